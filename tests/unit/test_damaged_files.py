# SPDX-License-Identifier: MIT
"""Damaged and foreign files: refused with a clear error, or what they say is as it was written."""

import hashlib
import io
import math
import pickle
import re
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.output import output_files
from ufl_beam.output.output_files import add_prefix, version

SECTION = ub.Section(
    EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=0.1, bending=ub.ElastoPlastic(0.5, 10.0)
)


def scene():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="left")
    load = ub.PointLoad(beam.end, force=(0, -3), amplitude=lambda t: math.sin(3 * t))
    return clamped(beam, loads=[load])


def run(*, until=0.5, **more):
    return ub.simulate(scene(), ub.EnergyMomentum(), t=(0, until), dt=0.1, **more)


class Solutions:
    """A saved solution; ``read`` gives what decides whether another one is the same."""

    format = "solution of ufl_beam, 6"
    advice = "Take another copy of the file, or run and save the solution again"

    def write(self, path):
        run().save(path)

    def read(self, path):
        return ub.Solution.load(path).q.tobytes()


class Studies:
    """The file of a study."""

    format = "study of ufl_beam, 3"
    advice = "Delete the file to compute all members, or name another"

    def write(self, path):
        ub.study(self.member, [{"x": x} for x in range(3)], path=path)

    def member(self, x):
        return {"row": np.arange(4.0) ** x, "other": np.arange(4.0)}

    def read(self, path):
        return ub.Study.load(path)["row"].tobytes()


class Checkpoints:
    """A checkpoint, from which the run goes on to a later end."""

    format = "checkpoint of ufl_beam, 9"
    advice = "Delete the file to begin anew, or name another"

    def write(self, path):
        run(checkpoint=ub.Checkpoint(path, every=100))

    def read(self, path):
        return run(checkpoint=ub.Checkpoint(path, every=100)).q.tobytes()


KINDS = {"solution": Solutions(), "study": Studies(), "checkpoint": Checkpoints()}


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


def flip_and_read(kind, path, flips):
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


@pytest.mark.serial
def test_a_flipped_bit_is_seen(kind, path):
    flip_and_read(kind, path, 60)


@pytest.mark.slow
@pytest.mark.serial
def test_400_flipped_bits_are_seen(kind, path):
    flip_and_read(kind, path, 400)


