# SPDX-License-Identifier: MIT
"""Defects that random combinations in space had, see ``tests/properties``."""

from dataclasses import replace

import numpy as np
import pytest
from into_space import EXACT, SKEW, InSpace, same_in_space
from test_space_analysis import flat_modes
from test_space_inelastic import (
    OTHER,
    RESULTANTS,
    SIX,
    STIFF,
    cantilever,
    in_plane,
    push,
    skew,
    square,
)

import ufl_beam as ub

RUN = {"newton": EXACT}
YIELDING = RESULTANTS["bending"]
SECTION = ub.Section(**STIFF, **OTHER)


@pytest.mark.parametrize("axes", [{"along": (1, 2, 2)}, {"axis": (0, 0, 1)}], ids=str)
def test_a_fixed_place_in_turned_axes_stays_after_start(axes):
    """It fell before; in the axes of the scene it stays, too, and the ledger closes."""
    beam = ub.Beam((0, 0, 0), (1, 0, 1), SECTION, cells=2)
    gravity = ub.Gravity((1.0, 2.0, -9.81))
    fall = ub.simulate(
        ub.Scene([beam], loads=[gravity]), ub.EnergyMomentum(), t=(0, 0.2), dt=0.02, **RUN
    )
    place = fall.position(beam.start)[-1]
    assert np.linalg.norm(place) > 0.2
    support = ub.PrescribedDisplacement(beam.start, u=0, v=0, w=0, **axes)
    held = ub.Scene([beam], loads=[gravity], supports=[support])
    run = ub.simulate(held, ub.EnergyMomentum(), t=(0.2, 0.4), dt=0.02, start=fall, **RUN)
    assert np.abs(run.position(beam.start) - place).max() < 1e-14
    assert run.energy.worst < 1e-13
    if "along" in axes:  # rotations are free
        pinned = ub.Scene([beam], loads=[gravity], supports=[ub.Pinned(beam.start)])
        other = ub.simulate(pinned, ub.EnergyMomentum(), t=(0.2, 0.4), dt=0.02, start=fall, **RUN)
        assert np.abs(run.position(beam.end) - other.position(beam.end)).max() < 1e-12


def test_modes_about_a_yielded_state_are_those_of_the_plane():
    column = cantilever(ub.Section(**STIFF, **YIELDING), in_plane, amplitude=lambda t: 3 * t)
    states = same_in_space(column, ub.Static())
    assert states[0].energy["plastic"][-1] > 0
    plane, space = (ub.modes(x.scene, n, at=x) for x, n in zip(states, (3, 12), strict=True))
    found = np.flatnonzero(flat_modes(space))[:3]
    assert np.abs(space.omega[found] / plane.omega - 1).max() < 1e-9


def test_free_motions_beside_damping():
    """A body on a ball joint at a support turns freely; others vibrate and are damped."""
    beam = ub.Beam((0, 0, 0), (0.3, 0.6, 0.4), ub.Section(**STIFF, **OTHER, **SIX), cells=2)
    body = ub.Body((0.1, -0.2, 0.15), mass=2.0, inertia=(0.3, 0.2, 0.25))
    scene = ub.Scene(
        [beam], bodies=[body], joints=[ub.Spherical(beam.start, body.at(0, 0, 0))],
        supports=[ub.Clamped(beam.start)], loads=[ub.Pressure(beam, normal=(3.0, -2.0))],
        damping=[ub.KelvinVoigt(0.09)],
    )  # fmt: skip
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=1 / 64, **RUN)
    exponents = ub.modes(scene, 6, at=run).exponents
    assert (exponents[:3] == 0).all()
    assert (exponents[3:].real < 0).all()


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["laws", "fibres"])
def test_reference_solver_with_inelastic_beams(kind):
    made, size = ub.Section(**STIFF, **OTHER, **SIX), 1.0
    if kind == "fibres":
        made, size = square(4, 0.1, ub.ElastoPlastic(355e6, isotropic=5e9)), 4e4
    scene = cantilever(made, skew, amplitude=lambda t: 20 * t, size=size)
    ordinary, plain = (
        ub.simulate(scene, ub.Static(), t=(0, 0.1), dt=0.005, newton=newton)
        for newton in (EXACT, ub.Newton(rtol=1e-12, reference=True))
    )
    end = scene.beams[0].end
    apart = np.abs(ordinary.displacement(end) - plain.displacement(end)).max()
    assert apart < 1e-10 * scene.size
    lost = [run.energy["plastic"][-1] for run in (ordinary, plain)]
    assert lost[0] > 0
    assert np.isclose(*lost, rtol=1e-9)


def test_viscosity_may_begin_with_start():
    """As in the plane, also beside laws."""
    ends, plane = [], cantilever(ub.Section(**STIFF, **YIELDING), in_plane, amplitude=push)
    for scene in (plane, InSpace(plane, SKEW).scene):
        first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.02, **RUN)
        damped = replace(scene, damping=[ub.KelvinVoigt(0.02)])
        second = ub.simulate(damped, ub.EnergyMomentum(), t=(0.5, 1), dt=0.02, start=first, **RUN)
        assert second.energy.worst < 1e-12
        assert second.energy["damping"][-1] > 0
        ends.append(second.position(scene.beams[0].end))
    lengths = [np.linalg.norm(end, axis=1) for end in ends]
    assert np.abs(lengths[0] - lengths[1]).max() < 1e-11


def bent(EI):
    made = ub.Section(**{**STIFF, "EI": EI}, **OTHER)
    return cantilever(made, skew, amplitude=lambda t: 20 * t)


def test_derivatives_of_fourth_order_are_refused():
    """Rotations turn by several Cayley vectors in a step, of which only the sum is kept."""
    with pytest.raises(ub.ArgumentError, match="not of their stages; use EnergyMomentum"):
        ub.differentiate(bent, {"EI": 500.0}, ub.EnergyMomentum(order=4), t=(0, 0.1), dt=0.02)


@pytest.mark.slow
def test_derivatives_with_decay():
    """Tables have sums of some thousand terms; differences have errors of second order."""
    scheme, h = ub.EnergyMomentumDecaying(), 0.03

    def moved(s):
        return s.displacement(s.scene.beams[0].end)

    run = ub.differentiate(bent, {"EI": 500.0}, scheme, t=(0, 0.1), dt=0.02, **RUN)
    ends = [
        moved(ub.simulate(bent(500.0 + x), scheme, t=(0, 0.1), dt=0.02, **RUN)) for x in (h, -h)
    ]
    exact = (ends[0] - ends[1]) / (2 * h)
    assert np.abs(run.of(moved)[..., 0] - exact).max() < (h / 500) * np.abs(exact).max()
