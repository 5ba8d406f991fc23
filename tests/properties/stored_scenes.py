# SPDX-License-Identifier: MIT
"""Small random scenes whose numbers are stored in ``tests/data/effects``: runs and comparisons.

:mod:`stored_effects` has a function for each effect.  As a script,
``python3 tests/properties/stored_scenes.py [EFFECT ...]`` computes and writes their numbers.
"""

import json
import math
import sys
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from mpi4py import MPI

import numpy as np

import ufl_beam as ub

FOLDER = Path(__file__).parents[1] / "data" / "effects"

MESHES = ub.Mesh(), ub.Mesh(), ub.Mesh(), ub.Mesh(degree=2), ub.Mesh(degree=3, lumped=True)
"""Of the scenes of each effect."""

SCENES = len(MESHES)

EXACT = ub.Newton(rtol=1e-12, max_iterations=60)
"""Iterations go on nearly to round-off, so that numbers do not depend on their way."""

LARGER = 1.2
"""Factor on a number of an effect in the scene that shows that this number acts."""

STATIC = ub.Static, ub.EnergyMomentumStatic


@dataclass
class Draft:
    """A scene while an effect writes into it; number `changed` of the effect is another one.

    Attributes:
        control: Control of a path, instead of a run in time.
        further: Records of the effect that the scene has in functions only.
    """

    random: np.random.Generator
    scheme: ub.extend.Scheme
    changed: int = -1
    count: int = 0
    end: float = 0.2
    dt: float | ub.Adaptive = 0.008
    mesh: ub.Mesh = MESHES[0]
    parts: dict = field(default_factory=dict)
    control: object = None
    further: list = field(default_factory=list)

    @property
    def static(self):
        return isinstance(self.scheme, STATIC)

    def some(self, low, high):
        """A random number; it is rounded, so that it can be read."""
        return float(f"{self.random.uniform(low, high):.4g}")

    def sign(self):
        return float(self.random.choice([-1.0, 1.0]))

    def one(self, *choices):
        return choices[int(self.random.integers(len(choices)))]

    def choose(self, *functions):
        """The value of one of some functions; numbers of the others are not drawn."""
        return self.one(*functions)()

    def acts(self, low, high):
        """A random number of the effect; it is larger in the scene that shows that it acts."""
        return self.some(low, high) * self.instead(1.0, LARGER)

    def instead(self, effect, other):
        """The effect, or something else in the scene that shows that it acts."""
        self.count += 1
        return other if self.count - 1 == self.changed else effect

    def either_sign(self, low, high):
        return self.sign() * self.acts(low, high)

    def add(self, kind, *records):
        """Add records to a field of the scene; the last one."""
        self.parts.setdefault(kind, []).extend(records)
        return records[-1]

    def wave(self, low=3.0, high=6.0, power=1):
        """A function of time that begins with zero and changes its sign or its slope."""
        ω = self.some(low, high) / self.end
        return lambda t: math.sin(ω * t) ** power

    def swell(self):
        """A function of time that begins with zero and with zero slope, and comes back."""
        ω = self.some(4.0, 7.0) / self.end
        return lambda t: (1.0 - math.cos(ω * t)) / 2

    def run(self):
        """Scene and solution."""
        scene = ub.Scene(**self.parts)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ub.ModelWarning)
            if self.control is not None:
                return scene, ub.follow(
                    scene, self.control, steps=25, mesh=self.mesh, newton=EXACT, comm=MPI.COMM_SELF
                )
            return scene, ub.simulate(
                scene, self.scheme, t=(0.0, self.end), dt=self.dt, mesh=self.mesh, newton=EXACT,
                comm=MPI.COMM_SELF,
            )  # fmt: skip


@dataclass(frozen=True)
class Effect:
    """An effect: its classes, a function that writes scenes, other seeds of some scenes."""

    name: str
    kinds: tuple[type, ...]
    write: Callable[[Draft], None]
    schemes: tuple[ub.extend.Scheme, ...]
    seeds: dict[int, int] = field(default_factory=dict)

    def draft(self, scene, changed=-1):
        """The scene of this number, in which one number of the effect may be changed."""
        random = np.random.default_rng(
            [zlib.crc32(self.name.encode()), self.seeds.get(scene, scene)]
        )
        scheme = self.schemes[scene % len(self.schemes)]
        draft = Draft(random, scheme, changed, mesh=MESHES[scene])
        self.write(draft)
        return draft


EFFECTS: dict[str, Effect] = {}

