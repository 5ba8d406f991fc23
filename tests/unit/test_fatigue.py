# SPDX-License-Identifier: MIT
"""Cycles, S-N curves and thinned histories: what long runs keep of themselves."""

import math

import numpy as np
import pytest
from helpers import raises
from hypothesis import given, settings, strategies
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.structures import fatigue
from ufl_beam.structures.fatigue import RainflowCounter

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
SECTION = ub.Section.rectangle(b=0.1, h=0.2, **STEEL)
CURVE = st.SNCurve.eurocode(71e6)


def by_range(found):
    """Counts by range, like those of the library."""
    counts = {}
    for size, count in zip(found.range.tolist(), found.count.tolist(), strict=True):
        counts[size] = counts.get(size, 0.0) + count
    return counts


# -- counting ----------------------------------------------------------------------------------

ASTM = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
"""The example of ASTM E1049-85, figure 6."""


def test_the_example_of_astm_e1049():
    found = st.rainflow(ASTM)
    assert by_range(found) == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    (whole,) = np.flatnonzero(found.count == 1.0)
    assert (found.range[whole], found.mean[whole]) == (4.0, 1.0)  # from -1 to 3
    # 3³/2 + 4³·3/2 + 6³/2 + 8³ + 9³/2 = 1094, if a range of 1 is borne for 1000 cycles
    curve = st.SNCurve(range=1.0, cycles=1000.0)
    assert found.damage(curve) == pytest.approx(1.094, rel=1e-14)
    assert found.equivalent(curve) == pytest.approx((1094 / 4) ** (1 / 3), rel=1e-14)


@settings(max_examples=100, deadline=None)
@given(
    series=strategies.lists(strategies.integers(-8, 8), min_size=1, max_size=80),
    pieces=strategies.lists(strategies.integers(1, 12), min_size=1, max_size=80),
)
def test_pieces_are_counted_as_the_whole(series, pieces):
    """And as the package rainflow counts; few ranges wait, from 16 to 0 that shrink."""
    counter, begin = RainflowCounter(0.5), 0
    while begin < len(series):
        size = pieces[begin % len(pieces)]
        counter.add(np.array(series[begin : begin + size], dtype=float))
        begin += size
        assert len(counter._waiting) <= 18
    found, whole = counter.cycles(), st.rainflow(series)
    assert by_range(found) == by_range(whole)
    assert np.array_equal(found.mean, whole.mean)
    library = pytest.importorskip("rainflow")
    # The library alone counts no cycle in series of two points
    expected = dict(library.count_cycles([*series, series[-1], series[-1]]))
    expected.pop(0, None)
    assert by_range(whole) == expected


@pytest.mark.parametrize("series", [[], [3.0], [3.0, 3.0, 3.0]])
def test_what_never_turns_has_no_cycles(series):
    found = st.rainflow(series)
    assert len(found.range) == 0
    assert found.damage(CURVE) == found.equivalent(CURVE) == 0.0


# -- curves ------------------------------------------------------------------------------------


def test_the_curve_of_the_eurocode():
    # EN 1993-1-9, 7.1: the knee at 0.737 and the cut-off at 0.549 of it, as printed
    assert CURVE.endurance(71e6) == 2e6
    knee = 71e6 * (2 / 5) ** (1 / 3)
    limit = knee * (5 / 100) ** (1 / 5)
    assert round(knee / 71e6, 3) == 0.737
    assert round(limit / knee, 3) == 0.549
    ranges = [142e6, knee, limit, 0.999 * limit, 0.0]
    assert CURVE.endurance(ranges) == pytest.approx([2.5e5, 5e6, 1e8, np.inf, np.inf], rel=1e-12)
    # Slope 5 between both
    assert CURVE.endurance(knee / 1.5) == pytest.approx(5e6 * 1.5**5, rel=1e-12)


def test_a_curve_of_one_slope_is_a_power():
    curve = st.SNCurve(range=100e6, cycles=1e6, slope=4.0)
    assert curve.endurance([10e6, 200e6]) == pytest.approx([1e10, 62500.0], rel=1e-12)


def test_mean_stresses_enlarge_ranges():
    sizes, means = np.array([100e6] * 4), np.array([0.0, 250e6, -250e6, 500e6])
    goodman, gerber = st.Goodman(500e6), st.Gerber(500e6)
    assert goodman(sizes, means).tolist() == [100e6, 200e6, 100e6, math.inf]
    assert gerber(sizes, means) == pytest.approx([100e6, 100e6 / 0.75, 100e6, math.inf])
    curve = st.SNCurve(range=100e6, cycles=1e6, mean=goodman)
    assert curve.endurance(sizes, means) == pytest.approx([1e6, 1.25e5, 1e6, 0.0])
    at_once = st.Cycles(sizes[3:], means[3:], np.array([0.5]))
    assert at_once.damage(curve) == math.inf


