# SPDX-License-Identifier: MIT
"""Files of runs: no two outputs share one, errors name them, and kills leave complete steps."""

import errno
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

from mpi4py import MPI

import h5py
import numpy as np
import pytest
from scenes import SECTION, clamped
from time_series import read_vtkhdf, read_xdmf

import ufl_beam as ub
from ufl_beam.output import output_files
from ufl_beam.output.output_files import OutputFile, read, require_writable
from ufl_beam.output.paraview_files import PAGE
from ufl_beam.simulation.checkpoint import FORMAT


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
    with pytest.raises(
        ub.ArgumentError, match=r"record\[0\] \((.*)\) and record\[1\] \((.*)\) would"
    ):
        run(*COLLISIONS[kind](shared_path))
    names = on_first_rank(lambda: sorted(p.name for p in shared_path.iterdir()))
    assert names == ["a.csv", "hard.csv", "link.csv", "x"]
    assert on_first_rank((shared_path / "a.csv").read_text) == "old"


def test_the_same_recorder_twice(shared_path):
    table = ub.History(shared_path / "a.csv")
    with pytest.raises(ub.ArgumentError, match=r"record\[0\] and record\[2\] are the same History"):
        run(table, ub.Events(), table)
    with pytest.raises(ub.ArgumentError, match=r"follow: record\[0\] and record\[1\] are the same"):
        ub.follow(scene(), ub.LoadControl(0.5), record=[table, table])


@pytest.mark.parametrize(
    "recorder", [ub.History, lambda path: ub.VTKHDF(path.with_suffix("")), Notes]
)
def test_a_checkpoint_shares_no_file(recorder, shared_path):
    path = shared_path / "a.hdf.part"
    checkpoint = ub.Checkpoint(path, every=2)
    with pytest.raises(ub.ArgumentError, match=rf"and checkpoint would both write {path}"):
        run(recorder(path), checkpoint=checkpoint)
    with pytest.raises(ub.ArgumentError, match="and checkpoint would both write"):
        run(recorder(path), checkpoint=ub.Checkpoint(f"{path.parent}/./{path.name}", every=2))


def test_xdmf_and_a_checkpoint_of_one_stem(shared_path, on_first_rank):
    """The names of docs/restart.md are two files, and both are what they should be."""
    for steps in (5, 10):
        solution = run(
            ub.XDMF(shared_path / "run.xdmf"),
            steps=steps,
            checkpoint=ub.Checkpoint(shared_path / "run.h5", every=2),
        )
    found = on_first_rank(lambda: read_xdmf(shared_path / "run.xdmf"))
    kept = on_first_rank(lambda: read(shared_path / "run.h5", FORMAT))
    assert len(found.times) == len(kept["history/q"]) == len(solution.times) == 11


def test_devices_may_be_shared():
    run(ub.History("/dev/null"), ub.History("/dev/null"))  # is not refused


def test_the_file_of_a_study_is_not_that_of_a_member(shared_path):
    path = shared_path / "study.h5"

    def member(x):
        run(ub.History(path), steps=1)
        return {"x": x}

    with pytest.raises(RuntimeError, match=r"study and record\[0\] \(History\) would both write"):
        ub.study(member, [{"x": 1.0}, {"x": 2.0}], path=path)
    # Afterwards it is free again
    assert not output_files._in_use
    run(ub.History(path), steps=1)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (3, "History: path = 3 must be the name of a file"),
        ("a\0b.csv", "cannot be written: .*embedded null"),
        ("x" * 300, "cannot be written: File name too long"),
    ],
)
def test_names_that_are_none(path, message, shared_path, monkeypatch):
    monkeypatch.chdir(shared_path)
    with pytest.raises(ub.ArgumentError, match=message):
        run(ub.History(path))


def test_a_check_makes_no_file_that_a_kill_could_leave(tmp_path):
    os.utime(tmp_path, (0, 0))
    require_writable(tmp_path / "a.csv")
    assert tmp_path.stat().st_mtime == 0


@pytest.mark.parametrize("name", ['a&b<c>".xdmf', " a b\n.xdmf", "ü✓.xdmf"])
def test_names_with_odd_characters(name, shared_path, on_first_rank):
    run(ub.XDMF(shared_path / name))
    assert len(on_first_rank(lambda: read_xdmf(shared_path / name)).times) == 6


# -- what a step costs -----------------------------------------------------------------------------


