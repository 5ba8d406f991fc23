# SPDX-License-Identifier: MIT
"""Forces of a connector law in a step, and their derivatives by the motions."""

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives

from ufl_beam.compiled.c_library import doubles, ffi
from ufl_beam.discretization.compiled_forms import Pointwise
from ufl_beam.dolfinx_compat import TABULATE
from ufl_beam.mechanics.connector_equations import law_step

CELL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])


def ask(function, w, out):
    """Call a compiled function of values at a point."""
    more = [ffi.NULL] * (TABULATE[0].count(",") - 3)
    function(doubles(out), doubles(w), ffi.NULL, doubles(CELL), *more)


def compiled_law(law, scheme):
    """Return a function of named numbers, see ``law_step``: forces, then their derivatives."""
    motions = [f"motion {i}" for i in range(law.components)]
    names = [*motions, *(f"before {i}" for i in range(law.components)), "dt", "theta"]
    names += [f"state {x}" for x in law.variables] + [f"number {x}" for x in law.parameters()]
    pointwise = Pointwise(names)
    at = pointwise.at | {name: ufl.variable(pointwise.at[name]) for name in motions}
    forces = law_step(law, at, scheme).forces
    slopes = [ufl.diff(force, at[name]) for force in forces for name in motions]
    function = pointwise.compile(*map(expand_derivatives, (*forces, *slopes)))

    def law_at(given):
        out = np.zeros(len(forces) + len(slopes))
        ask(function, np.array([given[name] for name in names]), out)
        return out

    law_at.keeps = pointwise
    return law_at


def require_tangent(law, scheme, steps, ε, tolerance, *, dt=0.01, state=1e-3):
    """Derivatives of a law in steps between motions are central differences of its forces.

    ``tolerance`` returns the allowed error of the forces and derivatives of a step.
    """
    n, compiled = law.components, compiled_law(law, scheme)
    known = {f"number {x}": value for x, value in law.parameters().items()}
    known |= {"dt": dt, "theta": scheme.theta} | {f"state {x}": state for x in law.variables}

    def answers(e0, e1):
        before = {f"before {i}": x for i, x in enumerate(e0)}
        found = compiled(known | before | {f"motion {i}": x for i, x in enumerate(e1)})
        return found[:n], found[n:].reshape(n, n)

    for step in steps:
        e0, e1 = np.reshape(step, (2, n))
        force, slopes = answers(e0, e1)
        changes = [answers(e0, e1 + e)[0] - answers(e0, e1 - e)[0] for e in ε * np.eye(n)]
        error = np.abs(slopes - np.transpose(changes) / (2 * ε))
        assert (error <= tolerance(force, slopes)).all()
