# SPDX-License-Identifier: MIT
"""Statement of guides, which hold a point on a curve in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import BlockSetting
from ufl_beam.blocks.connectors import RECORDED, ConnectorBlock, Data, OnConnector, Step
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, lib, loop, struct
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.mechanics.guide_curves import S, expansion, number

ROUND_OFF = 8
"""Last digits that the difference of two points on a curve may be wrong by."""

CORRECTIONS = 4
"""Newton corrections of the parameter before an iterate; two more are in its equation."""


@dataclass(frozen=True)
class OnCurve(OnConnector):
    """Point that is held on a curve C(s), without friction.

    The parameter s of the nearest point follows from the position, by Newton's method from the
    parameter of the last iterate, a mode.  So a guide has the same unknowns as other joints, and
    scales of s do not matter.  The last two corrections are in the equation: their error is of
    fourth order in the error of the mode, so that first and second derivatives are exact.

    In schemes whose forces act over the step, the force is normal to the chord C(s1) - C(s0), and
    does no work.  Round-off spoils the direction of a short chord, so it is replaced by its series
    about the middle parameter, C' + Δs²/24 C''', whose error is of fourth order in Δs, if the
    chord deviates from this direction by no more than round-off: there both errors are equal.  In
    other schemes the force is normal to the curve at the end of the step.

    Attributes:
        structure: The curve, see :func:`~ufl_beam.mechanics.guide_curves.structure_of`.
        count: Number of its numbers.
        tabulated: Whether they depend on s; then they are modes, from a table of each curve.
    """

    structure: tuple[Expr, Expr]
    count: int
    tabulated: bool
    of_step = ("dt",)

    @property
    def of_curve(self) -> list[str]:
        """Names of the numbers of the curve."""
        return [f"number {i}" for i in range(self.count)]

    @cached_property
    def data(self) -> Data:
        """See the base class: place; round-off (m); parameter and point after the last step."""
        numbers = ["x", "y", "round-off", *([] if self.tabulated else self.of_curve)]
        return Data(numbers, dict.fromkeys(("last s", "on x", "on y"), 0.0), name="Guide")

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class."""
        place, curve = connector.b.point, connector.law.curve
        round_off = ROUND_OFF * np.spacing(setting.scene.size + np.abs(place).max())
        return [*place, round_off, *([] if self.tabulated else curve.numbers)], None

    @property
    def modes(self) -> list[str]:
        """See the base class."""
        return ["s", *(self.of_curve if self.tabulated else ())]

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class; it is not called."""
        raise NotImplementedError

    def _curve(self, at: Inputs, s: Expr, order: int) -> list[Expr]:
        """Return a point of the curve, relative to the place, and derivatives up to an order."""
        known = {S: s} | {number(i): at[x] for i, x in enumerate(self.of_curve)}
        rows = [
            ufl.as_vector([ufl.replace(x, known) for x in row])
            for row in expansion(self.structure, order)
        ]
        return [rows[0] - ufl.as_vector([at["x"], at["y"]]), *rows[1:]]

    def _corrected(self, at: Inputs, p: Expr, s: Expr) -> Expr:
        """Return a better parameter of the point nearest to ``p``, by Newton's method."""
        on, slope, bend = self._curve(at, s, 2)
        square = ufl.dot(slope, slope)
        curved = square - ufl.dot(p - on, bend)
        return s + ufl.dot(p - on, slope) / _if(ufl.gt(curved, square / 2), curved, square / 2)

    def _along(self, at: Inputs, s: Expr, on: Expr, slope: Expr) -> Expr:
        """Return the vector to which the force is normal."""
        if self.scheme.average(0.0, 1.0) == 1.0:
            return slope
        way = s - at["last s"]
        _, middle, _, third = self._curve(at, (s + at["last s"]) / 2, 3)
        series, chord = middle + way**2 / 24 * third, on - ufl.as_vector([at["on x"], at["on y"]])
        aside = abs(series[0] * chord[1] - series[1] * chord[0])
        exact = ufl.gt(aside, at["round-off"] * ufl.sqrt(ufl.dot(series, series)))
        return ufl.as_vector(
            [
                _if(exact, c / _if(ufl.eq(way, 0.0), 1.0, way), d)
                for c, d in zip(chord, series, strict=True)
            ]
        )

    def equations(self, at: Inputs) -> Equations:
        """See the base class; round-off of the distance does not count."""
        _, moved = at.motions("q1")
        p, λ, none = ufl.as_vector([moved[0], moved[1]]), at["q1 force0"], ufl.as_ufl(0.0)
        found = at["s"]
        for _ in range(2 if self.tabulated else CORRECTIONS):  # C tries further rows of tables
            found = self._corrected(at, p, found)
        s = at["s"]
        for _ in range(2):
            s = at.stage(self._corrected(at, p, s))
        on, slope = self._curve(at, s, 1)
        gap, length = p - on, ufl.sqrt(ufl.dot(slope, slope))
        distance = (slope[0] * gap[1] - slope[1] * gap[0]) / length
        whole = ufl.sqrt(ufl.dot(gap, gap))
        signed = _if(ufl.lt(distance, 0.0), -whole, whole)
        e = at.stage(_if(ufl.le(whole, at["round-off"]), 0.0, signed), distance)
        t = self._along(at, s, on, slope)
        x, y = (at.stage(t[i] / ufl.sqrt(ufl.dot(t, t))) for i in (0, 1))
        now = {name: at[name] for name in self.modes}
        now["s"] = _if(ufl.lt(abs(found), FAR), found, at["s"])
        recorded = {f"{name} 0": none for name in RECORDED} | {"motion 0": e}
        return Equations(
            [none, -λ * y, none, λ * x, none, none, e],
            {"force 0": λ, "last s": s, "on x": on[0], "on y": on[1]},
            modes=now, motions=[e], recorded=recorded,
        )  # fmt: skip


