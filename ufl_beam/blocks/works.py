# SPDX-License-Identifier: MIT
"""Statements of virtual works and potentials of a user, and checks of the user's functions."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity
from ufl.classes import Zero
from ufl.core.expr import Expr
from ufl.domain import extract_domains

from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime
from ufl_beam.blocks.cells import (
    POINT,
    AxisOfCell,
    Cell,
    StatementOnCell,
    at_points,
    places,
    positions,
)
from ufl_beam.blocks.statement import Equations, Inputs, kernels
from ufl_beam.compiled.c_library import lib
from ufl_beam.errors import ModelError, shorten
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.functions import Constant, steady
from ufl_beam.model.works import Potential, VirtualWork, Work


class _Same:
    """Hashable wrapper of a user's function, compared by identity."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.function is self.function

    def __hash__(self) -> int:
        return id(self.function)


@dataclass(frozen=True)
class _WorkOnCell(StatementOnCell):
    """Effect of a user at a quadrature point of a cell.

    Attributes:
        name: Name of the work.
        density: The user's function.
        names: Names of its numbers.
        scheme: Time scheme.
    """

    name: str
    density: _Same
    names: tuple[str, ...]
    scheme: Scheme

    @property
    def numbers(self) -> tuple[str, ...]:
        """Quadrature point, and positions of the nodes."""
        return *POINT, *places(self.degree)

    @property
    @abstractmethod
    def work(self) -> Work:
        """A work with this function."""

    def point(self, at: Inputs) -> tuple[Cell, AxisOfCell, Expr]:
        """Return the cell, its axis at the quadrature point, and the length for which it stands."""
        axis = AxisOfCell(cell := Cell(self.degree, at), at["s"])
        return cell, axis, at["weight"] * axis.h

    def numbers_at(self, at: Inputs, when: str = "") -> dict[str, Expr]:
        """Return the time and the user's numbers at a time."""
        return {"t": at[f"t{when}"]} | {x: at[f"number {x}{when}"] for x in self.names}

    def returned(self, known: Mapping[str, Any], domain: ufl.Mesh) -> Expr:
        """Return the expression of the user's function, or raise :class:`ModelError`."""
        work = self.work
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
                f"{work}: the function returned {shorten(value)}; it must return an expression of "
                f"UFL, {wanted}"
            )
        if value.ufl_shape or value.ufl_free_indices:
            raise ModelError(
                f"{work}: the function returned a tensor of shape {value.ufl_shape}; it must "
                f"return a scalar, {wanted}"
            )
        if any(one != domain for one in extract_domains(value)):
            raise ModelError(
                f"{work}: the function uses a mesh of its own; use axis.x for the place, and "
                "`numbers` for its parameters"
            )
        return value


@dataclass(frozen=True)
class WorkOnCell(_WorkOnCell):
    """Virtual work of a user on a cell."""

    @property
    def of_step(self) -> tuple[str, ...]:
        """Time of the work, length of the step, load factor, and the user's numbers."""
        return "t", "dt", "growth", *(f"number {name}" for name in self.names)

    @property
    def work(self) -> Work:
        """See the base class."""
        numbers = dict.fromkeys(self.names, 1.0)
        return VirtualWork(self.name, self.density.function, numbers=numbers)

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        (cell, axis, length), weight = self.point(at), self.scheme.load_weight
        w = ufl.TestFunction(at.space(len(self.unknowns)))
        nodes = range(self.nodes)
        virtual = [ufl.as_vector([w[i * self.nodes + k] for i in range(3)]) for k in nodes]
        q0, q1 = axis.field(at.motions("q0")), axis.field(at.motions("q1"))
        known = {
            "q0": q0, "q1": q1, "q": (1.0 - weight) * q0 + weight * q1, "axis": axis,
            "v": (q1 - q0) / at["dt"], "w": axis.field(virtual), "dt": at["dt"],
        }  # fmt: skip
        work = length * self.returned(known | self.numbers_at(at), at.domain)
        try:
            check_form_arity(expand_derivatives(work * ufl.dx(domain=at.domain)), (w,))
        except (ArityMismatch, ValueError):  # ValueError: UFL fails to write its message
            raise ModelError(
                f"{self.work}: the function must return an expression that is linear in w, such "
                "as f * w[1]"
            ) from None
        every = ufl.as_vector([cell.virtual[k][i] for i in range(3) for k in nodes])
        return Equations(cell.forces(-at["growth"] * ufl.replace(work, {w: every})))


