# SPDX-License-Identifier: MIT
"""Output files: checks of paths, errors with names of files, and the format of saved data.

A file of a solution, study or checkpoint has named arrays and JSON, with a checksum.  The file is
a zip archive in the format of ``numpy.savez``, so ``numpy.load`` reads it.  Its member
``text.json`` has all content except arrays.  The comment at the end of the archive has the kind of
content, the number of the format and the version of ufl_beam.  The file ends with the SHA-256 of
all bytes before this checksum.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import re
import shutil
import stat
import warnings
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.discretization.state_io import OtherVersion
from ufl_beam.errors import ArgumentError
from ufl_beam.file_system import is_at, sync

Output = tuple[str, tuple[Path, ...]]  # name of a writer in messages, and the files that it writes
_in_use: list[Output] = []  # of the current runs in this process, outer runs first

BLOCK = 1 << 20  # number of bytes in each read for a checksum


def require_writable(path: Path) -> None:
    """Raise :class:`ArgumentError` if a file cannot be written.

    The check does not change a file, and creates none, because a kill would leave an empty file.
    """
    why = ""
    try:
        if not path.parent.is_dir():
            why = f": there is no directory {path.parent}; make it first"
        elif os.path.exists(path) or os.access(path.parent, os.W_OK | os.X_OK):
            os.close(os.open(path, os.O_WRONLY))
        else:
            why = f" cannot be written: {os.strerror(errno.EACCES)}"
    except FileNotFoundError:
        pass  # the run will create it
    except (OSError, ValueError) as error:  # a ValueError at a null character
        why = f" cannot be written: {getattr(error, 'strerror', error)}"
    if why:
        raise ArgumentError(f"output {path}{why}")


def require_apart(outputs: Sequence[Output], call: str) -> None:
    """Raise :class:`ArgumentError` if two outputs, also of outer runs, share a file.

    Symbolic and hard links are resolved.  Devices such as ``/dev/null`` may be shared.
    """
    owners: dict[object, str] = {}
    for owner, path in ((owner, path) for owner, paths in (*_in_use, *outputs) for path in paths):
        try:
            status = os.stat(path)
            if not stat.S_ISREG(status.st_mode):
                continue
            identity: object = (status.st_dev, status.st_ino)
        except OSError:  # there is no file yet
            identity = os.path.realpath(path)
        except ValueError as error:  # a null character
            raise ArgumentError(f"output {path} cannot be written: {error}") from None
        writer = owners.setdefault(identity, owner)
        if writer is not owner:
            raise ArgumentError(
                f"{call}: {writer} and {owner} would both write {os.path.realpath(path)}; "
                "give one of them another path"
            )


@contextmanager
def reserved(outputs: Iterable[Output]) -> Iterator[None]:
    """Reserve the files of a run within the context, so that inner runs cannot write them."""
    taken = list(outputs)
    _in_use.extend(taken)
    try:
        yield
    finally:
        for output in taken:
            _in_use.remove(output)


def beside(path: Path, ending: str = ".part") -> Path:
    """Return the path of a file in the same directory, such as a temporary file."""
    return path.with_name(f"{path.name}{ending}")


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add the file, the reason and, on a full disk, the free space to errors of writing."""
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
    """File that is written at byte positions; ``new`` creates or empties it; errors name it."""

    def __init__(self, path: Path, *, new: bool = True) -> None:
        self.path = path
        flags = os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT | os.O_TRUNC if new else 0)
        with naming(path):
            self._file = os.open(path, flags, 0o666)
        self.closed = False
        self._regular = stat.S_ISREG(os.fstat(self._file).st_mode)
        self._digest, self._hashed = hashlib.sha256(), 0

    @property
    def size(self) -> int:
        """Length of the file; bytes."""
        return os.fstat(self._file).st_size

    def put(self, at: int, data: bytes | bytearray) -> None:
        """Write at a position in bytes; append to a pipe or terminal."""
        rest = memoryview(data)
        with naming(self.path):
            while rest:
                file = self._file
                done = os.pwrite(file, rest, at) if self._regular else os.write(file, rest)
                rest, at = rest[done:], at + done

    def read(self, at: int, count: int) -> bytes:
        """Read ``count`` bytes from a position, or fewer at the end of the file."""
        return os.pread(self._file, count, at)

    def digest(self, length: int) -> bytes:
        """Return the SHA-256 of the first ``length`` bytes; they must not change later.

        Each byte is read once, so ``length`` must not decrease from call to call.  The digest of a
        file that is too short differs.
        """
        while self._regular and self._hashed < length:
            block = self.read(self._hashed, min(length - self._hashed, BLOCK))
            if not block:
                break
            self._digest.update(block)
            self._hashed += len(block)
        return self._digest.digest()

    def cut(self, length: int) -> None:
        """Truncate the file to ``length`` bytes."""
        if self._regular:
            os.ftruncate(self._file, length)

    def allocate(self, length: int) -> None:
        """Allocate ``length`` bytes, so that a full disk raises OSError here, not in a library."""
        missing = length - self.size
        if missing > 0 and hasattr(os, "posix_fallocate"):
            with naming(self.path):
                try:
                    os.posix_fallocate(self._file, self.size, missing)
                except OSError as error:
                    if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):  # not supported
                        raise

    def rename(self, path: Path) -> None:
        """Move the file; an existing file is replaced."""
        os.replace(self.path, path)
        self.path = path

    def sync(self) -> None:
        """Flush to the disk; :class:`FileNotFoundError` if the file was removed or replaced."""
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
                if error.errno not in (errno.EINVAL, errno.EROFS):  # pipe or terminal
                    raise

    def close(self) -> None:
        """Close the file; warn if it was removed or replaced."""
        in_place = is_at(self._file, self.path)
        os.close(self._file)
        self.closed = True
        if not in_place:
            warnings.warn(
                f"output {self.path} was removed or replaced during the run; data written to "
                "it are lost",
                RuntimeWarning,
                stacklevel=2,
            )


