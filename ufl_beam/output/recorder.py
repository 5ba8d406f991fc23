# SPDX-License-Identifier: MIT
"""Recorders of runs: base classes, the state of a run that recorders read, and checks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.blocks.beams import BeamCells, InelasticCells
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.display import Parameter
from ufl_beam.errors import ArgumentError, require_count, require_sequence, shorten, warn
from ufl_beam.file_system import require_path
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.bodies import AttachmentPoint, Member
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.records import unlike
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.output.internal_variables import in_beam
from ufl_beam.output.output_files import (
    Output,
    OutputFile,
    changed,
    require_apart,
    require_writable,
)
from ufl_beam.output.state_rows import FORCE, Connection, connection, connector_indices
from ufl_beam.output.states import States
from ufl_beam.parallel import on_first
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.inertia_and_damping import Inertia


class StateView(ABC):
    """Present state of a run, for recorders, controllers and laws of users.

    All processes call its methods together.
    """

    scene: Scene
    numbering: DofNumbering
    scheme: Scheme
    t: float  # s
    comm: MPI.Intracomm  # all processes of the run
    subdomain: Subdomain  # degrees of freedom of this process
    fields: Fields
    parameter: Parameter  # names and formats of `t`: time, or the load factor of a path
    substeps: int  # number of steps so far; substeps count as steps
    cell_forces: CellForces
    solution: Any  # `Solution` of the run
    inertia: Inertia
    beams: list[BeamCells]
    inelastic: list[InelasticCells]
    solver: Solver  # Newton's method
    newton: Newton  # its options
    controllers: Any  # `Controllers` of the simulation

    @property
    @abstractmethod
    def now(self) -> States:
        """The present state in the form of a solution; all processes call it together."""

    def entries(self) -> tuple[dict[str, float], ...]:
        """Return the parts of the energy ledger of the scene: state, supplied, lost; J."""
        columns, row = self.now.row(0)
        values: Any = row.tolist()
        return tuple({name: values[at] for name, at in group.items()} for group in columns.ledger)

    def connections(self) -> Array:
        """Return the fields of :class:`Connection` of all connectors; (num_connectors, 5)."""
        return np.asarray(self.now.column("connectors")[0,])

    def connector(self, connector: Connector) -> Connection:
        """Return motion, force, work, rate and dissipated energy of a connector.

        Raises:
            ArgumentError: The connector is not in the scene.
        """
        return connection(self.connections()[connector_indices(self.scene, connector)])

    def displacement(self, place: AttachmentPoint) -> Array:
        """Return the present displacement and rotation (u, v, ψ) of a place; (3,); m, m, rad."""
        return np.asarray(self.now.displacement(place)[0])

    def position(self, place: AttachmentPoint) -> Array:
        """Return the present coordinates of a place; (2,); m."""
        return np.asarray(self.now.position(place)[0])

    def velocity(self, place: AttachmentPoint) -> Array:
        """Return the present velocity (du/dt, dv/dt, dψ/dt) of a place; (3,); m/s, m/s, rad/s.

        Raises:
            ArgumentError: The run is static, so it has no velocities.
        """
        if not has_inertia(self.scheme):
            raise ArgumentError(
                f"velocity of {place}: the run is static; there is none. A controller for both "
                "kinds of runs can test now.scheme.dynamic"
            )
        return np.asarray(self.now.velocity(place)[0])

    def press(self, joint: Joint | Support) -> float:
        """Return the magnitude of the force of a joint or support in the last step; N.

        Raises:
            ArgumentError: The joint shares unknowns, or joint or support is not in the scene.
        """
        if isinstance(joint, Support):
            force = self.now.reaction(joint)[0, : self.numbering.displacements]
            return float(np.linalg.norm(force))
        connectors = self.scene.all_connectors
        values = [n for n in connector_indices(self.scene, joint) if not connectors[n].is_rotation]
        return float(np.linalg.norm(self.connections()[values, FORCE]))

    @abstractmethod
    def internal(self) -> State:
        """Return internal variables of cells as tables, see :attr:`Solution.internal`."""

    def variables(self, beam: Member) -> dict[str, Array]:
        """Return the present internal variables of a beam, see :meth:`Solution.variables`."""
        return in_beam(self.numbering, self.internal(), beam)

    def section_forces(self) -> Array:
        """Return the section forces of all cells in the last step; (num_cells, 3 or 6); N, N m.

        They are computed as in :meth:`Solution.section_forces`.
        """
        return self.now.forces_in_middle(0)

    @property
    @abstractmethod
    def q(self) -> Array:
        """Configuration at the degrees of freedom of this process; m, m, rad."""

    @property
    @abstractmethod
    def q_before(self) -> Array:
        """Configuration at the beginning of the last step, in the order of :attr:`q`."""

    @property
    def requested_forces(self) -> dict[Connector, float]:
        """Latest forces of controllers, and limits of friction forces; N or N m."""
        return dict(zip(self.controllers.at, map(float, self.controllers.values), strict=True))

    @property
    def iterations(self) -> int:
        """Number of Newton iterations so far."""
        return int(self.solver.c.total)

    @property
    def snes(self) -> Any:
        """SNES of petsc4py that solves the steps; it accepts monitors and other options.

        From the first access on, PETSc's ``newtonls`` solves the steps, instead of an equivalent
        method in C that is faster for few cells.  Norms of SNES combine forces (N), moments (N m)
        and residuals of connectors.  ``rtol`` of :class:`Newton` determines convergence.
        Monitors are also called in line searches and in path following.

        Example:
            >>> simulation, norms = ub.Simulation(scene, ub.EnergyMomentum()), []
            >>> simulation.snes.setMonitor(lambda snes, iteration, norm: norms.append(norm))
            >>> simulation.step_to(0.05)
            >>> len(norms) == simulation.iterations + 1
            True
        """
        return self.solver.snes

    def warn(self, warnings: Iterable[str], *, local: bool = False) -> None:
        """Store warnings that the solution does not have yet, and issue them on rank 0.

        With ``local``, each process issues its own warnings.
        """
        for said in warnings:
            if said not in self.solution.warnings:
                self.solution.warnings += f"{said}\n"
                if local or self.comm.rank == 0:
                    warn(said)

    def velocities(self) -> list[Array]:
        """Return a list with the velocities in the order of :attr:`q`; empty in statics."""
        return [self.inertia.v] if has_inertia(self.scheme) else []

    @property
    def may_break(self) -> bool:
        """True if the scene has inelastic material or hinges."""
        return bool(self.now.column("material")[0,].size or self.scene.hinges)

    def damage(self) -> tuple[Array, Array]:
        """Return jumps (rad) and dissipated energies (J) of cells; see :meth:`States.damage`."""
        return self.now.damage()

    @abstractmethod
    def watch(self, fractions: Array) -> Any:
        """Return extremes at ``fractions`` of cells, which C updates after each substep."""


class Recorder(ABC):
    """Base class of recorders of accepted steps; all processes call the methods together.

    Attributes:
        files: Paths of output files; outputs of a run must not share a file.
        by_itself: True if an open recorder needs no calls of :meth:`write`.

    Example:
        >>> class Speed(ub.extend.Recorder):
        ...     def open(self, simulation):
        ...         self.largest = 0.0
        ...     def write(self, simulation):
        ...         self.largest = max(self.largest, abs(simulation.velocity(beam.end)[1]))
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=Speed())
    """

    files: tuple[Path, ...] = ()
    by_itself = False

    def __repr__(self) -> str:
        return f"<{' '.join([type(self).__name__, *map(str, self.files)])}>"

    def require_writable(self) -> None:
        """Raise :class:`ArgumentError` if a file cannot be written; only process 0 calls it."""
        for path in self.files:
            require_writable(path)

    @abstractmethod
    def open(self, simulation: StateView) -> None:
        """Begin to record, with the initial state."""

    @abstractmethod
    def write(self, simulation: StateView) -> None:
        """Record the state after a step."""

    def close(self) -> None:
        """Stop recording; also called when the run fails."""

    def state(self) -> State:
        """Return arrays by name for :meth:`resume`; the arrays of the first process are saved.

        Raises:
            ArgumentError: The recorder cannot be restarted.
        """
        raise ArgumentError(
            f"{type(self).__name__}: this recorder cannot continue from a checkpoint; give it "
            "methods state() and resume(simulation, state), or run without a checkpoint"
        )

    def resume(self, simulation: StateView, state: State) -> None:
        """Continue from a :meth:`state`; a restarted run calls it instead of :meth:`open`.

        Raises:
            ArgumentError: Earlier output is missing or changed.
        """
        self.state()


class Restartable(Recorder):
    """Base of the recorders of the package; new and restarted runs call :meth:`begin`."""

    @abstractmethod
    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Begin with the initial state, or continue from a :meth:`state`."""

    def open(self, simulation: StateView) -> None:
        """Begin with the initial state."""
        self.begin(simulation)

    def resume(self, simulation: StateView, state: State) -> None:
        """Continue from a :meth:`state`; see :meth:`Recorder.resume`."""
        self.begin(simulation, state)


