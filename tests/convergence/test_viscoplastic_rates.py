# SPDX-License-Identifier: MIT
"""Orders in time of a viscoplastic vibration, each run compared with itself.

A law without a yield limit and with kinematic hardening is smooth: a standard linear solid.
"""

import math

import numpy as np
import pytest
from convergence.study import self_convergence
from helpers import assert_balanced
from scenes import clamped

import ufl_beam as ub

EI, LENGTH, DURATION = 25.0, 1.0, 0.2  # N m², m, s
RELAXATION = 0.05
"""Time of the law, s; the first period of the beam is 0.7 s with its mass."""


def pulse(t):
    return math.sin(math.pi * t / 0.15) ** 4 if t < 0.15 else 0.0


def vibration(scheme, dt):
    """Displacement, velocity and moment of the end state; the ledger closes at any step."""
    law = ub.ElastoPlastic(0.0, kinematic=EI, viscosity=ub.DuvautLions(RELAXATION))
    section = ub.Section(EA=1e4, GA=1e4, EI=EI, rhoA=1.0, rhoI=1e-3, bending=law)
    beam = ub.Beam((0, 0), (LENGTH, 0), section, cells=1)
    scene = clamped(
        beam,
        masses=[ub.PointMass(beam.end, 1.0)],
        loads=[ub.PointLoad(beam.end, force=(0, 25.0), amplitude=pulse)],
    )
    solution = ub.simulate(scene, scheme, t=(0, DURATION), dt=dt, newton=ub.Newton(rtol=1e-12))
    energy = solution.energy
    assert_balanced(energy)
    assert energy.lost["plastic"][-1] > 0.1 * energy.energy_transferred / 2
    return (
        solution.displacement(beam.end)[-1],
        solution.velocity(beam.end)[-1],
        solution.material_at(beam.start).forces[-1, 2:],  # at the end, as the others
    )


@pytest.mark.parametrize(("alpha", "order", "dt"), [(0.0, 2, 4e-3), (0.5, 1, 1e-3)])
def test_order_in_time(alpha, order, dt):
    """EnergyMomentum(alpha=0.5) is backward Euler; the next term of the error falls with dt."""
    runs = [vibration(ub.EnergyMomentum(alpha=alpha), dt / 2**k) for k in range(4)]
    for answer in zip(*runs, strict=True):  # displacements, then velocities, then the moment
        measured = self_convergence(answer)
        np.testing.assert_allclose(measured, order, rtol=0, atol=0.1)
        assert abs(measured[-1] - order) < 0.03


@pytest.mark.parametrize(("relaxation", "order"), [(0.05, 2), (0.0, 1)])
def test_a_yield_limit_keeps_the_order_if_flow_is_viscous(relaxation, order):
    """Energy dissipated by a bar of 1 N/m with a mass of 1 kg, which flows in turns.

    Without viscosity the rate of flow jumps within a step; the error depends on the place in the
    step.  Hence the mean order of 25 to 200 steps in a period, to a third.
    """
    period = 2 * math.pi
    law = ub.ElastoPlastic(0.25e-4, kinematic=4.0, viscosity=ub.DuvautLions(relaxation * period))
    bar = ub.Beam((0, 0), (1, 0), ub.Section(EA=1.0, GA=1.0, EI=1.0, axial=law), cells=1)
    block = ub.Body((1, 0), mass=1.0)
    scene = clamped(
        bar,
        ub.PrescribedDisplacement(bar.end, v=0, psi=0),
        bodies=[block],
        joints=[ub.Rigid(bar.end, block.middle)],
        initial=[ub.Velocity([block], linear=(1e-4, 0))],
    )

    def lost(steps):
        end = {"t": (0, 2 * period), "dt": period / steps}
        run = ub.simulate(scene, ub.EnergyMomentum(), newton=ub.Newton(rtol=1e-12), **end)
        assert_balanced(run.energy)
        return run.energy.lost["plastic"][:: steps // 25]

    exact = lost(3200)
    errors = [np.abs(lost(steps) - exact).max() for steps in (25, 50, 100, 200)]
    assert math.log2(errors[0] / errors[-1]) / 3 == pytest.approx(order, abs=1 / 3)
