# SPDX-License-Identifier: MIT
"""The reference solver: forms from the functional, scope, several processes, files, mistakes."""

from itertools import pairwise

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
import ufl

import ufl_beam as ub
from ufl_beam import dolfinx_compat
from ufl_beam.dolfinx_compat import compile_form, fem
from ufl_beam.mechanics import functional
from ufl_beam.mechanics.kinematics import Axis, strain
from ufl_beam.reference import connectors, forms, points, solver
from ufl_beam.reference.step_problem import StepProblem
from ufl_beam.simulation.reference_run import ReferenceRun

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*opened in 1 cell, in the middle of a cell"),
]

E, HARDENING, AREA, INERTIA = 73e9, 2e9, 2e-4, 0.1667e-8
ALUMINIUM = {"EA": E * AREA, "GA": 5 / 6 * E * AREA / 2.6, "EI": E * INERTIA}
"""Section 4.1 of the paper."""

SAME = 1e-10
"""Largest difference between solvers, or between numbers of processes, as a part of the motion."""


def weak_cell(viscosity, rate):
    """Section 4.1: a cantilever whose end turns, with an embedded hinge in a cell of 20 cm."""
    viscous = {"viscosity": ub.Perzyna(viscosity * INERTIA)} if viscosity else {}
    law = ub.ElastoPlastic(50.0, isotropic=HARDENING * INERTIA, **viscous)
    parts = [
        ub.Beam((0, 0), (0.4, 0), ub.Section(**ALUMINIUM, bending=law), cells=4),
        ub.Beam(
            (0.4, 0), (0.6, 0),
            ub.Section(**ALUMINIUM, bending=law, hinge=ub.Softening(80.0, 100.0)),
            cells=1, hinges={0.0: None, 1.0: None},
        ),
        ub.Beam((0.6, 0), (1, 0), ub.Section(**ALUMINIUM, bending=law), cells=4),
    ]  # fmt: skip
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(parts)]
    turned = ub.PrescribedDisplacement(parts[2].end, psi=lambda t: rate * t)
    return ub.Scene(parts, joints=joints, supports=[ub.Clamped(parts[0].start), turned])


def machine(*, stands=False):
    """Everything in the scope: fibres, hinges of both kinds, joints, a body, masses, loads.

    With ``stands``, without parts that only inertia holds, and without loads that act at once.
    """
    fibres = ub.Fibres(ub.ElastoPlastic(2e5, isotropic=1e7), number=4)
    post = ub.Section.rectangle(0.1, 0.1, E=1e8, nu=0.2, rho=1e3, fibres=fibres)
    plain = {"EA": 1e6, "GA": 4e5, "EI": 800.0, "rhoA": 10.0, "rhoI": 0.01}
    breaking = ub.Section(
        **plain, bending=ub.ElastoPlastic(30.0, isotropic=80.0), hinge=ub.Softening(40.0, 15.0)
    )
    left = ub.Beam((0, 0), (0, 1), post, cells=3)
    roof = ub.Beam((0, 1), (1, 1.2), breaking, cells=3)
    right = ub.Beam(
        (1, 1.2), (1.3, 0), ub.Section(**plain), cells=2, hinges={0.5: ub.Softening(20.0, 5.0)}
    )
    arm = ub.Beam((1, 1.2), (2, 1.2), ub.Section(**plain), cells=2)
    block = ub.Body((2.2, 1.2), mass=2.0, inertia=0.1)
    joints = [ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.start)]
    hanging = [
        ub.Revolute(roof.end, arm.start), ub.Revolute(arm.end, block.at(2.0, 1.2)),
        ub.Link(ub.ground(1.5, 2.5), arm.at(0.5)),
    ]  # fmt: skip
    push = ub.PointLoad(roof.at(1 / 3), force=(900.0, -700.0), amplitude=ub.ramp(0.1))
    weights = [ub.Gravity(), ub.LineLoad(roof, (0, -300.0), span=(0.0, 2 / 3))]
    moved = ub.PrescribedDisplacement(right.end, u=lambda t: t**2, v=0)
    return ub.Scene(
        [left, roof, right] + [arm] * (not stands),
        bodies=[block] * (not stands),
        joints=joints + hanging * (not stands),
        supports=[ub.Clamped(left.start), moved],
        masses=[ub.PointMass(roof.at(1 / 3), 3.0, 0.02)],
        loads=[push] + weights * (not stands),
        damping=[ub.Rayleigh(mass=0.3, stiffness=1e-5)] * (not stands),
    )


