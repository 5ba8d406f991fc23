# SPDX-License-Identifier: MIT
"""Section forces are in equilibrium with all that acts on a scene, in the equation of each step."""

import math

from mpi4py import MPI

import numpy as np
import pytest
from scenes import clamped, rigid_chain

import ufl_beam as ub

# Static runs warn of drag in a preload; here it is meant.
pytestmark = pytest.mark.filterwarnings("ignore:.*takes v:ufl_beam.ModelWarning")

SECTION = ub.Section(EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02)
ROUND_OFF = 1e-13  # of the largest force: sums of some ten numbers, some of them cancel
SOLVED = 1e-8  # part of the largest value that the tolerance of the solver, 1e-10, leaves at most

DYNAMIC = [
    ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.1, beta=0.1), ub.EnergyMomentumDecaying(),
    ub.EnergyMomentumPrinted(),
    ub.GeneralizedAlpha(), ub.Newmark(gamma=0.6, beta=0.4),
]  # fmt: skip
SCHEMES = [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(theta=0.5), *DYNAMIC]


def growing(t):
    return t


def virtual(a, b):
    return ub.VirtualWork(
        "wind", lambda w, v, f, t: (-f * t - 0.1 * v[1]) * w[1] + 0.1 * f * t * w[2],
        numbers={"f": 30.0}, beams=[a],
    )  # fmt: skip


def heat(a, b):
    density = lambda q, axis, M: -M * axis.d(q[2]) - 5 * M * axis.d(q[0])  # noqa: E731
    return ub.Potential("heat", density, numbers={"M": 5.0})


ACTIONS = {
    "points": {},
    "weight": {"loads": lambda a, b: ub.Gravity(acceleration=(1.0, -9.8))},
    "line": {"loads": lambda a, b: ub.LineLoad(b, force=(5, -30), moment=2.0, amplitude=growing)},
    "frame": {"loads": lambda a, b: ub.RotatingFrame(rate=3.0)},
    "virtual work": {"works": virtual},
    "potential": {"works": heat},
    "Rayleigh": {"damping": lambda a, b: ub.Rayleigh(mass=0.5, stiffness=1e-3)},
    "Kelvin-Voigt": {"damping": lambda a, b: ub.KelvinVoigt(1e-3)},
}
KINDS = {
    "elastic": SECTION,
    "yielding": ub.Section(
        EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02,
        bending=ub.ElastoPlastic(yield_limit=0.1, isotropic=200.0)
    ),
    "opening": ub.Section(
        EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02,
        hinge=ub.Softening(limit=0.2, fracture_energy=1.0),
    ),
}  # fmt: skip


def two_beams(actions="points", kind="elastic"):
    """Two clamped beams, joined by a pin whose force is known; and the pin."""
    a = ub.Beam((0, 0), (1, 0.4), KINDS[kind], cells=3, name="a")
    b = ub.Beam((1, 0.4), (2, 0), SECTION, cells=4, name="b")
    acts = {field: [make(a, b)] for field, make in ACTIONS[actions].items()}
    push = ub.PointLoad(a.at(2 / 3), force=(3.0, -20.0), moment=1.0, amplitude=growing)
    joint = ub.Revolute(a.end, b.start, multipliers=True)
    scene = ub.Scene(
        [a, b], joints=[joint], supports=[ub.Clamped(a.start), ub.Clamped(b.end)],
        damping=acts.get("damping", ()), works=acts.get("works", ()),
        loads=[push, *acts.get("loads", ())],
    )  # fmt: skip
    return scene, joint


