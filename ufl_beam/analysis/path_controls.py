# SPDX-License-Identifier: MIT
"""Controls of static paths, and the corrector that solves for steps.

A step ends in an equilibrium that fulfils the equation of a control.  The load factor is one of the
unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from ufl_beam.analysis.critical_points import Stiffness
from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, Reversal, StepFailed, require_number
from ufl_beam.mechanics.time_scheme import Step
from ufl_beam.model.bodies import Place
from ufl_beam.model.records import Instance, Number, Positive, Record
from ufl_beam.model.scene import Scene, not_in
from ufl_beam.model.supports import COMPONENTS
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.stepper import Trial
from ufl_beam.terms.term import Term

MOST_DOUBLINGS = 30  # largest number of doublings of a step in searches for a dissipated energy
BEYOND_LIMIT = 1e-9  # length of a motion beyond a limit, which lets a hinge or spring open
ONSET_FRACTION = 1e-6  # dissipated energy at the onset, as a fraction of the energy in the step
AT_END = 1e-6  # distance from the end of a path that counts as none, as a fraction of a step
CONTROL_TOLERANCE = 1e-9  # largest error of the equation of the control, as a fraction of a step


class Crossing(NamedTuple):
    """Step to a bifurcation point, with the critical mode there.

    Along the mode the tangent is singular and the load does no work, so a correction along the mode
    would be round-off divided by zero.  Therefore this component of the correction is
    prescribed: ``speed`` times the change of the load factor, the ratio on the path.  The component
    is the product with ``weighted``, the mode times the weights of the norm, in the axes of the
    supports.  The correction along the mode is removed by a multiple of K⁻¹ ``weighted``, with the
    tangent K: an error of the mode would cause forces in stiff cells.
    """

    predicted: Array
    weighted: Array
    speed: float


class PathCorrector:
    """Newton corrector of a path: equilibrium together with the equation of the control.

    A change ``factor`` of the load factor has the length 1.  While a step to a bifurcation point is
    solved, ``crossing`` has the prediction and the critical mode.

    Attributes:
        weights: Weights of the squares in the norm of a direction.  Displacements are divided by
            the size of the scene, the load factor by ``factor``.  The squares of displacements and
            rotations are averaged.  Degrees of freedom owned by another process have the weight
            zero, because norms are summed over the processes.
        factor_gradient: Gradient of the load factor.
        direction: Direction of the path at the beginning of the step.
        predicted_step: The predicted step.
        dissipates: True if energy was dissipated in the latest accepted step.
        onset: True if the path dissipates energy from the latest accepted state on.
    """

    def __init__(self, simulation: Simulation, factor: float) -> None:
        self.simulation, self.factor = simulation, factor
        self.subdomain = subdomain = simulation.subdomain
        numbering = subdomain.numbering
        squares = numbering.scales[subdomain.dofs] ** 2
        squares[subdomain.num_owned :] = 0.0
        squares /= numbering.size - len(numbering.multipliers)
        self._all_weights = subdomain.gather(squares)
        self.factor_gradient = np.append(0.0 * squares, subdomain.comm.rank == 0)
        self.weights = np.append(squares, 0.0) + self.factor_gradient / factor**2
        self.t = simulation.t
        self.dissipates = self.onset = False
        self.crossing: Crossing | None = None
        self._loading: list[Term] = [*simulation.loads, *simulation.connector_terms]
        # The forces of these cells depend on the load factor, too.
        self._imposed = simulation.equation.imposed
        self.direction = self.predicted_step = 0.0 * self.weights

    @property
    def start(self) -> Array:
        """Configuration and load factor at the beginning of the step."""
        return np.append(self.simulation.q, self.simulation.t)

    # -- measures ------------------------------------------------------------------------------

    def along(self, normal: Array, direction: Array) -> float:
        """Return the derivative of a quantity with the gradient ``normal`` along a direction."""
        return self.subdomain.total(float(normal @ direction))

    def length(self, direction: Array) -> float:
        """Return the length of a direction, without underflow; dimensionless."""
        largest = self.subdomain.largest(float(np.abs(direction[:-1]).max(initial=0.0)))
        largest = max(largest, abs(direction[-1]) / self.factor)
        if largest == 0.0 or not math.isfinite(largest):
            return largest
        # Squares of components below 1e-154 would underflow.
        unit = np.asarray(direction / largest)
        return largest * math.sqrt(self.along(self.weights * unit, unit))

    def size(self, motion: Array) -> float:
        """Return the length of a change of the configuration; dimensionless."""
        return self.length(np.append(motion, 0.0))

    def carried(self, direction: Array, trial: Trial) -> Array:
        """Return a direction at the end of a step, in the unknowns of the next step.

        In space, rotations in a step are conformal vectors in axes of the nodes before the step.
        """
        if not self.simulation.scene.in_space:
            return direction
        nodes, carried = self.subdomain.rotations.reshape(-1, 3), direction.copy()
        p, w = (trial.q1 - trial.step.q0)[nodes] / 4, direction[nodes]
        c, first = 1 / (1 + np.sum(p * p, axis=1, keepdims=True)), np.cross(w, p)
        carried[nodes] = c * (w + 2 * c * (first + np.cross(first, p)))
        return carried

    def dissipation(self, q: Array) -> float:
        """Return the energy that cells and connectors dissipate in the step to ``q``; J."""
        in_cells = sum(term.dissipation(q) for term in self.simulation.inelastic)
        local = sum((term.dissipation(q) for term in self.simulation.connector_terms), in_cells)
        return self.subdomain.total(local)

    def dissipation_side(self, q: Array, direction: Array) -> float:
        """Return how much more a motion along ``direction`` dissipates than one against it; J."""
        motion = direction[:-1]
        now, size = self.dissipation(q), self.size(motion)
        active = any(group.flow_direction.any() for group in self.simulation.connector_terms)
        flows = self.subdomain.total(float(active))
        for doubled in range(MOST_DOUBLINGS if (now > 0 or flows) and size > 0 else 0):
            δ = 1e-9 * 2**doubled / size
            more = self.dissipation(q + δ * motion) - self.dissipation(q - δ * motion)
            if abs(more) > now:
                return more
        return 0.0

    def kink(self, step: Array) -> tuple[Array, Array] | None:
        """Return the part of ``step`` up to an onset of dissipation, and the direction after it.

        The result is None if the last step dissipated energy, or if ``step`` does not.
        """
        q, motion = self.simulation.q, step[:-1]
        self.begin()
        if self.dissipates or not (whole := self.dissipation(q + motion)) > 0:
            return None
        increment = self._length_to(ONSET_FRACTION * whole, q, motion, (0.0, 1.0), 40) * step
        return increment, self.direction_beyond(increment)

    def onward(self) -> tuple[Array, Array]:
        """Return a first part of a step, and the direction after it.

        At an onset the part leads beyond the limit, which lets the hinge or spring open.
        """
        if not self.onset:
            return 0.0 * self.direction, self.direction
        self.begin()
        increment = BEYOND_LIMIT / self.length(self.direction) * self.direction
        return increment, self.direction_beyond(increment)

    def direction_beyond(self, step: Array) -> Array:
        """Return the direction at the end of ``step`` in which dissipation grows."""
        q, t = self.simulation.q + step[:-1], self.simulation.t + step[-1]
        _, direction = self.direction_at(q, t)
        return -direction if self.dissipation_side(q, direction) < 0 else direction

    def reverses(self, normal: Array, step: Array) -> bool:
        """Return whether the quantity with the gradient ``normal`` falls beyond ``step``.

        The result is true if a hinge or spring opens in the step beside others that flow already,
        so that more dissipation needs a motion against ``normal``.
        """
        with suppress(StepFailed):
            return self.dissipates and self.along(normal, self.direction_beyond(step)) < 0
        return False

    def until(self, energy: float, increment: Array, direction: Array) -> Array:
        """Extend a step from ``increment`` along a direction until it dissipates ``energy`` (J)."""
        q, motion = self.simulation.q + increment[:-1], direction[:-1]
        low, high = 0.0, 1e-6 / self.length(direction)
        for _ in range(MOST_DOUBLINGS):
            if self.dissipation(q + high * motion) >= energy:
                return increment + self._length_to(energy, q, motion, (low, high), 12) * direction
            low, high = high, 2 * high
        raise StepFailed(f"less than {energy:g} J dissipates in the direction of the path")

    def _length_to(
        self, energy: float, q: Array, motion: Array, between: tuple[float, float], halvings: int
    ) -> float:
        """Find by bisection how far to go along a motion from ``q`` to dissipate ``energy`` (J)."""
        low, high = between
        for _ in range(halvings):
            middle = (low + high) / 2
            enough = self.dissipation(q + middle * motion) >= energy
            low, high = (low, middle) if enough else (middle, high)
        return high

    # -- the border ----------------------------------------------------------------------------

    def step_at(self, t: float) -> Step:
        """Return a step to a load factor in infinite time, in which viscous forces vanish."""
        return Step(-math.inf, t, self.simulation.q, load_time=t, motion_time=t, fraction=1.0)

    def _moved(self, t: float) -> Array:
        """Return the prescribed motions at the degrees of freedom of supports; zero elsewhere."""
        x = np.zeros(self.subdomain.size)
        self.simulation.supports.move(x, x, self.step_at(t))
        return x

    def arrive(self, x: Array) -> None:
        """Store the iterate ``x``, and set the loads to the load factor :attr:`t`."""
        self._x = x.copy()
        self.simulation.equation.begin(self.step_at(self.t), self._loading, self._imposed)

    def tangent(self, x: Array, r: Array) -> None:
        """Assemble the tangent, and add the derivative of the residual by the load factor to ``r``.

        The derivative is a central difference, which is exact for linear time functions.
        """
        simulation, t = self.simulation, self.t
        q, ε = simulation.supports.in_plane(x), 1e-6 * max(1.0, abs(t))
        for δ, weight in ((ε, 0.5 / ε), (-ε, -0.5 / ε), (0.0, 0.0)):  # last: at the factor t
            simulation.equation.begin(self.step_at(t + δ), self._loading, self._imposed)
            forces = np.zeros(self.subdomain.size)
            for term in (*self._loading, *self._imposed):
                term.add_residual(q, forces)
            r += weight * forces
        simulation.supports.into_axes(r)
        self._rates = np.asarray((self._moved(t + ε) - self._moved(t - ε)) / (2 * ε), dtype=float)
        self._A = simulation.equation.tangent_at(x, self._rates, r)

    def correct(self, y: Array, z: Array, v: Array) -> None:
        """Find the load factor by the linearized control equation, and add its correction to ``y``.

        Corrections are subtracted from an iterate.  ``y`` is the correction at a constant load
        factor; ``z`` is the derivative of the correction with respect to the load factor; ``v`` is
        the solution for ``crossing.weighted``, if there is a crossing.
        """
        supports, moving = self.simulation.supports, self.simulation.supports.moving
        if len(moving):
            z = z - self._rates
        if self.crossing is not None:
            _, weighted, speed = self.crossing
            v /= self.along(weighted, v)
            y -= self.along(weighted, y) * v
            z = z - (self.along(weighted, z) + speed) * v
        by_y = self._error_derivative(np.append(supports.in_plane(y), 0.0))
        by_z = self._error_derivative(np.append(supports.in_plane(z), -1.0))
        change = (self._error(supports.in_plane(self._x)) - by_y) / by_z if by_z else math.nan
        y += change * z
        self.t += change
        y[moving] = self._x[moving] - self._moved(self.t)[moving]

    def met(self) -> bool:
        """Return whether the equation of the control is fulfilled."""
        return abs(self._error(self.simulation.supports.in_plane(self._x))) <= CONTROL_TOLERANCE

    def _error(self, q: Array) -> float:
        """Return the error of the control equation at ``q``, divided by ``target_change``."""
        if self._normal is None:
            return self.dissipation(q) / self._target_change - 1.0
        return self.along(self._normal, np.append(q, self.t) - self._end) / self._target_change

    def _error_derivative(self, direction: Array) -> float:
        """Return the derivative of :meth:`_error`, for energies by differences."""
        if self._normal is not None:
            return self.along(self._normal, direction) / self._target_change
        q, size = self.simulation.supports.in_plane(self._x), self.size(direction[:-1])
        if size == 0.0:
            return 0.0
        ε = 1e-3 * self.size(q - self.simulation.q) / size
        change = ε * direction[:-1]
        return (self._error(q + change) - self._error(q - change)) / (2 * ε)

    # -- a step --------------------------------------------------------------------------------

    def attempt(
        self, predicted: Array, normal: Array | None, target_change: float, *, hold: bool = True
    ) -> Trial:
        """Solve for an equilibrium on a plane through the end of a predicted step.

        Without ``normal``, solve for a step that dissipates the energy ``target_change`` (J).

        Args:
            predicted: Predicted step.
            normal: Gradient of the controlled quantity, normal to the plane.
            target_change: Change of this quantity in the step, by which its error is divided.
            hold: Whether hinges, cracks and springs that did not open in the last step stay closed
                if possible, see material_points.py; false along a direction in which they open.
        """
        simulation = self.simulation
        self._end, self._normal, self._target_change = self.start + predicted, normal, target_change
        self.predicted_step = predicted = (
            predicted if self.crossing is None else self.crossing.predicted
        )
        self.t = simulation.t + predicted[-1]
        step, guess = self.step_at(self.t), simulation.q + predicted[:-1]
        simulation.supports.into_axes(guess)
        simulation.together(simulation.supports.move, guess, guess, step)
        trial = simulation.attempt_along(step, guess, self, hold=hold)
        return trial._replace(step=self.step_at(self.t))

    def begin(self) -> None:
        """Let all terms begin a step at the present state and load factor."""
        simulation = self.simulation
        simulation.together(simulation.equation.begin, self.step_at(simulation.t))

    def direction_at(self, q: Array, t: float) -> tuple[Stiffness, Array]:
        """Return the stiffness of a state, and the direction of the path that raises the factor."""
        self.t, supports = t, self.simulation.supports
        for _ in range(2):  # the first tangent uses the forces before the step
            rate = np.zeros(self.subdomain.size)
            self.simulation.together(self.tangent, supports.in_axes(q), rate)
        stiffness = Stiffness(self.subdomain, self._A, supports.dofs, rate, self._all_weights)
        motion = stiffness.flow[self.subdomain.dofs] + self._rates
        supports.into_plane(motion)
        direction = np.append(motion, 1.0)
        size = self.length(direction)
        if not math.isfinite(size) or not self.size(motion) > 0:
            raise StepFailed(
                "nothing moves with the load factor here. If forces change without motion, as in "
                "a straight heated beam between fixed ends, give an imperfection, st.imperfect, or "
                "use simulate(scene, Static(), ...). Otherwise let a load or a motion continue to "
                "change, as with amplitude=lambda t: t"
            )
        return stiffness, direction / size


class Control(Record):
    """Base class of path controls, which determine the lengths of steps.

    A step changes the controlled quantity by ``step``, or by a fraction of ``step``.
    """

    step: float
    factor = 1.0  # change of the load factor that counts as much as a length of 1
    quantity = ""  # name of the controlled quantity if it may have an extremum on a path
    least_rest = 0.0  # least rest of a step after a kink, as a fraction of the step

    _refused: ClassVar[type[ArgumentError]] = ArgumentError

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.step == 0:
            raise ArgumentError(f"{type(self).__name__}: step = 0 leads nowhere")

    def require(self, scene: Scene) -> None:
        """Raise :class:`ArgumentError` if the control does not fit the scene."""

    def normal(self, corrector: PathCorrector, direction: Array) -> Array:
        """Return the gradient of the controlled quantity, with the sign for which it grows.

        By default the quantity is the arc length along ``direction``.
        """
        return np.asarray(corrector.weights * direction / corrector.length(direction))

    def shortened(self, corrector: PathCorrector, fraction: float) -> float:
        """Return the fraction of a step to the end of the path, at most ``fraction``; 0 there."""
        return fraction

    def sense(self, corrector: PathCorrector, direction: Array, increment: Array | None) -> float:
        """Return a positive number if the path continues along ``direction``.

        ``increment`` is the last step of the path, or None at the beginning of the path.
        """
        return corrector.along(self.normal(corrector, direction), direction)

    def solve_step(self, corrector: PathCorrector, fraction: float) -> Trial:
        """Solve for the end of a fraction of a step; raise :class:`StepFailed` if none is found.

        If the first attempt fails and dissipation begins in the step, a second attempt changes the
        direction at the onset of dissipation.
        """
        rest = target_change = abs(self.step) * fraction
        (increment, direction), hold = corrector.onward(), not corrector.onset
        while True:
            normal = self.normal(corrector, direction)
            speed = corrector.along(normal, direction)
            if speed == 0 and self.quantity:
                raise StepFailed(f"{self.quantity} is held, or does not move along the path here")
            if not speed > 0:
                raise Reversal(self.quantity)
            step = increment + rest / speed * direction
            try:
                return corrector.attempt(step, normal, target_change, hold=hold)
            except StepFailed as failure:
                kink = corrector.kink(step) if hold else None
                if kink is None and hold and self.quantity:
                    if corrector.reverses(normal, step):
                        raise Reversal(self.quantity) from None
                    raise StepFailed(
                        f"{failure}; perhaps {self.quantity} turns back here, where this control "
                        "cannot follow: use ArcLength",
                        failure.residuals,
                    ) from None
                if kink is None:
                    raise
            increment, direction = kink
            rest = max(
                target_change - corrector.along(normal, increment), self.least_rest * target_change
            )
            hold = False


@dataclass(frozen=True)
class ArcLength(Control):
    """Arc-length control, which passes limit points of loads and of displacements.

    Displacements are divided by the size of the scene, the change of the load factor by ``factor``.
    The square of the length is the mean square of all displacements and rotations (rad), plus the
    square of the load factor's change.

    Args:
        step: Longest step; with a negative step, the load factor falls initially.
        factor: Change of the load factor that counts as much as a length of 1.

    Raises:
        ArgumentError: ``step`` is zero, or ``factor`` is not positive.

    Example:
        >>> rod = ub.Section.circle(d=0.05, E=210e9, nu=0.3)
        >>> half = ub.Beam((0, 0), (2, 0.2), rod, cells=8)  # of a shallow arch
        >>> crown = ub.PrescribedDisplacement(half.end, u=0, psi=0)
        >>> down = ub.PointLoad(half.end, force=(0, -5e4), amplitude=lambda t: t)
        >>> arch = ub.Scene([half], supports=[ub.Pinned(half.start), crown], loads=[down])
        >>> path = ub.follow(arch, ub.ArcLength(0.1), steps=40)  # it snaps through
        >>> print([round(point.factor, 2) for point in path.critical if point.kind == "limit"])
        [0.49, -0.1]
    """

    step: Number
    _: KW_ONLY
    factor: Positive = 1.0
    least_rest = 1e-3

    def sense(self, corrector: PathCorrector, direction: Array, increment: Array | None) -> float:
        """Return a positive number if the path continues along ``direction``.

        At first the sign of ``step`` decides.  Later dissipation grows in this sense or, if it does
        not decide, the motion turns by less than π/2.  The load factor may turn by more, as where a
        spring has broken and others bear the load.
        """
        if increment is None:
            return self.step * float(direction[-1])
        side = corrector.dissipation_side(corrector.simulation.q + increment[:-1], direction)
        motion = np.append(increment[:-1], 0.0)
        return side or corrector.along(corrector.weights * motion, direction)

    def solve_step(self, corrector: PathCorrector, fraction: float) -> Trial:
        """Solve for the end of a step; if it fails, on a plane across the predicted motion.

        Where the last hinge of a mechanism opens, the path turns to a constant load factor, which
        may be parallel to the plane across the predicted step.  Dissipation tells its sense.
        """
        try:
            return super().solve_step(corrector, fraction)
        except StepFailed as failure:
            step = abs(self.step) * fraction * corrector.direction
            normal = corrector.weights * np.append(step[:-1], 0.0)
            if not (size := corrector.along(normal, step)) > 0:
                raise
            trial = corrector.attempt(step, normal, size)
            if not corrector.dissipation(trial.q1) > 0:
                raise failure from None
        return trial


@dataclass(frozen=True)
class LoadControl(Control):
    """Load control up to the limit load: steps change the load factor by ``step`` or less.

    Args:
        step: Change of the load factor; negative if the factor is to fall.

    Raises:
        ArgumentError: ``step`` is zero.

    Example:
        >>> path = ub.follow(scene, ub.LoadControl(0.25), steps=4)
        >>> print(path.factor)
        [0.   0.25 0.5  0.75 1.  ]
    """

    step: Number
    quantity = "the load factor"

    def normal(self, corrector: PathCorrector, direction: Array) -> Array:
        """Return the gradient of the load factor, with the sign of ``step``."""
        return math.copysign(1.0, self.step) * corrector.factor_gradient


@dataclass(frozen=True)
class DisplacementControl(Control):
    """Displacement control of one component at a place, which passes limit points of loads.

    Args:
        place: Place of a beam.
        component: "u", "v" or "psi", in space "u", "v" or "w".
        step: Change of the component; m or rad.
        end: Displacement or rotation at which the path ends, with shorter last steps; m or rad.

    Raises:
        ArgumentError: ``place`` is not a place of a beam, ``component`` is unknown, ``step`` is
            zero, or the path begins at ``end`` or beyond it.

    Example:
        >>> control = ub.DisplacementControl(beam.end, "v", -0.05)
        >>> path = ub.follow(scene, control, steps=4)
        >>> print(path.displacement(beam.end)[:, 1].round(6))
        [ 0.   -0.05 -0.1  -0.15 -0.2 ]
    """

    place: Instance[Place]
    component: str
    step: Number
    _: KW_ONLY
    end: Annotated[float | None, require_number] = None
    factor = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.component not in self._components:
            raise ArgumentError(
                f"DisplacementControl: component = {self.component!r} must be one of "
                f"{', '.join(self._components)}"
            )

    @property
    def _components(self) -> Sequence[str]:
        return "uvw" if len(self.place.point) == 3 else COMPONENTS

    def require(self, scene: Scene) -> None:
        """Raise :class:`ArgumentError` unless the beam of the place is in the scene."""
        if self.place.beam not in scene.beams:
            raise ArgumentError(
                f"DisplacementControl of {self.place}: {not_in(scene, self.place.beam)}"
            )

    @property
    def quantity(self) -> str:  # type: ignore[override]
        """Name of the component and the place."""
        return f"{self.component} of {self.place}"

    def shortened(self, corrector: PathCorrector, fraction: float) -> float:
        """Return the fraction of a step to :attr:`end`, at most ``fraction``; 0 at the end."""
        if self.end is None:
            return fraction
        component = self._components.index(self.component)
        now = float(corrector.simulation.displacement(self.place)[component])
        left = (self.end - now) / self.step
        if abs(left) <= AT_END * max(1.0, abs(self.end / self.step)):
            return 0.0
        if left < 0:
            raise ArgumentError(
                f"DisplacementControl: end = {self.end:g} is behind {self.quantity} = {now:g} for "
                f"step = {self.step:g}; give an end ahead, or the opposite step"
            )
        # A rest that is much shorter than the step before would be solved less accurately.
        return left if left <= (1.0 + AT_END) * fraction else min(fraction, left / 2)

    def normal(self, corrector: PathCorrector, direction: Array) -> Array:
        """Return the gradient of the component, with the sign of ``step``."""
        subdomain, normal = corrector.subdomain, np.zeros(corrector.subdomain.numbering.size)
        nodes, weights = subdomain.numbering.weights(self.place)
        normal[subdomain.numbering.dofs[nodes, self._components.index(self.component)]] += weights
        local = normal[subdomain.dofs] * math.copysign(1.0, self.step)
        local[subdomain.num_owned :] = 0.0
        return np.append(local, 0.0)


@dataclass(frozen=True)
class DissipationControl(Control):
    """Control by the energy that hinges, beams and springs dissipate, for sharp snap-backs.

    Softening and unloading may begin in nearly the same direction, but only softening dissipates.

    Args:
        step: Dissipated energy of a step; J.
        otherwise: Arc-length control of steps in which nothing dissipates.

    Raises:
        ArgumentError: ``step`` is not positive, or ``otherwise`` is no :class:`ArcLength`.

    Example:
        >>> pull = ub.PointLoad(weak.end, force=(0, -1e5), amplitude=lambda t: t)
        >>> pulled = ub.Scene([weak], supports=[ub.Clamped(weak.start)], loads=[pull])
        >>> path = ub.follow(pulled, ub.DissipationControl(50.0), steps=15)
        >>> print(path.factor.max().round(2))  # at the limit of the hinge
        0.25
    """

    step: Positive
    otherwise: Instance[ArcLength] = field(default_factory=lambda: ArcLength(0.05))

    @property
    def factor(self) -> float:  # type: ignore[override]
        """Change of the load factor that has the arc length 1."""
        return self.otherwise.factor

    def sense(self, corrector: PathCorrector, direction: Array, increment: Array | None) -> float:
        """Return :meth:`ArcLength.sense` of ``otherwise``."""
        return self.otherwise.sense(corrector, direction, increment)

    def solve_step(self, corrector: PathCorrector, fraction: float) -> Trial:
        """Solve for a step that dissipates the energy ``step``, or for an arc-length step.

        An arc-length step is taken if the last step dissipated no energy and this step does not,
        or if the step by energy fails.  At an onset of dissipation the path goes on to dissipate:
        an arc-length step could find elastic unloading instead.  The part of a step before an
        onset counts, so that ends of shorter and shorter steps approach the onset.
        """
        if not (corrector.dissipates or corrector.onset):
            with suppress(StepFailed):
                trial = self.otherwise.solve_step(corrector, fraction)
                if corrector.dissipation(trial.q1) == 0.0:
                    return trial
        energy = self.step * fraction
        try:
            corrector.begin()
            step = corrector.until(energy, *corrector.onward())
            if (kink := corrector.kink(step)) is not None:
                before = corrector.length(kink[0]) / abs(self.otherwise.step)
                energy *= max(1 - before / fraction, self.otherwise.least_rest)
                step = corrector.until(energy, *kink)
            return corrector.attempt(step, None, energy, hold=False)
        except StepFailed:
            if not corrector.dissipates:
                raise
        return self.otherwise.solve_step(corrector, fraction)
