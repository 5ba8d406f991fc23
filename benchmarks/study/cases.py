# SPDX-License-Identifier: MIT
"""Scenes of the study: smooth, stiff, impulsive, plastic, softening and static ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import ufl_beam as ub

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}  # Pa, -, kg/m^3
INSTANTS = 10
"""Times at which a place is compared; steps of all sizes end there."""


@dataclass(frozen=True)
class Case:
    """A scene and what is asked of it.

    Attributes:
        name: Title.
        kind: What makes it hard.
        says: One sentence for the docs.
        make: The scene with its coarsest cells, and the place that is compared.
        end: The run is from 0 to there; s, or the load parameter.
        steps: Of the coarsest run; a multiple of INSTANTS.
        elastic: Whether cells of higher degree may be taken.
        dynamic: Whether it moves.
    """

    name: str
    kind: str
    says: str
    make: Callable[[], tuple[ub.Scene, ub.Place]]
    end: float
    steps: int
    elastic: bool = True
    dynamic: bool = True

    @property
    def instants(self) -> np.ndarray:
        """(INSTANTS,); s."""
        return np.linspace(0.0, self.end, INSTANTS + 1)[1:]


def flying_beam():
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0)
    beam = ub.Beam((6, 0), (0, 8), section, cells=4)

    def pulse(t):
        return math.sin(math.pi * t) ** 2 * (t < 1.0)

    load = ub.PointLoad(beam.start, force=(8, 0), moment=-80, amplitude=pulse)
    return ub.Scene([beam], loads=[load]), beam.end


def pendulum():
    section = ub.Section(EA=1e5, GA=1e5, EI=10.0, rhoA=1.0, rhoI=1e-3)
    upper = ub.Beam((0, 0), (1, 0), section, cells=2, name="upper")
    lower = ub.Beam((1, 0), (2, 0), section, cells=2, name="lower")
    scene = ub.Scene(
        [upper, lower],
        joints=[ub.Revolute(upper.end, lower.start)],
        supports=[ub.Pinned(upper.start)],
        loads=[ub.Gravity()],
    )
    return scene, lower.end


def swing():
    EA, GA, EI = 3.65e5, 1.17e5, 0.0304166667
    flexible = ub.Section(EA=EA, GA=GA, EI=EI, rhoA=0.0135, rhoI=1.125e-9)
    stiff = ub.Section(EA=1e4 * EA, GA=1e4 * GA, EI=1e4 * EI, rhoA=0.0)
    beam = ub.Beam((0, -0.36), (0.72, -0.36), flexible, cells=4)
    left = ub.Beam((0, 0), (0, -0.36), stiff, cells=1, name="left")
    right = ub.Beam((1.08, 0), (0.72, -0.36), stiff, cells=1, name="right")
    push = ub.Table([0, 0.128, 0.256], [0, 2, 0])
    scene = ub.Scene(
        [beam, left, right],
        joints=[ub.Revolute(left.end, beam.start), ub.Revolute(right.end, beam.end)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.start)],
        masses=[ub.PointMass(beam.at(0.5), 0.5)],
        loads=[ub.PointLoad(beam.at(0.5), force=(1, 0), amplitude=push)],
    )
    return scene, beam.at(0.5)


def hit_cantilever():
    """Of 2 m; a half sine of 2 ms at its end."""
    beam = ub.Beam((0, 0), (2, 0), ub.Section.rectangle(b=0.05, h=0.05, **STEEL), cells=4)

    def blow(t):
        return math.sin(math.pi * t / 2e-3) if t < 2e-3 else 0.0

    load = ub.PointLoad(beam.end, force=(0, 40e3), amplitude=blow)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load]), beam.end


def yielding_cantilever():
    """Of 2 m; pulled within 20 ms beyond its limit moment, it flows and vibrates."""
    law = ub.ElastoPlastic(yield_limit=40e3, isotropic=1e5, viscosity=ub.Perzyna(1e3))
    section = ub.Section.rectangle(b=0.1, h=0.1, **STEEL, bending=law)
    beam = ub.Beam((0, 0), (2, 0), section, cells=4)
    grow = ub.Table([0, 0.02], [0, 1])
    load = ub.PointLoad(beam.end, force=(0, -25e3), amplitude=grow)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load]), beam.end


def breaking_arm():
    """Of an aluminium tube with a payload; its hub stops within 20 ms, its flange breaks."""
    tube = ub.Section.tube(d=0.050, t=0.002, E=70e9, nu=0.33, rho=2700.0)
    flange = 0.02 / 1.5
    arm = ub.Beam(
        (0, 0), (1.5, 0), tube, cells=3, corners=(flange,),
        hinges={0.5 * flange: ub.Softening(300.0, 20.0)},
    )  # fmt: skip

    def hub(t):
        go = min(t, 0.06)
        stop = min(max(t - 0.06, 0.0), 0.02)
        return 4.0 * (go + stop - stop**2 / 0.04)  # rad: 4 rad/s, then the brake

    return ub.Scene(
        [arm],
        supports=[ub.PrescribedDisplacement(arm.start, u=0, v=0, psi=hub)],
        masses=[ub.PointMass(arm.end, 2.0)],
        initial=[ub.Velocity([arm], angular=4.0)],
    ), arm.end


def bent_cantilever():
    section = ub.Section(EA=1e8, GA=1e8, EI=100.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    load = ub.PointLoad(beam.end, force=(0, -600.0), amplitude=ub.ramp(1.0))
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load]), beam.end


CASES = (
    Case("flying beam", "smooth", "A free beam, thrown by a force and a moment in the form of a "
         "pulse sin²(πt) of 1 s.", flying_beam, 2.0, 20),
    Case("double pendulum", "smooth", "Two slender beams that fall.", pendulum, 0.8, 20),
    Case("swing", "stiff", "A beam with a mass swings on links that are ten thousand times as "
         "stiff.", swing, 0.6, 30),
    Case("hit cantilever", "impulsive", "A steel bar and a blow of 2 ms at its end.",
         hit_cantilever, 0.04, 40),
    Case("yielding cantilever", "plastic", "A viscoplastic steel cantilever, bent beyond its "
         "limit moment by a force at its end.", yielding_cantilever, 0.1, 40, elastic=False),
    Case("breaking arm", "softening", "A rotating arm whose hub is stopped within 20 ms; a "
         "hinge in its flange softens until it bears no moment.", breaking_arm, 0.16, 80,
         elastic=False),
    Case("bent cantilever", "static", "A cantilever bent by a force of 6 EI/L² at its end.",
         bent_cantilever, 1.0, 10, dynamic=False),
)  # fmt: skip
"""What the study is about; the order is that of the docs."""
