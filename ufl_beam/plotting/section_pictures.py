# SPDX-License-Identifier: MIT
"""Picture of a cross-section: its outline and fibres to scale."""

from __future__ import annotations

import numpy as np

from ufl_beam.errors import ArgumentError
from ufl_beam.model.sections import Section
from ufl_beam.plotting import style
from ufl_beam.plotting.style import BLUE, INK, ORANGE, Axes, Figure, shade, with_unit

MM = 1e3


def draw_section(section: Section, *, ax: Axes | None = None) -> Figure:
    """Draw the outline of a section to scale, with a line at the middle of each layer of fibres.

    Axes begin at the axis of the beam; y points to its left.  A core is orange.  Rows of bars, and
    fibres of a section without a shape, are discs of their areas.
    """
    shape, fibres = section.shape, section.fibres
    if shape is None and fibres is None:
        raise ArgumentError(
            "plot: this Section has stiffnesses only; sections with a picture come from "
            "constructors of shapes such as Section.rectangle, or from Section.of_fibres"
        )
    from matplotlib.patches import Circle, PathPatch
    from matplotlib.path import Path

    with style.panel(ax, (6.0, 6.0)) as axes:
        axes.axhline(0.0, color=shade(INK), lw=0.8, ls=(0, (8, 4)), zorder=3)
        axis = fibres.axis if fibres is not None else shape.y if shape is not None else 0.0
        core = fibres.core if fibres is not None else None
        outer = [drawn for drawn in (shape, core) if drawn is not None]
        for number, (drawn, color) in enumerate(zip(outer, (BLUE, ORANGE), strict=False)):
            loops = [MM * (loop - 1j * axis) for loop in drawn.outlines()]
            paths = [Path(np.column_stack([z.real, z.imag]), closed=True) for z in loops]
            area = PathPatch(Path.make_compound_path(*paths), fc=(color, 0.2), ec=color, lw=1.5)
            axes.add_patch(area)
            if fibres is not None:  # the last materials are those of the shape and its core
                material = len(fibres.fibres) - len(outer) + number
                y, x = MM * fibres.y[fibres.material == material], loops[0].real
                lines = axes.hlines(y, x.min(), x.max(), color=color, lw=1.0)
                lines.set_clip_path(area)
        if fibres is not None:
            discs = slice(None if shape is None else fibres.bars)
            for y, A in zip(fibres.y[discs], fibres.A[discs], strict=True):
                r = MM * np.sqrt(A / np.pi)
                axes.add_patch(Circle((0.0, MM * y), r, fc=shade(INK), lw=0, zorder=4))
        if ax is None:
            title = f"EA = {with_unit(section.EA, 'N')}, EI = {with_unit(section.EI, 'N m²')}"
            if shape is not None and (fibres is None or not fibres.bars):
                title = (
                    f"A = {1e4 * shape.A:.4g} cm², I = {1e8 * shape.I:.4g} cm⁴,\n"
                    f"Wpl = {1e6 * shape.Wpl:.4g} cm³"
                )
            axes.set_title(title, loc="left", fontsize=style.font_size(11.0))
        axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        axes.autoscale_view()
    return style.parent_figure(axes)
