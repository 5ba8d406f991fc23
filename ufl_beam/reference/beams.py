# SPDX-License-Identifier: MIT
"""Beams: elastic cells, cells whose material yields or breaks, inertia and damping."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy  # its parts are loaded when they are used
import ufl
from scipy.sparse import csr_array
from ufl.algorithms import expand_derivatives

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import mass_form
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.energy_momentum import DecayingMidpoint
from ufl_beam.mechanics.functional import elastic_energy, resultants, virtual_work
from ufl_beam.mechanics.kinematics import strain, virtual_strain
from ufl_beam.mechanics.time_schemes import (
    DynamicScheme,
    Rates,
    Scheme,
    Step,
    combined,
    nodal_step,
    with_half_tangents,
)
from ufl_beam.model.damping import KelvinVoigt, Rayleigh
from ufl_beam.model.fibres import Layout
from ufl_beam.reference.cells import Cells, Force, Form, Ledger, OnNodes, Strains, lumps
from ufl_beam.reference.points import MaterialPoints, Search


class CellForce(Force):
    """Virtual work on cells in UFL, with its derivative, and the energies that are lost by it.

    Args:
        cells: Where it acts.
        work: Form that is linear in ``element.w``.
        losses: Forms of the energy that is lost in a step.
    """

    kind = "stress"

    def __init__(self, cells: Cells, work: ufl.Form, losses: Sequence[ufl.Form] = ()) -> None:
        of = cells.element
        self.cells, self.size, self.of = cells, cells.size, of
        self.work = cells.form(work)
        self.derivative = _derivative(work, cells)
        self.losses = [cells.form(loss) for loss in losses]
        self._accepted: Sequence[OnNodes] = ()

    def begin(self, step: Step) -> None:
        """Remember the configuration at the beginning."""
        self.cells.set(self.of.q0, step.q0)

    def residual(self, q1: Array) -> Array:
        """Virtual work if the step ends at ``q1``."""
        self.cells.set(self.of.q1, q1)
        return self.work.vector()

    def tangent(self, q1: Array) -> csr_array:
        """Its derivative, by UFL."""
        self.cells.set(self.of.q1, q1)
        return super().tangent(q1) if self.derivative is None else self.derivative.matrix()

    def lost(self, q1: Array) -> float:
        """Energy that is lost in the step; J."""
        self.cells.set(self.of.q1, q1)
        return sum(loss.value() for loss in self.losses)

    def accept(self, q1: Array, s: Array) -> None:
        """Remember the forces on the nodes."""
        self.residual(q1)
        self.note()

    def note(self) -> None:
        """Note the forces of the latest residual as those of the accepted step."""
        self._accepted = [self.cells.on_nodes(self.kind, self.work)]

    def on_nodes(self) -> Sequence[OnNodes]:
        """Forces on the nodes of the cells in the step that was just accepted."""
        return self._accepted


def _derivative(work: ufl.Form, cells: Cells) -> Form | None:
    """Derivative of a virtual work by the end of the step; None where it does not depend on it."""
    of = cells.element
    form = expand_derivatives(ufl.derivative(work, of.q1, ufl.TrialFunction(of.space)))
    return None if form.empty() else cells.form(form)


class ElasticBeams(CellForce):
    """Elastic cells: the resultants of a time scheme work on its virtual strains."""

    inner = True

    def __init__(self, grid: Grid, numbers: Index, scheme: Scheme, ledger: Ledger) -> None:
        cells = Cells(grid, numbers)
        of, self._ledger = cells.element, ledger
        C, dx = of.stiffness, of.dx(1)
        e0, e1 = strain(of.q0, of.axis), strain(of.q1, of.axis)
        r = scheme.resultants(C, e0, e1, of.constant)
        losses = []
        if scheme.alpha:
            losses.append(2 * of.constant(scheme.alpha) * elastic_energy(e1 - e0, C) * dx)
        self._decays, self._change_before = isinstance(scheme, DecayingMidpoint), of.at_points(3)
        if isinstance(scheme, DecayingMidpoint):  # c C (Δe - r Δe'), Δe' of the step before
            damped = of.constant(scheme.part) * resultants(e1 - e0 - self._change_before, C)
            r += damped
            losses.append(virtual_work(damped, e1 - e0) * dx)
        work = virtual_work(r, scheme.virtual_strain(of.q0, of.q1, of.w, of.axis)) * dx
        super().__init__(cells, work, losses)
        if losses:
            ledger.lost["numerical"] += 0.0
        self._energy = cells.form(elastic_energy(e1, C) * dx)
        self._strains, self._held = Strains(cells), 0.0
        self._change: Array = np.zeros((len(numbers), len(grid.mesh.point_weights), 3))
        self._dt = self._last_dt = math.inf

    def begin(self, step: Step) -> None:
        """Remember the beginning, and the changes of the strains in the step before."""
        super().begin(step)
        self._q0, self._dt = step.q0, step.dt
        ratio = min(1.0, step.dt / self._last_dt)
        self.cells.put(self._change_before, ratio * self._change)

    def stored(self, q: Array) -> float:
        """Elastic energy of all cells; J."""
        self.cells.set(self.of.q1, q)
        return self._energy.value()

    def change(self, q1: Array) -> float:
        """Energy that is stored in the step to ``q1``; J."""
        return self.stored(q1) - self._held

    def accept(self, q1: Array, s: Array) -> None:
        """Enter what the scheme has lost."""
        super().accept(q1, s)
        if self.losses:
            self._ledger.lost["numerical"] += self.lost(q1)
        if self._decays:
            self._change = self._strains(q1) - self._strains(self._q0)
            self._last_dt = self._dt

    def enter_state(self, q: Array) -> None:
        """Enter the elastic energy."""
        self._held = self.stored(q)
        self._ledger.state["stored"] += self._held

    def internal(self) -> dict[str, Array]:
        """Changes of the strains in the last step, and its length."""
        if not self._decays:
            return {}
        rows = np.column_stack([
            self.cells.numbers, self._change.reshape(len(self._change), -1),
            np.full(len(self._change), self._last_dt),
        ])  # fmt: skip
        return {f"changes of strains, {rows.shape[1] - 1}": rows[np.argsort(rows[:, 0])]}

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take over these changes where the run goes on."""
        name = f"changes of strains, {self._change[0].size + 1}"
        if self._decays and goes_on and name in internal:
            table = internal[name]
            rows = table[np.searchsorted(table[:, 0], self.cells.numbers), 1:]
            self._change = rows[:, :-1].reshape(self._change.shape)
            self._last_dt = float(rows[0, -1])


