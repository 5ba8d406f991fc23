# SPDX-License-Identifier: MIT
"""Idle motions: nodes without mass between hinges that bear nothing keep their place."""

import math

import numpy as np
import pytest
from helpers import raises, run

import ufl_beam as ub
from ufl_beam.discretization.state_io import Archive

SCHEMES = [ub.EnergyMomentum(alpha=0.1, beta=0.1), ub.EnergyMomentumDecaying(), ub.Static()]
PERFECT = ub.Softening(limit=0.0, fracture_energy=1.0)


def star(number, *, hinge=None, joint=ub.Rigid, moment=0.0):
    """Clamped members that meet at the origin, where a force acts; another one on a member."""
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=1e-3)
    hinges = {} if hinge is None else {1.0: hinge}
    angles = [2 * math.pi * k / number for k in range(number)]
    feet = [(math.cos(angle), math.sin(angle)) for angle in angles]
    members = [ub.Beam(foot, (0, 0), section, cells=2, hinges=hinges) for foot in feet]
    forces = [
        ub.PointLoad(members[0].at(0.5), force=(0.0, 3.0)),
        ub.PointLoad(members[0].end, force=(1.0, 0.5), moment=moment),
    ]
    clamped = [ub.Clamped(member.start) for member in members]
    ends = [member.end for member in members]
    return ub.Scene(members, joints=[joint(*ends)], supports=clamped, loads=forces)


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
@pytest.mark.parametrize("number", [2, 5])
def test_perfect_hinges_around_a_node_are_a_revolute_joint(scheme, number):
    """The node between them is idle; members move as if it were not there, but for round-off."""
    hinged = run(star(number, hinge=PERFECT), scheme)
    jointed = run(star(number, joint=ub.Revolute), scheme)
    member, other = hinged.scene.beams[0], jointed.scene.beams[0]
    found, expected = hinged.displacement(member.at(0.5)), jointed.displacement(other.at(0.5))
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    if number > 2:  # of two members only one has a hinge, and the node turns with the other one
        assert np.abs(hinged.displacement(member.end)[:, 2]).max() < 1e-12


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_a_driven_node_is_not_idle(scheme):
    """Nothing resists a moment on the node, however small."""
    with raises("held by nothing", "at (0, 0)", kind=ub.ConvergenceError):
        run(star(3, hinge=PERFECT, moment=0.01), scheme)


def storeys(embedded):
    """A brittle frame of three storeys, hinges at the ends of all members, hit for 50 ms."""
    law = ub.Softening(30e3, 10.0)
    section = ub.Section.rectangle(
        b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0, hinge=law if embedded else None
    )
    hinges = {} if embedded else {0.0: law, 1.0: law}
    members, joints, loads = [], [], []
    for y in (0, 3, 6):
        sides = ((0, y), (0, y + 3)), ((4, y), (4, y + 3)), ((0, y + 3), (4, y + 3))
        members += [ub.Beam(a, b, section, cells=4, hinges=hinges) for a, b in sides]
    push = ub.Table([0, 0.025, 0.05], [0, 1, 0])
    for k in range(3):
        left, right, girder, *above = members[3 * k : 3 * k + 5]
        joints += [ub.Rigid(left.end, girder.start, *(x.start for x in above[:1]))]
        joints += [ub.Rigid(right.end, girder.end, *(x.start for x in above[1:]))]
        loads.append(ub.PointLoad(left.end, (200e3 * (k + 1) / 3, -20e3), amplitude=push))
    feet = [ub.Clamped(members[0].start), ub.Clamped(members[1].start)]
    return ub.Scene(members, joints=joints, supports=feet, loads=loads)


@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
@pytest.mark.parametrize("embedded", [False, True])
def test_a_frame_falls_when_all_hinges_around_its_nodes_have_broken(embedded):
    """The run goes on; what was dissipated is a whole number of fracture energies, all spent."""
    solution = ub.simulate(storeys(embedded), ub.EnergyMomentumDecaying(), t=(0, 0.15), dt=1e-3)
    energy = solution.energy
    broken = energy.lost["hinges"][-1] / 10.0
    assert broken > 11
    assert abs(broken - round(broken)) < 1e-6
    assert energy.worst < 1e-8


def test_a_run_goes_on_with_what_is_idle():
    """The state knows the idle motions: the same iterations, to the last digit, follow."""

    def after(simulation, steps):
        for n in steps:
            simulation.step_to((n + 1) * 0.1)
        return simulation

    whole, half, other = (
        ub.Simulation(star(3, hinge=PERFECT), ub.EnergyMomentum()) for _ in range(3)
    )
    after(whole, range(10))
    after(half, range(5)).save_or_restore(archive := Archive(half.subdomain))
    other.save_or_restore(Archive(other.subdomain, archive.state()))
    after(other, range(5, 10))
    assert other.iterations == whole.iterations
    assert np.array_equal(other.q, whole.q)
