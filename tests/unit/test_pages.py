# SPDX-License-Identifier: MIT
"""Pages whose blocks of Python are a script: it runs and prints what they show."""

import re

import numpy as np
import pytest
from pages import DOCS, blocks_of, pictures_of, shown_in

import ufl_beam as ub

PAGES = [
    *sorted(DOCS.glob("extending*.md")),
    *sorted(DOCS.glob("howto_*.md")),
    *(DOCS / f"{name}.md" for name in ("coming_from", "derivatives", "hinges", "index")),
    *(DOCS / f"{name}.md" for name in ("results", "start")),
]


@pytest.mark.serial  # files
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_script_of_a_page_runs_and_prints_its_text(page, tmp_path, monkeypatch, capsys):
    """All blocks of Python of a page, one after the other, with their assertions.

    Each block of text is part of what they print; in it ``...`` stands for anything.
    """
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(page)
    assert "assert " in "".join(blocks)
    for optional in re.findall(r"^import (pyvista|vtk)$", "".join(blocks), re.MULTILINE):
        pytest.importorskip(optional)
    names = {"__name__": "__main__"}
    for number, block in enumerate(blocks):
        exec(compile(block, f"{page.name}, block {number}", "exec", dont_inherit=True), names)
    printed = capsys.readouterr().out
    for text in blocks_of(page, "text"):
        assert shown_in(printed, text), f"not printed: {text}\nprinted: {printed}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pictures_of_a_page_are_those_of_its_script(page):
    """A picture that a page shows is saved by its script under the same name."""
    scripts = "".join(blocks_of(page) + blocks_of(page, "py"))
    saved = re.findall(r'(?:savefig|SaveScreenshot)\("(\w+\.png)"', scripts)
    assert {*pictures_of(page)} <= {*saved}


def test_the_scheme_of_a_page_is_that_of_the_package():
    """The scheme of docs/extending.md has the results of the same scheme of the package.

    Points yield and hinges open.
    """
    names = {"__name__": "__main__"}
    first, *others = blocks_of(DOCS / "extending.md")
    scheme = next(block for block in others if "class Weighted" in block)
    for block in (first, "from dataclasses import dataclass", scheme):
        exec(block, names)
    weak = ub.Section(
        EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01,
        bending=ub.ElastoPlastic(30.0, isotropic=80.0),
        hinge=ub.Softening(40.0, fracture_energy=15.0),
    )  # fmt: skip
    beam = ub.Beam((0, 0), (0, 1), weak, cells=5)
    push = ub.PointLoad(beam.end, force=(900.0, 0.0), amplitude=ub.ramp(0.1))
    spring = ub.Stretch(ub.ground(1, 1), beam.end, ub.Spring(3e3, law=ub.ElastoPlastic(40.0)))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push], connectors=[spring])
    newton = ub.Newton(rtol=1e-12)
    mine, known = (
        ub.simulate(scene, scheme, t=(0, 0.1), dt=2e-3, newton=newton)
        for scheme in (names["Weighted"](0.6), ub.EnergyMomentum(alpha=0.1, beta=0.1))
    )
    assert min(known.energy.lost[name][-1] for name in ("plastic", "hinges", "numerical")) > 1e-3
    assert mine.substeps == known.substeps
    # The same numbers in another order.
    assert np.allclose(mine.q, known.q, rtol=0, atol=1e-9 * np.abs(known.q).max())
    for name, lost in known.energy.lost.items():
        assert np.allclose(mine.energy.lost[name], lost, rtol=1e-8, atol=1e-9)
