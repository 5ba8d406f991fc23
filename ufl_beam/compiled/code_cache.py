# SPDX-License-Identifier: MIT
"""Directory of compiled code, with entries that are private to a user and checked before use.

An entry is a directory with the files of one build and a list of their checksums.  An entry is
built in a scratch directory, written to the disk and renamed, so that a killed process leaves no
incomplete entry.  The lock of an entry belongs to the operating system, which frees it when the
process ends.  A clean-up, at most once a day, removes entries that were not used for a month.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

from mpi4py import MPI

from ufl_beam.dolfinx_compat import jit_directory
from ufl_beam.file_system import locked, sync

T = TypeVar("T")

CHECKSUMS = "checksums"
"""File with the name of its entry and the checksums of the other files of the entry."""

CLEANED = "swept"
"""File whose modification time is the time of the last clean-up."""

DAY = 86_400.0
"""Shortest time between two records of use of an entry, and between two clean-ups; s."""

UNUSED = 30 * DAY
"""Time after which an unused entry is removed; s."""

TRUSTED = os.geteuid(), 0
"""Users whose files are loaded: the user of this process and the administrator."""


def cached(name: str, build: Callable[[Path], T], load: Callable[[Path], T]) -> tuple[T, Path]:
    """Return a loaded entry of the cache and its directory; build a missing or damaged entry first.

    If several processes need the same entry, one process builds it and the others wait.  ``build``
    writes the files of the entry into an empty directory and loads them.  ``name`` must change with
    the sources.  An entry that cannot be imported is built again.
    """
    place, foreign = _place(), False
    if found := found_entry(name):
        try:
            return load(found), found
        except FileNotFoundError:
            pass  # a clean-up has just removed the entry
        except ImportError:
            foreign = True  # it was built for another system
    if not os.access(place, os.W_OK | os.X_OK):
        place, foreign = _temporary(f"the cache {place} cannot be written to"), False
    entry = place / name
    with locked(place / f"{name}.lock"):
        if not foreign and intact(entry):  # another process has built it meanwhile
            return load(entry), entry
        _remove_incomplete(entry)
        scratch = Path(tempfile.mkdtemp(prefix=f"{name}.", suffix=".part", dir=place))
        try:
            new = scratch / "new"
            new.mkdir()
            loaded = build(new)
            for path in new.glob("*.o"):
                path.unlink()
            (new / CHECKSUMS).write_text(_checksums(new, name))
            for path in (*new.iterdir(), new):
                sync(path)
            if os.path.lexists(entry):
                entry.rename(scratch / "damaged")
            new.rename(entry)
            sync(place)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    return loaded, entry


def found_entry(name: str) -> Path | None:
    """Return the directory of an entry that is complete, or None."""
    entry = _place() / name
    if not intact(entry):
        return None
    if _age(entry / CHECKSUMS) > DAY:  # record that the entry is used
        with suppress(PermissionError):  # the entry belongs to the administrator
            os.utime(entry / CHECKSUMS)
    return entry


def _remove_incomplete(entry: Path) -> None:
    """Remove incomplete builds of an entry that killed processes have left."""
    for rest in entry.parent.glob(f"{entry.name}.*.part"):
        shutil.rmtree(rest, ignore_errors=True)


def intact(entry: Path) -> bool:
    """Return whether an entry is complete, unchanged since its build, and from trusted users."""
    try:
        return (entry / CHECKSUMS).read_text() == _checksums(entry, entry.name)
    except (OSError, ValueError):
        return False


def _checksums(entry: Path, name: str) -> str:
    """Return the text of :data:`CHECKSUMS`; raise ValueError unless trusted users own all files."""
    lines = [name]
    for path in sorted(entry.iterdir()):
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or status.st_uid not in TRUSTED:
            raise ValueError(f"{path} is not a file of a trusted user")
        if path.name != CHECKSUMS:
            lines.append(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}")
    return "\n".join(lines) + "\n"


# -- unused entries ------------------------------------------------------------------------------


def _age(path: Path) -> float:
    """Return the time since a file was written, or since its use was last recorded; s."""
    return time.time() - path.stat().st_mtime


def clean_up(place: Path) -> None:
    """Remove entries that were not used for :data:`UNUSED`, and their locks; at most once a day.

    An entry is renamed before it is removed, so that no process finds an incomplete entry.
    """
    with suppress(OSError):
        if (place / CLEANED).exists() and _age(place / CLEANED) < DAY:
            return
        (place / CLEANED).touch()
        for lock in (lock for lock in place.glob("*.lock") if _age(lock) > UNUSED):
            entry = lock.with_suffix("")
            aside = entry.with_name(f"{entry.name}.unused.part")
            with locked(lock):
                if entry.exists():
                    if _age(entry / CHECKSUMS) < UNUSED:
                        continue
                    entry.rename(aside)
                    if _age(aside / CHECKSUMS) < UNUSED:  # a process has just used it
                        aside.rename(entry)
                        continue
                _remove_incomplete(entry)
                lock.unlink()


# -- directories ---------------------------------------------------------------------------------


def _make_private(directory: Path) -> str:
    """Create a private directory if it is missing; return why it cannot be used, or ""."""
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = directory.lstat()
        if not stat.S_ISDIR(status.st_mode):
            return "it is no directory"
        if status.st_uid not in TRUSTED:
            return f"it belongs to the user with the number {status.st_uid}"
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return f"others may write to it (mode {stat.S_IMODE(status.st_mode):o}); remove it"
        for parent in directory.absolute().parents:
            mode = parent.stat().st_mode
            if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
                return f"others may write to {parent} (mode {stat.S_IMODE(mode):o})"
    except OSError as error:
        return error.strerror or str(error)
    return ""


@cache
def _place() -> Path:
    """Return the directory of the entries."""
    chosen = jit_directory() / "ufl_beam"
    if why := _make_private(chosen):
        return _temporary(f"the cache {chosen} cannot be used: {why}")
    if MPI.COMM_WORLD.rank == 0:
        clean_up(chosen)
    return chosen


@cache
def _temporary(why: str) -> Path:
    """Return a private temporary directory; rank 0 warns, once for each reason ``why``."""
    base = Path(tempfile.gettempdir())
    directory = base / f"ufl_beam-{os.geteuid()}"
    if _make_private(directory):
        directory = Path(tempfile.mkdtemp(prefix="ufl_beam-"))
        atexit.register(shutil.rmtree, directory, ignore_errors=True)
    if MPI.COMM_WORLD.rank == 0:
        warnings.warn(
            f"{why}. Compiled code is kept in {directory} instead; "
            "for a cache in another directory set XDG_CACHE_HOME",
            RuntimeWarning,
            stacklevel=2,
        )
    return directory
