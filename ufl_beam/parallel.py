# SPDX-License-Identifier: MIT
"""MPI processes: distribution of scenes, exceptions on all processes, output.

If one process alone raised an exception, the other processes would wait forever in a collective
call.  So all processes raise the exception.
"""

from __future__ import annotations

import atexit
import math
import os
import pickle
import select
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from types import TracebackType
from typing import Any, TypeVar

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, ProcessesDiffer, StepFailed, shorten, warn

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of tqdm in a notebook without ipywidgets
    from tqdm.auto import tqdm

T = TypeVar("T")

GRACE = 3.0  # time for which a failed process waits for the other processes; s

FAILED = 32_749
"""Tag of messages of processes that end with an exception; MPI guarantees tags up to 32767."""

DELAY = 0.5  # time before a progress bar is shown, and between its updates; s

_ACTIVE: ContextVar[MPI.Intracomm] = ContextVar("processes of a scene", default=MPI.COMM_WORLD)


# -- processes of a scene --------------------------------------------------------------------------


def active_comm() -> MPI.Intracomm:
    """Return the communicator of calls without an argument ``comm``."""
    return _ACTIVE.get()


def communicator(comm: MPI.Intracomm | None, what: str) -> MPI.Intracomm:
    """Return the communicator of a call: its ``comm``, or by default :func:`active_comm`."""
    if comm is None:
        return active_comm()
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        raise ArgumentError(
            f"{what} = {shorten(comm)} must be a communicator, such as MPI.COMM_SELF"
        )
    return comm


@contextmanager
def alone() -> Iterator[None]:
    """Compute scenes on this process alone within the context."""
    before = _ACTIVE.set(MPI.COMM_SELF)
    try:
        yield
    finally:
        _ACTIVE.reset(before)


_DUPLICATE = MPI.Comm.Create_keyval()


def duplicate(comm: MPI.Intracomm) -> MPI.Intracomm:
    """Return a duplicate of ``comm`` for internal messages; later calls return it again."""
    known: Any = comm.Get_attr(_DUPLICATE)
    if known is None:
        known = comm.Dup()
        comm.Set_attr(_DUPLICATE, known)
    copy: MPI.Intracomm = known
    return copy


# -- exceptions that all processes raise -----------------------------------------------------------


class Agreement:
    """Collective calls of functions, whose exceptions are raised on all processes.

    On several processes each call costs one reduction of an integer.  The other processes may wait
    for a failed process in another collective call.  If they do not join the reduction within
    :data:`GRACE`, the failed process prints its exception and aborts all processes.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = duplicate(comm) if comm.size > 1 else None
        self.raised: BaseException | None = None  # latest exception that all processes raised

    def __call__(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function on all processes together; all raise if one raises."""
        if self._comm is None:
            return function(*arguments)
        error: BaseException | None = None
        try:
            value = function(*arguments)
        except BaseException as caught:
            error = caught
        self.synchronize(error)
        return value

    def synchronize(self, error: BaseException | None) -> None:
        """Raise on all processes if one of them has an exception; all processes call this method.

        Any other exception takes precedence over a failed step, after which the run may continue.
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
            _abort(comm)
        urgency, rank = divmod(int(first[0]), comm.size)
        if urgency == 2:
            return
        known = comm.bcast(portable(error) if comm.rank == rank else None, root=rank)
        self.raised = known if error is None or comm.rank != rank else error
        raise self.raised


def on_first(comm: MPI.Intracomm, action: Callable[[], object]) -> None:
    """Call ``action`` on the first process; all processes raise its exception."""
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


def portable(error: BaseException | None) -> BaseException | None:
    """Return an exception that can be pickled: ``error``, or a RuntimeError with its message."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _completed(*requests: MPI.Request) -> bool:
    """Wait at most :data:`GRACE` for communication; return whether it has completed."""
    end = time.monotonic() + GRACE
    while not MPI.Request.Testall(list(requests)):
        if time.monotonic() > end:
            return False
        time.sleep(1e-3)
    return True


