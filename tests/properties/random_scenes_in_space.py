# SPDX-License-Identifier: MIT
"""Random scenes in space, which can be stated in any axes: chains, trees and loops of parts."""

import math
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

import ufl_beam as ub

STEPS = 8
"""Steps of a run."""

SPOTS = (0.0, 0.5, 1.0)
"""Where parts are attached to beams."""

LAWS = {
    "spring": lambda k: ub.Spring(k), "damper": lambda k: ub.Damper(0.1 * k),
    "stop": lambda k: ub.Stop(k, low=-0.05, high=0.02),
    "motor": lambda k: ub.PrescribedMotion(lambda t: 0.1 * t * t),
    "force": lambda k: ub.PrescribedForce(lambda t: 0.05 * k * t),
    "yielding": lambda k: ub.Spring(k, ub.ElastoPlastic(0.02 * k)),
}  # fmt: skip
SMOOTH = "spring", "motor", "force"
"""Laws that do not dissipate and have no kinks."""


def built(seed, axes=None):
    """Return a random scene in space, its scheme, its step (s), and what is known of it.

    ``axes`` is a rotation of the whole scene.  Without loads and supports the scene is ``free``.
    """
    return _Writer(seed, axes or Rotation.identity()).scene()


class _Writer:
    """Draws a scene: the same numbers in all axes."""

    def __init__(self, seed, axes):
        self._random, self._axes, self.seed = np.random.default_rng(seed), axes, seed
        self._parts = {name: [] for name in ("beams", "bodies", "joints", "connectors")}
        self._anchors, self.laws = [], []
        # Points and vectors of the draw; places of the scene
        self._static = self._chance(0.25)

    def _chance(self, p):
        return self._random.random() < p

    def _one(self, some):
        return some[int(self._random.integers(0, len(some)))]

    def _size(self, low, high):
        """A number whose logarithm is uniform; decades."""
        return float(10 ** self._random.uniform(low, high))

    def _vector(self, size=1.0):
        v = self._random.normal(size=3)
        return size * v / np.linalg.norm(v)

    def _in_axes(self, v):
        return tuple(self._axes.apply(v).tolist())

    def _section(self):
        EI, rhoA = self._size(1, 3), self._size(-1, 1)
        EA, rhoI = EI * self._size(1, 4), rhoA * self._size(-4, 0)
        factors = self._random.uniform(0.2, 1.0, 5)
        return ub.Section(
            EA=EA, GA=EA * factors[0], GA3=EA * factors[1], EI=EI, EI2=EI * factors[2],
            GJ=EI * factors[3], rhoA=rhoA, rhoI=rhoI, rhoI2=rhoI * factors[4],
        )  # fmt: skip

    def _anchor(self):
        """A place of a part as a function of the point, its part, and the point."""
        return self._one(self._anchors)

    def _beam(self, i):
        apart = 0.0
        if not i:
            start, parent = np.zeros(3), None
        else:
            parent = self._anchor()
            kinds = ["Rigid", "Rigid", "Revolute", "Spherical", "Prismatic", "RigidLink", "Link"]
            kind = self._one(["Rigid", "RigidLink"] if self._static else kinds)
            apart = 0.4 if kind in ("RigidLink", "Link") else 0.0
            start = parent.point + self._vector(apart)
        way = self._vector(float(self._random.uniform(0.5, 2.0)))
        if i > 1 and not self._static and self._chance(0.3):  # a loop
            other = self._anchor()
            if np.linalg.norm(other.point - start) > 0.4:
                way, loop = other.point - start, other
            else:
                loop = None
        else:
            loop = None
        up = np.cross(way, self._vector())
        cells, section = int(self._one([2, 4])), self._section()
        ends = [self._in_axes(start), self._in_axes(start + way)]
        beam = ub.Beam(*ends, section, cells=cells, up=self._in_axes(up), name=f"beam{i}")
        self._parts["beams"].append(beam)
        if parent is not None:
            self._join(kind, parent.place, beam.start)
        if loop is not None:
            self._parts["joints"].append(ub.Spherical(loop.place, beam.end))
        for s in SPOTS:
            point = start + s * way
            self._anchors.append(SimpleNamespace(place=beam.at(s), point=point, part=beam))

    def _join(self, kind, a, b):
        axis = {"axis": self._in_axes(self._vector())}
        more = axis if kind in ("Revolute", "Prismatic") else {}
        if kind == "Prismatic" and self._chance(0.3):
            more["turning"] = True
        self._parts["joints"].append(getattr(ub, kind)(a, b, **more))

    def _body(self, i):
        parent = self._anchor()
        center, mass = parent.point + self._vector(0.3), self._size(-1, 1)
        arms = 0.3 * self._random.normal(size=(4, 3))
        tensor = mass * sum(r @ r * np.eye(3) - np.outer(r, r) for r in arms) / len(arms)
        turned = self._axes.as_matrix() @ tensor @ self._axes.as_matrix().T
        body = ub.Body(
            self._in_axes(center), mass=mass, inertia=(turned + turned.T) / 2, name=f"body{i}"
        )
        self._parts["bodies"].append(body)
        kinds = ["Rigid"] if self._static else ["Rigid", "Revolute", "Spherical"]
        self._join(self._one(kinds), parent.place, body.at(*self._in_axes(parent.point)))
        point = center + self._vector(0.2)
        place = body.at(*self._in_axes(point))
        self._anchors.append(SimpleNamespace(place=place, point=point, part=body))

    def _connector(self, *, free):
        a, b = self._anchor(), self._anchor()
        to_ground = not free and self._chance(0.5)
        held = to_ground and not np.any(b.point)  # perhaps by the support
        if held or (a.part is b.part and not to_ground):
            return
        if to_ground:
            point = b.point + self._vector()
            a = SimpleNamespace(place=ub.ground(*self._in_axes(point)), point=point)
        kind = self._one(["Stretch", "Slide", "Turn"])
        if kind == "Stretch" and np.linalg.norm(a.point - b.point) < 0.3:
            return
        name = self._one([x for x in LAWS if x != "motor" or to_ground])
        if name == "motor" and kind != "Stretch":
            name = "spring"
        self.laws.append(name)
        law = LAWS[name](self._size(0, 3))
        axis = {} if kind == "Stretch" else {"axis": self._in_axes(self._vector())}
        self._parts["connectors"].append(getattr(ub, kind)(a.place, b.place, law, **axis))

    def _loads(self):
        size = self._size(-1, 1.5)
        time = self._one([lambda t: t, lambda t: math.sin(5 * t), lambda t: min(1.0, 0.5 + t)])
        loads = []
        for _ in range(self._random.integers(1, 3)):
            beam = self._one(self._parts["beams"])
            vectors = [self._in_axes(self._vector(size)) for _ in range(2)]
            kind = self._one(["force", "moment", "line", "gravity"])
            place = beam.at(float(self._one(SPOTS[1:])))
            loads.append({
                "force": lambda p=place, v=vectors: ub.PointLoad(p, force=v[0], amplitude=time),
                "moment": lambda p=place, v=vectors: ub.PointLoad(
                    p, force=v[0], moment=v[1], amplitude=time),
                "line": lambda b=beam, v=vectors: ub.LineLoad(b, force=v[0], amplitude=time),
                "gravity": lambda v=vectors: ub.Gravity(v[0], amplitude=time),
            }[kind]())  # fmt: skip
        return loads

    def scene(self):
        for i in range(self._random.integers(1, 5)):
            self._beam(i)
        for i in range(self._random.integers(0, 3)):
            self._body(i)
        first, parts = self._parts["beams"][0], self._parts
        support = "Clamped" if self._static else self._one(["", "Clamped", "Pinned"])
        free = not support and self._chance(0.6)
        for _ in range(self._random.integers(0, 3) * (not self._static)):
            self._connector(free=free)
        initial = []
        if support != "Clamped" and self._chance(0.8):
            angular, linear = self._vector(self._size(-1, 1)), self._vector(1.0 * (not support))
            initial = [ub.Velocity(
                [*parts["beams"], *parts["bodies"]], angular=self._in_axes(angular),
                linear=self._in_axes(linear), about=first.ends[0],
            )]  # fmt: skip
        supports = [getattr(ub, support)(first.start)] if support else []
        loads = [] if free else self._loads()
        dissipates = bool({*self.laws} - {*SMOOTH})
        schemes = [ub.EnergyMomentum(), ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.1)]
        schemes += [ub.EnergyMomentumDecaying(), ub.EnergyMomentum(order=4)][: 1 + (not dissipates)]
        if self._static:
            schemes = [ub.Static(), ub.EnergyMomentumStatic()]
        scheme, dt = self._one(schemes), float(2.0 ** self._random.integers(-7, -2))
        if self._static:
            dt = 1 / STEPS
        scene = ub.Scene(
            parts["beams"], bodies=parts["bodies"], joints=parts["joints"], supports=supports,
            connectors=parts["connectors"], loads=loads, initial=initial,
        )  # fmt: skip
        return SimpleNamespace(scene=scene, scheme=scheme, dt=dt, free=free, axes=self._axes)
