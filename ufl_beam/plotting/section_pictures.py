# SPDX-License-Identifier: MIT
"""Picture of a cross-section: its outline and fibres to scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ufl_beam.errors import ArgumentError
from ufl_beam.model.sections import Section
from ufl_beam.plotting import style
from ufl_beam.plotting.style import BLUE, INK, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM = 1e3


def draw_section(section: Section, *, ax: Axes | None = None) -> Figure:
    """Draw the outline of a section to scale, with a line at the middle of each layer of fibres.

    Axes begin at the centroid; y points to the left of the direction of the beam.  Fibres of a
    section without a shape are discs of their areas.
    """
    shape, fibres = section.shape, section.fibres
    if shape is None and fibres is None:
        raise ArgumentError(
            "plot: this Section has stiffnesses only; sections with a picture come from "
            "constructors of shapes such as Section.steel, or from Section.of_fibres"
        )
    from matplotlib.patches import Circle, PathPatch
    from matplotlib.path import Path

    with style.panel(ax, (6.0, 6.0)) as axes:
        axes.axhline(0.0, color=shade(INK), lw=0.8, ls=(0, (8, 4)), zorder=3)
        if shape is not None:
            loops = [MM * loop for loop in shape.outlines()]
            paths = [Path(np.column_stack([z.real, z.imag]), closed=True) for z in loops]
            area = PathPatch(Path.make_compound_path(*paths), fc=BLUE, ec=BLUE, lw=1.5)
            area.set_facecolor((*area.get_facecolor()[:3], 0.2))
            axes.add_patch(area)
            if fibres is not None:
                x = loops[0].real
                lines = axes.hlines(MM * fibres.y, x.min(), x.max(), color=BLUE, lw=1.0)
                lines.set_clip_path(area)
            if ax is None:
                axes.set_title(
                    f"A = {1e4 * shape.A:.4g} cm², I = {1e8 * shape.I:.4g} cm⁴, "
                    f"Wpl = {1e6 * shape.Wpl:.4g} cm³",
                    loc="left", fontsize=style.font_size(11.0),
                )  # fmt: skip
        elif fibres is not None:
            for y, A in zip(fibres.y, fibres.A, strict=True):
                axes.add_patch(Circle((0.0, MM * y), MM * np.sqrt(A / np.pi), color=BLUE, lw=0))
        axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        axes.autoscale_view()
    return style.parent_figure(axes)
