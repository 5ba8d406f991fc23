# SPDX-License-Identifier: MIT
"""Schemes and recorders of users that are incomplete are refused by the names of what they lack."""

from dataclasses import dataclass

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.records import members
from ufl_beam.simulation import step_equation

BEAM = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0), cells=2)
SCENE = clamped(BEAM)


@pytest.fixture(autouse=True)
def no_mesh(monkeypatch):
    """Whatever is refused below is refused before any mesh exists."""

    def made(*_, **__):
        raise AssertionError("a mesh was made")

    monkeypatch.setattr(step_equation, "Fields", made)
    monkeypatch.setattr("ufl_beam.simulation.simulation.Subdomain", made)


def refused(said, scheme=None, **more):
    with pytest.raises(ub.ArgumentError) as caught:
        ub.simulate(SCENE, scheme or ub.EnergyMomentum(), t=(0, 0.1), dt=0.01, **more)
    assert said in str(caught.value)


def without(*names):
    """A scheme in statics that has all but some members."""
    static = ub.Static()
    return type("Mine", (), {n: getattr(static, n) for n in members(Scheme) if n not in names})()


@pytest.mark.parametrize("names", [("half_tangents",), ("theta", "mean"), ("mean",)])
def test_a_scheme_that_lacks_something(names):
    refused(f"scheme: Mine is not a time scheme: it lacks {', '.join(names)}", without(*names))


@pytest.mark.parametrize("name", [n for n in members(Scheme) if n != "dynamic"])
def test_each_member_counts(name):
    refused(f"it lacks {name}", without(name))


def test_a_scheme_with_inertia_that_lacks_something():
    @dataclass(frozen=True)
    class Mine(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics):
        alpha = 0.0

    refused("lacks coefficients, error_weights", Mine())


def test_a_method_with_other_arguments():
    class Mine(ub.EnergyMomentum):
        def coefficients(self, dt):
            return super().coefficients(dt, dt, 0)

    said = (
        "Mine is not a time scheme: its method coefficients cannot be called as "
        "coefficients(dt, last_dt, known)"
    )
    refused(said, Mine())
    named = without("mean")
    type(named).mean = 1.0
    refused("its method mean cannot be called as mean(f, q0, q1)", named)


def test_more_arguments_with_defaults_are_no_fault():
    class Mine(ub.EnergyMomentum):
        def slip(self, dt, change, rates, more=0):
            return 0.0 * change

    with pytest.raises(AssertionError, match="a mesh was made"):
        ub.simulate(SCENE, Mine(), t=(0, 0.1), dt=0.01)


def test_a_scheme_that_cannot_be_hashed():
    mine = without()
    type(mine).__hash__ = None
    refused("Mine cannot be hashed, and forms are kept by scheme; decorate the class with", mine)


@pytest.mark.parametrize("value", [1.0, "EnergyMomentum", ub.EnergyMomentum, object(), np.zeros(3)])
def test_no_scheme_at_all(value):
    with pytest.raises(
        ub.ArgumentError, match=r"must be a scheme, such as Static\(\) or EnergyMomentum\(\)"
    ):
        ub.simulate(SCENE, value, t=(0, 0.1), dt=0.01)


# -- recorders -----------------------------------------------------------------------------------


def test_a_recorder_without_its_base_class():
    class Mine:
        def open(self, simulation): ...
        def write(self, simulation): ...

    refused("simulate: record[0] = <", record=[Mine()])
    refused("is not a Recorder; derive your own classes from ub.extend.Recorder", record=[Mine()])


def test_a_recorder_that_lacks_a_method():
    class Mine(ub.extend.Recorder):
        def open(self, simulation): ...

    with pytest.raises(TypeError, match=r"Mine .*write"):
        Mine()


def test_a_recorder_with_other_arguments():
    class Mine(ub.extend.Recorder):
        def open(self, simulation): ...
        def write(self, simulation, t): ...

    said = "record[0]: Mine is not a recorder: its method write cannot be called as "
    refused(said + "write(simulation)", record=Mine())
