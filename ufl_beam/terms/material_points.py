# SPDX-License-Identifier: MIT
"""Material points: what is known of many, what they store, dissipate and remember.

The return map has two forms, one in C (compiled_points.py) and one in NumPy (reference_points.py).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import lib
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.point_equations import PointEquations, curved, inputs, prefixed, rows
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.fibres import Layout
from ufl_beam.model.material_law import MaterialLaw
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.openings import NOTHING, RELEASED, SPENT, SearchFlags

DIGITS = 16 * float(np.finfo(float).eps)
"""Round-off of dissipated energies, as a part of elastic ones of the strains."""


def kept_inputs(law: MaterialLaw) -> tuple[str, ...]:
    """The internal variables, and what else of an accepted state the next step depends on."""
    others = ("jump", "opening", *rows(law, "before"), "traction", "flows")
    return (*prefixed("state", law.variables), *others)


def expect_entries(layout: Layout, scheme: Scheme, ledger: Ledger) -> None:
    """Make the entries of the ledger that points of a layout write, on whatever process."""
    if layout.yields:
        ledger.state["hardening"] += 0.0
        ledger.lost["plastic"] += 0.0
    if layout.softening is not None:
        ledger.lost["hinges"] += 0.0
    if scheme.alpha or releases(layout, scheme):
        ledger.lost["numerical"] += 0.0


def releases(layout: Layout, scheme: Scheme) -> bool:
    """Return whether points lose energy numerically beside what ``alpha`` of a scheme takes.

    In the middle of a step no stress is left in what has broken, but perhaps at its ends.  Where
    elasticity is not linear, the stress of a step is not the mean over it.
    """
    breaks = layout.softening is not None and scheme.theta < 1
    return breaks or (scheme.average(0.0, 1.0) != 1.0 and curved(layout.kind))


class Points(ABC):
    """Points of the same layout in many cells.

    Args:
        layout: The points of a cell.
        keys: See :meth:`Layout.numbers`.
        length: Of the cells; (cells,); m.
        scheme: The time scheme.
        storage: Zeros, for all that is known of the points; (cells, n, number of inputs).
        search: Shared by all points of a scene.

    Attributes:
        names: Names of the inputs.
        strains: Of the cells at the latest response; (cells, 3); may be written to.
        r, D: The latest response, see :meth:`respond`.
        dt: Length of the step; (1,); s.
        over: The :attr:`excess`; (1,).
        kept: By cell: (N, V, M) in the accepted state, the jump of the last point, and the energy
            dissipated by plastic strains and by discontinuities; (cells, 6); N, N m, rad or m, J.
        sums: Of all cells: dissipated in the last step by plastic strains, by discontinuities,
            lost numerically by backward Euler (θ = 1); stored elastically, and by hardening;
            lost in the last step by what :func:`releases` names; work of the mean of the
            stresses at both ends on plastic strains, less that of those at the end, of points whose
            stress relaxes; (7,); J.
    """

    def __init__(
        self,
        layout: Layout,
        keys: list[tuple[int, int]],
        length: Array,
        scheme: Scheme,
        storage: Array,
        search: SearchFlags | None = None,
    ) -> None:
        self._search = search or SearchFlags()
        self._layout, self._storage, self._alpha = layout, storage, scheme.alpha
        self._yields, self.softens = layout.yields, layout.softening is not None
        self._releases = releases(layout, scheme)
        self.names, law = inputs(layout), layout.kind.law
        self._at = {name: storage[:, :, i] for i, name in enumerate(self.names)}
        self._kept = kept_inputs(law)
        self._components = len(law.resultants or "x")
        softening = layout.softening and layout.softening.of(1.0, 1.0)
        self._equations = PointEquations(layout.kind, softening, scheme)
        stiffness = np.reshape(layout.stiffness, (len(layout.weights), -1)).T
        for name, value in zip(rows(law, "stiffness"), stiffness, strict=True):
            self._at[name][:] = value
        for name, value in layout.numbers(keys).items():
            self._at[f"number {name}"][:] = value
        for name, initial in law.variables.items():
            self._at[f"state {name}"][:] = initial
        self._at["length"][:] = length[:, None]
        self._at["theta"][:] = scheme.theta
        self.dt: Array = np.ones(1)
        self._at["dt"][:] = self.dt
        self._at["softening energy"][:] = 1.0
        self._at["traction"][:] = np.inf
        if layout.softening is not None:
            for name in ("limit", "energy"):
                value = getattr(layout.softening, name)
                self._at[f"softening {name}"][:, layout.breaking] = value
            self._resist()

        cells = len(storage)
        self.kept = np.zeros((cells, int(lib.POINT_KEPT)))
        self.sums = np.zeros(int(lib.POINT_SUMS))
        self.r, self.D = np.zeros((cells, 3)), np.zeros((cells, 9))
        self._e0, self.strains = np.zeros((cells, 3)), np.zeros((cells, 3))
        self.over = np.zeros(1)
        self._prepare(scheme, length)

    @abstractmethod
    def _prepare(self, scheme: Scheme, length: Array) -> None:
        """Prepare the return map; called once, at the end of the constructor."""

    @property
    def in_c(self) -> dict[str, Any]:
        """Data for loops in C of other terms, by name in their structs; empty without them."""
        return {}

    def __getitem__(self, name: str) -> Array:
        """Return the values of an input at the points, by its name; a view; (cells, n)."""
        return self._at[name]

    def _rows(self, name: str) -> tuple[str, ...]:
        """Names of the components of a strain or stiffness."""
        return rows(self._layout.kind.law, name)

    def _of_points(self, strains: Array) -> tuple[Array, ...]:
        """Strains of the points by component, each (cells, n), from those of the cells."""
        d = self._components
        return tuple(strains @ self._layout.strains[k::d].T for k in range(d))

    def _resist(self) -> None:
        """Resistance after the openings so far."""
        softening, breaking = self._layout.softening, self._layout.breaking
        if softening is not None:
            self["traction"][:, breaking] = softening.traction(self["opening"][:, breaking])

    # -- the step ------------------------------------------------------------------------------

    def start(self, strains: Array) -> None:
        """Begin at these strains of the cells and not at those accepted; (cells, 3); 1, 1, 1/m."""
        self._e0[:] = strains
        for name, values in zip(self._rows("before"), self._of_points(strains), strict=True):
            self[name][:] = values
        self._resist()

    def begin(self, dt: float) -> None:
        """Begin a step of this length; s."""
        if dt != self.dt[0]:
            self["dt"][:] = self.dt[0] = dt

    @abstractmethod
    def respond(self, strains: Array) -> tuple[Array, Array]:
        """(N, V, M) that act in a step to these strains, and derivatives; (cells, 3), (cells, 9).

        They are not a number where an opening was not found.  The arrays are reused.
        """

    @property
    def excess(self) -> float:
        """Largest ``|stress| / limit - 1`` of a point that was held closed, or zero."""
        return float(self.over[0])

    @abstractmethod
    def release(self, least: float) -> None:
        """Let held points open from now on whose excess was so large in the latest response."""

    def tangent(self) -> tuple[Array, Array]:
        """Strains of the accepted state, and derivatives of a response to them; nothing changes.

        Shapes (cells, 3) and (cells, 9).
        """
        arrays = self._storage, self.strains, self.r, self.D, self._search.flags
        before = [array.copy() for array in arrays]
        try:
            return self._e0.copy(), self.respond(self._e0)[1].copy()
        finally:
            for array, values in zip(arrays, before, strict=True):
                array[:] = values

    def hold(self) -> None:
        """Close again the points that :meth:`release` opened."""
        flows = self["flows"]
        flows[flows == RELEASED] = 0.0

    def remaining(self, change: Array) -> Array:
        """Part of the elastic stiffness that is left for small changes of the strains; (cells,)."""
        layout, theta = self._layout, self["theta"][0, 0]
        elastic = theta * change**2 @ layout.rest
        for name, by_point in zip(self._rows("stiffness"), self._of_points(change), strict=True):
            elastic += (theta * self[name] * by_point**2) @ layout.weights
        now = np.einsum("ci,cij,cj->c", change, self.D.reshape(-1, 3, 3), change)
        return np.asarray(np.divide(now, elastic, out=np.ones(len(now)), where=elastic > 0))

    @abstractmethod
    def gives_energy(self) -> int:
        """Number of the point that gives most energy in the latest response, or -1.

        That is a law whose dissipation is negative: its equations have several solutions, and one
        was found that no material comes to.  Points of all cells are counted through.
        """

    def require_dissipation(self, describe: Callable[[int], str]) -> None:
        """Raise :class:`StepFailed` if a point gives energy; ``describe`` names its cell."""
        if (worst := self.gives_energy()) >= 0:
            law = type(self._layout.kind.law).__name__
            raise StepFailed(
                f"{law} of {describe(worst // self._storage.shape[1])} has a negative dissipation "
                "in the step: its equations have several solutions, or it stores energy that it "
                "does not state. A law that is to give energy has active = True, see "
                "docs/extending_laws.md"
            )

    @abstractmethod
    def accept(self) -> None:
        """Take the strains of the latest response as the new state."""

    def change(self) -> float:
        """Energy that :meth:`accept` would add to what is stored and dissipated; J.

        Where viscous stresses relax it is as the trapezoidal rule counts it: backward Euler's
        dissipation is that of the stress at the end, and the difference is no energy.
        """
        changes = self._sums_to_come() - [0, 0, 0, *self.sums[3:5], 0, 0]
        return float(np.sum(changes[[0, 1, 3, 4, 5, 6]]))

    def dissipation(self) -> float:
        """Energy that :meth:`accept` would add to what is dissipated; J.

        It is zero up to the round-off of the energies by whose difference laws may find it.
        """
        plastic, broken = map(float, self._sums_to_come()[:2])
        size, volume = 0.0, self._layout.weights * self["length"]
        for C, *ends in zip(*map(self._rows, ("stiffness", "strain", "before")), strict=True):
            size += sum(float(np.sum(volume * self[C] * self[e] ** 2)) for e in ends)
        return broken + (plastic if abs(plastic) > DIGITS * size else 0.0)

    @abstractmethod
    def _sums_to_come(self) -> Array:
        """Return :attr:`sums` as :meth:`accept` would leave them."""

    def freeze(self) -> None:
        """Keep everything elastic from now on; hinges that bear no moment any more are free.

        So points answer a vibration, however small, of what has yielded: elastic unloading.
        """
        breaking, softening = self._layout.breaking, self._layout.softening
        if softening is not None:
            borne, limit = (self[name][:, breaking] for name in ("traction", "softening limit"))
            spent = np.isfinite(limit) & (borne <= SPENT * limit)
            self["stiffness"][:, breaking] *= np.where(spent, NOTHING, 1.0)
        self["traction"][:] = np.inf
        self._let_stay()

    @abstractmethod
    def _let_stay(self) -> None:
        """Let the variables of the bulk stay as they are from now on."""

    # -- the ledger ----------------------------------------------------------------------------

    def enter_losses(self, ledger: Ledger) -> None:
        """Enter what the last step dissipated."""
        plastic, broken, lost, _, _, released, _ = self.sums.tolist()
        if self._yields:
            ledger.lost["plastic"] += plastic
        if self.softens:
            ledger.lost["hinges"] += broken
        if self._alpha:
            ledger.lost["numerical"] += 2 * self._alpha * lost
        if self._releases:
            ledger.lost["numerical"] += released

    def enter_stored(self, ledger: Ledger) -> None:
        """Enter what the accepted state stores."""
        _, _, _, elastic, hardening, *_ = self.sums.tolist()
        ledger.state["stored"] += elastic
        if self._yields:
            ledger.state["hardening"] += hardening

    def in_steps(self, ledger: Ledger) -> dict[str, Any]:
        """Fields of ``inelastic_term`` of loops.h, with the entries of both methods above."""
        state, lost = ledger.state, ledger.lost
        kinds = {
            "stored": (True, state, "stored"), "hardening": (self._yields, state, "hardening"),
            "plastic": (self._yields, lost, "plastic"), "hinges": (self.softens, lost, "hinges"),
            "numerical": (bool(self._alpha), lost, "numerical"),
            "released": (self._releases, lost, "numerical"),
        }  # fmt: skip
        entries = {k: part.pointer(name) for k, (has, part, name) in kinds.items() if has}
        return {"dt": self.dt, "alpha": self._alpha, **entries}

    # -- the state -----------------------------------------------------------------------------

    def state(self) -> Array:
        """Return the internal variables of the accepted state; (cells, k); a copy."""
        stored = np.zeros((len(self.kept), 2))
        stored[:1] = self.sums[3:5]  # of all cells together; to whom it belongs does not matter
        return np.hstack([*(self[name] for name in self._kept), self.kept, self._e0, stored])

    def restore(self, cells: Index, rows: Array) -> None:
        """Take over :meth:`state` in some of the cells.

        Call :meth:`start` and :meth:`refresh` where strains or laws are not those it is of.
        """
        ends = np.arange(1, len(self._kept) + 1) * self._storage.shape[1]
        *variables, kept, e0, stored = np.split(rows, [*ends, ends[-1] + 6, ends[-1] + 9], axis=1)
        for name, values in zip(self._kept, variables, strict=True):
            self[name][cells] = values
        self.kept[cells], self._e0[cells] = kept, e0
        self.sums[3:5] = stored.sum(axis=0)

    def refresh(self, strains: Array) -> None:
        """Make forces and stored energies those of a state that no step has led to."""
        layout, length, law = self._layout, self["length"][:, :1], self._equations.law(self._at)
        state, volume = self._equations.state(self._at), layout.weights * length
        relieved = self["jump"] / self["length"]
        e = law.as_argument(tuple(x - relieved for x in self._of_points(strains)))
        self.kept[:, :3] = layout.rest * strains
        for k, stress in enumerate(law.as_tuple(law.stress(e, state))):
            of_points = (layout.weights * stress) @ layout.strains[k :: self._components]
            self.kept[:, :3] += of_points
        of_rest = strains**2 @ layout.rest / 2 * length[:, 0]
        self.sums[3] = np.sum(volume * law.elastic_energy(e, state)) + np.sum(of_rest)
        self.sums[4] = np.sum(volume * law.hardening_energy(state))
