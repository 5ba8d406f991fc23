# SPDX-License-Identifier: MIT
"""Ground motions: files and their errors, integrals, scaling, correction, other time steps."""

import numpy as np
import pytest
import scipy
from helpers import raises

import ufl_beam as ub
import ufl_beam.structures as st

NEW = """PEER NGA STRONG MOTION DATABASE RECORD
Somewhere, 5/19/1940, Station 9, 180
ACCELERATION TIME SERIES IN UNITS OF G
NPTS=      7, DT=   .0100 SEC
   .1000000E+00  -.2000000E+00   .3000000E+00   .4000000E+00   .0000000E+00
  -.1000000E+00   .0000000E+00
"""
OLD = NEW.replace(
    "G\nNPTS=      7, DT=   .0100 SEC", "CM/S/S. FILTER POINTS: HP=0.1\n 7 0.0100  NPTS, DT"
)
VALUES = np.array([0.1, -0.2, 0.3, 0.4, 0.0, -0.1, 0.0])

G = 9.80665
"""Standard acceleration of gravity; m/s² (CGPM 1901)."""

RECORD = st.GroundMotion(0.02, np.random.default_rng(3).standard_normal(400), "noise")


@pytest.fixture
def read(tmp_path):
    """Read a text from a file."""

    def read_text(text, **options):
        path = tmp_path / "quake.txt"
        path.write_text(text)
        return st.GroundMotion.read(path, **options)

    return read_text


@pytest.mark.serial  # files
@pytest.mark.parametrize(
    ("text", "options", "unit"),
    [
        (NEW, {}, G),
        (NEW, {"unit": "g", "dt": 0.01}, G),
        (NEW.replace(" .0100 SEC", " 1.0D-02 SEC").replace("E+00", "D+00"), {}, G),  # Fortran
        (OLD, {}, 0.01),
        (OLD, {"unit": "gal"}, 0.01),
        (NEW.replace("OF G", "OF CM"), {"unit": "m/s2"}, 1.0),
        ("# t, a\n" + "\n".join(f"{k}e-2,{a}" for k, a in enumerate(VALUES)), {"unit": "g"}, G),
        ("\n".join(f" {k + 300}e-2\t{a} " for k, a in enumerate(VALUES)), {"unit": "gal"}, 0.01),
        ("0.1 -0.2 0.3\n\n0.4 0; -0.1; 0\n", {"unit": "m/s^2", "dt": 0.01}, 1.0),
        ("0.1,-0.2,0.3,\n0.4,0,-0.1,0,\n", {"unit": "m/s^2", "dt": 0.01}, 1.0),
    ],
)
def test_a_file_is_read(read, text, options, unit):
    motion = read(text, **options)
    # Steps of times with two decimals have the round-off of a sum.
    assert motion.dt == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_array_equal(motion.values, unit * VALUES)
    assert motion.name == "quake"


@pytest.mark.serial  # files
def test_times_with_few_digits_are_equal_steps(read):
    """Steps of 1/256 s, written with four decimals; the mean step has half of the last digit."""
    motion = read("\n".join(f"{k / 256:.4f} {a}" for k, a in enumerate(RECORD.values)), unit="g")
    assert motion.dt == pytest.approx(1 / 256, abs=1e-4 / len(motion.values))


IN_G = {"unit": "g"}
LINES = {"unit": "g", "dt": 0.1}
TIMED = "0.00 1\n0.01 2\n0.02 3\n0.03 4\n0.04 5\n"


