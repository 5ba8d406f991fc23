# SPDX-License-Identifier: MIT
"""`EnergyMomentum(order=4)`: a step of five stages, one step for everything outside of it."""

import math

from mpi4py import MPI

import numpy as np
import pytest
from helpers import at_step, raises, stop_after

import ufl_beam as ub

FOURTH = ub.EnergyMomentum(order=4)
TIGHT = ub.Newton(rtol=1e-12)
SECTION = ub.Section(EA=1e3, GA=1e3, EI=30.0, rhoA=1.0, rhoI=0.5)
YIELDING = ub.Section(EA=1e3, GA=1e3, EI=30.0, rhoA=1.0, rhoI=0.5, bending=ub.ElastoPlastic(10.0))
SAME = 1e-9
"""Newton's method leaves 1e-10 of the forces in each stage of some ten steps."""


def smooth(t):
    """A factor that grows from 0 to 1 without kinks."""
    return t**4 / (1 + t**4)


def arm(*, section=SECTION, start=(0.0, 0.0), cells=2):
    return ub.Beam(start, (start[0] + 3.0, start[1]), section, cells=cells)


def held(beam, **parts):
    """A cantilever under a smooth force, with further parts."""
    push = ub.PointLoad(beam.end, force=(2.0, -9.0), amplitude=smooth)
    parts["loads"] = [push, *parts.get("loads", [])]
    return ub.Scene([beam], **({"supports": [ub.Clamped(beam.start)]} | parts))


def linked():
    """Two beams that turn far, with a link between them, which has a multiplier."""
    a, b = arm(), ub.Beam((4, 0), (6, 1), SECTION, cells=2)
    loads = [ub.FollowerLoad(b.end, force=(0.0, -9.0)), ub.Gravity((0.0, -3.0))]
    joints, supports = [ub.RigidLink(a.end, b.start)], [ub.Pinned(a.start)]
    return ub.Scene([a, b], joints=joints, supports=supports, loads=loads), b.end


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


@pytest.mark.parametrize("order", [1, 3, 5, 2.5, True, "4"])
def test_orders_other_than_two_and_four_are_refused(order):
    with raises("order"):
        ub.EnergyMomentum(order=order)


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_numerical_dissipation_is_refused_by_name(name):
    with raises(f"{name} = 0.1 dissipates", "order=2"):
        ub.EnergyMomentum(**{name: 0.1}, order=4)


def on_end(law):
    return lambda beam: {"connectors": [ub.Slide(ub.ground(3, 0), beam.end, law, axis=(0, 1))]}


REFUSED = {
    "Rayleigh": lambda beam: {"damping": [ub.Rayleigh(mass=0.1)]},
    "KelvinVoigt": lambda beam: {"damping": [ub.KelvinVoigt(0.1)]},
    "Damper of Slide": on_end(ub.Damper(1.0)),
    "Coulomb of Slide": on_end(ub.Coulomb(1.0)),
    "RigidPlastic of Slide": on_end(ub.RigidPlastic(ub.ElastoPlastic(5.0))),
    "Spring of Slide": on_end(ub.Spring(5.0, law=ub.ElastoPlastic(1.0))),
    "Stop of Slide": on_end(ub.Stop(100.0, high=0.1)),
    "ForceLaw of Slide": on_end(ub.ForceLaw(lambda motion, rate: motion)),
    "Controller of Slide": on_end(ub.Controller(lambda state: 0.0)),
    "MovingLoad": lambda beam: {
        "loads": [ub.MovingLoad(beam, force=(0, -1), position=lambda t: t)]
    },
    "VirtualWork 'air'": lambda beam: {
        "works": [ub.VirtualWork("air", lambda v, w: -v[0] * w[0] - v[1] * w[1])]
    },
}


@pytest.mark.parametrize("part", REFUSED)
def test_a_part_that_dissipates_or_has_kinks_is_refused_by_name(part):
    beam = arm()
    scene = held(beam, **REFUSED[part](beam))
    with raises("EnergyMomentum of fourth order: ", part, "order", kind=ub.ModelError):
        go(scene)


def test_material_and_hinges_that_yield_are_refused_by_the_name_of_the_beam():
    beam = arm(section=YIELDING)
    with raises("beam may yield or break", kind=ub.ModelError):
        go(held(beam))
    hinged = ub.Beam((0, 0), (3, 0), SECTION, cells=2, hinges={0.5: ub.ElastoPlastic(5.0)})
    with raises("RigidPlastic of", "may yield or break", kind=ub.ModelError):
        go(held(hinged))


