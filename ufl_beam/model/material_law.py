# SPDX-License-Identifier: MIT
"""Base class of material laws: stress, evolution of internal variables, energies."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager
from dataclasses import fields
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from ufl_beam.errors import ModelError, calling, shorten

Values = Any
"""Array of real or complex numbers, or a UFL expression; for interacting resultants a tuple."""


class State:
    """Internal variables of a law as attributes."""

    def __init__(self, variables: Mapping[str, Values]) -> None:
        vars(self).update(variables)

    def __getattr__(self, name: str) -> Values:
        raise AttributeError(
            f"the law has no internal variable {name!r}; its variables: {', '.join(vars(self))}"
        )


class MaterialLaw(ABC):
    """Base of the laws of material points; a user's law is a frozen dataclass derived from it.

    The fields of the dataclass are the parameters of the law.  The methods are called with arrays
    and with UFL expressions; therefore they use ``ub.extend.law_functions``.  Methods read the
    elastic stiffness at the point from ``self.C``: EA, GA or EI of a resultant in a
    :class:`Section`, Young's modulus of a fibre, or the stiffness of a :class:`Spring`.  A law with
    internal variables defines either :meth:`increments` or :meth:`residuals`.  Energies are per
    volume for fibres, per length for resultants, total for springs.  See docs/extending_laws.md.

    Attributes:
        variables: Initial values of the internal variables, by name.
        resultants: ``"NM"`` or ``"NVM"`` if the law couples these resultants; strain, stress and
            ``C`` are then tuples.  By default a law has one strain and one stress.
        C: Elastic stiffness.
        length: Length of the cell of a fibre or resultant; m.  Laws whose energy is per area, such
            as fracture energies, divide by it.  It is 1 for springs.
        active: True if the law may supply energy, for example by swelling.  Otherwise a step is
            refused if the solution of :meth:`residuals` has a negative dissipation.
        records_path: True if the variables record the path of the strain, such as its largest value
            or its last reversal, at any rate of strain.  :meth:`increments` is then also called
            with the strain at the end of the step, and variables are not extrapolated from t_n+θ.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Dashpot(ub.extend.MaterialLaw):
        ...     eta: float  # N m² s
        ...     variables = {"creep": 0.0}  # 1/m
        ...     def stress(self, strain, state):
        ...         return self.C * (strain - state.creep)
        ...     def increments(self, strain, state, dt):
        ...         return {"creep": self.stress(strain, state) / (self.eta / dt + self.C)}
        ...     def elastic_energy(self, strain, state):
        ...         return self.C * (strain - state.creep) ** 2 / 2
        >>> creeps = ub.Section(EA=4e9, GA=1e9, EI=1.4e7, rhoA=157.0, bending=Dashpot(1e9))
    """

    variables: ClassVar[Mapping[str, float]] = {}
    resultants: ClassVar[str] = ""
    active: ClassVar[bool] = False
    records_path: ClassVar[bool] = False
    C: Values
    length: Values = 1.0

    @abstractmethod
    def stress(self, strain: Values, state: State) -> Values:
        """Return the stress; its derivative by the strain is ``C`` if elasticity is linear."""

    @abstractmethod
    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Return the density of the stored energy without the energy of hardening."""

    def hardening_energy(self, state: State) -> Values:
        """Return the density of the energy that hardening stores; zero by default."""
        return 0.0

    def increments(self, strain: Values, state: State, dt: Values) -> Mapping[str, Values]:
        """Return increments of the variables in a backward-Euler step, in closed form.

        Args:
            strain: Strain at the end of the step.
            state: Variables at the beginning of the step.
            dt: Length of the step; s.
        """
        return {}

    def fault(self, C: Values, length: float) -> str:
        """Return the error of the parameters at points of stiffness ``C``; empty if there is none.

        ``length`` is the length of the cell, or 0 before cells are known; m.
        """
        return ""

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Return the residuals of a backward-Euler step, one for each variable.

        Args:
            strain: Strain at the end of the step.
            old: Variables at the beginning of the step.
            new: Variables at the end of the step.
            dt: Length of the step; s.
        """
        return {}

    def dissipation(
        self, strain: Values, state: State, changes: State, dt: Values
    ) -> Values | None:
        """Return the density of the energy that a step dissipates.

        None, the default, stands for the work that is neither stored nor lost by the time scheme.

        Args:
            strain: Strain at the instant of the step at which the law holds; with ``records_path``
                at the end of the step.
            state: Variables at this instant.
            changes: Increments of the variables in the step.
            dt: Length of the step; s.
        """
        return None

    @property
    def elastic(self) -> bool:
        """True if the internal variables never change; False by default."""
        return False

    def parameters(self, C: Values) -> dict[str, Any]:
        """Return the parameters by name, at points of stiffness ``C``; by default the fields."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def with_parameters(self, C: Values, parameters: Mapping[str, Values]) -> MaterialLaw:
        """Return the law with stiffness ``C`` and other parameters: numbers, arrays or symbols."""
        law = copy.copy(self)
        vars(law).update(parameters, C=C)
        return law

    @property
    def solves(self) -> bool:
        """True if Newton's method finds the variables from :meth:`residuals`."""
        return type(self).residuals is not MaterialLaw.residuals

    @property
    def prestressed(self) -> bool:
        """True if laws of this class have a stress at zero strain for some parameters."""
        law = copy.copy(self)  # with irrational parameters, so that terms do not cancel
        vars(law).update({name: math.sqrt(k + 2) for k, name in enumerate(vars(self))})
        unit = uniform(self, 1.0)
        return any(np.any(σ != 0) for σ in _at_no_strain(law.with_parameters(unit, {})))

    def stressed(self, C: tuple[Values, ...], least: tuple[Values, ...]) -> bool:
        """Return whether a stress at zero strain exceeds ``C`` times the strain ``least``."""
        stresses = _at_no_strain(_sample(self, C))
        return any(np.any(abs(σ) > c * e) for σ, c, e in zip(stresses, C, least, strict=True))

    @property
    def must_dissipate(self) -> bool:
        """True if solutions of :meth:`residuals` with a negative dissipation are refused."""
        return self.solves and not self.active

    def as_tuple(self, values: Values) -> tuple[Values, ...]:
        """Return strains or stresses of a point as a tuple, also if the law has only one."""
        return tuple(values) if self.resultants else (values,)

    def as_argument(self, values: tuple[Values, ...]) -> Values:
        """Return strains or stiffnesses as an argument of methods: a tuple, or a single value."""
        return values if self.resultants else values[0]


