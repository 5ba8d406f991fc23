# SPDX-License-Identifier: MIT
"""Errors and warnings of the package, and checks of arguments for all records."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any, NoReturn, TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T")

LONGEST = 80  # largest number of characters of a value in a message

BYTES_PER_CELL = 400
"""Lower bound of the memory per cell on each process, for vertices and dof indices; bytes."""

RAM = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
"""Memory of this machine; bytes."""

PACKAGE = os.path.join(os.path.dirname(__file__), "")
"""The directory of this package."""


class ArgumentError(ValueError):
    """Wrong argument of a call, wrong result of a user's function, or unusable file.

    The message names the object and the error, and where possible a remedy.

    Example:
        >>> ub.Newton(rtol=-1.0)
        Traceback (most recent call last):
        ufl_beam.errors.ArgumentError: Newton: rtol = -1 must be positive
    """


class ArgumentTypeError(ArgumentError, TypeError):
    """Argument of a wrong type.

    Example:
        >>> ub.Newton(rtol="small")
        Traceback (most recent call last):
        ufl_beam.errors.ArgumentTypeError: Newton: rtol = 'small' is not a number
    """


class ModelError(ArgumentError):
    """Error in a model: an object is wrong, or objects do not fit together.

    Example:
        >>> ub.Scene([beam], supports=[ub.Clamped(beam.start), ub.Pinned(beam.start)])
        Traceback (most recent call last):
        ufl_beam.errors.ModelError: supports in conflict: Clamped at beam.start (0, 0) and ...
    """


class ModelWarning(UserWarning):
    """Warning about a scene or a call that is probably a mistake.

    The message names the object, the problem and a remedy.  To silence these warnings:
    ``warnings.filterwarnings("ignore", category=ub.ModelWarning)``; to make them errors:
    ``warnings.simplefilter("error", ub.ModelWarning)``.

    Example:
        >>> import warnings
        >>> with warnings.catch_warnings():
        ...     warnings.simplefilter("error", ub.ModelWarning)
        ...     ub.Beam((0, 0), (0.05, 0), section, name="stub")
        Traceback (most recent call last):
        ufl_beam.errors.ModelWarning: stub: its section is 0.2 m deep ...
    """


class StepFailed(Exception):
    """Failure of a step; ``residuals`` and ``reason`` are as in :class:`ConvergenceError`."""

    def __init__(self, message: str, residuals: dict[str, float] | None = None) -> None:
        super().__init__(message)
        self.residuals = residuals or {}
        self.reason = ""


class NoNumber(StepFailed, ModelError):
    """Error of a function of the scene without a finite value; a shorter step may avoid it."""


class Reversal(StepFailed):
    """Reversal of the quantity that a path control increases in every step."""

    def __init__(self, quantity: str) -> None:
        super().__init__(
            f"{quantity} turns back, where this control cannot follow; use ArcLength, or "
            "DissipationControl if hinges, cells or springs soften"
        )


class ConvergenceError(RuntimeError):
    """Failure to find equilibrium in a step, even in substeps; ``solution`` has the results so far.

    Attributes:
        time: Time of the last accepted state, s; in path following, its load factor.
        dt: Smallest substep that was tried, s; in path following, the change of the load factor.
        solution: The :class:`~ufl_beam.simulation.solution.Solution` up to ``time``;
            ``start=solution`` continues from this time with another step or scheme.
        residuals: Largest residual in each beam, body and connector, in descending order; N.
            Moments are divided by the size of the scene.  Empty if an equilibrium was rejected.
        forces: Magnitudes of the forces by kind: "beams", "connectors", "loads", "inertia",
            "damping"; N.
        reason: PETSc's name of the reason, such as "DIVERGED_MAX_IT"; empty if an equilibrium was
            found but rejected.

    Example:
        >>> pull = ub.PointLoad(weak.end, force=(0, -5e4), amplitude=lambda t: t)
        >>> pulled = ub.Scene([weak], supports=[ub.Clamped(weak.start)], loads=[pull])
        >>> try:
        ...     run = ub.simulate(pulled, ub.Static(), t=(0, 1), dt=0.1)
        ... except ub.ConvergenceError as error:
        ...     print(f"limit load: {5e4 * error.solution.times[-1]:.0f} N")
        limit load: 25000 N
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
        reason: str = "",
    ) -> None:
        super().__init__(message)
        self.time = time
        self.dt = dt
        self.solution = solution
        self.residuals = residuals
        self.forces = forces
        self.reason = reason


