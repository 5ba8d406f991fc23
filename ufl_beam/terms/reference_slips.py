# SPDX-License-Identifier: MIT
"""Rigid-plastic connectors whose law is evaluated by NumPy; rigid_plastic.c has the equation."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import lib
from ufl_beam.mechanics.slips import Slip, slip
from ufl_beam.model.law_functions import Values
from ufl_beam.terms.complex_steps import derivative
from ufl_beam.terms.connector_responses import Rows
from ufl_beam.terms.openings import HOLD, OPENED, OVER
from ufl_beam.terms.rigid_plastic import RigidPlasticResponse


class ReferenceSlips(RigidPlasticResponse):
    """Rigid-plastic connectors that NumPy evaluates, see rigid_plastic.c for the equation."""

    def _slip(self, slips: Values, way: Index) -> Slip:
        """Force and energies of these slips."""
        return slip(self._law, {**self._at, "slip": slips, "direction": way}, self._setting.scheme)

    def _force(self, motion: Array, way: Index) -> tuple[Array, Array]:
        """Force of a slip, and its derivative by the motion."""
        grown = np.maximum(way * motion, 0.0)
        force, slope = derivative(lambda a: self._slip(a, way).force, grown)
        return force, way * slope

    def rows(self, e1: Array, λ: Array) -> Rows:
        """α, β, γ around an iterate, whose directions of slip are found first."""
        flags, r = self._setting.search.flags, self._slope
        motion, limit = e1 - self._at["start"], self._limit * (1 + 1e-12)
        tested = λ - self._back_force + r * motion
        free = self._limit == 0
        held = (flags[HOLD] == 1) & (self._slipped == lib.CLOSED) & ~free
        over = held & (np.abs(tested) > limit)
        self._excess[:] = 0.0
        self._excess[over] = np.abs(tested[over]) / self._limit[over] - 1
        if over.any():
            flags[OVER] = 1
        way = np.where(tested < 0, -1, 1)
        force, _ = self._force(motion, way)
        beyond = np.where(
            way * motion <= 0, np.abs(tested) > limit, way * (λ + r * motion - force) > 0
        )
        slips = beyond & ~held & ~free
        if slips.any():
            flags[OPENED] = 1
        self._way[:] = np.where(free, np.where(motion < 0, -1, 1), np.where(slips, way, 0))
        force, slope = self._force(motion, self._way)
        moving = self._way != 0
        self._rows[:, 0] = np.where(moving, slope / r, 1.0)
        self._rows[:, 1] = np.where(moving, -1 / r, 0.0)
        self._rows[:, 2] = np.where(moving, (slope * e1 - force) / r, self._at["start"])
        return self._rows[:, 0], self._rows[:, 1], self._rows[:, 2]

    def _commit(self, e1: Array) -> tuple[float, float, float]:
        at, grown = self._at, np.maximum(self._way * (e1 - self._at["start"]), 0.0)
        end, bounded = self._slip(grown, self._way), np.isfinite(self._limit)
        dissipated, lost, stored = (
            np.where(bounded, x, 0.0) for x in (end.dissipated, end.lost, end.stored)
        )
        self._dissipated += dissipated
        self._limit[bounded] = (end.limit + 0 * grown)[bounded]
        self._back_force[bounded] = (end.back_force + 0 * grown)[bounded]
        self._slipped[:] = np.where(grown > 0, lib.FLOWING, lib.CLOSED)
        at["slipped"] += grown
        at["start"] += self._way * grown
        return float(dissipated.sum()), float(lost.sum()), float(stored.sum())

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Energy dissipated in a step to the motions ``e1``, positive where one would slip; J."""
        grown = np.maximum(self._way * (e1 - self._at["start"]), 0.0)
        over = np.maximum(np.abs(λ - self._back_force) - self._limit * (1 + 1e-12), 0.0)
        return float(np.where(self._way == 0, over, self._slip(grown, self._way).dissipated).sum())
