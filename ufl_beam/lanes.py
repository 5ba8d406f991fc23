"""FFCx's kernels for several cells at once: one cell in each lane of the processor's vectors.

Kernels are long straight lines of arithmetic on the numbers of one cell.  Their text is compiled
once more with vectors in the place of numbers, which GCC and Clang know as types.  The loop over
the cells is that of :mod:`ufl_beam.loops`.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np

from ufl_beam.compat import fem
from ufl_beam.native import DECLARATIONS, HEADERS, compiled, text

LANES = 4
"""Cells that are computed at once: as many as AVX has room for.  On what has less, vectors are made
of several; eight of AVX-512 are hardly faster, and more often too many."""

FUNCTIONS = {"sin", "cos", "sqrt", "fabs", "pow"}
"""Functions of which lanes.h has a version for vectors; powers with whole exponents."""

_NUMBER = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"
_KEYWORDS = {"for", "tabulate"}


def in_vectors(kernel: str) -> str | None:
    """The text of a kernel of FFCx with vectors in the place of numbers; none if it asks for more.

    Args:
        kernel: Its definition in C.
    """
    body = kernel[kernel.index("{") :]
    called = set(re.findall(r"\b([a-z_]\w*)\(", body)) - _KEYWORDS
    powers = re.findall(r"\bpow\(\w+, ([^)]+)\)", body)
    if called - FUNCTIONS or not all(re.fullmatch(r"-?\d+", power) for power in powers):
        return None
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


def written(form: fem.Form) -> str | None:
    """The kernel that FFCx wrote for a cell form; none if it is not in the cache any more."""
    library = Path(form.module.__file__)
    source = library.with_name(library.name.split(".")[0] + ".c")
    if not source.exists():
        return None
    pattern = r"^void tabulate_tensor_.*?^}(?=\s*^(?:bool|ufcx_integral) )"
    found = re.search(pattern, source.read_text(), re.M | re.S)
    return None if found is None else found[0]


def _processor() -> str:
    """What "native" means: what NumPy has found that the processor can."""
    return repr(np.show_config(mode="dicts"))


@cache
def _loop(kernel: str, entries: int, width: int, constants: int) -> Any:
    """Address of the loop over the cells; none where the compiler does not know such vectors."""
    numbers = {"LANES": LANES, "ENTRIES": entries, "WIDTH": width, "CONSTANTS": constants}
    source = "\n".join(
        [
            *(HEADERS, DECLARATIONS),
            *(f"#define {name} {value}" for name, value in numbers.items()),
            *(text("lanes.h"), kernel, text("lanes.c")),
        ]
    )
    flags = ["-O2", "-march=native", "-fno-math-errno", "-w"]
    try:
        module = compiled("ufl_beam_lanes", "void *in_lanes(void);", source, flags, _processor())
    except cffi.VerificationError:
        return None
    _alive.append(module)
    return int(module.ffi.cast("intptr_t", module.lib.in_lanes()))


_alive: list[Any] = []


def in_lanes(form: fem.Form, entries: int, width: int, constants: int) -> int | None:
    """Address of what computes several cells of a compiled form at once; none if nothing does.

    Args:
        form: A cell form.
        entries: Of the vector or matrix of a cell.
        width: Number of its coefficients' values in a cell.
        constants: Number of its constants.
    """
    kernel = written(form)
    vectors = None if kernel is None else in_vectors(kernel)
    return None if vectors is None else _loop(vectors, entries, width, constants)
