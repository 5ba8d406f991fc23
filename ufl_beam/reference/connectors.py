# SPDX-License-Identifier: MIT
"""Joints, motors and hinges of zero length, whose forces are Lagrange multipliers.

The forms of relative motions need the configurations of two nodes, so each connector is a cell of
unit length on a further mesh, one for each kind of motion.  There are few connectors, so every
process has all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import basix.ufl
import numpy as np
import ufl
from scipy.sparse import csr_array

from ufl_beam.arrays import Array, Index, State
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.dolfinx_compat import compile_form, fem, line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.mechanics.relative_motions import MOTIONS, Geometry, Pair
from ufl_beam.mechanics.time_scheme import Scheme, Step
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.model.connectors import Connector, law_of
from ufl_beam.model.functions import value_at


class ConnectorForms(NamedTuple):
    """Forms of connectors, and their coefficients."""

    work: ufl.Form  # virtual work, and ``a e + b λ - c``
    tangent: ufl.Form  # derivative of ``work`` by ``q1``
    motion: ufl.Form  # relative motion e of each cell
    geometry: fem.Function  # :class:`Geometry`
    row: fem.Function  # a, b, c
    q0: fem.Function  # configuration and force λ at the beginning of the step
    q1: fem.Function  # configuration and force λ at its end


def connector_forms(motion: str, scheme: Scheme, cells: meshes.Mesh) -> ConnectorForms:
    """Return forms on cells of unit length between the two nodes of a connector."""
    line = basix.ufl.element("Lagrange", "interval", 1)
    point = basix.ufl.element("DG", "interval", 0)
    space = fem.functionspace(cells, basix.ufl.mixed_element([line, line, line, point]))
    geometry, row = (fem.Function(fem.functionspace(cells, ("DG", 0, (n,)))) for n in (8, 3))
    q0, q1, by_cell = fem.Function(space), fem.Function(space), fem.functionspace(cells, ("DG", 0))

    def split(q: Any) -> tuple[Pair, Any]:
        """Split a function into the configurations at both ends of a cell, and the force."""
        *fields, force = ufl.split(q)
        at = (ufl.as_vector([x + s * ufl.grad(x)[0] for x in fields]) for s in (-0.5, 0.5))
        return Pair(*at), force

    (before, _), (now, λ), (w, w_λ) = map(split, (q0, q1, ufl.TestFunction(space)))
    dx = ufl.Measure("dx", domain=cells, metadata={"quadrature_degree": 1})
    vectors = (ufl.as_vector([geometry[i], geometry[i + 1]]) for i in range(0, 8, 2))
    e, variation = MOTIONS[motion](before, now, w, Geometry(*vectors), scheme)
    work = (λ * variation + w_λ * (row[0] * e + row[1] * λ - row[2])) * dx
    tangent, shown = ufl.derivative(work, q1), e * ufl.TestFunction(by_cell) * dx
    return ConnectorForms(work, tangent, shown, geometry, row, q0, q1)


class Connectors:
    """Connectors with one kind of relative motion e and forces λ, with the equations a e + b λ = c.

    Each is a cell between its nodes, and its force is a further unknown of the cell.

    Attributes:
        indices: Indices in :attr:`Scene.all_connectors`.
        forces_at: Numbers of the forces in the scene.
        hinges: Hinges of zero length among them, by position in ``indices``.
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
        hinges = ((k, c) for k, c in enumerate(self.connectors) if c in scene.hinges)
        self.hinges = {k: Hinge(c, scheme) for k, c in hinges}
        dofs = numbering.dofs_of_connectors[self.indices]
        self.forces_at = dofs[:, 6]
        self.forms = forms = connector_forms(motion, scheme, mesh)
        self._work, self._tangent, self._motion = map(compile_form, forms[:3])
        by_cell = forms.motion.arguments()[0].ufl_function_space()
        self._cells = _cell_dofs(by_cell).ravel()
        self._at: Index = np.empty(dofs.size, dtype=np.int64)
        self._at[_cell_dofs(forms.q1.function_space)] = dofs
        pairs = np.arange(dofs.size), self._at
        self._joins = csr_array((np.ones(dofs.size), pairs), (dofs.size, numbering.size))
        geometry = [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in self.connectors]
        forms.geometry.x.array[_cell_dofs(forms.geometry.function_space)] = geometry
        self._row_dofs, self._rows = _cell_dofs(forms.row.function_space), np.zeros((n, 3))

    def start(self, q: Array, internal: State) -> None:
        """Begin with a configuration and the internal variables of a :class:`Simulation`."""
        self.accept(q)
        names = (name for name in internal if name.startswith("Hinged, "))
        for table in (internal[name] for name in names):
            for k, hinge in self.hinges.items():
                for row in table[table[:, 0] == self.indices[k], 1:]:
                    hinge.opening, hinge.e0, _, _, flows = map(float, row)
                    hinge.flows = int(flows)

    def accept(self, q: Array) -> None:
        """Accept a configuration, with which the next step begins."""
        self.e0 = self.motions(q)
        self.forms.q0.x.array[:] = q[self._at]

    def begin(self, step: Step) -> None:
        """Begin a step; a substep in statics applies a part of the rest of a motion."""
        self._rows[:] = (1.0, 0.0, 0.0)
        for k, connector in enumerate(self.connectors):
            if connector.law is not RIGID and k not in self.hinges:
                end = value_at(connector.law.motion, step.motion_time, connector)
                self._rows[k, 2] = self.e0[k] + step.fraction * (end - self.e0[k])

    def residual(self, q1: Array, *, steep: bool) -> Array:
        """Return the work λ δe as forces on the nodes, and residuals of the equations; (size,)."""
        e = self.motions(q1)
        for k, hinge in self.hinges.items():
            self._rows[k] = hinge.row(e[k], q1[self.forces_at[k]], steep=steep)
        self.forms.row.x.array[self._row_dofs] = self._rows
        return np.asarray(self._joins.T @ fem.assemble_vector(self._work).array)

    def tangent(self) -> Any:
        """Return the derivative of the latest residual; (size, size), sparse."""
        return self._joins.T @ fem.assemble_matrix(self._tangent).to_scipy() @ self._joins

    def motions(self, q: Array) -> Array:
        """Return the relative motions at a configuration; (n,); m or rad."""
        self.forms.q1.x.array[:] = q[self._at]
        return np.asarray(fem.assemble_vector(self._motion).array[self._cells])


