# SPDX-License-Identifier: MIT
"""Cells of a subdomain, and the same cells as a mesh of DOLFINx, for forms of a user."""

from __future__ import annotations

import basix.ufl
import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr, zero_matrix
from ufl_beam.compiled.jit import compiled_form
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.dolfinx_compat import cell_coordinates, fem, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.errors import ModelError, shorten
from ufl_beam.mechanics.functional import kinetic_energy, virtual_work
from ufl_beam.mechanics.kinematics import Axis, strain
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import AttachmentPoint
from ufl_beam.model.scene import Scene
from ufl_beam.model.sections import IN_SPACE

STIFFNESS: dict[int, tuple[str, ...]] = {
    2: ("EA", "GA", "EI"), 3: tuple(IN_SPACE.values()),
}  # fmt: skip
"""Stiffnesses of sections in the plane, and for axes 1, 2, 3 of strains and curvatures in space."""

INERTIA: dict[int, tuple[str, ...]] = {2: ("rhoA", "rhoI"), 3: ("rhoA", "rhoI2", "rhoI")}
"""Inertias of sections in the plane and in space."""


class Element:
    """Finite element of the beams on a mesh of cells, and the functions in which forms are written.

    Attributes:
        degree: Polynomial degree of configurations.
        axis: Undeformed axis.
        space: Configurations (u_x, u_y, ψ).
        q0, q1: Configurations at the beginning and at the end of a step.
        w: Test function, the virtual motion.
        stiffness: (EA, GA, EI); N, N, N m².
        inertia: (rhoA, rhoI); kg/m, kg m.
    """

    def __init__(self, mesh: Mesh, cells: meshes.Mesh) -> None:
        self.degree, self._lumped, self._cell = mesh.degree, mesh.lumped, cells
        in_space = cells.geometry.dim == 3
        line = basix.ufl.element("Lagrange", "interval", mesh.degree)
        if not in_space:  # forms in space are no forms of UFL
            along = fem.Function(fem.functionspace(self._cell, ("DG", 1)))
            along.x.array[along.function_space.dofmap.list] = 0.0, 1.0
            self.axis = Axis(self._cell, mesh.nodes, along)
        mixed = basix.ufl.mixed_element([line] * (6 if in_space else 3))
        self.space = fem.functionspace(self._cell, mixed)
        self.q0, self.q1 = self.configuration(), self.configuration()
        self.w = ufl.TestFunction(self.space)
        self.stiffness, self.inertia = (
            fem.Function(fem.functionspace(self._cell, ("DG", 0, (n,))))
            for n in ((6, 3) if in_space else (3, 2))
        )

    def configuration(self) -> fem.Function:
        """Create a configuration (u_x, u_y, ψ)."""
        return fem.Function(self.space)

    def at_points(self, *shape: int) -> fem.Function:
        """Create a function at the points of ``dx(1)``; its values have the shape ``shape``."""
        rule = self._rule(1)
        element = basix.ufl.quadrature_element("interval", value_shape=shape, degree=rule)
        return fem.Function(fem.functionspace(self._cell, element))

    def constant(self, value: float) -> fem.Constant:
        """Create a number that can change without a new compilation of forms."""
        return fem.Constant(self._cell, float(value))

    def dx(self, degree: int) -> ufl.Measure:
        """Return the measure of the cells, of degree ``degree + 2 (p - 1)`` for cells of degree p.

        A form has only one measure, because FFCx 0.9 to 0.11 mixes rules wrongly.
        """
        rule = {"quadrature_degree": self._rule(degree)}
        return ufl.Measure("dx", domain=self._cell, metadata=rule)

    def dx_of_mass(self) -> ufl.Measure:
        """Return the measure of inertia: exact, or for lumped mass with points at the nodes."""
        if not self._lumped:
            return self.dx(2)
        rule = {"quadrature_rule": "GLL", "quadrature_degree": self._rule(1)}
        return ufl.Measure("dx", domain=self._cell, metadata=rule)

    def _rule(self, degree: int) -> int:
        return degree + 2 * (self.degree - 1)


class Fields:
    """Cells of one process, or some of them.

    ``positions`` selects cells by their indices in ``subdomain.cells``; the default is all cells.

    Attributes:
        cell_dofs: Local degrees of freedom of the cells; (num_cells, 3 (degree + 1)).
        order: Index in ``subdomain.cells`` of each cell.
        degree: Degree of the cells.
    """

    def __init__(self, subdomain: Subdomain, positions: Index | None = None) -> None:
        self.subdomain = subdomain
        everywhere = np.arange(len(subdomain.cells), dtype=np.int32)
        whole = positions is None or np.array_equal(positions, everywhere)
        self.order: Index = everywhere if positions is None else positions
        self.cell_dofs = subdomain.cell_dofs if whole else subdomain.cell_dofs[self.order]
        self._matrix: Csr | None = None
        self.degree: int = subdomain.numbering.mesh.degree

    def coordinates(self) -> Array:
        """Return the vertices of the cells; (num_cells, 2, 2); m."""
        numbering = self.subdomain.numbering
        vertices = numbering.cells.take(self.subdomain.cells[self.order], axis=0)
        return np.asarray(numbering.points.take(vertices, axis=0))

    def matrix(self, A: Csr | None = None) -> Csr:
        """Return a zero matrix for the degrees of freedom of this process, or ``A`` if it is given.

        All matrices share the pattern of the first one.
        """
        if A is not None:
            self._matrix = A
            return A
        if self._matrix is None:
            subdomain = self.subdomain
            connectors = subdomain.numbering.scene.all_connectors
            couples = [subdomain.cell_dofs, subdomain.connector_dofs, subdomain.body_dofs]
            couples += [dofs[None] for dofs in subdomain.effect_dofs.values()]
            component = np.array([connectors[i].component for i in subdomain.connectors], int)
            for offset in range(1, component.max(initial=0) + 1):  # forces of a bushing are coupled
                later, force = np.flatnonzero(component >= offset), subdomain.connector_dofs[:, -1]
                couples.append(np.column_stack([force[later], force[later - offset]]))
            self._matrix = zero_matrix(subdomain.size, *couples)
            return self._matrix
        return self._matrix.zeros_like()

    def section_values(self, *names: str) -> Array:
        """Return properties of the sections of the cells, such as EA; (num_cells, properties)."""
        numbering = self.subdomain.numbering
        sections, beam_sections = numbering.sections
        properties = [[getattr(section, name) for name in names] for section in sections]
        beams = numbering.beam_of_cell[self.subdomain.cells[self.order]]
        return np.asarray(np.array(properties).reshape(-1, len(names))[beam_sections[beams]])