def require_equilibrium(run, joint, states):
    """Compare ends of diagrams with reactions, and with the force of a pin.

    Clamps do not turn the axes of the diagram at an end, but where a section has a hinge there.
    """
    scene = run.scene
    a, b = scene.beams
    diagrams = {beam: [run.diagram(beam, n, points=2) for n in states] for beam in (a, b)}
    size = max(np.abs(run.reaction(support)[states]).max() for support in scene.supports)
    assert size > 0.1
    for beam, support, at, sign in ((a, scene.supports[0], 0, -1), (b, scene.supports[1], -1, 1)):
        ends = np.array([[d.N[at], d.V[at], d.M[at]] for d in diagrams[beam]])
        (x, y), (X, Y) = beam.start.point, beam.end.point
        t = np.array([X - x, Y - y]) / math.hypot(X - x, Y - y)
        plane = ends[:, :1] * t + ends[:, 1:2] * (-t[1], t[0])
        found = sign * np.column_stack([plane, ends[:, 2]])
        reactions = run.reaction(support)[states]
        if scene.hinges:
            found, reactions = (
                np.column_stack([np.linalg.norm(x[:, :2], axis=1), x[:, 2]])
                for x in (found, reactions)
            )
        # What acts at a clamp is its reaction; between it and a hinge there is the residual.
        assert np.abs(found - reactions).max() < (SOLVED if scene.hinges else ROUND_OFF) * size
    pull = np.linalg.norm(run.joint(joint).force[states], axis=1)
    for beam, at in ((a, -1), (b, 0)):
        ends = np.array([[np.hypot(d.N[at], d.V[at]), d.M[at]] for d in diagrams[beam]])
        assert np.abs(ends - np.column_stack([pull, 0 * pull])).max() < SOLVED * size


@pytest.mark.parametrize("actions", ACTIONS)
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_ends_of_beams_bear_what_supports_and_joints_do(actions, scheme):
    scene, joint = two_beams(actions)
    refused = (actions == "frame" and scheme in DYNAMIC[4:]) or (
        actions == "Rayleigh" and (scheme not in DYNAMIC)
    )
    if refused:
        pytest.skip("the scheme refuses it")
    run = ub.simulate(scene, scheme, t=(0, 0.1), dt=0.01)
    require_equilibrium(run, joint, np.arange(1, len(run)))


@pytest.mark.filterwarnings("ignore:a. the hinge of the section opened")
@pytest.mark.parametrize(
    ("kind", "scheme"),
    [
        (kind, scheme)
        for kind in ("yielding", "opening")
        for scheme in (SCHEMES[0], *SCHEMES[3:9:2])
    ],
    ids=str,
)
def test_cells_that_yield_or_break(kind, scheme):
    scene, joint = two_beams("weight" if scheme.dynamic else "line", kind)
    run = ub.simulate(scene, scheme, t=(0, 0.2), dt=0.01)
    material = run.material(scene.beams[0])
    assert (material.plastic if kind == "yielding" else material.hinge).any()
    require_equilibrium(run, joint, np.arange(1, len(run)))


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(), ub.EnergyMomentumStatic(theta=0.5)], ids=str
)
def test_thinned_saved_and_continued(scheme, shared_path):
    """Steps that are not kept change nothing; files and runs that go on have the same numbers."""
    scene, joint = two_beams("weight")
    times = {"dt": 0.01}
    whole = ub.simulate(scene, scheme, t=(0, 0.12), **times)
    some = ub.simulate(scene, scheme, t=(0, 0.12), every=3, **times)
    most = ub.simulate(scene, scheme, t=(0, 0.12), max_states=3, **times)
    for run in (some, most):
        require_equilibrium(run, joint, np.arange(1, len(run)))
        for n, t in enumerate(run.times):
            k = int(np.argmin(np.abs(whole.times - t)))
            for beam in scene.beams:
                one, other = run.diagram(beam, n), whole.diagram(beam, k)
                assert np.abs(np.subtract(one, other)).max() < SOLVED * 100
    some.save(shared_path / "some.h5")
    loaded = ub.Solution.load(shared_path / "some.h5")
    more = ub.simulate(scene, scheme, t=(0.12, 0.13), start=whole, **times)
    for beam, same in zip(scene.beams, loaded.scene.beams, strict=True):
        for n in range(len(some)):
            assert np.array_equal(loaded.diagram(same, n), some.diagram(beam, n))
            assert np.array_equal(loaded.section_forces(same, n), some.section_forces(beam, n))
        if scheme.dynamic:  # of the last step
            assert np.array_equal(more.diagram(beam, 0), whole.diagram(beam))


