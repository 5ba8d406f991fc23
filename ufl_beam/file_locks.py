# SPDX-License-Identifier: MIT
"""Locks of files between processes; the operating system frees them when a process ends."""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO


def is_at(file: int, path: Path) -> bool:
    """Return whether a path leads to an open file."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except OSError:
        return False


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Wait until no other process is in a context with this path; the file stays.

    It may be removed within the context: those who wait for it take a new one.  A file system that
    knows no locks locks nothing.
    """
    while True:
        with path.open("ab") as file:
            with suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_EX)
            if is_at(file.fileno(), path):
                yield
                return


class Lock:
    """An exclusive lock beside a file, in a file with ``.lock`` after its name."""

    def __init__(self, path: Path) -> None:
        self.path = path.with_name(path.name + ".lock")
        self._file: IO[str] | None = None

    def take(self) -> str:
        """Take the lock, or return who has it; an empty text if it was free.

        A file system that knows no locks locks nothing.

        Raises:
            OSError: The file cannot be written.
        """
        while True:
            file = self.path.open("a+", encoding="utf-8", errors="replace")
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.seek(0)
                owner = file.read().strip()
                file.close()
                return owner or "another process"
            except OSError:
                file.close()
                return ""
            if is_at(file.fileno(), self.path):
                break
            file.close()  # its owner has ended in between, and removed it
        file.truncate(0)
        file.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        file.flush()
        self._file = file
        return ""

    def release(self) -> None:
        """Give the lock back, if it was taken, and remove its file."""
        if self._file is not None:
            self.path.unlink(missing_ok=True)
            self._file.close()
            self._file = None
