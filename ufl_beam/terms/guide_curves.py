# SPDX-License-Identifier: MIT
"""Points on guide curves: held on a curve of the plane, free along it."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import StepFailed
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
        self._laws = [link.law for link in self.links if isinstance(link.law, Guide)]
        self._x, self._y = (self._dofs[:, k].astype(np.int64) for k in (1, 3))
        pairs = [(r, c) for r in (self._x, self._y) for c in (self._x, self._y)]
        self._stiff = [A.positions(r, c) for r, c in pairs]
        self._across = [A.positions(d, self._forces_at) for d in (self._x, self._y)]
        self._rows = [A.positions(self._forces_at, d) for d in (self._x, self._y)]
        self._points = np.array([link.b.point for link in self.links])
        self._over_step = np.full(len(self.links), setting.scheme.average(0.0, 1.0) != 1.0)
        n = len(self.links)
        self._s: Array = np.zeros(n)
        self._s0: Array = np.zeros(n)
        self._on0 = self._points.copy()
        self._size = size = share.grid.scene.size
        last_digit = np.spacing(size + np.abs(self._points).max(axis=1))
        self._shortest = size * (24 * last_digit / size) ** (1 / 3)
        self._steps: Array = np.array([parameter_step(law.curve, 0.0, size) for law in self._laws])

    # -- geometry ------------------------------------------------------------------------------

    def _nearest(self, p: Array) -> tuple[Array, Array]:
        """Points of the curves nearest to ``p``, and tangents there; from the latest ones."""
        curves, steps = [law.curve for law in self._laws], [float(step) for step in self._steps]
        found = np.array([
            nearest(curve, p[k], float(self._s[k]), steps[k], self._size)
            for k, curve in enumerate(curves)
        ])  # fmt: skip
        if not np.isfinite(found).all():
            place = self.links[int(np.argmin(np.isfinite(found)))].b
            raise StepFailed(f"{place} is where no nearest point of its guide curve was found")
        self._s = found
        t = np.array([tangent(c, float(found[k]), steps[k]) for k, c in enumerate(curves)])
        on = np.array([curve(s) for curve, s in zip(curves, self._s, strict=True)], dtype=float)
        return on, t

    def _curvatures(self, n: Array) -> Array:
        """Curvatures at the latest points towards the normals ``n``, by second differences; 1/m."""
        found = []
        for law, s, normal, step in zip(self._laws, self._s, n, self._steps, strict=True):
            t = tangent(law.curve, s, step)
            bend = np.add(law.curve(s + step), law.curve(s - step)) - np.multiply(2, law.curve(s))
            found.append(float(normal @ bend) / (step**2 * float(t @ t)))
        return np.array(found)

    def _at(self, q: Array) -> Array:
        return self._points + np.column_stack([q[self._x], q[self._y]])

    def _frames(self, q1: Array) -> tuple[Array, Array, Array, Array]:
        """Distance, normals there and over the step, and how these change with the point."""
        p = self._at(q1)
        on, t = self._nearest(p)
        t /= np.linalg.norm(t, axis=1)[:, None]
        n = np.column_stack([-t[:, 1], t[:, 0]])
        # In statics forces are across the curve at the end of the step, else across the chord.
        chord = on - self._on0
        length = np.linalg.norm(chord, axis=1)
        far = self._over_step & (length > self._shortest)
        d, bend = t.copy(), np.zeros_like(t)
        d[far] = chord[far] / length[far, None]
        d[far] *= np.sign(np.sum(d[far] * t[far], axis=1))[:, None]
        # d changes with the point by (I - d d) t t.dp / length
        back = np.sign(np.sum(chord[far] * d[far], axis=1)) / length[far]
        bend[far] = (t[far] - d[far] * np.sum(d * t, axis=1)[far, None]) * back[:, None]
        for k in np.flatnonzero(self._over_step & ~far):
            d[k], bend[k] = self._in_the_middle(k)
        m, turning = (np.column_stack([-x[:, 1], x[:, 0]]) for x in (d, bend))
        distance = np.sum(n * (p - on), axis=1)
        if not self._over_step.any():
            # The normal at the end turns by the curvature κ: dn = -κ t t.dp / (1 - κ distance).
            κ = self._curvatures(n)
            turning = (-κ / (1 - κ * distance))[:, None] * t
        return distance, n, m, np.einsum("ki,kj->kij", turning, t)

    def _in_the_middle(self, k: int) -> tuple[Array, Array]:
        """Direction of a curve in the middle of a short step, and its change with the end."""
        curve, step, s = self._laws[k].curve, self._steps[k], (self._s0[k] + self._s[k]) / 2
        t = tangent(curve, s, step)
        speed = np.linalg.norm(t)
        d = t / speed
        second = np.add(curve(s + step), curve(s - step)) - np.multiply(2, curve(s))
        bend = second / (step * speed) ** 2
        return d, (bend - d * (d @ bend)) / 2

    # -- the step ------------------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Distances from the curves; m."""
        self._s = self._s0.copy()
        return self._frames(q)[0]

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
        self._on0, t = self._nearest(self._at(q1))
        self._steps = REACH * self._size / np.linalg.norm(t, axis=1)
        self._s0 = self._s.copy()

    # -- the state -----------------------------------------------------------------------------

    def remember(self, memory: Memory, q: Array) -> None:
        """The points on the curves, their parameters, and the steps of these for tangents."""
        numbers = (self.work, self.rate, self._s, self._s0, self._steps)
        rows = memory.rows("guides", self.numbers, np.column_stack([*numbers, self._on0]))
        self.work, self.rate, self._s, self._s0, self._steps = rows[:, :5].T.copy()
        self._on0 = rows[:, 5:].copy()


def guides(share: Share, setting: Setting, A: Csr) -> list[Links]:
    """Make the guides of a process, all together; empty if it has none."""
    links = share.grid.scene.links
    here = [i for i, number in enumerate(share.links) if isinstance(links[number].law, Guide)]
    return [Guides(share, np.array(here), setting, A)] if here else []
