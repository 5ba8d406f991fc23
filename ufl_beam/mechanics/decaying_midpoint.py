# SPDX-License-Identifier: MIT
"""Midpoint rule of second order whose energy decays at high frequencies."""

from __future__ import annotations

from dataclasses import dataclass

from ufl_beam.mechanics.energy_momentum import ExactStep, Midway
from ufl_beam.mechanics.time_schemes import Coefficients, require_between


@dataclass(frozen=True)
class DecayingMidpoint(ExactStep, Midway):
    """Midpoint rule of second order that dissipates the energy of high frequencies.

    The dissipation of :class:`Midpoint` is proportional to the changes of strains and velocities in
    a step, and of first order.  Here it is proportional to second differences of both: a mode of
    circular frequency ω loses the part c (ω dt)⁴ of its energy in a step, with c = rho_inf (1 -
    rho_inf) / (2 (1 + rho_inf)²), and unresolved modes are reduced to ``rho_inf`` of their
    amplitude.  The equations of the step are

        resultants  C ((e0 + e1)/2 + c (Δe - r Δe')),     Δu/dt = (v0 + v1)/2 + c (Δv - r Δv'),

    Δe' and Δv' being the changes in the step before, and r the ratio of both steps, 1 at most.

    The sum of the energy and of c/2 times the energy of Δe and Δv never grows by the scheme, for
    any steps, because Δe (Δe - r Δe') = (Δe² - r² Δe'² + (Δe - r Δe')²)/2.  The total loss is the
    entry "numerical" of the ledger and never negative; a single step may give back a part of the
    loss of previous steps.  Linear momentum is conserved exactly, angular momentum to second order.
    Resultants of cells that may yield or break are not damped, so that open hinges turn freely, nor
    are connectors.

    Args:
        rho_inf: Spectral radius at infinite frequency, from 1/3 to 1; 1 loses nothing.

    Raises:
        SceneError: A number outside [1/3, 1].

    Example:
        >>> run = ub.simulate(scene, ub.DecayingMidpoint(rho_inf=0.5), t=(0, 1), dt=0.05)
        >>> bool(run.energy.lost["numerical"][-1] > 0), bool(run.energy.worst < 1e-9)
        (True, True)
    """

    rho_inf: float = 0.5

    alpha = 0.0
    looks_back = True

    def __post_init__(self) -> None:
        require_between("DecayingMidpoint: rho_inf", self.rho_inf, 1 / 3, 1.0)

    @property
    def part(self) -> float:
        """The part c of what second differences of strains and velocities store that is lost."""
        # At infinity (λ + 1)/2 + c (λ - 1)²/λ = 0; λ = -rho_inf is the larger root.
        return self.rho_inf * (1 - self.rho_inf) / (2 * (1 + self.rho_inf) ** 2)

    def coefficients(self, dt: float, last_dt: float, known: int) -> Coefficients:
        """Velocities, of whose changes in this step and in the last one a part counts."""
        c, keep = self.part, 0.5 + self.part
        r = c * min(1.0, dt / last_dt)
        return Coefficients(
            inertia=(1 / (dt**2 * keep), (r - 1) / (dt * keep), -r / (dt * keep)),
            velocity=(1 / dt, 0.0, 0.0),
            rates=((1 / (dt * keep), (c + r - 0.5) / keep, -r / keep),),
            slip=(c, -r, r),
        )

    def error_weights(self) -> tuple[float, float]:
        """The trapezoidal rule's, and what the second differences delay."""
        return 0.0, 1 / 12 + self.part
