# SPDX-License-Identifier: MIT
"""Time series of lines as VTKHDF: one HDF5 file, mesh written once, fields appended step by step.

The layout is "UnstructuredGrid" of version 2.0 with "Steps", see the documentation of VTK's file
formats; VTK 9.3, PyVista and ParaView 5.13 read it.  All data sets are made at the beginning, since
a kill damages an HDF5 file more easily when one is made than when one grows.  HDF5 itself is not to
meet a full disk, after which it dies: the space that a step may need is allocated before.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.output.output_files import OutputFile, failure, is_at, removed, warn_of_removal

Fields = Sequence[Mapping[str, Array]]  # at points and in cells, by name
LAYOUT = (2, 0)  # of the format; VTK 9.3 warns of later ones
LINE = 3  # VTK's number of the type of a cell
KINDS = ("PointData", "CellData")  # groups of fields
ROWS = 1024  # steps in a chunk of what has one number a step
BLOCK = 4096  # rows in a chunk of a field, at least those of one step
INDEX = 1 << 20  # bytes that the indices of all data sets grow by in a step, and some more


class VtkhdfWriter:
    """Writer of one time series, or of the rest of one with as many complete ``steps``.

    Of the ``fields`` only names and shapes count; ``constant`` ones are in cells, (m,).  It raises
    :class:`ValueError` if the file is not the one that was written up to there.
    """

    def __init__(
        self,
        path: Path,
        points: Array,
        cells: Index,
        constant: Mapping[str, Array],
        fields: Fields,
        steps: int | None = None,
    ) -> None:
        import h5py

        self._path, self.steps, self._h5s = path, steps or 0, h5py.h5s
        mesh = {
            "NumberOfPoints": np.array([len(points)]),
            "NumberOfCells": np.array([len(cells)]),
            "NumberOfConnectivityIds": np.array([cells.size]),
            "Points": points,
            "Connectivity": cells.ravel(),
            "Offsets": 2 * np.arange(len(cells) + 1),
            "Types": np.full(len(cells), LINE, dtype=np.uint8),
            **{f"CellData/{name}": values for name, values in constant.items()},
        }
        if steps is None:
            new = OutputFile(path)
            new.put(0, _empty_file(mesh, [*constant], fields))
            new.close()
        try:
            # Without a lock others may look at the file while the run goes on.
            self._file = h5py.File(path, "r+", locking=False)
        except OSError:
            if path.exists():
                raise ValueError("the file is damaged") from None
            raise
        if not self._is_same(mesh, fields):
            self._file.close()
            raise ValueError("not the file that was written up to there")
        self._descriptor = int(self._file.id.get_vfd_handle())
        self._find(fields)
        self._cut()

    @property
    def complete(self) -> tuple[int]:
        """Number of complete steps, for a checkpoint."""
        return (self.steps,)

    def _is_same(self, mesh: Mapping[str, Array], fields: Fields) -> bool:
        """Return whether the file has this mesh, these fields, and enough steps."""
        try:
            root = self._file["VTKHDF"]
            same = [np.array_equal(root[name][()], values) for name, values in mesh.items()]
            for kind, by_name in zip(KINDS, fields, strict=True):
                for name, values in by_name.items():
                    length, *shape = root[kind][name].shape
                    same.append(tuple(shape) == values.shape[1:])
                    same.append(length >= self.steps * len(values))
            return all(same) and int(root["Steps"].attrs["NSteps"]) >= self.steps
        except KeyError:
            return False

    def _find(self, fields: Fields) -> None:
        """Note the data sets that grow, and by how many rows a step."""
        root, steps = self._file["VTKHDF"], self._file["VTKHDF/Steps"]
        self._attributes = steps.attrs
        self._growing = [
            (root[kind][name].id, values.shape)
            for kind, by_name in zip(KINDS, fields, strict=True)
            for name, values in by_name.items()
        ]
        firsts = [(kind, *next(iter(f.items()))) for kind, f in zip(KINDS, fields, strict=True)]
        self._counts = [len(values) for *_, values in firsts]
        names = [f"{kind}Offsets/{name}" for kind, name, _ in firsts]
        names += ["PartOffsets", "CellOffsets", "NumberOfParts"]
        self._growing += [(steps[name].id, (1, *steps[name].shape[1:])) for name in names]
        self._times = steps["Values"].id
        self._room = INDEX + sum(
            8 * math.prod(dataset.get_create_plist().get_chunk())
            for dataset in (self._times, *(dataset for dataset, _ in self._growing))
        )

    def write(self, t: float, fields: Fields) -> None:
        """Append a step with its fields."""
        n = self.steps
        numbers = (*(n * count for count in self._counts), 0, 0, 1)
        rows: list[Any] = [*(values for by_name in fields for values in by_name.values()), *numbers]
        self._allocate()
        for (dataset, shape), values in zip(self._growing, rows, strict=True):
            self._put(dataset, n, np.broadcast_to(values, shape))
        self._file.flush()
        # All that the step has is in the file; that it is there comes last, and at once.
        self._put(self._times, n, np.array([t]))
        self._attributes.modify("NSteps", np.int64(n + 1))
        self._file.flush()
        self.steps = n + 1

    def _allocate(self) -> None:
        """Let the disk be full now rather than within HDF5, which cuts off what it has not used."""
        size, end = os.fstat(self._descriptor).st_size, self._file.id.get_filesize() + self._room
        if size < end and hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._descriptor, size, end - size)
            except OSError as error:
                if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):  # no such thing there
                    raise failure(error, self._path) from None

    def _put(self, dataset: Any, n: int, values: Array) -> None:
        """Write the rows of the n-th step by HDF5's own functions, which are the fastest."""
        first, (rows, *components) = n * len(values), values.shape
        shape = (first + rows, *components)
        dataset.set_extent(shape)
        space = self._h5s.create_simple(shape)
        space.select_hyperslab((first,) + (0,) * len(components), values.shape)
        dtype = np.int64 if values.dtype.kind == "i" else np.float64
        there = self._h5s.create_simple(values.shape)
        dataset.write(there, space, np.ascontiguousarray(values, dtype=dtype))

    def _cut(self) -> None:
        """Cut off what is behind the last step; times first, of too many of which VTK 9.3 dies."""
        self._times.set_extent((self.steps,))
        self._file.flush()
        self._attributes.modify("NSteps", np.int64(self.steps))
        self._file.flush()
        for dataset, (rows, *components) in self._growing:
            dataset.set_extent((self.steps * rows, *components))
        self._file.flush()

    def sync(self) -> None:
        """Bring everything to the disk; raises if the file was removed."""
        if not is_at(self._descriptor, self._path):
            raise removed(self._path)
        self._file.flush()
        os.fsync(self._descriptor)

    def close(self) -> None:
        """Close the file, without what an interrupt has left behind the last complete step."""
        if not self._file:
            return
        there = is_at(self._descriptor, self._path)
        try:
            self._cut()
        finally:
            self._file.close()
        if not there:
            warn_of_removal(self._path)


