"""UFL forms compiled for the hot loop: packed once, refreshed only where something changed.

A form is compiled with one quadrature rule: forms that mix a one-point rule with another are
silently wrong in FFCx 0.9 to 0.11.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from ufl_beam.compat import Array, cpp, fem
from ufl_beam.grid import Index
from ufl_beam.sparse import Csr


class Kernel:
    """A compiled cell form together with the packed values of its coefficients.

    Attributes:
        compiled: The DOLFINx form.
    """

    def __init__(self, form: ufl.Form) -> None:
        self.compiled = fem.form(form)
        self._form = self.compiled._cpp_object
        self._constants = cpp.fem.pack_constants(self._form)
        self._packed: dict[Any, Array] = cpp.fem.pack_coefficients(self._form)
        positions = self.compiled.ufcx_form.original_coefficient_positions
        everything = form.coefficients()
        used = [everything[positions[i]] for i in range(self._form_num_coefficients())]
        widths = [f.function_space.element.space_dimension for f in used]
        ends = np.cumsum(widths)
        self._columns = {f: slice(b - w, b) for f, w, b in zip(used, widths, ends, strict=True)}

    def depends_on(self, function: fem.Function) -> bool:
        """Whether ``function`` appears in the form."""
        return function in self._columns

    def _form_num_coefficients(self) -> int:
        return int(self.compiled.ufcx_form.num_coefficients)

    def coefficient(self, function: fem.Function) -> Array:
        """Packed values of ``function``: a view, written to in the place of the function.

        Shape (num_cells, dofs per cell).
        """
        (array,) = self._packed.values()
        return array[:, self._columns[function]]

    def share(self, other: Kernel) -> None:
        """Use the packed values of ``other``, a form of the same coefficients."""
        if self._columns != other._columns:
            raise ValueError("the forms do not have the same coefficients")
        self._packed = other._packed

    def add_to_vector(self, b: Array) -> None:
        """Add the linear form to ``b``."""
        cpp.fem.assemble_vector(b, self._form, self._constants, self._packed)

    def add_to_matrix(self, A: Csr) -> None:
        """Add the bilinear form to ``A``."""
        cpp.fem.assemble_matrix(A.matrix._cpp_object, self._form, self._constants, self._packed, [])

    def value(self) -> float:
        """Value of the functional."""
        return float(cpp.fem.assemble_scalar(self._form, self._constants, self._packed))


class Refresh:
    """Copies a configuration into the packed coefficients of kernels.

    Kernels in which the configuration does not appear cost nothing.
    """

    def __init__(self, cell_dofs: Index, function: fem.Function, kernels: list[Kernel]) -> None:
        self._dofs = np.ascontiguousarray(cell_dofs, dtype=np.intp)
        self._targets = [k.coefficient(function) for k in kernels if k.depends_on(function)]

    def __call__(self, q: Array) -> None:
        """Write the local degrees of freedom ``q``."""
        for target in self._targets:
            target[:] = q[self._dofs]
