# SPDX-License-Identifier: MIT
"""Rigid linkages that turn far in a step stay in their assembly; all [closed].

A linkage has several assemblies; the right one is the intersection of two circles, or the angle of
a pin.  Steps have the constraints exactly: 1e-9 m is the tolerance of Newton's method, and other
assemblies are 0.5 m away.
"""

import itertools

import numpy as np
import pytest

import ufl_beam as ub

TURN = 2 * np.pi
ORIGIN = ub.ground(0, 0)
MOVING = [ub.GeneralizedAlpha(0.8), ub.Newmark(0.6, 0.31)]


def xy(z):
    return float(np.real(z)), float(np.imag(z))


def bar(a, b, name):
    """A body between two points of the complex plane."""
    return ub.Body(xy((a + b) / 2), mass=1.0, inertia=0.1, name=name)


def motor(place, angle=lambda t: TURN * t):
    return ub.Turn(ORIGIN, place, ub.PrescribedMotion(angle))


def meeting(a, b, to_a, to_b, side):
    """The point at these distances from a and b, on one side of the line between them."""
    d = abs(b - a)
    x = (to_a**2 - to_b**2 + d**2) / (2 * d)
    return a + (b - a) / d * (x + side * 1j * np.sqrt(to_a**2 - x**2))


class FourBar:
    """Ground, crank, coupler and rocker; the coupler is a body, a `Link`, or all are beams."""

    def __init__(self, *lengths, side=1, start=0.0, kind="body"):
        self.lengths, self.side, self.start = lengths, side, start
        ground, a, c = lengths[0], *self.points(0.0)
        if kind == "beams":
            section = ub.Section(EA=1e8, GA=1e8, EI=1e4, rhoA=1.0)
            ends = (0j, a), (a, c), (ground, c)
            beams = [ub.Beam(xy(p), xy(q), section, cells=1) for p, q in ends]
            turned = ub.PrescribedDisplacement(beams[0].start, u=0, v=0, psi=lambda t: TURN * t)
            pins = [ub.Revolute(beams[0].end, beams[1].start)]
            pins += [ub.Revolute(beams[1].end, beams[2].end)]
            supports = [turned, ub.Pinned(beams[2].start)]
            self.scene = ub.Scene(beams, joints=pins, supports=supports)
            self.place = beams[2].end
            return
        bodies = [bar(0j, a, "crank"), bar(ground, c, "rocker")]
        pins = [(ORIGIN, bodies[0].at(0, 0)), (ub.ground(ground, 0), bodies[1].at(ground, 0))]
        self.place = bodies[1].at(*xy(c))
        ends = bodies[0].at(*xy(a)), self.place
        if kind == "body":
            bodies.append(bar(a, c, "coupler"))
            pins += [(end, bodies[2].at(*end.point)) for end in ends]
        joints = [ub.Revolute(*pair) for pair in pins] + [ub.Link(*ends)] * (kind == "link")
        drive = motor(bodies[0].middle)
        self.scene = ub.Scene(bodies=bodies, joints=joints, connectors=[drive])

    def points(self, t):
        ground, crank, coupler, rocker = self.lengths
        a = crank * np.exp(1j * (self.start + TURN * t))
        return a, meeting(a, ground, coupler, rocker, self.side)

    def error(self, run):
        found = run.position(self.place)[:, :2] @ [1, 1j]
        return max(abs(z - self.points(t)[1]) for z, t in zip(found, run.times, strict=True))


def random_linkage(number):
    """A four-bar linkage whose crank can turn, at least 3 cm from its dead centres."""
    rng = np.random.default_rng(number)
    while True:
        lengths = rng.uniform(0.3, 1.5, 4)
        short, _, _, long = np.sort(lengths)
        grashof = short + long < lengths.sum() / 2 - 0.015
        if grashof and short in lengths[:2]:
            kind = ("body", "link")[number % 2]
            return FourBar(*lengths, side=rng.choice([-1, 1]), start=rng.uniform(0, 6), kind=kind)


CRANK_ROCKERS = [FourBar(1.0, 0.5, 1.2, 0.8, kind=kind) for kind in ("body", "link")]
OF_BEAMS = FourBar(1.41, 0.83, 1.45, 0.9, side=-1, start=2.0, kind="beams")


@pytest.mark.parametrize(
    ("linkages", "schemes", "tolerance"),
    [
        (CRANK_ROCKERS, [ub.Static(), ub.EnergyMomentumStatic(), MOVING[0]], 1e-9),
        ([random_linkage(number) for number in range(12)], [ub.Static()], 1e-9),
        ([OF_BEAMS], [ub.Static()], 1e-6),
    ],
    ids=["crank-rocker", "random", "of beams"],
)
def test_linkages_keep_their_assembly(linkages, schemes, tolerance):
    """Elastic strains of beams are round-off of the forces, relative to 1e4 N."""
    for linkage, scheme, steps in itertools.product(linkages, schemes, (12, 8, 4)):
        run = ub.simulate(linkage.scene, scheme, t=(0, 1), dt=1 / steps)
        assert linkage.error(run) < tolerance


