# SPDX-License-Identifier: MIT
"""Equilibrium of a step by Newton's method of newton.c, as a solver of PETSc.

Its convergence is judged in tolerances without a dimension.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Protocol

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import (
    doubles,
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
from ufl_beam.errors import StepFailed
from ufl_beam.solvers.newton_options import PREFIX, Newton, database, take_options
from ufl_beam.solvers.null_vectors import IdleMotions
from ufl_beam.solvers.static_condensation import ChainsFirst
from ufl_beam.terms.base import from_c

FULL_STEPS = {"snes_linesearch_type": "basic"}
"""A norm in a line search would add forces and moments, and each search costs a residual."""


REASONS = {
    lib.SINGULAR: "found a singular tangent",
    lib.TOO_MANY: "did not converge",
    lib.STALLED: "came no closer to an equilibrium",
    lib.DIVERGED: "met a force that is not a finite number",
    -4: "met a force that is not a finite number",  # PETSc's name for it changed in 3.24
}
"""Reasons for which Newton's method stops, in words; by values of SNESConvergedReason."""


class Convergence:
    """Sizes of residuals and motions; newton.c decides by them when to stop.

    Attributes:
        c: ``equation`` of loops.h.
        diagonal: Entries of the tangent on the diagonal.
    """

    def __init__(self, share: Share, c: Any, A: Csr, held: Index, newton: Newton) -> None:
        self._share, self.c, self._held = share, c, held
        self._owned, self._weights = slice(share.num_owned), share.weights()
        self._moves = np.ones(share.size, dtype=np.uint8)
        self.leave_out(np.zeros(share.size, dtype=bool))
        all_dofs = np.arange(share.size, dtype=np.int32)
        self.diagonal = A.positions(all_dofs, all_dofs)
        fill(
            c,
            scene=share.grid.scene.size, rtol=newton.rtol, most=newton.max_iterations,
            space=share.scratch,
            lengths=share.lengths(), diagonal=self.diagonal,
            moves=ffi.from_buffer("uint8_t[]", self._moves),
        )  # fmt: skip

    def size(self, forces: Array) -> float:
        """Euclidean norm over the scene of forces, and moments over its size; N."""
        here = lib.norm(self._share.size, doubles(self._weights), doubles(forces))
        return float(lib.over_processes(self.c, lib.HYPOT, here))

    def scale(self) -> float:
        """Size of the loads and of the internal forces in the latest residual; N."""
        return float(self.c.loads + lib.over_processes(self.c, lib.HYPOT, self.c.inner_size))

    def leave_out(self, idle: npt.NDArray[np.bool_]) -> None:
        """Expect no round-off where supports hold, and where a stiffness holds idle motions."""
        self._moves[:] = ~idle
        self._moves[self._held] = 0

    def residuals(self) -> Array:
        """Sizes of the latest residual, moments over the size of the scene, ghosts zero; N."""
        r = np.frombuffer(ffi.buffer(self.c.residual, 8 * self._share.size))
        return np.asarray(np.abs(r) * self._weights)

    def random_work(self, x: Array, s: Array) -> float:
        """Work in a step ``s`` of the last digits at ``x``, were they independent; J."""
        forces = np.empty(self._share.size)
        lib.find_motion(self.c, doubles(x))
        lib.find_round_off(self.c, doubles(x), doubles(forces))
        works = (forces * s)[self._owned]
        return math.sqrt(self._share.total(float(np.sum(works**2))))

    def failure(self) -> StepFailed:
        """Describe why Newton's method has stopped without a solution."""
        names = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}
        reason, residuals = self.c.reason, self.residuals()
        worst = self._share.grid.worst(self._share.gather(residuals))
        places = [f"{size:.1e} N in {place}" for place, size in [*worst.items()][:3]]
        size = lib.over_processes(self.c, lib.HYPOT, float(np.linalg.norm(residuals)))
        failure = StepFailed(
            f"Newton's method {REASONS.get(reason, 'was stopped by PETSc')} after "
            f"{self.c.iterations} iterations; residual {size:.3e} N, largest: "
            f"{', '.join(places) or 'nowhere'}; forces in the scene {self.scale():.3e} N"
        )
        failure.residuals, failure.reason = worst, str(names.get(reason, reason))
        return failure


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


