# SPDX-License-Identifier: MIT
"""Cells whose material yields, flows or breaks: the return map between strains and virtual work."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, stated
from ufl_beam.discretization.function_spaces import Element, Fields, Strains
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.point_equations import inputs
from ufl_beam.mechanics.tangents import Tangents
from ufl_beam.mechanics.time_schemes import Scheme, Step, has_inertia
from ufl_beam.model.fibres import Layout
from ufl_beam.terms.compiled_points import CompiledPoints
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.in_cells import InCells
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.openings import STIFF, SearchFlags
from ufl_beam.terms.phases import Phases, TimeFunctions, beginning
from ufl_beam.terms.static_tangents import PredictedStrains
from ufl_beam.terms.tangent_derivatives import Cells

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


class InelasticBeams(Cells, ABC):
    """Resultants of cells with material points, working on the virtual strains.

    The points answer the strains of an iterate with resultants r and their derivatives D; around
    it resultants are b + D e, linear in the strains e, from which UFL derives the tangent,
    material and geometric.
    """

    kind = "beams"

    def __init__(
        self, fields: Fields, layout: Layout, scheme: Scheme, A: Csr, ledger: Ledger,
        search: SearchFlags, points: type[Points],
    ) -> None:  # fmt: skip
        self._A, self._ledger = A, ledger
        self._hinges, self._search = layout.hinges, search
        self._predicted = None if has_inertia(scheme) else PredictedStrains(fields)
        self._cells = fields.share.cells[fields.order]
        self._strains = Strains(fields)
        cells, n = len(fields.order), len(layout.weights)
        self._variables = np.zeros((cells, n, len(inputs(layout))))
        self.points = points(
            layout,
            fields.share.grid.keys(self._cells),
            fields.share.cell_lengths()[fields.order],
            scheme,
            self._variables,
            search,
        )

        forms = inelastic_forms(fields.element, scheme)
        self._q0, self._q1 = fields.element.q0, fields.element.q1
        self._b, self._D, self._fields, self._work_form = forms.b, forms.D, fields, forms.around
        self._force, self._tangent = (
            fields.hot_kernel(form, self._q1) for form in (forms.work, forms.tangent)
        )
        self._tangent.place(A)
        self._q: Array = np.empty(0)
        self.must_dissipate = layout.kind.law.must_dissipate
        self._prepare(forms)

    # -- the step ------------------------------------------------------------------------------

    def begin(self, step: Step) -> None:
        """Remember the strains at the beginning."""
        self._force.set(self._q0, step.q0)
        self._tangent.set(self._q0, step.q0)
        self._start_at(step.q0)
        self.points.begin(step.dt)
        if self._predicted is not None:
            self._predicted.begin(step)
        self._begin()

    def restart(self, tangents: Tangents) -> None:
        """Begin to iterate anew, with tangents of this kind."""
        if self._predicted is not None:
            self._predicted.restart(tangents)

    def _start_at(self, q0: Array) -> None:
        """Let the points begin at the strains of a configuration, if they are not there."""
        if q0 is not self._q:
            self._q = q0
            self.points.start(self._strains(q0))

    @abstractmethod
    def _prepare(self, forms: InelasticForms) -> None:
        """Prepare the evaluation; called once."""

    @abstractmethod
    def _begin(self) -> None:
        """Prepare a step."""

    @abstractmethod
    def _respond(self, q1: Array) -> None:
        """Let the points answer the strains at ``q1``."""

    @abstractmethod
    def _forget(self) -> None:
        """Forget the latest response: the points would answer otherwise now."""

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if the law of a point gives energy in the step to ``q1``."""
        self._respond(q1)
        grid = self._fields.share.grid
        self.points.require_dissipation(lambda cell: grid.describe_cell(self._cells[cell]))

    def in_cells(self) -> Sequence[InCells]:
        """The forces of the resultants."""
        return [InCells(lambda: self._force, lib.STRESS, self._fields.order)]

    def change(self, q1: Array) -> float:
        """Energy that cells of this process store and dissipate in the step to ``q1``; J."""
        self._respond(q1)
        return self.points.change()

    def dissipation(self, q1: Array) -> float:
        """Energy that cells of this process dissipate in the step to ``q1``; J."""
        self._respond(q1)
        return self.points.dissipation()

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Resultants around ``q1`` and their derivatives; points go on as they answer."""
        strains = self._strains(q1)
        r, D = self.points.respond(strains)
        self._forget()
        around = r - np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), strains)
        return {self._b: around, self._D: D}

    def about_state(self) -> tuple[Index, Array, Array]:
        """Cells (numbers of the grid), and b, D of resultants b + D e about the accepted state.

        Shapes (num_cells, 3) and (num_cells, 9).  D is that of a step like the last one.
        """
        strains, D = self.points.tangent()
        elastic = np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), strains)
        return self._cells, self.points.kept[:, :3] - elastic, D

    # -- see openings.py -----------------------------------------------------------------------

    @property
    def over(self) -> Array:
        """The :attr:`excess` in an array; (1,)."""
        return self.points.over

    @property
    def excess(self) -> float:
        """Largest excess of a held point over its limit, as a part of it."""
        return self.points.excess

    def release(self, least: float) -> None:
        """Let held points open whose excess is so large."""
        self.points.release(least)
        self._forget()

    def hold(self) -> None:
        """Close again the points that :meth:`release` opened."""
        self.points.hold()

    # -- the state -----------------------------------------------------------------------------

    def accept(self, q1: Array, s: Array) -> None:
        """Commit the internal variables."""
        self._respond(q1)
        self.points.accept()
        self._q = q1
        self.points.enter_losses(self._ledger)

    def add_state(self, q: Array) -> None:
        """Add the stored energy to the ledger."""
        if q is not self._q:
            self._q = q
            strains = self._strains(q)
            self.points.start(strains)
            self.points.refresh(strains)
        self.points.enter_stored(self._ledger)

    def remember(self, memory: Memory, q: Array) -> None:
        """Save or restore the internal variables."""
        self.restore(self._cells, memory.rows("cells", *self.state()))
        self._q = q

    # -- what solutions keep -------------------------------------------------------------------

    def kept(self) -> tuple[Index, Array]:
        """Cells (numbers of the grid), and :attr:`Points.kept` of them; (num_cells, 6); a view."""
        kept = self.points.kept
        return self._cells, kept if self._hinges else kept * self.kept_factors

    @property
    def kept_factors(self) -> Array:
        """Factors of :attr:`Points.kept` in what :meth:`kept` returns; (6,)."""
        return np.ones(6) if self._hinges else KEPT_WITHOUT_JUMP

    def state(self) -> tuple[Index, Array]:
        """Cells (numbers of the grid), and their internal variables; (num_cells, k)."""
        return self._cells, self.points.state()

    def restore(self, cells: Index, rows: Array) -> None:
        """Take over internal variables, of those cells that are here too."""
        _, here, there = np.intersect1d(self._cells, cells, return_indices=True)
        if len(here):
            self.points.restore(here, rows[there])


class CompiledInelasticBeams(InelasticBeams):
    """Cells whose points answer, and whose forms are evaluated, in one loop in C."""

    points: CompiledPoints
    _force: Kernel
    _tangent: Kernel

    def _prepare(self, forms: InelasticForms) -> None:
        share = self._fields.share
        self._latest: Array = np.full(share.size, np.nan)
        self.points.predict()
        self._in_c = struct(
            "inelastic", size=share.size, latest=self._latest, points=self.points.points,
            scene=share.grid.scene.size,
            strains=self._strains.kernel.cells, force=self._force.cells,
            tangent=self._tangent.cells, at_r=self._force.position(forms.r),
            at_b=self._tangent.position(forms.b), at_D=self._tangent.position(forms.D),
        )  # fmt: skip
        if self._predicted is not None:
            forces, last_b, last_D = np.zeros((3, len(self._cells), 9))
            of_tangent = {"forces": forces, "last_b": last_b, "last_D": last_D}
            fill(self._in_c, predicted=self._predicted.c, **of_tangent)

    def _begin(self) -> None:
        self._latest.fill(np.nan)
        self.points.points.predicts = 0

    def _forget(self) -> None:
        self._latest.fill(np.nan)

    def _respond(self, q1: Array) -> None:
        lib.respond_at(self._in_c, doubles(q1))

    def demand(self) -> Loop | None:
        """C function of :meth:`missed`."""
        return loop("missed_by_points", self._in_c) if self.points.points.line else None

    def missed(self, q1: Array, scale: float) -> float:
        """Largest force of a point at ``q1`` that is not that of its strain, over ``scale``."""
        q = doubles(q1)
        return float(lib.missed_by_points(self._in_c, q, q, scale, 0.0))

    def loops(self) -> tuple[Loop, Loop | None]:
        """The points, and two forms."""
        functions = ("add_inelastic_force", "add_inelastic_tangent")
        return loop(functions[0], self._in_c), loop(functions[1], self._in_c)

    def phases(self, times: TimeFunctions) -> Phases | None:
        """Loops over the points."""
        c = struct(
            "inelastic_term", cells=self._in_c, **self.points.in_steps(self._ledger)
        )  # fmt: skip
        begin = [*beginning((self._force, self._tangent), self._q0), loop("begin_inelastic", c)]
        if self._predicted is not None:
            begin.append(self._predicted.beginning())

        def leave(q: Array) -> None:
            self._q = q

        ends = [loop("accept_inelastic", c)], [loop("add_energy_of_points", c)]
        over = self.over if self.points.softens else None
        change = loop("change_of_points", c)
        admits = loop("points_dissipate", c) if self.must_dissipate else None
        return Phases(begin, *ends, change, self._start_at, leave, over, admits)

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the internal forces."""
        lib.add_inelastic_force(self._in_c, doubles(q1), doubles(r))

    def add_tangent(self, q1: Array) -> None:
        """Add the stiffness, material and geometric; see :class:`ElasticBeams`."""
        lib.add_inelastic_tangent(self._in_c, doubles(q1), doubles(self._A.data))


