# SPDX-License-Identifier: MIT
"""Elastica of a cantilever under a transverse dead tip load.

Source: K. Mattiasson, "Numerical results from large deflection beam and frame problems analysed by
means of elliptic integrals", Int. J. Numer. Meth. Eng. 17 (1981) 145-153; the curve is that of
K. E. Bisshopp and D. C. Drucker, Quart. Appl. Math. 3 (1945) 272-275.
"""

from pathlib import Path

import numpy as np
import pytest
from closed_forms import elastica
from convergence.study import extrapolated
from scenes import cantilever

import ufl_beam as ub

TABLE = np.loadtxt(Path(__file__).parents[1] / "data/elastica_tip_load.csv", delimiter=",")
LOADS = TABLE[:, 0]


def closed_form(a):
    """[closed] (w, u, θ) at the load a, as the table has them."""
    u, w, θ = elastica(a)
    return w, -u, θ


def computed(cells):
    """(w, u, θ) at all loads of the table."""
    scene = cantilever(cells=cells, force=(0, 1), time=lambda t: t)
    solution = ub.simulate(scene, ub.Static(), t=(0, LOADS[-1]), dt=0.1)
    rows = np.rint(LOADS / 0.1).astype(int)
    u, v, ψ = solution.displacement(scene.beams[0].end)[rows].T
    return np.column_stack([v, -u, ψ])


@pytest.fixture(scope="module")
def runs():
    """On 16, 32 and 64 cells."""
    return [computed(n) for n in (16, 32, 64)]


def test_table_is_the_closed_form():
    """[pub] Half a unit of the last digit."""
    np.testing.assert_allclose([closed_form(a) for a in LOADS], TABLE[:, 1:], rtol=0, atol=5.1e-6)


def test_elastica(runs):
    """Richardson's limit against the closed form.

    Tolerance: the fourth-order error that is left, a fifteenth of the change of the limit from the
    mesh before, doubled for the orders above; and the strains of axis and shear, 1e-8 of the load.
    """
    coarse, medium, fine = runs
    before, limit = extrapolated(coarse, medium), extrapolated(medium, fine)
    exact = np.array([closed_form(a) for a in LOADS])
    tolerance = 2 / 15 * np.abs(limit - before).max(axis=1) + 1e-8 * LOADS
    assert (np.abs(limit - exact).max(axis=1) <= tolerance).all()
    # [pub] To the digits of the table: half a unit, and what the extrapolation leaves.
    assert (np.abs(limit - TABLE[:, 1:]).max(axis=1) <= 5e-6 + tolerance).all()
