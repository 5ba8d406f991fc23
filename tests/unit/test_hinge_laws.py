# SPDX-License-Identifier: MIT
"""Hinges with capping, residual strength and deterioration: published rules, closed forms, runs."""

import itertools
import math
from dataclasses import fields

import numpy as np
import pytest
from helpers import assert_balanced, raises
from hinge_machine import Machine

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.model.material_law import State, initial_state

K, EXACT = 1e4, ub.EnergyMomentum()
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
        z = after(law, z, x)
        ((moment,),) = law.elastic_forces([np.array([x])], z)
        found.append((moment, z.spent[0] + z.dissipated[0]))
    return np.array(found).T


def after(law, z, x):
    """State of a law after a step to a motion."""
    changes = law.increments(np.array([x]), 0.0, z, 1.0)
    return State({name: getattr(z, name) + change for name, change in changes.items()})


def machine(law):
    backbones = law.backbone, law.negative or law.backbone
    more = ()
    if isinstance(law, st.PinchingHinge):
        more = (law.kappa_F, law.kappa_D), law.reloading
    capacities = law.strength, law.softening, law.unloading
    return Machine(law.stiffness, backbones, *capacities, law.exponent, *more)


# -- the law ---------------------------------------------------------------------------------------


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
    one = machine(law)
    moments, dissipated = np.transpose([(one.to(x), one.dissipated) for x in history])
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


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: st.Backbone(1.0, -0.01), ("Backbone: capping = -0.01", "turn back at the yield")),
        (lambda: st.Backbone(1.0, 0.01, overstrength=0.9), ("overstrength = 0.9", "at least")),
        (lambda: st.Backbone(1.0, 0.01, residual=1.2), ("residual = 1.2", "rise again")),
        (lambda: st.Backbone(1.0, 0.01, ultimate=0.005), ("ultimate rotation 0.005 rad", "0.01")),
        (
            lambda: st.IbarraKrawinkler(100.0, st.Backbone(1.0, 0.01, ultimate=0.015)),
            ("ultimate rotation 0.015 rad", "capping rotation 0.02 rad"),
        ),
        (
            lambda: st.IbarraKrawinkler(100.0, st.Backbone(1.0, 0.01, overstrength=2.0)),
            ("yield rotation 0.01 rad", "slope is 100", "half the elastic stiffness"),
        ),
    ],
)
def test_a_backbone_that_turns_back_is_refused(make, parts):
    with raises(*parts, kind=ub.ModelError):
        make()


# -- runs ------------------------------------------------------------------------------------------

BODY = ub.Body((0, 0), mass=1.0, inertia=1.0)
both_laws = pytest.mark.parametrize("law", [LAW, PINCHED], ids=lambda law: type(law).__name__)


def turned(law, angle=None, *, moment=None):
    """A body on a pin with a hinge of a law, turned by functions of time: an angle, or a moment."""
    at = ub.ground(0, 0), BODY.middle
    hinge = ub.Turn(*at, law)
    supports = [ub.PrescribedDisplacement(BODY.middle, psi=angle)] if angle else []
    loads = [ub.PointLoad(BODY.middle, moment=1.0, amplitude=moment)] if moment else []
    return hinge, ub.Scene(
        bodies=[BODY], joints=[ub.Revolute(*at)], connectors=[hinge], supports=supports, loads=loads
    )


@both_laws
def test_a_run_follows_the_rules(law):
    """Moments and dissipation are exact; the trapezoidal works of the support converge."""
    hinge, scene = turned(law, lambda t: 0.012 * t * math.sin(2 * math.pi * t))
    open_by = []
    for n in (400, 1600):
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
    move = ub.PrescribedDisplacement(beam.end, v=ub.Table([0, 1, 2], [0, 0.4, 0]))
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), move], connectors=[turn])
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=0.25)
    left = 10.0 * math.exp(-30.0) if law is BROKEN else 0.0
    assert abs(run.connector(turn).force[-1]) <= left + 8 * 2e6 * np.spacing(0.4)
    assert run.displacement(beam.end)[-1, 1] == 0.0


