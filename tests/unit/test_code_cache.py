# SPDX-License-Identifier: MIT
"""The cache of compiled code: damage, kills, other users, directories that cannot be written to."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ufl_beam.compiled import code_cache, jit, simd_kernels
from ufl_beam.compiled.code_cache import CHECKSUMS, cached, intact

ENTRY = "numbers_1234"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty cache."""
    directory = tmp_path / "cache"
    directory.mkdir(mode=0o700)
    monkeypatch.setattr(code_cache, "_place", lambda: directory)
    return directory


class Builds:
    """An entry with a source and a library; counts how often it is built."""

    def __init__(self, number=1):
        self.number, self.count = number, 0

    def build(self, directory):
        self.count += 1
        (directory / "source.c").write_text(f"int n = {self.number};")
        (directory / "library.so").write_bytes(bytes([self.number]) * 20_000)
        return self.load(directory)

    def load(self, directory):
        if (directory / "library.so").read_bytes() != bytes([self.number]) * 20_000:
            pytest.fail("a damaged library was loaded")  # which would be a SIGSEGV
        return self.number

    def __call__(self, name=ENTRY):
        value, directory = cached(name, self.build, self.load)
        assert value == self.number
        assert (directory / "source.c").exists()
        return self.count


@pytest.fixture
def built(place):
    """An entry that was built."""
    builds = Builds()
    assert [builds(), builds()] == [1, 1]
    return builds


def another_entry(entry):
    Builds(2)("numbers_other")
    shutil.rmtree(entry)
    shutil.copytree(entry.parent / "numbers_other", entry)


def a_file(entry):
    shutil.rmtree(entry)
    entry.write_text("")


def a_link(entry):
    elsewhere = entry.parent / "elsewhere.so"
    (entry / "library.so").rename(elsewhere)
    (entry / "library.so").symlink_to(elsewhere)


