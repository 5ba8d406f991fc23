"""Points on guide curves: held on a curve of the plane, free along it."""

from __future__ import annotations

import math

import numpy as np

from ufl_beam.beams import Curve
from ufl_beam.compat import Array
from ufl_beam.connectors import Guide
from ufl_beam.errors import SceneError, StepFailed, shorten
from ufl_beam.grid import Index, Share
from ufl_beam.links import Links
from ufl_beam.memory import Memory
from ufl_beam.responses import Setting
from ufl_beam.schemes import Step
from ufl_beam.sparse import Csr

PROJECTIONS = 50
"""Iterations in which the nearest point of a curve is sought."""


def tangent(curve: Curve, s: float) -> Array:
    """Derivative of a curve by its parameter; (2,); m."""
    ε = 1e-6
    return np.asarray((_on(curve, s + ε) - _on(curve, s - ε)) / (2 * ε))


def _on(curve: Curve, s: float) -> Array:
    """Point of a curve; (2,); m."""
    try:
        point = np.asarray(curve(s), dtype=np.float64)
        if point.shape == (2,):
            return point
    except (TypeError, ValueError):
        pass
    raise SceneError(
        f"guide curve: curve({s:g}) = {shorten(curve(s))} must be a pair (x, y); it must be one "
        "for all s that the motion may reach"
    )


def nearest(curve: Curve, point: Array, s: float) -> float:
    """Parameter of the point of a curve that is nearest to another; not a number if none is found.

    Args:
        curve: ``s -> (x, y)``; m.
        point: Shape (2,); m.
        s: Where to begin.
    """
    for _ in range(PROJECTIONS):
        t = tangent(curve, s)
        step = float((point - _on(curve, s)) @ t / (t @ t))
        s += step
        if abs(step) * math.hypot(*t) <= 1e-15 * math.hypot(*point):
            return s
    return s if abs(step) <= 1e-9 else math.nan


class Guides(Links):
    """Forces across curves; those over a step are across the chord, so that they do no work.

    The motion of a guide is the distance from its curve, zero when a step is accepted.
    """

    kind = "connectors"

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        super().__init__(share, here, A)
        self._laws = [link.law for link in self.links if isinstance(link.law, Guide)]
        self._x, self._y = (self._dofs[:, k].astype(np.int64) for k in (1, 3))
        pairs = [(r, c) for r in (self._x, self._y) for c in (self._x, self._y)]
        self._stiff = [A.positions(r, c) for r, c in pairs]
        self._across = [A.positions(d, self._forces_at) for d in (self._x, self._y)]
        self._rows = [A.positions(self._forces_at, d) for d in (self._x, self._y)]
        self._points = np.array([link.b.point for link in self.links])
        self._average = setting.scheme.average
        n = len(self.links)
        self._s: Array = np.zeros(n)
        self._s0: Array = np.zeros(n)
        self._on0 = self._points.copy()
        self._size = share.grid.scene.size

    # -- geometry ------------------------------------------------------------------------------

    def _nearest(self, p: Array) -> tuple[Array, Array]:
        """Points of the curves nearest to ``p``, and unit tangents there; from the latest ones."""
        curves = [law.curve for law in self._laws]
        found = np.array([nearest(c, p[k], float(self._s[k])) for k, c in enumerate(curves)])
        if not np.isfinite(found).all():
            place = self.links[int(np.argmin(np.isfinite(found)))].b
            raise StepFailed(f"{place} is where no nearest point of its guide curve was found")
        self._s = found
        t = np.array([tangent(curve, s) for curve, s in zip(curves, self._s, strict=True)])
        on = np.array([_on(curve, s) for curve, s in zip(curves, self._s, strict=True)])
        return on, t / np.linalg.norm(t, axis=1)[:, None]

    def _at(self, q: Array) -> Array:
        return self._points + np.column_stack([q[self._x], q[self._y]])

    def _frames(self, q1: Array) -> tuple[Array, Array, Array, Array]:
        """Distance, normals there and over the step, and how these change with the point."""
        p = self._at(q1)
        on, t = self._nearest(p)
        n = np.column_stack([-t[:, 1], t[:, 0]])
        # In statics forces are across the curve at the end of the step, else across the chord.
        chord = on - self._on0
        length = np.linalg.norm(chord, axis=1)
        moves = (length > 1e-8 * self._size) & (self._average(0.0, 1.0) != 1.0)
        d = np.where(moves[:, None], chord / np.where(moves, length, 1.0)[:, None], t)
        d *= np.sign(np.sum(d * t, axis=1))[:, None]
        m = np.column_stack([-d[:, 1], d[:, 0]])
        # dm = W (I - d d) t t.dp / length
        across = t - d * np.sum(d * t, axis=1)[:, None]
        across *= np.sign(np.sum(chord * d, axis=1))[:, None]
        turning = (
            np.column_stack([-across[:, 1], across[:, 0]])
            / np.where(moves, length, np.inf)[:, None]
        )
        distance = np.sum(n * (p - on), axis=1)
        return distance, n, m, np.einsum("ki,kj->kij", turning, t)

    # -- the step ------------------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Distances from the curves; m."""
        self._s = self._s0.copy()
        return self._frames(q)[0]

    def begin(self, step: Step) -> None:
        """Begin at the points of the last step."""
        self._s = self._s0.copy()

    def loops(self) -> None:
        """None."""

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the forces, and the distances."""
        distance, _, m, _ = self._frames(q1)
        λ = self.force(q1)
        np.add.at(r, self._x, λ * m[:, 0])
        np.add.at(r, self._y, λ * m[:, 1])
        r[self._forces_at] += distance

    def add_tangent(self, q1: Array) -> None:
        """Add the derivatives."""
        _, n, m, dm = self._frames(q1)
        λ, data = self.force(q1), self._A.data
        for k in range(2):
            np.add.at(data, self._across[k], m[:, k])
            np.add.at(data, self._rows[k], n[:, k])
            for j in range(2):
                np.add.at(data, self._stiff[2 * k + j], λ * dm[:, k, j])

    def demand(self) -> None:
        """None."""

    def excess(self, q: Array, r: Array, force: float) -> float:
        """Largest distance, as a part of 1 % of the scene."""
        round_off = 8 * np.spacing(self._size + np.abs(self._points + self._on0).max(axis=1))
        missed = np.maximum(np.abs(r[self._forces_at]) - round_off, 0.0)
        return float(missed.max() / (0.01 * self._size))

    def change(self, q1: Array) -> float:
        """Guides take no energy."""
        return 0.0

    def effort(self, q1: Array) -> float:
        """Guides take no energy."""
        return 0.0

    def accept(self, q1: Array, s: Array) -> None:
        """Remember the points on the curves."""
        self._on0, _ = self._nearest(self._at(q1))
        self._s0 = self._s.copy()

    def freeze(self) -> None:
        """Nothing yields."""

    # -- the state -----------------------------------------------------------------------------

    def add_state(self, q: Array) -> None:
        """Nothing is stored."""

    def remember(self, memory: Memory, q: Array) -> None:
        """The points on the curves, and their parameters."""
        rows = np.column_stack([self.work, self.rate, self._s, self._s0, self._on0])
        rows = memory.rows("guides", self.numbers, rows)
        self.work, self.rate, self._s, self._s0 = rows[:, :4].T.copy()
        self._on0 = rows[:, 4:].copy()
