# SPDX-License-Identifier: MIT
"""Files of runs: no two outputs share one, errors name them, and kills leave complete steps."""

import errno
import os
import resource
from functools import partial
from pathlib import Path
from types import SimpleNamespace

from mpi4py import MPI

import h5py
import numpy as np
import pytest
from helpers import at_step, raises
from scenes import SECTION, clamped
from time_series import read_vtkhdf, read_xdmf

import ufl_beam as ub
from ufl_beam.output.output_files import OutputFile, read, require_writable
from ufl_beam.output.paraview_files import PAGE
from ufl_beam.simulation.checkpoint import FORMAT

READERS = {ub.XDMF: read_xdmf, ub.VTKHDF: read_vtkhdf}


def scene():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="left")
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, -3))])


def run(*record, steps=5, dt=0.1, **more):
    scheme = ub.EnergyMomentum()
    return ub.simulate(scene(), scheme, t=(0, steps * dt), dt=dt, record=record, **more)


# -- files that two outputs would write ------------------------------------------------------------


class Notes(ub.extend.Recorder):
    """A recorder of a user that states its file."""

    def __init__(self, path):
        self.path = path

    @property
    def files(self):
        return (self.path,)

    def open(self, simulation):
        pass

    def write(self, simulation):
        pass


COLLISIONS = {
    "two tables": lambda d: [ub.History(d / "a.csv"), ub.History(d / "a.csv")],
    "other words": lambda d: [ub.History(d / "a.csv"), ub.History(f"{d}/x/.././a.csv")],
    "symbolic link": lambda d: [ub.History(d / "a.csv"), ub.History(d / "link.csv")],
    "hard link": lambda d: [ub.History(d / "a.csv"), ub.History(d / "hard.csv")],
    "XDMF": lambda d: [ub.XDMF(d / "a.xdmf"), ub.XDMF(d / "a.xdmf", every=2)],
    "VTKHDF": lambda d: [ub.VTKHDF(d / "a.hdf"), ub.VTKHDF(d / "a.hdf")],
    "copy of VTKHDF": lambda d: [ub.VTKHDF(d / "a.hdf"), ub.History(d / "a.hdf.part")],
    "of a user": lambda d: [ub.History(d / "a.csv"), Notes(d / "a.csv")],
    "table being thinned": lambda d: [ub.History(d / "a.csv", max_rows=3), Notes(d / "a.csv.part")],
}


@pytest.mark.parametrize("kind", COLLISIONS)
def test_outputs_that_share_a_file_are_refused(kind, shared_path, on_first_rank):
    """Named before anything is written; what is there stays as it is."""

    def prepare():
        (shared_path / "x").mkdir()
        (shared_path / "a.csv").write_text("old")
        (shared_path / "link.csv").symlink_to("a.csv")
        os.link(shared_path / "a.csv", shared_path / "hard.csv")

    on_first_rank(prepare)
    with raises("record[0] (", ") and record[1] (", ") would"):
        run(*COLLISIONS[kind](shared_path))
    names = on_first_rank(lambda: sorted(p.name for p in shared_path.iterdir()))
    assert names == ["a.csv", "hard.csv", "link.csv", "x"]
    assert on_first_rank((shared_path / "a.csv").read_text) == "old"


def test_the_same_recorder_twice(shared_path):
    table = ub.History(shared_path / "a.csv")
    with raises("record[0] and record[2] are the same History"):
        run(table, ub.Events(), table)
    with raises("follow: record[0] and record[1] are the same"):
        ub.follow(scene(), ub.LoadControl(0.5), record=[table, table])


@pytest.mark.parametrize(
    "recorder", [ub.History, lambda path: ub.VTKHDF(path.with_suffix("")), Notes]
)
def test_a_checkpoint_shares_no_file(recorder, shared_path):
    path = shared_path / "a.hdf.part"
    with raises(f"and checkpoint would both write {path}"):
        run(recorder(path), checkpoint=ub.Checkpoint(path, every=2))


