# SPDX-License-Identifier: MIT
"""Energy ledger of a scene; the statements of blocks/, terms and C write its entries."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles
from ufl_beam.discretization.state_io import Archive
from ufl_beam.display import Rich
from ufl_beam.model.connector_law import CONTRIBUTIONS

EXPLAINED = 0.1
"""Least ratio of estimated round-off to imbalance at which round-off explains the imbalance."""

ROUND_OFF_ENERGY = 1e-3
"""Largest ratio of stored and lost energy to transferred energy at which works are round-off."""


class Account(Mapping[str, float]):
    """Entries of one part of the ledger by name; entries that were never written are zero.

    The values are in one array, in the order in which names were first used, so that C can add to
    them.

    Attributes:
        amounts: Values of the entries, and space for more; J.
    """

    def __init__(self) -> None:
        self._at: dict[str, int] = {}
        self.amounts: Array = np.zeros(16)
        self._fixed = False  # True once C has addresses

    def __getitem__(self, name: str) -> float:
        return float(self.amounts[self._at[name]]) if name in self._at else 0.0

    def __setitem__(self, name: str, value: float) -> None:
        at = self._at.setdefault(name, len(self._at))
        if at == len(self.amounts):
            if self._fixed:
                raise RuntimeError(
                    f"the entry {name!r} must be made before C gets addresses of entries"
                )
            self.amounts = np.append(self.amounts, np.zeros(at))
        self.amounts[at] = value

    def __contains__(self, name: object) -> bool:
        return name in self._at

    def __iter__(self) -> Iterator[str]:
        return iter(self._at)

    def __len__(self) -> int:
        return len(self._at)

    def pointer(self, name: str) -> Any:
        """Return the address of an entry for C; afterwards the array cannot grow."""
        self[name] += 0.0
        self._fixed = True
        return doubles(self.amounts) + self._at[name]


@dataclass
class Ledger:
    """Energies of one process at one time; terms write them when a step is accepted.

    All processes create the same entries before the first step.  :class:`Energy` explains the three
    parts.
    """

    state: Account = field(default_factory=Account)
    supplied: Account = field(default_factory=Account)
    lost: Account = field(default_factory=Account)

    def size(self) -> float:
        """Return the sum of the absolute values of all entries; J."""
        accounts = self.state, self.supplied, self.lost
        return float(sum(np.abs(account.amounts).sum() for account in accounts))

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the supplied works and the losses since the beginning."""
        for kind, entries in (("supplied", self.supplied), ("lost", self.lost)):
            for name, value in entries.items():
                entries[name] = archive.total(f"{kind}: {name}", value)

    def begin(self) -> None:
        """Set the energies in the scene to zero; supplied work and losses remain."""
        self.state.amounts.fill(0.0)


class NamedEnergies(dict[str, Array]):
    """Entries of a part of the ledger by name; the error of a missing entry lists all names."""

    def __init__(self, entries: dict[str, Array], known: Sequence[str]) -> None:
        super().__init__(entries)
        self._known = tuple(known)

    def __missing__(self, name: str) -> Array:
        raise KeyError(
            f"the ledger has no entry {name!r}: no object of the scene makes it. "
            f"Entries: {', '.join(map(repr, self._known)) or 'none'}"
        )