class ProcessesDiffer(RuntimeError):
    """Error of redundant computations of a small scene: motions differ, or one process failed.

    Example:
        >>> try:
        ...     run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
        ... except ub.ProcessesDiffer as error:
        ...     print("Does a function of the scene depend on the rank?", error)
    """


class TradeoffError(RuntimeError):
    """Error of :func:`tradeoff`: the runs do not converge, or would take too long.

    Attributes:
        runs: All runs so far, as in :attr:`Tradeoff.runs`.

    Example:
        >>> tip = {"tip": lambda run: run.position(beam.end)[-1]}
        >>> wanted = {"scheme": ub.Static(), "t": (0, 1), "dt": 0.5, "tolerance": 1e-3}
        >>> try:
        ...     ub.tradeoff(scene, tip, **wanted, max_seconds=1e-3)
        ... except ub.TradeoffError as error:
        ...     print("max_seconds" in str(error))
        True
    """

    def __init__(self, message: str, runs: tuple[Any, ...] = ()) -> None:
        super().__init__(message)
        self.runs = runs


_told: ContextVar[set[str] | None] = ContextVar("_told", default=None)


@contextlib.contextmanager
def each_warning_once(*, anew: bool = False) -> Iterator[None]:
    """Issue equal warnings once: in the context, or in the outermost of contexts unless ``anew``.

    Also a decorator of an analysis, which may begin several runs of a scene.
    """
    before = None if anew else _told.get()
    token = _told.set(set() if before is None else before)
    try:
        yield
    finally:
        _told.reset(token)


def warn(message: str) -> None:
    """Issue a :class:`ModelWarning` that points to the line of the user's script."""
    if (told := _told.get()) is not None:
        if message in told:
            return
        told.add(message)
    level, frame = 1, sys._getframe()
    # Methods generated by ``dataclass`` are in <string>, wrappers of decorators in contextlib.
    library = (PACKAGE, "<string>", contextlib.__file__)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(library):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, ModelWarning, stacklevel=level)


@contextlib.contextmanager
def calling(what: str, remedy: str = "") -> Iterator[None]:
    """Turn errors in the context into :class:`ModelError` with ``what`` and the user's line."""
    try:
        with np.errstate(all="ignore"):
            yield
    except Exception as error:
        library = PACKAGE, functools.__file__  # functools calls law_functions
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if not frame.filename.startswith(library)]
        at = f" ({own[0].filename}, line {own[0].lineno})" if own else ""
        raise ModelError(f"{what}: {error}{at}{remedy}") from error


def shorten(value: object) -> str:
    """Format a value for a message as its ``repr`` in one line of at most :data:`LONGEST`."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # by a user's class, or an integer with too many digits
        text = f"<{type(value).__name__}>"
    return clip(text)


def clip(text: str) -> str:
    """Shorten a text in the middle to :data:`LONGEST` characters."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 20]} ... {text[-15:]}"


def as_float(value: object) -> float:
    """Convert a real number, also of NumPy, to ``float``; refuse text and arrays."""
    if isinstance(value, float | int):
        return float(value)
    scalar: Any = value
    if getattr(scalar, "ndim", None) == 0:
        scalar = scalar.item()
    if hasattr(scalar, "__len__"):
        raise TypeError("not a number")
    return float(scalar)


