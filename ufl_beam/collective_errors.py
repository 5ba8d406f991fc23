# SPDX-License-Identifier: MIT
"""Exceptions under MPI: what one process raises is raised by all, or ends all of them.

Without this a process that fails alone leaves the others waiting for ever in a collective call.
"""

from __future__ import annotations

import pickle
import sys
import time
import traceback
from collections.abc import Callable
from types import TracebackType
from typing import Any, TypeVar

from mpi4py import MPI

import numpy as np

from ufl_beam.errors import StepFailed

T = TypeVar("T")

GRACE = 3.0
"""Time for which a process that failed waits for the others; s."""

FAILED = 32_749
"""Tag of the messages of processes that end with an exception; MPI has tags up to 32767."""


class Agreement:
    """Calls that raise on all processes if they raise on one.

    On one process they are plain calls.  On several they cost one reduction of an integer.  If the
    others do not come within :data:`GRACE`, because they wait for the failed process elsewhere, it
    prints its exception and aborts all of them.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = duplicate(comm) if comm.size > 1 else None
        self.raised: BaseException | None = None  # the latest that all processes raised together

    def __call__(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function on all processes."""
        if self._comm is None:
            return function(*arguments)
        error: BaseException | None = None
        try:
            value = function(*arguments)
        except BaseException as caught:
            error = caught
        self.settle(error)
        return value

    def settle(self, error: BaseException | None) -> None:
        """Raise on all processes if one of them has an exception; all call it together.

        A failed step, after which the run may go on, gives way to any other exception.
        """
        comm = self._comm
        if comm is None:
            if error is not None:
                raise error
            return
        urgency = 2 if error is None else int(isinstance(error, StepFailed))
        first = np.array([urgency * comm.size + comm.rank])
        request = comm.Iallreduce(MPI.IN_PLACE, first, op=MPI.MIN)
        if error is None:
            request.Wait()
        elif not _completed(request):
            traceback.print_exception(error)
            abort(comm)
        urgency, rank = divmod(int(first[0]), comm.size)
        if urgency == 2:
            return
        known = comm.bcast(portable(error) if comm.rank == rank else None, root=rank)
        self.raised = known if error is None or comm.rank != rank else error
        raise self.raised


_DUPLICATE = MPI.Comm.Create_keyval()


def duplicate(comm: MPI.Intracomm) -> MPI.Intracomm:
    """Communicator of the same processes for agreements only; made once and kept with ``comm``."""
    known: Any = comm.Get_attr(_DUPLICATE)
    if known is None:
        known = comm.Dup()
        comm.Set_attr(_DUPLICATE, known)
    found: MPI.Intracomm = known
    return found


def portable(error: BaseException | None) -> BaseException | None:
    """Return an exception that other processes can receive: itself, or one with its message."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def on_first(comm: MPI.Intracomm, action: Callable[[], object]) -> None:
    """Do something on the first process; what it raises there is raised on all of them."""
    error: BaseException | None = None
    if comm.rank == 0:
        try:
            action()
        except BaseException as caught:
            error = caught
    if comm.size > 1:
        error = comm.bcast(portable(error))
    if error is not None:
        raise error


def _completed(*requests: MPI.Request) -> bool:
    """Wait for communication with the others, but not for ever."""
    end = time.monotonic() + GRACE
    while not MPI.Request.Testall(list(requests)):
        if time.monotonic() > end:
            return False
        time.sleep(1e-3)
    return True


def abort(comm: MPI.Intracomm) -> None:
    """End all processes, and say why."""
    print(  # noqa: T201
        f"ufl_beam: process {comm.rank} of {comm.size} failed; the others have not failed within "
        f"{GRACE:g} s and may wait for it, so all are ended",
        file=sys.stderr,
    )
    sys.stdout.flush()
    sys.stderr.flush()
    time.sleep(0.3)  # mpirun forwards what was printed, but not after an abort
    comm.Abort(1)


def _end_together(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Print an exception that nobody catches; abort unless all processes end with one."""
    _print_exception(kind, error, trace)
    if MPI.Is_finalized():
        return
    world = MPI.COMM_WORLD
    others = [rank for rank in range(world.size) if rank != world.rank]
    # No collective call, which might meet one of those that the others are in.
    told = [world.Isend(bytearray(), rank, FAILED) for rank in others]
    heard = [world.Irecv(bytearray(), rank, FAILED) for rank in others]
    if not _completed(*told, *heard):
        abort(world)


_print_exception = sys.excepthook
if MPI.COMM_WORLD.size > 1:
    # MPI ends a process only when all of them end.
    sys.excepthook = _end_together
