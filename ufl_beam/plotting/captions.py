# SPDX-License-Identifier: MIT
"""Short words for connectors, hinges and damping in pictures of a model."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import singledispatch

from ufl_beam.model.bodies import Body, Member
from ufl_beam.model.connector_laws import Coulomb, Damper, Law, RigidPlastic, Spring, Stop
from ufl_beam.model.damping import Damping, KelvinVoigt, Rayleigh
from ufl_beam.model.material_laws import HingeLaw
from ufl_beam.model.scene import Scene
from ufl_beam.plotting.style import with_unit


@singledispatch
def law_in_words(law: Law, turns: bool) -> str:
    """Describe the law of a connector, which turns or not, and its size."""
    return type(law).__name__.lower()


@law_in_words.register
def _(law: Spring, turns: bool) -> str:
    ends = [word for word, given in (("yields", law.law), ("breaks", law.softening)) if given]
    return ", ".join([with_unit(law.stiffness, "N m/rad" if turns else "N/m"), *ends])


@law_in_words.register
def _(law: Damper, turns: bool) -> str:
    return with_unit(law.viscosity, "N m s/rad" if turns else "N s/m")


@law_in_words.register
def _(law: Stop, turns: bool) -> str:
    if math.isinf(law.low):
        return f"stop ≤ {_motion_in_words(law.high, turns)}"
    if math.isinf(law.high):
        return f"stop ≥ {_motion_in_words(law.low, turns)}"
    return "stop " + " … ".join(_motion_in_words(end, turns) for end in (law.low, law.high))


def _motion_in_words(motion: float, turns: bool) -> str:
    return f"{motion:.3g} rad".replace("-", "−") if turns else with_unit(motion, "m")


@law_in_words.register
def _(law: Coulomb, turns: bool) -> str:
    limit = [with_unit(law.force, "N m" if turns else "N")] if law.force else []
    rate = [f"{law.coefficient:g}{' m' if turns else ''} × press"] if law.coefficient else []
    return f"friction {' + '.join([*limit, *rate])}"


@law_in_words.register
def _(law: RigidPlastic, turns: bool) -> str:
    return f"rigid up to {with_unit(float(law.law.limit), 'N m' if turns else 'N')}"


def hinge_in_words(law: HingeLaw) -> str:
    """Describe the moment at which a hinge opens."""
    return f"hinge {with_unit(float(law.limit), 'N m')}"


@singledispatch
def damping_in_words(damping: Damping) -> str:
    """Describe a kind of damping and its size."""
    return type(damping).__name__


@damping_in_words.register
def _(damping: Rayleigh) -> str:
    parts = (("mass", damping.mass, "1/s"), ("stiffness", damping.stiffness, "s"))
    return "Rayleigh damping, " + ", ".join(f"{n} {x:.3g} {u}" for n, x, u in parts if x)


@damping_in_words.register
def _(damping: KelvinVoigt) -> str:
    where = "" if damping.beams is None else " of " + ", ".join(b.name for b in damping.beams[:4])
    more = " ..." if len(damping.beams or ()) > 4 else ""
    return f"Kelvin–Voigt damping, {with_unit(damping.time, 's')}{where}{more}"


def names_of(scene: Scene) -> dict[Member | Body, str]:
    """Return names of beams and bodies; equal ones with their number in the scene."""
    groups: tuple[Sequence[Member | Body], ...] = (scene.beams, scene.bodies)
    known = [Counter(part.name for part in parts) for parts in groups]
    return {
        part: f"{part.name} {k}" if known[g][part.name] > 1 else part.name
        for g, parts in enumerate(groups)
        for k, part in enumerate(parts)
    }


def counted(number: int, one: str, many: str = "") -> str:
    """Write a number and the noun that it counts: "1 body", "20 000 beams"."""
    return f"{number:,}".replace(",", " ") + " " + (one if number == 1 else many or f"{one}s")
