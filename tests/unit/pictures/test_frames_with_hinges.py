# SPDX-License-Identifier: MIT
"""Pictures of a frame of three bays and five storeys whose members have hinges at both ends."""

import re

import numpy as np
import pytest
from drawn import STEEL, circles, middles, static, storeys
from matplotlib.colors import same_color, to_hex
from scenes import clamped

import ufl_beam as ub
from ufl_beam.plotting.style import GREY, SKY, scale

COLUMN, GIRDER = ub.ElastoPlastic(40e3, kinematic=4e5), ub.ElastoPlastic(30e3, kinematic=3e5)


def frame(law_of):
    """The frame with hinges, pushed to the right by growing forces, without weight."""
    plain = storeys(3, 5, law_of)
    pushed = [load.place for load in plain.loads if isinstance(load, ub.PointLoad)]
    loads = [ub.PointLoad(place, force=(1e3, 0), amplitude=lambda t: t) for place in pushed]
    return ub.Scene(plain.beams, joints=plain.joints, supports=plain.supports, loads=loads)


def by_kind(name):
    return COLUMN if name.startswith("C") else GIRDER


@pytest.fixture(scope="module")
def path():
    """Path of the frame up to a sway of 0.5 m."""
    scene = frame(by_kind)
    control = ub.DisplacementControl(scene["C40"].end, "u", 0.025)
    return ub.follow(scene, control, steps=20)


def words_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def notes(figure):
    """Texts of the notes and their colours, from the top."""
    found = [x for x in figure.axes[0].texts if x.get_gid() == "notes"]
    return {x.get_text(): x.get_color() for x in sorted(found, key=lambda x: -x.get_position()[1])}


def test_many_different_limits_are_three_notes_and_a_range():
    """Each storey has its limit, 10 to 50 kN m, at 14 ends of columns and girders."""
    figure = ub.plot(frame(lambda name: ub.ElastoPlastic(1e4 * (1 + int(name[1])), kinematic=1e5)))
    words = [f"dots: 14 hinges, {limit} kN m" for limit in (10, 20, 30)]
    found = notes(figure)
    assert [*found][:4] == [*words, "dots: 28 hinges, 40 kN m to 50 kN m"]
    colors = [*found.values()][:4]
    assert [len(middles(figure, "hinges", fill=x)) for x in colors] == [14, 14, 14, 28]


def rotations(path, n=-1):
    """Largest plastic rotation of each hinge that has yielded; rad."""
    states = range(path.index(n) + 1)
    found = [np.abs(path.connector(hinge).motion[states]).max() for hinge in path.scene.hinges]
    return sorted(x for x in found if x > 0)


def test_hardening_hinges_are_coloured_by_their_rotation(path):
    """No two marks cover each other, also at joints of four members."""
    axes, bar = ub.plot(path, "damage").axes
    marks = circles(axes)
    expected = rotations(path)
    assert len(marks) == len(expected) > 20
    assert expected[-1] > 10 * expected[0]
    assert bar.get_ylabel() == "plastic rotation of hinges (mrad)"
    assert bar.get_ylim()[1] == pytest.approx(1e3 * expected[-1])
    rule = scale("YlOrRd", 0.2, 1.0, 0.0, expected[-1])
    drawn = sorted(to_hex(mark.get_markerfacecolor()) for mark in marks)
    assert drawn == sorted(map(to_hex, rule.to_rgba(expected)))
    assert len({*drawn}) > 10
    at = np.array([mark.get_xydata()[0] for mark in marks])
    apart = np.linalg.norm(at[:, None] - at, axis=2) + np.eye(len(at))
    assert apart.min() > 0.1  # m, of a frame of 15 m


