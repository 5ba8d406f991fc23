# SPDX-License-Identifier: MIT
"""Random machines of everything that a scene may have, each a script that anybody can run.

Sizes are drawn over many decades, as parts of the length of the first beam, EI/L² and its period;
kinds of laws, joints and schemes from short lists, for each compiles forms of its own.
"""

import math

import numpy as np
from random_laws import IMPORTS, Draws
from scene_statements import PARTS, scene_call

STEPS = 10
"""Steps of a run."""

SPOTS = (0.0, 0.5, 1.0)
"""Where things are attached to beams."""


def script(seed):
    """Python source of a random machine."""
    return "\n".join(_Writer(seed).lines) + "\n"


class _Writer(Draws):
    """Draws a machine and writes it down."""

    def __init__(self, seed):
        self._random = np.random.default_rng(seed)
        self.lines = [f"# seed {seed}", *IMPORTS]
        self._static = self._chance(0.3)
        self._parts, self._anchors = {name: [] for name in PARTS}, []
        self._draw_scales((-2, 2), (0.7, 3), (-2, 8), (-3, 3))
        self._dt = self._T * self._size(-3, 0)
        self._free = not self._static and self._chance(0.2)
        for i in range(self._integer(1, 4)):
            self._beam(i)
        for i in range(self._integer(0, 2)):
            self._body(i)
        self._support()
        for _ in range(self._integer(0, 2)):
            self._connector()
        for _ in range(self._integer(1, 3)):
            self._load()
        if self._chance(0.3) and not self._static:
            self._damp()
        self._end()

    def _vector(self, size):
        return "({:.6g}, {:.6g})".format(*self._polar(size))

    def _add(self, part, text):
        self._parts[part].append(text)

    def _time(self):
        """A time function."""
        t = self._dt * STEPS
        kinds = [
            f"ub.ramp({t * self._some(0.1, 1):.6g})",
            f"ub.Table([0, {t / 2:.6g}, {t:.6g}], [0, {self._some(-1, 1):.3g}, 1])",
            f"lambda t: math.sin({self._some(1, 10) / t:.6g} * t)",
        ]
        if not self._static:
            kinds += ["lambda t: 1.0", f"lambda t: float(t < {t / 3:.6g})"]
        return self._one(kinds)

    def _hardening(self, stiffness, limit):
        """A law of a resultant, a fibre or a spring; sizes of stiffness and force."""
        more = [f"yield_limit={limit}"]
        for kind in ("isotropic", "kinematic"):
            if self._chance(0.5):
                more.append(f"{kind}={stiffness * self._size(-4, 0):.6g}")
        time = self._one([0.0, math.inf, self._T * self._size(-6, 6)])
        viscous = self._one(["", "Perzyna", "DuvautLions"])
        if viscous:
            size = time * stiffness if viscous == "Perzyna" else time
            more.append(f"viscosity=ub.{viscous}({_number(size)})")
        return f"ub.ElastoPlastic({', '.join(more)})"

    def _softening(self, limit):
        """A law of a hinge; an energy from brittle to ductile."""
        kind = self._one(["Softening", "LinearSoftening"])
        energy = self._M * self._size(-4, 3)
        limit = self._one([0.0, limit, limit, limit, math.inf])
        return f"ub.{kind}(limit={_number(limit)}, fracture_energy={energy:.6g})"

    def _section(self, i):
        kind = self._one(["elastic", "elastic", "resultants", "hinge", "both", "fibres"])
        stiff = self._one([1.0, 1.0, self._size(-3, 6)])
        EA, EI, rhoA = self._EA * stiff, self._EI * stiff, self._rhoA * self._size(-1, 1)
        limit = self._M * self._size(-3, 1) * stiff
        if kind == "fibres":
            text = self._of_fibres(i, EA, EI, rhoA, limit)
        else:
            text = self._of_resultants(kind, EA, EI, rhoA, limit)
        self.lines.append(f"section{i} = ub.Section{text}")
        return kind, limit

    def _of_fibres(self, i, EA, EI, rhoA, limit):
        h = math.sqrt(12 * EI / EA)
        E, strength = EA / h**2, limit / h**3
        drawn = [
            _number(strength),
            f"ub.distributions.Normal({strength:.6g}, {strength / 5:.6g}, seed={i})",
            f"ub.distributions.Lognormal({strength:.6g}, {strength / 3:.6g}, seed={i})",
            f"ub.distributions.Weibull({strength:.6g}, 3.0, seed={i})",
        ]
        law, crack = self._hardening(E, self._one(drawn)), ""
        if self._chance(0.3):
            energy = strength * h * self._size(-3, 2)
            numbers = f"limit={3 * strength:.6g}, fracture_energy={energy:.6g}"
            crack = f", softening=ub.Softening({numbers})"
        shape = self._one([f"rectangle(b={h:.6g}, h={h:.6g}", f"circle(d={h:.6g}"])
        return (
            f".{shape}, E={E:.6g}, nu=0.3, rho={rhoA / h**2:.6g}, "
            f"fibres=ub.Fibres({law}, number={self._one([4, 8])}{crack}))"
        )

    def _of_resultants(self, kind, EA, EI, rhoA, limit):
        rhoI = self._one([0.0, rhoA * EI / EA, rhoA * EI / EA])
        more = [f"EA={EA:.6g}, GA={EA * self._some(0.1, 0.5):.6g}, EI={EI:.6g}"]
        more.append(f"rhoA={rhoA:.6g}, rhoI={rhoI:.6g}")
        if kind in ("resultants", "both"):
            more.append(f"bending={self._hardening(EI, _number(limit))}")
            force = limit / self._L
            for name, size in (("axial", force * self._slender), ("shear", force)):
                if self._chance(0.3):
                    more.append(f"{name}={self._hardening(EA, _number(size))}")
        if kind in ("hinge", "both") and self._chance(0.7):
            more.append(f"hinge={self._softening(limit * self._size(-1, 1))}")
        return f"({', '.join(more)})"

    def _beam(self, i):
        kind, limit = self._section(i)
        name = f"beam{i}"
        parent = self._one(self._anchors) if i else None
        kinds = ["Rigid", "Rigid", "Revolute", "RigidLink"]
        if not self._static:
            kinds[3:] = ["Prismatic", "RigidLink", "Link", "Release"]
        joint = self._one(kinds)
        apart = joint in ("RigidLink", "Link")
        start = f"{parent}.point" if i else "(0.0, 0.0)"
        if i and apart:
            start = f"tuple(p + d for p, d in zip({start}, {self._vector(self._L / 4)}))"
        self.lines.append(f"x{i}, y{i} = {start}")
        length, angle = self._L * self._some(0.5, 2), self._some(-math.pi, math.pi)
        dx, dy = length * math.cos(angle), length * math.sin(angle)
        cells = self._one([1, 2, 4, 8])
        more = f"section{i}, cells={cells}, name='{name}'"
        if kind == "hinge" and self._chance(0.5):
            more += f", hinges={{{self._one(SPOTS)}: {self._softening(limit)}}}"
        end = f"(x{i} + {dx:.6g}, y{i} + {dy:.6g})"
        self.lines.append(f"{name} = ub.Beam((x{i}, y{i}), {end}, {more})")
        if i:
            self._join(joint, parent, f"{name}.at(0.0)", beam=name)
        self._add("beams", name)
        self._anchors += [f"{name}.at({s})" for s in SPOTS]

    def _body(self, i):
        name, parent = f"body{i}", self._one(self._anchors)
        mass = self._rhoA * self._L * self._size(-3, 3)
        self.lines.append(f"bx{i}, by{i} = {parent}.point")
        dx, dy = (self._L * self._some(-0.3, 0.3) for _ in range(2))
        center = f"(bx{i} + {dx:.6g}, by{i} + {dy:.6g})" if self._chance(0.7) else f"(bx{i}, by{i})"
        inertia = mass * self._L**2 * self._size(-3, 0)
        self.lines.append(
            f"{name} = ub.Body({center}, mass={mass:.6g}, inertia={inertia:.6g}, name='{name}')"
        )
        joint = "Rigid" if self._static else self._one(["Rigid", "Rigid", "Revolute"])
        self._join(joint, parent, f"{name}.at(bx{i}, by{i})")
        self._add("bodies", name)
        self._anchors.append(f"{name}.at(bx{i} + {self._L / 5:.6g}, by{i})")

    def _join(self, kind, a, b, beam=None):
        """A joint; in statics, what turns is held by a connector."""
        more, name = "", f"joint{len(self._parts['joints'])}"
        if kind in ("Rigid", "Revolute") and (self._chance(0.3) or self._static):
            more = ", multipliers=True"
        if kind == "Prismatic":
            more = f", axis={self._vector(1.0)}"
        if kind == "Release":
            a, b = f"{beam}.at(0.0)", a
            more = f", free='{self._one(['N', 'V', 'M', 'NM'])}'"
        self.lines.append(f"{name} = ub.{kind}({a}, {b}{more})")
        self._add("joints", name)
        if kind == "Revolute" and (self._static or (more and self._chance(0.7))):
            self._turn(a, b, name)

    def _turn(self, a, b, joint):
        size = self._M * self._size(-2, 1)
        laws = [self._spring(self._M, size), f"ub.PrescribedMotion({self._swing(1.0)})"]
        if not self._static:
            laws += [
                *self._resisting(self._M, 1.0, size),
                f"ub.Coulomb({size:.6g})",
                f"ub.Coulomb({size:.6g}, coefficient={self._L * 0.1:.6g}, joint={joint})",
            ]
        self._add("connectors", f"ub.Turn({a}, {b}, {self._one(laws)})")

    def _connector(self):
        a, b = self._one(self._anchors), self._one(self._anchors)
        if self._chance(0.3) and not self._free:
            a = f"ub.ground(*({b}.point[0] + {self._L:.6g}, {b}.point[1]))"
        if a.split(".")[0] == b.split(".")[0]:
            return
        stiffness, force = self._F / self._L, self._F * self._size(-2, 1)
        laws = [self._spring(stiffness, force), *self._resisting(stiffness, self._L, force)]
        if not self._static:
            laws.append(f"ub.Controller(lambda simulation: -{force:.6g} * math.sin(simulation.t))")
        law = self._one(laws)
        slide = f"ub.Slide({a}, {b}, {law}, axis={self._vector(1.0)})"
        self._add("connectors", self._one([f"ub.Stretch({a}, {b}, {law})", slide]))

    def _spring(self, stiffness, force):
        k = stiffness * self._size(-3, 5)
        more = ""
        if self._chance(0.3):
            more += f", law={self._hardening(k, _number(force))}"
        elif self._chance(0.3):
            more += f", softening=ub.Softening({force:.6g}, {force**2 / k * self._size(-1, 3):.6g})"
        return f"ub.Spring({k:.6g}{more})"

    def _resisting(self, stiffness, length, force):
        """Laws that resist, or push, whatever the motion is."""
        k, way, time = stiffness * self._size(-2, 3), length * self._some(0, 0.1), self._T
        c = stiffness * time * self._size(-3, 3)
        return [
            f"ub.Stop({k:.6g}, low={-way:.6g}, high={way / 2:.6g})",
            f"ub.Damper({c:.6g})",
            f"ub.PrescribedForce(lambda t: {force:.6g} * math.sin({1 / time:.6g} * t))",
            f"ub.ForceLaw(lambda e, rate: {k:.6g} * (e + {1 / length**2:.6g} * e**3) + "
            f"{c:.6g} * rate)",
        ]

    def _swing(self, size):
        """A motion that begins at rest."""
        ω = self._some(1, 6) / (self._dt * STEPS)
        return f"lambda t: {size * self._size(-3, 0):.6g} * (1 - math.cos({ω:.6g} * t))"

    def _support(self):
        if self._free:
            if self._chance(0.7):
                moving = ", ".join(self._parts["beams"] + self._parts["bodies"])
                linear = self._vector(self._L / self._T)
                angular = f"{self._some(-3, 3) / self._T:.6g}, about=(0.0, 0.0)"
                self._add("initial", f"ub.Velocity([{moving}], linear={linear}, angular={angular})")
            return
        root = "beam0.at(0.0)"
        moved = [
            f"ub.PrescribedDisplacement({root}, u={self._swing(self._L)}, v=0, psi=0)",
            f"ub.PrescribedDisplacement({root}, u=0, v=0, psi={self._swing(3.0)})",
        ]
        kinds = [f"ub.Clamped({root})", f"ub.Clamped({root})", *moved]
        if not self._static:
            kinds += [f"ub.Pinned({root})", f"ub.Roller({root}, along={self._vector(1.0)})"]
        self._add("supports", self._one(kinds))
        last = f"{self._parts['beams'][-1]}.at(1.0)"
        if self._chance(0.3):
            roller = f"ub.Roller({last}, along={self._vector(1.0)})"
            self._add("supports", self._one([roller, f"ub.Pinned({last})"]))
        elif self._chance(0.15):
            curve = f"lambda s, p={last}.point, d={self._vector(self._L)}: "
            curve += "(p[0] + s * d[0], p[1] + s * d[1] + s**2 * d[0])"
            self._add("joints", f"ub.Guided({last}, {curve})")

    def _load(self):
        size = self._F * self._size(-4, 0)
        place = self._one(self._anchors)
        force, moment, time = self._vector(size), size * self._L * self._some(-1, 1), self._time()
        kinds = [f"ub.PointLoad({place}, force={force}, moment={moment:.6g}, amplitude={time})"]
        if place.startswith("beam"):
            kinds.append(f"ub.FollowerLoad({place}, force={force}, amplitude={time})")
        line = self._vector(size / self._L)
        beam = self._one(self._parts["beams"])
        kinds.append(f"ub.LineLoad({beam}, force={line}, amplitude={time})")
        kinds.append(f"ub.Gravity({self._vector(size / self._rhoA / self._L)}, amplitude={time})")
        self._add("loads", self._one(kinds))
        if self._chance(0.3):
            mass = self._rhoA * self._L * self._size(-3, 3)
            inertia = self._one([0.0, mass * self._L**2 * self._size(-3, 0)])
            place = f"{self._one(self._parts['beams'])}.at({self._one(SPOTS)})"
            self._add("masses", f"ub.PointMass({place}, {mass:.6g}, {inertia:.6g})")

    def _damp(self):
        if self._chance(0.5):
            mass, stiffness = self._size(-3, 0) / self._T, self._size(-4, 0) * self._T
            self._add("damping", f"ub.Rayleigh(mass={mass:.6g}, stiffness={stiffness:.6g})")
        else:
            self._add("damping", f"ub.KelvinVoigt({self._size(-4, 1) * self._T:.6g})")

    def _end(self):
        theta = "EnergyMomentumStatic()", "EnergyMomentumStatic(0.5)"
        schemes = ["Static()", "Static()", *theta]
        if not self._static:
            a, b = self._some(0.01, 0.5), self._some(0, 0.5)
            schemes = ["EnergyMomentum()", "EnergyMomentum()", f"EnergyMomentum({a:.3g}, {b:.3g})"]
        self.lines += scene_call(self._parts)
        self.lines += [f"scheme = ub.{self._one(schemes)}", f"dt = {self._dt:.6g}"]


def _number(x):
    return "math.inf" if x == math.inf else f"{x:.6g}"


def round_off(solution):
    """Energy that the last digits of strains make, of positions over a cell; J."""
    scene = solution.scene
    last = np.finfo(float).eps * scene.size
    least = 0.0
    for beam in scene.beams:
        length = math.dist(*beam.ends)
        least += beam.section.EA * last**2 * beam.cells**2 / length
    most = float(np.max(solution.energy.total))
    # In some steps, over some nodes
    return 50 * (least + 2 * math.sqrt(least * most))
