# SPDX-License-Identifier: MIT
"""Runs of a combination, and checks of it that compare runs; mechanics_checks.py has others.

A check states when it applies, and its tolerance.  It raises :class:`NotApplicable` where the
combination is none for it, and AssertionError where results differ.
"""

import contextlib
import warnings
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from mpi4py import MPI

import numpy as np
from combinations import Combination
from helpers import stop_after
from restart_scenes import arrays_of
from user_classes import CONNECTOR_LAWS, LAWS, SOFTENING, LargestCurvature

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam import parallel
from ufl_beam.simulation.reference_run import require_scope

DIGITS = 1e-12
"""Tolerance of Newton's method in runs whose results are compared as numbers."""

SAME = 1e-7
"""Difference of two runs to :data:`DIGITS`, as a part of the largest value: each of some 20 steps
leaves 1e-12 of the forces, stiffnesses differ by factors of up to 1e3."""


class NotApplicable(Exception):
    """Why a check says nothing about a combination."""


def only(condition, reason):
    if not condition:
        raise NotApplicable(reason)


@dataclass
class Run:
    """Names of a script, and the solution of its scene; `failure` if a step failed."""

    names: dict
    solution: ub.Solution
    failure: str = ""


@dataclass
class Case:
    """A combination, its run, and a folder for files."""

    combination: Combination
    folder: Path
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF)

    def run(self, names=None, **changes):
        """Run the script, with other arguments; a failed step leaves what came before it."""
        names = names or self.combination.make()
        arguments = {key: names[key] for key in ("t", "dt", "mesh", "newton")}
        arguments |= {"comm": self.comm, **changes}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ub.ModelWarning)
            try:
                return Run(names, ub.simulate(names["scene"], names["scheme"], **arguments))
            except ub.ConvergenceError as error:
                return Run(names, error.solution, str(error))

    @cached_property
    def whole(self):
        """The run as the script states it."""
        return self.run()

    @cached_property
    def exact(self):
        """The same to more digits."""
        return self.run(newton=ub.Newton(rtol=DIGITS))

    @property
    def steps(self):
        return len(self.whole.solution) - 1

    @property
    def equal_steps(self):
        return not self.combination.has("ub.Adaptive")


CHECKS = {}


def check(function):
    """Add a function to the checks."""
    CHECKS[function.__name__] = function
    return function


def assert_same_bits(one, other):
    first, second = (arrays_of(x) if isinstance(x, ub.Solution) else x for x in (one, other))
    assert sorted(first) == sorted(second)
    for name, values in first.items():  # all bits but the signs of zeros
        numbers = not isinstance(values, str)
        assert np.array_equal(values, second[name], equal_nan=numbers), name


def difference(one, other, size=None):
    """Largest difference, as a part of the largest size; NaN stands where it stands in both."""
    one, other = np.asarray(one), np.asarray(other)
    assert one.shape == other.shape
    assert (np.isnan(one) == np.isnan(other)).all()
    size = np.nanmax(np.abs(other), initial=0.0) if size is None else size
    return float(np.nanmax(np.abs(one - other), initial=0.0)) / (size or 1.0)


def results(names, solution, rows=slice(None)):
    """Results of a solution by name: motions as parts of the scene, forces of all parts."""
    scene = names["scene"]
    lengths = scene.size * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, 1.0])
    moved = [one.at(s) for one in scene.beams for s in (0.0, 0.5, 1.0)]
    forces = [solution.section_forces_at(place)[rows] for place in moved]
    forces += [solution.reaction(support)[rows] for support in scene.supports]
    moved += [one.middle for one in scene.bodies]
    of_each = [np.atleast_2d(solution.connector(x).force[rows].T) for x in scene.connectors]
    return {
        "motions": (np.array([solution.displacement(p)[rows] / lengths for p in moved]), 1.0),
        "forces": (np.array(forces), None),
        "of connectors": (np.concatenate(of_each) if of_each else np.array([]), None),
    }


