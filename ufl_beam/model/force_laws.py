# SPDX-License-Identifier: MIT
"""Laws of connectors by functions of a user."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ufl_beam.display import one_line
from ufl_beam.errors import SceneError, closed, require_function, require_row
from ufl_beam.model.signatures import parameters_by_name


@closed("give it a function of your own")
@dataclass(frozen=True)
class ForceLaw:
    """Force of a connector as a function of its motion and rate, of time and its own history.

    Args:
        force: ``force(motion, rate)``; N or N m; a positive one resists growth.  It is evaluated
            where loads are, in dynamics in the middle of the step.  By name it may ask for ``t``,
            the time of that (s), ``dt``, the length of the step (s), and ``state``, the internal
            variables before it; then it returns the force and those after the step.
        state: Internal variables before the run.
        stored: ``stored(motion)``, or ``stored(motion, state)``, the energy that can be had back;
            J.  It is in the entry "stored" of the ledger, and the work that the law takes beyond it
            in the entry "functions"; without it all of the work.

    Raises:
        SceneError: A parameter that is not known; a state that the function does not ask for, or
            that it does and is not there.

    Example:
        >>> law = ub.ForceLaw(lambda motion, rate: 1e6 * motion + 1e9 * motion**3)
        >>> spring = ub.Slide(ub.ground(2, 0), beam.end, law, axis=(0, 1))
        >>> propped = ub.Scene([beam], [], scene.supports, scene.loads, connectors=[spring])
        >>> run = ub.simulate(propped, ub.Static(), t=(0, 1), dt=0.25)
        >>> bool(run.connector(spring).force[-1] < 0)  # it is compressed
        True
        >>> def maxwell(motion, rate, dt, state):  # a spring in series with a damper, and its force
        ...     after = (state[0] + 1e6 * rate * dt) / (1 + dt / 0.1)
        ...     return (state[0] + after) / 2, [after]
        >>> device = ub.Slide(ub.ground(2, 0), beam.end, ub.ForceLaw(maxwell, [0.0]), axis=(0, 1))
        >>> relaxing = ub.Scene([beam], [], scene.supports, scene.loads, connectors=[device])
        >>> run = ub.simulate(relaxing, ub.Midpoint(), t=(0, 1), dt=0.01)
        >>> bool(run.energy["functions"][-1] > 0), bool(run.energy.worst < 1e-9)
        (True, True)
    """

    force: Callable[..., Any]
    state: Sequence[float] = ()
    stored: Callable[..., float] | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        require_function(self.force, "ForceLaw: force", "(motion, rate)")
        row = require_row(self.state, "ForceLaw: state")
        object.__setattr__(self, "state", tuple(map(float, row.flat)))
        if self.state and "state" not in self.asked:
            raise SceneError(
                "ForceLaw: the function does not ask for the state; let it have a parameter state, "
                "and return the force and the state after the step"
            )
        if self.stored is not None:
            require_function(self.stored, "ForceLaw: stored", "the motion, or (motion, state)")
        _ = self.asked, self.asked_by_stored  # which refuse names that nobody knows

    @property
    def _history(self) -> tuple[str, ...]:
        return ("state",) if self.state else ()

    @property
    def asked(self) -> tuple[str, ...]:
        """Names by which the function asks for more than motion and rate."""
        return _names(self.force, ("t", "dt", *self._history), "force", after=2)

    @property
    def asked_by_stored(self) -> tuple[str, ...]:
        """Names by which the energy asks for more than the motion."""
        return _names(self.stored, self._history, "stored", after=1) if self.stored else ()


def _names(
    function: Callable[..., Any], known: tuple[str, ...], what: str, after: int
) -> tuple[str, ...]:
    names = parameters_by_name(function, known, after)
    for unknown in names.unknown if names else ():
        known = (*known, *(() if "state" in known else ("with ForceLaw(..., state=[...]) state",)))
        raise SceneError(
            f"ForceLaw: {what} has a parameter {unknown!r}, which nobody knows; there are "
            f"{', '.join(known)}"
        )
    return names.asked if names else ()
