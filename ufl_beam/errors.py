"""What can go wrong, and the checks of numbers that all records share."""

from __future__ import annotations

import math
from typing import Any


class SceneError(ValueError):
    """The scene or the call is wrong; raised before any mesh exists.

    The message says which object, what is wrong and what to do.
    """


class ModelWarning(UserWarning):
    """A scene or a call that is likely, but not surely, wrong.

    The message says which object it is about, what is unusual and what to do.  To silence one
    that is meant: ``warnings.filterwarnings("ignore", category=ub.ModelWarning)``; to make all of
    them errors: ``warnings.simplefilter("error", ub.ModelWarning)``.
    """


class StepFailed(Exception):
    """No equilibrium was found for a step; the message says why.

    Attributes:
        residuals: What is left where it is largest in each beam, body and connector; N, moments
            over the size of the scene.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.residuals: dict[str, float] = {}


class ConvergenceError(RuntimeError):
    """A step found no equilibrium, even after it was cut; nothing before it is lost.

    Attributes:
        time: Time of the last accepted state; s.
        dt: The smallest step that was tried; s.
        solution: The :class:`~ufl_beam.solution.Solution` up to ``time``; ``start=solution`` goes
            on from there with another step or scheme.
        residuals: What is left of the equilibrium where it is largest in each beam, body and
            connector, the largest first; N, moments over the size of the scene.  Empty if
            equilibria were found but refused.
        forces: Sizes of the forces that should be in equilibrium, by kind: "beams", "connectors",
            "loads", "inertia", "damping"; N.
    """

    def __init__(
        self,
        message: str,
        *,
        time: float,
        dt: float,
        solution: Any,
        residuals: dict[str, float],
        forces: dict[str, float],
    ) -> None:
        super().__init__(message)
        self.time = time
        self.dt = dt
        self.solution = solution
        self.residuals = residuals
        self.forces = forces


class TradeoffError(RuntimeError):
    """No setting can be recommended: the runs do not converge, or it would take too long.

    Attributes:
        runs: What was run, see :class:`~ufl_beam.ladders.Run`.
    """

    def __init__(self, message: str, runs: tuple[Any, ...] = ()) -> None:
        super().__init__(message)
        self.runs = runs


def require_number(
    value: float, what: str, *, positive: bool = False, at_least: float = -math.inf
) -> None:
    """Raise :class:`SceneError` naming ``what`` unless ``value`` is a finite number in range."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise SceneError(f"{what} = {value!r} is not a number") from None
    if not math.isfinite(number):
        raise SceneError(f"{what} = {number} is not finite")
    if positive and number <= 0:
        raise SceneError(f"{what} = {number:g} must be positive")
    if number < at_least:
        raise SceneError(f"{what} = {number:g} must be at least {at_least:g}")


def require_count(value: Any, what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless ``value`` is a whole number, at least 1."""
    require_number(value, what)
    if value != int(value) or value < 1:
        raise SceneError(f"{what} = {value} must be a whole number, at least 1")


def require_sequence(value: Any, what: str) -> tuple[Any, ...]:
    """``value`` as a tuple, or :class:`SceneError` naming ``what``."""
    try:
        return tuple(value)
    except TypeError:
        raise SceneError(f"{what} = {value!r} must be a list") from None


def require_kind(value: Any, kind: type | tuple[type, ...], what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless ``value`` is of a kind."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise SceneError(f"{what} = {value!r} is not a {' or '.join(k.__name__ for k in kinds)}")


def require_vector(value: Any, what: str) -> tuple[float, float]:
    """``value`` as a pair of finite floats, or :class:`SceneError` naming ``what``."""
    try:
        x, y = value
    except (TypeError, ValueError):
        raise SceneError(f"{what} = {value!r} must be a pair (x, y)") from None
    require_number(x, f"{what}[0]")
    require_number(y, f"{what}[1]")
    return float(x), float(y)
