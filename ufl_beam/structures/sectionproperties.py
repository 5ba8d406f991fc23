# SPDX-License-Identifier: MIT
"""Sections from cross-sections that the package sectionproperties has analysed."""

from __future__ import annotations

from typing import Any

from ufl_beam.errors import ModelError, shorten
from ufl_beam.model.sections import Section


def of_sectionproperties(analysed: Any, *, axis: str = "x", **laws: Any) -> Section:
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

    Example:
        >>> from sectionproperties.analysis import Section as Analysis
        >>> from sectionproperties.pre import DEFAULT_MATERIAL, rectangular_section
        >>> plate = Analysis(rectangular_section(0.2, 0.1).create_mesh([1e-4]))
        >>> plate.calculate_geometric_properties()
        >>> plate.calculate_warping_properties()
        >>> section = st.of_sectionproperties(plate)
    """
    what = "of_sectionproperties"
    if not type(analysed).__module__.startswith("sectionproperties."):
        raise ModelError(
            f"{what}: analysed = {shorten(analysed)} must be a Section of the package "
            "sectionproperties (pip install sectionproperties)"
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
    return Section(
        EA=EA, GA=shear / (2 * (1 + nu)), EI=own, rhoA=mass, rhoI=mass * own / EA,
        depth=depth, **laws,
    )  # fmt: skip
