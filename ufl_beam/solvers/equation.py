# SPDX-License-Identifier: MIT
"""The equation of a step as a solver sees it: residual, tangent, and what else must be met."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import ffi, lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.solvers.vectors import Vectors


class Equation(Protocol):
    """Equation of a step at the local degrees of freedom of a process.

    Unknowns and residuals are in the axes of supports; what several processes add to one degree of
    freedom is summed by the solver.

    Attributes:
        A: Matrix that takes the tangent.
        force: Internal forces in the latest residual; with the loads, the scale of convergence.
        held: Degrees of freedom that supports hold; what stands for them in A means nothing.
        error: First exception of a user's function since this was last set to None.
        c: ``equation`` of loops.h, which a solver completes with its own numbers.
    """

    A: Csr
    force: Array
    held: Index
    error: BaseException | None
    c: Any

    def note(self, error: BaseException) -> None:
        """Keep an exception, which must not pass through C while other processes go on."""

    def residual(self, x: Array, r: Array) -> None:
        """Write the local part of the residual at ``x`` into ``r``."""

    def complete(self, r: Array) -> None:
        """Remove from the summed residual what supports carry."""

    def tangent(self, x: Array) -> None:
        """Fill the matrix with the derivative at ``x``."""

    def missed(self, x: Array, r: Array, scale: float, moved: float) -> float:
        """Return how far the laws of connectors are missed by ``x`` with residual ``r``, relative.

        ``scale`` is the size of the forces in the scene (N), ``moved`` the largest motion (m).
        """

    def stiffen(self, stiff: bool) -> bool:
        """Begin again with stiffer tangents, or end that; return whether they differ."""

    def working(self, x: Array, y: Array) -> Array:
        """Return what the residual works on in a step ``y`` from ``x``; a new array."""

    def attach(self, snes: Any, callbacks: SnesCallbacks, f: Any, matrix: Any) -> None:
        """Let SNES evaluate the equation, by these callbacks or faster, with the residual in f."""

    def drive(self, snes: Any, factors: Any) -> None:
        """Let SNES leave Newton's method to the one in C, if the equation is all in C."""


class PythonEquation(Equation):
    """Base of an equation whose parts Python calls one after the other."""

    def __init__(self, A: Csr, force: Array, held: Index) -> None:
        self.A, self.force, self.held = A, force, held
        self.error = None
        self._missed = Demand(self.missed, len(force), self.note)
        self._demand = ffi.new("demand[]", [self._missed.loop])
        self.c = ffi.new("equation *", {"demands": 1, "demand": self._demand})

    def note(self, error: BaseException) -> None:
        """Keep the first exception."""
        self.error = self.error or error

    def attach(self, snes: Any, callbacks: SnesCallbacks, f: Any, matrix: Any) -> None:
        """Let SNES call Python."""
        snes.setFunction(callbacks.function, f)
        snes.setJacobian(callbacks.jacobian, matrix)
        snes.setConvergenceTest(callbacks.test)

    def drive(self, snes: Any, factors: Any) -> None:
        """Leave Newton's method to PETSc."""


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
        self._equation, self._vectors, self._stop = equation, vectors, stop
        self.idle: tuple[Index, Array] | None = None

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Note exceptions instead of raising them through PETSc: processes must stop together."""
        try:
            yield
        except BaseException as error:
            self._equation.note(error)

    def function(self, snes: Any, x: Any, f: Any) -> None:
        """Compute the residual ``f`` at ``x``."""
        self._vectors.update_ghosts(x)
        r = self._vectors.view(f, writable=True)
        with self.noted():
            self._equation.residual(self._vectors.view(x), r)
        if self._equation.error is not None:
            # It may have failed on this process alone; by the sum all give up together.
            r.fill(np.nan)
        self._vectors.add_ghosts(f)
        f.stateIncrease()
        self._equation.complete(r)

    def jacobian(self, snes: Any, x: Any, J: Any, P: Any) -> None:
        """Compute the tangent at ``x``, unless the last one is near enough."""
        if self._equation.c.near:
            return
        self._vectors.update_ghosts(x)
        with self.noted():
            self._equation.tangent(self._vectors.view(x))
            if self.idle is not None:
                entries, stiffnesses = self.idle
                self._equation.A.data[entries] += stiffnesses
        P.stateIncrease()

    def test(self, snes: Any, iteration: int, norms: Any) -> int:
        """Return why to stop after an iteration, or zero."""
        return self._stop(iteration)


# -- parts that C leaves to Python ---------------------------------------------------------------


@dataclass
class InPython:
    """A part of a residual or tangent at its first argument that Python adds to its second."""

    add: Callable[[Array, Array], None]
    size: tuple[int, int]
    failed: Callable[[BaseException], None]

    def __post_init__(self) -> None:
        self.handle = ffi.new_handle(self)

    def __call__(self, q: Any, out: Any) -> None:
        """Add, to arrays that C lends; not a number where that fails."""
        result = _lent(out, self.size[1])
        try:
            self.add(_lent(q, self.size[0]), result)
        except BaseException as error:
            self.failed(error)
            result.fill(np.nan)


@ffi.def_extern()  # type: ignore[misc, untyped-decorator, unused-ignore]
def add_in_python(handle: Any, q: Any, out: Any) -> None:
    """Callback of C, declared in loops.h."""
    ffi.from_handle(handle)(q, out)


@dataclass
class Demand:
    """Residual of the constraints of connectors, evaluated by Python."""

    missed: Callable[[Array, Array, float, float], float]
    size: int
    failed: Callable[[BaseException], None]

    def __post_init__(self) -> None:
        self.loop = lib.missed_in_python, ffi.new_handle(self)

    def __call__(self, q: Any, r: Any, scale: float, moved: float) -> float:
        """Return the residual; not a number where it fails."""
        try:
            return self.missed(_lent(q, self.size), _lent(r, self.size), scale, moved)
        except BaseException as error:
            self.failed(error)
            return math.nan


@ffi.def_extern()  # type: ignore[misc, untyped-decorator, unused-ignore]
def missed_in_python(handle: Any, q: Any, r: Any, scale: float, moved: float) -> float:
    """Callback of C, declared in loops.h."""
    missed: float = ffi.from_handle(handle)(q, r, scale, moved)
    return missed


def _lent(pointer: Any, size: int) -> Array:
    """An array that C lends."""
    return np.frombuffer(ffi.buffer(pointer, 8 * size))
