# SPDX-License-Identifier: MIT
"""Bodies, links and springs of a scene as straight lines."""

from __future__ import annotations

from typing import NamedTuple

from ufl_beam.model.bodies import GROUND, Anchor, Body, Spot
from ufl_beam.model.connectors import Connector
from ufl_beam.model.loads import FollowerLoad, PointLoad
from ufl_beam.model.scene import Scene

BODY, LINK = 1, 2  # parts of a scene in files; beams are 0


class Rod(NamedTuple):
    """Straight line between two anchors, of a body or a connector."""

    a: Anchor
    b: Anchor
    part: int  # BODY or LINK
    along: Connector | None = None  # whose force acts along it


def spots_of(scene: Scene) -> dict[Body, list[Spot]]:
    """Find the points of bodies and of the ground that something is attached to, each once."""
    anchors = [place for joint in scene.joints for place in joint.places]
    anchors += [place for connector in scene.connectors for place in (connector.a, connector.b)]
    anchors += [x.place for x in scene.loads if isinstance(x, PointLoad | FollowerLoad)]
    found: dict[Body, dict[Spot, None]] = {body: {} for body in (*scene.bodies, GROUND)}
    for anchor in anchors:
        if isinstance(anchor, Spot):
            found[anchor.body][anchor] = None
    return {body: list(spots) for body, spots in found.items()}


def rods_of(scene: Scene) -> list[Rod]:
    """List the lines from the centre of each body to its points, and along links and springs."""
    spots, rods = spots_of(scene), []
    for body in scene.bodies:
        x, y = body.center
        # If something is attached to its centre alone, it is shown too, and turns.
        beside = body.at(x + 0.02 * scene.size, y)
        others = [s for s in spots[body] if s.point != body.center] or [beside]
        rods += [Rod(body.middle, spot, BODY) for spot in others]
    for joint in scene.joints:
        if joint.look in ("RigidLink", "Link"):
            a, b = joint.places
            pulls = next((c for c in joint.holders if c.stretches), None)
            rods.append(Rod(a, b, LINK, pulls))
    rods += [
        Rod(c.a, c.b, LINK, c if c.stretches else None)
        for c in scene.connectors
        if not c.turns and c.apart != (0.0, 0.0)
    ]
    return rods
