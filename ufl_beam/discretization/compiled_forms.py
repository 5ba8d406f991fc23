# SPDX-License-Identifier: MIT
"""Compilation to C of functions in UFL, such as statements and laws of materials.

A function is compiled as a form with one quadrature point.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import islice, product
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import basix.ufl
import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.expand_indices import IndexExpander
from ufl.classes import Indexed, MultiIndex, Operator
from ufl.core.expr import Expr
from ufl.corealg.traversal import unique_post_traversal

from ufl_beam.arrays import Array, Index
from ufl_beam.caches import cached_by_structure
from ufl_beam.caches import cached_forms as cached_forms
from ufl_beam.compiled.c_library import doubles, ffi, fill, kernel, lib, struct, view_pointer
from ufl_beam.compiled.csr import Csr
from ufl_beam.compiled.jit import cached_form, compiled_form, has_form, remembered
from ufl_beam.compiled.simd_kernels import BATCH, element_loops, point_loop
from ufl_beam.dolfinx_compat import fem, line_mesh


def tabulators(compiled: Any) -> list[Any]:
    """Return the C functions of the cell integrals of a form of DOLFINx or :class:`CachedForm`."""
    form = compiled.ufcx_form
    integrals = [form.form_integrals[i] for i in range(form.form_integral_offsets[1])]
    return [kernel(x.tabulate_tensor_float64, compiled.module.ffi) for x in integrals]


@cached_by_structure
def _positions(indptr: Index, indices: Index, dofs: Index, batch_size: int) -> tuple[Index, ...]:
    """Find the places of the entries of cells in a matrix.

    Batches of cells with equal positions share a pattern.  With cells of degree 1, patterns come
    first whose entries in a row of the matrix are adjacent: six in the plane, twice six in space.

    Returns:
        ``pattern``, ``has`` and ``in_rows`` of the struct ``cells`` of loops.h; if a row of the
        matrix has too many entries for a pattern, only ``row``.
    """
    places = Csr(np.empty(0), indices, indptr).blocks(dofs, batch_size)
    if places.dtype == np.int32:
        return (places,)
    batches, entries, _ = places.shape
    rows = places.reshape(batches, entries * batch_size).view(f"V{entries * batch_size}")[:, 0]
    _, first, has = np.unique(rows, return_index=True, return_inverse=True)
    distinct = places[first]
    in_rows = np.zeros(len(first), dtype=bool)
    if entries in (36, 144):  # of six unknowns in the plane, of twelve in space
        size = math.isqrt(entries)
        sixes = np.arange(size).reshape(-1, 2).T.reshape(-1, 6)
        by_node = distinct.reshape(len(distinct), size, size, batch_size)[:, :, sixes]
        in_rows = (np.diff(by_node, axis=3) == 1).all(axis=(1, 2, 3, 4))
    order = np.argsort(~in_rows, kind="stable")
    number = np.empty(len(first), dtype=np.int32)
    number[order] = np.arange(len(first))
    return distinct[order], number[has], np.array([in_rows.sum()])


def places_in(A: Csr, dofs: Index, batch_size: int) -> dict[str, Any]:
    """Return fields of ``cells`` of loops.h for tangents of cells that are inserted in a matrix."""
    places, *more = _positions(A.indptr, A.indices, dofs, batch_size)
    if not more:
        return {"row": places}
    has, in_rows = more
    pattern = ffi.from_buffer("uint8_t[]", places)
    return {"begin": A.indptr, "pattern": pattern, "has": has, "in_rows": int(in_rows[0])}


def inserted_cells(function: Any, w: Array, dofs: Index, **places: Any) -> Any:
    """Return ``cells`` of loops.h for a function of cells, whose first inputs are the unknowns.

    ``w`` are the inputs after the unknowns, in batches, see :func:`in_batches`; it may be a part of
    a longer array.  For ``places`` see :func:`places_in`.
    """
    number, unknowns = dofs.shape
    inputs = unknowns + w.shape[1]
    if not function.inserts and function.outputs > lib.MOST_ENTRIES:
        raise ValueError(f"a cell has {function.outputs} values; loops.h allows {lib.MOST_ENTRIES}")
    return fill(
        ffi.new("cells *"), tabulate=function.one, several=function.inserts, batch_size=BATCH,
        number=number, of_cell=unknowns, dofs=np.ascontiguousarray(dofs, dtype=np.int32),
        width=w.strides[0] // (w.itemsize * BATCH), w=view_pointer(w), rows=function.outputs,
        inputs=inputs, all=np.empty(inputs), **places,
    )  # fmt: skip


class InsertedForces:
    """Forces on the nodes of cells, see :class:`~ufl_beam.terms.cell_forces.CellForces`."""

    def __init__(self, cells: Any) -> None:
        self.cells = cells

    def begin(self, q: Array) -> None:
        """Set the configuration before the step, which follows the unknowns."""
        lib.set_cells(self.cells, doubles(q), 0)

    def add(self, q: Array, out: Array) -> None:
        """Add the values at the unknowns ``q`` to a vector, a matrix or an array of values."""
        lib.add_cells(self.cells, doubles(q), doubles(out))

    def keep_entries(self) -> tuple[Any, Array]:
        """Store the values of all cells in each evaluation from now on, see :func:`in_batches`.

        Returns:
            A pointer to the address of the array of values, and a second array, by which C may
            replace the first.
        """
        batches, rows = -(-self.cells.number // BATCH), self.cells.rows
        each, second = np.zeros((2, batches, rows, BATCH))
        fill(self.cells, each=each)
        return ffi.addressof(self.cells, "each"), second


NOTHING: Mapping[Expr, Expr] = MappingProxyType({})


def with_shared_nodes(
    expressions: Sequence[Expr], instead: Mapping[Expr, Expr] = NOTHING
) -> tuple[Expr, ...]:
    """Return expressions in which equal nodes are the same object.

    The time in which UFL compares two equal nodes grows exponentially with their depth.  Nodes that
    are keys of ``instead`` are replaced by its values.
    """
    shared: dict[int, Expr] = {}  # the node to use, by the identity of a node
    known: dict[Any, Expr] = {}
    for expression in expressions:
        waiting = [expression]
        while waiting:
            node = waiting[-1]
            if isinstance(node, Indexed) and node in instead:
                if id(other := instead[node]) not in shared:
                    waiting.append(other)
                else:
                    shared[id(node)] = shared[id(other)]
                    waiting.pop()
                continue
            if missing := [x for x in node.ufl_operands if id(x) not in shared]:
                waiting += missing
                continue
            waiting.pop()
            if id(node) not in shared:
                operands = tuple(shared[id(x)] for x in node.ufl_operands)
                key = (type(node), *map(id, operands)) if operands else node
                if key not in known:
                    same = all(x is y for x, y in zip(operands, node.ufl_operands, strict=True))
                    known[key] = node if same else node._ufl_expr_reconstruct_(*operands)
                shared[id(node)] = known[key]
    return tuple(shared[id(expression)] for expression in expressions)


class _Components(IndexExpander):  # type: ignore[misc]
    """Replacement of tensors by their components, each of which is found once."""

    def __init__(self) -> None:
        super().__init__()
        self._found: dict[Any, Expr] = {}

    def visit(self, o: Expr) -> Expr:
        if isinstance(o, MultiIndex):
            return super().visit(o)
        indices = (self._index2value[ufl.Index(i)] for i in o.ufl_free_indices)
        if (key := (id(o), self.component(), *indices)) not in self._found:
            self._found[key] = super().visit(o)
        return self._found[key]

    def variable(self, o: Expr) -> Expr:
        """Keep the variables of inputs, by which functions may be differentiated."""
        return o if isinstance(o.ufl_operands[0], Indexed) else self.visit(o.ufl_operands[0])

    def of(self, tensor: Expr, at: tuple[int, ...]) -> Expr:
        self._components.push(at)
        component = self.visit(tensor)
        self._components.pop()
        return component


def components(tensor: Expr) -> list[Expr]:
    """Expand the derivatives in a tensor, and return its components without inner tensors.

    FFCx 0.9 to 0.11 searches all nodes of an expression for each inner tensor.
    """
    found, (whole,) = _Components(), with_shared_nodes([expand_derivatives(tensor)])
    for node in unique_post_traversal(whole):  # operands first, which limits the recursion
        if isinstance(node, Operator) and not node.ufl_free_indices:
            for at in product(*map(range, node.ufl_shape)):
                found.of(node, at)
    return [found.of(whole, at) for at in product(*map(range, whole.ufl_shape))]


class Pointwise:
    """Compiler of functions of values at a point; ``inputs`` are the names of these values.

    A function is compiled as a form on a cell of unit length with one quadrature point.

    Attributes:
        at: The values in UFL, by name.
    """

    def __init__(self, inputs: Sequence[str]) -> None:
        self._cell = line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))
        self._alive: list[fem.Form] = []
        x = fem.Function(self.values(len(inputs)))
        self.at: dict[str, Expr] = {name: x[i] for i, name in enumerate(inputs)}

    def compile(self, *outputs: Expr) -> Any:
        """Compile a C function that computes the outputs, valid as long as this object exists."""
        return tabulators(self.form_of(outputs)[0])[0]

    def compile_loop(self, *outputs: Expr) -> Any:
        """Compile a loop over points that computes the outputs, an ``answer_loop`` of loops.h.

        The loop is null if it would not be faster than calls of the function.
        """
        form, source = self.form_of(outputs)
        ((address, sizes),) = _addressed(tabulators(form), [(len(outputs), len(self.at))])
        return ffi.cast("answer_loop *", point_loop(source, address, sizes) or 0)

    def form_of(
        self, *functions: Sequence[Expr], instead: Mapping[Expr, Expr] = NOTHING,
        flags: Sequence[str] = (),
    ) -> tuple[fem.Form, Path]:  # fmt: skip
        """Compile functions as integrals of a form; return it, and the C file that FFCx wrote.

        Nodes that are keys of ``instead`` are replaced.
        """
        every = [x for outputs in functions for x in outputs]
        shared, sizes = iter(with_shared_nodes(every, instead)), [*map(len, functions)]
        z = ufl.TestFunction(self.values(most := max(sizes)))
        dx = ufl.Measure("dx", domain=self._cell, metadata={"quadrature_degree": 1})
        values = ([*islice(shared, n), *[0] * (most - n)] for n in sizes)
        parts = (ufl.dot(ufl.as_vector(x), z) * dx(k) for k, x in enumerate(values))
        form, source = compiled_form(sum(parts), *flags)
        self._alive.append(form)
        return form, source

    def values(self, n: int) -> fem.FunctionSpace:
        """Return a space of n values at the point."""
        element = basix.ufl.quadrature_element("interval", value_shape=(n,), degree=1)
        return fem.functionspace(self._cell, element)


class Stated(NamedTuple):
    """Functions of elements in UFL.

    Attributes:
        compiler: Their compiler.
        functions: Outputs of each function; it may have none.
        facts: What else their owner needs to know, as JSON can store it.
        instead: Nodes that are replaced, and their values.
        inserted: Number of the first functions that add to a vector or a matrix.
        unknowns: Number of the first inputs of these that are unknowns.
        large: True for long functions of few calls, which compilers optimize less.
    """

    compiler: Pointwise
    functions: Sequence[Sequence[Expr]]
    facts: Any = None
    instead: Mapping[Expr, Expr] = NOTHING
    inserted: int = 0
    unknowns: int = 0
    large: bool = False


def compiled_functions(key: str | None, state: Callable[[], Stated]) -> tuple[list[Any], Any]:
    """Compile functions of elements together, each an ``element_function`` of loops.h.

    ``state`` is called if the cache has no functions with this key, or if the key is None.

    Returns:
        The functions, None for one without outputs; and the facts.
    """

    def compile_now() -> str:
        made, name = state(), ""
        if some := [*filter(None, made.functions)]:
            flags = ["-O0"] * made.large
            name = made.compiler.form_of(*some, instead=made.instead, flags=flags)[1].parent.name
        sizes = [(len(outputs), len(made.compiler.at)) for outputs in made.functions]
        return json.dumps([name, sizes, made.facts, made.inserted, made.unknowns, made.large])

    text = remembered(f"functions_{key}", compile_now) if key else compile_now()
    name, sizes, facts, inserted, unknowns, large = json.loads(text)
    if not name:
        return [None] * len(sizes), facts
    if not has_form(name):  # a clean-up has removed it
        compile_now()
    form, source = cached_form(name)
    kernels = _addressed(compiled := tabulators(form), [(m, n) for m, n in sizes if m])
    loops = element_loops(source, kernels, inserted, unknowns, large)
    kinds, made = (("inserts", "tabulate_batch *"), ("several", "batch_function *")), list[Any]()
    for k, (one, loop, (_, (outputs, _))) in enumerate(zip(compiled, loops, kernels, strict=True)):
        made.append(struct("element_function", one=one, outputs=outputs))
        field, kind = kinds[k >= inserted]
        fill(made[-1], **{field: ffi.cast(kind, loop or 0)})
    return [made.pop(0) if outputs else None for outputs, _ in sizes], facts


def _addressed(functions: Sequence[Any], sizes: Sequence[tuple[int, int]]) -> Any:
    addresses = (int(ffi.cast("intptr_t", x)) for x in functions)
    return tuple(zip(addresses, sizes, strict=True))
