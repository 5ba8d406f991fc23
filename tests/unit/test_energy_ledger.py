# SPDX-License-Identifier: MIT
"""The ledger: its arithmetic, and that it closes in every scheme, at every step size."""

import math
import warnings
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
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


def test_entries_by_name():
    one = energy()
    assert list(one["kinetic"]) == [8, 8, 2]
    assert list(one["loads"]) == [0, 2, 1]
    assert list(one["numerical"]) == [0, 1, 3]
    with pytest.raises(KeyError):
        one["hinges"]


def test_total_and_imbalance():
    one = energy()
    assert list(one.total) == [8, 9, 6]
    assert list(one.imbalance) == [0, 0, 0]
    more = energy(supplied={"loads": np.array([0.0, 2.0, 5.0])})
    assert list(more.imbalance) == [0, 0, -4]
    less = energy(lost={})
    assert list(less.imbalance) == [0, -1, -3]


def test_throughput_counts_work_both_ways():
    # At most 9 J in the scene; 2 J in and 1 J out again
    assert energy().energy_transferred == 9 + 2 + 1
    off = energy(supplied={"loads": np.array([0.0, 2.0, 5.0])})
    assert off.worst == 4 / (9 + 5)


def test_a_ledger_of_zeros_has_no_throughput():
    nothing = ub.Energy({"stored": np.zeros(3)}, {}, {})
    assert nothing.energy_transferred == 0
    assert nothing.worst == 0


def test_the_ledger_can_be_read():
    lines = str(energy()).splitlines()
    assert lines[0] == "energy at the end"
    assert lines[1].split() == ["in", "scene", "stored", "4.000000e+00", "J"]
    assert lines[3].split() == ["supplied", "loads", "1.000000e+00", "J"]
    assert lines[4].split() == ["lost", "numerical", "3.000000e+00", "J"]
    assert "imbalance at most 0.0e+00 of 1.200000e+01 J transferred" in lines[5]


# -- known energies ------------------------------------------------------------------------------


def test_stored_energy_of_uniform_states():
    # EI κ² L / 2 with κ = M / EI: an end moment of 50 N m on 2 m
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    moment = ub.PointLoad(beam.end, moment=50.0, amplitude=ub.ramp(1.0))
    scene = clamped(beam, loads=[moment])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    expected = 50.0**2 * 2 / (2 * 100.0) * solution.times**2
    # Newton's method ends below 1e-10 of the forces, and energy is quadratic in what is left
    assert solution.energy["stored"] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    # The moment and the angle grow in proportion: the trapezoidal rule is exact
    assert solution.energy["loads"] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_work_of_gravity_is_the_height_that_is_lost():
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=3)
    scene = ub.Scene(
        [beam],
        supports=[ub.Pinned(beam.start)],
        loads=[ub.Gravity((0.0, -10.0))],
        masses=[ub.PointMass(beam.end, 3.0)],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.8), dt=0.02)
    ends = [solution.displacement(beam.at(i / 3))[:, 1] for i in range(4)]
    # 2 kg in three cells, linear between the vertices, and 3 kg at the end
    sunk = sum((a + b) / 2 * 2 / 3 for a, b in pairwise(ends)) + 3 * ends[-1]
    assert sunk.min() < -3  # it falls
    assert solution.energy["loads"] == pytest.approx(-10 * sunk, abs=1e-12 * 60)  # sums of 60 J


def test_work_of_a_support_that_moves():
    # Static stretch of 1 % of 2 m: EA ε² L / 2
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=3)
    pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.02 * t, v=0, psi=0)
    scene = clamped(beam, pull)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    assert solution.energy["supports"][-1] == pytest.approx(1e4 * 0.01**2, rel=1e-10)
    assert solution.energy["stored"][-1] == pytest.approx(1e4 * 0.01**2, rel=1e-10)
    assert "loads" not in solution.energy.supplied


# -- it closes -----------------------------------------------------------------------------------


def busy():
    """Everything that there is: joints, an inclined roller, moved supports, all loads, masses."""
    a = ub.Beam((0, 0), (0, 4), SECTION, cells=3)
    b = ub.Beam((0, 4), (3, 4), SECTION, cells=4)
    c = ub.Beam((3, 4), (3, 0), SECTION, cells=3)
    return ub.Scene(
        [a, b, c],
        joints=[ub.Rigid(a.end, b.start), ub.Revolute(b.end, c.start)],
        supports=[
            ub.PrescribedDisplacement(
                a.start, u=lambda t: 0.2 * np.sin(3 * t), v=0, psi=lambda t: 0.1 * t
            ),
            ub.Roller(c.end, along=(1, 0.5)),
        ],
        loads=[
            ub.PointLoad(b.start, force=(5, 0), moment=2.0, amplitude=ub.ramp(0.5)),
            ub.FollowerLoad(b.at(0.5), force=(0, -30)),
            ub.LineLoad(b, force=(0, -1)),
            ub.Gravity(),
        ],
        masses=[ub.PointMass(b.at(0.5), 2.0, 1.0)],
    )


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 0.1, 0.5])
@pytest.mark.parametrize(
    "scheme",
    [
        ub.EnergyMomentum(),
        ub.EnergyMomentum(0.1, 0.0),
        ub.EnergyMomentum(0.0, 0.1),
        ub.EnergyMomentum(0.5, 0.5),
    ],
    ids=str,
)
def test_the_ledger_of_dynamics_closes(scheme, dt):
    # 40 steps, or the time of the slowest motion
    solution = ub.simulate(busy(), scheme, t=(0, min(40 * dt, 2.0)), dt=dt)
    energy = solution.energy
    assert energy.worst < CLOSED
    assert set(energy.supplied) == {"loads", "supports"}
    assert energy.energy_transferred > 1e-3  # something happens
    if scheme == ub.EnergyMomentum():
        assert "numerical" not in energy.lost
    else:
        assert (np.diff(energy["numerical"]) >= 0).all()
        assert energy["numerical"][-1] > 0


