# SPDX-License-Identifier: MIT
"""Impacts of a run: at its start, and where prescribed rates jump; see mechanics/impacts.py."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, vstack
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array
from ufl_beam.discretization.state_io import Archive, State
from ufl_beam.discretization.state_transfer import geometry
from ufl_beam.mechanics.impacts import (
    ROUND_OFF,
    STEP_ERROR,
    Excess,
    may_jump,
    motion_of,
    motions_of,
    next_kink,
    rate_after,
)
from ufl_beam.mechanics.time_scheme import Step, stages_of
from ufl_beam.model.connector_laws import HOLDING
from ufl_beam.simulation.initial_state import same_time
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StepEquation


class Impact(NamedTuple):
    """Velocities and energies of a plastic impact."""

    v: Array  # velocities after the impact
    works: Array  # of the impulses of the constraints; J
    lost: float  # energy; J


class Impacts:
    """Constraints of a whole scene, and impacts in which velocities meet them.

    Args:
        equation: Equation of the whole scene on one process.

    Attributes:
        held: Degrees of freedom that supports hold, the first constraints.
        connectors: Indices of the connectors that are the other constraints.
        functions: Functions of time of the constraints; None for one that does not move.
    """

    def __init__(self, equation: StepEquation) -> None:
        self._equation, self.held = equation, equation.supports.dofs
        terms = equation.connector_terms
        self._terms = [term for term in terms if isinstance(term.connectors[0].law, HOLDING)]
        motions = {dof: motion for dof, motion, _ in equation.supports.motions}
        self.functions = [motions.get(int(dof)) for dof in self.held]
        self.functions += [motion_of(c.law) for term in self._terms for c in term.connectors]
        self.connectors = [int(i) for term in self._terms for i in term.indices]

    def _gradients(self, q: Array, t: float, state: State | None) -> csr_array:
        """Return the derivatives of the constraints at the configuration ``q``."""
        equation, A = self._equation, self._equation.A
        for term in self._terms if state else ():  # places on guides
            term.save_or_restore(Archive(equation.subdomain, state), q)
        step = Step.create(equation.scheme, t, t + 1.0, t + 1.0, q)
        equation.begin(step._replace(load_time=t, motion_time=t), self._terms)
        before = A.data.copy()
        A.data.fill(0.0)
        for term in self._terms:
            term.add_tangent(q)
        tangent = csr_array((A.data.copy(), A.indices, A.indptr), shape=(A.size, A.size))
        A.data[:] = before
        units = csr_array(eye_array(A.size, format="csr")[self.held])
        if equation.supports.turned:
            units = csr_array(np.array([*map(equation.supports.in_plane, units.toarray())]))
        forces = np.array([dof for term in self._terms for dof in term.forces_at], dtype=int)
        return csr_array(vstack([units, tangent[forces]]))

    def at_start(self, t: float, start: Solution | None) -> list[bool]:
        """Return which constraints may be contradicted when a run begins at ``t``.

        After ``start``, a dynamic run of another scene or to another time, these are constraints
        that its scene does not have; otherwise, motions that are prescribed.
        """
        if start is None:
            return [f is not None for f in self.functions]
        old, every = start.scene, self._equation.subdomain.numbering.scene.all_connectors
        known = {id(f) for f in motions_of(old)} if same_time(start, t) else set()
        fixed = {geometry(c) for c in old.all_connectors if motion_of(c.law) is None}
        new = [id(f) not in known for f in self.functions]
        for k, i in enumerate(self.connectors, start=len(self.held)):
            if self.functions[k] is None:
                new[k] = geometry(every[i]) not in fixed
        return new

    def after(self, last_dt: float, t: float, t1: float, checked: float) -> list[bool]:
        """Return which rates may have jumped in a step to ``t``, whose last stage took ``last_dt``.

        Before the first step, ``last_dt`` is infinite; the step is then as long as the next one, to
        ``t1``.  Rates up to the time ``checked`` do not count.
        """
        part = stages_of(self._equation.scheme)[-1]
        begin = max(t - (last_dt / part if math.isfinite(last_dt) else t1 - t), checked)
        return [begin < t and may_jump(f, begin, t) for f in self.functions]

    def next_check(self, t: float) -> float:
        """Return the first time after ``t`` at which a rate may jump; -inf if it is unknown."""
        return min(next_kink(f, t) for f in self.functions)

    def find(
        self, q: Array, v: Array, t: float, counts: list[bool], state: State | None,
        excess: Excess | None = None, longest: float = math.inf,
    ) -> Impact | None:  # fmt: skip
        """Return the impact at ``t``, if velocities ``v`` contradict a constraint that ``counts``.

        Args:
            q: Configuration.
            v: Velocities before the impact.
            t: Time; s.
            counts: See :meth:`at_start` and :meth:`after`.
            state: Internal variables; None if those of the equation are up to date.
            excess: See :data:`Excess`.
            longest: See :func:`rate_after`; infinite at the start of a run.
        """
        if not any(counts) and excess is None:
            return None
        pairs = np.array([rate_after(f, t, longest) for f in self.functions]).reshape(-1, 2)
        (wanted, sizes), G, M = pairs.T, self._gradients(q, t, state), self._masses
        now, masses, scales = G @ v, M.diagonal(), self._equation.subdomain.numbering.scales
        fastest = np.abs(v * scales).max(initial=0.0)
        speeds = np.divide(fastest, scales, out=np.zeros(len(v)), where=scales > 0)
        error = STEP_ERROR if math.isfinite(longest) else 0.0
        slack = ROUND_OFF * (abs(G) @ speeds) + error * np.abs(now)
        slack += max(ROUND_OFF, error) * (sizes + np.abs(wanted))
        if excess is None and not (np.array(counts) & (np.abs(now - wanted) > slack)).any():
            return None
        momentum, energy = excess or (np.zeros(len(v)), 0.0)
        # Supports prescribe some velocities.  The others, in the plane P, are scaled by D.
        E, G, missing = G[: len(self.held)], G[len(self.held) :], wanted - now
        P, given = eye_array(len(v)) - E.T @ E, E.T @ missing[: len(self.held)]
        # Unknowns without mass get so little that the others do not notice.
        light = 1e-9 * float(masses[masses > 0].min(initial=1e9))
        D = diags_array(np.where(masses > 0, masses, light) ** -0.5)
        own = D @ (P @ M @ P + E.T @ E + diags_array((masses <= 0) * light)) @ D
        B = csr_array(G @ P @ D)
        norms = np.sqrt(B.power(2).sum(axis=1))
        norms[norms == 0.0] = math.inf  # only supports move these places
        B = diags_array(1 / norms) @ B
        soft = -1e-15 * eye_array(len(norms))  # constraints may depend on each other
        right = D @ (P @ (momentum - M @ given)), (missing[len(self.held) :] - G @ given) / norms
        x = splu(csc_array(block_array([[own, B.T], [B, soft]]))).solve(np.concatenate(right))
        change, impulses = given + P @ (D @ x[: len(v)]), -x[len(v) :] / norms
        of_supports = E @ (M @ change - momentum - G.T @ impulses)
        works, after = np.append(of_supports, impulses) * wanted, v + change
        kinetic = (v @ (M @ v) - after @ (M @ after)) / 2 + v @ momentum + energy
        return Impact(after, works, float(kinetic + works.sum()))

    @cached_property
    def _masses(self) -> csr_array:
        assert self._equation.inertia is not None
        M = self._equation.inertia.M
        return csr_array((M.data, M.indices, M.indptr), shape=(M.size, M.size))

    def enter(self, impact: Impact, ledger: Any, groups: Iterable[Any], share: float = 1.0) -> None:
        """Enter the ``share`` of an impact in a ledger.

        Each of ``groups`` has indices of connectors and the works that they have taken.
        """
        of_supports, of_motors = np.split(impact.works, [len(self.held)])
        for name, works in (("supports", of_supports), ("motors", of_motors)):
            if works.any():
                ledger.supplied[name] += share * float(works.sum())
        ledger.lost["impacts"] += share * impact.lost
        taken = np.zeros(len(self._equation.subdomain.numbering.multipliers))
        taken[self.connectors] = -of_motors
        for indices, works in groups:
            works += taken[indices]
