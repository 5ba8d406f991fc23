# SPDX-License-Identifier: MIT
"""Base of dataclasses that check their fields; signatures of users' functions and objects."""

from __future__ import annotations

import inspect
from abc import ABC
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from functools import cache, lru_cache, partial
from typing import (
    Annotated,
    Any,
    ClassVar,
    Generic,
    Protocol,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)
from weakref import WeakKeyDictionary

import numpy as np

from ufl_beam.display import compact_repr
from ufl_beam.errors import (
    ArgumentError,
    ArgumentTypeError,
    ModelError,
    require_kind,
    require_number,
    require_point,
    require_switch,
    require_text,
    require_vector,
)

T = TypeVar("T")
TimeFunction = Callable[[float], float]

Number = Annotated[float, require_number]
Positive = Annotated[float, partial(require_number, positive=True)]
NotNegative = Annotated[float, partial(require_number, at_least=0.0)]
PositiveOrNone = Annotated[float | None, partial(require_number, positive=True)]
FromZero = Annotated[float, partial(require_number, at_least=0.0, infinite=True)]
"""Type of a field with a number that is not negative, or infinity."""

Vector = Annotated[tuple[float, float], require_vector]
VectorOfScene = Annotated[Any, require_point]
"""Type of a field with two numbers, or three in space."""

Text = Annotated[str, require_text]
Switch = Annotated[bool, require_switch]
Instance = Annotated[T, require_kind]
"""Type of a field with an object of the annotated class, or of one of several classes."""


def require_moment(value: Any, what: str) -> float | tuple[float, ...]:
    """Return a moment or angular velocity: a number, or three numbers in space."""
    if np.ndim(value) == 0:
        return require_number(value, what)
    if len(value) != 3:
        raise ArgumentError(f"{what} = {value} must be a number, or three numbers in space")
    return require_point(value, what)


NAMING = ("name", "place", "beam", "a", "b", "rail", "slider")
"""Fields used in the name of a record; errors in these fields name only the class."""

RENAMED = {
    "time": "amplitude", "limit": "yield_limit", "energy": "fracture_energy",
    "measured": "multipliers",
}  # fmt: skip
"""Present names of arguments, by former names."""


@cache
def _keywords(record: type[Any]) -> tuple[str, ...]:
    """Return the names of the arguments of a record; none if it takes any."""
    _, *arguments = inspect.signature(record.__init__).parameters.values()
    takes_any = any(x.kind is x.VAR_KEYWORD for x in arguments)
    return () if takes_any else tuple(x.name for x in arguments)


