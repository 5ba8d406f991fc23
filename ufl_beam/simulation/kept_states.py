# SPDX-License-Identifier: MIT
"""States of a run at the times that were kept."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.state_io import State
from ufl_beam.output.snapshot import Snapshot

LEDGER = ("state", "supplied", "lost")
"""The parts of the ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""


class KeptStates:
    """Lists of what was kept, see :class:`Snapshot`; ``v`` is empty in statics."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.q: list[Array] = []
        self.v: list[Array] = []
        self.reactions: list[Array] = []
        self.entries: list[tuple[dict[str, float], ...]] = []
        self.material: list[list[tuple[Index, Array]]] = []
        self.connections: list[Array] = []

    def keep(self, state: Snapshot) -> None:
        """Append a state of a run."""
        self.times.append(state.t)
        self.q.append(state.q)
        if state.v is not None:
            self.v.append(state.v)
        self.reactions.append(state.reactions)
        self.entries.append(state.entries)
        self.material.append(state.material)
        if len(state.connections):
            self.connections.append(state.connections)

    def thin(self) -> None:
        """Forget every other state; the first one stays."""
        for kept in vars(self).values():
            del kept[1::2]

    def ledger(self) -> list[dict[str, Array]]:
        """Return the parts of the ledger, with arrays by name; each (n+1,); J."""
        parts = []
        for k in range(len(LEDGER)):
            names = dict.fromkeys(name for entries in self.entries for name in entries[k])
            parts.append({n: np.array([e[k].get(n, 0.0) for e in self.entries]) for n in names})
        return parts

    def arrays(self) -> State:
        """Return all of it, as arrays by name."""
        arrays = {
            "times": np.array(self.times),
            "q": np.array(self.q),
            "v": np.array(self.v),
            "reactions": np.array(self.reactions),
            "connections": np.array(self.connections),
        }
        if self.material and self.material[0]:
            # Groups are those of laws and processes.
            tables = [np.concatenate([np.c_[group] for group in one]) for one in self.material]
            arrays["material"] = np.array([table[np.argsort(table[:, 0])] for table in tables])
        for kind, entries in zip(LEDGER, self.ledger(), strict=True):
            arrays |= {f"{kind}: {name}": values for name, values in entries.items()}
        return arrays

    def take(self, arrays: State) -> None:
        """Go on after :meth:`arrays`."""
        self.times = [float(t) for t in arrays["times"]]
        self.q, self.v = list(arrays["q"]), list(arrays["v"])
        self.reactions, self.connections = list(arrays["reactions"]), list(arrays["connections"])
        self.material = [[] for _ in self.times]
        if "material" in arrays:
            tables = [*arrays["material"]]
            self.material = [[(one[:, 0].astype(np.int64), one[:, 1:])] for one in tables]
        parts = [
            {name.removeprefix(f"{kind}: "): values
             for name, values in arrays.items() if name.startswith(f"{kind}: ")}
            for kind in LEDGER
        ]  # fmt: skip
        self.entries = [
            tuple({name: float(values[n]) for name, values in part.items()} for part in parts)
            for n in range(len(self.times))
        ]
