# SPDX-License-Identifier: MIT
"""Equation of a step, the sum of the terms of a scene, and checks of static steps."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.blocks.beams import BeamCells, InelasticCells, elastic_cells
from ufl_beam.blocks.block import Block, BlockSetting
from ufl_beam.blocks.connector_terms import connector_terms
from ufl_beam.blocks.damping import second_differences, tangent_damping, viscosity
from ufl_beam.blocks.loads import load_blocks
from ufl_beam.blocks.material_points import create_entries
from ufl_beam.blocks.nodes_in_space import put_turns
from ufl_beam.blocks.spatial_beams import (
    CellsInSpace,
    InelasticCellsInSpace,
    bodies_in_space,
    viscosity_in_space,
)
from ufl_beam.blocks.works import work_blocks
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.cells_in_space import TURNS, by_rotation, turns_at
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import NOWHERE, Archive, State
from ufl_beam.errors import StepFailed
from ufl_beam.mechanics.time_scheme import Scheme, Step, has_inertia
from ufl_beam.model.connector_laws import has_friction
from ufl_beam.model.constraint_checks import friction_repeats
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.loads import Rayleigh
from ufl_beam.model.supports import Support
from ufl_beam.parallel import Agreement
from ufl_beam.simulation.controllers import Controllers
from ufl_beam.terms.boundary_conditions import Supports
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.dead_loads import DeadLoads, dead_loads
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inertia_and_damping import BEFORE, Inertia, rayleigh_forces
from ufl_beam.terms.term import Callbacks, LoadTerm, Term

MOVING = "inertia", "damping"
"""Kinds of terms that depend on velocities."""


class StepEquation:
    """Equation of a step: forces and tangent of all terms at the local degrees of freedom.

    The terms are made on the subdomain of one process, for a run that begins at ``t0`` (s).  The
    initial local velocities ``v`` are set to zero, in place, where supports do not move.  An
    equation with the unknowns of another one may share its matrix ``A``.

    Attributes:
        A: Tangent matrix.
        fields: Fields on the cells of this process.
        ledger: Energies of this process.
        controllers: Forces of controllers and limits of friction in the step.
        beams: Terms of cells in the plane; ``inelastic``, those with material points, come first.
        cells: Terms of all cells.
        connector_terms: Terms of connectors, grouped by kind.
        loads: Terms of loads and works.
        supports: Prescribed motions and reactions.
        inertia: Inertia; None in statics.
        terms: All terms: ``inner``, with the internal forces of ``beams`` and ``connector_terms``,
            and ``others``.
        imposed: Terms of ``beams`` with imposed strains.
        remembering: Terms with internal variables, in space also with rotations of nodes.
        weights: Weights of residuals: 1 for forces, 1 / (size of the scene) for moments, 0 for
            ghosts and for equations of connectors.
        force: Internal forces in the latest residual, in statics; else empty.
        c: ``equation`` of loops.h, which a solver completes with its own data.
        callbacks: Python functions that C calls.
        phases: Phases of the terms, in the order of ``terms``.
        cell_forces: Forces of the terms on the nodes of cells.
    """

    def __init__(
        self, subdomain: Subdomain, scheme: Scheme, t0: float, v: Array, together: Agreement,
        A: Csr | None = None,
    ) -> None:  # fmt: skip
        self.subdomain, self.scheme, self.weights = subdomain, scheme, subdomain.weights()
        scene = subdomain.numbering.scene
        search, switched = np.zeros(lib.SEARCH_FLAGS, np.int32), np.zeros(1, np.int32)
        self.ledger, self.fields = ledger, fields = Ledger(), Fields(subdomain)
        self.A = A = fields.matrix(A)
        setting = (scheme, A, ledger)
        inertia = Inertia(fields, scheme, A, ledger, v) if has_inertia(scheme) else None
        self.inertia = inertia
        self.controllers = Controllers(subdomain)
        in_blocks = BlockSetting(
            subdomain, *setting, t0, inertia.c if inertia else None, search, switched,
            self.controllers.place, friction_repeats(scene),
        )  # fmt: skip
        strains = [load for load in scene.loads if isinstance(load, ImposedStrain)]
        # Terms create their ledger entries in the order of the columns of tables.  All processes
        # create the same entries, even without cells or connectors of a kind.
        self.inelastic, elastic = list[InelasticCells](), np.ones(len(subdomain.cells), dtype=bool)
        for section_points, cells in subdomain.numbering.inelastic:
            create_entries(section_points, scheme, ledger)
            indices = np.flatnonzero(np.isin(subdomain.cells, cells))
            if len(indices):
                elastic[indices] = False
                subset = Fields(subdomain, indices)
                kind = InelasticCellsInSpace if scene.in_space else InelasticCells
                self.inelastic.append(kind(subset, section_points, cells, in_blocks, strains))
        self.beams: list[BeamCells] = [*self.inelastic]
        numbering = subdomain.numbering
        some_elastic = len(numbering.inelastic_cells) < len(numbering.cells)
        if (scheme.alpha or scheme.lost_fraction) and some_elastic:
            ledger.lost["numerical"] += 0.0
        others: list[Term] = []

        self.connector_terms = together(connector_terms, in_blocks)

        self.loads: list[LoadTerm] = dead_loads(subdomain, scheme, ledger)
        if scene.works:
            self.loads += together(work_blocks, in_blocks)
        if scene.beams:
            ledger.state["stored"] += 0.0
        subset = fields if elastic.all() else Fields(subdomain, np.flatnonzero(elastic))
        self.in_space, self.nodes_in_space = list[CellsInSpace](), list[Any]()
        if scene.in_space:
            self.in_space = [CellsInSpace(subset, in_blocks)] if len(subset.order) else []
            bodies = bodies_in_space(in_blocks)
            self.nodes_in_space += [*self.inelastic, *self.in_space, *bodies]
            others += bodies
        elif elastic.any():
            self.beams.append(elastic_cells(subset, in_blocks, strains))
            if scheme.lost_fraction:
                others.append(second_differences(subset, in_blocks))
        self.loads += load_blocks(in_blocks)
        self.supports = Supports(subdomain, scheme, ledger, A)
        if inertia is not None:
            self.supports.stop(v)
            inertia.commit(v, v, math.inf)
            if inertia.loses_energy:
                ledger.lost["numerical"] += 0.0
            others.append(inertia)
        viscous = list[Block]()
        for damping in scene.damping:
            if isinstance(damping, Rayleigh):
                others += rayleigh_forces(damping, fields, *setting, inertia)
                if damping.tangent:
                    others += tangent_damping(damping, subset, self.inelastic, in_blocks)
            elif scene.in_space:
                viscous.append(viscosity_in_space(damping, fields, in_blocks))
            else:
                others.append(viscosity(damping, fields, in_blocks))
        others += viscous
        own = [*self.nodes_in_space, *viscous] or self.inelastic
        self.remembering: list[Any] = [*own, *self.connector_terms]
        self.inner: list[Term] = [*self.beams, *self.in_space, *self.connector_terms]
        self.others: list[Term] = [*self.loads, *others]
        self.cells: list[Any] = [*self.beams, *self.in_space]
        self.terms: list[Term] = [*self.inner, *self.others]
        self.imposed = [x for x in self.beams if x.imposed]
        self._fill_c(search, switched)
        in_cells = [forces for term in self.terms for forces in term.in_cells]
        in_c = [term.loads_in_cells() for term in self.loads if isinstance(term, DeadLoads)]
        self.cell_forces = CellForces(subdomain, in_cells, *in_c)

    def _fill_c(self, search: Index, switched: Index) -> None:
        """Fill ``equation`` of loops.h, and collect the phases of the terms."""
        subdomain, A, supports = self.subdomain, self.A, self.supports
        self.c = struct("equation", size=A.size, owned=subdomain.num_owned, weight=self.weights)
        self.callbacks = callbacks = Callbacks(self.c)
        loops = [term.loops for term in self.terms]
        stiffnesses = [stiffness for _, stiffness in loops if stiffness is not None]

        def pop(name: str) -> Any:
            """Remove the first stiffness with this C function; return its data, or null."""
            matches = (call for call in stiffnesses if call[0] == ffi.addressof(lib, name))
            if (match := next(matches, None)) is None:
                return ffi.NULL
            stiffnesses.remove(match)
            return match[1]

        product, cells = pop("add_step_tangent"), pop("add_cells")
        vectors = [load.vector for load in self.loads]
        law_residuals = [term.law_residual for term in self.inner if term.law_residual is not None]
        demanding = subdomain.largest(float(bool(law_residuals)))
        predicted = [x.prediction for x in self.cells if x.prediction is not None]
        zero, pivot = (x.astype(np.int32) for x in supports.entries)
        fill(
            self.c,
            inner=len(self.inner), forces=len(loops),
            force=ffi.new("call[]", [force for force, _ in loops]),
            stiffnesses=len(stiffnesses), stiffness=ffi.new("call[]", stiffnesses),
            product=product, cells=cells, indptr=A.indptr, tangent=A.data,
            load_vectors=len(vectors), load=ffi.new("vector *[]", vectors),
            zeros=len(zero), zero=zero, pivot=pivot,
            held=len(supports.dofs), hold=supports.dofs.astype(np.int32),
            reactions=supports.reactions, pivots=supports.pivots,
            turned=supports.turned, axes=supports.axes,
            plane=np.zeros(subdomain.size if supports.turned else 0),
            law_residuals=len(law_residuals), law_residual=ffi.new("law_residual[]", law_residuals),
            demanding=int(demanding),
            predictions=len(predicted), predicted=ffi.new("predicted_forces *[]", predicted),
            search=search, switched=switched,
        )  # fmt: skip
        self._alive = loops, law_residuals, predicted
        # In statics the work of the internal forces is compared with energies.
        self.force = np.zeros(0 if self.inertia is not None else subdomain.size)
        if self.inertia is None:
            fill(self.c, inner_force=self.force)
        # The ledger has all entries now, so their addresses, to which phases write, do not change.
        self.phases = [term.phases(callbacks) for term in self.terms]
        for term, phases in zip(self.terms, self.phases, strict=True):
            term.made_phases = phases

    # -- continued runs ------------------------------------------------------------------------

    def internal_variables(self, q: Array, t: float, prediction: Any) -> State:
        """Return the data of this state for ``start=``.

        They are internal variables, reactions, rates, forces, and the ``prediction`` of steps.
        """
        archive = Archive(self.subdomain)
        prediction.save_or_restore(archive)
        self.controllers.save_or_restore(archive, t)
        for term in self.remembering:
            term.save_or_restore(archive, q)
        scene = self.subdomain.numbering.scene
        friction = any(has_friction(connector.law) for connector in scene.all_connectors)
        if self.inertia is None or self.supports.work or self.supports.about or friction:
            self.supports.carry_on(archive, q)
        if self.inertia is not None:
            self.inertia.carry_on(archive, len(self.inertia.more))
            self._pass_on_step(archive, q)
        for load in self.loads:
            load.pass_on(archive)
            if isinstance(load, Block) and load.remembers:
                load.keep_states(archive)
        return archive.state()

    def begin_energies(self, t: float, q: Array, v: Array) -> None:
        """Set the energies of loads in the state that begins a run, see :class:`LoadTerm`."""
        for load in self.loads:
            load.begin_energy(t, q, v)

    def set_internal_variables(
        self, q: Array, t: float, internal: State, *, same: bool
    ) -> set[tuple[str, int]]:
        """Take over :meth:`internal_variables` of another run at the local configuration ``q``.

        ``same`` means that the other run ended at this time with this scene, so that accelerations
        are unchanged.  The result is :attr:`Archive.unknown` of cells and connectors.
        """
        archive = Archive(self.subdomain, internal)
        self.controllers.save_or_restore(archive, t)
        given = {*self.nodes_in_space} if TURNS in internal else set()
        given |= {x for x in self.remembering if x.kind == "damping" and not same}  # in space
        for term in (x for x in self.remembering if x not in given):
            term.save_or_restore(archive, q if term in self.nodes_in_space else NOWHERE)
        for cells in () if same else self.in_space:
            cells.forget_last_step()
        unknown = archive.unknown.copy()
        for load in self.loads:
            if isinstance(load, Block) and load.remembers:
                load.keep_states(archive)
        if TURNS in internal:
            self._put_turns(by_rotation(self.subdomain.numbering, internal[TURNS]))
        if "reactions" in internal:
            self.supports.carry_on(archive, q)
        if self.nodes_in_space and not same:
            self._take_turns(t, q)
        if self.inertia is not None and same:
            known = sum(name in internal for name in self.inertia.scheme.further_rates)
            self.inertia.carry_on(archive, known)
            if BEFORE in internal:
                self._pass_on_step(archive, q)
        return unknown

    def turns(self) -> Array:
        """Return the quaternions of nodes and bodies in space, see :data:`TURNS`; (nodes, 4)."""
        numbering = self.subdomain.numbering
        turns = np.zeros((len(numbering.points) + len(numbering.scene.rigid_bodies), 4))
        hinges = (x for x in self.connector_terms if hasattr(x, "turns"))  # nodes of no cell
        for term in (*self.nodes_in_space, *hinges):
            places, nodes = term.turns(numbering)
            turns[nodes] = term.states.ravel()[places]
        if not self.subdomain.alone:  # each node is on one process
            self.subdomain.comm.Allreduce(MPI.IN_PLACE, turns)
        return turns

    def _take_turns(self, t: float, q: Array) -> None:
        """Let loads and supports of another scene begin with the rotations of the nodes."""
        numbering, turns = self.subdomain.numbering, self.turns()

        def rotation_vector(support: Support) -> Array:
            return np.asarray(turns_at(numbering, support.place, turns[None]).as_rotvec()[0])

        self.supports.find_angles(rotation_vector, t)
        self._put_turns(by_rotation(numbering, turns))
        for load in self.loads:
            if isinstance(load, Block) and load.remembers:
                load.carry_on(t, q, None, None)

    def _put_turns(self, turns: Array) -> None:
        """Let all terms begin with quaternions at the rotations of all nodes; (size, 4)."""
        for term in (*self.remembering, *self.loads):
            put_turns(term, turns[self.subdomain.dofs])

    def _pass_on_step(self, archive: Archive, q: Array) -> None:
        """Save or restore the increments of the last step, if the next step depends on them."""
        if self.inertia is not None and self.inertia.scheme.uses_last_step:
            self.inertia.pass_on_step(archive)
            for term in self.terms:
                if isinstance(term, Block) and term not in self.in_space:
                    term.keep_states(archive)

    # -- forces and tangent --------------------------------------------------------------------

    def begin(
        self, step: Step, terms: Sequence[Term] | None = None, imposed: Sequence[BeamCells] = ()
    ) -> None:
        """Begin a step in some terms, by default all; beams then have exact tangents.

        Beams in ``imposed`` change their imposed strains only.
        """
        some = self.terms if terms is None else terms
        before = step.q0 if step.q_before is None else step.q_before
        q0, q_before = (np.ascontiguousarray(q) for q in (step.q0, before))
        if self.inertia is not None and any(term.kind in MOVING for term in some):
            lib.find_numbers(self.inertia.c, step.dt)
        c = ffi.new("time_step *", {
            "t0": step.t0, "t1": step.t1, "dt": step.dt, "load_time": step.load_time,
            "motion_time": step.motion_time, "fraction": step.fraction, "at": step.at,
            "ratio": step.ratio, "q0": doubles(q0), "q_before": doubles(q_before),
        })  # fmt: skip
        self._begun = c, q0, q_before  # kept alive while C refers to them
        with self.callbacks.raising():
            for term, phases in zip(self.terms, self.phases, strict=True):
                for begin, data in phases.begin if term in some else ():
                    begin(data, c, ffi.NULL, ffi.NULL)
            for beams in imposed:
                beams.impose(c)
        for cells in self.cells:
            if cells in some and (predicted := cells.prediction) is not None:
                predicted.begins, predicted.stale, predicted.exact = 0, 1, 1

    def inner_forces(self, q: Array, t: float | None = None) -> Array:
        """Return the forces of beams at ``q``, in a step too short for viscous flow; (size,).

        With a time ``t`` (s), forces of connectors are added, which are unknowns in ``q``.
        """
        short, forces = sys.float_info.min, np.zeros(self.subdomain.size)
        step = Step.create(self.scheme, 0.0, short, short, q)
        self.begin(step._replace(fraction=0.0), self.cells)  # imposed strains remain
        for cells in self.cells:
            cells.add_residual(q, forces)
        if t is not None:
            step = Step.create(self.scheme, t, t + 1.0, t + 1.0, q)
            self.begin(step._replace(load_time=t, motion_time=t), self.connector_terms)
            for group in self.connector_terms:
                group.add_residual(q, forces)
        return forces

    def add_state(self, q: Array) -> None:
        """Add the energies of the scene at ``q`` to the ledger."""
        with self.callbacks.raising():
            for phases in self.phases:
                for add, data in phases.add_state:
                    add(data, ffi.NULL, doubles(q), ffi.NULL)

    def tangent_at(self, x: Array, v: Array, r: Array) -> Csr:
        """Return the tangent at ``x``; add its product with a motion ``v`` of supports to ``r``.

        All vectors are local and in the axes of the supports.
        """
        lib.fill_tangent(self.c, doubles(self.supports.in_plane(x)))
        if len(self.supports.moving):
            forces = Product(self.A)(self.supports.in_plane(v))
            self.supports.into_axes(forces)
            r += forces
        lib.hold_tangent(self.c)
        return self.A

    def evaluate(self, q1: Array) -> bool:
        """Evaluate forces and tangent of the step at ``q1``; return False if a process fails."""
        lib.restart(self.c, lib.EXACT)
        self.c.raised = 0
        try:
            self.forces(q1)
        except StepFailed:
            self.c.raised = 1
        self.tangent(q1)
        return self.subdomain.largest(float(self.c.raised)) == 0.0

    def forces(self, q1: Array) -> Array:
        """Return the sum of the forces of all terms at ``q1`` on this process; (size,)."""
        r = np.zeros(self.subdomain.size)
        with self.callbacks.raising():
            for term in self.terms:
                term.add_residual(q1, r)
        return r

    def tangent(self, q1: Array) -> None:
        """Fill the matrix with the tangent at ``q1``, in the axes of supports.

        In rows and columns of supports only the diagonal entry is not zero.  Errors of user
        functions are stored in :attr:`callbacks`.
        """
        lib.fill_tangent(self.c, doubles(q1))
        lib.hold_tangent(self.c)

    def working(self, q: Array, y: Array) -> Array:
        """Return the motions on which residuals do work in a step ``y`` from ``q``, as a new array.

        It is ``y``, in the axes of supports, with motions of connectors instead of their forces.
        """
        v, works = self.supports.in_plane(y), y.copy()
        for group in self.connector_terms:
            group.put_motions(q, v, works)
        return works

    # -- derivatives about a state -------------------------------------------------------------

    def linearize(self, q: Array, step: Step) -> tuple[Array, Array]:
        """Return all forces except inertia in a step to ``q``, (size,), and their derivatives.

        Derivatives are ``data`` of :attr:`A`.  The axes of the plane are used, without supports.
        """
        r = np.zeros(self.subdomain.size)
        self.begin(step)
        self.A.data.fill(0.0)
        with self.callbacks.raising():
            for term in self.terms:
                if term.kind != "inertia":
                    term.add_residual(q, r)
                    term.add_tangent(q)
        return r, self.A.data.copy()

    def tangent_change(self, q: Array, u: Array) -> Array:
        """Return ``data`` of the derivative along ``u`` of the tangent of inner terms and loads."""
        self.A.data.fill(0.0)
        for term in (*self.inner, *self.loads):
            term.add_tangent_change(q, u)
        return self.A.data.copy()

    def stiffness_works(self, q: Array, X: Array, Y: Array) -> Array:
        """Return xᵀ K y for each pair of columns of X and Y, K as in :meth:`linearize`; (n,); J."""
        self.A.data.fill(0.0)
        for term in (*self.connector_terms, *self.others):
            if term.kind != "inertia":
                term.add_tangent(q)
        times, works = Product(self.A), np.zeros(X.shape[1])
        for i, (x, y) in enumerate(zip(*map(np.ascontiguousarray, (X.T, Y.T)), strict=True)):
            beam_work = sum(cells.tangent_work(q, x, y) for cells in self.cells)
            works[i] = beam_work + times(x) @ y
        return works

    def tangent_works(self, q: Array, u: Array, X: Array, Y: Array) -> tuple[Array, Array]:
        """Return the symmetric matrices Xᵀ K Y and Xᵀ K' Y; J.

        K is the tangent of beams, connectors and loads, and K' is its derivative along ``u``.  Only
        the upper triangles are computed.
        """
        works = np.zeros((2, X.shape[1], Y.shape[1]))
        for i, j in zip(*np.triu_indices(X.shape[1]), strict=True):
            x, y = (np.ascontiguousarray(column) for column in (X[:, i], Y[:, j]))
            works[0, i, j] = sum(cells.tangent_work(q, x, y) for cells in self.cells)
            works[1, i, j] = sum(cells.tangent_work(q, x, y, u) for cells in self.cells)
        for k, work in enumerate(works):
            self.A.data.fill(0.0)
            for term in (*self.connector_terms, *self.loads):
                if k == 0:
                    term.add_tangent(q)
                else:
                    term.add_tangent_change(q, u)
            times = Product(self.A)
            work += np.triu([times(np.ascontiguousarray(x)) @ Y for x in X.T])
            work += np.triu(work, 1).T
        return works[0], works[1]


def equation_of_scene(numbering: DofNumbering, scheme: Scheme, t0: float) -> StepEquation:
    """Return the equation of the whole scene on this process."""
    subdomain, still = Subdomain(numbering, MPI.COMM_SELF), np.zeros(numbering.size)
    return StepEquation(subdomain, scheme, t0, still, Agreement(subdomain.comm))


def forces_of_scene(numbering: DofNumbering, scheme: Scheme, t0: float) -> Callable[..., Array]:
    """Return a function like :meth:`CellForces.forces_from_record` for all cells of a scene."""
    equation = cache(partial(equation_of_scene, numbering, scheme, t0))  # without communication
    return lambda *state: equation().cell_forces.forces_from_record(*state)


# -- checks of static steps ------------------------------------------------------------------------

LARGEST_MOTION = 1e3
"""Largest motion of a node in a step without a mechanism; in sizes of the scene, or rad."""

KINK_IMBALANCE = 1e-6
"""Imbalance of work that a kink of a law may cause, as a fraction of the energy transferred so far,
or of the energy of the step before it was divided."""


class StaticPath:
    """Checks of each static step before it is accepted.

    The motion of nodes is limited, and the work of the internal forces must equal the energy that
    the step stores and dissipates.  Otherwise Newton's method may have found another branch of
    equilibria, beyond a limit load or where softening releases more energy than it dissipates.
    The ``slack`` of the scheme limits the imbalance of work.  The work of the residual that
    Newton's method leaves does not count.  A step is accepted, too, if the internal forces grow
    faster and faster along the straight line from its beginning to its end, as in a straight rope.

    The initial state, ``q`` at ``t0``, is in equilibrium with the vectors ``loads``.  Reactions are
    set from this equilibrium, unless the run ``goes_on`` from a static run of the same scene,
    whose reactions include viscous forces.

    Attributes:
        force: Internal forces at the end of the last step.
        c: ``static_path`` of loops.h.
    """

    def __init__(
        self, equation: StepEquation, q: Array, t0: float, loads: Sequence[Array],
        together: Agreement, *, goes_on: bool,
    ) -> None:  # fmt: skip
        subdomain, scheme, ledger = equation.subdomain, equation.scheme, equation.ledger
        supports = equation.supports
        self.force = together(equation.inner_forces, q, t0)
        equation.cell_forces.accept()
        if not goes_on:
            r = np.asarray(self.force - sum(loads))
            supports.into_axes(r)
            supports.hold(subdomain.added(r))
            supports.commit()
        changes = [phases.change for phases in equation.phases if phases.change is not None]
        accounts = ledger.state, ledger.supplied, ledger.lost
        of_dead_loads = all(isinstance(load, DeadLoads) for load in equation.loads)
        dead = of_dead_loads and not (supports.work or len(subdomain.numbering.multipliers))
        self.c = struct(
            "static_path", slack=scheme.slack, far=LARGEST_MOTION, kink=KINK_IMBALANCE, dead=dead,
            per_far=subdomain.numbering.scales[subdomain.dofs],
            force=self.force, terms=len(changes), weight_of_before=scheme.weight_of_before,
            change=ffi.new("change_call[]", changes), accounts=len(accounts),
            account=ffi.new("double *[]", [doubles(entries.amounts) for entries in accounts]),
            entries=np.array([len(entries) for entries in accounts], dtype=np.int32),
        )  # fmt: skip

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the internal forces at the end of the last step."""
        self.force[:] = archive.added("internal forces", self.force)

    def failure(self, mechanism: bool) -> StepFailed:
        """Return the error of a rejected step: a ``mechanism``, or a leap to another branch."""
        c = self.c
        if mechanism:
            return StepFailed(
                f"a node moves by {c.moves:.1e} times the size of the scene, or rotates by "
                f"{c.moves:.1e} rad, in the step: yielding points and open hinges leave a mechanism"
            )
        return StepFailed(
            f"the step stores and dissipates {c.stored:.3e} J, but the forces along it do "
            f"{c.work:.3e} J of work: it leaps to another branch of equilibria, or is too long "
            "to tell"
        )
