# SPDX-License-Identifier: MIT
"""Loads: dead and follower loads, rotating frames, virtual works and potentials of users."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import ufl
from scipy.sparse import csr_array

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.work_forms import GROWTH, statement
from ufl_beam.mechanics.kinematics import split, turn
from ufl_beam.mechanics.time_schemes import Scheme, Step, acting, has_inertia
from ufl_beam.model.bodies import carries
from ufl_beam.model.loads import FollowerLoad, Gravity, LineLoad, Load, PointLoad, RotatingFrame
from ufl_beam.model.time_functions import value_at
from ufl_beam.model.works import Potential, Work
from ufl_beam.reference.beams import CellForce, Mass
from ufl_beam.reference.cells import Cells, Force, Ledger, OnNodes, coupled, lumps

AT_REST = 1e300
"""Longest step that forms are told of, in which all rates vanish; s."""


class LoadForce(Force):
    """Base of loads: their work is that of their forces on the step of the nodes.

    Attributes:
        force: In the latest residual; (size,).
    """

    def __init__(self, size: int, scheme: Scheme, ledger: Ledger, entry: str = "loads") -> None:
        self.size, self.scheme, self.ledger, self._entry = size, scheme, ledger, entry
        self.force: Array = np.zeros(size)
        self.before: Array = self.force
        ledger.supplied[entry] += 0.0

    def enter_work(self, force: Array, s: Array, end: Array) -> None:
        """Enter the work of the step; ``end`` are the forces before the next one."""
        self.ledger.supplied[self._entry] += float(acting(self.scheme, self.before, force) @ s)
        self.before = end


class DeadLoad(LoadForce):
    """Dead load: a vector times a function of time."""

    def __init__(self, load: Load, grid: Grid, scheme: Scheme, ledger: Ledger) -> None:
        super().__init__(grid.size, scheme, ledger)
        self._load, self._grid = load, grid
        self._vector, self._along = _nodal_forces(load, grid)
        self._now = self._end = self._reached = 0.0  # factors: acting, at the ends of the steps

    def begin(self, step: Step) -> None:
        """Find the factor in the step; parts of a step go in proportion."""
        factor = value_at(self._load.time, step.load_time, self._load)
        change = step.fraction * (factor - self._reached)
        self._end = factor if step.fraction == 1 else self._reached + change
        self._now = self._end if step.at == 1 else self._reached + step.at * change
        self.force = self._now * self._vector

    def residual(self, q1: Array) -> Array:
        """Minus the load of the step."""
        return -self.force

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the work of the load."""
        self.enter_work(self.force, s, self._end * self._vector)
        self._reached, self._acted = self._end, self._now

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """The load at the time ``t``."""
        self._reached = value_at(self._load.time, t, self._load)
        self.before = self._reached * self._vector
        return self.before

    def on_nodes(self) -> Sequence[OnNodes]:
        """The load along beams."""
        if self._along is None:
            return ()
        return [OnNodes("density", np.arange(len(self._along)), -self._now * self._along)]


def _nodal_forces(load: Load, grid: Grid) -> tuple[Array, Array | None]:
    """Consistent nodal forces of a dead load, (size,); those along beams, (num_cells, 3, nodes)."""
    scene, vector = grid.scene, np.zeros(grid.size)
    of_beams = np.zeros((len(scene.beams), 3))
    if isinstance(load, PointLoad) and carries(load.place):  # else Scene.links has connectors
        np.add.at(vector, grid.node(load.place), [*load.force, load.moment])
    elif isinstance(load, LineLoad):
        of_beams[scene.beams.index(load.beam)] = *load.force, load.moment
    elif isinstance(load, Gravity):
        of_beams[:, :2] = np.outer([b.section.rhoA for b in scene.beams], load.acceleration)
        for dofs, mass, _ in lumps(grid):
            np.add.at(vector, dofs[:2], mass * np.array(load.acceleration))
    if not of_beams.any():
        return vector, None
    total = of_beams[grid.beam_of_cell] * grid.lengths(np.arange(len(grid.cells)))[:, None]
    first, *between, last = grid.mesh.parts
    along = total[:, :, None] * np.array([first, last, *between])
    np.add.at(vector, grid.dofs[grid.nodes_of_cells].transpose(0, 2, 1), along)
    return vector, along


