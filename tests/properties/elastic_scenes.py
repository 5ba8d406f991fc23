# SPDX-License-Identifier: MIT
"""Random elastic scenes as plain numbers, and the ways to state one scene that must not matter.

A draw is a tree of one to four beams.  `Built` states it in other units, turned, or with beams cut
in two; results at its places must then be the same, scaled and turned.
"""

import math
from itertools import chain, pairwise
from types import SimpleNamespace

from mpi4py import MPI

import numpy as np
from scene_statements import AS_GIVEN

import ufl_beam as ub

DRAWS = range(12)
"""Seeds of the default run."""

NODES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where things are attached: at vertices of all cell counts, 4 and 8, also of beams cut at 0.5."""

STEP, STEPS = 0.02, 15
"""Size and number of time steps; s.  The lowest periods of the scenes are of the order of 1 s."""

SECTION = {
    "EA": (1e3, 1e4, "N"), "GA": (1e3, 1e4, "N"), "EI": (10, 100, "N m2"),
    "rhoA": (0.5, 2.0, "kg/m"), "rhoI": (0.01, 0.1, "kg m"),
}  # fmt: skip
"""Limits and dimensions of the numbers of a section."""


def draw(seed, *, free=False, fixed=False, dead=False):
    """Numbers of a random scene, in SI; places are (beam, s).

    Beams are (start, end, section, cells), joints (kind, place, place), supports (kind, place,
    direction in rad), forces (kind, place, force, moment, duration of the ramp), lines (beam,
    force), masses (place, mass, inertia), a throw (linear, angular).  A scene may be free, clamped
    at its root for statics (`fixed`), or without follower loads (`dead`).
    """
    random = np.random.default_rng(seed)

    def some(low, high):
        return float(random.uniform(low, high))

    def pair(size):
        return some(-size, size), some(-size, size)

    def beam():
        return int(random.integers(0, len(scene.beams)))

    def place():
        return beam(), float(random.choice(NODES))

    names = "beams", "joints", "supports", "forces", "lines", "masses"
    scene = SimpleNamespace(gravity=None, throw=None, **{name: [] for name in names})
    for i in range(random.integers(1, 5)):
        if i == 0:
            start = pair(1)
        else:
            parent, s = place()
            (ax, ay), (bx, by), *_ = scene.beams[parent]
            start = (ax * (1 - s) + bx * s, ay * (1 - s) + by * s)
            hinge = random.random() < 0.5 and not fixed
            scene.joints.append(("Revolute" if hinge else "Rigid", (parent, s), (i, 0.0)))
        length, angle = some(0.5, 2.0), some(-math.pi, math.pi)
        end = (start[0] + length * math.cos(angle), start[1] + length * math.sin(angle))
        section = {name: some(*limits) for name, (*limits, _) in SECTION.items()}
        scene.beams.append((start, end, section, int(random.choice([4, 8]))))
    if fixed:
        scene.supports.append(("Clamped", (0, 0.0), 0.0))
    elif not free:
        kind = str(random.choice(["Clamped", "Pinned", "Roller"]))
        scene.supports.append((kind, (0, 0.0), some(-math.pi, math.pi)))
        if random.random() < 0.5:
            last = len(scene.beams) - 1, 1.0
            scene.supports.append(("Roller", last, some(-math.pi, math.pi)))
    for _ in range(random.integers(1, 4)):
        kind = "PointLoad" if dead or random.random() < 0.7 else "FollowerLoad"
        scene.forces.append((kind, place(), pair(20), some(-5, 5), some(0.05, 0.5)))
    if random.random() < 0.5:
        scene.lines.append((beam(), pair(5)))
    if random.random() < 0.5:
        scene.masses.append((place(), some(0.1, 3.0), some(0.0, 0.5)))
    if random.random() < 0.5 and not free:
        scene.gravity = pair(10)
    if free:
        scene.throw = pair(2), some(-3, 3)
    return scene


class Built:
    """A draw as a scene, in the units and axes of a statement."""

    def __init__(self, draw, statement=AS_GIVEN, *, cut=()):
        self.draw, self.statement, unit = draw, statement, statement.unit
        self._beams, joints = {}, []
        for i, (a, b, numbers, cells) in enumerate(draw.beams):
            section = ub.Section(**{n: x * unit(SECTION[n][2]) for n, x in numbers.items()})
            ends = [self._vector(p, "m") for p in (a, b)]
            if i in cut:
                ends.insert(1, tuple((np.array(ends[0]) + ends[1]) / 2))
                cells //= 2
            self._beams[i] = [
                ub.Beam(*two, section, cells=cells, name=f"beam{i}") for two in pairwise(ends)
            ]
            joints += [ub.Rigid(x.end, y.start) for x, y in pairwise(self._beams[i])]
        for kind, one, other in draw.joints:
            joints.append(getattr(ub, kind)(self.place(one), self.place(other)))
        self.supports = []
        for kind, place, direction in draw.supports:
            along = self._vector((math.cos(direction), math.sin(direction)))
            more = {"along": along} if kind == "Roller" else {}
            self.supports.append(getattr(ub, kind)(self.place(place), **more))
        loads = []
        for kind, place, force, moment, duration in draw.forces:
            numbers = self._vector(force, "N"), moment * unit("N m"), ub.ramp(duration * unit("s"))
            loads.append(getattr(ub, kind)(self.place(place), *numbers))
        for i, force in draw.lines:
            loads += [ub.LineLoad(x, force=self._vector(force, "N/m")) for x in self._beams[i]]
        if draw.gravity:
            loads.append(ub.Gravity(self._vector(draw.gravity, "m/s2")))
        masses = [
            ub.PointMass(self.place(place), mass * unit("kg"), inertia * unit("kg m2"))
            for place, mass, inertia in draw.masses
        ]
        pieces, initial = [*chain(*self._beams.values())], []
        if draw.throw:
            linear, angular = self._vector(draw.throw[0], "m/s"), draw.throw[1] * unit("1/s")
            initial.append(ub.Velocity(pieces, linear=linear, angular=angular, about=(0.0, 0.0)))
        self.scene = ub.Scene(
            pieces, joints=joints, supports=self.supports, loads=loads, masses=masses,
            initial=initial,
        )  # fmt: skip

    def _vector(self, xy, dimension="1"):
        x, y = self.statement.turned(*xy)
        unit = self.statement.unit(dimension)
        return x * unit, y * unit

    def place(self, place):
        """The place (beam, s) of the draw."""
        i, s = place
        return in_pieces(self._beams[i], s)

    def run(self, scheme, *, steps=STEPS, step=STEP, adaptive=None, **more):
        """Simulate `steps` steps of `step` seconds."""
        step *= self.statement.unit("s")
        self.solution = ub.simulate(
            self.scene, scheme, t=(0.0, steps * step), dt=adaptive or step, **more
        )
        return self

    def motion(self):
        """(u, v, ψ) of the nodes of all beams in all steps, in SI and the axes of the draw."""
        places = [self.place((i, s)) for i in self._beams for s in NODES]
        return np.array([self.statement.motion(self.solution.displacement(p)) for p in places])

    def reactions(self):
        """(F_x, F_y, M) of the supports after the first step, in SI and the axes of the draw."""
        rows = [
            self.statement.motion(self.solution.reaction(s)[1:], "N", "N m") for s in self.supports
        ]
        return np.array(rows).reshape(len(rows), -1, 3)

    def section_forces(self):
        """(N, V, M) of all cells at the end, in SI."""
        rows = [self.solution.section_forces(p) for i in self._beams for p in self._beams[i]]
        return np.concatenate(rows) / [self.statement.unit(x) for x in ("N", "N", "N m")]

    def energies(self):
        """The ledger in SI, by name."""
        energy = self.solution.energy
        groups = {**energy.state, **energy.supplied, **energy.lost}
        return {name: values / self.statement.unit("J") for name, values in groups.items()}

    @property
    def throughput(self):
        return self.solution.energy.energy_transferred / self.statement.unit("J")

    def results(self):
        """Arrays of all kinds of results."""
        return self.motion(), self.reactions(), self.section_forces()


def require_same_on_processes(run, tolerance):
    """All processes together find the result of each alone; on one, a run can be repeated."""
    one, other = run(MPI.COMM_WORLD), run(MPI.COMM_SELF)
    assert difference(one, other) < tolerance
    assert len(set(MPI.COMM_WORLD.allgather(one.motion().tobytes()))) == 1
    if MPI.COMM_WORLD.size == 1:
        assert (one.motion() == other.motion()).all()


def in_pieces(pieces, s):
    """A place of a beam of one or two pieces."""
    if len(pieces) == 1:
        return pieces[0].at(s)
    return pieces[0].at(2 * s) if s <= 0.5 else pieces[1].at(2 * s - 1)


def difference(one, other):
    """Largest difference of two results, over the largest value of each kind or the throughput."""
    parts = [relative(a, b) for a, b in zip(one.results(), other.results(), strict=True)]
    first, second = one.energies(), other.energies()
    assert first.keys() == second.keys()
    through = one.throughput
    return max([*parts, *(float(np.abs(first[n] - second[n]).max()) / through for n in first)])


def relative(one, other):
    """Largest difference as a part of the largest value."""
    assert one.shape == other.shape
    largest = float(np.abs(one).max(initial=0.0))
    return float(np.abs(one - other).max(initial=0.0)) / (largest or 1.0)
