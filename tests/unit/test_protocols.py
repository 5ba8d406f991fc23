# SPDX-License-Identifier: MIT
"""Schemes and recorders of users that are incomplete are refused by the names of what they lack."""

import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.records import members
from ufl_beam.simulation import step_equation

BEAM = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0), cells=2)
SCHEME = ub.EnergyMomentum()


@pytest.fixture(autouse=True)
def no_mesh(monkeypatch):
    """Whatever is refused below is refused before any mesh exists."""

    def made(*_, **__):
        raise AssertionError("a mesh was made")

    monkeypatch.setattr(step_equation, "Fields", made)
    monkeypatch.setattr("ufl_beam.simulation.simulation.Subdomain", made)


def run(scheme=SCHEME, **more):
    ub.simulate(clamped(BEAM), scheme, t=(0, 0.1), dt=0.01, **more)


def without(*names, **others):
    """A scheme in statics that has all but some members."""
    static = ub.Static()
    kept = {n: getattr(static, n) for n in members(Scheme) if n not in names}
    return type("Mine", (), kept | others)()


class Incomplete(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics):
    alpha = 0.0


class OtherArguments(ub.EnergyMomentum):
    def coefficients(self, dt):
        return super().coefficients(dt, dt, 0)


class WithDefaults(ub.EnergyMomentum):
    def slip(self, dt, change, rates, more=0):
        return 0.0 * change


@pytest.mark.parametrize(
    ("scheme", "words"),
    [
        *((without(n), f"it lacks {n}") for n in members(Scheme) if n != "dynamic"),
        (without("theta", "mean"), "scheme: Mine is not a time scheme: it lacks theta, mean"),
        (Incomplete(), "lacks coefficients, error_weights"),
        (
            OtherArguments(),
            "OtherArguments is not a time scheme: its method coefficients cannot be called as "
            "coefficients(dt, last_dt, known)",
        ),
        (without(mean=1.0), "its method mean cannot be called as mean(f, q0, q1)"),
        (
            without(__hash__=None),
            "Mine cannot be hashed, and forms are kept by scheme; decorate the class with",
        ),
        (1.0, "must be a scheme, such as Static() or EnergyMomentum()"),
    ],
)  # fmt: skip
def test_what_is_no_scheme(scheme, words):
    with raises(words):
        run(scheme)


def test_more_arguments_with_defaults_are_no_fault():
    with pytest.raises(AssertionError, match="a mesh was made"):
        run(WithDefaults())


class NoBase:
    def open(self, simulation): ...
    def write(self, simulation): ...


class NoWrite(ub.extend.Recorder):
    def open(self, simulation): ...


class WritesTime(NoWrite):
    def write(self, simulation, t): ...


def test_what_is_no_recorder():
    derive = "is not a Recorder; derive your own classes from ub.extend.Recorder"
    with raises("simulate: record[0] = <", derive):
        run(record=[NoBase()])
    with pytest.raises(TypeError, match=r"NoWrite .*write"):
        NoWrite()
    called = "its method write cannot be called as write(simulation)"
    with raises(f"record[0]: WritesTime is not a recorder: {called}"):
        run(record=WritesTime())
