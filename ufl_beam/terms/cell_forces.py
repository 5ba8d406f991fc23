# SPDX-License-Identifier: MIT
"""Forces on the nodes of cells in the equation of a step, and in the accepted state.

At a node, the forces of all cells and all other forces add up to the residual.  The forces at the
ends of a cell are therefore section forces in equilibrium with supports and joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, integers, lib
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.discretization.compiled_forms import InsertedForces
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.terms.term import InCells


class CellForces:
    """Forces of the cells of a process in the equation of the accepted step.

    Attributes:
        c: ``cell_forces`` of loops.h.
        needs_q0: True if the forces depend on the configuration at the beginning of the
            step.
        vectors: Pointers to vectors of degrees of freedom that determine forces.
        entries: Pairs of a pointer to entries of a form that determine forces, and their number.
        factors: Pairs of a pointer to load factors, equal on all processes, and their number.
    """

    def __init__(
        self, subdomain: Subdomain, forces: Sequence[InCells], loads: Any = ffi.NULL
    ) -> None:
        self._subdomain, self._space = subdomain, np.zeros(subdomain.size)
        self._alive: list[Any] = [forces]
        self._unmade = list[tuple[InCells, Any]]()
        self._step_forms: list[tuple[InsertedForces, Any, Array]] = []
        self.vectors, self.entries = list[Any](), list[tuple[Any, int]]()
        self.factors = list[tuple[Any, int]]()
        self._forces = ffi.new("force_in_cells[]", len(forces))
        vectors: dict[Any, Any] = {}  # by latest vector: pointer to the accepted one
        for c, force in zip(self._forces, forces, strict=True):
            c.kind, c.factor, c.number = force.kind, force.factor, len(force.order)
            c.batch_size = BATCH
            if not np.array_equal(force.order, np.arange(len(subdomain.cells))):
                order = force.order.astype(np.int32)
                c.cell = integers(order)
                self._alive.append(order)
            accepted, accepted_values = ffi.addressof(c, "accepted"), np.zeros(subdomain.size)
            if force.vector is not None:
                if force.vector not in vectors:
                    c.latest, vectors[force.vector] = force.vector, accepted
                    self.vectors.append(accepted)
                c.vector = vectors[force.vector]
                self._unmade.append((force, c))
            else:
                form = force.form()
                each, accepted_values = form.keep_entries()
                c.entries = accepted
                self._alive.append(each)
                if force.on_demand:
                    each[0] = ffi.NULL
                    self._step_forms.append((form, each, accepted_values))
                else:
                    c.latest = each
                    self.entries.append((accepted, accepted_values.size))
            c.accepted = doubles(accepted_values)
            self._alive.append(accepted_values)
        if loads != ffi.NULL:
            self.factors.append((ffi.addressof(loads, "accepted"), loads.vectors))
        self.needs_q0 = subdomain.largest(float(bool(self._step_forms))) > 0  # on any process
        first, *between, last = subdomain.numbering.mesh.nodes - 0.5
        from_middle = np.array([first, last, *between])
        self.c = fill(
            ffi.new("cell_forces *"), cells=len(subdomain.cells), nodes=2 + len(between),
            forces=len(forces), force=self._forces, loads=loads, from_middle=from_middle,
        )  # fmt: skip

    def accept(self) -> None:
        """Accept the forces of the latest residual as the forces of the accepted step."""
        lib.accept_cell_forces(self.c)

    def begin(self, values: Array | None) -> None:
        """Set the initial forces to ``values``, (9, num_cells), or to stresses of the residual."""
        if values is not None:
            fill(self.c, initial=values)
            return
        for c in self._forces:
            if c.kind == lib.STRESS and c.latest:
                c.accepted, c.latest[0] = c.latest[0], c.accepted

    def __call__(self, q: Array, before: Array) -> Array:
        """Compute resultants of cells in the order of ``cell_number`` in loops.h; (9, num_cells).

        ``q`` and ``before`` are the configurations at the end and at the beginning of the step.
        """
        self._make()
        for form, each, values in self._step_forms:
            latest, each[0] = each[0], doubles(values)
            form.begin(before)
            form.add(np.ascontiguousarray(q), self._space)
            each[0] = latest
        out: Array = np.empty((lib.CELL_NUMBERS, self.c.cells))
        lib.find_cell_forces(self.c, 0, doubles(out))
        return out

    def _make(self) -> None:
        """Create the forms that only cell forces need, at the first call."""
        for force, c in self._unmade:
            form = force.form()
            each, _ = form.keep_entries()
            c.entries, c.form = each, form.cells
            self._alive.append((form, each))
        self._unmade = []

    def in_order(self) -> bool:
        """Return whether each form has forces of all cells, in their order."""
        return not any(c.cell for c in self._forces)

    def keep_latest(self) -> None:
        """Store all entries of forms in each residual from now on, for use after a step."""
        self._make()
        structs = (c for c in self._forces if not c.latest and not c.vector)
        for c, (*_, each, values) in zip(structs, self._step_forms, strict=True):
            if not c.tee:
                latest = np.zeros(values.shape)
                self._alive.append(latest)
                c.tee, each[0] = each, doubles(latest)

    # -- data of solutions ----------------------------------------------------------------------

    def forces_from_record(self, record: Array, q: Array, before: Array) -> Array:
        """Compute the forces from a ``record`` of vectors, entries and factors, in this order."""
        arrays = [*((x, self._subdomain.size) for x in self.vectors), *self.entries, *self.factors]
        values, addresses, at = self.c.initial, [place[0] for place, _ in arrays], 0
        record = np.array(record)
        try:
            self.c.initial = ffi.NULL
            for place, n in arrays:
                place[0] = doubles(record[at : at + n])
                at += n
            return self(q, before)
        finally:
            self.c.initial = values
            for (place, _), old in zip(arrays, addresses, strict=True):
                place[0] = old

    def save_or_restore(self, archive: Archive, q: Array, before: Array) -> None:
        """Save or restore the resultants of the accepted step."""
        values = archive.rows("forces of cells", self._subdomain.cells, self(q, before).T)
        fill(self.c, initial=np.ascontiguousarray(values.T))
