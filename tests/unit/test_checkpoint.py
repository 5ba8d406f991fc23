# SPDX-License-Identifier: MIT
"""Checkpoints: what they refuse and why, what describes a run, full disks, who remembers what."""

import errno
import itertools
import math
import operator
import resource
from functools import partial
from types import MethodType, SimpleNamespace

from mpi4py import MPI

import numpy as np
import pytest
from helpers import AfterEachStep, raises
from scenes import clamped, rigid_chain

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.discretization.state_io import Archive
from ufl_beam.output import output_files
from ufl_beam.output.serialization import Description, difference
from ufl_beam.simulation.checkpoint import FORMAT


def read(path):
    return output_files.read(path, FORMAT)


STEEL = {"EA": 1e4, "GA": 1e4, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.1}


def scene(time=lambda t: math.sin(3 * t), EI=100.0, x=1.0, **more):
    section = ub.Section(**{**STEEL, "EI": EI})
    beam = ub.Beam((0, 0), (x, 0), section, cells=2, name="left")
    load = ub.PointLoad(beam.end, force=(0, -3), amplitude=time)
    return clamped(beam, loads=[load], **more)


def run(path, frame=None, scheme=None, *, every=2, also=(), t=(0, 0.5), dt=0.1, **more):
    checkpoint = ub.Checkpoint(path, every=every, also=also)
    return ub.simulate(
        frame or scene(), scheme or ub.EnergyMomentum(), t=t, dt=dt, checkpoint=checkpoint, **more
    )


@pytest.fixture
def path(shared_path):
    return shared_path / "run.checkpoint"


def test_wrong_checkpoints_are_refused(path):
    for arguments, words in (
        ({}, "say how often"),
        ({"every": 1, "also": [3]}, "also[0] = 3 has no state"),
    ):
        with raises(words):
            ub.Checkpoint(path, **arguments)
    with raises("there is no directory"):
        run(path.parent / "nowhere" / "x")


OTHERS = {
    "section": ({"frame": scene(EI=200.0)}, "'left'.section.EI is 200.0, in the file 100.0"),
    "place": ({"frame": scene(x=2.0)}, "scene.beams[0] 'left'", " is 2.0, in the file 1.0"),
    "function": ({"frame": scene(lambda t: math.cos(3 * t))}, "loads[0].amplitude has changed"),
    "table": ({"frame": scene(ub.Table((0, 1), (0, 1)))}, "amplitude is Table, in the file func"),
    "scheme": ({"scheme": ub.EnergyMomentum(0.1)}, "scheme.alpha is 0.1, in the file 0.0"),
    "dt": ({"dt": 0.05}, "dt is 0.05, in the file 0.1"),
    "adaptive": ({"dt": ub.Adaptive(1e-3)}, "dt is Adaptive, in the file 0.1"),
    "beginning": ({"t": (0.1, 0.6)}, "t[0] is 0.1, in the file 0.0"),
    "step": ({"t": (0, 0.45)}, "the step is 0.09 s, in the file 0.1"),
    "newton": ({"newton": ub.Newton(rtol=1e-8)}, "newton.rtol is 1e-08, in the file 1e-10"),
    "random": ({"also": [np.random.default_rng(1)]}, "other objects have a state"),
}


@pytest.mark.parametrize("other", OTHERS)
def test_the_file_of_another_run(other, path):
    run(path)
    arguments, *words = OTHERS[other]
    with raises(*words, "Delete the file to begin anew, or name another"):
        run(path, **arguments)


def test_another_start_is_refused(path):
    first = ub.simulate(scene(), ub.Static(), t=(0, 1), dt=1.0)
    run(path)
    with raises("start is ", ", in the file 'nothing'"):
        run(path, first.scene, start=first)


@pytest.mark.serial
def test_a_file_that_cannot_grow(path):
    """As on a full disk: a clear error, the solution, and the checkpoint before."""
    frame = scene()
    run(path, frame, t=(0, 0.2))  # so that everything is compiled
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    size = path.stat().st_size
    path.unlink()
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 500, limits[1]))
    try:
        with pytest.raises(OSError, match=r"of t = \S+ s cannot be written: .*it needs") as error:
            run(path, t=(0, 100.0), every=2)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert error.value.errno == errno.EFBIG
    assert "the one before is still there" in str(error.value)
    reached = error.value.solution
    assert [one.name for one in path.parent.iterdir()] == [path.name]
    before = read(path)["history/q"]
    assert 2 < len(before) < len(reached.q)
    assert (reached.q[: len(before)] == before).all()
    # With more space the same call goes on
    assert run(path, t=(0, 100.0), every=10**6).times[-1] == 100.0


