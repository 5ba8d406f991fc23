# SPDX-License-Identifier: MIT
"""States of a run at the kept times, and what follows from them: forces, strains, momenta."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from functools import cached_property
from itertools import chain
from typing import NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Blocks, Index, Later, Snapshot, Snapshots
from ufl_beam.compiled.c_library import lib
from ufl_beam.compiled.csr import Product
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import (
    Fields,
    Strains,
    mass_matrix,
)
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import State
from ufl_beam.display import one_line
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Place
from ufl_beam.output.archive import above, below, require_arrays
from ufl_beam.output.forces_along_cells import MIDDLE, ForcesAlongCells

LEDGER = ("state", "supplied", "lost")
"""The parts of the ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""


class Material(NamedTuple):
    """State of the material of all cells at one time.

    Attributes:
        forces: (N, V, M); (num_cells, 3); N, N, N m.
        jump: Rotation of the hinges; (num_cells,); rad.
        plastic: Energy dissipated by plastic strains; (num_cells,); J.
        hinge: Energy dissipated by hinges, or by the cracks of fibres; (num_cells,); J.
    """

    forces: Array
    jump: Array
    plastic: Array
    hinge: Array

    def __repr__(self) -> str:
        return one_line(self)


class KeptStates:
    """States that were kept; methods with a number ``n`` give results of all cells in the n-th.

    Attributes:
        of_record: Method of :class:`CellForces`, if states have its records.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._made: list[Snapshots] = []
        self._later: list[Snapshots | Later] = []  # that come after those
        self._ends: list[int] = []  # number of states up to the end of each block
        self.of_record: Callable[[Array, Array, Array], Array] | None = None
        self._rule: tuple[float, ForcesAlongCells] | None = None
        self._latest: tuple[int, Snapshot] | None = None  # state that was asked for last
        self._computed: tuple[Snapshot, float, int, Array] | None = None  # forces asked for last

    @property
    def _blocks(self) -> list[Snapshots]:
        """All states."""
        for one in self._later:
            self._made.append(one.make() if isinstance(one, Later) else one)
        self._later.clear()
        return self._made

    def append(self, states: Snapshots | Later) -> None:
        """Append states that come after those here."""
        if len(states.t):
            self._later.append(states)
            self._ends.append(len(self) + len(states.t))

    def part(self, first: int, last: int) -> KeptStates:
        """Views of the states from the first number to before the last one."""
        part, k = KeptStates(self._grid), bisect_right(self._ends, first)
        while first < last:
            block, end = self._blocks[k], self._ends[k]
            begin, k = end - len(block.t), k + 1
            if first > begin or last < end:
                block = block.view(slice(first - begin, last - begin))
            part.append(block)
            first = end
        return part

    def thin(self) -> None:
        """Forget every other state; the first one stays."""
        first = [end - len(block.t) for end, block in zip(self._ends, self._blocks, strict=True)]
        blocks = [b.some(slice(k % 2, None, 2)) for k, b in zip(first, self._blocks, strict=True)]
        self._made, self._later, self._ends, self._latest = [], [], [], None
        for block in blocks:
            self.append(block)

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, n: int) -> Snapshot:
        """The n-th state; the same object if it is asked for again."""
        number = range(len(self))[n]
        if self._latest is None or self._latest[0] != number:
            k = bisect_right(self._ends, number)
            self._latest = number, self._blocks[k].one(number - self._ends[k])
        return self._latest[1]

    @property
    def times(self) -> Array:
        """Times, or load factors of a path; (n+1,); s."""
        return Blocks([block.t for block in self._blocks])[:,]

    @property
    def q(self) -> Blocks:
        """Configurations, all degrees of freedom; (n+1, size)."""
        return Blocks([block.q for block in self._blocks])

    @property
    def v(self) -> Blocks:
        """Velocities, as :attr:`q`; empty in statics."""
        return Blocks([block.v for block in self._blocks if block.v is not None])

    @property
    def reactions(self) -> Blocks:
        """Forces of the supports; (n+1, num_supports, 3); N, N, N m."""
        return Blocks([block.reactions for block in self._blocks])

    @property
    def materials(self) -> Blocks:
        """Cells that can yield or break, and their material; (n+1, m, 7)."""
        return Blocks([block.material for block in self._blocks])

    @property
    def connections(self) -> Blocks:
        """Columns of ``Connection`` for all links; (n+1, num_links, 5)."""
        return Blocks([block.connections for block in self._blocks])

    def _complete(self) -> None:
        """Compute the forces of cells where records are kept in their place."""
        for k, block in enumerate(self._blocks):
            if block.cells.ndim == 2:
                states = map(block.one, range(len(block.t)))
                cells = np.array([self.numbers(state) for state in states])
                self._blocks[k], self._latest = block._replace(cells=cells), None

    def numbers(self, state: Snapshot) -> Array:
        """``cell_number`` of loops.h for all cells; (9, num_cells); N, N m."""
        if state.cells.ndim == 2:
            return state.cells
        if self.of_record is None:
            raise SceneError("section forces: these states were kept without them")
        before = state.q if state.before is None else state.before
        return self.of_record(state.cells, state.q, before)

    @property
    def before(self) -> Blocks:
        """Configurations at the beginnings of the steps; empty where they do not matter."""
        return Blocks([block.before for block in self._blocks if block.before is not None])

    def ledger(self) -> list[dict[str, Array]]:
        """Return the parts of the ledger, with arrays by name; each (n+1,); J."""
        parts = []
        for k in range(len(LEDGER)):
            names = dict.fromkeys(chain.from_iterable(b.entries[k] for b in self._blocks))
            parts.append({name: self._entry(k, name) for name in names})
        return parts

    def _entry(self, k: int, name: str) -> Array:
        """An entry of the k-th part of the ledger, zero where it is not there; (n+1,); J."""
        found = [block.entries[k].get(name) for block in self._blocks]
        pairs = zip(found, self._blocks, strict=True)
        return np.concatenate([np.zeros(len(b.t)) if e is None else e for e, b in pairs])

    # -- files ---------------------------------------------------------------------------------

    def arrays(self) -> State:
        """Return all states, as arrays by name."""
        self._complete()
        arrays = {
            "q": self.q[:,], "reactions": self.reactions[:,], "connections": self.connections[:,],
            "material": self.materials[:,], "times": self.times, "v": self.v[:,],
            "cells": Blocks([block.cells for block in self._blocks])[:,],
        }  # fmt: skip
        before = self.before[:,]
        if len(before) and not np.array_equal(before[1:], arrays["q"][:-1]):
            arrays["before"] = before  # else each step begins where the one before ends
        elif len(before):
            arrays["before"] = before[:1]
        for kind, entries in zip(LEDGER, self.ledger(), strict=True):
            arrays |= above(f"{kind}: ", entries)
        return arrays

    def take(self, arrays: State) -> None:
        """Go on after :meth:`arrays`; what they lack, or have no rows of, is not in the scene.

        Raises:
            SceneError: They have other shapes than those that the scene implies.
        """
        require_arrays(arrays, {"times": (-1,)})
        n, grid = len(arrays["times"]), self._grid
        shapes: dict[str, tuple[int, ...]] = {
            "reactions": (n, len(grid.scene.supports), 3), "material": (n, -1, 7),
            "connections": (n, len(grid.scene.links), 5),
        }  # fmt: skip
        nothing: dict[str, Array] = {
            name: np.zeros([max(length, 0) for length in shape]) for name, shape in shapes.items()
        }
        # Files of earlier versions have no forces of cells.
        shapes["cells"] = n, lib.CELL_NUMBERS, len(grid.cells)
        nothing["cells"] = np.broadcast_to(np.nan, shapes["cells"])
        found = {**nothing, **{name: values for name, values in arrays.items() if len(values)}}
        ledger = tuple(below(f"{kind}: ", found) for kind in LEDGER)
        self._made, self._later, self._ends, self._latest = [], [], [], None
        if n:
            shapes |= {"q": (n, grid.size)} | ({"v": (n, grid.size)} if "v" in found else {})
            shapes |= {"before": (-1, grid.size)} if "before" in found else {}
            require_arrays(found, shapes)
            if 1 == len(found.get("before", ())) < n:
                found["before"] = np.concatenate([found["before"], found["q"][:-1]])
            require_arrays(found, {"before": (n, grid.size)} if "before" in found else {})
            for entries in ledger:
                require_arrays(entries, dict.fromkeys(entries, (n,)))
            cells = found["material"][:, :, 0]
            if not np.isin(cells, np.arange(len(grid.cells))).all():
                raise SceneError("the array 'material' has numbers of cells that there are not")
            self.append(
                Snapshots(
                    found["times"], found["q"], found.get("v"), found["reactions"], ledger,
                    found["material"], found["connections"], found["cells"], found.get("before"),
                )
            )  # fmt: skip

    # -- cells ---------------------------------------------------------------------------------

    @cached_property
    def _fields(self) -> Fields:
        """The whole scene on this process: what is computed afterwards needs no communication."""
        return Fields(Share(self._grid, MPI.COMM_SELF))

    @cached_property
    def _strains(self) -> Strains:
        return Strains(self._fields)

    @cached_property
    def _dofs(self) -> Index:
        """Degrees of freedom (u, v, ψ) of the nodes of all cells; (num_cells, 3, degree + 1)."""
        return np.asarray(self._grid.dofs[self._grid.nodes_of_cells].transpose(0, 2, 1))

    def _along(self, between: float) -> ForcesAlongCells:
        if self._rule is None or self._rule[0] != between:
            self._rule = between, ForcesAlongCells(self._grid, between)
        return self._rule[1]

    def forces(self, n: int, between: float, points: int = 1) -> Array:
        """(N, V, M) in equally spaced points of the cells, or in the middle of each.

        (num_cells, points, 3).
        """
        state = self[n]
        asked = self._computed
        if asked is None or asked[0] is not state or asked[1:3] != (between, points):
            parts = MIDDLE if points == 1 else np.arange(points) / (points - 1)
            q, before = state.q[self._dofs], None
            if state.before is not None:
                before = state.before[self._dofs]
            forces = self._along(between)(slice(None), parts, self.numbers(state), q, before)
            forces.flags.writeable = False
            asked = self._computed = state, between, points, forces
        return asked[3]

    def forces_at(self, place: Place, between: float) -> Array:
        """(N, V, M) at a place at all kept times; (n+1, 3)."""
        cell, part = self._grid.cell_and_part(place)
        dofs, n = self._dofs[cell], len(self)
        q, before = self.q[:, dofs], self.before[:, dofs] if len(self.before) else None
        numbers = np.array([self.numbers(self[k])[:, cell] for k in range(n)]).T
        cells = np.full(n, cell)
        return np.asarray(self._along(between)(cells, np.array([part]), numbers, q, before)[:, 0])

    def strains(self, n: int) -> Array:
        """(Σ, Γ, K); (num_cells, 3); 1, 1, 1/m."""
        strains = np.empty((len(self._grid.cells), 3))
        strains[self._fields.order] = self._strains.mean(self[n].q)
        return strains

    def material(self, n: int, cells: Index | int, between: float) -> Material:
        """State of the material of some cells."""
        inelastic, rows = cells_of(self[n])
        if not len(inelastic) and not self._grid.scene.hinges:
            raise SceneError("material: nothing in the scene yields or breaks; it is elastic")
        everything = np.zeros((len(self._grid.cells), 6))
        everything[:, :3] = self.forces(n, between)[:, 0]
        everything[inelastic] = rows  # of the law
        chosen = everything[cells].T
        return Material(chosen[:3].T, *chosen[3:])

    def at(self, place: Place, of: Callable[[int], Array]) -> Array:
        """Results of the cell at a place at all kept times; (n+1, 3)."""
        cell = self._grid.cell(place)
        return np.array([of(n)[cell] for n in range(len(self))])

    def material_at(self, place: Place, between: float) -> Material:
        """State of the material in the cell at a place; arrays begin with (n+1,)."""
        cell = self._grid.cell(place)
        kept = [self.material(n, cell, between) for n in range(len(self))]
        return Material(*map(np.array, zip(*kept, strict=True)))

    def momentum(self) -> Array:
        """(p_x, p_y, L) at all kept times, L about the origin; (n+1, 3); N s, N s, N m s."""
        if not len(self.v):
            raise SceneError("momentum: the run was static; there is none")
        times, grid = Product(mass_matrix(self._fields)), self._grid
        dofs = np.vstack([grid.dofs, grid.dofs_of_bodies])
        centers = np.array([body.center for body in grid.scene.rigid_bodies]).reshape(-1, 2)
        _, first = np.unique(dofs[:, 0], return_index=True)
        u, v, ψ = dofs[first, 0], dofs[first, 1], np.unique(dofs[:, 2])
        X, Y = np.vstack([grid.points, centers])[first].T

        def of(q: Array, velocity: Array) -> tuple[float, float, float]:
            p = times(velocity)
            turning = (X + q[u]) * p[v] - (Y + q[v]) * p[u]
            return p[u].sum(), p[v].sum(), turning.sum() + p[ψ].sum()

        return np.array([of(q, v) for q, v in zip(self.q, self.v, strict=True)])


def cells_of(state: Snapshot) -> tuple[Index, Array]:
    """Cells of a state that can yield or break, and rows of their material, N, V, M first."""
    return state.material[:, 0].astype(np.int64), state.material[:, 1:]
