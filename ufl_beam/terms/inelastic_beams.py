# SPDX-License-Identifier: MIT
"""Cells whose material yields, flows or breaks: the return map between strains and virtual work."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, Strains
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.fibres import Layout
from ufl_beam.terms.base import InCells
from ufl_beam.terms.cells import Cells, PredictedStrains
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.openings import SearchFlags
from ufl_beam.terms.phases import Callbacks, Phases, beginning

KEPT_WITHOUT_JUMP = np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0])
"""Factors of :attr:`Points.kept` where its jump is a crack of one fibre, and no hinge."""


class InelasticForms(NamedTuple):
    """Virtual work of resultants r; the same of b + D e around an iterate, and its derivative."""

    work: ufl.Form
    around: ufl.Form
    tangent: ufl.Form
    r: fem.Function
    b: fem.Function
    D: fem.Function


@stated
def inelastic_forms(of: Element, scheme: Scheme) -> InelasticForms:
    """Forms of a step of a time scheme."""
    r, b, D = of.at_points(3), of.at_points(3), of.at_points(3, 3)
    w_e, dx = scheme.virtual_strain(of.q0, of.q1, of.w, of.axis), of.dx(1)
    around = virtual_work(b + ufl.dot(D, strain(of.q1, of.axis)), w_e) * dx
    tangent = ufl.derivative(around, of.q1, ufl.TrialFunction(of.space))
    return InelasticForms(virtual_work(r, w_e) * dx, around, tangent, r, b, D)  # P(34)


class InelasticBeams(Cells):
    """Resultants of cells with material points, working on the virtual strains, P(34).

    The points answer the strains of an iterate with resultants r and their derivatives D; around
    it resultants are b + D e, linear in the strains e, from which UFL derives the tangent,
    material and geometric.  One loop in C evaluates points and forms.

    Attributes:
        over: Largest excess of a held point over its limit, as a part of it; (1,).
    """

    kind = "beams"

    def __init__(
        self, fields: Fields, layout: Layout, scheme: Scheme, A: Csr, ledger: Ledger,
        search: SearchFlags,
    ) -> None:  # fmt: skip
        self._A, self._ledger, self._hinges = A, ledger, layout.hinges
        self.predicted = None if has_inertia(scheme) else PredictedStrains(fields)
        self._cells = fields.share.cells[fields.order]
        self._strains = Strains(fields)
        share, lengths = fields.share, fields.share.cell_lengths()[fields.order]
        self.points = Points(layout, share.grid.keys(self._cells), lengths, scheme, search)
        self.points.predict()
        self.over = self.points.over

        forms = inelastic_forms(fields.element, scheme)
        self._q0, self._q1 = fields.element.q0, fields.element.q1
        self._b, self._D, self._fields, self._work_form = forms.b, forms.D, fields, forms.around
        self._force, self._tangent = (
            fields.hot_kernel(form, self._q1) for form in (forms.work, forms.tangent)
        )
        self._tangent.place(A)
        self.must_dissipate = layout.kind.law.must_dissipate

        self._latest: Array = np.full(share.size, np.nan)
        self._in_c = struct(
            "inelastic", size=share.size, latest=self._latest, points=self.points.c,
            scene=share.grid.scene.size,
            strains=self._strains.kernel.cells, force=self._force.cells,
            tangent=self._tangent.cells, at_r=self._force.position(forms.r),
            at_b=self._tangent.position(forms.b), at_D=self._tangent.position(forms.D),
        )  # fmt: skip
        if self.predicted is not None:
            forces, last_b, last_D = np.zeros((3, len(lengths), 9))
            of_tangent = {"forces": forces, "last_b": last_b, "last_D": last_D}
            fill(self._in_c, predicted=self.predicted.c, **of_tangent)
        names = "add_inelastic_force", "add_inelastic_tangent"
        self._loops = loop(names[0], self._in_c), loop(names[1], self._in_c)

    # -- in C ----------------------------------------------------------------------------------

    def demand(self) -> Loop | None:
        """C function of :meth:`missed`."""
        return loop("missed_by_points", self._in_c) if self.points.c.line else None

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the points."""
        c = struct("inelastic_term", cells=self._in_c, **self.points.in_steps(self._ledger))
        begin = [*beginning((self._force, self._tangent), self._q0), loop("begin_inelastic", c)]
        if self.predicted is not None:
            begin.append(self.predicted.beginning)
        ends = [loop("accept_inelastic", c)], [loop("add_energy_of_points", c)]
        opens = {"cells": self._in_c} if self.points.softens else None
        change = loop("change_of_points", c)
        admits = loop("points_dissipate", c) if self.must_dissipate else None
        return Phases(begin, *ends, change, opens, admits)

    # -- the step ------------------------------------------------------------------------------

    def start(self, q: Array) -> None:
        """Let the points begin at the strains of a configuration."""
        strains = self._strains(q)
        self.points.start(strains)
        self.points.refresh(strains)

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if the law of a point gives energy in the step to ``q1``."""
        lib.respond_at(self._in_c, doubles(q1))
        grid = self._fields.share.grid
        self.points.require_dissipation(lambda cell: grid.describe_cell(self._cells[cell]))

    def in_cells(self) -> Sequence[InCells]:
        """The forces of the resultants."""
        return [InCells(lambda: self._force, lib.STRESS, self._fields.order)]

    def dissipation(self, q1: Array) -> float:
        """Energy that cells of this process dissipate in the step to ``q1``; J."""
        lib.respond_at(self._in_c, doubles(q1))
        return self.points.dissipation()

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Resultants around ``q1`` and their derivatives; points go on as they answer."""
        strains = self._strains(q1)
        r, D = self.points.respond(strains)
        self._latest.fill(np.nan)  # the points would answer otherwise now
        around = r - np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), strains)
        return {self._b: around, self._D: D}

    def about_state(self) -> tuple[Index, Array, Array]:
        """Cells (numbers of the grid), and b, D of resultants b + D e about the accepted state.

        Shapes (num_cells, 3) and (num_cells, 9).  D is that of a step like the last one.
        """
        strains, D = self.points.tangent()
        elastic = np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), strains)
        return self._cells, self.points.kept[:, :3] - elastic, D

    # -- the state -----------------------------------------------------------------------------

    def remember(self, memory: Memory, q: Array) -> None:
        """Save or restore the internal variables."""
        self.points.restore(memory.rows("cells", self._cells, self.points.state()))

    def kept(self) -> tuple[Index, Array]:
        """Cells (numbers of the grid), and :attr:`Points.kept` of them; (num_cells, 6); a view."""
        kept = self.points.kept
        return self._cells, kept if self._hinges else kept * KEPT_WITHOUT_JUMP

    @property
    def kept_factors(self) -> Array:
        """Factors of :attr:`Points.kept` in what :meth:`kept` returns; (6,)."""
        return np.ones(6) if self._hinges else KEPT_WITHOUT_JUMP
