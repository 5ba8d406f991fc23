# SPDX-License-Identifier: MIT
"""Laws of steel bars under cyclic strains: Menegotto and Pinto."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

from ufl_beam.model.checks import require_number
from ufl_beam.model.law_functions import (
    Values,
    absolute,
    below,
    exp,
    larger,
    log,
    positive,
    sign,
    smaller,
    where,
)
from ufl_beam.model.material_law import State
from ufl_beam.model.material_laws import Limit, PlasticLaw
from ufl_beam.model.records import NotNegative, Positive

STANDSTILL = 1e-8
"""Change of the strain that counts as a reversal, as a fraction of the yield strain.

Smaller changes are errors of the equilibrium.  If they were reversals, steps under a constant load
would restore the elastic stiffness of yielding fibres.
"""


@dataclass(frozen=True)
class MenegottoPinto(PlasticLaw):
    """Steel of Menegotto and Pinto, with the isotropic hardening of Filippou, Popov and Bertero.

    A branch begins at each reversal (εr, σr) with the stiffness C and approaches the hardening
    line of its direction.  With x = (ε - εr)/(ε0 - εr), where ε0 is the strain at which the elastic
    line through the reversal meets the hardening line, the stress is
    σr + C (ε0 - εr) (b x + (1 - b) x/(1 + x^R)^(1/R)).  The exponent is
    R = R0 (1 - cR1 ξ/(cR2 + ξ)), where ξ is the distance of ε0 from the largest strain in the
    direction of the branch, in yield strains.  The hardening line has the slope b C.  Its yield
    stress is multiplied by 1 + a1 ((εmax - εmin)/(2 a2 εy))^0.8 in compression, with a3 and a4
    in tension.  The entry "plastic" of the ledger is the work minus the elastic energy σ²/2C, by
    the mean stress of each step.  It falls between a reversal and the next zero of the stress,
    where yielding begins (Bauschinger effect).  After Menegotto and Pinto, IABSE Reports 13 (1973),
    and Filippou, Popov and Bertero, report UCB/EERC-83/19; the law is ``Steel02`` of OpenSees.

    Args:
        yield_limit: Stress at which the elastic line meets the hardening line, or a distribution
            such as :class:`Normal`; Pa, N or N m.
        hardening: Slope b of the hardening line, divided by C; from 0 to 0.999.
        R0: Exponent R of the first branch; 10 to 20.
        cR1: Largest relative decrease of R, less than 1.
        cR2: Value of ξ at which half of this decrease is reached.
        a1: Isotropic hardening in compression; zero, the default, means none.
        a2: Half of the range of strains in yield strains, at which the increase is a1.
        a3: Isotropic hardening in tension.
        a4: The same as a2, in tension.

    Raises:
        ModelError: A parameter is out of range.

    Example:
        >>> law = st.MenegottoPinto(yield_limit=500e6, hardening=0.01)  # Pa, 1
        >>> bars = ub.Section.of_fibres(
        ...     y=[-0.2, 0.2], A=[1e-3, 1e-3], E=200e9, nu=0.3, fibres=ub.Fibres(law)
        ... )
    """

    yield_limit: Limit
    hardening: Annotated[float, partial(require_number, at_least=0.0, at_most=0.999)]
    R0: Positive = 20.0
    cR1: Annotated[float, partial(require_number, at_least=0.0, at_most=0.999)] = 0.925
    cR2: Positive = 0.15
    a1: NotNegative = 0.0
    a2: Positive = 1.0
    a3: NotNegative = 0.0
    a4: Positive = 1.0
    active: ClassVar[bool] = True  # energy of the Bauschinger effect is not in the stored energy
    records_path: ClassVar[bool] = True
    # A branch has a start, a level σr/C, a span ε0 - εr and a sharpness R.  "turned" is the branch
    # that begins if the strain turns at "last".  Virgin steel has a span of zero.
    variables: ClassVar[Mapping[str, float]] = {
        "plastic": 0.0, "last": 0.0, "largest": 0.0, "least": 0.0, "start": 0.0, "level": 0.0,
        "span": 0.0, "sharpness": 0.0, "turned_span": 0.0, "turned_sharpness": 0.0,
    }  # fmt: skip

    def increments(self, strain: Values, state: State, dt: Values) -> dict[str, Values]:
        """Return the increments; strains that change by less than a limit leave the branch."""
        b, y = self.hardening, self.yield_limit / self.C
        change, none = strain - state.last, STANDSTILL * y
        virgin = below(absolute(state.span), 1e-4 * none)
        reverses = below(change * where(virgin, 0.0, sign(state.span)), -none)

        start = where(reverses, state.last, state.start)
        level = where(reverses, state.last - state.plastic, state.level)
        span = where(reverses, state.turned_span, where(virgin, sign(change) * y, state.span))
        R = where(reverses, state.turned_sharpness, where(virgin, self.R0, state.sharpness))
        x = (strain - start) / span
        size = log(larger(absolute(x), 1e-30))
        root = positive(size) + log(1 + exp(-R * absolute(size))) / R  # log(1 + abs(x)^R)/R
        elastic = level + (strain - start) * (b + (1 - b) * exp(-root))  # strain of the stress

        up = below(span, 0.0)  # the direction after a reversal
        largest, least = larger(state.largest, strain), smaller(state.least, strain)
        highest, lowest = larger(largest, y), smaller(least, -y)
        a, per = where(up, self.a3, self.a1), where(up, self.a4, self.a2)
        shift = 1 + a * ((highest - lowest) / (2 * per * y)) ** 0.8
        turned = where(up, y, -y) * shift + (b * strain - elastic) / (1 - b)
        ξ = absolute(where(up, highest, lowest) - strain - turned) / y
        moves = {
            "last": strain, "largest": largest, "least": least, "start": start,
            "level": level, "span": span, "sharpness": R, "turned_span": turned,
            "turned_sharpness": self.R0 * (1 - self.cR1 * ξ / (self.cR2 + ξ)),
        }  # fmt: skip
        stays = below(absolute(change), none)
        return {
            name: where(stays, 0.0, new - getattr(state, name)) for name, new in moves.items()
        } | {"plastic": strain - elastic - state.plastic}