def changed(what: str) -> ArgumentError:
    """Return the error of an output that differs from its state at the checkpoint."""
    return WrongReader(
        f"{what}: it differs from the file at the checkpoint: it is missing, or was changed "
        "while the run was down; restore it, or delete the checkpoint to begin anew"
    )


# -- the format of saved data ----------------------------------------------------------------------

Content = dict[str, Any]
"""Arrays and JSON data by name."""

ADVICE = {
    "solution": "Take another copy of the file, or run and save the solution again",
    "study": "Delete the file to compute all members, or name another",
    "checkpoint": "Delete the file to begin anew, or name another",
}
"""Remedies for a file that cannot be used."""


class WrongReader(ArgumentError):
    """Error of an intact file that this call cannot use; its message has the remedy."""


DIGEST = 64  # number of bytes of the checksum at the end of a file

END = re.compile(rb"(?s).*?(\w+ of ufl_beam, \d+); written by ufl_beam ([!-~]+); sha256 \w{64}")
"""Pattern of the end of a file; its groups are the format and the version of the package."""


@cache
def version() -> str:
    """Return the version of the source tree if it is imported, else of the installed package."""
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    if project.is_file():
        text = project.read_text(encoding="utf-8")
        match = re.search(r'^name = "ufl_beam"\nversion = "([^"]+)"', text, re.MULTILINE)
        if match:
            return match[1]
    return metadata.version("ufl_beam")


