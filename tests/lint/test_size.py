# SPDX-License-Identifier: MIT
"""Size of the package: lines of Python and C; a commit that raises a limit states the reason.

Effects move from the terms of the old core to ``blocks/``, which lowers the other limits.
"""

from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "ufl_beam"
BLOCKS = {"blocks.c", "elements_simd.c"}
LIMITS = {
    "Python of blocks": 6_751,
    "C of blocks": 520,
    "Python beside blocks": 47_500,
    "C beside blocks": 6_300,
}


@pytest.mark.parametrize("of_blocks", [True, False])
@pytest.mark.parametrize("language", ["Python", "C"])
def test_lines(language, of_blocks):
    suffixes = {".py"} if language == "Python" else {".c", ".h"}
    lines = sum(
        len(path.read_text("utf-8").splitlines())
        for path in PACKAGE.rglob("*")
        if path.suffix in suffixes
        and (path.parent.name == "blocks" or path.name in BLOCKS) == of_blocks
    )
    limit = LIMITS[f"{language} {'of' if of_blocks else 'beside'} blocks"]
    assert 0 < lines <= limit, "see the docstring of this file"
