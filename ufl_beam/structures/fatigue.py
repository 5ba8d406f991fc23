# SPDX-License-Identifier: MIT
"""Fatigue: rainflow counting of stress cycles, S-N curves, damage, and a recorder."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, State
from ufl_beam.display import compact_repr
from ufl_beam.errors import (
    ArgumentError,
    require_all,
    require_function,
    require_kind,
    require_number,
    require_row,
)
from ufl_beam.model import plausibility
from ufl_beam.model.bodies import Place
from ufl_beam.model.records import Instance, Positive, Record
from ufl_beam.output.recorder import Restartable, StateView

BLOCK = 1000  # number of steps between counts of cycles

# -- mean stresses and S-N curves -----------------------------------------------------------------


@dataclass(frozen=True)
class Goodman(Record):
    """Goodman's line: equivalent range S / (1 − mean / ultimate) of a range S with a tensile mean.

    It is the straight line of the Haigh diagram, and Soderberg's line with the yield stress as
    ``ultimate``.  A compressive mean has no effect.  At a mean of ``ultimate`` the life is zero.

    Args:
        ultimate: Ultimate stress; Pa.

    Example:
        >>> curve = st.SNCurve(range=71e6, mean=st.Goodman(ultimate=500e6))
        >>> print(curve.endurance(71e6, mean=0.0), curve.endurance(71e6, mean=250e6))
        2000000.0 250000.0
    """

    _refused = ArgumentError

    ultimate: Positive
    _power: ClassVar[int] = 1

    def __call__(self, range: Array, mean: Array) -> Array:
        """Compute equivalent ranges; infinite if the mean is at least ``ultimate``; (n,); Pa."""
        left = 1 - (np.maximum(mean, 0.0) / self.ultimate) ** self._power
        infinite = np.full_like(range, np.inf)
        return np.asarray(np.divide(range, left, out=infinite, where=left > 0))


@dataclass(frozen=True)
class Gerber(Goodman):
    """Gerber's parabola: equivalent range S / (1 − (mean / ultimate)²); see :class:`Goodman`.

    Args:
        ultimate: Ultimate stress; Pa.

    Example:
        >>> welded, machined = st.SNCurve(range=71e6), st.SNCurve(range=71e6, mean=st.Gerber(500e6))
        >>> bool(machined.endurance(100e6, mean=200e6) < welded.endurance(100e6, mean=200e6))
        True
    """

    _power = 2


def any_mean(range: Array, mean: Array) -> Array:
    """Return the ranges unchanged, because the mean stress does not affect welded details."""
    return range


Life = Annotated[float, partial(require_number, positive=True, infinite=True)]
MeanStress = Annotated[
    Callable[[Array, Array], Array], partial(require_function, arguments="(range, mean)")
]
Stress = Annotated[Callable[..., Array], partial(require_function, arguments="(N, V, M)")]


@dataclass(frozen=True, kw_only=True)
class SNCurve(Record):
    """S-N curve: number of cycles to failure as a function of stress range, by Basquin's law.

    Args:
        range: Stress range that leads to failure after ``cycles``; Pa.
        cycles: Number of cycles to failure at ``range``.
        slope: Exponent m of N = cycles (range / S)^m, with N cycles to failure at the range S.
        knee: Number of cycles at which the slope changes.
        slope_beyond: Slope above ``knee`` cycles.
        limit: Number of cycles to failure beyond which a stress range does no damage.
        mean: Function (range, mean) that returns equivalent ranges, such as :class:`Goodman`.

    Raises:
        ArgumentError: A number is not positive, ``limit`` is less than a finite ``knee``, or
            ``mean`` is no function.

    Example:
        >>> curve = st.SNCurve.eurocode(71e6)
        >>> print(curve.endurance([142e6, 71e6, 10e6]))  # cycles to failure
        [ 250000. 2000000.      inf]
    """

    _refused = ArgumentError

    range: Positive
    cycles: Positive = 2e6
    slope: Positive = 3.0
    knee: Life = math.inf
    slope_beyond: Positive = 5.0
    limit: Life = math.inf
    mean: MeanStress = any_mean

    __repr__ = compact_repr

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.range >= 10.0:  # less is a number without a unit
            plausibility.check("SNCurve", "stress range", self.range)
        if self.limit < self.knee < math.inf:
            raise ArgumentError(
                f"SNCurve: limit = {self.limit:g} cycles lies before the knee, {self.knee:g}"
            )

    @classmethod
    def eurocode(cls, category: float) -> SNCurve:
        """Make a curve of EN 1993-1-9: slope 3 up to 5e6 cycles, 5 up to 1e8, no damage beyond.

        Args:
            category: Detail category: stress range with 2e6 cycles to failure, such as 71e6; Pa.
        """
        require_number(category, "SNCurve.eurocode: category", positive=True)
        return cls(range=category, cycles=2e6, slope=3.0, knee=5e6, slope_beyond=5.0, limit=1e8)

    def endurance(self, range: npt.ArrayLike, mean: npt.ArrayLike = 0.0) -> Array:
        """Compute cycles to failure from ranges and means (Pa); infinite beyond ``limit``."""
        ranges, means = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (range, mean)))
        with np.errstate(divide="ignore"):
            first = self.cycles * (self.range / self.mean(ranges, means)) ** self.slope
        if math.isfinite(self.knee):
            second = self.knee * (first / self.knee) ** (self.slope_beyond / self.slope)
            first = np.where(first > self.knee, second, first)
        # A range whose endurance is the limit may exceed the limit by round-off.
        return np.where(first > self.limit * (1 + 1e-12), np.inf, first)


# -- rainflow counting ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Cycles:
    """Cycles of a stress history, sorted by range, the smallest first.

    Attributes:
        range: Stress ranges; (n,); Pa.
        mean: Mean stresses; (n,); Pa.
        count: Numbers of cycles; a half cycle counts as 0.5; (n,).

    Example:
        >>> cycles = st.rainflow([0, 100e6, -50e6, 80e6, 0])  # Pa
        >>> print(cycles.range / 1e6, cycles.count)
        [ 80. 100. 130. 150.] [0.5 0.5 0.5 0.5]
        >>> print(f"{cycles.damage(st.SNCurve.eurocode(71e6)):.2e}")
        4.95e-06
    """

    range: Array
    mean: Array
    count: Array

    __repr__ = compact_repr

    def damage(self, curve: SNCurve) -> float:
        """Compute Miner's sum: the fraction of the life that the cycles use; 1 at failure."""
        with np.errstate(divide="ignore"):  # zero cycles to failure
            return float(np.sum(self.count / curve.endurance(self.range, self.mean)))

    def equivalent(self, curve: SNCurve) -> float:
        """Compute the stress range that does the same damage if all cycles have it; Pa.

        Only ``slope`` is used, not ``slope_beyond``, as is usual for damage-equivalent ranges.
        """
        m, ranges = curve.slope, curve.mean(self.range, self.mean)
        total = self.count.sum()
        return float((self.count @ ranges**m / total) ** (1 / m)) if total > 0 else 0.0


