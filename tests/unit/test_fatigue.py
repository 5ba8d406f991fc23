# SPDX-License-Identifier: MIT
"""Cycles, S-N curves, extremes and thinned histories: what long runs keep of themselves."""

import csv
import math

import numpy as np
import pytest
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


whole_numbers = strategies.lists(strategies.integers(-8, 8), min_size=1, max_size=80)


@settings(max_examples=300, deadline=None)
@given(
    series=whole_numbers,
    pieces=strategies.lists(strategies.integers(1, 12), min_size=1, max_size=80),
)
def test_pieces_are_counted_as_the_whole(series, pieces):
    """And as the package rainflow counts."""
    library = pytest.importorskip("rainflow")
    # The library alone counts no cycle in series of two points
    expected = dict(library.count_cycles([*series, series[-1], series[-1]]))
    expected.pop(0, None)
    counter, begin = RainflowCounter(0.5), 0
    while begin < len(series):
        size = pieces[begin % len(pieces)]
        counter.add(np.array(series[begin : begin + size], dtype=float))
        begin += size
        # Ranges from 16 to 0 that shrink
        assert len(counter._waiting) <= 18
    assert by_range(counter.cycles()) == expected
    assert by_range(st.rainflow(series)) == expected


def test_what_waits_does_not_grow():
    """Cycles of one size are all halves, and none of them waits."""
    counter = RainflowCounter(1.0)
    for _ in range(50):
        counter.add(np.tile([3.0, -3.0], 100))
    assert len(counter._waiting) <= 3
    assert by_range(counter.cycles()) == {6.0: (2 * 50 * 100 - 1) / 2}


def test_means_survive_the_pieces():
    rng = np.random.default_rng(1)
    series = np.cumsum(rng.integers(-9, 10, 3000)).astype(float)
    counter = RainflowCounter(1.0)
    for piece in np.array_split(series, 37):
        counter.add(piece)
    one, other = counter.cycles(), st.rainflow(series)
    for name in ("range", "mean", "count"):
        assert np.array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("series", [[], [3.0], [3.0, 3.0, 3.0]])
def test_what_never_turns_has_no_cycles(series):
    found = st.rainflow(series)
    assert len(found.range) == 0
    assert found.damage(CURVE) == found.equivalent(CURVE) == 0.0


@pytest.mark.parametrize(
    ("series", "says"),
    [
        ([1.0, math.nan], r"series\[1\] = nan is not finite"),
        ([[1.0, 2.0]], r"series has shape \(1, 2\); give one row of numbers"),
    ],
)
def test_what_is_no_series(series, says):
    with pytest.raises(ub.ArgumentError, match=says):
        st.rainflow(series)


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


# -- in a run ----------------------------------------------------------------------------------


def mast(*loads, cells=4):
    """A cantilever upright from (0, 0), 4 m; push it at its end."""
    beam = ub.Beam((0, 0), (0, 4), SECTION, cells=cells, name="mast")
    return beam, clamped(beam, loads=[f(beam) for f in loads])


def to_and_fro(beam):
    return ub.PointLoad(beam.end, force=(8e3, -2e3), amplitude=lambda t: math.sin(40 * t) * (1 + t))


def test_stress_is_in_balance_with_the_load():
    """To the right at the top: tension on the left of the way up, largest at the clamp."""
    F, axial = 1e3, -500.0
    beam, scene = mast(lambda b: ub.PointLoad(b.end, force=(F, axial), amplitude=ub.ramp(1.0)))
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
    beam, scene = mast(to_and_fro)
    spot = st.HotSpot.fibre(beam.at(0.375), y=-0.1, E=210e9)  # in the middle of a cell
    recorder = st.Fatigue(spot, CURVE, resolution=1e5)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.4), dt=0.01, record=recorder)
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


def test_extremes_are_those_of_all_steps():
    beam, scene = mast(to_and_fro)
    body = ub.Body((0, 4), mass=100.0, inertia=3.0, name="head")
    scene = ub.Scene(
        [beam], bodies=[body], joints=[ub.Rigid(beam.end, body.middle)],
        supports=scene.supports, loads=scene.loads,
    )  # fmt: skip
    extremes = ub.Extremes()
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.4), dt=0.01, record=extremes)
    kept = range(len(solution))
    forces = np.array([np.transpose(solution.diagram(beam, n, points=2)[1:]) for n in kept])
    nodes = solution.numbering.nodes_of(beam)[1]
    for found, values in (
        (extremes.section_forces(beam), forces),
        (extremes.displacement(beam), solution.q[:, nodes]),
        (extremes.displacement(body), solution.displacement(body.middle)[:, None]),
    ):
        # Copies; forces of the same formulas in UFL and in NumPy: round-off of EA
        assert np.abs(found.low - values.min(axis=0)).max() < 1e-14 * SECTION.EA
        assert np.abs(found.high - values.max(axis=0)).max() < 1e-14 * SECTION.EA
    motion = solution.q[:, nodes]
    found = extremes.displacement(beam)
    assert np.array_equal(found.high, motion.max(axis=0))
    assert np.array_equal(found.time_high, solution.times[motion.argmax(axis=0)])
    assert np.array_equal(found.time_low, solution.times[motion.argmin(axis=0)])


