# SPDX-License-Identifier: MIT
"""Limit loads of beams and frames, and a cantilever that breaks: S17 of the reference.

Plastic hinges are bulk cells with a yield moment M_p.  The moment of a cell stands for its middle,
so where the moment has a corner, at clamps, loads and joints, the cells are a thousandth of the
beam: the limit load is h/2 off in 1000, a twentieth of a percent.  Below a line load the largest
moment of the span lies in a cell of a fortieth of the beam: the moment of a cell is the mean of
its ends, w h²/8 below the parabola, at most 0.12 % of M_p.  Both make less than the 0.5 % asked
for.

All is small against the length: rotations are M_p L/EI = 1e-4 times a few.
"""

import math

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub

M_P, EI = 1.0, 1e4  # N m, N m²
TINY = 1e-3
"""Cells where the moment has a corner, over the beam."""


FAR = 100 * M_P / EI
"""Displacements over a metre, far above the elastic ones."""


def yields(modulus=0.0):
    law = ub.ElastoPlastic(M_P, modulus)
    return ub.Section(EA=1e3 * EI, GA=1e3 * EI, EI=EI, bending=law)


HARDLY = 1e-8 * EI
"""Modulus where two cells side by side could share a hinge; N m².

A rotation of 20 M_p L/EI in a cell of L/1000 then raises the moment by 0.02 %."""


def member(a, b, corners, section, cells=1, name="beam"):
    """A beam with tiny cells before and after each of ``corners``."""
    fine = sorted({s + d for s in corners for d in (-TINY, 0, TINY)})
    return ub.Beam(
        a, b, section, cells=cells, corners=tuple(s for s in fine if 0 < s < 1), name=name
    )


def pushed(beams, joints, supports, place, component, size=2e-3, steps=100):
    """Largest force of a support that moves ``place`` in one direction: the limit load."""
    move = ub.PrescribedDisplacement(place, **{component: lambda t: size * t})
    scene = ub.Scene(beams, joints=joints, supports=[*supports, move])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / steps)
    force = solution.reaction(move)[1:, ["u", "v", "psi"].index(component)]
    assert force[-1] == pytest.approx(force[-3], rel=1e-3)  # a plateau
    return force[-1]


def loaded(scene_of, expected):
    """Largest factor of the load that deflections of the elastic size go with.

    Beyond it there is no equilibrium, or one far away, which bears more because the bent beam is
    shorter.
    """
    scene = scene_of(lambda t: expected * t)
    try:
        solution = ub.simulate(scene, ub.Static(), t=(0, 1.02), dt=1 / 400)
    except ub.ConvergenceError as failure:
        solution = failure.solution
    return solution.times[np.abs(solution.q).max(axis=1) < FAR][-1]  # 1.02 where there is no limit


def test_cantilever():
    """P = M_p/L; M_p/(L - h/2) with the cell of h at the clamp.

    The arm shortens by half the square of the rotation, 2e-3: 2e-6.
    """
    beam = member((0, 0), (1, 0), [0.0], yields(), cells=8)
    P = pushed([beam], [], [ub.Clamped(beam.start)], beam.end, "v")
    assert pytest.approx(M_P, rel=5e-3) == P
    assert pytest.approx(M_P / (1 - TINY / 2), rel=4e-6) == P


def slides(place):
    """Clamped, but free to move along."""
    return ub.PrescribedDisplacement(place, v=0, psi=0)


@pytest.mark.parametrize(
    ("start", "end", "factor"),
    [(ub.Clamped, slides, 8.0), (ub.Pinned, ub.Roller, 4.0), (ub.Clamped, ub.Roller, 6.0)],
)
def test_centre_load(start, end, factor):
    """8 M_p/L between clamps, 4 M_p/L on pins, 6 M_p/L on a clamp and a pin."""
    beam = member((0, 0), (1, 0), [0.0, 0.5, 1.0], yields(HARDLY), cells=2)
    P = pushed([beam], [], [start(beam.start), end(beam.end)], beam.at(0.5), "v")
    assert pytest.approx(factor * M_P, rel=5e-3) == P


@pytest.mark.parametrize(
    ("end", "factor"), [(slides, 16.0), (ub.Roller, 6 + 4 * math.sqrt(2))], ids=["fixed", "propped"]
)
def test_line_load(end, factor):
    """16 M_p/L² between clamps, 11.657 M_p/L² on a clamp and a pin."""
    beam = member((0, 0), (1, 0), [0.0, 1.0], yields(), cells=41)

    def scene(time):
        load = ub.LineLoad(beam, force=(0, -M_P), amplitude=time)
        return clamped(beam, end(beam.end), loads=[load])

    assert loaded(scene, factor) == pytest.approx(1, rel=5e-3)


