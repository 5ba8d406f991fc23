# SPDX-License-Identifier: MIT
"""One scene stated in several ways has one set of modes: units, axes, order of its beams."""

from dataclasses import replace

import numpy as np
import pytest
from elastic_scenes import Built, Units, draw

import ufl_beam as ub

UNITS = Units(metre=1e3, kilogram=10.0)
WAYS = ({"angle": 0.7}, {"units": UNITS})


@pytest.mark.parametrize("damping", [(), (ub.Rayleigh(mass=0.3, stiffness=1e-3),)])
@pytest.mark.parametrize("seed", range(0, 36, 3))
def test_modes_do_not_depend_on_units_and_axes(seed, damping):
    """Tolerance: round-off 1e-16 times the ratio of the highest squared frequency to the lowest."""

    def exponents(**way):
        built = Built(draw(seed, free=seed % 2 == 0), **way)
        return ub.modes(replace(built.scene, damping=damping), 8).exponents

    plain = exponents()
    assert len(plain) == 8
    for way in WAYS:
        np.testing.assert_allclose(exponents(**way), plain, rtol=1e-8, atol=1e-12)
