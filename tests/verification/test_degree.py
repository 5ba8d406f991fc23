# SPDX-License-Identifier: MIT
"""Orders of convergence of cells of degree 1, 2 and 3, against closed forms.

With p points a cell, displacements and rotations at vertices converge with h^2p, and frequencies
alike.  The problems are those of `test_roll_up.py`, `test_mattiasson_1981.py`,
`test_frequencies.py`, `test_flying_beam.py`.
"""

import math

import numpy as np
import pytest
from closed_forms import elastica
from convergence.study import orders
from scenes import cantilever, flying_beam

import ufl_beam as ub

TIGHT = ub.Newton(rtol=1e-13)
MESHES = {1: (8, 16, 32), 2: (4, 8, 16), 3: (2, 4, 8)}
"""Numbers of cells by degree: errors that are neither those of a coarse mesh nor rounding."""


def tip(scene, mesh, dt=0.25):
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt, mesh=mesh, newton=TIGHT)
    return solution.displacement(scene.beams[0].end)[-1]


def convergence(degree, error):
    """Measured orders, and the errors that they are of."""
    errors = [error(ub.Mesh(refine=n, degree=degree)) for n in MESHES[degree]]
    return orders(errors), errors


@pytest.mark.parametrize("degree", MESHES)
def test_half_circle(degree):
    """[closed] Rolled up by an end moment; 1.5 rad in a cell at most, next terms (1.5)²/24."""
    section = ub.Section(EA=1e4, GA=1e4, EI=500.0)
    scene = cantilever(section, length=10.0, cells=1, moment=math.pi * section.EI / 10)
    exact = [-10, 20 / math.pi, math.pi]
    measured, errors = convergence(
        degree, lambda mesh: np.abs(tip(scene, mesh) - exact)[:2].max() / 10
    )
    np.testing.assert_allclose(measured, 2 * degree, atol=0.15)
    assert errors[0] < 0.01


@pytest.mark.parametrize("degree", MESHES)
def test_elastica(degree):
    """[closed] What is linear in shear and axial strains, a/GA = 4e-7, is extrapolated to none."""

    def error(mesh):
        soft, stiff = (
            tip(cantilever(ub.Section(EA=E, GA=E, EI=1.0), cells=1, force=(0.0, 4.0)), mesh)
            for E in (1e7, 2e7)
        )
        return np.abs(2 * stiff - soft - elastica(4.0)).max()

    measured, errors = convergence(degree, error)
    np.testing.assert_allclose(measured, 2 * degree, atol=0.2)  # 6.14 on four cells
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("slenderness", [1e2, 1e4])
@pytest.mark.parametrize("degree", MESHES)
def test_one_cell_does_not_lock(degree, slenderness):
    """[closed] One cell of a cantilever with a tip force: v = F l³/3EI + F l/GA, ψ = F l²/2EI.

    Two Gauss points integrate a quadratic curvature exactly, so degrees 2 and 3 are exact; one
    point takes the moment of the middle, 1/4 instead of 1/3, however slender the beam is.
    """
    h = 1 / slenderness
    section = ub.Section.rectangle(b=1.0, h=h, E=1e12, nu=0.3, rho=1.0)
    force = 3e-6 * section.EI  # so small that squares of rotations are 1e-12
    scene = cantilever(section, cells=1, force=(0.0, force))
    _, v, ψ = tip(scene, ub.Mesh(degree=degree), dt=1.0)
    bent = (1 / 3 if degree > 1 else 1 / 4) * force / section.EI
    assert v == pytest.approx(bent + force / section.GA, rel=1e-6)
    assert ψ == pytest.approx(force / section.EI / 2, rel=1e-6)


def rod(lumped, degree, n):
    """First axial frequency of a rod held at one end over that of the continuum, less 1."""
    section = ub.Section(EA=1.0, GA=1.0, EI=1e9, rhoA=1.0, rhoI=1.0, depth=0.1)
    beam = ub.Beam((0, 0), (1, 0), section, cells=n)
    supports = [ub.Clamped(beam.start), ub.Roller(beam.end, along=(1, 0))]
    modes = ub.modes(
        ub.Scene([beam], supports=supports), 3, mesh=ub.Mesh(degree=degree, lumped=lumped)
    )
    return modes.omega[np.argmin(np.abs(modes.omega - math.pi / 2))] / (math.pi / 2) - 1