@dataclass(frozen=True, eq=False)
class Energy(Mapping[str, Array], Rich):
    """Energy ledger of a run: energy in the scene, work supplied, losses; a mapping of all entries.

    Attributes:
        state: Energy in the scene, by kind: "kinetic", "stored", "hardening", and potentials of a
            user; each (n+1,); J.
        supplied: Work since the beginning, by source: "loads", "supports", ...; each (n+1,); J.
        lost: Energy lost since the beginning, by cause: "numerical", ...; each (n+1,); J.

    Example:
        >>> ledger = solution.energy
        >>> print(sorted(ledger.state), sorted(ledger.supplied))
        ['kinetic', 'stored'] ['loads']
        >>> "stored" in ledger, [*ledger]
        (True, ['stored', 'kinetic', 'loads'])
        >>> bool(ledger.worst < 1e-9)  # largest imbalance, as a fraction of the transferred energy
        True
    """

    state: dict[str, Array]
    supplied: dict[str, Array]
    lost: dict[str, Array]

    __eq__, __hash__ = object.__eq__, object.__hash__  # arrays are not compared

    def __post_init__(self) -> None:
        names = [name for account in self._accounts for name in account]
        for kind in ("state", "supplied", "lost"):
            object.__setattr__(self, kind, NamedEnergies(getattr(self, kind), names))

    def __getitem__(self, name: str) -> Array:
        """Return the entry ``name``; (n+1,); J.  Effects that the scene lacks have no entries."""
        return next((account for account in self._accounts if name in account), self.state)[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the entries: state, supplied, lost."""
        return (name for account in self._accounts for name in account)

    def __len__(self) -> int:
        return sum(map(len, self._accounts))

    @property
    def _accounts(self) -> tuple[dict[str, Array], ...]:
        return self.state, self.supplied, self.lost

    @property
    def total(self) -> Array:
        """Energy in the scene; (n+1,); J."""
        return _sum(self.state)

    @property
    def imbalance(self) -> Array:
        """Energy that the ledger does not account for since the first state; (n+1,); J.

        The value of the first state is subtracted, because an equilibrium path begins under its
        constant loads, whose work is in the entries.
        """
        since = self.total - _sum(self.supplied) + _sum(self.lost)
        return np.asarray(since - since[0])

    @property
    def energy_transferred(self) -> float:
        """Maximum energy in the scene plus the magnitudes of all works on and by the scene; J."""
        works = sum(float(np.sum(np.abs(np.diff(work)))) for work in self.supplied.values())
        return float(np.max(self._in_scene)) + works

    @property
    def _in_scene(self) -> Array:
        """Energy in the scene, J; user potentials count by changes, as their zero is arbitrary."""
        sizes = {n: e if n in CONTRIBUTIONS else np.abs(e - e[0]) for n, e in self.state.items()}
        return _sum(sizes)

    @property
    def worst(self) -> float:
        """Largest imbalance, as a fraction of :attr:`energy_transferred`."""
        largest, transferred = float(np.max(np.abs(self.imbalance))), self.energy_transferred
        return largest / transferred if transferred > 0 else largest

    def describe_imbalance(self, tolerance: float, round_off: float) -> str:
        """Return a message about the imbalance; empty if it is as small as claimed, or round-off.

        Args:
            tolerance: Largest imbalance that the scheme claims, as a fraction of the transferred
                energy.
            round_off: Estimate of the error of the energy by round-off of the unknowns; J.
        """
        # Energies near the smallest floating-point number have too few digits.
        if not self.energy_transferred > sys.float_info.min / sys.float_info.epsilon:
            return ""
        if self.worst <= tolerance:
            return ""
        fraction = round_off / self.energy_transferred
        stored = float(np.max(self._in_scene))
        lost = sum(float(losses[-1]) for losses in self.lost.values())
        if fraction >= 1.0 and stored + lost <= ROUND_OFF_ENERGY * self.energy_transferred:
            return ""  # all works are round-off, as in rigid motion by supports
        reason = (
            ", the last digits of positions times the largest stiffness; lower the stiffness of "
            "members that hardly deform, or use fewer cells"
            if fraction >= EXPLAINED * self.worst
            else " and does not explain it; use a smaller rtol of Newton, or look for a force that "
            "the ledger does not know"
        )
        return (
            f"the energy ledger is open by {self.worst:.1e} of the transferred energy, and the "
            f"scheme claims {tolerance:.0e}: round-off is estimated at {fraction:.1e}{reason}"
        )

    def entries(self) -> list[tuple[str, str, float]]:
        """Return part ("in scene", "supplied" or "lost"), name and last value of each entry; J."""
        return [
            (kind, name, float(values[-1]))
            for kind, entries in zip(("in scene", "supplied", "lost"), self._accounts, strict=True)
            for name, values in entries.items()
        ]

    def balance(self) -> str:
        """Return a text with the largest imbalance and the transferred energy."""
        return f"imbalance at most {self.worst:.1e} of {self.energy_transferred:.6e} J transferred"

    def __str__(self) -> str:
        entries = [f"{kind:9s} {name:12s} {value: .6e} J" for kind, name, value in self.entries()]
        return "\n  ".join(["energy at the end", *entries, self.balance()])

    def __repr__(self) -> str:
        entries = "".join(f"{name} {value:.4g} J, " for _, name, value in self.entries())
        return f"<Energy at the end: {entries}imbalance {self.worst:.1e}>"


def _sum(entries: dict[str, Array]) -> Array:
    return np.asarray(sum(entries.values(), np.zeros(1)))
