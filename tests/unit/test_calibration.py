# SPDX-License-Identifier: MIT
"""Calibration: linear problems in closed form, intervals, warnings, failed runs, wrong calls.

The reaction of a beam under two forces that grow with t and t² is a linear function of both forces
to round-off, so that estimates and covariances have closed forms.
"""

import contextlib
import warnings
from types import SimpleNamespace

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from scipy.stats import norm, t

import ufl_beam as ub
import ufl_beam.structures as st

STEEL = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
TIMES = np.linspace(0.0, 1.0, 41)
SIGMA = 0.1  # N


def pushed(a, b, factor=1.0):
    """A cantilever under the force a t + b t²; N."""
    beam = ub.Beam((0, 0), (1, 0), STEEL, cells=1, name="beam")
    forces = (
        ub.PointLoad(beam.end, force=(factor * a, 0), amplitude=lambda s: s),
        ub.PointLoad(beam.end, force=(factor * b, 0), amplitude=lambda s: s * s),
    )
    return clamped(beam, loads=forces)


def force(run):
    """Force on the support of a run; N."""
    return -run.reaction(run.scene.supports[0])[:, 0]


def truth(a=2.0, b=-3.0, factor=1.0, times=TIMES):
    return factor * (a * times + b * times**2)


def single(a):
    return pushed(a, 0.0)


def tip(run):
    return run.displacement(run.scene["beam"].end)[:, 1]


def measurement(values=None, *, times=TIMES, seed=0, **options):
    """Noisy values of the force by default, from steps that end at their times."""
    if values is None:
        noise = np.random.default_rng(seed).normal(size=len(times))
        values = truth(factor=options.get("arguments", {}).get("factor", 1.0), times=times)
        values = values + SIGMA * noise
    options = {"quantity": force, "scheme": ub.Static(), "t": (0, 1), "dt": 0.025, **options}
    return st.Measurement(times, values, **options)


WITHIN = {"a": (1.0, -10.0, 10.0), "b": (1.0, -10.0, 10.0)}


def fit(measured, parameters=WITHIN, model=pushed, **options):
    several = [measured] if isinstance(measured, st.Measurement) else measured
    return st.calibrate(model, parameters, several, **options)


def warned(pattern):
    """A context in which the first process warns."""
    first = MPI.COMM_WORLD.rank == 0
    return pytest.warns(ub.ModelWarning, match=pattern) if first else contextlib.nullcontext()


def design(times=TIMES):
    """Matrix of the linear problem."""
    return np.stack([times, times**2], axis=1)


def test_estimates_and_covariance_of_a_linear_problem_are_those_of_least_squares():
    known, measured = fit(measurement(sigma=SIGMA)), measurement()
    A, y = design(), np.asarray(measured.values)
    best = np.linalg.lstsq(A, y, rcond=None)[0]
    # The search ends when a step changes variables, in units of 10 N, by less than 1e-10.
    np.testing.assert_allclose([*known.parameters.values()], best, rtol=1e-8)
    covariance = SIGMA**2 * np.linalg.inv(A.T @ A)
    # Derivatives are differences with the round-off of runs, 1e-12, over the step 2**-16.
    np.testing.assert_allclose(known.covariance, covariance, rtol=1e-6)
    deviations = np.sqrt(covariance.diagonal())
    correlations = covariance / np.outer(deviations, deviations)
    np.testing.assert_allclose(known.correlations, correlations, rtol=1e-6)
    rest = y - A @ best
    np.testing.assert_allclose(known.residuals[0], rest, atol=1e-8)
    assert known.cost == pytest.approx(0.5 * np.sum(rest**2) / SIGMA**2)
    estimated = fit(measured)
    s = np.sqrt(np.sum(rest**2) / (len(y) - 2))
    np.testing.assert_allclose(estimated.sigma[0], s, rtol=1e-8)
    for result, sigma, quantile in (
        (known, SIGMA, norm.ppf(0.975)),
        (estimated, s, t.ppf(0.975, len(y) - 2)),
    ):
        half = quantile * sigma / SIGMA * deviations
        np.testing.assert_allclose(result.half_widths, half, rtol=1e-6)
        for (low, high), p, w in zip(result.intervals.values(), best, half, strict=True):
            np.testing.assert_allclose((low, high), (p - w, p + w), rtol=1e-6)
    exact = fit(measurement(truth()))  # without errors
    np.testing.assert_allclose([*exact.parameters.values()], [2.0, -3.0], rtol=1e-6)
    assert exact.cost < len(TIMES)
    # no warning is issued


