# SPDX-License-Identifier: MIT
"""Names and units of the parameter of a solution: time, or the load factor of a path."""

from __future__ import annotations

from typing import NamedTuple


class Parameter(NamedTuple):
    """Words for the parameter of a solution, in pictures, tables and messages."""

    name: str  # title of an axis or a colour bar
    value: str  # format of a value in a sentence
    step: str  # format of a step in a sentence
    column: str  # title of a column
    progress: str  # title of an axis along which a solution goes one way only

    def at(self, value: float, digits: str = ".4g") -> str:
        """A value in words."""
        return self.value.format(format(value, digits))

    def over(self, step: float) -> str:
        """A step in words."""
        return self.step.format(format(step, ".3g"))


TIME = Parameter("time t (s)", "t = {} s", "dt = {} s", "t [s]", "time t (s)")

FACTOR = Parameter(
    "load factor",
    "load factor {}",
    "a change of the load factor by {}",
    "load factor [-]",
    "way along the path, root mean square of the nodes (m)",
)
