# SPDX-License-Identifier: MIT
"""Laws of several resultants of a cross-section that yield together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ufl_beam.model.law_functions import Values, below, sqrt, where
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.records import Positive, Record


@dataclass(frozen=True)
class AxialBending(Record, MaterialLaw):
    """Yield surface of axial force and moment, (N/Np)² + abs(M)/Mp = 1, with associated flow.

    It is that of a rectangle of an ideally plastic material.  Its ridge at M = 0 is rounded:
    abs(m) is (sqrt(m² + w²) - w)/(sqrt(1 + w²) - w) of m = M/Mp and w = ``rounding``.

    Args:
        axial: Np, the yield force; N.
        bending: Mp, the plastic moment; N m.
        rounding: Width w of the ridge.

    Raises:
        SceneError: A number is not positive.

    Example:
        >>> law = ub.AxialBending(axial=5e6, bending=2.5e5)  # N, N m
        >>> yields = ub.Section(EA=4.2e9, GA=1.3e9, EI=1.4e7, rhoA=157.0, interaction=law)
    """

    axial: Positive
    bending: Positive
    rounding: Positive = 0.01
    resultants: ClassVar[str] = "NM"
    variables: ClassVar[Mapping[str, float]] = {"stretch": 0.0, "curvature": 0.0, "flow": 0.0}

    def stress(self, strain: Values, state: State) -> Values:
        """(N, M) of the elastic parts of the strains."""
        (Σ, K), (EA, EI) = strain, self.C
        return EA * (Σ - state.stretch), EI * (K - state.curvature)

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Energy per length of the elastic parts of the strains."""
        (Σ, K), (EA, EI) = strain, self.C
        return (EA * (Σ - state.stretch) ** 2 + EI * (K - state.curvature) ** 2) / 2

    def excess(self, N: Values, M: Values) -> Values:
        """Yield function; positive outside of the surface."""
        w, m = self.rounding, M / self.bending
        return (N / self.axial) ** 2 + (sqrt(m**2 + w**2) - w) / (sqrt(1 + w**2) - w) - 1

    def residuals(self, strain: Values, old: State, new: State, dt: Values) -> Mapping[str, Values]:
        """Flow along the normal of the surface up to which the resultants return.

        Flow against the normal would lead to the far side of the surface.  So a negative flow moves
        nothing, and the excess grows with it: the equations have one solution.
        """
        (N, M), (EA, EI) = self.stress(strain, new), self.C
        w, m, flow = self.rounding, M / self.bending, new.flow - old.flow
        by_m = m / sqrt(m**2 + w**2) / (sqrt(1 + w**2) - w)
        γ = where(below(flow, 0.0), 0.0, flow)
        back = (flow - γ) * (EA / self.axial**2 + EI / self.bending**2)
        outside = below(-self.excess(*self.stress(strain, old)), 0.0)
        return {
            "stretch": new.stretch - old.stretch - γ * 2 * N / self.axial**2,
            "curvature": new.curvature - old.curvature - γ * by_m / self.bending,
            "flow": where(outside, self.excess(N, M) - back, flow),
        }
