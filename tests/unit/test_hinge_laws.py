# SPDX-License-Identifier: MIT
"""Hinges with capping, residual strength and deterioration: published rules, closed forms, runs."""

import itertools
import math
import os
from dataclasses import fields
from functools import partial

import numpy as np
import pytest
from compiled_law import compiled_law
from helpers import needs_mpirun, on_two_processes, raises, require_restart
from hinge_machine import Machine

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.model.material_law import State, initial_state

K = 1e4
STEEL = st.Backbone(
    100.0, capping=0.03, post_capping=0.1, overstrength=1.1, residual=0.3, ultimate=0.25
)
SLAB = st.Backbone(
    80.0, capping=0.02, post_capping=0.15, overstrength=1.2, residual=0.2, ultimate=0.3
)
LAW = st.IbarraKrawinkler(K, STEEL, SLAB, strength=1.0, softening=1.5, unloading=0.8)
PINCHED = st.PinchingHinge(K, STEEL, SLAB, 1.0, 1.5, 0.8, 1.0, 0.4, 0.3, reloading=1.2)


def follow(law, motions):
    """Moments and dissipated energies of a law called with numbers."""
    z, found = initial_state(law), []
    for x in motions:
        e = np.array([x])
        changes = law.increments(e, 0.0, z, 1.0)
        z = State({name: getattr(z, name) + change for name, change in changes.items()})
        ((moment,),) = law.elastic_forces([e], z)
        found.append((moment, z.spent[0] + z.dissipated[0]))
    return np.array(found).T


def machine(law):
    backbones = law.backbone, law.negative or law.backbone
    more = ()
    if isinstance(law, st.PinchingHinge):
        more = (law.kappa_F, law.kappa_D), law.reloading
    capacities = law.strength, law.softening, law.unloading
    return Machine(law.stiffness, backbones, *capacities, law.exponent, *more)


