# SPDX-License-Identifier: MIT
"""Time series for ParaView and PyVista: scenes as lines with fields, and recorders of them."""

from __future__ import annotations

import hashlib
import math
import mmap
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.errors import ArgumentError
from ufl_beam.model.bodies import AttachmentPoint
from ufl_beam.model.connectors import Connector
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.output.internal_variables import in_cells
from ufl_beam.output.output_files import OutputFile, beside
from ufl_beam.output.recorder import FileRecorder, StateView
from ufl_beam.output.section_forces import Diagram, DiagramInSpace

# -- scenes as lines -------------------------------------------------------------------------------

LineFields = tuple[Mapping[str, Array], Mapping[str, Array]]
"""Fields at points, (n,) or (n, 3), and in cells, (m,), by name."""


BODY, CONNECTOR = 1, 2  # kinds of lines: bodies, and links or connectors


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
        # A body with attachments at its centre alone also gets a line, which shows its rotation.
        x, *others = body.center
        beside = body.at(x + 0.02 * scene.size, *others)
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
        if not c.is_rotation and any(c.apart)
    ]
    return rods


class LineData:
    """Geometry of beams, bodies and connectors as lines, and the fields of a state on these lines.

    Points and lines of beams come first.  Each line of a body or connector follows, with two points
    of its own.  There N is the force of a connector along its line; other section forces are zero.

    Attributes:
        points: Coordinates of points; (n, 3); m.
        cells: Indices of the points at both ends of each line; (m, 2).
        kinds: Kind of each line: 0 for beams, or BODY, or CONNECTOR; (m,).
    """

    def __init__(self, simulation: StateView) -> None:
        numbering, rods = simulation.numbering, scene_rods(simulation.scene)
        self._ends = [end for rod in rods for end in (rod.a, rod.b)]
        own = len(numbering.points) + np.arange(len(self._ends)).reshape(-1, 2)
        points = np.array([*numbering.points, *(end.point for end in self._ends)])
        self.points: Array = in_three(points)
        self.cells: Index = np.concatenate([numbering.pieces, own])
        self.kinds = np.append(np.zeros(len(numbering.pieces)), [rod.group for rod in rods])
        connectors = simulation.scene.all_connectors
        # Connectors whose forces act along lines, by the index of the line in ``rods``
        self._pulls = {k: connectors.index(rod.along) for k, rod in enumerate(rods) if rod.along}
        self._pieces_per_cell, self._num_rods = numbering.mesh.degree, len(rods)

    def fields(self, simulation: StateView) -> LineFields:
        """Compute the fields of the present state, see :class:`XDMF`, on all processes together."""
        now, at_points, d = simulation.now, dict[str, Array](), simulation.numbering.displacements
        motions = [("rotation", "displacement", now.motion_of_nodes(0), now.displacement)]
        if len(v := now.v):
            of_nodes = v[0, simulation.numbering.dofs]
            motions.append(("angular velocity", "velocity", of_nodes, now.velocity))
        for turning, moving, of_nodes, of_place in motions:
            values = np.array([*of_nodes, *(of_place(end)[0] for end in self._ends)])
            at_points[moving] = in_three(values[:, :d])
            at_points[turning] = values[:, 2] if d == 2 else values[:, d:]
        forces = simulation.section_forces()
        names = (Diagram if d == 2 else DiagramInSpace)._fields[1:]
        fields: dict[str, Array] = dict(zip(names, forces.T, strict=True))
        if simulation.may_break:
            fields["jump"], fields["dissipated energy"] = simulation.damage()
            variables = in_cells(simulation.numbering, simulation.internal())
            fields |= {f"state.{name}": values for name, values in variables.items()}
        of_lines = {
            name: np.append(np.repeat(values, self._pieces_per_cell), np.zeros(self._num_rods))
            for name, values in fields.items()
        }
        if self._pulls:
            rods = of_lines["N"][len(self.cells) - self._num_rods :]
            rods[[*self._pulls]] = simulation.connections()[[*self._pulls.values()], 1]
        return at_points, of_lines


def in_three(points: Array) -> Array:
    """Return points in the plane with a third coordinate 0, and those in space; (..., 3)."""
    flat = np.zeros((*points.shape[:-1], 3 - points.shape[-1]))
    return np.concatenate([points, flat], axis=-1)


# -- time series -----------------------------------------------------------------------------------

Step = tuple[float, LineFields]  # time, s, or load factor; fields


