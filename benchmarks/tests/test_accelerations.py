# SPDX-License-Identifier: MIT
"""The benchmark of `make accelerations`: what it switches off, compares and writes."""

from pathlib import Path

import accelerations
import bench_accelerations as bench
import pytest
import switches

import ufl_beam as ub

ROOT = Path(__file__).parents[2]


@pytest.fixture
def advanced():
    """Simulation of a variant by name, some large steps after the start of the elastic scene."""
    runs = []

    def make(name):
        runs.append(bench.Run(name, bench.flying_beam(8), 0.1))
        runs[-1].advance(3)
        return runs[-1].simulation

    yield make
    for run in runs:
        run.simulation.close()


@pytest.mark.parametrize("scene", ["elastic", "large", "swing", "hinged", "jointed"])
def test_all_variants_reach_the_same_state(scene):
    runs = bench.compared(scene, 8)
    assert list(runs) == bench.variants(scene)
    iterations = {name: run.simulation.iterations for name, run in runs.items()}
    exact = {n for name, n in iterations.items() if "modified" not in name}
    assert len(exact) == 1, iterations
    for run in runs.values():
        run.simulation.close()


def test_points_open_and_couplings_dissipate_in_the_scenes():
    run = bench.Run(bench.SHIPPED, bench.hinged_beam(8), 0.01)
    run.advance(150)
    assert (run.simulation.inelastic[0].points["opening"] > 0).sum() > 1
    jointed = bench.Run(bench.SHIPPED, bench.jointed_beams(16), 0.01)
    jointed.advance(150)
    assert min(jointed.simulation.ledger.lost.values()) > 0
    assert {type(connector.law) for connector in jointed.simulation.scene.connectors} == {
        ub.Spring, ub.RigidPlastic,
    }  # fmt: skip
    assert len(jointed.simulation.scene.beams) == 4


def test_a_variant_with_another_result_is_refused(monkeypatch):
    wrong = bench.VARIANTS["cell by cell"]._replace(newton={"rtol": 1e-3})
    monkeypatch.setitem(bench.VARIANTS, "cell by cell", wrong)
    with pytest.raises(RuntimeError, match="elastic, 8 cells: cell by cell is off by"):
        bench.compared("elastic", 8)


def state_of(simulation):
    """Type of Newton's method, and whether SIMD, chains, fronts and prediction are in use."""
    elimination = simulation.solver._factors._elimination.c
    return {
        "newton": simulation.solver._snes.getType(),
        "SIMD": bool(simulation.beams[0]._kernels.force.inserts),
        "two ends": elimination.count == 2,
        "no chains": elimination.left_size == len(simulation.q),
        "fronts": bool(simulation.equation.c.fronts),
        "second order": bool(simulation.prediction.c.second),
    }


def test_variants_switch_off_one_acceleration_and_leave_the_package_as_it_was(advanced):
    shipped = state_of(advanced(switches.SHIPPED))
    assert shipped == {
        "newton": "shell", "SIMD": True, "two ends": True, "no chains": False, "fronts": True,
        "second order": True,
    }  # fmt: skip
    for variant, change in {
        switches.PETSC: {"newton": "newtonls"},
        switches.SCALAR: {"SIMD": False},
        switches.WHOLE: {"no chains": True},
        switches.LEFT: {"fronts": False},
        switches.VELOCITY: {"second order": False},
    }.items():
        found = state_of(advanced(variant))
        assert {key: found[key] for key in change} == change
    for variant in switches.VARIANTS:
        advanced(variant)
    assert state_of(advanced(switches.SHIPPED)) == shipped


def test_kept_tangents_are_switched_off():
    def kept(name):
        run = bench.Run(name, bench.flying_beam(8), 0.1)
        found = 0
        for _ in range(80):
            run.advance(1)
            found += run.simulation.equation.c.near
        run.simulation.close()
        return found, run.simulation.iterations

    assert kept(switches.SHIPPED)[0] > 0
    assert kept(switches.TANGENTS)[0] == 0


