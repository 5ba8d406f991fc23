# SPDX-License-Identifier: MIT
"""FFCx's kernels for several cells at once: one cell in each lane of the processor's vectors.

Kernels are long straight lines of arithmetic on the numbers of one cell.  Their text is compiled
once more with vectors in the place of numbers, which GCC and Clang know as types.  The loop over
the cells is that of :mod:`ufl_beam.compiled.c_library`.
"""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import numpy as np

from ufl_beam.compiled.jit import DECLARATIONS, HEADERS, CompilerError, compiled, text

LANES = 4
"""Cells that are computed at once: as many as AVX has room for.  On what has less, vectors are made
of several; eight of AVX-512 are hardly faster, and more often too many."""

FUNCTIONS = {"sin", "cos", "sqrt", "fabs", "pow"}
"""Functions of which lanes.h has a version for vectors; powers with whole exponents."""

_NUMBER = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"


class NotInVectors(Exception):
    """A kernel that has to be computed cell by cell."""


def in_vectors(kernel: str) -> str:
    """The text of a kernel of FFCx with vectors in the place of numbers.

    Args:
        kernel: Its definition in C.

    Raises:
        NotInVectors: It asks for functions that lanes.h has not.
    """
    body = kernel[kernel.index("{") :]
    called = re.findall(r"\b(?!for\b)([a-z_]\w*)\(", body)
    whole = re.findall(r"\bpow\([\w\[\]]+, -?\d+\)", body)
    if set(called) - FUNCTIONS or len(whole) < called.count("pow"):
        raise NotInVectors(f"functions {sorted(set(called))}, of whole powers {whole}")
    lines = []
    for line in body.splitlines():
        if not line.startswith("static const"):
            line = re.sub(rf"\bdouble (\w+) = ({_NUMBER});", r"lanes \1 = ALL(\2);", line)
            line = re.sub(rf"= ({_NUMBER} \* weights_\w+\[iq\]);", r"= ALL(\1);", line)
            line = re.sub(r"\bdouble\b", "lanes", line)
            line = re.sub(r"\bbool\b", "mask", line)
            line = re.sub(r"= ([^;?]+) \? ([^;:]+) : ([^;:]+);", r"= PICK(\1, \2, \3);", line)
            line = re.sub(rf"\b({'|'.join(FUNCTIONS)})\(", r"lanes_\1(", line)
        lines.append(line)
    names = ("lanes *restrict A", *(f"const lanes *restrict {x}" for x in ("w", "c")))
    arguments = ", ".join((*names, "const lanes *restrict coordinate_dofs"))
    return f"static inline void tabulate({arguments})\n" + "\n".join(lines)


def written(source: Path) -> str:
    """Return the kernel that FFCx wrote for a cell form.

    Args:
        source: File of its C.

    Raises:
        NotInVectors: The file has none.
    """
    pattern = r"^void tabulate_tensor_.*?^}(?=\s*^(?:bool|ufcx_integral) )"
    if source.exists() and (found := re.search(pattern, source.read_text(), re.M | re.S)):
        return found[0]
    raise NotInVectors(f"{source} has no kernel")


NONE = "void *in_lanes(void) { return 0; }"
"""C of a module without a loop, which the cache remembers like one with it."""


def _loop(written_in: Path, sizes: dict[str, int]) -> ModuleType:
    """The module with the loop over the cells."""
    defined = [f"#define {name} {size}" for name, size in sizes.items()]
    files = [text("lanes.h"), text("lanes.c")]

    def source() -> str:
        try:
            kernel = in_vectors(written(written_in))
        except NotInVectors:
            return NONE
        return "\n".join([HEADERS, DECLARATIONS, *defined, files[0], kernel, files[1]])

    return compiled(
        "ufl_beam_lanes",
        "void *in_lanes(void);",
        source,
        # FFCx names what it makes by what is in it; NumPy knows what "native" means.
        made_of=[written_in.name, *defined, *files, DECLARATIONS, Path(__file__).read_text(), _CPU],
        flags=["-O2", "-march=native", "-fno-math-errno", "-w"],
    )


_CPU = repr(np.show_config(mode="dicts"))
"""Configuration of NumPy, which includes the features of the processor."""

_modules: dict[tuple[str, int, int, int], ModuleType | None] = {}


def in_lanes(source: Path, entries: int, width: int, constants: int) -> int | None:
    """Address of what computes several cells of a compiled form at once; none if nothing does.

    Args:
        source: The C that FFCx wrote for a cell form.
        entries: Of the vector or matrix of a cell.
        width: Number of its coefficients' values in a cell.
        constants: Number of its constants.
    """
    key = (source.name, entries, width, constants)
    if key not in _modules:
        sizes = {"LANES": LANES, "ENTRIES": entries, "WIDTH": width, "CONSTANTS": constants}
        try:
            _modules[key] = _loop(source, sizes)
        except CompilerError:
            _modules[key] = None
    module = _modules[key]
    if module is None:
        return None
    return int(module.ffi.cast("intptr_t", module.lib.in_lanes())) or None