DAMAGES = {
    "cut": lambda entry: os.truncate(entry / "library.so", 1000),
    "gone": lambda entry: (entry / "library.so").unlink(),
    "no checksums": lambda entry: (entry / CHECKSUMS).unlink(),
    "binary checksums": lambda entry: (entry / CHECKSUMS).write_bytes(b"\xff\xfe\x00"),
    **{f.__name__: f for f in (another_entry, a_file, a_link)},
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_built_again_and_not_loaded(place, built, damage):
    DAMAGES[damage](place / ENTRY)
    assert not intact(place / ENTRY)
    assert [built(), built()] == [2, 2]
    assert not list(place.glob("*.part"))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
@pytest.mark.parametrize("file", ["library.so", CHECKSUMS])
def test_what_another_user_owns_is_built_again(place, built, file):
    os.chown(place / ENTRY / file, 1234, 1234)
    assert [built(), built()] == [2, 2]


def test_a_library_of_another_system_is_built_again(built):
    def load(directory):
        raise ImportError("undefined symbol")

    assert cached(ENTRY, built.build, load)[0] == 1
    assert built.count == 2


@pytest.mark.parametrize("stop", [KeyboardInterrupt, RuntimeError])
def test_a_build_that_is_stopped_leaves_nothing(place, stop):
    def build(directory):
        (directory / "library.so").write_text("half")
        raise stop

    with pytest.raises(stop):
        cached(ENTRY, build, build)
    assert [path.name for path in place.iterdir()] == [f"{ENTRY}.lock"]
    assert Builds()() == 1


def answer(number):
    """Call a real module that returns a number."""
    source = f"int answer(void) {{ return {number}; }}"
    options = {"depends_on": [source], "flags": []}
    module = jit.compiled("ufl_beam_test", "int answer(void);", lambda: source, **options)
    return module.lib.answer()


def test_damaged_c_is_compiled_again(place):
    """On a real library: loaded as it is, it would end this process."""
    assert answer(42) == 42
    (entry,) = (path for path in place.iterdir() if path.is_dir())
    (library,) = entry.glob("*.so")
    content = library.read_bytes()
    library.unlink()  # this process has mapped it
    library.write_bytes(content[:1000])
    assert answer(42) == 42
    assert len(library.read_bytes()) == len(content)
    assert intact(entry)


def test_files_are_on_the_disk_before_the_entry_has_its_name(place, monkeypatch):
    """So that a crash of the machine leaves no empty library under a name that is loaded."""
    synced, fsync = [], os.fsync

    def note(descriptor):
        synced.append((os.readlink(f"/proc/self/fd/{descriptor}"), (place / ENTRY).exists()))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", note)
    Builds()()
    before = {Path(name).name for name, complete in synced if not complete}
    assert {"source.c", "library.so", CHECKSUMS} <= before


# -- several processes ---------------------------------------------------------------------------

BUILD = """
import sys, time
from pathlib import Path
from ufl_beam.compiled import code_cache
place = Path(sys.argv[1])
code_cache._place = lambda: place
def build(directory):
    (directory / "begun").write_text("")
    with open(place.parent / "log", "a") as file:
        file.write("built\\n")
    time.sleep(float(sys.argv[2]))
code_cache.cached("slow", build, lambda directory: None)
"""


def start(place, seconds):
    return subprocess.Popen([sys.executable, "-c", BUILD, str(place), str(seconds)])


def begun(place):
    """Wait until a build has begun."""
    for _ in range(4000):
        if list(place.glob("slow.*.part/new/begun")):
            return
        time.sleep(0.005)
    pytest.fail("no build has begun")


@pytest.mark.serial
@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_build_is_in_nobodys_way(place, by):
    process = start(place, 100)
    begun(place)
    process.send_signal(by)
    assert process.wait(20) != 0
    before = time.perf_counter()
    assert Builds()("slow") == 1
    assert time.perf_counter() - before < 5  # FFCx waits 10 s
    assert sorted(path.name for path in place.iterdir()) == ["slow", "slow.lock"]


@pytest.mark.serial
def test_two_processes_build_the_same_once_and_different_entries_at_once(place):
    processes = [start(place, 1.5)]
    begun(place)
    processes.append(start(place, 0.0))
    assert Builds()() == 1  # another entry does not wait
    assert processes[0].poll() is None
    assert [process.wait(30) for process in processes] == [0, 0]
    assert (place.parent / "log").read_text() == "built\n"


@pytest.fixture
def home(tmp_path, monkeypatch):
    """The directory in which the cache is to be, and another one for temporary files."""
    (tmp_path / "tmp").mkdir(mode=0o700)
    monkeypatch.setattr(code_cache.tempfile, "tempdir", str(tmp_path / "tmp"))
    monkeypatch.setattr(code_cache, "_temporary", code_cache._temporary.__wrapped__)
    monkeypatch.setattr(code_cache, "jit_directory", lambda: tmp_path / "home" / "fenics")
    return tmp_path / "home" / "fenics"


def chosen():
    return code_cache._place.__wrapped__()


first_rank_says = pytest.mark.skipif(
    code_cache.MPI.COMM_WORLD.rank > 0, reason="only the first process says so"
)


def test_the_directory_is_private(home):
    assert chosen() == home / "ufl_beam"
    assert (home / "ufl_beam").stat().st_mode & 0o777 == 0o700


def open_to(directory, mode):
    directory.mkdir(parents=True)
    directory.chmod(mode)


def a_link_elsewhere(home):
    home.mkdir(parents=True)
    (home / "ufl_beam").symlink_to(home.parent)


@first_rank_says
@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda home: open_to(home / "ufl_beam", 0o770), "others may write to it"),
        (lambda home: open_to(home, 0o777), "others may write to .*fenics"),
        (lambda home: home.parent.write_text(""), "Not a directory"),
        (a_link_elsewhere, "it is no directory"),
    ],
    ids=["group", "above", "file", "link"],
)
def test_directories_that_cannot_be_trusted_or_made(home, make, why):
    make(home)
    with pytest.warns(RuntimeWarning, match=f"cannot be used: {why}.*XDG_CACHE_HOME"):
        place = chosen()
    temporary = Path(code_cache.tempfile.tempdir) / f"ufl_beam-{os.geteuid()}"
    assert place == temporary
    assert place.stat().st_mode & 0o777 == 0o700
    temporary.chmod(0o777)  # a directory of another in its place
    with pytest.warns(RuntimeWarning, match="cannot be used"):
        assert chosen() != temporary


@first_rank_says
def test_a_cache_that_cannot_be_written_to_is_read(place, built, home, monkeypatch):
    # For root everything is writable.
    monkeypatch.setattr(code_cache.os, "access", lambda *_: False)
    assert built() == 1
    with pytest.warns(RuntimeWarning, match="cannot be written to.*ufl_beam-"):
        assert Builds(3)("another") == 1
    assert [path.name for path in place.iterdir() if path.is_dir()] == [ENTRY]


WARNS = "import ufl_beam, warnings; warnings.warn('is it seen?', RuntimeWarning)"
LOG = "import logging; logging.basicConfig(format='log: %(message)s'); "


