# SPDX-License-Identifier: MIT
"""Blocks: all elements of a scene with one statement, as a term of the equation of a step.

A block computes everything that follows from a statement: forces and tangent, new states, entries
of the ledger, section forces, derivatives of runs, and restart.  The loops are in blocks.c.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.statement import OF_STEP, Kernels, Statement, kernels
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, integers, lib, loop, names, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.compiled_forms import InsertedForces, inserted_cells, places_in
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.functions import TimeFunction
from ufl_beam.model.scene import Scene
from ufl_beam.terms.derivatives import MOST_MARGINS, Each, Neighbours, differences
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, InCells, LoadTerm, Phases

TIMES = names("time_of_number", "time_")
"""Times of the numbers of a step, see loops.h."""


class BlockSetting(NamedTuple):
    """Equation of a step to which blocks belong.

    Attributes:
        subdomain, scheme, A, ledger: Cells of the process, scheme, matrix, ledger.
        t0: Initial time; s.
        rates: ``rates`` of loops.h; None in statics.
        search: Flags that all points and connectors share, see loops.h.
        switched: Whether a law began or ceased to hold since the last tangent; (1,).
        requested_forces: Function that returns the address of the force of a controller, or of the
            limit of friction.
        friction_repeats: True if constraints of sticking connectors may be redundant.
    """

    subdomain: Subdomain
    scheme: Scheme
    A: Csr
    ledger: Ledger
    t0: float
    rates: Any
    search: Index
    switched: Index
    requested_forces: Callable[[Any], Any]
    friction_repeats: bool

    @property
    def scene(self) -> Scene:
        """Scene of the equation of a step."""
        scene: Scene = self.subdomain.numbering.scene
        return scene


class InTime(NamedTuple):
    """Number of a step that is a function of time.

    Attributes:
        function: The function; None is the time itself.
        owner: Object that error messages name.
        when: Time at which the function is taken, one of :data:`TIMES`.  By default the number
            grows from its last value by the applied fraction of the step, as load factors do.
    """

    function: TimeFunction | None
    owner: object
    when: str = "growing"


class Elements(NamedTuple):
    """Elements of a statement on a process.

    Attributes:
        name: Name in saved states; no other block of the scene has it.
        indices: Index of each element in the scene.
        dofs: Local degrees of freedom in the order of ``Statement.unknowns``; (n, unknowns).
        numbers: Numbers in the order of ``Statement.numbers``; (n,) each.
        in_time: Functions of time, equal on all processes.
        of_step: Indices in ``in_time`` of functions in ``Statement.of_step``, one each or (n,).
        cells: Positions in ``subdomain.cells`` of elements that are cells.
        force_kind: Value of ``force_kind`` in loops.h, for section forces of cells.
        groups: Group of each element, if it shares numbers, (n,).  All processes have all groups.
        number_of_groups: Number of groups.
    """

    name: str
    indices: Index
    dofs: Index
    numbers: Sequence[Array] | Array
    in_time: Sequence[InTime] = ()
    of_step: Mapping[str, npt.ArrayLike] = {}
    cells: Index | None = None
    force_kind: int = lib.DENSITY
    groups: npt.ArrayLike = 0
    number_of_groups: int = 0


Made = tuple[Statement, Elements]
"""A statement, and its elements on a process."""


def called(function: Any, w: Array) -> Array:
    """Return the outputs of a compiled function of an element; none of no function."""
    out: Array = np.zeros(function.outputs if function else 0)
    if function:
        unused = [ffi.NULL] * (len(ffi.typeof(function.one).args) - 4)
        function.one(doubles(out), doubles(w), ffi.NULL, doubles(np.eye(1, 6, 3)[0]), *unused)
    return out


class Block(LoadTerm):
    """Elements of one statement on a process.

    Args:
        statement: Effect on an element.
        elements: The elements.
        setting: Equation of a step.
        kind: Kind of the term, see :class:`Term`.
        supplies: Entry of the ledger of the work that the elements do on the scene.
        moves: Whether the forces before the first step are computed with the initial velocities.

    Attributes:
        statement: The statement.
        state: Views of the states by name, in batches, with copies of the last element; initially
            zero.
        dofs: Degrees of freedom on which loads act, on any process.
        remembers: Whether a run that goes on needs the states of a load.
    """

    remembers = False

    def __init__(
        self, statement: Statement, elements: Elements, setting: BlockSetting, *,
        kind: str = "loads", supplies: str | None = None, moves: bool = False,
    ) -> None:  # fmt: skip
        subdomain, scheme, self._A, self._ledger, t0, nodal, *_ = setting
        self.statement, self._supplies = statement, supplies
        self._elements = elements._replace(numbers=())  # the block has copies
        self.kind, self._moves, self._subdomain = kind, moves, subdomain
        self._passes_on = bool(statement.shared or (moves and scheme.weight_of_before))
        self._kernels = made = kernels(statement)
        for account, energies in made.energies.items():
            for entry in energies:
                getattr(self._ledger, account)[entry] += 0.0
        if supplies:
            self._ledger.supplied[supplies] += 0.0
        n, fields, groups = len(elements.indices), made.fields, elements.number_of_groups
        motions, states, shares, width, numbers, modes, stored = (
            fields[x]
            for x in ("unknowns", "states", "shares", "width", "numbers", "modes", "stored")
        )
        in_time, functions = elements.in_time, len(elements.in_time)
        dofs = np.asarray(elements.dofs, dtype=np.int32).reshape(n, motions)
        loads = n if kind == "loads" else 0
        self.dofs: Index = np.zeros(0, np.int32)
        if kind == "loads":  # all processes have blocks of loads
            loaded: Array = np.zeros(subdomain.size)
            loaded[dofs] = 1.0
            # Other processes may load degrees of freedom that this process owns.
            self.dofs = np.flatnonzero(subdomain.added(loaded)).astype(np.int32)
        # Positions in the array of a step: functions of time, OF_STEP, shared numbers of each group
        more = {name: functions + i for i, name in enumerate(OF_STEP)}
        first = functions + len(more if statement.rates else OF_STEP[: lib.NUMBERS_OF_STEP])
        of_group = [first + shares * np.asarray(elements.groups) + i for i in range(shares)]
        index = more | {**elements.of_step} | dict(zip(statement.shared, of_group, strict=True))
        names = *statement.of_step, *statement.shared
        from_ = np.empty((len(names), n), dtype=np.int32)
        for row, name in zip(from_, names, strict=True):
            row[:] = index[name]
        self._of_step = first + shares * groups
        of_groups = np.broadcast_to(elements.groups, n)[: n if shares else 0]
        after = width - modes - len(from_)
        self._w: Array = np.zeros((batches := -(-n // BATCH), width, BATCH))
        self._numbers = self._w[:, after - numbers : after]
        lanes = np.minimum(np.arange(batches * BATCH), n - 1).reshape(batches, BATCH)
        for k, number in enumerate(elements.numbers):  # one by one, as all may be large
            self._numbers[:, k] = np.asarray(number).ravel()[lanes]
        self._states = np.zeros((batches, states, BATCH))
        self.state = {z: self._states[:, k] for k, z in enumerate(statement.state)}
        inserted = statement.inserts
        each, second = np.zeros((2, 0 if inserted else batches, made.force.outputs, BATCH))
        self.recorded: Array = np.zeros((n, fields["recorded"]))
        table = (motions + states + shares + MOST_MARGINS) * (width + 1)
        self._out: Array = np.zeros((1 if inserted else batches) * BATCH * made.most)
        self._each = ffi.new("double *[1]", [doubles(each)]), each
        self._times, self._t = np.zeros((3, self._of_step)), np.full(2, float(t0))
        self._begun = np.zeros(1, dtype=np.int32)
        self._forces = np.zeros((2, len(self.dofs)))
        self._energy = np.zeros(stored)
        self.vector = struct("vector", size=len(self.dofs), dof=self.dofs, values=self._forces[0])
        self._shared = np.zeros((groups, shares))
        ranged = [statement.numbers.index(x) for x in ("low", "high") if statement.acts_at]
        ranges = np.ascontiguousarray(self._numbers[:, ranged])
        self._nodal = nodal if statement.rates else ffi.NULL
        self._c = struct(
            "element_block", **fields, lanes=BATCH, elements=n, batches=batches,
            dofs=ffi.NULL if inserted else in_batches(dofs, BATCH),
            acting=np.full(1, batches, dtype=np.int32), batch=np.arange(batches, dtype=np.int32),
            range=ranges, size=len(self.dofs), dof=self.dofs,
            at=in_batches(np.searchsorted(self.dofs, dofs[:loads]).astype(np.int32), BATCH),
            entry=ffi.NULL if inserted else self._entries(made), functions=functions,
            when=np.array([TIMES.index(x.when) for x in in_time], dtype=np.int32), t=self._t,
            begun=self._begun,
            now=self._times[0], end=self._times[1], before=self._times[2],
            **{"from": in_batches(from_.T, BATCH)},
            state=self._states, w=self._w, out=self._out,
            space=np.zeros(3 * motions + 2 + width + max(made.most, table)),
            each=self._each[0],
            force=self._forces[0], force_before=self._forces[1],
            weight_of_before=scheme.weight_of_before,
            holds=np.zeros(n * statement.laws, dtype=np.int32),
            energy=self._energy, nodal=self._nodal, groups=groups, shared=self._shared,
            new_shared=np.zeros(self._shared.shape), totals=ffi.new("int[]", self._shared.size),
            group=in_batches(of_groups.astype(np.int32)[:, None], BATCH),
            scene=subdomain.numbering.scene.size, record=self.recorded,
        )  # fmt: skip
        tangent = loop("add_block_tangent", self._c) if made.tangent else None
        self.loops = loop("add_block", self._c), tangent
        if inserted:
            self._insert(made, dofs)
        elif elements.cells is not None:
            kept = self._each[0], second
            forces = SimpleNamespace(keep_entries=lambda: kept)
            self.in_cells = [InCells(lambda: forces, elements.force_kind, elements.cells)]

    def _insert(self, made: Kernels, dofs: Index) -> None:
        """Insert forces and tangents of cells by the loops for forms."""
        elements, places = self._elements, places_in(self._A, dofs, BATCH)
        w = self._w[:, dofs.shape[1] :]
        force = inserted_cells(made.force, w, dofs)
        tangent = inserted_cells(made.tangent, w, dofs, **places)
        fill(self._c, inserted=tangent)
        self.loops = loop("add_cells", force), loop("add_cells", tangent)
        forces = InsertedForces(force)
        on_demand, order = not (elements.in_time or made.strains), np.asarray(elements.cells)
        kind = elements.force_kind
        self.in_cells = [InCells(lambda: forces, kind, order, on_demand=on_demand)]

    def _entries(self, made: Kernels) -> Any:
        """Return the entries of the matrix of the outputs of a tangent, in batches."""
        i, j = np.array(made.entries, dtype=int).reshape(-1, 2).T
        dofs = np.reshape(self._elements.dofs, (-1, len(self.statement.unknowns))).astype(np.int32)
        entries = self._A.positions(dofs[:, i].ravel(), dofs[:, j].ravel()).astype(np.int32)
        return integers(in_batches(entries.reshape(len(dofs), len(i)), BATCH))

    def each_element(self, q: Array) -> Iterator[tuple[Index, Array, Array, Array]]:
        """Yield degrees of freedom, forces, and positions and values of the tangent at ``q``.

        This is the plain loop of the reference solver: one call of a kernel for an element.  The
        branches of laws are those of the latest residual.
        """
        made, unknowns, modes = self._kernels, len(self.statement.unknowns), self.statement.modes
        entries = np.array(made.entries, dtype=int).reshape(-1, 2)
        all_dofs = np.reshape(self._elements.dofs, (-1, unknowns))
        inputs: list[Array] = [*np.ascontiguousarray(self.by_element(self._w))]
        for dofs, w in zip(all_dofs, inputs, strict=True):
            w[:unknowns] = q[dofs]
            if "moved" in modes:  # the latest tangent is at q
                about = [*q[dofs], 1.0, 1.0, *q[dofs]]
                w[-len(modes) :][: len(about)] = about
            forces = called(made.force, w)[:unknowns]
            yield dofs, forces, entries, called(made.tangent, w)

    def freeze(self) -> None:
        """Keep the internal variables constant from now on."""
        made = kernels(self.statement.frozen)
        tangent, entries = made.tangent or ffi.NULL, self._entries(made)
        fill(self._c, force_of=made.force, tangent_of=tangent, entry=entries)

    @property
    def effect(self) -> str:
        """Name of the statement."""
        return type(self.statement).__name__

    @property
    def parts(self) -> object:
        """See the base class: the kind of statement, and the elements."""
        return self.effect, *self._elements.indices

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step, and enter energies."""
        self._callbacks, ledger, made = callbacks, self._ledger, self._kernels
        entries = [
            getattr(ledger, account).pointer(entry)
            for account, energies in made.energies.items() for entry in energies
        ]  # fmt: skip
        c = fill(
            self._c, function=callbacks.time_functions([x[:2] for x in self._elements.in_time]),
            entries=ffi.new("double *[]", entries),
            work=ledger.supplied.pointer(self._supplies) if self._supplies else ffi.NULL,
            equation=callbacks.c,
        )  # fmt: skip
        energies = [loop("add_energy_of_block", c)] if len(self._energy) else []
        change = loop("change_of_block", c) if self.kind == "connectors" else None
        return Phases([loop("begin_block", c)], [loop("accept_block", c)], energies, change)

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the forces before the next step to the forces at the time ``t``, and return them.

        If they depend on velocities, the last step is assumed to take 1 s at constant velocities.
        """
        self._t[:] = t
        before, dt = (q - v, 1.0) if self._moves and v is not None else (q, math.inf)
        self._begin(before, t, dt=dt, fraction=1.0)
        self.add_residual(q, np.zeros(self._subdomain.size))
        self._begin_state(q)
        self._forces[1], self._times[2] = self._forces[0], self._times[1]
        self._begun[:] = 1
        if self._passes_on and past is not None and past.has(f"forces of {self._elements.name}"):
            self._keep_forces(past)
            self._keep_shared(past)
        return -self._whole(self._forces[1])

    def _begin(self, q0: Array, t: float, *, dt: float, fraction: float) -> None:
        times = {"load_time": t, "motion_time": t, "fraction": fraction, "at": 1.0}
        step, nodal = struct("time_step", q0=q0, dt=dt, **times), self._nodal
        if nodal:  # without a step, the scheme has no coefficients
            now, nodal.now = nodal.now, ffi.NULL
        lib.begin_block(self._c, step, ffi.NULL, ffi.NULL)
        if nodal:
            nodal.now = now
        self._callbacks.synchronize()

    def begin_energy(self, t: float, q: Array, v: Array) -> None:
        """Set the shared numbers, and the energies of the state."""
        if self.statement.shared:
            self._t[:] = t
            self._begin(q, t, dt=math.inf, fraction=1.0)
            self._begin_state(q)

    def _begin_state(self, q: Array) -> None:
        """Compute state, shared numbers and energies at ``q``; a collective call."""
        lib.end_step_of_block(self._c, doubles(q), lib.BEGIN)
        if self.statement.shared and not self._subdomain.alone:
            self._shared[:] = self._subdomain.comm.allreduce(self._shared)

    def prepare(self, q1: Array) -> None:
        """Take further rates of the scheme, which are shared numbers, from a trial step."""
        if self.statement.trial:
            lib.end_step_of_block(self._c, doubles(q1), lib.TRIAL)

    def pass_on(self, archive: Archive) -> None:
        """Save the forces of the last step, if they depend on its velocities."""
        if self._passes_on:
            self._keep_forces(archive)
            self._keep_shared(archive)

    def _keep_shared(self, archive: Archive) -> None:
        """Save or restore shared numbers, and the energies of the state, which follow from them."""
        name, groups = self._elements.name, np.arange(len(self._shared))
        if not self.statement.shared:
            return
        self._shared[:] = archive.rows(f"shared by {name}", groups, self._shared, known=True)
        for i, energy in enumerate(self._energy):
            self._energy[i] = archive.total(f"energy {i} of {name}", energy)

    def _keep_forces(self, archive: Archive) -> None:
        """Save or restore the forces in the equation of the last step."""
        name = f"forces of {self._elements.name}"
        restores, forces = archive.has(name), archive.added(name, self._whole(self._forces[1]))
        if restores:
            self._forces[:] = forces[self.dofs]
            self._begun[:] = 1

    def start(self, q: Array) -> None:
        """See the base class: compute stored energies, and recorded numbers of the state."""
        if (len(self._energy) or self.recorded.size) and not self.statement.shared:
            self._begin(q, float(self._t[0]), dt=math.inf, fraction=0.0)
            lib.end_step_of_block(self._c, doubles(q), lib.ENERGIES)

    def _whole(self, forces: Array) -> Array:
        """Return forces at all local degrees of freedom from forces at the loaded ones."""
        whole: Array = np.zeros(self._subdomain.size)
        whole[self.dofs] = forces
        return whole

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore states, functions of time and forces at the end of the last step."""
        name = self._elements.name
        if self._c.size:
            self._keep_forces(archive)
        if functions := len(self._elements.in_time):  # all processes have the block
            self._t[0] = archive.number(f"time of {name}", float(self._t[0]))
            times = self._times[2, :functions, None]
            rows = f"functions of {name}", np.arange(functions), times
            times[:] = archive.rows(*rows, known=True)
        self.keep_states(archive)
        self._keep_shared(archive)
        if archive.restores:
            self.start(q)

    @property
    def states(self) -> Array:
        """States of the elements, in batches."""
        return self._states

    def keep_states(self, archive: Archive, first: int = 0, last: int | None = None) -> None:
        """Save or restore the states of the elements from the first to the last one."""
        if number := len(self.statement.state[first:last]):
            indices, states = self._elements.indices, self._states[:, first:last]
            rows = states.transpose(0, 2, 1).reshape(-1, number)[: len(indices)]
            states[:] = in_batches(archive.rows(self._elements.name, indices, rows), BATCH)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """See the base class."""
        made = kernels(self.statement.frozen)
        if (change := made.change) is not None:
            self._along(change, q1, [u], 0, self._entries(made), doubles(self._A.data))

    def tangent_work(self, q1: Array, x: Array, y: Array, u: Array | None = None) -> float:
        """Return y·(K x), J; K is the tangent or, with ``u``, its derivative along ``u``.

        The work is a sum over elements, computed from their relative motions.  A product with the
        matrix would have the round-off of axial and shear stiffness.  In slender cells this
        round-off may exceed the bending stiffness.
        """
        along = [x, y] if u is None else [x, y, u]
        work = self._kernels.tangent_work if u is None else self._kernels.change_of_tangent_work
        parts = len(along) - 1
        return float(self._along(work, q1, along, parts).sum()) if work is not None else 0.0

    def _along(
        self, function: Any, q: Array, directions: Sequence[Array], parts: int = 0,
        entries: Any = ffi.NULL, tangent: Any = ffi.NULL,
    ) -> Array:  # fmt: skip
        """Return outputs at ``q`` of a function of motions, or add them to the tangent.

        The last inputs of the function are ``parts`` zeros.
        """
        batches, width, lanes = self._w.shape
        out: Array = np.zeros(batches * function.outputs * lanes)
        width += len(directions) * self._c.unknowns + parts
        w = np.zeros((batches, width, lanes))
        lib.evaluate_along(
            self._c, function, doubles(q), len(directions),
            ffi.new("double *[]", [doubles(u) for u in directions]), width, doubles(w),
            doubles(out), entries, tangent,
        )  # fmt: skip
        return self.outputs(function, out)

    def outputs(self, function: Any, out: Array | None = None) -> Array:
        """Return the latest outputs of a function for each element; (elements, outputs)."""
        outputs = (self._out if out is None else out)[: len(self._w) * function.outputs * BATCH]
        return self.by_element(outputs.reshape(-1, function.outputs, BATCH))

    def by_element(self, batches: Array) -> Array:
        """Return the values of each element from values in batches; (elements, values)."""
        rows = batches.transpose(0, 2, 1).reshape(-1, batches.shape[1])
        return np.array(rows[: self._c.elements])

    # -- derivatives of runs ---------------------------------------------------------------------

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        P, others = len(neighbours), neighbours.number
        terms, found = [term for some in neighbours.terms for term in some], list[Each]()
        if all(map(self.is_like, terms)):
            by_number = neighbours.differences(lambda term: term._numbers)
            by_state = neighbours.state(lambda term: term._states)
        else:  # numbers in the functions of a user are in kernels, not in arrays
            found.append(differences(neighbours, lambda x: [x._times[2], x._t], self._begins))
            by_number, by_state = (np.zeros((P, *x.shape)) for x in (self._numbers, self._states))
            neighbours.states.append(by_state)
            terms, others = [], 0
        neighbours.states += [x for term in terms for x in (term._times[2], term._t)]
        b, by_shared = self._c, neighbours.state(lambda term: term._shared)
        fill(b, dofs=in_batches(np.asarray(self._elements.dofs, dtype=np.int32), BATCH))
        by_before = neighbours.state(lambda term: term._times[2, : b.functions])
        table, conditions = self._kernels.derivative
        changes = np.ones((P, b.width - b.modes), dtype=np.int32)
        first = changes.shape[1] - b.steps - b.numbers
        given = self.statement.given
        in_steps = np.array(
            [x.startswith("shift") or x in given for x in self.statement.numbers], bool
        )
        changes[:, first : first + b.numbers] = by_number.any(axis=(1, 3)) | in_steps
        c = struct(
            "block_derivatives", block=b, parameters=P, neighbours=others,
            neighbour=ffi.new("element_block *[]", [term._c for term in terms]),
            weight=neighbours.weights, table_of=table, margins=conditions,
            table=np.zeros(b.batches * table.outputs * b.lanes),
            direction=np.zeros(b.width * b.lanes), by_state=by_state, by_number=by_number,
            of_step=self._of_step, by_step=np.zeros((P, self._of_step)), by_shared=by_shared,
            by_before=by_before,
            state_bar=np.zeros(self._states.shape), number_bar=np.zeros(self._numbers.shape),
            step_bar=np.zeros(self._of_step), shared_bar=np.zeros(self._shared.shape),
            strains=self._kernels.strains, changes=changes,
            strain_bar=np.zeros(b.batches * self._kernels.strains * b.lanes),
        )  # fmt: skip
        self.complete_derivatives(c, neighbours, by_number)
        return [*found, ("block", c)]

    def _begins(self, neighbour: Any) -> list[Loop]:
        """Return phases that begin a step in a neighbouring scene before the block does."""
        return []

    def is_like(self, term: Block) -> bool:
        """Return whether a block of another scene differs in numbers of its elements only."""
        return self.statement == term.statement

    def complete_derivatives(self, c: Any, neighbours: Neighbours, by_number: Array) -> None:
        """Set further fields of ``block_derivatives`` of loops.h."""
