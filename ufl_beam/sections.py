"""Cross-sections: what a beam is made of, in resultants.

Units are SI: N, N m², kg/m, kg m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ufl_beam.errors import SceneError, require_number


@dataclass(frozen=True, eq=False)
class Section:
    """Stiffness and inertia of a cross-section, P(7) and P(18).

    Args:
        EA: Axial stiffness; N.
        GA: Shear stiffness, shear factor included; N.
        EI: Bending stiffness; N m².
        rhoA: Mass per length; kg/m.  Zero is a beam without mass.
        rhoI: Rotary inertia per length; kg m.  Zero leaves rotary inertia out.
        depth: Depth in the plane of motion, for pictures; m.  By default that of the rectangle
            with the same EI/EA.

    Raises:
        SceneError: A stiffness is not positive, or a number is not finite.
    """

    EA: float
    GA: float
    EI: float
    rhoA: float = 0.0
    rhoI: float = 0.0
    depth: float = 0.0

    def __post_init__(self) -> None:
        for name in ("EA", "GA", "EI"):
            require_number(getattr(self, name), f"Section: {name}", positive=True)
        for name in ("rhoA", "rhoI", "depth"):
            require_number(getattr(self, name), f"Section: {name}", at_least=0.0)
        if self.depth == 0.0:
            object.__setattr__(self, "depth", math.sqrt(12 * self.EI / self.EA))

    @classmethod
    def of_shape(
        cls, *, A: float, I: float, E: float, nu: float, rho: float, shear: float, depth: float
    ) -> Section:
        """Homogeneous isotropic section of a given shape.

        Args:
            A: Area; m².
            I: Second moment of area about the axis of bending; m⁴.
            E: Young's modulus; Pa.
            nu: Poisson's ratio.
            rho: Density; kg/m³.
            shear: Shear factor, the part of A that carries shear.
            depth: Depth in the plane of motion; m.
        """
        if not -1.0 < nu <= 0.5:
            raise SceneError(f"Section: nu = {nu} must lie in (-1, 0.5]")
        require_number(E, "Section: E", positive=True)
        GA = shear * A * E / (2 * (1 + nu))
        return cls(EA=E * A, GA=GA, EI=E * I, rhoA=rho * A, rhoI=rho * I, depth=depth)

    @classmethod
    def rectangle(
        cls, b: float, h: float, *, E: float, nu: float, rho: float = 0.0, shear: float = 5 / 6
    ) -> Section:
        """Rectangle of width ``b`` and depth ``h`` (in the plane of motion); m."""
        _positive("rectangle", b=b, h=h)
        return cls.of_shape(A=b * h, I=b * h**3 / 12, E=E, nu=nu, rho=rho, shear=shear, depth=h)

    @classmethod
    def circle(
        cls, d: float, *, E: float, nu: float, rho: float = 0.0, shear: float = 9 / 10
    ) -> Section:
        """Solid circle of diameter ``d``; m."""
        _positive("circle", d=d)
        A, I = math.pi * d**2 / 4, math.pi * d**4 / 64
        return cls.of_shape(A=A, I=I, E=E, nu=nu, rho=rho, shear=shear, depth=d)

    @classmethod
    def tube(
        cls, d: float, t: float, *, E: float, nu: float, rho: float = 0.0, shear: float = 1 / 2
    ) -> Section:
        """Circular tube of outer diameter ``d`` and wall thickness ``t``; m."""
        _positive("tube", d=d, t=t)
        if 2 * t > d:
            raise SceneError(
                f"Section.tube: wall t = {t} m is thicker than the radius of d = {d} m"
            )
        inner = d - 2 * t
        A, I = math.pi * (d**2 - inner**2) / 4, math.pi * (d**4 - inner**4) / 64
        return cls.of_shape(A=A, I=I, E=E, nu=nu, rho=rho, shear=shear, depth=d)

    @classmethod
    def i_shape(
        cls, h: float, b: float, tw: float, tf: float, *, E: float, nu: float, rho: float = 0.0
    ) -> Section:
        """Doubly symmetric I of depth ``h``, width ``b``, web ``tw`` and flanges ``tf``; m.

        Bends about its strong axis; the web between the mid-planes of the flanges carries shear.
        """
        _positive("i_shape", h=h, b=b, tw=tw, tf=tf)
        if 2 * tf >= h or tw > b:
            raise SceneError(
                f"Section.i_shape: web and flanges do not fit: h = {h}, b = {b}, tw = {tw}, "
                f"tf = {tf} m"
            )
        web = h - 2 * tf
        A = 2 * b * tf + tw * web
        I = (b * h**3 - (b - tw) * web**3) / 12
        return cls.of_shape(A=A, I=I, E=E, nu=nu, rho=rho, shear=tw * (h - tf) / A, depth=h)


def _positive(shape: str, **sizes: float) -> None:
    for name, value in sizes.items():
        require_number(value, f"Section.{shape}: {name}", positive=True)
