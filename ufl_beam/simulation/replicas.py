# SPDX-License-Identifier: MIT
"""Check of processes that compute copies of one small scene: all must find the same motion."""

from __future__ import annotations

import math
import time

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import CopiesDiffer, warn
from ufl_beam.parallel import duplicate

TOLERANCE = 1e-8
"""Difference of motions that counts, as a part of their size: far above round-off."""

SMALLEST_SHARE = 6_000
"""Scenes with fewer cells per process are computed by each process.

Measured on two cores with lattices: two processes break even at some 3 000 cells each, and are 1.2
times as fast at 6 000; see benchmarks/README.md.
"""

INTERVAL = 256
"""Most steps from one comparison to the next."""

PATIENCE = 20.0
"""Time for which a process waits for the others before it says so; s."""

_left: list[tuple[MPI.Request, Array]] = []
"""Comparisons that nobody waits for; MPI needs their buffers until they are complete."""


def sharing(comm: MPI.Intracomm, cells: int) -> MPI.Intracomm:
    """Return the processes that share a scene with so many cells: all, or this one alone."""
    return comm if cells >= comm.size * SMALLEST_SHARE else MPI.COMM_SELF


class Copies:
    """Copies of a small scene, one on each process.

    A function of the user that draws random numbers, or reads a clock, gives each process another
    scene and another solution.  So all processes compare a weighted sum of all states so far: in
    the background after 1, 2, 4, ... and then every :data:`INTERVAL` steps, and before anything is
    written or given back.
    """

    def __init__(self, comm: MPI.Intracomm, share: Share) -> None:
        self._comm = duplicate(comm)
        scales: Array = np.full(share.size, 1 / share.grid.scene.size)
        scales[share.rotations()] = 1.0
        scales[share.multipliers()] = 0.0
        self._weights = scales * np.random.default_rng(0).uniform(0.5, 1.0, len(scales))
        self._sum = self._size = self._times = 0.0
        self._steps, self._compared = 0, 0
        self._pending: tuple[MPI.Request, Array] | None = None
        self._open = True
        _left[:] = [one for one in _left if not one[0].Test()]

    def note(self, t: float, q: Array) -> None:
        """Take the state after a step into the comparison; raise if an earlier one failed."""
        self._sum += float(self._weights @ q)
        self._size += float(self._weights @ np.abs(q))
        self._times += t
        self._steps += 1
        n = self._steps
        if n % INTERVAL == 0 or (n < INTERVAL and n & (n - 1) == 0):
            self._complete()
            self._post()

    def settle(self) -> None:
        """Compare all states so far, together; all processes raise if they are not the same."""
        if self._open and self._compared < self._steps:
            self._complete()
            self._post()
        self._complete()

    def leave(self) -> None:
        """Tell the others, without waiting for them, that this process does not go on."""
        if self._open:
            before, self._open = self._pending, False
            self._post(failed=1.0)
            _left.extend(one for one in (before, self._pending) if one is not None)
            self._pending = None

    def _post(self, failed: float = 0.0) -> None:
        """Begin a comparison: the largest and the smallest of what the processes have."""
        mine = np.array([self._sum, self._times, float(self._steps)])
        ends = np.concatenate([mine, -mine, [self._size, failed]])
        self._pending = self._comm.Iallreduce(MPI.IN_PLACE, ends, op=MPI.MAX), ends
        self._compared = self._steps

    def _complete(self) -> None:
        """Wait for a comparison that was begun."""
        if self._pending is None:
            return
        (request, ends), self._pending = self._pending, None
        self._wait(request)
        apart, (size, failed) = ends[:3] + ends[3:6], ends[6:]
        allowed = TOLERANCE * np.array([size, abs(ends[1]) + abs(ends[4]), 0.0])
        if failed or (apart > allowed).any():
            self._open = False
            what = "find different motions"
            if failed:
                what = "go on differently: one of them has failed"
            raise CopiesDiffer(
                f"the {self._comm.size} processes, each of which computes this small scene, "
                f"{what}, seen by process {self._comm.rank} after {self._steps} steps. Something "
                "in the scene differs between them: random numbers without a seed, a clock, the "
                "number of the process. Seed random generators, or draw on one process and send to "
                "the others (MPI.COMM_WORLD.bcast), or pass comm=MPI.COMM_SELF if each is to "
                "compute its own scene"
            )

    def _wait(self, request: MPI.Request) -> None:
        end = time.monotonic() + PATIENCE
        while not request.Test():
            time.sleep(0.0)  # the others may need this core
            if time.monotonic() > end:
                end = math.inf
                warn(
                    f"process {self._comm.rank} of {self._comm.size} waits for the others to "
                    "compute the same scene. Let all processes run it, or pass comm=MPI.COMM_SELF "
                    "where one alone does"
                )
