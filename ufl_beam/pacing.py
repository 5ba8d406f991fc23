"""How a run goes through time: one step after the other, from its beginning to its end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from ufl_beam.simulation import Simulation


class Pace(Protocol):
    """What chooses the steps of a run.

    Attributes:
        steps: Steps done.
        finished: Whether the end is reached.
        progress: Part of the way that is done, from 0 to 1.
    """

    steps: int
    finished: bool
    progress: float

    def advance(self, simulation: Simulation) -> None:
        """One step.

        Raises:
            ConvergenceError: It failed.
        """

    def state(self) -> dict[str, float]:
        """Numbers from which :meth:`restore` goes on."""

    def restore(self, state: dict[str, float]) -> None:
        """Go on from a :meth:`state`."""


class EqualSteps:
    """Steps of one size, a little shorter than asked for where that does not divide the time.

    Args:
        t0: Beginning; s.
        t1: End; s.
        dt: Longest step; s.
    """

    def __init__(self, t0: float, t1: float, dt: float) -> None:
        self._t0, self._t1 = t0, t1
        # The slack is for the rounding of (t1 - t0) / dt.
        self._all = max(1, math.ceil((t1 - t0) / dt * (1 - 1e-9)))
        self.steps = 0

    @property
    def finished(self) -> bool:
        """Whether all steps are done."""
        return self.steps == self._all

    @property
    def progress(self) -> float:
        """Part of the steps that are done."""
        return self.steps / self._all

    def advance(self, simulation: Simulation) -> None:
        """One step; where it fails, in parts."""
        n = self.steps + 1
        simulation.step_to(self._t0 + (self._t1 - self._t0) * n / self._all)
        self.steps = n

    def state(self) -> dict[str, float]:
        """The number of steps."""
        return {"steps": float(self.steps)}

    def restore(self, state: dict[str, float]) -> None:
        """Go on after that many."""
        self.steps = int(state["steps"])
