# SPDX-License-Identifier: MIT
"""What `make study` says follows from its numbers; the runs themselves are not made here."""

import json
import math
from pathlib import Path

import advice
import pytest
import records


def run(scheme, seconds, error, degree=1):
    return {
        "scheme": scheme, "seconds": seconds, "error": error, "degree": degree, "cells": 8,
        "taken": 100,
    }  # fmt: skip


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


def test_advice_compares_schemes_by_time():
    (line,) = advice.advice([CASE])
    assert "an error of 0.001 takes 2 s with A, 100 steps, 8 cells; " in line
    assert "B as long" in line
    assert "C 3.0 times" in line
    assert "D does not reach it here; all runs with E fail" in line
    (none,) = advice.advice([{**CASE, "reference": 1.0}])
    assert "no run comes near the reference" in none


def test_the_table_has_means_over_scenes():
    slower = {**CASE, "runs": [run("A", 4.0, 5e-4), run("B", 1.0, 5e-4)]}
    rows = {line.split(" | ")[0]: line for line in advice.overall([CASE, slower])}
    # Means of 1 and 4 for A, of 1.1 and 1 for B
    assert rows["| A"].split(" | ")[2] == "2.00 (2 of 2)"
    assert rows["| B"].split(" | ")[2] == "1.05 (2 of 2)"
    assert rows["| D"].split(" | ")[2] == "— (0 of 1)"


def test_results_have_a_line_for_each_record():
    text = (Path(__file__).parents[1] / "results" / "study.json").read_text(encoding="utf-8")
    study = json.loads(text)
    assert records.in_lines(study) + "\n" == text
    rows = sum(len(case["runs"]) + len(case["dials"]) for case in study["cases"])
    assert rows < len(text.splitlines()) < rows + 20 * len(study["cases"])
    for value in ({}, [], [{}], {"a": [{"b": [1.5, None]}, {"c": {"d": [{"e": "f"}]}}]}, math.pi):
        assert json.loads(records.in_lines(value)) == value
