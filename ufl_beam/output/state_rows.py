# SPDX-License-Identifier: MIT
"""A state of a scene as one row of numbers: the table of its columns, and growing arrays of rows.

C writes rows of running simulations, see :class:`StateWriter`; solutions, the view of a run
and files read them by the names of the table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.partition import Share
from ufl_beam.display import in_one_line
from ufl_beam.mechanics.time_schemes import V
from ufl_beam.terms.boundary_conditions import Supports
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.energy_ledger import Ledger

LEDGER = ("state", "supplied", "lost")
"""The parts of the ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""

FORCES, RECORD, BEFORE = "cell forces", "record", "before"
"""Columns that not all states have: ``cell_number`` of loops.h of all cells, or what these follow
from, see :attr:`CellForces.kept`; q at the beginning of the step, if it is not that of the row
before (of the same row in the first one), and if forces depend on it."""


@in_one_line
class Connection(NamedTuple):
    """History of a connector.

    Motion, force and rate of a :class:`Bushing` are of all components; (n+1, 2) or (n+1, 3).

    Attributes:
        motion: Relative motion since the undeformed scene; (n+1,); m or rad.
        force: That resisted its growth during the step that ends there; (n+1,); N or N m.
        work: That the connector has taken since the beginning: what springs store and dissipate,
            what dampers and friction dissipate, and minus what motors supply; (n+1,); J.
        rate: Mean rate of the motion in the step that ends there; (n+1,); m/s or rad/s.
        dissipated: Energy that yielding, softening and plastic hinges have dissipated, or that a
            :class:`ConnectorLaw` has lost; (n+1,); J.
    """

    motion: Any
    force: Any
    work: Any
    rate: Any
    dissipated: Any


def connection(numbers: Array) -> Connection:
    """History of the columns of k components, of which works are added; (..., k, columns)."""
    if numbers.shape[-2] == 1:
        columns = np.moveaxis(numbers[..., 0, :], -1, 0)
        return Connection(*(x if x.ndim else float(x) for x in columns))
    motion, force, work, rate, dissipated = np.moveaxis(numbers, -1, 0)
    return Connection(motion, force, work.sum(-1), rate, dissipated.sum(-1))


FORCE, WORK, DISSIPATED = map(Connection._fields.index, ("force", "work", "dissipated"))
"""Columns of "connectors" in states, which are these fields."""


PLASTIC, HINGE = 4, 5
"""Columns of "material": (N, V, M), jump, plastic, hinge; see :class:`Material`."""


class Columns:
    """Table of the numbers of a state: their names and shapes, in the order of the row.

    Attributes:
        shapes: Shapes by name; () of a single number.
        at: Places in a row, by name.
        width: Numbers of a row.
        ledger: Places of the entries of each part of the ledger, by name.
    """

    def __init__(self, shapes: Mapping[str, Sequence[int]]) -> None:
        self.shapes = {name: tuple(shape) for name, shape in shapes.items()}
        ends = [0, *accumulate(map(math.prod, self.shapes.values()))]
        self.at = dict(zip(self.shapes, (slice(*pair) for pair in pairwise(ends)), strict=True))
        self.width = ends[-1]
        self.ledger = tuple(
            {name[len(part) + 2 :]: at.start for name, at in self.at.items()
             if name.startswith(f"{part}: ")}
            for part in LEDGER
        )  # fmt: skip
        self._others: dict[tuple[str, str], Columns] = {}

    @classmethod
    def of(cls, grid: Grid, *, moving: bool, ledger: Iterable[str], record: int | None) -> Columns:
        """Table of a scene; a number of connectors is a field of :class:`Connection`.

        Args:
            grid: Its numbering.
            moving: Whether there are velocities.
            ledger: Entries, such as "lost: plastic".
            record: Numbers that forces of cells follow from; None if the forces are in the row.
        """
        size, scene = grid.size, grid.scene
        return cls({
            "t": (),  # time, s; or the load factor of a path
            "q": (size,),  # configuration, all degrees of freedom in the order of the grid
            **({"v": (size,)} if moving else {}),  # velocities
            "reactions": (len(scene.supports), 3),  # forces of supports, in their axes
            "connectors": (len(scene.links), len(Connection._fields)),
            "material": (len(grid.inelastic_cells), int(lib.POINT_KEPT)),  # `Points.kept`
            **dict.fromkeys(ledger, ()),  # J
            **({FORCES: (lib.CELL_NUMBERS, len(grid.cells))} if record is None
               else {RECORD: (record,)}),
        })  # fmt: skip

    def of_rows(self, name: str, rows: Array) -> Array:
        """A column of a row, or of some rows: a view, in its shape."""
        return rows[..., self.at[name]].reshape(rows.shape[:-1] + self.shapes[name])

    def plus(self, name: str, shape: Sequence[int], *, without: str = "") -> Columns:
        """The same table with a column more at its end, and without another one."""
        key = name, without
        if key not in self._others:
            shapes = {n: of for n, of in self.shapes.items() if n != without}
            self._others[key] = Columns({**shapes, name: shape})
        return self._others[key]


