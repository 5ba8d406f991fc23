# SPDX-License-Identifier: MIT
"""Checks of the statements and functions of users before a run."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import called
from ufl_beam.blocks.effect_blocks import OfPython, computed
from ufl_beam.blocks.statement import Statement, kernels
from ufl_beam.blocks.works import (
    OfUser,
    geometry,
    initial_state,
    statement_of,
    values_at_zero,
)
from ufl_beam.errors import ModelError, shorten
from ufl_beam.mechanics.kinematics import COMPONENTS
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.scene import Scene
from ufl_beam.model.works import Effect, Work

OF_USERS = "nodes", "numbers", "state", "equations", "in_python"
"""Members of statements that users define; the others are for the package."""

MOTIONS = 1e-3, 1e-5
"""Motions in the check of works, as fractions of the size of the scene, and rad."""

FIRST_MOTION = 0.1
"""Motion before them."""

STEPS, LONG = 6, 1e300  # number of motions, and length of a step in which nothing has a rate; s

UNEXPLAINED = 1e-7, 1e-2
"""Largest work that is no energy, as a part of the energies in a step: round-off, and for schemes
that compute works by the trapezoidal rule its error in :data:`MOTIONS`."""


def require_works(scene: Scene, degree: int, scheme: Scheme) -> None:
    """Raise :class:`ModelError` if a statement or function of a user is wrong."""
    works = [x for x in scene.works if isinstance(x, Work)]
    of_works = {name for work in works for name in (work.name, work.in_time)}
    accounts = dict[str, str]()
    for work in scene.works:
        if isinstance(work, Effect):
            _require_of_user(work)
        statement = statement_of(work, degree, scheme)
        try:
            made = kernels(statement)
        except ModelError:
            raise
        except Exception as error:
            raise ModelError(f"{work}: its form cannot be compiled: {shorten(error)}") from error
        for account, energies in made.energies.items() if isinstance(work, Effect) else ():
            for entry in energies:
                if entry in of_works or accounts.setdefault(entry, account) != account:
                    raise ModelError(
                        f"{work}: the scene has another entry {entry!r} in the energy ledger; "
                        "rename one"
                    )
        if isinstance(work, Effect):
            require_explained(work, statement, scene)


def _require_of_user(effect: Effect) -> None:
    """Raise :class:`ModelError` if a statement has members that users cannot have."""
    statement, kind = effect.statement, type(effect.statement)
    if not isinstance(statement, Statement):
        raise ModelError(f"{effect}: {kind.__name__} must be derived from ub.extend.Statement")
    for name in sorted(vars(Statement).keys() - {*OF_USERS}):
        if not name.startswith("_") and getattr(kind, name) is not getattr(Statement, name):
            raise ModelError(
                f"{effect}: {name} is for statements of the package; a statement of a user has "
                "nodes, numbers, state, equations and in_python, and chooses branches by "
                "ufl.conditional"
            )
    names = [*statement.numbers, *statement.state, "dt"]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(f"{effect}: the name {name!r} occurs twice")


def require_explained(effect: Effect, statement: OfUser, scene: Scene) -> None:
    """Raise :class:`ModelError` if forces do work that is no energy, or energies do not go on.

    One element takes steps with random motions, from the undeformed scene.  After each step, a step
    without motion must give the same stored energies, with which a continued run begins.
    """
    made, scheme, label, beams = kernels(statement), statement.scheme, statement.label, effect.beams
    n, states, a = len(statement.unknowns), len(statement.state), scheme.weight_of_before
    stored, lost, supplied = (len(made.energies[x]) for x in ("state", "lost", "supplied"))
    of_places: Array = geometry(effect)
    if beams:  # a quadrature point of a cell that is a whole beam
        ends = [beams[0].curve(k) for k in np.linspace(0.0, 1.0, statement.nodes)]
        of_places = np.array([0.3, 1.0, *np.ravel(ends, "F")])
    known, inner = values_at_zero(effect), statement.inner
    numbers = [known[name.rpartition(" ")[0]] for name in statement.of_step[1:]]
    if isinstance(inner, OfPython):  # motions of the places
        n = len(COMPONENTS) * inner.nodes
    sizes, worst = np.repeat([scene.size, scene.size, 1.0], n // 3), list[tuple[float, str]]()

    def step(q0: Array, q1: Array, z: Array, dt: float) -> tuple[Array, Array, Array]:
        """Return forces, new state and energies of a step."""
        if isinstance(inner, OfPython):
            points = beams[0].curve(0.3) if beams else of_places[: 2 * inner.nodes]
            mine, past = np.split(z, [len(inner.state)])
            past = past if len(past) else np.zeros(n)
            values = known | dict(zip(inner.state, mine, strict=True)) | {"dt": dt}
            motions = np.array([q0, q1]).reshape(2, -1, inner.nodes).transpose(0, 2, 1)
            f, new, of = computed(
                statement, values, np.reshape(points, (-1, 2)), motions,
                past.reshape(-1, len(COMPONENTS)),
            )  # fmt: skip
            return f.T.ravel(), np.r_[new, f.ravel()][:states], np.array([*of.values()])
        w = np.array([*q1, *q0, *z, *of_places, dt, *numbers])
        end = called(made.end, w)
        return called(made.force, w)[:n], end[:states], end[states:]

    rest = step(np.zeros(n), np.zeros(n), initial_state(statement), 1.0)[0]
    finite = bool(np.isfinite(rest).all())
    for motion in MOTIONS:
        random, found = np.random.default_rng(1), [(math.nan, "")]
        z, (q, forces) = initial_state(statement), np.zeros((2, n))
        before: Array = np.zeros(stored)
        for k in range(STEPS):
            change = random.uniform(-1.0, 1.0, n) * sizes * (motion if k else FIRST_MOTION)
            now, z, energies = step(q, q + change, z, 1.0)
            slopes = np.ones(n)
            if not isinstance(inner, OfPython):
                slopes[2 * n // 3 :] = [_slope(statement, x) for x in change[2 * n // 3 :]]
            work = (a * forces + (1.0 - a) * now) @ (change / slopes)
            gone, came = np.split(energies[stored : stored + lost + supplied], [lost])
            terms = np.array([work, *(before - energies[:stored]), *-gone, *came])
            size = np.abs(terms).sum() + 1e-5 * np.abs(before).sum()
            q, forces, before = q + change, now, energies[:stored]
            finite = finite or bool(np.isfinite(now).all())
            if k and size > 0.0:
                text = f"{abs(terms.sum()):.3g} J of {np.abs(terms).max():.3g} J"
                found.append((abs(terms.sum()) / size, text))
            again = step(q, q, z, LONG)[2]
            again = again[-stored:] if made.knows_before else again[:stored]
            if stored and (np.abs(again - before) > 1e-9 * (np.abs(before) + size)).any():
                raise ModelError(
                    f"{label}: a step without motion changes the stored energy; give the energies "
                    "before the step as before="
                )
        worst.append(max(found[1:] or [(0.0, "")]))
    if not finite:
        raise ModelError(
            f"{label}: the forces are {rest.tolist()} without motion, and no numbers "
            "after random motions"
        )
    if min(worst)[0] > UNEXPLAINED[bool(a)]:
        raise ModelError(
            f"{label}: the forces do work that is neither stored, lost nor supplied, "
            f"{worst[0][1]} in a random step of {MOTIONS[0]:g} of the size of the scene; state it "
            "as an energy, such as lost={'damping': at.work(forces)}, or use at.potential"
        )


@lru_cache(maxsize=1024)
def _slope(statement: OfUser, turn: float) -> float:
    """Return the factor of the virtual rotation in a step in which a node turns."""
    return float(statement.scheme.virtual_rotation(*map(ufl.as_ufl, (0.0, float(turn), 1.0))))
