# SPDX-License-Identifier: MIT
"""The examples of docs/extending.md and docs/hinges.md run."""

import re
from pathlib import Path

import numpy as np
import pytest

import ufl_beam as ub

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [DOCS / "extending.md", DOCS / "hinges.md"]


def blocks_of(page):
    """Blocks of Python of a page."""
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)


@pytest.mark.serial  # files
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_examples_of_a_page_run(page, tmp_path, monkeypatch):
    """All blocks of Python of a page, one after the other, with their assertions."""
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(page)
    assert "assert " in "".join(blocks)
    names = {"__name__": "__main__"}
    for number, block in enumerate(blocks):
        exec(compile(block, f"{page.name}, block {number}", "exec"), names)
    for picture in tmp_path.glob("*.png"):
        assert (DOCS / "pictures" / picture.name).exists(), picture.name


@pytest.mark.parametrize("reference", [False, True], ids=["compiled", "reference"])
def test_a_scheme_of_the_page_in_both_paths(reference):
    """Where things yield and open, it is the scheme of the package with the same numbers."""
    names = {"__name__": "__main__"}
    for block in blocks_of(DOCS / "extending.md")[:2]:
        exec(block, names)
    weak = ub.Section(
        EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01, bending=ub.Hardening(30.0, modulus=80.0),
        hinge=ub.Softening(40.0, energy=15.0),
    )  # fmt: skip
    beam = ub.Beam((0, 0), (0, 1), weak, cells=5)
    push = ub.PointLoad(beam.end, force=(900.0, 0.0), time=ub.ramp(0.1))
    spring = ub.Stretch(ub.ground(1, 1), beam.end, ub.Spring(3e3, law=ub.Hardening(40.0)))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push], connectors=[spring])
    newton = ub.Newton(rtol=1e-12, reference=reference)
    mine, known = (
        ub.simulate(scene, scheme, t=(0, 0.1), dt=2e-3, newton=newton)
        for scheme in (names["Weighted"](0.6), ub.Midpoint(alpha=0.1, beta=0.1))
    )
    assert min(known.energy.lost[name][-1] for name in ("plastic", "hinges", "numerical")) > 1e-3
    assert mine.parts == known.parts
    # The same numbers in another order.
    assert np.allclose(mine.q, known.q, rtol=0, atol=1e-9 * np.abs(known.q).max())
    for name, lost in known.energy.lost.items():
        assert np.allclose(mine.energy.lost[name], lost, rtol=1e-8, atol=1e-9)
