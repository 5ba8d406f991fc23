# SPDX-License-Identifier: MIT
"""Elastica of a cantilever under a transverse dead tip load.

Source: K. Mattiasson, "Numerical results from large deflection beam and frame problems analysed by
means of elliptic integrals", Int. J. Numer. Meth. Eng. 17 (1981) 145-153; the curve is that of
K. E. Bisshopp and D. C. Drucker, Quart. Appl. Math. 3 (1945) 272-275.
"""

from pathlib import Path

import numpy as np
from closed_forms import elastica
from convergence.study import extrapolated
from scenes import cantilever

import ufl_beam as ub

ROWS = np.loadtxt(Path(__file__).parents[1] / "data/elastica_tip_load.csv", delimiter=",")
LOADS, TABLE = ROWS[:, 0], ROWS[:, 1:] * (1, -1, 1)
"""Loads, and (v, u, ψ) of the tip."""


def computed(cells, degree=1):
    """(v, u, ψ) at all loads of the table."""
    scene = cantilever(cells=cells, force=(0, 1), time=lambda t: t)
    mesh = ub.Mesh(degree=degree)
    solution = ub.simulate(scene, ub.Static(), t=(0, LOADS[-1]), dt=0.1, mesh=mesh)
    moved = solution.displacement(scene.beams[0].end)
    return moved[np.rint(LOADS / 0.1).astype(int)][:, [1, 0, 2]]


def exact():
    return np.array([elastica(a)[[1, 0, 2]] for a in LOADS])


def test_elastica():
    """[closed] Richardson's limit; the fourth order leaves 1/15 of the change from a coarser mesh.

    Doubled for the orders above, with strains of axis and shear, 1e-8 of the load.
    """
    coarse, medium, fine = (computed(n) for n in (16, 32, 64))
    before, limit = extrapolated(coarse, medium), extrapolated(medium, fine)
    tolerance = 2 / 15 * np.abs(limit - before).max(axis=1) + 1e-8 * LOADS
    assert (np.abs(limit - exact()).max(axis=1) <= tolerance).all()


def test_eight_cubic_cells_have_the_digits_of_the_table():
    """[pub] Half a unit of the last digit, of the closed form and of the run."""
    for found in (exact(), computed(8, degree=3)):
        np.testing.assert_allclose(found, TABLE, rtol=0, atol=5.1e-6)