def rainflow(series: npt.ArrayLike) -> Cycles:
    """Count the rainflow cycles of a series by ASTM E1049-85.

    Args:
        series: Stresses or another alternating quantity; (n,).

    Raises:
        ArgumentError: The series is not one row of finite numbers.

    Example:
        >>> cycles = st.rainflow([0, 3, 1, 2, 0])
        >>> print(cycles.range, cycles.mean, cycles.count)
        [1. 3.] [1.5 1.5] [1. 1.]
    """
    counter = RainflowCounter()
    counter.add(require_row(series, "rainflow: series"))
    return counter.cycles()


class RainflowCounter:
    """Rainflow counter of a series that comes in pieces.

    With a ``resolution`` (Pa), values are rounded to multiples of it.  So cycles fall into classes,
    whose number limits the memory.  Turning points are stored until their cycle is complete.  For a
    restart, ``counted`` and ``waiting`` are the results of :meth:`state`.
    """

    def __init__(
        self, resolution: float | None = None, counted: Array | None = None,
        waiting: Iterable[float] = (),
    ) -> None:  # fmt: skip
        self._resolution = resolution
        self._counts: defaultdict[tuple[float, float], float] = defaultdict(float)  # by ends
        for low, high, count in () if counted is None else counted:
            self._counts[float(low), float(high)] = float(count)
        # Turning points of incomplete cycles, with decreasing ranges between them
        self._waiting: list[float] = [*map(float, waiting)]

    def add(self, series: Array) -> None:
        """Count the next piece of the series, (n,), by the method of ASTM E1049."""
        points, unit = self._waiting, self._resolution
        for value in map(float, series if unit is None else np.rint(series / unit)):
            if points and value == points[-1]:
                continue
            if len(points) > 1 and (value > points[-1]) == (points[-1] > points[-2]):
                points.pop()  # no turning point: the series continues in its direction
            points.append(value)
            while len(points) > 2 and abs(value - points[-2]) >= abs(points[-2] - points[-3]):
                half = len(points) == 3  # the range includes the first point
                low, high = sorted(points[-3:-1])
                self._counts[low, high] += 0.5 if half else 1.0
                del points[-3 : -2 if half else -1]

    def cycles(self) -> Cycles:
        """Return all cycles so far; ranges between stored turning points count as half cycles."""
        counts = self._counts.copy()
        for ends in pairwise(self._waiting):
            counts[min(ends), max(ends)] += 0.5
        low, high = np.array(list(counts), dtype=float).reshape(-1, 2).T
        order, unit = np.lexsort((low, high - low)), self._resolution or 1.0
        count = np.array(list(counts.values()), dtype=float)
        return Cycles(unit * (high - low)[order], unit / 2 * (low + high)[order], count[order])

    def state(self) -> tuple[Array, Array]:
        """Return (low, high, count) of cycles, (n, 3), and stored points; unit: resolution."""
        counted = [(*ends, count) for ends, count in self._counts.items()]
        return np.array(counted, dtype=float).reshape(-1, 3), np.array(self._waiting, dtype=float)


