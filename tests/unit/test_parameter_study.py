# SPDX-License-Identifier: MIT
"""Studies: the same on any number of ranks, no member fatal, nothing lost, nothing done twice."""

import json
import math
import os
import shutil
import subprocess
import sys

from mpi4py import MPI

import h5py
import numpy as np
import pytest
from helpers import raises
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


FORCES = [{"force": force} for force in (1.0, 3.0, 10.0, -0.1, math.pi)]


def numbers(*x):
    return [{"x": x} for x in x]


def bits(study):
    return {name: (x.shape, x.tobytes()) for name, x in study.results.items()}


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


def test_results_are_in_the_order_of_cases():
    study = ub.study(square, numbers(3, 1.5, -2, np.float64(0.5), np.int64(4)))
    assert (study["square"] == [9, 2.25, 4, 0.25, 16]).all()
    assert study["powers"].shape == (5, 4)
    assert (study["powers"][2] == [1, -2, 4, -8]).all()
    assert study.cases == ({"x": 3}, {"x": 1.5}, {"x": -2}, {"x": 0.5}, {"x": 4})
    assert len(study) == 5
    assert study.member == "square"
    assert study.seconds.shape == (5,)
    assert (study.seconds > 0).all()
    assert study.failed == {}


def test_members_are_the_same_on_any_number_of_ranks():
    """To the last bit: each is computed by one process, as if there were no others."""
    together = ub.study(pushed, FORCES)
    alone = ub.study(pushed, FORCES, comm=MPI.COMM_SELF)
    assert bits(together) == bits(alone)
    assert len(set(map(repr, COMM.allgather(bits(together))))) == 1
    for i, case in enumerate(FORCES):
        by_hand = pushed(**case)
        # Outside of a study the tests share the small scene among all ranks, which sum in another
        # order; displacements are below 1 m, Newton's method ends below 1e-10 of the forces.
        assert np.abs(together["history"][i] - by_hand["history"]).max() < 1e-10
        assert together["steps"][i] == by_hand["steps"]


def test_each_case_is_computed_once(counted):
    ub.study(counted(square), numbers(*range(7)))
    assert counted.calls() == numbers(*range(7))


def test_members_need_not_pickle():
    offset = 10.0
    assert (ub.study(lambda x: {"y": x + offset}, numbers(1, 2))["y"] == [11, 12]).all()


def test_a_member_has_its_process_for_itself(shared_path):
    def member(force):
        simulation = ub.Simulation(post(force), ub.EnergyMomentum())
        simulation.close()
        files = [ub.XDMF(shared_path / f"{force}.xdmf"), ub.History(shared_path / f"{force}.csv")]
        return {"processes": simulation.comm.size, **pushed(force, files)}

    assert (ub.study(member, FORCES)["processes"] == 1).all()
    for case in FORCES:
        # A header, the initial state and five steps
        assert len((shared_path / f"{case['force']}.csv").read_text().splitlines()) == 7
        assert (shared_path / f"{case['force']}.xdmf").exists()
    assert active_comm() == COMM
    simulation = ub.Simulation(post(), ub.EnergyMomentum())
    assert simulation.comm.size == COMM.size
    simulation.close()


def test_a_study_in_a_member_is_its_own():
    def row(x):
        return {"row": ub.study(square, [{"x": x + i} for i in range(3)])["square"]}

    assert (ub.study(row, numbers(0, 5))["row"] == [[0, 1, 4], [25, 36, 49]]).all()


# -- failures ----------------------------------------------------------------------------------


def fragile(x):
    if x == 2:
        raise ub.ConvergenceError(
            "no equilibrium", time=0.0, dt=1.0, solution=None, residuals={}, forces={}
        )
    if x == 3:
        raise ub.ArgumentError("x = 3 is no scene")
    return square(x)


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


def test_a_simulation_that_fails():
    """A cantilever that ten steps of one iteration cannot follow."""

    def member(iterations):
        scene = post(force=1e4)
        newton = ub.Newton(max_iterations=iterations)
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, newton=newton)
        return {"good": 1.0}

    study = ub.study(member, [{"iterations": 50}, {"iterations": 1}])
    assert list(study.failed) == [1]
    assert study.failed[1].startswith("ConvergenceError: ")


def test_all_members_fail(shared_path):
    with raises("all 2 members failed", "no equilib", kind=RuntimeError):
        ub.study(fragile, numbers(2, 3), path=shared_path / "a.h5")
    assert len(ub.Study.load(shared_path / "a.h5").failed) == 2


# -- the file ----------------------------------------------------------------------------------


