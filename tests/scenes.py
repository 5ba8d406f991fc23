# SPDX-License-Identifier: MIT
"""Scenes of tests and benchmarks; lengths in m, SI units, unless a source has none.

The beam to look at is `scene.beams[0]`, the support `scene.supports[0]`.
"""

import math
from itertools import pairwise

import ufl_beam as ub

SLENDER = ub.Section(EA=1e8, GA=1e8, EI=1.0)
"""For elasticas of length 1: strains of axis and shear are 1e-8 of the force."""

GROWING = ub.ramp(1.0)
"""Time function of static loads that are to be followed from t = 0 to 1."""


SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)
"""For beams of some metres, of which a test needs no more than that they bend and move."""


def clamped(beam, *supports, **parts):
    """A beam clamped at its start, with other supports, and loads or other parts of a scene."""
    return ub.Scene([beam], supports=[ub.Clamped(beam.start), *supports], **parts)


def rigid_chain(beams, joints=(), **parts):
    """Beams joined rigidly, each start to the end before; other joints, and parts of a scene."""
    corners = [ub.Rigid(one.end, other.start) for one, other in pairwise(beams)]
    return ub.Scene(beams, joints=[*corners, *joints], **parts)


def on_rail(*laws, mass=1.0, speed=0.0, kind=ub.Slide, force=None, **parts):
    """A body at (1, 0) on a rail along x, with connectors of these laws to the origin.

    Args:
        speed: Velocity at the beginning.
        kind: `ub.Slide` or `ub.Stretch`.
        force: Function of time: force along the rail.
    """
    body = ub.Body((1, 0), mass=mass, inertia=1.0)
    rail = ub.ground(0, 0), body.middle
    push = [ub.PointLoad(body.middle, force=(1, 0), amplitude=force)] if force else []
    moves = [ub.Velocity([body], linear=(speed, 0.0))] if speed else []
    connectors = [kind(*rail, law) for law in laws]
    given = {"joints": [ub.Prismatic(*rail)], "loads": push, "initial": moves, **parts}
    return ub.Scene(bodies=[body], connectors=connectors, **given)


# -- statics -----------------------------------------------------------------------------------


def cantilever(
    section=SLENDER,
    *,
    length=1.0,
    cells=8,
    force=(0.0, 0.0),
    moment=0.0,
    time=GROWING,
    load=ub.PointLoad,
    loads=(),
):
    """Beam along x, clamped, with `load(...)` at its end; `loads`: functions of the beam."""
    beam = ub.Beam((0, 0), (length, 0), section, cells=cells)
    at_end = [load(beam.end, force=force, moment=moment, amplitude=time)]
    return clamped(beam, loads=at_end + [further(beam) for further in loads])


def quarter_circle(section=SLENDER, *, radius=1.0, cells=8, force=(0.0, 0.0), time=GROWING):
    """Arc about the origin from (radius, 0), clamped, to (0, radius), loaded."""
    beam = ub.Beam.arc((0, 0), radius, (0, math.pi / 2), section, cells=cells)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=force, amplitude=time)])


def beam_on_roller(
    section=SLENDER, *, length=1.0, cells=8, along=(1.0, 0.0), force=(0.0, -1.0), s=0.5
):
    """Beam along x, pinned at the origin, on a roller at its end, loaded at `s`."""
    beam = ub.Beam((0, 0), (length, 0), section, cells=cells)
    return ub.Scene(
        [beam],
        supports=[ub.Pinned(beam.start), ub.Roller(beam.end, along=along)],
        loads=[ub.PointLoad(beam.at(s), force=force, amplitude=GROWING)],
    )


