# SPDX-License-Identifier: MIT
"""Loads: dead loads, moving loads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.function_spaces import (
    Fields,
    point_masses,
)
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import ArgumentError
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.bodies import moves_with_node
from ufl_beam.model.functions import value_at
from ufl_beam.model.loads import (
    Gravity,
    LineLoad,
    Load,
    LoadAlongBeam,
    MovingLoad,
    PointLoad,
)
from ufl_beam.terms.derivatives import Each, Neighbours, differences, in_c
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, InCells, LoadTerm, NodeForces, Phases


def load_terms(
    fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr, rates: Any
) -> list[LoadTerm]:
    """Create the terms of the loads of a scene, one for all loads with the same kind of force.

    ``rates`` of loops.h are the rates of the scene; None in statics.
    """
    subdomain, loads = fields.subdomain, fields.subdomain.numbering.scene.loads
    if loads:
        ledger.supplied["loads"] += 0.0
    moving = [load for load in loads if isinstance(load, MovingLoad)]
    dead = [load for load in loads if load.dead and load not in moving]
    terms = list[LoadTerm]()
    if dead:
        terms.append(DeadLoads(dead, subdomain, scheme, ledger))
    if moving:
        terms.append(MovingLoads(moving, subdomain, scheme, ledger, A, rates))
    return terms


class _AtDofs(LoadTerm):
    """Loads that act at some degrees of freedom, with sizes that are functions of time.

    Attributes:
        dofs: Local degrees of freedom that are loaded on any process; the columns of ``_forces``.
    """

    _scheme: Scheme
    _ledger: Ledger
    _forces: Array  # (2, dofs): in the step equation, and at the end of the last step

    def _set_dofs(self, subdomain: Subdomain, loaded: Array, owners: Sequence[Load]) -> None:
        """Set ``dofs`` to the nonzero entries of ``loaded`` on any process; create the forces."""
        # Other processes may load degrees of freedom that this process owns.
        self.dofs: Index = np.flatnonzero(subdomain.added(loaded)).astype(np.int32)
        self._size, self._in_time = subdomain.size, [(load.amplitude, load) for load in owners]
        self._forces = np.zeros((2, len(self.dofs)))
        self.vector = struct("vector", size=len(self.dofs), dof=self.dofs, values=self._forces[0])

    def _whole(self, forces: Array) -> Array:
        """Return forces at all local degrees of freedom from forces at the loaded ones."""
        whole: Array = np.zeros(self._size)
        whole[self.dofs] = forces
        return whole


class DeadLoads(_AtDofs):
    """Forces and moments that keep their direction: vectors times functions of time."""

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
            if (in_some := _add_dead_load(load, subdomain, vector)) is not None:
                cells, on_nodes = in_some
                in_cells.setdefault(key, np.zeros(subdomain.cell_dofs.shape))[cells] += on_nodes
        for key, along in in_cells.items():
            np.add.at(vectors[key][1], subdomain.cell_dofs, along)
        owners, whole = zip(*vectors.values(), strict=True)
        self._set_dofs(subdomain, np.any(whole, axis=0) * 1.0, owners)
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

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        parameters, number = neighbours.weights.shape
        now, end = np.zeros((2, parameters, self._size))
        before = neighbours.state(lambda term: term._whole(term._forces[1]))
        loads = ffi.new("dead_loads *[]", [x._c for some in neighbours.terms for x in some])
        c = struct(
            "load_derivatives", parameters=parameters, size=self._size, neighbours=number,
            loads=self._c, own=np.zeros(self._size), neighbour=loads, weight=neighbours.weights,
            now=now, end=end, before=before,
        )  # fmt: skip
        return [in_c("load", c)]

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


def _add_dead_load(load: Load, subdomain: Subdomain, forces: Array) -> tuple[Index, Array] | None:
    """Add the concentrated forces of a dead load with the factor 1 to ``forces``.

    Returns:
        Local cells with forces along them, (n,), and consistent forces on the nodes of these cells,
        (n, dofs of a cell); None if there are none.
    """
    numbering, cells = subdomain.numbering, subdomain.cells
    mesh, at_places, loaded = numbering.mesh, [], None
    if isinstance(load, PointLoad):
        at_places = [(load.place, (*load.force, load.moment))]
    elif isinstance(load, LineLoad):
        loaded, factors = loaded_cells(load, subdomain)
        shares, density = factors @ mesh.gauss[1], [*load.force, load.moment]
    elif isinstance(load, Gravity):
        g_x, g_y = load.acceleration
        at_places = [
            (at, (mass * g_x, mass * g_y, 0.0)) for at, mass, _ in point_masses(numbering.scene)
        ]
        rhoA = np.array([beam.section.rhoA for beam in numbering.scene.beams])
        loaded = np.arange(len(cells))
        shares = np.outer(rhoA[numbering.beam_of_cell[cells]], mesh.fractions)
        density = [g_x, g_y, 0.0]
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


class MovingLoads(_AtDofs):
    """Forces and masses that move along beams: consistent nodal forces of the cell of each.

    A mass has the velocity of the point of the axis that it is at: v = ṙ + ṡ r', of the
    displacements alone.  Its momentum is a state of its own, so that it gains at a kink of the
    axis, between two cells, what the axis loses, and r'' is not needed.  The time scheme gives it
    the acceleration that fits these velocities.
    """

    def __init__(
        self,
        loads: Sequence[MovingLoad],
        subdomain: Subdomain,
        scheme: Scheme,
        ledger: Ledger,
        A: Csr,
        rates: Any,
    ) -> None:
        self._ledger, numbering, mesh = ledger, subdomain.numbering, subdomain.numbering.mesh
        self._scheme, self._counts = scheme, float(subdomain.comm.rank == 0)
        self._positions = [(load.position, load) for load in loads]
        cells = [np.concatenate([numbering.cells_of(x) for x in load.route]) for load in loads]
        order: Index = np.flatnonzero(np.isin(subdomain.cells, np.concatenate(cells)))
        self._cells: Index = subdomain.cells[order]
        number = np.full(len(numbering.cells), -1, dtype=np.int32)
        number[self._cells] = np.arange(len(order))
        along = [np.append(0.0, np.cumsum(numbering.lengths(x))) for x in cells]
        dofs = subdomain.cell_dofs[order, : 2 * len(mesh.nodes)]
        loaded: Array = np.zeros(subdomain.size)
        loaded[dofs] = 1.0
        self._set_dofs(subdomain, loaded, loads)
        # On cells: in the equation, at the end of the step, before the step
        self._on_cells = np.zeros((3, *dofs.shape))
        each, second = np.zeros((2, len(order), 3 * len(mesh.nodes)))
        self._each = ffi.new("double *[1]", [doubles(each)]), each
        ends = np.concatenate([np.column_stack([x[:-1], x[1:]]) for x in along])
        forces, mass = (np.array([getattr(x, name) for x in loads]) for name in ("force", "mass"))
        self._c = struct(
            "moving_loads", loads=len(loads), cells=len(order), nodes=len(mesh.nodes),
            size=len(self.dofs), dof=self.dofs,
            at=np.searchsorted(self.dofs, dofs).astype(np.int32),
            first=np.cumsum([0, *map(len, cells)]).astype(np.int32),
            cell=np.concatenate([number[x] for x in cells]),
            ends=ends,
            polynomial=mesh.polynomials[:, mesh.order].T.copy(),
            given=forces, now=self._on_cells[0],
            end=self._on_cells[1], before=self._on_cells[2], each=self._each[0],
            force=self._forces[0], force_before=self._forces[1],
            weight_of_before=scheme.weight_of_before,
        )  # fmt: skip
        self._A, tangent, self._kinetic = A, None, np.zeros(len(loads))
        self._state, self._on = np.zeros((len(loads), lib.MOST_RATES, 2)), np.zeros(len(loads), "i")
        points = numbering.points[numbering.nodes_of_cells[self._cells]]
        places = (points - points[:, :1]).transpose(0, 2, 1).reshape(dofs.shape)
        self._mass, self._heavy = mass, rates is not None and bool(mass.any())
        if self._heavy:
            both = dofs.reshape(len(order), 2, len(mesh.nodes))  # x and y
            rows, columns = np.broadcast_arrays(both[..., None], both[:, :, None])
            fill(
                self._c, rates=rates, mass=mass, kinetic=self._kinetic, state=self._state,
                on=self._on, here=np.full(len(loads), lib.OFF, dtype=np.int32),
                motion=np.zeros((len(loads), 2)), freedom=dofs.astype(np.int32),
                entry=A.positions(rows.ravel(), columns.ravel()), place=places,
                part=scheme.load_weight, totals=ffi.new("int[]", self._state.size),
                space=np.zeros(4 * self._state.size),
            )  # fmt: skip
            tangent = loop("add_tangent_of_moving_masses", self._c)
        self.loops = loop("subtract_moving_loads", self._c), tangent
        entries = NodeForces(self._each[0], 1, second)
        self.in_cells = [InCells(lambda: entries, lib.DENSITY, order)]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step."""
        self._callbacks = callbacks
        c = fill(
            self._c, factor=callbacks.time_functions(self._in_time), equation=callbacks.c,
            position=callbacks.time_functions(self._positions),
        )  # fmt: skip
        c.work, c.run = self._ledger.supplied.pointer("loads"), c
        energies = []
        if self._heavy:
            c.stored = self._ledger.state.pointer("kinetic")
            energies = [loop("add_energy_of_moving_masses", c)]
        return Phases([loop("begin_moving_loads", c)], [loop("accept_moving_loads", c)], energies)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        parameters, number = neighbours.weights.shape
        own = {"run": self._c, "rates": self._c.rates, "state": self._state, "on": self._on}
        others = [fill(x._c, **own) for some in neighbours.terms for x in some]
        change = neighbours.differences(lambda term: term._mass)
        if has_inertia(self._scheme) and change[:, self._mass == 0.0].any():
            raise ArgumentError(
                "differentiate: a moving load has no mass for the value of a parameter; choose "
                "another value"
            )
        c = struct(
            "moving_derivatives", parameters=parameters, neighbours=number, loads=self._c,
            neighbour=ffi.new("moving_loads *[]", others), weight=neighbours.weights,
            nowhere=np.zeros(self._on_cells[0].size), state_bar=np.zeros(self._state.shape),
            moved_bar=np.zeros((len(self._mass), 2)),
            state=neighbours.state(lambda term: term._state),
        )  # fmt: skip
        by_numbers = differences(neighbours, lambda term: [term._on_cells[2]])
        return [by_numbers, in_c("moving_loads", c)]

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the loads before the next step to the loads at the time ``t``, and return them.

        Masses have no acceleration before the first step, if there is no ``past``.
        """
        step = struct("time_step", load_time=t, fraction=1.0, at=1.0, dt=1.0)
        rates, self._c.rates = self._c.rates, ffi.NULL
        lib.begin_moving_loads(self._c, step, ffi.NULL, ffi.NULL)
        self._callbacks.synchronize()
        self._on_cells[2] = self._on_cells[0]
        self.add_residual(q, np.zeros(self._size))
        self._c.rates = rates
        if v is not None:
            self.begin_energy(t, q, v)
        self._forces[1] = self._forces[0]
        if past is not None and past.has("moving masses"):
            self._forces[1] = past.added("moving masses", self._whole(self._forces[1]))[self.dofs]
            self._masses_in(past)
        return self._whole(self._forces[0])

    def begin_energy(self, t: float, q: Array, v: Array) -> None:
        """Set the kinetic energies of the masses at the time ``t``."""
        if self._heavy:
            lib.start_moving_masses(self._c, t, doubles(q))
            self._callbacks.synchronize()

    def pass_on(self, archive: Archive) -> None:
        """Save the rates of the masses, and the forces of the last step, to which they add."""
        if self._heavy:
            archive.added("moving masses", self._whole(self._forces[1]))
            self._masses_in(archive)

    def prepare(self, q1: Array) -> None:
        """Take further rates of the masses from a trial step."""
        if self._heavy:
            lib.take_rates_of_masses(self._c, doubles(q1))

    def _masses_in(self, archive: Archive) -> None:
        """Save or restore which masses are on the beams, their rates and kinetic energies."""
        rates = np.column_stack([self._on, self._state.reshape(len(self._on), -1)])
        rates = archive.rows("rates of moving masses", np.arange(len(rates)), rates, known=True)
        self._on[:], self._state[:] = rates[:, 0], rates[:, 1:].reshape(self._state.shape)
        v = self._state[:, 1] * self._counts  # on one process only
        self._kinetic[:] = self._mass / 2 * (v * v).sum(axis=1)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the forces in the equation of the last step, and at its end."""
        self._forces[:] = archive.added("moving loads", self._whole(self._forces[1]))[self.dofs]
        self._on_cells[:] = archive.rows("moving loads", self._cells, self._on_cells[2])
        self._masses_in(archive)