def run(scene, scheme, end, dt, *, reference=True, **more):
    newton = ub.Newton(rtol=1e-12, reference=reference)
    return ub.simulate(scene, scheme, t=(0, end), dt=dt, newton=newton, **more)


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
    rate = 4 * np.pi
    scene = weak_cell(viscosity, rate)
    found = run(scene, ub.Static(), 1.0, 1 / 500)
    place = scene.beams[1].at(0.5)
    assert found.material_at(place).jump[-1] == pytest.approx(jump, abs=5e-12)
    assert apart(found, run(scene, ub.Static(), 1.0, 1 / 500, reference=False)) < SAME


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.05), ub.EnergyMomentumStatic()]
)
def test_everything_in_the_scope(scheme):
    """Motions, velocities, reactions, section forces, connectors and ledger of both solvers."""
    scene = machine(stands=not scheme.dynamic)
    # In statics the frame snaps at 0.016 s, where its hinge has opened.
    times = (0.12, 4e-3) if scheme.dynamic else (0.015, 5e-4)
    found, other = (run(scene, scheme, *times, reference=by) for by in (True, False))
    assert apart(found, other) < SAME
    assert found.substeps == other.substeps
    if scheme.dynamic:
        assert np.abs(found.v - other.v).max() < 10 * SAME * np.abs(other.v).max()
        assert min(found.energy.lost[name][-1] for name in ("plastic", "hinges", "damping")) > 0.01
    for name, energy in other.energy.items():
        difference = np.abs(found.energy[name] - energy).max()
        assert difference < SAME * other.energy.energy_transferred, name
    for support in scene.supports:
        a, b = (np.nan_to_num(x.reaction(support)) for x in (found, other))
        assert np.abs(a - b).max() < 10 * SAME * np.abs(b).max()
    for beam in scene.beams:
        a, b = (x.section_forces_at(beam.at(0.3)) for x in (found, other))
        assert np.abs(a - b).max() < 100 * SAME * np.abs(b).max()
    for a, b in zip(
        found.connector(scene.hinges[0]), other.connector(scene.hinges[0]), strict=True
    ):
        assert np.abs(a - b).max() <= 100 * SAME * np.abs(b).max()


def test_a_run_in_two_parts_by_different_solvers():
    """Internal variables of points, hinges and connectors go on from either solver."""
    scene, scheme, options = machine(), ub.EnergyMomentum(), {"dt": 4e-3}
    whole = run(scene, scheme, 0.12, 4e-3)
    for first in (False, True):
        newton = [ub.Newton(rtol=1e-12, reference=by) for by in (first, True)]
        begun = ub.simulate(scene, scheme, t=(0, 0.08), newton=newton[0], **options)
        rest = ub.simulate(scene, scheme, t=(0.08, 0.12), newton=newton[1], start=begun, **options)
        assert np.abs(rest.q[-1] - whole.q[-1]).max() < 1e-8 * np.abs(whole.q).max()


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
def test_reactions_where_a_static_run_goes_on(scheme):
    """At the first state of the second run, with a link and a hinge of zero length."""
    section, hinges = ub.Section(EA=1e6, GA=4e5, EI=800.0), {0.0: ub.Softening(20.0, 5.0)}
    upper = ub.Beam((0, 0), (1, 0), section, cells=3)
    lower = ub.Beam((0, -1), (1, -1), section, cells=3, hinges=hinges)
    push = ub.PointLoad(upper.end, force=(0, 100.0), amplitude=lambda t: t)
    supports = [ub.Clamped(upper.start), ub.Clamped(lower.start)]
    link = ub.Link(lower.end, upper.end)
    scene = ub.Scene([upper, lower], joints=[link], supports=supports, loads=[push])
    found, other = ([run(scene, scheme, 0.5, 0.1, reference=by)] for by in (True, False))
    for runs, by in ((found, True), (other, False)):
        newton = ub.Newton(rtol=1e-12, reference=by)
        runs += [
            ub.simulate(scene, scheme, t=(t, 1.0), dt=0.1, newton=newton, start=runs[0])
            for t in (0.5, 0.7)
        ]
    for one, two in zip(found, other, strict=True):
        assert apart(one, two) < SAME
        for support in supports:
            a, b = one.reaction(support), two.reaction(support)
            assert np.abs(a - b).max() < 10 * SAME * np.abs(b).max()


