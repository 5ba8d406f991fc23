# SPDX-License-Identifier: MIT
"""The equation of a step, its derivatives about a state, and the check of static steps."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, fill, lib, struct
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_schemes import Scheme, Step
from ufl_beam.terms.base import Callbacks, Term
from ufl_beam.terms.beams import Cells
from ufl_beam.terms.connectors import Links
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inertia_and_damping import RatesInC
from ufl_beam.terms.loads import LoadTerm
from ufl_beam.terms.material_points import SearchFlags
from ufl_beam.terms.supports import Supports

MOVING = "inertia", "damping"
"""Kinds of terms that depend on velocities."""


class StepEquation:
    """Sum of the virtual works of all terms, less what supports carry, at local degrees of freedom.

    The ``others`` are all terms but those of internal forces.

    Attributes:
        A: Matrix that takes the tangent.
        weights: Of the residuals: 1 for forces, 1 over the size of the scene for moments, 0 for
            ghosts and forces of connectors.
        force: Internal forces in the latest residual, in statics; else empty.
        c: ``equation`` of loops.h, which a solver completes with its own numbers.
        callbacks: Python functions that take part.
        phases: Of the terms.
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
        rates: RatesInC | None,
    ) -> None:
        self.share, self.A, self.supports, self.weights = share, A, supports, share.weights()
        in_motion, self._rates = rates is not None, rates
        # Where nothing has inertia, the work of the internal forces is compared with energies.
        self.force = np.zeros(0 if in_motion else share.size)
        self.beams, self.couplings, self.loads = beams, couplings, loads
        self.inner: list[Term] = [*beams, *couplings]
        self.others: list[Term] = [*loads, *others]
        self.terms: list[Term] = [*self.inner, *self.others]
        self.c = struct("equation", size=A.size, owned=share.num_owned, weight=self.weights)
        self.callbacks = callbacks = Callbacks(self.c)
        loops = [term.loops for term in self.terms]
        stiffnesses = [stiffness for _, stiffness in loops if stiffness is not None]

        def take(name: str) -> Any:
            """Data of the first stiffness of a name, which is taken out; null without any."""
            found = (one for one in stiffnesses if one[0] == ffi.addressof(lib, name))
            if (one := next(found, None)) is None:
                return ffi.NULL
            stiffnesses.remove(one)
            return one[1]

        product, cells = take("add_step_tangent"), take("add_cells")
        both = (*couplings, *beams)
        demands = [one.demand for one in both if one.demand is not None]
        demanding = share.largest(float(bool(demands)))
        predicted = [one.predicted.c for one in beams if one.predicted is not None]
        zero, pivot = (x.astype(np.int32) for x in supports.entries)
        fill(
            self.c,
            inner=len(self.inner), forces=len(loops),
            force=ffi.new("call[]", [force for force, _ in loops]),
            stiffnesses=len(stiffnesses), stiffness=ffi.new("call[]", stiffnesses),
            product=product, cells=cells, indptr=A.indptr, tangent=A.data,
            zeros=len(zero), zero=zero, pivot=pivot,
            held=len(supports.dofs), hold=supports.dofs.astype(np.int32),
            reactions=supports.reactions, pivots=supports.pivots,
            turned=supports.turned, axes=supports.axes,
            plane=np.zeros(share.size if supports.turned else 0),
            demands=len(demands), demand=ffi.new("demand[]", demands), demanding=int(demanding),
            predictions=len(predicted), predicted=ffi.new("predicted_strains *[]", predicted),
            search=search.flags, switched=search.switched,
        )  # fmt: skip
        self._alive = loops, demands, predicted
        if not in_motion:
            fill(self.c, inner_force=self.force)
        # The ledger has all its entries now, to whose places phases write.
        self.phases = [one.phases(callbacks) for one in self.terms]

    @property
    def held(self) -> Index:
        """Degrees of freedom that supports hold; what stands for them in A means nothing."""
        return self.supports.dofs

    def begin(self, step: Step, terms: Sequence[Term] | None = None) -> None:
        """Let terms begin a step, by default all; beams have exact tangents in it."""
        some = self.terms if terms is None else terms
        before = step.q0 if step.q_before is None else step.q_before
        q0, q_before = (np.ascontiguousarray(q) for q in (step.q0, before))
        if self._rates is not None and any(one.kind in MOVING for one in some):
            lib.find_numbers(self._rates.c, step.dt)
        c = ffi.new("time_step *", {
            "t0": step.t0, "t1": step.t1, "dt": step.dt, "load_time": step.load_time,
            "motion_time": step.motion_time, "fraction": step.fraction, "at": step.at,
            "ratio": step.ratio, "q0": doubles(q0), "q_before": doubles(q_before),
        })  # fmt: skip
        self._begun = c, q0, q_before  # as long as forms and terms know them
        with self.callbacks.raising():
            for term, phases in zip(self.terms, self.phases, strict=True):
                for begin, data in phases.begin if term in some else ():
                    begin(data, c, ffi.NULL, ffi.NULL)
        for one in self.beams:
            if one in some and one.predicted is not None:
                of = one.predicted.c
                of.begins, of.stale, of.exact = 0, 1, 1

    def forces_at_rest(self, scheme: Scheme, q: Array) -> Array:
        """Forces of beams at ``q``, in a step so short that nothing viscous flows."""
        short = sys.float_info.min
        self.begin(Step.of(scheme, 0.0, short, short, q), self.beams)
        forces = np.zeros(self.share.size)
        for beam in self.beams:
            beam.add_residual(q, forces)
        return forces

    def inner_forces(self, scheme: Scheme, q: Array, t: float) -> Array:
        """The same, with those of connectors at the time ``t``; these have theirs among ``q``."""
        forces = self.forces_at_rest(scheme, q)
        step = Step.of(scheme, t, t + 1.0, t + 1.0, q)._replace(load_time=t, motion_time=t)
        self.begin(step, self.couplings)
        for coupling in self.couplings:
            coupling.add_residual(q, forces)
        return forces

    def start(self, q: Array) -> None:
        """Take ``q`` for the accepted configuration, which no step has led to."""
        for term in self.terms:
            term.start(q)

    def add_state(self, q: Array) -> None:
        """Enter the energies that the scene holds at ``q``."""
        with self.callbacks.raising():
            for phases in self.phases:
                for add, data in phases.add_state:
                    add(data, ffi.NULL, doubles(q), ffi.NULL)

    def tangent_at(self, x: Array, v: Array, r: Array) -> Csr:
        """Return the tangent at ``x``; add to ``r`` what it makes of a motion ``v`` of supports.

        All are in the axes of the supports, and the local part.
        """
        lib.fill_tangent(self.c, doubles(self.supports.in_plane(x)))
        if len(self.supports.moving):
            forces = Product(self.A)(self.supports.in_plane(v))
            self.supports.enter(forces)
            r += forces
        lib.hold_tangent(self.c)
        return self.A

    def respond_at(self, q1: Array) -> bool:
        """Evaluate forces and tangent of the present step at ``q1``; false if a process cannot."""
        lib.restart(self.c, lib.EXACT)
        self.c.raised = 0
        try:
            self.forces(q1)
        except StepFailed:
            self.c.raised = 1
        self.tangent(q1)
        return self.share.largest(float(self.c.raised)) == 0.0

    def forces(self, q1: Array) -> Array:
        """Return the sum of the forces of all terms at ``q1``, those of this process."""
        r = np.zeros(self.share.size)
        with self.callbacks.raising():
            for term in self.terms:
                term.add_residual(q1, r)
        return r

    def tangent(self, q1: Array) -> None:
        """Fill the matrix with the derivative at ``q1``, in the axes of supports, with these held.

        What functions of users raise there is in :attr:`callbacks`.
        """
        lib.fill_tangent(self.c, doubles(q1))
        lib.hold_tangent(self.c)

    def working(self, q: Array, y: Array) -> Array:
        """Return the conjugates of residuals in a step ``y`` in the axes of supports; a new array.

        They are the step itself, and motions of connectors in the place of their forces.
        """
        v, works = self.supports.in_plane(y), y.copy()
        for coupling in self.couplings:
            coupling.put_motions(q, v, works)
        return works

    # -- derivatives about a state -------------------------------------------------------------

    def linearise(self, q: Array, step: Step) -> tuple[Array, Array]:
        """Return all forces but those of inertia in a step to ``q``, and their derivatives.

        Both are in the axes of the plane, nothing held; the derivatives as entries of the matrix.
        """
        r = np.zeros(self.share.size)
        self.begin(step)
        self.A.data.fill(0.0)
        with self.callbacks.raising():
            for term in self.terms:
                if term.kind != "inertia":
                    term.add_residual(q, r)
                    term.add_tangent(q)
        return r, self.A.data.copy()

    def tangent_change(self, q: Array, u: Array) -> Array:
        """Derivative along ``u`` of the latest tangent of :meth:`linearise`, at ``q``; entries."""
        self.A.data.fill(0.0)
        for one in (*self.inner, *self.loads):
            one.add_tangent_change(q, u)
        return self.A.data.copy()

    def stiffness_works(self, q: Array, X: Array, Y: Array) -> Array:
        """Works of the tangent of :meth:`linearise`, each column of X on its own of Y; J."""
        self.A.data.fill(0.0)
        for term in (*self.couplings, *self.others):
            if term.kind != "inertia":
                term.add_tangent(q)
        times, works = Product(self.A), np.zeros(X.shape[1])
        for i, (x, y) in enumerate(zip(*map(np.ascontiguousarray, (X.T, Y.T)), strict=True)):
            of_beams = sum(one.tangent_work(q, x, y) for one in self.beams)
            works[i] = of_beams + times(x) @ y
        return works

    def tangent_works(self, q: Array, u: Array, X: Array, Y: Array) -> tuple[Array, Array]:
        """Works of the tangent for motions X on Y, and of its derivative along u; symmetric; J."""
        works = np.zeros((2, X.shape[1], Y.shape[1]))
        for i, j in zip(*np.triu_indices(X.shape[1]), strict=True):
            x, y = (np.ascontiguousarray(one) for one in (X[:, i], Y[:, j]))
            works[0, i, j] = sum(one.tangent_work(q, x, y) for one in self.beams)
            works[1, i, j] = sum(one.work_of_change(q, u, x, y) for one in self.beams)
        for k, work in enumerate(works):
            self.A.data.fill(0.0)
            for one in (*self.couplings, *self.loads):
                if k == 0:
                    one.add_tangent(q)
                else:
                    one.add_tangent_change(q, u)
            times = Product(self.A)
            work += np.triu([times(np.ascontiguousarray(x)) @ Y for x in X.T])
            work += np.triu(work, 1).T
        return works[0], works[1]


