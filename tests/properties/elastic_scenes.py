# SPDX-License-Identifier: MIT
"""Random scenes as plain numbers, and the ways to state one scene that must not matter.

A draw is a tree of one to four beams, each joined to an earlier one, with supports, loads and
masses.  `Built` states it in other units, turned, or with beams cut in two; results at its places
must then be the same, scaled and turned.
"""

import math
from dataclasses import dataclass, field

import numpy as np

import ufl_beam as ub

DRAWS = range(12)
"""Seeds of the default run."""

NODES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where things are attached: at vertices of all cell counts, 4 and 8, also of beams cut at 0.5."""

STEP, STEPS = 0.02, 15
"""Size and number of time steps; s.  The lowest periods of the scenes are of the order of 1 s."""


@dataclass(frozen=True)
class Units:
    """What a metre, a kilogram and a second are called in other units."""

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0

    @property
    def newton(self):
        return self.kilogram * self.metre / self.second**2

    @property
    def joule(self):
        return self.newton * self.metre


@dataclass
class Draw:
    """The numbers of a scene, in SI.

    Attributes:
        beams: (start, end, section, cells) of each.
        joints: (kind, place, place); a place is (beam, s).
        supports: (kind, place, direction in rad).
        forces: (kind, place, force, moment, duration of the ramp).
        lines: (beam, force).
        masses: (place, mass, inertia).
        gravity: (g_x, g_y), or None.
        throw: (linear, angular), or None: a rigid motion of the whole scene.
    """

    beams: list = field(default_factory=list)
    joints: list = field(default_factory=list)
    supports: list = field(default_factory=list)
    forces: list = field(default_factory=list)
    lines: list = field(default_factory=list)
    masses: list = field(default_factory=list)
    gravity: tuple | None = None
    throw: tuple | None = None


def draw(seed, *, free=False, fixed=False, dead=False):
    """A random scene.

    Args:
        free: Without supports.
        fixed: One that cannot move without strain, for statics: the tree is clamped at its root.
        dead: Without follower loads.
    """
    random = np.random.default_rng(seed)

    def some(low, high):
        return float(random.uniform(low, high))

    scene = Draw()
    for i in range(random.integers(1, 5)):
        if i == 0:
            start = (some(-1, 1), some(-1, 1))
        else:
            parent, s = int(random.integers(0, i)), float(random.choice(NODES))
            (ax, ay), (bx, by), *_ = scene.beams[parent]
            start = (ax * (1 - s) + bx * s, ay * (1 - s) + by * s)
            hinge = random.random() < 0.5 and not fixed
            scene.joints.append(("Revolute" if hinge else "Rigid", (parent, s), (i, 0.0)))
        length, angle = some(0.5, 2.0), some(-math.pi, math.pi)
        end = (start[0] + length * math.cos(angle), start[1] + length * math.sin(angle))
        section = {
            "EA": some(1e3, 1e4),
            "GA": some(1e3, 1e4),
            "EI": some(10, 100),
            "rhoA": some(0.5, 2.0),
            "rhoI": some(0.01, 0.1),
        }
        scene.beams.append((start, end, section, int(random.choice([4, 8]))))
    last = len(scene.beams) - 1
    if fixed:
        scene.supports.append(("Clamped", (0, 0.0), 0.0))
    elif not free:
        kind = str(random.choice(["Clamped", "Pinned", "Roller"]))
        scene.supports.append((kind, (0, 0.0), some(-math.pi, math.pi)))
        if random.random() < 0.5:
            scene.supports.append(("Roller", (last, 1.0), some(-math.pi, math.pi)))
    for _ in range(random.integers(1, 4)):
        kind = "PointLoad" if dead or random.random() < 0.7 else "FollowerLoad"
        place = (int(random.integers(0, last + 1)), float(random.choice(NODES)))
        force = (some(-20, 20), some(-20, 20))
        scene.forces.append((kind, place, force, some(-5, 5), some(0.05, 0.5)))
    if random.random() < 0.5:
        scene.lines.append((int(random.integers(0, last + 1)), (some(-5, 5), some(-5, 5))))
    if random.random() < 0.5:
        place = (int(random.integers(0, last + 1)), float(random.choice(NODES)))
        scene.masses.append((place, some(0.1, 3.0), some(0.0, 0.5)))
    if random.random() < 0.5 and not free:
        scene.gravity = (some(-10, 10), some(-10, 10))
    if free:
        scene.throw = ((some(-2, 2), some(-2, 2)), some(-3, 3))
    return scene


class Built:
    """A draw as a scene.

    Attributes:
        scene: The scene.
        supports: Its supports in the order of the draw.
    """

    def __init__(self, draw, *, units=Units(), angle=0.0, cut=()):  # noqa: B008
        self.draw, self.units = draw, units
        self._cos, self._sin = math.cos(angle), math.sin(angle)
        self._cut = set(cut)
        metre, kilogram, second = units.metre, units.kilogram, units.second
        newton, joule = units.newton, units.joule
        self._beams = {}
        pieces, joints = [], []
        for i, (a, b, numbers, cells) in enumerate(draw.beams):
            section = ub.Section(
                EA=numbers["EA"] * newton,
                GA=numbers["GA"] * newton,
                EI=numbers["EI"] * joule * metre,
                rhoA=numbers["rhoA"] * kilogram / metre,
                rhoI=numbers["rhoI"] * kilogram * metre,
            )
            ends = [self._turn(p, metre) for p in (a, b)]
            name = f"beam{i}"
            if i in self._cut:
                middle = tuple((np.array(ends[0]) + ends[1]) / 2)
                self._beams[i] = [
                    ub.Beam(ends[0], middle, section, cells=cells // 2, name=f"{name}a"),
                    ub.Beam(middle, ends[1], section, cells=cells // 2, name=f"{name}b"),
                ]
                first, second_half = self._beams[i]
                joints.append(ub.Rigid(first.end, second_half.start))
            else:
                self._beams[i] = [ub.Beam(*ends, section, cells=cells, name=name)]
            pieces += self._beams[i]
        for kind, one, other in draw.joints:
            joints.append(getattr(ub, kind)(self.place(one), self.place(other)))
        self.supports = []
        for kind, place, direction in draw.supports:
            along = self._turn((math.cos(direction), math.sin(direction)))
            more = {"along": along} if kind == "Roller" else {}
            self.supports.append(getattr(ub, kind)(self.place(place), **more))
        loads = [
            getattr(ub, kind)(
                self.place(place),
                force=self._turn(force, newton),
                moment=moment * joule,
                amplitude=ub.ramp(duration * second),
            )
            for kind, place, force, moment, duration in draw.forces
        ]
        loads += [
            ub.LineLoad(piece, force=self._turn(force, newton / metre))
            for i, force in draw.lines
            for piece in self._beams[i]
        ]
        if draw.gravity:
            loads.append(ub.Gravity(self._turn(draw.gravity, metre / second**2)))
        masses = [
            ub.PointMass(self.place(place), mass * kilogram, inertia * kilogram * metre**2)
            for place, mass, inertia in draw.masses
        ]
        initial = []
        if draw.throw:
            linear, angular = draw.throw
            initial.append(
                ub.Velocity(
                    pieces,
                    linear=self._turn(linear, metre / second),
                    angular=angular / second,
                    about=(0.0, 0.0),
                )
            )
        self.scene = ub.Scene(
            pieces,
            joints=joints,
            supports=self.supports,
            loads=loads,
            masses=masses,
            initial=initial,
        )

    def _turn(self, vector, unit=1.0):
        x, y = vector
        return (self._cos * x - self._sin * y) * unit, (self._sin * x + self._cos * y) * unit

    def place(self, place):
        """The place (beam, s) of the draw."""
        i, s = place
        pieces = self._beams[i]
        if len(pieces) == 1:
            return pieces[0].at(s)
        return pieces[0].at(2 * s) if s <= 0.5 else pieces[1].at(2 * s - 1)

    def run(self, scheme, *, steps=STEPS, step=STEP, **more):
        """Simulate `steps` steps of `step` seconds."""
        self.solution = ub.simulate(
            self.scene,
            scheme,
            t=(0.0, steps * step * self.units.second),
            dt=step * self.units.second,
            **more,
        )
        return self

    def _turned_back(self, rows, unit, moment_unit):
        x, y, turn = rows.T
        c, s = self._cos, self._sin
        return np.column_stack([(c * x + s * y) / unit, (c * y - s * x) / unit, turn / moment_unit])

    def motion(self):
        """(u, v, ψ) of the nodes of all beams in all steps, in SI and the axes of the draw."""
        return np.array(
            [
                self._turned_back(
                    self.solution.displacement(self.place((i, s))), self.units.metre, 1.0
                )
                for i in self._beams
                for s in NODES
            ]
        )

    def reactions(self):
        """(F_x, F_y, M) of the supports after the first step, in SI and the axes of the draw."""
        rows = [
            self._turned_back(self.solution.reaction(s)[1:], self.units.newton, self.units.joule)
            for s in self.supports
        ]
        return np.array(rows).reshape(len(rows), -1, 3)

    def section_forces(self):
        """(N, V, M) of all cells at the end, in SI."""
        rows = [self.solution.section_forces(p) for i in self._beams for p in self._beams[i]]
        return np.concatenate(rows) / [self.units.newton, self.units.newton, self.units.joule]

    def energies(self):
        """The ledger in SI, by name."""
        energy = self.solution.energy
        groups = {**energy.state, **energy.supplied, **energy.lost}
        return {name: values / self.units.joule for name, values in groups.items()}


def difference(one, other):
    """Largest difference of two results, each kind as a part of its largest value.

    Rotations are compared with the larger of a radian and the largest rotation, and so on: parts of
    1 are what a result of the order of the scene is.
    """
    parts = [relative(one.motion(), other.motion())]
    if len(one.supports):
        parts.append(relative(one.reactions(), other.reactions()))
    parts.append(relative(one.section_forces(), other.section_forces()))
    first, second = one.energies(), other.energies()
    assert first.keys() == second.keys()
    throughput = one.solution.energy.energy_transferred / one.units.joule
    parts += [float(np.abs(first[n] - second[n]).max()) / throughput for n in first]
    return max(parts)


def relative(one, other):
    """Largest difference as a part of the largest value."""
    assert one.shape == other.shape
    return float(np.abs(one - other).max() / np.abs(one).max())
