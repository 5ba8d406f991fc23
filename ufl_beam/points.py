"""Material points: the return map of many at once, their state and their energies.

The return map is evaluated with complex strains whose imaginary part is a tiny step.  The real part
of the answer is the stress, the imaginary part over the step is its derivative: the consistent
tangent, exact to round-off, from the statement of the law itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ufl_beam.compat import Array
from ufl_beam.laws import Bulk, Softening, Values, sign

STEP = 1e-30
"""Imaginary step of derivatives; its square vanishes beside any strain."""

CLOSE = 1e-9
"""Relative step at which an opening is one step of Newton's method from round-off."""

MOST_ITERATIONS = 60

Resistance = Callable[[Softening, Array, Values], Values]
"""Traction at a discontinuity during a step: from its law, its opening before, and the growth."""


@dataclass(frozen=True, eq=False)
class Discontinuities:
    """Jumps embedded in the cells at those points that may break, P(25)-P(34).

    A jump relaxes the strain of the bulk by jump over length; what the bulk then bears is what the
    law of softening resists with: the second Euler equation of the Hu-Washizu functional.

    Attributes:
        softening: The law.
        where: Columns of the points that may break.
        jump: At t_n; shape (cells, m); rad, or m for fibres.
        opening: Accumulated over jumps in both directions, at t_n; shape (cells, m).
        resistance: Traction in a step.
    """

    softening: Softening
    where: slice
    jump: Array
    opening: Array
    resistance: Resistance


