# SPDX-License-Identifier: MIT
"""Virtual works and potentials of a user: forces, tangents, and entries in the ledger."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, ffi, lib, loop
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel
from ufl_beam.discretization.function_spaces import Fields, element_of
from ufl_beam.discretization.state_io import Memory, Restoring, Saving
from ufl_beam.discretization.work_forms import GROWTH, Statement, statement
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import SceneError, shorten
from ufl_beam.mechanics.time_schemes import Scheme, Step, acting
from ufl_beam.model.time_functions import value_at
from ufl_beam.model.works import Potential, VirtualWork, Work
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.in_cells import InCells
from ufl_beam.terms.loads import LoadTerm

AT_REST = 1e300
"""Longest step that forms are told of, in which all rates vanish; s."""


class Clock(NamedTuple):
    """Time (s) at which works act in a step, its length (s), and how much of them acts."""

    t: float
    dt: float
    growth: float


class Acting(ABC):
    """A work on those cells of a process on which it acts."""

    def __init__(
        self, work: Work, stated: Statement, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger
    ) -> None:
        self._work, self._stated, self._fields, self._A = work, stated, fields, A
        self._name, self._ledger, self._scheme = work.name, ledger, scheme
        self._size, self.order = fields.share.size, fields.order
        with _named(work):
            self.residual = self._kernel(stated.residual)
            self._kernels = [self.residual]
            self.tangent: Kernel | None = None
            if not stated.tangent.empty():
                self.tangent = self._kernel(stated.tangent)
                self.tangent.place(A)
                self._kernels.append(self.tangent)
        self._known: dict[str, float] = {}

    def _kernel(self, form: ufl.Form) -> Kernel:
        return self._fields.hot_kernel(form, self._fields.element.q1)

    @staticmethod
    @abstractmethod
    def expect(work: Work, stated: Statement, ledger: Ledger) -> None:
        """Make the entries of the ledger, also on processes without such cells."""

    def begin(self, q0: Array, clock: Clock) -> None:
        """Take note of the step that is to be solved."""
        for kernel in self._kernels:
            kernel.set(self._fields.element.q0, q0)
        self._put(clock.t, {"dt": clock.dt, GROWTH: clock.growth})

    def _put(self, t: float, clock: Mapping[str, float]) -> None:
        """Give the forms the numbers at a time, those that have changed."""
        of_time = self._work.numbers.items()
        values = {name: value_at(x, t, self._work) if callable(x) else x for name, x in of_time}
        for name, value in {"t": t, **clock, **values}.items():
            if self._known.get(name) != value:
                self._known[name] = value
                function = self._stated.numbers[name]
                for kernel in self._kernels:
                    if kernel.uses(function):
                        kernel.put(function, np.array([value]))

    def form_of_forces(self) -> Kernel:
        """The form of the residual."""
        return self.residual

    def force(self, q1: Array) -> Array:
        """Forces on the nodes at the end of the step; a new array."""
        r = np.zeros(self._size)
        self.residual.add(q1, r)
        return -r

    def take(self, force: Array, past: Restoring | None) -> Array:
        """Return the forces before the next step: those given, or those that ``past`` knows."""
        return force

    def pass_on(self, memory: Saving) -> None:
        """Save the forces of the last step if a scheme that needs them cannot find them again."""

    @abstractmethod
    def accept(self, q1: Array, s: Array, force: Array, times: tuple[float, float]) -> None:
        """Enter what the step between two times did."""

    def add_state(self, q: Array, t: float) -> None:
        """Enter the energy of the accepted state."""

    def remember(self, memory: Memory) -> None:
        """State what later steps depend on."""

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        change, u_of_form = self._change
        if change is not None:
            for name, value in self._known.items():
                if change.uses(function := self._stated.numbers[name]):
                    change.put(function, np.array([value]))
            change.set(u_of_form, u)
            change.add(q1, self._A.data)

    @cached_property
    def _change(self) -> tuple[Kernel | None, fem.Function]:
        of = self._fields.element
        u = of.configuration()
        form = expand_derivatives(ufl.derivative(self._stated.tangent, of.q1, u))
        if form.empty():
            return None, u
        change = self._kernel(form)
        change.place(self._A)
        return change, u


class Working(Acting):
    """A virtual work; what it does is entered as supplied."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._before: Array = np.zeros(self._size)

    @staticmethod
    def expect(work: Work, stated: Statement, ledger: Ledger) -> None:
        """Make its entry among the works supplied."""
        ledger.supplied[work.name] += 0.0

    def take(self, force: Array, past: Restoring | None) -> Array:
        """Take forces as those before the next step, or those that ``past`` knows; return them."""
        self._before = force
        if past is not None and past.has(self._saved_as):
            self.remember(past)
        return self._before

    def pass_on(self, memory: Saving) -> None:
        """Save forces that depend on the motion of the last step, if their work is counted on."""
        if self._work.takes_rates and self._scheme.weight_of_before:
            self.remember(memory)

    def accept(self, q1: Array, s: Array, force: Array, times: tuple[float, float]) -> None:
        """Enter the work of the step."""
        self._ledger.supplied[self._name] += float(acting(self._scheme, self._before, force) @ s)
        self._before = force

    def remember(self, memory: Memory) -> None:
        """The forces in the equation of the last step."""
        self._before = memory.added(self._saved_as, self._before)

    @property
    def _saved_as(self) -> str:
        return f"work of {self._name}"


