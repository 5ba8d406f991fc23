# SPDX-License-Identifier: MIT
"""300 random scenes in space: ledger, momenta, joints, restart, axes, modes, derivatives, files.

``python3 test_random_scenes_in_space.py 0 300`` checks others and prints those that fail.
"""

import contextlib
import io
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from random_scenes_in_space import STEPS, built
from run_differences import TIGHT, difference
from scipy.spatial.transform import Rotation

import ufl_beam as ub

SAMPLE = range(16)
"""Seeds of the default run."""

ALL = range(300)

FAR = "The hinge in a cell", "A cell, ", "The places of Turn"
"""Ends of runs in which cells and connectors turn by 360°; before, they lose digits."""

ENDS = "a mechanism has formed", "a limit load or a bifurcation is near", *FAR
"""Reasons why scenes end: of hinges, and of joints and cells that turn too far."""

UNDIFFERENTIATED = "Coulomb has no derivatives", "order=4)", "does not depend on x"
"""Scenes without derivatives, or without a load."""

EXACT = ub.Newton(rtol=1e-12)

CLOSED, KEPT = 1e-9, 1e-9
"""Imbalance as a part of the energy that went through; gaps of joints over the size, or rad."""

FACTOR, SAME = 1e3, 1e-9
"""A turned scene may differ by so many times what other last digits make; and anyway by this."""

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")


def run(one, *, t=(0.0, 1.0), start=None, **more):
    """The solution of a part of the steps of a scene, and the words of its failure."""
    arguments = {"dt": one.steps, "newton": EXACT, "start": start} | more
    try:
        ends = tuple(STEPS * one.dt * x for x in t)
        return ub.simulate(one.scene, one.scheme, t=ends, **arguments), ""
    except ub.ConvergenceError as error:
        return error.solution, str(error)


def places(scene):
    return [b.at(s) for b in scene.beams for s in (0.0, 0.4, 1.0)] + [
        b.middle for b in scene.bodies
    ]


def motion(one, solution):
    """Displacements over the size, and rotation matrices, in the axes of the draw; (n, 12)."""
    rows = []
    for place in places(solution.scene):
        moved, back = solution.displacement(place), one.axes.inv()
        turned = (back * Rotation.from_rotvec(moved[:, 3:]) * one.axes).as_matrix()
        size = solution.scene.size
        rows.append(np.hstack([back.apply(moved[:, :3]) / size, turned.reshape(-1, 9)]))
    return np.array(rows)


def gaps(one, solution):
    """Largest gaps of joints: distances over the size, and angles between axes."""
    found = [0.0]
    for joint in one.scene.joints:
        kind, (a, b) = type(joint).__name__, joint.places
        apart = solution.position(a) - solution.position(b)
        turns = [Rotation.from_rotvec(solution.displacement(x)[:, 3:]) for x in (a, b)]
        between = (turns[0].inv() * turns[1]).as_rotvec()
        if kind in ("Rigid", "Revolute", "Spherical", "Universal"):
            found.append(np.abs(apart).max() / one.scene.size)
        if kind in ("Rigid", "RigidLink"):
            found.append(np.abs(between).max())
        if kind == "Universal":
            arms = [x.apply(axis) for x, axis in zip(turns, joint.axes, strict=True)]
            found.append(np.abs((arms[0] * arms[1]).sum(axis=1)).max())
        if kind == "Cylindrical":
            axis = np.subtract(*(x.point for x in (b, a))) if joint.axis is None else joint.axis
            along = turns[0].apply(np.array(axis) / np.linalg.norm(axis))
            found.append(np.abs(np.cross(apart, along)).max() / one.scene.size)
        if kind == "Revolute":
            ends = [x.apply(np.array(joint.axis) / np.linalg.norm(joint.axis)) for x in turns]
            found.append(np.abs(ends[0] - ends[1]).max())
        if kind == "Link":
            lengths = np.linalg.norm(apart, axis=1)
            found.append(np.abs(lengths - lengths[0]).max() / one.scene.size)
    return max(found)


