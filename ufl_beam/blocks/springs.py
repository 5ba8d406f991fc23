# SPDX-License-Identifier: MIT
"""Springs, which may yield and break: material points whose strain is the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.block import BlockSetting
from ufl_beam.blocks.connectors import ConnectorBlock, Data, OnConnector, Step
from ufl_beam.blocks.material_points import Points, create_entries
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import fill
from ufl_beam.discretization.state_io import Archive
from ufl_beam.model.connector_laws import Spring
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.terms.derivatives import Neighbours
from ufl_beam.terms.term import Callbacks, Phases


@dataclass(frozen=True)
class OfSpring(OnConnector):
    """Force of a material point, linearized about the iterate; the line is a mode.

    The "shift" is zero; derivatives of the force at constant motions are derivatives by it.
    """

    of_step = ("dt",)
    modes = "slope", "force"
    data = Data(["shift"])

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class; the material points have the energies."""
        (e1,), (λ,) = step.e1, step.λ
        force = at.stage(at["force"], at["slope"] * e1 + at["shift"])
        return Equations([λ - force], strains=[e1])


class SpringBlock(ConnectorBlock):
    """Springs of one law.

    Attributes:
        points: Material points, one of each spring.
    """

    def __init__(
        self, statement: OfSpring, setting: BlockSetting, all_connectors: Index, law: Spring
    ) -> None:
        super().__init__(statement, setting, all_connectors)
        number, softening = len(self.connectors), law.softening
        section_points = SectionPoints(
            strains=np.array([[1.0, 0.0, 0.0]]), weights=np.ones(1),
            stiffness=np.array([law.stiffness]), laws=((law.bulk, 1),), rest=np.zeros(3),
            softening=softening if softening is not None and softening.opens else None,
            breaking=slice(0, None),
        )  # fmt: skip
        keys = [setting.scene.stream_keys[connector] for connector in self.connectors]
        self.points = Points(section_points, keys, np.ones(number), setting.scheme, setting.search)
        create_entries(section_points, setting.scheme, setting.ledger)
        self._strains = np.zeros((number, 3))
        self.must_dissipate = self.points.must_dissipate
        fill(self._c, stiffness=np.full(number, law.stiffness))
        self.fields += [("dissipated", x) for x in self.points.recorded.T[4:6]]

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class."""
        return self.points.phases(self._c, super().phases(callbacks), self._ledger)

    def _at(self, e: Array) -> Array:
        self._strains[:, 0] = e
        return self._strains

    def start(self, q: Array) -> None:
        """See the base class."""
        e = self._at(self.motion_at_begin(q))
        self.points.start(e)
        self.points.refresh(e)
        super().start(q)

    def put_forces(self, q: Array) -> None:
        """See the base class."""
        q[self.forces_at] = self.points.recorded[:, 0]
        self.commit(q)

    def dissipation(self, q1: Array) -> float:
        """See the base class."""
        self.points.return_map(self._at(self.motion(q1)))
        return self.points.dissipation()

    def require_dissipation(self, q1: Array) -> None:
        """See the base class."""
        self.points.return_map(self._at(self.motion(q1)))
        self.points.require_dissipation(self.describe)

    def remaining(self) -> Array:
        """See the base class."""
        now, elastic = self.points.works(np.eye(1, 3).repeat(len(self._strains), axis=0))
        left = np.divide(now, elastic, out=np.ones(len(now)), where=elastic > 0)
        return np.asarray(left)

    def freeze(self) -> None:
        """See the base class."""
        self.points.freeze()

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """See the base class."""
        super().save_or_restore(archive, q)
        self.points.restore(archive.rows("springs", self.indices, self.points.state()))

    def complete_derivatives(self, c: Any, neighbours: Neighbours, by_number: Array) -> None:
        """See the base class: C differentiates the points together with the springs."""
        fill(c, inner=self.points.derivatives(neighbours))
