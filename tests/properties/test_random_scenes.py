# SPDX-License-Identifier: MIT
"""200 random scenes, each stated in six ways: one result, constraints kept, a closed ledger.

And others, whose sizes are drawn from many decades; pictures of them.
"""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from constraint_gaps import largest_gap
from random_scenes import SAMPLE, STEPS, script
from scene_statements import AS_GIVEN, EPS, PARTS, changed_statements, made

import ufl_beam as ub
from ufl_beam.plotting.model import Drawing, model_notes, scene_load_caption
from ufl_beam.plotting.positions import Canvas

ALL = range(200)

SAME = 1e-12
"""Part of the size of the scene, or rad, that needs no reason: some thousand times the last digit,
as a few hundred operations in each of 15 steps lose; see `difference` for the rest."""

COPIES = 3
"""Runs with other last digits; each number changes by 4 units of its last place, its own way."""

FACTOR = 100
"""A statement may differ by so many times what other last digits of the data make: data are rounded
once, and three copies see a part of the directions in which a scene is sensitive."""

CHAOTIC = 1e-6
"""Difference of copies from which on a scene shows nothing."""

KEPT = 1e-9
"""Largest gap of a constraint, as a part of the size of the scene, or rad."""

CLOSED = 1e-9
"""Largest imbalance of the ledger as a part of the energy that went through."""

WIDE = 2, 7, 12, 26, 38, 41, 56, 59, 64, 83, 86, 104, 115, 123
"""Seeds of the default run of scenes of any size, some of which end with an error."""

EXACT = ("EnergyMomentum(", "EnergyMomentumDecaying(", "EnergyMomentumStatic(")
"""Schemes whose ledger closes at any step."""

CLEAR = "no equilibrium after t"
"""What a run that ends early must say."""

PLACES = (0.0, 0.25, 0.5, 0.8, 1.0)
"""Where motions of beams are compared; those between vertices are interpolated."""

WITHIN = (0.37, 0.81)
"""Where section forces are compared: within cells, at vertices they jump."""

MAGNIFIED = 1e3
"""Differences of forces and energies over those of motions: axial stiffnesses are up to 1e4 times
those of bending, and strains some hundredths."""


class Run:
    """A statement of a scene, its solution as far as it goes, its failure and its warnings."""

    def __init__(self, seed, statement=AS_GIVEN, wider=0.0):
        self.statement = statement
        self.source = script(seed, statement, wider)
        self.failure = None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            names = made(self.source)
            self.scene = names["scene"]
            arguments = {"t": names["times"], "dt": names["dt"], "mesh": names["mesh"]}
            if wider:  # steps that adapt may be many
                arguments["dt"] = (names["times"][1] - names["times"][0]) / STEPS
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


def sensitivity(seed, run):
    """Largest difference that other last digits of the data of a statement make."""
    copies = (Run(seed, replace(run.statement, digits=k)) for k in range(COPIES))
    return max(difference(run, copy) for copy in copies)


def compare(seed):
    """The runs of a scene by statement, their differences from the first, and sensitivities."""
    given = Run(seed)
    names = ["reordered"] if given.scattered else [one.name for one in changed_statements(seed)]
    runs = {x.name: Run(seed, x) for x in changed_statements(seed) if x.name in names}
    differences = {name: difference(given, other) for name, other in runs.items()}
    runs["as given"] = given
    if max(differences.values()) <= SAME:
        return runs, differences, dict.fromkeys(differences, 0.0)
    sensitivities = dict.fromkeys(differences, sensitivity(seed, given))
    if moved := runs.get("translated"):  # other coordinates have other last digits
        far = math.hypot(*moved.statement.shift) * moved.statement.unit("m")
        own = sensitivities["translated"], EPS * far / moved.scene.size
        sensitivities["translated"] = max(*own, sensitivity(seed, moved))
    return runs, differences, sensitivities


