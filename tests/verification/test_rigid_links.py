# SPDX-License-Identifier: MIT
"""Parts without deformation and mass: swing on massless links, eccentric loads, stiff beams.

Swing: a flexible beam with a mass at mid-span, hung on two rigid links.  Source: O. A. Bauchau,
N. J. Theron, "Energy decaying scheme for non-linear beam models", Comput. Methods Appl. Mech. Eng.
134 (1996) 37-56; data from MBDyn's tests/stiff/Swing.  All numbers are [calc], made with other
programs; test_swing.py has the same with stiff beams in the place of the links.
"""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from convergence.study import extrapolated
from scenes import SWING_PULSE, clamped, swing

import ufl_beam as ub

CONVERGED = np.loadtxt(Path(__file__).parents[1] / "data/swing.csv", delimiter=",")


def hung(cells):
    """The swing, its links being constraints."""
    beam = swing(cells=cells).beams[0]
    return ub.Scene(
        [beam],
        joints=[
            ub.Link(ub.ground(0, 0), beam.start),
            ub.Link(ub.ground(1.08, 0), beam.end),
        ],
        masses=[ub.PointMass(beam.at(0.5), 0.5)],
        loads=[ub.PointLoad(beam.at(0.5), force=(1, 0), amplitude=SWING_PULSE)],
    )


@lru_cache
def run(cells=4, dt=1e-3, end=0.7):
    return ub.simulate(hung(cells), ub.EnergyMomentum(), t=(0, end), dt=dt)


def row(solution, t):
    """Where the time t is."""
    n = int(np.argmin(np.abs(solution.times - t)))
    assert solution.times[n] == pytest.approx(t, abs=1e-9)
    return n


def places(solution):
    """Mid-span, A, B."""
    beam = solution.scene.beams[0]
    return beam.at(0.5), beam.start, beam.end


@pytest.mark.parametrize(
    ("t", "mid", "A", "unit"),
    [
        (0.50, (0.184135, -0.010707), (0.190133, 0.054305), 1e-6),
        (0.62, (0.243240, -0.019234), None, 1e-6),
        (0.64, (0.25168, -0.01990), (0.30806, 0.17372), 1e-5),
        (0.70, (0.24144, 0.00169), None, 1e-5),
    ],
)
def test_mesh_of_the_paper(t, mid, A, unit):
    """[calc] Four two-node cells, Δt = 1e-3 s, conserving: half a unit of the last digit."""
    solution = run()
    n = row(solution, t)
    at_mid, at_A, at_B = places(solution)
    np.testing.assert_allclose(solution.displacement(at_mid)[n, :2], mid, rtol=0, atol=0.501 * unit)
    if A:
        np.testing.assert_allclose(solution.displacement(at_A)[n, :2], A, rtol=0, atol=0.501 * unit)
    if t == 0.5:
        expected = 0.169473, -0.112122
        np.testing.assert_allclose(solution.displacement(at_B)[n, :2], expected, atol=0.501e-6)
    if t == 0.64:
        # Of the strain at that time; section forces are of the step before
        N = at_mid.beam.section.EA * solution.strains_at(at_mid)[n, 0]
        assert pytest.approx(143.3, abs=0.051) == N


def test_links_keep_their_length_and_do_no_work():
    """To 1e-12 of their length; the energy is that of the pulse, 0.063887 J [calc].

    Newton's method meets constraints to 1e-12 of the size of the scene; on as much the forces, up
    to 150 N, could do a work of 1e-10 J.
    """
    solution = run()
    for joint, apart in zip(solution.scene.joints, (0.36, math.sqrt(2) * 0.36), strict=True):
        a, b = joint.places
        length = np.linalg.norm(solution.position(b) - solution.position(a), axis=1)
        assert np.abs(length - apart).max() < 1e-12
        (rod,) = joint.holders
        assert np.abs(solution.connector(rod).work).max() < 1e-11 * 0.063887
    energy = solution.energy
    assert energy.worst < 1e-9
    after = energy.total[solution.times > 0.2561]
    np.testing.assert_allclose(after, 0.063887, rtol=0, atol=0.51e-6)


def motion(cells, dt):
    """Displacements of mid-span, A and B at the times of the table; (8, 6)."""
    return motion_of(run(cells, dt, 0.64))


