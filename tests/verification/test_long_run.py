# SPDX-License-Identifier: MIT
"""Long runs: damage against closed forms, and a frame that softens in very many steps."""

import gc
import math
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import clamped, rigid_chain

import ufl_beam as ub
import ufl_beam.structures as st

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))
from test_memory import MEBIBYTE, Watch

STEPS = int(os.environ.get("UFL_BEAM_STEPS", "100000"))
"""Of the slow test; `make long` takes a million."""


def test_damage_of_cycles_of_one_size():
    """Twenty slow cycles of a force at the end of a cantilever: Miner's sum in closed form."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3)
    beam = ub.Beam((0, 0), (2, 0), section, cells=2)
    F, W, n = 20e3, 0.1 * 0.2**2 / 6, 20
    push = ub.PointLoad(beam.end, force=(0, F), amplitude=lambda t: math.sin(2 * math.pi * t))
    scene = clamped(beam, loads=[push])
    spot = st.HotSpot.fibre(beam.start, y=0.1, E=210e9)
    curve = st.SNCurve(range=71e6, cycles=2e6, slope=3.0)
    fatigue = st.Fatigue(spot, curve, resolution=1e3)
    ub.simulate(scene, ub.Static(), t=(0, n), dt=0.125, record=fatigue)
    S = 2 * F * 2 / W  # 120 MPa
    # From zero to the first peak and from the last one to zero are halves of half the range
    damage = ((n - 0.5) * S**3 + 2 * 0.5 * (S / 2) ** 3) / (2e6 * 71e6**3)
    # The end moves down by v = FL³/3EI: the lever shrinks by 3/5 v²/L in stress, 3 times in damage
    v = F * 2**3 / (3 * section.EI)
    assert fatigue.damage(spot) == pytest.approx(damage, rel=9 / 5 * (v / 2) ** 2 + 3e3 / S)
    assert fatigue.life(spot) == pytest.approx(n / fatigue.damage(spot), rel=1e-15)


def softening_portal():
    """A clamped portal frame, 4 m by 6 m, shaken harder than its feet can bear."""
    section = ub.Section.rectangle(b=0.10, h=0.20, E=210e9, nu=0.3, rho=7850.0)
    law = ub.Softening(limit=6e3, fracture_energy=1.0 * STEPS)  # N m, J
    left = ub.Beam((0, 0), (0, 4), section, cells=2, name="left", hinges={0.25: law})
    roof = ub.Beam((0, 4), (6, 4), section, cells=2, name="roof")
    right = ub.Beam((6, 4), (6, 0), section, cells=2, name="right", hinges={0.75: law})
    shake = ub.PointLoad(left.end, force=(20e3, 0.0), amplitude=lambda t: math.sin(8 * t))
    return rigid_chain(
        [left, roof, right],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        damping=[ub.Rayleigh(mass=2.0)],
        loads=[shake],
    )


@pytest.mark.slow
@pytest.mark.serial
def test_very_many_steps(tmp_path):
    """Constant memory, bounded files, a ledger that closes."""
    scene = softening_portal()
    left, roof, _ = scene.beams
    spots = [st.HotSpot.fibre(place, y=0.1, E=210e9) for place in (left.start, roof.start)]
    fatigue, extremes = st.Fatigue(spots, st.SNCurve.eurocode(71e6)), ub.Extremes()
    table, watch = tmp_path / "long.csv", Watch({1000, STEPS})
    record = [fatigue, extremes, ub.History(table, [left.end], max_rows=200), watch]
    steps = {"t": (0, 0.01 * STEPS), "dt": 0.01, "max_states": 200}
    solution = ub.simulate(scene, ub.EnergyMomentum(0.05, 0.05), record=record, **steps)
    gc.collect()
    grown = watch.memory[STEPS] - watch.memory[1000]
    energy, hinges = solution.energy, solution.energy["hinges"]
    print(f"\n{solution}\n{fatigue}\nmemory grew by {grown / MEBIBYTE:.3f} MiB")
    assert solution.substeps >= STEPS
    assert grown < 1 * MEBIBYTE
    assert watch.objects[STEPS] - watch.objects[1000] == 1  # the probe itself
    assert energy.worst < 1e-8
    # The hinges soften all the time, and keep what they had left
    assert np.all(np.diff(hinges[:-1]) > 0)
    assert hinges[-1] < 2 * 1.0 * STEPS
    # The energy that they dissipated softened them, P(52)
    rest = 1 - solution.material_at(left.at(0.25)).hinge / STEPS
    # The limit holds within steps; at their ends moments alternate about it by the order of a step,
    # 8 rad/s 0.01 s of the amplitude, which is up to twice the limit
    moments = np.abs(solution.connector(scene.hinges[0]).force)
    assert 0.5 * 6e3 < moments.max() < 6e3 * (1 + 2 * 0.08)
    assert extremes.section_forces(left).high[0, 2] > moments.max()  # nearer to the clamp
    assert 0.0 < rest.min() < 0.9
    assert len(solution) <= 202
    assert len(table.read_text().splitlines()) <= 202
    for spot in spots:
        assert fatigue.cycles(spot).count.sum() > STEPS / 200
        assert fatigue.damage(spot) > 0
