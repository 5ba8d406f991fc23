# SPDX-License-Identifier: MIT
"""Parameter studies: a scene many times, with other parameters or seeds, in parallel.

Members are handed out by :mod:`mpi4py.futures`.  Since all processes run the same script, each has
the function of the member itself and only cases travel: it may be a closure, and need not pickle.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from contextvars import ContextVar
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

from ufl_beam.analysis.study_file import Outcome, Study, numbers_of, text_of
from ufl_beam.errors import SceneError, require_sequence, require_switch, shorten
from ufl_beam.output.output_files import part_of, require_apart, require_path, take
from ufl_beam.parallel import alone, communicator, on_first, progress_bar, say

Case = dict[str, Any]
Member = Callable[..., dict[str, Any]]

_MEMBER: ContextVar[Member] = ContextVar("member of the study that this process serves")


def study(
    member: Member,
    cases: Sequence[Case],
    *,
    path: str | Path | None = None,
    anew: bool = False,
    progress: bool = True,
    comm: MPI.Intracomm | None = None,
) -> Study:
    """Run a parameter study: call ``member(**case)`` for each case, in parallel under ``mpirun``.

    Each member is computed by one process alone, to the same last bit on any number of them.  The
    first process also hands cases out and, between its own members, writes the file.

    A member that raises an exception has failed: it is reported, and the others are computed.

    Args:
        member: Makes and simulates a scene and returns numbers and arrays by name, the same names
            and shapes for each case.  Files that it writes need names of their own.
        cases: Its arguments: ``[{"seed": seed, "mass": m} for m in (1, 2) for seed in range(50)]``;
            numbers, texts and lists of them, no two alike.
        path: File of the results, written on the way in at most a twentieth of the time.
            Cases that the file has are not computed again, unless they failed; what it has of
            other cases stays.
        anew: Compute all cases again and discard the results in the file, after a change of the
            member.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes; all of them, or this one alone in a member of another study.  A member
            leaves out ``comm`` of :func:`simulate`.

    Returns:
        Results in the order of the cases.

    Raises:
        SceneError: The call or the file is wrong, or a member returned something else than numbers
            and arrays, or not the names and shapes of the others; the file has those before.
        RuntimeError: All members failed.

    Example:
        >>> def member(length):
        ...     beam = ub.Beam((0, 0), (length, 0), section)
        ...     scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)])
        ...     return {"omega": ub.modes(scene, 2).omega}
        >>> results = ub.study(member, [{"length": 2.0}, {"length": 4.0}])
        >>> results["omega"].shape
        (2, 2)
    """
    comm = communicator(comm, "study: comm")
    require_switch(anew, "study: anew")
    require_switch(progress, "study: progress")
    name = getattr(member, "__name__", type(member).__name__)
    outputs = []
    if path is not None:
        path = require_path(path, "study")
        outputs.append(("study", (path, part_of(path))))
    todo: dict[str, Case] = {}
    records: dict[str, tuple[Outcome, float]] = {}

    def prepare() -> None:
        if not callable(member):
            raise SceneError(f"study: member = {shorten(member)} cannot be called; give a function")
        for i, case in enumerate(require_sequence(cases, "study: cases")):
            key = text_of(case, f"study: cases[{i}]")
            if key in todo:
                raise SceneError(f"study: cases[{i}] = {case} is there twice")
            todo[key] = case
        if not todo:
            raise SceneError("study: cases is empty")
        require_apart(outputs, "study")
        if path is not None and path.exists():
            old = Study.load(path)
            if not anew:
                if old.member != name:
                    raise SceneError(f"study {path} is one of {old.member}, not of {name}")
                for key, (outcome, seconds) in old.records().items():
                    if key not in todo or not isinstance(outcome, str):
                        records[key] = outcome, seconds
        save()  # that it cannot be written is better known now

    def save() -> None:
        if path is not None:
            order = [key for key in todo if key in records]
            order += [key for key in records if key not in todo]
            Study.of(name, {key: records[key] for key in order}).save(path)

    def gather() -> None:
        missing = {key: case for key, case in todo.items() if key not in records}
        next_save, done = 0.0, len(todo) - len(missing)
        bar = progress_bar(progress, comm, total=len(todo), initial=done, unit="member")
        try:
            with bar, closing(_outcomes(comm, member, missing)) as outcomes:
                for key, outcome, seconds in outcomes:
                    _require_alike(todo[key], outcome, records)
                    records[key] = outcome, seconds
                    bar.update()
                    begin = time.perf_counter()
                    if begin > next_save:
                        save()
                        next_save = time.perf_counter() + 20 * (time.perf_counter() - begin)
        finally:
            save()

    on_first(comm, prepare)
    release = take(outputs)
    try:
        if comm.rank > 0:
            for _ in _outcomes(comm, member, {}):
                pass  # this process serves until the first one has everything
        on_first(comm, gather)
    finally:
        release()
    result = Study.of(name, comm.bcast({key: records[key] for key in todo}))
    if len(result.failed) == len(result):
        raise RuntimeError(f"study: all {len(result)} members failed, {result.failed[0]}")
    if result.failed and comm.rank == 0:
        say(result)
    return result


def _outcomes(
    comm: MPI.Intracomm, member: Member, cases: dict[str, Case]
) -> Generator[tuple[str, Outcome, float], None, None]:
    """Case, outcome and seconds as members end; nothing on processes that serve the first one."""
    before = _MEMBER.set(member)
    try:
        if comm.size == 1:
            for key, case in cases.items():
                yield key, *_run(case)
            return
        with MPICommExecutor(comm, root=0) as executor:
            pool: Any = executor
            if pool is not None:
                yield from _shared_out(pool, cases)
    finally:
        _MEMBER.reset(before)


def _shared_out(
    pool: Any, cases: dict[str, Case]
) -> Generator[tuple[str, Outcome, float], None, None]:
    """Case, outcome and seconds; others take cases from the front, this process from the back."""
    futures = {pool.submit(_run, case): key for key, case in cases.items()}
    ended: SimpleQueue[Any] = SimpleQueue()

    def note(future: Any) -> None:
        if not future.cancelled():
            ended.put(future)

    for future in futures:
        future.add_done_callback(note)
    # A thread of the pool talks to the others meanwhile, which not every MPI allows.
    left = [*futures] if MPI.Query_thread() == MPI.THREAD_MULTIPLE else []
    given = 0
    try:
        while given < len(futures):
            if left and ended.empty():
                future = left.pop()
                if not future.cancel():
                    continue  # another process has begun it
                outcome = _run(cases[futures[future]])
            else:
                future = ended.get()
                outcome = future.result()
            given += 1
            yield futures[future], *outcome
    finally:
        for future in futures:
            future.cancel()


def _run(case: Case) -> tuple[Outcome, float]:
    """Run one member on the process that serves; its error is an outcome as well."""
    begin = time.perf_counter()
    try:
        with alone():
            returned = _MEMBER.get()(**case)
    except Exception as error:
        return f"{type(error).__name__}: {error}", time.perf_counter() - begin
    return numbers_of(case, returned), time.perf_counter() - begin


def _require_alike(case: Case, outcome: Outcome, records: dict[str, tuple[Outcome, float]]) -> None:
    """Names and shapes must be those of the first member that did not fail."""
    if isinstance(outcome, str):
        return
    new = {name: outcome[name].shape for name in sorted(outcome)}
    for other, (row, _) in records.items():
        if not isinstance(row, str):
            old = {name: row[name].shape for name in sorted(row)}
            if new != old:
                raise SceneError(
                    f"study: {case} returned names and shapes {new}, but {other} {old}; return "
                    "the same from all members, and begin a new file if they have changed"
                )
            return
