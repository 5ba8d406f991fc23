# SPDX-License-Identifier: MIT
"""Checks of laws of material points when the section or spring is made that follows them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from numbers import Real

import numpy as np

from ufl_beam.errors import SceneError, require_number, require_text, shorten
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.works import ENTRIES, LOSSES


def require_bulk_law(law: object, what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless a bulk can follow a law."""
    require_law(law, what)
    if resultants := law.resultants:  # type: ignore[attr-defined]
        raise SceneError(
            f"{what} = {shorten(law)} is a law of {resultants} together; use it as "
            "Section(interaction=)"
        )


def require_interaction(law: object, what: str) -> None:
    """Raise :class:`SceneError` naming ``what`` unless resultants of a section can follow a law."""
    require_law(law, what)
    if law.resultants not in ("NM", "NVM"):  # type: ignore[attr-defined]
        raise SceneError(
            f"{what} = {shorten(law)} is no law of N and M together, with resultants = 'NM' or "
            "'NVM'; use it as axial, shear or bending"
        )


def require_law(law: object, what: str) -> None:
    """Raise :class:`SceneError` unless a law is complete; it is called with numbers."""
    if not isinstance(law, MaterialLaw):
        raise SceneError(f"{what} = {shorten(law)} is not a Hardening or another MaterialLaw")
    kind = type(law).__name__
    _require_dataclass(law, f"{what}: {kind}")
    if taken := sorted(RESERVED & {field.name for field in fields(law)}):  # type: ignore[arg-type]
        raise SceneError(
            f"{what}: {kind}: a field cannot have the name {' or '.join(taken)}, which every "
            "MaterialLaw gives to something else: C is the elastic stiffness at the point, the "
            "others are its methods and attributes"
        )
    ways = [w for w in WAYS if getattr(type(law), w) is not getattr(MaterialLaw, w)]
    if len(ways) != (1 if law.variables else len(ways)):
        has = "both increments and residuals" if ways else "neither increments nor residuals"
        raise SceneError(f"{what}: {kind} has {has}; define one of both methods")
    C = tuple(np.ones(1) for _ in law.resultants or "x")
    numbers = law.numbers(law.as_argument(C))
    if "C" in numbers:
        raise SceneError(f"{what}: {kind}.numbers has the name C, that of the elastic stiffness")
    for name, value in numbers.items():
        number = isinstance(value, Real | np.ndarray) and not isinstance(value, bool)
        if not number and not hasattr(value, "draw"):
            raise SceneError(
                f"{what}: {kind}: {name} = {shorten(value)} is no number; fields of a law are its "
                "numbers, what else it knows can be a class variable"
            )
    tried = law.of(
        law.as_argument(C), {n: np.ones(1) if hasattr(v, "draw") else v for n, v in numbers.items()}
    )
    state = State({name: np.full(1, float(x)) for name, x in law.variables.items()})
    _try(tried, state, f"{what}: {kind}", (*ways, "increments")[0])


