# SPDX-License-Identifier: MIT
"""Hinges that yield by axial force and moment together."""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from compiled_law import require_tangent
from helpers import raises, require_restart
from scipy.optimize import minimize

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.model.material_law import State, initial_state

NP, MP = 400.0, 20.0
LAW = st.AxialBendingHinge(NP, MP, along=2e5, across=1e5, turning=3e3)


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
    n, m = np.array(projected(N, M)) / (NP, MP)
    # SLSQP finds minima to the square root of the precision of the distance
    assert (n, m) == pytest.approx(exact.x, abs=1e-5)
    assert n**2 + abs(m) < 1 + 1e-12


def test_a_step_far_outside_reaches_the_surface():
    """Trial forces up to 5e5 times the limits, whose round-off is 5e-11 of the limits."""
    for N, M in [(1e5, 1.0), (1e3, 1e6), (1e6, 1e6), (1.0, 1e7), (-1e7, 1e-9)]:
        n, m = np.array(projected(N, M)) / (NP, MP)
        assert n**2 + abs(m) == pytest.approx(1.0, abs=2e-10)


def test_tangents_are_derivatives():
    """Against central differences, elastic, on the surface and at a corner."""
    ends = np.array([(1e-3, 1e-3, 2e-3), (3e-3, 0, 2e-2), (-2e-2, 0, -1e-2), (1e-2, 0, 1e-5)])
    steps = [(np.zeros(3), e) for e in ends]
    # 1e-16/ε of forces of 400 N, beside stiffnesses of 2e5 N/m
    require_tangent(LAW, ub.EnergyMomentum(), steps, 1e-8, lambda *_: 20.0, dt=0.1, state=0.0)


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


def test_dynamics_close_the_ledger(tmp_path, as_by_reference):
    """A column under its own loads shaken at the end; reference solver, restart, no gain."""
    beam, hinge, scene = column()
    push = ub.PointLoad(
        beam.end, force=(60.0, -150.0), amplitude=lambda t: math.sin(30 * t) * (t < 0.3)
    )
    simulate = partial(ub.simulate, t=(0, 0.1), dt=4e-3)
    run = simulate(scene(loads=[push]), ub.EnergyMomentum(), newton=ub.Newton(rtol=1e-12))
    as_by_reference(run)
    assert run.energy.worst < 1e-9
    lost = run.connector(hinge).dissipated
    assert lost[-1] > 0.1
    assert np.diff(lost).min() > -1e-12 * lost[-1]
    simulate = partial(ub.simulate, dt=2e-3)
    require_restart(simulate, scene(loads=[push]), [hinge], ub.EnergyMomentum(), tmp_path, 0.2)


# -- results for engineers -------------------------------------------------------------------------

LAWS = {
    "spring": ub.Spring(3e3, law=ub.ElastoPlastic(MP)),
    "axial and bending": st.AxialBendingHinge(1e9, MP, along=2e5, across=1e5, turning=3e3),
    "deteriorating": st.IbarraKrawinkler(3e3, st.Backbone(MP, capping=1.0)),
    "pinching": st.PinchingHinge(3e3, st.Backbone(MP, capping=1.0)),
}


@dataclass(frozen=True)
class Mine(ub.extend.ConnectorLaw):
    """A perfectly plastic hinge with three components, the first two elastic."""

    stiffness: float
    limit_moment: float
    components: ClassVar = 3
    entry: ClassVar = "plastic"
    variables: ClassVar = {"plastic": 0.0}

    def energy(self, motion, state):
        x, y, turn = motion
        return self.stiffness * (x**2 + y**2 + (turn - state.plastic) ** 2) / 2

    def increments(self, motion, rate, state, dt):
        elastic, f = motion[2] - state.plastic, ub.extend.law_functions
        size = f.positive(f.absolute(elastic) - self.limit_moment / self.stiffness)
        return {"plastic": f.sign(elastic) * size}


