# SPDX-License-Identifier: MIT
"""FFCx's kernels for several cells at once: one cell in each lane of the processor's vectors.

Kernels are long straight lines of arithmetic on the numbers of one cell.  Their text is compiled
once more with vectors in the place of numbers, which GCC and Clang know as types.  The loop over
the cells is that of :mod:`ufl_beam.compiled.c_library`.
"""

from __future__ import annotations

import logging
import math
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_beam.compiled.c_library import doubles, ffi, integers, lib
from ufl_beam.compiled.jit import DECLARATIONS, HEADERS, CompilerError, Refused, compiled, text
from ufl_beam.dolfinx_compat import VERSIONS

LOGGER = logging.getLogger("ufl_beam")

LANES = 4
"""Cells that are computed at once: as many as AVX has room for.  On what has less, vectors are made
of several; eight of AVX-512 are hardly faster, and more often too many."""

FUNCTIONS = {"sin", "cos", "sqrt", "fabs", "pow"}
"""Functions of which lanes.h has a version for vectors; powers with whole exponents."""

_NUMBER = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"


def in_vectors(kernel: str) -> str:
    """The text of a kernel of FFCx with vectors in the place of numbers.

    Args:
        kernel: Its definition in C.

    Raises:
        Refused: It asks for functions that lanes.h has not.
    """
    body = kernel[kernel.index("{") :]
    called = re.findall(r"\b(?!for\b)([a-z_]\w*)\(", body)
    whole = re.findall(r"\bpow\([\w\[\]]+, -?\d+\)", body)
    missing = sorted(set(called) - FUNCTIONS)
    if len(whole) < called.count("pow"):
        missing.append("pow with a broken exponent")
    if missing:
        raise Refused(f"lanes.h has no {', '.join(missing)}")
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
        Refused: The file has none.
    """
    pattern = r"^void tabulate_tensor_.*?^}(?=\s*^(?:bool|ufcx_integral) )"
    if source.exists() and (found := re.search(pattern, source.read_text(), re.M | re.S)):
        return found[0]
    raise Refused(f"{source} has no kernel")


def in_batches(rows: npt.NDArray[Any], lanes: int) -> npt.NDArray[Any]:
    """Rows of numbers, one of each cell, as loops.h says; (num_batches, numbers, lanes).

    Args:
        rows: Shape (num_cells, ...).
        lanes: Number of rows in a batch.
    """
    rows = rows.reshape(len(rows), math.prod(rows.shape[1:]))
    if missing := -len(rows) % lanes:
        rows = np.concatenate([rows, np.repeat(rows[-1:], missing, axis=0)])
    return np.ascontiguousarray(rows.reshape(-1, lanes, rows.shape[1]).transpose(0, 2, 1))


AGREEMENT = 1e-12
"""Difference of a kernel in vectors from FFCx's, as a part of the largest entry of a cell."""


def require_agreement(found: Any, tabulate: Any, entries: int, width: int, constants: int) -> None:
    """Compare a kernel in vectors with FFCx's on random cells.

    Args:
        found: Function of lanes.c.
        tabulate: The kernel of FFCx.
        entries: Sizes of the kernel, as for :func:`in_lanes`.
        width: The same.
        constants: The same.

    Raises:
        Refused: The results differ.
    """
    number, random = 4 * LANES + 1, np.random.default_rng(0)  # the last batch is not full
    w = random.uniform(0.1, 1.0, (number, width))
    w[::2] *= random.choice([-1.0, 1.0], w[::2].shape)
    x = np.array([0.0, 0.0, 0.0, 1.0, 0.5, 0.0]) + random.uniform(-0.1, 0.1, (number, 6))
    row = np.arange(number * entries, dtype=np.int32).reshape(number, entries)
    numbers, results = random.uniform(0.1, 0.9, constants), np.zeros((2, number, entries))
    for result, lanes, function in zip(results, (1, LANES), (ffi.NULL, found), strict=True):
        cells = {
            **{"tabulate": tabulate, "several": function, "lanes": lanes, "number": number},
            **{"w": doubles(in_batches(w, lanes)), "width": width, "constants": doubles(numbers)},
            **{"coordinates": doubles(in_batches(x, lanes)), "rows": entries},
            "row": integers(in_batches(row, lanes)),
        }
        lib.add_cells(ffi.new("cells *", cells), ffi.NULL, doubles(result))
    one, several = results
    scale = np.abs(one).max(axis=1, where=np.isfinite(one), initial=0.0, keepdims=True)
    with np.errstate(invalid="ignore"):
        good = (abs(several - one) <= AGREEMENT * scale) | (several == one)
    good |= np.isnan(one) & np.isnan(several)
    if not np.all(good) or not np.any(np.isfinite(one)):
        why = f"{np.sum(~good)} of {good.size} entries are not those of FFCx's kernel"
        LOGGER.warning("a kernel in vectors, compiled by %s, is wrong: %s", VERSIONS, why)
        raise Refused(why)


_CPU = repr(np.show_config(mode="dicts"))
"""Configuration of NumPy, which includes the features of the processor."""

_functions: dict[tuple[str, int, int, int], Any] = {}


def in_lanes(source: Path, tabulate: Any, entries: int, width: int, constants: int) -> Any:
    """Function that computes several cells of a compiled form at once, or None.

    Args:
        source: The C that FFCx wrote for a cell form.
        tabulate: Its kernel.
        entries: Of the vector or matrix of a cell.
        width: Number of its coefficients' values in a cell.
        constants: Number of its constants.
    """
    sizes = (entries, width, constants)
    key = (source.name, *sizes)
    if key not in _functions:
        try:
            module = _compiled(source, tabulate, sizes)
            _functions[key] = _function(module)
        except (Refused, CompilerError) as why:
            LOGGER.info("%s is computed cell by cell, which is slower: %s", source.stem, why)
            _functions[key] = None
    return _functions[key]


def _function(module: ModuleType) -> Any:
    address = int(module.ffi.cast("intptr_t", module.lib.address()))
    return ffi.cast("in_lanes *", address)


def _compiled(source: Path, tabulate: Any, sizes: tuple[int, int, int]) -> ModuleType:
    """The module with the loop over the cells."""
    names = ("LANES", "ENTRIES", "WIDTH", "CONSTANTS")
    defined = [f"#define {x} {n}" for x, n in zip(names, (LANES, *sizes), strict=True)]
    head, loop = text("lanes.h"), text("lanes.c")
    return compiled(
        "ufl_beam_lanes",
        "void *address(void);",
        lambda: "\n".join(
            [HEADERS, DECLARATIONS, *defined, head, in_vectors(written(source)), loop]
        ),
        # FFCx names what it makes by what is in it; NumPy knows what "native" means.
        made_of=[source.name, *defined, head, loop, DECLARATIONS, Path(__file__).read_text(), _CPU],
        flags=["-O2", "-march=native", "-fno-math-errno"],
        check=lambda module: require_agreement(_function(module), tabulate, *sizes),
    )
