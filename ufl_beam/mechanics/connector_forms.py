# SPDX-License-Identifier: MIT
"""Forms of connectors: the force of a law on the variation of a relative motion."""

from __future__ import annotations

from typing import NamedTuple

import basix.ufl
import ufl
from ufl.core.expr import Expr

from ufl_beam.dolfinx_compat import fem
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.mechanics.relative_motions import MOTIONS, Numbers, Pair
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.memory import stated


class ConnectorForms(NamedTuple):
    """Forms of connectors with the coefficients that they are written in."""

    work: ufl.Form  # virtual work, and the row ``row[0] e + row[1] λ - row[2]`` of a law
    tangent: ufl.Form  # its derivative by the configuration
    motion: ufl.Form  # the relative motion e by cell
    rate: ufl.Form  # its derivative along ``u``
    change: ufl.Form  # derivative of the tangent along ``u``; ``bend`` is that of row[0] by e
    numbers: fem.Function  # see :class:`Numbers`
    row: fem.Function
    q0: fem.Function
    q1: fem.Function
    bend: fem.Function
    u: fem.Function


@stated
def connector_forms(motion: str, scheme: Scheme, cell: meshes.Mesh) -> ConnectorForms:
    """Forms on cells of unit length, from one node of a connector to the other."""
    line = basix.ufl.element("Lagrange", "interval", 1)
    point = basix.ufl.element("DG", "interval", 0)
    space = fem.functionspace(cell, basix.ufl.mixed_element([line, line, line, point]))
    numbers, row, bend = (
        fem.Function(fem.functionspace(cell, ("DG", 0, shape))) for shape in ((8,), (3,), ())
    )
    q0, q1, u = (fem.Function(space) for _ in range(3))
    (before, _), (now, λ), (w, w_λ) = map(_split, (q0, q1, ufl.TestFunction(space)))
    n = Numbers(*(ufl.as_vector([numbers[i], numbers[i + 1]]) for i in (0, 2, 4, 6)))
    e = MOTIONS[motion].value(now, n)
    e_w = MOTIONS[motion].variation(before, now, w, n, scheme)
    dx = ufl.Measure("dx", domain=cell, metadata={"quadrature_degree": 1})
    dq, z = ufl.TrialFunction(space), ufl.TestFunction(bend.function_space)
    work = (λ * e_w + w_λ * (row[0] * e + row[1] * λ - row[2])) * dx
    tangent, by_cell = ufl.derivative(work, q1, dq), e * z * dx
    of_rows = w_λ * bend * ufl.derivative(e, q1, u) * ufl.derivative(e, q1, dq) * dx
    change = ufl.derivative(tangent, q1, u) + of_rows
    rate = ufl.derivative(by_cell, q1, u)
    return ConnectorForms(work, tangent, by_cell, rate, change, numbers, row, q0, q1, bend, u)


def _split(q: Expr) -> tuple[Pair, Expr]:
    """Split coefficients into both configurations, values at the ends of a cell, and the force."""
    *components, force = ufl.split(q)

    def at(end: float) -> Expr:
        return ufl.as_vector([x + end / 2 * ufl.grad(x)[0] for x in components])

    return Pair(at(-1.0), at(1.0)), force
