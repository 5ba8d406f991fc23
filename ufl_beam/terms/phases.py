# SPDX-License-Identifier: MIT
"""Phases of a step, its beginning and its acceptance, as loops in C."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib, loop, struct
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.time_functions import ALWAYS, Table, TimeFunction, steady, value_at


class Phases(NamedTuple):
    """Loops of the type ``phase`` of loops.h, each with its data.

    ``change`` is the method of that name of internal forces, of the type ``change_of_energy``.
    Between calls of C the term is what its attributes say: ``enter`` hands them over before C takes
    steps from the accepted configuration that it is called with, ``leave`` takes them back at the
    one that C has come to.  ``over`` is :attr:`Openable.over` of what may open.  ``admits``
    is the check of a step before it is accepted, of the type ``admission``.
    """

    begin: Sequence[Loop] = ()
    accept: Sequence[Loop] = ()
    add_state: Sequence[Loop] = ()
    change: Loop | None = None
    enter: Callable[[Array], None] = lambda q: None
    leave: Callable[[Array], None] = lambda q: None
    over: Array | None = None
    admits: Loop | None = None


class Callbacks:
    """Python functions that C calls while it takes steps.

    Attributes:
        error: First exception that one of them has raised.
        used: Whether a term has phases that are methods.
        march: ``march`` of loops.h, once there is one.
    """

    error: BaseException | None = None
    used = False
    march: Any = None

    def __init__(self, size: int) -> None:
        self._alive, self._bytes = list[Any](), 8 * size
        # What terms are told of the step that C takes; they know a configuration by its identity.
        self._step: Step | None = None
        self._q0, self._q1, self._s = (np.full(size, math.nan) for _ in range(3))

    def of_time(self, functions: Sequence[tuple[TimeFunction, object]]) -> Any:
        """``time_function`` of loops.h for functions of time with their owners, see value_at."""
        of_time = ffi.new("time_function[]", len(functions))
        for place, (function, owner) in zip(of_time, functions, strict=True):
            if function is steady:
                function = ALWAYS
            if isinstance(function, Table):
                points = [np.array(x, dtype=np.float64) for x in (function.times, function.values)]
                place.points, (place.t, place.y) = len(points[0]), map(doubles, points)
                self._alive += points
            else:
                place.ask = lib.time_in_python
                place.handle = self.handle(partial(value_at, function, owner=owner))
        return of_time

    def begin(self, function: Callable[[Step], None]) -> Loop:
        """Phase of C that calls ``function(step)`` when a step begins."""
        self.used = True
        return self.phase(lambda *_: function(self._step))  # type: ignore[arg-type]

    def accept(self, function: Callable[[Array, Array], None]) -> Loop:
        """Phase of C that calls ``function(q1, s)`` when a step is accepted."""
        return self.phase(lambda *_: function(self._q1, self._s))

    def add_state(self, function: Callable[[Array], None]) -> Loop:
        """Phase of C that calls ``function(q1)`` for the accepted state."""
        return self.phase(lambda *_: function(self._q1))

    def change(self, function: Callable[[Array], tuple[float, float, float]]) -> Loop:
        """C function that adds the ``energy_change`` of loops.h which ``function(q1)`` returns."""
        return lib.change_in_python, self.handle(lambda q1: function(self._copy(q1)))

    def phase(self, function: Callable[[Any, Any, Any], None]) -> Loop:
        """Phase of C that calls ``function(step, q1, s)`` with pointers."""
        return lib.phase_in_python, self.handle(function)

    def note_beginning(self, step: Any, q1: Any, s: Any) -> None:
        """Make the step that terms are told of."""
        if not np.array_equal(before := self._copy(step.q0), self._q1):
            self._q1 = before
        self._q0 = self._q1
        numbers = step.load_time, step.motion_time, step.fraction, step.at
        q_before = self._copy(step.q_before)
        self._step = Step(step.t0, step.t1, self._q0, *numbers, q_before, step.ratio)

    def note_end(self, step: Any, q1: Any, s: Any) -> None:
        """Copy the end of the step for terms."""
        self._q1, self._s = self._copy(q1), self._copy(s)

    @property
    def end(self) -> Array:
        """The end of the step."""
        return self._q1

    def _copy(self, vector: Any) -> Array:
        return np.frombuffer(ffi.buffer(vector, self._bytes)).copy()

    def handle(self, function: Callable[..., Any]) -> Any:
        """Handle of a function that C calls."""
        self._alive.append(ffi.new_handle((self, function)))
        return self._alive[-1]


def _note(kind: type, error: BaseException, traceback: Any) -> None:
    """Note an exception in a callback; an interrupt may come before its first line has run."""
    callbacks, _ = ffi.from_handle(traceback.tb_frame.f_locals["handle"])
    callbacks.error = callbacks.error or error.with_traceback(traceback)
    if callbacks.march is not None:
        callbacks.march.raised = 1


@ffi.def_extern(error=math.nan, onerror=_note)  # type: ignore[misc, untyped-decorator, unused-ignore]
def time_in_python(handle: Any, t: float) -> float:
    """Callback of C, declared in c_library.py."""
    return float(ffi.from_handle(handle)[1](t=t))


@ffi.def_extern(onerror=_note)  # type: ignore[misc, untyped-decorator, unused-ignore]
def phase_in_python(handle: Any, step: Any, q1: Any, s: Any) -> None:
    """Callback of C, declared in c_library.py."""
    ffi.from_handle(handle)[1](step, q1, s)


@ffi.def_extern(onerror=_note)  # type: ignore[misc, untyped-decorator, unused-ignore]
def change_in_python(handle: Any, q1: Any, found: Any) -> None:
    """Callback of C, declared in c_library.py."""
    in_beams, in_connectors, effort = ffi.from_handle(handle)[1](q1)
    found.in_beams += in_beams
    found.in_connectors += in_connectors
    found.effort += effort


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


def weight_of_before(acting: Callable[[Array, Array], Array]) -> float:
    """Weight of the forces before a step among those that do its work; the others have the rest."""
    return float(acting(np.ones(1), np.zeros(1))[0])
