# SPDX-License-Identifier: MIT
"""Orders of convergence of cells of degree 1, 2 and 3, against closed forms.

With p points a cell, displacements and rotations at vertices converge with h^2p, and frequencies
alike.
"""

import math

import numpy as np
import pytest
from convergence.study import orders
from scenes import cantilever, clamped

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.plotting.inelastic_pictures import open_hinges

TIGHT = ub.Newton(rtol=1e-13)
MESHES = {1: (8, 16, 32), 2: (4, 8, 16), 3: (2, 4, 8)}
"""Numbers of cells by degree: errors that are neither those of a coarse mesh nor rounding."""


def tip(scene, mesh, dt=0.25):
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt, mesh=mesh, newton=TIGHT)
    return solution.displacement(scene.beams[0].end)[-1]


@pytest.mark.parametrize("degree", MESHES)
def test_half_circle(degree):
    """[closed] Rolled up by an end moment; 1.5 rad in a cell at most, next terms (1.5)²/24."""
    section = ub.Section(EA=1e4, GA=1e4, EI=500.0)
    scene = cantilever(section, length=10.0, cells=1, moment=math.pi * section.EI / 10)
    moved = [tip(scene, ub.Mesh(refine=n, degree=degree)) for n in MESHES[degree]]
    errors = np.abs(np.array(moved) - [-10, 20 / math.pi, math.pi])[:, :2].max(axis=1) / 10
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.15)
    assert errors[0] < 0.01


@pytest.mark.parametrize("slenderness", [1e2, 1e4])
@pytest.mark.parametrize("degree", MESHES)
def test_one_cell_does_not_lock(degree, slenderness):
    """[closed] One cell with a tip force: v = F l³/3EI + F l/GA, 1/4 for 1/3 at degree 1."""
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


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("degree", MESHES)
def test_orders_of_frequencies(degree, lumped):
    """Gauss-Lobatto points carry lumped masses, which keeps the order 2p."""
    errors = [abs(rod(lumped, degree, n)) for n in ((8, 16), (4, 8), (2, 4))[degree - 1]]
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.1)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize(("degree", "cells"), [(1, 16), (2, 8), (3, 4)])
def test_orders_of_motions(degree, cells, lumped):
    """A cantilever flung through half a turn, steps equal: against 16 cells of degree 3."""
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


# -- cells that yield ------------------------------------------------------------------------------

FORCE, YIELD = 2e-6, 1e-6  # N, N m; a length of 1 m and EI = 1 N m2: displacements are small
PLASTIC = {
    "front": (ub.ElastoPlastic(YIELD, isotropic=0.25), lambda M: np.maximum(M - YIELD, 0) / 0.25),
    "power": (st.RambergOsgood(YIELD, YIELD, 5), lambda M: YIELD * (M / YIELD) ** 5),
}
"""Laws of bending, and their plastic curvatures as functions of the moment."""


@pytest.mark.parametrize("kind", PLASTIC)
@pytest.mark.parametrize("degree", MESHES)
def test_curvatures_are_exact_at_gauss_points(degree, kind):
    """[calc] The displacement of three cells is a quadrature of curvature times lever arm.

    Virtual works of linear moments are integrated exactly.  Squares of rotations are below 1e-11.
    """
    law, plastic = PLASTIC[kind]
    section = ub.Section(EA=1e6, GA=1e6, EI=1.0, bending=law)
    scene = cantilever(section, cells=1, force=(0.0, FORCE))
    points, weights = np.polynomial.legendre.leggauss(degree)
    arm = 1 - (np.arange(3)[:, None] + (1 + points) / 2) / 3
    expected = np.sum(weights / 6 * arm * (FORCE * arm + plastic(FORCE * arm)))
    found = tip(scene, ub.Mesh(3, degree=degree))[1] - FORCE / section.GA
    assert found == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("degree", "cells"), [(1, 8), (2, 8), (3, 4)])
def test_orders_of_a_viscoplastic_beam(degree, cells):
    """Displacement and loss of a standard linear solid: against 16 cells of degree 3."""
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
    """[closed] L / (L - h/2) times fy b d²/4; hardening adds 4e-4, the tip turns by 1e-3."""
    law = ub.Fibres(ub.ElastoPlastic(1.0, isotropic=1.0), number=6)
    section = ub.Section.rectangle(0.1, 0.1, E=1e6, nu=0.2, fibres=law)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, 1e-4), amplitude=lambda t: t)])
    path = ub.follow(scene, ub.DisplacementControl(beam.end, "v", 1e-4), steps=10)
    borne = abs(path.reaction(scene.supports[0])[-1, 2]) / (0.1 * 0.1**2 / 4)
    assert borne == pytest.approx(1 / (1 - 1 / (2 * cells)), rel=1e-3)


@pytest.mark.parametrize("degree", [2, 3])
def test_buckling_of_one_and_two_cells(degree):
    """[closed] π²/4 of a cantilever; deformations before buckling change it by 2.5e-8."""
    scene = cantilever(ub.Section(EA=1e8, GA=1e8, EI=1.0), cells=1, force=(-1.0, 0.0))
    loads = [ub.buckling(scene, 1, mesh=ub.Mesh(n, degree=degree)).factors[0] for n in (1, 2)]
    errors = np.array(loads) / (math.pi**2 / 4) - 1
    assert 0 < errors[0] < {2: 0.016, 3: 0.0003}[degree]  # as docs/mesh.md says
    np.testing.assert_allclose(orders(errors), 2 * degree, atol=0.15)
