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
    file.write(json.dumps({"case": "beam", "cells": 8, "us_per_step": %d, "iterations": 3}) + "\\n")
"""


@pytest.mark.parametrize(
    ("other", "this", "row", "slower"),
    [
        # The machine is twice as slow in the second round, and disturbed in the third.
        ([10, 20, 10], [5, 10, 40], "10 | 10 | 0.50 | 0.50 to 4.00", 0),
        ([10, 10, 10], [10.7, 10.6, 10.1], "10 | 10.6 | 1.06 | 1.01 to 1.07", 1),
        ([10, 10, 10], [10.7, 10.6, 9.9], "10 | 10.6 | 1.06 | 0.99 to 1.07", 0),
        ([10, 10, 10], [10.4, 10.4, 11], "10 | 10.4 | 1.04 | 1.04 to 1.10", 0),
    ],
)
def test_ratios_are_taken_within_a_round(other, this, row, slower):
    """A case is slower if it is so in the median and in each round."""
    key, gone = ("beam", "us_per_step"), ("gone", "us_per_step")
    rounds = [({key: a, gone: a}, {key: b}) for a, b in zip(other, this, strict=True)]
    *_, found, _, end = compare.table(rounds).splitlines()
    assert found == f"| beam | us_per_step | {row} |"
    named = "; beam, us_per_step" * slower
    assert end == f"2 cases: 1 missing; gone, us_per_step, {slower} slower by more than 5%{named}"


def test_two_commits_are_run_in_turn(tmp_path):
    def git(*words):
        who = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
        return subprocess.run([*who, *words], check=True, capture_output=True, text=True).stdout

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
    assert len(git("worktree", "list").splitlines()) == 1
