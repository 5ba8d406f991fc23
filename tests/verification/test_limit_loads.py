# SPDX-License-Identifier: MIT
"""Limit loads of beams and frames, and a cantilever that breaks: S17 of the reference.

Plastic hinges are bulk cells with a yield moment M_p.  The moment of a cell is that of its middle:
where the moment has a corner, cells are a thousandth of the beam.
"""

import math

import numpy as np
import pytest
from helpers import require_no_gain
from scenes import clamped, rigid_chain

import ufl_beam as ub

M_P, EI = 1.0, 1e4  # N m, N m²
TINY = 1e-3
"""Cells where the moment has a corner, over the beam."""

SECTION = ub.Section(
    EA=1e3 * EI, GA=1e3 * EI, EI=EI, bending=ub.ElastoPlastic(M_P, isotropic=1e-8 * EI)
)
"""Cells side by side share hinges; a rotation of 20 M_p L/EI in a cell raises M by 0.02 %."""


def member(a, b, *middle, cells=1):
    """A beam with tiny cells at its ends, and at its middle if it has a corner there."""
    corners = sorted({s + d for s in (0.0, *middle, 1.0) for d in (-TINY, 0, TINY)})
    return ub.Beam(a, b, SECTION, cells=cells, corners=tuple(s for s in corners if 0 < s < 1))


def limit_load(beams, supports, place, component, size=2e-3):
    """Largest force of a support that moves ``place`` in one direction."""
    move = ub.PrescribedDisplacement(place, **{component: lambda t: size * t})
    scene = rigid_chain(beams, supports=[*supports, move])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.01)
    force = solution.reaction(move)[1:, ["u", "v", "psi"].index(component)]
    assert force[-1] == pytest.approx(force[-3], rel=1e-3)  # a plateau
    return force[-1]


def slides(place):
    """Clamped, but free to move along."""
    return ub.PrescribedDisplacement(place, v=0, psi=0)


@pytest.mark.parametrize(
    ("start", "end", "factor"),
    [(ub.Clamped, slides, 8.0), (ub.Pinned, ub.Roller, 4.0), (ub.Clamped, ub.Roller, 6.0)],
)
def test_centre_load(start, end, factor):
    """8 M_p/L between clamps, 4 M_p/L on pins, 6 M_p/L on a clamp and a pin."""
    beam = member((0, 0), (1, 0), 0.5, cells=2)
    P = limit_load([beam], [start(beam.start), end(beam.end)], beam.at(0.5), "v")
    assert pytest.approx(factor * M_P, rel=5e-3) == P


@pytest.mark.parametrize(
    ("feet", "sway", "factor"),
    [(ub.Clamped, True, 4.0), (ub.Pinned, True, 2.0), (ub.Clamped, False, -8.0)],
)
def test_mechanisms_of_a_portal(feet, sway, factor):
    """H h = 4 M_p with fixed feet, 2 M_p with pinned ones; V L = 8 M_p of the beam mechanism."""
    left, right = member((0, 0), (0, 1)), member((1, 1), (1, 0))
    roof = member((0, 1), (1, 1), 0.5, cells=2)
    place, component = (left.end, "u") if sway else (roof.at(0.5), "v")
    supports, size = [feet(left.start), feet(right.end)], math.copysign(2e-3, factor)
    force = limit_load([left, roof, right], supports, place, component, size)
    assert pytest.approx(factor * M_P, rel=5e-3) == force


@pytest.mark.parametrize(("V", "H"), [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, 1.0)])
def test_arc_length_reaches_the_mechanism_of_a_portal(V, H):
    """[closed] Beam 8 M_p/(V L), sway 4 M_p/(H h), combined 6 M_p/(V L/2 + H h); the least one.

    Displacements at the limit load are 1e-4 of the frame, so its path has a corner of 90°.
    """
    h, L, hinge = 1.0, 1.5, ub.ElastoPlastic(M_P)
    stiff = ub.Section(EA=1e9, GA=1e9, EI=EI)
    at_ends = {0.0: hinge, 1.0: hinge}
    left = ub.Beam((0, 0), (0, h), stiff, cells=2, hinges=at_ends)
    right = ub.Beam((L, h), (L, 0), stiff, cells=2, hinges=at_ends)
    roof = ub.Beam((0, h), (L, h), stiff, cells=2, hinges={0.5: hinge})
    loads = [ub.PointLoad(roof.at(0.5), force=(0, -V), amplitude=lambda t: t)] * (V > 0)
    loads += [ub.PointLoad(left.end, force=(H, 0), amplitude=lambda t: t)] * (H > 0)
    supports = [ub.Clamped(left.start), ub.Clamped(right.end)]
    scene = rigid_chain([left, roof, right], supports=supports, loads=loads)
    works = [(8, V * L), (4, H * h), (6, V * L / 2 + H * h)]
    limit = min(of_hinges * M_P / work for of_hinges, work in works if work > 0)

    path = ub.follow(scene, ub.ArcLength(0.05, factor=limit), steps=30)
    size = np.abs(path.displacement(roof.at(0.5))).max(axis=1)
    assert size[-1] > 0.2  # far along the mechanism
    assert path.factor[size < 1e-3].max() == pytest.approx(limit, rel=1e-4)


@pytest.mark.parametrize("slenderness", [1.0, 1.5])
def test_limit_of_a_crooked_column_does_not_depend_on_the_control(slenderness):
    """Between first yielding, by Perry's formula, and Euler's load; the cells add 1 %."""
    fy, E, h, b, bow = 235e6, 210e9, 0.2, 0.1, 1e-3
    fibres = ub.Fibres(ub.ElastoPlastic(fy, isotropic=1e6), number=10)
    section = ub.Section.rectangle(b, h, E=E, nu=0.3, fibres=fibres)
    squash, length = fy * b * h, slenderness * math.pi * math.sqrt(section.EI / (fy * b * h))
    column = ub.Beam.along(
        lambda s: (bow * length * math.sin(math.pi * s), length * s), section, cells=16
    )
    supports = [ub.Pinned(column.start), ub.Roller(column.end, along=(0, 1))]
    load = ub.PointLoad(column.end, force=(0, -squash), amplitude=lambda t: t)
    scene = ub.Scene([column], supports=supports, loads=[load])
    limits = [
        ub.follow(scene, ub.ArcLength(0.01, factor=factor), steps=steps).factor.max()
        for factor, steps in ((0.5, 200), (5.0, 30))
    ]
    assert limits[0] == pytest.approx(limits[1], rel=1e-7)
    η = bow * length * (h / 2) / (h**2 / 12)
    φ = (1 + η + slenderness**2) / 2
    assert 1 / (φ + math.sqrt(φ**2 - slenderness**2)) < limits[0] < 1.01 / slenderness**2


# -- a cantilever that breaks --------------------------------------------------------------------

ARMERO = {"EI": 77650e3, "M_c": 37.9e3, "M_u": 374e3, "H": 29400e3, "K_s": 18000e3}
"""N m², N m, N m, N m², N m: Armero and Ehrlich; Jukić, Brank, Ibrahimbegović."""


def test_cantilever_that_breaks():
    """[pub] F_u = 149.6 kN, 3.8854 kN m in the hinge, full opening at 0.020778 (linear softening).

    The bulk hardens from M_c on with the first modulus.  Half a unit of the last digit each; the
    bent cantilever shortens by 1e-4 of its length, half a unit is 3e-4.
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
    require_no_gain(solution.energy)
