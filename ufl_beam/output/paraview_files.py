# SPDX-License-Identifier: MIT
"""Files of time series of lines for ParaView: writers of XDMF and VTKHDF, valid after a kill."""

from __future__ import annotations

import hashlib
import math
import mmap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.output.output_files import OutputFile, part_of

LineFields = tuple[Mapping[str, Array], Mapping[str, Array]]
"""Fields at points, (n,) or (n, 3), and in cells, (m,), by name."""


class Lines(NamedTuple):
    """Mesh of straight lines."""

    points: Array  # (n, 3); m
    cells: Index  # points at both ends of each line; (m, 2)
    parts: Array  # number of the part of the scene to which each line belongs; (m,)


# -- XDMF ------------------------------------------------------------------------------------------

HEAD = (
    b'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>'
    b'<Grid Name="scene" GridType="Collection" CollectionType="Temporal">\n'
)
TAIL = b"</Grid></Domain></Xdmf>\n<?spare "  # steps to come are written into the instruction
CLOSING = b"<?e?>"  # its end; an instruction of its own once the one before has lost its end
PAGE, ROOM = mmap.PAGESIZE, 1 << 16


def data_path(path: Path) -> Path:
    """Return the path of the numbers of an XDMF file."""
    return path.with_name(path.name + ".bin")


class Complete(NamedTuple):
    """Sizes of the complete part of both files."""

    steps: int  # their number
    tail: int  # position of TAIL, the end of the document
    room: int  # position of CLOSING, the end of the spare instruction
    data: int  # length of the numbers


class XdmfWriter:
    """Writer of a time series as XDMF: one grid a step, numbers in a binary file beside the text.

    The text is followed by a processing instruction of spaces, ``<?spare ... ?>``.  A step is
    written into it together with new closing tags; then spaces over the old closing tags, within
    one page of memory, make the step part of the document.  So even a write that a kill cuts off
    leaves valid XML, and a step costs the same at any time.  Numbers are written before the text
    names them.

    ``complete`` are the sizes after the last complete step.  Given, it goes on from there, and
    raises :class:`ValueError` if the files are not those that were written up to there; ``digest``
    is that of :meth:`sync`.
    """

    def __init__(
        self,
        path: Path,
        lines: Lines,
        fields: LineFields,
        complete: Sequence[int] | None = None,
        digest: bytes = b"",
    ) -> None:
        self._name, mesh = escape(data_path(path).name), bytearray()
        items = []
        for values in (lines.cells.astype("<i8"), lines.points, lines.parts):
            items.append(_item(values, len(mesh), self._name))
            mesh += values.tobytes()
        self._mesh = (  # named anew in each step, written once
            f'<Topology TopologyType="Polyline" NodesPerElement="2" '
            f'NumberOfElements="{len(lines.cells)}">{items[0]}</Topology>'
            f'<Geometry GeometryType="XYZ">{items[1]}</Geometry>'
            f"{_attribute('part', 'Cell', lines.parts, items[2])}"
        )
        new = complete is None
        self.complete = Complete(*(complete or (0, len(HEAD), ROOM, len(mesh))))
        self._data, self._xml = OutputFile(data_path(path), new=new), OutputFile(path, new=new)
        if new:
            self._data.put(0, mesh)
            self._xml.put(0, (HEAD + TAIL).ljust(ROOM) + CLOSING)
        else:
            short = self._xml.size < self.complete.room + len(CLOSING)
            if short or self._digest() != digest:
                self._xml.close()
                self._data.close()
                raise ValueError("not the files that were written up to there")
            self._cut()

    def write(self, t: float, fields: LineFields) -> None:
        """Append a step with its fields."""
        if self._data.size > self.complete.data:  # an interrupt has left a part of a step
            self._cut()
        steps, tail, room, length = self.complete
        text = f'<Grid Name="{steps}" GridType="Uniform"><Time Value="{t!r}"/>{self._mesh}'
        data = bytearray()
        for center, by_name in zip(("Node", "Cell"), fields, strict=True):
            for name, values in by_name.items():
                item = _item(values, length + len(data), self._name)
                text += _attribute(name, center, values, item)
                data += values.tobytes()
        self._data.put(length, data)
        tail, room = self._append((text + "</Grid>\n").encode(), tail, room)
        self.complete = Complete(steps + 1, tail, room, length + len(data))

    def _append(self, grid: bytes, tail: int, room: int) -> tuple[int, int]:
        """Make a grid the last one of the document; where its tail and its spare room end now."""
        start = tail + len(TAIL)
        new_tail = start + len(grid)
        if new_tail % PAGE + len(TAIL) > PAGE:  # it lies within one page
            new_tail += -new_tail % PAGE
        if (least := new_tail + len(TAIL)) > room:
            new_room = least + ROOM + -(least + ROOM) % PAGE  # CLOSING lies within one page, too
            after = room + len(CLOSING)
            self._xml.put(after, b" " * (new_room - after))
            self._xml.put(new_room, CLOSING)
            self._xml.put(room, b" " * len(CLOSING))
            room = new_room
        self._xml.put(start, grid.ljust(new_tail - start) + TAIL)  # still in the instruction
        self._xml.put(tail, b" " * len(TAIL))  # now in the document
        return new_tail, room

    def _cut(self) -> None:
        """Cut off what is behind the last complete step; the document is valid all the time.

        Numbers of a step are written before its text, and cut off after it.
        """
        _, tail, room, length = self.complete
        self._xml.put(tail, TAIL)
        spare, after = tail + len(TAIL), room + len(CLOSING)
        self._xml.put(spare, b" " * (room - spare))
        self._xml.put(after, b" " * (self._xml.size - len(CLOSING) - after))
        self._xml.put(room, CLOSING)
        self._xml.cut(after)
        self._data.cut(length)

    def sync(self) -> bytes:
        """Bring everything to the disk; return its checksum; raises if a file was removed."""
        self._data.sync()
        self._xml.sync()
        return self._digest()

    def _digest(self) -> bytes:
        """SHA-256 of the document up to its tail, and of the numbers."""
        return self._xml.digest(self.complete.tail) + self._data.digest(self.complete.data)

    def close(self) -> None:
        """Close the text file and the file of numbers."""
        try:
            if self._data.size > self.complete.data:
                self._cut()
        finally:
            self._data.close()
            self._xml.close()