def test_a_new_link_stops_a_beam():
    """A plastic impact at the beginning of a run, whose scene has no prescribed motions."""
    section = ub.Section(EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01)
    arm = ub.Beam((0, 0), (1, 0), section, cells=4)
    pin = [ub.Pinned(arm.start)]
    spins = ub.Scene([arm], supports=pin, initial=[ub.Velocity((arm,), angular=1.0, about=(0, 0))])
    held = ub.Scene([arm], supports=pin, joints=[ub.Link(ub.ground(1.0, -1.5), arm.end)])
    begun = run(spins, ub.EnergyMomentum(), 1e-15, 1e-15)
    both = [
        ub.simulate(
            held, ub.EnergyMomentum(), t=(1e-15, 0.01), dt=1e-3, start=begun,
            newton=ub.Newton(rtol=1e-12, reference=by),
        )
        for by in (True, False)
    ]  # fmt: skip
    losses = [each.energy.lost["impacts"][-1] for each in both]
    assert losses[0] == pytest.approx(losses[1], rel=1e-12)
    assert 0.2 < losses[0] < spins.beams[0].section.rhoA / 6  # J, of the kinetic energy
    assert apart(*both) < SAME


def test_recorders(tmp_path):
    """A history and a file for ParaView of a run."""
    scene = machine()
    folder = MPI.COMM_WORLD.bcast(tmp_path)
    tip = scene.beams[3].end
    recorders = [
        ub.History(folder / "tip.csv", places=[tip]), ub.XDMF(folder / "machine.xdmf"),
    ]  # fmt: skip
    found = run(scene, ub.EnergyMomentum(), 0.02, 4e-3, record=recorders)
    MPI.COMM_WORLD.barrier()
    table = np.genfromtxt(folder / "tip.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(table[:, 1:4], found.displacement(tip), rtol=1e-12, atol=1e-15)
    assert (folder / "machine.xdmf").stat().st_size > 1000


# -- the functional --------------------------------------------------------------------------------


def broken():
    """State of the weak cell after its hinge has opened, and the functions of its last step."""
    rate = 4 * np.pi
    options = {"t0": 0.0, "start": None, "newton": ub.Newton(reference=True), "mesh": None}
    state = ReferenceRun(weak_cell(0.0, rate), ub.Static(), comm=MPI.COMM_WORLD, **options)
    fields, jump = state.fields, 0.0
    while jump < 0.1:
        state.step_to(state.t + 1 / 500)
        mine = np.abs(fields.jump1.x.array).max(initial=0.0)
        jump = MPI.COMM_WORLD.allreduce(mine, MPI.MAX)
    return state, fields


def assembled(form):
    return np.array(fem.assemble_vector(compile_form(form)).array)


def test_the_residual_is_the_derivative_of_the_functionals():
    """In statics: of the potential by q, of the modified functional and of Hu-Washizu's by q.

    The derivative of Hu-Washizu's functional by the resultants r is zero, as its strains are those
    of q; its derivative by the strains is zero, as r are the resultants.
    """
    state, fields = broken()
    axis, dx = Axis(fields.mesh), fields.dx(1)
    q, α, w = fields.q1, fields.jump1, ufl.TestFunction(fields.q1.function_space)

    def W(e):
        return functional.elastic_energy(e - fields.plastic, fields.stiffness)

    force = np.array(fem.assemble_vector(fields.force).array)
    size = np.abs(force).max()
    potential = functional.potential(W, q, α, ufl.as_ufl(0.0), axis) * dx
    D, r = fields.cellwise((3,)), fields.cellwise((3,))
    enhanced = functional.enhanced_strain(q, α, axis)
    cells = np.arange(len(fields.h), dtype=np.int32)
    at = fem.Expression(functional.incompatible(α, axis), np.array([[0.5]]))
    D.x.array[:] = at.eval(fields.mesh, cells).ravel()
    r.x.array[:] = fields.resultants().ravel()
    modified = functional.modified_functional(W, q, D, r, axis) * dx
    for energy in (potential, modified):
        difference = assembled(ufl.derivative(energy, q, w)) - force
        assert np.abs(difference).max() <= 1e-13 * size
    at = fem.Expression(strain(q, axis), np.array([[0.5]]))
    D.x.array[:] = at.eval(fields.mesh, cells).ravel()

    def enhanced_energy(e):
        return W(e + enhanced - strain(q, axis))

    mixed = functional.hu_washizu(enhanced_energy, q, D, r, axis) * dx
    assert np.abs(assembled(ufl.derivative(mixed, q, w)) - force).max() <= 1e-13 * size
    z = ufl.TestFunction(r.function_space)
    assert np.abs(assembled(ufl.derivative(mixed, r, z))).max(initial=0.0) <= 1e-15
    stiffness = np.abs(fields.stiffness.x.array).max() * np.abs(D.x.array).max()
    assert np.abs(assembled(ufl.derivative(mixed, D, z))).max(initial=0.0) <= 1e-12 * stiffness
    state.close()


# -- Newton's method -------------------------------------------------------------------------------


def loaded(petsc=None, weight=1e9):
    """A cantilever that a force bends far, and a post whose link bears a force of 1e9 N."""
    plain, stiff = ub.Section(EA=1e6, GA=4e5, EI=800.0), ub.Section(EA=1e15, GA=1e15, EI=1e15)
    arm = ub.Beam((0, 0), (1, 0), plain, cells=8)
    post = ub.Beam((3, 0), (3, 1), stiff, cells=1)
    scene = ub.Scene(
        [arm, post],
        joints=[ub.Link(ub.ground(3.0, 2.0), post.end)],
        supports=[ub.Clamped(arm.start), ub.Clamped(post.start)],
        loads=[ub.PointLoad(arm.end, force=(0, 2e3)), ub.PointLoad(post.end, force=(0, -weight))],
    )
    newton = ub.Newton(reference=True, petsc=petsc or {})
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, newton=newton)


