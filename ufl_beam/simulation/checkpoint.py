# SPDX-License-Identifier: MIT
"""Checkpoints: a run goes on after whatever has stopped it."""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from mpi4py import MPI

import numpy as np

from ufl_beam.collective_errors import Agreement, on_first
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import SceneError, require_count, require_number, require_sequence, shorten
from ufl_beam.file_locks import Lock
from ufl_beam.output.archive import above, below
from ufl_beam.output.output_files import require_path
from ufl_beam.output.recorders import Recorder
from ufl_beam.simulation.checkpoint_file import Content, read, write
from ufl_beam.simulation.fingerprint import CODE, Description, difference, has_state
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_control import Pace


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Checkpoint file from which a run is restarted, and the interval of writing it.

    If the file exists when the run begins, the run continues from it, bit for bit: after a crash,
    run the same script again.

    Args:
        path: File; HDF5.
        every: Write every so many steps.
        minutes: Write after so many minutes of wall time.
        also: Further objects with a state, besides those that functions in the scene use: random
            generators of NumPy, and objects with ``state()`` and ``restore(state)``, where the
            state consists of numbers, texts, lists and dicts.

    Raises:
        SceneError: Neither ``every`` nor ``minutes``, or a bad number; no state in ``also``.

    Example:
        >>> backup = ub.Checkpoint("run.checkpoint", every=1000)
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, checkpoint=backup)
        >>> [path.name for path in backup.files]
        ['run.checkpoint', 'run.checkpoint.part']
    """

    path: str | Path
    every: int | None = None
    minutes: float | None = None
    also: Sequence[Any] = ()

    def __post_init__(self) -> None:
        require_path(self.path, "Checkpoint")
        what = f"Checkpoint {self.path}"
        if self.every is None and self.minutes is None:
            raise SceneError(f"{what}: say how often, every=1000 (steps), minutes=10, or both")
        if self.every is not None:
            require_count(self.every, f"{what}: every")
        if self.minutes is not None:
            require_number(self.minutes, f"{what}: minutes", at_least=0.0)
        object.__setattr__(self, "also", require_sequence(self.also, f"{what}: also"))
        for i, one in enumerate(self.also):
            if not has_state(one):
                raise SceneError(
                    f"{what}: also[{i}] = {shorten(one)} has no state; give a random generator of "
                    "NumPy, or an object with methods state() and restore(state)"
                )

    @property
    def files(self) -> tuple[Path, ...]:
        """The file, and the one that takes its place; no other output may write them."""
        path = Path(self.path)
        return path, path.parent / f"{path.name}.part"


class Running(Protocol):
    """A simulation, as far as checkpoints know it; see there."""

    t: float
    parts: int
    solution: Solution
    together: Agreement

    @property
    def iterations(self) -> int:
        """Newton iterations so far."""

    def state(self) -> State:
        """Return the state on which later steps depend."""

    def resume(self, state: State) -> None:
        """Go on from a state."""


class Keeper:
    """The checkpoint of one run; its file is locked until :meth:`close`.

    Args:
        choice: What the user asks for.
        call: What the run is, by name.
        step: Size of its steps if they are equal; then the run may have another end.
        comm: Processes of the run.
    """

    def __init__(
        self, choice: Checkpoint, call: Mapping[str, Any], step: float | None, comm: MPI.Intracomm
    ) -> None:
        self._choice, self._call, self._comm = choice, call, comm
        self.path = Path(choice.path)
        self._step = step
        self._described = Description(call)
        also = {f"also[{i}]": one for i, one in enumerate(choice.also)}
        self._stateful = {**self._described.stateful, **also}
        self.found: Content = {}
        self._lock = Lock(self.path)
        try:
            on_first(comm, self._find)
        except BaseException:
            self.close()
            raise
        if comm.size > 1:
            self.found = comm.bcast(self.found)
        self._last_time, self._last_step = time.perf_counter(), -1
        self._begin = self._last_time - self.found.get("seconds", 0.0)

    # -- going on ------------------------------------------------------------------------------

    def _find(self) -> None:
        folder = self.path.parent
        if not folder.is_dir():
            raise SceneError(f"checkpoint {self.path}: there is no directory {folder}; make it")
        if not os.access(folder, os.W_OK):
            raise SceneError(f"checkpoint {self.path}: the directory cannot be written to")
        try:
            owner = self._lock.take()
            exists = self.path.exists()
        except OSError as error:
            raise SceneError(
                f"checkpoint {self.path}: {self._lock.path} cannot be written: {error.strerror}"
            ) from None
        if owner:
            raise SceneError(
                f"checkpoint {self.path} is in use: {owner} writes it. Let that run end, or stop "
                "it, or name another file"
            )
        if exists:
            self.found = read(self.path)
            self._require_same(self.found)

    def _require_same(self, found: Content) -> None:
        now, then = dict(self._described.texts), dict(found["call"])
        if found["python"] != PYTHON:
            for texts in (now, then):
                for name in [n for n in texts if n.endswith(f".{CODE}")]:
                    del texts[name]
        differs = difference(now, then)
        step, before = self._step, found["step"]
        if not differs and (step is None) != (before is None):
            differs = "steps are equal in one of both, and adaptive in the other"
        if not differs and step and abs(step - before) > 1e-9 * before:
            differs = f"the step is {step!r} s, in the file {before!r} s"
        if not differs and [*self._stateful] != [*found["stateful"]]:
            differs = "other objects have a state"
        if differs:
            raise SceneError(
                f"checkpoint {self.path} is of another run: {differs}. Delete the file to begin "
                "anew, or name another"
            )

    def close(self) -> None:
        """Let other runs have the file."""
        self._lock.release()

    def resume(self, simulation: Running, pace: Pace, t1: float) -> Iterator[Content]:
        """Take over what the file has, then give what it has of each recorder."""
        found = self.found
        state = below("state/", found)
        t = float(state["t"][0])
        if t > t1 and t - t1 > 1e-9 * (self._step or 0.0):
            raise SceneError(
                f"checkpoint {self.path} is at t = {t:.9g} s, beyond the end t[1] = {t1:.9g} s"
            )
        simulation.resume(state)
        simulation.solution.resume(below("history/", found))
        simulation.solution.parts = simulation.parts
        simulation.solution.iterations = simulation.iterations
        simulation.solution.seconds = found["seconds"]
        pace.restore(found["pace"])
        for one, its_state in zip(self._stateful.values(), found["stateful"].values(), strict=True):
            _restore(one, its_state)
        self._last_step = pace.steps
        self.found = {}
        return (below(f"recorder {i}/", found) for i in count())

    # -- writing -------------------------------------------------------------------------------

    def note(self, simulation: Running, pace: Pace, recorders: Sequence[Recorder]) -> None:
        """Write if it is time to; all processes call it together after each step."""
        if self._last_step < 0:  # better now than after an hour
            self._require_told()
            self._last_step = 0
        if pace.finished or self._due(pace.steps):
            self.write(simulation, pace, recorders)

    def _due(self, steps: int) -> bool:
        every, minutes = self._choice.every, self._choice.minutes
        due = every is not None and steps - self._last_step >= every
        if minutes is not None:
            over = time.perf_counter() - self._last_time >= 60 * minutes
            due = due or bool(self._comm.bcast(over) if self._comm.size > 1 else over)
        return due

    def write(self, simulation: Running, pace: Pace, recorders: Sequence[Recorder]) -> None:
        """Write; all processes call it together."""
        self._require_told()
        stateful = self._stateful.items()
        content: Content = {
            "python": PYTHON,
            "call": self._described.texts,
            "step": self._step,
            "seconds": time.perf_counter() - self._begin,
            "pace": pace.state(),
            "stateful": simulation.together(lambda: {name: _state(one) for name, one in stateful}),
            **above("state/", simulation.state()),
        }
        parts = [recorder.state() for recorder in recorders]

        def put() -> None:
            content.update(above("history/", simulation.solution.history()))
            for i, part in enumerate(parts):
                content.update(above(f"recorder {i}/", part))
            write(self.path, content, f"of t = {simulation.t:.9g} s")

        on_first(self._comm, put)
        self._last_time, self._last_step = time.perf_counter(), pace.steps

    def _require_told(self) -> None:
        """Raise if what functions use changes without their saying so: it would be lost."""
        changed = difference(Description(self._call).texts, self._described.texts)
        if changed:
            raise SceneError(
                f"checkpoint {self.path}: a function of the scene remembers what no checkpoint "
                f"knows of: {changed.replace(', in the file', ', at the beginning')}. Make it an "
                "object with methods state() and restore(state), see docs/restart.md"
            )


PYTHON = ".".join(map(str, sys.version_info[:2]))
"""Version of Python, on which the code of functions depends."""


# -- what has a state ---------------------------------------------------------------------------


def _state(one: Any) -> Any:
    if isinstance(one, np.random.Generator):
        return one.bit_generator.state
    if isinstance(one, np.random.RandomState):
        return one.get_state(legacy=False)
    return one.state()


def _restore(one: Any, state: Any) -> None:
    if isinstance(one, np.random.Generator):
        one.bit_generator.state = state
    elif isinstance(one, np.random.RandomState):
        one.set_state(state)
    else:
        one.restore(state)


def end_of(start: Solution | None) -> str:
    """A checksum of what a run begins with."""
    if start is None:
        return "nothing"
    total = hashlib.sha256()
    for name, values in {"q": start.q[-1:], "v": start.v[-1:], **start.internal}.items():
        total.update(f"{name} {values.shape}".encode())
        total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()[:16]