def test_equivalent_ranges_take_mean_stresses_into_account():
    curve = st.SNCurve(range=71e6, mean=st.Goodman(ultimate=500e6))
    cycles = st.rainflow([0.0, 100e6, 0.0, 100e6, 0.0])
    assert cycles.equivalent(curve) == pytest.approx(100e6 / (1 - 50e6 / 500e6))


# -- in a run ----------------------------------------------------------------------------------


def mast(force=(8e3, -2e3), amplitude=lambda t: math.sin(40 * t) * (1 + t)):
    """A cantilever upright from (0, 0), 4 m, with a force at its end."""
    beam = ub.Beam((0, 0), (0, 4), SECTION, cells=4, name="mast")
    return beam, clamped(beam, loads=[ub.PointLoad(beam.end, force=force, amplitude=amplitude)])


def run(scene, record, **more):
    more = {"t": (0, 0.4), "dt": 0.01, **more}
    return ub.simulate(scene, ub.EnergyMomentum(), record=record, **more)


def test_stress_is_in_balance_with_the_load():
    """To the right at the top: tension on the left of the way up, largest at the clamp."""
    F, axial = 1e3, -500.0
    beam, scene = mast((F, axial), ub.ramp(1.0))
    y, A, W = 0.1, 0.02, 0.1 * 0.2**2 / 6
    places = {beam.start: 4.0, beam.at(0.3): 2.8, beam.at(0.5): 2.0, beam.end: 0.0}
    spots = [st.HotSpot.fibre(place, y=y, E=210e9, factor=2.0) for place in places]
    own = st.HotSpot(beam.start, stress=lambda N, V, M: -M / W)
    fatigue = st.Fatigue([*spots, own], CURVE, resolution=1.0)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, record=fatigue)
    u, _, turn = np.abs(solution.displacement(beam.end)[-1])
    # What the formula leaves out is less: the lever of the axial force, the part of the other that
    # is axial once the beam has turned, and rounding
    more = abs(axial) * u / W + F * turn / A + 1.0
    for spot, arm in zip(spots, places.values(), strict=True):
        (size,) = fatigue.cycles(spot).range
        stress = 2.0 * (F * arm / W + axial / A)
        assert abs(size - abs(stress)) < 2.0 * more
        assert fatigue.cycles(spot).mean[0] * stress > 0
    # The moment at the clamp is that of its reaction: no error of the mesh, but for the rotation
    (moment,) = fatigue.cycles(own).range * W
    assert moment == pytest.approx(solution.reaction(scene.supports[0])[-1, 2], rel=turn**2)
    assert "mast.start (0, 0): 0.5 cycles" in str(fatigue)


def test_a_run_is_counted_as_its_solution(monkeypatch):
    monkeypatch.setattr(fatigue, "BLOCK", 7)  # a part of 41 rows
    beam, scene = mast()
    spot = st.HotSpot.fibre(beam.at(0.375), y=-0.1, E=210e9)  # in the middle of a cell
    recorder = st.Fatigue([spot, spot], CURVE, resolution=1e5)  # it is counted once
    solution = run(scene, recorder)
    N, _, M = solution.section_forces_at(spot.place).T
    expected = st.rainflow(np.rint((N / 0.02 + M * 0.1 * 12 / (0.1 * 0.2**3)) / 1e5))
    found = recorder.cycles(spot)
    assert found.count.sum() >= 3
    assert found.range == pytest.approx(1e5 * expected.range, rel=1e-12)
    assert found.mean == pytest.approx(1e5 * expected.mean, rel=1e-12)
    assert np.array_equal(found.count, expected.count)
    assert recorder.damage(spot) == found.damage(CURVE) > 0
    assert recorder.duration == 0.4
    assert recorder.life(spot) == pytest.approx(0.4 / recorder.damage(spot))


def test_what_a_run_that_fails_has_counted_is_kept():
    def amplitude(t):
        if t > 0.2:
            raise RuntimeError("enough")
        return math.sin(40 * t)

    beam, scene = mast(amplitude=amplitude)
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)
    recorder = st.Fatigue(spot, CURVE)
    with pytest.raises(RuntimeError, match="enough"):
        run(scene, recorder)
    assert recorder.duration == pytest.approx(0.2)
    assert recorder.cycles(spot).count.sum() > 0