# -- gains and lines -------------------------------------------------------------------------------


def case(variant, times, scene="elastic", cells=8):
    return {
        "scene": scene, "cells": cells, "variant": variant, "times": times, "rounds": len(times),
        "steps": 1, "us_median": 1e6 * sorted(times)[len(times) // 2], "us_min": 1e6 * min(times),
        "iterations": 2.0, "load": 0.5,
    }  # fmt: skip


def cases(factors):
    """Cases of all scenes; one round is ten times as slow, for all variants alike."""
    return [
        case(name, [f, 10 * f, 1.1 * f], scene, cells)
        for scene in bench.SCENES
        for cells in (8, 64)
        for name in bench.variants(scene)
        for f in [factors.get(name, 2.0) * cells]
    ]


def test_gains_are_ratios_within_a_round():
    found = bench.gains(cases({"as shipped": 1.0, "cell by cell": 1.5}))
    assert found["SIMD kernels"]["elastic", 64] == pytest.approx(1.5)
    assert found["dense fronts"]["hinged", 8] == pytest.approx(2.0)
    assert {scene for scene, _ in found["SIMD kernels"]} == {"elastic", "hinged", "jointed"}


def test_accelerations_of_little_gain_are_marked():
    found = bench.gains(cases({"as shipped": 1.0, "cell by cell": 1.09}))
    rows = {row.split(" | ")[0][2:]: row for row in bench.summary(found).splitlines()}
    assert "to be deleted" in rows["SIMD kernels"]
    assert "| 1.09 | 1.09 |" in rows["SIMD kernels"]
    assert "to be deleted" not in rows["dense fronts"]


def test_lines_of_code_are_counted_once():
    for one in accelerations.ACCELERATIONS.values():
        for place in one.code:
            assert accelerations.lines_of(place)
    text = (ROOT / "ufl_beam/compiled/c/beam_elimination.c").read_text(encoding="utf-8")
    assert accelerations.count(["compiled/c/beam_elimination.c"]) == len(text.splitlines())
    nested = ["solvers/substructuring.py:Klu", "solvers/substructuring.py"]
    assert accelerations.count(nested) == accelerations.count(nested[1:])
    start = min(accelerations.lines_of("compiled/c/newton.c:snes_newton"))[1]
    lines = (ROOT / "ufl_beam/compiled/c/newton.c").read_text(encoding="utf-8").splitlines()
    assert lines[start - 1].startswith("int snes_newton(")
    for gone in ("compiled/c/newton.c:gone", "solvers/newton.py:Solver.gone", "errors.py~no such"):
        with pytest.raises(ValueError, match="is not in the package"):
            accelerations.lines_of(gone)


def test_the_page_has_a_table_for_each_key(tmp_path):
    page = tmp_path / "page.md"
    text = bench.PAGE.read_text(encoding="utf-8")
    page.write_text(text, encoding="utf-8")
    bench.write(page, cases({"as shipped": 1.0}), 90)
    written = page.read_text(encoding="utf-8")
    for key in ("summary", "gains, jointed", "times, large"):
        inside = written.split(f"<!-- {key} -->\n")[1].split(f"<!-- end of {key} -->")[0]
        assert inside.startswith("| ")
        assert inside.endswith(" |\n")
    names = [name[1:] for name in bench.ACCELERATIONS]
    assert [name for name in names if name not in written] == []
    assert [name for name in names if name not in text] == []  # the command has written it
    assert "3 with 8 cells, 3 with 64 cells" in " ".join(written.split())


@pytest.mark.parametrize("scene", ["large", "hinged"])
def test_times_have_a_row_for_each_variant(scene):
    found = list(bench.measure(scene, 8, rounds=2, steps=1))
    assert [case["variant"] for case in found] == bench.variants(scene)
    assert all(len(case["times"]) == 2 and case["us_min"] > 0 for case in found)
    assert all(case["iterations"] >= 2 for case in found)
