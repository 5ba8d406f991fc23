# SPDX-License-Identifier: MIT
"""The reference solver: forms from the functional, scope, several processes, files."""

from dataclasses import replace
from itertools import pairwise

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
import ufl
from helpers import raises
from scenes import clamped

import ufl_beam as ub
from ufl_beam.dolfinx_compat import compile_form, fem
from ufl_beam.mechanics import functional
from ufl_beam.mechanics.kinematics import Axis, strain
from ufl_beam.reference.step_problem import StepProblem
from ufl_beam.simulation.reference_run import ReferenceInPlane

pytestmark = pytest.mark.filterwarnings("ignore:.*opened in 1 cell, in the middle of a cell")

E, HARDENING, AREA, INERTIA = 73e9, 2e9, 2e-4, 0.1667e-8
ALUMINIUM = {"EA": E * AREA, "GA": 5 / 6 * E * AREA / 2.6, "EI": E * INERTIA}
"""Section 4.1 of the paper."""

PLAIN = ub.Section(EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01)

SAME = 1e-10
"""Largest difference between solvers, or between numbers of processes, as a part of the motion."""


def weak_cell(viscosity, rate):
    """Section 4.1: a cantilever whose end turns, with an embedded hinge in a cell of 20 cm."""
    viscous = {"viscosity": ub.Perzyna(viscosity * INERTIA)} if viscosity else {}
    law = ub.ElastoPlastic(50.0, isotropic=HARDENING * INERTIA, **viscous)
    plain = ub.Section(**ALUMINIUM, bending=law)
    weak, free = replace(plain, hinge=ub.Softening(80.0, 100.0)), {0.0: None, 1.0: None}
    parts = [
        ub.Beam((0, 0), (0.4, 0), plain, cells=4),
        ub.Beam((0.4, 0), (0.6, 0), weak, cells=1, hinges=free),
        ub.Beam((0.6, 0), (1, 0), plain, cells=4),
    ]
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(parts)]
    turned = ub.PrescribedDisplacement(parts[2].end, psi=lambda t: rate * t)
    return ub.Scene(parts, joints=joints, supports=[ub.Clamped(parts[0].start), turned])


def machine():
    """Everything in the scope: fibres, hinges of both kinds, joints, a body, masses, loads."""
    fibres = ub.Fibres(ub.ElastoPlastic(2e5, isotropic=1e7), number=4)
    post = ub.Section.rectangle(0.1, 0.1, E=1e8, nu=0.2, rho=1e3, fibres=fibres)
    hardening, hinge = ub.ElastoPlastic(30.0, isotropic=80.0), ub.Softening(40.0, 15.0)
    breaking = replace(PLAIN, bending=hardening, hinge=hinge)
    left = ub.Beam((0, 0), (0, 1), post, cells=3)
    roof = ub.Beam((0, 1), (1, 1.2), breaking, cells=3)
    right = ub.Beam((1, 1.2), (1.3, 0), PLAIN, cells=2, hinges={0.5: ub.Softening(20.0, 5.0)})
    arm = ub.Beam((1, 1.2), (2, 1.2), PLAIN, cells=2)
    block = ub.Body((2.2, 1.2), mass=2.0, inertia=0.1)
    wheel, axle = ub.Body((3, 2), mass=2.0, inertia=0.1), ub.ground(3, 2)
    flap = ub.Beam((3, 2), (3.5, 2), PLAIN, cells=2, hinges={0.5: ub.Softening(0.0, 1.0)})
    push = ub.PointLoad(roof.at(1 / 3), force=(900.0, -700.0), amplitude=ub.ramp(0.1))
    return ub.Scene(
        [left, roof, right, arm, flap],
        bodies=[block, wheel],
        connectors=[ub.Turn(axle, wheel.middle, ub.PrescribedMotion(lambda t: np.sin(60 * t)))],
        joints=[
            ub.Rigid(left.end, roof.start),
            ub.Rigid(roof.end, right.start),
            ub.Revolute(roof.end, arm.start),
            ub.Revolute(arm.end, block.at(2.0, 1.2)),
            ub.Link(ub.ground(1.5, 2.5), arm.at(0.5)),
            ub.Revolute(axle, wheel.middle),
            ub.Rigid(wheel.middle, flap.start),
        ],
        supports=[
            ub.Clamped(left.start),
            ub.PrescribedDisplacement(right.end, u=lambda t: t**2, v=0),
        ],
        masses=[ub.PointMass(roof.at(1 / 3), 3.0, 0.02)],
        loads=[push, ub.Gravity(), ub.LineLoad(roof, (0, -300.0), span=(0.0, 2 / 3))],
        damping=[ub.Rayleigh(mass=0.3, stiffness=1e-5)],
    )


