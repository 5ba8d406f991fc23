# SPDX-License-Identifier: MIT
"""Section forces are in equilibrium with all that acts on a scene, in the equation of each step."""

import math
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
from helpers import in_turn, raises, run
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


def wind(w, v, f, t):
    return (-f * t - 0.1 * v[1]) * w[1] + 0.1 * f * t * w[2]


def heat(q, axis, M):
    return -M * axis.d(q[2]) - 5 * M * axis.d(q[0])


ACTIONS = {
    "weight": {"loads": lambda a, b: ub.Gravity(acceleration=(1.0, -9.8))},
    "line": {"loads": lambda a, b: ub.LineLoad(b, force=(5, -30), moment=2.0, amplitude=growing)},
    "frame": {"loads": lambda a, b: ub.RotatingFrame(rate=3.0)},
    "virtual work": {
        "works": lambda a, b: ub.VirtualWork("wind", wind, numbers={"f": 30.0}, beams=[a])
    },
    "potential": {"works": lambda a, b: ub.Potential("heat", heat, numbers={"M": 5.0})},
    "Rayleigh": {"damping": lambda a, b: ub.Rayleigh(mass=0.5, stiffness=1e-3)},
    "Kelvin-Voigt": {"damping": lambda a, b: ub.KelvinVoigt(1e-3)},
}
KINDS = {
    "elastic": SECTION,
    "yielding": replace(SECTION, bending=ub.ElastoPlastic(yield_limit=0.1, isotropic=200.0)),
    "opening": replace(SECTION, hinge=ub.Softening(limit=0.2, fracture_energy=1.0)),
}


def two_beams(actions, kind="elastic"):
    """Two clamped beams, joined by a pin whose force is known; and the pin."""
    a = ub.Beam((0, 0), (1, 0.4), KINDS[kind], cells=3, name="a")
    b = ub.Beam((1, 0.4), (2, 0), SECTION, cells=4, name="b")
    push = ub.PointLoad(a.at(2 / 3), force=(3.0, -20.0), moment=1.0, amplitude=growing)
    acts = {field: [make(a, b)] for field, make in ACTIONS[actions].items()}
    acts["loads"] = [push, *acts.get("loads", ())]
    joint = ub.Revolute(a.end, b.start, multipliers=True)
    supports = [ub.Clamped(a.start), ub.Clamped(b.end)]
    return ub.Scene([a, b], joints=[joint], supports=supports, **acts), joint


def require_equilibrium(run, joint):
    """Compare ends of diagrams with reactions, and with the force of a pin.

    Clamps do not turn the axes of the diagram at an end, but where a section has a hinge there.
    """
    scene, states = run.scene, np.arange(1, len(run))
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


def refused(scheme, actions):
    return (actions == "frame" and scheme in DYNAMIC[4:]) or (
        actions == "Rayleigh" and scheme not in DYNAMIC
    )


@pytest.mark.parametrize(
    ("actions", "scheme"),
    [(a, s) for a, s in in_turn(ACTIONS, SCHEMES, 4) if not refused(s, a)],
    ids=str,
)
def test_ends_of_beams_bear_what_supports_and_joints_do(actions, scheme):
    scene, joint = two_beams(actions)
    require_equilibrium(run(scene, scheme, t=(0, 0.1), dt=0.02), joint)


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(), ub.EnergyMomentumStatic(theta=0.5)], ids=str
)
def test_steps_that_are_not_kept_change_nothing(scheme):
    scene, joint = two_beams("weight")
    whole, some, most = (
        run(scene, scheme, t=(0, 0.12), dt=0.01, **more)
        for more in ({}, {"every": 3}, {"max_states": 3})
    )
    for thinned in (some, most):
        require_equilibrium(thinned, joint)
        for n, t in enumerate(thinned.times):
            k = int(np.argmin(np.abs(whole.times - t)))
            for beam in scene.beams:
                one, other = thinned.diagram(beam, n), whole.diagram(beam, k)
                assert np.abs(np.subtract(one, other)).max() < SOLVED * 100


