# SPDX-License-Identifier: MIT
"""Newton's method where material yields, where hinges soften, and where the last tangent does."""

import numpy as np
import pytest
from scenes import clamped, rigid_chain

import ufl_beam as ub


def thrown_beam(cells, **law):
    """A beam thrown so that all of it yields, if it can, here and there in either direction."""
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0, **law)
    beam = ub.Beam((6, 0), (0, 8), section, cells=cells)
    load = ub.PointLoad(beam.start, force=(8, 0), moment=-80)
    return ub.Scene([beam], loads=[load])


def hinged_frame():
    """A portal whose corner hinge is about free after 75 of 100 steps, and turns to and fro."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    hinge = {1.0: ub.Softening(limit=50e3, fracture_energy=2e3)}
    left = ub.Beam((0, 0), (0, 3), section, cells=15)
    roof = ub.Beam((0, 3), (4, 3), section, cells=20, hinges=hinge)
    right = ub.Beam((4, 3), (4, 0), section, cells=15)
    return rigid_chain(
        [left, roof, right],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(200e3, 0), amplitude=lambda t: float(t < 0.02))],
    )


def run_of(scene, steps, dt, **more):
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, steps * dt), dt=dt, **more)
    assert run.substeps == steps
    assert abs(run.energy.worst) < 1e-9
    return run


@pytest.mark.parametrize("cells", [64, 4096])
def test_iterations_where_all_cells_yield(cells):
    """No step is cut, and no more than one iteration in three finds what yields; cf. elastic.

    Branches chosen by strains take twice the elastic iterations in 1024 cells, and with 4096 cells
    steps are cut.
    """
    steps, law = 15, ub.ElastoPlastic(yield_limit=1.0, kinematic=10.0)
    elastic = run_of(thrown_beam(cells), steps, 0.01)
    yields = run_of(thrown_beam(cells, bending=law), steps, 0.01)
    # What hardening stores counts as well; it is more than half of all that yielding takes.
    assert yields.energy.lost["plastic"][-1] > 0.01 * yields.energy.supplied["loads"][-1]
    assert yields.iterations <= 1.5 * elastic.iterations


@pytest.mark.parametrize("kinematic", [100.0, 1.0])
def test_a_cantilever_that_yields_in_many_cells(kinematic):
    """Deflection in closed form; forces are small, so that nothing else is nonlinear.

    Beyond the yield moment the curvature has the plastic part (M - My)/K, from the clamp to where
    M = P y is My.  The deflection is the integral of curvature times y, and P L/GA.
    """
    EI, GA, My, cells = 1e3, 1e6, 1e-3, 512
    section = ub.Section(EA=1e6, GA=GA, EI=EI, bending=ub.ElastoPlastic(My, kinematic=kinematic))
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    load = ub.PointLoad(beam.end, force=(0, 2 * My), amplitude=lambda t: t)
    run = ub.simulate(clamped(beam, loads=[load]), ub.Static(), t=(0, 1), dt=0.25)
    P, b = 2 * My, 0.5
    plastic = (P * (1 - b**3) / 3 - My * (1 - b**2) / 2) / kinematic
    exact = P / 3 / EI + P / GA + plastic
    # Moments are those of the middles of cells: of order h².
    assert run.displacement(beam.end)[-1, 1] == pytest.approx(exact, rel=2 / cells**2)
    assert run.substeps == 4
    assert run.iterations <= 4 * 5


def test_a_hinge_that_flows_to_and_fro():
    """No step is cut; the last correction may use the tangent before it, as a tight run shows."""
    loose = run_of(hinged_frame(), 100, 1e-3)
    assert loose.iterations <= 5 * 100
    tight = run_of(hinged_frame(), 50, 1e-3, newton=ub.Newton(rtol=1e-13))
    difference = np.delete(loose.q[50] - tight.q[-1], tight.numbering.multipliers)
    # 1e-10 of some 1e5 N in each of 50 steps, on stiffnesses of the frame above 1e6 N/m.
    assert np.abs(difference).max() < 50 * 1e-10 * 1e5 / 1e6


SPEEDS = 0.071, 0.022, -0.029, -0.007
"""Rotations of the far ends of four members in the whole run; rad."""


def slips(steps, damper=0.0):
    """Slips of the hinges of four members at their common node, at hundredths of the run."""
    section = ub.Section(EA=4e9, GA=1.5e9, EI=4e7)
    laws = {
        (0, -3): ub.Softening(106e3, 3.5e3),  # N m, J
        (0, 3): ub.Softening(96e3, 5.1e3),
        (-3, 0): ub.Softening(89e3, 43.7e3),
        (3, 0): ub.Softening(93e3, 39.8e3),
    }
    beams = [ub.Beam(far, (0, 0), section, cells=2, hinges={1.0: law}) for far, law in laws.items()]
    turned = [
        ub.PrescribedDisplacement(beam.start, u=0, v=0, psi=lambda t, speed=speed: speed * t)
        for beam, speed in zip(beams, SPEEDS, strict=True)
    ]
    node = ub.Rigid(*(beam.end for beam in beams))
    dampers = [ub.Turn(ub.ground(0, 0), beams[0].end, ub.Damper(damper))] if damper else []
    scene = ub.Scene(beams, joints=[node], supports=turned, connectors=dampers)
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / steps)
    found = [run.connector(one) for one in scene.all_connectors if one.kind == "Hinge"]
    moments, motions = (
        np.array(x) for x in zip(*((c.force, c.motion) for c in found), strict=True)
    )
    return moments[:, :: steps // 100], motions[:, :: steps // 100]


def test_a_node_whose_hinges_all_soften():
    """Its rotation has a negative stiffness; it follows the unbalanced moment as with a damper.

    Newton's method alone moves it the other way.  The damper takes 2 kN m s times 0.05 rad/s, a
    thousandth of the moments, so that it delays the slips by less than a step of the fastest pair.
    """
    moments, free = slips(200)
    # equilibrium of the node, relative to the largest moment
    assert np.abs(moments.sum(axis=0)).max() < 1e-9 * np.abs(moments).max()
    _, damped = slips(400, damper=2e3)
    assert np.abs(free - damped).max() < (SPEEDS[0] - SPEEDS[2]) / 100
    assert np.abs(free[:2, -1]).min() > 0.014  # the hinges of the first two members open
