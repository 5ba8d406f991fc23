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
from ufl_beam.compiled.c_library import doubles, ffi, fill, in_order, lib, struct
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.connector_steps import law_step
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.connector_law import ConnectorLaw, place_of
from ufl_beam.model.connectors import Connector
from ufl_beam.model.material_law import State
from ufl_beam.terms.connector_laws import Rubbing
from ufl_beam.terms.connector_responses import Response, Setting, respond
from ufl_beam.terms.phases import Callbacks


def inputs(law: ConnectorLaw) -> tuple[str, ...]:
    """Names of the inputs of a compiled law; loops.h explains their order."""
    motions = (f"{when} {i}" for when in ("motion", "before") for i in range(law.components))
    of_law = (*(f"state {name}" for name in law.variables), *(f"number {n}" for n in law.numbers()))
    return (*motions, "dt", "theta", *of_law)


class LawForms:
    """Compiled law of a connector, for all numbers.

    Attributes:
        force: Forces and their derivatives by the motions at the end of the step.
        end: ``law_output`` of loops.h, then the variables at the end.
        limit: Force up to which the motion is held.
    """

    def __init__(self, law: ConnectorLaw, scheme: Scheme) -> None:
        self._law, self._scheme, self._pointwise = law, scheme, Pointwise(inputs(law))
        at, motions = self._pointwise.at, [f"motion {i}" for i in range(law.components)]
        self._at = at | {name: ufl.variable(at[name]) for name in motions}
        self._motions = [self._at[name] for name in motions]
        try:
            forces, *numbers, variables = law_step(law, self._at, scheme)
            self.force = self._compile(*forces, *self._slopes(forces))
            by_name = dict(zip(("stored", "numerical"), numbers, strict=True))
            end = in_order("law_output", by_name, "law_")
            self.end = self._compile(*end, *variables)
            old = State({name: at[f"state {name}"] for name in law.variables})
            numbers_of_law = {name: at[f"number {name}"] for name in law.numbers()}
            self.limit = self._compile(ufl.as_ufl(law.of(numbers_of_law).limit(old)))
        except Exception as error:
            raise SceneError(
                f"{type(law).__name__}: it cannot be called with symbols of UFL: {error}. Laws are "
                f"written with + - * / ** and the functions of ub.law_functions{place_of(law)}"
            ) from error

    @cached_property
    def frozen(self) -> tuple[Any, Any]:
        """The same forces, and second derivatives, while the variables stay as they are."""
        forces = law_step(self._law, self._at, self._scheme, frozen=True).forces
        slopes = self._slopes(forces)
        return self._compile(*forces, *slopes), self._compile(*self._slopes(slopes))

    def _slopes(self, values: Sequence[Expr]) -> list[Expr]:
        """Derivatives of each value by all motions."""
        return [ufl.diff(value, motion) for value in values for motion in self._motions]

    def _compile(self, *outputs: Expr) -> Any:
        """Compile a function; none if all that it returns is zero."""
        outputs = tuple(map(expand_derivatives, outputs))
        zero = all(isinstance(one, Zero) for one in outputs)
        return ffi.NULL if zero else self._pointwise.compile(*outputs)


_law_forms = stated(LawForms)


@respond.register(ConnectorLaw)
def _(law: ConnectorLaw, links: Sequence[Connector], setting: Setting) -> Response:
    return (RubbingLaws if law.holds else CompiledLaws)(law, links, setting)


