# SPDX-License-Identifier: MIT
"""One equilibrium by PETSc SNES: vectors, the matrix, tolerances without a dimension."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

from petsc4py import PETSc

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.collective_errors import Agreement
from ufl_beam.compiled.c_library import doubles, ffi, integers, lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.dof_numbering import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import (
    StepFailed,
    require_count,
    require_kind,
    require_number,
    require_switch,
    require_text,
)
from ufl_beam.solvers.c_equation import Demand, Equation, unlock
from ufl_beam.solvers.idle_motions import IdleMotions
from ufl_beam.solvers.line_search import SearchingNewton
from ufl_beam.solvers.preconditioners import Bordered, ChainsFirst

FULL_STEPS = {"snes_linesearch_type": "basic"}
"""A norm in a line search would add forces and moments, and each search costs a residual."""

PATIENCE = 10
"""Iterations in a row without half the least residual that are one too many.

Those that wander longer find a solution by luck: the last digits of the data would decide.
"""

REASONS = {
    lib.SINGULAR: "found a singular tangent",
    lib.TOO_MANY: "did not converge",
    lib.STALLED: "came no closer to an equilibrium",
    lib.DIVERGED: "met a force that is not a finite number",
    -4: "met a force that is not a finite number",  # PETSc's name for it changed in 3.24
}
"""Reasons for which Newton's method stops, in words; by values of SNESConvergedReason."""

PREFIX = "ub_"
"""Prefix of the PETSc options of the solver, as in ``-ub_snes_monitor``."""


@dataclass(frozen=True)
class Newton:
    """Options of Newton's method: tolerance, number of iterations, PETSc options.

    Args:
        rtol: Residual to be reached, as a part of the forces in the scene.
        max_iterations: Iterations before a step is cut.
        modified: Keep the tangent, also from step to step, while residuals fall fast enough.  What
            is saved grows with the number of cells; solutions end closer to ``rtol``.
        petsc: PETSc options without their prefix, such as ``{"snes_monitor": None}``; in
            ``PETSC_OPTIONS`` they have the prefix ``ub_``.  With any of them Newton's method is
            that of PETSc, else one in C that does the same, faster where cells are few.  A
            ``snes_linesearch_type`` takes the place of the search that follows full steps.

    Example:
        >>> newton = ub.Newton(rtol=1e-12, petsc={"snes_linesearch_type": "bt"})
        >>> run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=newton)
    """

    rtol: float = 1e-10
    max_iterations: int = 30
    modified: bool = False
    petsc: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_number(self.rtol, "Newton: rtol", positive=True)
        require_count(self.max_iterations, "Newton: max_iterations")
        object.__setattr__(self, "max_iterations", int(self.max_iterations))
        require_switch(self.modified, "Newton: modified")
        require_kind(self.petsc, dict, "Newton: petsc")
        for option in self.petsc:
            require_text(option, "Newton: petsc, an option")


class Border(Protocol):
    """One more unknown on which the residual depends, and one more equation.

    Attributes:
        t: The unknown.
    """

    t: float

    def arrive(self, x: Array) -> None:
        """Take note of an iterate; the residual that follows is at the unknown found so far."""

    def tangent(self, x: Array, r: Array) -> None:
        """Fill the matrix, and add the local part of the derivative by the unknown to ``r``."""

    def correct(self, y: Array, z: Array) -> None:
        """Change the unknown by what solves the equation, and ``y`` accordingly.

        Args:
            y: What Newton's method subtracts from the iterate if the unknown does not change.
            z: What the inverse of the tangent makes of the rate.
        """

    def met(self) -> bool:
        """Return whether the equation is."""


