# SPDX-License-Identifier: MIT
"""Joints, motors and hinges of zero length, whose forces are Lagrange multipliers.

Each is a cell of unit length on a second mesh, because the forms of relative motions need the
configurations of two nodes.  There are few of them, so every process has all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import point_masses
from ufl_beam.dolfinx_compat import compile_form, fem, line_mesh
from ufl_beam.mechanics.relative_motions import connector_forms
from ufl_beam.mechanics.time_scheme import Scheme, Step
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.model.functions import value_at
from ufl_beam.reference.hinges import Hinge


class Connectors:
    """Connectors with one kind of relative motion e and forces λ, with the equations α e + β λ = γ.

    Each is a cell of unit length between its nodes; its force is a further unknown of the cell.

    Attributes:
        indices: Indices in :attr:`Scene.all_connectors`.
        forces_at: Numbers of the forces in the scene.
        hinges: Hinges of zero length among them, by index in ``indices``.
        e0: Relative motions at the beginning of the step; m or rad.
    """

    def __init__(
        self, motion: str, indices: Index, numbering: DofNumbering, scheme: Scheme
    ) -> None:
        n, scene = len(indices), numbering.scene
        ends = np.tile([[0.0, 0.0], [1.0, 0.0]], (n, 1))
        mesh = line_mesh(ends, np.arange(2 * n).reshape(n, 2))
        self.indices: Index = indices[mesh.topology.original_cell_index]
        self.connectors = [scene.all_connectors[i] for i in self.indices]
        self.hinges = {
            k: Hinge(c, scheme) for k, c in enumerate(self.connectors) if c in scene.hinges
        }
        dofs = numbering.dofs_of_connectors[self.indices]
        self.forces_at = dofs[:, 6]
        self.forms = forms = connector_forms((motion,), scheme, mesh)
        self._work, self._tangent, self._motion = map(compile_form, forms[:3])
        by_cell = forms.motion.arguments()[0].ufl_function_space()
        self._cells = _cell_dofs(by_cell).ravel()
        self._at: Index = np.empty(dofs.size, dtype=np.int64)
        self._at[_cell_dofs(forms.q1.function_space)] = dofs
        pairs = np.arange(dofs.size), self._at
        self._joins = csr_array((np.ones(dofs.size), pairs), (dofs.size, numbering.size))
        self._joined, self._K = self._joins.T.tocsr(), fem.create_matrix(self._tangent)
        geometry = [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in self.connectors]
        forms.geometry.x.array[_cell_dofs(forms.geometry.function_space)] = geometry
        self._row_dofs = _cell_dofs(forms.row.function_space)
        self.e0: Array = np.zeros(n)
        self._rows: Array = np.zeros((n, 3))

    def accept(self, q: Array) -> None:
        """Accept a configuration, with which the next step begins."""
        self.e0 = self.motions(q)
        self.forms.q0.x.array[:] = q[self._at]

    def begin(self, step: Step) -> None:
        """Begin a step; a substep in statics applies a part of the rest of a motion."""
        self._rows = np.column_stack([np.ones_like(self.e0), 0 * self.e0, 0 * self.e0])
        for k, connector in enumerate(self.connectors):
            if connector.law is not RIGID and k not in self.hinges:
                end = value_at(connector.law.motion, step.motion_time, connector)
                self._rows[k, 2] = self.e0[k] + step.fraction * (end - self.e0[k])

    def residual(self, q1: Array, *, steep: bool = False) -> Array:
        """Return forces on the nodes, and residuals of the equations; (size,)."""
        e = self.motions(q1)
        for k, hinge in self.hinges.items():
            self._rows[k] = hinge.row(e[k], q1[self.forces_at[k]], steep=steep)
        self.forms.row.x.array[self._row_dofs] = self._rows
        return np.asarray(self._joined @ fem.assemble_vector(self._work).array)

    def tangent(self, *, ones: bool = False) -> Any:
        """Return the derivative of the latest residual, or its pattern; (size, size), sparse."""
        self._K.set_value(float(ones))
        K = self._K if ones else fem.assemble_matrix(self._K, self._tangent)
        return self._joined @ K.to_scipy() @ self._joins

    def motions(self, q: Array) -> Array:
        """Return the relative motions at a configuration; (n,); m or rad."""
        self.forms.q1.x.array[:] = q[self._at]
        return np.asarray(fem.assemble_vector(self._motion).array[self._cells])


def connectors_of(numbering: DofNumbering, scheme: Scheme) -> list[Connectors]:
    """Return the connectors of a scene, by kind of motion."""
    kinds: dict[str, list[int]] = {}
    for i, connector in enumerate(numbering.scene.all_connectors):
        kinds.setdefault(connector.motion, []).append(i)
    return [Connectors(kind, np.array(at), numbering, scheme) for kind, at in kinds.items()]


def masses(numbering: DofNumbering) -> Array:
    """Return masses and rotary inertias of bodies and point masses; (size,); kg, kg m²."""
    diagonal: Array = np.zeros(numbering.size)
    for place, mass, inertia in point_masses(numbering.scene):
        np.add.at(diagonal, numbering.node(place), [mass, mass, inertia])
    return diagonal


def _cell_dofs(space: fem.FunctionSpace) -> Index:
    """Return the degrees of freedom of the cells of a space; (num_cells, dofs of a cell)."""
    blocks, size = space.dofmap.list, space.dofmap.bs
    return np.asarray((blocks[:, :, None] * size + np.arange(size)).reshape(len(blocks), -1))
