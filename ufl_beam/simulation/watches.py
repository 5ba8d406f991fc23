# SPDX-License-Identifier: MIT
"""Watches over a run: signs in the ledger, and in forces of functions, of results that are wrong.

Dissipated energy must not fall and stored energy not be negative.  A scheme must not take more
energy than there is, and the force of a function must not change its direction at every step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ufl_beam.compiled.c_library import doubles, ffi, struct
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.connector_law import ENTRIES, ConnectorLaw, judges_loss
from ufl_beam.model.connector_laws import (
    Controller,
    Coulomb,
    Damper,
    ForceLaw,
    Spring,
    Stop,
)
from ufl_beam.model.connectors import Connector
from ufl_beam.model.material_law import MaterialLaw, has_quadratic_energies, judges_dissipation
from ufl_beam.model.scene import Scene
from ufl_beam.output.state_rows import DISSIPATED, HINGE, PLASTIC, WORK
from ufl_beam.output.states import States
from ufl_beam.simulation.controllers import Controllers
from ufl_beam.terms.connectors import Links

STATES = 100
"""Number of successive steps in which numerical losses are added."""

TURNOVER = 5.0
"""Numerical loss in so many steps, over the largest energy in the scene meanwhile, that is wrong.

A motion that steps resolve loses a small part of its energy in each.
"""

LITTLE = 1e-6
"""Numerical loss that does not matter, as a part of the energy that went through."""

ALTERNATIONS = 20
"""Number of successive changes of direction of a force that is a fault."""

LARGE = 0.5
"""Least change of such a force, as a part of the largest force so far."""

MOVED = 1e-9
"""Least motion of such a step, as a part of the size of the scene, or rad."""


class LedgerWatch:
    """Judges the kept states of a run, each once.

    Args:
        grid: Its scene is watched.
        scheme: The time scheme.
        claimed: Part of the energy that went through by which entries may err.
    """

    def __init__(self, grid: Grid, scheme: Scheme, claimed: float) -> None:
        self._grid, self._claimed = grid, claimed
        laws, links = [*_laws(grid.scene)], grid.scene.links
        grows = {"hinges": True, "plastic": all(map(judges_dissipation, laws))}
        # Other schemes integrate works with the mean of the forces at both ends.
        exact = grows["friction"] = grows["damping"] = scheme.weight_of_before == 0.0
        at_once = scheme.theta == scheme.load_weight  # elastic forces and variables
        stated = [link.law for link in links if isinstance(link.law, ConnectorLaw)]
        for law in stated:
            certain = exact and (at_once or not law.variables) and judges_loss(law)
            grows[law.entry] = grows.get(law.entry, exact) and certain
        self._grows = [name for name, certain in grows.items() if certain]
        given = any(isinstance(link.law, ForceLaw) and link.law.stored for link in links)
        given = given or not all(isinstance(law, Stop) for law in stated)
        self._bounded = not given and all(map(has_quadratic_energies, laws))
        self._in_motion = has_inertia(scheme)
        self._throughput = self._most = 0.0
        self._judged = 0  # number of the last state that was judged
        self._told: set[str] = set()

    def judge(self, states: States, every: int, *, last: bool = False) -> Iterator[str]:
        """Judge what was kept since the last call, if it is enough or the ``last``.

        ``every`` is the number of steps from one state to the next.  Yields warnings, of each kind
        the first.
        """
        number = len(states) - 1 - self._judged
        number -= 0 if last else number % STATES
        if number > 0:
            first, self._judged = self._judged, self._judged + number
            yield from self._judge(states.part(first, self._judged + 1), every)

    def thinned(self, states: States) -> None:
        """Go on where states, which were all judged, have been forgotten."""
        self._judged = len(states) - 1

    def _judge(self, states: States, every: int) -> Iterator[str]:
        times, (state, supplied, lost) = states.times, states.ledger()
        works = sum(float(np.abs(np.diff(work)).sum()) for work in supplied.values())
        sizes = [e if name in ENTRIES else np.abs(e - e[0]) for name, e in state.items()]
        held = np.asarray(sum(sizes, 0.0 * times))
        self._throughput += works + max(float(np.max(held)) - self._most, 0.0)
        self._most = max(self._most, float(np.max(held)))
        allowed = self._claimed * self._throughput
        for name in self._grows:
            if name in lost and name not in self._told:
                falls = -np.diff(lost[name])
                n = int(np.argmax(falls))
                if falls[n] > allowed:
                    self._told.add(name)
                    yield self._falls(name, float(falls[n]), states, n)
        least = float(np.min(state["stored"])) if "stored" in state and self._bounded else 0.0
        if least < -allowed and "stored" not in self._told:
            self._told.add("stored")
            t = times[int(np.argmin(state["stored"]))]
            yield (
                f"the stored energy is {least:.3g} J at t = {t:.6g} s, and a sum of squares is "
                "not negative: a law of material in the scene, or the step there, is wrong. Use "
                "smaller steps; check elastic_energy of a law of your own"
            )
        starts = np.arange(0, len(times) - STATES, STATES)
        if every > 1 or not self._in_motion or "numerical" not in lost or not len(starts):
            return
        losses = lost["numerical"][starts + STATES] - lost["numerical"][starts]
        most = np.maximum.reduceat(held, starts)
        wrong = losses > np.maximum(TURNOVER * most, LITTLE * self._throughput)
        if wrong.any() and "numerical" not in self._told:
            self._told.add("numerical")
            k = int(np.argmax(wrong))
            begin, end = times[starts[k]], times[starts[k] + STATES]
            yield (
                f"from t = {begin:.6g} to {end:.6g} s the time scheme took {losses[k]:.3g} J, the "
                f"entry 'numerical', {losses[k] / most[k]:.3g} times as much as the scene held at "
                f"most, in {STATES} steps. So most of the work that was supplied went into motions "
                "that are too fast for the steps, and results depend on the scheme. Use smaller "
                "steps, or smoother loads and supports; a controller that causes it needs another "
                "sample time, inertia at its place, or a ForceLaw instead"
            )

    def _falls(self, name: str, fall: float, states: States, n: int) -> str:
        before, after = states.times[n : n + 2]
        return (
            f"{self._where(name, states, n)}the dissipated energy, the entry {name!r} of the "
            f"ledger, falls by {fall:.3g} J between t = {before:.6g} and {after:.6g} s. No law of "
            "the scene gives dissipated energy back: a step found a wrong state there, and what "
            "follows is wrong. Use smaller steps; check the equations of a law of your own, or let "
            "one that is to give energy have active = True"
        )

    def _where(self, name: str, states: States, n: int) -> str:
        """Cell or connector whose dissipated energy falls most in a step."""
        kind = {"friction": Coulomb, "damping": Damper}.get(name)
        falls: dict[str, float] = {}
        for i, link in enumerate(self._grid.scene.links):
            entry = link.law.entry if isinstance(link.law, ConnectorLaw) else ""
            if entry == name if entry else kind is None or isinstance(link.law, kind):
                column = WORK if kind and not entry else DISSIPATED
                taken = states.column("connectors")[:, i, column]
                falls[f"{link}: "] = taken[n] - taken[n + 1]
        if name in ("hinges", "plastic"):
            column = PLASTIC if name == "plastic" else HINGE
            before, after = (states.cells_of(k)[:, column] for k in (n, n + 1))
            cell = int(np.argmax(before - after))
            place = self._grid.middle(cell)
            fall = before[cell] - after[cell]
            falls[f"{place.beam.name}, cell at s = {place.s:.3g}: "] = float(fall)
        worst = max(falls, key=lambda one: falls[one], default="")
        return worst if worst and falls[worst] > 0.0 else ""


def _laws(scene: Scene) -> Iterator[MaterialLaw]:
    """Laws of the material points of a scene."""
    for beam in scene.beams:
        layout = beam.section.layout(beam.section.hinge)
        if layout is not None and not layout.elastic:
            yield from (law for law, _ in layout.laws)
    springs = [link.law for link in scene.links if isinstance(link.law, Spring)]
    yield from (spring.law for spring in springs if spring.law is not None)


class ForceWatch:
    """Watches forces of controllers and force laws for a change of direction at every step.

    Attributes:
        c: ``force_watch`` of loops.h; None if there are no such laws.
    """

    c: Any = None

    def __init__(self, couplings: Sequence[Links], controllers: Controllers, size: float) -> None:
        kinds = Controller, ForceLaw
        found = [
            (link, one, k) for one in couplings for k, link in enumerate(one.links)
            if isinstance(link.law, kinds)
        ]  # fmt: skip
        self._links, n = [link for link, *_ in found], len(found)
        if not n:
            return
        controlled = [isinstance(link.law, Controller) for link in self._links]
        values, fresh = (
            [place(x) if of else ffi.NULL for x, of in zip(self._links, controlled, strict=True)]
            for place in (controllers.place, controllers.fresh_place)
        )
        self._told, none = np.full(n, math.nan), np.zeros((3, n))
        self.c = struct(
            "force_watch", number=n, most=ALTERNATIONS, large=LARGE, moved=MOVED,
            dof=np.array([one.forces_at[k] for _, one, k in found], dtype=np.int32),
            value=ffi.new("double *[]", values), fresh=ffi.new("int32_t *[]", fresh),
            rate=ffi.new("double *[]", [doubles(one.rate) + k for _, one, k in found]),
            length=np.array([1.0 if link.turns else size for link in self._links]),
            force=none[0], change=none[1], largest=none[2], told=self._told,
            count=np.zeros(n, dtype=np.int32),
        )  # fmt: skip
        self._alive = couplings, controllers

    def told(self) -> Iterator[str]:
        """Yield warnings that have not been told, one a connector."""
        if self.c is not None and self.c.tells:
            self.c.tells = 0
            for link, t in zip(self._links, map(float, self._told), strict=True):
                if not math.isnan(t):
                    yield _alternates(link, t)


def _alternates(link: Connector, t: float) -> str:
    """Describe a force that changes its direction at every step until ``t``."""
    sampled = isinstance(link.law, Controller) and link.law.sample
    said = (
        f"{link}: the force changed its direction at each of the {ALTERNATIONS} "
        f"{'samples' if sampled else 'steps'} before t = {t:.6g} s"
    )
    if not isinstance(link.law, Controller):
        return (
            f"{said}: it drives a motion that is too fast for the steps. Use smaller ones, or a "
            "scheme that damps such motions, as Midpoint(alpha=0.05, beta=0.05) does"
        )
    return (
        f"{said}: the controller answers the motion that it has caused by the time it is asked "
        "again. A force of kd times a rate that is held for a time dt needs kd dt < 2 J; J is the "
        "inertia (along a line the mass) that it moves within dt, and a beam without a body has "
        "hardly any there, whatever the step. Give the place the inertia of its drive, as "
        "PointMass or Body, take smaller gains, or state the force as a ForceLaw, which has no "
        "delay; see docs/howto_machine.md"
    )
