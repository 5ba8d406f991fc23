# SPDX-License-Identifier: MIT
"""Pressure, which turns with the deformed axis."""

import math

from mpi4py import MPI

import numpy as np
import pytest
from helpers import assert_balanced, run
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)
SCHEMES = [ub.EnergyMomentum(), ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha(0.8)]


def blown(**load):
    """A clamped beam of 2 m under a pressure that turns its tip by more than 1 rad."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=5)
    scene = clamped(beam, loads=[ub.Pressure(beam, -60.0, 40.0, **load)])
    return scene, beam


@pytest.mark.parametrize(
    ("scheme", "degree"),
    [*zip([ub.Static(), ub.EnergyMomentumStatic(), *SCHEMES], [1, 2, 3, 1, 2], strict=True)],
)
def test_pressure_in_both_solvers(scheme, degree, as_by_reference):
    """With the amplitude, span and profile of a load in a large motion."""
    scene, beam = blown(
        amplitude=ub.Table([0, 0.2, 0.4], [0, 1, 0.5]), span=(0.2, 0.9), profile=(0.5, 1.5)
    )
    newton = ub.Newton(rtol=1e-12)
    mine = run(scene, scheme, t=(0, 0.4), dt=0.04, mesh=ub.Mesh(degree=degree), newton=newton)
    as_by_reference(mine)
    assert np.abs(mine.displacement(beam.end)).max() > 0.3


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentumStatic()])
def test_the_work_of_a_pressure_is_that_on_the_area(scheme):
    """A beam held at both ends; the area below it is quadratic in the positions of the nodes."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    supports = [ub.Pinned(beam.start), ub.Pinned(beam.end)]
    scene = ub.Scene([beam], supports=supports, loads=[ub.Pressure(beam, -200.0)])
    held = run(scene, scheme, t=(0, 0.1), dt=0.01, newton=ub.Newton(rtol=1e-12))
    nodes = held.numbering.vertices_of(beam)
    x, y = (held.numbering.points[nodes] + held.q[:, held.numbering.dofs[nodes, :2]]).transpose(
        2, 0, 1
    )
    area = (np.diff(x) * (y[:, 1:] + y[:, :-1]) / 2).sum(axis=1)
    assert np.abs(y).max() > 0.05
    assert_balanced(held.energy)
    if scheme == ub.EnergyMomentum():  # in statics the load grows within the first step
        work = held.energy.supplied["loads"]
        assert work == pytest.approx(-200.0 * area, abs=1e-11 * np.abs(work).max())


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_reactions_and_diagrams_are_in_equilibrium(degree):
    """The resultant on the chord of a loaded part; the end value of a diagram is the reaction."""
    scene, beam = blown(span=(0.25, 0.75), amplitude=lambda t: t)
    mesh = ub.Mesh(degree=degree)
    bent = run(scene, ub.Static(), dt=0.25, mesh=mesh, newton=ub.Newton(rtol=1e-13))
    x0, y0 = bent.position(beam.at(0.25))[-1]
    x1, y1 = bent.position(beam.at(0.75))[-1]
    force = np.array([40 * (x1 - x0) + 60 * (y1 - y0), 40 * (y1 - y0) - 60 * (x1 - x0)])
    reaction = bent.reaction(scene.supports[0])[-1]
    assert reaction[:2] == pytest.approx(-force, abs=1e-11 * 100)
    diagram = bent.diagram(beam)
    ends = [-diagram.N[0], -diagram.V[0], -diagram.M[0]]
    assert ends == pytest.approx(reaction, abs=1e-10 * 100)  # the clamp does not turn
    assert [diagram.N[-1], diagram.V[-1], diagram.M[-1]] == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("scheme", [ub.Static(), *SCHEMES])
