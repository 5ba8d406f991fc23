# SPDX-License-Identifier: MIT
"""Fenced blocks of the pages in docs/, and what their scripts print."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def blocks_of(page, language="python"):
    """Fenced blocks of a language in a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def shown_in(printed, text):
    """Whether a block of text is part of what a script printed; ``...`` stands for anything."""
    shown = re.escape(" ".join(text.split())).replace(re.escape("..."), ".*?")
    return re.search(shown, " ".join(printed.split()))
