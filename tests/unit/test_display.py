# SPDX-License-Identifier: MIT
"""Models and results at prompts, in one line, and in notebooks: tables and pictures.

The lines of all public classes are checked in test_examples.py.
"""

import math
import re
import subprocess
import sys
from base64 import b64decode
from fractions import Fraction
from io import BytesIO
from typing import NamedTuple

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.display import compact_repr, html_page
from ufl_beam.plotting import history_pictures

SECTION = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
BEAM = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
FORCE = ub.PointLoad(BEAM.end, force=(0, -1e5), amplitude=lambda t: t)
SCENE = ub.Scene([BEAM], supports=[ub.Clamped(BEAM.start)], loads=[FORCE])


class Pair(NamedTuple):
    """Two things, of which the second has a default."""

    first: object
    second: object = 1.0


@pytest.mark.parametrize(
    ("shown", "text"),
    [
        (compact_repr(Pair(2)), "Pair(first=2)"),
        (compact_repr(Pair({}, 2)), "Pair(second=2)"),
        (compact_repr(Pair(math.pi, np.float64(1) / 3)), "Pair(first=3.14159, second=0.333333)"),
        (compact_repr(Pair((0.1 + 0.2, 1))), "Pair(first=(0.3, 1))"),
        (compact_repr(Pair(ub.ramp)), "Pair(first=ramp)"),
        (compact_repr(Pair(np.arange(3.0))), "Pair(first=[0, 1, 2])"),
        (compact_repr(Pair(np.zeros((9, 3)))), "Pair(first=array of shape (9, 3))"),
        (compact_repr(Pair([*range(9)])), "Pair(first=[0, 1, 2, 3, 4, 5, ...])"),
        (repr(ub.Newton(rtol=1e-8)), "Newton(rtol=1e-08)"),
        (repr(ub.Mesh(refine=Fraction(3, 2))), "Mesh(refine=3/2)"),
        (str(ub.Beam.arc((0, -1), 1.0, (np.pi, 0), SECTION).at(0.5)), "beam.at(0.5) (0, 0)"),
        (str(ub.ground(-1e-17, 1e-6)), "ground (0, 1e-06)"),
        (repr(ub.Scene(bodies=[ub.Body((0, 0), mass=1.0, inertia=1.0)])), "<Scene: 1 body>"),
    ],
)
def test_one_line(shown, text):
    """Numbers have six digits and no round-off, arrays their shapes, functions their names."""
    assert shown == text


# -- pages in notebooks ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solution():
    return ub.simulate(SCENE, ub.EnergyMomentum(), t=(0, 1), dt=0.05)


def cells(page):
    """Rows of the tables of a page."""
    rows = re.findall("<tr>(.*?)</tr>", page)
    return [re.findall("<t[hd]>(.*?)</t[hd]>", row) for row in rows]


def picture(page):
    """The picture of a page; (height, width, 4)."""
    from matplotlib.image import imread

    (data,) = re.findall('src="data:image/png;base64,(.*?)"', page)
    pixels = imread(BytesIO(b64decode(data)))
    assert np.ptp(pixels) > 0.5
    return pixels


@pytest.mark.serial
def test_a_scene_is_drawn():
    page = SCENE._repr_html_()
    assert "1 beam, 1 support, 1 load" in page
    assert picture(page).shape[1] > 600
    assert len(page) < 200_000
    data, look = ub.plot(SCENE)._repr_png_()  # at the end of a cell
    assert data.startswith(b"\x89PNG")
    assert 300 < look["width"] < 900  # pixels of a page
    assert html_page("<b>") == "<pre>&lt;b&gt;</pre>"


@pytest.mark.serial
def test_a_solution_has_its_text_its_ledger_and_shapes(solution):
    page = solution._repr_html_()
    for line in solution.summary():
        assert line in page
    ledger = {(part, name): float(value) for part, name, value in cells(page)[1:]}
    assert ledger.keys() == {("in scene", "stored"), ("in scene", "kinetic"), ("supplied", "loads")}
    for (_, name), value in ledger.items():
        assert value == pytest.approx(solution.energy[name][-1], rel=1e-5)  # six digits
    picture(page)


