# SPDX-License-Identifier: MIT
"""What is reported to happen, and when."""

import math
from dataclasses import replace

import pytest
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

ELASTIC = ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=1.0, rhoI=1e-3)


def cantilever(section, motion, **more):
    """A beam of 1 m, clamped, whose end rotates as `motion` says."""
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, name="arm", **more)
    return clamped(beam, ub.PrescribedDisplacement(beam.end, psi=motion))


def run(scene, scheme, *, t=1.0, dt=0.05):
    told = []
    events = ub.Events(tell=told.append)
    ub.simulate(scene, scheme, t=(0, t), dt=dt, record=events)
    if ub.parallel.active_comm().rank == 0:
        assert told == events.found
    return events.found


def test_a_hinge_opens_and_becomes_a_joint():
    """Uniform moment EI ψ / L until the limit, after which one cell opens, in closed form.

    Then EI (ψ - jump) / L = m = limit exp(-limit jump / energy); 99.9 % of the energy are gone at
    m = limit / 1000.
    """
    hinge = ub.Softening(limit=100.0, fracture_energy=50.0)
    scene = cantilever(ELASTIC, lambda t: 5 * t, hinges={0.25: hinge})
    assert run(cantilever(ELASTIC, lambda t: t), ub.Static()) == []
    first, last = run(scene, ub.Static(), dt=0.01)
    assert (first.what, last.what) == ("opens", "is free")
    assert first.where.beam.name == "arm"
    assert first.where.s == 0.25
    opens = 100.0 / 1e3 / 5
    free = (math.log(1000) * 50.0 / 100.0 + 0.1 / 1e3 * 1e3 / 1e3) / 5
    assert first.time == pytest.approx(opens + 0.01, abs=0.0101)
    assert last.time == pytest.approx(free, abs=0.0101)
    assert str(first) == f"t = {first.time:.9g} s: arm.at(0.25) (0.25, 0) opens"


def test_yielding_is_reported_once_in_each_cell():
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3, bending=ub.ElastoPlastic(100.0, isotropic=50.0))
    events = run(cantilever(section, lambda t: 0.3 * math.sin(6 * t)), ub.Static())
    assert [e.what for e in events] == ["yields", "yields"]
    assert {e.where.s for e in events} == {0.25, 0.75}
    # EI 0.3 sin(6 t) = 100 at t = 0.0566
    assert [e.time for e in events] == pytest.approx([0.1, 0.1])


def test_a_ball_bounces():
    """Flies 0.1 m at 1 m/s to a stop; half a period of contact; back to the other one."""
    ball = ub.Body((0, 0), mass=1.0, inertia=1.0, name="ball")
    stop = ub.Slide(ub.ground(0, 0), ball.middle, ub.Stop(1e4, low=-0.1, high=0.1), axis=(1, 0))
    start = [ub.Velocity([ball], linear=(1.0, 0.0))]
    scene = ub.Scene(bodies=[ball], connectors=[stop], initial=start)
    events = run(scene, ub.EnergyMomentum(), t=0.5, dt=1e-3)
    assert [e.what for e in events] == ["touches", "lets go", "touches", "lets go"]
    contact = math.pi / 100
    expected = [0.1, 0.1 + contact, 0.3 + contact, 0.3 + 2 * contact]
    assert [e.time for e in events] == pytest.approx(expected, abs=2e-3)
    assert {e.where for e in events} == {stop}


def test_friction_slides_and_sticks():
    """A block on a spring, let go at rest where the spring is stronger than friction."""
    block = ub.Body((0, 0), mass=1.0, inertia=1.0, name="block")
    friction = ub.Slide(ub.ground(0, 0), block.middle, ub.Coulomb(force=1.0), axis=(1, 0))
    push = ub.PointLoad(block.middle, force=(1.0, 0.0), amplitude=lambda t: 2.0 if t < 0.1 else 0.0)
    parts = {"connectors": [friction], "supports": [ub.Roller(block.middle)], "loads": [push]}
    scene = ub.Scene(bodies=[block], **parts)
    events = run(scene, ub.EnergyMomentum(), t=0.4, dt=1e-3)
    assert [e.what for e in events] == ["slides", "sticks"]
    # 1 m/s² for 0.1 s, then -1 m/s² for as long
    assert [e.time for e in events] == pytest.approx([0.0, 0.2], abs=3e-3)


@pytest.mark.parametrize("last", [0.06, 0.2], ids=["sticking", "sliding"])
def test_friction_goes_on_as_it_was(last):
    """Whether a place sticks depends on a limit, which is known in a run that goes on."""
    # A cantilever whose end is pushed against friction of 0.5 N slides from 0.14 s on.
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e3, GA=1e3, EI=1.0, rhoA=1.0), cells=2)
    brake = ub.Slide(ub.ground(1, 1), beam.end, ub.Coulomb(0.5), axis=(0, 1))
    push = ub.PointLoad(beam.end, (0, 1), amplitude=lambda t: 4 * t)
    shake = ub.PointLoad(beam.at(0.5), (0, 0.1))  # something moves before
    scene = clamped(beam, loads=[push, shake], connectors=[brake])

    def events(t, start=None):
        record = ub.Events()
        run = ub.simulate(scene, ub.EnergyMomentum(), t=t, dt=0.02, record=record, start=start)
        return run, [(event.what, event.time) for event in record.found]

    _, whole = events((0, 0.3))
    run, first = events((0, last))
    found = first + events((last, 0.3), run)[1]
    assert [what for what, _ in found] == ["slides"]
    assert found == [(what, pytest.approx(time)) for what, time in whole]


SECTION = ub.Section.rectangle(0.1, 0.2, E=210e9, nu=0.3, rho=7850.0)


@pytest.mark.parametrize(
    ("laws", "least"),
    [
        ({"interaction": st.AxialBending(5e6, 3e5)}, 0),
        ({"bending": st.ArmstrongFrederick(3e5, 1e6, 5.0)}, 0),
        ({"bending": st.MenegottoPinto(3e5, 0.01)}, 1),  # flows from the beginning
    ],
)
def test_cells_yield_once_and_not_by_round_off(laws, least):
    """The moment is a seventh of the limit, and changes its sign."""
    beam = ub.Beam((0, 0), (2, 0), replace(SECTION, **laws), cells=3)
    load = ub.PointLoad(beam.end, (1e4, -2e4), amplitude=lambda t: math.sin(20 * t))
    events = ub.Events()
    scene = clamped(beam, loads=[load])
    moved = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.02, record=events)
    assert len(events.found) == least * 3
    assert len(st.hinge_table(moved).rows) == least
