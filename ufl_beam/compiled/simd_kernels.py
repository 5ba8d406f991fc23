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
from collections.abc import Sequence
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
"""Compiler flags of loops over points, and over elements with two nodes.  The last flag sorts
instructions before registers are chosen.  Long laws take up to 40 % less time with it, forces of
cells of degree 1 a fifth less and their tangents a tenth less, but tangents of cells of degree 2
and 3 a quarter more."""

OF_TWO_NODES = 6
"""Number of unknowns of an element with two nodes."""

FUNCTIONS = {"sin", "cos", "tan", "sqrt", "fabs", "exp", "log", "pow"}
"""Functions that assembly_simd.h provides for vectors; lanes_pow has whole constants as exponents,
lanes_power others."""

INTERFACE = """
void *address_{0}(void);
void compute_both_{0}(void *of_ffcx, const double *w, double *one, double *several);
"""
"""Functions of each kernel that Python calls, in check_simd.c and the file of the loop."""

Sizes = tuple[int, int]
"""Numbers of outputs and of inputs of a kernel."""

OWN = (
    "tabulate", "compute_both", "address", "evaluate_in_lanes", "add_in_lanes", "take_unknowns",
    "insert_batch", "insert_rows_of_six",
)  # fmt: skip
"""Functions of each kernel in C, whose names get the number of the kernel."""

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


def without_scale(kernel: str) -> str:
    """Remove the length of the cell, which is 1, from the C code of an FFCx kernel of elements.

    FFCx multiplies each entry by it.  The code remains if the length is not a factor.
    """
    jacobian = r"^static const double FE\w+\[1\]\[1\]\[1\]\[2\] = .*?^// Section: Jacobian\n.*?^}\n"
    section = re.search(jacobian, kernel, re.M | re.S)
    if section is None:
        return kernel
    scale, kept = {*re.findall(r"^double (J\w*_c\d) =", section[0], re.M)}, list[str]()
    for line in kernel.replace(section[0], "").splitlines():
        defined = re.match(r"double (sp_\w+) = (.*);", line)
        used = re.findall(r"\b(?:sp_|J\d*_)\w+", defined[2] if defined else line)
        if defined and used and scale.issuperset(used):
            scale.add(defined[1])
            continue
        if defined and len(used) == 2 and " * " in line and len(scale.intersection(used)) == 1:
            line = f"double {defined[1]} = {next(x for x in used if x not in scale)};"
        elif scale.intersection(used):
            return kernel
        kept.append(line)
    return "\n".join(kept)


def with_stored_inputs(kernel: str, unknowns: int) -> str:
    """Let a kernel read the inputs after the unknowns from ``c``, which avoids copies of them."""

    def place(match: re.Match[str]) -> str:
        at = int(match[1])
        return match[0] if at < unknowns else f"c[{at - unknowns}]"

    if other := re.search(r"\bw\[(?!\d+\]).*", kernel):
        raise Refused(f"inputs are not read one by one: {other[0]}")
    return re.sub(r"\bw\[(\d+)\]", place, kernel)


def written(source: Path) -> list[str]:
    """Return the kernels that FFCx wrote into the file ``source`` for the integrals of a form."""
    code = source.read_text() if source.exists() else ""
    pattern = r"^void tabulate_tensor_(\w+).*?^}(?=\s*^(?:bool|ufcx_integral) )"
    kernels = {match[1]: match[0] for match in re.finditer(pattern, code, re.M | re.S)}
    names = re.findall(r"&(integral_\w+)", code)
    if not names or not kernels.keys() >= {*names}:
        raise Refused(f"{source} has no kernel")
    return [kernels[name] for name in names]


