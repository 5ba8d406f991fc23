# SPDX-License-Identifier: MIT
"""Functions of users that return NaN or infinity: the message names function and time."""

import math
import re

from mpi4py import MPI

import numpy as np
import pytest
import ufl

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=4e3, EI=10.0, rhoA=1.0, rhoI=1e-3)
SCHEMES = [ub.EnergyMomentum(), ub.Static(), ub.GeneralizedAlpha(0.8)]
WRONG = [math.nan, math.inf, -math.inf]
EITHER = ub.ArgumentError, ub.ConvergenceError


def girder(**parts):
    """A cantilever with one part of each kind, made from its beam."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
    made = {name: [make(beam)] for name, make in parts.items()}
    held = () if "supports" in made else [ub.Clamped(beam.start)]
    return ub.Scene([beam], **{"supports": held, **made})


def after(value, begin=0.25):
    """A function of time that is good until some time."""
    return lambda t: 1e-3 * t if t < begin else value


def loaded(make):
    return lambda value: girder(loads=lambda b: make(b, after(value)))


def turned(law):
    return lambda value: girder(connectors=lambda b: ub.Turn(ub.ground(2, 0), b.end, law(value)))


def work(kind, density):
    return lambda value: girder(works=lambda b: kind("push", density, numbers={"c": after(value)}))


TIME, RETURNED = "the time function is", "the function returned"
AT_END, TURN = f" at girder.end (1, 0): {TIME}", "Turn(ground (2, 0), girder.end (1, 0)): "
LATER = {
    "PointLoad": (loaded(lambda b, f: ub.PointLoad(b.end, (1, 0), amplitude=f)), AT_END),
    "FollowerLoad": (loaded(lambda b, f: ub.FollowerLoad(b.end, (1, 0), amplitude=f)), AT_END),
    "LineLoad": (loaded(lambda b, f: ub.LineLoad(b, (1, 0), amplitude=f)), f" on girder: {TIME}"),
    "MovingLoad": (loaded(lambda b, f: ub.MovingLoad(b, f, (1, 0))), f" on girder: {TIME}"),
    "Pressure": (loaded(lambda b, f: ub.Pressure(b, 1.0, amplitude=f)), f" on girder: {TIME}"),
    "Gravity": (loaded(lambda b, f: ub.Gravity(amplitude=f)), f": {TIME}"),
    "PrescribedDisplacement": (
        lambda value: girder(
            supports=lambda b: ub.PrescribedDisplacement(b.start, u=0, v=after(value), psi=0)
        ),
        f" at girder.start (0, 0): {TIME}",
    ),
    "PrescribedMotion": (turned(lambda v: ub.PrescribedMotion(after(v))), TIME),
    "PrescribedForce": (turned(lambda v: ub.PrescribedForce(after(v))), TIME),
    "Controller": (
        turned(lambda v: ub.Controller(lambda now: after(v)(now.t))), "the controller returned"
    ),
    "ForceLaw": (
        turned(lambda v: ub.ForceLaw(lambda e, rate, t: 1e-3 * e + after(v)(t))), RETURNED
    ),
    "state of a ForceLaw": (
        turned(lambda v: ub.ForceLaw(lambda e, de, t, state: (1e-3, [after(v)(t)]), state=[0.0])),
        RETURNED,
    ),
    "VirtualWork": (work(ub.VirtualWork, lambda w, c: c * w[1]), f" 'push': {TIME}"),
    "Potential": (work(ub.Potential, lambda q, c: c * q[1]), f" 'push': {TIME}"),
}  # fmt: skip
"""Scenes of a function that is wrong later, and words after the name of its owner."""


def failure_of(scene, scheme):
    """Error of a run, and its message, which says nothing of tangents or of what holds twice."""
    with pytest.raises(EITHER) as failure:
        ub.simulate(scene, scheme, t=(0, 1), dt=0.1, comm=MPI.COMM_SELF)
    said = str(failure.value)
    assert "singular" not in said
    assert "twice" not in said
    return failure.value, said


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda x: type(x).__name__)
@pytest.mark.parametrize("kind", LATER)
def test_a_later_call_is_named_with_its_time(kind, scheme):
    """Results up to the time remain."""
    make, words = LATER[kind]
    for value, name in ((math.nan, "nan"), (math.inf, "inf")):
        error, said = failure_of(make(value), scheme)
        owner = kind if words[0] in " :" else TURN
        assert f"{owner}{words} " in said
        assert name in said
        # The time that the message names last before it gives advice
        time = re.findall(r"t = ([-+.e\d]+) s", said.partition(" N)")[0])[-1]
        assert 0.25 - 1e-9 <= float(time) <= 0.3 + 1e-9
        assert 0.2 - 1e-9 <= error.solution.times[-1] <= 0.3 + 1e-9
        assert np.isfinite(error.solution.q).all()
        if kind == "PointLoad" and scheme == ub.EnergyMomentum():  # 1/4096 of a step before it
            assert error.solution.times[-1] == pytest.approx(0.25, rel=3e-3)


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda x: type(x).__name__)
@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda v: ub.ForceLaw(lambda e, rate: v), "the function returned"),
        (lambda v: ub.Controller(lambda now: v), "the controller returned"),
        (lambda v: ub.ForceLaw(lambda e, rate: e, stored=lambda e: v), "the energy returned"),
    ],
    ids=["ForceLaw", "Controller", "stored"],
)
def test_the_first_call_is_named(law, words, scheme):
    for value in WRONG:
        assert f"{TURN}{words} {value}" in failure_of(turned(law)(value), scheme)[1]


def test_a_law_without_a_value_far_away_is_met_by_shorter_steps():
    """A wall at 10 mm: the first iterate of the whole step is beyond, by 3 EI/L³ = 30 N/m."""

    def wall(motion, rate):
        beyond.append(motion >= 0.01)
        return -0.01 * math.log(1 - motion / 0.01) if motion < 0.01 else math.nan

    beyond = []
    scene = girder(
        connectors=lambda b: ub.Slide(ub.ground(1, 0), b.end, ub.ForceLaw(wall), axis=(0, 1)),
        loads=lambda b: ub.PointLoad(b.end, (0, 0.36), amplitude=lambda t: t),
    )
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, comm=MPI.COMM_SELF)
    stop = solution.connector(scene.connectors[0])
    assert 0.0095 < stop.motion[-1] < 0.01
    assert stop.force[-1] == pytest.approx(wall(stop.motion[-1], 0.0), rel=1e-6)
    assert any(beyond)
    assert solution.substeps > 1  # it was cut


def test_a_guide_that_ends_is_a_failed_step():
    """The curve is known up to 1 mm; the load along it brings the point there at t = 0.1 s."""
    curve = lambda s: (1 + s, ufl.conditional(s < 1e-3, s, math.nan))  # noqa: E731
    scene = girder(
        joints=lambda b: ub.Guided(b.end, curve),
        loads=lambda b: ub.PointLoad(b.end, (100.0, 1.0), amplitude=lambda t: t),
    )
    error, said = failure_of(scene, ub.EnergyMomentum())
    assert isinstance(error, ub.ConvergenceError)
    assert re.search(r"girder.end .* no nearest point", said)