def test_devices_may_be_shared():
    run(ub.History("/dev/null"), ub.History("/dev/null"))  # is not refused


def test_the_file_of_a_study_is_not_that_of_a_member(shared_path):
    path = shared_path / "study.h5"

    def member(x):
        run(ub.History(path), steps=1)
        return {"x": x}

    with raises("study and record[0] (History) would both write", kind=RuntimeError):
        ub.study(member, [{"x": 1.0}, {"x": 2.0}], path=path)
    run(ub.History(path), steps=1)  # afterwards it is free again


@pytest.mark.parametrize(
    ("path", "message"),
    [("a\0b.csv", "embedded null"), ("x" * 300, "cannot be written: File name too long")],
)
def test_names_that_are_none(path, message, shared_path, monkeypatch):
    monkeypatch.chdir(shared_path)
    with raises(message):
        run(ub.History(path))


def test_a_check_makes_no_file_that_a_kill_could_leave(tmp_path):
    os.utime(tmp_path, (0, 0))
    require_writable(tmp_path / "a.csv")
    assert tmp_path.stat().st_mtime == 0


def test_names_with_odd_characters(shared_path, on_first_rank):
    for name in ('a&b<c>".xdmf', " a b\n.xdmf", "ü✓.xdmf"):
        run(ub.XDMF(shared_path / name), steps=1)
        assert len(on_first_rank(lambda name=name: read_xdmf(shared_path / name)).times) == 2


# -- what a step costs -----------------------------------------------------------------------------


@pytest.mark.serial
@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="Linux counts transferred bytes")
@pytest.mark.parametrize("recorder", READERS)
def test_a_step_costs_the_same_at_any_time(recorder, tmp_path):
    """Bytes and system calls of the steps 50 to 550 beside those of the steps 550 to 1050.

    A file that is copied or read again in each step transfers three times as much in the second
    half.  A factor of 1.5 covers buffers that are filled in one half and written in the other.
    """
    beam = ub.Beam((0, 0), (4, 0), SECTION, cells=8)
    simulation = ub.Simulation(clamped(beam), ub.EnergyMomentum())
    file = recorder(tmp_path / f"a{recorder.endings[0]}")
    file.open(simulation)
    transferred = []
    for n in range(1051):
        if n in (50, 550, 1050):
            lines = Path("/proc/self/io").read_text().splitlines()[:4]
            transferred.append([int(line.split()[1]) for line in lines])
        file.write(simulation)
    file.close()
    simulation.close()
    first, second = np.diff(transferred, axis=0)
    assert np.all(second < 1.5 * first + 1000), (first, second)


@pytest.mark.serial
def test_checkpoints_hold_no_copies_of_files(tmp_path):
    """Their size is the same with files and without, but for some numbers and names."""
    sizes = []
    for record in ([], [ub.XDMF(tmp_path / "a.xdmf"), ub.VTKHDF(tmp_path / "a.vtkhdf")]):
        path = tmp_path / f"{len(record)}.checkpoint"
        run(*record, steps=200, dt=0.01, checkpoint=ub.Checkpoint(path, every=50))
        sizes.append(path.stat().st_size)
    assert (tmp_path / "a.xdmf").stat().st_size > 100_000
    assert sizes[1] - sizes[0] < 10_000


# -- files that are removed, full disks ------------------------------------------------------------


def remove(path):
    """A recorder that removes a file after three steps."""
    return at_step(3, lambda: MPI.COMM_WORLD.rank == 0 and path.unlink())


each_file = pytest.mark.parametrize(
    ("recorder", "name"), [(ub.History, "a.csv"), (ub.XDMF, "a.xdmf"), (ub.VTKHDF, "a.vtkhdf")]
)


