# SPDX-License-Identifier: MIT
"""Every public name has an example in its docstring, and it does what it shows."""

import doctest
import inspect
import re

import pytest
from helpers import ALL

import ufl_beam as ub
import ufl_beam.structures as st

pytestmark = pytest.mark.serial  # files, and lines that all ranks print

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def run(name, thing, names):
    """Run the example of something; the names that are known afterwards."""
    test = doctest.DocTestParser().get_doctest(thing.__doc__ or "", names, name, None, 0)
    assert test.examples, f"the docstring of {name} has no example"
    report = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=FLAGS)
    runner.run(test, out=report.append, clear_globs=False)
    said = "\n".join(report)
    if missing := re.search(r"^ *(?:Import|ModuleNotFound)Error: .*", said, re.MULTILINE):
        pytest.skip(missing[0].strip())
    assert not report, said
    return test.globs


@pytest.fixture(scope="module")
def core():
    """The names that examples may use: those of the package's own example."""
    return run("ufl_beam", ub, {})


@pytest.fixture
def names(core, request):
    """The names of the package, and for examples of structures also these."""
    thing = getattr(request.node, "callspec", None)
    of = ALL.get(thing.params.get("name", thing.params.get("owner"))) if thing else None
    of_structures = getattr(of, "__module__", "").startswith("ufl_beam.structures")
    return core | ({"st": st} if of_structures or of is st.Shape else {})


def test_example_of_structures(core):
    run("ufl_beam.structures", st, dict(core))


@pytest.mark.parametrize("name", ALL)
def test_example(name, names, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = run(name, ALL[name], dict(names))
    require_lines({key: made[key] for key in made.keys() - names.keys()})


def require_lines(made):
    """Objects of the package are shown at the prompt in one line, without their address."""
    for name, thing in made.items():
        if type(thing).__module__.startswith("ufl_beam."):
            shown = repr(thing)
            assert "\n" not in shown, f"{name}: {shown}"
            assert " object at 0x" not in shown, f"{name}: {shown}"
            assert len(shown) < 200, f"{name}: {shown}"


def test_the_common_objects_are_shown_in_one_line(names):
    require_lines(names)


MEMBERS = [
    (name, member)
    for name in ALL
    for member, thing in inspect.getmembers_static(ALL[name])
    if inspect.isclass(ALL[name]) and member[0] != "_" and ">>>" in (thing.__doc__ or "")
]
"""Members of public classes whose docstrings have examples of their own."""


@pytest.mark.parametrize("owner", sorted({owner for owner, _ in MEMBERS}))
def test_examples_of_members(owner, names, tmp_path, monkeypatch):
    """One after the other, with the names of the example of the class."""
    monkeypatch.chdir(tmp_path)
    known = run(owner, ALL[owner], dict(names))
    for name, member in MEMBERS:
        if name == owner:
            thing = inspect.getattr_static(ALL[owner], member)
            known = run(f"{owner}.{member}", thing, known)