# -- counting in a run ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class HotSpot(Record):
    """Place on a beam at which :class:`Fatigue` counts stress cycles.

    Args:
        place: Place on a beam.
        stress: Function (N, V, M) of section forces (N, N, N m) that returns stresses; (n,); Pa.
            In space it is a function (N, V2, V3, T, M2, M3) in axes of the section.

    Raises:
        ArgumentError: ``place`` is no place, or ``stress`` is no function.

    Example:
        >>> nominal = st.HotSpot.fibre(beam.start, y=0.1, E=210e9, factor=1.5)
        >>> own = st.HotSpot(beam.start, lambda N, V, M: N / 0.02 - 0.1 * M / 6.67e-5)
        >>> np.allclose(nominal.stress(0.0, 0.0, 1e4), 1.5 * own.stress(0.0, 0.0, 1e4), rtol=1e-3)
        True
    """

    _refused = ArgumentError

    place: Instance[Place]
    stress: Stress

    __repr__ = compact_repr

    @classmethod
    def fibre(
        cls, place: Place, *, y: float, E: float, factor: float = 1.0, z: float | None = None
    ) -> HotSpot:
        """Make a hot spot with the stress ``factor`` E (N/EA − y M/EI) of an elastic fibre.

        In space the stress is ``factor`` E (N/EA − y M3/EI + z M2/EI2).

        Args:
            place: Place on a beam.
            y: Distance from the axis, positive to the left of the direction from start to end; m.
            E: Young's modulus; Pa.
            factor: Stress concentration factor: hot-spot stress over nominal stress.
            z: In space, distance from the axis along axis 3 of the section, and y along axis 2; m.
        """
        require_kind(place, Place, "HotSpot: place")
        if (z is None) != (len(place.point) == 2):
            raise ArgumentError(f"HotSpot {place}: give z in space, and not in the plane")
        require_number(y, f"HotSpot {place}: y")
        require_number(E, f"HotSpot {place}: E", positive=True)
        require_number(factor, f"HotSpot {place}: factor", positive=True)
        section = place.beam.section
        far = y / section.depth
        plausibility.check(f"HotSpot {place}", "distance from the axis over the depth", far)
        per_N, per_M = factor * E / section.EA, -factor * E * y / section.EI
        if z is None:
            return cls(place, lambda N, V, M: per_N * N + per_M * M)
        require_number(z, f"HotSpot {place}: z")
        per_M2 = factor * E * z / section.EI2
        return cls(place, lambda N, V2, V3, T, M2, M3: per_N * N + per_M * M3 + per_M2 * M2)

    def __str__(self) -> str:
        return str(self.place)

    def _label(self) -> str:
        return f"HotSpot {self.place}"