def motion_of(solution):
    """The same of a run."""
    n = [row(solution, t) for t in CONVERGED[:, 0]]
    return np.hstack([solution.displacement(place)[n, :2] for place in places(solution)])


def test_convergence_to_the_table():
    """[calc] 3e-5 m up to 0.640 s, which the table claims.

    Richardson's limit in space and in time, each from its own runs since the errors add; before
    the snap it lies within half a unit of the table and the change from a coarser pair of meshes.
    """
    space, finer = [motion(n, 5e-4) for n in (8, 16, 32)], motion(16, 2.5e-4)
    in_time = extrapolated(space[1], finer) - space[1]
    before, after = (extrapolated(space[i], space[i + 1]) + in_time for i in (0, 1))
    difference = np.abs(after - np.delete(CONVERGED, [0, 3, 4], axis=1))
    assert difference.max() <= 3e-5
    left = np.abs(after - before)[:6].max()
    assert difference[:6].max() <= 0.5e-6 + left
    assert left <= 1.5e-5


def test_adaptive_steps_meet_the_table():
    """3e-5 m as above, with less than half of the equal steps that err as much.

    The errors of 16 cells in time are those from a run of a tolerance fifty times smaller.
    """
    stops = CONVERGED[:, 0].tolist()

    def adaptive(cells, tolerance):
        steps = ub.Adaptive(tolerance, stops=stops)
        return ub.simulate(hung(cells), ub.EnergyMomentum(), t=(0, 0.64), dt=steps)

    coarse, fine, exact = adaptive(16, 5e-7), adaptive(32, 5e-7), motion_of(adaptive(16, 1e-8))
    limit = extrapolated(motion_of(coarse), motion_of(fine))
    assert np.abs(limit - np.delete(CONVERGED, [0, 3, 4], axis=1)).max() <= 3e-5
    equal = run(16, 5e-4, 0.64)
    assert np.abs(motion_of(coarse) - exact).max() < np.abs(motion_of(equal) - exact).max()
    assert coarse.parts < equal.parts / 2
    assert np.abs(motion_of(coarse) - exact).max() < coarse.time_error * coarse.scene.size


def test_peak_of_the_snap():
    """[calc] 151 N at 0.6406 s; 1 %, with 32 cells and Δt = 2e-4 s.

    Half the step moves the peak by 0.2 %.
    """
    solution = run(32, 2e-4, 0.642)
    beam = solution.scene.beams[0]
    N = beam.section.EA * solution.strains_at(beam.at(0.5))[:, 0]
    assert N.max() == pytest.approx(151, rel=0.01)
    assert solution.times[N.argmax()] == pytest.approx(0.6406, abs=2e-4)


# -- eccentric loads ---------------------------------------------------------------------------

SECTION = ub.Section(EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=1e-3)


