# SPDX-License-Identifier: MIT
"""Laws of concrete fibres: Kent and Park, Mander; softening in tension by the fracture energy."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Annotated, Any, ClassVar

from ufl_beam.errors import ModelError
from ufl_beam.model.checks import require_number
from ufl_beam.model.law_functions import Values, below, exp, larger, log, positive, smaller, where
from ufl_beam.model.material_law import MaterialLaw, State
from ufl_beam.model.records import NotNegative, Positive, Record
from ufl_beam.model.softening_laws import LinearSoftening, SofteningLaw, require_softening
from ufl_beam.quadrature import gauss_rule

TINY = 1e-30  # strain that replaces zero in divisors and logarithms
BEYOND = 1e30  # finite number instead of an infinite strain

NO_TENSION = LinearSoftening(0.0, 1.0)


class _Concrete(Record, MaterialLaw):
    """Base of laws of concrete, which state the backbone in compression.

    Beyond its backbone the material is elastic: with the largest compressive strain m so far and
    the stress there, unloading and reloading follow the straight line to the residual strain of
    Karsan and Jirsa, J. Struct. Div. ASCE 95 (1969), with the stiffness C at most.  With η = m over
    the strain at the strength, the residual strain is 0.145 η² + 0.13 η for η < 2, then
    0.707 (η - 2) + 0.84, as in ``Concrete01`` of OpenSees.  Concrete01 has 0.834, by which the
    residual strain jumps.  Tensile strains count from the residual strain.  Up to the limit of
    ``tension`` they are elastic; then the traction of this law acts at an opening in proportion to
    the further strain, so that a cell dissipates the fracture energy.  Unloading of cracks is
    secant: they close at the residual strain.
    """

    tension: SofteningLaw
    records_path: ClassVar[bool] = True
    prestressed: ClassVar[bool] = False
    variables: ClassVar[Mapping[str, float]] = {"crushed": 0.0, "cracked": 0.0}

    @property
    @abstractmethod
    def peak(self) -> Values:
        """Compressive strain at the strength."""

    @property
    def last(self) -> Values:
        """Compressive strain beyond which the residual strain does not grow."""
        return BEYOND

    @abstractmethod
    def backbone(self, strain: Values) -> Values:
        """Return the compressive stress at a compressive strain that was never exceeded."""

    @abstractmethod
    def area(self, low: Values, high: Values) -> Values:
        """Return the integral of the backbone between two strains."""

    def _unloading(self, crushed: Values) -> tuple[Values, Values]:
        """Return residual strain (compressive) and stiffness after a largest compressive strain."""
        stress, η = self.backbone(crushed), smaller(crushed, self.last) / self.peak
        ratio = where(below(η, 2.0), (0.145 * η + 0.13) * η, 0.707 * (η - 2) + 0.84)
        elastic = larger(crushed - ratio * self.peak, stress / self.C)
        virgin = below(elastic, TINY)
        return crushed - elastic, where(virgin, self.C, stress / where(virgin, 1.0, elastic))

    def _crack_opening(self, cracked: Values) -> tuple[Values, Values]:
        """Return the opening of a crack at a largest tensile strain, and its derivative; m.

        The factor deducts the elastic energy at the limit from the fracture energy.
        """
        t, G = self.tension.limit, self.tension.fracture_energy
        limit = t / self.C
        factor = self.length * G / (G - limit * t / 2 * self.length)
        return factor * where(below(limit, cracked), cracked - limit, 0.0), factor

    def _secant(self, cracked: Values) -> Values:
        """Return the stiffness in tension after a largest tensile strain."""
        width, _ = self._crack_opening(cracked)
        cracks = below(self.tension.limit / self.C, cracked)
        return where(cracks, self.tension.traction(width) / where(cracks, cracked, 1.0), self.C)

    def stress(self, strain: Values, state: State) -> Values:
        """Return the stress, negative in compression."""
        residual, stiffness = self._unloading(state.crushed)
        e = strain + residual
        return e * where(below(-e, 0.0), self._secant(state.cracked), stiffness)

    def elastic_energy(self, strain: Values, state: State) -> Values:
        """Return the energy density that unloading returns."""
        return self.stress(strain, state) * (strain + self._unloading(state.crushed)[0]) / 2

    def increments(self, strain: Values, state: State, dt: Values) -> dict[str, Values]:
        """Return the growth of the largest strains in compression and tension."""
        crushes = positive(-strain - state.crushed)
        residual, _ = self._unloading(state.crushed + crushes)
        return {"crushed": crushes, "cracked": positive(strain + residual - state.cracked)}

    def dissipation(self, strain: Values, state: State, changes: State, dt: Values) -> Values:
        """Return the area below both backbones in the step, minus the growth of elastic energy."""
        high, wide = state.crushed, state.cracked
        low, narrow = high - changes.crushed, wide - changes.cracked

        def stored(crushed: Values, cracked: Values) -> Values:
            elastic = crushed - self._unloading(crushed)[0]
            return (self.backbone(crushed) * elastic + self._secant(cracked) * cracked**2) / 2

        limit = self.tension.limit / self.C
        (before, factor), (after, _) = self._crack_opening(narrow), self._crack_opening(wide)
        broken = self.tension.mean_traction(before, after - before) * (after - before) / factor
        elastic = self.C * (smaller(wide, limit) ** 2 - smaller(narrow, limit) ** 2) / 2
        work = self.area(low, high) + elastic + broken
        return work - stored(high, wide) + stored(low, narrow)

    def fault(self, C: Values, length: float) -> str:
        """Return the error of parameters with which the stress would turn back over the strain."""
        t, G = self.tension.limit, self.tension.fracture_energy
        longest = 2 * G * C / t**2 if t else math.inf
        if length < longest:
            return ""
        return (
            f"tension: a cell of {length:.3g} m stores more energy at the tensile limit "
            f"{t:.3g} than the fracture energy {G:.3g}, so that the stress would turn back; use "
            f"cells shorter than {longest:.3g} m, or a fracture energy above "
            f"{t**2 * length / (2 * C):.3g}"
        )

    def parameters(self, C: Values) -> dict[str, Any]:
        """Return the fields, and the parameters of the law in tension."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        del own["tension"]
        return own | {f"tension {name}": x for name, x in self.tension.parameters().items()}

    def with_parameters(self, C: Values, parameters: Mapping[str, Values]) -> MaterialLaw:
        """Return the law with stiffness ``C`` and other parameters: numbers, arrays or symbols."""
        own, tension = dict(parameters), {}
        for name in parameters:
            if name.startswith("tension "):
                tension[name.removeprefix("tension ")] = own.pop(name)
        own["tension"] = self.tension.with_parameters(tension)
        return super().with_parameters(C, own)


