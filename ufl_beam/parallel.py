# SPDX-License-Identifier: MIT
"""Which processes compute a scene together: all of them, or within a study one alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from mpi4py import MPI

from ufl_beam.errors import SceneError, shorten

_ACTIVE: ContextVar[MPI.Intracomm] = ContextVar("processes of a scene", default=MPI.COMM_WORLD)


def active_comm() -> MPI.Intracomm:
    """Return the processes that compute a scene, unless a call names others."""
    return _ACTIVE.get()


def communicator(comm: MPI.Intracomm | None, what: str) -> MPI.Intracomm:
    """Return the processes of a call: those that it names, or by default :func:`active_comm`."""
    if comm is None:
        return active_comm()
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        raise SceneError(f"{what} = {shorten(comm)} must be a communicator, such as MPI.COMM_SELF")
    return comm


@contextmanager
def alone() -> Iterator[None]:
    """Within this context a scene is computed by this process alone."""
    before = _ACTIVE.set(MPI.COMM_SELF)
    try:
        yield
    finally:
        _ACTIVE.reset(before)


def in_study() -> bool:
    """Return whether this is a member of a study, which shows no progress of its own."""
    return _ACTIVE.get() != MPI.COMM_WORLD


def say(*words: object, sep: str = " ") -> None:
    """Print from the first process only, as scripts do that may run under ``mpirun``.

    Example:
        >>> ub.say("steps:", len(solution.times) - 1)  # once, on any number of processes
        steps: 20
    """
    if active_comm().rank == 0:
        print(*words, sep=sep, flush=True)  # noqa: T201
