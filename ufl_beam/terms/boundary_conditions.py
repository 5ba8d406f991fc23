# SPDX-License-Identifier: MIT
"""Supports and prescribed motions: degrees of freedom with prescribed values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, integers, lib, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import ModelError
from ufl_beam.mechanics.time_scheme import Scheme, Step, acts_at_end
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.functions import TimeFunction, still, value_at
from ufl_beam.model.supports import Support
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks


class Supports:
    """Supports of a scene: constrained and prescribed degrees of freedom, reactions.

    The solver uses unknowns and residuals in the axes of the supports, which may be rotated.  The
    terms use unknowns and residuals in the global axes of the plane.  :meth:`into_axes` and
    :meth:`into_plane` transform vectors.

    Attributes:
        dofs: Local degrees of freedom that supports, or the ground, constrain.
        reactions: Forces of the supports on the scene in the latest residual, at ``dofs``, in the
            axes of the supports.
        entries: Matrix entries in the rows and columns of ``dofs``; diagonal entries of ``dofs``.
        pivots: Values of the diagonal entries of ``dofs`` in the constrained matrix.
        turned, axes: Number of rotations of axes; their ``turned_axes`` of loops.h.
        motions: Each moving local degree of freedom, its function of time, and its support.
        about: Supports of the scene in space with an axis, on any process.
        hinges: Each of these on this process, and the rotations of its node, (3,), of which the
            last one is about the axis.  Those with a prescribed rotation are first.
        angles: Rotations of the hinges; rad.
        moving: Local degrees of freedom whose values depend on time.
        work: True if any support of the scene, on any process, moves.
    """

    def __init__(self, subdomain: Subdomain, scheme: Scheme, ledger: Ledger, A: Csr) -> None:
        turned: list[tuple[Any, ...]] = []
        constrained: list[int] = []
        self.motions: list[tuple[int, TimeFunction, Support]] = []
        if GROUND in subdomain.numbering.scene.rigid_bodies:
            constrained.extend(subdomain.local(subdomain.numbering.node(GROUND.middle)))
        self._fixed, self._near = list[int](), 1e-9 * subdomain.numbering.scene.size
        free, driven = list[tuple[Support, Index]](), list[tuple[Support, Index]]()
        of_hinges = list[tuple[int, TimeFunction, Support]]()
        for support in subdomain.numbering.scene.supports:
            dofs = subdomain.numbering.node(support.place)
            for i, j, angle in support.turns:
                if len(pair := subdomain.local(dofs[[i, j]])):
                    turned.append(_turned_axes(pair, angle, A))
            for component, motion in support.held.items():
                local_dofs = subdomain.local(dofs[[component]])
                constrained.extend(local_dofs)
                if support.displacements == 3 > component and support.turns and motion == still:
                    self._fixed.extend(local_dofs)
                if component in support.moving:
                    group = (
                        of_hinges if support.axis is not None and component == 5 else self.motions
                    )
                    group.extend((dof, motion, support) for dof in local_dofs)
            if support.axis is not None:
                own = support, subdomain.local(dofs[3:])
                if len(own[1]):
                    (driven if 5 in support.moving else free).append(own)
        self.motions += of_hinges
        self.hinges, self._driven = [*driven, *free], len(driven)
        self.turned, self.axes, self._alive = len(turned), ffi.new("turned_axes[]", turned), turned
        self.dofs = np.array(sorted(constrained), dtype=np.int64)
        self.moving = np.array([dof for dof, *_ in self.motions], dtype=np.int64)
        is_constrained = np.zeros(A.size, dtype=bool)
        is_constrained[self.dofs] = True
        columns, rows = np.flatnonzero(is_constrained[A.indices]), A.entries_of(self.dofs)
        self.entries = np.union1d(columns, rows), A.positions(self.dofs, self.dofs)
        self.pivots: Array = np.ones(len(self.dofs))
        self._scheme, self._ledger, self._subdomain = scheme, ledger, subdomain
        supports = subdomain.numbering.scene.supports
        self.work = any(support.moving for support in supports)
        self.about = [support for support in supports if support.axis is not None]
        if self.work:
            ledger.supplied["supports"] += 0.0
        self.angles: Array = np.zeros(len(self.hinges))
        self.reactions: Array = np.zeros(len(self.dofs))
        self._before: Array = self.reactions.copy()

    def into_axes(self, x: Array) -> None:
        """Transform ``x`` from the axes of the plane to the axes of the supports, in place."""
        lib.turn_axes(self.turned, self.axes, doubles(x), 1)

    def into_plane(self, x: Array) -> None:
        """Transform ``x`` from the axes of the supports to the axes of the plane, in place."""
        lib.turn_axes(self.turned, self.axes, doubles(x), -1)

    def in_axes(self, q: Array) -> Array:
        """Return ``q`` in the axes of the supports; a copy only if an axis is turned."""
        if self.turned:
            self.into_axes(q := q.copy())
        return q

    def in_plane(self, x: Array) -> Array:
        """Return ``x`` in the axes of the plane; a copy only if an axis is turned."""
        if self.turned:
            self.into_plane(x := x.copy())
        return x

    def move(self, x: Array, x0: Array, step: Step) -> None:
        """Set prescribed values in ``x``, the end of a step that begins with unknowns ``x0``."""
        for dof, motion, support in self.motions:
            target = value_at(motion, step.motion_time, support)
            x[dof] = x0[dof] + step.fraction * (target - x0[dof])

    def in_c(self, callbacks: Callbacks) -> Any:
        """Return ``moving_supports`` of loops.h: prescribed motions, and the work of reactions."""
        moves = [(motion, support) for _, motion, support in self.motions]
        entry = self._ledger.supplied.pointer("supports") if self.work else ffi.NULL
        held = {int(dof): i for i, dof in enumerate(self.dofs)}
        hinges = [
            (int(dofs[2]), [held[int(dof)] for dof in dofs[:2]], held.get(int(dofs[2]), -1))
            for _, dofs in self.hinges
        ]
        return struct(
            "moving_supports", held=len(self.dofs), hold=self.dofs.astype(np.int32),
            moving=len(moves), dof=self.moving.astype(np.int32),
            motion=callbacks.time_functions(moves), reactions=self.reactions,
            before=self._before, work=entry, weight_of_before=self._scheme.weight_of_before,
            fixed=len(self._fixed), fix=np.array(self._fixed, dtype=np.int32), near=self._near,
            hinges=len(hinges), driven=self._driven, at_end=acts_at_end(self._scheme),
            hinge=ffi.new("hinge_support[]", hinges), angle=self.angles,
        )  # fmt: skip

    def hold(self, r: Array) -> None:
        """Store the reactions in the summed residual ``r``, and set its entries to zero."""
        if len(self.dofs):
            self.reactions[:] = r[self.dofs]
            r[self.dofs] = 0.0

    def stop(self, v: Array) -> None:
        """Set velocities at fixed supports to zero, in place; otherwise they would oscillate."""
        self.into_axes(v)
        moving = v[self.moving]
        v[self.dofs] = 0.0
        v[self.moving] = moving
        self.into_plane(v)

    def commit(self) -> None:
        """Accept the latest reactions."""
        self._before[:] = self.reactions

    def go_back(self) -> None:
        """Return to the reactions of the accepted state after a failed step."""
        self.reactions[:] = self._before

    def carry_on(self, archive: Archive, q: Array) -> None:
        """Save or restore the reactions in the equation of the last step, and angles of hinges."""
        reactions: Array = np.zeros(len(q))
        reactions[self.dofs] = self._before
        self.reactions[:] = archive.at_dofs("reactions", reactions)[self.dofs]
        self.commit()
        about = [int(dofs[2]) for _, dofs in self.hinges]
        if about and (not archive.restores or archive.has("angles of hinges")):
            angles: Array = np.zeros(len(q))
            angles[about] = self.angles
            self.angles[:] = archive.at_dofs("angles of hinges", angles)[about]

    @property
    def angle_of(self) -> dict[Support, float]:
        """Angles of the supports :attr:`about` an axis; rad.  All processes read it together."""
        own = [(self.about.index(x), a) for (x, _), a in zip(self.hinges, self.angles, strict=True)]
        everyone = [own] if self._subdomain.alone else self._subdomain.comm.allgather(own)
        return {self.about[i]: float(angle) for some in everyone for i, angle in some}

    def find_angles(self, turns: Callable[[Support], Array], t: float) -> None:
        """Set the angles of hinges from rotation vectors of their places, ``turns``.

        Whole turns are those of the prescribed rotation at the time ``t``.

        Raises:
            ModelError: The place of a hinge has turned about another axis.
        """
        of_node = [support for support, _ in self.hinges]
        for support in self.about:  # all processes raise
            turn, axis = turns(support), np.array(support.axis) / np.linalg.norm(support.axis)
            angle = float(turn @ axis)
            whole = value_at(support.moving[5], t, support) - angle if 5 in support.moving else 0.0
            if support in of_node:
                turns_so_far = 2 * math.pi * round(whole / (2 * math.pi))
                self.angles[of_node.index(support)] = angle + turns_so_far
            if np.abs(turn - angle * axis).max() > 1e-9:
                raise ModelError(
                    f"start: {support} turns about {support.axis}, but its place has turned about "
                    "another axis; use Revolute and the ground, or another axis"
                )

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the reactions and the pivots."""
        self.carry_on(archive, q)
        pivots = np.zeros(len(q))
        pivots[self.dofs] = self.pivots
        self.pivots[:] = archive.at_dofs("pivots", pivots)[self.dofs]


def _turned_axes(dofs: Index, angle: float, A: Csr) -> tuple[Any, ...]:
    """Return fields of ``turned_axes`` of loops.h for a support at an ``angle``; rad."""
    rows = [np.arange(A.indptr[d], A.indptr[d + 1], dtype=np.int32) for d in dofs]
    # Both dofs belong to the same cells, so their rows and columns have the same pattern.
    columns = [np.flatnonzero(A.indices == d).astype(np.int32) for d in dofs]
    sizes, indices = (len(rows[0]), len(columns[0])), map(integers, (*rows, *columns))
    return *map(int, dofs), *sizes, math.cos(angle), math.sin(angle), *indices