@pytest.mark.parametrize(("radius", "offset", "turns"), [(0.3, 0.2, 3), (0.2, 0.3, 0)])
@pytest.mark.parametrize("scheme", [ub.Static(), *MOVING], ids=str)
def test_a_quick_return_makes_no_further_turns(radius, offset, turns, scheme):
    """A crank drives a slotted lever, which turns as often as the crank if it is the shorter."""
    pivot, pin = -1j * offset, radius * np.exp(0.3j)
    axis = xy((pin - pivot) / abs(pin - pivot))
    crank = ub.Body((0, 0), mass=2.0, inertia=0.05, name="crank")
    lever = ub.Body(xy(pivot + 0.4 * complex(*axis)), mass=1.0, inertia=0.05, name="lever")
    joints = [
        ub.Revolute(ORIGIN, crank.middle),
        ub.Revolute(ub.ground(*xy(pivot)), lever.at(*xy(pivot))),
        ub.Prismatic(lever.at(*xy(pivot)), crank.at(*xy(pin)), axis=axis, turning=True),
    ]
    scene = ub.Scene(bodies=[crank, lever], joints=joints, connectors=[motor(crank.middle)])
    for steps in (33, 20, 8):
        run = ub.simulate(scene, scheme, t=(0, 3), dt=1 / steps)
        found = run.displacement(lever.middle)[-1, 2] / TURN
        # The mean of both ends of the last step is exact to a microradian in dynamics.
        assert found == pytest.approx(turns, abs=1e-6)


@pytest.mark.parametrize(("length", "offset", "steps"), [(0.4, 0.0, 4), (0.35, 0.04, 12)])
def test_a_slider_does_not_leap_through_its_crank(length, offset, steps):
    """Only the rod between crank and slider turns, and a `Link` has no rotation of its own."""

    def right(pins):
        return pins.real + np.sqrt(length**2 - (pins.imag - offset) ** 2)

    pin = 0.3 * np.exp(0.3j)
    crank = ub.Body((0, 0), mass=1.0, inertia=0.1, name="crank")
    block = ub.Body((right(pin), offset), mass=1.0, inertia=0.1)
    joints = [
        ub.Revolute(ORIGIN, crank.middle), ub.Link(crank.at(*xy(pin)), block.middle),
        ub.Prismatic(ub.ground(0, offset), block.middle, axis=(1, 0)),
    ]  # fmt: skip
    scene = ub.Scene(bodies=[crank, block], joints=joints, connectors=[motor(crank.middle)])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / steps)
    pins = 0.3 * np.exp(1j * (0.3 + TURN * run.times))
    assert run.position(block.middle)[:, 0] == pytest.approx(right(pins), abs=1e-9)


def test_a_trammel_does_not_leap():
    """Two blocks on rails at right angles, with a `Link`; the first one is driven through zero."""
    blocks = [ub.Body((0.8, 0), mass=1.0, inertia=1.0), ub.Body((0, 0.6), mass=1.0, inertia=1.0)]
    axes = zip(blocks, ((1, 0), (0, 1)), strict=True)
    rails = [ub.Prismatic(ORIGIN, block.middle, axis=axis) for block, axis in axes]
    law = ub.PrescribedMotion(lambda t: 0.98 * np.cos(TURN * t + np.arccos(0.8 / 0.98)) - 0.8)
    drive = ub.Slide(ORIGIN, blocks[0].middle, law, axis=(1, 0))
    joints = [*rails, ub.Link(blocks[0].middle, blocks[1].middle)]
    scene = ub.Scene(bodies=blocks, joints=joints, connectors=[drive])
    run = ub.simulate(scene, ub.Static(), t=(0, 2), dt=1 / 5)
    x, y = (run.position(block.middle)[:, k] for k, block in enumerate(blocks))
    assert y == pytest.approx(np.sqrt(1 - x**2), abs=1e-9)


@pytest.mark.filterwarnings("ignore:.* jumps:ufl_beam.ModelWarning")
def test_a_jump_of_a_motor_is_refused_with_a_remedy():
    arm = bar(0j, 1 + 0j, "arm")
    pin = ub.Revolute(ORIGIN, arm.at(0, 0))
    jump = motor(arm.middle, lambda t: 2.0 * (t > 0.5))
    scene = ub.Scene(bodies=[arm], joints=[pin], connectors=[jump])
    with pytest.raises(ub.ConvergenceError, match=r"rigid part turns by 2 rad .*reduce dt"):
        ub.simulate(scene, MOVING[0], t=(0, 1), dt=0.1)
