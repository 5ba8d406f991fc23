# SPDX-License-Identifier: MIT
"""Search for the equilibrium of a step in which no more opens than must.

With strong softening a step has two solutions, one in which a hinge stays closed and one in which
it has opened.  The rule that chooses: a hinge, a crack of a fibre or a softening spring that does
not flow at the beginning of a step stays closed in it if there is an equilibrium in which it bears
at most its limit.  Of several that bear too much, the one with the largest excess opens first, and
the others only if they still do then.

Laws of connectors that hold a motion follow the same rule, where the sliding force may be below the
limit: what sticks goes on to stick, and what slides to slide, if there is such an equilibrium.
"""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Index
from ufl_beam.compiled.c_library import lib

SPENT, NOTHING = 1e-6, 1e-30
"""Part of its limit below which an open hinge counts as a joint; factor of its stiffness then."""

RELEASED = float(lib.RELEASED)
"""Value of "flows" of a point that may open in this step although it did not flow in the last."""


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