def test_hinges_are_coloured_by_acceptance_limits(path):
    limits = {"IO": 0.005, "LS": 0.015, "CP": 0.03}  # rad
    for n in (8, -1):
        figure = ub.plot(path, "damage", n=n, limits=limits)
        ranges = ["IO, up to 0.005 rad", "LS, up to 0.015 rad", "CP, up to 0.03 rad"]
        assert words_of(figure) == [*ranges, "beyond CP"]
        colors = [mark.get_markerfacecolor() for mark in figure.legends[0].legend_handles]
        marks = [mark.get_markerfacecolor() for mark in circles(figure.axes[0])]
        counts = [sum(same_color(mark, color) for mark in marks) for color in colors]
        expected, _ = np.histogram(rotations(path, n), [0, *limits.values(), np.inf])
        assert counts == list(expected)
    assert min(counts) > 0  # at the end there is one of each
    with pytest.raises(ub.ArgumentError, match=r"limits\['LS'\] = 0.01 rad is not above the limit"):
        ub.plot(path, "damage", limits={"IO": 0.02, "LS": 0.01})


def test_damage_of_a_mechanism_without_beams():
    """A wheel whose yielding spring is turned by 0.1 rad; beyond 2 N m / 40 N m it yields."""
    wheel = ub.Body((0, 0), mass=1.0, inertia=1.0)
    ends = ub.ground(0, 0), wheel.middle
    turn = ub.Turn(*ends, ub.Spring(40.0, law=ub.ElastoPlastic(2.0, kinematic=10.0)))
    drive = ub.Turn(*ends, ub.PrescribedMotion(lambda t: 0.1 * t))
    scene = ub.Scene(bodies=[wheel], joints=[ub.Revolute(*ends)], connectors=[turn, drive])
    run = static(scene, dt=0.1)
    axes, bar = ub.plot(run, "damage").axes
    assert len(circles(axes)) == 1
    plastic = 0.1 - run.connector(turn).force[-1] / 40.0
    assert plastic > 0.01
    assert bar.get_ylim()[1] == pytest.approx(1e3 * plastic)  # mrad


def arrows(figure):
    """Marks of directions of beams, which are turned triangles."""
    marks = [line.get_marker() for line in figure.axes[0].lines]
    return sum(isinstance(marker, tuple) and marker[:2] == (3, 0) for marker in marks)


def test_the_legend_names_no_arrow_without_arrows():
    """72 beams are more than have arrows."""
    scene, extremes = storeys(4, 8), ub.Extremes()
    static(scene, record=extremes)
    for shown, what in ((extremes, "M"), (extremes, "V"), (extremes.solution, "M")):
        figure = ub.plot(shown, what)
        assert arrows(figure) == 0
        words = words_of(figure)
        assert words
        assert all(re.fullmatch(rf"{what} [<>] 0: .*, from start to end", x) for x in words)


def test_modes_show_both_phases_of_bodies():
    """The outlines of the body in both phases have opposite displacements from the grey one."""
    mast = ub.Beam((0, 0), (0, 4), STEEL, cells=4, name="mast")
    head = ub.Body((0, 4.5), mass=50.0, inertia=8.0, name="head")
    stay = ub.Stretch(head.at(0.7, 4.5), ub.ground(3, 4.5), ub.Spring(1e4))
    joint = ub.Rigid(mast.end, head.at(0, 4))
    scene = clamped(mast, bodies=[head], joints=[joint], connectors=[stay])
    shapes = ub.modes(scene, 1)
    axes = ub.plot(shapes, amplitude=0.1).axes[0]
    backward = [line.get_xydata() for line in axes.lines if same_color(line.get_color(), SKY)]
    assert len(backward) == 2  # beams, and bodies with rods
    moved = shapes.motion(0, amplitude=0.1, count=2)
    u, v, angle = moved.displacement(head.middle)[1]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    outline = next(
        line.get_xydata() for line in axes.lines
        if same_color(line.get_color(), GREY) and len(line.get_xydata()) == len(backward[1])
    )  # fmt: skip
    expected = (outline - head.center) @ turn.T + head.center + (u, v)
    np.testing.assert_allclose(backward[1], expected, rtol=0, atol=1e-9)
