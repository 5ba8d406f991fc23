# SPDX-License-Identifier: MIT
"""Signatures of what users write: parameters of functions by name, members of objects."""

from __future__ import annotations

import inspect
from abc import ABC
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Generic, NamedTuple, Protocol
from weakref import WeakKeyDictionary

from ufl_beam.errors import SceneError

NO_MEMBERS = {object, ABC, Protocol, Generic}


class Named(NamedTuple):
    """Parameters of a function: names with a meaning; others, without which it cannot be called."""

    asked: tuple[str, ...]
    unknown: tuple[str, ...]


def parameters_by_name(
    function: Callable[..., Any], known: Sequence[str], after: int = 0
) -> Named | None:
    """Return the names by which a function asks, after so many parameters by position.

    A function with ``**more`` asks for all that is known; None if the function does not tell.
    """
    try:
        parameters = [*inspect.signature(function).parameters.values()]
    except (TypeError, ValueError):
        return None
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return Named(tuple(known), ())
    named = [p for p in parameters[after:] if p.kind is not p.VAR_POSITIONAL]
    return Named(
        tuple(p.name for p in named if p.name in known),
        tuple(p.name for p in named if p.name not in known and p.default is p.empty),
    )


_calls_match: WeakKeyDictionary[type, set[type]] = WeakKeyDictionary()
"""Protocols that objects of a class were found to satisfy; signatures take a millisecond."""


@lru_cache(maxsize=32)
def members(of: type) -> dict[str, Callable[..., Any] | None]:
    """Public methods, by name, of a protocol or an abstract class; attributes are None."""
    found: dict[str, Callable[..., Any] | None] = {}
    for base in reversed(of.__mro__):
        if base in NO_MEMBERS:
            continue
        names = dict.fromkeys(inspect.get_annotations(base)) | vars(base)
        found |= {
            name: thing if inspect.isfunction(thing) else None
            for name, thing in names.items()
            if not name.startswith("_")
        }
    return found


def require_members(value: object, of: type, what: str, kind: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless an object has the members of a protocol.

    Methods must take the arguments that the protocol calls them with.  ``kind`` is what the object
    should be, such as "a time scheme".
    """
    name = type(value).__name__
    if missing := [name for name in members(of) if not hasattr(value, name)]:
        raise SceneError(f"{what}: {name} is not {kind}: it lacks {', '.join(missing)}")
    known = _calls_match.setdefault(type(value), set())
    if of in known:
        return
    for method, expected in members(of).items():
        if expected is not None and not _takes(getattr(value, method), expected):
            there = list(inspect.signature(expected).parameters)[1:]
            raise SceneError(
                f"{what}: {name} is not {kind}: its method {method} cannot be called as "
                f"{method}({', '.join(there)})"
            )
    known.add(of)


def _takes(method: Any, expected: Callable[..., Any]) -> bool:
    """Return whether a bound method takes the arguments of a function but its first."""
    try:
        signature = inspect.signature(method)
    except ValueError:  # of a builtin
        return True
    except TypeError:  # not callable
        return False
    _, *parameters = inspect.signature(expected).parameters.values()
    by_name = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
    try:
        signature.bind(*(len(parameters) - len(by_name)) * [None], **dict.fromkeys(by_name))
    except TypeError:
        return False
    return True
