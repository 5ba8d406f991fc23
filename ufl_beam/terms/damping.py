# SPDX-License-Identifier: MIT
"""Damping forces: what the records of damping.py do to the equation of a step."""

from __future__ import annotations

from functools import singledispatch

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr, StepProduct
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import SceneError
from ufl_beam.mechanics.kinematics import strain, virtual_strain
from ufl_beam.mechanics.time_schemes import Scheme, Step
from ufl_beam.model.damping import KelvinVoigt, Rayleigh
from ufl_beam.terms.beams import Inertia, OfForms, OfMatrix, Term, mass_matrix
from ufl_beam.terms.energy_ledger import Ledger


@singledispatch
def damping_forces(
    damping: object,
    fields: Fields,
    scheme: Scheme,
    A: Csr,
    ledger: Ledger,
    inertia: Inertia | None,
) -> list[Term]:
    """Forces of one kind of damping on the cells of a process; none if it has no such cells."""
    raise TypeError(f"{damping!r} is not a damping")


class KelvinVoigtForces(OfForms):
    """Resultants in proportion to the rates of the strains, P(89) with a weight of time over dt."""

    kind = "damping"

    def __init__(
        self, damping: KelvinVoigt, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger
    ) -> None:
        q0, q1 = fields.configuration(), fields.configuration()
        w, axis, dx = ufl.TestFunction(fields.space), fields.axis, fields.dx(1)
        C, rate = fields.stiffness(), fields.at_points()
        change = strain(q1, axis) - strain(q0, axis)
        r = ufl.as_vector([rate * C[i] * change[i] for i in range(3)])
        work = ufl.dot(r, scheme.virtual_strain(q0, q1, w, axis)) * dx
        self._q0, self._rate, self._time = q0, rate, damping.time
        self._force, self._tangent = fields.force_and_tangent(work, q1, A)
        self._lost = fields.hot_kernel(ufl.dot(r, change) * dx, q1)
        self._A, self._ledger, self._dt = A, ledger, 0.0

    def begin(self, step: Step) -> None:
        """Remember the configuration at the beginning."""
        for kernel in (self._force, self._lost):
            kernel.set(self._q0, step.q0)
            if step.dt != self._dt:
                kernel.put(self._rate, np.array([self._time / step.dt]))
        self._dt = step.dt

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the energy that was damped."""
        self._ledger.lost["damping"] += self._lost.value(q1)

    def add_state(self, q: Array) -> None:
        """Add nothing: damping stores no energy."""

    def remember(self, memory: Memory, q: Array) -> None:
        """Save nothing: damping has no internal variables."""


def reference_stiffness(fields: Fields) -> Csr:
    """Stiffness of the undeformed scene."""
    K = fields.matrix()
    q, C, axis = fields.configuration(), fields.stiffness(), fields.axis
    e, w_e = (
        virtual_strain(q, f(fields.space), axis) for f in (ufl.TrialFunction, ufl.TestFunction)
    )
    work = sum(C[i] * e[i] * w_e[i] for i in range(3)) * fields.dx(1)
    kernel = fields.kernel(work, q)
    kernel.place(K)
    kernel.add(np.zeros(fields.share.size), K.data)
    return K


class RayleighForces(OfMatrix):
    """A constant matrix times the velocity of the step, P(92)."""

    kind = "damping"

    def __init__(
        self, damping: Rayleigh, fields: Fields, A: Csr, ledger: Ledger, inertia: Inertia
    ) -> None:
        C, M, K = fields.matrix(), mass_matrix(fields), reference_stiffness(fields)
        C.data[:] = damping.mass * M.data + damping.stiffness * K.data  # P(92)
        rotations = inertia.scheme.half_tangents(fields.share.rotations())
        self._times = StepProduct(C, rotations, A)
        self._ledger, self._inertia = ledger, inertia

    def begin(self, step: Step) -> None:
        """Prepare what stays constant in the step."""
        self._dt = step.dt
        self._times.begin(step.q0, *self._inertia.scheme.velocity(step.dt, self._inertia))

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the energy that was damped."""
        self._ledger.lost["damping"] += self._times.square(s) / self._dt

    def add_state(self, q: Array) -> None:
        """Add nothing: damping stores no energy."""

    def remember(self, memory: Memory, q: Array) -> None:
        """Save nothing: damping has no internal variables."""


@damping_forces.register
def _rayleigh(
    damping: Rayleigh,
    fields: Fields,
    scheme: Scheme,
    A: Csr,
    ledger: Ledger,
    inertia: Inertia | None,
) -> list[Term]:
    if inertia is None:
        raise SceneError("Rayleigh: it damps velocities, and statics has none; use KelvinVoigt")
    ledger.lost["damping"] += 0.0
    return [RayleighForces(damping, fields, A, ledger, inertia)]


@damping_forces.register
def _kelvin_voigt(
    damping: KelvinVoigt,
    fields: Fields,
    scheme: Scheme,
    A: Csr,
    ledger: Ledger,
    inertia: Inertia | None,
) -> list[Term]:
    ledger.lost["damping"] += 0.0
    grid = fields.share.grid
    beams = grid.scene.beams if damping.beams is None else damping.beams
    cells = [
        cell
        for beam in beams
        for cell, hinge in zip(grid.cells_of(beam), grid.hinges(beam), strict=True)
        if hinge is None
    ]
    part = np.flatnonzero(np.isin(fields.share.cells, cells))
    if not len(part):
        return []
    return [KelvinVoigtForces(damping, Fields(fields.share, part), scheme, A, ledger)]