def test_a_mass_swings_and_comes_to_rest(as_by_reference):
    """Dynamics: closed ledger, no gain, and the reference solver finds the same."""
    hinge, scene = turned(PINCHED, moment=lambda t: 80 * math.sin(60 * t) * (t < 0.6))
    newton = ub.Newton(rtol=1e-12)
    as_by_reference(ub.simulate(scene, EXACT, t=(0, 0.12), dt=4e-3, newton=newton))
    run = ub.simulate(scene, EXACT, t=(0, 1), dt=2e-3)
    history = run.connector(hinge)
    assert_balanced(run.energy)
    assert history.dissipated[-1] > 5
    assert np.ptp(history.motion[-100:]) < 0.02  # twice the yield rotation


ARC = ub.ArcLength(0.02, factor=3000.0)


@pytest.mark.parametrize(
    ("EI", "control"), [(1e3, ARC), (2e2, ub.DissipationControl(0.6, otherwise=ARC))]
)
def test_a_path_passes_the_cap(EI, control):
    """[closed] The hinge of a cantilever follows its backbone, and the load has its limit there.

    The stiffness of the softer beam, 3 EI/L = 600 N m/rad, is below the fall after capping of
    1100 N m/rad, so that the deflection snaps back.
    """
    law = st.IbarraKrawinkler(K, st.Backbone(100.0, 0.03, 0.1, 1.1, 0.3))
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e7, GA=1e7, EI=EI, rhoA=1.0), cells=4)
    hinge = ub.Turn(ub.ground(0, 0), beam.start, law)
    load = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[hinge], loads=[load])
    path = ub.follow(scene, control, steps=22)
    history = path.connector(hinge)
    corners = [0, 0.01, 0.04, 0.04 + 80 * 0.1 / 110, 1.0], [0, 100, 110, 30, 30]
    assert history.motion[-1] > 0.12
    assert history.force == pytest.approx(np.interp(history.motion, *corners), abs=1e-6)
    limit = path.critical[0]
    assert limit.kind == "limit"
    assert history.motion[limit.n] == pytest.approx(0.04, abs=1e-6)
    assert (np.diff(path.displacement(beam.end)[:, 1]).min() < 0) == (EI < 3e2)


def test_modes_use_the_unloading_stiffness():
    """[closed] Frequency sqrt(k/J) of a body on a hinge whose stiffness k one excursion reduced."""
    law = st.IbarraKrawinkler(K, st.Backbone(100.0, 0.5, overstrength=1.5), unloading=6.0)
    hinge, scene = turned(law, moment=ub.Table([0, 1, 2], [0, 140, 0]))
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=0.1)
    one = machine(law)
    for x in run.connector(hinge).motion:
        one.to(x)
    assert one.K < 0.95 * K
    assert ub.modes(scene, 1, at=run).omega[0] == pytest.approx(math.sqrt(one.K), rel=1e-9)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.GeneralizedAlpha(0.8)], ids=str)
@pytest.mark.parametrize("law", [st.IbarraKrawinkler, st.PinchingHinge])
def test_the_dissipation_does_not_depend_on_the_steps(law, scheme):
    """[closed] The area of the parallelogram of a steady cycle, to 1e-6 (the rule stops at 1e-7).

    The paths of `PinchingHinge` without pinching go to the peaks: there steps of a 40th compare.
    """
    K, My, size, found = 3e7, 3e5, 0.03, []
    stiff = law(K, st.Backbone(My, capping=0.025, post_capping=0.17, overstrength=1.1))
    slope = 0.1 * My / 0.025
    area = 4 * (My - slope * My / K) * (size - My / K)
    turn, scene = turned(stiff, ub.Table([0, 1, 2, 3], [0, size, -size, size]))
    for n in (1, 2, 7, 40):
        run = ub.simulate(scene, scheme, t=(0, 3), dt=1 / n)
        lost = run.connector(turn).dissipated
        assert run.energy.lost[stiff.entry] == pytest.approx(lost)
        assert np.diff(lost).min() >= -1e-9 * lost[-1]
        found.append(lost[-1] - lost[n])
        if n == 2:  # works of supports are trapezoidal: steps with open ledgers are divided
            assert run.energy.worst < 0.05 or isinstance(scheme, ub.GeneralizedAlpha)
    expected = area if law is st.IbarraKrawinkler else found[-1]
    assert found == pytest.approx([expected] * 4, rel=1e-6)
