# SPDX-License-Identifier: MIT
"""The equation of a step in C: its parts one after the other, with no Python between them.

SNES calls these functions on one process.  What has no loop in C takes part by a call of Python.
Where several processes share a scene, and where supports are at an angle, SNES calls Python, see
:class:`SnesCallbacks`: the same terms, in the same order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, integers, lib, petsc
from ufl_beam.solvers.equation import Demand, Equation, InPython, SnesCallbacks
from ufl_beam.terms.base import InternalForces, Term
from ufl_beam.terms.links import Links
from ufl_beam.terms.supports import Supports


class CEquation:
    """The equation of a step in C, on one process and with no support at an angle.

    The same in ``python`` does what C does not; forces of beams and couplings are internal forces.
    """

    def __init__(
        self,
        python: Equation,
        beams: Sequence[InternalForces],
        couplings: Sequence[Links],
        others: Sequence[Term],
        supports: Supports,
    ) -> None:
        self.A, self.force, self.held = A, force, _ = python.A, python.force, python.held
        self.residual, self.complete = python.residual, python.complete
        self.tangent, self.missed = python.tangent, python.missed
        self.stiffen, self.working = python.stiffen, python.working
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

    def _demand_of(self, one: Links) -> tuple[Any, Any]:
        if (loop := one.demand()) is not None:
            return loop
        demand = Demand(one.excess, self._size, self.note)
        self._in_python.append(demand)
        return demand.loop

    def _call(self, add: Callable[[Array, Array], None], size: int) -> tuple[Any, Any]:
        part = InPython(add, (self._size, size), self.note)
        self._in_python.append(part)
        return lib.add_in_python, part.handle

    def note(self, error: BaseException) -> None:
        """Keep the first exception."""
        self.error = self.error or error

    def attach(
        self, snes: PETSc.SNES, callbacks: SnesCallbacks, f: PETSc.Vec, matrix: PETSc.Mat
    ) -> None:
        """Let SNES call the functions in C."""
        function, jacobian, test = map(_in_c, ("snes_function", "snes_jacobian", "snes_test"))
        petsc("SNESSetFunction", snes, f, function, self.c)
        petsc("SNESSetJacobian", snes, matrix, matrix, jacobian, self.c)
        petsc("SNESSetConvergenceTest", snes, test, self.c, ffi.NULL)

    def drive(self, snes: PETSc.SNES, factors: Any) -> None:
        """Let SNES leave Newton's method to the one in C."""
        factors.drive(self.c)
        snes.setType("shell")
        petsc("SNESShellSetContext", snes, self.c)
        petsc("SNESShellSetSolve", snes, _in_c("snes_newton"))


def _in_c(name: str) -> Any:
    """Pointer to a function of ours."""
    return ffi.addressof(lib, name)
