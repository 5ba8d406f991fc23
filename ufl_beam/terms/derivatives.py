# SPDX-License-Identifier: MIT
"""Derivatives of terms by parameters of the scene, for the derivatives of runs.

UFL differentiates the forms by their coefficients and the laws by their inputs.  The derivatives of
the numbers in a term are differences between scenes with neighbouring values of a parameter; see
derivatives.c for the derivatives of a step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import ufl
from ufl.classes import EQ, GE, GT, LE, LT, NE, Conditional, Division, Product, Zero
from ufl.core.expr import Expr
from ufl.corealg.traversal import unique_post_traversal

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, ffi, lib, struct
from ufl_beam.mechanics.kinematics import SERIES

FAR = 1e300
"""Margin of a comparison that does not matter."""

MOST_MARGINS = 24
"""Largest number of comparisons in a law that the ranges of derivatives take into account."""

Each = tuple[str, Any]
"""Kind of a derivative, whose functions are in C, and their data."""


class Neighbours:
    """A term in scenes with neighbouring values of each parameter.

    Attributes:
        term: The term in the scene itself.
        terms: The same term in the neighbouring scenes; for each parameter a list, which is empty
            if the derivatives are known already.
        number: Number of these scenes; 0 if the derivatives are known.
        weights: Weights of the neighbours in the derivative by a parameter, (parameters, n).  The
            weight of the scene itself makes their sum zero.
        size: Number of degrees of freedom.
        alive: Data that C refers to.
        enters: True for a parameter on which some number of the term depends; (parameters,).
        states: Derivatives of the state of the term, see :meth:`state`.
        places: Functions that return the arrays that :attr:`states` are derivatives of, by their
            indices.
    """

    def __init__(
        self, term: Any, terms: Sequence[Sequence[Any]], weights: Array, size: int,
        rows: Iterator[dict[int, Array]] | None = None,
    ) -> None:  # fmt: skip
        self._rows, self.number = rows, 0 if rows is not None else weights.shape[1]
        self.term, self.terms, self.weights, self.size = term, terms, weights, size
        self.alive, self.states = list[Any](), list[Array]()
        self.places: dict[int, Callable[[Any], Array]] = {}
        self.enters = np.zeros(len(terms), dtype=bool)

    def __len__(self) -> int:
        """Number of parameters."""
        return len(self.terms)

    def state(self, values: Callable[[Any], Array]) -> Array:
        """Return the derivatives of an array of the state of the term, and store them."""
        self.places[len(self.states)] = values
        self.states.append(self.differences(values))
        return self.states[-1]

    def change(self, values: Callable[[Any], Array]) -> bool:
        """Return whether parameters change an array on which the form of derivatives depends."""
        return self._rows is None and bool(self.differences(values).any())

    def differences(self, values: Callable[[Any], Array]) -> Array:
        """Return the derivatives of an array of the term; (parameters, *shape of the array)."""
        reference = values(self.term)
        derivatives = np.zeros((len(self), *np.shape(reference)))
        if self._rows is not None:
            for p, row in next(self._rows).items():
                derivatives[p], self.enters[p] = row, True
            return derivatives
        for p, some in enumerate(self.terms):
            for k, term in enumerate(some):
                with np.errstate(invalid="ignore"):  # infinite numbers do not change
                    change = values(term) - reference
                derivatives[p] += self.weights[p, k] * np.where(np.isfinite(change), change, 0.0)
        self.enters |= derivatives.reshape(len(self), -1).any(axis=1)
        return derivatives


class Registered(Neighbours):
    """List of the functions that return the numbers of a term; it replaces :class:`Neighbours`.

    Attributes:
        values: The functions.
        fixed: Functions that return numbers on which the form of derivatives depends.
    """

    def __init__(self, term: Any, size: int) -> None:
        super().__init__(term, [], np.zeros((0, 4)), size)
        self.values, self.fixed = list[Callable[[Any], Array]](), list[Callable[[Any], Array]]()

    def change(self, values: Callable[[Any], Array]) -> bool:
        """Keep the function; nothing changes."""
        self.fixed.append(values)
        return False

    def differences(self, values: Callable[[Any], Array]) -> Array:
        """Keep the function; there are no differences."""
        self.values.append(values)
        return np.zeros((0, *np.shape(values(self.term))))


Branches = dict[int, tuple[Expr, bool]]
"""Conditions, by their identity, and whether they hold, in all branches that contain a node."""


def _needed(factor: Expr) -> tuple[Expr, bool] | None:
    """Return a condition, and whether it must hold, without which a factor is zero."""
    if isinstance(factor, Conditional):
        condition, yes, no = factor.ufl_operands
        return (condition, isinstance(no, Zero)) if Zero in (type(yes), type(no)) else None
    if isinstance(factor, Division):
        return _needed(factor.ufl_operands[0])
    if isinstance(factor, Product):
        first, second = factor.ufl_operands
        return _needed(first) or _needed(second)
    return None


def _common(branches: list[Branches]) -> Branches:
    """Return the conditions that all branches have."""
    first, *others = branches
    return {k: x for k, x in first.items() if all(other.get(k) == x for other in others)}


def _operands(node: Expr, branches: Branches, compared: bool) -> list[Branches | None]:
    """Return the branches with each operand of a node; None if the operand does not matter."""
    inside: list[Branches | None] = [branches] * len(node.ufl_operands)
    if isinstance(node, Conditional):
        condition, yes, no = node.ufl_operands
        inside[1:] = [branches | {id(condition): (condition, holds)} for holds in (True, False)]
        if compared and yes == -no and condition.ufl_operands[0] in (yes, no):
            inside = [None, branches, branches]  # the absolute value of a number
    elif isinstance(node, Product):
        for k, (factor, other) in enumerate([node.ufl_operands, node.ufl_operands[::-1]]):
            if (needed := _needed(other)) is not None:
                inside[k] = branches | {id(needed[0]): needed}
            elif compared and isinstance(factor, Conditional):
                sides = factor.ufl_operands[0].ufl_operands
                inside[k] = None if sides == (other, Zero()) else branches
    return inside


def margins(outputs: Sequence[Expr]) -> list[Expr]:
    """Return the differences of both sides of the comparisons on which expressions depend.

    A comparison in a branch that is not taken, or in a factor of zero, has the margin :data:`FAR`.
    The sign of x in x sign(x) does not matter to comparisons of this product, which is continuous.
    The result is empty for more than :data:`MOST_MARGINS` comparisons, whose derivatives would take
    minutes to compile.
    """
    order: dict[int, Expr] = {}
    for output in outputs:
        order |= {id(node): node for node in unique_post_traversal(output) if id(node) not in order}
    # Branches with a node, as a value of the outputs and, apart from it, as a side of comparisons
    reached: dict[tuple[int, bool], Branches] = {(id(output), False): {} for output in outputs}
    found = dict[str, Expr]()
    for node in reversed(order.values()):  # parents come before their operands
        uses = [(c, reached[id(node), c]) for c in (False, True) if (id(node), c) in reached]
        compares = isinstance(node, EQ | NE | LE | LT | GE | GT)
        if uses and compares and node.ufl_operands[1] != SERIES:
            branches = _common([conditions for _, conditions in uses])
            left, right = node.ufl_operands
            margin = left - right
            for k, (condition, holds) in branches.items():
                if k != id(node):
                    pair = (margin, FAR) if holds else (FAR, margin)
                    margin = ufl.conditional(condition, *pair)
            found.setdefault(repr(id(left)) + repr(id(right)), margin)
            uses = [(True, branches)]
        for compared, branches in uses:
            inside = _operands(node, branches, compared)
            for operand, conditions in zip(node.ufl_operands, inside, strict=True):
                if conditions is not None:
                    key = id(operand), compared
                    reached[key] = _common([reached.get(key, conditions), conditions])
    return [*found.values()] if len(found) <= MOST_MARGINS else []


def differences(
    neighbours: Neighbours, state_of: Callable[[Any], Sequence[Array]] = lambda term: (),
    begins: Callable[[Any], Sequence[Loop]] = lambda term: (),
) -> Each:  # fmt: skip
    """Return the derivative of a term by numbers of the scene, as differences of its forces.

    The term in the neighbouring scenes takes the steps of the run, so that functions of time of a
    user and states that do not depend on the motion need no derivatives of their own.  Other
    derivatives of the term are those by the configuration before the step and by rates.

    Args:
        neighbours: The term.
        state_of: Arrays of the state of a term that its next step needs.
        begins: Further phases that begin a step in a neighbouring scene.
    """
    made = list[Any]()
    for some in neighbours.terms:
        neighbours.states += [array for term in some for array in state_of(term)]
    for term in (neighbours.term, *(x for some in neighbours.terms for x in some)):
        first = () if term is neighbours.term else begins(term)
        phases = [*first, *term.made_phases.begin], term.made_phases.accept
        calls = [ffi.new("phase_call[]", list(some)) for some in phases]
        neighbours.alive += [calls, first]
        both = [(len(some), call) for some, call in zip(phases, calls, strict=True)]
        made.append((*both, term.loops[0]))
    parameters, number = len(neighbours), neighbours.number
    size = neighbours.size
    c = struct(
        "term_differences", parameters=parameters, neighbours=number, size=size,
        term=ffi.new("term_in_steps[]", made), weight=neighbours.weights, here=np.zeros(size),
    )  # fmt: skip
    return "differences", c


FUNCTIONS = {
    "block": (
        "tabulate_block", "add_block_derivative", "accept_block_derivative",
        "accept_block_derivative", "transpose_block_state", "transpose_block", "finish_block",
    ),
    "product": ("", "add_product_derivative", "", "", "", "transpose_product", ""),
    "load": (
        "differentiate_loads", "add_load_derivative", "accept_load_derivative", "", "",
        "transpose_loads", "finish_loads",
    ),
    "differences": (
        "begin_neighbours", "add_differences_derivative", "accept_differences_derivative", "", "",
        "transpose_differences", "",
    ),
}  # fmt: skip
"""Functions of ``term_derivative``, then of ``term_transposes`` of loops.h, by the kind of a
derivative; empty if there is none."""


def functions(kind: str) -> list[Any]:
    """Return the functions of :data:`FUNCTIONS` for a kind; null if there is none."""
    return [ffi.addressof(lib, name) if name else ffi.NULL for name in FUNCTIONS[kind]]


def recorded(kind: str, data: Any) -> list[tuple[Any, int]]:
    """Return the memory that the adjoint of a step needs: addresses, and lengths in bytes.

    Instead of an address, the first item may be a pointer to it.
    """

    def rates(c: Any) -> list[tuple[Any, int]]:
        return [(ffi.addressof(c, "rate", j), 8 * c.size) for j in range(1, c.number)]

    if kind == "block":
        b = data.block
        states = [
            (b.state, 8 * b.batches * b.states * b.lanes),
            (b.shared, 8 * b.groups * b.shares),
        ]
        alike = [b, *(data.neighbour[i] for i in range(data.parameters * data.neighbours))]
        times = [pair for x in alike for pair in ((x.t, 16), (x.before, 8 * b.functions))]
        at = b.width - b.modes
        modes = [
            (b.w + (c * b.width + at) * b.lanes, 8 * b.modes * b.lanes)
            for c in range(b.batches if b.modes else 0)
        ]
        inner = list[tuple[Any, int]]()
        if data.inner:
            p = data.inner.points
            strains = 8 * p.strains * p.cells
            inner = [(p.w, 8 * p.cells * p.of_cell * p.width), (p.e0, strains), (p.e1, strains)]
            if p.damped:
                c, first = p.damped, (2 + p.damped.rates) * p.damped.unknowns
                tangents = (c.w + (k * c.width + first) * c.lanes for k in range(c.batches))
                inner += [(at, 72 * p.in_damped * c.lanes) for at in tangents]
        return [*states, *times, *modes, *inner, *(rates(b.nodal) if b.rates else ())]
    if kind == "product":
        product = data.matrix.product
        rate = ffi.addressof(product, "rate")  # C exchanges the vectors at this address
        return [(rate, 8 * product.size), (product.half, 8 * product.rotations)]
    return []
