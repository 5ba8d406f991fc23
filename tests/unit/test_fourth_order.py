# SPDX-License-Identifier: MIT
"""`EnergyMomentum(order=4)`: a step of five stages, one step for everything outside of it."""

import math

import numpy as np
import pytest
from failing_steps import let_fail
from helpers import raises
from run_differences import defaults, difference

import ufl_beam as ub

FOURTH = ub.EnergyMomentum(order=4)
TIGHT = ub.Newton(rtol=1e-12)
NUMBERS = {"EA": 1e3, "GA": 1e3, "EI": 30.0, "rhoA": 1.0, "rhoI": 0.5}
SECTION = ub.Section(**NUMBERS)
SAME = 1e-9
"""Newton's method leaves 1e-10 of the forces in each stage of some ten steps."""


def smooth(t):
    """A factor that grows from 0 to 1 without kinks."""
    return t**4 / (1 + t**4)


def arm(section=SECTION, **more):
    return ub.Beam((0, 0), (3, 0), section, cells=2, **more)


def held(beam, *loads, **parts):
    """A cantilever under a smooth force, with further parts."""
    push = ub.PointLoad(beam.end, force=(2.0, -9.0), amplitude=smooth)
    return ub.Scene(
        [beam], loads=[push, *loads], **({"supports": [ub.Clamped(beam.start)]} | parts)
    )


def turned(beam, law):
    """A beam that is pinned at its start, and turned there by a law."""
    turn = ub.Turn(ub.ground(0, 0), beam.start, law)
    return held(beam, supports=[ub.Pinned(beam.start)], connectors=[turn])


def linked():
    """Two beams that turn far, with a link between them, which has a multiplier."""
    a, b = arm(), ub.Beam((4, 0), (6, 1), SECTION, cells=2)
    loads = [ub.FollowerLoad(b.end, force=(0.0, -9.0)), ub.Gravity((0.0, -3.0))]
    joints, supports = [ub.RigidLink(a.end, b.start)], [ub.Pinned(a.start)]
    return ub.Scene([a, b], joints=joints, supports=supports, loads=loads)


def go(scene, t=(0, 1.0), dt=0.1, **options):
    return ub.simulate(scene, FOURTH, t=t, dt=dt, **{"newton": TIGHT, **options})


# -- the scheme and its refusals -----------------------------------------------------------------


def test_errors_of_third_order_cancel_in_the_sum_of_the_stages():
    """Suzuki 1990: lengths with the sum 1 whose cubes have the sum 0."""
    lengths = np.array(FOURTH.stages)
    assert lengths == pytest.approx([lengths[0]] * 2 + [1 - 4 * lengths[0]] + [lengths[0]] * 2)
    assert lengths.sum() == pytest.approx(1, abs=1e-15)
    assert (lengths**3).sum() == pytest.approx(0, abs=1e-15)
    assert ub.EnergyMomentum().stages == (1.0,)


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_numerical_dissipation_is_refused_by_name(name):
    with raises(f"{name} = 0.1 dissipates", "order=2"):
        ub.EnergyMomentum(**{name: 0.1}, order=4)


def on_end(law):
    return lambda b: held(b, connectors=[ub.Slide(ub.ground(3, 0), b.end, law, axis=(0, 1))])


def drag(v, w):
    return -v[0] * w[0] - v[1] * w[1]


