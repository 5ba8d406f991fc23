# SPDX-License-Identifier: MIT
"""Cells of a process whose material yields, flows or breaks."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Index
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import SceneError
from ufl_beam.model.fibres import Layout


def inelastic_cells(share: Share) -> list[tuple[Layout, Index]]:
    """Layouts of material points, and the cells (numbers of the grid) that have them."""
    grid = share.grid
    groups: dict[Layout, list[int]] = {}
    layouts: dict[object, Layout | None] = {}
    for beam in grid.scene.beams:
        laws = grid.hinges(beam)
        for cell, softening in zip(grid.cells_of(beam), laws, strict=True):
            key = (beam.section, softening)
            if key not in layouts:
                layouts[key] = beam.section.layout(softening)
            layout = layouts[key]
            if layout is not None and not layout.elastic:
                if grid.mesh.degree > 1:
                    raise SceneError(
                        f"Mesh: degree = {grid.mesh.degree} is for elastic beams, and {beam.name} "
                        "may yield or break; use degree=1 with more cells, or an elastic section"
                    )
                groups.setdefault(layout, []).append(int(cell))
    return [(layout, np.array(cells)) for layout, cells in groups.items()]