def portal(*, cells=4, H=20e3, V=-40e3, time=GROWING, feet=ub.Clamped):
    """Steel portal frame, 4 m by 6 m, pushed by `H` at a corner and loaded by `V` at mid-span."""
    steel = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
    column = ub.Section.rectangle(b=0.10, h=0.20, **steel)
    girder = ub.Section.rectangle(b=0.10, h=0.25, **steel)
    left = ub.Beam((0, 0), (0, 4), column, cells=cells, name="left")
    roof = ub.Beam((0, 4), (6, 4), girder, cells=2 * cells, name="roof")
    right = ub.Beam((6, 4), (6, 0), column, cells=cells, name="right")
    return rigid_chain(
        [left, roof, right],
        supports=[feet(left.start), feet(right.end)],
        loads=[
            ub.PointLoad(left.end, force=(H, 0), amplitude=time),
            ub.PointLoad(roof.at(0.5), force=(0, V), amplitude=time),
        ],
    )


# -- dynamics ----------------------------------------------------------------------------------


def struck_portal(*, hinges=None):
    """Steel portal under a blow of 20 ms at its corner, the end of beam 0, which has the hinges."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    left = ub.Beam((0, 0), (0, 3), section, cells=3, hinges=hinges or {})
    roof = ub.Beam((0, 3), (4, 3), section, cells=4)
    right = ub.Beam((4, 3), (4, 0), section, cells=3)
    blow = ub.Table([0, 0.01, 0.02], [0, 1, 0])
    return rigid_chain(
        [left, roof, right],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(200e3, 0), amplitude=blow)],
    )


def flying_beam(*, cells=10, time=lambda t: 1.0 * (t < 2.5), mass=1.0):
    """Free beam, thrown by a force and a moment at its lower end (Simo and Vu-Quoc 1986)."""
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=mass, rhoI=10.0 * mass)
    beam = ub.Beam((6, 0), (0, 8), section, cells=cells)
    return ub.Scene(
        [beam], loads=[ub.PointLoad(beam.start, force=(8, 0), moment=-80, amplitude=time)]
    )


def spin_up_angle(t):
    """Imposed angle of the spin-up manoeuvre; rad (Simo and Vu-Quoc 1986)."""
    ω, T = 6.0, 15.0
    if t >= T:
        return ω * t - ω * T / 2
    turn = 2 * math.pi / T
    return ω / T * (t**2 / 2 + (math.cos(turn * t) - 1) / turn**2)


def spin_up(*, cells=10):
    """Beam of length 10 along x that is turned at the origin (Simo and Vu-Quoc 1986)."""
    section = ub.Section(EA=2.8e7, GA=1e7, EI=1.4e4, rhoA=1.2, rhoI=6e-4)
    beam = ub.Beam((0, 0), (10, 0), section, cells=cells)
    return ub.Scene(
        [beam], supports=[ub.PrescribedDisplacement(beam.start, u=0, v=0, psi=spin_up_angle)]
    )


SWING_PULSE = ub.Table([0, 0.128, 0.256], [0, 2, 0])
"""Force on the mass of the swing; N over s."""


def swing(*, cells=4, rigidity=1e4):
    """Beam of 0.72 m with a mass at mid-span, hung on two links; no gravity (Bauchau and Theron).

    The beam has an even number of cells; links are `rigidity` times as stiff.
    """
    EA, GA, EI = 3.65e5, 1.17e5, 0.0304166667
    flexible = ub.Section(EA=EA, GA=GA, EI=EI, rhoA=0.0135, rhoI=1.125e-9)
    stiff = ub.Section(EA=rigidity * EA, GA=rigidity * GA, EI=rigidity * EI, rhoA=0.0)
    beam = ub.Beam((0, -0.36), (0.72, -0.36), flexible, cells=cells)
    left = ub.Beam((0, 0), (0, -0.36), stiff, cells=1, name="left")
    right = ub.Beam((1.08, 0), (0.72, -0.36), stiff, cells=1, name="right")
    return ub.Scene(
        [beam, left, right],
        joints=[ub.Revolute(left.end, beam.start), ub.Revolute(right.end, beam.end)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.start)],
        masses=[ub.PointMass(beam.at(0.5), 0.5)],
        loads=[ub.PointLoad(beam.at(0.5), force=(1, 0), amplitude=SWING_PULSE)],
    )
