# SPDX-License-Identifier: MIT
"""Combinations that hold a motion twice are refused before a run, with the names of all holders."""

import re
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest

import ufl_beam as ub

SECTION = ub.Section(EA=1e6, GA=3e5, EI=1e2, rhoA=1.0, rhoI=1e-3)
ORIGIN = ub.ground(0, 0)
FIRST = "Turn(ground (0, 0), arm.start (0, 0))"
REASON = "a RigidPlastic connector holds its motion until it yields"


def fuse():
    return ub.RigidPlastic(ub.ElastoPlastic(10.0, isotropic=1.0))


def motor():
    return ub.PrescribedMotion(lambda t: 0.1 * t)


class Parts:
    """An arm from the origin, a rod that begins where it ends, a block there."""

    def __init__(self):
        self.arm = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="arm")
        self.rod = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="rod")
        self.block = ub.Body((1, 0), mass=1.0, inertia=1.0, name="block")

    def turned(self, *laws, support=ub.Pinned):
        """The arm with connectors of these laws between ground and arm."""
        turns = [ub.Turn(ORIGIN, self.arm.start, law) for law in laws]
        return ub.Scene([self.arm], supports=[support(self.arm.start)], connectors=turns)

    def joined(self, joint, *connectors):
        """Arm and rod, clamped on both sides, with a joint."""
        supports = [ub.Clamped(self.arm.start), ub.Clamped(self.rod.end)]
        return ub.Scene(
            [self.arm, self.rod], joints=[joint], supports=supports, connectors=connectors
        )

    def led(self, *joints, across=None, **more):
        """The block with joints, and a connector across the x axis."""
        place = ub.ground(1, 0), self.block.middle
        drives = [] if across is None else [ub.Slide(*place, across, axis=(0, 1))]
        return ub.Scene(bodies=[self.block], joints=joints, connectors=drives, **more)

    def along(self, law):
        return ub.Slide(self.arm.end, self.rod.start, law, axis=(1, 0))

    def guide(self):
        return ub.Guided(self.block.middle, lambda s: (1 + s, 0.0))

    def rail(self):
        return ub.Prismatic(ub.ground(1, 0), self.block.middle, axis=(1, 0))

    def pin(self, **more):
        return ub.Revolute(self.arm.end, self.rod.start, **more)

    def ring(self, law):
        """Two blocks that two bars of fixed length and a connector between join, in parallel."""
        other = ub.Body((1, 1), mass=1.0, inertia=1.0, name="lid")
        bars = [ub.Link(self.block.at(x, 0), other.at(x, 1)) for x in (0, 1, 2)]
        strut = ub.Slide(self.block.at(3, 0), other.at(3, 1), law, axis=(0, 1))
        return ub.Scene(bodies=[self.block, other], joints=bars[:2], connectors=[strut])


def prescribed(place):
    return ub.PrescribedDisplacement(place, u=0, v=0, psi=lambda t: 0.1 * t)


GUIDED = "Guided(ground (1, 0), block (1, 0))"
ACROSS = "Slide(ground (1, 0), block (1, 0)) with "
ALONG = "Slide(arm.end (1, 0), rod.start (1, 0)) with "
MET = "Turn(arm.end (1, 0), rod.start (1, 0)) with "
RAIL = "Prismatic(ground (1, 0), block (1, 0))"
PIN = "Revolute(arm.end (1, 0), rod.start (1, 0))"
RIGID = "Rigid(arm.end (1, 0), rod.start (1, 0))"

TABLE = {
    "two rigid-plastic": (
        lambda p: p.turned(fuse(), fuse()),
        [f"{FIRST} with RigidPlastic; {FIRST} with RigidPlastic", REASON],
    ),
    "rigid-plastic and motor": (
        lambda p: p.turned(fuse(), motor()),
        [f"{FIRST} with RigidPlastic", f"{FIRST} with PrescribedMotion", REASON],
    ),
    "rigid-plastic and support": (
        lambda p: p.turned(fuse(), support=ub.Clamped),
        [f"{FIRST} with RigidPlastic", "Clamped at arm.start (0, 0)", REASON],
    ),
    "rigid-plastic and Revolute": (
        lambda p: p.joined(p.pin(), p.along(fuse())),
        [f"{ALONG}RigidPlastic", PIN, REASON],
    ),
    "rigid-plastic and measured Revolute": (
        lambda p: p.joined(p.pin(multipliers=True), p.along(fuse())),
        [PIN, f"{ALONG}RigidPlastic", REASON],
    ),
    "rigid-plastic and Rigid": (
        lambda p: p.joined(
            ub.Rigid(p.arm.end, p.rod.start), ub.Turn(p.arm.end, p.rod.start, fuse())
        ),
        [f"{MET}RigidPlastic", RIGID, REASON],
    ),
    "rigid-plastic and Prismatic": (
        lambda p: p.led(p.rail(), across=fuse()),
        [RAIL, f"{ACROSS}RigidPlastic", REASON],
    ),
    "rigid-plastic and guide": (
        lambda p: p.led(p.guide(), across=fuse()),
        [GUIDED, f"{ACROSS}RigidPlastic", REASON],
    ),
    "rigid-plastic and Link": (
        lambda p: p.joined(
            ub.Link(p.arm.at(0.5), p.rod.at(0.5)),
            ub.Stretch(p.arm.at(0.5), p.rod.at(0.5), fuse()),
        ),
        ["Link(arm.at(0.5)", "Stretch(arm.at(0.5)", REASON],
    ),
    "rigid-plastic in a ring of rigid parts": (
        lambda p: p.ring(fuse()),
        ["Link(block (0, 0), lid (0, 1))", "Slide(block (3, 0), lid (3, 1))", REASON],
    ),
    "two motors": (
        lambda p: p.turned(motor(), motor()),
        [f"{FIRST} with PrescribedMotion; {FIRST} with PrescribedMotion", "Remove one"],
    ),
    "motor and PrescribedDisplacement": (
        lambda p: p.turned(motor(), support=prescribed),
        [f"{FIRST} with PrescribedMotion", "PrescribedDisplacement at arm.start (0, 0)"],
    ),
    "motor and Rigid": (
        lambda p: p.joined(
            ub.Rigid(p.arm.end, p.rod.start), ub.Turn(p.arm.end, p.rod.start, motor())
        ),
        [f"{MET}PrescribedMotion", RIGID],
    ),
    "motor and guide": (
        lambda p: p.led(p.guide(), across=motor()),
        [GUIDED, f"{ACROSS}PrescribedMotion"],
    ),
    "guide and support": (
        lambda p: p.led(p.guide(), supports=[ub.Pinned(p.block.middle)]),
        [GUIDED, "Pinned at block (1, 0)"],
    ),
    "two guides": (lambda p: p.led(p.guide(), p.guide()), [f"{GUIDED}; {GUIDED}"]),
    "guide and Prismatic": (lambda p: p.led(p.guide(), p.rail()), [GUIDED, RAIL]),
    "two supports": (
        lambda p: ub.Scene([p.arm], supports=[ub.Clamped(p.arm.start), ub.Pinned(p.arm.start)]),
        ["Clamped at arm.start (0, 0)", "Pinned at arm.start (0, 0)", "remove one"],
    ),
}


