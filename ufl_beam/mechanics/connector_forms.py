# SPDX-License-Identifier: MIT
"""Forms of connectors: the forces of a law on the variations of relative motions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
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

    work: ufl.Form  # virtual work, and a row ``row[:n]·e + row[n] λ - row[n + 1]`` of each motion
    tangent: ufl.Form  # its derivative by the configuration
    motion: ufl.Form  # the n relative motions e by cell
    rate: ufl.Form  # their derivatives along ``u``
    change: ufl.Form  # derivative of the tangent along ``u``; ``bend`` is that of row[:n] by e
    numbers: fem.Function  # see :class:`Numbers`; of each motion
    row: fem.Function
    q0: fem.Function
    q1: fem.Function
    bend: fem.Function
    u: fem.Function


@stated
def connector_forms(motions: Sequence[str], scheme: Scheme, cell: meshes.Mesh) -> ConnectorForms:
    """Forms on cells of unit length, from one node of a connector to the other."""
    n = len(motions)
    line = basix.ufl.element("Lagrange", "interval", 1)
    point = basix.ufl.element("DG", "interval", 0)
    space = fem.functionspace(cell, basix.ufl.mixed_element([line, line, line, *n * [point]]))
    numbers, row, bend, of_cell = (
        fem.Function(fem.functionspace(cell, ("DG", 0, (size,))))
        for size in (8 * n, n * (n + 2), n**3, n)
    )
    q0, q1, u = (fem.Function(space) for _ in range(3))
    (before, _), (now, λ), (w, w_λ) = map(_split, (q0, q1, ufl.TestFunction(space)))
    dx = ufl.Measure("dx", domain=cell, metadata={"quadrature_degree": 1})
    dq, z = ufl.TrialFunction(space), ufl.TestFunction(of_cell.function_space)
    e, e_w = [], []
    for k, motion in enumerate(motions):
        at = range(8 * k, 8 * k + 8, 2)
        mine = Numbers(*(ufl.as_vector([numbers[i], numbers[i + 1]]) for i in at))
        e.append(MOTIONS[motion].value(now, mine))
        e_w.append(MOTIONS[motion].variation(before, now, w, mine, scheme))
    de, du = ([ufl.derivative(one, q1, along) for one in e] for along in (dq, u))
    density, of_rows, of_motions = 0, 0, 0
    for i in range(n):
        first = i * (n + 2)
        law = sum(row[first + j] * e[j] for j in range(n))
        density += λ[i] * e_w[i] + w_λ[i] * (law + row[first + n] * λ[i] - row[first + n + 1])
        of_motions += e[i] * z[i]
        for j, k in product(range(n), repeat=2):
            of_rows += w_λ[i] * bend[n * (n * i + j) + k] * du[k] * de[j]
    work, by_cell = density * dx, of_motions * dx
    tangent = ufl.derivative(work, q1, dq)
    change = ufl.derivative(tangent, q1, u) + of_rows * dx
    rate = ufl.derivative(by_cell, q1, u)
    return ConnectorForms(work, tangent, by_cell, rate, change, numbers, row, q0, q1, bend, u)


def _split(q: Expr) -> tuple[Pair, Sequence[Expr]]:
    """Split coefficients into both configurations, values at the ends of a cell, and the forces."""
    parts = ufl.split(q)

    def at(end: float) -> Expr:
        return ufl.as_vector([x + end / 2 * ufl.grad(x)[0] for x in parts[:3]])

    return Pair(at(-1.0), at(1.0)), parts[3:]
