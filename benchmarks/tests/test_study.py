# SPDX-License-Identifier: MIT
"""Advice and files of `make study`, the benchmark of idle effects, imports of all benchmarks."""

import importlib
import json
import math
from pathlib import Path

import advice
import bench_idle
import pytest
import records

import ufl_beam as ub

BENCHMARKS = Path(__file__).parents[1]


@pytest.mark.parametrize("script", sorted(path.stem for path in BENCHMARKS.glob("*.py")))
def test_a_benchmark_can_be_imported(script):
    """No name that it uses was removed from the package."""
    assert importlib.import_module(script).__doc__


def run(scheme, seconds, error, degree=1):
    numbers = {"degree": degree, "cells": 8, "taken": 100}
    return {"scheme": scheme, "seconds": seconds, "error": error, **numbers}


CASE = {
    "name": "beam",
    "kind": "smooth",
    "reference": 1e-5,
    "runs": [
        run("A", 1.0, 5e-3),
        run("A", 2.0, 5e-4),
        run("A", 9.0, 5e-5),
        run("B", 2.2, 8e-4, degree=2),
        run("B", 5.0, 6e-5),
        run("C", 6.0, 9e-4),
        run("D", 0.1, 0.5),
        {"scheme": "E", "failed": "no equilibrium"},
    ],
}


@pytest.mark.parametrize(
    ("target", "scheme", "seconds"), [(1e-2, "A", 1.0), (1e-3, "A", 2.0), (1e-4, "B", 5.0)]
)
def test_the_cheapest_run_within_an_error_is_found(target, scheme, seconds):
    best = advice.cheapest(CASE, target)
    assert (best["scheme"], best["seconds"]) == (scheme, seconds)


def test_errors_that_the_reference_cannot_tell_are_not_claimed():
    assert advice.cheapest({**CASE, "reference": 6e-5}, 1e-4) is None
    assert advice.cheapest(CASE, 1e-5) is None
    (none,) = advice.advice([{**CASE, "reference": 1.0}])
    assert "no run comes near the reference" in none


def test_advice_compares_schemes_by_time():
    (line,) = advice.advice([CASE])
    assert "an error of 0.001 takes 2 s with A, 100 steps, 8 cells; " in line
    assert "B as long; C 3.0 times; D does not reach it here; all runs with E fail" in line
    slower = {**CASE, "runs": [run("A", 4.0, 5e-4), run("B", 1.0, 5e-4)]}
    cells = [line.split(" | ") for line in advice.overall([CASE, slower])]
    rows = {first: others for first, *others in cells}
    # Means of 1 and 4 for A, of 1.1 and 1 for B
    for scheme, mean in (("A", "2.00 (2 of 2)"), ("B", "1.05 (2 of 2)"), ("D", "— (0 of 1)")):
        assert rows[f"| {scheme}"][1] == mean


def test_results_have_a_line_for_each_record():
    text = (BENCHMARKS / "results" / "study.json").read_text(encoding="utf-8")
    study = json.loads(text)
    assert records.in_lines(study) + "\n" == text
    rows = sum(len(case["runs"]) + len(case["dials"]) for case in study["cases"])
    assert rows < len(text.splitlines()) < rows + 20 * len(study["cases"])
    for value in ({}, [], [{}], {"a": [{"b": [1.5, None]}, {"c": {"d": [{"e": "f"}]}}]}, math.pi):
        assert json.loads(records.in_lines(value)) == value


@pytest.mark.parametrize("name", bench_idle.CASES)
def test_the_effects_are_idle(name):
    (record,) = bench_idle.measure(name, rounds=1, steps={4: 20})
    assert record["us_per_step_without"] > 0


def test_an_effect_that_acts_is_refused(monkeypatch):
    push = bench_idle.load(lambda beam: ub.PointLoad(beam.end, force=(0.0, 1.0)))
    monkeypatch.setitem(bench_idle.CASES, "a force", (push, {}))
    with pytest.raises(RuntimeError, match="a force, 4 cells: the effect changes the motion"):
        list(bench_idle.measure("a force", rounds=1, steps={4: 20}))


def test_the_table_has_a_row_for_each_effect_and_two_columns_for_each_mesh():
    measured = [
        {"case": name, "cells": n, "us_per_step_without": 8.0, "ratio": 1.5}
        for name in ("one", "other")
        for n in (8, 64)
    ]
    *_, head, _, one, other = bench_idle.table(measured, rounds=3).splitlines()
    assert head.count("|") == 6
    for name, row in (("one", one), ("other", other)):
        assert row == f"| {name} | 1.50 | 4.0 | 1.50 | 4.0 |"
