# SPDX-License-Identifier: MIT
"""Finite element of the beams, with which forms are written, and the cells of a subdomain.

Forms do not depend on a scene: they are defined on one cell and compiled once per process.
Integrals of a user and the reference solver need a DOLFINx mesh with the cells of a scene.
"""

from __future__ import annotations

from functools import cached_property

import basix.ufl
import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.csr import Csr, zero_matrix
from ufl_beam.compiled.jit import compiled_form
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.compiled_forms import Kernel, cached_forms
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.dolfinx_compat import cell_coordinates, fem, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.errors import ModelError, shorten
from ufl_beam.mechanics.functional import kinetic_energy
from ufl_beam.mechanics.kinematics import Axis, strain
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import AttachmentPoint
from ufl_beam.model.scene import Scene


class Element:
    """Finite element of the beams, and the functions in which forms are written.

    By default, forms are defined on one cell and compiled once for all scenes.  With ``cells``, the
    mesh of a scene, forms are defined on this mesh, and DOLFINx can assemble them.

    Attributes:
        degree: Polynomial degree of configurations.
        axis: Undeformed axis at the points of ``dx(1)``.
        anywhere: Undeformed axis at the points of any quadrature rule.
        space: Configurations (u_x, u_y, ψ).
        q0, q1: Configurations at the beginning and at the end of a step.
        w: Test function, the virtual motion.
        stiffness: (EA, GA, EI); N, N, N m².
        inertia: (rhoA, rhoI); kg/m, kg m.
    """

    def __init__(self, mesh: Mesh, cells: meshes.Mesh | None = None) -> None:
        self.degree, self._lumped = mesh.degree, mesh.lumped
        unit_cell = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]])
        self._cell = cells or line_mesh(*unit_cell)
        line = basix.ufl.element("Lagrange", "interval", mesh.degree)
        along = fem.Function(fem.functionspace(self._cell, ("DG", 1)))
        along.x.array[along.function_space.dofmap.list] = 0.0, 1.0
        self.anywhere = Axis(self._cell, mesh.nodes, along)
        self.axis = self.anywhere if mesh.degree > 1 else Axis(self._cell, mesh.nodes, 0.5)
        self.space = fem.functionspace(self._cell, basix.ufl.mixed_element([line, line, line]))
        self.q0, self.q1 = self.configuration(), self.configuration()
        self.w = ufl.TestFunction(self.space)
        self.stiffness, self.inertia = (
            fem.Function(fem.functionspace(self._cell, ("DG", 0, (n,)))) for n in (3, 2)
        )

    def configuration(self) -> fem.Function:
        """Create a configuration (u_x, u_y, ψ)."""
        return fem.Function(self.space)

    def in_cells(self, *shape: int) -> fem.Function:
        """Create a function that is constant in each cell; its values have the shape ``shape``."""
        return fem.Function(fem.functionspace(self._cell, ("DG", 0, shape)))

    def at_points(self, *shape: int) -> fem.Function:
        """Create a function at the points of ``dx(1)``; its values have the shape ``shape``."""
        rule = self._rule(1)
        element = basix.ufl.quadrature_element("interval", value_shape=shape, degree=rule)
        return fem.Function(fem.functionspace(self._cell, element))

    def sampled(self, values: Expr) -> ufl.Form:
        """Return a linear form whose cell vector has ``values`` (3,) times weights of sum 1."""
        z = ufl.TestFunction(self.at_points(3).function_space)
        return ufl.dot(values, z) / self.axis.h * self.dx(1)

    def constant(self, value: float) -> fem.Constant:
        """Create a number that can change without a new compilation of forms."""
        return fem.Constant(self._cell, float(value))

    def dx(self, degree: int) -> ufl.Measure:
        """Return the measure of the cells; a form has only one measure, see compiled_forms.py.

        The quadrature has the degree ``degree + 2 (p - 1)`` for cells of degree p.
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


def element_of(mesh: Mesh) -> Element:
    """Return the element of a mesh, defined on one cell; it does not depend on ``refine``."""
    return _element(mesh.degree, mesh.lumped)


@cached_forms
def _element(degree: int, lumped: bool) -> Element:
    return Element(Mesh(degree=degree, lumped=lumped))


@cached_forms
def derivative(work: ufl.Form, q1: fem.Function) -> ufl.Form:
    """Return the derivative of a virtual work with respect to ``q1``."""
    return ufl.derivative(work, q1, ufl.TrialFunction(q1.function_space))


@cached_forms
def applied(form: ufl.Form, q1: fem.Function) -> ufl.Form:
    """Return the product of a bilinear form and a vector, the unknown ``q1``."""
    return ufl.action(form, q1)


class Fields:
    """Cells of one process, or some of them, on which forms of the element are evaluated.

    Loops in C evaluate the forms, which are compiled once for all scenes.  ``positions`` selects
    cells by their indices in ``subdomain.cells``; the default is all cells.

    Attributes:
        cell_dofs: Local degrees of freedom of the cells; (num_cells, 3 (degree + 1)).
        order: Index in ``subdomain.cells`` of each cell.
        element: Element with which the forms are written.
    """

    def __init__(self, subdomain: Subdomain, positions: Index | None = None) -> None:
        self.subdomain = subdomain
        everywhere = np.arange(len(subdomain.cells), dtype=np.int32)
        whole = positions is None or np.array_equal(positions, everywhere)
        self.order: Index = everywhere if positions is None else positions
        self.cell_dofs = subdomain.cell_dofs if whole else subdomain.cell_dofs[self.order]
        self._matrix: Csr | None = None
        self.element = element_of(subdomain.numbering.mesh)

    def kernel(
        self, form: ufl.Form, unknown: fem.Function, cell_dofs: Index | None = None, *,
        several: bool = True,
    ) -> Kernel:  # fmt: skip
        """Compile a form for the cells, with the properties of their sections.

        Args:
            form: Cell integrals with one quadrature rule.
            unknown: The configuration that is an argument of :meth:`Kernel.add`.
            cell_dofs: Degrees of freedom of the unknown, by default :attr:`cell_dofs`.
            several: Whether to compute several cells at once, if possible.
        """
        dofs = self.cell_dofs if cell_dofs is None else cell_dofs
        batched = self._batched_coordinates if several else None
        kernel = Kernel(form, unknown, dofs, self.coordinates(), batched)
        for function in (self.element.stiffness, self.element.inertia):
            if kernel.uses(function):
                kernel.put(function, self.section_values(function))
        return kernel

    def coordinates(self) -> Array:
        """Return the vertices of the cells; (num_cells, 2, 2); m."""
        numbering = self.subdomain.numbering
        vertices = numbering.cells.take(self.subdomain.cells[self.order], axis=0)
        return np.asarray(numbering.points.take(vertices, axis=0))

    @cached_property
    def _batched_coordinates(self) -> Array:
        return in_batches(self.coordinates(), BATCH)

    def matrix(self) -> Csr:
        """Create a zero matrix for the degrees of freedom of this process."""
        if self._matrix is None:
            subdomain = self.subdomain
            connectors = subdomain.numbering.scene.all_connectors
            couples = [subdomain.cell_dofs, subdomain.connector_dofs, subdomain.body_dofs]
            couples += [dofs[None] for dofs in subdomain.effect_dofs.values()]
            component = np.array(
                [connectors[i].component for i in subdomain.connectors], dtype=np.int32
            )
            for offset in range(1, component.max(initial=0) + 1):  # forces of a bushing are coupled
                later, force = np.flatnonzero(component >= offset), subdomain.connector_dofs[:, 6]
                couples.append(np.column_stack([force[later], force[later - offset]]))
            self._matrix = zero_matrix(subdomain.size, *couples)
            return self._matrix
        return self._matrix.zeros_like()

    def assembled(self, form: ufl.Form) -> Csr:
        """Assemble a bilinear form at the undeformed configuration into a new matrix."""
        matrix = self.matrix()
        kernel = self.kernel(form, self.element.q1, several=False)
        kernel.place(matrix)
        kernel.add(np.zeros(self.subdomain.size), matrix.data)
        return matrix

    def section_values(self, function: fem.Function) -> Array:
        """Return values of ``element.stiffness`` or ``element.inertia``; (num_cells, 3 or 2)."""
        numbering = self.subdomain.numbering
        names = ("rhoA", "rhoI") if function is self.element.inertia else ("EA", "GA", "EI")
        sections, beam_sections = numbering.sections
        properties = [[getattr(section, name) for name in names] for section in sections]
        beams = numbering.beam_of_cell[self.subdomain.cells[self.order]]
        return np.asarray(np.array(properties).reshape(-1, len(names))[beam_sections[beams]])


@cached_forms
def mass_form(element: Element) -> ufl.Form:
    """Return the mass of the beams as a bilinear form; kg, kg m²."""
    v = element.configuration()
    momentum = ufl.derivative(
        kinetic_energy(v, element.inertia) * element.dx_of_mass(), v, element.w
    )
    return ufl.derivative(momentum, v, ufl.TrialFunction(element.space))  # P(67)


def mass_kernel(fields: Fields) -> Kernel:
    """Compile the product of the mass matrix of the beams and a vector, the unknown ``q1``."""
    q1 = fields.element.q1
    return fields.kernel(applied(mass_form(fields.element), q1), q1)


def point_masses(scene: Scene) -> list[tuple[AttachmentPoint, float, float]]:
    """List places, masses and rotary inertias of the point masses and the bodies; kg, kg m²."""
    masses = [(mass.place, mass.mass, mass.inertia) for mass in scene.masses]
    return masses + [(body.middle, body.mass, body.inertia) for body in scene.bodies]


def mass_matrix(fields: Fields) -> Csr:
    """Assemble the mass matrix of the beams, the point masses and the bodies."""
    subdomain, M = fields.subdomain, fields.assembled(mass_form(fields.element))
    masses = point_masses(subdomain.numbering.scene)
    nodes = [subdomain.numbering.node(place) for place, *_ in masses]
    dofs = np.array(nodes, dtype=np.int32).ravel()
    mine = subdomain.owns(dofs)
    local_dofs = subdomain.local(dofs[mine])
    values = np.array([(mass, mass, inertia) for _, mass, inertia in masses]).ravel()[mine]
    np.add.at(M.data, M.positions(local_dofs, local_dofs), values)  # a node may have several
    return M


@cached_forms
def _weighted_strains(element: Element) -> ufl.Form:
    return element.sampled(strain(element.q1, element.axis))


class Strains:
    """Strains (Σ, Γ, K) at the quadrature points of the cells.

    Attributes:
        form: Form of the strains times their quadrature weights.
        kernel: The form on all cells.
        weights: Quadrature weight of each strain of a cell.
    """

    def __init__(self, fields: Fields) -> None:
        self.form = _weighted_strains(fields.element)
        self.kernel = fields.kernel(self.form, fields.element.q1)
        self.weights = np.repeat(fields.subdomain.numbering.mesh.point_weights, 3)
        self.shape = (len(fields.order), len(self.weights))

    def __call__(self, q: Array) -> Array:
        """Compute strains at ``q``, point after point; (num_cells, 3 * degree); 1, 1, 1/m."""
        return np.asarray(self._weighted(q) / self.weights)

    def mean(self, q: Array) -> Array:
        """Compute the mean strains of the cells at ``q``; (num_cells, 3); 1, 1, 1/m."""
        in_points = self._weighted(q).reshape(self.shape[0], self.shape[1] // 3, 3)
        return np.asarray(in_points.sum(axis=1))

    def _weighted(self, q: Array) -> Array:
        strains = np.zeros(self.shape)
        self.kernel.add(q, strains)
        return strains


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
        numbering, cells = (
            subdomain.numbering,
            subdomain.cells if positions is None else subdomain.cells[positions],
        )
        vertices, local_vertices = np.unique(numbering.cells[cells], return_inverse=True)
        self.mesh = line_mesh(numbering.points[vertices], local_vertices.reshape(-1, 2))
        order: Index = np.asarray(self.mesh.topology.original_cell_index)
        # The direction of a beam is the order of the vertices in its cells.
        expected = numbering.points[numbering.cells[cells[order]]]
        if not np.array_equal(cell_coordinates(self.mesh)[:, :, :2], expected):
            raise RuntimeError("this version of DOLFINx reverses cells; please report it")
        super().__init__(subdomain, order if positions is None else positions[order])
        self.element = element = Element(numbering.mesh, self.mesh)
        for function in (element.stiffness, element.inertia):
            dofs = dofs_of_cells(function.function_space)
            function.x.array[dofs] = self.section_values(function)
