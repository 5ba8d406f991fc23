# SPDX-License-Identifier: MIT
"""Extremes of section forces and motions in a run, with their times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index, State
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.display import one_line
from ufl_beam.errors import SceneError, require_number
from ufl_beam.model.bodies import Body, Member
from ufl_beam.output.archive import require_arrays
from ufl_beam.output.recorders import Recorder
from ufl_beam.output.state_view import StateView
from ufl_beam.output.watches import Watch


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
    """Recorder of the extremes of section forces along all cells and of motions of all nodes.

    Each step counts, whatever the solution keeps; memory does not grow.  Section forces are those
    of diagrams in equally spaced points of each cell, both ends included.

    Args:
        points: Number of points of a cell, at least 2.

    Raises:
        SceneError: ``points`` is less than 2.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=extremes)
        >>> M = extremes.section_forces(beam).low[:, 2]  # N m
        >>> print(M[:6].round(-3))  # at both ends of three of the four cells
        [-195000. -146000. -146000.  -98000.  -98000.  -49000.]
    """

    def __init__(self, points: int = 2) -> None:
        require_number(points, "Extremes: points", at_least=2)
        self._parts = np.arange(int(points)) / (int(points) - 1)
        self._watch: Watch | None = None
        self._taken: list[Extent] = []

    def open(self, simulation: StateView) -> None:
        """Begin with the initial state."""
        self._grid: Grid = simulation.grid
        self._watch = simulation.watch(self._parts)
        if self._watch is None:
            self._taken = [Extent.around(x, simulation.t) for x in self._state(simulation)]
        self.write(simulation)

    @property
    def by_itself(self) -> bool:
        """True if steps are taken in without a call of :meth:`write`."""
        return self._watch is not None

    def write(self, simulation: StateView) -> None:
        """Take in the state of a step."""
        if self._watch is not None:
            self._watch.take(simulation.parts, simulation.t, simulation.q, simulation.q_before)
            return
        for extent, values in zip(self._taken, self._state(simulation), strict=True):
            extent.widen(values, simulation.t)

    def close(self) -> None:
        """End the record; what was reached stays."""
        self._taken, self._watch = self._extents, None

    def _state(self, simulation: StateView) -> tuple[Array, Array]:
        """Section forces of all cells, and the configuration, the same on every process."""
        return simulation.forces_along(self._parts), simulation.share.gather(simulation.q)

    @property
    def _extents(self) -> list[Extent]:
        """Those of forces and of motions."""
        if self._watch is not None:
            return [Extent(*of) for of in self._watch.extents()]
        return self._taken

    def state(self) -> State:
        """Return the extremes so far, by name."""
        extents = zip(("forces", "q"), self._extents, strict=True)
        return {f"{of} {name}": x for of, extent in extents for name, x in extent._asdict().items()}

    def resume(self, simulation: StateView, state: State) -> None:
        """Go on after a :meth:`state`."""
        self._grid = simulation.grid
        shapes = (len(self._grid.cells), len(self._parts), 3), (self._grid.size,)
        for what, shape in zip(("forces", "q"), shapes, strict=True):
            names = (f"{what} {name}" for name in Extent._fields)
            require_arrays(state, dict.fromkeys(names, shape))
        self._taken = [
            Extent(*(state[f"{what} {name}"].copy() for name in Extent._fields))
            for what in ("forces", "q")
        ]
        self._watch = simulation.watch(self._parts)
        if self._watch is not None:
            self._watch.begin(simulation.parts, self._taken)

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
        """Return extremes of (N, V, M) in points of the cells of a beam, N, N, N m.

        They are in the order of a :class:`Diagram` with as many points; (num_cells points, 3).

        Raises:
            SceneError: The beam is not in the scene, or nothing was run.
        """
        cells = self.grid.cells_of(beam)
        return Extent(*(x.reshape(-1, 3) for x in self._extents[0].of(cells)))

    def displacement(self, one: Member | Body) -> Extent:
        """Return extremes of (u, v, ψ) at the nodes of a beam, or of a body; (n, 3); m, m, rad.

        Rows follow a beam from start to end: its vertices, between them the inner nodes of a mesh
        of higher degree.  At a hinge ψ is that of :meth:`Solution.displacement` at the place.

        Raises:
            SceneError: It is not in the scene, or nothing was run.
        """
        if isinstance(one, Body):
            return self._extents[1].of(self.grid.node(one.middle).reshape(1, 3))
        return self._extents[1].of(self.grid.dofs[self.grid.nodes_along(one)])