def uniform(law: MaterialLaw, value: Values) -> Values:
    """Return equal strains or stiffnesses as an argument of the methods of a law."""
    return law.as_argument(tuple(value for _ in law.resultants or "x"))


def _sample(law: MaterialLaw, C: tuple[Values, ...] = ()) -> MaterialLaw:
    """Return a law with the stiffness ``C`` (by default 1), and 1 for each random parameter."""
    at = law.as_argument(C) if C else uniform(law, np.ones(1))
    parameters = law.parameters(at).items()
    return law.with_parameters(
        at, {n: np.ones(1) if hasattr(x, "draw") else x for n, x in parameters}
    )


def _at_no_strain(law: MaterialLaw) -> tuple[Values, ...]:
    """Return the stresses at zero strain, with the initial variables."""
    none = uniform(law, np.zeros(1))
    with np.errstate(all="ignore"):
        return law.as_tuple(law.stress(none, initial_state(law)))


def initial_state(law: Any) -> State:
    """Return the initial internal variables, each (1,)."""
    return State({name: np.full(1, float(x)) for name, x in law.variables.items()})


# -- checks --------------------------------------------------------------------------------------


def require_law(law: object, what: str, interaction: bool = False) -> None:
    """Raise :class:`ModelError` unless a law is complete, by calls at zero strain.

    With ``interaction`` the law must couple resultants, otherwise it must have one stress.
    """
    if not isinstance(law, MaterialLaw):
        raise ModelError(f"{what} = {shorten(law)} is not an ElastoPlastic or another MaterialLaw")
    kind = f"{what}: {type(law).__name__}"
    require_fields(law, MaterialLaw, kind)
    ways = [w for w in EVOLUTION_METHODS if getattr(type(law), w) is not getattr(MaterialLaw, w)]
    if len(ways) != (1 if law.variables else len(ways)):
        has = "both increments and residuals" if ways else "neither increments nor residuals"
        raise ModelError(f"{kind} has {has}; define one of the two methods")
    if law.records_path and ways == ["residuals"]:
        raise ModelError(
            f"{kind} has records_path = True and residuals; such laws define increments"
        )
    for name in law.variables:
        if not name.isidentifier():
            raise ModelError(
                f"{kind}.variables: the law cannot read state.{name}; {name!r} is no identifier"
            )
    parameters = law.parameters(uniform(law, np.ones(1)))
    if "C" in parameters:
        raise ModelError(f"{kind}.parameters has the name C, the name of the elastic stiffness")
    for name, value in parameters.items():
        if not hasattr(value, "draw"):
            require_field(value, f"{kind}: {name}", Real | np.ndarray)
    tried, state = _sample(law), initial_state(law)
    strain = uniform(law, np.zeros(1))
    method = (*ways, "increments")[0]
    calls = {
        "stress": (strain, state),
        "elastic_energy": (strain, state),
        "hardening_energy": (state,),
        method: (strain, state, *([state] if method == "residuals" else []), 1.0),
        "dissipation": (strain, state, state, 1.0),
    }
    for name, arguments in calls.items():
        with calling(f"{kind}.{name} fails at zero strain"):
            result = getattr(tried, name)(*arguments)
        if name == method:
            require_names(result, law, f"{kind}.{name}")
        elif name == "stress" and not np.all(np.isfinite(law.as_tuple(result))):
            raise ModelError(
                f"{kind}.stress is {shorten(result)} at zero strain; it must be a number"
            )
        elif name == "stress" and len(law.as_tuple(result)) != len(law.resultants or "x"):
            raise ModelError(f"{kind}.stress must return one stress for each of {law.resultants}")
    if interaction and law.resultants not in ("NM", "NVM"):
        raise ModelError(
            f"{what} = {shorten(law)} is no law of N and M together, which has resultants = 'NM' "
            "or 'NVM'; use it as axial, shear or bending"
        )
    if law.resultants and not interaction:
        raise ModelError(
            f"{what} = {shorten(law)} couples the resultants {law.resultants}; use it as "
            "Section(interaction=)"
        )