def add_prefix(prefix: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return content with a prefix added to its names."""
    return {prefix + name: value for name, value in content.items()}


def remove_prefix(prefix: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content whose names begin with a prefix; remove the prefix from the names."""
    inside = ((n, v) for n, v in content.items() if n.startswith(prefix))
    return {name.removeprefix(prefix): value for name, value in inside}


def write(path: Path, format: str, content: Content, at: str = "") -> None:
    """Write a file; at any time either the previous or the new file is there as a whole.

    The ``format`` has a kind of content and a number, such as "solution of ufl_beam, 2"; the number
    grows whenever the meaning of files changes.  ``at`` is added to messages, such as the time.
    """
    require_writable(path)
    what, file = format.partition(" ")[0], io.BytesIO()
    try:
        arrays = {n: v for n, v in content.items() if isinstance(v, np.ndarray)}
        text = {n: v for n, v in content.items() if n not in arrays or v.dtype.hasobject}
        kept: dict[str, Any] = {n: v for n, v in arrays.items() if n not in text}
        np.savez(file, **kept)
        with zipfile.ZipFile(file, "a") as archive:
            archive.comment = f"{format}; written by ufl_beam {version()}; sha256 ".encode()
            archive.comment += bytes(DIGEST)
            archive.writestr("text.json", json.dumps(text, default=plain))
    except (TypeError, ValueError) as error:
        raise ArgumentError(
            f"{what} {path}{at} cannot be written: a state() must consist of numbers, "
            f"texts, lists and dicts: {error}"
        ) from None
    temporary = beside(path)
    try:
        try:
            with temporary.open("wb") as new, file.getbuffer() as data:
                data[-DIGEST:] = hashlib.sha256(data[:-DIGEST]).hexdigest().encode()
                new.write(data)
            sync(temporary)
            os.replace(temporary, path)
            sync(path.parent)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        free = shutil.disk_usage(path.parent).free
        before = "the one before is still there" if path.exists() else "there is none yet"
        raise OSError(
            error.errno or errno.EIO,
            f"{what} {path}{at} cannot be written: {error.strerror}; it needs "
            f"{file.tell() / 1e6:.3g} MB, and {path.parent} has {free / 1e6:.3g} MB; {before}",
        ) from None


def plain(value: Any) -> Any:
    """Convert arrays and numbers of NumPy for JSON; TypeError for other objects."""
    if isinstance(value, np.generic | np.ndarray) and not value.dtype.hasobject:
        return value.tolist()
    raise TypeError(repr(value))


@contextmanager
def decoding(path: Path, *formats: str, content: Content | None = None) -> Iterator[Content]:
    """Yield the content of a file, and raise :class:`ArgumentError` at every error in using it.

    The message has the path, a remedy, and the version that wrote a content that this version does
    not understand.  The file is read unless its ``content`` is given.
    """
    what = formats[0].partition(" ")[0]
    try:
        content = read(path, *formats) if content is None else content
        yield content
    except WrongReader as error:
        raise ArgumentError(f"{what} {path}: {error}") from None
    except Exception as error:  # of any library, as a file may have any content
        why, told = str(error), isinstance(error, ArgumentError)
        if not told or isinstance(error, OtherVersion):
            by = "the file is damaged"
            if content is not None:
                by = f"version {content['version']} of ufl_beam wrote it, and this version, "
                by += f"{version()}, cannot use it"
            why = f"{by}: {why if told else repr(error)}"
        raise ArgumentError(f"{what} {path}: {why}. {ADVICE[what]}") from None if told else error


def read(path: Path, *formats: str) -> Content:
    """Read a file in one of some formats; its content has the "version" that wrote it."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise ArgumentError("there is no such file") from None
    except OSError as error:
        raise ArgumentError(f"the file cannot be read: {error.strerror}") from None
    kind = formats[0].rpartition(", ")[0]
    end = END.fullmatch(data[-256:])
    if end is None:
        why = "its last line is wrong" if data else "it is empty"
        raise ArgumentError(f"the file holds no {kind}, or is damaged: {why}")
    if hashlib.sha256(data[:-DIGEST]).hexdigest().encode() != data[-DIGEST:]:
        raise ArgumentError("the file is damaged: its checksum does not match its content")
    actual, by = end[1].decode(), end[2].decode()
    if actual not in formats:
        raise ArgumentError(
            f"the file is a {actual}, written by version {by} of ufl_beam; this version, "
            f"{version()}, needs a {formats[0]}"
        )
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        if sum(member.file_size for member in archive.zip.infolist()) > len(data):
            raise ArgumentError("the file is damaged: its content is larger than the file")
        members = dict(archive)
    text: Content = json.loads(members.pop("text.json"))
    if not all(isinstance(values, np.ndarray) for values in members.values()):
        raise ValueError("a member is neither text nor an array")
    return {"version": by, **text, **members}


def require_arrays(content: Mapping[str, Any], shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Raise :class:`OtherVersion` unless arrays of 64-bit numbers have shapes; -1: any length."""
    for name, shape in shapes.items():
        values = np.asarray(content.get(name))
        same = len(values.shape) == len(shape) and all(
            expected in (length, -1) for length, expected in zip(values.shape, shape, strict=True)
        )
        if not same or values.dtype.kind not in "fi" or values.dtype.itemsize != 8:
            is_ = f"{values.dtype} of shape {values.shape}" if name in content else "missing"
            raise OtherVersion(
                f"the array {name!r} is {is_}, and must be numbers of 64 bits of shape {shape}"
            )