class ReferenceInelasticBeams(InelasticBeams):
    """The same equations as :class:`CompiledInelasticBeams`, line by line."""

    def _prepare(self, forms: InelasticForms) -> None:
        self._forms = forms
        self._last: tuple[Array, Array] = np.empty(0), np.empty(0)

    def _begin(self) -> None:
        """Nothing is kept."""

    def _respond(self, q1: Array) -> None:
        self.points.respond(self._strains(q1))

    def _forget(self) -> None:
        """Nothing is kept."""

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the work of the resultants on the virtual strains, P(34)."""
        self._respond(q1)
        self._force.put(self._forms.r, self.points.r)
        self._force.add(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Add its derivative; in statics with the forces that static_tangents.py explains."""
        self._respond(q1)
        r, D = self.points.r, self.points.D.reshape(-1, 3, 3)
        elastic = np.einsum("kij,kj->ki", D, self.points.strains)
        forces: Array = r
        if (predicted := self._predicted) is not None:
            if predicted.c.begins:
                forces = self.points.kept[:, :3]
            elif not (predicted.c.exact or self._search.flags[STIFF]):
                b, before = self._last
                forces = b + np.einsum("kij,kj->ki", before, predicted(q1))
            self._last = r - elastic, D.copy()
            predicted.take(q1)
        for function, values in ((self._forms.b, forces - elastic), (self._forms.D, self.points.D)):
            self._tangent.put(function, values)
        self._tangent.add(q1, self._A.data)
