# SPDX-License-Identifier: MIT
"""Scripts of README.md and of pages run and print what the pages show; numbers that they state."""

import math
import re

import numpy as np
import pytest
from closed_forms import elastica
from pages import DOCS, blocks_of, pictures_of, shown_in
from scenes import cantilever

import ufl_beam as ub
from ufl_beam.model.connector_law import CONTRIBUTIONS

ROOT = DOCS.parent
README = ROOT / "README.md"
PAGES = [
    *sorted(DOCS.glob("extending*.md")),
    *sorted(DOCS.glob("howto_*.md")),
    *(DOCS / f"{name}.md" for name in ("coming_from", "derivatives", "hinges", "index")),
    *(DOCS / f"{name}.md" for name in ("results", "start")),
]
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def printed_by(blocks, page, capsys):
    """What blocks of a page print, and the names that they define."""
    names = {"__name__": "__main__"}
    for number, block in enumerate(blocks):
        exec(compile(block, f"{page.name}, block {number}", "exec", dont_inherit=True), names)
    return capsys.readouterr().out, names


@pytest.mark.serial  # files
@each_page
def test_the_script_of_a_page_runs_and_prints_its_text(page, tmp_path, monkeypatch, capsys):
    """All blocks of Python of a page, one after the other, with their assertions.

    Each block of text is part of what they print; in it ``...`` stands for anything.
    """
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(page)
    assert "assert " in "".join(blocks)
    for optional in re.findall(r"^import (pyvista|vtk)$", "".join(blocks), re.MULTILINE):
        pytest.importorskip(optional)
    printed, _ = printed_by(blocks, page, capsys)
    for text in blocks_of(page, "text"):
        assert shown_in(printed, text), f"not printed: {text}\nprinted: {printed}"


@each_page
def test_pictures_of_a_page_are_those_of_its_script(page):
    """A picture that a page shows is saved by its script under the same name."""
    scripts = "".join(blocks_of(page) + blocks_of(page, "py"))
    saved = re.findall(r'(?:savefig\(|SaveScreenshot\(|render\(\w+, )"(\w+\.png)"', scripts)
    assert {*pictures_of(page)} <= {*saved}


def test_the_page_of_results_lists_all_entries_of_the_ledger():
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (?:state|supplied|lost) \|", page, re.MULTILINE)
    assert sorted(rows) == sorted(CONTRIBUTIONS)


# -- README.md -----------------------------------------------------------------------------------


def test_the_lines_of_ufl_are_those_of_the_demo():
    """Beside comments, in the same order; the demo checks its results."""

    def code_of(text):
        return [line.partition("  #")[0].strip() for line in text.splitlines()]

    demo = code_of((ROOT / "demos/demo_the_card.py").read_text("utf-8"))
    lines = [line for line in code_of(blocks_of(README)[0]) if line]
    assert [demo.count(line) for line in lines] == [1] * len(lines)
    places = [demo.index(line) for line in lines]
    assert len(places) > 10
    assert places == sorted(places)


@pytest.mark.serial
def test_script_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    printed, names = printed_by(blocks_of(README)[1:], README, capsys)
    # 6 × 30 kJ: hinges that soften linearly are free at finite rotations.
    assert names["path"].energy["hinges"][-1] == pytest.approx(180e3, rel=1e-9)
    assert (tmp_path / "shapes.png").stat().st_size > 0
    (text,) = blocks_of(README, "text")
    assert shown_in(printed, text), printed


def test_the_demo_of_the_picture_computes_the_script():
    """The picture belongs to the script: all its lines but those of the output are in the demo."""
    demo = (ROOT / "demos/demo_pushover.py").read_text("utf-8")
    assert "docs/pictures/pushover.png" in README.read_text("utf-8")
    assert 'savefig(output / "pushover.png")' in demo
    others = [line for line in blocks_of(README)[1].splitlines() if line not in demo.splitlines()]
    assert [re.match(r"print|ub\.plot", line) is not None for line in others] == [True] * 3


def test_roll_up_closes_to_round_off():
    """README.md: 1e-14 of the length with 10 cells."""
    scene = cantilever(cells=10, moment=2 * math.pi)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    assert np.hypot(*solution.position(scene.beams[0].end)[-1]) < 1e-14


def test_elastica_has_the_digits_of_its_table():
    """README.md: five digits with 8 cubic cells; half a unit of the last one."""
    table = np.loadtxt(ROOT / "tests/data/elastica_tip_load.csv", delimiter=",")
    scene = cantilever(cells=8, force=(0, 1), time=lambda t: t)
    solution = ub.simulate(scene, ub.Static(), t=(0, 20), dt=0.1, mesh=ub.Mesh(degree=3))
    at = np.rint(table[:, 0] / 0.1).astype(int)
    u, v, ψ = solution.displacement(scene.beams[0].end)[at].T
    assert np.abs(np.column_stack([v, -u, ψ]) - table[:, 1:]).max() < 5e-6
    # of the closed form the table is rounded
    assert np.abs(v - [elastica(a)[1] for a in table[:, 0]]).max() < 1e-6
