# SPDX-License-Identifier: MIT
"""Statements of the forces inside beams: elastic cells, and cells with material points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime
from ufl_beam.blocks.cells import PointOfCell, StatementOnCell, added
from ufl_beam.blocks.material_points import Points
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import doubles, fill, lib, loop, struct
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.cell_functions import AXIS, STIFFNESS, Cell, axes
from ufl_beam.discretization.compiled_forms import inserted_cells
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.state_io import Archive
from ufl_beam.mechanics.functional import elastic_energy, virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.beams import Mesh
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.functions import value_at
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.terms.derivatives import Neighbours
from ufl_beam.terms.term import Callbacks, Phases

STRAINS = "Σ", "Γ", "K"
"""Strains of a section; 1, 1, 1/m."""


@dataclass(frozen=True)
class BeamCell(StatementOnCell):
    """Resultants (N, V, M) of the strains of a cell.

    In statics, nodes move along straight lines in an iteration, so rotating beams become longer
    than linearized strains predict.  In slender beams the axial forces of this error spoil the next
    iteration.  The residual has the resultants of the strains, and the tangent has the resultants
    of the linearized strains.  This is Newton's method for displacements and resultants as
    independent unknowns of the functional, with the resultants eliminated.  It converges in few
    iterations at any slenderness.

    Magisano, Leonetti and Garcea, Computer Methods in Applied Mechanics and Engineering 313 (2017).

    Attributes:
        scheme: Time scheme; its ``alpha`` is a number of the cells, and other values than 0 are
            alike.
        functions: Number of functions of time of imposed strains.
    """

    scheme: Scheme
    functions: int = 0

    inserts = True

    @property
    def static(self) -> bool:
        """True in statics, where tangents predict resultants."""
        return not has_inertia(self.scheme)

    @property
    def imposed(self) -> list[str]:
        """Names of the imposed strains of each function, the last numbers of a cell."""
        names = product(range(self.functions), range(self.degree), STRAINS)
        return [f"imposed{f} {k}{g}" for f, g, k in names]

    @property
    def of_step(self) -> list[str]:
        """Factors of imposed strains at the end of the step and before it."""
        return [f"{when}{f}" for f in range(self.functions) for when in ("now", "before")]

    @property
    def modes(self) -> list[str]:
        """In statics: motions at the latest tangent, and numbers of set_prediction in blocks.c."""
        return [*(f"about {x}" for x in self.unknowns), "moved", "reached"] if self.static else []

    def sections(self, at: Inputs) -> Iterator[SectionOfCell]:
        """Generate the sections at the Gauss points of the cell."""
        cell, mesh = Cell(self.degree, at), Mesh(degree=self.degree)
        for g, (s, weight) in enumerate(zip(mesh.points, mesh.point_weights, strict=True)):
            yield SectionOfCell(self, at, PointOfCell(cell, float(s)), g, float(weight))

    def work_on_imposed(self, before: Sequence[Expr], now: Sequence[Expr], imposed: Expr) -> Expr:
        """Return the work of resultants, given before and in the step, on imposed strains; J/m."""
        a, pairs = self.scheme.weight_of_before, zip(before, now, strict=True)
        return ufl.dot(ufl.as_vector([a * x + (1 - a) * y for x, y in pairs]), imposed)


class SectionOfCell:
    """Section at a Gauss point of a cell.

    Attributes:
        g: Index of the Gauss point.
        length: Length of the cell times the weight of the point; m.
        imposed: Change of the imposed strains in the step.
        e0, e1: Strains minus imposed strains, before the step and at its end.
        predicted: Strains minus imposed strains that the latest tangent predicts; None in dynamics.
    """

    def __init__(
        self, statement: BeamCell, at: Inputs, point: PointOfCell, g: int, weight: float
    ) -> None:
        self.g, self.length, self._at, self._point = g, weight * point.axis.h, at, point
        q0, q1 = (point.field(at, at.motions(group)) for group in ("q0", "q1"))
        before, now = (self._imposed(statement, when) for when in ("before", "now"))
        self.imposed, axis = now - before, point.axis
        self.e0, self.e1, self.predicted = strain(q0, axis) - before, strain(q1, axis) - now, None
        self._virtual_strain = statement.scheme.virtual_strain(q0, q1, point.virtual, axis)
        if statement.static:
            about, along = point.field(at, at.motions("about")), ufl.variable(ufl.as_ufl(0.0))
            e = strain(about + along * (q1 - about), axis) - before
            self.predicted = e + at["moved"] * ufl.diff(e, along) - at["reached"] * self.imposed

    def _imposed(self, statement: BeamCell, when: str) -> Expr:
        sums = ufl.zero(3)
        for f in range(statement.functions):
            strains = [self._at[f"imposed{f} {k}{self.g}"] for k in STRAINS]
            sums += self._at[f"{when}{f}"] * ufl.as_vector(strains)
        return sums

    def forces(self, resultants: Sequence[Expr]) -> list[Expr]:
        """Return the nodal forces of resultants (N, V, M)."""
        work = self.length * virtual_work(ufl.as_vector(resultants), self._virtual_strain)
        return self._point.forces(self._at, work)


@dataclass(frozen=True)
class ElasticCell(BeamCell):
    """Cell whose resultants are linear in its strains."""

    @property
    def numbers(self) -> list[str]:
        """Stiffnesses, the axis, "alpha", imposed strains."""
        return [*STIFFNESS, *AXIS, *["alpha"] * bool(self.scheme.alpha), *self.imposed]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        C = ufl.as_vector([at[name] for name in STIFFNESS])
        forces, on_imposed, stored, lost = list[list[Expr]](), 0, 0, 0
        for section in self.sections(at):
            e0, e1, length = section.e0, section.e1, section.length

            def resultants(e: Expr, e0: Expr = e0) -> list[Expr]:
                return [*self.scheme.resultants(C, e0, e, lambda _: at["alpha"])]

            own, predicted = resultants(e1), [None] * 3
            if section.predicted is not None:
                predicted = resultants(section.predicted)
            r = [at.stage(x, in_tangent=y) for x, y in zip(own, predicted, strict=True)]
            forces.append(section.forces(r))
            stored += length * elastic_energy(e1, C)
            if self.scheme.alpha:
                lost += length * 2 * at["alpha"] * elastic_energy(e1 - e0, C)  # P(90)
            on_imposed += length * self.work_on_imposed(resultants(e0), own, section.imposed)
        return Equations(
            added(forces), stored={"stored": stored},
            lost={"numerical": lost} if self.scheme.alpha else {},
            supplied={"loads": -on_imposed} if self.functions else {},
        )  # fmt: skip


@dataclass(frozen=True)
class InelasticCell(BeamCell):
    """Cell with material points, which map strains to resultants r and their derivatives D.

    r and D are modes.  Derivatives of the resultants at constant strains are those by "shift".
    """

    def _names(self, name: str, number: int = 3) -> list[str]:
        return [f"{name} {k}" for k in range(number * self.degree)]

    @property
    def numbers(self) -> list[str]:
        """Shifts, the axis, imposed strains."""
        return [*self._names("shift"), *AXIS, *self.imposed]

    @property
    def state(self) -> list[str]:
        """Resultants in the last step, if they do work on imposed strains in this step."""
        return self._names("before") if self.functions and self.scheme.weight_of_before else []

    @property
    def modes(self) -> list[str]:
        """Resultants r and their derivatives D; in statics also predicted resultants."""
        predicted = self._names("predicted") if self.static else []
        return [*super().modes, *predicted, *self._names("r"), *self._names("D", 9)]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        forces, on_imposed, strains, predicted = [], 0, [], []
        for section in self.sections(at):
            first, e, r = 3 * section.g, section.e1, list[Expr]()
            for k in range(first, first + 3):
                D = [at[f"D {3 * k + l}"] for l in range(3)]
                linear = at[f"shift {k}"] + sum((D[l] * e[l] for l in range(3)), 0)
                r.append(at.stage(at[f"r {k}"], linear, in_tangent=at.get(f"predicted {k}")))
            forces.append(section.forces(r))  # P(34)
            strains += [*e]
            predicted += [*section.predicted] if section.predicted is not None else []
            now = [at[f"r {k}"] for k in range(first, first + 3)]
            before = [at[f"before {k}"] for k in range(first, first + 3)] if self.state else now
            on_imposed += section.length * self.work_on_imposed(before, now, section.imposed)
        return Equations(
            added(forces), state={f"before {k}": at[f"r {k}"] for k in range(len(self.state))},
            supplied={"loads": -on_imposed} if self.functions else {},
            strains=strains, predicted=predicted,
        )  # fmt: skip


class BeamCells(Block):
    """Elastic cells of beams.

    Attributes:
        name: Name of the block.
        fields: The cells.
        prediction: ``predicted_forces`` of loops.h in statics; else None.
    """

    statement: BeamCell

    def __init__(
        self, statement: BeamCell, name: str, fields: Fields, setting: BlockSetting,
        strains: Sequence[ImposedStrain], numbers: Sequence[Array],
    ) -> None:  # fmt: skip
        in_time, imposed = imposed_strains(fields, strains)
        elements = Elements(
            name, fields.subdomain.cells[fields.order], fields.cell_dofs, [*numbers, *imposed],
            in_time, dict(zip(statement.of_step, range(len(in_time)), strict=False)),
            cells=fields.order, force_kind=lib.STRESS,
        )  # fmt: skip
        super().__init__(statement, elements, setting, kind="beams")
        self.name, self.fields, self.prediction = name, fields, None
        if not has_inertia(setting.scheme):
            self.prediction = struct("predicted_forces", in_space=setting.scene.in_space)
            fill(self._c, predicted=self.prediction)
            self.loops = self.loops[0], loop("add_predicted_tangent", self._c)
        else:
            for k, (function, owner, when) in enumerate(elements.in_time):
                if when == "moving" and function is not None:
                    self._times[2, k] = value_at(function, setting.t0, owner)

    @property
    def imposed(self) -> bool:
        """True if there are imposed strains."""
        return bool(self.statement.functions)

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class."""
        return super().phases(callbacks)._replace(change=loop("change_of_cells", self._c))

    def impose(self, step: Any) -> None:
        """Set the imposed strains of a step, which is ``time_step`` of loops.h."""
        lib.set_numbers_of_step(self._c, step)

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the imposed strains before the next step to those at the time ``t``."""
        self._t[:] = t
        self._begin(q, t, dt=np.inf, fraction=1.0)
        self._times[2] = self._times[1]
        return np.zeros(self._subdomain.size)

    def about_state(self) -> tuple[Index, Array, Array]:
        """Return cells (numbers of the scene), and their b and D, see :func:`section_law`."""
        cells, imposed = self.imposed_strains()
        C = self.by_element(self._numbers)[:, : len(STIFFNESS), None]
        D = np.tile((C * np.eye(3)).reshape(len(C), 9), self.statement.degree)
        return cells, -(C[:, None, :, 0] * imposed).reshape(len(C), -1), D

    def imposed_strains(self) -> tuple[Index, Array]:
        """Return cells (numbers of the scene), and their imposed strains; (n, degree, 3)."""
        cells, statement = self._elements.indices, self.statement
        shape = len(cells), statement.functions, statement.degree, 3
        first, factors = len(statement.numbers) - math.prod(shape[1:]), self._times[2]
        fields = self.by_element(self._numbers)[:, first:].reshape(shape)
        return cells, np.einsum("f,nfgk->ngk", factors[: 2 * shape[1] : 2], fields)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the factors of imposed strains."""
        self.keep_factors(archive)
        if archive.restores:
            self.start(q)

    def keep_factors(self, archive: Archive) -> None:
        """Save or restore the factors of imposed strains in the accepted state."""
        if self.statement.functions:
            factors, n = self._times[2, ::2], len(self._elements.indices)
            rows = archive.rows("imposed strains", self._elements.indices, np.tile(factors, (n, 1)))
            factors[:] = rows[0]