def differences(one, other, rows=slice(None)):
    """Largest differences of two runs by kind; of some rows of the second, as if it began there."""
    a, b = results(one.names, one.solution), results(other.names, other.solution, rows)
    forces = max((np.nanmax(np.abs(x), initial=0.0) for x, _ in b.values()), default=1.0)
    found = {}
    for name, (values, size) in a.items():
        values, others = (x[:, 1:] if x.ndim > 1 else x for x in (values, b[name][0]))
        found[name] = difference(values, others, size or forces)
    through = other.solution.energy.energy_transferred or 1.0
    for kind in ("state", "supplied", "lost"):
        mine, others = getattr(one.solution.energy, kind), getattr(other.solution.energy, kind)
        assert set(mine) == set(others)
        for name in mine:
            expected = others[name][rows] - (0.0 if kind == "state" else others[name][rows][0])
            found[f"{kind}: {name}"] = difference(mine[name], expected, through)
    return found


def assert_near(found, tolerance=SAME):
    assert max(found.values()) <= tolerance, {k: v for k, v in found.items() if v > tolerance}


@check
def failed_step(case):
    """A step that fails says why; longer steps may leap over a limit load of smaller ones."""
    only(case.whole.failure, "all steps converged")
    causes = "limit load", "mechanism has formed", "smaller dt"
    assert any(words in case.whole.failure for words in causes), case.whole.failure


@check
def ledger(case):
    """It closes as the scheme claims; what was lost never comes back, to digits of the whole.

    `EnergyMomentumDecaying` may give back a part of its own loss.  Laws with memory have errors of
    steps of both signs; hinges whose unloading stiffness falls store more at the same moment.
    """
    solution = case.whole.solution
    assert solution.imbalance_message == ""
    energy = solution.energy
    falling = "MenegottoPinto", "IbarraKrawinkler", "PinchingHinge"
    either = {"plastic": falling, "numerical": ("KentPark", "Mander", "RambergOsgood", *falling)}
    names = {"plastic", "hinges", "friction", "numerical"} & set(energy.lost)
    for name in names if case.combination.has_exact_ledger else ():
        if not case.combination.has(*either.get(name, ())):
            gives_back = name == "numerical" and case.combination.has("EnergyMomentumDecaying")
            least = energy.lost[name] if gives_back else np.diff(energy.lost[name])
            assert least.min(initial=0.0) >= -1e-9 * energy.energy_transferred, name


@check
def ledger_of_small_steps(case):
    """A ledger by trapezes, of second order where nothing yields, closes with smaller steps.

    A quarter of the step leaves a sixteenth of the imbalance; of yielding, sliding and contact a
    quarter.  Steps must resolve periods of the mesh, some 1e-3 s, in statics the creep of Kelvin
    and Voigt's damping: of longer steps, most of the imbalance is in the first one.
    """
    only(not case.combination.has_exact_ledger, "the scheme closes its ledger")
    only(case.equal_steps and not case.whole.failure, "steps are not equal")
    scene, dt = case.whole.names["scene"], case.whole.names["dt"]
    if case.combination.static:
        moving = [load for load in scene.loads if isinstance(load, ub.MovingLoad)]
        leaves = any(load.position(case.whole.names["t"][1]) > 1.1 for load in moving)
        only(not leaves, "what bends springs back as a load leaves")
        creep = [one.retardation_time for one in scene.damping if isinstance(one, ub.KelvinVoigt)]
        dt = min([dt, *creep])
    found = [imbalance(case.run(dt=dt))]
    for parts in (4, 32, 256):
        found.append(imbalance(case.run(dt=dt / parts)))
        if found[-1] <= max(0.5 * found[0], 1e-9):
            return
    raise AssertionError(f"imbalance {found} with 1, 1/4, 1/32 and 1/256 of {dt:.3g} s")


def imbalance(run):
    """Largest imbalance over the energy that went through; in statics without the first trapeze."""
    energy, first = run.solution.energy, 0 if len(run.solution.v) else 1
    return np.ptp(energy.imbalance[first:]) / (energy.energy_transferred or 1.0)


