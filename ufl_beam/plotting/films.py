# SPDX-License-Identifier: MIT
"""Films in GIF and MP4 files, and a virtual screen on which VTK draws their frames."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Frames = Iterator[Any]  # images (height, width, 3) of one size; np.uint8


@dataclass(frozen=True)
class Film(os.PathLike[str]):
    """Film in a file, returned by :func:`animate`.

    A notebook embeds and plays the film.  Elsewhere the object acts as the path of the file.

    Attributes:
        path: GIF or MP4 file.

    Example:
        >>> film = ub.animate(solution, "beam.gif", fps=5, seconds=0.4, size=(320, 192))
        >>> film
        Film('beam.gif')
        >>> with open(film, "rb") as file:
        ...     file.read(3)
        b'GIF'
    """

    path: Path

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"Film({str(self.path)!r})"

    def _repr_html_(self) -> str:
        data, style = b64encode(self.path.read_bytes()).decode(), 'style="max-width: 100%"'
        if self.path.suffix.lower() == ".gif":
            return f'<img alt="{self.path.stem}" {style} src="data:image/gif;base64,{data}">'
        return f'<video controls loop {style} src="data:video/mp4;base64,{data}"></video>'


def write_gif(path: Path, frames: Frames, fps: float) -> None:
    """Write a GIF file, in which durations of frames are whole hundredths of a second."""
    from PIL import Image

    images = [Image.fromarray(frame).quantize(256) for frame in frames]
    # Frames begin at the nearest hundredth of a second, so that rounding errors do not add up.
    durations = 10.0 * np.diff(np.rint(100.0 * np.arange(len(images) + 1) / fps))
    first, *others = images
    first.save(path, save_all=True, append_images=others, duration=durations.tolist(), loop=0)


def write_mp4(path: Path, frames: Frames, fps: float) -> None:
    """Write an MP4 file (H.264) by the ffmpeg of imageio-ffmpeg or of the system."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        program = get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:  # the package or its program is missing
        program = shutil.which("ffmpeg")
        if program is None:
            raise ImportError(
                "MP4 needs ffmpeg, GIF does not; install it by: pip install imageio-ffmpeg, or: "
                "apt-get install ffmpeg"
            ) from error
    # Not through a pipe: PETSc ends the interpreter if a broken pipe sends SIGPIPE.
    with tempfile.TemporaryDirectory() as folder:
        images, film = Path(folder, "images"), Path(folder, "film.mp4")
        with images.open("wb") as file:
            for frame in frames:
                file.write(np.ascontiguousarray(frame).data)
        height, width = frame.shape[:2]
        command = [
            program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{width}x{height}", "-r", str(fps), "-i", str(images),
            # H.264 needs an even width and height.
            "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p", str(film),
        ]  # fmt: skip
        run = subprocess.run(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
        if run.returncode:
            raise RuntimeError(f"{program}: {run.stderr.decode(errors='replace').strip()}")
        shutil.move(film, path)


WRITERS = {".gif": write_gif, ".mp4": write_mp4}
"""Functions that write films, by the suffix of the file."""


@contextmanager
def screen(pyvista: Any) -> Iterator[None]:
    """Start Xvfb if DISPLAY is not set and VTK before 9.4 would end the interpreter."""
    needed = sys.platform == "linux" and tuple(pyvista.vtk_version_info) < (9, 4)
    if not needed or os.environ.get("DISPLAY"):
        yield
        return
    if shutil.which("Xvfb") is None:
        raise RuntimeError(
            "PyVista with this VTK needs a screen, and DISPLAY is not set; install Xvfb "
            "(apt-get install xvfb) or VTK 9.4 or newer"
        )
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "1280x1024x24", "-nolisten", "tcp"],
        start_new_session=True,  # Ctrl-C must not end Xvfb before this process
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert server.stdout is not None
    with server:
        try:
            number = server.stdout.readline().strip()
            if not number:
                raise RuntimeError("Xvfb did not start; try: Xvfb -displayfd 1")
            os.environ["DISPLAY"] = f":{number}"
            yield
        finally:
            os.environ.pop("DISPLAY", None)
            server.terminate()