REFUSED = {
    "Rayleigh": lambda b: held(b, damping=[ub.Rayleigh(mass=0.1)]),
    "KelvinVoigt": lambda b: held(b, damping=[ub.KelvinVoigt(0.1)]),
    "Damper of Slide": on_end(ub.Damper(1.0)),
    "Coulomb of Slide": on_end(ub.Coulomb(1.0)),
    "RigidPlastic of Slide": on_end(ub.RigidPlastic(ub.ElastoPlastic(5.0))),
    "Spring of Slide": on_end(ub.Spring(5.0, law=ub.ElastoPlastic(1.0))),
    "Stop of Slide": on_end(ub.Stop(100.0, high=0.1)),
    "ForceLaw of Slide": on_end(ub.ForceLaw(lambda motion, rate: motion)),
    "Controller of Slide": on_end(ub.Controller(lambda state: 0.0)),
    "MovingLoad": lambda b: held(b, ub.MovingLoad(b, force=(0, -1), position=lambda t: t)),
    "VirtualWork 'air'": lambda b: held(b, works=[ub.VirtualWork("air", drag)]),
    "beam may yield or break": lambda b: held(
        arm(ub.Section(**NUMBERS, bending=ub.ElastoPlastic(10.0)))
    ),
    "RigidPlastic of": lambda b: held(arm(hinges={0.5: ub.ElastoPlastic(5.0)})),
}


@pytest.mark.parametrize("part", REFUSED)
def test_a_part_that_dissipates_or_has_kinks_is_refused_by_name(part):
    with raises("EnergyMomentum of fourth order: ", part, "order", kind=ub.ModelError):
        go(REFUSED[part](arm()))


# -- orders --------------------------------------------------------------------------------------


PARTS = {
    "loads": lambda b: held(
        b,
        ub.FollowerLoad(b.end, force=(0, -5)),
        ub.Pressure(b, 15.0, amplitude=smooth),
        ub.LineLoad(b, (0, -9), amplitude=smooth),
    ),
    "rotating frame": lambda b: held(b, ub.RotatingFrame(0.7)),
    "imposed strain": lambda b: held(
        b, ub.ImposedStrain(b, axial=0.05, curvature=0.3, amplitude=smooth)
    ),
    "works": lambda b: held(
        b,
        works=[
            ub.Potential("soil", lambda q, k: k * (q[1] ** 2 + q[1] ** 4), numbers={"k": smooth}),
            ub.VirtualWork("push", lambda q, w, t: -(t**4) * (1 + q[0] ** 2) * w[1]),
        ],
    ),
    "springs": lambda b: held(b, connectors=[ub.Stretch(ub.ground(4, 1), b.end, ub.Spring(20.0))]),
    "actuator": lambda b: turned(b, ub.PrescribedForce(lambda t: 9 * smooth(t))),
}
"""Parts that are smooth: all results are of fourth order."""


def with_body(beam):
    """A body at the end of a beam whose support moves."""
    body = ub.Body((3.5, 0.3), mass=2.0, inertia=0.4)
    move = ub.PrescribedDisplacement(beam.start, u=0, v=lambda t: 0.3 * smooth(t), psi=0)
    return held(beam, bodies=[body], joints=[ub.Rigid(beam.end, body.at(3, 0))], supports=[move])


HELD = {
    "moving support and body": with_body,
    "motor": lambda b: turned(b, ub.PrescribedMotion(smooth)),
    "guide": lambda b: held(
        b, supports=[ub.Pinned(b.start)], joints=[ub.Guided(b.end, lambda s: (3 - 0.3 * s**2, s))]
    ),
}
"""Motions that are prescribed or constrained: velocities along them are of second order."""


@pytest.mark.serial
@pytest.mark.parametrize("part", [*PARTS, *HELD])
def test_orders_of_motions_and_velocities(part):
    """At 1.6 s, by differences of successive runs: the next term of the error is of sixth order.

    The steps resolve the fastest vibration, of about 70 rad/s: a stage of the longest one turns it
    by 0.2 rad.
    """
    make, ends = (PARTS | HELD)[part], []
    for steps in (200, 400, 800):
        run = go(make(arm()), t=(0, 1.6), dt=1.6 / steps, every=steps)
        assert run.energy.worst < SAME
        free = run.numbering.scales > 0  # no multipliers
        ends.append((run.q[-1][free], run.v[-1][free]))
    coarse, middle, fine = (np.array(end) for end in ends)
    changes, finer = (np.abs(change).max(axis=1) for change in (middle - coarse, fine - middle))
    motions, velocities = np.log2(changes / finer)
    off = 0.15 if part in HELD else 0.1
    assert motions == pytest.approx(4, abs=off)
    assert velocities == pytest.approx(2 if part in HELD else 4, abs=off)


