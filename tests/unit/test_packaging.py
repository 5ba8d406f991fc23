# SPDX-License-Identifier: MIT
"""The package as it is shipped: imports without DOLFINx, sdist and wheel, and runs from them."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[2]
SHIPPED = ("demos", "docs", "tests", "benchmarks", "ufl_beam")


def command(*arguments, status=0, **more):
    """Run Python; its output, or its last words if it is to fail."""
    ran = subprocess.run(
        [sys.executable, *map(str, arguments)], capture_output=True, text=True, timeout=300, **more
    )
    assert ran.returncode == status, ran.stdout + ran.stderr
    return ran.stderr.strip().splitlines()[-1] if status else ran.stdout


def import_error(missing, **more):
    """Last line of `import ufl_beam` where some packages are missing."""
    script = f"import sys; sys.modules.update(dict.fromkeys({missing!r})); import ufl_beam"
    return command("-c", script, status=1, **more)


@pytest.mark.parametrize(
    "missing",
    [("mpi4py", "petsc4py", "dolfinx", "basix", "ufl", "ffcx"), ("dolfinx",), ("petsc4py",)],
    ids=["all", "dolfinx", "petsc4py"],
)
def test_an_import_without_dolfinx_says_what_is_needed(missing):
    """As after `pip install` alone: the words that are meant, whichever package is missing."""
    last = import_error(missing, cwd=ROOT)
    assert last.startswith("ImportError: ufl_beam needs DOLFINx 0.9 or newer")
    assert any(name in last for name in missing)
    assert f"{ROOT}/env, see docs/installation.md" in last


def pip(verb, *arguments):
    """Run pip without a network."""
    command("-m", "pip", verb, "--no-deps", "--no-index", *arguments)


def wheel_of(source, folder):
    """Build a wheel with what is installed."""
    pip("wheel", "--no-build-isolation", "--wheel-dir", folder, source)
    (wheel,) = folder.glob("ufl_beam-*.whl")
    return wheel


def content_of(wheel):
    """Names of files beside the metadata, and the metadata."""
    with zipfile.ZipFile(wheel) as file:
        inside = {name for name in file.namelist() if ".dist-info/" not in name}
        (metadata,) = (n for n in file.namelist() if n.endswith(".dist-info/METADATA"))
        return inside, file.read(metadata).decode()


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the project, because setuptools leaves its notes beside the sources."""
    pytest.importorskip("setuptools", minversion="77")
    source = tmp_path_factory.mktemp("packaging") / "source"
    source.mkdir()
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in SHIPPED:
        shutil.copytree(ROOT / name, source / name, ignore=unwanted, symlinks=True)
    for file in ROOT.iterdir():
        if file.is_file() and not file.name.startswith("."):
            shutil.copy(file, source)
    for built in ("demos/output", "docs/_build", "docs/api"):
        shutil.rmtree(source / built, ignore_errors=True)
    return source


@pytest.fixture(scope="module")
def sdist(copied):
    """The archive of the sources."""
    command("-c", "from setuptools import build_meta; build_meta.build_sdist('dist')", cwd=copied)
    (archive,) = (copied / "dist").glob("*.tar.gz")
    return archive


@pytest.fixture(scope="module")
def wheel(sdist, tmp_path_factory):
    """The wheel that is built from the sdist alone."""
    pytest.importorskip("pip")
    return wheel_of(sdist, tmp_path_factory.mktemp("wheel"))


def test_an_sdist_has_documentation_and_demos(copied, sdist):
    with tarfile.open(sdist) as tar:
        inside = {name.partition("/")[2] for name in tar.getnames()}
    shipped = [file for name in SHIPPED for file in (copied / name).rglob("*.*") if file.is_file()]
    assert {str(file.relative_to(copied)) for file in shipped} <= inside
    assert {"env", "environment.yml", "Makefile", "CHANGELOG.md"} <= inside
    assert {"CITATION.cff", "CONTRIBUTING.md"} <= inside


def test_a_wheel_has_the_package_its_c_and_the_licence(copied, wheel):
    """All files of the package, nothing else; the same from the checkout as from the sdist."""
    inside, said = content_of(wheel)
    known = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "ufl_beam").rglob("*")
        if path.suffix in {".py", ".c", ".h", ".csv", ".typed"}
    }
    assert any(name.endswith(".h") for name in known)
    assert inside == known
    assert re.search("^License-Expression: MIT$", said, re.MULTILINE)
    assert re.search("^License-File: LICENSE$", said, re.MULTILINE)
    assert content_of(wheel_of(copied, copied / "wheels"))[0] == inside


INSTALLED = """
import ufl_beam as ub
beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-3), cells=2)
load = ub.PointLoad(beam.end, force=(0.0, 0.1))
scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0.0, 0.1), dt=0.01)
assert solution.energy.worst < 1e-9  # the ledger closes
print(ub.__file__, ub.__version__, sep="\\n")
"""


@pytest.mark.parametrize("compiles", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_an_installed_wheel_runs_outside_of_the_checkout(wheel, tmp_path, compiles):
    """Its C is read in any case, and compiled where the cache is empty."""
    site, cache = tmp_path / "site", tmp_path / "cache"
    pip("install", "--target", site, wheel)
    rest = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p and Path(p) != ROOT]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), *rest])}
    if compiles:
        environment["XDG_CACHE_HOME"] = str(cache)
    printed = command("-c", INSTALLED, cwd=tmp_path, env=environment).split()
    assert printed == [str(site / "ufl_beam" / "__init__.py"), wheel.name.split("-")[1]]
    assert bool(list(cache.rglob("*.so"))) == compiles
    if not compiles:  # without DOLFINx: the ways that its user has, who has no source tree
        last = import_error(("dolfinx",), cwd=tmp_path, env=environment)
        assert all(way in last for way in ("conda install", "Debian", "Docker"))
        assert "docs/" not in last
        assert "env" not in last.split()
