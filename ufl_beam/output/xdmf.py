# SPDX-License-Identifier: MIT
"""Time series of lines as XDMF: one grid a step with all its fields, valid whenever a run ends.

The text is followed by a processing instruction of spaces, ``<?spare ... ?>``.  A step is written
into it together with new closing tags; then spaces over the old closing tags, within one page of
memory, make the step part of the document.  So even a write that a kill cuts off leaves valid XML,
and a step costs the same at any time.  Numbers are in a binary file, written before the text names
them.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

from ufl_beam.arrays import Array, Index
from ufl_beam.output.output_files import OutputFile

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
    """Writer of one time series; ``complete`` are its sizes after the last complete step.

    Given, it goes on from there, and raises :class:`ValueError` if the files are not those that
    were written up to there; ``digest`` is that of :meth:`sync`.
    """

    def __init__(
        self,
        path: Path,
        points: Array,
        cells: Index,
        parts: Array,
        complete: Complete | None = None,
        digest: bytes = b"",
    ) -> None:
        self._name, self._mesh_data = escape(data_path(path).name), b""
        items = []
        for values in (cells.astype("<i8"), points, parts):
            items.append(_item(values, len(self._mesh_data), self._name))
            self._mesh_data += values.tobytes()
        self._mesh = (  # named anew in each step, written once
            f'<Topology TopologyType="Polyline" NodesPerElement="2" '
            f'NumberOfElements="{len(cells)}">{items[0]}</Topology>'
            f'<Geometry GeometryType="XYZ">{items[1]}</Geometry>'
            f"{_attribute('part', 'Cell', parts, items[2])}"
        )
        new = complete is None
        self.complete = complete or Complete(0, len(HEAD), ROOM, len(self._mesh_data))
        self._data, self._xml = OutputFile(data_path(path), new=new), OutputFile(path, new=new)
        self._writing = False
        if new:
            self._data.put(0, self._mesh_data)
            self._xml.put(0, (HEAD + TAIL).ljust(ROOM) + CLOSING)
        else:
            short = self._xml.size < self.complete.room + len(CLOSING)
            if short or self._digest() != digest:
                self._xml.close()
                self._data.close()
                raise ValueError("not the files that were written up to there")
            self._cut()

    def write(self, t: float, fields: tuple[Mapping[str, Array], ...]) -> None:
        """Append a step with its fields."""
        if self._writing:  # an interrupt has left a part of a step
            self._cut()
        self._writing = True
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
        self._writing = False

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
        """Cut off what is behind the last complete step; the document is valid all the time."""
        _, tail, room, length = self.complete
        self._xml.put(tail, TAIL)
        spare, after = tail + len(TAIL), room + len(CLOSING)
        self._xml.put(spare, b" " * (room - spare))
        self._xml.put(after, b" " * (self._xml.size - len(CLOSING) - after))
        self._xml.put(room, CLOSING)
        self._xml.cut(after)
        self._data.cut(length)
        self._writing = False

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
            if self._writing:
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
