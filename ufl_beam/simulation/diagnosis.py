# SPDX-License-Identifier: MIT
"""Diagnosis of failed steps, open ledgers and wrong signs: forces, what gives way, round-off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import ConvergenceError, NoNumber, SceneError, StepFailed
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
from ufl_beam.model.material_laws import Hardening
from ufl_beam.model.scene import Scene
from ufl_beam.output.state_rows import DISSIPATED, HINGE, PLASTIC, WORK
from ufl_beam.output.states import States
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.factorization import Factorisation
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.null_vectors import SINGULAR, free_matrix, null_vectors
from ufl_beam.terms.base import KINDS
from ufl_beam.terms.beams import InelasticBeams
from ufl_beam.terms.connectors import Links

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
    """Connectors, or cells, in a motion: sizes of their deformations, and which have given way."""

    sizes: Array
    yielding: npt.NDArray[np.bool_]

    @property
    def stiff(self) -> bool:
        """True if one deforms that has its stiffness."""
        return bool((self.sizes[~self.yielding] >= SHARE).any())

    @property
    def soft(self) -> Index:
        """Numbers of those that have given way, the largest first."""
        return _named(np.where(self.yielding, self.sizes, 0.0))


def no_equilibrium(
    equation: StepEquation,
    newton: Solver,
    solution: Solution,
    failure: StepFailed,
    q0: Array,
    times: tuple[float, float],
    advice: str,
    loose: str,
) -> ConvergenceError | SceneError:
    """Describe why even the smallest step, from ``q0``, failed; all processes call it together.

    In the first step a motion without strain may be ``loose``, which no equilibrium has held yet.
    """
    if loose:
        return SceneError(f"{loose}{NOT_HELD}{failure}")
    (t, end), named = times, solution.parameter
    q1 = equation.supports.in_plane(newton.unknowns.copy())
    forces = _forces_by_kind(equation, newton, q1)
    sizes = ", ".join(f"{kind} {size:.1e} N" for kind, size in forces.items())
    where = f"at {named.at(t, '.9g')}"
    if end != t:
        where = f"after {named.at(t, '.9g')}, even with {named.over(end - t)}"
    # Where a function has no value there is no tangent to look at.
    why, at = "", (solution, q0, q1)
    if not isinstance(failure, NoNumber):
        why = _singularity(equation, solution.grid, q0, q1) or _near_limit(equation, *at)
    said = f"{failure} ({sizes})" if sizes else str(failure)
    return ConvergenceError(
        f"no equilibrium {where}: {why}{'; ' if why else ''}{said}. {advice}", time=t, dt=end - t,
        solution=solution, residuals=failure.residuals, forces=forces, reason=failure.reason,
    )  # fmt: skip


def open_ledger(solution: Solution, share: Share, newton: Solver) -> str:
    """Describe how far an exact ledger is open; empty if it closes as claimed."""
    energy, claimed = solution.energy, ROOM * newton.c.rtol
    if not energy.opened(claimed, 0.0):
        return ""
    # Errors of steps are independent: their squares add up.
    q = solution.q[:, share.dofs]
    steps = np.sqrt(np.sum(np.diff(q, axis=0) ** 2, axis=0))
    return energy.opened(claimed, newton.random_work(np.abs(q).max(axis=0), steps))


def _forces_by_kind(equation: StepEquation, newton: Solver, q1: Array) -> dict[str, float]:
    """Sizes of the forces at the latest iterate; N."""
    forces = {kind: np.zeros(equation.share.size) for kind in KINDS}
    for term in equation.terms:
        try:
            term.add_residual(q1, forces[term.kind])
        except Exception:
            forces[term.kind].fill(np.nan)  # it is why the step has failed
    sizes = {kind: newton.size(force) for kind, force in forces.items()}
    return {kind: size for kind, size in sizes.items() if size}


def _singularity(equation: StepEquation, grid: Grid, q0: Array, q1: Array) -> str:
    """Describe why the tangent of a failed step is singular, or nearly so; else empty.

    Where the latest tangent, at ``q1``, says nothing, Newton's method may have been sent far away
    by a tangent before it.  Then one near the beginning ``q0`` of the step tells.
    """
    if said := _singularity_at(equation, grid, q1):
        return said
    near = _near(equation, q0, q1)
    if near is q0 or not equation.respond_at(near):
        return ""
    return _singularity_at(equation, grid, near)


def _near_limit(equation: StepEquation, solution: Solution, q0: Array, q1: Array) -> str:
    """Say that a limit load or bifurcation is near the state ``q0`` of a static run; else empty.

    There the least stiffness is a small part of that in the first state, or the tangent has other
    signs, perhaps only a little beyond, where what yields has less stiffness.
    """
    if not len(equation.force) or not len(solution):
        return ""
    signs, least = [], []
    for q in (solution.q[0][equation.share.dofs], q0, _near(equation, q0, q1)):
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
    share, size = equation.share, equation.share.grid.scene.size
    way = np.abs(q1 - q0)
    way[share.multipliers] = 0.0
    way[share.rotations] *= size
    far = share.largest(float(way.max(initial=0.0))) / size
    return np.asarray(q0 + min(1.0, NEAR / far) * (q1 - q0)) if 0 < far < np.inf else q0


def _singularity_at(equation: StepEquation, grid: Grid, q: Array) -> str:
    """Describe why the latest tangent, which is that at ``q``, is singular; empty if it is not."""
    scene = grid.scene
    K, free = free_matrix(equation.share, equation.A, equation.supports.dofs)
    if not len(free) or not np.isfinite(K.data).all():
        return ""
    try:
        sizes, vectors = null_vectors(K)
    except (np.linalg.LinAlgError, RuntimeError):
        return ""
    x: Array = np.zeros(grid.size)
    x[free], size = vectors[:, -1], sizes[-1]
    motions = np.abs(x)
    turns = np.zeros(grid.size, dtype=bool)
    turns[grid.rotations] = True
    motions[~turns] /= scene.size
    motions[grid.multipliers] = 0.0
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
    links, cells = _deformations(equation, grid, q, x)
    said = _describe(grid, motions, links, cells)
    if size <= SINGULAR:
        return f"the tangent stiffness is singular: {said}"
    yields = links.yielding.any() or cells.yielding.any()
    mechanism = yields and not (links.stiff or cells.stiff)
    return f"a mechanism has formed: {said}" if mechanism else ""


def _deformations(
    equation: StepEquation, grid: Grid, q: Array, x: Array
) -> tuple[Deformed, Deformed]:
    """Deformations of the connectors and of the cells in a motion from ``q``, all of them."""
    share, scene = equation.share, grid.scene
    here, ε = x[share.dofs], 1e-6
    links, left = np.zeros(len(scene.links)), np.ones(len(scene.links))
    for one in (term for term in equation.terms if isinstance(term, Links)):
        try:
            change = (one.motion(q + ε * here) - one.motion(q - ε * here)) / (2 * ε)
        except StepFailed:
            continue  # a guide that ends has no motion there, which the failure of the step says
        links[one.numbers] = np.abs(change)
        left[one.numbers] = one.response.remaining()
    links /= np.where([link.turns for link in scene.links], 1.0, scene.size)
    strains, left_of_cells = _strains(grid, share.gather(q), x), np.ones(len(grid.cells))
    for beams in (term for term in equation.terms if isinstance(term, InelasticBeams)):
        cells, _ = beams.kept()
        left_of_cells[cells] = beams.points.remaining(strains[cells])
    if share.comm.size > 1:
        share.comm.Allreduce(MPI.IN_PLACE, links)
        share.comm.Allreduce(MPI.IN_PLACE, left, op=MPI.MIN)
        share.comm.Allreduce(MPI.IN_PLACE, left_of_cells, op=MPI.MIN)
    strains[:, :2] /= scene.size
    sizes = np.abs(strains).max(axis=1, initial=0.0)
    soft, soft_cells = left <= SOFT, left_of_cells <= SOFT
    return Deformed(links, soft & (links >= SHARE)), Deformed(sizes, soft_cells & (sizes >= SHARE))


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
    perfect = any(isinstance(law, Hardening) and law.bounded and law.opens for law in laws)
    if len(cells.soft) > 1 and perfect:
        said += (
            "; if they are in a row, nothing tells which of them flows: let the law harden a "
            "little, as Hardening(limit, modulus) with a millionth of the stiffness"
        )
    return said


def _strains(grid: Grid, q: Array, x: Array) -> Array:
    """Strains of a small motion ``x``, times lengths of cells; (num_cells, 3); m, m, rad."""
    first, last = grid.cells[:, 0], grid.cells[:, 1]
    position, motion = grid.points + q[grid.dofs[:, :2]], x[grid.dofs]
    d = position[last] - position[first]
    across = np.column_stack([-d[:, 1], d[:, 0]])
    change = motion[last] - motion[first]
    ψ = (motion[first, 2] + motion[last, 2]) / 2
    apart = change[:, :2] - ψ[:, None] * across
    length = np.linalg.norm(d, axis=1)
    along, shear = (np.sum(apart * axis, axis=1) / length for axis in (d, across))
    return np.column_stack([along, shear, change[:, 2]])


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
    """

    def __init__(self, grid: Grid, scheme: Scheme, claimed: float) -> None:
        self._grid, self._claimed = grid, claimed
        laws, links = [*_laws(grid.scene)], grid.scene.links
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
        self._judged = 0  # number of the last state that was judged
        self._told: set[str] = set()

    def judge(self, states: States, every: int, *, last: bool = False) -> Iterator[str]:
        """Judge what was kept since the last call, if it is enough or the ``last``.

        ``every`` is the number of steps from one state to the next.  Yields warnings, of each kind
        the first.
        """
        number = len(states) - 1 - self._judged
        number -= 0 if last else number % STATES
        if number > 0:
            first, self._judged = self._judged, self._judged + number
            yield from self._judge(states.part(first, self._judged + 1), every)

    def thinned(self, states: States) -> None:
        """Go on where states, which were all judged, have been forgotten."""
        self._judged = len(states) - 1

    def _judge(self, states: States, every: int) -> Iterator[str]:
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
                    yield self._falls(name, float(falls[n]), states, n)
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

    def _falls(self, name: str, fall: float, states: States, n: int) -> str:
        before, after = states.times[n : n + 2]
        return (
            f"{self._where(name, states, n)}the dissipated energy, the entry {name!r} of the "
            f"ledger, falls by {fall:.3g} J between t = {before:.6g} and {after:.6g} s. No law of "
            "the scene gives dissipated energy back: a step found a wrong state there, and what "
            "follows is wrong. Use smaller steps; check the equations of a law of your own, or let "
            "one that is to give energy have active = True"
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


def _laws(scene: Scene) -> Iterator[MaterialLaw]:
    """Laws of the material points of a scene."""
    for beam in scene.beams:
        layout = beam.section.layout(beam.section.hinge)
        if layout is not None and not layout.elastic:
            yield from (law for law, _ in layout.laws)
    springs = [link.law for link in scene.links if isinstance(link.law, Spring)]
    yield from (spring.law for spring in springs if spring.law is not None)
