# SPDX-License-Identifier: MIT
"""Static paths through limit points, bifurcations and snap-backs: S5, S7, S8, S17 of the reference.

[calc] values are those of an independent converged solution, with the digits that are given.
Limits are Richardson's of two meshes; the fourth order may leave a fifteenth of the change from the
mesh before, doubled for the orders above.
"""

import math

import numpy as np
import pytest
from closed_forms import buckled_column, softened
from convergence.study import extrapolated
from scenes import clamped, rigid_chain

import ufl_beam as ub


def growing(t):
    return t


def two_critical_points(now):
    return len(now.solution.critical) == 2


def assert_reaches(coarse, medium, fine, reference, digits):
    """Richardson's limit is the reference to half a unit of its last digit and the fourth order."""
    before, limit = (
        extrapolated(*map(np.array, pair)) for pair in ((coarse, medium), (medium, fine))
    )
    left = 2 / 15 * np.abs(limit - before)
    assert (np.abs(limit - reference) <= 0.51 * np.array(digits) + left).all(), (limit, left)


# -- S5: Lee's frame ---------------------------------------------------------------------------


def lee(cells, *, moved=False):
    """(place, support, scene); a load of 1 kN down at 24 cm from the corner, or the place moved."""
    A, I, E, nu = 6e-4, 2e-8, 72e9, 0.3  # m², m⁴, Pa
    section = ub.Section(EA=E * A, GA=E * A / (2 * (1 + nu)), EI=E * I)
    column = ub.Beam((0, 0), (0, 1.2), section, cells=cells, name="column")
    girder = ub.Beam((0, 1.2), (1.2, 1.2), section, cells=cells, name="girder")
    place = girder.at(0.2)
    push = ub.PrescribedDisplacement(place, v=lambda t: -t)
    scene = rigid_chain(
        [column, girder],
        supports=[ub.Pinned(column.start), ub.Pinned(girder.end), *([push] if moved else [])],
        loads=[] if moved else [ub.PointLoad(place, force=(0, -1e3), amplitude=growing)],
    )
    return place, push, scene


def test_lee_frame_limit_points():
    """[calc] (P in kN, v and u in cm); P is flat where it turns, so v and u have a digit less."""
    results = []
    for cells in (25, 50, 100):
        place, _, scene = lee(cells)
        path = ub.follow(scene, ub.ArcLength(0.04, factor=10), until=two_critical_points)
        assert [point.kind for point in path.critical] == ["limit", "limit"]
        u, v, _ = 100 * path.displacement(place)[[point.n for point in path.critical]].T
        results.append(np.column_stack([[point.factor for point in path.critical], -v, u]))
    reference = [[18.5466, 48.751, 26.879], [-9.3961, 58.224, 90.181]]
    assert_reaches(*results, reference, [1e-4, 2e-3, 2e-3])


def test_lee_frame_turning_points():
    """[calc] Where the place turns back, v (cm) and P (kN): limit points of a motion.

    v is flat there, so P has a digit less.
    """
    results = []
    for cells in (25, 50, 100):
        _, push, scene = lee(cells, moved=True)
        path = ub.follow(scene, ub.ArcLength(0.04), until=two_critical_points)
        P = -path.reaction(push)[[point.n for point in path.critical], 1] / 1e3
        results.append(np.column_stack([[100 * point.factor for point in path.critical], P]))
    assert_reaches(*results, [[61.013, 11.944], [50.737, -4.360]], [1e-3, 2e-3])


# -- S7: deep arch -----------------------------------------------------------------------------