def _item(values: Array | Index, at: int, name: str) -> str:
    kind = "Int" if values.dtype.kind == "i" else "Float"
    shape = " ".join(map(str, values.shape))
    return (
        f'<DataItem Dimensions="{shape}" NumberType="{kind}" Precision="8" Format="Binary" '
        f'Endian="Little" Seek="{at}">{name}</DataItem>'
    )


def _attribute(name: str, center: str, values: Array, item: str) -> str:
    form = "Vector" if values.ndim == 2 else "Scalar"
    return f'<Attribute Name="{name}" AttributeType="{form}" Center="{center}">{item}</Attribute>'


# -- VTKHDF ----------------------------------------------------------------------------------------

LAYOUT = (2, 0)  # of the format; VTK 9.3 warns of later ones
LINE = 3  # VTK's number of the type of a cell
KINDS = ("PointData", "CellData")  # groups of fields
SAME = {  # rows of each step, since all have one mesh
    "Steps/PartOffsets": np.array([0]),
    "Steps/CellOffsets": np.array([[0]]),
    "Steps/NumberOfParts": np.array([1]),
}
ROWS = 1024  # steps in a chunk of what has one number a step
BLOCK = 4096  # rows in a chunk of a field, at least those of one step
INDEX = 1 << 20  # bytes that the indices of all data sets grow by in a step, and some more


