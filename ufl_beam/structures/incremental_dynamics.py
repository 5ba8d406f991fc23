# SPDX-License-Identifier: MIT
"""Incremental dynamic analysis: runs under ground motions that are scaled to intensities."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import scipy  # its subpackages are loaded when they are used

from ufl_beam.analysis.constant_loads import require_options
from ufl_beam.analysis.parameter_study import Study, WrongResult, study
from ufl_beam.arrays import Array
from ufl_beam.display import Rich, bracketed
from ufl_beam.errors import (
    ArgumentError,
    ConvergenceError,
    each_warning_once,
    require_all,
    require_function,
    require_kind,
    require_number,
    require_row,
    shorten,
    warn,
)
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.mechanics.time_schemes import EnergyMomentum
from ufl_beam.model.beams import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.initial_state import StateOf, chosen_state, require_scheme
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.structures.ground_motion import GroundMotion

COMPLETED, BEYOND_LIMIT, NO_EQUILIBRIUM = range(3)
PERCENT = 16.0, 50.0, 84.0


class Fragility(NamedTuple):
    """Probability that a limit is exceeded, a lognormal distribution of the intensity.

    Attributes:
        median: Intensity with the probability 1/2.
        dispersion: Standard deviation of the logarithm of the intensity.
        intensities: Intensities of the analysis; (m,).
        exceeded: Number of motions that exceed the limit at each intensity; (m,).
        number: Number of motions at each intensity; (m,).

    Example:
        >>> fragility = st.Fragility.fit([2.0, 4.0, 8.0], [1, 10, 18], [20, 20, 20])
        >>> print(f"median {fragility.median:.2f}, dispersion {fragility.dispersion:.2f}")
        median 4.17, dispersion 0.48
        >>> print(f"{fragility(2.0):.3f}")
        0.063
    """

    median: float
    dispersion: float
    intensities: Array
    exceeded: Array
    number: Array

    def __call__(self, intensity: npt.ArrayLike) -> Any:
        """Return the probability at one or several intensities."""
        x = np.log(np.asarray(intensity, dtype=float) / self.median)
        return scipy.special.ndtr(x / self.dispersion)

    @classmethod
    def fit(
        cls, intensities: npt.ArrayLike, exceeded: npt.ArrayLike, number: npt.ArrayLike
    ) -> Fragility:
        """Fit the distribution to counts by maximum likelihood.

        The likelihood is binomial: Baker, Earthquake Spectra 31(1), 2015, equation 11.

        Args:
            intensities: Intensities; (m,).
            exceeded: Number of motions that exceed the limit at each intensity; (m,).
            number: Number of motions at each intensity; (m,).

        Raises:
            ArgumentError: The counts have no maximum of the likelihood, such as zeros only.
        """
        rows = zip(
            ("intensities", "exceeded", "number"), (intensities, exceeded, number), strict=True
        )
        im, z, n = (require_row(row, f"Fragility.fit: {name}") for name, row in rows)
        if not (0 < len(im) == len(z) == len(n) and (im > 0).all() and ((z >= 0) & (z <= n)).all()):
            raise ArgumentError(
                "Fragility.fit: intensities must be positive, one for each count, and exceeded "
                "must be from 0 to number"
            )
        some, others = im[z > 0], im[z < n]
        said = ""
        if not len(some):
            said = f"no motion exceeds the limit up to the intensity {others.max():g}"
        elif not len(others):
            said = f"all motions exceed the limit from the intensity {some.min():g} on"
        elif not others.max() > some.min():
            said = (
                f"no motion exceeds the limit below the intensity {some.min():g}, and all do above "
                f"{others.max():g}"
            )
        if said:
            raise ArgumentError(
                f"fragility: {said}; the fit needs intensities at which some motions exceed the "
                "limit and others do not, at two intensities or more"
            )
        middle = float(np.exp(np.log(im).mean()))
        x = np.log(im / middle)

        def loss(factors: Array) -> Any:
            """Return the negative logarithm of the likelihood, also of complex factors."""
            w = factors[0] + factors[1] * x
            return -(z @ scipy.special.log_ndtr(w) + (n - z) @ scipy.special.log_ndtr(-w))

        # The loss is convex in these factors, so that the minimum is unique.
        a, b = scipy.optimize.minimize(
            loss, np.array([0.0, 1.0]), jac="cs", method="BFGS", options={"gtol": 1e-9}
        ).x
        if not b > 0:
            raise ArgumentError(
                "fragility: the fraction of motions that exceed the limit does not grow with the "
                "intensity"
            )
        return cls(middle * math.exp(-a / b), 1.0 / b, im, z, n)

    def __repr__(self) -> str:
        return bracketed(self)

    def __str__(self) -> str:
        return f"Fragility: median {self.median:.4g}, dispersion {self.dispersion:.3g}"


@dataclass(frozen=True, eq=False, repr=False)
class DemandCurves(Rich):
    """Demands of a structure under scaled motions; made by :func:`incremental_dynamic_analysis`.

    Rows belong to motions, columns to intensities.

    Attributes:
        motions: Names of the motions; (n,).
        intensities: Intensities; (m,).
        limit: Demand beyond which the structure has collapsed.
        demand: Largest demand until the end of each run; NaN if the run failed; (n, m).
        end: Time at which each run ended; (n, m); s.
        outcome: 0 if the run was completed, 1 if the demand exceeded the limit, 2 if a step had no
            equilibrium; (n, m).
        study: The :class:`Study`, with errors of failed runs and with wall times.
        labels: Texts for demand and intensity in pictures: names of the functions ``measure`` and
            ``intensity``, if they have names.

    Example:
        >>> pulse = st.GroundMotion(0.02, np.sin(10 * np.arange(0, 1, 0.02)))
        >>> def build(motion):
        ...     shaking = ub.Gravity((0, -1), amplitude=motion.acceleration)
        ...     return ub.Scene([beam], supports=scene.supports, loads=[shaking])
        >>> dynamics = st.incremental_dynamic_analysis(build, [pulse], [5.0, 10.0],
        ...     measure=lambda run: run.displacement(beam.end)[:, 1], limit=2e-4)
        >>> print(dynamics.collapsed)
        [[False  True]]
        >>> figure = ub.plot(dynamics)
    """

    motions: tuple[str, ...]
    intensities: Array
    limit: float
    demand: Array
    end: Array
    outcome: Array
    study: Study
    labels: tuple[str, str] = ("demand", "intensity")

    @property
    def collapsed(self) -> npt.NDArray[np.bool_]:
        """True for each run in which the structure collapsed; (n, m)."""
        return self.outcome > COMPLETED

    def fractiles(self, percent: Sequence[float] = PERCENT) -> Array:
        """Return percentiles of the demand at each intensity; (len(percent), m).

        A percentile is the least demand that this percentage of the motions does not exceed; it is
        infinite if it belongs to a collapse.
        """
        p = require_row(percent, "fractiles: percent")
        if ((p < 0) | (p > 100)).any():
            raise ArgumentError("fractiles: percent must be between 0 and 100")
        demand = np.where(self.collapsed, np.inf, self.demand)
        columns = [row[~np.isnan(row)] for row in demand.T]
        return np.array([
            np.percentile(row, p, method="inverted_cdf") if len(row) else np.full(len(p), np.nan)
            for row in columns
        ]).T  # fmt: skip

    def fragility(self, limit: float | None = None) -> Fragility:
        """Fit the probability that the demand exceeds a limit, by default of collapse.

        Raises:
            ArgumentError: The limit is not positive or above the limit of collapse, or the fraction
                of motions that exceed it does not rise with the intensity, see :class:`Fragility`.
        """
        exceeded, valid = self.collapsed, ~np.isnan(self.demand)
        if limit is not None:
            limit = require_number(limit, "fragility: limit", positive=True)
            if limit > self.limit:
                raise ArgumentError(
                    f"fragility: limit = {limit:g} is above the limit of collapse, {self.limit:g}"
                )
            exceeded = exceeded | (self.demand > limit)
        return Fragility.fit(
            self.intensities, (exceeded & valid).sum(axis=0), valid.sum(axis=0).astype(float)
        )

    def __str__(self) -> str:
        lines = [f"{repr(self)[1:-1]}", " intensity     16 %      50 %      84 %  collapsed"]
        fractiles, collapses = self.fractiles(), self.collapsed.sum(axis=0)
        for k, level in enumerate(self.intensities):
            demands = " ".join(f"{x:9.4g}" for x in fractiles[:, k])
            lines.append(f"{level:10.4g} {demands} {collapses[k]:6d}")
        if several := int((self.outcome == NO_EQUILIBRIUM).sum()):
            lines.append(f"  collapses by a step without equilibrium below the limit: {several}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return (
            f"<DemandCurves: {len(self.motions)} motions, {len(self.intensities)} "
            f"intensities, {int(self.collapsed.sum())} collapses>"
        )


CHECKS = 10  # number of times in a run at which the demand is compared with the limit
PROPORTIONAL = 1e-9  # relative round-off of the intensity of a doubled motion
WHAT = "incremental_dynamic_analysis"
Measure = Callable[[Solution], npt.ArrayLike]


@each_warning_once()
def incremental_dynamic_analysis(
    build: Callable[[GroundMotion], Scene],
    motions: Sequence[GroundMotion],
    intensities: Sequence[float],
    measure: Measure,
    *,
    limit: float,
    intensity: Callable[[GroundMotion], float] | None = None,
    scheme: Scheme | None = None,
    dt: float | None = None,
    start: StateOf | None = None,
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    path: str | Path | None = None,
    anew: bool = False,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> DemandCurves:
    """Simulate a structure under each ground motion, scaled to each intensity.

    The analysis is after Vamvatsikos and Cornell (Earthquake Engineering and Structural Dynamics
    31, 2002) at given intensities.  The runs are the members of a :func:`study`: in parallel under
    ``mpirun``, each on one process, with results in a file from which the analysis continues.

    A structure collapses if its demand exceeds ``limit``, which ends the run, or if a step has no
    equilibrium.  The demand is compared with the limit at 10 times of a run.

    Args:
        build: Function that returns the scene under a scaled motion.  Its beams are always the
            same if there is a ``start``.
        motions: Ground motions; a run is as long as its motion.
        intensities: Increasing intensities, to which each motion is scaled.
        measure: Function of the solution so far that returns the demand, such as the drift of each
            storey at each time, in an array of any shape; its largest magnitude is the demand.
        limit: Demand beyond which the structure has collapsed.
        intensity: Function that returns the intensity of a motion, which is proportional to the
            motion, such as the spectral acceleration at the first period; it is called with each
            motion and its double.  By default it is the peak acceleration; m/s².
        scheme: Time scheme; by default :class:`EnergyMomentum`.
        dt: Time step; by default the time step of the motion; s.
        start: Static solution under permanent loads, from whose last state all runs begin.
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default as in ``start``, or the cells of the beams.
        path: File of the results, from which the analysis continues if the script is run again,
            also with further motions or intensities.
        anew: Discard the results in the file, as is necessary after a change of ``build``,
            ``measure``, ``limit`` or ``dt``.  Changes of motions are recognised.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes; by default all.

    Returns:
        The demands, their fractiles, and by :meth:`DemandCurves.fragility` the probability
        of collapse over the intensity.

    Raises:
        ArgumentError: The call or the file is wrong, or the intensity is not proportional to a
            motion.
        RuntimeError: All runs failed for other reasons than a missing equilibrium.

    Warns:
        ModelWarning: The demands of each motion are equal at all intensities.

    Example:
        >>> pulse = st.GroundMotion(0.02, np.sin(10 * np.arange(0, 1, 0.02)))
        >>> def build(motion):
        ...     shaking = ub.Gravity((0, -1), amplitude=motion.acceleration)
        ...     return ub.Scene([beam], supports=scene.supports, loads=[shaking])
        >>> dynamics = st.incremental_dynamic_analysis(build, [pulse], [5.0, 10.0],
        ...     measure=lambda run: run.displacement(beam.end)[:, 1], limit=0.1)
        >>> print((1e3 * dynamics.demand).round(2))  # mm
        [[0.12 0.23]]
    """
    require_function(build, f"{WHAT}: build", "a GroundMotion")
    require_function(measure, f"{WHAT}: measure", "a solution")
    limit = require_number(limit, f"{WHAT}: limit", positive=True)
    known = {
        _key(motion): motion for motion in require_all(motions, f"{WHAT}: motions", GroundMotion)
    }
    levels = require_row(intensities, f"{WHAT}: intensities")
    if not len(levels) or levels[0] <= 0 or (np.diff(levels) <= 0).any():
        raise ArgumentError(f"{WHAT}: intensities must be positive and increase")
    if not known:
        raise ArgumentError(f"{WHAT}: motions is empty")
    if len(known) < len(motions):
        raise ArgumentError(f"{WHAT}: motions: the same motion occurs twice")
    if intensity is not None:
        require_function(intensity, f"{WHAT}: intensity", "a GroundMotion")
    chosen: Any = EnergyMomentum() if scheme is None else scheme
    require_scheme(chosen, f"{WHAT}: scheme")
    if not has_inertia(chosen):
        raise ArgumentError(f"{WHAT}: scheme = {chosen!r} is static; give a dynamic scheme")
    if dt is not None:
        dt = require_number(dt, f"{WHAT}: dt", positive=True)
    start = chosen_state(start, f"{WHAT}: start")
    require_options(newton, mesh, progress, WHAT)
    unit = dict[str, float]()
    for key, motion in known.items():
        size = motion.peak if intensity is None else intensity(motion)
        unit[key] = require_number(size, f"{WHAT}: intensity of {motion.name}", positive=True)
        if intensity is not None:
            twice = require_number(intensity(motion.scaled(2.0)), f"{WHAT}: intensity")
            if not math.isclose(twice, 2.0 * unit[key], rel_tol=PROPORTIONAL):
                raise ArgumentError(
                    f"{WHAT}: intensity of {motion.name} = {unit[key]:g}, and {twice:g} if the "
                    "motion is doubled; give an intensity that is proportional to the motion, such "
                    "as a spectral acceleration, or a root of an integral of squares"
                )
    first = next(iter(known))
    require_kind(
        build(known[first].scaled(levels[0] / unit[first])), Scene, f"{WHAT}: build(motion)"
    )

    def member(motion: str, intensity: float) -> dict[str, float]:
        scaled = known[motion].scaled(intensity / unit[motion])
        step, outcome, taken, demand = dt or scaled.dt, COMPLETED, 0, 0.0
        between = math.ceil(scaled.duration / step / CHECKS)

        def beyond_limit(now: Simulation) -> bool:
            nonlocal taken, demand
            taken += 1
            if taken % between == 0:
                demand = _demand(measure, now.solution)
            return demand > limit

        try:
            run = simulate(
                build(scaled), chosen, t=(0.0, scaled.duration), dt=step, start=start,
                until=beyond_limit, newton=newton, mesh=mesh, progress=False,
            )  # fmt: skip
        except ConvergenceError as error:
            run, outcome = error.solution, NO_EQUILIBRIUM
        demand = _demand(measure, run)
        if demand > limit:
            outcome = BEYOND_LIMIT
        return {"demand": demand, "end": float(run.times[-1]), "outcome": float(outcome)}

    member.__name__ = WHAT
    cases = [{"motion": key, "intensity": float(level)} for key in known for level in levels]
    results = study(member, cases, path=path, anew=anew, progress=progress, comm=comm)
    demand, end, outcome = (
        results[name].reshape(len(known), len(levels)) for name in ("demand", "end", "outcome")
    )
    if len(levels) > 1 and (demand == demand[:, :1]).all():
        warn(f"{WHAT}: no demand depends on the intensity; does build use its argument?")
    names = tuple(motion.name for motion in known.values())
    by_default = "peak acceleration (m/s²)" if intensity is None else "intensity"
    labels = _name(measure, "demand"), _name(intensity, by_default)
    return DemandCurves(names, levels, limit, demand, end, outcome, results, labels)


def _name(function: Any, otherwise: str) -> str:
    """Return the name of a function in words; lambda and other objects have none."""
    name: str = getattr(function, "__name__", "")
    return name.replace("_", " ").strip() if name.isidentifier() else otherwise


def _key(motion: GroundMotion) -> str:
    """Return the name of a motion, with a checksum of its values."""
    values = np.array([motion.dt, *motion.values])
    return f"{motion.name} {hashlib.sha256(values.tobytes()).hexdigest()[:12]}"


def _demand(measure: Measure, solution: Solution) -> float:
    """Return the largest magnitude of the measure of a solution so far.

    Raises:
        ArgumentError: The measure returns no numbers.
    """
    value = measure(solution)
    try:
        sizes = np.abs(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        sizes = np.empty(0)
    sizes = sizes[~np.isnan(sizes)]  # the first row of many results is NaN
    if not len(sizes) or not np.isfinite(sizes).all():
        raise WrongResult(
            f"{WHAT}: measure returned {shorten(value)}, not finite numbers, of the states up to "
            f"t = {solution.times[-1]:g} s; no run can be judged"
        )
    return float(sizes.max())
