# SPDX-License-Identifier: MIT
"""Scripts of the pages in docs/; as a program, this module draws their pictures again."""

import os
import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

DOCS = Path(__file__).parents[2] / "docs"


def blocks_of(page, language="python"):
    """Fenced blocks of a language in a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def shown_in(printed, text):
    """Whether a block of text is part of what a script printed; ``...`` stands for anything."""
    shown = re.escape(" ".join(text.split())).replace(re.escape("..."), ".*?")
    return re.search(shown, " ".join(printed.split()))


def pictures_of(page):
    """Names of the pictures that a page shows."""
    return re.findall(r"\]\(pictures/(\w+\.png)\)", page.read_text(encoding="utf-8"))


def draw(page):
    """Run the script of a page, and copy the pictures that the page shows to docs/pictures."""
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        names = {"__name__": "__main__"}
        for block in blocks_of(page):
            exec(compile(block, page.name, "exec", dont_inherit=True), names)
        for picture in Path().glob("*.png"):
            if picture.name in pictures_of(page):
                shutil.copy(picture, DOCS / "pictures")
        os.chdir(DOCS)


if __name__ == "__main__":
    for page in sorted(DOCS.glob("*.md")):
        script = "".join(blocks_of(page))
        if any(f'savefig("{picture}")' in script for picture in pictures_of(page)):
            draw(page)
