# SPDX-License-Identifier: MIT
"""Combinations that hold a motion twice are refused before a run, with the names of all holders."""

import re

from mpi4py import MPI

import numpy as np
import pytest
from scenes import rigid_chain

import ufl_beam as ub

SECTION = ub.Section(EA=1e6, GA=3e5, EI=1e2, rhoA=1.0, rhoI=1e-3)
ORIGIN = ub.ground(0, 0)
FIRST = "Turn(ground (0, 0), arm.start (0, 0))"
REASON = "a RigidPlastic connector holds its motion until it yields"


def fuse():
    return ub.RigidPlastic(ub.ElastoPlastic(10.0, isotropic=1.0))


def motor():
    return ub.PrescribedMotion(lambda t: 0.1 * t)


SCHEME = ub.EnergyMomentum(alpha=0.05, beta=0.05)
ARM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="arm")
ROD = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="rod")
BLOCK = ub.Body((1, 0), mass=1.0, inertia=1.0, name="block")
MIDDLES = ARM.at(0.5), ROD.at(0.5)


def turned(*laws, support=ub.Pinned):
    """The arm with connectors of these laws between ground and arm."""
    turns = [ub.Turn(ORIGIN, ARM.start, law) for law in laws]
    return ub.Scene([ARM], supports=[support(ARM.start)], connectors=turns)


def joined(joint, *connectors):
    """Arm and rod, clamped on both sides, with a joint."""
    supports = [ub.Clamped(ARM.start), ub.Clamped(ROD.end)]
    return ub.Scene([ARM, ROD], joints=[joint], supports=supports, connectors=connectors)


def led(*joints, across=None, **more):
    """The block with joints, and a connector across the x axis."""
    place = ub.ground(1, 0), BLOCK.middle
    drives = [] if across is None else [ub.Slide(*place, across, axis=(0, 1))]
    return ub.Scene(bodies=[BLOCK], joints=joints, connectors=drives, **more)


def along(law):
    return ub.Slide(ARM.end, ROD.start, law, axis=(1, 0))


def met(law):
    return ub.Turn(ARM.end, ROD.start, law)


def pin(**more):
    return ub.Revolute(ARM.end, ROD.start, **more)


def guide():
    return ub.Guided(BLOCK.middle, lambda s: (1 + s, 0.0))


def rail():
    return ub.Prismatic(ub.ground(1, 0), BLOCK.middle, axis=(1, 0))


def ring(law):
    """Two blocks that two bars of fixed length and a connector between join, in parallel."""
    other = ub.Body((1, 1), mass=1.0, inertia=1.0, name="lid")
    bars = [ub.Link(BLOCK.at(x, 0), other.at(x, 1)) for x in (0, 1)]
    strut = ub.Slide(BLOCK.at(3, 0), other.at(3, 1), law, axis=(0, 1))
    return ub.Scene(bodies=[BLOCK, other], joints=bars, connectors=[strut])


GUIDED = "Guided(ground (1, 0), block (1, 0))"
ACROSS = "Slide(ground (1, 0), block (1, 0)) with "
ALONG = "Slide(arm.end (1, 0), rod.start (1, 0)) with "
MET = "Turn(arm.end (1, 0), rod.start (1, 0)) with "
RAIL = "Prismatic(ground (1, 0), block (1, 0))"
PIN = "Revolute(arm.end (1, 0), rod.start (1, 0))"
RIGID = "Rigid(arm.end (1, 0), rod.start (1, 0))"

