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
    """Return the values of a function with one point in each cell; (cells, components)."""
    return np.asarray(function.x.array).reshape(-1, function.function_space.dofmap.bs)


class Points:
    """Material points of all cells with one kind of section; n points in each cell.

    Args:
        section: Points of a section, with laws of one class and one component.
        cells: Cells of this process with these points.

    Attributes:
        variables: Internal variables: functions of the quadrature element with n components.
        excess: Relative excess over the limit of points that stay closed; (cells, n).
    """

    def __init__(
        self, section: SectionPoints, cells: Index, numbering: DofNumbering, fields: Fields,
        scheme: Scheme,
    ) -> None:  # fmt: skip
        self.section, self.cells, self.fields, self.θ = section, cells, fields, scheme.theta
        self.equations = PointEquations(section.kind, section.softening, scheme)
        n, law, softening = len(section.weights), section.kind.law, section.softening
        self.B = np.reshape(
            section.strains, (n, 3)
        )  # from strains of the axis to strains at points
        in_scene, self.length = fields.cells[cells], fields.h[cells, None]
        self.rows, keys = in_scene + section.number * len(numbering.cells), numbering.keys(in_scene)
        numbers = (
            section.parameters(keys) if len(cells) else dict.fromkeys(section.kind.parameters, 0.0)
        )
        of_hinge = softening.parameters() if softening else {}
        given = {"stiffness": section.stiffness, "length": self.length, "theta": self.θ}
        given |= {f"number {name}": x for name, x in numbers.items()}
        given |= {f"softening {name}": x for name, x in of_hinge.items()}
        self.shape = len(cells), n
        self.given = {name: np.broadcast_to(x, self.shape) for name, x in given.items()}
        limit = np.full(n, np.inf)
        if softening:
            limit[section.breaking] = softening.limit
        self.names = [f"state {name}" for name in law.variables]
        self.columns = [*self.names, "jump", "opening", "strain", "traction", "flows"]
        start: dict[str, Any] = dict(zip(self.names, law.variables.values(), strict=True))
        start |= {"jump": 0.0, "opening": 0.0, "traction": limit, "flows": 0.0}
        self.variables = {name: fields.at_points((n,)) for name in start}
        self._set(start)

    def _set(self, values: Mapping[str, Any]) -> None:
        for name, x in values.items():
            by_cell(self.variables[name])[self.cells] = x

    def _old(self) -> dict[str, Array]:
        old = {name: by_cell(f)[self.cells] for name, f in self.variables.items()}
        return {**self.given, **old}

    # -- a step ----------------------------------------------------------------------------------

    def begin(self, dt: float, *, hold: bool) -> None:
        """Begin a step; with ``hold``, points that did not flow open only if released.

        docs/steps.md states the rule by which points open.
        """
        self.at: dict[str, Any] = {**self._old(), "before": self.e0 @ self.B.T}
        self.at["dt"] = np.full_like(self.at["before"], dt)
        self.may_open = (self.at["flows"] > 0) | (self.at["traction"] == 0) | (not hold)

    @np.errstate(all="ignore")
    def return_map(self, strains: Array, *, stiff: bool) -> None:
        """Set jumps, plastic strains and moduli of cells, from the strains at the end of the step.

        With ``stiff``, points that do not open have their elastic tangent.
        """
        at, θ, w, B, fields = self.at, self.θ, self.section.weights, self.B, self.fields
        growth, direction = np.zeros((2, *self.may_open.shape))
        self.e1: Array = strains[self.cells]
        at |= {"strain": self.e1 @ B.T, "growth": growth, "direction": direction}
        stress, D = slope(self._stress, at, "strain")
        over = np.abs(stress) > at["traction"]  # P(51)
        opens = over & self.may_open
        self.excess = np.where(over & ~opens, np.abs(stress) / at["traction"] - 1, 0.0)
        D = θ * at["stiffness"] if stiff else D
        if opens.any():
            part = {name: x[opens] for name, x in at.items()}
            stress[opens], D[opens] = self._open(part, stress[opens])
            growth[opens], direction[opens] = part["growth"], part["direction"]
        e = (1 - θ) * self.e0 + θ * self.e1
        r = self.section.rest * e + (w * stress) @ B
        jump0 = self.section.hinges * at["jump"][:, -1:]
        jump1 = jump0 + self.section.hinges * (direction * growth)[:, -1:]
        e[:, 2:] += strain_by_jump((1 - θ) * jump0 + θ * jump1, self.length)
        moduli = np.einsum("cn,na,nb->cab", w * D, B, B) + θ * np.diag(self.section.rest)
        by_cell(fields.jump0)[self.cells], by_cell(fields.jump1)[self.cells] = jump0, jump1
        by_cell(fields.plastic)[self.cells] = e - r / by_cell(fields.stiffness)[self.cells]
        by_cell(fields.moduli)[self.cells] = moduli.reshape(-1, 9)

    def _stress(self, at: At) -> Values:
        """Return the stress of the bulk."""
        return self.equations.stress(at)[0]

    def _resistance(self, at: At) -> Values:
        """Return the stress that the discontinuity bears."""
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

    # -- accepted states -------------------------------------------------------------------------

    @np.errstate(all="ignore")
    def accept(self) -> None:
        """Accept the internal variables of the latest return map."""
        end = self.equations.end(self.at)
        new = {"traction": end.traction, "jump": end.jump, "opening": end.opening}
        new |= dict(zip(self.names, end.variables, strict=True))
        self._set(new | {"flows": self.at["growth"] > 0})
        self.e0 = self.e1

    def start(self, strains: Array, internal: State) -> None:
        """Begin at strains of all cells, with the internal variables of a :class:`Simulation`."""
        self.e0, first = strains[self.cells], self.rows[:1]
        tables = (table for name, table in internal.items() if name.startswith("cells, "))
        for table in (x for x in tables if np.isin(first, x[:, 0]).any()):
            values = table[np.searchsorted(table[:, 0], self.rows), 1:]
            n = self.shape[1]
            columns = {name: values[:, k * n : k * n + n] for k, name in enumerate(self.columns)}
            self._set({name: columns[name] for name in self.variables})
