# SPDX-License-Identifier: MIT
"""Internal variables of material points by name, from the tables of ``Solution.internal``."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, State
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.errors import ArgumentError
from ufl_beam.model.bodies import Member


def in_beam(numbering: DofNumbering, state: State, beam: Member) -> dict[str, Array]:
    """Return the internal variables of a beam, see :meth:`Solution.variables`."""
    cells, section = numbering.cells_of(beam), beam.section
    groups = section.section_points(section.hinge, numbering.scene.in_space)
    number = sum(len(points.weights) for points in groups)
    found = {name: x[cells, :, :number] for name, x in _at_points(numbering, state).items()}
    found = {name: x for name, x in found.items() if not np.isnan(x).all()}
    if not found:
        raise ArgumentError(f"variables: the laws of {beam.name} have no internal variables")
    return found


def in_cells(numbering: DofNumbering, state: State) -> dict[str, Array]:
    """Return the value of largest magnitude among the points of each cell; (num_cells,) each."""
    found = {}
    for name, values in _at_points(numbering, state).items():
        rows = np.nan_to_num(values.reshape(len(values), -1))
        found[name] = rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)]
    return found


def _at_points(numbering: DofNumbering, state: State) -> dict[str, Array]:
    """Return variables at the points of all cells, or NaN; (num_cells, degree, points)."""
    tables = [table for name, table in state.items() if name.startswith("cells, ")]
    count, degree = len(numbering.cells), numbering.mesh.degree
    number = max((max(x.at) + 1 for x, _ in numbering.inelastic), default=0)
    found = dict[str, Array]()
    for points, cells in numbering.inelastic:
        rows, n = cells + points.number * count, len(points.weights)
        table = next((table for table in tables if rows[0] in table[:, 0]), None)
        if table is None:
            raise ArgumentError(
                "variables: the solution has no internal variables; it is not the result of a run"
            )
        values = table[np.searchsorted(table[:, 0], rows), 1:].reshape(len(cells), degree, -1)
        for k, name in enumerate(points.kind.law.variables):
            whole = found.setdefault(name, np.full((count, degree, number), np.nan))
            whole[cells[:, None], :, points.at] = values[:, :, k * n : (k + 1) * n].swapaxes(1, 2)
    return found
