# SPDX-License-Identifier: MIT
"""The loops over cells and rows, compiled once for the machine.

They do what DOLFINx's assemblers do (a test compares both), but bring the unknowns of a cell up to
date on the way and know beforehand where the entries of its matrix go.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.jit import DECLARATIONS, HEADERS, compiled, text
from ufl_beam.dolfinx_compat import TABULATE

SOURCES = ("loops", "rigid_plastic", "elimination", "newton")
"""Files of C beside this one; they are one translation unit."""

_CALLBACKS = """
extern "Python" void add_in_python(void *self, const double *q, double *out);
extern "Python" double missed_in_python(void *self, const double *q, const double *r, double scale,
                                        double moved);
"""


_SOURCE = "\n".join(
    [
        HEADERS,
        f"#define CALL(f, e, w, c, x) f(e, w, c, x, 0, 0{TABULATE[1]})",
        DECLARATIONS,
        *(text(f"{name}.c") for name in SOURCES),
    ]
)
_module = compiled(
    "ufl_beam_loops",
    DECLARATIONS + _CALLBACKS,
    lambda: _SOURCE,
    made_of=[_SOURCE],
    flags=["-O3"],
)
ffi: Any = _module.ffi
lib: Any = _module.lib


Loop = tuple[Any, Any]
"""A function of the type ``part`` of loops.h, and what it is called with."""


def loop(name: str, data: Any) -> Loop:
    """The function ``name`` for ``data``, which the caller keeps alive."""
    return ffi.addressof(lib, name), data


doubles = partial(ffi.from_buffer, ffi.typeof("double[]"))
"""Pointer to a contiguous array of float64; it keeps the array alive."""

integers = partial(ffi.from_buffer, ffi.typeof("int32_t[]"))
"""Pointer to a contiguous array of int32; it keeps the array alive."""


def extrapolated(x: Array, y: Array, ratio: float) -> Array:
    """``x + ratio (x - y)``; of short arrays in half the time that NumPy takes."""
    out: Array = np.empty(len(x))
    lib.extrapolate(len(x), doubles(x), doubles(y), ratio, doubles(out))
    return out


def combined(a: float, x: Array, b: float, y: Array) -> Array:
    """``a x + b y``, likewise."""
    out: Array = np.empty(len(x))
    lib.combine(len(x), a, doubles(x), b, doubles(y), doubles(out))
    return out


def kernel(pointer: Any, of: Any) -> Any:
    """An FFCx kernel, given as a function pointer of the cffi instance ``of``."""
    return ffi.cast("kernel *", int(of.cast("intptr_t", pointer)))
