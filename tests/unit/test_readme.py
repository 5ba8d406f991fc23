# SPDX-License-Identifier: MIT
"""The script of README.md runs as printed, and the page states facts that are computed here."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from closed_forms import elastica
from pages import blocks_of, shown_in
from scenes import cantilever

import ufl_beam as ub

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"


def test_the_lines_of_ufl_are_those_of_the_demo():
    """Beside comments, in the same order; the demo checks its results."""
    lines, _ = blocks_of(README)
    demo, code = (ROOT / "demos/demo_the_card.py").read_text("utf-8").splitlines(), []
    for line in filter(None, (line.partition("  #")[0].strip() for line in lines.splitlines())):
        found = [k for k, text in enumerate(demo) if text.partition("  #")[0].strip() == line]
        assert len(found) == 1, line
        code += found
    assert len(code) > 10
    assert code == sorted(code)


@pytest.mark.serial
def test_script_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    _, script = blocks_of(README)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(script, "README.md", "exec"), names)
    path = names["path"]
    # 6 × 30 kJ: hinges that soften linearly are free at finite rotations.
    assert path.energy["hinges"][-1] == pytest.approx(180e3, rel=1e-9)
    assert (tmp_path / "shapes.png").stat().st_size > 0
    printed = capsys.readouterr().out
    (text,) = blocks_of(README, "text")
    assert shown_in(printed, text), printed


def test_the_demo_of_the_picture_computes_the_script():
    """The picture belongs to the script: all its lines but those of the output are in the demo."""
    _, script = blocks_of(README)
    demo = (ROOT / "demos/demo_pushover.py").read_text("utf-8")
    assert "docs/pictures/pushover.png" in README.read_text("utf-8")
    assert 'savefig(output / "pushover.png")' in demo
    lines = demo.splitlines()
    others = [line for line in script.splitlines() if line not in lines]
    assert [re.match(r"print|ub\.plot", line) is not None for line in others] == [True] * 3


def test_roll_up_closes_to_round_off():
    """README.md: 1e-14 of the length with 10 cells."""
    scene = cantilever(cells=10, moment=2 * math.pi)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, progress=False)
    assert np.hypot(*solution.position(scene.beams[0].end)[-1]) < 1e-14


def test_elastica_has_the_digits_of_its_table():
    """README.md: five digits with 8 cubic cells; half a unit of the last one."""
    table = np.loadtxt(ROOT / "tests/data/elastica_tip_load.csv", delimiter=",")
    scene = cantilever(cells=8, force=(0, 1), time=lambda t: t)
    mesh = ub.Mesh(degree=3)
    solution = ub.simulate(scene, ub.Static(), t=(0, 20), dt=0.1, mesh=mesh, progress=False)
    at = np.rint(table[:, 0] / 0.1).astype(int)
    u, v, ψ = solution.displacement(scene.beams[0].end)[at].T
    assert np.abs(np.column_stack([v, -u, ψ]) - table[:, 1:]).max() < 5e-6
    # of the closed form the table is rounded
    assert np.abs(v - [elastica(a)[1] for a in table[:, 0]]).max() < 1e-6


@pytest.mark.parametrize(
    ("degree", "cells", "errors"), [(3, 10, (1e-5, 1e-5)), (1, 60, (1.4e-3, 1.4e-3))]
)
def test_limit_loads_of_the_lee_frame(degree, cells, errors):
    """README.md: relative errors; the converged limit loads are those of demo_lee_frame.py."""
    A, I, E, nu = 6e-4, 2e-8, 72e9, 0.3  # m², m⁴, Pa
    section = ub.Section(EA=E * A, GA=E * A / (2 * (1 + nu)), EI=E * I)
    column = ub.Beam((0, 0), (0, 1.2), section, cells=cells)
    girder = ub.Beam((0, 1.2), (1.2, 1.2), section, cells=cells)
    load = ub.PointLoad(girder.at(0.2), force=(0, -1e3), amplitude=lambda t: t)
    frame = ub.Scene(
        [column, girder],
        joints=[ub.Rigid(column.end, girder.start)],
        supports=[ub.Pinned(column.start), ub.Pinned(girder.end)],
        loads=[load],
    )
    path = ub.follow(
        frame,
        ub.ArcLength(0.05, factor=10),
        until=lambda now: len(now.solution.critical) == 2,
        mesh=ub.Mesh(degree=degree),
    )
    limits = np.array([point.factor for point in path.critical])
    assert (np.abs(limits / (18.5466, -9.3961) - 1) < errors).all()
