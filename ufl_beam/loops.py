"""The loops over cells and rows, compiled once for the machine.

They do what DOLFINx's assemblers do (a test compares both), but bring the unknowns of a cell up to
date on the way and know beforehand where the entries of its matrix go.  FFCx needs a C compiler at
run time anyway.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import sysconfig
import tempfile
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from petsc4py import PETSc

import cffi
import numpy as np

from ufl_beam.compat import TABULATE, jit_directory

SOURCES = ("loops", "elimination", "newton")
"""Files of C beside this one; they are one translation unit."""

_CALLBACKS = """
extern "Python" void add_in_python(void *self, const double *q, double *out);
extern "Python" double missed_in_python(void *self, const double *q, const double *r, double scale);
"""


def _load() -> ModuleType:
    """The compiled module, from the cache of the JIT compiler or made anew."""
    arguments, extra = TABULATE
    declarations = "\n".join(
        [
            f"typedef void (kernel)({arguments});",
            f"typedef int{8 * np.dtype(PETSc.IntType).itemsize}_t petsc_int;",
            Path(__file__).with_name("loops.h").read_text(),
        ]
    )
    source = "\n".join(
        [
            *(f"#include <{name}.h>" for name in ("float", "math", "stdint", "string")),
            f"#define CALL(f, e, w, c, x) f(e, w, c, x, 0, 0{extra})",
            declarations,
            *(Path(__file__).with_name(f"{name}.c").read_text() for name in SOURCES),
        ]
    )
    key = hashlib.sha256((source + _CALLBACKS + sys.version).encode()).hexdigest()[:16]
    name = f"ufl_beam_loops_{key}"
    directory = jit_directory()
    library = directory / (name + str(sysconfig.get_config_var("EXT_SUFFIX")))
    if not library.exists():
        builder = cffi.FFI()
        builder.cdef(declarations + _CALLBACKS)
        builder.set_source(name, source, extra_compile_args=["-O3"], libraries=["m"])
        directory.mkdir(parents=True, exist_ok=True)
        # Other processes may compile the same at the same time; the last one wins.
        with tempfile.TemporaryDirectory(dir=directory) as scratch:
            os.replace(builder.compile(tmpdir=scratch), library)
    spec = importlib.util.spec_from_file_location(name, library)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load {library}; remove it and try again")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_module = _load()
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


def kernel(pointer: Any, of: Any) -> Any:
    """An FFCx kernel, given as a function pointer of the cffi instance ``of``."""
    return ffi.cast("kernel *", int(of.cast("intptr_t", pointer)))
