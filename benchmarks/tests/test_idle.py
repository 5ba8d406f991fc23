# SPDX-License-Identifier: MIT
"""The benchmark of idle effects: its effects are idle, and one that acts is refused."""

import bench_idle as bench
import pytest

import ufl_beam as ub


@pytest.mark.parametrize("name", bench.CASES)
def test_the_effects_are_idle(name):
    (record,) = bench.measure(name, rounds=1, steps={4: 20})
    assert record["us_per_step_without"] > 0


def test_an_effect_that_acts_is_refused(monkeypatch):
    push = bench.load(lambda beam: ub.PointLoad(beam.end, force=(0.0, 1.0)))
    monkeypatch.setitem(bench.CASES, "a force", (push, {}))
    with pytest.raises(RuntimeError, match="a force, 4 cells: the effect changes the motion"):
        list(bench.measure("a force", rounds=1, steps={4: 20}))


def test_the_table_has_a_row_for_each_effect_and_two_columns_for_each_mesh():
    records = [
        {"case": name, "cells": n, "us_per_step_without": 8.0, "ratio": 1.5}
        for name in ("one", "other")
        for n in (8, 64)
    ]
    *_, head, _, one, other = bench.table(records, rounds=3).splitlines()
    assert head.count("|") == one.count("|") == 6
    assert (one, other) == (
        "| one | 1.50 | 4.0 | 1.50 | 4.0 |", "| other | 1.50 | 4.0 | 1.50 | 4.0 |",
    )  # fmt: skip