@dataclass(frozen=True)
class PotentialOfCell(_WorkOnCell):
    """Potential energy of a user along a cell.

    Attributes:
        varies: Whether the energy may change in time without motion.
    """

    varies: bool

    @property
    def of_step(self) -> tuple[str, ...]:
        """Time and numbers: in the equation, at the end of the step and, if they vary, before."""
        times = " now", " end", *((" before", " between") if self.varies else ())
        names = "t", *(f"number {name}" for name in self.names)
        return tuple(name + when for when in times for name in names)

    @property
    def work(self) -> Work:
        """See the base class."""
        numbers = dict.fromkeys(self.names, 1.0)
        return Potential(self.name, self.density.function, numbers=numbers)

    def equations(self, at: Inputs) -> Equations:
        """See the base class; s is the increment of q along the whole cell."""
        (cell, axis, length), scheme, size = self.point(at), self.scheme, len(self.unknowns)
        pairs = ([x[i] for x in at.motions(name) for i in range(3)] for name in ("q0", "q1"))
        q0, q1 = map(ufl.as_vector, pairs)

        def energy(q: Expr, when: str) -> Expr:
            nodal = [ufl.as_vector([q[3 * k + i] for i in range(3)]) for k in range(self.nodes)]
            known = {"q": axis.field(nodal), "axis": axis, **self.numbers_at(at, f" {when}")}
            return length * self.returned(known, at.domain)

        def along(s: Sequence[Expr], q: Expr) -> Expr:
            variables = [ufl.variable(q[i]) for i in range(size)]
            value = energy(ufl.as_vector(variables), "now")
            return sum((ufl.diff(value, x) * y for x, y in zip(variables, s, strict=True)), 0)

        changes = [q1[i] - q0[i] for i in range(size)]
        s = [
            w[i] if i < 2 else scheme.virtual_rotation(0.0, changes[3 * k + 2], w[2])
            for k, w in enumerate(cell.virtual) for i in range(3)
        ]  # fmt: skip
        if isinstance(expand_derivatives(along(s, q1)), Zero):
            raise ModelError(f"{self.work}: the energy must depend on the configuration q")
        work, lost, supplied = scheme.mean(lambda q: along(s, q), q0, q1), {}, {}
        if α := scheme.alpha:
            work += α * (along(s, q1) - along(s, q0))
            lost = {"numerical": α * (along(changes, q1) - along(changes, q0))}
        stored = energy(q1, "end")
        if self.varies:
            moved = energy(q1, "between") - energy(q0, "between")
            supplied = {self.work.in_time: stored - energy(q0, "before") - moved}
        return Equations(cell.forces(work), {}, {self.name: stored}, lost, supplied)


def work_statement(work: Work, degree: int, scheme: Scheme) -> _WorkOnCell:
    """Return the statement of a work; it serves all beams and values of numbers."""
    fields = (degree, work.name, _Same(work.density), tuple(work.numbers), scheme)
    if isinstance(work, VirtualWork):
        return WorkOnCell(*fields)
    varying = {"t", *(name for name, x in work.numbers.items() if callable(x))}
    return PotentialOfCell(*fields, bool(varying & {*work.used_arguments}))


def require_work(work: Work, degree: int, scheme: Scheme) -> None:
    """Raise :class:`ModelError` if the function of a work fails, or returns no work or energy."""
    try:
        kernels(work_statement(work, degree, scheme))
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{work}: its form cannot be compiled: {shorten(error)}") from error


def work_blocks(setting: BlockSetting) -> list[Block]:
    """Return the blocks of the works of a scene; every process has them.

    The ledger has virtual works in ``supplied``, and energies of potentials in ``state``.  Virtual
    works grow in the substeps of the first step, as loads do; potentials act fully from the start.
    """
    subdomain, blocks = setting.subdomain, list[Block]()
    numbering, scene = subdomain.numbering, subdomain.numbering.scene
    for work in scene.works:
        statement = work_statement(work, numbering.mesh.degree, setting.scheme)
        in_time, of_step = [InTime(steady, work)], {"growth": 0}
        values = {f"number {k}": x if callable(x) else Constant(x) for k, x in work.numbers.items()}
        for name in statement.of_step:
            plain, time = name.rsplit(" ", 1) if isinstance(work, Potential) else (name, "now")
            if plain in ("t", *values):
                of_step[name] = len(in_time)
                in_time.append(InTime(values.get(plain), work, time))
        of_work = np.concatenate([numbering.cells_of(beam) for beam in work.on(scene.beams)])
        points = (work.degree + 2 * (numbering.mesh.degree - 1)) // 2 + 1
        cells, point, at = at_points(np.flatnonzero(np.isin(subdomain.cells, of_work)), points)
        elements = Elements(
            f"work of {work.name}", subdomain.cells[cells] * points + point,
            subdomain.cell_dofs[cells],
            [*at, *positions(subdomain, cells)], in_time, of_step, cells, lib.WORK,
        )  # fmt: skip
        supplies = work.name if isinstance(work, VirtualWork) else None
        blocks.append(
            Block(statement, elements, setting, supplies=supplies, moves=work.takes_rates)
        )
    return blocks