class CompiledLaws(Response):
    """Connectors whose laws are of one class, with numbers of their own."""

    def _prepare(self, law: Any) -> None:
        setting, ledger, k = self._setting, self._setting.ledger, law.components
        n = len(self._links) // k
        self._law, self._loses = law, not law.elastic
        self.name_in_files = f"{type(law).__qualname__}{[*law.variables]}"
        ledger.state["stored"] += 0.0
        if self._loses:
            ledger.lost[law.entry] += 0.0
        exact = setting.scheme.weight_of_before == 0.0
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
            self._at[f"number {name}"][:] = self._numbers(name)[::k]
        self._held, self._lost = np.zeros(n), np.zeros(n * k)  # lost: in the first component
        self._rows, self._sum = np.zeros((n, k * (k + 2))), np.zeros(2)
        self._forms = _law_forms(law.of(dict.fromkeys(law.numbers(), 1.0)), setting.scheme)
        outputs = int(lib.LAW_OUTPUTS) + len(law.variables)
        self._c = struct(
            "connector_laws", number=n, width=len(columns), variables=len(law.variables),
            components=k, force=self._forms.force, end=self._forms.end, loses=self._loses, w=w,
            stored=self._held, lost=self._lost, rows=self._rows, answer=np.zeros(outputs),
            sum=self._sum,
        )  # fmt: skip
        self.in_c = {"laws": self._c}

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """Entries of the ledger."""
        ledger = self._setting.ledger
        entries = {"stored": ledger.state.pointer("stored")}
        if self._loses:
            entries["lost"] = ledger.lost.pointer(self._law.entry)
        if self._delayed:
            entries["numerical"] = ledger.lost.pointer("numerical")
        return entries

    def dissipated(self) -> Sequence[Array]:
        """Energy that each connector has lost; J."""
        return (self._lost,)

    def bends(self, e1: Array) -> Array:
        """Minus the second derivatives of the forces; variables stay."""
        k = self._law.components
        self._w[:, :k] = e1.reshape(-1, k)
        bends = np.zeros((len(self._w), k**3))
        for w, of in zip(self._w, bends, strict=True):
            lib.ask_law(self._forms.frozen[1], doubles(w), k**3, doubles(of))
        return -bends

    # -- the state -----------------------------------------------------------------------------

    def _variables(self) -> State:
        return State({name: self._at[f"state {name}"] for name in self._law.variables})

    def _numbers_at(self) -> ConnectorLaw:
        """The law with the numbers of all connectors."""
        law: ConnectorLaw = self._law
        return law.of({name: self._at[f"number {name}"] for name in law.numbers()})

    def state(self) -> Array:
        """Internal variables, stored energy, and what was lost; (num_links, k)."""
        k = self._law.components
        of_law = [self._at[f"state {name}"] for name in self._law.variables]
        rows = np.column_stack([*of_law, self._held, self._lost[::k]])
        return np.repeat(rows, k, axis=0)

    def restore(self, rows: Array) -> None:
        """Take over the variables of :meth:`state`."""
        k = self._law.components
        *of_law, self._held[:], self._lost[::k] = rows[::k].T
        for name, values in zip(self._law.variables, of_law, strict=True):
            self._at[f"state {name}"][:] = values

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""
        k = self._law.components
        self._w[:, k : 2 * k] = e.reshape(-1, k)
        with np.errstate(all="ignore"):
            law, motions = self._numbers_at(), self._motions_before()
            self._held[:] = law.energy(law.given(motions), self._variables())

    def borne(self) -> Array | None:
        """Forces of the energies where :meth:`start` has begun."""
        forces = self._numbers_at().elastic_forces(self._motions_before(), self._variables())
        return np.column_stack(forces).ravel()

    def _motions_before(self) -> list[Array]:
        return [self._at[f"before {i}"] for i in range(self._law.components)]

    def freeze(self) -> None:
        """Keep the variables from now on."""
        fill(self._c, force=self._forms.frozen[0])


class RubbingLaws(Rubbing, CompiledLaws):
    """Laws that hold the motion below a limit."""

    opens = True

    def _prepare(self, law: Any) -> None:
        super()._prepare(law)
        self._limits = np.zeros(len(self._links))
        places = [doubles(self._limits) + i for i in range(len(self._links))]
        self._rub(places, laws=self._c, limit_of_law=self._forms.limit)

    def borne(self) -> Array | None:
        """Nobody knows the forces of what is held."""
        return None

    def bends(self, e1: Array) -> Array:
        """Zero: what sticks has none, and what slides is followed in no analysis."""
        return np.zeros((len(self._links), 1))

    def freeze(self) -> None:
        """Let what sticks stick from now on."""