@pytest.mark.parametrize(
    "goes_on", [ub.EnergyMomentum(), ub.EnergyMomentum(0.02), ub.EnergyMomentumDecaying()]
)
@pytest.mark.parametrize("loaded", [False, True])
def test_the_first_forces_of_a_run_that_goes_on(goes_on, loaded, shared_path):
    """They are the last ones before it, from memory or a file, in diagrams and envelopes."""
    scene, _ = two_beams("weight")
    times = {"dt": 0.01}
    half = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.05), **times)
    start = half
    if loaded:
        half.save(shared_path / "half.h5")
        start = ub.Solution.load(shared_path / "half.h5", scene=scene)
    extremes = ub.Extremes()
    more = ub.simulate(scene, goes_on, t=(0.05, 0.06), start=start, record=extremes, **times)
    for beam in scene.beams:
        first, last = more.diagram(beam, 0), half.diagram(beam)
        assert np.array_equal(first, last)
        of_steps = np.array([first[1:], more.diagram(beam, 1)[1:]])[..., [0, -1]]  # at both ends
        low = extremes.section_forces(beam).low[[0, -1]].T
        assert low == pytest.approx(of_steps.min(axis=0), rel=1e-12, abs=SOLVED)


@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentum(), ub.EnergyMomentumDecaying()], ids=str
)
def test_as_in_the_reference_path(scheme, as_by_reference):
    scene, _ = two_beams("virtual work", "yielding")
    as_by_reference(ub.simulate(scene, scheme, t=(0, 0.1), dt=0.02), 1e-7)


def test_section_forces_along_a_path_are_in_equilibrium():
    scene, joint = two_beams("line")
    path = ub.follow(scene, ub.LoadControl(0.05), steps=4)
    require_equilibrium(path, joint, np.arange(1, len(path)))


@pytest.mark.parametrize("actions", ["virtual work", "frame", "Rayleigh"])
@pytest.mark.parametrize("kind", ["elastic", "yielding"])
def test_processes_that_share_a_scene(actions, kind, monkeypatch):
    monkeypatch.setattr("ufl_beam.parallel.SMALLEST_SUBDOMAIN", 1)
    scene, joint = two_beams(actions, kind)
    options = {"t": (0, 0.1), "dt": 0.02}
    extremes, others = ub.Extremes(3), ub.Extremes(3)
    run = ub.simulate(scene, ub.EnergyMomentum(), record=extremes, **options)
    alone = ub.simulate(scene, ub.EnergyMomentum(), record=others, comm=MPI.COMM_SELF, **options)
    require_equilibrium(run, joint, np.arange(1, len(run)))
    for beam in scene.beams:
        one, other = run.diagram(beam), alone.diagram(beam)
        size = np.abs(other.N).max()
        assert np.abs(np.subtract(one, other)).max() < SOLVED * size
        one, other = (of.section_forces(beam).low for of in (extremes, others))
        assert np.abs(one - other).max() < SOLVED * size


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize(
    "hinges", [{}, {0.5: ub.Softening(limit=100.0, fracture_energy=50.0)}], ids=["elastic", "hinge"]
)
def test_extremes_include_substeps_on_processes_that_share_a_scene(hinges, fails, monkeypatch):
    """A turn by 3 rad divides a step, and a jump in it ends the run after some of the substeps."""
    monkeypatch.setattr("ufl_beam.parallel.SMALLEST_SUBDOMAIN", 1)
    turn, jump = ub.Table([0.0, 0.5, 0.6], [0.0, 0.0, 3.0]), 9.0 * fails
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4, hinges=hinges)
    moved = ub.PrescribedDisplacement(beam.start, psi=lambda t: turn(t) + jump * (t > 0.58))
    scene, found = ub.Scene([beam], supports=[moved]), list[ub.Extremes]()
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        found.append(extremes := ub.Extremes(3))
        options = {"t": (0, 1), "dt": 0.1, "record": extremes, "comm": comm}
        if fails:
            with pytest.raises(ub.ConvergenceError) as failure:
                ub.simulate(scene, ub.EnergyMomentum(), **options)
            run = failure.value.solution
        else:
            run = ub.simulate(scene, ub.EnergyMomentum(), **options)
        assert run.substeps > len(run) + 3
        whole_steps = range(len(run) - fails)
        of_states = max(run.diagram(beam, n, points=3).M.max() for n in whole_steps)
        assert extremes.section_forces(beam).high[:, 2].max() > 1.05 * of_states
    for kind in (ub.Extremes.section_forces, ub.Extremes.displacement):
        one, other = (kind(extremes, beam) for extremes in found)
        size = np.abs([other.low, other.high]).max(axis=(0, 1))
        assert (np.abs([one.low - other.low, one.high - other.high]) <= SOLVED * size).all()


