# SPDX-License-Identifier: MIT
"""Guide curves: functions in UFL, splines, and the equations that hold a point on them."""

import math

import numpy as np
import pytest
import ufl

import ufl_beam as ub
from ufl_beam.blocks.guides import GuideBlock

SECTION = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=0.01)


def scene(curve, **more):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
    return ub.Scene(
        [beam],
        joints=[ub.Guided(beam.end, curve)],
        supports=[ub.Roller(beam.start, along=(1, 0))],
        loads=[ub.Gravity(), ub.PointLoad(beam.end, (5.0, 0.0), amplitude=lambda t: min(t, 0.1))],
        **more,
    )


def wave(s):
    return 1.0 + s, 0.2 * ufl.sin(3 * s)


def cubic(s):
    return 1.0 + s + 0.3 * s**2, 0.4 * s - 0.5 * s**2 + 0.7 * s**3


def through(curve, count, reach=2.0):
    """A spline through points of a curve, at unequal parameters, of which one is zero."""
    s = np.linspace(-1.0, 1.0, 2 * count + 1)
    s = reach * (s + 0.3 * s**3) / 1.3
    return ub.Spline(
        [tuple(float(ufl.as_ufl(x)) for x in curve(p)) for p in s.tolist()], s.tolist()
    )


def run(guided, scheme=None, t=(0, 0.4), dt=0.01, **options):
    return ub.simulate(guided, scheme or ub.EnergyMomentum(), t=t, dt=dt, **options)


def block(simulation):
    (one,) = (x for x in simulation.connector_terms if isinstance(x, GuideBlock))
    return one


# -- curves ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "curve",
    [
        lambda s: (1 + s, math.sin(s)), lambda s: (1 + s, np.sin(s)), lambda s: (float(s), 0.0),
        lambda s: (1 + s, s) if s < 1 else (2.0, 1.0),
    ],
)  # fmt: skip
def test_a_curve_that_needs_a_number_is_refused_with_a_remedy(curve):
    beam = ub.Beam((0, 0), (1, 0), SECTION, name="girder")
    with pytest.raises(ub.ModelError, match=r"Guided\(girder.end .*ufl.cos\(s\) instead of math"):
        ub.Guided(beam.end, curve)


@pytest.mark.parametrize(
    "point", [None, (1.0,), (1.0, 2.0, 3.0), ("x", 0.0), 1.0, (ufl.as_vector([1.0, 2.0]), 0.0)]
)
def test_a_curve_must_return_a_point(point):
    with pytest.raises(ub.ModelError, match="no point"):
        scene(lambda s: point)


@pytest.mark.parametrize("kind", [list, ufl.as_vector, lambda p: (np.float64(1.0) * p[0], p[1])])
def test_a_curve_returns_any_two_expressions(kind):
    np.testing.assert_array_equal(run(scene(lambda s: kind(wave(s)))).q, run(scene(wave)).q)


def test_a_curve_is_called_once():
    calls = []

    def counted(s):
        calls.append(s)
        return wave(s)

    run(scene(counted))
    assert len(calls) == 1


@pytest.mark.serial  # one process has the guide
def test_curves_that_differ_in_numbers_share_functions():
    """And splines with any number of points."""
    pairs = [
        [lambda s, a=a: (1.0 + a * s, a * ufl.cos(s) - a) for a in (0.7, 0.3)],
        [through(cubic, count) for count in (5, 50)],
    ]
    for pair in pairs:
        one, other = (block(ub.Simulation(scene(x), ub.EnergyMomentum())) for x in pair)
        assert one.statement == other.statement
        assert one._kernels is other._kernels


@pytest.mark.parametrize(
    ("points", "s", "wrong"),
    [
        ([(0, 0)], None, "1 points"), ([(0, 0), (1, 0)], [0, 1, 2], "3 parameters s"),
        ([(0, 0), (1, 0)], [1, 0], "s must increase"), ([(0, 0), (0, 0)], None, "s must increase"),
    ],
)  # fmt: skip
def test_splines_are_checked(points, s, wrong):
    with pytest.raises(ub.ModelError, match=wrong):
        ub.Spline(points, s)


def test_parameters_of_a_spline_are_sums_of_distances():
    assert ub.Spline([(0, 0), (3, 4), (3, 6)]).s == (0.0, 5.0, 7.0)


# -- motion ----------------------------------------------------------------------------------------