class Points:
    """Points of the same layout in many cells.

    Args:
        bulk: Law of the bulk; arrays that broadcast to (cells, n).
        weights: Of the points; shape (n,).
        length: Of the cells; shape (cells, 1); m.
        p: Plastic strains at t_n, zero; shape (cells, n).
        ξ: Accumulated plastic strains at t_n, zero; shape (cells, n).
        breaks: Discontinuities, if any.
        θ: Part of a step at which the bulk follows its law.

    Attributes:
        worked: Energy that the plastic strains of each cell dissipated since the beginning; J.
        broken: Energy that the discontinuities of each cell dissipated; J.
    """

    def __init__(
        self,
        bulk: Bulk,
        weights: Array,
        length: Array,
        p: Array,
        ξ: Array,
        breaks: Discontinuities | None,
        θ: float,
    ) -> None:
        self._bulk, self._weights, self._length, self._θ = bulk, weights, length, θ
        self.p, self.ξ, self.breaks = p, ξ, breaks
        self._dt = 1.0
        self._e0: Array = np.zeros_like(p)
        self._dp: Array = np.zeros_like(p)
        self._growth: Array = np.zeros_like(p if breaks is None else breaks.jump)
        self.worked: Array = np.zeros(len(p))
        self.broken: Array = np.zeros(len(p))

    # -- the step ------------------------------------------------------------------------------

    def begin(self, strain: Array, dt: float) -> None:
        """Take note of the strains at the beginning of a step; shape (cells, n)."""
        self._e0, self._dt = strain, dt
        if self.breaks is not None:
            self._traction = self.breaks.softening.traction(self.breaks.opening)

    def respond(self, strain: Array) -> tuple[Array, Array]:
        """Stresses that act in a step that ends at ``strain``, and their derivatives; (cells, n).

        They are not a number where an opening was not found.
        """
        mean = self._without_jumps((1 - self._θ) * self._e0 + self._θ * strain)
        e: Values = mean + 1j * (self._θ * STEP)
        dp = self._bulk.flow(e, self.p, self.ξ, self._θ, self._dt)
        σ = self._bulk.stress(e, self.p + self._θ * dp)
        if self.breaks is not None:
            self._open(self.breaks, e, σ, dp)
        self._dp = dp.real
        return σ.real, σ.imag / STEP

    def _without_jumps(self, strain: Array) -> Array:
        """Strain of the bulk, with the jumps of t_n."""
        if self.breaks is None:
            return strain
        bulk = strain.copy()
        bulk[:, self.breaks.where] -= self.breaks.jump / self._length
        return bulk

    def _open(self, breaks: Discontinuities, e: Values, σ: Values, dp: Values) -> None:
        """Let those discontinuities grow that cannot bear what the bulk bears; σ, dp in place.

        The trial is the response of the bulk, plastic or not, to the jumps of t_n.
        """
        self._growth.fill(0.0)
        σ_b, dp_b = σ[:, breaks.where], dp[:, breaks.where]
        over = np.abs(σ_b.real) > self._traction  # P(51)
        if not over.any():
            return
        θ, dt, s = self._θ, self._dt, sign(σ_b[over])
        bulk = self._bulk.at(self.p.shape, breaks.where, over)
        e, p, ξ = (x[:, breaks.where][over] for x in (e, self.p, self.ξ))
        relief = (θ * s) / np.broadcast_to(self._length, over.shape)[over]
        opening = breaks.opening[over]

        def bear(e: Values, a: Values) -> tuple[Values, Values]:
            e = e - relief * a
            dp = bulk.flow(e, p, ξ, θ, dt)
            return bulk.stress(e, p + θ * dp), dp

        def excess(e: Values, a: Values) -> Values:
            return np.asarray(s * bear(e, a)[0] - breaks.resistance(breaks.softening, opening, a))

        a = _root(lambda a: excess(e.real, a), (e.real - p) / relief)
        slope = excess(e.real, a + 1j * STEP).imag / STEP
        # One more step of Newton's method, with complex strains: the implicit function theorem.
        a = a - excess(e, a) / slope
        σ_b[over], dp_b[over] = bear(e, a)
        self._growth[over] = s * a.real

    # -- the state -----------------------------------------------------------------------------

    def accept(self, strain: Array) -> Array:
        """Take the end of the step as the new state.

        The latest response must have been to ``strain``.

        Returns:
            What backward Euler (θ = 1) loses numerically in each cell; (cells,); J.
        """
        bulk, dp = self._bulk, self._dp
        before = self._without_jumps(self._e0) - self.p
        self.worked += self._sum(bulk.dissipation(dp, self._dt))
        self.p += dp
        self.ξ += np.abs(dp)
        if self.breaks is not None:
            a = np.abs(self._growth)
            energy = a * self.breaks.softening.mean_traction(self.breaks.opening, a)
            self.broken += energy @ self._weights[self.breaks.where]
            self.breaks.jump[:] += self._growth
            self.breaks.opening[:] += a
        change = self._without_jumps(strain) - self.p - before
        return self._sum(bulk.elastic_energy(change) + bulk.hardening_energy(dp, dp))

    def stress(self, strain: Array) -> Array:
        """Stresses in the accepted state; shape (cells, n)."""
        return np.asarray(self._bulk.stress(self._without_jumps(strain), self.p))

    def elastic_energy(self, strain: Array) -> Array:
        """Energy that each cell stores elastically in the accepted state; (cells,); J."""
        return self._sum(self._bulk.elastic_energy(self._without_jumps(strain) - self.p))

    def hardening_energy(self) -> Array:
        """Energy that hardening stores in each cell; (cells,); J."""
        return self._sum(self._bulk.hardening_energy(self.p, self.ξ))

    def _sum(self, density: Array) -> Array:
        return (density @ self._weights) * self._length[:, 0]


def _root(excess: Callable[[Values], Values], unloaded: Array) -> Array:
    """Roots of concave functions that are positive at zero; not a number where none was found.

    Newton's method comes to them from above without fail.

    Args:
        excess: The functions.
        unloaded: Where the bulk alone would bear nothing: an upper bound, if it is positive.
    """
    at_zero = excess(np.zeros_like(unloaded) + 1j * STEP)
    a = np.where(unloaded > 0, unloaded, np.abs(unloaded) + np.finfo(float).tiny)
    falls = at_zero.imag < 0
    newton = np.divide(-at_zero.real * STEP, at_zero.imag, where=falls, out=np.full_like(a, np.inf))
    a = np.minimum(a, newton)
    for _ in range(MOST_ITERATIONS):
        g = excess(a + 1j * STEP)
        below = (g.real > 0) & (g.imag >= 0)
        step = np.where(below, -a, g.real * STEP / np.where(below, -STEP, g.imag))
        a = a - step
        found = np.abs(step) <= CLOSE * np.maximum(a, CLOSE * np.abs(unloaded))
        if found.all():
            return a
    return np.where(found, a, np.nan)
