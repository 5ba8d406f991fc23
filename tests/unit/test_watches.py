# SPDX-License-Identifier: MIT
"""The ledger watches its own signs: dissipation, stored energy, losses to the scheme."""

import warnings
from dataclasses import dataclass
from typing import ClassVar

from mpi4py import MPI

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.output.state_rows import DISSIPATED, HINGE, PLASTIC
from ufl_beam.simulation.solution import Solution

STEEL = {"EA": 4e8, "GA": 1e8, "EI": 1.4e6, "rhoA": 40.0}


@dataclass(frozen=True)
class Elastic(ub.extend.MaterialLaw):
    """Elastic with a cubic term, a stress at no strain, and a sign of the energy."""

    cubic: float = 0.0
    initial: float = 0.0
    sign: float = 1.0
    variables: ClassVar = {}

    def stress(self, strain, state):
        return self.C * (strain - self.initial) + self.cubic * strain**3

    def elastic_energy(self, strain, state):
        quadratic = self.C * (strain**2 / 2 - self.initial * strain)
        return self.sign * (quadratic + self.cubic * strain**4 / 4)


def bent(spring=None, **section):
    """A cantilever, or one on a spring in the place of the clamp, that a load bends to and fro."""
    beam = ub.Beam((0, 0), (2, 0), ub.Section(**STEEL, **section), cells=2, name="girder")
    load = ub.PointLoad(beam.end, (0, -1e4), amplitude=ub.Table((0, 1, 2), (0, 1, -1)))
    parts = {"supports": [ub.Clamped(beam.start)]}
    if spring is not None:
        base = ub.Turn(ub.ground(0, 0), beam.start, spring)
        parts = {"supports": [ub.Pinned(beam.start)], "connectors": [base]}
    return ub.Scene([beam], loads=[load], **parts)


def run(scene, scheme=None, t=(0, 2), dt=0.02, **more):
    """The warnings of a run, and its solution."""
    scheme = ub.EnergyMomentum(0.05, 0.05) if scheme is None else scheme
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution = ub.simulate(scene, scheme, t=t, dt=dt, comm=MPI.COMM_SELF, **more)
    return [str(one.message) for one in caught if one.category is ub.ModelWarning], solution


def about(said, solution, *parts):
    """The one warning that has all parts, which the solution says, too."""
    found = [one for one in said if all(part in one for part in parts)]
    assert len(found) == 1, said
    assert found[0] in str(solution)
    return found[0]


# -- dissipation -----------------------------------------------------------------------------------


YIELDS = ub.ElastoPlastic(1.4e4, isotropic=1e5)
FALL = 1e4  # J, more than a step dissipates


def falling(after, entry="plastic"):
    """Let an entry of kept states fall once after a time, with its cell or connector."""
    grow = Solution.grow

    def grow_less(self, number=1):
        grow(self, number)
        for n in range(len(self) - number, len(self)):
            columns, row = self.row(n)
            if columns.column_of("t", row) > after:
                columns.column_of(f"lost: {entry}", row)[...] -= FALL
                columns.column_of("material", row)[
                    0:1, PLASTIC if entry == "plastic" else HINGE
                ] -= FALL
                columns.column_of("connectors", row)[0:1, DISSIPATED] -= FALL

    return grow_less


@pytest.mark.parametrize(
    ("entry", "begin", "more"),
    [
        ("plastic", 1.5, {}),
        ("plastic", 1.5, {"record": ub.Events()}),
        ("hinges", 1.0, {"every": 2}),
        ("hinges", 1.0, {"max_states": 30}),
    ],
)
def test_dissipation_that_falls_names_the_cell(entry, begin, more, monkeypatch):
    """In steps that C keeps and in those of Python, in states of all steps or of some."""
    monkeypatch.setattr(Solution, "grow", falling(begin, entry))
    section = {"bending": YIELDS} if entry == "plastic" else {"hinge": ub.Softening(1.4e4, 1e4)}
    said, solution = run(bent(**section), **more)
    one = about(said, solution, "girder, cell at s = 0.25: ", repr(entry), "falls by")
    t = float(one.partition("between t = ")[2].partition(" and ")[0])
    assert begin - 0.2 < t <= begin + 1e-9


def test_dissipation_of_a_spring_names_the_connector(monkeypatch):
    monkeypatch.setattr(Solution, "grow", falling(1.5))
    said, solution = run(bent(spring=ub.Spring(1e7, law=YIELDS)))
    about(said, solution, "Turn(ground (0, 0), girder.start (0, 0)): ", "'plastic'", "falls by")


