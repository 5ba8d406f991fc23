# SPDX-License-Identifier: MIT
"""State of a simulation between its steps, for recorders, controllers and solutions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index, Snapshot, on_demand
from ufl_beam.compiled.csr import as_slice
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Share
from ufl_beam.display import Parameter
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.bodies import Anchor
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.output.forces_along_cells import MIDDLE, ForcesAlongCells
from ufl_beam.output.joint_histories import Connection, connection, links_of, motion_of, velocity_of
from ufl_beam.output.watches import Watch
from ufl_beam.solvers.newton import Solver
from ufl_beam.terms.beams import Inertia
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inelastic_beams import InelasticBeams
from ufl_beam.terms.links import FORCE, Links
from ufl_beam.terms.supports import Supports

NO_REACTIONS = np.zeros((0, 3))
NO_CONNECTIONS = np.zeros((0, len(Connection._fields)))
NO_MATERIAL = np.zeros((0, 7))


class StateView(ABC):
    """State at the present time, by objects of the scene; all processes call methods together."""

    scene: Scene
    comm: MPI.Intracomm  # all processes of the run
    scheme: Scheme
    grid: Grid
    share: Share  # degrees of freedom of this process
    fields: Fields
    t: float  # s
    q: Array = on_demand()  # configuration at the local degrees of freedom
    q_before: Array  # that at the beginning of the last step
    between: float  # part of a step at whose configuration forces are in equilibrium
    begun: bool  # whether section forces depend on the configuration at its beginning
    cell_forces: CellForces
    parts: int  # steps so far, parts of cut steps counted each
    ledger: Ledger
    supports: Supports
    inertia: Inertia
    reactions_known: bool = False  # those of the initial state; in dynamics they are not
    couplings: list[Links]
    inelastic: list[InelasticBeams]
    solver: Solver  # Newton's method
    _has_inelastic: bool

    @property
    @abstractmethod
    def asked(self) -> dict[Connector, float]:
        """Forces of controllers, and limits of friction; N or N m."""

    @property
    @abstractmethod
    def parameter(self) -> Parameter:
        """Time, or the load factor of a path."""

    @property
    def iterations(self) -> int:
        """Newton iterations so far."""
        return self.solver.iterations

    @property
    def snes(self) -> Any:
        """SNES that solves the steps, of petsc4py; it takes monitors, histories and other methods.

        From when it is asked for, steps are solved by PETSc's ``newtonls``, also in the compiled
        path, where an equivalent method in C is faster for few cells.  Its norms add forces (N),
        moments (N m) and what connectors miss; convergence is judged by :class:`Newton`'s ``rtol``.
        Monitors are also called in line searches and along paths.

        Example:
            >>> simulation, norms = ub.Simulation(scene, ub.Midpoint()), []
            >>> simulation.snes.setMonitor(lambda snes, iteration, norm: norms.append(norm))
            >>> simulation.step_to(0.05)
            >>> len(norms) == simulation.iterations + 1
            True
        """
        return self.solver.snes

    def gather(self) -> Snapshot:
        """Gather the state of all processes."""
        v = [self.share.gather(v) for v in self.velocities()]
        connections = self.connections() if self.scene.links else NO_CONNECTIONS
        material = self._material_table() if self._has_inelastic else NO_MATERIAL
        return Snapshot(
            self.t, self.share.gather(self.q), v[0] if v else None, self.reactions(),
            self.entries(), material, connections, self._kept_forces(),
            self.share.gather(self.q_before) if self.begun else None,
        )  # fmt: skip

    def _kept_forces(self) -> Array:
        """What solutions keep of the forces of cells."""
        record = self.cell_forces.record() if self.share.alone else None
        if record is not None:
            return record
        return self.share.gather_cells(self.cell_forces(self.q, self.q_before).T).T

    def _material_table(self) -> Array:
        """Numbers of cells and rows of their material, in the order of the numbers; (m, 7)."""
        rows = [rows for _, rows in self.material()]
        empty, order = self._empty_table
        table = empty.copy()
        table[:, 1:] = (rows[0] if len(rows) == 1 else np.concatenate(rows))[order]
        return table

    @cached_property
    def _empty_table(self) -> tuple[Array, Index | slice]:
        """The table of :meth:`_material_table` without material, and its order."""
        cells = np.concatenate([cells for cells, _ in self.material()])
        table, order = np.zeros((len(cells), 7)), np.argsort(cells)
        table[:, 0] = cells[order]
        return table, as_slice(order)

    def velocities(self) -> list[Array]:
        """Velocities at the local degrees of freedom; none in statics."""
        return [self.inertia.v] if has_inertia(self.scheme) else []

    def reactions(self) -> Array:
        """Forces of all supports on the scene; (num_supports, 3); N, N, N m."""
        if not self.scene.supports:
            return NO_REACTIONS
        if self.parts == 0 and not self.reactions_known:
            return np.full((len(self.scene.supports), 3), np.nan)
        return self._support_forces()

    def _support_forces(self) -> Array:
        """Forces of all supports in the latest residual; (num_supports, 3); N, N, N m.

        Several supports may be at one node: each has the forces of the components that it holds.
        """
        forces = self.supports.all_reactions(self.share.size + 1)  # the last one is zero
        here: Array = forces[self.support_dofs]
        if not self.share.alone:
            self.share.comm.Allreduce(MPI.IN_PLACE, here)
        for k, support in enumerate(self.scene.supports):
            if support.angle:
                c, s = math.cos(support.angle), math.sin(support.angle)
                x, y = here[k, :2]
                here[k, :2] = c * x - s * y, s * x + c * y
        return here

    @cached_property
    def support_dofs(self) -> Index:
        """Local degrees of freedom that the supports hold, those that this process owns.

        (num_supports, 3), -1 for others; of a support at an angle they are those of its axes.
        """
        local = np.full((len(self.scene.supports), 3), -1, dtype=np.int64)
        for here, support in zip(local, self.scene.supports, strict=True):
            held = np.array([*support.held])
            dofs = self.share.at(support.place)[held]
            mine = self.share.owns(dofs)
            here[held[mine]] = self.share.local(dofs[mine])
        return local

    def entries(self) -> tuple[dict[str, float], ...]:
        """The ledger over all processes: state, supplied, lost; J."""
        parts = self.ledger.state, self.ledger.supplied, self.ledger.lost
        groups = tuple(part.by_name() for part in parts)
        if self.share.alone:
            return groups
        everyone = self.share.comm.allgather(groups)
        return tuple(
            {name: sum(one[g][name] for one in everyone) for name in group}
            for g, group in enumerate(groups)
        )

    def connections(self) -> Array:
        """Columns of :class:`Connection` for all links of the scene; (num_links, 5)."""
        here = np.zeros((len(self.scene.links), len(Connection._fields)))
        q = self.q
        for one in self.couplings:
            here[one.numbers, FORCE] = one.force(q)
            for column, numbers in one.kept(q):
                here[one.numbers, column] += numbers
        if not self.share.alone:
            self.share.comm.Allreduce(MPI.IN_PLACE, here)
        return here

    def connector(self, connector: Connector) -> Connection:
        """Return motion, force, work and rate of a connector at the end of the last step.

        Raises:
            SceneError: It is not in the scene.
        """
        return connection(self.connections()[links_of(self.scene, connector)])

    def displacement(self, place: Anchor) -> Array:
        """Displacement and rotation (u, v, ψ) of a place now; (3,); m, m, rad."""
        return np.asarray(motion_of(self.grid, place, self.share.gather(self.q)[None])[0])

    def velocity(self, place: Anchor) -> Array:
        """Velocity (du/dt, dv/dt, dψ/dt) of a place now; (3,); m/s, m/s, rad/s.

        Raises:
            SceneError: The run is static; it has no velocities.
        """
        if not has_inertia(self.scheme):
            raise SceneError(
                f"velocity of {place}: the run is static; there is none. A controller for both "
                "kinds of runs can ask now.scheme.dynamic"
            )
        q, v = self.share.gather(self.q), self.share.gather(self.velocities()[0])
        return np.asarray(velocity_of(self.grid, place, q[None], v[None])[0])

    def press(self, joint: Joint | Support) -> float:
        """Size of the force of a joint or a support at the end of the last step; N.

        Raises:
            SceneError: The joint shares its displacement; make it with ``measured=True``.
        """
        if isinstance(joint, Support):
            force = self._support_forces()[self.scene.supports.index(joint)]
            return float(np.linalg.norm(force[:2]))
        links = self.scene.links
        numbers = [n for n in links_of(self.scene, joint) if not links[n].turns]
        return float(np.linalg.norm(self.connections()[numbers, 1]))

    def section_forces(self) -> Array:
        """(N, V, M) in the middle of all cells; (num_cells, 3); N, N, N m.

        They belong to the equation of the last step, see :meth:`Solution.diagram`.
        """
        return self.forces_along(MIDDLE)[:, 0]

    def forces_along(self, parts: Array) -> Array:
        """(N, V, M) at parts of all cells, from 0 to 1; (num_cells, len(parts), 3); N, N, N m."""
        dofs, before = self._dofs_along, self.q_before if self.begun else None
        begun = None if before is None else before[dofs]
        numbers = self.cell_forces(self.q, self.q_before)
        here = self._along(self.share.cells, parts, numbers, self.q[dofs], begun)
        return self.share.gather_cells(here)

    def watch(self, parts: Array) -> Watch | None:
        """Begin to take in extremes after each step in C, or return None if that cannot be."""
        return None

    @cached_property
    def _along(self) -> ForcesAlongCells:
        return ForcesAlongCells(self.grid, self.between)

    @cached_property
    def _dofs_along(self) -> Index:
        return self.share.cell_dofs.reshape(len(self.share.cells), 3, self.grid.mesh.degree + 1)

    def material(self) -> list[tuple[Index, Array]]:
        """Cells that can yield or break, and :attr:`Points.kept`; later steps change them."""
        here = [inelastic.kept() for inelastic in self.inelastic]
        if not self._has_inelastic or self.share.alone:
            return here
        return [group for groups in self.share.comm.allgather(here) for group in groups]

    def hinges(self) -> Array:
        """Columns of :class:`Connection` for the plastic hinges of the scene; (num_hinges, 5)."""
        return self.connections()[len(self.scene.links) - len(self.scene.hinges) :]

    @property
    def may_break(self) -> bool:
        """True if something in the scene yields, softens or has plastic hinges."""
        return self._has_inelastic or bool(self.scene.hinges)

    def damage(self) -> tuple[Array, Array]:
        """Jump of rotation (rad) and dissipated energy (J) of each cell; both (num_cells,).

        Plastic hinges at its ends are included; of several jumps it is the largest.
        """
        jump, dissipated = np.zeros((2, len(self.grid.cells)))
        for cells, rows in self.material():
            jump[cells], dissipated[cells] = rows[:, 3], rows[:, 4] + rows[:, 5]
        if self.scene.hinges:
            hinges = Connection(*self.hinges().T)
            np.add.at(dissipated, self.grid.cells_at_hinges, hinges.dissipated)
            for cell, motion in zip(self.grid.cells_at_hinges, hinges.motion, strict=True):
                jump[cell] = max(jump[cell], motion, key=abs)
        return jump, dissipated
