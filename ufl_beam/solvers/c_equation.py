# SPDX-License-Identifier: MIT
"""The equation of a step in C: its parts one after the other, with no Python between them.

SNES calls these functions on one process.  What has no loop in C takes part by a call of Python.
Where several processes share a scene, and where supports are at an angle, SNES calls Python, see
:mod:`ufl_beam.solvers.newton`: the same terms, in the same order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, integers, lib, petsc
from ufl_beam.compiled.csr import Csr
from ufl_beam.terms.beams import Beams, Term
from ufl_beam.terms.connectors import Couplings
from ufl_beam.terms.guide_curves import Guides
from ufl_beam.terms.supports import Supports

Add = Callable[[Array, Array], None]


class InPython:
    """A part that Python computes.

    Args:
        add: Adds to its second argument what the part is at the first.
        size: Number of unknowns, and of what is added to.
        failed: Told of exceptions, which cannot pass through C.
    """

    def __init__(
        self, add: Add, size: tuple[int, int], failed: Callable[[BaseException], None]
    ) -> None:
        self._add, self._size, self._failed = add, size, failed
        self.handle = ffi.new_handle(self)

    def __call__(self, q: Any, out: Any) -> None:
        """Add, to arrays that C lends; not a number where that fails."""
        result = _lent(out, self._size[1])
        try:
            self._add(_lent(q, self._size[0]), result)
        except BaseException as error:
            self._failed(error)
            result.fill(np.nan)


@ffi.def_extern()  # type: ignore[misc, untyped-decorator, unused-ignore]
def add_in_python(handle: Any, q: Any, out: Any) -> None:
    """Callback of C, declared in loops.h."""
    ffi.from_handle(handle)(q, out)


class Demand:
    """Residual of the constraints of connectors, evaluated by Python.

    Args:
        missed: Of the unknowns, the residual, the scale of forces and the largest motion: how far
            it is missed.
        size: Number of unknowns.
        failed: Told of exceptions.
    """

    def __init__(
        self,
        missed: Callable[[Array, Array, float, float], float],
        size: int,
        failed: Callable[[BaseException], None],
    ) -> None:
        self._missed, self._size, self._failed = missed, size, failed
        self._handle = ffi.new_handle(self)
        self.loop = (lib.missed_in_python, self._handle)

    def __call__(self, q: Any, r: Any, scale: float, moved: float) -> float:
        """Return the residual; not a number where it fails."""
        try:
            return self._missed(_lent(q, self._size), _lent(r, self._size), scale, moved)
        except BaseException as error:
            self._failed(error)
            return math.nan


@ffi.def_extern()  # type: ignore[misc, untyped-decorator, unused-ignore]
def missed_in_python(handle: Any, q: Any, r: Any, scale: float, moved: float) -> float:
    """Callback of C, declared in loops.h."""
    missed: float = ffi.from_handle(handle)(q, r, scale, moved)
    return missed


def _lent(pointer: Any, size: int) -> Array:
    """An array that C lends."""
    return np.frombuffer(ffi.buffer(pointer, 8 * size))


class Equation:
    """The equation of a step.

    Args:
        A: Matrix that takes the tangent.
        beams, couplings: Terms whose forces are internal forces.
        others: The other terms.
        supports: What holds; none at an angle.
        force: Takes the internal forces.
    """

    def __init__(
        self,
        A: Csr,
        beams: Sequence[Beams],
        couplings: Sequence[Couplings | Guides],
        others: Sequence[Term],
        supports: Supports,
        force: Array,
    ) -> None:
        self.error: BaseException | None = None
        self._in_python: list[InPython | Demand] = []
        self._size, self._entries = len(force), len(A.data)
        inner = (*beams, *couplings)
        loops = [self._loops_of(term) for term in (*inner, *others)]
        self._forces = ffi.new("call[]", [force for force, _ in loops])
        self._stiffnesses = ffi.new("call[]", [s for _, s in loops if s is not None])
        self._alive = [
            *map(doubles, (force, A.data, supports.reactions, supports.pivots)),
            *(integers(x.astype(np.int32)) for x in (supports.dofs, *supports.entries)),
        ]
        self._supports, self._terms = supports, (*inner, *others)
        self.c = c = ffi.new("equation *")
        c.size, c.entries = self._size, self._entries
        c.inner, c.forces, c.stiffnesses = len(inner), len(loops), len(self._stiffnesses)
        c.force, c.stiffness = self._forces, self._stiffnesses
        c.inner_force, c.tangent, c.reactions, c.pivots, c.hold, c.zero, c.pivot = self._alive
        demands = [self._demand_of(one) for one in couplings]
        self._demands = ffi.new("demand[]", demands)
        c.demands, c.demand = len(demands), self._demands
        c.held, c.zeros = len(supports.dofs), len(supports.entries[0])

    def _loops_of(self, term: Term) -> tuple[Any, Any]:
        loops = term.loops()
        if loops is not None:
            return loops
        return (
            self._call(term.add_residual, self._size),
            self._call(lambda q, _: term.add_tangent(q), self._entries),
        )

    def _demand_of(self, one: Couplings | Guides) -> tuple[Any, Any]:
        if (loop := one.demand()) is not None:
            return loop
        demand = Demand(one.excess, self._size, self._note)
        self._in_python.append(demand)
        return demand.loop

    def _call(self, add: Add, size: int) -> tuple[Any, Any]:
        part = InPython(add, (self._size, size), self._note)
        self._in_python.append(part)
        return lib.add_in_python, part.handle

    def _note(self, error: BaseException) -> None:
        self.error = self.error or error

    def taken_error(self) -> BaseException | None:
        """Return the exception of Python since the last call, if any."""
        error, self.error = self.error, None
        return error

    def attach(self, snes: PETSc.SNES, f: PETSc.Vec, matrix: PETSc.Mat) -> None:
        """Let SNES call the functions in C."""
        function, jacobian, test = map(_in_c, ("snes_function", "snes_jacobian", "snes_test"))
        petsc("SNESSetFunction", snes, f, function, self.c)
        petsc("SNESSetJacobian", snes, matrix, matrix, jacobian, self.c)
        petsc("SNESSetConvergenceTest", snes, test, self.c, ffi.NULL)

    def drive(self, snes: PETSc.SNES) -> None:
        """Let SNES leave Newton's method to the one in C."""
        snes.setType("shell")
        petsc("SNESShellSetContext", snes, self.c)
        petsc("SNESShellSetSolve", snes, _in_c("snes_newton"))


def unlock(vector: PETSc.Vec) -> None:
    """Let a vector be written again that PETSc keeps locked after a linear solve has failed."""
    state = ffi.new("petsc_int *")
    petsc("VecLockGet", vector, state)
    for _ in range(state[0]):
        petsc("VecLockReadPop", vector)


def _in_c(name: str) -> Any:
    """Pointer to a function of ours."""
    return ffi.addressof(lib, name)