@pytest.mark.serial  # files
@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (TIMED, {}, ": the record has no unit; give unit= one of m/s2, g, cm/s2, gal, mm/s2"),
        (TIMED, {"unit": "ft/s2"}, ": unit = 'ft/s2' is unknown; give"),
        (NEW.replace("OF G", "OF CM"), {}, ": unit = 'CM' is unknown; give"),
        (TIMED.replace("0.02 3\n", ""), IN_G, ", line 3: the step from t = 0.01 s to 0.03"),
        ("#\n1 0\n0 0\n", IN_G, ", line 3: the step from t = 1 s to 0"),
        (TIMED.replace("3", "NaN", 1), IN_G, ", line 3: a number is not finite: '0.02 NaN'"),
        (TIMED.replace("2\n", "2 *\n", 1), IN_G, ", line 2: no numbers: '0.01 2 *'; comments"),
        ("time acc\n" + TIMED, IN_G, ", line 1: no numbers: 'time acc'; comments begin with #"),
        (TIMED + "0.05\n", IN_G, ", line 6: a time and an acceleration are expected"),
        ("1,,2\n", LINES, ", line 1: no numbers: '1,,2'"),
        ("1,2\n3,\n", LINES, ", line 2: a value is missing here"),
        (",1\n", LINES, ", line 1: no numbers"),
        (TIMED, {"unit": "g", "dt": 0.01}, ": the first column has times with the step 0.01 s"),
        (TIMED, {"unit": "g", "dt": 0.02}, ": the first column has times with the step 0.01 s"),
        ("0 1\n", IN_G, ": a record has at least two lines"),
        ("# nothing\n", IN_G, ": the file has no numbers"),
        (NEW.replace("      7", "      8"), {}, ": 7 accelerations, but NPTS = 8 in the head"),
        (NEW.replace(".3000000E+00", "*"), {}, ", line 5: no numbers"),
        (NEW, {"dt": 0.02}, ": dt = 0.02 s, but the file has 0.01 s"),
        (NEW, {"unit": "m/s2"}, ": unit = 'm/s2', but the file has G; omit unit"),
        (OLD, {"unit": "g"}, ": unit = 'g', but the file has CM/S/S; omit unit"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(read, text, options, message):
    with raises("quake.txt" + message, kind=ub.ModelError):
        read(text, **options)


HISTORY = st.GroundMotion.from_history


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: st.GroundMotion.read("no/such.AT2"), ["read: no/such.AT2: No such file"]),
        (lambda: HISTORY([0, 1, 2, 5], [0, 1, 2, 3]), ["times[3]: the step", "or give dt="]),
        (lambda: HISTORY([0, 1], [0, 1, 2]), ["2 times and 3 values"]),
        (lambda: HISTORY([0, 1, 1], [0, 1, 2], 0.1), ["must increase, but 1 follows 1"]),
        (RECORD.scaled, ["GroundMotion.scaled: give either factor or peak"]),
        (lambda: RECORD.scaled(0.0).scaled(peak=1.0), ["GroundMotion.scaled: noise is zero"]),
        (lambda: RECORD.corrected(highpass=25.0), ["highpass = 25 Hz must be below", "25 Hz"]),
        (
            lambda: st.GroundMotion(0.01, [0, 1, 2, 1.0]).corrected(highpass=1.0),
            ["has 4 values; a filter needs more than 15"],
        ),
        (lambda: RECORD.resampled(0.0234567891), ["not in the ratio of small whole numbers"]),
        (lambda: ub.Rayleigh.with_ratios(0.03, (5.0, 5.0)), ["omega = (5, 5) must be two"]),
        # a0 = 2 ω1 ω2 (ζ1 ω2 - ζ2 ω1)/(ω2² - ω1²)
        (lambda: ub.Rayleigh.with_ratios((0.01, 0.05), (5.0, 6.0)), ["need", "mass = -1.04"]),
        (lambda: st.response_spectrum(RECORD.scaled(0.0), [1.0], ductility=2.0), ["noise is zero"]),
    ],
)
def test_a_wrong_call_is_refused(make, parts):
    with raises(*parts):
        make()


def test_the_integrals_are_exact():
    """[closed] Acceleration 6 t until 1 s, which falls to zero in a further step of 0.1 s."""
    motion = st.GroundMotion(0.1, np.linspace(0.0, 6.0, 11))
    for t in (-1.0, 0.0, 0.25, 0.7, 1.0):
        after = max(t, 0.0)
        assert motion.acceleration(t) == pytest.approx(6 * after, rel=1e-14)
        assert motion.velocity(t) == pytest.approx(3 * after**2, rel=1e-14)
        assert motion.displacement(t) == pytest.approx(after**3, rel=1e-14)
    # In the further step the velocity grows by 6 · 0.1/2 and the displacement by 0.3 + 6 · 0.01/3.
    assert motion.acceleration(1.1) == motion.acceleration(3.0) == 0.0
    assert motion.velocity(2.1) == pytest.approx(3.3, rel=1e-14)
    assert motion.displacement(2.1) == pytest.approx(1.32 + 3.3, rel=1e-14)


def test_a_record_is_scaled():
    assert RECORD.scaled(-2.0).values[7] == -2.0 * RECORD.values[7]
    assert RECORD.scaled(peak=3.0).peak == pytest.approx(3.0, rel=1e-15)
    assert RECORD.scaled(1.0) == RECORD


