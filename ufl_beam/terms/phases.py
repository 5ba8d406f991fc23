# SPDX-License-Identifier: MIT
"""Phases of a step, its beginning and its acceptance, as loops in C."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib, loop, struct
from ufl_beam.dolfinx_compat import fem
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


class TimeFunctions:
    """Functions of time as C asks for them.

    Attributes:
        error: First exception of a function of a user that C has called.
    """

    error: BaseException | None = None

    def __init__(self) -> None:
        self._alive = list[Any]()

    def in_c(self, functions: Sequence[tuple[TimeFunction, object]]) -> Any:
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
                handle = ffi.new_handle((function, owner, self))
                place.ask, place.handle = lib.time_in_python, handle
                self._alive.append(handle)
        return of_time


def _note(kind: type, error: BaseException, traceback: Any) -> None:
    """Note an exception in a callback; an interrupt may come before its first line has run."""
    _, _, of_scene = ffi.from_handle(traceback.tb_frame.f_locals["handle"])
    of_scene.error = of_scene.error or error.with_traceback(traceback)


@ffi.def_extern(error=math.nan, onerror=_note)  # type: ignore[misc, untyped-decorator, unused-ignore]
def time_in_python(handle: Any, t: float) -> float:
    """Callback of C, declared in c_library.py."""
    function, owner, _ = ffi.from_handle(handle)
    return value_at(function, t, owner)


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
