# SPDX-License-Identifier: MIT
"""Pages whose blocks of Python are a script: they run and print what the pages show."""

import re

import pytest
from pages import DOCS, blocks_of, pictures_of

PAGES = [
    *sorted(DOCS.glob("extending*.md")),
    *sorted(DOCS.glob("howto_*.md")),
    *(DOCS / name for name in ("coming_from.md", "hinges.md", "start.md")),
]


@pytest.mark.serial  # files
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_script_of_a_page_runs(page, tmp_path, monkeypatch, capsys):
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
    printed = " ".join(capsys.readouterr().out.split())
    for text in blocks_of(page, "text"):
        shown = re.escape(" ".join(text.split())).replace(re.escape("..."), ".*?")
        assert re.search(shown, printed), f"not printed: {text}\nprinted: {printed}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pictures_of_a_page_are_those_of_its_script(page):
    """A picture that a page shows is saved by its script under the same name."""
    scripts = "".join(blocks_of(page) + blocks_of(page, "py"))
    saved = re.findall(r'(?:savefig|SaveScreenshot)\("(\w+\.png)"', scripts)
    assert {*pictures_of(page)} <= {*saved}
