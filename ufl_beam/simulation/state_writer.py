# SPDX-License-Identifier: MIT
"""Rows of a running simulation, which C writes; their columns are those of ``state_rows.py``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib
from ufl_beam.discretization.partition import Share
from ufl_beam.output.state_rows import FORCE, LEDGER, RECORD, Columns, Connection
from ufl_beam.terms.beams import InelasticBeams
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.connectors import Links
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inertia_and_damping import V
from ufl_beam.terms.supports import Supports


class StateWriter:
    """Writes rows of the state that C has, of the whole scene.

    Each process states which of its numbers are added to which places of the row; then the rows of
    all processes are added.

    Attributes:
        columns: Of a row; with the record of the forces of cells if one process has all of them.
    """

    def __init__(
        self, march: Any, share: Share, ledger: Ledger, supports: Supports,
        inelastic: Sequence[InelasticBeams], couplings: Sequence[Links], cell_forces: CellForces,
    ) -> None:  # fmt: skip
        self._march, self._share = march, share
        self._alive, self._kinds = list[Any](), list[Any]()
        grid, moving = share.grid, march.rates != ffi.NULL
        accounts = ledger.state, ledger.supplied, ledger.lost
        cells = [of for _, of in grid.inelastic]
        all_cells = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *cells]))
        record = cell_forces.kept if share.alone else []
        self.columns = columns = Columns.of(
            grid, moving=moving, cells=len(all_cells), record=sum(n for _, n in record),
            ledger=[f"{p}: {name}" for p, of in zip(LEDGER, accounts, strict=True) for name in of],
        )  # fmt: skip
        at = columns.at
        if share.comm.rank == 0:
            self._copy(self._place_of(ffi.addressof(march, "t")), at["t"].start, 1)
        now = ffi.addressof(march, "q")
        vectors = {"q": now}
        if moving:
            vectors["v"] = ffi.addressof(march.rates, "rate", V)
        for name, place in vectors.items():
            if share.alone:
                self._copy(place, at[name].start, share.size)
            else:
                own = np.arange(share.num_owned)
                self._add(place, own, at[name].start + share.dofs[own])
        for part, account in zip(LEDGER, accounts, strict=True):
            if account:
                first = at[f"{part}: {next(iter(account))}"].start
                self._copy(self._place(account.numbers), first, len(account))
        held = [  # of supports, those that this process owns, and their numbers in the row
            (dof, at["reactions"].start + 3 * k + c)
            for k, support in enumerate(grid.scene.supports)
            for c, dof in ((c, share.at(support.place)[c]) for c in support.held)
            if share.owns(np.array([dof]))[0]
        ]  # fmt: skip
        dofs, to = np.array(held, dtype=np.int64).reshape(-1, 2).T
        mine = np.searchsorted(supports.dofs, share.local(dofs))
        self._add(self._place(supports.reactions), mine, to)
        for one in inelastic:
            mine, k = one.kept()[0], np.flatnonzero(one.kept_factors)
            width = columns.shapes["material"][1]
            rows = at["material"].start + width * np.searchsorted(all_cells, mine)
            first = width * np.arange(len(mine))
            self._add(self._place(one.points.kept), first[:, None] + k, rows[:, None] + k)
        for link in couplings:
            rows = at["connectors"].start + columns.shapes["connectors"][1] * link.numbers
            self._add(now, link.forces_at, rows + FORCE)
            for field, numbers in link.kept:
                apart = numbers.strides[0] // numbers.itemsize * np.arange(len(rows))
                self._add(self._place(numbers), apart, rows + Connection._fields.index(field))
        first = at[RECORD].start
        for place, number in record:
            self._copy(place, first, number)
            first += number
        # Large vectors are written once; what is added to begins at zero.
        width = columns.width
        sums, after = (at["reactions"].start, at["material"].stop) if share.alone else (0, width)
        kept = ffi.new("kept_numbers[]", self._kinds)
        fill(march, kinds=len(kept), kept=kept, width=width, sums=sums, after_sums=after)

    def _place(self, numbers: Array) -> Any:
        """A place that has the address of an array, or of the first number of a view."""
        self._alive.append(numbers)
        return self._place_of(ffi.cast("double *", numbers.ctypes.data))

    def _place_of(self, address: Any) -> Any:
        self._alive.append(place := ffi.new("double *[1]", [address]))
        return place

    def _copy(self, place: Any, first: int, number: int) -> None:
        """Write numbers that stay one after the other."""
        self._kinds.append((place, number, first, ffi.NULL, ffi.NULL))

    def _add(self, place: Any, at: Index, to: Index) -> None:
        """Add numbers at some places to other places of the row."""
        both = [np.ascontiguousarray(x.ravel(), dtype=np.int32) for x in (at, to)]
        self._alive.append(both)
        self._kinds.append((place, at.size, 0, *map(integers, both)))

    def write(self, row: Array) -> None:
        """Write the state that C has; all processes call it together."""
        lib.keep_state(self._march, doubles(row))
        if not self._share.alone:
            self._share.comm.Allreduce(MPI.IN_PLACE, row)