def test_extremes_of_a_body():
    body = ub.Body((0, 0), mass=1.0, inertia=1.0)
    spring = ub.Slide(ub.ground(0, 0), body.middle, ub.Spring(100.0), axis=(1, 0))
    start, extremes = ub.Velocity([body], linear=(1.0, 0.2)), ub.Extremes()
    solution = run(ub.Scene(bodies=[body], connectors=[spring], initial=[start]), extremes)
    found, moved = extremes.displacement(body), solution.displacement(body.middle)
    assert np.array_equal([found.low[0], found.high[0]], [moved.min(axis=0), moved.max(axis=0)])


# -- thinned histories -------------------------------------------------------------------------


def test_history_of_some_steps_has_their_rows(shared_path, on_first_rank):
    beam, scene = mast()
    every = {1: {}, 4: {"every": 4}, 8: {"max_rows": 10}, 48: {"every": 3, "max_rows": 1}}
    tables = [ub.History(shared_path / f"{n}.csv", [beam.end], **more) for n, more in every.items()]
    run(scene, tables, t=(0, 0.5))

    def lines(n):
        return on_first_rank(lambda: (shared_path / f"{n}.csv").read_text().splitlines())

    header, *rows = lines(1)
    assert len(rows) == 51
    for n in every:
        assert lines(n) == [header, *rows[::n]]


def test_a_solution_is_thinned():
    whole, thin = (run(mast()[1], [], t=(0, 0.5), max_states=most) for most in (99, 10))
    rows = [*range(0, 50, 8), 50]
    assert np.array_equal(thin.times, whole.times[rows])
    assert np.array_equal(thin.q, whole.q[rows])
    assert np.array_equal(thin.v, whole.v[rows])
    assert np.array_equal(thin.energy["loads"], whole.energy["loads"][rows])
    found, expected = (x.reaction(x.scene.supports[0]) for x in (thin, whole))
    assert np.array_equal(found[1:], expected[rows][1:])


# -- bad input and pictures --------------------------------------------------------------------


def test_bad_input_is_refused():
    beam, scene = mast()
    place = ub.Beam((0, 0), (1, 0), SECTION, name="arm").end
    elsewhere = st.HotSpot(place, stress=lambda N, V, M: M)
    single = st.Fatigue(st.HotSpot(beam.start, stress=lambda N, V, M: M[0]), CURVE)
    pair = st.Fatigue([st.HotSpot(beam.at(s), stress=lambda N, V, M: M) for s in (0, 1)], CURVE)
    run(scene, pair, t=(0, 0.01))
    for make, *words in (
        (lambda: st.SNCurve(range=1.0, knee=5e6, limit=1e6), "limit = 1e+06 cycles lies before"),
        (lambda: ub.Extremes().section_forces(beam), "Extremes: nothing was run"),
        (lambda: single.cycles(elsewhere), "nothing was counted at arm.end"),
        (lambda: run(scene, st.Fatigue(elsewhere, CURVE)), "arm is not in the scene"),
        (lambda: run(scene, single), "mast.start ", " a finite number for each"),
        (lambda: ub.plot(pair, "cycles"), "give one of the 2 hot spots"),
        (
            lambda: ub.plot(pair, "cycles", pair.spots[0]),
            "the stress at mast.start",
            "never turned",
        ),
    ):
        with raises(*words):
            make()


def test_fatigue_and_extremes_have_pictures():
    beam, scene = mast()
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)
    recorder, extremes = st.Fatigue(spot, CURVE), ub.Extremes()
    run(scene, [recorder, extremes], max_states=4)
    (axes,) = ub.plot(extremes, "M").axes
    reached = extremes.section_forces(beam)
    texts = {text.get_text() for text in axes.texts}
    assert f"{1e-3 * reached.high[:, 2].max():.3g}" in texts
    assert f"−{-1e-3 * reached.low[:, 2].min():.3g}" in texts
    matrix, spectrum, damage, _ = ub.plot(recorder, "cycles", spot).axes
    shown = np.nansum(matrix.collections[0].get_array())
    assert shown == pytest.approx(recorder.cycles(spot).count.sum())
    assert spectrum.lines[0].get_xdata()[0] == pytest.approx(shown)
    assert spectrum.lines[0].get_ydata()[0] == 0.0  # cycles of a single range are a line, too
    assert sum(bar.get_width() for bar in damage.patches) == pytest.approx(100.0)