@pytest.mark.parametrize(
    ("goes_on", "loaded"),
    [
        (ub.EnergyMomentum(), True), (ub.EnergyMomentum(0.02), False),
        (ub.EnergyMomentumDecaying(), False),
    ],
)  # fmt: skip
def test_the_first_forces_of_a_run_that_goes_on(goes_on, loaded, shared_path):
    """They are the last ones before it, from memory or a file, in diagrams and envelopes."""
    scene, _ = two_beams("weight")
    half = start = run(scene, t=(0, 0.05), dt=0.01)
    if loaded:
        half.save(shared_path / "half.h5")
        start = ub.Solution.load(shared_path / "half.h5", scene=scene)
    extremes = ub.Extremes()
    more = run(scene, goes_on, t=(0.05, 0.06), start=start, record=extremes, dt=0.01)
    for beam in scene.beams:
        first, last = more.diagram(beam, 0), half.diagram(beam)
        assert np.array_equal(first, last)
        of_steps = np.array([first[1:], more.diagram(beam, 1)[1:]])[..., [0, -1]]  # at both ends
        low = extremes.section_forces(beam).low[[0, -1]].T
        assert low == pytest.approx(of_steps.min(axis=0), rel=1e-12, abs=SOLVED)


def test_paths():
    """Diagrams are in equilibrium, and extremes those of the diagrams."""
    scene, joint = two_beams("line")
    extremes = ub.Extremes()
    path = ub.follow(scene, ub.LoadControl(0.05), steps=4, record=extremes)
    require_equilibrium(path, joint)
    require_extremes(path, extremes)


@pytest.mark.parametrize("actions", ["virtual work", "frame", "Rayleigh"])
@pytest.mark.parametrize("kind", ["elastic", "yielding"])
def test_processes_that_share_a_scene(actions, kind, monkeypatch):
    """Recorders on any process have what solutions have; together the same as one alone."""
    monkeypatch.setattr("ufl_beam.parallel.SMALLEST_SUBDOMAIN", 1)
    scene, joint = two_beams(actions, kind)
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    simulation.keep()
    for n in range(5):
        simulation.step_to(0.02 * (n + 1))
        simulation.keep()
        forces, k = simulation.section_forces(), 0
        ends = simulation.now.cell_forces(0, np.array([0.0, 1.0]))
        if n == 2 and MPI.COMM_WORLD.rank > 0:
            continue
        for beam in scene.beams:
            of_beam = simulation.solution.section_forces(beam)
            here = slice(k, k := k + len(of_beam))
            assert np.array_equal(forces[here], of_beam)
            diagram = simulation.solution.diagram(beam, points=2)
            assert np.array_equal(ends[here].reshape(-1, 3).T, diagram[1:])
    together = simulation.solution
    simulation.close()
    require_equilibrium(together, joint)
    alone = run(scene, t=(0, 0.1), dt=0.02, comm=MPI.COMM_SELF)
    for beam in scene.beams:
        one, other = together.diagram(beam), alone.diagram(beam)
        assert np.abs(np.subtract(one, other)).max() < SOLVED * np.abs(other.N).max()


# -- closed forms ----------------------------------------------------------------------------------

STIFF = ub.Section(EA=1e11, GA=1e11, EI=1e10, rhoA=100.0, rhoI=1.0)


def static(cells, degree, make, clamp=False):
    """Diagram of a stiff beam of 6 m under a work."""
    beam = ub.Beam((0, 0), (6, 0), STIFF, cells=cells)
    ends = [ub.Clamped(beam.start), ub.Clamped(beam.end)]
    supports = ends if clamp else [ub.Pinned(beam.start), ub.Roller(beam.end)]
    scene = ub.Scene([beam], supports=supports, works=[make])
    return run(scene, ub.Static(), dt=1.0, mesh=ub.Mesh(degree=degree)).diagram(beam)


def close(found, exact, part=1e-7):  # deflections change 1e-8 of them
    np.testing.assert_allclose(found, exact, atol=part * np.max(np.abs(exact)), rtol=0)


WATER = ub.VirtualWork("water", lambda w, axis, f: -f * axis.x[0] / 6 * w[1], numbers={"f": 1e4})
COUPLE = ub.VirtualWork("couple", lambda w, m: m * w[2], numbers={"m": 1e3})
GRADIENT = ub.Potential("heat", lambda q, axis, M: -M * axis.d(q[2]), numbers={"M": 54e3})