# -- orders --------------------------------------------------------------------------------------


def body_and_scene(beam):
    body = ub.Body((3.5, 0.3), mass=2.0, inertia=0.4)
    return held(beam, bodies=[body], joints=[ub.Rigid(beam.end, body.at(3, 0))])


PARTS = {
    "point load": held,
    "follower load": lambda b: held(b, loads=[ub.FollowerLoad(b.end, force=(0, -5))]),
    "pressure": lambda b: held(b, loads=[ub.Pressure(b, 15.0, amplitude=smooth)]),
    "line load": lambda b: held(b, loads=[ub.LineLoad(b, (0, -9), amplitude=smooth)]),
    "rotating frame": lambda b: held(b, loads=[ub.RotatingFrame(0.7)]),
    "imposed strain": lambda b: held(
        b, loads=[ub.ImposedStrain(b, axial=0.05, curvature=0.3, amplitude=smooth)]
    ),
    "springs": lambda b: held(b, connectors=[ub.Stretch(ub.ground(4, 1), b.end, ub.Spring(20.0))]),
    "potential": lambda b: held(
        b,
        works=[
            ub.Potential("soil", lambda q, k: k * (q[1] ** 2 + q[1] ** 4), numbers={"k": smooth})
        ],
    ),
    "virtual work": lambda b: held(
        b, works=[ub.VirtualWork("push", lambda q, w, t: -(t**4) * (1 + q[0] ** 2) * w[1])]
    ),
    "actuator": lambda b: held(
        b,
        supports=[ub.Pinned(b.start)],
        connectors=[ub.Turn(ub.ground(0, 0), b.start, ub.PrescribedForce(lambda t: 9 * smooth(t)))],
    ),
}
"""Parts that are smooth: all results are of fourth order."""

HELD = {
    "moving support": lambda b: held(
        b, supports=[ub.PrescribedDisplacement(b.start, u=0, v=lambda t: 0.3 * smooth(t), psi=0)]
    ),
    "motor": lambda b: held(
        b,
        supports=[ub.Pinned(b.start)],
        connectors=[ub.Turn(ub.ground(0, 0), b.start, ub.PrescribedMotion(smooth))],
    ),
    "body": body_and_scene,
    "guide": lambda b: held(
        b, supports=[ub.Pinned(b.start)], joints=[ub.Guided(b.end, lambda s: (3 - 0.3 * s**2, s))]
    ),
}
"""Motions that are prescribed or constrained: velocities along them are of second order."""


def orders(make):
    """Orders of motions and velocities at 1.6 s, by differences of successive runs.

    The steps resolve the fastest vibration, of about 70 rad/s: a stage of the longest one turns it
    by 0.2 rad.
    """
    ends = []
    for steps in (200, 400, 800):
        run = go(make(arm()), t=(0, 1.6), dt=1.6 / steps, every=steps)
        assert run.energy.worst < SAME
        free = run.numbering.scales > 0  # no multipliers
        ends.append((run.q[-1][free], run.v[-1][free]))
    coarse, middle, fine = (np.array(end) for end in ends)
    changes, finer = (np.abs(change).max(axis=1) for change in (middle - coarse, fine - middle))
    return list(np.log2(changes / finer))


@pytest.mark.serial
@pytest.mark.parametrize("part", PARTS)
def test_smooth_scenes_are_of_fourth_order(part):
    """The next term of the error is of sixth order: a few per cent of the differences."""
    assert orders(PARTS[part]) == pytest.approx([4, 4], abs=0.1)


@pytest.mark.serial
@pytest.mark.parametrize("part", HELD)
def test_motions_with_constraints_are_of_fourth_order_and_velocities_of_second(part):
    motions, velocities = orders(HELD[part])
    assert motions == pytest.approx(4, abs=0.15)
    assert velocities == pytest.approx(2, abs=0.15)


