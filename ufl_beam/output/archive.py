# SPDX-License-Identifier: MIT
"""HDF5 files of named arrays and some text, each replaced at once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import State
from ufl_beam.errors import SceneError
from ufl_beam.output.output_files import replace_file, require_writable


def write(path: Path, format: str, text: Mapping[str, Any], arrays: State) -> None:
    """Write a file; there is always a whole one, the new or the one before.

    Args:
        path: The file.
        format: What it is and the number of its version, "solution of ufl_beam, 1".
        text: What JSON can hold, by name.
        arrays: By name.

    Raises:
        SceneError: The file cannot be written.
        OSError: There is no space for it.
    """
    import h5py

    require_writable(path)
    # Made in memory, since HDF5 dies of a full disk
    with h5py.File("archive", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = format
        file["text"] = json.dumps({**text, "arrays": [*arrays]})
        for name, values in arrays.items():
            file[name] = np.asarray(values)
        file.flush()
        image = file.id.get_file_image()
    replace_file(path, bytes(image))


def read(path: Path, format: str) -> tuple[dict[str, Any], State]:
    """Read the text and the arrays of a file.

    Raises:
        SceneError: There is no such file, or it is another one, or damaged.
    """
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
