# SPDX-License-Identifier: MIT
"""SIMD versions of FFCx's kernels: several cells at once, one cell in each lane of a vector.

A kernel of FFCx computes one cell, without branches.  Its C code is compiled again with vector
types of GCC and Clang instead of numbers.  The results are compared with FFCx's kernel.
"""

from __future__ import annotations

import logging
import math
import re
from collections import Counter
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_beam.compiled.jit import (
    DECLARATIONS,
    HEADERS,
    NATIVE,
    PROCESSOR,
    CompilerError,
    Refused,
    compiled,
    text,
)
from ufl_beam.dolfinx_compat import FLAGS as COMPILER_FLAGS
from ufl_beam.dolfinx_compat import VERSIONS

LOGGER = logging.getLogger("ufl_beam")


def has_wide_vectors(flags: list[str], features: list[str]) -> bool:
    """Return whether compilers may use AVX-512 with ``flags``, on a processor with ``features``."""
    march = [NATIVE, *(flag for flag in flags if flag.startswith("-march="))][-1]
    wide = {"AVX512F", "X86_V4"} & {*features}
    return bool(wide) if march == NATIVE else march == "-march=x86-64-v4"


_FEATURES = [*PROCESSOR.get("baseline", ()), *PROCESSOR.get("found", ())]
_WIDE = has_wide_vectors(COMPILER_FLAGS, _FEATURES)

BATCH = 8 if _WIDE else 4
"""Number of cells that are computed at once, one for each number in a vector of AVX-512 or AVX.
For other processors, compilers split the vectors."""

FLAGS = ["-O2", NATIVE, "-fno-math-errno", *(["-mprefer-vector-width=512"] if _WIDE else [])]
"""Compiler flags; without the last flag, compilers halve vectors of 512 bits for square roots."""

SCHEDULED = [*FLAGS, "-fschedule-insns"]
"""Compiler flags of loops over points.  The last flag sorts instructions before registers are
chosen.  Long laws take up to 40 % less time with it, but tangents of cells of degree 3 a sixth
more."""

FUNCTIONS = {"sin", "cos", "sqrt", "fabs", "exp", "log", "pow"}
"""Functions that assembly_simd.h provides for vectors; lanes_pow has whole constants as exponents,
lanes_power others."""

INTERFACE = """
void *address(void);
void compute_both(void *of_ffcx, const double *w, const double *constants, const double *x,
                  double *one, double *several);
"""
"""Functions of assembly_simd.c, points_simd.c and check_simd.c that Python calls."""

_NUMBER = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"
_POWER = r"\bpow\(([^(),]+), (?!-?\d+\))([^(),]+)\)"
_SLOW = rf"\b(?:exp|log)\(|{_POWER}"


def in_vectors(kernel: str) -> str:
    """Rewrite the C code of an FFCx kernel with vectors instead of numbers.

    Divisions by constants become multiplications.  Divisions by a variable that is a divisor more
    than once become calls of ``quotient`` in assembly_simd.h.  Conditions become masks, whose bits
    in a lane are all zero or all one, and logical operators become bitwise operators.

    Raises:
        Refused: The kernel needs a function that assembly_simd.h does not provide.
    """
    body = kernel[kernel.index("{") :]
    body = re.sub(r"\bint (sp_\w+) =", r"double \1 =", body)  # signs
    body = re.sub(_POWER, r"lanes_power(ALL(0.0) + \1, ALL(0.0) + \2)", body)
    called = re.findall(r"\b(?!for\b|lanes_)([a-z_]\w*)\(", body)
    missing = sorted(set(called) - FUNCTIONS)
    if missing:
        raise Refused(f"assembly_simd.h has no {', '.join(missing)}")
    divisors = Counter(re.findall(r"= [a-zA-Z]\w* / (sp_\w+);", body))
    repeated = "|".join(name for name, number in divisors.items() if number > 1) or "(?!)"
    lines = []
    for line in body.splitlines():
        if not line.startswith("static const"):
            line = re.sub(rf"/ ({_NUMBER});", r"* (1.0 / \1);", line)
            line = re.sub(
                rf"= ([a-zA-Z]\w*) / ({repeated});", r"= quotient(\1, \2, over_\2);", line
            )
            line = re.sub(rf"^double ({repeated}) = .*;", r"\g<0> double over_\1 = 1 / \1;", line)
            line = re.sub(rf"\bdouble (\w+) = ({_NUMBER});", r"lanes \1 = ALL(\2);", line)
            line = re.sub(rf"= ({_NUMBER} \* weights_\w+\[iq\]);", r"= ALL(\1);", line)
            line = re.sub(r"\bdouble\b", "lanes", line)
            if "bool " in line:
                line = line.replace("&&", "&").replace("||", "|")
                line = re.sub(r"!(?!=)", "~", re.sub(r"\bbool\b", "mask", line))
                line = re.sub(
                    rf"= ({_NUMBER}) ([<>!=]=?) ({_NUMBER});", r"= ALL(\1) \2 ALL(\3);", line
                )
            line = re.sub(r"= ([^;?]+) \? ([^;:]+) : ([^;:]+);", r"= PICK(\1, \2, \3);", line)
            line = re.sub(rf"\b({'|'.join(FUNCTIONS)})\(", r"lanes_\1(", line)
        lines.append(line)
    inputs = ", ".join(f"const lanes *restrict {x}" for x in ("w", "c", "coordinate_dofs"))
    return "\n".join([f"static inline void tabulate(lanes *restrict A, {inputs})", *lines])