def require_fields(law: Any, base: type, what: str, but: Collection[str] = ()) -> None:
    """Raise :class:`ModelError` unless a law is a frozen dataclass with admissible field names.

    Names of members of ``base`` are not admissible, except for the names in ``but``.
    """
    parameters = getattr(type(law), "__dataclass_params__", None)
    if parameters is None or not parameters.frozen or not parameters.eq:
        raise ModelError(f"{what} must be a dataclass: @dataclass(frozen=True)")
    reserved = {*vars(base), *base.__annotations__} - {*but}
    if taken := sorted(reserved & {field.name for field in fields(law)}):
        used = ": C is the elastic stiffness at the point, others are its methods and attributes"
        raise ModelError(
            f"{what}: a field cannot have the name {' or '.join(taken)}, which every "
            f"{base.__name__} gives to something else{used if base is MaterialLaw else ''}"
        )


def require_field(value: object, what: str, kinds: Any = Real) -> None:
    """Raise :class:`ModelError` unless the value of a field has one of the types ``kinds``."""
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise ModelError(
            f"{what} = {shorten(value)} is no number; fields of a law are numbers, its other "
            "attributes can be class variables"
        )
    if np.isnan(value).any():
        raise ModelError(f"{what} = {shorten(value)} is not a number; infinity is allowed")


EVOLUTION_METHODS = ("increments", "residuals")
"""Methods for the evolution of variables; a law with variables defines exactly one of them."""


def traced(law: object) -> AbstractContextManager[None]:
    """Return a context that turns errors of a law, called with UFL symbols, into ModelErrors."""
    return calling(f"{type(law).__name__}: it cannot be called with symbols of UFL", WRITTEN)


WRITTEN = ". Laws are written with + - * / ** and the functions of ub.extend.law_functions"
"""Advice in the errors of laws that cannot be called."""


def require_names(result: object, law: Any, what: str) -> None:
    """Raise :class:`ModelError` unless ``result`` is a dict with exactly the variables of a law."""
    if not isinstance(result, Mapping):
        raise ModelError(
            f"{what} returns {shorten(result)}; it must return a dict with the names "
            f"{', '.join(law.variables)}"
        )
    missing, unknown = (
        sorted(set(first) - set(second))
        for first, second in ((law.variables, result), (result, law.variables))
    )
    if missing or unknown:
        wrong = [f"lacks {', '.join(missing)}"] * bool(missing)
        wrong += [f"has {', '.join(unknown)}, which `variables` does not name"] * bool(unknown)
        raise ModelError(f"{what}: the returned dict {' and '.join(wrong)}")


def dissipation_must_grow(law: MaterialLaw) -> bool:
    """Return whether the dissipation of a law must not decrease in a run, for any step length.

    The entry "plastic" of the ledger is exact if the law defines ``dissipation``, or has quadratic
    energies.  Otherwise the entry has an integration error of either sign.  An active law may
    supply energy.
    """
    defined = type(law).dissipation is not MaterialLaw.dissipation
    return not law.active and (defined or has_quadratic_energies(law))


def has_quadratic_energies(law: MaterialLaw) -> bool:
    """Return whether the energies of a law are quadratic in strains and variables."""
    tried = _sample(law)
    hardening = quadratic(law, 1, lambda _, state: tried.hardening_energy(state))
    return hardening and quadratic(law, len(law.resultants or "x"), tried.elastic_energy)


def quadratic(law: Any, number: int, energy: Callable[[Any, State], Values]) -> bool:
    """Return whether an energy is quadratic in ``number`` strains or motions and the variables."""

    def value(factor: float) -> float:
        draw = np.random.default_rng(0).uniform
        strains = tuple(factor * draw(-1.0, 1.0, 1) for _ in range(number))
        state = State({name: factor * draw(-1.0, 1.0, 1) for name in law.variables})
        with np.errstate(all="ignore"):
            return float(np.sum(energy(law.as_argument(strains), state)))

    # Doubling of the arguments is exact in floating-point arithmetic.
    return bool(np.isclose(value(2.0), 4.0 * value(1.0), rtol=1e-12, atol=0.0))
