# SPDX-License-Identifier: MIT
"""Extremes of section forces and motions in a run, with their times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Body, Member
from ufl_beam.one_line import one_line
from ufl_beam.output.archive import require_arrays
from ufl_beam.output.recorders import Recorder
from ufl_beam.output.state_view import StateView


class Extent(NamedTuple):
    """Smallest and largest values of a run and their times; arrays of one shape.

    Attributes:
        low: The least values.
        high: The largest values.
        time_low: When the least were reached first; s.
        time_high: When the largest were reached first; s.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=extremes)
        >>> v = extremes.displacement(beam).of((-1, 1))
        >>> print(v.low.round(3), v.time_low)  # m, s
        -0.019 1.0
    """

    low: Array
    high: Array
    time_low: Array
    time_high: Array

    def __repr__(self) -> str:
        return one_line(self)

    @classmethod
    def around(cls, values: Array, t: float) -> Extent:
        """Return the range of the values of one time."""
        return cls(values.copy(), values.copy(), *np.full((2, *values.shape), t))

    def widen(self, values: Array, t: float) -> None:
        """Extend the range by the values of a time."""
        for reached, when, beyond in (
            (self.low, self.time_low, values < self.low),
            (self.high, self.time_high, values > self.high),
        ):
            if beyond.any():
                reached[beyond] = values[beyond]
                when[beyond] = t

    def of(self, rows: Index) -> Extent:
        """Return the range of some of the values."""
        return Extent(*(values[rows] for values in self))


class Extremes(Recorder):
    """Recorder of the extremes of section forces in all cells and of motions of all nodes.

    Each step counts, whatever the solution keeps; memory does not grow.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=extremes)
        >>> print(extremes.section_forces(beam).low[:, 2].round(-3))  # least M in the cells; N m
        [-175000. -125000.  -75000.  -25000.]
    """

    def open(self, simulation: StateView) -> None:
        """Begin with the initial state."""
        self._grid: Grid = simulation.grid
        self._forces, self._q = (Extent.around(x, simulation.t) for x in _state(simulation))

    def write(self, simulation: StateView) -> None:
        """Take in the state of a step."""
        for extent, values in zip((self._forces, self._q), _state(simulation), strict=True):
            extent.widen(values, simulation.t)

    def state(self) -> State:
        """Return the extremes so far, by name."""
        extents = ("forces", self._forces), ("q", self._q)
        return {f"{of} {name}": x for of, extent in extents for name, x in extent._asdict().items()}

    def resume(self, simulation: StateView, state: State) -> None:
        """Go on after a :meth:`state`."""
        self._grid = simulation.grid
        for what, values in zip(("forces", "q"), _state(simulation), strict=True):
            names = (f"{what} {name}" for name in Extent._fields)
            require_arrays(state, dict.fromkeys(names, values.shape))
        self._forces, self._q = (
            Extent(*(state[f"{what} {name}"].copy() for name in Extent._fields))
            for what in ("forces", "q")
        )

    @property
    def grid(self) -> Grid:
        """Vertices and cells of the scene.

        Raises:
            SceneError: Nothing was run.
        """
        if not hasattr(self, "_grid"):
            raise SceneError("Extremes: nothing was run; give it to simulate(..., record=)")
        return self._grid

    def section_forces(self, beam: Member) -> Extent:
        """Return extremes of (N, V, M) in the cells of a beam; (num_cells, 3); N, N, N m.

        Raises:
            SceneError: The beam is not in the scene, or nothing was run.
        """
        cells = self.grid.cells_of(beam)
        return self._forces.of(cells)

    def displacement(self, one: Member | Body) -> Extent:
        """Return extremes of (u, v, ψ) at the nodes of a beam, or of a body; (n, 3); m, m, rad.

        Raises:
            SceneError: It is not in the scene, or nothing was run.
        """
        dofs = self.grid.nodes_of(one)[1]
        return self._q.of(dofs)


def _state(simulation: StateView) -> tuple[Array, Array]:
    """Section forces of all cells, and the configuration, the same on every process."""
    return simulation.section_forces(), simulation.share.gather(simulation.q)
