# SPDX-License-Identifier: MIT
"""Results of an incremental dynamic analysis: demands, fractiles and fragility."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy  # its subpackages are loaded when they are used

from ufl_beam.analysis.parameter_study import Study
from ufl_beam.arrays import Array
from ufl_beam.display import Rich, bracketed
from ufl_beam.errors import ArgumentError, require_number, require_row

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
                "Fragility.fit: intensities must be positive, with as many counts, and exceeded "
                "must be from 0 to number"
            )
        some, others = im[z > 0], im[z < n]
        if not len(some) or not len(others) or not others.max() > some.min():
            raise ArgumentError(
                f"fragility: {_without_overlap(some, others)}; the fit needs intensities at which "
                "some motions exceed the limit and others do not, at two intensities or more"
            )
        middle = float(np.exp(np.log(im).mean()))
        x = np.log(im / middle)

        def loss(factors: Array) -> tuple[float, Array]:
            """Return the negative logarithm of the likelihood, and its gradient."""
            w = factors[0] + factors[1] * x
            up, down = scipy.special.log_ndtr(w), scipy.special.log_ndtr(-w)
            density = -(w**2) / 2 - math.log(2 * math.pi) / 2
            slope = -z * np.exp(density - up) + (n - z) * np.exp(density - down)
            return -float(z @ up + (n - z) @ down), np.array([slope.sum(), slope @ x])

        # The loss is convex in these factors, so that the minimum is unique.
        a, b = scipy.optimize.minimize(
            loss, np.array([0.0, 1.0]), jac=True, method="BFGS", options={"gtol": 1e-9}
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


def _without_overlap(some: Array, others: Array) -> str:
    """Describe counts to which no distribution can be fitted."""
    if not len(some):
        return f"no motion exceeds the limit up to the intensity {others.max():g}"
    if not len(others):
        return f"all motions exceed the limit from the intensity {some.min():g} on"
    return (
        f"no motion exceeds the limit below the intensity {some.min():g}, and all do above "
        f"{others.max():g}"
    )


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