def test_lumped_mass_of_a_rod():
    """[closed] Below, ω h = 2 sin(kh/2); consistent above, ω² h² = 6 (1 - cos kh)/(2 + cos kh)."""
    for n in (4, 16):
        kh = math.pi / 2 / n
        assert rod(True, 1, n) == pytest.approx(2 * math.sin(kh / 2) / kh - 1, rel=1e-8)
        consistent = math.sqrt(6 * (1 - math.cos(kh)) / (2 + math.cos(kh))) / kh - 1
        assert rod(False, 1, n) == pytest.approx(consistent, rel=1e-8)
        assert rod(True, 1, n) < 0 < rod(False, 1, n)


def test_lumped_mass_of_a_slender_beam():
    """Its first bending frequency errs by a third of what it does else, as measured."""
    section = ub.Section(EA=1e9, GA=1e9, EI=1e3, rhoA=2.0, rhoI=1e-9)
    beam = ub.Beam((0, 0), (1, 0), section, cells=8)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end, along=(1, 0))])
    full, lumped = (
        ub.modes(scene, 1, mesh=ub.Mesh(lumped=lumped)).omega[0] / math.pi**2 / 500**0.5 - 1
        for lumped in (False, True)
    )
    assert 0 < lumped < full < 0.02
    assert lumped / full == pytest.approx(1 / 3, rel=0.02)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("degree", MESHES)
def test_orders_of_frequencies(degree, lumped):
    """Gauss-Lobatto points carry lumped masses, which keeps the order 2p."""
    errors = [abs(rod(lumped, degree, n)) for n in ((8, 16), (4, 8), (2, 4))[degree - 1]]
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.1)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("degree", MESHES)
@pytest.mark.parametrize("dt", [0.05, 0.2])
def test_energy_and_momentum_are_exact(degree, lumped, dt):
    """Free flight after the load is gone, as in `test_flying_beam.py`, on four cells."""
    scene = flying_beam(cells=4)
    solution = ub.simulate(
        scene, ub.EnergyMomentum(), t=(0, 6), dt=dt, mesh=ub.Mesh(degree=degree, lumped=lumped),
        newton=TIGHT,
    )  # fmt: skip
    free = solution.times > 2.5 + dt
    energy, momentum = solution.energy.total[free], solution.momentum()[free]
    assert np.ptp(energy) <= 1e-10 * energy[-1]
    assert np.ptp(momentum[:, 2]) <= 1e-10 * abs(momentum[-1, 2])
    assert np.ptp(momentum[:, :2], axis=0).max() <= 1e-10 * np.abs(momentum[-1, :2]).max()
    assert solution.energy.worst <= 1e-10


@pytest.mark.parametrize("degree", [2, 3])
def test_exact_statics_closes_the_ledger(degree):
    scene = cantilever(cells=2, force=(0.0, 5.0), time=lambda t: t)
    solution = ub.simulate(
        scene, ub.EnergyMomentumStatic(0.5), t=(0, 1), dt=0.25, mesh=ub.Mesh(degree=degree),
        newton=TIGHT,
    )  # fmt: skip
    assert solution.energy.worst < 1e-10


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize(("degree", "cells"), [(1, 16), (2, 8), (3, 4)])
def test_orders_of_motions(degree, cells, lumped):
    """A cantilever flung through half a turn, steps equal: against 16 cells of degree 3.

    Their error is 16⁻⁶ of that of one cell; orders are reached to a tenth and some, as measured.
    """
    section = ub.Section(EA=1e4, GA=1e4, EI=500.0, rhoA=1.0, rhoI=0.1)
    scene = cantilever(
        section, length=10.0, cells=1, force=(0.0, 60.0),
        time=lambda t: math.sin(math.pi * min(t, 2.0) / 2) ** 4,
    )  # fmt: skip

    def end(mesh):
        solution = ub.simulate(
            scene, ub.EnergyMomentum(), t=(0, 3), dt=0.02, mesh=mesh, newton=TIGHT
        )
        return solution.displacement(scene.beams[0].end)[-1]

    exact = end(ub.Mesh(16, degree=3))
    errors = [
        np.abs(end(ub.Mesh(n, degree=degree, lumped=lumped)) - exact).max()
        for n in (cells, 2 * cells)
    ]
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.6)


@pytest.mark.parametrize("degree", [2, 3])
def test_a_decaying_scheme_knows_what_it_takes(degree):
    """Also where it remembers strains in the points of the cells."""
    scene, mesh = flying_beam(cells=4), ub.Mesh(degree=degree)
    more = {"dt": 0.1, "newton": TIGHT}
    first = ub.simulate(scene, ub.EnergyMomentumDecaying(), t=(0, 4), mesh=mesh, **more)
    lost = first.energy.lost["numerical"]
    assert first.energy.worst <= 1e-10
    assert 0 < lost[-1] < 0.1 * first.energy.total[-1]
