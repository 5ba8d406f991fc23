# SPDX-License-Identifier: MIT
"""Combinations of 2 to 5 features in small models, each a script that anybody can run."""

import math
import re
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from features import FEATURES, PLAIN, Feature
from scene_statements import PARTS, made, scene_call
from user_classes import CONNECTOR_LAWS, LAWS, SOFTENING

STATICS = ("Static()", "EnergyMomentumStatic()", "Static()", "EnergyMomentumStatic(0.7)")
DYNAMICS = (
    "EnergyMomentum()", "EnergyMomentum(0.05, 0.1)", "EnergyMomentumDecaying()",
    "EnergyMomentumPrinted()", "Newmark()", "Newmark(0.6, 0.36)", "GeneralizedAlpha(0.8)",
    "Weighted(0.55)", "EnergyMomentum(order=4)",
)  # fmt: skip
SCHEMES = (*STATICS, *DYNAMICS)

EXACT = ("ub.EnergyMomentumStatic", "ub.EnergyMomentum(", "ub.EnergyMomentumDecaying", "Weighted")

HOLDING = (
    "Link", "Prismatic", "multipliers=", "Guided", "PrescribedMotion", "Release", "Coulomb",
    "Brake", "RigidPlastic", "hinges=", "PrescribedDisplacement", "Roller", "Body",
)  # fmt: skip
"""Constraints, at which accelerations of undamped Newmark oscillate."""

FOURTH = "EnergyMomentum(order=4)"

ROUGH = (
    "damper", "force_law", "connector_law", "cushion", "moving_load", "virtual_work", "rayleigh",
    "kelvin_voigt",
)  # fmt: skip
"""Features that are elastic but dissipate or have kinks, so that fourth order refuses them."""

BASES = ("cantilever", "chain", "portal")

COLUMN = ("shape", "pinned", "degree", "refined", "potential", "newton", "propped", "side_spring")
"""Features that leave a straight column straight under a load along it; every 16th seed is one."""

RANDOM = re.compile(r"<(\S+) (\S+?)(?: (\S+))?>|\[\[(.*?)\]\](?!\])|TIME")
"""Random parts of texts: limits and format of a number, alternatives, a function of time."""

STIFF = "EA=1e6, GA=1e6, EI=100.0, rhoA=1.0, rhoI=0.01"

HEAD = """import math
import ufl_beam as ub
import ufl_beam.structures as st
from user_classes import *
"""


