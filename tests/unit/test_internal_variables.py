# SPDX-License-Identifier: MIT
"""Internal variables of beams by name: of solutions, simulations, DOLFINx functions and files."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from time_series import read_vtkhdf, read_xdmf

import ufl_beam as ub
from ufl_beam import structures as st

STEEL = {"E": 210e9, "nu": 0.3}


def cantilever(section, force=60e3):
    beam = ub.Beam((0, 0), (2, 0), section, cells=4, name="beam")
    load = ub.PointLoad(beam.end, force=(0.0, -force), amplitude=ub.ramp(1.0))
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


def pushed(section, force=60e3, **more):
    return ub.simulate(cantilever(section, force), ub.Static(), t=(0, 1), dt=0.1, **more)


def bending(**more):
    law = ub.ElastoPlastic(60e3, isotropic=4e5, kinematic=2e5)
    return ub.Section.rectangle(b=0.1, h=0.2, **STEEL, bending=law, **more)


@pytest.mark.parametrize("degree", [1, 2])
def test_plastic_curvatures_give_the_moments(degree):
    solution = pushed(bending(), mesh=ub.Mesh(degree=degree))
    beam = solution.scene["beam"]
    found = solution.variables(beam)
    assert [*found] == ["plastic", "accumulated"]
    assert found["plastic"].shape == (4, degree, 1)
    plastic = solution.numbering.mesh.point_weights @ found["plastic"][:, :, 0].T
    M = beam.section.EI * (solution.strains(beam)[:, 2] - plastic)
    np.testing.assert_allclose(M, solution.material(beam).forces[:, 2], rtol=1e-9)
    assert (plastic[:1] < -0.01).all()
    assert (found["accumulated"] == abs(found["plastic"])).all()


def test_fibres_have_the_order_of_the_section():
    """Fibres that may crack come last in C, and first in the section."""
    steel = ub.ElastoPlastic(250e6, isotropic=2e9)
    cover = ub.Fibres(steel, number=6, softening=ub.Softening(900e6, 1e6))
    core = ub.Fibres(ub.ElastoPlastic(200e6, isotropic=4e9))
    section = ub.Section.rectangle(b=0.1, h=0.2, **STEEL, fibres=cover, core=core, cover=0.02)
    solution = pushed(section, 120e3)
    beam, fibres = solution.scene["beam"], section.fibres
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
    solution = pushed(section)
    found = solution.variables(solution.scene["beam"])
    steel = section.fibres.material == 0
    for name, values in found.items():
        has_variable = steel if name in ("plastic", "accumulated") else ~steel
        assert (np.isfinite(values) == has_variable).all()
    assert {"plastic", "crushed", "cracked"} <= {*found}
    assert found["cracked"][0, 0, ~steel].any()


def test_a_run_has_them_at_each_step():
    class Plastic(ub.extend.Recorder):
        def open(self, simulation):
            self.largest = []

        def write(self, simulation):
            beam = simulation.scene["beam"]
            self.largest.append(abs(simulation.variables(beam)["plastic"]).max())

    record = Plastic()
    solution = pushed(bending(), record=record)
    assert record.largest[0] == 0.0
    assert (np.diff(record.largest[-3:]) > 0).all()
    end = solution.variables(solution.scene["beam"])["plastic"]
    assert record.largest[-1] == abs(end).max()


def test_functions_of_dolfinx():
    simulation = ub.Simulation(cantilever(bending()), ub.Static())
    for t in (0.5, 1.0):
        simulation.step_to(t)
        functions = simulation.dolfinx.variables
        for name, values in simulation.variables(simulation.scene["beam"]).items():
            found = functions[name].x.array
            assert (found == values[simulation.dolfinx.cells, 0, 0]).all()
            assert functions[name].name == f"state.{name}"
    assert simulation.variables(simulation.scene["beam"])["plastic"].any()
    simulation.close()


@pytest.mark.parametrize(("name", "kind"), [("a.xdmf", ub.XDMF), ("a.hdf", ub.VTKHDF)])
def test_files(name, kind, shared_path, on_first_rank):
    """Of a cell with several points, the value of the largest magnitude."""
    section = ub.Section.rectangle(
        b=0.1, h=0.2, **STEEL, fibres=ub.Fibres(ub.ElastoPlastic(250e6, isotropic=2e9), number=6)
    )
    solution = pushed(section, 120e3, record=kind(shared_path / name))
    read = read_xdmf if kind is ub.XDMF else read_vtkhdf
    series = on_first_rank(lambda: read(shared_path / name))
    for variable, values in solution.variables(solution.scene["beam"]).items():
        found = series.of(f"state.{variable}")
        assert not found[0].any()
        assert found[-1].any()
        for cell, at_points in zip(found[-1], values[:, 0], strict=True):
            assert cell in at_points
            assert abs(cell) == abs(at_points).max()


def test_the_reference_solver_has_them_too():
    one, other = (pushed(bending(), newton=ub.Newton(reference=x)) for x in (False, True))
    for name, values in one.variables(one.scene["beam"]).items():
        found = other.variables(other.scene["beam"])[name]
        np.testing.assert_allclose(found, values, atol=1e-9)


def test_a_file_of_a_solution_has_them(shared_path):
    solution = pushed(bending())
    solution.save(shared_path / "a.solution")
    loaded = ub.Solution.load(shared_path / "a.solution")
    found = loaded.variables(loaded.scene["beam"])
    assert (found["plastic"] == solution.variables(solution.scene["beam"])["plastic"]).all()


def test_what_has_none():
    section = ub.Section.rectangle(b=0.1, h=0.2, **STEEL)
    solution = pushed(section)
    with pytest.raises(ub.ArgumentError, match="the laws of beam have no internal variables"):
        solution.variables(solution.scene["beam"])
    simulation = ub.Simulation(cantilever(bending()), ub.Static())
    simulation.keep()
    with pytest.raises(ub.ArgumentError, match="the solution has no internal variables"):
        simulation.solution.variables(simulation.scene["beam"])
    assert not simulation.variables(simulation.scene["beam"])["plastic"].any()
    simulation.close()


def test_a_name_that_no_law_can_read():
    @dataclass(frozen=True)
    class Odd(ub.extend.MaterialLaw):
        variables: ClassVar = {"a/b": 0.0}

        def stress(self, strain, state):
            return self.C * strain

        def elastic_energy(self, strain, state):
            return 0.5 * self.C * strain**2

        def increments(self, strain, state, dt):
            return {"a/b": 0.0}

    with pytest.raises(ub.ModelError, match="'a/b' is no identifier"):
        ub.Section.rectangle(b=0.1, h=0.2, **STEEL, bending=Odd())