class FileRecorder(Restartable):
    """Base of recorders that append rows to a file, which has all complete rows at any time.

    Only the first process calls the methods with an underscore, except :meth:`_row`.

    Attributes:
        complete: Sizes of the complete rows in the file, on the first process.
    """

    complete: Sequence[int] = ()

    def __init__(self, path: str | Path, every: int) -> None:
        what = f"{type(self).__name__} {path}"
        self._path, self._what = require_path(path, type(self).__name__), what
        require_count(every, f"{what}: every")
        self._every, self._count = every, 0  # steps between rows; steps so far
        self._closing = ExitStack()  # calls that close the file

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Write the initial row to a new file, or delete the rows that follow a :meth:`state`."""
        self._comm: MPI.Intracomm = simulation.comm
        row, complete, digest = self._row(simulation), list[int](), None
        self._count = 0
        if state is not None:
            self._count, *complete = map(int, state["sizes"])
            digest = state["digest"].tobytes()

        def start() -> None:
            self._begin(row, complete, digest)
            if digest is None:
                self._append(row)

        on_first(self._comm, start)

    def _begin(self, row: Any, complete: Sequence[int], digest: bytes | None) -> None:
        """Open a new file for such rows, or a file whose ``complete`` rows have this checksum."""
        self.close()
        self.complete = complete
        try:
            self._file = self._start(row, digest)
            if digest is not None and self._sync() != digest:
                raise ValueError("not the file that was written up to there")
        except (FileNotFoundError, ValueError):
            if digest is None:
                raise
            self.close()
            raise changed(self._what) from None
        self._cut()
        self._closing.callback(self._cut)
        if self._file.path != self._path:  # a checked copy
            self._file.rename(self._path)

    def write(self, simulation: StateView) -> None:
        """Write a row after every ``every`` steps."""
        self._count += 1
        if self._count % self._every == 0:
            row = self._row(simulation)
            on_first(self._comm, lambda: self._append(row))

    def state(self) -> State:
        """Flush to the disk; return numbers of steps, and sizes and a checksum of the file.

        A closed recorder has no checksum, so that no run continues from its state.
        """
        digest = bytearray()
        on_first(self._comm, lambda: digest.extend(b"" if self._file.closed else self._sync()))
        return {
            "sizes": np.array([self._count, *self.complete], dtype=float),
            "digest": np.frombuffer(digest, dtype=np.uint8),
        }

    def close(self) -> None:
        """Close the file, without an incomplete last row."""
        self._closing.close()

    def _open(self, path: Path, *, new: bool = True) -> OutputFile:
        """Open a file, which :meth:`close` closes."""
        file = OutputFile(path, new=new)
        self._closing.callback(file.close)
        return file

    @abstractmethod
    def _row(self, simulation: StateView) -> Any:
        """Compute the row of the present state; all processes call it together."""

    @abstractmethod
    def _start(self, row: Any, digest: bytes | None) -> OutputFile:
        """Write a file without rows, or open the file, or a copy, with :attr:`complete` rows.

        If the file with the checksum ``digest`` was changed, :class:`ValueError` may be raised.
        """

    @abstractmethod
    def _append(self, row: Any) -> None:
        """Append a row."""

    @abstractmethod
    def _sync(self) -> bytes:
        """Flush to the disk; return a checksum of all complete rows; each is read once."""

    @abstractmethod
    def _cut(self) -> None:
        """Delete all data after the last complete row."""


def checked_recorders(
    record: Sequence[Recorder] | Recorder, comm: MPI.Intracomm, call: str, *others: Output
) -> tuple[tuple[Recorder, ...], list[Output]]:
    """Check the recorders of a run; return recorders and all outputs, including ``others``."""
    one = isinstance(record, Recorder | type)
    recorders: Any = (record,) if one else require_sequence(record, "record")
    outputs = []
    for i, recorder in enumerate(recorders):
        name = f"record[{i}]"
        if not isinstance(recorder, Recorder):
            remedy = "derive your own classes from ub.extend.Recorder"
            if isinstance(recorder, type):
                remedy = f"create one, recorder = {recorder.__name__}(...), before the run"
            raise ArgumentError(f"{call}: {name} = {shorten(recorder)} is not a Recorder; {remedy}")
        if why := unlike(recorder, Recorder):
            kind = type(recorder).__name__
            raise ArgumentError(f"{call}: {name}: {kind} is not a recorder: {why}")
        first = next(k for k, x in enumerate(recorders) if x is recorder)
        if first != i:
            raise ArgumentError(
                f"{call}: record[{first}] and {name} are the same {type(recorder).__name__}; "
                "leave one out"
            )
        on_first(comm, recorder.require_writable)
        outputs.append((f"{name} ({type(recorder).__name__})", recorder.files))
    outputs += others
    on_first(comm, lambda: require_apart(outputs, call))
    return recorders, outputs
