"""Cells whose material yields, flows or breaks: the return map between strains and virtual work."""

from __future__ import annotations

import numpy as np
import ufl

from ufl_beam.compat import Array
from ufl_beam.fields import Fields
from ufl_beam.grid import Grid, Index
from ufl_beam.kinematics import strain
from ufl_beam.laws import Layout
from ufl_beam.ledger import Ledger
from ufl_beam.points import Discontinuities, Points
from ufl_beam.schemes import Scheme, Step
from ufl_beam.sparse import Csr


def inelastic_cells(grid: Grid) -> list[tuple[Layout, Index]]:
    """Layouts of material points, and the cells (numbers of the grid) that have them."""
    groups: dict[Layout, list[int]] = {}
    layouts: dict[object, Layout | None] = {}
    for beam in grid.scene.beams:
        laws = grid.hinges(beam)
        for cell, softening in zip(grid.cells_of(beam), laws, strict=True):
            key = (beam.section, softening)
            if key not in layouts:
                layouts[key] = beam.section.layout(softening)
            layout = layouts[key]
            if layout is not None:
                groups.setdefault(layout, []).append(int(cell))
    return [(layout, np.array(cells)) for layout, cells in groups.items()]


def expect_entries(layout: Layout, scheme: Scheme, ledger: Ledger) -> None:
    """Make the entries of the ledger that cells of a layout write, on whatever process."""
    if layout.yields:
        ledger.state["hardening"] += 0.0
        ledger.lost["plastic"] += 0.0
    if layout.softening is not None:
        ledger.lost["hinges"] += 0.0
    if scheme.loss:
        ledger.lost["numerical"] += 0.0


class Strains:
    """(Σ, Γ, K) of the cells of some fields."""

    def __init__(self, fields: Fields) -> None:
        q = fields.configuration()
        z = ufl.TestFunction(fields.stiffness().function_space)
        mean = ufl.dot(strain(q, fields.axis), z) / fields.axis.h
        self._kernel = fields.kernel(mean * fields.dx(1), q)
        self._shape = (len(fields.order), 3)

    def __call__(self, q: Array) -> Array:
        """Strains at ``q``, in the order of the mesh; (num_cells, 3); 1, 1, 1/m."""
        values = np.zeros(self._shape)
        self._kernel.add(q, values.reshape(-1))
        return values


