# SPDX-License-Identifier: MIT
"""Cells whose embedded hinge or cracks opened in a run, and what depends on the mesh there.

An embedded hinge is in the middle of its cell and feels the mean moment of the cell.  At the ends
of the cell the moment differs by |V| h/2, so a hinge that belongs there opens at another load.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import warn
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.bodies import Member, Place
from ufl_beam.model.fibres import Layout
from ufl_beam.output.state_rows import HINGE
from ufl_beam.output.states import States

LARGE = 0.05
"""Shift of a limit by the place of its hinge from which a run warns, as a part of the limit."""

TINY = 1e-6
"""Opening, as a part of energy / limit, over which the first slope of a resistance is taken."""


class OpenedHinges(NamedTuple):
    """Embedded hinges of a beam that opened in a run.

    The error is the largest |V| h / (2 limit): the difference between the moments in the middle and
    at the ends of such a cell, as a part of the limit.
    """

    beam: Member
    number: int  # of cells
    error: float
    place: Place  # middle of the cell with the largest error


class Opened:
    """Cells that opened in a run.

    Attributes:
        first: Number of the first kept time after the opening; 0 of cells that were open at the
            beginning, -1 of those that stayed closed; (num_cells,).
        shear: |V| at the kept time before that one, or at that one where the run began in between;
            (num_cells,); N.
        dissipated: By hinges and cracks at the end; (num_cells,); J.
    """

    def __init__(self, states: States) -> None:
        self._grid = grid = states.grid
        self.first, self.shear = np.full(len(grid.cells), -1), np.zeros(len(grid.cells))
        self.dissipated = np.zeros(len(grid.cells))
        if len(states):
            self.dissipated[:] = states.cells_of(-1)[:, HINGE]
        cells = np.flatnonzero(self.dissipated > 0)
        if not len(cells):
            return
        rows = np.searchsorted(states.cells.inelastic, cells)
        dissipated, V = (states.column("material")[:, rows, k] for k in (HINGE, 1))
        self.first[cells] = first = (dissipated > 0).argmax(axis=0)
        # After an opening in a jump V is that of vibrations.
        n = np.where(first > 1, first - 1, first)
        self.shear[cells] = np.abs(V[n, np.arange(len(cells))])

    def hinges(self) -> list[OpenedHinges]:
        """Embedded hinges, laws of sections, that opened in the run; beam by beam."""
        grid = self._grid
        found = []
        for beam in grid.scene.beams:
            law = beam.section.hinge
            cells, laws = grid.cells_of(beam), grid.hinges(beam)
            cells = cells[[one is law for one in laws] & (self.first[cells] > 0)]
            if law is None or not len(cells) or law.limit == 0:
                continue
            errors = self.shear[cells] * grid.lengths(cells) / (2 * law.limit)
            worst = int(np.argmax(errors))
            place = grid.middle(int(cells[worst]))
            found.append(OpenedHinges(beam, len(cells), float(errors[worst]), place))
        return found

    def __repr__(self) -> str:
        number = np.count_nonzero(self.first >= 0)
        return f"<Opened: hinges or cracks in {number} of {len(self.first)} cells>"

    def summary(self) -> list[str]:
        """A line about embedded hinges that opened, if there are any."""
        hinges = self.hinges()
        if not hinges:
            return []
        number, worst = sum(one.number for one in hinges), max(hinges, key=lambda one: one.error)
        return [
            f"embedded hinges opened in {_cells_in_words(number)}; their place within the cell "
            f"shifts the limit by at most {_percent(worst.error)} ({worst.beam.name}, cell at "
            f"s = {worst.place.s:.3g})"
        ]

    def warn(self, scheme: Scheme, times: Array) -> None:
        """Issue a :class:`ModelWarning` for each beam where much depends on the mesh."""
        self._warn_of_jumps(scheme, times)
        for beam, number, error, place in self.hinges():
            if error > LARGE:
                warn(
                    f"{beam.name}: the hinge of the section opened in {_cells_in_words(number)}, "
                    "in the middle of a cell. At the ends of the cell at "
                    f"s = {place.s:.3g} the moment differs from that in its middle by "
                    f"{_percent(error)} of the limit, so the load at which the hinge opens is "
                    "uncertain by as much. Put a hinge exactly where it belongs, "
                    "Beam(hinges={s: law}), or use shorter cells"
                )

    def _warn_of_jumps(self, scheme: Scheme, times: Array) -> None:
        """Warn of resistances that fall faster with the opening than the stress of the cell.

        The stiffness of a cell against an opening is θ EI/h, or θ E/h of a fibre.
        """
        grid = self._grid
        for beam in grid.scene.beams:
            cells, laws = grid.cells_of(beam), grid.hinges(beam)
            fall = {law: _fall(beam.section.layout(law), scheme) for law in set(laws)}
            falls, energies = np.array([fall[law] for law in laws]).T
            opened = (self.first[cells] > 0) & (self.dissipated[cells] >= energies)
            lengths = grid.lengths(cells)
            ratios = np.where(opened, lengths, 0.0) * falls
            worst = int(np.argmax(ratios))
            ratio, length, t = ratios[worst], lengths[worst], times[self.first[cells[worst]]]
            if ratio > 1:
                warn(
                    f"{beam.name}: what opened in the cell at "
                    f"s = {grid.middle(int(cells[worst])).s:.3g} by t = {t:.6g} s did so in a "
                    f"jump: its resistance falls {ratio:.3g} times as fast as its cell of "
                    f"{length:.3g} m can follow. Energy that the cell released and the opening did "
                    "not dissipate went to the rest of the scene. Use cells shorter than "
                    f"{length / ratio:.3g} m, or an energy {ratio:.3g} times as large"
                )


def _cells_in_words(number: int) -> str:
    """A number of cells in words: "1 cell", "2 cells"."""
    return f"{number} cell{'s'[: number != 1]}"


def _percent(part: float) -> str:
    """A part in words: "12 %", or "more than 100 %" where the limit is next to nothing."""
    return f"{100 * part:.2g} %" if part <= 1 else "more than 100 %"


def _fall(layout: Layout | None, scheme: Scheme) -> tuple[float, float]:
    """Fall of the resistance per opening, over θ times the stiffness of the points; 1/m.

    It is that at the opening where the traction falls most; with the least energy that a cell
    dissipates before; J.
    """
    law = None if layout is None else layout.softening
    if layout is None or law is None or law.limit == 0:
        return 0.0, 0.0
    growth, begins = TINY * law.energy / law.limit, np.array([law.steepest[1]])
    after = scheme.resistance(law, begins, np.array([growth]))
    (fall,) = (law.traction(begins) - after) / growth
    before = law.mean_traction(0 * begins, begins) * begins * layout.weights[layout.breaking].min()
    return float(fall / (scheme.theta * layout.stiffness[layout.breaking].min())), float(before[0])
