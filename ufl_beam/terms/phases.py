# SPDX-License-Identifier: MIT
"""Phases of a step, its beginning and its acceptance, as loops in C."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib, loop, struct
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import StepFailed
from ufl_beam.model.curves import Curve
from ufl_beam.model.time_functions import Constant, Table, TimeFunction, steady, value_at


class Phases(NamedTuple):
    """Loops of the type ``phase`` of loops.h, each with its data.

    ``change`` says what a step stores and dissipates, of the type ``change_of_energy``; ``opens``
    are fields of ``openable``, if something may open; ``admits`` is the check of a step before it
    is accepted, of the type ``admission``; ``again`` begins a step again, which iterates tried.
    """

    begin: Sequence[Loop] = ()
    accept: Sequence[Loop] = ()
    add_state: Sequence[Loop] = ()
    change: Loop | None = None
    opens: dict[str, Any] | None = None
    admits: Loop | None = None
    again: Loop | None = None


class Callbacks:
    """Python functions that C calls while it takes steps.

    What they raise must not pass through C: the first exception is kept, and the step fails.

    Attributes:
        error: What was raised in the latest step; a failure of a step gives way to anything else.
        c: ``equation`` of loops.h.
    """

    error: BaseException | None = None

    def __init__(self, c: Any) -> None:
        self.c, self._alive, self._bytes = c, list[Any](), 8 * c.size

    def note(self, error: BaseException) -> None:
        """Keep an exception, and let C end the step on all processes."""
        if self.error is None or isinstance(self.error, StepFailed):
            self.error = error
        self.c.raised = max(self.c.raised, 1 if isinstance(error, StepFailed) else 2)

    # -- functions, with their data ---------------------------------------------------------------

    def curves(self, curves: Sequence[Curve]) -> Any:
        """Handles of curves for C; their points are not numbers if a curve fails."""
        return ffi.new("void *[]", [self.handle(curve, 2 * lib.CURVE_POINTS) for curve in curves])

    def run(self, function: Callable[[], None]) -> Loop:
        """C function that calls ``function()``."""
        return lib.run_in_python, self.handle(function)

    def of_time(self, functions: Sequence[tuple[TimeFunction, object]]) -> Any:
        """``time_function`` of loops.h for functions of time with their owners, see value_at."""
        of_time = ffi.new("time_function[]", len(functions))
        for place, (function, owner) in zip(of_time, functions, strict=True):
            if function is steady:
                function = Constant(1.0)
            if isinstance(function, Constant):
                function = Table((0.0,), (function.value,))
            if isinstance(function, Table):
                points = [np.array(x, dtype=np.float64) for x in (function.times, function.values)]
                place.points, (place.t, place.y) = len(points[0]), map(doubles, points)
                self._alive += points
            else:
                place.ask = lib.time_in_python
                place.handle = self.handle(partial(_value, function, owner))
        return of_time

    def phase(self, function: Callable[[Any, Any, Any], None]) -> Loop:
        """Phase of C that calls ``function(step, q1, s)`` with pointers."""
        return lib.phase_in_python, self.handle(function)

    # -- what they raise --------------------------------------------------------------------------

    def settle(self) -> None:
        """Raise what a function that C has called has raised."""
        error, self.error = self.error, None
        if error is not None:
            raise error

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Raise at the end of a block, outside of steps, what functions have raised in it."""
        before, self.error = (self.error, self.c.raised), None
        try:
            yield
            self.settle()
        finally:
            self.error, self.c.raised = before

    # -- handles -----------------------------------------------------------------------------------

    def lend(self, vector: Any) -> Array:
        """A vector of C, which C may change."""
        return np.frombuffer(ffi.buffer(vector, self._bytes))

    def handle(self, function: Any, size: int = 0) -> Any:
        """Handle of what C calls; ``size`` of numbers that it adds to, if it does."""
        self._alive.append(ffi.new_handle((self, function, size)))
        return self._alive[-1]


def _value(function: TimeFunction, owner: object, t: float) -> float:
    return value_at(function, t, owner)


def _note(kind: type, error: BaseException, traceback: Any) -> None:
    """Note an exception in a callback; an interrupt may come before its first line has run."""
    arguments = traceback.tb_frame.f_locals
    callbacks, _, size = ffi.from_handle(arguments["handle"])
    callbacks.note(error.with_traceback(traceback))
    if "out" in arguments:
        np.frombuffer(ffi.buffer(arguments["out"], 8 * size)).fill(math.nan)


def from_c(
    error: float | None = None, name: str | None = None
) -> Callable[[Callable[..., Any]], Any]:
    """Decorate a callback of C, declared in c_library.py; its value if it raises is ``error``."""
    more = {} if error is None else {"error": error}
    declared: Any = ffi.def_extern(name=name, onerror=_note, **more)
    return declared  # type: ignore[no-any-return]


@from_c()
def curve_in_python(handle: Any, s: float, step: float, out: Any) -> None:
    """Callback of C, declared in c_library.py."""
    curve, far = ffi.from_handle(handle)[1], 2 * step
    out[0 : 2 * lib.CURVE_POINTS] = (
        *curve(s - far), *curve(s - step), *curve(s), *curve(s + step), *curve(s + far),
    )  # fmt: skip


@from_c(math.nan)
def time_in_python(handle: Any, t: float) -> float:
    """Callback of C, declared in c_library.py."""
    return float(ffi.from_handle(handle)[1](t))


def call_in_python(handle: Any, *arguments: Any) -> None:
    """Callbacks of C, declared in c_library.py."""
    ffi.from_handle(handle)[1](*arguments)


for _name in ("run", "begin", "phase"):
    from_c(name=f"{_name}_in_python")(call_in_python)


def beginning(kernels: Iterable[Any], q0: fem.Function) -> list[Loop]:
    """Loops that give kernels the configuration at the beginning of a step, those that have it."""
    return [
        loop("begin_forms", struct("form_of_step", form=one.cells, at=one.position(q0)))
        for one in kernels if one.uses(q0)
    ]  # fmt: skip


def knowing(kernels: Sequence[Any], function: fem.Function) -> dict[str, Any]:
    """Fields of a struct for forms that know values of a function, which a phase gives them."""
    forms = [(one.cells, one.position(function)) for one in kernels]
    return {"forms": len(forms), "form": ffi.new("form_of_step[]", forms)}


def entering(kernel: Any, entry: Any) -> Loop:
    """Loop that adds the value of a kernel to an entry of the ledger."""
    return loop("add_values", struct("form_value", form=kernel.cells, entry=entry))
