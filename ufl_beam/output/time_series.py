# SPDX-License-Identifier: MIT
"""Time series for ParaView and PyVista: a recorders of a scene as one data set of lines."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.errors import SceneError, require_count
from ufl_beam.model.bodies import Anchor, arm
from ufl_beam.model.connectors import Connector
from ufl_beam.model.scene import Scene, spots_of
from ufl_beam.output.output_files import changed, part_of, require_path
from ufl_beam.output.paraview_files import (
    LineFields,
    Lines,
    VtkhdfWriter,
    XdmfWriter,
    data_path,
)
from ufl_beam.output.postprocessing import turned
from ufl_beam.output.recorders import Recorder, StateView
from ufl_beam.parallel import on_first

BODY, LINK = 1, 2
"""Numbers of bodies and links among the parts of a scene; beams are 0."""


class Rod(NamedTuple):
    """Straight line between two anchors, of a body or a connector."""

    a: Anchor
    b: Anchor
    part: int  # BODY or LINK
    along: Connector | None = None  # whose force acts along it


def rods_of(scene: Scene) -> list[Rod]:
    """List the lines from the centre of each body to its points, and along links and springs."""
    spots, rods = spots_of(scene), []
    for body in scene.bodies:
        x, y = body.center
        # If something is attached to its centre alone, it is shown too, and turns.
        beside = body.at(x + 0.02 * scene.size, y)
        others = [s for s in spots[body] if s.point != body.center] or [beside]
        rods += [Rod(body.middle, spot, BODY) for spot in others]
    for joint in scene.joints:
        if joint.look in ("RigidLink", "Link"):
            a, b = joint.places
            pulls = next((c for c in joint.holders if c.stretches), None)
            rods.append(Rod(a, b, LINK, pulls))
    rods += [
        Rod(c.a, c.b, LINK, c if c.stretches else None)
        for c in scene.connectors
        if not c.turns and c.apart != (0.0, 0.0)
    ]
    return rods


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on it.

    Beams come first, node after node; behind them each line of a body or connector with two points
    of its own.  N is the force of a connector that acts along its line; V and M are zero there.
    """

    def __init__(self, simulation: StateView) -> None:
        grid, rods = simulation.grid, rods_of(simulation.scene)
        ends = [anchor for rod in rods for anchor in (rod.a, rod.b)]
        corners = np.reshape([anchor.point for anchor in ends], (-1, 2))
        own = len(grid.points) + np.arange(len(ends)).reshape(-1, 2)
        self.lines = Lines(
            np.insert(np.concatenate([grid.points, corners]), 2, 0.0, axis=1),
            np.concatenate([grid.pieces, own]),
            np.append(np.zeros(len(grid.pieces)), [rod.part for rod in rods]),
        )
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
        forces = simulation.section_forces()
        of_cells: dict[str, Array] = {name: forces[:, k] for k, name in enumerate("NVM")}
        if simulation.may_break:
            of_cells["jump"], of_cells["dissipated energy"] = simulation.damage()
        in_cells = {
            name: np.append(np.repeat(values, self._pieces_of_cell), np.zeros(self._num_rods))
            for name, values in of_cells.items()
        }
        if self._pulls:
            rods = in_cells["N"][len(self.lines.cells) - self._num_rods :]
            rods[[*self._pulls]] = simulation.connections()[[*self._pulls.values()], 1]
        return at_points, in_cells


class TimeSeries(Recorder):
    """Base of recorders of a scene as one data set of lines, see :class:`XDMF` and :class:`VTKHDF`.

    Attributes:
        ending: End of the name of the file.
        writer: Class of the writer, made of path, lines and fields of the first state; and to go
            on of what ``complete`` and ``sync()`` of an earlier one gave.
    """

    ending: ClassVar[str]
    writer: ClassVar[Any]

    def __init__(self, path: str | Path, *, every: int = 1) -> None:
        kind = type(self).__name__
        self._path = require_path(path, kind)
        require_count(every, f"{kind} {path}: every")
        self._every, self._count = every, 0
        if self._path.suffix != self.ending:
            raise SceneError(f"{kind} {path}: the name of the file must end in {self.ending}")
        self._writers: list[Any] = []  # on the first process one, while it is open

    def open(self, simulation: StateView) -> None:
        """Write the mesh and the initial state."""
        self._begin(simulation, 0)

    def resume(self, simulation: StateView, state: State) -> None:
        """Cut off what was written after the state, and go on."""
        count, *complete = (int(n) for n in state["sizes"])
        self._begin(simulation, count, complete, state["digest"].tobytes())

    def _begin(self, simulation: StateView, count: int, *before: Any) -> None:
        """Make the writer of a new file, or of one with what was ``before``."""
        self._comm: MPI.Intracomm = simulation.comm
        self._scene, self._count = LineData(simulation), count
        fields = self._scene.fields(simulation)

        def make() -> None:
            self.close()
            try:
                self._writers = [self.writer(self._path, self._scene.lines, fields, *before)]
            except (FileNotFoundError, ValueError):
                if not before:
                    raise
                raise changed(f"{type(self).__name__} {self._path}") from None
            if not before:
                self._writers[0].write(simulation.t, fields)

        on_first(self._comm, make)

    def write(self, simulation: StateView) -> None:
        """Write the state, every so many steps."""
        self._count += 1
        if self._count % self._every == 0:
            fields = self._scene.fields(simulation)
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
    writer = XdmfWriter

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
    writer = VtkhdfWriter

    @property
    def files(self) -> tuple[Path, ...]:
        """Path of the file, and of the one that takes its place when a run is restarted."""
        return self._path, part_of(self._path)