def test_weights_of_several_measurements_agree_with_their_estimated_deviations():
    """A fixed point: deviations from residuals, and the minimum with these deviations."""
    rng = np.random.default_rng(3)
    late = np.linspace(0.5, 1.0, 21)
    first = measurement(truth() + 0.1 * rng.normal(size=len(TIMES)))
    second = measurement(
        truth(times=late) + 0.5 * rng.normal(size=len(late)), times=late, name="late"
    )
    result = fit([first, second])
    A, y = [design(), design(late)], [np.asarray(m.values) for m in (first, second)]
    s = np.array([1.0, 1.0])
    for _ in range(100):
        W = np.concatenate([rows / d for rows, d in zip(A, s, strict=True)])
        scaled = np.concatenate([v / d for v, d in zip(y, s, strict=True)])
        p = np.linalg.lstsq(W, scaled, rcond=None)[0]
        C = np.linalg.inv(W.T @ W)
        s = np.array([
            np.sqrt(np.sum((v - rows @ p) ** 2) / (len(v) - np.trace(rows @ C @ rows.T) / d**2))
            for rows, v, d in zip(A, y, s, strict=True)
        ])  # fmt: skip
    # Rounds end when deviations change by less than 1e-3, and each round gains a factor of ten.
    np.testing.assert_allclose([d[0] for d in result.sigma], s, rtol=1e-3)
    deviations = np.sqrt(np.linalg.inv(W.T @ W).diagonal())
    assert (np.abs(np.array([*result.parameters.values()]) - p) < 1e-3 * deviations).all()
    alone = np.sqrt(np.linalg.inv(A[1].T @ A[1]).diagonal()) * s[1] * t.ppf(0.975, 60)
    np.testing.assert_allclose(result.half_widths_alone[1], alone, rtol=1e-3)
    assert result.identified_by == {"a": "measurement", "b": "measurement"}


def test_too_few_values_for_an_estimate_of_their_deviation_are_refused():
    """Without a refusal the fit would go through them, and their deviation would become 1e-9."""
    for values, at in (([-1.2], [-1]), ([-0.2, -1.1], [20, 40])):
        numbers = {"times": None, "quantity": lambda run, at=at: force(run)[at]}
        few = measurement(values, name="few", **numbers)
        words = f"few has {len(at)} value", ", too few to estimate a standard deviation", "sigma="
        with raises(*words):
            fit([measurement(sigma=1.0), few])


def test_intervals_of_positive_parameters_are_symmetric_in_their_logarithm():
    values, times = np.exp([0.1, -0.1, 0.05]) * [0.5, 1.0, 1.5], np.array([0.5, 1.0, 1.5])
    measured = measurement(values, times=times, t=(0, 2), dt=0.5, sigma=0.1)
    result = fit(measured, {"a": 3.0}, single)
    a = times @ values / (times @ times)  # the force is a t
    assert result.parameters["a"] == pytest.approx(a)
    w = norm.ppf(0.975) * 0.1 / np.linalg.norm(times) / a
    np.testing.assert_allclose(result.intervals["a"], a * np.exp([-w, w]), rtol=1e-6)
    assert result.half_widths[0] == pytest.approx(w * a)


class Stored(SimpleNamespace):
    """A run with stored times alone."""

    def __len__(self):
        return len(self.times)


def interpolated(at, times, values):
    """Computed values at measured times, from a history at stored times."""
    options = {"quantity": lambda run: values, "t": (times[0], times[-1])}
    return measurement(np.zeros(len(at)), times=at, **options).computed(Stored(times=times))


