# SPDX-License-Identifier: MIT
"""Material points: return map, internal variables, stored and dissipated energies.

The laws are evaluated with UFL symbols, UFL computes their derivatives, and FFCx compiles both.
The return map in material_points.c is a loop over the points that calls the compiled laws.  The
tangents of opening discontinuities, and of laws that solve for their variables, follow from the
implicit function theorem.

With strong softening a step has two solutions: a hinge stays closed or opens.  A rule chooses
between them.  A hinge, a crack of a fibre or a softening spring that did not open further in the
last step stays closed if an equilibrium exists in which its stress is at most its limit.  If
several points exceed their limits, the point with the largest excess opens first.  The others open
only if they still exceed their limits afterwards.

Rigid-plastic connectors follow the same rule.  A connector law whose sliding force is below its
limit may also have two solutions: it continues to stick, or to slide, if such an equilibrium
exists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, cached_property
from typing import Any

import numpy as np
import ufl
from ufl.conditional import Condition
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.statement import Inputs, expanded
from ufl_beam.compiled.c_library import doubles, ffi, fill, in_order, lib, loop, names, struct
from ufl_beam.compiled.keys import key_of
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.compiled_forms import (
    Pointwise,
    Stated,
    cached_forms,
    compiled_functions,
    with_shared_nodes,
)
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.point_equations import At, PointEquations, curved, inputs, prefixed, rows
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model import law_functions
from ufl_beam.model.fibres import Kind, SectionPoints
from ufl_beam.model.law_functions import absolute
from ufl_beam.model.material_law import traced
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.terms.derivatives import Neighbours, margins
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Phases


@law_functions.where.register(Condition)
def _conditional(condition: Condition, yes: Any, no: Any) -> Expr:
    """Return UFL's conditional; FFCx would compute with whole numbers as C does, 1/2 = 0."""
    numbers = (float(x) if isinstance(x, int) else x for x in (yes, no))
    return ufl.conditional(condition, *numbers)


law_functions.below.register(Expr, ufl.lt)
law_functions.exp.register(Expr, ufl.exp)
law_functions.sqrt.register(Expr, ufl.sqrt)
law_functions.log.register(Expr, ufl.ln)
law_functions.tanh.register(Expr, ufl.tanh)

DIGITS = 16 * float(np.finfo(float).eps)
"""Round-off of plastic dissipation, as a fraction of the sum of C e² over points and step ends."""

EXHAUSTED = 1e-6
"""Resistance, as a fraction of the limit, up to which modal analysis treats a hinge as a joint.

At this resistance an exponential law has the same fraction of its fracture energy left.
"""

FIXED = "growth", "direction", "flows", "theta", "dt"
"""Inputs of a point that parameters do not change directly."""

FREED_STIFFNESS = 1e-30
"""Factor of the stiffness of such a hinge; the frequency of its motion is zero to round-off."""


def entries(section_points: SectionPoints, scheme: Scheme) -> dict[str, tuple[str, str]]:
    """Return accounts and names in the ledger of energies, by their name in ``point_output``.

    Schemes with forces over the step have two losses besides the loss by ``alpha``.  A point that
    breaks loses the energy of its stress at the end of the step.  In nonlinear elasticity the work
    of the stress at t_n+θ differs from the change of the energy.
    """
    softens, found = section_points.softening is not None, dict[str, tuple[str, str]]()
    if section_points.yields:
        found = {"hardening": ("state", "hardening"), "worked": ("lost", "plastic")}
    if softens:
        found["broken"] = "lost", "hinges"
    if scheme.alpha:
        found["lost"] = "lost", "numerical"
    if scheme.average(0.0, 1.0) != 1.0 and (softens or curved(section_points.kind)):
        found["released"] = "lost", "numerical"
    return found


def create_entries(section_points: SectionPoints, scheme: Scheme, ledger: Ledger) -> None:
    """Create the entries of the ledger that points of a layout write.

    Every process calls this function, even without such points, so that all ledgers have the same
    entries in the same order.
    """
    for account, name in entries(section_points, scheme).values():
        getattr(ledger, account)[name] += 0.0


PointTable = tuple[Any, list[str], Sequence[int]]


