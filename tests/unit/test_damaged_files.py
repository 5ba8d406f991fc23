# SPDX-License-Identifier: MIT
"""Damaged and foreign files: refused with a clear error, or what they say is as it was written."""

import hashlib
import io
import math
import pickle
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub
from ufl_beam.output import output_files
from ufl_beam.output.output_files import version

SECTION = ub.Section(
    EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=0.1, bending=ub.ElastoPlastic(0.5, 10.0)
)


def scene():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="left")
    load = ub.PointLoad(beam.end, force=(0, -3), amplitude=lambda t: math.sin(3 * t))
    return clamped(beam, loads=[load])


def run(*, until=0.5, **more):
    return ub.simulate(scene(), ub.EnergyMomentum(), t=(0, until), dt=0.1, **more)


class Kind(NamedTuple):
    """A kind of file; ``read`` returns the bytes that decide whether another one is the same."""

    format: str
    advice: str
    write: Callable
    read: Callable


def member(x):
    return {"row": np.arange(4.0) ** x, "other": np.arange(4.0)}


KINDS = {
    "solution": Kind(
        "solution of ufl_beam, 6",
        "Take another copy of the file, or run and save the solution again",
        lambda path: run().save(path),
        lambda path: ub.Solution.load(path).q.tobytes(),
    ),
    "study": Kind(
        "study of ufl_beam, 3",
        "Delete the file to compute all members, or name another",
        lambda path: ub.study(member, [{"x": x} for x in range(3)], path=path),
        lambda path: ub.Study.load(path)["row"].tobytes(),
    ),
    "checkpoint": Kind(
        "checkpoint of ufl_beam, 9",
        "Delete the file to begin anew, or name another",
        lambda path: run(checkpoint=ub.Checkpoint(path, every=100)),
        lambda path: run(checkpoint=ub.Checkpoint(path, every=100)).q.tobytes(),
    ),
}
serial = pytest.mark.serial


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "file.of any kind"


def refused(kind, path, *parts):
    """The error of reading a file names it, has these parts, and says what to do."""
    with pytest.raises(ub.ArgumentError) as error:
        kind.read(path)
    what = kind.format.partition(" ")[0]
    assert str(error.value).startswith(f"{what} {path}: "), error.value
    assert str(error.value).endswith(f". {kind.advice}"), error.value
    assert re.search(".*".join(map(re.escape, parts)), str(error.value)), error.value


# -- damage ----------------------------------------------------------------------------------------


@serial
@pytest.mark.parametrize("flips", [60, pytest.param(400, marks=pytest.mark.slow)])
def test_a_flipped_bit_is_seen(kind, path, flips):
    kind.write(path)
    good, chance = path.read_bytes(), np.random.default_rng(1)
    expected = kind.read(path)
    ends = [*range(8), *range(len(good) - 200, len(good), 9)]
    for at in [*ends, *chance.integers(0, len(good), flips - len(ends))]:
        bad = bytearray(good)
        bad[at] ^= 1 << int(chance.integers(0, 8))
        path.write_bytes(bad)
        refused(kind, path)
    path.write_bytes(good)
    assert kind.read(path) == expected


