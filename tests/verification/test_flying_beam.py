# SPDX-License-Identifier: MIT
"""Flying flexible beam, "planar spaghetti": free, thrown by a force and a moment for 2.5 s.

Source: J. C. Simo, L. Vu-Quoc, "On the dynamics of flexible beams under large overall motions - the
plane case: Part II", J. Appl. Mech. 53 (1986) 855-863; data as in moofeKIT flying_2D_spaghetti.m.
"""

from functools import lru_cache

import numpy as np
import pytest
from scenes import flying_beam

import ufl_beam as ub

# [calc] 20 cubic elements, Δt = 0.00625; loaded end (u, v, ψ), free end (u, v, ψ).
TABLE = {
    2.5: (-1.037, 4.476, -4.848, 3.583, -1.889, 0.53),
    5.0: (3.783, 8.203, -3.471, 8.074, -6.241, -5.37),
    7.5: (10.269, -0.282, -6.55, 17.238, 0.251, -7.47),
    10.0: (16.972, 6.412, -11.37, 21.324, -4.390, -6.88),
}
ROTATIONS = [2, 5]
DISPLACEMENTS = [0, 1, 3, 4]


@lru_cache
def run(cells, dt, mesh=None):
    scene, tight = flying_beam(cells=cells), ub.Newton(rtol=1e-13)
    return ub.simulate(scene, ub.EnergyMomentum(), t=(0, 10), dt=dt, mesh=mesh, newton=tight)


def ends(cells, dt):
    """Both ends at the times of the table; (4, 6)."""
    solution = run(cells, dt)
    rows = np.rint(np.array(list(TABLE)) / dt).astype(int)
    beam = solution.scene.beams[0]
    return np.hstack([solution.displacement(place)[rows] for place in (beam.start, beam.end)])


MESHES = [ub.Mesh(degree=degree, lumped=lumped) for degree in (1, 2, 3) for lumped in (False, True)]


@pytest.mark.parametrize(
    ("dt", "mesh"), [(0.01, MESHES[0]), *((0.2, mesh) for mesh in MESHES)], ids=str
)
def test_invariants_after_release(dt, mesh):
    """[closed] Free flight keeps energy and momenta at any step size, as far as 1e-13 lets it.

    The load acts in the middle of each step: the momentum is the force times the number of steps
    whose middle lies before 2.5 s.
    """
    solution = run(10, dt, mesh)
    loaded = np.sum(solution.times[1:] - dt / 2 < 2.5 - 1e-9)
    energy, momentum = solution.energy.total[loaded:], solution.momentum()[loaded:]
    assert np.ptp(energy) <= 1e-10 * energy[-1]
    assert np.ptp(momentum[:, 2]) <= 1e-10 * abs(momentum[-1, 2])
    impulse = (8 * dt * loaded, 0)  # (20, 0) where the step divides 2.5 s
    assert np.abs(momentum[:, :2] - impulse).max() <= 1e-10 * impulse[0]
    assert solution.energy.worst <= 1e-10


def test_invariants_of_the_source():
    """[calc] Total energy 379.5 ± 0.3, angular momentum -229.5: a unit of its last digit."""
    solution = run(160, 0.003125)
    assert solution.energy.total[-1] == pytest.approx(379.5, abs=0.3)
    assert solution.momentum()[-1, 2] == pytest.approx(-229.5, abs=0.1)


def test_motion_of_both_ends():
    """[calc] The table to a unit of its last digit, and the jitter by waves that no mesh resolves.

    The jitter of displacements is the difference of our two finest runs, that of rotations the
    difference from a run with the nodes and the step of the table.
    """
    finest = ends(320, 0.0015625)
    left = np.abs(finest - ends(160, 0.003125))[:, DISPLACEMENTS].max()
    jitter = np.abs(finest - ends(60, 0.00625))[:, ROTATIONS].max()
    difference = np.abs(finest - np.array(list(TABLE.values())))
    assert left < 3e-3
    assert jitter < 3e-2
    assert difference[:, DISPLACEMENTS].max() <= 1e-3 + left
    assert difference[:, ROTATIONS].max() <= 1e-2 + jitter
