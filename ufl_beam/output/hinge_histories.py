# SPDX-License-Identifier: MIT
"""Histories of the hinges of a run: rotations, plastic rotations, dissipated energies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, require_kind, require_number, require_text
from ufl_beam.model.bodies import Member, Place
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import RigidPlastic, Spring
from ufl_beam.model.connectors import Connector, can_yield, place_of
from ufl_beam.model.scene import Scene
from ufl_beam.output.state_rows import HINGE, JUMP, OWN_LAW_YIELDS, PLASTIC, Connection
from ufl_beam.output.states import States

SAME_VALUE = 1e-9
"""Relative difference below which two values are the same extreme value; its first time counts."""


def index_of_largest(values: Array) -> Any:
    """Return the first index of the largest magnitude along the first axis, without NaN."""
    sizes = np.nan_to_num(np.abs(values), nan=-1.0)
    return np.argmax(sizes >= (1 - SAME_VALUE) * sizes.max(axis=0), axis=0)


class HingeHistory(NamedTuple):
    """Rotations of a hinge, and the energy that it has dissipated.

    Attributes:
        where: Place of a hinge, middle of a cell with an open hinge, or rotational connector.  For
            a beam with yielding or cracking cells, the middle of the cell that dissipates most.
        rotations: Rotations; (n+1,); rad; NaN if they are unknown.
        plastic: Plastic rotations; (n+1,); rad; NaN if they are unknown.
        dissipated: Dissipated energies, of runs before ``start=``, too; (n+1,); J.
        yield_rotation: Rotation at the first limit; rad; NaN if it is unknown.
        negligible: Dissipated energy up to which the hinge has not yielded; J.
    """

    where: Place | Connector
    rotations: Array
    plastic: Array
    dissipated: Array
    yield_rotation: float = math.nan
    negligible: Array | float = 0.0

    @property
    def first_yield(self) -> int:
        """Index of the first state after the first yielding; -1 if the hinge did not yield."""
        yielded = self.dissipated > self.negligible
        return int(np.argmax(yielded)) if yielded.any() else -1

    @property
    def largest_rotation(self) -> float:
        """Rotation of largest magnitude; rad."""
        return float(self.rotations[index_of_largest(self.rotations)])

    @property
    def largest_plastic(self) -> float:
        """Plastic rotation of largest magnitude; rad."""
        return float(self.plastic[index_of_largest(self.plastic)])

    def state(self, limits: Mapping[str, float]) -> str:
        """Return the acceptance limit that the hinge satisfies, "elastic", or "beyond ..."."""
        judged = self.largest_plastic
        judged = self.largest_rotation if math.isnan(judged) else judged
        if self.first_yield < 0:
            return "elastic"
        if not limits or math.isnan(judged):
            return "yielded"
        met = [name for name, limit in limits.items() if abs(judged) <= limit]
        return met[0] if met else f"beyond {[*limits][-1]}"


def hinge_histories(states: States, owners: Iterable[Any] | None = None) -> list[HingeHistory]:
    """Return the hinges of beams and connectors in the order of first yielding; all by default.

    They are all hinges of zero length, open hinges of cells, connectors whose rotation may yield or
    soften, and beams with yielding or cracking cells, of which only the energy is known.
    """
    scene, found = states.scene, list[HingeHistory]()
    chosen = set[Any]((*scene.beams, *scene.connectors) if owners is None else owners)
    for hinge in scene.hinges:
        if (place := place_of(hinge)).beam in chosen:
            history = states.connector(hinge)
            found.append(HingeHistory(place, history.motion, history.motion, history.dissipated))
    for connector in (x for x in scene.connectors if x in chosen and can_yield(x)):
        history = states.connector(connector)
        negligible: Array | float = 0.0
        if isinstance(connector.law, ConnectorLaw):
            negligible = OWN_LAW_YIELDS * np.maximum.accumulate(np.abs(history.work))
        (motion, moment), (stiffness, limit) = rotation_of(history), _elastic(scene, connector)
        plastic = motion - moment / stiffness
        found.append(HingeHistory(
            connector, motion, plastic, history.dissipated, limit / stiffness, negligible
        ))  # fmt: skip
    for beam in (x for x in scene.beams if x in chosen):
        found += _of_cells(states, beam)
    never = len(states)
    return sorted(found, key=lambda x: x.first_yield if x.first_yield >= 0 else never)


def _of_cells(states: States, beam: Member) -> Iterator[HingeHistory]:
    """Yield open hinges in cells of a beam, and the beam itself if it yields or cracks."""
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
    jump, plastic, broken = (states.column("material")[:, rows, k] for k in (JUMP, PLASTIC, HINGE))
    if beam.section.fibres is not None:  # cracks are no rotations
        plastic, broken = plastic + broken, 0 * broken
    for i in np.flatnonzero(broken.any(axis=0)):
        yield HingeHistory(places[i], jump[:, i], jump[:, i], broken[:, i])
    if plastic.any():
        unknown, most = np.full(len(states), math.nan), int(np.argmax(plastic[-1]))
        yield HingeHistory(places[most], unknown, unknown, plastic.sum(axis=1))


def rotation_of(history: Connection) -> tuple[Array, Array]:
    """Return rotation (rad) and moment (N m) of a connector, or of the rotation of a bushing."""
    motion, moment = (np.atleast_2d(x.T)[-1] for x in history[:2])
    return motion, moment


def _elastic(scene: Scene, connector: Connector) -> tuple[float, float]:
    """Return the elastic stiffness of a rotation (N m/rad), and its first limit (N m), or NaN."""
    law: Any = connector.law
    if isinstance(law, RigidPlastic):
        return math.inf, math.nan
    if isinstance(law, ConnectorLaw):
        return law.elastic_rotation
    if not isinstance(law, Spring):
        return math.nan, math.nan
    limit = getattr(law.law, "yield_limit", math.nan)
    if hasattr(limit, "draw"):
        limit = limit.draw(1, scene.stream_keys[connector])[0]
    softens = math.nan if law.softening is None else float(law.softening.limit)
    return law.stiffness, (
        float(np.fmin(limit, softens)) if isinstance(limit, float | int) else softens
    )


def require_limits(limits: Any, what: str) -> None:
    """Raise :class:`ArgumentError` unless limits are positive and increase."""
    require_kind(limits, Mapping, what)
    last = 0.0
    for name, limit in limits.items():
        require_text(name, f"{what}: a name")
        require_number(limit, f"{what}[{name!r}]", positive=True)
        if limit <= last:
            raise ArgumentError(
                f"{what}[{name!r}] = {limit:g} rad is not above the limit before it, "
                f"{last:g} rad; give the limits in increasing order"
            )
        last = limit
