# SPDX-License-Identifier: MIT
"""A state of a scene as one row of numbers: the table of its columns, and growing arrays of rows.

C writes rows of running simulations, see ``simulation/state_writer.py``; solutions, the view of a
run and files read them by the names of the table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import lib
from ufl_beam.display import one_line

LEDGER = ("state", "supplied", "lost")
"""The parts of the ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""

FORCES, RECORD, BEFORE = "cell forces", "record", "before"
"""Columns that not all states have: ``cell_number`` of loops.h of all cells, or what these follow
from, see :attr:`CellForces.kept`; q at the beginning of the step, if it is not that of the row
before (of the same row in the first one), and if forces depend on it."""


class Connection(NamedTuple):
    """History of a connector.

    Motion, force and rate of a :func:`Bushing` are of all components; (n+1, 2) or (n+1, 3).

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

    def __repr__(self) -> str:
        return one_line(self)


def connection(numbers: Array) -> Connection:
    """History of the columns of k components, of which works are added; (..., k, 5)."""
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
    def of(
        cls, grid: Any, *, moving: bool, cells: int, ledger: Iterable[str], record: int | None
    ) -> Columns:
        """Table of a scene; a line of it is all that a quantity of connectors or cells needs.

        Args:
            grid: Its numbering.
            moving: Whether there are velocities.
            cells: Number of the cells that can yield or break.
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
            "material": (cells, int(lib.POINT_KEPT)),  # `Points.kept`
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


class Block:
    """Rows with the same columns, one below the other, with room for more that is never moved.

    Attributes:
        columns: Of the rows.
        number: Number of rows.
        space: The rows, and behind them the room.
    """

    def __init__(self, columns: Columns, space: Array, number: int) -> None:
        self.columns, self.space, self.number = columns, space, number

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