def test_small_displacements_are_magnified(solution, monkeypatch):
    """[closed] The deflection of 0.019 m, 1 % of the length, ten times; of 1 m as it is."""
    factors, draw = [], history_pictures.draw_shapes

    def shapes(solution, count, magnify):
        factors.append(magnify)
        return draw(solution, count=count, magnify=magnify)

    monkeypatch.setattr(history_pictures, "draw_shapes", shapes)
    solution._repr_html_()
    for v in (1.0, 0.0):
        sink = ub.PrescribedDisplacement(BEAM.start, u=0, v=lambda t, v=v: -v * t, psi=0)
        ub.simulate(ub.Scene([BEAM], supports=[sink]), ub.Static(), t=(0, 1), dt=1)._repr_html_()
    assert factors == [10, 1, 1]


@pytest.mark.serial
def test_modes_have_a_table():
    modes = ub.modes(SCENE, 8, mesh=ub.Mesh(refine=2))
    page = modes._repr_html_()
    assert cells(page)[1:] == [[str(k), title] for k, title in enumerate(modes.titles)]
    picture(page)
    assert repr(modes) == f"<Modes: {'; '.join(modes.titles[:4])}; ...>"
    page = modes.motion(0)._repr_html_()
    assert cells(page) == []  # a period of a mode has no ledger
    picture(page)


def test_a_path_names_its_critical_points():
    push = ub.PointLoad(BEAM.end, force=(-2e7, 0), amplitude=lambda t: t)
    column = ub.Scene([BEAM], supports=[ub.Clamped(BEAM.start)], loads=[push])
    path = ub.follow(column, ub.LoadControl(0.05), steps=10)
    assert "bifurcation point at factor 0.441" in path._repr_html_()
    assert path.summary()[-1] in str(path).splitlines()
    path.critical = [*path.critical] * 7
    assert path.summary()[-1].count("bifurcation") == 5
    assert path.summary()[-1].endswith(" and 2 more")


@pytest.mark.serial
def test_a_tradeoff_has_its_runs():
    tip = {"tip": lambda run: run.position(BEAM.end)[-1]}
    found = ub.tradeoff(SCENE, tip, scheme=ub.Static(), t=(0, 1), dt=0.5, tolerance=0.01)
    page = found._repr_html_()
    assert cells(page)[0] == ["", "seconds", "steps", "cells", "iterations", "tip", "setting"]
    chosen = next(row for row in cells(page) if row[0] == "=&gt;")
    assert chosen[-1] == str(found.best.setting)
    for line in found.remarks():
        assert line.splitlines()[0] in page
    picture(page)


def test_a_study_has_its_first_cases():
    def member(n):
        return {"square": n**2, "both": [n, -n], "inverse": 1 / (n - 1)}

    page = ub.study(member, [{"n": n} for n in range(15)])._repr_html_()
    head, *rows = cells(page)
    assert head == ["n", "inverse", "square"]
    assert rows[:3] == [["0", "-1", "0"], ["1", "nan", "nan"], ["2", "1", "4"]]
    assert len(rows) == 12
    for line in ("and 3 more cases", "both: (15, 2)", "ZeroDivisionError", "15 members, 1 failed"):
        assert line in page


def test_errors_of_pictures_leave_the_text():
    """Constraints that repeat are found when the scene is drawn."""
    joints = [ub.Revolute(BEAM.end, ub.ground(2, 0)), ub.Revolute(BEAM.start, ub.ground(0, 0))]
    over = ub.Scene([BEAM], joints=[*joints, ub.Link(BEAM.start, BEAM.end)])
    page = over._repr_html_()
    assert "no picture: ModelError" in page
    assert "1 beam, 3 joints" in page


@pytest.mark.serial
def test_matplotlib_is_not_imported_before_something_is_drawn():
    script = "\n".join([
        "import sys",
        "import ufl_beam as ub",
        "beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1, GA=1, EI=1))",
        "print(repr(ub.Scene([beam])), 'matplotlib' in sys.modules, 'IPython' in sys.modules)",
    ])  # fmt: skip
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout == "<Scene: 1 beam> False False\n", done.stderr
