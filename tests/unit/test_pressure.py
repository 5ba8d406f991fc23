# SPDX-License-Identifier: MIT
"""Pressure, which turns with the deformed axis."""

import numpy as np
import pytest
from helpers import assert_balanced, run
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)


def blown(**load):
    """A clamped beam of 2 m under a pressure that turns its tip by more than 1 rad."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=5)
    scene = clamped(beam, loads=[ub.Pressure(beam, -60.0, 40.0, **load)])
    return scene, beam


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentumStatic()])
def test_the_work_of_a_pressure_is_that_on_the_area(scheme):
    """A beam held at both ends; the area below it is quadratic in the positions of the nodes."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    supports = [ub.Pinned(beam.start), ub.Pinned(beam.end)]
    scene = ub.Scene([beam], supports=supports, loads=[ub.Pressure(beam, -200.0)])
    held = run(scene, scheme, t=(0, 0.1), dt=0.01, newton=ub.Newton(rtol=1e-12))
    x, y = np.transpose([held.position(beam.at(k / 6)) for k in range(7)], (2, 1, 0))
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
    x, y = bent.position(beam.at(0.75))[-1] - bent.position(beam.at(0.25))[-1]
    reaction = bent.reaction(scene.supports[0])[-1]
    assert reaction[:2] == pytest.approx([-40 * x - 60 * y, 60 * x - 40 * y], abs=1e-11 * 100)
    diagram = bent.diagram(beam)
    ends = [-diagram.N[0], -diagram.V[0], -diagram.M[0]]
    assert ends == pytest.approx(reaction, abs=1e-10 * 100)  # the clamp does not turn
    assert [diagram.N[-1], diagram.V[-1], diagram.M[-1]] == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_stiff_straight_beam_bears_a_pressure_as_a_line_load(degree):
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=1e9, GA=1e9, EI=1e9), cells=3)
    part = {"span": (0.1, 0.7), "profile": (3.0, -1.0)}
    diagrams = [
        run(clamped(beam, loads=[load]), ub.Static(), dt=1.0, mesh=ub.Mesh(degree=degree))
        .diagram(beam, points=5)
        for load in (ub.Pressure(beam, 5.0, 2.0, **part), ub.LineLoad(beam, (2.0, 5.0), **part))
    ]  # fmt: skip
    # 1e-8: rotations of the stiff beam
    np.testing.assert_allclose(*diagrams, rtol=0, atol=1e-7 * np.abs(diagrams[0]).max())
