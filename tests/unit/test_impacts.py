# SPDX-License-Identifier: MIT
"""Velocities that contradict a constraint change by a plastic impact, in every scheme."""

from dataclasses import dataclass

import numpy as np
import pytest
from helpers import assert_balanced, in_turn, raises

import ufl_beam as ub
import ufl_beam.structures as st

EXACT = 1e-9
"""Relative to the velocities: tolerances of Newton's method, and differences for rates."""


@dataclass(frozen=True)
class Own(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics):
    """A scheme of a user: the midpoint rule."""

    alpha = 0.0

    def coefficients(self, dt, last_dt, known):
        return ub.extend.Coefficients(
            inertia=(2 / dt**2, -2 / dt, 0.0), velocity=(1 / dt, 0.0, 0.0),
            rates=((2 / dt, -1.0, 0.0),),
        )  # fmt: skip

    def error_weights(self):
        return 0.0, 1 / 12


DAMPED = ub.GeneralizedAlpha(0.8), ub.Newmark(0.6, 0.31)
"""Schemes with forces at the end of the step that motors and multipliers allow."""

EXACT_LEDGER = (
    ub.EnergyMomentum(), ub.EnergyMomentum(order=4), ub.EnergyMomentum(0.05, 0.05),
    ub.EnergyMomentumDecaying(), Own(),
)  # fmt: skip

SCHEMES = *EXACT_LEDGER, *DAMPED


def simulate(scene, scheme, t, dt=0.01, **options):
    return ub.simulate(scene, scheme, t=t, dt=dt, progress=False, **options)


