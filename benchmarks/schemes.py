# SPDX-License-Identifier: MIT
"""Errors of the time schemes at equal steps, into the tables of ``docs/schemes.md``.

Run by ``make schemes``.  The flying beam of Simo and Vu-Quoc with 8 cells: thrown by a force that
stops at once, by one of the same impulse that rises and falls smoothly, and a stiffer one with
little rotary inertia.  Errors are those of both ends after 5 s, the larger one, against a run of
the same mesh with much smaller steps.

The last table is one of statics: a cantilever that yields to and fro under a force.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np

import ufl_beam as ub

PAGE = Path(__file__).parents[1] / "docs" / "schemes.md"
SCHEMES = [
    ub.EnergyMomentum(),
    ub.EnergyMomentum(order=4),
    ub.EnergyMomentum(0.05, 0.05),
    ub.EnergyMomentumDecaying(0.8),
    ub.EnergyMomentumDecaying(0.5),
    ub.EnergyMomentumPrinted(),
    ub.Newmark(),
    ub.GeneralizedAlpha(0.8),
    ub.GeneralizedAlpha(0.0),
]
STEPS = [0.1, 0.05, 0.025, 0.0125]
END, RELEASE, FINE = 5.0, 2.5, 1 / 3200


def sudden(t):
    """A force that ends at once."""
    return 1.0 * (t < RELEASE)


def smooth(t):
    """A force that rises and falls, with the same impulse."""
    return 2 * math.sin(math.pi * t / RELEASE) ** 2 * (t < RELEASE)


def thrown(time, *, EI=100.0, rhoI=10.0, moment=-80.0):
    """The scene."""
    section = ub.Section(EA=1e4, GA=1e4, EI=EI, rhoA=1.0, rhoI=rhoI)
    beam = ub.Beam((6, 0), (0, 8), section, cells=8)
    load = ub.PointLoad(beam.start, force=(8, 0), moment=moment, amplitude=time)
    return ub.Scene([beam], loads=[load])


SCENES = {
    "smooth": partial(thrown, smooth),
    "sudden": partial(thrown, sudden),
    "slender": partial(thrown, smooth, EI=500.0, rhoI=0.01, moment=-20.0),
}


def run(make, scheme, dt):
    """A run."""
    return ub.simulate(make(), scheme, t=(0, END), dt=dt, progress=False)


def ends(solution):
    """Positions of both ends at the end; (2, 2); m."""
    beam = solution.scene.beams[0]
    return np.array([solution.displacement(p)[-1, :2] for p in (beam.start, beam.end)])


def name(scheme):
    """As one writes it."""
    if stages(scheme) > 1:
        return f"`{type(scheme).__name__}(order=4)`, steps of {stages(scheme)} dt"
    numbers = [f"{value:.3g}" for key, value in vars(scheme).items() if key != "order"]
    return f"`{type(scheme).__name__}({', '.join(numbers)})`"


def stages(scheme):
    """Number of equations that a step solves; for equal work, steps are longer by this factor."""
    return len(getattr(scheme, "stages", (1.0,)))


def rows(make):
    """Lines of a table."""
    exact = ends(run(make, ub.EnergyMomentum(order=4), FINE))
    for scheme in SCHEMES:
        runs = [run(make, scheme, stages(scheme) * dt) for dt in STEPS]
        errors = [np.linalg.norm(ends(one) - exact, axis=1).max() for one in runs]
        free = (
            round(RELEASE / STEPS[0] / stages(scheme)) + 1
        )  # the first state that no load leads to
        energy = runs[0].energy.total[free:]
        momentum = runs[0].momentum()[free:, 2]
        drifts = [energy[-1] / energy[0] - 1, momentum[-1] / momentum[0] - 1]
        numbers = [f"{error:.1e}" for error in errors]
        numbers += [f"{drift:+.0e}" if abs(drift) > 1e-9 else "0" for drift in drifts]
        each = runs[0].iterations / runs[0].substeps / stages(scheme)
        numbers += [f"{runs[0].energy.worst:.0e}", f"{each:.1f}"]
        yield f"| {' | '.join([name(scheme), *numbers])} |"


def table(make):
    """Text of a table."""
    head = [f"dt = {dt:g} s" for dt in STEPS]
    columns = ["scheme", *head, "energy", "angular momentum", "imbalance", "iterations"]
    return "\n".join([f"| {' | '.join(columns)} |", "|---" * len(columns) + "|", *rows(make)])


STATICS = [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.5)]
STEPS_A_SECOND = [16, 32, 64, 128, 256]


def plastic_work(scheme, steps):
    """Plastic work of a force that goes to and fro, 1.4 times what yields at first; J."""
    law = ub.ElastoPlastic(yield_limit=5.0, isotropic=10.0)
    section = ub.Section(EA=1e6, GA=1e6 / 3, EI=100.0, bending=law)
    beam = ub.Beam((0, 0), (1, 0), section, cells=8)
    load = ub.PointLoad(beam.end, force=(0, -7.0), amplitude=ub.Table([0, 1, 3, 5], [0, 1, -1, 1]))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    run = ub.simulate(scene, scheme, t=(0, 5), dt=1 / steps, progress=False)
    return run.energy["plastic"][-1]


def cyclic_table():
    """Text of the table of statics: relative errors of the plastic work."""
    exact = plastic_work(ub.Static(), 4096)
    lines = [["scheme", *map(str, STEPS_A_SECOND)], ["---"] * (len(STEPS_A_SECOND) + 1)]
    for scheme in STATICS:
        errors = [plastic_work(scheme, steps) / exact - 1 for steps in STEPS_A_SECOND]
        lines.append([name(scheme), *(f"{e:+.0e}" if abs(e) > 1e-9 else "0" for e in errors)])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    tables = {key: partial(table, make) for key, make in SCENES.items()}
    for key, make in {**tables, "cyclic": cyclic_table}.items():
        begin, end = f"<!-- {key} -->\n", f"<!-- end of {key} -->"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = before + begin + make() + "\n" + end + after
    PAGE.write_text(text, encoding="utf-8")
