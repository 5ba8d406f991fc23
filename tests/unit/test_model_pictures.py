# SPDX-License-Identifier: MIT
"""Pictures of models before any run: what is in them, labels that stand clear, errors."""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pytest
import scenes
from matplotlib.collections import LineCollection, PolyCollection

import ufl_beam as ub
from ufl_beam.plotting.positions import (
    Candidate,
    Label,
    areas_covered,
    crossings,
    lengths_inside,
    place,
)
from ufl_beam.plotting.style import GREEN, RED

STEEL = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)


def frame(**parts):
    """A column and a girder, joined; with a rotor beside them."""
    column = ub.Beam((0, 0), (0, 3), STEEL, name="column")
    girder = ub.Beam((0, 3), (5, 3), STEEL, name="girder")
    rotor = ub.Body((7, 1), mass=3.0, inertia=1.0, name="rotor")
    made = {part: call(column, girder, rotor) for part, call in parts.items()}
    joints = [*made.pop("joints", []), ub.Rigid(column.end, girder.start)]
    return ub.Scene([column, girder], bodies=[rotor], joints=joints, **made)


def collections(figure, gid, kind=object):
    return [c for c in figure.axes[0].collections if c.get_gid() == gid and isinstance(c, kind)]


def shapes(figure, gid, kind=object):
    """Outlines or lines of a group, as arrays of points."""
    return [path.vertices for c in collections(figure, gid, kind) for path in c.get_paths()]


def words(figure):
    return [text.get_text() for text in figure.axes[0].texts if text.get_text()]


def amount(figure):
    """Number of lines, areas and words that are drawn."""
    drawn = sum(len(c.get_paths()) for c in figure.axes[0].collections)
    return drawn + len(figure.axes[0].texts)


@dataclass(frozen=True)
class Dashpot(ub.ConnectorLaw):
    """A law of a user."""

    c: float

    def resistance(self, motion, rate, state, dt):
        return self.c * rate


LAWS = {
    "spring": ub.Spring(2e4),
    "damper": ub.Damper(300.0),
    "stop": ub.Stop(1e6, high=0.02),
    "friction": ub.Coulomb(50.0),
    "motor": ub.PrescribedMotion(lambda t: t),
    "actuator": ub.PrescribedForce(lambda t: t),
    "controller": ub.Controller(lambda simulation: 0.0),
    "function": ub.ForceLaw(lambda motion, rate: motion),
    "own law": Dashpot(3.0),
    "rigid-plastic": ub.RigidPlastic(ub.Softening(1e3, 10.0)),
}

