# SPDX-License-Identifier: MIT
"""Cross-sections of beams, described by resultants or by fibres.

Units are SI: N, N m², kg/m, kg m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
import scipy  # its parts are loaded when they are used

from ufl_beam.arrays import Array
from ufl_beam.errors import ModelError, Moved
from ufl_beam.model import plausibility
from ufl_beam.model.checks import require_all, require_array, require_kind, require_number
from ufl_beam.model.fibres import Fibres, PlacedFibres, SectionPoints, by_class
from ufl_beam.model.material_law import MaterialLaw, require_law
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.model.records import Instance, NotNegative, Positive, PositiveOrNone, Record, Switch
from ufl_beam.model.shapes import Shape, rounded_rectangle
from ufl_beam.model.softening_laws import SofteningLaw, require_softening

ResultantLaw = Annotated[MaterialLaw | None, require_law]


RESULTANTS = {"axial": "EA", "shear": "GA", "bending": "EI"}
"""Laws of the resultants in the plane, with their stiffnesses, in the order of the strains."""

IN_SPACE = {
    "axial": "EA", "shear": "GA", "shear3": "GA3", "twisting": "GJ", "bending2": "EI2",
    "bending": "EI",
}  # fmt: skip
"""Laws of the resultants in space."""

LAWS = {*IN_SPACE, "hinge", "interaction"}
"""Arguments of a section that are laws."""


@dataclass(frozen=True, eq=False, repr=False)
class Section(Record):
    """Stiffness and inertia of a cross-section, P(7) and P(18).

    Args:
        EA: Axial stiffness; N.
        GA: Shear stiffness, shear factor included; N.
        EI: Bending stiffness; N m².
        rhoA: Mass per length; kg/m.  The default means a beam without mass, of which dynamics
            may warn; there is no warning of an explicit zero.
        rhoI: Rotary inertia per length; kg m.
        GA3, EI2, GJ, rhoI2: In space, stiffness against shear along axis 3, bending about axis 2,
            and torsion, and rotary inertia about axis 2; N, N m², N m², kg m.  ``GA`` is for shear
            along axis 2, ``EI`` and ``rhoI`` are about axis 3.  The resistance of open sections to
            warping is not modelled; runs in space warn of it.
        centroid_only: Accept, in space, a shape whose shear centre is not its centroid.  The offset
            is not modelled: transverse forces at the axis of the beam cause no torsion.
        depth: Depth in the plane of motion, for pictures; m.  The default is the depth of the
            rectangle with the same EI/EA.  A beam shorter than depth/√12 causes a warning.
        axial: Inelastic law of the axial force N; N.
        shear: Inelastic law of the shear force V; N.
        bending: Inelastic law of the bending moment M; N m.
        shear3, twisting, bending2: In space, inelastic laws of the shear force along axis 3, the
            torsional moment, and the bending moment about axis 2; N, N m, N m.
        hinge: Law of the hinge that opens in each cell where the moment reaches the limit of the
            law; N m, J.  For hinges at chosen places see :class:`Beam`.  In space it is about axis
            3, with a warning if a run ends with a jump above 90 degrees.
        fibres: Fibres with their positions, instead of laws of resultants and of the hinge.  They
            come from :meth:`of_fibres`, or from shapes such as :meth:`rectangle`.
        shape: Shape of a homogeneous section, with its area and moduli, such as ``shape.Wpl``.  It
            comes from constructors such as :meth:`rectangle`, or :func:`structures.steel`.
        interaction: Law of N and M together, such as :class:`AxialBending`, instead of laws of
            single resultants, the hinge and fibres.

    Raises:
        ModelError: A stiffness is not positive, a number is not finite, a law has the wrong type,
            or laws, fibres and ``interaction`` cannot be combined.

    Example:
        >>> plate = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
        >>> pipe = ub.Section.tube(d=0.2, t=0.01, E=210e9, nu=0.3, rho=7850.0)
        >>> own = ub.Section(EA=4.2e9, GA=1.3e9, EI=1.4e7, rhoA=157.0, rhoI=0.5)
        >>> print(f"{plate.EI:.3g} {pipe.EI:.3g} {own.EI:.3g}")  # N m²
        1.4e+07 5.67e+06 1.4e+07
    """

    EA: Positive
    GA: Positive
    EI: Positive
    rhoA: NotNegative = field(default=None)  # type: ignore[assignment]
    rhoI: NotNegative = 0.0
    depth: NotNegative = 0.0
    _: KW_ONLY
    axial: ResultantLaw = None
    shear: ResultantLaw = None
    bending: ResultantLaw = None
    hinge: Annotated[SofteningLaw | None, require_softening] = None
    fibres: Instance[PlacedFibres | None] = None
    interaction: Annotated[MaterialLaw | None, partial(require_law, interaction=True)] = None
    shape: Instance[Shape | None] = None
    GA3: PositiveOrNone = None
    EI2: PositiveOrNone = None
    GJ: PositiveOrNone = None
    rhoI2: NotNegative = field(default=None)  # type: ignore[assignment]
    centroid_only: Switch = False
    shear3: ResultantLaw = None
    twisting: ResultantLaw = None
    bending2: ResultantLaw = None
    massless_by_default: bool = field(init=False, repr=False)

    steel = Moved("ufl_beam.structures.steel")
    box = Moved("ufl_beam.structures.box")
    i_shape = Moved("ufl_beam.structures.i_shape")
    channel = Moved("ufl_beam.structures.channel")
    t_shape = Moved("ufl_beam.structures.t_shape")
    of_sectionproperties = Moved("ufl_beam.structures.of_sectionproperties")

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "massless_by_default", self.rhoA is None)
        if self.rhoA is None:
            object.__setattr__(self, "rhoA", 0.0)
        if self.depth == 0.0:
            object.__setattr__(self, "depth", math.sqrt(12 * self.EI / self.EA))
        laws = [n for n in (*IN_SPACE, "hinge") if getattr(self, n) is not None]
        if laws and self.fibres is not None:
            raise ModelError(
                f"Section: a law {laws[0]} beside fibres; a section with fibres has an elastic "
                "shear force and no other law; leave one out"
            )
        if self.interaction is not None and (laws or self.fibres is not None):
            law = laws[0] if laws else "fibres"
            raise ModelError(
                f"Section: {law} beside interaction, the law of N and M; leave one out"
            )
        self.section_points(self.hinge)  # raises an error if the laws cannot be combined

    def section_points(
        self, hinge: SofteningLaw | None, in_space: bool = False
    ) -> tuple[SectionPoints, ...]:
        """Return the material points of a cell with a hinge law, by class of their laws.

        The result is empty if no resultant has a law.  The hinge is about axis 3.
        """
        names = IN_SPACE if in_space else RESULTANTS
        if self.fibres is not None:
            others = (self.GA, self.GA3, self.GJ) if in_space else (self.GA,)
            return self.fibres.section_points(*others)
        if hinge is not None and not hinge.opens:
            hinge = None
        resultants = [getattr(self, name) for name in names]
        if all(law is None for law in (*resultants, self.interaction, hinge)):
            return ()
        stiffness = np.array([getattr(self, name) for name in names.values()], float)
        axes = np.eye(len(names))
        if self.interaction is not None:
            inelastic = np.array([name in self.interaction.resultants for name in "NVM"])
            chosen, laws = [inelastic], [self.interaction]
        else:
            if hinge is not None and self.bending is None:
                resultants[-1] = ElastoPlastic(yield_limit=math.inf)
            inelastic = np.array([law is not None for law in resultants])
            chosen = [row == 1.0 for row in axes[inelastic]]
            laws = [law for law in resultants if law is not None]
        points = [
            SectionPoints(axes[x], np.ones(1), stiffness[x], ((law, 1),), 0 * stiffness, at=(k,))
            for k, (x, law) in enumerate(zip(chosen, laws, strict=True))
        ]
        if hinge is not None:
            points[-1] = replace(points[-1], softening=hinge, hinges=True)
        return by_class(points, np.where(inelastic, 0.0, stiffness))

    @classmethod
    def _from_material(
        cls, A: float, I: float, E: float, nu: float, rho: float | None, shear_factor: float,
        *, fibres: PlacedFibres | None, I2: float | None = None, torsion: float | None = None,
        shear_factor3: float | None = None, **more: Any,
    ) -> Section:  # fmt: skip
        require_number(shear_factor, "Section: shear_factor", positive=True)
        if shear_factor3 is not None:
            require_number(shear_factor3, "Section: shear_factor3", positive=True)
        if rho is not None:
            require_number(rho, "Section: rho", at_least=0.0)
            more |= {"rhoA": rho * A, "rhoI": rho * I, "rhoI2": (I2 and rho * I2) or None}
        if not -1.0 < require_number(nu, "Section: nu") <= 0.5:
            raise ModelError(f"Section: nu = {nu} must lie in (-1, 0.5]")
        if rho:
            plausibility.check_material(E, rho)
        GA = shear_factor * A * E / (2 * (1 + nu))
        if I2 is not None:
            more["EI2"] = E * I2
        if shear_factor3 is not None:
            more["GA3"] = shear_factor3 * A * E / (2 * (1 + nu))
        if torsion is not None:
            polar = (I + (I2 or 0.0)) * (1 + 1e-9)
            require_number(torsion, "Section: torsion", positive=True, at_least=0.0, at_most=polar)
            more["GJ"] = torsion * E / (2 * (1 + nu))
        EA, EI = (E * A, E * I) if fibres is None else (fibres.EA, fibres.EI)
        return cls(EA=EA, GA=GA, EI=EI, fibres=fibres, **more)

    @classmethod
    def of_shape(
        cls, shape: Shape, *, E: float, nu: float, rho: float | None = None, shear_factor: float,
        axis: str = "strong", fibres: Fibres | None = None, core: Fibres | None = None,
        cover: float = 0.0, shear_factor3: float | None = None, torsion: float | None = None,
        centroid_only: bool = False, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a section of an isotropic material.

        The other constructors of shapes call this one; most have their own defaults of
        ``shear_factor``, ``shear_factor3`` and ``torsion``.  The axis of the beam runs through the
        centroid.

        Args:
            shape: Shape that bends in the plane of its y.
            E: Young's modulus; Pa.
            nu: Poisson's ratio.
            rho: Density; kg/m³.
            shear_factor: Shear area divided by the area, for GA.
            axis: "strong", or "weak" for the shape turned by 90°: its x becomes y, positive to the
                left of the direction of the beam.
            fibres: Law and number of layers across y.
            core: Law of the fibres farther than ``cover`` from the surface; for confined concrete.
            cover: Distance of the core from the surface; m.
            shear_factor3: In space, shear area along axis 3 divided by the area, for GA3.
            torsion: In space, torsion constant, for GJ; m⁴.  Of closed shapes and bars it is at
                most the polar moment ``shape.I + shape.I2``, of open shapes much smaller.
            centroid_only: See :class:`Section`.
            laws: ``axial``, ``shear``, ``bending``, ``hinge``, ``interaction`` of :class:`Section`.

        Raises:
            ModelError: An argument is wrong, or the section would bend sideways, because its axes
                are not principal axes.
        """
        require_kind(shape, Shape, "Section.of_shape: shape")
        require_number(E, "Section: E", positive=True)
        if axis not in ("strong", "weak"):
            raise ModelError(f'Section: axis = {axis!r} must be "strong" or "weak"')
        if abs(shape.obliquity) > 1e-6:
            raise ModelError(
                f"Section.of_shape: bending would move the beam out of the plane: ∫ x y dA is "
                f"{shape.obliquity:.2g} ∫ y² dA, not 0; turn the shape to its principal axes, or "
                "give Section(EA=, GA=, EI=) of a beam that is held in the plane"
            )
        # Saved models tell a shared object from equal ones, so each section has its own shape.
        for name in set(laws) - LAWS:
            raise ModelError(
                f"Section of a shape has no argument {name!r}; the arguments are E, nu, rho, "
                f"shear_factor, shear_factor3, torsion, axis, fibres, core, cover, centroid_only, "
                f"{', '.join(sorted(LAWS))}"
            )
        I2 = shape.I2 if axis == "strong" else shape.I
        shape = copy(shape) if axis == "strong" else shape.turned()
        return cls._from_material(
            shape.A, shape.I, E, nu, rho, shear_factor, depth=shape.top - shape.bottom,
            fibres=PlacedFibres.layers(fibres, E, shape, core, cover), shape=shape, I2=I2,
            shear_factor3=shear_factor3, torsion=torsion, centroid_only=centroid_only, **laws,
        )  # fmt: skip

    @classmethod
    def of_fibres(
        cls, y: Sequence[float], A: Sequence[float], *, E: float | Sequence[float], nu: float,
        fibres: Fibres | Sequence[Fibres], rho: float | Sequence[float] | None = None,
        shear_factor: float = 5 / 6, z: Sequence[float] | None = None,
        torsion: float | None = None, shear_factor3: float | None = None,
    ) -> Section:  # fmt: skip
        """Create a section of fibres with areas ``A`` (m²) at coordinates ``y`` (m).

        ``E`` (Pa), ``fibres`` and ``rho`` (kg/m³) are equal for all fibres, or sequences with a
        value for each fibre.  The laws of fibres may be of different classes.  The coordinate y
        points to the left of the direction of the beam; its origin is arbitrary.  The axis of the
        beam runs through the centroid of the stiffness EA, at y = ``section.fibres.axis``, so that
        N and M are uncoupled in elastic fibres.  The mass acts at the axis.  GA is
        ``shear_factor EA / (2 (1 + nu))``.

        In space, ``y`` and ``z`` (m) are coordinates along axes 2 and 3 of the section, which are
        principal axes, ``torsion`` is the torsion constant, and ``shear_factor3`` that for GA3, by
        default equal to ``shear_factor``, see :meth:`of_shape`.  Torsion and shear are elastic.

        Raises:
            ModelError: The sequences differ in length, an area or modulus is not positive, all
                fibres lie at one y or z, or the axes are no principal axes.

        Example:
            >>> timber, steel = (ub.Fibres(ub.ElastoPlastic(limit)) for limit in (30e6, 355e6))
            >>> plated = ub.Section.of_fibres(
            ...     [-0.105, -0.075, -0.025, 0.025, 0.075], [1e-3, 5e-3, 5e-3, 5e-3, 5e-3], nu=0.3,
            ...     E=[210e9, 11e9, 11e9, 11e9, 11e9], fibres=[steel] + 4 * [timber],
            ... )  # fmt: skip
            >>> print(f"axis at y = {plated.fibres.axis:.4f} m, EA = {plated.EA:.3g} N")
            axis at y = -0.0513 m, EA = 4.3e+08 N
        """
        what = "Section.of_fibres"
        at, areas = (require_array(x, f"{what}: {name}") for name, x in (("y", y), ("A", A)))
        if at.ndim != 1 or at.shape != areas.shape or not len(at):
            raise ModelError(
                f"{what}: y and A must be lists of equal length, not {at.shape} and {areas.shape}"
            )
        if not (areas > 0).all():
            raise ModelError(f"{what}: all areas A must be positive")
        if np.ptp(at) == 0.0:
            raise ModelError(f"{what}: all fibres at one y have no bending stiffness; spread them")
        if isinstance(fibres, list | tuple):
            each = require_all(fibres, f"{what}: fibres", Fibres)
        else:
            require_kind(fibres, Fibres, f"{what}: fibres")
            each = (fibres,) * len(at)
        laws = tuple({id(law): law for law in each}.values())
        if len(each) != len(at):
            raise ModelError(f"{what}: {len(each)} fibres for {len(at)} areas; give one for each")
        material = np.array([next(i for i, x in enumerate(laws) if x is law) for law in each])
        moduli = _each(E, len(at), f"{what}: E")
        density = _each(0.0 if rho is None else rho, len(at), f"{what}: rho")
        if not (moduli > 0).all() or not (density >= 0).all():
            raise ModelError(f"{what}: E must be positive, and rho must not be negative")
        if z is None and (torsion is not None or shear_factor3 is not None):
            raise ModelError(f"{what}: torsion and shear_factor3 are for fibres in space; give z")
        across = None if z is None else require_array(z, f"{what}: z")
        if across is not None and across.shape != at.shape:
            raise ModelError(f"{what}: {across.size} coordinates z of {len(at)} fibres")
        placed = PlacedFibres.about_centroid(laws, material, moduli, at, areas, z=across)
        mass, in_space = density * areas, dict[str, Any]()
        mean, total = placed.EA / float(areas.sum()), float(areas.sum())
        if placed.z is not None:
            (EI2, product) = (moduli * areas * placed.z) @ np.column_stack([placed.z, placed.y])
            if not EI2 > 0.0 or abs(product) > 1e-6 * EI2:
                raise ModelError(
                    f"{what}: axes 2 and 3 must be principal axes with bending stiffnesses; the "
                    f"sums of E A z² and E A y z are {EI2:.3g} and {product:.3g} N m²"
                )
            factor = shear_factor if shear_factor3 is None else shear_factor3
            in_space = {"I2": EI2 / mean, "torsion": torsion, "shear_factor3": factor}
            in_space |= {} if rho is None else {"rhoI2": mass @ placed.z**2}
        return cls._from_material(
            total, placed.EI / mean, mean, nu, None, shear_factor,
            depth=float(np.ptp(at)), fibres=placed, **in_space,
            **({} if rho is None else {"rhoA": mass.sum(), "rhoI": mass @ placed.y**2}),
        )  # fmt: skip

    def reinforced(
        self, y: Sequence[float], A: Sequence[float], *, E: float, fibres: Fibres
    ) -> Section:
        """Return the section with bars of areas ``A`` (m²) at coordinates ``y`` (m).

        The section must have fibres; bars replace equal areas of them.  The coordinate y is
        measured from mid-depth, or from the origin of a :class:`Shape` or of :meth:`of_fibres`.
        The axis moves to the centroid of the stiffness EA, at y = ``fibres.axis`` of the new
        section.  GA and mass do not change: the density of reinforced concrete includes the bars.
        EI2 becomes None, because it depends on the bars' coordinates across y.

        Args:
            y: Coordinates of the bars, or of rows of bars; m.
            A: Area of each bar or row; m².
            E: Young's modulus of the bars; Pa.
            fibres: Law of the bars; its ``number`` has no meaning.

        Raises:
            ModelError: The section has no fibres, the lengths of ``y`` and ``A`` differ, an area is
                not positive, a bar lies outside the section, or bars displace more than there is.

        Example:
            >>> cover, core, steel = (ub.Fibres(ub.ElastoPlastic(x)) for x in (30e6, 40e6, 5e8))
            >>> column = ub.Section.rectangle(
            ...     b=0.3, h=0.4, E=30e9, nu=0.2, rho=2500.0, fibres=cover, core=core, cover=0.03
            ... ).reinforced(y=[-0.15, 0.15], A=[1e-3, 1e-3], E=200e9, fibres=steel)
            >>> print(f"{column.EA:.3g} {column.EI:.3g}")  # N, N m²
            3.94e+09 5.55e+07
        """
        what = "Section.reinforced"
        if self.fibres is None:
            raise ModelError(
                f"{what}: the section has no fibres; create it with fibres=Fibres(law)"
            )
        require_kind(fibres, Fibres, f"{what}: fibres")
        require_number(E, f"{what}: E", positive=True)
        at, areas = (require_array(x, f"{what}: {name}") for name, x in (("y", y), ("A", A)))
        if at.ndim != 1 or at.shape != areas.shape or not (areas > 0).all():
            raise ModelError(f"{what}: y and A must be lists of equal length, with positive areas")
        placed = self.fibres.with_bars(fibres, E, at, areas)
        rhoA: Any = None if self.massless_by_default else self.rhoA
        return replace(self, EA=placed.EA, EI=placed.EI, EI2=None, rhoA=rhoA, fibres=placed)

    @classmethod
    def rectangle(cls, b: float, h: float, **material: Any) -> Section:
        """Create a rectangle of width ``b`` and depth ``h``, the size in the plane of motion; m.

        ``material`` are arguments of :meth:`of_shape`; the shear factors are 5/6 by default, and
        the torsion constant is Saint-Venant's series.
        """
        require_positive("Section.rectangle", b=b, h=h)
        return _bar(rounded_rectangle(b, h, 0.0), 5 / 6, _torsion_of_rectangle(b, h), material)

    @classmethod
    def circle(cls, d: float, **material: Any) -> Section:
        """Create a solid circle of diameter ``d``; m.

        ``material`` are arguments of :meth:`of_shape`; the shear factors are 9/10 by default, and
        the torsion constant is the polar moment.
        """
        require_positive("Section.circle", d=d)
        shape = rounded_rectangle(d, d, d / 2)
        return _bar(shape, 9 / 10, 2 * shape.I, material)

    @classmethod
    def tube(cls, d: float, t: float, **material: Any) -> Section:
        """Create a circular tube of outer diameter ``d`` and wall thickness ``t``; m.

        ``material`` are arguments of :meth:`of_shape`; the shear factors are 1/2 by default, by
        Cowper (1966) for thin walls and Poisson's ratio 0, and the torsion constant is the polar
        moment.
        """
        require_positive("Section.tube", d=d, t=t)
        if 2 * t > d:
            raise ModelError(
                f"Section.tube: wall t = {t} m is thicker than the radius of d = {d} m"
            )
        shape = rounded_rectangle(d, d, d / 2, t)
        return _bar(shape, 1 / 2, 2 * shape.I, material)


