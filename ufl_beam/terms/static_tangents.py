# SPDX-License-Identifier: MIT
"""Tangents of static steps, whose forces are those that the iteration before has predicted.

Displacements that solve a linear equation strain slender beams along their axes by nothing but the
error of the linearisation, and forces from that send the next iteration astray.  The equation was
about forces as well, which strains that are linear in the displacements predict without that
error: they belong into the tangent, while the residual remains that of the displacements.  That is
Newton's method for displacements and forces as independent unknowns, as the functional has them,
with the forces eliminated; it converges in few iterations, whatever the slenderness.  The first
guess of a step strains beams in the same way, so cells that yield extrapolate strains of states.

Magisano, Leonetti and Garcea, Computer Methods in Applied Mechanics and Engineering 313 (2017).
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

import numpy as np
import ufl

from ufl_beam.compiled.c_library import Loop, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import stated
from ufl_beam.discretization.function_spaces import Element, Fields
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_schemes import Scheme


@stated
def _linear_strains(of: Element) -> tuple[ufl.Form, fem.Function]:
    """Strains at the points, linear in a displacement about a configuration; that one."""
    about = of.configuration()
    e_about = strain(about, of.axis)
    linear = e_about + ufl.derivative(e_about, about, of.q1)
    z = ufl.TestFunction(of.at_points(3).function_space)
    return ufl.dot(linear, z) / of.axis.h * of.dx(1), about


class PredictedStrains:
    """Strains that an iteration of a static step predicts, by linear kinematics.

    Attributes:
        c: ``predicted_strains`` of loops.h, with the state of the iteration.
    """

    def __init__(self, fields: Fields) -> None:
        form, self._about = _linear_strains(fields.element)
        self._form = fields.hot_kernel(form, fields.element.q1)
        self._weights = fields.share.grid.mesh.point_weights.repeat(3)
        self._last, change = np.zeros((2, fields.share.size))
        shape = self._shape = len(fields.order), len(self._weights)
        self.c = struct(
            "predicted_strains", size=len(change), of_cell=shape[1], weight=self._weights,
            about=self._last, change=change, e=np.zeros(shape),
            strains=self._form.cells, at_about=self._form.position(self._about),
        )  # fmt: skip

    def beginning(self) -> Loop:
        """The phase that begins a step."""
        return loop("begin_predicted_strains", self.c)


@stated
def _tangent(of: Element, scheme: Scheme) -> tuple[ufl.Form, fem.Function]:
    """Tangent of elastic cells with given strains in its forces; these strains."""
    q0, q1, C = of.q0, of.q1, of.stiffness
    e0, e1, e = strain(q0, of.axis), strain(q1, of.axis), of.at_points(3)
    w_e = scheme.virtual_strain(q0, q1, of.w, of.axis)
    acting = partial(scheme.resultants, C, e0, constant=of.constant)
    change = ufl.TrialFunction(of.space)
    geometric = virtual_work(acting(e), ufl.derivative(w_e, q1, change))
    material = virtual_work(ufl.derivative(acting(e1), q1, change), w_e)
    return (geometric + material) * of.dx(1), e


class StaticTangent:
    """Tangent of elastic cells in a static step.

    Attributes:
        kernel: The form; it has the configuration at the beginning of the step.
        predicted: Strains of its forces.
    """

    def __init__(self, fields: Fields, scheme: Scheme, A: Csr) -> None:
        form, self._e = _tangent(fields.element, scheme)
        self.kernel = fields.hot_kernel(form, fields.element.q1)
        self.kernel.place(A)
        self.predicted, self._data = PredictedStrains(fields), A.data

    @cached_property
    def _in_c(self) -> Any:
        return struct(
            "static_tangent", predicted=self.predicted.c, tangent=self.kernel.cells,
            at_e=self.kernel.position(self._e),
        )  # fmt: skip

    def loop(self) -> Loop:
        """The loop that adds the tangent at an iterate."""
        return loop("add_static_tangent", self._in_c)

    def beginning(self) -> Loop:
        """The phase that begins a step; no branches are to be found by extrapolated strains."""
        return loop("begin_static_tangent", self._in_c)