OBJECTS = {
    "clamped": ("supports", lambda c, g, r: ub.Clamped(c.start)),
    "pinned": ("supports", lambda c, g, r: ub.Pinned(c.start)),
    "roller": ("supports", lambda c, g, r: ub.Roller(g.end)),
    "inclined roller": ("supports", lambda c, g, r: ub.Roller(g.end, along=(1, 1))),
    "prescribed": (
        "supports",
        lambda c, g, r: ub.PrescribedDisplacement(g.end, u=0.1, v=lambda t: t),
    ),
    "turned": ("supports", lambda c, g, r: ub.PrescribedDisplacement(r.middle, psi=lambda t: t)),
    "force": ("loads", lambda c, g, r: ub.PointLoad(g.at(0.5), force=(0, -4e4))),
    "moment": ("loads", lambda c, g, r: ub.PointLoad(g.end, moment=-3e3)),
    "no force": ("loads", lambda c, g, r: ub.PointLoad(g.end)),
    "on a body": ("loads", lambda c, g, r: ub.PointLoad(r.at(7.5, 1), force=(1, 1))),
    "follower": ("loads", lambda c, g, r: ub.FollowerLoad(g.end, force=(0, -1), moment=2.0)),
    "line load": ("loads", lambda c, g, r: ub.LineLoad(g, force=(0, -1e4))),
    "along": ("loads", lambda c, g, r: ub.LineLoad(c, force=(0, -1e4))),
    "line moment": ("loads", lambda c, g, r: ub.LineLoad(c, moment=1e3)),
    "no line load": ("loads", lambda c, g, r: ub.LineLoad(c)),
    "gravity": ("loads", lambda c, g, r: ub.Gravity()),
    "turning frame": ("loads", lambda c, g, r: ub.RotatingFrame(-2.0)),
    "mass": ("masses", lambda c, g, r: ub.PointMass(g.at(0.75), 50.0)),
    "velocity": ("initial", lambda c, g, r: ub.Velocity([c, g, r], linear=(1, 0), angular=0.5)),
    "spin": ("initial", lambda c, g, r: ub.Velocity([r], angular=0.5, about=(7, 1))),
    "rest": ("initial", lambda c, g, r: ub.Velocity([c])),
    "Rayleigh": ("damping", lambda c, g, r: ub.Rayleigh(mass=0.1)),
    "Kelvin-Voigt": ("damping", lambda c, g, r: ub.KelvinVoigt(1e-3, [c])),
    "revolute": ("joints", lambda c, g, r: ub.Revolute(c.start, ub.ground(0, 0))),
    "rigid": ("joints", lambda c, g, r: ub.Rigid(c.start, ub.ground(0, 0))),
    "prismatic": ("joints", lambda c, g, r: ub.Prismatic(ub.ground(7, 0), r.middle)),
    "link": ("joints", lambda c, g, r: ub.Link(g.end, r.at(7, 1.5))),
    "rigid link": ("joints", lambda c, g, r: ub.RigidLink(g.end, r.middle)),
    "guided": ("joints", lambda c, g, r: ub.Guided(r.middle, lambda s: (7 + s, 1 + s**2))),
    "release": ("joints", lambda c, g, r: ub.Release(c.start, ub.ground(0, 0), free="N")),
    **{
        f"{kind.__name__} {name}": (
            "connectors",
            lambda c, g, r, kind=kind, law=law: kind(ub.ground(8, 0), r.at(7.2, 1.2), law),
        )
        for kind in (ub.Turn, ub.Stretch, ub.Slide)
        for name, law in LAWS.items()
    },
}


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_leaves_something(name):
    part, make = OBJECTS[name]
    scene = frame(**{part: lambda *beams: [make(*beams)]})
    (added,) = {*getattr(scene, part)} - {*frame().joints, *scene.joints[1:]}
    others = [one for one in getattr(scene, part) if one is not added]
    without = dataclasses.replace(scene, **{part: others})
    assert amount(ub.plot(scene)) > amount(ub.plot(without))


def test_beams_run_through_their_vertices_and_have_names():
    arc = ub.Beam.arc((0, 0), 2.0, (0.0, 1.0), STEEL, cells=6, name="arc")
    rods = [ub.Beam((3, y), (5, y), STEEL, cells=3, name="rod") for y in (0, 1)]
    figure = ub.plot(ub.Scene([arc, *rods]))
    for drawn, beam in zip(shapes(figure, "beams"), [arc, *rods], strict=True):
        np.testing.assert_array_equal(drawn, [beam.curve(s) for s in beam.vertices(())])
    assert sorted(words(figure)) == ["arc", "rod 1", "rod 2"]  # numbers of scene.beams
    assert len(shapes(figure, "cells")) == 5 + 2 + 2
    assert figure.axes[0].get_title(loc="left") == "model: 3 beams, 12 cells"


def test_words_say_sizes_with_units():
    figure = ub.plot(
        frame(
            loads=lambda c, g, r: [
                ub.PointLoad(g.end, force=(3e3, -4e3)),
                ub.LineLoad(g, force=(0, -1e4), amplitude=ub.ramp(1.0)),
                ub.FollowerLoad(c.end, moment=-20.0),
                ub.Gravity(),
            ],
            masses=lambda c, g, r: [ub.PointMass(c.at(0.5), 50.0)],
            initial=lambda c, g, r: [ub.Velocity([r], linear=(3, 4))],
            supports=lambda c, g, r: [
                ub.PrescribedDisplacement(c.start, u=0.01, v=0.0, psi=lambda t: t)
            ],
            connectors=lambda c, g, r: [ub.Turn(ub.ground(7, 1), r.middle, ub.Stop(1e3, low=-0.1))],
        )
    )
    for text in (
        "column", "girder", "rotor, 3 kg", "5 kN", "10 kN/m × f(t)", "20 N m, follows", "50 kg",
        "g = 9.81 m/s²", "5 m/s", "u = 10 mm", "ψ(t)", "stop ≥ −0.1 rad",
    ):  # fmt: skip
        assert text in words(figure), text