# -- a step that fails ---------------------------------------------------------------------------


def on_a_rail(beam):
    slider = ub.Body((4, 1), mass=1.0, inertia=0.2)
    rail = [ub.Prismatic(beam.end, slider.middle)]
    move = ub.PrescribedDisplacement(slider.middle, u=smooth)
    return held(beam, bodies=[slider], joints=rail, supports=[ub.Pinned(beam.start), move])


@pytest.mark.filterwarnings("ignore:.*")
@pytest.mark.parametrize("make", [lambda beam: linked(), HELD["motor"], on_a_rail])
def test_a_step_whose_last_stage_fails_is_taken_back(make):
    """State and ledger are those of two steps of half the length, also works of multipliers."""
    scene = make(arm())
    one, other = (ub.Simulation(scene, FOURTH, newton=TIGHT) for _ in range(2))
    first = iter([True])
    let_fail(one, lambda t1: t1 == 0.4 and next(first, False))
    for t in (0.2, 0.4):
        one.step_to(t)
    for t in (0.2, 0.3, 0.4):
        other.step_to(t)
    assert one.substeps == other.substeps == 3
    for a, b in ((one.q, other.q), (one.inertia.v, other.inertia.v)):
        np.testing.assert_allclose(a, b, rtol=0, atol=SAME * max(scene.size, np.abs(b).max()))
    energy = sum(map(abs, other.entries()[0].values()))
    for found, expected in zip(one.entries(), other.entries(), strict=True):
        assert found == pytest.approx(expected, abs=SAME * energy)
    one.close(), other.close()


def test_derivatives_of_stages_are_taken_back_with_a_step_that_is_divided():
    def swing(EI=100.0, rate=0.5):
        section = ub.Section(EA=1e4, GA=4e3, EI=EI, rhoA=1.0, rhoI=0.01)
        beam = ub.Beam((0, 0), (2, 0), section, cells=4)
        pin = ub.Revolute(ub.ground(0, 0), beam.start, multipliers=True)
        turn = ub.Turn(ub.ground(0, 0), beam.start, ub.PrescribedMotion(lambda t: rate * t**2))
        return ub.Scene([beam], joints=[pin], loads=[ub.Gravity()], connectors=[turn])

    options = {"t": (0, 2.0), "dt": 0.5, "newton": ub.Newton(max_iterations=4)}
    found = ub.differentiate(swing, at := defaults(swing), FOURTH, **options)
    assert found.solution.substeps > len(found.solution)
    slopes = found.of(lambda s: s.q)
    for p, (name, value) in enumerate(at.items()):

        def motion(x, name=name):
            return ub.simulate(swing(**{name: x}), FOURTH, **options).q

        expected = difference(motion, value, 1e-4 * value)
        size = np.abs(expected).max(axis=0)  # of 15 motions, and of larger forces of joints
        error = np.abs(slopes[..., p] - expected).max(axis=0)
        assert np.all(error <= 1e-7 * np.maximum(size, size[:15].max()))


@pytest.mark.parametrize(
    ("dt", "part"), [(0.1, 0.3), (ub.Adaptive(1e-4, first=0.1, longest=0.1), 0.85)], ids=str
)
def test_a_run_that_ends_within_a_step_ends_in_the_last_whole_step(dt, part):
    """In a stage, after others; or between solving and accepting, where errors are estimated."""
    # The last midpoint of a stage is at 0.79 of a step, the last sample of Gauss's rule at 0.89.
    stop = [math.inf]

    def late(t):
        if t > stop[0]:
            raise RuntimeError("no value")
        return 1.0

    scene = held(arm(), ub.Gravity(amplitude=late))
    whole = go(scene, t=(0, 0.4), dt=dt)
    begin, end = whole.times[-2:]
    stop[0] = begin + part * (end - begin)
    with pytest.raises(RuntimeError, match="no value") as error:
        go(scene, t=(0, 0.4), dt=dt)
    solution = error.value.solution
    assert solution.times[-1] == pytest.approx(begin, abs=1e-12)
    assert solution.energy.worst < SAME
    np.testing.assert_allclose(solution.q[-1], whole.q[-2], rtol=0, atol=SAME)


