# SPDX-License-Identifier: MIT
"""Parameter studies: one scene with many parameters or seeds, computed in parallel.

:mod:`mpi4py.futures` distributes the members.  All processes run the same script, so only cases are
sent.  The member function may be a closure and need not be picklable.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import Rich
from ufl_beam.errors import (
    ArgumentError,
    require_function,
    require_kind,
    require_sequence,
    require_switch,
)
from ufl_beam.file_system import require_path
from ufl_beam.output.output_files import (
    add_prefix,
    beside,
    decoding,
    plain,
    remove_prefix,
    require_apart,
    require_arrays,
    reserved,
    write,
)
from ufl_beam.parallel import alone, communicator, on_first, print_once, progress_bar

Case = dict[str, Any]
Member = Callable[..., dict[str, Any]]
Outcome = dict[str, Array] | str  # result of a member, or the reason of its failure
Record = tuple[Outcome, float]  # outcome of a member, and its wall time; s

FORMAT, EARLIER = "study of ufl_beam, 3", "study of ufl_beam, 2"
"""Formats of files: of this version, and of versions whose results a study does not continue."""

_MEMBER: ContextVar[Member] = ContextVar("member of the study that this process serves")


@dataclass(frozen=True, eq=False)
class Study(Rich):
    """Results of the members of a study, the same on every process.

    ``study["peak"]`` has a row for each case; the row of a failed member is NaN.

    Attributes:
        member: Name of the function.
        cases: Arguments of each member; tuples and arrays become lists.
        results: Returned values by name; (len(cases), ...) each.
        failed: Error message of each failed case, by the index of the case.
        seconds: Wall time of each member; (len(cases),); s.

    Example:
        >>> results = ub.study(lambda n: {"square": n**2}, [{"n": 3}, {"n": 4}])
        >>> print(results["square"], results.failed)
        [ 9. 16.] {}
    """

    member: str
    cases: tuple[dict[str, Any], ...]
    results: dict[str, Array]
    failed: dict[int, str]
    seconds: Array

    @classmethod
    def from_records(cls, member: str, records: dict[str, Record]) -> Study:
        """Make a study from the record of each case, by the text of :func:`_case_text`."""
        outcomes = [outcome for outcome, _ in records.values()]
        failed = {i: outcome for i, outcome in enumerate(outcomes) if isinstance(outcome, str)}
        first: dict[str, Array] = next((row for row in outcomes if not isinstance(row, str)), {})
        none = {name: np.full_like(first[name], np.nan) for name in sorted(first)}
        rows = [none if isinstance(outcome, str) else outcome for outcome in outcomes]
        results = {name: np.array([row[name] for row in rows]) for name in none}
        seconds = np.array([seconds for _, seconds in records.values()])
        return cls(member, tuple(map(json.loads, records)), results, failed, seconds)

    def __len__(self) -> int:
        return len(self.cases)

    def __getitem__(self, name: str) -> Array:
        if name not in self.results:
            raise ArgumentError(f"study: no result {name!r}; there is {', '.join(self.results)}")
        return self.results[name]

    def __repr__(self) -> str:
        names = ", ".join(self.results) or "no results"
        return f"<Study of {self.member}: {len(self)} cases, {len(self.failed)} failed; {names}>"

    def __str__(self) -> str:
        lines = [f"study of {self.member}: {len(self)} members, {len(self.failed)} failed"]
        lines += [f"  failed: {self.cases[i]}: {error}" for i, error in self.failed.items()]
        return "\n".join(lines)

    def save(self, path: str | Path) -> None:
        """Write a file with a checksum; an existing file is replaced by a complete file only.

        Raises:
            ArgumentError: The file cannot be written.
            OSError: There is no space for the file.
        """
        file = require_path(path, "study")
        content = {
            "member": self.member, "cases": [*map(_case_text, self.cases)], "seconds": self.seconds,
            "errors": [self.failed.get(i, "") for i in range(len(self))],
        }  # fmt: skip
        write(file, FORMAT, {**content, **add_prefix("results/", self.results)})

    @classmethod
    def load(cls, path: str | Path) -> Study:
        """Read a file that :meth:`save` or :func:`study` wrote.

        Raises:
            ArgumentError: The file does not exist, is no study, or is damaged.
        """
        file = require_path(path, "study")
        with decoding(file, FORMAT, EARLIER) as content:
            cases, results = content["cases"], remove_prefix("results/", content)
            failed = {i: str(error) for i, error in enumerate(content["errors"]) if error}
            require_arrays(content, {"seconds": (len(cases),)})
            for name, values in results.items():
                require_arrays(results, {name: (len(cases), *values.shape[1:])})
            if len(content["errors"]) != len(cases):
                raise ArgumentError("the file is damaged: 'errors' lacks an entry for a case")
            made = tuple(map(json.loads, cases))
            return cls(str(content["member"]), made, results, failed, content["seconds"])


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

    Each member is computed by one process; results agree to the last bit for any number of
    processes.  The first process distributes cases and writes the file.  It also computes members
    if there is no other process, or if MPI supports several threads (``MPI_THREAD_MULTIPLE``).

    A member fails if it raises an exception.  The study continues and reports the failure.

    Args:
        member: Function that makes and simulates a scene and returns numbers and arrays by name,
            with the same names and shapes for each case.  It must write to different files for
            different cases.
        cases: Arguments: ``[{"seed": seed, "mass": m} for m in (1, 2) for seed in range(50)]``.
            Values are numbers, texts, or lists of these; no two cases are equal.
        path: File of the results.  It is saved repeatedly, which takes at most a twentieth of the
            wall time.  Cases in the file are not computed again, unless they failed.  Results of
            other cases stay in the file.
        anew: Compute all cases again and discard the results in the file, as is necessary after a
            change of the member.
        progress: Show a progress bar in a terminal or notebook.
        comm: Processes; by default all, but this process alone inside a member of another study.
            In a member, call :func:`simulate` without ``comm``.

    Returns:
        Results in the order of the cases.

    Raises:
        ArgumentError: The call or the file is wrong; or a member returned anything but numbers and
            arrays, or names or shapes that differ between members.  The results of earlier members
            are in the file.
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
        outputs.append(("study", (path, beside(path))))
    todo: dict[str, Case] = {}
    records: dict[str, Record] = {}

    def prepare() -> None:
        require_function(member, "study: member", "the names in the cases")
        for i, case in enumerate(require_sequence(cases, "study: cases")):
            key = _case_text(case, f"study: cases[{i}]")
            if key in todo:
                raise ArgumentError(f"study: cases[{i}] = {case} occurs twice")
            todo[key] = case
        if not todo:
            raise ArgumentError("study: cases is empty")
        require_apart(outputs, "study")
        if path is not None and path.exists():
            old = Study.load(path)
            if not anew:
                with decoding(path, FORMAT):
                    pass  # refuses earlier formats
                if old.member != name:
                    raise ArgumentError(f"study {path} has results of {old.member}, not of {name}")
                for i, key in enumerate(map(_case_text, old.cases)):
                    if key not in todo or i not in old.failed:
                        row = {result: values[i] for result, values in old.results.items()}
                        records[key] = old.failed.get(i, row), float(old.seconds[i])
        save()  # fails early if the file cannot be written

    def save() -> None:
        if path is not None:
            order = [key for key in todo if key in records]
            order += [key for key in records if key not in todo]
            Study.from_records(name, {key: records[key] for key in order}).save(path)

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
    with reserved(outputs):
        if comm.rank > 0:
            for _ in _outcomes(comm, member, {}):
                pass  # serve until the first process has all results
        on_first(comm, gather)
    result = Study.from_records(name, comm.bcast({key: records[key] for key in todo}))
    if len(result.failed) == len(result):
        raise RuntimeError(f"study: all {len(result)} members failed, {result.failed[0]}")
    if result.failed and comm.rank == 0:
        print_once(result)
    return result


def _outcomes(
    comm: MPI.Intracomm, member: Member, cases: dict[str, Case]
) -> Generator[tuple[str, Outcome, float], None, None]:
    """Yield key, outcome and seconds of each case on the first process; others yield nothing."""
    before = _MEMBER.set(member)
    try:
        if comm.size == 1:
            for key, case in cases.items():
                yield key, *_run(case)
            return
        with MPICommExecutor(comm, root=0) as pool:
            if pool is not None:
                yield from _distributed(pool, cases)
    finally:
        _MEMBER.reset(before)


def _distributed(
    pool: Any, cases: dict[str, Case]
) -> Generator[tuple[str, Outcome, float], None, None]:
    """Yield key, outcome and seconds of cases; this process begins with the last case."""
    futures = {pool.submit(_run, case): key for key, case in cases.items()}
    ended: SimpleQueue[Any] = SimpleQueue()  # includes futures that this process cancels
    for future in futures:
        future.add_done_callback(ended.put)
    # This process runs members only if MPI allows a thread of the pool to communicate meanwhile.
    left = [*futures] if MPI.Query_thread() == MPI.THREAD_MULTIPLE else []
    finished = 0
    try:
        while finished < len(futures):
            if left and ended.empty():
                future = left.pop()
                if not future.cancel():
                    continue  # another process has begun it
                outcome = _run(cases[futures[future]])
            else:
                future = ended.get()
                if future.cancelled():
                    continue  # this process has run it
                outcome = future.result()
            finished += 1
            yield futures[future], *outcome
    finally:
        for future in futures:
            future.cancel()


class WrongResult(ArgumentError):
    """Error of a member that ends the study, because other members would have the same error."""


def _run(case: Case) -> Record:
    """Run one member on this process; its exception is an outcome, a wrong result is raised."""
    begin = time.perf_counter()
    try:
        with alone():
            returned = _MEMBER.get()(**case)
    except WrongResult:
        raise
    except Exception as error:
        return f"{type(error).__name__}: {error}", time.perf_counter() - begin
    seconds = time.perf_counter() - begin
    if not isinstance(returned, dict) or not returned:
        raise ArgumentError(
            f"study: {case} returned {returned!r}; return a dict of numbers or arrays"
        )
    arrays = {}
    for name, value in returned.items():
        if not isinstance(name, str) or name in {"", "."} or "/" in name or not name.isprintable():
            raise ArgumentError(f"study: {case} returned {name!r}, which names no result")
        array = np.asarray(None)  # refused below, if lists have different lengths
        with suppress(ValueError):
            array = np.asarray(value)
        if array.dtype.kind not in "biuf":
            raise ArgumentError(
                f"study: {case} returned {name} = {value!r}, which is no number or array of numbers"
            )
        arrays[name] = array.astype(float)
    return arrays, seconds


def _require_alike(case: Case, outcome: Outcome, records: dict[str, Record]) -> None:
    if isinstance(outcome, str):
        return
    known = ((key, row) for key, (row, _) in records.items() if not isinstance(row, str))
    key, row = next(known, ("", outcome))
    new, old = ({name: x[name].shape for name in sorted(x)} for x in (outcome, row))
    if new != old:
        raise ArgumentError(
            f"study: {case} returned names and shapes {new}, but {key} {old}; return the same from "
            "all members, and begin a new file if they have changed"
        )


def _case_text(case: dict[str, Any], what: str = "case") -> str:
    """Return a case as JSON with all digits and sorted names, for comparison of cases."""
    require_kind(case, dict, what)
    for name in case:
        require_kind(name, str, f"{what}: name")
    try:
        return json.dumps(case, sort_keys=True, ensure_ascii=False, default=plain)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"{what} = {case}: values must be numbers, texts or lists of them; let the member "
            "make other objects from these"
        ) from None