@pytest.mark.parametrize(("force", "end"), [((0, -2), "tip"), ((3, 0), "tail"), ((-3, 0), "tip")])
def test_arrows_end_where_they_push_and_begin_where_they_pull(force, end):
    figure = ub.plot(scenes.cantilever(force=force))
    (line,), (head,) = (
        shapes(figure, "loads", LineCollection),
        shapes(figure, "loads", PolyCollection),
    )
    way = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    np.testing.assert_allclose(way, np.array(force) / math.hypot(*force), atol=1e-12)
    nearest = {"tip": head[0], "tail": line[0]}[end]
    gap = np.linalg.norm(nearest - (1.0, 0.0))
    assert gap < 0.2 * np.linalg.norm(head[0] - line[0])
    assert np.allclose((nearest - (1.0, 0.0)) @ (-way[1], way[0]), 0.0, atol=1e-12)


def test_a_line_load_is_a_comb_and_stands_on_the_one_before():
    beam = ub.Beam((0, 0), (4, 0), STEEL)
    loads = [ub.LineLoad(beam, force=(0, -f)) for f in (1e3, 2e3)]
    figure = ub.plot(ub.Scene([beam], loads=loads))
    heads = shapes(figure, "loads", PolyCollection)
    tips = np.array([head[0] for head in heads])
    assert len(heads) % 2 == 0
    first, second = np.split(tips, 2)
    np.testing.assert_allclose(first[[0, -1], 0], [0.0, 4.0], atol=1e-12)
    assert np.ptp(first[:, 1]) < 1e-12 < first[0, 1] < second[0, 1]
    lines = shapes(figure, "loads", LineCollection)
    tops = sorted({float(line[:, 1].max()) for line in lines})
    assert first[0, 1] < tops[0] < second[0, 1] < tops[-1]  # no comb reaches into the other


def test_colours_tell_loads_from_motions():
    scene = frame(
        loads=lambda c, g, r: [ub.PointLoad(g.end, force=(0, -1))],
        initial=lambda c, g, r: [ub.Velocity([r], linear=(1, 0))],
    )
    figure = ub.plot(scene)
    for group, color in (("loads", RED), ("velocities", GREEN)):
        rgb = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        for collection in collections(figure, group):
            np.testing.assert_allclose(collection.get_edgecolor()[0, :3], rgb)


def test_hinges_are_shown_where_they_are():
    law = ub.Softening(2e4, 1e3)
    beam = ub.Beam((0, 0), (4, 0), STEEL, cells=4, hinges={0.0: law, 0.75: law})
    figure = ub.plot(ub.Scene([beam], supports=[ub.Clamped(beam.start)]))
    found = shapes(figure, "hinges")
    middles = np.array(sorted(tuple(np.ptp(x, axis=0) / 2 + x.min(axis=0)) for x in found))
    np.testing.assert_allclose(middles[:, 1], 0.0, atol=1e-9)
    assert 0.0 < middles[0, 0] < 0.3  # beside the clamp
    assert middles[1, 0] == pytest.approx(3.0)
    assert words(figure).count("hinge 20 kN m") == 2


def test_a_section_with_a_hinge_shows_it_in_all_cells_and_at_the_ends():
    law = ub.Softening(2e4, 1e3)
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0, hinge=law)
    beam = ub.Beam((0, 0), (4, 0), section, cells=4)
    supports = [ub.Clamped(beam.start), ub.Clamped(beam.end)]
    figure = ub.plot(ub.Scene([beam], supports=supports))
    assert len(shapes(figure, "hinges")) == 4 + 2
    assert words(figure) == ["dots: hinges may form, from 20 kN m", "beam"]