def test_a_line_search_leaves_no_point_behind(monkeypatch):
    """Tangents, and accepted states, belong to the unknowns.

    PETSc's line search does not move the unknowns if the full step does not help and is below a
    tolerance of their norm.  The force of a link makes that norm, and so the tolerance, large.
    """
    Problem, at = StepProblem, [np.zeros(0)]
    residual, jacobian, accept = Problem._residual, Problem._jacobian, ReferenceRun.accept

    def evaluated(self, snes, x, f):
        at[0] = x.array_r.copy()
        residual(self, snes, x, f)

    def same(self, snes, x, A, P):
        assert np.array_equal(at[0], x.array_r)
        jacobian(self, snes, x, A, P)

    def accepted(self, step):
        assert np.array_equal(at[0], self.x.array_r)
        accept(self, step)

    monkeypatch.setattr(Problem, "_residual", evaluated)
    monkeypatch.setattr(Problem, "_jacobian", same)
    monkeypatch.setattr(ReferenceRun, "accept", accepted)
    full, searched = loaded(), loaded(petsc={"snes_linesearch_type": "bt"})
    assert searched.substeps == full.substeps == 2
    assert apart(full, searched) < SAME


def test_true_tangents_end_each_attempt(monkeypatch):
    """With elastic tangents, a small correction does not prove a small error."""
    solve, accept, tried = StepProblem._solve_by_snes, ReferenceRun.accept, []

    def solved(self, *attempt):
        reason = solve(self, *attempt)
        tried.append((self.stiff, reason > 0))
        return reason

    def accepted(self, step):
        assert tried[-1] == (0, True)
        accept(self, step)

    monkeypatch.setattr(StepProblem, "_solve_by_snes", solved)
    monkeypatch.setattr(ReferenceRun, "accept", accepted)
    run(weak_cell(2e7, np.pi), ub.Static(), 2.0, 0.1)
    assert (1, True) in tried  # when the section begins to yield


