# SPDX-License-Identifier: MIT
"""Version of the package, stated once, in pyproject.toml."""

from __future__ import annotations

import re
from functools import cache
from importlib import metadata
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1] / "pyproject.toml"


@cache
def version() -> str:
    """The version of the source tree that is imported, else that of the installed package."""
    if PROJECT.is_file():
        text = PROJECT.read_text(encoding="utf-8")
        stated = re.search(r'^name = "ufl_beam"\nversion = "([^"]+)"', text, re.MULTILINE)
        if stated:
            return stated[1]
    return metadata.version("ufl_beam")