class YieldingBeams(CellForce):
    """Cells with material points: resultants r of their return map, in quadrature functions.

    Around an iterate the resultants are b + D e, linear in the strains e, from which UFL derives
    the tangent, material and geometric.
    """

    inner = True

    def __init__(
        self, grid: Grid, numbers: Index, layout: Layout, scheme: Scheme, search: Search,
        ledger: Ledger,
    ) -> None:  # fmt: skip
        cells = Cells(grid, numbers)
        of, self._grid, self._hinges = cells.element, grid, layout.hinges
        self._r, self._b, self._D = of.at_points(3), of.at_points(3), of.at_points(3, 3)
        w_e = scheme.virtual_strain(of.q0, of.q1, of.w, of.axis)
        around = virtual_work(self._b + ufl.dot(self._D, strain(of.q1, of.axis)), w_e) * of.dx(1)
        super().__init__(cells, virtual_work(self._r, w_e) * of.dx(1))
        self.derivative = _derivative(around, cells)
        keys = grid.keys(cells.numbers)
        self.points = MaterialPoints(layout, keys, cells.lengths, scheme, search, ledger)
        self._strains = Strains(cells)

    def strains(self, q: Array) -> Array:
        """Strains of the cells; (num_cells, 3)."""
        return self._strains(q)[:, 0]

    def begin(self, step: Step) -> None:
        """Begin the step at the points, too."""
        super().begin(step)
        self.points.begin(step.dt)

    def residual(self, q1: Array) -> Array:
        """Work of the resultants that the return map gives."""
        self.points.respond(self.strains(q1))
        self.cells.put(self._r, self.points.r)
        return super().residual(q1)

    def tangent(self, q1: Array) -> csr_array:
        """Its derivative, with the consistent tangent of the return map in the latest residual."""
        r, D = self.points.r, self.points.D
        self.cells.put(self._b, r - np.einsum("kij,kj->ki", D, self.points.strains))
        self.cells.put(self._D, D)
        return super().tangent(q1)

    def change(self, q1: Array) -> float:
        """Energy that is stored and dissipated in the step to ``q1``; J."""
        return self.points.change()

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if the law of a point gives energy in the step."""
        self.points.require_dissipation([*map(self._grid.describe_cell, self.cells.numbers)])

    def accept(self, q1: Array, s: Array) -> None:
        """Take the internal variables at the end of the step."""
        self.note()
        self.points.accept()

    def enter_state(self, q: Array) -> None:
        """Enter the stored energies."""
        self.points.enter_stored()

    def material(self) -> Array:
        """Numbers of the cells, and what solutions keep of them; (num_cells, 7)."""
        kept = self.points.kept.copy()
        if not self._hinges:
            kept[:, 3] = 0.0  # a crack of one fibre is no rotation
        return np.column_stack([self.cells.numbers, kept])

    def internal(self) -> dict[str, Array]:
        """Internal variables of all points."""
        state = self.points.state()
        return {f"cells, {state.shape[1]}": np.column_stack([self.cells.numbers, state])}

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take over the internal variables of cells that were there, at the configuration ``q``."""
        table = internal.get(f"cells, {self.points.state().shape[1]}")
        if table is not None:
            _, here, there = np.intersect1d(self.cells.numbers, table[:, 0], return_indices=True)
            if len(here):
                self.points.restore(here, table[there, 1:])
        self.points.start(self.strains(q))
        self.points.refresh()


