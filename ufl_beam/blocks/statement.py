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

import numpy as np
import ufl
from ufl.classes import Zero
from ufl.core.expr import Expr

from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.compiled_forms import Pointwise, components

COMPONENTS = "x", "y", "rotation"
"""Components of the motion of a node: displacements (m) and rotation (rad)."""

COEFFICIENTS = [
    *(f"{row} {j}" for row in ("inertia", "velocity") for j in range(lib.MOST_RATES)),
    *(f"rates {i} {j}" for i in range(lib.MOST_RATES) for j in range(lib.MOST_RATES)),
]
"""Names of the coefficients of a scheme in a step, see :class:`~ufl_beam.Coefficients`."""

OF_STEP = ["dt", "fraction", "reached", *COEFFICIENTS]
"""Numbers of all steps: length (s); part of the changes of loads that is applied at the end of the
step, and in its equation; and, for statements with rates, coefficients of the scheme."""


class Equations(NamedTuple):
    """Functions of the inputs of a statement.

    Attributes:
        forces: Forces of the element in the equilibrium of its nodes, in the order of
            :attr:`Statement.unknowns`; positive if they resist a positive motion.
        state: New state and shared numbers at the end of the step, by name.
        stored: Energies that the element stores at the end of the step, by entry of the ledger; J.
        lost: Energies that it loses in the step, by entry of the ledger; J.
        supplied: Energies that it supplies in the step besides the work of loads; J.
    """

    forces: Sequence[Expr]
    state: Mapping[str, Expr] = {}
    stored: Mapping[str, Expr] = {}
    lost: Mapping[str, Expr] = {}
    supplied: Mapping[str, Expr] = {}


class Inputs(dict[str, Expr]):
    """Inputs of a statement by name; motions are "q0 x0", "q1 rotation1", rates "rate1 x0".

    Attributes:
        domain: Mesh of the inputs in UFL.
        space: Function that returns a space of n values on it.
    """

    def __init__(self, compiler: Pointwise, at: Mapping[str, Expr]) -> None:
        super().__init__(at)
        self.space = compiler.values
        self.domain = compiler.values(1).mesh.ufl_domain()

    def motions(self, group: str) -> list[Expr]:
        """Return the motion (x, y, rotation) of each node: "q0" before the step, "q1" after it.

        "rate1" are the velocities before the step, "rate2" and so on further rates of the scheme.
        """
        nodes = sum(name.startswith(f"{group} x") for name in self)
        return [ufl.as_vector([self[f"{group} {c}{k}"] for c in COMPONENTS]) for k in range(nodes)]

    def between(self, fraction: float) -> list[Expr]:
        """Return the motions of the nodes at a fraction of the step."""
        pairs = zip(self.motions("q0"), self.motions("q1"), strict=True)
        return [(1.0 - fraction) * q0 + fraction * q1 for q0, q1 in pairs]


class Statement(ABC):
    """Effect on an element.  Equal statements, such as equal frozen dataclasses, share kernels."""

    @property
    @abstractmethod
    def nodes(self) -> int:
        """Number of nodes of an element."""

    @property
    def rates(self) -> int:
        """Number of rates of each motion among the inputs, in dynamics."""
        return 0

    @property
    def state(self) -> Sequence[str]:
        """Names of the numbers that an element remembers."""
        return ()

    @property
    def of_step(self) -> Sequence[str]:
        """Names of the numbers of a step: values of functions of time, or :data:`OF_STEP`."""
        return ()

    @property
    def acts_at(self) -> Sequence[str]:
        """Names of the first numbers of the step, if elements act in some steps only.

        An element acts while one of these numbers is above its number "low" and not above its
        number "high", or its state is not zero.
        """
        return ()

    @property
    def shared(self) -> Sequence[str]:
        """Names of numbers that a group of elements remembers, which are inputs.

        The new numbers are the sums of the outputs of the elements that act.
        """
        return ()

    @property
    def trial(self) -> Sequence[str]:
        """Last names of ``shared``: numbers that a trial step for initial rates changes."""
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
        groups = "q1", "q0", *(f"rate{j + 1}" for j in range(self.rates))
        motions = (f"{group} {name}" for group in groups for name in self.unknowns)
        return [*motions, *self.state, *self.numbers, *self.of_step, *self.shared]