@dataclass(frozen=True)
class KentPark(_Concrete):
    """Concrete of Kent and Park, modified for confinement: a parabola, a line, a constant stress.

    The parabola begins with the stiffness C, so the strain at the strength is 2 strength/C.  After
    Scott, Park and Priestley, ACI Journal 79 (1982).  Unloading is after Karsan and Jirsa, J.
    Struct. Div. ASCE 95 (1969), by a straight line to the residual strain, as in ``Concrete01`` of
    OpenSees, with one difference: beyond η = 2, twice the strain ε at the strength, the residual
    strain is (0.707 (η - 2) + 0.84) ε, where Concrete01 has 0.834, by which it jumps at η = 2.
    Tension softens by the fracture energy over the length of the cell.

    Args:
        strength: Largest compressive stress, positive; Pa.
        residual: Compressive stress beyond the strain ``ultimate``; Pa.
        ultimate: Compressive strain at the end of the line; 1.
        tension: :class:`Softening`, :class:`LinearSoftening` or a :class:`SofteningLaw` of your
            own; limit in Pa, energy in J/m².  By default there is no tension.

    Raises:
        ModelError: A number is not positive, or the residual stress exceeds the strength; when a
            section is created: ``ultimate`` is less than the strain at the strength; when a run
            begins: a cell is so long that its stress in tension would turn back.

    Example:
        >>> law = st.KentPark(  # Pa, Pa, 1, then Pa and J/m²
        ...     30e6, residual=6e6, ultimate=0.006, tension=ub.Softening(2.5e6, 80.0)
        ... )
        >>> column = ub.Section.rectangle(b=0.3, h=0.3, E=30e9, nu=0.2, fibres=ub.Fibres(law))
    """

    strength: Positive
    residual: NotNegative
    ultimate: Positive
    tension: Annotated[SofteningLaw, require_softening] = NO_TENSION

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.residual > self.strength:
            raise ModelError(
                f"KentPark: residual = {self.residual:g} must not exceed the strength "
                f"{self.strength:g}"
            )

    @classmethod
    def confined(
        cls,
        strength: float,
        *,
        ratio: float = 0.0,
        yield_limit: float = 0.0,
        width: float = 0.0,
        spacing: float = 1.0,
        tension: SofteningLaw = NO_TENSION,
    ) -> KentPark:
        """Return the law of concrete confined by hoops, by Scott, Park and Priestley (1982).

        Use E = 1000 ``strength`` in the section: the strain at the strength of unconfined concrete
        is then 0.002.

        Args:
            strength: Strength of unconfined cylinders, above 6.9 MPa; Pa.
            ratio: Volume of the hoops over the volume of the core within them; 0, the default, is
                unconfined concrete.
            yield_limit: Yield stress of the hoops; Pa.
            width: Width of the core to the outside of the hoops; m.
            spacing: Distance between hoops along the member; m.
            tension: Law in tension.

        Raises:
            ModelError: A number is out of range.

        Example:
            >>> law = st.KentPark.confined(
            ...     30e6, ratio=0.01, yield_limit=400e6, width=0.25, spacing=0.1
            ... )
            >>> print(f"{law.strength / 1e6:.1f} MPa, {law.ultimate:.4f}")
            34.0 MPa, 0.0232
        """
        what = "KentPark.confined"
        require_number(strength, f"{what}: strength", at_least=7e6)
        require_number(spacing, f"{what}: spacing", positive=True)
        for name, value in (("ratio", ratio), ("yield_limit", yield_limit), ("width", width)):
            require_number(value, f"{what}: {name}", at_least=0.0)
        MPa, K = strength / 1e6, 1 + ratio * yield_limit / strength
        half = (3 + 0.29 * MPa) / (145 * MPa - 1000) + 0.75 * ratio * math.sqrt(width / spacing)
        return cls(K * strength, 0.2 * K * strength, 0.002 * K + 1.6 * (half - 0.002 * K), tension)

    @property
    def peak(self) -> Values:
        """Compressive strain at the strength, 2 strength/C."""
        return 2 * self.strength / self.C

    @property
    def last(self) -> Values:
        """Strain ``ultimate``, beyond which the residual strain does not grow."""
        return self.ultimate

    def backbone(self, strain: Values) -> Values:
        """Return the compressive stress at a compressive strain that was never exceeded."""
        f, r, x = self.strength, self.residual, strain / self.peak
        slope = (f - r) / (self.ultimate - self.peak)
        return where(below(x, 1.0), f * x * (2 - x), r + slope * positive(self.ultimate - strain))

    def area(self, low: Values, high: Values) -> Values:
        """Return the integral of the backbone between two strains, in closed form."""
        f, r, peak, end = self.strength, self.residual, self.peak, self.ultimate

        def up_to(strain: Values) -> Values:
            x, rest = smaller(strain, peak) / peak, positive(end - larger(strain, peak))
            line = (f - r) / (2 * (end - peak)) * ((end - peak) ** 2 - rest**2)
            return f * peak * x**2 * (1 - x / 3) + line + r * positive(strain - peak)

        return up_to(high) - up_to(low)

    def fault(self, C: Values, length: float) -> str:
        """Return the error of parameters with which the stress would turn back over the strain."""
        peak = 2 * self.strength / C
        if self.ultimate > peak:
            return super().fault(C, length)
        return (
            f"ultimate = {self.ultimate:g} must exceed the strain at the strength, "
            f"2 strength/E = {peak:g}; the stress would turn back over the strain"
        )