def test_no_attempt_is_repeated(monkeypatch):
    """A load that the hinges cannot bear; a search from the same guess would fail again."""
    section = ub.Section(EA=1e6, GA=4e5, EI=800.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, hinges={0.5: ub.Softening(20.0, 5.0)})
    push = ub.PointLoad(beam.end, force=(0.0, 60.0))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
    guesses, solve = [], StepProblem.solve
    monkeypatch.setattr(solver, "MOST_SUBSTEPS", 1)
    monkeypatch.setattr(
        StepProblem, "solve", lambda self, x: (guesses.append(x), solve(self, x))[1]
    )
    with pytest.raises(ub.ConvergenceError):
        run(scene, ub.Static(), 1.0, 1.0)
    assert len(guesses) == len({x.tobytes() for x in guesses}) > 1


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
    options = {"t0": 0.0, "start": None, "newton": ub.Newton(reference=True), "mesh": None}
    state = ReferenceRun(machine(), ub.EnergyMomentum(), comm=MPI.COMM_WORLD, **options)
    objects = [x for x in vars(state).values() if isinstance(x, PETSc.Object)] + state.matrices
    state.close()
    assert len(objects) > 5
    assert not any(x.handle for x in objects)


def test_expressions_have_the_options_of_forms(monkeypatch):
    flags, create = ["-DEXPRESSION"], fem.Expression
    monkeypatch.setattr(dolfinx_compat, "FLAGS", flags)

    def expression(*arguments, **options):
        assert options["jit_options"]["cffi_extra_compile_args"][-1:] == flags
        raise KeyboardInterrupt

    monkeypatch.setattr(fem, "Expression", expression)
    with pytest.raises(KeyboardInterrupt):
        loaded()
    assert create is not fem.Expression


# -- refusals --------------------------------------------------------------------------------------


