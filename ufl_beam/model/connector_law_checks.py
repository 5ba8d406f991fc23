# SPDX-License-Identifier: MIT
"""Checks of laws of connectors when the connector is made that follows them."""

from __future__ import annotations

import inspect
from dataclasses import fields
from numbers import Real

import numpy as np

from ufl_beam.errors import SceneError, require_number, require_text, shorten
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.law_checks import quadratic, require_dataclass, require_names
from ufl_beam.model.ledger_entries import ENTRIES, LOSSES
from ufl_beam.model.material_law import State


def require_connector_law(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`SceneError` unless a law of a connector is complete; it is called at no motion.

    Its methods are compiled when a run begins.
    """
    what = f"{what}: {type(law).__name__}"
    require_dataclass(law, what)
    reserved = {*vars(ConnectorLaw), *ConnectorLaw.__annotations__}
    names = {field.name for field in fields(law)}  # type: ignore[arg-type]
    if taken := sorted(reserved & names):
        raise SceneError(
            f"{what}: a field cannot have the name {' or '.join(taken)}, which every ConnectorLaw "
            "gives to something else"
        )
    for name, value in law.numbers().items():
        require_number(value, f"{what}: {name}")
    stated = {n for n in CALLED if getattr(type(law), n) is not getattr(ConnectorLaw, n)}
    if not stated & {"energy", "resistance", "limit"}:
        raise SceneError(
            f"{what} has neither energy nor resistance, nor a limit; define one of these methods"
        )
    if law.holds and (stated & {"energy", "resistance"} or law.components > 1):
        raise SceneError(
            f"{what} has a limit, which is for laws of one component without energy and "
            "resistance; let another connector beside it have these"
        )
    if "sliding" in stated and not law.holds:
        raise SceneError(f"{what} has a sliding force and no limit; define this method")
    if law.variables and "increments" not in stated:
        raise SceneError(f"{what} has variables and no increments; define this method")
    require_text(law.entry, f"{what}.entry")
    if not law.entry or (law.entry in ENTRIES and law.entry not in LOSSES):
        raise SceneError(
            f"{what}.entry = {law.entry!r} is no name for what is lost; there are "
            f"{', '.join(LOSSES)}, or take a name of your own"
        )
    for name, value in law.variables.items():
        require_number(value, f"{what}.variables[{name!r}]")
    if law.components not in (1, 2, 3):
        raise SceneError(f"{what}.components = {law.components!r} must be 1, 2 or 3")
    motion, state = law.given([np.zeros(1)] * law.components), law.initially()
    calls = {"energy": (motion, state), "limit": (state,)}
    calls |= dict.fromkeys(CALLED[2:], (motion, motion, state, 1.0))
    for name, arguments in calls.items():
        try:
            with np.errstate(all="ignore"):
                found = getattr(law, name)(*arguments)
        except Exception as error:
            raise SceneError(f"{what}.{name} fails at no motion: {error}{place_of(law)}") from error
        if name == "increments":
            require_names(found, law, f"{what}.{name}")
        if name == "resistance" and law.components > 1:
            if not isinstance(found, tuple | list) or len(found) != law.components:
                raise SceneError(
                    f"{what}.resistance returns {shorten(found)}; it must return a tuple of "
                    f"{law.components} forces{place_of(law)}"
                )
            values = [("", force) for force in found]
        else:
            values = list(found.items()) if name == "increments" else [("", found)]
        for of, value in values:
            number = isinstance(value, Real) or np.shape(value) == (1,)
            if not number or not np.all(np.isfinite(value)):
                raise SceneError(
                    f"{what}.{name} returns {f'{of} = ' * bool(of)}{shorten(value)} at no motion; "
                    f"it must return a number there{place_of(law)}"
                )


CALLED = ("energy", "limit", "resistance", "sliding", "increments")
"""Methods that a law of a connector may define."""


def require_limit(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`SceneError` unless increments of a law have a limit for ever longer steps."""
    motion, rest = (law.given([np.full(1, x)] * law.components) for x in (0.5, 0.0))
    with np.errstate(all="ignore"):
        changes = law.increments(motion, rest, law.initially(), np.inf) if law.variables else {}
    for name, change in changes.items():
        if not np.all(np.isfinite(change)):
            raise SceneError(
                f"{what}: {type(law).__name__}.increments returns {name} = {shorten(change)} for "
                "dt = inf, and steps of a path are infinitely slow; state it so that it has a "
                f"limit, as a / (b / dt + c), or use simulate(scene, Static(), ...){place_of(law)}"
            )


def place_of(law: object) -> str:
    """Return file and line of the class of a law in brackets, if they are known."""
    try:
        file, (_, line) = inspect.getsourcefile(type(law)), inspect.getsourcelines(type(law))
    except (OSError, TypeError):
        return ""
    return f" ({file}, line {line})"


def judges_loss(law: ConnectorLaw) -> bool:
    """Return whether what a law of a connector loses is its own dissipation, whatever the step.

    With variables it is, up to an error of the step, unless the energy is quadratic.
    """

    def energy(factor: float) -> list[float]:
        draw = np.random.default_rng(0).uniform
        state = State({name: factor * draw(-1.0, 1.0, 1) for name in law.variables})
        with np.errstate(all="ignore"):
            motions = [factor * draw(-1.0, 1.0, 1) for _ in range(law.components)]
            return [float(np.sum(law.energy(law.given(motions), state)))]

    return not law.active and (not law.variables or quadratic(energy))