def require_number(
    value: Any,
    what: str,
    *,
    positive: bool = False,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    infinite: bool = False,
) -> float:
    """Return ``value`` as a float in range, or raise :class:`ArgumentError` naming ``what``.

    The value must be finite; with ``infinite`` it may also be positive infinity.
    """
    try:
        number = as_float(value)
    except (TypeError, ValueError):
        raise ArgumentTypeError(f"{what} = {shorten(value)} is not a number") from None
    except OverflowError:
        raise ArgumentError(f"{what} = {shorten(value)} is too large for a number") from None
    if not math.isfinite(number) and not (infinite and number == math.inf):
        raise ArgumentError(f"{what} = {number} is not finite")
    if positive and number <= 0:
        raise ArgumentError(f"{what} = {number:g} must be positive")
    if number < at_least:
        raise ArgumentError(f"{what} = {number:g} must be at least {at_least:g}")
    if number > at_most:
        raise ArgumentError(f"{what} = {number:g} must lie between {at_least:g} and {at_most:g}")
    return number


def require_returned(value: object, function: str, at: str, *, finite: bool = False) -> float:
    """Return the value of a user's function as a float; it must be finite if ``finite``."""
    try:
        number = as_float(value)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(
            f"{function} returned {shorten(value)} at {at}; it must return a number"
        ) from None
    if finite and not math.isfinite(number):
        raise ArgumentError(f"{function} returned {number} at {at}; it must return a finite number")
    return number


def require_count(value: Any, what: str, at_least: int = 1) -> int:
    """Return ``value`` as an integer >= ``at_least``, or raise :class:`ArgumentError`."""
    number = require_number(value, what)
    if number != int(number) or number < at_least or isinstance(value, bool):
        raise ArgumentError(
            f"{what} = {shorten(value)} must be a whole number, at least {at_least}"
        )
    return int(value)


def require_sequence(value: Any, what: str) -> tuple[Any, ...]:
    """Return ``value`` as a tuple, or raise :class:`ArgumentError` naming ``what``."""
    if not isinstance(value, str | bytes):
        try:
            return tuple(value)
        except TypeError:
            pass
    raise ArgumentTypeError(f"{what} = {shorten(value)} must be a list")


def require_numbers(value: Any, what: str) -> tuple[Any, ...]:
    """Return ``value`` as a tuple of finite numbers, or raise :class:`ArgumentError`."""
    numbers = require_sequence(value, what)
    if {*map(type, numbers)} <= {float} and np.isfinite(numbers).all():
        return numbers  # a record of an earthquake has many
    for i, number in enumerate(numbers):
        require_number(number, f"{what}[{i}]")
    return numbers


def require_kind(value: Any, kind: type | tuple[type, ...], what: str) -> None:
    """Raise :class:`ArgumentError` naming ``what`` unless ``value`` is an instance of ``kind``."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        names = " or ".join(getattr(k, "called", k.__name__) for k in kinds)
        own = tuple(k for k in kinds if k.__module__.startswith("ufl_beam"))
        held = getattr(value, "__dict__", {})
        inside = [n for n, x in held.items() if isinstance(x, own) and not n.startswith("_")]
        hint = f"; give its attribute {inside[0]!r}" if len(inside) == 1 else ""
        raise ArgumentTypeError(f"{what} = {shorten(value)} is not a {names}{hint}")


def require_all(value: Any, what: str, kind: type | tuple[type, ...]) -> tuple[Any, ...]:
    """Return ``value`` as a tuple of instances of ``kind``, or raise :class:`ArgumentError`."""
    records = require_sequence(value, what)
    for i, record in enumerate(records):
        require_kind(record, kind, f"{what}[{i}]")
    return records


class Moved:
    """Attribute of a class that is elsewhere now; reading it raises :class:`AttributeError`."""

    def __init__(self, new: str) -> None:
        self._new = new

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"{owner.__name__}.{name}"

    def __get__(self, instance: object, owner: type | None = None) -> NoReturn:
        raise AttributeError(f"{self._name} is {self._new} now")


def closed(instead: str) -> Callable[[type[T]], type[T]]:
    """Forbid subclasses of a class of the model; ``instead`` is the advice to users.

    Computations use only the class itself and its fields, so methods and fields of a subclass would
    have no effect.
    """

    def close(kind: type[T]) -> type[T]:
        def refuse(cls: type, **_: object) -> None:
            raise ModelError(
                f"{cls.__name__}: {kind.__name__} has no subclasses, because computations would "
                f"ignore their methods and fields; {instead}"
            )

        kind.__init_subclass__ = classmethod(refuse)  # type: ignore[assignment, method-assign, arg-type]
        return kind

    return close


def require_text(value: Any, what: str) -> None:
    """Raise :class:`ArgumentError` naming ``what`` unless files can hold ``value`` as text."""
    if not isinstance(value, str):
        raise ArgumentTypeError(f"{what} = {shorten(value)} must be text")
    if any(c == "\0" or "\ud800" <= c <= "\udfff" for c in value):
        raise ArgumentError(
            f"{what} = {shorten(value)} has a character that files cannot have, a null or a "
            "surrogate; leave it out"
        )


def require_switch(value: Any, what: str) -> None:
    """Raise :class:`ArgumentError` naming ``what`` unless ``value`` is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise ArgumentTypeError(f"{what} = {shorten(value)} must be True or False")


