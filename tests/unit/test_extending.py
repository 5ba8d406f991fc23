# SPDX-License-Identifier: MIT
"""The examples of docs/extending.md, of other pages of that name, and of docs/hinges.md run."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted([*DOCS.glob("extending*.md"), DOCS / "hinges.md"])


@pytest.mark.serial  # files
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_examples_of_a_page_run(page, tmp_path, monkeypatch):
    """All blocks of Python of a page, one after the other, with their assertions."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    assert "assert " in "".join(blocks)
    names = {"__name__": "__main__"}
    for number, block in enumerate(blocks):
        exec(compile(block, f"{page.name}, block {number}", "exec"), names)
    for picture in tmp_path.glob("*.png"):
        assert (DOCS / "pictures" / picture.name).exists(), picture.name
