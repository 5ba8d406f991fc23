# SPDX-License-Identifier: MIT
"""Table of the hinges of a run: first yielding, rotations, ductility, acceptance limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.display import Parameter, Tabular
from ufl_beam.errors import ArgumentError, require_all, require_kind, shorten
from ufl_beam.model.bodies import Member, Place
from ufl_beam.model.connectors import Connector
from ufl_beam.output.hinge_histories import hinge_histories, require_limits
from ufl_beam.simulation.solution import Solution


class HingeState(NamedTuple):
    """Largest rotations and dissipated energy of a hinge in a run.

    Attributes:
        where: Place of a hinge, middle of a cell with an open hinge, or rotational connector.  For
            a beam with yielding or cracking cells, the middle of the cell that dissipates most.
        n: Index of the first state after the first yielding; -1 if the hinge did not yield.
        time: Time or load factor of this state; NaN if the hinge did not yield.
        rotation: Rotation of largest magnitude; rad.
        plastic: Plastic rotation of largest magnitude; rad.
        ductility: Magnitude of ``rotation`` divided by the yield rotation, if there is one.
        dissipated: Dissipated energy at the last state, of runs before ``start=``, too; J.
        state: Name of the acceptance limit that the hinge satisfies, "elastic", or "beyond ...".
    """

    where: Place | Connector
    n: int
    time: float
    rotation: float
    plastic: float
    ductility: float
    dissipated: float
    state: str


@dataclass(frozen=True, eq=False)
class HingeTable(Tabular):
    """Table of hinges in the order of first yielding; :func:`hinge_table` returns it.

    Attributes:
        rows: A :class:`HingeState` for each hinge.
        parameter: Labels of the times.

    Example:
        >>> table = st.hinge_table(broken, {"IO": 0.005, "LS": 0.015, "CP": 0.03})  # rad
        >>> print(table)
        hinge              yields at t [s]  rotation [rad]  plastic [rad]  ...  state
        ...
    """

    rows: tuple[HingeState, ...]
    parameter: Parameter

    def columns(self) -> dict[str, list[Any]]:
        """Return the columns of the table by name and unit."""
        where, _, times, *others = zip(*self.rows, strict=True) if self.rows else ((),) * 8
        names = "rotation [rad]", "plastic [rad]", "ductility", "dissipated [J]", "state"
        columns = {"hinge": map(str, where), f"yields at {self.parameter.column}": times}
        columns |= dict(zip(names, others, strict=True))
        return {name: [*values] for name, values in columns.items()}

    def __repr__(self) -> str:
        return f"<HingeTable: {len(self.rows)}, {sum(x.n >= 0 for x in self.rows)} yielded>"


def hinge_table(
    solution: Solution,
    limits: Mapping[str, float] = MappingProxyType({}),
    *,
    n: int = -1,
    only: Sequence[Member | Connector] | None = None,
) -> HingeTable:
    """Return rotations, ductility and dissipated energy of all hinges of a run, as a table.

    The rows are in the order of first yielding.  They are all hinges of zero length, open hinges of
    cells, connectors whose rotation may yield or soften, and beams with yielding or cracking cells,
    of which only the energy is known.  See docs/results.md.

    Args:
        solution: Run, or path.
        limits: Acceptance limits of the plastic rotation by name, in increasing order, as in
            ``{"IO": 0.01, "LS": 0.025, "CP": 0.04}``; rad.
        n: Index of the last state that counts, negative from the end, such as ``target.n`` of a
            pushover.
        only: Beams and connectors whose hinges are listed; all by default.

    Raises:
        ArgumentError: A limit is not positive or not above the limit before it, or a beam or
            connector is not in the scene.

    Example:
        >>> (row,) = st.hinge_table(broken, {"IO": 0.01, "LS": 0.1}).rows
        >>> print(row.where, row.state)
        beam.start (0, 0) LS
    """
    require_kind(solution, Solution, "hinge_table: solution")
    require_limits(limits, "hinge_table: limits")
    require_kind(n, (int, np.integer), "hinge_table: n")
    known = {*solution.scene.beams, *solution.scene.connectors}
    owners = known if only is None else require_all(only, "hinge_table: only", (Member, Connector))
    for i, owner in enumerate(owners):
        if owner not in known:
            raise ArgumentError(f"hinge_table: only[{i}] = {shorten(owner)} is not in the scene")
    rows, times = list[HingeState](), solution.times
    for hinge in hinge_histories(solution.subset(0, solution.index(n) + 1), owners):
        first, rotation, at_yield = hinge.first_yield, hinge.largest_rotation, hinge.yield_rotation
        rows.append(HingeState(
            hinge.where, first, float(times[first]) if first >= 0 else math.nan, rotation,
            hinge.largest_plastic, abs(rotation) / at_yield if at_yield else math.nan,
            float(hinge.dissipated[-1]), hinge.state(limits),
        ))  # fmt: skip
    return HingeTable(tuple(rows), solution.parameter)
