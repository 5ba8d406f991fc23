# SPDX-License-Identifier: MIT
"""Internal variables of beams by name: of solutions, simulations, DOLFINx functions and files."""

from typing import ClassVar

import numpy as np
import pytest
from helpers import AfterEachStep, raises
from scenes import clamped
from time_series import read_vtkhdf, read_xdmf
from user_laws import Dashpot

import ufl_beam as ub
from ufl_beam import structures as st

STEEL = {"E": 210e9, "nu": 0.3}
BENDING = ub.Section.rectangle(
    b=0.1, h=0.2, **STEEL, bending=ub.ElastoPlastic(60e3, isotropic=4e5, kinematic=2e5)
)


def cantilever(section, force=60e3):
    beam = ub.Beam((0, 0), (2, 0), section, cells=4, name="beam")
    load = ub.PointLoad(beam.end, force=(0.0, -force), amplitude=ub.ramp(1.0))
    return beam, clamped(beam, loads=[load])


def pushed(section, force=60e3, **more):
    beam, scene = cantilever(section, force)
    return beam, ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, **more)


@pytest.mark.parametrize(("degree", "reference"), [(1, False), (2, False), (1, True)])
def test_plastic_curvatures_give_the_moments(degree, reference, shared_path):
    beam, solution = pushed(
        BENDING, mesh=ub.Mesh(degree=degree), newton=ub.Newton(reference=reference)
    )
    found = solution.variables(beam)
    assert [*found] == ["plastic", "accumulated"]
    assert found["plastic"].shape == (4, degree, 1)
    plastic = solution.numbering.mesh.point_weights @ found["plastic"][:, :, 0].T
    M = beam.section.EI * (solution.strains(beam)[:, 2] - plastic)
    np.testing.assert_allclose(M, solution.material(beam).forces[:, 2], rtol=1e-9)
    assert (plastic[:1] < -0.01).all()
    assert (found["accumulated"] == abs(found["plastic"])).all()
    solution.save(shared_path / "a.solution")
    loaded = ub.Solution.load(shared_path / "a.solution")
    assert (loaded.variables(loaded.scene["beam"])["plastic"] == found["plastic"]).all()


def test_fibres_have_the_order_of_the_section():
    """Fibres that may crack come last in C, and first in the section."""
    steel = ub.ElastoPlastic(250e6, isotropic=2e9)
    cover = ub.Fibres(steel, number=6, softening=ub.Softening(900e6, 1e6))
    core = ub.Fibres(ub.ElastoPlastic(200e6, isotropic=4e9))
    section = ub.Section.rectangle(b=0.1, h=0.2, **STEEL, fibres=cover, core=core, cover=0.02)
    (beam, solution), fibres = pushed(section, 120e3), section.fibres
    plastic = solution.variables(beam)["plastic"][:, 0]
    assert plastic.shape == (4, len(fibres.y))
    e = solution.strains(beam)
    stress = fibres.E * (e[:, :1] - fibres.y * e[:, 2:] - plastic)
    forces = np.column_stack([stress @ fibres.A, -stress @ (fibres.A * fibres.y)])
    expected = solution.material(beam).forces[:, [0, 2]]
    np.testing.assert_allclose(forces, expected, atol=1e-6 * abs(expected).max())
    assert np.count_nonzero(plastic[0]) > 4


def test_laws_of_several_classes():
    """Concrete has no plastic strain, and steel no crushing."""
    concrete = ub.Fibres(st.KentPark(30e6, 0.002, 0.01), number=8)
    bars = ub.Fibres(ub.ElastoPlastic(400e6, isotropic=1e9))
    section = ub.Section.rectangle(b=0.3, h=0.4, E=30e9, nu=0.2, fibres=concrete)
    section = section.reinforced(y=[-0.15, 0.15], A=[1e-3, 1e-3], E=200e9, fibres=bars)
    beam, solution = pushed(section)
    found, steel = solution.variables(beam), section.fibres.material == 0
    for name, values in found.items():
        has_variable = steel if name in ("plastic", "accumulated") else ~steel
        assert (np.isfinite(values) == has_variable).all()
    assert {"plastic", "crushed", "cracked"} <= {*found}
    assert found["cracked"][0, 0, ~steel].any()


def test_a_run_has_them_at_each_step():
    """Also as functions of DOLFINx."""
    largest, differ = [], []

    def look(simulation):
        values = simulation.variables(simulation.scene["beam"])
        largest.append(abs(values["plastic"]).max())
        for name, function in simulation.dolfinx.variables.items():
            assert function.name == f"state.{name}"
            cells = simulation.dolfinx.cells
            differ.append((function.x.array != values[name][cells, 0, 0]).any())

    beam, solution = pushed(BENDING, record=AfterEachStep(look))
    assert largest[0] == 0.0
    assert (np.diff(largest[-3:]) > 0).all()
    assert largest[-1] == abs(solution.variables(beam)["plastic"]).max()
    assert len(differ) == 2 * len(largest)
    assert not any(differ)


@pytest.mark.parametrize(("name", "kind"), [("a.xdmf", ub.XDMF), ("a.hdf", ub.VTKHDF)])
def test_files(name, kind, shared_path, on_first_rank):
    """Of a cell with several points, the value of the largest magnitude."""
    layers = ub.Fibres(ub.ElastoPlastic(250e6, isotropic=2e9), number=6)
    section = ub.Section.rectangle(b=0.1, h=0.2, **STEEL, fibres=layers)
    beam, solution = pushed(section, 120e3, record=kind(shared_path / name))
    read = read_xdmf if kind is ub.XDMF else read_vtkhdf
    series = on_first_rank(lambda: read(shared_path / name))
    for variable, values in solution.variables(beam).items():
        found = series.of(f"state.{variable}")
        assert not found[0].any()
        assert found[-1].any()
        for cell, at_points in zip(found[-1], values[:, 0], strict=True):
            assert cell in at_points
            assert abs(cell) == abs(at_points).max()


def test_what_has_none():
    beam, solution = pushed(ub.Section.rectangle(b=0.1, h=0.2, **STEEL))
    with raises("the laws of beam have no internal variables"):
        solution.variables(beam)
    beam, scene = cantilever(BENDING)
    simulation = ub.Simulation(scene, ub.Static())
    simulation.keep()
    with raises("the solution has no internal variables"):
        simulation.solution.variables(beam)
    simulation.close()


def test_a_name_that_no_law_can_read():
    class Odd(Dashpot):
        variables: ClassVar = {"a/b": 0.0}

    with raises("'a/b' is no identifier", kind=ub.ModelError):
        ub.Section.rectangle(b=0.1, h=0.2, **STEEL, bending=Odd(1.0))