def test_a_deep_arch_has_its_two_limit_loads():
    """[calc] 897.287, which [pub] DaDeppo and Schmidt 1975 give as 897; the minimum after it.

    The cells are chords of the arc.  v of a maximum that is flat has two digits less than P.
    """
    results = []
    for cells in (40, 80, 160):
        half = math.radians(215 / 2)
        section = ub.Section(EA=1e8, GA=1e8, EI=1e6)
        angles = (math.pi / 2 + half, math.pi / 2 - half)
        arch = ub.Beam.arc((0, 0), 100.0, angles, section, cells=cells)
        apex = arch.at(0.5)
        scene = clamped(
            arch,
            ub.Pinned(arch.end),
            loads=[ub.PointLoad(apex, force=(0, -1000), amplitude=growing)],
        )
        path = ub.follow(scene, ub.ArcLength(0.04), until=two_critical_points)
        assert [point.kind for point in path.critical] == ["limit", "limit"]
        u, v, _ = path.displacement(apex)[[point.n for point in path.critical]].T
        factors = np.array([point.factor for point in path.critical])
        results.append(np.array([*(1000 * factors), -v[0], u[0], -v[1]]))
    reference = [897.287, -73.05, 113.727, 61.141, 122.07]
    assert_reaches(*results, reference, [1e-3, 1e-2, 1e-2, 2e-3, 2e-2])


# -- S8: Euler's column ------------------------------------------------------------------------


def column(cells, section, P):
    """A perfect column of unit length, clamped at its foot, loaded along its axis."""
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    load = ub.PointLoad(beam.end, force=(-P, 0), amplitude=growing)
    return beam, clamped(beam, loads=[load])


@pytest.mark.parametrize("cells", [4, 32])
@pytest.mark.parametrize(("EA", "GA"), [(1e8, 1e8), (200.0, 50.0), (50.0, 1e4)])
def test_critical_load(cells, EA, GA):
    """[closed] P (1 - P/EA + P/GA) = 4 EI/h² tan²(π h/4L), which tends to π² EI/4L²; also buckling.

    With cells h in ψ'' EI + P v' = 0, v' = (1 - P/EA + P/GA) ψ: ψ' is a difference, v' a mean of
    both ends.  The point is located to 1e-7 of a step.
    """
    _, scene = column(cells, ub.Section(EA=EA, GA=GA, EI=1.0), 1.0)
    path = ub.follow(scene, ub.ArcLength(0.2), until=lambda now: now.t > 3)
    (point,) = path.critical
    assert point.kind == "bifurcation"
    near = ub.simulate(scene, ub.Static(), t=(0, 0.999 * point.factor), dt=3.0)
    more = ub.buckling(scene, 1, t=point.factor, at=near).factors[0]
    factors = point.factor, point.factor * (0.999 + 0.001 * more), ub.buckling(scene, 1).factors[0]
    for P in factors:
        left = P * (1 - P / EA + P / GA)
        assert left == pytest.approx(4 * cells**2 * math.tan(math.pi / 4 / cells) ** 2, rel=1e-7)
    # The path goes on straight.
    assert np.abs(path.q[-1][path.numbering.dofs[:, 1:]]).max() < 1e-6


DEGREES = np.array([20, 40, 60, 80, 100, 120, 140, 160, 176])


def test_branch_to_the_elastica():
    """[closed] Load and end position at nine angles; strains of axis and shear are 1e-8 P."""
    exact = [buckled_column(α) for α in np.radians(DEGREES)]
    # [pub] Timoshenko and Gere, table 2-4
    np.testing.assert_allclose(exact[-1], [9.1162, -0.5772, 0.4214], rtol=0, atol=0.51e-4)
    results = []
    for cells in (32, 64, 128):
        beam, scene = column(cells, ub.Section(EA=1e8, GA=1e8, EI=1.0), math.pi**2 / 4)
        straight = ub.follow(scene, ub.ArcLength(0.2), until=lambda now: now.t > 1.1)
        (point,) = straight.critical
        turn = ub.DisplacementControl(beam.end, "psi", math.radians(4))
        bent = ub.follow(scene, turn, start=point.branch(), steps=44)
        at = DEGREES // 4
        u, v, ψ = bent.displacement(beam.end)[at].T
        np.testing.assert_allclose(np.degrees(ψ), DEGREES, rtol=1e-8)
        results.append(np.column_stack([bent.factor[at], 1 + u, v]))
        assert bent.energy.lost == {}
    # P = 22 at most: 22e-8 of 1e-6
    assert_reaches(*results, exact, [1e-6, 1e-6, 1e-6])


