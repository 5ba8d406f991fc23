# SPDX-License-Identifier: MIT
"""Pictures of models before any run: what is in them, labels that stand clear, errors."""

import math

import numpy as np
import pytest
from drawn import STEEL, middles, outlines, texts
from helpers import raises
from matplotlib.collections import LineCollection, PolyCollection
from scenes import cantilever, clamped, portal, rigid_chain

import ufl_beam as ub
import ufl_beam.structures as st


def frame(**parts):
    """A column and a girder, joined; with a rotor beside them."""
    column = ub.Beam((0, 0), (0, 3), STEEL, name="column")
    girder = ub.Beam((0, 3), (5, 3), STEEL, name="girder")
    rotor = ub.Body((7, 1), mass=3.0, inertia=1.0, name="rotor")
    made = {part: call(column, girder, rotor) for part, call in parts.items()}
    return rigid_chain([column, girder], bodies=[rotor], **made)


def amount(figure):
    """Number of lines, areas and words that are drawn."""
    drawn = sum(len(c.get_paths()) for c in figure.axes[0].collections)
    return drawn + len(figure.axes[0].texts)


SPRING = ub.Spring(10.0)

OBJECTS = {
    "clamped": ("supports", lambda c, g, r: ub.Clamped(c.start)),
    "pinned": ("supports", lambda c, g, r: ub.Pinned(c.start)),
    "roller": ("supports", lambda c, g, r: ub.Roller(g.end)),
    "inclined roller": ("supports", lambda c, g, r: ub.Roller(g.end, along=(1, 1))),
    "moved": ("supports", lambda c, g, r: ub.PrescribedDisplacement(g.end, u=0.1, v=lambda t: t)),
    "turned": ("supports", lambda c, g, r: ub.PrescribedDisplacement(r.middle, psi=lambda t: t)),
    "force": ("loads", lambda c, g, r: ub.PointLoad(g.at(0.5), force=(0, -4e4))),
    "moment": ("loads", lambda c, g, r: ub.PointLoad(g.end, moment=-3e3)),
    "no force": ("loads", lambda c, g, r: ub.PointLoad(g.end)),
    "on a body": ("loads", lambda c, g, r: ub.PointLoad(r.at(7.5, 1), force=(1, 1))),
    "follower": ("loads", lambda c, g, r: ub.FollowerLoad(g.end, force=(0, -1), moment=2.0)),
    "line load": ("loads", lambda c, g, r: ub.LineLoad(g, force=(0, -1e4))),
    "along": ("loads", lambda c, g, r: ub.LineLoad(c, force=(0, -1e4))),
    "line moment": ("loads", lambda c, g, r: ub.LineLoad(c, moment=1e3)),
    "strain": ("loads", lambda c, g, r: ub.ImposedStrain(g, 1e-4, (0.0, 1e-4), span=(0.2, 1.0))),
    "no strain": ("loads", lambda c, g, r: ub.ImposedStrain(g)),
    "moving load": ("loads", lambda c, g, r: ub.MovingLoad(g, lambda t: 2 * t, (0, -1e4))),
    "moving nothing": ("loads", lambda c, g, r: ub.MovingLoad(g, lambda t: 2 * t)),
    "pressure": ("loads", lambda c, g, r: ub.Pressure(g, -1e4, profile=(0.0, 1.0))),
    "friction": ("loads", lambda c, g, r: ub.Pressure(g, 0.0, -1e4)),
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
    "turn": ("connectors", lambda c, g, r: ub.Turn(ub.ground(8, 0), r.middle, SPRING)),
    "stretch": ("connectors", lambda c, g, r: ub.Stretch(ub.ground(8, 0), r.middle, SPRING)),
    "slide": ("connectors", lambda c, g, r: ub.Slide(ub.ground(8, 0), r.middle, SPRING)),
}
"""Objects of each kind; each law of connectors is in `test_symbols.py`."""


@pytest.fixture(scope="module")
def amount_without():
    return amount(ub.plot(frame()))


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_is_drawn(name, amount_without):
    part, make = OBJECTS[name]
    assert amount(ub.plot(frame(**{part: lambda *beams: [make(*beams)]}))) > amount_without


def test_beams_run_through_their_vertices_and_have_names():
    arc = ub.Beam.arc((0, 0), 2.0, (0.0, 1.0), STEEL, cells=6, name="arc")
    rods = [ub.Beam((3, y), (5, y), STEEL, cells=3, name="rod") for y in (0, 1)]
    figure = ub.plot(ub.Scene([arc, *rods]))
    for drawn, beam in zip(outlines(figure, "beams"), [arc, *rods], strict=True):
        np.testing.assert_array_equal(drawn, [beam.curve(s) for s in beam.vertices(())])
    assert sorted(texts(figure)) == ["arc", "rod 1", "rod 2"]  # numbers of scene.beams
    assert len(outlines(figure, "cells")) == 5 + 2 + 2
    assert figure.axes[0].get_title(loc="left") == "model: 3 beams, 12 cells"


def test_labels_have_sizes_with_units():
    figure = ub.plot(
        frame(
            loads=lambda c, g, r: [
                ub.PointLoad(g.end, force=(3e3, -4e3)), ub.FollowerLoad(c.end, moment=-20.0),
                ub.LineLoad(g, force=(0, -1e4), amplitude=ub.ramp(1.0)), ub.Gravity(),
            ],
            masses=lambda c, g, r: [ub.PointMass(c.at(0.5), 50.0)],
            initial=lambda c, g, r: [ub.Velocity([r], linear=(3, 4))],
            supports=lambda c, g, r: [
                ub.PrescribedDisplacement(c.start, u=0.01, v=0.0, psi=lambda t: t)
            ],
            connectors=lambda c, g, r: [ub.Turn(ub.ground(7, 1), r.middle, ub.Stop(1e3, low=-0.1))],
        )
    )  # fmt: skip
    assert {*texts(figure)} >= {
        "column", "girder", "rotor, 3 kg", "5 kN", "10 kN/m × f(t)", "20 N m, follows", "50 kg",
        "g = 9.81 m/s²", "5 m/s", "u = 10 mm", "ψ(t)", "stop ≥ −0.1 rad",
    }  # fmt: skip


