# SPDX-License-Identifier: MIT
"""Laws that bear a stress at no strain: temperature, shrinkage, prestress."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from helpers import raises
from uniaxial_points import LENGTH, Bars, C, histories
from user_laws import Eigenstrain, YieldingEigenstrain

import ufl_beam as ub
import ufl_beam.structures as st

L, EI, E0 = 8.0, 1e8, 1e-4
STIFF = {"EA": 1e9, "GA": 1e9, "EI": EI, "rhoA": 100.0, "rhoI": 1.0}
CURVED = ub.Section(**STIFF, bending=Eigenstrain(E0))
SIMPLE = [lambda beam: ub.Pinned(beam.start), lambda beam: ub.Roller(beam.end)]
CLAMPED = [lambda beam: ub.Clamped(beam.start), lambda beam: ub.Clamped(beam.end)]


def scene(supports, section=CURVED, **more):
    beam = ub.Beam((0, 0), (L, 0), section, cells=8, name="girder")
    return beam, ub.Scene([beam], supports=[make(beam) for make in supports], **more)


@pytest.mark.parametrize(
    ("scheme", "dt", "reference"),
    [
        (ub.Static(), 0.25, False),
        (ub.EnergyMomentumStatic(1.0), 1.0, False),
        (ub.Static(), 1.0, True),
        (ub.EnergyMomentumStatic(1.0), 0.25, True),
    ],
)
def test_eigenstrains_bend_a_free_beam_and_load_a_clamped_one(scheme, dt, reference):
    """[closed] The simple beam bends to e0 and bears nothing; the clamped one bears -EI e0."""
    options = {"t": (0, 1), "dt": dt, "newton": ub.Newton(reference=reference)}
    beam, simple = scene(SIMPLE)
    run = ub.simulate(simple, scheme, **options)
    # An arc of the angle 8e-4: its rise differs by the square of that.
    rise = (1 - math.cos(E0 * L / 2)) / E0
    assert -run.displacement(beam.at(0.5))[-1, 1] == pytest.approx(rise, rel=1e-6)
    assert np.abs(run.diagram(beam).M).max() < 1e-9 * EI * E0
    beam, clamped = scene(CLAMPED)
    run = ub.simulate(clamped, scheme, **options)
    assert np.abs(run.displacement(beam.at(0.5))).max() < 1e-15 * L
    assert np.abs(run.diagram(beam).M + EI * E0).max() < 1e-9 * EI * E0
    assert run.energy.worst < 1e-12


def pressed(section, load):
    """A simple beam with a load that grows in its middle; the middle."""
    beam, simple = scene(SIMPLE, section)
    middle = beam.at(0.5)
    push = ub.PointLoad(middle, force=(0, -load), amplitude=lambda t: t)
    return ub.Scene([beam], supports=simple.supports, loads=[push]), middle


def test_a_load_beside_it():
    """[closed] Deflections of a small load and of the eigenstrain add up, in each of many steps."""
    (both, middle), (plain, alone) = (pressed(s, 1e3) for s in (CURVED, ub.Section(**STIFF)))
    y = ub.simulate(both, ub.Static(), t=(0, 1), dt=0.1).displacement(middle)[:, 1]
    added = ub.simulate(plain, ub.Static(), t=(0, 1), dt=0.1).displacement(alone)[:, 1]
    assert y[1:] - y[1] == pytest.approx(added[1:] - added[1], rel=1e-5)  # (e0 L)², with dy
    path = ub.follow(both, ub.LoadControl(0.1), steps=10)
    of_path = path.displacement(middle)[:, 1]
    assert of_path[0] == pytest.approx(y[-1] - (y[-1] - y[1]) / 0.9)
    assert of_path[-1] == pytest.approx(y[-1], rel=1e-6)
    assert path.energy.worst < 1e-7  # of the trapezoidal rule, (curvature L)²


@pytest.mark.parametrize("law", [st.ArmstrongFrederick(1e12, 1.0, 1.0), Eigenstrain(0.0)], ids=repr)
def test_round_off_of_dissipation_turns_no_path(law):
    """A path on which nothing yields is that of the elastic beam."""
    paths = [
        ub.follow(pressed(section, 1e5)[0], ub.ArcLength(0.01), steps=20).times
        for section in (ub.Section(**STIFF), ub.Section(**STIFF, bending=law))
    ]
    assert paths[1] == pytest.approx(paths[0], rel=1e-9)


def test_a_spring_that_is_too_long():
    """[closed] Two springs in a row, one of them by e0 too long: its stiffness takes its share."""
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STIFF), cells=2)
    springs = [
        ub.Stretch(ub.ground(-1, 0), beam.start, ub.Spring(1e3, law=Eigenstrain(0.02))),
        ub.Stretch(beam.end, ub.ground(2, 0), ub.Spring(3e3)),
    ]
    guide = [ub.Roller(beam.start), ub.Roller(beam.end)]
    held = ub.Scene([beam], supports=guide, connectors=springs)
    run = ub.simulate(held, ub.Static(), t=(0, 1), dt=0.5)
    assert run.displacement(beam.start)[-1, 0] == pytest.approx(0.02 / 4, rel=1e-5)  # of EA
    with raises("modes: Eigenstrain of Stretch(", "at no strain"):
        ub.modes(held, 1)


@dataclass(frozen=True)
class Both(ub.extend.MaterialLaw):
    """Axial strain and curvature that are free."""

    axial: float
    bending: float
    resultants: ClassVar = "NM"

    def stress(self, strain, state):
        return tuple(c * (e - x) for c, e, x in zip(self.C, strain, self._free, strict=True))

    def elastic_energy(self, strain, state):
        return sum(c * (e - x) ** 2 / 2 for c, e, x in zip(self.C, strain, self._free, strict=True))

    @property
    def _free(self):
        return self.axial, self.bending


def test_of_interacting_resultants():
    """[closed] A cantilever grows by the axial one, and its end turns by the other times L."""
    section = ub.Section(**STIFF, interaction=Both(1e-3, E0))
    beam, cantilever = scene(CLAMPED[:1], section)
    run = ub.simulate(cantilever, ub.Static(), t=(0, 1), dt=1.0)
    assert run.displacement(beam.end)[-1, 2] == pytest.approx(E0 * L, rel=1e-9)
    assert run.displacement(beam.end)[-1, 0] == pytest.approx(1e-3 * L, rel=1e-3)  # less the arc's
    assert np.abs(run.section_forces_at(beam.start)[-1, 0]) < 1e-9 * 1e9 * 1e-3


@pytest.mark.filterwarnings("ignore:the energy ledger is open:ufl_beam.ModelWarning")  # at rest
@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(0.05), ub.EnergyMomentumDecaying(), ub.Newmark()], ids=repr
)
def test_a_beam_vibrates_about_its_static_state(scheme):
    """From the undeformed scene it vibrates about the static solution; from that it stays there."""
    beam, simple = scene(SIMPLE)
    run = ub.simulate(simple, scheme, t=(0, 0.5), dt=2e-3)
    y, rise = -run.displacement(beam.at(0.5))[:, 1], E0 * L**2 / 8
    # The first mode has 32/(π³) of it, and is 0.04 s long: means over 12 periods
    assert y.mean() == pytest.approx(rise, rel=0.03)
    assert y.max() == pytest.approx(2 * rise, rel=0.1)
    if not isinstance(scheme, ub.Newmark):
        assert run.energy.worst < 1e-9
    still = ub.simulate(simple, ub.Static(), t=(0, 1), dt=1.0)
    run = ub.simulate(simple, scheme, t=(1, 1.1), dt=2e-3, start=still)
    assert np.ptp(run.displacement(beam.at(0.5))[:, 1]) < 1e-9 * rise


@pytest.mark.filterwarnings("ignore:the energy ledger is open:ufl_beam.ModelWarning")  # at rest
def test_analyses_about_the_undeformed_scene_are_refused():
    """It is not in equilibrium; about a static solution they are those of the elastic beam."""
    beam, simple = scene(SIMPLE, loads=[])
    plain, elastic = scene(SIMPLE, ub.Section(**STIFF))
    push = [ub.PointLoad(one.end, force=(-1e5, 0)) for one in (beam, plain)]
    pushed = ub.Scene([beam], supports=simple.supports, loads=push[:1])
    for analyse in (lambda: ub.modes(simple, 1), lambda: ub.buckling(pushed, 1)):
        with raises("Eigenstrain of girder bears a stress at no strai"):
            analyse()
    with raises("EnergyMomentumStatic(theta=0.5): Eigenstrain of girder"):
        ub.simulate(simple, ub.EnergyMomentumStatic(0.5), t=(0, 1), dt=0.5)
    at = ub.simulate(simple, ub.Static(), t=(0, 1), dt=1.0)
    held = ub.simulate(simple, ub.EnergyMomentumStatic(0.5), t=(1, 2), dt=0.5, start=at)
    y = held.displacement(beam.at(0.5))[:, 1]
    assert y == pytest.approx(np.full(3, at.displacement(beam.at(0.5))[-1, 1]), rel=1e-9)
    omega = ub.modes(elastic, 1).omega
    assert ub.modes(simple, 1, at=at).omega == pytest.approx(omega, rel=1e-6)  # (e0 L)²
    factors = ub.buckling(ub.Scene([plain], supports=elastic.supports, loads=push[1:]), 1).factors
    assert ub.buckling(pushed, 1, at=at).factors == pytest.approx(factors, rel=1e-4)


@pytest.mark.parametrize(
    "law", [Eigenstrain(0.01), YieldingEigenstrain(2.0, 20.0, 10.0, 0.5)], ids=["elastic", "yields"]
)
@pytest.mark.parametrize("scheme", [ub.EnergyMomentumStatic(0.5), ub.EnergyMomentumStatic(0.8)])
def test_work_is_stored_or_dissipated_or_lost(scheme, law):
    """At points; what is dissipated is none, or what limit and viscosity take."""
    for k in range(4):
        one, through = Bars(1, law, None, scheme), 0.0
        one.points.refresh(np.zeros((1, 3)))
        stored = one.points.sums[3:5].sum()
        assert stored == pytest.approx(C * 0.01**2 / 2 * LENGTH)
        for strain in histories(8)[:, 2 * k + 1]:
            before = one.strain[0]
            (σ,) = one.step([strain])
            plastic, _, lost, elastic, hardening, _, _ = one.points.sums
            work, now = σ * (strain - before) * LENGTH, elastic + hardening
            through = max(through, abs(work), now, C * strain**2 * LENGTH)
            left = work - (now - stored) - plastic - (2 * scheme.theta - 1) * lost
            assert abs(left) < 1e-13 * through
            assert plastic > -1e-13 * through
            if isinstance(law, Eigenstrain):
                assert plastic < 1e-13 * through
            stored = now
