# SPDX-License-Identifier: MIT
"""Laws of joints, motors, actuators, controllers and dampers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ufl_beam.blocks.block import BlockSetting, InTime
from ufl_beam.blocks.connectors import Data, OnConnector, Step
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.model.connector_laws import Controller


@dataclass(frozen=True)
class Held(OnConnector):
    """Motion of zero, as in joints; forces of joints do no work."""

    of_step = ("dt",)

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        return Equations(step.e1)


@dataclass(frozen=True)
class Driven(OnConnector):
    """Motion as a function of time, which substeps reach in proportion to the loads."""

    of_step = "dt", "fraction", "wanted"

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class."""
        return (), InTime(connector.law.motion, connector, "whole_motion")

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        (e0,), (e1,), (work,) = step.e0, step.e1, step.work
        missed = e1 - e0 - at["fraction"] * (at["wanted"] - e0)
        return Equations([missed], supplied={"motors": -work})


@dataclass(frozen=True)
class Pushed(OnConnector):
    """Force of an actuator or controller; a positive one makes the motion grow.

    Attributes:
        entry: Entry of the ledger of its work.
    """

    entry: str
    of_step = "dt", "wanted"

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class; C takes the force of a controller from an array."""
        controlled = isinstance(connector.law, Controller)
        known = setting.requested_forces(connector) if controlled else connector.law.force
        return (), InTime(known, connector)

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        return Equations([step.λ[0] + at["wanted"]], supplied={self.entry: -step.work[0]})


@dataclass(frozen=True)
class Damped(OnConnector):
    """Force in proportion to the mean rate of the motion in a step."""

    of_step = ("dt",)
    data = Data(["viscosity"])  # N s/m or N m s/rad

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class."""
        return [connector.law.viscosity], None

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        rate = (step.e1[0] - step.e0[0]) / at["dt"]
        return Equations([step.λ[0] - at["viscosity"] * rate], lost={"damping": step.work[0]})
