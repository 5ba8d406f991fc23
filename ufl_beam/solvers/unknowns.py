# SPDX-License-Identifier: MIT
"""Unknowns of an equation, as far as solvers know them: numbers, owners and kinds."""

from __future__ import annotations

from typing import Protocol

from mpi4py import MPI

from ufl_beam.arrays import Array, Index


class Sized(Protocol):
    """A scene, of which solvers know the size."""

    @property
    def size(self) -> float:
        """Size of the scene; m."""


class Numbering(Protocol):
    """Degrees of freedom of the whole scene, see :class:`Grid`."""

    size: int

    @property
    def rotations(self) -> Index:
        """Degrees of freedom that are rotations."""

    @property
    def multipliers(self) -> Index:
        """Degrees of freedom that are forces of connectors."""

    @property
    def scene(self) -> Sized:
        """The scene."""

    def worst(self, sizes: Array) -> dict[str, float]:
        """Describe where sizes at the degrees of freedom are largest."""


class Unknowns(Protocol):
    """Degrees of freedom of one process, see :class:`Share`."""

    comm: MPI.Intracomm
    dofs: Index
    num_owned: int
    ghosts: Index
    cell_dofs: Index

    @property
    def grid(self) -> Numbering:
        """Numbering of the whole scene."""

    @property
    def size(self) -> int:
        """Number of local degrees of freedom, ghosts included."""

    def rotations(self) -> Index:
        """Local numbers of rotations."""

    def multipliers(self) -> Index:
        """Local numbers of forces of connectors."""

    def lengths(self) -> Array:
        """Lengths whose last digits displacements and rotations have; m."""

    def gather(self, values: Array) -> Array:
        """Values at all degrees of freedom, on every process."""

    def total(self, here: float) -> float:
        """Sum over the processes."""

    def largest(self, here: float) -> float:
        """Maximum over the processes."""
