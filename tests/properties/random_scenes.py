# SPDX-License-Identifier: MIT
"""Random scenes of all public objects and schemes, each a script that anybody can run.

Sizes follow from the length of the first beam, EI/L² and its period, so that motions are large and
yet regular.  Scattered limits depend on the last digits of places: such scenes are reordered only.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from random_laws import IMPORTS, Laws
from scene_statements import AS_GIVEN, PARTS, MotionGeometry, scene_call

STEPS = 15
"""Steps of a run of equal ones."""

SAMPLE = 9, 27, 34, 38, 51, 91, 99, 110, 113, 150, 151, 164, 165, 175, 184, 190
"""Seeds of default runs: they have all public names, and more pairs of them than the first 40."""

SPOTS = (0.0, 0.25, 1 / 3, 0.5, 1.0)
"""Where things are attached to beams."""


def script(seed, statement=AS_GIVEN, wider=0.0):
    """Python source of a random scene; all sizes are drawn from so many decades more."""
    return _Writer(seed, statement, wider).source() + "\n"


class _Anchor(NamedTuple):
    """A place as it is written, its point in the first statement, and the part that it is of."""

    text: str
    point: tuple
    part: str
    is_end: bool = False

    def __str__(self):
        return self.text


class _Writer(Laws):
    """Draws a scene and writes it down."""

    def __init__(self, seed, statement, wider):
        self._wider = wider
        self._random = np.random.default_rng(seed)
        self._others = np.random.default_rng([seed, 1])
        self._scattered = self._chance(0.1)
        self._say = MotionGeometry(statement, places_stay=self._scattered)
        self._lists = {name: [] for name in PARTS}
        title = f"# {'scattered, ' * self._scattered}seed {seed}, {statement.name}"
        self._lines = [title, *IMPORTS]
        self._statement, self._anchors = statement, []
        self._flips = np.random.default_rng(statement.backwards)
        self._order = np.random.default_rng(statement.shuffled)
        self._static = self._chance(0.25)
        self._draw_scales((-1, 1), (1, 2), (-1, 5), (-1, 1))
        self._dt = self._T * self._size(-2, -0.7)
        self._end = STEPS * self._dt
        self._scheme()
        self._elastic = self._chance(0.3) and not self._scattered
        self._beam(None)
        for _ in range(self._integer(0, 3)):
            parent = self._one(self._anchors)
            (self._beam if self._chance(0.65) else self._body)(parent)
        self._root()
        self._second_support()
        for _ in range(self._integer(0, 2)):
            self._connector()
        for _ in range(self._integer(1, 3)):
            self._load()
        self._mass()
        self._damp()
        self._frame()
        self._mesh()

    def _scheme(self):
        a, b = self._some(0.01, 0.5), self._some(0, 0.5)
        if self._static:
            theta = f"EnergyMomentumStatic({self._some(0.5, 1):.2f})"
            names = ["Static()", "Static()", "EnergyMomentumStatic()", theta]
        else:
            names = [
                "EnergyMomentum()", "EnergyMomentum()", "EnergyMomentum()",
                f"EnergyMomentum({a:.2f}, {b:.2f})",
                f"EnergyMomentumDecaying({self._some(0.34, 1):.2f})", "EnergyMomentumPrinted()",
                "Newmark()", "Newmark(0.6, 0.35)", f"GeneralizedAlpha({self._some(0, 0.9):.2f})",
            ]  # fmt: skip
        self._name = self._one(names)
        at_end = self._name.startswith(("Newmark", "Generalized"))
        self._rubs = not at_end and not self._static
        self._may_hold = self._name != "Newmark()"
        # Nothing bounds the energy of undamped Newmark, which steps that adapt would follow.
        adapts = self._chance(0.2) and not self._static and self._name != "Newmark()"
        adapts = adapts and not self._name.startswith("EnergyMomentumDecaying")  # refused
        self._step = self._say.number(self._dt, "s")
        if adapts:
            stops = ", ".join(self._say.number(self._end * k / 4, "s") for k in (1, 2, 3))
            self._step = f"ub.Adaptive({self._size(-4, -2.5):.3g}, stops=[{stops}])"

    def _time(self):
        """A function of time, at most some ones large."""
        t, say = self._end, self._say
        ω = say.number(self._some(1, 6) / t, "1/s")
        first, last = (say.number(x, "s") for x in (t * self._some(0.2, 0.6), t))
        kinds = [
            f"ub.ramp({say.number(t * self._some(0.1, 1), 's')})",
            f"ub.Table([0.0, {first}, {last}], [0.0, {self._some(-1, 1)!r}, 1.0])",
            f"lambda t: math.sin({ω} * t)",
        ]
        if not self._static:
            kinds += ["lambda t: 1.0", f"lambda t: 1.0 - math.cos({ω} * t)"]
        return self._one(kinds)

    def _beam(self, parent):
        """A beam, joined to an anchor if there is one."""
        i = len(self._lists["beams"])
        name = f"beam{i}"
        _, hinges = self._section(i)
        joint, gap = self._kind_of_joint(parent)
        start = (0.0, 0.0) if parent is None else tuple(np.add(parent.point, gap))
        L, cells = self._L * self._some(0.5, 1.5), self._integer(1, 6)
        shape = self._one(["straight", "straight", "arc", "arc", "polyline", "along"])
        backwards = self._statement.backwards is not None
        backwards = backwards and (i == 0 or self._flips.random() < 0.7)
        axis, text = getattr(self, f"_{shape}")(start, L, backwards)
        more = f"section{i}, cells={cells}, name='{name}'"
        if backwards and self._asymmetric:
            more = more.replace(f"section{i}", f"section{i}_upside_down")
        if shape == "straight" and hinges:
            laws = {1 - s if backwards else s: law for s, law in hinges.items()}
            more += f", hinges={{{', '.join(f'{s!r}: {law}' for s, law in laws.items())}}}"
        way = f"  # {name} runs backwards" if backwards else ""
        self._lines.append(f"{name} = ub.Beam{text}, {more}){way}")
        self._lists["beams"].append(name)

        def at(s):
            place = f"{name}.at({1 - s if backwards else s!r})"
            return _Anchor(place, axis(s), name, is_end=s in (0.0, 1.0))

        if parent is not None:
            self._join(joint, parent, at(0.0))
        else:
            self._start = at(0.0)
        self._last = at(1.0)
        self._anchors += [at(s) for s in SPOTS]

    def _ends(self, points, backwards):
        return [self._say.point(p) for p in (points[::-1] if backwards else points)]

    def _straight(self, start, L, backwards):
        end = tuple(np.add(start, self._polar(L)))
        text = ", ".join(self._ends([start, end], backwards))
        return lambda s: tuple(np.add(start, s * np.subtract(end, start))), f"({text}"

    def _arc(self, start, L, backwards):
        sweep, first = self._one([-1, 1]) * self._some(0.5, 3), self._some(-math.pi, math.pi)
        radius = L / abs(sweep)
        x, y = start[0] - radius * math.cos(first), start[1] - radius * math.sin(first)
        angles = [self._say.direction(a) for a in (first, first + sweep)]
        a, b = angles[::-1] if backwards else angles

        def axis(s):
            angle = first + s * sweep
            return x + radius * math.cos(angle), y + radius * math.sin(angle)

        center, size = self._say.point((x, y)), self._say.number(radius, "m")
        return axis, f".arc({center}, {size}, ({a}, {b})"

    def _polyline(self, start, L, backwards):
        points = [start]
        angle = self._some(-math.pi, math.pi)
        for _ in range(self._integer(2, 3)):
            angle += self._some(-1.5, 1.5)
            way = L / 2 * np.array([math.cos(angle), math.sin(angle)])
            points.append(tuple(np.add(points[-1], way * self._some(0.4, 1))))
        lengths = [math.dist(p, q) for p, q in pairwise(points)]
        at = np.concatenate([[0], np.cumsum(lengths)]) / sum(lengths)

        def axis(s):
            return tuple(float(np.interp(s, at, [p[k] for p in points])) for k in (0, 1))

        return axis, f".polyline([{', '.join(self._ends(points, backwards))}]"

    def _along(self, start, L, backwards):
        """A Bézier curve."""
        points = [start]
        for _ in range(3):
            points.append(tuple(np.add(points[-1], self._polar(L / 2))))
        points[3] = tuple(np.add(start, self._polar(L)))

        def axis(s):
            b = [(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3]
            return tuple(sum(w * p[k] for w, p in zip(b, points, strict=True)) for k in (0, 1))

        lines = (
            f"lambda s, p=({', '.join(self._ends(points, backwards))}): tuple("
            "(1 - s)**3 * p[0][k] + 3 * s * (1 - s)**2 * p[1][k] + "
            "3 * s**2 * (1 - s) * p[2][k] + s**3 * p[3][k] for k in (0, 1))"
        )
        return axis, f".along({lines}"

    def _body(self, parent):
        name, say = f"body{len(self._lists['bodies'])}", self._say
        mass = self._rhoA * self._L * self._size(-0.5, 1)
        inertia = mass * self._L**2 * self._size(-1.5, -0.5)
        joint = self._one(["Rigid", "Rigid", "Revolute", "RigidLink"])
        joint = "Rigid" if self._static and joint == "Revolute" else joint
        away = tuple(self._L * self._some(-0.3, 0.3) for _ in range(2))
        if self._chance(0.3) or not self._may_hold:
            away = (0.0, 0.0)
        middle = tuple(np.add(parent.point, away))
        numbers = f"{say.point(middle)}, mass={say.number(mass, 'kg')}"
        numbers += f", inertia={say.number(inertia, 'kg m2')}"
        self._lines.append(f"{name} = ub.Body({numbers}, name='{name}')")
        self._lists["bodies"].append(name)
        center = _Anchor(f"{name}.middle", middle, name)

        def at(point):
            return _Anchor(f"{name}.at(*{say.point(point)})", point, name)

        if away == (0.0, 0.0):
            self._join("Rigid" if joint == "RigidLink" else joint, parent, center)
        else:
            self._join(joint, parent, center if joint == "RigidLink" else at(parent.point))
        self._anchors.append(center)
        if self._may_hold:
            self._anchors.append(at(tuple(np.add(middle, (self._L / 5, self._L / 7)))))

    def _kind_of_joint(self, parent):
        """Kind, and how far apart its places are."""
        kinds = ["Rigid", "Rigid", "Rigid", "Revolute"]
        if self._may_hold:
            kinds += ["Prismatic", "RigidLink", "Release"]
            kinds += [] if self._static else ["Link", "Prismatic", "Revolute"]
        kind = self._one(kinds)
        gap = self._polar(self._L * self._some(0.1, 0.3))
        return kind, gap if kind in ("Link", "RigidLink") else (0.0, 0.0)

    def _join(self, kind, a, b):
        """A joint; in statics springs hold what it leaves free."""
        name = f"joint{len(self._lists['joints'])}"
        measured = self._chance(0.4) and self._may_hold and kind in ("Rigid", "Revolute")
        more, axis = ", multipliers=True" if measured else "", self._polar(1.0)
        along, free = self._say.vector(axis), self._one(["N", "V", "M", "NM"])
        turning = self._chance(0.3)
        held = self._some(0, 1)
        first, second = (b, a) if kind == "Release" else (a, b)
        if kind == "Prismatic":
            more = f", axis={along}" + (", turning=True" if turning else "")
        if kind == "Release":
            free = free[0] if self._static else free
            more = f", free='{free}'"
        both = [first, second]
        if kind in ("Rigid", "Revolute", "Link", "RigidLink"):
            self._shuffle(both)
        self._lines.append(f"{name} = ub.{kind}({both[0]}, {both[1]}{more})")
        self._lists["joints"].append(name)
        turns = kind == "Revolute" or (kind == "Prismatic" and turning)
        turns |= kind == "Release" and "M" in free
        slides = kind == "Prismatic" or (kind == "Release" and free[0] in "NV")
        if turns and (self._static or held < 0.6):
            self._turn(a, b, name if measured else None)
        if slides and (self._static or held > 0.4):
            self._slide(a, b, along, name)

    def _shuffle(self, records):
        """Another order, where the statement wants one."""
        if self._statement.shuffled is not None:
            self._order.shuffle(records)

    def _root(self):
        """What holds the first beam at its start."""
        place, say = self._start, self._say
        x, y = self._polar(self._L * self._size(-2, -0.7))
        ground = f"ub.ground(*{say.point(place.point)})"
        far = tuple(np.add(place.point, self._polar(self._L / 3)))
        turn, along = self._some(0.1, 1.5), self._some(-math.pi, math.pi)
        ω = say.number(self._some(1, 6) / self._end, "1/s")
        way = f"lambda t: {{}} * (1.0 - math.cos({ω} * t))"
        to = tuple(float(v) for v in self._statement.turned(x, y))
        u, v = (way.format(repr(c * self._statement.unit("m"))) for c in to)
        psi = f"psi={way.format(repr(turn))}"
        supports = {
            "Clamped": f"ub.Clamped({place})",
            "PrescribedDisplacement": f"ub.PrescribedDisplacement({place}, u={u}, v={v}, psi=0)",
            "Turned": f"ub.PrescribedDisplacement({place}, u=0, v=0, {psi})",
            "Pinned": f"ub.Pinned({place})",
            "Roller": f"ub.Roller({place}, along={say.vector((math.cos(along), math.sin(along)))})",
        }
        kinds = ["Clamped", "Clamped", "Clamped"]
        if self._may_hold:
            kinds += ["PrescribedDisplacement", "Turned", "Rigid", "RigidLink"]
        if not self._static:
            kinds += ["Pinned", "Pinned", "Roller", "free", "free"]
            if self._may_hold:
                kinds += ["Revolute", "Prismatic", "Guided", "Link"]
        kind = self._held_by = self._one(kinds)
        throw = self._chance(0.6)
        linear = self._polar(self._L / self._T * self._size(-1, 0))
        angular = self._some(-1, 1) / self._T
        if kind in supports:
            self._lists["supports"].append(supports[kind])
        elif kind in ("RigidLink", "Link"):
            self._join(kind, _Anchor(f"ub.ground(*{say.point(far)})", far, "ground"), place)
        elif kind == "Guided":
            self._guide(place)
        elif kind != "free":
            self._join(kind, _Anchor(ground, place.point, "ground"), place)
        if throw and kind in ("free", "Pinned"):
            moving = list(self._lists["beams"] + self._lists["bodies"])
            self._shuffle(moving)
            linear = say.vector(linear, "m/s") if kind == "free" else "(0.0, 0.0)"
            motion = f"linear={linear}, angular={say.number(angular, '1/s')}"
            motion += f", about={say.point(place.point)}"
            self._lists["initial"].append(f"ub.Velocity([{', '.join(moving)}], {motion})")

    def _second_support(self):
        """Often the end of the last beam is held, too."""
        place, chance = self._last, self._some(0, 1)
        along = self._say.vector(self._polar(1.0))
        if self._held_by == "free" or self._lists["initial"]:
            return
        if chance < 0.25:
            self._lists["supports"].append(f"ub.Roller({place}, along={along})")
        elif chance < 0.35:
            self._lists["supports"].append(f"ub.Pinned({place})")
        elif chance < 0.45 and self._may_hold:
            self._guide(place)

    def _guide(self, place):
        """A parabola through a place; its parameter is a length."""
        angle, bend = self._some(-math.pi, math.pi), self._some(-0.5, 0.5) / self._L
        t = self._say.vector((math.cos(angle), math.sin(angle)))
        n = self._say.vector((-math.sin(angle), math.cos(angle)))
        curve = (
            f"lambda s, p={self._say.point(place.point)}, t={t}, n={n}: tuple(p[k] + s * t[k] + "
        )
        curve += f"{self._say.number(bend, '1/m')} * s**2 * n[k] for k in (0, 1))"
        self._lists["joints"].append(f"ub.Guided({place}, {curve})")

    def _load(self):
        size, say = self._F * self._size(-1.3, 0), self._say
        place, beam = self._one(self._anchors), self._one(self._lists["beams"])
        force, moment = say.vector(self._polar(size), "N"), self._some(-1, 1) * size * self._L
        line, more = self._polar(size / self._L), self._some(-0.3, 0.3) * size
        weight, time = self._polar(size / self._rhoA / self._L), self._time()
        if place.is_end and not self._elastic:
            moment = 0.0  # it would turn what lies beyond a hinge there, which nothing resists
        moment = say.number(moment, "N m")
        at = f"{place}, force={force}, moment={moment}, amplitude={time}"
        kinds = [
            f"ub.PointLoad({at})",
            f"ub.PointLoad({at})",
            f"ub.LineLoad({beam}, force={say.vector(line, 'N/m')}, "
            f"moment={say.number(more, 'N')}, amplitude={time})",
            f"ub.Gravity({say.vector(weight, 'm/s2')}, amplitude={time})",
        ]
        if place.part.startswith("beam") or place.text.endswith("middle"):
            kinds.append(f"ub.FollowerLoad({at})")
        self._lists["loads"].append(self._one(kinds))

    def _mass(self):
        mass = self._rhoA * self._L * self._size(-1, 1)
        inertia = self._one([0.0, mass * self._L**2 * self._size(-2, -1)])
        place, say = self._one([a for a in self._anchors if a.part.startswith("beam")]), self._say
        if self._chance(0.3):
            numbers = f"{say.number(mass, 'kg')}, {say.number(inertia, 'kg m2')}"
            self._lists["masses"].append(f"ub.PointMass({place}, {numbers})")

    def _damp(self):
        mass, stiffness = self._size(-3, -1) / self._T, self._size(-4, -2) * self._T
        say, damping = self._say.number, self._lists["damping"]
        viscous = say(self._size(-4, -1) * self._T, "s")
        kind = self._one(["", "", "Rayleigh", "KelvinVoigt", "both"])
        if kind in ("Rayleigh", "both") and not self._static:
            factors = f"mass={say(mass, '1/s')}, stiffness={say(stiffness, 's')}"
            damping.append(f"ub.Rayleigh({factors})")
        if kind in ("KelvinVoigt", "both"):
            beams = ", beams=[beam0]" if kind == "both" else ""
            damping.append(f"ub.KelvinVoigt({viscous}{beams})")

    def _frame(self):
        """A frame that turns, with so much centrifugal force as other loads."""
        rate, about = self._some(-1, 1) / self._T, self._polar(self._L)
        turns = self._chance(0.15)
        if turns and (self._rubs or self._name == "Static()"):
            rate, about = self._say.number(rate, "1/s"), self._say.point(about)
            self._lists["loads"].append(f"ub.RotatingFrame({rate}, about={about})")

    def _mesh(self):
        refine, degree = self._one([1, 1, 1, 2]), self._one([1, 1, 2, 3])
        lumped, degree = self._chance(0.2), degree if self._elastic else 1
        self._lines.append(f"mesh = ub.Mesh({refine}, degree={degree}, lumped={lumped})")

    def source(self):
        """The script."""
        for records in filter(None, self._lists.values()):
            self._shuffle(records)
        times = f"times = (0.0, {self._say.number(self._end, 's')})"
        scheme, dt = f"scheme = ub.{self._name}", f"dt = {self._step}"
        return "\n".join([*self._lines, *scene_call(self._lists), scheme, times, dt])