def require_connector_law(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`SceneError` unless a law of a connector is complete; it is called at no motion.

    Its methods are compiled when a run begins.
    """
    what = f"{what}: {type(law).__name__}"
    _require_dataclass(law, what)
    reserved = {*vars(ConnectorLaw), *ConnectorLaw.__annotations__}
    if taken := sorted(reserved & set(law.numbers())):
        raise SceneError(
            f"{what}: a field cannot have the name {' or '.join(taken)}, which every ConnectorLaw "
            "gives to something else"
        )
    for name, value in law.numbers().items():
        require_number(value, f"{what}: {name}")
    stated = {n for n in CALLED if getattr(type(law), n) is not getattr(ConnectorLaw, n)}
    if not stated & {"energy", "resistance"}:
        raise SceneError(f"{what} has neither energy nor resistance; define one of both methods")
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
    motion, state = np.zeros(1), law.initially()
    calls = {"energy": (motion, state)}
    calls |= dict.fromkeys(CALLED[1:], (motion, motion, state, 1.0))  # type: ignore[arg-type]
    for name, arguments in calls.items():
        try:
            with np.errstate(all="ignore"):
                found = getattr(law, name)(*arguments)
        except Exception as error:
            raise SceneError(f"{what}.{name} fails at no motion: {error}{place_of(law)}") from error
        if name == "increments":
            _require_names(found, law, f"{what}.{name}")
        for of, value in found.items() if name == "increments" else [("", found)]:
            number = isinstance(value, Real) or np.shape(value) == (1,)
            if not number or not np.all(np.isfinite(value)):
                raise SceneError(
                    f"{what}.{name} returns {f'{of} = ' * bool(of)}{shorten(value)} at no motion; "
                    f"it must return a number there{place_of(law)}"
                )


CALLED = ("energy", "resistance", "increments")
"""Methods that a law of a connector may define."""


def require_limit(law: ConnectorLaw, what: str) -> None:
    """Raise :class:`SceneError` unless increments of a law have a limit for ever longer steps."""
    motion, rest = np.full(1, 0.5), np.zeros(1)
    with np.errstate(all="ignore"):
        changes = law.increments(motion, rest, law.initially(), np.inf) if law.variables else {}
    for name, change in changes.items():
        if not np.all(np.isfinite(change)):
            raise SceneError(
                f"{what}: {type(law).__name__}.increments returns {name} = {shorten(change)} for "
                "dt = inf, and steps of a path are infinitely slow; state it so that it has a "
                f"limit, as a / (b / dt + c){place_of(law)}"
            )


def place_of(law: object) -> str:
    """Return file and line of the class of a law in brackets, if they are known."""
    try:
        file, (_, line) = inspect.getsourcefile(type(law)), inspect.getsourcelines(type(law))
    except (OSError, TypeError):
        return ""
    return f" ({file}, line {line})"


def _require_dataclass(law: object, what: str) -> None:
    parameters = getattr(type(law), "__dataclass_params__", None)
    if parameters is None or not parameters.frozen or not parameters.eq:
        raise SceneError(f"{what} must be a dataclass: @dataclass(frozen=True)")


RESERVED = frozenset({*vars(MaterialLaw), *MaterialLaw.__annotations__})
"""Names that a field of a law cannot have."""

WAYS = ("increments", "residuals")
"""Methods of a law by which its variables evolve."""


def _try(law: MaterialLaw, state: State, what: str, way: str) -> None:
    """Call the methods of a law at no strain; raise :class:`SceneError` if they do not fit."""
    strain = law.as_argument(tuple(np.zeros(1) for _ in law.resultants or "x"))
    between = (state,) if way == "increments" else (state, state)
    calls = {
        "stress": (strain, state),
        "elastic_energy": (strain, state),
        "hardening_energy": (state,),
        way: (strain, *between, 1.0),
        "dissipation": (strain, state, state, 1.0),
    }
    for name, arguments in calls.items():
        try:
            with np.errstate(all="ignore"):
                found = getattr(law, name)(*arguments)
        except Exception as error:
            raise SceneError(f"{what}.{name} fails at no strain: {error}") from error
        if name == way:
            _require_names(found, law, f"{what}.{name}")
        elif name == "stress" and not np.all(np.isfinite(law.as_tuple(found))):
            raise SceneError(f"{what}.stress is {shorten(found)} at no strain; it must be a number")
        elif name == "stress" and len(law.as_tuple(found)) != len(law.resultants or "x"):
            raise SceneError(f"{what}.stress must return one stress for each of {law.resultants}")


def _require_names(found: object, law: MaterialLaw | ConnectorLaw, what: str) -> None:
    """Raise :class:`SceneError` unless a method returned the variables of a law by name."""
    if not isinstance(found, Mapping):
        raise SceneError(
            f"{what} returns {shorten(found)}; it must return a dict with the names "
            f"{', '.join(law.variables)}"
        )
    missing, unknown = (
        sorted(set(one) - set(other))
        for one, other in ((law.variables, found), (found, law.variables))
    )
    if missing or unknown:
        wrong = [f"lacks {', '.join(missing)}"] * bool(missing)
        wrong += [f"has {', '.join(unknown)}, which `variables` does not name"] * bool(unknown)
        raise SceneError(f"{what}: what it returns {' and '.join(wrong)}")


def judges_dissipation(law: MaterialLaw) -> bool:
    """Return whether the entry "plastic" of a law is its own dissipation, whatever the step.

    So it is if the law states it, and if energies are quadratic.  Else the entry has an error of
    the rule by which works are integrated, of either sign.  An active law may give energy.
    """
    stated = type(law).dissipation is not MaterialLaw.dissipation
    return not law.active and (stated or has_quadratic_energies(law))


def judges_loss(law: ConnectorLaw) -> bool:
    """Return whether what a law of a connector loses is its own dissipation, whatever the step.

    With variables it is, up to an error of the step, unless the energy is quadratic.
    """

    def energy(factor: float) -> list[float]:
        draw = np.random.default_rng(0).uniform
        state = State({name: factor * draw(-1.0, 1.0, 1) for name in law.variables})
        with np.errstate(all="ignore"):
            return [float(np.sum(law.energy(factor * draw(-1.0, 1.0, 1), state)))]

    return not law.active and (not law.variables or _quadratic(energy))


def has_quadratic_energies(law: MaterialLaw) -> bool:
    """Return whether the energies of a law are quadratic in strains and variables."""
    C = tuple(np.ones(1) for _ in law.resultants or "x")
    numbers = law.numbers(law.as_argument(C)).items()
    tried = law.of(law.as_argument(C), {n: 1.0 if hasattr(v, "draw") else v for n, v in numbers})

    def energies(factor: float) -> list[float]:
        draw = np.random.default_rng(0).uniform
        strain = law.as_argument(tuple(factor * draw(-1.0, 1.0, 1) for _ in C))
        state = State({name: factor * draw(-1.0, 1.0, 1) for name in law.variables})
        with np.errstate(all="ignore"):
            found = tried.elastic_energy(strain, state), tried.hardening_energy(state)
        return [float(np.sum(x)) for x in found]

    return _quadratic(energies)


def _quadratic(energies: Callable[[float], list[float]]) -> bool:
    """Return whether energies of some numbers times a factor go with its square."""
    # Twice the numbers have the same digits.
    return bool(np.allclose(energies(2.0), 4.0 * np.array(energies(1.0)), rtol=1e-12, atol=0.0))
