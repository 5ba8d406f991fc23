# SPDX-License-Identifier: MIT
"""File system: data brought to the disk, and locks between processes.

The operating system frees a lock when its process ends.  On a file system without locks, all
processes get a lock at once.
"""

from __future__ import annotations

import fcntl
import os
import socket
from pathlib import Path
from typing import IO


def is_at(file: int, path: Path) -> bool:
    """Return whether ``path`` still leads to the open file ``file``."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except OSError:
        return False


def sync(path: Path) -> None:
    """Wait until a file or a directory is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def locked(path: Path, more: int = 0) -> IO[str]:
    """Open a file with an exclusive lock, which is released when the file is closed.

    The process that has the lock may remove the file: processes that wait for it then create a new
    one.  ``more`` are flags of ``flock``.
    """
    while True:
        file = path.open("a+", encoding="utf-8", errors="replace")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | more)
        except BlockingIOError:
            with file:
                file.seek(0)
                raise BlockingIOError(file.read().strip() or "another process") from None
        except OSError:
            pass
        if is_at(file.fileno(), path):
            return file
        file.close()


class Lock:
    """Exclusive lock of a file, by a second file with ``.lock`` after the name of the first."""

    def __init__(self, path: Path) -> None:
        self.path = path.with_name(path.name + ".lock")
        self._file: IO[str] | None = None

    def acquire(self) -> str:
        """Take the lock and return an empty text, or return which process has it.

        Raises:
            OSError: The file of the lock cannot be written.
        """
        try:
            self._file = locked(self.path, fcntl.LOCK_NB)
        except BlockingIOError as error:
            return str(error)
        self._file.truncate(0)
        self._file.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        self._file.flush()
        return ""

    def release(self) -> None:
        """Give the lock back, if it was taken, and remove its file."""
        if self._file is not None:
            self.path.unlink(missing_ok=True)
            self._file.close()
            self._file = None
