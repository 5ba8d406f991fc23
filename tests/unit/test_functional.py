# SPDX-License-Identifier: MIT
"""The functional on its page: its Euler equations, and that what runs is made of it."""

import math

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from scenes import clamped

import ufl_beam as ub
from ufl_beam.discretization.function_spaces import DolfinxFields, Element, dofs_of_cells
from ufl_beam.dolfinx_compat import fem, line_mesh
from ufl_beam.mechanics import functional
from ufl_beam.mechanics.kinematics import strain

EPS = float(np.finfo(float).eps)

POINTS = np.array([[0, 0], [1, 0.5], [1.5, 2], [1, 3.0]])
MESH = line_mesh(POINTS, np.array([[0, 1], [1, 2], [2, 3]]))


def random_function(space, seed):
    function = fem.Function(space)
    function.x.array[:] = np.random.default_rng(seed).uniform(-0.5, 0.5, len(function.x.array))
    return function


@pytest.fixture
def fields():
    """Configuration, jumps, free strains and resultants at random, with a bulk that has flowed."""
    of = Element(ub.Mesh(), MESH)
    constant = fem.functionspace(MESH, ("DG", 0, (3,)))
    q, α = random_function(of.space, 1), random_function(fem.functionspace(MESH, ("DG", 0)), 2)
    D, r, plastic = (random_function(constant, seed) for seed in (3, 4, 5))

    def W(e):
        return functional.elastic_energy(e - plastic, ufl.as_vector((60.0, 40.0, 30.0)))

    return of, q, α, D, r, W


def vector(form):
    return fem.assemble_vector(fem.form(form)).array


def scalar(form):
    return fem.assemble_scalar(fem.form(form))


def variation(density, function, dx):
    return vector(ufl.derivative(density * dx, function, ufl.TestFunction(function.function_space)))


def test_variation_by_resultants_ties_strains_to_the_configuration(fields):
    """P(29), its third equation."""
    of, q, _, D, r, W = fields
    found = variation(functional.hu_washizu(W, q, D, r, of.axis), r, of.dx(1))
    z = ufl.TestFunction(r.function_space)
    expected = vector(ufl.dot(strain(q, of.axis) - D, z) * of.dx(1))
    assert np.abs(found - expected).max() <= 8 * EPS * np.abs(expected).max()


def test_variation_by_strains_is_the_law(fields):
    """P(29), its second equation: resultants are the derivative of the free energy."""
    of, q, _, D, r, W = fields
    found = variation(functional.hu_washizu(W, q, D, r, of.axis), D, of.dx(1))
    e, z = ufl.variable(D), ufl.TestFunction(D.function_space)
    expected = vector(ufl.dot(ufl.diff(W(e), e) - r, z) * of.dx(1))
    assert np.abs(found - expected).max() <= 8 * EPS * np.abs(expected).max()


def test_modified_functional_is_that_of_split_strains(fields):
    """P(26) with the split P(30) is P(31)."""
    of, q, α, _, r, W = fields
    D, jump = functional.enhanced_strain(q, α, of.axis), functional.incompatible(α, of.axis)
    split = scalar(functional.hu_washizu(W, q, D, r, of.axis) * of.dx(1))
    modified = scalar(functional.modified_functional(W, q, jump, r, of.axis) * of.dx(1))
    assert math.isclose(split, modified, rel_tol=16 * EPS)


def test_jumps_do_no_work_on_constant_resultants(fields):
    """P(33): what a jump adds to the strain of the bulk, and the jump itself, add up to none."""
    of, _, α, *_ = fields
    z = ufl.TestFunction(α.function_space)
    along_the_bulk = vector(functional.incompatible(α, of.axis)[2] * z * of.dx(1))
    assert np.abs(along_the_bulk + α.x.array).max() <= 4 * EPS


