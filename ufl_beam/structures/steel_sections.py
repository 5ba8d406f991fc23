# SPDX-License-Identifier: MIT
"""Sections of rolled, welded and hollow steel profiles, from dimensions or designations."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache, lru_cache
from heapq import nsmallest
from pathlib import Path
from typing import Any

from ufl_beam.errors import ModelError
from ufl_beam.model.checks import require_number, require_text
from ufl_beam.model.sections import Section, require_positive
from ufl_beam.model.shapes import Shape, rounded_rectangle
from ufl_beam.quadrature import gauss_rule

Walls = list[tuple[complex, complex, float]]
"""Middle lines of thin walls: start x + iy, end and thickness; m.  A wall begins where others end.

The shear flow is zero where nothing ends, and at the ends of the last walls by symmetry.
"""


def steel(designation: str, **material: Any) -> Section:
    """Create a rolled or hollow steel section of a standard series from its designation.

    The series are IPE, HEA, HEB, HEM, UPE and the American W and HSS; upper or lower case,
    spaces and hyphens do not matter, and "HE 200 B" is "HEB 200".  The constructor is
    :func:`i_shape`, :func:`channel`, :func:`box` or :meth:`Section.tube`, with root and corner
    radii.

    Args:
        designation: Designation, such as "IPE 300", "W14X90" or "HSS8X4X1/4".
        material: Arguments of ``Section.of_shape``.  By default E = 210e9 Pa and nu = 0.3 (EN
            1993-1-1, 3.2.6), and rho = 7850 kg/m³.

    Raises:
        ModelError: The designation is unknown; the message lists similar ones.

    Example:
        >>> ipe = st.steel("IPE 300").shape
        >>> print(f"{1e4 * ipe.A:.2f} cm², {1e8 * ipe.I:.0f} cm⁴, {1e6 * ipe.Wpl:.1f} cm³")
        53.81 cm², 8356 cm⁴, 628.4 cm³
        >>> girder = st.steel("W14X90", axis="weak", E=200e9)
    """
    require_text(designation, "steel: designation")
    name = "".join(designation.upper().replace("×", "X").replace("-", " ").split())
    name = re.sub(r"^HE(\d+)([ABM])$", r"HE\2\1", name)
    table = _steel_table()
    if name not in table:
        similar = ", ".join(_similar(name, table))
        raise ModelError(
            f"steel: designation {designation!r} is not in the table of IPE, HEA, HEB, "
            f"HEM, UPE, W and HSS; similar designations are {similar}"
        )
    kind, sizes = table[name]
    material = {"E": 210e9, "nu": 0.3, "rho": 7850.0} | material
    kinds: dict[str, Callable[..., Section]]
    kinds = {"I": i_shape, "C": channel, "box": box, "tube": Section.tube}
    return kinds[kind](*sizes, **material)


def i_shape(h: float, b: float, tw: float, tf: float, r: float = 0.0, **material: Any) -> Section:
    """Create a symmetric I: depth h, width b, thickness tw of the web and tf of the flanges; m.

    ``r`` is the radius of the fillets between web and flanges; m.  ``material`` are arguments
    of ``Section.of_shape``.  By default the shear area is ``tw (h - tf)``, the web, or
    ``5/3 b tf``, the flanges, about the weak axis.  The torsion constant follows El Darwish
    and Johnston (Proc. ASCE 91, ST1, 1965), as in European tables.  Its error is below 4 % for
    r <= 1.5 tf and for all sections of :func:`steel`.  Give ``torsion=`` if r > 2 tf, tw > 1.5 tf
    or b < 2 tw, where the formula does not hold.

    Example:
        >>> girder = st.i_shape(h=0.3, b=0.15, tw=0.0071, tf=0.0107, E=210e9, nu=0.3, rho=7850.0)
    """
    shape, _ = _flanged("I", h, b, tw, tf, r)
    torsion = _torsion_of_flanged("I", h, b, tw, tf, r)
    return _profile(shape, (tw * (h - tf), 5 / 3 * b * tf), torsion, material)


def channel(h: float, b: float, tw: float, tf: float, r: float = 0.0, **material: Any) -> Section:
    """Create a channel with parallel flanges, with the dimensions of :func:`i_shape`.

    About the weak axis, the web is to the right of the direction of the beam.  ``material`` are
    arguments of ``Section.of_shape``; the defaults of the shear factors are Cowper's (1966) for
    thin walls and Poisson's ratio 0; the torsion constant is computed as for an I.  Scenes
    in space need ``centroid_only=True``, because the shear centre is behind the web.

    Example:
        >>> purlin = st.channel(h=0.2, b=0.08, tw=0.006, tf=0.011, E=210e9, nu=0.3, rho=7850.0)
    """
    shape, walls = _flanged("C", h, b, tw, tf, r)
    return _profile(shape, _shear_areas(walls), _torsion_of_flanged("C", h, b, tw, tf, r), material)


def t_shape(h: float, b: float, tw: float, tf: float, r: float = 0.0, **material: Any) -> Section:
    """Create a T: depth h with the flange of width b and thickness tf, thickness tw of the web.

    The flange is to the left of the direction of the beam; ``r`` is the radius of the fillets;
    m.  ``material`` are arguments of ``Section.of_shape``; the defaults of the shear factors are
    Cowper's (1966) for thin walls and Poisson's ratio 0, and of the torsion constant that of
    :func:`i_shape`.  Scenes in space need ``centroid_only=True``, because the shear centre is in
    the flange.

    Example:
        >>> stiffener = st.t_shape(h=0.1, b=0.1, tw=0.01, tf=0.01, E=210e9, nu=0.3, rho=7850.0)
    """
    shape, walls = _flanged("T", h, b, tw, tf, r)
    return _profile(shape, _shear_areas(walls), _torsion_of_flanged("T", h, b, tw, tf, r), material)


def box(b: float, h: float, t: float, r: float = 0.0, **material: Any) -> Section:
    """Create a rectangular hollow section: width b, depth h, wall t, outer corner radius r; m.

    The inner radius is r - t, or 0.  ``material`` are arguments of ``Section.of_shape``; the
    defaults of the shear factors are Cowper's (1966) for thin walls and Poisson's ratio 0, and
    the torsion constant follows EN 10210-2.

    Example:
        >>> column = st.box(b=0.2, h=0.3, t=0.01, r=0.02, E=210e9, nu=0.3, rho=7850.0)
    """
    require_positive("box", b=b, h=h, t=t)
    require_number(r, "box: r", at_least=0.0)
    if material.get("axis") == "weak":
        b, h, material = h, b, material | {"axis": "strong"}
    if 2 * t >= min(b, h):
        raise ModelError(f"box: two walls do not fit: b = {b}, h = {h}, t = {t} m")
    if 2 * r > min(b, h):
        raise ModelError(f"box: r = {r} m does not fit: b = {b}, h = {h} m")
    areas = [thin_walled_shear_area(box_walls(*sides, t)) for sides in ((b, h), (h, b))]
    corner = (r + max(r - t, 0.0)) / 2
    length = 2 * (b + h - 2 * t) - 2 * corner * (4 - math.pi)
    enclosed = (b - t) * (h - t) - corner**2 * (4 - math.pi)
    torsion = t**3 * length / 3 + 4 * enclosed**2 * t / length
    return _profile(rounded_rectangle(b, h, r, t), areas, torsion, material)


def _flanged(kind: str, h: float, b: float, tw: float, tf: float, r: float) -> tuple[Shape, Walls]:
    name = {"I": "i_shape", "C": "channel", "T": "t_shape"}[kind]
    require_positive(f"{name}", h=h, b=b, tw=tw, tf=tf)
    require_number(r, f"{name}: r", at_least=0.0)
    if (2 * tf if kind != "T" else tf) >= h or tw > b:
        raise ModelError(
            f"{name}: web and flanges do not fit: h = {h}, b = {b}, tw = {tw}, tf = {tf} m"
        )
    across = b - tw if kind == "C" else (b - tw) / 2
    along = h - tf if kind == "T" else h / 2 - tf
    if r > min(across, along):
        raise ModelError(f"{name}: r = {r} m; the fillets have room for {min(across, along):.4g} m")
    return flanged(kind, h, b, tw, tf, r)


def _profile(
    shape: Shape, areas: Sequence[float], torsion: float | None, material: dict[str, Any]
) -> Section:
    """Create a section with defaults of its shear areas (m²) and torsion constant (m⁴)."""
    own, other = areas[::-1] if material.get("axis") == "weak" else areas
    factors = {"shear_factor": own / shape.A, "shear_factor3": other / shape.A}
    return Section.of_shape(shape, **factors | {"torsion": torsion} | material)


def _shear_areas(walls: Walls) -> list[float]:
    turned = [(1j * start, 1j * end, t) for start, end, t in walls]
    return [thin_walled_shear_area(walls), thin_walled_shear_area(turned)]


def _torsion_of_flanged(
    kind: str, h: float, b: float, tw: float, tf: float, r: float
) -> float | None:
    """Return the torsion constant of an I, C or T by El Darwish and Johnston; m⁴.

    SCI P385 has the formulas.  The result is None where they do not hold: with finite
    differences of Prandtl's stress function they differ by up to 10 % within the limits below,
    and by up to 50 % outside.
    """
    w, f = tw / tf, r / tf
    if w > 1.5 or f > 2.0 or b < 2 * tw:
        return None
    flanges = 1 if kind == "T" else 2
    if kind == "C":
        alpha = -0.0908 + 0.2621 * w + 0.1231 * f - 0.0752 * w * f - 0.0945 * w**2
        D = 2 * (3 * r + tw + tf - math.sqrt(2 * (2 * r + tw) * (2 * r + tf)))
    else:
        alpha = -0.042 + 0.2204 * w + 0.1355 * f - 0.0865 * w * f - 0.0725 * w**2
        D = ((tf + r) ** 2 + (r + tw / 4) * tw) / (2 * r + tf)
    flange = b * tf**3 / 3 + alpha * D**4 - 0.21 * tf**4
    foot = 0.105 * tw**4 if kind == "T" else 0.0
    return flanges * flange + (h - flanges * tf) * tw**3 / 3 - foot


def _similar(name: str, table: Iterable[str]) -> list[str]:
    """Return five designations, of the same series if it exists, with the nearest sizes."""

    def parts(text: str) -> tuple[str, list[int]]:
        return re.split(r"\d", text)[0], [int(size) for size in re.findall(r"\d+", text)]

    def distance(other: str) -> tuple[bool, list[int]]:
        (series, sizes), (own, wanted) = parts(other), parts(name)
        return series != own, [abs(a - b) for a, b in zip(sizes, wanted, strict=False)]

    return nsmallest(5, table, key=distance)


@cache
def _steel_table() -> dict[str, tuple[str, tuple[float, ...]]]:
    """Return the kind and the dimensions (m) of each designation."""
    lines = Path(__file__).with_name("steel_shapes.csv").read_text("utf-8").splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    return {name: (kind, tuple(float(mm) / 1000 for mm in sizes)) for name, kind, *sizes in rows}


@lru_cache(maxsize=256)
def flanged(kind: str, h: float, b: float, tw: float, tf: float, r: float) -> tuple[Shape, Walls]:
    """Create an "I", a "T" with its flange above, or a channel "C" with its web on the left.

    ``r`` (m) is the radius of the fillets between web and flanges.
    """
    left, web, right = (-b / 2, -tw / 2, b / 2) if kind != "C" else (-b / 2, -b / 2, b / 2)
    face, rim = h / 2 - tf, h / 2
    half = [(web + tw, face, r), (right, face, 0.0), (right, rim, 0.0)]
    half += [(left, rim, 0.0), (left, face, 0.0), (web, face, r)][: 1 if kind == "C" else 3]
    foot = [(x, -y, radius) for x, y, radius in half[::-1]]
    if kind == "T":
        foot = [(web, -rim, 0.0), (web + tw, -rim, 0.0)]
    middle, top = complex(web + tw / 2), complex(web + tw / 2, (face + rim) / 2)
    tips = (left, right) if kind != "C" else (right,)
    flange: Walls = [(complex(x, top.imag), top, tf) for x in tips]
    if kind == "T":
        return Shape(foot + half), [*flange, (complex(0, -rim), top, tw)]
    below = [(start.conjugate(), end.conjugate(), t) for start, end, t in flange]
    return Shape(foot + half), [*flange, *below, (top, middle, tw), (top.conjugate(), middle, tw)]


def box_walls(b: float, h: float, t: float) -> Walls:
    """Return the walls of a rectangular hollow section that bends in the plane of ``h``; m."""
    x, y = (b - t) / 2, (h - t) / 2
    walls: Walls = []
    for corner in (complex(i * x, j * y) for i in (-1, 1) for j in (-1, 1)):
        walls += [(complex(0.0, corner.imag), corner, t), (corner, complex(corner.real), t)]
    return walls


def thin_walled_shear_area(walls: Walls) -> float:
    """Return the shear area A_s = I² / ∫ (S²/t) ds, with the first moment S of the shear flow; m².

    This is the shear coefficient of Cowper (J. Appl. Mech. 33, 1966, p. 335) for thin walls and
    Poisson's ratio 0.
    """
    area = sum(abs(end - start) * t for start, end, t in walls)
    centre = sum(abs(end - start) * t * (start + end).imag / 2 for start, end, t in walls) / area
    nodes, weights = gauss_rule(3)
    inflow: dict[complex, float] = {}
    energy = I = 0.0
    for start, end, t in walls:
        length, y0, y1 = abs(end - start), start.imag - centre, end.imag - centre
        S = inflow.get(start, 0.0) + t * length * (y0 * nodes + (y1 - y0) * nodes**2 / 2)
        energy += length * float(weights @ S**2) / t
        I += length * t * (y0**2 + y0 * y1 + y1**2) / 3
        inflow[end] = inflow.get(end, 0.0) + inflow.get(start, 0.0) + t * length * (y0 + y1) / 2
    return I**2 / energy
