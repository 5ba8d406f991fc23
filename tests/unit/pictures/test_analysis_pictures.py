# SPDX-License-Identifier: MIT
"""Pictures of analyses of structures: their curves and labels."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import boxes_of, circles, outlines, require_apart, texts
from matplotlib.figure import Figure

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.plotting.style import BLUE, RED


def test_a_capacity_curve_shows_hinges_and_targets():
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    law = ub.ElastoPlastic(5e4, isotropic=1e5)  # N m, N m/rad
    column = ub.Beam((0, 0), (0, 2), section, cells=2, hinges={0.0: law}, name="column")
    scene = ub.Scene(
        [column], supports=[ub.Clamped(column.start)], masses=[ub.PointMass(column.end, 5e3)]
    )
    curve = st.pushover(scene, column.end, -0.05, steps=10, progress=False)
    targets = curve.n2(lambda T: 8.0, 0.5), curve.asce41(lambda T: 8.0)
    figure = ub.plot(curve, targets=targets)
    axes = figure.axes[0]
    np.testing.assert_allclose(
        axes.lines[0].get_xydata(), np.column_stack([curve.displacement, curve.base_shear / 1e3])
    )
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
        axes = figure.axes[0]
        assert len(circles(axes)) == 15
        assert len(texts(figure)) > 10
        require_apart(boxes_of(figure), figure.bbox)


def test_a_response_to_a_spectrum_has_both_signs():
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    column = ub.Beam((0, 0), (0, 2), section, cells=4, name="column")
    scene = ub.Scene([column], supports=[ub.Clamped(column.start)])
    response = st.response_spectrum_analysis(scene, lambda T: 3.0, n=6)
    axes = ub.plot(response, "V").axes[0]
    assert len(outlines(axes.figure, RED)) == len(outlines(axes.figure, BLUE)) == 1
    assert axes.get_title(loc="left").endswith("by response spectrum")


def test_an_envelope_of_combinations_has_both_extremes():
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    column = ub.Beam((0, 0), (0, 2), section, cells=2, name="column")
    scene = ub.Scene([column], supports=[ub.Clamped(column.start)])
    cases = {"W": [ub.PointLoad(column.end, force=(1e3, -1e3))]}
    found = st.load_combinations(
        scene, cases, {"left": {"W": 1.5}, "right": {"W": -1.5}}, progress=False
    )
    axes = ub.plot(found, "V").axes[0]
    assert len(outlines(axes.figure, RED)) == len(outlines(axes.figure, BLUE)) == 1
    assert axes.get_title(loc="left").endswith("of 2 load combinations")


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
    fit = curves.fragility()
    curve = right.lines[0].get_xydata()
    np.testing.assert_allclose(curve[:, 0], fit(curve[:, 1]))
    certain = st.DemandCurves(
        curves.motions, curves.intensities, 0.4, demand, curves.end, 0 * outcome, study
    )
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
