# SPDX-License-Identifier: MIT
"""A random scene in several statements: runs, and differences of their motions."""

import warnings
from dataclasses import replace

import numpy as np
from random_scenes import script
from scene_statements import AS_GIVEN

import ufl_beam as ub

PLACES = (0.0, 0.25, 0.5, 0.8, 1.0)
"""Where motions of beams are compared; those between vertices are interpolated."""

WITHIN = (0.37, 0.81)
"""Where section forces are compared: within cells, at vertices they jump."""

MAGNIFIED = 1e3
"""Differences of forces and energies over those of motions: axial stiffnesses are up to 1e4 times
those of bending, and strains some hundredths."""


class Run:
    """A statement of a scene, its solution as far as it goes, its failure and its warnings."""

    def __init__(self, seed, statement=AS_GIVEN, source=script):
        self.statement = statement
        self.source = source(seed, statement)
        names = {}
        self.failure = None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            exec(self.source, names)
            self.scene = names["scene"]
            arguments = {"t": names["times"], "dt": names["dt"], "mesh": names["mesh"]}
            try:
                self.solution = ub.simulate(self.scene, names["scheme"], **arguments)
            except ub.ConvergenceError as error:
                self.solution, self.failure = error.solution, str(error)
        self.warnings = [str(w.message) for w in caught]
        self.scattered = self.source.startswith("# scattered")
        self.seconds = statement.unit("s")

    def motion(self):
        """Times, s; (u, v, ψ) of places of all parts in SI and the axes of the first statement."""
        places = {(body.name, 0.0): body.middle for body in self.scene.bodies}
        for beam in self.scene.beams:
            for s in PLACES:
                places[beam.name, s] = beam.at(1 - s if self.is_backwards(beam) else s)
        moved = [self.solution.displacement(places[key]) for key in sorted(places)]
        return self.solution.times / self.seconds, np.array([*map(self.statement.motion, moved)])

    def forces(self):
        """N, V in N and M in N m within all beams, in their directions of the first statement."""
        units = [self.statement.unit(name) for name in ("N", "N", "N m")]
        rows = {}
        for beam in self.scene.beams:
            back = self.is_backwards(beam)
            for s in WITHIN:
                found = self.solution.section_forces_at(beam.at(1 - s if back else s)) / units
                rows[beam.name, s] = found * [1, 1, -1 if back else 1]
        return np.array([rows[key] for key in sorted(rows)])

    def energies(self):
        """Entries of the ledger as parts of the energy that went through."""
        energy = self.solution.energy
        return {name: energy[name] / (energy.energy_transferred or 1.0) for name in energy}

    def is_backwards(self, beam):
        return f"# {beam.name} runs backwards" in self.source


def difference(one, other):
    """Largest difference at common times: of motions as parts of the scene or in rad; of the rest.

    Section forces count as parts of their largest, energies of the throughput, over `MAGNIFIED`.
    """
    (t, x), (s, y) = one.motion(), other.motion()
    if len(t) == len(s) and not (one.failure or other.failure):
        # Each step with its own length, if steps are adaptive
        common = [(i, i) for i in range(len(t))]
    else:
        common = [(i, j) for i, j in _common(t, s, 1e-12 * max(t[-1], s[-1]))]
    a, b = (np.array(k) for k in zip(*common, strict=True))
    size = one.scene.size / one.statement.unit("m")
    x, y = (z[:, k] / [size, size, 1.0] for z, k in ((x, a), (y, b)))
    found = [np.abs(x - y).max() / max(1.0, np.abs(x).max())]
    f, g = one.forces()[:, a], other.forces()[:, b]
    for part in (slice(0, 2), slice(2, 3)):
        largest = np.abs(f[..., part]).max()
        found.append(np.abs(f[..., part] - g[..., part]).max() / MAGNIFIED / (largest or 1.0))
    first, second = one.energies(), other.energies()
    assert first.keys() == second.keys()
    found += [np.abs(first[name][a] - second[name][b]).max() / MAGNIFIED for name in first]
    return float(max(found))


def _common(t, s, near):
    j = np.searchsorted(s, t - near)
    for i, k in enumerate(j):
        if k < len(s) and abs(s[k] - t[i]) <= near:
            yield i, int(k)


def perturbed(statement, number):
    """The same statement with other last digits."""
    return replace(statement, name=f"{statement.name}, digits {number}", digits=number)
