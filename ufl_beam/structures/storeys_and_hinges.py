# SPDX-License-Identifier: MIT
"""Drifts and shears of storeys, and a table of hinges: rotations, ductility, limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import Parameter, Tabular
from ufl_beam.errors import ArgumentError, require_all, require_kind, require_sequence, shorten
from ufl_beam.model.bodies import AttachmentPoint, Member, Place, require_place
from ufl_beam.model.checks import require_vector
from ufl_beam.model.connectors import Connector
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.output.hinge_histories import hinge_histories, index_of_largest, require_limits
from ufl_beam.simulation.solution import Solution

SAME_LEVEL = 1e-9
"""Largest distance of a point from a level on which it lies, as a fraction of the scene's size."""


@dataclass(frozen=True, eq=False)
class Storeys(Tabular):
    """Drifts and shears of storeys at the stored times; :func:`storeys` returns it.

    The text and :meth:`frame` have a row for each storey: the values of largest magnitude, and the
    times at which they occur.

    Attributes:
        levels: Places at the levels, from the lowest to the highest.
        times: Times or load factors; (n+1,).
        heights: Heights of the storeys; (num_storeys,); m.
        drift: Horizontal displacement of the upper level of each storey relative to its lower
            level; (n+1, num_storeys); m.
        shear: Horizontal force in each storey, positive if it balances forces in the direction +x
            on the scene above; (n+1, num_storeys); N.
        parameter: Labels of ``times``.

    Example:
        >>> column = ub.Beam((0, 0), (0, 3), section, name="column")
        >>> push = ub.PointLoad(column.end, force=(2e3, 0))
        >>> frame = ub.Scene([column], supports=[ub.Clamped(column.start)], loads=[push])
        >>> run = ub.simulate(frame, ub.Static(), t=(0, 1), dt=1.0)
        >>> storeys = st.storeys(run, [column.start, column.end])
        >>> print(storeys.shear[-1].round(6))  # N
        [2000.]
        >>> print(storeys)
        storey  height [m]  drift [m]  drift ratio  drift at t [s]  shear [N]  shear at t [s]
        1                3  0.0012...    0.0004...               1       2000               1
    """

    levels: tuple[AttachmentPoint, ...]
    times: Array
    heights: Array
    drift: Array
    shear: Array
    parameter: Parameter

    @property
    def ratio(self) -> Array:
        """Drifts divided by the heights of the storeys; (n+1, num_storeys)."""
        return self.drift / self.heights

    def columns(self) -> dict[str, list[Any]]:
        """Return the values of largest magnitude in each storey, by name and unit."""
        storeys = np.arange(len(self.heights))
        drifts, shears = (index_of_largest(values) for values in (self.drift, self.shear))
        at = self.parameter.column
        columns = {
            "storey": storeys + 1, "height [m]": self.heights,
            "drift [m]": self.drift[drifts, storeys], "drift ratio": self.ratio[drifts, storeys],
            f"drift at {at}": self.times[drifts],
            "shear [N]": self.shear[shears, storeys], f"shear at {at}": self.times[shears],
        }  # fmt: skip
        return {name: values.tolist() for name, values in columns.items()}

    def __repr__(self) -> str:
        return f"<Storeys: {len(self.heights)}, {len(self.times)} states>"


