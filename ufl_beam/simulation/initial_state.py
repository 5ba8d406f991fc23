# SPDX-License-Identifier: MIT
"""Numbering and initial state of a run, and checks before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.blocks.work_checks import require_works
from ufl_beam.caches import no_garbage_collection
from ufl_beam.discretization.cells_in_space import TURNS
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.model_warnings import (
    warn_of_far_points,
    warn_of_free_hinges,
    warn_of_masses,
    warn_of_origin,
    warn_of_rates,
    warn_of_touching,
    warn_of_warping,
)
from ufl_beam.discretization.state_io import OtherVersion, State
from ufl_beam.discretization.state_transfer import (
    APART,
    CELL_TABLES,
    Excess,
    Transfer,
    geometry,
    same_unknowns,
)
from ufl_beam.display import at_point
from ufl_beam.errors import ArgumentError, ModelError, require_kind, shorten, warn
from ufl_beam.mechanics.time_scheme import DynamicScheme, Scheme, has_inertia, stages_of
from ufl_beam.model.beams import DEFAULT_MESH, Mesh
from ufl_beam.model.connector_laws import HOLDING, RIGID, Coulomb, Guide, has_friction
from ufl_beam.model.connectors import Connector
from ufl_beam.model.constraint_checks import (
    require_independent,
    require_inertia,
    require_no_mechanism,
    require_no_prestress,
    require_smooth,
    warn_of_held_motions,
)
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.model.records import unlike
from ufl_beam.model.scene import Scene
from ufl_beam.model.works import Effect
from ufl_beam.output.output_files import version
from ufl_beam.simulation.solution import Solution

StateOf = Solution | tuple[Solution, int]
"""State of a solution: its last one, or the n-th stored one of (solution, n)."""


@no_garbage_collection()
def checked_numbering(
    scene: Scene, scheme: Scheme, mesh: Mesh, *, fresh: bool
) -> tuple[DofNumbering, str]:
    """Check a scene and a scheme, and number the degrees of freedom of the scene.

    With ``fresh``, the run begins with the undeformed scene.  The second result describes a motion
    without strain that only loads can resist in statics; it is empty if no such motion exists.
    """
    free_motion = ""
    require_kind(scene, Scene, "scene")
    require_scheme(scheme, "scheme")
    if has_inertia(scheme):
        if scene.in_space and not scheme.half_tangents:
            raise ModelError(
                f"{scheme!r}: rotations in space need EnergyMomentum(), EnergyMomentumDecaying(), "
                "Static() or EnergyMomentumStatic(): this scheme adds changes of angles and their "
                "rates, and in space a sum of angles about changing axes is no rotation"
            )
        require_inertia(scene)
        warn_of_masses(scene)
        if scene.initial:
            warn_of_origin(scene)
        require_rates(scene, scheme)
        if len(stages_of(scheme)) > 1:
            require_smooth(scene, scheme)
    else:
        free_motion = require_no_mechanism(scene)
        warn_of_rates(scene)
        if fresh and scheme.theta < 1:  # the run would oscillate about equilibrium
            instead = "begin with a run by Static() or EnergyMomentumStatic(theta=1), as start="
            require_no_prestress(scene, repr(scheme), instead)
    require_works(scene, mesh.degree, scheme)
    require_independent(scene)
    warn_of_warping(scene)
    warn_of_far_points(scene)
    warn_of_free_hinges(scene)
    numbering = DofNumbering(scene, mesh)
    warn_of_touching(numbering)
    warn_of_held_motions(scene)
    return numbering, free_motion


def require_rates(scene: Scene, scheme: DynamicScheme) -> None:
    """Raise :class:`ModelError` if a scheme lacks a mean velocity or damping that a scene needs."""
    name = type(scheme).__name__
    laws: list[Any] = [(c, c.law) for c in scene.all_connectors]
    for owner, what in laws + [(load, load) for load in scene.loads]:
        if (isinstance(what, RotatingFrame) or has_friction(what)) and not scheme.has_mean_velocity:
            raise ModelError(
                f"{name}: {owner} needs the mean velocity of a step, and this scheme takes all "
                "forces at the end of the step; use EnergyMomentum() or EnergyMomentumDecaying()"
            )
    if not scheme.accelerations_oscillate:
        return
    prescribed = [str(c) for c in scene.all_connectors if isinstance(c.law, HOLDING)]
    prescribed += [f"the support of {s.place}" for s in scene.supports if s.moving]
    if prescribed:
        raise ModelError(
            f"{name}: {prescribed[0]} prescribes a motion, whose accelerations oscillate for ever "
            "without numerical damping; use GeneralizedAlpha(0.8), or EnergyMomentum()"
        )


def require_scheme(scheme: Any, what: str) -> None:
    """Raise :class:`ArgumentError`, with the name ``what``, unless ``scheme`` is a time scheme."""
    tries = hasattr(scheme, "dynamic") or hasattr(scheme, "step")
    if isinstance(scheme, type) or not tries:
        raise ArgumentError(
            f"{what} = {shorten(scheme)} must be a scheme, such as Static() or EnergyMomentum()"
        )
    dynamic = getattr(scheme, "dynamic", False)
    if why := unlike(scheme, DynamicScheme if dynamic else Scheme):
        raise ArgumentError(f"{what}: {type(scheme).__name__} is not a time scheme: {why}")
    try:
        hash(scheme)
    except TypeError:
        raise ArgumentError(
            f"{what}: {type(scheme).__name__} cannot be hashed, and forms are kept by scheme; "
            "decorate the class with @dataclass(frozen=True)"
        ) from None


def chosen_state(given: StateOf | None, what: str) -> Solution | None:
    """Return the solution that ends with a state: a solution, or its part up to (solution, n).

    Raises:
        ArgumentError: There is no such state, or its internal variables are not known.
    """
    if given is None:
        return None
    solution, n = given if isinstance(given, tuple) and len(given) == 2 else (given, -1)
    require_kind(solution, Solution, what)
    require_kind(n, (int, np.integer), f"{what}: n of (solution, n)")
    if (n := solution.index(n)) == len(solution) - 1 and solution.internal:
        return solution
    scene, numbering = solution.scene, solution.numbering
    owners = [numbering.middle(int(cell)).beam.name for cell in numbering.inelastic_cells[:1]]
    owners += [str(c) for c in scene.all_connectors if remembers(c.law)]
    owners += [str(x) for x in scene.works if isinstance(x, Effect) and x.statement.state]
    if scene.in_space:  # whole turns
        motions = solution.column("connectors")[:, :, 0][n]
        owners += [str(scene.all_connectors[i]) for i in np.flatnonzero(np.abs(motions) > math.pi)
                   if scene.all_connectors[i].is_rotation]  # fmt: skip
    if owners:
        raise ArgumentError(
            f"{what}: {owners[0]} has internal variables, which solutions keep at the end of a run "
            f"only; end a run at {solution.parameter.at(solution.times[n])}, or call end() or "
            "snapshot() of a Simulation there"
        )
    part = type(solution)(scene, numbering, solution)
    part._blocks = solution.subset(0, n + 1)._blocks
    reactions = np.zeros(numbering.size)
    for support, forces in zip(scene.supports, part.column("reactions")[:,][-1], strict=True):
        held = [*support.held]
        reactions[numbering.node(support.place)[held]] = forces[held]
    part.internal = {"reactions": reactions} if np.isfinite(reactions).all() else {}
    if scene.in_space:
        part.internal[TURNS] = part.column(TURNS)[:,][-1]
    return part


def remembers(law: Any) -> bool:
    """Return whether the forces of a connector law depend on more than the present motion."""
    names = "law", "softening", "variables", "holds", "state", "sample"
    return isinstance(law, Coulomb | Guide) or any(getattr(law, name, None) for name in names)


def mesh_of(start: Solution | None, mesh: Mesh | None) -> Mesh:
    """Return ``mesh`` if it is given, else the mesh of ``start``, else the default mesh."""
    if mesh is not None:
        require_kind(mesh, Mesh, "mesh")
        return mesh
    return DEFAULT_MESH if start is None else start.numbering.mesh


SAME_TIME = 1e-12
"""Largest round-off between the end of a run and the beginning of its continuation, as a fraction
of the largest time."""


def continuation(start: Solution | None, scene: Scene, t0: float) -> tuple[float, bool]:
    """Return the time of the initial state (s), and whether ``start`` ended then with this scene.

    If it did, no force has jumped, so accelerations and forces of its last step are still valid.
    """
    if start is None or start.scene is not scene or not same_time(start, t0):
        return t0, False
    return float(start.times[-1]), True


def same_time(start: Solution, t0: float) -> bool:
    """Return whether a run ended at the time ``t0`` (s), up to round-off."""
    slack = SAME_TIME * float(np.abs(start.times[[0, -1]]).max())
    return abs(float(start.times[-1]) - t0) <= slack


def initial_state(
    numbering: DofNumbering, start: Solution | None
) -> tuple[Array, Array, State, Excess | None]:
    """Return the state with which a run begins.

    It consists of the configuration and velocities, (size,) each, the internal variables, and the
    excess of momentum of velocities that differ where ``start`` had separate unknowns.
    """
    v = _initial_velocity(numbering)
    if start is None:
        return np.zeros(numbering.size), v, {}, None
    q0, v0 = start.q[-1], start.v[-1] if len(start.v) else None
    if same_unknowns(start.numbering, numbering):
        return q0, v if v0 is None else v0, start.internal, None
    transfer = Transfer(start.numbering, numbering)
    after, excess = (v, None) if v0 is None else transfer.velocity(v0)
    return transfer.state(q0), after, transfer.internal(start.internal), excess


def require_known(numbering: DofNumbering, start: Solution, unknown: set[tuple[str, int]]) -> None:
    """Raise :class:`OtherVersion` if ``start`` lacks internal variables of a law that it had.

    ``unknown`` has a table and an index of each cell and connector without stored variables.
    """
    laws = {geometry(c): c.law for c in start.scene.all_connectors} if unknown else {}
    cells = [index % len(numbering.cells) for table, index in unknown if table == CELL_TABLES[0]]
    at = [index for table, index in unknown if table not in CELL_TABLES]
    connectors = (numbering.scene.all_connectors[index] for index in sorted(at))
    owners = [numbering.middle(cell).beam.name for cell in sorted(cells)]
    owners += [str(c) for c in connectors if remembers(c.law) and laws.get(geometry(c)) == c.law]
    if owners:
        raise OtherVersion(
            f"start: version {start.version} of ufl_beam computed the solution and stored other "
            f"internal variables of {owners[0]} than this version, {version()}. Run again from the "
            "beginning"
        )


def require_held(connectors: Sequence[Connector], motions: Array, size: float) -> None:
    """Raise :class:`ModelError` if a joint or link of a continued run does not fit its state.

    ``motions`` (m or rad) are zero in a state that fits; ``size`` is the size of the scene (m).
    """
    for connector, e in zip(connectors, motions, strict=True):
        if connector.law is RIGID and abs(e) > APART * (1.0 if connector.is_rotation else size):
            raise ModelError(
                f"start: {connector} does not fit the end of the solution: the motion that it "
                f"holds at zero is {e:.3g} {'rad' if connector.is_rotation else 'm'} there. "
                "Connect the places by a spring, or start from a solution that fits"
            )


def _initial_velocity(numbering: DofNumbering) -> Array:
    """Return the velocities that :class:`Velocity` gives to parts, and zero elsewhere; (size,).

    Parts with mass but without :class:`Velocity` are at rest.
    """
    scene, scales, fastest = numbering.scene, numbering.scales, 0.0
    v: Array = np.full(numbering.size, np.nan)
    parts: list[Any] = [b for b in scene.beams if b.section.rhoA or b.section.rhoI]
    parts += [b for b in scene.bodies if b.mass or b.inertia]
    given: list[tuple[Any, Any]] = [(part, x.at) for x in scene.initial for part in x.beams]
    still = np.zeros(numbering.width)
    rest = [(part, lambda *_: still) for part in parts if part not in dict(given)]
    for part, at in given + rest * bool(given):
        points, dofs = numbering.nodes_of(part)
        new = np.array([at(*point) for point in points])
        fastest = max(fastest, np.abs(new * scales[dofs]).max())
        apart = (np.abs(v[dofs] - new) * scales[dofs] > 1e-9 * fastest).any(axis=1)
        if apart.any():
            place, rate = at_point(points[apart][0]), np.nanmax(np.abs(v[dofs[apart][0]]))
            raise ArgumentError(
                f"Velocity: {part.name} gets two different velocities at {place}, from "
                "itself, zero by default, or from a part that it is joined to and that moves at "
                f"{rate:.3g} m/s or rad/s; give all joined parts velocities that agree"
            )
        v[dofs] = new
    v = np.nan_to_num(v)
    if given:
        _require_agreement(numbering, v)
    return v


def _require_agreement(numbering: DofNumbering, v: Array) -> None:
    """Check that joints and supports allow the initial velocities.

    Joined parts that move apart are an error, because they would vibrate.  Supports that cancel
    all velocities of a beam are an error; supports that cancel some of them cause a warning.
    """
    size, speeds = numbering.scene.size, np.abs(v * numbering.scales)
    fastest = size * speeds.max()
    connectors = numbering.scene.all_connectors
    for connector, dofs in zip(connectors, numbering.dofs_of_connectors, strict=True):
        a, b = v[dofs[:-1]].reshape(-1, 2).T
        by_a, by_b = connector.rigidly()
        rate = float(np.dot(by_a, a) + np.dot(by_b, b))
        per = size if connector.is_rotation else 1.0
        if connector.law is RIGID and abs(rate) > 1e-9 * fastest / per:
            raise ArgumentError(
                f"Velocity: the parts that {connector} joins would move apart at {rate:.3g} m/s "
                "or rad/s; give all joined parts velocities that agree"
            )
    supports = {
        int(numbering.node(support.place)[c]): (support, support.names[c])
        for support in numbering.scene.supports if not support.moving and not support.turns
        for c in support.held
    }  # fmt: skip
    moving = speeds > 1e-9 * speeds.max()
    for beam in (beam for velocity in numbering.scene.initial for beam in velocity.beams):
        dofs = np.unique(numbering.nodes_of(beam)[1])
        dofs = dofs[moving[dofs]]
        lost = [supports[dof] for dof in dofs.tolist() if dof in supports]
        if not lost:
            continue
        support, _ = lost[0]
        if len(lost) == len(dofs):
            raise ArgumentError(
                f"Velocity: {beam.name} does not move, because {support} holds it; remove the "
                "support or the velocity"
            )
        names = ", ".join(x for x in support.names if x in {name for _, name in lost})
        warn(
            f"Velocity of {beam.name}: {support} prescribes {names}, so that the velocity at its "
            "place is zero from the start but the rest of the beam moves, which is an impact. Give "
            "a velocity that agrees with the support, about= its place"
        )
