# SPDX-License-Identifier: MIT
"""Virtual works and potentials of a user: forces, tangents, and entries in the ledger."""

from __future__ import annotations

import math
from functools import cached_property, partial
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import ffi, fill, lib, loop, number_view, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel
from ufl_beam.discretization.function_spaces import Fields, element_of
from ufl_beam.discretization.state_io import Archive
from ufl_beam.discretization.work_forms import Statement, statement
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import ModelError, shorten
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.functions import Constant
from ufl_beam.model.works import Potential, Work
from ufl_beam.terms.derivatives import Each, Neighbours, differences, form_derivative, in_c
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, InCells, LoadTerm, Phases, entering


class Acting:
    """Work of a user on those cells of a process on which the work acts.

    Attributes:
        order: Positions of the cells in ``subdomain.cells``.
        residual: Compiled form of the forces with negative sign.
        tangent: Compiled form of the derivative of ``residual``; None if it is zero.
        passes_on: True if a continued run needs the forces of the last step, because these depend
            on rates and do a fraction of the work of the next step.
    """

    def __init__(
        self, work: Work, work_forms: Statement, fields: Fields, scheme: Scheme, A: Csr
    ) -> None:
        self._work, self._forms, self._fields, self._A = work, work_forms, fields, A
        self.order = fields.order
        self.passes_on = work.takes_rates and bool(scheme.weight_of_before)
        self._saved_as = f"work of {work.name}"
        tangent = None if work_forms.tangent.empty() else work_forms.tangent
        forms = work_forms.residual, tangent, work_forms.energy, work_forms.lost
        try:
            made: list[Any] = [form and fields.kernel(form, fields.element.q1) for form in forms]
        except Exception as error:
            raise ModelError(f"{work}: its form cannot be compiled: {shorten(error)}") from error
        self.residual: Kernel = made[0]
        self.tangent, self._energy, self._lost = made[1:]
        if self.tangent is not None:
            self.tangent.place(A)
        self._values: Array = np.full(len(work_forms.parameters), math.nan)
        # Forces of a virtual work in the equation of the last step
        self._before = np.zeros(0 if self._energy else fields.subdomain.size)

    def in_c(self, ledger: Ledger, callbacks: Callbacks) -> Any:
        """Return ``user_work`` of loops.h, with entries of the ledger."""
        work, q0, functions = self._work, self._fields.element.q0, self._forms.parameters.values()
        kernels = [self.residual, self.tangent, self._energy, self._lost]
        forms = [kernel for kernel in kernels if kernel is not None]
        at = [_position(form, function) for form in forms for function in functions]
        values = [x if callable(x) else Constant(x) for x in work.numbers.values()]
        pointers: dict[str, Any] = {}
        if self._energy is None:
            pointers["supplied"] = ledger.supplied.pointer(work.name)
        else:
            _, pointers["energy"] = entering(self._energy, ledger.state.pointer(work.name))
            if self._forms.varies(work):
                pointers["supplied"] = ledger.supplied.pointer(work.in_time)
        if self._lost is not None:
            _, pointers["lost"] = entering(self._lost, ledger.lost.pointer("numerical"))
        return struct(
            "user_work", residual=self.residual.cells, forms=len(forms), numbers=len(functions),
            form=ffi.new("form_of_step[]", [(form.cells, _position(form, q0)) for form in forms]),
            at=np.array(at, dtype=np.int32), number=self._values, before=self._before,
            of_time=callbacks.time_functions([(value, work) for value in values]), **pointers,
        )  # fmt: skip

    def by_q0(self) -> list[Each]:
        """Return the derivative of the forces by the configuration before the step, if any."""
        q0, q1 = self._fields.element.q0, self._fields.element.q1
        kernel = partial(self._fields.kernel, unknown=q1)
        found = form_derivative(self._forms.residual, self.residual, kernel, q0)
        return [] if found is None else [in_c("form", found)]

    def initial_forces(self, q: Array, past: Archive | None) -> Array:
        """Return the forces before the next step, from ``past`` or at ``q``, and store them."""
        force = np.zeros(len(q))
        self.residual.add(q, force)
        if self._energy is not None:
            return -force
        self._before[:] = -force
        if past is not None and past.has(self._saved_as):
            self.save_or_restore(past)
        return self._before

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the forces in the equation of the last step; potentials need none."""
        if self._energy is None:
            self._before[:] = archive.added(self._saved_as, self._before)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        change, direction = self._change
        if change is not None:
            for function, value in zip(self._forms.parameters.values(), self._values, strict=True):
                if change.uses(function):
                    change.put(function, np.array([value]))
            change.set(direction, u)
            change.add(q1, self._A.data)

    @cached_property
    def _change(self) -> tuple[Kernel | None, fem.Function]:
        element = self._fields.element
        u = element.configuration()
        form = expand_derivatives(ufl.derivative(self._forms.tangent, element.q1, u))
        if form.empty():
            return None, u
        change = self._fields.kernel(form, element.q1)
        change.place(self._A)
        return change, u


def _position(form: Kernel, function: fem.Function) -> int:
    """Return the position of the values of ``function`` in ``form``; -1 if it is not used."""
    return form.position(function) if form.uses(function) else -1


# -- the term ------------------------------------------------------------------------------------


class Works(LoadTerm):
    """Works of a user on the cells of a process; every process has this term.

    The ledger has virtual works in ``supplied``, and energies of potentials in ``state``.  Virtual
    works grow in the substeps of the first step, as loads do; potentials act fully from the start.
    """

    def __init__(self, fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr, t0: float) -> None:
        self._ledger = ledger
        subdomain, self._A = fields.subdomain, A
        numbering = subdomain.numbering
        self._works: list[Acting] = []
        for work in numbering.scene.works:
            work_forms = statement(work, element_of(numbering.mesh), scheme)
            # All processes create the entries, even processes without such cells
            potential = isinstance(work, Potential)
            (ledger.state if potential else ledger.supplied)[work.name] += 0.0
            if work_forms.varies(work):
                ledger.supplied[work.in_time] += 0.0
            if work_forms.lost is not None:
                ledger.lost["numerical"] += 0.0
            cells = np.concatenate(
                [numbering.cells_of(beam) for beam in work.on(numbering.scene.beams)]
            )
            positions = np.flatnonzero(np.isin(subdomain.cells, cells))
            if len(positions):
                subset = (
                    fields
                    if len(positions) == len(subdomain.cells)
                    else Fields(subdomain, positions)
                )
                self._works.append(Acting(work, work_forms, subset, scheme, A))
        self._force, space = np.zeros((2, subdomain.size))
        self.vector = struct("vector", size=subdomain.size, values=self._force)
        self._c = struct(
            "user_works", size=subdomain.size, works=len(self._works), t=t0, force=self._force,
            space=space, weight_of_before=scheme.weight_of_before,
        )  # fmt: skip
        tangents = [work.tangent for work in self._works if work.tangent is not None]
        self._calls = [_calls([work.residual for work in self._works]), _calls(tangents)]
        force, tangent = (loop("add_calls", calls) for calls, _ in self._calls)
        self.loops = force, tangent
        self.in_cells = [
            InCells(lambda work=work: work.residual, lib.WORK, work.order)  # type: ignore[misc]
            for work in self._works
        ]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops over the works that begin and accept a step, and enter energies."""
        self._callbacks = callbacks
        self._in_c = [work.in_c(self._ledger, callbacks) for work in self._works]
        fill(self._c, work=ffi.new("user_work *[]", self._in_c))
        begin, accept = loop("begin_works", self._c), loop("accept_works", self._c)
        return Phases([begin], [accept], [loop("add_energy_of_works", self._c)])

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        found = [each for work in self._works for each in work.by_q0()]

        def state_of(term: Works) -> list[Array]:
            return [number_view(term._c, name) for name in ("t", "grown")]

        return [differences(neighbours, state_of), *found]

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the forces before the next step to the forces at ``q``, and return them."""
        self._c.t, self._c.grown = t, 1.0
        # The last step is assumed to take 1 s at constant velocities, in statics infinitely long
        before, dt = (q, math.inf) if v is None else (q - v, 1.0)
        times = {"load_time": t, "motion_time": t, "fraction": 1.0, "at": 1.0}
        step = struct("time_step", q0=before, dt=dt, **times)
        lib.begin_works(self._c, step, ffi.NULL, ffi.NULL)
        self._callbacks.synchronize()
        self._force[:] = sum(work.initial_forces(q, past) for work in self._works)
        return self._force.copy()

    def pass_on(self, archive: Archive) -> None:
        """Save the forces of works that depend on the motion of the last step."""
        for work in self._works:
            if work.passes_on:
                work.save_or_restore(archive)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore time, load factor, and forces in the equation of the last step."""
        self._c.t = archive.number("time of works", self._c.t)
        self._c.grown = archive.number("growth of works", self._c.grown)
        self._force[:] = archive.added("works", self._force)
        for work in self._works:
            work.save_or_restore(archive)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        for work in self._works:
            work.add_tangent_change(q1, u)


def _calls(kernels: list[Kernel]) -> tuple[Any, Any]:
    """Return the argument of ``add_calls`` of loops.h, and an array that must stay alive."""
    calls = ffi.new("call[]", [loop("add_cells", kernel.cells) for kernel in kernels])
    return ffi.new("calls *", {"number": len(kernels), "part": calls}), calls
