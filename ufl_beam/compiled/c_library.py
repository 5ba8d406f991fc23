# SPDX-License-Identifier: MIT
"""C library of the package: loops over cells and connectors, material points, Newton's method.

It is compiled at the first use, and again after changes of its source.  The loops over cells
assemble the same vectors and matrices as DOLFINx, as a test verifies.  They also copy the unknowns
into the coefficients of each cell, and add the entries of the cell at stored indices of the matrix.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import partial
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.jit import DECLARATIONS, HEADERS, NATIVE, compiled, text
from ufl_beam.dolfinx_compat import VERSIONS

T = TypeVar("T")

SOURCES = (
    "assembly", "csr", "dead_loads", "inertia_and_damping", "material_laws", "embedded_hinges",
    "material_points", "blocks", "inelastic_cells", "energy_changes", "beam_elimination",
    "multifrontal", "newton", "cell_forces", "derivatives", "adjoint", "block_derivatives",
    "point_derivatives", "state_rows", "steps", "oscillators",
)  # fmt: skip
"""C files in the folder c; they form one translation unit."""

FLAGS = ["-O3", NATIVE, "-fopenmp-simd", "-ffp-contract=off"]
"""Compiler flags: SIMD may change the order of sums; products are rounded before they are added."""

_CALLBACKS = """
extern "Python" double time_in_python(void *handle, double t);
extern "Python" void phase_in_python(void *handle, const time_step *step, const double *q1,
                                     const double *s);
extern "Python" int coefficients_in_python(void *handle, scheme_numbers *numbers);
extern "Python" void agree_in_python(void *handle, int number, const int *how, double *values);
extern "Python" int solve_in_python(void *handle, int anew);
extern "Python" void find_conjugates_in_python(void *handle, const double *q);
extern "Python" int find_zero_modes_in_python(void *handle);
extern "Python" int forget_zero_modes_in_python(void *handle);
extern "Python" void arrive_in_python(void *handle, const double *x);
extern "Python" int change_along_in_python(void *handle, const double *x);
extern "Python" int met_in_python(void *handle);
extern "Python" void run_in_python(void *handle);
extern "Python" void begin_in_python(void *handle, double t, double dt);
"""


_SOURCE = "\n".join([HEADERS, DECLARATIONS, *(text(f"{name}.c") for name in SOURCES)])
module = compiled(
    "ufl_beam_loops", DECLARATIONS + _CALLBACKS, lambda: _SOURCE, depends_on=[_SOURCE], flags=FLAGS
)
ffi: Any = module.ffi
lib: Any = module.lib

_PETSC = ctypes.CDLL(PETSc.__file__)  # petsc4py has loaded PETSc
for _name, _field in ffi.typeof("petsc_functions").fields:
    _address = ctypes.cast(getattr(_PETSC, _name), ctypes.c_void_p).value
    setattr(lib.petsc, _name, ffi.cast(_field.type, _address))


def opaque(thing: Any) -> Any:
    """Return the C pointer of a petsc4py object; return other arguments unchanged."""
    return ffi.cast("void *", thing.handle) if isinstance(thing, PETSc.Object) else thing


def petsc(name: str, *arguments: Any) -> None:
    """Call a function of ``petsc_functions`` in loops.h; raise RuntimeError if it fails."""
    if error := getattr(lib.petsc, name)(*map(opaque, arguments)):
        text, specific = ffi.new("const char **"), ffi.new("char **")
        lib.petsc.PetscErrorMessage(error, text, specific)
        words = (ffi.string(message[0]).decode() for message in (text, specific) if message[0])
        raise RuntimeError(f"{name} of PETSc failed with error {error}: {': '.join(words)}")


Loop = tuple[Any, Any]
"""A function of the type ``part`` of loops.h, and its first argument."""


def loop(name: str, data: Any) -> Loop:
    """Pair a function of the library with its data, which the caller keeps alive."""
    return ffi.addressof(lib, name), data


doubles = partial(ffi.from_buffer, ffi.typeof("double[]"))
"""Return a pointer to a contiguous array of float64; the pointer keeps it alive."""


def view_pointer(array: Array) -> Any:
    """Return a pointer to the first number of a view of float64; the pointer keeps it alive."""
    return ffi.gc(ffi.cast("double *", array.ctypes.data), lambda _, alive=array: None)


_FLOAT64, _INT32 = np.dtype(np.float64), np.dtype(np.int32)
_INT32_ARRAY = ffi.typeof("int32_t[]")


def integers(array: Index) -> Any:
    """Return a pointer to a contiguous array of int32; the pointer keeps it alive."""
    if array.dtype != _INT32:
        raise TypeError(f"C takes integers of 32 bits, not {array.dtype}")
    return ffi.from_buffer(_INT32_ARRAY, array)


_alive: WeakKeyDictionary[Any, dict[str, Any]] = WeakKeyDictionary()


def fill(struct: Any, **fields: Any) -> Any:
    """Set fields of a struct of loops.h and return the struct, which keeps the values alive.

    Arrays of float64 or int32 become pointers.
    """
    values = _in_c(fields)
    for name, value in values.items():
        setattr(struct, name, value)
    _alive.setdefault(struct, {}).update(values)
    return struct


def _in_c(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the values of fields, with pointers to arrays instead of the arrays."""
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            fields[name] = doubles(value) if value.dtype == _FLOAT64 else integers(value)
    return fields


def struct(kind: str, **fields: Any) -> Any:
    """Return a pointer to a new struct of loops.h, see :func:`fill`."""
    values = _in_c(fields)
    _alive[made := ffi.new(f"{kind} *", values)] = values
    return made


def names(enum: str, prefix: str = "") -> tuple[str, ...]:
    """Return the names of an enum of loops.h in lower case, without ``prefix`` and the last one.

    The last one is the number of the others.
    """
    elements = ffi.typeof(f"enum {enum}").elements
    return tuple(elements[i].lower().removeprefix(prefix) for i in range(len(elements) - 1))


def in_order(enum: str, values: Mapping[str, T], prefix: str = "") -> list[T]:
    """Sort values by name into the order of an enum of loops.h; see :func:`names`."""
    expected = names(enum, prefix)
    if set(values) != set(expected):
        raise ValueError(f"{enum} is {expected} in loops.h, and {tuple(values)} in Python")
    return [values[name] for name in expected]


LARGE_SCENE = 2**16
"""Number of unknowns above which memory is returned to the system, which takes at least 0.03 ms."""


def give_back_memory(unknowns: int) -> None:
    """Return freed memory of large scenes to the system; the GNU C library would keep it."""
    if unknowns > LARGE_SCENE:
        lib.give_back_memory()


def kernel(pointer: Any, instance: Any) -> Any:
    """Cast the FFCx kernel ``pointer`` of a cffi ``instance`` to the type of kernels in loops.h."""
    expected, actual = ffi.typeof("kernel *").cname, instance.typeof(pointer).cname
    if actual != expected:
        raise RuntimeError(
            f"{VERSIONS} make kernels of the C type {actual}; ufl_beam calls {expected}, and "
            "is tested with DOLFINx 0.9 to 0.11"
        )
    return ffi.cast("kernel *", int(instance.cast("intptr_t", pointer)))
