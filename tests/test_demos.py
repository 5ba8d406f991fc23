# SPDX-License-Identifier: MIT
"""Each demo runs to its end, where it checks its own result."""

import runpy
from pathlib import Path

import pytest

DEMOS = sorted((Path(__file__).parents[1] / "demos").glob("demo_*.py"))


@pytest.mark.slow
@pytest.mark.demo
@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_each_demo_runs_to_its_end(demo, tmp_path, monkeypatch):
    if "import control\n" in demo.read_text(encoding="utf-8"):
        pytest.importorskip("control")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(demo))
    assert list((tmp_path / "output").glob("*.png"))
