# SPDX-License-Identifier: MIT
"""Records whose annotations say which values their fields accept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cache, partial
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from ufl_beam.errors import require_kind, require_number, require_vector

T = TypeVar("T")

Number = Annotated[float, require_number]
Positive = Annotated[float, partial(require_number, positive=True)]
NotNegative = Annotated[float, partial(require_number, at_least=0.0)]
Vector = Annotated[tuple[float, float], require_vector]
Instance = Annotated[T, require_kind]
"""An object of a class, or of one of several."""


class Record:
    """Base of frozen dataclasses that check their fields by annotations ``Annotated[T, check]``.

    A check is called as ``check(value, what=name)`` with a value that is not the default; what it
    returns takes the place of the value, unless it is None.
    """

    def __post_init__(self) -> None:
        for name, default, check in _checks(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if value is not default:
                kept = check(value, what=f"{self._label()}: {name}")
                object.__setattr__(self, name, value if kept is None else kept)

    def _label(self) -> str:
        """Name of the record in messages."""
        return type(self).__name__


@cache
def _checks(record: type[Any]) -> list[tuple[str, object, Callable[..., object]]]:
    """Name, default and check of each field that has a check."""
    found = []
    hints = get_type_hints(record, include_extras=True)
    for field in fields(record):
        if get_origin(hint := hints[field.name]) is Annotated:
            kind, check = hint.__origin__, hint.__metadata__[0]
            if check is require_kind:
                kinds = tuple(k for k in get_args(kind) if k is not type(None))
                check = partial(require_kind, kind=kinds or kind)
            found.append((field.name, field.default, check))
    return found
