# SPDX-License-Identifier: MIT
"""Material points whose return map is NumPy: the laws called on arrays, all points at once.

What material_points.c does point after point.  Derivatives are complex steps, as the laws are
functions of real and complex numbers alike.
"""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import lib
from ufl_beam.mechanics.point_equations import At, prefixed
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.terms.complex_steps import EPS, derivative, jacobian, part_of, solved
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.openings import HOLD, OPENED, OVER, RELEASED, STIFF


class ReferencePoints(Points):
    """Points whose laws are called on arrays."""

    def _prepare(self, scheme: Scheme, length: Array) -> None:
        self._scheme, self._frozen = scheme, False

    # -- the laws --------------------------------------------------------------------------------

    def _state(self, storage: Array) -> dict[str, Array]:
        """Numbers of the points by name; views."""
        return {name: storage[:, :, i] for i, name in enumerate(self.names)}

    @np.errstate(over="ignore")  # of a viscosity over a short step
    def _flow(self, at: At) -> Array:
        """Stresses of the bulk at t_n+θ; (d, cells, n) of points with d strains."""
        equations = self._equations
        stress = equations.elastic_stress(at) if self._frozen else equations.stress(at)
        return np.array([s + 0 * at["length"] for s in stress])

    def _residuals(self, at: At) -> Array:
        """Residuals of the variables that a law solves for; (m, cells, n)."""
        return np.array([r + 0 * at["length"] for r in self._equations.residuals(at)])

    @np.errstate(invalid="ignore")  # where the variables were not found
    def _answer(self, at: At) -> tuple[Array, Array]:
        """Stresses of the bulk, and derivatives by strains; (d, cells, n), (d, d, cells, n)."""
        strains, law = self._rows("strain"), self._layout.kind.law
        if not law.solves or self._frozen:
            return jacobian(self._flow, at, strains)
        self._solve(at)
        unknown = prefixed("new", law.variables)
        stress, tangent = jacobian(self._flow, at, strains)
        _, by_unknown = jacobian(self._flow, at, unknown)
        J, E = (jacobian(self._residuals, at, names)[1] for names in (unknown, strains))
        return stress, tangent - np.einsum("aj...,jb...->ab...", by_unknown, solved(J, E))

    @np.errstate(all="ignore")
    def _solve(self, at: At) -> None:
        """Find the variables of a law from its residuals, as solve_law in C does."""
        variables, strains = self._layout.kind.law.variables, self._rows("strain")
        unknown = prefixed("new", variables)
        for name, old in zip(unknown, prefixed("state", variables), strict=True):
            at[name][:] = at[old]
        ε, done = np.array([at[name] for name in strains]), np.zeros(at["length"].shape, bool)
        for _ in range(int(lib.MOST_CORRECTIONS) + 1):
            R, J = jacobian(self._residuals, at, unknown)
            _, E = jacobian(self._residuals, at, strains)
            z, δ = np.array([at[name] for name in unknown]), solved(J, R[:, None])[:, 0]
            sizes = np.einsum("ij...,j...->i...", abs(J), abs(δ))
            digits = np.einsum("ij...,j...->i...", abs(J), abs(z))
            digits = 4 * EPS * (digits + np.einsum("ij...,j...->i...", abs(E), abs(ε)))
            small = (abs(R) <= digits) | (abs(δ) <= 1e-9 * abs(z))
            ends = ~done & small.all(axis=0)
            sizes = sizes + digits
            before = part_of(R, sizes)
            part: Array = np.ones(done.shape)
            for _ in range(10):
                for name, value in zip(unknown, z - part * δ, strict=True):
                    at[name][:] = np.where(done, at[name], value)
                falls = part_of(self._residuals(at), sizes) <= (1 - part / 10) * before
                if (falls | done | ends).all():
                    break
                part = np.where(falls | done | ends, part, part / 2)
            done |= ends
            if done.all():
                return
        for name in unknown:
            at[name][~done] = np.nan

    # -- the step --------------------------------------------------------------------------------

    def respond(self, strains: Array) -> tuple[Array, Array]:
        """Answer the strains of an iterate."""
        at, flags, layout, θ = self._at, self._search.flags, self._layout, self._scheme.theta
        self.strains[:] = strains
        for name, values in zip(self._rows("strain"), self._of_points(strains), strict=True):
            at[name][:] = values
        at["growth"][:] = at["direction"][:] = 0.0
        stress, slope = self._answer(at)
        first = stress[0]  # of points that can open the only one
        over = np.abs(first) > at["traction"]
        held = over & (flags[HOLD] == 1) & (at["flows"] == lib.CLOSED) & (at["traction"] > 0)
        self.over[0] = float(np.max(np.abs(first[held]) / at["traction"][held] - 1, initial=0.0))
        opens = over & ~held
        if held.any():
            flags[OVER] = 1
        if flags[STIFF]:
            C = np.array([at[name] for name in self._rows("stiffness")])
            slope = np.where(over, slope, θ * np.einsum("ab,b...->ab...", np.eye(len(C)), C))
        if opens.any():
            flags[OPENED] = 1
            at["direction"][:] = np.where(opens, np.where(first < 0, -1.0, 1.0), 0.0)
            at["growth"][:] = self._growth(at, first, opens)
            stress_open, slope_open = self._opened(at)
            stress, slope = np.where(opens, stress_open, stress), np.where(opens, slope_open, slope)
        B, w = layout.strains.reshape(-1, len(stress), 3), layout.weights
        self.r[:] = layout.rest * ((1 - θ) * self._e0 + θ * strains)
        self.r[:] += np.einsum("n,acn,nak->ck", w, stress, B)
        D = np.einsum("n,abcn,nak,nbl->ckl", w, slope, B, B) + θ * np.diag(layout.rest)
        self.D[:] = D.reshape(-1, 9)
        return self.r, self.D

    @np.errstate(over="ignore")  # in the branch of a series that is not taken
    def _resistance(self, at: At) -> tuple[Array, Array]:
        """Resistance of the discontinuities in the step, and its derivative by their growth."""
        return derivative(lambda a: self._equations.resistance(at, a), at["growth"])

    def _opened(self, at: At) -> tuple[Array, Array]:
        """Stress at the growth that was found, and its derivative, condensed as P(74), P(75)."""
        stress, slope = self._answer(at)
        _, softens = self._resistance(at)
        with np.errstate(divide="ignore", invalid="ignore"):
            return stress, slope * softens / (slope / at["length"] + softens)

    def _growth(self, at: At, stress: Array, opens: Array) -> Array:
        """Growth at which nothing is over the resistance; Newton's method between two bounds."""
        length, θ = at["length"], self._scheme.theta
        bound = np.abs(stress) / at["stiffness"] * length / θ + np.finfo(float).tiny
        digits = np.maximum(np.abs(at["before"]), np.abs(at["strain"])) * length
        digits = 4 * EPS * (bound + digits + np.abs(at["jump"]))
        found = np.full_like(stress, np.nan)
        low, high = np.zeros_like(stress), np.full_like(stress, np.inf)

        def excess(a: Array) -> tuple[Array, Array]:
            """Excess of what the bulk bears over the resistance, and its derivative."""
            now = {**at, "growth": a}
            borne, tangent = self._answer(now)
            resists, softens = self._resistance(now)
            over = at["direction"] * borne[0] - resists
            return over, -tangent[0, 0] / length - softens

        with np.errstate(all="ignore"):
            over, slope = excess(low)
            # Those that do not open, or were over the limit by a last digit.
            none = np.logical_not(np.logical_and(opens, over > 0))
            a = np.where(slope < 0, np.fmin(bound, -over / slope), bound)
            last = np.full_like(stress, np.inf)
            for _ in range(200):
                before, (over, slope) = over, excess(a)
                low, high = np.where(over > 0, a, low), np.where(over > 0, high, a)
                better = a - over / slope
                step = np.abs(better - a)
                # So small a relative step was the last but none: the next one would be its square.
                ends = np.isnan(found) & ((step <= 1e-9 * a) | (step <= digits))
                found = np.where(ends, np.where(better > 0, better, a), found)
                if (none | ~np.isnan(found)).all():
                    break
                halved = np.where(np.isfinite(high), (low + high) / 2, 2 * a)
                wanders = ((before > 0) != (over > 0)) & (step > last / 2) & np.isfinite(high)
                within, last = (better > low) & (better < high) & ~wanders, step
                a = np.where(within, better, halved)
        return np.where(none, 0.0, found)

    def release(self, least: float) -> None:
        """Let held points open from now on whose excess was so large in the latest response."""
        at = self._at
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.abs(self._answer(at)[0][0]) / at["traction"] - 1
        closed = (at["flows"] == lib.CLOSED) & np.isfinite(at["traction"])
        at["flows"][closed & (excess > 0) & (excess >= least)] = RELEASED

    def _let_stay(self) -> None:
        """Let the variables of the bulk stay as they are from now on."""
        self._frozen = True

    def gives_energy(self) -> int:
        """Number of the point that gives most energy in the latest response, or -1."""
        law = self._layout.kind.law
        if not law.must_dissipate:
            return -1

        def stored(at: At) -> Array:
            return np.array([self._equations.stored(at) + 0 * at["length"]])

        with np.errstate(all="ignore"):
            _, slopes = jacobian(stored, self._at, prefixed("new", law.variables))
            own, size = self._equations.own_dissipation(self._at, tuple(slopes[0]))
            part = np.nan_to_num(own / size).ravel()
        worst = int(np.argmin(part))
        return worst if part[worst] < -lib.NO_ENERGY else -1

    # -- the end of a step -----------------------------------------------------------------------

    def accept(self) -> None:
        """Take the strains of the latest response as the new state."""
        self.sums[:] = self._commit(self._storage, self._e0, self.kept)

    def _sums_to_come(self) -> Array:
        """Return :attr:`sums` as :meth:`accept` would leave them."""
        return self._commit(self._storage.copy(), self._e0.copy(), self.kept.copy())

    @np.errstate(over="ignore")
    def _commit(self, storage: Array, e0: Array, kept: Array) -> Array:
        """Write the end of the step into these arrays; return :attr:`sums`."""
        at, layout = self._state(storage), self._layout
        length, volume = at["length"][:, 0], layout.weights * at["length"]
        end = self._equations.end(at)
        energy, stress = end.elastic, np.array([s + 0 * at["length"] for s in end.stress])

        # What cells have besides points is elastic.
        change = self.strains - e0
        lost = np.sum(layout.rest * change**2 / 2 * length[:, None])
        elastic = np.sum(layout.rest * self.strains**2 / 2 * length[:, None])
        e0[:] = self.strains

        variables = prefixed("state", layout.kind.law.variables)
        for name, grown in zip(variables, end.changes, strict=True):
            at[name][:] += grown
        for name, now in zip(self._rows("before"), self._rows("strain"), strict=True):
            at[name][:] = at[now]
        at["jump"][:] += at["direction"] * at["growth"]
        at["opening"][:] += at["growth"]
        at["flows"][:] = np.where(at["growth"] > 0, lib.FLOWING, lib.CLOSED)
        at["growth"][:] = at["direction"][:] = 0.0

        # What has broken bears nothing; its elastic strain goes into the jump.
        breaks = np.isfinite(at["traction"])
        at["traction"][breaks] = (end.resistance + 0 * at["length"])[breaks]
        gone = at["traction"] == 0
        for relieved, name in zip(stress, self._rows("stiffness"), strict=True):
            at["jump"][:] += np.where(gone, relieved / at[name] * at["length"], 0.0)
        released = np.sum(np.where(gone, volume * (energy - end.left), 0.0) + volume * end.missed)
        energy, stress = np.where(gone, end.left, energy), np.where(gone, 0.0, stress)

        B = layout.strains.reshape(-1, len(stress), 3)
        kept[:, :3] = layout.rest * self.strains
        kept[:, :3] += np.einsum("n,acn,nak->ck", layout.weights, stress, B)
        kept[:, 3] = at["jump"][:, -1]
        plastic = np.sum(volume * end.worked, axis=1)
        broken = np.sum(layout.weights * (end.broken + 0 * at["length"]), axis=1)
        kept[:, 4] += plastic
        kept[:, 5] += broken
        return np.array([
            np.sum(plastic), np.sum(broken), lost + np.sum(volume * end.lost),
            elastic + np.sum(volume * energy), np.sum(volume * end.hardening), released,
            np.sum(volume * end.relaxed),
        ])  # fmt: skip
