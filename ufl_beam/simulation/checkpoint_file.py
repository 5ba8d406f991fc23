# SPDX-License-Identifier: MIT
"""Files of checkpoints.

A file is one line of text, filled up to 512 bytes, and an HDF5 file, which readers of HDF5 find
behind it.  The line has the checksum of all that follows.
"""

from __future__ import annotations

import errno
import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.errors import SceneError
from ufl_beam.output.archive import image_of
from ufl_beam.output.output_files import put_in_place

FORMAT = "checkpoint of ufl_beam, 2"
"""The number grows whenever the meaning of files changes."""

HEADER = 512
"""Bytes before the HDF5 file, the least that readers of HDF5 skip."""

Content = dict[str, Any]
"""Arrays by name; what is not an array is JSON."""


def write(path: Path, content: Content, what: str) -> None:
    """Write a file at once: there is always a whole one, the new or the one before."""
    text = {name: value for name, value in content.items() if not isinstance(value, np.ndarray)}
    arrays = {name: value for name, value in content.items() if name not in text}
    try:
        encoded = json.dumps({**text, "arrays": list(arrays)}, default=_plain)
    except TypeError as error:
        raise SceneError(
            f"checkpoint {what}: a state() has something else than numbers, texts, lists and "
            f"dicts: {error}"
        ) from None
    body = image_of(FORMAT, {"text": np.frombuffer(encoded.encode(), dtype=np.uint8), **arrays})
    line = f"{FORMAT}; sha256 {hashlib.sha256(body).hexdigest()}\n".encode()
    try:
        put_in_place(path, line.ljust(HEADER, b"\0") + body)
    except OSError as error:
        free = shutil.disk_usage(path.parent).free
        before = "the one before is still there" if path.exists() else "there is none yet"
        raise OSError(
            error.errno or errno.EIO,
            f"checkpoint {path} {what} cannot be written: {error.strerror}; it needs "
            f"{(len(body) + HEADER) / 1e6:.3g} MB, and {path.parent} has {free / 1e6:.3g} MB; "
            f"{before}",
        ) from None


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(repr(value))


def read(path: Path) -> Content:
    """Read a file of :func:`write`; :class:`SceneError` if it is damaged, or something else."""
    import h5py

    def refuse(why: str) -> SceneError:
        return SceneError(
            f"checkpoint {path}: {why}. Delete the file to begin anew, or name another"
        )

    try:
        data = path.read_bytes()
    except OSError as error:
        raise refuse(f"the file cannot be read: {error.strerror}") from None
    line, _, rest = data[:HEADER].partition(b"\n")
    kind, _, checksum = line.decode(errors="replace").partition("; sha256 ")
    name, _, version = FORMAT.rpartition(", ")
    if not data:
        raise refuse("the file is empty")
    if kind != FORMAT:
        if kind.startswith(name):
            raise refuse(
                f"the file is a {kind}, and this version of ufl_beam reads number {version}"
            )
        raise refuse("the file is no checkpoint, or its beginning is damaged")
    if hashlib.sha256(data[HEADER:]).hexdigest() != checksum or rest.strip(b"\0"):
        raise refuse("the file is damaged: its checksum is not that of its content")
    with h5py.File(path, "r") as file:
        content: Content = json.loads(file["text"][()].tobytes())
        for array in content.pop("arrays"):
            content[array] = file[array][()]
    return content