def inelastic_cells(grid: Grid) -> dict[Layout, Index]:
    """Layouts of material points that can yield or break, and the cells that have them."""
    sections, of_beam = grid.sections
    groups: dict[Layout, list[int]] = {}
    for number, section in enumerate(sections):
        layout = section.layout(section.hinge)
        if layout is not None and not layout.elastic:
            if grid.mesh.degree > 1:
                beam = grid.scene.beams[int(np.argmax(of_beam == number))]
                raise SceneError(
                    f"Mesh: degree = {grid.mesh.degree} is for elastic beams, and {beam.name} "
                    "may yield or break; use degree=1 with more cells, or an elastic section"
                )
            groups.setdefault(layout, []).append(number)
    of_cell = of_beam[grid.beam_of_cell]
    return {layout: np.flatnonzero(np.isin(of_cell, one)) for layout, one in groups.items()}


# -- inertia and damping -------------------------------------------------------------------------


class Mass:
    """Mass matrix of a scene: beams, point masses and rigid bodies; P(18).

    Attributes:
        matrix: All of it; kg, kg m².
        cells: The beams.
        of_beams: Form of their mass times ``element.q1``.
    """

    def __init__(self, grid: Grid) -> None:
        self.cells = cells = Cells(grid, np.arange(len(grid.cells)))
        form, diagonal = mass_form(cells.element), np.zeros(grid.size)
        for dofs, mass, inertia in lumps(grid):
            np.add.at(diagonal, dofs, [mass, mass, inertia])
        self.matrix = cells.form(form).matrix() + csr_array(scipy.sparse.diags_array(diagonal))
        self.of_beams = cells.form(ufl.action(form, cells.element.q1))

    def on_nodes(self, v: Array) -> OnNodes:
        """Mass of the beams times a vector."""
        self.cells.set(self.cells.element.q1, v)
        return self.cells.on_nodes("density", self.of_beams)


