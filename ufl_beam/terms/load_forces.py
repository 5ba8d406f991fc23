# SPDX-License-Identifier: MIT
"""Loads: dead loads, follower loads, centrifugal and Coriolis forces."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.compiled_forms import cached_forms
from ufl_beam.discretization.function_spaces import (
    Element,
    Fields,
    mass_kernel,
    mass_matrix,
    point_masses,
)
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.mechanics.kinematics import perpendicular, split
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.bodies import moves_with_node
from ufl_beam.model.functions import value_at
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.loads import FollowerLoad, Gravity, LineLoad, Load, PointLoad, RotatingFrame
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, InCells, Phases, Term


def load_terms(fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr) -> list[LoadTerm]:
    """Create the terms of the loads of a scene, one for all loads with the same kind of force."""
    subdomain, loads = fields.subdomain, fields.subdomain.numbering.scene.loads
    if loads:
        ledger.supplied["loads"] += 0.0
    followers = [load for load in loads if isinstance(load, FollowerLoad)]
    frames = [load for load in loads if isinstance(load, RotatingFrame)]
    strains = [load for load in loads if isinstance(load, ImposedStrain)]  # see imposed_strains.py
    dead = [load for load in loads if load not in (*followers, *frames, *strains)]
    terms: list[LoadTerm] = [FrameForces(x, fields, scheme, ledger, A) for x in frames]
    if dead:
        terms.append(DeadLoads(dead, subdomain, scheme, ledger))
    if followers:
        terms.append(FollowerLoads(followers, subdomain, scheme, ledger, A))
    return terms


class LoadTerm(Term):
    """Forces that depend on time or on the configuration.

    Attributes:
        vector: ``vector`` of loops.h: forces of the term; their norm is added to the force with
            which the convergence test compares the residual.
    """

    kind = "loads"
    vector: Any
    _scheme: Scheme
    _ledger: Ledger

    @abstractmethod
    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Begin at the time ``t``: take its loads as the loads before the first step; return them.

        The state ``q`` is assumed to be in equilibrium with these loads.  ``v`` are the velocities,
        None in statics.  ``past`` is the end of an earlier run of the same scene, if there is one.
        """

    def pass_on(self, archive: Archive) -> None:
        """Save the forces of the last step that :meth:`carry_on` cannot recompute."""


class _AtDofs(LoadTerm):
    """Loads that act at some degrees of freedom, with sizes that are functions of time.

    Attributes:
        dofs: Local degrees of freedom that are loaded on any process; the columns of ``_forces``.
    """

    _forces: Array  # (rows, dofs); the first row is in the step equation

    def _set_dofs(
        self, subdomain: Subdomain, loaded: Array, owners: Sequence[Load], rows: int
    ) -> None:
        """Set ``dofs`` to the nonzero entries of ``loaded`` on any process; create the forces."""
        # Other processes may load degrees of freedom that this process owns.
        self.dofs: Index = np.flatnonzero(subdomain.added(loaded)).astype(np.int32)
        self._size, self._in_time = subdomain.size, [(load.amplitude, load) for load in owners]
        self._forces = np.zeros((rows, len(self.dofs)))
        self.vector = struct("vector", size=len(self.dofs), dof=self.dofs, values=self._forces[0])

    def _factors_at(self, t: float) -> Array:
        return np.array([value_at(function, t, load) for function, load in self._in_time])

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
        # Forces in the equation, and at the end of the last step.
        self._set_dofs(subdomain, np.any(whole, axis=0) * 1.0, owners, rows=2)
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

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the loads before the next step to the loads at the time ``t``, and return them."""
        self._factors[:3] = factors = self._factors_at(t)
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
        beam_cells = numbering.cells_of(load.beam)
        loaded = np.flatnonzero((cells >= beam_cells[0]) & (cells <= beam_cells[-1]))
        s = numbering.gauss_parameters(load.beam)[cells[loaded] - beam_cells[0]]
        shares, density = load.factors(s) @ mesh.gauss[1], [*load.force, load.moment]
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
    for place, force in at_places:
        if moves_with_node(place):  # else a connector of Scene.all_connectors applies the force
            dofs = numbering.node(place)
            mine = subdomain.owns(dofs)
            forces[subdomain.local(dofs[mine])] += np.array(force)[mine]
    if loaded is None:
        return None
    first, *between, last = (numbering.lengths(cells[loaded])[:, None] * shares).T
    return loaded, np.kron(density, np.column_stack([first, last, *between]))


class FollowerLoads(_AtDofs):
    """Forces that rotate with the cross-section on which they act."""

    def __init__(
        self,
        loads: Sequence[FollowerLoad],
        subdomain: Subdomain,
        scheme: Scheme,
        ledger: Ledger,
        A: Csr,
    ) -> None:
        self._ledger = ledger
        indices = [i for i, load in enumerate(loads) if subdomain.computes(load.place)]
        owners = [loads[i] for i in indices]
        self._indices: Index = np.array(indices, dtype=np.int64)
        places = [subdomain.local(subdomain.numbering.node(load.place)) for load in owners]
        dofs = np.array(places, dtype=np.int32).reshape(-1, 3)
        x, y, self._turning = np.ascontiguousarray(dofs.T)
        loaded: Array = np.zeros(subdomain.size)
        loaded[dofs] = 1.0
        # Forces in the latest residual, and in the residual of the last step.
        self._set_dofs(subdomain, loaded, owners, rows=2)
        forces = [[*load.force, load.moment] for load in owners]
        self._unit_forces = np.array(forces, dtype=np.float64).reshape(-1, 3)
        # Sizes in the equation, at the end of the step, and at the end of the last step.
        self._sizes = np.zeros((3, *self._unit_forces.shape))
        self._rotations, self._A = np.zeros(len(indices)), A
        self._c = struct(
            "follower_loads", number=len(indices), size=len(self.dofs), dof=self.dofs,
            at=np.searchsorted(self.dofs, dofs).astype(np.int32), given=self._unit_forces,
            turning=self._turning, turn0=self._rotations, part=scheme.load_weight,
            now=self._sizes[0], end=self._sizes[1], before=self._sizes[2],
            x=A.positions(x, self._turning), y=A.positions(y, self._turning),
            force=self._forces[0], force_before=self._forces[1],
            weight_of_before=scheme.weight_of_before,
        )  # fmt: skip
        tangent = loop("add_tangent_of_follower_loads", self._c)
        self.loops = loop("subtract_follower_loads", self._c), tangent

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step."""
        c = fill(self._c, factor=callbacks.time_functions(self._in_time))
        c.work = self._ledger.supplied.pointer("loads")
        return Phases([loop("begin_follower_loads", c)], [loop("accept_follower_loads", c)])

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the loads before the next step to the loads at the time ``t``, and return them."""
        self._sizes[:] = self._unit_forces * self._factors_at(t).reshape(-1, 1)
        self._rotations[:] = q[self._turning]
        self.add_residual(q, np.zeros(self._size))
        self._forces[1] = self._forces[0]
        return self._whole(self._forces[0])

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the forces in the equation of the last step, and sizes at its end."""
        self._forces[:] = archive.added("follower loads", self._whole(self._forces[1]))[self.dofs]
        self._sizes[:] = archive.rows("follower loads", self._indices, self._sizes[2])


