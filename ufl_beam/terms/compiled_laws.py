# SPDX-License-Identifier: MIT
"""Responses of connectors whose laws are stated as energy and resistance, compiled to C."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.constantvalue import Zero
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, in_order, lib, names, struct
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.connector_steps import law_step
from ufl_beam.mechanics.time_schemes import Scheme, Step
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_law_checks import place_of
from ufl_beam.model.material_law import State
from ufl_beam.terms.connector_responses import Response, Rows, respond
from ufl_beam.terms.phases import Callbacks, weight_of_before


def inputs(law: ConnectorLaw) -> tuple[str, ...]:
    """Names of the inputs of a compiled law; loops.h explains their order."""
    of_law = (*(f"state {name}" for name in law.variables), *(f"number {n}" for n in law.numbers()))
    return (*names("law_input", "law_"), *of_law)


class LawForms:
    """Compiled law of a connector, for all numbers.

    Attributes:
        force: Force and its derivative by the motion at the end of the step.
        end: ``law_output`` of loops.h, then the variables at the end.
    """

    def __init__(self, law: ConnectorLaw, scheme: Scheme) -> None:
        self._law, self._scheme, self._pointwise = law, scheme, Pointwise(inputs(law))
        motion = ufl.variable(self._pointwise.at["motion"])
        self._at = {**self._pointwise.at, "motion": motion}
        try:
            force, *numbers, variables = law_step(law, self._at, scheme)
            self.force = self._compile(force, ufl.diff(force, motion))
            by_name = dict(zip(("stored", "numerical"), numbers, strict=True))
            end = in_order("law_output", by_name, "law_")
            self.end = self._compile(*end, *variables)
        except Exception as error:
            raise SceneError(
                f"{type(law).__name__}: it cannot be called with symbols of UFL: {error}. Laws are "
                f"written with + - * / ** and the functions of ub.law_functions{place_of(law)}"
            ) from error

    @cached_property
    def frozen(self) -> tuple[Any, Any]:
        """The same force, and its second derivative, while the variables stay as they are."""
        motion = self._at["motion"]
        force = law_step(self._law, self._at, self._scheme, frozen=True).force
        slope = ufl.diff(force, motion)
        return self._compile(force, slope), self._compile(ufl.diff(slope, motion))

    def _compile(self, *outputs: Expr) -> Any:
        """Compile a function; none if all that it returns is zero."""
        outputs = tuple(map(expand_derivatives, outputs))
        zero = all(isinstance(one, Zero) for one in outputs)
        return ffi.NULL if zero else self._pointwise.compile(*outputs)


_law_forms = stated(LawForms)


@respond.register(ConnectorLaw)
class CompiledLaws(Response):
    """Connectors whose laws are of one class, with numbers of their own."""

    def _prepare(self, law: Any) -> None:
        setting, n, ledger = self._setting, len(self._links), self._setting.ledger
        self._law, self._loses = law, not law.elastic
        self.name_in_files = f"{type(law).__qualname__}{[*law.variables]}"
        ledger.state["stored"] += 0.0
        if self._loses:
            ledger.lost[law.entry] += 0.0
        exact = weight_of_before(setting.scheme.acting) == 0.0
        self._delayed = exact and setting.scheme.load_weight > 0.5
        if self._delayed:
            ledger.lost["numerical"] += 0.0
        columns = inputs(law)
        w = self._w = np.zeros((n, len(columns)))
        self._at = {name: w[:, k] for k, name in enumerate(columns)}
        self._at["theta"][:], self._at["dt"][:] = setting.scheme.theta, 1.0
        for name, value in law.variables.items():
            self._at[f"state {name}"][:] = value
        for name in law.numbers():
            self._at[f"number {name}"][:] = self._numbers(name)
        self._held, self._lost = np.zeros((2, n))
        self._rows, self._sum = np.zeros((n, 3)), np.zeros(2)
        self._forms = _law_forms(law.of(dict.fromkeys(law.numbers(), 1.0)), setting.scheme)
        outputs = int(lib.LAW_OUTPUTS) + len(law.variables)
        self._c = struct(
            "connector_laws", number=n, width=len(columns), variables=len(law.variables),
            force=self._forms.force, end=self._forms.end, loses=self._loses, w=w,
            stored=self._held, lost=self._lost, rows=self._rows, answer=np.zeros(outputs),
            sum=self._sum,
        )  # fmt: skip
        self.in_c = {"laws": self._c}

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any] | None:
        """Entries of the ledger."""
        ledger = self._setting.ledger
        entries = {"stored": ledger.state.pointer("stored")}
        if self._loses:
            entries["lost"] = ledger.lost.pointer(self._law.entry)
        if self._delayed:
            entries["numerical"] = ledger.lost.pointer("numerical")
        return entries

    # -- the step ------------------------------------------------------------------------------

    def begin(self, e0: Array, step: Step) -> None:
        """Begin a step at the motions ``e0``."""
        self._at["dt"][:], self._at["before"][:] = step.dt, e0

    def rows(self, e1: Array, λ: Array) -> Rows:
        """The laws around the motions."""
        lib.find_rows_of_laws(self._c, doubles(np.ascontiguousarray(e1)))
        return self._rows[:, 0], self._rows[:, 1], self._rows[:, 2]

    def accept(self, e1: Array, work: float) -> None:
        """Enter what the step has lost; C has taken its end as the new state."""
        lost, numerical = self._sum.tolist()
        if self._loses:
            self._setting.ledger.lost[self._law.entry] += lost
        if self._delayed:
            self._setting.ledger.lost["numerical"] += numerical

    def add_state(self, e: Array) -> None:
        """Enter the stored energy."""
        self._setting.ledger.state["stored"] += float(self._held.sum())

    def change(self, e1: Array, work: float) -> float:
        """All of the work, or the change of the energy where nothing is lost."""
        if self._loses:
            return work
        return float(np.sum(self._numbers_at().energy(e1, self._variables()) - self._held))

    def dissipated(self) -> Sequence[Array]:
        """Energies that the connectors have lost."""
        return (self._lost,)

    def bends(self, e1: Array) -> Array:
        """Minus the second derivatives of the forces; variables stay."""
        self._at["motion"][:] = e1
        return np.array([-lib.ask_law(self._forms.frozen[1], doubles(w)) for w in self._w])

    # -- the state -----------------------------------------------------------------------------

    def _variables(self) -> State:
        return State({name: self._at[f"state {name}"] for name in self._law.variables})

    def _numbers_at(self) -> ConnectorLaw:
        """The law with the numbers of all connectors."""
        law: ConnectorLaw = self._law
        return law.of({name: self._at[f"number {name}"] for name in law.numbers()})

    def state(self) -> Array:
        """Internal variables, stored energy, and what was lost; (num_links, k)."""
        of_law = [self._at[f"state {name}"] for name in self._law.variables]
        return np.column_stack([*of_law, self._held, self._lost])

    def restore(self, rows: Array) -> None:
        """Take over the variables of :meth:`state`."""
        *of_law, self._held[:], self._lost[:] = rows.T
        for name, values in zip(self._law.variables, of_law, strict=True):
            self._at[f"state {name}"][:] = values

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""
        self._at["before"][:] = e
        with np.errstate(all="ignore"):
            self._held[:] = self._numbers_at().energy(e, self._variables())

    def borne(self) -> Array | None:
        """Forces of the energies where :meth:`start` has begun."""
        return np.asarray(self._numbers_at().elastic_force(self._at["before"], self._variables()))

    def freeze(self) -> None:
        """Keep the variables from now on."""
        fill(self._c, force=self._forms.frozen[0])
