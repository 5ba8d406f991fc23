"""Files that a run writes on the way."""

from __future__ import annotations

import csv
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import basix.ufl
import numpy as np

from ufl_beam.bodies import Anchor
from ufl_beam.compat import Array, fem, io, line_mesh
from ufl_beam.connectors import Connector, Joint
from ufl_beam.errors import SceneError, require_count
from ufl_beam.grid import Grid
from ufl_beam.joints import links_of, motion_of
from ufl_beam.scene import Scene
from ufl_beam.skeleton import BEAM, rods_of

if TYPE_CHECKING:
    from ufl_beam.simulation import Simulation


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
        require_count(every, f"XDMF {path}: every")
        self._path, self._every = Path(path), every
        if self._path.suffix != ".xdmf":
            raise SceneError(f"XDMF {path}: the name of the file must end in .xdmf")
        self._files: list[Any] = []

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if one of both files cannot be written."""
        _require_writable(self._path)
        _require_writable(self._path.with_suffix(".h5"))

    def open(self, simulation: Simulation) -> None:
        """Write the mesh and the initial state."""
        self._count = 0
        self._inelastic = len(simulation.material()) > 0
        self._rods = rods_of(simulation.scene)
        links = simulation.scene.links
        self._pulling = [
            (k, links.index(rod.along)) for k, rod in enumerate(self._rods) if rod.along is not None
        ]
        on_first(simulation.comm, lambda: self._begin(simulation.grid))
        self._put(simulation)

    def _begin(self, grid: Grid) -> None:
        # Rods have vertices of their own, as beams do.
        ends = [anchor.point for rod in self._rods for anchor in (rod.a, rod.b)]
        points = np.concatenate([grid.points, np.reshape(ends, (-1, 2))])
        more = len(grid.points) + np.arange(len(ends)).reshape(-1, 2)
        all_cells = np.concatenate([grid.cells, more])
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
        self._files = [io.XDMFFile(MPI.COMM_SELF, self._path, "w")]
        self._files[0].write_mesh(domain)

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
    """

    def __init__(
        self,
        path: str | Path,
        places: Sequence[Anchor] = (),
        connectors: Sequence[Connector | Joint] = (),
    ) -> None:
        self._path, self._places = Path(path), tuple(places)
        self._connectors = tuple(connectors)
        self._files: list[Any] = []

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if the file cannot be written."""
        _require_writable(self._path)

    def open(self, simulation: Simulation) -> None:
        """Write the header and the initial state."""
        self._links = {
            link: name
            for followed in self._connectors
            for link, name in _named_links(simulation.scene, followed)
        }
        names = [f"{c} {place}" for place in self._places for c in ("u", "v", "psi")]
        names += [f"{c} {x}" for x in self._links.values() for c in ("motion", "force", "work")]
        header = ["t", *names, *simulation.ledger_names()]
        row = self._row(simulation)
        on_first(simulation.comm, lambda: self._begin(header, row))

    def _begin(self, header: list[str], row: list[str]) -> None:
        self._files = [self._path.open("w", newline="")]
        self._write_row(header)
        self._write_row(row)

    def write(self, simulation: Simulation) -> None:
        """Write the row of the state."""
        row = self._row(simulation)
        on_first(simulation.comm, lambda: self._write_row(row))

    def _row(self, simulation: Simulation) -> list[str]:
        q = simulation.share.gather(simulation.q)
        motion = [motion_of(simulation.grid, place, [q])[0] for place in self._places]
        links = list(self._links)
        connections = simulation.connections()[links, :3] if links else ()
        entries = {name: e for group in simulation.entries() for name, e in group.items()}
        energies = [entries[name] for name in simulation.ledger_names()]
        numbers = (simulation.t, *np.ravel(motion), *np.ravel(connections), *energies)
        return [repr(float(x)) for x in numbers]

    def _write_row(self, row: list[str]) -> None:
        csv.writer(self._files[0]).writerow(row)
        self._files[0].flush()

    def close(self) -> None:
        """Close the file."""
        for file in self._files:
            file.close()
        self._files = []


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
