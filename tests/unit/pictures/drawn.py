# SPDX-License-Identifier: MIT
"""Models of the tests of pictures, and the lines, areas and texts of a figure."""

from mpi4py import MPI

import numpy as np
from matplotlib.colors import same_color
from matplotlib.text import Text
from user_classes import Stiffening

import ufl_beam as ub

FIRST = MPI.COMM_WORLD.rank == 0

STEEL = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)

LIMIT, FRACTURE, YIELD = 10.0, 3.0, 8.0
"""Moments of the hinge and of yielding of the damaged arm, N m; fracture energy, J."""


def static(scene, dt=1.0, **more):
    """Static run from t = 0 to 1."""
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt, **more)


def moved(beam, **motion):
    """Beam that is clamped at its start; the motion of its end is prescribed."""
    held = [ub.Clamped(beam.start), ub.PrescribedDisplacement(beam.end, **motion)]
    return ub.Scene([beam], supports=held)


def yielding_beam():
    """Cantilever of four cells that yield, with a hinge at the clamp.

    The moment at the clamp is the largest: it yields at 8 N m, and breaks at 10 N m.
    """
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0, bending=ub.ElastoPlastic(YIELD, isotropic=30.0))
    hinges = {0.0: ub.Softening(LIMIT, FRACTURE)}
    return ub.Beam((0, 0), (1, 0), section, cells=4, name="arm", hinges=hinges)


def damaged_arm():
    """The same, moved to and fro at its end."""
    return moved(yielding_beam(), v=ub.Table([0, 1, 2, 3], [0, 0.15, 0.0, 0.3]))


def crank():
    """A crank, a rod without mass, a slider on a rail of the ground, and a spring; no beams."""
    wheel = ub.Body((0.3, 0.2), mass=1.0, inertia=0.1, name="wheel")
    block = ub.Body((3.0, 0.0), mass=2.0, inertia=0.2, name="block")
    bearing = ub.Revolute(ub.ground(0, 0), wheel.at(0, 0))
    rail = ub.Prismatic(ub.ground(2, 0), block.middle)
    rod = ub.Link(wheel.at(0.6, 0.4), block.at(2.8, 0.1))
    spring = ub.Stretch(block.at(3.2, 0.1), ub.ground(4.5, 0.4), ub.Spring(20.0))
    motor = ub.Turn(ub.ground(0, 0), wheel.at(0, 0), ub.PrescribedMotion(lambda t: 3.0 * t**2))
    return ub.Scene(bodies=[wheel, block], joints=[bearing, rail, rod], connectors=[spring, motor])


def storeys(bays, floors, law_of=lambda name: None):
    """A frame with a name for each member, a force and line loads for each floor.

    ``law_of`` returns the law of the hinges at both ends of a member.
    """
    beams, joints, loads = [], {}, []

    def add(a, b, name):
        law = law_of(name)
        hinges = {0: law, 1: law} if law else {}
        beam = ub.Beam(a, b, STEEL, cells=2, name=name, hinges=hinges)
        beams.append(beam)
        for place in (beam.start, beam.end):
            joints.setdefault(place.point, []).append(place)

    for floor in range(floors):
        for bay in range(bays + 1):
            add((5.0 * bay, 3.0 * floor), (5.0 * bay, 3.0 * floor + 3), f"C{floor}{bay}")
        for bay in range(bays):
            add((5.0 * bay, 3.0 * floor + 3), (5.0 * bay + 5, 3.0 * floor + 3), f"B{floor}{bay}")
        loads.append(ub.PointLoad(beams[-2 * bays - 1].end, force=(40e3, 0)))
        loads += [ub.LineLoad(beam, force=(0, -25e3)) for beam in beams[-bays:]]
    feet = [ub.Clamped(places[0]) for (_, y), places in joints.items() if y == 0.0]
    joined = [ub.Rigid(*places) for places in joints.values() if len(places) > 1]
    return ub.Scene(beams, joints=joined, supports=feet, loads=loads)


LAWS = [
    ub.PrescribedMotion(lambda t: 0.1 * t),
    ub.PrescribedForce(lambda t: t),
    ub.Controller(lambda simulation: 1.0),
    ub.Spring(10.0),
    ub.Damper(1.0),
    ub.Stop(100.0, high=0.05),
    ub.Coulomb(0.1),
    ub.ForceLaw(lambda x, v: 10.0 * x),
    Stiffening(10.0, 0.0),
    ub.RigidPlastic(ub.Softening(0.5, 1.0)),
]
"""A connector law of each kind."""


def outlines(figure, group, kind=object, *, fill=None, width=None):
    """Lines and areas of a group, those of a kind, filling colour or line width if given; m."""
    drawn = [c for c in figure.axes[0].collections if c.get_gid() == group and isinstance(c, kind)]
    if fill is not None:
        drawn = [c for c in drawn if any(same_color(x, fill) for x in c.get_facecolor())]
    if width is not None:
        drawn = [c for c in drawn if c.get_linewidth() == width]
    return [path.vertices for c in drawn for path in c.get_paths()]


def middles(figure, group, fill=None):
    """Where the symbols of a group are; (n, 2); m."""
    found = [(x.min(axis=0) + x.max(axis=0)) / 2 for x in outlines(figure, group, fill=fill)]
    return np.reshape(found, (-1, 2))


def has(points, point):
    """Whether a point is among others, to round-off of coordinates of 1 m."""
    return bool(len(points)) and float(np.min(np.linalg.norm(points - point, axis=1))) < 1e-12


def texts(figure):
    """Words and numbers in the axes."""
    return [text.get_text() for text in figure.axes[0].texts if text.get_text()]


def circles(axes):
    """Lines of one point each that are round, and not in the legend alone."""
    return [x for x in axes.lines if x.get_marker() == "o" and len(x.get_xdata()) == 1]


def boxes_of(figure, group=None):
    """Boxes of the labels, without the lines that lead to them; pixels."""
    figure.draw_without_rendering()
    labels = [x for x in figure.axes[0].texts if group is None or x.get_gid() == group]
    return [Text.get_window_extent(text).frozen() for text in labels]


def require_apart(boxes, frame):
    """Boxes overlap by less than a pixel, as texts have whole pixels, and are in the frame."""
    for k, box in enumerate(boxes):
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
        assert frame.y0 <= box.y0 < box.y1 <= frame.y1
        assert not any(box.padded(-0.5).overlaps(other.padded(-0.5)) for other in boxes[:k])
