# SPDX-License-Identifier: MIT
"""Results of load combinations: their solutions and the envelope."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.display import Rich, in_one_line
from ufl_beam.errors import require_array
from ufl_beam.model.bodies import AttachmentPoint, Member
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.simulation.solution import Solution

UNITS = {
    3: (("N", "kN"), ("V", "kN"), ("M", "kN m")),
    6: (("N", "kN"), ("V2", "kN"), ("V3", "kN"), ("T", "kN m"), ("M2", "kN m"), ("M3", "kN m")),
}
"""Section forces of the plane and of space with their units in texts, in which values in SI units
are divided by 1000."""


@in_one_line
class Governing(NamedTuple):
    """Smallest and largest values over load combinations, as arrays of the same shape.

    Attributes:
        low: The least values.
        high: The largest values.
        low_by: Names (``str``) of the combinations with the least values.
        high_by: Names (``str``) of the combinations with the largest values.

    Example:
        >>> free = ub.Scene([beam], supports=scene.supports)
        >>> cases = {"G": [ub.Gravity()], "Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
        >>> both = st.load_combinations(free, cases, {"1": {"G": 1.35, "Q": 1.5}, "2": {"G": 1}})
        >>> forces = both.section_forces(beam)
        >>> print(forces.high[0, 1].round(), forces.high_by[0, 1])  # V at the start; N
        -3080.0 2
    """

    low: Array
    high: Array
    low_by: npt.NDArray[Any]
    high_by: npt.NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class LoadCombinations(Rich):
    """Runs of load combinations and their envelope; made by :func:`load_combinations`.

    Attributes:
        factors: Factor of each load case, by the names of combination and case.
        solutions: Solution of each combination that has an equilibrium, by its name; the last state
            has the whole loads.
        failed: Reason why a combination has no equilibrium, by its name.

    Example:
        >>> free = ub.Scene([beam], supports=scene.supports)
        >>> cases = {"G": [ub.Gravity()], "Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
        >>> both = st.load_combinations(free, cases, {"1": {"G": 1.35, "Q": 1.5}, "2": {"G": 1}})
        >>> M = both.section_forces(beam)
        >>> print(M.low[0, 2].round(-2), M.low_by[0, 2])  # N m
        -34200.0 1
        >>> figure = ub.plot(both, "M")
    """

    factors: dict[str, dict[str, float]]
    solutions: dict[str, Solution]
    failed: dict[str, str]

    @property
    def scene(self) -> Scene:
        """Model, with the loads of the first combination that has an equilibrium."""
        return next(iter(self.solutions.values())).scene

    def envelope(self, value: Callable[[Solution], npt.ArrayLike]) -> Governing:
        """Return extremes of a function of a solution, such as the drift of a storey.

        Example:
            >>> free = ub.Scene([beam], supports=scene.supports)
            >>> cases = {"Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
            >>> both = st.load_combinations(free, cases, {"A": {"Q": 1.5}, "B": {"Q": -1.0}})
            >>> both.envelope(lambda run: run.displacement(beam.end)[-1, 1]).low_by
            'A'
        """
        names = np.array([*self.solutions], dtype=object)  # its elements are str, not np.str_
        values = np.array([
            require_array(value(run), f"envelope: the value of combination {name!r}")
            for name, run in self.solutions.items()
        ])  # fmt: skip
        return Governing(
            values.min(axis=0), values.max(axis=0),
            names[values.argmin(axis=0)], names[values.argmax(axis=0)],
        )  # fmt: skip

    def section_forces(self, beam: Member, *, points: int = 9) -> Governing:
        """Return extremes of (N, V, M) at points of the cells of a beam; N, N, N m.

        In space, they are of (N, V2, V3, T, M2, M3).
        Rows have the order of a :class:`Diagram` with the same points; (num_cells · points, 3).

        Raises:
            ArgumentError: The beam is not in the scene, or ``points`` is less than 2.
        """
        return self.envelope(lambda run: np.transpose(run.diagram(beam, points=points)[1:]))

    def displacement(self, place: AttachmentPoint) -> Governing:
        """Return extremes of (u, v, ψ) of a place; (3,); m, m, rad."""
        return self.envelope(lambda run: run.displacement(place)[-1])

    def reaction(self, support: Support) -> Governing:
        """Return extremes of the force (x, y) and moment of a support; (3,); N, N, N m.

        Raises:
            ArgumentError: The support is not in the scene.
        """
        return self.envelope(lambda run: run.reaction(support)[-1])

    def __str__(self) -> str:
        first = next(iter(self.solutions.values()))
        width = max(len(name) for name in self.factors)
        lines = [f"{repr(self)[1:-1]}; extremes of section forces and their combinations"]
        for beam in first.scene.beams:
            reached = self.section_forces(beam)
            for k, (name, unit) in enumerate(UNITS[reached.low.shape[1]]):
                low, high = int(reached.low[:, k].argmin()), int(reached.high[:, k].argmax())
                lines.append(
                    f"  {beam.name:12s} {name} {reached.low[low, k] / 1e3:10.2f} {unit:4s} "
                    f"{reached.low_by[low, k]:{width}s} {reached.high[high, k] / 1e3:10.2f} "
                    f"{unit:4s} {reached.high_by[high, k]}"
                )
        return "\n".join([*lines, *(f"  {name}: {why}" for name, why in self.failed.items())])

    def __repr__(self) -> str:
        return f"<LoadCombinations: {len(self.factors)} combinations, {len(self.failed)} failed>"
