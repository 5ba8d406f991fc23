# SPDX-License-Identifier: MIT
"""The problems: their numbers, what a run must tell, and how far that is from the converged answer.

A problem knows nothing of any program.  Every program gets the same chains of cells, loads and
steps, and answers with ``values`` that the problem compares with its reference.
"""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

REFERENCE = Path(__file__).with_name("reference.json")
"""Converged answers, made by reference.py."""


def known(problem):
    """Return the converged answers of a problem: arrays by name, none before they were computed."""
    kept = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
    values = kept.get(problem, {}).get("values", {})
    return {name: np.array(value) for name, value in values.items()}


class Section(NamedTuple):
    EA: float  # N
    GA: float  # N, effective
    EI: float  # N m^2
    rhoA: float  # kg/m
    rhoI: float  # kg m
    GA3: float | None = None  # in space: shear along axis 3, bending about axis 2, torsion, inertia
    EI2: float | None = None
    GJ: float | None = None
    rhoI2: float | None = None

    def times(self, factor):
        """Stiffer by a factor, of the same mass."""
        return self._replace(EA=factor * self.EA, GA=factor * self.GA, EI=factor * self.EI)


class Chain(NamedTuple):
    """A straight beam of equal cells with two nodes each."""

    start: tuple[float, ...]  # m
    end: tuple[float, ...]  # m
    section: Section
    cells: int

    @property
    def points(self):
        """Nodes; (cells + 1, 2 or 3); m."""
        return np.linspace(self.start, self.end, self.cells + 1)

    @property
    def angle(self):
        """Direction in the plane of x and y; rad."""
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    @property
    def h(self):
        """Length of a cell; m."""
        return math.dist(self.start, self.end) / self.cells


def steel_like(width, thickness, E, nu, rho):
    A, I = width * thickness, width * thickness**3 / 12
    return Section(E * A, 5 / 6 * E / (2 * (1 + nu)) * A, E * I, rho * A, rho * I)


E_MODULUS, AREA, INERTIA = 73e9, 2e-4, 0.1667e-8  # Pa, m^2, m^4
STRIP = Section(
    E_MODULUS * AREA, 5 / 6 * E_MODULUS / 2.6 * AREA, E_MODULUS * INERTIA,
    2700 * AREA, 2700 * INERTIA,
)  # fmt: skip


class RollUp:
    """A cantilever bent by an end moment to a half or a full circle, in equal load steps."""

    steps = 8
    section = STRIP

    def chains(self, cells):
        return [Chain((0, 0), (1, 0), self.section, cells)]

    def moment(self, turns):
        return 2 * math.pi * turns * self.section.EI  # N m, over 1 m

    def measures(self, values, turns):
        """Distance of the end from where the exact circle ends; m."""
        k = 2 * math.pi * turns
        exact = math.sin(k) / k, (1 - math.cos(k)) / k
        return {"error": math.dist(values["tip"], exact)}


class FlyingBeam:
    """A free beam, pushed and turned at its start until 2.5 s (Simo and Vu-Quoc 1986)."""

    section = Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0)
    force, moment, until, end = 8.0, -80.0, 2.5, 10.0  # N, N m, s, s
    reference = ((22.970722, 6.411984), (21.324850, 3.609902))
    """Start and end at 10 s; m.  ``reference.py`` comes to the same within 1e-4: the push jumps,
    and the answer of 2048 cells and steps of 0.5 ms is not known better."""

    def chains(self, cells):
        return [Chain((6, 0), (0, 8), self.section, cells)]

    def triangle(self, t):
        """Factor of the push for the error of the steps: it rises and falls until 2.5 s."""
        return max(0.0, min(t, self.until - t)) * 2 / self.until

    def measures(self, values):
        """Distance of both ends from the reference, root of the mean square; m."""
        away = [math.dist(a, b) for a, b in zip(values["ends"], self.reference, strict=True)]
        return {"error": math.hypot(*away) / math.sqrt(2)}