class PointForms:
    """C functions of the inputs of a point, compiled from its laws.

    The parameters of ``softening`` are inputs, so their values do not matter here.

    Attributes:
        law: Stresses and their derivatives with respect to strains.  A law that solves for its
            variables has more outputs, see improve_sized in material_laws.c.
        resistance: Resistance of the discontinuity, and its derivative with respect to the growth.
        end: ``point_output`` of loops.h, the new state, and stresses.
        own: Dissipation of a law that must dissipate, and the size of its terms; else null.
    """

    def __init__(
        self, inputs: tuple[str, ...], kind: Kind, softening: SofteningLaw | None, scheme: Scheme
    ) -> None:
        self._arguments = inputs, kind, softening, scheme
        self._pointwise = pointwise = Pointwise(inputs)
        self._kind, self._softening = kind, softening
        self._equations = equations = PointEquations(kind, softening, scheme)
        law = kind.law
        self._strains = rows(law, "strain")
        unknown = prefixed("new", law.variables) if law.solves else ()
        free = {name: ufl.variable(pointwise.at[name]) for name in (*self._strains, *unknown)}
        self._at = at = {**pointwise.at, **free}
        self.resistance = ffi.NULL
        if softening is not None:
            with traced(softening):
                a = ufl.variable(pointwise.at["growth"])
                resistance = equations.resistance({**pointwise.at, "growth": a}, a)
                slope = ufl.diff(resistance, a)
            self.resistance = pointwise.compile(resistance, slope)
        with traced(law):
            stress = tuple(map(ufl.as_ufl, equations.stress(at)))
            outputs = [*stress, *self._derivatives(stress, self._strains)]
            if law.solves:
                r = tuple(map(ufl.as_ufl, equations.residuals(at)))
                outputs = [
                    *r,
                    *self._derivatives(r, unknown),
                    *self._derivatives(r, self._strains),
                    *outputs,
                    *self._derivatives(stress, unknown),
                ]
            end = self._at_end(at)
            self.own = ffi.NULL
            if law.must_dissipate:
                stored = ufl.as_ufl(equations.stored(at))
                slopes = tuple(self._derivatives((stored,), unknown))
                self.own = pointwise.compile(*equations.own_dissipation(at, slopes))
        self.law = pointwise.compile(*outputs)
        self.end = pointwise.compile(*end)
        self._outputs = outputs, end

    def _at_end(self, at: At) -> list[Expr]:
        """Return energies, the new state, and stresses at the end of a step."""
        end = self._equations.end(at)
        energies = in_order("point_output", {x: getattr(end, x) for x in names("point_output")})
        state = end.traction, end.jump, end.opening, *end.variables
        return [*map(ufl.as_ufl, (*energies, *state, *end.stress))]

    @cached_property
    def loops(self) -> dict[str, Any]:
        """Loops over points, which may be null, and space for the answers of one point.

        In statics, respond in material_points.c asks the law twice.
        """
        law, end = self._outputs
        iterates = self._equations.law(self._at).solves
        return {
            "law_loop": ffi.NULL if iterates else self._pointwise.compile_loop(*law),
            "end_loop": self._pointwise.compile_loop(*end),
            "answers": np.zeros(max(2 * len(law), len(end))),
        }

    @cache  # noqa: B019 - forms are kept in a cache of their own
    def table(self, shapes: bool, m: int) -> PointTable:
        """Derivatives of the resultants of a section by its strains and all numbers of a point.

        Args:
            shapes: Whether parameters change strains or weights of points, the shape of a section.
            m: Number of strains of a section.

        Returns:
            An ``element_function`` of loops.h; names of its inputs; numbers of states, numbers,
            unknowns and margins, see ``point_derivatives`` there.
        """

        def state() -> Stated:
            equations, law = self._equations, self._kind.law
            strain, before = (rows(law, name) for name in ("strain", "before"))
            new = prefixed("new", law.variables) if law.solves else ()
            softens, of_jump = self._softening is not None, ("traction", "jump", "opening")
            states = [*of_jump * softens, *prefixed("state", law.variables)]
            modes = [*FIXED, *strain, *before, *new, *(() if softens else of_jump)]
            B = [f"B {a}{k}" for a in range(len(strain)) for k in range(m)]
            numbers = [name for name in self._pointwise.at if name not in (*states, *modes)]
            numbers += [f"rest {k}" for k in range(m)]
            (numbers if shapes else modes).extend([*B, "weight"])
            motions = [f"{e} {k}" for e in ("e1", "e0") for k in range(m)]
            compiler = Pointwise([*motions, *states, *numbers, *modes])
            at = Inputs(compiler, {name: ufl.variable(x) for name, x in compiler.at.items()})
            for e, own in (("e1", strain), ("e0", before)):
                for a, name in enumerate(own):
                    sums = sum(at[f"B {a}{k}"] * at[f"{e} {k}"] for k in range(m))
                    at[name] = at.stage(at[name], sums)
            with traced(law):
                stress = expanded(equations.stress(at))
                end, variables = self._at_end(at), equations.end(at).variables
                unknowns = expanded(equations.residuals(at)) if law.solves else []
            answers, of_opening = [*stress, *expanded(variables), *unknowns], list[Expr]()
            if self._softening is not None:
                with traced(self._softening):
                    resistance = equations.resistance(at, at["growth"])
                answers += expanded([excess := at["direction"] * stress[0] - resistance])
                opens = ufl.ne(at["direction"], 0.0)
                unknowns[:0] = [ufl.conditional(opens, excess, at["growth"])]
                distance = absolute(stress[0]) - at["traction"]
                of_opening = [ufl.conditional(opens, at["growth"], distance)]
            conditions = [*margins(with_shared_nodes(answers)), *of_opening]
            new_state = end[lib.POINT_OUTPUTS : -len(stress)][0 if softens else len(of_jump) :]
            σ, θ = [at.stage(x) for x in stress], at["theta"]
            resultants = [
                at[f"rest {k}"] * ((1 - θ) * at[f"e0 {k}"] + θ * at[f"e1 {k}"])
                + at["weight"] * sum(x * at[f"B {a}{k}"] for a, x in enumerate(σ))
                for k in range(m)
            ]
            outputs = expanded([*resultants, *new_state, *conditions, *unknowns])
            inputs = [*motions, *states, *numbers, *["growth"] * softens, *new]
            counts = len(states), len(numbers), len(unknowns), len(conditions)
            return Stated(
                compiler, [[*at.slopes(outputs, inputs), *conditions]],
                [[*compiler.at], counts], at.values_of_stages,
            )  # fmt: skip

        key = key_of("points", *self._arguments, shapes, m)
        (function,), (names, counts) = compiled_functions(key, state)
        return function, names, counts

    @cached_property
    def elastic(self) -> Any:
        """Stresses and their derivatives with respect to strains at constant variables."""
        stress = tuple(map(ufl.as_ufl, self._equations.elastic_stress(self._at)))
        return self._pointwise.compile(*stress, *self._derivatives(stress, self._strains))

    def _derivatives(self, functions: tuple[Expr, ...], by: tuple[str, ...]) -> list[Expr]:
        """Return derivatives with respect to the inputs ``by``, one function after the other."""
        return [ufl.diff(f, self._at[name]) for f in functions for name in by]


