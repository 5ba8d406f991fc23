# SPDX-License-Identifier: MIT
"""Material points whose return map is NumPy: the laws called on arrays, all points at once.

What material_points.c does point after point.  Derivatives are complex steps, as the laws are
functions of real and complex numbers alike.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import lib
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.law_functions import Values
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.openings import HOLD, OPENED, OVER, RELEASED, STIFF

IMAGINARY = 1e-200
"""Step into the imaginary: its square disturbs no digit of the value."""

EPS = float(np.finfo(float).eps)


def derivative(f: Callable[[Values], Values], x: Array) -> tuple[Array, Array]:
    """Value and derivative of a function of arrays, entry by entry."""
    y = f(x + 1j * IMAGINARY)
    return np.real(y).copy(), np.imag(y) / IMAGINARY


class ReferencePoints(Points):
    """Points whose laws are called on arrays."""

    def _prepare(self, scheme: Scheme, length: Array) -> None:
        self._scheme, self._excess = scheme, 0.0

    # -- the laws --------------------------------------------------------------------------------

    def _state(self, storage: Array) -> dict[str, Array]:
        """Numbers of the points by name; views."""
        return {name: storage[:, :, i] for i, name in enumerate(self._at)}

    @np.errstate(over="ignore")  # of a viscosity over a short step
    def _flow(self, at: dict[str, Array], strain: Values, growth: Values) -> tuple[Values, Values]:
        """Stress of the bulk at t_n+θ, and the plastic flow of the step."""
        law, θ = self._law(at), self._scheme.theta
        jump = at["jump"] + θ * at["direction"] * growth
        e = (1 - θ) * at["before"] + θ * strain - jump / at["length"]
        dp = law.flow(e, at["plastic"], at["accumulated"], θ, at["dt"])
        return law.stress(e, at["plastic"] + θ * dp), dp

    def _law(self, at: dict[str, Array]) -> Values:
        statement = self._layout.statement
        return statement(at["stiffness"], *(at[name] for name in statement.numbers()))

    def _over(self, at: dict[str, Array], strain: Values, growth: Values) -> Values:
        """Excess of what the bulk bears over the resistance of the discontinuity."""
        stress, _ = self._flow(at, strain, growth)
        return at["direction"] * stress - self._resistance(at, growth)

    def _resistance(self, at: dict[str, Array], growth: Values) -> Values:
        return self._scheme.resistance(self._softening(at), at["opening"], growth)

    def _softening(self, at: dict[str, Array]) -> Values:
        law = self._layout.softening
        return law and law.of(at["softening limit"], at["softening energy"])

    # -- the step --------------------------------------------------------------------------------

    def respond(self, strains: Array) -> tuple[Array, Array]:
        """Answer the strains of an iterate."""
        at, flags, layout, θ = self._at, self._search.flags, self._layout, self._scheme.theta
        self.strains[:] = strains
        at["strain"][:] = strain = strains @ layout.strains.T
        at["growth"][:] = at["direction"][:] = 0.0
        none = np.zeros_like(strain)
        stress, slope = derivative(lambda ε: self._flow(at, ε, none)[0], strain)
        over = np.abs(stress) > at["traction"]  # P(51)
        held = over & (flags[HOLD] == 1) & (at["flows"] == lib.CLOSED) & (at["traction"] > 0)
        self._excess = float(np.max(np.abs(stress[held]) / at["traction"][held] - 1, initial=0.0))
        opens = over & ~held
        if held.any():
            flags[OVER] = 1
        if flags[STIFF]:
            slope = np.where(over, slope, θ * at["stiffness"])
        if opens.any():
            flags[OPENED] = 1
            at["direction"][:] = np.where(opens, np.where(stress < 0, -1.0, 1.0), 0.0)
            at["growth"][:] = np.where(opens, self._growth(at, strain), 0.0)
            stress_open, slope_open = self._opened(at, strain)
            stress, slope = np.where(opens, stress_open, stress), np.where(opens, slope_open, slope)
        B, w = layout.strains, layout.weights
        self.r[:] = layout.rest * ((1 - θ) * self._e0 + θ * strains) + (w * stress) @ B
        D = np.einsum("n,cn,nk,nl->ckl", w, slope, B, B) + θ * np.diag(layout.rest)
        self.D[:] = D.reshape(-1, 9)
        return self.r, self.D

    def _opened(self, at: dict[str, Array], strain: Array) -> tuple[Array, Array]:
        """Stress at the growth that was found, and its derivative, condensed as P(74), P(75)."""
        a = at["growth"]
        stress, by_strain = derivative(lambda ε: self._flow(at, ε, a)[0], strain)
        _, by_growth = derivative(lambda g: self._flow(at, strain, g)[0], a)
        _, over_by_strain = derivative(lambda ε: self._over(at, ε, a), strain)
        _, over_by_growth = derivative(lambda g: self._over(at, strain, g), a)
        with np.errstate(divide="ignore", invalid="ignore"):
            return stress, by_strain - by_growth * over_by_strain / over_by_growth

    def _growth(self, at: dict[str, Array], strain: Array) -> Array:
        """Growth at which nothing is over the resistance; Newton's method between two bounds."""
        length, θ = at["length"], self._scheme.theta
        e = (1 - θ) * at["before"] + θ * strain - at["jump"] / length
        bound = np.abs(e - at["plastic"]) * length / θ + np.finfo(float).tiny
        digits = np.maximum(np.abs(at["before"]), np.abs(strain)) * length + np.abs(at["jump"])
        digits = 4 * EPS * (bound + digits)
        found = np.full_like(strain, np.nan)
        low, high = np.zeros_like(strain), np.full_like(strain, np.inf)
        with np.errstate(all="ignore"):
            over, slope = derivative(lambda g: self._over(at, strain, g), low)
            none = ~(over > 0)  # a last digit over the limit, or not among those that open
            a = np.where(slope < 0, np.fmin(bound, -over / slope), bound)
            for _ in range(200):
                over, slope = derivative(lambda g: self._over(at, strain, g), a)
                low, high = np.where(over > 0, a, low), np.where(over > 0, high, a)
                better = a - over / slope
                step = np.abs(better - a)
                # So small a relative step was the last but none: the next one would be its square.
                ends = np.isnan(found) & ((step <= 1e-9 * a) | (step <= digits))
                found = np.where(ends, np.where(better > 0, better, a), found)
                if (none | ~np.isnan(found)).all():
                    break
                halved = np.where(np.isfinite(high), (low + high) / 2, 2 * a)
                a = np.where((better > low) & (better < high), better, halved)
        return np.where(none, 0.0, found)

    @property
    def excess(self) -> float:
        """Largest ``|stress| / limit - 1`` of a point that was held closed, or zero."""
        return self._excess

    def release(self, least: float) -> None:
        """Let held points open from now on whose excess was so large in the latest response."""
        at = self._at
        stress, _ = self._flow(at, at["strain"], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.abs(stress) / at["traction"] - 1
        closed = (at["flows"] == lib.CLOSED) & np.isfinite(at["traction"])
        at["flows"][closed & (excess > 0) & (excess >= least)] = RELEASED

    # -- the end of a step -----------------------------------------------------------------------

    def accept(self) -> None:
        """Take the strains of the latest response as the new state."""
        self.sums[:] = self._commit(self._storage, self._e0, self.kept)

    def _sums_to_come(self) -> Array:
        """Return :attr:`sums` as :meth:`accept` would leave them."""
        return self._commit(self._storage.copy(), self._e0.copy(), self.kept.copy())

    def _commit(self, storage: Array, e0: Array, kept: Array) -> Array:
        """Write the end of the step into these arrays; return :attr:`sums`."""
        at, layout = self._state(storage), self._layout
        law, softening, growth = self._law(at), self._softening(at), at["growth"].copy()
        length, volume = at["length"][:, 0], layout.weights * at["length"]
        _, dp = self._flow(at, at["strain"], growth)

        # What cells have besides points is elastic.
        change = self.strains - e0
        lost = np.sum(layout.rest * change**2 / 2 * length[:, None])
        elastic = np.sum(layout.rest * self.strains**2 / 2 * length[:, None])
        e0[:] = self.strains

        before = at["before"] - at["jump"] / at["length"] - at["plastic"]
        at["before"][:] = at["strain"]
        at["plastic"] += dp
        at["accumulated"] += np.abs(dp)
        at["jump"] += at["direction"] * growth
        worked = law.dissipation(dp, at["dt"])
        broken = np.zeros_like(dp)
        if softening is not None:
            broken = growth * softening.mean_traction(at["opening"], growth)
        at["opening"] += growth
        at["flows"][:] = np.where(growth > 0, lib.FLOWING, lib.CLOSED)
        at["growth"][:] = at["direction"][:] = 0.0
        now = at["before"] - at["jump"] / at["length"] - at["plastic"]
        of_step = law.elastic_energy(now - before) + law.hardening_energy(dp, dp)
        energy, stress = law.elastic_energy(now), law.stress(now, 0.0)

        # Where viscous stresses relax, their mean works more than those at the end.
        hardened = of_step - law.elastic_energy(now - before)
        relaxed = np.where(dp != 0, hardened - law.stress(now - before, 0.0) / 2 * dp, 0.0)
        # What has broken bears nothing; its elastic strain goes into the jump.
        if softening is not None:
            breaks = np.isfinite(at["traction"])
            at["traction"][breaks] = softening.traction(at["opening"])[breaks]
        gone = at["traction"] == 0
        at["jump"] += np.where(gone, now * at["length"], 0.0)
        released = np.sum(np.where(gone, volume * energy, 0.0))
        energy, stress = np.where(gone, 0.0, energy), np.where(gone, 0.0, stress)

        kept[:, :3] = layout.rest * self.strains + (layout.weights * stress) @ layout.strains
        kept[:, 3] = at["jump"][:, -1]
        plastic, broken = np.sum(volume * worked, axis=1), np.sum(layout.weights * broken, axis=1)
        kept[:, 4] += plastic
        kept[:, 5] += broken
        return np.array([
            np.sum(plastic), np.sum(broken), lost + np.sum(volume * of_step),
            elastic + np.sum(volume * energy),
            np.sum(volume * law.hardening_energy(at["plastic"], at["accumulated"])),
            released, np.sum(volume * np.maximum(relaxed, 0.0)),
        ])  # fmt: skip
