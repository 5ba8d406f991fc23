# SPDX-License-Identifier: MIT
"""Analyses about any stored state of a solution, (solution, n), and runs that a condition ends."""

from functools import partial

import numpy as np
import pytest
from helpers import raises, stop_after
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

SLENDER = ub.Section(EA=1e5, GA=1e5, EI=3.0, rhoA=0.1, rhoI=1e-5)
BEAM = ub.Beam((0, 0), (2, 0), SLENDER, cells=4, name="arm")
PUSH = ub.PointLoad(BEAM.end, force=(-0.1, 1.0), amplitude=lambda t: t)
SCENE = clamped(BEAM, loads=[PUSH], masses=[ub.PointMass(BEAM.end, 0.1)])


def static(end, **options):
    return ub.simulate(SCENE, ub.Static(), t=(0, end), dt=0.25, **options)


@pytest.fixture(scope="module")
def whole():
    """A static run with the loads at 0, 1/4, 1/2, 3/4 and 1."""
    return static(1.0)


def test_analyses_about_a_stored_state_are_those_about_the_end_of_a_shorter_run(whole):
    """To round-off: both have the same steps."""
    part = static(0.5)
    for call in (
        lambda at: ub.modes(SCENE, 3, at=at).frequencies,
        lambda at: ub.linearize(
            SCENE, inputs=[PUSH], outputs=[("displacement", BEAM.end, "v")], at=at
        ).frequency_response(1.0),
        lambda at: ub.follow(SCENE, ub.LoadControl(0.1), steps=2, start=at).q,
        lambda at: ub.simulate(SCENE, ub.EnergyMomentum(), t=(0.5, 0.6), dt=0.05, start=at).q,
        lambda at: ub.simulate(SCENE, ub.Newmark(), t=(0.5, 0.6), dt=0.05, start=at).q,
    ):
        np.testing.assert_allclose(call((whole, 2)), call(part), rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(call((whole, -1)), call(whole))


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum(), ub.EnergyMomentumStatic()])
def test_a_run_from_a_stored_state_repeats_the_rest_of_the_run(scheme):
    """Motions, reactions and section forces, to the tolerance of Newton's method."""
    run = ub.simulate(SCENE, scheme, t=(0, 1), dt=0.05)
    rest = ub.simulate(SCENE, scheme, t=(run.times[8], 1), dt=0.05, start=(run, 8))
    assert rest.times == pytest.approx(run.times[8:])
    size = np.abs(run.q).max()
    np.testing.assert_allclose(rest.q, run.q[8:], rtol=0, atol=1e-9 * size)
    for of in (
        lambda s: s.reaction(SCENE.supports[0])[1:],
        lambda s: s.section_forces_at(BEAM.at(0.4)),
    ):
        mine, other = of(rest), of(run)[-len(of(rest)) :]
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-7 * np.abs(other).max())


def test_buckling_about_a_stored_state():
    """A column under a quarter, half, three quarters of a load below its critical load."""
    push = ub.PointLoad(BEAM.end, force=(-1.0, 0.0), amplitude=lambda t: t)  # of 1.85 N
    column = clamped(BEAM, loads=[push])
    runs = [ub.simulate(column, ub.Static(), t=(0, t), dt=0.25) for t in (1.0, 0.5)]
    states = (runs[0], 2), runs[1]
    one, other = (ub.buckling(column, 1, at=at, t=2.0).factors for at in states)
    np.testing.assert_allclose(one, other, rtol=1e-9)


YIELDS = ub.Section(EA=1e5, GA=1e5, EI=3.0, rhoA=1.0, bending=ub.ElastoPlastic(1.0))


@pytest.mark.parametrize(
    ("section", "law", "named"),
    [
        (YIELDS, None, "arm"),
        (SLENDER, ub.Spring(1e3, law=ub.ElastoPlastic(1.0)), "Turn(ground"),
        (SLENDER, ub.Coulomb(1.0), "Turn(ground"),
        (SLENDER, st.AxialBendingHinge(1e9, 1.0, 1e5, 1e5, 1e3), "Bushing(ground"),
        (SLENDER, ub.ForceLaw(lambda e, de, state: (e, [e]), state=[0.0]), "Turn(ground"),
    ],
)
def test_states_without_their_internal_variables_are_refused(section, law, named):
    """The last state is known, any other one is not."""
    beam = ub.Beam((0, 0), (2, 0), section, cells=2, name="arm")
    kind = ub.Bushing if isinstance(law, ub.extend.ConnectorLaw) else ub.Turn
    more = [] if law is None else [kind(ub.ground(2, 0), beam.end, law)]
    scene = clamped(beam, connectors=more)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=0.1)
    with raises("start", named, "has internal variables", "end a run at t = 0.1 s", "snapshot()"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0.1, 0.2), dt=0.1, start=(run, 1))
    ub.simulate(scene, ub.EnergyMomentum(), t=(0.2, 0.3), dt=0.1, start=(run, 2))
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    simulation.step_to(0.1)
    simulation.keep()
    with raises("start", named, "has internal variables", "end of a run", "end()"):
        ub.Simulation(scene, ub.EnergyMomentum(), start=simulation.solution)
    simulation.end()
    ub.Simulation(scene, ub.EnergyMomentum(), start=simulation.solution)


