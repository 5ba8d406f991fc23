# SPDX-License-Identifier: MIT
"""Compilation to C of UFL forms, and of functions at a point such as the laws of materials.

Coefficients of forms are packed once; later only changed values are packed.

A form is compiled with one quadrature rule only, because FFCx 0.9 to 0.11 gives wrong results for
forms that mix a one-point rule with another rule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import accumulate, islice
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
from ufl_beam.compiled.jit import compiled_form
from ufl_beam.compiled.simd_kernels import (
    BATCH,
    element_loops,
    in_batches,
    interleaved,
    point_loop,
)
from ufl_beam.dolfinx_compat import VERSIONS, fem, line_mesh, pack


def tabulators(compiled: fem.Form) -> list[Any]:
    """Return the C functions of the cell integrals of a form, valid as long as the form exists."""
    form = compiled.ufcx_form
    integrals = [form.form_integrals[i] for i in range(form.form_integral_offsets[1])]
    return [kernel(x.tabulate_tensor_float64, compiled.module.ffi) for x in integrals]


class Prepared(NamedTuple):
    """Form compiled for all scenes.

    Attributes:
        form, source: Form of DOLFINx, and the C file that FFCx wrote for it.
        tabulate: C function of the form.
        coefficients: Coefficients that the C function uses.
        columns: Columns of each coefficient in ``packed``, by ``id`` of the coefficient.
        constants: Values of the constants.
        packed: Values of the coefficients in each cell of the mesh of the form.
        entries: Number of entries of the vector or matrix of a cell; 1 for a functional.
    """

    form: fem.Form
    source: Path
    tabulate: Any
    coefficients: list[fem.Function]
    columns: dict[int, slice]
    constants: Array
    packed: Array
    entries: int


@lru_cache(maxsize=512)
def prepared(form: ufl.Form) -> Prepared:
    """Compile a form; a second call returns the first result."""
    compiled, source = compiled_form(form)
    ufcx, (constants, packed) = compiled.ufcx_form, pack(compiled)
    positions = ufcx.original_coefficient_positions[0 : ufcx.num_coefficients]
    used = [form.coefficients()[i] for i in positions]
    ends = [0, *accumulate(f.function_space.element.space_dimension for f in used)]
    if packed.shape[1] != ends[-1]:
        raise ValueError(f"{VERSIONS} pack {packed.shape[1]} values of a cell, not {ends[-1]}")
    # Keys are identities, because Python computes hashes of UFL functions slowly.
    columns = {id(f): slice(*ends[i : i + 2]) for i, f in enumerate(used)}
    sizes = [x.ufl_function_space().element.space_dimension for x in form.arguments()]
    entries = math.prod(sizes)
    if entries > lib.MOST_ENTRIES:
        raise ValueError(
            f"a form on cells of {' x '.join(map(str, sizes))} degrees of freedom has {entries} "
            f"entries; loops.h allows {lib.MOST_ENTRIES}"
        )
    (tabulate,) = tabulators(compiled)
    return Prepared(compiled, source, tabulate, used, columns, constants, packed, entries)


@cached_by_structure
def _positions(indptr: Index, indices: Index, dofs: Index, batch_size: int) -> tuple[Index, ...]:
    """Find the places of the entries of cells in a matrix.

    Batches of cells with equal positions share a pattern.  With cells of degree 1, patterns whose
    entries are adjacent in each row of the matrix come first.

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
    if entries == 36:
        by_node = distinct.reshape(len(distinct), 6, 6, batch_size)[:, :, [0, 2, 4, 1, 3, 5]]
        in_rows = (np.diff(by_node, axis=2) == 1).all(axis=(1, 2, 3))
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