def test_interpolation_is_exact_for_cubics_and_of_fourth_order():
    times = np.array([0.0, 0.1, 0.3, 0.4, 0.7, 1.0])
    at = np.linspace(0, 1, 23)
    cubic = np.poly1d([1.0, -2.0, 0.5, 3.0])
    np.testing.assert_allclose(interpolated(at, times, cubic(times)), cubic(at), atol=1e-14)
    stored = np.exp(times)
    np.testing.assert_allclose(interpolated(times, times, stored), stored, rtol=1e-15)
    at_end = measurement(np.zeros(3), times=np.arange(1, 4) * 0.1, t=(0, 0.3), dt=0.1)
    assert at_end.times[-1] == 0.3  # 3 times 0.1 is above it
    two = times[:2]
    assert interpolated([0.025], two, two) == pytest.approx([0.025])  # two times: a line
    h = np.array([0.02, 0.01])
    at = np.linspace(0, 1, 997)
    errors = [
        np.abs(interpolated(at, x, np.sin(9 * x)) - np.sin(9 * at)).max()
        for x in (np.arange(0, 1 + d / 2, d) for d in h)
    ]
    assert np.log2(errors[0] / errors[1]) > 3.9


def test_interpolation_at_fourth_order_is_of_sixth_order():
    """Its error is below that of the steps; with four states it would be above it."""
    section = ub.Section(EA=1e3, GA=1e3, EI=30.0, rhoA=1.0, rhoI=0.5)
    beam = ub.Beam((0, 0), (3, 0), section, cells=1, name="beam")
    load = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=lambda s: np.sin(s) ** 4)
    scene, fourth = clamped(beam, loads=[load]), ub.EnergyMomentum(order=4)
    fine, coarse = (ub.simulate(scene, fourth, t=(0, 3), dt=dt) for dt in (0.01, 0.1))
    options = {"quantity": tip, "scheme": fourth, "t": (0, 3), "dt": 0.1}
    at = measurement(np.zeros(301), times=fine.times, **options)
    steps = np.abs(tip(coarse) - tip(fine)[::10]).max()
    assert np.abs(at.computed(coarse) - tip(fine)).max() < 1.5 * steps


def controlled(a, b):
    """The forces of `pushed` by a controller, which has no derivatives; none of less than -3.5."""
    if b < -3.5:
        raise ub.ModelError("too large")
    beam = ub.Beam((0, 0), (1, 0), STEEL, cells=1, name="beam")
    law = ub.Controller(lambda now: a * now.t + b * now.t**2)
    pull = ub.Slide(ub.ground(1, 0), beam.end, law, axis=(1, 0))
    return clamped(beam, connectors=[pull])


@pytest.mark.parametrize(("b", "start"), [(-3.0, 1.0), (-3.0, 2.0), (-3.4999999, -3.0)])
def test_effects_without_derivatives_have_differences_of_runs(b, start):
    """Estimates of a linear problem; one-sided at the bound 2 of b, and where runs fail."""

    def forces(**at):
        run = ub.simulate(controlled(**at), ub.Static(), t=(0, 1), dt=0.025)
        return force(run)

    measured = measurement(forces(a=2.0, b=b), sigma=SIGMA)
    result = fit(measured, {"a": (1.0, -10.0, 10.0), "b": (start, -10.0, 2.0)}, controlled)
    assert list(result.parameters.values()) == pytest.approx([2.0, b], abs=1e-5)
    columns = np.column_stack([forces(a=1.0, b=0.0), forces(a=0.0, b=1.0)]) / SIGMA
    deviations = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    np.testing.assert_allclose(result.half_widths / norm.ppf(0.975), deviations, rtol=1e-5)


def test_a_first_row_without_a_value_is_left_out():
    def acceleration(run):
        return run.acceleration(run.scene["beam"].end)[:, 0]

    options = {"quantity": acceleration, "scheme": ub.EnergyMomentum(), "t": (0, 0.1), "dt": 1e-3}
    times = np.array([0.01, 0.02, 0.03])
    later = measurement([1.0, 2.0, 3.0], times=times, **options)
    run = ub.simulate(single(2.0), ub.EnergyMomentum(), t=(0, 0.1), dt=1e-3)
    np.testing.assert_allclose(later.computed(run), acceleration(run)[[10, 20, 30]], rtol=1e-9)
    early = measurement([1.0, 2.0], times=[0.0, 0.1], **options)
    with raises("quantity returned nan at the beginning", "before 0.001"):
        early.computed(run)


