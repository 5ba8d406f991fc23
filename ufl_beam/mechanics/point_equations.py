# SPDX-License-Identifier: MIT
"""Equations of a material point over a step, for UFL expressions and for arrays.

The law holds at t_n+θ.  A backward-Euler step of length θ dt gives the changes of its variables up
to t_n+θ; divided by θ, they are the changes in the whole step.  Laws with memory follow the path of
the strain up to t_n+θ and up to the end of the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.corealg.traversal import unique_pre_traversal

from ufl_beam.compiled.c_library import names
from ufl_beam.mechanics.functional import strain_by_jump
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.fibres import Kind, SectionPoints
from ufl_beam.model.law_functions import Values, absolute, below, positive, where
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.softening_laws import SofteningLaw

UNLIMITED = 1e300
"""Traction above which a point has no limit."""

At = Mapping[str, Values]
"""Inputs of points by name, see :func:`inputs`."""


def rows(law: MaterialLaw, name: str) -> tuple[str, ...]:
    """Return the names of the components of a strain or stiffness."""
    return tuple(f"{name} {x}" for x in law.resultants) if law.resultants else (name,)


def prefixed(prefix: str, names: Mapping[str, object] | tuple[str, ...]) -> tuple[str, ...]:
    """Return names with a prefix: ``state plastic`` for the variable ``plastic`` of a law."""
    return tuple(f"{prefix} {name}" for name in names)


def inputs(section_points: SectionPoints) -> tuple[str, ...]:
    """Return the names of the inputs of a point in their order in memory, see loops.h."""
    law, parameters = section_points.kind
    softening = (
        section_points.softening.parameters() if section_points.softening is not None else {}
    )
    return (
        *names("point_input"), *prefixed("state", law.variables),
        *rows(law, "strain"), *rows(law, "before"), *rows(law, "stiffness"),
        *(prefixed("new", law.variables) if law.solves else ()),
        *prefixed("number", parameters), *prefixed("softening", softening),
    )  # fmt: skip


class End(NamedTuple):
    """Energies (J/m³ or J/m), stresses and state of a point at the end of a step."""

    worked: Values  # dissipated by the bulk
    broken: Values  # dissipated by the discontinuity
    lost: Values  # numerical loss of backward Euler, divided by ``2 alpha`` of the scheme
    elastic: Values  # stored elastically
    hardening: Values  # stored by hardening
    released: Values  # numerical loss by breaking, and in nonlinear elasticity
    relaxed: Values  # work on plastic strain by the mean stress, minus work by the end stress
    traction: Values  # resistance of the discontinuity
    jump: Values
    opening: Values
    variables: tuple[Values, ...]
    stress: tuple[Values, ...]


@lru_cache(maxsize=128)
def curved(kind: Kind) -> bool:
    """Return whether stresses are nonlinear in strains, at constant variables or by memory."""
    if kind.law.records_path:
        return True

    def symbol(_: str) -> Expr:
        return ufl.variable(ufl.as_ufl(0.5))

    law = kind.law
    C, e = (tuple(map(symbol, rows(law, name))) for name in ("stiffness", "strain"))
    point_law = law.with_parameters(
        law.as_argument(C), {name: symbol(name) for name in kind.parameters}
    )
    state = State({name: symbol(name) for name in law.variables})
    try:
        stress = law.as_tuple(point_law.stress(law.as_argument(e), state))
        slopes = [expand_derivatives(ufl.diff(ufl.as_ufl(σ), x)) for σ in stress for x in e]
    except Exception:
        return False  # the compilation of the law reports the reason
    return any(node in e for slope in slopes for node in unique_pre_traversal(slope))


class PointEquations:
    """Equations of points of one kind with discontinuities of one kind."""

    def __init__(self, kind: Kind, softening: SofteningLaw | None, scheme: Scheme) -> None:
        self._kind, self._softening, self._scheme = kind, softening, scheme
        self._names, self._curved = kind.law.variables, curved(kind)
        self._over_step = scheme.average(0.0, 1.0) != 1.0

    def law(self, at: At) -> MaterialLaw:
        """Return the law with the parameters of the points."""
        law, parameters = self._kind
        C = tuple(at[name] for name in rows(law, "stiffness"))
        return law.with_parameters(
            law.as_argument(C),
            {"length": at["length"], **{name: at[f"number {name}"] for name in parameters}},
        )

    def softening(self, at: At) -> SofteningLaw | None:
        """Return the law of the discontinuity with the parameters of the points."""
        law = self._softening
        return law and law.with_parameters(
            {name: at[f"softening {name}"] for name in law.parameters()}
        )

    def resistance(self, at: At, growth: Values) -> Values:
        """Return the resistance of a discontinuity whose opening grows by ``growth``."""
        law = self.softening(at)
        return 0 * growth if law is None else self._scheme.resistance(law, at["opening"], growth)

    def state(self, at: At, prefix: str = "state") -> State:
        """Return the variables at the beginning of the step; with "new", the unknown variables."""
        return State({name: at[f"{prefix} {name}"] for name in self._names})

    def strain(self, at: At) -> Values:
        """Return the strain of the bulk at t_n+θ: the strain of the cell minus jump/length."""
        law, θ = self._kind.law, at["theta"]
        jump = at["jump"] + θ * at["direction"] * at["growth"]
        ends = zip(rows(law, "before"), rows(law, "strain"), strict=True)
        return law.as_argument(
            tuple(
                (1 - θ) * at[e0] + θ * at[e1] + strain_by_jump(jump, at["length"])
                for e0, e1 in ends
            )
        )

    def changes(self, at: At) -> State:
        """Return the changes of the variables from t_n to t_n+θ."""
        law, old = self.law(at), self.state(at)
        if law.solves:
            new = self.state(at, "new")
            return State({n: getattr(new, n) - getattr(old, n) for n in self._names})
        return State(law.increments(self.strain(at), old, at["theta"] * at["dt"]))

    def residuals(self, at: At) -> tuple[Values, ...]:
        """Return the residuals at t_n+θ of a law that solves for its variables."""
        new, dt = self.state(at, "new"), at["theta"] * at["dt"]
        residuals = self.law(at).residuals(self.strain(at), self.state(at), new, dt)
        return tuple(residuals[name] for name in self._names)

    def stored(self, at: At) -> Values:
        """Return the energy at t_n+θ stored by a law that solves for its variables."""
        law, new = self.law(at), self.state(at, "new")
        return law.elastic_energy(self.strain(at), new) + law.hardening_energy(new)

    def own_dissipation(self, at: At, slopes: tuple[Values, ...]) -> tuple[Values, Values]:
        """Return (dissipation, size of its terms) of a law that solves for its variables.

        The dissipation is -∂ψ/∂z Δz, without errors of the time scheme, unless the law states it.
        ``slopes`` are the derivatives ∂ψ/∂z of the energy :meth:`stored` by the variables z.
        """
        law, old, new = self.law(at), self.state(at), self.state(at, "new")
        changes = State({n: (getattr(new, n) - getattr(old, n)) / at["theta"] for n in self._names})
        strain, size = self.strain(at), absolute(self.stored(at))
        for name, e in zip(rows(law, "stiffness"), law.as_tuple(strain), strict=True):
            size = size + at[name] * e**2
        by_variables = 0 * size
        for slope, name in zip(slopes, self._names, strict=True):
            z0, z1 = getattr(old, name), getattr(new, name)
            by_variables = by_variables - slope * (z1 - z0)
            size = size + absolute(slope) * (absolute(z0) + absolute(z1))
        dissipated = law.dissipation(strain, new, changes, at["dt"])
        return by_variables if dissipated is None else dissipated + 0 * size, size

    def stress(self, at: At) -> tuple[Values, ...]:
        """Return the stresses of the bulk at t_n+θ, where the law holds."""
        law, old, changes = self.law(at), self.state(at), self.changes(at)
        return law.as_tuple(law.stress(self.strain(at), _plus(old, changes)))

    def elastic_stress(self, at: At) -> tuple[Values, ...]:
        """Return the stresses at t_n+θ with the variables at the beginning of the step."""
        law = self.law(at)
        return law.as_tuple(law.stress(self.strain(at), self.state(at)))

    def _elastic_growth(self, law: MaterialLaw, de: tuple[Values, ...], dz: State) -> Values:
        """Return the elastic energy of the changes, without its terms that are linear in them."""
        growth = law.elastic_energy(law.as_argument(de), dz)
        if not law.prestressed:
            return growth
        opposite_dz, none = (State({n: k * z for n, z in vars(dz).items()}) for k in (-1.0, 0.0))
        opposite = law.elastic_energy(law.as_argument(tuple(-e for e in de)), opposite_dz)
        return (growth + opposite) / 2 - law.elastic_energy(
            law.as_argument(tuple(0 * e for e in de)), none
        )

    def end(self, at: At) -> End:
        """Return energies, stresses and the state at the end of the step.

        The mean stress of each step of a broken point is zero, but stresses at the ends of steps
        might alternate about zero.  So the discontinuity takes over the elastic strain, which
        nothing holds any more, and its energy is released.
        """
        law, softening, θ, a = self.law(at), self.softening(at), at["theta"], at["growth"]
        argument, zero = law.as_argument, 0 * a
        jump, length = at["jump"], at["length"]
        e0 = tuple(at[n] + strain_by_jump(jump, length) for n in rows(law, "before"))
        jump = jump + at["direction"] * a
        e1 = tuple(at[n] + strain_by_jump(jump, length) for n in rows(law, "strain"))
        de = tuple(y - x for x, y in zip(e0, e1, strict=True))

        at_θ, old = self.changes(at), self.state(at)
        changes = State({name: getattr(at_θ, name) * (1 / θ) for name in self._names})
        if law.records_path:
            changes = State(law.increments(argument(e1), old, at["dt"]))
        new = _plus(old, changes)
        before, now = (law.as_tuple(law.stress(argument(e), z)) for e, z in ((e0, old), (e1, new)))
        elastic, hardening = law.elastic_energy(argument(e1), new), law.hardening_energy(new)
        stored = elastic - law.elastic_energy(argument(e0), old)
        stored = stored + hardening - law.hardening_energy(old)
        work = sum(σ * e for σ, e in zip(self.stress(at), de, strict=True))
        if law.records_path:
            # The stresses at both ends are exact.  By their mean, ``worked`` does not depend on the
            # scheme; ``nonlinear_loss`` is the rest of the work of the stress at t_n+θ.
            lost = relaxed = zero
            worked = law.dissipation(argument(e1), new, changes, at["dt"])
            if worked is None:
                means = ((x + y) / 2 for x, y in zip(before, now, strict=True))
                worked = sum(σ * e for σ, e in zip(means, de, strict=True)) - stored
            nonlinear_loss = work - stored - worked
        else:
            # ``lost`` is exact for quadratic energies.  For other laws that state no dissipation,
            # its error is in ``worked``.
            hardened = law.hardening_energy(changes)
            lost = self._elastic_growth(law, de, changes) + hardened
            elastically, nonlinear_loss, C = de, zero, tuple(at[n] for n in rows(law, "stiffness"))
            if self._curved:
                # ``nonlinear_loss`` is ``worked`` below at constant variables: not dissipation.
                ends = tuple(law.as_tuple(law.stress(argument(e1), old)))
                elastically = tuple((y - x) / c for x, y, c in zip(before, ends, C, strict=True))
                curve = sum(σ * e for σ, e in zip(self.elastic_stress(at), de, strict=True))
                none = State(dict.fromkeys(self._names, zero))
                linear = (2 * θ - 1) * self._elastic_growth(law, de, none)
                elastically_stored = law.elastic_energy(argument(e1), old)
                elastically_stored -= law.elastic_energy(argument(e0), old)
                nonlinear_loss = curve - elastically_stored - linear
            worked = law.dissipation(self.strain(at), _plus(old, at_θ), changes, at["dt"])
            if worked is None:
                worked = work - stored - (2 * θ - 1) * lost - nonlinear_loss
            relaxed = hardened
            for σ0, σ1, e, c in zip(before, now, elastically, C, strict=True):
                relaxed = relaxed - (σ1 - σ0) / 2 * (e - (σ1 - σ0) / c)
        broken, released, traction = zero, zero, at["traction"]
        if self._over_step:
            released = nonlinear_loss + zero
        if softening is not None:
            broken = a * softening.mean_traction(at["opening"], a) / length
            resistance = softening.traction(at["opening"] + a)
            traction = where(below(traction, UNLIMITED), resistance, traction)
            left = law.elastic_energy(e1[0] - now[0] / at["stiffness"], new)
            holds = below(-resistance, 0.0)
            jump = jump + where(holds, 0.0, now[0] / at["stiffness"] * length)
            released = released + where(holds, 0.0, elastic - left)
            elastic, now = where(holds, elastic, left), (where(holds, now[0], 0.0),)
        return End(
            worked + zero, broken, lost + zero, elastic + zero, hardening + zero, released,
            positive(relaxed) + zero, traction, jump, at["opening"] + a,
            tuple(getattr(new, name) for name in self._names), now,
        )  # fmt: skip


def _plus(state: State, changes: State) -> State:
    """Add the changes to the variables."""
    return State({name: z + getattr(changes, name) for name, z in vars(state).items()})