def check(seed, also=True):
    """Check a scene; return the failure of its run, which must be clear, or an empty text."""
    one = built(seed)
    solution, failure = run(one)
    assert not failure or "no equilibrium after t" in failure, failure
    assert np.isfinite(solution.q).all()
    turns = [solution.connector(x).motion for x in one.scene.connectors if isinstance(x, ub.Turn)]
    if max((np.abs(x).max() for x in turns), default=0.0) > 6.0:
        return "a connector turned by 360°, at which its moments across the axis are infinite"
    if any(words in failure for words in FAR):
        return failure
    if not isinstance(one.scheme, ub.Static):
        assert solution.energy.worst < CLOSED, f"imbalance {solution.energy.worst:.1e}"
    assert (gap := gaps(one, solution)) < KEPT, f"gap {gap:.1e}"
    if one.free:
        p = solution.momentum()
        lengths = (np.linalg.norm(np.subtract(*beam.ends)) for beam in one.scene.beams)
        masses = [b.section.rhoA * x for b, x in zip(one.scene.beams, lengths, strict=True)]
        mass = sum(masses) + sum(body.mass for body in one.scene.bodies)
        size = np.abs(p).max() + mass * np.abs(solution.v).max() * one.scene.size + 1e-300
        exact = slice(None) if not isinstance(one.scheme, ub.EnergyMomentumDecaying) else slice(3)
        drift = np.abs(p - p[0])[:, exact].max() / size
        assert drift < 1e-9, f"momenta drift by {drift:.1e}"
    for further in FURTHER if also and not failure else ():
        further(one, solution)
    return failure


def assert_same(one, solution, other, what, by=None):
    """Check that last states agree, or differ by what last digits do; return the difference.

    ``other`` is a solution or its motion.
    """
    last = motion(one, solution)[:, -1]
    found = other if isinstance(other, np.ndarray) else motion(by or one, other)
    difference = np.abs(last - found[:, -1]).max()
    if difference > SAME:
        near = built(one.seed, Rotation.from_rotvec(1e-15 * np.ones(3)))
        digits = np.abs(last - motion(near, run(near)[0])[:, -1]).max()
        said = f"{what} differs by {difference:.1e}, last digits make {digits:.1e}"
        assert difference < FACTOR * digits, said
    return difference


def restarts(one, solution):
    """A run in two parts, and a run that is interrupted."""
    if one.steps == one.dt:
        first, _ = run(one, t=(0.0, 0.5))
        second, words = run(one, t=(0.5, 1.0), start=first)
        if solution.substeps == STEPS:  # else steps may be cut elsewhere, or fail beside
            assert not words, f"with start=: {words}"
            again = assert_same(one, solution, second, "start=")
            # Springs begin with motions that are computed again, from unit quaternions, and
            # supports with motions in their axes
            digits = one.scene.all_connectors or any(x.turns for x in one.scene.supports)
            assert digits or not again, f"start= differs by {again:.1e}"
    with tempfile.TemporaryDirectory() as folder:
        backup, half = ub.Checkpoint(f"{folder}/run.h5", every=1), STEPS / 2 * one.dt
        run(one, checkpoint=backup, until=lambda now: now.t >= half)
        resumed, _ = run(one, checkpoint=backup)
        assert (motion(one, resumed) == motion(one, solution)).all(), "checkpoint"


def in_other_axes(one, solution):
    """A turned scene has the turned motion."""
    other = built(one.seed, Rotation.random(random_state=one.seed))
    turned, words = run(other)
    assert not words, f"in other axes: {words}"
    if turned.substeps == solution.substeps:  # else round-off cuts a step
        assert_same(one, solution, turned, "in other axes", other)


def by_reference(one, solution):
    """Newton's method by a plain loop over kernels finds the same motion."""
    try:
        plain, words = run(one, newton=ub.Newton(rtol=1e-12, reference=True))
    except ub.ArgumentError as error:
        if "cannot be combined with" not in str(error):
            raise
    else:
        assert not words, f"reference=True: {words}"
        if plain.substeps == solution.substeps:
            assert_same(one, solution, plain, "reference=True")


def vibrations(one, solution):
    """Modes about the last state are found, or a scene that turns is refused."""
    try:
        assert np.isfinite(ub.modes(one.scene, 4, at=solution).shapes).all()
    except ub.ArgumentError as error:
        if "modes: at turns" not in str(error):
            raise


def recorders(one, solution):
    """Recorders change nothing, and what they record is in the solution."""
    if one.seed % 5:
        return
    with tempfile.TemporaryDirectory() as folder:
        _recorders(one, solution, folder)


def _recorders(one, solution, folder):
    history = ub.History(f"{folder}/run.csv", [places(one.scene)[-1]], one.scene.connectors)
    extremes, path = ub.Extremes(), Path(folder) / "run.vtkhdf"
    again, _ = run(one, record=[history, extremes, ub.VTKHDF(path), ub.Events()])
    assert (again.q == solution.q).all()
    rows = np.loadtxt(history.files[0], delimiter=",", skiprows=1)
    end = solution.displacement(places(one.scene)[-1])
    assert len(rows) == len(end)
    assert (rows[:, 1:7] == end).all()
    assert path.stat().st_size > 0
    for beam in one.scene.beams:
        drawn = [solution.diagram(beam, n, points=2)[1:] for n in range(len(solution))]
        forces, kept = np.array(drawn).transpose(0, 2, 1), extremes.section_forces(beam)
        size = np.abs(forces).max()
        assert np.abs(kept.high - forces.max(axis=0)).max() <= 1e-12 * size
        assert np.abs(kept.low - forces.min(axis=0)).max() <= 1e-12 * size


