# SPDX-License-Identifier: MIT
"""Damping from a history: peaks, logarithmic decrement, and which law their decay follows."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from helpers import raises

import ufl_beam as ub
from ufl_beam.structures.free_decay import (
    damping,
    damping_ratio,
    fit_decay,
    logarithmic_decrement,
    peaks,
)

OMEGA = 2 * np.pi
"""A period of one second."""

T = np.linspace(0, 10, 1001)


def viscous(t, decrement, phase=-1.0):
    """Free vibration under viscous damping, its period 1 s; it starts before its first maximum."""
    return np.exp(-decrement * t) * np.cos(OMEGA * t + phase)


def coulomb(t, friction, start=1.0):
    """Free vibration under dry friction F, from rest at ``start``, its period 1 s; friction = F/k.

    In half-cycle j a cosine about ±F/k, with 2 F/k less amplitude than the one before.
    """
    j = np.floor(2 * t)
    return (-1) ** j * friction + (start - (2 * j + 1) * friction) * np.cos(OMEGA * t)


# -- peaks ---------------------------------------------------------------------------------------


def test_a_parabola_is_found_exactly_whatever_the_steps():
    t = np.array([0.0, 0.7, 1.0, 1.9, 2.5])
    times, amplitudes = peaks(t, 5 - 2 * (t - 1.3) ** 2, about=1.0)
    # Numbers of order 10, a few operations
    assert times == pytest.approx([1.3], abs=1e-14)
    assert amplitudes == pytest.approx([4.0], abs=1e-14)


@pytest.mark.parametrize(("top", "time"), [([1, 1], 2.5), ([1, 1, 1], 3.0), ([1, 1, 1, 1], 3.0)])
def test_a_flat_top_is_one_peak(top, time):
    """In the middle; of four equal samples at the lower of the middle ones; ends are no maxima."""
    x = [1, 0, 0.5, *top, 0.5, 0, 1]
    times, amplitudes = peaks(np.arange(len(x)), x)
    assert times == pytest.approx([time + 1], abs=1e-14)
    assert amplitudes == pytest.approx([1 if len(top) > 2 else 1 + 0.5 / 8], abs=1e-14)


def test_minima_and_moved_histories_have_the_decrement_of_maxima():
    t = np.linspace(0, 8, 801)
    x = viscous(t, 0.1)
    upper, lower, moved = damping(t, x), damping(t, -x), damping(t + 100, x - 3, about=-3)
    assert lower.times[0] - upper.times[0] == pytest.approx(0.5, abs=1e-6)  # both parabolas
    assert lower.decrement == pytest.approx(upper.decrement, abs=1e-10)
    assert upper.better == "exponential"
    # The cosine at a maximum is that of arctan(δ/2π); the fit is to 1e-8
    height = np.exp(-0.1 * upper.times[0]) / np.hypot(1, 0.1 / OMEGA)
    assert upper.exponential.initial == pytest.approx(height, rel=1e-6)
    assert moved.times == pytest.approx(upper.times + 100, abs=1e-10)
    assert moved.amplitudes == pytest.approx(upper.amplitudes, abs=1e-14)  # round-off of 3


def test_high_frequency_riding_on_the_vibration():
    t = np.linspace(0, 10, 4001)
    x = viscous(t, 0.05) + 0.02 * np.sin(23.7 * OMEGA * t)
    assert len(peaks(t, x, prominence=0)[0]) > 50
    decay = damping(t, x)
    assert len(decay.times) == 10
    # The highest sample is within the ripple of the vibration's amplitude A; δ is the mean of
    # nine periods, so that only the first and the last peak count: ε/A_0 + ε/A_9, A_9 = A_0/1.57
    assert decay.decrement == pytest.approx(0.05, abs=0.02 * (1 + 1.57) / 9)


# -- decrement and ratio -------------------------------------------------------------------------


def interpolation_error(decrement, dt):
    """Bound on the relative error of a parabola's height, with θ = ω dt and ζ small.

    Within half a step of the middle sample |x'''| |s (s² − dt²)| / 6 ≤ 0.375 dt³ |x'''| / 6, where
    x''' of A exp(-ζωt) cos(ωt) is at most A ω³ (2 ζ + 1.5 θ): 2 ζ at the maximum, growing by ω a
    second over at most 1.5 dt; both up to 1 + O(ζ).
    """
    θ, ζ = OMEGA * dt, damping_ratio(decrement)
    return 1.1 * 0.375 / 6 * θ**3 * (2 * ζ + 1.5 * θ)


@pytest.mark.parametrize("decrement", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("dt", [0.05, 0.0031])
def test_a_damped_cosine(decrement, dt):
    t = np.arange(0, 7, dt)
    decay = damping(t, viscous(t, decrement), prominence=0.01)
    ε = interpolation_error(decrement, dt)
    assert len(decay.times) == 7
    assert decay.decrements == pytest.approx(np.full(6, decrement), abs=2 * ε + 1e-12)
    assert decay.decrement == pytest.approx(decrement, abs=2 * ε / 6 + 1e-12)
    # ζ = σ / √(σ² + ω²) exactly, with σ = δ / T; dζ/dδ < 1/2π
    ratio = decrement / np.hypot(decrement, OMEGA)
    assert decay.ratio == pytest.approx(ratio, abs=2 * ε / 6 / OMEGA + 1e-12)
    assert decay.fitted_ratio == pytest.approx(ratio, abs=2 * ε / OMEGA + 1e-8)


def test_peaks_are_of_fourth_order():
    # Worst of many places between samples; half the steps, 1/16 of the error, as x''' = 0 there
    errors = []
    for dt in (0.08, 0.04, 0.02):
        phases = np.linspace(-2, -1, 200)
        heights = [
            peaks(np.arange(0, 1, dt), viscous(np.arange(0, 1, dt), 0, p))[1] for p in phases
        ]
        errors.append(np.max(np.abs(np.array(heights) - 1)))
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(16, rel=0.1)