def rotors():
    first = ub.Body((0, 0), mass=1.0, inertia=2.0, name="first")
    second = ub.Body((0, 0), mass=1.0, inertia=3.0, name="second")
    ground = ub.ground(0, 0)
    axles = [ub.Revolute(ground, first.middle), ub.Revolute(ground, second.middle)]
    return first, second, axles, ub.Velocity((first,), angular=10.0, about=(0, 0))


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_a_clutch_that_closes_loses_the_energy_of_the_relative_speed(scheme):
    """Angular momentum 20 kg m²/s: both turn with 20/5 = 4 rad/s; 40 of 100 J remain."""
    first, second, axles, spin = rotors()
    free = ub.Scene([], bodies=[first, second], joints=axles, initial=[spin])
    before = simulate(free, scheme, (0, 1), 0.02)
    apart = float(before.q[-1] @ np.eye(len(before.q[0]))[before.numbering.node(second.middle)[2]])
    apart -= float(before.displacement(first.middle)[-1, 2])
    clutch = ub.Turn(first.middle, second.middle, ub.PrescribedMotion(lambda t: apart))
    locked = ub.Scene([], bodies=[first, second], joints=axles, connectors=[clutch])
    run = simulate(locked, scheme, (1, 2), 0.02, start=before)
    for body in (first, second):
        np.testing.assert_allclose(run.velocity(body.middle)[:, 2], 4.0, rtol=1e-6)
    np.testing.assert_allclose(run.energy["kinetic"], 40.0, rtol=1e-6)
    np.testing.assert_allclose(run.energy.lost["impacts"], 60.0, rtol=1e-6)
    np.testing.assert_allclose(run.energy.supplied["motors"], 0.0, atol=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
@pytest.mark.parametrize("n", [50, 51])
def test_a_mass_that_is_moved_and_then_held_is_at_rest(scheme, n):
    """With any number of steps to the end of the ramp.  Released, it swings by u = 0.1 m."""
    mass = ub.Body((0, 0), mass=2.0, inertia=1.0)
    spring = ub.Slide(ub.ground(0, 0), mass.middle, ub.Spring(50.0), axis=(1, 0))
    ramp = ub.Table([0, 1], [0, 0.1])
    move = ub.PrescribedDisplacement(mass.middle, u=ramp, v=0.0, psi=0.0)
    guide = ub.PrescribedDisplacement(mass.middle, v=0.0, psi=0.0)
    held = ub.Scene([], bodies=[mass], supports=[move], connectors=[spring])
    hold = simulate(held, scheme, (0, 2), 1 / n)
    v = hold.velocity(mass.middle)[:, 0]
    moving = hold.times < 0.95
    np.testing.assert_allclose(v[moving], 0.1, rtol=1e-6)
    np.testing.assert_allclose(v[hold.times > 1.05], 0.0, atol=1e-7)
    # The support does the work 2 kg (0.1 m/s)² in the impact at the start, of which half is lost.
    lost = hold.energy.lost["impacts"]
    np.testing.assert_allclose(lost[moving], 0.01, rtol=1e-6)
    assert hold.energy["kinetic"][-1] <= 1e-12
    if scheme in EXACT_LEDGER:
        assert_balanced(hold.energy)
    free = ub.Scene([], bodies=[mass], supports=[guide], connectors=[spring])
    if scheme == ub.EnergyMomentum():
        run = simulate(free, scheme, (2, 5), 1e-3, start=hold)
        np.testing.assert_allclose(np.abs(run.q[:, 0]).max(), 0.1, rtol=1e-6)


@pytest.mark.parametrize("scheme", EXACT_LEDGER, ids=repr)
def test_a_kink_inside_of_a_step(scheme):
    """At 1 s, in steps that end at 0.98 and 1.05 s, as a function and as a table."""
    for f in (lambda t: 0.1 * min(t, 1.0), ub.Table([0, 1], [0, 0.1])):
        mass = ub.Body((0, 0), mass=2.0, inertia=1.0)
        move = ub.PrescribedDisplacement(mass.middle, u=f, v=0.0, psi=0.0)
        held = ub.Scene([], bodies=[mass], supports=[move])
        run = simulate(held, scheme, (0, 2.1), 0.07)
        np.testing.assert_allclose(run.velocity(mass.middle)[-3:, 0], 0.0, atol=1e-9)
        assert_balanced(run.energy)


def flying_beam(cells=4):
    """A beam with a body at its end, joined away from the centre of the body, and another body."""
    section = ub.Section(EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02)
    beam = ub.Beam((0, 0), (2, 0), section, cells=cells, name="beam")
    body = ub.Body((2.3, 0.2), mass=1.5, inertia=0.4, name="body")
    other = ub.Body((0, 1.0), mass=2.0, inertia=0.3, name="other")
    return beam, body, other, ub.Rigid(beam.end, body.at(2, 0))


def in_flight(parts, scheme, **velocity):
    """The end of a flight that is so short that all positions are as at its beginning."""
    beam, body, other, joint = parts
    fly = ub.Velocity((beam, body), **velocity)
    scene = ub.Scene([beam], bodies=[body, other], joints=[joint], initial=[fly])
    return simulate(scene, scheme, (0, 1e-15), 1e-15)


NEW = {
    "link": lambda at, other: {"joints": [ub.Link(at, other.middle)]},
    "slot": lambda at, other: {"joints": [ub.Prismatic(other.middle, at, axis=(1, 0.4))]},
    "pin": lambda at, other: {"joints": [ub.Revolute(at, other.at(0, 0))]},
    "joint": lambda at, other: {"joints": [ub.Rigid(at, other.at(0, 0), multipliers=True)]},
    "motor": lambda at, other: {
        "connectors": [ub.Turn(at, other.middle, ub.PrescribedMotion(lambda t: 3.0 * t))]
    },
    "guide": lambda at, other: {"joints": [ub.Guided(at, lambda s: (0.3 * s, s))]},
    "support": lambda at, other: {"supports": [ub.Pinned(at)]},
    "inclined": lambda at, other: {"supports": [ub.Roller(at, along=(1.0, 0.7))]},
    "moving": lambda at, other: {
        "supports": [ub.PrescribedDisplacement(at, v=ub.Table([0, 1], [0, 2.0]))]
    },
}


@pytest.mark.parametrize(("name", "scheme"), in_turn(NEW, SCHEMES, 3), ids=str)
def test_a_new_constraint_changes_the_momentum_by_its_impulse_only(name, scheme):
    """Carnot: the lost energy is the kinetic energy of the change of the velocities."""
    beam, body, other, joint = parts = flying_beam()
    before = in_flight(parts, scheme, linear=(1.0, 0.5), angular=0.3, about=(0.4, 1.0))
    new = NEW[name](beam.start, other)
    scene = ub.Scene(
        [beam], bodies=[body, other], **{**new, "joints": [joint, *new.get("joints", [])]}
    )
    run = simulate(scene, scheme, (0, 1e-3), 1e-5, start=before)
    energy = run.energy
    lost, supplied = energy.lost["impacts"], sum(energy.supplied[k][0] for k in energy.supplied)
    assert lost[0] > 1e-3
    np.testing.assert_array_equal(lost, lost[0])
    kinetic = before.energy["kinetic"][-1]
    np.testing.assert_allclose(energy["kinetic"][0] + lost[0] - supplied, kinetic, rtol=EXACT)
    if name in ("link", "slot", "pin", "joint", "motor"):  # inner constraints
        np.testing.assert_allclose(run.momentum()[0], before.momentum()[-1], atol=1e-9)
    # The constraint remains satisfied, so that nothing jumps in the first steps.
    change = np.abs(
        np.diff(run.v[:, : run.numbering.multipliers.min(initial=run.numbering.size)], axis=0)
    )
    assert change[0].max() <= 2 * change[:20].max() <= 2.0
    if scheme in EXACT_LEDGER:
        assert_balanced(energy)


@pytest.mark.parametrize("scheme", SCHEMES[:5], ids=repr)
def test_places_that_begin_to_share_unknowns_meet(scheme):
    """Two bodies, 2 and 3 kg, with 10 m/s and 0: 4 m/s; rotations stay in a pin."""
    a = ub.Body((0, 0), mass=2.0, inertia=1.0, name="a")
    b = ub.Body((0, 0), mass=3.0, inertia=1.0, name="b")
    push = ub.Velocity((a,), linear=(10.0, 0.0), angular=1.0)
    before = simulate(ub.Scene([], bodies=[a, b], initial=[push]), scheme, (0, 1e-15), 1e-15)
    for joint, spin in (
        (ub.Revolute(a.middle, b.middle), (1.0, 0.0)),
        (ub.Rigid(a.middle, b.middle), (0.5, 0.5)),
    ):
        run = simulate(
            ub.Scene([], bodies=[a, b], joints=[joint]), scheme, (0, 1), 0.1, start=before
        )
        for body, rate in zip((a, b), spin, strict=True):
            wanted = np.broadcast_to([4.0, 0.0, rate], (11, 3))
            np.testing.assert_allclose(run.velocity(body.middle), wanted, atol=1e-9)
        lost = 100.0 + 0.5 - 40.0 - sum(rate**2 / 2 for rate in spin)
        np.testing.assert_allclose(run.energy.lost["impacts"], lost, rtol=EXACT)


def test_a_joint_that_moves_to_another_place_conserves_the_momentum():
    """Shared unknowns are separated and joined at the same time."""
    section = ub.Section(EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02)
    a, b, c = (ub.Beam((0, 0), (x, y), section, cells=2) for x, y in ((1, 0), (0, 1), (-1, 0)))
    move = [
        ub.Velocity((a, b), linear=(1, 0), angular=1.0, about=(0, 0)),
        ub.Velocity((c,), linear=(-1, 0.5)),
    ]
    to_b, to_c = ([ub.Turn(a.start, x.start, ub.Spring(1e-3))] for x in (b, c))
    joint = ub.Rigid(a.start, b.start)
    scene = ub.Scene([a, b, c], joints=[joint], connectors=to_c, initial=move)
    before = simulate(scene, ub.EnergyMomentum(), (0, 1e-15), 1e-15)
    after = ub.Scene([a, b, c], joints=[ub.Rigid(a.start, c.start)], connectors=to_b)
    run = simulate(after, ub.EnergyMomentum(), (0, 1e-3), 1e-5, start=before)
    np.testing.assert_allclose(
        run.momentum(), np.broadcast_to(before.momentum()[-1], (101, 3)), atol=1e-9
    )
    energy = run.energy["kinetic"][0] + run.energy.lost["impacts"][0]
    np.testing.assert_allclose(energy, before.energy["kinetic"][-1], rtol=EXACT)
    assert_balanced(run.energy)


def machine():
    """A crank with a motor, a rod with a plastic hinge, a slider with friction, a moved foot."""
    section = ub.Section(EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02)
    crank = ub.Body((0, 0), mass=2.0, inertia=0.5, name="crank")
    rod = ub.Beam((0.5, 0), (2, 0), section, cells=4, hinges={0.5: ub.ElastoPlastic(40.0, 20.0)})
    slider = ub.Body((2, 0), mass=1.0, inertia=0.1, name="slider")
    foot = ub.Body((0, -1), mass=1.0, inertia=0.1, name="foot")
    motor = ub.Turn(
        ub.ground(0, 0),
        crank.middle,
        ub.PrescribedMotion(ub.Table([0, 0.1, 0.2, 0.3], [0, 0.2, 0.2, 0.5])),
    )
    return ub.Scene(
        [rod], bodies=[crank, slider, foot],
        joints=[
            ub.Revolute(ub.ground(0, 0), crank.middle), ub.Rigid(rod.end, slider.middle),
            ub.Revolute(crank.at(0.5, 0), rod.start),
        ],
        supports=[
            ub.PrescribedDisplacement(
                foot.middle, u=ub.Table([0.1, 0.2], [0, 0.1]), v=0.0, psi=0.0
            )
        ],
        connectors=[
            motor, ub.Slide(ub.ground(2, 0), slider.middle, ub.Coulomb(3.0), axis=(0, 1)),
            ub.Stretch(foot.middle, slider.middle, ub.Spring(200.0)),
        ],
    )  # fmt: skip


def test_several_rates_that_jump_at_once_in_a_machine(shared_path):
    """With friction, a hinge and offset joints; ledger and restart."""
    scene, scheme = machine(), ub.EnergyMomentum(0.05)
    span = {"t": (0, 0.4), "dt": 0.01}
    run = simulate(scene, scheme, **span)
    lost = run.energy.lost["impacts"]
    assert lost[0] > 1e-6
    assert np.flatnonzero(np.diff(lost) > 1e-6).tolist() == [10, 20, 30]
    assert_balanced(run.energy)
    file = ub.Checkpoint(shared_path / "run.checkpoint", every=5)
    half = simulate(scene, scheme, (0, 0.2), 0.01, checkpoint=file)
    resumed = simulate(scene, scheme, **span, checkpoint=file)
    np.testing.assert_array_equal(resumed.q, run.q)
    np.testing.assert_array_equal(resumed.v, run.v)
    parts = simulate(scene, scheme, (0.2, 0.4), 0.01, start=half)
    np.testing.assert_allclose(parts.v[1:], run.v[21:], atol=1e-6)


def test_the_reference_solver_has_the_same_impacts(as_by_reference):
    as_by_reference(simulate(machine(), ub.EnergyMomentum(0.05), t=(0, 0.4), dt=0.01), 1e-8)


@pytest.mark.parametrize("scheme", EXACT_LEDGER, ids=repr)
def test_smooth_motions_have_no_impacts(scheme):
    """A motor that turns far and fast, after a smooth start."""
    wheel = ub.Body((0, 0), mass=2.0, inertia=0.5)
    motor = ub.Turn(ub.ground(0, 0), wheel.middle, ub.PrescribedMotion(lambda t: 20 * t**2))
    scene = ub.Scene(
        [], bodies=[wheel], joints=[ub.Revolute(ub.ground(0, 0), wheel.middle)], connectors=[motor]
    )
    run = simulate(scene, scheme, (0, 1), 0.01)
    assert not run.energy.lost["impacts"].any()


@pytest.mark.parametrize("motion", [
    lambda t: 0.5 * min(t, 0.5) ** 2 + 0.5 * max(t - 0.5, 0.0),  # acceleration ends
    lambda t: 0.5 * max(t - 0.5, 0.0) ** 2,  # and begins
    st.GroundMotion(0.1, [0.0, 3.0, 2.0, -4.0, 6.0, 0.0]).displacement,
], ids=["ends", "begins", "record"])  # fmt: skip
@pytest.mark.parametrize("steps", [7, 19, 23, 50])
def test_accelerations_that_jump_are_no_impacts(motion, steps):
    """The change of the momentum is the impulse of the support; the velocities have no jump."""
    block = ub.Body((0, 0), mass=2.0, inertia=1.0)
    held = ub.PrescribedDisplacement(block.middle, u=motion, v=0.0, psi=0.0)
    run = simulate(
        ub.Scene([], bodies=[block], supports=[held]), EXACT_LEDGER[0], (0, 1), 1 / steps
    )
    impulses = np.diff(run.times) * run.reaction(held)[1:, 0]
    sizes = np.abs(run.reaction(held)[1:, 0]).max() / steps
    assert np.diff(run.momentum()[:, 0]) == pytest.approx(impulses, rel=0, abs=EXACT * sizes)


def test_a_run_in_parts_does_not_lose_energy():
    """Joints that both scenes have keep the errors of the steps."""
    bob = ub.Body((1, 0), mass=1.0, inertia=0.1)
    rod = ub.Link(ub.ground(0, 0), bob.middle)
    gravity, wind = ub.Gravity(), ub.PointLoad(bob.middle, force=(0.5, 0.0))
    first = ub.Scene([], bodies=[bob], joints=[rod], loads=[gravity])
    second = ub.Scene([], bodies=[bob], joints=[rod], loads=[gravity, wind])
    before = simulate(first, ub.EnergyMomentum(), (0, 0.5), 0.01)
    for scene in (first, second):
        run = simulate(scene, ub.EnergyMomentum(), (0.5, 1), 0.01, start=before)
        assert "impacts" not in run.energy
        np.testing.assert_array_equal(run.v[0], before.v[-1])


def test_a_run_in_parts_goes_on_with_the_guess():
    """So that it needs the same iterations and finds the same motion, bit for bit."""
    section = ub.Section(EA=1e6, GA=4e5, EI=20.0, rhoA=3.0, rhoI=0.02)
    beam = ub.Beam((0, 0), (2, 0), section, cells=6)
    load = ub.PointLoad(beam.end, force=(0.0, -30.0), amplitude=ub.Table([0, 1], [0, 1]))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    for scheme in (ub.EnergyMomentum(), ub.EnergyMomentum(order=4)):
        whole = simulate(scene, scheme, (0, 1), 0.05)
        part = simulate(scene, scheme, (0, 0.5), 0.05)
        rest = simulate(scene, scheme, (0.5, 1), 0.05, start=part)
        assert part.iterations + rest.iterations == whole.iterations
        np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=1e-12)


