# SPDX-License-Identifier: MIT
"""Diagnosis of failed steps, open ledgers and wrong signs: forces, what gives way, round-off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from mpi4py import MPI

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.errors import ArgumentError, ConvergenceError, ModelError, NoNumber, StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.connector_law import ENTRIES, ConnectorLaw, judges_loss
from ufl_beam.model.connector_laws import (
    Coulomb,
    Damper,
    ForceLaw,
    Spring,
    Stop,
)
from ufl_beam.model.constraint_checks import INSTEAD
from ufl_beam.model.material_law import MaterialLaw, has_quadratic_energies, judges_dissipation
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.output.state_rows import DISSIPATED, HINGE, PLASTIC, WORK
from ufl_beam.output.states import States
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.factorization import Factorisation
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.null_vectors import SINGULAR, free_matrix, null_vectors
from ufl_beam.terms.term import KINDS

SHARE = 0.1
"""Least motion or deformation that is named, as a part of the largest motion."""

SOFT = 1e-3
"""Largest stiffness of a connector or a cell that gives way, as a part of its elastic one."""

NEAR = 1e-3
"""Motion from the beginning of a step, in sizes of the scene or radians, after which the tangent
tells what yields as the step begins."""

NOT_HELD = (
    "Loads can hold it where they balance, as a weight below its hinge, and there is no such state "
    f"near that in which the run begins. Begin there. {INSTEAD}. In the first step: "
)
"""What is said of a run of statics whose first step fails where a motion without strain is free."""

WEAK = 0.1
"""Part of the least stiffness in the first state that is left near a limit load: the root of 1/4096
where it is as far away as the smallest part of a step."""

ROOM = 10.0
"""Largest imbalance of an exact ledger over the tolerance of the solver."""

NAMED = 3
"""Largest number of names in a list."""


class Deformed(NamedTuple):
    """Connectors, or cells, that deform in a motion."""

    soft: Index  # numbers of those that have given way, the largest first
    stiff: bool  # True if one deforms that has its stiffness


def no_equilibrium(
    equation: StepEquation,
    newton: Solver,
    solution: Solution,
    failure: StepFailed,
    q0: Array,
    times: tuple[float, float],
    advice: str,
    loose: str,
) -> ConvergenceError | ArgumentError:
    """Describe why even the smallest step, from ``q0``, failed; all processes call it together.

    In the first step a motion without strain may be ``loose``, which no equilibrium has held yet.
    """
    if loose:
        return ModelError(f"{loose}{NOT_HELD}{failure}")
    (t, end), named = times, solution.parameter
    q1 = equation.supports.in_plane(newton.unknowns.copy())
    vectors = {kind: np.zeros(equation.share.size) for kind in KINDS}
    for term in equation.terms:
        try:
            term.add_residual(q1, vectors[term.kind])
        except Exception:
            vectors[term.kind].fill(np.nan)  # it is why the step has failed
    forces = {kind: size for kind, force in vectors.items() if (size := newton.size(force))}
    sizes = ", ".join(f"{kind} {size:.1e} N" for kind, size in forces.items())
    where = f"at {named.at(t, '.9g')}"
    if end != t:
        where = f"after {named.at(t, '.9g')}, even with {named.over(end - t)}"
    why = ""
    if not isinstance(failure, NoNumber):  # where a function has no value there is no tangent
        near = _near(equation, q0, q1)
        why = _singularity(equation, q1)
        # If the latest tangent says nothing, Newton's method may have been sent far away by a
        # tangent before it.  Then one near the beginning of the step tells.
        if not why and near is not q0 and equation.respond_at(near):
            why = _singularity(equation, near)
        why = why or _near_limit(equation, solution, q0, near)
    said = f"{failure} ({sizes})" if sizes else str(failure)
    return ConvergenceError(
        f"no equilibrium {where}: {why}{'; ' if why else ''}{said}. {advice}", time=t, dt=end - t,
        solution=solution, residuals=failure.residuals, forces=forces, reason=failure.reason,
    )  # fmt: skip


def _near_limit(equation: StepEquation, solution: Solution, q0: Array, near: Array) -> str:
    """Say that a limit load or bifurcation is near the state ``q0`` of a static run; else empty.

    There the least stiffness is a small part of that in the first state, or the tangent has other
    signs, perhaps only a little beyond, ``near`` it, where what yields has less stiffness.
    """
    if not len(equation.force) or not len(solution):
        return ""
    signs, least = [], []
    for q in (solution.q[0][equation.share.dofs], q0, near):
        if not np.isfinite(q).all() or not equation.respond_at(q):
            return ""
        K, free = free_matrix(equation.share, equation.A, equation.supports.dofs)
        if not len(free):
            return ""
        try:
            signs.append(Factorisation(csr_array(K)).negative)
            least.append(null_vectors(K)[0][-1])
        except (np.linalg.LinAlgError, RuntimeError):
            return ""
    if len(set(signs)) == 1 and least[1] > WEAK * least[0]:
        return ""
    return (
        "a limit load or a bifurcation is near, where the tangent stiffness is singular; follow "
        "the path through it with ub.follow(scene, ub.ArcLength(...))"
    )


def _near(equation: StepEquation, q0: Array, q1: Array) -> Array:
    """A state on the way from ``q0`` to ``q1``, at most :data:`NEAR` away."""
    share = equation.share
    way = np.abs(q1 - q0) * share.grid.scales[share.dofs]
    far = share.largest(float(way.max(initial=0.0)))
    return np.asarray(q0 + min(1.0, NEAR / far) * (q1 - q0)) if 0 < far < np.inf else q0


def _singularity(equation: StepEquation, q: Array) -> str:
    """Describe why the latest tangent, which is that at ``q``, is singular; empty if it is not."""
    grid, scene = equation.share.grid, equation.share.grid.scene
    K, free = free_matrix(equation.share, equation.A, equation.supports.dofs)
    if not len(free) or not np.isfinite(K.data).all():
        return ""
    try:
        sizes, vectors = null_vectors(K)
    except (np.linalg.LinAlgError, RuntimeError):
        return ""
    x: Array = np.zeros(grid.size)
    x[free], size = vectors[:, -1], sizes[-1]
    motions = np.abs(x) * grid.scales
    largest = float(motions.max())
    if not np.isfinite(largest):
        return ""
    if largest == 0.0:
        forces = np.abs(x[grid.multipliers])
        names = [str(scene.links[i]) for i in _named(forces / forces.max())]
        said = f"the tangent stiffness is singular: {_list(names)} hold the same motion twice"
        return said if size <= SINGULAR else ""
    x /= largest
    motions /= largest
    links, cells = _deformations(equation, q, x)
    said = _describe(grid, motions, links, cells)
    if size <= SINGULAR:
        return f"the tangent stiffness is singular: {said}"
    yields = len(links.soft) or len(cells.soft)
    mechanism = yields and not (links.stiff or cells.stiff)
    return f"a mechanism has formed: {said}" if mechanism else ""


def _deformations(equation: StepEquation, q: Array, x: Array) -> list[Deformed]:
    """Deformations of the connectors and of the cells in a motion from ``q``, all of them."""
    share, grid, scene = equation.share, equation.share.grid, equation.share.grid.scene
    here, ε = x[share.dofs], 1e-6
    links, left = np.zeros(len(scene.links)), np.ones(len(scene.links))
    for one in equation.couplings:
        try:
            change = (one.motion(q + ε * here) - one.motion(q - ε * here)) / (2 * ε)
        except StepFailed:
            continue  # a guide that ends has no motion there, which the failure of the step says
        links[one.numbers] = np.abs(change)
        left[one.numbers] = one.response.remaining()
    links /= np.where([link.turns for link in scene.links], 1.0, scene.size)
    # Strains of a small motion, times lengths of cells; (num_cells, 3); m, m, rad
    first, last = grid.cells[:, 0], grid.cells[:, 1]
    position, motion = grid.points + share.gather(q)[grid.dofs[:, :2]], x[grid.dofs]
    d = position[last] - position[first]
    across = np.column_stack([-d[:, 1], d[:, 0]])
    change = motion[last] - motion[first]
    ψ = (motion[first, 2] + motion[last, 2]) / 2
    apart = change[:, :2] - ψ[:, None] * across
    length = np.linalg.norm(d, axis=1)
    along, shear = (np.sum(apart * axis, axis=1) / length for axis in (d, across))
    strains = np.column_stack([along, shear, change[:, 2]])
    left_of_cells = np.ones(len(grid.cells))
    for beams in equation.inelastic:
        cells, _ = beams.kept()
        left_of_cells[cells] = beams.points.remaining(strains[cells])
    if share.comm.size > 1:
        share.comm.Allreduce(MPI.IN_PLACE, links)
        share.comm.Allreduce(MPI.IN_PLACE, left, op=MPI.MIN)
        share.comm.Allreduce(MPI.IN_PLACE, left_of_cells, op=MPI.MIN)
    strains[:, :2] /= scene.size
    sizes = np.abs(strains).max(axis=1, initial=0.0)
    found = []
    for deformed, remaining in ((links, left), (sizes, left_of_cells)):
        soft = remaining <= SOFT
        stiff = bool((deformed[~soft] >= SHARE).any())
        found.append(Deformed(_named(np.where(soft, deformed, 0.0)), stiff))
    return found


def _describe(grid: Grid, motions: Array, links: Deformed, cells: Deformed) -> str:
    """Words for a motion that meets no force; ``motions`` are the sizes of its parts."""
    alike = np.round(motions, 6)  # the order of equal ones must not be that of their round-off
    parts = []
    for words in grid.worst(np.where(alike >= 1 / 2, alike, 0.0)):
        component, _, place = words.partition(" of ")
        what = "rotation" if component == "psi" else f"displacement {component}"
        parts.append(f"the {what} of {place}")
    if cells.stiff:
        return (
            f"the forces no longer resist a motion that is largest in {_list(parts)}, as at a "
            "limit load or a bifurcation"
        )
    said = f"{_list(parts)} {'is' if len(parts) == 1 else 'are'} held by nothing"
    ways = [str(grid.scene.links[i]) for i in links.soft]
    ways += [grid.describe_cell(i) for i in cells.soft]
    if ways:
        give = "gives way" if len(ways) == 1 else "give way together"
        said += f"; {_list(ways)} {give} at no further force"
    layouts = (grid.scene.beams[grid.beam_of_cell[i]].section.layout(None) for i in cells.soft)
    laws = (law for layout in layouts if layout is not None for law, _ in layout.laws)
    perfect = any(isinstance(law, ElastoPlastic) and law.bounded and law.opens for law in laws)
    if len(cells.soft) > 1 and perfect:
        said += (
            "; if they are in a row, nothing tells which of them flows: let the law harden a "
            "little, as ElastoPlastic(limit, modulus) with a millionth of the stiffness"
        )
    return said


def _named(sizes: Array) -> Index:
    """The largest of those that are large enough to be named."""
    order = np.argsort(-sizes, kind="stable")
    return order[sizes[order] >= SHARE]


def _list(names: list[str]) -> str:
    """Names in a sentence, the first ones of many."""
    names, more = names[:NAMED], len(names) - NAMED
    if more > 0:
        return f"{', '.join(names)} and {more} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


# -- signs in the ledger of a run ------------------------------------------------------------------

STATES = 100
"""Number of successive steps in which numerical losses are added."""

TURNOVER = 5.0
"""Numerical loss in so many steps, over the largest energy in the scene meanwhile, that is wrong.

