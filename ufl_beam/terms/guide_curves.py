# SPDX-License-Identifier: MIT
"""Points on guide curves: held on a curve of the plane, free along it."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import NoNumber
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.curves import REACH, parameter_step
from ufl_beam.terms.connector_responses import Setting
from ufl_beam.terms.links import Links
from ufl_beam.terms.phases import Callbacks, Phases


class Guides(Links):
    """Forces across curves; those over a step are across the chord, so that they do no work.

    The last digits of the curve spoil the direction of a short chord.  Where it is so short that
    they spoil more than the curvature does, the direction in its middle takes its place: either
    errs by the last digits to the power of two thirds at most.

    The motion of a guide is the distance from its curve, zero when a step is accepted.  All is
    computed in guide_curves.c, which asks Python for points of the curves.
    """

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        super().__init__(share, here, setting, A)
        n, size = len(self.links), setting.size
        self._curves = [link.law.curve for link in self.links if isinstance(link.law, Guide)]
        x, y, λ = self._x, self._y, _ = [self._dofs[:, k] for k in (1, 3, 6)]
        pairs = (x, x), (x, y), (y, x), (y, y), (x, λ), (y, λ), (λ, x), (λ, y)
        points = np.array([link.b.point for link in self.links], dtype=np.float64)
        last_digit = np.spacing(size + np.abs(points).max(axis=1))
        self._s, self._s0, self._distance = np.zeros((3, n))
        self._steps = np.array([parameter_step(curve, 0.0, size) for curve in self._curves])
        self._on0, self._size = points.copy(), size
        self._c = struct(
            "guides", number=n, over_step=setting.scheme.average(0.0, 1.0) != 1.0,
            dofs=self._dofs, entries=np.column_stack([A.positions(*pair) for pair in pairs]),
            point=points, size=size, reach=REACH,
            shortest=size * (24 * last_digit / size) ** (1 / 3),
            distance=self._distance, s0=self._s0, s=self._s, step=self._steps, on0=self._on0,
            frame=ffi.new("guide_frame[]", n), around=ffi.new("curve_around[]", n),
        )  # fmt: skip
        lib.begin_guides_again(self._c)

    # -- in C ----------------------------------------------------------------------------------

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops of the forces and distances, and of their derivatives."""
        return loop("add_guides_force", self._c), loop("add_guides_tangent", self._c)

    def demand(self) -> Loop:
        """C function of the largest distance."""
        return loop("missed_by_guides", self._c)

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops that begin at the points of the last step, and remember those at its end."""
        self._callbacks = callbacks
        fill(self._c, ask=lib.curve_in_python, curve=callbacks.curves(self._curves))
        self._c.report, self._c.handle = callbacks.run(self._report)
        begin, accept = (loop(name, self._c) for name in ("begin_guides", "accept_guides"))
        return Phases([begin], [accept], again=loop("begin_guides_again", self._c))

    def _report(self) -> None:
        place = self.links[self._c.lost].b
        raise NoNumber(f"{place} is where no nearest point of its guide curve was found")

    # -- outside of steps ----------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Distances from the curves; m."""
        lib.begin_guides_again(self._c)
        with self._callbacks.raising():
            lib.find_frames(self._c, doubles(q))
        return np.array([self._c.frame[k].distance for k in range(len(self.links))])

    def _kept_motion(self, q: Array) -> Array:
        """Distances in the accepted state."""
        return self._distance

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

    def change(self, q1: Array) -> float:
        """Guides take no energy."""
        return 0.0

    # -- the state -----------------------------------------------------------------------------

    def remember(self, memory: Memory, q: Array) -> None:
        """The points on the curves, their parameters, and the steps of these for tangents."""
        numbers = (self._distance, self._s, self._s0, self._steps)
        rows = memory.rows("guides", self.numbers, np.column_stack([*numbers, self._on0]))
        for mine, column in zip(numbers, rows.T, strict=False):
            mine[:] = column
        self._on0[:] = rows[:, 4:]


def guides(share: Share, setting: Setting, A: Csr) -> list[Links]:
    """Make the guides of a process, all together; empty if it has none."""
    links = share.grid.scene.links
    here = [i for i, number in enumerate(share.links) if isinstance(links[number].law, Guide)]
    return [Guides(share, np.array(here), setting, A)] if here else []
