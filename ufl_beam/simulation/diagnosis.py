# SPDX-License-Identifier: MIT
"""Diagnosis of failed steps (forces, mechanisms, limit loads) and check of the energy ledger."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

from mpi4py import MPI

import numpy as np
from scipy.sparse import csr_array, diags_array

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.cells_in_space import rotated, rotation_vectors, rotations_between
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.display import FACTOR
from ufl_beam.errors import (
    ArgumentError,
    ConvergenceError,
    ModelError,
    NoNumber,
    Reversal,
    StepFailed,
    warn,
)
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.connector_law import CONTRIBUTIONS, ConnectorLaw, loss_must_grow
from ufl_beam.model.connector_laws import Coulomb, Damper, ForceLaw, RigidPlastic, Spring, Stop
from ufl_beam.model.connectors import place_of
from ufl_beam.model.constraint_checks import INSTEAD
from ufl_beam.model.loads import Rayleigh, RotatingFrame
from ufl_beam.model.material_law import MaterialLaw, dissipation_must_grow, has_quadratic_energies
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.output.state_rows import DISSIPATED, HINGE, JUMP, PLASTIC, WORK
from ufl_beam.output.states import States
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.factorization import Factorization
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.null_vectors import SINGULAR, free_tangent, soft_motions
from ufl_beam.terms.term import KINDS

LEAST_NAMED = 0.1
"""Least deformation of a connector or cell that counts, relative to the largest nodal motion; also
the least force that a message names, relative to the largest force."""

SOFT = 1e-3
"""Stiffness up to which a connector or cell is soft, as a fraction of its elastic stiffness."""

YIELDED = 0.5  # the same fraction, up to which a message on a limit load names a connector or cell

PROBE_DISTANCE = 1e-3
"""Distance of the probe state from the initial state of a step; in sizes of the scene, or rad.  The
tangent in the probe state shows which material yields at the start of the step."""

FREE_MOTION = (
    "Loads can hold the scene only near an equilibrium, as a weight below its hinge, and the run "
    f"does not begin near one. Begin near an equilibrium. {INSTEAD}. In the first step: "
)
"""Text that follows the description of a motion without strain if the first static step fails."""

LIMIT_STIFFNESS = 0.1
"""Ratio of the least singular value of the tangent to its value in the first state, up to which a
limit load is near.

