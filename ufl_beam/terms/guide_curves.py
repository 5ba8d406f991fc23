# SPDX-License-Identifier: MIT
"""Points on guide curves: held on a curve of the plane, free along it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import NoNumber
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.curves import REACH, nearest, parameter_step, tangent
from ufl_beam.terms.connector_responses import Setting
from ufl_beam.terms.links import Links


class Guides(Links):
    """Forces across curves; those over a step are across the chord, so that they do no work.

    The last digits of the curve spoil the direction of a short chord.  Where it is so short that
    they spoil more than the curvature does, the direction in its middle takes its place: either
    errs by the last digits to the power of two thirds at most.

    The motion of a guide is the distance from its curve, zero when a step is accepted.
    """

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        super().__init__(share, here, setting, A)
        self._curves = [link.law.curve for link in self.links if isinstance(link.law, Guide)]
        self._x, self._y = (self._dofs[:, k].astype(np.int64) for k in (1, 3))
        pairs = [(r, c) for r in (self._x, self._y) for c in (self._x, self._y)]
        self._stiff = [A.positions(r, c) for r, c in pairs]
        self._across = [A.positions(d, self._forces_at) for d in (self._x, self._y)]
        self._rows = [A.positions(self._forces_at, d) for d in (self._x, self._y)]
        self._points = np.array([link.b.point for link in self.links])
        self._over_step = setting.scheme.average(0.0, 1.0) != 1.0
        self._s, self._s0, self._distance = np.zeros((3, len(self.links)))
        self._on0 = self._points.copy()
        self._size = size = setting.size
        last_digit = np.spacing(size + np.abs(self._points).max(axis=1))
        self._shortest = size * (24 * last_digit / size) ** (1 / 3)
        self._steps: Array = np.array([parameter_step(c, 0.0, size) for c in self._curves])

    # -- geometry ------------------------------------------------------------------------------

    def _at(self, q: Array) -> Array:
        return self._points + np.column_stack([q[self._x], q[self._y]])

    def _nearest(self, p: Array) -> tuple[Array, Array]:
        """Points of the curves nearest to ``p``, and tangents there; from the latest ones."""
        curves = [(curve, float(self._steps[k])) for k, curve in enumerate(self._curves)]
        found = np.array([
            nearest(curve, p[k], float(self._s[k]), step, self._size)
            for k, (curve, step) in enumerate(curves)
        ])  # fmt: skip
        if not np.isfinite(found).all():
            place = self.links[int(np.argmin(np.isfinite(found)))].b
            raise NoNumber(f"{place} is where no nearest point of its guide curve was found")
        self._s = found
        t = np.array([tangent(c, float(found[k]), step) for k, (c, step) in enumerate(curves)])
        return np.array([c(s) for (c, _), s in zip(curves, found, strict=True)], np.float64), t

    def _frames(self, q1: Array) -> tuple[Array, Array, Array, Array]:
        """Distances, normals there and over the step, and how the latter change with the points."""
        p = self._at(q1)
        on, t = self._nearest(p)
        frames = [self._frame(k, p[k], on[k], t[k]) for k in range(len(p))]
        distance, n, m, dm = map(np.array, zip(*frames, strict=True))
        return distance, n, m, dm

    def _frame(self, k: int, p: Array, on: Array, slope: Array) -> tuple[Any, Array, Array, Any]:
        """Those of guide ``k``, from the nearest point of its curve and the tangent there."""
        t = slope / np.sqrt(np.sum(slope**2))
        n = _turned(t)
        distance = np.sum(n * (p - on))
        if not self._over_step:
            # The normal at the end turns by the curvature κ: dn = -κ t t.dp / (1 - κ distance).
            κ = float(n @ self._bend(k, self._s[k])) / (self._steps[k] ** 2 * float(slope @ slope))
            return distance, n, n, np.outer(-κ / (1 - κ * distance) * t, t)
        chord = on - self._on0[k]
        length = np.sqrt(np.sum(chord**2))
        if length > self._shortest[k]:
            d = chord / length
            d *= np.sign(np.sum(d * t))
            # d changes with the point by (I - d d) t t.dp / length
            bend = (t - d * np.sum(d * t)) * (np.sign(np.sum(chord * d)) / length)
        else:
            d, bend = self._in_the_middle(k)
        return distance, n, _turned(d), np.outer(_turned(bend), t)

    def _bend(self, k: int, s: float) -> Array:
        """Second difference of a curve over two steps of its parameter; m."""
        curve, step = self._curves[k], self._steps[k]
        ends = np.add(curve(s + step), curve(s - step))
        return np.asarray(ends - np.multiply(2, curve(s)))

    def _in_the_middle(self, k: int) -> tuple[Array, Array]:
        """Direction of a curve in the middle of a short step, and its change with the end."""
        s = (self._s0[k] + self._s[k]) / 2
        t = tangent(self._curves[k], s, self._steps[k])
        speed = np.linalg.norm(t)
        d = t / speed
        bend = self._bend(k, s) / (self._steps[k] * speed) ** 2
        return d, (bend - d * (d @ bend)) / 2

    # -- the step ------------------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Distances from the curves; m."""
        self._s = self._s0.copy()
        return self._frames(q)[0]

    def _kept_motion(self, q: Array) -> Array:
        """Distances in the accepted state."""
        return self._distance

    def begin(self, step: Step) -> None:
        """Begin at the points of the last step."""
        self.again()

    def again(self) -> None:
        """Begin at the points of the last step."""
        self._s = self._s0.copy()

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the forces, and the distances."""
        distance, _, m, _ = self._frames(q1)
        λ = self.force(q1)
        np.add.at(r, self._x, λ * m[:, 0])
        np.add.at(r, self._y, λ * m[:, 1])
        r[self._forces_at] += distance

    def add_tangent(self, q1: Array) -> None:
        """Add the derivatives of forces and constraints to the tangent."""
        _, n, m, dm = self._frames(q1)
        λ, data = self.force(q1), self._A.data
        for k in range(2):
            np.add.at(data, self._across[k], m[:, k])
            np.add.at(data, self._rows[k], n[:, k])
            for j in range(2):
                np.add.at(data, self._stiff[2 * k + j], λ * dm[:, k, j])

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``.

        Only Python knows the curves, so it is a difference of fourth order, over a hundredth of
        the scene: curvatures are known to 1e-8, which leaves 1e-6.
        """
        way = np.abs(u[np.r_[self._x, self._y]]).max(initial=0.0)
        ε = 1e-2 * self._size / way if way > 0 else 1.0
        data = self._A.data
        before, change = data.copy(), np.zeros_like(data)
        for k, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1)):
            data.fill(0.0)
            self.add_tangent(q1 + k * ε * u)
            change += weight / (12 * ε) * data
        data[:] = before + change

    def excess(self, q: Array, r: Array, force: float, moved: float) -> float:
        """Largest distance, as a part of 1 % of the scene."""
        round_off = 8 * np.spacing(self._size + np.abs(self._points + self._on0).max(axis=1))
        missed = np.maximum(np.abs(r[self._forces_at]) - round_off, 0.0)
        return float(missed.max() / (0.01 * self._size))

    def change(self, q1: Array) -> float:
        """Guides take no energy."""
        return 0.0

    def accept(self, q1: Array, s: Array) -> None:
        """Remember the points on the curves."""
        p = self._at(q1)
        self._on0, t = self._nearest(p)
        length = np.linalg.norm(t, axis=1)
        self._steps = REACH * self._size / length
        self._distance[:] = np.sum(_turned(t.T).T * (p - self._on0), axis=1) / length
        self._s0 = self._s.copy()

    # -- the state -----------------------------------------------------------------------------

    def remember(self, memory: Memory, q: Array) -> None:
        """The points on the curves, their parameters, and the steps of these for tangents."""
        numbers = (self._distance, self._s, self._s0, self._steps)
        rows = memory.rows("guides", self.numbers, np.column_stack([*numbers, self._on0]))
        self._distance[:], self._s, self._s0, self._steps = rows[:, :4].T.copy()
        self._on0 = rows[:, 4:].copy()


def _turned(a: Array) -> Array:
    """A vector turned by +90°."""
    return np.array([-a[1], a[0]])


def guides(share: Share, setting: Setting, A: Csr) -> list[Links]:
    """Make the guides of a process, all together; empty if it has none."""
    links = share.grid.scene.links
    here = [i for i, number in enumerate(share.links) if isinstance(links[number].law, Guide)]
    return [Guides(share, np.array(here), setting, A)] if here else []
