# SPDX-License-Identifier: MIT
"""Time series for ParaView and PyVista: scenes as lines, writers of files, recorders."""

from __future__ import annotations

import hashlib
import math
import mmap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.discretization.dof_numbering import turned
from ufl_beam.errors import ArgumentError, require_count
from ufl_beam.file_system import require_path
from ufl_beam.model.bodies import AttachmentPoint, arm
from ufl_beam.model.connectors import Connector
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.output.output_files import OutputFile, beside, changed
from ufl_beam.output.recorder import Restartable, StateView
from ufl_beam.parallel import on_first

# -- a scene as lines ------------------------------------------------------------------------------

LineFields = tuple[Mapping[str, Array], Mapping[str, Array]]
"""Fields at points, (n,) or (n, 3), and in cells, (m,), by name."""


class Lines(NamedTuple):
    """Mesh of straight lines."""

    points: Array  # (n, 3); m
    cells: Index  # indices of the points at both ends of each line; (m, 2)
    kinds: Array  # kind of each line: 0 for beams, or BODY, or CONNECTOR; (m,)


BODY, CONNECTOR = 1, 2
"""Kinds of lines: bodies, and links or connectors.  Lines of beams have the kind 0."""


class Rod(NamedTuple):
    """Straight line of a body or a connector, between two places."""

    a: AttachmentPoint
    b: AttachmentPoint
    group: int  # BODY or CONNECTOR
    along: Connector | None = None  # connector whose force acts along the line