def test_a_study_is_loaded_as_it_was(shared_path):
    cases = [{"force": f, "text": "Träger", "list": [1, 0.1]} for f in (1.0, 2.0, 0.3)]

    def member(force, text, list):
        if force == 2.0:
            raise ValueError(text)
        return pushed(force)

    study = ub.study(member, cases, path=shared_path / "a.h5")
    loaded = ub.Study.load(shared_path / "a.h5")
    assert bits(loaded) == bits(study)
    assert loaded.cases == study.cases
    assert loaded.cases[1]["list"] == [1, 0.1]
    assert loaded.failed == study.failed == {1: "ValueError: Träger"}
    assert (loaded.seconds == study.seconds).all()
    assert str(loaded) == str(study)
    COMM.barrier()
    assert [path.name for path in shared_path.iterdir()] == ["a.h5"]


def test_numpy_reads_the_file(shared_path, on_first_rank):
    ub.study(square, numbers(1, 2), path=shared_path / "a.h5")

    def read():
        with np.load(shared_path / "a.h5") as file:
            return json.loads(file["text.json"])["cases"], file["results/powers"].tolist()

    assert on_first_rank(read) == (['{"x": 1}', '{"x": 2}'], [[1, 1, 1, 1], [1, 2, 4, 8]])


def test_a_study_goes_on(shared_path, counted):
    path = shared_path / "a.h5"
    first = ub.study(counted(pushed), FORCES[:3], path=path)
    assert len(counted.calls()) == 3
    more = ub.study(counted(pushed), FORCES[::-1], path=path)
    assert counted.calls() == sorted(FORCES[3:], key=repr)
    assert more.cases == tuple(FORCES[::-1])
    assert (more["history"][::-1][:3] == first["history"]).all()
    assert bits(more) == bits(ub.study(pushed, FORCES[::-1]))

    # Cases that are not asked for stay in the file
    assert len(ub.study(counted(pushed), FORCES[1:2], path=path)) == 1
    assert counted.calls() == []
    assert len(ub.Study.load(path)) == 5
    COMM.barrier()

    ub.study(counted(pushed), FORCES[1:2], path=path, anew=True)
    assert counted.calls() == FORCES[1:2]
    assert len(ub.Study.load(path)) == 1


def test_failed_members_are_tried_again(shared_path, counted):
    path = shared_path / "a.h5"
    broken = [2, 3]

    def member(x):
        return fragile(x) if x in broken else square(x)

    assert list(ub.study(member, numbers(1, 2, 3), path=path).failed) == [1, 2]
    broken.pop()
    study = ub.study(counted(member), numbers(1, 2, 3), path=path)
    assert counted.calls() == numbers(2, 3)
    assert list(study.failed) == [1]
    assert study["square"][2] == 9


def test_cases_are_compared_exactly(shared_path, counted):
    def member(**case):
        return {"one": 1}

    path = shared_path / "a.h5"
    ub.study(member, [{"a": 0.1, "b": 1}, {"a": math.nan}, {"a": (1, 2)}], path=path)
    same = [{"b": 1, "a": 0.1}, {"a": math.nan}, {"a": np.array([1, 2])}]
    near = [{"a": math.nextafter(0.1, 1), "b": 1}, {"a": 0.1, "b": True}, {"a": 0.1}]
    assert len(ub.study(counted(member), same + near, path=path)) == 6
    assert len(counted.calls()) == 3


@pytest.mark.serial
def test_the_file_is_written_on_the_way(tmp_path):
    path = tmp_path / "a.h5"

    def member(x):
        found = len(ub.Study.load(path))
        if x == 2:
            raise KeyboardInterrupt
        return {"found": found}

    with pytest.raises(KeyboardInterrupt):
        ub.study(member, numbers(0, 1, 2, 3), path=path)
    kept = ub.Study.load(path)
    assert kept.cases == ({"x": 0}, {"x": 1})  # also what came less than 20 writings ago
    assert (kept["found"] == [0, 1]).all()  # the first member at once
    assert active_comm() == COMM


# -- errors ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("member", "cases", "says"),
    [
        ("square", numbers(1), ("member = 'square' must be a function of the names in",)),
        (square, [], ("cases is empty",)),
        (square, 3, ("cases = 3 must be a list",)),
        (square, [{"x": 1}, 2], ("cases[1] = 2 is not a dict",)),
        (square, [{1: 2}], ("cases[0]: name = 1 is not a str",)),
        (square, [{"x": SECTION}], ("cases[0]", "values must be numbers, texts or lists")),
        (square, numbers(1, 2, 1), ("cases[2] = {'x': 1} occurs twice",)),
    ],
)
def test_wrong_calls_are_refused(member, cases, says):
    with raises("study: ", *says):
        ub.study(member, cases)