class Kernel:
    """Compiled cell form with the packed values of its coefficients.

    The form is stated on a mesh of one cell, and the kernel evaluates it on all cells.
    Coefficients have the values in this one cell until :meth:`put` or :meth:`set` changes them.  A
    linear form whose test function is in the space of the unknown adds to the degrees of freedom of
    the cells.  Any other linear form returns separate entries for each cell.  After :meth:`place`,
    a bilinear form adds to a matrix.

    Args:
        form: Cell integrals with one quadrature rule.
        unknown: The configuration that is an argument of :meth:`add` and :meth:`value`; the form
            need not depend on it.
        cell_dofs: Degrees of freedom of the unknown; shape (num_cells, dofs per cell).
        coordinates: Vertices of the cells; shape (num_cells, 2, 2); m.
        several: ``coordinates`` in batches of :data:`BATCH`, by :func:`in_batches`; None: no SIMD.

    Attributes:
        batch_size: Number of cells that are computed at once with SIMD; else 1.
        coordinates: Vertices of the cells, in batches; m.
    """

    def __init__(
        self, form: ufl.Form, unknown: fem.Function, cell_dofs: Index, coordinates: Array,
        several: Array | None = None,
    ) -> None:  # fmt: skip
        self._form = ready = prepared(form)
        self._num_values = ready.entries
        self._dofs = np.ascontiguousarray(cell_dofs, dtype=np.int32)
        num_cells = len(cell_dofs)
        spaces = [argument.ufl_function_space() for argument in form.arguments()]
        self._is_functional, self._is_vector = not spaces, len(spaces) == 1
        self._to_dofs = self._is_vector and spaces[0] is unknown.function_space
        per_cell = self._dofs.shape[1] if self._to_dofs else self._num_values
        expected = (0, per_cell, (num_cells, 2, 2))
        if expected != (num_cells % len(ready.packed), self._num_values, coordinates.shape):
            raise ValueError(
                f"a form with {self._num_values} entries of a cell, stated on {len(ready.packed)} "
                f"cells, got rows of shape {(num_cells, per_cell)} and coordinates of shape "
                f"{coordinates.shape}"
            )
        self._matrix: Csr | None = None
        self._at, self._unknowns = 0, 0
        self._values, self._columns = ready.packed, ready.columns  # the unknown is removed below
        if self.uses(unknown):
            columns, self._unknowns = dict(ready.columns), self._dofs.shape[1]
            removed = columns.pop(id(unknown))
            self._at, width = removed.start, removed.stop - removed.start
            values = ready.packed
            self._values = np.hstack([values[:, : removed.start], values[:, removed.stop :]])
            self._columns = {
                function: x if x.stop <= removed.start else slice(x.start - width, x.stop - width)
                for function, x in columns.items()
            }
        address = None
        if several is not None:
            sizes = (self._num_values, ready.packed.shape[1], len(ready.constants))
            tabulate = int(ffi.cast("intptr_t", ready.tabulate))
            address = interleaved(ready.source, tabulate, sizes, (self._at, self._unknowns))
        if several is None or address is None:
            self.batch_size, self._tabulate_batch = 1, ffi.NULL
            self.coordinates = in_batches(coordinates, 1)
        else:
            self.batch_size = BATCH
            self._tabulate_batch = ffi.cast("tabulate_batch *", address)
            self.coordinates = several

    @cached_property
    def _packed(self) -> Array:
        """Values of all coefficients except the unknown in the cells, in batches."""
        values = self._values
        return in_batches(np.tile(values, (len(self._dofs) // len(values), 1)), self.batch_size)

    @cached_property
    def _places(self) -> dict[str, Any]:
        """Fields of the struct ``cells`` with the positions to which entries are added."""
        shape = len(self._dofs), self._num_values
        if self._to_dofs or self._is_functional:
            return {}
        if self._matrix is not None:
            return places_in(self._matrix, self._dofs, self.batch_size)
        places = np.zeros(shape, dtype=np.int32)
        if self._is_vector:
            places += np.arange(places.size, dtype=np.int32).reshape(shape)
        return {"row": in_batches(places, self.batch_size)}

    @cached_property
    def cells(self) -> Any:
        """Argument of ``add_cells`` of loops.h, created at the first use."""
        number, cell_size = self._dofs.shape
        packed, coefficients = self._packed, self._form.packed.shape[1]
        return fill(
            ffi.new("cells *"),
            tabulate=self._form.tabulate, several=self._tabulate_batch, batch_size=self.batch_size,
            number=number, of_cell=cell_size, dofs=self._dofs, unknowns=self._unknowns, at=self._at,
            width=packed.strides[0] // (packed.itemsize * self.batch_size), w=view_pointer(packed),
            constants=self._form.constants, coordinates=self.coordinates, rows=self._num_values,
            coefficients=coefficients, all=np.empty(coefficients),
            is_functional=self._is_functional, **self._places,
        )  # fmt: skip

    def uses(self, function: fem.Function) -> bool:
        """Return whether ``function`` is a coefficient of the form."""
        return id(function) in self._form.columns

    def position(self, function: fem.Function) -> int:
        """Return the first column of ``function`` in the packed values without the unknown."""
        return int(self._columns[id(function)].start)

    def set(self, function: fem.Function, q: Array) -> None:
        """Set ``function`` to the configuration ``q``, if the form depends on it."""
        if (columns := self._columns.get(id(function))) is not None:
            lib.set_cells(self.cells, doubles(q), columns.start)

    def put(self, function: fem.Function, values: Array) -> None:
        """Set the values of ``function`` in the cells; (num_cells, dofs per cell)."""
        columns = self._columns[id(function)]
        rows = np.broadcast_to(values, (len(self._dofs), columns.stop - columns.start))
        self._packed[:, columns] = in_batches(rows, self.batch_size)

    def get(self, function: fem.Function) -> Array:
        """Return the values of ``function`` in the cells; (num_cells, dofs per cell)."""
        columns = self._packed[:, self._columns[id(function)]]
        by_cell = columns.transpose(0, 2, 1).reshape(-1, columns.shape[1])
        return by_cell[: len(self._dofs)].copy()

    @property
    def coefficients(self) -> list[fem.Function]:
        """Coefficients of the form, without the unknown."""
        return [f for f in self._form.coefficients if id(f) in self._columns]

    def place(self, A: Csr) -> None:
        """Let :meth:`add` of a bilinear form add to entries of ``A`` from now on."""
        per_cell = self._dofs.shape[1]
        if self._num_values != per_cell**2:
            raise ValueError(
                f"{self._num_values} entries of a cell are no matrix of {per_cell} rows"
            )
        self._matrix = A

    def keep_entries(self) -> tuple[Any, int, Array]:
        """Store the entries of all cells in each evaluation from now on.

        Call :meth:`place` before this method; it has no effect afterwards.

        Returns:
            A pointer to the address of the array of entries; the number of cells in a batch, see
            :func:`in_batches`; and a second array, by which C may replace the first.
        """
        batches = -(-len(self._dofs) // self.batch_size)
        each, second = np.zeros((2, batches, self._num_values, self.batch_size))
        fill(self.cells, each=each)
        return ffi.addressof(self.cells, "each"), self.batch_size, second

    def add(self, q: Array, b: Array) -> None:
        """Add the form at the unknown ``q`` to ``b``, a vector or the entries of a matrix."""
        lib.add_cells(self.cells, doubles(q), doubles(b))

    def value(self, q: Array) -> float:
        """Return the value of the functional at the unknown ``q``."""
        value: float = lib.value_of_cells(self.cells, doubles(q))
        return value


def inserted_cells(function: Any, w: Array, dofs: Index, **places: Any) -> Any:
    """Return ``cells`` of loops.h for a function of cells, whose first inputs are the unknowns.

    ``w`` are the inputs in batches; for ``places`` see :func:`places_in`.
    """
    number, unknowns = dofs.shape
    return fill(
        ffi.new("cells *"), tabulate=function.one, several=function.inserts, batch_size=BATCH,
        number=number, of_cell=unknowns, dofs=dofs, unknowns=unknowns, width=w.shape[1],
        w=view_pointer(w[:, unknowns:]), rows=function.outputs, coefficients=w.shape[1],
        all=np.empty(w.shape[1]), **places,
    )  # fmt: skip


class InsertedForces:
    """Forces of cells of a statement, which is evaluated as a form; see :class:`Kernel`."""

    def __init__(self, cells: Any) -> None:
        self.cells = cells

    def uses(self, q0: object) -> bool:
        """Return whether the forces depend on the configuration before the step."""
        return True

    def set(self, q0: object, q: Array) -> None:
        """Set the configuration before the step, which follows the unknowns."""
        lib.set_cells(self.cells, doubles(q), 0)

    def add(self, q: Array, r: Array) -> None:
        """Add the forces at ``q`` to ``r``."""
        lib.add_cells(self.cells, doubles(q), doubles(r))

    def keep_entries(self) -> tuple[Any, int, Array]:
        """Store the forces of all cells in each evaluation, see :meth:`Kernel.keep_entries`."""
        batches, rows = -(-self.cells.number // BATCH), self.cells.rows
        each, second = np.zeros((2, batches, rows, BATCH))
        fill(self.cells, each=each)
        return ffi.addressof(self.cells, "each"), BATCH, second


def with_shared_nodes(
    expressions: Sequence[Expr], instead: Mapping[Expr, Expr] = MappingProxyType({})
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
    found, whole = _Components(), expand_derivatives(tensor)
    for node in unique_post_traversal(whole):  # operands first, which limits the recursion
        if isinstance(node, Operator) and not node.ufl_free_indices:
            for at in np.ndindex(node.ufl_shape):
                found.of(node, at)
    return [found.of(whole, at) for at in np.ndindex(whole.ufl_shape)]


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
        return self._compiled(outputs)[0][0]

    def compile_loop(self, *outputs: Expr) -> Any:
        """Compile a loop over points that computes the outputs, an ``answer_loop`` of loops.h.

        The loop is null if it would not be faster than calls of the function.
        """
        _, source, ((address, sizes),) = self._compiled(outputs)
        return ffi.cast("answer_loop *", point_loop(source, address, sizes) or 0)

    def compile_elements(
        self, *functions: Sequence[Expr], instead: Mapping[Expr, Expr] = MappingProxyType({}),
        inserted: int = 0, unknowns: int = 0,
    ) -> list[Any]:  # fmt: skip
        """Compile functions of elements together, each an ``element_function`` of loops.h.

        A function without outputs is None.  Nodes that are keys of ``instead`` are replaced.  For
        ``inserted`` and ``unknowns`` see :func:`element_loops`.
        """
        compiled, source, kernels = self._compiled(*filter(None, functions), instead=instead)
        loops = element_loops(source, kernels, inserted, unknowns)
        kinds = ("inserts", "tabulate_batch *"), ("several", "batch_function *")
        made = list[Any]()
        for k, (one, loop, (_, sizes)) in enumerate(zip(compiled, loops, kernels, strict=True)):
            made.append(struct("element_function", one=one, outputs=sizes[0]))
            name, kind = kinds[k >= inserted]
            fill(made[-1], **{name: ffi.cast(kind, loop or 0)})
        return [made.pop(0) if outputs else None for outputs in functions]

    def _compiled(
        self, *functions: Sequence[Expr], instead: Mapping[Expr, Expr] = MappingProxyType({})
    ) -> tuple[list[Any], Path, Any]:
        """Compile functions as integrals of one form.

        Returns:
            C functions, the C file that FFCx wrote, and addresses and sizes of the functions.
        """
        every = [x for outputs in functions for x in outputs]
        shared = iter(with_shared_nodes(every, instead))
        sizes = [(len(outputs), len(self.at), 0) for outputs in functions]
        z = ufl.TestFunction(self.values(most := max(sizes)[0]))
        dx = ufl.Measure("dx", domain=self._cell, metadata={"quadrature_degree": 1})
        values = ([*islice(shared, n), *[0] * (most - n)] for n, *_ in sizes)
        parts = (ufl.dot(ufl.as_vector(x), z) * dx(k) for k, x in enumerate(values))
        form, source = compiled_form(sum(parts))
        self._alive.append(form)
        addresses = [int(ffi.cast("intptr_t", x)) for x in tabulators(form)]
        return tabulators(form), source, tuple(zip(addresses, sizes, strict=True))

    def values(self, n: int) -> fem.FunctionSpace:
        """Return a space of n values at the point."""
        element = basix.ufl.quadrature_element("interval", value_shape=(n,), degree=1)
        return fem.functionspace(self._cell, element)
