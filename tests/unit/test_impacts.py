# SPDX-License-Identifier: MIT
"""Velocities that contradict a constraint change by a plastic impact, in every scheme."""

import numpy as np
import pytest
from helpers import assert_balanced, in_turn, raises
from user_classes import Weighted

import ufl_beam as ub
import ufl_beam.structures as st

EXACT = 1e-9
"""Relative to the velocities: tolerances of Newton's method, and differences for rates."""


EXACT_LEDGER = (
    ub.EnergyMomentum(), ub.EnergyMomentum(order=4), ub.EnergyMomentum(0.05, 0.05),
    ub.EnergyMomentumDecaying(), Weighted(0.5),
)  # fmt: skip

SCHEMES = *EXACT_LEDGER, ub.GeneralizedAlpha(0.8), ub.Newmark(0.6, 0.31)
"""With forces at the end of the step those that motors and multipliers allow."""

SECTION = ub.Section(EA=1e6, GA=4e5, EI=2e3, rhoA=3.0, rhoI=0.02)
MASS = ub.Body((0, 0), mass=2.0, inertia=1.0)


def simulate(scene, scheme=EXACT_LEDGER[0], t=(0, 1), dt=0.01, **options):
    return ub.simulate(scene, scheme, t=t, dt=dt, **options)


def led(u, *connectors):
    """The mass, led along x by a function of time, or free along x without one."""
    motion = {} if u is None else {"u": u}
    support = ub.PrescribedDisplacement(MASS.middle, v=0.0, psi=0.0, **motion)
    return ub.Scene(bodies=[MASS], supports=[support], connectors=connectors)


# -- prescribed motions ----------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_a_clutch_that_closes_loses_the_energy_of_the_relative_speed(scheme):
    """Angular momentum 20 kg m²/s: both turn with 20/5 = 4 rad/s; 40 of 100 J remain."""
    bodies = first, second = [ub.Body((0, 0), mass=1.0, inertia=x) for x in (2.0, 3.0)]
    axles = [ub.Revolute(ub.ground(0, 0), body.middle) for body in bodies]
    spin = ub.Velocity((first,), angular=10.0, about=(0, 0))
    free = ub.Scene(bodies=bodies, joints=axles, initial=[spin])
    before = simulate(free, scheme, dt=0.02)
    turned = [float(before.displacement(body.middle)[-1, 2]) for body in bodies]
    closed = ub.PrescribedMotion(lambda t: turned[1] - turned[0])
    clutch = ub.Turn(first.middle, second.middle, closed)
    locked = ub.Scene(bodies=bodies, joints=axles, connectors=[clutch])
    run = simulate(locked, scheme, (1, 2), 0.02, start=before)
    for body in bodies:
        np.testing.assert_allclose(run.velocity(body.middle)[:, 2], 4.0, rtol=1e-6)
    np.testing.assert_allclose(run.energy["kinetic"], 40.0, rtol=1e-6)
    np.testing.assert_allclose(run.energy.lost["impacts"], 60.0, rtol=1e-6)
    np.testing.assert_allclose(run.energy.supplied["motors"], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("scheme", "n"), [(one, 50 + k % 2) for k, one in enumerate(SCHEMES)], ids=str
)
def test_a_mass_that_is_moved_and_then_held_is_at_rest(scheme, n):
    """With any number of steps to the end of the ramp.  Released, it swings by u = 0.1 m."""
    spring = ub.Slide(ub.ground(0, 0), MASS.middle, ub.Spring(50.0), axis=(1, 0))
    hold = simulate(led(ub.Table([0, 1], [0, 0.1]), spring), scheme, (0, 2), 1 / n)
    v, moving = hold.velocity(MASS.middle)[:, 0], hold.times < 0.95
    np.testing.assert_allclose(v[moving], 0.1, rtol=1e-6)
    np.testing.assert_allclose(v[hold.times > 1.05], 0.0, atol=1e-7)
    # The support does the work 2 kg (0.1 m/s)² in the impact at the start, of which half is lost.
    np.testing.assert_allclose(hold.energy.lost["impacts"][moving], 0.01, rtol=1e-6)
    assert hold.energy["kinetic"][-1] <= 1e-12
    if scheme in EXACT_LEDGER:
        assert_balanced(hold.energy)
    if scheme == ub.EnergyMomentum():
        run = simulate(led(None, spring), scheme, (2, 5), 1e-3, start=hold)
        np.testing.assert_allclose(np.abs(run.q[:, 0]).max(), 0.1, rtol=1e-6)