def test_equilibrium_of_the_hinge(fields):
    """P(34), its second equation: the moment of the bulk is that of the hinge, 6 α."""
    of, q, α, _, _, W = fields
    found = variation(functional.potential(W, q, α, 3 * α**2, of.axis), α, of.dx(1))
    e = ufl.variable(functional.enhanced_strain(q, α, of.axis))
    z = ufl.TestFunction(α.function_space)
    moment = vector(ufl.diff(W(e), e)[2] / of.axis.h * z * of.dx(1))
    assert np.abs(found - (6 * α.x.array - moment)).max() <= 16 * EPS * np.abs(moment).max()


# -- what runs -----------------------------------------------------------------------------------

STIFFNESS = {"EA": 6e3, "GA": 4e3, "EI": 300.0}
C = ufl.as_vector([*STIFFNESS.values()])


def pushed(**hinge):
    """A cantilever whose end is turned, and its element; every process computes all of it."""
    beam = ub.Beam((0, 0), (1, 2), ub.Section(**STIFFNESS, **hinge), cells=3)
    scene = clamped(beam, ub.PrescribedDisplacement(beam.end, psi=lambda t: 0.3 * t))
    simulation = ub.Simulation(scene, ub.Static(), comm=MPI.COMM_SELF)
    for t in np.linspace(0.05, 1, 20):
        simulation.step_to(float(t))
    fields = DolfinxFields(simulation.subdomain)
    fields.element.q1.x.array[dofs_of_cells(fields.element.space)] = simulation.q[fields.cell_dofs]
    return simulation, fields, fields.element


def test_forces_are_the_derivative_of_the_potential():
    """Internal forces of a static step, elastic, are P(34), its first equation."""
    simulation, _, of = pushed()
    expected, found = np.zeros((2, simulation.subdomain.size))
    W = functional.elastic_energy(strain(of.q1, of.axis), C)
    expected[simulation.dolfinx.dofs] = variation(W, of.q1, of.dx(1))
    for one in simulation.beams:
        one.add_residual(simulation.q, found)
    assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()


def test_an_open_hinge_is_a_stationary_jump():
    """The jumps that the return map finds make the potential stationary, P(34) and P(49)."""
    simulation, fields, of = pushed(hinge=ub.Softening(40.0, 25.0))
    cells, recorded = simulation.inelastic[0].sections()
    kept = recorded[:, 0]  # of the Gauss point in the middle
    α = fem.Function(fem.functionspace(fields.mesh, ("DG", 0)))
    α.x.array[np.argsort(fields.order)[cells]] = kept[:, 3]
    assert np.count_nonzero(α.x.array) == 3  # a uniform moment opens all
    # The energy that a growing jump dissipates, whose derivative is the traction P(52)
    broken = 25.0 * (1 - ufl.exp(-40.0 / 25.0 * abs(α)))

    def W(e):
        return functional.elastic_energy(e, C)

    residual = variation(functional.potential(W, of.q1, α, broken, of.axis), α, of.dx(1))
    moments = np.abs(kept[:, 2])
    assert (moments < 40.0).all()
    # The local solution has a relative step of 1e-9, squared, and round-off
    assert np.abs(residual).max() <= 1e-12 * moments.max()


def test_mass_is_the_second_derivative_of_the_kinetic_energy():
    """P(67): consistent, h/3 and h/6 of the density."""
    of = Element(ub.Mesh(), MESH)
    of.inertia.x.array[:] = np.tile([2.0, 0.5], 3)
    v = random_function(of.space, 7)
    energy = scalar(functional.kinetic_energy(v, of.inertia) * of.dx_of_mass())
    lengths = np.hypot(*np.diff(POINTS, axis=0).T)[MESH.topology.original_cell_index]
    of_cells = v.x.array[dofs_of_cells(of.space)].reshape(3, 3, 2)
    square = (of_cells**2).sum(axis=2) + of_cells.prod(axis=2)
    expected = (lengths[:, None] / 3 * square * [2.0, 2.0, 0.5]).sum() / 2
    assert math.isclose(energy, expected, rel_tol=16 * EPS)
