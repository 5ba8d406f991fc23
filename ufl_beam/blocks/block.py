# SPDX-License-Identifier: MIT
"""Blocks: all elements of a scene with one statement, as a term of the equation of a step.

A block computes everything that follows from a statement: forces and tangent, new states, entries
of the ledger, section forces, derivatives of runs, and restart.  The loops are in blocks.c.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.statement import Statement, kernels
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.functions import TimeFunction
from ufl_beam.terms.derivatives import Each, Neighbours, in_c
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, InCells, LoadTerm, Phases


class Block(LoadTerm):
    """Elements of one statement on a process.

    Args:
        statement: Effect on an element.
        name: Name of the elements in saved states.
        indices: Index of each element in the scene.
        dofs: Local degrees of freedom of the elements; (n, 3 * nodes), see ``Statement.unknowns``.
        numbers: Numbers of the elements, in the order of ``Statement.numbers``; (n,) each.
        functions: Functions of time, with the owners that messages name; equal on all processes.
        of_step: For each name of ``Statement.of_step`` but "dt", the index in ``functions`` of each
            element; (n,).
        kind: Kind of the term, see :class:`Term`.
        supplies: Entry of the ledger of the work that the elements do on the scene.
        cells: Positions in ``subdomain.cells`` of the elements, if they are cells.
        force_kind: Value of ``force_kind`` in loops.h, for section forces of cells.

    Attributes:
        statement: The statement.
        state: Views of the states by name, in batches, with copies of the last element; initially
            zero.
    """

    def __init__(
        self, statement: Statement, name: str, indices: Index, dofs: Index,
        numbers: Sequence[Array], subdomain: Subdomain, scheme: Scheme, ledger: Ledger,
        A: Csr, *, functions: Sequence[tuple[TimeFunction, object]] = (),
        of_step: Mapping[str, npt.ArrayLike] | None = None, kind: str = "loads",
        supplies: str | None = None, cells: Index | None = None, force_kind: int = lib.DENSITY,
    ) -> None:  # fmt: skip
        self.statement, self._name, self._indices = statement, name, indices
        self._functions, self._supplies, self._ledger = functions, supplies, ledger
        self.kind = kind
        self._size, self._subdomain, self._A = subdomain.size, subdomain, A
        self._kernels = made = kernels(statement)
        for name in made.lost:
            ledger.lost[name] += 0.0
        n, width, motions = len(indices), len(statement.inputs), len(statement.unknowns)
        dofs = np.asarray(dofs, dtype=np.int32).reshape(n, motions)
        loaded: Array = np.zeros(subdomain.size)
        loaded[dofs] = 1.0
        # Other processes may load degrees of freedom that this process owns.
        self.dofs: Index = np.flatnonzero(subdomain.added(loaded)).astype(np.int32)
        rows, columns = (dofs[:, list(x)] for x in zip(*made.entries, strict=True))
        entries = A.positions(rows.ravel(), columns.ravel()).reshape(n, -1)
        time_index = {"dt": np.full(n, len(functions))} | dict(of_step or {})
        from_ = [np.broadcast_to(time_index[x], n) for x in statement.of_step]
        w = np.zeros((n, width))
        first = 2 * motions + len(statement.state)
        w[:, first : first + len(statement.numbers)] = np.array(numbers).reshape(-1, n).T
        self._w = in_batches(w, BATCH)
        self._states = self._w[:, 2 * motions : first]
        self.state = {z: self._states[:, k] for k, z in enumerate(statement.state)}
        self._numbers = self._w[:, first : first + len(statement.numbers)]
        batches, most = len(self._w), made.tangent.outputs
        most = max(most, made.end.outputs) if made.end else most
        each, self._second = np.zeros((2, batches, motions, BATCH))
        self._each = ffi.new("double *[1]", [doubles(each)]), each
        self._times = np.zeros((3, len(functions) + 1))
        self._forces = np.zeros((2, len(self.dofs)))
        self._energy = np.zeros(len(made.stored))
        self.vector = struct("vector", size=len(self.dofs), dof=self.dofs, values=self._forces[0])
        self._c = struct(
            "block", force_of=made.force, tangent_of=made.tangent, end_of=made.end or ffi.NULL,
            lanes=BATCH, elements=n, batches=batches, unknowns=motions,
            states=len(statement.state), numbers=len(statement.numbers),
            steps=len(statement.of_step), width=width, size=len(self.dofs), dof=self.dofs,
            dofs=in_batches(dofs, BATCH), at=in_batches(np.searchsorted(self.dofs, dofs).astype(np.int32), BATCH),
            entry=in_batches(entries, BATCH), functions=len(functions), now=self._times[0],
            end=self._times[1], before=self._times[2],
            **{"from": in_batches(np.array(from_, dtype=np.int32).T.reshape(n, -1), BATCH)},
            w=self._w, out=np.zeros(batches * BATCH * most),
            space=np.zeros(max(motions * (motions + 1), most)), each=self._each[0],
            force=self._forces[0], force_before=self._forces[1],
            weight_of_before=scheme.weight_of_before, stored=len(made.stored),
            lost=len(made.lost), energy=self._energy,
        )  # fmt: skip
        self.loops = loop("add_block", self._c), loop("add_block_tangent", self._c)
        if cells is not None:
            self.in_cells = [InCells(lambda: self, force_kind, cells)]

    @property
    def effect(self) -> str:
        """Name of the statement."""
        return type(self.statement).__name__

    def keep_entries(self) -> tuple[Any, int, Array]:
        """Return the forces of elements, as :meth:`Kernel.keep_entries` does those of cells."""
        return self._each[0], BATCH, self._second

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step, and enter energies."""
        self._callbacks, ledger, made = callbacks, self._ledger, self._kernels
        entries = [ledger.state.pointer(name) for name in made.stored]
        entries += [ledger.lost.pointer(name) for name in made.lost]
        c = fill(
            self._c, function=callbacks.time_functions(self._functions),
            entries=ffi.new("double *[]", entries),
            work=ledger.supplied.pointer(self._supplies) if self._supplies else ffi.NULL,
        )  # fmt: skip
        energies = [loop("add_energy_of_block", c)] if made.stored else []
        return Phases([loop("begin_block", c)], [loop("accept_block", c)], energies)

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the forces before the next step to the forces at the time ``t``, and return them."""
        step = struct("time_step", load_time=t, fraction=1.0, at=1.0, dt=math.inf, q0=q)
        lib.begin_block(self._c, step, ffi.NULL, ffi.NULL)
        self._callbacks.synchronize()
        self.add_residual(q, np.zeros(self._size))
        self._forces[1], self._times[2] = self._forces[0], self._times[1]
        return -self._whole(self._forces[0])

    def _whole(self, forces: Array) -> Array:
        """Return forces at all local degrees of freedom from forces at the loaded ones."""
        whole: Array = np.zeros(self._size)
        whole[self.dofs] = forces
        return whole

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore states, functions of time and forces at the end of the last step."""
        name, n = self._name, len(self._indices)
        if self._supplies:
            forces = archive.added(name, self._whole(self._forces[1]))
            self._forces[:] = forces[self.dofs]
        times = self._times[2, :-1, None]
        self._times[2, :-1] = archive.rows(
            f"functions of {name}", np.arange(len(times)), times, known=True
        )[:, 0]
        if self.statement.state:
            rows = self._states.transpose(0, 2, 1).reshape(-1, len(self.statement.state))[:n]
            rows = archive.rows(f"states of {name}", self._indices, rows)
            self._states[:] = in_batches(rows, BATCH)

    # -- derivatives of runs ---------------------------------------------------------------------

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        P, others = neighbours.weights.shape
        by_number = neighbours.differences(lambda term: term._numbers)
        by_state = neighbours.state(lambda term: term._states)
        terms = [term for some in neighbours.terms for term in some]
        neighbours.states += [term._times[2] for term in terms]
        b, numbers = self._c, len(self._functions) + 1
        rows = b.unknowns + b.states
        c = struct(
            "block_derivatives", block=b, parameters=P, neighbours=others,
            neighbour=ffi.new("block *[]", [term._c for term in terms]),
            weight=neighbours.weights, table_of=self._kernels.derivative,
            table=np.zeros(b.batches * rows * b.width * b.lanes),
            direction=np.zeros(b.width * b.lanes), by_state=by_state, by_number=by_number,
            by_step=np.zeros((P, numbers)), state_bar=np.zeros(self._states.shape),
            number_bar=np.zeros(self._numbers.shape), step_bar=np.zeros(numbers),
        )  # fmt: skip
        return [in_c("block", c)]
