# SPDX-License-Identifier: MIT
"""Pushover: forces with a constant distribution that grow until a target displacement."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from textwrap import shorten as shortened
from typing import Any

import numpy as np

from ufl_beam.analysis.constant_loads import (
    AT,
    loaded_state,
    require_options,
    size_of,
    with_amplitude,
)
from ufl_beam.analysis.linearization import Linearization
from ufl_beam.analysis.modes import computed_modes
from ufl_beam.analysis.path_controls import DisplacementControl
from ufl_beam.analysis.path_following import Path, follow
from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import DofNumbering, values_at
from ufl_beam.discretization.function_spaces import point_masses
from ufl_beam.display import FACTOR, Parameter
from ufl_beam.errors import (
    ArgumentError,
    ConvergenceError,
    each_warning_once,
    require_all,
    require_count,
    require_kind,
    require_number,
    shorten,
    warn,
)
from ufl_beam.model import plausibility
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import AttachmentPoint, Place
from ufl_beam.model.connectors import law_of, place_of
from ufl_beam.model.functions import Constant
from ufl_beam.model.loads import Gravity, LineLoad, Load, PointLoad
from ufl_beam.model.scene import Scene
from ufl_beam.output.history import Events
from ufl_beam.quadrature import gauss_rule
from ufl_beam.simulation.initial_state import mesh_of
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.structures.pushover_result import HingeFormation, Pushover

DISPLACEMENTS = "u", "v", "w"
PATTERNS = "mode", "uniform", "triangular"
TIMES = -1.0, 0.0, 0.5, 2.0, 5.0, *(10.0**k for k in range(1, 7))
"""Times (s) at which a prescribed motion or a connector force must equal its value at 1 s.  They
are large, because on the path the base shear (N) takes the place of time."""

MODES = 6  # number of modes among which the one with the largest effective mass is chosen
LEAST_MOTION = 1e-6  # of the control place, as a fraction of the largest motion of the scene
SAME = 2e-6  # fraction of the target that the end of a path may miss, twice AT_END
NAMED_FROM = 0.99  # hinges with this fraction of their limit are named if the path ends early
MOST_NAMED, MOST_CHARACTERS = 8, 400  # hinges, and characters of an error, in ``failure``
BASE_SHEAR = Parameter(
    "base shear (N)", "base shear {} N", "a change of the base shear by {:.3g} N",
    "base shear [N]", FACTOR.progress,
)  # fmt: skip
MOST_STEPS = 20  # largest number of steps of a path, in multiples of the steps asked for
Shape = Callable[[AttachmentPoint], float]
"""Function of a place: its displacement in a mode, with any factor."""


@each_warning_once()
def pushover(
    scene: Scene,
    place: Place,
    target: float,
    *,
    pattern: str | Sequence[Load] = "mode",
    component: str = "u",
    steps: int = 100,
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    progress: bool = True,
) -> Pushover:
    """Push a structure to a target displacement under constant loads of the scene.

    The loads of the scene act first, with their values at t = 1 s, and then stay constant.  Forces
    with a constant distribution grow, controlled by the displacement of a place.  Patterns with
    a name act on the masses of beams and on point masses.  Damping, dampers and viscosity have no
    effect.

    Args:
        scene: Model with its permanent loads.
        place: Control place, such as the end of the highest column.
        target: Displacement of the control place, with its sign, beyond the displacement due to the
            loads of the scene; m.
        pattern: Distribution of the pushing forces: "mode", mass times the elastic mode with the
            largest effective mass of the first six; "uniform", mass; "triangular", mass times the
            height above the lowest point, along y, in space z; or a list of :class:`PointLoad`,
            :class:`LineLoad` and :class:`Gravity`. The sum of the forces in the direction of the
            component is scaled to the base shear.
        component: "u" to push along x, "v" along y, or in space "w" along z.
        steps: Number of steps to the target.
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default the cells of the beams.
        progress: Show a progress bar in a terminal or notebook.

    Returns:
        The curve, with the equilibrium path and the sequence of hinges.  With a list of loads, the
        equivalent mass and the participation factor are computed with the elastic deflection under
        these loads as shape φ.

    Raises:
        ArgumentError: The call is wrong, a pattern needs mass and there is none, the pattern does
            not move the control place, the forces along the component have no sum, or a prescribed
            motion or connector force depends on time.
        ConvergenceError: There is no equilibrium under the loads of the scene, or no first step.

    Warns:
        ModelWarning: The path ended before the target; the message has its end and the hinges.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> capacity = st.pushover(pile, weak.end, -0.05, component="v", pattern="uniform")
        >>> print(capacity.hinges[0].where, capacity.hinges[0].what)
        beam.start (0, 0) opens
    """
    require_kind(scene, Scene, "pushover: scene")
    require_kind(place, Place, "pushover: place")
    target = require_number(target, "pushover: target")
    if target == 0.0:
        raise ArgumentError("pushover: target = 0 leads nowhere; give a displacement in m")
    names = DISPLACEMENTS[: len(place.point)]
    if not isinstance(component, str) or component not in names:
        options = " or ".join(map(repr, names))
        raise ArgumentError(f"pushover: component = {shorten(component)} must be {options}")
    far = target / scene.size
    plausibility.check("pushover", "target over the size of the scene", far)
    steps = require_count(steps, "pushover: steps")
    require_options(newton, mesh, progress, "pushover")
    control = DisplacementControl(place, component, target / steps)
    control.require(scene)
    loads: tuple[Load, ...] = ()
    if not isinstance(pattern, str):
        loads = require_all(pattern, "pushover: pattern", (PointLoad, LineLoad, Gravity))
    elif pattern not in PATTERNS:
        raise ArgumentError(
            f"pushover: pattern = {shorten(pattern)} must be one of {', '.join(PATTERNS)}, or a "
            "list of loads"
        )
    for owner, function in scene.time_functions():
        if not isinstance(owner, Load) and any(function(t) != function(AT) for t in TIMES):
            raise ArgumentError(
                f"pushover: {owner} depends on time, and a pushover has none; make it constant, or "
                "use ub.follow"
            )
    axis = names.index(component)
    # Loads begin and end at vertices, which must be the same in all steps below
    placed = [with_amplitude(load, Constant(0.0)) for load in loads]
    scene = replace(scene, damping=(), loads=[*scene.loads, *placed])
    steady, start = loaded_state(scene, "pushover", mesh, newton)
    numbering = DofNumbering(scene, mesh_of(start, mesh))
    masses = mass_points(numbering, axis)
    total = sum(mass for _, mass in masses)
    if isinstance(pattern, str) and not total > 0:
        raise ArgumentError(
            f"pushover: nothing that moves has mass, and the pattern {pattern!r} acts on masses; "
            "give sections rho or rhoA, give PointMass, or a list of loads as pattern"
        )
    if isinstance(pattern, str):
        shape = _shape(pattern, place, axis, steady, start, mesh, masses)
        loads = tuple(_forces(scene, axis, shape))
    sum_of_forces = sum(_along(load, axis, numbering) for load in loads)
    largest = sum(_along(load, i, numbering, abs) for load in loads for i in range(len(names)))
    if not abs(sum_of_forces) > LEAST_MOTION * largest:
        raise ArgumentError(
            f"pushover: the forces of the pattern have no sum along {component}, so that there is "
            "no base shear"
        )
    unit = [with_amplitude(load, Proportional(size_of(load) / sum_of_forces)) for load in loads]
    loaded = replace(steady, loads=[*steady.loads, *unit])
    linear = Linearization(loaded, start, abs(sum_of_forces), mesh).linear_change("pushover")[0]
    moved = float(values_at(numbering, place, linear[None])[0, axis])
    if not abs(moved) > LEAST_MOTION * np.abs(linear[numbering.dofs[:, : len(names)]]).max():
        raise ArgumentError(
            f"pushover: the pattern does not move {component} of {place}; give another control "
            "place or component"
        )
    if not isinstance(pattern, str):

        def shape(at: AttachmentPoint) -> float:
            return float(values_at(numbering, at, linear[None])[0, axis]) / moved

    weighted = np.array([(mass, mass * shape(at)) for at, mass in masses]).reshape(-1, 2)
    first, second = weighted[:, 1].sum(), (weighted[:, 1] ** 2 / weighted[:, 0]).sum()
    period = _main_mode(steady, start, mesh, masses, axis)[1] if total > 0 else math.nan
    path, events, failure = _follow(
        loaded, control, target, steps, start, newton=newton, mesh=mesh, progress=progress
    )
    path.parameter = BASE_SHEAR
    displacement = path.displacement(place)[:, axis]
    displacement = displacement - displacement[0]
    hinges = tuple(_formations(events, path, displacement))
    if failure:
        named = [f"{hinge.where} {hinge.what}" for hinge in hinges]
        named += [f"{at} is at its limit" for at in _at_limit(path)]
        named = named[:MOST_NAMED] + [f"{len(named) - MOST_NAMED} more"] * (len(named) > MOST_NAMED)
        failure = (
            f"the path ends at {component} = {displacement[-1]:.4g} m of {target:g} m, with a base "
            f"shear of {path.factor[-1]:.4g} N; hinges: {'; '.join(named) or 'none'}. {failure}"
        )
        warn(f"pushover: {failure}")
    return Pushover(
        path, place, component, target, displacement, path.factor, hinges,
        abs(sum_of_forces) / abs(moved), total, first, first / second if total > 0 else math.nan,
        period, failure,
    )  # fmt: skip


@dataclass(frozen=True)
class Proportional:
    """Function that is proportional to the load factor."""

    slope: float

    def __call__(self, t: float) -> float:
        """Return the value at a load factor."""
        return self.slope * t


def mass_points(numbering: DofNumbering, axis: int) -> list[tuple[AttachmentPoint, float]]:
    """List points with mass (kg): Gauss points of cells, and point masses that can move.

    Point masses that a support holds in the component ``axis`` are left out.
    """
    scene, weights = numbering.scene, gauss_rule(4)[1]
    rows: list[tuple[AttachmentPoint, float]] = []
    for beam in scene.beams:
        if rhoA := beam.section.rhoA:
            lengths = numbering.lengths(numbering.cells_of(beam))
            points = zip(
                numbering.gauss_parameters(beam).ravel(), np.outer(lengths, weights).ravel(),
                strict=True,
            )  # fmt: skip
            rows += [(beam.at(float(s)), rhoA * float(length)) for s, length in points]
    constrained = {int(numbering.node(s.place)[c]) for s in scene.supports for c in s.held}
    return rows + [
        (at, mass)
        for at, mass, _ in point_masses(scene)
        if mass and int(numbering.node(at)[axis]) not in constrained
    ]


def _main_mode(
    scene: Scene,
    start: Solution | None,
    mesh: Mesh | None,
    masses: list[tuple[AttachmentPoint, float]],
    axis: int,
) -> tuple[Shape, float]:
    """Return shape and period (s) of the undamped mode with the largest effective mass."""
    shapes = computed_modes(scene, MODES, start, mesh, damped=False)
    m = np.array([mass for _, mass in masses])
    effective = []
    for k in range(len(shapes)):
        motion = np.array([shapes.shape(k, at)[: len(at.point)].real for at, _ in masses])
        effective.append(float((m @ motion[:, axis]) ** 2 / (m @ motion**2).sum()))
    k = int(np.argmax(effective))
    return lambda at: float(shapes.shape(k, at)[axis].real), 1.0 / float(shapes.frequencies[k])


def _shape(
    pattern: str, place: Place, axis: int, scene: Scene, start: Solution | None,
    mesh: Mesh | None, masses: list[tuple[AttachmentPoint, float]],
) -> Shape:  # fmt: skip
    """Return the shape of a named pattern, which is 1 at the control place.

    Raises:
        ArgumentError: The pattern does not move the control place.
    """
    if pattern == "uniform":
        return lambda at: 1.0
    form: Shape
    if pattern == "triangular":
        lowest = min(at.point[-1] for at, _ in masses)
        lowest = min([lowest, *(support.place.point[-1] for support in scene.supports)])
        form, largest = (lambda at: float(at.point[-1] - lowest)), scene.size
    else:
        (form, _), largest = _main_mode(scene, start, mesh, masses, axis), 1.0
    at_place = form(place)
    if not abs(at_place) > LEAST_MOTION * largest:
        raise ArgumentError(
            f"pushover: the pattern {pattern!r} does not move {DISPLACEMENTS[axis]} of {place}; "
            "give another control place or pattern"
        )
    return lambda at: form(at) / at_place


def _forces(scene: Scene, axis: int, shape: Shape) -> list[Load]:
    """Return loads of mass times the shape along an axis, on beams and point masses."""
    direction = np.eye(3 if scene.in_space else 2)[axis]
    loads: list[Load] = []
    for beam in scene.beams:
        if rhoA := beam.section.rhoA:

            def along(s: float, beam: Any = beam) -> float:
                return shape(beam.at(s))

            loads.append(LineLoad(beam, tuple(rhoA * direction), profile=along))
    constrained = {support.place for support in scene.supports if axis in support.held}
    for at, mass, _ in point_masses(scene):
        if mass and at not in constrained:
            loads.append(PointLoad(at, tuple(mass * shape(at) * direction)))
    return loads


def _along(
    load: Load, axis: int, numbering: DofNumbering, size: Callable[[Any], Any] = float
) -> float:
    """Return the force of a load along an axis, with ``size=abs`` its magnitude; N."""
    factor = size_of(load)
    if isinstance(load, PointLoad):
        return float(size(factor * load.force[axis]))
    if isinstance(load, Gravity):
        mass = sum(mass for _, mass in mass_points(numbering, axis))
        return float(size(factor * load.acceleration[axis] * mass))
    if isinstance(load, LineLoad):
        weights = gauss_rule(4)[1]
        lengths = numbering.lengths(numbering.cells_of(load.beam))
        shares = load.factors(numbering.gauss_parameters(load.beam)) @ weights
        return float(size(factor * load.force[axis] * float(lengths @ shares)))
    raise TypeError(f"{type(load).__name__} has no sum of forces")


def _follow(
    scene: Scene, control: DisplacementControl, target: float, steps: int, start: Solution | None,
    **options: Any,
) -> tuple[Path, Events, str]:  # fmt: skip
    """Follow the path to the target; return it, its events, and the reason of an early end."""
    axis, events = DISPLACEMENTS.index(control.component), Events()
    before = 0.0 if start is None else float(start.displacement(control.place)[-1, axis])
    control = replace(control, end=before + target)
    try:
        path = follow(
            scene, control, steps=MOST_STEPS * steps, start=start, record=events, **options
        )
    except ConvergenceError as error:
        path = error.solution
        if len(path) < 2:
            raise
        return path, events, shortened(str(error), MOST_CHARACTERS, placeholder=" ...")
    left = before + target - float(path.displacement(control.place)[-1, axis])
    ended_early = abs(left) > SAME * max(abs(target), abs(before + target))
    return path, events, "too many steps" if ended_early else ""


def _at_limit(path: Path) -> list[Place]:
    """Return places of closed hinges whose moments nearly reach their limits when a path ends."""
    hinges = []
    for hinge in path.scene.hinges:
        limit, state = float(law_of(hinge).limit), path.connector(hinge)
        if state.dissipated[-1] == 0.0 and abs(state.force[-1]) >= NAMED_FROM * limit:
            hinges.append(place_of(hinge))
    return hinges


def _formations(events: Events, path: Path, displacement: Array) -> Any:
    """Iterate over the events with the states at which they are found."""
    n = 0
    for event in events.found:
        # The time of an event is a load factor.  The path may reach the same load factor twice.
        n = next((k for k in range(n, len(path)) if path.factor[k] == event.time), n)
        yield HingeFormation(
            n, float(displacement[n]), float(path.factor[n]), event.where, event.what
        )