@pytest.mark.parametrize(("cells", "degree"), [(1, 1), (4, 1), (1, 2), (3, 2), (1, 3), (2, 3)])
def test_diagrams_of_works(cells, degree):
    """[closed] p = w x/l: V = w (x² - l²/3)/(2 l), M = w x (l² - x²)/(6 l).

    Of a couple V = -m, as ends are free of moments, and M = 0.  Of a thermal gradient M = -EI κ all
    along the clamped beam, 0 in the simple one.
    """
    s, N, V, M = static(cells, degree, WATER)
    x = 6.0 * s
    close(V, 1e4 * (x**2 - 12.0) / 12)
    close(M, 1e4 * x * (36.0 - x**2) / 36)
    assert np.abs(N).max() < 1e-3 * np.abs(V).max()
    _, _, V, M = static(cells, degree, COUPLE)
    close(V, -1e3)
    assert np.abs(M).max() < 1e-6 * 1e3
    assert np.abs(static(cells, degree, GRADIENT).M).max() < 1e-6 * 54e3
    _, _, V, M = static(cells, degree, GRADIENT, clamp=True)
    close(M, -54e3)
    assert np.abs(V).max() < 1e-6 * 54e3


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.GeneralizedAlpha()], ids=str)
def test_a_spinning_rod(scheme):
    """[closed] N = rhoA ω² (l²/4 - x²)/2, x from the middle; of second order in 0.02 rad."""
    rod = ub.Beam((-1, 0), (1, 0), ub.Section(EA=1e8, GA=1e8, EI=1e6, rhoA=2.0, rhoI=1e-3), cells=4)
    spin = ub.Velocity([rod], angular=2.0)
    # The stretch begins with ωy = 0: parameters that damp its vibration
    start = ub.Scene([rod], initial=[spin], damping=[ub.KelvinVoigt(1e-3)])
    s, N, V, M = run(start, scheme, t=(0, 4), dt=0.01).diagram(rod)
    exact = 2.0 * 4.0 * (1 - (2 * s - 1) ** 2) / 2
    close(N, exact, 2e-3)
    assert max(np.abs(V).max(), np.abs(M).max()) < 2e-3 * 4.0


def test_section_forces_of_places():
    """They are those of the diagram there; at a vertex of the cell before it."""
    scene, _ = two_beams("weight")
    solution = run(scene, t=(0, 0.05), dt=0.01)
    beam = scene.beams[1]  # four cells, nine points each
    for s, point in ((0.0, 0), (0.125, 4), (0.25, 8), (0.28125, 10), (1.0, 35)):
        found = solution.section_forces_at(beam.at(s))
        for n in range(len(solution)):
            exact = np.array(solution.diagram(beam, n)[1:])[:, point]
            assert np.abs(found[n] - exact).max() <= 1e-12 * max(1.0, np.abs(exact).max())


