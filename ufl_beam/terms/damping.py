# SPDX-License-Identifier: MIT
"""Damping forces: those of the records of damping.py, and those of a scheme that decays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import lib, loop, struct
from ufl_beam.compiled.csr import Csr, StepProduct
from ufl_beam.discretization.compiled_forms import Kernel, stated
from ufl_beam.discretization.function_spaces import (
    Element,
    Fields,
    Strains,
    applied,
    mass_kernel,
    mass_matrix,
)
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.energy_momentum import DecayingMidpoint
from ufl_beam.mechanics.functional import resultants, virtual_work
from ufl_beam.mechanics.kinematics import strain, virtual_strain
from ufl_beam.mechanics.time_schemes import Scheme, with_half_tangents
from ufl_beam.model.damping import KelvinVoigt, Rayleigh
from ufl_beam.terms.base import InCells, Term
from ufl_beam.terms.cells import OfForms
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.phases import Callbacks, Phases, knowing
from ufl_beam.terms.rates_in_c import RatesInC


def _work_and_loss(
    of: Element, scheme: Scheme | DecayingMidpoint, factor: Expr, before: Expr
) -> tuple[ufl.Form, ufl.Form]:
    """Forms of resultants ``factor C (Δe - before)``, Δe being the changes of the strains."""
    change = strain(of.q1, of.axis) - strain(of.q0, of.axis)
    r = factor * resultants(change - before, of.stiffness)
    w_e = scheme.virtual_strain(of.q0, of.q1, of.w, of.axis)
    return virtual_work(r, w_e) * of.dx(1), virtual_work(r, change) * of.dx(1)


@stated
def _viscous_forms(of: Element, scheme: Scheme) -> tuple[ufl.Form, ufl.Form, fem.Function]:
    """Virtual work, the energy lost, and the time over that of the step."""
    rate = of.at_points()
    return *_work_and_loss(of, scheme, rate, ufl.zero(3)), rate


class KelvinVoigtForces(OfForms):
    """Resultants in proportion to the rates of the strains, P(89) with a weight of time over dt."""

    kind = _entry = "damping"

    def __init__(
        self, damping: KelvinVoigt, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger
    ) -> None:
        work, lost, self._rate = _viscous_forms(fields.element, scheme)
        super().__init__(work, [lost], fields, A, ledger)
        self._time, self._dt = damping.time, np.zeros(1)

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the cells; the step is a number of the forms."""
        begin, accept, *_ = super().phases(callbacks)
        c = struct(
            "viscous_forms", **knowing(self._of_step, self._rate), of_cell=len(self._rate.x.array),
            time=self._time, dt=self._dt,
        )  # fmt: skip
        return Phases([*begin, loop("begin_viscous_forms", c)], accept)


@stated
def _reference_stiffness(of: Element) -> ufl.Form:
    rest = of.configuration()
    e, w_e = (virtual_strain(rest, w, of.axis) for w in (ufl.TrialFunction(of.space), of.w))
    return virtual_work(resultants(e, of.stiffness), w_e) * of.dx(1)


class RayleighForces(Term):
    """A constant matrix times the velocity of the step, P(92)."""

    kind = "damping"

    def __init__(
        self, damping: Rayleigh, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger,
        rates: RatesInC,
    ) -> None:  # fmt: skip
        self._damping, self._fields = damping, fields
        C, M = fields.matrix(), mass_matrix(fields)
        K = fields.assembled(_reference_stiffness(fields.element))
        C.data[:] = damping.mass * M.data + damping.stiffness * K.data  # P(92)
        rotations = with_half_tangents(scheme, fields.share.rotations())
        self._times = StepProduct(C, rotations, A, fields.share.scratch)
        self._loops = self._times.loops
        self._ledger, self._rates, self._A = ledger, rates, A

    def in_cells(self) -> Sequence[InCells]:
        """Both matrices of the beams times the velocities of the step."""
        fields, damping, of = self._fields, self._damping, self._fields.element
        at = fields.order, self._times.rate

        def stiffness() -> Kernel:
            return fields.hot_kernel(applied(_reference_stiffness(of), of.q1), of.q1)

        return [
            InCells(stiffness, lib.STRESS, *at, damping.stiffness),
            InCells(partial(mass_kernel, fields), lib.DENSITY, *at, damping.mass),
        ]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the matrix and the velocities."""
        of = self._rates.times(self._times, lost=self._ledger.lost.pointer("damping"))
        return Phases([loop("begin_rayleigh", of)], [loop("accept_rayleigh", of)])


def damping_forces(
    of: Rayleigh | KelvinVoigt, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger,
    rates: RatesInC | None,
) -> list[Term]:  # fmt: skip
    """Forces of one kind of damping on the cells of a process; none if it has no such cells."""
    ledger.lost["damping"] += 0.0
    if isinstance(of, Rayleigh):
        if rates is None:
            raise SceneError(
                "Rayleigh: it damps vibrations, in proportion to mass, too, and statics has none; "
                "use KelvinVoigt, which acts in the time of a static run"
            )
        return [RayleighForces(of, fields, scheme, A, ledger, rates)]
    grid = fields.share.grid
    beams = grid.scene.beams if of.beams is None else of.beams
    pairs = (zip(grid.cells_of(beam), grid.hinges(beam), strict=True) for beam in beams)
    cells = [cell for of_beam in pairs for cell, hinge in of_beam if hinge is None]
    part = np.flatnonzero(np.isin(fields.share.cells, cells))
    if not len(part):
        return []
    return [KelvinVoigtForces(of, fields.part(part), scheme, A, ledger)]


# -- of schemes ----------------------------------------------------------------------------------


@stated
def _change_forms(of: Element, scheme: DecayingMidpoint) -> tuple[ufl.Form, ufl.Form, fem.Function]:
    """Virtual work, the energy lost, and the changes of the strains in the step before."""
    before = of.at_points(3)
    return *_work_and_loss(of, scheme, of.constant(scheme.part), before), before


class SecondDifferences(OfForms):
    """Resultants c C (Δe - r Δe'), see :class:`DecayingMidpoint`."""

    kind, _entry = "beams", "numerical"

    def __init__(self, scheme: DecayingMidpoint, fields: Fields, A: Csr, ledger: Ledger) -> None:
        work, lost, self._before = _change_forms(fields.element, scheme)
        super().__init__(work, [lost], fields, A, ledger)
        self._strains = Strains(fields)
        self._cells = fields.share.cells[fields.order]
        self._e, self._change = np.zeros((2, *self._strains.shape))
        self._last_dt = np.full(1, math.inf)

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the cells and their strains."""
        begin, accept, *_ = super().phases(callbacks)
        c = struct(
            "second_differences", strains=self._strains.kernel.cells, weight=self._strains.weights,
            of_cell=len(self._strains.weights), **knowing(self._of_step, self._before), e=self._e,
            change=self._change, space=np.zeros(self._e.shape), last_dt=self._last_dt,
        )  # fmt: skip
        before, after = (loop(f"{name}_second_differences", c) for name in ("begin", "accept"))
        return Phases([*begin, before], [*accept, after])

    def start(self, q: Array) -> None:
        """Take the strains at ``q``."""
        self._e[:] = self._strains(q)

    def remember(self, memory: Memory, q: Array) -> None:
        """The changes of the strains in the last step, and its length."""
        # The length is in the rows: the process that says numbers for all may have no such cells.
        rows = np.column_stack([self._change, np.full(len(self._change), self._last_dt)])
        rows = memory.rows("changes of strains", self._cells, rows)
        self._change[:], self._last_dt[0] = rows[:, :-1], rows[0, -1]
        self.start(q)
