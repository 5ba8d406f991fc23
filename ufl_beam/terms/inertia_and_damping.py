# SPDX-License-Identifier: MIT
"""Inertia, damping, and the rates of a time scheme in C.

Coefficients of a scheme are cached, because steps have only a few different lengths.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, lib, loop, struct
from ufl_beam.compiled.csr import Csr, Product
from ufl_beam.discretization.cell_functions import (
    mass_forces,
    mass_matrix,
    stiffness_forces,
    stiffness_matrix,
)
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import ModelError
from ufl_beam.mechanics.time_scheme import (
    FURTHER,
    V_BEFORE,
    Coefficients,
    DynamicScheme,
    Scheme,
    V,
    combined,
    with_half_tangents,
)
from ufl_beam.model.loads import Rayleigh
from ufl_beam.terms.derivatives import (
    Each,
    Neighbours,
)
from ufl_beam.terms.energy_ledger import Ledger
from ufl_beam.terms.term import Callbacks, InCells, Phases, Term

BEFORE = "velocity before"
"""Name of the velocities at the beginning of the last step in saved data."""


@lru_cache(maxsize=1024)  # differences of rounded times have about ten values
def _coefficients(scheme: Any, dt: float, last_dt: float, known: int) -> Coefficients:
    """Return the coefficients of a scheme for a step as lists of numbers."""
    c = scheme.coefficients(dt, last_dt, known)
    inertia, velocity, *rates = (list(map(float, row)) for row in (*c[:2], *c.rates))
    defect = None if c.velocity_defect is None else list(map(float, c.velocity_defect))
    return Coefficients(inertia, velocity, rates, defect)


def checked_coefficients(scheme: DynamicScheme) -> Coefficients:
    """Return the coefficients of a step of 1 s, after a check of their rows.

    Raises:
        ModelError: The rows do not match :class:`Coefficients`.
    """
    known: Any = scheme
    number = len(scheme.further_rates)
    try:
        c = _coefficients(known, 1.0, 1.0, number)
        rows = c.inertia, c.velocity, *c.rates, *([c.velocity_defect] if c.velocity_defect else [])
        right = len(c.rates) == 1 + number and {len(row) for row in rows} == {FURTHER + number}
        right = right and bool(np.isfinite(rows).all()) and c.rates[0][0] != 0.0
    except (TypeError, ValueError, AttributeError):
        right = False
    if not right or FURTHER + number > lib.MOST_RATES:
        raise ModelError(
            f"{scheme!r}: coefficients(dt, last_dt, known) must return Coefficients, whose rows "
            f"have 3 + known finite numbers, with {1 + number} rows in rates, see docs/extending.md"
        )
    return c


@ffi.def_extern(error=0)  # type: ignore[misc, untyped-decorator, unused-ignore]
def coefficients_in_python(handle: Any, c: Any) -> int:
    """Write ``scheme_numbers`` of loops.h for a step; C calls this function."""
    scheme, number = ffi.from_handle(handle)
    inertia, velocity, rates, defect = _coefficients(scheme, c.dt, c.last_dt, c.more)
    rows = inertia, velocity, defect or [0.0] * FURTHER, *rates
    places = c.inertia, c.velocity, c.slip, *c.rates
    for place, row in zip(places, rows, strict=False):
        place[0:number] = [*row, *[0.0] * (number - len(row))]
    c.gives = len(rates) - 1
    return 1


class StepProduct:
    """Forces ``A (factor s - back v)`` with s = (Δu, 2 tan(Δψ/2)), and their derivative.

    ``A`` is constant and has the sparsity pattern of ``tangent``, to which the derivative is added.
    ``scratch`` is space for one number per row; other code may use it between evaluations.

    Attributes:
        A: The matrix as :class:`Product`.
        c: ``step_product`` of loops.h; phases of a step set ``factor``, ``back``, ``v`` and ``q0``.
        loops: C functions that add the forces and their derivative.
        rate: Address of the pointer to ``factor s - back v`` of the latest forces.
    """

    def __init__(self, A: Csr, rotations: Index, tangent: Csr, scratch: Array) -> None:
        self.A, self._tangent = Product(A), tangent
        in_row = self.A.places(A)[1]
        place = {"far": in_row}
        if A.narrow():
            place = {"place": ffi.from_buffer("uint8_t[]", in_row.astype(np.uint8))}
        self.c = struct(
            "step_product", size=A.size, A=self.A.c, begin=tangent.indptr, **place,
            rotations=len(rotations), rotation=rotations, space=scratch, rate=np.zeros(A.size),
            turn=np.full(len(rotations), np.nan), half=np.empty(len(rotations)),
        )  # fmt: skip
        self.loops = loop("add_step_force", self.c), loop("add_step_tangent", self.c)
        self.rate = ffi.addressof(self.c, "rate")

    def matrix(self) -> Csr:
        """Return the matrix ``A`` in the pattern of the tangent."""
        A = self._tangent.zeros_like()
        A.data[self.A.places(A)[0]] = self.A.data
        return A


class Inertia(Term):
    """Inertia of beams, point masses and bodies: constant mass matrix, P(18), and rates in C.

    Rates are velocities, velocities before the last step, and further rates of the scheme, such as
    accelerations.  Properties return copies.

    Attributes:
        scheme: The time scheme.
        c: ``rates`` of loops.h; its ``last_dt`` is infinite before the first step.
        loses_energy: True if the scheme has a ``velocity_defect``, whose work is lost.

    Raises:
        ModelError: The scheme has coefficients that do not match :class:`Coefficients`.
    """

    kind = "inertia"

    def __init__(
        self, fields: Fields, scheme: DynamicScheme, A: Csr, ledger: Ledger, v: Array
    ) -> None:
        rotations = with_half_tangents(scheme, fields.subdomain.plane_rotations)
        self._times = StepProduct(mass_matrix(fields), rotations, A, fields.subdomain.scratch)
        self.loops, at = self._times.loops, (fields.order, self._times.rate)
        self.in_cells = [InCells(partial(mass_forces, fields), lib.DENSITY, *at)]
        if fields.subdomain.numbering.scene.in_space:
            self.in_cells = []
        self._ledger, self._A, self.scheme = ledger, A, scheme
        size, number = len(v), FURTHER + len(scheme.further_rates)
        self.loses_energy = checked_coefficients(scheme).velocity_defect is not None
        # Rate 0, the nodal step, is stored elsewhere.  Velocities before the last step are not
        # computed: they are the old velocities.  Without a use, new velocities overwrite them.
        asks = self.loses_energy or scheme.uses_last_step
        self._now = np.zeros((number - V, size))
        self._next = np.zeros((number - V_BEFORE - (not asks), size))
        self._defect = np.zeros(size if self.loses_energy else 0)
        handle = ffi.new_handle((scheme, number))
        find = lib.coefficients_in_python
        self.c = struct("rates", size=size, number=number, find=find, handle=handle)
        self.c.after_any = not scheme.uses_last_step
        first, *more = self._next if asks else (self._now[1], *self._next)
        for k, (rate, new) in enumerate(
            zip(self._now, (first, self._defect, *more), strict=True), start=V
        ):
            self.c.rate[k], self.c.new_rate[k] = doubles(rate), doubles(new)
        self.commit(v, v, math.inf)
        self.keep()

    @property
    def M(self) -> Csr:
        """Mass matrix; a new object."""
        return self._times.matrix()

    @property
    def step_product(self) -> Any:
        """``step_product`` of loops.h of the mass matrix."""
        return self._times.c

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops over the matrix and the velocities."""
        lost = self._ledger.lost.pointer("numerical") if self.loses_energy else ffi.NULL
        kinetic = self._ledger.state.pointer("kinetic")
        c = self._in_steps = self.times(self._times, kept=kinetic, lost=lost)
        begin, accept = loop("begin_product", c), loop("accept_inertia", c)
        return Phases([begin], [accept], [loop("add_kinetic_energy", c)])

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        return product_derivative(neighbours, self._in_steps, lambda term: term.M)

    # -- the rates -----------------------------------------------------------------------------

    def _rate(self, k: int) -> Array:
        """Return a view of the rate ``k``; C exchanges the arrays in each step."""
        return np.frombuffer(ffi.buffer(self.c.rate[k], 8 * self.c.size))

    @property
    def v(self) -> Array:
        """Velocities of the accepted state."""
        return self._rate(V).copy()

    @property
    def v_before(self) -> Array:
        """Velocities before the last step."""
        return self._rate(V_BEFORE).copy()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of :attr:`rates` in saved data."""
        return "velocity", BEFORE, *self.scheme.further_rates

    @property
    def rates(self) -> Array:
        """Velocities, velocities before the last step, and further rates; (number, size)."""
        return np.array([self._rate(k) for k in range(V, self.c.number)])

    @property
    def more(self) -> tuple[Array, ...]:
        """Known further rates of the scheme."""
        return tuple(self._rate(FURTHER + k).copy() for k in range(self.c.more))

    def keep(self, *more: Array) -> None:
        """Set the further rates; a step can begin if some are set or the scheme has none."""
        for k, rate in enumerate(more):
            self._rate(FURTHER + k)[:] = rate
        self.c.more, self.c.ready = len(more), bool(more) or not self.scheme.further_rates

    def commit(self, v: Array, v_before: Array, last_dt: float) -> None:
        """Set velocities, and velocities before the last step and the length of that step."""
        self._rate(V)[:], self._rate(V_BEFORE)[:], self.c.last_dt = v, v_before, last_dt

    def after(self, s: Array, dt: float) -> list[Array]:
        """Return velocities and further rates after a nodal step ``s``."""
        known: Any = self.scheme
        rows = _coefficients(known, dt, self.c.last_dt, self.c.more).rates
        return [combined(row, s, self) for row in rows]

    def times(self, product: StepProduct, **fields: Any) -> Any:
        """Return ``matrix_of_rates`` of loops.h for a matrix, with further ``fields``."""
        v = np.zeros(self.c.size)
        return struct("matrix_of_rates", product=product.c, rates=self.c, v=v, **fields)

    # -- in files ------------------------------------------------------------------------------

    def carry_on(self, archive: Archive, known: int) -> None:
        """Save or restore the first ``known`` further rates of the scheme."""
        more = self.more or (self.v,) * known
        self.keep(*map(archive.at_dofs, self.scheme.further_rates[:known], more))

    def pass_on_step(self, archive: Archive) -> None:
        """Save or restore velocities before the last step, and its length as a vector."""
        v_before = archive.at_dofs(BEFORE, self.v_before)
        lengths = archive.at_dofs("last step", np.full(self.c.size, self.c.last_dt))
        self.commit(self.v, v_before, float(lengths[0]) if len(lengths) else self.c.last_dt)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore all rates and the length of the last step."""
        v = archive.at_dofs("velocity", self.v)
        v_before = archive.at_dofs(BEFORE, self.v_before)
        self.commit(v, v_before, archive.number("step of velocity", self.c.last_dt))
        self.carry_on(archive, int(archive.number("further rates", len(self.more))))


