# SPDX-License-Identifier: MIT
"""Time series for ParaView and PyVista: recorders of a scene as one data set of lines."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.errors import SceneError, require_count
from ufl_beam.model.bodies import arm
from ufl_beam.output.joint_histories import turned
from ufl_beam.output.output_files import changed, part_of, require_path
from ufl_beam.output.recorders import Recorder
from ufl_beam.output.scene_lines import rods_of
from ufl_beam.output.state_view import StateView
from ufl_beam.output.vtkhdf import VtkhdfWriter
from ufl_beam.output.xdmf import Complete, XdmfWriter, data_path
from ufl_beam.parallel import on_first

LineFields = tuple[dict[str, Array], dict[str, Array]]  # at points, (n,) or (n, 3); in cells, (m,)


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on it.

    Beams come first, node after node; behind them each line of a body or connector with two points
    of its own.  N is the force of a connector that acts along its line; V and M are zero there.
    """

    def __init__(self, simulation: StateView) -> None:
        grid, rods = simulation.grid, rods_of(simulation.scene)
        ends = [anchor for rod in rods for anchor in (rod.a, rod.b)]
        corners = np.reshape([anchor.point for anchor in ends], (-1, 2))
        self.points = np.insert(np.concatenate([grid.points, corners]), 2, 0.0, axis=1)
        lines = len(grid.points) + np.arange(len(ends)).reshape(-1, 2)
        self.cells: Index = np.concatenate([grid.pieces, lines])
        self.parts = np.append(np.zeros(len(grid.pieces)), [rod.part for rod in rods])
        self._nodes = np.concatenate([grid.dofs, *(grid.node(a)[None] for a in ends)])
        self._ends = slice(len(grid.points), None)
        self._arms = np.reshape([arm(anchor) for anchor in ends], (-1, 2))
        links = simulation.scene.links
        # Lines, and the links whose forces act along them
        self._pulls = {k: links.index(rod.along) for k, rod in enumerate(rods) if rod.along}
        self._pieces_of_cell, self._num_rods = grid.mesh.degree, len(rods)

    def fields(self, simulation: StateView) -> LineFields:
        """Compute the fields of the present state, see :class:`XDMF`; all processes call it."""
        q = simulation.share.gather(simulation.q)[self._nodes]
        arms = turned(self._arms, q[self._ends, 2])
        displacement = np.insert(q[:, :2], 2, 0.0, axis=1)
        displacement[self._ends, :2] += arms - self._arms
        at_points = {"displacement": displacement, "rotation": q[:, 2]}
        for velocities in simulation.velocities():
            v = simulation.share.gather(velocities)[self._nodes]
            velocity = np.insert(v[:, :2], 2, 0.0, axis=1)
            velocity[self._ends, :2] += v[self._ends, 2:] * arms[:, ::-1] * (-1.0, 1.0)
            at_points |= {"velocity": velocity, "angular velocity": v[:, 2]}
        return at_points, self._in_cells(simulation)

    def _in_cells(self, simulation: StateView) -> dict[str, Array]:
        forces = simulation.section_forces()
        in_cells: dict[str, Array] = {name: forces[:, k] for k, name in enumerate("NVM")}
        if simulation.may_break:
            in_cells["jump"], in_cells["dissipated energy"] = simulation.damage()
        in_lines = {
            name: np.append(np.repeat(values, self._pieces_of_cell), np.zeros(self._num_rods))
            for name, values in in_cells.items()
        }
        if self._pulls:
            rods = in_lines["N"][len(self.cells) - self._num_rods :]
            rods[[*self._pulls]] = simulation.connections()[[*self._pulls.values()], 1]
        return in_lines