The ratio falls with the square root of the distance to the limit load.  A distance of 1/4096 of a
step, the smallest substep, gives 1/64; a tenth allows for larger distances."""

MOST_TURNED = 0.2
"""Largest change of a quaternion of a node, half of the angle in rad, with which the tangent of the
first state in space is known: unknowns of rotations refer to the present axes of the node."""

LEDGER_TOLERANCE = 10.0
"""Largest relative imbalance of a ledger that should be exact, as a multiple of ``Newton.rtol``."""

BENT_FAR = np.pi / 2
"""Rotations in space from which on an error of a run names a cell; rad."""

NAMED = 3  # largest number of names that a message lists

MOST_LISTED = 12
"""Largest number of connectors and cells that a message lists as parts of a mechanism."""


class Deformed(NamedTuple):
    """Connectors, or cells, that deform in a motion."""

    soft: Index  # indices of connectors or cells that are soft, the largest deformation first
    stiff: bool  # True if a connector or cell that is not soft deforms


def no_equilibrium(
    equation: StepEquation,
    newton: Solver,
    solution: Solution,
    failure: StepFailed,
    q0: Array,
    times: tuple[float, float],
    advice: str,
    free_motion: str,
) -> ConvergenceError | ArgumentError:
    """Return the error of a run whose smallest substep, from ``q0`` between ``times`` (s), failed.

    All processes call it together.  ``free_motion`` describes a motion without strain; it is empty
    if no such motion exists, or if loads resisted the motion in an earlier equilibrium.
    """
    if free_motion:
        return ModelError(f"{free_motion}{FREE_MOTION}{failure}")
    (t, end), named = times, solution.parameter
    q1 = equation.supports.in_plane(newton.unknowns.copy())
    vectors = {kind: np.zeros(equation.subdomain.size) for kind in KINDS}
    for term in equation.terms:
        try:
            term.add_residual(q1, vectors[term.kind])
        except Exception:
            vectors[term.kind].fill(np.nan)  # the exception is why the step has failed
    forces = {kind: size for kind, force in vectors.items() if (size := newton.size(force))}
    finite = ((kind, size) for kind, size in forces.items() if np.isfinite(size))
    sizes = ", ".join(f"{kind} {size:.1e} N" for kind, size in finite)
    where = f"at {named.at(t, '.9g')}"
    if end != t:
        where = f"after {named.at(t, '.9g')}, even with {named.step.format(end - t)}"
    why = ""
    if not isinstance(failure, NoNumber):  # without a value of a function there is no tangent
        probe = _probe_state(equation, q0, q1)
        why = _singularity(equation, q1)
        # If the latest tangent is regular, an earlier, nearly singular tangent may have caused the
        # failure.  So the tangent near the beginning of the step is examined, too.
        if not why and probe is not q0 and equation.evaluate(probe):
            why = _singularity(equation, probe)
        why = why or _limit_point(equation, solution, q0, probe)
    known = {
        "guided": "no nearest point was found on its guide curve",
        "turning": "in space it turns by 360° about an axis that is not its own, where the "
        "rotation vector has no direction",
    }
    lost = [
        f"{c.b if c.motion == 'guided' else c}: {known[c.motion]}"
        for c in equation.subdomain.numbering.scene.all_connectors
        if c.motion in known and not np.isfinite(failure.residuals.get(f"force of {c}", 0.0))
    ]
    reasons = [*lost, why, f"{failure} ({sizes})" if sizes else str(failure)]
    if isinstance(failure, Reversal):
        reasons.reverse()
    return ConvergenceError(
        f"no equilibrium {where}: {'; '.join(filter(None, reasons))}. {advice}", time=t,
        dt=end - t, solution=solution, residuals=failure.residuals, forces=forces,
        reason=failure.reason,
    )  # fmt: skip


def turned_far(now: States) -> str:
    """Return advice on a hinge or cell in space that has turned too far, or nothing."""
    numbering, turns = now.numbering, now.turns(0)
    first, second = turns[numbering.cells.T]
    angles = np.linalg.norm(rotations_between(first, second), axis=1)
    if max(angles, default=0.0) < BENT_FAR:
        return ""
    largest = int(angles.argmax())
    angle, jump = angles[largest], abs(now.cells_of(0)[largest, JUMP])
    cell = numbering.describe_cell(largest)
    if jump > angle / 2:
        return (
            f"The hinge in a cell, {cell}, has turned by {np.degrees(jump):.0f}°; a cell is too "
            "stiff about other axes beyond 90°, and cannot turn by 360°. Put the hinge between two "
            "nodes, Beam(hinges={s: law})"
        )
    return (
        f"A cell, {cell}, is bent or twisted by {np.degrees(angle):.0f}° between its nodes, where "
        "its strains are no approximation any more; give the beam more cells, or check its "
        "stiffness"
    )


def _limit_point(equation: StepEquation, solution: Solution, q0: Array, probe: Array) -> str:
    """Return a message if, in statics, a limit load or a bifurcation is near ``q0``; else "".

    The criteria are a least singular value of the tangent that is a small fraction of its value in
    the first state, unless nodes in space have turned far since, and a changed number of negative
    pivots, or sign of the determinant if a tangent is not symmetric.  The pivots are also counted
    at ``probe``, a little beyond ``q0``, where yielding has reduced the stiffness.  The message
    names connectors and cells that yield there and deform in the motion of least stiffness.
    """
    if not len(equation.force) or not len(solution):
        return ""
    negative, least, symmetric = [], [], True
    states, numbering = [solution.q[0][equation.subdomain.dofs], q0, probe], solution.numbering
    ends = [solution.turns(n) for n in (0, -1) if numbering.scene.in_space]
    if np.abs(np.diff(ends, axis=0)).max(initial=0.0) > MOST_TURNED:
        del states[0]
    for q in states:
        if not np.isfinite(q).all() or not equation.evaluate(q):
            return ""
        if (found := soft_motions(equation)) is None:
            return ""
        K, free, sizes, vectors = found
        try:
            factors = Factorization(csr_array(K))
        except (np.linalg.LinAlgError, RuntimeError):
            return ""
        negative.append(factors.negative)
        symmetric &= factors.symmetric
        least.append(sizes[-1])
    alike = len({n if symmetric else n % 2 for n in negative}) == 1
    if alike and least[-2] > LIMIT_STIFFNESS * least[0]:
        return ""
    x: Array = np.zeros(numbering.size)
    x[free] = vectors[:, -1]
    x /= np.abs(x * numbering.scales).max() or 1.0
    names = _names(numbering, *_deformations(equation, probe, x, YIELDED))
    verb = "yields or softens" if len(names) == 1 else "yield or soften"
    said = f"; {_list(names, MOST_LISTED)} {verb}" if names else ""
    advice = "; follow the path through it with ub.follow(scene, ub.ArcLength(...))"
    if solution.parameter is FACTOR:
        advice = ""  # the run is such a path
    return (
        "a limit load or a bifurcation is near, where the tangent stiffness is singular"
        f"{said}{advice}"
    )


def _probe_state(equation: StepEquation, q0: Array, q1: Array) -> Array:
    """Return a state in the direction from ``q0`` to ``q1``, :data:`PROBE_DISTANCE` from ``q0``.

    It may lie beyond ``q1``; forces of connectors are then the ones of ``q1``.
    """
    subdomain = equation.subdomain
    scales, change = subdomain.numbering.scales[subdomain.dofs], q1 - q0
    far = subdomain.largest(float(np.abs(change * scales).max(initial=0.0)))
    if not 0 < far < np.inf:
        return q0
    factor = PROBE_DISTANCE / far
    return np.asarray(q0 + np.where(scales > 0, factor, min(1.0, factor)) * change)


def _singularity(equation: StepEquation, q: Array) -> str:
    """Describe a singularity or a mechanism in the latest tangent, evaluated at ``q``; else ""."""
    numbering, scene = equation.subdomain.numbering, equation.subdomain.numbering.scene
    if (found := soft_motions(equation)) is None:
        return ""
    x: Array = np.zeros(numbering.size)
    K, free, sizes, vectors = found
    x[free], size = vectors[:, -1], sizes[-1]
    motions, forces = np.abs(x) * numbering.scales, np.abs(x[numbering.multipliers])
    largest = float(motions.max())
    if not np.isfinite(largest):
        return ""
    if largest * scene.size * abs(K).max() <= SINGULAR * forces.max(initial=0.0):
        joints = {holder: joint for joint in scene.joints for holder in joint.holders}
        held = (scene.all_connectors[i] for i in _named(forces / (forces.max() or 1.0)))
        names = [*dict.fromkeys(str(joints.get(x, x)) for x in held)]
        said = (
            f"the tangent stiffness is singular: the constraints of {_list(names)} are not "
            "independent"
        )
        return said if size <= SINGULAR else ""
    x /= largest
    motions /= largest
    connectors, cells = _deformations(equation, q, x)
    said = _describe(numbering, motions, connectors, cells)
    if size <= SINGULAR:
        return f"the tangent stiffness is singular: {said}"
    yields = len(connectors.soft) or len(cells.soft)
    mechanism = yields and not (connectors.stiff or cells.stiff)
    return f"a mechanism has formed: {said}" if mechanism else ""


def _deformations(equation: StepEquation, q: Array, x: Array, most: float = SOFT) -> list[Deformed]:
    """Find the connectors and the cells that deform in a small motion along ``x`` from ``q``.

    Those with at most the fraction ``most`` of their elastic stiffness are soft.
    """
    subdomain, numbering = equation.subdomain, equation.subdomain.numbering
    scene, p, ε = numbering.scene, numbering.mesh.degree, 1e-6
    ends = [q + way * ε * x[subdomain.dofs] for way in (1.0, -1.0)]
    connectors, left = np.zeros(len(scene.all_connectors)), np.ones(len(scene.all_connectors))
    for group in equation.connector_terms:
        after, before = map(group.motion, ends)
        known = np.isfinite(after) & np.isfinite(before)  # no end of a guide or of a rotation
        change = np.subtract(after, before, out=np.zeros_like(after), where=known) / (2 * ε)
        connectors[group.indices] = np.abs(change)
        left[group.indices] = group.remaining()
        if isinstance(group.law, RigidPlastic):
            # A held connector cannot move, so one that moves slips in the latest tangent.
            left[group.indices[np.abs(change) >= LEAST_NAMED]] = 0.0
    connectors /= np.where(
        [connector.is_rotation for connector in scene.all_connectors], 1.0, scene.size
    )
    # Works of the tangent, and of the elastic stiffness, on the strains at the Gauss points
    now, elastic = works = np.zeros((2, len(numbering.cells), p))
    for beams in equation.inelastic:
        after, before = map(beams.strains, ends)
        by_point = beams.points.works((after - before) / (2 * ε))
        works[:, beams.sections()[0]] += by_point.reshape(2, -1, p)
    turns = equation.turns() if scene.in_space else None
    sizes = _deformations_of_cells(numbering, subdomain.gather(q), x, turns)
    left_in_cells = np.divide(now, elastic, out=np.ones_like(now), where=elastic > 0).min(axis=1)
    if subdomain.comm.size > 1:
        for values, of in ((connectors, MPI.SUM), (left, MPI.MIN), (left_in_cells, MPI.MIN)):
            subdomain.comm.Allreduce(MPI.IN_PLACE, values, op=of)
    deformations = []
    for deformed, remaining in ((connectors, left), (sizes, left_in_cells)):
        soft = remaining <= most
        stiff = bool((deformed[~soft] >= LEAST_NAMED).any())
        deformations.append(Deformed(_named(np.where(soft, deformed, 0.0)), stiff))
    return deformations


def _deformations_of_cells(
    numbering: DofNumbering, q: Array, x: Array, turns: Array | None
) -> Array:
    """Return the largest deformation in each cell by a small motion ``x`` from ``q``; (num_cells,).

    Between neighbouring nodes it is a displacement, in sizes of the scene, or a rotation, in rad,
    beyond the rigid motion.  In space, ``turns`` are the quaternions of the nodes.
    """
    d, (a, b) = numbering.displacements, numbering.pieces.T
    u, ψ = np.split(x[numbering.dofs], [d], axis=1)
    arms = np.diff((numbering.points + q[numbering.dofs[:, :d]])[numbering.pieces], axis=1)[:, 0]
    if turns is None:
        carried = (ψ[a] + ψ[b]) / 2 * np.column_stack([-arms[:, 1], arms[:, 0]])
    else:
        ψ = rotated(ψ, rotation_vectors(turns[: len(ψ)]))
        carried = np.cross((ψ[a] + ψ[b]) / 2, arms)
    apart = np.abs(u[b] - u[a] - carried).max(axis=1) / numbering.scene.size
    pieces = np.maximum(apart, np.abs(ψ[b] - ψ[a]).max(axis=1))
    return np.asarray(pieces.reshape(-1, numbering.mesh.degree).max(axis=1))


def _describe(
    numbering: DofNumbering, motions: Array, connectors: Deformed, cells: Deformed
) -> str:
    """Describe a motion that no force resists; ``motions`` are its magnitudes, up to 1; (size,)."""
    alike = np.round(motions, 6)  # so that round-off does not determine the order of equal motions
    phrases = []
    for words in numbering.worst(np.where(alike >= 1 / 2, alike, 0.0)):
        component, _, place = words.partition(" of ")
        what = "rotation" if component == "psi" else component
        what = what if what.startswith("rotation") else f"displacement {component}"
        phrases.append(f"the {what} of {place}")
    if cells.stiff:
        return (
            f"the forces no longer resist a motion that is largest in {_list(phrases)}, as at a "
            "limit load or a bifurcation"
        )
    said = f"{_list(phrases)} {'is' if len(phrases) == 1 else 'are'} held by nothing"
    names = _names(numbering, connectors, cells)
    if names:
        verb = "gives way" if len(names) == 1 else "give way together"
        said += f"; {_list(names, MOST_LISTED)} {verb} at no further force"
    sections = (numbering.scene.beams[numbering.beam_of_cell[i]].section for i in cells.soft)
    groups = (section.section_points(None, numbering.scene.in_space) for section in sections)
    laws = (law for points in chain.from_iterable(groups) for law, _ in points.laws)
    perfect = any(isinstance(law, ElastoPlastic) and law.bounded and law.opens for law in laws)
    if len(cells.soft) > 1 and perfect:
        said += (
            "; if they carry the same force, it does not determine which of them yields: let the "
            "law harden a little, as ElastoPlastic(limit, isotropic=...) with a millionth of the "
            "elastic stiffness"
        )
    return said


def _named(sizes: Array) -> Index:
    """Return the indices of sizes of at least :data:`LEAST_NAMED`, the largest size first."""
    order = np.argsort(-sizes, kind="stable")
    return order[sizes[order] >= LEAST_NAMED]


def _names(numbering: DofNumbering, connectors: Deformed, cells: Deformed) -> list[str]:
    """Return the names of soft connectors and cells; the name of a hinge has one of its places."""
    names = []
    for i in connectors.soft:
        connector = numbering.scene.all_connectors[i]
        is_hinge = connector.kind == "Hinge"
        names.append(f"Hinge({place_of(connector)})" if is_hinge else str(connector))
    return names + [numbering.describe_cell(i) for i in cells.soft]


def _list(names: list[str], most: int = NAMED) -> str:
    """Join names for a sentence: the first ``most`` names, and the number of the others."""
    names, more = names[:most], len(names) - most
    if more > 0:
        return f"{', '.join(names)} and {more} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


# -- signs in the ledger of a run ------------------------------------------------------------------

GROUP_SIZE = 100  # number of steps in a group; numerical losses are summed over each group

LARGE_LOSS = 5.0
"""Least numerical loss in a group that is reported, as a multiple of the largest energy of the
scene in the group.