def boxes(figure, gid="labels"):
    figure.draw_without_rendering()
    texts = [text for text in figure.axes[0].texts if text.get_gid() == gid]
    return np.array([text.get_window_extent().extents for text in texts])


def storeys(bays, floors):
    """A frame with a name for each member and a load for each floor."""
    beams, joints, loads = [], {}, []

    def add(a, b, name):
        beam = ub.Beam(a, b, STEEL, cells=2, name=name)
        beams.append(beam)
        for place_ in (beam.start, beam.end):
            joints.setdefault(place_.point, []).append(place_)
        return beam

    for floor in range(floors):
        for bay in range(bays + 1):
            add((5.0 * bay, 3.0 * floor), (5.0 * bay, 3.0 * floor + 3), f"C{floor}{bay}")
        for bay in range(bays):
            add((5.0 * bay, 3.0 * floor + 3), (5.0 * bay + 5, 3.0 * floor + 3), f"B{floor}{bay}")
        loads.append(ub.PointLoad(beams[-2 * bays - 1].end, force=(1e3 * (floor + 1), 0)))
        loads += [ub.LineLoad(beam, force=(0, -5e3)) for beam in beams[-bays:]]
    feet = [ub.Clamped(places[0]) for (_, y), places in joints.items() if y == 0.0]
    joined = [ub.Rigid(*places) for places in joints.values() if len(places) > 1]
    return ub.Scene(beams, joints=joined, supports=feet, loads=loads)


@pytest.mark.parametrize(("bays", "floors", "number"), [(1, 1, 5), (2, 3, 24), (3, 4, 44)])
def test_labels_cover_neither_beams_nor_each_other(bays, floors, number):
    scene = storeys(bays, floors)
    figure = ub.plot(scene)
    found = boxes(figure)
    assert len(found) == number  # members, a force and the line loads of each floor
    area = areas_covered(found[:, :2], found[:, 2:], found)
    own = np.prod(found[:, 2:] - found[:, :2], axis=1)
    # Each box covers itself; to a square pixel, as texts have whole pixels
    np.testing.assert_allclose(area, own, atol=1.0)
    to_pixels = figure.axes[0].transData.transform
    ends = np.array([np.ravel(to_pixels(np.array(b.ends))) for b in scene.beams])
    assert lengths_inside(found[:, :2], found[:, 2:], ends).max() == 0.0
    inside = figure.axes[0].get_window_extent().extents
    assert (found[:, :2] > inside[:2]).all()
    assert (found[:, 2:] < inside[2:]).all()


def test_everything_is_within_the_axes():
    scene = frame(
        loads=lambda c, g, r: [
            ub.PointLoad(g.end, force=(5, -5)),
            ub.PointLoad(r.middle, moment=1),
        ],
        supports=lambda c, g, r: [ub.Clamped(c.start)],
    )
    axes = ub.plot(scene).axes[0]
    points = np.concatenate([p.vertices for c in axes.collections for p in c.get_paths()])
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    assert (points.min(axis=0) > (left, low)).all()
    assert (points.max(axis=0) < (right, high)).all()
    box = axes.get_window_extent()
    assert box.width / box.height == pytest.approx((right - left) / (high - low))  # one scale


def test_a_large_scene_has_few_artists():
    """A thousand beams are one collection; their names are left out."""
    beams = [ub.Beam((i, j), (i + 1, j), STEEL, cells=2) for i in range(40) for j in range(25)]
    chains = [ub.Rigid(a.end, b.start) for a, b in zip(beams, beams[25:], strict=False)]
    figure = ub.plot(
        ub.Scene(beams, joints=chains, loads=[ub.PointLoad(beams[0].end, force=(0, -1))])
    )
    assert len(shapes(figure, "beams")) == 1000
    assert len(shapes(figure, "pins")) == len(chains)
    assert words(figure) == ["1 N"]
    assert len(figure.axes[0].get_children()) < 40