def storeys(
    solution: Solution,
    levels: Sequence[AttachmentPoint],
    *,
    direction: Sequence[float] | None = None,
) -> Storeys:
    """Return drifts and shears of the storeys between levels; y points upwards, in space z.

    The drift of a storey is the difference of the horizontal displacements of its two levels.  Its
    shear is the sum of the horizontal forces in beams, links and connectors that a horizontal cut
    just above its lower level meets.  A cut through the feet of all columns bears the base shear.

    Args:
        solution: Run, or path.
        levels: A place at each level, from the feet of the columns to the roof.
        direction: In space, the horizontal direction (x, y) of drifts and shears.

    Raises:
        ArgumentError: A level is not above the one before it, nothing is cut above a level, or a
            body is cut; in space, there is no direction.

    Example:
        >>> mast = ub.Beam((0, 0), (0, 3), section)
        >>> wind = ub.LineLoad(mast, force=(500, 0))  # N/m
        >>> tower = ub.Scene([mast], supports=[ub.Clamped(mast.start)], loads=[wind])
        >>> run = ub.simulate(tower, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(st.storeys(run, [mast.start, mast.at(0.5), mast.end]).shear[-1].round(6))  # N
        [1500.  750.]
    """
    require_kind(solution, Solution, "storeys: solution")
    places = require_sequence(levels, "storeys: levels")
    for i, place in enumerate(places):
        require_place(place, f"storeys: levels[{i}]")
    if len(places) < 2:
        raise ArgumentError("storeys: levels must have at least two places, the lowest first")
    in_space, ahead = solution.scene.in_space, np.array([1.0, 0.0])
    if in_space != (direction is not None):
        raise ArgumentError(
            "storeys: in space give direction=(x, y) of drifts and shears; in the plane there is "
            "none, because they are along x"
        )
    if direction is not None:
        way = np.array(require_vector(direction, "storeys: direction"))
        if not way.any():
            raise ArgumentError(f"storeys: direction = {shorten(direction)} has no length")
        ahead = np.append(way / np.linalg.norm(way), 0.0)
    elevations = np.array([place.point[-1] for place in places])
    least = SAME_LEVEL * solution.scene.size
    for i in np.flatnonzero(np.diff(elevations) <= least)[:1]:
        raise ArgumentError(
            f"storeys: levels[{i + 1}] = {places[i + 1]} is not above levels[{i}] = {places[i]}; "
            "give the levels from the lowest to the highest"
        )
    motions = [solution.displacement(place)[:, : len(ahead)] for place in places]
    moved = np.column_stack([motion @ ahead for motion in motions])
    shear = shears_above(solution, elevations[:-1], least, ahead)
    heights = np.diff(elevations)
    return Storeys(
        places, solution.times, heights, np.diff(moved, axis=1), shear, solution.parameter
    )


def shears_above(solution: Solution, elevations: Array, tolerance: float, ahead: Array) -> Array:
    """Compute horizontal forces on the scene below horizontal cuts, by the scene above; (n+1, m).

    They are along the unit vector ``ahead``.  A cut is just above its elevation (m): points within
    ``tolerance`` (m) of it are below.
    """
    numbering, scene = solution.numbering, solution.scene
    axis = "yz"[scene.in_space]
    y = numbering.points[numbering.cells, -1]
    shear, cut_cells = np.zeros((len(solution), len(elevations))), list[Any]()
    for k, elevation in enumerate(elevations):
        above = y > elevation + tolerance
        for cell in np.flatnonzero(above[:, 0] != above[:, 1]):
            fraction = (elevation - y[cell, 0]) / np.diff(y[cell])[0]
            at_end = round(fraction)
            if abs(y[cell, at_end] - elevation) <= tolerance:
                fraction = float(at_end)
            cut_cells.append((k, int(cell), float(fraction), 1 if above[cell, 1] else -1))
        connectors = _cut_connectors(scene, elevation, tolerance)
        for connector, sign in connectors:
            force = solution.connector(connector).force
            directions = solution.directions(connector)[:, : len(ahead)]
            shear[:, k] += sign * force * (directions @ ahead)
        if not connectors and not any(cut[0] == k for cut in cut_cells):
            raise ArgumentError(
                f"storeys: nothing is cut just above the level {axis} = {elevation:g} m; give a "
                "place at the feet of the columns of each storey"
            )
    _, cells, fractions, _ = zip(*cut_cells, strict=True) if cut_cells else ((), (), (), ())
    forces = solution.forces_in_cells(cells, fractions, in_plane=True)
    for i, (k, _, _, sign) in enumerate(cut_cells):
        shear[:, k] += sign * (forces[:, i, : len(ahead)] @ ahead)
    return shear


def _cut_connectors(scene: Scene, elevation: float, tol: float) -> list[tuple[Connector, int]]:
    """Return connectors of displacements through a cut, with the sign 1 if b is above it."""
    axis = "yz"[scene.in_space]

    def above(place: AttachmentPoint) -> bool:
        return place.point[-1] > elevation + tol

    for body, points in attachment_points(scene).items():
        if body in scene.bodies and len({*map(above, points)}) > 1:
            raise ArgumentError(
                f"storeys: the level {axis} = {elevation:g} m cuts the body {body.name}, whose "
                "internal forces are unknown; give a level at which only beams and connectors are "
                "cut"
            )
    return [
        (connector, 1 if above(connector.b) else -1)
        for connector in scene.all_connectors
        if not connector.is_rotation and above(connector.a) != above(connector.b)
    ]