# -- a step that fails ---------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:.*")
def test_an_attempt_that_is_taken_back_leaves_the_state():
    """All terms return, to round-off: state, ledger and the next step."""
    scene, end = linked()
    one, other = (ub.Simulation(scene, FOURTH, newton=TIGHT) for _ in range(2))
    for simulation in (one, other):
        simulation.step_to(0.1)
    one.attempt(0.3)
    one.take_back()
    assert one.t == other.t == 0.1
    size = scene.size
    for a, b in ((one.q, other.q), (one.inertia.v, other.inertia.v)):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * max(size, np.abs(b).max()))
    energy = sum(other.ledger.state.values())
    for name in ("state", "supplied", "lost"):
        for entry, value in getattr(other.ledger, name).items():
            assert getattr(one.ledger, name)[entry] == pytest.approx(value, abs=1e-12 * energy)
    for simulation in (one, other):
        simulation.step_to(0.25)
        simulation.keep()
    assert one.substeps == other.substeps == 2
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=SAME * size)
    found, expected = (x.now.reaction(scene.supports[0])[0] for x in (one, other))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert one.displacement(end) == pytest.approx(other.displacement(end), abs=SAME * size)
    one.close(), other.close()


DRIVEN = {
    "motor": lambda b: held(
        b,
        supports=[ub.Pinned(b.start)],
        connectors=[ub.Turn(ub.ground(0, 0), b.start, ub.PrescribedMotion(smooth))],
    ),
    "moving support of a rail": lambda b: held(
        b,
        bodies=[slider := ub.Body((4, 1), mass=1.0, inertia=0.2)],
        joints=[ub.Prismatic(b.end, slider.middle)],
        supports=[ub.Pinned(b.start), ub.PrescribedDisplacement(slider.middle, u=smooth)],
    ),
}
"""Scenes in which multipliers do work on prescribed motions."""


@pytest.mark.parametrize("part", DRIVEN)
def test_works_of_multipliers_are_taken_back(part):
    """The force of a constraint belongs to a stage, not to the configuration at its beginning."""
    simulation = ub.Simulation(DRIVEN[part](arm()), FOURTH, newton=TIGHT)
    simulation.step_to(0.2)
    ledger = simulation.ledger
    before = {**ledger.state, **ledger.supplied}
    simulation.attempt(0.6)
    simulation.take_back()
    after = {**ledger.state, **ledger.supplied}
    size = sum(map(abs, before.values()))
    assert before == pytest.approx(after, abs=1e-10 * size)
    simulation.close()
    adaptive = go(DRIVEN[part](arm()), dt=ub.Adaptive(1e-5, first=0.5))
    assert adaptive.energy.worst < SAME


def test_a_stage_that_fails_repeats_the_whole_step_in_halves():
    """Three iterations are too few for steps of 0.5 s, and enough for the halves."""
    scene, _ = linked()
    few = ub.Newton(max_iterations=3)
    run = go(scene, t=(0, 2.0), dt=0.5, newton=few)
    assert run.substeps > 4
    assert list(run.times) == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert run.energy.worst < SAME
    simulation = ub.Simulation(scene, FOURTH, newton=few)
    simulation.time_loop.largest_turn = 1e-3  # substeps of 12 ms turn nodes farther, later on
    with pytest.raises(ub.ConvergenceError) as error:
        simulation.step_to(50.0)
    assert 0 < error.value.solution.times[-1] == simulation.t < 1
    assert simulation.t % (50 / 4096) == pytest.approx(0, abs=1e-12)  # it is no end of a stage


@pytest.mark.parametrize("motor", [False, True])
def test_derivatives_of_stages_are_taken_back_with_a_step_that_is_divided(motor):
    def swing(EI, rate=0.5):
        section = ub.Section(EA=1e4, GA=4e3, EI=EI, rhoA=1.0, rhoI=0.01)
        beam = ub.Beam((0, 0), (2, 0), section, cells=4)
        pin, loads = ub.Revolute(ub.ground(0, 0), beam.start, multipliers=True), [ub.Gravity()]
        if not motor:
            return ub.Scene([beam], joints=[pin], loads=loads)
        drive = ub.PrescribedMotion(lambda t: rate * t**2)
        turn = ub.Turn(ub.ground(0, 0), beam.start, drive)
        return ub.Scene([beam], joints=[pin], loads=loads, connectors=[turn])

    at = {"EI": 100.0} | ({"rate": 0.5} if motor else {})
    run = {"scheme": FOURTH, "t": (0, 2.0), "dt": 0.5, "newton": ub.Newton(max_iterations=4)}
    found = ub.differentiate(swing, at, **run, progress=False)
    assert found.solution.substeps > len(found.solution)
    slopes = found.of(lambda s: s.q)
    for p, (name, value) in enumerate(at.items()):
        h = 1e-4 * value
        q = [
            ub.simulate(swing(**at | {name: value + k * h}), **run, progress=False).q
            for k in (-2, -1, 1, 2)
        ]
        expected = (q[0] - 8 * q[1] + 8 * q[2] - q[3]) / (12 * h)
        size = np.abs(expected).max(axis=0)  # of 15 motions, and of larger forces of joints
        error = np.abs(slopes[..., p] - expected).max(axis=0)
        assert np.all(error <= 1e-7 * np.maximum(size, size[:15].max()))


