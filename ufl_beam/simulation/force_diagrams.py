# SPDX-License-Identifier: MIT
"""Diagrams of section forces along beams."""

from __future__ import annotations

from typing import NamedTuple

from ufl_beam.arrays import Array
from ufl_beam.display import one_line


class Diagram(NamedTuple):
    """Section forces along a beam; at a vertex the values before and after it.

    Attributes:
        s: Parameter of the beam, from 0 at its start to 1; (num_cells points,).
        N: Axial force, positive in tension; N.
        V: Shear force, along the normal to the left of the direction of the beam; N.
        M: Bending moment, positive with tension to the right of that direction; N m.

    Example:
        >>> diagram = solution.diagram(beam, points=2)  # at both ends of the four cells
        >>> print(diagram.s[:4], diagram.M[:4].round(-3))
        [0.   0.25 0.25 0.5 ] [-195000. -146000. -146000.  -98000.]
    """

    s: Array
    N: Array
    V: Array
    M: Array

    def __repr__(self) -> str:
        return one_line(self)
