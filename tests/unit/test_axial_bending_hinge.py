# SPDX-License-Identifier: MIT
"""Hinges that yield by axial force and moment together."""

import math
from functools import partial

import numpy as np
import pytest
from helpers import raises, require_reference, require_restart
from scipy.optimize import minimize

import ufl_beam as ub
from ufl_beam.compiled.c_library import doubles, lib
from ufl_beam.model.material_law import State, initial_state
from ufl_beam.terms.compiled_connector_laws import LawForms, inputs

NP, MP = 400.0, 20.0
LAW = ub.AxialBendingHinge(NP, MP, along=2e5, across=1e5, turning=3e3)


def projected(N, M):
    """Forces after one step from rest to elastic forces (N, M), by the law."""
    motion = tuple(np.array([x]) for x in (N / LAW.along, 0.0, M / LAW.turning))
    changes = LAW.increments(motion, motion, initial_state(LAW), 1.0)
    new = LAW.elastic_forces(motion, State(changes))
    return float(new[0][0]), float(new[2][0])


@pytest.mark.parametrize("seed", range(20))
def test_a_step_projects_on_the_yield_surface(seed):
    """Against minimization of the energy norm by SciPy; corners and elastic states included."""
    random = np.random.default_rng(seed)
    N, M = random.normal(size=2) * (2 * NP, 2 * MP) * (1.0, 0.02 if seed % 4 == 0 else 1.0)
    found = projected(N, M)

    def distance(x):
        n, m = x * (NP, MP)
        return ((n - N) ** 2 / LAW.along + (m - M) ** 2 / LAW.turning) / (NP**2 / LAW.along)

    inside = [
        {"type": "ineq", "fun": lambda x, way=way: 1 - x[0] ** 2 - way * x[1]} for way in (1, -1)
    ]
    exact = minimize(
        distance, np.array([0.1, 0.1]), constraints=inside, method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )  # fmt: skip
    # SLSQP finds minima to the square root of the precision of the distance
    assert np.array(found) / (NP, MP) == pytest.approx(exact.x, abs=1e-5)
    n, m = np.array(found) / (NP, MP)
    assert n**2 + abs(m) < 1 + 1e-12


def test_a_step_far_outside_reaches_the_surface():
    """Trial forces up to 5e5 times the limits, whose round-off is 5e-11 of the limits."""
    for N, M in [(1e5, 1.0), (1e3, 1e6), (1e6, 1e6), (1.0, 1e7), (-1e7, 1e-9)]:
        n, m = np.array(projected(N, M)) / (NP, MP)
        assert n**2 + abs(m) == pytest.approx(1.0, abs=2e-10)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum()], ids=str)
def test_tangents_are_derivatives(scheme):
    """Against central differences, elastic, on the surface and at a corner."""
    forms, names = LawForms(LAW, scheme), inputs(LAW)
    known = {f"number {n}": x for n, x in LAW.parameters().items()}
    known |= {f"state {n}": 0.0 for n in LAW.variables} | {"dt": 0.1, "theta": scheme.theta}
    known |= {f"before {k}": 0.0 for k in range(3)}

    def ask(e):
        answers = np.zeros(12)
        given = known | {f"motion {k}": e[k] for k in range(3)}
        lib.ask_law(forms.force, doubles(np.array([given[n] for n in names])), 12, doubles(answers))
        return answers

    for e in np.array([(1e-3, 1e-3, 2e-3), (3e-3, 0, 2e-2), (-2e-2, 0, -1e-2), (1e-2, 0, 1e-5)]):
        ε = 1e-8
        steps = [(ask(e + ε * one)[:3] - ask(e - ε * one)[:3]) / (2 * ε) for one in np.eye(3)]
        # 1e-16/ε of forces of 400 N
        assert ask(e)[3:].reshape(3, 3) == pytest.approx(np.array(steps).T, abs=1e-4 * 2e5)


def column(**more):
    """An elastic column on a hinge, under a constant load along it and a growing one across."""
    beam = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=5.0), cells=4)
    hinge = ub.Bushing(ub.ground(0, 0), beam.start, LAW, axis=(0, 1))
    return beam, hinge, partial(ub.Scene, [beam], connectors=[hinge], **more)


@pytest.mark.parametrize("n", [0.0, 0.3, -0.6])
def test_the_plastic_moment_depends_on_the_axial_force(n):
    """[closed] M = Mp (1 - n²) under a constant N; it stretches by 2 n Mp/Np per plastic rotation.

    The axis of the bushing turns with the ground, so N is the load, which keeps its direction.
    """
    beam, hinge, scene = column()
    pull = ub.PointLoad(beam.end, force=(0.0, n * NP))
    turn = ub.PrescribedDisplacement(beam.end, psi=lambda t: 0.1 * t)
    run = ub.simulate(scene(loads=[pull], supports=[turn]), ub.Static(), t=(0, 1), dt=0.02)
    history = run.connector(hinge)
    N, _, M = history.force[-1]
    assert pytest.approx(n * NP, abs=1e-6 * NP) == N
    assert pytest.approx(MP * (1 - n**2), rel=1e-6) == M
    stretch, turned = history.motion[-1, [0, 2]] - history.motion[-20, [0, 2]]
    assert stretch == pytest.approx(2 * n * MP / NP * turned, abs=1e-6 * turned)


def test_dynamics_close_the_ledger(tmp_path):
    """A column under its own loads shaken at the end; reference solver, restart, no gain."""
    beam, hinge, scene = column()
    push = ub.PointLoad(
        beam.end, force=(60.0, -150.0), amplitude=lambda t: math.sin(30 * t) * (t < 0.3)
    )
    simulate = partial(ub.simulate, t=(0, 0.1), dt=4e-3)
    run = require_reference(simulate, scene(loads=[push]), hinge, ub.EnergyMomentum())
    assert run.energy.worst < 1e-9
    lost = run.connector(hinge).dissipated
    assert lost[-1] > 0.1
    assert np.diff(lost).min() > -1e-12 * lost[-1]
    simulate = partial(ub.simulate, dt=2e-3)
    require_restart(simulate, scene(loads=[push]), [hinge], ub.EnergyMomentum(), tmp_path, 0.2)


def test_numbers_must_be_positive():
    with raises("AxialBendingHinge: turning = 0", kind=ub.ModelError):
        ub.AxialBendingHinge(1.0, 1.0, 1.0, 1.0, 0.0)
