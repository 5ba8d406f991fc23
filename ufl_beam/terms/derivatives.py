# SPDX-License-Identifier: MIT
"""Derivatives of terms by parameters of the scene, for the derivatives of runs.

UFL differentiates the forms by their coefficients and the laws by their inputs.  The derivatives of
the numbers in a term are differences between scenes with neighbouring values of a parameter; see
derivatives.c for the derivatives of a step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import ffi, lib, struct
from ufl_beam.discretization.compiled_forms import Kernel, cached_forms
from ufl_beam.dolfinx_compat import fem

Each = tuple[Any, ...]
"""Fields of ``term_derivative`` of loops.h."""


class Neighbours:
    """A term in scenes with neighbouring values of each parameter.

    Attributes:
        term: The term in the scene itself.
        terms: The same term in the neighbouring scenes; for each parameter a list.
        weights: Weights of the neighbours in the derivative by a parameter, (parameters, n).  The
            weight of the scene itself makes their sum zero.
    """

    def __init__(self, term: Any, terms: Sequence[Sequence[Any]], weights: Array) -> None:
        self.term, self.terms, self.weights = term, terms, weights
        self.alive = list[Any]()

    def __len__(self) -> int:
        """Number of parameters."""
        return len(self.terms)

    def differences(self, values: Callable[[Any], Array]) -> Array:
        """Return the derivatives of an array of the term; (parameters, *shape of the array)."""
        here = values(self.term)
        rows = []
        for some, weights in zip(self.terms, self.weights, strict=True):
            total = np.zeros(np.shape(here))
            for other, weight in zip(some, weights, strict=True):
                change = values(other) - here
                total += weight * np.where(np.isfinite(change), change, 0.0)
            rows.append(total)
        return np.array(rows)


@cached_forms
def _derivative(form: ufl.Form, coefficient: fem.Function) -> ufl.Form:
    trial = ufl.TrialFunction(coefficient.function_space)
    return ufl.derivative(form, coefficient, trial)


def form_derivative(
    form: ufl.Form, kernel: Kernel, compile_form: Callable[[ufl.Form], Kernel],
    coefficient: fem.Function, **direction: Any,
) -> Any:  # fmt: skip
    """Return ``form_derivative`` of loops.h for the derivative of a form by a coefficient.

    Args:
        form: Linear form in cells.
        kernel: The form compiled, with its values.
        compile_form: Compiles another form on the same cells.
        coefficient: Coefficient of the form, or its unknown.
        direction: Fields ``direction`` and ``stride``; none if the coefficient is q0.
    """
    table = compile_form(_derivative(form, coefficient))
    table.keep_entries()
    copies = table.copies_from(kernel)
    return struct(
        "form_derivative", form=kernel.cells, table=table.cells,
        columns=coefficient.function_space.element.space_dimension, copies=len(copies),
        copy=np.ascontiguousarray(copies), **direction,
    )  # fmt: skip


def form_derivatives(
    form: ufl.Form, kernel_of: Callable[[Any], Kernel], compile_form: Callable[[ufl.Form], Kernel],
    q0: fem.Function, neighbours: Neighbours, without: Sequence[fem.Function] = (),
) -> list[Each]:  # fmt: skip
    """Return derivatives of a form by q0, and by coefficients that depend on parameters."""
    kernel, made = kernel_of(neighbours.term), list[Each]()
    for coefficient in kernel.coefficients:
        if coefficient is q0:
            made.append(in_c("form", form_derivative(form, kernel, compile_form, q0)))
        elif not any(coefficient is x for x in without):
            change = neighbours.differences(lambda x, c=coefficient: kernel_of(x).get(c))
            if change.any():
                direction = {"direction": change.ravel(), "stride": change[0].size}
                f = form_derivative(form, kernel, compile_form, coefficient, **direction)
                made.append(in_c("form", f))
    return made


def differences(neighbours: Neighbours, size: int) -> Each:
    """Return the derivative of a term by numbers of the scene, as differences of its forces.

    The term in the neighbouring scenes takes the steps of the run, so that functions of time of a
    user and states that do not depend on the motion need no derivatives of their own.  Other
    derivatives of the term are those by the configuration before the step and by rates.
    """
    made = list[Any]()
    for term in (neighbours.term, *(x for some in neighbours.terms for x in some)):
        phases = term.made_phases.begin, term.made_phases.accept
        calls = [ffi.new("phase_call[]", list(some)) for some in phases]
        neighbours.alive.append(calls)
        both = [(len(some), call) for some, call in zip(phases, calls, strict=True)]
        made.append((*both, term.loops[0]))
    parameters, number = neighbours.weights.shape
    c = struct(
        "term_differences", parameters=parameters, neighbours=number, size=size,
        term=ffi.new("term_in_steps[]", made), weight=neighbours.weights, here=np.zeros(size),
    )  # fmt: skip
    return in_c("differences", c)


LINEARIZE = {
    "form": "tabulate_derivative", "points": "tabulate_points", "load": "differentiate_loads",
    "connectors": "tabulate_connectors", "differences": "begin_neighbours",
    "moving_loads": "differentiate_moving_loads", "guides": "find_tangents_before",
    "imposed": "find_imposed_directions", "damping": "tabulate_damping",
}  # fmt: skip
ACCEPT = {
    name: f"accept_{name}_derivative"
    for name in ("points", "load", "connectors", "differences", "moving_loads", "imposed")
}


def in_c(kind: str, data: Any) -> Each:
    """Return the fields of ``term_derivative`` of loops.h for data of a kind."""
    found = (LINEARIZE.get(kind), f"add_{kind}_derivative", ACCEPT.get(kind))
    has = (name if name and hasattr(lib, name) else None for name in found)
    return data, *(ffi.addressof(lib, name) if name else ffi.NULL for name in has)


def all_in_c(terms: Sequence[Each]) -> dict[str, Any]:
    """Return the fields ``terms`` and ``term`` of ``derivatives`` of loops.h."""
    array = ffi.new("term_derivative[]", terms)
    return {"terms": len(terms), "term": array}