@dataclass
class Draft:
    """A model while features write into it; `last`: name of the beam whose end is the `tip`."""

    random: np.random.Generator
    static: bool
    column: bool = False
    sections: dict = field(default_factory=dict)
    last: str = "b0"
    joint: str = "ub.Rigid({a}, {b})"
    root: str | None = "ub.Clamped({place})"
    step: str = ""
    mesh: str = "ub.Mesh()"
    newton: str = "ub.Newton()"
    gap: bool = False
    end: float = 0.15

    def __post_init__(self):
        for name in ("lines", "works", *PARTS):
            setattr(self, name, [])

    def some(self, low, high):
        return float(self.random.uniform(low, high))

    def one(self, choices):
        return choices[int(self.random.integers(len(choices)))]

    def text(self, row):
        """A text with its random parts drawn."""
        return RANDOM.sub(self._draw, row.replace("TIP", "LAST.end").replace("LAST", self.last))

    def one_text(self, *rows):
        """One of some texts; parts of the others are drawn, too."""
        return self.one([self.text(row) for row in rows])

    def _draw(self, part):
        low, high, digits, choices = part.groups()
        if choices is not None:
            return self.one(choices.split("|"))
        return format(self.some(float(low), float(high)), digits or ".4g") if low else self.time()

    def time(self):
        """A function of time, at most about one large."""
        t = self.end
        kinds = [
            f"ub.ramp({t * self.some(0.2, 1):.4g})",
            f"ub.Table([0.0, {t / 3:.4g}, {t:.4g}], [0.0, {self.some(-1, 1):.3f}, 1.0])",
            f"lambda t: math.sin({self.some(2, 6) / t:.4g} * t)",
        ]
        return self.one(kinds if self.static else [*kinds, "lambda t: 1.0"])

    @property
    def tip(self):
        """End of the last beam; m."""
        return self.beams[int(self.last[1:])]["b"]

    def beam(self, a, b, cells):
        self.beams.append({"a": a, "b": b, "cells": cells, "kind": "", "hinges": ""})
        self.last = f"b{len(self.beams) - 1}"

    def need_beams(self, number, apart=False):
        self.gap = apart
        while len(self.beams) < number:
            x, y = self.beams[-1]["b"]
            self.beam((x, y), (x + 0.8, y - 0.5), 2)

    def _beams(self):
        for i, beam in enumerate(self.beams):
            a, b = beam["a"], beam["b"]
            if i == 1 and self.gap:
                a = (a[0] + 0.1, a[1] + 0.05)
            more = f", hinges={beam['hinges']}" if beam["hinges"] else ""
            yield f"section{i} = {self.sections.get(i, f'ub.Section({PLAIN})')}"
            yield (
                f"b{i} = ub.Beam{_axis(beam['kind'], a, b)}, section{i}, cells={beam['cells']}, "
                f"name='b{i}'{more})"
            )

    def source(self, scheme, title):
        """The script."""
        lines = [f"# {title}", HEAD, *self._beams(), *self.bodies, *self.lines]
        beams, joints = [f"b{i}" for i in range(len(self.beams))], list(self.joints)
        bodies, supports = ["body"] * len(self.bodies), list(self.supports)
        if len(beams) > 1:
            lines.append(f"joint = {self.joint.format(a='b0.end', b='b1.start')}")
            joints.append("joint")
            joints += [f"ub.Rigid({a}.end, {b}.start)" for a, b in pairwise(beams[1:])]
        if self.root is not None:
            rest = {"u": "v=0, psi=0", "v": "u=0, psi=0", "psi": "u=0, v=0"}
            moves = re.search(r"\}, (u|v|psi)=", self.root)
            text = self.root.format(place="b0.start", rest=rest[moves[1]] if moves else "")
            lines.append(f"root = {text}")
            supports.insert(0, "root")
        moving = ", ".join(beams + bodies)
        parts = {
            "beams": beams, "joints": joints, "supports": supports, "loads": self.loads,
            "masses": self.masses, "initial": [x.format(moving=moving) for x in self.initial],
            "damping": self.damping, "bodies": bodies, "connectors": self.connectors,
            "works": self.works,
        }  # fmt: skip
        text = "\n".join([*lines, *scene_call(parts)])
        if scheme == "Newmark()" and any(word in text for word in HOLDING):
            scheme = "Newmark(0.6, 0.36)"
        ours = "" if scheme.startswith("Weighted") else "ub."
        return (
            f"{text}\nscheme = {ours}{scheme}\nt, dt = (0.0, {self.end}), {self.step}\n"
            f"mesh, newton = {self.mesh}, {self.newton}\n"
        )


def _axis(kind, a, b):
    """Beginning of a call that makes a beam from a to b."""
    (ax, ay), (bx, by) = a, b
    mx, my = (ax + bx) / 2, (ay + by) / 2
    if kind == "polyline":
        return f".polyline([{a}, ({mx - 0.1:.4g}, {my + 0.2:.4g}), {b}]"
    if kind == "along":
        curve = f"({ax} + s * {bx - ax:.6g}, {ay} + s * {by - ay:.6g} + 0.8 * s * (1 - s))"
        return f".along(lambda s: {curve}"
    if kind == "arc":  # about a centre at a distance of the chord from its middle
        cx, cy = mx + (by - ay), my - (bx - ax)
        first, last = math.atan2(ay - cy, ax - cx), math.atan2(by - cy, bx - cx)
        last += 2 * math.pi * round((first - last) / (2 * math.pi))
        return f".arc(({cx}, {cy}), {math.dist((cx, cy), a)}, ({first}, {last})"
    return f"({a}, {b}"


