# SPDX-License-Identifier: MIT
"""Studies: the same on any number of ranks, no member fatal, nothing lost, nothing done twice."""

import json
import math

from mpi4py import MPI

import numpy as np
import pytest
from helpers import needs_mpirun, on_two_processes, raises
from scenes import SECTION, clamped

import ufl_beam as ub
from ufl_beam.parallel import active_comm

COMM = MPI.COMM_WORLD


def post(force=1.0):
    beam = ub.Beam((0, 0), (0, 2), SECTION, cells=3)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(force, 0))])


def pushed(force, record=()):
    """A member that simulates; its numbers have all 53 bits."""
    scene = post(force)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.02, record=record)
    u = solution.displacement(scene.beams[0].end)[:, 0]
    return {"history": u, "peak": u.max(), "steps": solution.substeps}


def square(x):
    """A member that costs nothing."""
    return {"square": x**2, "powers": x ** np.arange(4)}


def fragile(x):
    if x == 2:
        raise ub.ConvergenceError(
            "no equilibrium", time=0.0, dt=1.0, solution=None, residuals={}, forces={}
        )
    if x == 3:
        raise ub.ArgumentError("x = 3 is no scene")
    return square(x)


FORCES = [{"force": force} for force in (1.0, 3.0, 10.0, -0.1, math.pi)]


def numbers(*x):
    return [{"x": x} for x in x]


def bits(study):
    return {name: (x.shape, x.tobytes()) for name, x in study.results.items()}


@pytest.fixture
def file(shared_path):
    return shared_path / "a.h5"


@pytest.fixture
def counted():
    """`counted(member)`: the same, remembering its calls; `counted.calls()`: those of all ranks."""
    calls = []

    def wrap(member):
        def called(**case):
            calls.append(case)
            return member(**case)

        called.__name__ = member.__name__
        return called

    def collect():
        found = [case for here in COMM.allgather(calls) for case in here]
        calls.clear()
        return sorted(found, key=repr)

    wrap.calls = collect
    return wrap


# -- results -----------------------------------------------------------------------------------


def test_results_are_in_the_order_of_cases(counted):
    """Each case is computed once; members need not pickle."""
    x = [3, 1.5, -2, np.float64(0.5), np.int64(4)]
    study = ub.study(counted(square), numbers(*x))
    assert (study["square"] == [9, 2.25, 4, 0.25, 16]).all()
    assert study["powers"].shape == (5, 4)
    assert (study["powers"][2] == [1, -2, 4, -8]).all()
    assert study.cases == ({"x": 3}, {"x": 1.5}, {"x": -2}, {"x": 0.5}, {"x": 4})
    assert len(counted.calls()) == len(study) == 5
    assert study.member == "square"
    assert study.seconds.shape == (5,)
    assert (study.seconds > 0).all()
    assert study.failed == {}
    with raises("no result 'cube'; there is powers, square"):
        study["cube"]


def test_members_are_the_same_on_any_number_of_ranks():
    """To the last bit: each is computed by one process, as if there were no others."""
    together = ub.study(pushed, FORCES)
    alone = ub.study(pushed, FORCES, comm=MPI.COMM_SELF)
    assert bits(together) == bits(alone)
    assert len(set(map(repr, COMM.allgather(bits(together))))) == 1
    by_hand = pushed(**FORCES[-1])
    # Outside of a study the tests share the small scene among all ranks, which sum in another
    # order; displacements are below 1 m, Newton's method ends below 1e-10 of the forces.
    assert np.abs(together["history"][-1] - by_hand["history"]).max() < 1e-10
    assert together["steps"][-1] == by_hand["steps"]


def test_a_member_has_its_process_for_itself(shared_path):
    def processes():
        simulation = ub.Simulation(post(), ub.EnergyMomentum())
        simulation.close()
        return simulation.comm.size

    def member(force):
        files = [ub.XDMF(shared_path / f"{force}.xdmf"), ub.History(shared_path / f"{force}.csv")]
        return {"processes": processes(), **pushed(force, files)}

    assert (ub.study(member, FORCES[:2])["processes"] == 1).all()
    for case in FORCES[:2]:
        # A header, the initial state and five steps
        assert len((shared_path / f"{case['force']}.csv").read_text().splitlines()) == 7
        assert (shared_path / f"{case['force']}.xdmf").exists()
    assert processes() == active_comm().size == COMM.size