@pytest.mark.parametrize(("force", "end"), [((0, -2), "tip"), ((3, 0), "tail"), ((-3, 0), "tip")])
def test_arrows_end_where_they_push_and_begin_where_they_pull(force, end):
    figure = ub.plot(cantilever(force=force))
    (line,) = outlines(figure, "loads", LineCollection)
    (head,) = outlines(figure, "loads", PolyCollection)
    way = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    np.testing.assert_allclose(way, np.array(force) / math.hypot(*force), atol=1e-12)
    nearest = {"tip": head[0], "tail": line[0]}[end]
    gap = np.linalg.norm(nearest - (1.0, 0.0))
    assert gap < 0.2 * np.linalg.norm(head[0] - line[0])
    assert np.allclose((nearest - (1.0, 0.0)) @ (-way[1], way[0]), 0.0, atol=1e-12)


def test_a_load_on_a_closed_ring_is_drawn_across_it():
    """Also dead loads: the chord of a ring is round-off and no direction."""

    def circle(s):
        return math.cos(2 * math.pi * s), math.sin(2 * math.pi * s)

    ring = ub.Beam.along(circle, STEEL, cells=16)
    joint, load = ub.Rigid(ring.end, ring.start), ub.LineLoad(ring, force=(0, -10.0))
    figure = ub.plot(clamped(ring, joints=[joint], loads=[load]))
    (line,) = outlines(figure, "loads", LineCollection, width=1.2)
    height = line[:, 1] - [circle(s)[1] for s in np.linspace(0, 1, len(line))]
    np.testing.assert_allclose(height, height[0], rtol=1e-9)
    assert height[0] > 0


def test_hinges_are_at_their_places():
    """Those of a beam, and those of a section in all cells and at the ends."""
    law = ub.Softening(2e4, 1e3)
    beam = ub.Beam((0, 0), (4, 0), STEEL, cells=4, hinges={0.0: law, 0.75: law})
    figure = ub.plot(clamped(beam))
    x, y = middles(figure, "hinges").T
    np.testing.assert_allclose(y, 0.0, atol=1e-9)
    assert 0.0 < min(x) < 0.3  # beside the clamp
    assert max(x) == pytest.approx(3.0)
    assert texts(figure).count("hinge 20 kN m") == 2
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0, hinge=law)
    beam = ub.Beam((0, 0), (4, 0), section, cells=4)
    figure = ub.plot(clamped(beam, ub.Clamped(beam.end)))
    assert len(outlines(figure, "hinges")) == 4 + 2
    assert texts(figure) == ["dots: hinges may form, from 20 kN m", "beam"]


def test_a_section_is_drawn_to_scale():
    """Outline and hole, core, layers and bars; mm from the axis of the beam."""
    cover, core, steel = (ub.Fibres(ub.ElastoPlastic(x), number=8) for x in (3e7, 4e7, 5e8))
    concrete = {"E": 30e9, "nu": 0.2, "fibres": cover, "core": core, "cover": 0.02}
    plain = st.box(0.4, 0.6, 0.1, **concrete)
    section = plain.reinforced([-0.25, 0.25], [2e-3, 1e-3], E=200e9, fibres=steel)
    axes = ub.plot(section).axes[0]
    outline, inset, *bars = axes.patches
    axis = section.fibres.axis * 1e3
    assert abs(axis) > 1
    for patch, sides in ((outline, (400, 600, 200, 400)), (inset, (360, 560, 240, 440))):
        outer, hole = (points for points in patch.get_path().to_polygons())
        assert [*np.ptp(outer, axis=0), *np.ptp(hole, axis=0)] == pytest.approx(sides)
        assert [x.mean() for x in (outer[:-1, 1], hole[:-1, 1])] == pytest.approx([-axis, -axis])
    assert [bar.center[1] for bar in bars] == pytest.approx([-250 - axis, 250 - axis])
    assert [np.pi * bar.radius**2 for bar in bars] == pytest.approx([2e3, 1e3])
    layers = [len(lines.get_segments()) for lines in axes.collections]
    assert layers == [(section.fibres.material == k).sum() for k in (1, 2)]
    assert axes.get_aspect() == 1.0
    discs = ub.Section.of_fibres([0, 0.1], [1e-4, 2e-4], E=1e9, nu=0.3, fibres=steel)
    assert len(ub.plot(discs).axes[0].patches) == 2
    ipe = ub.plot(st.steel("IPE 300")).axes[0]
    assert ipe.get_title(loc="left") == "A = 53.81 cm², I = 8356 cm⁴,\nWpl = 628.4 cm³"
    with pytest.raises(ub.ArgumentError, match="this Section has stiffnesses only"):
        ub.plot(ub.Section(EA=1.0, GA=1.0, EI=1.0))


@pytest.mark.parametrize(
    ("shown", "options", "words"),
    [
        (3, {}, "3 is a int, which has no picture; there are pictures of Scene, Section, "),
        (portal(), {"quantity": "M"}, "of a Scene is not one of model; a scene has none before"),
        (portal(), {"n": 3}, "unexpected keyword argument 'n'; the picture 'model' takes ax"),
    ],
)
def test_wrong_arguments_of_a_model_picture_are_refused(shown, options, words):
    with raises("plot: ", words):
        ub.plot(shown, **options)
