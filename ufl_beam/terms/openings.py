# SPDX-License-Identifier: MIT
"""Search for the equilibrium of a step in which no more opens than must.

With strong softening a step has two solutions, one in which a hinge stays closed and one in which
it has opened.  The rule that chooses: a hinge, a crack of a fibre or a softening spring that does
not flow at the beginning of a step stays closed in it if there is an equilibrium in which it bears
at most its limit.  Of several that bear too much, the one with the largest excess opens first, and
the others only if they still do then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import StepFailed

FALL = 0.7
"""Held places open from the largest excess over their limit on, then from this part of it on, ...

Where one opens, others may unload; so the worst one opens first.  That the part falls keeps the
number of solutions small where many open in a step: up to 14, with 8000 fibres in steps of any
length.
"""

TIE = 1e-9
"""Difference of two excesses, as parts of their limits, that means nothing.

Places that bear the same but for the tolerance of the solver open together, on any number of
processes.
"""


OPENED, STIFF, HOLD, OVER = (lib.OPENED, lib.STIFF, lib.HOLD, lib.OVER)
"""Entries of :attr:`SearchFlags.flags`."""


SPENT, NOTHING = 1e-6, 1e-30
"""Part of its limit below which an open hinge counts as a joint; factor of its stiffness then."""

RELEASED = float(lib.RELEASED)
"""Value of "flows" of a point that may open in this step although it did not flow in the last."""


BEGIN = tuple(np.eye(lib.SEARCH_FLAGS, dtype=np.int32)[HOLD] * hold for hold in (0, 1))
"""Flags at the beginning of a search in which what does not flow may open, or is held."""


class SearchFlags:
    """Flags that all points and connectors of a scene share in a step.

    Attributes:
        flags: Of the present search for an equilibrium; (4,), int32.  OPENED: a point has opened.
            STIFF: points that do not open answer elastically.  HOLD: points that do not flow stay
            closed.  OVER: one of them has borne more than its limit.
        switched: Whether the row of a connector was about its motion in the latest tangent and is
            about its force now, or the other way round; (1,), int32.
    """

    def __init__(self) -> None:
        self.switched: Index = np.zeros(1, dtype=np.int32)
        self.flags: Index = np.zeros(lib.SEARCH_FLAGS, dtype=np.int32)

    def begin(self, hold: bool) -> None:
        """Begin a search for an equilibrium."""
        self.flags[:] = BEGIN[hold]

    @property
    def opened(self) -> bool:
        """True if a point of this process has opened."""
        return bool(self.flags[OPENED])

    def stiffen(self, stiff: bool) -> None:
        """Let points that do not open answer elastically, or no more."""
        self.flags[STIFF] = stiff


class Openable(Protocol):
    """Places of one kind that open beyond a limit, and are held closed while HOLD is set."""

    @property
    def over(self) -> Array:
        """``|stress| / limit - 1`` of held places in the latest residual; of all, or the largest.

        Zero of places that bear at most their limit.
        """

    def release(self, least: float) -> None:
        """Let held places open from now on whose excess is at least so large."""

    def hold(self) -> None:
        """Close again the points that :meth:`release` opened."""


class Openings:
    """Solves a step with what does not flow held closed, then lets open what bears too much."""

    def __init__(self, search: SearchFlags, places: Sequence[Openable], share: Share) -> None:
        self._search, self._places, self._share = search, places, share
        self._released = False

    @property
    def flags(self) -> Index:
        """:attr:`SearchFlags.flags` of the places."""
        return self._search.flags

    def solve(
        self, guess: Array, solve: Callable[[Array], Array], again: Callable[[], None]
    ) -> Array:
        """Find the equilibrium of a step from a guess; ``again`` begins the step again.

        Raises:
            StepFailed: There is none, neither with places held closed nor with all of them free.
        """
        search = self._search
        search.begin(hold=True)
        try:
            q = solve(guess)
            opens = search.flags[OVER] or not self._share.alone
            return self._open_few(q, solve) if opens else q
        except StepFailed:
            if not self._share.largest(float(search.flags[OVER])):
                raise  # nothing would open
        finally:
            search.begin(hold=False)
            self.close()
        again()
        return solve(guess)

    def _open_few(self, q: Array, solve: Callable[[Array], Array]) -> Array:
        """Let places open, in turn, until none bears too much."""
        times = 0
        while self.open(times):
            q, times = solve(q), times + 1
        return q

    def open(self, times: int) -> bool:
        """Let places open that bear too much, those with the largest excess first.

        Args:
            times: Number of earlier calls in the step.

        Returns:
            True if there are such places.
        """
        here = (float(one.over.max(initial=0.0)) for one in self._places)
        excess = self._share.largest(max(here, default=0.0))
        if excess:
            self._released = True
            for one in self._places:
                one.release(FALL**times * excess - TIE)
        return bool(excess)

    def close(self) -> None:
        """Close again what :meth:`open` opened, before the step is accepted."""
        if self._released:
            self._released = False
            for one in self._places:
                one.hold()
