# SPDX-License-Identifier: MIT
"""The script of README.md runs as printed, and its ledger closes."""

import re
from pathlib import Path

import pytest
from pages import blocks_of

README = Path(__file__).parents[2] / "README.md"


@pytest.mark.serial
def test_script_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    (script,) = blocks_of(README)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(script, "README.md", "exec"), names)
    solution = names["solution"]
    assert solution.times[-1] == pytest.approx(0.2)
    # Midpoint claims a closed ledger; the tolerance of Newton's method is 1e-10 of the forces.
    assert solution.energy.worst < 1e-9
    assert solution.energy["hinges"][-1] > 0
    assert (tmp_path / "portal.png").stat().st_size > 0
    assert "imbalance" in capsys.readouterr().out


PAGES = ("README.md", "docs/start.md", "docs/installation.md")


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_the_pages_exist(page):
    """Targets of make, and the packages that ./env asks for in one line."""
    text = (README.parent / page).read_text("utf-8")
    makefile = (README.parent / "Makefile").read_text("utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    commands = re.findall(r"(?:^|`|: )make ([a-z-]+)", text, re.MULTILINE)
    assert commands
    assert set(commands) <= targets
    (tools,) = re.findall('^tools="(.*)"', (README.parent / "env").read_text("utf-8"), re.MULTILINE)
    assert f"sudo apt-get install git make {tools}\n" in text
    assert "<this repository>" not in text


def test_the_readme_is_one_screen():
    assert len(README.read_text("utf-8").splitlines()) <= 60


def test_links_of_the_readme_lead_somewhere():
    targets = re.findall(r"\]\(([^)#]+)\)", README.read_text("utf-8"))
    for target in targets:
        if not target.startswith("http"):
            assert (README.parent / target).exists(), target
    assert targets