def test_values_without_times_are_compared_as_they_are():
    def at_end(run):
        return force(run)[-1]

    result = fit(measurement([4.0], times=None, quantity=at_end, sigma=0.1), {"a": 1.0}, single)
    assert result.parameters["a"] == pytest.approx(4.0)
    assert "measurement: 1 value, " in str(result)
    below = ub.plot(result).axes[1]
    assert below.get_xlabel() == "number of the value"
    assert [x for x in below.get_xticks() if 0.5 <= x <= 1.5] == [1.0]


def test_arguments_distinguish_the_runs_of_measurements():
    """The second test has ten times the force and the same errors, so its interval is a tenth."""
    measured = [
        measurement(sigma=SIGMA, name="small"),
        measurement(sigma=SIGMA, name="large", arguments={"factor": 10.0}, seed=1),
    ]
    result = fit(measured)
    small, large = result.half_widths_alone
    np.testing.assert_allclose(small, 10 * large, rtol=1e-6)
    assert result.identified_by == {"a": "large", "b": "large"}
    assert "± by small" in str(result)


def test_starts_end_at_the_same_minimum_and_others_are_reported():
    """The force a² + a/5 has two minima, at the truth a = 1 and near -1.2 with a larger cost."""

    def model(a, b):
        return pushed(a * a + 0.2 * a, b)

    measured = measurement(truth(1.2, 1.0), sigma=SIGMA)
    bounds = {"a": (0.5, -0.8, 3.0), "b": (0.5, -5.0, 5.0)}
    result = fit(measured, bounds, model, starts=12)
    one, again, other = (fit(measured, bounds, model, starts=2, **x) for x in ({}, {}, {"seed": 1}))
    assert np.array_equal(one.end_costs, again.end_costs)
    assert not np.array_equal(one.starts, other.starts)
    assert result.parameters["a"] == pytest.approx(1.0, abs=1e-6)
    assert result.starts[0].tolist() == [0.5, 0.5]
    assert ((result.starts >= [-0.8, -5.0]) & (result.starts <= [3.0, 5.0])).all()
    best = np.abs(result.ends[:, 0] - 1.0) < 1e-4
    assert 6 <= best.sum() == result.same_minimum < 12  # the others are at the bound -0.8
    np.testing.assert_allclose(result.ends[~best, 0], -0.8, atol=1e-3)
    assert f"{best.sum()} of 12 starts end at the least cost" in str(result)
    assert "times this cost, a = -0.8" in str(result)


def rubbing(limit, hardening):
    """A beam that yields and rubs at its end."""
    bends = ub.ElastoPlastic(limit, isotropic=hardening)
    section = ub.Section(EA=2e6, GA=8e5, EI=2e3, rhoA=5.0, rhoI=0.01, bending=bends)
    beam = ub.Beam((0, 0), (2, 0), section, cells=6, name="beam")
    rub = ub.Slide(ub.ground(2, 0), beam.end, ub.Coulomb(20.0), axis=(0, 1))
    push = ub.Table([0, 0.1, 0.2], [0, 1, 0])
    load = ub.PointLoad(beam.end, force=(0, -300.0), amplitude=push)
    return clamped(beam, masses=[ub.PointMass(beam.end, 10.0)], connectors=[rub], loads=[load])


@pytest.mark.parametrize("start", [{"limit": (250.0, 100, 500), "hardening": (300.0, 10, 5000)},
                                   {"limit": 250.0, "hardening": 400.0}])  # fmt: skip
def test_a_search_goes_on_where_computed_values_jump(start):
    """They jump where friction sticks in another step; the cost there is 12 % above the least."""
    options = {"scheme": ub.EnergyMomentum(0.05, 0.05), "t": (0, 0.5), "dt": 2.5e-3}
    run = ub.simulate(rubbing(300.0, 500.0), **options)
    times, random = np.arange(0.01, 0.5, 0.01), np.random.default_rng(1)
    values = np.interp(times, run.times, tip(run))
    values += 0.002 * np.abs(values).max() * random.normal(size=len(times))
    with warned("hardly distinguish limit and hardening"):
        found = fit([st.Measurement(times, values, tip, **options)], start, model=rubbing)
    low, high = found.intervals["limit"]
    assert low < 300.0 < high
    assert np.sum(found.residuals[0] ** 2) < 9.5e-6


