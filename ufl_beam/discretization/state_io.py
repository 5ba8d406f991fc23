# SPDX-License-Identifier: MIT
"""The state of a simulation in numbers of the grid: the same on any number of processes.

Whatever remembers something from one step to the next states in one method, ``remember``, what that
is; the same statement writes it down and takes it back.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Protocol

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.arrays import State as State
from ufl_beam.discretization.partition import Share

NOWHERE: Array = np.empty(0)
"""In the place of a configuration: of what is remembered, strains and stored energies are not that
of the scene."""


class Memory(Protocol):
    """Takes what a process remembers and gives back what it is to remember."""

    def number(self, name: str, value: float) -> float:
        """A number that all processes know."""

    def total(self, name: str, value: float) -> float:
        """A number whose sum over the processes means something."""

    def at_dofs(self, name: str, values: Array) -> Array:
        """Values at the local degrees of freedom, alike on all processes that have them."""

    def added(self, name: str, values: Array) -> Array:
        """Values at the local degrees of freedom whose sums over the processes mean something."""

    def rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Rows of numbered things, each on one process only; of any lengths under one name."""


class Saving:
    """A memory that writes down; :meth:`state` is what came together."""

    def __init__(self, share: Share) -> None:
        self._share = share
        self._sums: dict[str, tuple[int, Index, Array]] = {}
        self._rows: defaultdict[str, list[Array]] = defaultdict(list)

    def number(self, name: str, value: float) -> float:
        """Save a number that is the same on all processes."""
        self._sum(name, 1, np.zeros(int(self._share.comm.rank == 0), dtype=int), np.array([value]))
        return value

    def total(self, name: str, value: float) -> float:
        """Save the sum of a number over all processes."""
        self._sum(name, 1, np.zeros(1, dtype=int), np.array([value]))
        return value

    def at_dofs(self, name: str, values: Array) -> Array:
        """Save values at the owned degrees of freedom."""
        share = self._share
        self._sum(name, share.grid.size, share.dofs[: share.num_owned], values)
        return values

    def added(self, name: str, values: Array) -> Array:
        """Save a number that is the same on all processes."""
        self._sum(name, self._share.grid.size, self._share.dofs, values)
        return values

    def _sum(self, name: str, size: int, where: Index, values: Array) -> None:
        self._sums[name] = size, where, values[: len(where)].copy()

    def rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Save numbered rows of a table."""
        self._rows[f"{name}, {rows.shape[1]}"].append(np.column_stack([numbers, rows]))
        return rows

    def state(self) -> State:
        """Return the state of all processes, on each of them; they call it together."""
        here = self._sums, self._rows
        everyone = [here] if self._share.comm.size == 1 else self._share.comm.allgather(here)
        state: State = {}
        tables: defaultdict[str, list[Array]] = defaultdict(list)
        for sums, rows in everyone:
            for name, (size, where, values) in sums.items():
                # From -0, to which anything may be added without losing its sign
                np.add.at(state.setdefault(name, np.full(size, -0.0)), where, values)
            for name, parts in rows.items():
                tables[name] += parts
        for name, parts in tables.items():
            table = np.concatenate(parts)
            state[name] = table[np.argsort(table[:, 0])]
        return state


class Restoring:
    """A memory that gives back a state; what that does not have stays as it is."""

    def __init__(self, share: Share, state: State) -> None:
        self._share, self._state = share, state

    def number(self, name: str, value: float) -> float:
        """Return the number that was saved."""
        return float(self._state[name][0])

    def total(self, name: str, value: float) -> float:
        """See :class:`Memory`; the first process has all of it."""
        return self.number(name, value) if self._share.comm.rank == 0 else 0.0

    def at_dofs(self, name: str, values: Array) -> Array:
        """Return the saved values at the local degrees of freedom."""
        return np.asarray(self._state[name][self._share.dofs])

    def added(self, name: str, values: Array) -> Array:
        """See :class:`Memory`; the owner of a degree of freedom has all of it."""
        values = self.at_dofs(name, values)
        values[self._share.num_owned :] = 0.0
        return values

    def rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Return the saved rows of these numbers."""
        table = self._state.get(f"{name}, {rows.shape[1]}")
        if table is None:
            return rows
        found = np.minimum(np.searchsorted(table[:, 0], numbers), len(table) - 1)
        known = table[found, 0] == numbers
        return np.where(known[:, None], table[found, 1:], rows)