def scene_rods(scene: Scene) -> list[Rod]:
    """Return lines from the centre of a body to its points, and along links and connectors."""
    spots, rods = attachment_points(scene), list[Rod]()
    for body in scene.bodies:
        x, y = body.center
        # A body with attachments at its centre alone also gets a line, which shows its rotation.
        beside = body.at(x + 0.02 * scene.size, y)
        others = [s for s in spots[body] if s.point != body.center] or [beside]
        rods += [Rod(body.middle, place, BODY) for place in others]
    for joint in scene.joints:
        if joint.is_rod:
            a, b = joint.places
            pulls = next((c for c in joint.holders if c.stretches), None)
            rods.append(Rod(a, b, CONNECTOR, pulls))
    rods += [
        Rod(c.a, c.b, CONNECTOR, c if c.stretches else None)
        for c in scene.connectors
        if not c.is_rotation and c.apart != (0.0, 0.0)
    ]
    return rods


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on these lines.

    Points and lines of beams come first.  Each line of a body or connector follows, with two points
    of its own.  There N is the force of a connector along its line, else 0; V and M are zero.
    """

    def __init__(self, simulation: StateView) -> None:
        numbering, rods = simulation.numbering, scene_rods(simulation.scene)
        ends = [end for rod in rods for end in (rod.a, rod.b)]
        corners = np.reshape([end.point for end in ends], (-1, 2))
        own = len(numbering.points) + np.arange(len(ends)).reshape(-1, 2)
        self.lines = Lines(
            np.insert(np.concatenate([numbering.points, corners]), 2, 0.0, axis=1),
            np.concatenate([numbering.pieces, own]),
            np.append(np.zeros(len(numbering.pieces)), [rod.group for rod in rods]),
        )
        self._nodes = np.concatenate([numbering.dofs, *(numbering.node(a)[None] for a in ends)])
        self._ends = slice(len(numbering.points), None)
        self._arms = np.reshape([arm(end) for end in ends], (-1, 2))
        connectors = simulation.scene.all_connectors
        # Connectors whose forces act along lines, by the index of the line in ``rods``
        self._pulls = {k: connectors.index(rod.along) for k, rod in enumerate(rods) if rod.along}
        self._pieces_per_cell, self._num_rods = numbering.mesh.degree, len(rods)

    def fields(self, simulation: StateView) -> LineFields:
        """Compute the fields of the present state, see :class:`XDMF`, on all processes together."""
        q = simulation.subdomain.gather(simulation.q)[self._nodes]
        arms = turned(self._arms, q[self._ends, 2])
        displacement = np.insert(q[:, :2], 2, 0.0, axis=1)
        displacement[self._ends, :2] += arms - self._arms
        at_points = {"displacement": displacement, "rotation": q[:, 2]}
        for velocities in simulation.velocities():
            v = simulation.subdomain.gather(velocities)[self._nodes]
            velocity = np.insert(v[:, :2], 2, 0.0, axis=1)
            velocity[self._ends, :2] += v[self._ends, 2:] * arms[:, ::-1] * (-1.0, 1.0)
            at_points |= {"velocity": velocity, "angular velocity": v[:, 2]}
        forces = simulation.section_forces()
        fields: dict[str, Array] = {name: forces[:, k] for k, name in enumerate("NVM")}
        if simulation.may_break:
            fields["jump"], fields["dissipated energy"] = simulation.damage()
        in_cells = {
            name: np.append(np.repeat(values, self._pieces_per_cell), np.zeros(self._num_rods))
            for name, values in fields.items()
        }
        if self._pulls:
            rods = in_cells["N"][len(self.lines.cells) - self._num_rods :]
            rods[[*self._pulls]] = simulation.connections()[[*self._pulls.values()], 1]
        return at_points, in_cells


# -- XDMF -----------------------------------------------------------------------------------------

HEAD = (
    b'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>'
    b'<Grid Name="scene" GridType="Collection" CollectionType="Temporal">\n'
)
TAIL = b"</Grid></Domain></Xdmf>\n<?spare "  # into its instruction go later steps
CLOSING = b"<?e?>"  # end of the instruction; after an earlier end, a separate instruction
PAGE, CAPACITY = mmap.PAGESIZE, 1 << 16


class Complete(NamedTuple):
    """Sizes of the complete steps in the file."""

    steps: int  # number of steps
    tail: int  # position of TAIL, the end of the document
    capacity: int  # position of CLOSING, the end of the spare instruction


class XdmfWriter:
    """Writer of a time series as XDMF: one XML file with a grid and its numbers for each step.

    A processing instruction of spaces, ``<?spare ... ?>``, follows the text.  A step is written
    into the instruction, with new closing tags.  Then the old closing tags, which lie within one
    page of memory, are overwritten with spaces, so that the step belongs to the document.  So an
    interrupted write leaves valid XML, and the cost of a step does not grow.

    The numbers are text because meshio reads no binary file with the numbers of several fields.
    They are not rounded.

    For a restart, ``complete`` has the sizes after the last complete step, and ``digest`` is the
    result of :meth:`sync`.  If the file differs, :class:`ValueError` is raised.
    """

    def __init__(
        self, path: Path, lines: Lines, fields: LineFields,
        complete: Sequence[int] | None = None, digest: bytes = b"",
    ) -> None:  # fmt: skip
        self._mesh = (  # part of the text of each step
            f'<Topology TopologyType="Polyline" NodesPerElement="2" '
            f'NumberOfElements="{len(lines.cells)}">{_item(lines.cells)}</Topology>'
            f'<Geometry GeometryType="XYZ">{_item(lines.points)}</Geometry>'
            f'<Attribute Name="part" AttributeType="Scalar" Center="Cell">'
            f"{_item(lines.kinds)}</Attribute>"
        )
        new, self._interrupted = complete is None, False
        self.complete = Complete(*(complete or (0, len(HEAD), CAPACITY)))
        self._xml = OutputFile(path, new=new)
        if new:
            self._xml.put(0, (HEAD + TAIL).ljust(CAPACITY) + CLOSING)
        else:
            short = self._xml.size < self.complete.capacity + len(CLOSING)
            if short or self.sync() != digest:
                self._xml.close()
                raise ValueError("not the file that was written up to there")
            self._cut()

    def write(self, t: float, fields: LineFields) -> None:
        """Append a step with its fields."""
        if self._interrupted:
            self._cut()
        self._interrupted = True
        steps, tail, capacity = self.complete
        text = f'<Grid Name="{steps}" GridType="Uniform"><Time Value="{t!r}"/>{self._mesh}'
        for center, by_name in zip(("Node", "Cell"), fields, strict=True):
            for name, values in by_name.items():
                form = "Vector" if values.ndim == 2 else "Scalar"
                text += f'<Attribute Name="{name}" AttributeType="{form}" Center="{center}">'
                text += f"{_item(values)}</Attribute>"
        # The text goes into the instruction, with a new tail that lies within one page.
        element, start = (text + "</Grid>\n").encode(), tail + len(TAIL)
        new_tail = start + len(element)
        if new_tail % PAGE + len(TAIL) > PAGE:
            new_tail += -new_tail % PAGE
        if (least := new_tail + len(TAIL)) > capacity:
            # CLOSING lies within one page, too
            new_capacity = least + CAPACITY + -(least + CAPACITY) % PAGE
            after = capacity + len(CLOSING)
            self._xml.put(after, b" " * (new_capacity - after))
            self._xml.put(new_capacity, CLOSING)
            self._xml.put(capacity, b" " * len(CLOSING))
            capacity = new_capacity
        self._xml.put(start, element.ljust(new_tail - start) + TAIL)  # still in the instruction
        self._xml.put(tail, b" " * len(TAIL))  # now in the document
        self.complete, self._interrupted = Complete(steps + 1, new_tail, capacity), False

    def _cut(self) -> None:
        """Delete the text after the last complete step; the document is valid at any time."""
        _, tail, capacity = self.complete
        self._xml.put(tail, TAIL)
        spare, after = tail + len(TAIL), capacity + len(CLOSING)
        self._xml.put(spare, b" " * (capacity - spare))
        self._xml.put(after, b" " * (self._xml.size - len(CLOSING) - after))
        self._xml.put(capacity, CLOSING)
        self._xml.cut(after)

    def sync(self) -> bytes:
        """Flush to the disk; return the SHA-256 of the document up to its tail."""
        self._xml.sync()
        return self._xml.digest(self.complete.tail)

    def close(self) -> None:
        """Close the file, without an incomplete last step."""
        try:
            if self._interrupted:
                self._cut()
        finally:
            self._xml.close()


def _item(values: Array | Index) -> str:
    """Return the XML element of numbers; ``repr`` does not round them."""
    kind, shape = "Int" if values.dtype.kind == "i" else "Float", " ".join(map(str, values.shape))
    numbers = " ".join(map(repr, values.ravel().tolist()))
    head = f'<DataItem Dimensions="{shape}" NumberType="{kind}" Precision="8" Format="XML">'
    return f"{head}{numbers}</DataItem>"


# -- VTKHDF ---------------------------------------------------------------------------------------

FORMAT_VERSION = (2, 0)  # version of the format; VTK 9.3 warns of later versions
LINE = 3  # VTK_LINE, VTK's type of line cells
KINDS = ("PointData", "CellData")  # groups of fields
ZERO_OFFSETS = {  # rows of each step; they are equal because all steps have one mesh
    "Steps/PartOffsets": np.array([0]),
    "Steps/CellOffsets": np.array([[0]]),
    "Steps/NumberOfParts": np.array([1]),
}
ROWS = 1024  # number of steps in a chunk of a data set with one number for each step
BLOCK = 4096  # number of rows in a chunk of a field, unless one step has more
INDEX = 1 << 20  # upper bound of the growth of the indices of all data sets in a step; bytes


class VtkhdfWriter:
    """Writer of a time series as VTKHDF: the mesh is written once, fields in each step.

    The layout is "UnstructuredGrid" of version 2.0 with "Steps", see the documentation of VTK's
    file formats; VTK 9.3, PyVista and ParaView 5.13 read it.  All data sets are created at the
    beginning: a kill during the creation of a data set damages the file more easily than a kill
    during its growth.  HDF5 crashes when a disk is full, so the space for a step is allocated
    first.

    Only names and shapes of ``fields`` are used.  For a restart, ``complete`` has the number of
    complete steps, and ``digest`` is the result of :meth:`sync`.  If the file differs,
    :class:`ValueError` is raised.
    """

    def __init__(
        self, path: Path, lines: Lines, fields: LineFields,
        complete: Sequence[int] | None = None, digest: bytes = b"",
    ) -> None:  # fmt: skip
        import h5py

        self.complete = (*(complete or (0,)),)  # number of complete steps
        rows = _rows(0.0, 0, fields)
        self._output = OutputFile(path if complete is None else beside(path, ".part"))
        self._output.put(0, _empty_file(lines, rows, fields))
        # Without a lock, other programs can read the file during the run.
        self._file = h5py.File(self._output.path, "r+", locking=False)
        self._root = self._file["VTKHDF"]
        self._growing = {name: (self._root[name], len(values)) for name, values in rows.items()}
        self._hashes = [hashlib.sha256() for _ in rows]
        self._hashed = 0  # steps that the checksums include
        chunks = (dataset.chunks for dataset, _ in self._growing.values())
        self._step_size = INDEX + sum(8 * math.prod(chunk) for chunk in chunks)
        if complete is not None:
            self._resume(path, digest)

    def _resume(self, path: Path, digest: bytes) -> None:
        """Copy the complete steps of a file, and replace the file if the digest agrees.

        So the run does not append to a damaged file, in which HDF5 may crash.
        """
        import h5py

        try:
            self._output.allocate(path.stat().st_size + 2 * self._step_size)
            try:
                with h5py.File(path, "r", locking=False) as file:
                    for name, (new, rows) in self._growing.items():
                        old = file["VTKHDF"][name]
                        new.resize(self.complete[0] * rows, axis=0)
                        for first in range(0, len(new), BLOCK):
                            new[first : first + BLOCK] = old[first : min(first + BLOCK, len(new))]
            except Exception:  # many kinds, which HDF5 raises for damaged files
                raise ValueError("the file is damaged") from None
            self._cut()
            if self.sync() != digest:
                raise ValueError("not the file that was written up to there")
        except BaseException:
            self.close()
            self._output.path.unlink()
            raise
        self._output.rename(path)

    def write(self, t: float, fields: LineFields) -> None:
        """Append a step with its fields."""
        self._output.allocate(self._file.id.get_filesize() + self._step_size)
        (steps,) = self.complete
        (times, time), *others = _rows(t, steps, fields).items()
        for name, values in others:
            self._put(name, values)
        self._file.flush()
        # The data of the step are in the file.  Its time and the number of steps follow last.
        self._put(times, time)
        self._root["Steps"].attrs.modify("NSteps", np.int64(steps + 1))
        self._file.flush()
        self.complete = (steps + 1,)

    def _put(self, name: str, values: Array) -> None:
        """Write the rows of the next step by HDF5's low-level functions, which are faster."""
        from h5py import h5s

        dataset, (rows, *components) = self._growing[name][0].id, values.shape
        first = self.complete[0] * rows
        dataset.set_extent((first + rows, *components))
        space = h5s.create_simple((first + rows, *components))
        space.select_hyperslab((first, *(0 for _ in components)), values.shape)
        dataset.write(h5s.create_simple(values.shape), space, np.ascontiguousarray(values))

    def _cut(self) -> None:
        """Delete data after the last complete step; times first, as extra times crash VTK 9.3."""
        (times, _), *others = self._growing.values()
        times.resize(self.complete[0], axis=0)
        self._file.flush()
        self._root["Steps"].attrs.modify("NSteps", np.int64(self.complete[0]))
        self._file.flush()
        for dataset, rows in others:
            dataset.resize(self.complete[0] * rows, axis=0)
        self._file.flush()

    def sync(self) -> bytes:
        """Flush to the disk; return a SHA-256 of all numbers; each number is read once."""
        self._file.flush()
        self._output.sync()
        whole = hashlib.sha256()
        for (dataset, rows), hashed in zip(self._growing.values(), self._hashes, strict=True):
            end = self.complete[0] * rows
            for first in range(self._hashed * rows, end, BLOCK):
                hashed.update(dataset[first : min(first + BLOCK, end)])
            whole.update(hashed.digest())
        self._hashed = self.complete[0]
        return whole.digest()

    def close(self) -> None:
        """Close the file, without an incomplete last step."""
        try:
            self._cut()
        finally:
            self._file.close()
            self._output.close()


