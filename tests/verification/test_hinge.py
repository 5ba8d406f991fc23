# SPDX-License-Identifier: MIT
"""An embedded hinge that softens, in one cell: S17 of the reference, closed forms and limits.

The moment of a cell is that of its middle, where the hinge is.  So for a cantilever loaded at its
tip, of cells h_i at x_i from the tip, with the hinge in the cell of length h at the clamp,

    M = M(α) in that cell,  F = M/(L - h/2),  δ = F (Σ h_i x_i²/EI + L/GA) + α (L - h/2).

Linear scenes have s times the moments and s² times the energies of the reference (EI = 1000,
L = 2, M_u = 10, G_f = 5), and so s times the rotations.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import softened
from helpers import assert_balanced, require_no_gain
from scenes import rigid_chain

import ufl_beam as ub

EI, LENGTH, M_U, G_F = 1000.0, 2.0, 10.0, 5.0  # N m², m, N m, J
SHEAR = 1e-5
"""EI/(GA L²): shear makes 3e-5 of the elastic deflection."""

GA = EI / (SHEAR * LENGTH**2)
pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
"""Cells are long, and the beams of single cells short, on purpose."""

LAWS = [ub.Softening, ub.LinearSoftening]


class Hinged:
    """Two metres along x, a hinge embedded in the first cell, of length ``h`` if that is shorter.

    Attributes:
        first: The beam of that cell, without hinges at its ends.
        lengths: Of all cells; m.
    """

    def __init__(self, law, *, cells=8, h=LENGTH, rho=0.0):
        h, number = min(h, LENGTH / cells), max(cells - 1, 1)
        whole = {"EA": GA, "GA": GA, "EI": EI, "rhoA": rho, "rhoI": 1e-3 * rho}
        weak = ub.Section(**whole, hinge=law)
        self.first = ub.Beam((0, 0), (h, 0), weak, cells=1, hinges={0.0: None, 1.0: None})
        self.start, self.beams, self.lengths = self.first.start, [self.first], [h]
        if h < LENGTH:
            self.beams.append(ub.Beam((h, 0), (LENGTH, 0), ub.Section(**whole), cells=number))
            self.lengths += [(LENGTH - h) / number] * number
        self.end = self.beams[-1].end

    def scene(self, **more):
        return rigid_chain(self.beams, **more)


def turned(law, motion, scheme, *, dt, cells=1, end=1.0, rho=0.0):
    """Cantilever whose end is turned as given."""
    beam = Hinged(law, cells=cells, rho=rho)
    turn = ub.PrescribedDisplacement(beam.end, psi=motion)
    scene = beam.scene(supports=[ub.Clamped(beam.start), turn])
    return beam, ub.simulate(scene, scheme, t=(0, end), dt=dt)


# -- in a cell of a beam that yields: section 4.1 of the paper ------------------------------------


@pytest.mark.parametrize(
    ("eta", "jump", "cells"), [(0.0, 3.533765992932, 1), (2e7, 3.663166978989, 4)]
)
def test_weak_cell_of_the_paper(eta, jump, cells):
    """[calc] Section 4.1: a beam that has yielded is turned to 4π; by another solver."""
    E, K, A, I = 73e9, 2e9, 2e-4, 0.1667e-8
    law = ub.ElastoPlastic(50.0, isotropic=K * I, viscosity=ub.Perzyna(eta * I))
    whole = {"EA": E * A, "GA": E * A / 3, "EI": E * I, "bending": law}
    weak = ub.Section(**whole, hinge=ub.Softening(80.0, 100.0))
    left, right = (
        ub.Beam((x, 0), (x + 0.4, 0), ub.Section(**whole), cells=cells) for x in (0, 0.6)
    )
    middle = ub.Beam((0.4, 0), (0.6, 0), weak, cells=1, hinges={0.0: None, 1.0: None})
    turn = ub.PrescribedDisplacement(right.end, psi=lambda t: 4 * math.pi * t)
    scene = rigid_chain([left, middle, right], supports=[ub.Clamped(left.start), turn])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / 500)
    opened = solution.material_at(middle.at(0.5))
    assert opened.jump[-1] == pytest.approx(jump, rel=0, abs=1e-10)
    assert opened.hinge[-1] == pytest.approx(100 * (1 - math.exp(-0.8 * jump)), rel=1e-10)


# -- closed forms --------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("cells", "h"), [(8, 2e-6), (8, 0.1), (1, LENGTH), (64, 1.0)])
def test_tip_load(law, cells, h):
    """[closed] Force, moment and opening at three points; squares of rotations are 1e-6 at most."""
    scale = 1e-3
    law = law(scale * M_U, scale**2 * G_F)
    beam = Hinged(law, cells=cells, h=h)
    lengths = np.array(beam.lengths)
    arms = LENGTH - np.cumsum(lengths) + lengths / 2
    openings = np.array([0.1, 0.3, 0.5]) * scale
    M = softened(law, openings)
    F = M / arms[0]
    δ = F * (np.sum(lengths * arms**2) / EI + LENGTH / GA) + openings * arms[0]
    push = ub.PrescribedDisplacement(beam.end, v=ub.Table([0, 1, 2, 3], [0.0, *δ]))
    scene = beam.scene(supports=[ub.Clamped(beam.start), push])
    solution = ub.simulate(scene, ub.Static(), t=(0, 3), dt=1 / 16)
    at = [16, 32, 48]
    hinge = solution.material_at(beam.start)
    np.testing.assert_allclose(solution.reaction(push)[at, 1], F, rtol=1e-6)
    np.testing.assert_allclose(hinge.forces[at, 2], M, rtol=1e-6)
    np.testing.assert_allclose(hinge.jump[at], openings, rtol=1e-6)
    require_no_gain(solution.energy)


# -- what a complete opening dissipates ----------------------------------------------------------

BRITTLE = 0.2
"""J; the moment falls with 500 N m at most: where the beam of 500 N m drives it, no snap-back."""

COMPLETE = 30 * BRITTLE / M_U
"""rad; exponentially, exp(-25) = 1e-11 of the energy is left."""


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("cells", "steps"), [(1, 10), (4, 37), (64, 10)])
@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic(0.5)])
def test_energy_of_a_complete_opening_in_statics(law, cells, steps, scheme):
    """G_f to 1e-9, whatever the step and the mesh."""
    energy, more = 1.25 * BRITTLE, {"dt": 1 / steps, "cells": cells}
    beam, solution = turned(law(M_U, energy), lambda t: COMPLETE * t, scheme, **more)
    assert solution.energy.lost["hinges"][-1] == pytest.approx(energy, rel=1e-9)
    assert solution.material(beam.first).hinge.sum() == pytest.approx(energy, rel=1e-9)
    require_no_gain(solution.energy)
    if scheme != ub.Static():
        assert solution.energy.worst <= 1e-9


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("cells", "steps"), [(1, 233), (4, 50)])
def test_energy_of_a_complete_opening_in_dynamics(law, cells, steps):
    """G_f to 1e-9 and the ledger, with inertia, which also opens it the other way."""

    def motion(t):
        return COMPLETE * math.sin(math.pi * t / 2) ** 2

    more = {"dt": 1 / steps, "cells": cells, "rho": 1.0}
    _, solution = turned(law(M_U, BRITTLE), motion, ub.EnergyMomentum(), **more)
    assert solution.energy.lost["hinges"][-1] == pytest.approx(BRITTLE, rel=1e-9)
    assert_balanced(solution.energy)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()])
def test_cycles_dissipate_no_more_than_the_fracture_energy(law, scheme):
    """Opened to and fro, elastic between: both directions share the fracture energy."""
    energy = 1.25 * BRITTLE
    table = ub.Table([0, 1, 2, 3, 4, 5, 6], 0.02 * np.array([0, 1.5, -0.5, -2, 0.5, 2, 8]))
    rho = 0.01 if scheme.dynamic else 0.0
    beam, solution = turned(law(M_U, energy), table, scheme, dt=1 / 100, end=6, rho=rho)
    hinge = solution.material_at(beam.start)
    M = hinge.forces[:, 2]
    lost = solution.energy.lost["hinges"]
    assert lost.max() <= energy * (1 + 1e-12)
    assert lost[-1] > 0.9 * energy
    require_no_gain(solution.energy)
    growth = np.diff(hinge.jump)
    assert (growth > 0).any()
    assert (growth < 0).any()
    opening = np.concatenate([[0.0], np.cumsum(np.abs(growth))])
    if scheme.dynamic:
        assert solution.energy.worst <= 1e-9
        return
    resistance = softened(law(M_U, energy), opening)
    assert (np.abs(M) <= resistance * (1 + 1e-9) + 1e-9).all()
    moves = np.concatenate([[False], growth != 0])
    np.testing.assert_allclose(np.abs(M[moves]), resistance[moves], rtol=1e-9, atol=1e-9)
    still = growth == 0
    ψ = solution.displacement(beam.end)[:, 2]
    slope = np.diff(M)[still] / np.diff(ψ)[still]
    np.testing.assert_allclose(slope, EI / LENGTH, rtol=1e-8)


# -- limits --------------------------------------------------------------------------------------


def falling(law, *, joint=False, h=0.1):
    """Two metres of beam along x, falling about a pin at the origin; a joint, or hinge, half-way.

    The hinge is in the middle of a cell of length h; all other cells are the same in both.
    """
    stiff = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=1e-3)
    reach = 1.0 if joint else 1.0 - h / 2  # of both parts
    vertices = np.array([0.5, 0.75, 1.0 - h / 2])  # from the outer ends; m
    inner = tuple(vertices[vertices < reach] / reach)
    upper = ub.Beam((0, 0), (reach, 0), stiff, cells=1, corners=inner)
    mirrored = tuple(1 - s for s in reversed(inner))
    lower = ub.Beam((2 - reach, 0), (2, 0), stiff, cells=1, corners=mirrored)
    parts = {"supports": [ub.Pinned(upper.start)], "loads": [ub.Gravity()]}
    if joint:
        scene = ub.Scene([upper, lower], joints=[ub.Revolute(upper.end, lower.start)], **parts)
    else:
        weak = replace(stiff, hinge=law)
        middle = ub.Beam(upper.ends[1], lower.ends[0], weak, cells=1, hinges={0.0: None, 1.0: None})
        scene = rigid_chain([upper, middle, lower], **parts)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.01)
    assert_balanced(solution.energy)
    return solution.displacement(lower.end)


def test_infinite_limit_is_elastic():
    """Never opens: the elastic trajectory; a limit of 1e9 N m takes the way of the hinge there."""
    elastic = falling(None)
    np.testing.assert_array_equal(falling(ub.Softening(math.inf, 1.0)), elastic)
    for law in LAWS:
        np.testing.assert_allclose(falling(law(1e9, 1e18)), elastic, rtol=0, atol=1e-8)


@pytest.mark.parametrize("law", LAWS)
def test_no_limit_is_a_revolute_joint(law):
    """A limit of 1e-12 N m and of nothing: the motion of a revolute joint, to first order in h.

    The ends of the cell of the hinge are nearer to each other by h (1 - cos(α/2)).
    """
    errors = []
    for h in (0.1, 0.025, 0.0125):
        joint = falling(None, joint=True, h=h)
        errors.append(np.abs(falling(law(0.0, 1.0), h=h) - joint).max())
    np.testing.assert_allclose(falling(law(1e-12, 1.0)), falling(law(0.0, 1.0)), rtol=0, atol=1e-9)
    order = np.log2(np.array(errors[:-1]) / errors[1:]) / (2, 1)
    assert errors[-1] < 0.01
    assert (order > 0.9).all()


# -- snap-back -----------------------------------------------------------------------------------


def steepest(law, ratio):
    """Energy for which the moment falls ``ratio`` times as steeply as the beam can follow."""
    part = 2 if law is ub.LinearSoftening else 1
    return M_U**2 / (part * ratio * EI / LENGTH)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("cells", "steps"), [(1, 13), (4, 40), (1, 400)])
def test_snap_back_stops_statics(law, cells, steps):
    """Steeper than EI/L: no equilibrium after the limit, and the message says so there."""
    yields, brittle = M_U * LENGTH / EI, law(M_U, steepest(law, 2.0))
    with pytest.raises(ub.ConvergenceError, match="snaps back") as failure:
        turned(brittle, lambda t: 2 * yields * t, ub.Static(), dt=1 / steps, cells=cells)
    assert 0.5 - 1 / steps <= failure.value.time <= 0.5 + 1.01 / steps
    solution = failure.value.solution
    require_no_gain(solution.energy)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
def test_no_snap_back(law, scheme):
    """A little less steep than EI/L, statics goes through, and with small steps with the law."""
    yields, law = M_U * LENGTH / EI, law(M_U, steepest(law, 0.8))
    beam, solution = turned(law, lambda t: 4 * yields * t, scheme, dt=1 / 400, cells=4)
    hinge = solution.material_at(beam.start)
    opens, most = hinge.jump > 0, (1e-8 if scheme == ub.Static() else 0.05) * M_U
    expected = softened(law, hinge.jump[opens])
    np.testing.assert_allclose(hinge.forces[opens, 2], expected, rtol=0, atol=most)


def test_a_hinge_in_a_very_short_cell():
    """A flange of 0.1 mm that breaks: the jump over its length is ten thousand times its strain."""
    tube = ub.Section.tube(d=0.050, t=0.002, E=70e9, nu=0.33, rho=2700.0)
    s = 0.02 / 1.5
    hinges = {0.5 * s: ub.Softening(300.0, 20.0)}
    arm = ub.Beam((0, 0), (1.5, 0), tube, cells=3, corners=(s,), hinges=hinges)

    def hub(t):
        stop = min(max(t - 0.06, 0.0), 0.02)
        return 4.0 * (min(t, 0.06) + stop - stop**2 / 0.04)  # rad: 4 rad/s, then the brake

    scene = ub.Scene(
        [arm],
        supports=[ub.PrescribedDisplacement(arm.start, u=0, v=0, psi=hub)],
        masses=[ub.PointMass(arm.end, 2.0)],
        initial=[ub.Velocity([arm], angular=4.0)],
    )
    mesh = ub.Mesh(refine=128)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.16), dt=0.16 / 2560, mesh=mesh)
    assert solution.substeps < 1.01 * 2560
    assert solution.energy.worst < 1e-9
    assert 19.0 < solution.energy.lost["hinges"][-1] < 20.0  # J; the law never ends
