# SPDX-License-Identifier: MIT
"""Loads, users' virtual works and potentials, supports and prescribed motions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy  # its subpackages are loaded when they are used
import ufl
from scipy.sparse import csr_array

from old_reference.beam_residuals import Inertia, Mass
from old_reference.cell_forms import (
    Archive,
    CellForce,
    Cells,
    Force,
    Response,
    Setting,
    coupled,
    end_forces,
    point_masses,
)
from old_reference.work_forms import GROWTH, statement
from ufl_beam.arrays import Array
from ufl_beam.mechanics.kinematics import perpendicular, split
from ufl_beam.mechanics.time_scheme import Step, acting, combined, has_inertia, nodal_step
from ufl_beam.model.bodies import GROUND, moves_with_node
from ufl_beam.model.functions import value_at
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.loads import (
    FollowerLoad,
    Gravity,
    LineLoad,
    Load,
    MovingLoad,
    PointLoad,
    Pressure,
    RotatingFrame,
)
from ufl_beam.model.works import Potential, Work

AT_REST = 1e300  # largest step length in forms, so large that all rates vanish; s


class LoadForce(Force, ABC):
    """Base of loads: forces that may depend on the configuration, times a function of time.

    Attributes:
        force: Nodal forces in the latest response; (size,).
        along: :attr:`on_nodes` of loads along beams, for a factor of one.
    """

    along: Array | float = 0.0

    def __init__(self, load: Load | RotatingFrame, setting: Setting) -> None:
        self.size, self.load, self.scheme = setting.numbering.size, load, setting.scheme
        self.time = (lambda t: 1.0) if isinstance(load, RotatingFrame) else load.amplitude
        self.force: Array = np.zeros(self.size)
        self._before: Array = self.force
        self.factor, self._reached, self.supplied = 0.0, 0.0, setting.ledger.supplied
        self.supplied["loads"] += 0.0

    @abstractmethod
    def forces(self, q: Array) -> Response:
        """Return forces at the configuration ``q`` for a factor of one, and their derivative."""

    def place(self, step: Step, q1: Array) -> Array:
        """Return the configuration at which the load acts if the step ends at ``q1``."""
        return np.asarray(step.q0 + self.scheme.load_weight * (q1 - step.q0))

    def response(self, step: Step, q1: Array) -> Response:
        """Return minus the load and its derivative; a substep applies a part of the increment."""
        wanted = value_at(self.time, step.load_time, self.load)
        growth = step.fraction * (wanted - self._reached)
        self.factor, self._end = self._reached + step.at * growth, self._reached + growth
        forces, slope = self.forces(self.place(step, q1))
        self.force, self.on_nodes = self.factor * forces, self.factor * self.along
        return -self.force, -self.factor * self.scheme.load_weight * slope

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the work of the load on the nodal step in the ledger."""
        self.supplied["loads"] += float(acting(self.scheme, self._before, self.force) @ s)
        self._before, self._reached = self.force, self._end

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """Return the load at time ``t``, which is assumed in equilibrium with the initial state."""
        self._reached = value_at(self.time, t, self.load)
        self.force = self._before = self._reached * self.forces(q)[0]
        return self.force


