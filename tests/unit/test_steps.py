# SPDX-License-Identifier: MIT
"""Steps of C: openings within a step, states that are kept, interrupts, steps of any size."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from helpers import raises, run
from scenes import SECTION, clamped, rigid_chain

import ufl_beam as ub

pytestmark = pytest.mark.serial


def elastic():
    """Two load vectors, one with a function of Python, and a support that moves."""
    left = ub.Beam((0, 0), (0, 3), SECTION, cells=4)
    roof = ub.Beam((0, 3), (4, 3), SECTION, cells=4)
    return rigid_chain(
        [left, roof],
        supports=[
            ub.Clamped(left.start),
            ub.PrescribedDisplacement(roof.end, u=lambda t: 0.05 * t, v=0.0),
        ],
        loads=[
            ub.PointLoad(left.end, force=(40.0, -10.0), amplitude=lambda t: np.sin(3.0 * t)),
            ub.LineLoad(roof, force=(0.0, -5.0), amplitude=ub.ramp(0.3)),
        ],
    )


def inelastic():
    """Bending that hardens, and a hinge in a cell that softens."""
    law = ub.ElastoPlastic(yield_limit=30.0, kinematic=50.0)
    weak = replace(SECTION, hinge=ub.Softening(limit=25.0, fracture_energy=20.0))
    left = ub.Beam((0, 0), (0, 3), replace(SECTION, bending=law), cells=4)
    roof = ub.Beam((0, 3), (4, 3), weak, cells=4)
    return rigid_chain(
        [left, roof],
        supports=[ub.Clamped(left.start), ub.Pinned(roof.end)],
        loads=[ub.PointLoad(left.end, force=(40.0, -10.0), amplitude=ub.ramp(0.4))],
    )


def connected():
    """Members joined by a pin, springs that yield and break, and plastic hinges that open."""
    left = ub.Beam((0, 0), (0, 3), SECTION, cells=3, hinges={0.0: ub.Softening(2.0, 10.0)})
    hinges = {0.5: ub.ElastoPlastic(yield_limit=5.0, kinematic=20.0)}
    roof = ub.Beam((0, 3), (4, 3), SECTION, cells=4, hinges=hinges)
    props = [
        ub.Stretch(ub.ground(1, 0), roof.at(0.25), ub.Spring(200.0, ub.ElastoPlastic(4.0, 5.0))),
        ub.Turn(left.end, roof.start, ub.Spring(50.0, softening=ub.Softening(0.2, 1.0))),
    ]
    return ub.Scene(
        [left, roof],
        joints=[ub.Revolute(left.end, roof.start, multipliers=True)],
        supports=[
            ub.Clamped(left.start),
            ub.PrescribedDisplacement(roof.end, u=0.0, v=lambda t: -0.8 * t),
        ],
        loads=[ub.PointLoad(left.end, force=(40.0, -10.0), amplitude=ub.ramp(0.4))],
        connectors=props,
    )


def slipping():
    """Cells with cracks, and between them hinges that slip; in a step several open in turn."""
    cracks = ub.Fibres(
        ub.ElastoPlastic(9e3, isotropic=1e5), softening=ub.Softening(4e3, 200.0), number=6
    )
    section = ub.Section.rectangle(b=0.1, h=0.1, E=1e6, nu=0.3, rho=100.0)
    cracking = ub.Section.rectangle(b=0.1, h=0.1, E=1e6, nu=0.3, rho=100.0, fibres=cracks)
    at = np.linspace(0.0, 6.0, 7)
    beams = [
        ub.Beam((a, 0), (b, 0), of, cells=2)
        for a, b, of in zip(at[:-1], at[1:], [section, cracking] * 3, strict=True)
    ]
    return ub.Scene(
        beams,
        joints=[ub.Revolute(a.end, b.start) for a, b in pairwise(beams)],
        connectors=[
            ub.Turn(a.end, b.start, ub.RigidPlastic(ub.ElastoPlastic(limit, isotropic=20.0)))
            for limit, (a, b) in zip((0.5, 0.6, 0.6, 0.7, 0.5), pairwise(beams), strict=True)
        ],
        supports=[ub.Clamped(beams[0].start), ub.Clamped(beams[-1].end)],
        loads=[ub.LineLoad(beam, force=(0.0, -1.2), amplitude=ub.ramp(0.2)) for beam in beams],
    )


def end(simulation, steps, dt=0.02):
    for n in range(steps):
        simulation.step_to((n + 1) * dt)
    return simulation


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(0.1, 0.05), ub.GeneralizedAlpha(0.5), ub.Static()], ids=str
)
def test_steps_in_which_several_places_open_are_those_of_the_reference(scheme, as_by_reference):
    """Scenes of all kinds are compared in properties/test_reference_path.py."""
    as_by_reference(run(slipping(), scheme, t=(0, 0.36), dt=0.04, newton=ub.Newton(1e-12)), 1e-7)


def test_states_that_were_asked_for_stay():
    """They are copied once they are asked for, and later steps do not write to them."""
    watched, alone = (ub.Simulation(connected(), ub.EnergyMomentum()) for _ in range(2))
    seen = []
    for n in range(6):
        for simulation in (watched, alone):
            simulation.step_to(0.02 * (n + 1))
        assert watched.q is watched.q
        seen.append((watched.q, watched.inertia.v, watched.q.copy(), watched.inertia.v.copy()))
    for q, v, q_then, v_then in seen:
        assert np.array_equal(q, q_then)
        assert np.array_equal(v, v_then)
    assert not np.array_equal(seen[0][0], seen[-1][0])
    assert np.array_equal(alone.q, watched.q)
    assert np.array_equal(alone.inertia.v, watched.inertia.v)
    assert "hinges" in alone.ledger.lost


def test_no_leap_beyond_a_limit_load():
    """Two springs that are to snap through, from 0.3 m above their ends, each 1 m aside.

    With the apex y above them they carry 2 k y (L / √(1 + y²) - 1), most where 1 + y² = L^(2/3).
    """
    k, rise = 1000.0, 0.3
    apex = ub.Beam((0, rise), (0, rise + 0.1), SECTION, cells=1)
    length = np.hypot(1.0, rise)
    y = np.sqrt(length ** (2 / 3) - 1)
    limit = 2 * k * y * (length / np.hypot(1.0, y) - 1)
    scene = ub.Scene(
        [apex],
        connectors=[ub.Stretch(ub.ground(x, 0), apex.start, ub.Spring(k)) for x in (-1, 1)],
        supports=[ub.PrescribedDisplacement(apex.start, u=0.0, psi=0.0)],
        loads=[ub.PointLoad(apex.start, force=(0.0, -1.5 * limit), amplitude=ub.ramp(1.0))],
    )
    with raises("a limit load or a bifurcation is near", kind=ub.ConvergenceError) as caught:
        run(scene, ub.Static(), dt=0.5)
    assert 1.5 * caught.value.solution.times[-1] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("dt", [0.1, 0.03, 1 / 30, 0.007])
def test_the_first_contact_in_statics_is_no_leap(dt, as_by_reference):
    """A lever of 2 m on a pin moves freely, until its middle, at half the motion, meets a stop.

    Before the contact there is no energy in the scene to which the energy of the contact is small.
    The force at the end holds half of the contact force.
    """
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    end = ub.PrescribedDisplacement(beam.end, v=lambda t: 0.02 * t)
    k, middle = 1e5, beam.at(0.5)
    stop = ub.Slide(ub.ground(1, 0), middle, ub.Stop(k, high=5e-4), axis=(0, 1))
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), end], connectors=[stop])
    solution = run(scene, ub.Static(), t=(0, 0.3), dt=dt, newton=ub.Newton(rtol=1e-12))
    as_by_reference(solution)
    force = solution.connector(stop).force[-1]
    assert force == pytest.approx(k * (solution.displacement(middle)[-1, 1] - 5e-4), rel=1e-9)
    assert solution.reaction(end)[-1, 1] == pytest.approx(force / 2, rel=1e-5)


@pytest.mark.parametrize("make", [elastic, inelastic, connected])
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(0.1, 0.05), ub.Static()], ids=str)
def test_now_is_read_as_the_solution(make, scheme):
    """The state of a running simulation, and the last one of its solution, in all columns."""
    simulation = ub.Simulation(make(), scheme)
    for t in np.linspace(0.0, 0.3, 16)[1:]:
        simulation.step_to(t)
        simulation.keep()
        now, solution = simulation.now, simulation.solution
        state, states = now.history(), solution.history()
        assert {*states} - {"before", "every"} == {*state} - {"before"}
        for name in state.keys() & states.keys():
            assert np.array_equal(state[name][0], states[name][-1]), name
        assert np.array_equal(now.before(0), solution.before(-1)) or not solution.needs_start
        for beam in simulation.scene.beams:
            assert np.array_equal(now.diagram(beam), solution.diagram(beam))


@pytest.mark.parametrize("make", [inelastic, connected])
def test_every_other_state_stays_when_states_are_thinned(make):
    """Every other state stays, whatever kept them."""
    simulation, ends = ub.Simulation(make(), ub.EnergyMomentum()), np.linspace(0.0, 0.6, 31)[1:]
    simulation.keep()
    while len(ends):
        ends = ends[simulation.steps_to(ends, keep=True) :]
    solution = simulation.solution
    before, beams = solution.history(), solution.scene.beams
    begun = np.array([solution.before(n) for n in range(31)])
    forces = [[solution.section_forces(beam, n) for beam in beams] for n in range(0, 31, 2)]
    solution.downsample()
    after = solution.history()
    assert len(solution) == 16
    for name in after.keys() - {"every"}:
        whole = begun if name == "before" else before[name]
        assert np.array_equal(after[name], whole[::2], equal_nan=True), name
    for n, of_state in enumerate(forces):
        for beam, one in zip(beams, of_state, strict=True):
            assert np.array_equal(solution.section_forces(beam, n), one)


@dataclass(frozen=True)
class Short(ub.EnergyMomentum):
    """A scheme with a number too few."""

    def coefficients(self, dt, last_dt, known):
        return super().coefficients(dt, last_dt, known)._replace(rates=((2 / dt, -1.0),))


def test_coefficients_of_another_number_are_refused():
    with raises("Short", "coefficients", "rows have 3 + known finite numbers"):
        ub.Simulation(elastic(), Short())


def test_slender_beams_yield_in_a_few_iterations():
    """Axial strains of straight increments are not taken for yielding: fibres bend by 56 degrees.

    With branches and forces by the strains of the iterates it takes 33 iterations a step, and half
    of the steps are cut.
    """
    steel = ub.Fibres(ub.ElastoPlastic(355e6, isotropic=5e9), number=8)
    section = ub.Section.rectangle(b=0.02, h=0.01, E=210e9, nu=0.3, fibres=steel)
    beam = ub.Beam((0, 0), (1, 0), section, cells=12)
    load = ub.PointLoad(beam.end, force=(0.0, 360.0), amplitude=ub.ramp(1.0))
    simulation = ub.Simulation(clamped(beam, loads=[load]), ub.Static())
    end(simulation, 20, 0.05)
    assert simulation.substeps == 20
    assert simulation.iterations <= 80
    assert simulation.displacement(beam.end)[2] > 0.95
    assert simulation.entries()[2]["plastic"] > 0


def test_singular_tangent_is_a_failed_step():
    """KLU stops PETSc where it finds no pivot; a shorter step has one.

    A force that grows by 4 m/dt² takes from a step of dt what inertia gives it.
    """
    body, dt = ub.Body((1, 0), mass=1.0, inertia=1.0), 2.0**-6
    law = ub.ForceLaw(lambda e, rate: -4.0 / dt**2 * e)
    scene = ub.Scene(
        bodies=[body],
        connectors=[ub.Slide(ub.ground(0, 0), body.middle, law)],
        loads=[ub.PointLoad(body.middle, force=(1.0, 0.0))],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0.0, dt), dt=dt)
    assert solution.substeps > 1
    assert np.isfinite(solution.q).all()


@pytest.mark.parametrize("dt", [1e-15, 1e-18])
def test_steps_that_do_not_change_the_time_are_refused(dt):
    with raises("too small: steps from t = 1 to 2 s"):
        ub.simulate(elastic(), ub.EnergyMomentum(), t=(1.0, 2.0), dt=dt)


def test_steps_from_zero_may_have_any_size():
    """The time itself is what limits a step, not its size in seconds."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    start = ub.Velocity([beam], linear=(1.0, 0.0))
    scene = ub.Scene([beam], initial=[start])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0.0, 3e-30), dt=1e-30)
    assert solution.momentum()[-1, 0] == pytest.approx(1.0, rel=1e-14)