class Record:
    """Base of frozen dataclasses that check their fields by annotations ``Annotated[T, check]``.

    ``check(value, what="Record: name")`` checks values other than the default.  ``name`` is the
    name of the field, or the text that follows the check in the annotation.  The result of the
    check replaces the value, unless the result is None.
    """

    _refused: ClassVar[type[ArgumentError]] = ModelError
    """Class of the error for a wrong field; ArgumentError in records outside a model."""

    def __new__(cls, *_: Any, **named: Any) -> Any:
        """Raise :class:`ArgumentError` for unknown keywords, before ``__init__``."""
        if cls.__init__ is object.__init__:
            raise TypeError(f"{cls.__name__} is a base class; use a class derived from it")
        known = _keywords(cls)  # type: ignore[arg-type]
        for name in named if known else ():
            if name not in known:
                new = RENAMED.get(name, "")
                remedy = f"give {new}=" if new in known else f"the arguments are {', '.join(known)}"
                raise ArgumentTypeError(f"{cls.__name__} has no argument {name!r}; {remedy}")
        return super().__new__(cls)

    def __repr__(self) -> str:
        return compact_repr(self)  # for dataclasses with ``repr=False``

    def __post_init__(self) -> None:
        for name, word, default, check in _checks(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if value is not default:
                try:
                    checked = check(value, what=word)
                except ArgumentError as error:  # its message begins with the word
                    owner = type(self).__name__ if name in NAMING else self._label()
                    kind = type(error) if isinstance(error, self._refused) else self._refused
                    raise kind(f"{owner}: {error}") from error.__cause__
                object.__setattr__(self, name, value if checked is None else checked)

    def _label(self) -> str:
        """Return the name of the record in messages: its text, or its class if it has none."""
        return type(self).__name__ if type(self).__str__ is object.__str__ else str(self)

    def attached_to(self) -> Iterable[Any]:
        """Return the places to which the record is attached, by default its ``place``."""
        place = getattr(self, "place", None)
        return () if place is None else (place,)

    def functions_of_time(self) -> Iterable[TimeFunction]:
        """Return the functions of time of the record, by default its fields of this type."""
        return [getattr(self, name) for name in _timed(type(self))]  # type: ignore[arg-type]


@cache
def _timed(record: type[Any]) -> list[str]:
    """Return the names of the fields with a function of time."""
    return [n for n, kind in get_type_hints(record).items() if kind == TimeFunction]


@cache
def _checks(record: type[Any]) -> list[tuple[str, str, object, Callable[..., object]]]:
    """Return (name, name in messages, default, check) for each field with a check."""
    checks = []
    hints = get_type_hints(record, include_extras=True)
    for field in fields(record):
        if get_origin(hint := hints[field.name]) is Annotated:
            kind, (check, *word) = hint.__origin__, hint.__metadata__
            if check is require_kind:
                kinds = tuple(k for k in get_args(kind) if k is not type(None))
                check = partial(require_kind, kind=kinds or kind)
            checks.append((field.name, *(word or [field.name]), field.default, check))
    return checks


# -- signatures of users' functions and objects -------------------------------------------------


NO_MEMBERS = {object, ABC, Protocol, Generic}

_satisfied: WeakKeyDictionary[type, set[type]] = WeakKeyDictionary()
"""Protocols that each class satisfies; cached, because a check takes a millisecond."""


def parameters_by_name(
    function: Callable[..., Any], known: Sequence[str], what: str, after: int = 0, more: str = ""
) -> tuple[str, ...] | None:
    """Return the ``known`` names among the parameters after the first ``after`` parameters.

    The result is all known names for a function with ``**kwargs``, and None for a function without
    a signature.  ``more`` is appended to the message of the error.

    Raises:
        ModelError: The function has an unknown parameter without a default.
    """
    try:
        parameters = [*inspect.signature(function).parameters.values()]
    except (TypeError, ValueError):
        return None
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return tuple(known)
    named = [p for p in parameters[after:] if p.kind is not p.VAR_POSITIONAL]
    for p in named:
        if p.name not in known and p.default is p.empty:
            raise ModelError(
                f"{what} has a parameter {p.name!r}, which is unknown; the known ones are "
                f"{', '.join(known)}{more}"
            )
    return tuple(p.name for p in named if p.name in known)


@lru_cache(maxsize=32)
def members(protocol: type) -> dict[str, Callable[..., Any] | None]:
    """Return the members of a protocol or abstract class by name; None for attributes."""
    methods: dict[str, Callable[..., Any] | None] = {}
    for base in reversed([base for base in protocol.__mro__ if base not in NO_MEMBERS]):
        for name, thing in (dict.fromkeys(inspect.get_annotations(base)) | vars(base)).items():
            if not name.startswith("_"):
                methods[name] = thing if inspect.isfunction(thing) else None
    return methods


def unlike(value: object, protocol: type) -> str:
    """Return the reason why an object does not satisfy a protocol; empty if it does.

    Methods of the object must accept the arguments of the methods of the protocol.
    """
    if missing := [name for name in members(protocol) if not hasattr(value, name)]:
        return f"it lacks {', '.join(missing)}"
    known = _satisfied.setdefault(type(value), set())
    for name, expected in members(protocol).items():
        if expected is None or protocol in known:
            continue
        _, *parameters = inspect.signature(expected).parameters.values()
        by_name = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
        positions = (len(parameters) - len(by_name)) * [None]
        try:
            inspect.signature(getattr(value, name)).bind(*positions, **dict.fromkeys(by_name))
        except ValueError:
            pass  # a builtin has no signature
        except TypeError:  # also if the member is not callable
            call = ", ".join(p.name for p in parameters)
            return f"its method {name} cannot be called as {name}({call})"
    known.add(protocol)
    return ""