def test_a_study_in_a_member_is_its_own():
    def row(x):
        return {"row": ub.study(square, [{"x": x + i} for i in range(3)])["square"]}

    assert (ub.study(row, numbers(0, 5))["row"] == [[0, 1, 4], [25, 36, 49]]).all()


# -- failures ----------------------------------------------------------------------------------


def test_a_failed_member_is_reported_and_not_fatal(capsys):
    study = ub.study(fragile, numbers(1, 2, 3, 4))
    assert study.failed == {
        1: "ConvergenceError: no equilibrium",
        2: "ArgumentError: x = 3 is no scene",
    }
    assert np.array_equal(study["square"], [1, np.nan, np.nan, 16], equal_nan=True)
    assert np.isnan(study["powers"][[1, 2]]).all()
    assert study["powers"].shape == (4, 4)
    said = (
        "study of fragile: 4 members, 2 failed\n"
        "  failed: {'x': 2}: ConvergenceError: no equilibrium\n"
        "  failed: {'x': 3}: ArgumentError: x = 3 is no scene\n"
    )
    assert capsys.readouterr().out == (said if COMM.rank == 0 else "")
    assert active_comm() == COMM


def test_all_members_fail(file):
    """A cantilever that ten steps of one iteration cannot follow."""

    def member(iterations):
        newton = ub.Newton(max_iterations=iterations)
        ub.simulate(post(force=1e4), ub.Static(), t=(0, 1), dt=0.1, newton=newton)

    with raises("all 1 members failed", "ConvergenceError: ", kind=RuntimeError):
        ub.study(member, [{"iterations": 1}], path=file)
    assert len(ub.Study.load(file).failed) == 1


# -- the file ----------------------------------------------------------------------------------


def test_a_study_is_loaded_as_it_was(file, on_first_rank):
    cases = [{"force": f, "text": "Träger", "list": [1, 0.1]} for f in (1.0, 2.0, 0.3)]

    def member(force, text, list):
        if force == 2.0:
            raise ValueError(text)
        return pushed(force)

    study = ub.study(member, cases, path=file)
    loaded = ub.Study.load(file)
    assert bits(loaded) == bits(study)
    assert loaded.cases == study.cases
    assert loaded.cases[1]["list"] == [1, 0.1]
    assert loaded.failed == study.failed == {1: "ValueError: Träger"}
    assert (loaded.seconds == study.seconds).all()
    assert str(loaded) == str(study)
    COMM.barrier()
    assert [path.name for path in file.parent.iterdir()] == ["a.h5"]

    def by_numpy():
        with np.load(file) as arrays:
            return len(json.loads(arrays["text.json"])["cases"]), arrays["results/history"].shape

    assert on_first_rank(by_numpy) == (3, study["history"].shape)


def test_a_study_goes_on(file, counted):
    first = ub.study(counted(pushed), FORCES[:3], path=file)
    assert len(counted.calls()) == 3
    more = ub.study(counted(pushed), FORCES[::-1], path=file)
    assert counted.calls() == sorted(FORCES[3:], key=repr)
    assert more.cases == tuple(FORCES[::-1])
    assert (more["history"][::-1][:3] == first["history"]).all()
    assert bits(more) == bits(ub.study(pushed, FORCES[::-1]))

    # Cases that are not asked for stay in the file
    assert len(ub.study(counted(pushed), FORCES[1:2], path=file)) == 1
    assert counted.calls() == []
    assert len(ub.Study.load(file)) == 5
    COMM.barrier()

    ub.study(counted(pushed), FORCES[1:2], path=file, anew=True)
    assert counted.calls() == FORCES[1:2]
    assert len(ub.Study.load(file)) == 1


def test_failed_members_are_tried_again(file, counted):
    broken = [2, 3]

    def member(x):
        return fragile(x) if x in broken else square(x)

    assert list(ub.study(member, numbers(1, 2, 3), path=file).failed) == [1, 2]
    broken.pop()
    study = ub.study(counted(member), numbers(1, 2, 3), path=file)
    assert counted.calls() == numbers(2, 3)
    assert list(study.failed) == [1]
    assert study["square"][2] == 9