def require_function(value: Any, what: str, arguments: str) -> None:
    """Raise :class:`ArgumentError` naming ``what`` unless ``value`` is a function."""
    if not callable(value):
        raise ArgumentTypeError(f"{what} = {shorten(value)} must be a function of {arguments}")


def require_capacity(cells: int, what: str) -> None:
    """Raise :class:`ArgumentError` naming ``what`` if cells exceed the memory or the indices.

    Each process stores the numbering of the whole scene, with indices of 32 bits.
    """
    needed = cells * BYTES_PER_CELL
    if needed > RAM:
        raise ArgumentError(
            f"{what} would take {needed / 1e9:.3g} GB of memory; this machine has "
            f"{RAM / 1e9:.3g} GB. Take fewer cells"
        )
    if 3 * cells >= 2**31:
        raise ArgumentError(
            f"{what} has more degrees of freedom than the 32-bit indices of PETSc can number. "
            "Take fewer cells"
        )


def require_point(value: Any, what: str, most: int = 3) -> tuple[float, ...]:
    """Return ``value`` as two or three finite floats, or raise :class:`ArgumentError`."""
    try:
        numbers = () if isinstance(value, str | bytes) else tuple(value)
    except TypeError:
        numbers = ()
    if not 2 <= len(numbers) <= most:
        raise ArgumentTypeError(f"{what} = {shorten(value)} must be a pair (x, y)")
    return tuple(require_number(x, f"{what}[{i}]") for i, x in enumerate(numbers))


def require_vector(value: Any, what: str) -> tuple[float, float]:
    """Return ``value`` as a pair of finite floats, or raise :class:`ArgumentError`."""
    x, y = require_point(value, what, most=2)
    return x, y


def require_array(values: Any, what: str) -> npt.NDArray[np.float64]:
    """Return ``values`` as an array of finite numbers, or raise :class:`ArgumentError`."""
    try:
        array = np.asarray(values)
        objects = array.flat if array.dtype.kind == "O" else ()
        if array.dtype.kind not in "buifO" or any(
            value is None or isinstance(value, str | bytes) for value in objects
        ):
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentTypeError(f"{what} = {shorten(values)} must be numbers") from None
    for i in np.argwhere(~np.isfinite(array)):
        at = ", ".join(map(str, i))
        raise ArgumentError(f"{what}{f'[{at}]' if at else ''} = {array[tuple(i)]} is not finite")
    return array


def require_row(values: Any, what: str) -> npt.NDArray[np.float64]:
    """Return ``values`` as finite numbers of shape (n,), or raise :class:`ArgumentError`."""
    row = require_array(values, what)
    if row.ndim != 1:
        raise ArgumentError(f"{what} has shape {row.shape}; give one row of numbers")
    return row
