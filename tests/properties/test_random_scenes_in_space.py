# SPDX-License-Identifier: MIT
"""300 random scenes in space: ledger, momenta, joints, restart, axes, processes.

``python3 test_random_scenes_in_space.py 0 300`` checks others and prints those that fail.
"""

import contextlib
import io
import sys
import tempfile
import traceback
import warnings

from mpi4py import MPI

import numpy as np
import pytest
from random_scenes_in_space import STEPS, built
from scipy.spatial.transform import Rotation

import ufl_beam as ub

SAMPLE = range(16)
"""Seeds of the default run."""

ALL = range(300)

EXACT = ub.Newton(rtol=1e-12)

CLOSED, KEPT = 1e-9, 1e-9
"""Imbalance as a part of the energy that went through; gaps of joints over the size, or rad."""

FACTOR, SAME = 1e3, 1e-9
"""A turned scene may differ by so many times what other last digits make; and anyway by this."""

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")


def run(one, *, t=(0.0, 1.0), start=None, **more):
    """The solution of a part of the steps of a scene, and the words of its failure."""
    ends = tuple(STEPS * one.dt * x for x in t)
    try:
        arguments = {"t": ends, "dt": one.dt, "newton": EXACT, "start": start, "progress": False}
        return ub.simulate(one.scene, one.scheme, **arguments, **more), ""
    except ub.ConvergenceError as error:
        return error.solution, str(error)


def places(scene):
    return [b.at(s) for b in scene.beams for s in (0.0, 0.4, 1.0)] + [
        b.middle for b in scene.bodies
    ]


def motion(one, solution):
    """Displacements over the size, and rotation matrices, in the axes of the draw; (n, 12)."""
    rows = []
    for place in places(one.scene):
        moved, back = solution.displacement(place), one.axes.inv()
        turned = (back * Rotation.from_rotvec(moved[:, 3:]) * one.axes).as_matrix()
        rows.append(np.hstack([back.apply(moved[:, :3]) / one.scene.size, turned.reshape(-1, 9)]))
    return np.array(rows)


def gaps(one, solution):
    """Largest gaps of joints: distances over the size, and angles between axes."""
    found = [0.0]
    for joint in one.scene.joints:
        kind, (a, b) = type(joint).__name__, joint.places
        apart = solution.position(a) - solution.position(b)
        turns = [Rotation.from_rotvec(solution.displacement(x)[:, 3:]) for x in (a, b)]
        between = (turns[0].inv() * turns[1]).as_rotvec()
        if kind in ("Rigid", "Revolute", "Spherical"):
            found.append(np.abs(apart).max() / one.scene.size)
        if kind in ("Rigid", "RigidLink"):
            found.append(np.abs(between).max())
        if kind == "Revolute":
            ends = [x.apply(np.array(joint.axis) / np.linalg.norm(joint.axis)) for x in turns]
            found.append(np.abs(ends[0] - ends[1]).max())
        if kind == "Link":
            lengths = np.linalg.norm(apart, axis=1)
            found.append(np.abs(lengths - lengths[0]).max() / one.scene.size)
    return max(found)


def check(seed):
    """Check a scene; return the failure of its run, which must be clear, or an empty text."""
    one = built(seed)
    solution, failure = run(one)
    assert not failure or "no equilibrium after t" in failure, failure
    assert np.isfinite(solution.q).all()
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
    if failure:
        return failure
    first, _ = run(one, t=(0.0, 0.5))
    second, words = run(one, t=(0.5, 1.0), start=first)
    assert not words, f"with start=: {words}"
    again = np.abs(motion(one, second)[:, -1] - motion(one, solution)[:, -1]).max()
    # Springs begin with motions that are computed again, from unit quaternions
    assert again <= (SAME if one.scene.connectors else 0.0), f"start= differs by {again:.1e}"
    with tempfile.TemporaryDirectory() as folder:
        backup, half = ub.Checkpoint(f"{folder}/run.h5", every=1), STEPS / 2 * one.dt
        run(one, checkpoint=backup, until=lambda now: now.t >= half)
        resumed, _ = run(one, checkpoint=backup)
        assert (motion(one, resumed) == motion(one, solution)).all(), "checkpoint"
    axes = Rotation.random(random_state=seed)
    other = built(seed, axes)
    turned, words = run(other)
    assert not words, f"in other axes: {words}"
    difference = np.abs(motion(one, solution) - motion(other, turned)).max()
    if difference > SAME:  # what last digits do
        near = built(seed, Rotation.from_rotvec(1e-15 * np.ones(3)))
        digits = np.abs(motion(one, solution) - motion(near, run(near)[0])).max()
        said = f"in other axes {difference:.1e}, last digits make {digits:.1e}"
        assert difference < FACTOR * digits, said
    return ""


@pytest.mark.parametrize("seed", SAMPLE)
def test_a_scene_in_space(seed):
    check(seed)


@pytest.mark.slow
@pytest.mark.serial
def test_nearly_all_scenes_end():
    failures = [seed for seed in ALL if check(seed)]
    assert len(failures) <= 0.03 * len(ALL), failures


@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="one process")
@pytest.mark.parametrize("seed", SAMPLE)
def test_processes_agree(seed):
    one = built(seed)
    solution, _ = run(one)
    alone, _ = run(one, comm=MPI.COMM_SELF)
    assert (motion(one, solution) == motion(one, alone)).all()
    assert len(set(MPI.COMM_WORLD.allgather(motion(one, solution).tobytes()))) == 1


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
