# SPDX-License-Identifier: MIT
"""Load combinations: closed forms of a cantilever, runs of the scene, combinations that fail."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises, run
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

SECTION = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
L = 2.0  # m
BEAM = ub.Beam((0, 0), (L, 0), SECTION, cells=2, name="cantilever")
CLAMPED = ub.Clamped(BEAM.start)
SCENE = ub.Scene([BEAM], supports=[CLAMPED])
CASES = {
    "dead": [ub.LineLoad(BEAM, force=(0, -1.0))],  # N/m: so small that the beam stays straight
    "live": [ub.PointLoad(BEAM.end, force=(0, -2.0), amplitude=lambda t: 0.5 * t)],  # 1 N at 1 s
    "wind": [ub.PointLoad(BEAM.end, force=(3.0, 4.0))],
}
COMBINATIONS = {
    "ULS 1": {"dead": 1.35, "live": 1.5},
    "ULS 2": {"dead": 1.0, "wind": 1.5},
    "SLS": {"dead": 1.0, "live": 1.0, "wind": 0.1},
}


def by_hand(x, dead, live=0.0, wind=0.0):
    """N, V, M of the cantilever at x by statics."""
    down, arm = live - 4.0 * wind, L - x
    return 3.0 * wind, -dead * arm - down, -dead * arm**2 / 2 - down * arm


def test_the_envelope_of_a_cantilever():
    """[closed] Deflections are 1e-7 of the length, so forces agree to 1e-6 of the largest, 15."""
    found = st.load_combinations(SCENE, CASES, COMBINATIONS)
    assert ([*found.solutions], found.failed) == ([*COMBINATIONS], {})
    names, reached = np.array([*COMBINATIONS]), found.section_forces(BEAM, points=3)
    for row, x in ((0, 0.0), (1, L / 4), (5, L)):  # two cells with three points each
        table = np.array([by_hand(x, **factors) for factors in COMBINATIONS.values()])
        np.testing.assert_allclose(reached.low[row], table.min(axis=0), rtol=1e-6, atol=1.5e-5)
        np.testing.assert_allclose(reached.high[row], table.max(axis=0), rtol=1e-6, atol=1.5e-5)
        if x < L:  # at the end moments of all combinations are zero
            assert (reached.low_by[row] == names[table.argmin(axis=0)]).all()
            assert (reached.high_by[row] == names[table.argmax(axis=0)]).all()
    support = found.reaction(CLAMPED)
    np.testing.assert_allclose(support.high[1], 2 * 1.35 + 1.5, rtol=1e-6)
    assert (support.high_by[1], support.low_by[0]) == ("ULS 1", "ULS 2")
    assert found.displacement(BEAM.end).high_by[1] == "ULS 2"
    assert "low_by=['ULS 2', 'ULS 2', 'ULS 2']" in repr(support)
    assert str(found).splitlines()[3].split() == (
        ["cantilever", "M", "-0.01", "kN", "m", "ULS", "1", "0.01", "kN", "m", "ULS", "2"]
    )


def test_combinations_are_runs_of_the_scene():
    """A plastic hinge: results cannot be superposed; loads of the scene act in each combination."""
    hinged = ub.Beam((0, 0), (L, 0), SECTION, hinges={0.0: ub.ElastoPlastic(1e5, isotropic=1e6)})
    cases = {"tip": [ub.PointLoad(hinged.end, force=(0, -6e4))]}
    scene, rows = clamped(hinged, loads=[ub.Gravity()]), {"half": {"tip": 0.5}, "all": {"tip": 1.0}}
    found = st.load_combinations(scene, cases, rows, steps=5)
    for name, factor in (("half", 0.5), ("all", 1.0)):
        load = ub.PointLoad(hinged.end, (0, -6e4), amplitude=ub.Table((0, 1), (0, factor)))
        alone = replace(scene, loads=[ub.Gravity(), load])
        same = run(alone, ub.Static(), dt=0.2)
        np.testing.assert_allclose(found.solutions[name].q[-1], same.q[-1], rtol=1e-10, atol=1e-15)
    drop = found.envelope(lambda one: one.displacement(hinged.end)[-1, 1])
    assert (type(drop.low_by), drop.low_by) == (str, "all")
    assert drop.low < 2.5 * drop.high  # elastic: 2


@pytest.mark.parametrize("place", [0.3, 0.5])
def test_loads_between_vertices_are_in_the_envelope(place):
    """[closed] Forces and ends of line loads are vertices, here in one of two combinations each."""
    cases = {
        "P": [ub.PointLoad(BEAM.at(place), force=(0, -2.0))],
        "q": [ub.LineLoad(BEAM, force=(0, -1.0), span=(0.0, 0.7))],
    }
    combinations = {"1": {"P": 1.0}, "2": {"q": 1.0}}
    found = st.load_combinations(SCENE, cases, combinations)
    (s,) = {tuple(one.diagram(BEAM).s) for one in found.solutions.values()}
    arms = [np.maximum(end * L - np.array(s) * L, 0) for end in (place, 0.7)]
    moments = -2.0 * arms[0], -(arms[1] ** 2) / 2  # N m
    reached = found.section_forces(BEAM)
    np.testing.assert_allclose(reached.low[:, 2], np.minimum(*moments), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(reached.high[:, 2], np.maximum(*moments), rtol=1e-6, atol=1e-6)


def test_a_combination_without_equilibrium_is_named_and_left_out():
    """The hinge bears 1e5 N m, so that the tip bears 5e4 N."""
    hinge = ub.Softening(limit=1e5, fracture_energy=1e3)  # N m, J
    weak = ub.Beam((0, 0), (L, 0), SECTION, hinges={0.0: hinge})
    scene, cases = clamped(weak), {"P": [ub.PointLoad(weak.end, force=(0, -1e5))]}
    rows = {"much": {"P": 1.0}, "little": {"P": 0.4}}
    with pytest.warns(ub.ModelWarning, match=r"much: no equilibrium beyond 0\.5"):
        found = st.load_combinations(scene, cases, rows)
    assert ([*found.solutions], [*found.failed]) == (["little"], ["much"])
    assert found.failed["much"].startswith("no equilibrium beyond 0.5")
    assert "\n  much: no equilibrium beyond 0.5" in str(found)
    with raises("much: no equilibrium", kind=ub.ConvergenceError):
        st.load_combinations(scene, cases, {"much": {"P": 1.0}})


def test_mistakes_are_named():
    with raises("combinations['A']: 'wnd' is not a case; cases: dead, live, wind"):
        st.load_combinations(SCENE, CASES, {"A": {"wnd": 1.0}})
    with raises("cases['spin']: forces of a RotatingFrame have no factor"):
        st.load_combinations(SCENE, {"spin": [ub.RotatingFrame(rate=1.0)]}, {"A": {"spin": 1.0}})
    found = st.load_combinations(SCENE, CASES, COMBINATIONS)
    with raises("combination 'ULS 1' = None must be numbers"):
        found.envelope(lambda run: None)


def test_loads_that_act_twice_or_not_at_all_are_named():
    """Cases act with their values at 1 s; the scene's own loads act in all combinations."""
    loaded = replace(SCENE, loads=[ub.Gravity()])
    row = {"1": {"G": 1.0}}
    with pytest.raises(ub.ArgumentError, match=r"Gravity of cases\['G'\].*replace\(scene, loads"):
        st.load_combinations(loaded, {"G": loaded.loads}, row)
    quake = st.GroundMotion(0.01, [0, 1, 2, -1, 0]).acceleration
    for amplitude, said in (
        (quake, "no force at t = 1 s"),
        (lambda t: math.sin(math.pi * t), "no force at t = 1 s"),
        (ub.ramp(10.0), "amplitude 0.1 at t = 1 s, .* and 1 from 10 s"),
    ):
        case = [ub.Gravity((0, -1), amplitude=amplitude)]
        with pytest.warns(ub.ModelWarning, match=said):
            st.load_combinations(SCENE, {"G": case}, row)
    gone = ub.MovingLoad(BEAM, lambda t: 3.0 * t, (0, -1.0))
    with (
        pytest.warns(ub.ModelWarning, match="not on its beam at t = 1 s"),
        pytest.warns(ub.ModelWarning, match="never on its route"),
    ):
        st.load_combinations(SCENE, {"G": [gone]}, row)
    for amplitude in (lambda t: t, lambda t: 2.0, ub.ramp(1.0)):
        point = ub.PointLoad(BEAM.end, force=(0, -1e3), amplitude=amplitude)
        st.load_combinations(SCENE, {"G": [point]}, row)  # no warning is issued


def test_dampers_and_damping_bear_nothing():
    """And a moving load acts where it is at 1 s."""
    axle = ub.MovingLoad(BEAM, lambda t: t * L / 2, force=(0, -1.0))
    cases = {"axle": [axle], "side": [ub.PointLoad(BEAM.end, (0.5, 0.0))]}
    combinations = {"all": {"axle": 2.0, "side": 1.0}}
    brake = ub.Stretch(BEAM.start, BEAM.end, ub.Damper(1e9))
    damped = replace(SCENE, connectors=[brake], damping=[ub.KelvinVoigt(retardation_time=9.0)])
    runs = [
        st.load_combinations(scene, cases, combinations).solutions["all"]
        for scene in (damped, SCENE)
    ]
    np.testing.assert_allclose(runs[0].reaction(CLAMPED)[-1], (-0.5, 2.0, L), rtol=1e-6)
    ends = (found.displacement(BEAM.end)[-1] for found in runs)
    np.testing.assert_allclose(*ends, rtol=1e-8, atol=1e-15)
