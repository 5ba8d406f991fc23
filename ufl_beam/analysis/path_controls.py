# SPDX-License-Identifier: MIT
"""Controls of static paths, and the corrector that solves their steps.

A step ends in an equilibrium that fulfils the equation of a control, with the load factor unknown.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field
from typing import NamedTuple

import numpy as np

from ufl_beam.analysis.critical_points import Direction, Stiffness, metric
from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, StepFailed, require_kind, require_number
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.bodies import Place
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.stepper import Trial
from ufl_beam.terms.base import Term

MOST_DOUBLINGS = 30  # doublings of a step until something dissipates in it
ONSET_PART = 1e-6  # part of the dissipated energy of a step at which its onset is looked at
CONTROL_TOLERANCE = 1e-9  # part of a step by which its end may miss the equation of the control
LEAST_REST = 1e-3  # least part of a step of arc length that is left beyond a kink


@dataclass(frozen=True)
class Plane:
    """Linear constraint: a step ends at a distance ``reach`` along a normal from ``start``."""

    corrector: PathCorrector
    normal: Direction
    reach: float
    start: Direction

    def residual(self, q: Array, t: float) -> float:
        """Missing part of the reach."""
        return self.derivative(q, Direction(q - self.start.q, t - self.start.t)) - 1.0

    def derivative(self, q: Array, way: Direction) -> float:
        """Derivative of the equation along a direction; it is the same at any state."""
        return self.corrector.along(self.normal, way) / self.reach


@dataclass(frozen=True)
class DissipatedEnergy:
    """Constraint of the energy (J) that is dissipated in a step."""

    corrector: PathCorrector
    energy: float

    def residual(self, q: Array, t: float) -> float:
        """Missing part of the energy."""
        return self.corrector.dissipation(q) / self.energy - 1.0

    def derivative(self, q: Array, way: Direction) -> float:
        """Derivative of the equation, by a central difference over a small part of the step."""
        size = self.corrector.size(way)
        gone = self.corrector.size(Direction(q - self.corrector.simulation.q, 0.0))
        if size == 0.0:
            return 0.0
        ε = 1e-3 * gone / size
        return (self.residual(q + ε * way.q, 0.0) - self.residual(q - ε * way.q, 0.0)) / (2 * ε)


class Crossing(NamedTuple):
    """Step to a bifurcation point, with the critical mode there.

    Along the mode the tangent is singular, and the load does no work: a correction along it is
    round-off over zero.  So only the load factor moves the step along the mode, as it moves the
    path: ``speed`` is its motion along the mode for a unit of the load factor.  The mode is in the
    axes of supports.
    """

    predicted: Direction
    mode: Array
    speed: float


class PathCorrector:
    """Newton corrector of a path: equilibrium together with the equation of the control.

    A change ``factor`` of the load factor counts as much as a unit of displacement.  Steps are
    predicted and corrected by ``crossing``, where there is one.
    """

    def __init__(self, simulation: Simulation, factor: float) -> None:
        self.simulation, self.factor = simulation, factor
        self.share = simulation.share
        self.weights = metric(self.share)
        self._all_weights = self.share.gather(self.weights)
        self.t = simulation.t
        self.dissipates = False
        self.crossing: Crossing | None = None
        self._driven: list[Term] = [*simulation.loads, *simulation.couplings]
        self.direction: Direction = Direction(np.zeros(self.share.size), 0.0)
        self.sought = self.direction

    @property
    def start(self) -> Direction:
        """State and load factor at the beginning of the step."""
        return Direction(self.simulation.q, self.simulation.t)

    # -- measures ------------------------------------------------------------------------------

    def product(self, a: Direction, b: Direction) -> float:
        """Return the inner product of two directions; dimensionless."""
        return self.share.total(float((self.weights * a.q) @ b.q)) + a.t * b.t / self.factor**2

    def along(self, normal: Direction, way: Direction) -> float:
        """Return the derivative along ``way`` of a linear quantity with the gradient ``normal``."""
        return self.share.total(float(normal.q @ way.q)) + normal.t * way.t

    def length(self, way: Direction) -> float:
        """Return the length of a direction, however small; dimensionless."""
        along = abs(way.t) / self.factor
        largest = max(self.share.largest(float(np.abs(way.q).max(initial=0.0))), along)
        if largest == 0.0 or not math.isfinite(largest):
            return largest
        # Squares of what is below 1e-154 would be nothing.
        unit = way / largest
        return largest * math.sqrt(self.product(unit, unit))

    def size(self, way: Direction) -> float:
        """Return the length of a direction's part in the configuration; dimensionless."""
        return self.length(Direction(way.q, 0.0))

    def dissipation(self, q: Array) -> float:
        """Return the energy that beams and springs dissipate in the step to ``q``; J."""
        in_cells = sum(one.dissipation(q) for one in self.simulation.inelastic)
        here = sum((one.dissipation(q) for one in self.simulation.couplings), in_cells)
        return self.share.total(here)

    def predict_dissipation(self, energy: float) -> Direction:
        """Predict a step that dissipates so much energy (J); :class:`StepFailed` if none does.

        Where nothing dissipated before, the direction changes as soon as something does.
        """
        way = self.direction
        self.begin()
        gone = Direction(np.zeros(self.share.size), 0.0)
        if not self.dissipates:
            gone = self._until(ONSET_PART * energy, gone, way)
            way = self._beyond(gone)
        return self._until(energy, gone, way)

    def kink(self, length: float) -> tuple[Direction, Direction] | None:
        """Find the step to where dissipation begins within a length, and the direction beyond."""
        way, q = self.direction, self.simulation.q
        self.begin()
        if self.dissipates or not self.dissipation(q + length * way.q) > 0:
            return None
        begun = bisect(lambda part: self.dissipation(q + part * way.q) > 0, 0.0, length, 40)
        gone = begun * way
        return gone, self._beyond(gone)

    def _beyond(self, gone: Direction) -> Direction:
        """Direction of the path where something has just begun to dissipate."""
        self.t, q = self.simulation.t + gone.t, self.simulation.q + gone.q
        way = self.direction_of(self.stiffness_at(q))
        return -way if self.dissipation_side(q, way) < 0 else way

    def _until(self, energy: float, gone: Direction, way: Direction) -> Direction:
        """Extend the step so far along a direction until it dissipates an energy; J."""

        def enough(length: float) -> bool:
            return self.dissipation(self.simulation.q + gone.q + length * way.q) >= energy

        low, high = 0.0, 1e-6 / self.length(way)
        for _ in range(MOST_DOUBLINGS):
            if enough(high):
                break
            low, high = high, 2 * high
        else:
            raise StepFailed("nothing dissipates in the direction of the path")
        return gone + bisect(enough, low, high, 12) * way

    def dissipation_side(self, q: Array, way: Direction) -> float:
        """Positive where more dissipates in a direction from ``q``, negative where against it."""
        now, size = self.dissipation(q), self.size(way)
        here = any(one.response.way.any() for one in self.simulation.couplings)
        flows = self.share.total(float(here))
        for doubled in range(MOST_DOUBLINGS if (now > 0 or flows) and size > 0 else 0):
            δ = 1e-9 * 2**doubled / size
            more = self.dissipation(q + δ * way.q) - self.dissipation(q - δ * way.q)
            if abs(more) > now:
                return more
        return 0.0

    # -- the border ----------------------------------------------------------------------------

    def step_at(self, t: float) -> Step:
        """Return an infinitely slow step to a load factor: rates and viscous forces vanish."""
        return Step(-math.inf, t, self.simulation.q, load_time=t, motion_time=t, fraction=1.0)

    def _driven_forces(self, q: Array, t: float) -> Array:
        """Forces of all that depends on the load factor, which is t from now on."""
        self.simulation.equation.begin(self.step_at(t), self._driven)
        forces = np.zeros(self.share.size)
        for term in self._driven:
            term.add_residual(q, forces)
        return forces

    def _moved(self, t: float) -> Array:
        """Return the prescribed motions at the degrees of freedom of supports; zero elsewhere."""
        x = np.zeros(self.share.size)
        self.simulation.supports.move(x, x, self.step_at(t))
        return x

    def arrive(self, x: Array) -> None:
        """Bring the loads to the load factor of an iterate."""
        self._x = x.copy()
        self.simulation.equation.begin(self.step_at(self.t), self._driven)

    def tangent(self, x: Array, r: Array) -> None:
        """Fill the matrix, and the derivative by the load factor, exact for linear functions."""
        simulation, t = self.simulation, self.t
        q, ε = simulation.supports.in_plane(x), 1e-6 * max(1.0, abs(t))
        for sign in (1, -1):
            r += sign / (2 * ε) * self._driven_forces(q, t + sign * ε)
        self._driven_forces(q, t)
        simulation.supports.enter(r)
        self._rates = np.asarray((self._moved(t + ε) - self._moved(t - ε)) / (2 * ε), dtype=float)
        self._A = simulation.equation.tangent_at(x, self._rates, r)

    def correct(self, y: Array, z: Array) -> None:
        """Correct an iterate by the linearised equation of the control."""
        supports, moving = self.simulation.supports, self.simulation.supports.moving
        if len(moving):
            z = z - self._rates
        if self.crossing is not None:
            mode = Direction(self.crossing.mode, 0.0)
            y -= self.product(Direction(y, 0.0), mode) * mode.q
            along = self.product(Direction(z, 0.0), mode) + self.crossing.speed
            z = z - along * mode.q
        q = supports.in_plane(self._x)
        residual = self._constraint.residual(q, self.t)
        by_y = self._constraint.derivative(q, Direction(supports.in_plane(y), 0.0))
        by_z = self._constraint.derivative(q, Direction(supports.in_plane(z), -1.0))
        change = (residual - by_y) / by_z if by_z else math.nan
        y += change * z
        self.t += change
        y[moving] = self._x[moving] - self._moved(self.t)[moving]

    def met(self) -> bool:
        """Return whether the equation of the control is fulfilled."""
        q = self.simulation.supports.in_plane(self._x)
        return abs(self._constraint.residual(q, self.t)) <= CONTROL_TOLERANCE

    # -- a step --------------------------------------------------------------------------------

    def attempt(
        self, predicted: Direction, constraint: Plane | DissipatedEnergy, *, hold: bool = True
    ) -> Trial:
        """Solve for an equilibrium under a constraint, beginning with a predicted step.

        Closed openings that do not flow are held closed if they can be, see material_points.py,
        unless ``hold`` is false, as in a direction in which they open.
        """
        if self.crossing is not None:
            predicted = self.crossing.predicted
        self._constraint, self.sought = constraint, predicted
        simulation = self.simulation
        self.t = simulation.t + predicted.t
        step, guess = self.step_at(self.t), simulation.q + predicted.q
        simulation.supports.enter(guess)
        simulation.together(simulation.supports.move, guess, guess, step)
        trial = simulation.attempt_along(step, guess, self, hold=hold)
        return trial._replace(step=self.step_at(self.t))

    def begin(self) -> None:
        """Let all terms begin a step at the present state and load factor."""
        simulation = self.simulation
        simulation.together(simulation.equation.begin, self.step_at(simulation.t))

    def stiffness_at(self, q: Array) -> Stiffness:
        """Return the tangent stiffness at a state."""
        supports = self.simulation.supports
        for _ in range(2):  # the first tangent of a step is that of the forces before it
            rate = np.zeros(self.share.size)
            self.simulation.together(self.tangent, supports.in_axes(q), rate)
        return Stiffness(self.share, self._A, supports.dofs, rate, self._all_weights)

    def direction_of(self, stiffness: Stiffness) -> Direction:
        """Return the direction of the path in which the load factor grows."""
        q = stiffness.flow[self.share.dofs] + self._rates
        self.simulation.supports.leave(q)
        way = Direction(q, 1.0)
        size = self.length(way)
        if not math.isfinite(size) or not self.size(way) > 0:
            raise StepFailed(
                "nothing moves with the load factor here; let a load or a motion go on to change, "
                "as with time=lambda t: t"
            )
        return way / size