def test_the_correction_finds_the_drift():
    """[closed] A polynomial is found but for the record, whose velocity has a small polynomial."""
    t = RECORD.dt * np.arange(len(RECORD.values))
    moved = st.GroundMotion(RECORD.dt, np.array(RECORD.values) + 0.3 - 0.2 * t)
    np.testing.assert_allclose(moved.corrected().values, RECORD.corrected().values, atol=1e-12)
    # Berg and Housner's condition: no further line makes the mean square of the velocity smaller.
    v = scipy.integrate.cumulative_trapezoid(moved.corrected().values, dx=RECORD.dt, initial=0)
    for power in (1, 2):
        assert abs(v @ t**power) < 1e-12 * abs(v) @ t**power
    # Degree 0 leaves the linear drift.
    assert abs(moved.corrected(0).velocity(9.0)) > 10 * abs(moved.corrected().velocity(9.0))


def test_the_filter_removes_long_waves():
    """A wave of 0.05 Hz below the filter of 0.5 Hz; one of 5 Hz, ten times as fast, remains.

    [closed] A Butterworth filter of order 4, used twice, has the gain 1/(1 + (f0/f)⁸).
    """
    t = np.arange(0.0, 60.0, 0.02)
    window = np.sin(np.pi * t / 60) ** 2
    short, long = window * np.sin(10 * np.pi * t), window * np.sin(0.1 * np.pi * t)
    kept = np.array(st.GroundMotion(0.02, short + long).corrected(highpass=0.5).values)
    assert abs(kept - short).max() < 1e-3  # less than the sidebands of the window


def test_shorter_steps_are_the_same_function():
    fine = RECORD.resampled(RECORD.dt / 4)
    for t in np.linspace(0.0, RECORD.duration + 2 * RECORD.dt, 57):
        assert fine.acceleration(t) == pytest.approx(RECORD.acceleration(t), abs=1e-13)
        assert fine.displacement(t) == pytest.approx(RECORD.displacement(t), abs=1e-12)


def test_longer_steps_keep_slow_waves_and_remove_fast_ones():
    """Waves of 2 Hz and 20 Hz; steps of 0.03 s represent at most 16.7 Hz."""
    t = np.arange(0.0, 12.0, 0.01)
    window = np.sin(np.pi * t / 12) ** 2
    slow, fast = window * np.sin(4 * np.pi * t), window * np.sin(40 * np.pi * t)
    kept = st.GroundMotion(0.01, slow + fast).resampled(0.03)
    assert len(kept.values) == 400
    # Half of the amplitude of SciPy's filter in its pass band, 60 dB, is 1e-3.
    np.testing.assert_allclose(kept.values, slow[::3], atol=5e-3)


def test_a_history_with_uneven_times_is_interpolated():
    floor = HISTORY([2.0, 3.0, 5.0], [0.0, 2.0, 0.0], dt=0.5, name="floor")
    assert floor == st.GroundMotion(0.5, [0.0, 1.0, 2.0, 1.5, 1.0, 0.5, 0.0], "floor")
    assert HISTORY(0.1 * np.arange(5), np.arange(5)).dt == pytest.approx(0.1, rel=1e-15)


@pytest.mark.parametrize("ratios", [0.03, (0.02, 0.05)])
def test_rayleigh_damping_has_the_ratios(ratios):
    """[closed] a0/(2 ω) + a1 ω/2."""
    damping = ub.Rayleigh.with_ratios(ratios, (5.0, 40.0))
    at = [damping.mass / (2 * w) + damping.stiffness * w / 2 for w in (5.0, 40.0)]
    np.testing.assert_allclose(at, ratios, rtol=1e-14)


def test_adaptive_steps_end_at_samples_of_a_record():
    """The velocity of a support has a kink at each sample of the acceleration."""
    motion = st.GroundMotion(0.25, [0.0, 1.0, -1.0, 0.0, 0.0])
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e3, GA=1e3, EI=1e3, rhoA=1.0, rhoI=1.0))
    foot = ub.PrescribedDisplacement(beam.start, u=0.0, v=motion.displacement, psi=0.0)
    scene = ub.Scene([beam], supports=[foot])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=ub.Adaptive(1e-2))
    assert {0.25, 0.5, 0.75} <= set(run.times)
