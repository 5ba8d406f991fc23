# SPDX-License-Identifier: MIT
"""Picture of a model before a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import counted, html_page
from ufl_beam.model.constraint_checks import require_independent
from ufl_beam.model.loads import Gravity, Load, Rayleigh, RotatingFrame
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.model.works import Effect
from ufl_beam.plotting import notebook, style
from ufl_beam.plotting.model_drawing import (
    CAPTIONS,
    MOST_LABELS,
    NAMES,
    Drawing,
    Subject,
    draw,
    in_time,
)
from ufl_beam.plotting.positions import Placed, place, segments
from ufl_beam.plotting.style import POINTS, RED, TEXT, WHITE, font_size, shade, with_unit
from ufl_beam.plotting.symbols import draw_strokes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST, MOST = (5.5, 3.0), (9.0, 6.8)  # least and largest size of a new figure; inch
LEFT, RIGHT, BELOW, ABOVE, REMARK = 66.0, 14.0, 46.0, 34.0, 16.0  # space around the axes; points
LABEL_SIZE, TITLE_SIZE, ARROW_SIZE = 11.0, 14.0, 26.0  # font sizes; points
ARROW_WIDTH = 60.0  # width for the arrow of a load on the whole scene, with spacing; points

Measure = Callable[[str], Array]  # returns half the width and height of a text; (2,); points
UNBOUNDED = np.array([-np.inf, -np.inf, np.inf, np.inf])  # frame of unknown position


def draw_model(scene: Scene, *, ax: Axes | None = None) -> Figure:
    """Draw the undeformed model, before any run.

    It shows beams, their cells and names, bodies, joints, supports, connectors with parameters,
    hinges, loads (red), masses, prescribed motions (orange) and initial velocities (green).  Loads
    that turn with their place have hollow arrow heads.  Drives that prescribe
    a motion are filled with orange; drives that prescribe a force are hollow.  Labels for which
    there is no space are omitted.
    """
    require_independent(scene)
    subject = Subject(scene)
    alike = [f"{number} connectors: {words}" for words, number in subject.alike.items()]
    notes = [*subject.hinge_notes, *alike, *model_notes(scene)]
    cells = (subject.cells, "cell", "cells")
    beams, bodies = (len(scene.beams), "beam", "beams"), (len(scene.bodies), "body", "bodies")
    title = f"model: {counted(beams, cells, bodies)}"
    with style.panel(ax, MOST) as axes:
        measure: Measure = cache(lambda text: style.half_size(axes, text, font_size(LABEL_SIZE)))
        line_height = font_size(REMARK)
        axes.set(xlabel="x (m)", ylabel="y (m)")
        pad = 8.0 + line_height * len(notes)
        axes.set_title(title, loc="left", fontsize=font_size(TITLE_SIZE), pad=pad)
        for k, words in enumerate(reversed(notes)):
            axes.annotate(
                words, (0.0, 1.0), (0.0, 6.0 + line_height * k), xycoords="axes fraction",
                textcoords="offset points", fontsize=font_size(LABEL_SIZE),
                color=shade(subject.hinge_notes.get(words, TEXT)), gid="notes",
            )  # fmt: skip
        if ax is None:
            style.parent_figure(axes).set_layout_engine("none")
            around = LEFT + RIGHT, font_size(BELOW + ABOVE + REMARK * len(notes))
            least, most = (POINTS * np.array(size) - around for size in (LEAST, MOST))
            # at least as wide as the texts above the axes
            texts = [text for text, *_ in map(scene_load_caption, scene.loads) if text]
            widths = [2 * measure(text)[0] + ARROW_WIDTH for text in texts]
            first = 2 * TITLE_SIZE / LABEL_SIZE * measure(title)[0] + sum(widths)
            above = max([first, *(2 * measure(words)[0] for words in notes)])
            least[0] = min(max(least[0], above), most[0])
        else:
            least = most = style.lay_out(axes)
        drawing, placed, frame = _planned(subject, measure, least, most)
        _fit(axes, drawing.scale, frame, len(notes) if ax is None else None)
        draw_strokes(axes, drawing.strokes)
        _write(axes, placed, drawing.scale)
        # Loads on the whole scene are stated above the axes, at the right.
        x, y = frame[2:] - frame[:2] + (0.0, 17.0)
        for text, arrow, angle in filter(any, map(scene_load_caption, scene.loads)):
            for words, size, rotation in ((text, LABEL_SIZE, 0.0), (arrow, ARROW_SIZE, angle)):
                axes.annotate(
                    words, (x, y), xycoords="axes points", ha="right", va="center", color=RED,
                    fontsize=font_size(size), rotation=rotation, annotation_clip=False,
                    gid="badges",
                )  # fmt: skip
                x -= 2 * float(measure(text)[0]) + 6.0 if words is text else ARROW_WIDTH
    return style.parent_figure(axes)


@html_page.register
def scene_page(scene: Scene) -> str:
    """Write a scene as HTML: its summary, and its picture."""
    return notebook.lines(str(scene)) + notebook.image("model", partial(draw_model, scene))


def model_notes(scene: Scene) -> list[str]:
    """Return lines of text on damping, users' virtual works, and hinges that may form in cells."""
    notes = []
    for damping in scene.damping:
        if isinstance(damping, Rayleigh):
            kind = "tangent stiffness" if damping.tangent else "stiffness"
            coefficients = (("mass", damping.mass, "1/s"), (kind, damping.stiffness, "s"))
            sizes = ", ".join(f"{name} {x:.3g} {unit}" for name, x, unit in coefficients if x)
            notes.append(f"Rayleigh damping, {sizes}")
        else:
            beams = damping.beams or ()
            where = " of " + ", ".join(b.name for b in beams[:4]) if beams else ""
            more = " ..." if len(beams) > 4 else ""
            notes.append(
                f"Kelvin–Voigt damping, {with_unit(damping.retardation_time, 's')}{where}{more}"
            )
    for work in scene.works:
        where = "" if work.beams is None else " on " + ", ".join(b.name for b in work.beams[:4])
        where += " at " * bool(work.places) + ", ".join(map(str, work.places[:4]))
        said = "statement" if isinstance(work, Effect) else "function"
        notes.append(f"{work.name}: acts as its {said} says{where}")
    laws = {b.section.hinge for b in scene.beams if b.section.hinge and b.section.hinge.opens}
    if laws:
        limits = sorted({with_unit(law.limit, "N m") for law in laws})
        notes.append(f"dots: hinges may form, from {', '.join(limits[:4])}")
    return notes