def test_what_a_run_that_fails_has_counted_is_kept():
    def force(t):
        if t > 0.2:
            raise RuntimeError("enough")
        return math.sin(40 * t)

    beam, scene = mast(lambda b: ub.PointLoad(b.end, force=(8e3, 0.0), amplitude=force))
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)
    recorder, extremes = st.Fatigue(spot, CURVE), ub.Extremes()
    with pytest.raises(RuntimeError, match="enough"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01, record=[recorder, extremes])
    assert recorder.duration == pytest.approx(0.2)
    assert recorder.cycles(spot).count.sum() > 0
    assert extremes.displacement(beam).high[-1, 0] > 0


def test_counts_and_extremes_go_on_from_a_checkpoint(shared_path):
    beam, scene = mast(to_and_fro)
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)

    def run(end, **more):
        recorders = st.Fatigue(spot, CURVE), ub.Extremes()
        run = {"t": (0, end), "dt": 0.01, "record": recorders}
        ub.simulate(scene, ub.EnergyMomentum(), **run, **more)
        return recorders

    checkpoint = ub.Checkpoint(shared_path / "run.checkpoint", every=10)
    run(0.33, checkpoint=checkpoint)
    (counted, reached), (whole, all_of_it) = run(0.5, checkpoint=checkpoint), run(0.5)
    for one, other in zip(
        (*vars(counted.cycles(spot)).values(), *reached.section_forces(beam)),
        (*vars(whole.cycles(spot)).values(), *all_of_it.section_forces(beam)),
        strict=True,
    ):
        # The steps have the same size but for round-off, so forces differ by that of EA
        assert one == pytest.approx(other, rel=1e-6, abs=1e-13 * SECTION.EA)
    assert counted.duration == whole.duration == 0.5


# -- thinned histories -------------------------------------------------------------------------


def read(path):
    with path.open() as file:
        return list(csv.reader(file))


def test_history_of_some_steps_has_their_rows(shared_path, on_first_rank):
    beam, scene = mast(to_and_fro)
    names = ("all", "some", "few", "one")
    all_of_them, some, few, one = (shared_path / f"{name}.csv" for name in names)
    ub.simulate(
        scene,
        ub.EnergyMomentum(),
        t=(0, 0.5),
        dt=0.01,
        record=[
            ub.History(all_of_them, [beam.end]),
            ub.History(some, [beam.end], every=4),
            ub.History(few, [beam.end], max_rows=10),
            ub.History(one, [beam.end], every=3, max_rows=1),
        ],
    )

    def check():
        header, *rows = read(all_of_them)
        assert len(rows) == 51
        for path, every in ((some, 4), (few, 8), (one, 48)):
            assert read(path) == [header, *rows[::every]], path
        assert sorted(path.stem for path in shared_path.iterdir()) == sorted(names)
        return True

    assert on_first_rank(check)


def test_a_solution_is_thinned():
    _, scene = mast(to_and_fro)
    run = {"t": (0, 0.5), "dt": 0.01}
    whole = ub.simulate(scene, ub.EnergyMomentum(), **run)
    thin = ub.simulate(scene, ub.EnergyMomentum(), max_states=10, **run)
    # 0, 8, ..., 48 and the last one
    rows = [*range(0, 50, 8), 50]
    assert len(thin) == len(rows)
    assert np.array_equal(thin.times, whole.times[rows])
    assert np.array_equal(thin.q, whole.q[rows])
    assert np.array_equal(thin.v, whole.v[rows])
    assert np.array_equal(thin.energy["loads"], whole.energy["loads"][rows])
    assert np.array_equal(
        thin.reaction(scene.supports[0])[1:], whole.reaction(scene.supports[0])[rows][1:]
    )


# -- bad input ---------------------------------------------------------------------------------