class Fatigue(Restartable):
    """Recorder of the rainflow cycles of the stress at hot spots.

    Memory does not grow with the number of steps.  Section forces are evaluated in each step as in
    :meth:`Solution.diagram`.

    Args:
        spots: Hot spots, or one hot spot.
        curve: S-N curve of all spots.
        resolution: Stresses are rounded to multiples of this stress; Pa.  The default 0 means a
            hundredth of the ``range`` of the curve.

    Raises:
        ArgumentError: A spot or the curve has a wrong type, or the resolution is negative.

    Example:
        >>> spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)
        >>> fatigue = st.Fatigue(spot, st.SNCurve.eurocode(71e6))
        >>> shake = ub.PointLoad(beam.end, force=(0, 5e4), amplitude=np.sin)
        >>> shaken = ub.Scene([beam], supports=scene.supports, loads=[shake])
        >>> run = ub.simulate(shaken, ub.Static(), t=(0, 20), dt=0.2, record=fatigue)
        >>> print(f"life: {fatigue.life(spot):.0e} s")
        life: 2e+05 s
    """

    def __init__(
        self, spots: Sequence[HotSpot] | HotSpot, curve: SNCurve, *, resolution: float = 0.0
    ) -> None:
        several = spots if isinstance(spots, Sequence) else (spots,)
        self.spots: tuple[HotSpot, ...] = tuple(
            dict.fromkeys(require_all(several, "Fatigue: spots", HotSpot))
        )
        require_kind(curve, SNCurve, "Fatigue: curve")
        require_number(resolution, "Fatigue: resolution", at_least=0.0)
        self.curve = curve
        self._resolution = resolution or curve.range / 100
        self._counters: dict[HotSpot, RainflowCounter] = {}
        self._block: list[Array] = []

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Begin with the initial state, or continue from a :meth:`state`."""
        at = [simulation.numbering.cell_and_fraction(spot.place) for spot in self.spots]
        self._cells = np.array([cell for cell, _ in at], dtype=np.int64)
        self._fractions, self._column = np.unique([s for _, s in at], return_inverse=True)
        self._counters, self._block = {}, []
        for i, spot in enumerate(self.spots):
            before = (state[f"counted {i}"], state[f"waiting {i}"]) if state else ()
            self._counters[spot] = RainflowCounter(self._resolution, *before)
        if state:
            self._begin, self._end = map(float, state["duration"])
        else:
            self._begin = simulation.t
            self.write(simulation)
            self.close()  # So a stress that is no number raises an error at once.

    def write(self, simulation: StateView) -> None:
        """Store the section forces, and count after each block of steps."""
        forces = simulation.now.cell_forces(0, self._fractions)
        self._block.append(forces[self._cells, self._column])
        self._end = simulation.t
        if len(self._block) == BLOCK:
            self.close()

    def close(self) -> None:
        """Count the cycles of the stored steps."""
        if not self._block:
            return
        forces, self._block = np.stack(self._block, axis=-1), []
        for k, spot in enumerate(self.spots):
            names = "N, V, M" if len(forces[k]) == 3 else "N, V2, V3, T, M2, M3"
            stress = np.asarray(spot.stress(*forces[k]), dtype=np.float64)
            if stress.shape != forces[k, 0].shape or not np.isfinite(stress).all():
                raise ArgumentError(
                    f"HotSpot {spot}: stress({names}) must return a finite number for each {names}"
                )
            self._counters[spot].add(stress)

    def state(self) -> State:
        """Return the first and last time, and cycles and stored turning points of each spot."""
        self.close()
        state: State = {"duration": np.array([self._begin, self._end])}
        for i, counter in enumerate(self._counters.values()):
            state[f"counted {i}"], state[f"waiting {i}"] = counter.state()
        return state

    @property
    def duration(self) -> float:
        """Length of the time in which cycles were counted; s."""
        return self._end - self._begin

    def cycles(self, spot: HotSpot) -> Cycles:
        """Return the cycles at a spot.

        Raises:
            ArgumentError: The spot is not among ``spots``, or nothing was run.
        """
        if spot not in self._counters:
            raise ArgumentError(f"Fatigue: nothing was counted at {spot}; add it to spots, and run")
        return self._counters[spot].cycles()

    def damage(self, spot: HotSpot) -> float:
        """Compute Miner's sum at a spot, 1 at failure; errors as :meth:`cycles`."""
        return self.cycles(spot).damage(self.curve)

    def life(self, spot: HotSpot) -> float:
        """Extrapolate the time to failure, s; infinite without damage; errors as :meth:`cycles`."""
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