# -- a step is one step for everything outside ---------------------------------------------------


@pytest.mark.parametrize("mesh", [ub.Mesh(), ub.Mesh(degree=2)], ids=str)
def test_forces_are_means_over_the_last_stage_and_agree_with_reactions(mesh):
    """At its ends the beam bears the reaction, and the force of the load in mid-stage."""
    # A rotation of 0.1 rad in a stage would change the direction of a force by 1e-3.
    beam = arm()
    scene = held(beam, ub.LineLoad(beam, (0.0, -3.0), amplitude=smooth))
    run, dt = go(scene, dt=0.05, mesh=mesh), 0.05
    last = FOURTH.stages[-1] * dt
    for n in (5, 20):
        begun = run.before(n)
        assert np.abs(begun - run.q[n - 1]).max() > 1e-3 * np.abs(begun).max()
        reaction = run.reaction(scene.supports[0])[n]
        np.testing.assert_allclose(run.section_forces_at(beam.start)[n], -reaction, rtol=1e-9)
        force = np.array([2.0, -9.0]) * smooth(run.times[n] - last / 2)
        turn = (run.displacement(beam.end)[n, 2] + begun[run.numbering.node(beam.end)[2]]) / 2
        c, s = math.cos(turn), math.sin(turn)
        N, V, M = run.section_forces_at(beam.end)[n]
        np.testing.assert_allclose([c * N - s * V, s * N + c * V], force, rtol=1e-3)
        assert abs(M) < 1e-9 * abs(reaction[2])
    # The last stage begins near the motion at that time; stages have errors of second order.
    short = go(scene, t=(0, 1.0 - last), dt=dt, mesh=mesh)
    assert np.abs(run.before(20) - short.q[-1]).max() < 1e-4 * scene.size


@pytest.mark.filterwarnings("ignore:.*")
def test_the_reference_solver_agrees(as_by_reference):
    as_by_reference(go(linked(), t=(0, 2.0), dt=0.5), 1e-8)


# -- adaptive steps ------------------------------------------------------------------------------


@pytest.mark.parametrize("part", ["springs", "rotating frame", "imposed strain"])
def test_adaptive_steps_meet_the_tolerance_with_steps_by_its_fifth_root(part):
    """The sum of the estimates bounds the error, and has its size; a step errs by dt^5."""
    beam = arm()
    scene = PARTS[part](beam)
    fine = {"dt": 1.6 / 2000, "every": 2000}
    exact = go(scene, t=(0, 1.6), **fine).displacement(beam.end)[-1]
    steps = []
    for tolerance in (1e-6, 1e-8):
        run = go(scene, t=(0, 1.6), dt=ub.Adaptive(tolerance), newton=ub.Newton())
        error = np.abs(run.displacement(beam.end)[-1] - exact) / [scene.size, scene.size, 1]
        assert 0.005 * run.time_error < error.max() < 2 * run.time_error
        steps.append(len(run) - 1)
    assert steps[1] / steps[0] == pytest.approx(100 ** (1 / 5), rel=0.25)


# -- speed and accuracy --------------------------------------------------------------------------


@pytest.mark.serial
def test_a_trade_off_extrapolates_with_the_order_of_the_scheme():
    beam = arm()
    found = ub.tradeoff(
        held(beam), {"tip": lambda run: run.displacement(beam.end)[-1, :2]}, scheme=FOURTH,
        t=(0, 1.6), dt=0.2, tolerance={"tip": 3e-6}, mesh=ub.Mesh(degree=3), newton=TIGHT,
    )  # fmt: skip
    steps = found.convergence["tip"].steps
    assert steps.method == 4
    assert 3.5 < steps.order < 5
    assert found.ratio(found.best) <= 1
