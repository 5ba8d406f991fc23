# SPDX-License-Identifier: MIT
"""Where a run begins: at rest, in the state of another solution, in motion."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from helpers import raises
from scenes import SECTION, clamped

import ufl_beam as ub


def bent(load=ub.PointLoad):
    """A cantilever with a steady force that bends it by some 0.5 rad, and gravity."""
    beam = ub.Beam((0, 0), (2, 1), SECTION, cells=4)
    return clamped(
        beam,
        loads=[load(beam.end, force=(5, -30)), ub.Gravity()],
        masses=[ub.PointMass(beam.at(0.5), 1.0)],
    )


@pytest.mark.parametrize("load", [ub.PointLoad, ub.FollowerLoad])
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1)], ids=str)
def test_dynamics_from_a_static_solution_stays_at_rest(load, scheme):
    scene = bent(load)
    static = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    end = static.displacement(scene.beams[0].end)[-1]
    assert np.abs(end).max() > 0.3
    solution = ub.simulate(scene, scheme, t=(0, 5), dt=0.1, start=static)
    motion = solution.displacement(scene.beams[0].end)
    assert (motion[0] == end).all()
    # What Newton's method leaves, 1e-10 of 100 N, on 100 N/m of stiffness
    assert np.abs(motion - end).max() < 1e-9
    # A residual of 1e-8 N moves 1e-10 m at 1e-9 m/s
    assert solution.energy["kinetic"].max() < 1e-15
    assert np.abs(solution.velocity(scene.beams[0].end)).max() < 1e-7


def test_from_rest_without_start_it_moves():
    """That the test above can fail."""
    scene = bent()
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    assert solution.energy["kinetic"].max() > 1


def test_statics_from_a_static_solution():
    scene = bent()
    once = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    again = ub.simulate(scene, ub.Static(), t=(1, 2), dt=0.5, start=once)
    assert (again.q[0] == once.q[-1]).all()
    assert np.abs(again.q - once.q[-1]).max() < 1e-10  # as converged
    assert again.energy.worst < 1e-9
    assert again.energy["stored"][0] == pytest.approx(once.energy["stored"][-1], rel=1e-14)


def test_a_run_in_two_parts_is_the_run():
    """The state, configuration and velocities, is all that a run needs."""
    scene = bent()
    scheme = ub.EnergyMomentum(0.05, 0.05)
    whole = ub.simulate(scene, scheme, t=(0, 1), dt=0.05)
    first = ub.simulate(scene, scheme, t=(0, 0.5), dt=0.05)
    second = ub.simulate(scene, scheme, t=(0.5, 1), dt=0.05, start=first)
    # The guess of the first step differs, and with it what Newton's method leaves
    assert np.abs(second.q - whole.q[10:]).max() < 1e-9
    assert np.abs(second.v - whole.v[10:]).max() < 1e-7
    assert second.times == pytest.approx(whole.times[10:])


@dataclass(frozen=True)
class DampedVelocities(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics):
    """Δu/dt = (v0 + v1)/2 + c (Δv - r Δv'), with the change Δv' of velocities in the last step."""

    c: float = 0.05

    alpha = 0.0
    uses_last_step = True

    def coefficients(self, dt, last_dt, known):
        c, r, after = self.c, self.c * min(1.0, dt / last_dt), 0.5 + self.c
        return ub.extend.Coefficients(
            inertia=(1 / (dt**2 * after), (r - 1) / (dt * after), -r / (dt * after)),
            velocity=(1 / dt, 0.0, 0.0),
            rates=((1 / (dt * after), (c + r - 0.5) / after, -r / after),),
            velocity_defect=(c, -r, r),
        )

    def error_weights(self):
        return 0.0, 1 / 12 + self.c


@pytest.mark.parametrize(
    "scheme", [DampedVelocities(), ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha()]
)
@pytest.mark.parametrize(("middle", "dt"), [(0.1, 0.01), (0.12, 0.002), (0.07 + 0.02, 0.003)])
def test_a_scheme_that_uses_the_last_step_carries_on(scheme, middle, dt):
    """The second part knows the change of velocities in the last step of the first part.

    In floating point 60 · 0.12 / 60 is less than 0.12, and 0.07 + 0.02 is more than 0.09.
    """
    scene = pushed_beam()
    whole = ub.simulate(scene, scheme, t=(0, 2 * middle), dt=dt)
    first = ub.simulate(scene, scheme, t=(0, round(middle, 2)), dt=dt)
    assert first.times[-1] == round(middle, 2)
    second = ub.simulate(scene, scheme, t=(middle, 2 * middle), dt=dt, start=first)
    size = np.abs(whole.q).max()
    assert size > 0.01
    np.testing.assert_allclose(second.q[-1], whole.q[-1], atol=1e-12 * size)


def pushed_beam():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    push = ub.PointLoad(beam.end, force=(0, -3.0), amplitude=ub.Table([0, 0.05, 0.06], [1, 1, 0]))
    return clamped(beam, loads=[push])


@pytest.mark.parametrize("scheme", [ub.Static(), ub.GeneralizedAlpha(0.6)], ids=str)
def test_forces_of_moving_supports_carry_on(scheme):
    """The work of the first step takes the mean of the force before and after it."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    moved = ub.PrescribedDisplacement(beam.end, v=lambda t: 0.1 * t**2)
    scene = clamped(beam, moved)
    whole = ub.simulate(scene, scheme, t=(0, 1), dt=0.05)
    first = ub.simulate(scene, scheme, t=(0, 0.5), dt=0.05)
    second = ub.simulate(scene, scheme, t=(0.5, 1), dt=0.05, start=first)
    work = whole.energy["supports"][10:] - whole.energy["supports"][10]
    # What Newton's method leaves
    assert second.energy["supports"] == pytest.approx(work, rel=1e-7)


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()], ids=str)
def test_what_is_held_does_not_move(scheme):
    """Velocities that would contradict a support are zero from the beginning."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    throw = ub.Velocity([beam], linear=(1, 2))
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end, along=(1, 1))]
    scene = ub.Scene([beam], supports=supports, initial=[throw])
    with pytest.warns(ub.ModelWarning, match="Pinned at beam.start .* prescribes u, v, so"):
        solution = ub.simulate(scene, scheme, t=(0, 0.1), dt=0.05)
    assert np.abs(solution.velocity(beam.start)[:, :2]).max() == 0
    # On the roller the part along it stays: (1, 2) on (1, 1)/√2 is (1.5, 1.5)
    assert solution.velocity(beam.end)[0] == pytest.approx([1.5, 1.5, 0], rel=1e-14, abs=1e-14)
    assert solution.velocity(beam.at(0.5))[0] == pytest.approx([1, 2, 0])


def test_other_supports_and_loads_may_follow():
    """A rope is cut: the static state of one scene, let go in another of the same beams."""
    scene = bent()
    beam = scene.beams[0]
    held = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    free = clamped(beam, masses=scene.masses)
    solution = ub.simulate(free, ub.EnergyMomentum(), t=(0, 2), dt=0.02, start=held)
    assert solution.energy.total[0] == pytest.approx(held.energy["stored"][-1], rel=1e-14)
    # Nothing comes in and nothing goes out
    assert np.ptp(solution.energy.total) < 1e-9 * solution.energy.total[0]
    assert solution.energy["kinetic"].max() > 0.5 * solution.energy.total[0]


def pair(*, joint=None, **more):
    """Two beams in a row, the first one clamped, with a spring to the ground at the far end."""
    a = more.pop("a", None) or ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="a")
    b = more.pop("b", None) or ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="b")
    joints = [joint(a.end, b.start)] if joint else []
    spring = ub.Stretch(ub.ground(2, 3), b.end, ub.Spring(10.0, law=ub.ElastoPlastic(1.0)))
    return (
        a,
        b,
        ub.Scene(
            [a, b], joints=joints, supports=[ub.Clamped(a.start)], connectors=[spring], **more
        ),
    )


@pytest.mark.filterwarnings("ignore:.* touch:ufl_beam.ModelWarning")
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()], ids=str)
def test_a_joint_may_be_removed(scheme):
    """A coupling opens: both beams go on from where they are, each on its own.

    The joint shared unknowns or was held by forces; what follows is the same, to what Newton's
    method leaves, and nothing comes in.
    """
    ends = []
    for joint in (ub.Rigid, lambda *places: ub.Rigid(*places, multipliers=True)):
        a, b, _ = pair()
        push = ub.PointLoad(b.end, force=(0.0, -30.0), amplitude=lambda t: t)
        _, _, whole = pair(a=a, b=b, joint=joint, loads=[push])
        bent = ub.simulate(whole, ub.Static(), t=(0, 1), dt=0.125)
        assert bent.connector(whole.connectors[0]).work[-1] > 0
        _, _, parted = pair(a=a, b=b)
        solution = ub.simulate(parted, scheme, t=(1, 1.5), dt=0.02, start=bent)
        for place in (a.at(0.5), a.end, b.start, b.end):
            before, after = bent.displacement(place)[-1], solution.displacement(place)[0]
            np.testing.assert_array_equal(after, before)
        # The springs of the connectors remember that they have yielded: nothing is stored anew
        stored = bent.energy["stored"][-1]
        assert solution.energy["stored"][0] == pytest.approx(stored, rel=1e-12)
        if scheme == ub.EnergyMomentum():
            assert solution.energy.worst < 1e-9
        gap = solution.displacement(b.start)[-1] - solution.displacement(a.end)[-1]
        assert np.abs(gap[:2]).max() > 0.01
        ends.append(np.concatenate([solution.displacement(x)[-1] for x in (a.end, b.start)]))
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-6)


@pytest.mark.filterwarnings("ignore:.* touch:ufl_beam.ModelWarning")
def test_a_joint_may_be_added_where_places_are_together():
    """A body on a spring is caught by a hinge while it passes; bodies and connectors stay known."""
    hub = ub.Body((0, 0), mass=1.0, inertia=1.0, name="hub")
    other = ub.Body((3, 0), mass=1.0, inertia=1.0, name="other")
    springs = [ub.Stretch(ub.ground(0, 1), x.middle, ub.Spring(9.0)) for x in (hub, other)]
    bar = ub.Beam((0, 0), (0, -1), SECTION, cells=2, name="bar")
    first = ub.Scene(
        [bar], bodies=[hub, other], connectors=springs, joints=[ub.Rigid(bar.start, hub.middle)],
        loads=[ub.Gravity()],
    )  # fmt: skip
    fallen = ub.simulate(first, ub.EnergyMomentum(), t=(0, 0.3), dt=0.01)
    second = ub.Scene(
        [bar], bodies=[other, hub], connectors=springs[::-1], loads=[ub.Gravity()],
        joints=[ub.Rigid(bar.start, hub.middle)],
    )  # fmt: skip
    whole = ub.simulate(first, ub.EnergyMomentum(), t=(0.3, 0.5), dt=0.01, start=fallen)
    solution = ub.simulate(second, ub.EnergyMomentum(), t=(0.3, 0.5), dt=0.01, start=fallen)
    for place in (hub.middle, other.middle, bar.end):
        np.testing.assert_allclose(
            solution.displacement(place), whole.displacement(place), atol=1e-9
        )
    for spring in springs:
        np.testing.assert_allclose(
            solution.connector(spring).force[1:], whole.connector(spring).force[1:], atol=1e-7
        )


def test_velocity_gives_kinetic_energy_and_momentum():
    # 1 m/s and 2 rad/s of a beam of 2 m and 6 kg with a mass of 4 kg at its end
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1e4, GA=1e4, EI=1e4, rhoA=3.0, rhoI=0.5), cells=3)
    throw = ub.Velocity([beam], linear=(1, 0), angular=2.0)
    scene = ub.Scene([beam], masses=[ub.PointMass(beam.end, 4.0, 0.25)], initial=[throw])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    assert solution.velocity(beam.end)[0] == pytest.approx([1, 4, 2], rel=1e-15)
    assert solution.velocity(beam.at(0.25))[0] == pytest.approx([1, 1, 2], rel=1e-15)
    # m v^2 / 2 + (rhoI L + rhoA L^3 / 3 + 4 * 4 + 0.25) ω^2 / 2; the mass matrix is exact
    inertia = 0.5 * 2 + 3 * 8 / 3 + 16 + 0.25
    assert solution.energy["kinetic"][0] == pytest.approx(10 / 2 + inertia * 4 / 2, rel=1e-14)
    assert solution.energy["stored"][0] == 0
    # p = (m v, ω (3 * 2 * 1 + 4 * 2)), L about the origin = J ω
    assert solution.momentum()[0] == pytest.approx([10, 2 * 14, inertia * 2], rel=1e-14)


def test_velocity_about_a_point():
    beam = ub.Beam((3, 1), (3, 5), SECTION, cells=2)
    turn = ub.Velocity([beam], linear=(7, 0), angular=-2.0, about=(1, 1))
    scene = ub.Scene([beam], initial=[turn])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)
    # v + ω W (x - c): the start is 2 m to the right of the point, the end 4 m above that
    assert solution.velocity(beam.start)[0] == pytest.approx([7, -4, -2], rel=1e-15)
    assert solution.velocity(beam.end)[0] == pytest.approx([7 + 8, -4, -2], rel=1e-15)


def test_velocity_of_one_beam_of_two():
    a = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    b = ub.Beam((5, 0), (6, 0), SECTION, cells=2)
    scene = ub.Scene([a, b], initial=[ub.Velocity([b], linear=(0, 3))])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.5)
    assert (solution.velocity(a.end) == 0).all()
    # Free flight, to round-off of the solver
    assert np.abs(solution.displacement(b.end)[:, 1] - 3 * solution.times).max() < 1e-10


def test_start_takes_the_place_of_initial_velocities():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    scene = ub.Scene([beam], initial=[ub.Velocity([beam], linear=(0, 3))])
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.5)
    second = ub.simulate(scene, ub.EnergyMomentum(), t=(1, 2), dt=0.5, start=first)
    assert (second.v[0] == first.v[-1]).all()
    assert second.displacement(beam.end)[-1, 1] == pytest.approx(6, abs=1e-10)


def test_a_rotating_bar_keeps_turning_through_many_turns():
    """A stiff bar spins freely: ω is exact at the mid-point scheme's tangent of half the turn."""
    stiff = ub.Section(EA=1e7, GA=1e7, EI=1e7, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((-1, 0), (1, 0), stiff, cells=2)
    scene = ub.Scene([beam], initial=[ub.Velocity([beam], angular=10.0)])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 10), dt=0.05)
    # 2 tan(Δψ/2) = ω Δt, so Δψ = 2 atan(0.25) a step: 98 rad, some 16 turns
    expected = 200 * 2 * math.atan(0.25)
    # The bar stretches by its centrifugal force, 50 N / 1e7 N, and breathes by as much
    assert solution.displacement(beam.at(0.5))[-1, 2] == pytest.approx(expected, rel=1e-4)
    assert solution.energy.worst < 1e-9


@pytest.mark.parametrize("reference", [False, True])
def test_a_new_link_must_fit_the_state(reference):
    """A link of the undeformed length would pull the sagging tip up by 1 mm in one step."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    supports, load = [ub.Clamped(beam.start)], ub.PointLoad(beam.end, force=(0.0, -0.5))
    free = ub.Scene([beam], supports=supports, loads=[load])
    sagging = ub.simulate(free, ub.Static(), t=(0, 1), dt=1.0)
    link = ub.Link(ub.ground(1.0, 1.0), beam.end)
    held = ub.Scene([beam], supports=supports, loads=[load], joints=[link])
    with raises("start: ", "does not fit the end", "Connect the places", kind=ub.ModelError):
        ub.simulate(
            held, ub.Static(), t=(1, 2), dt=1.0, start=sagging,
            newton=ub.Newton(reference=reference),
        )  # fmt: skip