A motion that steps resolve loses a small part of its energy in each.
"""

LITTLE = 1e-6
"""Numerical loss that does not matter, as a part of the energy that went through."""


class LedgerWatch:
    """Judges the kept states of a run, each once.

    Args:
        grid: Its scene is watched.
        scheme: The time scheme.
        claimed: Part of the energy that went through by which entries may err.

    Attributes:
        judged: Number of the last state that was judged; all are if states were thinned.
    """

    def __init__(self, grid: Grid, scheme: Scheme, claimed: float) -> None:
        self._grid, self._claimed = grid, claimed
        links, laws = grid.scene.links, list[MaterialLaw]()  # of material points
        for beam in grid.scene.beams:
            layout = beam.section.layout(beam.section.hinge)
            if layout is not None and not layout.elastic:
                laws += [law for law, _ in layout.laws]
        springs = [link.law.law for link in links if isinstance(link.law, Spring)]
        laws += [law for law in springs if law is not None]
        grows = {"hinges": True, "plastic": all(map(judges_dissipation, laws))}
        # Other schemes integrate works with the mean of the forces at both ends.
        exact = grows["friction"] = grows["damping"] = scheme.weight_of_before == 0.0
        at_once = scheme.theta == scheme.load_weight  # elastic forces and variables
        stated = [link.law for link in links if isinstance(link.law, ConnectorLaw)]
        for law in stated:
            certain = exact and (at_once or not law.variables) and judges_loss(law)
            grows[law.entry] = grows.get(law.entry, exact) and certain
        self._grows = [name for name, certain in grows.items() if certain]
        given = any(isinstance(link.law, ForceLaw) and link.law.stored for link in links)
        given = given or not all(isinstance(law, Stop) for law in stated)
        self._bounded = not given and all(map(has_quadratic_energies, laws))
        self._in_motion = has_inertia(scheme)
        self._throughput = self._most = 0.0
        self.judged = 0
        self._told: set[str] = set()

    def judge(self, states: States, every: int, *, last: bool = False) -> Iterator[str]:
        """Judge what was kept since the last call, if it is enough or the ``last``.

        ``every`` is the number of steps from one state to the next.  Yields warnings, of each kind
        the first.
        """
        number = len(states) - 1 - self.judged
        number -= 0 if last else number % STATES
        if number <= 0:
            return
        states = states.part(self.judged, self.judged + number + 1)
        self.judged += number
        times, (state, supplied, lost) = states.times, states.ledger()
        works = sum(float(np.abs(np.diff(work)).sum()) for work in supplied.values())
        sizes = [e if name in ENTRIES else np.abs(e - e[0]) for name, e in state.items()]
        held = np.asarray(sum(sizes, 0.0 * times))
        self._throughput += works + max(float(np.max(held)) - self._most, 0.0)
        self._most = max(self._most, float(np.max(held)))
        allowed = self._claimed * self._throughput
        for name in self._grows:
            if name in lost and name not in self._told:
                falls = -np.diff(lost[name])
                n = int(np.argmax(falls))
                if falls[n] > allowed:
                    self._told.add(name)
                    before, after = times[n : n + 2]
                    yield (
                        f"{self._where(name, states, n)}the dissipated energy, the entry {name!r} "
                        f"of the ledger, falls by {falls[n]:.3g} J between t = {before:.6g} and "
                        f"{after:.6g} s. No law of the scene gives dissipated energy back: a step "
                        "found a wrong state there, and what follows is wrong. Use smaller steps; "
                        "check the equations of a law of your own, or let one that is to give "
                        "energy have active = True"
                    )
        least = float(np.min(state["stored"])) if "stored" in state and self._bounded else 0.0
        if least < -allowed and "stored" not in self._told:
            self._told.add("stored")
            t = times[int(np.argmin(state["stored"]))]
            yield (
                f"the stored energy is {least:.3g} J at t = {t:.6g} s, and a sum of squares is "
                "not negative: a law of material in the scene, or the step there, is wrong. Use "
                "smaller steps; check elastic_energy of a law of your own"
            )
        starts = np.arange(0, len(times) - STATES, STATES)
        if every > 1 or not self._in_motion or "numerical" not in lost or not len(starts):
            return
        losses = lost["numerical"][starts + STATES] - lost["numerical"][starts]
        most = np.maximum.reduceat(held, starts)
        wrong = losses > np.maximum(TURNOVER * most, LITTLE * self._throughput)
        if wrong.any() and "numerical" not in self._told:
            self._told.add("numerical")
            k = int(np.argmax(wrong))
            begin, end = times[starts[k]], times[starts[k] + STATES]
            yield (
                f"from t = {begin:.6g} to {end:.6g} s the time scheme took {losses[k]:.3g} J, the "
                f"entry 'numerical', {losses[k] / most[k]:.3g} times as much as the scene held at "
                f"most, in {STATES} steps. So most of the work that was supplied went into motions "
                "that are too fast for the steps, and results depend on the scheme. Use smaller "
                "steps, or smoother loads and supports; a controller that causes it needs another "
                "sample time, inertia at its place, or a ForceLaw instead"
            )

    def _where(self, name: str, states: States, n: int) -> str:
        """Cell or connector whose dissipated energy falls most in a step."""
        kind = {"friction": Coulomb, "damping": Damper}.get(name)
        falls: dict[str, float] = {}
        for i, link in enumerate(self._grid.scene.links):
            entry = link.law.entry if isinstance(link.law, ConnectorLaw) else ""
            if entry == name if entry else kind is None or isinstance(link.law, kind):
                column = WORK if kind and not entry else DISSIPATED
                taken = states.column("connectors")[:, i, column]
                falls[f"{link}: "] = taken[n] - taken[n + 1]
        if name in ("hinges", "plastic"):
            column = PLASTIC if name == "plastic" else HINGE
            before, after = (states.cells_of(k)[:, column] for k in (n, n + 1))
            cell = int(np.argmax(before - after))
            place = self._grid.middle(cell)
            fall = before[cell] - after[cell]
            falls[f"{place.beam.name}, cell at s = {place.s:.3g}: "] = float(fall)
        worst = max(falls, key=lambda one: falls[one], default="")
        return worst if worst and falls[worst] > 0.0 else ""
