# SPDX-License-Identifier: MIT
"""Laws of rigid-plastic connectors over a step, as functions of the slip that grows in it.

They are stated once for UFL and for numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.law_functions import Values
from ufl_beam.model.material_law import State
from ufl_beam.model.material_laws import Hardening
from ufl_beam.model.softening_laws import SofteningLaw


class Slip(NamedTuple):
    """A law of slip over a step; J, forces in N or N m."""

    force: Values  # that acts in the step, in the direction of the motion
    dissipated: Values  # in the step
    lost: Values  # numerically by backward Euler, over ``2 alpha`` of the scheme
    stored: Values  # at the end
    limit: Values  # force beyond the back force up to which the motion is held after the step
    back_force: Values  # force about which the limit lies after the step


@singledispatch
def slip(law: Any, at: Mapping[str, Values], scheme: Scheme) -> Slip:
    """Slip by a law; numbers of ``law`` itself do not matter.

    They are by name: the slip of the step and its direction (1 or -1); accumulated slip (slipped)
    and motion (start) at its beginning; θ and dt; numbers of the law, see :func:`numbers`.
    """
    raise TypeError(f"{law!r} is no law of a hinge")


@singledispatch
def numbers(law: Any) -> dict[str, Any]:
    """Numbers of a law by the names that :func:`slip` has for them."""
    raise TypeError(f"{law!r} is no law of a hinge")


@numbers.register
def _(law: SofteningLaw) -> dict[str, Any]:
    return {f"number {name}": value for name, value in law.numbers().items()}


@numbers.register
def _(law: Hardening) -> dict[str, Any]:
    return {f"number {name}": value for name, value in law.numbers(np.ones(())).items()}


def _of(at: Mapping[str, Values]) -> dict[str, Values]:
    """Numbers of a law among those of a slip."""
    return {n.removeprefix("number "): x for n, x in at.items() if n.startswith("number ")}


@slip.register
def _(law: SofteningLaw, at: Mapping[str, Values], scheme: Scheme) -> Slip:
    a, ξ, none = at["slip"], at["slipped"], 0 * at["slip"]
    law = law.of(_of(at))
    force = at["direction"] * scheme.resistance(law, ξ, a)
    return Slip(force, a * law.mean_traction(ξ, a), none, none, law.traction(ξ + a), none)


@slip.register
def _(law: Hardening, at: Mapping[str, Values], scheme: Scheme) -> Slip:
    a, ξ, s, e, θ, dt = (at[n] for n in ("slip", "slipped", "direction", "start", "θ", "dt"))
    of_law, change = _of(at), State({"plastic": a, "accumulated": a})
    limit, H, B = (of_law[name] for name in ("limit", "modulus", "kinematic"))
    bulk = law.of(np.inf, of_law)
    resistance = limit + H * (ξ + θ * a) + of_law["viscosity"] * a / dt
    return Slip(
        s * resistance + B * (e + θ * s * a),
        bulk.dissipation(s * a, change, change, dt),
        bulk.hardening_energy(change),
        bulk.hardening_energy(State({"plastic": e + s * a, "accumulated": ξ + a})),
        limit + H * (ξ + a),
        B * (e + s * a),
    )
