# SPDX-License-Identifier: MIT
"""Orders of convergence of cells of degree 1, 2 and 3, against closed forms.

With p points a cell, displacements and rotations at vertices converge with h^2p, and frequencies
alike.  The problems are those of `test_roll_up.py`, `test_mattiasson_1981.py`,
`test_frequencies.py`, `test_flying_beam.py`, and cantilevers that yield.
"""

import math

import numpy as np
import pytest
from closed_forms import elastica
from convergence.study import orders
from scenes import cantilever, clamped, flying_beam

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.plotting.inelastic_pictures import open_hinges

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


# -- cells that yield ------------------------------------------------------------------------------

FORCE, YIELD = 2e-6, 1e-6  # N, N m; a length of 1 m and EI = 1 N m2: displacements are small
POWER = st.RambergOsgood(YIELD, YIELD, 5)
PLASTIC = {
    "front": (ub.ElastoPlastic(YIELD, isotropic=0.25), lambda M: np.maximum(M - YIELD, 0) / 0.25),
    "power": (POWER, lambda M: YIELD * (M / YIELD) ** 5),
}
"""Laws of bending, and their plastic curvatures as functions of the moment."""


def yielding_tip(law, mesh):
    """Displacement of the end by curvature alone, under FORCE."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1.0, bending=law)
    scene = cantilever(section, cells=1, force=(0.0, FORCE))
    return tip(scene, mesh)[1] - FORCE / section.GA


@pytest.mark.parametrize("kind", PLASTIC)
@pytest.mark.parametrize("degree", MESHES)
def test_curvatures_are_exact_at_gauss_points(degree, kind):
    """[calc] One displacement is a quadrature of curvature times lever arm, also by three cells.

    Moments of a cantilever are known, and virtual works of linear moments are integrated exactly.
    Squares of rotations are below 1e-11.
    """
    law, plastic = PLASTIC[kind]
    points, weights = np.polynomial.legendre.leggauss(degree)
    arm = 1 - (np.arange(3)[:, None] + (1 + points) / 2) / 3
    expected = np.sum(weights / 6 * arm * (FORCE * arm + plastic(FORCE * arm)))
    assert yielding_tip(law, ub.Mesh(3, degree=degree)) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("degree", MESHES)
def test_orders_of_a_power_law(degree):
    """[closed] The curvature is a polynomial of degree 5, so that three cells suffice."""
    exact = FORCE / 3 + YIELD * (FORCE / YIELD) ** 5 / 7
    measured, errors = convergence(degree, lambda mesh: abs(yielding_tip(POWER, mesh) / exact - 1))
    np.testing.assert_allclose(measured, 2 * degree, atol=0.1)
    assert errors[0] < 0.03


@pytest.mark.parametrize(("degree", "cells"), [(1, 8), (2, 8), (3, 4)])
def test_orders_of_a_viscoplastic_beam(degree, cells):
    """A standard linear solid, bent by 0.7 rad: against 16 cells of degree 3, equal steps.

    The displacements of the end, and the energy that the beam has dissipated.
    """
    law = ub.ElastoPlastic(0.0, kinematic=25.0, viscosity=ub.Perzyna(2.5))
    scene = cantilever(
        ub.Section(EA=1e4, GA=1e4, EI=25.0, bending=law), cells=1, force=(0.0, 25.0),
        time=lambda t: math.sin(4 * t) ** 4,
    )  # fmt: skip

    def end(mesh):
        solution = ub.simulate(scene, ub.Static(), t=(0, 0.4), dt=0.02, mesh=mesh, newton=TIGHT)
        moved = solution.displacement(scene.beams[0].end)[-1]
        return np.append(moved, solution.energy.lost["plastic"][-1])

    exact = end(ub.Mesh(16, degree=3))
    errors = [np.abs(end(ub.Mesh(n, degree=degree)) / exact - 1) for n in (cells, 2 * cells)]
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.15)


@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")  # of the place in a long cell
@pytest.mark.parametrize("degree", [2, 3])
def test_hinges_in_cells_are_at_gauss_points(degree):
    """The first Gauss point opens, as a hinge of zero length there; displacements are small."""
    law = ub.Softening(1e-6, 4e-12)  # N m, J; within 4e-6 rad
    elastic = {"EA": 1e6, "GA": 1e6, "EI": 1.0}
    at = (1 + np.polynomial.legendre.leggauss(degree)[0][0]) / 2
    mesh = ub.Mesh(degree=degree)

    def run(hinges, **more):
        beam = ub.Beam((0, 0), (1, 0), ub.Section(**elastic, **more), cells=1, hinges=hinges)
        lift = ub.PrescribedDisplacement(beam.end, v=lambda t: 2e-6 * t)
        scene = clamped(beam, lift)
        solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.05, mesh=mesh, newton=TIGHT)
        return beam, solution, scene.supports[-1]

    beam, found, lift = run({0.0: None, 1.0: None}, hinge=law)
    _, expected, other = run({at: law})
    np.testing.assert_allclose(
        found.reaction(lift)[:, 1], expected.reaction(other)[:, 1], rtol=0, atol=1e-8 * law.limit
    )
    lost = expected.energy.lost["hinges"]
    np.testing.assert_allclose(found.energy.lost["hinges"], lost, rtol=0, atol=1e-8 * lost[-1])
    assert lost[-1] > 0.1 * law.fracture_energy
    (row,) = st.hinge_table(found).rows
    assert row.where == beam.at(at)
    (mark,) = open_hinges(found, -1, lambda place: place.point)
    np.testing.assert_allclose(mark.at, [at, 0.0], rtol=0, atol=1e-15)
    assert mark.fraction == pytest.approx(lost[-1] / law.fracture_energy, rel=1e-8)
    # |V| before the opening, times the distance from the end of the cell
    shift = at * found.reaction(lift)[np.argmax(lost > 0) - 1, 1] / law.limit
    assert found.hinge_place_error() == {beam: pytest.approx(shift, rel=1e-9)}


@pytest.mark.parametrize("degree", [2, 3])
def test_a_cell_is_a_mixed_member(degree):
    """[closed] N and V are constant and M is linear in a cell without loads, though fibres yield.

    Differences are those of the rotation, below 2e-5, which turns the forces.
    """
    law = ub.Fibres(ub.ElastoPlastic(0.1, isotropic=5e4), number=6)
    section = ub.Section.rectangle(0.1, 0.1, E=1e6, nu=0.2, fibres=law)  # yields at 1e-7
    force = np.array([2e-4, 4e-5])
    scene = cantilever(section, cells=1, force=tuple(force))
    solution = ub.simulate(
        scene, ub.Static(), t=(0, 1), dt=0.25, mesh=ub.Mesh(degree=degree), newton=TIGHT
    )
    N, V, M, _, plastic, _ = solution.column("material")[-1:, :][0].T
    arm = 1 - (1 + np.polynomial.legendre.leggauss(degree)[0]) / 2
    most = 2e-5 * force.max()
    assert (plastic > 0).any()
    assert abs(solution.displacement(scene.beams[0].end)[-1, 2]) < 2e-5
    np.testing.assert_allclose(N, force[0], rtol=0, atol=most)
    np.testing.assert_allclose(V, force[1], rtol=0, atol=most)
    np.testing.assert_allclose(M, force[1] * arm, rtol=0, atol=most)


@pytest.mark.parametrize("cells", [4, 8])
def test_the_base_of_linear_cells_bears_more_than_the_section(cells):
    """[closed] L / (L - h/2) times fy b d²/4: the middle of the first cell flows in all layers.

    Hardening adds 4e-4, and the rotation of the tip is 1e-3.
    """
    law = ub.Fibres(ub.ElastoPlastic(1.0, isotropic=1.0), number=6)
    section = ub.Section.rectangle(0.1, 0.1, E=1e6, nu=0.2, fibres=law)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    push = ub.PointLoad(beam.end, force=(0, 1e-4), amplitude=lambda t: t)
    foot = ub.Clamped(beam.start)
    scene = ub.Scene([beam], supports=[foot], loads=[push])
    path = ub.follow(scene, ub.DisplacementControl(beam.end, "v", 1e-4), steps=10)
    borne = abs(path.reaction(foot)[-1, 2]) / (0.1 * 0.1**2 / 4)
    assert borne == pytest.approx(1 / (1 - 1 / (2 * cells)), rel=1e-3)


@pytest.mark.parametrize("degree", [2, 3])
def test_buckling_of_one_and_two_cells(degree):
    """[closed] π²/4 of a cantilever; deformations before buckling change it by 2.5e-8."""
    scene = cantilever(ub.Section(EA=1e8, GA=1e8, EI=1.0), cells=1, force=(-1.0, 0.0))
    loads = [ub.buckling(scene, 1, mesh=ub.Mesh(n, degree=degree)).factors[0] for n in (1, 2)]
    errors = np.array(loads) / (math.pi**2 / 4) - 1
    assert 0 < errors[0] < {2: 0.016, 3: 0.0003}[degree]  # as docs/mesh.md says
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.15)