def _empty_file(mesh: Mapping[str, Array], constant: list[str], fields: Fields) -> bytes:
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
        _series(steps, "Values", (), np.float64)
        _series(steps, "NumberOfParts", (), np.int64)
        # All steps have one mesh, so that all these are 0: one data set under several names.
        zeros = _series(steps, "PartOffsets", (), np.int64)
        for name in ("PointOffsets", *(f"CellDataOffsets/{name}" for name in constant)):
            steps[name] = zeros
        steps["ConnectivityIdOffsets"] = _series(steps, "CellOffsets", (1,), np.int64)
        for kind, by_name in zip(KINDS, fields, strict=True):
            offsets: Any = None
            for name, values in by_name.items():
                rows = len(values) * max(1, BLOCK // len(values))
                _series(root.require_group(kind), name, values.shape[1:], np.float64, rows)
                if offsets is None:
                    offsets = _series(steps.require_group(f"{kind}Offsets"), name, (), np.int64)
                else:
                    steps[f"{kind}Offsets/{name}"] = offsets
        file.flush()
        return bytes(file.id.get_file_image())


def _series(group: Any, name: str, shape: tuple[int, ...], dtype: Any, rows: int = ROWS) -> Any:
    """Make a data set that grows by rows of a shape."""
    return group.create_dataset(
        name, (0, *shape), dtype, maxshape=(None, *shape), chunks=(rows, *shape)
    )
