# SPDX-License-Identifier: MIT
"""Imposed strains of cells: temperature, shrinkage, tendons."""

from __future__ import annotations

import numpy as np

from old_reference.cell_forms import Cells, Setting, put
from ufl_beam.arrays import Array
from ufl_beam.mechanics.time_scheme import Step, has_inertia
from ufl_beam.model.functions import value_at
from ufl_beam.model.imposed_strains import ImposedStrain


class ImposedStrains:
    """Imposed strains of some cells at both ends of a step.

    Attributes:
        before, now: The strains, as functions in forms.
        change: Change of the strains in the step; (num_cells, points, 3).
        values: The strains at the end; (num_cells, points, 3).
    """

    def __init__(self, cells: Cells, setting: Setting, t0: float) -> None:
        numbering, element = setting.numbering, cells.element
        self.before, self.now = element.at_points(3), element.at_points(3)
        degree = numbering.mesh.degree
        points, weights = np.polynomial.legendre.leggauss(5)
        self._loads = [x for x in numbering.scene.loads if isinstance(x, ImposedStrain)]
        self._fields = np.zeros((len(self._loads), len(cells.cell_indices), degree, 3))
        for field, load in zip(self._fields, self._loads, strict=True):
            s, first = numbering.parameters(load.beam), numbering.cells_of(load.beam)[0]
            for k, cell in enumerate(cells.cell_indices - first):
                if 0 <= cell < len(s) - 1:
                    middle, half = (s[cell] + s[cell + 1]) / 2, (s[cell + 1] - s[cell]) / 2
                    strains = load.strains(middle + half * points)
                    # The fit has the lowest degree at which all moments agree.
                    fit = np.polynomial.legendre.legfit(
                        points, strains, degree - 1, w=np.sqrt(weights)
                    )
                    own = np.polynomial.legendre.leggauss(degree)[0]
                    field[k] = np.polynomial.legendre.legval(own, fit).T
        self._reached: Array = np.zeros(len(self._loads))
        if has_inertia(setting.scheme):
            self.start(t0)
        else:
            self._put(self._reached)

    def start(self, t: float) -> None:
        """Take the strains at the time ``t`` as the strains before the first step."""
        self._reached = np.array([value_at(load.amplitude, t, load) for load in self._loads])
        self._put(self._reached)

    def begin(self, step: Step) -> None:
        """Begin a step; a substep changes the strains by a fraction of the change in the step."""
        t = step.motion_time
        wanted = np.array([value_at(load.amplitude, t, load) for load in self._loads])
        self._put(self._reached + step.fraction * (wanted - self._reached))

    def accept(self) -> None:
        """Accept the strains at the end of the step."""
        self._reached = self._end

    def _put(self, end: Array) -> None:
        self._end = end
        before: Array = np.einsum("l,lcpk->cpk", self._reached, self._fields)
        self.values: Array = np.einsum("l,lcpk->cpk", end, self._fields)
        self.change = self.values - before
        put(self.before, before)
        put(self.now, self.values)
