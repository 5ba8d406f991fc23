# SPDX-License-Identifier: MIT
"""Files beside the package: versions, dependencies and targets agree with each other."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = (ROOT / "pyproject.toml").read_text("utf-8")
MAKEFILE = (ROOT / "Makefile").read_text("utf-8")
TARGETS = set(re.findall(r"^([a-z-]+):.*##", MAKEFILE, re.MULTILINE))


def only(pattern, text):
    """The only match of a pattern that begins at the begin of a line."""
    (found,) = re.findall(f"^{pattern}", text, flags=re.MULTILINE)
    return found


def test_the_version_is_the_same_in_all_files():
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert only(r'version = "([^"]+)"', PROJECT) == only(r'version: "?([^"\s]+)"?$', citation)


@pytest.mark.parametrize("page", ["README.md", "docs/start.md", "docs/installation.md"])
def test_commands_of_the_pages_exist(page):
    """Targets of make, and the packages that ./env asks for in one line."""
    text = (ROOT / page).read_text("utf-8")
    commands = re.findall(r"(?:^|`|: )make ([a-z-]+)", text, re.MULTILINE)
    assert commands
    assert set(commands) <= TARGETS
    tools = only('tools="(.*)"', (ROOT / "env").read_text("utf-8"))
    assert f"sudo apt-get install git make {tools}\n" in text
    assert "<this repository>" not in text


def test_pre_commit_has_the_ruff_of_make_check():
    """`required-version` is what the Makefile installs."""
    required = only('required-version = "(.*?)"', PROJECT)
    assert f'["ruff{required}"]' in (ROOT / ".pre-commit-config.yaml").read_text("utf-8")


def test_python_is_checked_for_the_oldest_version_claimed():
    """By ruff and mypy, since tests run with newer ones only."""
    oldest = only(r'requires-python = ">=(3\.\d+)"', PROJECT)
    assert f'\npython_version = "{oldest}"' in PROJECT
    assert f'\ntarget-version = "py{oldest.replace(".", "")}"' in PROJECT
    assert f"\n  - python >={oldest}\n" in (ROOT / "environment.yml").read_text("utf-8")


def test_conda_gets_all_dependencies():
    """Those of pyproject.toml with their versions, and those that it cannot name."""
    (lists,) = re.findall(r"^dependencies = (\[.*?\n\])\n\n.*?^dev = ", PROJECT, re.M | re.S)
    more = only(r"view = \[(.*)\]", PROJECT) + only(r"test = \[(.*)\]", PROJECT)
    needed = re.findall(r'"([\w-]+)[^"]*"', lists.partition("]")[0] + more)
    versions = dict(re.findall(r'"([\w-]+)(>=[\d.]+)"', PROJECT))
    text = (ROOT / "environment.yml").read_text("utf-8")
    named = dict(re.findall(r"^ +- ([\w-]+) ?([^\s#]*)", text, re.MULTILINE))
    assert len(needed) > 12
    assert {x: named.get(x) for x in needed} == {x: versions.get(x, "") for x in needed}
    assert {"fenics-dolfinx", "mpi4py", "petsc4py", "slepc4py", "c-compiler", "pip"} <= set(named)
    assert "petsc=*=real*" in text


def test_the_public_address_has_one_place():
    """The table `[project.urls]`; a guess elsewhere would lead to the pages of strangers."""
    address = re.compile(r"(?:https?://|ssh://|git@)[^\s\"'<>)]*ufl[-_]beam[^\s\"'<>)]*")
    kinds = {".md", ".py", ".cff", ".yml", ".yaml", ".json", ".toml", ""}
    folders = (
        ".ci/",
        ".devcontainer/",
        ".github/**/",
        "docs/",
        "demos/",
        "ufl_beam/**/",
        "tests/**/",
    )
    paths = [path for folder in ("", *folders) for path in ROOT.glob(f"{folder}*")]
    files = [path for path in paths if path.suffix in kinds and path.is_file()]
    assert len(files) > 300
    places = [path.name for path in files for _ in address.findall(path.read_text("utf-8"))]
    assert places == ["pyproject.toml"] * len(re.findall("^Repository = ", PROJECT, re.MULTILINE))


def test_a_forge_runs_the_targets_of_make():
    """Its workflow has no commands of its own, and all targets of .ci/run exist."""
    workflow = (ROOT / ".github/workflows/ci.yml").read_text("utf-8")
    assert re.findall(r"\brun: (.*)", workflow) == [".ci/run"]
    run = (ROOT / ".ci/run").read_text("utf-8")
    (listed,) = re.findall("for each in ([^;]*);", run)
    alone = re.findall(r"(?:then |^)target ([a-z-]+)", run, re.MULTILINE)
    called = {*listed.split(), *alone}
    assert {"test", "test-mpi", "test-sid"} <= called <= TARGETS


SCHEMES = [
    "Static()", "EnergyMomentumStatic(0.7)", "EnergyMomentum()", "EnergyMomentum(alpha=0.05)",
    "EnergyMomentumDecaying()", "EnergyMomentumPrinted()", "Newmark()", "GeneralizedAlpha()",
]  # fmt: skip

SCRIPT = """
import ufl_beam as ub

def compare(scene: ub.Scene) -> list[ub.Solution]:
    return [
        {runs}
    ]
"""


def test_a_script_with_all_schemes_passes(tmp_path):
    """Protocols must not ask for attributes that can be set: frozen schemes have none."""
    api = pytest.importorskip("mypy.api")
    runs = ",\n        ".join(f"ub.simulate(scene, ub.{s}, t=(0, 1), dt=0.1)" for s in SCHEMES)
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(runs=runs))
    text, errors, status = api.run(["--config-file", str(ROOT / "pyproject.toml"), str(script)])
    assert status == 0, text + errors