class Storing(Acting):
    """A potential; its energy is an entry of the state."""

    def __init__(self, work: Work, stated: Statement, *more: Any) -> None:
        super().__init__(work, stated, *more)
        self._q0: Array = np.empty(0)
        with _named(work):
            self._energy = self._kernel(stated.energy)
            self._lost = [] if stated.lost is None else [self._kernel(stated.lost)]
        self._kernels += [self._energy, *self._lost]
        self._held, self._varies = 0.0, stated.varies(work)

    @staticmethod
    def expect(work: Work, stated: Statement, ledger: Ledger) -> None:
        """Make its entries of state, work and loss."""
        ledger.state[work.name] += 0.0
        if stated.varies(work):
            ledger.supplied[work.in_time] += 0.0
        if stated.lost is not None:
            ledger.lost["numerical"] += 0.0

    def begin(self, q0: Array, clock: Clock) -> None:
        """Take note of the step that is to be solved."""
        super().begin(q0, clock)
        self._q0 = q0

    def accept(self, q1: Array, s: Array, force: Array, times: tuple[float, float]) -> None:
        """Enter what the scheme lost, and what a change in time supplied."""
        for lost in self._lost:
            self._ledger.lost["numerical"] += lost.value(q1)
        if self._varies:
            begin, end = times
            self._put(float(acting(self._scheme, np.array(begin), np.array(self._known["t"]))), {})
            moved = self._energy.value(q1) - self._energy.value(self._q0)
            self._put(end, {})
            gained = self._energy.value(q1) - self._held - moved
            self._ledger.supplied[self._work.in_time] += gained

    def add_state(self, q: Array, t: float) -> None:
        """Enter the energy of the accepted state."""
        self._put(t, {})
        self._held = self._energy.value(q)
        self._ledger.state[self._name] += self._held


@contextmanager
def _named(work: Work) -> Iterator[None]:
    """Name the work whose form cannot be compiled."""
    try:
        yield
    except Exception as error:
        raise SceneError(f"{work}: its form cannot be compiled: {shorten(error)}") from error


KINDS: dict[type[Work], type[Acting]] = {VirtualWork: Working, Potential: Storing}


# -- the term ------------------------------------------------------------------------------------