@pytest.mark.parametrize(
    ("returned", "says"),
    [
        (None, ("returned None; return a dict",)),
        ({}, ("returned {}; return a dict",)),
        ({"u": None}, ("returned u = None, which is no number",)),
        ({"u": "1"}, ("returned u = '1', which is no number",)),
        ({"u": [[1], [1, 2]]}, ("returned u = [[1], [1, 2]]",)),
        ({"u": 1j}, ("returned u = 1j",)),
        ({1: 1.0}, ("returned 1, which names no result",)),
        ({"a/b": 1.0}, ("returned 'a/b', which names no result",)),
    ],
)
def test_what_members_return(returned, says):
    with raises("study: {'x': 0}", *says):
        ub.study(lambda x: returned, numbers(0))
    assert active_comm() == COMM


@pytest.mark.parametrize("other", [{"u": 1.0}, {"v": [1.0, 2]}, {"u": 1.0, "w": 2.0}])
def test_members_that_return_different_things(other, shared_path):
    path = shared_path / "a.h5"
    ub.study(lambda x: {"u": [1.0, 2.0]}, numbers(0), path=path)
    with raises("study: {'x': 1} returned names and shapes", "but {\"x\": 0} {'u': (2,)}"):
        ub.study(lambda x: other, numbers(0, 1), path=path)
    assert len(ub.Study.load(path)) == 1


def test_unknown_results_are_named():
    with raises("no result 'cube'; there is powers, square"):
        ub.study(square, numbers(1))["cube"]


def test_files_that_cannot_be_written(shared_path, on_first_rank, counted):
    with raises("nowhere", "there is no directory", "make it first"):
        ub.study(counted(square), numbers(1), path=shared_path / "nowhere" / "a.h5")
    on_first_rank(lambda: (shared_path / "a.h5.part").mkdir())
    with raises("a.h5 cannot be written: Is a directory", kind=OSError):
        ub.study(counted(square), numbers(1), path=shared_path / "a.h5")
    assert counted.calls() == []


def test_files_that_are_no_studies(shared_path, on_first_rank):
    with raises("a.h5: there is no such file"):
        ub.Study.load(shared_path / "a.h5")
    COMM.barrier()
    on_first_rank(lambda: (shared_path / "a.h5").write_text("notes"))
    on_first_rank(lambda: h5py.File(shared_path / "b.h5", "w").close())
    ub.study(square, numbers(*range(20)), path=shared_path / "c.h5")

    def cut():
        whole = (shared_path / "c.h5").read_bytes()
        (shared_path / "c.h5").write_bytes(whole[: len(whole) // 2])

    on_first_rank(cut)
    for name in ("a.h5", "b.h5", "c.h5"):
        before = (shared_path / name).read_bytes()
        for anew in (False, True):
            with raises(name, "the file holds no study of ufl_beam, or is damaged"):
                ub.study(square, numbers(1), path=shared_path / name, anew=anew)
        assert (shared_path / name).read_bytes() == before


def test_files_of_another_member(shared_path):
    ub.study(square, numbers(1), path=shared_path / "a.h5")
    with raises("a.h5 has results of square, not of fragile"):
        ub.study(fragile, numbers(1), path=shared_path / "a.h5")


# -- mpirun ------------------------------------------------------------------------------------

SCRIPT = """
import ufl_beam as ub

def member(x):
    scene = ub.Beam((0, 0), (1, 0), ub.Section(EA=1.0, GA=1.0, EI=1.0), cells=2)
    if x == 3:
        raise ValueError("three")
    return {"square": x**2}

study = ub.study(member, [{"x": x} for x in range(6)], path="study.h5")
assert list(study.failed) == [3]
ub.print_once(study["square"].tolist())
"""


@pytest.mark.serial
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
@pytest.mark.parametrize("ranks", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_a_script_under_mpirun(ranks, tmp_path):
    """Its member is defined in the script itself."""
    (tmp_path / "script.py").write_text(SCRIPT)
    # As Makefile sets them, and not what MPI has put into the environment of this process
    environment = dict(os.environ)
    environment |= {f"OMPI_ALLOW_RUN_AS_ROOT{more}": "1" for more in ("", "_CONFIRM")}
    for name in ("rmaps_default_mapping_policy", "mapby"):
        environment[f"PRTE_MCA_{name}"] = ":oversubscribe"
    ran = subprocess.run(
        ["mpirun", "-n", str(ranks), sys.executable, "script.py"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == 0, ran.stderr
    assert "1 failed\n  failed: {'x': 3}: ValueError: three\n" in ran.stdout
    assert "[0.0, 1.0, 4.0, nan, 16.0, 25.0]" in ran.stdout
    assert len(ub.Study.load(tmp_path / "study.h5")) == 6
