# SPDX-License-Identifier: MIT
"""Runs that fail on the way: the solution up to there, its files, and the message."""

from mpi4py import MPI

import numpy as np
import pytest
from scenes import SECTION, clamped

import ufl_beam as ub


def beam():
    return ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")


def run(scene, scheme=None, *, t=(0.0, 1.0), dt=0.1, **more):
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=t, dt=dt, **more)


def turned(psi):
    one = beam()
    return ub.Scene([one], supports=[ub.PrescribedDisplacement(one.start, u=0, v=0, psi=psi)])


@pytest.mark.filterwarnings(
    "ignore:PrescribedDisplacement at girder.start .* psi jumps:ufl_beam.ModelWarning"
)
@pytest.mark.parametrize(
    ("psi", "time"),
    [(lambda t: 4.0 * (t > 0.55), 0.55), (lambda t: 4.0 * (t > 0), 0.0), (4.0, 0.0)],
)
def test_a_jump_of_more_than_a_half_turn_has_no_equilibrium(psi, time):
    with pytest.raises(ub.ConvergenceError) as failure:
        run(turned(psi))
    message = str(failure.value)
    assert "turns by 4 rad in the step, more than the limit of 0.75 π; reduce dt" in message
    assert f"no equilibrium after t = {time:g} s" in message
    assert "Try a smaller dt" in message
    # Parts of 1/4096 of the step are the smallest
    assert failure.value.dt == pytest.approx(0.1 / 4096, rel=1e-6)
    assert failure.value.time == pytest.approx(time, abs=1e-12)


def test_a_step_with_a_large_turn_is_subdivided():
    """4 rad in 0.1 s is too much for one step of 0.1 s, but not for its parts."""
    scene = turned(lambda t: 40.0 * t)
    solution = run(scene, t=(0, 0.1))
    assert solution.substeps > 1
    assert solution.displacement(scene.beams[0].start)[-1, 2] == pytest.approx(4.0, rel=1e-12)


@pytest.mark.parametrize("scheme", [ub.GeneralizedAlpha(0.8), ub.Newmark()], ids=repr)
def test_a_turn_far_from_the_velocity_is_subdivided(scheme):
    """A step of 0.1 s turns the tip by 5 rad beyond its velocity, and its halves by 1.25 rad."""
    soft = ub.Section(EA=1e-6, GA=1e-6, EI=1e-6, rhoA=1.0, rhoI=1.0)
    one = ub.Beam((0, 0), (1, 0), soft, cells=1)
    moment = 1000.0 / 3.0  # of a third of rhoI, P(18)
    scene = clamped(one, loads=[ub.PointLoad(one.end, moment=moment)])
    solution = run(scene, scheme, t=(0, 0.3))
    turns = solution.displacement(one.end)[:, 2]
    np.testing.assert_allclose(turns, 500.0 * solution.times**2, rtol=1e-6)
    assert solution.substeps == 2 * (len(solution) - 1)
    halves = run(scene, scheme, t=(0, 0.3), dt=0.05)
    assert halves.substeps == len(halves) - 1


def test_nothing_is_lost_when_a_step_fails(shared_path, on_first_rank):
    """The solution ends with the last accepted state, the table with the last whole step."""
    path = shared_path / "run.csv"
    scene = turned(lambda t: t + 4.0 * (t > 0.55))
    end = scene.beams[0].end
    with pytest.raises(ub.ConvergenceError) as failure:
        run(scene, record=ub.History(path, [end]))
    error = failure.value
    solution = error.solution
    # Five whole steps, then parts up to 0.55 s or the last multiple of 0.1/4096 s before it
    assert solution.times[:6] == pytest.approx(0.1 * np.arange(6), abs=1e-12)
    assert solution.times[-1] == error.time
    assert 0.55 - 0.1 / 4096 <= error.time <= 0.55 + 1e-12
    assert len(solution.times) == len(solution.displacement(end)) == 7
    assert solution.energy.worst < 1e-9  # closed by design, section 9
    assert solution.displacement(scene.beams[0].start)[-1, 2] == pytest.approx(error.time)
    rows = on_first_rank(lambda: np.loadtxt(path, delimiter=",", skiprows=1))
    assert (rows[:, 0] == solution.times[:6]).all()
    assert (rows[:, 1:4] == solution.displacement(end)[:6]).all()


def test_too_few_iterations_in_words():
    """Where the equilibrium is missed, and by which forces; no limit load is near."""
    one = beam()
    push = ub.PointLoad(one.end, force=(0, 500), amplitude=lambda t: 1.0 * (t > 0.25))
    newton = ub.Newton(rtol=1e-14, max_iterations=1)
    message = "did not converge after 1 iterations; residual"
    with pytest.raises(ub.ConvergenceError, match=message) as failure:
        run(clamped(one, loads=[push]), ub.Static(), dt=0.5, newton=newton)
    error = failure.value
    assert error.reason == "DIVERGED_MAX_IT"
    for words in ("DIVERGED", "singular", "limit load or a bifurcation is near"):
        assert words not in str(error)
    (place, residual), *_ = error.residuals.items()
    assert f"{residual:.1e} N in {place}" in str(error)
    assert f"of {one.name} at (" in place
    sizes = [*error.residuals.values()]
    assert sizes == sorted(sizes, reverse=True)
    assert set(error.forces) == {"beams", "loads"}
    assert min(error.forces.values()) > residual > 0


def test_the_solution_of_an_interrupted_run_goes_on():
    """What stops it is the user's own; internal variables are those of the last state."""
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, bending=ub.ElastoPlastic(10.0, isotropic=10.0))
    one, until = ub.Beam((0, 0), (1, 0), section, cells=2), [0.55]

    def motion(t):
        if t > until[0]:
            raise KeyboardInterrupt
        return 0.4 * t

    scene = clamped(one, ub.PrescribedDisplacement(one.end, psi=motion))
    with pytest.raises(KeyboardInterrupt) as failure:
        run(scene, ub.Static(), every=4, comm=MPI.COMM_SELF)
    reached = failure.value.solution
    assert reached.times[-1] == pytest.approx(0.5)
    until[0] = 2.0
    rest = run(scene, ub.Static(), t=(reached.times[-1], 1), start=reached, comm=MPI.COMM_SELF)
    whole = run(scene, ub.Static(), comm=MPI.COMM_SELF)
    assert whole.energy.lost["plastic"][-1] > 0
    np.testing.assert_allclose(rest.section_forces(one), whole.section_forces(one), atol=1e-9)