def test_the_monotone_backbone_is_a_polygon():
    """[closed] Corners at yielding, capping, residual, ultimate and zero strength."""
    residual = 0.04 + (110 - 30) * 0.1 / 110
    zero = 0.25 + 30 / (2 * 1100)  # twice as steep as after capping
    corners = [0, 0.01, 0.04, residual, 0.25, zero, 1.0], [0, 100, 110, 30, 30, 0, 0]
    law = st.IbarraKrawinkler(K, STEEL)
    for n in (5, 60):  # a step may pass several corners
        x = np.linspace(0, 0.3, n)
        for way in (1, -1):
            moments, dissipated = follow(law, way * x)
            assert moments == pytest.approx(way * np.interp(x, *corners), abs=1e-11)
        nodes = np.array(corners).T[:-1]  # area of the polygon
        area = sum((b[0] - a[0]) * (a[1] + b[1]) / 2 for a, b in itertools.pairwise(nodes))
        assert dissipated[-1] == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("pinches", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_deterioration_follows_the_published_rules(seed, pinches):
    """Against a machine of numbers: moments and energies of random histories, to round-off.

    Steps are from a fifth of the yield rotation to ten yield rotations.
    """
    random = np.random.default_rng(seed)
    capacities = random.choice([0.3, 1.0, 3.0, math.inf], 3)
    law = st.IbarraKrawinkler(
        K, STEEL if seed % 4 else st.Backbone(100.0, 0.03), (SLAB, None)[seed % 2], *capacities,
        exponent=random.choice([1.0, 1.5, 2.0]),
    )  # fmt: skip
    if pinches:
        law = st.PinchingHinge(
            **{field.name: getattr(law, field.name) for field in fields(law)},
            kappa_F=random.choice([0.2, 0.6, 1.0]), kappa_D=random.choice([0.0, 0.3, 1.0]),
            reloading=random.choice([0.5, 3.0, math.inf]),
        )  # fmt: skip
    steps = random.normal(size=80) * random.choice([0.002, 0.01, 0.03, 0.1], 80)
    history = np.cumsum(steps) * random.choice([0.3, 1.0])
    one, expected = machine(law), []
    for x in history:
        one.to(x)
        expected.append((one.M, one.dissipated))
    moments, dissipated = np.array(expected).T
    found, lost = follow(law, history)
    assert found == pytest.approx(moments, abs=1e-9)
    assert lost == pytest.approx(dissipated, abs=1e-9)
    assert lost[-1] > 1.0


def test_one_excursion_by_hand():
    """[closed] 90 J at the reversal of a hinge with E_t = 300 J for strength, 600 J for unloading.

    The unloading stiffness falls by 90/510.  The elastic energy that unloading returns is then
    larger, and so the excursion dissipates slightly less than 90 J.
    """
    backbone = st.Backbone(100.0, capping=2.0)
    law = st.IbarraKrawinkler(K, backbone, strength=3.0, unloading=6.0)
    soft = K * (1 - 90 / 510)
    energy = 90 + 100**2 / (2 * K) - 100**2 / (2 * soft)
    moments, dissipated = follow(law, [0.91, 0.91 - 50 / soft, 0.6])
    assert moments == pytest.approx([100, 50, -100 * (1 - energy / (300 - energy))], rel=1e-12)
    assert dissipated[:2] == pytest.approx([energy, energy], rel=1e-12)


def test_two_pinched_excursions_by_hand():
    """[closed] κF = 0.4 and κD = 0.25 of a perfectly plastic hinge, from 0.05 to -0.03 to 0.05 rad.

    The first path goes from 0.04 rad, the plastic rotation, by (0, -0.4 · 100 · 4/5) to the yield
    rotation; the second one from -0.02 rad by 0.75 · 0.04 rad and 0.4 · 100 · 5/7 to the peak.
    The energies are areas of triangles and trapezoids.
    """
    law = st.PinchingHinge(K, st.Backbone(100.0, 2.0), kappa_F=0.4, kappa_D=0.25)
    ways = [0.05, 0.02, 0.0, -0.005, -0.01, -0.03, 0.005, 0.03, 0.04, 0.05, 0.06]
    moments, dissipated = follow(law, ways)
    middle = 40 * 5 / 7
    expected = [100, -16, -32, -66, -100, -100, middle / 2, middle, middle / 2 + 50, 100, 100]
    assert moments == pytest.approx(expected, rel=1e-12)
    assert dissipated[[0, 5, 9]] == pytest.approx([4.0, 4.0 + 2.8, 6.8 + 1.5], rel=1e-12)
    straight = st.PinchingHinge(K, st.Backbone(100.0, 2.0))  # aims at peaks without pinching
    moments, _ = follow(straight, ways)
    assert moments[[1, 2, 6, 7]] == pytest.approx([-40, -80, 250 / 7, 500 / 7], rel=1e-12)


def turned(law, angle, **more):
    """A body on a pin with a hinge of a law, turned to angles as a function of time."""
    body = ub.Body((0, 0), mass=1.0, inertia=1.0)
    at = ub.ground(0, 0), body.middle
    hinge = ub.Turn(*at, law)
    held = [ub.PrescribedDisplacement(body.middle, psi=angle)] if angle else []
    scene = ub.Scene(
        bodies=[body], joints=[ub.Revolute(*at)], connectors=[hinge], supports=held, **more
    )
    return hinge, scene


SCHEMES = [ub.Static(), ub.EnergyMomentum()]


@pytest.mark.parametrize("law", [LAW, PINCHED], ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_tangents_are_derivatives(scheme, law):
    """Against central differences after random histories; ends of steps near kinks are left out."""
    answers = compiled_law(law, scheme)
    random, z, e0, tried = np.random.default_rng(3), initial_state(law), 0.0, 0
    known = {f"number {n}": x for n, x in law.parameters().items()}
    known |= {"dt": 0.01, "theta": scheme.theta}
    for step in random.normal(size=120) * random.choice([0.002, 0.01, 0.05], 120):
        state = {f"state {n}": float(np.sum(x)) for n, x in vars(z).items()}

        def ask(e1, given=known | state | {"before 0": e0}):
            return answers(given | {"motion 0": e1})

        e1, ε = e0 + step, 1e-8
        (low, _), (_, slope), (high, _) = (ask(e) for e in (e1 - ε, e1, e1 + ε))
        slopes = [ask(e)[1] for e in (e1 - ε, e1 + ε)]
        if slopes == pytest.approx([slope] * 2, rel=1e-6, abs=1e-6 * K):
            tried += 1
            # 1e-16/ε of moments of 100, over K
            assert slope == pytest.approx((high - low) / (2 * ε), abs=1e-5 * K)
        z = State({n: getattr(z, n) + x for n, x in law.increments(
            np.array([e1]), 0.0, z, 1.0).items()})  # fmt: skip
        e0 = e1
    assert tried > 100


@pytest.mark.parametrize("law", [LAW, PINCHED], ids=lambda law: type(law).__name__)
def test_a_run_follows_the_rules(law):
    """Moments and dissipation are exact; the trapezoidal works of the support converge."""
    open_by = []
    for n in (400, 1600):
        hinge, scene = turned(law, lambda t: 0.012 * t * math.sin(2 * math.pi * t))
        run = ub.simulate(scene, ub.Static(), t=(0, 10), dt=10 / n)
        history, one = run.connector(hinge), machine(law)
        moments = [one.to(x) for x in history.motion]
        assert history.force == pytest.approx(moments, abs=1e-9)
        # The rule for the work stops at 1e-7.
        assert history.dissipated[-1] == pytest.approx(one.dissipated, rel=1e-6)
        open_by.append(run.energy.worst)
    assert open_by[1] < open_by[0] / 8  # second order, up to kinks within steps


BROKEN = ub.Spring(K, softening=ub.Softening(10.0, 0.1))
"""10²/1e4/2 = 0.005 J are stored at the limit, less than the fracture energy of 0.1 J."""


@pytest.mark.parametrize("law", [LAW, PINCHED, BROKEN])
def test_a_hinge_that_has_failed_returns_to_its_initial_rotation(law):
    """The prescribed motion is zero again and no moment is left, so all forces are round-off.

    Their size is the largest stiffness, EA of a cell of 0.5 m, times the round-off of motions.
    The moment of the spring falls as exp(-100 slip), limit over energy; the slip is above 0.3.
    """
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e6, GA=1e6, EI=1e5), cells=2)
    turn = ub.Turn(ub.ground(0, 0), beam.start, law)
    drive = ub.Table([0, 1, 2], [0, 0.4, 0])
    move = ub.PrescribedDisplacement(beam.end, v=drive)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), move], connectors=[turn])
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=0.25)
    left = 10.0 * math.exp(-30.0) if law is BROKEN else 0.0
    assert abs(run.connector(turn).force[-1]) <= left + 8 * 2e6 * np.spacing(0.4)
    assert run.displacement(beam.end)[-1, 1] == 0.0