@dataclass(frozen=True)
class Mander(_Concrete):
    """Concrete of Mander, Priestley and Park: the curve of Popovics up to crushing or spalling.

    With x the compressive strain over ``strain``, the stress is strength x r/(r - 1 + x^r), where
    r = C/(C - strength/strain).  Unconfined concrete spalls: beyond 2 ``strain`` a straight line
    leads to zero at the strain ``spalling``.  After Mander, Priestley and Park, J. Struct. Eng.
    ASCE 114 (1988).  Unloading is after Karsan and Jirsa, ibid. 95 (1969), by a straight line to
    the residual strain, as in ``Concrete04`` of OpenSees, instead of their curves; tension softens
    by the fracture energy over the length of the cell.

    Args:
        strength: Largest compressive stress, positive; Pa.
        strain: Compressive strain at the strength; 1.
        spalling: Compressive strain at which the stress is zero; infinite, the default, for
            confined concrete, which follows the curve.
        tension: As of :class:`KentPark`.

    Raises:
        ModelError: A number is not positive, or ``spalling`` is at most 2 ``strain``; when a
            section is created: E is less than 1.02 strength/strain; when a run begins: a cell is
            so long that its stress in tension would turn back.

    Example:
        >>> core = st.Mander.confined(30e6, pressure=2e6)  # Pa
        >>> print(f"{core.strength / 1e6:.1f} MPa at {core.strain:.4f}")
        42.0 MPa at 0.0060
        >>> column = ub.Section.rectangle(b=0.3, h=0.3, E=27e9, nu=0.2, fibres=ub.Fibres(core))
    """

    strength: Positive
    strain: Positive
    spalling: Annotated[float, partial(require_number, positive=True, infinite=True)] = math.inf
    tension: Annotated[SofteningLaw, require_softening] = NO_TENSION

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.spalling <= 2 * self.strain:
            raise ModelError(
                f"Mander: spalling = {self.spalling:g} must exceed 2 strain = {2 * self.strain:g}"
            )

    @classmethod
    def confined(
        cls,
        strength: float,
        pressure: float,
        *,
        strain: float = 0.002,
        tension: SofteningLaw = NO_TENSION,
    ) -> Mander:
        """Return the law of confined concrete, equations (3), (5) and (29) of the paper.

        Args:
            strength: Strength of unconfined concrete; Pa.
            pressure: Effective lateral pressure at which the hoops yield; Pa.
            strain: Strain at the strength of unconfined concrete; 1.
            tension: Law in tension.

        Raises:
            ModelError: A number is out of range.

        Example:
            >>> print(f"{st.Mander.confined(30e6, 0.0).strength:.3g}")
            3e+07
        """
        require_number(strength, "Mander.confined: strength", positive=True)
        require_number(strain, "Mander.confined: strain", positive=True)
        p = require_number(pressure, "Mander.confined: pressure", at_least=0.0) / strength
        K = -1.254 + 2.254 * math.sqrt(1 + 7.94 * p) - 2 * p
        return cls(K * strength, strain * (1 + 5 * (K - 1)), tension=tension)

    @property
    def peak(self) -> Values:
        """Compressive strain at the strength."""
        return self.strain

    @property
    def _begins(self) -> Values:
        """Compressive strain at which spalling begins."""
        return where(below(self.spalling, BEYOND / 2), 2 * self.strain, self.spalling / 2)

    def _curve(self, x: Values) -> Values:
        """Return the stress on the curve of Popovics at a compressive strain over ``strain``."""
        r = self.C / (self.C - self.strength / self.strain)
        return self.strength * x * r / (r - 1 + exp(r * log(x + TINY)))

    def backbone(self, strain: Values) -> Values:
        """Return the compressive stress at a compressive strain that was never exceeded."""
        begins, end = self._begins, self.spalling
        curved = below(strain, begins)
        left = where(curved, 1.0, positive(end - strain) / (end - begins))
        return left * self._curve(where(curved, strain, begins) / self.strain)

    def area(self, low: Values, high: Values) -> Values:
        """Return the integral of the backbone, by quadrature up to the beginning of spalling."""
        begins, end = self._begins, self.spalling
        before, after = (positive(end - larger(x, begins)) for x in (low, high))
        # Without spalling both are equal: the difference of their squares would leave round-off.
        line = self._curve(2.0) * (before - after) * ((before + after) / (2 * (end - begins)))
        x0, x1 = (smaller(x, begins) / self.strain for x in (low, high))
        rule = [(float(x), float(w)) for x, w in zip(*gauss_rule(4), strict=True)]
        mean = sum(w * self._curve(x0 + x * (x1 - x0)) for x, w in rule)
        return line + (x1 - x0) * self.strain * mean

    def parameters(self, C: Values) -> dict[str, Any]:
        """Return the parameters; an infinite strain of spalling as a large number."""
        return super().parameters(C) | {"spalling": min(self.spalling, BEYOND)}

    def fault(self, C: Values, length: float) -> str:
        """Return the error of parameters with which the stress would turn back over the strain."""
        least = 1.02 * self.strength / self.strain
        if least <= C:
            return super().fault(C, length)
        return (
            f"E = {C:.4g} must be at least 1.02 strength/strain = {least:.4g}, the stiffness of "
            "the line from zero to the strength; otherwise the curve of Popovics turns back"
        )