class TimeSeries(Recorder):
    """Time series of a scene as one data set of lines, see :class:`XDMF` and :class:`VTKHDF`."""

    ending: str

    def __init__(self, path: str | Path, *, every: int = 1) -> None:
        kind = type(self).__name__
        self._path = require_path(path, kind)
        require_count(every, f"{kind} {path}: every")
        self._every, self._count = every, 0
        if self._path.suffix != self.ending:
            raise SceneError(f"{kind} {path}: the name of the file must end in {self.ending}")
        self._writers: list[Any] = []

    def open(self, simulation: StateView) -> None:
        """Write the mesh and the initial state."""
        self._count = 0
        fields = self._prepare(simulation)
        on_first(simulation.comm, lambda: self._begin(simulation.t, fields))

    def _prepare(self, simulation: StateView) -> LineFields:
        """Note the mesh; the fields of the present state."""
        self._comm: MPI.Intracomm = simulation.comm
        self._lines = LineData(simulation)
        return self._lines.fields(simulation)

    def _begin(self, t: float, fields: LineFields) -> None:
        self.close()
        self._writers = [self._writer(fields)]
        self._writers[0].write(t, fields)

    @abstractmethod
    def _writer(
        self, fields: LineFields, complete: Sequence[int] | None = None, digest: bytes = b""
    ) -> Any:
        """Make the writer of a file, or of one that is complete up to some sizes."""

    def write(self, simulation: StateView) -> None:
        """Write the state, every so many steps."""
        self._count += 1
        if self._count % self._every == 0:
            fields = self._lines.fields(simulation)
            on_first(self._comm, lambda: self._writers[0].write(simulation.t, fields))

    def state(self) -> State:
        """Return the number of steps, and sizes and checksum of what is complete, on the disk."""
        digests: list[bytes] = []
        on_first(self._comm, lambda: digests.extend(writer.sync() for writer in self._writers))
        sizes = [n for writer in self._writers for n in writer.complete]
        return {
            "sizes": np.array([self._count, *sizes], dtype=float),
            "digest": np.frombuffer(b"".join(digests), dtype=np.uint8),
        }

    def resume(self, simulation: StateView, state: State) -> None:
        """Cut off what was written after the state, and go on."""
        self._count, *sizes = (int(n) for n in state["sizes"])
        fields, digest = self._prepare(simulation), state["digest"].tobytes()
        on_first(simulation.comm, lambda: self._take_back(fields, sizes, digest))

    def _take_back(self, fields: LineFields, sizes: list[int], digest: bytes) -> None:
        try:
            self._writers = [self._writer(fields, sizes, digest)]
        except (FileNotFoundError, ValueError):
            raise changed(f"{type(self).__name__} {self._path}") from None

    def close(self) -> None:
        """Close the files of the time series."""
        writers, self._writers = self._writers, []
        for writer in writers:
            writer.close()


class XDMF(TimeSeries):
    """Time series for ParaView: all fields of a step on one data set of lines.

    At points ``displacement`` (3 components; m) and ``rotation`` (rad), in dynamics also
    ``velocity`` (m/s) and ``angular velocity`` (rad/s).  In cells ``N``, ``V`` (N), ``M`` (N m), as
    in their middle; where something yields or breaks, also the ``jump`` of the hinge (rad) and the
    ``dissipated energy`` (J).  ``part`` is 0 in beams; 1 in lines from the centre of each body to
    its points; 2 along links and springs, where N is the force of what pulls along its line.

    The file is valid and has all complete steps at any moment, also after a kill.  A step costs the
    same however many there are.  On a path the time is the load factor.

    Args:
        path: File, ending in ``.xdmf``; its numbers are beside it in a file of the same name with
            ``.bin`` behind it.
        every: Write every so many steps.

    Raises:
        SceneError: ``every`` is no whole number of steps, or the path does not end in ``.xdmf``.

    Example:
        >>> film = ub.XDMF("beam.xdmf", every=5)
        >>> solution = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=film)
        >>> [path.name for path in film.files]
        ['beam.xdmf', 'beam.xdmf.bin']
    """

    ending = ".xdmf"

    @property
    def files(self) -> tuple[Path, ...]:
        """Paths of the file, and of that of its numbers."""
        return self._path, data_path(self._path)

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if a file cannot be written, or its name stand in XML."""
        name = self._path.name
        if name != name.strip() or not name.isprintable():
            raise SceneError(
                f"XDMF {name!r}: spaces at the ends and characters that cannot be printed do not "
                "survive in XML; take another name"
            )
        super().require_writable()

    def _writer(
        self, fields: LineFields, complete: Sequence[int] | None = None, digest: bytes = b""
    ) -> XdmfWriter:
        lines, sizes = self._lines, None if complete is None else Complete(*complete)
        return XdmfWriter(self._path, lines.points, lines.cells, lines.parts, sizes, digest)


class VTKHDF(TimeSeries):
    """Time series for ParaView, VTK and PyVista in one HDF5 file, with the fields of :class:`XDMF`.

    Each step is flushed, so the file can be read during the run.  After a kill it has all complete
    steps, except if HDF5 was just rearranging its index, for some microseconds.  A restarted run
    compares the numbers and goes on in a copy, as HDF5 may crash in a damaged file.

    Args:
        path: File, ending in ``.vtkhdf``.
        every: Write every so many steps.

    Raises:
        SceneError: ``every`` is no whole number of steps, or the path does not end in
            ``.vtkhdf``.

    Example:
        >>> film = ub.VTKHDF("beam.vtkhdf", every=5)
        >>> solution = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=film)
        >>> [path.name for path in film.files]
        ['beam.vtkhdf', 'beam.vtkhdf.part']
    """

    ending = ".vtkhdf"

    @property
    def files(self) -> tuple[Path, ...]:
        """Path of the file, and of the one that takes its place when a run is restarted."""
        return self._path, part_of(self._path)

    def _writer(
        self, fields: LineFields, complete: Sequence[int] | None = None, digest: bytes = b""
    ) -> VtkhdfWriter:
        lines, steps = self._lines, None if complete is None else complete[0]
        mesh = lines.points, lines.cells, lines.parts
        return VtkhdfWriter(self._path, *mesh, fields, steps, digest)
