# SPDX-License-Identifier: MIT
"""Return map in NumPy: material points of cells, with embedded hinges; P(32), P(51), P(76)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import strain_by_jump
from ufl_beam.mechanics.point_equations import At, PointEquations
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.law_functions import Values
from ufl_beam.reference.forms import Fields

CORRECTIONS = 100
"""Largest number of Newton corrections of a jump."""


def slope(f: Callable[[At], Values], at: Mapping[str, Any], name: str) -> tuple[Array, Array]:
    """Return a function of arrays and its derivative by an input, by a complex step."""
    y = f({**at, name: at[name] + 1e-200j})
    return np.real(y).copy(), np.imag(y) * 1e200


def by_cell(function: fem.Function) -> Array:
    """Return the values of a function with one point in each cell; (cells, components).

    Such functions have the degree of freedom c in the cell c.
    """
    return np.asarray(function.x.array).reshape(-1, function.function_space.dofmap.bs)


class Points:
    """Material points of all cells with one kind of section; n points in each cell.

    Args:
        kind: Points of a section, with laws of one class and one component.
        cells: Cells of this process with these points.

    Attributes:
        rows: Numbers of the cells in ``solution.internal``.
        variables: Internal variables: functions of the quadrature element with n components.
        excess: Relative excess over the limit of points that stay closed; (cells, n).
        recorded: (N, V, M) at the end of the last step, jump, energies dissipated by plastic
            strains and by jumps; (cells, 6).
        stored: Elastic and hardening energy of each cell; (cells, 2); J.
        numerical: Numerical loss since the beginning; J.
    """

    def __init__(
        self, kind: SectionPoints, cells: Index, numbering: DofNumbering, fields: Fields,
        scheme: Scheme,
    ) -> None:  # fmt: skip
        self.kind, self.cells, self.fields = kind, cells, fields
        in_scene = fields.cells[cells]
        self.rows, keys = in_scene + kind.number * len(numbering.cells), numbering.keys(in_scene)
        self.scheme, self.θ = scheme, scheme.theta
        self.equations = PointEquations(kind.kind, kind.softening, scheme)
        n, law, softening = len(kind.weights), kind.kind.law, kind.softening
        self.B = np.reshape(kind.strains, (n, 3))
        numbers = kind.parameters(keys) if len(cells) else dict.fromkeys(kind.kind.parameters, 0.0)
        given: dict[str, Any] = {
            "stiffness": kind.stiffness, "length": fields.h[cells, None], "theta": self.θ,
            **{f"number {name}": x for name, x in numbers.items()},
            **{f"softening {name}": x for name, x in (softening.parameters() if softening else {})
               .items()},
        }  # fmt: skip
        self.given = {name: np.broadcast_to(x, (len(cells), n)) for name, x in given.items()}
        self.names = [f"state {name}" for name in law.variables]
        start: dict[str, Any] = dict(zip(self.names, law.variables.values(), strict=True))
        start |= {"jump": 0.0, "opening": 0.0, "limit": np.full(n, np.inf), "flows": 0.0}
        if softening:
            start["limit"][kind.breaking] = softening.limit
        self.variables = {name: fields.at_points((n,)) for name in start}
        self._set(self.variables, start)
        self.recorded: Array = np.zeros((len(cells), 6))
        self.numerical = 0.0

    def _set(self, functions: Mapping[str, fem.Function], values: Mapping[str, Any]) -> None:
        for name, x in values.items():
            by_cell(functions[name])[self.cells] = x

    def _old(self) -> dict[str, Array]:
        return {name: by_cell(f)[self.cells] for name, f in self.variables.items()}

    # -- a step ----------------------------------------------------------------------------------

    def begin(self, dt: float, *, hold: bool) -> None:
        """Begin a step; with ``hold``, points that did not flow open only if released.

        docs/steps.md states the rule by which points open.
        """
        old, at_points = self._old(), self.e0 @ self.B.T
        self.at: dict[str, Any] = {**self.given, **old, "before": at_points}
        self.at["dt"] = np.full_like(at_points, dt)
        self.may_open = (old["flows"] > 0) | (old["limit"] == 0) | (not hold)
        self.excess = np.zeros_like(at_points)

    @np.errstate(all="ignore")
    def return_map(self, strains: Array, *, stiff: bool) -> None:
        """Set jumps, plastic strains and D of the cells, from the strains at the end of the step.

        With ``stiff``, points that do not open have their elastic tangent.
        """
        at, θ, w, B, rest = self.at, self.θ, self.kind.weights, self.B, self.kind.rest
        growth, direction = np.zeros((2, *self.may_open.shape))
        self.e1: Array = strains[self.cells]
        at |= {"strain": self.e1 @ B.T, "growth": growth, "direction": direction}
        stress, D = slope(self._stress, at, "strain")
        over = np.abs(stress) > at["limit"]  # P(51)
        opens = over & self.may_open
        self.excess = np.where(over & ~opens, np.abs(stress) / at["limit"] - 1, 0.0)
        D = θ * at["stiffness"] if stiff else D
        if opens.any():
            part = {name: x[opens] for name, x in at.items()}
            stress[opens], D[opens] = self._open(part, stress[opens])
            growth[opens], direction[opens] = part["growth"], part["direction"]
        e = (1 - θ) * self.e0 + θ * self.e1
        r = rest * e + (w * stress) @ B
        jump0 = self.kind.hinges * at["jump"][:, -1:]
        jump1 = jump0 + self.kind.hinges * (direction * growth)[:, -1:]
        e[:, 2:] += strain_by_jump((1 - θ) * jump0 + θ * jump1, at["length"][:, :1])
        D = np.einsum("cn,na,nb->cab", w * D, B, B) + θ * np.diag(rest)
        plastic = e - r / by_cell(self.fields.stiffness)[self.cells]
        new = {"jump0": jump0, "jump1": jump1, "plastic": plastic, "D": D.reshape(-1, 9)}
        self._set(vars(self.fields), new)

    def _stress(self, at: At) -> Values:
        return self.equations.stress(at)[0]

    def _resistance(self, at: At) -> Values:
        return self.equations.resistance(at, at["growth"])

    def _open(self, at: dict[str, Any], stress: Array) -> tuple[Array, Array]:
        """Let jumps grow until bulk and hinge bear the same moment, P(32); NaN stops SNES.

        The excess over the resistance is concave in the growth, so Newton's method approaches the
        root from above; bisection takes over outside of the bounds.
        """
        at["direction"] = np.where(stress < 0, -1.0, 1.0)
        a, low, high = np.zeros_like(stress), np.zeros_like(stress), np.full_like(stress, np.inf)
        bound = np.abs(stress) / at["stiffness"] * at["length"] / at["theta"]  # elastic bulk
        for k in range(CORRECTIONS):
            at["growth"] = a
            stress, falls = slope(self._stress, at, "growth")
            t, softens = slope(self._resistance, at, "growth")
            over = at["direction"] * stress - t  # P(32)
            change = at["direction"] * falls - softens
            low, high = np.where(over > 0, a, low), np.where(over > 0, high, a)
            newton = a - over / change
            if k == 0:
                a = np.where(change < 0, np.fmin(bound, newton), bound)
                continue
            if (met := np.abs(newton - a) <= 1e-9 * a + 1e-17).all():
                break
            halved = np.where(np.isfinite(high), (low + high) / 2, 2 * a)
            a = np.where((newton > low) & (newton < high), newton, halved)
        at["growth"] = np.where(met, np.maximum(newton, 0.0), np.nan)
        stress, D = slope(self._stress, at, "strain")
        _, softens = slope(self._resistance, at, "growth")
        return stress, D * softens / (D / at["length"] + softens)  # P(76)

    def release(self, least: float) -> None:
        """Let points open whose excess is large enough."""
        self.may_open |= (self.excess > 0) & (self.excess >= least)

    # -- the end of a step -----------------------------------------------------------------------

    @np.errstate(all="ignore")
    def change(self) -> float:
        """Return the energy stored and dissipated in the step; J."""
        end, volume = self.equations.end(self.at), self.kind.weights * self.at["length"]
        bulk = end.worked + end.elastic + end.hardening + end.nonlinear_loss + end.relaxed
        total = np.sum(volume * bulk) + np.sum(self.kind.weights * (end.broken + 0 * volume))
        return float(total + self._rest(self.e1).sum() - self.stored.sum())

    @np.errstate(all="ignore")
    def accept(self) -> None:
        """Accept the internal variables of the latest return map."""
        at, end, w, α = self.at, self.equations.end(self.at), self.kind.weights, self.scheme.alpha
        volume = w * at["length"]
        self.recorded[:, 4] += np.sum(volume * end.worked, axis=1)
        self.recorded[:, 5] += np.sum(w * (end.broken + 0 * volume), axis=1)
        self.numerical += 2 * α * self._rest(self.e1 - self.e0).sum()
        self.numerical += np.sum(volume * (2 * α * end.lost + end.nonlinear_loss))
        limit = np.where(np.isfinite(at["limit"]), end.resistance, np.inf)
        # Broken points bear nothing; their elastic strain becomes a part of the jump.
        broken = limit == 0
        relieved = np.where(broken, end.stress[0] / at["stiffness"] * at["length"], 0.0)
        self.numerical += np.sum(np.where(broken, volume * (end.elastic - end.left), 0.0))
        new = {"limit": limit, "flows": at["growth"] > 0, "opening": at["opening"] + at["growth"]}
        new["jump"] = at["jump"] + at["direction"] * at["growth"] + relieved
        new |= {n: at[n] + change for n, change in zip(self.names, end.changes, strict=True)}
        self._set(self.variables, new)
        self._store(self.e1)

    def _store(self, strains: Array) -> None:
        """Compute forces and energies of the accepted state at strains of these cells."""
        self.e0 = strains
        old, kind, at_points = self._old(), self.kind, self.e0 @ self.B.T
        at = {**self.given, **old}
        law, z = self.equations.law(at), self.equations.state(at)
        e = at_points + strain_by_jump(old["jump"], at["length"])
        stress = law.as_tuple(law.stress(law.as_argument((e,)), z))[0] * (old["limit"] != 0)
        self.recorded[:, :3] = kind.rest * self.e0 + (kind.weights * stress) @ self.B
        self.recorded[:, 3] = kind.hinges * old["jump"][:, -1]
        volume, elastic = kind.weights * at["length"], law.elastic_energy(law.as_argument((e,)), z)
        hardening = law.hardening_energy(z)
        energies = (np.sum(volume * x, axis=1) for x in (elastic, hardening))
        self.stored = np.column_stack([*energies])
        self.stored[:, 0] += self._rest(self.e0)

    def _rest(self, strains: Array) -> Array:
        """Return the energy of resultants without points in each cell; J."""
        return np.asarray(strains**2 @ self.kind.rest / 2 * self.fields.h[self.cells])

    # -- beginning and restart -------------------------------------------------------------------

    def start(self, strains: Array, internal: State) -> None:
        """Begin at strains of all cells, with a table of :meth:`state` if there is one."""
        self._store(strains[self.cells])
        table, n = internal.get(f"cells, {self.state().shape[1] - 1}"), len(self.kind.weights)
        if table is not None and len(self.cells):
            values = table[np.searchsorted(table[:, 0], self.rows), 1:]
            for i, name in enumerate((*self.names, "jump", "opening", "", "limit", "flows")):
                self._set(self.variables, {name: values[:, i * n : (i + 1) * n]} if name else {})
            self.recorded = values[:, -11:-5].copy()
            self._store(values[:, -5:-2].copy())
        jumps = self.kind.hinges * self.recorded[:, 3]
        for function in (self.fields.jump0, self.fields.jump1):
            function.x.array[self.cells] = jumps

    def state(self) -> Array:
        """Return the variables as a table with a row for each cell; see ``solution.internal``."""
        old = self._old()
        columns = [*(old[name] for name in self.names), old["jump"], old["opening"]]
        columns += [self.e0 @ self.B.T, old["limit"], old["flows"], self.recorded, self.e0]
        return np.column_stack([self.rows, *columns, self.stored])