def _bar(shape: Shape, factor: float, torsion: float, material: dict[str, Any]) -> Section:
    """Create a section with defaults of both shear factors and of the torsion constant; m⁴."""
    defaults = {"shear_factor": factor, "shear_factor3": factor, "torsion": torsion}
    return Section.of_shape(shape, **defaults | material)


def _torsion_of_rectangle(b: float, h: float) -> float:
    """Return a b³ (1/3 - 64 b/(π⁵ a) Σ tanh(n π a/(2 b))/n⁵), n odd, with the sides a >= b; m⁴."""
    a, b = max(b, h), min(b, h)
    from_one = sum((1 - math.tanh(n * math.pi * a / (2 * b))) / n**5 for n in range(1, 12, 2))
    series = 31 / 32 * scipy.special.zeta(5.0) - from_one
    return float(a * b**3 * (1 / 3 - 64 * b / (math.pi**5 * a) * series))


def require_positive(owner: str, **sizes: float) -> None:
    """Raise :class:`ModelError` unless all sizes are positive."""
    for name, value in sizes.items():
        require_number(value, f"{owner}: {name}", positive=True)


def _each(values: float | Sequence[float], n: int, what: str) -> Array:
    """Return a value for each of n fibres, from one number or from n numbers."""
    checked = require_array(values, what)
    if checked.ndim and checked.shape != (n,):
        raise ModelError(f"{what} has shape {checked.shape}; give a number, or {n} numbers")
    return np.array(np.broadcast_to(checked, n))
