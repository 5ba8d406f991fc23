# SPDX-License-Identifier: MIT
"""States that C keeps of steps without Python: a row of numbers each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import Any, Protocol

import numpy as np

from ufl_beam.arrays import Array, Index, Snapshots
from ufl_beam.compiled.c_library import ffi, integers
from ufl_beam.model.supports import Support
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.links import CONNECTION, FORCE, Links
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.rates_in_c import V
from ufl_beam.terms.supports import Supports

MATERIAL = 7
"""Numbers of a cell in a state: its number, and :attr:`Points.kept`."""


class Inelastic(Protocol):
    """Cells with material points; see :class:`InelasticBeams`."""

    @property
    def points(self) -> Points:
        """The points, with what solutions keep of them."""

    @property
    def kept_factors(self) -> Array:
        """Factors of these numbers; (6,)."""

    def kept(self) -> tuple[Index, Array]:
        """Return numbers of the cells, and what is kept of them."""


class KeptRows:
    """Rows of a scene: vectors and the ledger, then the tables of a state, row by row.

    ``cell_forces`` are :attr:`CellForces.kept`, and ``q`` is the accepted configuration.

    Attributes:
        q: Columns of the configuration.
        width: Numbers of a row.
        kinds: List of ``kept_numbers`` of loops.h.
    """

    def __init__(
        self, march: Any, ledger: Ledger, supports: Supports, scene_supports: Sequence[Support],
        support_dofs: Index,
        inelastic: Sequence[Inelastic], couplings: Sequence[Links], num_links: int,
        cell_forces: Sequence[tuple[Any, int]], q: Array,
    ) -> None:  # fmt: skip
        self._alive, self._kinds = list[Any](), list[Any]()
        moving = march.rates != ffi.NULL
        accounts = ledger.state, ledger.supplied, ledger.lost
        self._names = [list(account) for account in accounts]
        self._num_supports = len(support_dofs)
        angles = [support.angle for support in scene_supports]
        self._turned = [(i, (math.cos(a), math.sin(a))) for i, a in enumerate(angles) if a]
        kept = [one.kept()[0] for one in inelastic]
        cells = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *kept]))
        sizes = [
            march.size, march.size * moving, *map(len, accounts), support_dofs.size,
            MATERIAL * len(cells), CONNECTION * num_links, sum(n for _, n in cell_forces),
        ]  # fmt: skip
        ends = list(accumulate([0, *sizes]))
        self.width, columns = ends[-1], [slice(*pair) for pair in pairwise(ends)]
        self.q, v, *self._entries, self._reactions, self._material = columns[:-2]
        self._connections, self._cells = columns[-2:]
        self._v = v if moving else None

        now = ffi.addressof(march, "q")
        self._copy(now, self.q)
        if moving:
            self._copy(ffi.addressof(march.rates, "rate", V), v)
        for account, entries in zip(accounts, self._entries, strict=True):
            self._copy(self._place(account.numbers), entries)
        dofs = support_dofs.ravel()
        places = np.flatnonzero(np.isin(dofs, supports.dofs))  # others are not held
        held = np.searchsorted(supports.dofs, dofs[places])
        self._add(self._place(supports.reactions), held, self._reactions.start + places)
        for one, mine in zip(inelastic, kept, strict=True):
            rows = self._material.start + MATERIAL * np.searchsorted(cells, mine)
            self._add(self._place(mine.astype(np.float64)), np.arange(len(mine)), rows)
            k, first = np.flatnonzero(one.kept_factors), (MATERIAL - 1) * np.arange(len(mine))
            self._add(self._place(one.points.kept), first[:, None] + k, rows[:, None] + 1 + k)
        for link in couplings:
            rows = self._connections.start + CONNECTION * link.numbers
            self._add(now, link.forces_at, rows + FORCE)
            for column, numbers in link.kept(q):
                apart = numbers.strides[0] // numbers.itemsize
                self._add(self._place(numbers), apart * np.arange(len(rows)), rows + column)
        at = self._cells.start
        for place, number in cell_forces:
            self._copy(place, slice(at, at := at + number))
        self.kinds = ffi.new("kept_numbers[]", self._kinds)

    def _place(self, numbers: Array) -> Any:
        """A place that has the address of an array, or of the first number of a view."""
        place = ffi.new("double *[1]", [ffi.cast("double *", numbers.ctypes.data)])
        self._alive += [numbers, place]
        return place

    def _copy(self, place: Any, to: slice) -> None:
        """Keep numbers that stay one after the other."""
        self._kinds.append((place, to.stop - to.start, to.start, ffi.NULL, ffi.NULL))

    def _add(self, place: Any, at: Index, to: Index) -> None:
        """Keep numbers at some places, added to other places of the row."""
        both = [np.ascontiguousarray(x.ravel(), dtype=np.int32) for x in (at, to)]
        self._alive.append(both)
        self._kinds.append((place, at.size, 0, *map(integers, both)))

    def states(self, times: Array, rows: Array, before: Array | None) -> Snapshots:
        """The states at these times, as views of their rows.

        ``before`` are the configurations at the beginnings of the steps, if they are asked for.
        """
        n = len(times)
        reactions = rows[:, self._reactions].reshape(n, self._num_supports, 3)
        for i, (c, s) in self._turned:
            x, y = reactions[:, i, 0].copy(), reactions[:, i, 1].copy()
            reactions[:, i, 0], reactions[:, i, 1] = c * x - s * y, s * x + c * y
        names = zip(self._names, self._entries, strict=True)
        return Snapshots(
            times, rows[:, self.q], None if self._v is None else rows[:, self._v],
            reactions,
            tuple(dict(zip(of, rows[:, at].T, strict=True)) for of, at in names),
            rows[:, self._material].reshape(n, -1, MATERIAL),
            rows[:, self._connections].reshape(n, -1, CONNECTION),
            rows[:, self._cells], before,
        )  # fmt: skip
