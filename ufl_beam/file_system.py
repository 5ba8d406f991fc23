# SPDX-License-Identifier: MIT
"""File system: names of files, data flushed to the disk, and locks of files between processes.

The operating system frees a lock when its process ends.  On a file system without locks, several
processes can acquire the same lock.
"""

from __future__ import annotations

import fcntl
import os
import socket
from pathlib import Path
from typing import IO

from ufl_beam.errors import ArgumentError, shorten


def require_path(path: str | os.PathLike[str], what: str) -> Path:
    """Return ``path`` as a :class:`Path`, or raise :class:`ArgumentError` naming ``what``."""
    if not isinstance(path, str | os.PathLike) or not os.fspath(path):
        raise ArgumentError(f"{what}: path = {shorten(path)} must be the name of a file")
    return Path(path)


def is_at(file: int, path: Path) -> bool:
    """Return whether ``path`` still refers to the open file with the descriptor ``file``."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except OSError:
        return False


def sync(path: Path) -> None:
    """Flush a file or a directory to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def locked(path: Path, more: int = 0) -> IO[str]:
    """Open a file with an exclusive lock, which is released when the file is closed.

    The owner of the lock may remove the file; waiting processes then create a new file.  ``more``
    are additional flags of ``flock``; with ``LOCK_NB``, a taken lock raises BlockingIOError.
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
    """Exclusive lock of a file by means of a lock file, whose name has ``.lock`` appended."""

    def __init__(self, path: Path) -> None:
        self.path = path.with_name(path.name + ".lock")
        self._file: IO[str] | None = None

    def acquire(self) -> str:
        """Acquire the lock and return an empty text, or return the name of its owner.

        Raises:
            OSError: The lock file cannot be written.
        """
        try:
            self._file = locked(self.path, fcntl.LOCK_NB)
        except BlockingIOError as error:
            return str(error)
        self._file.truncate(0)
        self._file.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        self._file.flush()
        return ""

    def unlock(self) -> None:
        """Release the lock, if it was acquired, and remove the lock file."""
        if self._file is not None:
            self.path.unlink(missing_ok=True)
            self._file.close()
            self._file = None