class MatrixForce(Force):
    """Constant matrix times the sum of a row of :class:`Coefficients`."""

    def __init__(self, grid: Grid, scheme: DynamicScheme, matrix: csr_array) -> None:
        self.size, self.scheme, self.matrix = grid.size, scheme, matrix
        self._rotations = grid.rotations.astype(np.int32)
        self._half_tangents = with_half_tangents(scheme, self._rotations)

    def begin_at(self, q0: Array, row: Sequence[float], rates: Rates) -> None:
        """Take note of the configuration and the numbers of a step."""
        self._q0, self._factor = q0, row[0]
        self._push = combined(row, np.zeros(self.size), rates)

    def rate(self, q1: Array) -> Array:
        """Vector that the matrix is multiplied with."""
        return self._factor * nodal_step(self.scheme, self._q0, q1, self._rotations) + self._push

    def residual(self, q1: Array) -> Array:
        """Forces if the step ends at ``q1``."""
        return np.asarray(self.matrix @ self.rate(q1))

    def tangent(self, q1: Array) -> csr_array:
        """Their derivative; the step of a rotation is 2 tan(Δψ/2) or Δψ, by the scheme."""
        slope: Array = np.full(self.size, self._factor)
        slope[self._half_tangents] /= np.cos((q1 - self._q0)[self._half_tangents] / 2) ** 2
        return csr_array(self.matrix @ scipy.sparse.diags_array(slope))


class Inertia(MatrixForce):
    """Inertia, and the velocities of the accepted state; satisfies :class:`Rates`.

    Attributes:
        v: Velocities; (size,).
        v_before: Those at the beginning of the last step.
        more: What the scheme keeps besides, such as accelerations.
        last_dt: Length of the last step, infinite before the first; s.
    """

    def __init__(self, grid: Grid, scheme: DynamicScheme, v: Array, ledger: Ledger) -> None:
        self.mass = Mass(grid)
        super().__init__(grid, scheme, self.mass.matrix)
        self.v, self.v_before, self.more = v, v, tuple[Array, ...]()
        self.dt = self.last_dt = math.inf
        self._ledger = ledger
        self._rate: Array = np.zeros(grid.size)
        if scheme.coefficients(1.0, 1.0, len(scheme.kept)).slip is not None:
            ledger.lost["numerical"] += 0.0

    def begin(self, step: Step) -> None:
        """Take the coefficients of the step."""
        self.dt = step.dt
        self.of_step = self.scheme.coefficients(step.dt, self.last_dt, len(self.more))
        self.begin_at(step.q0, self.of_step.inertia, self)

    def after(self, s: Array) -> tuple[Array, ...]:
        """Velocities after the step ``s``, and what the scheme keeps besides."""
        return tuple(combined(row, s, self) for row in self.of_step.rates)

    def accept(self, q1: Array, s: Array) -> None:
        """New velocities, and what the scheme has lost."""
        self._rate = self.rate(q1)
        v, *more = self.after(s)
        if self.of_step.slip is not None:
            change = v - self.v
            lost = combined(self.of_step.slip, change, self) @ (self.matrix @ change)
            self._ledger.lost["numerical"] += float(lost)
        self.v_before, self.v, self.more, self.last_dt = self.v, v, tuple(more), self.dt

    def enter_state(self, q: Array) -> None:
        """Enter the kinetic energy."""
        self._ledger.state["kinetic"] += float(self.v @ (self.matrix @ self.v)) / 2

    def on_nodes(self) -> Sequence[OnNodes]:
        """Mass of the beams times the accelerations of the step."""
        return [self.mass.on_nodes(self._rate)]

    def internal(self) -> dict[str, Array]:
        """What the scheme keeps besides the velocities."""
        known = dict(zip(self.scheme.kept, self.more, strict=False))
        if isinstance(self.scheme, DecayingMidpoint):
            known["velocity before"] = self.v_before
            known["last step"] = np.full(self.size, self.last_dt)
        return known

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take it over where the run goes on: no force has jumped."""
        if not goes_on:
            return
        self.more = tuple(internal[name] for name in self.scheme.kept if name in internal)
        if isinstance(self.scheme, DecayingMidpoint) and "velocity before" in internal:
            self.v_before = internal["velocity before"]
            self.last_dt = float(internal["last step"][0])


class RayleighForce(MatrixForce):
    """Rayleigh damping: (a0 M + a1 K) v, with the stiffness K of the undeformed scene, P(92)."""

    def __init__(self, damping: Rayleigh, grid: Grid, inertia: Inertia, ledger: Ledger) -> None:
        self._mass, self._damping, cells = inertia.mass, damping, inertia.mass.cells
        of = cells.element
        rest, v = of.configuration(), ufl.TrialFunction(of.space)
        e, w_e = (virtual_strain(rest, x, of.axis) for x in (v, of.w))
        K = virtual_work(resultants(e, of.stiffness), w_e) * of.dx(1)
        self._stiffness = cells.form(ufl.action(K, of.q1))
        matrix = damping.mass * self._mass.matrix + damping.stiffness * cells.form(K).matrix()
        super().__init__(grid, inertia.scheme, csr_array(matrix))
        self._inertia, self._ledger, self._accepted = inertia, ledger, list[OnNodes]()

    def begin(self, step: Step) -> None:
        """Take the coefficients of the velocity of the step."""
        self._dt = step.dt
        self.begin_at(step.q0, self._inertia.of_step.velocity, self._inertia)

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the energy that was damped."""
        self._ledger.lost["damping"] += float(s @ (self.matrix @ s)) / self._dt
        rate, cells = self.rate(q1), self._mass.cells
        of_mass = self._mass.on_nodes(rate)
        of_stiffness = cells.on_nodes("stress", self._stiffness)  # at the same vector
        self._accepted = [
            of_mass._replace(forces=self._damping.mass * of_mass.forces),
            of_stiffness._replace(forces=self._damping.stiffness * of_stiffness.forces),
        ]

    def on_nodes(self) -> Sequence[OnNodes]:
        """Both matrices of the beams times the velocities of the step."""
        return self._accepted