@pytest.mark.parametrize("action", ACTIONS)
def test_of_a_simulation(action):
    """What recorders ask for is what solutions have, on any process without the others."""
    scene, _ = two_beams(action)
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    for n in range(4):
        simulation.step_to(0.01 * (n + 1))
        simulation.keep()
        forces, k = simulation.section_forces(), 0
        ends = simulation.now.cell_forces(0, np.array([0.0, 1.0]))
        if n == 2 and MPI.COMM_WORLD.rank > 0:
            continue
        for beam in scene.beams:
            of_beam = simulation.solution.section_forces(beam)
            diagram = simulation.solution.diagram(beam, points=2)
            here = slice(k, k := k + len(of_beam))
            assert np.array_equal(forces[here], of_beam)
            assert np.array_equal(ends[here].reshape(-1, 3).T, diagram[1:])
    simulation.close()


# -- closed forms ----------------------------------------------------------------------------------

STIFF = ub.Section(EA=1e11, GA=1e11, EI=1e10, rhoA=100.0, rhoI=1.0)


def static(cells, degree, **more):
    beam = ub.Beam((0, 0), (6, 0), STIFF, cells=cells)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    made = {field: [make(beam) for make in makes] for field, makes in more.items()}
    scene = ub.Scene([beam], supports=supports, **made)
    options = {"t": (0, 1), "dt": 1.0, "mesh": ub.Mesh(degree=degree)}
    return ub.simulate(scene, ub.Static(), **options).diagram(beam)


def close(found, exact, part=1e-7):  # deflections change 1e-8 of them
    np.testing.assert_allclose(found, exact, atol=part * np.max(np.abs(exact)), rtol=0)


def water(beam):
    return ub.VirtualWork("water", lambda w, axis, f: -f * axis.x[0] / 6 * w[1], numbers={"f": 1e4})


def couple(beam):
    return ub.VirtualWork("couple", lambda w, m: m * w[2], numbers={"m": 1e3})


def gradient(beam):
    return ub.Potential("heat", lambda q, axis, M: -M * axis.d(q[2]), numbers={"M": 54e3})


@pytest.mark.parametrize(("cells", "degree"), [(1, 1), (4, 1), (1, 2), (3, 2), (1, 3), (2, 3)])
def test_a_hydrostatic_load_by_a_work(cells, degree):
    """[closed] p = w x/l: V = w (x² - l²/3)/(2 l), M = w x (l² - x²)/(6 l)."""
    s, N, V, M = static(cells, degree, works=[water])
    x = 6.0 * s
    close(V, 1e4 * (x**2 - 12.0) / 12)
    close(M, 1e4 * x * (36.0 - x**2) / 36)
    assert np.abs(N).max() < 1e-3 * np.abs(V).max()


