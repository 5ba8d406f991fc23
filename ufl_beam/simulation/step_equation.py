# SPDX-License-Identifier: MIT
"""The equation of a step, from the terms of a scene; and its derivatives about a state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, lib
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.tangents import Tangents
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.solvers.equation import Equation
from ufl_beam.terms.base import InternalForces, Term
from ufl_beam.terms.links import Links
from ufl_beam.terms.loads import LoadTerm
from ufl_beam.terms.openings import SearchFlags
from ufl_beam.terms.supports import Supports
from ufl_beam.terms.tangent_derivatives import Cells


class StepEquation(Equation):
    """Sum of the virtual works of all terms, less what supports carry.

    The ``others`` are all terms but those of internal forces.
    """

    def __init__(
        self,
        share: Share,
        A: Csr,
        beams: Sequence[Cells],
        couplings: Sequence[Links],
        loads: Sequence[LoadTerm],
        others: Sequence[Term],
        supports: Supports,
        search: SearchFlags,
        *,
        in_motion: bool,
    ) -> None:
        # Where nothing has inertia, the work of the internal forces is compared with energies.
        force = np.zeros(0 if in_motion else share.size)
        super().__init__(A, share.weights(), force, supports.dofs)
        self.share, self.supports, self._search = share, supports, search
        self._beams, self._couplings, self._loads = beams, couplings, loads
        self.inner: list[InternalForces] = [*beams, *couplings]
        self.others: list[Term] = [*loads, *others]
        self.terms: list[Term] = [*self.inner, *self.others]
        predicted = share.largest(float(any(one.demand() is not None for one in beams)))
        self._tangent_in_c = False  # in C
        fill(self.c, switched=search.switched)
        if not share.grid.scene.links and predicted == 0.0:  # in any process
            self.demand([])

    def begin(self, step: Step) -> None:
        """Let all terms begin a step."""
        for term in self.terms:
            term.begin(step)

    def load_forces(self) -> list[Array]:
        """Vectors of the loads in the present step; new arrays where they have changed."""
        return [load.force for load in self._loads]

    def residual(self, x: Array, r: Array) -> None:
        """Write the local part of the residual at ``x`` into ``r``."""
        q1 = self.supports.in_plane(x)
        r.fill(0.0)
        for inner in self.inner:
            inner.add_residual(q1, r)
        lib.note_inner_forces(self.c, doubles(r))
        for term in self.others:
            term.add_residual(q1, r)
        self.supports.enter(r)

    def complete(self, r: Array) -> None:
        """Note the reactions in the summed residual, and remove them from it."""
        self.supports.hold(r)

    def tangent(self, x: Array) -> None:
        """Fill the matrix with the derivative at ``x``."""
        self._assemble(self.supports.in_plane(x))
        self.supports.hold_matrix(self.A.data)

    def _assemble(self, q1: Array) -> None:
        if self._tangent_in_c:
            lib.fill_tangent(self.c, doubles(q1))
            return
        self.A.data.fill(0.0)
        for term in self.terms:
            term.add_tangent(q1)

    def tangent_at(self, x: Array, v: Array, r: Array) -> Csr:
        """Return the tangent at ``x``; add to ``r`` what it makes of a motion ``v`` of supports.

        All are in the axes of the supports, and the local part.
        """
        self._assemble(self.supports.in_plane(x))
        if len(self.supports.moving):
            forces = Product(self.A)(self.supports.in_plane(v))
            self.supports.enter(forces)
            r += forces
        self.supports.hold_matrix(self.A.data)
        return self.A

    def respond_at(self, q1: Array) -> bool:
        """Evaluate forces and tangent of the present step at ``q1``; false if a process cannot."""
        x, failed = self.supports.in_axes(q1), 0.0
        self.restart(Tangents.EXACT)
        try:
            self.residual(x, np.zeros(self.share.size))
            self.tangent(x)
        except StepFailed:
            failed = 1.0
        return self.share.largest(failed) == 0.0

    def restart(self, tangents: Tangents) -> None:
        """Begin to iterate anew, with tangents of this kind."""
        for inner in self.inner:
            inner.restart(tangents)

    def stiffen(self, stiff: bool) -> bool:
        """Begin again with stiff points, or end that; return whether it makes a difference."""
        opened = bool(self.share.largest(float(self._search.opened)))
        self._search.stiffen(stiff and opened)
        if stiff:
            for coupling in self._couplings:
                coupling.again()
        return opened

    def missed(self, x: Array, r: Array, scale: float, moved: float) -> float:
        """Return the largest residual of the laws of connectors and points, without dimension."""
        q1 = self.supports.in_plane(x)
        here = max((c.excess(q1, r, scale, moved) for c in self._couplings), default=0.0)
        return self.share.largest(max([here, *(one.missed(q1, scale) for one in self._beams)]))

    def working(self, x: Array, y: Array) -> Array:
        """Return the conjugates of residuals in the step ``y`` from ``x``."""
        q, v, works = self.supports.in_plane(x), self.supports.in_plane(y), y.copy()
        for coupling in self._couplings:
            coupling.put_motions(q, v, works)
        return works

    # -- in C ----------------------------------------------------------------------------------

    def leave_to_c(self) -> None:
        """Let SNES call the loops of the terms in C, with no Python between them.

        What has no loop takes part by a call of Python.  Where several processes share a scene, and
        where supports are at an angle, SNES calls Python: the same terms, in the same order; the
        tangent is added up in C if all terms have loops.
        """
        supports = self.supports
        self._tangent_in_c = all(term.loops() for term in self.terms)
        loops = [term.loops() or self._in_python(term) for term in self.terms]
        stiffnesses = [stiffness for _, stiffness in loops if stiffness is not None]

        def take(name: str) -> Any:
            """Data of the first stiffness of a name, which is taken out; null without any."""
            found = (one for one in stiffnesses if one[0] == ffi.addressof(lib, name))
            if (one := next(found, None)) is None:
                return ffi.NULL
            stiffnesses.remove(one)
            return one[1]

        product, cells = take("add_step_tangent"), take("add_cells")
        zero, pivot = (x.astype(np.int32) for x in supports.entries)
        fill(
            self.c,
            inner=len(self.inner), forces=len(loops),
            force=ffi.new("call[]", [force for force, _ in loops]),
            stiffnesses=len(stiffnesses), stiffness=ffi.new("call[]", stiffnesses),
            product=product, cells=cells, indptr=self.A.indptr,
            zeros=len(zero), zero=zero, pivot=pivot,
            held=len(supports.dofs), hold=supports.dofs.astype(np.int32),
            reactions=supports.reactions, pivots=supports.pivots,
        )  # fmt: skip
        if self.share.alone and not supports.turned:
            demands = [one.demand() or self.demand_in_python(one.excess) for one in self._couplings]
            self.demand([*demands, *filter(None, (one.demand() for one in self._beams))])
            self.in_c = True

    def _in_python(self, term: Term) -> tuple[Loop, Loop]:
        def add_tangent(q1: Array, _: Array) -> None:
            term.add_tangent(q1)

        residual = self.part_in_python(term.add_residual, self.share.size)
        return residual, self.part_in_python(add_tangent, len(self.A.data))

    # -- derivatives about a state -------------------------------------------------------------

    def linearise(self, q: Array, step: Step) -> tuple[Array, Array]:
        """Return all forces but those of inertia in a step to ``q``, and their derivatives.

        Both are in the axes of the plane, nothing held; the derivatives as entries of the matrix.
        """
        r = np.zeros(self.share.size)
        self.A.data.fill(0.0)
        for term in self.terms:
            if term.kind != "inertia":
                term.begin(step)
                if isinstance(term, InternalForces):
                    term.restart(Tangents.EXACT)
                term.add_residual(q, r)
                term.add_tangent(q)
        return r, self.A.data.copy()

    def tangent_change(self, q: Array, u: Array) -> Array:
        """Derivative along ``u`` of the latest tangent of :meth:`linearise`, at ``q``; entries."""
        self.A.data.fill(0.0)
        for one in (*self.inner, *self._loads):
            one.add_tangent_change(q, u)
        return self.A.data.copy()

    def stiffness_works(self, q: Array, X: Array, Y: Array) -> Array:
        """Works of the tangent of :meth:`linearise`, each column of X on its own of Y; J."""
        self.A.data.fill(0.0)
        for term in (*self._couplings, *self.others):
            if term.kind != "inertia":
                term.add_tangent(q)
        times, works = Product(self.A), np.zeros(X.shape[1])
        for i, (x, y) in enumerate(zip(*map(np.ascontiguousarray, (X.T, Y.T)), strict=True)):
            of_beams = sum(one.tangent_work(q, x, y) for one in self._beams)
            works[i] = of_beams + times(x) @ y
        return works

    def tangent_works(self, q: Array, u: Array, X: Array, Y: Array) -> tuple[Array, Array]:
        """Works of the tangent for motions X on Y, and of its derivative along u; symmetric; J."""
        works = np.zeros((2, X.shape[1], Y.shape[1]))
        for i, j in zip(*np.triu_indices(X.shape[1]), strict=True):
            x, y = (np.ascontiguousarray(one) for one in (X[:, i], Y[:, j]))
            works[0, i, j] = sum(one.tangent_work(q, x, y) for one in self._beams)
            works[1, i, j] = sum(one.work_of_change(q, u, x, y) for one in self._beams)
        for k, work in enumerate(works):
            self.A.data.fill(0.0)
            for one in (*self._couplings, *self._loads):
                if k == 0:
                    one.add_tangent(q)
                else:
                    one.add_tangent_change(q, u)
            times = Product(self.A)
            work += np.triu([times(np.ascontiguousarray(x)) @ Y for x in X.T])
            work += np.triu(work, 1).T
        return works[0], works[1]