# -- S17: a hinge that snaps back ----------------------------------------------------------------

EI, LENGTH, M_U = 1000.0, 2.0, 10.0  # N m², m, N m
SCALE = 1e-3
"""Moments are so many times, energies its square times those; rotations stay linear."""


@pytest.mark.parametrize("steepness", [4 / 3, 4.0, 40.0])
@pytest.mark.parametrize("law", [ub.Softening, ub.LinearSoftening])
def test_hinge_snap_back(law, steepness):
    """[closed] M = M_u exp(-M_u α/G_f) or linear, δ = F Σ(..) + α arm, G_f (1 - M/M_u); 1e-6.

    As in ``test_hinge.py``, but softening falls ``steepness`` times as steeply as 3EI/L: load and
    displacement go back.  Rotations are 1e-3 of a radian, nonlinear terms 1e-6 of that.
    """
    part = 2 if law is ub.LinearSoftening else 1
    energy = M_U**2 / (part * steepness * 3 * EI / LENGTH)
    h, GA = 2e-6, EI / (1e-5 * LENGTH**2)
    beam = ub.Beam(
        (0, 0), (LENGTH, 0), ub.Section(EA=GA, GA=GA, EI=EI), cells=8, corners=(h / LENGTH,),
        hinges={0.0: law(SCALE * M_U, SCALE**2 * energy)},
    )  # fmt: skip
    load = ub.PointLoad(beam.end, force=(0, SCALE * M_U / LENGTH), amplitude=growing)
    scene = clamped(beam, loads=[load])
    control = ub.DissipationControl(SCALE**2 * energy / 16, ub.ArcLength(0.2))
    spent = SCALE**2 * energy * 0.9
    path = ub.follow(scene, control, until=lambda now: now.ledger.lost["hinges"] > spent)

    vertices = LENGTH * np.array(beam.vertices([]))
    lengths, arms = np.diff(vertices), LENGTH - (vertices[1:] + vertices[:-1]) / 2
    F = path.factor * M_U / LENGTH
    α = path.material_at(beam.start).jump / SCALE
    δ = F * (np.sum(lengths * arms**2) / EI + LENGTH / GA) + α * arms[0]
    np.testing.assert_allclose(path.displacement(beam.end)[1:, 1] / SCALE, δ[1:], rtol=1e-6)
    opens = α > 0
    assert opens.sum() >= 15
    M = softened(law(M_U, energy), α)
    np.testing.assert_allclose(F[opens] * arms[0], M[opens], rtol=1e-6)
    lost = path.energy.lost["hinges"] / SCALE**2 / energy
    # Of the exponential law 1 - M/M_u, of the linear one 1 - (M/M_u)²
    np.testing.assert_allclose(lost[opens], 1 - (M[opens] / M_U) ** part, rtol=1e-6, atol=1e-9)
    (peak,) = path.critical
    assert peak.kind == "limit"
    assert peak.factor == pytest.approx(LENGTH / arms[0], rel=1e-5)
    after = slice(peak.n, peak.n + 3)
    assert (np.diff(F[after]) < 0).all()
    assert (np.diff(δ[after]) < 0).all()


HINGES = [("hinge", ratio, arc, 1.0, True) for ratio in (1.0, 6.0) for arc in (0.03, 0.05, 0.17)]
HINGES += [("hinge in space", ratio, 0.05, 1.0, True) for ratio in (1.0, 6.0)]
HINGES += [(kind, 1.2, 0.05, 1.0, False) for kind in ("hinge", "hinge in space")]
HINGES += [("spring", ratio, arc, 1.0, True) for ratio in (6.0, 20.0) for arc in (0.05, 0.17)]
HINGES += [("spring", 1.2, 0.07, 5.0, True)]


