# SPDX-License-Identifier: MIT
"""Types of arrays, and the states of a scene as solutions keep them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
"""Real numbers."""

Complex: TypeAlias = npt.NDArray[np.complex128]
"""Complex numbers."""

Index: TypeAlias = npt.NDArray[Any]
"""Integers that number something."""

State: TypeAlias = dict[str, Array]
"""Arrays of a state, by name."""


def on_demand() -> Any:
    """Attribute that is an array; set to a function, it becomes its result once it is asked for."""
    return _OnDemand()


class _OnDemand:
    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"_{name}"

    def __get__(self, of: object, owner: type) -> Array:
        value = vars(of)[self._name]
        if callable(value):
            value = vars(of)[self._name] = value()
        array: Array = value
        return array

    def __set__(self, of: object, value: Array | Callable[[], Array]) -> None:
        vars(of)[self._name] = value


class Snapshot(NamedTuple):
    """State of a scene at one time, the same on every process."""

    t: float  # time, s; or the load factor of a path
    q: Array  # configuration, all degrees of freedom in the order of the grid
    v: Array | None  # velocities, as q; None in statics
    reactions: Array  # forces of the supports on the scene; (num_supports, 3); N, N, N m
    entries: tuple[dict[str, float], ...]  # the ledger: state, supplied, lost; J
    material: Array  # numbers of the cells that can yield or break, and their material; (m, 7)
    connections: Array  # columns of ``Connection`` for all links; (num_links, 5)
    cells: Array  # ``cell_number`` of loops.h of all cells, (9, num_cells), or a record, (k,)
    before: Array | None  # q at the beginning of the step, if forces depend on it


class Snapshots(NamedTuple):
    """States at successive times: arrays as those of :class:`Snapshot`, behind an axis of times."""

    t: Array
    q: Array
    v: Array | None
    reactions: Array
    entries: tuple[dict[str, Array], ...]
    material: Array
    connections: Array
    cells: Array
    before: Array | None

    @classmethod
    def of(cls, one: Snapshot) -> Snapshots:
        """Make them of a single state."""
        return cls(
            np.array([one.t]), one.q[None], None if one.v is None else one.v[None],
            one.reactions[None],
            tuple({name: np.array([x]) for name, x in part.items()} for part in one.entries),
            one.material[None], one.connections[None], one.cells[None],
            None if one.before is None else one.before[None],
        )  # fmt: skip

    def one(self, n: int) -> Snapshot:
        """Return the n-th of the states."""
        return Snapshot(*self._each(lambda x: x[n]))

    def view(self, n: slice) -> Snapshots:
        """Views of some of the states."""
        return Snapshots(*self._each(lambda x: x[n]))

    def some(self, n: slice) -> Snapshots:
        """Copies of some of the states."""
        return Snapshots(*self._each(lambda x: x[n].copy()))

    def _each(self, of: Callable[[Array], Any]) -> Iterator[Any]:
        """Fields made of all arrays alike."""
        for field in self:
            if isinstance(field, tuple):
                yield tuple({name: of(x) for name, x in part.items()} for part in field)
            else:
                yield None if field is None else of(field)


class Later(NamedTuple):
    """States that are made of what was kept of them once somebody asks."""

    t: Array
    make: Callable[[], Snapshots]


class Blocks:
    """An array in blocks, one below the other; indices select from all of it what is asked for."""

    def __init__(self, blocks: Sequence[Array]) -> None:
        self._blocks = blocks

    def __len__(self) -> int:
        return sum(map(len, self._blocks))

    @property
    def last(self) -> Array:
        """The last row of the last block."""
        last: Array = self._blocks[-1][-1]
        return last

    def __iter__(self) -> Iterator[Array]:
        return chain.from_iterable(self._blocks)

    def __getitem__(self, at: tuple[Any, ...]) -> Array:
        """A new array; the first index is ``:``."""
        chosen = [block[at] for block in self._blocks]
        return np.concatenate(chosen) if chosen else np.empty(0)
