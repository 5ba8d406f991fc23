# SPDX-License-Identifier: MIT
"""Functions, forms and the SNES of a simulation are those of the equations that run."""

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem
from helpers import raises
from scenes import clamped, rigid_chain

import ufl_beam as ub
from ufl_beam import parallel
from ufl_beam.discretization.function_spaces import DolfinxFields
from ufl_beam.output import dolfinx_view

STEEL = {"EA": 1e6, "GA": 4e5, "EI": 800.0, "rhoA": 10.0, "rhoI": 0.01}


@pytest.fixture(autouse=True)
def _shuffled(monkeypatch):
    """Cells of the mesh in an order that is not theirs in the scene, as DOLFINx may choose."""

    def fields(subdomain):
        order = np.random.default_rng(3).permutation(len(subdomain.cells))
        return DolfinxFields(subdomain, order)

    monkeypatch.setattr(dolfinx_view, "DolfinxFields", fields)


def frame():
    """Elastic cells, cells that yield and hinge, and hinges of zero length; a rigid corner."""
    weak = ub.Section(
        **STEEL,
        bending=ub.ElastoPlastic(30.0, isotropic=80.0),
        hinge=ub.Softening(40.0, fracture_energy=15.0),
    )
    left = ub.Beam((0, 0), (0, 1), weak, cells=5)
    roof = ub.Beam(
        (0, 1), (1, 1.2), ub.Section(**STEEL), cells=4, hinges={0.5: ub.Softening(20, 5)}
    )
    return rigid_chain(
        [left, roof],
        supports=[ub.Clamped(left.start), ub.Pinned(roof.end)],
        loads=[ub.PointLoad(roof.at(0.25), force=(900.0, -700.0), amplitude=ub.ramp(0.1))],
    )


def moved(scene, scheme, *, t=0.06, **more):
    """A simulation some steps later."""
    newton = ub.Newton(rtol=1e-12)
    simulation = ub.Simulation(scene, scheme, newton=newton, **{"comm": MPI.COMM_SELF, **more})
    for k in range(6):
        simulation.step_to(t * (k + 1) / 6)
    return simulation


def assembled(simulation, work):
    """A linear form on the mesh, at the degrees of freedom of the scene."""
    r, view = np.zeros(len(simulation.q)), simulation.dolfinx
    np.add.at(r, view.dofs, fem.assemble_vector(fem.form(work)).array)
    return r


@pytest.mark.parametrize("least", [1, 6000], ids=["shared", "copies"])
def test_total_is_that_of_the_scene_on_any_processes(monkeypatch, least):
    """Length, ∫ x² and energies; [round-off] of 12 cells and of Newton's method."""
    monkeypatch.setattr(parallel, "SMALLEST_SUBDOMAIN", least)
    beam = ub.Beam((0, 0), (3, 0), ub.Section(**STEEL), cells=12)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(10.0, 30.0))])
    simulation = moved(scene, ub.EnergyMomentum(), comm=MPI.COMM_WORLD)
    assert simulation.subdomain.comm.size == (MPI.COMM_WORLD.size if least == 1 else 1)
    view = simulation.dolfinx
    x, C, e = ufl.SpatialCoordinate(view.mesh), view.stiffness, view.strains
    stored = sum(C[i] * e[i] ** 2 / 2 for i in range(3)) * view.dx
    one = fem.Constant(view.mesh, 1.0)
    assert view.total(one * view.dx) == pytest.approx(3.0, rel=1e-13)
    assert view.total(x[0] ** 2) == pytest.approx(9.0, rel=1e-13)
    # Both rules in one form: FFCx alone would take one for both.
    assert view.total(one * view.dx + x[0] ** 2 * ufl.dx) == pytest.approx(12.0, rel=1e-13)
    energies = simulation.entries()[0]
    assert view.total(stored) == pytest.approx(energies["stored"], rel=1e-10)
    v, M = view.velocity.x.array, fem.assemble_matrix(fem.form(view.forms.mass)).to_scipy()
    kinetic = simulation.subdomain.comm.allreduce(v @ M @ v / 2)
    assert kinetic == pytest.approx(energies["kinetic"], rel=1e-12)
    simulation.close()


