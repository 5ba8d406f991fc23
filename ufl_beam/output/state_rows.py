# SPDX-License-Identifier: MIT
"""State of a scene as one row of numbers: the table of its columns, and growing arrays of rows.

C writes the rows of running simulations, see :class:`StateWriter`.  Results and files are made from
columns, which have names.
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
from ufl_beam.discretization.cells_in_space import TURNS
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.display import in_one_line
from ufl_beam.errors import ArgumentError
from ufl_beam.mechanics.time_scheme import V
from ufl_beam.model.bodies import moves_with_node
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene, index_of
from ufl_beam.terms.boundary_conditions import Supports
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.energy_ledger import Ledger

LEDGER = ("state", "supplied", "lost")
"""Parts of the energy ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""

FORCES, RECORD, BEFORE = "cell forces", "record", "before"
"""Columns that only some states have.  FORCES: resultants of all cells, ``cell_number`` of loops.h.
RECORD: data from which :meth:`CellForces.forces_from_record` computes FORCES.  BEFORE: q at the
beginning of the step, if FORCES depends on it and the previous row may have another q."""


@in_one_line
class Connection(NamedTuple):
    """History of a connector, or its present values (without the axis n+1).

    Motion, force and rate of a :class:`Bushing` have two or three components; (n+1, 2 or 3).

    Attributes:
        motion: Relative motion, zero in the undeformed scene; (n+1,); m or rad.
        force: Force that resisted the growth of the motion in the step that ends at each time;
            (n+1,); N or N m.
        work: Work on the connector since the beginning: energy stored or dissipated by springs,
            dampers and friction, minus energy supplied by motors; (n+1,); J.
        rate: Mean rate of the motion in the step that ends at each time; (n+1,); m/s or rad/s.
        dissipated: Energy dissipated by yielding, softening and plastic hinges, or by a
            :class:`ConnectorLaw`; (n+1,); J.
    """

    motion: Any
    force: Any
    work: Any
    rate: Any
    dissipated: Any


def connection(values: Array) -> Connection:
    """Make a history from the columns of k components; (..., k, num_columns).

    Works and dissipated energies of the components are added.
    """
    if values.shape[-2] == 1:
        columns = np.moveaxis(values[..., 0, :], -1, 0)
        return Connection(*(x if x.ndim else float(x) for x in columns))
    motion, force, work, rate, dissipated = np.moveaxis(values, -1, 0)
    return Connection(motion, force, work.sum(-1), rate, dissipated.sum(-1))


FORCE, WORK, DISSIPATED = map(Connection._fields.index, ("force", "work", "dissipated"))
"""Indices of fields of :class:`Connection`, and so of numbers of the column "connectors"."""

OWN_LAW_YIELDS = 1e-3
"""Dissipated fraction of the largest work so far at which a :class:`ConnectorLaw` has yielded.
Smaller losses may be errors of the trapezoidal rule."""


JUMP, PLASTIC, HINGE = -3, -2, -1
"""Indices of the last fields in the column "material": jump, plastic, hinge of :class:`Material`,
after the resultants."""


class Columns:
    """Names and shapes of the columns of a state, in the order of a row.

    Attributes:
        shapes: Shapes by name; () for a single number.
        at: Slices of a row, by name.
        width: Length of a row.
        ledger: For each part of the energy ledger, index in a row by the name of the entry.
    """

    def __init__(self, shapes: Mapping[str, Sequence[int]]) -> None:
        self.shapes = {name: tuple(shape) for name, shape in shapes.items()}
        ends = [0, *accumulate(map(math.prod, self.shapes.values()))]
        self.at = dict(zip(self.shapes, (slice(*pair) for pair in pairwise(ends)), strict=True))
        self.width = ends[-1]
        self.ledger = tuple(
            {name[len(account_name) + 2 :]: at.start for name, at in self.at.items()
             if name.startswith(f"{account_name}: ")}
            for account_name in LEDGER
        )  # fmt: skip
        self._others: dict[tuple[str, str], Columns] = {}

    @classmethod
    def create(
        cls, numbering: DofNumbering, *, moving: bool, ledger: Iterable[str], record: int | None,
        before: bool = False,
    ) -> Columns:  # fmt: skip
        """Make the columns of a scene.

        If ``moving``, a row has velocities, and if ``before``, the column BEFORE.  ``ledger`` has
        names of entries, as "lost: plastic".  ``record`` is the length of the
        column "record"; if None, the row has forces of cells.
        """
        size, scene = numbering.size, numbering.scene
        nodes = len(numbering.points) + len(scene.rigid_bodies)
        return cls({
            "t": (),  # time, s; or the load factor of a path
            "reactions": (len(scene.supports), numbering.width),  # of supports, in their axes
            "connectors": (len(scene.all_connectors), len(Connection._fields)),
            # `Points.recorded`, Gauss point after Gauss point of cells that can yield or break
            "material": (
                len(numbering.inelastic_cells) * numbering.mesh.degree,
                numbering.width + int(lib.POINT_KEPT),
            ),
            **({TURNS: (nodes, 4)} if scene.in_space else {}),
            **dict.fromkeys(ledger, ()),  # J
            "q": (size,),  # configuration, all degrees of freedom in the order of the numbering
            **({"v": (size,)} if moving else {}),  # velocities
            **({BEFORE: (size,)} if before else {}),
            **({FORCES: (lib.CELL_NUMBERS, len(numbering.cells))} if record is None
               else {RECORD: (record,)}),
        })  # fmt: skip

    def column_of(self, name: str, rows: Array) -> Array:
        """Return a view of a column of one or several rows; (..., *shape of the column)."""
        return rows[..., self.at[name]].reshape(rows.shape[:-1] + self.shapes[name])

    def plus(self, name: str, shape: Sequence[int], *, without: str = "") -> Columns:
        """Return columns with an additional last column, and without the column ``without``."""
        key = name, without
        if key not in self._others:
            shapes = {n: size for n, size in self.shapes.items() if n != without}
            self._others[key] = Columns({**shapes, name: shape})
        return self._others[key]


