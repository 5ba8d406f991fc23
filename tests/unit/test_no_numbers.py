# SPDX-License-Identifier: MIT
"""Functions of users that return NaN or infinity: the message names function and time."""

import math
import re

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from scenes import clamped

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=4e3, EI=10.0, rhoA=1.0, rhoI=1e-3)
WRONG = [math.nan, math.inf, -math.inf]
SCHEMES = [ub.EnergyMomentum(), ub.Static(), ub.GeneralizedAlpha(0.8)]


def girder(**parts):
    """A cantilever with one part of each kind, made from its beam."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
    made = {name: [make(beam)] for name, make in parts.items()}
    held = () if "supports" in made else [ub.Clamped(beam.start)]
    return ub.Scene([beam], **{"supports": held, **made})


def after(value, begin=0.25):
    """A function of time that is good until some time."""
    return lambda t: 1e-3 * t if t < begin else value


def turned(law):
    return girder(connectors=lambda b: ub.Turn(ub.ground(2, 0), b.end, law))


def work(kind):
    """A work whose number is a function."""

    def make(value):
        cached_forms = (
            (lambda w, c: c * w[1]) if kind is ub.VirtualWork else (lambda q, c: c * q[1])
        )
        return girder(works=lambda b: kind("push", cached_forms, numbers={"c": after(value)}))

    return make


TURN = "Turn(ground (2, 0), girder.end (1, 0)): "
LATER = {
    "PointLoad": lambda v: (
        girder(loads=lambda b: ub.PointLoad(b.end, (1, 0), amplitude=after(v))),
        "PointLoad at girder.end (1, 0): the time function is",
    ),
    "FollowerLoad": lambda v: (
        girder(loads=lambda b: ub.FollowerLoad(b.end, (1, 0), amplitude=after(v))),
        "FollowerLoad at girder.end (1, 0): the time function is",
    ),
    "LineLoad": lambda v: (
        girder(loads=lambda b: ub.LineLoad(b, (1, 0), amplitude=after(v))),
        "LineLoad on girder: the time function is",
    ),
    "MovingLoad": lambda v: (
        girder(loads=lambda b: ub.MovingLoad(b, after(v), (1, 0))),
        "MovingLoad on girder: the time function is",
    ),
    "Pressure": lambda v: (
        girder(loads=lambda b: ub.Pressure(b, 1.0, amplitude=after(v))),
        "Pressure on girder: the time function is",
    ),
    "Gravity": lambda v: (
        girder(loads=lambda b: ub.Gravity(amplitude=after(v))),
        "Gravity: the time function is",
    ),
    "PrescribedDisplacement": lambda v: (
        girder(supports=lambda b: ub.PrescribedDisplacement(b.start, u=0, v=after(v), psi=0)),
        "PrescribedDisplacement at girder.start (0, 0): the time function is",
    ),
    "PrescribedMotion": lambda v: (
        turned(ub.PrescribedMotion(after(v))),
        f"{TURN}the time function is",
    ),
    "PrescribedForce": lambda v: (
        turned(ub.PrescribedForce(after(v))),
        f"{TURN}the time function is",
    ),
    "Controller": lambda v: (
        turned(ub.Controller(lambda now: after(v)(now.t))),
        f"{TURN}the controller returned",
    ),
    "ForceLaw": lambda v: (
        turned(ub.ForceLaw(lambda e, rate, t: 1e-3 * e + after(v)(t))),
        f"{TURN}the function returned",
    ),
    "state of a ForceLaw": lambda v: (
        turned(ub.ForceLaw(lambda e, rate, t, state: (1e-3, [after(v)(t)]), state=[0.0])),
        f"{TURN}the function returned",
    ),
    "VirtualWork": lambda v: (work(ub.VirtualWork)(v), "'push': the time function is"),
    "Potential": lambda v: (work(ub.Potential)(v), "'push': the time function is"),
}


def run(scene, scheme, **more):
    return ub.simulate(scene, scheme, t=(0, 1), dt=0.1, comm=MPI.COMM_SELF, **more)


def time_in(said):
    """The time that a message names last before it gives advice."""
    return float(re.findall(r"t = ([-+.e\d]+) s", said.partition(" N)")[0])[-1])


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda x: type(x).__name__)
@pytest.mark.parametrize("value", WRONG)
@pytest.mark.parametrize("kind", LATER)
def test_a_later_call_is_named_with_its_time(kind, value, scheme):
    """Results up to the time remain; nothing is said of tangents or of what holds twice."""
    scene, words = LATER[kind](value)
    with pytest.raises((ub.ArgumentError, ub.ConvergenceError)) as failure:
        run(scene, scheme)
    said = str(failure.value)
    assert f"{words} " in said
    assert "nan" in said if math.isnan(value) else "inf" in said
    assert "singular" not in said
    assert "twice" not in said
    assert 0.25 - 1e-9 <= time_in(said) <= 0.3 + 1e-9
    assert 0.2 - 1e-9 <= failure.value.solution.times[-1] <= 0.3 + 1e-9
    assert np.isfinite(failure.value.solution.q).all()
    if kind == "PointLoad" and scheme == ub.EnergyMomentum():  # 1/4096 of a step before it
        assert failure.value.solution.times[-1] == pytest.approx(0.25, rel=3e-3)


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda x: type(x).__name__)
@pytest.mark.parametrize("value", WRONG)
@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda v: ub.ForceLaw(lambda e, rate: v), "the function returned"),
        (lambda v: ub.Controller(lambda now: v), "the controller returned"),
        (lambda v: ub.ForceLaw(lambda e, rate: e, stored=lambda e: v), "the energy returned"),
    ],
    ids=["ForceLaw", "Controller", "stored"],
)
def test_the_first_call_is_named(law, words, value, scheme):
    with pytest.raises((ub.ArgumentError, ub.ConvergenceError)) as failure:
        run(turned(law(value)), scheme)
    said = str(failure.value)
    assert f"{TURN}{words} {value}" in said
    assert "singular" not in said
    assert "twice" not in said


@pytest.mark.parametrize("value", WRONG)
def test_a_time_function_is_asked_before_a_run(value):
    with pytest.raises(ub.ArgumentError, match=f"the time function is {value} at t = 0"):
        ub.PrescribedMotion(lambda t: value)


def test_a_law_without_a_value_far_away_is_met_by_shorter_steps():
    """A wall at 10 mm: the first iterate of the whole step is beyond, by 3 EI/L³ = 30 N/m."""

    def wall(motion, rate):
        beyond.append(motion >= 0.01)
        return -0.01 * math.log(1 - motion / 0.01) if motion < 0.01 else math.nan

    beyond = []
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
    stop = ub.Slide(ub.ground(1, 0), beam.end, ub.ForceLaw(wall), axis=(0, 1))
    push = ub.PointLoad(beam.end, (0, 0.36), amplitude=lambda t: t)
    scene = clamped(beam, loads=[push], connectors=[stop])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, comm=MPI.COMM_SELF)
    way = solution.connector(stop).motion[-1]
    assert 0.0095 < way < 0.01
    assert solution.connector(stop).force[-1] == pytest.approx(wall(way, 0.0), rel=1e-6)
    assert any(beyond)
    assert solution.substeps > 1  # it was cut


def test_a_guide_that_ends_is_a_failed_step():
    """The curve is known up to 1 mm; the load along it brings the point there at t = 0.1 s."""
    scene = girder(
        joints=lambda b: ub.Guided(
            b.end, lambda s: (1 + s, ufl.conditional(s < 1e-3, s, math.nan))
        ),
        loads=lambda b: ub.PointLoad(b.end, (100.0, 1.0), amplitude=lambda t: t),
    )
    with pytest.raises(ub.ConvergenceError, match=r"girder.end .* no nearest point") as failure:
        run(scene, ub.EnergyMomentum())
    assert "singular" not in str(failure.value)
