# SPDX-License-Identifier: MIT
"""Random distributions of the limits of fibres and springs.

Example:
    >>> limit = ub.distributions.Lognormal(355e6, 25e6, seed=1)  # Pa
    >>> steel = ub.Fibres(ub.ElastoPlastic(limit), number=10)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import scipy  # its parts are loaded when they are used

from ufl_beam.model.checks import require_count
from ufl_beam.model.records import Positive, Record

__all__ = ["Lognormal", "Normal", "TruncatedNormal", "Weibull"]


@dataclass(frozen=True)
class Distribution(Record, ABC):
    """Base of the distributions of a random quantity that is not negative.

    Each cell and each spring draws from a random stream of its own.  The key of the stream is a
    checksum of the ends of the beam and the number of the cell in the beam, or a checksum of the
    places of the spring.  So values depend on neither the number of processes nor the order of
    beams and springs, except of those between the same two points.
    """

    _: KW_ONLY
    # The same seed gives the same values again.
    seed: Annotated[int, partial(require_count, at_least=0)]

    @abstractmethod
    def _law(self) -> Any:
        """Return the distribution of SciPy."""

    def draw(self, n: int, key: tuple[int, ...]) -> npt.NDArray[np.float64]:
        """Draw ``n`` independent values from the stream ``key``; negative values become 0; (n,)."""
        stream = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))
        return np.asarray(np.maximum(self._law().rvs(n, random_state=stream), 0.0))


@dataclass(frozen=True)
class _ByMoments(Distribution):
    """Base of the distributions with a mean and a standard deviation."""

    mean: Positive
    deviation: Positive


class Normal(_ByMoments):
    """Normal distribution; negative values become zero: such points yield at once.

    Args:
        mean: Mean; Pa for fibres, N or N m for resultants.
        deviation: Standard deviation; same unit.
        seed: Seed of the random streams; the same seed gives the same values again.

    Raises:
        ModelError: Mean or deviation is not positive, or the seed is not a whole number from 0.

    Example:
        >>> limit = ub.distributions.Normal(mean=355e6, deviation=25e6, seed=1)
        >>> scattered = ub.Fibres(ub.ElastoPlastic(limit), number=16)
    """

    def _law(self) -> Any:
        return scipy.stats.norm(self.mean, self.deviation)


class TruncatedNormal(_ByMoments):
    """Normal distribution with the arguments of :class:`Normal`, truncated to positive values.

    By truncation the mean exceeds ``mean``, and the deviation is less than ``deviation``.

    Example:
        >>> limit = ub.distributions.TruncatedNormal(mean=30e6, deviation=20e6, seed=1)
        >>> bool((limit.draw(100, (0, 0)) > 0).all())
        True
    """

    def _law(self) -> Any:
        return scipy.stats.truncnorm(-self.mean / self.deviation, np.inf, self.mean, self.deviation)


class Lognormal(_ByMoments):
    """Lognormal distribution with the arguments of :class:`Normal`.

    Example:
        >>> limit = ub.distributions.Lognormal(mean=355e6, deviation=25e6, seed=1)
        >>> scattered = ub.Fibres(ub.ElastoPlastic(limit), number=16)
    """

    def _law(self) -> Any:
        spread = np.sqrt(np.log1p((self.deviation / self.mean) ** 2))
        return scipy.stats.lognorm(spread, scale=self.mean * np.exp(-(spread**2) / 2))


@dataclass(frozen=True)
class Weibull(Distribution):
    """Weibull distribution of positive values, for strengths.

    Args:
        scale: Value that is exceeded with the probability exp(-1); Pa for fibres, N or N m for
            resultants.
        shape: Weibull modulus; a larger modulus means less scatter.
        seed: Seed of the random streams; the same seed gives the same values again.

    Raises:
        ModelError: Scale or shape is not positive, or the seed is not a whole number from 0.

    Example:
        >>> limit = ub.distributions.Weibull(scale=355e6, shape=20.0, seed=1)
        >>> scattered = ub.Fibres(ub.ElastoPlastic(limit), number=16)
    """

    scale: Positive
    shape: Positive

    def _law(self) -> Any:
        return scipy.stats.weibull_min(self.shape, scale=self.scale)
