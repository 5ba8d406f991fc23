# SPDX-License-Identifier: MIT
"""The other programs, from PyPI into a directory of the cache: they are no part of the package."""

import os
import subprocess
import sys
from pathlib import Path

PACKAGES = ("exudyn==1.13.6", "openseespy==3.8.0.0", "openseespylinux==3.8.0.0")


def installed():
    """The directory; what cannot be installed is missing there, and its runs say so."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ufl_beam"
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    directory = cache / f"peers-{python}"
    for package in PACKAGES:
        name, version = package.split("==")
        if not (directory / f"{name}-{version}.dist-info").exists():
            print(f"installing {package} in {directory}", flush=True)
            pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check", "--no-input"]
            # without what they depend on: NumPy and SciPy are there
            command = [*pip, "install", "--no-deps", "--target", str(directory), package]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                print(f"{package} cannot be installed: {done.stderr.strip()[-300:]}")
    return directory
