# SPDX-License-Identifier: MIT
"""Where a run begins: at rest, in the state of another solution, in motion."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import raises, run
from scenes import SECTION, clamped

import ufl_beam as ub

EXACT, STATIC = ub.EnergyMomentum(), ub.Static()


def bent(load=ub.PointLoad):
    """A cantilever with a steady force that bends it by some 0.5 rad, and gravity."""
    beam = ub.Beam((0, 0), (2, 1), SECTION, cells=4)
    loads = [load(beam.end, force=(5, -30)), ub.Gravity()]
    return beam, clamped(beam, loads=loads, masses=[ub.PointMass(beam.at(0.5), 1.0)])


# -- in the state of another solution --------------------------------------------------------------


@pytest.mark.parametrize("load", [ub.PointLoad, ub.FollowerLoad])
@pytest.mark.parametrize("scheme", [EXACT, ub.EnergyMomentum(0.1, 0.1)], ids=str)
def test_dynamics_from_a_static_solution_stays_at_rest(load, scheme):
    beam, scene = bent(load)
    static = run(scene, STATIC, dt=0.25)
    end = static.displacement(beam.end)[-1]
    assert np.abs(end).max() > 0.3
    solution = run(scene, scheme, t=(0, 5), start=static)
    motion = solution.displacement(beam.end)
    assert (motion[0] == end).all()
    # What Newton's method leaves, 1e-10 of 100 N, on 100 N/m of stiffness
    assert np.abs(motion - end).max() < 1e-9
    # A residual of 1e-8 N moves 1e-10 m at 1e-9 m/s
    assert solution.energy["kinetic"].max() < 1e-15
    assert np.abs(solution.velocity(beam.end)).max() < 1e-7


@pytest.mark.parametrize(
    ("scheme", "middle", "dt"),
    [
        (ub.EnergyMomentumDecaying(), 0.1, 0.01),
        (ub.EnergyMomentumDecaying(), 0.12, 0.002),
        (ub.GeneralizedAlpha(), 0.07 + 0.02, 0.003),
    ],
)
def test_a_scheme_that_uses_the_last_step_carries_on(scheme, middle, dt):
    """The second part knows the change of velocities in the last step of the first part.

    In floating point 60 · 0.12 / 60 is less than 0.12, and 0.07 + 0.02 is more than 0.09.
    """
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    push = ub.PointLoad(beam.end, force=(0, -3.0), amplitude=ub.Table([0, 0.05, 0.06], [1, 1, 0]))
    scene = clamped(beam, loads=[push])
    whole = run(scene, scheme, t=(0, 2 * middle), dt=dt)
    first = run(scene, scheme, t=(0, round(middle, 2)), dt=dt)
    assert first.times[-1] == round(middle, 2)
    second = run(scene, scheme, t=(middle, 2 * middle), dt=dt, start=first)
    size = np.abs(whole.q).max()
    assert size > 0.01
    np.testing.assert_allclose(second.q[-1], whole.q[-1], atol=1e-12 * size)


@pytest.mark.filterwarnings("ignore:.* touch:ufl_beam.ModelWarning")
@pytest.mark.parametrize("scheme", [EXACT, ub.Newmark()], ids=str)
def test_a_joint_may_be_removed(scheme):
    """A coupling opens: both beams go on from where they are, each on its own.

    The joint shared unknowns or was held by forces; what follows is the same, to what Newton's
    method leaves, and nothing comes in.
    """
    a, b = (ub.Beam((x, 0), (x + 1, 0), SECTION, cells=2) for x in (0, 1))
    spring = ub.Stretch(ub.ground(2, 3), b.end, ub.Spring(10.0, law=ub.ElastoPlastic(1.0)))
    push = ub.PointLoad(b.end, force=(0.0, -30.0), amplitude=lambda t: t)
    parted = ub.Scene([a, b], supports=[ub.Clamped(a.start)], connectors=[spring])
    ends = []
    for multipliers in (False, True):
        joint = ub.Rigid(a.end, b.start, multipliers=multipliers)
        whole = replace(parted, joints=[joint], loads=[push])
        bent = run(whole, STATIC, dt=0.125)
        assert bent.connector(spring).work[-1] > 0
        solution = run(parted, scheme, t=(1, 1.5), dt=0.02, start=bent)
        for place in (a.at(0.5), a.end, b.start, b.end):
            before, after = bent.displacement(place)[-1], solution.displacement(place)[0]
            np.testing.assert_array_equal(after, before)
        # The springs of the connectors remember that they have yielded: nothing is stored anew
        stored = bent.energy["stored"][-1]
        assert solution.energy["stored"][0] == pytest.approx(stored, rel=1e-12)
        if scheme == EXACT:
            assert solution.energy.worst < 1e-9
        gap = solution.displacement(b.start)[-1] - solution.displacement(a.end)[-1]
        assert np.abs(gap[:2]).max() > 0.01
        ends.append(np.concatenate([solution.displacement(x)[-1] for x in (a.end, b.start)]))
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-6)


def test_bodies_and_connectors_stay_known_in_another_order():
    """As parts of a scene that follows, with the same joint."""
    hub, other = (ub.Body((x, 0), mass=1.0, inertia=1.0) for x in (0, 3))
    springs = [ub.Stretch(ub.ground(0, 1), x.middle, ub.Spring(9.0)) for x in (hub, other)]
    bar = ub.Beam((0, 0), (0, -1), SECTION, cells=2)
    more = {"beams": [bar], "joints": [ub.Rigid(bar.start, hub.middle)], "loads": [ub.Gravity()]}
    first = ub.Scene(bodies=[hub, other], connectors=springs, **more)
    second = ub.Scene(bodies=[other, hub], connectors=springs[::-1], **more)
    fallen = run(first, t=(0, 0.3), dt=0.01)
    whole, solution = (run(x, t=(0.3, 0.5), dt=0.01, start=fallen) for x in (first, second))
    for place in (hub.middle, other.middle, bar.end):
        motions = solution.displacement(place), whole.displacement(place)
        np.testing.assert_allclose(*motions, atol=1e-9)
    for spring in springs:
        forces = solution.connector(spring).force[1:], whole.connector(spring).force[1:]
        np.testing.assert_allclose(*forces, atol=1e-7)


@pytest.mark.parametrize("reference", [False, True])
def test_a_new_link_must_fit_the_state(reference):
    """A link of the undeformed length would pull the sagging tip up by 1 mm in one step."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    loads = [ub.PointLoad(beam.end, force=(0.0, -0.5))]
    sagging = run(clamped(beam, loads=loads), STATIC, dt=1.0)
    held = clamped(beam, loads=loads, joints=[ub.Link(ub.ground(1.0, 1.0), beam.end)])
    newton = ub.Newton(reference=reference)
    with raises("start: ", "does not fit the end", "Connect the places", kind=ub.ModelError):
        run(held, STATIC, t=(1, 2), dt=1.0, start=sagging, newton=newton)


