# SPDX-License-Identifier: MIT
"""Section forces along cells, from the forces between cells and nodes.

At the ends of a cell, section forces are the forces between the cell and its nodes, see
:mod:`ufl_beam.terms.cell_forces`.  Stresses, inertia, damping, loads and works (users' virtual
works and potentials) cause them.  So section forces are in equilibrium with all nodal forces, up to
the residual of the step.  Between the ends they follow from the resultant, the couple and, without
works, the first moments of the forces along the cell.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import lib
from ufl_beam.display import in_one_line
from ufl_beam.quadrature import gauss_rule


@in_one_line
class Diagram(NamedTuple):
    """Section forces along a beam, with two values at each inner vertex; (num_cells · points,).

    Attributes:
        s: Parameter of the beam, from 0 at its start to 1 at its end.
        N: Axial force, positive in tension; N.
        V: Shear force, along the normal to the left of the direction of the beam; N.
        M: Bending moment, positive with tension on the right of this direction; N m.

    Example:
        >>> diagram = solution.diagram(beam, points=2)  # at both ends of the four cells
        >>> print(diagram.s[:4], diagram.M[:4].round(-3))
        [0.   0.25 0.25 0.5 ] [-195000. -146000. -146000.  -98000.]
    """

    s: Array
    N: Array
    V: Array
    M: Array


@in_one_line
class DiagramInSpace(NamedTuple):
    """Section forces along a beam in space, in axes of the sections; (num_cells · points,).

    Attributes:
        s: Parameter of the beam, from 0 at its start to 1 at its end.
        N: Axial force, positive in tension; N.
        V2: Shear force along axis 2; N.
        V3: Shear force along axis 3; N.
        T: Torsional moment; N m.
        M2: Bending moment about axis 2, positive with tension on the side of axis 3; N m.
        M3: Bending moment about axis 3, positive with tension on the side opposite to axis 2; N m.

    Example:
        >>> tube = ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3, rho=7850.0)
        >>> arm = ub.Beam((0, 0, 0), (2, 0, 0), tube, up=(0, 0, 1))
        >>> pull = ub.PointLoad(arm.end, force=(0, 3.0, 5.0))
        >>> mast = ub.Scene([arm], supports=[ub.Clamped(arm.start)], loads=[pull])
        >>> run = ub.simulate(mast, ub.Static(), t=(0, 1), dt=1.0)
        >>> diagram = run.diagram(arm)
        >>> print(diagram.V2[0].round(3), diagram.V3[0].round(3))  # up, and to the right
        5.0 -3.0
    """

    s: Array
    N: Array
    V2: Array
    V3: Array
    T: Array
    M2: Array
    M3: Array


@in_one_line
class Material(NamedTuple):
    """State of the material in n cells at one time, or in one cell at n times.

    Attributes:
        forces: Section forces (N, V, M); (n, 3); N, N, N m.
        jump: Jump of the rotation in the hinge of a cell; (n,); rad.
        plastic: Energy dissipated by plastic strains; (n,); J.
        hinge: Energy dissipated by hinges, or by cracks of fibres; (n,); J.
    """

    forces: Array
    jump: Array
    plastic: Array
    hinge: Array


MIDDLE: Array = np.full(1, 0.5)
"""Middle of a cell, as a fraction of its length."""

GAUSS = [*zip(*(values.tolist() for values in gauss_rule(3)), strict=True)]
"""Points and weights of a Gauss rule from 0 to 1; it is exact for the integrals below."""


def section_force(
    resultants: Any, tangent: Callable[[Any], tuple[Any, Any]], *, works: bool
) -> Callable[[Any], tuple[Any, Any, Any]]:
    """Return a function that computes force (x, y) and moment at a fraction of a cell.

    The fraction is 0 at the start of the cell and 1 at its end.

    Args:
        resultants: Resultants of the cell, ``cell_number`` of loops.h: arrays or UFL expressions.
        tangent: Function of the fraction that returns the derivative (x, y) of the position with
            respect to the fraction, in the configuration of equilibrium.
        works: True if the scene has works: transverse forces then may have any distribution.
    """
    start, end, skew = (
        (resultants[k], resultants[k + 1]) for k in (lib.START_X, lib.END_X, lib.SKEW_X)
    )
    at_start, at_end, couple = (resultants[k] for k in (lib.START_M, lib.END_M, lib.COUPLE))

    def force(s: Any) -> list[Any]:
        bend = -6 * s * (1 - s)
        return [s * (a + b) - a + bend * c for a, b, c in zip(start, end, skew, strict=True)]

    def lever(s: Any) -> Any:
        """Return the mean from 0 to ``s`` of the cross product of tangent and force."""
        pairs = ((weight, tangent(at * s), force(at * s)) for at, weight in GAUSS)
        return sum(weight * (x[0] * f[1] - x[1] * f[0]) for weight, x, f in pairs)

    # The end moments determine an additional couple or, with works, the transverse forces.
    imbalance = at_start + at_end - couple + lever(1.0)
    if works:
        arms = [[6 * w * at * (1 - at) * x for x in tangent(at)] for at, w in GAUSS]
        x, y = (sum(column) for column in zip(*arms, strict=True))
        factor = imbalance / (x * x + y * y)
        skew = skew[0] - factor * y, skew[1] + factor * x
    else:
        couple = couple + imbalance
    return lambda s: (*force(s), s * (couple - lever(s)) - at_start)


def in_section(plane: tuple[Any, Any, Any], c: Any, s: Any) -> tuple[Any, Any, Any]:
    """Return (N, V, M) from (F_x, F_y, M); (c, s) is the direction of the axis."""
    x, y, M = plane
    return c * x + s * y, c * y - s * x, M


class ForcesAlongCells:
    """Section forces (N, V, M) at points of the cells of a scene.

    Attributes:
        angles: Directions of the smooth undeformed axis at both ends of cells; (num_cells, 2); rad.
        dofs: Degrees of freedom (u, v, ψ) of the nodes of cells; (num_cells, 3, degree + 1).
    """

    def __init__(self, numbering: Any) -> None:
        nodes = numbering.nodes_of_cells
        start, end, *inner = range(nodes.shape[1])
        self._mesh, self._along = numbering.mesh, [start, *inner, end]
        self.dofs: Index = numbering.dofs[nodes].transpose(0, 2, 1)
        self._works = bool(numbering.scene.works)
        self._places: Array = numbering.points[nodes[:, self._along]].transpose(2, 0, 1)
        self.angles: Array = numbering.axis_angles

    def __call__(
        self,
        cells: Index | slice,
        fractions: Array,
        resultants: Array,
        q: Array,
        *,
        in_plane: bool = False,
    ) -> Array:
        """Compute section forces at fractions of cells; N, N, N m.

        Args:
            cells: Indices of the cells, or one index repeated for each time.
            fractions: Fractions from 0 at the start to 1 at the end; (points,).
            resultants: Resultants ``cell_number`` of loops.h of the cells; (9, num_cells).
            q: Configurations (u, v, ψ) of the nodes in which the forces are in equilibrium;
                (num_cells, 3, degree + 1).
            in_plane: Return forces along x and y instead of N and V.

        Returns:
            (N, V, M), or (F_x, F_y, M) with ``in_plane``; (num_cells, points, 3).
        """
        u, v, ψ = q[:, :, self._along].transpose(1, 0, 2)
        x, y = self._places[:, cells] + (u, v)
        mesh, (start, end) = self._mesh, self.angles[cells].T

        def tangent(s: Array | float) -> tuple[Array, Array]:
            slopes = mesh.slopes(np.ravel(s)).T
            return x @ slopes, y @ slopes

        angle = np.outer(start, 1 - fractions) + np.outer(end, fractions)
        angle = angle + ψ @ mesh.weights(fractions).T  # complex for derivatives
        at = section_force(resultants[:, :, None], tangent, works=self._works)(fractions)
        forces = at if in_plane else in_section(at, np.cos(angle), np.sin(angle))
        return np.stack(forces, axis=2)
