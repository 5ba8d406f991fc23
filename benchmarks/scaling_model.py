# SPDX-License-Identifier: MIT
"""Cost model of several processes: work, bytes and messages counted in runs, and extrapolated."""

import pickle
import time
from collections import Counter

import numpy as np

from ufl_beam.compiled.c_library import ffi, lib

COLLECTIVE = (
    "allreduce", "Allreduce", "Iallreduce", "allgather", "Allgather", "Allgatherv", "bcast",
)  # fmt: skip
LATENCY, BANDWIDTH = 20e-6, 5e9  # s of a collective call on a cluster, B/s: assumed


class Counted:
    """A communicator that counts collective calls and the bytes that this process gives."""

    def __init__(self, comm, count):
        self._comm, self._count = comm, count

    def __getattr__(self, name):
        function = getattr(self._comm, name)
        if name not in COLLECTIVE:
            return function

        def call(*arguments, **named):
            if name[0].isupper():
                size = next(x.nbytes for x in arguments if isinstance(x, np.ndarray))
            else:
                size = len(pickle.dumps(arguments[0]))
            self._count.update(messages=1, bytes=size)
            return function(*arguments, **named)

        return call


def count_traffic(simulation):
    """Count the collective calls, ghost updates and bytes of a simulation from now on."""
    count, solver = Counter(), simulation.solver
    if simulation.subdomain.alone:
        return count
    simulation.subdomain.comm = Counted(simulation.subdomain.comm, count)
    simulation.together._comm = Counted(simulation.together._comm, count)
    summed = solver._factors._factors._inner
    summed._comm = Counted(summed._comm, count)
    ghosts, update = 8 * len(simulation.subdomain.ghosts), lib.petsc.VecGhostUpdateBegin

    def counted(vector, *how):
        count.update(messages=1, bytes=ghosts)
        return update(vector, *how)

    solver.counted = ffi.callback(ffi.typeof(update), counted)  # C calls it: it stays alive
    lib.petsc.VecGhostUpdateBegin = solver.counted
    return count


def work(simulation):
    """Sizes of the part of this process, of the sum of all parts, and the time of its factors."""
    factors = simulation.solver._factors
    reduced = factors._factors._inner.left
    begin = time.perf_counter()
    for _ in range(3):
        lib.factorize(factors._factors.c)
    return {
        "cells_here": len(simulation.subdomain.cells),
        "joints_here": factors._elimination.left.size, "joints": reduced.size,
        "entries": len(reduced.data), "s_of_joints": (time.perf_counter() - begin) / 3,
        "ghosts": len(simulation.subdomain.ghosts),
    }  # fmt: skip


def fitted(whole, half, shared):
    """Numbers of the model, from one process with all cells and with half, and from two."""
    cells, fewer = whole["cells"], half["cells"]
    bytes_whole, bytes_half, bytes_shared = (
        1e6 * max(one["memory_mb"]) for one in (whole, half, shared)
    )
    # On one process all cells count twice: in the numbering of the scene, and as its own.
    both = (bytes_whole - bytes_half) / (cells - fewer)
    own = 2 * (bytes_whole - bytes_shared) / cells
    return {
        "cells": cells, "entries": whole["entries"], "s_of_joints": whole["s_of_joints"],
        "s_per_cell": (1e-3 * whole["ms_per_iteration"] - whole["s_of_joints"]) / cells,
        "messages": shared["messages_per_iteration"],
        "memory": (bytes_whole - both * cells, both - own, own),
    }  # fmt: skip


def extrapolated(cells, ranks, model, growth):
    """Seconds of an iteration by parts, and bytes of a process.

    ``growth`` is the exponent with which operations for joints grow with cells: 1 in a tower, 1.5
    in a square lattice.
    """
    larger = cells / model["cells"]
    bytes_sent = 16 * model["entries"] * larger * (ranks > 1)
    seconds = {
        "cells": model["s_per_cell"] * cells / ranks,
        "joints": model["s_of_joints"] * larger**growth,
        "messages": model["messages"] * LATENCY * np.log2(ranks) + bytes_sent / BANDWIDTH,
    }
    fixed, whole_scene, own = model["memory"]
    return seconds, fixed + whole_scene * cells + own * cells / ranks