def test_decrements_by_hand():
    mean, each = logarithmic_decrement([8, 4, 1])
    assert mean == pytest.approx(np.log(8) / 2, rel=1e-15)
    assert each == pytest.approx(np.log([2, 4]), rel=1e-15)


def test_damping_ratio_of_arrays_zero_and_growth():
    assert damping_ratio(0.0) == 0
    assert damping_ratio(OMEGA) == pytest.approx(np.sqrt(0.5), rel=1e-15)
    δ = np.array([[0.5, 0.01], [3.0, 1e-9]])
    printed = 1 / np.sqrt(1 + (OMEGA / δ) ** 2)  # as (62) has it, which fails at 0
    assert damping_ratio(δ) == pytest.approx(printed, rel=1e-14)
    assert damping_ratio(-δ) == pytest.approx(-printed, rel=1e-14)
    # The inverse, from (92)
    ζ = np.array([0.001, 0.1, 0.9])
    assert damping_ratio(OMEGA * ζ / np.sqrt(1 - ζ**2)) == pytest.approx(ζ, rel=1e-14)


def test_damping_ratios_of_table_2():
    """Both are printed to 0.001, half of it each; the first ones also to five digits."""
    for δ, ζ in (
        (
            [0.077, 0.062, 0.038, 0.025, 0.017, 0.013, 0.006, 0.003],
            [0.012, 0.010, 0.006, 0.004, 0.003, 0.002, 0.001, 0.001],
        ),
        (
            [0.076, 0.061, 0.038, 0.025, 0.017, 0.013, 0.006, 0.003],
            [0.012, 0.010, 0.006, 0.004, 0.003, 0.002, 0.001, 0.000],
        ),
    ):
        assert damping_ratio(δ) == pytest.approx(np.array(ζ), abs=5e-4 * (1 + 1 / OMEGA))
    assert damping_ratio([0.077, 0.062, 0.038]) == pytest.approx(
        np.array([0.01225, 0.00987, 0.00605]), abs=5e-6
    )


