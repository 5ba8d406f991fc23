# SPDX-License-Identifier: MIT
"""A run that is stopped, by whatever, and run again is the run, to the last bit."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises, stop_after
from restart_scenes import arrays_of, bend, machine
from time_series import read_vtkhdf, require_equal

import ufl_beam as ub

SCRIPT = Path(__file__).with_name("restart_scenes.py")

RUNS = {
    "midpoint": (machine, ub.EnergyMomentum(0.05, 0.02), 0.2, 0.005),
    "adaptive": (machine, ub.EnergyMomentum(0.05, 0.02), 0.1, ub.Adaptive(1e-4)),
    "judged": (bend, ub.EnergyMomentum(0.05, 0.02), 2.0, ub.Adaptive(2e-3)),
    "decaying": (bend, ub.EnergyMomentumDecaying(), 5.0, 0.1),
    "Newmark": (bend, ub.Newmark(0.6, 0.35), 5.0, 0.1),
    "generalized-alpha": (bend, ub.GeneralizedAlpha(), 5.0, 0.1),
    "static": (bend, ub.Static(), 5.0, 0.1),
    "exact static": (bend, ub.EnergyMomentumStatic(), 5.0, 0.1),
}


def go(kind, path=None, *, steps=10**9, every=5, comm=None):
    """A run, perhaps stopped after some steps."""
    make, scheme, end, dt = RUNS[kind]
    checkpoint = None if path is None else ub.Checkpoint(path, every=every)
    return ub.simulate(
        make(), scheme, t=(0, end), dt=dt, every=2, record=stop_after(steps),
        checkpoint=checkpoint, comm=comm,
    )  # fmt: skip


def stopped(*arguments, **keywords):
    with pytest.raises(KeyboardInterrupt):
        go(*arguments, **keywords)


def assert_same_bits(one, other):
    assert list(one) == list(other)
    for name, values in one.items():
        assert values.dtype == other[name].dtype, name
        assert values.tobytes() == other[name].tobytes(), name


def assert_same_numbers(one, other):
    """To what Newton's method leaves, 1e-10 of the forces in each step, as any two runs differ."""
    assert (one["t"] == other["t"]).all()
    assert one.keys() == other.keys()
    names = {"q", "v", "reactions", "material", "lost: plastic", "lost: hinges"}
    for name in names & one.keys():
        size = np.abs(np.nan_to_num(other[name])).max(initial=0.0)
        assert np.abs(np.nan_to_num(one[name] - other[name])).max(initial=0.0) <= 1e-7 * size, name


@pytest.mark.filterwarnings("ignore:Adaptive")  # the controllers of the machine remember
@pytest.mark.parametrize("kind", RUNS)
def test_a_run_that_goes_on_is_the_run(kind, shared_path):
    """Twice stopped; to the last bit, on several processes but for sums over them."""
    path = shared_path / "run.checkpoint"
    whole = go(kind)
    stopped(kind, path, steps=12)
    stopped(kind, path, steps=9)
    solution = go(kind, path)
    if MPI.COMM_WORLD.size == 1:
        assert_same_bits(arrays_of(solution), arrays_of(whole))
        assert str(solution).split("wall")[1:] == str(whole).split("wall")[1:]
        assert repr(solution.time_error) == repr(whole.time_error)
    assert_same_numbers(arrays_of(solution), arrays_of(whole))
    # What must remember has something to remember
    lost = whole.energy.lost
    assert lost["plastic"][-1] > 0.0
    assert lost["hinges"][-1] > 0.0 or kind == "adaptive"  # which ends before
    if kind == "midpoint":
        assert lost["friction"][-1] > 0.0
        assert whole.energy.worst < 1e-9


@pytest.mark.parametrize("kind", ["midpoint", "static"])
@pytest.mark.parametrize("first", ["one", "all"])
def test_a_run_goes_on_on_another_number_of_processes(kind, first, shared_path, on_first_rank):
    path = shared_path / "run.checkpoint"
    whole = go(kind)
    if first == "one":
        on_first_rank(lambda: stopped(kind, path, steps=12, comm=MPI.COMM_SELF))
        solution = arrays_of(go(kind, path))
    else:
        stopped(kind, path, steps=12)
        solution = on_first_rank(lambda: arrays_of(go(kind, path, comm=MPI.COMM_SELF)))
    assert_same_numbers(solution, arrays_of(whole))


def test_a_finished_run_is_there_at_once_and_a_later_end_goes_on(shared_path):
    """The rounding of the times of steps is another; all else is the run."""
    checkpoint = ub.Checkpoint(shared_path / "run.checkpoint", every=100)

    def until(end, steps=10**9, **more):
        more |= {"t": (0, end), "dt": 0.005, "record": stop_after(steps)}
        return ub.simulate(machine(), ub.EnergyMomentum(0.05), **more)

    short = until(0.1, checkpoint=checkpoint)
    again = until(0.1, steps=1, checkpoint=checkpoint)  # a single step would stop it
    assert_same_numbers(arrays_of(again), arrays_of(short))
    assert again.q.tobytes() == short.q.tobytes()
    longer, whole = until(0.2, checkpoint=checkpoint), until(0.2)
    assert longer.times == pytest.approx(whole.times, rel=1e-14)
    # What a last digit of the time changes, and what Newton's method leaves
    assert np.abs(longer.q - whole.q).max() < 1e-8 * np.abs(whole.q).max()
    with raises("is at t = 0.2 s, beyond the end t[1] = 0.15"):
        until(0.15, checkpoint=checkpoint)


def until_killed(folder, dice):
    """Run the script and kill it a moment after it has gone on; whether it was still running."""

    def size():
        with contextlib.suppress(FileNotFoundError):  # not yet, or being replaced
            return (folder / "run.csv").stat().st_size

    environment, before = {**os.environ, "OMP_NUM_THREADS": "1"}, size()
    process = subprocess.Popen([sys.executable, str(SCRIPT), str(folder)], env=environment)
    while process.poll() is None and size() in (before, None, 0):
        time.sleep(0.002)
    time.sleep(dice.uniform(0, 0.05))
    process.send_signal(signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


@pytest.mark.serial
@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_killed_runs_are_the_run(tmp_path, kills):
    """Tables and XDMF byte for byte; VTKHDF, whose HDF5 leaves gaps, number by number."""
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    for one in (whole, killed):
        one.mkdir()
    dice = random.Random(1)
    done = sum(until_killed(killed, dice) for _ in range(kills))
    for one in (whole, killed):
        subprocess.run([sys.executable, str(SCRIPT), str(one)], check=True, timeout=300)
    assert done >= kills / 2  # the others had come to the end
    with np.load(whole / "end.npz") as one, np.load(killed / "end.npz") as other:
        assert_same_bits({n: one[n] for n in one}, {n: other[n] for n in other})
    for name in ("run.csv", "few.csv", "run.xdmf"):
        assert (whole / name).read_bytes() == (killed / name).read_bytes(), name
    require_equal(*(read_vtkhdf(folder / "run.vtkhdf") for folder in (killed, whole)))
    assert not list(killed.glob("*.part"))
