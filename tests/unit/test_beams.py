# SPDX-License-Identifier: MIT
"""Beams: where the axis runs, which vertices it gets, and what a place is."""

import math

import numpy as np
import pytest
from helpers import run
from scenes import clamped

import ufl_beam as ub
from ufl_beam.discretization.dof_numbering import DofNumbering

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0)


def numbered(*beams, **parts):
    return DofNumbering(ub.Scene(beams, **parts))


def test_a_place_is_the_same_however_it_is_named():
    beam, twin = (ub.Beam((1, 2), (4, 6), SECTION, name="strut") for _ in range(2))
    assert beam.at(0.0) == beam.start
    assert beam.at(1.0) == beam.end
    assert hash(beam.at(1)) == hash(beam.end)
    assert beam.at(0.25) != beam.at(0.5)
    assert beam != twin
    assert beam.start != twin.start
    words = "strut.start (1, 2)", "strut.end (4, 6)", "strut.at(0.5) (2.5, 4)"
    assert tuple(map(str, (beam.start, beam.end, beam.at(0.5)))) == words


R = math.sqrt(0.5)
CURVES = {
    "line": (ub.Beam((1, 2), (4, 6), SECTION), {0: (1, 2), 0.5: (2.5, 4), 1: (4, 6)}),
    "arc": (
        ub.Beam.arc((1, 1), 2.0, (0, math.pi / 2), SECTION),
        {0: (3, 1), 0.5: (1 + 2 * R, 1 + 2 * R), 1: (1, 3)},
    ),
    "clockwise": (
        ub.Beam.arc((0, 0), 1.0, (math.pi / 2, 0), SECTION), {0: (0, 1), 1 / 3: (0.5, 0.75**0.5)}
    ),
    # Pieces of 3 and 1 m: the corner is at 3/4
    "polyline": (
        ub.Beam.polyline([(0, 0), (3, 0), (3, 1)], SECTION),
        {0.5: (2, 0), 0.75: (3, 0), 0.875: (3, 0.5)},
    ),
    "along": (
        ub.Beam.along(lambda s: (2 * s, s**2), SECTION), {0: (0, 0), 0.5: (1, 0.25), 1: (2, 1)}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CURVES)
def test_points_of_a_beam(name):
    beam, points = CURVES[name]
    for s, point in points.items():
        assert beam.at(s).point == pytest.approx(point)


def bent(beam):
    """End of a beam whose plastic hinge in the middle yields."""
    push = ub.PointLoad(beam.end, force=(0, -3.0), amplitude=lambda t: t)
    scene = clamped(beam, loads=[push])
    solution = run(scene, ub.Static(), dt=0.25)
    return solution.displacement(beam.end), solution.connector(scene.hinges[0]).motion


@pytest.mark.parametrize(
    "make",
    [
        lambda **more: ub.Beam.polyline([(0, 0), (1, 0), (2, 0)], SECTION, **more),
        lambda **more: ub.Beam.along(lambda s: (2 * s, 0.0), SECTION, **more),
        lambda **more: ub.Beam.arc(
            (1, -1e6), 1e6, (math.pi / 2 + 1e-6, math.pi / 2 - 1e-6), SECTION, **more
        ),
    ],
    ids=["polyline", "along", "arc"],
)  # fmt: skip
def test_hinges_of_curved_beams(make):
    """Their places are parameters along the whole beam; each of these beams is straight."""
    hinges = {0.5: ub.ElastoPlastic(yield_limit=1.0, isotropic=100.0)}
    beam = make(cells=4, hinges=hinges)
    assert [place.s for place in beam.hinge_laws] == [0.5]
    end, jump = bent(beam)
    expected, straight = bent(ub.Beam((0, 0), (2, 0), SECTION, cells=4, hinges=hinges))
    # The hinge bears a moment of 3 N m: its jump is (3 - 1)/100 rad.  The angles of the arc differ
    # from those of the line by 1e-6 rad, which turns the motion of 0.1 m
    assert abs(jump[-1]) == pytest.approx(0.02, rel=0.05)
    assert np.allclose(jump, straight, rtol=0, atol=1e-6)
    assert np.allclose(end, expected, rtol=0, atol=1e-6)


def test_vertices_are_regular_and_those_attached():
    """Places nearer to a vertex than 1e-9 of a cell are this vertex."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    assert beam.vertices(()) == [0, 0.25, 0.5, 0.75, 1]
    assert beam.vertices([0.3, 0.5, 1 - 1e-12]) == [0, 0.25, 0.3, 0.5, 0.75, 1]
    bent = ub.Beam.polyline([(0, 0), (3, 0), (3, 1)], SECTION, cells=3)
    assert bent.vertices(()) == pytest.approx([0, 1 / 3, 2 / 3, 3 / 4, 1])
    corners = [(0, 0), (4 / 3, 0), (8 / 3, 0), (3, 0), (3, 1)]
    np.testing.assert_allclose(numbered(bent).points, corners, atol=1e-15)


EXTRA = ub.Beam((0.3, 0), (0.3, 1), SECTION, cells=1)


@pytest.mark.parametrize(
    "attach",
    [
        lambda place: {"loads": [ub.PointLoad(place)]},
        lambda place: {"loads": [ub.FollowerLoad(place)]},
        lambda place: {"supports": [ub.Pinned(place)]},
        lambda place: {"masses": [ub.PointMass(place, 1.0)]},
        lambda place: {"joints": [ub.Revolute(place, EXTRA.start)]},
    ],
)
def test_attached_places_become_vertices(attach):
    beam, plain = (ub.Beam((0, k), (1, k), SECTION, cells=2) for k in (0, 2))
    numbering = numbered(beam, plain, EXTRA, **attach(beam.at(0.3)))
    vertices = numbering.vertices_of(beam)
    assert numbering.points[vertices, 0] == pytest.approx([0, 0.3, 0.5, 1])
    assert numbering.vertex(beam.at(0.3)) == vertices[1]
    assert numbering.parameters(beam).tolist() == [0.0, 0.3, 0.5, 1.0]
    assert numbering.parameters(plain).tolist() == [0.0, 0.5, 1.0]


def test_interpolation_between_vertices():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    vertices, weights = numbered(beam).weights(beam.at(0.3))
    assert list(vertices) == [1, 2]
    assert weights == pytest.approx([0.8, 0.2])


def test_joints_share_degrees_of_freedom():
    """Three beams of three cells, two joined rigidly (3), one pinned to them (2)."""
    beams = [ub.Beam((0, 0), end, SECTION, cells=3) for end in ((1, 0), (0, 1), (-1, 0))]
    a, b, c = (beam.start for beam in beams)
    numbering = numbered(*beams, joints=[ub.Rigid(a, b), ub.Revolute(b, c)])
    assert numbering.size == 36 - 5
    at = [numbering.dofs[numbering.vertex(place)] for place in (a, b, c)]
    assert (at[0] == at[1]).all()
    assert (at[0][:2] == at[2][:2]).all()
    assert at[0][2] != at[2][2]
    assert sorted(set(numbering.dofs.ravel())) == list(range(numbering.size))
    assert numbered(*beams, joints=[ub.Revolute(a, b, c)]).size == 36 - 4
    ring = ub.Beam.arc((0, 0), 1.0, (0, 2 * math.pi), SECTION, cells=12)
    assert numbered(ring, joints=[ub.Rigid(ring.start, ring.end)]).size == 36


def test_joints_whose_ends_are_apart_by_rounding_only():
    one = ub.Beam((0, 0), (0.1 + 0.2, 0), SECTION, cells=1)
    other = ub.Beam((0.3, 0), (1, 0), SECTION, cells=1)
    assert numbered(one, other, joints=[ub.Rigid(one.end, other.start)]).size == 9