def test_what_is_beyond_the_scope_is_refused_by_name():
    scene = machine()
    tip, arm = scene.beams[3].end, scene.beams[3]
    spring = ub.Stretch(ub.ground(0, 3), tip, ub.Spring(1e3), name="hanger")
    hardening = ub.Beam(
        (0, 0), (1, 0), arm.section, cells=2,
        hinges={0.5: ub.ElastoPlastic(20.0, isotropic=5.0)},
    )  # fmt: skip
    simple = {"supports": [ub.Clamped(hardening.start)]}
    dead = ub.Scene([hardening], **simple)
    plain = ub.Beam((0, 0), (1, 0), arm.section, cells=2)
    held = {"supports": [ub.Clamped(plain.start)]}
    cases = [
        (dead, ub.EnergyMomentum(), "the law of the hinge Hinge"),
        (ub.Scene([plain], connectors=[ub.Stretch(ub.ground(0, 3), plain.end, ub.Spring(1e3),
                  name="hanger")], **held), ub.EnergyMomentum(), "the law of hanger"),
        (ub.Scene([plain], loads=[ub.FollowerLoad(plain.end, force=(0, 1.0))], **held),
         ub.Static(), "the load FollowerLoad"),
        (ub.Scene([plain], damping=[ub.KelvinVoigt(1e-3)], **held), ub.EnergyMomentum(),
         "the damping KelvinVoigt"),
        (ub.Scene([plain], **held), ub.Newmark(), "the scheme Newmark"),
        (ub.Scene([plain], **held), ub.EnergyMomentum(order=4), "the scheme EnergyMomentum"),
    ]  # fmt: skip
    assert spring.name == "hanger"
    for refused, scheme, message in cases:
        with pytest.raises(
            ub.ArgumentError, match=f"reference=True cannot be combined with {message}"
        ):
            run(refused, scheme, 0.1, 0.05)
    degree = ub.Mesh(degree=2)
    with pytest.raises(ub.ArgumentError, match="a mesh of degree above 1"):
        run(ub.Scene([plain], **held), ub.EnergyMomentum(), 0.1, 0.05, mesh=degree)
    if MPI.COMM_WORLD.size > 1:
        one = ub.Beam((0, 0), (1, 0), arm.section, cells=1)
        with pytest.raises(ub.ArgumentError, match="processes for"):
            run(ub.Scene([one], supports=[ub.Clamped(one.start)]), ub.Static(), 1.0, 1.0)


# -- mistakes that are found -----------------------------------------------------------------------


def sign_of_jump(patch):
    """A hinge that opens adds to the strain of the bulk."""
    stress = points.Points._stress
    patch.setattr(
        points.Points,
        "_stress",
        lambda self, at: stress(self, {**at, "direction": -at["direction"]}),
    )


def mass_of_beams(patch):
    """Inertia is too large by a part in a million."""
    make = StepProblem._make_matrices

    def wrong(self):
        make(self)
        self.M.scale(1 + 1e-6)

    patch.setattr(StepProblem, "_make_matrices", wrong)


def motion_of_connectors(patch):
    """Relative motions are too large by a part in a million."""
    motions = connectors.Connectors.motions
    patch.setattr(connectors.Connectors, "motions", lambda self, q: (1 + 1e-6) * motions(self, q))


def plastic_strain(patch):
    """Plastic strains are too large by a part in a million."""
    back = points.Points.return_map

    def wrong(self, strains, *, stiff):
        back(self, strains, stiff=stiff)
        self.fields.plastic.x.array[:] *= 1 + 1e-6

    patch.setattr(points.Points, "return_map", wrong)


def stiffness(patch):
    """The stiffness of all sections is too large by a part in a million."""
    begin = forms.Fields.__init__

    def wrong(self, frame, scheme):
        begin(self, frame, scheme)
        self.stiffness.x.array[:] *= 1 + 1e-6
        self.elastic.x.array[:] *= 1 + 1e-6

    patch.setattr(forms.Fields, "__init__", wrong)


@pytest.mark.serial  # an open ledger is an error on the first process
@pytest.mark.parametrize(
    "mistake", [sign_of_jump, mass_of_beams, motion_of_connectors, plastic_strain, stiffness]
)
def test_a_mistake_is_found(mistake, monkeypatch):
    """Each changes results by more than the solvers differ."""
    scene, scheme = machine(), ub.EnergyMomentum(0.1)
    other = run(scene, scheme, 0.12, 4e-3, reference=False)
    mistake(monkeypatch)
    try:
        found = run(scene, scheme, 0.12, 4e-3)
    except (ub.ConvergenceError, ub.ModelWarning):
        return
    changes = [np.abs(found.energy[n] - other.energy[n]).max() for n in other.energy]
    through = other.energy.energy_transferred
    assert apart(found, other) > SAME or max(changes) > SAME * through