# -- whether a static step was followed ------------------------------------------------------------

FAR = 1e3
"""Largest motion of a node in a static step that is no mechanism; sizes of the scene or radians."""

KINK = 1e-6
"""Work that a kink of a law may leave unexplained, as a part of the energy that went through."""


class StaticPath:
    """Checks of a static step before it is accepted, from the state in which the path begins.

    The internal forces must account for what a step stores and dissipates.  Otherwise Newton's
    method may have found another branch of equilibria: beyond a limit load, or where softening lets
    go more than it dissipates.  The ``slack`` of the scheme says how much work may stay
    unexplained; ``force`` are the internal forces at the end of the last step.
    """

    _c: Any

    def __init__(self, share: Share, scheme: Scheme, ledger: Ledger, force: Array) -> None:
        self._share, self._scheme, self._ledger, self.force = share, scheme, ledger, force

    def remember(self, memory: Memory, q: Array) -> None:
        """The internal forces at the end of the last step."""
        self.force[:] = memory.added("internal forces", self.force)

    def failure(self, mechanism: bool) -> StepFailed:
        """Describe why the latest step was not followed: it leaves a mechanism, or leaps."""
        c = self._c
        if mechanism:
            return StepFailed(
                f"a node moves by {c.moves:.1e} times the size of the scene, or turns by so many "
                "radians, in the step: what yields and what has opened leave a mechanism"
            )
        return StepFailed(
            f"the step stores and dissipates {c.stored:.3e} J, but the forces along it do "
            f"{c.work:.3e} J of work: it leaps to another branch of equilibria, or is too long "
            "to tell"
        )

    def in_c(self, changes: Sequence[Loop]) -> Any:
        """``static_path`` of loops.h; ``changes`` are those of the terms."""
        parts = self._ledger.state, self._ledger.supplied, self._ledger.lost
        per_far = np.full(self._share.size, 1 / self._share.grid.scene.size)
        per_far[self._share.rotations] = 1.0
        self._c = struct(
            "static_path", slack=self._scheme.slack, far=FAR, kink=KINK, per_far=per_far,
            force=self.force, terms=len(changes),
            weight_of_before=self._scheme.weight_of_before,
            change=ffi.new("change_call[]", list(changes)), accounts=len(parts),
            account=ffi.new("double *[]", [doubles(part.numbers) for part in parts]),
            entries=np.array([len(part) for part in parts], dtype=np.int32),
        )  # fmt: skip
        return self._c


# -- steps -----------------------------------------------------------------------------------------