PINS = (ub.Clearance(stiffness=1e5, gap=1e-3, friction=0.3, radius=0.02),)


def turned(laws):
    """Cantilevers whose ends rotate, each on a hinge with one of the laws; uniform moments."""
    beams, feet, supports = [], [], []
    for k, law in enumerate(laws):
        beam = ub.Beam((0, k), (1, k), ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=5.0), cells=2)
        several = getattr(law, "components", 1) > 1
        feet.append((ub.Bushing if several else ub.Turn)(ub.ground(0, k), beam.start, law))
        supports += [ub.Pinned(beam.start)] * (not several)
        held = {"u": lambda t: 0.0, "v": lambda t: -0.01 * t} if law in PINS else {}
        supports.append(ub.PrescribedDisplacement(beam.end, psi=lambda t: 0.1 * t, **held))
        beams.append(beam)
    return feet, ub.Scene(beams, supports=supports, connectors=feet)


def test_hinge_laws_have_the_results_of_a_spring_that_yields():
    """Events, table and ledger; the moment is uniform, so all hinges turn alike; not a pin."""
    (*feet, pin), scene = turned([*LAWS.values(), Mine(3e3, MP), *PINS])
    events = ub.Events()
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.02, record=events)
    assert {event.where for event in events.found} == {*feet}
    # The loss of a law is seen from a thousandth of its work on, within a step
    assert {event.what for event in events.found} == {"yields"}
    assert np.ptp([event.time for event in events.found]) < 0.021
    rows = {row.where: row for row in st.hinge_table(run, {"IO": 0.05, "CP": 0.2}).rows}
    assert {*rows} == {*feet}
    spring = rows[feet[0]]
    for foot in feet:
        # The elastic rotation of a law of a user is not known
        for name in ("rotation", *(("plastic", "ductility") if foot is not feet[-1] else ())):
            # Round-off of Newton's method, 1e-9 of the forces
            assert getattr(rows[foot], name) == pytest.approx(getattr(spring, name), rel=1e-6)
        assert rows[foot].state == spring.state == "CP"
        assert rows[foot].n == run.times.tolist().index(rows[foot].time) > 0
        # Of the first step beyond the limit the trapezoidal work is known
        assert rows[foot].dissipated == pytest.approx(spring.dissipated, rel=0.02)
    total = sum(row.dissipated for row in rows.values())
    assert run.energy.lost["plastic"][-1] == pytest.approx(total, rel=1e-12)
    lost, work = run.connector(pin).dissipated[-1], run.connector(pin).work[-1]
    assert lost > 1e-3 * work > 0
    assert [row.where for row in st.hinge_table(run, only=[feet[1]]).rows] == [feet[1]]


def test_pictures_show_hinges_of_connectors():
    """Circles at the feet that yield, and moments over rotations; not of a pin with friction."""
    (*feet, pin), scene = turned([*LAWS.values(), Mine(3e3, MP), *PINS])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    for what, n in (("damage", -1), ("shape", 0)):
        axes = ub.plot(run, what, n=n).axes[0]
        marks = [x.get_xydata()[0] for x in axes.lines if len(x.get_xdata()) == 1]
        # The feet are at x = 0 and y = 0, 1, 2, ...
        drawn = [at for at in marks if np.allclose(at, (0, np.round(at[1])), rtol=0, atol=1e-9)]
        assert len(drawn) == (len(feet) if n else 0)
    for foot in feet:
        axes = ub.plot(run, "hinge", foot).axes[0]
        history = run.connector(foot)
        last = [np.atleast_2d(x.T)[-1, -1] for x in (history.motion, history.force)]
        ends = [line.get_xydata()[-1] for line in axes.lines]
        assert any(np.allclose(end, last, rtol=1e-12, atol=0) for end in ends)
        assert f"hinge at {foot}" in axes.get_title(loc="left")
    with raises("no rotation whose law may yield"):
        ub.plot(run, "hinge", pin)