def test_a_run_that_ends_in_a_stage_ends_in_the_last_whole_step():
    def late(t):
        if t > 0.33:
            raise RuntimeError("no value")
        return 1.0

    beam = arm()
    scene = held(beam, loads=[ub.Gravity(amplitude=late)])
    with pytest.raises(RuntimeError, match="no value") as error:
        go(scene, dt=0.1)
    solution = error.value.solution  # the step from 0.3 s has stages that are solved
    assert solution.times[-1] == pytest.approx(0.3)
    assert solution.energy.worst < SAME


# -- a step is one step for everything outside ---------------------------------------------------


@pytest.mark.parametrize("mesh", [ub.Mesh(), ub.Mesh(degree=2)], ids=str)
def test_forces_are_means_over_the_last_stage_and_agree_with_reactions(mesh):
    """At its ends the beam bears the reaction, and the force of the load in mid-stage.

    A rotation of 0.1 rad in a stage would change the direction of a force by 1e-3.
    """
    beam = arm()
    scene = held(beam, loads=[ub.LineLoad(beam, (0.0, -3.0), amplitude=smooth)])
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


def test_recorders_and_stored_states_have_whole_steps_only():
    seen, scene = [], linked()[0]
    extremes, history = ub.Extremes(), at_step(3, lambda: seen.append(True))
    run = go(scene, dt=0.1, record=[extremes, history])
    assert (run.substeps, len(run.times), seen) == (10, 11, [True])
    first, moved = extremes.displacement(scene.beams[0]), run.displacement(scene.beams[0].end)
    assert first.high[-1] == pytest.approx(moved.max(axis=0))
    assert first.low[-1] == pytest.approx(moved.min(axis=0))
    assert set(np.unique(first.time_high)) <= set(run.times)


def test_steps_in_a_loop_and_in_one_call_are_the_same():
    scene, _ = linked()
    run, simulation = go(scene), ub.Simulation(scene, FOURTH, newton=TIGHT)
    for t in run.times[1:]:
        simulation.step_to(t)
        simulation.keep()
    np.testing.assert_array_equal(simulation.solution.q[-1], run.q[-1])
    for n in (1, 10):
        np.testing.assert_allclose(
            simulation.solution.cell_resultants(n - 1), run.cell_resultants(n), rtol=0, atol=1e-9
        )
    simulation.close()


@pytest.mark.filterwarnings("ignore:.*")
def test_the_reference_solver_agrees(as_by_reference):
    """Also the ledger closes in substeps, if iterations end early."""
    scene, _ = linked()
    run, divided = (
        go(scene, t=(0, 2.0), dt=0.5, newton=ub.Newton(rtol=1e-12, max_iterations=most))
        for most in (20, 3)
    )
    as_by_reference(run, 1e-8)
    assert divided.substeps > 4
    assert divided.energy.worst < SAME


@pytest.mark.serial
@pytest.mark.parametrize("dt", [0.05, ub.Adaptive(1e-5)], ids=str)
def test_a_resumed_run_is_the_run_to_the_last_bit(tmp_path, dt):
    def run(path, steps=10**9):
        checkpoint = ub.Checkpoint(tmp_path / path, every=3)
        return go(linked()[0], dt=dt, record=stop_after(steps), checkpoint=checkpoint)

    whole = run("whole")
    with pytest.raises(KeyboardInterrupt):
        run("part", steps=8)
    resumed = run("part")
    assert resumed.q.tobytes() == whole.q.tobytes()
    assert resumed.v.tobytes() == whole.v.tobytes()
    for n in (4, len(whole) - 1):
        np.testing.assert_allclose(resumed.cell_resultants(n), whole.cell_resultants(n), rtol=1e-12)


def test_a_run_in_two_parts_is_the_run():
    scene, _ = linked()
    whole = go(scene)
    first = go(scene, t=(0, 0.5))
    second = go(scene, t=(0.5, 1.0), start=first)
    np.testing.assert_allclose(second.q[-1], whole.q[-1], rtol=0, atol=SAME * scene.size)
    np.testing.assert_allclose(second.cell_resultants(0), first.cell_resultants(-1), rtol=1e-12)


