# SPDX-License-Identifier: MIT
"""Table of a run as a CSV file: motions of places, connectors, and the energy ledger."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ufl_beam.arrays import State
from ufl_beam.errors import SceneError, require_count, require_kind, require_sequence
from ufl_beam.model.bodies import Anchor, require_anchors
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.output.joint_histories import links_of
from ufl_beam.output.output_files import OutputFile, changed, part_of, require_path
from ufl_beam.output.recorders import Recorder
from ufl_beam.output.state_view import StateView
from ufl_beam.parallel import on_first

MOTION = (("u", "m"), ("v", "m"), ("psi", "rad"))  # columns of a place, and their units
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # beginnings of formulas in spreadsheets
COMPONENTS = ("along", "across", "turn")  # of a bushing
CONNECTOR = ("motion", "force", "work")  # columns of a connector


class History(Recorder):
    """Table (CSV) of the motion of places and of the energy ledger, complete after a crash.

    Columns: t, or the load factor of a path; u, v, psi of each place; motion, force, work of each
    connector; then the entries of the ledger.  The names of the columns end in their units.

    Args:
        path: File, ending in ``.csv``.
        places: Places to follow, on beams and bodies.
        connectors: Connectors to follow, see
            :class:`~ufl_beam.output.state_rows.Connection`; of joints, all the connectors that
            hold them.
        every: Write every so many steps.
        most: Largest number of rows, besides the initial one.  When it is exceeded, every other row
            is deleted, and half as many steps are written from then on.

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
        most: int = sys.maxsize,
    ) -> None:
        require_count(every, f"History {path}: every")
        require_count(most, f"History {path}: most")
        self._first_every, self._most = every, most
        self._path = require_path(path, "History")
        self._part = part_of(self._path)
        self._places = require_sequence(places, f"History {path}: places")
        self._connectors = require_sequence(connectors, f"History {path}: connectors")
        for i, place in enumerate(self._places):
            require_anchors(f"History {path}: places[{i}]", place)
        for i, one in enumerate(self._connectors):
            require_kind(one, (Connector, Joint), f"History {path}: connectors[{i}]")
        self._files: list[OutputFile] = []

    @property
    def files(self) -> tuple[Path, ...]:
        """Path of the file, and if rows may go that of the one that takes its place."""
        return (self._path,) if self._most == sys.maxsize else (self._path, self._part)

    def open(self, simulation: StateView) -> None:
        """Write the header and the initial state."""
        self._prepare(simulation)
        row = self._row(simulation)
        self._every, self._steps = self._first_every, 0
        on_first(simulation.comm, lambda: self._begin(self._path, self._header + row))

    def _prepare(self, simulation: StateView) -> None:
        self._comm = simulation.comm
        self._links = {
            link: name
            for followed in self._connectors
            for link, name in _named_links(simulation.scene, followed)
        }
        names = [f"{c} {place} [{unit}]" for place in self._places for c, unit in MOTION]
        for link, name in self._links.items():
            turns = simulation.scene.links[link].turns
            units = ("rad", "N m", "J") if turns else ("m", "N", "J")
            names += [f"{c} {name} [{unit}]" for c, unit in zip(CONNECTOR, units, strict=True)]
        energies = [f"{name} [J]" for group in simulation.entries() for name in group]
        for twice in {*names} & {*energies}:
            raise SceneError(
                f"History {self._path}: {twice!r} would be a column of a connector and of the "
                "energy ledger; give the work that is called so another name"
            )
        columns = [simulation.parameter.column, *names, *energies]
        # Spreadsheets take what begins so for a formula, which may run programs
        self._header = _line([f"'{c}" if c.startswith(FORMULA) else c for c in columns])

    def _begin(self, path: Path, content: bytes) -> None:
        self.close()
        self._files, self._length = [OutputFile(path)], 0
        self._append(content)

    def _append(self, line: bytes) -> None:
        """Write at the end of the complete part: an interrupted line is written over."""
        self._files[0].put(self._length, line)
        self._length += len(line)

    def write(self, simulation: StateView) -> None:
        """Write the row of the state, every so many steps."""
        self._steps += 1
        if self._steps == (self._most + 1) * self._every:
            on_first(simulation.comm, self._thin)
            self._every *= 2
        if self._steps % self._every == 0:
            row = self._row(simulation)
            on_first(simulation.comm, lambda: self._append(row))

    def _thin(self) -> None:
        """Leave out every other row; at no time is there less than one whole file."""
        rows = self._files[0].read(len(self._header), self._length).splitlines(keepends=True)
        self._begin(self._part, self._header + b"".join(rows[::2]))
        self._files[0].rename(self._path)

    def _row(self, simulation: StateView) -> bytes:
        motion = [simulation.displacement(place) for place in self._places]
        links = list(self._links)
        connections = simulation.connections()[links, :3] if links else ()
        energies = [energy for group in simulation.entries() for energy in group.values()]
        numbers = (simulation.t, *np.ravel(motion), *np.ravel(connections), *energies)
        return _line([repr(float(x)) for x in numbers])

    def state(self) -> State:
        """Return the length of the file and its checksum; all of it where rows may go again."""
        rows = self._steps // self._every
        counts = np.array([self._every, self._steps, rows, 0], dtype=float)
        content = digest = b""

        def sync() -> None:
            nonlocal content, digest
            for file in self._files:
                file.sync()
                counts[3] = self._length
                if self._most < sys.maxsize:
                    content = file.read(0, self._length)
                else:
                    digest = file.digest(self._length)

        on_first(self._comm, sync)
        texts = {"content": content, "digest": digest}
        return {"counts": counts, **{n: np.frombuffer(x, dtype=np.uint8) for n, x in texts.items()}}

    def resume(self, simulation: StateView, state: State) -> None:
        """Cut off what was written after the state, and append."""
        self._prepare(simulation)
        self._every, self._steps, _, length = map(int, state["counts"])
        content, digest = (state[name].tobytes() for name in ("content", "digest"))
        on_first(simulation.comm, lambda: self._take_back(content, digest, length))

    def _take_back(self, content: bytes, digest: bytes, length: int) -> None:
        if content:
            self._path.write_bytes(content)
        try:
            file = OutputFile(self._path, new=False)
        except FileNotFoundError:
            raise changed(f"History {self._path}") from None
        if file.read(0, len(self._header)) != self._header or (
            not content and file.digest(length) != digest
        ):
            file.close()
            raise changed(f"History {self._path}")
        self._files, self._length = [file], length
        file.cut(length)

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
        names = COMPONENTS if followed.components else (type(followed.law).__name__,)
        return [(link, f"{followed}, {name}") for link, name in zip(links, names, strict=False)]
    holders = [scene.links[link] for link in links]
    axes = ["psi" if c.turns else "xy"[abs(c.axis[1]) > abs(c.axis[0])] for c in holders]
    return [
        (link, f"{holder}, {axis}" if len(links) > 1 else str(holder))
        for link, holder, axis in zip(links, holders, axes, strict=True)
    ]
