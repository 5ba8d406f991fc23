"""C compiled once for the machine, and kept in the cache of the JIT compiler.

FFCx needs a C compiler at run time anyway.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

from petsc4py import PETSc

import cffi
import numpy as np

from ufl_beam.compat import TABULATE, jit_directory

HEADERS = "\n".join(f"#include <{name}.h>" for name in ("float", "math", "stdint", "string"))


def text(name: str) -> str:
    """A file of C beside this one."""
    return Path(__file__).with_name(name).read_text()


DECLARATIONS = "\n".join(
    [
        f"typedef void (kernel)({TABULATE[0]});",
        f"typedef int{8 * np.dtype(PETSc.IntType).itemsize}_t petsc_int;",
        text("loops.h"),
    ]
)
"""What all files of C know of each other."""

SANITIZERS = (
    "-O1",
    "-g1",  # line numbers
    "-fno-omit-frame-pointer",
    "-fno-wrapv",
    "-fsanitize=address,undefined,bounds-strict",
    "-fno-sanitize-recover=all",
)
"""Flags that make the compiler check addresses and undefined behaviour; see `make sanitize`."""

EXTRA = SANITIZERS if os.environ.get("UFL_BEAM_SANITIZE", "0") != "0" else ()
"""Flags after those of each library: the sanitizers if ``UFL_BEAM_SANITIZE=1``, else none."""


def compiled(
    stem: str,
    declarations: str,
    source: Callable[[], str],
    *,
    made_of: Sequence[str],
    flags: Sequence[str],
) -> ModuleType:
    """The module of cffi with a source, from the cache or made anew.

    Args:
        stem: Beginning of its name.
        declarations: What Python sees of it.
        source: Its C; called if it is not in the cache.
        made_of: What the C depends on, and what the flags make of the machine.
        flags: For the compiler.

    Raises:
        cffi.VerificationError: The compiler refuses.
    """
    flags = [*flags, *EXTRA]
    key = "\0".join((declarations, *made_of, *flags, sys.version))
    name = f"{stem}_{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    directory = jit_directory()
    library = directory / (name + str(sysconfig.get_config_var("EXT_SUFFIX")))
    if not library.exists():
        builder = cffi.FFI()
        builder.cdef(declarations)
        builder.set_source(
            name,
            source(),
            extra_compile_args=flags,
            extra_link_args=list(EXTRA),
            libraries=["m"],
        )
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
