# SPDX-License-Identifier: MIT
"""Texts for prompts, notebooks and pictures: one-line representations, HTML, names and units.

Models and results do not import plotting: modules that draw them register functions here.
"""

from __future__ import annotations

import html
import math
import reprlib
from abc import ABC, abstractmethod
from collections.abc import Iterable
from fractions import Fraction
from functools import singledispatch
from inspect import signature
from types import FunctionType
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")

FEW = 4  # largest size of an array whose numbers are written


class _Short(reprlib.Repr):
    """Short texts: numbers of six digits, names of functions, shapes of arrays, truncated lists."""

    def repr1(self, x: Any, level: int) -> str:
        if isinstance(x, float):
            return f"{x:.6g}"
        if isinstance(x, Fraction):
            return str(x)
        if isinstance(x, FunctionType):
            return x.__name__
        if type(x).__name__ == "ndarray":
            short = x.ndim == 1 and x.size <= FEW
            return self.repr_list([*x], level) if short else f"array of shape {x.shape}"
        return super().repr1(x, level)


def at_point(point: Iterable[float]) -> str:
    """Return "(x, y)"; coordinates below 1e-12 m, as by round-off of arcs, are written as zero."""
    rounded = (round(float(coordinate), 12) + 0.0 for coordinate in point)  # -0 + 0 is 0
    return f"({', '.join(f'{x:g}' for x in rounded)})"


_SHORT = _Short()
_SHORT.maxother = _SHORT.maxstring = 120


def compact_repr(record: Any) -> str:
    """Write a record as ``Mesh(refine=2)``, without empty mappings and default values."""
    fields = []
    for name, parameter in signature(type(record)).parameters.items():
        value = _SHORT.repr(getattr(record, name))
        if value not in (_SHORT.repr(parameter.default), "{}"):
            fields.append(f"{name}={value}")
    return f"{type(record).__name__}({', '.join(fields)})"


def in_one_line(kind: type[T]) -> type[T]:
    """Let a class, such as a named tuple, use :func:`compact_repr` as its ``repr``."""
    kind.__repr__ = compact_repr  # type: ignore[method-assign]
    return kind


def bracketed(named: Any) -> str:
    """Write the text of an object in angle brackets: ``<column.end (0, 3)>``."""
    return f"<{named}>"


def counted(*things: tuple[int, str, str]) -> str:
    """Write the numbers of things, as in ``1 beam, 8 cells``; leave out zeros."""
    return ", ".join(f"{n} {singular if n == 1 else plural}" for n, singular, plural in things if n)


def aligned(rows: list[list[str]], left: int | None = None) -> list[str]:
    """Return rows of texts as lines, with columns to the right, but the column ``left``."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = enumerate(zip(row, widths, strict=True))
        lines.append("  ".join(x.ljust(w) if i == left else x.rjust(w) for i, (x, w) in cells))
    return [line.rstrip() for line in lines]


# -- notebooks -----------------------------------------------------------------------------------


@singledispatch
def html_page(shown: object) -> str:
    """Return an object as HTML: its text, unless a function is registered for its class."""
    return f"<pre>{html.escape(str(shown))}</pre>"


class Rich:
    """Base of models and results that a notebook shows as tables and a picture."""

    def _repr_html_(self) -> str:
        return html_page(self)


class Tabular(Rich, ABC):
    """Base of results in columns: aligned text, HTML in notebooks, and a frame of pandas."""

    @abstractmethod
    def columns(self) -> dict[str, list[Any]]:
        """Return the columns by name and unit."""

    def texts(self) -> list[list[str]]:
        """Return the names of the columns, and rows of texts; NaN is a dash."""
        columns = self.columns()
        rows = zip(*columns.values(), strict=True)
        return [[*columns], *([_cell(value) for value in row] for row in rows)]

    def __str__(self) -> str:
        return "\n".join(aligned(self.texts(), left=0))

    def frame(self) -> Any:
        """Return the table as a ``DataFrame`` of pandas, which is an optional package.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise ImportError(
                f"{type(self).__name__}.frame needs pandas, which is not installed; run "
                "pip install pandas, or use .columns(), a dictionary of lists"
            ) from None
        return pd.DataFrame(self.columns())


def _cell(value: Any) -> str:
    """Write a value of a table: numbers with four digits, NaN as a dash."""
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.4g}"
    return str(value)


# -- the parameter of a solution -----------------------------------------------------------------


class Parameter(NamedTuple):
    """Labels of the parameter of a solution, time or load factor, in pictures and messages."""

    name: str  # title of an axis or a colour bar
    value: str  # format of a value in a sentence
    step: str  # format of a step in a sentence, with three digits
    column: str  # title of a column
    progress: str  # title of an axis for a quantity that never decreases along the solution

    def at(self, value: float, digits: str = ".4g") -> str:
        """Write a value with its name or unit."""
        return self.value.format(format(value, digits))


TIME = Parameter("time t (s)", "t = {} s", "dt = {:.3g} s", "t [s]", "time t (s)")

FACTOR = Parameter(
    "load factor",
    "load factor {}",
    "a change of the load factor by {:.3g}",
    "load factor [-]",
    "path length (m)",
)
