# SPDX-License-Identifier: MIT
"""Cantilever rolled up by an end moment.

Data sets: P. L. Kinon, P. Betsch, S. R. Eugster, "Energy-momentum-consistent simulation of planar
geometrically exact beams" (2025) and moofeKIT rollup.m (L = 10); GXBeam tipmoment.jl (L = 12 in);
beamFoam (S. Bali et al., doi 10.1002/nme.6994; L = 10).

[closed] At every moment the beam is a circle of radius L/θ, θ = ML/EI.  With n two-node cells and
one point each it is a regular polygon: the rotations at the nodes are exact, i θ/n; the chords have
their undeformed length h and the direction of the rotation at their middle.  Summed, the tip is
R (sin θ, 1 - cos θ) with R = h / (2 sin(θ/2n)), longer than L/θ by the part (θ/n)²/24: second
order.
"""

import math

import numpy as np
import pytest
from convergence.study import orders
from scenes import cantilever

import ufl_beam as ub

DATA_SETS = {
    "Kinon": (10.0, ub.Section(EA=1e4, GA=1e4, EI=500.0)),
    "GXBeam": (12.0, ub.Section(EA=30e6, GA=30e6 / 2.6, EI=30e6 / 12)),
    "beamFoam": (10.0, ub.Section(EA=1e4, GA=5e3, EI=100.0)),
}


def rolled(length, section, cells, turns=1.0):
    """Angles of the end and its (u, v, ψ) in ten steps to so many turns."""
    scene = cantilever(
        section, length=length, cells=cells, moment=turns * 2 * math.pi * section.EI / length
    )
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    return turns * 2 * math.pi * solution.times, solution.displacement(scene.beams[0].end)


def on_circle(radius, length, θ):
    return np.column_stack([radius * np.sin(θ) - length, radius * (1 - np.cos(θ)), θ])


@pytest.mark.parametrize("cells", [1, 3, 10, 20])
@pytest.mark.parametrize("name", DATA_SETS)
def test_an_end_moment_bends_cells_to_a_polygon(name, cells):
    """[closed] To solver tolerance.

    Unbalanced forces are 1e-10 of M/L = θ EI/L²; a force F moves the end of a cantilever by
    F L³/3EI.  With the moments, which count as much, that is 1e-10 · 2π · (1/3 + 1) < 1e-9 of the
    length.
    """
    length, section = DATA_SETS[name]
    turns = 1.0 if cells > 2 else 0.5  # a single cell cannot close
    θ, computed = rolled(length, section, cells, turns)
    radius = length / cells / (2 * np.sin(θ[1:] / (2 * cells)))
    np.testing.assert_allclose(
        computed[1:], on_circle(radius, length, θ[1:]), rtol=0, atol=1e-9 * length
    )


@pytest.mark.parametrize("name", DATA_SETS)
def test_the_tip_comes_to_the_clamp(name):
    """[closed] The tip comes to the clamp, with any number of cells."""
    length, section = DATA_SETS[name]
    _, computed = rolled(length, section, 10)
    np.testing.assert_allclose(computed[-1], [-length, 0, 2 * math.pi], rtol=0, atol=1e-9 * length)


def test_positions_converge_with_second_order():
    """Second order to the true circle at λ = 0.4, 0.8, ... turns (GXBeam); next term 1e-3 here."""
    length, section = DATA_SETS["GXBeam"]
    errors = []
    for cells in (10, 20, 40, 80):
        θ, computed = rolled(length, section, cells)
        errors.append(np.abs(computed[1:] - on_circle(length / θ[1:], length, θ[1:]))[:-1].max())
    np.testing.assert_allclose(orders(errors), 2, rtol=0, atol=0.01)
