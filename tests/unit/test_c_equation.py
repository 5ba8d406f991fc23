# SPDX-License-Identifier: MIT
"""The equation of a step: Newton's method of C and that of PETSc, and what passes through them."""

import sys

from petsc4py import PETSc

import numpy as np
import pytest
from scenes import SECTION, clamped, rigid_chain

import ufl_beam as ub
from ufl_beam.compiled.c_library import lib


def elastic():
    beam = ub.Beam((0, 0), (4, 3), SECTION, cells=6)
    loads = [
        ub.PointLoad(beam.end, force=(3.0, 5.0)),
        ub.FollowerLoad(beam.at(0.5), force=(0.0, 2.0), amplitude=lambda t: t),
    ]
    return clamped(beam, loads=loads)


def inelastic():
    hinge = {1.0: ub.Softening(limit=30.0, fracture_energy=5.0)}
    law = ub.ElastoPlastic(yield_limit=20.0, isotropic=5.0, kinematic=3.0)
    soft = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0, bending=law)
    left = ub.Beam((0, 0), (0, 3), soft, cells=4)
    roof = ub.Beam((0, 3), (4, 3), SECTION, cells=4, hinges=hinge)
    return rigid_chain(
        [left, roof],
        supports=[ub.Clamped(left.start), ub.Pinned(roof.end)],
        loads=[ub.PointLoad(left.end, force=(40.0, -10.0), amplitude=lambda t: min(t, 0.2))],
        damping=[ub.Rayleigh(mass=0.1, stiffness=1e-3)],
    )


def machine():
    """Something held, something sprung, a law that only Python knows, and a guide."""
    crank = ub.Beam((0, 0), (1, 0), SECTION, cells=3)
    rod = ub.Beam((1, 0), (3, 0), SECTION, cells=4)
    ground = ub.ground(3.0, 0.5)
    spring = ub.Spring(50.0, law=ub.ElastoPlastic(yield_limit=5.0, kinematic=2.0))
    return ub.Scene(
        [crank, rod],
        joints=[ub.Revolute(crank.end, rod.start), ub.Guided(rod.end, lambda s: (3.0 + s, 0.0))],
        connectors=[
            ub.Turn(crank.end, rod.start, spring),
            ub.Stretch(ground, rod.end, ub.ForceLaw(lambda e, de: 3.0 * e**3 + 0.1 * de)),
        ],
        supports=[ub.Pinned(crank.start)],
        loads=[ub.PointLoad(rod.at(0.5), force=(0.0, 10.0))],
    )


def run(scene, newton=None, scheme=None, steps=20):
    return ub.simulate(
        scene, scheme or ub.EnergyMomentum(), t=(0, 0.02 * steps), dt=0.02, newton=newton
    )


@pytest.mark.parametrize("options", [{"snes_type": "newtonls"}, {"snes_max_it": 25}])
@pytest.mark.parametrize("make", [elastic, inelastic, machine])
def test_options_bring_the_solver_of_petsc(options, make):
    of_petsc, own = run(make(), ub.Newton(petsc=options)), run(make())
    assert of_petsc.iterations == own.iterations
    assert np.allclose(of_petsc.q, own.q, rtol=0, atol=1e-11)


@pytest.mark.parametrize("make", [elastic, inelastic, machine])
def test_petsc_may_keep_tangents(make):
    lagged, full = run(make(), ub.Newton(petsc={"snes_lag_jacobian": "2"})), run(make())
    assert lagged.substeps == full.substeps
    assert lagged.iterations > full.iterations  # tangents were kept
    # Residuals of 1e-10 of forces of 1e2 N, on stiffnesses of some 10 N/m, in 20 steps.
    assert np.allclose(full.q, lagged.q, rtol=0, atol=20 * 1e-9)
    assert lagged.energy.worst < 1e-8


def test_what_python_raises_in_the_middle_arrives():
    def force(e, de):
        raise ZeroDivisionError("of the user")

    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    law = ub.ForceLaw(force)
    scene = clamped(beam, connectors=[ub.Stretch(ub.ground(1.0, 1.0), beam.end, law)])
    with pytest.raises(ZeroDivisionError, match="of the user") as error:
        run(scene)
    assert len(error.value.solution.times) >= 1


@pytest.mark.parametrize(
    ("mine", "theirs"),
    [
        ("ITERATING", "ITERATING"),
        ("AT_ROUND_OFF", "CONVERGED_FNORM_ABS"),
        ("CONVERGED", "CONVERGED_FNORM_RELATIVE"),
        ("SINGULAR", "DIVERGED_LINEAR_SOLVE"),
        ("TOO_MANY", "DIVERGED_MAX_IT"),
        ("STALLED", "DIVERGED_LINE_SEARCH"),
        ("DIVERGED", "DIVERGED_DTOL"),
    ],
)
def test_reasons_are_those_of_petsc(mine, theirs):
    assert getattr(lib, mine) == int(getattr(PETSc.SNES.ConvergedReason, theirs))


def test_an_interrupt_at_the_door_of_a_callback_is_not_lost():
    """It comes before the first line of what C calls, and cffi would only print it."""

    def interrupt(frame, event, argument):
        if frame.f_code.co_name == "call_in_python":
            sys.settrace(None)
            raise KeyboardInterrupt

    simulation, whole = (ub.Simulation(machine(), ub.EnergyMomentum()) for _ in range(2))
    simulation.step_to(0.02)
    before = sys.gettrace()
    sys.settrace(interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            simulation.step_to(0.04)
    finally:
        sys.settrace(before)
    assert simulation.t == 0.02
    simulation.step_to(0.04)
    whole.step_to(0.02)
    whole.step_to(0.04)
    np.testing.assert_array_equal(simulation.q, whole.q)