def test_runs_that_are_right_do_not_warn():
    for parts in ({"bending": YIELDS}, {"hinge": ub.Softening(1.4e4, 1e4)}):
        said, _ = run(bent(**parts))
        assert not [one for one in said if "falls by" in one]


@pytest.mark.parametrize(
    ("law", "number", "entry"),
    [(ub.Damper(1e2), "viscosity", "damping"), (ub.Coulomb(1e3), "force", "friction")],
    ids=["damper", "friction"],
)
def test_a_connector_that_drives(law, number, entry):
    object.__setattr__(law, number, -getattr(law, number))
    beam = ub.Beam((0, 0), (2, 0), ub.Section(**STEEL), cells=2, name="girder")
    device = ub.Slide(ub.ground(2, 0), beam.end, law, axis=(0, 1))
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, (0, -1e4))], connectors=[device])
    said, solution = run(scene, t=(0, 0.05), dt=1e-3)
    about(said, solution, "Slide(ground (2, 0), girder.end (2, 0)): ", repr(entry), "falls by")


# -- stored energy ---------------------------------------------------------------------------------


def test_stored_energy_below_zero():
    said, solution = run(bent(bending=Elastic(sign=-1.0)))
    about(said, solution, "the stored energy is -", "at t = ", "elastic_energy")


def test_an_energy_without_a_zero_may_be_negative():
    """A spring with a force at no motion, which a compressive motion relieves."""
    spring = ub.Spring(1e7, law=Elastic(initial=0.01))
    said, solution = run(bent(spring=spring), ub.EnergyMomentum(), t=(0, 0.02), dt=1e-3)
    assert solution.energy["stored"].min() < 0
    assert not [one for one in said if "the stored energy is" in one]


def test_a_curved_elastic_law_is_not_blamed():
    """It dissipates nothing, and no warning says otherwise."""
    said, solution = run(bent(bending=Elastic(cubic=1e11)), dt=0.25)
    assert not solution.energy["plastic"].any()
    assert not said


# -- the scheme ------------------------------------------------------------------------------------


FORGETFUL = ub.EnergyMomentum(alpha=0.5, beta=0.5)


def shaken(push, scheme, steps, stiffness=(2 * np.pi / 50) ** 2):
    """A mass on a spring, whose period is 50 s, under a force in steps of 1 s."""
    body = ub.Body((0, 0), mass=1.0, inertia=1.0, name="mass")
    way = ub.Prismatic(ub.ground(0, 0), body.middle, axis=(1, 0))
    spring = ub.Slide(ub.ground(0, 0), body.middle, ub.Spring(stiffness), axis=(1, 0))
    load = ub.PointLoad(body.middle, (1, 0), amplitude=push)
    scene = ub.Scene([], joints=[way], loads=[load], connectors=[spring], bodies=[body])
    return run(scene, scheme, t=(0, steps), dt=1.0)


def sine(period):
    return lambda t: np.sin(2 * np.pi * t / period)


def test_a_load_at_each_step_is_lost():
    """A jolt of alternating sign at each step, in a scheme that forgets motions at once."""
    said, solution = shaken(sine(2.5), FORGETFUL, 150)
    about(said, solution, "the time scheme took", "the entry 'numerical'", "from t = 0 to 100 s")
    assert "numerical" not in "".join(shaken(sine(2.5), FORGETFUL, 90)[0])


@pytest.mark.parametrize(
    "scheme", [FORGETFUL, ub.EnergyMomentumDecaying(1 / 3), ub.GeneralizedAlpha(0.5)], ids=str
)
def test_a_resonance_that_only_the_scheme_damps(scheme):
    """All work is lost, in many periods; each step loses a part of what the scene holds."""
    said, _ = shaken(sine(50.0), scheme, 3000)
    assert not said


def test_a_blow_that_dies_out():
    """All energy is lost in some steps, down to the last digits, but once."""
    said, solution = shaken(ub.Table((0, 1, 2), (0, 1, 0)), FORGETFUL, 1000, stiffness=100.0)
    assert solution.energy["numerical"][-1] > 0.9 * solution.energy["loads"][-1]
    assert not said


def test_a_run_that_goes_on_remembers_its_warnings(tmp_path, monkeypatch):
    monkeypatch.setattr(Solution, "grow", falling(0.5))
    backup = ub.Checkpoint(tmp_path / "run.checkpoint", every=10)
    said, _ = run(bent(bending=YIELDS), t=(0, 1), dt=0.02, checkpoint=backup)
    monkeypatch.undo()
    again, solution = run(bent(bending=YIELDS), t=(0, 2), dt=0.02, checkpoint=backup)
    about(said, solution, "'plastic'")
    assert not [one for one in again if "'plastic'" in one]
