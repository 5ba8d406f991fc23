# SPDX-License-Identifier: MIT
"""Setting of a trade-off that was run, judged by the limits that are known."""

from __future__ import annotations

from dataclasses import dataclass

from ufl_beam.analysis.targets import Choice, Prediction, Target
from ufl_beam.analysis.tradeoff_result import Run


@dataclass(frozen=True)
class Found:
    """Setting that was run, and what the runs of its family predict."""

    run: Run
    prediction: Prediction

    @property
    def family(self) -> int:
        """Number of the dials that the setting begins with."""
        return self.run.refinement.family

    @property
    def expected(self) -> Choice:
        """The setting with the predicted wall time and error."""
        _, refine, level = self.run.refinement
        return self.prediction.choice(refine, level)

    @property
    def choice(self) -> Choice:
        """The setting with its wall time and the predicted error."""
        return self.expected._replace(seconds=self.run.seconds)

    @property
    def ratio(self) -> float:
        """Largest distance from a limit, in its unit."""
        return self.ratio_of(self.run)

    @property
    def unsure(self) -> float:
        """Largest uncertainty of a limit, in its unit."""
        return self.prediction.unsure

    def ratio_of(self, run: Run) -> float:
        """Return the largest distance of a run from a limit, in its unit."""
        crosses = self.prediction.crosses
        return self.prediction.largest({n: run.values[n] - c.limit for n, c in crosses.items()})

    def accepted(self, target: Target, run: Run | None = None) -> bool:
        """Return whether this run, or the same with other options, is what was asked for."""
        run = run or self.run
        return target.accepts(run.seconds, self.ratio_of(run), self.unsure)

    def clear(self, target: Target) -> bool:
        """Return whether limits are known well enough to tell that this run is accurate enough."""
        return self.ratio + self.unsure <= target.bounds[1]

    def serves(self, target: Target) -> bool:
        """Return whether this run is accurate and fast enough."""
        return not self.rank(target)[0]

    def rank(self, target: Target) -> tuple[bool, float]:
        """The least is the best."""
        return target.rank(self.run.seconds, self.ratio, self.unsure, self.expected)
