# SPDX-License-Identifier: MIT
"""History of a run: a CSV file of motions, connectors and the energy ledger, and events."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, State
from ufl_beam.display import TIME, Parameter, bracketed
from ufl_beam.errors import (
    ArgumentError,
    require_all,
    require_count,
    require_function,
    require_sequence,
)
from ufl_beam.mechanics.time_scheme import has_inertia
from ufl_beam.model.bodies import AttachmentPoint, Place, require_place
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import Coulomb, HingeLaw, RigidPlastic, Spring, Stop
from ufl_beam.model.connectors import Connector, can_yield
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.output.output_files import OutputFile, beside, require_arrays
from ufl_beam.output.recorder import FileRecorder, Restartable, StateView
from ufl_beam.output.state_rows import (
    DISSIPATED,
    FORCE,
    HINGE,
    OWN_LAW_YIELDS,
    PLASTIC,
    WORK,
    connector_indices,
)
from ufl_beam.parallel import on_first

# -- table -----------------------------------------------------------------------------------------

MOTION = {2: ("u", "v", "psi"), 3: ("u", "v", "w", "rx", "ry", "rz")}
"""Columns of a place: displacements and rotations, by the number of displacements."""

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of formulas in spreadsheets
COMPONENTS = ("along", "across", "turn")  # motions of a bushing
CONNECTOR = ("motion", "force", "work")  # columns of a connector


class History(FileRecorder):
    """Recorder of motions, connectors and energies in a CSV file that is valid after a crash.

    The columns are the time or load factor; u, v, psi of each place, in space u, v, w and the
    rotation vector rx, ry, rz; accelerations; motion, force, work of each connector; and the
    entries of the energy ledger.  The names of the columns end in their units.  Accelerations are
    means since the previous row, as in :meth:`Solution.acceleration`; in the first row they are
    NaN.  They are not changed if ``max_rows`` deletes that row.

    Args:
        path: File, ending in ``.csv``.
        places: Places to follow, on beams and bodies.
        connectors: Connectors to follow, see
            :class:`~ufl_beam.output.state_rows.Connection`; a joint may have several.
        accelerations: Places whose accelerations are recorded, in dynamics.
        every: Number of steps between rows.
        max_rows: Largest number of rows after the initial row.  If it would be exceeded, every
            other row is deleted and ``every`` is doubled.

    Raises:
        ArgumentError: An argument has a wrong type, or ``every`` or ``max_rows`` is not positive.
            A run raises it if it is static and has places in ``accelerations``.

    Example:
        >>> table = ub.History("tip.csv", [beam.end])
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=table)
        >>> np.loadtxt("tip.csv", delimiter=",", skiprows=1).shape[0]
        21
    """

    def __init__(
        self,
        path: str | Path,
        places: Sequence[AttachmentPoint] = (),
        connectors: Sequence[Connector | Joint] = (),
        *,
        accelerations: Sequence[AttachmentPoint] = (),
        every: int = 1,
        max_rows: int = sys.maxsize,
    ) -> None:
        super().__init__(path, every)
        require_count(max_rows, f"History {path}: max_rows")
        self._first_every, self._max_rows = every, max_rows
        self._temporary = beside(self._path)  # replaces the file when rows are deleted
        self.files = (self._path, self._temporary) if self._thins else (self._path,)
        self._places = require_sequence(places, f"History {path}: places")
        self._accelerated = require_sequence(accelerations, f"History {path}: accelerations")
        for what, some in (("places", self._places), ("accelerations", self._accelerated)):
            for i, place in enumerate(some):
                require_place(place, f"History {path}: {what}[{i}]")
        self._before: Array = np.zeros((0, 4))  # time and velocity of each in the previous row
        what = f"History {path}: connectors"
        self._connectors = require_all(connectors, what, (Connector, Joint))

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Write header and initial row, or cut off the rows that follow a :meth:`state`."""
        self._followed = {
            connector: name
            for followed in self._connectors
            for connector, name in _named_components(simulation.scene, followed)
        }
        d = simulation.numbering.displacements
        motion = [*zip(MOTION[d], ["m"] * d + ["rad"] * (2 * d - 3), strict=True)]
        names = [f"{c} {place} [{unit}]" for place in self._places for c, unit in motion]
        names += [f"d2{c}/dt2 {x} [{unit}/s2]" for x in self._accelerated for c, unit in motion]
        if self._accelerated and not has_inertia(simulation.scheme):
            raise ArgumentError(
                f"History {self._path}: accelerations: the run is static; there are none"
            )
        for connector, name in self._followed.items():
            is_rotation = simulation.scene.all_connectors[connector].is_rotation
            units = ("rad", "N m", "J") if is_rotation else ("m", "N", "J")
            names += [f"{c} {name} [{unit}]" for c, unit in zip(CONNECTOR, units, strict=True)]
        energies = [f"{name} [J]" for group in simulation.entries() for name in group]
        for twice in {*names} & {*energies}:
            raise ArgumentError(
                f"History {self._path}: {twice!r} would be a column of a connector and of the "
                "energy ledger; give the VirtualWork or Potential another name"
            )
        columns = [simulation.parameter.column, *names, *energies]
        # Spreadsheets read such names as formulas, which may run programs
        self._header = _line([f"'{c}" if c.startswith(FORMULA) else c for c in columns])
        self._before = np.full((len(self._accelerated), 1 + len(motion)), np.nan)
        self._every = self._first_every
        super().begin(simulation, state)
        if state is not None:
            self._every = int(state["sizes"][2])
            if self._accelerated:
                require_arrays(state, {"before": self._before.shape})
                self._before = state["before"].copy()

    def _start(self, row: bytes, digest: bytes | None) -> OutputFile:
        header, new = self._header, digest is None
        self.complete = self.complete or (len(header), self._every)  # bytes, steps between rows
        if digest is not None and self._thins:
            self._path.write_bytes(digest)
        file = self._open(self._path, new=new)
        if new:
            file.put(0, header)
        elif file.read(0, len(header)) != header:
            raise ValueError("the file has other columns")
        return file

    def _append(self, row: bytes) -> None:
        """Write after the last complete line; an interrupted line is overwritten."""
        length, every = self.complete
        self._file.put(length, row)
        self.complete = length + len(row), every

    def write(self, simulation: StateView) -> None:
        """Write a row after every ``every`` steps."""
        if self._count + 1 == (self._max_rows + 1) * self._every:
            self._every *= 2
            on_first(simulation.comm, self._drop_rows)
        super().write(simulation)

    def _drop_rows(self) -> None:
        """Delete every other row; a complete file exists at any time."""
        rows = self._file.read(len(self._header), self.complete[0]).splitlines(keepends=True)
        self.close()
        self._file, self.complete = self._open(self._temporary), (0, self._every)
        self._closing.callback(self._cut)
        self._append(self._header + b"".join(rows[::2]))
        self._file.rename(self._path)

    def _row(self, simulation: StateView) -> bytes:
        motion = [simulation.displacement(place) for place in self._places]
        for i, place in enumerate(self._accelerated):
            now = np.append(simulation.t, simulation.velocity(place))
            change = now - self._before[i]
            motion.append(change[1:] / change[0])
            self._before[i] = now
        connectors = list(self._followed)
        connections = simulation.connections()[connectors, :3] if connectors else ()
        energies = [energy for group in simulation.entries() for energy in group.values()]
        line = (simulation.t, *np.ravel(motion), *np.ravel(connections), *energies)
        return _line([repr(float(x)) for x in line])

    @property
    def _thins(self) -> bool:
        """True if rows may be deleted after a checkpoint, which then has a copy of the file."""
        return self._max_rows < sys.maxsize

    def state(self) -> State:
        """Return sizes, and the checksum of the file, or its content if rows may be deleted."""
        return super().state() | ({"before": self._before.copy()} if self._accelerated else {})

    def _sync(self) -> bytes:
        length = self.complete[0]
        self._file.sync()
        return self._file.read(0, length) if self._thins else self._file.digest(length)

    def _cut(self) -> None:
        self._file.cut(self.complete[0])