def bisect(reached: Callable[[float], bool], low: float, high: float, halvings: int) -> float:
    """Find by bisection where something is reached: at the upper end of what is left."""
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (low, middle) if reached(middle) else (middle, high)
    return high


class Control(ABC):
    """Base class of path controls, which set the lengths of steps."""

    @property
    @abstractmethod
    def factor(self) -> float:
        """Change of the load factor that counts as much as a unit of displacement."""

    def require(self, scene: Scene) -> None:
        """Raise :class:`SceneError` if the control does not fit the scene."""

    @abstractmethod
    def sense(self, corrector: PathCorrector, way: Direction, gone: Direction | None) -> float:
        """Positive if a path that came by ``gone``, or begins (None), goes on along ``way``."""

    @abstractmethod
    def solve_step(self, corrector: PathCorrector, part: float) -> Trial:
        """Solve for the end of a step, or of a part of it; :class:`StepFailed` if there is none."""


def _require_step(step: float, what: str) -> None:
    require_number(step, f"{what}: step")
    if step == 0:
        raise SceneError(f"{what}: step = 0 leads nowhere")


@dataclass(frozen=True)
class ArcLength(Control):
    """Arc-length control: passes limit points of loads and of displacements.

    The length is the root mean square of all displacements over the size of the scene, of all
    rotations (rad), and of the change of the load factor over ``factor``.

    Args:
        step: Longest step; a negative one begins with a falling load factor.
        factor: Change of the load factor that counts as much as a length of 1.

    Raises:
        SceneError: No step, or ``factor`` is not positive.

    Example:
        >>> rod = ub.Section.circle(d=0.05, E=210e9, nu=0.3)
        >>> half = ub.Beam((0, 0), (2, 0.2), rod, cells=8)  # of a shallow arch
        >>> crown = ub.Prescribed(half.end, u=0, psi=0)
        >>> down = ub.PointLoad(half.end, force=(0, -5e4), time=lambda t: t)
        >>> arch = ub.Scene([half], supports=[ub.Pinned(half.start), crown], loads=[down])
        >>> path = ub.follow(arch, ub.ArcLength(0.1), steps=40)  # it snaps through
        >>> print([round(point.factor, 2) for point in path.critical if point.kind == "limit"])
        [0.49, -0.1]
    """

    step: float
    _: KW_ONLY
    factor: float = 1.0

    def __post_init__(self) -> None:
        _require_step(self.step, "ArcLength")
        require_number(self.factor, "ArcLength: factor", positive=True)

    def sense(self, corrector: PathCorrector, way: Direction, gone: Direction | None) -> float:
        """First the sign of the step, later that of flow and openings, else by turns below π/2."""
        if gone is None:
            return self.step * way.t
        side = corrector.dissipation_side(corrector.simulation.q + gone.q, way)
        return side or corrector.product(gone, way)

    def solve_step(self, corrector: PathCorrector, part: float) -> Trial:
        """Solve on the plane across the direction of the path."""
        reach, way = abs(self.step) * part, corrector.direction
        size = corrector.length(way)
        unit = way / size
        try:
            plane = Plane(corrector, self._across(corrector, unit), reach, corrector.start)
            return corrector.attempt(reach * unit, plane)
        except StepFailed:
            if (kink := corrector.kink(reach / size)) is None:
                raise
        gone, way = kink
        unit = way / corrector.length(way)
        rest = max(reach - corrector.length(gone), LEAST_REST * reach)
        plane = Plane(corrector, self._across(corrector, unit), rest, corrector.start + gone)
        return corrector.attempt(gone + rest * unit, plane, hold=False)

    def _across(self, corrector: PathCorrector, unit: Direction) -> Direction:
        """Normal of the plane across a direction."""
        return Direction(np.asarray(corrector.weights * unit.q), unit.t / self.factor**2)


