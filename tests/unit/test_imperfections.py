# SPDX-License-Identifier: MIT
"""Initial imperfections: scenes in another geometry without stress."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises, run
from scenes import clamped, portal

import ufl_beam as ub
import ufl_beam.structures as st

L, EI = 2.0, 100.0
SECTION = ub.Section(EA=1e8, GA=1e8, EI=EI, rhoA=1.0)
EULER = math.pi**2 * EI / L**2


def pinned_column(load):
    column = ub.Beam((0, 0), (0, L), SECTION, cells=16, name="column")
    supports = [ub.Pinned(column.start), ub.Roller(column.end, along=(0, 1))]
    loads = [ub.PointLoad(column.end, (0, -load))]
    return ub.Scene([column], supports=supports, loads=loads)


@pytest.mark.parametrize(("ratio", "by_mode"), [(0.3, False), (0.8, True)])
def test_a_bow_is_amplified(ratio, by_mode):
    """[closed] The bow e₀ of a column grows to e₀/(1 - P/P_cr).

    The load is a fraction of the buckling load of the mesh, whose mode is the half sine at its
    vertices, so that the errors are of large motion, (π e/L)² of the deflection e = e₀/(1 - ratio).
    """
    force = ratio * ub.buckling(pinned_column(1.0), 1).factors[0]
    scene, e = pinned_column(force), L / 2000
    if by_mode:
        crooked = st.imperfect(scene, mode=ub.buckling(scene, 1), amplitude=e)
    else:
        crooked = st.imperfect(scene, bow={scene["column"]: 1 / 2000})
    column = crooked["column"]
    assert abs(column.curve(0.5)[0]) == pytest.approx(e, rel=1e-9)
    found = run(crooked, ub.Static(), dt=0.5, newton=ub.Newton(rtol=1e-12))
    total = abs(found.position(column.at(0.5))[-1, 0])
    assert total == pytest.approx(e / (1 - ratio), rel=2 * (math.pi * e / L / (1 - ratio)) ** 2)
    M = np.abs(found.diagram(column).M).max()
    assert pytest.approx(force * total, rel=1e-6) == M


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_the_amplitude_of_a_mode_does_not_depend_on_axes(angle):
    """It is the largest distance that a point moves."""
    end = np.array([math.cos(angle), math.sin(angle)]) * L
    column = ub.Beam((0, 0), tuple(end), SECTION, cells=4, name="column")
    load = ub.PointLoad(column.end, tuple(-end))
    scene = ub.Scene([column], supports=[ub.Clamped(column.start)], loads=[load])
    crooked = st.imperfect(scene, mode=ub.buckling(scene, 1), amplitude=0.01)
    assert math.dist(crooked["column"].curve(1.0), end) == pytest.approx(0.01, rel=1e-9)


def test_sway_of_a_cantilever():
    """[closed] M = P φ L tan(κL)/κL with κ² = P/EI, for small rotations; the mesh adds (κh)²/12."""
    load, φ = 0.15 * EULER, 1e-4
    column = ub.Beam((3, 1), (3, 1 + L), SECTION, cells=20, name="column")
    scene = clamped(column, loads=[ub.PointLoad(column.end, (0, -load))])
    leaning = st.imperfect(scene, sway=φ)
    assert leaning["column"].start.point == (3, 1)
    assert leaning["column"].end.point == pytest.approx((3 + φ * L, 1 + L), abs=1e-15)
    moment = run(leaning, ub.Static(), dt=1.0).reaction(leaning.supports[0])[-1, 2]
    κL = math.sqrt(load / EI) * L
    assert moment == pytest.approx(load * φ * L * math.tan(κL) / κL, rel=(κL / 20) ** 2)


def test_nothing_moves_without_loads():
    """An imperfect frame is free of stress, and its sway is that of all of its points."""
    scene = portal(H=0.0, V=0.0)
    left = scene.beams[0]
    crooked = st.imperfect(scene, sway=0.01, bow={left: 0.02})
    assert not run(crooked, ub.EnergyMomentum(), dt=0.5).q.any()
    for old, new in zip(scene.beams, crooked.beams, strict=True):
        assert old.name == new.name
        for s in (0.0, 0.3, 1.0):
            x, y = old.curve(s)
            moved = np.subtract(new.curve(s), (x + 0.01 * y, y))
            wave = 0.02 * math.dist(*old.ends) * math.sin(math.pi * s) if old is left else 0.0
            assert np.hypot(*moved) == pytest.approx(wave, abs=1e-14)


@pytest.mark.parametrize("by_mode", [False, True])
def test_a_scene_with_everything_keeps_its_objects(by_mode):
    """Bodies, connectors, joints and loads refer to the new beams; forces are nearly the same."""
    column = ub.Beam((0, 0), (0, L), SECTION, cells=4, name="column")
    girder = ub.Beam((0, L), (L, L), SECTION, cells=4, name="girder")
    weight = ub.Body((L + 0.2, L), mass=2.0, inertia=0.1, name="weight")
    pin = ub.Revolute(girder.end, weight.at(L, L))
    scene = ub.Scene(
        [column, girder],
        bodies=[weight],
        joints=[ub.Rigid(column.end, girder.start), pin],
        supports=[ub.Clamped(column.start)],
        loads=[
            ub.Gravity(),
            ub.LineLoad(girder, (0, -2), span=(0.2, 0.8), profile=lambda s: s),
            ub.Pressure(column, 3.0),
            ub.MovingLoad(girder, lambda t: t, (0, -1)),
            ub.FollowerLoad(weight.middle, (1, 0)),
        ],
        masses=[ub.PointMass(girder.at(0.5), 1.0)],
        initial=[ub.Velocity([girder], linear=(0.0, 0.0))],
        damping=[ub.KelvinVoigt(1e-4, [girder])],
        connectors=[
            ub.Stretch(ub.ground(1, 0), girder.at(0.5), ub.Spring(50.0)),
            ub.Turn(girder.end, weight.middle, ub.Spring(10.0)),
        ],
        works=[
            ub.Potential("soil", lambda q, k: k * q[0] ** 2, beams=[column], numbers={"k": 5.0})
        ],
    )
    mode = ub.modes(replace(scene, loads=[], damping=[]), 1) if by_mode else None
    new = st.imperfect(scene, sway=1e-6, mode=mode, amplitude=1e-6)
    assert new.joints[1].places[1].body is new["weight"] is new.bodies[0]
    assert new.works[0].beams[0] is new["column"]
    assert new.connectors[0].b.beam is new.loads[1].beam is new["girder"]
    end = [run(x, t=(0, 0.2), dt=0.02).displacement(x["girder"].end)[-1] for x in (scene, new)]
    assert end[0] == pytest.approx(end[1], abs=1e-4 * np.abs(end[0]).max())


def test_wrong_imperfections():
    scene = pinned_column(1.0)
    column, mode = scene["column"], ub.modes(scene, 1)
    whirling = replace(scene, connectors=[ub.Turn(ub.ground(0, 0), column.start, ub.Damper(0.1))])
    whirl = ub.modes(whirling, 1)
    stray = ub.Beam((0, 0), (1, 0), SECTION)
    tee = ub.Beam((0, 1), (1, 1), SECTION)
    joined = ub.Scene([column, tee], joints=[ub.Rigid(column.at(0.5), tee.start)])
    for of, change, message in [
        (scene, {}, "nothing changes the geometry"),
        (scene, {"mode": mode}, "nothing changes the geometry"),
        (scene, {"bow": {stray: 0.1}}, "is not in the scene"),
        (joined, {"bow": {column: 0.1}}, "is between its ends; divide the beam"),
        (joined, {"mode": mode, "amplitude": 1.0}, "mode is of other beams"),
        (scene, {"mode": mode, "k": 1, "amplitude": 1.0}, "no shape 1"),
        (whirling, {"mode": whirl, "amplitude": 1.0}, "mode 0 is complex; its phases differ"),
    ]:
        with raises(message):
            st.imperfect(of, **change)
