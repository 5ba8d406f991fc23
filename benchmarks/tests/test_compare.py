# SPDX-License-Identifier: MIT
"""Benchmarks of two commits side by side: the table of ratios, and a run in a small repository."""

import subprocess

import compare
import pytest

BENCHMARK = """
import json, pathlib
results = pathlib.Path(__file__).parent / "results"
results.mkdir(exist_ok=True)
with (results / "bench_it.jsonl").open("a") as file:
    file.write(json.dumps({"case": "beam", "cells": 8, "us_per_step": %d, "commit": "x"}) + "\\n")
"""


def record(**times):
    return {"case": "beam", "cells": 8, "iterations": 3, "commit": "x", **times}


def test_times_are_found_by_their_names():
    found = compare.times([record(us_per_step=2.0, us_min=1.0), {"case": "other", "ms_per_run": 3}])
    assert found == {("beam, 8", "us_per_step"): 2.0, ("other", "ms_per_run"): 3}


def test_ratios_are_taken_within_a_round():
    """The machine is twice as slow in the second round, and disturbed in the third."""
    rounds = [(10.0, 5.0), (20.0, 10.0), (10.0, 40.0)]
    key = "beam", "us_per_step"
    lines = compare.table([({key: a, ("gone", "us_per_step"): a}, {key: b}) for a, b in rounds])
    assert lines.splitlines()[2:] == [
        "| beam | us_per_step | 10 | 10 | 0.50 | 0.50 to 4.00 |",
        "",
        "2 cases: 1 missing; gone, us_per_step, 0 slower by more than 5%",
    ]


@pytest.mark.parametrize(
    ("times", "slower"), [([10.7, 10.6, 10.1], 1), ([10.7, 10.6, 9.9], 0), ([10.4, 10.4, 11], 0)]
)
def test_a_case_is_slower_in_the_median_and_in_each_round(times, slower):
    key = "beam", "us_per_step"
    found = compare.table([({key: 10.0}, {key: time}) for time in times])
    assert f", {slower} slower" in found


def test_two_commits_are_run_in_turn(tmp_path):
    def git(*words):
        who = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", "-C", str(tmp_path), *who, *words], check=True, capture_output=True)

    git("init", "-q")
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "env").write_text('#!/bin/sh\nexec "$@"\n')
    (tmp_path / "env").chmod(0o755)
    for time in (40, 10):
        (tmp_path / "benchmarks" / "bench_it.py").write_text(BENCHMARK % time)
        git("add", "-A")
        git("commit", "-qm", f"Takes {time}")
    lines = list(compare.compare(tmp_path, "HEAD~1", "HEAD", ["bench_it"], rounds=2))
    assert [line.split(" ", 2)[-1] for line in lines[:2]] == ["Takes 40", "Takes 10"]
    assert "| beam, 8 | us_per_step | 40 | 10 | 0.25 | 0.25 to 0.25 |" in lines[2]
    assert not (tmp_path / "benchmarks" / "results").exists()
    left = subprocess.run(
        ["git", "-C", str(tmp_path), "worktree", "list"], check=True, capture_output=True, text=True
    )
    assert len(left.stdout.splitlines()) == 1