# -- in motion -------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [EXACT, ub.Newmark()], ids=str)
def test_what_is_held_does_not_move(scheme):
    """Velocities that would contradict a support are zero from the beginning."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    throw = ub.Velocity([beam], linear=(1, 2))
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end, along=(1, 1))]
    scene = ub.Scene([beam], supports=supports, initial=[throw])
    with pytest.warns(ub.ModelWarning, match="Pinned at beam.start .* prescribes u, v, so"):
        solution = run(scene, scheme, t=(0, 0.1), dt=0.05)
    assert np.abs(solution.velocity(beam.start)[:, :2]).max() == 0
    # On the roller the part along it stays: (1, 2) on (1, 1)/√2 is (1.5, 1.5)
    assert solution.velocity(beam.end)[0] == pytest.approx([1.5, 1.5, 0], rel=1e-14, abs=1e-14)
    assert solution.velocity(beam.at(0.5))[0] == pytest.approx([1, 2, 0])


def test_velocity_gives_kinetic_energy_and_momentum():
    # 1 m/s and 2 rad/s of a beam of 2 m and 6 kg with a mass of 4 kg at its end
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1e4, GA=1e4, EI=1e4, rhoA=3.0, rhoI=0.5), cells=3)
    throw = ub.Velocity([beam], linear=(1, 0), angular=2.0)
    scene = ub.Scene([beam], masses=[ub.PointMass(beam.end, 4.0, 0.25)], initial=[throw])
    solution = run(scene, t=(0, 0.1))
    assert solution.velocity(beam.end)[0] == pytest.approx([1, 4, 2], rel=1e-15)
    assert solution.velocity(beam.at(0.25))[0] == pytest.approx([1, 1, 2], rel=1e-15)
    # m v^2 / 2 + (rhoI L + rhoA L^3 / 3 + 4 * 4 + 0.25) ω^2 / 2; the mass matrix is exact
    inertia = 0.5 * 2 + 3 * 8 / 3 + 16 + 0.25
    assert solution.energy["kinetic"][0] == pytest.approx(10 / 2 + inertia * 4 / 2, rel=1e-14)
    assert solution.energy["stored"][0] == 0
    # p = (m v, ω (3 * 2 * 1 + 4 * 2)), L about the origin = J ω
    assert solution.momentum()[0] == pytest.approx([10, 2 * 14, inertia * 2], rel=1e-14)


def test_velocity_about_a_point():
    """And of one beam of two."""
    beam, other = ub.Beam((3, 1), (3, 5), SECTION, cells=2), ub.Beam((5, 0), (6, 0), SECTION)
    turn = ub.Velocity([beam], linear=(7, 0), angular=-2.0, about=(1, 1))
    solution = run(ub.Scene([beam, other], initial=[turn]), t=(0, 0.1))
    # v + ω W (x - c): the start is 2 m to the right of the point, the end 4 m above that
    assert solution.velocity(beam.start)[0] == pytest.approx([7, -4, -2], rel=1e-15)
    assert solution.velocity(beam.end)[0] == pytest.approx([7 + 8, -4, -2], rel=1e-15)
    assert (solution.velocity(other.end) == 0).all()


def test_start_takes_the_place_of_initial_velocities():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    scene = ub.Scene([beam], initial=[ub.Velocity([beam], linear=(0, 3))])
    first = run(scene, dt=0.5)
    second = run(scene, t=(1, 2), dt=0.5, start=first)
    assert (second.v[0] == first.v[-1]).all()
    # Free flight, to round-off of the solver
    assert second.displacement(beam.end)[-1, 1] == pytest.approx(6, abs=1e-10)
