# SPDX-License-Identifier: MIT
"""Guide curves: functions in UFL, splines, and the equations that hold a point on them."""

import math
from functools import partial

import numpy as np
import pytest
import ufl
from helpers import raises, run
from run_differences import CHANGES, differences, relative_error

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=10.0, rhoA=1.0, rhoI=0.01)
BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")


def scene(curve):
    return ub.Scene(
        [BEAM],
        joints=[ub.Guided(BEAM.end, curve)],
        supports=[ub.Roller(BEAM.start, along=(1, 0))],
        loads=[ub.Gravity(), ub.PointLoad(BEAM.end, (5.0, 0.0), amplitude=lambda t: min(t, 0.1))],
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


run = partial(run, t=(0, 0.4), dt=0.01)
both_kinds = pytest.mark.parametrize("curve", [wave, through(wave, 30)], ids=["UFL", "spline"])
both_schemes = pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(), ub.GeneralizedAlpha(0.8)], ids=str
)

# -- curves ----------------------------------------------------------------------------------------

NEEDS_NUMBER = "Guided(girder.end ", "ufl.cos(s) instead of math"


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: scene(lambda s: (1 + s, math.sin(s))), NEEDS_NUMBER),
        (lambda: scene(lambda s: (1 + s, np.sin(s))), NEEDS_NUMBER),
        (lambda: scene(lambda s: (1 + s, s) if s < 1 else (2.0, 1.0)), NEEDS_NUMBER),
        (lambda: scene(lambda s: (ufl.as_vector([1.0, 2.0]), 0.0)), ["no point"]),
        (lambda: ub.Spline([(0, 0)]), ["1 points"]),
        (lambda: ub.Spline([(0, 0), (1, 0)], [0, 1, 2]), ["3 parameters s"]),
        (lambda: ub.Spline([(0, 0), (1, 0)], [1, 0]), ["s must increase"]),
        (lambda: ub.Spline([(0, 0), (0, 0)]), ["s must increase"]),
    ],
)
def test_wrong_curves_are_refused(make, parts):
    with raises(*parts, kind=ub.ModelError):
        make()


def test_parameters_of_a_spline_are_sums_of_distances():
    assert ub.Spline([(0, 0), (3, 4), (3, 6)]).s == (0.0, 5.0, 7.0)


# -- motion ----------------------------------------------------------------------------------------


@both_schemes
def test_a_spline_through_points_of_a_cubic_is_the_cubic(scheme):
    """Its segments, of which several are passed in a step, are one polynomial, to round-off."""
    whole, parts = (run(scene(x), scheme, dt=0.05).q for x in (cubic, through(cubic, 40)))
    assert np.abs(whole).max() > 0.1
    assert np.abs(whole - parts).max() < 1e-9 * np.abs(whole).max()


@both_kinds
@pytest.mark.parametrize("dt", [1e-5, 1e-2])
def test_force_of_a_guide_is_normal_to_the_chord(curve, dt):
    """For short chords too, whose own direction has few digits; the work is round-off."""
    guided = scene(curve)
    solution = run(guided, t=(0, 20 * dt), dt=dt)
    force, at = solution.joint(guided.joints[0]).force, solution.position(BEAM.end)
    work = (force[1:] * np.diff(at, axis=0)).sum(axis=1)
    # Two points with two last digits of the size each
    assert np.abs(work).max() < 8 * np.spacing(2.0) * np.abs(force).max()
    assert np.abs(force).max() > 0.5


def test_a_loaded_scene_has_a_spline_that_goes_the_same_way(shared_path):
    solution = run(scene(wave))
    solution.save(shared_path / "guided.h5")
    (joint,) = ub.Solution.load(shared_path / "guided.h5").scene.joints
    # Splines of a thousand segments err by their fourth power
    assert np.abs(solution.q - run(scene(joint.curve)).q).max() < 1e-9 * np.abs(solution.q).max()


# -- derivatives -----------------------------------------------------------------------------------


def of_numbers(a, b):
    return scene(lambda s: (1.0 + s, a * ufl.sin(b * s)))


def of_points(a, b):
    s = np.linspace(-1, 1, 21)
    return scene(ub.Spline(np.column_stack([1.0 + s, a * np.sin(b * s)]).tolist(), s.tolist()))


@pytest.mark.serial
@pytest.mark.parametrize(
    ("model", "a"),
    [
        (of_numbers, 0.4),
        (of_numbers, 1.0),  # UFL drops the factor 1: neighbouring curves have another structure
        (of_points, 0.4),
    ],
)
@both_schemes
def test_derivatives_by_curves(model, a, scheme):
    """Direct against central differences of runs, and the adjoint against both."""
    at, options = {"a": a, "b": 3.0}, {"t": (0, 0.3), "dt": 0.02}

    def motion(run):  # without the force, whose round-off is masses / dt² as large
        return run.q[:, :-1]

    newton = ub.Newton(rtol=1e-12)
    found = ub.differentiate(model, at, scheme, newton=newton, **options).of(motion)
    for k, name in enumerate(at):
        runs = differences(model, at, name, motion, scheme, CHANGES[:1], **options)
        assert relative_error(found[..., k], next(runs)) < 1e-9
    more = {"newton": newton, "of": lambda run: run.q[:, 4]}
    _, whole = ub.gradient(model, at, scheme, **more, **options)
    np.testing.assert_allclose(whole, found[-1, 4], rtol=1e-8)
