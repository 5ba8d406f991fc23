# SPDX-License-Identifier: MIT
"""The virtual work of connectors: the force of a law on the variation of a relative motion."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import CellForm, Kernel, stated
from ufl_beam.discretization.dolfinx_forms import DolfinxForm
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.mechanics.connector_forms import connector_forms
from ufl_beam.mechanics.relative_motions import MOTIONS
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.connector_laws import HELD, ForceLaw, Law, RigidPlastic, Spring
from ufl_beam.terms import connector_laws, force_laws, rigid_plastic, springs
from ufl_beam.terms.connector_responses import Setting, respond
from ufl_beam.terms.links import Links
from ufl_beam.terms.phases import Phases, TimeFunctions, beginning

LAWS = (connector_laws, force_laws, rigid_plastic, springs)
"""Modules with the responses of laws, which register them with :func:`respond`."""


def _kind(law: Law) -> object:
    """Key of a law: connectors with the same one are computed together."""
    if isinstance(law, Spring):
        return law
    if isinstance(law, ForceLaw):
        return ForceLaw, len(law.state)
    return type(law), law is HELD, isinstance(law, RigidPlastic) and type(law.law)


class Couplings(Links, ABC):
    """Connectors of one relative motion whose laws are of one kind.

    Each is a cell of unit length from one node to the other, with its force as a seventh unknown.
    """

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        super().__init__(share, here, setting, A)
        links, n = self.links, len(here)
        self._forms = forms = connector_forms(links[0].motion, setting.scheme, self._cells())
        self._numbers = np.array([(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in links])
        self._work, self._tangent, self._value = map(
            self._form, (forms.work, forms.tangent, forms.motion)
        )
        self._tangent.place(A)
        self._length = np.where([c.turns for c in links], 1.0, setting.size)
        self._size = setting.size
        self._weight_of_before = float(setting.scheme.acting(np.ones(1), np.zeros(1))[0])
        self._e, self._rows = np.zeros(n), np.zeros((n, 3))
        self._q: Array = np.empty(0)
        self._prepare()

    @abstractmethod
    def _cells(self) -> meshes.Mesh:
        """The mesh that forms are stated on."""

    @abstractmethod
    def _evaluated(self, form: ufl.Form) -> CellForm:
        """A form on the connectors."""

    @abstractmethod
    def _prepare(self) -> None:
        """Prepare the evaluation; called once."""

    # -- the step ------------------------------------------------------------------------------

    def _form(self, form: ufl.Form) -> CellForm:
        evaluated = self._evaluated(form)
        if evaluated.uses(self._forms.numbers):
            evaluated.put(self._forms.numbers, self._numbers)
        return evaluated

    @cached_property
    def _rate(self) -> CellForm:
        """The rates of the motions; friction asks for them."""
        return self._form(self._forms.rate)

    def rates(self, q: Array, v: Array) -> Array:
        """Rates of the motions at ``q`` if the velocities are ``v``; (num_links,); m/s or rad/s."""
        rates = np.zeros(len(self.links))
        self._rate.set(self._forms.u, v)
        self._rate.add(q, rates)
        return rates

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Put minus the change of the motions where the row is about the force."""
        about_force = self.response.about_force(self._rows)
        if about_force.any():
            works[self._forces_at] = np.where(
                about_force != 0.0, -about_force * self.rates(q, v), works[self._forces_at]
            )

    def begin(self, step: Step) -> None:
        """Remember the motions at the beginning."""
        self._work.set(self._forms.q0, step.q0)
        self._tangent.set(self._forms.q0, step.q0)
        if step.q0 is not self._q:
            self._q, self._e[:] = step.q0, self.motion(step.q0)
        self._dt = step.dt
        self.response.begin(self._e, step)
        if self.response.steady:
            self._put(*self.response.rows(self._e, self._before))

    def _put(self, *rows: Array | float) -> None:
        for column, numbers in enumerate(rows):
            self._rows[:, column] = numbers
        for kernel in (self._work, self._tangent):
            kernel.put(self._forms.row, self._rows)

    def add_tangent(self, q1: Array) -> None:
        """Add the derivative; the rows are those of the latest residual."""
        self._tangent.add(q1, self._A.data)

    def _kept_motion(self, q: Array) -> Array:
        """Motions of the accepted state as solutions show them."""
        return self.response.motion(self._e)

    def _taken(self, q1: Array) -> Array:
        weight = self._weight_of_before
        force = weight * self._before + (1 - weight) * self.force(q1)
        return np.asarray(force * (self.motion(q1) - self._e))

    def change(self, q1: Array) -> float:
        """Energy that the connectors take in the step to ``q1``; J."""
        return self.response.change(self.motion(q1), float(self._taken(q1).sum()))

    def effort(self, q1: Array) -> float:
        """Sum of the sizes of the works that the connectors take in the step to ``q1``; J."""
        return float(np.abs(self._taken(q1)).sum())

    @abstractmethod
    def _commit(self, q1: Array) -> float:
        """Take motions, forces and works as those of the state; what all have taken; J."""

    def accept(self, q1: Array, s: Array) -> None:
        """Enter what was supplied or lost."""
        taken = self._commit(q1)
        self._q = q1
        self.response.accept(self._e, taken)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        change, e = self._tangent_change, self.motion(q1)
        self._put(*self.response.rows(e, self.force(q1)))
        bends = self.response.bends(e)[:, None]
        for function, values in ((self._forms.row, self._rows), (self._forms.bend, bends)):
            if change.uses(function):
                change.put(function, values)
        change.set(self._forms.u, u)
        change.add(q1, self._A.data)

    @cached_property
    def _tangent_change(self) -> CellForm:
        change = self._form(self._forms.change)
        change.place(self._A)
        return change

    # -- the state -----------------------------------------------------------------------------

    def add_state(self, q: Array) -> None:
        """Enter what is stored."""
        if q is not self._q:
            self._q, self._e[:] = q, self.motion(q)
            self.response.start(self._e)
        self.response.add_state(self._e)

    def remember(self, memory: Memory, q: Array) -> None:
        """Motions, forces and works, and what the laws remember."""
        response = self.response
        rows = np.column_stack([self.work, self.rate, self._before, self._e, response.state()])
        # Files have the names of these classes.
        rows = memory.rows(type(response).__name__, self.numbers, rows)
        self.work[:], self.rate[:], self._before[:], self._e[:] = rows[:, :4].T
        response.restore(rows[:, 4:])
        self._q = q


