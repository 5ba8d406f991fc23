# SPDX-License-Identifier: MIT
"""Statements: one effect on an element, in UFL.

A statement has the forces of an element on its nodes, its new state, and its energies, as functions
of the motions of the nodes, the state, numbers of the element, and numbers of the step.  Tangents,
works, section forces and derivatives follow from these functions; see :mod:`ufl_beam.blocks.block`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import ufl
from ufl.algorithms import expand_derivatives
from ufl.classes import ListTensor, Zero
from ufl.core.expr import Expr

from ufl_beam.discretization.compiled_forms import Pointwise

COMPONENTS = "x", "y", "rotation"
"""Components of the motion of a node: displacements (m) and rotation (rad)."""


class Equations(NamedTuple):
    """Functions of the inputs of a statement.

    Attributes:
        forces: Forces of the element in the equilibrium of its nodes, in the order of
            :attr:`Statement.unknowns`; positive if they resist a positive motion.
        state: New state at the end of the step, by name.
        stored: Energies that the element stores at the end of the step, by entry of the ledger; J.
        lost: Energies that it loses in the step, by entry of the ledger; J.
    """

    forces: Sequence[Expr]
    state: Mapping[str, Expr] = {}
    stored: Mapping[str, Expr] = {}
    lost: Mapping[str, Expr] = {}


class Inputs(dict[str, Expr]):
    """Inputs of a statement by name; motions are "q0 x0", "q1 rotation1" and so on."""

    def motions(self, group: str) -> list[Expr]:
        """Return the motion (x, y, rotation) of each node: "q0" before the step, "q1" after it."""
        nodes = sum(name.startswith(f"{group} x") for name in self)
        return [ufl.as_vector([self[f"{group} {c}{k}"] for c in COMPONENTS]) for k in range(nodes)]

    def between(self, fraction: float) -> list[Expr]:
        """Return the motions of the nodes at a fraction of the step."""
        pairs = zip(self.motions("q0"), self.motions("q1"), strict=True)
        return [(1.0 - fraction) * q0 + fraction * q1 for q0, q1 in pairs]


class Statement(ABC):
    """Effect on an element.  Equal statements, such as equal frozen dataclasses, share kernels.

    Attributes:
        of_step: Names of the numbers of a step; "dt" is its length (s), others are values of
            functions of time.
    """

    of_step: Sequence[str] = ()

    @property
    @abstractmethod
    def nodes(self) -> int:
        """Number of nodes of an element."""

    @property
    def state(self) -> Sequence[str]:
        """Names of the numbers that an element remembers."""
        return ()

    @property
    @abstractmethod
    def numbers(self) -> Sequence[str]:
        """Names of the constant numbers of an element."""

    @abstractmethod
    def equations(self, at: Inputs) -> Equations:
        """Return the functions of the inputs ``at``."""

    @property
    def unknowns(self) -> list[str]:
        """Names of the motions of an element: x of all nodes, then y, then rotations."""
        return [f"{c}{k}" for c in COMPONENTS for k in range(self.nodes)]

    @property
    def inputs(self) -> list[str]:
        """Names of all inputs, in the order of the columns of an element."""
        motions = (f"{group} {name}" for group in ("q1", "q0") for name in self.unknowns)
        return [*motions, *self.state, *self.numbers, *self.of_step]


class Kernels:
    """Compiled functions of a statement, each as ``element_function`` of loops.h.

    Attributes:
        force: Forces of an element.
        tangent: Their derivatives by the motions at the end of the step, without zeros.
        entries: Row and column of each entry of ``tangent``.
        end: New state, stored and lost energies; None if there are none.
        stored, lost: Names of the energies in the ledger.
    """

    def __init__(self, statement: Statement) -> None:
        self._statement = statement
        self._compiler = Pointwise(statement.inputs)
        at = Inputs({name: ufl.variable(x) for name, x in self._compiler.at.items()})
        made, self._at = statement.equations(at), at
        self.stored, self.lost = tuple(made.stored), tuple(made.lost)
        self._forces, self._state = list(made.forces), [made.state[z] for z in statement.state]
        self.force = self._compiled(_expanded(self._forces))
        names = [f"q1 {name}" for name in statement.unknowns]
        slopes = _expanded([ufl.diff(ufl.as_ufl(f), at[q]) for f in self._forces for q in names])
        nonzero = [i for i, slope in enumerate(slopes) if not isinstance(slope, Zero)]
        self.entries = [divmod(i, len(names)) for i in nonzero]
        self.tangent = self._compiled([slopes[i] for i in nonzero])
        self.end = self._compiled(
            _expanded([*self._state, *made.stored.values(), *made.lost.values()])
        )

    def _compiled(self, outputs: Sequence[Expr]) -> Any:
        return self._compiler.compile_elements(*outputs) if outputs else None

    @cached_property
    def derivative(self) -> Any:
        """Derivatives of forces and new state, row after row, by all inputs."""
        rows, columns = [*self._forces, *self._state], self._statement.inputs
        slopes = [ufl.diff(ufl.as_ufl(f), self._at[name]) for f in rows for name in columns]
        return self._compiled(_expanded(slopes))


@lru_cache(maxsize=128)
def kernels(statement: Statement) -> Kernels:
    """Compile the functions of a statement; equal statements have the same."""
    return Kernels(statement)


def _expanded(outputs: Sequence[Expr]) -> list[Expr]:
    """Return expressions with all derivatives expanded together."""
    if not outputs:
        return []
    whole = expand_derivatives(ufl.as_vector([ufl.as_ufl(x) for x in outputs]))
    if isinstance(whole, ListTensor):
        return list(whole.ufl_operands)
    return (
        [Zero()] * len(outputs)
        if isinstance(whole, Zero)
        else [whole[i] for i in range(len(outputs))]
    )
