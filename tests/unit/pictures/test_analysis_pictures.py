# SPDX-License-Identifier: MIT
"""Pictures of analyses of structures: their curves and labels."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import STEEL, boxes_of, circles, outlines, require_apart, texts
from helpers import raises
from matplotlib.figure import Figure
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.plotting.style import BLUE, RED


def column(**more):
    return ub.Beam((0, 0), (0, 2), STEEL, cells=4, name="column", **more)


def test_a_capacity_curve_shows_hinges_and_targets():
    beam = column(hinges={0.0: ub.ElastoPlastic(5e4, isotropic=1e5)})  # N m, N m/rad
    scene = clamped(beam, masses=[ub.PointMass(beam.end, 5e3)])
    curve = st.pushover(scene, beam.end, -0.05, steps=10)
    targets = curve.n2(lambda T: 8.0, 0.5), curve.asce41(lambda T: 8.0)
    figure = ub.plot(curve, targets=targets)
    axes = figure.axes[0]
    expected = np.column_stack([curve.displacement, curve.base_shear / 1e3])
    np.testing.assert_allclose(axes.lines[0].get_xydata(), expected)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "1: column.start (0, 0) yields" in labels
    assert {label.split(":")[0] for label in labels} == {"N2", "ASCE 41", "1"}
    lines = [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == ":"]
    np.testing.assert_allclose(lines, [-target.displacement for target in targets])
    assert axes.get_ylabel() == "base shear (kN)"
    # Fifteen hinges in a quarter of the curve have numbers that are apart, or no number
    several = [
        curve.hinges[0]._replace(n=k, displacement=-0.05 + 8e-4 * k, base_shear=5e4 - 100.0 * k)
        for k in range(15)
    ]
    for ax in (None, Figure(figsize=(6, 4), layout="constrained").subplots()):
        figure = ub.plot(replace(curve, hinges=tuple(several)), ax=ax)
        assert len(circles(figure.axes[0])) == 15
        assert len(texts(figure)) > 10
        require_apart(boxes_of(figure), figure.bbox)


def test_responses_and_combinations_have_both_signs():
    beam = column()
    scene = clamped(beam)
    cases = {"W": [ub.PointLoad(beam.end, force=(1e3, -1e3))]}
    factors = {"left": {"W": 1.5}, "right": {"W": -1.5}}
    for found, words in (
        (st.response_spectrum_analysis(scene, lambda T: 3.0, n=6), "by response spectrum"),
        (st.load_combinations(scene, cases, factors), "of 2 load combinations"),
    ):
        figure = ub.plot(found, "V")
        assert len(outlines(figure, RED)) == len(outlines(figure, BLUE)) == 1
        assert figure.axes[0].get_title(loc="left").endswith(words)


def test_a_study_is_drawn_over_each_number_that_its_cases_vary():
    """Arrays by their largest magnitude; neither over names nor over equal numbers."""

    def member(a, b, name, fixed):
        return {"sum": a + b, "motion": np.array([a, -3 * b])}

    cases = [(1.0, 5, "x"), (2.0, 7, "y"), (4.0, 6, "x")]
    cases = [{"a": a, "b": b, "name": name, "fixed": 1.0} for a, b, name in cases]
    study = ub.study(member, cases)
    axes = np.reshape(ub.plot(study).axes, (2, 2))
    for panels, expected in zip(axes, ([15, 21, 18], [6, 9, 10]), strict=True):
        for panel, x in zip(panels, ([1, 2, 4], [5, 7, 6]), strict=True):
            np.testing.assert_array_equal(panel.lines[0].get_xydata(), np.transpose([x, expected]))
    assert [x.get_xlabel() for x in axes[1]] == ["a", "b"]
    assert [x.get_ylabel() for x in axes[:, 0]] == ["motion", "sum"]
    with raises("plot: the study has no results over numbers of its cases"):
        ub.plot(ub.study(lambda name: {"x": 1.0}, [{"name": "x"}]))


def test_demand_curves_end_at_collapse():
    """Beside the points of the probability of collapse and the fitted curve."""
    study = ub.Study("none", (), {}, {}, np.zeros(0))
    demand = np.array([[0.1, 0.2, 0.5], [0.1, 0.6, 0.3], [0.2, 0.3, 0.7]])
    outcome = (demand > 0.4).astype(float)
    curves = st.DemandCurves(
        ("a", "b", "c"), np.array([1.0, 2.0, 3.0]), 0.4, demand, np.ones((3, 3)), outcome, study
    )
    left, right = ub.plot(curves).axes
    np.testing.assert_array_equal(left.lines[1].get_xydata(), [[0, 0], [0.1, 1], [0.4, 2]])
    np.testing.assert_array_equal(left.lines[4].get_xydata()[:3], [[0, 0], [0.1, 1], [0.3, 2]])
    np.testing.assert_allclose(right.lines[1].get_xydata(), [[0, 1], [1 / 3, 2], [2 / 3, 3]])
    curve = right.lines[0].get_xydata()
    np.testing.assert_allclose(curve[:, 0], curves.fragility()(curve[:, 1]))
    certain = replace(curves, outcome=0 * outcome)
    assert len(ub.plot(certain).axes) == 1  # nothing collapses
    labels = "drift (1)", "spectral acceleration (m/s²)"
    for figure, words in (
        (ub.plot(certain), ("demand", "intensity")),
        (ub.plot(replace(certain, labels=("drift", "g"))), ("drift", "g")),
        (ub.plot(curves, labels=labels), labels),
    ):
        assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == words
    for wrong in (("drift",), "ab", (1, 2)):
        with pytest.raises(ub.ArgumentError, match="plot: labels"):
            ub.plot(curves, labels=wrong)
