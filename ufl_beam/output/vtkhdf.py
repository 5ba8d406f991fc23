# SPDX-License-Identifier: MIT
"""Time series of lines as VTKHDF: one HDF5 file, mesh written once, fields appended step by step.

The layout is "UnstructuredGrid" of version 2.0 with "Steps", see the documentation of VTK's file
formats; VTK 9.3, PyVista and ParaView 5.13 read it.  All data sets are made at the beginning: a
process that is killed while one is made damages the file more easily than while one grows.  HDF5
crashes when a disk is full, so the space that a step may need is allocated before.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.output.output_files import OutputFile, part_of

Fields = tuple[Mapping[str, Array], ...]  # at points and in cells, by name
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
    """Writer of one time series, or of the rest of one with as many complete ``steps``.

    Of the ``fields`` only names and shapes count.  It raises :class:`ValueError` if the file is not
    the one that was written up to there; ``digest`` is that of :meth:`sync`.
    """

    def __init__(
        self,
        path: Path,
        points: Array,
        cells: Index,
        parts: Array,
        fields: Fields,
        steps: int | None = None,
        digest: bytes = b"",
    ) -> None:
        import h5py

        self.steps, self._h5s = steps or 0, h5py.h5s
        mesh = {
            "NumberOfPoints": np.array([len(points)]),
            "NumberOfCells": np.array([len(cells)]),
            "NumberOfConnectivityIds": np.array([cells.size]),
            "Points": points,
            "Connectivity": cells.ravel(),
            "Offsets": 2 * np.arange(len(cells) + 1),
            "Types": np.full(len(cells), LINE, dtype=np.uint8),
            "CellData/part": parts,
        }
        self._output = OutputFile(path if steps is None else part_of(path))
        self._output.put(0, _empty_file(mesh, fields))
        # Without a lock others may look at the file while the run goes on.
        self._file = h5py.File(self._output.path, "r+", locking=False)
        root, rows = self._file["VTKHDF"], _rows(0, fields)
        self._attributes, self._times = root["Steps"].attrs, root["Steps/Values"].id
        self._growing = [(root[name].id, values.shape) for name, values in rows.items()]
        self._room = INDEX + sum(
            8 * math.prod(dataset.get_create_plist().get_chunk())
            for dataset in (self._times, *(dataset for dataset, _ in self._growing))
        )
        lengths = {"Steps/Values": 1, **{name: len(values) for name, values in rows.items()}}
        self._hashes = {name: (length, hashlib.sha256()) for name, length in lengths.items()}
        self._hashed = 0  # steps that the checksums have
        if steps is not None:
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
                    for name, (rows, _) in self._hashes.items():
                        old, new = file["VTKHDF"][name], self._file["VTKHDF"][name]
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

    def write(self, t: float, fields: Fields) -> None:
        """Append a step with its fields."""
        n, rows = self.steps, _rows(self.steps, fields)
        self._output.allocate(self._file.id.get_filesize() + self._room)
        for (dataset, _), values in zip(self._growing, rows.values(), strict=True):
            self._put(dataset, n, values)
        self._file.flush()
        # All that the step has is in the file; that it is there comes last, and at once.
        self._put(self._times, n, np.array([t]))
        self._attributes.modify("NSteps", np.int64(n + 1))
        self._file.flush()
        self.steps = n + 1

    def _put(self, dataset: Any, n: int, values: Array) -> None:
        """Write the rows of the n-th step by HDF5's own functions, which are the fastest."""
        first, (rows, *components) = n * len(values), values.shape
        shape = (first + rows, *components)
        dataset.set_extent(shape)
        space = self._h5s.create_simple(shape)
        space.select_hyperslab((first,) + (0,) * len(components), values.shape)
        there = self._h5s.create_simple(values.shape)
        dataset.write(there, space, np.ascontiguousarray(values))

    def _cut(self) -> None:
        """Cut off what is behind the last step; times first, of too many VTK 9.3 crashes."""
        self._times.set_extent((self.steps,))
        self._file.flush()
        self._attributes.modify("NSteps", np.int64(self.steps))
        self._file.flush()
        for dataset, (rows, *components) in self._growing:
            dataset.set_extent((self.steps * rows, *components))
        self._file.flush()

    def sync(self) -> bytes:
        """Bring everything to the disk; return the SHA-256 of all numbers; each is read once.

        Raises:
            OSError: The file was removed.
        """
        self._file.flush()
        self._output.sync()
        root, whole = self._file["VTKHDF"], hashlib.sha256()
        for name, (rows, hashed) in self._hashes.items():
            end = self.steps * rows
            for first in range(self._hashed * rows, end, BLOCK):
                hashed.update(root[name][first : min(first + BLOCK, end)])
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


def _rows(n: int, fields: Fields) -> dict[str, Array]:
    """Rows that the n-th step adds to each data set that grows, besides its time."""
    by_kind = dict(zip(KINDS, fields, strict=True))
    values = {f"{kind}/{name}": x for kind in KINDS for name, x in by_kind[kind].items()}
    firsts = {kind: next(iter(by_kind[kind])) for kind in KINDS}
    offsets = {
        f"Steps/{kind}Offsets/{name}": np.array([n * len(by_kind[kind][name])])
        for kind, name in firsts.items()
    }
    return {**values, **offsets, **SAME}


def _empty_file(mesh: Mapping[str, Array], fields: Fields) -> bytes:
    """A file without steps, made in memory."""
    import h5py

    with h5py.File("vtkhdf", "w", driver="core", backing_store=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(LAYOUT)
        root.attrs["Type"] = np.bytes_("UnstructuredGrid")  # of fixed length; a str is refused
        for name, values in mesh.items():
            root[name] = values
        steps = root.create_group("Steps")
        # HDF5 writes in the order of addresses: the number of steps comes before their times.
        steps.attrs["NSteps"] = np.int64(0)
        for name, values in {"Steps/Values": np.zeros(1), **_rows(0, fields)}.items():
            count, *shape = values.shape
            rows = count * max(1, BLOCK // count) if name.startswith(KINDS) else ROWS
            root.create_dataset(
                name, (0, *shape), values.dtype, maxshape=(None, *shape), chunks=(rows, *shape)
            )
        # What all steps, or all fields of a kind, have in common is one data set of several names.
        steps["PointOffsets"] = steps["CellDataOffsets/part"] = steps["PartOffsets"]
        steps["ConnectivityIdOffsets"] = steps["CellOffsets"]
        for kind, (first, *others) in zip(KINDS, fields, strict=True):
            for name in others:
                steps[f"{kind}Offsets/{name}"] = steps[f"{kind}Offsets/{first}"]
        file.flush()
        return bytes(file.id.get_file_image())
