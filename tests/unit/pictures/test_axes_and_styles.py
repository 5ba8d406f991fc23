# SPDX-License-Identifier: MIT
"""Axes that the user gives, and settings and styles of Matplotlib that stay."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import same_color
from matplotlib.figure import Figure

import ufl_beam as ub
from ufl_beam.plotting import style
from ufl_beam.plotting.style import BLUE, INK

PLACED = {"history": 1.0, "moment-curvature": 1.0, "hinge": 0.0}
"""Pictures of a place, and its parameter along the beam."""

ONE_PANEL = ["scene", "extremes", "shape", "M", "shapes", "damage", "dissipation", *PLACED]


def draw(name, run, extremes, ax):
    if name in ("scene", "extremes"):
        return ub.plot(run.scene if name == "scene" else extremes, ax=ax)
    places = [run.scene.beams[0].at(PLACED[name])] if name in PLACED else []
    return ub.plot(run, name, *places, ax=ax)


@pytest.mark.parametrize("name", ONE_PANEL)
def test_a_picture_is_in_the_axes_of_the_user_only(damaged, extremes, name):
    """Neither the size nor other parts of the figure change; a figure is refused as axes."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = (part.subplots() for part in figure.subfigures(1, 2))
    assert draw(name, damaged, extremes, right) is figure
    figure.draw_without_rendering()
    assert right.has_data() or right.collections
    assert not left.has_data()
    assert not [*figure.legends, *left.figure.legends, *right.figure.legends]
    np.testing.assert_array_equal(figure.get_size_inches(), (10, 4))
    with pytest.raises(ub.ArgumentError, match=r"ax = .* must be axes of Matplotlib"):
        draw(name, damaged, extremes, figure)


def test_colours_suit_a_dark_background(damaged):
    def beam_of(figure):
        return max(figure.axes[0].lines, key=lambda line: line.get_zorder() == 4)

    with plt.style.context("dark_background"):
        dark, model = ub.plot(damaged), ub.plot(damaged.scene)
    for figure in (dark, model):
        assert same_color(figure.get_facecolor(), "black")
        assert same_color(figure.axes[0].get_facecolor(), "black")
        assert same_color(figure.axes[0].title.get_color(), "white")
        labels = figure.axes[0].get_xticklabels()
        assert all(same_color(label.get_color(), "white") for label in labels)
    assert same_color(beam_of(dark).get_color(), "white")
    assert same_color(beam_of(ub.plot(damaged)).get_color(), INK)
    edges = [c.get_edgecolor() for c in model.axes[0].collections if c.get_gid() == "beams"]
    assert all(same_color(edge[0], "white") for edge in edges)


def test_settings_of_matplotlib_are_used_and_not_changed(damaged):
    run, end = damaged, damaged.scene.beams[0].end
    settings = {"axes.edgecolor": "red", "figure.dpi": 80, "axes.prop_cycle": mpl.cycler(color="k")}
    with mpl.rc_context({**settings, "font.size": 26.0}):
        figure = ub.plot(run, "history", end)
        large = ub.plot(run, "M").axes[0].texts[0].get_fontsize()
    assert large == pytest.approx(2 * ub.plot(run, "M").axes[0].texts[0].get_fontsize())
    assert same_color(figure.axes[0].spines["left"].get_edgecolor(), "red")
    assert figure.dpi == 80
    assert same_color(figure.axes[0].lines[-1].get_color(), "k")
    figure = ub.plot(run, "history", end)
    assert not same_color(figure.axes[0].spines["left"].get_edgecolor(), "red")
    assert same_color(figure.axes[0].lines[-1].get_color(), BLUE)
    assert mpl.rcParams["font.size"] == mpl.rcParamsDefault["font.size"]  # left as they were


def labels_of(axis):
    """Labels of major and minor ticks in view."""
    low, high = axis.get_view_interval()
    minor = axis.get_minor_formatter().format_ticks(axis.get_minorticklocs())
    assert not any(minor)
    at = [tick for tick in axis.get_majorticklocs() if low <= tick <= high]
    return axis.get_major_formatter().format_ticks(at)


@pytest.mark.serial  # files
@pytest.mark.parametrize(
    ("limits", "labels"),
    [
        ((1e-3, 10.0), ["0.001", "0.01", "0.1", "1", "10"]),
        ((0.3, 3.0), ["0.5", "1", "2"]),
        ((0.026, 0.056), ["0.03", "0.035", "0.04", "0.045", "0.05", "0.055"]),
        ((9e-6, 1.1), [rf"$\mathdefault{{10^{{{n}}}}}$" for n in range(-5, 1)]),
        ((9e-7, 9e-6), [rf"$\mathdefault{{{x}10^{{-6}}}}$" for x in ("", r"2\times", r"5\times")]),
    ],
)
def test_labels_of_logarithmic_axes(tmp_path, limits, labels):
    """They are few and readable; ticks that the user sets stay."""
    with ub.picture((6, 4)) as figure:
        axes = figure.subplots()
        axes.set(xscale="log", yscale="log", xlim=limits, ylim=(1, 100))
        axes.set_yticks([3, 30], ["three", "thirty"])
    figure.savefig(tmp_path / "log.png")
    assert labels_of(axes.xaxis) == labels
    assert [text.get_text() for text in axes.get_yticklabels()] == ["three", "thirty"]


def test_colour_bars_in_space_leave_space_for_numbers():
    gaps = []
    for projection in (None, "3d"):
        with ub.picture((6, 4)) as figure:
            axes = figure.add_subplot(projection=projection)
            bar = style.draw_bar(axes, style.scale("viridis", 0.0, 1.0, 0.0, 1.0), "x")
        figure.draw_without_rendering()
        gaps.append(bar.ax.get_position().x0 - axes.get_position().x1)
    assert gaps[1] > gaps[0] + 0.02