class DeadLoad(LoadForce):
    """Dead load: consistent nodal forces times a function of time."""

    def __init__(self, load: Load, setting: Setting) -> None:
        super().__init__(load, setting)
        numbering = setting.numbering
        scene, self._vector = numbering.scene, np.zeros(numbering.size)
        cells, nodes = np.arange(len(numbering.cells)), numbering.mesh.nodes
        along: Array = np.zeros((len(cells), 3, len(nodes)))  # forces on the nodes in order
        # Point loads on a body, except at its centre, are connectors in Scene.all_connectors.
        if isinstance(load, PointLoad) and moves_with_node(load.place):
            np.add.at(self._vector, numbering.node(load.place), [*load.force, load.moment])
        elif isinstance(load, LineLoad):
            s = numbering.parameters(load.beam)
            for cell, s0, s1 in zip(numbering.cells_of(load.beam), s[:-1], s[1:], strict=True):
                for point, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
                    at = (1 + point) / 2
                    factor = load.factors(np.array([s0 + at * (s1 - s0)]))[0] * weight / 2
                    along[cell] += np.outer(
                        [*load.force, load.moment], factor * numbering.mesh.weights(at)
                    )
        elif isinstance(load, Gravity):
            rhoA = np.array([beam.section.rhoA for beam in scene.beams])[numbering.beam_of_cell]
            along[:, :2] = np.multiply.outer(
                np.outer(rhoA, load.acceleration), numbering.mesh.fractions
            )
            for dofs, mass, _ in point_masses(numbering):
                np.add.at(self._vector, dofs[:2], mass * np.array(load.acceleration))
        elif not isinstance(load, PointLoad):
            raise TypeError(f"{type(load).__name__} is not a dead load")
        along *= numbering.lengths(cells)[:, None, None]
        inner = range(1, len(nodes) - 1)
        along = along[:, :, [0, len(nodes) - 1, *inner]]  # in the order of the nodes of cells
        np.add.at(self._vector, numbering.dofs[numbering.nodes_of_cells].transpose(0, 2, 1), along)
        self.along = end_forces(numbering, "density", cells, -along)

    def forces(self, q: Array) -> Response:
        """Return the consistent nodal forces, and their derivative, which is zero."""
        return self._vector, np.zeros((self.size, self.size))


class Follower(LoadForce):
    """Follower load: it rotates with the cross-section or body that it acts on."""

    def __init__(self, load: FollowerLoad, setting: Setting) -> None:
        super().__init__(load, setting)
        self._dofs, self._unit_force = (
            setting.numbering.node(load.place),
            (*load.force, load.moment),
        )

    def forces(self, q: Array) -> Response:
        """Return (F_x, F_y, M) turned with the node, and the derivative."""
        (x, y, M), ψ, force = self._unit_force, q[self._dofs[2]], np.zeros(self.size)
        c, s = math.cos(ψ), math.sin(ψ)
        x, y = c * x - s * y, s * x + c * y
        np.add.at(force, self._dofs, [x, y, M])
        rotations = np.repeat(self._dofs[2], 2)
        return force, coupled(self.size, self._dofs[:2], rotations, np.array([-y, x]))


