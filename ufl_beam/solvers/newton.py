# SPDX-License-Identifier: MIT
"""Equilibrium of a step by Newton's method of newton.c, as a solver of PETSc."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Protocol

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import (
    ffi,
    fill,
    give_back_memory,
    lib,
    loop,
    opaque,
    petsc,
    struct,
)
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.solvers.convergence import Convergence
from ufl_beam.solvers.newton_options import PREFIX, Newton
from ufl_beam.solvers.null_vectors import IdleMotions
from ufl_beam.solvers.petsc_options import database, take_options
from ufl_beam.solvers.static_condensation import ChainsFirst
from ufl_beam.solvers.vectors import Vectors
from ufl_beam.terms.phases import Callbacks, from_c

FULL_STEPS = {"snes_linesearch_type": "basic"}
"""A norm in a line search would add forces and moments, and each search costs a residual."""


class Equation(Protocol):
    """Equation of a step; see :class:`StepEquation`."""

    A: Csr
    c: Any
    callbacks: Callbacks
    weights: Array

    @property
    def held(self) -> Index:
        """Degrees of freedom that supports hold."""

    def working(self, q: Array, y: Array) -> Array:
        """Return the conjugates of residuals in a step ``y``; a new array."""


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


class Solver:
    """Newton's method of newton.c, with the objects of PETSc that it works on.

    By default it is the solver of SNES.  Where options or monitors ask for PETSc's ``newtonls``,
    that drives the same residuals, tangents and test of convergence.

    Attributes:
        change: Of the latest iteration; between solutions others may use it.
    """

    def __init__(self, share: Share, equation: Equation, newton: Newton, least: int) -> None:
        self._share, self._equation, self._newton = share, equation, newton
        self._vectors, self._factors = Vectors(share), ChainsFirst(share, equation.A)
        self._x, self._f, self._y = (self._vectors.new() for _ in range(3))
        local = [self._vectors.view(one, writable=True) for one in (self._x, self._f, self._y)]
        self._q, self._r, self.change = local
        c = self._c = equation.c
        self.convergence = Convergence(share, c, equation.A, equation.held, newton)
        handle = equation.callbacks.handle
        fill(
            c,
            least=least, unknowns=self._q, residual=self._r, change=self.change,
            x=opaque(self._x), f=opaque(self._f), y=opaque(self._y),
            find_conjugates=lib.find_conjugates_in_python,
            find_idle=lib.find_idle_in_python, forget_idle=lib.forget_idle_in_python,
            aside=np.zeros(share.size if c.search != ffi.NULL else 0),
        )  # fmt: skip
        c.handle = handle(self)  # what `fill` keeps must not keep this object
        if share.alone:
            self._factors.drive(c)
        else:
            fill(c, agree=lib.agree_in_python, solve=lib.solve_in_python)
        self._ksp = PETSc.KSP().create(self._x.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("python")
        self._ksp.getPC().setPythonContext(self._factors)
        self._make_snes()
        self._has_idle = False

    # -- PETSc ---------------------------------------------------------------------------------

    def _make_matrix(self) -> PETSc.Mat:
        if self._share.alone and self._c.monitored:
            return self._equation.A.petsc()
        # Nothing but the preconditioner, which has its own, asks for the matrix.
        self._equation.A.release()
        give_back_memory(self._share.size)
        sizes = (self._share.num_owned, self._share.grid.size)
        matrix = PETSc.Mat().createPython([sizes, sizes], object(), comm=self._share.comm)
        matrix.setUp()
        return matrix

    def _make_snes(self) -> None:
        chosen = {**database(), **self._newton.petsc}
        c, snes = self._c, PETSc.SNES().create(self._x.comm)
        c.monitored, c.searches = bool(chosen), "snes_linesearch_type" not in chosen
        snes.setOptionsPrefix(PREFIX)
        petsc("SNESSetFunction", snes, self._f, *loop("snes_function", c))
        petsc("SNESSetConvergenceTest", snes, *loop("snes_test", c), ffi.NULL)
        self._let_c_fill(snes)
        snes.setTolerances(max_it=self._newton.max_iterations)
        snes.setType("newtonls")
        snes.setKSP(self._ksp)
        take_options(snes, {**FULL_STEPS, **chosen})
        if not c.monitored:
            snes.setType("shell")
            solve, context = loop("snes_newton", c)
            petsc("SNESShellSetContext", snes, context)
            petsc("SNESShellSetSolve", snes, solve)
        self._snes, c.snes = snes, opaque(snes)

    def _let_c_fill(self, snes: PETSc.SNES) -> None:
        self._matrix = self._make_matrix()
        matrices = self._matrix, self._matrix
        petsc("SNESSetJacobian", snes, *matrices, *loop("snes_jacobian", self._c))

    @property
    def snes(self) -> PETSc.SNES:
        """SNES of the steps; from when it is asked for, their method is PETSc's ``newtonls``."""
        if not self._c.monitored:
            self._c.monitored = 1
            self._let_c_fill(self._snes)
            self._snes.setType("newtonls")
            take_options(self._snes, FULL_STEPS)  # SNES has forgotten its line search
        return self._snes

    # -- callbacks of C --------------------------------------------------------------------------

    def agree(self, how: Sequence[int], values: Array) -> None:
        """Replace numbers by those of all processes; the largest is infinite if one is none."""
        comm = self._share.comm
        everywhere = np.empty((comm.size, len(values)))
        comm.Allgather(values, everywhere)
        for k, (kind, column) in enumerate(zip(how, everywhere.T, strict=True)):
            if kind == lib.LARGEST:
                values[k] = math.inf if np.isnan(column).any() else column.max()
            else:
                values[k] = math.hypot(*column) if kind == lib.HYPOT else column.sum()

    def solve(self, anew: bool) -> bool:
        """Find the change of an iteration over all processes; return whether that fails."""
        owned = slice(self._share.num_owned)
        if anew and not self._factors.factor(self._r[owned]):
            return True
        return not self._factors.solve(self._r[owned], self.change[owned], reduced=anew)

    def find_conjugates(self, q: Array) -> None:
        """Find what a residual works on in a change."""
        conjugate = self._equation.working(q, self.change)
        fill(self._c, conjugate=conjugate, start=np.empty(len(q)))

    @cached_property
    def _idle(self) -> IdleMotions:
        """Idle motions; only scenes in which a tangent was singular have any."""
        self._has_idle = True
        A, diagonal = self._equation.A, self.convergence.diagonal
        return IdleMotions(self._share, A, diagonal, self._equation.held)

    def find_idle(self) -> bool:
        """Look for more idle motions, and hold them; return whether there are any."""
        now = self.convergence
        found = self._idle.find(now.residuals(), now.scale())
        self._put_idle()
        return found

    def forget_idle(self) -> bool:
        """Hold idle motions no more; return whether any were held."""
        some = self._idle.forget()
        if some:
            self._put_idle()
        return some

    def _put_idle(self) -> None:
        """Add the stiffnesses against idle motions to tangents from now on."""
        entries, stiffnesses = self._idle.entries
        idle = {"idle_entry": entries.astype(np.int32), "idle_stiffness": stiffnesses}
        fill(self._c, idle=len(entries), **idle)
        self.convergence.leave_out(self._idle.stiffness > 0.0)

    # -- paths -----------------------------------------------------------------------------------

    def follow(self, border: Border | None) -> None:
        """Solve for the unknown of a border as well, or no more."""
        if border is None:
            self._c.border = ffi.NULL
            return
        t, handle = np.array([border.t]), self._equation.callbacks.handle
        self._border = t, struct(
            "border", t=t, arrive=lib.arrive_in_python, change=lib.change_of_border_in_python,
            met=lib.border_is_met_in_python,
        )  # fmt: skip
        self._border[1].handle = handle(Bordered(self, border, t))
        self._c.border = self._border[1]

    def bordered_change(self, border: Border, x: Array) -> bool:
        """Find the change of an iteration of the bordered equation; return whether that fails.

        By elimination of the border: one factorisation and two solutions, as the tangent alone is
        banded.  Where that is nearly singular, the next iteration makes up for the lost digits.
        """
        rate = self._rate
        self._rates.fill(0.0)
        border.tangent(x, self._rates)
        if self._c.idle:
            entries, stiffnesses = self._idle.entries
            self._equation.A.data[entries] += stiffnesses
        self._vectors.add_ghosts(rate)
        self._rates[self._equation.held] = 0.0
        owned = slice(self._share.num_owned)
        if not self._factors.factor(self._r[owned]):
            return True
        y, z = np.zeros((2, len(x)))
        self._factors.solve(self._r[owned], y[owned], reduced=True)
        good = self._factors.solve(self._rates[owned], z[owned], reduced=False)
        for found in (y, z):
            self.change[owned] = found[owned]
            self._vectors.update_ghosts(self._y)
            found[:] = self.change
        border.correct(y, z)
        self.change[:] = y
        return not good

    @cached_property
    def _rate(self) -> PETSc.Vec:
        return self._vectors.new()

    @cached_property
    def _rates(self) -> Array:
        return self._vectors.view(self._rate, writable=True)

    # -- what is known of it -------------------------------------------------------------------

    @property
    def iterations(self) -> int:
        """Number of iterations so far."""
        return int(self._c.total)

    @property
    def unknowns(self) -> Array:
        """The unknowns of SNES, which C writes to; local values."""
        return self._q

    def iterate(self) -> Array:
        """Return the latest configuration, converged or not; local values, ghosts included."""
        return self._q.copy()

    def begin_steps_anew(self) -> None:
        """Keep no tangent from step to step: a run that goes on from a checkpoint has none."""
        self._c.anew = 1

    def remember(self, memory: Memory) -> None:
        """Pass on the number of iterations, and motions found to be idle."""
        self._c.rate = math.inf  # the next tangent is a new one, here and there
        self._c.total = int(memory.number("iterations", self.iterations))
        if memory.number("idle motions are known", float(self._has_idle)):
            self._idle.remember(memory)
            self._put_idle()

    def require_no_error(self) -> None:
        """Raise the error of PETSc that ended the latest solution, if one did."""
        if self._c.error:
            raise PETSc.Error(self._c.error)

    def destroy(self) -> None:
        """Give back what PETSc holds."""
        for one in (self._snes, self._x, self._matrix):
            one.destroy()