class Kernels:
    """Compiled functions of a statement, each as ``element_function`` of loops.h.

    Attributes:
        force: Forces of an element.
        tangent: Their derivatives by the motions at the end of the step, without zeros.
        entries: Row and column of each entry of ``tangent``.
        end: New state, stored, lost and supplied energies; None if there are none.
        energies: Names of these energies in the ledger, by account.
    """

    def __init__(self, statement: Statement) -> None:
        self._statement, self._compilers = statement, list[Pointwise]()
        made, at = self._stated(statement.inputs)
        names = [f"q1 {name}" for name in statement.unknowns]
        forces = _expanded(made.forces)
        slopes = _slopes(forces, [at[q] for q in names])
        nonzero = [i for i, slope in enumerate(slopes) if not isinstance(slope, Zero)]
        self.entries = [divmod(i, len(names)) for i in nonzero]
        self.energies = {"state": made.stored, "lost": made.lost, "supplied": made.supplied}
        energies = [value for account in self.energies.values() for value in account.values()]
        tangent, end = [slopes[i] for i in nonzero], _expanded([*self._states(made), *energies])
        self.force, self.tangent, self.end = self._compiled(forces, tangent, end)

    def _stated(self, names: Sequence[str]) -> tuple[Equations, Inputs]:
        self._compilers.append(compiler := Pointwise(names))
        at = Inputs(compiler, {name: ufl.variable(x) for name, x in compiler.at.items()})
        return self._statement.equations(at), at

    def _states(self, made: Equations) -> list[Expr]:
        return [made.state[name] for name in (*self._statement.state, *self._statement.shared)]

    def _compiled(self, *functions: Sequence[Expr]) -> list[Any]:
        return self._compilers[-1].compile_elements(*functions)

    @cached_property
    def derivative(self) -> Any:
        """Derivatives of forces, new state and shared numbers, row after row, by all inputs."""
        names = self._statement.inputs
        made, at = self._stated(names)
        rows = [*made.forces, *self._states(made)]
        return self._compiled(_slopes(_expanded(rows), [at[name] for name in names]))[0]

    @cached_property
    def change(self) -> Any:
        """Derivatives of ``tangent`` along motions, which are further inputs; None if zero."""
        names = [f"q1 {name}" for name in self._statement.unknowns]
        made, at = self._stated([*self._statement.inputs, *(f"along {x}" for x in names)])
        motions = [at[name] for name in names]
        slopes = _slopes(_expanded(made.forces), motions)
        slopes = [slopes[i * len(names) + j] for i, j in self.entries]
        rows = np.reshape(np.array(_slopes(slopes, motions), dtype=object), (-1, len(names)))
        changes = _expanded([
            sum((x * at[f"along {name}"] for x, name in zip(row, names, strict=True)), 0)
            for row in rows
        ])  # fmt: skip
        return None if all(isinstance(x, Zero) for x in changes) else self._compiled(changes)[0]


@lru_cache(maxsize=128)
def kernels(statement: Statement) -> Kernels:
    """Compile the functions of a statement; equal statements have the same."""
    return Kernels(statement)


def _expanded(outputs: Sequence[Expr]) -> list[Expr]:
    """Return expressions with all derivatives expanded together."""
    return components(ufl.as_vector([*map(ufl.as_ufl, outputs)])) if outputs else []


def _slopes(outputs: Sequence[Expr], by: Sequence[Expr]) -> list[Expr]:
    """Return the derivatives of expanded expressions: of the first one by all variables, ..."""
    if not outputs:
        return []
    every = ufl.as_vector(outputs)  # UFL differentiates a vector at once
    whole = components(ufl.as_tensor([ufl.diff(every, x) for x in by]))
    return [x for i in range(len(outputs)) for x in whole[i :: len(outputs)]]
