# SPDX-License-Identifier: MIT
"""Simulations in which an acceleration is switched off.

Some have an option for that.  For the others, classes and functions of the package are replaced
while a simulation is built.
"""

from contextlib import ExitStack, contextmanager
from functools import cache
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

import ufl_beam as ub
from ufl_beam.blocks import block, material_points
from ufl_beam.blocks.statement import Kernels
from ufl_beam.compiled import c_library
from ufl_beam.compiled.jit import compiled
from ufl_beam.discretization import compiled_forms
from ufl_beam.simulation import stepper
from ufl_beam.simulation.stepper import Prediction
from ufl_beam.solvers import beam_elimination, newton
from ufl_beam.solvers.substructuring import Klu

plan = beam_elimination._plan


def one_by_one(_source, kernels, *_):
    """Replace `element_loops`: there is no loop over several cells at once."""
    return [None] * len(kernels)


def without_chains(cell_dofs, indptr, indices, alone, *more):
    """Chains of no vertices: the whole tangent remains for the fronts."""
    return plan(cell_dofs, indptr, indices, np.zeros_like(alone), *more)


def klu(inner, _):
    """Factor with KLU, called by PETSc, instead of fronts."""
    return Klu(inner)


class AtVelocity(Prediction):
    """Prediction that goes on at the velocity of the last step, without its acceleration."""

    def __init__(self, subdomain, q, weights, **options):
        super().__init__(subdomain, q, weights, **options)
        self.c.second = c_library.ffi.NULL


KEEPS = "if (iteration > !e->product && !kept"
"""Where newton.c lets the tangent of the last iterate do."""


@cache
def without_kept_tangents():
    """Newton's method of newton.c, compiled to make a tangent in every iteration; its address."""
    assert c_library._SOURCE.count(KEEPS) == 1
    source = c_library._SOURCE.replace(KEEPS, KEEPS.replace("(", "(0 && ", 1))
    declarations = c_library.DECLARATIONS + c_library._CALLBACKS
    other = compiled(
        "ufl_beam_tangents",
        declarations,
        lambda: source,
        depends_on=[source],
        flags=c_library.FLAGS,
    )
    for name, field in other.ffi.typeof("petsc_functions").fields:
        address = int(c_library.ffi.cast("intptr_t", getattr(c_library.lib.petsc, name)))
        setattr(other.lib.petsc, name, other.ffi.cast(field.type, address))
    return int(other.ffi.cast("intptr_t", other.ffi.addressof(other.lib, "snes_newton")))


def loop_without_kept_tangents(name, data):
    """Do what :func:`c_library.loop` does, but for Newton's method."""
    function, data = c_library.loop(name, data)
    if name == "snes_newton":
        ffi = c_library.ffi
        function = ffi.cast(ffi.typeof(function), without_kept_tangents())
    return function, data


class Variant(NamedTuple):
    """What is replaced while a simulation is built, and options of Newton's method."""

    replaced: tuple[tuple[Any, str, Any], ...] = ()
    newton: dict[str, Any] = {}  # noqa: RUF012 - of a tuple, which nothing changes

    @contextmanager
    def switched(self):
        """Replace what is to be replaced."""
        with ExitStack() as stack:
            for where, name, new in self.replaced:
                stack.enter_context(patch.object(where, name, new))
            yield

    def simulation(self, scene):
        """A simulation of a scene."""
        with self.switched():
            return ub.Simulation(scene, ub.EnergyMomentum(), newton=ub.Newton(**self.newton))


# Besides the loops, caches of what has been compiled with them
CELL_BY_CELL = (compiled_forms, "element_loops", one_by_one), (block, "kernels", Kernels)
POINT_BY_POINT = (
    (compiled_forms, "point_loop", lambda *_: None),
    (material_points, "_point_forms", material_points.PointForms),
)
NO_CHAINS = (beam_elimination, "_plan", without_chains)
NO_FRONTS = (beam_elimination, "Multifrontal", klu)
ALL_TANGENTS = (newton, "loop", loop_without_kept_tangents)
AT_VELOCITY = (stepper, "Prediction", AtVelocity)

SHIPPED, PETSC = "as shipped", "PETSc's `newtonls`"
SCALAR, WHOLE = "cell by cell", "fronts of the whole tangent"
LEFT = "KLU instead of fronts"
TANGENTS, VELOCITY = "a tangent in each iteration", "guess at the last velocity"

VARIANTS = {
    SHIPPED: Variant(),
    PETSC: Variant(newton={"petsc": {"snes_type": "newtonls"}}),
    SCALAR: Variant((*CELL_BY_CELL, *POINT_BY_POINT)),
    WHOLE: Variant((NO_CHAINS,)),
    LEFT: Variant((NO_FRONTS,)),
    TANGENTS: Variant((ALL_TANGENTS,)),
    VELOCITY: Variant((AT_VELOCITY,)),
}
"""Variants of a simulation by name."""