def point_masses(scene: Scene) -> list[tuple[AttachmentPoint, float, float]]:
    """List places, masses and rotary inertias of the point masses and the bodies; kg, kg m²."""
    masses = [(mass.place, mass.mass, mass.inertia) for mass in scene.masses]
    return masses + [(body.middle, body.mass, body.inertia) for body in scene.bodies]


# -- the cells as a mesh of DOLFINx ----------------------------------------------------------------


def dofs_of_cells(space: fem.FunctionSpace) -> Index:
    """Return the degrees of freedom of a space in each cell; (num_cells, dofs per cell)."""
    blocks, size = space.dofmap.list, space.dofmap.bs
    return np.asarray(blocks[:, :, None] * size + np.arange(size)).reshape(len(blocks), -1)


def integrated(integral: ufl.Form | Expr, mesh: meshes.Mesh) -> float:
    """Integrate a form without arguments, or a scalar expression, over the cells of a mesh.

    Raises:
        ModelError: ``integral`` is something else, is over facets, or is on another mesh.
    """
    if isinstance(integral, Expr) and not integral.ufl_shape:
        integral = integral * ufl.dx(domain=mesh)
    if not isinstance(integral, ufl.Form) or integral.arguments():
        raise ModelError(
            f"dolfinx.total: {shorten(integral)} must be a form of UFL without test functions, "
            "such as expression * view.dx, or a scalar expression"
        )
    if any(term.integral_type() != "cell" for term in integral.integrals()):
        raise ModelError(
            "dolfinx.total: the form has integrals over facets, which would depend on the number "
            "of processes, because each has its own mesh; integrate over cells, with dx"
        )
    if any(domain != mesh.ufl_domain() for domain in integral.ufl_domains()):
        raise ModelError("dolfinx.total: the form is on another mesh; state it on view.mesh")
    # Integrals are compiled separately, because each compiled form has one quadrature rule.
    forms = (compiled_form(ufl.Form([term]))[0] for term in integral.integrals())
    return float(sum(fem.assemble_scalar(form) for form in forms))


class DolfinxFields(Fields):
    """Cells as a mesh of DOLFINx, with an element on this mesh, so that DOLFINx can assemble.

    Attributes:
        mesh: Mesh of the cells; DOLFINx chooses their order.
    """

    def __init__(self, subdomain: Subdomain, positions: Index | None = None) -> None:
        numbering = subdomain.numbering
        cells = subdomain.cells if positions is None else subdomain.cells[positions]
        vertices, local_vertices = np.unique(numbering.cells[cells], return_inverse=True)
        self.mesh = line_mesh(numbering.points[vertices], local_vertices.reshape(-1, 2))
        order: Index = np.asarray(self.mesh.topology.original_cell_index)
        # The direction of a beam is the order of the vertices in its cells.
        expected = numbering.points[numbering.cells[cells[order]]]
        if not np.array_equal(cell_coordinates(self.mesh)[:, :, : expected.shape[2]], expected):
            raise RuntimeError("this version of DOLFINx reverses cells; please report it")
        super().__init__(subdomain, order if positions is None else positions[order])
        self.element = element = Element(numbering.mesh, self.mesh)
        d = expected.shape[2]
        for function, names in ((element.stiffness, STIFFNESS[d]), (element.inertia, INERTIA[d])):
            dofs = dofs_of_cells(function.function_space)
            function.x.array[dofs] = np.nan_to_num(self.section_values(*names).astype(float))


def beam_forms(
    element: Element, scheme: Scheme
) -> tuple[ufl.Form, ufl.Form, ufl.Form, tuple[fem.Function, ...]]:
    """Return forms of a step: virtual work of the beams, its derivative by q1, and their mass.

    In steps, forces inside beams are the statements of ufl_beam/blocks/beams.py.

    Returns:
        The forms; and functions, zero at first, of imposed strains at both ends of the step (6,),
        and of further resultants b + D e: b (3,) and D (3, 3).
    """
    q0, q1, w, axis = element.q0, element.q1, element.w, element.axis
    imposed, b, D = element.at_points(6), element.at_points(3), element.at_points(3, 3)
    before, now = (ufl.as_vector([imposed[i + k] for k in range(3)]) for i in (0, 3))
    e0, e1, change = strain(q0, axis), strain(q1, axis), ufl.TrialFunction(element.space)
    r = scheme.resultants(element.stiffness, e0 - before, e1 - now, element.constant)
    w_e = scheme.virtual_strain(q0, q1, w, axis)
    work = virtual_work(r + b + ufl.dot(D, e1), w_e) * element.dx(1)
    v = element.configuration()
    energy = kinetic_energy(v, element.inertia) * element.dx_of_mass()
    mass = ufl.derivative(ufl.derivative(energy, v, w), v, change)
    return work, ufl.derivative(work, q1, change), mass, (imposed, b, D)
