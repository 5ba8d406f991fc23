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

from ufl_beam.arrays import Array, Blocks, Index, Snapshot, Snapshots
from ufl_beam.compiled.csr import Product
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.function_spaces import (
    CompiledFields,
    Fields,
    SectionForces,
    Strains,
    mass_matrix,
)
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Place
from ufl_beam.one_line import one_line
from ufl_beam.output.archive import above, below

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
    """States that were kept; methods with a number ``n`` give results of all cells in the n-th."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._blocks: list[Snapshots] = []
        self._ends: list[int] = []  # number of states up to the end of each block
        self._latest: tuple[int, Snapshot] | None = None  # state that was asked for last
        self._computed: tuple[Snapshot, Array] | None = None  # forces in the last state asked for

    def append(self, states: Snapshots) -> None:
        """Append states that come after those here."""
        if len(states.t):
            self._blocks.append(states)
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
        self._blocks, self._ends, self._latest = [], [], None
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
        arrays = {
            "q": self.q[:,], "reactions": self.reactions[:,], "connections": self.connections[:,],
            "material": self.materials[:,], "times": self.times, "v": self.v[:,],
        }  # fmt: skip
        for kind, entries in zip(LEDGER, self.ledger(), strict=True):
            arrays |= above(f"{kind}: ", entries)
        return arrays

    def take(self, arrays: State) -> None:
        """Go on after :meth:`arrays`; what they lack, or have no rows of, is not in the scene."""
        n = len(arrays["times"])
        nothing: dict[str, Array] = {
            "reactions": np.zeros((n, 0, 3)), "connections": np.zeros((n, 0, 5)),
            "material": np.zeros((n, 0, 7)),
        }  # fmt: skip
        found = {**nothing, **{name: values for name, values in arrays.items() if len(values)}}
        ledger = tuple(below(f"{kind}: ", found) for kind in LEDGER)
        self._blocks, self._ends, self._latest = [], [], None
        if n:
            self.append(
                Snapshots(
                    found["times"], found["q"], found.get("v"), found["reactions"], ledger,
                    found["material"], found["connections"],
                )
            )  # fmt: skip

    # -- cells ---------------------------------------------------------------------------------

    @cached_property
    def _fields(self) -> Fields:
        """The whole scene on this process: what is computed afterwards needs no communication."""
        return CompiledFields(Share(self._grid, MPI.COMM_SELF))

    @cached_property
    def _section_forces(self) -> SectionForces:
        return SectionForces(self._fields)

    @cached_property
    def _strains(self) -> Strains:
        return Strains(self._fields)

    def forces(self, n: int) -> Array:
        """(N, V, M), kept where history decides, else computed from the motion; (num_cells, 3)."""
        state = self[n]
        if self._computed is None or self._computed[0] is not state:
            forces = np.empty((len(self._grid.cells), 3))
            self._section_forces.write(state.q, forces)
            cells, rows = cells_of(state)
            forces[cells] = rows[:, :3]
            forces.flags.writeable = False
            self._computed = state, forces
        return self._computed[1]

    def forces_in_points(self, state: Snapshot) -> Array:
        """(N, V, M) in the Gauss points, as :meth:`forces`; (num_cells, degree, 3)."""
        fields = self._fields
        forces = np.empty((len(fields.order), self._grid.mesh.degree, 3))
        C = fields.of_sections(fields.element.stiffness)
        forces[fields.order] = self._strains(state.q).reshape(forces.shape) * C[:, None]
        cells, rows = cells_of(state)
        forces[cells] = rows[:, None, :3]
        return forces

    def strains(self, n: int) -> Array:
        """(Σ, Γ, K); (num_cells, 3); 1, 1, 1/m."""
        strains = np.empty((len(self._grid.cells), 3))
        strains[self._fields.order] = self._strains.mean(self[n].q)
        return strains

    def material(self, n: int, cells: Index | int) -> Material:
        """State of the material of some cells."""
        inelastic, rows = cells_of(self[n])
        if not len(inelastic) and not self._grid.scene.hinges:
            raise SceneError("material: nothing in the scene yields or breaks; it is elastic")
        everything = np.zeros((len(self._grid.cells), 6))
        everything[:, :3] = self.forces(n)
        everything[inelastic, 3:] = rows[:, 3:]
        chosen = everything[cells].T
        return Material(chosen[:3].T, *chosen[3:])

    def at(self, place: Place, of: Callable[[int], Array]) -> Array:
        """Results of the cell at a place at all kept times; (n+1, 3)."""
        cell = self._grid.cell(place)
        return np.array([of(n)[cell] for n in range(len(self))])

    def material_at(self, place: Place) -> Material:
        """State of the material in the cell at a place; arrays begin with (n+1,)."""
        cell = self._grid.cell(place)
        kept = [self.material(n, cell) for n in range(len(self))]
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
