# SPDX-License-Identifier: MIT
"""`./env` as an ordinary user: the message before the build, and nothing is left of a stopped one.

Commands of the machine are replaced by stubs, so nothing is downloaded or installed.
"""

import os
import re
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = "mmdebstrap bubblewrap uidmap debian-archive-keyring"
pytestmark = pytest.mark.serial

USES = "awk bash cat chmod cksum cut dirname find ln mkdir mktemp mv readlink realpath rm setsid "
USES += "sed sleep stat tail tar touch true uname flock"

BUILDS = """\
[ "$1" = --unshare-helper ] && { shift; exec "$@"; }
mkdir "$TMPDIR/mmdebstrap.of_another_id"
touch "$TMPDIR/mmdebstrap.of_another_id/file" "$BEGUN"
exec sleep 60
"""


@pytest.fixture
def machine(tmp_path):
    """A machine of user alice with some commands; stubs are added by name and text."""
    commands = tmp_path / "bin"
    commands.mkdir()
    for name in USES.split():
        (commands / name).symlink_to(shutil.which(name))

    def stub(name, text):
        (commands / name).write_text(f"#!/bin/bash\n{text}\n")
        (commands / name).chmod(0o755)

    stub("id", '[ "$*" = -u ] && echo 1000 || echo alice')
    stub("apt-get", "exit 1")
    stub("unshare", "exit 0")
    stub("df", "printf 'disk\\ndisk 0 0 99999999 0 /\\n'")
    stub("grep", 'case "$*" in */etc/sub*) exit 1 ;; esac; exec /usr/bin/grep "$@"')
    return stub


def environment(tmp_path):
    work = tmp_path / "work"
    work.mkdir(exist_ok=True)
    return {
        "PATH": str(tmp_path / "bin"),
        "HOME": str(tmp_path),
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
        "TMPDIR": str(work),
        "UFL_BEAM_SUITE": "trixie",
        "BEGUN": str(tmp_path / "begun"),
    }


def test_an_ordinary_user_is_told_all_before_anything_is_done(machine, tmp_path):
    command = [shutil.which("bash"), ROOT / "env", "true"]
    ran = subprocess.run(
        command, capture_output=True, text=True, env=environment(tmp_path), timeout=60
    )
    assert ran.returncode == 125
    assert "packages: mmdebstrap bubblewrap uidmap" in ran.stderr
    assert "ids of alice in /etc/subuid and /etc/subgid" in ran.stderr
    (line,) = (line for line in ran.stderr.splitlines() if "sudo" in line)
    assert re.fullmatch(
        rf"env:   sudo apt-get install {TOOLS} && "
        r"sudo usermod --add-subuids (\d+-\d+) --add-subgids \1 alice",
        line,
    )
    assert not (tmp_path / "cache").exists()


@pytest.fixture
def build(machine, tmp_path):
    """Start a build that does not end, and return its process."""
    if not list(Path("/usr/share/keyrings").glob("debian-archive-keyring.*")):
        pytest.skip("the check of the machine needs Debian's keyring")
    machine("grep", 'case "$*" in */etc/sub*) exit 0 ;; esac; exec /usr/bin/grep "$@"')
    machine("newuidmap", "exit 0")
    machine("bwrap", "exit 0")
    machine("mmdebstrap", BUILDS)
    started = []

    def start():
        begun = tmp_path / "begun"
        begun.unlink(missing_ok=True)
        command = [shutil.which("bash"), ROOT / "env", "true"]
        process = subprocess.Popen(
            command, stderr=subprocess.PIPE, text=True, env=environment(tmp_path)
        )
        started.append(process)
        for _ in range(200):
            if begun.exists():
                return process
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.1)
        raise AssertionError("the build did not begin")

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stderr.close()


def left(tmp_path):
    """Files of a build that is not finished."""
    cache = [p.name for p in (tmp_path / "cache" / "ufl_beam").iterdir() if p.suffix != ".log"]
    return {*cache, *(p.name for p in (tmp_path / "work").iterdir())} - {"lock"}


def test_a_stopped_build_leaves_nothing(build, tmp_path):
    process = build()
    assert len(left(tmp_path)) == 3  # half a root, the directory of mmdebstrap, a link to it
    process.send_signal(signal.SIGTERM)
    assert process.wait(30) == 130
    assert "its files are removed" in process.stderr.read()
    assert left(tmp_path) == set()


def test_the_next_build_removes_the_files_of_a_killed_one(build, tmp_path):
    killed = build()
    (builder,) = Path(f"/proc/{killed.pid}/task/{killed.pid}/children").read_text().split()
    killed.kill()
    killed.wait()
    os.killpg(int(builder), signal.SIGKILL)  # else it goes on to the end
    before = left(tmp_path)
    assert len(before) == 3
    process = build()
    after = left(tmp_path)
    assert len(after) == 3
    assert len(before & after) == 2  # another directory of mmdebstrap
    process.terminate()
    assert process.wait(30) == 130
    assert left(tmp_path) == set()
