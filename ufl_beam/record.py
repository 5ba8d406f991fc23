"""Files that a run writes on the way."""

from __future__ import annotations

import csv
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import basix.ufl
import numpy as np

from ufl_beam.bodies import Anchor, require_anchor
from ufl_beam.compat import Array, fem, io, line_mesh
from ufl_beam.connectors import Connector, Joint
from ufl_beam.errors import SceneError, require_count, require_kind, require_path, require_sequence
from ufl_beam.grid import Grid
from ufl_beam.joints import links_of, motion_of
from ufl_beam.memory import State
from ufl_beam.scene import Scene
from ufl_beam.skeleton import BEAM, rods_of

if TYPE_CHECKING:
    from ufl_beam.simulation import Simulation


UNLIMITED = sys.maxsize
"""As many as there are."""


class Recorder(ABC):
    """Something that looks at each accepted step; all processes call it together."""

    @abstractmethod
    def require_writable(self) -> None:
        """Raise :class:`SceneError` if the output cannot be written; the first process asks."""

    @abstractmethod
    def open(self, simulation: Simulation) -> None:
        """Begin, with the initial state."""

    @abstractmethod
    def write(self, simulation: Simulation) -> None:
        """Record the state after a step."""

    @abstractmethod
    def close(self) -> None:
        """End; also called when the run fails."""

    def state(self) -> State:
        """What :meth:`resume` needs, arrays by name; that of the first process is kept.

        Raises:
            SceneError: The recorder has none.
        """
        raise SceneError(
            f"{type(self).__name__}: this recorder cannot go on from a checkpoint; give it methods "
            "state() and resume(simulation, state), or run without a checkpoint"
        )

    def resume(self, simulation: Simulation, state: State) -> None:
        """Go on from a :meth:`state`, in the place of :meth:`open`; nothing is recorded yet.

        Raises:
            SceneError: What was written before is not there any more.
        """
        self.state()


def on_first(comm: MPI.Intracomm, action: Callable[[], None]) -> None:
    """Do something on the first process; what it raises there is raised on all of them."""
    error: Exception | None = None
    if comm.rank == 0:
        try:
            action()
        except Exception as caught:
            error = caught
    if comm.size > 1:
        error = comm.bcast(error)
    if error is not None:
        raise error