@pytest.mark.parametrize(
    ("words", "measured", "start", "model", "finite"),
    [
        ("do not determine a and b: they have the same effect",
         measurement(truth(2.0, 0.0), sigma=SIGMA), {"a": 1.0, "b": 3.0},
         lambda a, b: single(a * b), [False, False]),
        ("hardly distinguish a and b: .* -1.0000",
         measurement(truth(2.0, 0.03), sigma=1e-4), {"a": 1.2, "b": 0.8},
         lambda a, b: pushed(a + b, 0.03 * b), [True, True]),
        # The second force acts where the first one is above 2.5 N only
        ("do not determine b: it has no effect",
         measurement(truth(2.0, 0.0), sigma=SIGMA), {"a": 3.0, "b": 0.1},
         lambda a, b: pushed(a, max(a - 2.5, 0.0) * b), [True, False]),
        ("hardly determine a: its 95 % interval is",
         measurement(sigma=10.0), {"a": 1.0}, single, [True]),
    ],
)  # fmt: skip
def test_parameters_that_are_not_determined_are_named(words, measured, start, model, finite):
    with warned(words):
        result = fit(measured, start, model)
    assert np.isfinite(result.half_widths).tolist() == finite
    if not any(finite):
        assert result.identified_by["a"] == "all together"
        assert result.parameters["a"] * result.parameters["b"] == pytest.approx(2.0)
        assert len(result.warnings) == 1
        assert result.warnings[0] in str(result)


def test_bounds_hold_and_are_named():
    data = measurement(truth(2.0, 0.0), sigma=SIGMA)
    for entry, side, end in (
        ((1.0, 0.5, 1.5), "upper", 1.5), ((3.0, 2.5, None), "lower", 2.5),
        ((1.0, None, 1.5), "upper", 1.5), ((-3.0, None, -1.0), "upper", -1.0),
    ):  # fmt: skip
        with warned(f"a = {end:g} is at its {side} bound"):
            result = fit(data, {"a": entry}, single)
        assert result.parameters["a"] == pytest.approx(end, rel=1e-3)
        assert side == "lower" or result.intervals["a"][1] <= end
    assert fit(data, {"a": (1.0, 0.0, None)}, single).warnings == ()


def test_failed_runs_shorten_the_step_of_the_search():
    """A beam breaks under more than 2.5 N, where most random starts are."""
    law = ub.Softening(limit=2.5, fracture_energy=1.0)

    def model(a):
        beam = ub.Beam((0, 0), (1, 0), STEEL, cells=4, name="beam", hinges={0.0: law})
        return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, -a), amplitude=lambda s: s)])

    def moment(run):
        return run.reaction(run.scene.supports[0])[:, 2]

    options = {"quantity": moment, "scheme": ub.Static(), "t": (0, 1), "dt": 0.25, "sigma": 0.01}
    run = ub.simulate(model(2.45), ub.Static(), t=(0, 1), dt=0.25)
    measured = measurement(moment(run), times=run.times, **options)
    result = fit(measured, {"a": (0.1, 0.01, 100.0)}, model, starts=4)
    assert result.failed > 0
    assert f"{result.failed} failed" in repr(result)
    assert result.same_minimum == 4
    assert result.parameters["a"] == pytest.approx(2.45, rel=1e-6)
    with raises("calibrate: the run at the start failed; give another", kind=ub.ConvergenceError):
        fit(measured, {"a": 50.0}, model)


def test_warnings_of_runs_in_the_search_are_not_repeated():
    def model(a, b):
        warnings.warn("odd", ub.ModelWarning, stacklevel=1)
        return pushed(a, b)

    with pytest.warns(ub.ModelWarning, match="odd") as found:
        fit(measurement(sigma=SIGMA), model=model)
    assert len(found) == 1  # of the final run