def _rows(t: float, n: int, fields: LineFields) -> dict[str, Array]:
    """Return the rows that the n-th step adds to each growing data set; the time comes first."""
    rows = {"Steps/Values": np.array([t])}
    offsets = {}
    for kind, by_name in zip(KINDS, fields, strict=True):
        rows |= {f"{kind}/{name}": values for name, values in by_name.items()}
        first, length = next((name, len(values)) for name, values in by_name.items())
        offsets[f"Steps/{kind}Offsets/{first}"] = np.array([n * length])
    return {**rows, **offsets, **ZERO_OFFSETS}


def _empty_file(lines: Lines, rows: dict[str, Array], fields: LineFields) -> bytes:
    """Return the content of a file without steps."""
    import h5py

    with h5py.File("vtkhdf", "w", driver="core", backing_store=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(FORMAT_VERSION)
        root.attrs["Type"] = np.bytes_("UnstructuredGrid")  # VTK refuses a str
        root["NumberOfPoints"] = np.array([len(lines.points)])
        root["NumberOfCells"] = np.array([len(lines.cells)])
        root["NumberOfConnectivityIds"] = np.array([lines.cells.size])
        root["Points"] = lines.points
        root["Connectivity"] = lines.cells.ravel()
        root["Offsets"] = 2 * np.arange(len(lines.cells) + 1)
        root["Types"] = np.full(len(lines.cells), LINE, dtype=np.uint8)
        root["CellData/part"] = lines.kinds
        steps = root.create_group("Steps")
        # HDF5 writes in the order of addresses: first the number of steps, then their times.
        steps.attrs["NSteps"] = np.int64(0)
        for name, values in rows.items():
            count, *shape = values.shape
            chunk = count * max(1, BLOCK // count) if name.startswith(KINDS) else ROWS
            root.create_dataset(
                name, (0, *shape), values.dtype, maxshape=(None, *shape), chunks=(chunk, *shape)
            )
        # Equal offsets of several fields are one data set with several names.
        steps["PointOffsets"] = steps["CellDataOffsets/part"] = steps["PartOffsets"]
        steps["ConnectivityIdOffsets"] = steps["CellOffsets"]
        for kind, (first, *others) in zip(KINDS, fields, strict=True):
            for name in others:
                steps[f"{kind}Offsets/{name}"] = steps[f"{kind}Offsets/{first}"]
        file.flush()
        return bytes(file.id.get_file_image())


# -- recorders -------------------------------------------------------------------------------------


class TimeSeries(Restartable):
    """Base of recorders of a scene as one data set of lines, see :class:`XDMF` and :class:`VTKHDF`.

    Attributes:
        endings: Suffixes that the name of the file may have.
        second: Suffixes that are added to the name of the file for further files.
        limit: Largest number of points.
        writer: Class of the writer.  Its arguments are the path, lines, and fields of the first
            state; for a restart also ``complete`` and the ``sync()`` of the earlier writer.
    """

    endings: ClassVar[tuple[str, ...]]
    second: ClassVar[tuple[str, ...]] = ()
    limit: ClassVar[float] = math.inf
    writer: ClassVar[Any]

    def __init__(self, path: str | Path, *, every: int = 1) -> None:
        kind = type(self).__name__
        self._path = require_path(path, kind)
        self.files = (self._path, *(beside(self._path, suffix) for suffix in self.second))
        require_count(every, f"{kind} {path}: every")
        self._every, self._count = every, 0
        if self._path.suffix not in self.endings:
            endings = " or ".join(self.endings)
            raise ArgumentError(f"{kind} {path}: the name of the file must end in {endings}")
        self._writers: list[Any] = []  # one writer on the first process while it is open

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Write mesh and initial state, or delete the steps that follow a :meth:`state`."""
        self._comm: MPI.Intracomm = simulation.comm
        self._scene, self._count, before = LineData(simulation), 0, tuple[Any, ...]()
        if (points := len(self._scene.lines.points)) > self.limit:
            raise ArgumentError(
                f"{type(self).__name__} {self._path}: ParaView cannot read fields of {points} "
                f"points, more than {self.limit:.0f}, as text; write a VTKHDF file"
            )
        if state is not None:
            self._count, *complete = map(int, state["sizes"])
            before = complete, state["digest"].tobytes()
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
        """Write the state after every ``every`` steps."""
        self._count += 1
        if self._count % self._every == 0:
            fields = self._scene.fields(simulation)
            on_first(self._comm, lambda: self._writers[0].write(simulation.t, fields))

    def state(self) -> State:
        """Flush to the disk; return numbers of steps, and sizes and a checksum of the files."""
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
    """Time series for ParaView and meshio: all fields of a step on one data set of lines.

    Points have ``displacement`` (3 components; m) and ``rotation`` (rad), in dynamics also
    ``velocity`` (m/s) and ``angular velocity`` (rad/s).  Cells have ``N``, ``V`` (N), ``M`` (N m)
    in their middle; if something may yield or break, also the ``jump`` of the hinge (rad) and the
    ``dissipated energy`` (J).  ``part`` is 0 in beams; 1 in lines from the centre of each body to
    its points; 2 along links and connectors, where N is a force along the line.

    At any moment, also after a kill, the file is valid and has all complete steps.  The cost of a
    step does not grow with the number of steps.  In path following, the time is the load factor.
    The numbers are text, so files of :class:`VTKHDF` are opened faster if there are many cells.

    Args:
        path: File, ending in ``.xdmf``.
        every: Number of steps between written states.

    Raises:
        ArgumentError: ``every`` is no positive whole number, the path does not end in ``.xdmf``,
            or (in the run) there are more than 130 000 points, which ParaView cannot read.

    Example:
        >>> film = ub.XDMF("beam.xdmf", every=5)
        >>> solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=film)
        >>> [path.name for path in film.files]
        ['beam.xdmf']
    """

    endings = (".xdmf",)
    limit = 130e3  # libxml2 reads no text of 10 MB; a vector has up to 75 characters
    writer = XdmfWriter


class VTKHDF(TimeSeries):
    """Time series for PyVista, ParaView and VTK in one HDF5 file, with the fields of :class:`XDMF`.

    Each step is flushed, so the file can be read during the run.  After a kill the file has all
    complete steps, except in the microseconds in which HDF5 rearranges its index.  A restarted run
    checks the numbers and continues in a copy, because HDF5 may crash in a damaged file.

    Args:
        path: File, ending in ``.hdf`` or ``.vtkhdf``.  PyVista reads only names in ``.hdf``.
        every: Number of steps between written states.

    Raises:
        ArgumentError: ``every`` is no positive whole number, or the path has another ending.

    Example:
        >>> film = ub.VTKHDF("beam.hdf", every=5)
        >>> solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=film)
        >>> [path.name for path in film.files]
        ['beam.hdf', 'beam.hdf.part']
    """

    endings, second = (".hdf", ".vtkhdf"), (".part",)
    writer = VtkhdfWriter