def test_a_single_body_and_a_scene_far_away():
    for x in (0.0, 1e5):
        body = ub.Body((x, 0), mass=1.0, inertia=0.1)
        axes = ub.plot(ub.Scene(bodies=[body], loads=[ub.Gravity()])).axes[0]
        assert axes.get_xlim()[0] < x < axes.get_xlim()[1]
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: ub.plot(3), "plot: 3 is a int; give a Scene, the Solution of a run, or"),
        (lambda s: ub.plot([s]), "is a list; give a Scene"),
        (
            lambda s: ub.plot(s, "M"),
            "quantity = 'M' of a Scene is not one of model; a scene has none before a run",
        ),
        (
            lambda s: ub.plot(s, n=3),
            "unexpected keyword argument 'n'; the picture 'model' takes ax",
        ),
        (lambda s: ub.plot(s, magnify=10), "unexpected keyword argument 'magnify'"),
    ],
)
def test_refused(call, message):
    with pytest.raises(ub.ArgumentError) as caught:
        call(scenes.portal())
    assert message in str(caught.value)


def test_a_scene_that_contradicts_itself_is_refused_before_it_is_drawn():
    rotor = ub.Body((0, 0), mass=1.0, inertia=1.0)
    joints = [ub.Link(ub.ground(x, y), rotor.middle) for x, y in ((1, 0), (0, 1), (1, 1))]
    with pytest.raises(ub.ArgumentError, match="constraints repeat or contradict each other"):
        ub.plot(ub.Scene(bodies=[rotor], joints=joints))


# -- labels ------------------------------------------------------------------------------------


def test_lengths_areas_and_crossings_are_those_of_sampling():
    random = np.random.default_rng(4)
    low = random.uniform(0, 3, (5, 2))
    high = low + random.uniform(0.5, 2, (5, 2))
    lines = np.vstack([random.uniform(0, 4, (30, 4)), [[1, 0, 1, 4]], [[0, 2, 4, 2]]])
    parts = (np.arange(20000) + 0.5)[:, None, None] / 20000
    points = lines[:, :2] + parts * (lines[:, 2:] - lines[:, :2])
    lengths = np.linalg.norm(lines[:, 2:] - lines[:, :2], axis=1)
    for k in range(5):
        inside = ((points >= low[k]) & (points <= high[k])).all(axis=2).mean(axis=0)
        # A sample is 1/20000 of a line of at most 5.7 m; each of 32 lines errs by two of them
        assert lengths_inside(low, high, lines)[k] == pytest.approx(inside @ lengths, abs=0.02)
    boxes_ = np.hstack([low, high])
    assert areas_covered(low[:1], high[:1], boxes_[:1]) == pytest.approx(np.prod(high[0] - low[0]))
    cross = np.array([[0, 0, 2, 2], [0, 2, 2, 0], [0, 3, 1, 3]], dtype=float)
    np.testing.assert_array_equal(crossings(cross, cross), [1, 1, 0])


def test_a_label_moves_away_from_lines_and_other_labels():
    up, down = np.array([0.0, 1.0]), np.array([0.0, -1.0])
    at = np.zeros(2)
    label = Label("x", "k", 0, (Candidate(at, up), Candidate(at, down)))
    half = np.array([10.0, 5.0])
    nothing = np.empty((0, 4))
    (one,) = place([label], [half], nothing)
    assert one.center[1] > 0.0  # the first spot
    line = np.array([[-20.0, 9.0, 20.0, 9.0]])
    (one,) = place([label], [half], line)
    assert one.center[1] < 0.0
    first, second = place([label, label], [half, half], nothing)
    assert first.center[1] * second.center[1] < 0.0
    assert first.overlap == second.overlap == 0.0
    inside = np.array([-50.0, -50.0, 50.0, 3.0])
    (one,) = place([label], [half], nothing, inside)
    assert one.center[1] < 0.0