def shaken(law):
    """A body on a hinge under a moment that yields it in both directions."""
    hinge, scene = turned(law, None)
    load = ub.PointLoad(
        scene.bodies[0].middle, moment=80.0, amplitude=lambda t: math.sin(60 * t) * (t < 0.6)
    )
    parts = {"bodies": scene.bodies, "joints": scene.joints, "connectors": scene.connectors}
    return hinge, ub.Scene(**parts, loads=[load])


def test_a_mass_swings_and_comes_to_rest(as_by_reference):
    """Dynamics: closed ledger, no gain, and the reference solver finds the same."""
    hinge, scene = shaken(PINCHED)
    newton = ub.Newton(rtol=1e-12)
    short = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.12), dt=4e-3, newton=newton)
    as_by_reference(short)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=2e-3)
    assert run.energy.worst < 1e-9
    history = run.connector(hinge)
    assert history.dissipated[-1] > 5
    assert np.diff(history.dissipated).min() > -1e-9 * history.dissipated[-1]
    assert np.ptp(history.motion[-100:]) < 0.02  # twice the yield rotation


def test_restart(tmp_path):
    hinge, scene = shaken(LAW)
    simulate = partial(ub.simulate, dt=2e-3)
    require_restart(simulate, scene, [hinge], ub.EnergyMomentum(), tmp_path, until=0.4)


def cantilever(law, EI=1e3):
    """A cantilever on a hinge, with a force across its end."""
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e7, GA=1e7, EI=EI, rhoA=1.0), cells=4)
    hinge = ub.Turn(ub.ground(0, 0), beam.start, law)
    load = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=lambda t: t)
    return beam.end, hinge, ub.Scene(
        [beam], supports=[ub.Pinned(beam.start)], connectors=[hinge], loads=[load]
    )  # fmt: skip


ARC = ub.ArcLength(0.02, factor=3000.0)


