# SPDX-License-Identifier: MIT
"""Transfer of the last state of a run to a scene with the same beams and other connections."""

from __future__ import annotations

from copy import copy

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.cell_functions import mass_matrix
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import ModelError
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.connectors import Connector

APART = 1e-6
"""Largest difference between the positions of two places that a new joint may connect, relative to
the size of the scene; in rotations, in rad."""

ROUND_OFF = 1e-6
"""Largest difference of velocities that is not an impact, relative to all velocities."""

Excess = tuple[Array, float]
"""Momentum and kinetic energy (J) before an impact in addition to those of the velocities: of parts
with different velocities that begin to share an unknown."""

CELL_TABLES = ("cells", "changes of strains", "committed tangents")
"""Tables of internal variables of cells; the other tables are of connectors."""


class Transfer:
    """Map between the degrees of freedom of two scenes.

    Beams and bodies of both scenes are the same if they are the same objects.  Connectors are the
    same if motion, places and type of law are equal.  If a joint was removed, both places start at
    the position of the joint.  If a joint was added, its places must coincide.
    """

    def __init__(self, old: DofNumbering, new: DofNumbering) -> None:
        self._old, self._new = old, new
        new.scene.require_plane("start= of a scene with other connections")
        self._require_alike()
        bodies = [body for body in new.scene.rigid_bodies if body in old.scene.rigid_bodies]
        new_dofs, old_dofs = (
            np.vstack([numbering.dofs, *(numbering.node(body.middle) for body in bodies)]).ravel()
            for numbering in (new, old)
        )
        # ``connectors`` maps indices of connectors from the new scene to the old scene.
        known: dict[object, list[int]] = {}
        for i, connector in enumerate(old.scene.all_connectors):
            known.setdefault(geometry(connector), []).append(i)
        connectors: dict[int, int] = {}
        for i, connector in enumerate(new.scene.all_connectors):
            if candidates := known.get(geometry(connector)):
                connectors[i] = candidates.pop(0)
        self._connector_map = {a: b for b, a in connectors.items()}
        self._to = np.concatenate([new_dofs, new.multipliers[list(connectors)]])
        self._from = np.concatenate([old_dofs, old.multipliers[list(connectors.values())]])

    def _require_alike(self) -> None:
        """Raise unless beams, meshes and points are equal and all bodies are in the old scene."""
        old, new = self._old, self._new
        if old.scene.beams != new.scene.beams or old.mesh != new.mesh:
            raise ModelError(
                "start: the solution has other beams or another mesh; use the same Beam objects "
                "in the same order, and the same Mesh. From a file: "
                "start=ub.Solution.load(path, scene=scene) with the scene that was saved"
            )
        if not np.array_equal(old.points, new.points):
            nodes = ((b, old.nodes_of(b)[0], new.nodes_of(b)[0]) for b in new.scene.beams)
            beam = next(b for b, before, now in nodes if not np.array_equal(before, now))
            raise ModelError(
                f"start: {beam.name} has other vertices than in the solution, because objects "
                "are attached at other places; add these places to corners=(s, ...) of the beam"
            )
        for body in new.scene.bodies:
            if body not in old.scene.bodies:
                raise ModelError(
                    f"start: {body.name} is not in the scene of the solution, so its position is "
                    "unknown; add it to the first scene, too, held by supports there"
                )

    def state(self, q: Array) -> Array:
        """Map a configuration to the new numbering; raise if places of a new joint are apart."""
        mapped = self._map(q)
        mismatch = np.abs(mapped[self._to] - q[self._from])
        worst = int(np.argmax(relative := mismatch * self._new.scales[self._to]))
        if relative[worst] > APART:
            unit = "rad" if self._to[worst] in self._new.rotations else "m"
            raise ModelError(
                "start: the new scene joins places whose positions differ by "
                f"{mismatch[worst]:.3g} {unit} at the end of the solution: "
                f"{self._new.describe(int(self._to[worst]))}. Connect them by springs, or start "
                "from a solution in which their positions are equal"
            )
        return self._on_ground(mapped)

    def velocity(self, v: Array) -> tuple[Array, Excess | None]:
        """Map velocities to the new numbering.

        The second result is the momentum and energy of the velocities of places that begin to share
        an unknown, if they differ; they are in addition to those of the first result.
        """
        mapped, new = self._on_ground(self._map(v)), self._new
        gaps, fastest = v[self._from] - mapped[self._to], np.abs(v * self._old.scales).max()
        if np.abs(gaps * new.scales[self._to]).max() <= ROUND_OFF * fastest:
            return mapped, None
        own = np.arange(3 * (len(new.dofs) + len(new.dofs_of_bodies))).reshape(-1, 3)
        apart = copy(new)  # nodes have unknowns of their own
        apart.dofs, apart.dofs_of_bodies = np.split(own, [len(new.dofs)])
        apart.size = own.size + new.size
        gap = np.append(gaps, np.zeros(apart.size - len(gaps)))
        momentum = mass_matrix(Fields(Subdomain(apart, MPI.COMM_SELF))).sparse() @ gap
        excess = np.zeros(new.size)
        np.add.at(excess, self._to, momentum[: len(gaps)])
        return mapped, (excess, float(gap @ momentum / 2))

    def _map(self, x: Array) -> Array:
        mapped = np.zeros(self._new.size)
        mapped[self._to] = x[self._from]
        return mapped

    def _on_ground(self, x: Array) -> Array:
        if GROUND in self._new.scene.rigid_bodies:
            x[self._new.node(GROUND.middle)] = 0.0
        return x

    def internal(self, state: State) -> State:
        """Map internal variables, forces and stored rates to the numbering of the new scene."""
        mapped: State = {}
        for name, values in state.items():
            if values.ndim == 1:
                mapped[name] = self._map(values) if len(values) == self._old.size else values
            elif name.rpartition(",")[0] in CELL_TABLES:
                mapped[name] = values
            else:
                common = [row for row in values if int(row[0]) in self._connector_map]
                rows = [[self._connector_map[int(row[0])], *row[1:]] for row in common]
                if rows:
                    mapped[name] = np.array(sorted(rows, key=lambda row: row[0]))
        return mapped


def same_unknowns(old: DofNumbering, new: DofNumbering) -> bool:
    """Return whether degrees of freedom and connectors have equal numbers in two scenes."""
    before, now = ([geometry(c) for c in x.scene.all_connectors] for x in (old, new))
    same_bodies = old.scene.rigid_bodies == new.scene.rigid_bodies
    return new.agrees(old) and old.size == new.size and same_bodies and before == now


def geometry(connector: Connector) -> object:
    """Return a key that is equal for connectors of the same places and kind of law."""
    names = "motion", "a", "b", "axis", "corner"
    return *(getattr(connector, name) for name in names), type(connector.law)
