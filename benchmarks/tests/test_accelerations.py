# SPDX-License-Identifier: MIT
"""The benchmark of `make accelerations`: what it switches off, compares and writes."""

import accelerations
import bench_accelerations as bench
import pytest
import switches


def advanced(name, make=lambda: bench.flying_beam(8), dt=0.1, steps=3):
    """A run of a variant, some steps after its start."""
    run = bench.Run(name, make(), dt)
    run.advance(steps)
    return run


@pytest.mark.parametrize("scene", ["elastic", "large", "swing", "hinged", "jointed"])
def test_all_variants_reach_the_same_state_and_are_timed(scene):
    found = list(bench.measure(scene, 8, rounds=2, steps=1))
    assert [case["variant"] for case in found] == bench.variants(scene)
    assert all(len(case["times"]) == 2 and case["us_min"] > 0 for case in found)
    assert all(case["iterations"] >= 2 for case in found)


def test_points_open_and_couplings_dissipate_in_the_scenes():
    hinged = advanced(bench.SHIPPED, lambda: bench.hinged_beam(8), 0.01, 150)
    assert (hinged.simulation.inelastic[0].points["opening"] > 0).sum() > 1
    jointed = advanced(bench.SHIPPED, lambda: bench.jointed_beams(16), 0.01, 150)
    assert min(jointed.simulation.ledger.lost.values()) > 0


def test_a_variant_with_another_result_is_refused(monkeypatch):
    wrong = bench.VARIANTS["cell by cell"]._replace(newton={"rtol": 1e-3})
    monkeypatch.setitem(bench.VARIANTS, "cell by cell", wrong)
    with pytest.raises(RuntimeError, match="elastic, 8 cells: cell by cell is off by"):
        bench.compared("elastic", 8)


def state_of(variant):
    """Type of Newton's method, and whether SIMD, chains, fronts and prediction are in use."""
    simulation = advanced(variant).simulation
    elimination = simulation.solver._factors._elimination.c
    found = {
        "newton": simulation.solver._snes.getType(),
        "SIMD": bool(simulation.beams[0]._kernels.force.inserts),
        "chains": elimination.left_size < len(simulation.q),
        "fronts": bool(simulation.equation.c.fronts),
        "second order": bool(simulation.prediction.c.second),
    }
    simulation.close()
    return found


def test_variants_switch_off_one_acceleration_and_leave_the_package_as_it_was():
    shipped = {"newton": "shell"} | dict.fromkeys(
        ("SIMD", "chains", "fronts", "second order"), True
    )
    for variant, name, found in (
        (switches.PETSC, "newton", "newtonls"),
        (switches.SCALAR, "SIMD", False),
        (switches.WHOLE, "chains", False),
        (switches.LEFT, "fronts", False),
        (switches.VELOCITY, "second order", False),
    ):
        assert state_of(variant)[name] == found
        assert state_of(switches.SHIPPED) == shipped


@pytest.mark.parametrize(("variant", "keeps"), [("SHIPPED", True), ("TANGENTS", False)])
def test_kept_tangents_are_switched_off(variant, keeps):
    run, found = advanced(getattr(switches, variant)), 0
    for _ in range(80):
        run.advance(1)
        found += run.simulation.equation.c.near
    assert (found > 0) == keeps


def cases(factors):
    """Cases of all scenes; one round is ten times as slow, for all variants alike."""
    rest = {"rounds": 3, "steps": 1, "us_median": 1.0, "us_min": 1.0, "iterations": 2, "load": 0.5}
    return [
        {"scene": scene, "cells": cells, "variant": name, "times": [f, 10 * f, 1.1 * f], **rest}
        for scene in bench.SCENES
        for cells in (8, 64)
        for name in bench.variants(scene)
        for f in [factors.get(name, 2.0) * cells]
    ]


def test_gains_are_ratios_within_a_round_and_little_gain_is_marked():
    found = bench.gains(cases({"as shipped": 1.0, "cell by cell": 1.09}))
    assert found["SIMD kernels"]["elastic", 64] == pytest.approx(1.09)
    assert found["dense fronts"]["hinged", 8] == pytest.approx(2.0)
    assert {scene for scene, _ in found["SIMD kernels"]} == {"elastic", "hinged", "jointed"}
    rows = {row.split(" | ")[0][2:]: row for row in bench.summary(found).splitlines()}
    assert "| 1.09 | 1.09 | less than a tenth everywhere: to be deleted" in rows["SIMD kernels"]
    assert "to be deleted" not in rows["dense fronts"]


def test_lines_of_code_are_counted_once():
    for one in accelerations.ACCELERATIONS.values():
        assert all(map(accelerations.lines_of, one.code))
    text = (accelerations.PACKAGE / "compiled/c/newton.c").read_text(encoding="utf-8").splitlines()
    assert accelerations.count(["compiled/c/newton.c"]) == len(text)
    nested = ["solvers/substructuring.py:Klu", "solvers/substructuring.py"]
    assert accelerations.count(nested) == accelerations.count(nested[1:])
    start = min(accelerations.lines_of("compiled/c/newton.c:snes_newton"))[1]
    assert text[start - 1].startswith("int snes_newton(")
    for gone in ("compiled/c/newton.c:gone", "solvers/newton.py:Solver.gone", "errors.py~no such"):
        with pytest.raises(ValueError, match="is not in the package"):
            accelerations.lines_of(gone)


def test_the_page_has_a_table_for_each_key(tmp_path):
    page, text = tmp_path / "page.md", bench.PAGE.read_text(encoding="utf-8")
    page.write_text(text, encoding="utf-8")
    bench.write(page, cases({"as shipped": 1.0}), 90)
    written = page.read_text(encoding="utf-8")
    for key in ("summary", "gains, jointed", "times, large"):
        inside = written.split(f"<!-- {key} -->\n")[1].split(f"<!-- end of {key} -->")[0]
        assert inside.startswith("| ")
        assert inside.endswith(" |\n")
    for name in bench.ACCELERATIONS:  # the command has written the page
        assert name[1:] in written
        assert name[1:] in text
    assert "3 with 8 cells, 3 with 64 cells" in " ".join(written.split())