@pytest.mark.filterwarnings("ignore:output .* was removed:RuntimeWarning")
@each_file
def test_a_file_that_was_removed_before_a_checkpoint(recorder, name, shared_path, on_first_rank):
    path = shared_path / name
    checkpoint = ub.Checkpoint(shared_path / "a.checkpoint", every=2)
    words = f"output {path} was removed ", "the checkpoint before is kept"
    with raises(*words, kind=FileNotFoundError) as error:
        run(recorder(path), remove(path), checkpoint=checkpoint)
    assert len(error.value.solution.times) == 5
    kept = on_first_rank(lambda: read(shared_path / "a.checkpoint", FORMAT))
    assert len(kept["history/q"]) == 3
    with raises("it differs from the file at the checkpoint"):
        run(recorder(path), remove(path), checkpoint=checkpoint)


@pytest.mark.serial
@each_file
def test_a_file_that_was_removed_otherwise(recorder, name, tmp_path):
    """The run goes on to its end, and a warning says what is lost."""
    with pytest.warns(RuntimeWarning, match=rf"output \S*{name} was removed or replaced"):
        solution = run(recorder(tmp_path / name), remove(tmp_path / name))
    assert len(solution.times) == 6


def test_a_device_that_is_full():
    with raises("output /dev/full cannot be written: No space left", kind=OSError) as error:
        run(ub.History("/dev/full"))
    assert error.value.errno == errno.ENOSPC


@pytest.mark.serial
@pytest.mark.parametrize(
    ("recorder", "limit"), [(ub.History, 100_000), (ub.XDMF, 300_000), (ub.VTKHDF, 2_000_000)]
)
def test_a_disk_that_is_full(recorder, limit, tmp_path):
    """As on a full disk, by a limit on files: the steps before are there, and the solution.

    VTKHDF allocates its space before HDF5 needs it; else the interpreter died here.
    """
    path = tmp_path / f"a{getattr(recorder, 'endings', ['.csv'])[0]}"
    run(recorder(path), steps=1)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limits[1]))
    try:
        with raises(f"output {path}", " cannot be written: ", "before is", kind=OSError) as error:
            run(recorder(path), steps=10_000, dt=1e-4)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    reached = len(error.value.solution.times)
    assert reached > 100
    if recorder is ub.History:
        assert len(path.read_bytes().splitlines()) == reached
    else:
        # The step that failed is in the solution and not in the file
        assert len(READERS[recorder](path).times) == reached - 1


# -- interrupts and kills --------------------------------------------------------------------------

LINES = SimpleNamespace(points=np.eye(3), cells=np.array([[0, 1], [1, 2]]), kinds=np.zeros(2))


def fields(n):
    return {"u": np.full((3, 3), n / 7)}, {"N": np.full(2, 1.0 * n)}


def writer_of(path, complete=(), digest=None):
    """A recorder whose file is open without a step, or with those of a state."""
    writer = (ub.XDMF if path.suffix == ".xdmf" else ub.VTKHDF)(path)
    writer._scene = LINES
    writer._begin((0.0, fields(0)), complete, digest)
    return writer


def write(writer, steps):
    for n in steps:
        writer._append((0.5 * n, fields(n)))


def require_steps(path, count=None):
    """All steps are there with their numbers; their count."""
    found = (read_xdmf if path.suffix == ".xdmf" else read_vtkhdf)(path)
    count = len(found.times) if count is None else count
    assert found.times == [0.5 * n for n in range(count)]
    for n in range(count):
        assert (found.of("u")[n] == n / 7).all()
        assert (found.of("N")[n] == n).all()
    return count


class Killed(BaseException):
    """A kill in a write."""


