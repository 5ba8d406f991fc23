# SPDX-License-Identifier: MIT
"""Controls of static paths: what decides how long their steps are."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from ufl_beam.analysis.critical_points import Direction
from ufl_beam.analysis.path_corrector import Walk
from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, StepFailed, require_kind, require_number
from ufl_beam.model.beams import Place
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS
from ufl_beam.simulation.simulation import Trial

SHORTEST = 1e-3
"""Part of a step of arc length that is gone at least beyond a bend."""


# -- equations of steps --------------------------------------------------------------------------


class Plane:
    """A linear equation: how far a step goes along a normal.

    Args:
        walk: What steps.
        normal: In the space of configurations and load factors.
        reach: How far.
        gone: Where this is measured from, seen from the accepted state; from there without it.
    """

    def __init__(
        self, walk: Walk, normal: Direction, reach: float, gone: Direction | None = None
    ) -> None:
        self._total, self._normal, self._reach = walk.share.total, normal, reach
        self._q0, self._t0 = walk.simulation.q, walk.simulation.t
        if gone is not None:
            self._q0, self._t0 = self._q0 + gone.q, self._t0 + gone.t

    def miss(self, q: Array, t: float) -> float:
        """Part of the reach."""
        gone = self.slope(q, Direction(q - self._q0, t - self._t0))
        return gone - 1.0

    def slope(self, q: Array, way: Direction) -> float:
        """Derivative of the equation along a direction; it is the same at any state."""
        along = self._total(float(self._normal.q @ way.q)) + self._normal.t * way.t
        return along / self._reach


class Given:
    """A load factor that is given.

    Args:
        t: The load factor.
    """

    def __init__(self, t: float) -> None:
        self._t = t

    def miss(self, q: Array, t: float) -> float:
        """Residual of the equation: missing change of the load factor."""
        return t - self._t

    def slope(self, q: Array, way: Direction) -> float:
        """That of the load factor."""
        return way.t


class Dissipated:
    """Constraint of the energy that is dissipated in a step.

    Args:
        walk: What steps.
        reach: J.
    """

    def __init__(self, walk: Walk, reach: float) -> None:
        self._walk, self._reach = walk, reach

    def miss(self, q: Array, t: float) -> float:
        """Part of the reach."""
        return self._walk.dissipation(q) / self._reach - 1.0

    def slope(self, q: Array, way: Direction) -> float:
        """By a central difference over a small part of the step; nothing else asks for it."""
        size = self._walk.size(way)
        gone = self._walk.size(Direction(q - self._walk.simulation.q, 0.0))
        if size == 0.0:
            return 0.0
        ε = 1e-3 * gone / size
        return (self.miss(q + ε * way.q, 0.0) - self.miss(q - ε * way.q, 0.0)) / (2 * ε)


def _across(walk: Walk, normal: Direction, reach: float, what: str) -> Trial:
    """Solve for where the path reaches a plane; ``what`` is the quantity that grows towards it.

    Raises:
        StepFailed: It does not reach it.
    """

    def along(way: Direction) -> float:
        return walk.share.total(float(normal.q @ way.q)) + normal.t * way.t

    def length(rest: float, way: Direction) -> float:
        """Return the length of the step along a direction."""
        speed = along(way)
        if not speed * reach > 0:
            raise StepFailed(f"{what} turns back, where this control cannot follow; take ArcLength")
        return rest / speed

    way, plane = walk.direction, Plane(walk, normal, reach)
    size = length(reach, way)
    try:
        return walk.attempt(way, size, plane)
    except StepFailed as failure:
        if (bend := walk.bend(size)) is None:
            more = f"{failure}; perhaps {what} turns back here, where this control cannot follow"
            raise failure.saying(f"{more}: take ArcLength") from None
    gone, way = bend
    return walk.attempt(
        _joined(gone, way, length(reach - along(gone), way)), 1.0, plane, hold=False
    )


def _joined(gone: Direction, way: Direction, length: float) -> Direction:
    """A direction, and so far along another one from its end."""
    return Direction(gone.q + length * way.q, gone.t + length * way.t)


# -- controls ----------------------------------------------------------------------------------


@runtime_checkable
class Control(Protocol):
    """Protocol of path controls, which set the lengths of steps."""

    @property
    def factor(self) -> float:
        """Change of the load factor that counts as much as a unit of displacement."""

    def require(self, scene: Scene) -> None:
        """Raise :class:`SceneError` if the control does not fit the scene."""

    def ahead(self, walk: Walk, way: Direction) -> float:
        """Positive if ``way`` is the one in which a path begins."""

    def onward(self, walk: Walk, gone: Direction, way: Direction) -> float:
        """Positive if a path that came by ``gone`` in the step goes on along ``way``."""

    def seek(self, walk: Walk, part: float) -> Trial:
        """Solve for the end of a step, or of a part of it.

        Raises:
            StepFailed: There is none.
        """


def _require_step(step: float, what: str) -> None:
    require_number(step, f"{what}: step")
    if step == 0:
        raise SceneError(f"{what}: step = 0 leads nowhere")


@dataclass(frozen=True)
class ArcLength:
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
        >>> arch = ub.Beam.polyline([(0, 0), (2, 0.2), (4, 0)], rod)
        >>> down = ub.PointLoad(arch.at(0.5), force=(0, -1e5), time=lambda t: t)
        >>> shallow = ub.Scene([arch], [], [ub.Pinned(arch.start), ub.Pinned(arch.end)], [down])
        >>> path = ub.follow(shallow, ub.ArcLength(0.1), steps=40)  # it snaps through
        >>> print([round(point.factor, 2) for point in path.critical if point.kind == "limit"])
        [0.56, -0.14]
    """

    step: float
    _: KW_ONLY
    factor: float = 1.0

    def __post_init__(self) -> None:
        _require_step(self.step, "ArcLength")
        require_number(self.factor, "ArcLength: factor", positive=True)

    def require(self, scene: Scene) -> None:
        """It fits all scenes."""

    def ahead(self, walk: Walk, way: Direction) -> float:
        """The sign of the step is that of the first change of the load factor."""
        return self.step * way.t

    def onward(self, walk: Walk, gone: Direction, way: Direction) -> float:
        """Choose the direction: plastic flow and openings go on, else the turn is below π/2."""
        side = walk.side(walk.simulation.q + gone.q, way)
        return side or walk.product(gone, way, self.factor)

    def seek(self, walk: Walk, part: float) -> Trial:
        """On the plane across the direction."""
        reach = abs(self.step) * part
        unit = self._unit(walk, walk.direction)
        try:
            return walk.attempt(unit, reach, Plane(walk, self._across(walk, unit), reach))
        except StepFailed:
            if (bend := walk.bend(reach / walk.length(walk.direction, self.factor))) is None:
                raise
        gone, unit = bend[0], self._unit(walk, bend[1])
        rest = max(reach - walk.length(gone, self.factor), SHORTEST * reach)
        plane = Plane(walk, self._across(walk, unit), rest, gone)
        return walk.attempt(_joined(gone, unit, rest), 1.0, plane, hold=False)

    def _unit(self, walk: Walk, way: Direction) -> Direction:
        """A direction of length one."""
        size = walk.length(way, self.factor)
        return Direction(np.asarray(way.q / size, dtype=np.float64), way.t / size)

    def _across(self, walk: Walk, unit: Direction) -> Direction:
        """Normal of the plane across a direction."""
        across: Array = np.asarray(walk.weights * unit.q, dtype=np.float64)
        return Direction(across, unit.t / self.factor**2)


