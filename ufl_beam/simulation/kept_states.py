# SPDX-License-Identifier: MIT
"""States of a run at the times that were kept."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index, Snapshot
from ufl_beam.discretization.state_io import State

LEDGER = ("state", "supplied", "lost")
"""The parts of the ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""


class KeptStates(list[Snapshot]):
    """States that were kept; ``v`` is empty in statics, ``connections`` in scenes without any."""

    @property
    def times(self) -> list[float]:
        """Times, or load factors of a path; s."""
        return [state.t for state in self]

    @property
    def q(self) -> list[Array]:
        """Configurations, all degrees of freedom."""
        return [state.q for state in self]

    @property
    def v(self) -> list[Array]:
        """Velocities, all degrees of freedom."""
        return [state.v for state in self if state.v is not None]

    @property
    def reactions(self) -> list[Array]:
        """Forces of the supports on the scene."""
        return [state.reactions for state in self]

    @property
    def material(self) -> list[list[tuple[Index, Array]]]:
        """Groups of cells that can yield or break, and rows for their material."""
        return [state.material for state in self]

    @property
    def connections(self) -> list[Array]:
        """Columns of ``Connection`` for all links."""
        return [state.connections for state in self if len(state.connections)]

    def ledger(self) -> list[dict[str, Array]]:
        """Return the parts of the ledger, with arrays by name; each (n+1,); J."""
        parts = []
        for k in range(len(LEDGER)):
            part = [state.entries[k] for state in self]
            names = dict.fromkeys(name for entries in part for name in entries)
            parts.append({n: np.array([e.get(n, 0.0) for e in part]) for n in names})
        return parts

    def arrays(self) -> State:
        """Return all of it, as arrays by name."""
        names = ("times", "q", "v", "reactions", "connections")
        arrays = {name: np.array(getattr(self, name)) for name in names}
        if self and self[0].material:
            # Groups are those of laws and processes.
            tables = [np.concatenate([np.c_[group] for group in one]) for one in self.material]
            arrays["material"] = np.array([table[np.argsort(table[:, 0])] for table in tables])
        for kind, entries in zip(LEDGER, self.ledger(), strict=True):
            arrays |= {f"{kind}: {name}": values for name, values in entries.items()}
        return arrays

    def take(self, arrays: State) -> None:
        """Go on after :meth:`arrays`."""
        n = len(arrays["times"])
        material: list[list[tuple[Index, Array]]] = [[] for _ in range(n)]
        if "material" in arrays:
            material = [[(one[:, 0].astype(np.int64), one[:, 1:])] for one in arrays["material"]]
        parts = [
            {name.removeprefix(f"{kind}: "): values
             for name, values in arrays.items() if name.startswith(f"{kind}: ")}
            for kind in LEDGER
        ]  # fmt: skip
        # Shapes that are no run have no velocities and reactions.
        reactions, connections = (
            arrays[name] if len(arrays[name]) else np.zeros((n, 0))
            for name in ("reactions", "connections")
        )
        v = arrays["v"] if len(arrays["v"]) else [None] * n
        self[:] = [
            Snapshot(
                float(arrays["times"][k]), arrays["q"][k], v[k], reactions[k],
                tuple({name: float(x[k]) for name, x in part.items()} for part in parts),
                material[k], connections[k],
            )
            for k in range(n)
        ]  # fmt: skip
