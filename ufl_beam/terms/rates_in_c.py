# SPDX-License-Identifier: MIT
"""Velocities, and what else a scheme keeps, as C has them.

A scheme states what becomes of them in Python.  All of that is a sum of multiples; the numbers are
found by asking the scheme what it makes of unit vectors, once for each length of a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.compiled.csr import StepProduct
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.time_schemes import DynamicScheme

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


class RatesInC:
    """Velocities of a scene, those before the last step, and what else a scheme keeps; all in C.

    They satisfy :class:`Rates`.  Arrays are copies; a new one that is set is copied, too.

    Attributes:
        c: ``rates`` of loops.h.

    Raises:
        SceneError: The scheme makes something else of rates than sums of multiples of them.
    """

    def __init__(self, scheme: DynamicScheme, v: Array) -> None:
        known: Any = scheme
        size, number = len(v), MORE + len(scheme.kept)
        if number > lib.MOST_RATES or not _sums_of_multiples(known):
            raise SceneError(
                f"{scheme!r}: what it makes of velocities must be sums of multiples of them"
            )
        self._scheme = scheme
        # Changes are elsewhere; of velocities before the last ones new ones are not computed, and
        # new velocities take their place where nothing asks for them.
        asks = scheme.slips or _asks_for_before(known)
        self._now = np.zeros((number - V, size))
        self._next = np.zeros((number - V_BEFORE - (not asks), size))
        self._slip = np.zeros(size if scheme.slips else 0)
        self._handle = ffi.new_handle(self)
        self.c = fill(ffi.new("rates *"), size=size, number=number, find=lib.numbers_in_python)
        self.c.handle = self._handle  # what `fill` keeps must not keep this object
        self.c.after_any = _after_any(known)
        first, *more = self._next if asks else (self._now[1], *self._next)
        for k, (rate, new) in enumerate(
            zip(self._now, (first, self._slip, *more), strict=True), start=V
        ):
            self.c.rate[k], self.c.new_rate[k] = doubles(rate), doubles(new)
        self.c.last_dt = math.inf
        self.v = self.v_before = v
        self.keep()

    def _rate(self, k: int) -> Array:
        """A rate as C has it; a view."""
        return np.frombuffer(ffi.buffer(self.c.rate[k], 8 * self.c.size))

    @property
    def v(self) -> Array:
        """Velocities."""
        return self._rate(V).copy()

    @v.setter
    def v(self, v: Array) -> None:
        self._rate(V)[:] = v

    @property
    def v_before(self) -> Array:
        """Velocities before the last step."""
        return self._rate(V_BEFORE).copy()

    @v_before.setter
    def v_before(self, v: Array) -> None:
        self._rate(V_BEFORE)[:] = v

    @property
    def more(self) -> tuple[Array, ...]:
        """What else the scheme keeps, as much as is known of it."""
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

    @last_dt.setter
    def last_dt(self, dt: float) -> None:
        self.c.last_dt = dt

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