TABLE = {
    "two rigid-plastic": (
        lambda: turned(fuse(), fuse()),
        [f"{FIRST} with RigidPlastic; {FIRST} with RigidPlastic", REASON],
    ),
    "rigid-plastic and motor": (
        lambda: turned(fuse(), motor()),
        [f"{FIRST} with RigidPlastic", f"{FIRST} with PrescribedMotion", REASON],
    ),
    "rigid-plastic and support": (
        lambda: turned(fuse(), support=ub.Clamped),
        [f"{FIRST} with RigidPlastic", "Clamped at arm.start (0, 0)", REASON],
    ),
    "rigid-plastic and Revolute": (
        lambda: joined(pin(), along(fuse())), [f"{ALONG}RigidPlastic", PIN, REASON]
    ),
    "rigid-plastic and Rigid": (
        lambda: joined(ub.Rigid(ARM.end, ROD.start), met(fuse())),
        [f"{MET}RigidPlastic", RIGID, REASON],
    ),
    "rigid-plastic and guide": (
        lambda: led(guide(), across=fuse()), [GUIDED, f"{ACROSS}RigidPlastic", REASON]
    ),
    "rigid-plastic and Link": (
        lambda: joined(ub.Link(*MIDDLES), ub.Stretch(*MIDDLES, fuse())),
        ["Link(arm.at(0.5)", "Stretch(arm.at(0.5)", REASON],
    ),
    "rigid-plastic in a ring of rigid parts": (
        lambda: ring(fuse()),
        ["Link(block (0, 0), lid (0, 1))", "Slide(block (3, 0), lid (3, 1))", REASON],
    ),
    "two motors": (
        lambda: turned(motor(), motor()),
        [f"{FIRST} with PrescribedMotion; {FIRST} with PrescribedMotion", "Remove one"],
    ),
    "motor and guide": (
        lambda: led(guide(), across=motor()), [GUIDED, f"{ACROSS}PrescribedMotion"]
    ),
    "guide and support": (
        lambda: led(guide(), supports=[ub.Pinned(BLOCK.middle)]), [GUIDED, "Pinned at block (1, 0)"]
    ),
    "guide and Prismatic": (lambda: led(guide(), rail()), [GUIDED, RAIL]),
    "two supports": (
        lambda: ub.Scene([ARM], supports=[ub.Clamped(ARM.start), ub.Pinned(ARM.start)]),
        ["Clamped at arm.start (0, 0)", "Pinned at arm.start (0, 0)", "remove one"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", TABLE)
def test_contradictions_name_all_holders_and_a_remedy(case):
    """All holders are named, and one reason and remedy; no step is tried."""
    make, words = TABLE[case]
    with pytest.raises(ub.ArgumentError) as refused:
        ub.Simulation(make(), SCHEME, comm=MPI.COMM_SELF)
    for part in words:
        assert part in str(refused.value)


ALLOWED = {
    "rigid-plastic and spring": lambda: turned(fuse(), ub.Spring(1e3)),
    "motor and friction": lambda: turned(motor(), ub.Coulomb(3.0)),
    "rigid-plastic beside other motions of a joint": lambda: joined(
        pin(multipliers=True), met(fuse())
    ),
    "rigid-plastic across a Link": lambda: joined(
        ub.Link(*MIDDLES), ub.Slide(*MIDDLES, fuse(), axis=(0, 1)), along(ub.Spring(1e3))
    ),
}


@pytest.mark.parametrize("case", ALLOWED)
def test_neighbours_of_the_table_run(case):
    solution = ub.simulate(ALLOWED[case](), SCHEME, t=(0, 0.1), dt=0.01)
    assert np.isfinite(solution.q).all()
    assert solution.energy.worst < 1e-9


def test_rigid_plastic_beside_friction_adds_its_limit():
    """A cantilever on both: it begins to turn at 10 + 3 N m, by a load at 1 m."""
    scene = turned(fuse(), ub.Coulomb(3.0))
    load = ub.PointLoad(ARM.end, (0, -20.0), amplitude=lambda t: t)
    loaded = ub.Scene([ARM], supports=scene.supports, loads=[load], connectors=scene.connectors)
    # slow, so that accelerations bear nothing: the first period of the arm is 0.18 s
    solution = ub.simulate(loaded, SCHEME, t=(0, 0.8), dt=2e-3)
    turns = np.abs(solution.displacement(ARM.start)[:, 2]) > 1e-6
    first = solution.times[int(np.argmax(turns))]
    assert 20.0 * first == pytest.approx(13.0, rel=0.05)


def test_many_hinges_are_looked_through_at_once():
    """A hinge that moves a node of its own repeats nothing; only others are decomposed."""
    law = ub.Softening(limit=10.0, fracture_energy=1.0)
    more = {"cells": 1, "hinges": {0.0: law, 1.0: law}}
    beams = [ub.Beam((x, 0), (x + 1, 0), SECTION, name=f"b{x}", **more) for x in range(60)]
    fuses = [ub.Turn(ORIGIN, beams[0].start, fuse()) for _ in range(2)]
    scene = rigid_chain(beams, supports=[ub.Pinned(beams[0].start)], connectors=fuses)
    with pytest.raises(ub.ArgumentError) as refused:
        ub.Simulation(scene, ub.EnergyMomentum(), comm=MPI.COMM_SELF)
    names = re.findall(r"Turn\(ground \(0, 0\), b0.start \(0, 0\)\)", str(refused.value))
    assert len(names) == 2
