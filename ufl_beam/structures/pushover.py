# SPDX-License-Identifier: MIT
"""Pushover: forces with a constant distribution that grow until a target displacement."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from textwrap import shorten as shortened
from typing import Any, NamedTuple

import numpy as np
import scipy  # its subpackages are loaded when they are used

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
from ufl_beam.display import FACTOR, Parameter, Rich, bracketed, in_one_line
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
from ufl_beam.model.connectors import Connector, law_of, place_of
from ufl_beam.model.functions import Constant
from ufl_beam.model.loads import Gravity, LineLoad, Load, PointLoad
from ufl_beam.model.scene import Scene
from ufl_beam.output.history import Events
from ufl_beam.output.states import States
from ufl_beam.quadrature import gauss_rule
from ufl_beam.simulation.initial_state import mesh_of
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.structures.response_spectra import Spectrum, spectral_accelerations

SETTLED = 1e-9  # relative change of the target that ends its iterations
MOST_ITERATIONS = 100  # for the target that bounds the two lines of ASCE 41
STRAIGHT = 1e-3  # excess of energy below which a curve is elastic and perfectly plastic, or elastic
SITES = {"A": 130.0, "B": 130.0, "C": 90.0, "D": 60.0, "E": 60.0, "F": 60.0}
"""Factors a of ASCE/SEI 41-17, equation 7-29, by site class."""


@in_one_line
class HingeFormation(NamedTuple):
    """Event of a pushover: a hinge or cell yields, opens or becomes free.

    Attributes:
        n: Index of the state at the end of the step in which the event occurred.
        displacement: Displacement of the control place in this state; m.
        base_shear: Base shear in this state; N.  Shorter steps are nearer to the event.
        where: Place of the hinge, middle of the cell, or connector.
        what: "yields", "opens", "is free" or another event of :class:`Event`.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> print(st.pushover(pile, weak.end, -0.05, component="v").hinges[0])
         -0.0053 m    -24.80 kN  beam.start (0, 0) opens
    """

    n: int
    displacement: float
    base_shear: float
    where: Place | Connector
    what: str

    def __str__(self) -> str:
        return (
            f"{self.displacement:8.4f} m {self.base_shear / 1e3:9.2f} kN  {self.where} {self.what}"
        )


class TargetDisplacement(NamedTuple):
    """Displacement of the control place that a spectrum demands, with its derivation.

    Attributes:
        method: "N2" or "ASCE 41".
        displacement: Magnitude of the target displacement of the control place; m.
        n: Index of the first state of the path with this displacement, or of its last state.
        yield_displacement: Displacement of the control place at the yield point of the idealised
            curve; m.
        yield_shear: Base shear there; N.
        period: Effective period: T* of N2, T_e of ASCE 41; s.
        acceleration: Spectral acceleration at this period; m/s².
        strength_ratio: Elastic force divided by the yield force: q_u of N2, μ_strength of ASCE 41.
        factors: Further factors by name: "Gamma" of N2, "C0", "C1", "C2", "Cm" of ASCE 41.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> capacity = st.pushover(pile, weak.end, -0.05, component="v")
        >>> demand = capacity.asce41(([0.01, 0.5, 4.0], [8.0, 8.0, 1.0]), site="C")
        >>> print(f"{1e3 * demand.displacement:.2f} mm, ductility {demand.ductility:.2f}")
        9.35 mm, ductility 1.96
    """

    method: str
    displacement: float
    n: int
    yield_displacement: float
    yield_shear: float
    period: float
    acceleration: float
    strength_ratio: float
    factors: dict[str, float]

    @property
    def ductility(self) -> float:
        """Target displacement divided by the yield displacement."""
        return self.displacement / self.yield_displacement

    def __repr__(self) -> str:
        return bracketed(self)

    def __str__(self) -> str:
        factors = ", ".join(f"{name} = {value:.3f}" for name, value in self.factors.items())
        return (
            f"{self.method}: target displacement {self.displacement:.4g} m, ductility "
            f"{self.ductility:.2f}, period {self.period:.3g} s, strength ratio "
            f"{self.strength_ratio:.2f}, {factors}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Pushover(Rich):
    """Capacity curve of a structure under growing loads; made by :func:`pushover`.

    Attributes:
        path: Equilibrium path, a :class:`Path`; its load factor is the base shear (N).
        place: Control place.
        component: Controlled component, "u", "v" or "w".
        target: Displacement asked for; m.
        displacement: Displacement of the control place since the loads of the scene; (n+1,); m.
        base_shear: Sum of the pushing forces in the direction of the component; (n+1,); N.
        hinges: Events in the order of the path.
        stiffness: Base shear over displacement of the first, elastic step; N/m.
        mass: Mass of the scene without point masses at supports; kg.
        equivalent_mass: m* = Σ m φ, with the shape φ of the pattern, 1 at the control place; kg.
        gamma: Participation factor Σ m φ / Σ m φ²; NaN without mass.
        period: Period of the elastic mode with the largest effective mass; NaN without mass; s.
        failure: Reason why the path ended before the target; empty if it reached the target.

    Example:
        >>> mass = ub.PointMass(weak.end, 5e3)
        >>> pile = ub.Scene([weak], supports=[ub.Clamped(weak.start)], masses=[mass])
        >>> capacity = st.pushover(pile, weak.end, -0.05, component="v")
        >>> print(f"{1e-3 * abs(capacity.base_shear).max():.1f} kN")
        25.2 kN
        >>> demand = capacity.n2(lambda T: 8.0 * min(1.0, 0.5 / T), corner=0.5)
        >>> print(f"{1e3 * demand.displacement:.2f} mm")
        12.59 mm
        >>> figure = ub.plot(capacity, targets=demand)
    """

    path: States
    place: Place
    component: str
    target: float
    displacement: Array
    base_shear: Array
    hinges: tuple[HingeFormation, ...]
    stiffness: float
    mass: float
    equivalent_mass: float
    gamma: float
    period: float
    failure: str = ""

    def __str__(self) -> str:
        first = (
            f"pushover of {self.component} at {self.place} to {self.displacement[-1]:.4g} m, "
            f"largest base shear {np.abs(self.base_shear).max() / 1e3:.4g} kN"
        )
        return "\n".join([first, *map(str, self.hinges), *filter(None, [self.failure])])

    def __repr__(self) -> str:
        return f"<Pushover: {str(self).splitlines()[0]}>"

    def _curve(self, upto: float | None, what: str) -> tuple[Array, Array]:
        """Return the curve up to ``upto``, by default the largest base shear, as positive numbers.

        Raises:
            ArgumentError: The scene has no mass, or ``upto`` is outside of the curve.
        """
        if not self.mass > 0:
            raise ArgumentError(
                f"{what}: the scene has no mass, so that it has no period; give sections rho or "
                "rhoA, or PointMass"
            )
        sign = math.copysign(1.0, self.target)
        d, V = sign * self.displacement, sign * self.base_shear
        end = float(d[np.argmax(V)])
        if upto is not None:
            end = require_number(upto, f"{what}: upto", positive=True)
            if end > d[-1]:
                raise ArgumentError(
                    f"{what}: upto = {end:g} m is beyond the end of the curve at {d[-1]:.4g} m; "
                    "push farther"
                )
        inside = d < end
        return np.append(d[inside], end), np.append(V[inside], np.interp(end, d, V))

    def _target(self, method: str, displacement: float, *rest: Any) -> TargetDisplacement:
        reached = np.abs(self.displacement) >= displacement
        if not reached.any():
            warn(
                f"{method}: the target displacement {displacement:.4g} m is beyond the end of the "
                f"capacity curve at {abs(self.displacement[-1]):.4g} m; "
                + (f"the structure ends there: {self.failure}" if self.failure else "push farther")
            )
        n = int(np.argmax(reached)) if reached.any() else len(self.displacement) - 1
        return TargetDisplacement(method, displacement, n, *rest)

    def n2(
        self, spectrum: Spectrum, corner: float, *, upto: float | None = None
    ) -> TargetDisplacement:
        """Compute the target displacement by the N2 method.

        The equivalent oscillator has the mass m* = Σ m φ and the force and displacement of the
        curve divided by Γ.  The curve is idealised as elastic and perfectly plastic, with equal
        energy up to the plastic mechanism.  Fajfar, Earthquake Spectra 16(3), 2000; EN 1998-1:2004,
        annex B.

        Args:
            spectrum: Elastic spectral acceleration (m/s²) as a function of the period (s), or
                (periods, accelerations).
            corner: Period T_C between constant acceleration and constant velocity; s.
            upto: Displacement of the control place at which the mechanism forms; by default the one
                of the largest base shear; m.  With the computed target it may be called again.

        Raises:
            ArgumentError: The spectrum does not cover the period, the scene has no mass, or
                ``upto`` is so far beyond the largest base shear that no such curve exists.

        Warns:
            ModelWarning: The target displacement is beyond the end of the curve.
        """
        corner = require_number(corner, "n2: corner", positive=True)
        d, V = self._curve(upto, "n2")
        energy = float(scipy.integrate.trapezoid(V, d))
        strength = float(V[-1])
        yields = 2.0 * (float(d[-1]) - energy / strength)
        if yields * self.stiffness < 0.99 * strength:
            peak = abs(float(self.displacement[np.abs(self.base_shear).argmax()]))
            raise ArgumentError(
                f"n2: up to {d[-1]:g} m the base shear has fallen so far that a curve of equal "
                f"energy would be stiffer than the structure; give upto at most {peak:.4g} m, "
                "where the base shear is largest"
            )
        period = 2.0 * math.pi * math.sqrt(self.equivalent_mass * yields / strength)
        acceleration = float(spectral_accelerations(spectrum, np.array([period]), "n2")[0])
        elastic = acceleration * (period / (2.0 * math.pi)) ** 2
        ratio = acceleration * self.equivalent_mass * self.gamma / strength
        demand = elastic
        if period < corner and ratio > 1.0:
            demand = elastic / ratio * (1.0 + (ratio - 1.0) * corner / period)
            demand = min(demand, 3.0 * elastic)
        return self._target(
            "N2", self.gamma * demand, yields, strength, period, acceleration, ratio,
            {"Gamma": self.gamma},
        )  # fmt: skip

    def asce41(self, spectrum: Spectrum, *, site: str = "D") -> TargetDisplacement:
        """Compute the target displacement by the coefficient method, C0 C1 C2 S_a T_e²/(4 π²).

        C0 is Γ.  The curve is idealised by two lines with equal energy up to the target or the
        largest base shear, the first through 60 % of the yield force.  C1 and C2 are equations 7-29
        and 7-30 of ASCE/SEI 41-17, the target is equation 7-28.  C_m is the fraction of the
        effective mass, or 1 for periods above 1 s.  The pattern should be "mode".  The largest
        strength ratio for dynamic stability (equation 7-32) is not checked.

        Args:
            spectrum: Elastic spectral acceleration (m/s²) as a function of the period (s), or
                (periods, accelerations).
            site: Site class, "A" to "F".

        Raises:
            ArgumentError: The spectrum does not cover the period, or the scene has no mass.

        Warns:
            ModelWarning: The target displacement is beyond the end of the curve.
        """
        if not isinstance(site, str) or site not in SITES:
            raise ArgumentError(f"asce41: site = {shorten(site)} must be one of {', '.join(SITES)}")
        d, V = self._curve(None, "asce41")
        end = float(d[-1])
        fraction = 1.0 if self.period > 1.0 else self.gamma * self.equivalent_mass / self.mass
        for _ in range(MOST_ITERATIONS):
            strength, stiffness = bilinear(d, V, end)
            period = self.period * math.sqrt(self.stiffness / stiffness)
            acceleration = float(spectral_accelerations(spectrum, np.array([period]), "asce41")[0])
            ratio = acceleration * self.mass * fraction / strength
            more = max(ratio - 1.0, 0.0)
            c1 = 1.0 if period > 1.0 else 1.0 + more / (SITES[site] * max(period, 0.2) ** 2)
            c2 = 1.0 if period > 0.7 else 1.0 + (more / period) ** 2 / 800.0
            demand = self.gamma * c1 * c2 * acceleration * (period / (2.0 * math.pi)) ** 2
            end, before = min(demand, float(d[-1])), end
            if abs(end - before) <= SETTLED * end:
                break
        factors = {"C0": self.gamma, "C1": c1, "C2": c2, "Cm": fraction}
        return self._target(
            "ASCE 41", demand, strength / stiffness, strength, period, acceleration, ratio, factors
        )


def bilinear(d: Array, V: Array, end: float) -> tuple[float, float]:
    """Return yield force and stiffness of two lines with the energy of a curve up to ``end``.

    The first line crosses the curve at 60 % of the yield force; ASCE/SEI 41-17, 7.4.3.2.4.
    """
    last, inside = float(np.interp(end, d, V)), d < end
    d, V = np.append(d[inside], end), np.append(V[inside], last)
    energy = float(scipy.integrate.trapezoid(V, d))
    rising = np.maximum.accumulate(V)

    def stiffness(strength: float) -> float:
        return 0.6 * strength / float(np.interp(0.6 * strength, rising, d))

    def more(strength: float) -> float:
        """Return the energy of the lines minus the energy of the curve, per energy."""
        yields = strength / stiffness(strength)
        return ((strength * end + last * (end - yields)) / 2.0) / energy - 1.0

    if more(last) <= STRAIGHT:
        return last, stiffness(last)
    strength = float(scipy.optimize.brentq(more, 1e-6 * last, last, xtol=1e-12 * last))
    return strength, stiffness(strength)


DISPLACEMENTS = "u", "v", "w"
PATTERNS = "mode", "uniform", "triangular"
TIMES = -1.0, 0.0, 0.5, 2.0, 5.0, *(10.0**k for k in range(1, 7))
"""Times (s) at which a prescribed motion or a connector force must equal its value at 1 s.  They
are large, because on the path the base shear (N) takes the place of time."""

MODES = 6  # number of modes among which the one with the largest effective mass is chosen
LEAST_MOTION = 1e-6  # of the control place, as a fraction of the largest motion of the scene
MISSED = 2e-6  # fraction of the target that the end of a path may miss, twice AT_END
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
    period = math.nan
    if total > 0:
        main, period = _main_mode(steady, start, mesh, masses, axis)
    if isinstance(pattern, str):
        shape = _shape(pattern, place, axis, steady, main, masses)
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
    path, events, failure = _follow(
        loaded, control, target, steps, start, newton=newton, mesh=mesh, progress=progress
    )
    path.parameter = BASE_SHEAR
    displacement = path.displacement(place)[:, axis]
    displacement = displacement - displacement[0]
    hinges, n = list[HingeFormation](), 0
    for event in events.found:
        # The time of an event is a load factor.  The path may reach the same load factor twice.
        n = next((k for k in range(n, len(path)) if path.factor[k] == event.time), n)
        at_event = n, float(displacement[n]), float(path.factor[n])
        hinges.append(HingeFormation(*at_event, event.where, event.what))
    if failure:
        named = [f"{hinge.where} {hinge.what}" for hinge in hinges]
        closed = ((hinge, path.connector(hinge)) for hinge in path.scene.hinges)
        named += [
            f"{place_of(hinge)} is at its limit"
            for hinge, state in closed
            if state.dissipated[-1] == 0.0
            and abs(state.force[-1]) >= NAMED_FROM * float(law_of(hinge).limit)
        ]
        named = named[:MOST_NAMED] + [f"{len(named) - MOST_NAMED} more"] * (len(named) > MOST_NAMED)
        failure = (
            f"the path ends at {component} = {displacement[-1]:.4g} m of {target:g} m, with a base "
            f"shear of {path.factor[-1]:.4g} N; hinges: {'; '.join(named) or 'none'}. {failure}"
        )
        warn(f"pushover: {failure}")
    return Pushover(
        path, place, component, target, displacement, path.factor, tuple(hinges),
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
            at = numbering.gauss_parameters(beam).ravel().tolist()
            shares = np.outer(lengths, weights).ravel().tolist()
            rows += [(beam.at(s), rhoA * share) for s, share in zip(at, shares, strict=True)]
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
    """Return shape and period (s) of the undamped mode with the largest effective mass.

    Raises:
        ArgumentError: Nothing resists this mode.
    """
    shapes = computed_modes(scene, MODES, start, mesh, damped=False)
    m = np.array([mass for _, mass in masses])
    effective = []
    for k in range(len(shapes)):
        motion = np.array([shapes.shape(k, at)[: len(at.point)].real for at, _ in masses])
        effective.append(float((m @ motion[:, axis]) ** 2 / (m @ motion**2).sum()))
    k = int(np.argmax(effective))
    if shapes.frequencies[k] == 0.0:
        raise ArgumentError(
            "pushover: nothing resists the mode with the largest effective mass; give supports, or "
            "a load that closes stops, such as ties, which count as open where they just touch"
        )
    return lambda at: float(shapes.shape(k, at)[axis].real), 1.0 / float(shapes.frequencies[k])


def _shape(
    pattern: str, place: Place, axis: int, scene: Scene, main: Shape,
    masses: list[tuple[AttachmentPoint, float]],
) -> Shape:  # fmt: skip
    """Return the shape of a named pattern, which is 1 at the control place.

    Raises:
        ArgumentError: The pattern does not move the control place.
    """
    if pattern == "uniform":
        return lambda at: 1.0
    form, largest = main, 1.0
    if pattern == "triangular":
        lowest = min(at.point[-1] for at, _ in masses)
        lowest = min([lowest, *(support.place.point[-1] for support in scene.supports)])
        form, largest = (lambda at: float(at.point[-1] - lowest)), scene.size
    at_place = form(place)
    if not abs(at_place) > LEAST_MOTION * largest:
        raise ArgumentError(
            f"pushover: the pattern {pattern!r} does not move {DISPLACEMENTS[axis]} of {place}; "
            "give another control place or pattern"
        )
    return lambda at: form(at) / at_place


def _forces(scene: Scene, axis: int, shape: Shape) -> list[Load]:
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
    ended_early = abs(left) > MISSED * max(abs(target), abs(before + target))
    return path, events, "too many steps" if ended_early else ""