def torn(monkeypatch, act, n, pages):
    """Act until, in the n-th write, a kill comes after some pages, which kernels copy singly."""
    put, left = os.pwrite, [n]

    def pwrite(file, data, at):
        left[0] -= 1
        if left[0] >= 0:
            return put(file, data, at)
        put(file, data[: max((at // PAGE + pages) * PAGE - at, 0)], at)
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", pwrite)
        with pytest.raises(Killed):
            act()


@pytest.mark.serial
def test_xdmf_is_complete_whenever_a_kill_comes(tmp_path, monkeypatch):
    """Torn at each write of some steps; then the run goes on from five steps before."""
    path, first, kept = tmp_path / "a.xdmf", 20, []
    writer = writer_of(path)
    for n in range(first + 1):
        kept.append((writer.complete, writer._sync()))
        write(writer, [n] if n < first else [])
    writer.close()
    begin = path.read_bytes()

    def again():
        writer = writer_of(path, *kept[-6])
        write(writer, range(first - 5, first))
        return writer

    for n in range(40):
        for pages in (0, 1, 2):
            path.write_bytes(begin)
            writer = writer_of(path, *kept[-1])
            torn(monkeypatch, partial(write, writer, range(first, first + 99)), n, pages)
            # Complete, and perhaps not yet counted
            assert 0 <= require_steps(path) - writer.complete[0] <= 1
        if n % 7:
            continue
        for m in range(6):  # also while it is taken back
            torn(monkeypatch, again, m, 1)
            require_steps(path)
        again().close()
        assert path.read_bytes() == begin


@pytest.mark.serial
@pytest.mark.parametrize("goes_on", [False, True])
@pytest.mark.parametrize(
    ("name", "owner", "call", "n"),
    [("a.xdmf", os, "pwrite", 15), ("a.vtkhdf", ub.VTKHDF, "_put", 40)],
)
def test_an_interrupt_in_a_write(name, owner, call, n, goes_on, tmp_path, monkeypatch):
    """Ctrl-C in a write: closed, or gone on with, the file has all complete steps."""
    write_data, calls = getattr(owner, call), []

    def interrupted(*arguments):
        calls.append(arguments)
        if len(calls) == n:
            raise KeyboardInterrupt
        return write_data(*arguments)

    writer = writer_of(tmp_path / name)
    monkeypatch.setattr(owner, call, interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(writer, range(10))
    steps = writer.complete[0]
    assert 0 < steps < 10
    if goes_on:
        write(writer, [steps])
    writer.close()
    require_steps(tmp_path / name, steps + goes_on)


@pytest.mark.serial
def test_vtkhdf_never_has_more_times_than_steps(tmp_path, monkeypatch):
    """VTK 9.3 dies of them: a kill between any two flushes, read as it is then."""
    path, flush, found = tmp_path / "a.vtkhdf", h5py.File.flush, set()

    def look(self):
        flush(self)
        # A copy: readers must not share an open file with the writer
        (tmp_path / "copy.vtkhdf").write_bytes(path.read_bytes())
        with h5py.File(tmp_path / "copy.vtkhdf") as file:
            steps = file["VTKHDF/Steps"]
            found.add((int(steps.attrs["NSteps"]), len(steps["Values"])))

    writer = writer_of(path)
    monkeypatch.setattr(h5py.File, "flush", look)
    write(writer, [0])
    digest = writer._sync()
    write(writer, [1, 2])
    writer.close()
    assert found == {(n, n) for n in range(4)}
    found.clear()
    writer_of(path, (1,), digest).close()
    assert found == {(3, 3), (1, 1)}  # the file before, and the one in its place


@pytest.mark.serial
def test_an_interrupt_in_a_row_of_a_table(tmp_path, monkeypatch):
    put = OutputFile.put

    def interrupted(self, at, data):
        put(self, at, data[:10] if data.startswith(b"0.3") else data)
        if data.startswith(b"0.3"):
            raise KeyboardInterrupt

    monkeypatch.setattr(OutputFile, "put", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(ub.History(tmp_path / "a.csv"))
    rows = (tmp_path / "a.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows] == ["t [s]", "0.0", "0.1", "0.2"]
    assert len({row.count(",") for row in rows}) == 1


def test_recorders_close_also_when_one_fails(shared_path):
    class Bad(Notes):
        def close(self):
            raise RuntimeError("cannot close")

    table = ub.History(shared_path / "a.csv")
    with raises("cannot close", kind=RuntimeError):
        run(Bad(shared_path / "notes"), table, steps=1)
    if MPI.COMM_WORLD.rank == 0:
        with raises("Bad file descriptor", kind=OSError):
            os.fstat(table._file._file)
