# SPDX-License-Identifier: MIT
"""Swing: a flexible beam with a mass at mid-span, hung on two rigid links; the links snap taut.

Source: O. A. Bauchau, N. J. Theron, "Energy decaying scheme for non-linear beam models", Comput.
Methods Appl. Mech. Eng. 134 (1996) 37-56; data from MBDyn's tests/stiff/Swing.  No response values
are published, so all numbers are [calc], made with other programs.

The links are constraints, or massless beams of one cell, 10⁴ times as stiff as the beam.
"""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from convergence.study import extrapolated
from scenes import SWING_PULSE, swing

import ufl_beam as ub

CONVERGED = np.loadtxt(Path(__file__).parents[1] / "data/swing.csv", delimiter=",")


@lru_cache
def run(alpha=0.0):
    scheme = ub.EnergyMomentum(alpha, alpha)
    return ub.simulate(swing(cells=4, rigidity=1e4), scheme, t=(0, 2.5), dt=1e-3)


def hung(cells):
    """The swing on links that are constraints."""
    beam = swing(cells=cells).beams[0]
    ends = (ub.ground(0, 0), beam.start), (ub.ground(1.08, 0), beam.end)
    return ub.Scene(
        [beam],
        joints=[ub.Link(*pair) for pair in ends],
        masses=[ub.PointMass(beam.at(0.5), 0.5)],
        loads=[ub.PointLoad(beam.at(0.5), force=(1, 0), amplitude=SWING_PULSE)],
    )


@lru_cache
def run_on_links(cells=4, dt=1e-3, end=0.7):
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


PLACES, VELOCITY = [0, 1, 4, 5, 6, 7], [2, 3]
"""Columns of displacements of mid-span, A and B, and of the velocity of mid-span."""


def motion(solution):
    """Columns of the converged table; (8, 8)."""
    n = [row(solution, t) for t in CONVERGED[:, 0]]
    mid, *ends = places(solution)
    moved = [solution.displacement(place)[n, :2] for place in ends]
    return np.hstack([solution.displacement(mid)[n, :2], solution.velocity(mid)[n, :2], *moved])


@pytest.mark.parametrize("run", [run, run_on_links])
@pytest.mark.parametrize(
    ("t", "mid", "A", "unit"),
    [
        (0.50, (0.184135, -0.010707), (0.190133, 0.054305), 1e-6),
        (0.62, (0.243240, -0.019234), None, 1e-6),
        (0.64, (0.25168, -0.01990), (0.30806, 0.17372), 1e-5),
        (0.70, (0.24144, 0.00169), None, 1e-5),
    ],
)
def test_mesh_of_the_paper(t, mid, A, unit, run):
    """[calc] Four two-node cells, Δt = 1e-3 s, conserving: half a unit of the last digit."""
    solution = run()
    n = row(solution, t)
    at_mid, at_A, at_B = places(solution)
    np.testing.assert_allclose(solution.displacement(at_mid)[n, :2], mid, rtol=0, atol=0.501 * unit)
    if A:
        np.testing.assert_allclose(solution.displacement(at_A)[n, :2], A, rtol=0, atol=0.501 * unit)
    if run is run_on_links and t == 0.5:
        expected = 0.169473, -0.112122
        np.testing.assert_allclose(solution.displacement(at_B)[n, :2], expected, atol=0.501e-6)
    if run is run_on_links and t == 0.64:
        # Of the strain at that time; section forces are of the step before
        N = at_mid.beam.section.EA * solution.strains_at(at_mid)[n, 0]
        assert pytest.approx(143.3, abs=0.051) == N
    energy = solution.energy.total[solution.times > 0.2561]
    np.testing.assert_allclose(energy, 0.063887, rtol=0, atol=0.51e-6)


def test_loss_of_energy():
    """[calc] α = β = 0.01: half a unit of the printed digits, 1e-5 J."""
    solution = run(alpha=0.01)
    rows = [row(solution, t) for t in (0.7, 1.0, 1.5, 2.5)]
    np.testing.assert_allclose(
        solution.energy.total[rows], [0.05732, 0.05510, 0.05279, 0.05092], rtol=0, atol=0.51e-5
    )
    mid = solution.displacement(places(solution)[0])[row(solution, 1.0), :2]
    np.testing.assert_allclose(mid, (0.2211, 0.1186), rtol=0, atol=0.51e-4)
    # [calc] with more dissipation: half a unit of the fourth decimal
    for more, left in ((0.05, 0.0469), (0.5, 0.0316)):
        assert run(alpha=more).energy.total[-1] == pytest.approx(left, rel=0, abs=0.51e-4)
    assert (np.diff(solution.energy["numerical"]) >= 0).all()


