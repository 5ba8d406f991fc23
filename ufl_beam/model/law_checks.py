# SPDX-License-Identifier: MIT
"""Checks of laws of material points when the section or spring is made that follows them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from numbers import Real
from typing import Any

import numpy as np

from ufl_beam.errors import SceneError, raised_at, shorten
from ufl_beam.model.material_law import MaterialLaw, State


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
    require_dataclass(law, f"{what}: {kind}")
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


def require_dataclass(law: object, what: str) -> None:
    """Raise :class:`SceneError` unless the class of a law is a frozen dataclass."""
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
            raise SceneError(
                f"{what}.{name} fails at no strain: {error}{raised_at(error)}"
            ) from error
        if name == way:
            require_names(found, law, f"{what}.{name}")
        elif name == "stress" and not np.all(np.isfinite(law.as_tuple(found))):
            raise SceneError(f"{what}.stress is {shorten(found)} at no strain; it must be a number")
        elif name == "stress" and len(law.as_tuple(found)) != len(law.resultants or "x"):
            raise SceneError(f"{what}.stress must return one stress for each of {law.resultants}")


@contextmanager
def traced(law: object) -> Iterator[None]:
    """Raise :class:`SceneError` naming a law that cannot be called with symbols of UFL."""
    try:
        yield
    except Exception as error:
        raise SceneError(
            f"{type(law).__name__}: it cannot be called with symbols of UFL: {error}"
            f"{raised_at(error)}. Laws are written with + - * / ** and the functions of "
            "ub.law_functions"
        ) from error


def require_names(found: object, law: Any, what: str) -> None:
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

    return quadratic(energies)


def quadratic(energies: Callable[[float], list[float]]) -> bool:
    """Return whether energies of some numbers times a factor go with its square."""
    # Twice the numbers have the same digits.
    return bool(np.allclose(energies(2.0), 4.0 * np.array(energies(1.0)), rtol=1e-12, atol=0.0))
