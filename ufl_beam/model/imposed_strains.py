# SPDX-License-Identifier: MIT
"""Imposed strains of beams: temperature, shrinkage, tendons, lack of fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import KW_ONLY, dataclass
from numbers import Real
from typing import Annotated, ClassVar

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, closed
from ufl_beam.model import plausibility
from ufl_beam.model.beams import Beam
from ufl_beam.model.bodies import AttachmentPoint, Member
from ufl_beam.model.checks import require_kind, require_number
from ufl_beam.model.functions import Timed, TimeFunction, steady
from ufl_beam.model.loads import Load, Profile, profile_at, require_profile, require_span
from ufl_beam.model.records import Instance


def require_along(value: object, what: str) -> Profile:
    """Return ``value`` as a pair of numbers at both ends or as a function of s, or raise."""
    if isinstance(value, Real):
        return (require_number(value, what),) * 2
    return require_profile(value, what)


Along = Annotated[Profile | float, require_along]


@closed("state other strains in the law of a section")
@dataclass(frozen=True, eq=False, repr=False)
class ImposedStrain(Load):
    """Strains that a beam would have without stress, by temperature, shrinkage or a tendon.

    Stresses follow from the strains of the beam minus the imposed strains.  Section forces,
    reactions, stored energy, yielding and hinges refer to these stresses.  The strains act on the
    whole section, also on sections of fibres: the axial strain of a fibre at y is
    ``axial - y curvature``.  The ledger contains minus the work of the stresses on the imposed
    strains in the entry "loads".  A static run applies the initial imposed strains in its first
    step; a dynamic run begins with them.

    Each strain is a number, a pair of values at both ends of the span, or a function of the
    parameter s of the beam.  A cell with p integration points replaces the strains by a polynomial
    of degree p - 1 with the same mean.  A saved solution contains a function of s as a table of
    values.

    Args:
        beam: The beam.
        axial: Imposed axial strain, positive in elongation; dimensionless.
        curvature: Imposed curvature, positive with elongation on the right of the direction of the
            beam; 1/m.
        shear: Imposed shear strain; dimensionless.
        amplitude: Factor on the strains, a function of time t (s).
        span: Parameters of the beam at both ends of the strains, from 0 to 1.  Both ends become
            vertices of the mesh.

    Raises:
        ModelError: The span is not inside the beam, or a strain is not finite at an end of it.

    Example:
        >>> fire = ub.ImposedStrain.temperature(beam, 1.2e-5, uniform=100.0)  # 1/K, K
        >>> held = ub.Scene(
        ...     [beam], supports=[ub.Clamped(beam.start), ub.Clamped(beam.end)], loads=[fire]
        ... )
        >>> run = ub.simulate(held, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(f"{run.section_forces(beam)[0, 0] / section.EA:.4f}")  # -1.2e-5 * 100
        -0.0012
    """

    dead: ClassVar = False  # the stresses change the stiffness of the beam

    beam: Instance[Member]
    axial: Along = (0.0, 0.0)
    curvature: Along = (0.0, 0.0)
    amplitude: Timed = steady
    _: KW_ONLY
    shear: Along = (0.0, 0.0)
    span: Annotated[tuple[float, float], require_span] = (0.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        axial, _, curvature = abs(self.strains(np.array(self.span))).max(axis=0)
        bent = float(curvature) * self.beam.section.depth
        plausibility.check(str(self), "imposed strain", float(axial))
        plausibility.check(str(self), "imposed curvature times depth", bent)

    def __str__(self) -> str:
        return f"ImposedStrain of {self.beam.name}"

    def attached_to(self) -> Iterable[AttachmentPoint]:
        """See the base class."""
        return (self.beam.at(s) for s in self.span)

    def strains(self, s: Array) -> Array:
        """Return (axial, shear, curvature) at parameters ``s``; (..., 3); zero out of the span."""
        names = ("axial", "shear", "curvature")
        values = [profile_at(s, getattr(self, x), self.span, f"{self}: {x}") for x in names]
        return np.stack(values, axis=-1)

    @classmethod
    def temperature(
        cls, beam: Beam, expansion: float, uniform: float = 0.0, gradient: float = 0.0, *,
        amplitude: TimeFunction = steady, span: tuple[float, float] = (0.0, 1.0),
    ) -> ImposedStrain:  # fmt: skip
        """Create the strains of a change of temperature that is linear over the depth.

        Args:
            beam: The beam.
            expansion: Coefficient of thermal expansion; 1/K.
            uniform: Change of the temperature of the axis; K.
            gradient: Gradient of the change of temperature across the depth, positive if the left
                of the beam is warmer, (left - right) / depth; K/m.
            amplitude: Factor on both, a function of time t (s).
            span: Parameters of the beam at both ends of the heated part.
        """
        α = require_number(expansion, "ImposedStrain.temperature: expansion", positive=True)
        T = require_number(uniform, "ImposedStrain.temperature: uniform")
        g = require_number(gradient, "ImposedStrain.temperature: gradient")
        return cls(beam, α * T, -α * g, amplitude, span=span)

    @classmethod
    def tendon(
        cls, beam: Beam, force: float, eccentricity: Along = 0.0, *,
        amplitude: TimeFunction = steady, span: tuple[float, float] = (0.0, 1.0),
    ) -> ImposedStrain:  # fmt: skip
        """Create the strains that a tendon with a given force causes in an elastic section.

        Section forces of the scene are sums over concrete and tendon.  So the concrete bears
        ``N - force``, and N and M vanish in a statically determinate beam without other loads.

        Args:
            beam: The beam.
            force: Force of the tendon, positive in tension; N.  It is constant along
                the span; several loads with different spans can describe a loss by friction.
            eccentricity: Distance of the tendon from the axis, positive to the left of the
                direction of the beam; m.  A number, a pair of values at both ends, or a function of
                s, such as a parabola, or ``ub.Table`` for a polygon.
            amplitude: Factor on the force, a function of time t (s).
            span: Parameters of the beam at both ends of the tendon.

        Raises:
            ModelError: The tendon is below the lowest or above the highest point of the section.
        """
        require_kind(beam, Beam, "ImposedStrain.tendon: beam")
        P = require_number(force, "ImposedStrain.tendon: force")
        e = require_along(eccentricity, "ImposedStrain.tendon: eccentricity")
        section, (first, last) = beam.section, require_span(span, "ImposedStrain.tendon: span")
        s = first + (last - first) * np.arange(101.0) / 100
        at = profile_at(s, e, (first, last), "ImposedStrain.tendon: eccentricity")
        low, high = -section.depth / 2, section.depth / 2
        if section.fibres is not None:
            low, high = (end - section.fibres.axis for end in section.fibres.ends)
        elif section.shape is not None:
            low, high = section.shape.bottom, section.shape.top
        outside = np.maximum(at - high, low - at)
        far = outside.argmax()
        if outside[far] > 1e-9 * (high - low):
            raise ModelError(
                f"ImposedStrain.tendon: the tendon has the eccentricity {at[far]:.3g} m in "
                f"{beam.name} at s = {s[far]:.3g}, outside its section, which reaches from "
                f"{low:.3g} to {high:.3g} m"
            )
        curvature = _scaled(e, P / section.EI)
        return cls(beam, -P / section.EA, curvature, amplitude, span=span)


def _scaled(profile: Profile, factor: float) -> Profile:
    """Return a profile times a factor."""
    if callable(profile):
        function: Callable[[float], float] = profile
        return lambda s: factor * function(s)
    return profile[0] * factor, profile[1] * factor