def _line(cells: Sequence[str]) -> bytes:
    """Return a line of a CSV file."""
    text = io.StringIO(newline="")
    csv.writer(text).writerow(cells)
    return text.getvalue().encode()


def _named_components(scene: Scene, followed: Connector | Joint) -> list[tuple[int, str]]:
    """Return index and name of each component; components have different names."""
    connectors = connector_indices(scene, followed)
    if isinstance(followed, Connector):
        names = COMPONENTS if followed.components else (type(followed.law).__name__,)
        return [(n, f"{followed}, {name}") for n, name in zip(connectors, names, strict=False)]
    holders = [scene.all_connectors[connector] for connector in connectors]
    axes = [*map(_axis_name, holders)]
    if len({*axes}) < len(axes):  # of oblique axes
        axes = [str(k + 1) for k in range(len(axes))]
    return [
        (connector, f"{holder}, {axis}" if len(connectors) > 1 else str(holder))
        for connector, holder, axis in zip(connectors, holders, axes, strict=True)
    ]


def _axis_name(holder: Connector) -> str:
    """Return "x", "y", "z", "psi", "rx", "ry" or "rz" for a motion that a joint holds."""
    if holder.is_rotation and len(holder.axis) == 2:
        return "psi"
    axis = np.cross(holder.other, holder.axis) if holder.is_rotation else holder.axis
    return "r" * holder.is_rotation + "xyz"[int(np.argmax(np.abs(axis)))]


