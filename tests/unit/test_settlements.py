# SPDX-License-Identifier: MIT
"""Settlements: supports of all kinds that move, and their work."""

import math

import numpy as np
import pytest
from helpers import assert_balanced, run
from scenes import clamped

import ufl_beam as ub

L, EA, GA, EI = 2.0, 1e6, 1e6, 100.0
SECTION = ub.Section(EA=EA, GA=GA, EI=EI, rhoA=3.0, rhoI=0.1)
SMALL = 1e-5
"""Settlement in m."""
CUBIC = ub.Mesh(degree=3)  # exact for beams that are loaded at their ends


def moving(place, **motion):
    """Settle in proportion to time."""
    return ub.PrescribedDisplacement(
        place, **{k: (lambda t, x=x: x * t) if k in "uvpsi" and x else x for k, x in motion.items()}
    )


def settled(*supports, beam):
    """All reactions, and the work of the supports; a diagram ends with the reactions."""
    scene = ub.Scene([beam], supports=[make(beam) for make in supports])
    found = run(scene, ub.Static(), dt=0.5, mesh=CUBIC, newton=ub.Newton(rtol=1e-13))
    assert found.energy.worst < 1e-4  # trapezoidal rule: exact but for rotations of 1e-5
    diagram = found.diagram(beam)
    ends = np.hypot(diagram.N[[0, -1]], diagram.V[[0, -1]])
    sizes = [np.hypot(*found.reaction(scene.supports[k])[-1, :2]) for k in (0, -1)]
    assert ends == pytest.approx(sizes, abs=1e-9 * max(sizes))
    return [found.reaction(s)[-1] for s in scene.supports], found.energy.supplied["supports"][-1]


@pytest.mark.parametrize("motion", ["v", "psi"])
def test_a_clamp_settles(motion):
    """[closed] A beam clamped at both ends; with shear, Φ = 12 EI/(GA L²)."""
    beam, Φ = ub.Beam((0, 0), (L, 0), SECTION, cells=2), 12 * EI / (GA * L**2)
    held = {"v": 0, "psi": 0} | {motion: -SMALL}
    (_, end), work = settled(
        lambda b: ub.Clamped(b.start), lambda b: moving(b.end, **held), beam=beam
    )
    # The end moves by v: V = 12 EI/L³ v, M = -6 EI/L² v; it turns: V = -6 EI/L² ψ, M = 4 EI/L ψ
    shear, moment = (-12 / L**3, 6 / L**2) if motion == "v" else (6 / L**2, -(4 + Φ) / L)
    assert end[1:] == pytest.approx(np.array([shear, moment]) * EI * SMALL / (1 + Φ), rel=1e-5)
    assert work == pytest.approx(-end[1 if motion == "v" else 2] * SMALL / 2, rel=1e-5)


def test_the_middle_of_a_continuous_beam_settles():
    """[closed] Two equal spans: 6 EI δ/l³ at the middle, with shear; M = 3 EI δ/l²."""
    beam = ub.Beam((0, 0), (L, 0), SECTION, cells=2)
    l = L / 2
    force = SMALL / (l**3 / (6 * EI) + l / (2 * GA))
    reactions, work = settled(
        lambda b: ub.Pinned(b.start),
        lambda b: moving(b.at(0.5), v=-SMALL),
        lambda b: ub.Roller(b.end),
        beam=beam,
    )
    assert [r[1] for r in reactions] == pytest.approx([force / 2, -force, force / 2], rel=1e-6)
    assert work == pytest.approx(force * SMALL / 2, rel=1e-6)


def test_an_inclined_roller_settles():
    """[closed] A propped cantilever: δ = f (n_x² L/EA + n_y² (L³/3EI + L/GA)) across the roller."""
    beam = ub.Beam((0, 0), (L, 0), SECTION, cells=2)
    along = np.array([2.0, 1.0]) / math.sqrt(5)
    (_, end), work = settled(
        lambda b: ub.Clamped(b.start),
        lambda b: moving(b.end, v=-SMALL, along=tuple(along)),
        beam=beam,
    )
    x, y = -along[1], along[0]
    f = -SMALL / (x**2 * L / EA + y**2 * (L**3 / (3 * EI) + L / GA))
    # 2e-3 = EA/EI v L/4: how the shortening by rotation changes the small displacement along x
    assert end == pytest.approx([f * x, f * y, 0.0], rel=1e-4, abs=1e-12)
    assert work == pytest.approx(-f * SMALL / 2, rel=1e-4)


@pytest.mark.parametrize(
    "scheme",
    [ub.Static(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentum(), ub.GeneralizedAlpha(0.8)],
)
def test_a_support_at_an_angle_moves_far(scheme):
    """As the same model in turned axes."""

    soft = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=3.0, rhoI=0.1)
    motion = {"u": lambda t: -0.2 * t**2, "v": lambda t: 0.4 * t**2}
    runs = []
    for angle in (0.0, 0.7):
        c, s = math.cos(angle), math.sin(angle)
        beam = ub.Beam((0, 0), (2 * c, 2 * s), soft, cells=4)
        scene = clamped(beam, ub.PrescribedDisplacement(beam.end, **motion, along=(c, s)))
        moved = run(scene, scheme, newton=ub.Newton(rtol=1e-12), dt=0.05)
        runs.append((moved.section_forces_at(beam.start), moved.energy.supplied["supports"]))
        if isinstance(scheme, ub.EnergyMomentum | ub.EnergyMomentumStatic):
            assert_balanced(moved.energy)
    (other_force, other_work), (force, work) = runs
    assert force == pytest.approx(other_force, abs=1e-7 * np.abs(force).max())
    assert work == pytest.approx(other_work, abs=1e-7 * np.abs(work).max())
