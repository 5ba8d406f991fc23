# SPDX-License-Identifier: MIT
"""Cantilever rolled up by an end moment.

Data sets: P. L. Kinon, P. Betsch, S. R. Eugster, "Energy-momentum-consistent simulation of planar
geometrically exact beams" (2025) and moofeKIT rollup.m (L = 10); GXBeam tipmoment.jl (L = 12 in);
beamFoam (S. Bali et al., doi 10.1002/nme.6994; L = 10).

[closed] With n two-node cells and one point each the beam is a regular polygon, θ = ML/EI: the
rotations at the nodes are i θ/n; the chords have their undeformed length h and the direction of the
rotation at their middle.  The tip is R (sin θ, 1 - cos θ) with R = h / (2 sin(θ/2n)), which is L/θ
but for the part (θ/n)²/24; after one turn it is at the clamp.
"""

import math

import numpy as np
import pytest
from scenes import cantilever

import ufl_beam as ub

DATA_SETS = {
    "Kinon": (10.0, ub.Section(EA=1e4, GA=1e4, EI=500.0)),
    "GXBeam": (12.0, ub.Section(EA=30e6, GA=30e6 / 2.6, EI=30e6 / 12)),
    "beamFoam": (10.0, ub.Section(EA=1e4, GA=5e3, EI=100.0)),
}


@pytest.mark.parametrize("cells", [1, 3, 10])
@pytest.mark.parametrize("name", DATA_SETS)
def test_an_end_moment_bends_cells_to_a_polygon(name, cells):
    """[closed] Unbalanced moments and forces of 1e-10 M/L move the end by less than 1e-9 L."""
    length, section = DATA_SETS[name]
    turn = 2 * math.pi if cells > 2 else math.pi  # a single cell cannot close
    scene = cantilever(section, length=length, cells=cells, moment=turn * section.EI / length)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    found, θ = solution.displacement(scene.beams[0].end)[1:], turn * solution.times[1:]
    R = length / cells / (2 * np.sin(θ / (2 * cells)))
    exact = np.column_stack([R * np.sin(θ) - length, R * (1 - np.cos(θ)), θ])
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-9 * length)
