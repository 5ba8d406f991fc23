# SPDX-License-Identifier: MIT
"""Forces inside beams: elastic cells, and cells whose material yields, flows or breaks.

Inelastic cells compute resultants by the return map of their material points.  Both kinds of cells
predict strains in the iterations of static steps.  For the analysis of buckling they also compute
works of the tangent and of its derivative.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, cached_forms
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Element, Fields, Strains
from ufl_beam.discretization.state_io import Archive
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import ArgumentError
from ufl_beam.mechanics.functional import elastic_energy, virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.terms.derivatives import (
    Each,
    Neighbours,
    form_derivative,
    form_derivatives,
    in_c,
    shape_derivative,
    shape_derivatives,
)
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.imposed_strains import (
    CellStrains,
    elastic_strains,
    imposed_at_points,
    work_on_imposed_strains,
)
from ufl_beam.terms.material_points import Points
from ufl_beam.terms.term import Callbacks, InCells, Phases, Term, beginning, entering

# -- static steps ----------------------------------------------------------------------------------


@cached_forms
def _linear_strains(element: Element) -> tuple[ufl.Form, fem.Function]:
    """Return weighted strains, linearized about a configuration, and this configuration."""
    about = element.configuration()
    e_about = strain(about, element.axis)
    return element.sampled(e_about + ufl.derivative(e_about, about, element.q1)), about


def predicted_strains(fields: Fields) -> Any:
    """Return ``predicted_strains`` of loops.h, the strains predicted by a static iteration.

    In an iteration nodes move along straight lines, so rotating beams become longer than linearized
    strains predict.  In slender beams the axial forces of this error spoil the next iteration.  The
    tangent therefore uses the forces of the linearized strains, the residual the forces of the
    actual strains.  This is Newton's method for displacements and forces as independent unknowns of
    the functional, with the forces eliminated.  It converges in few iterations at any slenderness.
    The initial guess of a step has the same error, so cells that yield extrapolate the strains of
    the last two states instead.

    Magisano, Leonetti and Garcea, Computer Methods in Applied Mechanics and Engineering 313 (2017).
    """
    form, about = _linear_strains(fields.element)
    kernel = fields.kernel(form, fields.element.q1)
    weights = fields.subdomain.numbering.mesh.point_weights.repeat(3)
    last, change = np.zeros((2, fields.subdomain.size))
    return struct(
        "predicted_strains", size=len(change), of_cell=len(weights), weight=weights,
        about=last, change=change, e=np.zeros((len(fields.order), len(weights))),
        strains=kernel.cells, at_about=kernel.position(about),
    )  # fmt: skip


# -- works of tangents -----------------------------------------------------------------------------


@cached_forms
def _works(work: ufl.Form, q1: fem.Function) -> dict[str, Any]:
    """Return forms of the tangent K by name, with the functions x, y and u in them.

    The forms are the work y·(K x), its derivative along u, and the derivative of K along u.
    """
    x, y, u = (fem.Function(q1.function_space) for _ in range(3))
    tangent = ufl.derivative(work, q1, ufl.TrialFunction(q1.function_space))
    action = ufl.action(ufl.derivative(work, q1, x), y)
    change = ufl.derivative(action, q1, u)
    matrix = ufl.derivative(tangent, q1, u)
    return {"tangent": action, "change": change, "matrix": matrix, "x": x, "y": y, "u": u}


class Cells(Term):
    """Forces in cells, with the work y·(K x) of their tangent K for two displacement vectors.

    The work is a sum over cells, computed from the strains of x and y.  A product with the matrix
    would have the round-off of axial and shear stiffness.  In slender cells this round-off may
    exceed the bending stiffness.
    """

    _work_form: ufl.Form
    _q1: fem.Function
    _fields: Fields
    predicted: Any = None
    """In statics, the :func:`predicted_strains` whose forces are in the tangent; else None."""
    imposed: CellStrains | None = None
    """Imposed strains of the cells; None if there are none."""

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Return the values in cells, at ``q1``, of further functions in the virtual work."""
        return {}

    @cached_property
    def _derivatives(self) -> tuple[dict[str, Any], dict[str, Kernel]]:
        return _works(self._work_form, self._q1), {}

    def _at(self, q1: Array, name: str, **motions: Array) -> Kernel:
        """Return the kernel of a form of :func:`_works` at ``q1``; compile it at the first use."""
        forms, kernels = self._derivatives
        if name not in kernels:
            kernels[name] = self._fields.kernel(forms[name], self._q1, several=False)
            if name == "matrix":
                kernels[name].place(self._A)
        kernel = kernels[name]
        for function, values in self._coefficients(q1).items():
            if kernel.uses(function):
                kernel.put(function, values)
        for motion, values in motions.items():
            kernel.set(forms[motion], values)
        return kernel

    @abstractmethod
    def about_state(self) -> tuple[Index, Array, Array]:
        """Return cells (numbers of the scene), and their b and D, see :func:`section_law`."""

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        self._at(q1, "matrix", u=u).add(q1, self._A.data)

    def tangent_work(self, q1: Array, x: Array, y: Array, u: Array | None = None) -> float:
        """Return y·(K x), J; K is the tangent or, with ``u``, its derivative along ``u``."""
        if u is None:
            return self._at(q1, "tangent", x=x, y=y).value(q1)
        return self._at(q1, "change", u=u, x=x, y=y).value(q1)


