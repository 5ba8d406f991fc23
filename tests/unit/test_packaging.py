"""The package as it is shipped: what an import without DOLFINx says, and what an sdist contains."""

import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHIPPED = ("demos", "docs", "tests", "benchmarks", "ufl_beam")


@pytest.mark.serial
@pytest.mark.parametrize(
    "missing",
    [("mpi4py", "petsc4py", "dolfinx", "basix", "ufl", "ffcx"), ("dolfinx",), ("petsc4py",)],
    ids=["all", "dolfinx", "petsc4py"],
)
def test_an_import_without_dolfinx_says_what_is_needed(missing):
    """As after `pip install` alone: the words that are meant, whichever package is missing."""
    script = "\n".join(
        ["import sys", f"for name in {missing!r}: sys.modules[name] = None", "import ufl_beam"]
    )
    ran = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, timeout=60
    )
    assert ran.returncode == 1
    last = ran.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: ufl_beam needs DOLFINx 0.9 or newer")
    assert any(name in last for name in missing)
    assert "docs/installation.md" in last


@pytest.mark.serial
def test_an_sdist_has_documentation_and_demos(tmp_path):
    """Built from a copy, because setuptools leaves its notes beside the sources."""
    backend = pytest.importorskip("setuptools", minversion="77").__name__
    source = tmp_path / "source"
    source.mkdir()
    unwanted = shutil.ignore_patterns("__pycache__", "output", "*.egg-info")
    for name in SHIPPED:
        shutil.copytree(ROOT / name, source / name, ignore=unwanted)
    for file in ROOT.iterdir():
        if file.is_file() and not file.name.startswith("."):
            shutil.copy(file, source)
    build = f"import {backend}.build_meta as b; b.build_sdist('dist')"
    ran = subprocess.run([sys.executable, "-c", build], capture_output=True, text=True, cwd=source)
    assert ran.returncode == 0, ran.stderr
    (archive,) = (source / "dist").glob("*.tar.gz")
    with tarfile.open(archive) as tar:
        inside = {name.partition("/")[2] for name in tar.getnames()}
    for name in SHIPPED:
        for file in (source / name).rglob("*.*"):
            if file.is_file():
                assert str(file.relative_to(source)) in inside
    assert {"env", "Makefile", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md"} <= inside
