# SPDX-License-Identifier: MIT
"""Plastic hinges of zero length: the jump is held, or its moment follows a softening law."""

from __future__ import annotations

from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.connectors import Connector, law_of


class Hinge:
    """Law of a hinge of zero length in a step; motion e and moment λ are unknowns of the step.

    Attributes:
        opening: Sum of the absolute values of the growths of the jump; rad.
        flows: Direction of the growth in the last step, or 0.
        way: Direction in which the jump grows in this step, or 0.
        excess: Relative excess of the moment over the limit of a held hinge.
        lost: Dissipated energy; J.
    """

    def __init__(self, hinge: Connector, scheme: Scheme) -> None:
        self.law: Any = law_of(hinge)
        self.scheme, self.opening, self.flows, self.lost, self.e0 = scheme, 0.0, 0, 0.0, 0.0
        self.begin(0.0, hold=True)

    @property
    def limit(self) -> float:
        """Moment that the hinge bears at the beginning of the step; N m."""
        return float(self.law.traction(np.array(self.opening)))

    def begin(self, dt: float, *, hold: bool) -> None:
        """Begin a step, in which the hinge moves on if it moved in the last one."""
        self.way, self.excess, self.grown, self.moment = self.flows, 0.0, 0.0, 0.0

    def row(self, e: float, moment: float, *, steep: bool) -> tuple[float, float, float]:
        """Return (α, β, γ) of the linear equation α e + β λ = γ of a Newton iteration.

        With ``steep``, the tangent has the opposite sign, so that nodes between hinges move with
        the unbalanced moment.
        """
        self.grown, self.moment = e - self.e0, moment
        if self.way == 0:
            return 1.0, 0.0, self.e0
        a = np.array([max(self.way * self.grown, 0.0) + 1e-200j])
        t: Any = self.scheme.resistance(self.law, np.array([self.opening]), a)[0]
        falls = abs(t.imag * 1e200) if steep else t.imag * 1e200
        return -falls, 1.0, self.way * t.real - falls * e

    def turns_back(self) -> bool:
        """Hold the hinge if it has turned back, and return whether; else measure the excess."""
        back, self.excess, limit = self.way * self.grown < 0, 0.0, self.limit
        if limit == 0:
            back, self.way = self.way == 0, -1 if self.grown < 0 else 1
        elif back:
            self.way = 0
        elif self.way == 0:
            self.excess = max(abs(self.moment) / limit - 1 - 1e-12, 0.0)
        return back

    def release(self, least: float) -> None:
        """Let the hinge open if its excess is large enough."""
        if self.excess > 0 and self.excess >= least:
            self.way = -1 if self.moment < 0 else 1

    def change(self) -> float:
        """Return the energy dissipated in the step; J."""
        a = np.array([abs(self.way * self.grown)])
        return float((a * self.law.mean_traction(np.array([self.opening]), a))[0])

    def accept(self) -> None:
        """Accept the jump at the end of a step."""
        self.lost, a = self.lost + self.change(), abs(self.way * self.grown)
        self.opening, self.flows, self.e0 = (
            self.opening + a,
            self.way * (a > 0),
            self.e0 + self.grown,
        )

    def state(self) -> Array:
        """Return the variables that follow the numbers of a connector in ``solution.internal``."""
        return np.array([self.opening, self.e0, self.limit, 0.0, self.lost, self.flows, 0.0])

    def restore(self, row: Array) -> None:
        """Begin with a row of :meth:`state`."""
        self.opening, self.e0, _, _, self.lost, flows, _ = map(float, row)
        self.flows = int(flows)
