# SPDX-License-Identifier: MIT
"""Fatigue at named places: stress cycles counted while a run goes on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.display import one_line
from ufl_beam.errors import SceneError, require_kind, require_number, require_sequence
from ufl_beam.model.bodies import Place
from ufl_beam.output.rainflow import Cycles, RainflowCounter, SNCurve
from ufl_beam.output.recorders import Recorder
from ufl_beam.output.state_view import StateView

BLOCK = 1000  # steps that are collected before their cycles are counted


@dataclass(frozen=True, eq=False)
class HotSpot:
    """Place of a beam whose stress cycles :class:`Fatigue` counts.

    Args:
        place: Where on a beam.
        stress: Stress from N, V (N) and M (N m) at many times; (n,) each; Pa.

    Raises:
        SceneError: The place is none, or the stress no function.

    Example:
        >>> nominal = ub.HotSpot.fibre(beam.start, y=0.1, E=210e9, factor=1.5)
        >>> own = ub.HotSpot(beam.start, lambda N, V, M: N / 0.02 - 0.1 * M / 6.67e-5)
        >>> np.allclose(nominal.stress(0.0, 0.0, 1e4), 1.5 * own.stress(0.0, 0.0, 1e4), rtol=1e-3)
        True
    """

    place: Place
    stress: Callable[[Array, Array, Array], Array]

    __repr__ = one_line

    def __post_init__(self) -> None:
        require_kind(self.place, Place, "HotSpot: place")
        if not callable(self.stress):
            raise SceneError(f"HotSpot {self.place}: stress = {self.stress!r} is not a function")

    @classmethod
    def fibre(cls, place: Place, *, y: float, E: float, factor: float = 1.0) -> HotSpot:
        """Make a spot with the elastic stress E (N/EA − y M/EI) of a fibre.

        Args:
            place: Where on a beam.
            y: Distance from the axis, positive on the left of the way from start to end; m.
            E: Young's modulus; Pa.
            factor: Stress concentration: hot-spot over nominal stress.
        """
        require_kind(place, Place, "HotSpot: place")
        require_number(y, f"HotSpot {place}: y")
        require_number(E, f"HotSpot {place}: E", positive=True)
        require_number(factor, f"HotSpot {place}: factor", positive=True)
        section = place.beam.section
        per_N, per_M = factor * E / section.EA, -factor * E * y / section.EI
        return cls(place, lambda N, V, M: per_N * N + per_M * M)

    def __str__(self) -> str:
        return str(self.place)


class Fatigue(Recorder):
    """Recorder of the rainflow cycles of the stress at named places.

    Its memory does not grow with the number of steps.  Section forces are those of the equation of
    each step at the place, see :meth:`Solution.diagram`.

    Args:
        spots: Where.
        curve: S-N curve of all spots.
        resolution: Stresses are rounded to multiples of it; Pa.  By default a hundredth of the
            range that the curve is named by.

    Raises:
        SceneError: A spot or the curve is none, or the resolution is not positive.

    Example:
        >>> spot = ub.HotSpot.fibre(beam.start, y=0.1, E=210e9)
        >>> fatigue = ub.Fatigue(spot, ub.SNCurve.eurocode(71e6))
        >>> shake = ub.PointLoad(beam.end, force=(0, 5e4), time=np.sin)
        >>> shaken = ub.Scene([beam], supports=scene.supports, loads=[shake])
        >>> run = ub.simulate(shaken, ub.Static(), t=(0, 20), dt=0.2, record=fatigue)
        >>> print(f"life: {fatigue.life(spot):.0e} s")
        life: 2e+05 s
    """

    def __init__(
        self, spots: Sequence[HotSpot] | HotSpot, curve: SNCurve, *, resolution: float = 0.0
    ) -> None:
        several = (spots,) if isinstance(spots, HotSpot) else spots
        self.spots: tuple[HotSpot, ...] = require_sequence(several, "Fatigue: spots")
        for i, spot in enumerate(self.spots):
            require_kind(spot, HotSpot, f"Fatigue: spots[{i}]")
        require_kind(curve, SNCurve, "Fatigue: curve")
        require_number(resolution, "Fatigue: resolution", at_least=0.0)
        self.curve = curve
        self._resolution = resolution or curve.range / 100
        self._counters: dict[HotSpot, RainflowCounter] = {}

    def open(self, simulation: StateView) -> None:
        """Begin to count, with the initial state."""
        self._prepare(simulation.grid)
        self._begin = simulation.t
        self.write(simulation)
        self._count()  # A stress that is no number is found at once.

    def _prepare(self, grid: Grid) -> None:
        at = [grid.cell_and_part(spot.place) for spot in self.spots]
        self._cells = np.array([cell for cell, _ in at], dtype=np.int64)
        self._parts, self._part = np.unique([part for _, part in at], return_inverse=True)
        self._counters = {spot: RainflowCounter(self._resolution) for spot in self.spots}
        self._block: list[Array] = []

    def write(self, simulation: StateView) -> None:
        """Note the section forces, and count now and then."""
        self._block.append(simulation.forces_along(self._parts)[self._cells, self._part])
        self._end = simulation.t
        if len(self._block) == BLOCK:
            self._count()

    def _count(self) -> None:
        forces, self._block = np.stack(self._block, axis=-1), []
        for k, spot in enumerate(self.spots):
            N, V, M = (forces[k, i] for i in range(3))
            stress = np.asarray(spot.stress(N, V, M), dtype=np.float64)
            if stress.shape != N.shape or not np.isfinite(stress).all():
                raise SceneError(f"HotSpot {spot}: stress(N, V, M) must be a finite number each")
            self._counters[spot].add(stress)

    def close(self) -> None:
        """Count the steps that are left."""
        if self._counters and self._block:
            self._count()

    def state(self) -> State:
        """Return the time that was counted, cycles and waiting turning points of each spot."""
        self.close()
        state: State = {"duration": np.array([self._begin, self._end])}
        for i, counter in enumerate(self._counters.values()):
            state[f"counted {i}"], state[f"waiting {i}"] = counter.state()
        return state

    def resume(self, simulation: StateView, state: State) -> None:
        """Go on after a :meth:`state`."""
        self._prepare(simulation.grid)
        self._begin, self._end = map(float, state["duration"])
        for i, counter in enumerate(self._counters.values()):
            counter.resume(state[f"counted {i}"], state[f"waiting {i}"])

    @property
    def duration(self) -> float:
        """Time that was counted; s."""
        return self._end - self._begin

    def cycles(self, spot: HotSpot) -> Cycles:
        """Return the cycles at a spot.

        Raises:
            SceneError: The spot is not one of these, or nothing was run.
        """
        if spot not in self._counters:
            raise SceneError(f"Fatigue: nothing was counted at {spot}; name it, and run")
        return self._counters[spot].cycles()

    def damage(self, spot: HotSpot) -> float:
        """Compute Miner's sum at a spot, 1 at failure; errors as :meth:`cycles`."""
        return self.cycles(spot).damage(self.curve)

    def life(self, spot: HotSpot) -> float:
        """Extrapolate the time to failure; s; errors as :meth:`cycles`."""
        damage = self.damage(spot)
        return self.duration / damage if damage > 0 else math.inf

    def __str__(self) -> str:
        lines = [f"fatigue in {self.duration:g} s"] if self._counters else ["fatigue: not run yet"]
        for spot in self._counters:
            cycles = self.cycles(spot)
            largest = cycles.range.max(initial=0.0)
            lines.append(
                f"  {spot}: {cycles.count.sum():g} cycles up to {1e-6 * largest:.4g} MPa, "
                f"damage {self.damage(spot):.4g}, life {self.life(spot):.4g} s"
            )
        return "\n".join(lines)