@dataclass(frozen=True)
class LoadControl:
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

    def __post_init__(self) -> None:
        _require_step(self.step, "LoadControl")

    def require(self, scene: Scene) -> None:
        """It fits all scenes."""

    def ahead(self, walk: Walk, way: Direction) -> float:
        """As the load factor changes."""
        return self.step * way.t

    def onward(self, walk: Walk, gone: Direction, way: Direction) -> float:
        """As the load factor changes."""
        return self.ahead(walk, way)

    def seek(self, walk: Walk, part: float) -> Trial:
        """At the next load factor."""
        normal = Direction(np.zeros(walk.share.size), 1.0)
        return _across(walk, normal, self.step * part, "the load factor")


@dataclass(frozen=True)
class DisplacementControl:
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
        """The beam of the place is in the scene."""
        if self.place.beam not in scene.beams:
            raise SceneError(
                f"DisplacementControl of {self.place}: {self.place.beam.name} is not in the scene"
            )

    def _normal(self, walk: Walk) -> Direction:
        share, normal = walk.share, np.zeros(walk.share.grid.size)
        nodes, weights = share.grid.weights(self.place)
        normal[share.grid.dofs[nodes, COMPONENTS.index(self.component)]] += weights
        local = normal[share.dofs]
        local[share.num_owned :] = 0.0
        return Direction(local, 0.0)

    def ahead(self, walk: Walk, way: Direction) -> float:
        """As the place moves."""
        return self.step * walk.share.total(float(self._normal(walk).q @ way.q))

    def onward(self, walk: Walk, gone: Direction, way: Direction) -> float:
        """As the place moves."""
        return self.ahead(walk, way)

    def seek(self, walk: Walk, part: float) -> Trial:
        """At the next displacement."""
        what = f"{self.component} of {self.place}"
        return _across(walk, self._normal(walk), self.step * part, what)


@dataclass(frozen=True)
class DissipationControl:
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
        """That of the arc length."""
        return self.otherwise.factor

    def require(self, scene: Scene) -> None:
        """It fits all scenes; of elastic ones it follows the path by arc length."""

    def ahead(self, walk: Walk, way: Direction) -> float:
        """As the arc length begins."""
        return self.otherwise.ahead(walk, way)

    def onward(self, walk: Walk, gone: Direction, way: Direction) -> float:
        """As the arc length goes on."""
        return self.otherwise.onward(walk, gone, way)

    def seek(self, walk: Walk, part: float) -> Trial:
        """At the next dissipated energy, unless a step of arc length dissipates nothing."""
        if not walk.dissipates:
            try:
                trial = self.otherwise.seek(walk, part)
            except StepFailed:
                return self._spend(walk, part)
            if walk.dissipation(trial.q1) == 0.0:
                return trial
        try:
            return self._spend(walk, part)
        except StepFailed:
            if not walk.dissipates:
                raise
        return self.otherwise.seek(walk, part)

    def _spend(self, walk: Walk, part: float) -> Trial:
        reach = self.step * part
        return walk.attempt(walk.aim(reach), 1.0, Dissipated(walk, reach), hold=False)
