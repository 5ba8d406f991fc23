# SPDX-License-Identifier: MIT
"""Shear-flexible cantilever under a tip load.

Source: K. Nachbagauer, A. Pechstein, H. Irschik, J. Gerstmayr, "A new locking-free formulation for
planar, shear deformable, linear and quadratic beam finite elements based on the absolute nodal
coordinate formulation", Multibody System Dynamics 26 (2011) 245-263; its figures are also in the
test ANCFBeamTest.py of Exudyn, which reproduces them.

The published elements interpolate the slope vector of the cross-section, ours (the paper's) the
angle ψ.  Limits are the same; the curvature of a single cell is 2 tan(Δψ/2) / h there, Δψ / h here.
So few cells are compared in the linear range.
"""

import numpy as np
import pytest
from convergence.study import romberg
from scenes import cantilever

import ufl_beam as ub

NU, LENGTH, FORCE = 0.3, 2.0, 5e8 * 0.5**3
SHEAR_FACTOR = 10 * (1 + NU) / (12 + 11 * NU)
SECTION = ub.Section.rectangle(b=0.1, h=0.5, E=2.07e11, nu=NU, shear_factor=SHEAR_FACTOR)


def tip(cells, force=FORCE):
    """(u, v, ψ) of the tip, u in the direction of the source."""
    scene = cantilever(SECTION, length=LENGTH, cells=cells, force=(0, force))
    tight = ub.Newton(rtol=1e-13)  # nine digits are compared
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25, newton=tight)
    return solution.displacement(scene.beams[0].end)[-1] * (-1, 1, 1)


def test_large_deflection():
    """[calc] 0.15097114, 0.71056860, 0.52017317: half a unit of the eighth decimal."""
    limit = romberg(*(tip(n) for n in (32, 64, 128, 256)))
    np.testing.assert_allclose(limit, [0.15097114, 0.71056860, 0.52017317], rtol=0, atol=6e-9)
    # [pub] deflection with 1024 elements and the error that is printed beside it.
    assert limit[1] == pytest.approx(0.71056837 + 2.280e-7, rel=0, abs=6e-9)


@pytest.mark.parametrize(
    ("cells", "u", "v"),
    [
        (1, 9.12273046e-8, 6.16666566e-4),
        (2, 1.61293091e-7, 7.61594059e-4),
        (4, 1.81763233e-7, 7.97825954e-4),
        (256, 1.88847418e-7, 8.09900305e-4),
    ],
)
def test_linear_range(cells, u, v):
    """[pub] a thousandth of the load, to the printed digits.

    The published curvature makes the cell at the clamp, which turns by Δψ, stiffer by Δψ²/3: the
    deflection is smaller by at most that part, and u, which goes with its square, by twice that.
    """
    computed = tip(cells, FORCE / 1000)
    stiffer = (computed[2] / cells * (2 - 1 / cells)) ** 2 / 3
    assert -1e-16 <= computed[0] - u <= 2 * stiffer * u + 1e-15
    assert -1e-12 <= computed[1] - v <= stiffer * v + 1e-12
