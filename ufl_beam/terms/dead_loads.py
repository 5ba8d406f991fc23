# SPDX-License-Identifier: MIT
"""Dead loads: forces and moments that keep their direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, loop, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory, Restoring
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.bodies import carries
from ufl_beam.model.loads import Gravity, LineLoad, Load, PointLoad
from ufl_beam.model.time_functions import value_at
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.loads import LoadTerm
from ufl_beam.terms.phases import Callbacks, Phases


class DeadLoads(LoadTerm):
    """Forces and moments that keep their direction: vectors times functions of time.

    Attributes:
        dofs: Local degrees of freedom that are loaded; other arrays here are at these alone.
    """

    def __init__(self, loads: Sequence[Load], share: Share, scheme: Scheme, ledger: Ledger) -> None:
        super().__init__(scheme, ledger)
        # Loads of one time function are one vector; functions need not be hashable.
        vectors: dict[int, tuple[Load, Array]] = {}
        in_cells: dict[int, Array] = {}
        for load in loads:
            key = id(load.time)
            _, vector = vectors.setdefault(key, (load, np.zeros(share.size)))
            _add_forces(load, share, vector)
            if (along := _along_beams(load, share)) is not None:
                in_cells[key] = in_cells.get(key, 0.0) + along
        for key, along in in_cells.items():
            np.add.at(vectors[key][1], share.cell_dofs, along)
        whole = [vector for _, vector in vectors.values()]
        # A process may own degrees of freedom that others load.
        self.dofs = np.flatnonzero(share.added(np.any(whole, axis=0) * 1.0)).astype(np.int32)
        self._vectors = [(load, vector[self.dofs]) for load, vector in vectors.values()]
        self._size = share.size
        # In the equation, at the end of the step, and at that of the last one.
        self._forces = np.zeros((3, len(self.dofs)))
        self.vector = struct("vector", size=len(self.dofs), dof=self.dofs, values=self._forces[0])
        # Parts of the vectors that act: now, at the end of the step, at that of the last one, and
        # in its equation.
        self._parts: Array = np.zeros((4, len(vectors)))
        self._along = [in_cells.get(key) for key in vectors]

    def loads_in_cells(self) -> Any:
        """``loads_in_cells`` of loops.h; null if nothing acts along beams."""
        if not any(along is not None for along in self._along):
            return ffi.NULL
        along = [ffi.NULL if one is None else doubles(one) for one in self._along]
        c = struct(
            "loads_in_cells", vectors=len(along), vector=ffi.new("double *[]", along),
            latest=self._parts[0], accepted=self._parts[3],
        )  # fmt: skip
        return ffi.gc(c, lambda _, kept=(c, along): None)  # solutions outlive the term

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loop that subtracts the load vector; no tangent."""
        return loop("subtract_vector", self.vector), None

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the vectors."""
        owners = [(load.time, load) for load, _ in self._vectors]
        c = self._c = struct(
            "dead_loads", size=len(self.dofs), dof=self.dofs, vectors=len(owners),
            force=self._forces[0], end=self._forces[1], before=self._forces[2],
            parts=[doubles(part) for part in self._parts[:3]],
            factors=np.full(len(owners), math.nan), factor=callbacks.of_time(owners),
            vector=ffi.new("double *[]", [doubles(vector) for _, vector in self._vectors]),
            work=self._ledger.supplied.pointer("loads"),
            weight_of_before=self._scheme.weight_of_before,
        )  # fmt: skip
        return Phases([loop("begin_dead_loads", c)], [loop("accept_dead_loads", c)])

    def carry_on(self, t: float, q: Array, v: Array | None, past: Restoring | None) -> Array:
        """The loads at time ``t``; take the state ``q`` as one that is in equilibrium with them."""
        factors = self._factors_at(t)
        self._parts[:3] = factors
        self._forces[:] = sum(
            f * vector for f, (_, vector) in zip(factors, self._vectors, strict=True)
        )
        return self._whole(self._forces[0])

    def _factors_at(self, t: float) -> list[float]:
        """Factors of the vectors; a vector belongs to its first load for messages."""
        return [value_at(load.time, t, load) for load, _ in self._vectors]

    def _whole(self, forces: Array) -> Array:
        """Forces at all local degrees of freedom, from those that are loaded."""
        whole: Array = np.zeros(self._size)
        whole[self.dofs] = forces
        return whole

    def remember(self, memory: Memory, q: Array) -> None:
        """The forces at the end of the last step."""
        self._forces[:] = memory.added("dead loads", self._whole(self._forces[2]))[self.dofs]
        for k in range(len(self._vectors)):
            self._c.factors[k] = math.nan
        for k, part in enumerate(self._parts[2]):
            self._parts[2, k] = memory.number(f"part of dead loads {k}", part)


@singledispatch
def _add_forces(load: Load, share: Share, forces: Array) -> None:
    """Add the nodal forces of a dead load, consistent with displacements, with factor one."""
    raise TypeError(f"{type(load).__name__} is not a dead load")


@_add_forces.register
def _(load: PointLoad, share: Share, forces: Array) -> None:
    if not carries(load.place):
        return  # Scene.links has connectors for it
    dofs = share.at(load.place)
    mine = share.owns(dofs)
    forces[share.local(dofs[mine])] += np.array([*load.force, load.moment])[mine]


@_add_forces.register
def _(load: LineLoad, share: Share, forces: Array) -> None:
    """All of it acts along a beam."""


@_add_forces.register
def _(load: Gravity, share: Share, forces: Array) -> None:
    scene = share.grid.scene
    heavy = [(one.place, one.mass) for one in scene.masses]
    heavy += [(one.middle, one.mass) for one in scene.bodies]
    for place, mass in heavy:
        g_x, g_y = load.acceleration
        _add_forces(PointLoad(place, force=(mass * g_x, mass * g_y)), share, forces)


def _along_beams(load: Load, share: Share) -> Array | None:
    """Forces on the nodes of cells with factor one; none if the load acts at a place."""
    grid = share.grid
    if isinstance(load, LineLoad):
        here = [beam is load.beam for beam in grid.scene.beams]
        per_beam = np.outer(here, [*load.force, load.moment])
    elif isinstance(load, Gravity):
        per_beam = np.outer([b.section.rhoA for b in grid.scene.beams], [*load.acceleration, 0.0])
    else:
        return None
    loads = per_beam[grid.beam_of_cell[share.cells]] * share.cell_lengths()[:, None]
    first, *between, last = grid.mesh.parts
    return np.kron(loads, [first, last, *between])
