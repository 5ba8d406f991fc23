# SPDX-License-Identifier: MIT
"""Bifurcations of stiff, perfect structures: their kind, the primary path, and linear buckling.

With EA L²/EI of 1e6 and more, the last digits of axial forces move a state along the critical mode,
the more the nearer it is to the critical point.
"""

from itertools import pairwise

import numpy as np
import pytest
from helpers import raises
from scenes import clamped, rigid_chain

import ufl_beam as ub
import ufl_beam.structures as st

CONTROLS = [ub.LoadControl(0.3), ub.ArcLength(0.05, factor=4)]


def growing(t):
    return t


def first_point(now):
    return bool(now.solution.critical)


def frame(section, cells=16):
    """Two members with a load at their apex; their axial force at the factor 1 is 8/√2."""
    left = ub.Beam((0, 0), (1, 1), section, cells=cells)
    right = ub.Beam((1, 1), (2, 0), section, cells=cells)
    load = ub.PointLoad(left.end, force=(0, -8), amplitude=growing)
    supports = [ub.Clamped(left.start), ub.Clamped(right.end)]
    return rigid_chain([left, right], supports=supports, loads=[load])


def column(section, cells=16):
    """A column at 53 degrees, so that round-off of its axial force moves it sideways."""
    beam = ub.Beam((0, 0), (0.6, 0.8), section, cells=cells)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(-0.6, -0.8), amplitude=growing)])


def portal(section, cells=16, foot=ub.Pinned):
    """A portal that sways."""
    ends = pairwise([(0, 0), (0, 1), (1, 1), (1, 0)])
    left, girder, right = (ub.Beam(a, b, section, cells=cells) for a, b in ends)
    loads = [ub.PointLoad(p, force=(0, -1), amplitude=growing) for p in (left.end, right.start)]
    supports = [foot(left.start), ub.Pinned(right.end)]
    return rigid_chain([left, girder, right], supports=supports, loads=loads)


@pytest.mark.parametrize("control", CONTROLS, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize("EA", [1e4, 1e8])
@pytest.mark.parametrize(("make", "N"), [(frame, 8 / 2**0.5), (column, 1.0), (portal, 1.0)])
def test_buckling_against_follow(make, N, EA, control):
    """The factor of linear buckling; only in the frame strains of N/EA bend beams before.

    A step is 1.5 of the factor at most, and the point is located to 1e-7 of it.
    """
    scene = make(ub.Section(EA=EA, GA=EA, EI=1.0))
    factor = ub.buckling(scene, 1).factors[0]
    path = ub.follow(scene, control, until=lambda now: now.t > 1.2 * factor)
    (point,) = path.critical
    assert point.kind == "bifurcation"
    assert point.factor == pytest.approx(factor, rel=(make is frame) * factor * N / EA + 2e-7)
    assert (np.diff(path.factor) > 0).all()
    # Without the mode the rotation is that of the strains, at most the axial ones.
    turned = path.displacement(scene.beams[0].end)[:, 2]
    assert np.abs(turned).max() <= 2 * path.factor[-1] * N / EA


def quarter_ring(section, cells, loads):
    """A quarter of a ring of radius 1 with symmetric ends."""
    arc = ub.Beam.arc((0, 0), 1.0, (0, np.pi / 2), section, cells=cells)
    supports = [
        ub.PrescribedDisplacement(arc.start, v=0, psi=0),
        ub.PrescribedDisplacement(arc.end, u=0, psi=0),
    ]
    return ub.Scene([arc], supports=supports, loads=loads(arc))


def radial(arc):
    """Forces at the nodes, whose directions are constant."""
    loads = []
    for k in range(13):
        angle, share = np.pi / 2 * k / 12, np.pi / 24 * (0.5 if k in (0, 12) else 1.0)
        force = (-share * np.cos(angle), -share * np.sin(angle))
        loads.append(ub.PointLoad(arc.at(k / 12), force=force, amplitude=growing))
    return loads


def a_column_on_a_hinge(section):
    """The stiffness of the foot is 20 EI/L; hinges of this kind are as stiff in shear as GA."""
    beam = ub.Beam((0, 0), (0, 1), section, cells=8)
    law = st.AxialBendingHinge(1e9, 1e9, along=section.EA, across=section.GA, turning=20.0)
    foot = ub.Bushing(ub.ground(0, 0), beam.start, law, axis=(0, 1))
    load = ub.PointLoad(beam.end, force=(0, -1), amplitude=growing)
    return ub.Scene([beam], connectors=[foot], loads=[load])


STRAIGHT = {
    "column": lambda section: column(section, cells=8),
    "portal": lambda section: portal(section, cells=4, foot=ub.Clamped),
    "ring": lambda section: quarter_ring(section, 12, radial),
    "column on a hinge": a_column_on_a_hinge,
}
"""Scenes whose nodes move on straight lines up to the bifurcation."""


@pytest.mark.parametrize(
    "ratio", [0.1, 25.0, 1e4, *(pytest.param(x, marks=pytest.mark.slow) for x in (1.0, 1e3))]
)
@pytest.mark.parametrize("make", STRAIGHT.values(), ids=STRAIGHT)
def test_buckling_with_any_shear_stiffness(make, ratio):
    """The factor of linear buckling, GA = 0.1 to 1e4 EA, with strains of 1e-3 to 2e-2.

    Tolerance: the point is located to 1e-7, second derivatives have a round-off of 1e-13 times the
    stiffness, up to 1e-7.  Cells of the ring do not stay exactly straight: 1e-6.
    """
    scene = make(ub.Section(EA=2e3, GA=ratio * 2e3, EI=1.0))
    factors = ub.buckling(scene, 2).factors  # no warning is issued
    path = ub.follow(scene, ub.LoadControl(factors[0] / 3.7), until=first_point)
    assert path.critical[0].kind == "bifurcation"
    assert path.critical[0].factor == pytest.approx(factors[0], rel=5e-6)
    assert 0 < factors[0] < factors[1]


@pytest.mark.parametrize(
    ("EA", "cells", "control"),
    [(1e4, 16, ub.LoadControl(0.5)), (1e6, 48, ub.ArcLength(0.05, factor=5))],
)
def test_a_ring_under_pressure(EA, cells, control):
    """[closed] p = 3 EI/R³; the tangent of the pressure is unsymmetric at the ends.

    The polygon has a second-order error: 0.0233 with 16 cells, 0.0026 with 48.  The radius shrinks
    by p/EA, twice that at the nodes.
    """

    def water(arc):
        return [ub.Pressure(arc, 1.0, amplitude=growing)]

    scene = quarter_ring(ub.Section(EA=EA, GA=EA, EI=1.0), cells, water)
    top = scene.beams[0].start
    path = ub.follow(scene, control, until=lambda now: now.t >= 4)
    (point,) = path.critical
    assert point.kind == "bifurcation"
    assert point.factor == pytest.approx(3.0, abs=6.5 / cells**2 + 20 / EA)
    assert (np.diff(path.factor) > 0).all()
    assert np.abs(path.displacement(top)[:, 0]).max() <= 2 * path.factor[-1] / EA
    branches = [
        ub.follow(scene, ub.ArcLength(0.05), start=point.branch(k), steps=4) for k in (1, -1)
    ]
    with raises("branch: sign = 2 must be 1 or -1"):
        point.branch(2)
    one, other = (branch.displacement(top)[-1, 0] for branch in branches)
    assert one * other < 0
    assert min(abs(one), abs(other)) > 0.05


def test_all_bifurcations_of_a_column():
    """Those of linear buckling, also in the first step, or two in a step: 1e-4 apart."""
    for step in (2.0, 33.0):
        beam = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e8, GA=1e8, EI=1.0), cells=16)
        supports = [ub.Pinned(beam.start), ub.PrescribedDisplacement(beam.end, u=0)]
        load = ub.PointLoad(beam.end, force=(0, -1), amplitude=growing)
        scene = ub.Scene([beam], supports=supports, loads=[load])
        path = ub.follow(scene, ub.LoadControl(step), until=lambda now: now.t > 100)
        assert [point.kind for point in path.critical] == ["bifurcation"] * 3
        factors = [point.factor for point in path.critical]
        np.testing.assert_allclose(factors, ub.buckling(scene, 3).factors, rtol=1e-6)
    sections = [ub.Section(EA=1e6, GA=1e6, EI=EI) for EI in (1.0, 1.0001)]
    beams = [ub.Beam((x, 0), (x, 1), s, cells=8) for x, s in enumerate(sections)]
    loads = [ub.PointLoad(beam.end, force=(0, -1), amplitude=growing) for beam in beams]
    scene = ub.Scene(beams, supports=[ub.Clamped(beam.start) for beam in beams], loads=loads)
    path = ub.follow(scene, ub.LoadControl(0.3), until=lambda now: now.t > 3)
    factors = [point.factor for point in path.critical]
    np.testing.assert_allclose(factors, ub.buckling(scene, 2).factors, rtol=5e-6)