class Counting:
    """A load that remembers how often it was asked."""

    def __init__(self):
        self.times = 0

    def __call__(self, now):
        self.times += 1
        return 0.1 * self.times


class Telling(Counting):
    def state(self):
        return {"times": self.times}

    def restore(self, state):
        self.times = state["times"]


def steered(force):
    (beam,) = (frame := scene()).beams
    turn = ub.Turn(ub.ground(0, 0), beam.end, ub.Controller(force))
    return clamped(beam, loads=frame.loads, connectors=[turn])


def test_what_a_controller_remembers_goes_on(path):
    whole = ub.simulate(steered(Telling()), ub.EnergyMomentum(), t=(0, 1), dt=0.1)
    run(path, steered(Telling()), t=(0, 0.5))
    force = Telling()
    longer = run(path, steered(force), t=(0, 1))
    assert force.times == 10
    assert longer.q[-1] == pytest.approx(whole.q[-1], rel=1e-9, abs=1e-12)


def counting_in_a_closure():
    times = 0

    def force(now):
        nonlocal times
        times += 1
        return 0.1 * times

    return force


def listing(asked):
    return lambda now: asked.append(now.t) or 0.1


@pytest.mark.parametrize(
    ("force", "message"),
    [
        (Counting(), "law.force.times is 1.0, at the beginning 0.0"),
        (counting_in_a_closure(), "law.force.times is 1.0, at the beginning 0.0"),
        (listing([]), "law.force.asked is 1 in a row, at the beginning 0 in a row"),
    ],
    ids=["object", "closure", "list"],
)
def test_what_is_not_told_would_be_lost(force, message, path):
    """Said after the first step and not after the first crash."""
    with raises(message, "state() and restore(state)") as error:
        run(path, steered(force), every=100)
    assert len(error.value.solution.times) == 2


def test_random_generators_go_on(path):
    """Those that functions use are found; others are named."""

    def noisy():
        used = np.random.default_rng(1)
        return used, steered(lambda now: 0.1 * used.normal())

    other, legacy = np.random.Generator(np.random.MT19937(2)), np.random.RandomState(3)
    used, frame = noisy()
    run(path, frame, also=[other, legacy])
    expected = [x.normal() for x in (used, other, legacy)]
    used, frame = noisy()
    other.normal(size=7)
    run(path, frame, also=[other, legacy])
    assert [x.normal() for x in (used, other, legacy)] == expected


class Odd(Telling):
    def state(self):
        return {1j}


class Deaf(ub.extend.Recorder):
    def open(self, simulation):
        pass

    def write(self, simulation):
        pass


def test_what_cannot_go_on_is_refused(path, on_first_rank):
    with raises("must consist of numbers, texts, lists and dicts"):
        run(path, steered(Odd()))
    with raises("Deaf: this recorder cannot continue"):
        run(path, record=Deaf())
    table = path.with_suffix(".csv")
    run(path, record=ub.History(table))
    on_first_rank(lambda: table.write_text("t\n0\n"))
    with raises("it differs from the file at the checkpoint"):
        run(path, record=ub.History(table))


def test_by_the_clock(path, on_first_rank):
    """Each step takes longer than no minutes: there is a checkpoint of each step before."""
    steps = itertools.count()

    def look(simulation):
        MPI.COMM_WORLD.Barrier()
        done = next(steps)
        assert done == 0 or len(read(path)["history/q"]) == done + 1
        MPI.COMM_WORLD.Barrier()

    checkpoint = ub.Checkpoint(path, minutes=0.0)
    scheme, record = ub.EnergyMomentum(), AfterEachStep(look)
    ub.simulate(scene(), scheme, t=(0, 0.5), dt=0.1, checkpoint=checkpoint, record=record)
    assert on_first_rank(lambda: len(read(path)["history/q"])) == 6


AMPLITUDE = 2.0


def described(value):
    return Description({"x": value}).texts


def test_numbers_that_are_equal_are_described_alike():
    assert described(2) == described(2.0) == described(np.float64(2)) == {"x": "2.0"}
    assert described(math.inf) == {"x": "inf"}
    assert described(0.1) != described(0.1 + 1e-17 * 10)
    assert described(2**53) != described(2**53 + 1)