class Solver:
    """Finds the configuration in which a residual vanishes.

    Args:
        share: The degrees of freedom of this process.
        A: Matrix that ``tangent`` fills.
        residual: Writes the local part of the residual at x into r: ``residual(x, r)``.
        complete: Called with the summed residual; removes what supports carry.
        tangent: Fills ``A`` at x: ``tangent(x)``.
        forces: Internal forces in the latest residual; with the loads, the scale of convergence.
        excess: Of an iterate, its residual, the scale of forces and the largest motion: how far
            what connectors demand is missed, as a number without dimension that must reach the
            tolerance too.
        equation: ``residual``, ``complete`` and ``tangent`` in C, on one process.
        held: Local degrees of freedom that supports hold; what stands for them in A means nothing.
        relieve: Begins again with tangents that are stiffer where that may help, or ends that; says
            whether they differ: ``relieve(relief)``.
        working: Of an iterate and a step from it: what the residual works on, see
            :class:`SearchingNewton`; new arrays.
        newton: Tolerances.
        least: Iterations at least, unless a residual is far below its tolerance.
        agreement: Raises on all processes what one has raised.
    """

    def __init__(
        self,
        share: Share,
        A: Csr,
        *,
        residual: Callable[[Array, Array], None],
        complete: Callable[[Array], None],
        tangent: Callable[[Array], None],
        forces: Array,
        excess: Callable[[Array, Array, float, float], float],
        relieve: Callable[[bool], bool],
        working: Callable[[Array, Array], Array],
        held: Index,
        newton: Newton,
        least: int,
        agreement: Agreement,
        equation: Equation | None = None,
    ) -> None:
        self._share, self._A, self._newton, self._least = share, A, newton, least
        self._residual, self._complete, self._tangent = residual, complete, tangent
        self._excess, self._relieve, self._working = excess, relieve, working
        self._agreement = agreement
        self._at_forces = doubles(forces)
        self._parallel = share.comm.size > 1
        self._views: dict[int, Array] = {}
        self._weights = self._force_weights()
        self._norm = (len(self._weights), doubles(self._weights))
        self._moves = np.ones(share.size)
        self._moves[held] = 0.0
        self._diagonal = np.flatnonzero(A.rows() == A.indices)
        self._held = held
        self._idle_tangent: tuple[Index, Array] | None = None
        self._x = self._vector()
        self._view(self._x, writable=True)
        self._matrix = self._make_matrix()
        self._f = self._vector()
        self._r = self._view(self._f, writable=True)
        self._at_r = doubles(self._r)
        self._factors = self._make_factors()
        self._ksp = self._make_ksp()
        self._equation = equation
        self._correction = np.empty(share.size)
        self._course = self._make_course()
        self._snes = self._make_snes({} if equation is not None else FULL_STEPS)
        self.iterations = self._done = 0
        self._keeps = False
        self._last_loads: list[Array] = []
        self._loads = 0.0
        self._error: BaseException | None = None

    def _make_course(self) -> Any:
        """Make the data of the convergence test in C, see :func:`judge`."""
        c = ffi.new("equation *") if self._equation is None else self._equation.c
        c.size = self._share.size
        c.rtol, c.modified, c.rate = self._newton.rtol, self._newton.modified, math.inf
        self._at_diagonal = integers(self._diagonal.astype(np.int32))
        self._at_sizes = [
            *map(doubles, (self._share.lengths(), self._moves, np.empty(self._share.size)))
        ]
        c.weight, c.residual, c.diagonal = self._norm[1], self._at_r, self._at_diagonal
        c.lengths, c.moves, c.space = self._at_sizes
        c.scene = self._share.grid.scene.size
        c.x = ffi.cast("void *", self._x.handle)
        self._at_correction = doubles(self._correction)
        c.change, c.most = self._at_correction, self._newton.max_iterations
        c.least = self._least
        if self._equation is None:
            self._demand = Demand(self._excess, self._share.size, self._note)
            self._demands = ffi.new("demand[]", [self._demand.loop])
            c.demands, c.demand = len(self._demands), self._demands
        return c

    def _note(self, error: BaseException) -> None:
        self._error = self._error or error

    @contextmanager
    def _noted(self) -> Iterator[None]:
        """Note exceptions, which must not pass through PETSc while other processes go on.

        From then on the residual is no number, so that all processes stop together.
        """
        try:
            yield
        except BaseException as error:
            self._note(error)

    # -- vectors and the matrix ----------------------------------------------------------------

    def _vector(self) -> PETSc.Vec:
        share = self._share
        if not self._parallel:
            return PETSc.Vec().createSeq(share.size)
        size = (share.num_owned, share.grid.size)
        return PETSc.Vec().createGhost(share.ghosts, size=size, comm=share.comm)

    def _view(self, vector: PETSc.Vec, writable: bool = False) -> Array:
        """Local values of a vector, ghosts included; PETSc keeps them where they are."""
        handle = vector.handle
        view = self._views.get(handle)
        if view is None:
            if self._parallel:
                with vector.localForm() as local:
                    view = local.array_w
            else:
                view = vector.array_w if writable else vector.array_r
            self._views[handle] = view
        return view

    def _update_ghosts(self, vector: PETSc.Vec) -> None:
        """Copies of values that other processes own; PETSc copies between vectors without them."""
        if self._parallel:
            vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

    def _make_matrix(self) -> PETSc.Mat:
        if not self._parallel:
            return self._A.petsc()
        # Nothing but the preconditioner, which has its own, asks for the matrix.
        sizes = (self._share.num_owned, self._share.grid.size)
        matrix = PETSc.Mat().createPython([sizes, sizes], object(), comm=self._share.comm)
        matrix.setUp()
        return matrix

    def _make_factors(self) -> ChainsFirst:
        # A connector alone may hold a part whose own stiffness leaves zeros, or nothing but
        # round-off, on the diagonal; PETSc's factorisation does not exchange rows, KLU's does.
        connected = len(self._share.grid.multipliers) > 0
        return ChainsFirst(self._share, self._A, "klu" if connected else "petsc")

    def _make_ksp(self) -> PETSc.KSP:
        ksp = PETSc.KSP().create(self._x.comm)
        ksp.setOptionsPrefix(PREFIX)
        ksp.setType("preonly")
        factors = ksp.getPC()
        factors.setType("python")
        factors.setPythonContext(self._factors)
        return ksp

    def _make_snes(self, search: dict[str, Any]) -> PETSc.SNES:
        snes = PETSc.SNES().create(self._x.comm)
        snes.setOptionsPrefix(PREFIX)
        if self._equation is not None:
            self._equation.attach(snes, self._f, self._matrix)
        else:
            snes.setFunction(self._function, self._f)
            snes.setJacobian(self._jacobian, self._matrix)
            snes.setConvergenceTest(self._test)
        snes.setTolerances(max_it=self._newton.max_iterations)
        snes.setType("newtonls")
        snes.setKSP(self._ksp)
        database = PETSc.Options(PREFIX)
        before = database.getAll()
        chosen = {**(search or FULL_STEPS), **before, **self._newton.petsc}
        try:
            for name, value in chosen.items():
                database[name] = value
            snes.setFromOptions()
            if self._equation is not None and not (search or before or self._newton.petsc):
                self._factors.drive(self._equation.c)
                self._equation.drive(snes)
        finally:
            # PETSc may have given those of before 3.24 their new names.
            for name in {**chosen, **database.getAll()}:
                del database[name]
            for name, value in before.items():
                database[name] = value
        return snes

    @cached_property
    def _careful(self) -> PETSc.SNES | SearchingNewton:
        chosen = {**PETSc.Options(PREFIX).getAll(), **self._newton.petsc}
        if "snes_linesearch_type" in chosen:
            return self._snes
        return SearchingNewton(
            self._snes,
            self._ksp,
            x=self._x,
            f=self._f,
            y=self._vector(),
            w=self._vector(),
            matrix=self._matrix,
            test=lambda iteration: self._test(self._snes, iteration, ()),
            near=lambda: bool(self._course.near),
            work=self._work_on,
            most=self._newton.max_iterations,
        )

    def _work_on(self, y: PETSc.Vec) -> Callable[[], float]:
        """Work of the latest residual on a step from the present iterate; J."""
        for vector in (self._x, y):
            self._update_ghosts(vector)
        number = len(self._weights)
        step = self._working(self._view(self._x), self._view(y))[:number]
        return lambda: self._share.total(float(self._r[:number] @ step))

    # -- with a border -------------------------------------------------------------------------

    @cached_property
    def _along(self) -> PETSc.SNES:
        """SNES of the bordered equations; its steps are full ones."""
        self._rate, self._y = self._vector(), self._vector()
        snes = self._make_snes(FULL_STEPS)
        snes.setFunction(self._function_along, self._f)
        snes.setJacobian(self._jacobian_along, self._matrix)
        snes.setConvergenceTest(self._test_along)
        ksp = PETSc.KSP().create(self._x.comm)
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(Bordered(self._ksp.getPC(), self._rate, self._correct))
        snes.setKSP(ksp)
        return snes

    def _function_along(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self._update_ghosts(x)
        with self._noted():
            self._border.arrive(self._view(x))
        self._function(snes, x, f)

    def _jacobian_along(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        self._update_ghosts(x)
        rate = self._view(self._rate, writable=True)
        rate.fill(0.0)
        with self._noted():
            self._border.tangent(self._view(x), rate)
        P.stateIncrease()
        if self._parallel:
            self._rate.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        rate *= self._moves
        self._rate.stateIncrease()

    def _correct(self, y: PETSc.Vec, z: PETSc.Vec) -> None:
        y.copy(self._y)
        self._update_ghosts(self._y)
        self._update_ghosts(z)
        corrected = self._view(self._y, writable=True)
        with self._noted():
            self._border.correct(corrected, self._view(z))
        y.array_w[:] = corrected[: len(self._weights)]

    def _test_along(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, ...]) -> int:
        reason = self._test(snes, iteration, norms)
        return int(lib.ITERATING) if reason > 0 and not self._border.met() else reason

    def solve_along(self, guess: Array, loads: list[Array], border: Border) -> Array:
        """The configuration as :meth:`solve` finds it, together with the unknown of a border.

        Raises:
            StepFailed: No convergence.
        """
        self._border = border
        self._start(guess, loads)
        reason = self._iterate(self._along, 12)
        if reason <= 0:
            raise self._failure(reason)
        self._update_ghosts(self._x)
        return self._view(self._x).copy()

    # -- what SNES calls -----------------------------------------------------------------------

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self._update_ghosts(x)
        r = self._view(f, writable=True)
        with self._noted():
            self._residual(self._view(x), r)
        if self._error is not None:
            # It may have failed on this process alone; by the sum all give up together.
            r.fill(np.nan)
        if self._parallel:
            f.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        f.stateIncrease()
        self._complete(r)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        if self._course.near:
            return
        self._update_ghosts(x)
        with self._noted():
            self._tangent(self._view(x))
            if self._idle_tangent is not None:
                entries, stiffnesses = self._idle_tangent
                self._A.data[entries] += stiffnesses
        P.stateIncrease()

    # -- convergence ---------------------------------------------------------------------------

    def _force_weights(self) -> Array:
        """One for forces, one over the size of the scene for moments."""
        weights = np.ones(self._share.size)
        weights[self._share.rotations()] = 1 / self._share.grid.scene.size
        weights[self._share.multipliers()] = 0.0
        return weights[: self._share.num_owned].copy()

    def _size(self, forces: Any) -> float:
        """Euclidean norm over the scene of forces and moments over its size, at a pointer; N."""
        if not self._parallel:
            size: float = lib.size_of_forces(self._course, forces)
            return size
        square = self._share.total(lib.sum_of_squares(*self._norm, forces))
        if lib.has_its_digits(square):
            return math.sqrt(square)
        if math.isnan(square):
            return square
        largest = self._share.largest(lib.largest_size(*self._norm, forces))
        if largest == 0.0 or not math.isfinite(largest):
            return largest
        scaled = lib.scaled_sum_of_squares(*self._norm, forces, largest)
        return largest * math.sqrt(self._share.total(scaled))

    def _scale(self) -> float:
        """Size of the loads and of the internal forces in the latest residual; N."""
        return self._loads + self._size(self._at_forces)

    def _residuals(self) -> Array:
        """Sizes of the latest residual, moments over the size of the scene, ghosts zero; N."""
        sizes = np.zeros(self._share.size)
        sizes[: len(self._weights)] = np.abs(self._r[: len(self._weights)]) * self._weights
        return sizes

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, ...]) -> int:
        residual = self._size(self._at_r)
        if not math.isfinite(residual):
            return int(lib.DIVERGED)
        scale = self._scale()
        self._find_motion()
        floor = 8 * self._round_off() if iteration > 1 else 0.0
        x = doubles(self._view(self._x))
        return int(lib.judge(self._course, x, iteration, residual, scale, floor))

    def _round_off(self) -> float:
        """Residual that the last digit of displacements, strains and rotations makes; N.

        Stiff or finely divided beams cannot be solved any better, however small the forces are.
        """
        digits = self._last_digits(self._view(self._x))
        return self._size(doubles(self._A.data[self._diagonal] * digits))

    def _find_motion(self) -> None:
        """Note the largest motion of the iterate in any process, at most the size of the scene."""
        self._note_motion(self._view(self._x))

    def _note_motion(self, x: Array) -> None:
        largest = lib.largest_motion(*self._norm, doubles(x))
        self._course.moved = min(self._share.largest(largest), self._course.scene)

    def _last_digits(self, x: Array) -> Array:
        digits = np.empty(self._share.size)
        lib.find_last_digits(self._course, doubles(x), doubles(digits))
        return digits

    def least_work(self, s: Array) -> float:
        """Work in a step ``s`` of what the last digit of displacements makes; less is none; J."""
        self._find_motion()
        works = self._A.data[self._diagonal] * self._last_digits(self._view(self._x)) * np.abs(s)
        return self._share.total(float(works[: len(self._weights)].sum()))

    def random_work(self, x: Array, s: Array) -> float:
        """Work in a step ``s`` of the last digits at ``x``, were they independent; J."""
        self._note_motion(x)
        works = self._A.data[self._diagonal] * self._last_digits(x) * s
        return math.sqrt(self._share.total(float(np.sum(works[: len(self._weights)] ** 2))))

    # -- the call ------------------------------------------------------------------------------

    def solve(self, guess: Array, loads: list[Array], like_last: bool = False) -> Array:
        """The configuration, found from ``guess``; local values, ghosts included; a new array.

        Args:
            guess: Where to begin.
            loads: Vectors of the loads, for the scale of convergence; new arrays where they change.
            like_last: Whether the tangent of the last solution may do for this one.

        Raises:
            StepFailed: No convergence.
        """
        x = self._start(guess, loads)
        self._keeps = like_last
        reason = self._iterate(self._snes, 2)
        self._keeps = False
        if reason == lib.SINGULAR and self._may_go_on():
            reason = self._hold_idle(guess)
        if reason == lib.STALLED:
            reason = self._iterate(self._careful, PATIENCE)
        if reason <= 0 and self._may_go_on() and self._relieve(True):
            x[:] = guess
            self._x.stateIncrease()
            reason = self._relieved()
        if reason <= 0:
            raise self._failure(reason)
        self._update_ghosts(self._x)
        return x.copy()

    @cached_property
    def _idle(self) -> IdleMotions:
        """Idle motions; only scenes in which a tangent was singular have any."""
        return IdleMotions(self._share, self._A, self._diagonal, self._held)

    def _hold_idle(self, guess: Array) -> int:
        """Iterate with idle motions held; without any if that does not help."""

        def again() -> int:
            self._put_idle()
            self._view(self._x)[:] = guess
            self._x.stateIncrease()
            return self._iterate(self._snes, 2)

        reason = int(lib.SINGULAR)
        while reason == lib.SINGULAR and self._idle.find(self._residuals(), self._scale()):
            reason = again()
        if reason <= 0 and self._idle.forget():
            reason = again()
        return reason

    def _put_idle(self) -> None:
        """Add the stiffnesses against idle motions to tangents from now on."""
        entries, stiffnesses = self._idle_tangent = self._idle.entries
        self._at_idle = integers(entries), doubles(stiffnesses)
        c = self._course
        c.idle, (c.idle_entry, c.idle_stiffness) = len(entries), self._at_idle

    def _relieved(self) -> int:
        """Iterate with stiffer tangents, which come near but slowly, then with true ones."""
        slow = self._iterate(self._snes, PATIENCE)
        self._relieve(False)
        if slow != lib.TOO_MANY and slow <= 0:
            return slow
        near = self._view(self._x).copy()
        exact = self._iterate(self._snes, 2)
        if exact <= 0:
            self._view(self._x)[:] = near
            self._x.stateIncrease()
        return exact if exact > 0 else slow

    def _start(self, guess: Array, loads: list[Array]) -> Array:
        # On several processes they may change on some only.
        if self._parallel or list(map(id, loads)) != list(map(id, self._last_loads)):
            self._last_loads = loads
            self._loads = self._course.loads = sum(self._size(doubles(load)) for load in loads)
        x = self._view(self._x)
        x[:] = guess
        self._x.stateIncrease()
        return x

    def _iterate(self, snes: PETSc.SNES | SearchingNewton, patience: int) -> int:
        """Solve; give up after so many iterations in a row without half the least residual."""
        course = self._course
        course.last = course.best = math.inf
        course.near, course.slow, course.patience = 0, 0, patience
        if snes is not self._snes or not self._keeps:
            course.rate = math.inf
        self._error = None
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
        if self._equation is not None:
            self._error = self._error or self._equation.taken_error()
        if reason <= 0:
            unlock(self._f)
        self._done = snes.getIterationNumber()
        self.iterations += self._done
        return reason

    def _may_go_on(self) -> bool:
        """Return True; raise what a function of the user has raised on any process."""
        error = self._error
        self._agreement.settle(None if isinstance(error, StepFailed) else error)
        return True

    def _failure(self, reason: int) -> StepFailed:
        self._agreement.settle(self._error)
        names = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}
        scale = self._scale()
        residuals = self._share.grid.worst(self._share.gather(self._residuals()))
        places = [f"{size:.1e} N in {place}" for place, size in [*residuals.items()][:3]]
        largest = ", ".join(places) or "nowhere"
        failure = StepFailed(
            f"Newton's method {REASONS.get(reason, 'was stopped by PETSc')} after {self._done} "
            f"iterations; residual {self._size(self._at_r):.3e} N, largest: {largest}; "
            f"forces in the scene {scale:.3e} N"
        )
        failure.residuals = residuals
        failure.reason = str(names.get(reason, reason))
        return failure

    @property
    def rtol(self) -> float:
        """Residual to be reached, as a part of the forces in the scene."""
        return self._newton.rtol

    def iterate(self) -> Array:
        """The latest configuration, converged or not; local values, ghosts included."""
        return self._view(self._x).copy()

    def size(self, forces: Array) -> float:
        """Euclidean norm over the scene of forces, and moments over its size; N."""
        return self._size(doubles(forces))

    def remember(self, memory: Memory) -> None:
        """Pass on the number of iterations, and motions found to be idle."""
        self.iterations = int(memory.number("iterations", self.iterations))
        if memory.number("idle motions are known", float(self._idle_tangent is not None)):
            self._idle.remember(memory)
            self._put_idle()

    def destroy(self) -> None:
        """Give back what PETSc holds."""
        self._snes.destroy()
        self._x.destroy()
        self._matrix.destroy()
