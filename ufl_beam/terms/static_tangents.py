# SPDX-License-Identifier: MIT
"""Tangents of static steps, whose forces are those that the iteration before has predicted.

Displacements that solve a linear equation strain slender beams along their axes by nothing but the
error of the linearisation, and forces from that send the next iteration astray.  The equation was
about forces as well, which strains that are linear in the displacements predict without that
error: they belong into the tangent, while the residual remains that of the displacements.  That is
Newton's method for displacements and forces as independent unknowns, as the functional has them,
with the forces eliminated; it converges in few iterations, whatever the slenderness.

Magisano, Leonetti and Garcea, Computer Methods in Applied Mechanics and Engineering 313 (2017).
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import Loop, fill, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.tangents import Tangents
from ufl_beam.mechanics.time_schemes import Scheme


@stated
def _forms(of: Element, scheme: Scheme) -> tuple[ufl.Form, fem.Function, ufl.Form, fem.Function]:
    """Tangent with given strains in its forces; strains linear in a displacement; the functions."""
    q0, q1, C, about = of.q0, of.q1, of.stiffness, of.configuration()
    e0, e1, e = strain(q0, of.axis), strain(q1, of.axis), of.at_points(3)
    w_e = scheme.virtual_strain(q0, q1, of.w, of.axis)
    acting = partial(scheme.resultants, C, e0, constant=of.constant)
    change = ufl.TrialFunction(of.space)
    geometric = virtual_work(acting(e), ufl.derivative(w_e, q1, change))
    material = virtual_work(ufl.derivative(acting(e1), q1, change), w_e)
    e_about = strain(about, of.axis)
    linear = e_about + ufl.derivative(e_about, about, q1)
    z = ufl.TestFunction(e.function_space)
    return (geometric + material) * of.dx(1), e, ufl.dot(linear, z) / of.axis.h * of.dx(1), about


class StaticTangent:
    """Tangent of elastic cells in a static step.

    Attributes:
        kernel: The form; it has the configuration at the beginning of the step.
    """

    def __init__(self, fields: Fields, scheme: Scheme, A: Csr) -> None:
        tangent, self._e, strains, self._about = _forms(fields.element, scheme)
        unknown, size = fields.element.q1, fields.share.size
        self.kernel, self._strains = (fields.hot_kernel(x, unknown) for x in (tangent, strains))
        self.kernel.place(A)
        self._data, self._weights = A.data, fields.share.grid.mesh.point_weights.repeat(3)
        self._predicted: Array = np.zeros((len(fields.order), len(self._weights)))
        self._q0: Array = np.zeros(size)
        self._last: Array = self._q0
        self._begins = self._exact = False

    def begin(self, q0: Array) -> None:
        """Begin a step: the first forces are those at its beginning."""
        self._q0 = q0
        if self.kernel.cells:
            fill(self._in_c, q0=q0)
        self.restart(Tangents.PREDICTED)

    def restart(self, tangents: Tangents) -> None:
        """Begin to iterate anew, with tangents of this kind."""
        self._begins = tangents is not Tangents.EXACT
        self._exact = exact = tangents is not Tangents.PREDICTED
        if self.kernel.cells:
            self._in_c.begins, self._in_c.exact = self._begins, exact

    def add(self, q: Array) -> None:
        """Add the tangent at an iterate to the matrix."""
        about = self._q0 if self._begins else q if self._exact else self._last
        self._strains.set(self._about, about)
        self._predicted.fill(0.0)
        self._strains.add(q - about if not self._begins else np.zeros_like(q), self._predicted)
        self.kernel.put(self._e, self._predicted / self._weights)
        self.kernel.add(q, self._data)
        self._last, self._begins = q.copy(), False

    # -- in C ----------------------------------------------------------------------------------

    @cached_property
    def _in_c(self) -> Any:
        kernel: Any = self.kernel
        strains: Any = self._strains
        about, change = np.zeros((2, len(self._last)))
        return struct(
            "static_tangent", size=len(about), of_cell=len(self._weights), weight=self._weights,
            tangent=kernel.cells, at_e=kernel.position(self._e), strains=strains.cells,
            at_about=strains.position(self._about), about=about, change=change,
            e=np.zeros(self._predicted.shape), q0=self._q0,
        )  # fmt: skip

    def loop(self) -> Loop:
        """The loop of :meth:`add`."""
        return loop("add_static_tangent", self._in_c)

    def beginning(self) -> Loop:
        """The phase of :meth:`begin`."""
        return loop("begin_static_tangent", self._in_c)
