# SPDX-License-Identifier: MIT
"""Compilation of C modules and UFL forms into a cache, which later runs use.

The C compiler is no additional requirement, because FFCx needs it at run time, too.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from petsc4py import PETSc

import cffi
import numpy as np
import ufl

from ufl_beam.compiled.code_cache import cached, found_entry
from ufl_beam.dolfinx_compat import FLAGS, TABULATE, compile_form, fem, form_key

HEADERS = f"""\
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#define CALL(f, e, w, c, x) f(e, w, c, x, 0, 0{TABULATE[1]})"""
"""Beginning of every translation unit; CALL calls a kernel of FFCx."""


def text(name: str) -> str:
    """Return the text of a C file."""
    return (Path(__file__).parent / "c" / name).read_text()


DECLARATIONS = f"""\
typedef void (kernel)({TABULATE[0]});
typedef int{8 * np.dtype(PETSc.IntType).itemsize}_t petsc_int;
{text("loops.h")}"""
"""Declarations that follow HEADERS in every translation unit."""

SANITIZERS = [
    *("-O1", "-g1", "-fno-omit-frame-pointer", "-fno-wrapv"),
    *("-fsanitize=address,undefined,bounds-strict", "-fno-sanitize-recover=all"),
    *("-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror"),
]
"""Flags that add checks of addresses and undefined behaviour, with line numbers (-g1); see `make
sanitize`."""

EXTRA = SANITIZERS if os.environ.get("UFL_BEAM_SANITIZE", "0") != "0" else []
"""Flags appended for every library: sanitizers if ``UFL_BEAM_SANITIZE`` is set and not 0."""

NATIVE = "-march=native"
"""Flag that lets the compiler use all instructions of the processor."""

PROCESSOR = np.show_config(mode="dicts").get("SIMD Extensions", {})
"""Features of the processor: the baseline of NumPy, and further features that NumPy found.

Code compiled for this processor may not run on another processor that shares the cache.
"""


class CompilerError(RuntimeError):
    """The C compiler is missing or rejects the code."""


class Refused(Exception):
    """Compiled code must not be used; the message is the reason, which the cache stores."""


def compiled(
    stem: str,
    declarations: str,
    source: Callable[[], str],
    *,
    depends_on: Sequence[str],
    flags: Sequence[str],
    check: Callable[[ModuleType], None] = lambda _: None,
) -> ModuleType:
    """Return a C module, which is compiled if it is not in the cache.

    Args:
        stem: Beginning of the name of the module.
        declarations: C declarations of functions and types for Python.
        source: Function that returns the C code, called if the module is not in the cache; it may
            raise :class:`Refused`.
        depends_on: Texts that determine the C code; if one changes, the module is compiled again.
        flags: Compiler flags.
        check: Function called with the newly compiled module; it may raise :class:`Refused`.
    """
    # Python's own flags have -g, and debug symbols take a fifth of the time and half of the file.
    flags = [*flags, "-g0", "-fvisibility=hidden", *FLAGS, *EXTRA]
    name = f"{stem}_{_digest(declarations, *depends_on, *flags, sys.version, repr(PROCESSOR))}"

    def build(directory: Path) -> ModuleType | Refused:
        builder = cffi.FFI()
        builder.cdef(declarations)
        try:
            options = {"extra_compile_args": flags, "extra_link_args": EXTRA}
            builder.set_source(name, source(), libraries=["m"], **options)
            with _explained(stem):
                builder.compile(tmpdir=directory)
            check(module := _imported(name, directory))
        except Refused as refusal:
            (directory / REFUSAL).write_text(str(refusal))
            return refusal
        return module

    def load(directory: Path) -> ModuleType | Refused:
        refusal = directory / REFUSAL
        return Refused(refusal.read_text()) if refusal.exists() else _imported(name, directory)

    module, directory = cached(name, build, load)
    if isinstance(module, Refused):
        raise module
    module.__file__ = str(directory / Path(str(module.__file__)).name)  # renamed since its import
    return module


TEXT = "text"
"""File of a cache entry that is a text."""

REFUSAL = "refused"
"""File of a cache entry whose code must not be used; it contains the reason."""


def _imported(name: str, directory: Path) -> ModuleType:
    """Import a compiled module."""
    library = directory / (name + str(sysconfig.get_config_var("EXT_SUFFIX")))
    spec = importlib.util.spec_from_file_location(name, library)
    if spec is None or spec.loader is None:
        raise ImportError(f"{library} is not a Python library")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def compiled_form(form: ufl.Form, *flags: str) -> tuple[fem.Form, Path]:
    """Return a form, which is compiled if it is not in the cache, and the path of its C code.

    ``flags`` are further compiler flags.
    """

    def build(directory: Path) -> fem.Form:
        with _explained("a form"):
            return compile_form(form, directory, flags)

    key = _digest(form_key(form), *flags)
    loaded, directory = cached(f"form_{key}", build, partial(compile_form, form, flags=flags))
    return loaded, _code(directory, Path(loaded.module.__file__))


def _code(directory: Path, library: Path) -> Path:
    """Return the path of the C code of a library that FFCx has compiled."""
    return directory / (library.name.split(".")[0] + ".c")


class CachedForm(NamedTuple):
    """A form of FFCx without its expressions in UFL, as attributes of DOLFINx's forms."""

    ufcx_form: Any
    module: ModuleType


def has_form(name: str) -> bool:
    """Return whether the cache has a form, by the name of its entry."""
    return found_entry(name) is not None


@cache
def cached_form(name: str) -> tuple[CachedForm, Path]:
    """Return a form by the name of its entry in the cache, and the path of its C code.

    Its functions are valid until the process ends.
    """
    directory = found_entry(name)
    if directory is None:
        raise FileNotFoundError(f"the cache of compiled code has no {name}")
    (library,) = directory.glob("lib*" + str(sysconfig.get_config_var("EXT_SUFFIX")))
    module = _imported(library.name.split(".")[0], directory)
    (form,) = (x for x in dir(module.lib) if x.startswith("form_"))
    return CachedForm(getattr(module.lib, form), module), _code(directory, library)


def remembered(name: str, make: Callable[[], str]) -> str:
    """Return a text from the cache, which is made if it is not there."""

    def build(directory: Path) -> str:
        (directory / TEXT).write_text(made := make())
        return made

    return cached(name, build, lambda directory: (directory / TEXT).read_text())[0]


def _digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


@contextmanager
def _explained(code: str) -> Iterator[None]:
    """Raise :class:`CompilerError` with the remedy if ``code`` cannot be compiled."""
    try:
        yield
    except cffi.VerificationError as error:
        raise CompilerError(
            f"{code} cannot be compiled: {error}. DOLFINx and ufl_beam need a C compiler when they "
            "run: install one (Debian: gcc, conda: c-compiler), or name it in the environment "
            "variable CC"
        ) from error
