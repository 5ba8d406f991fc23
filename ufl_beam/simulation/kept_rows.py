# SPDX-License-Identifier: MIT
"""States that C keeps of steps without Python: a row of numbers each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, pairwise, repeat
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index, Snapshot
from ufl_beam.compiled.c_library import doubles, ffi
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.rates_in_c import V
from ufl_beam.terms.supports import Supports

CONNECTION = 5
"""Numbers of a connector in a state."""


class KeptRows:
    """Rows of a scene without connectors: what they consist of, and the states that they are.

    Attributes:
        width: Numbers of a row.
        kinds: List of ``kept_numbers`` of loops.h.
    """

    def __init__(
        self, march: Any, ledger: Ledger, supports: Supports, inelastic: Sequence[Any],
        support_dofs: Index,
    ) -> None:  # fmt: skip
        self._names = [list(part) for part in (ledger.state, ledger.supplied, ledger.lost)]
        moving = march.rates != ffi.NULL
        now = [ffi.addressof(march, "q")]
        now += [ffi.addressof(march.rates, "rate", V)] if moving else []
        parts = (ledger.state, ledger.supplied, ledger.lost)
        fixed = [part.numbers[: len(part)] for part in parts]
        fixed += [supports.reactions, *(one.points.kept.reshape(-1) for one in inelastic)]
        self._places = [ffi.new("double *[1]", [doubles(x)]) for x in fixed]
        sizes = [march.size] * len(now) + [x.size for x in fixed]
        self.kinds = ffi.new("kept_numbers[]", list(zip([*now, *self._places], sizes, strict=True)))
        ends = list(accumulate([1, *sizes]))
        self.width, (self._q, *columns) = ends[-1], (slice(*pair) for pair in pairwise(ends))
        self._v = columns.pop(0) if moving else None
        self._entries, self._reactions, self._material = columns[:3], columns[3], columns[4:]
        # Components of supports that are not held have the column after the last one.
        dofs, held = support_dofs, np.append(supports.dofs, -1)
        at = np.searchsorted(held[:-1], dofs)
        self._held = np.where(held[at] == dofs, at, len(held) - 1)
        factors = [one.kept_factors for one in inelastic]
        cells = [one.kept()[0] for one in inelastic]
        self._factors = np.concatenate(
            [np.tile(f, (len(c), 1)) for f, c in zip(factors, cells, strict=True)]
            or [np.zeros((0, 6))]
        )
        numbers = np.concatenate([*cells, np.zeros(0, dtype=np.int64)])
        self._order = np.argsort(numbers)
        self._cells = numbers[self._order]

    def states(self, times: Array, rows: Array, parts: int, iterations: int) -> Iterator[Snapshot]:
        """The states at the ends of steps, before which so many parts and iterations were done."""
        v = repeat(None) if self._v is None else rows[:, self._v]
        count = range(parts + 1, parts + 1 + len(rows))
        done: Any = (rows[:, 0].astype(np.int64) + iterations).tolist()
        at: Any = times.tolist()
        connections = repeat(np.zeros((0, CONNECTION)))
        return map(
            Snapshot, at, rows[:, self._q], v, self._of_supports(rows), self._of_ledger(rows),
            self._of_material(rows), connections, count, done,
        )  # fmt: skip

    def _of_ledger(self, rows: Array) -> Iterator[tuple[dict[str, float], ...]]:
        parts = zip(*(rows[:, at].tolist() for at in self._entries), strict=True)
        for state in parts:
            yield tuple(
                dict(zip(*part, strict=True)) for part in zip(self._names, state, strict=True)
            )

    def _of_supports(self, rows: Array) -> Iterable[Array]:
        """Forces of all supports; (num_rows, num_supports, 3)."""
        if not self._held.size:
            return repeat(np.zeros((0, 3)))
        padded: Array = np.hstack([rows[:, self._reactions], np.zeros((len(rows), 1))])
        forces: Iterable[Array] = padded[:, self._held]
        return forces

    def _of_material(self, rows: Array) -> Iterable[Array]:
        """Numbers of cells and rows of their material; (num_rows, m, 7)."""
        if not len(self._cells):
            return repeat(np.zeros((0, 7)))
        n = len(rows)
        kept = np.hstack([rows[:, at].reshape(n, -1) for at in self._material])
        kept = (kept.reshape(n, -1, 6) * self._factors)[:, self._order]
        cells = np.broadcast_to(self._cells[:, None], (n, len(self._cells), 1))
        table: Iterable[Array] = np.concatenate([cells, kept], axis=2)
        return table