class _QuantityControl(Control):
    """Control of a quantity that is linear in the configuration and the load factor."""

    step: float

    @abstractmethod
    def _normal(self, corrector: PathCorrector) -> Direction:
        """Gradient of the quantity."""

    @property
    @abstractmethod
    def _quantity(self) -> str:
        """The quantity in words."""

    def sense(self, corrector: PathCorrector, way: Direction, gone: Direction | None) -> float:
        """Positive if the quantity changes along ``way`` as ``step`` says."""
        return self.step * corrector.along(self._normal(corrector), way)

    def solve_step(self, corrector: PathCorrector, part: float) -> Trial:
        """Solve at the next value of the quantity."""
        reach, what, normal = self.step * part, self._quantity, self._normal(corrector)

        def length(rest: float, way: Direction) -> float:
            """Return the length of the step along a direction."""
            speed = corrector.along(normal, way)
            if not speed * reach > 0:
                raise StepFailed(
                    f"{what} turns back, where this control cannot follow; take ArcLength"
                )
            return rest / speed

        plane = Plane(corrector, normal, reach, corrector.start)
        size = length(reach, corrector.direction)
        try:
            return corrector.attempt(size * corrector.direction, plane)
        except StepFailed as failure:
            if (kink := corrector.kink(size)) is None:
                raise StepFailed(
                    f"{failure}; perhaps {what} turns back here, where this control cannot "
                    "follow: take ArcLength",
                    failure.residuals,
                ) from None
        gone, way = kink
        rest = length(reach - corrector.along(normal, gone), way)
        return corrector.attempt(gone + rest * way, plane, hold=False)