def test_what_total_refuses():
    view = moved(frame(), ub.EnergyMomentum()).dolfinx
    w = ufl.TestFunction(view.function_space)
    for wrong, message in [
        (w[0] * view.dx, "without test functions"),
        (view.configuration, "a scalar expression"),
        (3.0, "a form of UFL"),
        (fem.Constant(view.mesh, 1.0) * ufl.ds, "over facets"),
        (moved(frame(), ub.EnergyMomentum()).dolfinx.configuration[0] * ufl.dx, "another mesh"),
    ]:
        with raises(message):
            view.total(wrong)


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(0.1), ub.EnergyMomentumStatic(), ub.GeneralizedAlpha()]
)
def test_forms_are_those_of_the_terms(scheme):
    """In a step that has not begun; cells that flow have the tangent of a step."""
    simulation = moved(frame(), scheme, t=0.06 if scheme.dynamic else 0.03)
    assert simulation.damage()[1].max() > 1e-3  # J
    beams = [term for term in simulation.terms if term.kind == "beams"]
    forms, dofs = simulation.dolfinx.forms, simulation.dolfinx.dofs
    work, q = assembled(simulation, forms.work), simulation.q
    K = fem.assemble_matrix(fem.form(forms.tangent)).to_scipy().tocoo()
    tangent = np.zeros((len(q), len(q)))
    np.add.at(tangent, (dofs[K.row], dofs[K.col]), K.data)

    t = simulation.t + 0.01
    simulation.equation.begin(ub.extend.Step.create(scheme, simulation.t, t, t, q), beams)
    r, A = np.zeros(len(q)), simulation.equation.A
    A.data.fill(0.0)
    for term in beams:
        term.add_tangent(q)  # in statics the first one is of the forces before
        A.data.fill(0.0)
    for term in beams:
        term.add_residual(q, r)
        term.add_tangent(q)
    expected = np.zeros_like(tangent)
    expected[A.rows(), A.indices] = A.data
    # Round-off of strains from displacements of the size of the frame, times EA.
    assert np.allclose(work, r, rtol=0, atol=1e-12 * STEEL["EA"])
    assert np.allclose(tangent, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    simulation.close()


def test_functions_follow_the_state():
    simulation = moved(frame(), ub.EnergyMomentum(0.1))
    view, first = simulation.dolfinx, simulation.dolfinx.configuration
    simulation.step_to(0.08)
    assert view.configuration is first
    assert np.array_equal(first.x.array, simulation.q[view.dofs])
    assert np.array_equal(view.velocity.x.array, simulation.inertia.v[view.dofs])
    jump, _ = simulation.damage()
    assert np.array_equal(view.jump.x.array, jump[view.cells])
    of_left, of_roof = (np.abs(view.jump.x.array[view.cell_tags.find(n)]) for n in (0, 1))
    assert of_left.max() > 0  # embedded
    assert of_roof.max() > 0  # of zero length
    forces = view.forces.x.array.reshape(-1, 3)
    assert np.array_equal(forces, simulation.section_forces()[view.cells])
    simulation.close()


def test_what_a_scene_does_not_have():
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL), cells=2)
    simulation = ub.Simulation(clamped(beam), ub.Static())
    with raises("dolfinx.jump: no beam of the scene has a hinge; give"):
        simulation.dolfinx.jump  # noqa: B018
    with raises("dolfinx.velocity: a static scheme has no velocit"):
        simulation.dolfinx.velocity  # noqa: B018
    simulation.close()


# -- the SNES ------------------------------------------------------------------------------------


def test_a_monitor_sees_each_iteration_and_changes_none():
    plain = moved(frame(), ub.EnergyMomentum(0.1))
    watched = ub.Simulation(
        frame(), ub.EnergyMomentum(0.1), newton=ub.Newton(rtol=1e-12)
    )  # under mpirun, by all processes
    seen = []
    watched.snes.setMonitor(lambda snes, iteration, norm: seen.append(iteration))
    watched.snes.setConvergenceHistory()
    for k in range(6):
        watched.step_to(0.01 * (k + 1))
    assert len(seen) - seen.count(0) == watched.iterations == plain.iterations
    norms, _ = watched.snes.getConvergenceHistory()
    assert len(norms) == len(seen)
    assert norms[-1] < 1e-6 * norms.max()
    # Sums are in another order, and in C operations are contracted otherwise.
    assert np.allclose(plain.q, watched.subdomain.gather(watched.q), rtol=0, atol=1e-11)
    for simulation in (plain, watched):
        simulation.close()


@pytest.mark.serial
def test_a_monitor_sees_a_path(capfd):
    beam = ub.Beam((0, 0), (3, 0), ub.Section(**STEEL), cells=2)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, 1.0), amplitude=lambda t: t)])
    options = ub.Newton(petsc={"snes_monitor": ""})
    path = ub.follow(scene, ub.LoadControl(0.5), steps=2, newton=options)
    assert capfd.readouterr().out.count("0 SNES Function norm") == len(path)


def test_the_matrix_of_snes():
    """PETSc has it from when it is asked for; before, nobody has its columns."""
    simulation = ub.Simulation(frame(), ub.EnergyMomentum(0.1))
    simulation.step_to(0.01)
    A, snes = simulation.equation.A, simulation.snes
    simulation.step_to(0.02)
    if simulation.subdomain.alone:
        found = snes.getJacobian()[0].getValuesCSR()
        assert all(map(np.array_equal, found, (A.indptr, A.indices, A.data)))
    simulation.close()