@pytest.mark.parametrize("scheme", EXACT_LEDGER[:2], ids=repr)
@pytest.mark.parametrize("f", [lambda t: 0.1 * min(t, 1.0), ub.Table([0, 1], [0, 0.1])])
def test_a_kink_inside_of_a_step(scheme, f):
    """At 1 s, in steps that end at 0.98 and 1.05 s."""
    run = simulate(led(f), scheme, (0, 2.1), 0.07)
    np.testing.assert_allclose(run.velocity(MASS.middle)[-3:, 0], 0.0, atol=1e-9)
    assert_balanced(run.energy)


def motor(motion):
    """The mass on an axle, turned by a motor."""
    at = ub.ground(0, 0), MASS.middle
    turn = ub.Turn(*at, ub.PrescribedMotion(motion))
    return ub.Scene(bodies=[MASS], joints=[ub.Revolute(*at)], connectors=[turn])


@pytest.mark.parametrize("motion", [
    lambda t: 0.5 * min(t, 0.5) ** 2 + 0.5 * max(t - 0.5, 0.0),  # acceleration ends
    lambda t: 0.5 * max(t - 0.5, 0.0) ** 2,  # and begins
    st.GroundMotion(0.1, [0.0, 3.0, 2.0, -4.0, 6.0, 0.0]).displacement,
], ids=["ends", "begins", "record"])  # fmt: skip
@pytest.mark.parametrize("steps", [7, 19, 50])
def test_accelerations_that_jump_are_no_impacts(motion, steps):
    """The change of the momentum is the impulse of the support; the velocities have no jump."""
    scene = led(motion)
    run = simulate(scene, dt=1 / steps)
    force = run.reaction(scene.supports[0])[1:, 0]
    sizes = np.abs(force).max() / steps
    impulses = np.diff(run.times) * force
    assert np.diff(run.momentum()[:, 0]) == pytest.approx(impulses, rel=0, abs=EXACT * sizes)


