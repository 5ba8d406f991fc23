# SPDX-License-Identifier: MIT
"""Supports and prescribed motions: degrees of freedom whose values are given."""

from __future__ import annotations

import math

import numpy as np
import scipy  # its parts are loaded when they are used
from scipy.sparse import csr_array

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.mechanics.time_schemes import Scheme, Step, acting
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.time_functions import value_at
from ufl_beam.reference.cells import Ledger


class Supports:
    """Supports of a scene, which may be at an angle to the axes of the plane.

    Attributes:
        axes: Orthogonal matrix from the axes of the plane to those of the supports.
        held: Degrees of freedom that are held or prescribed, in their axes.
        free: All others: the unknowns of a step.
        reactions: Forces of the supports in the latest residual, in their axes; (size,).
        before: Those of the accepted step.
    """

    def __init__(self, grid: Grid, scheme: Scheme, ledger: Ledger) -> None:
        self._grid, self._scheme, self._ledger = grid, scheme, ledger
        axes = scipy.sparse.eye_array(grid.size).tolil()
        held = {int(d): None for d in grid.node(GROUND.middle)} if _has_ground(grid) else {}
        self._motions = []
        for support in grid.scene.supports:
            dofs = grid.node(support.place)
            if support.angle:
                c, s, (i, j) = math.cos(support.angle), math.sin(support.angle), dofs[:2]
                axes[i, i], axes[i, j], axes[j, i], axes[j, j] = c, s, -s, c
            held |= {int(dofs[component]): None for component in support.held}
            for component, motion in support.moving.items():
                self._motions.append((int(dofs[component]), motion, support))
        self.axes = csr_array(axes.tocsr())
        self.held = np.array(sorted(held), dtype=np.int64)
        self.free = np.setdiff1d(np.arange(grid.size), self.held)
        self.reactions: Array = np.zeros(grid.size)
        self.before: Array = self.reactions
        if self._motions:
            ledger.supplied["supports"] += 0.0

    def move(self, x: Array, x0: Array, step: Step) -> None:
        """Set in ``x`` what is held and prescribed in the step that begins at ``x0``."""
        x[self.held] = x0[self.held]
        for dof, motion, support in self._motions:
            wanted = value_at(motion, step.motion_time, support)
            x[dof] = x0[dof] + step.fraction * (wanted - x0[dof])

    def stop(self, v: Array) -> Array:
        """Velocities without those of what is held fast; else they would ring."""
        x = self.axes @ v
        moving = [dof for dof, *_ in self._motions]
        x[np.setdiff1d(self.held, moving)] = 0.0
        return np.asarray(self.axes.T @ x)

    def note(self, r: Array) -> None:
        """Note the reactions in a residual, which is in the axes of the supports."""
        reactions: Array = np.zeros(len(r))
        reactions[self.held] = r[self.held]
        self.reactions = reactions

    def accept(self, s: Array) -> None:
        """Enter the work of supports that move in a step of the nodes."""
        if self._motions:
            force = acting(self._scheme, self.before, self.reactions)
            self._ledger.supplied["supports"] += float(force @ (self.axes @ s))
        self.before = self.reactions

    def forces(self) -> Array:
        """Forces of each support on the scene, of the components that it holds; (num, 3)."""
        found = np.zeros((len(self._grid.scene.supports), 3))
        for force, support in zip(found, self._grid.scene.supports, strict=True):
            held = [*support.held]
            force[held] = self.before[self._grid.node(support.place)[held]]
            c, s = math.cos(support.angle), math.sin(support.angle)
            force[:2] = c * force[0] - s * force[1], s * force[0] + c * force[1]
        return found


def _has_ground(grid: Grid) -> bool:
    return GROUND in grid.scene.rigid_bodies