@stated
def _one_cell() -> meshes.Mesh:
    return line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))


class CompiledCouplings(Couplings):
    """Connectors whose forms, and laws of many kinds, are evaluated in C."""

    _work: Kernel
    _tangent: Kernel
    _value: Kernel

    def _cells(self) -> meshes.Mesh:
        return _one_cell()

    def _evaluated(self, form: ufl.Form) -> Kernel:
        unit = np.tile([[0.0, 0.0], [1.0, 0.0]], (len(self.links), 1, 1))
        return Kernel(form, self._forms.q1, self._dofs, unit)

    def _prepare(self) -> None:
        n, row = len(self.links), self._forms.row
        self._now = np.zeros(n)
        self._in_c = struct(
            "couplings", number=n, link=np.arange(n, dtype=np.int32), dofs=self._dofs,
            force=self._forces_at.copy(), length=self._length, size=self._size,
            work=self._work.cells, tangent=self._tangent.cells, motion=self._value.cells,
            row=self._work.position(row), row_of_tangent=self._tangent.position(row),
            by_cell=np.zeros(n), e0=self._e, e1=self._now, before=self._before,
            taken=self.work, rate=self.rate, weight_of_before=self._weight_of_before,
            **self.response.in_c,
        )  # fmt: skip
        self._asks_python = not self.response.steady and not self.response.in_c

    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""
        lib.find_motions(self._in_c, doubles(q))
        return self._now.copy()

    def loops(self) -> tuple[Loop, Loop | None] | None:
        """C loops of the laws that are steady or of material points."""
        if self._asks_python:
            return None
        return loop("add_couplings_force", self._in_c), loop("add_cells", self._tangent.cells)

    def phases(self, times: TimeFunctions) -> Phases | None:
        """Loops over what is held, driven, pushed or damped, springs and rigid-plastic ones."""
        response = self.response
        if (of_law := response.in_steps(times)) is None:
            return None
        fields = {name for name, _ in ffi.typeof("coupling_term").fields}
        mine = {name: x for name, x in of_law.items() if name in fields}
        points = struct("inelastic_term", **{k: x for k, x in of_law.items() if k not in fields})
        c = struct("coupling_term", links=self._in_c, points=points, **mine)

        def enter(q: Array) -> None:
            if q is not self._q:
                self._q, self._e[:] = q, self.motion(q)
            if not of_law:  # rows that stay
                self._put(*response.rows(self._e, self._before))
            c.hardened = response.stored

        def leave(q: Array) -> None:
            self._q, response.stored = q, c.hardened

        begin = beginning((self._work, self._tangent), self._forms.q0)
        phases = ("begin_couplings", "accept_couplings", "add_energy_of_couplings")
        first, accept, state = ([loop(name, c)] for name in phases)
        over = None if response.openable is None else response.openable.over
        admits = loop("springs_dissipate", c) if response.must_dissipate else None
        change = loop("change_of_couplings", c)
        return Phases([*begin, *first], accept, state, change, enter, leave, over, admits)

    def demand(self) -> Loop:
        """The loop of :meth:`excess`."""
        return loop("missed_by_couplings", self._in_c)

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the forces on the nodes, and the rows of the laws."""
        if self._asks_python:
            self._put(*self.response.rows(self.motion(q1), self.force(q1)))
        lib.add_couplings_force(self._in_c, doubles(q1), doubles(r))

    def excess(self, q: Array, r: Array, force: float, moved: float) -> float:
        """Largest residual of a row: of motions as a part of 1 % of ``moved``, or of ``force``."""
        missed: float = lib.missed_by_couplings(self._in_c, doubles(q), doubles(r), force, moved)
        return missed

    def _commit(self, q1: Array) -> float:
        return float(lib.commit_couplings(self._in_c, doubles(q1), self._dt))


class ReferenceCouplings(Couplings):
    """The same equations as :class:`CompiledCouplings`, line by line."""

    def _cells(self) -> meshes.Mesh:
        """Cells of unit length, with no vertices in common."""
        n = len(self.links)
        mesh = line_mesh(np.tile([[0.0, 0.0], [1.0, 0.0]], (n, 1)), np.arange(2 * n).reshape(n, 2))
        self._order = np.asarray(mesh.topology.original_cell_index)
        return mesh

    def _evaluated(self, form: ufl.Form) -> DolfinxForm:
        return DolfinxForm(form, self._forms.q1, self._dofs, self._order)

    def _prepare(self) -> None:
        """Nothing more is needed."""

    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""
        e = np.zeros(len(self.links))
        self._value.add(q, e)
        return e

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the forces on the nodes, and the rows of the laws."""
        if not self.response.steady:
            self._put(*self.response.rows(self.motion(q1), self.force(q1)))
        self._work.add(q1, r)

    def excess(self, q: Array, r: Array, force: float, moved: float) -> float:
        """Largest residual of a row: of motions as a part of 1 % of ``moved``, or of ``force``.

        What the last digits of the motions make of a row does not count.
        """
        amplitude, unit = moved / self._size, self.response.factors()
        weight = np.abs(self._rows[:, 1])
        of_motion = 0.01 * self._length * amplitude
        of_force = weight * force * self._size / self._length
        size = np.where(weight * unit < 1 - 1e-12, of_motion, of_force)
        displaced = np.abs(q[self._dofs[:, :4]]).max(axis=1) / self._size
        turned = np.abs(q[self._dofs[:, 4:6]]).max(axis=1)
        far = amplitude + np.maximum(displaced, turned)
        round_off = 8 * np.abs(self._rows[:, 0]) * self._length * np.spacing(far)
        left = np.abs(r[self._forces_at]) - round_off
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.where(left <= 0, 0.0, left / size).max())

    def _commit(self, q1: Array) -> float:
        e, taken = self.motion(q1), self._taken(q1)
        self.work += taken
        self.rate[:] = (e - self._e) / self._dt
        self._before[:] = self.force(q1)
        self._e[:] = e
        return float(taken.sum())


def couplings(share: Share, setting: Setting, A: Csr, kind: type[Couplings]) -> list[Links]:
    """Make the connectors of a process but for guides, those that are alike together.

    Each process makes the entries of the ledger in the order of the scene, also those that only
    others write.
    """
    links = share.grid.scene.links
    groups: dict[tuple[str, object], list[int]] = {}
    keys = [(link.motion, _kind(link.law)) for link in links]
    for i, number in enumerate(share.links):
        groups.setdefault(keys[number], []).append(i)
    made: list[Links] = []
    for key, link in dict(zip(keys, links, strict=True)).items():
        if link.motion in MOTIONS and key in groups:
            made.append(kind(share, np.array(groups[key]), setting, A))
        elif link.motion in MOTIONS:
            respond(link.law, (), setting)
    return made
