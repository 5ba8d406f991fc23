# SPDX-License-Identifier: MIT
"""Viscous forces in static runs, and the ledger of a run that another one goes on from."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import run
from scenes import clamped
from user_laws import Dashpot

import ufl_beam as ub

SECTION = ub.Section(EA=1e3, GA=1e3, EI=1.0, rhoA=1.0, rhoI=1e-3)
SLOW_MOTION = pytest.mark.filterwarnings("ignore:.*takes v:ufl_beam.ModelWarning")


def drag(c):
    return ub.VirtualWork("wind", lambda v, w, c: -c * v[1] * w[1], numbers={"c": c})


def pushed(*supports, **more):
    """A cantilever whose end is pushed to and fro."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    load = ub.PointLoad(beam.end, (0, -1), amplitude=lambda t: math.sin(4 * t))
    return clamped(beam, *supports, loads=[load], **more)


@SLOW_MOTION
@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
def test_a_work_with_velocities_acts_in_statics_as_dampers_do(scheme):
    """A rigid bar on springs k in drag c: backward Euler of c u' + k u = F; [exact] to 1e-9 of u.

    Strains of the bar are 1e-9 of the motion over its length.  ``EnergyMomentumStatic`` applies the
    load of the beginning in an eighth of the first step.
    """
    k, c, force, dt = 50.0, 20.0, 3.0, 0.1
    bar = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e10, GA=1e10, EI=1e10), cells=1)

    def moved(*laws, works=()):
        connectors = [
            ub.Slide(ub.ground(*end.point), end, law, axis=(0, 1))
            for law in (ub.Spring(k / 2), *laws)
            for end in (bar.start, bar.end)
        ]
        load = ub.PointLoad(bar.at(0.5), (0, force), amplitude=lambda t: 1 + t)
        guide = ub.Roller(bar.start, along=(0, 1))
        parts = {"supports": [guide], "connectors": connectors, "works": works}
        return run(ub.Scene([bar], loads=[load], **parts), scheme).displacement(bar.end)[:, 1]

    u, begin = [0.0], 0.0
    if scheme != ub.Static():
        begin = dt / 8
        u = [force / (c / begin + k)]
    for end in np.arange(1, 11) * dt:
        viscous = c / (end - begin)
        u.append((viscous * u[-1] + force * (1 + end)) / (viscous + k))
        begin = end
    u[0] = 0.0
    np.testing.assert_allclose(moved(works=[drag(c)]), u, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(moved(ub.Damper(c / 2)), u, rtol=1e-8, atol=1e-12)
    assert moved()[-1] > 1.2 * u[-1]


def test_a_static_run_warns_of_a_work_with_velocities():
    scene = pushed(works=[drag(1.0)])
    with pytest.warns(ub.ModelWarning, match=r"'wind' takes v, which is \(q1 - q0\)/dt") as told:
        ub.simulate(scene, ub.Static(), t=(0, 0.1), dt=0.1)
    assert told[0].filename == __file__
    run(scene, t=(0, 0.1))  # warnings are errors here
    assert drag(1.0).takes_rates
    assert ub.VirtualWork("flow", lambda q0, q1, w, dt: (q0 - q1)[1] / dt * w[1]).takes_rates
    assert not ub.VirtualWork("push", lambda q, w, t: t * w[1]).takes_rates
    assert not ub.Potential("soil", lambda q: q[1] ** 2).takes_rates


def moving(v, **more):
    """A cantilever whose end is moved."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    return clamped(beam, ub.PrescribedDisplacement(beam.end, v=v), **more)


DRAG, DAMPING = {"works": [drag(0.5)]}, {"damping": [ub.KelvinVoigt(0.5)]}


@SLOW_MOTION
@pytest.mark.parametrize(
    ("scheme", "scene", "entry"),
    [
        (ub.GeneralizedAlpha(0.6), pushed(**DRAG), "wind"),
        (ub.Newmark(0.6, 0.3025), pushed(**DRAG), "wind"),
        (ub.EnergyMomentumStatic(), pushed(**DRAG), "wind"),
        (ub.Newmark(0.6, 0.3025), moving(lambda t: -0.05 * math.sin(t) ** 2, **DAMPING), "damping"),
        (ub.Static(), moving(lambda t: -0.05 * math.sin(t) ** 2, **DAMPING), "damping"),
    ],
)
def test_works_and_losses_in_two_runs_are_those_of_one(scheme, scene, entry):
    """[round-off] Newton's tolerance leaves 1e-10 of the energy that went through.

    Forces of damping are a part of the reaction of a support.
    """
    whole, one = (run(scene, scheme, t=(0, end), dt=0.05) for end in (1, 0.5))
    two = run(scene, scheme, t=(0.5, 1), dt=0.05, start=one)
    throughput = whole.energy.energy_transferred
    assert abs(whole.energy[entry][-1]) > 0.01 * throughput
    for name in (*whole.energy.supplied, *whole.energy.lost):
        sum_of_parts = one.energy[name][-1] + two.energy[name][-1]
        assert sum_of_parts == pytest.approx(whole.energy[name][-1], abs=1e-10 * throughput)
    if not scheme.dynamic:  # else reactions of a first state are not known
        first, last = (x.reaction(scene.supports[0]) for x in (two, one))
        np.testing.assert_allclose(first[0], last[-1], rtol=1e-12)


def test_the_last_step_of_decaying_midpoint_goes_on():
    """Its second differences begin with the step before; [round-off] as above."""
    scene, scheme = pushed(), ub.EnergyMomentumDecaying()
    whole, one = (run(scene, scheme, t=(0, end), dt=0.05) for end in (1, 0.5))
    two = run(scene, scheme, t=(0.5, 1), dt=0.05, start=one)
    fresh = run(replace(scene), scheme, t=(0.5, 1), dt=0.05, start=one)
    size = np.abs(whole.q).max()
    assert np.abs(two.q[-1] - whole.q[-1]).max() < 1e-8 * size
    assert np.abs(fresh.q[-1] - whole.q[-1]).max() > 1e-5 * size  # forces may have jumped
    lost = one.energy["numerical"][-1] + two.energy["numerical"][-1]
    tolerance = 1e-8 * whole.energy.energy_transferred
    assert lost == pytest.approx(whole.energy["numerical"][-1], abs=tolerance)


def test_the_work_of_drag_in_the_first_step_of_a_moving_scene():
    """A stiff bar at 2 m/s in drag of 0.1 N s/m²: 0.4 W, less c/m dt/2 = 5e-4 of it."""
    bar = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    flying = ub.Velocity((bar,), linear=(0.0, 2.0))
    scene = ub.Scene([bar], initial=[flying], works=[drag(0.1)])
    wind = run(scene, ub.Newmark(), t=(0, 0.02), dt=0.01).energy["wind"]
    assert np.diff(wind) == pytest.approx(-0.1 * 2.0**2 * 0.01, rel=5e-3)


def test_a_pin_with_friction_sticks_in_two_runs_where_it_sticks_in_one():
    """The force of the guess, which differs after `start=`, does not choose between branches.

    Found by a random combination: the pin sticks at t = 0.0808 s in a run from the beginning.
    """
    section = ub.Section(EA=1e4, GA=4e3, EI=100.0, rhoA=1.0, rhoI=0.01)
    creeps = replace(section, bending=Dashpot(6.368))
    left = ub.Beam((0.0, 0.0), (0.1, 1.0), creeps, cells=4)
    roof = ub.Beam((0.1, 1.0), (1.0, 1.1), section, cells=2)
    right = ub.Beam((1.0, 1.1), (1.1, 0.0), section, cells=3)
    pin = ub.Revolute(left.end, roof.start, multipliers=True)
    has_friction = ub.Turn(left.end, roof.start, ub.Coulomb(0.1168, coefficient=0.02, joint=pin))
    stiffens = ub.ForceLaw(lambda motion, rate: 123 * motion + 2329 * motion**3)
    loads = [
        ub.PointLoad(roof.end, (-6.136, 5.109), amplitude=ub.Table([0, 0.05, 0.15], [0, 0.703, 1])),
        ub.FollowerLoad(roof.end, (3.027, -7.783), moment=-1.204),
        ub.PointLoad(roof.at(0.5), moment=-3.415, amplitude=ub.ramp(0.06103)),
    ]
    scene = ub.Scene(
        [left, roof, right], joints=[pin, ub.Rigid(roof.end, right.start)],
        supports=[ub.Clamped(left.start), ub.Pinned(right.end)], loads=loads,
        connectors=[ub.Turn(ub.ground(0, 0), roof.at(0.5), stiffens), has_friction],
    )  # fmt: skip
    steps, middle = {"dt": 0.15 / 13, "newton": ub.Newton(rtol=1e-12)}, 0.15 * 6 / 13
    whole, first = (run(scene, t=(0.0, end), **steps) for end in (0.15, middle))
    second = run(scene, t=(middle, 0.15), start=first, **steps)
    force = whole.connector(has_friction).force
    assert np.ptp(force[6:]) > 0.1  # N m; it sticks and slides
    np.testing.assert_allclose(second.connector(has_friction).force, force[6:], atol=1e-8)
