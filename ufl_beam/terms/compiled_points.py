# SPDX-License-Identifier: MIT
"""Material points whose return map runs in C, compiled from the statement of the laws.

The laws are traced with UFL symbols: UFL derives the consistent tangents, by the implicit function
theorem where a discontinuity opens, FFCx compiles them, and a loop in C goes over the points.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import ufl
from ufl.conditional import Condition
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import ffi, fill, in_order, lib, struct
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.point_equations import End, PointEquations, inputs, prefixed, rows
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model import law_functions
from ufl_beam.model.fibres import Kind
from ufl_beam.model.material_laws import SofteningLaw
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.material_points import Points

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


_point_forms = stated(PointForms)


class CompiledPoints(Points):
    """Points whose response and commitment are loops in C, see material_points.c.

    Attributes:
        points: What the loops take, see loops.h.
    """

    def _prepare(self, scheme: Scheme, length: Array) -> None:
        layout, law = self._layout, self._layout.kind.law
        softening = layout.softening and layout.softening.of(1.0, 1.0)
        self._forms = forms = _point_forms(inputs(layout), layout.kind, softening, scheme)
        self._solves, self._dynamic = law.solves, has_inertia(scheme)
        arrays = {"B": layout.strains, "weight": layout.weights, "rest": layout.rest}
        arrays = {k: np.ascontiguousarray(x, np.float64) for k, x in arrays.items()}
        cells, of_cell, width = self._storage.shape
        self.points = struct(
            "points", cells=cells, of_cell=of_cell, width=width, w=self._storage,
            theta=scheme.theta, length=np.ascontiguousarray(length), **arrays,
            law=forms.law, resistance=forms.resistance, end=forms.end, solves=law.solves,
            components=self._components, variables=len(law.variables),
            strain=inputs(layout).index(rows(law, "strain")[0]),
            e0=self._e0, e1=self.strains, r=self.r, D=self.D, kept=self.kept, sum=self.sums,
            own=forms.own, over=self.over, unlike=np.zeros(3), search=self._search.flags,
        )  # fmt: skip

    @property
    def in_c(self) -> dict[str, Any]:
        """The points, by their name in the structs of loops.h."""
        return {"points": self.points}

    def begin(self, dt: float) -> None:
        """Begin a step of this length; s."""
        super().begin(dt)
        if self._solves:
            self.points.tried = 0

    def predict(self) -> None:
        """Let tangents predict stresses where points yield, see follow_prediction in C."""
        if self._components == 1 and self._yields:
            lines = np.zeros((2, *self._storage.shape[:2], int(lib.LINE)))
            fill(self.points, line=lines[0], predicted=lines[1])

    def respond(self, strains: Array) -> tuple[Array, Array]:
        """Answer strains, whatever the last tangent predicts."""
        self.points.predicts, self.points.linear = 0, ffi.NULL
        self.strains[:] = strains
        lib.respond(self.points)
        return self.r, self.D

    def release(self, least: float) -> None:
        """Let held points open from now on whose excess was so large in the latest response."""
        lib.release(self.points, least)

    def gives_energy(self) -> int:
        """Number of the point that gives most energy in the latest response, or -1."""
        return int(lib.gives_energy(self.points))

    def accept(self) -> None:
        """Take the strains of the latest response as the new state."""
        lib.commit(self.points)

    def _let_stay(self) -> None:
        """Let the variables of the bulk stay as they are from now on."""
        self.points.law, self.points.solves = self._forms.elastic, False

    def _sums_to_come(self) -> Array:
        """Return :attr:`sums` as :meth:`accept` would leave them."""
        copy = self._copy()
        lib.commit(copy)
        return np.frombuffer(ffi.buffer(copy.sum, self.sums.nbytes)).copy()

    def in_steps(self, ledger: Ledger) -> dict[str, Any]:
        """Fields of ``inelastic_term``; in statics a copy, which tells what a step would change."""
        copy = {} if self._dynamic else {"copy": self._copy()}
        return {**super().in_steps(ledger), **copy}

    def _copy(self) -> Any:
        """Points with a copy of the state, which loops may change, and the same response."""
        copy = ffi.new("points *", self.points[0])
        return fill(
            copy, e0=self._e0.copy(), w=self._storage.copy(), kept=self.kept.copy(),
            sum=self.sums.copy(),
        )  # fmt: skip