def test_wrong_states(whole):
    with raises("modes: at", "is not a Solution"):
        ub.modes(SCENE, 1, at=(1, 2))
    with raises("modes: at: n of (solution, n)", "is not a"):
        ub.modes(SCENE, 1, at=(whole, 0.5))
    with raises("n = 5", "give -5 to 4"):
        static(2.0, start=(whole, 5))


# -- conditions that end a run -----------------------------------------------------------------

SWINGS = clamped(BEAM, loads=[ub.Gravity()])


def low(now):
    """The tip is 50 mm below its place, which it reaches in about 0.1 s."""
    return now.position(BEAM.end)[1] < -0.05


@pytest.mark.parametrize("dt", [0.01, ub.Adaptive(1e-4)], ids=["equal", "adaptive"])
def test_a_run_ends_after_the_first_step_that_satisfies_a_condition(dt):
    run = ub.simulate(SWINGS, ub.EnergyMomentum(), t=(0, 1), dt=dt, until=low)
    heights = run.position(BEAM.end)[:, 1]
    assert heights[-1] < -0.05 <= heights[-2]
    assert run.times[-1] < 1.0
    more = ub.simulate(SWINGS, ub.EnergyMomentum(), t=(run.times[-1], 1), dt=dt, start=run)
    assert more.times[-1] == 1.0


def test_conditions_with_few_stored_states():
    """The last state is stored, whatever the others are."""
    run = ub.simulate(SWINGS, ub.EnergyMomentum(), t=(0, 1), dt=0.01, until=low)
    few = ub.simulate(SWINGS, ub.EnergyMomentum(), t=(0, 1), dt=0.01, until=low, every=50)
    np.testing.assert_array_equal(few.q, run.q[[0, -1]])


def test_conditions_may_use_recorders_and_survive_a_restart(tmp_path):
    """A resumed run ends where the whole one does, also when it is run once more."""
    swing = partial(ub.simulate, SWINGS, ub.EnergyMomentum(), t=(0, 1), dt=0.01, until=low)
    run, file = swing(), ub.Checkpoint(tmp_path / "run.checkpoint", every=1)
    assert len(run) > 4
    with pytest.raises(KeyboardInterrupt):
        swing(checkpoint=file, record=stop_after(2))
    for _ in range(2):
        again = swing(checkpoint=file, record=stop_after(1000))
        np.testing.assert_array_equal(again.q, run.q)
    touched = ub.Events()
    stop = ub.Slide(ub.ground(2, 0), BEAM.end, ub.Stop(1e4, low=-0.05), axis=(0, 1))
    caught = ub.simulate(
        clamped(BEAM, loads=[ub.Gravity()], connectors=[stop]), ub.EnergyMomentum(), t=(0, 1),
        dt=0.01, record=touched, until=lambda now: len(touched.found) > 0,
    )  # fmt: skip
    assert caught.times[-1] == touched.found[0].time < 1.0


def test_a_condition_returns_true_or_false():
    for wrong in (None, np.zeros(3) < 1):
        with raises("until returned", "True or False"):
            static(1.0, until=lambda now, wrong=wrong: wrong)
    with raises("simulate: until = 3 must be a function"):
        static(1.0, until=3)


def test_a_simulation_without_stored_states_says_how_to_store_them():
    """In each use of its solution; it has states after keep()."""
    simulation = ub.Simulation(SWINGS, ub.EnergyMomentum())
    for _ in range(3):
        simulation.step_to(simulation.t + 0.01)
    empty, words = simulation.solution, ("no state is stored", "keep()", "snapshot()")
    assert all(word in str(empty) and word in repr(empty) for word in words)
    for use in (
        lambda: empty.displacement(BEAM.end), lambda: empty.position(BEAM.end), lambda: empty.q,
        lambda: empty.energy, lambda: empty.section_forces(BEAM), lambda: empty.shape(BEAM),
        lambda: ub.simulate(SWINGS, ub.Static(), t=(0, 1), dt=1.0, start=empty),
        lambda: ub.modes(SWINGS, 1, at=empty), lambda: ub.plot(empty),
        lambda: ub.modes(SWINGS, 1, at=(empty, 0)),
    ):  # fmt: skip
        with raises(*words):
            use()
    simulation.keep()
    assert empty.times == pytest.approx([0.03], rel=1e-15)
    position = np.add(BEAM.end.point, simulation.displacement(BEAM.end)[:2])
    assert simulation.position(BEAM.end) == pytest.approx(position, rel=1e-15)
    now = simulation.snapshot()
    simulation.close()
    assert np.array_equal(now.q, empty.q)
    rest = ub.simulate(SWINGS, ub.EnergyMomentum(), t=(0.03, 0.05), dt=0.01, start=now)
    assert rest.times[-1] == 0.05