class XDMF(Recorder):
    """Time series for ParaView: displacement and rotation at vertices, N, V, M in cells.

    Where something yields or breaks, also the jump of the hinge (rad) and the dissipated energy (J)
    of each cell.  A scene with bodies, links or connectors has more cells: from the centre of each
    body to its points, and along links and springs.  A field "part" is 0 in beams, 1 in bodies and
    2 in links; N is the force of what pulls along its line, and 0 in the others, as V and M.

    Args:
        path: File, ending in ``.xdmf``; the data are beside it in ``.h5``.
        every: Write every so many steps.

    Raises:
        SceneError: ``every`` is no whole number of steps, or the path does not end in ``.xdmf``.
    """

    def __init__(self, path: str | Path, *, every: int = 1) -> None:
        require_path(path, "XDMF: path")
        require_count(every, f"XDMF {path}: every")
        self._path, self._every = Path(path), every
        if self._path.suffix != ".xdmf":
            raise SceneError(f"XDMF {path}: the name of the file must end in .xdmf")
        self._files: list[Any] = []

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if one of both files cannot be written."""
        for path in self._paths:
            _require_writable(path)

    def open(self, simulation: Simulation) -> None:
        """Write the mesh and the initial state."""
        self._count = 0
        self._prepare(simulation)
        on_first(simulation.comm, lambda: self._begin(simulation.grid))
        self._put(simulation)

    def _prepare(self, simulation: Simulation) -> None:
        self._inelastic = len(simulation.material()) > 0
        self._rods = rods_of(simulation.scene)
        links = simulation.scene.links
        self._pulling = [
            (k, links.index(rod.along)) for k, rod in enumerate(self._rods) if rod.along is not None
        ]

    def _begin(self, grid: Grid) -> None:
        domain = self._make_functions(grid)
        self._files = [io.XDMFFile(MPI.COMM_SELF, self._path, "w")]
        self._files[0].write_mesh(domain)

    def _make_functions(self, grid: Grid) -> Any:
        # Rods have vertices of their own, as beams do.
        ends = [anchor.point for rod in self._rods for anchor in (rod.a, rod.b)]
        points = np.concatenate([grid.points, np.reshape(ends, (-1, 2))])
        more = len(grid.points) + np.arange(len(ends)).reshape(-1, 2)
        all_cells = np.concatenate([grid.pieces, more])
        domain = line_mesh(points, all_cells)
        self._order = domain.topology.original_cell_index
        line = basix.ufl.element("Lagrange", "interval", 1)
        vectors = basix.ufl.element("Lagrange", "interval", 1, shape=(3,))
        constants = basix.ufl.element("DG", "interval", 0)
        self._displacement = _named(domain, vectors, "displacement")
        self._rotation = _named(domain, line, "rotation")
        names = ["N", "V", "M", *(["jump", "dissipated energy"] if self._inelastic else [])]
        names += ["part"] if self._rods else []
        self._in_cells = [_named(domain, constants, name) for name in names]
        dofmap = self._rotation.function_space.dofmap.list
        self._vertex_of_dof = np.empty(len(points), dtype=np.int64)
        self._vertex_of_dof[dofmap] = all_cells[self._order]
        return domain

    def state(self) -> State:
        """Both files: HDF5 changes them here and there, so that one that dies cannot be cut off."""
        state = {"count": np.array([self._count], dtype=float)}
        if self._files:
            self.close()
            state.update({path.suffix: _bytes_of(path) for path in self._paths})
            self._append()
        return state

    def resume(self, simulation: Simulation, state: State) -> None:
        """Make the files what they were, and append to them."""
        self._count = int(state["count"][0])
        self._prepare(simulation)

        def put_back() -> None:
            self._make_functions(simulation.grid)
            for path in self._paths:
                path.write_bytes(state[path.suffix].tobytes())
            self._append()

        on_first(simulation.comm, put_back)

    def _append(self) -> None:
        self._files = [io.XDMFFile(MPI.COMM_SELF, self._path, "a")]

    @property
    def _paths(self) -> tuple[Path, Path]:
        return self._path, self._path.with_suffix(".h5")

    def write(self, simulation: Simulation) -> None:
        """Record every so many steps."""
        self._count += 1
        if self._count % self._every == 0:
            self._put(simulation)

    def _put(self, simulation: Simulation) -> None:
        q = simulation.share.gather(simulation.q)
        columns = [*simulation.section_forces().T]
        if self._inelastic:
            jump, dissipated = np.zeros((2, len(simulation.grid.cells)))
            for cells, rows in simulation.material():
                jump[cells], dissipated[cells] = rows[:, 3], rows[:, 4] + rows[:, 5]
            columns += [jump, dissipated]
        columns = [np.repeat(column, simulation.grid.mesh.degree) for column in columns]
        if self._rods:
            columns = self._with_rods(columns, simulation.connections())
        on_first(simulation.comm, lambda: self._write(simulation, q, columns))

    def _with_rods(self, columns: list[Array], connections: Array) -> list[Array]:
        """Values in all cells, those of rods last."""
        in_rods = np.zeros((len(columns), len(self._rods)))
        for rod, link in self._pulling:
            in_rods[0, rod] = connections[link, 1]
        parts = np.r_[np.full(len(columns[0]), BEAM), [rod.part for rod in self._rods]]
        pairs = zip(columns, in_rods, strict=True)
        return [*(np.concatenate(pair) for pair in pairs), parts]

    def _write(self, simulation: Simulation, q: Array, columns: list[Array]) -> None:
        grid = simulation.grid
        ends = [motion_of(grid, place, [q])[0] for rod in self._rods for place in (rod.a, rod.b)]
        at_vertices = np.concatenate([q[grid.dofs], np.reshape(ends, (-1, 3))])
        at_dofs = at_vertices[self._vertex_of_dof]
        self._displacement.x.array.reshape(-1, 3)[:, :2] = at_dofs[:, :2]
        self._rotation.x.array[:] = at_dofs[:, 2]
        for values, function in zip(columns, self._in_cells, strict=True):
            function.x.array[:] = values[self._order]
        for function in (self._displacement, self._rotation, *self._in_cells):
            self._files[0].write_function(function, simulation.t)

    def close(self) -> None:
        """Close the file."""
        for file in self._files:
            file.close()
        self._files = []


class History(Recorder):
    """Table of the motion of places and of the ledger, one row a step, complete if the run dies.

    Columns: t; u, v, psi of each place; motion, force, work of each connector; then the entries of
    the ledger (J).

    Args:
        path: File, ending in ``.csv``.
        places: Places to follow, on beams and bodies.
        connectors: Connectors to follow, see :class:`~ufl_beam.joints.Connection`; of joints, all
            the connectors that hold them.
        every: Write every so many steps.
        most: Rows, besides the initial one, that the file may have.  When there are more, every
            other one goes, and only half as many steps are written from then on.

    Raises:
        SceneError: ``every`` or ``most`` is no whole number, at least 1.
    """

    def __init__(
        self,
        path: str | Path,
        places: Sequence[Anchor] = (),
        connectors: Sequence[Connector | Joint] = (),
        *,
        every: int = 1,
        most: int = UNLIMITED,
    ) -> None:
        require_path(path, "History: path")
        require_count(every, f"History {path}: every")
        require_count(most, f"History {path}: most")
        self._first_every, self._most = every, most
        self._path, self._places = Path(path), require_sequence(places, f"History {path}: places")
        self._connectors = require_sequence(connectors, f"History {path}: connectors")
        for i, place in enumerate(self._places):
            require_anchor(place, f"History {path}: places[{i}]")
        for i, one in enumerate(self._connectors):
            require_kind(one, (Connector, Joint), f"History {path}: connectors[{i}]")
        self._files: list[Any] = []

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if the file cannot be written."""
        _require_writable(self._path)

    def open(self, simulation: Simulation) -> None:
        """Write the header and the initial state."""
        header = self._prepare(simulation)
        row = self._row(simulation)
        self._every, self._steps, self._rows = self._first_every, 0, 0
        on_first(simulation.comm, lambda: self._begin(header, row))

    def _prepare(self, simulation: Simulation) -> list[str]:
        """Note what is followed; the header."""
        self._links = {
            link: name
            for followed in self._connectors
            for link, name in _named_links(simulation.scene, followed)
        }
        names = [f"{c} {place}" for place in self._places for c in ("u", "v", "psi")]
        names += [f"{c} {x}" for x in self._links.values() for c in ("motion", "force", "work")]
        return ["t", *names, *simulation.ledger_names()]

    def _begin(self, header: list[str], row: list[str]) -> None:
        self._files = [self._path.open("w", newline="")]
        self._write_row(header)
        self._write_row(row)

    def write(self, simulation: Simulation) -> None:
        """Write the row of the state, every so many steps."""
        self._steps += 1
        if self._steps % self._every:
            return
        if self._rows == self._most:
            on_first(simulation.comm, self._thin)
            self._rows, self._every = self._rows // 2, 2 * self._every
            if self._steps % self._every:
                return
        row = self._row(simulation)
        self._rows += 1
        on_first(simulation.comm, lambda: self._write_row(row))

    def _thin(self) -> None:
        """Leave out every other row; at no time is there less than one whole file."""
        self.close()
        thinner = self._path.with_suffix(".thinner")
        with self._path.open(newline="") as old, thinner.open("w", newline="") as new:
            new.write(next(old))
            new.writelines(islice(old, 0, None, 2))
        thinner.replace(self._path)
        self._files = [self._path.open("a", newline="")]

    def _row(self, simulation: Simulation) -> list[str]:
        q = simulation.share.gather(simulation.q)
        motion = [motion_of(simulation.grid, place, [q])[0] for place in self._places]
        links = list(self._links)
        connections = simulation.connections()[links, :3] if links else ()
        entries = {name: e for group in simulation.entries() for name, e in group.items()}
        energies = [entries[name] for name in simulation.ledger_names()]
        numbers = (simulation.t, *np.ravel(motion), *np.ravel(connections), *energies)
        return [repr(float(x)) for x in numbers]

    def state(self) -> State:
        """The length of the file, and the whole of it where rows may go again."""
        counts = np.array([self._every, self._steps, self._rows, 0], dtype=float)
        state = {"counts": counts, "content": np.empty(0, dtype=np.uint8)}
        if self._files:
            os.fsync(self._files[0].fileno())
            counts[3] = self._path.stat().st_size
            if self._most < UNLIMITED:
                state["content"] = _bytes_of(self._path)
        return state

    def resume(self, simulation: Simulation, state: State) -> None:
        """Cut off what was written after the state, and append."""
        header = self._prepare(simulation)
        self._every, self._steps, self._rows, length = map(int, state["counts"])
        on_first(simulation.comm, lambda: self._cut(header, state["content"], length))

    def _cut(self, header: list[str], content: Array, length: int) -> None:
        if len(content):
            self._path.write_bytes(content.tobytes())
        try:
            with self._path.open(newline="") as file:
                same = next(csv.reader(file)) == header and file.seek(0, os.SEEK_END) >= length
        except (OSError, StopIteration):
            same = False
        if not same:
            raise SceneError(
                f"History {self._path}: it is not the file that was written up to the checkpoint; "
                "bring it back, or delete the checkpoint to begin anew"
            )
        os.truncate(self._path, length)
        self._files = [self._path.open("a", newline="")]

    def _write_row(self, row: list[str]) -> None:
        csv.writer(self._files[0]).writerow(row)
        self._files[0].flush()

    def close(self) -> None:
        """Close the file."""
        for file in self._files:
            file.close()
        self._files = []


def _bytes_of(path: Path) -> Array:
    return np.fromfile(path, dtype=np.uint8)


def _named(domain: Any, element: Any, name: str) -> fem.Function:
    return fem.Function(fem.functionspace(domain, element), name=name)


def _named_links(scene: Scene, followed: Connector | Joint) -> list[tuple[int, str]]:
    """Numbers of links and their names, which tell alike ones between the same places apart."""
    links = links_of(scene, followed)
    if isinstance(followed, Connector):
        return [(links[0], f"{followed}, {type(followed.law).__name__}")]
    holders = [scene.links[link] for link in links]
    axes = ["psi" if c.turns else "xy"[abs(c.axis[1]) > abs(c.axis[0])] for c in holders]
    return [
        (link, f"{holder}, {axis}" if len(links) > 1 else str(holder))
        for link, holder, axis in zip(links, holders, axes, strict=True)
    ]


def _require_writable(path: Path) -> None:
    if not path.parent.is_dir():
        raise SceneError(f"output {path}: there is no directory {path.parent}; make it first")
    new = not path.exists()
    try:
        with path.open("ab"):
            pass
    except OSError as error:
        raise SceneError(f"output {path} cannot be written: {error.strerror}") from None
    if new:
        path.unlink()