def outrigger(scheme, *, load, how, cells=4, arm=0.5):
    """A cantilever of 1 m with a rigid arm upwards at its end that is pushed at its tip."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=cells)
    plate = ub.Body((1.0, arm), mass=1.0, inertia=1.0, name="plate")
    if how == "link":
        joint, at = ub.RigidLink(beam.end, plate.middle), plate.middle
    elif how == "off-centre":
        plate = ub.Body((1.3, 0.2), mass=1.0, inertia=1.0, name="plate")
        joint, at = ub.Rigid(beam.end, plate.at(1, 0)), plate.at(1.0, arm)
    else:
        at = beam.end
    bodies = [] if how == "statically" else [plate]
    joints = [joint] if bodies else []
    x, y = load
    moment = -arm * x if how == "statically" else 0.0
    loads = [ub.PointLoad(at, force=(x, y), moment=moment, amplitude=ub.ramp(1.0))]
    scene = clamped(beam, joints=joints, bodies=bodies, loads=loads)
    solution = ub.simulate(scene, scheme, t=(0, 1), dt=0.1)
    return solution, beam


@pytest.mark.parametrize("how", ["link", "off-centre"])
def test_moment_is_force_times_offset(how):
    """A small force: the moment in the beam is force x offset, [closed], to the displacements.

    1e-3 N at 0.5 m bends the beam by 5e-6 rad, which is what the lever changes by.
    """
    for load in ((1e-3, 0.0), (0.0, 1e-3), (1e-3, 2e-3)):
        solution, beam = outrigger(ub.Static(), load=load, how=how)
        N, V, M = solution.section_forces(beam)[-1]
        assert pytest.approx(load[0], abs=1e-5 * 2e-3) == N
        assert pytest.approx(load[1], abs=1e-5 * 2e-3) == V
        # In the middle of the last cell, 1/8 m from the end
        assert pytest.approx(load[1] / 8 - 0.5 * load[0], abs=1e-5 * 2e-3) == M
        reaction = solution.reaction(solution.scene.supports[0])[-1]
        by_hand = -load[0], -load[1], 0.5 * load[0] - load[1]
        np.testing.assert_allclose(reaction, by_hand, rtol=0, atol=1e-5 * 2e-3)


def test_large_rotation_by_an_eccentric_load():
    """The equilibrium by hand: the reaction is minus the load, and its moment that of the tip."""
    solution, beam = outrigger(ub.Static(), load=(-150.0, -40.0), how="link")
    tip = solution.displacement(beam.end)[-1]
    assert abs(tip[2]) > 0.5  # it bends a lot
    x, y = solution.position(beam.end)[-1]
    lever = np.array([x - 0.5 * math.sin(tip[2]), y + 0.5 * math.cos(tip[2])])
    moment = lever[0] * -40.0 - lever[1] * -150.0
    reaction = solution.reaction(solution.scene.supports[0])[-1]
    np.testing.assert_allclose(reaction, [150.0, 40.0, -moment], rtol=1e-8)


def test_eccentric_load_on_a_body():
    """The same with the arm as a part of a body, which is pushed off its centre."""
    tips = []
    for how in ("link", "off-centre"):
        solution, beam = outrigger(ub.Static(), load=(-150.0, -40.0), how=how)
        tips.append(solution.displacement(beam.end)[-1])
    # Each is solved to 1e-10 of the forces, up to EA = 1e6 N over EI = 100 N m²
    np.testing.assert_allclose(*tips, rtol=0, atol=1e-8)


# -- stiff beams in the place of rigid parts ---------------------------------------------------


def with_arm(ratio):
    """The outrigger in dynamics, its arm a RigidLink or a beam that is so many times as stiff."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    load = {"force": (-20.0, -30.0), "amplitude": ub.ramp(0.1)}
    if ratio is None:
        plate = ub.Body((1.0, 0.5), mass=1.0, inertia=0.1, name="plate")
        beams, bodies, masses = [beam], [plate], []
        joint = ub.RigidLink(beam.end, plate.middle)
        loads = [ub.PointLoad(plate.middle, **load)]
    else:
        stiff = ub.Section(EA=ratio * 1e3, GA=ratio * 1e3, EI=ratio * 100.0, rhoA=0.0)
        arm = ub.Beam((1, 0), (1, 0.5), stiff, cells=1, name="arm")
        beams, bodies, masses = [beam, arm], [], [ub.PointMass(arm.end, 1.0, 0.1)]
        joint = ub.Rigid(beam.end, arm.start)
        loads = [ub.PointLoad(arm.end, **load)]
    scene = ub.Scene(
        beams, joints=[joint], bodies=bodies, masses=masses,
        supports=[ub.Clamped(beam.start)], loads=loads,
    )  # fmt: skip
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
    assert solution.energy.worst < 1e-9
    return solution.displacement(beam.end)[-1]


def test_stiff_beams_become_rigid():
    """The error falls like 1/ratio until round-off, and all ratios can be solved."""
    exact = with_arm(None)
    errors = np.array([np.abs(with_arm(10.0**n) - exact).max() for n in range(2, 9)])
    falls = errors[1:] / errors[:-1]
    np.testing.assert_allclose(falls, 0.1, rtol=0, atol=0.011)
    assert errors[-1] < 1e-8


def test_stiff_links_become_links():
    """The same for the links of the swing up to 0.6 s, before the snap."""
    exact = run(end=0.6).displacement(places(run(end=0.6))[0])[-1, :2]
    errors = []
    for ratio in (1e-2, 1e-1, 1.0):
        scene = swing(cells=4, rigidity=ratio)
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.6), dt=1e-3)
        moved = solution.displacement(scene.beams[0].at(0.5))[-1, :2]
        errors.append(np.abs(moved - exact).max())
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 5
