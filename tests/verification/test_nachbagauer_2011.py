# SPDX-License-Identifier: MIT
"""Shear-flexible cantilever under a tip load.

Source: K. Nachbagauer, A. Pechstein, H. Irschik, J. Gerstmayr, "A new locking-free formulation for
planar, shear deformable, linear and quadratic beam finite elements based on the absolute nodal
coordinate formulation", Multibody System Dynamics 26 (2011) 245-263; its figures are also in the
test ANCFBeamTest.py of Exudyn, which reproduces them.

The published elements interpolate the slope vector of the cross-section, ours (the paper's) the
angle ψ.  Limits are the same, single elements are not: at the midpoint of a cell the former's
curvature is 2 tan(Δψ/2) / h, ours Δψ / h.  So few cells are compared with the published figures in
the linear range, up to this difference, and with an independent statement of our own discrete
equations for large deflections.  (The published 0.07140274 and 0.54225823 of one element at the
full load follow to all digits from the interpolated slope vector with a thickness strain at the
nodes; ours gives 0.08323462 and 0.58355161.)
"""

import numpy as np
import pytest
from convergence.study import romberg
from scenes import cantilever
from scipy.optimize import fsolve

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


def tip_of_chain(cells, force=FORCE):
    """The same from the equilibrium of straight cells that carry (N, V, M) at their midpoints."""
    h = LENGTH / cells

    def cell_vectors(ψ):
        middle = ψ - np.diff(ψ, prepend=0) / 2
        stretch = 1 + force * np.sin(middle) / SECTION.EA
        shear = force * np.cos(middle) / SECTION.GA
        return h * np.array(
            [
                stretch * np.cos(middle) - shear * np.sin(middle),
                stretch * np.sin(middle) + shear * np.cos(middle),
            ]
        )

    def equilibrium(ψ):
        x = cell_vectors(ψ)[0]
        arm = np.cumsum(x[::-1])[::-1] - x / 2  # of the tip load about the midpoints
        return np.diff(ψ, prepend=0) / h - force * arm / SECTION.EI

    ψ = fsolve(equilibrium, np.linspace(0.4, 0.5, cells), xtol=1e-12)
    x, y = cell_vectors(ψ).sum(axis=1)
    return np.array([LENGTH - x, y, ψ[-1]])


@pytest.mark.parametrize("cells", [1, 2, 4])
def test_large_deflection_of_few_cells(cells):
    """[closed] the discrete equations; solver tolerance 1e-10 of the forces, amplified by < 10."""
    np.testing.assert_allclose(tip(cells), tip_of_chain(cells), rtol=1e-9)


def test_large_deflection():
    """[calc] 0.15097114, 0.71056860, 0.52017317: half a unit of the eighth decimal.

    Romberg's limit of 32 to 256 cells is good to the tolerance of the solver.
    """
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

    The published curvature makes a cell that turns by Δψ stiffer by the part Δψ²/3, at most that of
    the cell at the clamp, whose moment is 2 - 1/n times the mean.  So the deflection is smaller by
    at most that part, and u, which goes with its square, by twice that.  A unit of the last digit
    for the rounding of the source.
    """
    computed = tip(cells, FORCE / 1000)
    stiffer = (computed[2] / cells * (2 - 1 / cells)) ** 2 / 3
    assert -1e-16 <= computed[0] - u <= 2 * stiffer * u + 1e-15
    assert -1e-12 <= computed[1] - v <= stiffer * v + 1e-12


def test_limit_of_the_linear_range():
    """[calc] 1.888492e-7, 8.099033e-4; [pub] 1.88847e-7, 8.09900e-4 are of 256 elements, above."""
    u, v, _ = romberg(*(tip(n, FORCE / 1000) for n in (32, 64, 128)))
    assert u == pytest.approx(1.888492e-7, rel=0, abs=0.6e-13)
    assert v == pytest.approx(8.099033e-4, rel=0, abs=0.6e-10)