@serial
def test_a_part_of_a_file_and_more_than_a_file(kind, path):
    kind.write(path)
    good, checksum = path.read_bytes(), "its checksum does not match its content"
    for bad, message in (
        (b"", "or is damaged: it is empty"),
        (b"hello", "or is damaged: its last line is wrong"),
        (good[: len(good) // 2], "its last line is wrong"),
        (good + b"0", "its last line is wrong"),
        (good[-256:], checksum),
        (good + good, checksum),
    ):
        path.write_bytes(bad)
        refused(kind, path, message)


@serial
def test_hdf5_of_others_and_directories(kind, path):
    with h5py.File(path, "w") as file:
        file["q"] = np.zeros(3)
    refused(kind, path, f"holds no {kind.format[:-3]}")
    path.unlink()
    path.mkdir()
    refused(kind, path, "cannot be read: Is a directory")


@serial
def test_files_of_other_kinds_and_versions(kind, path, monkeypatch):
    others = [other.format for other in KINDS.values() if other is not kind]
    for format in (*others, f"{kind.format[:-1]}1", f"{kind.format[:-1]}99"):
        with monkeypatch.context() as other_version:
            other_version.setattr(output_files, "version", lambda: "9.8.7")
            output_files.write(path, format, {})
        refused(
            kind, path, f"is a {format}, written by version 9.8.7 of ufl_beam; this version, "
            f"{version()}, needs a {kind.format}",
        )  # fmt: skip


# -- files that are wrong in spite of their checksum -----------------------------------------------


def rewrite(path, what, change):
    """Write the file with another content and the checksum of that."""
    content = output_files.read(path, KINDS[what].format)
    change(content)
    output_files.write(path, KINDS[what].format, content)


def changed(name, make):
    return lambda content: content.update({name: make(content[name])})


def without(name):
    return lambda content: content.pop(name)


def with_beams(scene, **fields):
    for record in scene["records"]:
        record.update(fields if record["is"] == "Beam" else {})
    return scene


WRONG = [
    ("solution", changed("history/q", lambda q: q[:, :-1]), "'q' is float64 of"),
    ("solution", changed("history/q", lambda q: q.astype("f4")), "'q' is float32"),
    ("solution", without("history/q"), "'q' is missing"),
    ("solution", changed("history/v", lambda v: v[1:]), "'v' is float64"),
    ("solution", changed("counts", lambda x: x[:1]), "'counts' is int64 of shape (1,)"),
    ("solution", without("scene"), "KeyError('scene')"),
    ("solution", changed("seconds", lambda x: "soon"), "ValueError("),
    ("solution", changed("numbering", lambda x: x + 1), "it numbers degrees of freedom differ"),
    ("solution", changed("scene", lambda s: with_beams(s, odd=1)), "odd"),
    ("solution", changed("scene", lambda s: with_beams(s, cells=10**15)), "left: cells = 10000000"),
    ("study", changed("results/row", lambda x: x[:-1]), "'row' is float64 of shape"),
    ("study", changed("errors", lambda x: x[1:]), "'errors' lacks an entry"),
    ("study", changed("cases", lambda x: ["{"] * 3), "JSONDecodeError"),
    ("checkpoint", changed("state/q", lambda q: q[1:]), "'q' of the state is of shape"),
    (
        "checkpoint",
        lambda content: content.update({n: x[:, :1] for n, x in content.items() if "cells, " in n}),
        "of the state is of shape",
    ),
    (
        "checkpoint", lambda content: content.update({"state/wear, 2": np.zeros((1, 3))}),
        f"version {version()} of ufl_beam wrote it, and this version, {version()}, cannot use it: "
        "the array 'wear, 2' is unknown",
    ),
    ("checkpoint", changed("history/q", lambda q: q[1:]), "'q' is float64 of shape"),
    ("checkpoint", changed("call", lambda x: 3), "TypeError("),
    ("checkpoint", changed("stateful", lambda x: {"a": 1}), "other objects have a"),
]  # fmt: skip


@serial
@pytest.mark.parametrize(("what", "change", "message"), WRONG, ids=[row[2] for row in WRONG])
def test_wrong_content_is_refused(what, change, message, path):
    KINDS[what].write(path)
    rewrite(path, what, change)
    refused(KINDS[what], path, message)


@serial
@pytest.mark.parametrize(
    ("make", "change", "message"),
    [
        (ub.Events, without("recorder 0/events"), "cannot continue from it: KeyError('events')"),
        (
            ub.Extremes,
            changed("recorder 0/forces low", np.transpose),
            "the array 'forces low' is float64 of",
        ),
    ],
)
def test_states_of_recorders_that_are_wrong(make, change, message, path):
    checkpoint = ub.Checkpoint(path, every=100)
    run(checkpoint=checkpoint, record=make())
    rewrite(path, "checkpoint", change)
    with raises("checkpoint ", message):
        run(checkpoint=checkpoint, record=make())


def header(shape, descr="'<f8'"):
    """The beginning of an array of NumPy."""
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


class Evil:
    """Runs code of its own where it is unpickled."""

    def __reduce__(self):
        return (Path.touch, (Path("unpickled"),))


MEMBERS = {
    "pickle": ("odd.npy", header((), "'|O'") + pickle.dumps(Evil()), "allow_pickle=False"),
    "bare pickle": ("odd.npy", pickle.dumps(Evil()), "damaged: ValueError"),
    "absurd": ("odd.npy", header((10**15,)), "damaged: "),
    "too short": ("odd.npy", header((7,)) + bytes(8), "damaged: ValueError"),
    "code": (
        "odd.npy", b"\x93NUMPY\x01\x00\xff\xff{'descr': __import__('os')}", "damaged: ValueError"
    ),
    "bomb": (
        "odd.npy", header((10**8,)) + bytes(10**8), "its content is larger than the file"
    ),
    "no text": ("text.json", None, "text.json"),
    "no JSON": ("text.json", b"{", "JSONDecodeError"),
    "no characters": ("text.json", b"\xff\xfe\xff", "damaged: UnicodeDecodeError"),
    "nested": ("text.json", b"[" * 100_000, "damaged: RecursionError"),
}  # fmt: skip


@serial
@pytest.mark.parametrize("member", MEMBERS)
def test_members_that_are_no_arrays_and_no_text(member, path, tmp_path, monkeypatch):
    """No code of a file is run, and no memory is taken for what is not in it."""
    monkeypatch.chdir(tmp_path)
    name, content, message = MEMBERS[member]
    KINDS["study"].write(path)
    with zipfile.ZipFile(path) as file:
        members = {n: file.read(n) for n in file.namelist() if n != name}
        comment = file.comment
    members |= {} if content is None else {name: content}
    again = io.BytesIO()
    with zipfile.ZipFile(again, "w", zipfile.ZIP_DEFLATED) as file:
        for one, written in members.items():
            packed = zipfile.ZIP_DEFLATED if len(written) > 10**6 else zipfile.ZIP_STORED
            file.writestr(one, written, compress_type=packed)
        file.comment = comment
    data = again.getvalue()[:-64]
    path.write_bytes(data + hashlib.sha256(data).hexdigest().encode())
    refused(KINDS["study"], path, message)
    assert not Path("unpickled").exists()


@serial
def test_what_cannot_be_written_is_said(path):
    for name, value in (("a", {1j}), ("a", np.array([None])), ("\ud800", np.zeros(2))):
        with raises("of t = 1 s cannot be written: "):
            output_files.write(path, "study of ufl_beam, 2", {name: value}, " of t = 1 s")
    assert not [*path.parent.iterdir()]


# -- time series that a run goes on with -----------------------------------------------------------

SERIES = {"run.csv": ub.History, "run.xdmf": ub.XDMF, "run.vtkhdf": ub.VTKHDF}


def recorded(folder, name, until):
    record = SERIES[name](folder / name)
    run(until=until, record=record, checkpoint=ub.Checkpoint(folder / "checkpoint", every=100))
    return [path for path in record.files if path.exists()]


def numbers(path):
    """All that a time series has, to the bit."""
    if path.suffix != ".vtkhdf":
        return path.read_bytes()
    found = {}

    def add(name, one):
        if isinstance(one, h5py.Dataset):
            found[name] = one[()].tobytes()

    with h5py.File(path) as file:
        file.visititems(add)
    return found


@serial
@pytest.mark.parametrize("flips", [20, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SERIES)
def test_a_changed_part_of_a_time_series_is_refused(name, flips, tmp_path):
    """A flipped bit outside of empty space: the run is refused, or ends as the whole one."""
    (tmp_path / "whole").mkdir()
    recorded(tmp_path / "whole", name, 1.0)
    whole = numbers(tmp_path / "whole" / name)
    files = recorded(tmp_path, name, 0.5)
    before = {path: path.read_bytes() for path in (*files, tmp_path / "checkpoint")}
    chance, refusals, errors = np.random.default_rng(3), 0, 0
    for path in files:
        written = np.flatnonzero(~np.isin(np.frombuffer(before[path], np.uint8), (0, ord(" "))))
        for at in chance.choice(written, flips):
            data = bytearray(before[path])
            data[at] ^= 1 << int(chance.integers(0, 8))
            path.write_bytes(data)
            try:
                recorded(tmp_path, name, 1.0)
            except ub.ArgumentError as error:
                refusals += "it differs from the file at the checkpoint" in str(error)
                errors += 1
                assert path.read_bytes() == data  # as it was found
            else:
                assert numbers(tmp_path / name) == whole
            for one, content in before.items():
                one.write_bytes(content)
    assert refusals == errors > flips / 2
    recorded(tmp_path, name, 1.0)
    assert numbers(tmp_path / name) == whole


def test_a_history_is_checked_on_all_processes(shared_path, on_first_rank):
    recorded(shared_path, "run.csv", 0.5)
    table = shared_path / "run.csv"
    on_first_rank(lambda: table.write_text(table.read_text().replace("0.2,", "0.3,", 1)))
    with raises("it differs from the file at the checkpoint"):
        recorded(shared_path, "run.csv", 1.0)
