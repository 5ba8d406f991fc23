# SPDX-License-Identifier: MIT
"""The ledger: its arithmetic and entries; it closes in every scheme, at every step size."""

import math
import warnings
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises
from scenes import SECTION, clamped

import ufl_beam as ub

CLOSED = 1e-9
"""Largest imbalance of a ledger as a part of its throughput."""


# -- arithmetic ----------------------------------------------------------------------------------


def energy(**more):
    """A ball that is thrown, stored in a spring, with some loss: numbers in binary."""
    groups = {
        "state": {"stored": np.array([0.0, 1.0, 4.0]), "kinetic": np.array([8.0, 8.0, 2.0])},
        "supplied": {"loads": np.array([0.0, 2.0, 1.0])},
        "lost": {"numerical": np.array([0.0, 1.0, 3.0])},
        **more,
    }
    return ub.Energy(**groups)


def test_total_and_imbalance():
    assert list(energy().total) == [8, 9, 6]
    assert list(energy().imbalance) == [0, 0, 0]
    assert list(energy(lost={}).imbalance) == [0, -1, -3]
    # At most 9 J in the scene; 2 J in and 1 J out again
    assert energy().energy_transferred == 9 + 2 + 1
    off = energy(supplied={"loads": np.array([0.0, 2.0, 5.0])})
    assert list(off.imbalance) == [0, 0, -4]
    assert off.worst == 4 / (9 + 5)
    nothing = ub.Energy({"stored": np.zeros(3)}, {}, {})
    assert nothing.energy_transferred == nothing.worst == 0


def test_the_ledger_can_be_read():
    lines = str(energy()).splitlines()
    assert lines[0] == "energy at the end"
    assert lines[1].split() == ["in", "scene", "stored", "4.000000e+00", "J"]
    assert lines[3].split() == ["supplied", "loads", "1.000000e+00", "J"]
    assert lines[4].split() == ["lost", "numerical", "3.000000e+00", "J"]
    assert "imbalance at most 0.0e+00 of 1.200000e+01 J transferred" in lines[5]


def test_a_ledger_is_a_mapping():
    one = energy()
    assert [*one] == ["stored", "kinetic", "loads", "numerical"]
    assert {name: values[-1] for name, values in one.items()}["numerical"] == 3.0
    assert "friction" not in one
    assert 0 not in one
    assert one != energy()
    assert {one: 1}[one] == 1


# -- known energies ------------------------------------------------------------------------------