@pytest.mark.parametrize("case", TABLE)
def test_contradictions_name_all_holders_and_a_remedy(case):
    """All holders are named, and one reason and remedy; no step is tried."""
    make, words = TABLE[case]
    with pytest.raises(ub.ArgumentError) as refused:
        ub.Simulation(make(Parts()), ub.EnergyMomentum(alpha=0.05, beta=0.05), comm=MPI.COMM_SELF)
    for part in words:
        assert part in str(refused.value)


ALLOWED = {
    "rigid-plastic and spring": lambda p: p.turned(fuse(), ub.Spring(1e3)),
    "rigid-plastic and friction": lambda p: p.turned(fuse(), ub.Coulomb(3.0)),
    "motor and friction": lambda p: p.turned(motor(), ub.Coulomb(3.0)),
    "rigid-plastic beside other motions of a joint": lambda p: p.joined(
        p.pin(multipliers=True), ub.Turn(p.arm.end, p.rod.start, fuse())
    ),
    "rigid-plastic across a Link": lambda p: p.joined(
        ub.Link(p.arm.at(0.5), p.rod.at(0.5)),
        ub.Slide(p.arm.at(0.5), p.rod.at(0.5), fuse(), axis=(0, 1)),
        p.along(ub.Spring(1e3)),
    ),
}


@pytest.mark.parametrize("case", ALLOWED)
def test_neighbours_of_the_table_run(case):
    solution = ub.simulate(
        ALLOWED[case](Parts()), ub.EnergyMomentum(alpha=0.05, beta=0.05), t=(0, 0.1), dt=0.01
    )
    assert np.isfinite(solution.q).all()
    assert solution.energy.worst < 1e-9


def test_rigid_plastic_beside_friction_adds_its_limit():
    """A cantilever on both: it begins to turn at 10 + 3 N m, by a load at 1 m."""
    parts = Parts()
    scene = parts.turned(fuse(), ub.Coulomb(3.0))
    load = ub.PointLoad(parts.arm.end, (0, -20.0), amplitude=lambda t: t)
    loaded = ub.Scene(
        [parts.arm], supports=scene.supports, loads=[load], connectors=scene.connectors
    )
    # slow, so that accelerations bear nothing: the first period of the arm is 0.18 s
    solution = ub.simulate(loaded, ub.EnergyMomentum(alpha=0.05, beta=0.05), t=(0, 1), dt=2e-3)
    turns = np.abs(solution.displacement(parts.arm.start)[:, 2]) > 1e-6
    first = solution.times[int(np.argmax(turns))]
    assert 20.0 * first == pytest.approx(13.0, rel=0.05)


def test_many_hinges_are_looked_through_at_once():
    """A hinge that moves a node of its own repeats nothing; only others are decomposed."""
    law = ub.Softening(limit=10.0, fracture_energy=1.0)
    beams = [
        ub.Beam((x, 0), (x + 1, 0), SECTION, cells=1, hinges={0.0: law, 1.0: law}, name=f"b{x}")
        for x in range(60)
    ]
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
    fuses = [ub.Turn(ORIGIN, beams[0].start, fuse()) for _ in range(2)]
    scene = ub.Scene(beams, joints=joints, supports=[ub.Pinned(beams[0].start)], connectors=fuses)
    with pytest.raises(ub.ArgumentError) as refused:
        ub.Simulation(scene, ub.EnergyMomentum(), comm=MPI.COMM_SELF)
    names = re.findall(r"Turn\(ground \(0, 0\), b0.start \(0, 0\)\)", str(refused.value))
    assert len(names) == 2
