# SPDX-License-Identifier: MIT
"""Output files: checks of their paths before a run, errors that name the file."""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import stat
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ufl_beam.errors import SceneError, shorten
from ufl_beam.file_system import is_at, sync

Output = tuple[str, tuple[Path, ...]]  # name of a writer in messages, and the files that it writes
_in_use: list[Output] = []  # outputs of the runs that go on in this process, the outer ones first

BLOCK = 1 << 20  # bytes that are read at once for a checksum


def require_path(path: str | Path, what: str) -> Path:
    """Return ``path`` as a :class:`Path`, or raise :class:`SceneError` naming ``what``."""
    if not isinstance(path, str | os.PathLike) or not os.fspath(path):
        raise SceneError(f"{what}: path = {shorten(path)} must be the name of a file")
    return Path(path)


def require_writable(path: Path) -> None:
    """Raise :class:`SceneError` if a file cannot be written; its content stays as it is."""
    why = ""
    try:
        if not path.parent.is_dir():
            why = f": there is no directory {path.parent}; make it first"
        else:
            new = not path.exists()
            path.open("ab").close()
            if new:
                path.unlink()
    except (OSError, ValueError) as error:  # a ValueError at a null character
        why = f" cannot be written: {getattr(error, 'strerror', error)}"
    if why:
        raise SceneError(f"output {path}{why}")


def require_apart(outputs: Sequence[Output], call: str) -> None:
    """Raise :class:`SceneError` if two outputs, or an outer run's and one of these, share a file.

    Files are compared through symbolic and hard links; devices such as ``/dev/null`` may be shared.
    """
    owners: dict[object, str] = {}
    for owner, paths in (*_in_use, *outputs):
        for path in paths:
            for identity in _identities(path):
                other = owners.setdefault(identity, owner)
                if other is not owner:
                    raise SceneError(
                        f"{call}: {other} and {owner} would both write {os.path.realpath(path)}; "
                        "give one of them another path"
                    )


def _identities(path: Path) -> list[object]:
    """The real path, and the inode of a file that exists; none of a device."""
    try:
        real = os.path.realpath(path)
        found = os.stat(real)
    except OSError:
        return [real]
    except ValueError as error:  # a null character
        raise SceneError(f"output {path} cannot be written: {error}") from None
    return [real, (found.st_dev, found.st_ino)] if stat.S_ISREG(found.st_mode) else []


def take(outputs: Iterable[Output]) -> Callable[[], None]:
    """Reserve the files of a run against runs within it; return the function that frees them."""
    taken = list(outputs)
    _in_use.extend(taken)

    def release() -> None:
        for output in taken:
            _in_use.remove(output)

    return release


def part_of(path: Path) -> Path:
    """Return the path of the file that takes the place of another one once it is complete."""
    return path.with_name(f"{path.name}.part")


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Let errors of writing say which file, why, how much space there is, and what is kept."""
    try:
        yield
    except OSError as error:
        space = ""
        if error.errno == errno.ENOSPC and path.is_file():
            space = f" ({shutil.disk_usage(path.parent).free / 1e6:.3g} MB are free)"
        raise OSError(
            error.errno or errno.EIO,
            f"output {path} cannot be written: {error.strerror or error}{space}; what was written "
            "before is complete",
        ) from None


class OutputFile:
    """File that is written at given positions, emptied or made if new; errors name it."""

    def __init__(self, path: Path, *, new: bool = True) -> None:
        self.path = path
        flags = os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT | os.O_TRUNC if new else 0)
        with naming(path):
            self._file = os.open(path, flags, 0o666)
        self._regular = stat.S_ISREG(os.fstat(self._file).st_mode)
        self._digest, self._hashed = hashlib.sha256(), 0

    @property
    def size(self) -> int:
        """Length of the file; bytes."""
        return os.fstat(self._file).st_size

    def put(self, at: int, data: bytes | bytearray) -> None:
        """Write at a position of the file; pipes and terminals have none."""
        rest = memoryview(data)
        with naming(self.path):
            while rest:
                file = self._file
                done = os.pwrite(file, rest, at) if self._regular else os.write(file, rest)
                rest, at = rest[done:], at + done

    def read(self, at: int, count: int) -> bytes:
        """Read some bytes, fewer at the end of the file."""
        return os.pread(self._file, count, at)

    def digest(self, length: int) -> bytes:
        """Return the SHA-256 of the first bytes, which do not change any more; each is read once.

        Later calls ask for at least as many.  A file that is too short has another digest.
        """
        while self._regular and self._hashed < length:
            block = self.read(self._hashed, min(length - self._hashed, BLOCK))
            if not block:
                break
            self._digest.update(block)
            self._hashed += len(block)
        return self._digest.digest()

    def cut(self, length: int) -> None:
        """Cut the file off at a length."""
        if self._regular:
            os.ftruncate(self._file, length)

    def allocate(self, length: int) -> None:
        """Let the disk be full now rather than when a library writes up to a length."""
        missing = length - self.size
        if missing > 0 and hasattr(os, "posix_fallocate"):
            with naming(self.path):
                try:
                    os.posix_fallocate(self._file, self.size, missing)
                except OSError as error:
                    if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):  # no such thing there
                        raise

    def rename(self, path: Path) -> None:
        """Move the file, in the place of another one if that exists."""
        os.replace(self.path, path)
        self.path = path

    def sync(self) -> None:
        """Bring everything to the disk; :class:`FileNotFoundError` if the file was removed."""
        if not is_at(self._file, self.path):
            raise FileNotFoundError(
                errno.ENOENT,
                f"output {self.path} was removed or replaced during the run, so that no checkpoint "
                "can count on it; the checkpoint before is kept, and the solution so far is in the "
                "error",
            )
        with naming(self.path):
            try:
                os.fsync(self._file)
            except OSError as error:
                if error.errno not in (errno.EINVAL, errno.EROFS):  # not of a file
                    raise

    def close(self) -> None:
        """Close the file; warn if it is not where it was."""
        there = is_at(self._file, self.path)
        os.close(self._file)
        if not there:
            warnings.warn(
                f"output {self.path} was removed or replaced during the run; what was written to "
                "it is lost",
                RuntimeWarning,
                stacklevel=2,
            )


def put_in_place(path: Path, data: bytes | memoryview) -> None:
    """Write a whole file; the one before stays until the new one is on the disk."""
    part = part_of(path)
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    sync(path.parent)


def changed(what: str) -> SceneError:
    """Return the error of an output that is not as the checkpoint knows it."""
    return SceneError(
        f"{what}: it is not what was written up to the checkpoint: it is missing, or was changed "
        "while the run was down; bring it back, or delete the checkpoint to begin anew"
    )