def test_statics_closes_to_the_order_of_its_steps():
    """Works are trapezoidal there: second order, unless forces grow in proportion to motions."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    loads = [ub.PointLoad(beam.end, force=(20, -80), amplitude=ub.ramp(1.0))]
    scene = clamped(beam, loads=loads)
    worst = [
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt).energy.worst for dt in (0.1, 0.05, 0.025)
    ]
    assert worst[-1] < 1e-3
    for coarse, fine in pairwise(worst):
        assert coarse / fine == pytest.approx(4, rel=0.15)


def test_cutting_a_step_keeps_the_ledger_closed():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    spin = ub.PrescribedDisplacement(beam.start, u=0, v=0, psi=lambda t: 20 * t**2)
    solution = ub.simulate(
        ub.Scene([beam], supports=[spin]), ub.EnergyMomentum(), t=(0, 1), dt=0.25
    )
    assert solution.substeps > 4
    assert len(solution.times) == 5
    assert solution.energy.worst < CLOSED


def test_one_ledger_on_all_ranks():
    from mpi4py import MPI

    scene = busy()
    energies = [
        ub.simulate(scene, ub.EnergyMomentum(0.1, 0.1), t=(0, 0.2), dt=0.02, comm=comm).energy
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]
    for group in ("state", "supplied", "lost"):
        all_of_us, alone = (getattr(energy, group) for energy in energies)
        assert list(all_of_us) == list(alone)
        for name in alone:
            # Energies of up to 10 J from equilibria to 1e-10 of the forces
            assert all_of_us[name] == pytest.approx(alone[name], abs=1e-8)


# -- a run says when it is open --------------------------------------------------------------------


def stiff(EA):
    """A free beam that flies and turns; 1e14 N leaves nothing of 1e-2 J but last digits."""
    section = ub.Section(EA=EA, GA=EA, EI=1.0, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((6, 0), (0, 8), section, cells=16)
    push = ub.PointLoad(beam.start, force=(0.01, 0), moment=-0.1)
    return ub.Scene([beam], loads=[push])


def test_a_run_says_when_round_off_opens_its_ledger():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        # The imbalance is luck: from 1e-7 to 1e-4 with this EA, as the compiler orders the sums.
        solution = ub.simulate(stiff(1e18), ub.EnergyMomentum(), t=(0, 3), dt=0.1)
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
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=2)
    push = ub.PointLoad(beam.end, force=(0, 20.0), amplitude=lambda t: t)
    scene = clamped(beam, loads=[push])
    solution = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
    assert solution.energy.worst > 1e-9
    assert solution.imbalance_message == ""


def test_energies_of_nearly_nothing_are_not_compared():
    """Squares of motions of 1e-160 m have lost their digits, and nobody would miss them."""
    beam = ub.Beam((0, 0), (2, 1), SECTION, cells=2)
    push = ub.PointLoad(beam.end, force=(0, 1e-158), amplitude=lambda t: t)
    scene = clamped(beam, loads=[push])
    assert ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1).imbalance_message == ""


def test_small_strains_keep_their_digits():
    """The ledger of a stiff slanted beam under 1e-9 N closes as that under 1 N does.

    With strains as differences of numbers near one it was open by a third of what went through.
    """
    section = ub.Section(EA=2.5e9, GA=8e8, EI=630.0, rhoA=100.0, rhoI=0.1)
    for force in (1.0, 1e-9, 1e-12):
        beam = ub.Beam((0, 0), (1.7, 2.4), section, cells=8)
        push = ub.PointLoad(beam.end, force=(force, 0), amplitude=lambda t: min(t, 1.0))
        scene = clamped(beam, loads=[push])
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.01)
        assert solution.energy.worst < 1e-12


def test_a_ledger_is_a_mapping():
    one = energy()
    assert [*one] == [*one.keys()] == ["stored", "kinetic", "loads", "numerical"]
    assert len(one) == 4
    assert "loads" in one
    assert "friction" not in one
    assert 0 not in one
    assert one.get("friction") is None
    assert one.get("stored") is one["stored"]
    assert {name: values[-1] for name, values in one.items()}["numerical"] == 3.0
    assert one == one
    assert one != energy()
    assert {one: 1}[one] == 1
