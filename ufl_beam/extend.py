# SPDX-License-Identifier: MIT
"""Base classes of laws, effects, schemes and recorders of your own; see docs/extending.md.

Example:
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Cubic(ub.extend.ConnectorLaw):
    ...     stiffness: float  # N/m³
    ...     def energy(self, motion, state):
    ...         return self.stiffness * motion**4 / 4
    >>> stop = ub.Slide(ub.ground(2, 0), beam.end, Cubic(1e9), axis=(0, 1))
"""

from ufl_beam.blocks.statement import Equations, Statement
from ufl_beam.mechanics.time_scheme import Coefficients, DynamicScheme, Scheme, Step
from ufl_beam.mechanics.time_schemes import EnergyMomentumBase, MidpointDynamics
from ufl_beam.model import law_functions
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.joints import Joint
from ufl_beam.model.material_law import MaterialLaw
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.output.recorder import Recorder

__all__ = [
    "Coefficients", "ConnectorLaw", "DynamicScheme", "EnergyMomentumBase", "Equations", "Joint",
    "MaterialLaw", "MidpointDynamics", "Recorder", "Scheme", "SofteningLaw", "Statement", "Step",
    "law_functions",
]  # fmt: skip