@pytest.mark.parametrize(("kind", "ratio", "arc", "factor", "by_energy"), HINGES)
def test_a_brittle_hinge_softens_whatever_the_steps(kind, ratio, arc, factor, by_energy):
    """The path goes on to dissipate from the limit on; elastic unloading is a path, too."""
    EI, length, limit = 1e6, 2.0, 10e3  # N m², m, N m
    energy, stiff = limit**2 / (ratio * 3 * EI / length), 1e5 * EI / length**2
    space, breaks = kind == "hinge in space", kind == "spring"
    more = {"GA3": stiff, "EI2": EI, "GJ": EI} if space else {}
    section = ub.Section(EA=stiff, GA=stiff, EI=EI, **more)
    law, z = ub.Softening(limit=limit, fracture_energy=energy), (0.0,) * space
    beam = ub.Beam(
        (0, 0, *z), (length, 0, *z), section, cells=4, hinges={} if breaks else {0.0: law},
        **({"up": (0, 1, 0)} if space else {}),
    )  # fmt: skip
    spring = ub.Spring(100 * EI / length, softening=law)
    turns = [ub.Turn(ub.ground(0, 0), beam.start, spring)] if breaks else []
    load = ub.PointLoad(beam.end, force=(0, limit / length, *z), amplitude=lambda t: t)
    foot = ub.Pinned(beam.start) if breaks else ub.Clamped(beam.start)
    scene = ub.Scene([beam], supports=[foot], connectors=turns, loads=[load])
    control = ub.ArcLength(arc, factor=factor)
    path = ub.follow(
        scene, ub.DissipationControl(energy / 20, control) if by_energy else control, steps=100,
        until=lambda now: now.ledger.lost["hinges"] > 0.9 * energy,
    )  # fmt: skip
    lost, factor = path.energy["hinges"], path.factor
    assert 0.9 * energy < lost[-1] < energy
    assert factor.min() > -1e-9
    # The moment falls linearly with the dissipated energy; the arm shortens by second order.
    at = lost > 0.1 * energy
    assert np.abs(factor[at] - (1 - lost[at] / energy)).max() < 0.01


@pytest.mark.parametrize("factor", [1.0, 1e3])
def test_a_path_by_energy_goes_on_after_the_last_dissipation(factor):
    """One of two springs breaks while the load falls, then the other bears a growing load."""
    limit, energy, stiff, rest = 10.0, 1.0, 100.0, 50.0  # N, J, N/m, N/m
    block, ground = ub.Body((0, 0), mass=1.0, inertia=1.0), ub.ground(-1, 0)
    breaks = ub.Spring(stiff, softening=ub.LinearSoftening(limit, energy))
    scene = ub.Scene(
        [], bodies=[block], supports=[ub.PrescribedDisplacement(block.middle, v=0.0, psi=0.0)],
        connectors=[
            ub.Slide(ground, block.middle, law, axis=(1, 0)) for law in (breaks, ub.Spring(rest))
        ],
        loads=[ub.PointLoad(block.middle, force=(limit, 0), amplitude=lambda t: t)],
    )  # fmt: skip
    control = ub.DissipationControl(energy / 10, ub.ArcLength(0.1, factor=factor))
    path = ub.follow(scene, control, steps=60, until=lambda now: now.t > 2.0)
    u, lost = path.displacement(block.middle)[:, 0], path.energy["hinges"]
    assert path.factor[-1] > 2.0
    assert lost[-1] == pytest.approx(energy, rel=1e-9)
    broken = lost > (1 - 1e-9) * energy
    np.testing.assert_allclose(limit * path.factor[broken], rest * u[broken], rtol=1e-9)
    whole = lost == 0.0
    np.testing.assert_allclose(limit * path.factor[whole], (stiff + rest) * u[whole], rtol=1e-9)
