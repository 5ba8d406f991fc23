# SPDX-License-Identifier: MIT
"""Springs that may yield and break."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.model.connector_laws import Spring
from ufl_beam.model.fibres import Layout
from ufl_beam.model.material_laws import Hardening
from ufl_beam.terms.connector_responses import Response, respond
from ufl_beam.terms.material_points import Points, expect_entries
from ufl_beam.terms.phases import Callbacks


@respond.register(Spring)
class _Sprung(Response):
    """Springs of one law: material points whose strain is the motion."""

    def _prepare(self, law: Spring) -> None:
        softening = law.softening
        layout = Layout(
            strains=np.array([[1.0, 0.0, 0.0]]),
            weights=np.ones(1),
            stiffness=np.array([law.stiffness]),
            laws=((law.law or Hardening(limit=np.inf), 1),),
            rest=np.zeros(3),
            softening=softening if softening is not None and softening.opens else None,
            breaking=slice(0, None),
        )
        setting, number = self._setting, len(self._links)
        keys = [(0, i) for i in range(number)]
        self.points = Points(layout, keys, np.ones(number), setting.scheme, setting.search)
        expect_entries(layout, setting.scheme, setting.ledger)
        self._strains = np.zeros((number, 3))
        self.must_dissipate = layout.kind.law.must_dissipate
        self.in_c = {"points": self.points.c}
        self.opens = self.points.softens

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        return self.points.in_steps(self._setting.ledger)

    def _at(self, e: Array) -> Array:
        self._strains[:, 0] = e
        return self._strains

    def dissipation(self, e1: Array, λ: Array) -> float:
        self.points.respond(self._at(e1))
        return self.points.dissipation()

    def require_dissipation(self, e1: Array) -> None:
        self.points.respond(self._at(e1))
        self.points.require_dissipation(lambda number: str(self._links[number]))

    def dissipated(self) -> Sequence[Array]:
        return self.points.kept[:, 4], self.points.kept[:, 5]

    def remaining(self) -> Array:
        return self.points.remaining(np.eye(1, 3).repeat(len(self._strains), axis=0))

    def state(self) -> Array:
        return self.points.state()

    def restore(self, rows: Array) -> None:
        self.points.restore(rows)

    def start(self, e: Array) -> None:
        self.points.start(self._at(e))
        self.points.refresh(self._at(e))

    def borne(self) -> Array | None:
        return self.points.kept[:, 0]

    def freeze(self) -> None:
        self.points.freeze()
