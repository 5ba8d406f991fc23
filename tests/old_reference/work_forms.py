# SPDX-License-Identifier: MIT
"""Forms of a user's virtual works and potentials, and checks of the user's functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity
from ufl.core.expr import Expr
from ufl.domain import extract_domains

from ufl_beam.discretization.compiled_forms import cached_forms
from ufl_beam.discretization.function_spaces import Element
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import ModelError, shorten
from ufl_beam.mechanics.kinematics import split
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.works import VirtualWork, Work

GROWTH = "growth of works"
"""Name of the load factor of virtual works; its spaces distinguish it from parameters."""


class Statement(NamedTuple):
    """Forms of a virtual work or potential."""

    residual: ufl.Form  # minus the virtual work
    tangent: ufl.Form  # derivative of the residual; empty if it is zero
    parameters: Mapping[str, fem.Function]  # coefficients for numbers in the forms, by name
    energy: ufl.Form | None = None  # energy of a potential at the end of a step
    lost: ufl.Form | None = None  # energy that the scheme dissipates in a step

    def varies(self, work: Work) -> bool:
        """Return whether the energy of a potential may change in time without motion."""
        known = () if self.energy is None else self.energy.coefficients()
        varying = ["t", *(name for name, number in work.numbers.items() if callable(number))]
        return any(self.parameters[name] in known for name in varying)


class _Same:
    """Hashable wrapper of a user's function, compared by identity."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.function is self.function

    def __hash__(self) -> int:
        return id(self.function)


def statement(work: Work, element: Element, scheme: Scheme) -> Statement:
    """Return the forms of a work in a time scheme; they serve all beams and parameter values.

    Raises:
        ModelError: The function of the work fails, or returns no suitable expression.
    """
    names = tuple(work.numbers)
    return _statement(
        type(work), work.name, _Same(work.density), names, work.degree, element, scheme
    )


@cached_forms
def _statement(
    kind: type[Work], name: str, density: _Same, names: Sequence[str], degree: int,
    element: Element, scheme: Scheme,
) -> Statement:  # fmt: skip
    work = kind(name, density.function, numbers=dict.fromkeys(names, 1.0), degree=degree)
    state = _virtual_work_forms if issubclass(kind, VirtualWork) else _potential_forms
    functions = {name: element.in_cells() for name in ("t", "dt", GROWTH, *names)}
    residual, *energies = state(work, element, scheme, functions)
    derivative = ufl.derivative(residual, element.q1, ufl.TrialFunction(element.space))
    return Statement(residual, expand_derivatives(derivative), functions, *energies)


def _virtual_work_forms(
    work: Work, element: Element, scheme: Scheme, functions: Mapping[str, fem.Function]
) -> tuple[ufl.Form]:
    """Return the form of minus the virtual work."""
    q0, q1, w = element.q0, element.q1, element.w
    weight, v = scheme.load_weight, (q1 - q0) / functions["dt"]
    q = (1.0 - weight) * q0 + weight * q1
    known = {"q0": q0, "q1": q1, "q": q, "v": v, "w": w, "axis": element.anywhere, **functions}
    density, dx = _returned(work, known, element), element.dx(work.degree)
    try:
        check_form_arity(expand_derivatives(density * dx), (w,))
    except (ArityMismatch, ValueError):  # ValueError: UFL fails to write its message
        raise ModelError(
            f"{work}: the function must return an expression that is linear in w, such as f * w[1]"
        ) from None
    return (-functions[GROWTH] * density * dx,)


def _potential_forms(
    work: Work, element: Element, scheme: Scheme, functions: Mapping[str, fem.Function]
) -> tuple[ufl.Form, ufl.Form, ufl.Form | None]:
    """Return the forms of minus virtual work, energy at the end of a step, and dissipation."""
    q0, q1, w, q, dx = (
        element.q0,
        element.q1,
        element.w,
        element.configuration(),
        element.dx(work.degree),
    )
    energy = _returned(work, {"q": q, "axis": element.anywhere, **functions}, element)
    gradient = expand_derivatives(ufl.derivative(energy, q, w))
    if expand_derivatives(gradient * dx).empty():
        raise ModelError(f"{work}: the energy must depend on the configuration q")

    def along(direction: Expr, at: Expr) -> Expr:
        return ufl.replace(gradient, {q: at, w: direction})

    # For w equal to the increment of the nodes, s is the increment of q along the whole cell.
    axis = element.anywhere
    (_, ψ0), (_, ψ1), (w_u, w_ψ) = map(split, (q0, q1, w))
    pairs = zip(axis.at_nodes(ψ1 - ψ0), axis.at_nodes(w_ψ), strict=True)
    rotations = [scheme.virtual_rotation(0.0, change, variation) for change, variation in pairs]
    rotation, _ = axis.interpolate(rotations)
    s = ufl.as_vector([w_u[0], w_u[1], rotation])
    force = scheme.mean(lambda at: along(s, at), q0, q1)
    lost = None
    if scheme.alpha:
        α, direction = element.constant(scheme.alpha), q1 - q0
        force += α * (along(s, q1) - along(s, q0))
        lost = α * (along(direction, q1) - along(direction, q0)) * dx
    return force * dx, ufl.replace(energy, {q: q1}) * dx, lost


def _returned(work: Work, known: Mapping[str, Any], element: Element) -> Expr:
    """Return the expression of the function of a work, or raise :class:`ModelError`."""
    wanted = "an energy per length of components of q, such as k * q[1] ** 2 / 2"
    if isinstance(work, VirtualWork):
        wanted = "a virtual work per length, linear in components of w, such as f * w[1]"
    try:
        value = work.density(**{name: known[name] for name in work.used_arguments})
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{work}: the function fails: {shorten(error)}") from error
    if not isinstance(value, Expr):
        raise ModelError(
            f"{work}: the function returned {shorten(value)}; it must return an expression of UFL, "
            f"{wanted}"
        )
    if value.ufl_shape or value.ufl_free_indices:
        raise ModelError(
            f"{work}: the function returned a tensor of shape {value.ufl_shape}; it must return a "
            f"scalar, {wanted}"
        )
    if any(domain != element.space.mesh.ufl_domain() for domain in extract_domains(value)):
        raise ModelError(
            f"{work}: the function uses a mesh of its own; use axis.x for the place, and "
            "`numbers` for its parameters"
        )
    return value
