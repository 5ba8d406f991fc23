# SPDX-License-Identifier: MIT
"""Results by which engineers design frames: drifts and shears of storeys, and a table of hinges."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import Parameter, Tabular
from ufl_beam.errors import (
    ArgumentError,
    require_all,
    require_kind,
    require_number,
    require_sequence,
    require_text,
    shorten,
)
from ufl_beam.model.bodies import AttachmentPoint, Member, Place, require_place
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import RigidPlastic, Spring
from ufl_beam.model.connectors import Connector, can_yield, place_of
from ufl_beam.model.hinge_laws import AxialBendingHinge, IbarraKrawinkler, PinchingHinge
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.output.state_rows import HINGE, OWN_LAW_YIELDS, PLASTIC, Connection
from ufl_beam.output.states import States

# -- storeys ---------------------------------------------------------------------------------------

SAME_LEVEL = 1e-9
"""Largest distance of a point from a level on which it lies, as a fraction of the scene's size."""


@dataclass(frozen=True, eq=False)
class Storeys(Tabular):
    """Drifts and shears of storeys at the stored times; :meth:`Solution.storeys` returns it.

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
        >>> storeys = run.storeys([column.start, column.end])
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
        drifts, shears = (_largest(values) for values in (self.drift, self.shear))
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


def storeys_of(states: States, levels: Sequence[AttachmentPoint], parameter: Parameter) -> Storeys:
    """Compute drifts and shears; see :meth:`Solution.storeys`."""
    places = require_sequence(levels, "storeys: levels")
    for i, place in enumerate(places):
        require_place(place, f"storeys: levels[{i}]")
    if len(places) < 2:
        raise ArgumentError("storeys: levels must have at least two places, the lowest first")
    elevations = np.array([place.point[1] for place in places])
    least = SAME_LEVEL * states.scene.size
    for i in np.flatnonzero(np.diff(elevations) <= least)[:1]:
        raise ArgumentError(
            f"storeys: levels[{i + 1}] = {places[i + 1]} is not above levels[{i}] = {places[i]}; "
            "give the levels from the lowest to the highest"
        )
    moved = np.column_stack([states.displacement(place)[:, 0] for place in places])
    shear = shears_above(states, elevations[:-1], least)
    heights = np.diff(elevations)
    return Storeys(places, states.times, heights, np.diff(moved, axis=1), shear, parameter)


def shears_above(states: States, elevations: Array, tolerance: float) -> Array:
    """Compute horizontal forces on the scene below horizontal cuts, by the scene above; (n+1, m).

    A cut is just above its elevation (m): points within ``tolerance`` (m) of it are below.
    """
    numbering, scene = states.numbering, states.scene
    y = numbering.points[numbering.cells, 1]
    shear, cut_cells = np.zeros((len(states), len(elevations))), list[tuple[int, int, float, int]]()
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
            force = states.connector(connector).force
            shear[:, k] += sign * force * states.directions(connector)[:, 0]
        if not connectors and not any(cut[0] == k for cut in cut_cells):
            raise ArgumentError(
                f"storeys: nothing is cut just above the level y = {elevation:g} m; give a place "
                "at the feet of the columns of each storey"
            )
    _, cells, fractions, _ = zip(*cut_cells, strict=True) if cut_cells else ((), (), (), ())
    forces = states.forces_in_cells(cells, fractions, in_plane=True)
    for i, (k, _, _, sign) in enumerate(cut_cells):
        shear[:, k] += sign * forces[:, i, 0]
    return shear


def _cut_connectors(scene: Scene, elevation: float, tol: float) -> list[tuple[Connector, int]]:
    """Return connectors of displacements through a cut, with the sign 1 if b is above it."""

    def above(place: AttachmentPoint) -> bool:
        return place.point[1] > elevation + tol

    for body, points in attachment_points(scene).items():
        if body in scene.bodies and len({*map(above, points)}) > 1:
            raise ArgumentError(
                f"storeys: the level y = {elevation:g} m cuts the body {body.name}, whose internal "
                "forces are unknown; give a level at which only beams and connectors are cut"
            )
    return [
        (connector, 1 if above(connector.b) else -1)
        for connector in scene.all_connectors
        if not connector.is_rotation and above(connector.a) != above(connector.b)
    ]


SAME_VALUE = 1e-9
"""Relative difference below which two values are the same extreme value; its first time counts."""


def _largest(values: Array) -> Any:
    """Return the first index of the largest magnitude along the first axis, without NaN."""
    sizes = np.nan_to_num(np.abs(values), nan=-1.0)
    return np.argmax(sizes >= (1 - SAME_VALUE) * sizes.max(axis=0), axis=0)


# -- hinges ----------------------------------------------------------------------------------------


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
        dissipated: Dissipated energy at the end, of runs before ``start=``, too; J.
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
    """Table of hinges in the order of first yielding; :meth:`Solution.hinges` returns it.

    Attributes:
        rows: A :class:`HingeState` for each hinge.
        parameter: Labels of the times.

    Example:
        >>> table = broken.hinges({"IO": 0.005, "LS": 0.015, "CP": 0.03})  # rad
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