def in_batches(rows: npt.NDArray[Any], batch_size: int) -> npt.NDArray[Any]:
    """Arrange ``rows``, one per cell, in batches (num_batches, numbers, batch size)."""
    rows = rows.reshape(len(rows), math.prod(rows.shape[1:]))
    if missing := -len(rows) % batch_size:
        rows = np.concatenate([rows, np.repeat(rows[-1:], missing, axis=0)])
    batches = rows.reshape(len(rows) // batch_size, batch_size, rows.shape[1])
    return np.ascontiguousarray(batches.transpose(0, 2, 1))


ROUND_OFF = 16 * float(np.finfo(float).eps)
"""Least tolerance for inputs of size one, between which all entries of a cell may cancel."""

NEAR = 1e-13
"""Relative change of inputs by which an entry of FFCx's own kernel changes by more than the
tolerance, if round-off decides a condition in it, or its numbers cancel; such entries do not count.
"""

AGREEMENT = 1e-10
"""Tolerance on the difference from FFCx's kernel, relative to the largest entry of a cell, but at
least of the median cell: all entries of a cell may be small differences of its numbers.

The round-off in the tangent of a cell of degree 3 is 1e-12 of this entry; a wrong kernel has larger
errors than the tolerance.
"""


def require_agreement(module: ModuleType, kernels: Sequence[tuple[int, Sizes]]) -> None:
    """Raise :class:`Refused` if a vector kernel differs from FFCx's kernel on random cells."""
    at = partial(module.ffi.from_buffer, "double[]")
    for number, (kernel, (entries, width)) in enumerate(kernels):
        random, wrong, of_ffcx = np.random.default_rng(0), 0, module.ffi.cast("void *", kernel)
        for signs in ([1.0], [1.0], [-1.0, 1.0], [-1.0, 1.0]):
            w = random.uniform(0.1, 1.0, (width, BATCH)) * random.choice(signs, (width, BATCH))
            one, several, moved = np.zeros((3, entries, BATCH))
            compute_both = getattr(module.lib, f"compute_both_{number}")
            compute_both(of_ffcx, *map(at, (w, one, several)))
            scale = np.abs(one).max(axis=0, where=np.isfinite(one), initial=0.0)
            scale = np.maximum(AGREEMENT * np.maximum(scale, np.median(scale)), ROUND_OFF)
            with np.errstate(invalid="ignore"):
                good = (np.abs(several - one) <= scale) | (several == one)
                for _ in range(4 if not good.all() else 0):  # beside a condition, or cancellation
                    near = w * (1.0 + NEAR * random.choice([-1.0, 1.0], w.shape))
                    compute_both(of_ffcx, *map(at, (near, moved, several.copy())))
                    good |= np.abs(moved - one) > scale
            wrong += np.sum(~good & (np.isfinite(one) | np.isfinite(several)))
        if wrong:
            why = f"{wrong} of {4 * BATCH * entries} entries differ from FFCx's kernel"
            LOGGER.warning("a vector kernel, from code of %s, is wrong: %s", VERSIONS, why)
            raise Refused(why)


@cache
def point_loop(source: Path, kernel: int, sizes: Sizes) -> int | None:
    """Return the address of the SIMD loop of a compiled function of points, see points_simd.c.

    None means that SIMD is not faster: loading the inputs takes as long as their evaluation, unless
    that calls functions of the C library.
    """
    if source.exists() and not re.search(_SLOW, source.read_text()):
        return None
    return _loops(["points_simd.c"], source, [(kernel, sizes)], SCHEDULED)[0]


@cache
def element_loops(
    source: Path, kernels: tuple[tuple[int, Sizes], ...], inserted: int, unknowns: int,
    large: bool = False,
) -> list[int | None]:  # fmt: skip
    """Return the addresses of the SIMD loops of functions of elements, compiled as one form.

    The first ``inserted`` functions of cells add to a vector or a matrix; their first inputs are
    the ``unknowns``.
    """
    files = ["assembly_simd.c" if k < inserted else "elements_simd.c" for k in range(len(kernels))]
    flags = FLAGS if unknowns > OF_TWO_NODES else SCHEDULED
    flags = [*flags, *["-O1", "-fno-schedule-insns"] * large]
    return _loops(files, source, kernels, flags, unknowns)


def _loops(
    files: Sequence[str], source: Path, kernels: Sequence[tuple[int, Sizes]], flags: list[str],
    unknowns: int = 0,
) -> list[int | None]:  # fmt: skip
    """Compile the loop in a file over each kernel of FFCx."""
    head = "\n".join([HEADERS, DECLARATIONS, f"#define LANES {BATCH}", text("assembly_simd.h")])
    loops, which, macros = [text("check_simd.c") + text(x) for x in files], range(len(kernels)), []
    for k in which:
        sizes = kernels[k][1]
        values = zip(("UNKNOWNS", "ENTRIES", "WIDTH"), (unknowns, *sizes), strict=True)
        own = [("SIDE", math.isqrt(sizes[0])), *((name, f"{name}_{k}") for name in OWN)]
        defined = [*values, *own]
        macros.append("".join(f"\n#undef {x}\n#define {x} {value}" for x, value in defined))

    def code() -> str:
        own = list(map(in_vectors, map(without_scale, written(source))))
        for k in range(files.count("assembly_simd.c")):
            own[k] = with_stored_inputs(own[k], unknowns)
        bodies = zip(macros, own, loops, strict=True)
        return head + "".join(f"{defined}\n{body}\n{loop}" for defined, body, loop in bodies)

    try:
        lanes = compiled(
            "ufl_beam_lanes",
            "".join(map(INTERFACE.format, which)),
            code,
            # The name of the file is a hash of the form, options and versions of FFCx.
            depends_on=[source.name, head, *macros, *loops, Path(__file__).read_text()],
            flags=flags,
            check=lambda module: require_agreement(module, kernels),
        )
    except (Refused, CompilerError) as why:
        LOGGER.info("%s is computed cell by cell, which is slower: %s", source.stem, why)
        return [None] * len(kernels)
    addresses = (getattr(lanes.lib, f"address_{k}")() for k in which)
    return [int(lanes.ffi.cast("intptr_t", address)) for address in addresses]
