# SPDX-License-Identifier: MIT
"""Plastic impacts: velocities that a new constraint, or a jump of a prescribed rate, contradicts.

Velocities change by the least kinetic energy that satisfies the constraints.  The impulse of a
constraint does the work of the rate after the impact; the kinetic energy of the change of the
velocities is lost (theorem of Carnot).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, vstack
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.state_io import Archive, State
from ufl_beam.discretization.state_transfer import ROUND_OFF, Excess, geometry
from ufl_beam.mechanics.time_scheme import Scheme, Step, has_inertia, stages_of
from ufl_beam.model.connector_laws import HOLDING, RIGID, PrescribedMotion
from ufl_beam.model.functions import WEIGHTS, Constant, Table, TimeFunction
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.initial_state import same_time
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StepEquation, equation_of_scene

PARTS = 8
"""Number of parts of a step in which a function is sampled to find a kink."""

UNEVEN = 16.0
"""Ratio of the largest second difference to the third smallest one that shows a kink."""

STEP_ERROR = 1e-3
"""Largest velocity along a constraint that does not contradict it within a run, relative to the
rate of the constraint; in addition to :data:`ROUND_OFF`."""


def motion_of(law: object) -> TimeFunction | None:
    """Return the motion that the law of a motor prescribes; None for other laws."""
    return law.motion if isinstance(law, PrescribedMotion) and law is not RIGID else None


def motions_of(scene: Scene) -> list[TimeFunction]:
    """Return the motions that the supports and motors of a scene prescribe."""
    motions = [motion_of(connector.law) for connector in scene.all_connectors]
    motions += [motion for support in scene.supports for motion in support.moving.values()]
    return [motion for motion in motions if motion is not None]


def rate_after(f: TimeFunction, t: float, longest: float) -> tuple[float, float]:
    """Return the right derivative of ``f`` at ``t``, and the largest mean rate soon after ``t``.

    One-sided differences of fourth order with shorter and shorter steps are compared; those that
    differ least are the result.  The steps are powers of two, so that times are exact.
    """
    rates, largest = [0.0], 0.0
    first = 2.0 ** math.floor(math.log2(min(longest, 2.0**-8)))
    for h in (first / 4**k for k in range(10) if first / 4**k > 16 * math.ulp(t)):
        with suppress(Exception):  # a function of a user may end soon after t
            values = np.array([float(f(t + i * h)) for i in range(5)])
            if np.isfinite(values).all():
                rates.append(float(WEIGHTS[0] @ values) / h)
                largest = max(largest, float(np.abs(values - values[0]).max()) / h)
    changes = np.abs(np.diff(rates[1:]))
    return rates[2 + int(np.argmin(changes))] if len(changes) else rates[-1], largest


def next_kink(f: TimeFunction | None, t: float) -> float:
    """Return the first time after ``t`` at which the rate of ``f`` may jump; -inf if unknown."""
    if isinstance(f, Table):
        return next(iter(f.times[bisect_right(f.times, t) :]), math.inf)
    return math.inf if f is None or isinstance(f, Constant) else -math.inf


def may_jump(f: TimeFunction | None, t0: float, t1: float) -> bool:
    """Return whether the rate of ``f`` may jump between ``t0``, excluded, and ``t1``, included."""
    h = (t1 - t0) / PARTS
    if f is None or (kink := next_kink(f, t0 + 1e-8 * h)) != -math.inf:
        return f is not None and kink <= t1 + 1e-8 * h
    try:
        values = [float(f(t0 + i * h)) for i in range(PARTS)] + [float(f(t1)), float(f(t1 + h))]
    except Exception:  # a function of a user may end soon after t1
        return False
    triples = zip(values, values[1:], values[2:], strict=False)  # each step: faster than NumPy
    second = sorted(abs(x - 2.0 * y + z) for x, y, z in triples)
    if second[-1] <= UNEVEN * second[2] + 16 * math.ulp(max(map(abs, values))):
        return False
    outside = [0.0]  # as large if only an acceleration begins or ends in the step
    for t in (t0 - h, t1 + h):
        with suppress(Exception):
            outside.append(abs(float(f(t - h)) - 2.0 * float(f(t)) + float(f(t + h))))
    return bool(second[-1] > 2.0 * max(outside))


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
        moves: Whether a constraint has a function of time.
    """

    def __init__(self, equation: StepEquation) -> None:
        self._equation, self._held = equation, equation.supports.dofs
        terms = equation.connector_terms
        self._terms = [term for term in terms if isinstance(term.law, HOLDING)]
        motions = {dof: motion for dof, motion, _ in equation.supports.motions}
        connectors = [c for term in self._terms for c in term.connectors]
        self._functions = [motions.get(int(dof)) for dof in self._held]
        self._functions += [motion_of(connector.law) for connector in connectors]
        self.moves = any(f is not None for f in self._functions)
        # Supports and motors are the same as in another scene if they have the same function.
        fixed = [None] * len(self._held) + [geometry(connector) for connector in connectors]
        pairs = zip(self._functions, fixed, strict=True)
        self._keys = [key if f is None else id(f) for f, key in pairs]

    def _gradients(self, q: Array, t: float, state: State) -> csr_array:
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
        forces = [dof for term in self._terms for dof in term.forces_at]
        of_connectors = A.sparse()[np.array(forces, dtype=int)]
        A.data[:] = before
        units = csr_array(eye_array(A.size, format="csr")[self._held])
        if equation.supports.turned:
            units = csr_array(np.array([*map(equation.supports.in_plane, units.toarray())]))
        return csr_array(vstack([units, of_connectors]))

    def at_start(self, t: float, start: Solution | None) -> list[bool]:
        """Return which constraints may be contradicted when a run begins at ``t``.

        After ``start``, a dynamic run of another scene or to another time, these are constraints
        that its scene does not have; otherwise, motions that are prescribed.
        """
        if start is None:
            return [f is not None for f in self._functions]
        connectors = start.scene.all_connectors
        known: set[object] = {geometry(c) for c in connectors if motion_of(c.law) is None}
        if same_time(start, t):
            known.update(map(id, motions_of(start.scene)))
        return [key not in known for key in self._keys]

    def after(self, last_dt: float, t: float, t1: float) -> list[bool]:
        """Return which rates may have jumped in a step to ``t``, whose last stage took ``last_dt``.

        Before the first step, ``last_dt`` is infinite; the step is then as long as the next one, to
        ``t1``.
        """
        part = stages_of(self._equation.scheme)[-1]
        begin = t - (last_dt / part if math.isfinite(last_dt) else t1 - t)
        return [may_jump(f, begin, t) for f in self._functions]

    def next_check(self, t: float) -> float:
        """Return the first time after ``t`` at which a rate may jump; -inf if it is unknown."""
        return min(next_kink(f, t) for f in self._functions)

    def find(
        self, q: Array, v: Array, t: float, counts: list[bool], state: State,
        excess: Excess | None = None, longest: float = math.inf,
    ) -> Impact | None:  # fmt: skip
        """Return the impact at ``t``, if velocities ``v`` contradict a constraint that ``counts``.

        The internal variables ``state`` are empty if those of the equation are up to date.
        ``longest`` is an argument of :func:`rate_after`, infinite at the start of a run.
        """
        if not any(counts) and excess is None:
            return None
        pairs = [(0.0, 0.0) if f is None else rate_after(f, t, longest) for f in self._functions]
        wanted, sizes = np.reshape(pairs, (-1, 2)).T
        assert self._equation.inertia is not None
        G, M = self._gradients(q, t, state), self._equation.inertia.M.sparse()
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
        E, G, missing = G[: len(self._held)], G[len(self._held) :], wanted - now
        P, given = eye_array(len(v)) - E.T @ E, E.T @ missing[: len(self._held)]
        # Unknowns without mass get so little that the others do not notice.
        light = 1e-9 * float(masses[masses > 0].min(initial=1e9))
        D = diags_array(np.where(masses > 0, masses, light) ** -0.5)
        own = D @ (P @ M @ P + E.T @ E + diags_array((masses <= 0) * light)) @ D
        B = csr_array(G @ P @ D)
        norms = np.sqrt(B.power(2).sum(axis=1))
        norms[norms == 0.0] = math.inf  # only supports move these places
        B = diags_array(1 / norms) @ B
        soft = -1e-15 * eye_array(len(norms))  # constraints may depend on each other
        right = D @ (P @ (momentum - M @ given)), (missing[len(self._held) :] - G @ given) / norms
        x = splu(csc_array(block_array([[own, B.T], [B, soft]]))).solve(np.concatenate(right))
        change, impulses = given + P @ (D @ x[: len(v)]), -x[len(v) :] / norms
        of_supports = E @ (M @ change - momentum - G.T @ impulses)
        works, after = np.append(of_supports, impulses) * wanted, v + change
        kinetic = (v @ (M @ v) - after @ (M @ after)) / 2 + v @ momentum + energy
        return Impact(after, works, float(kinetic + works.sum()))

    def enter(self, impact: Impact, ledger: Any, groups: Iterable[Any], share: float = 1.0) -> None:
        """Enter the ``share`` of an impact in a ledger.

        Each of ``groups`` has indices of connectors and the works that they have taken.
        """
        of_supports, of_motors = np.split(impact.works, [len(self._held)])
        for name, works in (("supports", of_supports), ("motors", of_motors)):
            if works.any():
                ledger.supplied[name] += share * float(works.sum())
        ledger.lost["impacts"] += share * impact.lost
        taken = np.zeros(len(self._equation.subdomain.numbering.multipliers))
        taken[[i for term in self._terms for i in term.indices]] = -of_motors
        for indices, works in groups:
            works += taken[indices]


def impacts_of(
    numbering: DofNumbering, scheme: Scheme, t: float, start: Solution | None, same: bool,
    state: tuple[Array, Array, State, Excess | None], equation: StepEquation | None = None,
) -> tuple[Impacts | None, Impact | None]:  # fmt: skip
    """Return the impacts of a run, and the one with which it begins at ``t``; None without impacts.

    The run begins with the ``state`` of :func:`initial_state`; whether this is the ``same`` time
    and scene as at the end of ``start``, see :func:`continuation`.  ``equation`` is the equation of
    the whole scene on one process, if there is one already.
    """
    dynamic = start is not None and len(start.v) > 0
    if not has_inertia(scheme) or not (motions_of(numbering.scene) or (dynamic and not same)):
        return None, None
    equation = equation or equation_of_scene(numbering, scheme, t)
    impacts, (q, v, internal, excess) = Impacts(equation), state
    if dynamic and same:
        return impacts, None
    if not dynamic:
        equation.supports.stop(v)
    counts = impacts.at_start(t, start if dynamic else None)
    return impacts, impacts.find(q, v, t, counts, internal, excess)