def test_a_run_under_pressure_is_resumed(scheme, tmp_path):
    scene, _ = blown(amplitude=ub.ramp(0.3))
    whole = run(scene, scheme, t=(0, 0.4), dt=0.02)
    folder = MPI.COMM_WORLD.bcast(tmp_path)
    for name, end in (("half", 0.2), ("whole", 0.4)):
        file = ub.Checkpoint(folder / "run", every=5)
        resumed = run(scene, scheme, t=(0, end), dt=0.02, checkpoint=file)
        resumed.save(folder / f"{name}.npz")
    assert np.array_equal(resumed.q, whole.q)
    assert np.array_equal(ub.Solution.load(folder / "whole.npz").q, whole.q)
    half = ub.Solution.load(folder / "half.npz", scene=scene)
    continued = run(scene, scheme, t=(0.2, 0.4), dt=0.02, start=half)
    size = np.abs(whole.q).max()
    exact = scheme in (ub.Static(), ub.EnergyMomentum())  # the others know accelerations of a step
    np.testing.assert_allclose(continued.q[-1], whole.q[-1], atol=(1e-9 if exact else 1e-2) * size)


def test_processes_share_a_pressure():
    scene, beam = blown(profile=lambda s: math.sin(3 * s))
    together, alone = (
        run(scene, t=(0, 0.3), dt=0.02, comm=comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    assert np.abs(alone.displacement(beam.end)).max() > 0.1
    np.testing.assert_allclose(together.q, alone.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(together.diagram(beam).M, alone.diagram(beam).M, atol=1e-7)


def test_a_beam_of_polynomial_forces():
    """Straight and stiff, the beam bears a pressure as it bears a line load."""
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1e9, GA=1e9, EI=1e9), cells=3)
    part = {"span": (0.1, 0.7), "profile": (3.0, -1.0)}
    loads = ub.Pressure(beam, 5.0, 2.0, **part), ub.LineLoad(beam, (2.0, 5.0), **part)
    for degree in (1, 2, 3):
        mesh, diagrams = ub.Mesh(degree=degree), []
        for load in loads:
            bent = run(clamped(beam, loads=[load]), ub.Static(), dt=1.0, mesh=mesh)
            diagrams.append(np.array(bent.diagram(beam, points=5)))
        # 1e-8: rotations of the stiff beam
        np.testing.assert_allclose(*diagrams, rtol=0, atol=1e-7 * np.abs(diagrams[0]).max())


def test_buckling_refuses_pressure():
    scene, _ = blown()
    with pytest.raises(ub.ArgumentError, match="the Pressure has a stiffness of its own"):
        ub.buckling(scene, 1)


@pytest.mark.serial
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_change_of_the_tangent_of_loads_is_its_derivative(degree):
    """Differences of fourth order of the tangent itself leave 1e-9 of its change."""
    beam = ub.Beam((0, 0), (1, 2), ub.Section(EA=60.0, GA=40.0, EI=30.0), cells=2)
    loads = [
        ub.Pressure(beam, 20.0, -30.0, profile=(0.5, 2.0)),
        ub.FollowerLoad(beam.end, force=(20, -30), moment=7),
        ub.RotatingFrame(rate=3.0),
    ]
    scene, scheme = clamped(beam, loads=loads), ub.Static()
    equation = ub.Simulation(scene, scheme, mesh=ub.Mesh(degree=degree)).equation
    q, u = np.random.default_rng(degree).uniform(-0.3, 0.3, (2, equation.A.size))
    equation.begin(ub.extend.Step.create(scheme, 0.0, 1.0, 1.0, np.zeros(len(q))))

    def tangent(q):
        equation.A.data.fill(0.0)
        for term in (*equation.inner, *equation.loads):
            term.add_tangent(q)
        return equation.A.data.copy()

    h = 1e-2
    stencil = ((-2, 1), (-1, -8), (1, 8), (2, -1))
    difference = sum(weight * tangent(q + k * h * u) for k, weight in stencil) / (12 * h)
    change = equation.tangent_change(q, u)
    assert np.abs(change - difference).max() < 1e-8 * np.abs(change).max()