@pytest.mark.parametrize(
    ("EI", "control"), [(1e3, ARC), (2e2, ub.DissipationControl(0.6, otherwise=ARC))]
)
def test_a_path_passes_the_cap(EI, control):
    """[closed] The hinge follows its backbone; the load has its limit where the hinge caps.

    The stiffness of the softer beam, 3 EI/L = 600 N m/rad, is below the fall after capping of
    1100 N m/rad, so that the deflection snaps back.
    """
    law = st.IbarraKrawinkler(K, st.Backbone(100.0, 0.03, 0.1, 1.1, 0.3))
    end, hinge, scene = cantilever(law, EI)
    path = ub.follow(scene, control, steps=22)
    history = path.connector(hinge)
    corners = [0, 0.01, 0.04, 0.04 + 80 * 0.1 / 110, 1.0], [0, 100, 110, 30, 30]
    assert history.motion[-1] > 0.12
    assert history.force == pytest.approx(np.interp(history.motion, *corners), abs=1e-6)
    limit = path.critical[0]
    assert limit.kind == "limit"
    assert history.motion[limit.n] == pytest.approx(0.04, abs=1e-6)
    assert (np.diff(path.displacement(end)[:, 1]).min() < 0) == (EI < 3e2)


def test_displacement_control_passes_the_cap():
    """[closed] The same hinge in statics with a prescribed deflection, against its backbone."""
    law = st.IbarraKrawinkler(K, st.Backbone(100.0, 0.03, 0.1, 1.1, 0.3))
    end, hinge, scene = cantilever(law)
    pull = ub.PrescribedDisplacement(end, v=lambda t: 0.25 * t)
    scene = ub.Scene(scene.beams, supports=[*scene.supports, pull], connectors=[hinge])
    history = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.02).connector(hinge)
    corners = [0, 0.01, 0.04, 0.04 + 80 * 0.1 / 110, 1.0], [0, 100, 110, 30, 30]
    assert np.abs(history.motion).max() > 0.2
    assert history.force == pytest.approx(
        np.sign(history.motion) * np.interp(np.abs(history.motion), *corners), abs=1e-6
    )


def test_modes_use_the_unloading_stiffness():
    """[closed] Frequency sqrt(k/J) of a body on a hinge whose stiffness k one excursion reduced."""
    law = st.IbarraKrawinkler(K, st.Backbone(100.0, 0.5, overstrength=1.5), unloading=6.0)
    hinge, scene = turned(law, None)
    load = ub.PointLoad(
        scene.bodies[0].middle, moment=1.0, amplitude=ub.Table([0, 1, 2], [0, 140, 0])
    )
    parts = {"bodies": scene.bodies, "joints": scene.joints, "connectors": [hinge]}
    scene = ub.Scene(**parts, loads=[load])
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=0.1)
    one = machine(law)
    for x in run.connector(hinge).motion:
        one.to(x)
    assert one.K < 0.95 * K
    assert ub.modes(scene, 1, at=run).omega[0] == pytest.approx(math.sqrt(one.K), rel=1e-9)


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: st.Backbone(1.0, -0.01), ("Backbone: capping = -0.01", "turn back at the yield")),
        (lambda: st.Backbone(1.0, 0.01, overstrength=0.9), ("overstrength = 0.9", "at least")),
        (lambda: st.Backbone(1.0, 0.01, residual=1.2), ("residual = 1.2", "rise again")),
        (lambda: st.Backbone(1.0, 0.01, ultimate=0.005), ("ultimate rotation 0.005 rad", "0.01")),
        (lambda: st.Backbone(1.0, 0.01, post_capping=0.0), ("post_capping = 0", "positive")),
        (
            lambda: st.IbarraKrawinkler(100.0, st.Backbone(1.0, 0.01, ultimate=0.015)),
            ("ultimate rotation 0.015 rad", "capping rotation 0.02 rad"),
        ),
        (
            lambda: st.IbarraKrawinkler(100.0, st.Backbone(1.0, 0.01, overstrength=2.0)),
            ("yield rotation 0.01 rad", "slope is 100", "half the elastic stiffness"),
        ),
        (lambda: st.IbarraKrawinkler(1.0, 2.0), ("IbarraKrawinkler: backbone", "Backbone")),
        (lambda: st.IbarraKrawinkler(K, STEEL, strength=0.0), ("strength = 0", "positive")),
        (lambda: st.PinchingHinge(K, STEEL, kappa_F=0.0), ("PinchingHinge: kappa_F", "positive")),
        (lambda: st.PinchingHinge(K, STEEL, kappa_D=1.2), ("PinchingHinge: kappa_D", "at most 1")),
        (lambda: st.IbarraKrawinkler(K, STEEL, exponent=0.5), ("exponent = 0.5", "at least 1")),
    ],
)
def test_a_backbone_that_turns_back_is_refused(make, parts):
    with raises(*parts, kind=ub.ModelError):
        make()