@pytest.mark.serial
@pytest.mark.parametrize(
    ("before", "options", "seen"),
    [
        ("", [], "RuntimeWarning: is it seen?"),
        # Some come before FFCx is there, for which Python adds a handler that shows nothing
        (LOG, ["-W", "always"], "RuntimeWarning: is it seen?"),
        (LOG + "logging.captureWarnings(True); ", [], "log: <string>:1: RuntimeWarning: is it"),
    ],
    ids=["", "always, after logging", "logged"],
)
def test_warnings_are_seen(before, options, seen):
    """FFCx 0.9 has all of them logged, which without a handler is nowhere.

    They are logged if the user asks for it.
    """
    command = [sys.executable, *options, "-c", before + WARNS]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert seen in run.stderr


def test_without_a_compiler_there_are_words(place, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(jit.CompilerError, match=r"no-such-compiler.*need a C compiler.*gcc"):
        jit.compiled("ufl_beam_test", "", lambda: "", depends_on=[], flags=[])


def test_a_kernel_without_vectors_is_remembered(place, tmp_path):
    source = tmp_path / "libffcx_forms_0.c"
    source.write_text("nothing")
    for _ in range(2):
        simd_kernels.element_loops.cache_clear()
        assert simd_kernels.element_loops(source, ((0, (1, 1)),), 0, 0) == [None]
    assert len([path for path in place.iterdir() if path.is_dir()]) == 1


def aged(days, *paths):
    """Let files be so old."""
    then = time.time() - days * code_cache.DAY
    for path in paths:
        os.utime(path, (then, then))


def entries(place):
    return sorted(path.name for path in place.iterdir() if path.name != code_cache.CLEANED)


def test_what_was_not_used_for_a_month_is_removed_once_a_day(place):
    builds = {name: Builds() for name in ("old_1", "used_2", "new_3")}
    for name, build in builds.items():
        build(name)
        aged(99, place / f"{name}.lock")
    aged(31, place / "old_1" / CHECKSUMS)
    aged(29, place / "used_2" / CHECKSUMS)
    (place / "old_1.rest.part").mkdir()  # of a process that was killed
    (place / "gone_4.lock").touch()
    aged(31, place / "gone_4.lock")
    code_cache.clean_up(place)
    assert entries(place) == ["new_3", "new_3.lock", "used_2", "used_2.lock"]
    assert [build(name) for name, build in builds.items()] == [2, 1, 1]
    # On the same day nothing is looked for
    aged(31, place / "new_3" / CHECKSUMS)
    code_cache.clean_up(place)
    assert (place / "new_3").exists()
    aged(2, place / code_cache.CLEANED)
    code_cache.clean_up(place)
    assert not (place / "new_3").exists()


def test_a_module_of_an_earlier_version_is_ignored_and_removed(place):
    assert answer(1) == 1
    (earlier,) = (name for name in entries(place) if not name.endswith(".lock"))
    assert answer(2) == 2
    assert len(entries(place)) == 4
    aged(31, place / earlier / CHECKSUMS, *place.glob("*.lock"))
    code_cache.clean_up(place)
    assert len(entries(place)) == 2
    assert not (place / earlier).exists()
    assert answer(2) == 2


def test_a_use_is_noted_once_a_day(place, built):
    for days, noted in ((0.5, False), (2.0, True)):
        aged(days, place / ENTRY / CHECKSUMS)
        before = (place / ENTRY / CHECKSUMS).stat().st_mtime
        assert built() == 1
        assert ((place / ENTRY / CHECKSUMS).stat().st_mtime != before) == noted


def test_what_is_used_while_it_is_removed_stays(place, built, monkeypatch):
    """Another process finds it between the two looks at its age."""
    age = code_cache._age
    aged(31, place / ENTRY / CHECKSUMS, place / f"{ENTRY}.lock")

    def used(path):
        found = age(path)
        if path == place / ENTRY / CHECKSUMS:
            os.utime(path)
        return found

    monkeypatch.setattr(code_cache, "_age", used)
    code_cache.clean_up(place)
    assert entries(place) == [ENTRY, f"{ENTRY}.lock"]
    assert built() == 1


def test_what_is_removed_while_it_is_loaded_is_built_again(built):
    load = built.load

    def removed(directory):
        built.load = load
        for path in (directory / CHECKSUMS, directory / "library.so"):
            path.unlink()
        return load(directory)

    built.load = removed
    assert built() == 2


def test_a_cache_that_cannot_be_written_is_not_swept(place, built, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError

    aged(31, place / ENTRY / CHECKSUMS, place / f"{ENTRY}.lock")
    for name in ("touch", "rename", "unlink"):
        monkeypatch.setattr(Path, name, refuse)
    monkeypatch.setattr(os, "utime", refuse)
    code_cache.clean_up(place)
    assert built() == 1