def test_a_frame_of_roorda_has_a_limit_point():
    """The column shortens and turns the joint: an imperfection P/EA of an asymmetric kind.

    The limit point is below the factor of linear buckling by a distance in proportion to √(P/EA).
    """
    missing = []
    for EA in (1e4, 1e5):
        section = ub.Section(EA=EA, GA=EA, EI=1.0)
        post = ub.Beam((0, 0), (0, 1), section, cells=16)
        girder = ub.Beam((0, 1), (1, 1), section, cells=16)
        load = ub.PointLoad(post.end, force=(0, -1), amplitude=growing)
        supports = [ub.Pinned(post.start), ub.Pinned(girder.end)]
        scene = rigid_chain([post, girder], supports=supports, loads=[load])
        path = ub.follow(scene, ub.ArcLength(0.02, factor=5), until=first_point)
        (point,) = path.critical
        assert point.kind == "limit"
        missing.append(1 - point.factor / ub.buckling(scene, 1).factors[0])
    assert missing[0] / missing[1] == pytest.approx(10**0.5, rel=0.05)


@pytest.mark.parametrize(("cells", "step"), [(12, 0.028), (24, 0.013), (24, 0.025)])
def test_a_symmetric_arch_stays_symmetric(cells, step):
    """Rounding of the mode must not spoil the state at the bifurcation before the limit point."""
    section = ub.Section.rectangle(h=0.02, b=0.1, E=210e9, nu=0.3)
    ends = np.pi / 2 + 0.4, np.pi / 2 - 0.4
    arch = ub.Beam.arc((0, -5 * np.cos(0.4)), 5.0, ends, section, cells=cells)
    crown = arch.at(0.5)
    load = ub.PointLoad(crown, force=(0, -1e3), amplitude=growing)
    scene = ub.Scene([arch], supports=[ub.Pinned(p) for p in (arch.start, arch.end)], loads=[load])
    path = ub.follow(
        scene, ub.ArcLength(step, factor=30), until=lambda now: now.displacement(crown)[1] < -0.25
    )
    assert [point.kind for point in path.critical] == ["bifurcation", "limit"]
    assert abs(path.displacement(crown)[:, 0]).max() < 1e-8