SHARED = """
import sys
sys.path[:0] = [{here!r}, {tests!r}]
from ufl_beam import parallel
parallel.SMALLEST_SUBDOMAIN = 1
import test_hinge_laws as t
hinges, scene = t.frame()
run = t.sway(scene)
t.ub.print_once(repr(t.ends(hinges, run)))
"""


def frame():
    """A portal with deteriorating hinges at the feet and at the corners."""
    section = ub.Section(EA=1e6, GA=1e6, EI=4e3, rhoA=1.0)
    left = ub.Beam((0, 0), (0, 1), section, cells=4)
    girder = ub.Beam((0, 1), (2, 1), section, cells=4)
    right = ub.Beam((2, 0), (2, 1), section, cells=4)
    pairs = [(ub.ground(0, 0), left.start), (left.end, girder.start),
             (girder.end, right.end), (ub.ground(2, 0), right.start)]  # fmt: skip
    hinges = [ub.Turn(a, b, LAW) for a, b in pairs]
    joints = [ub.Revolute(a, b) for a, b in pairs[1:3]]
    supports = [ub.Pinned(left.start), ub.Pinned(right.start)]
    push = ub.PointLoad(left.end, force=(400.0, 0), amplitude=lambda t: math.sin(6 * t))
    return hinges, ub.Scene(
        [left, girder, right], joints=joints, supports=supports, connectors=hinges, loads=[push]
    )


def sway(scene):
    return ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)


def ends(hinges, run):
    """Moments and dissipated energies of hinges at the end."""
    found = [run.connector(hinge) for hinge in hinges]
    return [(float(x.force[-1]), float(x.dissipated[-1])) for x in found]


@pytest.mark.slow
@pytest.mark.serial
@needs_mpirun
def test_two_processes_share_a_frame():
    here = os.path.dirname(os.path.abspath(__file__))
    found = on_two_processes("-c", SHARED.format(here=here, tests=os.path.dirname(here)))
    assert found.returncode == 0, found.stderr
    shared = np.array(eval(found.stdout.splitlines()[-1]))
    hinges, scene = frame()
    run = sway(scene)
    alone = ends(hinges, run)
    assert run.energy.worst < 1e-9
    assert min(lost for _, lost in alone) > 1.0
    np.testing.assert_allclose(shared, alone, rtol=0, atol=1e-7 * np.abs(alone).max())


@pytest.mark.parametrize("scheme", [ub.Static(), ub.GeneralizedAlpha(0.8)], ids=str)
@pytest.mark.parametrize("law", [st.IbarraKrawinkler, st.PinchingHinge])
def test_the_dissipation_does_not_depend_on_the_steps(law, scheme):
    """[closed] The area of the parallelogram of a steady cycle, to 1e-6 (the rule stops at 1e-7).

    The paths of `PinchingHinge` without pinching go to the peaks: there steps of a 40th compare.
    """
    K, My, size = 3e7, 3e5, 0.03
    stiff = law(K, st.Backbone(My, capping=0.025, post_capping=0.17, overstrength=1.1))
    slope = 0.1 * My / 0.025
    area = 4 * (My - slope * My / K) * (size - My / K)
    found = []
    for n in (1, 2, 7, 40):
        body = ub.Body((0, 0), mass=1.0, inertia=1.0)
        turn = ub.Turn(ub.ground(0, 0), body.middle, stiff)
        table = ub.Table([0, 1, 2, 3], [0, size, -size, size])
        move = ub.PrescribedDisplacement(body.middle, u=0.0, v=0.0, psi=table)
        scene = ub.Scene(bodies=[body], supports=[move], connectors=[turn])
        run = ub.simulate(scene, scheme, t=(0, 3), dt=1 / n)
        lost = run.connector(turn).dissipated
        assert run.energy.lost[stiff.entry] == pytest.approx(lost)
        assert np.diff(lost).min() >= -1e-9 * lost[-1]
        found.append(lost[-1] - lost[n])
        if n == 2:  # works of supports are trapezoidal: steps with open ledgers are divided
            assert run.energy.worst < 0.05 or isinstance(scheme, ub.GeneralizedAlpha)
    expected = area if law is st.IbarraKrawinkler else found[-1]
    assert found == pytest.approx([expected] * 4, rel=1e-6)