class PressureForce(LoadForce):
    """Pressure: forces along dx and its normal, by the work of each node's shape function."""

    def __init__(self, load: Pressure, setting: Setting) -> None:
        super().__init__(load, setting)
        self._numbering = numbering = setting.numbering
        cells, mesh = numbering.cells_of(load.beam), numbering.mesh
        s, nodes = numbering.parameters(load.beam), numbering.nodes_of_cells[cells]
        start, *inner, end = range(len(mesh.nodes))
        order = [start, end, *inner]  # of the nodes of cells
        forces: Array = np.zeros((len(cells), 2 * len(order), 2 * len(order)))
        turned = np.array([[load.tangential, -load.normal], [load.normal, load.tangential]])
        for k, (s0, s1) in enumerate(pairwise(s)):
            for point, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
                at = (1 + point) / 2
                factor = load.factors(np.array([s0 + at * (s1 - s0)]))[0] * weight / 2
                pair = np.outer(mesh.weights(at)[order], mesh.slopes(at)[order])
                forces[k] += np.kron(turned, factor * pair)
        self._cells, self._matrices = cells, forces
        dofs = numbering.dofs[nodes][:, :, :2].transpose(0, 2, 1).reshape(len(cells), -1)
        self._places = numbering.points[nodes].transpose(0, 2, 1).reshape(dofs.shape)
        self._dofs, rows = dofs, np.repeat(dofs, dofs.shape[1], axis=1)
        self._slope = coupled(self.size, rows, np.tile(dofs, dofs.shape[1]), forces)

    def forces(self, q: Array) -> Response:
        """Return the nodal forces, which are linear in the positions of the nodes."""
        x, vector = self._places + q[self._dofs], np.zeros(self.size)
        on_cells = np.einsum("kij,kj->ki", self._matrices, x)
        np.add.at(vector, self._dofs, on_cells)
        on_nodes = np.zeros((len(on_cells), 3, self._dofs.shape[1] // 2))
        on_nodes[:, :2] = on_cells.reshape(len(on_cells), 2, -1)
        self.along = end_forces(self._numbering, "density", self._cells, -on_nodes)
        return vector, self._slope


class MovingForce(LoadForce):
    """Force and mass that move along a route of beams.

    Substeps in statics apply a part of the change of the nodal forces.  The mass has rates of its
    own, with which the scheme gives it the velocity of the axis at its place in each step.
    """

    def __init__(self, load: MovingLoad, setting: Setting, inertia: Inertia | None) -> None:
        super().__init__(load, setting)
        self._numbering, self._moving = setting.numbering, load
        self._inertia = inertia if load.mass else None
        self._reached_forces = self._on_cell(0.0, np.zeros(2))
        self._rates: list[Array] | None = None  # velocity, velocity before the last step, further
        if self._inertia is not None:
            self.stored = {"kinetic": 0.0}

    def _at(self, t: float) -> tuple[int, Array, Array, Array] | None:
        """Return the loaded cell at a time, its degrees of freedom (3, n), shapes and slopes."""
        numbering, load = self._numbering, self._moving
        d = value_at(load.position, t, load)
        cells = np.concatenate([numbering.cells_of(beam) for beam in load.route])
        ends, mesh = np.append(0.0, np.cumsum(numbering.lengths(cells))), numbering.mesh
        if not 0.0 <= d <= ends[-1]:
            return None
        i = max(int(np.searchsorted(ends, d)) - 1, 0)
        first, *inner, last = range(len(mesh.nodes))
        h, order = ends[i + 1] - ends[i], [first, last, *inner]
        s, dofs = (d - ends[i]) / h, numbering.dofs[numbering.nodes_of_cells[cells[i]]]
        return int(cells[i]), dofs.T, mesh.weights(s)[order], mesh.slopes(s)[order] / h

    def _on_cell(self, t: float, force: Array) -> tuple[Array, Array]:
        """Return nodal forces of a force at its place at time ``t``, and :attr:`on_nodes`."""
        vector, at = np.zeros(self.size), self._at(t)
        if at is None:
            return vector, np.zeros((9, len(self._numbering.cells)))
        cell, dofs, shapes, _ = at
        on_nodes = np.zeros((1, 3, len(shapes)))
        on_nodes[0, :2] = np.outer(force, shapes)
        vector[dofs[:2]] += on_nodes[0, :2]
        return vector, end_forces(self._numbering, "density", np.array([cell]), -on_nodes)

    def _forces_at(self, t: float) -> tuple[Array, Array]:
        size = value_at(self.time, t, self.load)
        return self._on_cell(t, size * np.array(self._moving.force))

    def _velocity(self, t: float, q: Array, v: Array, speed: float) -> Array:
        """Return the velocity of the axis at the place of the mass, which moves with ``speed``."""
        at = self._at(t)
        assert at is not None
        cell, dofs, shapes, slopes = at
        points = self._numbering.points[self._numbering.nodes_of_cells[cell]]
        place = (points - points[0]).T + q[dofs[:2]]
        return np.asarray(v[dofs[:2]] @ shapes + speed * (place @ slopes))

    def _speed(self, t: float, before: float, after: float) -> float:
        """Return the speed along the beam from places at times before and after ``t``."""
        ends = (value_at(self._moving.position, t + x, self._moving) for x in (-before, after))
        return (-next(ends) + next(ends)) / (before + after)

    def _mass_step(self, step: Step, q1: Array) -> tuple[Array, Array] | None:
        """Return the step of the mass in the rates of the scheme, and its acceleration."""
        inertia, rates = self._inertia, self._rates
        if inertia is None or rates is None or self._at(step.load_time) is None:
            return None
        s = nodal_step(self.scheme, step.q0, q1, self._numbering.rotations)
        rows = inertia.scheme.coefficients(step.dt, inertia.last_dt, len(inertia.more))[:2]
        speed = self._speed(step.load_time, step.dt / 2, step.dt / 2)
        at_axis = self._velocity(
            step.load_time, self.place(step, q1), combined(rows[1], s, inertia), speed
        )
        known = [sum(c * x for c, x in zip(row[1:], rates, strict=False)) for row in rows]
        mine = np.asarray((at_axis - known[1]) / rows[1][0], dtype=np.float64)
        return mine, np.asarray(known[0] + rows[0][0] * mine)

    def _mass_forces(self, step: Step, q1: Array) -> tuple[Array, Array, Array]:
        """Return nodal forces of the mass, :attr:`on_nodes`, and the derivative of the forces."""
        inertia, slope, found = self._inertia, np.zeros((self.size,) * 2), self._mass_step(step, q1)
        if found is None or inertia is None:
            return *self._on_cell(step.load_time, np.zeros(2)), slope
        at = self._at(step.load_time)
        assert at is not None
        _, dofs, shapes, slopes = at
        rows = inertia.scheme.coefficients(step.dt, inertia.last_dt, len(inertia.more))[:2]
        speed = self._speed(step.load_time, step.dt / 2, step.dt / 2)
        by_node = rows[1][0] * shapes + self.scheme.load_weight * speed * slopes
        factor = -self._moving.mass * rows[0][0] / rows[1][0]
        for k in (0, 1):
            slope[np.ix_(dofs[k], dofs[k])] += factor * np.outer(shapes, by_node)
        return *self._on_cell(step.load_time, -self._moving.mass * found[1]), slope

    def _enter(self, t: float, q: Array, rates: Sequence[Array]) -> None:
        """Set the rates of the mass to those of the axis at its place; None outside of the route.

        ``rates`` are velocities and further rates of the nodes.
        """
        self._rates = None
        if self._at(t) is not None:
            h = 1e-4  # s
            speed = 2 * self._speed(t, 0.0, h) - self._speed(t, 0.0, 2 * h)
            v, *more = (self._velocity(t, q, x, speed * (k == 0)) for k, x in enumerate(rates))
            self._rates = [v, v, *more]
        self._count()

    def _count(self) -> None:
        """Set the kinetic energy."""
        v = np.zeros(2) if self._rates is None else self._rates[0]
        self.stored = {"kinetic": float(self._moving.mass / 2 * v @ v)}

    def forces(self, q: Array) -> Response:
        """Return the forces of the latest step, and their derivative, which is zero."""
        return self.force, np.zeros((self.size, self.size))

    def response(self, step: Step, q1: Array) -> Response:
        """Return minus the forces of load and mass, and their derivative."""
        wanted = self._forces_at(step.load_time)
        pairs = list(zip(self._reached_forces, wanted, strict=True))
        force, on_cells = (a + step.fraction * (b - a) for a, b in pairs)
        self._end_forces = force, on_cells
        self.force, self.on_nodes = (a + step.at * step.fraction * (b - a) for a, b in pairs)
        force, on_nodes, slope = self._mass_forces(step, q1)
        self.force, self.on_nodes = self.force + force, self.on_nodes + on_nodes
        return -self.force, -slope

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the work of the load, and of the drive of the mass, in the ledger."""
        self._end = 0.0
        super().accept(step, q1, s)
        self._reached_forces = self._end_forces
        if self._inertia is not None:
            before, found, inertia = (
                self.stored["kinetic"],
                self._mass_step(step, q1),
                self._inertia,
            )
            if found is None or self._rates is None:
                self._enter(step.t1, q1, inertia.after(s))
            else:
                known, last = self._after(step, found[0]), self._rates[0]
                self._rates = [known[0], last, *known[1:]]
                if self._at(step.t1) is None:
                    self._rates = None
                self._count()
            self.supplied["loads"] += self.stored["kinetic"] - before

    def _after(self, step: Step, mine: Array) -> list[Array]:
        """Return velocity and further rates of the mass after its step ``mine``."""
        inertia, rates = self._inertia, self._rates
        assert inertia is not None
        assert rates is not None
        rows = inertia.scheme.coefficients(step.dt, inertia.last_dt, len(inertia.more)).rates
        known = (mine, *rates)
        return [sum((c * x for c, x in zip(row, known, strict=False)), np.zeros(2)) for row in rows]

    def prepare(self, step: Step, q1: Array) -> None:
        """Take further rates of the mass from a trial step."""
        found = self._mass_step(step, q1)
        if found is not None and self._rates is not None:
            self._rates = [*self._rates[:2], *self._after(step, found[0])[1:]]

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """Return the load at time ``t``, which is assumed in equilibrium with the initial state."""
        self._reached_forces = self._forces_at(t)
        self.force = self._before = self._reached_forces[0]
        if v is not None:
            self.begin_energy(t, q, v)
        return self.force

    def begin_energy(self, t: float, q: Array, v: Array) -> None:
        """Set the rates of the mass at the time ``t``."""
        if self._inertia is not None:
            self._enter(t, q, [v])

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the forces in the last step and the rates of the mass."""
        if self._inertia is not None:
            number = self._numbering.scene.loads.index(self._moving)
            self._before = archive.vector(f"moving mass {number}", self._before)
            rates = archive.vector(f"rates of moving mass {number}", np.ravel(self._rates or []))
            self._rates = [*rates.reshape(-1, 2)] or None
            self._count()


class FrameForce(LoadForce):
    """Centrifugal forces, which have a potential, and Coriolis forces, which do no work.

    The frame rotates at a constant rate, so its rotation adds no moments of rotary inertia.
    :meth:`equilibrium` has no Coriolis forces: they do no work, statics has none, and schemes
    without a mean velocity, which need the forces of the initial state, refuse the frame.
    """

    def __init__(self, frame: RotatingFrame, setting: Setting, mass: Mass) -> None:
        super().__init__(frame, setting)
        numbering, self._Ω, self._mass, element = (
            setting.numbering,
            frame.rate,
            mass,
            mass.cells.element,
        )
        self._double = 2 * self._Ω * has_inertia(setting.scheme)
        self._translational: Array = np.ones(numbering.size)
        self._translational[numbering.rotations] = 0.0
        self._pull = mass.matrix * (self._Ω**2 * self._translational[:, None])
        nodes = np.concatenate([numbering.dofs_of_bodies, numbering.dofs])
        self._pairs = np.unique(nodes[:, :2], axis=0)  # degrees of freedom u, v of the nodes
        # G: mass times a rotation by 90°.  The Coriolis forces are -2 Ω G v.
        (u, _), (w_u, _) = split(ufl.TrialFunction(element.space)), split(element.w)
        density = element.inertia[0] * ufl.dot(perpendicular(u), w_u)
        G = mass.cells.form(density * element.dx_of_mass()).assembled()
        for (i, j, _), m, _ in point_masses(numbering):
            G = G + coupled(
                numbering.size, np.array([i, j]), np.array([j, i]), m * np.array([-1, 1])
            )
        self._gyro = self._double * G
        centers = np.array([body.center for body in numbering.scene.rigid_bodies]).reshape(-1, 2)
        self._places: Array = np.zeros(numbering.size)  # positions from the centre of rotation
        self._places[nodes[:, :2]] = np.concatenate([centers, numbering.points]) - frame.about

    def forces(self, q: Array) -> Response:
        """Return the centrifugal forces at the positions of the nodes, and their derivative."""
        return np.asarray(self._pull @ (self._places + q)), self._pull

    def response(self, step: Step, q1: Array) -> Response:
        """Return minus the forces, and the derivative; Coriolis forces use mean velocities."""
        r, K = super().response(step, q1)
        coriolis = self._gyro @ (q1 - step.q0) / step.dt
        return np.asarray(r + coriolis), K + self._gyro / step.dt

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the work, and store forces on cells from the accelerations of the frame."""
        super().accept(step, q1, s)
        v = (q1 - step.q0) / step.dt
        a = -self.factor * self._Ω**2 * self._translational * (self._places + self.place(step, q1))
        a[self._pairs[:, 0]] -= self._double * v[self._pairs[:, 1]]
        a[self._pairs[:, 1]] += self._double * v[self._pairs[:, 0]]
        self.on_nodes = self._mass.on_nodes(a)


class WorkForce(CellForce):
    """Virtual work or potential of a user on the cells on which it acts.

    Forces of a potential always act fully.  In statics, virtual works grow from zero within the
    first step, as loads do.
    """

    def __init__(self, work: Work, setting: Setting, t0: float) -> None:
        numbering, scheme, supplied = setting.numbering, setting.scheme, setting.ledger.supplied
        indices = np.concatenate(
            [numbering.cells_of(beam) for beam in work.on(numbering.scene.beams)]
        )
        cells = Cells(numbering, indices)
        self._forms = forms = statement(work, cells.element, scheme)
        energy = None if forms.energy is None else (forms.energy, work.name)
        lost = None if forms.lost is None else (forms.lost, "numerical")
        super().__init__(cells, forms.residual, setting, stored=energy, lost=lost, kind="work")
        self._work, self._scheme = work, scheme
        self._varies, self._is_potential = forms.varies(work), isinstance(work, Potential)
        self._t, self._grown = t0, 0.0
        self.force: Array = np.zeros(numbering.size)
        self._before: Array = self.force
        if not self._is_potential:
            supplied[work.name] += 0.0
        if self._varies:
            supplied[work.in_time] += 0.0

    def _put(self, t: float, **clock: float) -> None:
        """Set time, growth, step length, and the user's parameters in the forms."""
        parameters = self._work.numbers.items()
        values = {n: value_at(x, t, self._work) if callable(x) else x for n, x in parameters}
        for name, value in {"t": t, **clock, **values}.items():
            self._forms.parameters[name].x.array[:] = value
        self._at = t

    def response(self, step: Step, q1: Array) -> Response:
        """Return minus the virtual work, or the gradient of the potential, and the derivative.

        A substep applies the same part of the increment as loads do.
        """
        fraction, growth = step.fraction, step.fraction * (1.0 - self._grown)
        self._end = self._t + fraction * (step.motion_time - self._t), self._grown + growth
        t = self._t + step.at * fraction * (step.load_time - self._t)
        self._put(t, **{"dt": min(step.dt, AT_REST), GROWTH: self._grown + step.at * growth})
        r, K = super().response(step, q1)
        self.force = -r
        return r, K

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Enter the work of the step in the ledger."""
        name, supplied, at = self._work.name, self.ledger.supplied, np.array(self._at)
        if not self._is_potential:
            supplied[name] += float(acting(self._scheme, self._before, self.force) @ s)
        stored, t = self.stored.get(name, 0.0), float(acting(self._scheme, np.array(self._t), at))
        self._before, (self._t, self._grown) = self.force, self._end
        super().accept(step, q1, s)
        if self._varies:  # supplied as time passes: the change of energy minus the change by motion
            self._put(t)
            moved = self.energy(q1) - self.energy(step.q0)
            supplied[self._work.in_time] += self.stored[name] - stored - moved

    def start(self, q: Array) -> None:
        """Compute the energy of a potential."""
        if self._is_potential:
            self._put(self._t)
            super().start(q)

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """Return the forces at ``q``, the end of a step of 1 s with constant velocities ``v``."""
        self._t, self._grown = t, 1.0
        self.cells.set(self.element.q0, q if v is None else q - v)
        self.cells.set(self.element.q1, q)
        self._put(t, **{"dt": AT_REST if v is None else 1.0, GROWTH: 1.0})
        self.force = self._before = -self.work.joined(self.work.assembled())
        return self.force

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the forces in the last step if they depend on velocities."""
        if self._work.takes_rates and self._scheme.weight_of_before and not self._is_potential:
            self._before = archive.vector(f"work of {self._work.name}", self._before)


def all_loads(setting: Setting, inertia: Inertia | None, t0: float) -> list[LoadForce | WorkForce]:
    """Return all loads and works of a scene."""
    loads: list[LoadForce | WorkForce] = []
    mass = None if inertia is None else inertia.mass
    for load in setting.numbering.scene.loads:
        if isinstance(load, RotatingFrame):
            loads.append(FrameForce(load, setting, mass or Mass(setting.numbering)))
        elif isinstance(load, FollowerLoad):
            loads.append(Follower(load, setting))
        elif isinstance(load, ImposedStrain):  # see imposed_strains.py
            setting.ledger.supplied["loads"] += 0.0
        elif isinstance(load, MovingLoad):
            loads.append(MovingForce(load, setting, inertia))
        elif isinstance(load, Pressure):
            loads.append(PressureForce(load, setting))
        else:
            loads.append(DeadLoad(load, setting))
    return [*loads, *(WorkForce(work, setting, t0) for work in setting.numbering.scene.works)]


# -- supports ------------------------------------------------------------------------------------


class Supports:
    """Supports of a scene, which may be at an angle to the axes of the plane.

    Attributes:
        axes: Orthogonal matrix from components in the plane to components along support axes.
        constrained: Constrained or prescribed degrees of freedom, in the axes of the supports.
        free: All other degrees of freedom, which are the unknowns of a step.
        reactions: Forces of the supports in the latest residual, in the same axes; (size,).
        before: Reactions of the accepted step.
    """

    def __init__(self, setting: Setting) -> None:
        self._numbering, self._scheme = setting.numbering, setting.scheme
        numbering, self._supplied = setting.numbering, setting.ledger.supplied
        axes = scipy.sparse.eye_array(numbering.size).tolil()
        constrained: dict[int, None] = {}
        if GROUND in numbering.scene.rigid_bodies:
            constrained = {int(dof): None for dof in numbering.node(GROUND.middle)}
        self._motions = []
        for support in numbering.scene.supports:
            dofs = numbering.node(support.place)
            if support.angle:
                c, s, (i, j) = math.cos(support.angle), math.sin(support.angle), dofs[:2]
                axes[i, i], axes[i, j], axes[j, i], axes[j, j] = c, s, -s, c
            constrained |= {int(dofs[component]): None for component in support.held}
            for component, motion in support.moving.items():
                self._motions.append((int(dofs[component]), motion, support))
        self.axes = csr_array(axes.tocsr())
        self.constrained = np.array(sorted(constrained), dtype=np.int64)
        self.free = np.setdiff1d(np.arange(numbering.size), self.constrained)
        self.before: Array = np.zeros(numbering.size)
        self.store_reactions(self.before)
        if self._motions:
            self._supplied["supports"] += 0.0

    def move(self, x: Array, x0: Array, step: Step) -> None:
        """Set the constrained and prescribed values in ``x`` for the step that begins at ``x0``."""
        x[self.constrained] = x0[self.constrained]
        for dof, motion, support in self._motions:
            wanted = value_at(motion, step.motion_time, support)
            x[dof] = x0[dof] + step.fraction * (wanted - x0[dof])

    def stop(self, v: Array) -> Array:
        """Return initial velocities with zeros at fixed supports; others would oscillate there."""
        x = self.axes @ v
        moving = [dof for dof, *_ in self._motions]
        x[np.setdiff1d(self.constrained, moving)] = 0.0
        return np.asarray(self.axes.T @ x)

    def store_reactions(self, r: Array) -> None:
        """Store the reactions in a residual ``r``, which is in the axes of the supports."""
        self.reactions: Array = np.zeros(len(r))
        self.reactions[self.constrained] = r[self.constrained]

    def accept(self, s: Array) -> None:
        """Enter the work of moving supports on the nodal step in the ledger."""
        if self._motions:
            force = acting(self._scheme, self.before, self.reactions)
            self._supplied["supports"] += float(force @ (self.axes @ s))
        self.before = self.reactions

    def forces(self) -> Array:
        """Return force and moment of each support on the scene; (num_supports, 3); N, N, N m."""
        forces = np.zeros((len(self._numbering.scene.supports), 3))
        for force, support in zip(forces, self._numbering.scene.supports, strict=True):
            components = [*support.held]
            force[components] = self.before[self._numbering.node(support.place)[components]]
            c, s = math.cos(support.angle), math.sin(support.angle)
            force[:2] = c * force[0] - s * force[1], s * force[0] + c * force[1]
        return forces
