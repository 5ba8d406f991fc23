# SPDX-License-Identifier: MIT
"""Saved state of a simulation, which does not depend on the number of processes.

An object with data that later steps need has a method ``save_or_restore``.  The same calls of an
:class:`Archive` in this method save the data, or restore them.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.arrays import State as State
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.errors import ModelError

NOWHERE: Array = np.empty(0)
"""Argument of ``save_or_restore`` instead of a configuration while a state is restored: restored
strains and energies do not belong to the present configuration of the scene."""


class OtherVersion(ModelError):
    """Error of saved arrays that another version of the package wrote in another form."""


class Archive:
    """Storage of the state of a process, for restart and ``start=``.

    Without ``state``, methods save their arguments and return them.  With ``state``, methods return
    the saved values instead.

    Attributes:
        unknown: Table and index of each row that was to be restored and is not in the state.
    """

    def __init__(self, subdomain: Subdomain, state: State | None = None) -> None:
        self._subdomain, self._restored = subdomain, state
        self.unknown: set[tuple[str, int]] = set()
        self._sums: dict[str, tuple[int, Index, Array]] = {}
        self._rows: defaultdict[str, list[Array]] = defaultdict(list)
        self._scalar = (1, np.zeros(1, dtype=int), int(subdomain.comm.rank == 0))
        self._dofs = (subdomain.numbering.size, subdomain.dofs, subdomain.num_owned)

    @property
    def restores(self) -> bool:
        """True if methods return saved values."""
        return self._restored is not None

    def number(self, name: str, value: float) -> float:
        """Save or restore a number that is equal on all processes."""
        return float(self._values(name, np.array([value]), *self._scalar)[0])

    def total(self, name: str, value: float) -> float:
        """Save or restore a number as its sum over the processes."""
        return float(self._values(name, np.array([value]), *self._scalar, summed=True)[0])

    def at_dofs(self, name: str, values: Array) -> Array:
        """Save or restore values at the local degrees of freedom, equal on all processes."""
        return self._values(name, values, *self._dofs)

    def added(self, name: str, values: Array) -> Array:
        """Save or restore values at the local degrees of freedom as sums over the processes."""
        return self._values(name, values, *self._dofs, summed=True)

    def _values(
        self, name: str, values: Array, size: int, where: Index, owned: int, *, summed: bool = False
    ) -> Array:
        """Save or restore values at ``where`` in an array; this process owns the first ``owned``.

        Processes with the same position have equal values there, or addends if ``summed``.
        """
        if self._restored is None:
            mine = len(values) if summed else owned
            self._sums[name] = size, where[:mine], values[:mine].copy()
            return values
        result = self._array(name, (size,))[where]
        if summed:
            result[owned:] = 0.0  # the owner has the sum
        return np.asarray(result)

    def rows(self, name: str, indices: Index, rows: Array, *, known: bool = False) -> Array:
        """Save or restore rows by index; each is on one process, or if ``known`` on all processes.

        Calls with the same name may have rows of different lengths.  If the state has no row with
        an index, the present row is returned.
        """
        columns = rows.shape[1]
        key = f"{name}, {columns}"
        if self._restored is None:
            if not known or self._subdomain.comm.rank == 0:
                self._rows[key].append(np.column_stack([indices, rows]))
            return rows
        if not self.has(key):
            self.unknown |= {(name, int(index)) for index in indices}
            return rows
        table = self._array(key, (-1, columns + 1))
        positions = np.minimum(np.searchsorted(table[:, 0], indices), len(table) - 1)
        present = table[positions, 0] == indices
        self.unknown |= {(name, int(index)) for index in indices[~present]}
        return np.where(present[:, None], table[positions, 1:], rows)

    def has(self, name: str) -> bool:
        """Return whether a state is being restored and has values of this name."""
        return self._restored is not None and name in self._restored

    def _array(self, name: str, shape: tuple[int, ...]) -> Array:
        """Return an array of the state; raise unless dimensions and columns fit ``shape``."""
        values = (self._restored or {}).get(name)
        if values is None or len(values.shape) != len(shape) or shape[-1] != values.shape[-1]:
            problem = "missing" if values is None else f"of shape {values.shape}"
            raise OtherVersion(f"the array {name!r} of the state is {problem}, and must be {shape}")
        return values

    def state(self) -> State:
        """Return the saved state of all processes on each process; a collective call."""
        own = self._sums, self._rows
        everyone = [own] if self._subdomain.comm.size == 1 else self._subdomain.comm.allgather(own)
        state: State = {}
        tables: defaultdict[str, list[Array]] = defaultdict(list)
        for sums, rows in everyone:
            for name, (size, where, values) in sums.items():
                # Start from -0.0, because 0.0 + (-0.0) would lose the sign of a zero.
                np.add.at(state.setdefault(name, np.full(size, -0.0)), where, values)
            for name, arrays in rows.items():
                tables[name] += arrays
        for name, arrays in tables.items():
            table = np.concatenate(arrays)
            state[name] = table[np.argsort(table[:, 0])]
        return state
