# SPDX-License-Identifier: MIT
"""Solution of one step: the equilibrium that is sought, and whether it can be trusted."""

from __future__ import annotations

import math
from functools import partial

from ufl_beam.arrays import Array
from ufl_beam.collective_errors import Agreement
from ufl_beam.compiled.csr import as_slice
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.constraint_checks import no_number
from ufl_beam.simulation.branch_check import StaticPath
from ufl_beam.simulation.step_cutting import Trial
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.direct_solver import DirectSolver
from ufl_beam.solvers.equation import Border
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.solvers.static_condensation import ChainsFirst
from ufl_beam.terms.openings import Openings

LARGEST_TURN = 0.75 * math.pi
"""A step that turns a node further is cut; the algorithmic strains end at π."""

LEAST_AT_REST, LEAST_IN_MOTION = 2, 1
"""Iterations at least in statics and dynamics, unless a residual is far below its tolerance.

A column that nearly buckles magnifies a load that is hardly larger than the tolerance.  In motion
its inertia holds it meanwhile.
"""


class StepSolver:
    """Solves steps of a scene; whoever accepts them keeps its state."""

    def __init__(
        self,
        scheme: Scheme,
        equation: StepEquation,
        openings: Openings | None,
        branch: StaticPath | None,
        newton: Newton,
        factors: ChainsFirst | DirectSolver,
        together: Agreement,
    ) -> None:
        self._scheme, self._equation, self._openings = scheme, equation, openings
        self._branch, self._together, share = branch, together, equation.share
        least = LEAST_IN_MOTION if has_inertia(scheme) else LEAST_AT_REST
        self.newton = Solver(share, equation, factors, newton, least, together)
        self._rotations, self._multipliers = share.rotations(), as_slice(share.multipliers())
        self._coupled = len(share.grid.multipliers) > 0

    def solve(self, step: Step, guess: Array, *, like_last: bool) -> Trial:
        """Solve a step that the terms have begun, from a guess in the axes of the supports.

        ``like_last`` lets the tangent of the last step do for this one.
        """
        loads = self._equation.load_forces()
        try:
            if self._openings is None:
                q1 = self.newton.solve(guess, loads, like_last)
            else:
                solve = partial(self.newton.solve, loads=loads, like_last=like_last)
                q1 = self._openings.solve(guess, solve, partial(self._equation.begin, step))
        except StepFailed:
            try:
                self._together(self._require_numbers, step)
            except StepFailed as better:
                raise better from None
            raise
        return self._trial(step, q1)

    def solve_along(self, step: Step, guess: Array, border: Border, *, hold: bool) -> Trial:
        """Solve a step, whose times are those of the guess, together with the load factor.

        With ``hold`` what does not flow stays closed if it can, see openings.py.
        """
        t = border.t
        solve = partial(self.newton.solve_along, loads=self._equation.load_forces(), border=border)

        def again() -> None:
            self._equation.begin(step)
            border.t = t

        if self._openings is None or not hold:
            return self._trial(step, solve(guess))
        return self._trial(step, self._openings.solve(guess, solve, again))

    def _require_numbers(self, step: Step) -> None:
        """Raise :class:`StepFailed` if a time function is no finite number in a step."""
        scene = self._equation.share.grid.scene
        if said := no_number(scene, (step.load_time, step.motion_time)):
            raise StepFailed(said)

    def _trial(self, step: Step, q1: Array) -> Trial:
        """Return the result ``q1`` of a step, in the axes of the supports, if it can be trusted."""
        self._equation.supports.leave(q1)
        s, turn = self._scheme.nodal_step(step.q0, q1, self._rotations)
        if self._coupled:
            s[self._multipliers] = 0.0
        turn = self._equation.share.largest(turn)
        if not turn <= LARGEST_TURN:
            raise StepFailed(
                f"a node turns by {turn:.3g} rad in the step, and |Δψ| must stay below π; reduce dt"
            )
        if self._branch is not None:
            self._branch.require(q1, s, self._equation.force, self.newton.convergence.least_work(s))
        return Trial(step, q1, s)
