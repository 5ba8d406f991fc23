# SPDX-License-Identifier: MIT
"""Places of the plastic hinges of zero length in a scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Anchor, Node, NodeDof, Place, merged, node
from ufl_beam.model.connector_laws import HingeLaw, RigidPlastic
from ufl_beam.model.connectors import Connector


def plastic_hinges(
    may_have: Mapping[Place, HingeLaw],  # laws of the hinges that the beams may have
    rigid: Iterable[Sequence[NodeDof]],  # groups of rotations that joints make equal
    bearing: Iterable[Anchor],  # where supports, connectors or masses bear a moment
    loaded: Iterable[Anchor],  # where loads are moments
) -> tuple[Connector, ...]:
    """Plastic hinges of zero length, as connectors of both sides.

    A beam has those of its ``hinges``, and one at each end if its section has a hinge.  There is
    none at an end that bears no moment, nor at one where nothing but a load is: the load acts on
    the member, as nothing beyond a hinge could bear it.  Where two members meet and nothing else
    bears a moment, both have the same moment; then only the weaker one has a hinge, as the other
    one never opens.
    """
    laws = {place: law for place, law in may_have.items() if law.opens}
    if not laws:
        return ()
    same = merged(rigid)
    members: dict[NodeDof, list[Node]] = {}
    for dof in {*same, *same.values()}:
        members.setdefault(same[dof], []).append(dof[0])

    borne, acted = ({same[node(place), 2] for place in places} for places in (bearing, loaded))

    def stays(place: Place) -> bool:
        if 0.0 < place.s < 1.0:
            return True
        dof = same[place, 2]
        others = [other for other in members.get(dof, ()) if other != place]
        between = len(others) > 0 and (dof in acted or not _outlasts(place, others, laws))
        return dof in borne or between

    return tuple(_hinge(place, law) for place, law in laws.items() if stays(place))


def law_of(link: Connector) -> HingeLaw:
    """Return the law of a plastic hinge, or of another rigid-plastic connector."""
    if not isinstance(link.law, RigidPlastic):
        raise SceneError(f"{link}: its law is not rigid-plastic")
    return link.law.law


def place_of(hinge: Connector) -> Place:
    """Return the place of a plastic hinge, on the side that joints and loads are attached to."""
    if not isinstance(hinge.a, Place):
        raise SceneError(f"{hinge}: it is not a plastic hinge of a beam")
    return hinge.a.beam.at(hinge.a.s)


def _outlasts(place: Place, others: Sequence[Node], laws: Mapping[Place, HingeLaw]) -> bool:
    """Return whether the only other member at a joint yields first, or is listed first."""
    if len(others) > 1 or not isinstance(others[0], Place) or others[0] not in laws:
        return False
    here, there, order = laws[place], laws[others[0]], list(laws)
    if here.limit == there.limit and here.bounded and there.bounded:
        return order.index(others[0]) < order.index(place)
    return there.bounded and there.limit <= here.limit


def _hinge(place: Place, law: HingeLaw) -> Connector:
    """The connector of a hinge; its motion is the jump of the rotation along the beam."""
    beyond = Place(place.beam, place.s, beyond=True)
    before, after = (beyond, place) if place.s == 1.0 else (place, beyond)
    return Connector("Hinge", "turning", before, after, RigidPlastic(law))
