# SPDX-License-Identifier: MIT
"""Models that are hard to converge, run to the end or to the mechanism.

Run by ``make collection``.  Writes ``docs/collection.md``; fails if a model ends in another way
than it should.  Arguments select models by parts of their names, and only print.
"""

import sys
from pathlib import Path

sys.path.insert(1, str(Path(__file__).parents[1]))  # of the module records

import dynamics  # noqa: F401  # enters its models
import statics  # noqa: F401
from models import MODELS, judged
from report import confirmation, in_opensees, outcome, save
from to_opensees import beside


def main() -> int:
    """Run all models, or those whose names contain an argument; the exit code."""
    words = sys.argv[1:]
    rows = []
    for name, one in MODELS.items():
        if words and not any(word in name for word in words):
            continue
        rows.append(row := judged(one))
        row["opensees"] = beside(one.case())
        print(
            f"{name:72s} {outcome(row):18s} {row['cut']:3d} cut {row['seconds']:6.1f} s  "
            f"{confirmation(row)}  OpenSees: {' | '.join(in_opensees(row))}",
            flush=True,
        )
    if not words:
        save(rows)
    return int(any(row["verdict"] == "WRONG" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