class Follower(LoadForce):
    """Follower load: it turns with the cross-section or body that it acts on."""

    def __init__(self, load: FollowerLoad, grid: Grid, scheme: Scheme, ledger: Ledger) -> None:
        super().__init__(grid.size, scheme, ledger)
        self._load, self._dofs = load, grid.node(load.place)
        self._given = np.array([*load.force, load.moment])
        self._now = self._end = self._reached = 0.0
        self._part = scheme.load_weight  # part of the step at whose rotation it acts

    def begin(self, step: Step) -> None:
        """Find the factor in the step."""
        factor = value_at(self._load.time, step.load_time, self._load)
        self._end = self._reached + step.fraction * (factor - self._reached)
        self._now = self._reached + step.at * (self._end - self._reached)
        self._turn0 = step.q0[self._dofs[2]]

    def _acting(self, q1: Array) -> Array:
        """(F_x, F_y, M) in the step to ``q1``."""
        ψ = self._turn0 + self._part * (q1[self._dofs[2]] - self._turn0)
        (x, y, M), c, s = self._now * self._given, math.cos(ψ), math.sin(ψ)
        return np.array([c * x - s * y, s * x + c * y, M])

    def residual(self, q1: Array) -> Array:
        """Minus the load of the step."""
        self.force = np.zeros(self.size)
        np.add.at(self.force, self._dofs, self._acting(q1))
        return -self.force

    def tangent(self, q1: Array) -> csr_array:
        """Its derivative by the rotation."""
        x, y, _ = self._acting(q1)
        slope = self._part * np.array([y, -x])
        return coupled(self.size, self._dofs[:2], np.repeat(self._dofs[2], 2), slope)

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the work of the load."""
        self.residual(q1)
        self.enter_work(self.force, s, self.force)
        self._reached = self._end

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """The load at the time ``t``."""
        self._reached = self._now = value_at(self._load.time, t, self._load)
        self._turn0 = q[self._dofs[2]]
        self.residual(q)
        self.before = self.force
        return self.force


class FrameForce(LoadForce):
    """Centrifugal and Coriolis forces; the first have a potential, the second do no work.

    Rotary inertia keeps its spin in steady rotation, so no moments come of it.
    """

    def __init__(
        self, frame: RotatingFrame, grid: Grid, mass: Mass, scheme: Scheme, ledger: Ledger
    ) -> None:
        super().__init__(grid.size, scheme, ledger)
        Ω, self._grid, self._mass = frame.rate, grid, mass
        no_turn: Array = np.ones(grid.size)
        no_turn[grid.rotations] = 0.0
        self._pull = csr_array(mass.matrix.multiply(Ω**2 * no_turn[:, None]))
        self._gyro = 2 * Ω * has_inertia(scheme) * _turned_mass(grid, mass.cells)
        self._no_turn, self._Ω, self._double = no_turn, Ω, 2 * Ω * has_inertia(scheme)
        centers = np.array([body.center for body in grid.scene.rigid_bodies]).reshape(-1, 2)
        self._places: Array = np.zeros(grid.size)  # from the centre of rotation
        nodes = np.concatenate([grid.dofs_of_bodies, grid.dofs])
        self._places[nodes[:, :2]] = np.concatenate([centers, grid.points]) - frame.about
        self._grown = self._accelerations = 0.0

    def begin(self, step: Step) -> None:
        """Remember the beginning, and how much of the forces acts."""
        self._q0, self._dt = step.q0, step.dt
        growth = step.fraction * (1.0 - self._grown)
        self._growth, self._end = self._grown + step.at * growth, self._grown + growth

    def residual(self, q1: Array) -> Array:
        """Minus the centrifugal forces where the scheme takes loads; Coriolis forces."""
        q = self._q0 + self.scheme.load_weight * (q1 - self._q0)
        self.force = self._growth * (self._pull @ (self._places + q))
        return np.asarray(self._gyro @ (q1 - self._q0) / self._dt - self.force)

    def tangent(self, q1: Array) -> csr_array:
        """Derivative of both forces."""
        weight = self._growth * self.scheme.load_weight
        return csr_array(self._gyro / self._dt - weight * self._pull)

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the work of the centrifugal forces."""
        self.residual(q1)
        self.enter_work(self.force, s, self.force)
        self._grown, change = self._end, q1 - self._q0
        x: Array = self._places + self._q0 + self.scheme.load_weight * change
        self._note(x, self._growth, np.asarray(change / self._dt))

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """The centrifugal forces at ``q``."""
        self._grown = 1.0
        self.force = self.before = np.asarray(self._pull @ (self._places + q))
        self._note(self._places + q, 1.0, np.zeros(self.size))
        return self.force

    def _note(self, x: Array, growth: float, v: Array) -> None:
        """Note the accelerations of the frame at places ``x`` with the velocities ``v``."""
        self._a = -growth * self._Ω**2 * x * self._no_turn
        nodes = np.unique(np.r_[self._grid.dofs, self._grid.dofs_of_bodies], axis=0)
        pairs = np.unique(nodes[:, :2], axis=0)
        self._a[pairs[:, 0]] -= self._double * v[pairs[:, 1]]
        self._a[pairs[:, 1]] += self._double * v[pairs[:, 0]]

    def on_nodes(self) -> Sequence[OnNodes]:
        """Mass of the beams times the accelerations of the frame."""
        return [self._mass.on_nodes(self._a)]


