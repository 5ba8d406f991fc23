# SPDX-License-Identifier: MIT
"""The virtual work of connectors: the force of a law on the variation of a relative motion."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, integers, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, stated
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.mechanics.connector_forms import connector_forms
from ufl_beam.mechanics.relative_motions import MOTIONS
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import HELD, ForceLaw, Law, RigidPlastic, Spring
from ufl_beam.model.connectors import Connector
from ufl_beam.terms import compiled_laws, connector_laws, force_laws, rigid_plastic, springs
from ufl_beam.terms.connector_responses import Setting, respond
from ufl_beam.terms.links import Links
from ufl_beam.terms.phases import Callbacks, Phases, beginning

LAWS = (compiled_laws, connector_laws, force_laws, rigid_plastic, springs)
"""Modules with the responses of laws, which register them with :func:`respond`."""


def _motions_with(link: Connector) -> tuple[str, ...]:
    """Motions that the law of a link acts on, its own among them."""
    if isinstance(link.law, ConnectorLaw) and link.law.components > 1:
        return ("sliding", "sliding", "turning")[: link.law.components]
    return (link.motion,)


def _kind(law: Law) -> object:
    """Key of a law: connectors with the same one are computed together."""
    if isinstance(law, Spring):
        return law
    if isinstance(law, ForceLaw):
        return ForceLaw, len(law.state)
    if isinstance(law, ConnectorLaw):
        return type(law), law.elastic
    return type(law), law is HELD, isinstance(law, RigidPlastic) and type(law.law)


@stated
def _one_cell() -> meshes.Mesh:
    return line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))


class Couplings(Links):
    """Connectors of the same relative motions whose laws are of one kind.

    Each is a cell of unit length from one node to the other, with its forces as unknowns after
    those of the nodes.  Components of a :func:`Bushing` are links that stand one after the other.
    Forms, and laws of many kinds, are evaluated in C.
    """

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        super().__init__(share, here, setting, A)
        links, scheme = self.links, setting.scheme
        motions = _motions_with(links[0])
        k, n = len(motions), len(links)
        self._cells = n // k
        self._dofs = np.column_stack([self._dofs[::k, :6], self._forces_at.reshape(-1, k)])
        self._forms = forms = connector_forms(motions, scheme, _one_cell())
        numbers = [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in links]
        self._numbers = np.reshape(numbers, (self._cells, 8 * k))
        self._work, self._tangent, self._value = map(
            self._form, (forms.work, forms.tangent, forms.motion)
        )
        self._tangent.place(A)
        self._e, self._now, self._rows = np.zeros(n), np.zeros(n), np.zeros((n, k + 2))
        self._rows[:, 0] = 1.0  # held, until a law says something else
        for kernel in (self._work, self._tangent):
            kernel.put(forms.row, self._rows.reshape(self._cells, -1))
        self._in_c = struct(
            "couplings", number=self._cells, components=k,
            link=np.arange(self._cells, dtype=np.int32), dofs=self._dofs,
            force=self._forces_at.copy(), size=setting.size,
            length=np.where([c.turns for c in links], 1.0, setting.size),
            work=self._work.cells, tangent=self._tangent.cells, motion=self._value.cells,
            row=self._work.position(forms.row), row_of_tangent=self._tangent.position(forms.row),
            by_cell=np.zeros(n), e0=self._e, e1=self._now, before=self._before,
            taken=self.work, rate=self.rate, weight_of_before=scheme.weight_of_before,
            **self.response.in_c,
        )  # fmt: skip
        self.response.know(self)

    def _form(self, form: ufl.Form) -> Kernel:
        """A form on the connectors, with their numbers."""
        unit = np.tile([[0.0, 0.0], [1.0, 0.0]], (self._cells, 1, 1))
        kernel = Kernel(form, self._forms.q1, self._dofs, unit)
        if kernel.uses(self._forms.numbers):
            kernel.put(self._forms.numbers, self._numbers)
        return kernel

    @property
    def velocities(self) -> fem.Function:
        """Function of :attr:`rate_of_motion` that has the velocities."""
        return self._forms.u

    @property
    def motions(self) -> tuple[Array, Array]:
        """Motions in the accepted state and in the latest iterate, as C has them."""
        return self._e, self._now

    # -- in C ----------------------------------------------------------------------------------

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops of forces and rows, and of their derivatives."""
        return loop("add_couplings_force", self._in_c), loop("add_cells", self._tangent.cells)

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the connectors; where laws of a user have a history, they are asked, too."""
        self._callbacks, response = callbacks, self.response
        of_law = response.in_steps(callbacks)
        fields = {name for name, _ in ffi.typeof("coupling_term").fields}
        mine = {name: x for name, x in of_law.items() if name in fields}
        points = struct("inelastic_term", **{k: x for k, x in of_law.items() if k not in fields})
        c = struct("coupling_term", links=self._in_c, points=points, **mine)

        begin = beginning((self._work, self._tangent), self._forms.q0)
        phases = ("begin_couplings", "accept_couplings", "add_energy_of_couplings")
        first, accept, state = ([loop(name, c)] for name in phases)
        admits = loop("springs_dissipate", c) if response.must_dissipate else None
        change, opens, again = loop("change_of_couplings", c), None, None
        if response.asks_at_ends:
            accept.insert(0, callbacks.phase(self._ask_at_end))
        if response.opens:
            names, of = ("points", "slips", "rubs", "way_before"), response.in_c
            found = {**of, "slips": of.get("rigid_plastic"), "rubs": of.get("friction"), **of_law}
            opens = {name: found[name] for name in names if found.get(name) is not None}
            if "way_before" in opens:
                opens["way_before"] = integers(opens["way_before"])
        if response.in_c.keys() & {"rigid_plastic", "friction", "asked"}:
            again = loop("begin_couplings_again", c)
        return Phases([*begin, *first], accept, state, change, opens, admits, again)

    def demand(self) -> Loop:
        """The loop that says how much an iterate misses of the laws."""
        return loop("missed_by_couplings", self._in_c)

    def _ask_at_end(self, step: Any, q1: Any, s: Any) -> None:
        """Let laws of a user take the end of a step, before anything is accepted."""
        lib.find_motions(self._in_c, q1)
        self.response.take(self._now)

    # -- the step ------------------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""
        lib.find_motions(self._in_c, doubles(q))
        return self._now.copy()

    @cached_property
    def rate_of_motion(self) -> Kernel:
        """The rates of the motions; friction asks for them."""
        return self._form(self._forms.rate)

    def rates(self, q: Array, v: Array) -> Array:
        """Rates of the motions at ``q`` if the velocities are ``v``; (num_links,); m/s or rad/s."""
        rates = np.zeros(len(self.links))
        self.rate_of_motion.set(self._forms.u, v)
        self.rate_of_motion.add(q, rates)
        return rates

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Put minus the change of the motions where the row is about the force."""
        about_force = self.response.about_force(self.rows(q))
        if about_force.any():
            works[self._forces_at] = np.where(
                about_force != 0.0, -about_force * self.rates(q, v), works[self._forces_at]
            )

    def rows(self, q: Array) -> Array:
        """Rows of the laws around ``q``; (num_links, k + 2) with k components."""
        lib.find_rows(self._in_c, doubles(q), doubles(self._rows))
        return self._rows

    def _kept_motion(self, q: Array) -> Array:
        """Motions of the accepted state as solutions show them."""
        return self.response.motion(self._e)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        change, e = self._tangent_change, self.motion(q1)
        both = self.rows(q1), self.response.bends(e)
        rows, bends = (np.reshape(x, (self._cells, -1)) for x in both)
        for function, values in ((self._forms.row, rows), (self._forms.bend, bends)):
            if change.uses(function):
                change.put(function, values)
        change.set(self._forms.u, u)
        change.add(q1, self._A.data)

    @cached_property
    def _tangent_change(self) -> Kernel:
        change = self._form(self._forms.change)
        change.place(self._A)
        return change

    # -- the state -----------------------------------------------------------------------------

    def start(self, q: Array) -> None:
        """Begin at the motions of a configuration."""
        self._e[:] = self.motion(q)
        self.response.start(self._e)

    def remember(self, memory: Memory, q: Array) -> None:
        """Motions, forces and works, and what the laws remember."""
        response = self.response
        rows = np.column_stack([self.work, self.rate, self._before, self._e, response.state()])
        name = response.name_in_files or type(response).__name__
        rows = memory.rows(name, self.numbers, rows)
        self.work[:], self.rate[:], self._before[:], self._e[:] = rows[:, :4].T
        response.restore(rows[:, 4:])


def couplings(share: Share, setting: Setting, A: Csr) -> list[Links]:
    """Make the connectors of a process but for guides, those that are alike together.

    Each process makes the entries of the ledger in the order of the scene, also those that only
    others write.
    """
    links = share.grid.scene.links
    groups: dict[tuple[tuple[str, ...], object], list[int]] = {}
    keys = [(_motions_with(link), _kind(link.law)) for link in links]
    for i, number in enumerate(share.links):
        groups.setdefault(keys[number], []).append(i)
    made: list[Links] = []
    for key, link in dict(zip(keys, links, strict=True)).items():
        if link.motion in MOTIONS and key in groups:
            made.append(Couplings(share, np.array(groups[key]), setting, A))
        elif link.motion in MOTIONS:
            respond(link.law, (), setting)
    return made
