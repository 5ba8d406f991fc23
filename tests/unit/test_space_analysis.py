# SPDX-License-Identifier: MIT
"""Analyses in space: vibration, buckling, mechanisms, paths, derivatives of runs."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ufl_beam as ub

EXACT = ub.Newton(rtol=1e-13)
SKEW = Rotation.from_rotvec([0.3, -0.7, 1.1])
STIFF = {"EA": 1e4, "GA": 1e4, "EI": 500.0, "rhoA": 1.0, "rhoI": 10.0}
OTHER = {"GA3": 7e3, "EI2": 300.0, "GJ": 400.0, "rhoI2": 6.0}


def in_turned_plane(x, y):
    return tuple(SKEW.apply([x, y, 0.0]))


def in_plane(x, y):
    return x, y


def frame(at, loads=()):
    """Two beams with a rigid joint, held at both ends; the loads act at the joint."""
    flat = len(at(0, 0)) == 2
    section = ub.Section(**STIFF, **{} if flat else OTHER)
    up = [{} if flat else {"up": at(*x)} for x in ((1, 1), (0, 1))]
    long = ub.Beam(at(6, 0), at(0, 8), section, cells=6, **up[0])
    short = ub.Beam(at(0, 8), at(3, 9), section, cells=3, **up[1])
    ball = ub.Body(at(3.5, 9), mass=30.0, inertia=5.0 if flat else (5.0, 5.0, 5.0))
    joints = [ub.Rigid(long.end, short.start), ub.Rigid(short.end, ball.at(*at(3, 9)))]
    push = [ub.PointLoad(long.end, force=at(*x), amplitude=lambda t: t) for x in loads]
    return ub.Scene(
        [long, short], bodies=[ball], joints=joints, supports=[ub.Clamped(long.start)], loads=push
    )


def flat_modes(shapes):
    """Return the modes whose displacements are in the turned plane."""
    nodes = shapes.numbering.dofs[:, :3]
    moved = np.array([SKEW.inv().apply(shapes.shapes[nodes, k]) for k in range(len(shapes))])
    return np.abs(moved[..., 2]).max(axis=1) < 1e-6 * np.abs(moved).max(axis=(1, 2))


@pytest.mark.parametrize("loads", [(), ((3.0, -8.0),)])
def test_planar_modes_in_a_turned_plane(loads):
    """Modes of the planar frame are among those in space, undeformed and about a static state."""
    both, found = [], []
    for at in (in_plane, in_turned_plane):
        scene, state = frame(at, loads), None
        if loads:
            state = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=EXACT, progress=False)
        both.append(ub.modes(scene, 4 if at is in_plane else 12, at=state))
    plane, space = both
    found = space.omega[flat_modes(space)]
    assert np.abs(found[:4] / plane.omega - 1).max() < 1e-9
    assert space.omega.min() < 0.99 * plane.omega.min()  # out of the plane


def test_planar_buckling_in_a_turned_plane():
    column, push = [], (0.0, -1.0)
    for at in (in_plane, in_turned_plane):
        flat = at is in_plane
        section = ub.Section(**STIFF, **{} if flat else OTHER | {"EI2": 800.0})
        beam = ub.Beam(at(0, 0), at(0, 5), section, cells=6, **{} if flat else {"up": at(1, 0)})
        load = ub.PointLoad(beam.end, force=at(*push))
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        column.append(ub.buckling(scene, 1).factors[0])
    assert abs(column[1] / column[0] - 1) < 1e-8


L = 2.0
NARROW = ub.Section(
    EA=1.05e7, GA=3.5e6, GA3=3.5e6, EI=2187.5, EI2=0.875, GJ=1.35, rhoA=0.4, rhoI=8e-5, rhoI2=4e-8
)
"""A strip of 1 x 50 mm; axis 2 is along its height."""


def extrapolated(values, order=2):
    """Return values on halved cells without their error of second order."""
    coarse, fine = values
    return fine + (fine - coarse) / (2**order - 1)


def strip(cells, section=NARROW, **more):
    beam = ub.Beam((0, 0, 0), (L, 0, 0), section, cells=cells)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], **more), beam


def omega_along(shapes, component, count):
    """Return frequencies of modes whose largest motion is a component of the nodes."""
    moves = np.abs(shapes.shapes[shapes.numbering.dofs]).max(axis=0)  # (6, n)
    return shapes.omega[moves.argmax(axis=0) == component][:count]


@pytest.mark.parametrize("component", [1, 2])
def test_frequencies_about_both_axes(component):
    """Bending of a cantilever, against closed forms of slender beams."""
    section = ub.Section(
        EA=1e8, GA=1e8, GA3=1e8, EI=90.0, EI2=40.0, GJ=50.0, rhoA=1.0, rhoI=1e-6, rhoI2=1e-6
    )
    found = []
    for cells in (16, 32):
        shapes = ub.modes(strip(cells, section)[0], 8)
        moves = np.abs(shapes.shapes[shapes.numbering.dofs[:, 1:3]]).max(axis=0)
        found.append(shapes.omega[moves[component - 1] > 0.5][:2])
    β = np.array([1.8751040687, 4.6940911330]) / L
    exact = β**2 * np.sqrt(40.0 if component == 1 else 90.0)
    assert np.abs(extrapolated(found) / exact - 1).max() < 1e-4


def test_frequencies_of_torsion_and_stretch():
    section = ub.Section(
        EA=4e4, GA=1e9, GA3=1e9, EI=1e3, EI2=1e3, GJ=3e4, rhoA=1.0, rhoI=0.7, rhoI2=0.3
    )
    found = [ub.modes(strip(cells, section)[0], 8) for cells in (16, 32)]
    for speed, component in ((np.sqrt(4e4), 0), (np.sqrt(3e4), 3)):
        omega = [omega_along(shapes, component, 1)[0] for shapes in found]
        assert abs(extrapolated(omega) / (np.pi * speed / (2 * L)) - 1) < 1e-5


def test_lateral_buckling_of_a_cantilever():
    """Bending before buckling changes the factor by about EI2/EI and GJ/EI."""
    exact = 4.012599 * np.sqrt(NARROW.EI2 * NARROW.GJ) / L**2
    found = []
    for cells in (8, 16):
        scene, beam = strip(cells)
        push = ub.PointLoad(beam.end, force=(0, 0, -1.0))
        shapes = ub.buckling(ub.Scene([beam], supports=scene.supports, loads=[push]), 2)
        assert np.allclose(*np.abs(shapes.factors), rtol=1e-7)
        assert (shapes.errors < 1e-6).all()
        found.append(np.abs(shapes.factors[0]))
    assert abs(extrapolated(found) / exact - 1) < (NARROW.EI2 + NARROW.GJ) / NARROW.EI + 1e-4


def test_buckling_in_uniform_bending():
    """Fork ends; constant moments at both ends."""
    exact, found = np.pi * np.sqrt(NARROW.EI2 * NARROW.GJ) / L, []
    held = ub.PrescribedMotion(lambda t: 0.0)
    for cells in (8, 16):
        beam = ub.Beam((0, 0, 0), (L, 0, 0), NARROW, cells=cells)
        ends = (ub.ground(0, 0, 0), beam.start), (ub.ground(L, 0, 0), beam.end)
        forks = [ub.Turn(*end, held, axis=(1, 0, 0)) for end in ends]
        forks += [ub.Slide(*ends[1], held, axis=axis) for axis in ((0, 1, 0), (0, 0, 1))]
        scene = ub.Scene(
            [beam], joints=[ub.Spherical(*ends[0])], connectors=forks,
            loads=[
                ub.PointLoad(beam.start, moment=(0, 1.0, 0)),
                ub.PointLoad(beam.end, moment=(0, -1.0, 0)),
            ],
        )  # fmt: skip
        found.append(abs(ub.buckling(scene, 1).factors[0]))
    assert abs(extrapolated(found) / exact - 1) < (NARROW.EI2 + NARROW.GJ) / NARROW.EI + 1e-4


def test_a_square_column_buckles_about_both_axes():
    section = ub.Section(**STIFF | OTHER | {"EI": 500.0, "EI2": 500.0, "GA3": 1e4})
    beam = ub.Beam((0, 0, 0), (3, 4, 12), section, cells=8)
    push = ub.PointLoad(beam.end, force=(-3 / 13, -4 / 13, -12 / 13))
    found = ub.buckling(ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push]), 2)
    assert abs(found.factors[0] / found.factors[1] - 1) < 1e-9
    weak = ub.Section(**STIFF | OTHER | {"EI2": 200.0})
    both = []
    for cells in (8, 16):
        beam = ub.Beam((0, 0, 0), (3, 4, 12), weak, cells=cells)
        push = ub.PointLoad(beam.end, force=(-3 / 13, -4 / 13, -12 / 13))
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        both.append(ub.buckling(scene, 1).factors[0])
    euler = np.pi**2 * 200.0 / (4 * 13.0**2)
    assert abs(extrapolated(both) / euler - 1) < 2 * euler / 7e3 + 1e-4  # shear


def test_frequencies_vanish_at_the_buckling_load():
    """Modes about loaded states, at stored states before the last one, too."""
    scene, beam = strip(8)
    (factor,) = ub.buckling(
        ub.Scene(
            [beam], supports=scene.supports, loads=[ub.PointLoad(beam.end, force=(-1.0, 0, 0))]
        ), 1,
    ).factors  # fmt: skip
    push = ub.PointLoad(beam.end, force=(-factor, 0, 0), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=scene.supports, loads=[push])
    run = ub.simulate(scene, ub.Static(), t=(0, 0.999), dt=0.333, newton=EXACT, progress=False)
    squares = [ub.modes(scene, 1, at=(run, n)).omega[0] ** 2 for n in range(4)]
    assert squares[3] < 2e-3 * squares[0]
    assert np.all(np.diff(squares) < 0)


def test_pictures_and_files_of_modes(shared_path):
    shapes = ub.modes(strip(4)[0], 3)
    swing = shapes.motion(1, count=8)
    (beam,) = shapes.scene.beams
    tip = swing.displacement(beam.end)
    assert np.abs(tip[0, :3]).max() == pytest.approx(0.1 * L)
    assert np.abs(tip[4] + tip[0]).max() < 1e-12
    assert shapes.shape(1, beam.end).shape == (6,)
    shapes.write(shared_path / "modes.hdf")


def mechanisms():
    beam = ub.Beam((0, 0, 0), (1, 2, 0), ub.Section(**STIFF, **OTHER), name="arm")
    ball = ub.Body((1, 2, 1), mass=1.0, inertia=(1, 1, 1), name="ball")
    base, held = ub.ground(0, 0, 0), [ub.Clamped(beam.start)]
    return {
        "free": ({}, "6 independent ways"),
        "pinned": ({"supports": [ub.Pinned(beam.start)]}, "3 independent ways"),
        "turning": (
            {"joints": [ub.Revolute(base, beam.start, axis=(1, 1, 0))]},
            "turn about the axis (0.707, 0.707, 0) through (0, 0, 0)",
        ),
        "sliding": (
            {"joints": [ub.Prismatic(base, beam.start, axis=(0, 0, 1))]},
            "1 way, so statics has no unique answer: arm (beam 0) can shift along (0, "
        ),
        "hanging": (
            {"supports": held, "bodies": [ball], "joints": [ub.Link(beam.end, ball.middle)]},
            "5 independent ways",
        ),
        "loaded": (
            {"supports": [ub.Pinned(beam.start)], "loads": [ub.Gravity((1, 2, 0))]},
            "1 way, so statics has no unique answer: arm (beam 0) can turn about the axis",
        ),
    } | {
        name: (more | {"beams": [beam]}, words)
        for name, (more, words) in {"resisting": ({"supports": held}, "")}.items()
    }, beam  # fmt: skip


@pytest.mark.parametrize("case", mechanisms()[0])
def test_mechanisms_in_statics(case):
    cases, beam = mechanisms()
    parts, words = cases[case]
    scene = ub.Scene(**{"beams": [beam]} | parts)
    if not words:
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, progress=False)
        return
    with pytest.raises(ub.ModelError, match=re.escape(words)):
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, progress=False)


def test_a_pendulum_hangs_in_statics():
    """Weight holds a revolute joint; the first tangent, without loads, is singular."""
    beam = ub.Beam((0, 0, 0), (0, 0, -3), ub.Section(**STIFF, **OTHER), cells=3, up=(0, 1, 0))
    joint = ub.Revolute(ub.ground(0, 0, 0), beam.start, axis=(1, 0, 0))
    loads = [
        ub.Gravity((0, 0, -9.81)),
        ub.PointLoad(beam.end, force=(0, 0.1, 0), amplitude=lambda t: t),
    ]
    scene = ub.Scene([beam], joints=[joint], loads=loads)
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=EXACT, progress=False)
    shape = run.shape(beam)
    weight = 9.81 * (shape[:-1] + shape[1:]) / 2  # of cells of 1 m and 1 kg
    assert abs(weight[:, 1].sum() + 0.1 * shape[-1, 2]) < 1e-9
    assert shape[-1, 1] > 0.01
