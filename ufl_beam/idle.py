"""Idle motions: those that have no inertia, and that no force resists or drives.

The node where several members meet has no mass of its own.  When all plastic hinges around it have
lost their strength, any rotation of the node is an equilibrium, and the tangent stiffness is
singular.  Newton's method then keeps the node where it is: an entry on the diagonal of the tangent
makes its equation solvable.  Residuals, hence forces, energies and solutions, know nothing of it.
"""

from __future__ import annotations

import numpy as np

from ufl_beam.compat import Array
from ufl_beam.grid import Index, Share
from ufl_beam.memory import Memory
from ufl_beam.null_vectors import free_matrix, null_vector
from ufl_beam.sparse import Csr

STIFFNESS = 0.01
"""Stiffness against an idle motion in the tangent, as a part of the largest one in the scene.

A motion that is resisted after all converges the faster, the smaller this is; round-off moves what
is idle the less, the larger it is.
"""

DRIVEN = 1e-6
"""Force, as a part of the forces in the scene, above which a motion is driven, and not idle."""


class IdleMotions:
    """Stiffnesses that the tangent has against idle motions; none until one is found.

    Args:
        share: The degrees of freedom of this process.
        A: The tangent.
        diagonal: Positions of the diagonal in its data.
        held: Local degrees of freedom that supports hold.

    Attributes:
        stiffness: At the local degrees of freedom; N/m, N m/rad.
    """

    def __init__(self, share: Share, A: Csr, diagonal: Index, held: Index) -> None:
        self._share, self._A, self._diagonal, self._held = share, A, diagonal, held
        self._turns = np.zeros(share.size, dtype=bool)
        self._turns[share.rotations()] = True
        self._moves = np.arange(share.size) < share.num_owned
        self._moves[share.multipliers()] = False
        self.stiffness: Array = np.zeros(share.size)

    @property
    def entries(self) -> tuple[Index, Array]:
        """Positions in the data of the tangent, and what is added there."""
        here = np.flatnonzero(self.stiffness)
        return self._diagonal[here].astype(np.int32), self.stiffness[here]

    def find(self, forces: Array, scale: float) -> bool:
        """Look for one more idle motion of the latest tangent; all processes call it together.

        Args:
            forces: Sizes of the latest residual at the local degrees of freedom, moments over the
                size of the scene; N.
            scale: Size of the forces in the scene; N.

        Returns:
            Whether there is one.
        """
        share = self._share
        K, free = free_matrix(share, self._A, self._held)
        if not len(free) or not np.isfinite(K.data).all():
            return False
        try:
            _, vector = null_vector(K)
        except (np.linalg.LinAlgError, RuntimeError):
            return False
        everywhere = np.zeros(share.grid.size)
        everywhere[free] = np.abs(vector)
        motion: Array = np.where(self._moves, everywhere[share.dofs], 0.0)
        motion[~self._turns] /= share.grid.scene.size
        largest = share.largest(float(motion.max(initial=0.0)))
        if not 0.0 < largest < np.inf:
            return False
        idle = (motion == largest) & (self.stiffness == 0.0) & (forces <= DRIVEN * scale)
        diagonal = np.abs(self._A.data[self._diagonal])
        for alike in (self._turns, ~self._turns):
            stiffest = share.largest(float(diagonal[alike & self._moves].max(initial=0.0)))
            self.stiffness[idle & alike] = STIFFNESS * stiffest
        return share.total(float(idle.any())) > 0.0

    def forget(self) -> bool:
        """Take all stiffnesses away; return whether there were any, on any process."""
        some = self._share.largest(float(self.stiffness.max(initial=0.0))) > 0.0
        self.stiffness[:] = 0.0
        return some

    def remember(self, memory: Memory) -> None:
        """Pass on the stiffnesses."""
        self.stiffness[:] = memory.at_dofs("idle motions", self.stiffness)