def zipped(members):
    """A zip archive of these bytes by name."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as made:
        for name, data in members.items():
            made.writestr(name, data)
    return file.getvalue()


def swapped(data):
    """The archive with the contents of its first two arrays of one length exchanged."""
    with zipfile.ZipFile(io.BytesIO(data)) as found:
        sizes = {}
        for one in found.infolist():
            other = sizes.setdefault(one.file_size, one)
            if found.read(other) != found.read(one):
                break
        else:
            pytest.fail("there are no two arrays of one length")
        first, second = found.read(other), found.read(one)
    begin, end = data.index(first), data.index(second)
    out = bytearray(data)
    out[begin : begin + len(first)], out[end : end + len(second)] = second, first
    return bytes(out)


DAMAGES = {
    "empty": (lambda data: b"", "or is damaged: it is empty"),
    "text": (lambda data: b"hello", "or is damaged: its last line is wrong"),
    "zip": (lambda data: zipped({"a.txt": b"a"}), "its last line is wrong"),
    "numpy": (lambda data: zipped({"a.npy": b"a"}), "its last line is wrong"),
    "half": (lambda data: data[: len(data) // 2], "its last line is wrong"),
    "last byte": (lambda data: data[:-1], "its last line is wrong"),
    "longer": (lambda data: data + b"0", "its last line is wrong"),
    "first byte": (lambda data: data[1:], "its checksum does not match its content"),
    "end alone": (lambda data: data[-256:], "its checksum does not match its content"),
    "swapped": (swapped, "its checksum does not match its content"),
    "twice": (lambda data: data + data, "its checksum does not match its content"),
}


@pytest.mark.serial
@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_no_file_of_the_kind(kind, damage, path):
    change, message = DAMAGES[damage]
    kind.write(path)
    path.write_bytes(change(path.read_bytes()))
    refused(kind, path, message)


@pytest.mark.serial
def test_hdf5_of_others_and_directories(kind, path):
    with h5py.File(path, "w") as file:
        file["q"] = np.zeros(3)
    refused(kind, path, f"holds no {kind.format[:-3]}")
    path.unlink()
    path.mkdir()
    refused(kind, path, "cannot be read: Is a directory")


@pytest.mark.serial
@pytest.mark.parametrize("other", KINDS)
def test_files_of_other_kinds_and_versions(kind, other, path, monkeypatch):
    if (other := KINDS[other]) is not kind:
        other.write(path)
        refused(kind, path, f"is a {other.format}, written by version {version()}")
        return
    monkeypatch.setattr(output_files, "version", lambda: "9.8.7")
    later = f"{kind.format[:-1]}99"
    output_files.write(path, later, {})
    monkeypatch.undo()
    refused(
        kind, path, f"is a {later}, written by version 9.8.7 of ufl_beam; this version, "
        f"{version()}, needs a {kind.format}",
    )  # fmt: skip


# -- files that are wrong in spite of their checksum -----------------------------------------------


def forge(kind, path, change):
    """Write the file with another content and the checksum of that."""
    kind.write(path)
    content = output_files.read(path, kind.format)
    change(content)
    output_files.write(path, kind.format, content)


def forge_members(kind, path, change):
    """As :func:`forge`, with the bytes of the members."""
    kind.write(path)
    data = path.read_bytes()
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        members, comment = {name: file.read(name) for name in file.namelist()}, file.comment
    change(members)
    again = io.BytesIO()
    with zipfile.ZipFile(again, "w") as file:
        for name, content in members.items():
            big = len(content) > 10**6
            kind_of = zipfile.ZIP_DEFLATED if big else zipfile.ZIP_STORED
            file.writestr(name, content, compress_type=kind_of)
        file.comment = comment
    data = again.getvalue()[:-64]
    path.write_bytes(data + hashlib.sha256(data).hexdigest().encode())


def changed(name, make):
    def change(content):
        content[name] = make(content[name])

    return change


WRONG = {
    "shape of q": ("solution", changed("history/q", lambda q: q[:, :-1]), "'q' is float64 of"),
    "times": ("solution", changed("history/t", lambda t: t[:-1]), "'reactions' is float64 of"),
    "type of q": ("solution", changed("history/q", lambda q: q.astype("f4")), "'q' is float32"),
    "text in q": ("solution", changed("history/q", lambda q: q.astype(str)), "'q' is <U"),
    "velocities": ("solution", changed("history/v", lambda v: v[1:]), "'v' is float64"),
    "ledger": (
        "solution", changed("history/state: kinetic", lambda x: x[1:]), "kinetic' is float64"
    ),
    "counts": ("solution", changed("counts", lambda x: x[:1]), "'counts' is int64 of shape (1,)"),
    "cells": (
        "solution", changed("history/material", lambda x: x[:, :1]), "'material' is float64"
    ),
    "no q": ("solution", lambda content: content.pop("history/q"), "'q' is missing"),
    "no scene": ("solution", lambda content: content.pop("scene"), "KeyError('scene')"),
    "no class": ("solution", changed("kind", lambda kind: "Keeper"), "KeyError('Keeper')"),
    "seconds": ("solution", changed("seconds", lambda x: "soon"), "ValueError("),
    "numbering": (
        "solution", changed("numbering", lambda x: x + 1),
        f"version {version()} of ufl_beam wrote it, and this version, {version()}, cannot use it: "
        "it numbers degrees of freedom differently",
    ),
    "field": (
        "solution", changed("scene", lambda s: s["records"][-1].update(odd=1) or s), "odd"
    ),
    "cells of a beam": (
        "solution",
        changed("scene", lambda s: [
            r.update(cells=10**15) for r in s["records"] if r["is"] == "Beam"
        ] and s),
        "left: cells = 1000000000000000",
    ),
    "results": ("study", changed("results/row", lambda x: x[:-1]), "'row' is float64 of shape"),
    "seconds of members": ("study", changed("seconds", lambda x: x[0]), "'seconds' is float64"),
    "errors": ("study", changed("errors", lambda x: x[1:]), "'errors' lacks an entry"),
    "cases": ("study", changed("cases", lambda x: ["{"] * 3), "JSONDecodeError"),
    "no member": ("study", lambda content: content.pop("member"), "KeyError('member')"),
    "state": ("checkpoint", changed("state/q", lambda q: q[1:]), "'q' of the state is of shape"),
    "no state": ("checkpoint", lambda content: content.pop("state/q"), "'q' of the state is miss"),
    "points": ("checkpoint", lambda content: [
        content.update({name: x[:, :1]}) for name, x in [*content.items()] if "cells, " in name
    ], "of the state is of shape"),
    "another table": ("checkpoint", lambda content: [
        content.update({f"state/material, {name.rpartition(' ')[2]}": content.pop(name)})
        for name in [*content] if "cells, " in name and name.startswith("state/c")
    ], "cannot use it: the array 'cells, "),
    "one more table": (
        "checkpoint", lambda content: content.update({"state/wear, 2": np.zeros((1, 3))}),
        "cannot use it: the array 'wear, 2' is unknown",
    ),
    "history": ("checkpoint", changed("history/q", lambda q: q[1:]), "'q' is float64 of shape"),
    "pace": ("checkpoint", lambda content: content.pop("pace/steps"), "KeyError('steps')"),
    "call": ("checkpoint", changed("call", lambda x: 3), "TypeError("),
    "stateful": ("checkpoint", changed("stateful", lambda x: {"a": 1}), "other objects have a"),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_content_is_refused(wrong, path):
    what, change, message = WRONG[wrong]
    forge(KINDS[what], path, change)
    refused(KINDS[what], path, message)


class Notes(ub.extend.Recorder):
    """A recorder of a user, with a state of one array."""

    def open(self, simulation):
        self.count = np.zeros(1)

    def write(self, simulation):
        self.count += 1

    def state(self):
        return {"count": self.count}

    def resume(self, simulation, state):
        self.count = state["count"].copy()


@pytest.mark.serial
@pytest.mark.parametrize(
    ("name", "make"), [("run.csv", ub.History), ("run.xdmf", ub.XDMF), ("notes", lambda _: Notes())]
)
def test_recorders_whose_state_is_missing(name, make, path, tmp_path):
    checkpoint = ub.Checkpoint(path, every=100)
    run(checkpoint=checkpoint, record=make(tmp_path / name))
    format = KINDS["checkpoint"].format
    content = output_files.read(path, format)
    without = {n: x for n, x in content.items() if not n.startswith("recorder 0/")}
    output_files.write(path, format, without)
    with pytest.raises(
        ub.ArgumentError, match=r"checkpoint .* cannot continue from it: KeyError\('"
    ):
        run(checkpoint=checkpoint, record=make(tmp_path / name))


@pytest.mark.serial
def test_extremes_of_another_shape(path):
    checkpoint = ub.Checkpoint(path, every=100)
    run(checkpoint=checkpoint, record=ub.Extremes())
    format = KINDS["checkpoint"].format
    content = output_files.read(path, format)
    content["recorder 0/forces low"] = content["recorder 0/forces low"].T
    output_files.write(path, format, content)
    with pytest.raises(
        ub.ArgumentError, match=r"checkpoint .*the array 'forces low' is float64 of"
    ):
        run(checkpoint=checkpoint, record=ub.Extremes())


def header(shape, descr="'<f8'"):
    """The beginning of an array of NumPy."""
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


class Evil:
    """Runs code of its own where it is unpickled."""

    def __reduce__(self):
        return (Path.touch, (Path("unpickled"),))


MEMBERS = {
    "pickle": (header((), "'|O'") + pickle.dumps(Evil()), "allow_pickle=False"),
    "bare pickle": (pickle.dumps(Evil()), "damaged: ValueError"),
    "absurd": (header((10**15,)), "damaged: "),
    "negative": (header((-5,)), "damaged: "),
    "too short": (header((7,)) + bytes(8), "damaged: ValueError"),
    "header": (b"\x93NUMPY\x01\x00\xff\xff{'descr': __import__('os')}", "damaged: ValueError"),
    "bomb": (header((10**8,)) + bytes(10**8), "its content is larger than the file"),
}


@pytest.mark.serial
@pytest.mark.parametrize("member", MEMBERS)
def test_arrays_that_are_none(kind, member, path, tmp_path, monkeypatch):
    """No code of a file is run, and no memory is taken for what is not in it."""
    monkeypatch.chdir(tmp_path)
    content, message = MEMBERS[member]
    forge_members(kind, path, lambda members: members.update({"odd.npy": content}))
    refused(kind, path, message)
    assert not Path("unpickled").exists()


TEXTS = {
    "none": (None, "text.json"),
    "no JSON": (b"{", "JSONDecodeError"),
    "no text": (b"\xff\xfe\xff", "damaged: UnicodeDecodeError"),
    "a list": (b"[]", "damaged: "),
    "nested": (b"[" * 100_000, "damaged: RecursionError"),
}


@pytest.mark.serial
@pytest.mark.parametrize("text", TEXTS)
def test_text_that_is_none(kind, text, path):
    content, message = TEXTS[text]

    def change(members):
        del members["text.json"]
        if content is not None:
            members["text.json"] = content

    forge_members(kind, path, change)
    refused(kind, path, message)


def test_what_cannot_be_written_is_said(tmp_path):
    for name, value in (("a", {1j}), ("a", np.array([None])), ("\ud800", np.zeros(2))):
        path, content = tmp_path / "file", {name: value}
        with pytest.raises(ub.ArgumentError, match="file of t = 1 s cannot be written: "):
            output_files.write(path, "study of ufl_beam, 2", content, " of t = 1 s")
    assert not [*tmp_path.iterdir()]


# -- earlier versions ------------------------------------------------------------------------------


@pytest.mark.serial
def test_files_of_earlier_versions_are_refused(kind, path):
    """Their classes had other names."""
    number = {"study of ufl_beam, 3": 1}.get(kind.format, int(kind.format[-1]) - 1)
    earlier = f"{kind.format[:-1]}{number}"
    output_files.write(path, earlier, {})
    refused(kind, path, f"is a {earlier}, written by version", f"needs a {kind.format}")


# -- time series that a run goes on with -----------------------------------------------------------

SERIES = {"run.csv": ub.History, "run.xdmf": ub.XDMF, "run.vtkhdf": ub.VTKHDF}


def recorded(folder, name, until):
    record = SERIES[name](folder / name)
    run(until=until, record=record, checkpoint=ub.Checkpoint(folder / "checkpoint", every=100))
    return [path for path in record.files if path.exists()]


def flip_and_resume(name, folder, flips):
    """Flip a bit that is not in empty space: the run is refused, or ends as the whole one."""
    (folder / "whole").mkdir()
    recorded(folder / "whole", name, 1.0)
    whole = numbers(folder / "whole" / name)
    files = recorded(folder, name, 0.5)
    before = {path: path.read_bytes() for path in (*files, folder / "checkpoint")}
    chance, refusals, errors = np.random.default_rng(3), 0, 0
    for path in files:
        written = np.flatnonzero(~np.isin(np.frombuffer(before[path], np.uint8), (0, ord(" "))))
        for at in chance.choice(written, flips):
            data = bytearray(before[path])
            data[at] ^= 1 << int(chance.integers(0, 8))
            path.write_bytes(data)
            try:
                recorded(folder, name, 1.0)
            except ub.ArgumentError as error:
                refusals += "it differs from the file at the checkpoint" in str(error)
                errors += 1
                assert path.read_bytes() == data  # as it was found
            else:
                assert numbers(folder / name) == whole
            for one, content in before.items():
                one.write_bytes(content)
    assert refusals == errors > flips / 2
    recorded(folder, name, 1.0)
    assert numbers(folder / name) == whole


@pytest.mark.serial
@pytest.mark.parametrize("name", SERIES)
def test_a_changed_part_of_a_time_series_is_refused(name, tmp_path):
    flip_and_resume(name, tmp_path, 25)


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("name", SERIES)
def test_400_changes_of_a_time_series_are_refused(name, tmp_path):
    flip_and_resume(name, tmp_path, 400)


def numbers(path):
    """All that a time series has, to the bit."""
    if path.suffix == ".vtkhdf":
        with h5py.File(path) as file:
            found = {}
            file.visititems(
                lambda name, one: (
                    found.update({name: one[()].tobytes()})
                    if isinstance(one, h5py.Dataset)
                    else None
                )
            )
            return found
    return path.read_bytes()


@pytest.mark.serial
@pytest.mark.parametrize("name", SERIES)
def test_each_number_of_a_time_series_is_checked(name, tmp_path):
    """A number of the first rows that was changed by hand, with all sizes as they were."""
    files = recorded(tmp_path, name, 0.5)
    path = files[-1]
    if name.endswith(".vtkhdf"):
        with h5py.File(path, "r+") as file:
            file["VTKHDF/PointData/rotation"][-1] += 1e-9
    elif name.endswith(".xdmf"):
        data = bytearray(path.read_bytes())
        data[data.rindex(b"</DataItem>") - 1] ^= 1
        path.write_bytes(data)
    else:
        path.write_text(path.read_text().replace("0.2,", "0.3,", 1))
    with pytest.raises(
        ub.ArgumentError, match="it is missing, or was changed while the run was down"
    ):
        recorded(tmp_path, name, 1.0)


def test_a_history_is_checked_on_all_processes(shared_path, on_first_rank):
    recorded(shared_path, "run.csv", 0.5)
    table = shared_path / "run.csv"
    on_first_rank(lambda: table.write_text(table.read_text().replace("0.2,", "0.3,", 1)))
    with pytest.raises(ub.ArgumentError, match="it differs from the file at the checkpoint"):
        recorded(shared_path, "run.csv", 1.0)


def test_names_have_prefixes():
    assert add_prefix("a/", {"b": 1}) == {"a/b": 1}
    assert output_files.remove_prefix("a/", {"a/b": 1, "c": 2}) == {"b": 1}