def test_cases_are_compared_exactly(file, counted):
    def member(**case):
        return {"one": 1}

    ub.study(member, [{"a": 0.1, "b": 1}, {"a": math.nan}, {"a": (1, 2)}], path=file)
    same = [{"b": 1, "a": 0.1}, {"a": math.nan}, {"a": np.array([1, 2])}]
    near = [{"a": math.nextafter(0.1, 1), "b": 1}, {"a": 0.1, "b": True}, {"a": 0.1}]
    assert len(ub.study(counted(member), same + near, path=file)) == 6
    assert len(counted.calls()) == 3


@pytest.mark.serial
def test_the_file_is_written_on_the_way(file):
    def member(x):
        found = len(ub.Study.load(file))
        if x == 2:
            raise KeyboardInterrupt
        return {"found": found}

    with pytest.raises(KeyboardInterrupt):
        ub.study(member, numbers(0, 1, 2, 3), path=file)
    kept = ub.Study.load(file)
    assert kept.cases == ({"x": 0}, {"x": 1})  # also what came less than 20 writings ago
    assert (kept["found"] == [0, 1]).all()  # the first member at once
    assert active_comm() == COMM


# -- errors ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cases", "says"),
    [
        ([{1: 2}], ["cases[0]: name = 1 is not a str"]),
        ([{"x": SECTION}], ["cases[0]", "values must be numbers, texts or lists"]),
        (numbers(1, 2, 1), ["cases[2] = {'x': 1} occurs twice"]),
    ],
)
def test_wrong_cases_are_refused(cases, says):
    with raises("study: ", *says):
        ub.study(square, cases)


@pytest.mark.parametrize(
    ("returned", "says"),
    [
        (None, "returned None; return a dict"),
        ({}, "returned {}; return a dict"),
        ({"u": "1"}, "returned u = '1', which is no number"),
        ({"u": [[1], [1, 2]]}, "returned u = [[1], [1, 2]]"),
        ({"u": 1j}, "returned u = 1j"),
        ({1: 1.0}, "returned 1, which names no result"),
        ({"a/b": 1.0}, "returned 'a/b', which names no result"),
    ],
)
def test_what_members_return(returned, says):
    with raises("study: {'x': 0}", says):
        ub.study(lambda x: returned, numbers(0))
    assert active_comm() == COMM


@pytest.mark.parametrize("other", [{"u": 1.0}, {"v": [1.0, 2]}, {"u": 1.0, "w": 2.0}])
def test_members_that_return_different_things(other, file):
    ub.study(lambda x: {"u": [1.0, 2.0]}, numbers(0), path=file)
    with raises("study: {'x': 1} returned names and shapes", "but {\"x\": 0} {'u': (2,)}"):
        ub.study(lambda x: other, numbers(0, 1), path=file)
    assert len(ub.Study.load(file)) == 1


def test_files_that_cannot_be_written(file, on_first_rank, counted):
    with raises("nowhere", "there is no directory", "make it first"):
        ub.study(counted(square), numbers(1), path=file.parent / "nowhere" / "a.h5")
    on_first_rank(file.with_name("a.h5.part").mkdir)
    with raises("a.h5 cannot be written: Is a directory", kind=OSError):
        ub.study(counted(square), numbers(1), path=file)
    assert counted.calls() == []


def test_files_of_another_member(file):
    with raises("a.h5: there is no such file"):
        ub.Study.load(file)
    COMM.barrier()
    ub.study(square, numbers(1), path=file)
    with raises("a.h5 has results of square, not of fragile"):
        ub.study(fragile, numbers(1), path=file)


# -- mpirun ------------------------------------------------------------------------------------

SCRIPT = """
import sys
import ufl_beam as ub

def member(x):
    if x == 3:
        raise ValueError("three")
    return {"square": x**2}

study = ub.study(member, [{"x": x} for x in range(6)], path=sys.argv[1])
assert list(study.failed) == [3]
ub.print_once(study["square"].tolist())
"""


@pytest.mark.serial
@needs_mpirun
def test_a_script_under_mpirun(file):
    """Its member is defined in the script itself."""
    ran = on_two_processes("-c", SCRIPT, file)
    assert ran.returncode == 0, ran.stderr
    assert "1 failed\n  failed: {'x': 3}: ValueError: three\n" in ran.stdout
    assert "[0.0, 1.0, 4.0, nan, 16.0, 25.0]" in ran.stdout
    assert len(ub.Study.load(file)) == 6
