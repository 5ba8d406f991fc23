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

import cffi

from ufl_beam.compat import TABULATE, jit_directory

SOURCES = ("loops", "elimination")
"""Files of C beside this one; they are one translation unit."""

_DECLARATIONS = """
void set_cells(int cells, int dofs_per_cell, const int32_t *dofs, const double *q, int at,
               double *w, int width);
void cells_vector(kernel *tabulate, int cells, int dofs_per_cell, const int32_t *dofs,
                  const double *q, int at, double *w, int width, const double *constants,
                  const double *coordinates, int rows, const int32_t *row, double *b);
void add_product(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                 const double *x, double *y);
double quadratic_form(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                      const double *x);
double step_of_nodes(int size, int rotations, const int32_t *rotation, double *s,
                     const double *q0, const double *q1);
void add_step_product(int size, const int32_t *indptr, const int32_t *indices, const double *data,
                      double factor, double back, const double *v, int rotations,
                      const int32_t *rotation, double *s, const double *q0, const double *q1,
                      double *r);
void add_step_tangent(int entries, const int32_t *entry, const int32_t *column, const double *data,
                      int size, int rotations, const int32_t *rotation, double *half,
                      const double *q0, const double *q1, double *tangent);
double weighted_square(int rows, const double *w, const double *f);
void respond(int32_t *course, kernel *bulk, kernel *opening, kernel *excess, int points,
             const double *B, const double *weight, const double *rest, double theta,
             const double *e0, double *w, double *r, double *D, int cells, const double *e1);
void respond_at(const double *q, int size, double *latest,
                kernel *strain, int cells, int dofs_per_cell, const int32_t *dofs, int at,
                double *values, int values_width, const double *constants,
                const double *coordinates, int rows, const int32_t *row, double *e1,
                int32_t *course, kernel *bulk, kernel *opening, kernel *excess, int points,
                const double *B, const double *weight, const double *rest, double theta,
                const double *e0, double *w, double *r, double *D, double *b,
                double *packed_D, int width);
void commit(kernel *end, int cells, int points, const double *B, const double *weight,
            const double *rest, const double *length, double *e0, const double *e1,
            double *w, double *kept, double *sum);
void linearise(int cells, const double *e, const double *r, const double *D, double *b,
               double *packed_D, int width);
typedef struct {
  int chains;
  const int32_t *first, *row, *order, *from_ends, *indptr;
  const double *data;
  double *kept;
  int32_t *swaps;
} chains;
void eliminate(const chains *c, const int32_t *places, double *left);
void eliminate_from(const chains *c, const double *b, double *f, const int32_t *places,
                    double *left);
void substitute(const chains *c, const double *f, const int32_t *places, const double *ends,
                double *x);
"""


def _load() -> ModuleType:
    """The compiled module, from the cache of the JIT compiler or made anew."""
    arguments, extra = TABULATE
    source = "\n".join(
        [
            "#include <stdint.h>",
            f"typedef void (kernel)({arguments});",
            f"#define CALL(f, e, w, c, x) f(e, w, c, x, 0, 0{extra})",
            *(Path(__file__).with_name(f"{name}.c").read_text() for name in SOURCES),
        ]
    )
    key = hashlib.sha256((source + _DECLARATIONS + sys.version).encode()).hexdigest()[:16]
    name = f"ufl_beam_loops_{key}"
    directory = jit_directory()
    library = directory / (name + str(sysconfig.get_config_var("EXT_SUFFIX")))
    if not library.exists():
        builder = cffi.FFI()
        builder.cdef(f"typedef void (kernel)({arguments});" + _DECLARATIONS)
        builder.set_source(name, source, extra_compile_args=["-O2"], libraries=["m"])
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


doubles = partial(ffi.from_buffer, ffi.typeof("double[]"))
"""Pointer to a contiguous array of float64; it keeps the array alive."""

integers = partial(ffi.from_buffer, ffi.typeof("int32_t[]"))
"""Pointer to a contiguous array of int32; it keeps the array alive."""


def kernel(pointer: Any, of: Any) -> Any:
    """An FFCx kernel, given as a function pointer of the cffi instance ``of``."""
    return ffi.cast("kernel *", int(of.cast("intptr_t", pointer)))
