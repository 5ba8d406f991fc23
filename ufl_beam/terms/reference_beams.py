# SPDX-License-Identifier: MIT
"""Cells that yield and break, with forms that DOLFINx assembles and laws that NumPy evaluates."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.dolfinx_compat import fem
from ufl_beam.terms.inelastic_beams import InelasticBeams, InelasticForms


class ReferenceInelasticBeams(InelasticBeams):
    """The same equations as :class:`CompiledInelasticBeams`, line by line.

    Attributes:
        jump: Jump α of the rotation in the hinges of the cells at the latest iterate, DG0; rad.
    """

    def _prepare(self, forms: InelasticForms) -> None:
        self._forms, self._first = forms, False
        self.jump = fem.Function(fem.functionspace(self._fields.mesh, ("DG", 0)))

    def _begin(self) -> None:
        self._first = not self._scheme.dynamic

    def _respond(self, q1: Array) -> None:
        points = self.points
        points.respond(self._strains(q1))
        self.jump.x.array[:] = (points["jump"] + points["direction"] * points["growth"])[:, -1]

    def _forget(self) -> None:
        """Nothing is kept."""

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the work of the resultants on the virtual strains, P(34)."""
        self._respond(q1)
        self._force.put(self._forms.r, self.points.r)
        self._force.add(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Add its derivative; that of the first iterate in statics is of the forces before."""
        self._respond(q1)
        r: Array = self.points.r
        D = self.points.D
        if self._first:
            self._first, r = False, np.asarray(self.points.kept[:, :3])
        around = r - np.einsum("kij,kj->ki", D.reshape(-1, 3, 3), self.points.strains)
        for function, values in ((self._forms.b, around), (self._forms.D, D)):
            self._tangent.put(function, values)
        self._tangent.add(q1, self._A.data)
