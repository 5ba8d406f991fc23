# SPDX-License-Identifier: MIT
"""Size of the package by subpackage: lines, files, functions, classes, structs of C.

    python3 benchmarks/size.py [COMMIT ...]

Counts the working tree, or each commit.  Blank lines, comments and docstrings count as lines,
nested functions and methods as functions.
"""

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
COLUMNS = ("Python", "C", "files", "functions", "classes", "C functions", "C structs")

C_FUNCTION = re.compile(r"^[a-z][\w\s*]*\b\w+\([^;{}]*\)\s*\{", re.MULTILINE)
C_STRUCT = re.compile(r"^(?:typedef\s+)?struct\b[^;{}()]*\{", re.MULTILINE)


def git(*arguments):
    """Output of git."""
    return subprocess.run(
        ["git", *arguments], cwd=ROOT, check=True, capture_output=True, encoding="utf-8"
    ).stdout


def sources(commit=None):
    """Paths and texts of the sources of a commit, or of the working tree."""
    if commit is None:
        paths = git("ls-files", "-co", "--exclude-standard", "ufl_beam").splitlines()
        paths = [path for path in paths if (ROOT / path).exists()]
    else:
        paths = git("ls-tree", "-r", "--name-only", commit, "ufl_beam").splitlines()
    for path in paths:
        if path.endswith((".py", ".c", ".h")):
            text = git("show", f"{commit}:{path}") if commit else (ROOT / path).read_text("utf-8")
            yield PurePosixPath(path), text


def counted(path, text):
    """Numbers of one file by column."""
    lines = len(text.splitlines())
    if path.suffix != ".py":
        functions, structs = (len(x.findall(text)) for x in (C_FUNCTION, C_STRUCT))
        return Counter(C=lines, files=1, **{"C functions": functions, "C structs": structs})
    kinds = Counter(type(node) for node in ast.walk(ast.parse(text)))
    functions = kinds[ast.FunctionDef] + kinds[ast.AsyncFunctionDef]
    return Counter(Python=lines, files=1, functions=functions, classes=kinds[ast.ClassDef])


def table(commit=None):
    """Text of the table of a commit, one row for each subpackage and one for all."""
    rows = {}
    for path, text in sources(commit):
        package = path.parts[1] if len(path.parts) > 2 else "top level"
        rows.setdefault(package, Counter()).update(counted(path, text))
    rows = dict(sorted(rows.items()))
    rows["all"] = sum(rows.values(), Counter())
    lines = [["subpackage", *COLUMNS], ["---"] + ["---:"] * len(COLUMNS)]
    lines += [[name, *(str(row[column]) for column in COLUMNS)] for name, row in rows.items()]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    for one in sys.argv[1:] or [None]:
        print(f"{one or 'working tree'}:\n\n{table(one)}\n")