@pytest.mark.serial
@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="Linux counts transferred bytes")
@pytest.mark.parametrize("recorder", [ub.XDMF, ub.VTKHDF])
def test_a_step_costs_the_same_at_any_time(recorder, tmp_path):
    """Bytes and system calls of the steps 50 to 550 beside those of the steps 550 to 1050.

    A file that is copied or read again in each step transfers three times as much in the second
    half.  A factor of 1.5 covers buffers that are filled in one half and written in the other.
    """
    beam = ub.Beam((0, 0), (4, 0), SECTION, cells=8)
    simulation = ub.Simulation(clamped(beam), ub.EnergyMomentum())
    file = recorder(tmp_path / f"a{recorder.endings[0]}")
    file.open(simulation)

    def transferred():
        lines = Path("/proc/self/io").read_text().splitlines()[:4]
        return np.array([int(line.split()[1]) for line in lines])

    def cost(steps):
        before = transferred()
        for _ in range(steps):
            file.write(simulation)
        return transferred() - before

    cost(50)
    first, second = cost(500), cost(500)
    file.close()
    simulation.close()
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


class Remove(Notes):
    """Removes a file after some steps."""

    def __init__(self, path, steps):
        super().__init__(path.with_suffix(".notes"))
        self.gone, self.steps = path, steps

    def write(self, simulation):
        self.steps -= 1
        if self.steps == 0 and simulation.comm.rank == 0:
            self.gone.unlink()

    def state(self):
        return {}


REMOVED = {
    "History": (ub.History, "a.csv", "a.csv"),
    "XDMF": (ub.XDMF, "a.xdmf", "a.xdmf"),
    "VTKHDF": (ub.VTKHDF, "a.vtkhdf", "a.vtkhdf"),
}


@pytest.mark.filterwarnings("ignore:output .* was removed:RuntimeWarning")
@pytest.mark.parametrize("kind", REMOVED)
def test_a_file_that_was_removed_before_a_checkpoint(kind, shared_path, on_first_rank):
    recorder, name, gone = REMOVED[kind]
    checkpoint = ub.Checkpoint(shared_path / "a.checkpoint", every=2)
    message = rf"output \S*{re.escape(gone)} was removed .*the checkpoint before is kept"
    with pytest.raises(FileNotFoundError, match=message) as error:
        run(recorder(shared_path / name), Remove(shared_path / gone, 3), checkpoint=checkpoint)
    assert len(error.value.solution.times) == 5
    kept = on_first_rank(lambda: read(shared_path / "a.checkpoint", FORMAT))
    assert len(kept["history/q"]) == 3
    with pytest.raises(ub.ArgumentError, match="it differs from the file at the checkpoint"):
        run(recorder(shared_path / name), Remove(shared_path / gone, 3), checkpoint=checkpoint)


@pytest.mark.serial
@pytest.mark.parametrize("kind", REMOVED)
def test_a_file_that_was_removed_otherwise(kind, tmp_path):
    """The run goes on to its end, and a warning says what is lost."""
    recorder, name, gone = REMOVED[kind]
    with pytest.warns(
        RuntimeWarning, match=rf"output \S*{re.escape(gone)} was removed or replaced"
    ):
        solution = run(recorder(tmp_path / name), Remove(tmp_path / gone, 3))
    assert len(solution.times) == 6


def test_a_device_that_is_full():
    with pytest.raises(OSError, match="output /dev/full cannot be written: No space left") as error:
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
        with pytest.raises(
            OSError, match=f"output {path}.* cannot be written: .*before is"
        ) as error:
            run(recorder(path), steps=10_000, dt=1e-4)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    reached = len(error.value.solution.times)
    assert reached > 100
    if recorder is ub.History:
        assert len(path.read_bytes().splitlines()) == reached
    else:
        read = read_xdmf if recorder is ub.XDMF else read_vtkhdf
        # The step that failed is in the solution and not in the file
        assert len(read(path).times) == reached - 1


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


def require_steps(path, count):
    """All steps are there with their numbers."""
    found = (read_xdmf if path.suffix == ".xdmf" else read_vtkhdf)(path)
    assert found.times == [0.5 * n for n in range(count)]
    for n in range(count):
        assert (found.of("u")[n] == n / 7).all()
        assert (found.of("N")[n] == n).all()