class Works(LoadTerm):
    """Works of a scene on the cells of a process; all processes have the term.

    Virtual works grow in parts of the first step, as loads do; potentials are there.
    """

    def __init__(self, fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr, t0: float) -> None:
        share = fields.share
        grid = share.grid
        super().__init__(share, scheme, ledger)
        self._parts: list[Acting] = []
        for work in grid.scene.works:
            kind = KINDS[type(work)]
            kind.expect(work, statement(work, element_of(grid.mesh), scheme), ledger)
            cells = np.concatenate([grid.cells_of(beam) for beam in work.on(grid.scene.beams)])
            part = np.flatnonzero(np.isin(share.cells, cells))
            if len(part):
                of = fields if len(part) == len(share.cells) else fields.part(part)
                stated = statement(work, of.element, scheme)
                self._parts.append(kind(work, stated, of, scheme, A, ledger))
        self._t, self._grown = t0, 0.0
        self._end = t0, 0.0
        tangents = [part.tangent for part in self._parts if part.tangent is not None]
        self._in_c = [_calls([part.residual for part in self._parts]), _calls(tangents)]
        self._tangents, self._A = tangents, A

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops over the works."""
        force, tangent = (loop("add_calls", calls) for calls, _ in self._in_c)
        return force, tangent

    def begin(self, step: Step) -> None:
        """Tell the works of the step; parts of one go in proportion to the way of the loads."""
        t, part = self._t, step.fraction
        growth = part * (1.0 - self._grown)
        self._end = t + part * (step.motion_time - t), self._grown + growth
        at = t + step.at * part * (step.load_time - t)
        clock = Clock(at, min(step.dt, AT_REST), self._grown + step.at * growth)
        for one in self._parts:
            one.begin(step.q0, clock)

    def carry_on(self, t: float, q: Array, v: Array | None, past: Restoring | None) -> Array:
        """The forces at ``q``; take that state as one that is in equilibrium with them."""
        self._t, self._grown, self._force = t, 1.0, np.zeros_like(self._force)
        # As at the end of a second in which the velocities stayed.
        before, dt = (q, AT_REST) if v is None else (q - v, 1.0)
        for one in self._parts:
            one.begin(before, Clock(t, dt, 1.0))
            self._force = self._force + one.take(one.force(q), past)
        return self._force

    def pass_on(self, memory: Saving) -> None:
        """Save the forces of works that depend on the motion of the last step."""
        for one in self._parts:
            one.pass_on(memory)

    def in_cells(self) -> Sequence[InCells]:
        """The forces of each work."""
        return [InCells(one.form_of_forces, lib.WORK, one.order) for one in self._parts]

    def add_residual(self, q1: Array, r: Array) -> None:
        """Subtract the forces from the residual."""
        for one in self._parts:
            one.residual.add(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Subtract the derivative of the forces from the tangent."""
        for tangent in self._tangents:
            tangent.add(q1, self._A.data)

    def accept(self, q1: Array, s: Array) -> None:
        """Enter what the works did in the step."""
        self._force = np.zeros_like(q1)
        for one in self._parts:
            force = one.force(q1)
            one.accept(q1, s, force, (self._t, self._end[0]))
            self._force += force
        self._t, self._grown = self._end

    def add_state(self, q: Array) -> None:
        """Enter the energies of the potentials."""
        for one in self._parts:
            one.add_state(q, self._t)

    def remember(self, memory: Memory, q: Array) -> None:
        """The time and growth of the works, and their forces in the equation of the last step."""
        self._t = memory.number("time of works", self._t)
        self._grown = memory.number("growth of works", self._grown)
        self._force = memory.added("works", self._force)
        for one in self._parts:
            one.remember(memory)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        for one in self._parts:
            one.add_tangent_change(q1, u)


def _calls(kernels: list[Kernel]) -> tuple[Any, Any]:
    """Argument of ``add_calls`` of loops.h, and what it needs alive."""
    calls = ffi.new("call[]", [loop("add_cells", kernel.cells) for kernel in kernels])
    return ffi.new("calls *", {"number": len(kernels), "part": calls}), calls