# -- the two laws --------------------------------------------------------------------------------


def test_dry_friction_is_linear():
    f, dt = 0.02, 0.001
    t = np.arange(0, 10.5, dt)
    decay = damping(t, coulomb(t, f))
    assert len(decay.times) == 10
    assert decay.better == "linear"
    # The curvature jumps by 2 f ω² at a peak: within a step, a height of f ω² dt²
    ε = f * (OMEGA * dt) ** 2
    assert decay.amplitudes == pytest.approx(1 - 4 * f * np.arange(1, 11), abs=ε)
    assert decay.linear.initial == pytest.approx(1 - 4 * f, abs=ε)
    assert decay.linear.rate == pytest.approx(4 * f, abs=ε)
    assert decay.linear.rms <= ε
    assert decay.evidence > 1e10
    assert (np.diff(decay.decrements) > 0).all()  # the same amount is more and more of the rest


def test_the_linear_law_is_the_regression_by_hand():
    # Amplitudes 4, 2, 3: mean 3, slope -1/2, residuals 1/2, -1, 1/2
    law = fit_decay([10, 11, 12], [4, 2, 3]).linear
    assert (law.initial, law.rate) == pytest.approx((3.5, 0.5), rel=1e-14)
    assert law.rms == pytest.approx(np.sqrt(1.5 / 3), rel=1e-14)
    # Standard error √(1.5 / 1 / 2) of the slope; t of one degree of freedom is tan(0.95 π/2),
    # which SciPy has to 1e-10
    assert law.rate_95 == pytest.approx(np.sqrt(0.75) * np.tan(0.475 * np.pi), rel=1e-9)


def test_evidence_is_that_of_akaike():
    decay = fit_decay([0, 1, 2, 3, 4], [5, 4.2, 3.3, 2.9, 2.2])
    aic = [5 * np.log(5 * law.rms**2) + 2 * 2 for law in (decay.linear, decay.exponential)]
    assert decay.better == ("linear", "exponential")[int(np.argmin(aic))]
    assert decay.evidence == pytest.approx(np.exp(abs(aic[0] - aic[1]) / 2), rel=1e-12)


@pytest.mark.parametrize("law", ["linear", "exponential"])
def test_intervals_hold_the_truth_as_often_as_they_say(law):
    rng = np.random.default_rng(61)
    t = np.arange(12.0)
    clean = 2 - 0.1 * t if law == "linear" else 2 * np.exp(-0.1 * t)
    inside, right, ratios = [], 0, 0
    for _ in range(400):
        decay = fit_decay(t, clean + 0.02 * rng.standard_normal(12))
        fit = getattr(decay, law)
        inside.append([abs(fit.initial - 2) < fit.initial_95, abs(fit.rate - 0.1) < fit.rate_95])
        ratios += abs(decay.fitted_ratio - damping_ratio(0.1)) < decay.fitted_ratio_95
        right += decay.better == law
    # 95 % within three deviations √(0.95 0.05 / 400) = 0.011 of a binomial mean
    assert np.mean(inside, axis=0) == pytest.approx([0.95, 0.95], abs=0.033)
    assert right > 390  # the laws differ by 0.09, the noise is 0.02
    if law == "exponential":
        assert ratios / 400 == pytest.approx(0.95, abs=0.033)


def test_constant_and_growing_amplitudes():
    decay = fit_decay(np.arange(5), np.ones(5))
    assert decay.decrement == decay.ratio == 0
    assert decay.linear.rate == 0
    assert abs(decay.exponential.rate) < 1e-15
    assert decay.evidence == 1  # neither
    decay = fit_decay(np.arange(5), np.exp(0.2 * np.arange(5)))
    assert decay.decrement == pytest.approx(-0.2, rel=1e-14)
    assert decay.fitted_ratio == pytest.approx(damping_ratio(-0.2), rel=1e-8)