class TimeSeries(FileRecorder):
    """Base of :class:`XDMF` and :class:`VTKHDF`, whose files have one data set of lines.

    The first of the ``complete`` sizes is the number of steps in the file.

    Attributes:
        endings: Suffixes that the name of the file may have.
        second: Suffixes that are added to the name of the file for further files.
        limit: Largest number of points.
    """

    endings: ClassVar[tuple[str, ...]]
    second: ClassVar[tuple[str, ...]] = ()
    limit: ClassVar[float] = math.inf

    def __init__(self, path: str | Path, *, every: int = 1) -> None:
        super().__init__(path, every)
        self.files = (self._path, *(beside(self._path, suffix) for suffix in self.second))
        if self._path.suffix not in self.endings:
            endings = " or ".join(self.endings)
            raise ArgumentError(f"{self._what}: the name of the file must end in {endings}")

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Write mesh and initial state, or delete the steps that follow a :meth:`state`."""
        self._scene = LineData(simulation)
        if (points := len(self._scene.points)) > self.limit:
            raise ArgumentError(
                f"{self._what}: ParaView cannot read fields of {points} points, more than "
                f"{self.limit:.0f}, as text; write a VTKHDF file"
            )
        super().begin(simulation, state)

    def _row(self, simulation: StateView) -> Step:
        return simulation.t, self._scene.fields(simulation)


# -- XDMF -----------------------------------------------------------------------------------------

HEAD = (
    b'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>'
    b'<Grid Name="scene" GridType="Collection" CollectionType="Temporal">\n'
)
SPARE, CLOSING = b"<?spare ?>", b"?>"  # processing instruction; its last characters
END = b"</Grid></Domain></Xdmf>\n" + SPARE
PAGE = mmap.PAGESIZE


class XDMF(TimeSeries):
    """Time series for ParaView and meshio: all fields of a step on one data set of lines.

    Points have ``displacement`` (3 components; m) and ``rotation`` (rad), in dynamics also
    ``velocity`` (m/s) and ``angular velocity`` (rad/s).  Cells have ``N``, ``V`` (N), ``M`` (N m)
    in their middle, in space ``N``, ``V2``, ``V3``, ``T``, ``M2``, ``M3``; if something may yield
    or break, also the ``jump`` of the hinge (rad), the ``dissipated energy`` (J), and the internal
    variables of laws, such as ``state.plastic``, with their values of the largest magnitude in a
    cell.  ``part`` is 0 in beams; 1 in lines from the
    centre of each body to its points; 2 along links and connectors, where N is a force along the
    line.

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

    # An interrupted write ends between two pages of memory.  Each END lies within one page, so that
    # the file is valid XML after each write of `_append` and `_cut`, and if a write is interrupted.
    # The numbers are text because meshio reads no binary file with the numbers of several fields.

    def _start(self, row: Step, digest: bytes | None) -> OutputFile:
        scene = self._scene
        self._mesh = (  # part of the text of each step
            f'<Topology TopologyType="Polyline" NodesPerElement="2" '
            f'NumberOfElements="{len(scene.cells)}">{_item(scene.cells)}</Topology>'
            f'<Geometry GeometryType="XYZ">{_item(scene.points)}</Geometry>'
            f'<Attribute Name="part" AttributeType="Scalar" Center="Cell">'
            f"{_item(scene.kinds)}</Attribute>"
        )
        # Number of steps, and position of END; earlier versions stored a further size
        _, end = self.complete = self.complete[:2] or (0, len(HEAD))
        file = self._open(self._path, new=digest is None)
        if digest is None:
            file.put(0, HEAD + END)
        elif file.size < end + len(END):
            raise ValueError("the file is too short")
        return file

    def _append(self, row: Step) -> None:
        self._cut()  # after an interrupted write
        (steps, end), (t, fields) = self.complete, row
        text = f'<Grid Name="{steps}" GridType="Uniform"><Time Value="{t!r}"/>{self._mesh}'
        for center, by_name in zip(("Node", "Cell"), fields, strict=True):
            for name, values in by_name.items():
                form = "Vector" if values.ndim == 2 else "Scalar"
                text += f'<Attribute Name="{name}" AttributeType="{form}" Center="{center}">'
                text += f"{_item(values)}</Attribute>"
        element, begin = (text + "</Grid>\n").encode(), end + len(END)
        new_end = begin + len(element)
        if new_end % PAGE + len(END) > PAGE:
            new_end += -new_end % PAGE
        size = new_end + len(END) - begin
        # The instruction of END is extended to the end of the file, which is spaces, then contains
        # the step with a new END.  Without the old END, the step belongs to the document.
        self._file.put(begin, SPARE.rjust(size))
        self._file.put(begin - len(CLOSING), b" " * len(CLOSING))
        self._file.put(begin, element.ljust(size - len(END)) + END)
        self._file.put(end, b" " * len(END))
        self.complete = steps + 1, new_end

    def _cut(self) -> None:
        _, end = self.complete
        if self._file.size > (after := end + len(END)):
            later = self._file.read(after, self._file.size - after)
            if SPARE in later:  # the instruction of END is extended to the last SPARE
                self._file.put(end, END.removesuffix(CLOSING).ljust(len(END)))
                self._file.put(after, b" " * later.rindex(SPARE))
            self._file.put(end, END)
            self._file.cut(after)

    def _sync(self) -> bytes:
        self._file.sync()
        return self._file.digest(self.complete[1])


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

    # The layout is "UnstructuredGrid" of version 2.0 with "Steps", see the documentation of VTK's
    # file formats; VTK 9.3, PyVista and ParaView 5.13 read it.  All data sets are created at the
    # beginning: a kill during the creation of a data set damages the file more easily than a kill
    # during its growth.  HDF5 crashes when a disk is full, so the space for a step is allocated
    # first.

    def _start(self, row: Step, digest: bytes | None) -> OutputFile:
        import h5py

        rows, self.complete = _rows(row, 0), self.complete or (0,)
        if digest is not None:  # unless the copy replaces the file
            self._closing.callback(self.files[1].unlink, missing_ok=True)
        file = self._open(self.files[digest is not None])
        file.put(0, _empty_file(self._scene, rows, row[1]))
        # Without a lock, other programs can read the file during the run.
        self._h5 = h5py.File(file.path, "r+", locking=False)
        self._closing.callback(self._h5.close)
        self._root = self._h5["VTKHDF"]
        self._growing = {name: (self._root[name], len(values)) for name, values in rows.items()}
        self._hashes = [hashlib.sha256() for _ in rows]
        self._hashed = 0  # steps that the checksums include
        chunks = (dataset.chunks for dataset, _ in self._growing.values())
        self._step_size = INDEX + sum(8 * math.prod(chunk) for chunk in chunks)
        if digest is not None:
            file.allocate(self._path.stat().st_size + 2 * self._step_size)
            try:
                self._copy()
            except Exception:  # many kinds, which HDF5 raises for damaged files
                raise ValueError("the file is damaged") from None
            self._cut()
        return file

    def _copy(self) -> None:
        """Copy the complete steps of the file, because HDF5 may crash in a damaged file."""
        import h5py

        with h5py.File(self._path, "r", locking=False) as file:
            for name, (new, rows) in self._growing.items():
                old = file["VTKHDF"][name]
                new.resize(self.complete[0] * rows, axis=0)
                for first in range(0, len(new), BLOCK):
                    new[first : first + BLOCK] = old[first : min(first + BLOCK, len(new))]

    def _append(self, row: Step) -> None:
        self._file.allocate(self._h5.id.get_filesize() + self._step_size)
        (steps,) = self.complete
        (times, time), *others = _rows(row, steps).items()
        for name, values in others:
            self._put(name, values)
        self._h5.flush()
        # The data of the step are in the file.  Its time and the number of steps follow last.
        self._put(times, time)
        self._root["Steps"].attrs.modify("NSteps", np.int64(steps + 1))
        self._h5.flush()
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
        (steps,) = self.complete
        (times, _), *others = self._growing.values()
        times.resize(steps, axis=0)  # first, as extra times crash VTK 9.3
        self._h5.flush()
        self._root["Steps"].attrs.modify("NSteps", np.int64(steps))
        self._h5.flush()
        for dataset, rows in others:
            dataset.resize(steps * rows, axis=0)
        self._h5.flush()

    def _sync(self) -> bytes:
        self._h5.flush()
        self._file.sync()
        for (dataset, rows), hashed in zip(self._growing.values(), self._hashes, strict=True):
            end = self.complete[0] * rows
            for first in range(self._hashed * rows, end, BLOCK):
                hashed.update(dataset[first : min(first + BLOCK, end)])
        self._hashed = self.complete[0]
        return hashlib.sha256(b"".join(hashed.digest() for hashed in self._hashes)).digest()


