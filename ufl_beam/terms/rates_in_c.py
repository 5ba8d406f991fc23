# SPDX-License-Identifier: MIT
"""Velocities, and what else a scheme keeps, as C has them.

A scheme states the coefficients of a step, once for each length of a step.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.compiled.csr import StepProduct
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.time_schemes import Coefficients, DynamicScheme, combined

CHANGE, V, V_BEFORE, MORE = range(4)
"""Places of the rates in C: the step or a change of velocities, velocities, ..."""


class RatesInC:
    """Velocities of a scene, those before the last step, and what else a scheme keeps; all in C.

    They satisfy :class:`Rates`; arrays are copies.

    Attributes:
        c: ``rates`` of loops.h.
        slips: True if the scheme loses energy by the rates.

    Raises:
        SceneError: The scheme states no such coefficients as :class:`Coefficients` describes.
    """

    def __init__(self, scheme: DynamicScheme, v: Array) -> None:
        size, number = len(v), MORE + len(scheme.kept)
        self.slips = checked_coefficients(scheme).slip is not None
        self._scheme = scheme
        # Changes are elsewhere; of velocities before the last ones new ones are not computed, and
        # new velocities take their place where nothing asks for them.
        asks = self.slips or scheme.looks_back
        self._now = np.zeros((number - V, size))
        self._next = np.zeros((number - V_BEFORE - (not asks), size))
        self._slip = np.zeros(size if self.slips else 0)
        self._handle = ffi.new_handle(self)
        self.c = fill(ffi.new("rates *"), size=size, number=number, find=lib.numbers_in_python)
        self.c.handle = self._handle  # what `fill` keeps must not keep this object
        self.c.after_any = not scheme.looks_back
        first, *more = self._next if asks else (self._now[1], *self._next)
        for k, (rate, new) in enumerate(
            zip(self._now, (first, self._slip, *more), strict=True), start=V
        ):
            self.c.rate[k], self.c.new_rate[k] = doubles(rate), doubles(new)
        self.take(v, v, math.inf)
        self.keep()

    def _rate(self, k: int) -> Array:
        """A rate as C has it; a view."""
        return np.frombuffer(ffi.buffer(self.c.rate[k], 8 * self.c.size))

    @property
    def v(self) -> Array:
        """Velocities of the accepted state."""
        return self._rate(V).copy()

    @property
    def v_before(self) -> Array:
        """Velocities before the last step."""
        return self._rate(V_BEFORE).copy()

    @property
    def more(self) -> tuple[Array, ...]:
        """Rates that the scheme keeps besides, as many as are known."""
        return tuple(self._rate(MORE + k).copy() for k in range(self.c.more))

    def keep(self, *more: Array) -> None:
        """Set what else the scheme keeps; a step can begin if that is anything."""
        for k, rate in enumerate(more):
            self._rate(MORE + k)[:] = rate
        self.c.more, self.c.ready = len(more), bool(more) or not self._scheme.kept

    @property
    def last_dt(self) -> float:
        """Length of the last step, infinite before the first; s."""
        return float(self.c.last_dt)

    def take(self, v: Array, v_before: Array, last_dt: float) -> None:
        """Set velocities, those before the last step, and its length."""
        self._rate(V)[:], self._rate(V_BEFORE)[:], self.c.last_dt = v, v_before, last_dt

    def find(self, numbers: Any) -> None:
        """Write the numbers of the steps that ``scheme_numbers`` of loops.h is about."""
        known: Any = self._scheme
        of = _coefficients(known, numbers.dt, numbers.last_dt, numbers.more)
        none = [0.0] * MORE
        rows = of.inertia, of.velocity, of.slip or none, *of.rates
        places = numbers.inertia, numbers.velocity, numbers.slip, *numbers.rates
        for place, row in zip(places, rows, strict=False):
            place[0 : self.c.number] = [*row, *[0.0] * (self.c.number - len(row))]
        numbers.gives = len(of.rates) - 1

    def after(self, s: Array, dt: float) -> list[Array]:
        """Velocities after a step ``s`` of the nodes, and what the scheme keeps besides."""
        known: Any = self._scheme
        rows = _coefficients(known, dt, self.last_dt, self.c.more).rates
        return [combined(row, s, self) for row in rows]

    def times(self, product: StepProduct, **entries: Any) -> Any:
        """Return ``matrix_of_rates`` of loops.h for a matrix, with entries of the ledger."""
        v, momentum = np.zeros(self.c.size), np.zeros(len(self._slip))
        of = struct("matrix_of_rates", product=product.c, v=v, momentum=momentum, **entries)
        return fill(of, rates=self.c)


@lru_cache(maxsize=1024)  # steps of one size have some ten lengths, as times are rounded
def _coefficients(scheme: Any, dt: float, last_dt: float, known: int) -> Coefficients:
    """Coefficients of a step, as lists of numbers."""
    found = scheme.coefficients(dt, last_dt, known)
    inertia, velocity, *rates = (list(map(float, row)) for row in (*found[:2], *found.rates))
    slip = None if found.slip is None else list(map(float, found.slip))
    return Coefficients(inertia, velocity, rates, slip)


def checked_coefficients(scheme: DynamicScheme) -> Coefficients:
    """Return coefficients of steps of 1 s, and refuse rows of another length.

    Raises:
        SceneError: They are not as :class:`Coefficients` says.
    """
    known: Any = scheme
    number = len(scheme.kept)
    try:
        found = _coefficients(known, 1.0, 1.0, number)
        rows = found.inertia, found.velocity, *found.rates, *([found.slip] if found.slip else [])
        right = len(found.rates) == 1 + number and {len(row) for row in rows} == {MORE + number}
        right = right and bool(np.isfinite(rows).all()) and found.rates[0][0] != 0.0
    except (TypeError, ValueError, AttributeError):
        right = False
    if not right or MORE + number > lib.MOST_RATES:
        raise SceneError(
            f"{scheme!r}: coefficients(dt, last_dt, known) must return Coefficients with rows of "
            f"3 + known numbers, {1 + number} of them in rates, see docs/extending.md"
        )
    return found


@ffi.def_extern(error=0)  # type: ignore[misc, untyped-decorator, unused-ignore]
def numbers_in_python(handle: Any, numbers: Any) -> int:
    """Callback of C, declared in c_library.py."""
    ffi.from_handle(handle).find(numbers)
    return 1
