# SPDX-License-Identifier: MIT
"""Cost model of several processes: work, bytes and messages counted in runs, and extrapolated."""

import pickle
import time
from collections import Counter

import numpy as np

from ufl_beam.compiled.c_library import doubles, ffi, lib
from ufl_beam.discretization.partition import bisect

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
    summed = solver._factors._solved._inner
    summed._comm = Counted(summed._comm, count)
    ghosts, update = 8 * len(simulation.subdomain.ghosts), lib.petsc.VecGhostUpdateBegin

    def counted(vector, *how):
        count.update(messages=1, bytes=ghosts)
        return update(vector, *how)

    solver.counted = ffi.callback(ffi.typeof(update), counted)  # C calls it: it stays alive
    lib.petsc.VecGhostUpdateBegin = solver.counted
    return count


def front_flops(pivots, others):
    """Operations of the elimination of pivots in dense fronts with other unknowns."""
    left = [np.arange(m, p + m, dtype=float) for p, m in zip(pivots, others, strict=True)]
    return float(sum(np.sum(n + 2 * n**2) for n in left))


def work(simulation):
    """Sizes of the part of this process: cells, unknowns of joints, operations, entries."""
    factors = simulation.solver._factors
    fronts, entries = factors._solved, factors._elimination.left
    found = {
        "cells_here": len(simulation.subdomain.cells),
        "joints_here": entries.size,
        "ghosts": len(simulation.subdomain.ghosts),
    }
    if not simulation.subdomain.alone:
        summed, fronts = fronts._inner.left, fronts._inner._inner
        sizes = {"border": summed.size, "border_entries": len(summed.data)}
        found |= {"border_here": fronts.left.size, **sizes}
    c, begin = fronts.c, time.perf_counter()
    for _ in range(3):
        lib.factor_fronts(c, doubles(entries.data))
    found["s_of_flops"] = (time.perf_counter() - begin) / 3
    found["flops"] = front_flops(*(np.diff(list(x[0 : c.fronts])) for x in (c.first, c.begin)))
    return found


def borders(numbering, ranks):
    """Unknowns that several of so many processes have, in all and of one process at most."""
    part = bisect(numbering.points[numbering.cells].mean(axis=1), ranks)
    of_cell = numbering.dofs[numbering.cells].reshape(len(part), 6)
    pairs = np.unique(of_cell.astype(np.int64) * ranks + part[:, None])
    dofs, ranks_of = pairs // ranks, pairs % ranks
    shared = np.bincount(dofs, minlength=numbering.size)[dofs] > 1
    return len(np.unique(dofs[shared])), int(np.bincount(ranks_of[shared]).max(initial=0))


def fitted(whole, half, shared):
    """Numbers of the model, from one process with all cells and with half, and from two."""
    flops, rate = whole["flops"], whole["flops"] / whole["s_of_flops"]
    cells, fewer = whole["cells"], half["cells"]
    bytes_whole, bytes_half, bytes_shared = (
        1e6 * max(one["memory_mb"]) for one in (whole, half, shared)
    )
    # On one process all cells count twice: in the numbering of the scene, and as its own.
    both = (bytes_whole - bytes_half) / (cells - fewer)
    own = 2 * (bytes_whole - bytes_shared) / cells
    return {
        "cells": cells, "flops": flops, "flops_per_s": rate,
        "s_per_cell": (1e-3 * whole["ms_per_iteration"] - flops / rate) / cells,
        "messages": shared["messages_per_iteration"],
        "memory": (bytes_whole - both * cells, both - own, own),
    }  # fmt: skip


def extrapolated(cells, ranks, model, border, part, growth):
    """Seconds of an iteration by parts, and bytes of a process.

    ``border`` unknowns belong to several processes, ``part`` of them to one process at most.
    ``growth`` is the exponent with which operations for joints grow with cells: 1 in a tower, 1.5
    in a square lattice.
    """
    here, rate = cells / ranks, model["flops_per_s"]
    # The last separator of the borders couples to itself only: in a tower a border, in a square
    # the borders between its halves.
    separator = max(part / 2, border / 4 if growth > 1 else 0)
    entries = border * min(border, 2 * part)
    seconds = {
        "cells": model["s_per_cell"] * here,
        "joints": model["flops"] * (here / model["cells"]) ** growth / rate,
        "borders": 2 / 3 * separator**2 * border / rate,
        "messages": model["messages"] * LATENCY * np.log2(ranks) + 16 * entries / BANDWIDTH,
    }
    fixed, whole_scene, own = model["memory"]
    return seconds, fixed + whole_scene * cells + own * here + 8 * part**2 + 16 * entries
