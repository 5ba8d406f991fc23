# SPDX-License-Identifier: MIT
"""Picture of a model before a run."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import counted, html_page
from ufl_beam.model.constraint_checks import require_independent
from ufl_beam.model.loads import Gravity, Load, Rayleigh, RotatingFrame
from ufl_beam.model.scene import Scene, attachment_points
from ufl_beam.model.works import Effect
from ufl_beam.plotting import notebook, style
from ufl_beam.plotting.labels import AROUND, MOST, arrange
from ufl_beam.plotting.model_drawing import Drawing, hinge_groups, in_time
from ufl_beam.plotting.style import POINTS, RED, TEXT, font_size, shade, with_unit
from ufl_beam.plotting.symbols import draw_strokes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE = 1.45  # distance of notes above the axes, relative to their font size
LABEL_SIZE, ARROW_SIZE = 11.0, 20.0  # font sizes; points


def draw_model(scene: Scene, *, ax: Axes | None = None) -> Figure:
    """Draw the undeformed model, before any run.

    It shows beams, their cells and names, bodies, joints, supports, connectors with parameters,
    hinges, loads (red), masses, prescribed motions (orange) and initial velocities (green).  Loads
    that turn with their place have hollow arrow heads.  Drives that prescribe
    a motion are filled with orange; drives that prescribe a force are hollow.  Notes above the axes
    replace many equal labels.  Labels for which there is no space are omitted.
    """
    require_independent(scene)
    with style.panel(ax, MOST) as axes:
        space = style.lay_out(axes) if ax else POINTS * np.subtract(MOST, AROUND)
        drawing = _fitted(scene, 0.9 * space)
        labels, repeated = drawing.grouped()
        cells = sum(len(axis) - 1 for axis in drawing.axes.values()), "cell", "cells"
        beams, bodies = (len(scene.beams), "beam", "beams"), (len(scene.bodies), "body", "bodies")
        style.plane_axes(axes, f"model: {counted(beams, cells, bodies)}")
        notes = [(words, color, "", 0.0) for words, color in hinge_groups(scene)[0].items()]
        notes += [(words, color, "", 0.0) for words, color in repeated.items()]
        notes += [(words, TEXT, "", 0.0) for words in model_notes(scene)]
        captions = map(scene_load_caption, scene.loads)
        notes += [(text, RED, arrow, angle) for text, arrow, angle in captions if text]
        size = font_size(LABEL_SIZE)
        axes.set_title(axes.get_title("left"), loc="left", pad=8.0 + LINE * size * len(notes))
        for k, (words, color, arrow, angle) in enumerate(reversed(notes)):
            note = axes.annotate(
                words, (0.0, 1.0), (0.0, 6.0 + LINE * size * k), xycoords="axes fraction",
                textcoords="offset points", fontsize=size, color=shade(color), gid="notes",
            )  # fmt: skip
            axes.annotate(
                arrow, (1.0, 0.5), (15.0, 0.0), xycoords=note, textcoords="offset points",
                fontsize=font_size(ARROW_SIZE), color=shade(color), rotation=angle, ha="center",
                va="center",
            )  # fmt: skip
        draw_strokes(axes, drawing.strokes)
        arrange(axes, ax, labels, drawing.scale)
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


def _fitted(scene: Scene, space: Array) -> Drawing:
    """Return a drawing of a scene that fits in a width and height, (2,); points."""
    scale = scene.size / 500.0
    drawing = Drawing(scene, scale)
    points = [body.center for body in scene.bodies]
    points += [spot.point for spots in attachment_points(scene).values() for spot in spots]
    extent = np.ptp(np.concatenate([*drawing.axes.values(), np.reshape(points, (-1, 2))]), axis=0)
    # Symbols have sizes in points.
    most = np.maximum(space - (drawing.size - extent) / scale, 0.3 * space)
    return Drawing(scene, float(np.max(extent / most)) or scale)