def elastic_cells(
    fields: Fields, setting: BlockSetting, strains: Sequence[ImposedStrain]
) -> BeamCells:
    """Return the block of elastic cells."""
    scheme, numbering = setting.scheme, setting.subdomain.numbering
    stiffness, alpha = (
        fields.section_values(*STIFFNESS).T,
        np.zeros(len(fields.order)),
    )
    numbers = [*stiffness, *axes(fields), *[alpha + scheme.alpha] * bool(scheme.alpha)]
    inelastic = numbering.inelastic_cells
    some = [x for x in strains if not np.isin(numbering.cells_of(x.beam), inelastic).all()]
    statement = ElasticCell(fields.degree, alike(scheme), functions_of(some))
    return BeamCells(statement, "elastic cells", fields, setting, some, numbers)


def alike(scheme: Any) -> Any:
    """Return a scheme with a fixed ``alpha``, so that schemes share kernels."""
    chosen = scheme.alpha and "alpha" in getattr(scheme, "__dataclass_fields__", {})
    return replace(scheme, alpha=0.5) if chosen else scheme


TANGENTS = "committed tangents"
"""Name of the tangents for damping in saved data."""


class InelasticCells(BeamCells):
    """Cells with material points, which may yield, flow or break.

    Attributes:
        points: Material points.
        recorded_factors: Factors of :attr:`Points.recorded` in :meth:`sections`, zero for the jump
            of a fibre.
    """

    def __init__(
        self, fields: Fields, section_points: SectionPoints, cells: Index, setting: BlockSetting,
        strains: Sequence[ImposedStrain],
    ) -> None:  # fmt: skip
        numbering, degree = fields.subdomain.numbering, fields.degree
        some = [x for x in strains if np.isin(numbering.cells_of(x.beam), cells).any()]
        statement, numbers = self.stated(fields, setting.scheme, some, section_points.number)
        name = f"cells with points {section_points.number}"
        super().__init__(statement, name, fields, setting, some, numbers)
        own = self._elements.indices
        # Rows of saved states: other points of the same cells have other rows.
        self._rows = own + section_points.number * len(numbering.cells)
        lengths, keys = numbering.section_lengths(own), numbering.keys(own)
        self.points = points = Points(
            section_points, keys, lengths, setting.scheme, setting.search, predicts=True
        )
        self.must_dissipate = points.must_dissipate
        self.recorded_factors = np.ones(points.recorded.shape[1])
        self.recorded_factors[len(section_points.rest)] = section_points.hinges
        made, order = self._kernels, statement.modes
        rows = in_batches(
            np.arange(len(own) * made.strains, dtype=np.int32).reshape(len(own), -1), BATCH
        )
        dofs = np.asarray(self._elements.dofs)
        w = self._w[:, dofs.shape[1] :]
        self._latest: Array = np.full(fields.subdomain.size, np.nan)
        self._sections = struct(
            "inelastic", size=len(self._latest), latest=self._latest, points=points.c,
            scene=numbering.scene.size, in_cell=degree, block=self._c,
            strains=inserted_cells(made.strain, w, dofs, row=rows), force=self.loops[0][1],
            at_r=order.index("r 0"), at_D=order.index("D 0"),
        )  # fmt: skip
        if self.prediction is not None:
            forces, last_b, e, change = np.zeros((4, *points.r.shape))
            fill(
                self._sections, forces=forces, last_b=last_b, e=e, change=change,
                last_D=np.zeros_like(points.D), at_predicted=order.index("predicted 0"),
                predicted=inserted_cells(made.predicted, w, dofs, row=rows),
            )  # fmt: skip
        names = "add_inelastic_force", "add_inelastic_tangent"
        force, tangent = (loop(name, self._sections) for name in names)
        self.loops = force, tangent
        if points.c.line:
            self.law_residual = loop("missed_by_points", self._sections)

    @staticmethod
    def stated(
        fields: Fields, scheme: Scheme, strains: Sequence[ImposedStrain], number: int
    ) -> tuple[Any, list[Array]]:
        """Return the statement of cells, and their numbers, for the points with a number."""
        shifts = np.zeros((3 * fields.degree, len(fields.order)))
        statement = InelasticCell(fields.degree, alike(scheme), functions_of(strains))
        return statement, [*shifts, *axes(fields)]

    # -- in C ----------------------------------------------------------------------------------

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops that begin and accept a step, and enter energies."""
        fill(self._c, sections=self._sections)
        return self.points.phases(self._c, super().phases(callbacks), self._ledger)

    def describe(self, place: int) -> str:
        """Return the cell of a material point."""
        points, numbering = int(self.points.c.of_cell), self._subdomain.numbering
        cell = int(self._elements.indices[place // points // self.statement.degree])
        return str(numbering.describe_cell(cell))

    def complete_derivatives(self, c: Any, neighbours: Neighbours, by_number: Array) -> None:
        """See the base class: C differentiates the points together with the cells."""
        fill(c, inner=self.points.derivatives(neighbours))

    # -- the step ------------------------------------------------------------------------------

    def start(self, q: Array) -> None:
        """Set the accepted strains of the points to the strains at ``q``, without a step."""
        self._begin(q, float(self._t[0]), dt=math.inf, fraction=0.0)
        strains = self.strains(q)
        self.points.start(strains)
        self.points.refresh(strains)
        self.points.start_tangents()
        if self.imposed and (before := len(self.statement.state)):
            self._states[:] = in_batches(self.points.recorded[:, :3].reshape(-1, before), BATCH)

    def strains(self, q: Array) -> Array:
        """Return the strains at ``q`` minus the imposed strains of the step; (sections, 3)."""
        return self._along(self._kernels.strain, q, []).reshape(self.points.r.shape)

    def _respond(self, q: Array) -> None:
        lib.respond_at(self._sections, doubles(q))

    def impose(self, step: Any) -> None:
        """See the base class."""
        super().impose(step)
        self._latest[:] = np.nan

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a point generates energy in the step to ``q1``."""
        self._respond(q1)
        self.points.require_dissipation(lambda i: self.describe(i * int(self.points.c.of_cell)))

    def dissipation(self, q1: Array) -> float:
        """Return the energy that cells of this process dissipate in the step to ``q1``; J."""
        self._respond(q1)
        return self.points.dissipation()

    def _about(self, q: Array) -> None:
        """Set the resultants and their derivatives to those at ``q``, without predictions."""
        self.points.c.predicts, self._latest[:] = 0, np.nan
        exact = self.prediction and self.prediction.exact
        if self.prediction is not None:
            self.prediction.exact = 1
        self._respond(q)
        lib.put_tangents(self._sections)
        if self.prediction is not None:
            self.prediction.exact = exact
        self._latest[:] = np.nan

    def each_element(self, q: Array) -> Iterator[tuple[Index, Array, Array, Array]]:
        """See the base class."""
        self._about(q)
        yield from super().each_element(q)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """See the base class."""
        self._about(q1)
        super().add_tangent_change(q1, u)

    def tangent_work(self, q1: Array, x: Array, y: Array, u: Array | None = None) -> float:
        """See the base class."""
        self._about(q1)
        return super().tangent_work(q1, x, y, u)

    def about_state(self) -> tuple[Index, Array, Array]:
        """See the base class; D is for a step with the length of the last step."""
        cells, imposed = self.imposed_strains()
        strains, D = self.points.tangent()
        whole = strains + imposed.reshape(-1, 3)
        elastic = np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), whole)
        b, n = self.points.recorded[:, :3] - elastic, len(cells)
        return cells, b.reshape(n, -1), D.reshape(n, -1)

    # -- the state -----------------------------------------------------------------------------

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the internal variables, and tangents for damping."""
        state, damped = self.points.state(), self.points.damped
        rows = archive.rows("cells", self._rows, state.reshape(len(self._rows), -1))
        self.points.restore(rows.reshape(state.shape))
        if damped is not None:
            damped.set_tangents(archive.rows(TANGENTS, self._rows, damped.tangents))
        self.keep_factors(archive)
        self.keep_states(archive)

    def sections(self) -> tuple[Index, Array]:
        """Return cells (scene numbers), and :attr:`Points.recorded`; (num_cells, degree, 6)."""
        recorded, cells = self.points.recorded * self.recorded_factors, self._elements.indices
        return cells, recorded.reshape(len(cells), -1, recorded.shape[1])


def section_law(groups: Iterable[BeamCells], numbering: DofNumbering) -> tuple[Array, Array]:
    """Return b and D of the section forces b + D e of cells about the accepted state.

    b + D e are the section forces for strains e at p integration points; b is (num_cells, 3 p), D
    (num_cells, 9 p).  Rows of cells in no group are zero.
    """
    count, points = len(numbering.cells), numbering.mesh.degree
    b, D = np.zeros((count, 3 * points)), np.zeros((count, 9 * points))
    for cells, own_b, own_D in (group.about_state() for group in groups):
        b[cells] += own_b
        D[cells] += own_D
    return b, D


def functions_of(loads: Sequence[ImposedStrain]) -> int:
    """Return the number of different functions of time of loads."""
    return len({id(load.amplitude) for load in loads})


def imposed_strains(
    fields: Fields, loads: Sequence[ImposedStrain]
) -> tuple[list[InTime], list[Array]]:
    """Return functions of time, and the strains of the cells for each of them as numbers.

    Loads with the same time function share their numbers; messages name the first load.  A function
    has two numbers of a step, at its end and before it.  ``loads`` act on cells of any process.
    """
    if not loads:
        return [], []
    subdomain, numbering = fields.subdomain, fields.subdomain.numbering
    owners = {id(load.amplitude): load for load in reversed(loads)}
    cells = subdomain.cells[fields.order]
    points, weights = np.polynomial.legendre.leggauss(4)
    own = np.polynomial.legendre.leggauss(numbering.mesh.degree)[0]
    degree = len(own) - 1
    # Least squares: polynomials with the same moments, evaluated at the points of the cells
    moments = np.polynomial.legendre.legvander(points, degree) * weights[:, None]
    fitted = (np.arange(degree + 1) + 0.5) * np.polynomial.legendre.legvander(own, degree)
    arrays = {key: np.zeros((len(cells), len(own), 3)) for key in owners}
    for load in loads:
        beam_cells = numbering.cells_of(load.beam)
        mine = np.flatnonzero((cells >= beam_cells[0]) & (cells <= beam_cells[-1]))
        s = numbering.gauss_parameters(load.beam)[cells[mine] - beam_cells[0]]
        arrays[id(load.amplitude)][mine] += fitted @ moments.T @ load.strains(s)
    in_time, numbers = list[InTime](), list[Array]()
    for key, load in owners.items():
        in_time += [InTime(load.amplitude, load, when) for when in ("moving", "last")]
        numbers += [*arrays[key].reshape(len(cells), -1).T]
    return in_time, numbers
