# SPDX-License-Identifier: MIT
"""PETSc vectors of the unknowns of a scene, and their local values."""

from __future__ import annotations

from petsc4py import PETSc

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import ffi, petsc
from ufl_beam.discretization.partition import Share


class Vectors:
    """Vectors of the unknowns; where processes share a scene, with ghosts."""

    def __init__(self, share: Share) -> None:
        self._share, self._views = share, dict[int, Array]()
        self.parallel = not share.alone

    def new(self) -> PETSc.Vec:
        """Make a vector of the unknowns, shared like them."""
        share = self._share
        if not self.parallel:
            return PETSc.Vec().createSeq(share.size)
        size = (share.num_owned, share.grid.size)
        return PETSc.Vec().createGhost(share.ghosts, size=size, comm=share.comm)

    def view(self, vector: PETSc.Vec, writable: bool = False) -> Array:
        """Local values of a vector, ghosts included; PETSc keeps them where they are."""
        handle = vector.handle
        view = self._views.get(handle)
        if view is None:
            if self.parallel:
                with vector.localForm() as local:
                    view = local.array_w
            else:
                view = vector.array_w if writable else vector.array_r
            self._views[handle] = view
        return view

    def update_ghosts(self, vector: PETSc.Vec) -> None:
        """Copy values that other processes own; PETSc copies between vectors without them."""
        if self.parallel:
            vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

    def add_ghosts(self, vector: PETSc.Vec) -> None:
        """Add to values of other processes what this one has for them."""
        if self.parallel:
            vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)


def unlock(vector: PETSc.Vec) -> None:
    """Let a vector be written again that PETSc keeps locked after a linear solve has failed."""
    state = ffi.new("petsc_int *")
    petsc("VecLockGet", vector, state)
    for _ in range(state[0]):
        petsc("VecLockReadPop", vector)
