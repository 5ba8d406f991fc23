# SPDX-License-Identifier: MIT
"""The page on laws of one's own does what it says."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "extending_laws.md"


@pytest.mark.serial
def test_the_scripts_of_the_page_run():
    """One after the other; their assertions are closed forms."""
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 2
    names = {"__name__": "page"}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec", dont_inherit=True), names)
    assert names["run"].times[-1] == 1
