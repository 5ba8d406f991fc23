# SPDX-License-Identifier: MIT
"""The state of a simulation in numbers of the grid: the same on any number of processes.

Whatever remembers something from one step to the next states in one method, ``remember``, what that
is; the same statement writes it down and takes it back.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.arrays import State as State
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import SceneError

NOWHERE: Array = np.empty(0)
"""In the place of a configuration: of what is remembered, strains and stored energies are not that
of the scene."""


class Memory(ABC):
    """Takes what a process remembers and gives back what it is to remember."""

    def __init__(self, share: Share) -> None:
        self._share = share
        self._one = (1, np.zeros(1, dtype=int), int(share.comm.rank == 0))
        self._dofs = (share.grid.size, share.dofs, share.num_owned)

    def number(self, name: str, value: float) -> float:
        """A number that all processes know."""
        return float(self._values(name, np.array([value]), *self._one)[0])

    def total(self, name: str, value: float) -> float:
        """A number whose sum over the processes means something."""
        return float(self._values(name, np.array([value]), *self._one, summed=True)[0])

    def at_dofs(self, name: str, values: Array) -> Array:
        """Values at the local degrees of freedom, alike on all processes that have them."""
        return self._values(name, values, *self._dofs)

    def added(self, name: str, values: Array) -> Array:
        """Values at the local degrees of freedom whose sums over the processes mean something."""
        return self._values(name, values, *self._dofs, summed=True)

    def known_rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Rows of numbered things that all processes know."""
        return self.rows(name, numbers, rows)

    @abstractmethod
    def rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Rows of numbered things, each on one process only; of any lengths under one name."""

    @abstractmethod
    def _values(
        self, name: str, values: Array, size: int, where: Index, owned: int, *, summed: bool = False
    ) -> Array:
        """Values at some places of ``size``, of which the first ``owned`` are of this process.

        They are alike on all processes that have a place, or addends where they are ``summed``.
        """


class Saving(Memory):
    """A memory that writes down; :meth:`state` is what came together."""

    def __init__(self, share: Share) -> None:
        super().__init__(share)
        self._sums: dict[str, tuple[int, Index, Array]] = {}
        self._rows: defaultdict[str, list[Array]] = defaultdict(list)

    def _values(
        self, name: str, values: Array, size: int, where: Index, owned: int, *, summed: bool = False
    ) -> Array:
        mine = len(values) if summed else owned
        self._sums[name] = size, where[:mine], values[:mine].copy()
        return values

    def rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Save numbered rows of a table."""
        self._rows[f"{name}, {rows.shape[1]}"].append(np.column_stack([numbers, rows]))
        return rows

    def known_rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Save rows that all processes know, once."""
        return self.rows(name, numbers, rows) if self._share.comm.rank == 0 else rows

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


class Restoring(Memory):
    """A memory that gives back a state; rows that the state does not have stay as they are."""

    def __init__(self, share: Share, state: State) -> None:
        super().__init__(share)
        self._state = state

    def has(self, name: str) -> bool:
        """Return true if the state has numbers of this name."""
        return name in self._state

    def _values(
        self, name: str, values: Array, size: int, where: Index, owned: int, *, summed: bool = False
    ) -> Array:
        here = self._found(name, (size,))[where]
        if summed:
            here[owned:] = 0.0  # the owner has all of it
        return np.asarray(here)

    def rows(self, name: str, numbers: Index, rows: Array) -> Array:
        """Return the saved rows of these numbers."""
        columns = rows.shape[1]
        if f"{name}, {columns}" not in self._state:
            return rows
        table = self._found(f"{name}, {columns}", (-1, columns + 1))
        found = np.minimum(np.searchsorted(table[:, 0], numbers), len(table) - 1)
        known = table[found, 0] == numbers
        return np.where(known[:, None], table[found, 1:], rows)

    def _found(self, name: str, shape: tuple[int, ...]) -> Array:
        """Return an array of the state; :class:`SceneError` if it has not the shape; -1 is any."""
        values = self._state.get(name)
        if values is None or len(values.shape) != len(shape) or shape[-1] != values.shape[-1]:
            found = "missing" if values is None else f"of shape {values.shape}"
            raise SceneError(f"the array {name!r} of the state is {found}, and must be {shape}")
        return values
