# SPDX-License-Identifier: MIT
"""Which processes compute a scene together: all of them, or within a study one alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from mpi4py import MPI

from ufl_beam.errors import SceneError, shorten

_OURS: ContextVar[MPI.Intracomm] = ContextVar("processes of a scene", default=MPI.COMM_WORLD)


def ours() -> MPI.Intracomm:
    """The processes that a scene is computed by, unless a call says others."""
    return _OURS.get()


def communicator(comm: MPI.Intracomm | None, what: str) -> MPI.Intracomm:
    """Return the processes of a call: those that it names, or by default :func:`ours`.

    Raises:
        SceneError: Not a communicator of mpi4py.
    """
    if comm is None:
        return ours()
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        raise SceneError(f"{what} = {shorten(comm)} must be a communicator, such as MPI.COMM_SELF")
    return comm


@contextmanager
def alone() -> Iterator[None]:
    """Within this context a scene is computed by this process alone."""
    before = _OURS.set(MPI.COMM_SELF)
    try:
        yield
    finally:
        _OURS.reset(before)


def in_study() -> bool:
    """Return whether this is a member of a study, which shows no progress of its own."""
    return _OURS.get() != MPI.COMM_WORLD


def say(*words: object, sep: str = " ") -> None:
    """Print from the first process only, as scripts do that may run under ``mpirun``.

    Example:
        >>> ub.say("steps:", len(solution.times) - 1)  # once, on any number of processes
        steps: 20
    """
    if ours().rank == 0:
        print(*words, sep=sep, flush=True)  # noqa: T201