class InelasticBeams:
    """Resultants of cells with material points, working on the virtual strains.

    The points answer the strains of an iterate with resultants and their derivatives; between
    iterates the form knows the resultants r = b + D e as linear in the strains e, so that UFL
    derives the tangent, material and geometric.
    """

    def __init__(
        self, fields: Fields, layout: Layout, scheme: Scheme, A: Csr, ledger: Ledger
    ) -> None:
        self._layout, self._scheme, self._A, self._ledger = layout, scheme, A, ledger
        self._order = fields.order
        self._cells = fields.share.cells[fields.order]
        self._strains = Strains(fields)
        n = len(layout.weights)
        cells = len(fields.order)
        self._variables = {"p": fields.at_points(n), "ξ": fields.at_points(n)}
        length = fields.share.cell_lengths()[fields.order][:, None]
        breaks = None
        if layout.softening is not None:
            m = len(range(n)[layout.breaking])
            self._variables |= {"jump": fields.at_points(m), "opening": fields.at_points(m)}
            breaks = Discontinuities(
                layout.softening,
                layout.breaking,
                self._values("jump"),
                self._values("opening"),
                scheme.resistance,
            )
        self.points = Points(
            layout.bulk(fields.share.grid.keys(self._cells)),
            layout.weights,
            length,
            self._values("p"),
            self._values("ξ"),
            breaks,
            scheme.theta,
        )
        self._length = length[:, 0]
        self._products = np.einsum("n,ni,nj->nij", layout.weights, *[layout.strains] * 2)
        self._products = self._products.reshape(n, 9)
        self._sums = layout.weights[:, None] * layout.strains
        self._rest = np.diag(layout.rest).ravel() * scheme.theta

        q0, q1 = fields.configuration(), fields.configuration()
        b, D = fields.at_points(3), fields.at_points(3, 3)
        w, axis = ufl.TestFunction(fields.space), fields.axis
        r = b + ufl.dot(D, strain(q1, axis))
        work = ufl.dot(r, scheme.virtual_strain(q0, q1, w, axis)) * fields.dx(1)  # P(32)
        tangent = ufl.derivative(work, q1, ufl.TrialFunction(fields.space))
        self._q0, self._b, self._D = q0, b, D
        self._force, self._tangent = (fields.kernel(form, q1) for form in (work, tangent))
        self._tangent.share(self._force)
        self._tangent.place(A)
        self._e0: Array = np.zeros((cells, 3))
        self._e1 = self._e0
        self._at: Array = np.empty(0)

    def _values(self, name: str) -> Array:
        """An internal variable; a view of shape (cells, points)."""
        return np.asarray(self._variables[name].x.array.reshape(len(self._order), -1))

    # -- the step ------------------------------------------------------------------------------

    def begin(self, step: Step) -> None:
        """Remember the strains at the beginning."""
        self._force.set(self._q0, step.q0)
        self._e0 = self._strains(step.q0)
        self.points.begin(self._e0 @ self._layout.strains.T, step.dt)
        self._at = np.empty(0)

    def _respond(self, q1: Array) -> None:
        """Resultants at ``q1`` and their derivatives, into the form."""
        if np.array_equal(q1, self._at):
            return
        self._at = q1.copy()
        self._e1 = e = self._strains(q1)
        σ, E = self.points.respond(e @ self._layout.strains.T)
        D = E @ self._products + self._rest
        mean = (1 - self._scheme.theta) * self._e0 + self._scheme.theta * e
        r = σ @ self._sums + self._layout.rest * mean
        self._force.put(self._b, r - np.einsum("cij,cj->ci", D.reshape(-1, 3, 3), e))
        self._force.put(self._D, D)

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the internal forces."""
        self._respond(q1)
        self._force.add(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Add the stiffness, material and geometric."""
        self._respond(q1)
        self._tangent.add(q1, self._A.data)

    # -- the state -----------------------------------------------------------------------------

    def accept(self, q1: Array, s: Array) -> None:
        """Commit the internal variables."""
        self._respond(q1)
        points, ledger, scheme = self.points, self._ledger, self._scheme
        before = points.worked.sum(), points.broken.sum()
        lost = points.accept(self._e1 @ self._layout.strains.T)
        if self._layout.yields:
            ledger.lost["plastic"] += float(points.worked.sum() - before[0])
        if points.breaks is not None:
            ledger.lost["hinges"] += float(points.broken.sum() - before[1])
        if scheme.loss:
            lost = lost + self._rest_energy(self._e1 - self._e0)
            ledger.lost["numerical"] += 2 * scheme.loss * float(lost.sum())

    def _rest_energy(self, e: Array) -> Array:
        return np.asarray((e**2 @ self._layout.rest) / 2 * self._length)

    def add_state(self, q: Array) -> None:
        """Stored energy."""
        self._ledger.state["stored"] += self.stored(q)
        if self._layout.yields:
            self._ledger.state["hardening"] += float(self.points.hardening_energy().sum())

    def stored(self, q: Array) -> float:
        """Elastic energy of the cells of this process; J."""
        e = self._strains(q)
        energy = self.points.elastic_energy(e @ self._layout.strains.T) + self._rest_energy(e)
        return float(energy.sum())

    # -- what solutions keep -------------------------------------------------------------------

    def write_section_forces(self, q: Array, resultants: Array) -> None:
        """(N, V, M) in the accepted state ``q`` into the rows of the cells; N, N, N m."""
        e = self._strains(q)
        σ = self.points.stress(e @ self._layout.strains.T)
        resultants[self._order] = σ @ self._sums + self._layout.rest * e

    def write_material(self, cells: Array) -> None:
        """Jump of the hinge, and energies dissipated, into the rows of the cells; rad, J, J."""
        points = self.points
        if points.breaks is not None and self._layout.hinges:
            cells[self._order, 0] = points.breaks.jump[:, 0]
        cells[self._order, 1] = points.worked
        cells[self._order, 2] = points.broken

    def _state(self) -> list[Array]:
        """All that the accepted state consists of, by cells of the mesh; views."""
        variables = [self._values(name) for name in self._variables]
        return [*variables, self.points.worked[:, None], self.points.broken[:, None]]

    def state(self) -> tuple[Index, Array]:
        """Cells (numbers of the grid), and their internal variables; (num_cells, k)."""
        return self._cells, np.hstack(self._state())

    def restore(self, cells: Index, rows: Array) -> None:
        """Take over internal variables, of those cells that are here too."""
        _, here, there = np.intersect1d(self._cells, cells, return_indices=True)
        if len(here):
            state = self._state()
            ends = np.cumsum([part.shape[1] for part in state])[:-1]
            for part, new in zip(state, np.split(rows[there], ends, axis=1), strict=True):
                part[here] = new