def test_the_derivative_of_a_run_with_a_jump_within_is_refused():
    def model(rate):
        return motor(ub.Table([0, 0.5, 1], [0, rate, rate]))

    with raises("no derivative: at t = 0.5 s the rate of a prescribed motion jumps"):
        ub.differentiate(model, {"rate": 2.0}, ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    found = ub.differentiate(model, {"rate": 2.0}, ub.EnergyMomentum(), t=(0, 0.4), dt=0.01)
    # d(I w²/2)/d rate with w = rate/0.5; w alternates by w (w dt)²/6 with w dt = 0.04
    change = found.of(lambda run: run.energy["kinetic"])
    np.testing.assert_allclose(change[:, 0], 1.0 * (2.0 / 0.5) / 0.5, rtol=2e-3)


# -- constraints -----------------------------------------------------------------------------------

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


@pytest.mark.parametrize(("name", "scheme"), in_turn(NEW, SCHEMES), ids=str)
def test_a_new_constraint_changes_the_momentum_by_its_impulse_only(name, scheme):
    """Carnot: the lost energy is the kinetic energy of the change of the velocities.

    A beam has a body at its end, joined away from the centre of the body; its flight is so short
    that all positions are as at its beginning.
    """
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    body = ub.Body((2.3, 0.2), mass=1.5, inertia=0.4, name="body")
    other = ub.Body((0, 1.0), mass=2.0, inertia=0.3, name="other")
    parts = {"beams": [beam], "bodies": [body, other]}
    joint = ub.Rigid(beam.end, body.at(2, 0))
    fly = ub.Velocity((beam, body), linear=(1.0, 0.5), angular=0.3, about=(0.4, 1.0))
    before = simulate(ub.Scene(**parts, joints=[joint], initial=[fly]), scheme, (0, 1e-15), 1e-15)
    new = NEW[name](beam.start, other)
    scene = ub.Scene(**parts, **{**new, "joints": [joint, *new.get("joints", [])]})
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
    motions = run.numbering.multipliers.min(initial=run.numbering.size)
    change = np.abs(np.diff(run.v[:, :motions], axis=0))
    assert change[0].max() <= 2 * change[:20].max() <= 2.0
    if scheme in EXACT_LEDGER:
        assert_balanced(energy)


@pytest.mark.parametrize("scheme", EXACT_LEDGER[:2], ids=repr)
@pytest.mark.parametrize(("kind", "spins"), [(ub.Revolute, (1.0, 0.0)), (ub.Rigid, (0.5, 0.5))])
def test_places_that_begin_to_share_unknowns_meet(scheme, kind, spins):
    """Two bodies, 2 and 3 kg, with 10 m/s and 0: 4 m/s; rotations stay in a pin."""
    bodies = a, b = [ub.Body((0, 0), mass=m, inertia=1.0) for m in (2.0, 3.0)]
    push = ub.Velocity((a,), linear=(10.0, 0.0), angular=1.0)
    before = simulate(ub.Scene(bodies=bodies, initial=[push]), scheme, (0, 1e-15), 1e-15)
    scene = ub.Scene(bodies=bodies, joints=[kind(a.middle, b.middle)])
    run = simulate(scene, scheme, dt=0.1, start=before)
    for body, rate in zip(bodies, spins, strict=True):
        wanted = np.broadcast_to([4.0, 0.0, rate], (11, 3))
        np.testing.assert_allclose(run.velocity(body.middle), wanted, atol=1e-9)
    lost = 100.0 + 0.5 - 40.0 - sum(rate**2 / 2 for rate in spins)
    np.testing.assert_allclose(run.energy.lost["impacts"], lost, rtol=EXACT)


def test_velocities_that_contradict_shared_unknowns_are_refused():
    """As with constraint forces: a part with mass has no velocity, but its neighbour moves it."""
    a, b = ub.Beam((0, 0), (0, 3), SECTION), ub.Beam((0, 3), (4, 3), SECTION)

    def scene(joint, *moved):
        turn = ub.Velocity(moved, angular=1.0, about=(0, 0))
        return ub.Scene([a, b], joints=[joint], supports=[ub.Pinned(a.start)], initial=[turn])

    for kind in (ub.Rigid, ub.Revolute):
        for multipliers in (False, True):
            joint = kind(a.end, b.start, multipliers=multipliers)
            with raises("Velocity: ", "at 3 m/s", "give all joined parts velocities that agree"):
                simulate(scene(joint, a), t=(0, 0.1))
    assert len(simulate(scene(joint, a, b), t=(0, 0.02)).times) == 3


# -- machines and runs in parts --------------------------------------------------------------------


def test_a_run_in_parts_does_not_lose_energy():
    """Joints that both scenes have keep the errors of the steps."""
    bob = ub.Body((1, 0), mass=1.0, inertia=0.1)
    parts = {"bodies": [bob], "joints": [ub.Link(ub.ground(0, 0), bob.middle)]}
    wind = ub.PointLoad(bob.middle, force=(0.5, 0.0))
    first, second = (ub.Scene(**parts, loads=[ub.Gravity(), *more]) for more in ([], [wind]))
    before = simulate(first, t=(0, 0.5))
    for scene in (first, second):
        run = simulate(scene, t=(0.5, 1), start=before)
        assert "impacts" not in run.energy
        np.testing.assert_array_equal(run.v[0], before.v[-1])
