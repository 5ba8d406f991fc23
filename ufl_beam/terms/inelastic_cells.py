# SPDX-License-Identifier: MIT
"""Cells whose material yields, flows or breaks."""

from __future__ import annotations

from typing import Any

import numpy as np

from ufl_beam.arrays import Index
from ufl_beam.errors import SceneError
from ufl_beam.model.fibres import Layout


def inelastic_cells(grid: Any) -> list[tuple[Layout, Index]]:
    """Layouts of material points, and the cells (numbers of the grid) that have them."""
    groups = dict[Layout, list[int]]()
    sections, of_beam = grid.sections
    for number, section in enumerate(sections):
        layout = section.layout(section.hinge)
        if layout is not None and not layout.elastic:
            if grid.mesh.degree > 1:
                beam = grid.scene.beams[int(np.argmax(of_beam == number))]
                raise SceneError(
                    f"Mesh: degree = {grid.mesh.degree} is for elastic beams, and {beam.name} "
                    "may yield or break; use degree=1 with more cells, or an elastic section"
                )
            groups.setdefault(layout, []).append(number)
    of_cell = of_beam[grid.beam_of_cell]
    return [(layout, np.flatnonzero(np.isin(of_cell, one))) for layout, one in groups.items()]