def new_rows(number: int, width: int) -> Array:
    """Rows of zeros.  NumPy asks for large pages from 4 MiB on, whose first touch takes longer."""
    return np.frombuffer(bytearray(8 * number * width)).reshape(number, width)


@dataclass
class Block:
    """Rows with the same columns, one below the other, with room for more that is never moved."""

    columns: Columns
    space: Array  # the rows, and behind them the room
    number: int  # of rows

    @property
    def rows(self) -> Array:
        """The rows; (number, width)."""
        return self.space[: self.number]


class Column:
    """A column of states in several blocks, without those that lack it; (n+1, ...)."""

    def __init__(self, blocks: Sequence[Block], name: str) -> None:
        self._name = name
        self._blocks = [b for b in blocks if b.number and name in b.columns.at]

    def __len__(self) -> int:
        return sum(block.number for block in self._blocks)

    def __getitem__(self, at: tuple[Any, ...]) -> Array:
        """A new array; the first index is ``:``."""
        parts = [block.columns.of_rows(self._name, block.rows)[at] for block in self._blocks]
        return np.concatenate(parts) if parts else np.empty(0)


# -- rows of a running simulation ------------------------------------------------------------------


class StateWriter:
    """Writes rows of the state that C has, of the whole scene.

    Each process states which of its numbers are added to which places of the row; then the rows of
    all processes are added.

    Attributes:
        columns: Of a row; with the record of the forces of cells if one process has all of them.
    """

    def __init__(
        self, march: Any, share: Share, ledger: Ledger, supports: Supports,
        inelastic: Sequence[Any], couplings: Sequence[Any], cell_forces: CellForces,
    ) -> None:  # fmt: skip
        self._march, self._share = march, share
        self._alive, self._kinds = list[Any](), list[Any]()
        grid, moving = share.grid, march.rates != ffi.NULL
        accounts = ledger.state, ledger.supplied, ledger.lost
        record = cell_forces.kept if share.alone else []
        self.columns = columns = Columns.of(
            grid, moving=moving, record=sum(n for _, n in record),
            ledger=[f"{p}: {name}" for p, of in zip(LEDGER, accounts, strict=True) for name in of],
        )  # fmt: skip
        at = columns.at
        if share.comm.rank == 0:
            self._copy(self._place(ffi.addressof(march, "t")), at["t"].start, 1)
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
            for c, dof in ((c, share.grid.node(support.place)[c]) for c in support.held)
            if share.owns(np.array([dof]))[0]
        ]  # fmt: skip
        dofs, to = np.array(held, dtype=np.int64).reshape(-1, 2).T
        mine = np.searchsorted(supports.dofs, share.local(dofs))
        self._add(self._place(supports.reactions), mine, to)
        for one in inelastic:
            mine, k = one.kept()[0], np.flatnonzero(one.kept_factors)
            width = columns.shapes["material"][1]
            rows = at["material"].start + width * np.searchsorted(grid.inelastic_cells, mine)
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

    def _place(self, numbers: Any) -> Any:
        """A place that has the address of a number of C, of an array, or of a view."""
        address = numbers
        if isinstance(numbers, np.ndarray):
            address = ffi.cast("double *", numbers.ctypes.data)
        self._alive += [numbers, place := ffi.new("double *[1]", [address])]
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