def hinges_of(
    states: States,
    limits: Mapping[str, float],
    only: Sequence[Member | Connector] | None,
    parameter: Parameter,
) -> HingeTable:
    """Collect the hinges of a solution; see :meth:`Solution.hinges`."""
    _require_limits(limits)
    scene = states.scene
    known = {*scene.beams, *scene.connectors}
    owners = known if only is None else require_all(only, "hinges: only", (Member, Connector))
    for i, owner in enumerate(owners):
        if owner not in known:
            raise ArgumentError(f"hinges: only[{i}] = {shorten(owner)} is not in the scene")
    rows, chosen = list[HingeState](), {*owners}

    def add(
        where: Place | Connector, motion: Array, plastic: Array, lost: Array,
        at_yield: float = math.nan, least: Array | float = 0.0,
    ) -> None:  # fmt: skip
        yielded = np.flatnonzero(lost > least)
        n = int(yielded[0]) if len(yielded) else -1
        rotation, plastic_rotation = (float(x[_largest(x)]) for x in (motion, plastic))
        judged = rotation if math.isnan(plastic_rotation) else plastic_rotation
        met = [name for name, limit in limits.items() if abs(judged) <= limit]
        state = "yielded" if not limits or math.isnan(judged) else f"beyond {[*limits][-1]}"
        rows.append(HingeState(
            where, n, float(states.times[n]) if n >= 0 else math.nan, rotation, plastic_rotation,
            abs(rotation) / at_yield if at_yield else math.nan, float(lost[-1]),
            "elastic" if n < 0 else met[0] if met else state,
        ))  # fmt: skip

    for hinge in scene.hinges:
        if (place := place_of(hinge)).beam in chosen:
            history = states.connector(hinge)
            add(place, history.motion, history.motion, history.dissipated)
    for connector in (x for x in scene.connectors if x in chosen and can_yield(x)):
        history = states.connector(connector)
        least: Array | float = 0.0
        if isinstance(connector.law, ConnectorLaw):
            least = OWN_LAW_YIELDS * np.maximum.accumulate(np.abs(history.work))
        (motion, moment), (stiffness, limit) = rotation_of(history), _elastic(scene, connector)
        plastic = motion - moment / stiffness
        add(connector, motion, plastic, history.dissipated, limit / stiffness, least)
    for beam in (x for x in scene.beams if x in chosen):
        _add_cells(states, beam, add)
    rows.sort(key=lambda row: row.n if row.n >= 0 else len(states))
    return HingeTable(tuple(rows), parameter)


def _add_cells(states: States, beam: Member, add: Any) -> None:
    """Add open hinges in cells of a beam, and the beam itself if it yields or cracks."""
    numbering = states.numbering
    cells = np.intersect1d(numbering.cells_of(beam), numbering.inelastic_cells)
    if not len(cells):
        return
    mesh, s = numbering.mesh, numbering.parameters(beam)
    start = np.repeat(cells - numbering.cells_of(beam)[0], mesh.degree)
    x = np.tile(mesh.points, len(cells))  # Gauss points, one cell after the other
    places = [beam.at((1 - a) * s[i] + a * s[i + 1]) for i, a in zip(start, x, strict=True)]
    rows = np.searchsorted(numbering.inelastic_cells, cells)[:, None] * mesh.degree
    rows = (rows + np.arange(mesh.degree)).ravel()
    jump, plastic, broken = (states.column("material")[:, rows, k] for k in (3, PLASTIC, HINGE))
    if beam.section.fibres is not None:  # cracks are no rotations
        plastic, broken = plastic + broken, 0 * broken
    for i in np.flatnonzero(broken.any(axis=0)):
        add(places[i], jump[:, i], jump[:, i], broken[:, i])
    if plastic.any():
        unknown, most = np.full(len(states), math.nan), int(np.argmax(plastic[-1]))
        add(places[most], unknown, unknown, plastic.sum(axis=1))


def rotation_of(history: Connection) -> tuple[Array, Array]:
    """Return rotation (rad) and moment (N m) of a connector, or of the rotation of a bushing."""
    motion, moment = (np.atleast_2d(x.T)[-1] for x in history[:2])
    return motion, moment


def _elastic(scene: Scene, connector: Connector) -> tuple[float, float]:
    """Return the elastic stiffness of a rotation (N m/rad), and its first limit (N m), or NaN."""
    law: Any = connector.law
    if isinstance(law, RigidPlastic):
        return math.inf, math.nan
    if isinstance(law, AxialBendingHinge):
        return law.turning, law.bending
    if isinstance(law, IbarraKrawinkler | PinchingHinge):
        backbones = law.backbone, law.negative or law.backbone
        return law.stiffness, min(x.yield_limit for x in backbones)
    if not isinstance(law, Spring):
        return math.nan, math.nan
    limit = getattr(law.law, "yield_limit", math.nan)
    if hasattr(limit, "draw"):
        limit = limit.draw(1, scene.stream_keys[connector])[0]
    softens = math.nan if law.softening is None else float(law.softening.limit)
    return law.stiffness, (
        float(np.fmin(limit, softens)) if isinstance(limit, float | int) else softens
    )


def _require_limits(limits: Any) -> None:
    """Raise :class:`ArgumentError` unless limits are positive and increase."""
    require_kind(limits, Mapping, "hinges: limits")
    last = 0.0
    for name, limit in limits.items():
        require_text(name, "hinges: limits: a name")
        require_number(limit, f"hinges: limits[{name!r}]", positive=True)
        if limit <= last:
            raise ArgumentError(
                f"hinges: limits[{name!r}] = {limit:g} rad is not above the limit before it, "
                f"{last:g} rad; give the limits in increasing order"
            )
        last = limit