A motion that the steps resolve loses a small fraction of its energy in each step.
"""

SMALL_LOSS = 1e-6  # numerical loss that is never reported, as a fraction of the energy transferred


def work_of_round_off(states: States) -> float:
    """Return the largest work of a force of a connector on the round-off of a position; J."""
    scene, forces = states.scene, np.abs(states.q[:, states.numbering.multipliers])
    lengths = [1.0 if x.is_rotation else scene.size for x in scene.all_connectors]
    return float(np.finfo(float).eps * np.max(forces * lengths, initial=0.0))


class LedgerWatch:
    """Check of the energy ledger of a run; each stored state is checked once.

    Args:
        numbering: Vertices, cells and degrees of freedom of the scene.
        scheme: The time scheme.
        tolerance: Largest error of an entry of the ledger that causes no warning, as a fraction of
            the energy transferred.

    Attributes:
        last_checked: Index of the last checked state; the run updates it when it deletes states.
    """

    def __init__(self, numbering: DofNumbering, scheme: Scheme, tolerance: float) -> None:
        self._numbering, self._tolerance = numbering, tolerance
        connectors, laws = numbering.scene.all_connectors, list[MaterialLaw]()
        for beam in numbering.scene.beams:
            points = beam.section.section_points(beam.section.hinge, numbering.scene.in_space)
            if not all(class_points.elastic for class_points in points):
                laws += [law for class_points in points for law, _ in class_points.laws]
        springs = (x.law.law for x in connectors if isinstance(x.law, Spring))
        laws += [law for law in springs if law is not None]
        grows = {"hinges": True, "plastic": all(map(dissipation_must_grow, laws))}
        # Schemes with forces at the end of a step compute works from the mean of the forces at both
        # ends.  The error of this mean can make the entries of friction and damping fall.
        exact = grows["friction"] = grows["damping"] = scheme.weight_of_before == 0.0
        # True if elastic forces and variables of laws belong to the same instant
        at_once = scheme.theta == scheme.load_weight
        user_laws = [x.law for x in connectors if isinstance(x.law, ConnectorLaw)]
        for law in user_laws:
            certain = exact and (at_once or not law.variables) and loss_must_grow(law)
            grows[law.entry] = grows.get(law.entry, exact) and certain
        self._grows = [name for name, certain in grows.items() if certain]
        prescribed = any(isinstance(x.law, ForceLaw) and x.law.stored for x in connectors)
        prescribed = prescribed or not all(isinstance(law, Stop) for law in user_laws)
        self._bounded = not prescribed and all(map(has_quadratic_energies, laws))
        self._in_motion = has_inertia(scheme)
        self._transferred = self._most = 0.0
        self.last_checked = 0
        self._told: set[str] = set()

    def faults(self, states: States, every: int, *, last: bool = False) -> Iterator[str]:
        """Check the states since the last call, in groups of :data:`GROUP_SIZE`; yield warnings.

        ``every`` is the number of steps between states.  With ``last``, an incomplete group is
        checked, too.  Only the first warning of each kind is yielded.
        """
        number = len(states) - 1 - self.last_checked
        number -= 0 if last else number % GROUP_SIZE
        if number <= 0:
            return
        states = states.subset(self.last_checked, self.last_checked + number + 1)
        self.last_checked += number
        times, (state, supplied, lost) = states.times, states.ledger()
        works = sum(float(np.abs(np.diff(work)).sum()) for work in supplied.values())
        sizes = [e if name in CONTRIBUTIONS else np.abs(e - e[0]) for name, e in state.items()]
        energy = np.asarray(sum(sizes, 0.0 * times))
        self._transferred += works + max(float(np.max(energy)) - self._most, 0.0)
        self._most = max(self._most, float(np.max(energy)))
        allowed = self._tolerance * self._transferred
        for name in self._grows:
            if name in lost and name not in self._told:
                falls = -np.diff(lost[name])
                n = int(np.argmax(falls))
                if falls[n] > allowed and falls[n] > work_of_round_off(states):
                    self._told.add(name)
                    before, after = times[n : n + 2]
                    yield (
                        f"{self._where(name, states, n)}the dissipated energy, the entry {name!r} "
                        f"of the ledger, falls by {falls[n]:.3g} J between t = {before:.6g} and "
                        f"{after:.6g} s. No law of the scene gives dissipated energy back: a step "
                        "found a wrong state there, and all later results are wrong. Use smaller "
                        "steps; check the equations of a law of your own, or set active = True in "
                        "a law that supplies energy"
                    )
        least = float(np.min(state["stored"])) if "stored" in state and self._bounded else 0.0
        if least < -allowed and "stored" not in self._told:
            self._told.add("stored")
            t = times[int(np.argmin(state["stored"]))]
            yield (
                f"the stored energy is {least:.3g} J at t = {t:.6g} s, but is a sum of squares: "
                "a material law in the scene, or the step there, is wrong. Use smaller steps; "
                "check elastic_energy of a law of your own"
            )
        starts = np.arange(0, len(times) - GROUP_SIZE, GROUP_SIZE)
        if every > 1 or not self._in_motion or "numerical" not in lost or not len(starts):
            return
        losses = lost["numerical"][starts + GROUP_SIZE] - lost["numerical"][starts]
        most = np.maximum.reduceat(energy, starts)
        wrong = losses > np.maximum(LARGE_LOSS * most, SMALL_LOSS * self._transferred)
        if wrong.any() and "numerical" not in self._told:
            self._told.add("numerical")
            k = int(np.argmax(wrong))
            begin, end = times[starts[k]], times[starts[k] + GROUP_SIZE]
            yield (
                f"from t = {begin:.6g} to {end:.6g} s the time scheme took {losses[k]:.3g} J, the "
                f"entry 'numerical', {losses[k] / most[k]:.3g} times the largest energy of the "
                f"scene in these {GROUP_SIZE} steps. Motions that the steps resolve do not lose so "
                "much, so some motions are too fast for the steps, and results depend on the "
                "scheme. Use smaller steps, or smoother loads and supports; a controller that "
                "causes the loss needs another sample time, inertia at its place, or a ForceLaw "
                "instead"
            )

    def _where(self, name: str, states: States, n: int) -> str:
        """Name the cell or connector whose part of the entry ``name`` falls most after state ``n``.

        The result ends with ": "; it is empty if no part falls.
        """
        kind = {"friction": Coulomb, "damping": Damper}.get(name)
        falls: dict[str, float] = {}
        for i, connector in enumerate(self._numbering.scene.all_connectors):
            entry = connector.law.entry if isinstance(connector.law, ConnectorLaw) else ""
            if entry == name if entry else kind is None or isinstance(connector.law, kind):
                column = WORK if kind and not entry else DISSIPATED
                taken = states.column("connectors")[:, i, column]
                falls[f"{connector}: "] = taken[n] - taken[n + 1]
        if name in ("hinges", "plastic"):
            column = PLASTIC if name == "plastic" else HINGE
            before, after = (states.cells_of(k)[:, column] for k in (n, n + 1))
            cell = int(np.argmax(before - after))
            place = self._numbering.middle(cell)
            fall = before[cell] - after[cell]
            falls[f"{place.beam.name}, cell at s = {place.s:.3g}: "] = float(fall)
        worst = max(falls, key=lambda name: falls[name], default="")
        return worst if worst and falls[worst] > 0.0 else ""


TURNED = 0.05
"""Rotation of beams beyond which Rayleigh damping of their stiffness is warned of; rad.