def portal(feet, section):
    """One metre by one metre; beams, joints and supports."""
    left = member((0, 0), (0, 1), [0.0, 1.0], section, name="left")
    roof = member((0, 1), (1, 1), [0.0, 0.5, 1.0], section, cells=2, name="roof")
    right = member((1, 1), (1, 0), [0.0, 1.0], section, name="right")
    joints = [ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.start)]
    return [left, roof, right], joints, [feet(left.start), feet(right.end)]


@pytest.mark.parametrize(("feet", "factor"), [(ub.Clamped, 4.0), (ub.Pinned, 2.0)])
def test_sway_of_a_portal(feet, factor):
    """H h = 4 M_p with fixed feet, 2 M_p with pinned ones."""
    beams, joints, supports = portal(feet, yields(HARDLY))
    H = pushed(beams, joints, supports, beams[0].end, "u")
    assert pytest.approx(factor * M_P, rel=5e-3) == H


@pytest.mark.parametrize("feet", [ub.Clamped, ub.Pinned])
def test_beam_mechanism_of_a_portal(feet):
    """V L = 8 M_p."""
    beams, joints, supports = portal(feet, yields(HARDLY))
    V = pushed(beams, joints, supports, beams[1].at(0.5), "v", size=-2e-3)
    assert pytest.approx(-8 * M_P, rel=5e-3) == V


@pytest.mark.parametrize(("feet", "sum_"), [(ub.Clamped, 6.0), (ub.Pinned, 4.0)])
def test_combined_mechanism_of_a_portal(feet, sum_):
    """H h + V L/2 = 6 M_p, or 4 M_p; it governs for V = 3 H and h = L."""
    beams, joints, supports = portal(feet, yields())

    def scene(time):
        loads = [
            ub.PointLoad(beams[0].end, force=(M_P, 0), amplitude=time),
            ub.PointLoad(beams[1].at(0.5), force=(0, -3 * M_P), amplitude=time),
        ]
        return ub.Scene(beams, joints=joints, supports=supports, loads=loads)

    assert loaded(scene, sum_ / 2.5) == pytest.approx(1, rel=5e-3)


# -- a cantilever that breaks --------------------------------------------------------------------

ARMERO = {"EI": 77650e3, "M_c": 37.9e3, "M_u": 374e3, "H": 29400e3, "K_s": 18000e3}
"""N m², N m, N m, N m², N m: Armero and Ehrlich; Jukić, Brank, Ibrahimbegović."""


def test_cantilever_that_breaks():
    """[pub] F_u = 149.6 kN, 3.8854 kN m in the hinge, full opening at 0.020778 (linear softening).

    Length 2.5 m; the bulk hardens from M_c on with the first modulus: the second, from M_y on, is
    left out, since neither the limit nor the hinge knows of it.  Half a unit of the last
    digit each; the shortening of the bent cantilever is 1e-4 of its length, half a unit 3e-4.
    """
    a, l, h = ARMERO, 2.5, 2.5e-5  # m
    bulk = ub.ElastoPlastic(a["M_c"], a["H"])
    section = ub.Section(EA=1e3 * a["EI"], GA=1e3 * a["EI"], EI=a["EI"], bending=bulk)
    law = ub.LinearSoftening(a["M_u"], a["M_u"] ** 2 / (2 * a["K_s"]))
    beam = ub.Beam((0, 0), (l, 0), section, cells=20, corners=(h / l,), hinges={0.0: law})
    push = ub.PrescribedDisplacement(beam.end, v=lambda t: 0.12 * t)
    scene = clamped(beam, push)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.005)
    F = solution.reaction(push)[1:, 1]
    M = solution.section_forces_at(beam.start)[:, 2]
    hinge = solution.material_at(beam.start)
    assert F.max() <= a["M_u"] / (l - h / 2 - 5e-4)
    opens = (hinge.jump > 0) & (1e-6 * a["M_u"] < M)
    assert opens.sum() >= 10
    # Steps do not meet the limit: the force at an opening of zero, from the branch that opens.
    F_u = np.polyval(np.polyfit(hinge.jump[opens], F[opens[1:]], 2), 0.0)
    assert F_u / 1e3 == pytest.approx(149.6, rel=0, abs=0.05)
    slope, at_zero = np.polyfit(hinge.jump[opens], M[opens], 1)
    assert -at_zero / slope == pytest.approx(0.020778, rel=0, abs=0.5e-6)
    assert hinge.hinge[-1] / 1e3 == pytest.approx(3.8854, rel=0, abs=0.5e-4)
    assert np.abs(M[hinge.jump > 0.020778]).max() <= 1e-9 * a["M_u"]
    assert (hinge.plastic > 0).any()
    for lost in solution.energy.lost.values():
        assert np.diff(lost).min() >= -1e-12 * solution.energy.energy_transferred