PLACE = ub.Beam((0, 0), (1, 0), SECTION, name="arm").end


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: st.SNCurve(range=0.0), "SNCurve: range = 0 must be positive"),
        (lambda: st.SNCurve(range=1.0, cycles=-1.0), "cycles = -1 must be positive"),
        (lambda: st.SNCurve(range=1.0, slope=0.0), "slope = 0 must be positive"),
        (lambda: st.SNCurve(range=1.0, knee=0.0), "knee = 0 must be positive"),
        (lambda: st.SNCurve(range=1.0, limit=math.nan), "limit = nan is not finite"),
        (lambda: st.SNCurve(range=1.0, knee=5e6, limit=1e6), "limit = 1e[+]06 cycles lies before"),
        (lambda: st.SNCurve(range=1.0, mean=3.0), r"mean = 3\.0 must be a function"),
        (lambda: st.SNCurve.eurocode(-71e6), "must be positive"),
        (lambda: st.Goodman(0.0), "Goodman: ultimate = 0 must be positive"),
        (lambda: st.Gerber(math.inf), "Gerber: ultimate = inf is not finite"),
        (lambda: st.HotSpot.fibre(3, y=0.1, E=1.0), "HotSpot: place = 3 is not a Place"),
        (lambda: st.HotSpot.fibre(PLACE, y=math.nan, E=1.0), "arm.end .*: y = nan is not finite"),
        (lambda: st.HotSpot.fibre(PLACE, y=0.1, E=0.0), "E = 0 must be positive"),
        (lambda: st.HotSpot(PLACE, stress=1.0), r"stress = 1\.0 must be a function of \(N, V, M\)"),
        (lambda: st.Fatigue([PLACE], CURVE), r"spots\[0\] = .* is not a HotSpot"),
        (lambda: st.Fatigue(3, CURVE), r"spots\[0\] = 3 is not a HotSpot"),
        (lambda: st.Fatigue([], 71e6), r"curve = .* is not a SNCurve"),
        (lambda: st.Fatigue([], CURVE, resolution=-1.0), "resolution = -1 must be at least 0"),
        (lambda: ub.History("h.csv", every=0), "History h.csv: every = 0 must be a whole number"),
        (lambda: ub.History("h.csv", max_rows=1.5), r"max_rows = 1\.5 must be a whole number"),
        (lambda: ub.Extremes().section_forces(PLACE.beam), "Extremes: nothing was run"),
    ],
)
def test_bad_input_is_refused(make, message):
    with pytest.raises(ub.ArgumentError, match=message):
        make()


def test_bad_input_of_a_run():
    beam, scene = mast(to_and_fro)
    run = {"t": (0, 1), "dt": 0.1}
    with pytest.raises(ub.ArgumentError, match="simulate: max_states = 0 must be a whole number"):
        ub.simulate(scene, ub.EnergyMomentum(), max_states=0, **run)
    elsewhere = st.Fatigue(st.HotSpot(PLACE, stress=lambda N, V, M: M), CURVE)
    with pytest.raises(ub.ArgumentError, match="arm is not in the scene"):
        ub.simulate(scene, ub.EnergyMomentum(), record=elsewhere, **run)
    spot = st.HotSpot(beam.start, stress=lambda N, V, M: M[0])  # one number
    single = st.Fatigue(spot, CURVE)
    with pytest.raises(ub.ArgumentError, match=r"mast\.start .* a finite number for each"):
        ub.simulate(scene, ub.EnergyMomentum(), record=single, **run)
    with pytest.raises(ub.ArgumentError, match=r"nothing was counted at arm\.end"):
        single.cycles(st.HotSpot(PLACE, stress=lambda N, V, M: M))


# -- pictures ----------------------------------------------------------------------------------


def test_fatigue_and_extremes_have_pictures():
    beam, scene = mast(to_and_fro)
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)
    recorder, extremes = st.Fatigue(spot, CURVE), ub.Extremes()
    ub.simulate(
        scene, ub.EnergyMomentum(), t=(0, 0.4), dt=0.01, record=[recorder, extremes], max_states=4
    )
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
    with pytest.raises(ub.ArgumentError, match="is not one of"):
        ub.plot(extremes, "shape")


def test_a_spot_given_twice_is_counted_once():
    section = ub.Section.rectangle(E=2e11, b=0.1, h=0.2, nu=0.3, rho=7850.0)
    beam = ub.Beam((0, 0), (2, 0), section, cells=4)
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=2e11)
    load = ub.PointLoad(beam.end, force=(0, -1e4), amplitude=lambda t: np.sin(20 * t))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    once, twice = (st.Fatigue(spots, st.SNCurve.eurocode(71e6)) for spots in (spot, [spot] * 2))
    ub.simulate(scene, ub.Static(), t=(0, 3), dt=0.02, record=[once, twice], progress=False)
    assert once.life(spot) == twice.life(spot)


def test_equivalent_ranges_take_mean_stresses_into_account():
    curve = st.SNCurve(range=71e6, mean=st.Goodman(ultimate=500e6))
    cycles = st.rainflow([0.0, 100e6, 0.0, 100e6, 0.0])
    assert cycles.equivalent(curve) == pytest.approx(100e6 / (1 - 50e6 / 500e6))