ANY = ub.EnergyMomentum(), ub.Static(), ub.GeneralizedAlpha(0.8)
DYNAMIC = ub.EnergyMomentum(), ub.EnergyMomentumDecaying(0.6), ub.GeneralizedAlpha(0.7)
OVER_STEP = ub.EnergyMomentum(), ub.EnergyMomentumDecaying(0.6), ub.EnergyMomentum(0.05, 0.1)
OVER_ANY_STEP = ub.EnergyMomentum(), ub.EnergyMomentumStatic(), ub.EnergyMomentumDecaying(0.6)
"""Schemes of scenes, in turn; not all effects allow statics, or schemes with forces at the end."""


def effects(schemes=ANY, seeds=None, **kinds):
    """Add the effects that a function of a draft and their name writes; `kinds`: their classes."""

    def add(function):
        for name, of in kinds.items():
            write = partial(function, name=name)
            of = of if isinstance(of, tuple) else (of,)
            EFFECTS[name] = Effect(name, of, write, schemes, seeds or {})
        return function

    return add


# -- numbers -----------------------------------------------------------------------------------


def numbers(scene, solution, rows=None):
    """Numbers of a run at three times, or in `rows`; the first word of a name is their kind."""
    n = len(solution) - 1
    rows = [n // 3, 2 * n // 3, n] if rows is None else rows
    found = {"count steps": [n], "time": solution.times[rows]}
    places = {
        f"{beam.name} {k}/{beam.cells}": beam.at(k / beam.cells)
        for beam in scene.beams
        for k in range(beam.cells + 1)
    }
    for name, place in (places | {body.name: body.middle for body in scene.bodies}).items():
        found[f"motion {name}"] = solution.displacement(place)[rows]
        if len(solution.v):
            found[f"velocity {name}"] = solution.velocity(place)[-1]
    for beam in scene.beams:
        forces = [np.array(solution.diagram(beam, row, points=2)[1:])[:, [0, -1]] for row in rows]
        found[f"force N V M at the ends of {beam.name}"] = forces
    for i, support in enumerate(scene.supports):
        found[f"force of support {i}"] = solution.reaction(support)[rows]
    for i, joint in enumerate(scene.joints):
        found[f"force of joint {i}"] = solution.joint(joint).force[rows] if joint.holders else []
    for i, connector in enumerate((*scene.connectors, *scene.hinges)):
        history = solution.connector(connector)
        found[f"motion of connector {i}"] = history.motion[rows]
        found[f"force of connector {i}"] = history.force[rows]
    energy = solution.energy
    for kind in ("state", "supplied", "lost"):
        for name, values in getattr(energy, kind).items():
            found[f"energy {kind}: {name}"] = values[rows]
    return {name: np.ravel(values) for name, values in found.items() if np.size(values)}


def differences(one, other):
    """Largest difference of numbers of each kind, as a part of the largest number of the kind."""
    assert list(one) == list(other)
    sizes = {"count": 1.0}
    for name, values in other.items():
        kind = name.split()[0]
        sizes[kind] = max(sizes.get(kind, 0.0), float(np.abs(values).max()))
    return {
        name: float(np.abs(np.subtract(one[name], values)).max()) / (sizes[name.split()[0]] or 1.0)
        for name, values in other.items()
    }


def stored(name):
    """What the file of an effect says about each scene."""
    return json.loads((FOLDER / f"{name}.json").read_text("utf-8"))


def compute(one):
    """Numbers of the scenes of an effect, and how much each number of the effect changes them."""
    scenes = []
    for seed in range(SCENES):
        draft = one.draft(seed)
        found, acts = numbers(*draft.run()), []
        for k in range(draft.count):
            changed = numbers(*one.draft(seed, k).run())
            same = [n for n in found if n in changed and len(found[n]) == len(changed[n])]
            pair = ({name: of[name] for name in same} for of in (found, changed))
            acts.append(max(differences(*pair).values()))
        scenes.append({"acts": acts, "numbers": found})
    return scenes


def write(name, scenes):
    """Write a file with each list of numbers in one line."""
    texts = []
    for scene in scenes:
        acts = ", ".join(f"{x:.1e}" for x in scene["acts"])
        lists = {key: ", ".join(f"{x:.13g}" for x in of) for key, of in scene["numbers"].items()}
        lines = ",\n".join(f'  "{key}": [{values}]' for key, values in lists.items())
        texts.append(f'{{"acts": [{acts}],\n "numbers": {{\n{lines}}}}}')
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.json").write_text("[" + ",\n".join(texts) + "]\n", "utf-8")


def main(names):
    """Compute and write the numbers of some effects, by default of those that have none."""
    import stored_effects  # noqa: F401 - adds the effects; it imports this module

    missing = [name for name in EFFECTS if not (FOLDER / f"{name}.json").exists()]
    for name in names or missing:
        scenes = compute(EFFECTS[name])
        write(name, scenes)
        print(name, *(min(scene["acts"], default=math.nan) for scene in scenes), flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    sys.modules["stored_scenes"] = sys.modules["__main__"]
    main(sys.argv[1:])
