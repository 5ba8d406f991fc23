# SPDX-License-Identifier: MIT
"""Random scenes in space, which can be stated in any axes: chains, trees and loops of parts."""

import math
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

import ufl_beam as ub
from ufl_beam.model.bodies import BodyPoint

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
    "friction": lambda k: ub.Coulomb(0.05 * k),
}  # fmt: skip
SMOOTH = "spring", "motor", "force"
"""Laws that do not dissipate and have no kinks."""

LAWS_OF_SECTIONS = "axial", "shear", "shear3", "twisting", "bending2", "bending"

TIMES = lambda t: t, lambda t: math.sin(5 * t), lambda t: min(1.0, 0.5 + t)


def built(seed, axes=None, factor=1.0):
    """Return a random scene in space, its scheme, its step (s), and what is known of it.

    ``axes`` is a rotation of the whole scene.  Without loads and supports the scene is ``free``.
    ``factor`` multiplies forces of loads and the stiffness EI2.
    """
    return _Writer(seed, axes or Rotation.identity(), factor).scene()


class _Writer:
    """Draws a scene: the same numbers in all axes."""

    def __init__(self, seed, axes, factor):
        self._random, self._axes, self._factor = np.random.default_rng(seed), axes, factor
        self._seed = seed
        self._parts = {name: [] for name in ("beams", "bodies", "joints", "connectors")}
        self._anchors, self.laws = [], []  # names of laws of connectors and beams
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
        factors, laws = self._random.uniform(0.2, 1.0, 5), {}
        kind = self._one([""] * 4 + ["laws", "laws", "fibres", "hinge"])
        if kind:
            self.laws.append(kind)
        if kind == "fibres":
            y, z, r = *np.array([(-1, -1), (-1, 1), (1, -1), (1, 1), (0, 2), (0, -2)]).T, 0.1
            law = ub.ElastoPlastic(0.1 * EI * self._size(-1, 1) / r, isotropic=EI / r**2 / 5)
            return ub.Section.of_fibres(
                y * r, np.full(6, r * r), z=z * r, E=EI / r**4 / 4, nu=0.3, rho=rhoA / (6 * r * r),
                torsion=r**4 * factors[3], shear_factor=factors[0], fibres=ub.Fibres(law),
            )  # fmt: skip
        if kind == "laws":
            for name in LAWS_OF_SECTIONS:
                size = EI * self._size(-2, 0) * (0.1 if "ing" in name else 1.0)
                more = {"isotropic": 0.1 * EI, "kinematic": 0.2 * EI}
                more["viscosity"] = ub.Perzyna(eta=0.1 * size)
                more = {key: x for key, x in more.items() if self._chance(0.5)}
                if self._chance(0.5):
                    laws[name] = ub.ElastoPlastic(size, **more)
        elif kind == "hinge":
            laws["hinge"] = self._softening(EI)
        return ub.Section(
            EA=EA, GA=EA * factors[0], GA3=EA * factors[1], EI=EI, GJ=EI * factors[3],
            EI2=EI * factors[2] * self._factor, rhoA=rhoA, rhoI=rhoI, rhoI2=rhoI * factors[4],
            **laws,
        )  # fmt: skip

    def _softening(self, EI):
        limit = EI * self._size(-3, -1)
        return ub.LinearSoftening(limit, fracture_energy=limit * self._size(-0.5, 0.5))

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
            kinds += ["Universal", "Cylindrical"]
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
        hinges, stiff = {}, not i or kind == "Rigid"
        if self._chance(0.15) and not section.fibres:
            self.laws.append("hinge")
            hinges = {self._one([0.0, 0.5] if stiff else [0.5]): self._softening(section.EI)}
        beam = ub.Beam(
            *ends, section, cells=cells, up=self._in_axes(up), name=f"beam{i}", hinges=hinges
        )
        self._parts["beams"].append(beam)
        if parent is not None:
            self._join(kind, parent.place, beam.start)
        if loop is not None:
            self._parts["joints"].append(ub.Spherical(loop.place, beam.end))
        for s in SPOTS:
            point = start + s * way
            self._anchors.append(SimpleNamespace(place=beam.at(s), point=point, part=beam))

    def _join(self, kind, a, b):
        vector = self._vector()
        axis = {"axis": self._in_axes(vector)}
        more = dict(axis) if kind in ("Revolute", "Prismatic", "Cylindrical") else {}
        if kind == "Prismatic" and self._chance(0.3):
            more["turning"] = True
        if kind == "Universal":
            more["axes"] = axis["axis"], self._in_axes(np.cross(vector, self._vector()))
        if kind in ("Rigid", "Revolute", "Spherical", "Universal") and self._chance(0.2):
            more["multipliers"] = True
        self._parts["joints"].append(getattr(ub, kind)(a, b, **more))
        if kind == "Revolute" and self._chance(0.5):
            names = ["hinge", "hardening", "friction"] + ["rubbing"] * ("multipliers" in more)
            size, name = self._size(-2, 1), self._one(names)
            law = {
                "hinge": ub.RigidPlastic(ub.LinearSoftening(size, fracture_energy=size)),
                "hardening": ub.RigidPlastic(ub.ElastoPlastic(size, kinematic=size)),
                "friction": ub.Coulomb(size),
                "rubbing": ub.Coulomb(coefficient=0.1, joint=self._parts["joints"][-1]),
            }[name]
            self.laws.append(name)
            self._parts["connectors"].append(ub.Turn(a, b, law, **axis))

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
        size, time = self._size(-1, 1.5) * self._factor, self._one(TIMES)
        loads = [self._load(size, time) for _ in range(self._random.integers(1, 3))]
        frames = [x for x in loads if isinstance(x, ub.RotatingFrame)]
        return [x for x in loads if x not in frames[1:]]

    def _load(self, size, time):
        beam, timed = self._one(self._parts["beams"]), {"amplitude": time}
        force, moment = (self._in_axes(self._vector(size)) for _ in range(2))
        kind = self._one([
            "force", "moment", "line", "gravity", "follower", "pressure", "moving", "frame",
        ])  # fmt: skip
        place = beam.at(float(self._one(SPOTS[1:])))
        a, b, speed = *(size * self._random.normal(size=2)).tolist(), self._size(-1, 1)
        about = self._in_axes(self._vector())
        return {
            "force": lambda: ub.PointLoad(place, force=force, **timed),
            "moment": lambda: ub.PointLoad(place, force=force, moment=moment, **timed),
            "line": lambda: ub.LineLoad(beam, force=force, **timed),
            "gravity": lambda: ub.Gravity(force, **timed),
            "follower": lambda: ub.FollowerLoad(place, force=force, moment=moment, **timed),
            "pressure": lambda: ub.Pressure(beam, normal=(a, b), tangential=a - b, **timed),
            "moving": lambda: ub.MovingLoad(beam, lambda t: speed * t, force=force, **timed),
            "frame": lambda: ub.RotatingFrame(tuple(0.1 * x for x in moment), about=about),
        }[kind]()

    def scene(self):
        for i in range(self._random.integers(1, 5)):
            self._beam(i)
        for i in range(self._random.integers(0, 3)):
            self._body(i)
        first, parts = self._parts["beams"][0], self._parts
        some = ["", "", "Clamped", "Pinned", "Roller", "Hinge", "Moving"]
        support = self._one(["Clamped", "Turned"] if self._static else some)
        free = not support and self._chance(0.6)
        for _ in range(self._random.integers(0, 3) * (not self._static)):
            self._connector(free=free)
        initial = []
        axis, up = self._vector(), self._vector()
        if support not in ("Clamped", "Turned") and self._chance(0.8):
            angular, linear = self._vector(self._size(-1, 1)), self._vector(1.0 * (not support))
            if support == "Hinge":
                angular = axis * np.linalg.norm(angular)
            initial = [ub.Velocity(
                [*parts["beams"], *parts["bodies"]], angular=self._in_axes(angular),
                linear=self._in_axes(linear), about=first.ends[0],
            )]  # fmt: skip
        along = {"along": self._in_axes(axis), "up": self._in_axes(up)}
        hinge, rate = {"axis": along["along"], "u": 0.0, "v": 0.0, "w": 0.0}, self._size(-1, 1)
        supports = {
            "": lambda: [], "Clamped": lambda: [ub.Clamped(first.start)],
            "Pinned": lambda: [ub.Pinned(first.start)],
            "Roller": lambda: [ub.Roller(first.start, along=along["along"])],
            "Hinge": lambda: [ub.PrescribedDisplacement(first.start, **hinge)],
            "Moving": lambda: [ub.PrescribedDisplacement(
                first.start, **along, u=lambda t: 0.1 * t * t, w=0.0)],
            "Turned": lambda: [ub.PrescribedDisplacement(
                first.start, **hinge, psi=lambda t: rate * t * t)],
        }[support]()  # fmt: skip
        if not free and not self._static and self._chance(0.2):  # one direction of another place
            held, vector = self._anchor(), self._vector()
            if np.any(held.point) and not isinstance(held.place, BodyPoint):
                axes = {"along": self._in_axes(vector), "up": self._in_axes(np.roll(vector, 1))}
                u = self._one([0.0, lambda t: 0.1 * t * t])
                supports.append(ub.PrescribedDisplacement(held.place, u=u, **axes))
                initial = []
        damping = [ub.KelvinVoigt(self._size(-3, -1))] if self._chance(0.15) else []
        self.laws += ["viscous"] * len(damping)
        loads = [] if free else self._loads()
        dissipates = bool({*self.laws} - {*SMOOTH})
        schemes = [ub.EnergyMomentum(), ub.EnergyMomentum(), ub.EnergyMomentum(alpha=0.1)]
        schemes += [ub.EnergyMomentumDecaying(), ub.EnergyMomentum(order=4)][: 1 + (not dissipates)]
        if self._static:
            schemes = [ub.Static(), ub.EnergyMomentumStatic()]
        scheme, dt = self._one(schemes), float(2.0 ** self._random.integers(-7, -2))
        if self._static:
            dt = 1 / STEPS
        fixed = self._static or isinstance(scheme, ub.EnergyMomentumDecaying)
        steps = ub.Adaptive(1e-3, first=dt / 4) if not fixed and self._chance(0.1) else dt
        scene = ub.Scene(
            parts["beams"], bodies=parts["bodies"], joints=parts["joints"], supports=supports,
            connectors=parts["connectors"], loads=loads, initial=initial, damping=damping,
        )  # fmt: skip
        return SimpleNamespace(
            scene=scene,
            scheme=scheme,
            dt=dt,
            steps=steps,
            free=free,
            axes=self._axes,
            seed=self._seed,
        )
