# SPDX-License-Identifier: MIT
"""Files of pictures and films, and a screen where VTK needs one."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ufl_beam.errors import SceneError


def optional(module: str, package: str, why: str) -> Any:
    """Import a module that need not be installed, or say how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f"{why}; install it by: pip install {package}") from error


def require_suffix(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    """Return the path of a picture, or raise :class:`SceneError`."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise SceneError(f"{path}: the name must end in {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise SceneError(f"{path}: there is no directory {path.parent}; make it first")
    return path


def film_writer(path: Path, fps: float) -> Any:
    """Open a GIF or MP4 with so many frames per second."""
    imageio = optional("imageio.v2", "ufl_beam[view]", "films need imageio")
    if path.suffix.lower() == ".gif":
        return imageio.get_writer(path, mode="I", duration=1000.0 / fps, loop=0)
    optional("imageio_ffmpeg", "imageio-ffmpeg", "MP4 needs imageio-ffmpeg, GIF does not")
    return imageio.get_writer(path, fps=fps, macro_block_size=2)


@contextmanager
def screen(pyvista: Any) -> Iterator[None]:
    """Provide a screen if VTK needs one and there is none: without, it ends the interpreter."""
    needed = sys.platform == "linux" and tuple(pyvista.vtk_version_info) < (9, 4)
    if not needed or os.environ.get("DISPLAY"):
        yield
        return
    if shutil.which("Xvfb") is None:
        raise RuntimeError(
            "PyVista with this VTK needs a screen, and DISPLAY is not set; install Xvfb "
            "(apt-get install xvfb) or VTK 9.4 or newer"
        )
    reader, writer = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writer), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"],
        pass_fds=[writer],
        start_new_session=True,  # Ctrl-C is for this process; it still needs its screen to end
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writer)
    try:
        with os.fdopen(reader) as answer:
            number = answer.readline().strip()
        if not number:
            raise RuntimeError("Xvfb did not start; try: Xvfb -displayfd 1")
        os.environ["DISPLAY"] = f":{number}"
        yield
    finally:
        os.environ.pop("DISPLAY", None)
        server.terminate()
        server.wait()