def run(scene, scheme, end, dt, *, reference=True, begin=0.0, **more):
    newton = ub.Newton(rtol=1e-12, reference=reference)
    return ub.simulate(scene, scheme, t=(begin, end), dt=dt, newton=newton, **more)


def apart(one, other):
    """Largest difference of motions, as a part of the largest motion."""
    columns = one.numbering.multipliers
    one, other = (np.delete(x.q, columns, axis=1) for x in (one, other))
    return np.abs(one - other).max() / np.abs(other).max()


# -- results ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("viscosity", "jump"), [(0.0, 3.533765992932), (2e7, 3.663166978989)], ids=["rate", "viscous"]
)
def test_the_embedded_hinge_of_the_paper(viscosity, jump):
    """Jumps to 12 digits, as computed by two other programs of the equations."""
    scene = weak_cell(viscosity, 4 * np.pi)
    found, other = (run(scene, ub.Static(), 1.0, 1 / 500, reference=by) for by in (True, False))
    assert found.material_at(scene.beams[1].at(0.5)).jump[-1] == pytest.approx(jump, abs=5e-12)
    assert apart(found, other) < SAME


def test_a_run_in_two_parts_by_different_solvers(tmp_path):
    """Both find the same; internal variables of points, hinges and connectors go on from either."""
    scene, scheme = machine(), ub.EnergyMomentum()
    folder, tip = MPI.COMM_WORLD.bcast(tmp_path), scene.beams[3].end
    record = [ub.History(folder / "tip.csv", places=[tip]), ub.XDMF(folder / "machine.xdmf")]
    extremes = [ub.Extremes(), ub.Extremes()]
    whole = run(scene, scheme, 0.12, 4e-3, record=[*record, extremes[0]])
    other = run(scene, scheme, 0.12, 4e-3, reference=False, record=extremes[1])
    assert apart(whole, other) < SAME
    assert whole.substeps == other.substeps
    assert np.abs(whole.v - other.v).max() < 10 * SAME * np.abs(other.v).max()
    assert min(whole.energy.lost[name][-1] for name in ("plastic", "hinges", "damping")) > 0.01
    for name, energy in other.energy.items():
        difference = np.abs(whole.energy[name] - energy).max()
        assert difference < SAME * other.energy.energy_transferred, name
    for beam in scene.beams:
        one, two = (x.section_forces(beam) for x in extremes)
        assert np.abs(np.array(one[:2]) - two[:2]).max() < 10 * SAME * np.abs(two[:2]).max()
    for first in (False, True):
        begun = run(scene, scheme, 0.08, 4e-3, reference=first)
        rest = run(scene, scheme, 0.12, 4e-3, begin=0.08, start=begun)
        assert np.abs(rest.q[-1] - whole.q[-1]).max() < 1e-8 * np.abs(whole.q).max()
    MPI.COMM_WORLD.barrier()
    table = np.genfromtxt(folder / "tip.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(table[:, 1:4], whole.displacement(tip), rtol=1e-12, atol=1e-15)
    assert (folder / "machine.xdmf").stat().st_size > 1000


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
def test_reactions_where_a_static_run_goes_on(scheme):
    """At the first state of the second run, with a link and a hinge of zero length."""
    upper = ub.Beam((0, 0), (1, 0), PLAIN, cells=3)
    lower = ub.Beam((0, -1), (1, -1), PLAIN, cells=3, hinges={0.0: ub.Softening(20.0, 5.0)})
    push = ub.PointLoad(upper.end, force=(0, 100.0), amplitude=lambda t: t)
    supports = [ub.Clamped(upper.start), ub.Clamped(lower.start)]
    link = ub.Link(lower.end, upper.end)
    scene = ub.Scene([upper, lower], joints=[link], supports=supports, loads=[push])
    first = run(scene, scheme, 0.5, 0.1)
    both = [
        run(scene, scheme, 1.0, 0.1, reference=by, begin=0.5, start=first) for by in (True, False)
    ]
    assert apart(*both) < SAME
    for support in supports:
        a, b = (x.reaction(support) for x in both)
        assert np.abs(a - b).max() < 10 * SAME * np.abs(b).max()


def test_a_new_link_stops_a_beam():
    """A plastic impact at the beginning of a run, whose scene has no prescribed motions."""
    arm = ub.Beam((0, 0), (1, 0), PLAIN, cells=4)
    pin = [ub.Pinned(arm.start)]
    spins = ub.Scene([arm], supports=pin, initial=[ub.Velocity((arm,), angular=1.0, about=(0, 0))])
    held = ub.Scene([arm], supports=pin, joints=[ub.Link(ub.ground(1.0, -1.5), arm.end)])
    scheme = ub.EnergyMomentum()
    begun = run(spins, scheme, 1e-15, 1e-15)
    both = [
        run(held, scheme, 0.01, 1e-3, reference=by, begin=1e-15, start=begun)
        for by in (True, False)
    ]
    losses = [each.energy.lost["impacts"][-1] for each in both]
    assert losses[0] == pytest.approx(losses[1], rel=1e-12)
    assert 0.2 < losses[0] < PLAIN.rhoA / 6  # J, of the kinetic energy
    assert apart(*both) < SAME


# -- the functional --------------------------------------------------------------------------------


def state_of(scene, scheme):
    options = {"t0": 0.0, "start": None, "newton": ub.Newton(reference=True), "mesh": None}
    return ReferenceInPlane(scene, scheme, comm=MPI.COMM_WORLD, **options)


def assembled(form):
    return np.array(fem.assemble_vector(compile_form(form)).array)


def test_the_residual_is_the_derivative_of_the_functionals():
    """In statics: of the potential by q, of the modified functional and of Hu-Washizu's by q.

    The state is that of the weak cell after its hinge has opened.  The derivative of Hu-Washizu's
    functional by the resultants r is zero, as its strains are those of q; its derivative by the
    strains is zero, as r are the resultants.
    """
    state = state_of(weak_cell(0.0, 4 * np.pi), ub.Static())
    fields, jump = state.problem.fields, 0.0
    while jump < 0.1:
        state.step_to(state.t + 1 / 500)
        mine = np.abs(fields.jump1.x.array).max(initial=0.0)
        jump = MPI.COMM_WORLD.allreduce(mine, MPI.MAX)
    axis, dx = Axis(fields.mesh), fields.dx(1)
    q, α, w = fields.q1, fields.jump1, ufl.TestFunction(fields.q1.function_space)

    def W(e):
        return functional.elastic_energy(e - fields.plastic, fields.stiffness)

    def set_strains(density):
        at = fem.Expression(density, np.array([[0.5]]))
        cells = np.arange(len(fields.h), dtype=np.int32)
        D.x.array[:] = at.eval(fields.mesh, cells).ravel()

    force = np.array(fem.assemble_vector(fields.force).array)
    size = np.abs(force).max()
    potential = functional.potential(W, q, α, ufl.as_ufl(0.0), axis) * dx
    D, r = fields.cellwise((3,)), fields.cellwise((3,))
    enhanced = functional.enhanced_strain(q, α, axis)
    set_strains(functional.incompatible(α, axis))
    r.x.array[:] = fields.resultants().ravel()
    modified = functional.modified_functional(W, q, D, r, axis) * dx
    for energy in (potential, modified):
        difference = assembled(ufl.derivative(energy, q, w)) - force
        assert np.abs(difference).max() <= 1e-13 * size
    set_strains(strain(q, axis))
    mixed = functional.hu_washizu(lambda e: W(e + enhanced - strain(q, axis)), q, D, r, axis) * dx
    assert np.abs(assembled(ufl.derivative(mixed, q, w)) - force).max() <= 1e-13 * size
    z = ufl.TestFunction(r.function_space)
    assert np.abs(assembled(ufl.derivative(mixed, r, z))).max(initial=0.0) <= 1e-15
    stiffness = np.abs(fields.stiffness.x.array).max() * np.abs(D.x.array).max()
    assert np.abs(assembled(ufl.derivative(mixed, D, z))).max(initial=0.0) <= 1e-12 * stiffness
    state.close()


# -- Newton's method -------------------------------------------------------------------------------


def loaded(petsc=None, weight=1e9):
    """A cantilever that a force bends far, and a post whose link bears a force of 1e9 N."""
    stiff = ub.Section(EA=1e15, GA=1e15, EI=1e15)
    arm = ub.Beam((0, 0), (1, 0), PLAIN, cells=8)
    post = ub.Beam((3, 0), (3, 1), stiff, cells=1)
    scene = ub.Scene(
        [arm, post],
        joints=[ub.Link(ub.ground(3.0, 2.0), post.end)],
        supports=[ub.Clamped(arm.start), ub.Clamped(post.start)],
        loads=[ub.PointLoad(arm.end, force=(0, 2e3)), ub.PointLoad(post.end, force=(0, -weight))],
    )
    newton = ub.Newton(reference=True, petsc=petsc or {})
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, newton=newton)


