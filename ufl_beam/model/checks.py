# SPDX-License-Identifier: MIT
"""Checks of arguments; each check raises :class:`ModelError` for a wrong argument."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from ufl_beam import errors
from ufl_beam.errors import ArgumentError, ModelError

P = ParamSpec("P")
T = TypeVar("T")


def raising_model_errors(check: Callable[P, T]) -> Callable[P, T]:
    """Return a check that raises :class:`ModelError` instead of :class:`ArgumentError`."""

    @wraps(check)
    def checked(*arguments: P.args, **named: P.kwargs) -> T:
        try:
            return check(*arguments, **named)
        except ArgumentError as error:
            raise ModelError(str(error)) from None

    return checked


require_all = raising_model_errors(errors.require_all)
require_array = raising_model_errors(errors.require_array)
require_count = raising_model_errors(errors.require_count)
require_function = raising_model_errors(errors.require_function)
require_kind = raising_model_errors(errors.require_kind)
require_capacity = raising_model_errors(errors.require_capacity)
require_point = raising_model_errors(errors.require_point)
require_number = raising_model_errors(errors.require_number)
require_numbers = raising_model_errors(errors.require_numbers)
require_returned = raising_model_errors(errors.require_returned)
require_row = raising_model_errors(errors.require_row)
require_sequence = raising_model_errors(errors.require_sequence)
require_switch = raising_model_errors(errors.require_switch)
require_text = raising_model_errors(errors.require_text)
require_vector = raising_model_errors(errors.require_vector)
