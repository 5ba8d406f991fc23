# SPDX-License-Identifier: MIT
"""Forces of elastic cells, of cells that yield or break, of inertia and of damping."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import zip_longest

import numpy as np
import ufl

from old_reference.cell_forms import (
    Archive,
    CellForce,
    Cells,
    Force,
    Form,
    Response,
    Setting,
    cell_dofs,
    point_masses,
    put,
)
from old_reference.imposed_strains import ImposedStrains
from old_reference.return_map import MaterialPoints
from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import mass_form
from ufl_beam.errors import ModelError
from ufl_beam.mechanics.functional import elastic_energy, resultants, virtual_work
from ufl_beam.mechanics.kinematics import strain, virtual_strain
from ufl_beam.mechanics.time_scheme import (
    DynamicScheme,
    Step,
    combined,
    nodal_step,
    with_half_tangents,
)
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.loads import KelvinVoigt, Rayleigh


class ElasticBeams(CellForce):
    """Elastic cells, with resultants and virtual strains of the time scheme."""

    def __init__(self, indices: Index, setting: Setting, t0: float) -> None:
        cells, scheme = Cells(setting.numbering, indices), setting.scheme
        element, self.imposed = cells.element, ImposedStrains(cells, setting, t0)
        imposed, C = self.imposed, element.stiffness
        e0 = strain(element.q0, element.axis) - imposed.before
        e1 = strain(element.q1, element.axis) - imposed.now
        r, losses = scheme.resultants(C, e0, e1, element.constant), []
        if scheme.alpha:
            losses.append(2 * element.constant(scheme.alpha) * elastic_energy(e1 - e0, C))
        self._decays, self._change_before = bool(scheme.lost_fraction), element.at_points(3)
        acting = (
            scheme.weight_of_before * scheme.resultants(C, e0, e0, element.constant)
            + (1 - scheme.weight_of_before) * r
        )
        change = ufl.dot(acting, imposed.now - imposed.before) * element.dx(1)
        self._work_on_imposed, self._supplied = cells.form(change), setting.ledger.supplied
        if scheme.lost_fraction:
            # c C (Δe - ρ Δe'), with the lost fraction c, the change Δe' in the last step, and
            # ρ = min(1, dt / length of last step)
            whole = strain(element.q1, element.axis) - strain(element.q0, element.axis)
            damped = element.constant(scheme.lost_fraction) * resultants(
                whole - self._change_before, C
            )
            r = r + damped
            losses.append(virtual_work(damped, whole))
        w_e = scheme.virtual_strain(element.q0, element.q1, element.w, element.axis)
        energy = elastic_energy(e1, C) * element.dx(1), "stored"
        lost = (sum(losses) * element.dx(1), "numerical") if losses else None
        super().__init__(
            cells, virtual_work(r, w_e) * element.dx(1), setting, stored=energy, lost=lost
        )
        points = len(setting.numbering.mesh.point_weights)
        self._last_change: Array = np.zeros((len(indices), points, 3))
        self._last_dt = math.inf

    def response(self, step: Step, q1: Array) -> Response:
        """Return the virtual work, and its derivative; both may depend on the last step."""
        put(self._change_before, min(1.0, step.dt / self._last_dt) * self._last_change)
        self.imposed.begin(step)
        return super().response(step, q1)

    def change(self, step: Step, q1: Array) -> float:
        """Return the sum of the energy stored in the step and the work on imposed strains; J."""
        return self.energy(q1) - self.stored["stored"] + self.work_on_imposed()

    def work_on_imposed(self) -> float:
        """Return the work of the resultants on the change of imposed strains in the step; J."""
        return float(self._work_on_imposed.assembled())

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept the end of the step; store the changes of the strains if the scheme uses them."""
        super().accept(step, q1, s)
        if self.imposed.change.any():
            self._supplied["loads"] -= self.work_on_imposed()
        self.imposed.accept()
        if self._decays:
            self._last_change = self.cells.strains(q1) - self.cells.strains(step.q0)
            self._last_dt = step.dt

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the length of the last step, and the changes of the strains in it."""
        if self._decays:
            n = len(self._last_change)
            rows = self._last_change.reshape(n, -1), np.full(n, self._last_dt)
            restored = archive.rows(
                "changes of strains", self.cells.cell_indices, np.column_stack(rows)
            )
            self._last_change = restored[:, :-1].reshape(self._last_change.shape)
            self._last_dt = float(restored[0, -1])


class YieldingBeams(CellForce):
    """Cells with material points, whose return map computes the resultants r.

    In the form of the virtual work, r is a quadrature function.  UFL derives the tangent from a
    form with b + D e, the linearization of r in the strains e at an iterate.  So the tangent has a
    material and a geometric part.
    """

    def __init__(
        self, indices: Index, section_points: SectionPoints, setting: Setting, t0: float
    ) -> None:
        cells, numbering = Cells(setting.numbering, indices), setting.numbering
        element, self._hinges = cells.element, section_points.hinges
        self.imposed, self._supplied = ImposedStrains(cells, setting, t0), setting.ledger.supplied
        self._weight = setting.scheme.weight_of_before
        self._r, self._b, self._D = (
            element.at_points(3),
            element.at_points(3),
            element.at_points(3, 3),
        )
        w_e = setting.scheme.virtual_strain(element.q0, element.q1, element.w, element.axis)
        linear = self._b + ufl.dot(self._D, strain(element.q1, element.axis))
        work, around = (virtual_work(r, w_e) * element.dx(1) for r in (self._r, linear))
        super().__init__(cells, work, setting, around=around)
        self._degree = numbering.mesh.degree
        self.rows = cells.cell_indices + section_points.number * len(numbering.cells)
        self._names = [
            numbering.describe_cell(number) for number in cells.cell_indices.repeat(self._degree)
        ]
        self.points = MaterialPoints(
            section_points, numbering.keys(cells.cell_indices),
            numbering.section_lengths(cells.cell_indices), setting,
        )  # fmt: skip

    def response(self, step: Step, q1: Array) -> Response:
        """Return the virtual work after a return map, and its consistent tangent."""
        points, whole = self.points, self.cells.strains(q1).reshape(-1, 3)
        self.imposed.begin(step)
        points.return_map(whole - self.imposed.values.reshape(-1, 3), step.dt)
        put(self._r, points.r)
        put(self._b, points.r - np.einsum("kij,kj->ki", points.D, whole))
        put(self._D, points.D)
        return super().response(step, q1)

    def change(self, step: Step, q1: Array) -> float:
        """Return the sum of stored and dissipated energy and work on imposed strains in a step."""
        self.points.require_dissipation(self._names)
        return self.points.change() + self.work_on_imposed()

    def work_on_imposed(self) -> float:
        """Return the work of the resultants on the change of imposed strains in the step; J."""
        before, w = self.points.recorded[:, :3], self._weight
        acting = w * before + (1 - w) * self.points.r
        change = self.imposed.change.reshape(-1, 3)
        lengths = np.outer(self.cells.lengths, self.cells.weights).ravel()
        return float(lengths @ np.einsum("ki,ki->k", acting, change))

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept the internal variables at the end of the step."""
        if self.imposed.change.any():
            self._supplied["loads"] -= self.work_on_imposed()
        self.imposed.accept()
        self.points.accept()

    def start(self, q: Array) -> None:
        """Compute the accepted state of the points at the strains of a configuration."""
        strains = self.cells.strains(q) - self.imposed.values
        self.points.start(strains.reshape(-1, 3))

    @property
    def stored(self) -> Mapping[str, float]:  # type: ignore[override]
        """Stored energies of the points, by entry of the ledger; J."""
        return self.points.stored

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the internal variables of all points."""
        state = self.points.state()
        rows = archive.rows("cells", self.rows, state.reshape(len(self.rows), -1))
        self.points.state(rows.reshape(state.shape))

    def material(self) -> Array:
        """Return the six values "material" at each Gauss point; (num_cells, degree, 6)."""
        data = self.points.recorded.copy()
        data[:, 3] *= self._hinges  # the rotation of a hinge; jumps of fibres are no rotations
        return data.reshape(-1, self._degree, 6)


# -- inertia and damping -------------------------------------------------------------------------


class Mass:
    """Mass matrix of a scene: beams, point masses and rigid bodies; P(18).

    Attributes:
        matrix: Mass matrix of the whole scene; kg, kg m².
        cells: Cells of the beams.
    """

    def __init__(self, numbering: DofNumbering) -> None:
        self.cells = cells = Cells(numbering, np.arange(len(numbering.cells)))
        form, diagonal = mass_form(cells.element), np.zeros(numbering.size)
        for dofs, mass, inertia in point_masses(numbering):
            np.add.at(diagonal, dofs, [mass, mass, inertia])
        self.matrix = cells.form(form).assembled() + np.diag(diagonal)
        self._beam_form = cells.form(ufl.action(form, cells.element.q1))

    def on_nodes(self, v: Array) -> Array:
        """Return the mass matrix of the beams times ``v``, as forces at the nodes of cells."""
        self.cells.set(self.cells.element.q1, v)
        return self.cells.on_nodes("density", self._beam_form.assembled())


class MatrixForce(Force):
    """Product of a matrix, constant in a step, and a rate; :class:`Coefficients` define the rate.

    Attributes:
        rate: Rate in the latest response; (size,).
        coefficients: Coefficients of the scheme in the latest response.
    """

    row: str
    inertia: Inertia

    def __init__(self, setting: Setting, scheme: DynamicScheme, matrix: Array) -> None:
        self.size, self.scheme, self.matrix = setting.numbering.size, scheme, matrix
        self.ledger, self._rotations = setting.ledger, setting.numbering.rotations.astype(np.int32)

    def response(self, step: Step, q1: Array) -> Response:
        """Return forces and derivative; rotations enter as 2 tan(Δψ/2) or Δψ, see the scheme."""
        scheme, before, rotations = self.scheme, self.inertia, self._rotations
        self.coefficients = scheme.coefficients(step.dt, before.last_dt, len(before.more))
        row = getattr(self.coefficients, self.row)
        s, turned = (
            nodal_step(scheme, step.q0, q1, rotations),
            with_half_tangents(scheme, rotations),
        )
        self.rate, slope = combined(row, s, before), np.full(self.size, row[0])
        slope[turned] /= np.cos((q1 - step.q0)[turned] / 2) ** 2
        return np.asarray(self.matrix @ self.rate), self.matrix * slope


class Inertia(MatrixForce):
    """Forces of inertia, and the velocities of the accepted state.

    Attributes:
        v: Velocities; (size,).
        v_before: Velocities at the beginning of the last step.
        more: Further rates of the scheme, such as accelerations.
        last_dt: Length of the last step, infinite before the first; s.
    """

    row = "inertia"

    def __init__(self, setting: Setting, scheme: DynamicScheme, v: Array) -> None:
        self.mass, self.inertia = Mass(setting.numbering), self
        super().__init__(setting, scheme, self.mass.matrix)
        self.v, self.v_before, self.more, self.last_dt = v, v, tuple[Array, ...](), math.inf
        if scheme.coefficients(1.0, 1.0, len(scheme.further_rates)).velocity_defect is not None:
            setting.loses("numerical")

    def after(self, s: Array) -> tuple[Array, ...]:
        """Return velocities and further rates of the scheme after increments ``s`` of the nodes."""
        return tuple(combined(row, s, self) for row in self.coefficients.rates)

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept new velocities, and enter numerical losses in the ledger."""
        self.on_nodes = self.mass.on_nodes(self.rate)
        v, *more = self.after(s)
        if self.coefficients.velocity_defect is not None:
            change = v - self.v
            lost = combined(self.coefficients.velocity_defect, change, self) @ (
                self.matrix @ change
            )
            self.ledger.lost["numerical"] += float(lost)
        self.v_before, self.v, self.more, self.last_dt = self.v, v, tuple(more), step.dt
        self.start(q1)

    def start(self, q: Array) -> None:
        """Compute the kinetic energy of the velocities."""
        self.stored = {"kinetic": float(self.v @ (self.matrix @ self.v)) / 2}

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore further rates, and data of the last step that the scheme uses."""
        pairs = zip_longest(self.scheme.further_rates, self.more)
        more = [archive.vector(name, known) for name, known in pairs]
        self.more = tuple(known for known in more if known is not None)
        if self.scheme.uses_last_step:
            self.v_before = archive.vector("velocity before", self.v_before)
            last = archive.vector("last step", np.full(self.size, self.last_dt))
            self.last_dt = float(last[0])


class DampingForce(MatrixForce):
    """Base of Rayleigh damping, (a0 M + a1 K) v, P(92)."""

    row = "velocity"
    _damping: Rayleigh
    _action: Form  # product of K and the rate on cells

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the energy lost by damping in the ledger."""
        self.ledger.lost["damping"] += float(s @ (self.matrix @ s)) / step.dt
        mass, damping = self.inertia.mass, self._damping
        by_mass = mass.on_nodes(self.rate)
        # mass.on_nodes has set the function q1, on which _action depends, to the rate.
        by_stiffness = mass.cells.on_nodes("stress", self._action.assembled())
        self.on_nodes = damping.mass * by_mass + damping.stiffness * by_stiffness


