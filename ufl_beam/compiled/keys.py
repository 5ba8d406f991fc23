# SPDX-License-Identifier: MIT
"""Keys of compiled code: the arguments from which the package makes a function in UFL.

With a key, code in the cache is found before its expressions in UFL are made, which takes longer
than loading it.  Objects of users have no key, because their names do not determine their code.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import ufl

from ufl_beam.dolfinx_compat import compiler_key

PACKAGE = Path(__file__).parents[1]

PLAIN = {type(None), bool, int, float, str}
"""Types whose values Python prints exactly."""


def key_of(*arguments: Any) -> str | None:
    """Return a key of arguments, the package and its compilers; None for objects of users."""
    try:
        texts = _sources(), *map(_text, arguments)
    except LookupError:
        return None
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


@cache
def _sources() -> str:
    """Return a key of all that turns arguments into code."""
    files = sorted(PACKAGE.rglob("*.py"))
    found = hashlib.sha256(b"\0".join(path.read_bytes() for path in files))
    return "\0".join([found.hexdigest(), ufl.__version__, compiler_key()])


def _text(x: Any) -> str:
    """Return a text that differs for arguments that differ; raise LookupError for other objects."""
    if type(x) in PLAIN:
        return repr(x)
    if isinstance(x, type):
        return _name(x)
    if type(x) in (tuple, list):
        return f"({','.join(map(_text, x))})"
    if isinstance(x, Mapping):
        return f"{{{','.join(f'{_text(k)}:{_text(v)}' for k, v in x.items())}}}"
    if is_dataclass(x):
        values = (getattr(x, field.name) for field in fields(x))
        return f"{_name(type(x))}({','.join(map(_text, values))})"
    if isinstance(x, tuple):  # with names
        return f"{_name(type(x))}({','.join(map(_text, x))})"
    raise LookupError(x)


def _name(kind: type) -> str:
    """Return the name of a class of the package, which finds it; raise LookupError for others."""
    module = kind.__module__
    found: Any = sys.modules.get(module)
    if module.partition(".")[0] == __package__.partition(".")[0]:
        for name in kind.__qualname__.split("."):
            found = getattr(found, name, None)
        if found is kind:
            return f"{module}.{kind.__qualname__}"
    raise LookupError(kind)
