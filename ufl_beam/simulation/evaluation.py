# SPDX-License-Identifier: MIT
"""Two ways to evaluate the same equations: loops in C, or DOLFINx, NumPy and PETSc alone."""

from __future__ import annotations

from typing import NamedTuple

from ufl_beam.discretization.dolfinx_forms import SeparateCells
from ufl_beam.discretization.function_spaces import CompiledFields, Fields
from ufl_beam.solvers.direct_solver import DirectSolver
from ufl_beam.solvers.static_condensation import ChainsFirst
from ufl_beam.terms.compiled_points import CompiledPoints
from ufl_beam.terms.compiled_slips import CompiledSlips
from ufl_beam.terms.connectors import CompiledCouplings, Couplings, ReferenceCouplings
from ufl_beam.terms.inelastic_beams import (
    CompiledInelasticBeams,
    InelasticBeams,
    ReferenceInelasticBeams,
)
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.reference_points import ReferencePoints
from ufl_beam.terms.reference_slips import ReferenceSlips
from ufl_beam.terms.rigid_plastic import RigidPlasticResponse


class Classes(NamedTuple):
    """Classes that evaluate the same equations; satisfies :class:`Evaluation` of assembly.py."""

    fields: type[Fields]  # forms on cells
    points: type[Points]  # return map of material points
    inelastic: type[InelasticBeams]  # cells with such points
    couplings: type[Couplings]  # connectors
    slips: type[RigidPlasticResponse]  # plastic hinges of zero length
    factors: type[ChainsFirst] | type[DirectSolver]  # factorization of the tangent
    in_c: bool  # True if C may call the terms with no Python between them


COMPILED = Classes(
    CompiledFields, CompiledPoints, CompiledInelasticBeams, CompiledCouplings, CompiledSlips,
    ChainsFirst, True,
)  # fmt: skip
REFERENCE = Classes(
    SeparateCells, ReferencePoints, ReferenceInelasticBeams, ReferenceCouplings, ReferenceSlips,
    DirectSolver, False,
)  # fmt: skip