@cached_forms
def _turned_mass(element: Element) -> ufl.Form:
    (u, _), (w_u, _) = split(ufl.TrialFunction(element.space)), split(element.w)
    return element.inertia[0] * ufl.dot(perpendicular(u), w_u) * element.dx_of_mass()


class FrameForces(LoadTerm):
    """Centrifugal forces, which have a potential, and Coriolis forces, which do no work.

    Rotary inertia causes no further moments, because a constant rate of the frame adds a constant
    to the angular velocity of a cross-section.
    """

    def __init__(
        self, frame: RotatingFrame, fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr
    ) -> None:
        subdomain = fields.subdomain
        self._ledger = ledger
        # G v is the mass matrix times velocities turned by 90°; the Coriolis force is -2 Ω G v
        S, G = mass_matrix(fields), fields.assembled(_turned_mass(fields.element))
        for at, mass, _ in point_masses(subdomain.numbering.scene):
            dofs = subdomain.numbering.node(at)[:2]
            if subdomain.owns(dofs).all():
                u, v = subdomain.local(dofs)
                G.data[G.positions(np.array([u, v]), np.array([v, u]))] += (-mass, mass)
        coriolis = 2 * frame.rate if has_inertia(scheme) else 0.0
        S.data[np.isin(S.rows(), subdomain.rotations)] = 0.0
        S.data *= frame.rate**2
        G.data *= coriolis
        self._matrices, self._A = (Product(S), Product(G)), A
        x, y = (np.ascontiguousarray(axis, dtype=np.int32) for axis in subdomain.translations())
        # Vectors from the centre of rotation to all nodes.  Nodes of beams are written last: if
        # they are joined to the ground, they share its freedoms, but are not at its centre.
        numbering, from_axis = subdomain.numbering, np.zeros(subdomain.numbering.size)
        centers = np.array([body.center for body in numbering.scene.rigid_bodies]).reshape(-1, 2)
        points = np.concatenate([centers, numbering.points]) - frame.about
        from_axis[np.concatenate([numbering.dofs_of_bodies, numbering.dofs])[:, :2]] = points
        change, place, space, self._force, self._before, rest = np.zeros((6, subdomain.size))
        accelerations = ffi.new("double *[1]", [doubles(rest)])
        self._rest = rest, accelerations
        self.vector = struct("vector", size=subdomain.size, values=self._force)
        c = self._c = struct(
            "rotating_frame", size=subdomain.size, entries=len(A.data), places=len(x), x=x, y=y,
            pull=self._matrices[0].c, turn=self._matrices[1].c, pulls=S.data, turns=G.data,
            from_centre=from_axis[subdomain.dofs], rate=frame.rate, coriolis=coriolis,
            part=scheme.load_weight, weight_of_before=scheme.weight_of_before, change=change,
            place=place, space=space, force=self._force, before=self._before,
            accelerations=accelerations,
        )  # fmt: skip
        self.loops = loop("subtract_frame_forces", c), loop("add_tangent_of_frame", c)
        at_cells = fields.order, accelerations
        self.in_cells = [InCells(partial(mass_kernel, fields), lib.DENSITY, *at_cells)]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step."""
        self._c.work = self._ledger.supplied.pointer("loads")
        return Phases([loop("begin_frame", self._c)], [loop("accept_frame", self._c)])

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the forces before the next step to the forces at ``q``, and return them."""
        self._c.grown = 1.0
        still = np.zeros(len(q))
        step = struct("time_step", q0=q, dt=math.inf, fraction=1.0, at=1.0)
        lib.begin_frame(self._c, step, ffi.NULL, ffi.NULL)
        self.add_residual(q, np.zeros(len(q)))
        lib.accept_frame(self._c, step, doubles(q), doubles(still))
        return self._force.copy()

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the forces of the last step, and the load factor at its end."""
        self._force[:] = self._before[:] = archive.added("rotating frame", self._before)
        self._c.grown = archive.number("growth of the rotating frame", self._c.grown)