def derivative(one, solution):
    """The derivative by a factor on loads and a stiffness is that of differences of runs."""
    inelastic = any(b.section.section_points(b.section.hinge, True) for b in one.scene.beams)
    usual = isinstance(one.scheme, ub.EnergyMomentum) and one.scheme.order == 2 and not inelastic
    if one.seed in SAMPLE and not usual:  # the tables of others compile for half a minute
        return
    arguments = {"t": (0, STEPS * one.dt), "dt": one.dt, "newton": TIGHT}

    def model(x):
        return built(one.seed, factor=x).scene

    def last(s):
        return motion(one, s)[:, -1]

    try:
        found = ub.differentiate(model, {"x": 1.0}, one.scheme, **arguments)
    except ub.ArgumentError as error:
        if not any(words in str(error) for words in UNDIFFERENTIATED):
            raise
        return
    exact = found.of(last)[..., 0]
    size, errors = max(np.abs(exact).max(), 1e-3), []
    for h in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        d = difference(lambda x: last(ub.simulate(model(x), one.scheme, **arguments)), 1.0, h)
        errors.append(np.abs(d - exact).max() / size)
        if errors[-1] < max(1e-6, 3e-12 / h):  # differences lose digits
            return
    near = (h * k for h in (1e-9, 1e-8, 1e-7) for k in (-2, -1, 1, 2))
    runs = [ub.simulate(model(1.0 + x), one.scheme, **arguments) for x in near]
    pieces = {found.solution.substeps, *(s.substeps for s in runs)}
    assert len(pieces) > 1, f"derivatives {min(errors):.1e}"  # else steps are cut elsewhere


FURTHER = restarts, in_other_axes, by_reference, vibrations, recorders, derivative
"""Checks of some scenes whose run ends."""


@pytest.mark.serial  # files of one process
@pytest.mark.parametrize("seed", SAMPLE)
def test_a_scene_in_space(seed):
    check(seed)


def test_modes_with_a_free_motion_among_very_slow_ones():
    """Eigenvectors of an unsymmetric stiffness have errors, which depend on the axes.

    A body turns freely on a ball joint; the slowest other exponent is 2e-6 of the highest one.
    """
    found = []
    for axes in (None, 5, 8):
        one = built(283, None if axes is None else Rotation.random(random_state=axes))
        found.append(ub.modes(one.scene, 8, at=run(one)[0]).omega)
    assert [x[0] for x in found] == [0.0, 0.0, 0.0]
    assert np.allclose(found[1:], found[0], rtol=1e-6, atol=0.0)


@pytest.mark.slow
@pytest.mark.serial
def test_nearly_all_scenes_end():
    failures = {seed: words for seed in ALL if (words := check(seed))}
    failures = {k: x for k, x in failures.items() if not any(end in x for end in ENDS)}
    assert len(failures) <= 0.03 * len(ALL), failures


@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="one process")
@pytest.mark.parametrize("seed", SAMPLE)
def test_processes_share_a_scene(seed, shared_path, on_first_rank):
    """They find the motion of one process, also from its checkpoint, and it from theirs."""
    one = built(seed)
    solution, words = run(one)
    alone, words_alone = run(one, comm=MPI.COMM_SELF)
    everyone = MPI.COMM_WORLD.allgather((words, motion(one, solution).tobytes()))
    assert len(set(everyone)) == 1
    assert bool(words) == bool(words_alone)
    if words or solution.substeps != alone.substeps:  # round-off decides where steps are cut
        return
    assert_same(one, solution, alone, "one process")

    def half(name, **more):
        backup = ub.Checkpoint(shared_path / name, every=1)
        run(one, checkpoint=backup, until=lambda now: now.t >= STEPS / 2 * one.dt, **more)
        return backup

    backup, solo = half("together"), {"comm": MPI.COMM_SELF}
    end = on_first_rank(lambda: motion(one, run(one, checkpoint=backup, **solo)[0]))
    assert_same(one, solution, end, "checkpoint of all processes")
    on_first_rank(lambda: half("alone", **solo) and None)
    resumed, _ = run(one, checkpoint=ub.Checkpoint(shared_path / "alone", every=1))
    assert_same(one, solution, resumed, "checkpoint of one process")


if __name__ == "__main__":
    for number in range(*map(int, sys.argv[1:])):
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            try:
                said = check(number)
            except Exception:
                said = traceback.format_exc(limit=-2)
        if said:
            print(number, said, flush=True)
