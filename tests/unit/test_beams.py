# SPDX-License-Identifier: MIT
"""Beams: where the axis runs, which vertices it gets, and what a place is."""

import math

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.model.functions import points_along

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0)


def test_a_place_is_the_same_however_it_is_named():
    beam = ub.Beam((0, 0), (3, 4), SECTION)
    assert beam.at(0.0) == beam.start
    assert beam.at(1.0) == beam.end
    assert hash(beam.at(1)) == hash(beam.end)
    assert beam.at(0.25) != beam.at(0.5)


def test_places_of_equal_beams_differ():
    one, other = (ub.Beam((0, 0), (1, 0), SECTION) for _ in range(2))
    assert one != other
    assert one.start != other.start


def test_points_of_a_straight_beam():
    beam = ub.Beam((1, 2), (4, 6), SECTION)
    assert beam.start.point == (1, 2)
    assert beam.end.point == (4, 6)
    assert beam.at(0.5).point == (2.5, 4)


def test_a_place_says_where_it_is():
    beam = ub.Beam((1, 2), (4, 6), SECTION, name="strut")
    assert str(beam.start) == "strut.start (1, 2)"
    assert str(beam.end) == "strut.end (4, 6)"
    assert str(beam.at(0.5)) == "strut.at(0.5) (2.5, 4)"


def test_an_arc_goes_from_angle_to_angle():
    beam = ub.Beam.arc((1, 1), 2.0, (0, math.pi / 2), SECTION, cells=3)
    assert beam.ends[0] == pytest.approx((3, 1))
    assert beam.ends[1] == pytest.approx((1, 3))
    half = 1 + 2 / math.sqrt(2)
    assert beam.at(0.5).point == pytest.approx((half, half))


def test_an_arc_may_run_clockwise():
    beam = ub.Beam.arc((0, 0), 1.0, (math.pi / 2, 0), SECTION)
    assert beam.start.point == pytest.approx((0, 1))
    assert beam.at(1 / 3).point == pytest.approx((0.5, math.sqrt(3) / 2))


def test_full_circle_may_close():
    beam = ub.Beam.arc((0, 0), 1.0, (0, 2 * math.pi), SECTION, cells=12)
    numbering = DofNumbering(ub.Scene([beam], joints=[ub.Rigid(beam.start, beam.end)]))
    assert len(numbering.points) == 13
    assert numbering.size == 36  # 12 vertices: the ends share all three


def test_polyline_goes_by_length():
    # Pieces of 3 and 1 m: the corner is at 3/4
    beam = ub.Beam.polyline([(0, 0), (3, 0), (3, 1)], SECTION, cells=3)
    assert beam.at(0.75).point == (3, 0)
    assert beam.at(0.5).point == pytest.approx((2, 0))
    assert beam.at(0.875).point == pytest.approx((3, 0.5))


def bent(beam):
    """End of a beam whose plastic hinge in the middle yields."""
    push = ub.PointLoad(beam.end, force=(0, -3.0), amplitude=lambda t: t)
    scene = clamped(beam, loads=[push])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
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


def test_hinges_of_curved_beams_are_checked():
    with pytest.raises(ub.ArgumentError, match=r"hinge at s = 2 must lie between 0 and 1"):
        ub.Beam.arc((0, 0), 1.0, (0, 1), SECTION, hinges={2.0: ub.ElastoPlastic(1.0)})


def test_corners_are_vertices():
    beam = ub.Beam.polyline([(0, 0), (3, 0), (3, 1)], SECTION, cells=3)
    assert beam.vertices(()) == pytest.approx([0, 1 / 3, 2 / 3, 3 / 4, 1])
    points = DofNumbering(ub.Scene([beam])).points
    assert points == pytest.approx(
        np.array([(0, 0), (4 / 3, 0), (8 / 3, 0), (3, 0), (3, 1)], dtype=float)
    )


def test_a_beam_may_follow_any_curve():
    beam = ub.Beam.along(lambda s: (2 * s, s**2), SECTION, cells=4)
    assert beam.ends == ((0, 0), (2, 1))
    assert DofNumbering(ub.Scene([beam])).points[:, 1] == pytest.approx(
        [0, 1 / 16, 1 / 4, 9 / 16, 1]
    )


def test_vertices_are_regular_and_those_attached():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    assert beam.vertices(()) == [0, 0.25, 0.5, 0.75, 1]
    assert beam.vertices([0.3, 0.5]) == [0, 0.25, 0.3, 0.5, 0.75, 1]


def test_places_next_to_a_vertex_are_that_vertex():
    # Nearer than 1e-9 of a cell; 0.1 + 0.2 and 3/10 differ in the last digit
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=10)
    assert len(beam.vertices([0.1 + 0.2, 1 - 1e-12, 1e-12])) == 11
    assert beam.vertices([1 - 1e-12])[-1] == 1.0