_point_forms = cached_forms(PointForms)


class Points:
    """Material points of many cells whose sections have the same points.

    A cell of degree p counts as p cells here, one for each of its Gauss points.  The length of each
    is the Gauss weight times the length of the cell.

    Args:
        section_points: The points of a cell.
        keys: Keys of the cells for random values, see :meth:`SectionPoints.parameters`.
        length: Lengths of the cells; (cells,); m.
        scheme: The time scheme.
        search: Flags of the present search for an equilibrium, which all points and connectors of
            a scene share, see loops.h; (SEARCH_FLAGS,).
        predicts: True if tangents predict stresses of yielding points with one strain component,
            see follow_prediction in material_points.c.

    Attributes:
        c: ``points`` of loops.h.
        names: Names of the inputs of a point.
        strains: Strains of the cells in the latest response; (cells, 3); 1, 1, 1/m; in space
            (cells, 6).
        r, D: The latest response, see :meth:`return_map`.
        softens: True if points may break.
        must_dissipate: True if a law must not give energy.
        over: Largest ``|stress| / limit - 1`` of the points that the latest response has held
            closed, at least zero; (1,).
        damped: Block of damped cells, whose first numbers are the derivatives of (N, V, M) in the
            accepted state by the strains, with negative eigenvalues set to zero; they are NaN until
            :meth:`start_tangents`.  None if there is no such damping.
        recorded: For each cell: (N, V, M) in the accepted state, the jump of the last point, and
            the energies that plastic strains and discontinuities have dissipated since the
            beginning; (cells, 6), in space (cells, 9); N, N, N m, rad or m, J, J.
        sums: Sums of ``point_output`` of loops.h over all cells, in the last step; J.
    """

    def __init__(
        self,
        section_points: SectionPoints,
        keys: Sequence[tuple[int, ...]],
        length: Array,
        scheme: Scheme,
        search: Index | None = None,
        *,
        predicts: bool = False,
    ) -> None:
        self._search: Index = np.zeros(lib.SEARCH_FLAGS, np.int32) if search is None else search
        self._section_points, self._alpha = section_points, scheme.alpha
        self._yields, self.softens = section_points.yields, section_points.softening is not None
        self._entries = entries(section_points, scheme)
        self.must_dissipate = section_points.kind.law.must_dissipate
        self.names, law = inputs(section_points), section_points.kind.law
        cells, per_cell, width = len(length), len(section_points.weights), len(self.names)
        m = len(section_points.rest)
        n = cells * per_cell
        self._padded = np.zeros((-(-n // BATCH) * BATCH, width))
        self._storage = storage = self._padded[:n].reshape(cells, per_cell, width)
        self._at = {name: storage[:, :, i] for i, name in enumerate(self.names)}
        # Internal variables, and further data of an accepted state for the next step
        others = ("jump", "opening", *rows(law, "before"), "traction", "flows")
        self._state_names = (*prefixed("state", law.variables), *others)
        self._components = len(law.resultants or "x")
        softening = section_points.softening and section_points.softening.kind()
        self._equations = PointEquations(section_points.kind, softening, scheme)
        stiffness = np.reshape(section_points.stiffness, (len(section_points.weights), -1)).T
        for name, value in zip(rows(law, "stiffness"), stiffness, strict=True):
            self._at[name][:] = value
        for name, value in section_points.parameters(keys).items():
            self._at[f"number {name}"][:] = value
        for name, initial in law.variables.items():
            self._at[f"state {name}"][:] = initial
        self._at["length"][:] = length[:, None]
        self._at["theta"][:] = scheme.theta
        self._at["dt"][:] = 1.0
        self._at["traction"][:] = np.inf
        if section_points.softening is not None:
            for name, value in section_points.softening.parameters().items():
                self._at[f"softening {name}"][:] = value
            self._update_resistance()

        self.recorded = np.zeros((cells, m + int(lib.POINT_KEPT)))
        self.sums = np.zeros(int(lib.POINT_OUTPUTS))
        self.r, self.D = np.zeros((cells, m)), np.zeros((cells, m * m))
        self._e0, self.strains = np.zeros((2, cells, m))
        self.over = np.zeros(1)
        self.damped: Any = None

        self._forms = forms = _point_forms(self.names, section_points.kind, softening, scheme)
        arrays = {
            "B": section_points.strains,
            "weight": section_points.weights,
            "rest": section_points.rest,
        }
        arrays = {k: np.ascontiguousarray(x, np.float64) for k, x in arrays.items()}
        self.c = struct(
            "points", cells=cells, of_cell=per_cell, width=width, strains=m, w=storage,
            theta=scheme.theta, length=np.ascontiguousarray(length), **arrays,
            law=forms.law, resistance=forms.resistance, end=forms.end, solves=law.solves,
            components=self._components, variables=len(law.variables),
            strain=self.names.index(rows(law, "strain")[0]),
            e0=self._e0, e1=self.strains, r=self.r, D=self.D, kept=self.recorded, sum=self.sums,
            own=forms.own, over=self.over, unlike=np.zeros(m), search=self._search,
        )  # fmt: skip
        if per_cell >= BATCH:
            fill(self.c, **forms.loops | {"answers": np.tile(forms.loops["answers"], per_cell)})
        if predicts and self._components == 1 and self._yields:
            lines = np.zeros((2, cells, per_cell, int(lib.LINE)))
            fill(self.c, line=lines[0], predicted=lines[1])

    def derivatives(self, neighbours: Neighbours) -> Any:
        """Return ``point_derivatives`` of loops.h for terms with ``points``."""
        (cells, per_cell, _), P, m = self._storage.shape, len(neighbours), self.r.shape[1]

        def shape_of(term: Any) -> Array:
            of = term.points._section_points
            return np.hstack([np.reshape(of.strains, (per_cell, -1)), of.weights[:, None]])

        shape = shape_of(neighbours.term)
        shapes = neighbours.change(shape_of)
        function, inputs, (states, numbers, unknowns, conditions) = self._forms.table(shapes, m)
        n, columns = cells * per_cell, 2 * m + states + numbers
        place = {name: k for k, name in enumerate(self.names)}
        column = np.array([place.get(name, -1) for name in inputs], dtype=np.int32)
        adjacent = slice(first := column[2 * m], first + states)
        of_w = column[(own := slice(2 * m + states, columns))][column[own] >= 0]

        def numbers_of(term: Any) -> Array:
            points = term.points
            rest = np.tile(points._section_points.rest / per_cell, (per_cell, 1))
            tiled = np.tile(np.hstack([rest, shape_of(term)]) if shapes else rest, (cells, 1))
            return in_batches(np.hstack([points._storage[:, :, of_w].reshape(n, -1), tiled]), BATCH)

        def states_of(term: Any) -> Array:
            """Return a view, which users of the derivatives change."""
            rows = term.points._padded.reshape(-1, BATCH, len(self.names))
            return np.asarray(rows[:, :, adjacent].transpose(0, 2, 1))

        by_number, none = neighbours.differences(numbers_of), np.zeros(0)
        by_state, known = neighbours.state(states_of), numbers_of(neighbours.term)
        w = np.zeros((batches := len(known), len(inputs), BATCH))
        w[:, own] = known
        geometry = inputs.index("B 00")
        given = slice(geometry, geometry + shape.shape[1])
        w[:, given] = in_batches(np.tile(shape, (cells, 1)), BATCH)
        changes = np.ones((P, columns), dtype=np.int32)
        changes[:, own] = by_number.any(axis=(1, 3))
        dofs = m * (np.arange(n)[:, None] // per_cell) + np.arange(m)
        block = struct(
            "element_block", lanes=BATCH, elements=n, batches=batches, unknowns=m, states=states,
            numbers=numbers, modes=len(inputs) - columns, width=len(inputs), w=w,
            acting=np.full(1, batches, dtype=np.int32), batch=np.arange(batches, dtype=np.int32),
            dofs=in_batches(dofs.astype(np.int32), BATCH),
            space=np.zeros(2 * len(inputs) + function.outputs), new_shared=none,
        )  # fmt: skip
        of = struct(
            "block_derivatives", block=block, parameters=P, margins=conditions, unknowns=unknowns,
            table_of=function, table=np.zeros(batches * function.outputs * BATCH), changes=changes,
            direction=np.zeros(columns * max(unknowns, BATCH)), by_state=by_state,
            by_number=by_number, state_bar=np.zeros(by_state.shape[1:]),
            number_bar=np.zeros(known.shape), step_bar=none, shared_bar=none, strain_bar=none,
        )  # fmt: skip
        c = struct(
            "point_derivatives", points=self.c, of=of, column=column, geometry=geometry,
            rest=inputs.index("rest 0"),
            e0=neighbours.state(lambda term: term.points._e0), e1=np.zeros((P, cells, m)),
            r=np.zeros((cells, m)), e0_bar=np.zeros((cells, m)), e1_bar=np.zeros((cells, m)),
            r_bar=np.zeros((cells, m)),
        )  # fmt: skip
        self._derivatives = c
        return c

    def complete_derivatives(self, c: Any, neighbours: Neighbours) -> None:
        """Let C differentiate tangents for damping; ``c``: derivatives of the damped cells."""
        # An eighth of the neighbours' distance: near the scene, and 1e-12 of round-off
        step, of = 1 / (8 * np.abs(neighbours.weights).max(axis=1)), self._derivatives.of.block
        inputs = np.zeros(of.elements * (of.width - of.modes))
        fill(
            self._derivatives, tangents=c.by_number, step=step, tangents_bar=c.number_bar,
            input_bar=inputs,
        )  # fmt: skip

    def __getitem__(self, name: str) -> Array:
        """Return a view of the values of the input ``name`` at the points; (cells, n)."""
        return self._at[name]

    def _rows(self, name: str) -> tuple[str, ...]:
        """Return the names of the components of a strain or stiffness."""
        return rows(self._section_points.kind.law, name)

    def _at_points(self, strains: Array) -> tuple[Array, ...]:
        """Return each strain component of the points, (cells, n), from strains of the cells."""
        d = self._components
        return tuple(strains @ self._section_points.strains[k::d].T for k in range(d))

    def _update_resistance(self) -> None:
        """Set the resistance of discontinuities to its value at their accumulated openings."""
        softening, breaking = self._section_points.softening, self._section_points.breaking
        if softening is not None:
            self["traction"][:, breaking] = softening.traction(self["opening"][:, breaking])

    # -- the step ------------------------------------------------------------------------------

    def start(self, strains: Array) -> None:
        """Replace the accepted strains of the cells by ``strains``; (cells, 3); 1, 1, 1/m."""
        self._e0[:] = strains
        for name, values in zip(self._rows("before"), self._at_points(strains), strict=True):
            self[name][:] = values
        self._update_resistance()

    def begin(self, dt: float) -> None:
        """Begin a step of length ``dt``; s."""
        self["dt"][:] = dt
        self.c.tried = 0  # a law that solves for its variables has no iterate to start from

    def return_map(self, strains: Array) -> tuple[Array, Array]:
        """Return (N, V, M) in a step to ``strains``, and derivatives; (cells, 3), (cells, 9).

        Both are NaN in a cell where no solution for an opening or for the variables of a law is
        found.  Later calls overwrite the arrays.  Predictions of the last tangent are ignored.
        """
        self.c.predicts, self.c.linear = 0, ffi.NULL
        self.strains[:] = strains
        lib.respond(self.c)
        return self.r, self.D

    def tangent(self) -> tuple[Array, Array]:
        """Return the accepted strains, and the tangents in a step that does not change them.

        The shapes are (cells, 3) and (cells, 9).  The latest response is restored.
        """
        with self._unchanged():
            return self._e0.copy(), self.return_map(self._e0)[1].copy()

    @contextmanager
    def _unchanged(self) -> Iterator[None]:
        """Restore the latest response at the end of a ``with`` block."""
        arrays = self._storage, self.strains, self.r, self.D, self._search
        before = [array.copy() for array in arrays]
        try:
            yield
        finally:
            for array, values in zip(arrays, before, strict=True):
                array[:] = values

    def keep_tangents(self, block: Any, **fields: Any) -> None:
        """Store tangents in :attr:`damped` after each step; ``fields`` are of ``points``."""
        self.damped = block
        fill(self.c, inputs=np.zeros(len(self.names)), **fields)

    def start_tangents(self) -> None:
        """Replace tangents for damping that are NaN by the elastic stiffness."""
        if self.damped is None:
            return
        known, law = self.damped.tangents, (self.c.law, self.c.law_loop, self.c.solves)
        with self._unchanged():
            self["traction"][:] = np.inf
            self.c.law, self.c.law_loop, self.c.solves = self._forms.elastic, ffi.NULL, False
            self.return_map(self._e0)
            lib.keep_tangents(self.c)
        self.c.law, self.c.law_loop, self.c.solves = law
        self.damped.set_tangents(np.where(np.isnan(known), self.damped.tangents, known))

    def works(self, change: Array) -> Array:
        """Return works of the tangent and of the elastic stiffness on strains; (2, cells).

        The tangent is the one of the latest response.  ``change`` has the shape (cells, 3).
        """
        section_points, theta = self._section_points, self["theta"][0, 0]
        elastic = theta * change**2 @ section_points.rest
        for name, by_point in zip(self._rows("stiffness"), self._at_points(change), strict=True):
            elastic += (theta * self[name] * by_point**2) @ section_points.weights
        D = self.D.reshape(len(change), change.shape[1], -1)
        now = np.einsum("ci,cij,cj->c", change, D, change)
        return np.array([now, elastic])

    def require_dissipation(self, describe: Callable[[int], str]) -> None:
        """Raise :class:`StepFailed` if a point generates energy; ``describe`` names its cell.

        The law then has a negative dissipation.  Either its equations have several solutions, of
        which the solver found an unphysical one; or it stores energy that it does not state.
        """
        if (worst := lib.gives_energy(self.c)) >= 0:
            law = type(self._section_points.kind.law).__name__
            raise StepFailed(
                f"{law} of {describe(worst // self._storage.shape[1])} has a negative dissipation "
                "in the step: its equations have several solutions, or it stores energy that it "
                "does not state. A law that is to give energy has active = True, see "
                "docs/extending_laws.md"
            )

    def accept(self) -> None:
        """Accept the strains of the latest response."""
        lib.end_points(self.c, self.c.sum, 1)

    def dissipation(self) -> float:
        """Return the energy that :meth:`accept` would add to the dissipated energies; J.

        A plastic dissipation within the round-off of the elastic energies counts as zero, because
        laws may compute it as a difference of energies.
        """
        lib.end_points(self.c, doubles(sums := np.zeros_like(self.sums)), 0)
        plastic, broken = sums[: lib.LOST]
        size, volume = 0.0, self._section_points.weights * self["length"]
        for C, *ends in zip(*map(self._rows, ("stiffness", "strain", "before")), strict=True):
            size += sum(float(np.sum(volume * self[C] * self[e] ** 2)) for e in ends)
        return float(broken + (plastic if abs(plastic) > DIGITS * size else 0.0))

    def freeze(self) -> None:
        """Make all points elastic from now on; discontinuities without resistance are free.

        Small vibrations about a yielded state unload its points elastically.
        """
        breaking, softening = self._section_points.breaking, self._section_points.softening
        if softening is not None:
            borne, limit = self["traction"][:, breaking], softening.limit
            spent = np.isfinite(limit) & (borne <= EXHAUSTED * limit)
            self["stiffness"][:, breaking] *= np.where(spent, FREED_STIFFNESS, 1.0)
        self["traction"][:] = np.inf
        self.c.law, self.c.law_loop, self.c.solves = self._forms.elastic, ffi.NULL, False
        if self.damped is not None:
            self.damped.set_tangents(np.full(self.damped.tangents.shape, np.nan))
            self.start_tangents()

    # -- the ledger ----------------------------------------------------------------------------

    def phases(self, block: Any, made: Phases, ledger: Ledger) -> Phases:
        """Add the points of ``element_block`` of loops.h to the functions of the block."""
        of = self._entries | {"elastic": ("state", "stored")}
        pointers = {x: getattr(ledger, account).pointer(y) for x, (account, y) in of.items()}
        entry = [pointers.get(name, ffi.NULL) for name in names("point_output")]
        fill(self.c, alpha=self._alpha, entry=entry)
        begin, accept, add = (
            loop(name, fill(block, inner=self.c))
            for name in ("begin_points", "accept_points", "add_energy_of_points")
        )
        dissipates = loop("points_dissipate", block) if self.must_dissipate else None
        return made._replace(
            begin=[*made.begin, begin], accept=[accept, *made.accept], add_state=[add],
            opens=block if self.softens else None, admits=dissipates, again=None,
        )  # fmt: skip

    # -- the state -----------------------------------------------------------------------------

    def state(self) -> Array:
        """Return a copy of variables, strains and energies of the accepted state; (cells, k)."""
        stored = np.zeros((len(self.recorded), 2))
        stored[:1] = self.sums[3:5]  # sums over all cells; any row may store them
        return np.hstack(
            [*(self[name] for name in self._state_names), self.recorded, self._e0, stored]
        )

    def restore(self, rows: Array) -> None:
        """Restore the variables of :meth:`state`.

        Call :meth:`start` and :meth:`refresh` afterwards if strains or laws differ from that state.
        """
        of_cell = self._storage.shape[1], self.recorded.shape[1], self._e0.shape[1]
        widths = [of_cell[0]] * len(self._state_names) + [*of_cell[1:]]
        *variables, recorded, e0, stored = np.split(rows, np.cumsum(widths), axis=1)
        for name, values in zip(self._state_names, variables, strict=True):
            self[name][:] = values
        self.recorded[:], self._e0[:] = recorded, e0
        self.sums[3:5] = stored.sum(axis=0)

    def refresh(self, strains: Array) -> None:
        """Compute (N, V, M) and stored energies at ``strains`` and the present variables."""
        section_points, length, law = (
            self._section_points,
            self["length"][:, :1],
            self._equations.law(self._at),
        )
        state, volume = self._equations.state(self._at), section_points.weights * length
        relieved = self["jump"] / self["length"]
        e = law.as_argument(tuple(x - relieved for x in self._at_points(strains)))
        resultants = self.recorded[:, : len(section_points.rest)]
        resultants[:] = section_points.rest * strains
        for k, stress in enumerate(law.as_tuple(law.stress(e, state))):
            forces = (section_points.weights * stress) @ section_points.strains[
                k :: self._components
            ]
            resultants += forces
        rest_energy = strains**2 @ section_points.rest / 2 * length[:, 0]
        self.sums[3] = np.sum(volume * law.elastic_energy(e, state)) + np.sum(rest_energy)
        self.sums[4] = np.sum(volume * law.hardening_energy(state))
