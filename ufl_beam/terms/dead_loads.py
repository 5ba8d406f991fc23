# SPDX-License-Identifier: MIT
"""Dead loads: vectors of nodal forces, which cost nothing in an iteration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, loop, struct
from ufl_beam.discretization.function_spaces import point_masses
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.bodies import moves_with_node
from ufl_beam.model.functions import same_function, value_at
from ufl_beam.model.loads import Gravity, LineLoad, Load, LoadAlongBeam, MovingLoad, PointLoad
from ufl_beam.terms.derivatives import Each, Neighbours
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, LoadTerm, Phases


def dead_loads(subdomain: Subdomain, scheme: Scheme, ledger: Ledger) -> list[LoadTerm]:
    """Create the term of the dead loads of a scene, if there are any."""
    scene = subdomain.numbering.scene
    if scene.loads:
        ledger.supplied["loads"] += 0.0
    loads = [load for load in scene.loads if load.dead and not isinstance(load, MovingLoad)]
    return [DeadLoads(loads, subdomain, scheme, ledger)] if loads else []


class DeadLoads(LoadTerm):
    """Forces and moments that keep their direction: vectors times functions of time.

    Attributes:
        dofs: Local degrees of freedom that are loaded on any process; the columns of ``_forces``.
    """

    def __init__(
        self, loads: Sequence[Load], subdomain: Subdomain, scheme: Scheme, ledger: Ledger
    ) -> None:
        self._scheme, self._ledger = scheme, ledger
        # Loads with the same time function share a vector; messages name the first load.  Keys are
        # identities, because functions need not be hashable.
        vectors: dict[int, tuple[Load, Array]] = {}
        in_cells: dict[int, Array] = {}
        for load in loads:
            key = id(load.amplitude)
            _, vector = vectors.setdefault(key, (load, np.zeros(subdomain.size)))
            if (in_some := add_dead_load(load, subdomain, vector)) is not None:
                cells, on_nodes = in_some
                in_cells.setdefault(key, np.zeros(subdomain.cell_dofs.shape))[cells] += on_nodes
        for key, along in in_cells.items():
            np.add.at(vectors[key][1], subdomain.cell_dofs, along)
        owners, whole = zip(*vectors.values(), strict=True)
        # Other processes may load degrees of freedom that this process owns.
        loaded = subdomain.added(np.any(whole, axis=0) * 1.0)
        self.dofs: Index = np.flatnonzero(loaded).astype(np.int32)
        self._size, self._in_time = subdomain.size, [(load.amplitude, load) for load in owners]
        # In the step equation, and at the end of the last step
        self._forces = np.zeros((2, len(self.dofs)))
        self.vector = struct("vector", size=len(self.dofs), dof=self.dofs, values=self._forces[0])
        self._vectors = [vector[self.dofs] for vector in whole]
        # Rows: factors in the equation of this step, at its end, at its beginning, and in the
        # equation of the previous step.
        self._factors: Array = np.zeros((4, len(vectors)))
        self._along = [in_cells.get(key) for key in vectors]
        self.loops = loop("subtract_vector", self.vector), None

    def loads_in_cells(self) -> Any:
        """Return ``loads_in_cells`` of loops.h; null if no load acts along beams."""
        if not any(along is not None for along in self._along):
            return ffi.NULL
        along = [ffi.NULL if forces is None else doubles(forces) for forces in self._along]
        c = struct(
            "loads_in_cells", vectors=len(along), vector=ffi.new("double *[]", along),
            latest=self._factors[0], accepted=self._factors[3],
        )  # fmt: skip
        return ffi.gc(c, lambda _, alive=(c, along): None)  # solutions outlive the term

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step."""
        number = len(self._vectors)
        c = self._c = struct(
            "dead_loads", size=len(self.dofs), dof=self.dofs, vectors=number,
            force=self._forces[0], before=self._forces[1], factors=self._factors[0],
            factors_at_end=self._factors[1], factors_before=self._factors[2],
            asked=np.full(number, math.nan), factor=callbacks.time_functions(self._in_time),
            vector=ffi.new("double *[]", [doubles(vector) for vector in self._vectors]),
            work=self._ledger.supplied.pointer("loads"),
            weight_of_before=self._scheme.weight_of_before,
        )  # fmt: skip
        return Phases([loop("begin_dead_loads", c)], [loop("accept_dead_loads", c)])

    @property
    def parts(self) -> object:
        """See the base class: the number of functions of time."""
        return type(self), len(self._vectors)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        P, number = len(neighbours), len(self._vectors)
        now, end = np.zeros((2, P, self._size))
        before = neighbours.state(lambda term: term._whole(term._forces[1]))
        changes = [
            (p, v, change.copy())
            for v in range(number)
            for p, change in enumerate(neighbours.differences(partial(_vector, v)))
            if change.any()
        ]
        parameter, vector = (np.array([x[k] for x in changes], dtype=np.int32) for k in (0, 1))
        rows = np.reshape([x[2] for x in changes], (-1, self._size))
        dofs = np.flatnonzero(rows.any(axis=0)).astype(np.int32)
        loads = ffi.new("dead_loads *[]", [x._c for some in neighbours.terms for x in some])
        enters = np.zeros(P, dtype=np.int32)
        enters[parameter] = 1
        for p, some in enumerate(neighbours.terms):
            pairs = (x for term in some for x in zip(self._in_time, term._in_time, strict=True))
            enters[p] |= not all(same_function(a, b) for (a, _), (b, _) in pairs)
        c = struct(
            "load_derivatives", parameters=P, size=self._size, neighbours=neighbours.number,
            loads=self._c, number=len(rows), loaded=len(dofs), parameter=parameter, vector=vector,
            dof=dofs, change=rows.take(dofs, axis=1), factor=np.zeros(number),
            by_factor=np.zeros((P, number)), neighbour=loads, weight=neighbours.weights,
            now=now, end=end, before=before, enters=enters,
            vector_bar=np.zeros((number, len(dofs))),
        )  # fmt: skip
        return [("load", c)]

    def _whole(self, forces: Array) -> Array:
        """Return forces at all local degrees of freedom from forces at the loaded ones."""
        whole: Array = np.zeros(self._size)
        whole[self.dofs] = forces
        return whole

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the loads before the next step to the loads at the time ``t``, and return them."""
        factors = np.array([value_at(function, t, load) for function, load in self._in_time])
        self._factors[:3] = factors
        self._forces[:] = sum(f * vector for f, vector in zip(factors, self._vectors, strict=True))
        return self._whole(self._forces[0])

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the forces at the end of the last step, and their factors."""
        self._forces[:] = archive.added("dead loads", self._whole(self._forces[1]))[self.dofs]
        for k, factor in enumerate(self._factors[2]):
            self._c.asked[k] = math.nan
            self._factors[2, k] = archive.number(f"part of dead loads {k}", factor)


