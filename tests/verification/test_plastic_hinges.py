# SPDX-License-Identifier: MIT
"""Plastic hinges of zero length: plastic theory, closed forms, and the joints that they become."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import softened
from helpers import assert_balanced
from scenes import clamped, on_rail, rigid_chain

import ufl_beam as ub
import ufl_beam.structures as st

EI, LENGTH, LIMIT = 1000.0, 2.0, 10.0  # N m², m, N m
ELASTIC = ub.Section(EA=1e8, GA=1e8, EI=EI)
MOVING = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=1e-3)
LAWS = [
    ub.Softening(LIMIT, 5.0),
    ub.LinearSoftening(LIMIT, 5.0),
    ub.ElastoPlastic(LIMIT, isotropic=30.0, kinematic=20.0),
    ub.ElastoPlastic(LIMIT, isotropic=30.0, viscosity=ub.Perzyna(2.0)),
]
EXACT = [
    ub.EnergyMomentumStatic(0.5),
    ub.EnergyMomentumStatic(),
    ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.05),
]


def growing(t):
    return t


# -- plastic theory ------------------------------------------------------------------------------


@pytest.mark.parametrize(("by", "cells"), [("section", 4), ("beam", 8)])
def test_collapse_of_a_portal(by, cells):
    """[plastic theory] 4 M_p / h = 150 kN to 0.2 %; second-order terms of the sway are 0.1 %."""
    steel = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
    height, width = 4.0, 6.0
    law = ub.Softening(limit=150e3, fracture_energy=1e9)  # perfectly plastic to six digits
    everywhere, ends = (law, {}) if by == "section" else (None, {0.0: law, 1.0: law})
    column = st.i_shape(0.2, 0.2, 0.009, 0.015, **steel, hinge=everywhere)
    girder = st.i_shape(0.5, 0.3, 0.02, 0.03, **steel)
    left = ub.Beam((0, 0), (0, height), column, cells=cells, name="left", hinges=ends)
    roof = ub.Beam((0, height), (width, height), girder, cells=8, name="roof")
    right = ub.Beam((width, height), (width, 0), column, cells=cells, name="right", hinges=ends)
    scene = rigid_chain(
        [left, roof, right],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(1e3, 0), amplitude=growing)],
    )
    assert len(scene.hinges) == 4
    path = ub.follow(
        scene,
        ub.DisplacementControl(left.end, "u", 0.01),
        until=lambda now: now.displacement(left.end)[0] > 0.12,
    )
    assert path.factor[-1] == pytest.approx(150.0, rel=2e-3)
    assert all(abs(path.connector(hinge).motion[-1]) > 0.01 for hinge in scene.hinges)


# -- the law at the place ------------------------------------------------------------------------


def turned(law, motion, scheme, *, dt, end=1.0, s=0.0, rho=0.0, cells=2):
    """Beam clamped at its start, whose end is turned as given: one moment along all of it."""
    section = ub.Section(EA=1e6, GA=1e6, EI=EI, rhoA=rho, rhoI=1e-3 * rho)
    beam = ub.Beam((0, 0), (LENGTH, 0), section, cells=cells, hinges={s: law})
    scene = clamped(beam, ub.PrescribedDisplacement(beam.end, psi=motion))
    return scene, ub.simulate(scene, scheme, t=(0, end), dt=dt)


def resistance(law, slip, rate=0.0):
    """[closed] Moment after a slip one way, at a rate."""
    if not isinstance(law, ub.ElastoPlastic):
        return softened(law, slip)
    return law.limit + (law.isotropic + law.kinematic) * slip + law.viscosity.eta * rate


@pytest.mark.parametrize(("law", "s"), list(zip(LAWS, [0.0, 0.3, 1.0, 0.3], strict=True)))
def test_moment_of_a_hinge(law, s):
    """[closed] θ = M(α) L/EI + α; before the limit the jump is zero."""
    dt, θ = 0.01, 0.3
    scene, solution = turned(law, lambda t: θ * t, ub.Static(), dt=dt, s=s)
    (hinge,) = scene.hinges
    α, M, *_ = solution.connector(hinge)
    ψ = θ * solution.times
    closed = ψ * EI / LENGTH <= LIMIT
    np.testing.assert_array_equal(α[closed], 0.0)
    assert (np.diff(α[~closed]) > 0).all()
    rate = np.diff(α, prepend=0.0) / dt
    expected = [resistance(law, *slip) for slip in zip(α[~closed], rate[~closed], strict=True)]
    np.testing.assert_allclose(M[~closed], expected, rtol=1e-9)
    np.testing.assert_allclose(M * LENGTH / EI + α, ψ, rtol=1e-9, atol=1e-12)
    at = solution.material_at(scene.beams[0].at(s))
    np.testing.assert_array_equal(at.jump, α)
    np.testing.assert_array_equal(at.forces[:, 2], M)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("scheme", "dt"), list(zip(EXACT, [0.1, 0.013, 0.1, 0.013], strict=True)))
def test_ledger_of_cycles(law, scheme, dt):
    """To and fro at any step: the ledger closes to 1e-9, nothing dissipated is given back."""
    swing = ub.Table([0, 1, 2, 3], [0.0, 0.1, -0.15, 0.2])
    rho = 0.01 if scheme.dynamic else 0.0
    scene, solution = turned(law, swing, scheme, dt=dt, end=3.0, rho=rho)
    energy = solution.energy
    assert_balanced(energy)
    history = solution.connector(scene.hinges[0])
    assert history.motion.min() < 0 < history.motion.max()
    np.testing.assert_allclose(history.dissipated, energy.lost["hinges"], rtol=1e-12)
    if not isinstance(law, ub.ElastoPlastic):
        assert history.dissipated[-1] <= law.fracture_energy * (1 + 1e-12)
        if not scheme.dynamic and scheme.theta == 0.5:
            np.testing.assert_allclose(history.work, history.dissipated, rtol=1e-9, atol=1e-12)


def test_a_hinge_opens_where_its_neighbours_have_yielded():
    """[closed] ψ = M L/EI + (M_u - M_y)/H L + a with M = M_u exp(-M_u a/G_f) at the jump a.

    The moment is a mean over a step, so the error of a is at most half of the rotation of a step.
    """
    EI, yields, hardening, limit, energy, steps = 121.7, 50.0, 3.334, 80.0, 100.0, 500
    law = ub.ElastoPlastic(yields, isotropic=hardening)
    beam = ub.Beam(
        (0, 0), (1, 0), ub.Section(EA=1.46e7, GA=4.7e6, EI=EI, bending=law), cells=1,
        corners=(0.4, 0.6), hinges={0.5: ub.Softening(limit, energy)},
    )  # fmt: skip
    scene = clamped(beam, ub.PrescribedDisplacement(beam.end, psi=lambda t: math.pi * t))
    solution = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 4), dt=4 / steps)
    jump = solution.material_at(beam.at(0.5)).jump[-1]
    moment = softened(ub.Softening(limit, energy), jump)
    expected = 4 * math.pi - moment / EI - (limit - yields) / hardening
    assert jump == pytest.approx(expected, abs=4 * math.pi / steps / 2)
    assert solution.energy.worst < 1e-10


def test_kinematic_hardening_remembers_its_direction():
    """[closed] Turned back, the moment flows at 2 limit below the one at the turn (Bauschinger)."""
    law = ub.ElastoPlastic(LIMIT, kinematic=50.0)
    there_and_back = ub.Table([0, 1, 2], [0.0, 0.2, 0.0])
    scene, solution = turned(law, there_and_back, ub.Static(), dt=1 / 200, end=2.0)
    α, M, *_ = solution.connector(scene.hinges[0])
    top = np.argmax(α)
    flows_back = top + np.flatnonzero(np.diff(α[top:]) < 0)[0] + 1
    expected = M[top] - 2 * LIMIT + 50.0 * (α[flows_back] - α[top])
    assert M[flows_back] == pytest.approx(expected, rel=1e-9)


# -- what a hinge becomes ------------------------------------------------------------------------


def falling(hinge, scheme):
    """Two metres of beam falling about a pin, with a hinge half-way, or a revolute joint."""
    if hinge is None:
        beams = [ub.Beam((x, 0), (x + 1, 0), MOVING, cells=4) for x in (0, 1)]
        joints = [ub.Revolute(beams[0].end, beams[1].start)]
    else:
        beams, joints = [ub.Beam((0, 0), (2, 0), MOVING, cells=8, hinges={0.5: hinge})], []
    pin = ub.Pinned(beams[0].start)
    scene = ub.Scene(beams, joints=joints, supports=[pin], loads=[ub.Gravity()])
    solution = ub.simulate(scene, scheme, t=(0, 0.5), dt=0.01)
    assert solution.energy.worst < 1e-9
    return solution.displacement(beams[-1].end)


@pytest.mark.parametrize(
    ("law", "scheme"),
    [
        (ub.Softening, ub.EnergyMomentum()),
        (ub.LinearSoftening, ub.EnergyMomentum(0.05, 0.05)),
        (ub.Softening, ub.EnergyMomentumDecaying()),
    ],
)
def test_without_a_limit_it_is_a_revolute_joint(law, scheme):
    """The same motion, to the tolerance of 1e-10 in 50 steps of large rotations."""
    joint = falling(None, scheme)
    np.testing.assert_allclose(falling(law(0.0, 1.0), scheme), joint, rtol=0, atol=1e-9)
    np.testing.assert_allclose(falling(law(1e-12, 1e-12), scheme), joint, rtol=0, atol=1e-9)


# -- where hinges are ----------------------------------------------------------------------------


def corner(*laws, joint=ub.Rigid):
    """Beams that meet at the origin, each with a hinge there, clamped at their other ends."""
    beams = []
    for a, law in enumerate(laws):
        hinges = {} if law is None else {0.0: law}
        end = (math.cos(a), math.sin(a))
        beams.append(ub.Beam((0, 0), end, ELASTIC, cells=2, hinges=hinges))
    supports = [ub.Clamped(beam.end) for beam in beams]
    return ub.Scene(beams, joints=[joint(*(beam.start for beam in beams))], supports=supports)


WEAK, STRONG = ub.Softening(1.0, 1.0), ub.Softening(2.0, 1.0)


@pytest.mark.parametrize(
    ("laws", "hinged"),
    [
        ((STRONG, WEAK), [1]),
        ((WEAK, STRONG), [0]),
        ((WEAK, WEAK), [0]),
        ((WEAK, None), [0]),
        ((ub.ElastoPlastic(1.0), STRONG), [0]),
        ((ub.ElastoPlastic(1.0, isotropic=1.0), STRONG), [0, 1]),  # it may exceed the other limit
        ((WEAK, WEAK, WEAK), [0, 1, 2]),
        ((ub.Softening(math.inf, 1.0), STRONG), [1]),
    ],
)
def test_hinges_where_members_meet(laws, hinged):
    """Two members have the same moment: the weaker one has the hinge; of three all have one."""
    scene = corner(*laws)
    assert [scene.beams.index(hinge.a.beam) for hinge in scene.hinges] == hinged


def test_a_moment_at_the_joint_leaves_both_hinges():
    """A load, rotary inertia or a spring at the joint makes the moments of the members differ."""
    scene = corner(WEAK, STRONG)
    place = scene.beams[0].start
    for more in (
        {"loads": [ub.PointLoad(place, moment=1.0)]},
        {"masses": [ub.PointMass(scene.beams[1].start, 1.0, inertia=1.0)]},
        {"connectors": [ub.Turn(ub.ground(0, 0), place, ub.Spring(1.0))]},
    ):
        assert len(replace(scene, **more).hinges) == 2


def test_no_hinge_where_no_moment_is():
    """Free and pinned ends, revolute joints: nothing of a hinge, though the section has one."""
    section = ub.Section(EA=1e6, GA=1e6, EI=EI, hinge=WEAK)
    free, pinned = (ub.Beam((0, y), (1, y), section, cells=2) for y in (0, 1))
    supports = [ub.Clamped(free.start), ub.Pinned(pinned.start), ub.Roller(pinned.end)]
    scene = ub.Scene([free, pinned], supports=supports)
    assert [str(hinge.a) for hinge in scene.hinges] == [str(free.start)]
    assert corner(WEAK, WEAK, joint=ub.Revolute).hinges == ()


# -- rigid-plastic connectors --------------------------------------------------------------------


def test_a_block_that_slips():
    """[closed] F(t) = 3 t on m = 2 against 1 + H x: at rest until 1/3, then m x'' = 3 t - 1 - H x.

    With ω² = H/m: x = (3/H) (τ - sin(ω τ)/ω), τ = t - 1/3; second order in the step.
    """
    m, H = 2.0, 8.0
    law = ub.RigidPlastic(ub.ElastoPlastic(1.0, isotropic=H))
    scene = on_rail(law, mass=m, force=lambda t: 3.0 * t)
    ω, errors = math.sqrt(H / m), []
    for n in (60, 120, 240):
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1.0), dt=1 / n)
        τ = np.maximum(solution.times - 1 / 3, 0.0)
        x = 3 / H * (τ - np.sin(ω * τ) / ω)
        moved = solution.displacement(scene.bodies[0].middle)[:, 0]
        errors.append(np.abs(moved - x).max())
        assert solution.energy.worst < 1e-9
    assert errors[0] < 1e-3
    assert np.log2(errors[0] / errors[1]) > 1.8
    assert np.log2(errors[1] / errors[2]) > 1.8


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (3.0, "RigidPlastic: law = 3.0"),
        (
            ub.ElastoPlastic(1.0, viscosity=ub.DuvautLions(1.0)),
            "DuvautLions relaxes an elastic stress",
        ),
    ],
)
def test_bad_laws_are_refused(law, words):
    """A hinge of zero length has no elasticity."""
    with pytest.raises(ub.ArgumentError, match=words):
        ub.RigidPlastic(law)


@pytest.mark.parametrize("given", [None, "law", "none", "never"])
def test_a_moment_at_a_free_end_acts_on_the_member(given, recwarn):
    """Nothing beyond a hinge could bear it; a hinge that was asked for there is warned of."""
    law = ub.Softening(limit=1.0, fracture_energy=1.0)
    at_end = {"law": law, "none": None, "never": ub.Softening(limit=math.inf, fracture_energy=1.0)}
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0, hinge=law)
    hinges = {} if given is None else {1.0: at_end[given]}
    beam = ub.Beam((0, 0), (1, 0), section, cells=4, name="arm", hinges=hinges)
    turn = ub.PointLoad(beam.end, moment=0.5)
    scene = clamped(beam, loads=[turn])
    assert len(scene.hinges) == 1  # that at the clamp
    ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    said = [str(one.message) for one in recwarn if one.category is ub.ModelWarning]
    assert len(said) == (given == "law")
    assert all("arm: the hinge at s = 1 has nothing beyond" in one for one in said)


@pytest.mark.parametrize("limit", [1e-300, 1e-100, 1e-12, 1e300])
def test_limits_down_to_nothing_and_up_to_everything(limit):
    """A hinge that bears nothing turns as a pin does, one that bears all as a clamp."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=0.1, rhoI=1e-4)
    ends = []
    for hinges, held in (
        ({0.0: ub.Softening(limit, 1.0)}, ub.Clamped),
        ({}, ub.Pinned if limit < 1.0 else ub.Clamped),
    ):
        beam = ub.Beam((0, 0), (1, 0), section, cells=2, hinges=hinges)
        push = ub.PointLoad(beam.end, force=(0.0, 1.0))
        scene = ub.Scene([beam], supports=[held(beam.start)], loads=[push])
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.2), dt=0.01)
        ends.append(solution.displacement(beam.end))
    # A moment of 1e-12 changes the motion by as much.
    assert np.abs(ends[0] - ends[1]).max() < 1e-10