def _abort(comm: MPI.Intracomm) -> None:
    """End all processes, and print the reason."""
    print(  # noqa: T201
        f"ufl_beam: process {comm.rank} of {comm.size} failed; the others have not failed within "
        f"{GRACE:g} s and may wait for it, so all are ended",
        file=sys.stderr,
    )
    sys.stdout.flush()
    sys.stderr.flush()
    time.sleep(0.3)  # mpirun forwards output, but not after an abort
    comm.Abort(1)


# -- uncaught exceptions ---------------------------------------------------------------------------


def _end(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Print an uncaught exception; abort unless all processes end with an exception.

    Nothing is printed if the output has no reader any more, as in ``script | head``.
    """
    if not (issubclass(kind, BrokenPipeError) and _write_to_nowhere()):
        _print_exception(kind, error, trace)
    if MPI.Is_finalized() or MPI.COMM_WORLD.size == 1:
        return
    # A process that ends waits in MPI_Finalize for all processes.  A collective call could match
    # a different collective call of another process, so messages are sent instead.
    world = MPI.COMM_WORLD
    others = [rank for rank in range(world.size) if rank != world.rank]
    told = [world.Isend(bytearray(), rank, FAILED) for rank in others]
    heard = [world.Irecv(bytearray(), rank, FAILED) for rank in others]
    if not _completed(*told, *heard):
        _abort(world)


def _write_to_nowhere() -> bool:
    """Return whether the output has no reader; if so, redirect it to the null device."""
    try:
        output = sys.stdout.fileno()
        poll = select.poll()
        poll.register(output, 0)
        broken = any(event & select.POLLERR for _, event in poll.poll(0))
    except (AttributeError, OSError, ValueError):  # closed, or no file
        return False
    if broken:
        os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    return broken


_print_exception = sys.excepthook
sys.excepthook = _end
atexit.register(_write_to_nowhere)
with suppress(ValueError):  # not in the main thread
    # PETSc has replaced Python's handler by a handler that prints a page of text.  Restore
    # Python's handler, so that writing raises BrokenPipeError.
    signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))


# -- output ----------------------------------------------------------------------------------------


def print_once(*words: object, sep: str = " ") -> None:
    """Print from the first process only, for scripts that may run under ``mpirun``.

    Example:
        >>> ub.print_once("steps:", len(solution.times) - 1)  # once, on any number of processes
        steps: 20
    """
    if active_comm().rank == 0:
        print(*words, sep=sep, flush=True)  # noqa: T201


def progress_bar(shown: bool, comm: MPI.Intracomm, **options: Any) -> Any:
    """Create a progress bar of tqdm; the first process shows it in a terminal or notebook.

    Members of a study and work of less than half a second have no visible bar.  In a notebook,
    TQDM_DISABLE=1 in the environment of the kernel hides bars, for example in documentation.

    Args:
        shown: Whether the user wants a bar.
        comm: Processes that share the work.
        options: Arguments of tqdm; ``total=1.0`` is for fractions of the work, in per cent.
    """
    if isinstance(options.get("total"), float):
        options["bar_format"] = "{percentage:3.0f}%|{bar}| [{elapsed}<{remaining}{postfix}]"
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if not shown or comm.rank > 0 or active_comm() != MPI.COMM_WORLD:
        options["disable"] = True
    elif shell is None or "IPKernelApp" not in shell.config:
        options["disable"] = None  # no bar unless the output is a terminal
    return tqdm(delay=DELAY, mininterval=DELAY, **options)


# -- redundant computation of a small scene --------------------------------------------------------

TOLERANCE = 1e-8
"""Largest relative difference of motions that count as equal; it is far above round-off."""

SMALLEST_SUBDOMAIN = 6_000
"""Least number of cells per process for sharing a scene; else each process computes it whole.

Measured with lattices on two cores: at some 3 000 cells each, two processes are as fast as one; at
6 000 cells each they are 1.2 times as fast.
"""

INTERVAL = 256  # largest number of steps between comparisons
LONGEST_WAIT = 20.0  # time for which a process waits for the other processes before it warns; s

_begun: list[tuple[MPI.Request, Array]] = []
"""Comparisons that may be incomplete.  MPI writes into their buffers until they are complete, also
after the end of the simulation."""


def sharing(comm: MPI.Intracomm, cells: int) -> MPI.Intracomm:
    """Return the communicator that shares a scene: ``comm``, or MPI.COMM_SELF for few cells."""
    return comm if cells >= comm.size * SMALLEST_SUBDOMAIN else MPI.COMM_SELF


class ProcessComparison:
    """Redundant computation of a small scene, once on each process.

    If a user's function draws random numbers or reads a clock, solutions may differ between
    processes.  So the processes compare a weighted sum of all states so far.  They compare in the
    background after 1, 2, 4, ... and then every :data:`INTERVAL` steps, and before results are
    written or returned.

    Attributes:
        several: True if several processes each compute the scene; else nothing is compared.
    """

    def __init__(
        self, comm: MPI.Intracomm, subdomain: Any
    ) -> None:  # a `Subdomain`, which this module must not import
        self.several = self._open = comm.size > subdomain.comm.size
        self._pending: tuple[MPI.Request, Array] | None = None
        if not self.several:
            return
        self._comm = duplicate(comm)
        random = np.random.default_rng(0).uniform(0.5, 1.0, subdomain.size)
        self._weights: Array = subdomain.numbering.scales[subdomain.dofs] * random
        self._sum = self._size = self._times = 0.0
        self._steps, self._compared = 0, 0

    def compare(self, t: float, q: Array) -> None:
        """Add the state after a step to the comparison; raise if an earlier comparison failed."""
        self._sum += float(self._weights @ q)
        self._size += float(self._weights @ np.abs(q))
        self._times += t
        self._steps += 1
        n = self._steps
        if n % INTERVAL == 0 or (n < INTERVAL and n & (n - 1) == 0):
            self._complete()
            self._post()

    def synchronize(self) -> None:
        """Compare all states so far, on all processes together; all raise if states differ."""
        if self._open and self._compared < self._steps:
            self._complete()
            self._post()
        self._complete()

    def finish(self) -> None:
        """Report to the other processes, without waiting, that this process stops."""
        if self._open:
            self._open = False
            self._post(failed=1.0)
            self._pending = None

    def _post(self, failed: float = 0.0) -> None:
        """Begin a comparison: find the largest and the smallest sum over all processes."""
        mine = np.array([self._sum, self._times, float(self._steps)])
        ends = np.concatenate([mine, -mine, [self._size, failed]])
        self._pending = self._comm.Iallreduce(MPI.IN_PLACE, ends, op=MPI.MAX), ends
        _begun[:] = [*(pair for pair in _begun if not pair[0].Test()), self._pending]
        self._compared = self._steps

    def _complete(self) -> None:
        """Complete a pending comparison; raise :class:`ProcessesDiffer` if states differ."""
        if self._pending is None:
            return
        (request, ends), self._pending = self._pending, None
        end = time.monotonic() + LONGEST_WAIT
        while not request.Test():
            time.sleep(0.0)  # another process may need this core
            if time.monotonic() > end:
                end = math.inf
                warn(
                    f"process {self._comm.rank} of {self._comm.size} waits for the others to "
                    "compute the same scene. Let all processes run it, or pass comm=MPI.COMM_SELF "
                    "where one process runs it alone"
                )
        apart, (size, failed) = ends[:3] + ends[3:6], ends[6:]
        allowed = TOLERANCE * np.array([size, abs(ends[1]) + abs(ends[4]), 0.0])
        if failed or (apart > allowed).any():
            self._open = False
            what = "find different motions"
            if failed:
                what = "continue differently: one of them has failed"
            raise ProcessesDiffer(
                f"the {self._comm.size} processes, each of which computes this small scene, "
                f"{what}, seen by process {self._comm.rank} after {self._steps} steps. Something "
                "in the scene differs between them: random numbers without a seed, a clock, the "
                "number of the process. Seed random generators, or draw on one process and send to "
                "the others (MPI.COMM_WORLD.bcast), or pass comm=MPI.COMM_SELF if each is to "
                "compute its own scene"
            )