def test_a_line_search_leaves_no_point_behind():
    """PETSc's line search does not move the unknowns if the full step does not help and is small.

    Its tolerance is a part of the norm of the unknowns, which the force of a link makes large.
    """
    full, searched = loaded(), loaded(petsc={"snes_linesearch_type": "bt"})
    assert searched.substeps == full.substeps == 2
    assert apart(full, searched) < SAME


@pytest.mark.serial  # a single process raises
def test_errors_are_no_failed_steps(monkeypatch):
    """Only a singular matrix is; the next attempts find the solution."""
    jacobian, left = StepProblem._jacobian, [2]

    def singular(self, snes, x, A, P):
        jacobian(self, snes, x, A, P)
        if left[0]:
            left[0] -= 1
            P.zeroEntries()

    def broken(*_):
        raise PETSc.Error(55)  # out of memory

    expected = loaded(weight=1.0)
    monkeypatch.setattr(StepProblem, "_jacobian", singular)
    assert apart(loaded(weight=1.0), expected) < SAME
    assert left == [0]
    monkeypatch.setattr(StepProblem, "_jacobian", broken)
    with pytest.raises(PETSc.Error):
        loaded()


def test_all_objects_of_petsc_are_destroyed():
    state = state_of(machine(), ub.EnergyMomentum())
    problem = state.problem
    objects = [x for x in vars(problem).values() if isinstance(x, PETSc.Object)] + problem.matrices
    state.close()
    assert len(objects) > 5
    assert not any(x.handle for x in objects)


