# SPDX-License-Identifier: MIT
"""Dead loads: forces and moments that keep their direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import singledispatch
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, loop, struct
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.mechanics.time_schemes import Scheme, Step
from ufl_beam.model.bodies import carries
from ufl_beam.model.loads import Gravity, LineLoad, Load, PointLoad
from ufl_beam.model.time_functions import value_at
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.loads import LoadTerm
from ufl_beam.terms.phases import Phases, TimeFunctions, weight_of_before


class DeadLoads(LoadTerm):
    """Forces and moments that keep their direction: vectors times functions of time."""

    _name = "dead loads"

    def __init__(self, loads: Sequence[Load], share: Share, scheme: Scheme, ledger: Ledger) -> None:
        super().__init__(share, scheme, ledger)
        # Loads of one time function are one vector; functions need not be hashable.
        vectors: dict[int, tuple[Load, Array]] = {}
        for load in loads:
            _, vector = vectors.setdefault(id(load.time), (load, np.zeros(share.size)))
            _add_forces(load, share, vector)
        self._vectors = list(vectors.values())
        self._end: Array = self.force
        self._in_c = struct("vector", size=share.size)
        self._factors: list[float] = []
        self._scheme = scheme

    def begin(self, step: Step) -> None:
        """The loads of the step; nothing is to do for those that stay."""
        factors = self._factors_at(step.load_time)
        if factors == self._factors and step.fraction == step.at == 1:
            return
        self.force = self._end = self._times(factors)
        self._factors = factors
        if step.fraction < 1 or step.at < 1:
            change = step.fraction * (self._end - self._before)
            self._end = self._before + change
            self.force = self._end if step.at == 1 else self._before + step.at * change
            self._factors = []
        self._values = self._in_c.values = doubles(self.force)

    def loops(self) -> tuple[Loop, Loop | None]:
        """C loop that subtracts the load vector; no tangent."""
        return loop("subtract_vector", self._in_c), None

    def phases(self, times: TimeFunctions) -> Phases | None:
        """Loops over the vectors."""
        owners = [(load.time, load) for load, _ in self._vectors]
        weight, size = weight_of_before(self._acting), len(self.force)
        alike = weight == 0.0 and self._scheme.step(0.0, 1.0, 1.0, np.zeros(0)).at == 1.0
        forces = np.zeros((1 if alike else 3, size))
        now, end, before = (forces[k % len(forces)] for k in range(3))
        c = self.steps_in_c = struct(
            "dead_loads", size=size, vectors=len(owners), force=now, end=end, before=before,
            factors=np.empty(len(owners)), factor=times.in_c(owners),
            vector=ffi.new("double *[]", [doubles(vector) for _, vector in self._vectors]),
            work=self._ledger.supplied.pointer("loads"), weight_of_before=weight,
        )  # fmt: skip

        def enter(q: Array) -> None:
            before[:] = self._before
            self.force, self._end, self._before = now, end, before  # no second arrays
            for k in range(len(owners)):
                c.factors[k] = math.nan
            self._in_c.values = doubles(now)

        def leave(q: Array) -> None:
            self.force, self._end, self._before = now.copy(), end.copy(), before.copy()
            self._factors = []

        begin, accept = [loop("begin_dead_loads", c)], [loop("accept_dead_loads", c)]
        return Phases(begin, accept, enter=enter, leave=leave)

    def carry_on(self, t: float, q: Array) -> Array:
        """The loads at time ``t``; take the state ``q`` as one that is in equilibrium with them."""
        self._before = self._times(self._factors_at(t))
        return self._before

    def _factors_at(self, t: float) -> list[float]:
        """Factors of the vectors; a vector belongs to its first load for messages."""
        return [value_at(load.time, t, load) for load, _ in self._vectors]

    def _times(self, factors: list[float]) -> Array:
        (_, vector), *others = self._vectors
        force = factors[0] * vector
        for factor, (_, vector) in zip(factors[1:], others, strict=True):
            force += factor * vector
        return force

    def add_residual(self, q1: Array, r: Array) -> None:
        """Subtract the loads from the residual."""
        r -= self.force

    def accept(self, q1: Array, s: Array) -> None:
        """Enter the work of the loads, if there are any."""
        if any(self._factors) or self._before is not self.force:
            self._ledger.supplied["loads"] += float(self._acting(self._before, self.force) @ s)
            self._before = self._end

    def remember(self, memory: Memory, q: Array) -> None:
        """The forces at the end of the last step."""
        super().remember(memory, q)
        self._end, self._factors = self._before, []


@singledispatch
def _add_forces(load: Load, share: Share, forces: Array) -> None:
    """Add the nodal forces of a dead load, consistent with displacements, with factor one."""
    raise TypeError(f"{type(load).__name__} is not a dead load")


@_add_forces.register
def _(load: PointLoad, share: Share, forces: Array) -> None:
    if not carries(load.place):
        return  # Scene.links has connectors for it
    dofs = share.at(load.place)
    mine = share.owns(dofs)
    forces[share.local(dofs[mine])] += np.array([*load.force, load.moment])[mine]


@_add_forces.register
def _(load: LineLoad, share: Share, forces: Array) -> None:
    here = [beam is load.beam for beam in share.grid.scene.beams]
    forces += _along_beams(np.outer(here, [*load.force, load.moment]), share)


@_add_forces.register
def _(load: Gravity, share: Share, forces: Array) -> None:
    scene = share.grid.scene
    rhoA = [beam.section.rhoA for beam in scene.beams]
    weight = _along_beams(np.outer(rhoA, [*load.acceleration, 0.0]), share)
    heavy = [(one.place, one.mass) for one in scene.masses]
    heavy += [(one.middle, one.mass) for one in scene.bodies]
    for place, mass in heavy:
        g_x, g_y = load.acceleration
        _add_forces(PointLoad(place, force=(mass * g_x, mass * g_y)), share, weight)
    forces += weight


def _along_beams(per_beam: npt.NDArray[Any], share: Share) -> Array:
    """Nodal forces of line loads (num_beams, 3): two nodes of a cell bear a half of it each."""
    grid = share.grid
    loads = per_beam[grid.beam_of_cell[share.cells]] * share.cell_lengths()[:, None]
    first, *between, last = grid.mesh.parts
    forces = np.zeros(share.size)
    np.add.at(forces, share.cell_dofs, np.kron(loads, [first, last, *between]))
    return forces
