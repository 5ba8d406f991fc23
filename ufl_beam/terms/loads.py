# SPDX-License-Identifier: MIT
"""Loads: what all kinds have in common, and centrifugal and Coriolis forces."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib, loop, struct
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, mass_kernel, mass_matrix
from ufl_beam.discretization.state_io import Memory, Restoring, Saving
from ufl_beam.mechanics.kinematics import split, turn
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.terms.base import Term
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.in_cells import InCells
from ufl_beam.terms.phases import Callbacks, Phases


class LoadTerm(Term):
    """Forces that time or the configuration gives."""

    kind = "loads"

    vector: Any
    """``vector`` of loops.h: forces whose size is part of the scale of convergence."""

    def __init__(self, scheme: Scheme, ledger: Ledger) -> None:
        self._scheme, self._ledger = scheme, ledger

    @abstractmethod
    def carry_on(self, t: float, q: Array, v: Array | None, past: Restoring | None) -> Array:
        """The loads at time ``t``; take the state ``q`` as one that is in equilibrium with them.

        ``v`` are the velocities, None in statics; ``past`` is the end of a run of the same scene.
        """

    def pass_on(self, memory: Saving) -> None:
        """Save the forces of the last step that :meth:`carry_on` could not find again."""


@stated
def _turned_mass(of: Element) -> ufl.Form:
    (u, _), (w_u, _) = split(ufl.TrialFunction(of.space)), split(of.w)
    return of.inertia[0] * ufl.dot(turn(u), w_u) * of.dx_of_mass()


def turned_mass_matrix(fields: Fields) -> Csr:
    """Mass times a quarter turn of velocities, so that 2 Ω of it times them is Coriolis' force."""
    share, G = fields.share, fields.assembled(_turned_mass(fields.element))
    scene = share.grid.scene
    lumps = [(share.at(one.place), one.mass) for one in scene.masses]
    lumps += [(share.at(one.middle), one.mass) for one in scene.bodies]
    for dofs, mass in lumps:
        if share.owns(dofs[:2]).all():
            u, v = share.local(dofs[:2])
            G.data[G.positions(np.array([u, v]), np.array([v, u]))] += (-mass, mass)
    return G


class FrameForces(LoadTerm):
    """Centrifugal and Coriolis forces; the first have a potential, the second do no work.

    Rotary inertia keeps its spin in steady rotation, so no moments come of it.
    """

    def __init__(
        self, frame: RotatingFrame, fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr
    ) -> None:
        share = fields.share
        super().__init__(scheme, ledger)
        S, G = mass_matrix(fields), turned_mass_matrix(fields)
        coriolis = 2 * frame.rate if has_inertia(scheme) else 0.0
        S.data[np.isin(S.rows(), share.rotations())] = 0.0
        S.data *= frame.rate**2
        G.data *= coriolis
        self._matrices, self._A, self._fields = (Product(S), Product(G)), A, fields
        x, y = (np.ascontiguousarray(of, dtype=np.int32) for of in share.translations())
        change, place, space, self._force, self._before, rest = np.zeros((6, share.size))
        self._accelerations = rest, ffi.new("double *[1]", [doubles(rest)])
        self.vector = struct("vector", size=share.size, values=self._force)
        self._c = struct(
            "rotating_frame", size=share.size, entries=len(A.data), places=len(x), x=x, y=y,
            pull=self._matrices[0].c, turn=self._matrices[1].c, pulls=S.data, turns=G.data,
            from_centre=_positions(fields, frame.about), rate=frame.rate, coriolis=coriolis,
            part=scheme.load_weight, weight_of_before=scheme.weight_of_before, change=change,
            place=place, space=space, force=self._force, before=self._before,
            accelerations=self._accelerations[1],
        )  # fmt: skip

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loops of both forces, and of their derivatives."""
        return loop("subtract_frame_forces", self._c), loop("add_tangent_of_frame", self._c)

    def phases(self, callbacks: Callbacks) -> Phases:
        """Loops over the degrees of freedom."""
        self._c.work = self._ledger.supplied.pointer("loads")
        return Phases([loop("begin_frame", self._c)], [loop("accept_frame", self._c)])

    def in_cells(self) -> Sequence[InCells]:
        """The mass of the beams times the accelerations of the frame."""
        form = partial(mass_kernel, self._fields)
        return [InCells(form, lib.DENSITY, self._fields.order, self._accelerations[1])]

    def carry_on(self, t: float, q: Array, v: Array | None, past: Restoring | None) -> Array:
        """The forces at ``q``; take that state as one that is in equilibrium with them."""
        self._c.grown = 1.0
        still = np.zeros(len(q))
        step = struct("time_step", q0=q, dt=math.inf, fraction=1.0, at=1.0)
        lib.begin_frame(self._c, step, ffi.NULL, ffi.NULL)
        self.add_residual(q, np.zeros(len(q)))
        lib.accept_frame(self._c, step, doubles(q), doubles(still))
        return self._force.copy()

    def remember(self, memory: Memory, q: Array) -> None:
        """The forces in the equation of the last step, and how much of them acts."""
        self._force[:] = self._before[:] = memory.added("rotating frame", self._before)
        self._c.grown = memory.number("growth of the rotating frame", self._c.grown)


def _positions(fields: Fields, about: tuple[float, float]) -> Array:
    """Vectors from a point to the places of all displacements; (size,); m."""
    share = fields.share
    grid, x = share.grid, np.zeros(share.grid.size)
    centers = np.array([body.center for body in grid.scene.rigid_bodies]).reshape(-1, 2)
    # Beams last: those joined to the ground share its displacement, not the place of its centre.
    points = np.concatenate([centers, grid.points]) - about
    x[np.concatenate([grid.dofs_of_bodies, grid.dofs])[:, :2]] = points
    return np.asarray(x[share.dofs])
