# SPDX-License-Identifier: MIT
"""Section forces along cells: closed forms, and equilibrium with all that acts on a beam."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub

STIFF = ub.Section(EA=1e10, GA=1e10, EI=1e9, rhoA=100.0, rhoI=1.0)
SOFT = ub.Section.rectangle(b=0.02, h=0.02, E=1e8, nu=0.3, rho=2000.0)
SOLVED = 1e-8  # part of the largest value that the tolerance of the solver, 1e-10, leaves at most


def static(scene, degree=1):
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25, mesh=ub.Mesh(degree=degree))


def supported(cells, *loads, length=6.0):
    """A beam on two supports with these loads, functions of the beam."""
    beam = ub.Beam((0, 0), (length, 0), STIFF, cells=cells)
    supports = [ub.Pinned(beam.start), ub.Roller(beam.end, along=(1, 0))]
    return ub.Scene([beam], supports=supports, loads=[load(beam) for load in loads]), beam


def close(found, exact, part=SOLVED):
    np.testing.assert_allclose(found, exact, atol=part * np.max(np.abs(exact)), rtol=0)


@pytest.mark.parametrize(("cells", "degree"), [(1, 1), (3, 1), (4, 1), (1, 2), (1, 3), (4, 3)])
def test_simply_supported_beam(cells, degree):
    """[closed] M = w x (l - x)/2, V = w (x - l/2); the deflection changes 1e-8 of them."""
    scene, beam = supported(cells, lambda b: ub.LineLoad(b, force=(0, -10e3)))
    solution = static(scene, degree)
    assert not np.any(solution.diagram(beam, 0)[1:])  # the initial state bears nothing
    s, _, V, M = solution.diagram(beam)
    x = 6.0 * s
    close(M, 10e3 * x * (6.0 - x) / 2)
    close(V, 10e3 * (x - 3.0))


def test_weight_with_a_force_and_a_couple_along_the_beam():
    """[closed] Superposition; V jumps at the force and nowhere else."""
    scene, beam = supported(
        4,
        lambda b: ub.Gravity(acceleration=(0, -10.0)),
        lambda b: ub.PointLoad(b.at(0.25), force=(0, -4e3)),
        lambda b: ub.LineLoad(b, moment=500.0),
        length=8.0,
    )
    s, _, V, M = static(scene).diagram(beam)
    x, after = 8.0 * s, np.arange(len(s)) >= 9
    left = 4e3 + 3e3 + 500.0  # [closed] reaction at the start to weight, force and couples
    close(V, -left + 1e3 * x + 4e3 * after, 1e-7)
    close(M, left * x - 500.0 * x - 1e3 * x**2 / 2 - 4e3 * (x - 2.0) * after, 1e-7)


def test_large_rotations_under_weight():
    """A hanging beam, degree 1: between vertices, too, all parts are in equilibrium."""
    beam = ub.Beam((0, 0), (1, 0.3), SOFT, cells=5)
    solution = static(clamped(beam, loads=[ub.Gravity()]))
    s, N, V, M = solution.diagram(beam, points=3)
    x = np.array([solution.position(beam.at(a))[-1, 0] for a in s])
    weight = SOFT.rhoA * 9.81 * math.hypot(1.0, 0.3)
    np.testing.assert_allclose(np.hypot(N, V), weight * (1 - s), atol=SOLVED * weight)
    # Moment of the weight beyond, at the mean of the displaced axis beyond: linear in each cell
    beyond = np.array([np.trapezoid(x[k:], s[k:]) - x[k] * (1 - s[k]) for k in range(len(s))])
    close(M, -weight * beyond)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_continuous_in_a_rotating_frame(degree):
    """N and M of a turning blade end with zero, and have no steps."""
    # [closed] N = rhoA Ω² (r_end² - r²)/2 but for the stretch, 1e-4.
    beam = ub.Beam((0.2, 0), (1.2, 0), STIFF, cells=4)
    s, N, *_ = static(clamped(beam, loads=[ub.RotatingFrame(8.0)]), degree).diagram(beam)
    close(N, 100.0 * 64.0 * (1.2**2 - (0.2 + s) ** 2) / 2, 1e-6)


def test_diagrams_of_a_quarter_ring():
    """[closed] A quarter of a ring, φ from its end: N = -P sin φ, V = P cos φ, |M| = P r sin φ."""
    # Chords of 1/16 of a right angle: N and V are exact to the square of their angle, 0.1²/8.
    angle, radius, force = np.pi / 2, 2.0, 1e3
    ring = ub.Beam.arc((0, 0), radius, (0.0, angle), STIFF, cells=16)
    scene = clamped(ring, loads=[ub.PointLoad(ring.end, force=(0, -force))])
    s, N, V, M = static(scene).diagram(ring)
    φ = angle * (1 - s)
    close(N, -force * np.sin(φ), 1.3e-3)
    close(V, force * np.cos(φ), 1.3e-3)
    np.testing.assert_allclose(np.diff([N, V])[:, 8::9], 0.0, atol=1e-6 * force)
    close(np.abs(M), force * radius * np.sin(φ), 2e-3)


def test_forces_jump_at_corners():
    """An L of one beam: N and V change places at its corner."""
    bent = ub.Beam.polyline([(0, 0), (0, 2), (2, 2)], STIFF, cells=4)
    scene = clamped(bent, loads=[ub.PointLoad(bent.end, force=(0, -1e3))])
    s, N, V, _ = static(scene).diagram(bent)
    post = np.arange(len(s)) < 18
    close(N, np.where(post, -1e3, 0.0), 1e-4)
    close(V, np.where(post, 0.0, -1e3), 1e-4)


def test_beams_in_free_fall_bear_nothing():
    beam = ub.Beam((0, 0), (2, 0), STIFF, cells=4)
    scene = ub.Scene([beam], loads=[ub.Gravity()])
    fall = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.25)
    # Round-off of EA and EI times strains of displacements of 5 m
    assert np.abs(fall.diagram(beam)[1:]).max() < 1e-4


def test_yielding_beams_and_hinges():
    """A propped cantilever with a plastic hinge: its moment is the limit, elsewhere a parabola."""
    law = ub.ElastoPlastic(yield_limit=20e3, isotropic=1.0)
    section = replace(STIFF, bending=ub.ElastoPlastic(yield_limit=30e3, isotropic=1e8))
    beam = ub.Beam((0, 0), (6, 0), section, cells=4, hinges={0.0: law}, name="prop")
    load = ub.LineLoad(beam, force=(0, -10e3), amplitude=lambda t: t)
    solution = static(clamped(beam, ub.Roller(beam.end, along=(1, 0)), loads=[load]))
    assert solution.material(beam).plastic.any()  # it yields in the field
    diagram = solution.diagram(beam)
    x = 6.0 * diagram.s
    close(diagram.M, 10e3 * x * (6.0 - x) / 2 - 20e3 * (1 - x / 6.0), 1e-5)


def test_wrong_points_and_beams_are_refused():
    scene, beam = supported(2, lambda b: ub.Gravity())
    solution = static(scene)
    with raises("diagram: points = 1 "):
        solution.diagram(beam, points=1)
    with raises("not in the scene"):
        solution.diagram(ub.Beam((0, 0), (1, 0), STIFF))