@pytest.mark.parametrize(
    "attach",
    [
        lambda place: {"loads": [ub.PointLoad(place)]},
        lambda place: {"loads": [ub.FollowerLoad(place)]},
        lambda place: {"supports": [ub.Pinned(place)]},
        lambda place: {"masses": [ub.PointMass(place, 1.0)]},
        lambda place: {"joints": [ub.Revolute(place, EXTRA.start)], "beams": [place.beam, EXTRA]},
    ],
    ids=["load", "follower", "support", "mass", "joint"],
)
def test_attached_places_become_vertices(attach):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    parts = {"beams": [beam], **attach(beam.at(0.3))}
    numbering = DofNumbering(ub.Scene(**parts))
    vertices = numbering.vertices_of(beam)
    assert numbering.points[vertices, 0] == pytest.approx([0, 0.3, 0.5, 1])
    assert numbering.vertex(beam.at(0.3)) == vertices[1]


EXTRA = ub.Beam((0.3, 0), (0.3, 1), SECTION, cells=1)


def test_joints_share_degrees_of_freedom():
    # Three beams at a point: two rigid, one hinged to them.  12 + 12 + 12 of four-cell beams less
    # one rigid (3) and one revolute (2)
    beams = [ub.Beam((0, 0), end, SECTION, cells=3) for end in ((1, 0), (0, 1), (-1, 0))]
    a, b, c = (beam.start for beam in beams)
    scene = ub.Scene(beams, joints=[ub.Rigid(a, b), ub.Revolute(b, c)])
    numbering = DofNumbering(scene)
    assert numbering.size == 36 - 5
    at = [numbering.dofs[numbering.vertex(place)] for place in (a, b, c)]
    assert (at[0] == at[1]).all()
    assert (at[0][:2] == at[2][:2]).all()
    assert at[0][2] != at[2][2]
    assert sorted(set(numbering.dofs.ravel())) == list(range(numbering.size))


def test_three_places_in_one_joint_are_as_two_joints():
    beams = [ub.Beam((0, 0), end, SECTION, cells=1) for end in ((1, 0), (0, 1), (-1, 0))]
    a, b, c = (beam.start for beam in beams)
    together = DofNumbering(ub.Scene(beams, joints=[ub.Revolute(a, b, c)]))
    pairs = DofNumbering(ub.Scene(beams, joints=[ub.Revolute(c, b), ub.Revolute(a, c)]))
    assert together.size == pairs.size == 18 - 4


def test_joints_whose_ends_are_apart_by_rounding_only():
    one = ub.Beam((0, 0), (0.1 + 0.2, 0), SECTION)
    other = ub.Beam((0.3, 0), (1, 0), SECTION)
    apart, joined = ((), [ub.Rigid(one.end, other.start)])
    sizes = [DofNumbering(ub.Scene([one, other], joints=joints)).size for joints in (apart, joined)]
    assert sizes[0] - sizes[1] == 3


def test_interpolation_between_vertices():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    vertices, weights = DofNumbering(ub.Scene([beam])).weights(beam.at(0.3))
    assert list(vertices) == [1, 2]
    assert weights == pytest.approx([0.8, 0.2])


def test_points_along_many_curves():
    """The same to the last digit as one after the other, straight or not."""
    section = ub.Section(EA=60.0, GA=40.0, EI=30.0)
    beams = [
        ub.Beam((0.1, 0.7), (1.3, 0.2), section),
        ub.Beam.arc((0, 0), 1.0, (0, 1), section),
        ub.Beam((1.3, 0.2), (0.1, 0.7), section),
    ]
    parameters = [np.linspace(0, 1, n) for n in (4, 3, 7)]
    found = points_along([beam.curve for beam in beams], parameters)
    expected = [beam.curve(s) for beam, at in zip(beams, parameters, strict=True) for s in at]
    assert np.array_equal(found, expected)
    assert points_along([], []).shape == (0, 2)


def test_beams_alike_share_their_parameters():
    section = ub.Section(EA=60.0, GA=40.0, EI=30.0)
    one, other, divided = (ub.Beam((0, i), (1, i), section, cells=4) for i in range(3))
    loads = [ub.PointLoad(divided.at(0.3), force=(0.0, -1.0)), ub.PointLoad(one.end, moment=1.0)]
    numbering = DofNumbering(ub.Scene([one, other, divided], loads=loads))
    assert numbering.parameters(one) is numbering.parameters(other)
    assert numbering.parameters(divided).tolist() == [0.0, 0.25, 0.3, 0.5, 0.75, 1.0]
