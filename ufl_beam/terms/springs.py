# SPDX-License-Identifier: MIT
"""Springs that may yield and break."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.connector_laws import Spring
from ufl_beam.model.connectors import Connector
from ufl_beam.model.fibres import Layout
from ufl_beam.model.material_laws import Hardening
from ufl_beam.terms.connector_responses import Response, Rows, Setting, respond
from ufl_beam.terms.material_points import Points, expect_entries, inputs
from ufl_beam.terms.openings import Openable


@respond.register(Spring)
class _Sprung(Response):
    """Springs of one law: material points whose strain is the motion."""

    def __init__(self, law: Spring, links: Sequence[Connector], setting: Setting) -> None:
        super().__init__(links)
        layout = Layout(
            strains=np.array([[1.0, 0.0, 0.0]]),
            weights=np.ones(1),
            stiffness=np.array([law.stiffness]),
            laws=((law.law or Hardening(limit=np.inf), 1),),
            rest=np.zeros(3),
            softening=law.softening,
            breaking=slice(0, None),
        )
        number = len(links)
        keys = [(0, i) for i in range(number)]
        storage = np.zeros((number, 1, len(inputs(layout.statement))))
        self.points = Points(layout, keys, np.ones(number), setting.scheme, storage, setting.search)
        self._ledger = setting.ledger
        expect_entries(layout, setting.scheme, setting.ledger)
        self._strains = np.zeros((number, 3))
        self.in_c = {"points": self.points.points}

    @property
    def openable(self) -> Openable | None:
        """The points, if they can break."""
        return self.points if self.points.softens else None

    def _at(self, e: Array) -> Array:
        self._strains[:, 0] = e
        return self._strains

    def begin(self, e0: Array, step: Step) -> None:
        """Begin a step."""
        self.points.begin(step.dt)

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The force around the iterate."""
        r, D = self.points.respond(self._at(e1))
        return -D[:, 0], 1.0, r[:, 0] - D[:, 0] * e1

    def about_force(self, rows: Array) -> Array:
        """Factors of one."""
        return np.ones(len(self._strains))

    def accept(self, e1: Array, work: float) -> None:
        """Commit the internal variables."""
        self.points.respond(self._at(e1))
        self.points.accept()
        self.points.enter_losses(self._ledger)

    def add_state(self, e: Array) -> None:
        """Stored energy."""
        self.points.enter_stored(self._ledger)

    def change(self, e1: Array, work: float) -> float:
        """Energy stored and dissipated in the step; J."""
        self.points.respond(self._at(e1))
        return self.points.change()

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated in the step; J."""
        self.points.respond(self._at(e1))
        return self.points.dissipation()

    @property
    def dissipated(self) -> Array:
        """Energy that each spring has dissipated; (num_links,); J."""
        return np.asarray(self.points.kept[:, 4:].sum(axis=1))

    def remaining(self) -> Array:
        """Part of the elastic stiffness that is left in the latest iterate; (num_links,)."""
        return self.points.remaining(np.eye(1, 3).repeat(len(self._strains), axis=0))

    def state(self) -> Array:
        """Internal variables."""
        return self.points.state()

    def restore(self, rows: Array) -> None:
        """Take over :meth:`state`."""
        self.points.restore(np.arange(len(rows)), rows)

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""
        self.points.start(self._at(e))
        self.points.refresh(self._at(e))

    def freeze(self) -> None:
        """Keep everything elastic from now on: nothing yields or breaks further."""
        self.points.freeze()