def test_stored_energy_of_uniform_states():
    """EI κ² L / 2 with κ = M / EI: an end moment of 50 N m on 2 m."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, moment=50.0, amplitude=ub.ramp(1.0))])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    expected = 50.0**2 * 2 / (2 * 100.0) * solution.times**2
    # Newton's method ends below 1e-10 of the forces, and energy is quadratic in what is left
    assert solution.energy["stored"] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    # The moment and the angle grow in proportion: the trapezoidal rule is exact
    assert solution.energy["loads"] == pytest.approx(expected, rel=1e-9, abs=1e-12)


# -- it closes -----------------------------------------------------------------------------------


def busy():
    """Everything that there is: joints, an inclined roller, moved supports, all loads, masses."""
    a = ub.Beam((0, 0), (0, 4), SECTION, cells=3)
    b = ub.Beam((0, 4), (3, 4), SECTION, cells=4)
    c = ub.Beam((3, 4), (3, 0), SECTION, cells=3)
    shaken = {"u": lambda t: 0.2 * np.sin(3 * t), "v": 0, "psi": lambda t: 0.1 * t}
    return ub.Scene(
        [a, b, c],
        joints=[ub.Rigid(a.end, b.start), ub.Revolute(b.end, c.start)],
        supports=[ub.PrescribedDisplacement(a.start, **shaken), ub.Roller(c.end, along=(1, 0.5))],
        loads=[
            ub.PointLoad(b.start, force=(5, 0), moment=2.0, amplitude=ub.ramp(0.5)),
            ub.FollowerLoad(b.at(0.5), force=(0, -30)),
            ub.LineLoad(b, force=(0, -1)),
            ub.Gravity(),
        ],
        masses=[ub.PointMass(b.at(0.5), 2.0, 1.0)],
    )


@pytest.mark.parametrize("dt", [1e-3, 0.1, 0.5])
@pytest.mark.parametrize("weights", [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.5, 0.5)])
def test_the_ledger_of_dynamics_closes(weights, dt):
    """In 40 steps, or the time of the slowest motion."""
    scheme = ub.EnergyMomentum(*weights)
    energy = ub.simulate(busy(), scheme, t=(0, min(40 * dt, 2.0)), dt=dt).energy
    assert energy.worst < CLOSED
    assert set(energy.supplied) == {"loads", "supports"}
    assert energy.energy_transferred > 1e-3  # something happens
    if scheme == ub.EnergyMomentum():
        assert "numerical" not in energy.lost
    else:
        assert (np.diff(energy["numerical"]) >= 0).all()
        assert energy["numerical"][-1] > 0


def pushed(force, section=SECTION, end=(2, 0), cells=4):
    """A cantilever with a force that grows at its end."""
    beam = ub.Beam((0, 0), end, section, cells=cells)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=force, amplitude=ub.ramp(1.0))])


def test_statics_closes_to_the_order_of_its_steps():
    """Works are trapezoidal there: second order, unless forces grow in proportion to motions."""
    scene = pushed((20, -80))
    worst = [
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt).energy.worst for dt in (0.1, 0.05, 0.025)
    ]
    assert worst[-1] < 1e-3
    for coarse, fine in pairwise(worst):
        assert coarse / fine == pytest.approx(4, rel=0.15)


# -- a run says when it is open --------------------------------------------------------------------


def test_a_run_says_when_round_off_opens_its_ledger():
    """A free beam that flies and turns; 1e18 N leaves nothing of 1e-2 J but last digits."""
    # The imbalance is luck: from 1e-7 to 1e-4 with this EA, as the compiler orders the sums.
    section = ub.Section(EA=1e18, GA=1e18, EI=1.0, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((6, 0), (0, 8), section, cells=16)
    scene = ub.Scene([beam], loads=[ub.PointLoad(beam.start, force=(0.01, 0), moment=-0.1)])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 3), dt=0.1)
    # The first process says so for all.
    said = [str(one.message) for one in caught if one.category is ub.ModelWarning]
    assert said == [solution.imbalance_message] * (MPI.COMM_WORLD.rank == 0)
    assert "round-off is estimated at" in solution.imbalance_message
    assert solution.energy.worst > 1e-9
    assert solution.imbalance_message in str(solution)
    assert "last digits of positions" in solution.imbalance_message


def test_a_run_says_when_its_tolerance_opens_the_ledger():
    """No round-off there, but the energy of forces that are missed by a part of 1e-3."""
    energies = energy(lost={"numerical": np.array([0, 0.5, 1.0])})
    assert energies.worst > 1e-3
    assert "does not explain it" in energies.describe_imbalance(1e-9, 1e-13)
    assert "last digits of positions" in energies.describe_imbalance(1e-9, 1.0)
    assert energies.describe_imbalance(1.0, 0.0) == ""


def test_a_scene_that_turns_as_a_whole_has_no_energy_to_balance():
    """It goes where it came from; what its supports work on the way is round-off, and no news."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    turn = ub.PrescribedDisplacement(beam.end, psi=lambda t: math.sin(math.pi * t))
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), turn])
    solution = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=0.01)
    assert solution.energy.energy_transferred < 1e-9
    assert solution.imbalance_message == ""


@pytest.mark.parametrize("scheme", [ub.Newmark(), ub.EnergyMomentumPrinted(), ub.Static()], ids=str)
def test_schemes_that_claim_nothing_say_nothing(scheme):
    solution = ub.simulate(pushed((0, 20.0)), scheme, t=(0, 1), dt=0.25)
    assert solution.energy.worst > 1e-9
    assert solution.imbalance_message == ""