class Swing:
    """A flexible beam with a heavy middle on two vertical links, pushed for 0.256 s.

    Half of the cells are in the beam, a quarter in each link.
    """

    section = steel_like(5e-3, 1e-3, E=73e9, nu=0.3, rho=2700.0)
    stiffer, mass, length, connector = 100.0, 0.5, 0.72, 0.36  # -, kg, m, m
    peak, until, end = 2.0, 0.256, 2.5  # N, s, s
    sampled = 0.05  # s
    compared = 1.2  # s; at 1.53 s links and beam snap taut, and what follows hangs on every digit

    def chains(self, cells):
        rigid, n = self.section.times(self.stiffer), cells // 4
        L, H = self.length, self.connector
        return [
            Chain((0, 0), (L, 0), self.section, 2 * n),
            Chain((0, 0), (0, H), rigid, n),
            Chain((L, 0), (L, H), rigid, n),
        ]

    def push(self, t):
        return self.peak * max(0.0, 1 - abs(2 * t / self.until - 1))

    def measures(self, values):
        """Distance of the middle from the reference, root of the mean square up to 1.2 s; m.

        Where a program tells the energy: its change from the end of the push to the last sample.
        """
        n, told = round(self.compared / self.sampled), {}
        if energy := values.get("energy"):
            told["drift"] = energy[-1] / energy[math.ceil(self.until / self.sampled)] - 1
        reference = known("P3").get("middle")
        if reference is not None:
            away = np.array(values["middle"])[:n] - reference[:n]
            told["error"] = float(np.sqrt(np.mean(np.sum(away**2, axis=1))))
        return told


class Portal:
    """A frame that is pushed for 0.1 s, with a rotational hinge that yields, top right.

    A third of the cells is in each of left column, girder and right column.  Displacement is that
    of the top left corner; the rotation of the hinge is that of the column against the girder.
    """

    section = Section(EA=1e7, GA=1e7 / 2.6 * 5 / 6, EI=1e4, rhoA=10.0, rhoI=10.0 * 1e4 / 1e7)
    height, span = 3.0, 4.0  # m
    stiffness, limit, ratio = 1e5, 500.0, 0.01  # N m/rad, N m, -
    force, until, end, dt = 2000.0, 0.1, 15.0, 1e-3  # N, s, s, s
    sampled = 0.02  # s

    def chains(self, cells):
        n, B, H = cells // 3, self.span, self.height
        ends = (((0, 0), (0, H)), ((0, H), (B, H)), ((B, H), (B, 0)))
        return [Chain(a, b, self.section, n) for a, b in ends]

    def push(self, t):
        return self.force * math.sin(math.pi * t / self.until) if t < self.until else 0.0

    def measures(self, values):
        """Error of the displacement u, root of the mean square over 15 s; m.

        And the residual displacement, about which the frame vibrates in the last third: its mean
        with Hann's window, which leaves nothing of the vibration; m.
        """
        u = np.array(values["u"])
        last = u[2 * len(u) // 3 :]
        window = np.hanning(len(last) + 2)[1:-1]
        told = {"residual": float(window @ last / window.sum()), "end": float(u[-1])}
        reference = known("P4")
        if reference:
            told["error"] = float(np.sqrt(np.mean((u - reference["u"]) ** 2)))
            turn = np.array(values["turn"]) - reference["turn"]
            told["error_turn"] = float(np.sqrt(np.mean(turn**2)))
        return told


class Cantilever:
    """A clamped strip under a load at its end that grows to 100 N in 20 ms, in 20 steps."""

    section = STRIP
    force, end, dt = -100.0, 0.02, 1e-3  # N, s, s

    def chains(self, cells):
        return [Chain((0, 0), (1, 0), self.section, cells)]

    def push(self, t):
        return self.force * t / self.end

    def measures(self, values):
        """Distance of the end from the reference, at 20 ms; m."""
        reference = known("P5").get("tip")
        return {} if reference is None else {"error": math.dist(values["tip"], reference)}


class TumblingBeam:
    """A free beam in space, pushed and turned at its start until 5 s (Simo and Vu-Quoc 1988)."""

    section = Section(
        EA=1e4, GA=1e4, EI=500.0, rhoA=1.0, rhoI=10.0, GA3=1e4, EI2=500.0, GJ=500.0, rhoI2=10.0
    )
    force, moment = (0.1, 0.0, 0.0), (0.0, -0.5, -1.0)  # N, N m; times the factor
    peak, until, end = 200.0, 5.0, 10.0  # -, s, s

    def chains(self, cells):
        return [Chain((6, 0, 0), (0, 8, 0), self.section, cells)]

    def push(self, t):
        """Factor of force and moment: it rises and falls until 5 s."""
        return self.peak * max(0.0, min(t, self.until - t)) * 2 / self.until

    def measures(self, values):
        """Distance of both ends from the reference at 10 s, root of the mean square; m.

        And the relative change of energy from the end of the push to 10 s.
        """
        energy = values["energy"]
        told = {"drift": energy[-1] / energy[0] - 1}
        reference = known("P6").get("ends")
        if reference is not None:
            away = np.subtract(values["ends"], reference)
            told["error"] = float(np.sqrt(np.mean(np.sum(away**2, axis=1))))
        return told


PROBLEMS = {
    "P1": RollUp(),
    "P2": FlyingBeam(),
    "P3": Swing(),
    "P4": Portal(),
    "P5": Cantilever(),
    "P6": TumblingBeam(),
}
