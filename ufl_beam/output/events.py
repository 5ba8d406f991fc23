# SPDX-License-Identifier: MIT
"""Events of a run: yielding, opening, breaking, touching, sliding, and their times."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import State
from ufl_beam.display import TIME, Parameter, bracketed
from ufl_beam.errors import require_function
from ufl_beam.model.bodies import Place
from ufl_beam.model.connector_laws import Coulomb, Stop
from ufl_beam.model.connectors import Connector
from ufl_beam.model.plastic_hinges import law_of
from ufl_beam.output.recorders import Recorder
from ufl_beam.output.state_rows import DISSIPATED, FORCE, HINGE, PLASTIC
from ufl_beam.output.state_view import StateView
from ufl_beam.parallel import on_first

Flags = npt.NDArray[np.bool_]

IN_CELLS = ("yields", "opens", "is free")  # once in a cell; hinges and cracks open and end
OF_CONNECTORS = {Stop: ("touches", "lets go"), Coulomb: ("slides", "sticks")}  # with their ends
KINDS = (*IN_CELLS, *(kind for pair in OF_CONNECTORS.values() for kind in pair))  # all events
Row = tuple[float, int, str]  # time, number of the cell or connector, what
BROKEN_PART = 0.999  # part of the energy of a hinge after which it is called a joint


class Event(NamedTuple):
    """Event of a step: yielding, opening of a hinge, contact, sliding.

    Attributes:
        time: End of the step; s; on a path its load factor.
        where: A place in the middle of a cell, that of a plastic hinge, or a connector.
        what: "yields", "opens", "is free" in a cell; "touches", "lets go", "slides", "sticks".
        parameter: Words for the time.

    Example:
        >>> events = ub.Events()
        >>> run = ub.simulate(hinged, ub.Static(), t=(0, 1), dt=0.02, record=events)
        >>> opening = events.found[0]
        >>> print(f"{opening.time:.2f} s: {opening.where} {opening.what}")
        0.10 s: beam.start (0, 0) opens
    """

    time: float
    where: Place | Connector
    what: str
    parameter: Parameter = TIME

    def __repr__(self) -> str:
        return bracketed(self)

    def __str__(self) -> str:
        return f"{self.parameter.at(self.time, '.9g')}: {self.where} {self.what}"


class Events(Recorder):
    """Recorder of events, for scenes with hinges, inelastic material, stops or friction.

    A hinge "is free" when it has dissipated 99.9 % of its energy; a hinge that hardens "yields".
    Contact and sliding may begin and end repeatedly; all other events occur once in a cell or
    hinge.

    Args:
        tell: Called on the first process with each event as it happens, such as ``print``.

    Attributes:
        found: The events in their order, the same on all processes.

    Example:
        >>> events = ub.Events(tell=print)
        >>> run = ub.simulate(hinged, ub.Static(), t=(0, 0.5), dt=0.02, record=events)
        t = 0.1 s: beam.start (0, 0) opens
    """

    def __init__(self, tell: Callable[[Event], object] | None = None) -> None:
        if tell is not None:
            require_function(tell, "Events: tell", "an Event")
        self._tell = tell or (lambda event: None)
        self.found: list[Event] = []
        self._rows: list[Row] = []

    def __repr__(self) -> str:
        return f"<Events: {len(self.found)}>"

    def open(self, simulation: StateView) -> None:
        """Take note of the initial state."""
        self.found, self._rows = [], []
        self._watch(simulation)

    def _watch(self, simulation: StateView) -> None:
        """Find the events that a scene may have, and those before the run."""
        grid = simulation.grid
        in_cells = [law for beam in simulation.scene.beams for law in grid.hinges(beam)]
        laws = [*in_cells, *(law_of(hinge) for hinge in simulation.scene.hinges)]
        breaking = [law is not None and law.limit > 0 for law in laws]
        energies = np.array([law.energy if law is not None else np.inf for law in laws])
        self._enough = np.where(breaking, BROKEN_PART * energies, np.inf)
        self._breaks = np.isfinite(energies)
        links = simulation.scene.links
        self._links = [i for i, link in enumerate(links) if type(link.law) in OF_CONNECTORS]
        self._in_cells, self._on = self._look(simulation)

    def _look(self, simulation: StateView) -> tuple[Flags, Flags]:
        """Return the events of each cell and hinge, (n, 3), and which connectors touch or slide."""
        in_cells = np.zeros((len(self._enough), len(IN_CELLS)), dtype=bool)
        num_cells, hinges = len(simulation.grid.cells), simulation.scene.hinges
        plastic, broken = simulation.now.cells_of(0)[:, [PLASTIC, HINGE]].T
        happened = (plastic > 0, broken > 0, broken >= self._enough[:num_cells])
        in_cells[:num_cells] = np.column_stack(happened)
        if hinges:
            lost = simulation.connections()[-len(hinges) :, DISSIPATED]
            breaks, enough = self._breaks[num_cells:], self._enough[num_cells:]
            happened = ((lost > 0) & ~breaks, (lost > 0) & breaks, lost >= enough)
            in_cells[num_cells:] = np.column_stack(happened)
        if not self._links:
            return in_cells, np.zeros(0, dtype=bool)
        forces = np.abs(simulation.connections()[self._links, FORCE])
        # Forces above which they touch, or slide; the limit of friction is known to some digits
        links = (simulation.scene.links[link] for link in self._links)
        limits = [(1 - 1e-9) * simulation.asked.get(link, 0.0) for link in links]
        return in_cells, np.asarray(forces > limits)

    def write(self, simulation: StateView) -> None:
        """Note the changes of a step."""
        (in_cells, on), t = self._look(simulation), simulation.t
        changes = np.argwhere(in_cells & ~self._in_cells)
        new = [(t, int(cell), IN_CELLS[n]) for cell, n in changes]
        for k in np.flatnonzero(on != self._on):
            begins, ends = OF_CONNECTORS[type(simulation.scene.links[self._links[k]].law)]
            new.append((t, self._links[k], begins if on[k] else ends))
        self._in_cells, self._on = in_cells, on
        events = self._add(simulation, new)
        if events:
            on_first(simulation.comm, lambda: [self._tell(event) for event in events])

    def _add(self, simulation: StateView, rows: list[Row]) -> list[Event]:
        links, grid = simulation.scene.links, simulation.grid
        named = simulation.parameter
        events = [
            Event(t, grid.place_of(number) if what in IN_CELLS else links[number], what, named)
            for t, number, what in rows
        ]
        self._rows += rows
        self.found += events
        return events

    def state(self) -> State:
        """Return the events so far: time, number of the cell or connector, and kind."""
        return {"events": np.array([(t, n, KINDS.index(what)) for t, n, what in self._rows])}

    def resume(self, simulation: StateView, state: State) -> None:
        """Go on after the events of a :meth:`state`."""
        self.found, self._rows = [], []
        self._add(simulation, [(float(t), int(n), KINDS[int(k)]) for t, n, k in state["events"]])
        self._watch(simulation)