@dataclass
class Block:
    """Rows with the same columns, and space for more rows; rows are never moved in memory."""

    columns: Columns
    space: Array  # the rows, then the free space
    number: int  # number of rows

    @property
    def rows(self) -> Array:
        """The rows; (number, width)."""
        return self.space[: self.number]


class Column:
    """Column of all states that have it, in one or several blocks; (n+1, ...)."""

    def __init__(self, blocks: Sequence[Block], name: str) -> None:
        self._name = name
        self._blocks = [b for b in blocks if b.number and name in b.columns.at]

    def __len__(self) -> int:
        return sum(block.number for block in self._blocks)

    def __getitem__(self, at: tuple[Any, ...]) -> Array:
        """Return a new array; the first index is ``:``, or a number if there is only one block."""
        pieces = [block.columns.column_of(self._name, block.rows)[at] for block in self._blocks]
        return np.concatenate(pieces) if pieces else np.empty(0)


# -- rows of a running simulation ------------------------------------------------------------------


class StateWriter:
    """Writer of the state in C as a row of the whole scene.

    On each process C writes a row with the numbers of this process; the sum over the processes is
    the row of the scene.  Vectors of degrees of freedom, at the end of the row, are not added but
    gathered from the processes that own the degrees of freedom.

    Attributes:
        records: True if the row has the column "record".  Several processes have no common record
            if forces depend on entries of forms, because these differ between processes.
        columns: Columns of a row.
    """

    def __init__(
        self, time_loop: Any, subdomain: Subdomain, ledger: Ledger, supports: Supports,
        inelastic: Sequence[Any], connector_terms: Sequence[Any], cell_forces: CellForces,
        in_space: Sequence[Any] = (),
    ) -> None:  # fmt: skip
        self._time_loop, self._subdomain = time_loop, subdomain
        self._alive, self._groups = list[Any](), list[Any]()
        numbering, moving = subdomain.numbering, time_loop.rates != ffi.NULL
        accounts = ledger.state, ledger.supplied, ledger.lost
        self.records = subdomain.alone or not subdomain.largest(float(len(cell_forces.entries)))
        vectors, others = list[Any](), list[tuple[Any, int]]()
        if self.records:
            vectors, others = cell_forces.vectors, [*cell_forces.entries, *cell_forces.factors]
        self.columns = columns = Columns.create(
            numbering, moving=moving,
            record=numbering.size * len(vectors) + sum(n for _, n in others),
            ledger=[f"{p}: {n}" for p, names in zip(LEDGER, accounts, strict=True) for n in names],
            before=time_loop.stages > 1,
        )  # fmt: skip
        at = columns.at
        if subdomain.comm.rank == 0:
            self._copy(self._place(ffi.addressof(time_loop, "t")), at["t"].start, 1)
        now = ffi.addressof(time_loop, "q")
        velocity = [ffi.addressof(time_loop.rates, "rate", V)] if moving else []
        last_stage = list[Any]()
        if time_loop.stages > 1:
            last_stage = [ffi.addressof(time_loop.prediction, "q_before")]
        self._gathered = list[tuple[Any, slice]]()
        first = at["q"].start
        for place in (now, *velocity, *last_stage, *vectors):
            if subdomain.alone:
                self._copy(place, first, numbering.size)
            else:
                self._gathered.append((place, slice(first, first + numbering.size)))
            first += numbering.size
        for place, number in others:
            self._copy(place, first, number)
            first += number
        for account_name, account in zip(LEDGER, accounts, strict=True):
            if account:
                first = at[f"{account_name}: {next(iter(account))}"].start
                self._copy(self._place(account.amounts), first, len(account))
        # Degrees of freedom of supports that this process owns, and their indices in the row
        constrained = [
            (numbering.node(support.place)[c], at["reactions"].start + numbering.width * k + c)
            for k, support in enumerate(numbering.scene.supports)
            for c in support.held
        ]
        dofs, to = np.array(constrained, dtype=np.int64).reshape(-1, 2).T
        owned = subdomain.owns(dofs)
        dofs, to = dofs[owned], to[owned]
        mine = np.searchsorted(supports.dofs, subdomain.local(dofs))
        self._add(self._place(supports.reactions), mine, to)
        for term in inelastic:
            (mine, recorded), p = term.sections(), numbering.mesh.degree
            k, width = np.flatnonzero(term.recorded_factors), recorded.shape[-1]
            sections = p * np.searchsorted(numbering.inelastic_cells, mine)[:, None] + np.arange(p)
            rows = at["material"].start + width * sections.ravel()
            first = width * np.arange(len(rows))
            self._add(self._place(term.points.recorded), first[:, None] + k, rows[:, None] + k)
        hinges = [x for x in connector_terms if hasattr(x, "turns")] if in_space else []
        for term in (*in_space, *hinges):
            mine, nodes = term.turns(numbering)
            rows = at[TURNS].start + 4 * nodes[:, None] + np.arange(4)
            self._add(self._place(term.states), mine, rows)
        for connector in connector_terms:
            rows = at["connectors"].start + columns.shapes["connectors"][1] * connector.indices
            self._add(now, connector.forces_at, rows + FORCE)
            for field, values in connector.fields:
                apart = values.strides[0] // values.itemsize * np.arange(len(rows))
                self._add(self._place(values), apart, rows + Connection._fields.index(field))
        groups = ffi.new("group_columns[]", self._groups)
        fill(time_loop, num_groups=len(groups), groups=groups, width=columns.width)
        time_loop.sums = at["q"].start

    def _place(self, values: Any) -> Any:
        """Return a pointer to the address of the numbers of an array, or ``values`` of C."""
        address = values
        if isinstance(values, np.ndarray):
            address = ffi.cast("double *", values.ctypes.data)
        self._alive += [values, place := ffi.new("double *[1]", [address])]
        return place

    def _copy(self, place: Any, first: int, number: int) -> None:
        """Let C write ``number`` contiguous numbers to the row, from the index ``first`` on."""
        self._groups.append((place, number, first, ffi.NULL, ffi.NULL))

    def _add(self, place: Any, at: Index, to: Index) -> None:
        """Let C add the numbers at the indices ``at`` to the row at the indices ``to``."""
        both = [np.ascontiguousarray(x.ravel(), dtype=np.int32) for x in (at, to)]
        self._alive.append(both)
        self._groups.append((place, at.size, 0, *map(integers, both)))

    def write(self, row: Array) -> None:
        """Write the present state of C to ``row``; all processes call this method together."""
        subdomain = self._subdomain
        lib.keep_state(self._time_loop, doubles(row))
        if not subdomain.alone:
            subdomain.comm.Allreduce(MPI.IN_PLACE, row[: self._time_loop.sums])
        for place, at in self._gathered:
            subdomain.gather(np.frombuffer(ffi.buffer(place[0], 8 * subdomain.size)), row[at])