def test_functions_are_described_by_what_they_use(monkeypatch):
    def waves(a, b=3.0):
        return lambda t, c=b: AMPLITUDE * a * t * c

    once = described(waves(1.0))
    assert once == described(waves(1.0))
    assert difference(described(waves(2.0)), once) == "x.a is 2.0, in the file 1.0"
    assert "x.defaults[0] is 4.0" in difference(described(waves(1.0, 4.0)), once)
    monkeypatch.setitem(globals(), "AMPLITUDE", 3.0)
    assert difference(described(waves(1.0)), once) == "x.AMPLITUDE is 3.0, in the file 2.0"
    assert difference(described(lambda t: t), described(lambda t: t + 1)) == (
        "the function x has changed"
    )
    for make, name in (
        (lambda x: partial(operator.add, x), "x.args[0]"),
        (lambda x: MethodType(waves, SimpleNamespace(size=x)), "x.self.size"),
    ):
        found = difference(described(make(2.0)), described(make(1.0)))
        assert found == f"{name} is 2.0, in the file 1.0"
    assert difference({}, {"x": "1.0"}) == "x is 1.0 in the file, and there is none now"


def test_what_contains_itself_and_arrays_and_dicts():
    circle = []
    circle.append(circle)
    assert described(circle)["x[0]"] == "the same as x"
    arrays = described({"a": np.zeros(3)}), described({"a": np.ones(3)})
    assert difference(*arrays).startswith("x['a'] is float64 of shape (3,)")
    names = described({"a": 1}), described({"b": 1})
    assert difference(*names) == "x['a'] is 1.0, in the file there is none"


def test_the_last_step_of_cells_that_the_first_process_does_not_have():
    """Second differences are those of elastic cells, here the last ones of the scene."""
    numbers = {"EA": 1e4, "GA": 4e3, "EI": 10.0, "rhoA": 1.0, "rhoI": 0.01}
    yielding = ub.Section(**numbers, bending=ub.ElastoPlastic(50.0))
    first = ub.Beam((0, 0), (1, 0), yielding, cells=4)
    last = ub.Beam((1, 0), (2, 0), ub.Section(**numbers), cells=4)
    load = ub.PointLoad(last.end, force=(0, -5.0))
    scene = rigid_chain([first, last], supports=[ub.Clamped(first.start)], loads=[load])
    runs = [ub.Simulation(scene, ub.EnergyMomentumDecaying()) for _ in range(2)]
    for n in range(1, 6):
        runs[0].step_to(0.01 * n)
    archive = Archive(runs[0].subdomain)
    runs[0].save_or_restore(archive)
    runs[1].save_or_restore(Archive(runs[1].subdomain, archive.state()))
    for one in runs:
        one.step_to(0.06)
    assert np.array_equal(*(one.q for one in runs))
    for one in runs:
        one.close()


def test_events_of_connector_laws_go_on(path):
    """A hinge unloads before the restart and yields after it; works of all components count."""
    section = ub.Section.rectangle(0.05, 0.1, E=210e9, nu=0.3, rho=7850.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    law = st.AxialBendingHinge(1e9, 2e3, along=1e8, across=1e8, turning=1e5)
    foot = ub.Bushing(ub.ground(0, 0), beam.start, law)
    table = ub.Table((0.0, 0.5, 1.0, 2.0), (0.0, 1.9e3, 0.0, 2.1e3))
    push = ub.PointLoad(beam.end, moment=1.0, amplitude=table)
    stop = ub.Turn(ub.ground(0, 0), beam.start, ub.Spring(1e3))  # beyond the limit of the hinge
    pushed = ub.Scene([beam], connectors=[foot, stop], loads=[push])

    def events(t, **more):
        recorder = ub.Events()
        run = ub.simulate(pushed, ub.Static(), t=(0, t), dt=0.1, record=recorder, **more)
        return run, [(event.time, event.where, event.what) for event in recorder.found]

    whole, expected = events(2.0)
    _, before = events(1.0, checkpoint=ub.Checkpoint(path, every=1))
    _, after = events(2.0, checkpoint=ub.Checkpoint(path, every=1))
    (row,) = st.hinge_table(whole).rows
    assert (before, after) == ([], expected) == ([], [(row.time, foot, "yields")])