@dataclass(frozen=True)
class LoadControl(_QuantityControl):
    """Load control: equal steps of the load factor, up to the limit load.

    Args:
        step: Change of the load factor; negative downwards.

    Raises:
        SceneError: No step.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.25), steps=4)
        >>> print(path.factor)
        [0.   0.25 0.5  0.75 1.  ]
    """

    step: float
    factor = 1.0
    _quantity = "the load factor"

    def __post_init__(self) -> None:
        _require_step(self.step, "LoadControl")

    def _normal(self, corrector: PathCorrector) -> Direction:
        return Direction(np.zeros(corrector.share.size), 1.0)


@dataclass(frozen=True)
class DisplacementControl(_QuantityControl):
    """Displacement control of one component at a place: passes limit points of loads.

    Args:
        place: Place of a beam.
        component: "u", "v" or "psi".
        step: Change of the component; m or rad.

    Raises:
        SceneError: Not a place of a beam, another component, no step.

    Example:
        >>> control = ub.DisplacementControl(beam.end, "v", -0.05)
        >>> path = ub.follow(scene, control, steps=4)
        >>> print(path.displacement(beam.end)[:, 1].round(6))
        [ 0.   -0.05 -0.1  -0.15 -0.2 ]
    """

    place: Place
    component: str
    step: float
    factor = math.inf

    def __post_init__(self) -> None:
        require_kind(self.place, Place, "DisplacementControl: place")
        if self.component not in COMPONENTS:
            raise SceneError(
                f"DisplacementControl: component = {self.component!r} must be one of "
                f"{', '.join(COMPONENTS)}"
            )
        _require_step(self.step, "DisplacementControl")

    def require(self, scene: Scene) -> None:
        """Raise :class:`SceneError` unless the beam of the place is in the scene."""
        if self.place.beam not in scene.beams:
            raise SceneError(
                f"DisplacementControl of {self.place}: {self.place.beam.name} is not in the scene"
            )

    def _normal(self, corrector: PathCorrector) -> Direction:
        share, normal = corrector.share, np.zeros(corrector.share.grid.size)
        nodes, weights = share.grid.weights(self.place)
        normal[share.grid.dofs[nodes, COMPONENTS.index(self.component)]] += weights
        local = normal[share.dofs]
        local[share.num_owned :] = 0.0
        return Direction(local, 0.0)

    @property
    def _quantity(self) -> str:
        return f"{self.component} of {self.place}"