@in_one_line
class JointHistory(NamedTuple):
    """History of a joint between its first place a and its second place b.

    Forces and their directions belong to the step that ends at their time, as reactions do.

    Attributes:
        motion: Displacement of b relative to a, in axes that turn with a, and rotation of b
            relative to a, in space a rotation vector in these axes; zero in the undeformed scene;
            (n+1, 3), in space (n+1, 6); m, rad.
        force: Force of the joint on b, along x and y, in space z; (n+1, 2 or 3); N.
        in_a, in_b: The same force in axes that turn with a and with b; (n+1, 2 or 3); N.
        moment: Moment of the joint on b, about the place b; (n+1,), in space along x, y, z,
            (n+1, 3); N m.  If the places share their rotation, the moment is unknown: NaN.  In
            energy-momentum schemes it is a mean of the step.  In the plane its work on the change
            of the rotation is the work of the step; in space its impulse is exact.
    """

    motion: Array
    force: Array
    in_a: Array
    in_b: Array
    moment: Array


def connector_indices(scene: Scene, connector: Connector | Joint) -> list[int]:
    """Return the indices in ``scene.all_connectors`` of a connector's or joint's components."""
    if isinstance(connector, Connector):
        return [index_of(scene.all_connectors, c) for c in connector.components or (connector,)]
    index_of(scene.joints, connector)
    if not connector.holders:
        raise ArgumentError(
            f"{connector} shares unknowns, so that its force is not known; make it with "
            "multipliers=True"
        )
    return [scene.all_connectors.index(holder) for holder in connector.holders]


def signs_on_second_place(joint: Joint) -> dict[int, float]:
    """Return the signs of the holders in the force of a joint on its second place, by index.

    Raises:
        ArgumentError: The second place shares its displacement with another place, so that the
            force on it alone is not known.
    """
    b = joint.places[1]
    alike = [x for x in joint.places if 0 in joint.shared and moves_with_node(x)]
    if b in alike and len(alike) > 1:
        other = next(place for place in alike if place != b)
        raise ArgumentError(
            f"{joint}: {other} and {b} share unknowns, so that the force between them is not "
            "known; make it with multipliers=True, or give a point of a body as second place"
        )
    places = [(holder.a, holder.b) for holder in joint.holders]
    return {k: 1.0 if x[1] == b else -1.0 for k, x in enumerate(places) if b in x}