def imposed_directions(neighbours: Neighbours) -> Array | None:
    """Return the derivatives of the imposed strains of cells, which steps set; None without."""
    own, others = neighbours.term.imposed, [[x.imposed for x in some] for some in neighbours.terms]
    if own is None:
        if any(other is not None for some in others for other in some):
            raise ArgumentError(
                "differentiate: imposed strains are zero for the value of a parameter; choose "
                "another value"
            )
        return None
    directions: Array = own.differentiate(others)
    return directions


def section_law(groups: Iterable[Cells], numbering: DofNumbering) -> tuple[Array, Array]:
    """Return b and D of the section forces b + D e of cells about the accepted state.

    b + D e are the section forces for strains e at p integration points; b is (num_cells, 3 p), D
    (num_cells, 9 p).  Rows of cells in no group are zero.
    """
    count, points = len(numbering.cells), numbering.mesh.degree
    b, D = np.zeros((count, 3 * points)), np.zeros((count, 9 * points))
    for cells, own_b, own_D in (group.about_state() for group in groups):
        b[cells] += own_b
        D[cells] += own_D
    return b, D


# -- elastic beams ---------------------------------------------------------------------------------


class ElasticForms(NamedTuple):
    """Forms of elastic beams: virtual work, stored energy, and numerical losses of energy."""

    work: ufl.Form
    stored: ufl.Form
    losses: list[ufl.Form]


@cached_forms
def elastic_forms(element: Element, scheme: Scheme, *, imposed: bool = False) -> ElasticForms:
    """Return the forms of elastic cells in a step of a time scheme."""
    q0, q1, w, C, dx = element.q0, element.q1, element.w, element.stiffness, element.dx(1)
    e0, e1 = elastic_strains(element, imposed=imposed)
    r = scheme.resultants(C, e0, e1, element.constant)
    w_e = scheme.virtual_strain(q0, q1, w, element.axis)
    stored = elastic_energy(e1, C) * dx
    lost = 2 * element.constant(scheme.alpha) * elastic_energy(e1 - e0, C) * dx  # P(90)
    return ElasticForms(virtual_work(r, w_e) * dx, stored, [lost] if scheme.alpha else [])


@cached_forms
def _static_tangent(
    element: Element, scheme: Scheme, *, imposed: bool
) -> tuple[ufl.Form, fem.Function]:
    """Return the tangent of elastic cells for forces of given strains, and these strains."""
    q0, q1, C = element.q0, element.q1, element.stiffness
    (e0, e1), e = elastic_strains(element, imposed=imposed), element.at_points(3)
    w_e = scheme.virtual_strain(q0, q1, element.w, element.axis)
    acting = partial(scheme.resultants, C, e0, constant=element.constant)
    change = ufl.TrialFunction(element.space)
    geometric = virtual_work(acting(e), ufl.derivative(w_e, q1, change))
    material = virtual_work(ufl.derivative(acting(e1), q1, change), w_e)
    return (geometric + material) * element.dx(1), e


