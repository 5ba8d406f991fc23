# SPDX-License-Identifier: MIT
"""States at successive times and their results: motions, forces, material, momenta."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.compiled.csr import Product
from ufl_beam.discretization.cell_functions import mass_matrix, strains_of
from ufl_beam.discretization.cells_in_space import (
    STIFFNESS_IN_SPACE,
    TURNS,
    CellsOfState,
    cell_axes,
    lost_numbers,
    momentum,
    rotated,
    rotation_from,
    rotation_vectors,
    turned_further,
    turns_at,
    velocity_at,
)
from ufl_beam.discretization.dof_numbering import DofNumbering, turned, values_at
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.errors import ArgumentError, require_number
from ufl_beam.model.bodies import AttachmentPoint, BodyPoint, Member, Place, arm
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import value_at
from ufl_beam.model.joints import Joint
from ufl_beam.model.loads import Gravity, LineLoad, MovingLoad, Pressure, RotatingFrame
from ufl_beam.model.scene import index_of
from ufl_beam.model.supports import Support
from ufl_beam.output.output_files import require_arrays
from ufl_beam.output.section_forces import (
    MIDDLE,
    Diagram,
    DiagramInSpace,
    ForcesAlongCells,
    Material,
)
from ufl_beam.output.state_rows import (
    BEFORE,
    FORCE,
    FORCES,
    HINGE,
    JUMP,
    LEDGER,
    PLASTIC,
    RECORD,
    Block,
    Column,
    Columns,
    Connection,
    JointHistory,
    connection,
    connector_indices,
    signs_on_second_place,
)
from ufl_beam.quadrature import gauss_rule
from ufl_beam.terms.dead_loads import add_dead_load, loaded_cells
from ufl_beam.terms.energy_ledger import Energy

LEAST_ROWS, MOST_VALUES = 8, 2**17
"""Least number of rows of a new block, and largest number of values in a block.  Small blocks fit
into memory that the process already has.  The first access to new memory takes a considerable
fraction of the time of a step."""

SHORTEST_CHORD = 1e-5
"""Length of a chord of a guide whose direction has few digits, as a fraction of the size."""


NO_STATE = (
    "no state is stored; keep() of a Simulation stores the present one, snapshot() returns it as a "
    "solution for start="
)


class Cells:
    """Objects that compute results of all cells of a scene; each is created at its first access.

    The computations need no communication between processes.
    """

    def __init__(self, numbering: DofNumbering) -> None:
        self.numbering = numbering

    @cached_property
    def fields(self) -> Fields:
        """Fields on all cells."""
        return Fields(Subdomain(self.numbering, MPI.COMM_SELF))

    @cached_property
    def strains(self) -> Callable[[Array], Array]:
        """Function that computes the strains of all cells, see :func:`strains_of`."""
        return strains_of(self.fields)

    @cached_property
    def axes(self) -> tuple[Array, Array]:
        """Lengths and axes of cells in space, see :func:`cell_axes`."""
        return cell_axes(self.fields)

    @cached_property
    def dead_loads(self) -> list[tuple[Any, Array]]:
        """Dead loads along beams in space, and their forces on nodes of cells; (n, 2, 3); N."""
        found, none = list[tuple[Any, Array]](), np.zeros(self.numbering.size)
        for load in self.numbering.scene.loads:
            if isinstance(load, Gravity | LineLoad):
                some = add_dead_load(load, self.fields.subdomain, none)
                along: Array = np.zeros((len(self.numbering.cells), 6, 2))
                if some is not None:
                    along[some[0]] = some[1].reshape(-1, 6, 2)
                found.append((load, along[:, :3].transpose(0, 2, 1)))
        return found

    def loads_in_space(self, t: float, q: Array, state: CellsOfState) -> Array:
        """Return the forces of loads along cells on their nodes, without inertia; (n, 2, 3); N."""
        numbering, subdomain = self.numbering, self.fields.subdomain
        found: Array = np.zeros((len(numbering.cells), 2, 3))
        for load, forces in self.dead_loads:
            found += value_at(load.amplitude, t, load) * forces
        for load in numbering.scene.loads:
            if isinstance(load, Pressure | MovingLoad):
                factor = value_at(load.amplitude, t, load)
            if isinstance(load, Pressure):
                (cells, profile), (s, weights) = loaded_cells(load, subdomain), gauss_rule(4)
                shares = factor * profile @ (weights * [1 - s, s]).T
                force = state.forces_on_axis((load.tangential, *np.broadcast_to(load.normal, 2)))
                found[cells] += shares[:, :, None] * force[cells, None]
            elif isinstance(load, RotatingFrame):
                moved = numbering.points + q[numbering.dofs[: len(numbering.points), :3]]
                arms = moved[numbering.cells] - (*load.about, 0.0)[:3]
                masses = state.lengths * self.fields.section_values("rhoA")[:, 0]
                accelerations = -np.cross(load.rate, np.cross(load.rate, arms))
                found += masses[:, None, None] * ((1 + np.eye(2)) / 6 @ accelerations)
            elif isinstance(load, MovingLoad):
                cells = np.concatenate([numbering.cells_of(beam) for beam in load.route])
                ends = np.append(0.0, np.cumsum(numbering.lengths(cells)))
                distance = value_at(load.position, t, load)
                if 0.0 <= distance <= ends[-1]:
                    k = max(int(np.searchsorted(ends, distance)) - 1, 0)
                    s = (distance - ends[k]) / (ends[k + 1] - ends[k])
                    found[cells[k]] += factor * np.outer((1 - s, s), (*load.force, 0.0)[:3])
        return found

    @cached_property
    def along(self) -> ForcesAlongCells:
        """Object that computes the section forces of all cells."""
        return ForcesAlongCells(self.numbering)


class States:
    """States of a scene at n+1 times, for the solution of a run and for the present state.

    Attributes:
        scene: Model.
        numbering: Vertices, cells and degrees of freedom of the scene.
        equilibrium_fraction: Instant of equilibrium in a step, as a fraction of the step.
        needs_start: True if forces depend on the configuration at the beginning of the step.
        cells: Objects that compute section forces and strains of all cells.
        forces_from_record: Function that computes :meth:`cell_resultants` from a record, q, and q
            at the beginning of the step.
    """

    equilibrium_fraction = 1.0
    needs_start = False
    forces_from_record: Callable[[Array, Array, Array], Array] | None = None

    def __init__(self, numbering: DofNumbering, like: States | None = None, *blocks: Block) -> None:
        self.numbering, self.scene = numbering, numbering.scene
        self.cells = Cells(numbering)
        self._blocks = [*blocks]
        self._computed: tuple[tuple[int, bytes], Array] | None = None  # latest `cell_forces`
        if like is not None:
            self.cells, self.forces_from_record = like.cells, like.forces_from_record
            self.equilibrium_fraction, self.needs_start = (
                like.equilibrium_fraction,
                like.needs_start,
            )

    # -- rows ----------------------------------------------------------------------------------

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Rows of the states."""
        return tuple(self._blocks)

    def free_rows(self, columns: Columns, number: int = 1) -> Array:
        """Return up to ``number`` free rows after the last state; :meth:`grow` makes them states.

        Blocks are never copied to a larger block, because freed memory may stay with the process.
        """
        block = self._blocks[-1] if self._blocks else None
        if (
            block is None
            or (block.columns is not columns and block.columns.at != columns.at)
            or block.number == len(block.space)
        ):
            most = MOST_VALUES // columns.width
            rows = max(number, min(max(len(self), LEAST_ROWS), most))
            block = Block(columns, np.zeros((rows, columns.width)), 0)
            self._blocks.append(block)
        return block.space[block.number : block.number + number]

    def grow(self, number: int = 1) -> None:
        """Append ``number`` states, which were written into :meth:`free_rows`."""
        self._blocks[-1].number += number

    def append(self, columns: Columns, *pieces: Array) -> None:
        """Append a state: a row with these ``columns``, in one or several ``pieces``."""
        np.concatenate(pieces, out=self.free_rows(columns)[0])
        self.grow()

    def subset(self, first: int, last: int) -> States:
        """Return the states from ``first`` to ``last - 1`` as views."""
        blocks, end = [], 0
        for block in self._blocks:
            begin, end = end, end + block.number
            rows = block.rows[max(first - begin, 0) : max(last - begin, 0)]
            blocks.append(Block(block.columns, rows, len(rows)))
        return States(self.numbering, self, *blocks)

    def downsample(self) -> None:
        """Delete every second state; the first state remains."""
        states, self._blocks, self._computed = self.subset(0, len(self)), [], None
        for n in range(0, len(states), 2):
            columns, *pieces = states.row(n)
            if states.needs_start and BEFORE not in columns.at:
                columns = columns.plus(BEFORE, (self.numbering.size,))
                pieces.append(states.before(n))
            self.append(columns, *pieces)

    def __len__(self) -> int:
        """Number of states."""
        return sum(block.number for block in self._blocks)

    def index(self, n: int) -> int:
        """Return the index of the n-th state from the beginning; raise ArgumentError without it."""
        number, n = len(self), operator.index(n)
        if not number:
            raise ArgumentError(NO_STATE)
        if not -number <= n < number:
            raise ArgumentError(
                f"n = {n}: the solution kept {number} times; give {-number} to {number - 1}"
            )
        return n % number

    def row(self, n: int) -> tuple[Columns, Array]:
        """Return the columns of the n-th state, and a view of its row."""
        n = self.index(n)
        for block in self._blocks:
            if n < block.number:
                break
            n -= block.number
        return block.columns, block.rows[n]

    def column(self, name: str) -> Column:
        """Return the column ``name`` of all states that have it; (n+1, ...)."""
        if name == "q":
            self.index(0)  # raises if there is none
        return Column(self._blocks, name)

    def _row(self, name: str, n: int) -> Array:
        """Return a view of a column of the n-th state."""
        columns, row = self.row(n)
        return columns.column_of(name, row)

    def before(self, n: int) -> Array:
        """Return q at the beginning of the step that ends at the n-th state; (size,).

        If forces do not depend on this q, or if no step led to the state, return q of the state.
        """
        n = self.index(n)
        columns, row = self.row(n)
        if BEFORE in columns.at:
            return columns.column_of(BEFORE, row)
        if not n or not self.needs_start:
            return self._row("q", n)
        q = self._row("q", n - 1)
        if TURNS in columns.at and "v" in columns.at:
            change, turns = self._row("q", n) - q, (self.turns(n - 1), self.turns(n))
            q = q - lost_numbers(self.numbering, change, *turns)
        return q

    def cell_resultants(self, n: int) -> Array:
        """Return resultants of cells, ``cell_number`` of loops.h, in a state; (9, num_cells)."""
        columns, row = self.row(n)
        if FORCES in columns.at:
            return columns.column_of(FORCES, row)
        if self.forces_from_record is None:
            raise ArgumentError("section forces: these states were stored without them")
        record, q = (columns.column_of(name, row) for name in (RECORD, "q"))
        return self.forces_from_record(record, q, self.before(n))

    def history(self) -> State:
        """Return all states as arrays by name, with the resultants of cells; (n+1, ...)."""
        number = range(len(self))
        names = dict.fromkeys(name for block in self._blocks for name in block.columns.at)
        arrays = {name: self.column(name)[:,] for name in names if ": " not in name}
        arrays.pop(RECORD, None)
        arrays[FORCES] = np.array([self.cell_resultants(n) for n in number])
        if arrays.pop(BEFORE, None) is not None:
            before = np.array([self.before(n) for n in number])
            if not np.array_equal(before, arrays["q"][[0, *number[:-1]]]):
                arrays[BEFORE] = before  # a step does not begin at the previous state
        for group, entries in zip(LEDGER, self.ledger(), strict=True):
            arrays |= {f"{group}: {name}": values for name, values in entries.items()}
        return arrays

    def resume(self, history: State) -> None:
        """Restore the states of a :meth:`history`; missing arrays become zero.

        Raises:
            ArgumentError: Times, q or forces are missing, or shapes do not match the scene.
        """
        require_arrays(history, {"t": (-1,)})
        n, begins = len(history["t"]), BEFORE in history
        self._blocks, self._computed = [], None
        ledger = [name for name in history if name.startswith(tuple(f"{x}: " for x in LEDGER))]
        columns = Columns.create(self.numbering, moving="v" in history, ledger=ledger, record=None)
        if begins:
            columns = columns.plus(BEFORE, (self.numbering.size,))
        rows: Array = np.zeros((n, columns.width))
        for name, shape in columns.shapes.items():
            if name in history or name in ("q", FORCES):
                require_arrays(history, {name: (n, *shape)})
                columns.column_of(name, rows)[:] = history[name]
        self._blocks = [Block(columns, rows, n)]

    # -- motion --------------------------------------------------------------------------------

    @property
    def times(self) -> Array:
        """Times of the initial and the n recorded states, s; or load factors; (n+1,)."""
        return self.column("t")[:,]

    @property
    def q(self) -> Array:
        """Configurations, in the order of the degrees of freedom; (n+1, size); m, m, rad."""
        return self.column("q")[:,]

    @property
    def v(self) -> Array:
        """Velocities, in the order of :attr:`q`; empty in statics; m/s, m/s, rad/s."""
        return self.column("v")[:,]

    def displacement(self, place: AttachmentPoint) -> Array:
        """Return displacement and rotation (u, v, ψ) of a place; (n+1, 3); m, m, rad.

        In space, return the displacement (u, v, w) and the rotation vector, of an angle up to π;
        (n+1, 6).

        Between the nodes of a beam, values are interpolated with the degree of the cells.  In
        bodies, values are exact.

        Raises:
            ArgumentError: The beam or body of the place is not in the scene.
        """
        motion = values_at(self.numbering, place, self.column("q"))
        if self.scene.in_space:
            turns = turns_at(self.numbering, place, self.column(TURNS))
            motion[:, :3] += turns.apply(arm(place)) - arm(place)
            motion[:, 3:] = turns.as_rotvec()
        elif isinstance(place, BodyPoint):
            motion[:, :2] += turned(arm(place), motion[:, 2]) - arm(place)
        return motion

    def motion_of_nodes(self, n: int) -> Array:
        """Return :meth:`displacement` of all nodes of beams in a state; (num_nodes, 3 or 6)."""
        motion = np.asarray(self._row("q", n)[self.numbering.dofs])
        if self.scene.in_space:
            motion[:, 3:] = rotation_vectors(self._row(TURNS, n)[: len(motion)])
        return motion

    def turns(self, n: int) -> Array:
        """Return the quaternions of nodes and bodies in space, see ``TURNS``; (nodes, 4)."""
        return self._row(TURNS, n)

    def velocity(self, place: AttachmentPoint) -> Array:
        """Return the velocity (du/dt, dv/dt, dψ/dt) of a place; (n+1, 3); m/s, m/s, rad/s.

        In space, return the velocity, and the angular velocity about axes of the node; (n+1, 6).

        Raises:
            ArgumentError: The run was static, or the beam or body is not in the scene.
        """
        if not len(v := self.column("v")):
            raise ArgumentError("velocity: the run was static; there is none")
        states = self.column(TURNS if self.scene.in_space else "q")
        return velocity_at(self.numbering, place, v, states)

    def position(self, place: AttachmentPoint) -> Array:
        """Return the coordinates of a place in the deformed scene; (n+1, 2 or 3); m."""
        if isinstance(place, BodyPoint):
            u = self.displacement(place)[:, : self.numbering.displacements]
            return np.asarray(place.point + u)
        nodes, weights = self.numbering.weights(place)
        u = self.displacement(place)[:, : self.numbering.displacements]
        return np.asarray(weights @ self.numbering.points[nodes] + u)

    def shape(self, beam: Member, n: int = -1) -> Array:
        """Return the deformed vertices of a beam at the n-th time; (num_vertices, 2 or 3); m."""
        vertices, numbering = self.numbering.vertices_of(beam), self.numbering
        moved = self._row("q", n)[numbering.dofs[vertices, : numbering.displacements]]
        return np.asarray(numbering.points[vertices] + moved)

    # -- joints --------------------------------------------------------------------------------

    def connector(self, connector: Connector) -> Connection:
        """Return motion, force, work, rate and dissipated energy of a connector.

        Raises:
            ArgumentError: The connector is not in the scene.
        """
        return connection(self.column("connectors")[:, connector_indices(self.scene, connector)])

    def joint(self, joint: Joint) -> JointHistory:
        """Return the motion between the first two places of a joint, and its force on the second.

        Forces are known of joints made with ``multipliers=True``, and of joints that are always
        constrained by forces, such as :class:`Link`, see docs/joints.md.

        Raises:
            ArgumentError: The joint is not in the scene, or the second place shares unknowns with
                another one.
        """
        resultants, (a, b, *_) = connector_indices(self.scene, joint), joint.places
        signs, d = signs_on_second_place(joint), self.numbering.displacements
        rotations = [self.displacement(place)[:, d:] for place in (a, b)]
        between = self.position(b) - self.position(a)
        apart = rotated(between, -rotations[0]) - np.subtract(b.point, a.point)
        motion = np.column_stack([apart, rotation_from(*rotations)])
        force, moment = np.zeros((len(self), d)), np.zeros((len(self), 2 * d - 3))
        if 2 in joint.shared:
            moment[:] = np.nan
        forces = self.column("connectors")[:, resultants, FORCE].T
        for k, sign in signs.items():
            holder = joint.holders[k]
            resultant = moment if holder.is_rotation else force
            resultant -= (sign * forces[k])[:, None] * self.directions(holder)
        in_a, in_b = (rotated(force, -self._rotation_in_step(place)) for place in (a, b))
        return JointHistory(motion, force, in_a, in_b, moment if d == 3 else moment[:, 0])

    def directions(self, connector: Connector) -> Array:
        """Return directions in which b moves if the motion of a connector grows; (n+1, 2 or 3).

        Of rotations that joints hold they are axes, in the plane 1; (n+1, 1 or 3).
        They belong to the step that ends at each time, as the forces do: with
        :attr:`equilibrium_fraction` < 1 they are means of the directions at both ends of it.
        """
        a, b, ends = connector.a, connector.b, self._ends()
        if isinstance(connector.law, Guide):
            curve, size, s, normals = connector.law.curve, self.scene.size, 0.0, []
            points, begun = ends[0][1].position(b), ends[-1][1].position(b)
            for n in range(len(self)):
                chord = np.array(points[n] - begun[n])
                s = curve.nearest(np.array(points[n] + begun[n]) / 2, s, size)
                x, y = curve.at(s)[1]
                if np.hypot(*chord) > SHORTEST_CHORD * size:  # the force is normal to it
                    x, y = chord * np.sign(chord @ (x, y))
                normals.append((-y, x))
            return np.asarray(normals / np.linalg.norm(normals, axis=1)[:, None])
        if connector.is_rotation and not self.scene.in_space:
            return np.ones((len(self), 1))
        if connector.stretches:
            apart = [(weight, some.position(b) - some.position(a)) for weight, some in ends]
            length = sum(weight * np.linalg.norm(x, axis=1) for weight, x in apart)
            return np.asarray(sum(weight * x for weight, x in apart) / length[:, None])

        def mean(axis: Sequence[float], place: AttachmentPoint, follows: bool) -> Array:
            d = self.numbering.displacements
            turns = [(w, follows * some.displacement(place)[:, d:]) for w, some in ends]
            return np.asarray(sum(weight * rotated(axis, x) for weight, x in turns))

        if connector.is_rotation:
            other, axis = mean(connector.other, b, True), mean(connector.axis, a, True)
            return np.asarray(np.cross(other, axis))
        return mean(connector.axis, a, connector.follows_a)

    def _rotation_in_step(self, place: AttachmentPoint) -> Array:
        """Return the rotation of a place to which forces of steps belong; (n+1, 1 or 3); rad."""
        ends, d = self._ends(), self.numbering.displacements
        (_, now), *begun = ((w, some.displacement(place)[:, d:]) for w, some in ends)
        for weight, before in begun:
            return rotation_from(-now, weight * rotation_from(now, before))
        return now

    def _ends(self) -> list[tuple[float, States]]:
        """Return the states, and configurations at the beginnings of their steps, with weights."""
        e = self.equilibrium_fraction
        if e == 1.0:
            return [(e, self)]
        names: dict[str, tuple[int, ...]] = {"t": (), "q": (self.numbering.size,)}
        if self.scene.in_space:
            names[TURNS] = self.turns(0).shape
        begun, columns = States(self.numbering), Columns(names)
        for n in range(len(self)):
            state = [np.zeros(1), q := self.before(n)]
            if self.scene.in_space:
                change = q - self._row("q", n)
                state.append(turned_further(self.numbering, self.turns(n), change).ravel())
            begun.append(columns, *state)
        return [(e, self), (1.0 - e, begun)]

    def reaction(self, support: Support) -> Array:
        """Return force (x, y) and moment of a support on the scene; (n+1, 3); N, N, N m.

        In space, return force and moment along the axes of the scene; (n+1, 6).
        Reactions in directions that the support leaves free are zero.

        Each row belongs to the step that ends at its time.  In dynamics the first row is NaN.  In
        statics the first row has the reactions of the initial state.  They are zero if the scene
        is undeformed, because loads act from the first step on.  With ``start=`` they are the last
        reactions of the earlier run.

        Raises:
            ArgumentError: The support is not in the scene.
        """
        index = index_of(self.scene.supports, support, "reaction: ")
        forces = self.column("reactions")[:, index]
        for i, j, angle in reversed(support.turns):
            forces[:, [i, j]] = turned(forces[:, [i, j]], np.full(len(forces), angle))
        if support.axis is not None:
            turns = turns_at(self.numbering, support.place, self.column(TURNS))
            forces[:, 3:] = turns.apply(forces[:, 3:])
        return forces

    # -- forces of cells -----------------------------------------------------------------------

    def _in_equilibrium(self, n: int) -> Array:
        """Return the configuration in which the forces of the n-th state are in equilibrium."""
        e, q = self.equilibrium_fraction, self._row("q", n)
        return q if e == 1.0 else (1 - e) * self.before(n) + e * q

    def cell_forces(self, n: int, pieces: Array = MIDDLE) -> Array:
        """Compute (N, V, M) of :meth:`diagram` in all cells in the n-th state.

        Args:
            n: Index of the state.
            pieces: Fractions of the length of a cell, from 0 to 1, by default the middle.

        Returns:
            Section forces; (num_cells, len(pieces), 3 or 6); N, N, N m.
        """
        if self.scene.in_space:
            return self._in_cells_of_space(n, pieces)
        key = self.index(n), pieces.tobytes()
        if self._computed is None or self._computed[0] != key:
            along, q = self.cells.along, self._in_equilibrium(n)
            forces = along(slice(None), pieces, self.cell_resultants(n), q[along.dofs])
            forces.flags.writeable = False
            self._computed = key, forces
        return self._computed[1]

    def _in_cells_of_space(self, n: int, pieces: Array, in_scene: bool = False) -> Array:
        """Compute section forces of strains of a state, and of loads along cells."""
        t, q, cells = float(self._row("t", n)), self._row("q", n), self.cells_in_space(n)
        # The undeformed scene has no section forces, as in the plane.
        along = (
            self.cells.loads_in_space(t, q, cells)
            if q.any()
            else np.zeros((len(cells.lengths), 2, 3))
        )
        resultants = self.forces_in_middle(n)
        return cells.section_forces(pieces, resultants, along, in_scene=in_scene)

    def cells_in_space(self, n: int) -> CellsOfState:
        """Return the cells in the n-th state of a scene in space."""
        state = self._row("q", n), self._row(TURNS, n)
        return CellsOfState.of(self.numbering, self.cells.axes, *state)

    def section_forces(self, beam: Member, n: int = -1) -> Array:
        """Return (N, V, M) of :meth:`diagram` in the middle of cells; (num_cells, 3); N, N, N m.

        In space, return the forces along, and moments about, the axes 1, 2 and 3 of the sections,
        of the strains of the state; (num_cells, 6).
        """
        return self.forces_in_middle(n)[self.numbering.cells_of(beam)]

    def forces_in_middle(self, n: int) -> Array:
        """Return :meth:`section_forces` of all cells; (num_cells, 3 or 6)."""
        if not self.scene.in_space:
            return np.asarray(self.cell_forces(n)[:, 0])
        stiffness = self.cells.fields.section_values(*STIFFNESS_IN_SPACE)
        return self.cells_of(n, stiffness * self.mean_strains(n))[:, :JUMP]

    def section_forces_at(self, place: Place) -> Array:
        """Return (N, V, M) of :meth:`diagram` at a place; (n+1, 3); N, N, N m.

        In space, return (N, V2, V3, T, M2, M3); (n+1, 6).

        At an inner vertex the values belong to the end of the cell before the vertex.

        Raises:
            ArgumentError: The beam of the place is not in the scene.
        """
        cell, fraction = self.numbering.cell_and_fraction(place)
        return np.asarray(self.forces_in_cells([cell], [fraction])[:, 0])

    def forces_in_cells(
        self, cells: Sequence[int], fractions: Sequence[float], *, in_plane: bool = False
    ) -> Array:
        """Return (N, V, M) of :meth:`diagram` at a fraction of each of some cells; (n+1, m, 3).

        With ``in_plane`` forces along x and y are returned instead of N and V; in space, forces
        along and moments about x, y, z.
        """
        n, chosen = range(len(self)), np.array(cells, dtype=np.int64)
        if self.scene.in_space:
            pieces = np.array(fractions)
            rows = (self._in_cells_of_space(k, pieces, in_plane) for k in n)
            return np.array([row[chosen, range(len(chosen))] for row in rows])
        dofs, forces = self.cells.along.dofs[chosen], np.zeros((len(n), len(chosen), 3))
        q = np.array([self._in_equilibrium(k)[dofs] for k in n])
        resultants = np.array([self.cell_resultants(k)[:, chosen] for k in n])
        for i, (cell, at) in enumerate(zip(cells, fractions, strict=True)):
            forces[:, i] = self.cells.along(
                np.full(len(n), cell), np.full(1, at), resultants[:, :, i].T, q[:, i],
                in_plane=in_plane,
            )[:, 0]  # fmt: skip
        return forces

    def diagram(self, beam: Member, n: int = -1, *, points: int = 9) -> Any:
        """Return section forces along a beam, by equilibrium of cells, at the n-th time.

        The result is a :class:`Diagram`, in space a :class:`DiagramInSpace`.

        Section forces satisfy the equation of the step that ends at this time, with inertia,
        damping, loads and users' virtual works.  At a support they agree with its :meth:`reaction`
        in the axes of the section, which turn with the beam.  Each cell has ``points`` equally
        spaced points, both ends included; their parameters ``s`` run from 0 at the start of the
        beam to 1 at its end, and inner vertices occur twice.  Under a uniform load V is linear
        between the points.

        With ``start=`` and the same scheme, a run begins with the last forces of the earlier run.
        Other static runs begin without section forces, other dynamic runs with stresses only.

        In space, section forces follow from the strains of the state and all loads along the beam.
        They are in equilibrium with all forces of statics.  Inertia within a cell is left
        out, so that V and N at the ends of cells have errors of first order in their length.

        Raises:
            ArgumentError: The beam is not in the scene, or ``points`` is less than 2.
        """
        require_number(points, "diagram: points", at_least=2)
        s, fractions = self.numbering.parameters(beam), np.arange(int(points)) / (int(points) - 1)
        at = s[:-1, None] + fractions * np.diff(s)[:, None]
        forces = self.cell_forces(n, fractions)[self.numbering.cells_of(beam)]
        kind = DiagramInSpace if self.scene.in_space else Diagram
        return kind(at.ravel(), *forces.reshape(-1, forces.shape[2]).T)

    def strains(self, beam: Member, n: int = -1) -> Array:
        """Return (Σ, Γ, K) in the cells of a beam at the n-th time; (num_cells, 3); 1, 1, 1/m.

        In space, they are strains along, and curvatures about, the axes of the section; (..., 6).
        K includes the jump of a hinge, divided by the length of its cell.
        """
        return self.mean_strains(n)[self.numbering.cells_of(beam)]

    def strains_at(self, place: Place) -> Array:
        """Return (Σ, Γ, K) in the cell of :meth:`section_forces_at`; (n+1, 3); 1, 1, 1/m."""
        cell = self.numbering.cell(place)
        return np.array([self.mean_strains(n)[cell] for n in range(len(self))])

    def mean_strains(self, n: int) -> Array:
        """Return (Σ, Γ, K) in all cells in the n-th state; (num_cells, 3); 1, 1, 1/m."""
        if self.scene.in_space:
            return self.cells_in_space(n).strains()
        strains = np.empty((len(self.numbering.cells), 3))
        in_points = self.cells.strains(self._row("q", n)).reshape(len(strains), -1, 3)
        weights = self.numbering.mesh.point_weights
        strains[self.cells.fields.order] = np.einsum("kpi,p->ki", in_points, weights)
        return strains

    def material(self, beam: Member, n: int = -1) -> Material:
        """Return forces, jumps and dissipated energies in the cells of a beam at the n-th time.

        Raises:
            ArgumentError: All beams are elastic, or the beam is not in the scene.
        """
        return self._material(n, self.numbering.cells_of(beam))

    def _material(self, n: int, cells: Index | int) -> Material:
        if not len(self.numbering.inelastic_cells) and not self.scene.hinges:
            raise ArgumentError("material: no beam of the scene yields or breaks; give one a law")
        chosen = self.cells_of(n, self.forces_in_middle(n))[cells].T
        return Material(chosen[:JUMP].T, *chosen[JUMP:])

    def cells_of(self, n: int, forces: Array | float = 0.0) -> Array:
        """Return "material" of all cells, in elastic cells ``forces`` and zeros; (num_cells, 6).

        Forces are means over a cell; jumps and energies are sums over its integration points.  In
        space there are six forces; (num_cells, 9).
        """
        at_points = self.points_of(n)
        everything: Array = at_points.sum(axis=1)
        inelastic = self.numbering.inelastic_cells
        everything[:, :JUMP] = forces
        means = self.numbering.mesh.point_weights @ at_points[inelastic, :, :JUMP]
        everything[inelastic, :JUMP] = means
        return everything

    def points_of(self, n: int) -> Array:
        """Return "material" at Gauss points of all cells, or zeros; (num_cells, degree, 6 or 9)."""
        rows, p = self._row("material", n), self.numbering.mesh.degree
        everything: Array = np.zeros((len(self.numbering.cells), p, rows.shape[1]))
        everything[self.numbering.inelastic_cells] = rows.reshape(-1, p, rows.shape[1])
        return everything

    def material_at(self, place: Place) -> Material:
        """Return the material state of the cell at a place at all times; (n+1, ...).

        ``forces`` are section forces in the middle of the cell; of a yielding cell, forces of its
        law for the strains at the stored time.  If a plastic hinge is at the
        place, ``forces[:, -1]`` is the moment of the hinge in each step, ``jump`` its rotation, and
        ``hinge`` its dissipated energy.

        Raises:
            ArgumentError: All beams are elastic, or the beam is not in the scene.
        """
        cell, hinge = self.numbering.cell(place), self.numbering.hinge_at(place)
        states = zip(*(self._material(n, cell) for n in range(len(self))), strict=True)
        forces, jump, plastic, energy = map(np.array, states)
        if hinge is not None:
            history = self.connector(hinge)
            forces[:, -1], jump, energy = history.force, history.motion, history.dissipated
        return Material(forces, jump, plastic, energy)

    def damage(self, n: int = -1) -> tuple[Array, Array]:
        """Return jump of rotation (rad) and dissipated energy (J) of each cell; (num_cells,) each.

        Plastic hinges at the ends of cells are included.  If a cell has several jumps, the jump of
        the largest magnitude is returned.
        """
        states = self.cells_of(n)
        jump, dissipated = states[:, JUMP].copy(), states[:, PLASTIC] + states[:, HINGE]
        if self.scene.hinges:
            hinges = Connection(*self._row("connectors", n)[-len(self.scene.hinges) :].T)
            np.add.at(dissipated, self.numbering.cells_at_hinges, hinges.dissipated)
            for cell, motion in zip(self.numbering.cells_at_hinges, hinges.motion, strict=True):
                jump[cell] = max(jump[cell], motion, key=abs)
        return jump, dissipated

    # -- balances ------------------------------------------------------------------------------

    def ledger(self) -> list[dict[str, Array]]:
        """Return the three parts of the energy ledger, each as arrays by name; (n+1,); J."""
        pieces = []
        for k in range(len(LEDGER)):
            columns = [(block.rows, block.columns.ledger[k]) for block in self._blocks]
            names = dict.fromkeys(name for _, at in columns for name in at)
            pieces.append({
                name: np.concatenate([
                    rows[:, at[name]] if name in at else np.zeros(len(rows)) for rows, at in columns
                ])
                for name in names
            })  # fmt: skip
        return pieces

    @property
    def energy(self) -> Energy:
        """Energy ledger of all states."""
        self.index(0)  # raises if there is none
        return Energy(*self.ledger())

    def momentum(self) -> Array:
        """Return momenta (p_x, p_y, L), with L about the origin; (n+1, 3); N s, N s, N m s.

        In space both are vectors; (n+1, 6).

        They contain beams, bodies and point masses, but not masses of moving loads.

        Raises:
            ArgumentError: The run was static.
        """
        if not len(self.column("v")):
            raise ArgumentError("momentum: the run was static; there is none")
        times, names = Product(mass_matrix(self.cells.fields)), ["q", "v"]
        names += [TURNS] * self.scene.in_space
        rows = ([self._row(name, n) for name in names] for n in range(len(self)))
        return np.array([momentum(self.numbering, q, times(v), *z) for q, v, *z in rows])
