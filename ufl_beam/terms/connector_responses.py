# SPDX-License-Identifier: MIT
"""Laws of connectors over a step: one row ``α e + β λ = γ`` for each component of each of them.

e is the relative motion at the end of the step and λ the force that resists its growth.  What is
held has a row about e, all other laws have one about λ, linear in e around the latest iterate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.openings import SearchFlags
from ufl_beam.terms.phases import Callbacks
from ufl_beam.terms.rates_in_c import RatesInC


class Setting(NamedTuple):
    """Arguments that all responses are made with."""

    asked: Callable[[Connector], Any]  # places of forces of controllers and limits of friction
    rates: RatesInC | None  # velocities; None in statics
    size: float  # of the scene; m
    scheme: Scheme
    ledger: Ledger
    friction_repeats: bool  # True if places that stick may hold what is held already
    search: SearchFlags  # of all points of the scene


class Response:
    """Connectors whose laws are of one kind, that of ``law``; motions and forces are arrays.

    By default nothing is stored, yields or is remembered; the work of the forces is entered in
    ``_entry`` of a part of the ledger, if that has a name.
    """

    in_c: Mapping[str, Any] = {}  # data of laws evaluated in C, by names in ``couplings``, loops.h
    must_dissipate = False  # True if require_dissipation has to be called before a step is accepted
    name_in_files = ""  # of the internal variables, if it is not that of the class
    opens = False  # True if connectors open beyond a limit
    _part, _entry, _sign = "lost", "", 1.0

    def __init__(self, law: Any, links: Sequence[Connector], setting: Setting) -> None:
        self._links, self._setting = links, setting
        self._laws: list[Any] = [link.law for link in links]
        self._entries = getattr(setting.ledger, self._part)
        if self._entry:
            self._entries[self._entry] += 0.0
        self._prepare(law)

    def _prepare(self, law: Any) -> None:
        """Prepare the response; called once."""

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """Return fields of ``coupling_term`` of loops.h.

        Names of entries of the ledger are those of ``inelastic_term``.
        """
        return self._entry_in_steps() if self._entry else {}

    def _entry_in_steps(self) -> dict[str, Any]:
        """Those of them that say where the work of the forces is entered."""
        return {"entry": self._entries.pointer(self._entry), "sign": self._sign}

    def _numbers(self, name: str) -> Array:
        """A number of the laws."""
        return np.array([getattr(law, name) for law in self._laws], dtype=np.float64)

    def _lengths(self) -> Array:
        """Motions that are large: the size of the scene, or a radian."""
        return np.where([link.turns for link in self._links], 1.0, self._setting.size)

    def know(self, couplings: Any) -> None:
        """Take arrays of the connectors, and forms on them, that the laws need."""

    @property
    def asks_at_ends(self) -> bool:
        """True if :meth:`take` is to be called when a step is accepted."""
        return False

    def take(self, e1: Array) -> None:
        """Take the end of a step at the motions ``e1``, before C does; this may raise."""

    def about_force(self, rows: Array) -> Array:
        """Factors by which rows about the force are divided, zero for rows about the motion.

        ``rows`` are the latest ones; (num_links, n), the force and the right side at the end.
        """
        of_force = rows[:, -2]
        return np.divide(1.0, of_force, out=np.zeros(len(rows)), where=of_force != 0.0)

    def motion(self, e: Array) -> Array:
        """Motions of the accepted state as solutions show them; ``e`` are those of the nodes.

        A view, which later steps change.
        """
        return e

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated plastically in a step to the motions ``e1``; J."""
        return 0.0

    def flows(self) -> bool:
        """Return whether one slips plastically in the latest iterate."""
        return False

    def require_dissipation(self, e1: Array) -> None:
        """Raise :class:`StepFailed` if a law gives energy in a step to the motions ``e1``."""

    def dissipated(self) -> Sequence[Array]:
        """Energies whose sum each connector has dissipated plastically; (num_links,) each; J.

        Views, which later steps change.
        """
        return ()

    def remaining(self) -> Array:
        """Part of the elastic stiffness that is left in the latest iterate; (num_links,)."""
        return np.ones(len(self._links))

    def bends(self, e1: Array) -> Array:
        """Derivatives of α by the motions, internal variables kept; (num_connectors, n)."""
        return np.zeros((len(self._links), 1))

    def state(self) -> Array:
        """Return the internal variables; (num_links, k)."""
        return np.zeros((len(self._links), 0))

    def restore(self, rows: Array) -> None:
        """Take over the internal variables of :meth:`state`."""

    def start(self, e: Array) -> None:
        """Begin at motions that no step has led to."""

    def borne(self) -> Array | None:
        """Forces of springs in the state that :meth:`start` has begun at; (num_links,)."""
        return None

    def freeze(self) -> None:
        """Keep everything elastic from now on: nothing yields or breaks further."""


@singledispatch
def respond(law: Any, links: Sequence[Connector], setting: Setting) -> Response:
    """The response of connectors whose laws are of the kind of ``law``."""
    raise TypeError(f"{law!r} is no law of a connector")