def check(seed):
    """Whether a scene is as it must be; its runs, and how sensitive it is."""
    runs, differences, sensitivities = compare(seed)
    given = runs["as given"]
    for name, found in differences.items():
        digits = sensitivities[name]
        said = f"{name} differs by {found:.1e}, last digits make {digits:.1e}\n{given.source}"
        assert found <= max(SAME, FACTOR * digits), said
    if given.failure is not None:  # perhaps within a step, on the way to its motions
        assert CLEAR in given.failure, f"{given.failure}\n{given.source}"
    else:
        gap, owner = largest_gap(given.solution, given.scene.size)
        assert gap <= KEPT, f"{owner} is missed by {gap:.1e}\n{given.source}"
    worst, said = given.solution.energy.worst, given.solution.imbalance_message
    assert not said or said in given.warnings
    if worst > CLOSED and any(f"scheme = ub.{name}" in given.source for name in EXACT):
        assert said, f"imbalance {worst:.1e} of throughput, without a word\n{given.source}"
    return runs, max(sensitivities.values())


@pytest.mark.serial
@pytest.mark.parametrize("seed", SAMPLE)
def test_all_statements_of_a_scene_give_one_result(seed):
    """Also the cut steps and the iterations, some of which search; failed steps go on longer."""
    runs, _ = check(seed)
    if runs["as given"].failure is None:
        assert len({(x.solution.substeps, x.solution.iterations) for x in runs.values()}) == 1


@pytest.mark.slow
@pytest.mark.serial
def test_nearly_all_scenes_are_regular():
    """The same of all; nearly all are regular, so that comparing them shows something."""
    assert sum(check(seed)[1] > CHAOTIC for seed in ALL) <= 0.05 * len(ALL)


# -- sizes of many decades ---------------------------------------------------------------------


def round_off(solution):
    """Energy that the last digits of strains make, of positions over a cell; J."""
    scene, least = solution.scene, 0.0
    for beam in scene.beams:
        last = EPS * scene.size * beam.cells / math.dist(*beam.ends)
        least += beam.section.EA * last**2 * math.dist(*beam.ends)
    most = float(np.max(solution.energy.total))
    return 50 * (least + 2 * math.sqrt(least * most))  # in some steps, over some nodes


def require_closed_or_clear(seed):
    """A scene whose sizes are ten times larger or smaller ends with a closed ledger or clearly."""
    one = Run(seed, wider=1.0)
    energy = one.solution.energy
    assert CLEAR in (one.failure or CLEAR), one.failure
    assert np.isfinite(one.solution.q).all()
    if not any(f"scheme = ub.{name}" in one.source for name in EXACT):
        return
    imbalance = float(np.abs(energy.imbalance).max()) - round_off(one.solution)
    assert imbalance <= CLOSED * energy.energy_transferred, one.source
    gives_back = {"numerical"} if "EnergyMomentumDecaying" in one.source else set()
    for name in {"plastic", "hinges", "friction", "numerical"} & set(energy.lost) - gives_back:
        least = np.diff(energy.lost[name]).min(initial=0.0)
        assert least >= -1e-12 * energy.energy_transferred, (name, one.source)


@pytest.mark.parametrize("seed", WIDE)
def test_scenes_of_any_size_have_a_closed_ledger_or_a_clear_error(seed):
    require_closed_or_clear(seed)


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("seed", ALL)
def test_all_scenes_of_any_size(seed):
    require_closed_or_clear(seed)


def amount(scene):
    """Number of strokes, labels and words of a picture, all of whose numbers are finite."""
    drawing = Drawing(Canvas(scene, 1.0, scale=scene.size / 300.0))
    strokes = [stroke for group in drawing.strokes.values() for stroke in group]
    assert all(np.isfinite(stroke.points).all() for stroke in strokes)
    labels = sum(map(len, drawing.labels.values()))
    whole = [load for load in scene.loads if any(scene_load_caption(load))]
    return len(strokes) + labels + len(whole) + len(model_notes(scene))


@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
@pytest.mark.parametrize("seed", range(25))
def test_every_object_leaves_something(seed):
    scene = made(script(seed))["scene"]
    everything = amount(scene)
    for part in PARTS[2:]:  # beside beams and bodies
        for one in getattr(scene, part):
            others = [other for other in getattr(scene, part) if other is not one]
            assert amount(replace(scene, **{part: others})) != everything, one
