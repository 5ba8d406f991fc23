# SPDX-License-Identifier: MIT
"""Loads, and how they vary in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ufl_beam.errors import (
    SceneError,
    require_number,
    require_returned,
    require_sequence,
    require_vector,
    shorten,
)
from ufl_beam.model.beams import Beam
from ufl_beam.model.bodies import Anchor, carries, require_anchor

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
    """The time function that grows linearly from 0 to 1 within ``duration`` (s) and stays."""
    require_number(duration, "ramp: duration", positive=True)
    return Table((0.0, duration), (0.0, 1.0))


@dataclass(frozen=True)
class Table:
    """A time function through points, linear between them and constant outside.

    Args:
        times: Increasing times; s.
        values: Value at each time.

    Raises:
        SceneError: Different lengths, or times that do not increase.
    """

    times: Sequence[float]
    values: Sequence[float]

    def __post_init__(self) -> None:
        for name in ("times", "values"):
            object.__setattr__(self, name, require_sequence(getattr(self, name), f"Table: {name}"))
        if len(self.times) != len(self.values) or len(self.times) < 1:
            raise SceneError(
                f"Table: {len(self.times)} times and {len(self.values)} values; "
                "give as many of each"
            )
        for kind, numbers in (("times", self.times), ("values", self.values)):
            for i, number in enumerate(numbers):
                require_number(number, f"Table: {kind}[{i}]")
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
        raise SceneError(
            f"{what}: time = {shorten(function)} must be a function of t, such as ub.Table"
        )
    try:
        value = function(0.0)
    except Exception as error:
        raise SceneError(f"{what}: the time function fails at t = 0: {shorten(error)}") from error
    number = require_returned(value, f"{what}: the time function", "t = 0")
    if not math.isfinite(number):
        raise SceneError(f"{what}: the time function is {number} at t = 0")


def value_at(function: TimeFunction, t: float, owner: object) -> float:
    """Evaluate a time function of a user.

    Raises:
        SceneError: It returns no number; the message names ``owner``.
    """
    value = function(t)
    if type(value) is float:
        return value
    return require_returned(value, f"{owner}: the time function", f"t = {t:.9g} s")


@dataclass(frozen=True, eq=False)
class PointLoad:
    """Dead force and moment at a place: they keep their direction in the plane.

    Args:
        place: Where.
        force: (F_x, F_y); N.
        moment: Counter-clockwise; N m.
        time: Factor at time t.
    """

    place: Anchor
    force: tuple[float, float] = (0.0, 0.0)
    moment: float = 0.0
    time: TimeFunction = steady

    def __post_init__(self) -> None:
        _check_point_load(self, "PointLoad")

    def __str__(self) -> str:
        return f"PointLoad at {self.place}"


@dataclass(frozen=True, eq=False)
class FollowerLoad:
    """Force at a place that turns with the cross-section; not conservative.

    Args:
        place: Where.
        force: (F_x, F_y) before any rotation; N.
        moment: Counter-clockwise; N m.
        time: Factor at time t.
    """

    place: Anchor
    force: tuple[float, float] = (0.0, 0.0)
    moment: float = 0.0
    time: TimeFunction = steady

    def __post_init__(self) -> None:
        _check_point_load(self, "FollowerLoad")
        if not carries(self.place):
            raise SceneError(
                f"FollowerLoad at {self.place}: not the centre of the body; act on the centre, "
                "with the moment that this makes"
            )

    def __str__(self) -> str:
        return f"FollowerLoad at {self.place}"


def _check_point_load(load: PointLoad | FollowerLoad, kind: str) -> None:
    require_anchor(load.place, kind)
    require_vector(load.force, f"{kind} at {load.place}: force")
    require_number(load.moment, f"{kind} at {load.place}: moment")
    require_time_function(load.time, f"{kind} at {load.place}")


@dataclass(frozen=True, eq=False)
class LineLoad:
    """Dead force and moment along a whole beam, per undeformed length.

    Args:
        beam: Where.
        force: (f_x, f_y); N/m.
        moment: Counter-clockwise; N m/m.
        time: Factor at time t.
    """

    beam: Beam
    force: tuple[float, float] = (0.0, 0.0)
    moment: float = 0.0
    time: TimeFunction = steady

    def __post_init__(self) -> None:
        if not isinstance(self.beam, Beam):
            raise SceneError(f"LineLoad: {self.beam!r} is not a Beam")
        require_vector(self.force, f"LineLoad on {self.beam.name}: force")
        require_number(self.moment, f"LineLoad on {self.beam.name}: moment")
        require_time_function(self.time, f"LineLoad on {self.beam.name}")

    def __str__(self) -> str:
        return f"LineLoad on {self.beam.name}"


@dataclass(frozen=True, eq=False)
class Gravity:
    """Weight of all beams, bodies and point masses.

    Args:
        acceleration: (g_x, g_y); m/s².
        time: Factor at time t.
    """

    acceleration: tuple[float, float] = (0.0, -9.81)
    time: TimeFunction = steady

    def __post_init__(self) -> None:
        require_vector(self.acceleration, "Gravity: acceleration")
        require_time_function(self.time, "Gravity")

    def __str__(self) -> str:
        return "Gravity"


@dataclass(frozen=True, eq=False)
class RotatingFrame:
    """Centrifugal and Coriolis forces on all that has mass: the scene turns steadily as a whole.

    Motions, velocities and all other loads are those that somebody sees who turns with the frame.
    In statics it gives the steady rotation, with all that it stretches and bends.

    Args:
        rate: Angular velocity of the frame, counter-clockwise; rad/s.
        about: The point that stays in place; m.
    """

    rate: float
    about: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        require_number(self.rate, "RotatingFrame: rate")
        require_vector(self.about, "RotatingFrame: about")

    @property
    def time(self) -> TimeFunction:
        """The rate does not change: that would make other forces."""
        return steady


Load = PointLoad | FollowerLoad | LineLoad | Gravity | RotatingFrame
