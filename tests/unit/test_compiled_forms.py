# SPDX-License-Identifier: MIT
"""What is compiled: one quadrature rule per form, and nothing that the scene does not need."""

import math

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import cpp
from scenes import clamped

import ufl_beam as ub
from ufl_beam.discretization import cell_functions
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import DolfinxFields, Fields, beam_forms
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.dolfinx_compat import VERSION, fem

SECTION = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0)


def everything():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    return clamped(
        beam,
        ub.Roller(beam.end, along=(1, 1)),
        loads=[ub.Gravity(), ub.FollowerLoad(beam.end, force=(1, 0)), ub.LineLoad(beam)],
        masses=[ub.PointMass(beam.end, 1.0, 1.0)],
    )


def plain(**more):
    """Cantilever with hinges that never open."""
    hinges = {0.1: ub.Softening(math.inf, 2.0)}
    section = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, hinge=ub.Softening(math.inf, 1.0))
    return clamped(ub.Beam((0, 0), (1, 0), section, cells=4, hinges=hinges), **more)


def moved(u):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    return clamped(beam, ub.PrescribedDisplacement(beam.end, u=u))


@pytest.mark.parametrize(
    ("scene", "scheme", "effects", "entries"),
    [
        (plain(loads=[ub.Gravity()]), ub.Static(), ["DeadLoads"], "stored loads"),
        (plain(), ub.EnergyMomentum(), ["Inertia"], "stored kinetic"),
        (plain(), ub.EnergyMomentum(0.1), ["Inertia"], "stored kinetic numerical"),
        (plain(), ub.EnergyMomentum(0.0, 0.1), ["Inertia"], "stored kinetic numerical"),
        (
            everything(), ub.EnergyMomentum(), ["DeadLoads", "FollowerForce", "Inertia"],
            "stored kinetic loads",
        ),
        (moved(0.0), ub.EnergyMomentum(), ["Inertia"], "stored kinetic"),
        (moved(ub.ramp(1.0)), ub.EnergyMomentum(), ["Inertia"], "stored kinetic supports impacts"),
    ],
)  # fmt: skip
def test_dynamics_adds_the_mass_and_nothing_else(scene, scheme, effects, entries):
    """Terms, and entries of the ledger: nothing of what a scene does not have."""
    simulation = ub.Simulation(scene, scheme)
    assert [term.effect for term in simulation.terms] == ["ElasticCell", *effects]
    assert [name for group in simulation.entries() for name in group] == entries.split()
    simulation.close()


def fields_of_a_frame(mesh=None):
    a = ub.Beam((0, 0), (0, 2), SECTION, cells=3)
    b = ub.Beam((0, 2), (3, 1), SECTION, cells=4)
    scene = ub.Scene([a, b], joints=[ub.Revolute(a.end, b.start)])
    return Fields(Subdomain(DofNumbering(scene, mesh or ub.Mesh()), MPI.COMM_SELF))


def space_with_dofs(domain, element, cell_dofs, size):
    """Make a function space with given degrees of freedom of the cells."""
    plain = fem.functionspace(domain, element)
    index_map = cpp.common.IndexMap(MPI.COMM_SELF, size)
    adjacency = cpp.graph.AdjacencyList_int32(np.ascontiguousarray(cell_dofs, dtype=np.int32))
    dofmap = cpp.fem.DofMap(plain.dofmap.dof_layout, index_map, 1, adjacency, 1)
    arguments = [domain._cpp_object, plain._cpp_object.element, dofmap]
    if VERSION < (0, 11):
        arguments.append(list(element.reference_value_shape))
    return fem.FunctionSpace(domain, element, cpp.fem.FunctionSpace_float64(*arguments))


@pytest.mark.parametrize(
    "mesh", [ub.Mesh(), ub.Mesh(degree=2), ub.Mesh(degree=3, lumped=True)], ids=str
)
def test_functions_of_cells_are_what_dolfinx_assembles(mesh):
    """Forces of strains, masses and the stiffness at rest; sums over cells in another order."""
    fields = fields_of_a_frame(mesh)
    q = np.random.default_rng(0).uniform(-1, 1, fields.subdomain.size)
    C = np.diag([SECTION.EA, SECTION.GA, SECTION.EI]).ravel()
    law = (
        np.zeros((len(fields.order), 3 * mesh.degree)),
        np.tile(C, (len(fields.order), mesh.degree)),
    )
    forces = np.zeros(len(q))
    cell_functions.stress_forces(fields, law).add(q, forces)

    meshed = DolfinxFields(fields.subdomain)
    of, size = meshed.element, fields.subdomain.size
    space = space_with_dofs(meshed.mesh, of.space.ufl_element(), meshed.cell_dofs, size)
    now, w, u = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    now.x.array[:] = q
    work, _, mass, _ = beam_forms(of, ub.Static())
    assembled = fem.assemble_vector(fem.form(ufl.replace(work, {of.q1: now, of.w: w}))).array
    assert np.abs(forces - assembled).max() < 1e-13 * np.abs(assembled).max()
    rest = fem.Function(space)  # where the tangent of the forces is the stiffness
    tangent = ufl.derivative(ufl.replace(work, {of.q1: rest, of.w: w}), rest, u)
    mass = ufl.replace(mass, {of.w: w, ufl.TrialFunction(of.space): u})
    for form, matrix in (
        (tangent, cell_functions.stiffness_matrix(fields)),
        (mass, cell_functions.mass_matrix(fields)),
    ):
        expected = fem.assemble_matrix(fem.form(form)).to_dense()
        found = matrix.sparse().toarray()
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
        product = np.zeros(size)
        on_cells = cell_functions.stiffness_forces, cell_functions.mass_forces
        on_cells[form is mass](fields).add(q, product)
        assert np.abs(product - expected @ q).max() < 1e-13 * np.abs(expected).max()