def _turned_mass(grid: Grid, cells: Cells) -> csr_array:
    """Mass times a quarter turn of velocities, so that 2 Ω of it times them is Coriolis' force."""
    of = cells.element
    (u, _), (w_u, _) = split(ufl.TrialFunction(of.space)), split(of.w)
    G = cells.form(of.inertia[0] * ufl.dot(turn(u), w_u) * of.dx_of_mass()).matrix()
    for (u, v, _), m, _ in lumps(grid):
        G = G + coupled(grid.size, np.array([u, v]), np.array([v, u]), m * np.array([-1, 1]))
    return csr_array(G)


# -- works of users ------------------------------------------------------------------------------


class WorkForce(CellForce):
    """Virtual work or potential of a user on the cells on which it acts.

    The forces of a potential are always there; virtual works grow in parts of the first step, as
    loads do.
    """

    kind = "work"

    def __init__(self, work: Work, grid: Grid, scheme: Scheme, ledger: Ledger, t0: float) -> None:
        numbers = np.concatenate([grid.cells_of(beam) for beam in work.on(grid.scene.beams)])
        cells = Cells(grid, numbers)
        stated = statement(work, cells.element, scheme)
        super().__init__(cells, stated.residual, [stated.lost] if stated.lost is not None else [])
        self._work, self._stated, self._scheme, self._ledger = work, stated, scheme, ledger
        self._energy = None if stated.energy is None else cells.form(stated.energy)
        self._varies, self._held = stated.varies(work), 0.0
        self._t = self._t_end = t0
        self._grown = self._grown_end = 0.0
        self.force: Array = np.zeros(grid.size)
        self.before: Array = self.force
        if isinstance(work, Potential):
            ledger.state[work.name] += 0.0
            if self._varies:
                ledger.supplied[work.in_time] += 0.0
            if self.losses:
                ledger.lost["numerical"] += 0.0
        else:
            ledger.supplied[work.name] += 0.0

    def _put(self, t: float, **clock: float) -> None:
        """Give the forms time, growth, length of the step, and the numbers of the work."""
        numbers = self._work.numbers.items()
        values = {n: value_at(x, t, self._work) if callable(x) else x for n, x in numbers}
        for name, value in {"t": t, **clock, **values}.items():
            self._stated.numbers[name].x.array[:] = value
        self._at = t

    def begin(self, step: Step) -> None:
        """Tell the forms of the step; parts of one go in proportion to the way of the loads."""
        super().begin(step)
        part, self._q0 = step.fraction, step.q0
        growth = part * (1.0 - self._grown)
        self._t_end = self._t + part * (step.motion_time - self._t)
        self._grown_end = self._grown + growth
        t = self._t + step.at * part * (step.load_time - self._t)
        growth = self._grown + step.at * growth
        self._put(t, **{"dt": min(step.dt, AT_REST), GROWTH: growth})

    def residual(self, q1: Array) -> Array:
        """Minus the virtual work, or the derivative of the potential."""
        r = super().residual(q1)
        self.force = -r
        return r

    def accept(self, q1: Array, s: Array) -> None:
        """Enter what the work did in the step."""
        super().accept(q1, s)
        if isinstance(self._work, Potential):
            if self.losses:
                self._ledger.lost["numerical"] += self.lost(q1)
            if self._varies:
                self._ledger.supplied[self._work.in_time] += self._gained(q1)
        else:
            work = float(acting(self._scheme, self.before, self.force) @ s)
            self._ledger.supplied[self._work.name] += work
        self.before, self._t, self._grown = self.force, self._t_end, self._grown_end

    def _gained(self, q1: Array) -> float:
        """Energy that a change in time brings: all of the change but that by the motion; J."""
        self._put(float(acting(self._scheme, np.array(self._t), np.array(self._at))))
        moved = self._value(q1) - self._value(self._q0)
        self._put(self._t_end)
        return self._value(q1) - self._held - moved

    def _value(self, q: Array) -> float:
        self.cells.set(self.of.q1, q)
        return 0.0 if self._energy is None else self._energy.value()

    def enter_state(self, q: Array) -> None:
        """Enter the energy of a potential."""
        if self._energy is not None:
            self._put(self._t)
            self._held = self._value(q)
            self._ledger.state[self._work.name] += self._held

    def equilibrium(self, t: float, q: Array, v: Array | None) -> Array:
        """The forces at ``q``, as at the end of a second in which the velocities stayed."""
        self._t, self._grown = t, 1.0
        self.cells.set(self.of.q0, q if v is None else q - v)
        self._put(t, **{"dt": AT_REST if v is None else 1.0, GROWTH: 1.0})
        self.residual(q)
        self.before = self.force
        return self.force

    def internal(self) -> dict[str, Array]:
        """Forces of the last step, which depend on its motion."""
        counted = self._scheme.weight_of_before != 0.0
        if isinstance(self._work, Potential) or not (self._work.takes_rates and counted):
            return {}
        return {f"work of {self._work.name}": self.before}

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take over these forces where the run goes on."""
        if goes_on:
            self.before = internal.get(f"work of {self._work.name}", self.before)


def loads_of(
    grid: Grid, scheme: Scheme, mass: Mass | None, ledger: Ledger, t0: float
) -> list[LoadForce | WorkForce]:
    """All loads and works of a scene."""
    found: list[LoadForce | WorkForce] = []
    for load in grid.scene.loads:
        if isinstance(load, RotatingFrame):
            found.append(FrameForce(load, grid, mass or Mass(grid), scheme, ledger))
        elif isinstance(load, FollowerLoad):
            found.append(Follower(load, grid, scheme, ledger))
        else:
            found.append(DeadLoad(load, grid, scheme, ledger))
    found += [WorkForce(work, grid, scheme, ledger, t0) for work in grid.scene.works]
    return found