class Bordered:
    """Border of the equation as C calls it; ``t`` is its unknown there; (1,)."""

    def __init__(self, solver: Solver, border: Border, t: Array) -> None:
        self._solver, self._border, self._t = solver, border, t

    def arrive(self, x: Array) -> None:
        """Take note of an iterate."""
        self._border.t = float(self._t[0])
        self._border.arrive(x)

    def change(self, x: Array) -> bool:
        """Find the change of an iteration; return whether that fails."""
        failed = self._solver.bordered_change(self._border, x)
        self._t[0] = self._border.t
        return failed

    def met(self) -> bool:
        """Return whether the equation of the border is met."""
        return self._border.met()


@from_c()
def agree_in_python(handle: Any, number: int, how: Any, values: Any) -> None:
    """Callback of C, declared in c_library.py."""
    solver = ffi.from_handle(handle)[1]
    solver.agree(how[0:number], np.frombuffer(ffi.buffer(values, 8 * number)))


@from_c(1)
def solve_in_python(handle: Any, anew: int) -> int:
    """Callback of C, declared in c_library.py."""
    return int(ffi.from_handle(handle)[1].solve(bool(anew)))


@from_c()
def find_conjugates_in_python(handle: Any, q: Any) -> None:
    """Callback of C, declared in c_library.py."""
    callbacks, solver, _ = ffi.from_handle(handle)
    solver.find_conjugates(callbacks.lend(q))


@from_c(0)
def find_idle_in_python(handle: Any) -> int:
    """Callback of C, declared in c_library.py."""
    return int(ffi.from_handle(handle)[1].find_idle())


@from_c(0)
def forget_idle_in_python(handle: Any) -> int:
    """Callback of C, declared in c_library.py."""
    return int(ffi.from_handle(handle)[1].forget_idle())


@from_c()
def arrive_in_python(handle: Any, x: Any) -> None:
    """Callback of C, declared in c_library.py."""
    callbacks, border, _ = ffi.from_handle(handle)
    border.arrive(callbacks.lend(x))


@from_c(1)
def change_of_border_in_python(handle: Any, x: Any) -> int:
    """Callback of C, declared in c_library.py."""
    callbacks, border, _ = ffi.from_handle(handle)
    return int(border.change(callbacks.lend(x)))


@from_c(0)
def border_is_met_in_python(handle: Any) -> int:
    """Callback of C, declared in c_library.py."""
    return int(ffi.from_handle(handle)[1].met())