class ElasticBeams(Cells):
    """Virtual work of the resultants of elastic cells, P(12).

    In statics the tangent uses the forces of the :func:`predicted_strains`.
    """

    kind = "beams"

    def __init__(
        self, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger,
        imposed: CellStrains | None = None,
    ) -> None:  # fmt: skip
        element, self.imposed = fields.element, imposed
        forms = elastic_forms(element, scheme, imposed=imposed is not None)
        q1, tangent = element.q1, None
        if not has_inertia(scheme):
            form, e = _static_tangent(element, scheme, imposed=imposed is not None)
            tangent, self.predicted = fields.kernel(form, q1), predicted_strains(fields)
            tangent.place(A)
            self._static = struct(
                "static_tangent", predicted=self.predicted, tangent=tangent.cells,
                at_e=tangent.position(e),
            )  # fmt: skip
        self._q0, self._q1, self._work_form = element.q0, q1, forms.work
        self._fields, self._A, self._ledger = fields, A, ledger
        if tangent is None:
            force, in_motion = fields.force_and_tangent(forms.work, q1, A)
            slope = loop("add_cells", in_motion.cells)
        else:
            force, slope = fields.kernel(forms.work, q1), loop("add_static_tangent", self._static)
        self._force, self.loops = force, (loop("add_cells", force.cells), slope)
        self._losses = [fields.kernel(form, q1) for form in forms.losses]
        self._step_kernels = [force, *(x for x in self._losses if not x.reuse_values(force))]
        if self._losses:
            ledger.lost["numerical"] += 0.0
        self._stored = fields.kernel(forms.stored, q1)
        self._stored.reuse_values(self._force)
        if tangent is not None:
            self._step_kernels.append(tangent)
        # Without imposed strains, the configurations at both ends of a step determine the forces.
        q0 = self._q0 if imposed is None else None
        self.in_cells = [InCells(lambda: force, lib.STRESS, fields.order, q0=q0)]
        if imposed is None:
            return
        work = fields.kernel(work_on_imposed_strains(element, scheme), q1)
        self._step_kernels.append(work)
        kernels = [*self._step_kernels[:-1], self._stored]
        imposed.enter_forms(kernels, work, imposed_at_points(element))
        if self.predicted is not None:
            fill(self.predicted, imposed=imposed.strains)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        own, function = imposed_directions(neighbours), imposed_at_points(self._fields.element)
        kernel, without = partial(self._fields.kernel, unknown=self._q1), [function]
        found = form_derivatives(
            self._work_form, lambda term: term._force, kernel, self._q0, neighbours, without
        )
        if own is None:
            return found
        f = form_derivative(
            self._work_form, self._force, kernel, function, direction=own.ravel(),
            stride=own[0].size, bar=neighbours.term.imposed.bars,
        )  # fmt: skip
        return [*found, in_c("form", f)]

    def about_state(self) -> tuple[Index, Array, Array]:
        """See the base class."""
        fields = self._fields
        C, n = fields.section_values(fields.element.stiffness), len(fields.order)
        D = np.repeat((C[:, None] * np.eye(3))[:, None], fields.element.degree, axis=1)
        b = np.zeros((n, fields.element.degree, 3))
        if self.imposed is not None:
            b -= C[:, None] * self.imposed.strains[:, :, 1]
        return fields.subdomain.cells[fields.order], b.reshape(n, -1), D.reshape(n, -1)

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        if self.imposed is None:
            return {}
        strains = self.imposed.strains
        return {imposed_at_points(self._fields.element): strains.reshape(len(strains), -1)}

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops over the cells that begin and accept a step, and enter the stored energy."""
        begin, lost = beginning(self._step_kernels, self._q0), self._ledger.lost
        accept = [entering(loss, lost.pointer("numerical")) for loss in self._losses]
        if self.predicted is not None:
            begin = [*begin, loop("begin_static_tangent", self._static)]
        state = entering(self._stored, self._ledger.state.pointer("stored"))
        return Phases(begin, accept, [state], loop("change_of_form", state[1]))


# -- beams with material points --------------------------------------------------------------------

TANGENTS = "committed tangents"
"""Name of the tangents for damping in saved data."""

WITHOUT_JUMP = np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0])
"""Factors of :attr:`Points.recorded` that remove the jump of a fibre in cells without a hinge."""


class InelasticForms(NamedTuple):
    """Forms with resultants r, or with b + D e, which is affine in the strains e."""

    work: ufl.Form  # virtual work of r
    around: ufl.Form  # virtual work of b + D e, linearized at an iterate
    tangent: ufl.Form  # derivative of ``around``
    r: fem.Function
    b: fem.Function
    D: fem.Function


@cached_forms
def inelastic_forms(element: Element, scheme: Scheme) -> InelasticForms:
    """Return the forms of inelastic cells in a step of a time scheme."""
    r, b, D = element.at_points(3), element.at_points(3), element.at_points(3, 3)
    w_e, dx = scheme.virtual_strain(element.q0, element.q1, element.w, element.axis), element.dx(1)
    around = virtual_work(b + ufl.dot(D, strain(element.q1, element.axis)), w_e) * dx
    tangent = ufl.derivative(around, element.q1, ufl.TrialFunction(element.space))
    return InelasticForms(virtual_work(r, w_e) * dx, around, tangent, r, b, D)  # P(34)


class InelasticBeams(Cells):
    """Virtual work of the resultants of cells with material points, P(34).

    At each Gauss point, the points map strains of an iterate to resultants r and their derivatives
    D.  UFL derives the material and the geometric tangent from b + D e, the resultants linearized
    in the strains e about the iterate.  C evaluates points and forms.

    Attributes:
        recorded_factors: Factors of :attr:`Points.recorded` in :meth:`recorded`; (6,).
    """

    kind = "beams"

    def __init__(
        self, fields: Fields, section_points: SectionPoints, scheme: Scheme, A: Csr, ledger: Ledger,
        search: Index, imposed: CellStrains | None = None,
    ) -> None:  # fmt: skip
        self._A, self._ledger, self.imposed = A, ledger, imposed
        self.recorded_factors = np.ones(6) if section_points.hinges else WITHOUT_JUMP
        self.predicted = None if has_inertia(scheme) else predicted_strains(fields)
        self._cells = fields.subdomain.cells[fields.order]
        # Rows of saved states: other points of the same cells have other rows.
        self._rows = self._cells + section_points.number * len(fields.subdomain.numbering.cells)
        self._strains = Strains(fields)
        subdomain, numbering = fields.subdomain, fields.subdomain.numbering
        lengths, keys = numbering.section_lengths(self._cells), numbering.keys(self._cells)
        self.points = Points(section_points, keys, lengths, scheme, search, predicts=True)

        forms = inelastic_forms(fields.element, scheme)
        self._q0, self._q1 = fields.element.q0, fields.element.q1
        self._b, self._D, self._fields, self._work_form = forms.b, forms.D, fields, forms.around
        self._force, self._tangent = (
            fields.kernel(form, self._q1) for form in (forms.work, forms.tangent)
        )
        self._force_form, self._r = forms.work, forms.r
        self._tangent.place(A)
        self.must_dissipate = section_points.kind.law.must_dissipate

        self._latest: Array = np.full(subdomain.size, np.nan)
        self._in_c = struct(
            "inelastic", size=subdomain.size, latest=self._latest, points=self.points.c,
            scene=numbering.scene.size, in_cell=numbering.mesh.degree,
            weight=numbering.mesh.point_weights, strains=self._strains.kernel.cells,
            force=self._force.cells, tangent=self._tangent.cells,
            at_r=self._force.position(forms.r),
            at_b=self._tangent.position(forms.b), at_D=self._tangent.position(forms.D),
        )  # fmt: skip
        if self.predicted is not None:
            forces, last_b, last_D = np.zeros((3, len(lengths), 9))
            tangents = {"forces": forces, "last_b": last_b, "last_D": last_D}
            fill(self._in_c, predicted=self.predicted, **tangents)
        if imposed is not None:
            imposed.enter_points(self._in_c)
            fill(self._in_c, imposed=imposed.strains)
            if self.predicted is not None:
                fill(self.predicted, imposed=imposed.strains)
        names, force = ("add_inelastic_force", "add_inelastic_tangent"), self._force
        self.loops = loop(names[0], self._in_c), loop(names[1], self._in_c)
        self.in_cells = [InCells(lambda: force, lib.STRESS, fields.order)]
        if self.points.c.line:
            self.law_residual = loop("missed_by_points", self._in_c)

    # -- in C ----------------------------------------------------------------------------------

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops over the points that begin and accept a step, and enter energies."""
        c = struct(
            "inelastic_term", points=self.points.c, cells=self._in_c,
            **self.points.in_steps(self._ledger),
        )  # fmt: skip
        begin = [*beginning((self._force, self._tangent), self._q0), loop("begin_inelastic", c)]
        if self.predicted is not None:
            begin.append(loop("begin_predicted_strains", self.predicted))
        ends = [loop("accept_inelastic", c)], [loop("add_energy_of_points", c)]
        opens = {"points": self.points.c, "cells": self._in_c} if self.points.softens else None
        change = loop("change_of_points", c)
        admits = loop("points_dissipate", c) if self.must_dissipate else None
        return Phases(begin, *ends, change, opens, admits)

    def describe(self, place: int) -> str:
        """Return the cell of a material point."""
        points, numbering = int(self.points.c.of_cell), self._fields.subdomain.numbering
        cell = int(self._cells[place // points // numbering.mesh.degree])
        return str(numbering.describe_cell(cell))

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        kernel, strains = partial(self._fields.kernel, unknown=self._q1), self._strains
        by_q1 = form_derivative(strains.form, strains.kernel, kernel, self._q1)
        strains_of, size = (lambda term: term._strains.kernel), self.points.r.size
        shape = shape_derivative(strains_of, neighbours, size)
        at = {"cells": self._in_c, "strains": by_q1, "shape": shape}
        if (imposed := imposed_directions(neighbours)) is not None:
            at |= {"imposed": imposed, "imposed_bar": neighbours.term.imposed.bars}
        points = self.points.derivatives(neighbours, "points", **at)
        force = partial(form_derivative, self._force_form, self._force, kernel)
        by_r = force(self._r, direction=points.r, stride=0, bar=points.r_bar)
        by_q0 = [in_c("form", f) for f in [force(self._q0)] if f is not None]
        moving = shape_derivatives(lambda term: term._force, neighbours)
        return [in_c("points", points), in_c("form", by_r), *by_q0, *moving]

    # -- the step ------------------------------------------------------------------------------

    def start(self, q: Array) -> None:
        """Set the accepted strains of the points to the strains at ``q``, without a step."""
        strains = self._elastic_strains(q)
        self.points.start(strains)
        self.points.refresh(strains)
        self.points.start_tangents()

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a point generates energy in the step to ``q1``."""
        lib.respond_at(self._in_c, doubles(q1))
        numbering = self._fields.subdomain.numbering
        self.points.require_dissipation(
            lambda i: numbering.describe_cell(self._cells[i // numbering.mesh.degree])
        )

    def dissipation(self, q1: Array) -> float:
        """Return the energy that cells of this process dissipate in the step to ``q1``; J."""
        lib.respond_at(self._in_c, doubles(q1))
        return self.points.dissipation()

    def _coefficients(self, q1: Array) -> dict[fem.Function, Array]:
        """Return b and D about ``q1``; this replaces the latest response of the points."""
        r, D = self.points.return_map(self._elastic_strains(q1))
        self._latest.fill(np.nan)  # the latest response belongs to other unknowns
        whole = self._strains(q1).reshape(-1, 3)
        around = r - np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), whole)
        n = len(self._cells)
        return {self._b: around.reshape(n, -1), self._D: D.reshape(n, -1)}

    def _elastic_strains(self, q: Array) -> Array:
        """Return the strains at ``q`` minus the imposed strains at the end of the step; (n, 3)."""
        strains = self._strains(q).reshape(-1, 3)
        return strains if self.imposed is None else strains - self.imposed.now

    def about_state(self) -> tuple[Index, Array, Array]:
        """See the base class; D is for a step with the length of the last step."""
        strains, D = self.points.tangent()
        if self.imposed is not None:
            strains += self.imposed.now
        elastic = np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), strains)
        b, n = self.points.recorded[:, :3] - elastic, len(self._cells)
        return self._cells, b.reshape(n, -1), D.reshape(n, -1)

    # -- the state -----------------------------------------------------------------------------

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the internal variables, and tangents for damping."""
        state, tangents = self.points.state(), self.points.committed
        rows = archive.rows("cells", self._rows, state.reshape(len(self._rows), -1))
        self.points.restore(rows.reshape(state.shape))
        if tangents is not None:
            rows = archive.rows(TANGENTS, self._rows, tangents.reshape(len(self._rows), -1))
            tangents[:] = rows.reshape(tangents.shape)

    def keep_tangents(self) -> tuple[Index, Array]:
        """Let the points store tangents for damping; return positions of the cells, and tangents.

        The tangents are (num_cells, 9 p) at p integration points; C updates them.
        """
        self.points.keep_tangents()
        assert self.points.committed is not None
        order = self._fields.order.astype(np.int32)
        return order, self.points.committed.reshape(len(order), -1)

    def recorded(self) -> tuple[Index, Array]:
        """Return cells (scene numbers), and :attr:`Points.recorded`; (num_cells, degree, 6)."""
        recorded = self.points.recorded * self.recorded_factors
        return self._cells, recorded.reshape(len(self._cells), -1, recorded.shape[1])