@dataclass(frozen=True)
class DissipationControl(Control):
    """Dissipation control by the energy that hinges and yielding beams lose: sharp snap-backs.

    Softening and unloading may begin in nearly the same direction; only one of them dissipates.

    Args:
        step: Dissipated energy of a step; J.
        otherwise: Steps where nothing dissipates; arc length.

    Raises:
        SceneError: ``step`` is not positive.

    Example:
        >>> pull = ub.PointLoad(weak.end, force=(0, -1e5), time=lambda t: t)
        >>> pulled = ub.Scene([weak], supports=[ub.Clamped(weak.start)], loads=[pull])
        >>> path = ub.follow(pulled, ub.DissipationControl(50.0), steps=15)
        >>> print(path.factor.max().round(2))  # at the limit of the hinge
        0.25
    """

    step: float
    otherwise: ArcLength = field(default_factory=lambda: ArcLength(0.05))

    def __post_init__(self) -> None:
        require_number(self.step, "DissipationControl: step", positive=True)
        require_kind(self.otherwise, ArcLength, "DissipationControl: otherwise")

    @property
    def factor(self) -> float:
        """Factor of the arc length."""
        return self.otherwise.factor

    def sense(self, corrector: PathCorrector, way: Direction, gone: Direction | None) -> float:
        """That of the arc length."""
        return self.otherwise.sense(corrector, way, gone)

    def solve_step(self, corrector: PathCorrector, part: float) -> Trial:
        """Solve at the next dissipated energy, unless a step of arc length dissipates nothing."""
        if corrector.dissipates:
            with suppress(StepFailed):
                return self._dissipate(corrector, part)
            return self.otherwise.solve_step(corrector, part)
        with suppress(StepFailed):
            trial = self.otherwise.solve_step(corrector, part)
            if corrector.dissipation(trial.q1) == 0.0:
                return trial
        return self._dissipate(corrector, part)

    def _dissipate(self, corrector: PathCorrector, part: float) -> Trial:
        energy = self.step * part
        predicted = corrector.predict_dissipation(energy)
        return corrector.attempt(predicted, DissipatedEnergy(corrector, energy), hold=False)