def test_results_are_shown_as_text_table_and_picture():
    result = fit([measurement(sigma=SIGMA, name="first"), measurement(seed=1, name="second")])
    assert repr(result).startswith("<Calibration: 2 parameters, 2 measurements, ")
    parts = "95 % interval", "± by first", "correlations: b, a -0.9", "0.1 (given)", "(estim"
    assert all(part in str(result) for part in parts)
    page = result._repr_html_()
    assert "<table>" in page
    assert 'alt="measured and computed values"' in page
    figure = ub.plot(result)
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == ["first", "second"]
    assert len(figure.axes) == 4
    points = figure.axes[2].lines[1].get_ydata()
    np.testing.assert_allclose(points, result.residuals[0] / SIGMA)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (("times[1] = 1.5 is outside the run from 0 to 1",), {"times": [0.5, 1.5]}),
        (("times must increase", "0.5 follows 0.5"), {"times": [0.5, 0.5]}),
        (("3 times and 2 values",), {"times": [0.1, 0.2, 0.3]}),
        (("values[1]", "not finite"), {"values": [1.0, np.nan]}),
        (("values is empty",), {"times": [], "values": []}),
        (("sigma must be a positive number, or one for each",), {"sigma": [1.0, -1.0]}),
        (("sigma has 3 standard deviations for 2 values",), {"sigma": [1.0, 1.0, 1.0]}),
        (("must come after",), {"t": (1, 0)}),
        (("dt", "not a number"), {"dt": ub.Adaptive(1e-3)}),
    ],
)
def test_wrong_measurements_are_refused(words, options):
    options = {"times": [0.5, 1.0], "values": [1.0, 2.0], **options}
    with raises(*words):
        measurement(options.pop("values"), **options)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (("the model: got an unexpected keyword argument 'c'", "arguments are a, b, factor"),
         {"parameters": {"a": 1.0, "b": 1.0, "c": 1.0}}),
        (("the model: missing a required argument: 'b'",), {"parameters": {"a": 1.0}}),
        (("factor is a parameter, and an argument of <Measurement",),
         {"parameters": {**WITHIN, "factor": 1.0},
          "measured": measurement(arguments={"factor": 2.0})}),
        (("parameters is empty",), {"parameters": {}}),
        (("parameters['a'] = (1.0, 2.0)", "(start, lower, upper)"),
         {"parameters": {"a": (1.0, 2.0), "b": 1.0}}),
        (("parameters['a']: 1 is not between the bounds 2 and inf",),
         {"parameters": {"a": (1.0, 2.0, None), "b": 1.0}}),
        (("parameters['a'] = 0 has no scale",), {"parameters": {"a": 0.0, "b": 1.0}}),
        (("2 measured values are too few for 2 parameters and a standard deviation",),
         {"measured": measurement([1.0, 2.0], times=[0.5, 1.0])}),
        (("1 measured values are too few for 2 parameters;",),
         {"measured": measurement([1.0], times=[0.5], sigma=1.0)}),
        (("5 starts need bounds of b",), {"parameters": {**WITHIN, "b": 1.0}, "starts": 5}),
    ],
)  # fmt: skip
def test_wrong_calls_are_refused_before_any_run(words, options):
    runs = []

    def quantity(run):
        runs.append(run)
        return force(run)

    options = {"measured": measurement(quantity=quantity), **options}
    with raises(*words):
        fit(**options)
    assert not runs


@pytest.mark.parametrize(
    ("words", "quantity"),
    [
        (("shape (41, 3)", "one number for each stored time", "(41,)"),
         lambda run: run.displacement(run.scene["beam"].end)),
        (("returned 'text', not numbers",), lambda run: "text"),
        (("returned nan at index 40",), lambda run: np.append(force(run)[:-1], np.nan)),
    ],
)  # fmt: skip
def test_wrong_quantities_are_named(words, quantity):
    with raises("Measurement measurement: quantity", *words):
        fit(measurement(quantity=quantity))


def test_parameters_without_effect_are_refused_before_the_search():
    with raises("the parameter b has no effect on the computed values at its start"):
        fit(measurement(), model=lambda a, b: single(a))
