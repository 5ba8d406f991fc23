# SPDX-License-Identifier: MIT
"""Forces that move along beams."""

import math
from itertools import pairwise

import numpy as np
import pytest
from helpers import raises, run
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)
STIFF = ub.Section(EA=1e9, GA=1e9, EI=1e9, rhoA=3.0, rhoI=0.1)
"""Deflections of 1e-9 m: reactions are those of the undeformed beam to that part."""
TIGHT = ub.Newton(rtol=1e-12)


def wave(t):
    return 1 + 0.3 * math.sin(20 * t)


def crossed(cells=5, mass=0.0):
    """A cantilever of 2 m: one load enters, crosses and leaves it; the other one turns back."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=cells)
    loads = [
        ub.MovingLoad(beam, lambda t: 10 * t - 0.5, (4, -40), wave),
        ub.MovingLoad(beam, lambda t: 1.2 + 0.5 * math.sin(9 * t), (0, 15), mass=mass),
    ]
    return clamped(beam, loads=loads), beam


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_reactions_and_diagrams_are_those_of_a_force_at_its_place(degree):
    """In every cell and at vertices; before it comes and after it has left there is none."""
    beam = ub.Beam((0, 0), (2, 0), STIFF, cells=4)
    load = ub.MovingLoad(beam, lambda t: t - 0.25, (3, -7))
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end)], loads=[load])
    moved = run(scene, ub.Static(), t=(0, 2.375), dt=0.125, mesh=ub.Mesh(degree=degree))
    d = moved.times - 0.25
    there = (d >= 0) & (d <= 2)
    left, right = (moved.reaction(support) for support in scene.supports)
    # 1e-7: deflections of this part of the length
    assert left[1:, 0] == pytest.approx(-3.0 * there[1:], abs=1e-6)
    assert left[1:, 1] == pytest.approx((7 * there * (2 - d) / 2)[1:], abs=1e-6)
    assert right[1:, 1] == pytest.approx((7 * there * d / 2)[1:], abs=1e-6)
    for n in range(1, len(moved)):
        # At both ends of each cell; within the cell of the load 0.148 F h, as the docstring says
        for points, tolerance in ((2, 1e-6), (9, 4 / 27 * 7 * 0.5 + 1e-6)):
            diagram = moved.diagram(beam, n, points=points)
            x, a = 2 * diagram.s, d[n]
            M = 7 * np.where(x <= a, x * (2 - a) / 2, a * (2 - x) / 2) * there[n]
            assert pytest.approx(M, abs=tolerance) == diagram.M
        sizes = np.hypot(diagram.N[0], diagram.V[0]), np.hypot(*left[n, :2])  # the pin turns
        assert sizes[0] == pytest.approx(sizes[1], abs=1e-11 * 7)


@pytest.mark.parametrize("scheme", [ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha(0.5)], ids=str)
def test_work_of_the_drive_of_a_mass_that_begins_on_the_beam(scheme):
    """A mass m moves outwards with the speed u along a beam that turns with ω."""
    m, ω, u = 3.0, 3.0, 1.0
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1e7, GA=1e7, EI=1e6, rhoA=0.01, rhoI=1e-4))
    turned = ub.PrescribedDisplacement(beam.start, u=0.0, v=0.0, psi=lambda t: ω * t)
    scene = ub.Scene(
        [beam], supports=[turned], loads=[ub.MovingLoad(beam, lambda t: 0.2 + u * t, mass=m)],
        initial=[ub.Velocity((beam,), angular=ω)],
    )  # fmt: skip
    energy = run(scene, scheme, t=(0, 0.5), dt=0.01).energy
    assert energy.state["kinetic"][0] == pytest.approx(m / 2 * (u**2 + (0.2 * ω) ** 2), rel=0.06)
    assert energy.supplied["loads"][-1] == pytest.approx(m * ω**2 * (0.2**2 - 0.7**2) / 2, rel=0.01)
    assert energy.supplied["supports"][-1] == pytest.approx(m * ω**2 * (0.7**2 - 0.2**2), rel=0.01)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()])
def test_a_load_crosses_several_beams_as_one(scheme):
    """At the vertex between them, at t = 0.1 s, the force acts once."""

    def crossed(*ends):
        beams = [ub.Beam(a, b, SECTION, cells=2, name=f"b{a[0]}") for a, b in pairwise(ends)]
        joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
        route = beams if len(beams) > 1 else beams[0]
        load = ub.MovingLoad(route, lambda t: 10 * t, (3, -40), mass=2.0)
        scene = ub.Scene(beams, joints=joints, supports=[ub.Clamped(beams[0].start)], loads=[load])
        mesh = ub.Mesh(refine=3 - len(beams))
        moved = run(scene, scheme, t=(0, 0.3), dt=0.05, mesh=mesh, newton=TIGHT)
        return moved.displacement(beams[-1].end), moved.reaction(scene.supports[0])[1:]

    for two, one in zip(crossed((0, 0), (1, 0), (2, 0)), crossed((0, 0), (2, 0)), strict=True):
        np.testing.assert_allclose(two, one, atol=1e-9 * np.abs(one).max())


def test_adaptive_steps_end_where_a_load_comes_and_leaves():
    """The impulse is force times duration, although the load crosses in 1 % of the run."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    scene = ub.Scene([beam], loads=[ub.MovingLoad(beam, lambda t: 100 * t - 101, (0, -40))])
    crossed = run(scene, t=(0, 2), dt=ub.Adaptive(1e-4))
    assert crossed.momentum()[-1, 1] == pytest.approx(-40 * 2 / 100, rel=1e-8)


def test_a_load_that_stands_still_is_a_point_load():
    """At a vertex; with the buckling factors of a column, too."""
    beam = ub.Beam((0, 0), (0, 2), SECTION, cells=4)
    runs, factors = [], []
    for load in (
        lambda force: ub.MovingLoad(beam, ub.Table([0], [1.5]), force),
        lambda force: ub.PointLoad(beam.at(0.75), force),
    ):
        scene, column = (clamped(beam, loads=[load(force)]) for force in ((1, -20), (0, -20)))
        runs.append(run(scene, t=(0, 0.2), dt=0.02, newton=TIGHT).q)
        factors.append(ub.buckling(column, 2).factors)
    np.testing.assert_allclose(*runs, atol=1e-10)
    np.testing.assert_allclose(*factors, rtol=1e-9)


def test_routes_with_gaps_and_masses_in_rotating_frames_are_refused():
    a, b = (ub.Beam((x, 0), (x + 1, 0), SECTION, name=name) for x, name in enumerate("ab"))
    with raises("MovingLoad: beam", "a starts 2 m from the end of b", kind=ub.ModelError):
        ub.MovingLoad([b, a], lambda t: t, (0, -1))
    frame = ub.RotatingFrame(rate=3.0)
    with raises("MovingLoad on b has a mass", "RotatingFrame", kind=ub.ModelError):
        clamped(b, loads=[frame, ub.MovingLoad(b, lambda t: 0.5, mass=3.0)])
    clamped(b, loads=[frame, ub.MovingLoad(b, lambda t: 0.5)])
