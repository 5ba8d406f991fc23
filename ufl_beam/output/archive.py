# SPDX-License-Identifier: MIT
"""HDF5 files of named arrays and some text, each replaced at once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ufl_beam.arrays import State
from ufl_beam.errors import SceneError
from ufl_beam.output.output_files import failure, put_in_place, require_writable


def above(prefix: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return content with a prefix before its names."""
    return {prefix + name: value for name, value in content.items()}


def below(prefix: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content whose names begin with a prefix, without it."""
    inside = ((n, v) for n, v in content.items() if n.startswith(prefix))
    return {name.removeprefix(prefix): value for name, value in inside}


def write(path: Path, format: str, text: Mapping[str, Any], arrays: State) -> None:
    """Write a file; there is always a whole one, the new or the one before.

    The ``format`` names the content and its version: "solution of ufl_beam, 1".
    """
    require_writable(path)
    encoded = json.dumps({**text, "arrays": [*arrays]})
    try:
        put_in_place(path, image_of(format, {"text": encoded, **arrays}))
    except OSError as error:
        raise failure(error, path) from None


def image_of(format: str, content: Mapping[str, Any]) -> bytes:
    """Return an HDF5 file, made in memory because HDF5 crashes when a disk is full."""
    import h5py

    with h5py.File("archive", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = format
        for name, values in content.items():
            file[name] = values
        file.flush()
        return bytes(file.id.get_file_image())


def read(path: Path, format: str) -> tuple[dict[str, Any], State]:
    """Read the text and the arrays of a file; :class:`SceneError` if it is another or damaged."""
    import h5py

    kind, _, number = format.rpartition(", ")
    what = kind.partition(" ")[0]
    if not path.is_file():
        raise SceneError(f"{what} {path}: there is no such file")
    try:
        with h5py.File(path, "r") as file:
            found = str(file.attrs.get("format", "another file"))
            if found == format:
                text: dict[str, Any] = json.loads(file["text"][()])
                arrays: State = {name: file[name][()] for name in text.pop("arrays")}
                return text, arrays
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise SceneError(
            f"{what} {path}: the file holds no {kind}, or is damaged: {error}"
        ) from None
    if found.startswith(f"{kind}, "):
        raise SceneError(
            f"{what} {path}: the file is a {found}, and this version of ufl_beam reads number "
            f"{number}"
        )
    raise SceneError(f"{what} {path}: the file holds no {kind}")