class RayleighForce(DampingForce):
    """Rayleigh damping with the stiffness K of the undeformed beams."""

    def __init__(self, damping: Rayleigh, setting: Setting, inertia: Inertia) -> None:
        self.inertia, self._damping, cells = inertia, damping, inertia.mass.cells
        element = cells.element
        rest, v = element.configuration(), ufl.TrialFunction(element.space)
        e, w_e = (virtual_strain(rest, x, element.axis) for x in (v, element.w))
        K = virtual_work(resultants(e, element.stiffness), w_e) * element.dx(1)
        self._action = cells.form(ufl.action(K, element.q1))
        matrix = damping.mass * inertia.matrix + damping.stiffness * cells.form(K).assembled()
        super().__init__(setting, inertia.scheme, matrix)


class TangentRayleighForce(DampingForce):
    """Rayleigh damping with the tangent stiffness of the accepted state.

    Negative eigenvalues of the tangents of sections are removed.  The configuration is the one at
    the beginning of the step.
    """

    def __init__(
        self, damping: Rayleigh, setting: Setting, inertia: Inertia,
        yielding: Sequence[YieldingBeams],
    ) -> None:  # fmt: skip
        self.inertia, self._damping, self._yielding = inertia, damping, yielding
        self._cells = cells = inertia.mass.cells
        element = cells.element
        self._step: Step | None = None
        self._D, v = element.at_points(3, 3), ufl.TrialFunction(element.space)
        e, w_e = (virtual_strain(element.q0, x, element.axis) for x in (v, element.w))
        K = virtual_work(ufl.dot(self._D, e), w_e) * element.dx(1)
        self._stiffness, self._action = cells.form(K), cells.form(ufl.action(K, element.q1))
        C = element.stiffness.x.array.reshape(-1, 1, 3, 1) * np.eye(3)
        order = cell_dofs(element.stiffness.function_space)[:, 0] // 3
        self._sections = np.repeat(C[order], len(cells.weights), axis=1)
        self._position = np.argsort(cells.cell_indices)  # of each cell in the mesh
        # Unknown until the start of a run
        self._tangents = [np.full((len(beams.points.D), 3, 3), np.nan) for beams in yielding]
        for beams in yielding:
            beams.points.keeps_tangents = True
        super().__init__(setting, inertia.scheme, inertia.mass.matrix)

    def response(self, step: Step, q1: Array) -> Response:
        """Return forces and derivative; a new step has a new matrix."""
        if step is not self._step:
            self._step = step
            for beams, tangents in zip(self._yielding, self._tangents, strict=True):
                cells = self._position[beams.cells.cell_indices]
                self._sections[cells] = tangents.reshape(len(cells), -1, 3, 3)
            put(self._D, self._sections)
            self._cells.set(self._cells.element.q0, step.q0)
            K = self._damping.stiffness * self._stiffness.assembled()
            self.matrix = self._damping.mass * self.inertia.matrix + K
        return super().response(step, q1)

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the energy lost by damping in the ledger, and accept new tangents."""
        super().accept(step, q1, s)
        for beams, tangents in zip(self._yielding, self._tangents, strict=True):
            tangents[:] = positive(beams.points.end_tangents, beams.points.elastic())

    def start(self, q: Array) -> None:
        """Set unknown tangents to the elastic stiffness."""
        for beams, tangents in zip(self._yielding, self._tangents, strict=True):
            elastic = positive(beams.points.elastic_tangent(), beams.points.elastic())
            tangents[:] = np.where(np.isnan(tangents), elastic, tangents)

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the tangents."""
        for beams, tangents in zip(self._yielding, self._tangents, strict=True):
            rows = tangents.reshape(len(beams.rows), -1)
            tangents[:] = archive.rows("committed tangents", beams.rows, rows).reshape(
                tangents.shape
            )


