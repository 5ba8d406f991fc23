# SPDX-License-Identifier: MIT
"""Checks of arguments that raise :class:`ModelError`."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from ufl_beam import errors
from ufl_beam.errors import ArgumentError, ModelError

P = ParamSpec("P")
T = TypeVar("T")


def of_model(check: Callable[P, T]) -> Callable[P, T]:
    """Make a check raise :class:`ModelError`."""

    @wraps(check)
    def checked(*arguments: P.args, **named: P.kwargs) -> T:
        try:
            return check(*arguments, **named)
        except ArgumentError as error:
            raise ModelError(str(error)) from None

    return checked


require_all = of_model(errors.require_all)
require_array = of_model(errors.require_array)
require_count = of_model(errors.require_count)
require_function = of_model(errors.require_function)
require_kind = of_model(errors.require_kind)
require_memory = of_model(errors.require_memory)
require_number = of_model(errors.require_number)
require_returned = of_model(errors.require_returned)
require_row = of_model(errors.require_row)
require_sequence = of_model(errors.require_sequence)
require_switch = of_model(errors.require_switch)
require_text = of_model(errors.require_text)
require_vector = of_model(errors.require_vector)
