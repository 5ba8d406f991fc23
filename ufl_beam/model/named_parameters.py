# SPDX-License-Identifier: MIT
"""Functions of a user whose parameters have known names: they take what they ask for."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple


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
