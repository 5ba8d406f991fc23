# SPDX-License-Identifier: MIT
"""Words of the package: private ones in identifiers, and turns of phrase in sentences.

    python3 benchmarks/words.py [COMMIT ...]

Counts the working tree, or each commit.  An identifier is a name that Python code defines: of a
module, class, function, argument, variable or field.  It is split into words at underscores and
capitals.  A sentence is one of a docstring, a comment or a page of docs/ and README.
"""

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from pathlib import Path, PurePosixPath

from size import git

PRIVATE = {
    "spot": "attachment point", "anchor": "attachment point", "share": "subdomain",
    "grid": "dof map", "link": "connector", "links": "connector", "coupling": "connector",
    "couplings": "connector", "part": "fraction, substep", "parts": "fractions, substeps",
    "way": "direction, increment", "turn": "rotation", "turns": "rotation",
    "opening": "activation of a hinge", "openings": "activation", "openable": "activation",
    "release": "activation", "slip": "rigid-plastic connector", "slips": "rigid-plastic",
    "entries": "terms of the balance", "throughput": "energy transferred", "numbers": "parameters",
    "layout": "section discretization", "respond": "constitutive update", "take": "commit",
    "leave": "finalize", "settle": "synchronize", "give": "abort", "ask": "evaluate",
    "asked": "evaluate", "note": "log", "march": "time loop", "lanes": "SIMD batch",
    "stated": "cached form", "chains": "static condensation", "judge": "convergence test",
    "near": "keep the Jacobian", "patience": "stall limit", "missed": "residual",
    "demand": "constraint residual", "idle": "zero-energy mode", "kept": "stored",
    "thin": "downsample", "remember": "serialize", "memory": "archive", "back": "coefficient",
    "midway": "midpoint loads", "dials": "settings", "dial": "setting", "cross": "2-D fit",
    "found": "result", "choice": "candidate", "doubt": "error bound", "sure": "safety factor",
    "unsure": "safety factor", "chance": "safety factor", "replicas": "redundant computation",
    "copies": "redundant computation", "fingerprint": "hash", "saying": "message",
    "pose": "layout", "stage": "canvas", "sheet": "page", "glyph": "symbol", "badge": "label",
    "footing": "foundation symbol", "held": "constrained", "driven": "prescribed",
    "given": "prescribed", "pushed": "loaded", "rubbing": "friction", "sprung": "spring",
    "room": "layer", "floor": "dependency depth", "one": "the noun", "other": "the noun",
    "of": "the noun", "here": "the noun", "there": "the noun", "gone": "the noun",
}  # fmt: skip
"""Words with a meaning of their own, and the field's terms."""

ALONE = (
    "one", "other", "of", "here", "there", "found", "gone", "near", "back", "take", "give", "leave",
    "note", "ask", "room", "sure", "unsure", "chance", "doubt", "release", "stage", "cross",
    "choice", "thin", "entries", "memory",
)  # fmt: skip
"""Words that are private only as a whole name, or as its first word for `of`."""

KEPT = ("scene", "place", "ledger", "accept", "node", "jump", "response")
"""Words of that kind that stay; docs/notation.md defines them."""

KEPT_NAMES = {
    "ends and joints of structural analysis": ("Release", "Link", "RigidLink", "Turn"),
    "terms of fatigue and of earthquake engineering": ("HotSpot", "spot", "DemandCurves", "demand"),
    "crack opening, of fracture mechanics": ("opening", "_crack_opening"),
    "of matrices and of the ledger": ("entries",),
    "public attributes and arguments": ("found", "held", "numbers"),
    "derivatives of a quantity; constructors, as `from_` in other packages": (
        "of", "of_fibres", "of_sectionproperties", "of_shape",
    ),
    "argument of `__eq__` in Python": ("other",),
}  # fmt: skip
"""Names with such words that stay, by reason."""

TURNS = {
    "what ...": r"\b[Ww]hat\b",
    "that of, those of": r"\b(?:that|those) (?:of|in|at|which|after|before)\b",
    "in the place of": r"\bin (?:the|its|their) place of?\b",
    "so many, as many": r"\b(?:so|as) many\b",
    "but for": r"\bbut for\b",
}
"""Turns of phrase that are read twice."""

SENTENCE = re.compile(r"(?<=[.!?:;])\s+(?=[A-Z`*|])|\n\s*\n|\n(?=\s*[*|#-])")


def texts(commit=None):
    """Paths and texts of package and pages."""
    of = ("ufl_beam", "docs", "README.md", "CONTRIBUTING.md")
    if commit is None:
        paths = git("ls-files", *of).splitlines()
    else:
        paths = git("ls-tree", "-r", "--name-only", commit, *of).splitlines()
    for path in paths:
        if path.endswith((".py", ".c", ".h", ".md")):
            if commit is None:
                text = (git_root / path).read_text("utf-8")
            else:
                text = git("show", f"{commit}:{path}")
            yield PurePosixPath(path), text


git_root = Path(git("rev-parse", "--show-toplevel").strip())


def words_of(identifier):
    """Words of an identifier in lower case."""
    return [w.lower() for w in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", identifier)]


def identifiers(path, text):
    """Names that a module defines, each once."""
    names = {path.stem}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.attr)
    return names


def prose(path, text):
    """Docstrings and comments of code, or a page without its code."""
    if path.suffix == ".md":
        return re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    if path.suffix in (".c", ".h"):
        return "\n\n".join(re.findall(r"/\*(.*?)\*/", text, re.DOTALL))
    parts, lines = [], []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            lines.append(token.string.lstrip("# "))
        elif token.type != tokenize.NL:
            parts, lines = [*parts, " ".join(lines)], []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            parts.append(
                re.sub(r"^\s*>>>.*?(?=\n\s*\n|\Z)", "", str(node.value.value), flags=re.M | re.S)
            )
    return "\n\n".join(filter(None, parts))


def counts(commit=None):
    """Identifiers with private words by word; sentences by folder, and those with a turn.

    Names in :data:`KEPT_NAMES` are counted as "kept names".
    """
    private, sentences, turns = Counter(), Counter(), Counter()
    kept = {name for names in KEPT_NAMES.values() for name in names}
    for path, text in texts(commit):
        if path.suffix == ".py":
            for name in identifiers(path, text):
                words = words_of(name)
                private.update({
                    "kept names" if name in kept and commit is None else word for word in words
                    if word in PRIVATE
                    and (word not in ALONE or words == [word] or word == words[0] == "of")
                })  # fmt: skip
        where = "package" if path.parts[0] == "ufl_beam" else "pages"
        for sentence in SENTENCE.split(prose(path, text)):
            if len(sentence.split()) < 3:
                continue
            sentences[where] += 1
            found = [name for name, turn in TURNS.items() if re.search(turn, sentence)]
            turns.update(found)
            turns[where] += bool(found)
    return private, sentences, turns


def report(commit=None):
    """Text of the counts of a commit."""
    private, sentences, turns = counts(commit)
    lines = [f"{commit or 'working tree'}:", ""]
    for where in ("package", "pages"):
        part = turns[where] / max(sentences[where], 1)
        lines.append(f"{where}: {turns[where]} of {sentences[where]} sentences, {100 * part:.1f} %")
    lines.append("turns: " + ", ".join(f"{name} {turns[name]}" for name in TURNS))
    kept = private.pop("kept names", 0)
    lines.append(f"identifiers with private words: {sum(private.values())}, and {kept} kept names")
    lines.append("  " + ", ".join(f"{word} {n}" for word, n in private.most_common()))
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    for each in sys.argv[1:] or [None]:
        print(report(each))
