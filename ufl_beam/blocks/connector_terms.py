# SPDX-License-Identifier: MIT
"""Terms of all connectors of a scene: the statement of each law."""

from __future__ import annotations

from typing import Any

import numpy as np

from ufl_beam.blocks.block import BlockSetting
from ufl_beam.blocks.connectors import ConnectorBlock, OnConnector
from ufl_beam.blocks.dampers_and_motors import Damped, Driven, Held, Pushed
from ufl_beam.blocks.force_laws import FunctionBlock, OfFunctions
from ufl_beam.blocks.friction import Rubbing
from ufl_beam.blocks.guides import GuideBlock, OnCurve
from ufl_beam.blocks.laws_of_energy import LawBlock, OfEnergy
from ufl_beam.blocks.rigid_plastic import HingeBlock, Hinged, prototype_of
from ufl_beam.blocks.springs import OfSpring, SpringBlock
from ufl_beam.mechanics.guide_curves import structure_of
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import (
    RIGID,
    Controller,
    Coulomb,
    Damper,
    ForceLaw,
    Guide,
    PrescribedForce,
    PrescribedMotion,
    RigidPlastic,
    Spring,
)
from ufl_beam.model.connectors import Connector


def statement_of(law: Any, motions: tuple[str, ...], scheme: Scheme) -> OnConnector:
    """Return the statement of a law."""
    if law is RIGID:
        return Held(motions, scheme)
    alike = None
    if isinstance(law, ConnectorLaw):
        alike = law.with_parameters(dict.fromkeys(law.parameters(), 1.0))
        if not law.holds:
            return OfEnergy(motions, scheme, alike, law.elastic)
    if isinstance(law, Coulomb | ConnectorLaw):
        return Rubbing(motions, scheme, alike)
    if isinstance(law, RigidPlastic):
        return Hinged(motions, scheme, prototype_of(law.law))
    if isinstance(law, PrescribedForce):
        return Pushed(motions, scheme, "loads")
    if isinstance(law, Controller):
        return Pushed(motions, scheme, "controllers")
    if isinstance(law, ForceLaw):
        return OfFunctions(motions, scheme, len(law.state))
    if isinstance(law, Guide):
        return OnCurve(motions, scheme, *structure_of(law.curve))
    kinds: dict[type, type[OnConnector]] = {PrescribedMotion: Driven, Damper: Damped}
    return kinds[type(law)](motions, scheme)


def _motions_with(connector: Connector) -> tuple[str, ...]:
    """Return the names of motions in the law of a connector: one, or all motions of a bushing."""
    if isinstance(connector.law, ConnectorLaw) and connector.law.components > 1:
        return ("sliding", "sliding", "turning")[: connector.law.components]
    return (connector.motion,)


def _kind(law: Any) -> object:
    """Return the key of a law; connectors with the same key are computed together."""
    if isinstance(law, Spring):
        return law
    if isinstance(law, ForceLaw):
        return ForceLaw, len(law.state)
    if isinstance(law, ConnectorLaw):
        return type(law), law.elastic
    if isinstance(law, Guide):
        return Guide, structure_of(law.curve)
    return type(law), law is RIGID, isinstance(law, RigidPlastic) and type(law.law)


def connector_terms(setting: BlockSetting) -> list[Any]:
    """Create the terms of the connectors of a process, one for each kind.

    Every process creates all entries of the ledger, in the order of the scene, and keeps the terms
    of which it has connectors.
    """
    scheme, connectors, made = setting.scheme, setting.scene.all_connectors, list[Any]()
    kind_of_space = " in space" * setting.scene.in_space
    keys = [
        (tuple(motion + kind_of_space for motion in _motions_with(c)), _kind(c.law))
        for c in connectors
    ]
    for key, connector in dict(zip(keys, connectors, strict=True)).items():
        law, of_kind = connector.law, np.array([i for i, x in enumerate(keys) if x == key])
        if isinstance(law, Spring):
            springs = OfSpring(key[0], scheme)
            made.append(SpringBlock(springs, setting, of_kind, law))
            continue
        statement = statement_of(law, key[0], scheme)
        kinds: dict[type, type[ConnectorBlock]] = {
            OfEnergy: LawBlock, Hinged: HingeBlock, OfFunctions: FunctionBlock, OnCurve: GuideBlock,
        }  # fmt: skip
        kind = kinds.get(type(statement), ConnectorBlock)
        made.append(kind(statement, setting, of_kind))
    return [term for term in made if len(term.indices)]