@pytest.mark.parametrize("degree", [1, 3])
def test_a_couple_by_a_work(degree):
    """[closed] V = -m, as ends are free of moments; M = 0 everywhere."""
    _, _, V, M = static(3, degree, works=[couple])
    close(V, -1e3)
    assert np.abs(M).max() < 1e-6 * 1e3


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_thermal_gradient_by_a_potential(degree):
    """[closed] -EI κ all along the clamped beam, 0 in the simple one."""
    _, _, _, M = static(4, degree, works=[gradient])
    assert np.abs(M).max() < 1e-6 * 54e3
    beam = ub.Beam((0, 0), (6, 0), STIFF, cells=4)
    supports = [ub.Clamped(beam.start), ub.Clamped(beam.end)]
    scene = ub.Scene([beam], supports=supports, works=[gradient(beam)])
    options = {"t": (0, 1), "dt": 1.0, "mesh": ub.Mesh(degree=degree)}
    run = ub.simulate(scene, ub.Static(), **options)
    close(run.diagram(beam).M, -54e3)
    assert np.abs(run.diagram(beam).V).max() < 1e-6 * 54e3


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.GeneralizedAlpha()], ids=str)
def test_a_spinning_rod(scheme):
    """[closed] N = rhoA ω² (l²/4 - x²)/2, x from the middle; of second order in 0.02 rad."""
    rod = ub.Beam((-1, 0), (1, 0), ub.Section(EA=1e8, GA=1e8, EI=1e6, rhoA=2.0, rhoI=1e-3), cells=4)
    spin = ub.Velocity([rod], angular=2.0)
    # The stretch begins with ωy = 0: parameters that damp its vibration
    start = ub.Scene([rod], initial=[spin], damping=[ub.KelvinVoigt(1e-3)])
    run = ub.simulate(start, scheme, t=(0, 4), dt=0.01)
    s, N, V, M = run.diagram(rod)
    exact = 2.0 * 4.0 * (1 - (2 * s - 1) ** 2) / 2
    close(N, exact, 2e-3)
    assert max(np.abs(V).max(), np.abs(M).max()) < 2e-3 * 4.0


def test_section_forces_of_places():
    """They are those of the diagram there; at a vertex of the cell before it."""
    scene, _ = two_beams("weight")
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.05), dt=0.01)
    beam = scene.beams[1]  # four cells, nine points each
    for s, point in ((0.0, 0), (0.125, 4), (0.25, 8), (0.28125, 10), (1.0, 35)):
        found = run.section_forces_at(beam.at(s))
        for n in range(len(run)):
            exact = np.array(run.diagram(beam, n)[1:])[:, point]
            assert np.abs(found[n] - exact).max() <= 1e-12 * max(1.0, np.abs(exact).max())


