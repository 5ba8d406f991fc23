# SPDX-License-Identifier: MIT
"""Assembly: the terms of a scene, made for one time scheme on the part of one process."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Share
from ufl_beam.discretization.state_io import NOWHERE, Memory, State
from ufl_beam.mechanics.energy_momentum import DecayingMidpoint
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.connector_laws import rubs
from ufl_beam.model.constraint_checks import friction_repeats
from ufl_beam.model.loads import FollowerLoad, RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import Agreement
from ufl_beam.simulation.controllers import Controllers
from ufl_beam.simulation.step_equation import StaticPath, StepEquation
from ufl_beam.terms.base import Term
from ufl_beam.terms.beams import Cells, ElasticBeams, InelasticBeams
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.connector_laws import Setting
from ufl_beam.terms.connectors import Links, couplings
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.inertia_and_damping import (
    BEFORE,
    Inertia,
    RatesInC,
    SecondDifferences,
    damping_forces,
)
from ufl_beam.terms.loads import DeadLoads, FollowerLoads, FrameForces, LoadTerm
from ufl_beam.terms.material_points import SearchFlags, expect_entries
from ufl_beam.terms.supports import Supports
from ufl_beam.terms.works import Works


@dataclass(frozen=True)
class Assembly:
    """Terms of a scene and what they share."""

    fields: Fields  # on the cells of this process
    ledger: Ledger
    controllers: Controllers  # with their forces, and the limits of friction, in the step
    beams: list[Cells]  # those with material points first
    inelastic: list[InelasticBeams]  # those with material points
    couplings: list[Links]  # connectors, those alike together
    loads: list[LoadTerm]
    inertia: Inertia | None
    supports: Supports
    equation: StepEquation
    cell_forces: CellForces

    @property
    def remembering(self) -> list[InelasticBeams | Links]:
        """Terms with internal variables."""
        return [*self.inelastic, *self.couplings]

    def internal_variables(self, q: Array, t: float) -> State:
        """Return what a run that starts here takes over: internal variables, reactions, rates."""
        memory = Memory(self.equation.share)
        self.controllers.remember(memory, t)
        for one in self.remembering:
            one.remember(memory, q)
        slips = any(rubs(link.law) for link in self.equation.share.grid.scene.links)
        if self.inertia is None or self.supports.work or slips:
            self.supports.carry_on(memory, q)
        if self.inertia is not None:
            self.inertia.carry_on(memory, len(self.inertia.rates.more))
            if isinstance(self.inertia.scheme, DecayingMidpoint):
                self._pass_on_step(memory, q)
        for load in self.loads:
            load.pass_on(memory)
        return memory.state()

    def _pass_on_step(self, memory: Memory, q: Array) -> None:
        """State the changes of the last step, on which the next one of the scheme depends."""
        if self.inertia is not None:
            self.inertia.pass_on_step(memory)
        for term in self.equation.terms:
            if isinstance(term, SecondDifferences):
                term.remember(memory, q)

    def carry_on(self, t: float, q: Array, internal: State | None) -> list[Array]:
        """Return the loads at the initial state, which is in equilibrium with them.

        ``internal`` are the :meth:`internal_variables` of a run of the same scene that ended there.
        """
        v = None if self.inertia is None else self.inertia.v
        past = None if internal is None else Memory(self.equation.share, internal)
        return [load.carry_on(t, q, v, past) for load in self.loads]

    def take_over(self, q: Array, t: float, internal: State, *, same: bool) -> None:
        """Take over :meth:`internal_variables` of another run at the local configuration ``q``.

        ``same`` says that no force has changed since, so that accelerations are what they were.
        """
        memory = Memory(self.equation.share, internal)
        self.controllers.remember(memory, t)
        for one in self.remembering:
            one.remember(memory, NOWHERE)
        if "reactions" in internal:
            self.supports.carry_on(memory, q)
        if self.inertia is not None and same:
            known = sum(name in internal for name in self.inertia.scheme.kept)
            self.inertia.carry_on(memory, known)
            if BEFORE in internal and isinstance(self.inertia.scheme, DecayingMidpoint):
                self._pass_on_step(memory, q)

    def static_path(
        self, scheme: Scheme, q: Array, t0: float, loads: list[Array], together: Agreement,
        *, goes_on: bool,
    ) -> StaticPath | None:  # fmt: skip
        """Begin a static path, and set the reactions to those of its state; None in dynamics.

        The state, ``q`` at ``t0``, is in equilibrium with ``loads``; none if nothing acts yet.  A
        path that ``goes_on`` from a static run of the same scene has the reactions of that already,
        with the forces of what is viscous.
        """
        if self.inertia is not None:
            return None
        share, of_beginning = self.equation.share, self.equation.inner_forces
        path = StaticPath(share, scheme, self.ledger, together(of_beginning, scheme, q, t0))
        self.cell_forces.accept()
        if not goes_on:
            r = np.asarray(path.force - sum(loads))
            self.supports.enter(r)
            self.supports.hold(share.added(r))
            self.supports.take()
        return path


def assemble(share: Share, scheme: Scheme, t0: float, v: Array, together: Agreement) -> Assembly:
    """Make the terms of a scene that begins at t0 (s).

    Supports stop the initial local velocities ``v`` in place.
    """
    scene, ledger, fields, search = share.grid.scene, Ledger(), Fields(share), SearchFlags()
    A = fields.matrix()
    setting = (scheme, A, ledger)

    # Each kind makes its entries of the ledger: their order is that of the columns of tables.  It
    # follows from the scene alone, also where a process lacks cells or connectors of a kind.
    inelastic, elastic = [], np.ones(len(share.cells), dtype=bool)
    for layout, cells in share.grid.inelastic:
        expect_entries(layout, scheme, ledger)
        part = np.flatnonzero(np.isin(share.cells, cells))
        if len(part):
            elastic[part] = False
            inelastic.append(InelasticBeams(Fields(share, part), layout, *setting, search))
    beams: list[Cells] = [*inelastic]
    loses = scheme.alpha or isinstance(scheme, DecayingMidpoint)
    if loses and sum(len(cells) for _, cells in share.grid.inelastic) < len(share.grid.cells):
        ledger.lost["numerical"] += 0.0
    numerical: list[Term] = []
    if elastic.any():
        part = np.flatnonzero(elastic)
        on_part = fields if elastic.all() else Fields(share, part)
        beams.append(ElasticBeams(on_part, *setting))
        if isinstance(scheme, DecayingMidpoint):
            numerical.append(SecondDifferences(scheme, on_part, A, ledger))

    controllers = Controllers(share)
    rates = RatesInC(scheme, v) if has_inertia(scheme) else None
    connectors = Setting(
        controllers.place,
        None if rates is None else rates.c,
        scene.size,
        scheme,
        ledger,
        friction_repeats(scene),
        search,
    )
    of_links = share, connectors, A
    coupled = together(couplings, *of_links)

    loads = _loads(scene, fields, scheme, ledger, A)
    if scene.works:
        loads.append(together(Works, fields, scheme, ledger, A, t0))
    supports, inertia = Supports(share, scheme, ledger, A), None
    if rates is not None and has_inertia(scheme):
        supports.stop(v)
        rates.take(v, v, math.inf)
        inertia = Inertia(fields, scheme, A, ledger, rates)
    others: list[Term] = [*numerical, *([inertia] if inertia else [])]
    for damping in scene.damping:
        others += damping_forces(damping, fields, *setting, rates)
    if scene.beams:
        ledger.state["stored"] += 0.0
    parts = share, A, beams, coupled, loads, others, supports, search
    equation = StepEquation(*parts, rates)
    in_cells = [part for term in equation.terms for part in term.in_cells]
    dead = [term.loads_in_cells() for term in equation.terms if isinstance(term, DeadLoads)]
    return Assembly(
        fields, ledger, controllers, beams, inelastic, coupled, loads, inertia,
        supports, equation, CellForces(share, in_cells, *dead),
    )  # fmt: skip


def _loads(scene: Scene, fields: Fields, scheme: Scheme, ledger: Ledger, A: Csr) -> list[LoadTerm]:
    if scene.loads:
        ledger.supplied["loads"] += 0.0
    followers = [load for load in scene.loads if isinstance(load, FollowerLoad)]
    frames = [load for load in scene.loads if isinstance(load, RotatingFrame)]
    dead = [load for load in scene.loads if load not in (*followers, *frames)]
    loads: list[LoadTerm] = [FrameForces(frame, fields, scheme, ledger, A) for frame in frames]
    if dead:
        loads.append(DeadLoads(dead, fields.share, scheme, ledger))
    if followers:
        loads.append(FollowerLoads(followers, fields.share, scheme, ledger, A))
    return loads
