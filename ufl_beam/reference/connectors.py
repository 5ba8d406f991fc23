# SPDX-License-Identifier: MIT
"""Connectors: the force of a law on the variation of a relative motion, and guide curves."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.errors import NoNumber
from ufl_beam.mechanics.connector_forms import connector_forms
from ufl_beam.mechanics.relative_motions import MOTIONS
from ufl_beam.mechanics.time_schemes import Step, acting
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.curves import REACH, nearest, parameter_step, tangent
from ufl_beam.reference.cells import Force, Form, coupled, dofs_of_cells, separate_cells
from ufl_beam.reference.connector_laws import Setting, law_in_step

MOTION, FORCE, WORK, RATE, DISSIPATED = range(5)
"""Columns of ``Connection``."""


class Linked(Force):
    """Base of connectors, whose forces are unknowns of the scene.

    Attributes:
        numbers: Of the connectors among the links of the scene.
        forces_at: Degrees of freedom that are their forces.
        before: Forces at the end of the last step.
    """

    inner = True

    def __init__(self, grid: Grid, numbers: Index) -> None:
        self.size, self.numbers = grid.size, numbers
        self.links: list[Connector] = [grid.scene.links[i] for i in numbers]
        self.dofs = grid.dofs_of_links[numbers]
        self.forces_at = self.dofs[:, 6]
        self.before: Array = np.zeros(len(numbers))
        self.work: Array = np.zeros(len(numbers))
        self.rate: Array = np.zeros(len(numbers))

    def kept(self, q: Array) -> Array:
        """Columns of ``Connection``; (num_links, 5)."""
        raise NotImplementedError

    def missed(self, q: Array, r: Array, scale: float, moved: float) -> float:
        """Largest residual of a law, as a part of forces or of motions in the scene."""
        raise NotImplementedError

    def effort(self, q1: Array) -> float:
        """Sum of the sizes of the works that the connectors take in the step to ``q1``; J."""
        return 0.0

    def again(self) -> None:
        """Forget what the iterates of the step have tried."""

    def take_forces(self, q: Array) -> None:
        """Take the forces in ``q`` as those before the next step."""
        self.before = q[self.forces_at].copy()


class Connectors(Linked):
    """Connectors of one relative motion.

    Each is a cell of unit length from one node to the other, with its force as a seventh unknown.
    """

    def __init__(self, motion: str, numbers: Index, grid: Grid, setting: Setting) -> None:
        n = len(numbers)
        mesh, order = separate_cells(np.tile([[0.0, 0.0], [1.0, 0.0]], (n, 1, 1)))
        super().__init__(grid, numbers[order])
        self.laws = [law_in_step(link, setting) for link in self.links]
        self._setting, self._stated = setting, connector_forms((motion,), setting.scheme, mesh)
        stated = self._stated
        self._at: Index = np.empty(7 * n, dtype=np.int64)
        self._at[dofs_of_cells(stated.q1.function_space)] = self.dofs
        self._work, self._tangent, self._motion, self._rate = (
            Form(form, self._at, grid.size)
            for form in (stated.work, stated.tangent, stated.motion, stated.rate)
        )
        numbers_of_links = [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in self.links]
        self._put(stated.numbers, np.array(numbers_of_links))
        self._row_dofs = dofs_of_cells(stated.row.function_space)
        self._cell_dofs = dofs_of_cells(stated.bend.function_space)[:, 0]
        self._length = np.array([law.length for law in self.laws])
        self._rows: Array = np.zeros((n, 3))
        self._e0: Array = np.zeros(n)
        self._dt = 1.0

    def _put(self, function: Any, values: Array) -> None:
        function.x.array[dofs_of_cells(function.function_space)] = values

    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""
        self._stated.q1.x.array[:] = q[self._at]
        return self._motion.entries()[self._cell_dofs]

    def rates(self, q: Array, v: Array) -> Array:
        """Rates of the motions if the velocities are ``v``; (num_links,); m/s or rad/s."""
        self._stated.q1.x.array[:], self._stated.u.x.array[:] = q[self._at], v[self._at]
        return self._rate.entries()[self._cell_dofs]

    def begin(self, step: Step) -> None:
        """Begin the step in all laws."""
        self._stated.q0.x.array[:], self._dt = step.q0[self._at], step.dt
        for law, e0 in zip(self.laws, self._e0, strict=True):
            law.begin(float(e0), step)

    def again(self) -> None:
        """Forget what the iterates of the step have tried."""
        for law in self.laws:
            law.again()

    def residual(self, q1: Array) -> Array:
        """Forces on the nodes, and the rows of the laws."""
        e1, λ = self.motion(q1), q1[self.forces_at]
        rows = [law.row(float(e1[i]), float(λ[i])) for i, law in enumerate(self.laws)]
        self._rows = np.array(rows)
        self._put(self._stated.row, self._rows)
        return self._work.vector()

    def tangent(self, q1: Array) -> csr_array:
        """Their derivative; the rows are those of the latest residual."""
        self._stated.q1.x.array[:] = q1[self._at]
        return self._tangent.matrix()

    def missed(self, q: Array, r: Array, scale: float, moved: float) -> float:
        """Largest residual of a row: of motions as a part of 1 % of ``moved``, or of ``scale``.

        What the last digits of the motions make of a row does not count.
        """
        size = self._setting.size
        amplitude, weight = moved / size, np.abs(self._rows[:, 1])
        unit = np.array([law.slope for law in self.laws])
        of_motion = 0.01 * self._length * amplitude
        wanted = np.where(
            weight * unit < 1 - 1e-12, of_motion, weight * scale * size / self._length
        )
        far = np.maximum(np.abs(q[self.dofs[:, :4]]).max(axis=1) / size,
                         np.abs(q[self.dofs[:, 4:6]]).max(axis=1)) + amplitude  # fmt: skip
        left = np.abs(r[self.forces_at])
        left -= 8 * np.abs(self._rows[:, 0]) * self._length * np.spacing(far)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.where(left <= 0, 0.0, left / wanted).max())

    def _taken(self, q1: Array) -> Array:
        force = acting(self._setting.scheme, self.before, q1[self.forces_at])
        return np.asarray(force * (self.motion(q1) - self._e0))

    def change(self, q1: Array) -> float:
        """Energy that the connectors take in the step; J."""
        parts = zip(self.laws, self.motion(q1), self._taken(q1), strict=True)
        return sum(law.change(float(e), float(work)) for law, e, work in parts)

    def effort(self, q1: Array) -> float:
        """Sum of the sizes of the works that the connectors take in the step; J."""
        return float(np.abs(self._taken(q1)).sum())

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a law gives energy."""
        for law, e in zip(self.laws, self.motion(q1), strict=True):
            law.require_dissipation(float(e))

    def accept(self, q1: Array, s: Array) -> None:
        """Take the end of the step; enter what was supplied or lost."""
        e, taken = self.motion(q1), self._taken(q1)
        self.work = self.work + taken
        self.rate, self._e0 = np.asarray((e - self._e0) / self._dt), e
        self.take_forces(q1)
        for law, motion, work in zip(self.laws, e, taken, strict=True):
            law.accept(float(motion), float(work))

    def enter_state(self, q: Array) -> None:
        """Enter what is stored."""
        for law, e in zip(self.laws, self._e0, strict=True):
            law.enter_state(float(e))

    def kept(self, q: Array) -> Array:
        """Columns of ``Connection`` of each; (num_links, 5)."""
        e = [law.motion(float(e)) for law, e in zip(self.laws, self._e0, strict=True)]
        dissipated = [law.dissipated for law in self.laws]
        return np.column_stack([e, q[self.forces_at], self.work, self.rate, dissipated])

    def put_forces(self, q: Array) -> None:
        """Put the forces that springs bear in the undeformed scene into its configuration."""
        for i, law in enumerate(self.laws):
            if (borne := law.borne()) is not None:
                q[self.forces_at[i]] = self.before[i] = borne

    def internal(self) -> dict[str, Array]:
        """Works, rates, forces, motions and internal variables, by the kind of the law."""
        tables = defaultdict(list)
        for i, law in enumerate(self.laws):
            row = [self.work[i], self.rate[i], self.before[i], self._e0[i], *law.state()]
            tables[f"{law.saved_as}, {len(row)}"].append([self.numbers[i], *row])
        return {name: np.array(rows) for name, rows in tables.items()}

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take them over, and begin at the motions of ``q``."""
        for i, law in enumerate(self.laws):
            table = internal.get(f"{law.saved_as}, {4 + len(law.state())}", np.zeros((0, 1)))
            for row in table[table[:, 0] == self.numbers[i], 1:]:
                self.work[i], self.rate[i], self.before[i] = row[:3]
                law.restore(row[4:])
        self._e0 = self.motion(q)
        for law, e in zip(self.laws, self._e0, strict=True):
            law.start(float(e))


class GuideForce(Linked):
    """Point on a curve of the plane: held across it, free along it.

    The force over a step is across the chord of the curve, so that it does no work.  The last
    digits of the curve spoil the direction of a short chord; the direction in its middle takes its
    place there.  The motion is the distance from the curve, zero when a step is accepted.
    """

    def __init__(self, number: int, grid: Grid, setting: Setting) -> None:
        super().__init__(grid, np.array([number]))
        link = self.links[0]
        assert isinstance(link.law, Guide)
        self._place, self._curve, self._size = link.b, link.law.curve, setting.size
        self._point = self._on0 = np.array(link.b.point)
        self._x, self._λ = self.dofs[0, [1, 3]], self.dofs[0, 6]
        self._over_step = setting.scheme.average(0.0, 1.0) != 1.0
        last_digit = np.spacing(self._size + np.abs(self._point).max())
        self._shortest = self._size * (24 * last_digit / self._size) ** (1 / 3)
        self._s = self._s0 = 0.0  # parameters of the curve: now, and at the beginning
        self._step = parameter_step(self._curve, 0.0, self._size)

    def _nearest(self, q: Array) -> tuple[Array, Array]:
        """Nearest point of the curve, and tangent there; from the latest one."""
        p = self._point + q[self._x]
        s = nearest(self._curve, p, self._s, self._step, self._size)
        if not math.isfinite(s):
            raise NoNumber(f"{self._place} is where no nearest point of its guide curve was found")
        self._s = s
        return np.array(self._curve(s), np.float64), tangent(self._curve, s, self._step)

    def _bend(self, s: float) -> Array:
        """Second difference of the curve over two steps of its parameter; m."""
        ends = np.add(self._curve(s + self._step), self._curve(s - self._step))
        return np.asarray(ends - np.multiply(2, self._curve(s)))

    def _frame(self, q: Array) -> tuple[float, Array, Array, Array]:
        """Distance, normals there and over the step, derivative of the latter by the point."""
        on, slope = self._nearest(q)
        t = np.asarray(slope / math.hypot(*slope), np.float64)
        n = _turned(t)
        distance = float(n @ (self._point + q[self._x] - on))
        if not self._over_step:
            # The normal at the end turns by the curvature κ: dn = -κ t t.dp / (1 - κ distance).
            κ = float(n @ self._bend(self._s)) / (self._step**2 * float(slope @ slope))
            return distance, n, n, np.asarray(np.outer(-κ / (1 - κ * distance) * t, t))
        chord = on - self._on0
        length = math.hypot(*chord)
        if length > self._shortest:
            d = chord / length
            d = d * np.sign(d @ t)
            # d changes with the point by (I - d d) t t.dp / length
            bend = (t - d * (d @ t)) * (np.sign(chord @ d) / length)
        else:
            middle = (self._s0 + self._s) / 2
            along: Array = tangent(self._curve, middle, self._step)
            speed = float(np.linalg.norm(along))
            d = along / speed
            bend = self._bend(middle) / (self._step * speed) ** 2
            bend = np.asarray((bend - d * (d @ bend)) / 2)
        return distance, n, _turned(np.asarray(d)), np.asarray(np.outer(_turned(bend), t))

    def again(self) -> None:
        """Begin at the point of the last step."""
        self._s = self._s0

    def begin(self, step: Step) -> None:
        """Begin at the point of the last step."""
        self.again()

    def residual(self, q1: Array) -> Array:
        """The force across the curve, and the distance from it."""
        distance, _, m, _ = self._frame(q1)
        r = np.zeros(self.size)
        r[self._x], r[self._λ] = q1[self._λ] * m, distance
        return r

    def tangent(self, q1: Array) -> csr_array:
        """Derivative of both by the unknowns."""
        _, n, m, dm = self._frame(q1)
        (x, y), λ = self._x, self._λ
        rows, columns = [x, x, y, y, x, y, λ, λ], [x, y, x, y, λ, λ, x, y]
        values = [*(q1[λ] * dm).ravel(), *m, *n]
        return coupled(self.size, np.array(rows), np.array(columns), np.array(values))

    def missed(self, q: Array, r: Array, scale: float, moved: float) -> float:
        """Distance, as a part of 1 % of the scene."""
        round_off = 8 * np.spacing(self._size + np.abs(self._point + self._on0).max())
        return float(max(abs(r[self._λ]) - round_off, 0.0) / (0.01 * self._size))

    def accept(self, q1: Array, s: Array) -> None:
        """Remember the point on the curve."""
        self._on0, t = self._nearest(q1)
        self._step = REACH * self._size / float(np.linalg.norm(t))
        self._s0 = self._s

    def kept(self, q: Array) -> Array:
        """Columns of ``Connection``; the distance is NaN at the end of a curve."""
        self._s = self._s0
        try:
            distance = self._frame(q)[0]
        except NoNumber:
            distance = math.nan
        return np.array([[distance, q[self._λ], 0.0, 0.0, 0.0]])

    def internal(self) -> dict[str, Array]:
        """The point on the curve, its parameter, and the step of that for tangents."""
        row = self.numbers[0], 0.0, 0.0, self._s, self._s0, self._step, *self._on0
        return {"guides, 7": np.array([row])}

    def take(self, internal: dict[str, Array], q: Array, *, goes_on: bool) -> None:
        """Take over the point and its parameter."""
        table = internal.get("guides, 7", np.zeros((0, 8)))
        for row in table[table[:, 0] == self.numbers[0]]:
            self._s, self._s0, self._step = map(float, row[3:6])
            self._on0 = row[6:].copy()


def _turned(a: Array) -> Array:
    """A vector turned by +90°."""
    return np.array([-a[1], a[0]])


def connectors_of(grid: Grid, setting: Setting) -> list[Linked]:
    """All connectors of a scene: those of one motion together, and each guide."""
    found: list[Linked] = []
    links = grid.scene.links
    for motion in MOTIONS:
        numbers = np.array([i for i, link in enumerate(links) if link.motion == motion])
        if len(numbers):
            found.append(Connectors(motion, numbers, grid, setting))
    guides = (i for i, link in enumerate(links) if isinstance(link.law, Guide))
    return [*found, *(GuideForce(i, grid, setting) for i in guides)]