class VtkhdfWriter:
    """Writer of a time series as VTKHDF: mesh written once, fields appended step by step.

    The layout is "UnstructuredGrid" of version 2.0 with "Steps", see the documentation of VTK's
    file formats; VTK 9.3, PyVista and ParaView 5.13 read it.  All data sets are made at the
    beginning: a process that is killed while one is made damages the file more easily than while
    one grows.  HDF5 crashes when a disk is full, so the space that a step may need is allocated
    before.

    ``complete`` is the number of steps after which it goes on.  Of the ``fields`` only names and
    shapes count.  It raises :class:`ValueError` if the file is not the one that was
    written up to there; ``digest`` is that of :meth:`sync`.
    """

    def __init__(
        self,
        path: Path,
        lines: Lines,
        fields: LineFields,
        complete: Sequence[int] | None = None,
        digest: bytes = b"",
    ) -> None:
        import h5py

        (self.steps,) = complete or (0,)
        rows = _rows(0.0, 0, fields)
        self._output = OutputFile(path if complete is None else part_of(path))
        self._output.put(0, _empty_file(lines, rows, fields))
        # Without a lock others may look at the file while the run goes on.
        self._file = h5py.File(self._output.path, "r+", locking=False)
        self._root = self._file["VTKHDF"]
        self._growing = {name: (self._root[name], len(values)) for name, values in rows.items()}
        self._hashes = [hashlib.sha256() for _ in rows]
        self._hashed = 0  # steps that the checksums have
        chunks = (dataset.chunks for dataset, _ in self._growing.values())
        self._room = INDEX + sum(8 * math.prod(chunk) for chunk in chunks)
        if complete is not None:
            self._take_over(path, digest)

    def _take_over(self, path: Path, digest: bytes) -> None:
        """Copy the complete steps of a file, and put this one in its place if they are the same.

        So the run does not append to HDF5 that may be damaged, of which HDF5 may crash.
        """
        import h5py

        try:
            self._output.allocate(path.stat().st_size + 2 * self._room)
            try:
                with h5py.File(path, "r", locking=False) as file:
                    for name, (new, rows) in self._growing.items():
                        old = file["VTKHDF"][name]
                        new.resize(self.steps * rows, axis=0)
                        for first in range(0, len(new), BLOCK):
                            new[first : first + BLOCK] = old[first : min(first + BLOCK, len(new))]
            except Exception:  # of HDF5, which has many for what is damaged
                raise ValueError("the file is damaged") from None
            self._cut()
            if self.sync() != digest:
                raise ValueError("not the file that was written up to there")
        except BaseException:
            self.close()
            self._output.path.unlink()
            raise
        self._output.rename(path)

    @property
    def complete(self) -> tuple[int]:
        """Number of complete steps, for a checkpoint."""
        return (self.steps,)

    def write(self, t: float, fields: LineFields) -> None:
        """Append a step with its fields."""
        self._output.allocate(self._file.id.get_filesize() + self._room)
        (times, time), *others = _rows(t, self.steps, fields).items()
        for name, values in others:
            self._put(name, values)
        self._file.flush()
        # All that the step has is in the file; that it is there comes last, and at once.
        self._put(times, time)
        self._root["Steps"].attrs.modify("NSteps", np.int64(self.steps + 1))
        self._file.flush()
        self.steps += 1

    def _put(self, name: str, values: Array) -> None:
        """Write the rows of the next step by HDF5's own functions, which are the fastest."""
        from h5py import h5s

        dataset, (rows, *components) = self._growing[name][0].id, values.shape
        first = self.steps * rows
        dataset.set_extent((first + rows, *components))
        space = h5s.create_simple((first + rows, *components))
        space.select_hyperslab((first, *(0 for _ in components)), values.shape)
        dataset.write(h5s.create_simple(values.shape), space, np.ascontiguousarray(values))

    def _cut(self) -> None:
        """Cut off what is behind the last step; times first, of too many VTK 9.3 crashes."""
        (times, _), *others = self._growing.values()
        times.resize(self.steps, axis=0)
        self._file.flush()
        self._root["Steps"].attrs.modify("NSteps", np.int64(self.steps))
        self._file.flush()
        for dataset, rows in others:
            dataset.resize(self.steps * rows, axis=0)
        self._file.flush()

    def sync(self) -> bytes:
        """Bring everything to the disk; return the SHA-256 of all numbers; each is read once.

        Raises:
            OSError: The file was removed.
        """
        self._file.flush()
        self._output.sync()
        whole = hashlib.sha256()
        for (dataset, rows), hashed in zip(self._growing.values(), self._hashes, strict=True):
            end = self.steps * rows
            for first in range(self._hashed * rows, end, BLOCK):
                hashed.update(dataset[first : min(first + BLOCK, end)])
            whole.update(hashed.digest())
        self._hashed = self.steps
        return whole.digest()

    def close(self) -> None:
        """Close the file, without what an interrupt has left behind the last complete step."""
        try:
            self._cut()
        finally:
            self._file.close()
            self._output.close()


def _rows(t: float, n: int, fields: LineFields) -> dict[str, Array]:
    """Rows that the n-th step adds to each data set that grows; its time is the first."""
    rows = {"Steps/Values": np.array([t])}
    offsets = {}
    for kind, by_name in zip(KINDS, fields, strict=True):
        rows |= {f"{kind}/{name}": values for name, values in by_name.items()}
        first, length = next((name, len(values)) for name, values in by_name.items())
        offsets[f"Steps/{kind}Offsets/{first}"] = np.array([n * length])
    return {**rows, **offsets, **SAME}


def _empty_file(lines: Lines, rows: dict[str, Array], fields: LineFields) -> bytes:
    """A file without steps, made in memory."""
    import h5py

    with h5py.File("vtkhdf", "w", driver="core", backing_store=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(LAYOUT)
        root.attrs["Type"] = np.bytes_("UnstructuredGrid")  # of fixed length; a str is refused
        root["NumberOfPoints"] = np.array([len(lines.points)])
        root["NumberOfCells"] = np.array([len(lines.cells)])
        root["NumberOfConnectivityIds"] = np.array([lines.cells.size])
        root["Points"] = lines.points
        root["Connectivity"] = lines.cells.ravel()
        root["Offsets"] = 2 * np.arange(len(lines.cells) + 1)
        root["Types"] = np.full(len(lines.cells), LINE, dtype=np.uint8)
        root["CellData/part"] = lines.parts
        steps = root.create_group("Steps")
        # HDF5 writes in the order of addresses: the number of steps comes before their times.
        steps.attrs["NSteps"] = np.int64(0)
        for name, values in rows.items():
            count, *shape = values.shape
            chunk = count * max(1, BLOCK // count) if name.startswith(KINDS) else ROWS
            root.create_dataset(
                name, (0, *shape), values.dtype, maxshape=(None, *shape), chunks=(chunk, *shape)
            )
        # What all steps, or all fields of a kind, have in common is one data set of several names.
        steps["PointOffsets"] = steps["CellDataOffsets/part"] = steps["PartOffsets"]
        steps["ConnectivityIdOffsets"] = steps["CellOffsets"]
        for kind, (first, *others) in zip(KINDS, fields, strict=True):
            for name in others:
                steps[f"{kind}Offsets/{name}"] = steps[f"{kind}Offsets/{first}"]
        file.flush()
        return bytes(file.id.get_file_image())