def scene_load_caption(load: Load) -> tuple[str, str, float]:
    """Return text, arrow and its angle (degrees) of a load on the whole scene; else empty texts."""
    if isinstance(load, Gravity):
        x, y = load.acceleration
        size, angle = math.hypot(x, y), math.degrees(math.atan2(y, x))
        return in_time(f"g = {size:.4g} m/s²", load.amplitude), "→" if size else "", angle
    if isinstance(load, RotatingFrame):
        x, y = load.about
        text = f"frame: {load.rate:.4g} rad/s about ({x:g}, {y:g})".replace("-", "−")
        return text, "↺" if load.rate >= 0 else "↻", 0.0
    return "", "", 0.0


def _planned(
    subject: Subject, measure: Measure, least: Array, most: Array
) -> tuple[Drawing, list[Placed], Array]:
    """Return the largest drawing that fits, its labels, and the corners of the axes.

    The least and the largest size of the axes, (2,), and the corners, (4,), are in points.
    """
    scene = subject.scene
    points = [*subject.axes.values(), *(np.array([body.center]) for body in scene.bodies)]
    attached = chain(*attachment_points(scene).values())
    points += [np.array([place.point]) for place in attached]
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    scale, frame = max(*(high - low) / (400.0, 250.0), scene.size / 500.0), UNBOUNDED
    # Symbols have sizes in points, so their extent in m is known only in a second iteration.
    for _ in range(2):
        drawing = draw(subject, scale)
        placed = _arrange(drawing, measure, frame)
        points = [stroke.points / scale for stroke in chain(*drawing.strokes.values())]
        points += [box.center + sign * box.half[None] for box in placed for sign in (-1, 1)]
        everything = np.concatenate(points)
        below = low / scale - everything.min(axis=0) + 8.0
        beyond = everything.max(axis=0) - high / scale + 8.0
        space = np.maximum(most - below - beyond, 0.3 * most)
        scale = float(np.max((high - low) / space)) or scale
        first, last = low / scale - below, high / scale + beyond
        more = np.maximum(least - (last - first), 0.0) / 2
        frame = np.concatenate([first - more, last + more])
    drawing = draw(subject, scale)
    return drawing, _arrange(drawing, measure, frame), frame


def _arrange(drawing: Drawing, measure: Measure, frame: Array) -> list[Placed]:
    """Place the labels; omit labels that other labels would cover."""
    labels = drawing.labels
    for rank in (NAMES, CAPTIONS):
        if len(labels) > MOST_LABELS:
            labels = [label for label in labels if label.rank < rank]
    labels = labels[:MOST_LABELS]
    lines = np.concatenate([segments(stroke.points) for stroke in chain(*drawing.strokes.values())])
    halves = [measure(label.text) for label in labels]
    placed = place(labels, halves, lines / drawing.scale, frame)
    return [box for box in placed if box.overlap < 0.1]


def _fit(axes: Axes, scale: float, frame: Array, notes: int | None) -> None:
    """Set limits and ticks; fit the size of a new figure to the axes and the texts around them.

    ``notes`` is the number of notes above the axes, or None for axes of the user.
    """
    from matplotlib.ticker import MaxNLocator

    (x0, y0, x1, y1), (across, up) = frame, frame[2:] - frame[:2]
    axes.set(xlim=(x0 * scale, x1 * scale), ylim=(y0 * scale, y1 * scale))
    for line, length, each in ((axes.xaxis, across, 60.0), (axes.yaxis, up, 32.0)):
        number = min(max(int(length / font_size(each)), 2), 9)
        line.set_major_locator(MaxNLocator(number, steps=[1, 2, 2.5, 5, 10]))
    if notes is not None:
        below, above = font_size(BELOW), font_size(ABOVE + REMARK * notes)
        figure = style.parent_figure(axes)
        left, width, height = LEFT, across + LEFT + RIGHT, up + below + above
        for _ in range(2):  # the second time with the width of the tick labels
            figure.set_size_inches(width / POINTS, height / POINTS)
            axes.set_position((left / width, below / height, across / width, up / height))
            outer: Any = axes.get_tightbbox()
            beyond = axes.get_window_extent().x0 - outer.x0
            more = beyond * POINTS / figure.dpi + 8.0 - left
            left, width = left + more, width + more
    axes.set_aspect("equal")


def _write(axes: Axes, placed: list[Placed], scale: float) -> None:
    """Write the labels, and lines from distant labels to their objects."""
    for box in placed:
        if len(box.leader):
            axes.plot(
                *scale * box.leader.T, color="#999999", linewidth=0.8, zorder=6, gid="leaders"
            )
        x, y = scale * box.center
        axes.text(
            x, y, box.label.text, color=shade(box.label.color), fontsize=font_size(LABEL_SIZE),
            ha="center", va="center", zorder=7, gid="labels",
            bbox={"facecolor": shade(WHITE), "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
        )  # fmt: skip
