# SPDX-License-Identifier: MIT
"""Lines that show what is no beam: bodies, and links that join places which are apart."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.loads import FollowerLoad, PointLoad
from ufl_beam.model.scene import Scene

BEAM, BODY, LINK = 0, 1, 2
"""Numbers of the parts of a scene in files."""


class Rod(NamedTuple):
    """A straight line between two anchors.

    Attributes:
        a, b: Its ends.
        part: ``BODY`` or ``LINK``.
        along: The connector whose force acts along it, if there is one.
    """

    a: Anchor
    b: Anchor
    part: int
    along: Connector | None = None


def spots_of(scene: Scene) -> dict[Body, list[Spot]]:
    """Points of each body, and of the ground, that something is attached to, each once."""
    found: dict[Body, dict[Spot, None]] = {body: {} for body in (*scene.bodies, GROUND)}
    for anchor in _anchors(scene):
        if isinstance(anchor, Spot):
            found[anchor.body][anchor] = None
    return {body: list(spots) for body, spots in found.items()}


def rods_of(scene: Scene) -> list[Rod]:
    """Lines from the centre of each body to its points, and along links and springs."""
    spots, rods = spots_of(scene), []
    for body in scene.bodies:
        # What is attached to its centre alone is shown too, and turns.
        others = [s for s in spots[body] if s.point != body.center] or [_beside(body, scene)]
        rods += [Rod(body.middle, spot, BODY) for spot in others]
    for joint in scene.joints:
        if joint.look in ("RigidLink", "Link"):
            a, b = joint.places
            rods.append(Rod(a, b, LINK, _pulls(joint.holders)))
    rods += [
        Rod(c.a, c.b, LINK, _pulls((c,)))
        for c in scene.connectors
        if not c.turns and c.apart != (0.0, 0.0)
    ]
    return rods


def _pulls(connectors: tuple[Connector, ...]) -> Connector | None:
    return next((c for c in connectors if c.stretches), None)


def _beside(body: Body, scene: Scene) -> Spot:
    x, y = body.center
    return body.at(x + 0.02 * scene.size, y)


def _anchors(scene: Scene) -> Iterator[Anchor]:
    things: tuple[Joint | Connector, ...] = (*scene.joints, *scene.connectors)
    for thing in things:
        yield from thing.places if isinstance(thing, Joint) else (thing.a, thing.b)
    for load in scene.loads:
        if isinstance(load, PointLoad | FollowerLoad):
            yield load.place
