# SPDX-License-Identifier: MIT
"""Equilibrium of a step by Newton's method, as a solver of PETSc."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.collective_errors import Agreement
from ufl_beam.compiled.c_library import ffi, fill, give_back_memory, lib, loop, opaque, petsc
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.tangents import Tangents
from ufl_beam.solvers.bordered import BorderedNewton
from ufl_beam.solvers.convergence import Convergence
from ufl_beam.solvers.equation import Border, Equation, SnesCallbacks
from ufl_beam.solvers.line_search import SearchingNewton
from ufl_beam.solvers.newton_options import PREFIX, Newton
from ufl_beam.solvers.null_vectors import IdleMotions
from ufl_beam.solvers.petsc_options import database, take_options
from ufl_beam.solvers.static_condensation import ChainsFirst
from ufl_beam.solvers.vectors import Vectors, unlock

FULL_STEPS = {"snes_linesearch_type": "basic"}
"""A norm in a line search would add forces and moments, and each search costs a residual."""

PATIENCE = 10
"""Iterations in a row without half the least residual that are one too many.

Those that wander longer find a solution by luck: the last digits of the data would decide.
"""


class Solver:
    """Finds the configuration in which the residual of an equation vanishes.

    Attributes:
        in_c: Whether C can solve steps with no Python.
        iterations: Number of iterations so far.
    """

    def __init__(
        self,
        share: Share,
        equation: Equation,
        newton: Newton,
        least: int,
        agreement: Agreement,
    ) -> None:
        self._share, self._equation, self._newton = share, equation, newton
        self._factors = ChainsFirst(share, equation.A)
        self._agreement, self._vectors = agreement, Vectors(share)
        self._x, self._f = self._vectors.new(), self._vectors.new()
        self._q, r = (self._vectors.view(one, writable=True) for one in (self._x, self._f))
        self.convergence = Convergence(share, equation, self._q, r, newton, least)
        equation.c.x = opaque(self._x)
        self._callbacks = SnesCallbacks(equation, self._vectors, self.convergence.test)
        self.in_c = equation.in_c and not self._chosen()
        self._matrix = self._make_matrix()
        self._ksp = PETSc.KSP().create(self._x.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("python")
        self._ksp.getPC().setPythonContext(self._factors)
        self._bordered: BorderedNewton | None = None
        self._snes = self._make_snes()
        if self.in_c:
            self._leave_newton_to_c()
        self.iterations = self._done = 0

    # -- PETSc ---------------------------------------------------------------------------------

    def _make_matrix(self) -> PETSc.Mat:
        if not (self._vectors.parallel or self.in_c):
            return self._equation.A.petsc()
        # Nothing but the preconditioner, which has its own, asks for the matrix.
        self._equation.A.release()
        give_back_memory(self._share.size)
        sizes = (self._share.num_owned, self._share.grid.size)
        matrix = PETSc.Mat().createPython([sizes, sizes], object(), comm=self._share.comm)
        matrix.setUp()
        return matrix

    def _chosen(self) -> dict[str, Any]:
        """PETSc options that the user has chosen."""
        return {**database(), **self._newton.petsc}

    def _make_snes(self) -> PETSc.SNES:
        snes = PETSc.SNES().create(self._x.comm)
        snes.setOptionsPrefix(PREFIX)
        if self._equation.in_c:
            petsc("SNESSetFunction", snes, self._f, *loop("snes_function", self._equation.c))
            self._let_c_fill(snes)
            petsc("SNESSetConvergenceTest", snes, *loop("snes_test", self._equation.c), ffi.NULL)
        else:
            snes.setFunction(self._callbacks.function, self._f)
            snes.setJacobian(self._callbacks.jacobian, self._matrix)
            snes.setConvergenceTest(self._callbacks.test)
        snes.setTolerances(max_it=self._newton.max_iterations)
        snes.setType("newtonls")
        snes.setKSP(self._ksp)
        take_options(snes, {**FULL_STEPS, **self._chosen()})
        return snes

    def _let_c_fill(self, snes: PETSc.SNES) -> None:
        matrices = self._matrix, self._matrix
        petsc("SNESSetJacobian", snes, *matrices, *loop("snes_jacobian", self._equation.c))

    def _leave_newton_to_c(self) -> None:
        self._factors.drive(self._equation.c)
        solve, context = loop("snes_newton", self._equation.c)
        self._snes.setType("shell")
        petsc("SNESShellSetContext", self._snes, context)
        petsc("SNESShellSetSolve", self._snes, solve)

    @property
    def snes(self) -> PETSc.SNES:
        """SNES of the steps; from when it is asked for, their method is PETSc's ``newtonls``."""
        if self.in_c:
            self.in_c = False
            self._matrix = self._make_matrix()
            self._let_c_fill(self._snes)
            self._snes.setType("newtonls")
            take_options(self._snes, FULL_STEPS)  # SNES has forgotten its line search
        return self._snes

    @cached_property
    def _careful(self) -> PETSc.SNES | SearchingNewton:
        """Newton's method with a line search."""
        if "snes_linesearch_type" in self._chosen():
            return self._snes
        return SearchingNewton(self._snes, self._vectors, self._equation, self.convergence)

    def _along(self, border: Border) -> PETSc.SNES:
        """SNES of the equation with a border."""
        if self._bordered is None:
            factors, snes, of_steps = self._ksp.getPC(), self._make_snes(), self._snes

            def call_monitors(*arguments: Any) -> None:
                for monitor, more, named in of_steps.getMonitor() or ():
                    monitor(*arguments, *more, **named)

            snes.setMonitor(call_monitors)
            self._bordered = BorderedNewton(snes, self._callbacks, factors, border)
        self._bordered.border = border
        return self._bordered.snes

    # -- the calls -----------------------------------------------------------------------------

    @np.errstate(over="ignore", invalid="ignore")  # of iterates that diverge
    def solve(self, guess: Array, loads: list[Array], like_last: bool = False) -> Array:
        """Find the configuration from ``guess``; local values, ghosts included; a new array.

        The ``loads``, for the scale of convergence, are new arrays where they change; ``like_last``
        lets the tangent of the last solution do for this one.
        """
        self.convergence.take_loads(loads)
        self._go_to(guess)
        reason = self._iterate(self._snes, 2, like_last=like_last)
        if reason == lib.SINGULAR and self._may_go_on():
            reason = self._hold_idle(partial(self._again, guess))
        if reason == lib.STALLED:
            self._equation.restart(Tangents.EXACT)
            reason = self._iterate(self._careful, PATIENCE)
        if reason <= 0 and self._may_go_on() and self._equation.stiffen(True):
            self._go_to(guess)
            reason = self._stiffened()
        return self._solution(reason)

    def solve_along(self, guess: Array, loads: list[Array], border: Border) -> Array:
        """Find the configuration as :meth:`solve` does, together with the unknown of a border."""
        self.convergence.take_loads(loads)
        start = border.t

        def iterate() -> int:
            border.t = start
            self._go_to(guess)
            self._equation.restart(Tangents.FIRST)
            return self._iterate(self._along(border), 12)

        reason = iterate()
        if reason == lib.SINGULAR and self._may_go_on():
            reason = self._hold_idle(iterate)
        return self._solution(reason)

    @cached_property
    def _idle(self) -> IdleMotions:
        """Idle motions; only scenes in which a tangent was singular have any."""
        return IdleMotions(
            self._share, self._equation.A, self.convergence.diagonal, self._equation.held
        )

    def _again(self, guess: Array) -> int:
        """Iterate from a guess once more."""
        self._go_to(guess)
        return self._iterate(self._snes, 2)

    def _hold_idle(self, again: Callable[[], int]) -> int:
        """Iterate again with idle motions held; without any if that does not help."""
        reason, now = int(lib.SINGULAR), self.convergence
        while reason == lib.SINGULAR and self._idle.find(now.residuals(), now.scale()):
            self._put_idle()
            reason = again()
        if reason <= 0 and self.forget_idle():
            reason = again()
        return reason

    def forget_idle(self) -> bool:
        """Hold idle motions no more; return whether any were held."""
        some = self._idle.forget()
        if some:
            self._put_idle()
        return some

    def _put_idle(self) -> None:
        """Add the stiffnesses against idle motions to tangents from now on."""
        entries, stiffnesses = self._callbacks.idle = self._idle.entries
        idle = {"idle_entry": entries, "idle_stiffness": stiffnesses}
        fill(self._equation.c, idle=len(entries), **idle)
        self.convergence.leave_out(self._idle.stiffness > 0.0)

    def _stiffened(self) -> int:
        """Iterate with stiffer tangents, which come near but slowly, then with true ones."""
        slow = self._iterate(self._snes, PATIENCE)
        self._equation.stiffen(False)
        if slow != lib.TOO_MANY and slow <= 0:
            return slow
        near = self.iterate()
        exact = self._iterate(self._snes, 2)
        if exact <= 0:
            self._go_to(near)
        return exact if exact > 0 else slow

    def _go_to(self, q: Array) -> None:
        self._q[:] = q
        self._x.stateIncrease()
        self._equation.restart(Tangents.PREDICTED)

    def _iterate(
        self, snes: PETSc.SNES | SearchingNewton, patience: int, *, like_last: bool = False
    ) -> int:
        """Solve; give up after so many iterations in a row without half the least residual."""
        self.convergence.begin(patience, like_last=like_last)
        self._equation.error = None
        try:
            snes.solve(None, self._x)
            reason = int(snes.getConvergedReason())
        except PETSc.Error as error:
            cause: BaseException = error
            while cause.__cause__ is not None:
                cause = cause.__cause__
            if getattr(cause, "ierr", 0) != lib.OF_LIBRARY:
                raise cause from None
            reason = int(lib.SINGULAR)  # KLU stops PETSc where it finds no pivot
        if reason <= 0:
            unlock(self._f)
        self._done = snes.getIterationNumber()
        self.iterations += self._done
        return reason

    def _may_go_on(self) -> bool:
        """Return True; raise what a function of the user has raised on any process."""
        error = self._equation.error
        self._agreement.settle(None if isinstance(error, StepFailed) else error)
        return True

    def _solution(self, reason: int) -> Array:
        """Return the latest iterate; raise the failure, or what a function of the user raised."""
        if reason <= 0:
            self._agreement.settle(self._equation.error)
            raise self.convergence.failure(reason, self._done)
        if self._vectors.parallel:
            self._vectors.update_ghosts(self._x)
        return self._q.copy()

    # -- what is known of it -------------------------------------------------------------------

    @property
    def unknowns(self) -> Array:
        """The unknowns of SNES, which C writes to; local values."""
        return self._q

    def in_petsc(self) -> Any:
        """SNES, as C has it."""
        return opaque(self._snes)

    def iterate(self) -> Array:
        """Return the latest configuration, converged or not; local values, ghosts included."""
        return self._q.copy()

    def begin_steps_anew(self) -> None:
        """Keep no tangent from step to step: a run that goes on from a checkpoint has none."""
        self._equation.c.anew = 1

    def remember(self, memory: Memory) -> None:
        """Pass on the number of iterations, and motions found to be idle."""
        self._equation.c.rate = math.inf  # the next tangent is a new one, here and there
        self.iterations = int(memory.number("iterations", self.iterations))
        if memory.number("idle motions are known", float(self._callbacks.idle is not None)):
            self._idle.remember(memory)
            self._put_idle()

    def destroy(self) -> None:
        """Give back what PETSc holds."""
        self._snes.destroy()
        self._x.destroy()
        self._matrix.destroy()
