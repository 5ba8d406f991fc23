# SPDX-License-Identifier: MIT
"""A screen for VTK, which before version 9.4 ends the interpreter if there is none."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def screen(pyvista: Any) -> Iterator[None]:
    """Provide a screen by Xvfb if this VTK needs one and there is none."""
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