def product_derivative(
    neighbours: Neighbours, matrix: Any, matrix_of: Callable[[Any], Csr]
) -> list[Each]:
    """Return the derivative of a constant matrix times rates, for :meth:`Term.derivatives`."""
    A = matrix_of(neighbours.term)
    changes = neighbours.differences(lambda term: matrix_of(term).data)
    products = [Product(Csr(x, A.indices, A.indptr)).c if x.any() else ffi.NULL for x in changes]
    neighbours.alive.append(products)
    change = ffi.new("constant_matrix *[]", products)
    return [("product", struct("product_derivative", matrix=matrix, change=change))]


# -- damping ---------------------------------------------------------------------------------------


class RayleighForces(Term):
    """Constant matrix of mass and stiffness times the velocity of the step, P(92)."""

    kind = "damping"

    def __init__(
        self, damping: Rayleigh, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger,
        rates: Inertia,
    ) -> None:  # fmt: skip
        C, at = rates.M, fields.order
        C.data *= damping.mass
        if damping.stiffness:
            C.data += damping.stiffness * stiffness_matrix(fields).data  # P(92)
        rotations = with_half_tangents(scheme, fields.subdomain.rotations)
        self._times = StepProduct(C, rotations, A, fields.subdomain.scratch)
        self.loops = self._times.loops
        self._ledger, self._rates, self._A = ledger, rates, A
        stress, density, rate = lib.STRESS, lib.DENSITY, self._times.rate
        self.in_cells = [
            InCells(partial(stiffness_forces, fields), stress, at, rate, damping.stiffness),
            InCells(partial(mass_forces, fields), density, at, rate, damping.mass),
        ]

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops over the matrix and the velocities."""
        lost = self._ledger.lost.pointer("damping")
        c = self._in_steps = self._rates.times(self._times, damps=1, lost=lost)
        return Phases([loop("begin_product", c)], [loop("accept_rayleigh", c)])

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        return product_derivative(neighbours, self._in_steps, lambda term: term._times.matrix())


def rayleigh_forces(
    damping: Rayleigh, fields: Fields, scheme: Scheme, A: Csr, ledger: Ledger,
    rates: Inertia | None,
) -> Iterator[Term]:  # fmt: skip
    """Yield the term of Rayleigh damping with constant matrices, if there is one."""
    ledger.lost["damping"] += 0.0
    if rates is None:
        raise ModelError(
            "Rayleigh: it damps vibrations, and statics has no inertia. Leave it out, by "
            "dataclasses.replace(scene, damping=())"
        )
    if not damping.tangent:
        yield RayleighForces(damping, fields, scheme, A, ledger, rates)
    elif damping.mass:
        yield RayleighForces(Rayleigh(mass=damping.mass), fields, scheme, A, ledger, rates)
