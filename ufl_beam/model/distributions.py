# SPDX-License-Identifier: MIT
"""Distributions of yield stresses over fibres and cells; seeded, the same on every process.

Each cell of each beam draws from a stream of its own, known by where the beam begins and ends, so
that neither the order of beams nor the number of processes changes what it gets.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from numbers import Integral
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import scipy  # its parts are loaded when they are used

from ufl_beam.errors import SceneError, shorten
from ufl_beam.model.records import Positive, Record


def _require_seed(value: Any, what: str) -> None:
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 0:
        raise SceneError(f"{what} = {shorten(value)} must be a whole number, 0 or more")


@dataclass(frozen=True)
class Distribution(Record, ABC):
    """Base of the distributions: a random positive quantity."""

    _: KW_ONLY
    seed: Annotated[int, _require_seed]  # the same seed gives the same scene again

    @abstractmethod
    def _law(self) -> Any:
        """The distribution of SciPy."""

    def draw(self, n: int, key: tuple[int, int]) -> npt.NDArray[np.float64]:
        """``n`` independent values of the stream ``key``; none is negative; shape (n,)."""
        stream = np.random.default_rng(np.random.SeedSequence(int(self.seed), spawn_key=key))
        return np.asarray(np.maximum(self._law().rvs(n, random_state=stream), 0.0))


@dataclass(frozen=True)
class _ByMoments(Distribution):
    """Base of the distributions that are given by mean and standard deviation."""

    mean: Positive
    deviation: Positive


class Normal(_ByMoments):
    """Normal distribution; negative values become zero, and such fibres yield at once.

    Args:
        mean: Mean; Pa for fibres, N or N m for resultants.
        deviation: Standard deviation; same unit.
        seed: The same seed gives the same scene again.

    Raises:
        SceneError: Mean or deviation are not positive, or the seed is no whole number.

    Example:
        >>> limit = ub.Normal(mean=355e6, deviation=25e6, seed=1)
        >>> scattered = ub.Fibres(ub.Hardening(limit), number=16)
    """

    def _law(self) -> Any:
        return scipy.stats.norm(self.mean, self.deviation)


class TruncatedNormal(_ByMoments):
    """Normal distribution of these parameters, truncated to positive values.

    Example:
        >>> limit = ub.TruncatedNormal(mean=30e6, deviation=20e6, seed=1)
        >>> bool((limit.draw(100, (0, 0)) > 0).all())
        True
    """

    def _law(self) -> Any:
        return scipy.stats.truncnorm(-self.mean / self.deviation, np.inf, self.mean, self.deviation)


class Lognormal(_ByMoments):
    """Lognormal distribution of given mean and standard deviation.

    Example:
        >>> limit = ub.Lognormal(mean=355e6, deviation=25e6, seed=1)
        >>> scattered = ub.Fibres(ub.Hardening(limit), number=16)
    """

    def _law(self) -> Any:
        spread = np.sqrt(np.log1p((self.deviation / self.mean) ** 2))
        return scipy.stats.lognorm(spread, scale=self.mean * np.exp(-(spread**2) / 2))


@dataclass(frozen=True)
class Weibull(Distribution):
    """Weibull distribution of positive values, for strengths.

    Args:
        scale: Value that a part exp(-1) of all values exceeds; Pa for fibres, N or N m for
            resultants.
        shape: Weibull's modulus; the larger, the less scatter.
        seed: The same seed gives the same scene again.

    Raises:
        SceneError: Scale or shape are not positive, or the seed is no whole number.

    Example:
        >>> limit = ub.Weibull(scale=355e6, shape=20.0, seed=1)
        >>> scattered = ub.Fibres(ub.Hardening(limit), number=16)
    """

    scale: Positive
    shape: Positive

    def _law(self) -> Any:
        return scipy.stats.weibull_min(self.shape, scale=self.scale)
