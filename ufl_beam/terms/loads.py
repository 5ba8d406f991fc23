# SPDX-License-Identifier: MIT
"""Loads: what all kinds have in common, and centrifugal and Coriolis forces."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import partial

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, lib
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields, mass_kernel, mass_matrix
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory, Restoring, Saving
from ufl_beam.mechanics.kinematics import split, turn
from ufl_beam.mechanics.time_schemes import Scheme, Step, acting, has_inertia
from ufl_beam.model.loads import RotatingFrame
from ufl_beam.terms.base import Term
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.in_cells import InCells


class LoadTerm(Term):
    """Forces that time or the configuration gives."""

    kind = "loads"

    def __init__(self, share: Share, scheme: Scheme, ledger: Ledger) -> None:
        self._scheme, self._ledger = scheme, ledger
        self._force: Array = np.zeros(share.size)

    @property
    def force(self) -> Array:
        """The forces in the latest residual; a new array where they have changed."""
        return self._force

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
        super().__init__(share, scheme, ledger)
        self._before = self._force
        S, G = mass_matrix(fields), turned_mass_matrix(fields)
        S.data[np.isin(S.rows(), share.rotations())] = 0.0
        S.data *= frame.rate**2
        G.data *= 2 * frame.rate if has_inertia(scheme) else 0.0
        self._slope: Array | None = None  # of the forces of the step
        self._S, self._G, self._pull, self._turn = S.data, G.data, Product(S), Product(G)
        self._from_centre, self._fields = _positions(fields, frame.about), fields
        # Accelerations by places, and in motion by displacements of the other direction.
        self._outward, self._across = np.zeros((2, share.size))
        self._other: Index = np.arange(share.size)
        u, v = share.translations()
        self._other[u], self._other[v] = v, u
        self._outward[u] = self._outward[v] = -(frame.rate**2)
        self._across[u], self._across[v] = -2 * frame.rate, 2 * frame.rate
        self._in_motion = has_inertia(scheme)
        self._accelerations = np.zeros(share.size)
        self._place = ffi.new("double *[1]", [doubles(self._accelerations)])
        self._A, self._share_of_end, self._grown = A, scheme.load_weight, 0.0

    def begin(self, step: Step) -> None:
        """Remember the beginning, and how much of the forces acts."""
        self._q0, self._dt = step.q0, step.dt
        growth = step.fraction * (1.0 - self._grown)
        self._growth, self._growth_at_end = self._grown + step.at * growth, self._grown + growth
        self._at_beginning = self._from_centre + step.q0
        self._slope = None

    def in_cells(self) -> Sequence[InCells]:
        """The mass of the beams times the accelerations of the frame."""
        form = partial(mass_kernel, self._fields)
        return [InCells(form, lib.DENSITY, self._fields.order, self._place)]

    def _put_accelerations(self, a: Array) -> None:
        """Note the accelerations, where forces in cells find them."""
        ffi.memmove(self._place[0], doubles(a), a.nbytes)

    def carry_on(self, t: float, q: Array, v: Array | None, past: Restoring | None) -> Array:
        """The forces at ``q``; take that state as one that is in equilibrium with them."""
        self._grown = 1.0
        self._put_accelerations(self._outward * (self._from_centre + q))
        self._force = self._before = self._pull(self._from_centre + q)
        return self._force

    def add_residual(self, q1: Array, r: Array) -> None:
        """Subtract centrifugal and Coriolis forces from the residual."""
        self._change = q1 - self._q0
        self._x = self._at_beginning + self._share_of_end * self._change
        self._force = self._growth * self._pull(self._x)
        r -= self._force
        r += self._turn(self._change) / self._dt

    def add_tangent(self, q1: Array) -> None:
        """Subtract the derivative of the forces from the tangent."""
        if self._slope is None:
            self._slope = self._G / self._dt - self._growth * self._share_of_end * self._S
        self._A.data += self._slope

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the work of the centrifugal forces, and take how much of them acts."""
        self._ledger.supplied["loads"] += float(acting(self._scheme, self._before, self._force) @ s)
        self._before, self._grown = self._force, self._growth_at_end
        a = self._growth * self._outward * self._x
        if self._in_motion:
            a += self._across / self._dt * self._change.take(self._other)
        self._put_accelerations(a)

    def remember(self, memory: Memory, q: Array) -> None:
        """The forces in the equation of the last step, and how much of them acts."""
        self._force = self._before = memory.added("rotating frame", self._before)
        self._grown = memory.number("growth of the rotating frame", self._grown)


def _positions(fields: Fields, about: tuple[float, float]) -> Array:
    """Vectors from a point to the places of all displacements; (size,); m."""
    share = fields.share
    grid, x = share.grid, np.zeros(share.grid.size)
    centers = np.array([body.center for body in grid.scene.rigid_bodies]).reshape(-1, 2)
    # Beams last: those joined to the ground share its displacement, not the place of its centre.
    points = np.concatenate([centers, grid.points]) - about
    x[np.concatenate([grid.dofs_of_bodies, grid.dofs])[:, :2]] = points
    return np.asarray(x[share.dofs])
