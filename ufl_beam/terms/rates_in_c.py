# SPDX-License-Identifier: MIT
"""Velocities, and what else a scheme keeps, where C takes steps without Python.

A scheme states what becomes of them in Python.  All of that is a sum of multiples; the numbers are
found by asking the scheme what it makes of unit vectors, once for each length of a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Protocol

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.compiled.csr import StepProduct
from ufl_beam.mechanics.time_schemes import DynamicScheme, Rates

CHANGE, V, V_BEFORE, MORE = range(4)
"""Places of the rates in C: the step or a change of velocities, velocities, ..."""

SAME = 1e-12
"""Difference of two results of the same numbers, relative, that is nothing but round-off."""


@dataclass
class Asked:
    """Rates that a scheme is asked about."""

    v: Array
    v_before: Array
    more: tuple[Array, ...]
    last_dt: float


class Moving(Rates, Protocol):
    """Velocities of a scene in motion, and its scheme."""

    scheme: DynamicScheme

    @property
    def ready(self) -> bool:
        """True if a step can begin."""


class RatesInC:
    """The rates of a scene as C has them; attributes of ``moving`` are handed over and back.

    Attributes:
        c: ``rates`` of loops.h.
    """

    def __init__(self, moving: Moving) -> None:
        self._moving, self._scheme = moving, moving.scheme
        size, number = len(moving.v), MORE + len(self._scheme.kept)
        # Changes are elsewhere; of velocities before the last ones new ones are not computed, and
        # new velocities take their place where nothing asks for them.
        scheme: Any = self._scheme
        self._asks = self._scheme.slips or _asks_for_before(scheme)
        self._now = np.zeros((number - V, size))
        self._next = np.zeros((number - V_BEFORE - (not self._asks), size))
        self._slip = np.zeros(size if self._scheme.slips else 0)
        self._handle = ffi.new_handle(self)
        self.c = fill(ffi.new("rates *"), size=size, number=number, find=lib.numbers_in_python)
        self.c.handle = self._handle  # what `fill` keeps must not keep this object
        self.c.after_any = _after_any(scheme)

    @classmethod
    def of(cls, moving: Moving) -> RatesInC | None:
        """The rates, if the scheme makes sums of multiples of them."""
        if MORE + len(moving.scheme.kept) > lib.MOST_RATES:
            return None
        scheme: Any = moving.scheme
        return cls(moving) if _sums_of_multiples(scheme) else None

    def find(self, numbers: Any) -> None:
        """Write the numbers of the steps that ``scheme_numbers`` of loops.h is about."""
        n, known = self.c.number, numbers.more
        scheme: Any = self._scheme
        of = MORE + known, numbers.dt, numbers.last_dt
        ends, inertia, velocity, *rates, slip = _numbers(scheme, *of)
        numbers.factor, numbers.back, numbers.factor_of_velocity, numbers.back_of_velocity = ends
        zeros = [0.0] * (n - MORE - known)
        for place, row in (
            (numbers.inertia, inertia), (numbers.velocity, velocity), (numbers.slip, slip),
            *zip(numbers.rates, rates, strict=False),
        ):  # fmt: skip
            place[0:n] = [*row, *zeros]
        numbers.gives = len(rates) - 1

    def times(self, product: StepProduct, **entries: Any) -> Any:
        """Return ``matrix_of_rates`` of loops.h for a matrix, with entries of the ledger."""
        v, momentum = np.zeros(self.c.size), np.zeros(len(self._slip))
        of = struct("matrix_of_rates", product=product.c, v=v, momentum=momentum, **entries)
        return fill(of, rates=self.c)

    # -- handing over --------------------------------------------------------------------------

    def enter(self, q: Array) -> None:
        """Take the rates from Python."""
        moving, now = self._moving, self._now
        self.c.more, self.c.ready = len(moving.more), moving.ready
        for k, rate in enumerate((moving.v, moving.v_before, *moving.more)):
            now[k] = rate
        # No second arrays of what C has; velocities are asked for between its calls.
        moving.v_before, moving.more = now[1], tuple(now[2 : 2 + self.c.more])
        v, *more = self._next if self._asks else (now[1], *self._next)
        for k, (rate, new) in enumerate(zip(now, (v, self._slip, *more), strict=True), start=V):
            self.c.rate[k], self.c.new_rate[k] = doubles(rate), doubles(new)
        self.c.last_dt = moving.last_dt

    def leave(self, q: Array) -> None:
        """Give the rates back to Python."""
        moving, size = self._moving, 8 * self.c.size
        rates = [
            np.frombuffer(ffi.buffer(self.c.rate[k], size)).copy()
            for k in range(V, MORE + self.c.more)
        ]
        moving.v, moving.v_before, moving.more = rates[0], rates[1], tuple(rates[2:])
        moving.last_dt = self.c.last_dt


def _ask(scheme: DynamicScheme, dt: float, columns: Array, last_dt: float) -> Sequence[Array]:
    """Answers of a scheme for given rates: factors, forces of inertia, velocity, rates and slip."""
    change, v, before, *more = columns
    asked = Asked(v, before, tuple(more), last_dt)
    factor, back, of_inertia = scheme.inertia(dt, asked)
    factor_of_velocity, back_of_velocity, velocity = scheme.velocity(dt, asked)
    factors = np.array([factor, back, factor_of_velocity, back_of_velocity])
    slip = scheme.slip(dt, change, asked)
    return (factors, of_inertia, velocity, *scheme.rates(dt, change, asked), slip)


@lru_cache(maxsize=1024)  # steps of one size have some ten lengths, as times are rounded
def _numbers(scheme: Any, n: int, dt: float, last_dt: float) -> Any:
    """Answers of a scheme for unit vectors; a list of numbers each."""
    return [x.tolist() for x in _ask(scheme, dt, np.eye(n), last_dt)]


@cache
def _after_any(scheme: Any) -> bool:
    """Return whether the length of the last step does not matter to a scheme."""
    n = MORE + len(scheme.kept)
    one, *others = (_numbers(scheme, n, 0.1, last_dt) for last_dt in (0.1, 0.07, 0.4))
    return all(other == one for other in others)


@cache
def _asks_for_before(scheme: Any) -> bool:
    """Return whether what a scheme keeps depends on the velocities before the last ones."""
    n = MORE + len(scheme.kept)
    answers = [_numbers(scheme, n, 0.1, last_dt) for last_dt in (0.1, 0.07, 0.4)]
    return any(row[V_BEFORE] != 0.0 for _, _, _, *rates, _ in answers for row in rates)


@cache
def _sums_of_multiples(scheme: Any) -> bool:
    """Return whether a scheme does to any rates what it does to unit vectors."""
    n = MORE + len(scheme.kept)
    columns = np.cos(np.arange(4.0 * n).reshape(n, 4))  # any numbers
    for dt, last_dt in ((0.1, 0.1), (0.1, 0.07)):
        factors, *vectors = _ask(scheme, dt, np.eye(n), last_dt)
        same_factors, *found = _ask(scheme, dt, columns, last_dt)
        if len(vectors) != n + 1 or not np.array_equal(factors, same_factors):
            return False
        for numbers, vector in zip(vectors, found, strict=True):
            size = np.abs(numbers) @ np.abs(columns)
            if not np.all(np.abs(numbers @ columns - vector) <= SAME * size):
                return False
    return True


@ffi.def_extern(error=0)  # type: ignore[misc, untyped-decorator, unused-ignore]
def numbers_in_python(handle: Any, numbers: Any) -> int:
    """Callback of C, declared in c_library.py."""
    ffi.from_handle(handle).find(numbers)
    return 1