# -- supports at one node --------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()], ids=str)
@pytest.mark.parametrize(("along", "turns_first"), [((1, 0), True), ((-2, 1), False)])
def test_supports_at_one_node_have_what_they_hold(scheme, along, turns_first):
    """[closed] The force of a roller is across it, the other support bears the moment alone."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    roller, turning = ub.Roller(beam.end, along=along), ub.PrescribedDisplacement(beam.end, psi=0.0)
    both = [turning, roller] if turns_first else [roller, turning]
    scene = clamped(beam, *both, loads=[ub.LineLoad(beam, force=(0.0, -1.0))])
    simulation = ub.Simulation(scene, scheme)
    simulation.keep()
    for n in range(4):
        simulation.step_to(0.01 * (n + 1))
        simulation.keep()
    solution = simulation.solution
    of_roller, of_turning = solution.reaction(roller)[-1], solution.reaction(turning)[-1]
    assert abs(of_roller @ (*along, 0.0)) < ROUND_OFF
    assert of_roller[2] == 0.0
    assert np.array_equal(of_turning[:2], (0.0, 0.0))
    assert abs(of_turning[2]) > 1e-3
    assert simulation.press(turning) == 0.0
    assert simulation.press(roller) == pytest.approx(np.hypot(*of_roller[:2]), rel=1e-15)
    with raises("is not in the scene"):
        simulation.press(ub.Roller(beam.start, along=along))
    d = solution.diagram(beam, points=2)
    end = np.array([d.N[-1], d.V[-1], d.M[-1]])  # the end does not turn
    # Across the roller, and along it nothing but the residual
    assert np.abs(of_roller + of_turning - end).max() < 1e-9
    if scheme == ub.Static():
        total = sum(solution.reaction(support)[-1, :2] for support in scene.supports)
        assert total == pytest.approx((0.0, 1.0), abs=1e-9)
    simulation.close()


A = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="a")
B = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="b")


def test_supports_of_places_that_a_joint_puts_together():
    """Places that a joint makes one node are one node: u and v are of one support, ψ of another."""
    pin, hold = ub.Pinned(A.end), ub.PrescribedDisplacement(B.start, psi=0.0)
    push = ub.PointLoad(B.end, force=(0.0, -1.0))
    scene = rigid_chain([A, B], supports=[ub.Pinned(A.start), pin, hold], loads=[push])
    solution = run(scene, ub.Static(), dt=1.0)
    # [closed] b is a cantilever: 1 N, 1 N m
    assert solution.reaction(pin)[-1] == pytest.approx((0, 1, 0), abs=1e-6)
    assert solution.reaction(hold)[-1] == pytest.approx((0, 0, 1), abs=1e-6)
    hold = ub.PrescribedDisplacement(A.start, psi=0.0)
    joint, push = ub.Revolute(ub.ground(0, 0), A.start), ub.PointLoad(A.end, force=(0, -1.0))
    solution = run(
        ub.Scene([A], joints=[joint], supports=[hold], loads=[push]), ub.Static(), dt=1.0
    )
    # [closed] The ground bears the force, not the support
    assert solution.reaction(hold)[-1] == pytest.approx((0, 0, 1), abs=1e-6)


# -- extremes --------------------------------------------------------------------------------------


def require_extremes(run, extremes, points=2):
    """Those of the diagrams of all steps; motions to the last digit."""
    for beam in run.scene.beams:
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


@pytest.mark.parametrize(
    ("actions", "kind", "scheme"),
    [
        ("line", "elastic", ub.Static()), ("frame", "elastic", ub.EnergyMomentum()),
        ("virtual work", "elastic", ub.GeneralizedAlpha()), ("line", "yielding", ub.Static()),
        ("virtual work", "yielding", ub.EnergyMomentum()), ("frame", "yielding", ub.Static()),
        ("line", "yielding", ub.GeneralizedAlpha()),
    ],
    ids=str,
)  # fmt: skip
def test_extremes_are_those_of_the_diagrams_of_all_steps(scheme, actions, kind):
    """In C, in Python, and where a step is taken by each; recorders change nothing."""
    scene, _ = two_beams(actions, kind)
    two, three = ub.Extremes(), ub.Extremes(3)
    solution = run(scene, scheme, t=(0, 0.4), dt=0.02, record=[two, three])
    require_extremes(solution, two)
    require_extremes(solution, three, 3)
    alone = run(scene, scheme, t=(0, 0.4), dt=0.02)
    assert np.array_equal(alone.q, solution.q)
    assert np.array_equal(alone.v, solution.v)


@pytest.mark.parametrize(("cells", "degree"), [(4, 3), (16, 1), (19, 3), (150, 1)])
def test_extremes_of_any_number_of_cells(cells, degree):
    """Batches that are full and not, and more cells than C takes in at once."""
    beam = ub.Beam.arc((0, 0), 2.0, (0.0, 1.0), SECTION, cells=cells)
    load = ub.LineLoad(beam, force=(1.0, -3.0), moment=0.2, amplitude=lambda t: math.sin(9 * t))
    scene, extremes = clamped(beam, loads=[load, ub.Gravity()]), ub.Extremes(3)
    options = {"t": (0, 0.4), "dt": 0.02, "record": extremes, "mesh": ub.Mesh(degree=degree)}
    require_extremes(run(scene, **options), extremes, 3)


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("hinges", [{}, {0.5: ub.Softening(100.0, 50.0)}], ids=["elastic", "hinge"])
def test_extremes_include_substeps_on_processes_that_share_a_scene(hinges, fails, monkeypatch):
    """A turn by 3 rad divides a step, and a jump in it ends the run after some of the substeps."""
    monkeypatch.setattr("ufl_beam.parallel.SMALLEST_SUBDOMAIN", 1)
    turn, jump = ub.Table([0.0, 0.5, 0.6], [0.0, 0.0, 3.0]), 9.0 * fails
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4, hinges=hinges)
    moved = ub.PrescribedDisplacement(beam.start, psi=lambda t: turn(t) + jump * (t > 0.58))
    scene, found = ub.Scene([beam], supports=[moved]), list[ub.Extremes]()
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        found.append(extremes := ub.Extremes(3))
        try:
            solution = run(scene, record=extremes, comm=comm)
            assert not fails
        except ub.ConvergenceError as failure:
            assert fails
            solution = failure.solution
        assert solution.substeps > len(solution) + 3
        whole_steps = range(len(solution) - fails)
        of_states = max(solution.diagram(beam, n, points=3).M.max() for n in whole_steps)
        assert extremes.section_forces(beam).high[:, 2].max() > 1.05 * of_states
    for kind in (ub.Extremes.section_forces, ub.Extremes.displacement):
        one, other = (kind(extremes, beam) for extremes in found)
        size = np.abs([other.low, other.high]).max(axis=(0, 1))
        assert (np.abs([one.low - other.low, one.high - other.high]) <= SOLVED * size).all()