# -- events ----------------------------------------------------------------------------------------

Flags = npt.NDArray[np.bool_]

IN_CELLS = ("yields", "opens", "is free")  # each at most once in a cell or hinge
CONNECTOR_EVENTS = {Stop: ("touches", "lets go"), Coulomb: ("slides", "sticks")}  # begin, end
KINDS = (*IN_CELLS, *(kind for pair in CONNECTOR_EVENTS.values() for kind in pair))  # all events
Row = tuple[float, int, str]  # time, number of the cell or connector, kind of event
BROKEN_FRACTION = 0.999  # dissipated fraction of the fracture energy of a hinge that "is free"


def breaking_law(law: object) -> HingeLaw | None:
    """Return the law of a hinge, or the softening of a spring that only breaks, or None."""
    if isinstance(law, RigidPlastic):
        return law.law
    return law.softening if isinstance(law, Spring) and law.law is None else None


class Event(NamedTuple):
    """Event in a step: yielding, opening of a hinge, contact or sliding.

    Attributes:
        time: End of the step, s; in path following, its load factor.
        where: Middle of a cell, place of a plastic hinge, or connector.
        what: "yields", "opens", "is free" in a cell, a hinge or a rotational connector;
            "touches", "lets go", "slides", "sticks".
        parameter: Name and text formats of ``time``.

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


class Events(Restartable):
    """Recorder of events, for scenes with hinges, inelastic material, stops or friction.

    A hinge "is free" when it has dissipated 99.9 % of its fracture energy; a hardening hinge
    "yields".  So do connectors of rotations, alone or in a :class:`Bushing`, with a law of yielding
    or softening.  A cell "yields" when it first dissipates: under the first load if its law has no
    elastic range, as ``st.KentPark``.  Contact and sliding may begin and end
    repeatedly; all other events occur once in a cell or hinge.

    Args:
        tell: Function, such as ``print``, that the first process calls with each event when the
            event is recorded.

    Attributes:
        found: Events in chronological order, the same on all processes.

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

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Begin with the initial state, or continue from the events of a :meth:`state`."""
        self.found, self._rows = [], []
        numbering = simulation.numbering
        in_cells = [numbering.scene.beams[i].section.hinge for i in numbering.beam_of_cell]
        connectors, hinges = simulation.scene.all_connectors, len(simulation.scene.hinges)
        first = len(connectors) - hinges
        # Hinges, which are the last connectors, and connectors that yield or break
        self._hinges = [*range(first, len(connectors))]
        self._hinges += [i for i, c in enumerate(connectors[:first]) if can_yield(c)]
        self._components = [(i, connectors[i].component) for i in self._hinges]
        ends = [connectors[i].law for i in self._hinges]
        self._own = np.array([isinstance(law, ConnectorLaw) for law in ends], dtype=bool)
        self._work: Array = np.zeros(len(ends))  # largest works on connector laws so far
        if state is not None:
            require_arrays(state, {"work": self._work.shape})
            self._work = state["work"].copy()
        laws = [*in_cells, *map(breaking_law, ends)]
        # Energies from which on hinges are free
        breaking = [law is not None and law.limit > 0 for law in laws]
        energies = np.array([law.fracture_energy if law is not None else np.inf for law in laws])
        self._enough = np.where(breaking, BROKEN_FRACTION * energies, np.inf)
        self._breaks = np.isfinite(energies)
        self._followed = [i for i, c in enumerate(connectors) if type(c.law) in CONNECTOR_EVENTS]
        self._in_cells, self._on = self._look(simulation)  # events before the run
        if state is not None:
            require_arrays(state, {"in_cells": self._in_cells.shape})
            self._in_cells |= state["in_cells"] > 0
            rows = [(float(t), int(n), KINDS[int(kind)]) for t, n, kind in state["events"]]
            self._add(simulation, rows)

    def _look(self, simulation: StateView) -> tuple[Flags, Flags]:
        """Return flags of events in cells and hinges, (n, 3), and of contact or sliding, (m,)."""
        plastic, broken = np.max(simulation.now.points_of(0)[:, :, [PLASTIC, HINGE]], axis=1).T
        if hinges := len(self._hinges):
            rows, breaks = simulation.connections(), self._breaks[-hinges:]
            # The rotation of a bushing is its last component, and its loss is in the first one
            rows = np.array([rows[k - n : k + 1].sum(axis=0) for k, n in self._components])
            self._work = np.maximum(self._work, np.abs(rows[:, WORK]))
            least = np.where(self._own, OWN_LAW_YIELDS * self._work, 0.0)
            lost = np.where(rows[:, DISSIPATED] > least, rows[:, DISSIPATED], 0.0)
            plastic = np.append(plastic, np.where(breaks, 0.0, lost))
            broken = np.append(broken, np.where(breaks, lost, 0.0))
        in_cells = np.column_stack([plastic > 0, broken > 0, broken >= self._enough])
        forces = np.abs(simulation.connections()[self._followed, FORCE])
        # Forces above which connectors touch or slide; sliding forces have round-off
        connectors, limits = simulation.scene.all_connectors, simulation.requested_forces
        most = [(1 - 1e-9) * limits.get(connectors[i], 0.0) for i in self._followed]
        return in_cells, np.asarray(forces > most)

    def write(self, simulation: StateView) -> None:
        """Record the events of a step."""
        (in_cells, on), t = self._look(simulation), simulation.t
        changes = np.argwhere(in_cells & ~self._in_cells)
        in_cells |= self._in_cells  # a dissipation that falls again is no second event
        new = [(t, int(cell), IN_CELLS[n]) for cell, n in changes]
        for k in np.flatnonzero(on != self._on):
            number = self._followed[k]
            begins, ends = CONNECTOR_EVENTS[type(simulation.scene.all_connectors[number].law)]
            new.append((t, number, begins if on[k] else ends))
        self._in_cells, self._on = in_cells, on
        events = self._add(simulation, new)
        if events:
            on_first(simulation.comm, lambda: [*map(self._tell, events)])

    def _add(self, simulation: StateView, rows: list[Row]) -> list[Event]:
        connectors, numbering = simulation.scene.all_connectors, simulation.numbering
        cells, hinges = len(numbering.cells), len(simulation.scene.hinges)
        events = []
        for t, number, what in rows:
            where: Place | Connector
            if what not in IN_CELLS:
                where = connectors[number]
            elif number < cells + hinges:
                where = numbering.place_of(number)
            else:
                where = connectors[self._hinges[number - cells]]
                bushings = (x for x in simulation.scene.connectors if where in x.components)
                where = next(bushings, where)
            events.append(Event(t, where, what, simulation.parameter))
        self._rows += rows
        self.found += events
        return events

    def state(self) -> State:
        """Return the events so far: time, number of the cell or connector, and kind."""
        events = np.array([(t, n, KINDS.index(what)) for t, n, what in self._rows])
        return {"events": events, "work": self._work, "in_cells": self._in_cells.astype(float)}