A rigid rotation by this angle has the linear strain 1 - cos θ = 0.00125, at which steel yields.
"""


def warn_of_rayleigh(solution: Solution) -> None:
    """Warn of Rayleigh damping with the initial stiffness, which resists rigid turning.

    Beams have turned far, and the run has lost ten times what strains ever stored.
    """
    damping = [x for x in solution.scene.damping if isinstance(x, Rayleigh) and x.stiffness]
    if not len(solution) or all(x.tangent for x in damping):
        return
    turns = np.abs(solution.q[:, solution.numbering.dofs[:, 2]]).max()
    lost, stored = solution.energy["damping"][-1], solution.energy["stored"].max()
    if turns > TURNED and lost > 10 * stored:
        warn(
            f"{damping[0]}: it resists rigid turning and flow; beams have turned by {turns:.2g} "
            f"rad, damping has taken {lost:.3g} J, and strains have stored at most {stored:.3g} J. "
            "Use KelvinVoigt(stiffness), with the same number, which damps strains only, or "
            "tangent=True if cells flow"
        )


EXAMINED = 20_000  # largest number of unknowns of a scene whose last static state is examined

NEUTRAL = 1e-11  # eigenvalues down to minus this fraction of the diagonal count as zero


def warn_of_instability(solution: Solution, equation: StepEquation, q: Array) -> None:
    """Warn if the last state ``q`` of a static run is an unstable equilibrium, as of a column.

    Scenes that have dissipated energy are not examined, nor those with forces of connectors, in a
    rotating frame, with an unsymmetric tangent, or on several processes.
    """
    numbering = equation.subdomain.numbering
    if (
        len(numbering.multipliers) or numbering.size > EXAMINED or not equation.subdomain.alone
        or any(lost[-1] for lost in solution.energy.lost.values())
        or any(isinstance(load, RotatingFrame) for load in solution.scene.loads)
    ):  # fmt: skip
        return
    if not equation.evaluate(q):  # the last step may have needed no tangent
        return
    K, free = free_tangent(equation)
    if not len(free) or not np.isfinite(K.data).all():
        return
    try:
        factors = Factorization(csr_array(K + diags_array(NEUTRAL * np.abs(K.diagonal()))))
    except np.linalg.LinAlgError:
        return
    if factors.symmetric and factors.negative:
        warn(
            f"the equilibrium at {solution.parameter.at(float(solution.times[-1]), '.9g')} is "
            f"unstable: its tangent stiffness has negative eigenvalues, {factors.negative} of "
            f"{len(free)}, so that the scene would leave it, as a straight column beyond its "
            "buckling load. An imperfection with shorter steps, or ub.follow, leads to stable "
            "states"
        )