def test_a_place_stays_on_its_curve():
    """Without drift, and the force does no work."""
    guided = scene(wave)
    solution = run(guided)
    u, v, _ = solution.displacement(guided.beams[0].end).T
    assert np.abs(v - 0.2 * np.sin(3 * u)).max() < 1e-12  # some last digits of a metre
    assert np.abs(u).max() > 0.1
    assert solution.energy.worst < 1e-11


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.GeneralizedAlpha(0.8)], ids=str)
@pytest.mark.parametrize("dt", [0.01, 0.05])
def test_a_spline_through_points_of_a_cubic_is_the_cubic(scheme, dt):
    """Its segments, of which several are passed in a step, are one polynomial, to round-off."""
    whole, parts = (run(scene(x), scheme, dt=dt).q for x in (cubic, through(cubic, 40)))
    assert np.abs(whole).max() > 0.1
    assert np.abs(whole - parts).max() < 1e-9 * np.abs(whole).max()


@pytest.mark.parametrize("curve", [wave, through(wave, 30)], ids=["UFL", "spline"])
@pytest.mark.parametrize("dt", [1e-5, 1e-3, 1e-2, 3e-2])
def test_force_of_a_guide_is_normal_to_the_chord(curve, dt):
    """For short chords too, whose own direction has few digits; the work is round-off."""
    guided = scene(curve)
    solution = run(guided, t=(0, 20 * dt), dt=dt)
    force, at = solution.joint(guided.joints[0]).force, solution.position(guided.beams[0].end)
    work = (force[1:] * np.diff(at, axis=0)).sum(axis=1)
    # Two points with two last digits of the size each
    assert np.abs(work).max() < 8 * np.spacing(2.0) * np.abs(force).max()
    assert np.abs(force).max() > 0.5


@pytest.mark.parametrize("curve", [wave, through(wave, 30)], ids=["UFL", "spline"])
def test_a_run_goes_on_where_another_one_ended(curve):
    """The parameter and the point of the curve are saved."""
    guided = scene(curve)
    whole, first = run(guided), run(guided, t=(0, 0.2))
    second = run(guided, t=(0.2, 0.4), start=first)
    assert np.abs(whole.q[-1] - second.q[-1]).max() < 1e-11 * np.abs(whole.q).max()


def test_a_loaded_scene_has_a_spline_that_goes_the_same_way(shared_path):
    solution = run(scene(wave))
    solution.save(shared_path / "guided.h5")
    (joint,) = ub.Solution.load(shared_path / "guided.h5").scene.joints
    again = run(scene(joint.curve))
    # Splines of a thousand segments err by their fourth power
    assert np.abs(solution.q - again.q).max() < 1e-9 * np.abs(solution.q).max()


# -- derivatives -----------------------------------------------------------------------------------


def of_numbers(a=0.4, b=3.0):
    return scene(lambda s: (1.0 + s, a * ufl.sin(b * s)))


def of_a_structure(a=1.0, b=3.0):
    """UFL drops the factor 1, so that neighbouring curves have another structure."""
    return of_numbers(a, b)


def of_points(a=0.4, b=3.0):
    s = np.linspace(-1, 1, 21)
    return scene(ub.Spline(np.column_stack([1.0 + s, a * np.sin(b * s)]).tolist(), s.tolist()))


@pytest.mark.serial
@pytest.mark.parametrize("model", [of_numbers, of_a_structure, of_points])
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.GeneralizedAlpha(0.8)], ids=str)
def test_derivatives_by_curves(model, scheme):
    """Direct against central differences of runs, and the adjoint against both."""
    a, b = model.__defaults__
    options = {"t": (0, 0.3), "dt": 0.02, "newton": ub.Newton(rtol=1e-12)}
    found = ub.differentiate(model, {"a": a, "b": b}, scheme, **options).of(
        lambda run: run.q[:, :-1]  # without the force, whose round-off is masses / dt² as large
    )
    for k, name in enumerate("ab"):
        h = 1e-3
        runs = [
            ub.simulate(model(**{"a": a, "b": b} | {name: value + d}), scheme, **options).q[:, :-1]
            for value in [(a, b)[k]] for d in (-2 * h, -h, h, 2 * h)
        ]  # fmt: skip
        difference = (runs[0] - 8 * runs[1] + 8 * runs[2] - runs[3]) / (12 * h)
        # Runs have 1e-12 of the forces, divided by h
        assert np.abs(found[..., k] - difference).max() < 1e-9 * np.abs(difference).max()
    _, whole = ub.gradient(model, {"a": a, "b": b}, scheme, **options, of=lambda run: run.q[:, 4])
    np.testing.assert_allclose(whole, found[-1, 4], rtol=1e-8)