# -- supports at one node --------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()], ids=str)
@pytest.mark.parametrize("along", [(1, 0), (1, 1), (-2, 1)])
@pytest.mark.parametrize("turns_first", [False, True])
def test_supports_at_one_node_have_what_they_hold(scheme, along, turns_first):
    """[closed] The force of a roller is across it, the other support bears the moment alone."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    roller, turning = ub.Roller(beam.end, along=along), ub.PrescribedDisplacement(beam.end, psi=0.0)
    clamp, both = ub.Clamped(beam.start), [roller, turning]
    scene = ub.Scene(
        [beam], supports=[clamp, *(reversed(both) if turns_first else both)],
        loads=[ub.LineLoad(beam, force=(0.0, -1.0))],
    )  # fmt: skip
    simulation = ub.Simulation(scene, scheme)
    simulation.keep()
    for n in range(4):
        simulation.step_to(0.01 * (n + 1))
        simulation.keep()
    run = simulation.solution
    of_roller, of_turning = run.reaction(roller)[-1], run.reaction(turning)[-1]
    assert abs(of_roller @ (*along, 0.0)) < ROUND_OFF
    assert of_roller[2] == 0.0
    assert np.array_equal(of_turning[:2], (0.0, 0.0))
    assert abs(of_turning[2]) > 1e-3
    assert simulation.press(turning) == 0.0
    assert simulation.press(roller) == pytest.approx(np.hypot(*of_roller[:2]), rel=1e-15)
    with pytest.raises(ub.ArgumentError, match="is not in the scene"):
        simulation.press(ub.Roller(beam.start, along=along))
    d = run.diagram(beam, points=2)
    end = np.array([d.N[-1], d.V[-1], d.M[-1]])  # the end does not turn
    # Across the roller, and along it nothing but the residual
    assert np.abs(of_roller + of_turning - end).max() < 1e-9
    if scheme == ub.Static():
        total = sum(run.reaction(support)[-1, :2] for support in scene.supports)
        assert total == pytest.approx((0.0, 1.0), abs=1e-9)
    simulation.close()


def test_supports_of_places_that_a_joint_puts_together():
    """Places that a joint makes one node are one node: u and v are of one support, ψ of another."""
    a = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="a")
    b = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="b")
    pin, hold = ub.Pinned(a.end), ub.PrescribedDisplacement(b.start, psi=0.0)
    scene = rigid_chain(
        [a, b],
        supports=[ub.Pinned(a.start), pin, hold],
        loads=[ub.PointLoad(b.end, force=(0.0, -1.0))],
    )
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    # [closed] b is a cantilever: 1 N, 1 N m
    assert run.reaction(pin)[-1] == pytest.approx((0, 1, 0), abs=1e-6)
    assert run.reaction(hold)[-1] == pytest.approx((0, 0, 1), abs=1e-6)
    grounded = ub.Scene(
        [a], joints=[ub.Revolute(ub.ground(0, 0), a.start)],
        supports=[ub.PrescribedDisplacement(a.start, psi=0.0)],
        loads=[ub.PointLoad(a.end, force=(0, -1.0))],
    )  # fmt: skip
    run = ub.simulate(grounded, ub.Static(), t=(0, 1), dt=1.0)
    # [closed] The ground bears the force, not the support
    assert run.reaction(grounded.supports[0])[-1] == pytest.approx((0, 0, 1), abs=1e-6)


@pytest.mark.parametrize(
    ("one", "other", "held"),
    [
        (lambda p: ub.Pinned(p), lambda p: ub.Roller(p), "v"),
        (lambda p: ub.Roller(p, along=(1, 1)), lambda p: ub.Roller(p, along=(-1, 1)), "u"),
        (lambda p: ub.Roller(p, along=(1, 2)), lambda p: ub.PrescribedDisplacement(p, u=0.0), "u"),
        (lambda p: ub.PrescribedDisplacement(p, psi=0.1), lambda p: ub.Clamped(p), "psi"),
    ],
)
def test_two_supports_that_hold_the_same_are_refused(one, other, held):
    a = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="a")
    b = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="b")
    with pytest.raises(
        ub.ArgumentError, match=f"supports in conflict: .* both hold {held}; remove"
    ):
        rigid_chain([a, b], supports=[one(a.end), other(b.start)])


# -- extremes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("points", [2, 3])
@pytest.mark.parametrize("actions", ["line", "virtual work", "frame"])
@pytest.mark.parametrize("kind", ["elastic", "yielding"])
@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentum(), ub.GeneralizedAlpha()], ids=str
)
def test_extremes_are_those_of_the_diagrams_of_all_steps(scheme, actions, kind, points):
    """In C, in Python, and where a step is taken by each; motions to the last digit."""
    if actions == "frame" and scheme == ub.GeneralizedAlpha():
        pytest.skip("the scheme refuses it")
    scene, _ = two_beams(actions, kind)
    require_extremes(scene, scheme, points)


def require_extremes(scene, scheme, points, **options):
    extremes = ub.Extremes(points)
    times = {"t": (0, 0.4), "dt": 0.02, **options}
    run = ub.simulate(scene, scheme, record=extremes, **times)
    assert len(run) == 21
    for beam in scene.beams:
        kept = range(len(run))
        values = np.array([np.transpose(run.diagram(beam, n, points=points)[1:]) for n in kept])
        found, size = extremes.section_forces(beam), np.abs(values).max()
        assert found.low.shape == values.shape[1:]
        assert np.abs(found.low - values.min(axis=0)).max() < ROUND_OFF * size
        assert np.abs(found.high - values.max(axis=0)).max() < ROUND_OFF * size
        for extreme, when in ((found.low, found.time_low), (found.high, found.time_high)):
            at = np.abs(run.times - when[..., None]).argmin(axis=-1)
            reached = np.take_along_axis(values, at[None], axis=0)[0]
            assert np.abs(reached - extreme).max() < ROUND_OFF * size
        motion = run.q[:, run.numbering.dofs[run.numbering.nodes_along(beam)]]
        assert np.array_equal(extremes.displacement(beam).low, motion.min(axis=0))
        assert np.array_equal(extremes.displacement(beam).high, motion.max(axis=0))


@pytest.mark.parametrize("cells", [4, 8, 16, 19, 150])
@pytest.mark.parametrize("degree", [1, 3])
def test_extremes_of_any_number_of_cells(cells, degree):
    """Batches that are full and not, and more cells than C takes in at once."""
    beam = ub.Beam.arc((0, 0), 2.0, (0.0, 1.0), SECTION, cells=cells)
    load = ub.LineLoad(beam, force=(1.0, -3.0), moment=0.2, amplitude=lambda t: math.sin(9 * t))
    scene = clamped(beam, loads=[load, ub.Gravity()])
    require_extremes(scene, ub.EnergyMomentum(), 3, mesh=ub.Mesh(degree=degree))
    require_extremes(scene, ub.Static(), 2, mesh=ub.Mesh(degree=degree))


def test_extremes_of_paths():
    scene, _ = two_beams("line")
    extremes = ub.Extremes()
    path = ub.follow(scene, ub.LoadControl(0.05), steps=4, record=extremes)
    beam = scene.beams[0]
    M = np.array([path.diagram(beam, n, points=2).M for n in range(len(path))])
    found = extremes.section_forces(beam)
    assert np.abs(found.low[:, 2] - M.min(axis=0)).max() < ROUND_OFF * np.abs(M).max()


def test_a_recorder_of_extremes_changes_nothing():
    """Nor does it bring Python into the steps."""
    scene, _ = two_beams("weight")
    times = {"t": (0, 0.4), "dt": 0.01}
    alone = ub.simulate(scene, ub.EnergyMomentum(), **times)
    watched = ub.simulate(
        scene, ub.EnergyMomentum(), record=[ub.Extremes(), ub.Extremes(3)], **times
    )
    assert np.array_equal(alone.q, watched.q)
    assert np.array_equal(alone.v, watched.v)
    with pytest.raises(ub.ArgumentError, match="Extremes: points = 1 "):
        ub.Extremes(1)


def test_the_envelope_of_a_clamped_beam():
    """[closed] w l²/12 at the clamps but for the mesh; means of eight cells say 2/3 of it."""
    beam = ub.Beam((0, 0), (6, 0), STIFF, cells=8)
    supports = [ub.Clamped(beam.start), ub.Clamped(beam.end)]
    load = ub.LineLoad(beam, force=(0, -1e4), amplitude=growing)
    scene = ub.Scene([beam], supports=supports, loads=[load])
    extremes = ub.Extremes()
    options = {"t": (0, 1), "dt": 0.25, "record": extremes}
    run = ub.simulate(scene, ub.Static(), **options)
    found = extremes.section_forces(beam)
    # Linear cells err by h²/l², 1/64 [closed]; the reaction has the same error
    assert found.low[0, 2] == pytest.approx(-run.reaction(supports[0])[-1, 2], rel=1e-12)
    assert found.low[:, 2].min() == pytest.approx(-30e3 * (1 - 1 / 64), rel=1e-6)
    assert found.high[:, 2].max() == pytest.approx(15e3 * (1 + 2 / 64), rel=1e-6)