def _vector(share: Share) -> tuple[PETSc.Vec, Array]:
    """A vector of the unknowns, and its local values; where processes share a scene, with ghosts.

    PETSc keeps the values where they are.
    """
    if share.alone:
        vector = PETSc.Vec().createSeq(share.size)
        return vector, vector.array_w
    size = (share.num_owned, share.grid.size)
    vector = PETSc.Vec().createGhost(share.ghosts, size=size, comm=share.comm)
    with vector.localForm() as local:
        return vector, local.array_w


class Solver:
    """Newton's method of newton.c, with the objects of PETSc that it works on.

    By default it is the solver of SNES.  Where options or monitors ask for PETSc's ``newtonls``,
    that drives the same residuals, tangents and test of convergence.

    Args:
        equation: The :class:`StepEquation` of the steps.
        least: Iterations at least.

    Attributes:
        change: Of the latest iteration; between solutions others may use it.
        unknowns: The unknowns of SNES, which C writes to; local values.
    """

    def __init__(self, share: Share, equation: Any, newton: Newton, least: int) -> None:
        self._share, self._equation, self._newton = share, equation, newton
        self._factors = ChainsFirst(share, equation.A)
        (self._x, self.unknowns), (self._f, self._r), (self._y, self.change) = (
            _vector(share) for _ in range(3)
        )
        c = self._c = equation.c
        self.convergence = Convergence(share, c, equation.A, equation.held, newton)
        fill(
            c,
            least=least, unknowns=self.unknowns, residual=self._r, change=self.change,
            x=opaque(self._x), f=opaque(self._f), y=opaque(self._y),
            find_conjugates=lib.find_conjugates_in_python,
            find_idle=lib.find_idle_in_python, forget_idle=lib.forget_idle_in_python,
            aside=np.zeros(share.size if c.search != ffi.NULL else 0),
        )  # fmt: skip
        c.handle = equation.callbacks.handle(self)  # what `fill` keeps must not keep this object
        if share.alone:
            self._factors.drive(c)
        else:
            fill(c, agree=lib.agree_in_python, solve=lib.solve_in_python)
        self._make_snes()
        self._has_idle = False

    # -- PETSc ---------------------------------------------------------------------------------

    def _make_snes(self) -> None:
        chosen = {**database(), **self._newton.petsc}
        ksp, snes = PETSc.KSP().create(self._x.comm), PETSc.SNES().create(self._x.comm)
        for one in (ksp, snes):
            one.setOptionsPrefix(PREFIX)
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(self._factors)
        c, self._snes = self._c, snes
        c.snes, c.monitored = opaque(snes), bool(chosen)
        c.searches = "snes_linesearch_type" not in chosen
        petsc("SNESSetFunction", snes, self._f, *loop("snes_function", c))
        petsc("SNESSetConvergenceTest", snes, *loop("snes_test", c), ffi.NULL)
        self._let_c_fill()
        snes.setTolerances(max_it=self._newton.max_iterations)
        snes.setType("newtonls")
        snes.setKSP(ksp)
        take_options(snes, {**FULL_STEPS, **chosen})
        if not c.monitored:
            snes.setType("shell")
            solve, context = loop("snes_newton", c)
            petsc("SNESShellSetContext", snes, context)
            petsc("SNESShellSetSolve", snes, solve)

    def _let_c_fill(self) -> None:
        """Give SNES the matrix: of PETSc where its own method needs that, else none."""
        if self._share.alone and self._c.monitored:
            self._matrix = self._equation.A.petsc()
        else:
            # Nothing but the preconditioner, which has its own, asks for the matrix.
            self._equation.A.release()
            give_back_memory(self._share.size)
            sizes = (self._share.num_owned, self._share.grid.size)
            self._matrix = PETSc.Mat().createPython([sizes, sizes], object(), comm=self._share.comm)
            self._matrix.setUp()
        matrices = self._matrix, self._matrix
        petsc("SNESSetJacobian", self._snes, *matrices, *loop("snes_jacobian", self._c))

    @property
    def snes(self) -> PETSc.SNES:
        """SNES of the steps; from when it is asked for, their method is PETSc's ``newtonls``."""
        if not self._c.monitored:
            self._c.monitored = 1
            self._let_c_fill()
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
        return not self._factors.solve(self._r[owned], self.change[owned], reduced=bool(anew))

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
        self._c.border = ffi.NULL
        if border is not None:
            self._border, self._t = border, np.array([border.t])
            self._border_in_c = struct(
                "border", t=self._t, handle=self._c.handle, arrive=lib.arrive_in_python,
                change=lib.change_along_in_python, met=lib.met_in_python,
            )  # fmt: skip
            self._c.border = self._border_in_c

    def arrive(self, x: Array) -> None:
        """Let the border take note of an iterate."""
        self._border.t = float(self._t[0])
        self._border.arrive(x)

    def met(self) -> bool:
        """Return whether the equation of the border is met."""
        return self._border.met()

    def change_along(self, x: Array) -> bool:
        """Find the change of an iteration of the bordered equation; return whether that fails.

        By elimination of the border: one factorisation and two solutions, as the tangent alone is
        banded.  Where that is nearly singular, the next iteration makes up for the lost digits.
        """
        border, (rate, rates), owned = self._border, self._rate, slice(self._share.num_owned)
        rates.fill(0.0)
        border.tangent(x, rates)
        if self._c.idle:
            entries, stiffnesses = self._idle.entries
            self._equation.A.data[entries] += stiffnesses
        if not self._share.alone:
            rate.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        rates[self._equation.held] = 0.0
        if not self._factors.factor(self._r[owned]):
            return True
        y, z = np.zeros((2, len(x)))
        self._factors.solve(self._r[owned], y[owned], reduced=True)
        good = self._factors.solve(rates[owned], z[owned], reduced=False)
        for found in (y, z):
            self.change[owned] = found[owned]
            if not self._share.alone:
                self._y.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)
            found[:] = self.change
        border.correct(y, z)
        self.change[:], self._t[0] = y, border.t
        return not good

    @cached_property
    def _rate(self) -> tuple[PETSc.Vec, Array]:
        return _vector(self._share)

    # -- what is known of it -------------------------------------------------------------------

    @property
    def iterations(self) -> int:
        """Number of iterations so far."""
        return int(self._c.total)

    def iterate(self) -> Array:
        """Return the latest configuration, converged or not; local values, ghosts included."""
        return self.unknowns.copy()

    def remember(self, memory: Memory) -> None:
        """Pass on the number of iterations, and motions found to be idle."""
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


@from_c()
def agree_in_python(handle: Any, number: int, how: Any, values: Any) -> None:
    """Callback of C, declared in c_library.py."""
    solver = ffi.from_handle(handle)[1]
    solver.agree(how[0:number], np.frombuffer(ffi.buffer(values, 8 * number)))


def _let_c_call(method: str, error: int | None = None) -> None:
    """Let C call a method of a solver, see c_library.py; its value if it raises is ``error``."""

    @from_c(error, name=f"{method}_in_python")
    def call(handle: Any, *given: Any) -> int | None:
        callbacks, solver, _ = ffi.from_handle(handle)
        size = 8 * callbacks.c.size
        vectors = (
            np.frombuffer(ffi.buffer(x, size)) if isinstance(x, ffi.CData) else x for x in given
        )
        found = getattr(solver, method)(*vectors)
        return None if error is None else int(found)


for _method, _error in {
    "solve": 1, "find_conjugates": None, "find_idle": 0, "forget_idle": 0, "arrive": None,
    "change_along": 1, "met": 0,
}.items():  # fmt: skip
    _let_c_call(_method, _error)
