# SPDX-License-Identifier: MIT
"""Response of rigid-plastic connectors, such as plastic hinges of zero length.

A connector is held exactly until its force reaches the limit of its law.  Then the force is that of
the law, a function of the slip that grows in the step; see rigid_plastic.c.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, in_order, lib, names, struct
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.mechanics.slips import numbers, slip
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.bodies import Place
from ufl_beam.model.connector_laws import RigidPlastic
from ufl_beam.model.connectors import Connector
from ufl_beam.model.material_law import traced
from ufl_beam.model.material_laws import Hardening
from ufl_beam.model.plastic_hinges import law_of
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.terms.connector_responses import Response, respond
from ufl_beam.terms.openings import NOTHING, SPENT
from ufl_beam.terms.phases import Callbacks

INPUTS = (*names("slip_input", "slip_"), "θ", "dt")
"""First inputs of the compiled laws: the slip of the step and its direction (1 or -1); accumulated
slip and motion at t_n, which loops.h names as well; numbers of the scheme.  Then come those of the
law."""


class SlipForms:
    """Compiled laws of slip: force and its derivative by the slip; ``slip_output`` of loops.h."""

    def __init__(self, law: SofteningLaw | Hardening, scheme: Scheme) -> None:
        self._pointwise = pointwise = Pointwise((*INPUTS, *numbers(law)))
        at = {**pointwise.at, "slip": ufl.variable(pointwise.at["slip"])}
        with traced(law):
            end = slip(law, at, scheme)._asdict()
            force = end.pop("force")
            slope = ufl.diff(force, at["slip"])
        self._response = force, slope
        self.force = pointwise.compile(*self._response)
        self.end = pointwise.compile(*in_order("slip_output", end, "slip_"))

    @cached_property
    def spent(self) -> Any:
        """Force and its derivative next to nothing."""
        return self._pointwise.compile(*(NOTHING * x for x in self._response))


_slip_forms = stated(SlipForms)


EARLY = 0.01
"""Motion, in rad or as a part of the scene, that counts as much as the limit in deciding whether a
connector slips in an iterate; solutions do not depend on it."""


WEAK = 1e-9
"""Factor of motions at least, as a part of EI of the member over the size of the scene."""


def _slope(link: Connector, size: float) -> float:
    """Factor of motions beside forces in the equation of a connector, see rigid_plastic.c.

    It is above the steepest softening, so that an open branch is found open; and so large that
    motions, not the round-off of forces, say in which direction a weak hinge slips.
    """
    law = law_of(link)
    if not 0.0 < law.limit < np.inf:
        return 1.0
    steepest, _ = law.steepest
    early = law.limit / (EARLY * (1.0 if link.turns else size))
    least = WEAK * link.a.beam.section.EI / size if isinstance(link.a, Place) else 0.0
    return float(max(early, least)) + (2 * steepest if steepest < np.inf else 0.0)


@respond.register(RigidPlastic)
class RigidPlasticResponse(Response):
    """Rigid-plastic connectors whose laws are of one kind, followed in C.

    Attributes:
        over: ``|force| / limit - 1`` of each connector that was held, or zero; (num_links,).
    """

    name_in_files = "CompiledSlips"

    def _prepare(self, law: RigidPlastic) -> None:
        n, ledger, scheme = len(self._links), self._setting.ledger, self._setting.scheme
        self._ledger = ledger
        ledger.lost["hinges"] += 0.0
        self._hardens = isinstance(law.law, Hardening)
        self._loss = 2 * scheme.alpha if self._hardens else 0.0
        if self._hardens:
            ledger.state["hardening"] += 0.0
        if self._loss:
            ledger.lost["numerical"] += 0.0
        inputs = (*INPUTS, *numbers(law.law))
        self._storage = np.zeros((n, len(inputs)))
        self._at = {name: self._storage[:, i] for i, name in enumerate(inputs)}
        for i, link in enumerate(self._links):
            for name, value in numbers(law_of(link)).items():
                self._at[name][i] = value
        self._at["θ"][:], self._at["dt"][:] = scheme.theta, 1.0
        self._limit = self._at["number limit"].copy()
        self._back_force, self._dissipated, self.over = np.zeros((3, n))
        self._slipped, self._way, self._way_before = np.zeros((3, n), dtype=np.int32)
        self._rows, self._stored = np.zeros((n, 3)), np.zeros(1)
        self._slope = np.array([_slope(link, self._setting.size) for link in self._links])
        self.opens = True

        kind = Hardening(1.0) if isinstance(law.law, Hardening) else law.law.kind()
        self._forms, self._sums = _slip_forms(kind, scheme), np.zeros(3)
        self._c = struct(
            "rigid_plastic", number=n, width=len(inputs), w=self._storage,
            force=self._forms.force, end=self._forms.end, search=self._setting.search.flags,
            limit=self._limit, back_force=self._back_force, dissipated=self._dissipated,
            slope=self._slope, excess=self.over, slipped=self._slipped, way=self._way,
            rows=self._rows,
        )  # fmt: skip
        self.in_c = {"rigid_plastic": self._c}

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """The laws, and what they enter."""
        ledger = self._ledger
        entries = {"hinges": ledger.lost.pointer("hinges")}
        if self._hardens:
            entries["hardening"] = ledger.state.pointer("hardening")
        if self._loss:
            entries["numerical"] = ledger.lost.pointer("numerical")
        of_law = {"dt_of_law": INPUTS.index("dt"), "way_before": self._way_before}
        of_law["hardened"] = self._stored
        return {**of_law, "loss": self._loss, **entries}

    # -- what has slipped ----------------------------------------------------------------------

    def motion(self, e: Array) -> Array:
        """Motions without the round-off of those that are held."""
        return self._at["start"]

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated in a step to the motions ``e1``, positive where one would slip; J."""
        arrays = doubles(e1), doubles(np.ascontiguousarray(λ))
        return float(lib.dissipation_of_rigid_plastic(self._c, *arrays))

    def dissipated(self) -> Sequence[Array]:
        """Energy that each has dissipated; (num_links,); J."""
        return (self._dissipated,)

    def remaining(self) -> Array:
        """All of the stiffness is left, or none where one slips."""
        return np.where(self._way == 0, 1.0, 0.0)

    def flows(self) -> bool:
        """Return whether one slips in the latest iterate."""
        return bool(self._way.any())

    # -- the state -----------------------------------------------------------------------------

    @property
    def _variables(self) -> tuple[npt.NDArray[Any], ...]:
        at = self._at["slipped"], self._at["start"]
        return (*at, self._limit, self._back_force, self._dissipated, self._way_before)

    def state(self) -> Array:
        """Internal variables; (num_links, 7)."""
        stored = np.zeros(len(self._rows))
        stored[:1] = self._stored  # of all together; to whom it belongs does not matter
        return np.column_stack([*self._variables, stored])

    def restore(self, rows: Array) -> None:
        """Take over the variables of :meth:`state`."""
        *variables, stored = rows.T
        for mine, values in zip(self._variables, variables, strict=True):
            mine[:] = values
        self._slipped[:] = np.abs(self._way_before)
        self._stored[0] = stored.sum()

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""
        self._at["start"][:] = e

    def freeze(self) -> None:
        """Hold from now on, but for connectors that bear nothing any more: these are free."""
        spent = self._limit <= SPENT * self._at["number limit"]
        self._limit[:] = np.where(spent, 0.0, np.inf)
        if not self._hardens:
            self._c.force = self._forms.spent