def written(source: Path) -> str:
    """Return the text of the kernel that FFCx wrote into the file ``source`` for a form."""
    pattern = r"^void tabulate_tensor_.*?^}(?=\s*^(?:bool|ufcx_integral) )"
    if source.exists() and (match := re.search(pattern, source.read_text(), re.M | re.S)):
        return match[0]
    raise Refused(f"{source} has no kernel")


def in_batches(rows: npt.NDArray[Any], batch_size: int) -> npt.NDArray[Any]:
    """Arrange ``rows``, one per cell, in batches (num_batches, numbers, batch size)."""
    rows = rows.reshape(len(rows), math.prod(rows.shape[1:]))
    if missing := -len(rows) % batch_size:
        rows = np.concatenate([rows, np.repeat(rows[-1:], missing, axis=0)])
    batches = rows.reshape(len(rows) // batch_size, batch_size, rows.shape[1])
    return np.ascontiguousarray(batches.transpose(0, 2, 1))


AGREEMENT = 1e-10
"""Tolerance on the difference from FFCx's kernel, relative to the largest entry of a cell, but at
least of the median cell: all entries of a cell may be small differences of its numbers.

The round-off in the tangent of a cell of degree 3 is 1e-12 of this entry; a wrong kernel has larger
errors than the tolerance.
"""


def require_agreement(module: ModuleType, kernel: int, sizes: tuple[int, int, int]) -> None:
    """Raise :class:`Refused` if a vector kernel differs from FFCx's kernel on random cells.

    ``sizes`` are the numbers of entries, of coefficient values and of constants of the kernel.
    """
    random, (entries, width, constants) = np.random.default_rng(0), sizes
    at, wrong = partial(module.ffi.from_buffer, "double[]"), 0
    for signs in ([1.0], [1.0], [-1.0, 1.0], [-1.0, 1.0]):
        w = random.uniform(0.1, 1.0, (width, BATCH)) * random.choice(signs, (width, BATCH))
        x = np.array([[0.0, 0.0, 0.0, 1.0, 0.5, 0.0]]).T + random.uniform(-0.1, 0.1, (6, BATCH))
        c, (single, several) = random.uniform(0.1, 0.9, constants), np.zeros((2, entries, BATCH))
        address = module.ffi.cast("void *", kernel)
        module.lib.compute_both(address, *map(at, (w, c, x, single, several)))
        scale = np.abs(single).max(axis=0, where=np.isfinite(single), initial=0.0)
        scale = np.maximum(scale, np.median(scale))
        with np.errstate(invalid="ignore"):
            good = (np.abs(several - single) <= AGREEMENT * scale) | (several == single)
        wrong += np.sum(~good & ~(np.isnan(single) & np.isnan(several)))
    if wrong:
        why = f"{wrong} of {4 * BATCH * entries} entries differ from FFCx's kernel"
        LOGGER.warning("a vector kernel, from code of %s, is wrong: %s", VERSIONS, why)
        raise Refused(why)


@cache
def interleaved(
    source: Path, kernel: int, sizes: tuple[int, int, int], unknowns: tuple[int, int]
) -> int | None:
    """Return the address of the SIMD loop of a compiled form, or None if the form has none.

    ``sizes`` are as in :func:`require_agreement`.  ``unknowns`` are the position of the first
    unknown among the coefficients, and the number of unknowns.
    """
    numbers = {"SIDE": math.isqrt(sizes[0]), "AT": unknowns[0], "UNKNOWNS": unknowns[1]}
    return _loop("assembly_simd.c", source, kernel, sizes, numbers, FLAGS)


@cache
def point_loop(source: Path, kernel: int, sizes: tuple[int, int, int]) -> int | None:
    """Return the address of the SIMD loop of a compiled function of points, see points_simd.c.

    None means that SIMD is not faster: loading the inputs takes as long as their evaluation, unless
    that calls functions of the C library.
    """
    if source.exists() and not re.search(_SLOW, source.read_text()):
        return None
    return _loop("points_simd.c", source, kernel, sizes, {}, SCHEDULED)


@cache
def element_loop(source: Path, kernel: int, sizes: tuple[int, int, int]) -> int | None:
    """Return the address of the SIMD loop of a compiled function of elements, or None."""
    return _loop("elements_simd.c", source, kernel, sizes, {}, FLAGS)


def _loop(
    file: str, source: Path, kernel: int, sizes: tuple[int, int, int], numbers: dict[str, int],
    flags: list[str],
) -> int | None:  # fmt: skip
    """Compile the loop in ``file`` over a kernel of FFCx, with ``numbers`` as macros."""
    numbers |= dict(zip(("ENTRIES", "WIDTH", "CONSTANTS"), sizes, strict=True)) | {"LANES": BATCH}
    defined = [f"#define {x} {n}" for x, n in numbers.items()]
    head = "\n".join([HEADERS, DECLARATIONS, *defined, text("assembly_simd.h")])
    loop = text("check_simd.c") + text(file)
    try:
        module = compiled(
            "ufl_beam_lanes",
            INTERFACE,
            lambda: "\n".join([head, in_vectors(written(source)), loop]),
            # The name of the file is a hash of the form, options and versions of FFCx.
            depends_on=[source.name, head, loop, Path(__file__).read_text()],
            flags=flags,
            check=lambda module: require_agreement(module, kernel, sizes),
        )
    except (Refused, CompilerError) as why:
        LOGGER.info("%s is computed cell by cell, which is slower: %s", source.stem, why)
        return None
    return int(module.ffi.cast("intptr_t", module.lib.address()))