def _vector(v: int, term: DeadLoads) -> Array:
    """Return the forces of loads with the same function of time, at its value 1."""
    return term._whole(term._vectors[v])


def add_dead_load(load: Load, subdomain: Subdomain, forces: Array) -> tuple[Index, Array] | None:
    """Add the concentrated forces of a dead load with the factor 1 to ``forces``.

    Returns:
        Local cells with forces along them, (n,), and consistent forces on the nodes of these cells,
        (n, dofs of a cell); None if there are none.
    """
    numbering, cells = subdomain.numbering, subdomain.cells
    mesh, at_places, loaded = numbering.mesh, [], None
    # In space, moments at places are statements, and there are none along beams
    moment = [0.0] * 3 if numbering.scene.in_space else [getattr(load, "moment", 0.0)]
    if isinstance(load, PointLoad):
        force = (*load.force, 0.0)[: numbering.displacements]
        at_places = [(load.place, (*force, *moment))]
    elif isinstance(load, LineLoad):
        loaded, factors = loaded_cells(load, subdomain)
        shares, density = factors @ mesh.gauss[1], [*load.force, *moment]
    elif isinstance(load, Gravity):
        density = [*load.acceleration, *moment]
        at_places = [
            (at, tuple(mass * g for g in density)) for at, mass, _ in point_masses(numbering.scene)
        ]
        rhoA = np.array([beam.section.rhoA for beam in numbering.scene.beams])
        loaded = np.arange(len(cells))
        shares = np.outer(rhoA[numbering.beam_of_cell[cells]], mesh.fractions)
    else:
        raise TypeError(f"{type(load).__name__} is not a dead load")
    # Connectors of Scene.all_connectors apply the forces at other places.
    at_nodes = [(numbering.node(at), force) for at, force in at_places if moves_with_node(at)]
    dofs = np.array([node for node, _ in at_nodes], dtype=np.int32).ravel()
    mine = subdomain.owns(dofs)
    nodal = np.array([force for _, force in at_nodes], dtype=np.float64).ravel()
    np.add.at(forces, subdomain.local(dofs[mine]), nodal[mine])
    if loaded is None:
        return None
    first, *between, last = (numbering.lengths(cells[loaded])[:, None] * shares).T
    along = np.column_stack([first, last, *between])
    return loaded, np.hstack([component * along for component in density])


def loaded_cells(load: LoadAlongBeam, subdomain: Subdomain) -> tuple[Index, Array]:
    """Return the local cells of the loaded beam, and the profile at their Gauss points, (n, 4)."""
    numbering, cells = subdomain.numbering, subdomain.cells
    beam_cells = numbering.cells_of(load.beam)
    loaded = np.flatnonzero((cells >= beam_cells[0]) & (cells <= beam_cells[-1]))
    s = numbering.gauss_parameters(load.beam)[cells[loaded] - beam_cells[0]]
    return loaded, load.factors(s)