def test_velocities_that_contradict_shared_unknowns_are_refused():
    """As with constraint forces: a part with mass has no velocity, but its neighbour moves it."""
    section = ub.Section(EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02)
    a, b = (
        ub.Beam((0, 0), (0, 3), section, name="bar"),
        ub.Beam((0, 3), (4, 3), section, name="other"),
    )
    turn = ub.Velocity((a,), angular=1.0, about=(0, 0))
    for kind in (ub.Rigid, ub.Revolute):
        for multipliers in (False, True):
            joint = kind(a.end, b.start, multipliers=multipliers)
            scene = ub.Scene([a, b], joints=[joint], supports=[ub.Pinned(a.start)], initial=[turn])
            with raises("Velocity: ", "at 3 m/s", "give all joined parts velocities that agree"):
                simulate(scene, ub.EnergyMomentum(), (0, 0.1))
    turns = ub.Velocity((a, b), angular=1.0, about=(0, 0))
    scene = ub.Scene([a, b], joints=[joint], supports=[ub.Pinned(a.start)], initial=[turns])
    assert len(simulate(scene, ub.EnergyMomentum(), (0, 0.02)).times) == 3


def test_the_derivative_of_a_run_with_a_jump_within_is_refused():
    def model(rate):
        wheel = ub.Body((0, 0), mass=2.0, inertia=0.5)
        law = ub.PrescribedMotion(ub.Table([0, 0.5, 1], [0, rate, rate]))
        motor = ub.Turn(ub.ground(0, 0), wheel.middle, law)
        return ub.Scene(
            [],
            bodies=[wheel],
            joints=[ub.Revolute(ub.ground(0, 0), wheel.middle)],
            connectors=[motor],
        )

    with raises("no derivative: at t = 0.5 s the rate of a prescribed motion jumps"):
        ub.differentiate(model, {"rate": 2.0}, ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    found = ub.differentiate(model, {"rate": 2.0}, ub.EnergyMomentum(), t=(0, 0.4), dt=0.01)
    # d(I w²/2)/d rate with w = rate/0.5; w alternates by w (w dt)²/6 with w dt = 0.04
    change = found.of(lambda run: run.energy["kinetic"])
    np.testing.assert_allclose(change[:, 0], 0.5 * (2.0 / 0.5) / 0.5, rtol=2e-3)