def positive(D: Array, C: Array) -> Array:
    """Return the symmetric part of D without its negative eigenvalues.

    The eigenvalues belong to D scaled by the stiffnesses C.  D is (n, 3, 3), C (n, 3).
    """
    scale, symmetric = np.sqrt(C[:, :, None] * C[:, None, :]), (D + D.transpose(0, 2, 1)) / 2
    values, vectors = np.linalg.eigh(symmetric / scale)
    negative = np.einsum("nik,nk,njk->nij", vectors, np.minimum(values, 0.0), vectors)
    return np.asarray(symmetric - negative * scale)


class KelvinVoigtForce(CellForce):
    """Kelvin-Voigt damping: resultants C Δe/Δt times the retardation time."""

    def __init__(self, damping: KelvinVoigt, indices: Index, setting: Setting) -> None:
        cells = Cells(setting.numbering, indices)
        element, self._time, self._rate = (
            cells.element,
            damping.retardation_time,
            cells.element.constant(1.0),
        )
        change = strain(element.q1, element.axis) - strain(element.q0, element.axis)
        r = self._rate * resultants(change, element.stiffness)
        w_e = setting.scheme.virtual_strain(element.q0, element.q1, element.w, element.axis)
        lost = virtual_work(r, change) * element.dx(1), "damping"
        super().__init__(cells, virtual_work(r, w_e) * element.dx(1), setting, lost=lost)

    def response(self, step: Step, q1: Array) -> Response:
        """Return the virtual work at the strain rates of the step, and its derivative."""
        self._rate.value = self._time / step.dt
        return super().response(step, q1)


def damping_forces(
    setting: Setting, inertia: Inertia | None, yielding: Sequence[YieldingBeams]
) -> list[Force]:
    """Return the forces of all damping in a scene."""
    forces: list[Force] = []
    for damping in setting.numbering.scene.damping:
        setting.loses("damping")
        if isinstance(damping, KelvinVoigt):
            beams = setting.numbering.scene.beams if damping.beams is None else damping.beams
            # Beams whose cells may have hinges are left out, so that an open hinge turns freely.
            cells = [
                setting.numbering.cells_of(beam) for beam in beams if beam.section.hinge is None
            ]
            if cells:
                indices = np.unique(np.concatenate(cells))
                forces.append(KelvinVoigtForce(damping, indices, setting))
        elif inertia is None:
            raise ModelError(
                "Rayleigh: it damps vibrations, and statics has no inertia. Leave it out, by "
                "dataclasses.replace(scene, damping=())"
            )
        elif damping.tangent:
            forces.append(TangentRayleighForce(damping, setting, inertia, yielding))
        else:
            forces.append(RayleighForce(damping, setting, inertia))
    return forces
