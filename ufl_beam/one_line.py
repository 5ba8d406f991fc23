# SPDX-License-Identifier: MIT
"""Representations of one line, for the prompt of Python."""

from __future__ import annotations

import reprlib
from fractions import Fraction
from inspect import signature
from types import FunctionType
from typing import Any

FEW = 4  # numbers of an array that are written


class _Short(reprlib.Repr):
    """Six digits of numbers, names of functions, shapes of arrays; long lists are cut."""

    def __init__(self) -> None:
        super().__init__()
        self.maxother = self.maxstring = 120

    def repr_float(self, x: float, level: int) -> str:
        return f"{x:.6g}"

    repr_float64 = repr_float

    def repr_Fraction(self, x: Fraction, level: int) -> str:
        return str(x)

    def repr_function(self, f: FunctionType, level: int) -> str:
        return f.__name__

    def repr_ndarray(self, x: Any, level: int) -> str:
        if x.ndim != 1 or x.size > FEW:
            return f"array of shape {x.shape}"
        return self.repr_list([*x], level)


_SHORT = _Short().repr


def one_line(record: Any) -> str:
    """Write a record: ``Mesh(refine=2)``; fields as by default and empty ones are left out."""
    fields = []
    for name, parameter in signature(type(record)).parameters.items():
        value = _SHORT(getattr(record, name))
        if value not in (_SHORT(parameter.default), "{}"):
            fields.append(f"{name}={value}")
    return f"{type(record).__name__}({', '.join(fields)})"


def bracketed(named: Any) -> str:
    """Write what has a text of one line: ``<column.end (0, 3)>``."""
    return f"<{named}>"


def counted(*things: tuple[int, str, str]) -> str:
    """Write the numbers of things of which there are any: ``1 beam, 8 cells``."""
    return ", ".join(f"{n} {one if n == 1 else many}" for n, one, many in things if n)
