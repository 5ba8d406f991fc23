# SPDX-License-Identifier: MIT
"""A frame whose hinge softens, struck at its corner: section 4.4 of the paper.

[calc] numbers are those of an independent solver of the functional, a DOLFINx program on one mesh
with the jump in DG0, which makes the same steps; it agrees in all digits that are given.  Material
and section are those of the paper, geometry and impulse are assumed, see
demos/demo_vibrating_frame.py.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import ufl_beam as ub
import ufl_beam.structures as st

E, A, I = 1e9, 10e-4, 1e-8  # Pa, m², m⁴
H = np.sqrt(12 * I / A)  # m
LIMIT, FRACTURE = 3.15, 1.5  # N m, J
ELASTIC = {"b": A / H, "h": H, "E": E, "nu": 0.3, "rho": 1000.0}
IMPULSE = ub.Table([0, 0.15, 0.3], [0, 1, 0])


def swing(girder, end):
    """Run of the frame with this girder, one or two beams, and the corner on its right."""
    section = ub.Section.rectangle(**ELASTIC)
    left = ub.Beam((0, 0), (0, 1), section, cells=8)
    right = ub.Beam((1, 1), (1, 0), section, cells=8)
    beams = [left, *girder, right]
    scene = ub.Scene(
        beams,
        joints=[ub.Rigid(a.end, b.start) for a, b in pairwise(beams)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(13.8, 0), amplitude=IMPULSE)],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, end), dt=1e-3, every=5)
    assert solution.energy.worst < 1e-9
    return solution, girder[-1].end


@cache
def at_the_corner(energy, end):
    """The hinge of zero length has this fracture energy; J."""
    hinges = {1.0: ub.Softening(LIMIT, energy)}
    section = ub.Section.rectangle(**ELASTIC)
    return swing([ub.Beam((0, 1), (1, 1), section, cells=8, corners=(0.95,), hinges=hinges)], end)


@pytest.mark.parametrize("energy", [0.4, 0.8])
def test_a_hinge_that_opens_completely_takes_its_fracture_energy(energy):
    """[closed] The frame keeps the work of the impulse less G_f; exp(-t_u x/G_f) = 1e-7 remains."""
    solution, _ = at_the_corner(energy, 15.0)
    assert solution.energy.lost["hinges"][-1] == pytest.approx(energy, rel=1e-7)
    left = solution.energy.supplied["loads"][-1] - energy
    assert solution.energy.total[-1] == pytest.approx(left, rel=1e-6)


def test_the_critical_fracture_energy_is_the_work_of_the_impulse():
    """[calc] Of 875 mJ 0.32 mJ remain with 0.9 J; with less or more it is 75 or 166 mJ."""
    remains = [at_the_corner(energy, 15.0)[0].energy.total[-1] for energy in (0.8, 0.9, 1.5)]
    np.testing.assert_allclose(remains, [0.07549, 0.00032, 0.16619], rtol=0, atol=0.51e-5)


def decrement(solution, corner):
    """Mean over the eight periods after the impulse, of halves of a maximum and a minimum."""
    free = solution.times > IMPULSE.times[-1]
    t, u = solution.times[free], solution.displacement(corner)[free, 0]
    (times, highest), (_, lowest) = (st.peaks(t, x, prominence=0.2) for x in (u, -u))
    return st.fit_decay(times[:9], (highest[:9] + lowest[:9]) / 2).decrement


def test_the_first_decrement_of_table_2():
    """0.0784 with eight cells; the paper has 0.077, to which G_f and the impulse were chosen."""
    assert decrement(*at_the_corner(FRACTURE, 6.5)) == pytest.approx(0.0784, abs=0.51e-4)


@pytest.mark.parametrize(
    ("bending", "hinge", "bulk"),
    [(None, 0.6658721, 0.0), (ub.ElastoPlastic(3.0, isotropic=500e6 * I), 0.6561901, 0.0036464)],
)
def test_a_hinge_embedded_in_the_last_cell(bending, hinge, bulk):
    """[calc] Energies lost by the hinge and by its cell, with K and M_y of the paper; 0.1 µJ."""
    law = ub.Softening(LIMIT, FRACTURE)
    weak = ub.Section.rectangle(**ELASTIC, bending=bending, hinge=law)
    girder = ub.Beam((0, 1), (0.96, 1), ub.Section.rectangle(**ELASTIC), cells=8)
    last = ub.Beam((0.96, 1), (1, 1), weak, cells=1, hinges={0.0: None, 1.0: None})
    solution, _ = swing([girder, last], 6.5)
    lost = solution.energy.lost
    assert lost["hinges"][-1] == pytest.approx(hinge, rel=0, abs=0.51e-7)
    if bulk:
        assert lost["plastic"][-1] == pytest.approx(bulk, rel=0, abs=0.51e-7)
