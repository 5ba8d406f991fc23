# SPDX-License-Identifier: MIT
"""Return map of material points in NumPy, for all points of one kind at once.

The input of a point is the strain at the end of a step.  Laws are called on arrays; derivatives are
by complex steps.  If the stress exceeds the resistance of the discontinuity, the jump grows until
both are equal, and its growth is condensed out of the tangent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from old_reference.cell_forms import Search, Setting
from ufl_beam.arrays import Array
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.point_equations import At, PointEquations, curved, inputs, prefixed, rows
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.law_functions import Values

CLOSED, FLOWING = 0.0, 1.0
"""Values of the flag of a discontinuity that did not grow, or did grow, in the last step."""

IMAGINARY = 1e-200  # size of a complex step; its square does not change the value

EPS = float(np.finfo(float).eps)

NO_ENERGY = 1e-9
"""Largest energy gain that counts as zero, divided by the size of the terms of dissipation."""

CORRECTIONS, HALVINGS = 100, 10
"""Maximum number of Newton corrections of variables, and of halvings of a correction."""


# -- derivatives ---------------------------------------------------------------------------------


def derivative(f: Callable[[Values], Values], x: Array) -> tuple[Array, Array]:
    """Return value and derivative of a function that acts on arrays entry by entry."""
    y = f(x + 1j * IMAGINARY)
    return np.real(y).copy(), np.imag(y) / IMAGINARY


def jacobian(
    f: Callable[[At], Sequence[Values]], at: Mapping[str, Values], by: Sequence[str]
) -> tuple[Array, Array]:
    """Return values of functions, and derivatives by the k inputs ``by``; (n, ...), (n, k, ...)."""
    k, shape = len(by), np.shape(at[by[0]])
    # One call for all inputs: the first axis of an input is that of the k derivatives.
    steps = 1j * IMAGINARY * np.eye(k).reshape(k, k, *np.ones_like(shape))
    values = f({**at, **{name: at[name] + step for name, step in zip(by, steps, strict=True)}})
    y = np.array([np.broadcast_to(value, (k, *shape)) for value in values])
    return np.real(y[:, 0]).copy(), np.imag(y) / IMAGINARY


def solved(A: Array, b: Array) -> Array:
    """Solve A x = b at many points; (n, n, ...), (n, k, ...); NaN where A is singular."""
    A, b = (np.moveaxis(x, (0, 1), (-2, -1)) for x in (A, b))
    A = np.where((np.linalg.det(A) == 0)[..., None, None], np.nan, A)
    return np.asarray(np.moveaxis(np.linalg.solve(A, b), (-2, -1), (0, 1)))


# -- points --------------------------------------------------------------------------------------


class MaterialPoints:
    """Material points of many cells, with the same layout in each cell.

    Args:
        section_points: The points of a cell, with their laws.
        keys: Keys of the cells, for random parameters.
        length: Lengths of the cells; (cells,); m.
        setting: Setting; its scheme decides at which time of a step the laws hold.

    Attributes:
        at: Inputs and internal variables of the points, by name; (cells, n) each.
        r: (N, V, M) of the latest response; (cells, 3).
        D: Derivatives of ``r`` with respect to the strains; (cells, 3, 3).
        recorded: For each cell: (N, V, M) of the accepted state, the jump of the last point, the
            energies dissipated by plastic strains and by discontinuities; (cells, 6).
        stored: Energies in the accepted state, by entry of the ledger; J.
        softens: True if points may open.
        excess: ``|stress| / limit - 1`` of points that are held closed, else 0; (cells, n).
        released: True for points that may open from this iterate on.
        keeps_tangents: True if :meth:`accept` computes ``end_tangents``.
        end_tangents: Derivatives of (N, V, M) in the accepted state, with the laws at the end of
            the step; (cells, 3, 3).
    """

    def __init__(
        self,
        section_points: SectionPoints,
        keys: Sequence[tuple[int, ...]],
        length: Array,
        setting: Setting,
    ) -> None:
        self._section_points, self._scheme, self._ledger = (
            section_points,
            setting.scheme,
            setting.ledger,
        )
        scheme, self._search = setting.scheme, setting.search
        cells, n, self._law = len(keys), len(section_points.weights), section_points.kind.law
        self.at = at = {name: np.zeros((cells, n)) for name in inputs(section_points)}
        names = (rows(self._law, name) for name in ("strain", "before", "stiffness"))
        self._e, self._e0, self._C = names
        self._z, self._z1 = (prefixed(prefix, self._law.variables) for prefix in ("state", "new"))
        self._variables = *self._z, "jump", "opening", *self._e0, "traction", "flows"
        for name, C in zip(self._C, np.reshape(section_points.stiffness, (n, -1)).T, strict=True):
            at[name][:] = C
        for name, value in section_points.parameters(keys).items():
            at[f"number {name}"][:] = value
        for name, initial in zip(self._z, self._law.variables.values(), strict=True):
            at[name][:] = initial
        at["length"][:], at["theta"][:], at["dt"][:] = length[:, None], scheme.theta, 1.0
        at["traction"][:] = np.inf
        for name, value in (
            section_points.softening.parameters() if section_points.softening else {}
        ).items():
            at[f"softening {name}"][:] = value
        self._equations = PointEquations(section_points.kind, section_points.softening, scheme)
        # B times the strains of the cell are the strains of the points, by component.
        self._B = np.asarray(section_points.strains).reshape(n, -1, 3)
        self._volume = section_points.weights * at["length"]
        self.r, self.strains, self.strains0 = np.zeros((3, cells, 3))
        self.D: Array = np.zeros((cells, 3, 3))
        self.recorded: Array = np.zeros((cells, 6))
        self.excess: Array = np.zeros((cells, n))
        self.released: Any = False
        self.keeps_tangents = False
        self.end_tangents = self.D
        self.softens = section_points.softening is not None
        # Broken points have no stress at t_n+θ, where the law holds, but may have a stress at the
        # end of a step.  Its energy is a numerical loss.
        over_step = scheme.average(0.0, 1.0) != 1.0
        releases = over_step and (self.softens or curved(section_points.kind))
        losses = {"plastic": section_points.yields, "hinges": self.softens}
        losses["numerical"] = bool(scheme.alpha) or releases
        self._lost = [name for name, occurs in losses.items() if occurs]
        setting.loses(*self._lost)
        self.stored = {"stored": 0.0, **({"hardening": 0.0} if section_points.yields else {})}

    def _at_points(self, strains: Array) -> Array:
        """Return strains of the points, by component, from cell strains; (d, cells, n)."""
        return np.asarray(np.einsum("nak,ck->acn", self._B, strains))

    def _array(self, values: Sequence[Values]) -> Array:
        """Return values at the points as one array; (m, cells, n)."""
        return np.array([x + 0 * self.at["length"] for x in values])

    # -- a step ----------------------------------------------------------------------------------

    @np.errstate(all="ignore")
    def return_map(self, strains: Array, dt: float) -> None:
        """Compute :attr:`r` and :attr:`D` from the strains of an iterate, (cells, 3).

        The step has the length ``dt``; s.
        """
        at, θ, w = self.at, float(self.at["theta"][0, 0]), self._section_points.weights
        self.strains, at["dt"][:] = strains.copy(), dt
        for name, values in zip(self._e, self._at_points(strains), strict=True):
            at[name][:] = values
        at["growth"][:] = at["direction"][:] = 0.0
        stress, slope = self._bulk(at)
        first = stress[0]  # points that can open have one component
        over = np.abs(first) > at["traction"]  # P(51)
        closed = over & (at["flows"] == CLOSED) & (at["traction"] > 0) & self._search.hold
        closed &= np.logical_not(self.released)
        self.excess = np.where(closed, np.abs(first) / at["traction"] - 1, 0.0)
        self._search.over |= bool(closed.any())
        opens = over & ~closed
        if opens.any():
            at["direction"][:] = np.where(opens, np.where(first < 0, -1.0, 1.0), 0.0)
            at["growth"][:] = self._growth(first, opens)
            _, softens = derivative(partial(self._equations.resistance, at), at["growth"])
            stress_open, D = self._bulk(at)
            condensed = D * softens / (D / at["length"] + softens)  # P(76)
            stress, slope = np.where(opens, stress_open, stress), np.where(opens, condensed, slope)
        rest = self._section_points.rest  # stiffness of resultants without points
        self.r = rest * ((1 - θ) * self.strains0 + θ * strains)
        self.r = self.r + np.einsum("n,acn,nak->ck", w, stress, self._B)
        self.D = self._section_tangents(slope, θ)

    def _bulk(self, at: At) -> tuple[Array, Array]:
        """Return bulk stresses at t_n+θ, and slopes by strain; (d, cells, n), (d, d, cells, n)."""
        stress, d, names = self._equations.stress, len(self._e), (*self._e, *self._z1)
        if not self._law.solves:
            return jacobian(stress, at, self._e)
        self._solve(at)
        (σ, S), (_, R) = (jacobian(f, at, names) for f in (stress, self._equations.residuals))
        return σ, S[:, :d] - np.einsum("aj...,jb...->ab...", S[:, d:], solved(R[:, d:], R[:, :d]))

    def _residuals(self, at: At) -> Array:
        """Return residuals of the variables that a law solves for; (m, cells, n)."""
        return self._array(self._equations.residuals(at))

    def _solve(self, at: At) -> None:
        """Solve for the variables of a law by Newton's method at each point."""
        for name, old in zip(self._z1, self._z, strict=True):
            at[name][:] = at[old]
        ε, done = np.array([at[name] for name in self._e]), np.zeros(at["length"].shape, bool)
        equations, d, names = self._equations.residuals, len(self._e), (*self._e, *self._z1)
        for _ in range(CORRECTIONS + 1):
            R, slopes = jacobian(equations, at, names)
            E, J = slopes[:, :d], slopes[:, d:]
            z, δ = np.array([at[name] for name in self._z1]), solved(J, R[:, None])[:, 0]
            # Sizes of the terms of each equation, and their round-off
            by_z, by_δ = (np.einsum("ij...,j...->i...", abs(J), abs(x)) for x in (z, δ))
            digits = 4 * EPS * (by_z + np.einsum("ij...,j...->i...", abs(E), abs(ε)))
            sizes = by_δ + digits
            ends = done | ((abs(R) <= digits) | (abs(δ) <= 1e-9 * abs(z))).all(axis=0)
            before = _largest_ratio(R, sizes)
            fraction: Array = np.ones(done.shape)
            for _ in range(HALVINGS):
                for name, value in zip(self._z1, z - fraction * δ, strict=True):
                    at[name][:] = np.where(done, at[name], value)
                falls = _largest_ratio(self._residuals(at), sizes) <= (1 - fraction / 10) * before
                if (falls | ends).all():
                    break
                fraction = np.where(falls | ends, fraction, fraction / 2)
            done = ends
            if done.all():
                return
        for name in self._z1:
            at[name][~done] = np.nan

    def _end_tangents(self) -> Array:
        """Return :attr:`end_tangents` of the latest response."""
        state = self.at, self.r, self.D, self.excess, self._search
        self.at, self._search = {name: x.copy() for name, x in self.at.items()}, Search()
        self.at["theta"][:] = 1.0
        self.return_map(self.strains, self.at["dt"][0, 0])
        D = self.D
        self.at, self.r, self.D, self.excess, self._search = state
        return np.where(
            np.isfinite(D).all(axis=(1, 2), keepdims=True), D, self.D / self._scheme.theta
        )

    @np.errstate(all="ignore")
    def elastic_tangent(self) -> Array:
        """Return derivatives of (N, V, M) at constant variables in the state; (cells, 3, 3)."""
        at = {
            **self.at,
            **{name: self.at[before] for name, before in zip(self._e, self._e0, strict=True)},
        }
        at["theta"] = np.ones_like(at["theta"])

        return self._section_tangents(jacobian(self._equations.elastic_stress, at, self._e)[1], 1.0)

    def _section_tangents(self, slope: Array, θ: float) -> Array:
        """Return derivatives of (N, V, M) from derivatives of stresses, (d, d, cells, n)."""
        w, rest = self._section_points.weights, self._section_points.rest
        D = np.einsum("n,abcn,nak,nbl->ckl", w, slope, self._B, self._B)
        return np.asarray(D + θ * np.diag(rest))

    def elastic(self) -> Array:
        """Return elastic stiffnesses of the sections; (cells, 3); N, N, N m²."""
        w, C = self._section_points.weights, np.array([self.at[name] for name in self._C])
        return np.asarray(self._section_points.rest + np.einsum("n,acn,nak->ck", w, C, self._B**2))

    # -- discontinuities -------------------------------------------------------------------------

    def _growth(self, stress: Array, opens: Array) -> Array:
        """Return the growth at which bulk stress equals resistance, by Newton steps in bounds."""
        at, length = self.at, self.at["length"]

        def excess(a: Array) -> tuple[Array, Array]:
            """Return bulk stress minus resistance of the discontinuity, and its derivative."""
            borne, tangent = self._bulk({**at, "growth": a})
            resists, softens = derivative(partial(self._equations.resistance, at), a)
            over = at["direction"] * borne[0] - resists  # P(32)
            return over, -tangent[0, 0] / length - softens

        # After this growth, an elastic bulk has no stress.
        bound = np.abs(stress) / at["stiffness"] * length / at["theta"]
        bound += np.finfo(float).tiny
        digits = np.maximum(np.abs(at["before"]), np.abs(at["strain"])) * length
        digits = 4 * EPS * (bound + digits + np.abs(at["jump"]))
        roots, last = np.full_like(stress, np.nan), np.full_like(stress, np.inf)
        low, high = np.zeros_like(stress), np.full_like(stress, np.inf)
        over, slope = excess(low)
        # No growth of points that are closed, or above the limit only by round-off
        none = np.logical_not(np.logical_and(opens, over > 0))
        a = np.where(slope < 0, np.fmin(bound, -over / slope), bound)
        for _ in range(2 * CORRECTIONS):
            before, (over, slope) = over, excess(a)
            low, high = np.where(over > 0, a, low), np.where(over > 0, high, a)
            better = a - over / slope
            step = np.abs(better - a)
            # After a relative step of 1e-9, the next one is about 1e-18, below round-off.
            ends = np.isnan(roots) & ((step <= 1e-9 * a) | (step <= digits))
            roots = np.where(ends, np.where(better > 0, better, a), roots)
            if (none | ~np.isnan(roots)).all():
                break
            halved = np.where(np.isfinite(high), (low + high) / 2, 2 * a)
            wanders = ((before > 0) != (over > 0)) & (step > last / 2) & np.isfinite(high)
            within, last = (better > low) & (better < high) & ~wanders, step
            a = np.where(within, better, halved)
        return np.where(none, 0.0, roots)

    # -- the end of a step -----------------------------------------------------------------------

    @np.errstate(all="ignore")
    def require_dissipation(self, names: Sequence[str]) -> None:
        """Raise :class:`StepFailed` if a law generates energy; ``names`` are names of cells."""
        if not self._law.must_dissipate:
            return

        _, slopes = jacobian(lambda at: [self._equations.stored(at)], self.at, self._z1)
        own, size = self._equations.own_dissipation(self.at, tuple(slopes[0]))
        ratio = np.nan_to_num(own / size)
        worst = int(np.argmin(ratio))
        if ratio.flat[worst] < -NO_ENERGY:
            raise StepFailed(
                f"{type(self._law).__name__} of {names[worst // ratio.shape[1]]} has a negative "
                "dissipation in the step: its equations have several solutions, or it stores "
                "energy that it does not state. A law that is to give energy has active = True, "
                "see docs/extending_laws.md"
            )

    @np.errstate(all="ignore")
    def change(self) -> float:
        """Return the energy that is stored and dissipated in the step of the latest response; J.

        Work of relaxing viscous stresses is integrated by the trapezoidal rule.
        """
        end = self._equations.end(self.at)
        bulk = end.worked + end.elastic + end.hardening + end.nonlinear_loss + end.relaxed
        change = np.sum(self._volume * bulk) + np.sum(self._section_points.weights * end.broken)
        return float(change + self._rest_energy(self.strains)) - sum(self.stored.values())

    def _rest_energy(self, strains: Array) -> float:
        """Return the elastic energy of resultants without material points; J."""
        return float(np.sum(strains**2 @ self._section_points.rest / 2 * self.at["length"][:, 0]))

    @np.errstate(over="ignore")
    def accept(self) -> None:
        """Accept the latest response, and enter its dissipation in the ledger."""
        at, α = self.at, self._scheme.alpha
        if self.keeps_tangents:
            self.end_tangents = self._end_tangents()
        end = self._equations.end(at)
        plastic = np.sum(self._volume * end.worked, axis=1)
        broken = np.sum(self._section_points.weights * (end.broken + 0 * at["length"]), axis=1)
        self.recorded[:, 4:] += np.column_stack([plastic, broken])
        numerical = 2 * α * self._rest_energy(self.strains - self.strains0)
        numerical += np.sum(self._volume * (2 * α * end.lost + end.nonlinear_loss))
        for name, grown in zip(self._z, end.changes, strict=True):
            at[name] += grown
        at["jump"] += at["direction"] * at["growth"]
        at["opening"] += at["growth"]
        at["flows"][:] = np.where(at["growth"] > 0, FLOWING, CLOSED)
        at["growth"][:] = at["direction"][:] = 0.0
        # Broken points bear no stress; their elastic strain becomes part of the jump.
        breaks = np.isfinite(at["traction"])
        at["traction"][breaks] = (end.resistance + 0 * at["length"])[breaks]
        separated = at["traction"] == 0
        for relieved, name in zip(end.stress, self._C, strict=True):
            at["jump"] += np.where(separated, relieved / at[name] * at["length"], 0.0)
        numerical += np.sum(np.where(separated, self._volume * (end.elastic - end.left), 0.0))
        lost = {"plastic": plastic.sum(), "hinges": broken.sum(), "numerical": numerical}
        for entry in self._lost:
            self._ledger.lost[entry] += float(lost[entry])
        self._update_accepted(self.strains)

    def start(self, strains: Array) -> None:
        """Compute the accepted state at strains of the cells, (cells, 3)."""
        softening, breaking = self._section_points.softening, self._section_points.breaking
        if softening is not None:
            self.at["traction"][:, breaking] = softening.traction(self.at["opening"][:, breaking])
        self._update_accepted(strains.copy())

    def _update_accepted(self, strains: Array) -> None:
        """Compute forces and stored energies of the accepted state from variables and strains."""
        at, w = self.at, self._section_points.weights
        self.strains0, point_strains = strains, self._at_points(strains)
        for name, values in zip(self._e0, point_strains, strict=True):
            at[name][:] = values
        law, z = self._equations.law(at), self._equations.state(at)
        e = law.as_argument(tuple(point_strains - at["jump"] / at["length"]))
        stress = self._array(law.as_tuple(law.stress(e, z))) * (at["traction"] != 0)
        self.recorded[:, :3] = self._section_points.rest * strains
        self.recorded[:, :3] += np.einsum("n,acn,nak->ck", w, stress, self._B)
        self.recorded[:, 3] = at["jump"][:, -1]
        energies = law.elastic_energy(e, z), law.hardening_energy(z)
        elastic, hardening = (float(np.sum(self._volume * x)) for x in energies)
        by_entry = {"stored": elastic + self._rest_energy(strains), "hardening": hardening}
        self.stored = {entry: by_entry[entry] for entry in self.stored}

    def state(self, values: Array | None = None) -> Array:
        """Return the accepted internal variables, (cells, k); ``values`` replace them if given.

        :meth:`start` then computes forces and stored energies.
        """
        if values is not None:
            n = self.at["length"].shape[1]
            for i, name in enumerate(self._variables):
                self.at[name][:] = values[:, i * n : (i + 1) * n]
            self.recorded = values[:, -11:-5].copy()
        stored = np.zeros((len(self.recorded), 2))
        # The first row has the energies of all cells, as only the sum over the rows is used.
        stored[:1] = self.stored["stored"], self.stored.get("hardening", 0.0)
        variables = [self.at[name] for name in self._variables]
        return np.asarray(np.hstack([*variables, self.recorded, self.strains0, stored]))


def _largest_ratio(residuals: Array, sizes: Array) -> Array:
    """Return the largest ratio of a residual of a law to its size; infinite instead of NaN."""
    ratio = np.where(residuals == 0, 0.0, np.abs(residuals) / sizes)
    return np.asarray(np.nan_to_num(ratio, nan=np.inf, posinf=np.inf).max(axis=0))