@pytest.mark.parametrize("alpha", [0.0, 0.01])
def test_the_ledger_closes(alpha):
    """To 1e-9 of the work over 2.5 s; the round-off of forces of the links is ε EA = 8e-7 N."""
    energy = run(alpha=alpha).energy
    assert np.abs(energy.imbalance).max() <= 1e-9 * energy["loads"][-1]


# -- links that are constraints ------------------------------------------------------------------


def test_links_keep_their_length_and_do_no_work():
    """To 1e-12 of the size of the scene, and 1e-11 of the energy."""
    solution = run_on_links()
    for joint, apart in zip(solution.scene.joints, (0.36, math.sqrt(2) * 0.36), strict=True):
        a, b = joint.places
        length = np.linalg.norm(solution.position(b) - solution.position(a), axis=1)
        assert np.abs(length - apart).max() < 1e-12
        (rod,) = joint.holders
        assert np.abs(solution.connector(rod).work).max() < 1e-11 * 0.063887
    assert solution.energy.worst < 1e-9


def test_convergence_to_the_table():
    """[calc] Displacements to 3e-5 m, the accuracy of the table; velocities of mid-span; work.

    Richardson's limit in space and in time, each from its own runs since the errors add; up to
    0.63 s, before the snap, to half a unit and the change of the limit from coarser runs.
    """
    runs = [run_on_links(n, 4e-4, 0.64) for n in (16, 32, 64)]
    space = [motion(solution) for solution in runs]
    time = [space[0], *(motion(run_on_links(16, dt, 0.64)) for dt in (2e-4, 1e-4))]
    before, after = (
        extrapolated(space[i], space[i + 1]) + extrapolated(time[i], time[i + 1]) - time[0]
        for i in (0, 1)
    )
    left, apart = np.abs(after - before), np.abs(after - CONVERGED[:, 1:])
    assert apart[:, PLACES].max() <= 3e-5
    for columns, half, most in ((PLACES, 0.5e-6, 3e-6), (VELOCITY, 0.5e-5, 1e-5)):
        assert apart[:6, columns].max() <= half + left[:6, columns].max()
        assert left[:6, columns].max() <= most
    work = extrapolated(*(solution.energy["loads"][-1] for solution in runs[1:]))
    assert work == pytest.approx(0.063905, rel=0, abs=0.51e-6)


def test_adaptive_steps_meet_the_table():
    """3e-5 m as above, on links, with less than half of the equal steps that err as much.

    The errors of 16 cells in time are those from a run of a tolerance fifty times smaller.
    """
    stops = CONVERGED[:, 0].tolist()

    def adaptive(cells, tolerance):
        steps = ub.Adaptive(tolerance, stops=stops)
        return ub.simulate(hung(cells), ub.EnergyMomentum(), t=(0, 0.64), dt=steps)

    coarse, fine, exact = adaptive(16, 5e-7), adaptive(32, 5e-7), adaptive(16, 1e-8)
    limit = extrapolated(motion(coarse), motion(fine))
    assert np.abs(limit - CONVERGED[:, 1:])[:, PLACES].max() <= 3e-5
    equal = run_on_links(16, 5e-4, 0.64)
    error, other = (np.abs(motion(x) - motion(exact))[:, PLACES].max() for x in (coarse, equal))
    assert error < other
    assert coarse.substeps < equal.substeps / 2
    assert error < coarse.time_error * coarse.scene.size


def test_peak_of_the_snap():
    """[calc] 151 N at 0.6406 s; 1 %, with 32 cells and Δt = 2e-4 s."""
    solution = run_on_links(32, 2e-4, 0.642)
    beam = solution.scene.beams[0]
    N = beam.section.EA * solution.strains_at(beam.at(0.5))[:, 0]
    assert N.max() == pytest.approx(151, rel=0.01)
    assert solution.times[N.argmax()] == pytest.approx(0.6406, abs=2e-4)