class KelvinVoigtForce(CellForce):
    """Kelvin-Voigt damping: resultants C Δe over the time of the step, times that of the law."""

    def __init__(
        self, damping: KelvinVoigt, grid: Grid, numbers: Index, scheme: Scheme, ledger: Ledger
    ) -> None:
        cells = Cells(grid, numbers)
        of, self._time, self._ledger = cells.element, damping.time, ledger
        self._rate = of.constant(1.0)
        change = strain(of.q1, of.axis) - strain(of.q0, of.axis)
        r, dx = self._rate * resultants(change, of.stiffness), of.dx(1)
        w_e = scheme.virtual_strain(of.q0, of.q1, of.w, of.axis)
        super().__init__(cells, virtual_work(r, w_e) * dx, [virtual_work(r, change) * dx])

    def begin(self, step: Step) -> None:
        """Tell the form the length of the step."""
        super().begin(step)
        self._rate.value = self._time / step.dt

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the energy that was damped."""
        super().accept(q1, s)
        self._ledger.lost["damping"] += self.lost(q1)


def damping_forces(
    grid: Grid, scheme: Scheme, inertia: Inertia | None, ledger: Ledger
) -> list[Force]:
    """Forces of all damping in a scene."""
    forces: list[Force] = []
    for damping in grid.scene.damping:
        ledger.lost["damping"] += 0.0
        if isinstance(damping, KelvinVoigt):
            beams = grid.scene.beams if damping.beams is None else damping.beams
            # Cells with a hinge are left out, so that an open hinge turns freely.
            cells = [grid.cells_of(beam) for beam in beams if beam.section.hinge is None]
            if cells:
                numbers = np.unique(np.concatenate(cells))
                forces.append(KelvinVoigtForce(damping, grid, numbers, scheme, ledger))
        elif inertia is None:
            raise SceneError(
                "Rayleigh: it damps vibrations, in proportion to mass, too, and statics has none; "
                "use KelvinVoigt, which acts in the time of a static run"
            )
        else:
            forces.append(RayleighForce(damping, grid, inertia, ledger))
    return forces
