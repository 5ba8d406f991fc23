# SPDX-License-Identifier: MIT
"""Laws of material points, compiled for the return map in C.

The laws are traced with UFL symbols: UFL derives the consistent tangents, by the implicit function
theorem where a discontinuity opens, and FFCx compiles them.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import ufl
from ufl.conditional import Condition
from ufl.core.expr import Expr

from ufl_beam.compiled.c_library import ffi, in_order
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model import law_functions
from ufl_beam.model.fibres import Kind
from ufl_beam.model.material_laws import SofteningLaw
from ufl_beam.terms.point_equations import End, PointEquations, prefixed, rows

law_functions.where.register(Condition, ufl.conditional)
law_functions.below.register(Expr, ufl.lt)
law_functions.exp.register(Expr, ufl.exp)
law_functions.sqrt.register(Expr, ufl.sqrt)
law_functions.log.register(Expr, ufl.ln)
law_functions.tanh.register(Expr, ufl.tanh)


class PointForms:
    """Compiled laws: C functions from the inputs of a point to what the loops need.

    The numbers of ``softening`` do not matter: they are inputs.

    Attributes:
        law: Stresses and their derivatives by strains; of a law that solves for its variables
            residuals and their derivatives, then stresses and theirs, see solve_law in C.
        resistance: That of the discontinuity, and its derivative by the growth.
        end: ``point_output`` of loops.h, stresses, and changes of the variables.
        own: What a law that must dissipate does by itself, and the size of that; or null.
    """

    def __init__(
        self, inputs: tuple[str, ...], kind: Kind, softening: SofteningLaw | None, scheme: Scheme
    ) -> None:
        self._pointwise = pointwise = Pointwise(inputs)
        self._equations = equations = PointEquations(kind, softening, scheme)
        law = kind.law
        self._strains = rows(law, "strain")
        unknown = prefixed("new", law.variables) if law.solves else ()
        free = {name: ufl.variable(pointwise.at[name]) for name in (*self._strains, *unknown)}
        self._at = at = {**pointwise.at, **free}
        try:
            stress = tuple(map(ufl.as_ufl, equations.stress(at)))
            answer = [*stress, *self._derivatives(stress, self._strains)]
            if law.solves:
                r = tuple(map(ufl.as_ufl, equations.residuals(at)))
                by_both = [self._derivatives(r, names) for names in (unknown, self._strains)]
                answer = [
                    *r,
                    *by_both[0],
                    *by_both[1],
                    *answer,
                    *self._derivatives(stress, unknown),
                ]
            *numbers, stress, changes = equations.end(at)
            self.own = ffi.NULL
            if law.must_dissipate:
                stored = ufl.as_ufl(equations.stored(at))
                slopes = tuple(self._derivatives((stored,), unknown))
                self.own = pointwise.compile(*equations.own_dissipation(at, slopes))
        except Exception as error:
            raise SceneError(
                f"{type(law).__name__}: it cannot be called with symbols of UFL: {error}. Laws are "
                "written with + - * / ** and the functions of ub.law_functions"
            ) from error
        self.law = pointwise.compile(*answer)
        end = in_order("point_output", dict(zip(End._fields, numbers, strict=False)))
        self.end = pointwise.compile(*end, *stress, *changes)
        self.resistance = ffi.NULL
        if softening is not None:
            a = ufl.variable(pointwise.at["growth"])
            resistance = equations.resistance({**pointwise.at, "growth": a}, a)
            self.resistance = pointwise.compile(resistance, ufl.diff(resistance, a))

    @cached_property
    def elastic(self) -> Any:
        """Stresses and their derivatives by strains while the variables stay as they are."""
        stress = tuple(map(ufl.as_ufl, self._equations.elastic_stress(self._at)))
        return self._pointwise.compile(*stress, *self._derivatives(stress, self._strains))

    def _derivatives(self, of: tuple[Expr, ...], by: tuple[str, ...]) -> list[Expr]:
        """Derivatives, one row of each function."""
        return [ufl.diff(f, self._at[name]) for f in of for name in by]


point_forms = stated(PointForms)
