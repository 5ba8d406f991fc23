# SPDX-License-Identifier: MIT
"""Imposed strains of cells: temperature, shrinkage, tendons.

The terms of beam_forces.py subtract imposed strains from the strains of the configuration.  The
term of this module computes imposed strains in each step, and the work of the resultants on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, loop, struct
from ufl_beam.discretization.compiled_forms import Kernel, cached_forms
from ufl_beam.discretization.function_spaces import Element, Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import ArgumentError
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia
from ufl_beam.model.functions import value_at
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.terms.derivatives import Each, Neighbours, in_c
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, LoadTerm, Phases


@cached_forms
def imposed_at_points(element: Element) -> fem.Function:
    """Return the imposed strains of cells at both ends of a step; (6,); 1, 1, 1/m."""
    return element.at_points(6)


def elastic_strains(element: Element, *, imposed: bool) -> tuple[ufl.core.expr.Expr, ...]:
    """Return strains minus imposed strains at the beginning and at the end of a step; (3,)."""
    e0, e1 = (strain(q, element.axis) for q in (element.q0, element.q1))
    if not imposed:
        return e0, e1
    x = imposed_at_points(element)
    return e0 - ufl.as_vector([x[0], x[1], x[2]]), e1 - ufl.as_vector([x[3], x[4], x[5]])


@cached_forms
def work_on_imposed_strains(element: Element, scheme: Scheme) -> ufl.Form:
    """Return the work of elastic resultants on the change of imposed strains in a step."""
    e0, e1 = elastic_strains(element, imposed=True)
    now, w = scheme.resultants(element.stiffness, e0, e1, element.constant), scheme.weight_of_before
    before = scheme.resultants(element.stiffness, e0, e0, element.constant)
    acting = now if w == 0 else w * before + (1 - w) * now
    x = imposed_at_points(element)
    return sum(acting[k] * (x[3 + k] - x[k]) for k in range(3)) * element.dx(1)


class CellStrains:
    """Imposed strains of the cells of one term.

    Attributes:
        cells: Cells of the scene; (num_cells,).
        strains: Imposed strains at the integration points at both ends of the step;
            (num_cells, points, 2, 3); 1, 1, 1/m.
        c: ``imposed_cells`` of loops.h.
        directions: Derivatives of ``strains`` by parameters, if they are asked for; (parameters,
            num_cells, points, 2, 3).
        bars: Derivatives of a number by ``strains`` in a step, of the adjoint; of the same shape.
    """

    def __init__(self, cells: Index, fields: Sequence[Array]) -> None:
        self.cells = cells
        self.strains: Array = np.zeros((*fields[0].shape[:2], 2, 3))
        self._fields = [np.ascontiguousarray(field) for field in fields]
        self._kernels: list[Kernel] = []
        self.c = struct(
            "imposed_cells", cells=len(self.strains), points=self.strains.shape[1],
            field=ffi.new("double *[]", [doubles(field) for field in self._fields]),
            strains=self.strains,
        )  # fmt: skip

    def put(self, factors: Sequence[float]) -> None:
        """Set the strains at both ends of the step to their values for ``factors`` of loads."""
        self.strains[:] = 0.0
        for field, factor in zip(self._fields, factors, strict=True):
            self.strains += factor * field[:, :, None]
        for kernel in self._kernels:
            kernel.put(self._function, self.strains.reshape(len(self.strains), -1))

    def differentiate(self, neighbours: Sequence[Sequence[CellStrains | None]]) -> Array:
        """Create and return :attr:`directions`; ``neighbours`` see :class:`Neighbours`."""
        if any(other is None for some in neighbours for other in some):
            raise ArgumentError(
                "differentiate: imposed strains are zero for a neighbouring value of a parameter; "
                "choose another value"
            )
        self.bars = np.zeros(self.strains.shape)
        self.directions = np.zeros((len(neighbours), *self.strains.shape))
        return self.directions

    @property
    def now(self) -> Array:
        """Imposed strains at the end of the step; (num_cells points, 3)."""
        return self.strains[:, :, 1].reshape(-1, 3)

    def enter_forms(self, kernels: Sequence[Kernel], work: Kernel, function: fem.Function) -> None:
        """Write the strains in each step into ``function`` in the kernels of elastic cells."""
        self._function = function
        self._kernels = [kernel for kernel in (*kernels, work) if kernel.uses(function)]
        for kernel in self._kernels:
            kernel.put(function, self.strains.reshape(len(self.strains), -1))
        forms = [(kernel.cells, kernel.position(function)) for kernel in self._kernels]
        fill(self.c, forms=len(forms), form=ffi.new("form_of_step[]", forms), work=work.cells)

    def enter_points(self, inelastic: Any) -> None:
        """Subtract the strains in each step from the strains of cells with material points."""
        fill(self.c, inelastic=inelastic, before=np.zeros((self.strains.size // 6, 3)))


class ImposedStrains(LoadTerm):
    """Imposed strains in each step, times functions of time.

    The strains change between the ends of a step, as prescribed motions do.
    """

    def __init__(
        self, loads: Sequence[ImposedStrain], subdomain: Subdomain, scheme: Scheme, ledger: Ledger,
        t0: float,
    ) -> None:  # fmt: skip
        self._loads, self._subdomain, self._scheme, self._ledger = loads, subdomain, scheme, ledger
        # Loads with the same time function share an array; messages name the first load.
        owners = {id(load.amplitude): load for load in reversed(loads)}
        self._in_time = [(load.amplitude, load) for load in owners.values()]
        self._index = {key: k for k, key in enumerate(owners)}
        # Factors at the beginning and at the end of the step
        self._factors = np.zeros((2, len(owners)))
        if has_inertia(scheme):
            self._factors[:] = [value_at(f, t0, load) for f, load in self._in_time]
        self._cells: list[CellStrains] = []
        self.vector = struct("vector", size=0)
        self.loops = loop("subtract_vector", self.vector), None

    def on_cells(self, fields: Fields) -> CellStrains | None:
        """Return the imposed strains of the cells of ``fields``; None if there are none."""
        numbering, cells = self._subdomain.numbering, self._subdomain.cells[fields.order]
        points, weights = np.polynomial.legendre.leggauss(4)
        own = np.polynomial.legendre.leggauss(numbering.mesh.degree)[0]
        degree = len(own) - 1
        # Least squares: polynomials with the same moments, evaluated at the points of the cells
        moments = np.polynomial.legendre.legvander(points, degree) * weights[:, None]
        fitted = (np.arange(degree + 1) + 0.5) * np.polynomial.legendre.legvander(own, degree)
        shares = fitted @ moments.T
        arrays = np.zeros((len(self._in_time), len(cells), len(own), 3))
        for load in self._loads:
            beam_cells = numbering.cells_of(load.beam)
            mine = np.flatnonzero((cells >= beam_cells[0]) & (cells <= beam_cells[-1]))
            s = numbering.gauss_parameters(load.beam)[cells[mine] - beam_cells[0]]
            arrays[self._index[id(load.amplitude)], mine] += shares @ load.strains(s)
        if not arrays.any():
            return None
        self._cells.append(CellStrains(cells, [*arrays]))
        self._cells[-1].put(self._factors[1].tolist())
        return self._cells[-1]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the loops that begin and accept a step."""
        c = self._c = struct(
            "imposed_strains", functions=len(self._in_time), groups=len(self._cells),
            factor=callbacks.time_functions(self._in_time), factors=self._factors[0],
            factors_at_end=self._factors[1],
            group=ffi.new("imposed_cells *[]", [cells.c for cells in self._cells]),
            weight_of_before=self._scheme.weight_of_before,
            supplied=self._ledger.supplied.pointer("loads"),
        )  # fmt: skip
        change = loop("change_of_imposed_strains", c)
        begin, accept = loop("begin_imposed_strains", c), loop("accept_imposed_strains", c)
        return Phases([begin], [accept], change=change)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        parameters, number = neighbours.weights.shape
        others = [x._c for some in neighbours.terms for x in some]
        neighbours.states += [x._factors for some in neighbours.terms for x in some]
        directions, bars = (
            ffi.new("double *[]", [doubles(x) for x in some])
            for some in zip(*((cells.directions, cells.bars) for cells in self._cells), strict=True)
        )
        c = struct(
            "imposed_derivatives", parameters=parameters, neighbours=number, here=self._c,
            size=np.array([cells.strains.size for cells in self._cells], dtype=np.int32),
            neighbour=ffi.new("imposed_strains *[]", others), weight=neighbours.weights,
            direction=directions, bar=bars,
        )  # fmt: skip
        return [in_c("imposed", c)]

    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Set the strains before the next step to the strains at the time ``t``."""
        self._set([value_at(f, t, load) for f, load in self._in_time])
        return np.zeros(self._subdomain.size)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the factors of the strains in the accepted state."""
        before = enumerate(self._factors[0])
        self._set([archive.number(f"imposed strains {k}", factor) for k, factor in before])

    def _set(self, factors: Sequence[float]) -> None:
        self._factors[:] = factors
        for cells in self._cells:
            cells.put(factors)
