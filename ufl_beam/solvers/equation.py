# SPDX-License-Identifier: MIT
"""The equation of a step as a solver sees it: residual, tangent, and what else must be met."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.mechanics.tangents import Tangents
from ufl_beam.solvers.vectors import Vectors


class Equation(ABC):
    """Equation of a step at the local degrees of freedom of a process.

    Unknowns and residuals are in the axes of supports; what several processes add to one degree of
    freedom is summed by the solver.

    Attributes:
        A: Matrix that takes the tangent.
        weights: Of the residuals: 1 for forces, 1 over the size of the scene for moments, 0 for
            ghosts and forces of connectors.
        force: Internal forces in the latest residual; none where nobody asks for them.
        held: Degrees of freedom that supports hold; what stands for them in A means nothing.
        error: First exception of a user's function since this was last set to None.
        c: ``equation`` of loops.h, which a solver completes with its own numbers.
        in_c: Whether ``c`` has all parts of the equation, so that SNES need not call Python.
    """

    def __init__(self, A: Csr, weights: Array, force: Array, held: Index) -> None:
        self.A, self.weights, self.force, self.held = A, weights, force, held
        self.error: BaseException | None = None
        self.in_c, self._handles = False, list[Any]()
        self.c = struct("equation", size=A.size, weight=weights)
        self.c.inner_force = doubles(force) if len(force) else ffi.NULL
        self.demand([self.demand_in_python(self.missed)])

    def note(self, error: BaseException) -> None:
        """Keep the first exception, which must not pass through C while other processes go on."""
        self.error = self.error or error
        self.c.raised = 1

    @abstractmethod
    def residual(self, x: Array, r: Array) -> None:
        """Write the local part of the residual at ``x`` into ``r``."""

    @abstractmethod
    def complete(self, r: Array) -> None:
        """Remove from the summed residual what supports carry."""

    @abstractmethod
    def tangent(self, x: Array) -> None:
        """Fill the matrix with the derivative at ``x``."""

    @abstractmethod
    def restart(self, tangents: Tangents) -> None:
        """Begin to iterate anew, with tangents of this kind."""

    @abstractmethod
    def missed(self, x: Array, r: Array, scale: float, moved: float) -> float:
        """Return how far the laws of connectors are missed by ``x`` with residual ``r``, relative.

        ``scale`` is the size of the forces in the scene (N), ``moved`` the largest motion (m).
        """

    @abstractmethod
    def stiffen(self, stiff: bool) -> bool:
        """Begin again with stiffer tangents, or end that; return whether they differ."""

    @abstractmethod
    def working(self, x: Array, y: Array) -> Array:
        """Return what the residual works on in a step ``y`` from ``x``; a new array."""

    # -- functions of Python that C calls --------------------------------------------------------

    def demand(self, demands: list[Loop]) -> None:
        """Let the solver meet what these functions evaluate, see ``demand`` of loops.h."""
        self._demands = ffi.new("demand[]", demands)
        self.c.demands, self.c.demand = len(demands), self._demands

    def part_in_python(self, add: Callable[[Array, Array], None], size: int) -> Loop:
        """C function that adds to ``size`` numbers what Python does; not a number if that fails."""
        return lib.add_in_python, self._handle(InPython(self, add, size))

    def demand_in_python(self, missed: Callable[[Array, Array, float, float], float]) -> Loop:
        """C function that calls :meth:`missed`, or the like; not a number if that fails."""
        return lib.missed_in_python, self._handle(InPython(self, missed, self.A.size))

    def _handle(self, function: InPython) -> Any:
        self._handles.append(ffi.new_handle(function))
        return self._handles[-1]


class InPython(NamedTuple):
    """A function of an equation that C calls, and how many numbers it is lent besides unknowns."""

    equation: Equation
    function: Callable[..., Any]
    size: int


def _lent(pointer: Any, size: int) -> Array:
    """An array that C lends."""
    return np.frombuffer(ffi.buffer(pointer, 8 * size))


def note_exception(kind: type, error: BaseException, traceback: Any) -> None:
    """Note an exception in a callback whose handle has the equation.

    An interrupt may come before the first line of the callback has run.
    """
    arguments = traceback.tb_frame.f_locals
    of = ffi.from_handle(arguments["handle"])
    of.equation.note(error.with_traceback(traceback))
    if "out" in arguments:
        _lent(arguments["out"], of.size).fill(np.nan)


@ffi.def_extern(onerror=note_exception)  # type: ignore[misc, untyped-decorator, unused-ignore]
def add_in_python(handle: Any, q: Any, out: Any) -> None:
    """Callback of C, declared in c_library.py."""
    of = ffi.from_handle(handle)
    of.function(_lent(q, of.equation.A.size), _lent(out, of.size))


@ffi.def_extern(error=math.nan, onerror=note_exception)  # type: ignore[misc, untyped-decorator, unused-ignore]
def missed_in_python(handle: Any, q: Any, r: Any, scale: float, moved: float) -> float:
    """Callback of C, declared in c_library.py."""
    of = ffi.from_handle(handle)
    return float(of.function(_lent(q, of.size), _lent(r, of.size), scale, moved))


class Border(Protocol):
    """Additional unknown ``t`` on which the residual depends, with its equation."""

    t: float

    def arrive(self, x: Array) -> None:
        """Take note of an iterate; the residual that follows is at the unknown found so far."""

    def tangent(self, x: Array, r: Array) -> None:
        """Fill the matrix, and add the local part of the derivative by the unknown to ``r``."""

    def correct(self, y: Array, z: Array) -> None:
        """Change the unknown by what solves the equation, and ``y`` accordingly.

        Newton's method subtracts ``y`` from the iterate; ``z`` is what the inverse of the tangent
        makes of the rate.
        """

    def met(self) -> bool:
        """Return whether the equation is."""


class SnesCallbacks:
    """Residual and tangent of an equation in vectors of PETSc.

    ``idle`` are entries of the tangent and stiffnesses that hold idle motions, if there are any.
    """

    def __init__(self, equation: Equation, vectors: Vectors, stop: Callable[[int], int]) -> None:
        self.equation, self.vectors, self._stop = equation, vectors, stop
        self.idle: tuple[Index, Array] | None = None

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Note exceptions instead of raising them through PETSc: processes must stop together."""
        try:
            yield
        except BaseException as error:
            self.equation.note(error)

    def function(self, snes: Any, x: Any, f: Any) -> None:
        """Compute the residual ``f`` at ``x``."""
        self.vectors.update_ghosts(x)
        r = self.vectors.view(f, writable=True)
        with self.noted():
            self.equation.residual(self.vectors.view(x), r)
        if self.equation.error is not None:
            # It may have failed on this process alone; by the sum all give up together.
            r.fill(np.nan)
        self.vectors.add_ghosts(f)
        f.stateIncrease()
        self.equation.complete(r)

    def jacobian(self, snes: Any, x: Any, J: Any, P: Any) -> None:
        """Compute the tangent at ``x``, unless the last one is near enough."""
        if self.equation.c.near:
            return
        self.vectors.update_ghosts(x)
        with self.noted():
            self.equation.tangent(self.vectors.view(x))
            self.hold_idle()
        P.stateIncrease()

    def hold_idle(self) -> None:
        """Add the stiffnesses against idle motions to the tangent."""
        if self.idle is not None:
            entries, stiffnesses = self.idle
            self.equation.A.data[entries] += stiffnesses

    def test(self, snes: Any, iteration: int, norms: Any) -> int:
        """Return why to stop after an iteration, or zero."""
        return self._stop(iteration)
