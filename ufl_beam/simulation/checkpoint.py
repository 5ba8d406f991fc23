# SPDX-License-Identifier: MIT
"""Checkpoints, from which an interrupted run continues."""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.discretization.state_io import Archive, OtherVersion, State
from ufl_beam.errors import ArgumentError, require_count, require_number, require_sequence, shorten
from ufl_beam.file_system import Lock, require_path
from ufl_beam.output.output_files import (
    Content,
    add_prefix,
    beside,
    decoding,
    remove_prefix,
    require_arrays,
    require_writable,
    write,
)
from ufl_beam.output.recorder import Recorder
from ufl_beam.output.serialization import CODE, Description, difference, has_state
from ufl_beam.parallel import on_first
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution

FORMAT = "checkpoint of ufl_beam, 9"
"""Format of the file; its number grows if arrays of the same names and shapes get another meaning.
Other arrays are found when a state is restored."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Checkpoint file of a run, and the interval at which the file is written.

    After a crash, run the same script again.  If the file exists, the run continues from its state.
    On one process the results then equal the results of an uninterrupted run to the last bit.

    Args:
        path: File.
        every: Number of steps after which the file is written again.
        minutes: Wall time after which the file is written again; min.
        also: Further objects to save: random generators of NumPy, or objects with ``state()`` and
            ``restore(state)``.  Such objects that functions in the scene use are always saved.  A
            state consists of numbers, strings, lists and dicts.

    Raises:
        ArgumentError: ``path`` is no name of a file, both ``every`` and ``minutes`` are missing, a
            number is out of range, or an object in ``also`` has no state.

    Example:
        >>> backup = ub.Checkpoint("run.checkpoint", every=1000)
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, checkpoint=backup)
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
            raise ArgumentError(f"{what}: say how often, every=1000 (steps), minutes=10, or both")
        if self.every is not None:
            require_count(self.every, f"{what}: every")
        if self.minutes is not None:
            require_number(self.minutes, f"{what}: minutes", at_least=0.0)
        object.__setattr__(self, "also", require_sequence(self.also, f"{what}: also"))
        for i, item in enumerate(self.also):
            if not has_state(item):
                raise ArgumentError(
                    f"{what}: also[{i}] = {shorten(item)} has no state; give a random generator of "
                    "NumPy, or an object with methods state() and restore(state)"
                )

    @property
    def files(self) -> tuple[Path, ...]:
        """The checkpoint file and its temporary file; no other output may write them."""
        path = Path(self.path)
        return path, beside(path)


class CheckpointFile:
    """Reader and writer of the checkpoint of one run.

    ``call`` contains the arguments of the run by name, which must be the same after a restart.
    The end ``t1`` (s) may differ in runs with equal steps; ``step`` is their length (s), or None
    for adaptive steps.

    Attributes:
        lock: Lock of the file, until the run releases it.
        content: Content of the existing file; empty without a file and after :meth:`resume`.
    """

    def __init__(
        self,
        checkpoint: Checkpoint,
        call: Mapping[str, Any],
        step: float | None,
        t1: float,
        recorders: Sequence[Recorder],
        comm: MPI.Intracomm,
    ) -> None:
        for recorder in recorders:
            if type(recorder).state is Recorder.state:
                recorder.state()  # raises, because this recorder cannot be restarted
        self._call, self._step, self._t1, self._comm = call, step, t1, comm
        self._checkpoint, self.path, self._recorders = checkpoint, Path(checkpoint.path), recorders
        self._described = Description(call)
        also = {f"also[{i}]": item for i, item in enumerate(checkpoint.also)}
        self._stateful = {**self._described.stateful, **also}
        self.content: Content = {}
        self.lock = Lock(self.path)
        try:
            on_first(comm, self._find)
        except BaseException:
            self.lock.unlock()
            raise
        if comm.size > 1:
            self.content = comm.bcast(self.content)
        self._last_time, self._last_step = time.perf_counter(), -1

    # -- restart -------------------------------------------------------------------------------

    def _find(self) -> None:
        """Lock the file; if it exists, read it, and check that it belongs to this run."""
        if not (folder := self.path.parent).is_dir():
            raise ArgumentError(f"checkpoint {self.path}: there is no directory {folder}; make it")
        try:
            owner = self.lock.acquire()
            exists = self.path.exists()
        except OSError as error:
            raise ArgumentError(
                f"checkpoint {self.path}: {self.lock.path} cannot be written: {error.strerror}"
            ) from None
        if owner:
            raise ArgumentError(
                f"checkpoint {self.path} is in use: {owner} writes it. Let that run end, or stop "
                "it, or name another file"
            )
        if exists:
            with decoding(self.path, FORMAT) as self.content:
                now, then = self._described.texts, self.content["call"]
                if self.content["python"] != PYTHON:
                    code = f".{CODE}"
                    now, then = ({n: x[n] for n in x if not n.endswith(code)} for x in (now, then))
                step, before, differs = self._step, self.content["step"], difference(now, then)
                if not differs and step and abs(step - before) > 1e-9 * before:
                    differs = f"the step is {step!r} s, in the file {before!r} s"
                if not differs and [*self._stateful] != [*self.content["stateful"]]:
                    differs = "other objects have a state"
                if differs:
                    raise ArgumentError(f"it is of another run: {differs}")
                t, t1 = float(self.content["state/t"][0]), self._t1
                if t > t1 and t - t1 > 1e-9 * (self._step or 0.0):
                    raise ArgumentError(f"it is at t = {t:.9g} s, beyond the end t[1] = {t1:.9g} s")
        require_writable(self.path)

    def resume(self, simulation: Simulation, pace: Any) -> None:
        """Restore simulation, step control ``pace``, objects with a state, and recorders."""
        content, solution = self.content, simulation.solution
        with decoding(self.path, FORMAT, content=content):
            _restore(simulation, remove_prefix("state/", content))
            solution.resume(remove_prefix("history/", content))
            pace.restore(remove_prefix("pace/", content))
            solution.seconds = float(content["seconds"])
        solution.substeps, solution.iterations = simulation.substeps, simulation.iterations
        solution.time_error = pace.error
        solution.warnings = content["warnings"]
        states = content["stateful"].values()
        for item, state in zip(self._stateful.values(), states, strict=True):
            if isinstance(item, np.random.Generator):
                item.bit_generator.state = state
            elif isinstance(item, np.random.RandomState):
                item.set_state(state)
            else:
                item.restore(state)
        for i, recorder in enumerate(self._recorders):
            try:
                recorder.resume(simulation, remove_prefix(f"recorder {i}/", content))
            except (LookupError, TypeError, ValueError) as error:
                with decoding(self.path, FORMAT, content=content):
                    if isinstance(error, ArgumentError):
                        raise
                    raise OtherVersion(f"{recorder} cannot continue from it: {error!r}") from error
        self._last_step, self.content = pace.steps, {}

    # -- writing -------------------------------------------------------------------------------

    def due(self, steps: int) -> bool:
        """Return whether the file is due after ``steps`` steps; all processes call it together."""
        if self._last_step < 0:  # so that an error comes after the first step
            self._require_unchanged()
            self._last_step = 0
        every, minutes = self._checkpoint.every, self._checkpoint.minutes
        due = every is not None and steps - self._last_step >= every
        if minutes is not None:
            over = time.perf_counter() - self._last_time >= 60 * minutes
            due = due or bool(self._comm.bcast(over) if self._comm.size > 1 else over)
        return due

    def write(self, simulation: Simulation, pace: Any, seconds: float) -> None:
        """Write the file, ``seconds`` after the start of the run. All processes call it."""

        def states() -> dict[str, Any]:
            by_name = dict[str, Any]()
            for name, item in self._stateful.items():
                if isinstance(item, np.random.Generator):
                    by_name[name] = item.bit_generator.state
                elif isinstance(item, np.random.RandomState):
                    by_name[name] = item.get_state(legacy=False)
                else:
                    by_name[name] = item.state()
            return by_name

        solution, archive = simulation.solution, Archive(simulation.subdomain)
        simulation.save_or_restore(archive)
        content = {
            "seconds": solution.seconds + seconds,
            **add_prefix("pace/", pace.state()),
            "stateful": simulation.together(states), "warnings": solution.warnings,
            **add_prefix("state/", archive.state()),
        }  # fmt: skip
        for i, recorder in enumerate(self._recorders):
            content |= add_prefix(f"recorder {i}/", recorder.state())
        self._require_unchanged()
        content |= {"python": PYTHON, "call": self._described.texts, "step": self._step}
        at = f" of t = {content['state/t'][0]:.9g} s"
        history = solution.history

        def write_all() -> None:
            write(self.path, FORMAT, content | add_prefix("history/", history()), at)

        on_first(self._comm, write_all)
        self._last_time, self._last_step = time.perf_counter(), pace.steps

    def _require_unchanged(self) -> None:
        changed = difference(Description(self._call).texts, self._described.texts)
        if changed:
            raise ArgumentError(
                f"checkpoint {self.path}: a function of the scene has changed data that no file "
                f"contains: {changed.replace(', in the file', ', at the beginning')}. Make it an "
                "object with methods state() and restore(state), see docs/restart.md"
            )


def _restore(simulation: Simulation, state: State) -> None:
    """Restore a simulation; raise unless its state then consists of the same arrays."""
    simulation.together(simulation.save_or_restore, Archive(simulation.subdomain, state))
    simulation.save_or_restore(restored := Archive(simulation.subdomain))
    arrays = restored.state()
    require_arrays(state, {name: values.shape for name, values in arrays.items()})
    if unknown := sorted(state.keys() - arrays.keys()):
        raise OtherVersion(f"the array {unknown[0]!r} is unknown")


PYTHON = ".".join(map(str, sys.version_info[:2]))
"""Version of Python; functions are compared by their compiled code, which depends on it."""


def checksum_at(start: Solution | None) -> str:
    """Return a checksum of the last state of ``start``, or "nothing" if ``start`` is None."""
    if start is None:
        return "nothing"
    total = hashlib.sha256()
    for name, values in {"q": start.q[-1:], "v": start.v[-1:], **start.internal}.items():
        total.update(f"{name} {values.shape}".encode())
        total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()[:16]
