# SPDX-License-Identifier: MIT
"""Entries of the energy ledger: names that are taken, frames, and elasticity that is not linear."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from helpers import in_turn
from scenes import clamped

import ufl_beam as ub

EXACT = [
    ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentumDecaying(),
    ub.EnergyMomentumStatic(0.5),
]
AT_END = [ub.Static(), ub.Newmark(), ub.GeneralizedAlpha(0.8)]


def beam(**laws):
    section = ub.Section(EA=1e5, GA=1e5, EI=1.0, rhoA=1.0, rhoI=0.01, **laws)
    return ub.Beam((0, 0), (1, 0), section, cells=4)


# -- names and frames --------------------------------------------------------------------------


def test_a_work_may_not_have_the_name_of_what_a_potential_gains():
    soil = ub.Potential("soil", lambda q, k: k * q[1] ** 2, numbers={"k": ub.ramp(1.0)})
    wind = ub.VirtualWork("soil in time", lambda w: w[1])
    bed = ub.Potential("soil in time", lambda q: q[1] ** 2)
    for other in (wind, bed):
        with pytest.raises(ub.ArgumentError, match=r"'soil in time' has the name .* 'soil' gains"):
            ub.Scene([beam()], works=[other, soil])
    ub.Scene([beam()], works=[wind])


def test_a_work_may_not_have_the_name_of_a_column(tmp_path):
    one = beam()
    spring = ub.Turn(ub.ground(1, 0), one.end, ub.Spring(1.0))
    wind = ub.VirtualWork(f"work {spring}, Spring", lambda w: w[1])
    held = [ub.Clamped(one.start)]
    scene = ub.Scene([one], supports=held, connectors=[spring], works=[wind])
    table = ub.History(tmp_path / "run.csv", connectors=[spring])
    with pytest.raises(ub.ArgumentError, match="would be a column of a connector"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1, record=table)


def test_a_scene_is_in_one_frame():
    frames = [ub.RotatingFrame(1.0), ub.RotatingFrame(2.0)]
    with pytest.raises(ub.ArgumentError, match=r"2 rotating frames.*rate=1.*rate=2.*one frame"):
        ub.Scene([beam()], loads=frames)
    ub.Scene([beam()], loads=[frames[0], ub.Gravity(), ub.Gravity((1.0, 0.0))])


# -- elasticity that is not linear -------------------------------------------------------------


@dataclass(frozen=True)
class Stiffening(ub.extend.MaterialLaw):
    """Elastic, with a cubic part; it also flows slowly if ``rate`` is not zero."""

    k: float
    rate: float = 0.0
    variables: ClassVar = {"creep": 0.0}

    def stress(self, strain, state):
        e = strain - state.creep
        return self.C * (e + self.k * e**3)

    def increments(self, strain, state, dt):
        return {"creep": self.rate * dt * (strain - state.creep)}

    def elastic_energy(self, strain, state):
        e = strain - state.creep
        return self.C * (e**2 / 2 + self.k * e**4 / 4)


@dataclass(frozen=True)
class OneSided(Stiffening):
    """Elastic in one direction, soft in the other."""

    def stress(self, strain, state):
        return (
            ub.extend.law_functions.where(ub.extend.law_functions.below(strain, 0.1), 0.1, 1.0)
            * (self.C * (strain - 0.1))
            + 0.01 * self.C
        )

    def elastic_energy(self, strain, state):
        e = strain - 0.1
        part = ub.extend.law_functions.where(ub.extend.law_functions.below(e, 0.0), 0.1, 1.0)
        return self.C * (part * e**2 / 2 + 0.01 * strain)


ELASTIC = Stiffening(5.0), OneSided(0.0)


def bent(law, scheme, reference=False, dt=0.05):
    one = beam(bending=law)
    load = ub.PointLoad(one.end, (0, 1.0), amplitude=lambda t: t)
    scene = clamped(one, loads=[load])
    newton = ub.Newton(reference=reference)
    return ub.simulate(scene, scheme, t=(0, 1), dt=dt, newton=newton).energy


@pytest.mark.parametrize(
    ("law", "scheme", "reference"),
    [
        *((law, scheme, False) for law in ELASTIC for scheme in (*EXACT, *AT_END)),
        *((*pair, True) for pair in in_turn(ELASTIC, [*EXACT, *AT_END])),
    ],
    ids=str,
)
def test_an_elastic_law_dissipates_nothing(law, scheme, reference):
    """[exact] zero: the same operations in both terms of a difference."""
    energy = bent(law, scheme, reference)
    assert energy["stored"][-1] > 0.01
    assert not energy["plastic"].any()
    assert not energy["hardening"].any()
    if scheme in EXACT:
        assert energy.worst < 1e-9
        assert energy.lost["numerical"].any()


def test_the_ledger_of_an_elastic_law_in_statics_is_of_second_order():
    """[estimate] the order of two halvings is within 0.1 of 2."""
    worst = [bent(Stiffening(5.0), ub.Static(), dt=dt).worst for dt in (0.05, 0.025, 0.0125)]
    assert np.log2(worst[0] / worst[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(worst[1] / worst[2]) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("scheme", EXACT, ids=str)
def test_the_ledger_of_a_law_that_flows_closes(scheme):
    energy = bent(Stiffening(5.0, rate=0.5), scheme)
    assert energy["plastic"][-1] > 0.05 * energy["stored"][-1]
    assert energy.worst < 1e-9


def test_dissipation_of_a_law_that_flows_is_the_same_in_all_static_schemes():
    """∫ σ rate (e - creep) dt, to the first order of their steps: 1/256 each, and twice as safe."""
    found = [
        bent(Stiffening(5.0, rate=0.5), scheme, dt=1 / 256)["plastic"][-1]
        for scheme in (ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.5))
    ]
    assert np.ptp(found) < 3 / 256 * found[0]