# -- units, text ---------------------------------------------------------------------------------


def test_units_do_not_matter():
    """The fit is to 1e-8."""
    second, metre = 1e-6, 1e9
    x = viscous(T, 0.1) + 0.01 * np.cos(5.3 * T)
    one, other = damping(T, x), damping(second * T, metre * x)
    near = partial(pytest.approx, rel=1e-7)
    for name in ("decrement", "decrements", "ratio", "fitted_ratio", "fitted_ratio_95", "evidence"):
        assert getattr(other, name) == near(getattr(one, name)), name
    assert other.better == one.better
    assert other.period == near(second * one.period)
    for law, unit in (("linear", metre / second), ("exponential", 1 / second)):
        a, b = getattr(one, law), getattr(other, law)
        assert (b.rate, b.rate_95) == near((unit * a.rate, unit * a.rate_95))
        assert (b.initial, b.initial_95) == near((metre * a.initial, metre * a.initial_95))
        assert b.rms == near(metre * a.rms)


def test_it_can_be_read():
    lines = str(fit_decay([0, 1, 2, 3], [8, 4, 2, 1])).splitlines()
    assert lines[0] == "4 peaks, period 1 s (1 to 1 s)"
    assert lines[1] == "  decrement    0.6931 (0.6931 to 0.6931), damping ratio 0.1097"
    assert lines[2].startswith("  linear       A0 = 7.2 ± ")
    assert lines[3].startswith("  exponential  A0 = 8 ± ")
    assert ", rate = 0.69315 ± " in lines[3]
    assert ", damping ratio 0.1097 ± " in lines[3]
    assert lines[4].startswith("  exponential describes them better, evidence ratio ")


# -- errors --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: peaks([0, 1, 2], [0, 1]), ["3 t and 2 x; give the same number of"]),
        (lambda: peaks([0, 1, 1], [0, 1, 0]), ["t must increase", "t[1] = 1 is followed by 1"]),
        (
            lambda: damping(T[:150], viscous(T[:150], 0.1)),
            ["peaks found: 2, needed: 3", "longer history", "prominence = 0.05"],
        ),
        (lambda: damping(T[:0], T[:0]), ["peaks found: 0"]),
        (lambda: damping(T, 0 * T), ["peaks found: 0"]),
        (
            lambda: logarithmic_decrement([1.0, 0.0]),
            ["amplitudes[1] = 0 must be positive", "from the equilibrium"],
        ),
        (  # exp(-0.1 · 3.16) = 0.73, next 0.66
            lambda: damping(T, viscous(T, 0.1), about=0.7),
            ["amplitudes[4] = -0.", "must be positive", "about"],
        ),
        (lambda: logarithmic_decrement([1.0]), ["amplitudes given: 1, needed: 2"]),
        (lambda: fit_decay([0, 1], [2, 1]), ["amplitudes given: 2, needed: 3"]),
        (lambda: fit_decay([0, 1, 2], [4, 3, 2, 1]), ["3 t and 4 amplitudes"]),
        (
            lambda: fit_decay([0, 1, 2], [440, 0.702, 1.38e6]),
            ["no exponential fits", "from 0.702 to 1.38e+06", "one free vibration"],
        ),
    ],
)
def test_histories_without_a_decrement_are_refused(call, words):
    with raises(*words):
        call()


def test_a_moved_equilibrium_is_told():
    """A decay about a residual displacement of half of the first amplitude."""
    x = viscous(T, 0.1) + 0.5
    with pytest.warns(ub.ModelWarning, match=r"is about 0\.5,.*give about=0\.5"):
        wrong = damping(T, x)
    assert wrong.decrement < 0.08
    found = damping(T, x, about=0.5)  # no warning is issued
    assert found.decrement == pytest.approx(0.1, rel=1e-3)