class HingeState(NamedTuple):
    """Largest rotations and dissipated energy of a hinge in a run.

    Attributes:
        where: Place of a hinge, middle of a cell with an open hinge, or rotational connector.  For
            a beam with yielding or cracking cells, the middle of the cell that dissipates most.
        n: Index of the first state after the first yielding; -1 if the hinge did not yield.
        time: Time or load factor of this state; NaN if the hinge did not yield.
        rotation: Rotation of largest magnitude; rad.
        plastic: Plastic rotation of largest magnitude; rad.
        ductility: Magnitude of ``rotation`` divided by the yield rotation, if there is one.
        dissipated: Dissipated energy at the last state, of runs before ``start=``, too; J.
        state: Name of the acceptance limit that the hinge satisfies, "elastic", or "beyond ...".
    """

    where: Place | Connector
    n: int
    time: float
    rotation: float
    plastic: float
    ductility: float
    dissipated: float
    state: str


@dataclass(frozen=True, eq=False)
class HingeTable(Tabular):
    """Table of hinges in the order of first yielding; :func:`hinge_table` returns it.

    Attributes:
        rows: A :class:`HingeState` for each hinge.
        parameter: Labels of the times.

    Example:
        >>> table = st.hinge_table(broken, {"IO": 0.005, "LS": 0.015, "CP": 0.03})  # rad
        >>> print(table)
        hinge              yields at t [s]  rotation [rad]  plastic [rad]  ...  state
        ...
    """

    rows: tuple[HingeState, ...]
    parameter: Parameter

    def columns(self) -> dict[str, list[Any]]:
        """Return the columns of the table by name and unit."""
        where, _, times, *others = zip(*self.rows, strict=True) if self.rows else ((),) * 8
        names = "rotation [rad]", "plastic [rad]", "ductility", "dissipated [J]", "state"
        columns = {"hinge": map(str, where), f"yields at {self.parameter.column}": times}
        columns |= dict(zip(names, others, strict=True))
        return {name: [*values] for name, values in columns.items()}

    def __repr__(self) -> str:
        return f"<HingeTable: {len(self.rows)}, {sum(x.n >= 0 for x in self.rows)} yielded>"


def hinge_table(
    solution: Solution,
    limits: Mapping[str, float] = MappingProxyType({}),
    *,
    n: int = -1,
    only: Sequence[Member | Connector] | None = None,
) -> HingeTable:
    """Return rotations, ductility and dissipated energy of all hinges of a run, as a table.

    The rows are in the order of first yielding.  They are all hinges of zero length, open hinges of
    cells, connectors whose rotation may yield or soften, and beams with yielding or cracking cells,
    of which only the energy is known.  See docs/results.md.

    Args:
        solution: Run, or path.
        limits: Acceptance limits of the plastic rotation by name, in increasing order, as in
            ``{"IO": 0.01, "LS": 0.025, "CP": 0.04}``; rad.
        n: Index of the last state that counts, negative from the end, such as ``target.n`` of a
            pushover.
        only: Beams and connectors whose hinges are listed; all by default.

    Raises:
        ArgumentError: A limit is not positive or not above the limit before it, or a beam or
            connector is not in the scene.

    Example:
        >>> (row,) = st.hinge_table(broken, {"IO": 0.01, "LS": 0.1}).rows
        >>> print(row.where, row.state)
        beam.start (0, 0) LS
    """
    require_kind(solution, Solution, "hinge_table: solution")
    require_limits(limits, "hinge_table: limits")
    require_kind(n, (int, np.integer), "hinge_table: n")
    known = {*solution.scene.beams, *solution.scene.connectors}
    owners = known if only is None else require_all(only, "hinge_table: only", (Member, Connector))
    for i, owner in enumerate(owners):
        if owner not in known:
            raise ArgumentError(f"hinge_table: only[{i}] = {shorten(owner)} is not in the scene")
    rows, times = list[HingeState](), solution.times
    for hinge in hinge_histories(solution.subset(0, solution.index(n) + 1), owners):
        first, rotation, at_yield = hinge.first_yield, hinge.largest_rotation, hinge.yield_rotation
        rows.append(HingeState(
            hinge.where, first, float(times[first]) if first >= 0 else math.nan, rotation,
            hinge.largest_plastic, abs(rotation) / at_yield if at_yield else math.nan,
            float(hinge.dissipated[-1]), hinge.state(limits),
        ))  # fmt: skip
    return HingeTable(tuple(rows), solution.parameter)