def test_energies_of_nearly_nothing_are_not_compared():
    """Squares of motions of 1e-160 m have lost their digits, and nobody would miss them."""
    run = ub.simulate(pushed((0, 1e-158), end=(2, 1)), ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    assert run.imbalance_message == ""


@pytest.mark.parametrize("force", [1.0, 1e-12])
def test_small_strains_keep_their_digits(force):
    """The ledger of a stiff slanted beam under 1e-12 N closes as that under 1 N does."""
    # With strains as differences of numbers near one it was open by a third of what went through.
    section = ub.Section(EA=2.5e9, GA=8e8, EI=630.0, rhoA=100.0, rhoI=0.1)
    scene = pushed((force, 0), section, end=(1.7, 2.4), cells=8)
    assert ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.01).energy.worst < 1e-12


# -- names and frames ----------------------------------------------------------------------------


def soft_beam(**laws):
    section = ub.Section(EA=1e5, GA=1e5, EI=1.0, rhoA=1.0, rhoI=0.01, **laws)
    return ub.Beam((0, 0), (1, 0), section, cells=4)


def test_a_work_may_not_have_the_name_of_what_a_potential_gains():
    soil = ub.Potential("soil", lambda q, k: k * q[1] ** 2, numbers={"k": ub.ramp(1.0)})
    wind = ub.VirtualWork("soil in time", lambda w: w[1])
    bed = ub.Potential("soil in time", lambda q: q[1] ** 2)
    for other in (wind, bed):
        with raises("'soil in time' has the name ", "'soil' gains"):
            ub.Scene([soft_beam()], works=[other, soil])
    ub.Scene([soft_beam()], works=[wind])


def test_a_work_may_not_have_the_name_of_a_column(tmp_path):
    one = soft_beam()
    spring = ub.Turn(ub.ground(1, 0), one.end, ub.Spring(1.0))
    wind = ub.VirtualWork(f"work {spring}, Spring", lambda w: w[1])
    table = ub.History(tmp_path / "run.csv", connectors=[spring])
    with raises("would be a column of a connector"):
        scene = clamped(one, connectors=[spring], works=[wind])
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1, record=table)


def test_a_scene_is_in_one_frame():
    frames = [ub.RotatingFrame(1.0), ub.RotatingFrame(2.0)]
    with raises("2 rotating frames", "rate=1", "rate=2", "one frame"):
        ub.Scene([soft_beam()], loads=frames)
    ub.Scene([soft_beam()], loads=[frames[0], ub.Gravity(), ub.Gravity((1.0, 0.0))])


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


EXACT = [
    ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentumDecaying(),
    ub.EnergyMomentumStatic(0.5),
]
AT_END = [ub.Static(), ub.Newmark(), ub.GeneralizedAlpha(0.8)]


def bent(scheme, rate=0.0, reference=False):
    one = soft_beam(bending=Stiffening(5.0, rate))
    scene = clamped(one, loads=[ub.PointLoad(one.end, (0, 1.0), amplitude=lambda t: t)])
    newton = ub.Newton(reference=reference)
    return ub.simulate(scene, scheme, t=(0, 1), dt=0.05, newton=newton).energy


@pytest.mark.parametrize(
    ("scheme", "reference"),
    [*((x, False) for x in (*EXACT, *AT_END)), (EXACT[1], True), (AT_END[0], True)],
    ids=str,
)
def test_an_elastic_law_dissipates_nothing(scheme, reference):
    """[exact] zero: the same operations in both terms of a difference."""
    energy = bent(scheme, reference=reference)
    assert energy["stored"][-1] > 0.01
    assert not energy["plastic"].any()
    assert not energy["hardening"].any()
    if scheme in EXACT:
        assert energy.worst < 1e-9
        assert energy.lost["numerical"].any()


@pytest.mark.parametrize("scheme", EXACT, ids=str)
def test_the_ledger_of_a_law_that_flows_closes(scheme):
    energy = bent(scheme, rate=0.5)
    assert energy["plastic"][-1] > 0.05 * energy["stored"][-1]
    assert energy.worst < 1e-9
