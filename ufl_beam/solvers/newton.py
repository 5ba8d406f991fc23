# SPDX-License-Identifier: MIT
"""Equilibrium of a step by Newton's method in newton.c, as a solver of PETSc.

Its convergence test is ``test_convergence`` there, with dimensionless tolerances.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from petsc4py import PETSc

import numpy as np
from scipy.linalg import qr

from ufl_beam.arrays import Array
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
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import StepFailed
from ufl_beam.solvers.beam_elimination import CondensedSolver
from ufl_beam.solvers.newton_options import PREFIX, Newton, apply_options, database
from ufl_beam.solvers.null_vectors import SINGULAR, soft_motions
from ufl_beam.terms.term import from_c

FULL_STEPS = {"snes_linesearch_type": "basic"}
"""Options for full steps.  A line search of PETSc would mix forces and moments in one norm, and
need additional residuals."""

ZERO_MODE_STIFFNESS = 0.01
"""Stiffness against a zero-energy mode, relative to the largest diagonal entry of the tangent for
displacements or for rotations.

If forces resist the mode after all, iterations converge faster with a smaller stiffness.  A larger
stiffness reduces the motion that round-off causes.
"""

FORCED = 1e-6
"""Residual up to which a motion is a zero-energy mode; relative to the forces in the scene."""

REASONS = {
    lib.SINGULAR: "found a singular tangent",
    lib.TOO_MANY: "did not converge",
    lib.STALLED: "came no closer to an equilibrium",
    lib.DIVERGED: "met a force that is not a finite number",
    -4: "met a force that is not a finite number",  # its name in PETSc changed in 3.24
}
"""Text for each reason of a failure, by values of SNESConvergedReason."""


TIGHT = 1e-12
"""Largest tolerance at which steps of dynamics keep the digits that large displacements lose; this
takes 3 % of the time of a step in the plane."""


def _vector(subdomain: Subdomain) -> tuple[PETSc.Vec, Array]:
    """Create a vector of the unknowns; return it and its local values.

    The vector has ghosts if processes share a scene.  The address of its values does not change.
    """
    if subdomain.alone:
        vector = PETSc.Vec().createSeq(subdomain.size)
        return vector, vector.array_w
    size = (subdomain.num_owned, subdomain.numbering.size)
    vector = PETSc.Vec().createGhost(subdomain.ghosts, size=size, comm=subdomain.comm)
    with vector.localForm() as local:
        return vector, local.array_w


class Solver:
    """Newton's method in newton.c, and the PETSc objects that it uses.

    By default, newton.c is the solver of SNES.  If there are PETSc options or :attr:`snes` has been
    read, PETSc's ``newtonls`` calls the same residuals, tangents and convergence test.

    Args:
        equation: The :class:`StepEquation` of the steps.
        least: Least number of iterations, unless a residual is far below the tolerance.

    Attributes:
        c: ``equation`` of loops.h.
        change: Change in the latest iteration; between solutions, other code may use the array.
        unknowns: Local values of the latest iterate, converged or not; C writes them.
    """

    def __init__(self, subdomain: Subdomain, equation: Any, newton: Newton, least: int) -> None:
        self._subdomain, self._equation, self._newton = subdomain, equation, newton
        self._weights, A = equation.weights, equation.A
        self._factors = CondensedSolver(subdomain, A)
        (self._x, self.unknowns), (self._f, self._r), (self._y, self.change) = (
            _vector(subdomain) for _ in range(3)
        )
        every = np.arange(subdomain.size, dtype=np.int32)
        self._diagonal = A.positions(every, every)
        self._stiffness = np.zeros(subdomain.size)  # against zero-energy modes
        self._moves = np.empty(subdomain.size, dtype=np.uint8)
        c = self.c = equation.c
        fill(
            c,
            scene=subdomain.numbering.scene.size, rtol=newton.rtol, most=newton.max_iterations,
            least=least, space=subdomain.scratch, lengths=subdomain.lengths(),
            diagonal=self._diagonal,
            moves=ffi.from_buffer("uint8_t[]", self._moves),
            unknowns=self.unknowns, residual=self._r, change=self.change,
            x=opaque(self._x), f=opaque(self._f), y=opaque(self._y),
            find_conjugates=lib.find_conjugates_in_python,
            find_zero_modes=lib.find_zero_modes_in_python,
            forget_zero_modes=lib.forget_zero_modes_in_python,
            aside=np.zeros(subdomain.size if c.search != ffi.NULL else 0),
        )  # fmt: skip
        if newton.rtol <= TIGHT and c.product and subdomain.alone and not c.turned:
            self._low = np.zeros(subdomain.size)
            fill(c, low=self._low)
            fill(ffi.cast("step_product *", c.product), low=self._low)
        self._set_stiffness()
        c.handle = equation.callbacks.handle(self)  # `fill` would keep this object alive
        if subdomain.alone:
            self._factors.drive(c)
        else:
            fill(c, agree=lib.agree_in_python, solve=lib.solve_in_python)
        self._make_snes()

    # -- PETSc ---------------------------------------------------------------------------------

    def _make_snes(self) -> None:
        chosen = {**database(), **self._newton.petsc}
        c, snes = self.c, PETSc.SNES().create(self._x.comm)
        self._snes, self._objects = snes, [snes, self._x]
        c.snes, c.searches = opaque(snes), "snes_linesearch_type" not in chosen
        petsc("SNESSetFunction", snes, self._f, *loop("snes_function", c))
        snes.setSolution(self._x)  # monitors of paths need it before a solution by SNES
        if chosen:
            self._use_petsc(chosen)
            return
        self._free_pattern()
        snes.setType("shell")
        solve, context = loop("snes_newton", c)
        petsc("SNESShellSetContext", snes, context)
        petsc("SNESShellSetSolve", snes, solve)

    def _free_pattern(self) -> None:
        self._equation.A.free()
        give_back_memory(self._subdomain.size)

    def _use_petsc(self, chosen: dict[str, Any]) -> None:
        """Let PETSc's own method ``newtonls`` solve, with the chosen options."""
        c, snes, ksp = self.c, self._snes, PETSc.KSP().create(self._x.comm)
        c.monitored = 1
        if c.low:
            self._low[:], c.low = 0.0, ffi.NULL
        for x in (ksp, snes):
            x.setOptionsPrefix(PREFIX)
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(self._factors)
        if self._subdomain.alone:
            matrix = self._equation.A.petsc()
        else:  # only the preconditioner needs a matrix, and it has its own
            self._free_pattern()
            sizes = (self._subdomain.num_owned, self._subdomain.numbering.size)
            matrix = PETSc.Mat().createPython([sizes, sizes], object(), comm=self._subdomain.comm)
            matrix.setUp()
        self._objects.append(matrix)
        petsc("SNESSetJacobian", snes, matrix, matrix, *loop("snes_jacobian", c))
        petsc("SNESSetConvergenceTest", snes, *loop("snes_test", c), ffi.NULL)
        snes.setTolerances(max_it=self._newton.max_iterations)
        snes.setType("newtonls")
        snes.setKSP(ksp)
        apply_options(snes, {**FULL_STEPS, **chosen})

    @property
    def snes(self) -> PETSc.SNES:
        """SNES of the steps; reading it switches to PETSc's method ``newtonls``."""
        if not self.c.monitored:
            self._use_petsc({})
        return self._snes

    def destroy(self) -> None:
        """Destroy the PETSc objects."""
        for x in self._objects:
            x.destroy()

    # -- callbacks of C --------------------------------------------------------------------------

    def solve(self, anew: bool) -> bool:
        """Compute the change, with a new factorization if ``anew``; return whether this fails."""
        owned = slice(self._subdomain.num_owned)
        if anew and not self._factors.factor(self._r[owned]):
            return True
        return not self._factors.solve(self._r[owned], self.change[owned], reduced=bool(anew))

    def find_conjugates(self, q: Array) -> None:
        """Compute the motions conjugate to residuals in the change, for works in a line search."""
        conjugate = self._equation.working(q, self.change)
        fill(self.c, conjugate=conjugate, start=np.empty(len(q)))

    def find_zero_modes(self) -> bool:
        """Stiffen new motions that no force resists or drives; return whether there are any.

        An example is a massless node at which several members meet.  When all plastic hinges around
        it have lost their strength, any rotation of the node is an equilibrium, and the tangent is
        singular.  So a stiffness against the rotation is added to the diagonal of the tangent.
        Residuals, and so forces, energies and solutions, do not contain this stiffness.
        """
        subdomain, A, numbering = self._subdomain, self._equation.A, self._subdomain.numbering
        if (found := soft_motions(self._equation)) is None:
            return False
        _, free, sizes, vectors = found
        doubted = self.c.doubt == lib.DOUBTED
        if doubted and not sizes[-1] <= SINGULAR:
            return False
        motions = numbering.scales[free, None] * vectors
        # One degree of freedom for each mode, chosen so that the modes are independent there
        pivots = qr(motions.T, mode="r", pivoting=True)[1][: vectors.shape[1]]
        dofs = free[pivots[np.abs(motions[pivots]).max(axis=1) > 0.0]]
        chosen = np.isin(subdomain.dofs, dofs)
        new = chosen & (self._stiffness == 0.0)
        forced = chosen & (self._residuals() > FORCED * self.scale()) & (not doubted)
        if not subdomain.total(float(new.any())) or subdomain.total(float(forced.any())):
            return False
        rotations = np.isin(subdomain.dofs, numbering.rotations)
        owned = np.arange(subdomain.size) < subdomain.num_owned
        owned[subdomain.multipliers] = False
        sizes = np.abs(A.data[self._diagonal])
        for alike in (rotations & owned, ~rotations & owned):
            stiffest = subdomain.largest(float(sizes[alike].max(initial=0.0)))
            self._stiffness[new & alike] = ZERO_MODE_STIFFNESS * stiffest
        self._set_stiffness()
        return True

    def forget_zero_modes(self) -> bool:
        """Remove all stiffnesses against zero-energy modes; return whether any process had some."""
        if self._subdomain.largest(float(self.c.idle)) == 0.0:
            return False
        self._stiffness[:] = 0.0
        self._set_stiffness()
        return True

    def _set_stiffness(self) -> None:
        """Let C add the stiffnesses against zero-energy modes to tangents from now on.

        Degrees of freedom with such a stiffness, or with a support, do not count in the round-off
        of forces.
        """
        dofs = np.flatnonzero(self._stiffness)
        arrays = {"idle_entry": self._diagonal[dofs], "idle_stiffness": self._stiffness[dofs]}
        fill(self.c, idle=len(dofs), **arrays)
        self._moves[:] = self._stiffness == 0.0
        self._moves[self._equation.supports.dofs] = 0

    # -- paths -----------------------------------------------------------------------------------

    def follow(self, border: Any) -> None:
        """Solve also for the load factor of a :class:`PathCorrector`; None switches this off."""
        self._border, self.c.border = border, ffi.NULL
        if border is not None:
            self._t = np.array([border.t])
            in_c = struct(
                "border", t=self._t, handle=self.c.handle, arrive=lib.arrive_in_python,
                change=lib.change_along_in_python, met=lib.met_in_python,
            )  # fmt: skip
            fill(self.c, border=in_c)

    def arrive(self, x: Array) -> None:
        """Pass an iterate and its load factor to the border."""
        self._border.t = float(self._t[0])
        self._border.arrive(x)

    def met(self) -> bool:
        """Return whether the control equation is satisfied."""
        return bool(self._border.met())

    def change_along(self, x: Array) -> bool:
        """Compute the change of an iteration of the bordered equation; return whether this fails.

        The border is eliminated by one factorization and two solutions, because a border would
        destroy the sparsity of the tangent.  If the tangent is nearly singular, the next iteration
        recovers the lost digits.
        """
        border, subdomain, owned = self._border, self._subdomain, slice(self._subdomain.num_owned)
        rates, y, z, v = np.zeros((4, len(x)))
        border.tangent(x, rates)
        self._equation.A.data[self._diagonal] += self._stiffness
        rates = subdomain.added(rates)
        rates[self._equation.supports.dofs] = 0.0
        if not self._factors.factor(self._r[owned]):
            return True
        self._factors.solve(self._r[owned], y[owned], reduced=True)
        good = self._factors.solve(rates[owned], z[owned], reduced=False)
        if border.crossing is not None:
            good &= self._factors.solve(border.crossing.weighted[owned], v[owned], reduced=False)
        y, z, v = (subdomain.gather(x)[subdomain.dofs] for x in (y, z, v))
        border.correct(y, z, v)
        self.change[:], self._t[0] = y, border.t
        return not good

    # -- sizes for dimensionless tolerances --------------------------------------------------------

    def size(self, forces: Array) -> float:
        """Return the Euclidean norm of forces, with moments divided by the scene's size; N."""
        local = lib.norm(self._subdomain.size, ffi.NULL, doubles(self._weights), doubles(forces))
        return float(lib.over_processes(self.c, lib.HYPOT, local))

    def scale(self) -> float:
        """Return the sum of the sizes of loads and of internal forces in the latest residual; N."""
        return float(self.c.loads + lib.over_processes(self.c, lib.HYPOT, self.c.inner_size))

    def random_work(self, x: Array, s: Array) -> float:
        """Return the expected work of independent round-off forces at ``x`` in a step ``s``; J."""
        forces = np.empty(self._subdomain.size)
        lib.find_motion(self.c, doubles(x))
        lib.find_round_off(self.c, doubles(x), doubles(forces))
        works = (forces * s)[: self._subdomain.num_owned]
        return math.sqrt(self._subdomain.total(float(np.sum(works**2))))

    def _residuals(self) -> Array:
        """Return magnitudes of the latest residual, with moments divided by the scene's size; N.

        They are zero at ghosts and at forces of connectors.
        """
        return np.asarray(np.abs(self._r) * self._weights)

    def error(self) -> PETSc.Error | None:
        """Return the PETSc error that ended the latest solution, if any."""
        return PETSc.Error(self.c.error) if self.c.error else None

    def failure(self) -> StepFailed:
        """Return the error of a step for which Newton's method found no solution."""
        names = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}
        reason, residuals = self.c.reason, self._residuals()
        worst = self._subdomain.numbering.worst(self._subdomain.gather(residuals))
        places = [f"{size:.1e} N in {place}" for place, size in [*worst.items()][:3]]
        size = self.size(self._r)
        sizes = (
            f"; residual {size:.3e} N, largest: {', '.join(places) or 'nowhere'}; "
            f"forces in the scene {self.scale():.3e} N"
        )
        failure = StepFailed(
            f"Newton's method {REASONS.get(reason, 'was stopped by PETSc')} after "
            f"{self.c.iterations} iterations{sizes if math.isfinite(size) else ''}"
        )
        failure.residuals, failure.reason = worst, str(names.get(reason, reason))
        return failure

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the number of iterations and stiffnesses against zero-energy modes."""
        self.c.total = int(archive.number("iterations", self.c.total))
        known = self._subdomain.largest(float(self._stiffness.any()))
        known = archive.number("idle motions are known", known)
        self._stiffness[:] = archive.at_dofs("idle motions", self._stiffness) if known else 0.0
        self._set_stiffness()


@from_c()
def agree_in_python(handle: Any, number: int, how: Any, values: Any) -> None:
    """Combine numbers over all processes; a maximum is infinite if a number is NaN."""
    comm = ffi.from_handle(handle)[1]._subdomain.comm
    everywhere = np.empty((comm.size, number))
    comm.Allgather(np.frombuffer(ffi.buffer(values, 8 * number)), everywhere)
    for k, column in enumerate(everywhere.T):
        if how[k] == lib.LARGEST:
            values[k] = math.inf if np.isnan(column).any() else column.max()
        else:
            values[k] = math.hypot(*column) if how[k] == lib.HYPOT else column.sum()


def _call(method: str, error: int | None, handle: Any, *data: Any) -> int | None:
    """Call a method of a solver from C, see c_library.py; if it raises, C gets ``error``."""
    callbacks, solver = ffi.from_handle(handle)
    size = 8 * callbacks.c.size
    vectors = (np.frombuffer(ffi.buffer(x, size)) if isinstance(x, ffi.CData) else x for x in data)
    result = getattr(solver, method)(*vectors)
    return None if error is None else int(result)


for _method, _error in {
    "solve": 1, "find_conjugates": None, "find_zero_modes": 0, "forget_zero_modes": 0,
    "arrive": None, "change_along": 1, "met": 0,
}.items():  # fmt: skip
    from_c(_error, f"{_method}_in_python")(partial(_call, _method, _error))
