# SPDX-License-Identifier: MIT
"""Controls of static paths, which set the lengths of their steps."""

from __future__ import annotations

import math
from abc import abstractmethod
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field

import numpy as np

from ufl_beam.analysis.critical_points import Direction
from ufl_beam.analysis.path_corrector import Control, PathCorrector, Plane
from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, StepFailed, require_kind, require_number
from ufl_beam.model.bodies import Place
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS
from ufl_beam.simulation.stepper import Trial

LEAST_REST = 1e-3  # least part of a step of arc length that is left beyond a kink


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
                raise failure.saying(
                    f"{failure}; perhaps {what} turns back here, where this control cannot "
                    "follow: take ArcLength"
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
