# SPDX-License-Identifier: MIT
"""Sections: the resultants of shapes, from the formulas of any table book."""

import math

import numpy as np
import pytest

import ufl_beam as ub
import ufl_beam.structures as st

STEEL = {"E": 210e9, "nu": 0.25, "rho": 7850.0}
G = 84e9  # E / 2.5

CLOSE = 1e-14
"""Relative; the same products in another order: a few units in the last place."""


def check(section, *, A, I, shear_area):
    assert pytest.approx(210e9 * A, rel=CLOSE) == section.EA
    assert pytest.approx(210e9 * I, rel=CLOSE) == section.EI
    assert pytest.approx(G * shear_area, rel=CLOSE) == section.GA
    assert section.rhoA == pytest.approx(7850.0 * A, rel=CLOSE)
    assert section.rhoI == pytest.approx(7850.0 * I, rel=CLOSE)


def test_a_rectangle_has_its_stiffnesses():
    # b h, b h^3 / 12, shear factor 5/6
    section = ub.Section.rectangle(b=0.1, h=0.3, **STEEL)
    check(section, A=0.03, I=0.1 * 0.027 / 12, shear_area=0.025)
    assert section.depth == 0.3


def test_a_circle_has_its_stiffnesses():
    # pi r^2, pi r^4 / 4, shear factor 9/10
    section = ub.Section.circle(0.2, **STEEL)
    check(
        section,
        A=math.pi * 0.01,
        I=math.pi * 1e-4 / 4,
        shear_area=0.9 * math.pi * 0.01,
    )
    assert section.depth == 0.2


def test_a_tube_has_its_stiffnesses():
    # radii 0.1 and 0.08: pi (R^2 - r^2), pi (R^4 - r^4) / 4; differences lose two digits
    section = ub.Section.tube(0.2, 0.02, **STEEL)
    A, I = math.pi * 0.0036, math.pi * (1e-4 - 0.4096e-4) / 4
    assert pytest.approx(210e9 * A, rel=1e-12) == section.EA
    assert pytest.approx(210e9 * I, rel=1e-12) == section.EI
    assert pytest.approx(G * A / 2, rel=1e-12) == section.GA


def test_tube_that_is_full_is_a_circle():
    tube = ub.Section.tube(0.2, 0.1, **STEEL)
    circle = ub.Section.circle(0.2, **STEEL)
    assert pytest.approx(circle.EA, rel=CLOSE) == tube.EA
    assert pytest.approx(circle.EI, rel=CLOSE) == tube.EI


def test_an_i_shape_has_its_stiffnesses():
    # By flanges and web: 2 (b tf^3 / 12 + b tf d^2) + tw hw^3 / 12, d = (h - tf) / 2
    h, b, tw, tf = 0.3, 0.15, 0.01, 0.02
    web, d = 0.26, 0.14
    section = st.i_shape(h, b, tw, tf, **STEEL)
    A = 2 * 0.15 * 0.02 + 0.01 * 0.26
    I = 2 * (b * tf**3 / 12 + b * tf * d**2) + tw * web**3 / 12
    assert pytest.approx(210e9 * A, rel=1e-13) == section.EA
    assert pytest.approx(210e9 * I, rel=1e-12) == section.EI  # a difference of cubes loses a digit
    assert pytest.approx(G * tw * (h - tf), rel=1e-13) == section.GA


def test_i_shape_without_web_opening_is_a_rectangle():
    # A web as wide as the flanges fills the rectangle; only the shear area is another.
    i_shape = st.i_shape(0.3, 0.1, 0.1, 0.05, **STEEL)
    rectangle = ub.Section.rectangle(0.1, 0.3, **STEEL)
    assert pytest.approx(rectangle.EA, rel=CLOSE) == i_shape.EA
    assert pytest.approx(rectangle.EI, rel=CLOSE) == i_shape.EI


def test_without_density_there_is_no_mass():
    section = ub.Section.rectangle(0.1, 0.3, E=1.0, nu=0.0)
    assert (section.rhoA, section.rhoI) == (0.0, 0.0)


def test_default_depth_is_that_of_the_rectangle_of_the_same_stiffness():
    # EI / EA = h^2 / 12
    section = ub.Section(EA=12.0, GA=1.0, EI=4.0)
    assert section.depth == pytest.approx(2.0, rel=CLOSE)


def test_records_are_frozen():
    with pytest.raises(AttributeError):
        ub.Section(EA=1.0, GA=1.0, EI=1.0).EA = 2.0


def test_layers_of_a_circle_end_at_its_rim():
    """For some diameters r² - y² has a negative last digit there."""
    for d in np.append(np.random.default_rng(1).uniform(1e-3, 1.0, 300), 0.00976466):
        fibres = ub.Fibres(ub.ElastoPlastic(1e6), number=4)
        section = ub.Section.circle(d=d, E=1e9, nu=0.3, fibres=fibres)
        assert pytest.approx(1e9 * np.pi * d**2 / 4, rel=1e-12) == section.EA