@dataclass(frozen=True)
class Combination:
    """A drawn model: a script that makes `scene`, `scheme`, `t`, `dt`, `mesh` and `newton`."""

    seed: int
    base: str
    features: tuple[Feature, ...]
    source: str

    @property
    def title(self):
        return self.source.splitlines()[0][2:]

    def make(self, source=None):
        """The names that the script defines, each time new ones: some remember what they saw."""
        return made(source or self.source)

    @cached_property
    def elastic(self):
        """Whether nothing but elasticity, inertia and viscosity acts."""
        return all(feature.elastic for feature in self.features)

    def has(self, *words):
        """Whether one of the words is in the script."""
        return any(word in self.source for word in words)

    @property
    def static(self):
        return self.has("scheme = ub.Static(", "scheme = ub.EnergyMomentumStatic(")

    @property
    def has_exact_ledger(self):
        """Whether works of the scheme are increments of energy, however long its steps are."""
        return self.has(*(f"scheme = {one}" for one in EXACT))

    @property
    def names(self):
        """Public names that the script uses, also by its classes of a user."""
        found = set(re.findall(r"\b(?:ub|st)\.(?:extend\.|distributions\.)?(\w+)", self.source))
        for words, used in USED.items():
            found |= set(used.split()) if self.has(*words) else set()
        return found


USED = {
    ("ub.ground",): "ground",
    LAWS: "law_functions MaterialLaw",
    SOFTENING: "law_functions SofteningLaw",
    CONNECTOR_LAWS: "ConnectorLaw",
    ("ub.Effect",): "Equations Statement",
    ("Weighted",): "Coefficients EnergyMomentumBase MidpointDynamics Scheme DynamicScheme Step",
}
"""Public names that are used by others, which are words of scripts."""


def draw(seed):
    """The combination of a seed: first feature and scheme come in turn, others at random."""
    random = np.random.default_rng([2026, seed])
    first = FEATURES[seed % len(FEATURES)]
    base = BASES[int(random.integers(len(BASES)))]
    if seed % 16 == 7:
        base = "column"
        first = FEATURES[[one.name for one in FEATURES].index(COLUMN[seed // 16 % len(COLUMN)])]
    if {"tip", "free"} & set(first.slots):
        base = "chain" if base == "portal" else base
    scheme = SCHEMES[(seed + seed // len(FEATURES)) % len(SCHEMES)]
    if not _allows(first, scheme, base):
        scheme = str(random.choice([s for s in SCHEMES if _allows(first, s, base)]))
    draft = Draft(random, static=scheme in STATICS, column=base == "column")
    taken = {"tip", "free"} if base == "portal" else set()
    _build(draft, base)
    number, chosen = int(random.integers(2, 6)), []
    for one in (first, *(FEATURES[i] for i in random.permutation(len(FEATURES)))):
        free = one not in chosen and not taken & set(one.slots)
        if len(chosen) < number and free and _allows(one, scheme, base):
            chosen.append(one)
            taken |= set(one.slots)
    for one in chosen:
        one.write(draft, one.name)
    steps = int(random.integers(8, 25))
    draft.step = draft.step or f"{draft.end / steps:.6g}"
    words = ", ".join(one.name for one in chosen)
    title = f"combination {seed}: {base} with {words}; {scheme}"
    return Combination(seed, base, tuple(chosen), draft.source(scheme, title))


def _allows(one, scheme, base):
    if base == "column":
        return one.name in COLUMN and scheme in STATICS
    if scheme == FOURTH and (not one.elastic or one.name in ROUGH):
        return False
    if scheme.startswith("EnergyMomentumDecaying") and one.name == "adaptive":
        return False
    static, at_end = scheme in STATICS, scheme.startswith(("Newmark", "Generalized"))
    return one.allows(static, at_end)


def _build(d, base):
    """Beams and the first load."""
    if base == "column":
        d.beam((0.0, 0.0), (1.0, 0.0), 6)
        d.loads.append("ub.PointLoad(b0.end, force=(-1.0, 0.0), amplitude=lambda t: t)")
        d.sections[0] = f"ub.Section({STIFF})"
        return
    if base == "portal":
        corners = (0.0, 0.0), (0.1, 1.0), (1.0, 1.1), (1.1, 0.0)
        for (a, b), cells in zip(pairwise(corners), (4, 2, 3), strict=True):
            d.beam(a, b, cells)
        d.supports.append("ub.Pinned(b2.end)")
        d.last = "b1"
    else:
        d.beam((0.0, 0.0), (1.0, 0.2), d.one([2, 4]))
    if base == "chain":
        d.beam((1.0, 0.2), (1.8, -0.3), d.one([2, 3]))
    force = "force=(<-25 25 .3f>, <-25 25 .3f>)"
    d.loads.append(d.text(f"ub.PointLoad(TIP, {force}, amplitude=TIME)"))