def test_processes_that_share_a_scene_find_the_same():
    scene, _ = linked()
    alone, shared = go(scene, comm=MPI.COMM_SELF), go(scene)
    np.testing.assert_allclose(shared.q, alone.q, rtol=0, atol=SAME * scene.size)
    np.testing.assert_allclose(
        shared.cell_resultants(-1), alone.cell_resultants(-1),
        rtol=0, atol=1e-8 * np.abs(alone.cell_resultants(-1)).max(),
    )  # fmt: skip


# -- adaptive steps ------------------------------------------------------------------------------


@pytest.mark.parametrize("part", ["point load", "springs", "rotating frame", "imposed strain"])
def test_adaptive_steps_meet_the_tolerance_with_steps_by_its_fifth_root(part):
    """The sum of the estimates bounds the error, and has its size; a step errs by dt^5."""
    beam = arm()
    scene = PARTS[part](beam)
    fine = {"dt": 1.6 / 2000, "every": 2000, "newton": ub.Newton(rtol=1e-12)}
    exact = go(scene, t=(0, 1.6), **fine).displacement(beam.end)[-1]
    steps, errors = [], []
    for tolerance in (1e-6, 1e-8):
        run = go(scene, t=(0, 1.6), dt=ub.Adaptive(tolerance), newton=ub.Newton())
        error = np.abs(run.displacement(beam.end)[-1] - exact) / [scene.size, scene.size, 1]
        assert 0.005 * run.time_error < error.max() < 2 * run.time_error
        steps.append(len(run) - 1), errors.append(run.time_error)
    assert steps[1] / steps[0] == pytest.approx(100 ** (1 / 5), rel=0.25)


def test_adaptive_steps_end_at_kinks_and_resolve_loads():
    """A load that is too short for the midpoint rule of stages shortens the steps."""
    beam = arm()
    table = ub.Table([0, 0.3, 0.6, 2.0], [0, 1, 0, 0])
    scene = held(beam, loads=[ub.PointLoad(beam.end, force=(0, 5), amplitude=table)])
    run = go(scene, dt=ub.Adaptive(1e-5))
    assert {0.3, 0.6} <= set(run.times)


def test_an_adaptive_run_that_ends_between_solving_and_accepting_ends_in_the_last_whole_step():
    """The estimate of errors asks for loads at other times than the stages."""
    begun = []

    def late(t):
        if begun and t > begun[0]:
            raise RuntimeError("no value")
        return 1.0

    beam = arm()
    scene = held(beam, loads=[ub.Gravity(amplitude=late)])
    steps = ub.Adaptive(1e-4, first=0.1, longest=0.1)
    whole = go(scene, t=(0, 0.4), dt=steps)
    begun.append(0.385)  # the last sample of Gauss's rule in the step from 0.3 s is at 0.3887 s
    with pytest.raises(RuntimeError, match="no value") as error:
        go(scene, t=(0, 0.4), dt=steps)
    solution = error.value.solution
    assert solution.times[-1] in whole.times
    assert solution.energy.worst < SAME
    n = len(solution) - 1
    np.testing.assert_allclose(solution.q[-1], whole.q[n], rtol=0, atol=SAME)


# -- speed and accuracy --------------------------------------------------------------------------


@pytest.mark.serial
@pytest.mark.parametrize(("dt", "least"), [(0.2, 3.5), (ub.Adaptive(1e-4), 3.0)], ids=str)
def test_a_trade_off_extrapolates_with_the_order_of_the_scheme(dt, least):
    """A level halves steps; errors of adaptive runs vary with the steps that are chosen."""
    beam = arm()
    found = ub.tradeoff(
        held(beam), {"tip": lambda run: run.displacement(beam.end)[-1, :2]}, scheme=FOURTH,
        t=(0, 1.6), dt=dt, tolerance={"tip": 3e-6}, mesh=ub.Mesh(degree=3),
        newton=ub.Newton(rtol=1e-12), progress=False,
    )  # fmt: skip
    steps = found.convergence["tip"].steps
    assert steps.method == 4
    assert least < steps.order < 5
    assert found.ratio(found.best) <= 1
    run = ub.simulate(held(beam), **found.recommended)
    assert run.substeps == len(run) - 1