class Torn:
    """Writes that end, at the n-th, after some bytes: as when a kill comes meanwhile.

    The kernel copies pages one by one, so a write ends at the border of one.
    """

    def __init__(self, monkeypatch, n, pages, error):
        self.n, self.pages, self.error, self.write = n, pages, error, os.pwrite
        monkeypatch.setattr(output_files.os, "pwrite", self)

    def __call__(self, file, data, at):
        if self.n == 0:
            border = (at // PAGE + self.pages) * PAGE - at
            self.write(file, data[: max(border, 0)], at)
            raise self.error
        self.n -= 1
        return self.write(file, data, at)


class Killed(BaseException):
    pass


@pytest.mark.serial
def test_xdmf_is_complete_whenever_a_kill_comes(tmp_path, monkeypatch):
    """Torn at each write of some steps.

    What a kill leaves is read, then gone on with from five steps before.
    """
    path, first = tmp_path / "a.xdmf", 20
    writer = writer_of(path)
    kept = []
    for n in range(first):
        kept.append((writer.complete, writer._sync()))
        write(writer, [n])
    kept.append((writer.complete, writer._sync()))
    writer.close()
    begin = path.read_bytes()
    for n in range(40):
        for pages in (0, 1, 2):
            path.write_bytes(begin)
            writer = writer_of(path, *kept[-1])
            with monkeypatch.context() as torn:
                Torn(torn, n, pages, Killed())
                with pytest.raises(Killed):
                    write(writer, range(first, first + 99))
            count = len(read_xdmf(path).times)
            assert 0 <= count - writer.complete[0] <= 1  # complete, and perhaps not yet counted
            require_steps(path, count)
        if n % 7:
            continue
        for m in range(6):  # also while it is taken back
            with monkeypatch.context() as torn:
                Torn(torn, m, 1, Killed())
                with pytest.raises(Killed):
                    write(writer_of(path, *kept[-6]), range(first - 5, first))
            require_steps(path, len(read_xdmf(path).times))
        writer = writer_of(path, *kept[-6])
        write(writer, range(first - 5, first))
        writer.close()
        assert path.read_bytes() == begin


@pytest.mark.serial
@pytest.mark.parametrize("n", range(2))
def test_an_interrupt_in_a_write_of_xdmf(n, tmp_path, monkeypatch):
    """Ctrl-C in a write: closed, or gone on with, the file is as if nothing had happened."""
    for name in ("whole", "closed", "on"):
        writer = writer_of(tmp_path / f"{name}.xdmf")
        write(writer, range(7))
        if name != "whole":
            with monkeypatch.context() as torn:
                Torn(torn, n, 1, KeyboardInterrupt())
                with pytest.raises(KeyboardInterrupt):
                    write(writer, [7])
        if name != "closed":
            write(writer, range(7, 10))
        writer.close()
    require_steps(tmp_path / "closed.xdmf", 7)
    require_steps(tmp_path / "on.xdmf", 10)
    text, other = ((tmp_path / f"{name}.xdmf").read_text() for name in ("whole", "on"))
    assert text.split() == other.split()


@pytest.mark.serial
@pytest.mark.parametrize("n", [40, 42, 45])
def test_an_interrupt_in_a_write_of_vtkhdf(n, tmp_path, monkeypatch):
    path, put, calls = tmp_path / "a.vtkhdf", ub.VTKHDF._put, []

    def interrupted(self, name, values):
        calls.append(name)
        if len(calls) == n:
            raise KeyboardInterrupt
        put(self, name, values)

    writer = writer_of(path)
    monkeypatch.setattr(ub.VTKHDF, "_put", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(writer, range(10))
    steps = writer.complete[0]
    assert 0 < steps < 10
    if n == 45:  # gone on with
        write(writer, [steps])
        steps += 1
    writer.close()
    require_steps(path, steps)


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
    table = ub.History(tmp_path / "a.csv")
    put = OutputFile.put

    def interrupted(self, at, data):
        if data.startswith(b"0.3"):
            put(self, at, data[:10])
            raise KeyboardInterrupt
        put(self, at, data)

    monkeypatch.setattr(OutputFile, "put", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(table)
    rows = (tmp_path / "a.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows] == ["t [s]", "0.0", "0.1", "0.2"]
    assert len({row.count(",") for row in rows}) == 1


KILLED = """
import sys
import time
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from test_output_files import fields, writer_of
writer = writer_of(Path(sys.argv[1]))
k = 0
while True:
    writer._append((0.5 * k, fields(k)))
    k += 1
"""


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("name", ["a.xdmf", "a.vtkhdf"])
def test_ten_kills_during_writes(name, tmp_path):
    """A process that does nothing but write, killed at random moments."""
    dice, here = np.random.default_rng(0), Path(__file__).parent
    for n in range(10):
        path = tmp_path / f"{n}{name}"
        command = [sys.executable, "-c", KILLED, str(path), str(here), str(here.parent)]
        with subprocess.Popen(command) as process:
            while not path.exists() or path.stat().st_size < 70_000:
                assert process.poll() is None
                time.sleep(0.01)
            time.sleep(dice.uniform(0, 0.1))
            process.kill()
        found = (read_xdmf if name == "a.xdmf" else read_vtkhdf)(path)
        assert len(found.times) > 1
        require_steps(path, len(found.times))


def test_recorders_close_also_when_one_fails(shared_path):
    class Bad(Notes):
        def close(self):
            raise RuntimeError("cannot close")

    table = ub.History(shared_path / "a.csv")
    with pytest.raises(RuntimeError, match="cannot close"):
        run(Bad(shared_path / "notes"), table, steps=1)
    if MPI.COMM_WORLD.rank == 0:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(table._file._file)
    assert MPI.COMM_WORLD.allreduce(1) == MPI.COMM_WORLD.size