FAR = 1e300
"""Parameters beyond, and those that are not a number, are not found."""


class GuideBlock(ConnectorBlock):
    """Guides along curves of one structure."""

    def __init__(self, statement: OnCurve, *arguments: Any) -> None:
        super().__init__(statement, *arguments)
        self.statement: OnCurve
        laws: list[Any] = [connector.law for connector in self.connectors]
        curves = [law.curve for law in laws]
        for i, (curve, connector) in enumerate(zip(curves, self.connectors, strict=True)):
            on, at = curve.at(0.0)[0] - connector.b.point, divmod(i, BATCH)
            self.state["on x"][at], self.state["on y"][at] = on
        self._tables: list[Array] = [x.table for x in curves] if statement.tabulated else []
        if self._tables:
            rows = np.array([len(table) for table in self._tables], dtype=np.int32)
            fill(
                self._c, columns=statement.count, table_rows=rows,
                table=ffi.new("double *[]", [*map(doubles, self._tables)]),
            )  # fmt: skip

    def is_like(self, term: Any) -> bool:
        """See the base class."""
        pairs = zip(self._tables, term._tables, strict=True)
        return super().is_like(term) and all(np.array_equal(*pair) for pair in pairs)

    def _begins(self, neighbour: GuideBlock) -> list[Loop]:
        """See the base class: the state follows from the configuration of the run."""
        return [
            loop("begin_neighbour", struct("block_pair", block=self._c, neighbour=neighbour._c))
        ]

    def motion(self, q: Array) -> Array:
        """See the base class: sought from the accepted points of the curves."""
        lib.begin_block_again(self._c, ffi.NULL, ffi.NULL, ffi.NULL)
        self.add_residual(q, np.zeros(len(q)))
        return super().motion(q)


def _if(condition: Any, yes: Any, no: Any) -> Expr:
    return ufl.conditional(condition, yes, no)
