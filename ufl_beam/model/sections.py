# SPDX-License-Identifier: MIT
"""Cross-sections of beams, described by resultants or by fibres.

Units are SI: N, N m², kg/m, kg m.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from copy import copy
from dataclasses import KW_ONLY, dataclass, field
from difflib import get_close_matches
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ufl_beam.errors import ModelError, shorten
from ufl_beam.model.checks import require_array, require_kind, require_number, require_text
from ufl_beam.model.fibres import Fibres, PlacedFibres, SectionPoints
from ufl_beam.model.material_law import MaterialLaw, require_law
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.model.records import Instance, NotNegative, Positive, Record
from ufl_beam.model.shapes import (
    Shape,
    Walls,
    box_walls,
    flanged,
    rounded_rectangle,
    thin_walled_shear_area,
)
from ufl_beam.model.softening_laws import SofteningLaw, require_softening

ResultantLaw = Annotated[MaterialLaw | None, require_law]


@dataclass(frozen=True, eq=False, repr=False)
class Section(Record):
    """Stiffness and inertia of a cross-section, P(7) and P(18).

    Args:
        EA: Axial stiffness; N.
        GA: Shear stiffness, shear factor included; N.
        EI: Bending stiffness; N m².
        rhoA: Mass per length; kg/m.  Zero, the default, means a beam without mass.  Dynamics may
            warn of the default, but never warns of an explicit zero.
        rhoI: Rotary inertia per length; kg m.
        depth: Depth in the plane of motion, for pictures; m.  The default is the depth of the
            rectangle with the same EI/EA.  A beam shorter than depth/√12 causes a warning.
        axial: Inelastic law of the axial force N; N.
        shear: Inelastic law of the shear force V; N.
        bending: Inelastic law of the bending moment M; N m.
        hinge: Law of the hinge that opens in each cell where the moment reaches the limit of the
            law; N m, J.  For hinges at chosen places see :class:`Beam`.
        fibres: Fibres with their positions, instead of laws of resultants and of the hinge.  They
            come from :meth:`of_fibres`, or from shapes such as :meth:`rectangle`.
        shape: Shape of a homogeneous section, with its area and moduli, such as ``shape.Wpl``.  It
            comes from constructors such as :meth:`steel`.
        interaction: Law of N and M together, such as :class:`AxialBending`, instead of laws of
            single resultants, the hinge and fibres.

    Raises:
        ModelError: A stiffness is not positive, a number is not finite, a law has the wrong type,
            or laws, fibres and ``interaction`` cannot be combined.

    Example:
        >>> plate = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
        >>> pipe = ub.Section.tube(d=0.2, t=0.01, E=210e9, nu=0.3, rho=7850.0)
        >>> own = ub.Section(EA=4.2e9, GA=1.3e9, EI=1.4e7, rhoA=157.0, rhoI=0.5)
        >>> column = ub.Section.steel("HEB 200")
        >>> print(f"{plate.EI:.3g} {pipe.EI:.3g} {own.EI:.3g} {column.EI:.3g}")  # N m²
        1.4e+07 5.67e+06 1.4e+07 1.2e+07
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
    massless_by_default: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "massless_by_default", self.rhoA is None)
        if self.rhoA is None:
            object.__setattr__(self, "rhoA", 0.0)
        if self.depth == 0.0:
            object.__setattr__(self, "depth", math.sqrt(12 * self.EI / self.EA))
        laws = [n for n in ("axial", "shear", "bending", "hinge") if getattr(self, n) is not None]
        if laws and self.fibres is not None:
            raise ModelError(
                f"Section: a law {laws[0]} beside fibres, which bear N and M, while shear is "
                "elastic; leave one out"
            )
        if self.interaction is not None and (laws or self.fibres is not None):
            law = laws[0] if laws else "fibres"
            raise ModelError(
                f"Section: {law} beside interaction, the law of N and M; leave one out"
            )
        self.section_points(self.hinge)  # raises an error if the laws cannot be combined

    def section_points(self, hinge: SofteningLaw | None) -> SectionPoints | None:
        """Return the material points of a cell with a hinge law; None if the cell is elastic."""
        if self.fibres is not None:
            return self.fibres.section_points(self.GA)
        if hinge is not None and not hinge.opens:
            hinge = None
        stiffness, bending = np.array([self.EA, self.GA, self.EI]), self.bending
        if self.interaction is not None:
            if hinge is not None:
                raise ModelError("Section: a hinge beside interaction of N and M; leave one out")
            inelastic = np.array([name in self.interaction.resultants for name in "NVM"])
            laws = [(self.interaction, 1)]
        else:
            if hinge is not None and bending is None:
                bending = ElastoPlastic(yield_limit=math.inf)
            inelastic = np.array([law is not None for law in (self.axial, self.shear, bending)])
            laws = [(law, 1) for law in (self.axial, self.shear, bending) if law is not None]
        if not laws:
            return None
        return SectionPoints(
            strains=np.eye(3)[inelastic],
            weights=np.ones(len(laws)),
            stiffness=stiffness[inelastic],
            laws=tuple(laws),
            rest=np.where(inelastic, 0.0, stiffness),
            softening=hinge,
            breaking=slice(len(laws) - 1, None),
            hinges=hinge is not None,
        )

    @classmethod
    def _of_material(
        cls, A: float, I: float, E: float, nu: float, rho: float | None, shear_factor: float,
        *, fibres: PlacedFibres | None, **more: Any,
    ) -> Section:  # fmt: skip
        require_number(shear_factor, "Section: shear_factor", positive=True)
        if rho is not None:
            require_number(rho, "Section: rho", at_least=0.0)
            more |= {"rhoA": rho * A, "rhoI": rho * I}
        if not -1.0 < require_number(nu, "Section: nu") <= 0.5:
            raise ModelError(f"Section: nu = {nu} must lie in (-1, 0.5]")
        GA = shear_factor * A * E / (2 * (1 + nu))
        EA, EI = (E * A, E * I) if fibres is None else (fibres.EA, fibres.EI)
        return cls(EA=EA, GA=GA, EI=EI, fibres=fibres, **more)

    @classmethod
    def of_shape(
        cls, shape: Shape, *, E: float, nu: float, rho: float | None = None, shear_factor: float,
        axis: str = "strong", fibres: Fibres | None = None, **laws: Any,
    ) -> Section:  # fmt: skip
        """Create a section of an isotropic material.

        The other constructors of shapes pass these arguments on, with ``shear_factor`` by default.
        The axis of the beam runs through the centroid.

        Args:
            shape: Shape that bends in the plane of its y.
            E: Young's modulus; Pa.
            nu: Poisson's ratio.
            rho: Density; kg/m³.
            shear_factor: Shear area divided by the area, for GA.
            axis: "strong", or "weak" for the shape turned by 90°: its x becomes y, positive to the
                left of the direction of the beam.
            fibres: Law and number of layers across y, measured from the centroid.
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
        # Files compare objects that are one with such that are equal: each section has its own.
        shape = copy(shape) if axis == "strong" else shape.turned()
        return cls._of_material(
            shape.A, shape.I, E, nu, rho, shear_factor, depth=shape.top - shape.bottom,
            fibres=PlacedFibres.layers(fibres, E, shape), shape=shape, **laws,
        )  # fmt: skip

    @classmethod
    def of_fibres(
        cls, y: Sequence[float], A: Sequence[float], *, E: float, nu: float, fibres: Fibres,
        rho: float | None = None, shear_factor: float = 5 / 6,
    ) -> Section:  # fmt: skip
        """Create a section of fibres with areas ``A`` (m²) at coordinates ``y`` (m).

        The coordinate y points to the left of the direction of the beam; its origin is arbitrary.
        The axis of the beam runs through the centroid of the fibres.

        Raises:
            ModelError: The lengths of ``y`` and ``A`` differ, an area is not positive, or all
                fibres lie at one y.
        """
        require_kind(fibres, Fibres, "Section.of_fibres: fibres")
        require_number(E, "Section: E", positive=True)
        at, areas = (
            require_array(x, f"Section.of_fibres: {name}") for name, x in (("y", y), ("A", A))
        )
        if at.ndim != 1 or at.shape != areas.shape or not len(at):
            raise ModelError(
                f"Section.of_fibres: y and A must be lists of equal length, not {at.shape} and "
                f"{areas.shape}"
            )
        if not (areas > 0).all():
            raise ModelError("Section.of_fibres: all areas A must be positive")
        total, depth = float(areas.sum()), float(np.ptp(at))
        if depth == 0.0:
            raise ModelError(
                "Section.of_fibres: all fibres at one y have no bending stiffness; spread them"
            )
        placed = PlacedFibres(fibres, E, at - (areas @ at) / total, areas)
        return cls._of_material(
            total, placed.EI / E, E, nu, rho, shear_factor, depth=depth, fibres=placed
        )

    @classmethod
    def rectangle(cls, b: float, h: float, **material: Any) -> Section:
        """Create a rectangle of width ``b`` and depth ``h``, the size in the plane of motion; m.

        ``material`` are arguments of :meth:`of_shape`; the shear factor is 5/6 by default.
        """
        _require_positive("Section.rectangle", b=b, h=h)
        return cls.of_shape(rounded_rectangle(b, h, 0.0), **{"shear_factor": 5 / 6} | material)

    @classmethod
    def circle(cls, d: float, **material: Any) -> Section:
        """Create a solid circle of diameter ``d``; m.

        ``material`` are arguments of :meth:`of_shape`; the shear factor is 9/10 by default.
        """
        _require_positive("Section.circle", d=d)
        return cls.of_shape(rounded_rectangle(d, d, d / 2), **{"shear_factor": 9 / 10} | material)

    @classmethod
    def tube(cls, d: float, t: float, **material: Any) -> Section:
        """Create a circular tube of outer diameter ``d`` and wall thickness ``t``; m.

        ``material`` are arguments of :meth:`of_shape`; the shear factor is 1/2 by default, by
        Cowper (1966) for thin walls and Poisson's ratio 0.
        """
        _require_positive("Section.tube", d=d, t=t)
        if 2 * t > d:
            raise ModelError(
                f"Section.tube: wall t = {t} m is thicker than the radius of d = {d} m"
            )
        return cls.of_shape(rounded_rectangle(d, d, d / 2, t), **{"shear_factor": 1 / 2} | material)

    @classmethod
    def box(cls, b: float, h: float, t: float, r: float = 0.0, **material: Any) -> Section:
        """Create a rectangular hollow section: width b, depth h, wall t, outer corner radius r; m.

        The inner radius is r - t, or 0.  ``material`` are arguments of :meth:`of_shape`; the shear
        factor is by default that of Cowper (1966) for thin walls and Poisson's ratio 0.
        """
        _require_positive("Section.box", b=b, h=h, t=t)
        require_number(r, "Section.box: r", at_least=0.0)
        if material.get("axis") == "weak":
            b, h, material = h, b, material | {"axis": "strong"}
        if 2 * t >= min(b, h):
            raise ModelError(f"Section.box: two walls do not fit: b = {b}, h = {h}, t = {t} m")
        return cls._thin_walled(rounded_rectangle(b, h, r, t), box_walls(b, h, t), material)

    @classmethod
    def i_shape(
        cls, h: float, b: float, tw: float, tf: float, r: float = 0.0, **material: Any
    ) -> Section:
        """Create a symmetric I: depth h, width b, thickness tw of the web and tf of the flanges; m.

        ``r`` is the radius of the fillets between web and flanges; m.  ``material`` are arguments
        of :meth:`of_shape`.  By default the shear area is ``tw (h - tf)``, the web, or
        ``5/3 b tf``, the flanges, about the weak axis.
        """
        shape, _ = cls._flanged("I", h, b, tw, tf, r)
        area = 5 / 3 * b * tf if material.get("axis") == "weak" else tw * (h - tf)
        return cls.of_shape(shape, **{"shear_factor": area / shape.A} | material)

    @classmethod
    def channel(
        cls, h: float, b: float, tw: float, tf: float, r: float = 0.0, **material: Any
    ) -> Section:
        """Create a channel with parallel flanges, with the dimensions of :meth:`i_shape`.

        About the weak axis, the web is to the right of the direction of the beam.  ``material`` are
        arguments of :meth:`of_shape`; the shear factor is by default that of Cowper (1966) for thin
        walls and Poisson's ratio 0.
        """
        return cls._thin_walled(*cls._flanged("C", h, b, tw, tf, r), material)

    @classmethod
    def t_shape(
        cls, h: float, b: float, tw: float, tf: float, r: float = 0.0, **material: Any
    ) -> Section:
        """Create a T: depth h with the flange of width b and thickness tf, thickness tw of the web.

        The flange is to the left of the direction of the beam; ``r`` is the radius of the fillets;
        m.  ``material`` are arguments of :meth:`of_shape`; the shear factor is by default that of
        Cowper (1966) for thin walls and Poisson's ratio 0.
        """
        return cls._thin_walled(*cls._flanged("T", h, b, tw, tf, r), material)

    @classmethod
    def _flanged(
        cls, kind: str, h: float, b: float, tw: float, tf: float, r: float
    ) -> tuple[Shape, Walls]:
        name = {"I": "i_shape", "C": "channel", "T": "t_shape"}[kind]
        _require_positive(f"Section.{name}", h=h, b=b, tw=tw, tf=tf)
        require_number(r, f"Section.{name}: r", at_least=0.0)
        if (2 * tf if kind != "T" else tf) >= h or tw > b:
            raise ModelError(
                f"Section.{name}: web and flanges do not fit: h = {h}, b = {b}, tw = {tw}, "
                f"tf = {tf} m"
            )
        return flanged(kind, h, b, tw, tf, r)

    @classmethod
    def _thin_walled(cls, shape: Shape, walls: Walls, material: dict[str, Any]) -> Section:
        if material.get("axis") == "weak":
            walls = [(1j * start, 1j * end, t) for start, end, t in walls]
        factor = thin_walled_shear_area(walls) / shape.A
        return cls.of_shape(shape, **{"shear_factor": factor} | material)

    @classmethod
    def steel(cls, designation: str, **material: Any) -> Section:
        """Create a rolled or hollow steel section of a standard series from its designation.

        The series are IPE, HEA, HEB, HEM, UPE and the American W and HSS; upper or lower case and
        spaces do not matter, and "HE 200 B" is "HEB 200".  The constructor is :meth:`i_shape`,
        :meth:`channel`, :meth:`box` or :meth:`tube`, with root and corner radii.

        Args:
            designation: Designation, such as "IPE 300", "W14X90" or "HSS8X4X1/4".
            material: Arguments of :meth:`of_shape`.  By default E = 210e9 Pa and nu = 0.3 (EN
                1993-1-1, 3.2.6), and rho = 7850 kg/m³.

        Raises:
            ModelError: The designation is unknown; the message lists similar ones.

        Example:
            >>> ipe = ub.Section.steel("IPE 300").shape
            >>> print(f"{1e4 * ipe.A:.2f} cm², {1e8 * ipe.I:.0f} cm⁴, {1e6 * ipe.Wpl:.1f} cm³")
            53.81 cm², 8356 cm⁴, 628.4 cm³
            >>> girder = ub.Section.steel("W14X90", axis="weak", E=200e9)
        """
        require_text(designation, "Section.steel: designation")
        name = "".join(designation.upper().replace("×", "X").split())
        name = re.sub(r"^HE(\d+)([ABM])$", r"HE\2\1", name)
        table = _steel_table()
        if name not in table:
            similar = ", ".join(get_close_matches(name, table, n=5, cutoff=0.0))
            raise ModelError(
                f"Section.steel: {designation!r} is not in the table of IPE, HEA, HEB, HEM, UPE, W "
                f"and HSS; similar designations are {similar}"
            )
        kind, sizes = table[name]
        material = {"E": 210e9, "nu": 0.3, "rho": 7850.0} | material
        if kind == "box":
            return cls.box(*sizes, **material)
        if kind == "tube":
            return cls.tube(*sizes, **material)
        return (cls.i_shape if kind == "I" else cls.channel)(*sizes, **material)

    @classmethod
    def of_sectionproperties(cls, analysed: Any, *, axis: str = "x", **laws: Any) -> Section:
        """Create a section from a cross-section of any shape, analysed by sectionproperties.

        Its results give EA, EI, GA and the mass.  GA is E A_s / (2 (1 + ν)), with the mean ν of
        several materials; the rotary inertia is the mass times EI/EA.

        Args:
            analysed: ``Section`` of the package sectionproperties with materials, after
                ``calculate_geometric_properties`` and ``calculate_warping_properties``.  Its
                coordinates are in m, moduli in Pa, densities in kg/m³.
            axis: Axis of bending: "x" for a plane of motion along its y, "y" for one along its x.
            laws: ``axial``, ``shear``, ``bending``, ``hinge``, ``interaction`` of :class:`Section`.

        Raises:
            ModelError: The cross-section is not analysed or has no materials, or its x and y are
                not principal axes.
        """
        what = "Section.of_sectionproperties"
        if not type(analysed).__module__.startswith("sectionproperties."):
            raise ModelError(
                f"{what}: {shorten(analysed)} must be a Section of the package sectionproperties "
                "(pip install sectionproperties)"
            )
        if axis not in ("x", "y"):
            raise ModelError(f'{what}: axis = {axis!r} must be "x" or "y"')
        try:
            EA, EI, mass = analysed.get_ea(), analysed.get_eic(), analysed.get_mass()
            EA_s, nu = analysed.get_eas(), analysed.get_nu_eff()
        except (AttributeError, RuntimeError) as error:
            raise ModelError(
                f"{what}: give the geometry materials, and calculate geometric and warping "
                f"properties: {error}"
            ) from None
        if abs(EI[2]) > 1e-6 * max(EI[:2]):
            raise ModelError(f"{what}: x and y are not principal axes; rotate the geometry to them")
        x0, x1, y0, y1 = analysed.geometry.calculate_extents()
        own, depth, shear = (EI[0], y1 - y0, EA_s[1]) if axis == "x" else (EI[1], x1 - x0, EA_s[0])
        return cls(
            EA=EA, GA=shear / (2 * (1 + nu)), EI=own, rhoA=mass, rhoI=mass * own / EA,
            depth=depth, **laws,
        )  # fmt: skip


@cache
def _steel_table() -> dict[str, tuple[str, tuple[float, ...]]]:
    """Return the kind and the dimensions (m) of each designation."""
    rows = [
        line.split(",")
        for line in Path(__file__).with_name("steel_shapes.csv").read_text("utf-8").splitlines()
        if not line.startswith("#")
    ]
    return {name: (kind, tuple(float(mm) / 1000 for mm in sizes)) for name, kind, *sizes in rows}


def _require_positive(owner: str, **sizes: float) -> None:
    for name, value in sizes.items():
        require_number(value, f"{owner}: {name}", positive=True)