@check
def split(case):
    """A run in two parts by `start=` is the run."""
    only(case.equal_steps, "steps depend on those before")
    only(not case.exact.failure, "a step fails")
    for parts in (1, 4, 16):  # as in assert_agree
        names, n = case.combination.make(), (len(case.exact.solution) - 1) * parts
        (t0, t1), k = names["t"], n // 2
        at = t0 + (t1 - t0) * k / n
        equal = {"dt": (t1 - t0) / n * (1 + 1e-10), "newton": ub.Newton(rtol=DIGITS)}
        whole = case.run(**equal)
        only(not whole.failure, "longer steps leap over a limit load")
        first = case.run(t=(t0, at), names=names, **equal)
        second = case.run(t=(at, t1), start=first.solution, names=names, **equal)
        if has_cut(whole, first, second) and parts < 16:
            continue
        assert_near(differences(first, whole, slice(0, k + 1)))
        assert_near(differences(second, whole, slice(k, None)))
        return


@check
def resumed(case):
    """A run that is interrupted and resumed is the run, to the last bit."""
    only(not case.whole.failure, "a step fails")
    only(case.steps >= 4, "too few steps")
    checkpoint = ub.Checkpoint(case.folder / "run.checkpoint", every=3)

    def go(folder, stop, **more):
        names = case.combination.make()
        written = recorders_of(case, names, folder)
        return case.run(names=names, record=[*written, stop_after(stop)], **more), written

    with contextlib.suppress(KeyboardInterrupt):
        go("resumed", case.steps // 2 + 1, checkpoint=checkpoint)
    resumed, again = go("resumed", 10**9, checkpoint=checkpoint)
    other = ub.Checkpoint(case.folder / "whole.checkpoint", every=3)
    expected, whole = go("whole", 10**9, checkpoint=other)
    assert_same_bits(resumed.solution, expected.solution)
    assert_same_bits(resumed.solution, case.whole.solution)
    assert_same_records(again, whole)


@check
def saved(case):
    """A loaded solution has the same results and texts; guide curves are saved as points."""
    own = *LAWS, *SOFTENING, *CONNECTOR_LAWS, "ub.Effect"
    only(not case.combination.has(*own), "own laws cannot be saved")
    before = case.whole.solution
    before.save(case.folder / "solution.h5")
    after = ub.Solution.load(case.folder / "solution.h5")
    assert_same_bits(before, after)
    assert str(before) == str(after)
    assert_same_bits(*(dict(derived_results(solution)) for solution in (before, after)))
    for one, other in zip(before.scene.joints, after.scene.joints, strict=True):
        if isinstance(one, ub.Guided):
            assert difference(before.joint(one).force, after.joint(other).force) < 1e-5


def derived_results(solution):
    """Names and arrays of results that follow from the states."""
    scene = solution.scene
    for i, beam in enumerate(scene.beams):
        yield f"section forces {i}", solution.section_forces(beam)
        yield f"position {i}", solution.position(beam.at(0.37))
    for i, support in enumerate(scene.supports):
        yield f"reaction {i}", solution.reaction(support)
    histories = [*map(solution.diagram, scene.beams), *map(solution.connector, scene.connectors)]
    for joint in scene.joints:
        held = joint.holders and {joint.holders[0].a, joint.holders[0].b} == set(joint.places[:2])
        if held and not isinstance(joint, ub.Guided):
            histories.append(solution.joint(joint))
    for i, history in enumerate(histories):
        yield from ((f"{name} {i}", values) for name, values in history._asdict().items())


@check
def recorders(case):
    """Recorders change nothing, and what they record is in the solution."""
    names = case.combination.make()
    written = recorders_of(case, names, "recorders")
    run = case.run(names=names, record=written)
    assert_same_bits(run.solution, case.whole.solution)
    history, extremes, *_ = written
    rows = np.loadtxt(history.files[0], delimiter=",", skiprows=1)
    end = run.solution.displacement(run.names["b0"].end)
    if len(rows) == len(end):  # parts of a failed step are not kept
        assert (rows[:, 1:4] == end).all()
    only(not has_cut(run), "parts of steps are in either the solution or the records")
    for beam in run.names["scene"].beams:
        numbering = run.solution.numbering
        kept = run.solution.q[:, numbering.dofs[numbering.nodes_along(beam)]]
        drawn = [run.solution.diagram(beam, n, points=2)[1:] for n in range(len(kept))]
        forces = np.array(drawn).transpose(0, 2, 1)
        moved, borne = extremes.displacement(beam), extremes.section_forces(beam)
        for found, states in ((moved, kept), (borne, forces)):
            size = np.abs(states).max()  # round-off: C adds in another order than NumPy
            assert difference(found.high, states.max(axis=0), size) < 1e-12
            assert difference(found.low, states.min(axis=0), size) < 1e-12


@check
def engineering(case):
    """Hinges of beams dissipate what their cells do; accelerations add up to velocities; drifts."""
    solution, scene = case.whole.solution, case.whole.names["scene"]
    rows, (_, lost) = st.hinge_table(solution, only=scene.beams).rows, solution.damage()
    assert difference(sum(row.dissipated for row in rows), lost.sum(), lost.sum() or 1.0) < 1e-12
    assert all(row.n < 0 or row.time == solution.times[row.n] for row in rows)
    for beam in scene.beams if len(solution.v) else ():
        v, steps = solution.velocity(beam.end), np.diff(solution.times)[:, None]
        gained = np.cumsum(steps * solution.acceleration(beam.end)[1:], axis=0)
        assert difference(v[1:], v[0] + gained, np.abs(v).max() or 1.0) < 1e-12
    low, high = sorted((scene.beams[0].start, scene.beams[0].end), key=lambda x: x.point[1])
    only(high.point[1] - low.point[1] > 0.1, "the first beam is horizontal")
    only(not scene.bodies, "a level may cut a body")
    storeys = st.storeys(solution, [low, high])
    moved = solution.displacement(high) - solution.displacement(low)
    assert (storeys.drift[:, 0] == moved[:, 0]).all()
    assert np.isfinite(storeys.shear).all()


def recorders_of(case, names, folder):
    """New recorders of all kinds, which write to a folder of the case."""
    path, seed = case.folder / folder, case.combination.seed
    path.mkdir(exist_ok=True)
    mean = (st.Goodman(4e8), st.Gerber(4e8))[seed % 2]
    curve = st.SNCurve(range=1e6, mean=mean) if seed % 3 else st.SNCurve.eurocode(71e6)
    spot = st.HotSpot.fibre(names["b0"].at(0.3), y=0.05, E=1.2e8)
    series = ub.XDMF(path / "run.xdmf") if seed % 2 else ub.VTKHDF(path / "run.vtkhdf", every=2)
    history = ub.History(path / "run.csv", [names["b0"].end], names["scene"].connectors)
    others = ub.Events(), st.Fatigue(spot, curve), LargestCurvature(), series
    return [history, ub.Extremes(accelerations=len(case.whole.solution.v) > 0), *others]


def assert_same_records(some, others):
    """Recorders of two runs have the same rows, extremes, events, cycles and numbers."""
    for one, other in zip(some, others, strict=True):
        assert_same_bits(one.state(), other.state())
        for path, another in zip(one.files, other.files, strict=True):
            if path.suffix in (".csv", ".xdmf"):
                assert path.read_bytes() == another.read_bytes(), path.name


@check
def loops(case):
    """Loops of `step_to` and `steps_to` take the steps of the run, to the last bit."""
    only(case.equal_steps, "the run chooses its steps")
    only(not case.whole.failure, "a step fails")
    ends = case.whole.solution.times[1:]
    for many in (False, True):
        names, left = case.combination.make(), ends
        options = {"mesh": names["mesh"], "newton": names["newton"], "comm": case.comm}
        simulation = ub.Simulation(names["scene"], names["scheme"], **options)
        simulation.keep()
        while len(left) and many:
            left = left[simulation.steps_to(left, keep=True) :]
        for t in left:
            simulation.step_to(t)
            simulation.keep()
        simulation.end()
        simulation.close()
        assert_same_bits(simulation.solution, case.whole.solution)


class StepsAreCut(AssertionError):
    """Two runs that cannot be compared: steps are cut, however small; with both runs."""


def assert_agree(case, tolerance=SAME, **changes):
    """Runs with other arguments find the motions, forces and energies of `exact`.

    Where one must cut a step, last digits decide: then smaller steps, which none must cut, are
    compared.  Beyond a limit load there are none: the state leaps, however short its steps are.
    """
    only(not case.exact.failure, "a step fails")
    for parts in (1, 4, 16):
        more = {"newton": ub.Newton(rtol=DIGITS)}
        if parts > 1:
            only(case.equal_steps, "last digits decide on the steps")
            more["dt"] = case.exact.names["dt"] / parts
        expected = case.run(**more) if parts > 1 else case.exact
        only(not expected.failure, "longer steps leap over a limit load")
        found = case.run(**{**more, **changes})
        same_times = len(found.solution) == len(expected.solution)
        near = same_times and max(differences(found, expected).values()) <= tolerance
        if has_cut(expected, found) and not near:
            continue
        assert not found.failure, found.failure
        return assert_near(differences(found, expected), tolerance)
    only(not leaps(case, expected), "the state leaps over a limit load")
    start = case.exact.names["t"][0]
    more["t"] = (start, start + more["dt"])
    first = case.run(**more), case.run(**{**more, **changes})
    leaps_first = case.combination.static and has_cut(*first)
    only(not leaps_first, "under the loads at the start there are several equilibria")
    raise StepsAreCut(expected, found)


def leaps(case, short):
    """Whether in statics a state leaps in a step but the first: as far as four short steps."""
    motions = (results(run.names, run.solution)["motions"][0] for run in (short, case.exact))
    farthest = [np.abs(np.diff(x, axis=1)[:, 1:]).max() for x in motions]
    return case.combination.static and farthest[0] > 4 / 16 * farthest[1]


def has_cut(*runs):
    """Whether one of the runs has cut a step."""
    return any(run.failure or run.solution.substeps > len(run.solution) - 1 for run in runs)


@check
def reference(case):
    """The reference solver finds the same motions, forces and energies."""
    only(case.equal_steps, "its steps are equal")
    only(case.comm.size == 1, "it has one process")
    solution = case.whole.solution
    try:
        require_scope(solution.numbering, solution.scheme, MPI.COMM_SELF)
    except ub.ArgumentError as error:
        only(False, str(error))
    try:
        assert_agree(case, newton=ub.Newton(rtol=DIGITS, reference=True))
    except StepsAreCut as flag:
        expected, found = flag.args
        alone = not has_cut(expected) and not found.failure
        only(not alone, "only the reference solver cuts steps, however small")
        raise


@check
def newton_options(case):
    """Options of Newton's method change nothing but what it leaves."""
    only(case.combination.has("Newton(p", "Newton(m"), "none")
    options = case.exact.names["newton"]
    assert_agree(case, 100 * SAME, newton=replace(options, rtol=min(options.rtol, 1e-11)))


@check
def processes(case):
    """Shared by all processes of MPI the run is the one of a single process."""
    only(MPI.COMM_WORLD.size > 1, "one process")
    smallest, parallel.SMALLEST_SUBDOMAIN = parallel.SMALLEST_SUBDOMAIN, 1
    try:
        assert_agree(case, comm=MPI.COMM_WORLD)
    finally:
        parallel.SMALLEST_SUBDOMAIN = smallest


REFUSED = "hinges are for resultants"
"""What a refusal of a combination may say: features that the documentation excludes together."""


def outcome_of(combination, folder, names=CHECKS):
    """What became of each check: "passed", "not applicable", "refused", or words of a flag."""
    case, found = Case(combination, folder), {}
    try:
        assert case.whole.solution is not None
    except ub.ArgumentError as error:
        return {"run": "refused" if REFUSED in str(error) else f"refused: {error}"}
    for name in names:
        try:
            CHECKS[name](case)
            found[name] = "passed"
        except NotApplicable:
            found[name] = "not applicable"
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
    return found


def flags_of(found):
    """Checks that failed, and what they said."""
    known = "passed", "not applicable", "refused"
    return {name: words for name, words in found.items() if words not in known}