def _rows(step: Step, n: int) -> dict[str, Array]:
    """Return the rows that the n-th step adds to each growing data set; the time comes first."""
    t, fields = step
    rows, offsets = {"Steps/Values": np.array([t])}, {}
    for kind, by_name in zip(KINDS, fields, strict=True):
        rows |= {f"{kind}/{name}": values for name, values in by_name.items()}
        first, length = next((name, len(values)) for name, values in by_name.items())
        offsets[f"Steps/{kind}Offsets/{first}"] = np.array([n * length])
    return {**rows, **offsets, **ZERO_OFFSETS}


def _empty_file(scene: LineData, rows: dict[str, Array], fields: LineFields) -> bytes:
    """Return the content of a file without steps."""
    import h5py

    with h5py.File("vtkhdf", "w", driver="core", backing_store=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(FORMAT_VERSION)
        root.attrs["Type"] = np.bytes_("UnstructuredGrid")  # VTK refuses a str
        root["NumberOfPoints"] = np.array([len(scene.points)])
        root["NumberOfCells"] = np.array([len(scene.cells)])
        root["NumberOfConnectivityIds"] = np.array([scene.cells.size])
        root["Points"] = scene.points
        root["Connectivity"] = scene.cells.ravel()
        root["Offsets"] = 2 * np.arange(len(scene.cells) + 1)
        root["Types"] = np.full(len(scene.cells), LINE, dtype=np.uint8)
        root["CellData/part"] = scene.kinds
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