class Hinge:
    """Law of a hinge of zero length in a step; jump e and moment λ are unknowns of the step.

    Attributes:
        opening: Sum of the absolute values of the growths of the jump; rad.
        flows: Direction of the growth in the last step, or 0.
        way: Direction in which the jump grows in this step, or 0 if the hinge is held.
        excess: Relative excess of the moment over the limit of a held hinge.
    """

    def __init__(self, hinge: Connector, scheme: Scheme) -> None:
        self.law: Any = law_of(hinge)
        self.scheme, self.opening, self.flows, self.e0 = scheme, 0.0, 0, 0.0
        self.begin(0.0, hold=True)

    @property
    def limit(self) -> float:
        """Moment that the hinge bears at the beginning of the step; N m."""
        return float(self.law.traction(np.array(self.opening)))

    def begin(self, dt: float, *, hold: bool) -> None:
        """Begin a step; the hinge moves on if it moved in the last one, otherwise it is held."""
        self.way, self.excess, self.grown, self.moment = self.flows, 0.0, 0.0, 0.0

    def row(self, e: float, moment: float, *, steep: bool) -> tuple[float, float, float]:
        """Note an iterate; return (a, b, c) of the equation a e + b λ = c, linear around it.

        With ``steep``, the slope of the resistance has the opposite sign, so that nodes between
        hinges move with the unbalanced moment.
        """
        self.grown, self.moment = e - self.e0, moment
        if self.way == 0:
            return 1.0, 0.0, self.e0
        growth = np.array([max(self.way * self.grown, 0.0) + 1e-200j])
        t: Any = self.scheme.resistance(self.law, np.array([self.opening]), growth)[0]
        falls = abs(t.imag * 1e200) if steep else t.imag * 1e200
        return -falls, 1.0, self.way * t.real - falls * e

    def turns_back(self) -> bool:
        """Hold the hinge if its jump has turned back; return whether it has.

        A hinge that has lost its strength is not held, but free in either direction.  A held
        hinge measures its excess.
        """
        back, self.excess, limit = self.way * self.grown < 0, 0.0, self.limit
        if limit == 0:
            back, self.way = self.way == 0, -1 if self.grown < 0 else 1
        elif back:
            self.way = 0
        elif self.way == 0:
            self.excess = max(abs(self.moment) / limit - 1 - 1e-12, 0.0)
        return back

    def release(self, least: float) -> None:
        """Let the hinge open if its excess is large enough."""
        if self.excess > 0 and self.excess >= least:
            self.way = -1 if self.moment < 0 else 1

    def accept(self) -> None:
        """Accept the jump at the end of a step."""
        growth = abs(self.way * self.grown)
        self.opening, self.e0 = self.opening + growth, self.e0 + self.grown
        self.flows = self.way * int(growth > 0)


def connectors_of(numbering: DofNumbering, scheme: Scheme) -> list[Connectors]:
    """Return the connectors of a scene, by kind of motion."""
    kinds: dict[str, list[int]] = {}
    for i, connector in enumerate(numbering.scene.all_connectors):
        kinds.setdefault(connector.motion, []).append(i)
    return [Connectors(kind, np.array(at), numbering, scheme) for kind, at in kinds.items()]


def _cell_dofs(space: fem.FunctionSpace) -> Index:
    """Return the degrees of freedom of the cells of a space; (num_cells, dofs of a cell)."""
    blocks, size = space.dofmap.list, space.dofmap.bs
    return np.asarray((blocks[:, :, None] * size + np.arange(size)).reshape(len(blocks), -1))
