# SPDX-License-Identifier: MIT
"""Newton's method where full steps go round, and where the last tangent does."""

import numpy as np
import pytest

import ufl_beam as ub


def yielding_beam(cells):
    """A beam thrown so that all of it yields, here and there in either direction."""
    law = ub.Hardening(limit=1.0, kinematic=10.0)
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0, bending=law)
    beam = ub.Beam((6, 0), (0, 8), section, cells=cells)
    load = ub.PointLoad(beam.start, force=(8, 0), moment=-80)
    return ub.Scene([beam], loads=[load])


def hinged_frame():
    """A portal whose corner hinge is about free after 75 of 100 steps, and turns to and fro."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    hinge = {1.0: ub.Softening(limit=50e3, energy=2e3)}
    left = ub.Beam((0, 0), (0, 3), section, cells=15)
    roof = ub.Beam((0, 3), (4, 3), section, cells=20, hinges=hinge)
    right = ub.Beam((4, 3), (4, 0), section, cells=15)
    return ub.Scene(
        [left, roof, right],
        joints=[ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.start)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(200e3, 0), time=lambda t: float(t < 0.02))],
    )


@pytest.mark.parametrize(
    ("scene", "steps", "dt"),
    [(yielding_beam(2048), 4, 0.01), (hinged_frame(), 100, 1e-3)],
    ids=["fine", "hinge"],
)
def test_points_that_flow_to_and_fro(scene, steps, dt):
    """No step is cut, where full steps go round between two states in the fine scene."""
    run = ub.simulate(scene, ub.Midpoint(), t=(0, steps * dt), dt=dt, progress=False)
    assert run.parts == steps
    assert run.iterations <= 5 * steps
    assert abs(run.energy.worst) < 1e-9

    if not scene.hinges:  # or that scene shows nothing
        full = ub.Newton(petsc={"snes_linesearch_type": "basic"})
        run = ub.simulate(
            scene, ub.Midpoint(), t=(0, steps * dt), dt=dt, progress=False, newton=full
        )
        assert run.parts > steps


def test_a_kept_tangent_ends_below_the_tolerance():
    """The last correction may use the tangent before it; a tight run tells what that leaves."""
    ends = []
    for rtol in (1e-10, 1e-13):
        run = ub.simulate(
            hinged_frame(), ub.Midpoint(), t=(0, 0.05), dt=1e-3, progress=False,
            newton=ub.Newton(rtol=rtol),
        )  # fmt: skip
        ends.append(np.delete(run.q[-1], run.grid.multipliers))
    # 1e-10 of some 1e5 N in each of 50 steps, on stiffnesses of the frame above 1e6 N/m.
    assert np.abs(ends[0] - ends[1]).max() < 50 * 1e-10 * 1e5 / 1e6
