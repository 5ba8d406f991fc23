# SPDX-License-Identifier: MIT
"""The script of README.md runs as printed, and its ledger closes."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "README.md"


@pytest.mark.serial
def test_script_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    (script,) = re.findall(r"```python\n(import ufl_beam.*?)```", README.read_text(), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(script, "README.md", "exec"), names)
    solution = names["solution"]
    assert solution.times[-1] == pytest.approx(0.4)
    # Midpoint claims a closed ledger; the tolerance of Newton's method is 1e-10 of the forces.
    assert solution.energy.worst < 1e-9
    for name in ("portal.xdmf", "portal.xdmf.bin", "portal.csv", "portal.png", "model.png"):
        assert (tmp_path / name).stat().st_size > 0
    assert "imbalance" in capsys.readouterr().out


def test_links_of_the_readme_lead_somewhere():
    targets = re.findall(r"\]\(([^)#]+)\)", README.read_text())
    for target in targets:
        if not target.startswith("http"):
            assert (README.parent / target).exists(), target
    assert targets
