# SPDX-License-Identifier: MIT
"""Forms of the virtual work of beams, for views in DOLFINx.

In steps, forces inside beams are the statements of :mod:`ufl_beam.blocks.beams`.
"""

from __future__ import annotations

from typing import NamedTuple

import ufl

from ufl_beam.caches import cached_forms
from ufl_beam.discretization.function_spaces import Element
from ufl_beam.dolfinx_compat import fem
from ufl_beam.mechanics.functional import kinetic_energy, virtual_work
from ufl_beam.mechanics.kinematics import strain
from ufl_beam.mechanics.time_scheme import Scheme


@cached_forms
def imposed_at_points(element: Element) -> fem.Function:
    """Return the imposed strains of cells at both ends of a step; (6,); 1, 1, 1/m."""
    return element.at_points(6)


@cached_forms
def elastic_form(element: Element, scheme: Scheme, *, imposed: bool = False) -> ufl.Form:
    """Return the virtual work of elastic cells in a step of a time scheme."""
    q0, q1, w, x = element.q0, element.q1, element.w, imposed_at_points(element)
    ends = (strain(q, element.axis) for q in (q0, q1))
    parts = [ufl.as_vector([x[i + k] for k in range(3)]) * imposed for i in (0, 3)]
    e0, e1 = (e - part if imposed else e for e, part in zip(ends, parts, strict=True))
    r = scheme.resultants(element.stiffness, e0, e1, element.constant)
    return virtual_work(r, scheme.virtual_strain(q0, q1, w, element.axis)) * element.dx(1)


@cached_forms
def derivative(work: ufl.Form, q1: fem.Function) -> ufl.Form:
    """Return the derivative of a virtual work with respect to ``q1``."""
    return ufl.derivative(work, q1, ufl.TrialFunction(q1.function_space))


@cached_forms
def mass_form(element: Element) -> ufl.Form:
    """Return the mass of the beams as a bilinear form; kg, kg m²."""
    v = element.configuration()
    energy = kinetic_energy(v, element.inertia) * element.dx_of_mass()
    return derivative(ufl.derivative(energy, v, element.w), v)


class InelasticForms(NamedTuple):
    """Virtual work of b + D e, which is affine in the strains e."""

    around: ufl.Form
    b: fem.Function
    D: fem.Function


@cached_forms
def inelastic_forms(element: Element, scheme: Scheme) -> InelasticForms:
    """Return the forms of inelastic cells in a step of a time scheme."""
    b, D = element.at_points(3), element.at_points(3, 3)
    w_e = scheme.virtual_strain(element.q0, element.q1, element.w, element.axis)
    resultants = b + ufl.dot(D, strain(element.q1, element.axis))
    return InelasticForms(virtual_work(resultants, w_e) * element.dx(1), b, D)
