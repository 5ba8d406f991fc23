# SPDX-License-Identifier: MIT
"""Rigid-plastic connectors whose law is compiled and followed in C, see rigid_plastic.c."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, in_order, lib, struct
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.mechanics.slips import slip
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.connector_laws import RigidPlastic
from ufl_beam.model.material_laws import Hardening, SofteningLaw
from ufl_beam.terms.connector_responses import Rows
from ufl_beam.terms.phases import TimeFunctions
from ufl_beam.terms.rigid_plastic import INPUTS, RigidPlasticResponse


class SlipForms:
    """Compiled laws of slip: force and its derivative by the slip; ``slip_output`` of loops.h."""

    def __init__(self, law: SofteningLaw | Hardening, scheme: Scheme) -> None:
        self._pointwise = pointwise = Pointwise(INPUTS)
        at = {**pointwise.at, "slip": ufl.variable(pointwise.at["slip"])}
        end = slip(law, at, scheme)._asdict()
        force = end.pop("force")
        self.force = pointwise.compile(force, ufl.diff(force, at["slip"]))
        self.end = pointwise.compile(*in_order("slip_output", end, "slip_"))


_slip_forms = stated(SlipForms)


class CompiledSlips(RigidPlasticResponse):
    """Rigid-plastic connectors that C evaluates."""

    def _prepare(self, law: RigidPlastic) -> None:
        super()._prepare(law)
        kind = Hardening(1.0) if isinstance(law.law, Hardening) else law.law.of(1.0, 1.0)
        self._forms, self._sums = _slip_forms(kind, self._setting.scheme), np.zeros(3)
        self._c = struct(
            "rigid_plastic", number=len(self._rows), width=len(INPUTS), w=self._storage,
            force=self._forms.force, end=self._forms.end, search=self._setting.search.flags,
            limit=self._limit, back_force=self._back_force, dissipated=self._dissipated,
            slope=self._slope, excess=self._excess, slipped=self._slipped, way=self._way,
            rows=self._rows,
        )  # fmt: skip
        self.in_c = {"rigid_plastic": self._c}

    def in_steps(self, times: TimeFunctions) -> dict[str, Any] | None:
        """The laws, and what they enter."""
        ledger = self._ledger
        entries = {"hinges": ledger.lost.pointer("hinges")}
        if self._hardens:
            entries["hardening"] = ledger.state.pointer("hardening")
        if self._loss:
            entries["numerical"] = ledger.lost.pointer("numerical")
        of_law = {"dt_of_law": INPUTS.index("dt"), "way_before": self._way_before}
        return {**of_law, "loss": self._loss, **entries}

    def rows(self, e1: Array, λ: Array) -> Rows:
        """Rows of the latest iterate, which C has set."""
        return self._rows[:, 0], self._rows[:, 1], self._rows[:, 2]

    def _commit(self, e1: Array) -> tuple[float, float, float]:
        lib.commit_rigid_plastic(self._c, doubles(e1), doubles(self._sums))
        dissipated, lost, stored = self._sums.tolist()
        return dissipated, lost, stored

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated in a step to the motions ``e1``, positive where one would slip; J."""
        arrays = doubles(e1), doubles(np.ascontiguousarray(λ))
        return float(lib.dissipation_of_rigid_plastic(self._c, *arrays))