# -- refusals --------------------------------------------------------------------------------------

BEAM = ub.Beam((0, 0), (1, 0), PLAIN, cells=2)
HARDENS = ub.Beam((0, 0), (1, 0), PLAIN, hinges={0.5: ub.ElastoPlastic(20.0, isotropic=5.0)})
HANGER = ub.Stretch(ub.ground(0, 3), BEAM.end, ub.Spring(1e3), name="hanger")


@pytest.mark.parametrize(
    ("scene", "scheme", "words"),
    [
        (clamped(HARDENS), ub.EnergyMomentum(), "the law of the hinge Hinge"),
        (clamped(BEAM, connectors=[HANGER]), ub.EnergyMomentum(), "the law of hanger"),
        (
            clamped(BEAM, loads=[ub.FollowerLoad(BEAM.end, force=(0, 1.0))]),
            ub.Static(),
            "the load FollowerLoad",
        ),
        (
            clamped(BEAM, damping=[ub.KelvinVoigt(1e-3)]),
            ub.EnergyMomentum(),
            "the damping KelvinVoigt",
        ),
        (clamped(BEAM), ub.Newmark(), "the scheme Newmark"),
        (clamped(BEAM), ub.EnergyMomentum(order=4), "the scheme EnergyMomentum"),
    ],
)
def test_what_is_beyond_the_scope_is_refused_by_name(scene, scheme, words):
    with raises(f"reference=True cannot be combined with {words}"):
        run(scene, scheme, 0.1, 0.05)


def test_lumped_mass():
    scene, mesh = clamped(BEAM), ub.Mesh(lumped=True)
    load = ub.PointLoad(scene.beams[0].end, force=(0, -30.0))
    scene = replace(scene, loads=[load])
    found, expected = (
        run(scene, ub.EnergyMomentum(), 0.2, 0.02, mesh=mesh, reference=reference)
        for reference in (True, False)
    )
    assert np.abs(found.q - expected.q).max() < 1e-9 * np.abs(expected.q).max()


def test_meshes_beyond_the_scope():
    with raises("a mesh of degree above 1"):
        run(clamped(BEAM), ub.EnergyMomentum(), 0.1, 0.05, mesh=ub.Mesh(degree=2))
    if MPI.COMM_WORLD.size > 1:
        with raises("processes for"):
            run(clamped(ub.Beam((0, 0), (1, 0), PLAIN, cells=1)), ub.Static(), 1.0, 1.0)
