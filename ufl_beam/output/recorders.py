# SPDX-License-Identifier: MIT
"""Files that a run writes on the way."""

from __future__ import annotations

import csv
import io
import sys
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from ufl_beam.collective_errors import on_first
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import SceneError, require_count, require_kind, require_sequence
from ufl_beam.model.bodies import Anchor, require_anchor
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.output.joint_histories import links_of, motion_of
from ufl_beam.output.output_files import (
    Output,
    OutputFile,
    require_apart,
    require_path,
    require_writable,
)

if TYPE_CHECKING:
    from ufl_beam.output.state_view import StateView


UNLIMITED = sys.maxsize
"""As many as there are."""


MOTION = (("u", "m"), ("v", "m"), ("psi", "rad"))
"""Components of the motion of a place, and their units."""

TRANSLATION = (("motion", "m"), ("force", "N"), ("work", "J"))
"""Columns of a connector, and their units."""

ROTATION = (("motion", "rad"), ("force", "N m"), ("work", "J"))
"""The same of one that turns."""


class Recorder(ABC):
    """Base class of recorders, which see each accepted step; called by all processes together.

    Example:
        >>> class Speed(ub.Recorder):
        ...     largest = 0.0
        ...     require_writable = open = close = lambda self, *simulation: None
        ...     def write(self, simulation):
        ...         self.largest = max(self.largest, abs(simulation.velocity(beam.end)[1]))
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=Speed())
    """

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that it writes: two outputs of a run must not share one."""
        return ()

    @abstractmethod
    def require_writable(self) -> None:
        """Raise :class:`SceneError` if the output cannot be written; the first process asks."""

    @abstractmethod
    def open(self, simulation: StateView) -> None:
        """Begin, with the initial state."""

    @abstractmethod
    def write(self, simulation: StateView) -> None:
        """Record the state after a step."""

    @abstractmethod
    def close(self) -> None:
        """End; also called when the run fails."""

    def state(self) -> State:
        """Return the arrays for :meth:`resume`, by name; those of the first process count.

        Raises:
            SceneError: The recorder has none.
        """
        raise SceneError(
            f"{type(self).__name__}: this recorder cannot go on from a checkpoint; give it methods "
            "state() and resume(simulation, state), or run without a checkpoint"
        )

    def resume(self, simulation: StateView, state: State) -> None:
        """Go on from a :meth:`state`, in the place of :meth:`open`; nothing is recorded yet.

        Raises:
            SceneError: What was written before is not there any more.
        """
        self.state()


def recorders_of(
    record: Sequence[Recorder] | Recorder, comm: MPI.Intracomm, call: str, *others: Output
) -> tuple[tuple[Recorder, ...], list[Output]]:
    """Check the recorders of a run.

    Args:
        record: What the user gave.
        comm: Processes of the run.
        call: Name for messages.
        others: Other outputs of the run.

    Returns:
        The recorders; all outputs.

    Raises:
        SceneError: Something is no recorder, or given twice; a file cannot be written, or two
            outputs write the same one.
    """
    recorders = (record,) if isinstance(record, Recorder) else require_sequence(record, "record")
    outputs = []
    for i, recorder in enumerate(recorders):
        name = f"record[{i}]"
        require_kind(recorder, Recorder, f"{call}: {name}")
        first = next(k for k, one in enumerate(recorders) if one is recorder)
        if first != i:
            raise SceneError(
                f"{call}: record[{first}] and {name} are the same {type(recorder).__name__}; "
                "leave one out"
            )
        on_first(comm, recorder.require_writable)
        outputs.append((f"{name} ({type(recorder).__name__})", recorder.files))
    outputs += others
    on_first(comm, lambda: require_apart(outputs, call))
    return recorders, outputs


def close_all(recorders: Sequence[Recorder]) -> None:
    """Close all recorders, also when closing one of them fails."""
    with ExitStack() as stack:
        for recorder in reversed(recorders):
            stack.callback(recorder.close)


class History(Recorder):
    """Table (CSV) of the motion of places and of the energy ledger, complete after a crash.

    Columns: t, or the load factor of a path; u, v, psi of each place; motion, force, work of each
    connector; then the entries of the ledger.  The names of the columns end in their units.

    Args:
        path: File, ending in ``.csv``.
        places: Places to follow, on beams and bodies.
        connectors: Connectors to follow, see
            :class:`~ufl_beam.output.joint_histories.Connection`; of joints, all the connectors that
            hold them.
        every: Write every so many steps.
        most: Rows, besides the initial one, that the file may have.  When there are more, every
            other one goes, and only half as many steps are written from then on.

    Raises:
        SceneError: ``every`` or ``most`` is no whole number, at least 1.

    Example:
        >>> table = ub.History("tip.csv", [beam.end])
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=table)
        >>> np.loadtxt("tip.csv", delimiter=",", skiprows=1).shape[0]
        21
    """

    def __init__(
        self,
        path: str | Path,
        places: Sequence[Anchor] = (),
        connectors: Sequence[Connector | Joint] = (),
        *,
        every: int = 1,
        most: int = UNLIMITED,
    ) -> None:
        require_count(every, f"History {path}: every")
        require_count(most, f"History {path}: most")
        self._first_every, self._most = every, most
        self._path = require_path(path, "History")
        self._places = require_sequence(places, f"History {path}: places")
        self._connectors = require_sequence(connectors, f"History {path}: connectors")
        for i, place in enumerate(self._places):
            require_anchor(place, f"History {path}: places[{i}]")
        for i, one in enumerate(self._connectors):
            require_kind(one, (Connector, Joint), f"History {path}: connectors[{i}]")
        self._files: list[OutputFile] = []

    @property
    def files(self) -> tuple[Path, ...]:
        """The file, and if rows may go the one that takes its place."""
        return (self._path,) if self._most == UNLIMITED else (self._path, self._part)

    @property
    def _part(self) -> Path:
        return self._path.with_name(self._path.name + ".part")

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if the file cannot be written."""
        require_writable(self._path)

    def open(self, simulation: StateView) -> None:
        """Write the header and the initial state."""
        self._prepare(simulation)
        row = self._row(simulation)
        self._every, self._steps, self._rows = self._first_every, 0, 0
        on_first(simulation.comm, lambda: self._begin(row))

    def _prepare(self, simulation: StateView) -> None:
        """Note what is followed, and the header."""
        self._comm = simulation.comm
        self._links = {
            link: name
            for followed in self._connectors
            for link, name in _named_links(simulation.scene, followed)
        }
        names = [f"{c} {place} [{unit}]" for place in self._places for c, unit in MOTION]
        for link, name in self._links.items():
            units = ROTATION if simulation.scene.links[link].turns else TRANSLATION
            names += [f"{c} {name} [{unit}]" for c, unit in units]
        energies = (f"{name} [J]" for name in simulation.ledger_names())
        self._header = _line([simulation.parameter.column, *names, *energies])

    def _begin(self, row: bytes) -> None:
        self.close()
        self._files, self._length = [OutputFile(self._path)], 0
        self._append(self._header)
        self._append(row)

    def _append(self, line: bytes) -> None:
        """Write at the end of what is complete: an interrupted line is written over."""
        self._files[0].put(self._length, line)
        self._length += len(line)

    def write(self, simulation: StateView) -> None:
        """Write the row of the state, every so many steps."""
        self._steps += 1
        if self._steps % self._every:
            return
        if self._rows == self._most:
            on_first(simulation.comm, self._thin)
            self._rows, self._every = self._rows // 2, 2 * self._every
            if self._steps % self._every:
                return
        row = self._row(simulation)
        self._rows += 1
        on_first(simulation.comm, lambda: self._append(row))

    def _thin(self) -> None:
        """Leave out every other row; at no time is there less than one whole file."""
        rows = self._files[0].read(len(self._header), self._length).splitlines(keepends=True)
        self.close()
        self._length = 0
        self._files = [OutputFile(self._part)]
        self._append(self._header + b"".join(rows[::2]))
        self._files[0].rename(self._path)

    def _row(self, simulation: StateView) -> bytes:
        q = simulation.share.gather(simulation.q)
        motion = [motion_of(simulation.grid, place, [q])[0] for place in self._places]
        links = list(self._links)
        connections = simulation.connections()[links, :3] if links else ()
        entries = {name: e for group in simulation.entries() for name, e in group.items()}
        energies = [entries[name] for name in simulation.ledger_names()]
        numbers = (simulation.t, *np.ravel(motion), *np.ravel(connections), *energies)
        return _line([repr(float(x)) for x in numbers])

    def state(self) -> State:
        """The length of the file, and the whole of it where rows may go again."""
        on_first(self._comm, self._sync)
        counts = np.array([self._every, self._steps, self._rows, 0], dtype=float)
        content = b""
        for file in self._files:
            counts[3] = self._length
            if self._most < UNLIMITED:
                content = file.read(0, self._length)
        return {"counts": counts, "content": np.frombuffer(content, dtype=np.uint8)}

    def _sync(self) -> None:
        for file in self._files:
            file.sync()

    def resume(self, simulation: StateView, state: State) -> None:
        """Cut off what was written after the state, and append."""
        self._prepare(simulation)
        self._every, self._steps, self._rows, length = map(int, state["counts"])
        on_first(simulation.comm, lambda: self._take_back(state["content"].tobytes(), length))

    def _take_back(self, content: bytes, length: int) -> None:
        if content:
            self._path.write_bytes(content)
        if not self._is_same(length):
            raise SceneError(
                f"History {self._path}: it is not the file that was written up to the checkpoint; "
                "bring it back, or delete the checkpoint to begin anew"
            )
        self._files, self._length = [OutputFile(self._path, new=False)], length
        self._files[0].cut(length)

    def _is_same(self, length: int) -> bool:
        """Return whether there is a file with this header, long enough."""
        try:
            with self._path.open("rb") as file:
                same = file.read(len(self._header)) == self._header
            return same and self._path.stat().st_size >= length
        except FileNotFoundError:
            return False

    def close(self) -> None:
        """Close the file, without what an interrupt has left behind the last complete row."""
        files, self._files = self._files, []
        for file in files:
            file.cut(self._length)
            file.close()


def _line(cells: Sequence[str]) -> bytes:
    """A line of a CSV file."""
    text = io.StringIO(newline="")
    csv.writer(text).writerow(cells)
    return text.getvalue().encode()


def _named_links(scene: Scene, followed: Connector | Joint) -> list[tuple[int, str]]:
    """Numbers of links and their names, which tell alike ones between the same places apart."""
    links = links_of(scene, followed)
    if isinstance(followed, Connector):
        return [(links[0], f"{followed}, {type(followed.law).__name__}")]
    holders = [scene.links[link] for link in links]
    axes = ["psi" if c.turns else "xy"[abs(c.axis[1]) > abs(c.axis[0])] for c in holders]
    return [
        (link, f"{holder}, {axis}" if len(links) > 1 else str(holder))
        for link, holder, axis in zip(links, holders, axes, strict=True)
    ]
