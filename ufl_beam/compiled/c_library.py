# SPDX-License-Identifier: MIT
"""The loops over cells and rows, compiled once for the machine.

They do what DOLFINx's assemblers do (a test compares both), but bring the unknowns of a cell up to
date on the way and know beforehand where the entries of its matrix go.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import partial
from typing import Any, TypeVar

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.jit import DECLARATIONS, HEADERS, compiled, text
from ufl_beam.dolfinx_compat import TABULATE, VERSIONS

T = TypeVar("T")

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
module = compiled(
    "ufl_beam_loops",
    DECLARATIONS + _CALLBACKS,
    lambda: _SOURCE,
    made_of=[_SOURCE],
    flags=["-O3"],
)
ffi: Any = module.ffi
lib: Any = module.lib

_PETSC = ctypes.CDLL(PETSc.__file__)  # petsc4py, which has loaded PETSc
for _name, _field in ffi.typeof("petsc_functions").fields:
    _address = ctypes.cast(getattr(_PETSC, _name), ctypes.c_void_p).value
    setattr(lib.petsc, _name, ffi.cast(_field.type, _address))


def petsc(name: str, *arguments: Any) -> None:
    """Call a function of ``petsc_functions`` in loops.h; objects of petsc4py are theirs in C.

    Raises:
        RuntimeError: It returns an error.
    """
    in_c = (
        ffi.cast("void *", argument.handle) if isinstance(argument, PETSc.Object) else argument
        for argument in arguments
    )
    if error := getattr(lib.petsc, name)(*in_c):
        text, specific = ffi.new("const char **"), ffi.new("char **")
        lib.petsc.PetscErrorMessage(error, text, specific)
        words = (ffi.string(of[0]).decode() for of in (text, specific) if of[0])
        raise RuntimeError(f"{name} of PETSc failed with error {error}: {': '.join(words)}")


Loop = tuple[Any, Any]
"""A function of the type ``part`` of loops.h, and what it is called with."""


def loop(name: str, data: Any) -> Loop:
    """The function ``name`` for ``data``, which the caller keeps alive."""
    return ffi.addressof(lib, name), data


doubles = partial(ffi.from_buffer, ffi.typeof("double[]"))
"""Pointer to a contiguous array of float64; it keeps the array alive."""

integers = partial(ffi.from_buffer, ffi.typeof("int32_t[]"))
"""Pointer to a contiguous array of int32; it keeps the array alive."""


def names(enum: str, prefix: str = "") -> tuple[str, ...]:
    """Names in an enum of loops.h, in order, without its last one, which is their number."""
    elements = ffi.typeof(f"enum {enum}").elements
    return tuple(elements[i].lower().removeprefix(prefix) for i in range(len(elements) - 1))


def in_order(enum: str, values: Mapping[str, T], prefix: str = "") -> list[T]:
    """Values in the order of an enum of loops.h, by its names; see :func:`names`.

    Raises:
        ValueError: Python and C do not name the same.
    """
    expected = names(enum, prefix)
    if set(values) != set(expected):
        raise ValueError(f"{enum} is {expected} in loops.h, and {tuple(values)} in Python")
    return [values[name] for name in expected]


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
    """An FFCx kernel, given as a function pointer of the cffi instance ``of``.

    Raises:
        RuntimeError: It takes other arguments than ufl_beam passes.
    """
    expected, found = ffi.typeof("kernel *").cname, of.typeof(pointer).cname
    if found != expected:
        raise RuntimeError(
            f"{VERSIONS} make kernels of the C type {found}; ufl_beam calls {expected}. It is "
            "tested with DOLFINx 0.9 to 0.11"
        )
    return ffi.cast("kernel *", int(of.cast("intptr_t", pointer)))
