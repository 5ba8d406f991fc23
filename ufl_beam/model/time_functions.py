# SPDX-License-Identifier: MIT
"""Functions of time that loads, supports and drives follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np

from ufl_beam.display import one_line
from ufl_beam.errors import (
    NoNumber,
    SceneError,
    closed,
    require_number,
    require_returned,
    require_sequence,
    shorten,
)

TimeFunction = Callable[[float], float]


def steady(t: float) -> float:
    """The time function of a load that is always there: 1."""
    return 1.0


@dataclass(frozen=True)
class Constant:
    """The time function that has always the same value."""

    value: float

    def __call__(self, t: float) -> float:
        """The value, at any time."""
        return self.value


def ramp(duration: float) -> TimeFunction:
    """Return the time function that grows from 0 to 1 within ``duration`` (s) and stays at 1.

    Example:
        >>> growth = ub.ramp(2.0)
        >>> growth(0.5), growth(2.0), growth(9.0)
        (0.25, 1.0, 1.0)
    """
    require_number(duration, "ramp: duration", positive=True)
    return Table((0.0, duration), (0.0, 1.0))


@closed("any function of t will do")
@dataclass(frozen=True)
class Table:
    """Time function by points, linear between them and constant outside.

    Args:
        times: Increasing times; s.
        values: Value at each time.

    Raises:
        SceneError: Different lengths, or times that do not increase.

    Example:
        >>> pulse = ub.Table([0, 0.1, 0.2], [0, 5, 0])
        >>> print(pulse(0.05), pulse(0.1), pulse(1.0))
        2.5 5.0 0.0
    """

    times: Sequence[float]
    values: Sequence[float]

    __repr__ = one_line

    def __post_init__(self) -> None:
        for name in ("times", "values"):
            numbers = require_sequence(getattr(self, name), f"Table: {name}")
            object.__setattr__(self, name, numbers)
            for i, number in enumerate(numbers):
                require_number(number, f"Table: {name}[{i}]")
        if len(self.times) != len(self.values) or len(self.times) < 1:
            raise SceneError(
                f"Table: {len(self.times)} times and {len(self.values)} values; "
                "give as many of each"
            )
        for i, (before, after) in enumerate(pairwise(self.times)):
            if after <= before:
                raise SceneError(
                    f"Table: times must increase, but times[{i}] = {before:g} is followed "
                    f"by {after:g}"
                )

    @property
    def kinks(self) -> Sequence[float]:
        """Times at which adaptive steps end: the function is smooth only between them; s."""
        return self.times

    def __call__(self, t: float) -> float:
        """Value at time ``t``."""
        return float(np.interp(t, self.times, self.values))


def require_time_function(function: TimeFunction, what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless ``function`` gives a number at t = 0."""
    if not callable(function):
        raise SceneError(f"{what} = {shorten(function)} must be a function of t, such as ub.Table")
    try:
        value = function(0.0)
    except Exception as error:
        raise SceneError(f"{what}: the time function fails at t = 0: {shorten(error)}") from error
    number = require_returned(value, f"{what}: the time function", "t = 0")
    if not math.isfinite(number):
        raise SceneError(f"{what}: the time function is {number} at t = 0")


Timed = Annotated[TimeFunction, require_time_function]
"""Field of a record with a time function."""


def value_at(function: TimeFunction, t: float, owner: object) -> float:
    """Evaluate a time function of a user.

    Raises:
        NoNumber: The value is not finite.
        SceneError: It is no number.
    """
    value = function(t)
    if type(value) is not float:
        value = require_returned(value, f"{owner}: the time function", f"t = {t:.9g} s")
    if not math.isfinite(value):
        raise NoNumber(f"{owner}: the time function is {value} at t = {t:.9g} s")
    return value
