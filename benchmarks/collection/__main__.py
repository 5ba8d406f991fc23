# SPDX-License-Identifier: MIT
"""Models that fail elsewhere, run to the end or to the mechanism.

Run by ``make collection``.  Writes ``docs/collection.md``; fails if a model ends in another way
than it should.  Arguments select models by parts of their names, and only print.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

sys.path.insert(1, str(Path(__file__).parents[1]))  # of the module records

import dynamics  # noqa: F401  # enters its models
import statics
from models import MODELS, judged
from opensees_models import CONTROLS, NAMES
from report import confirmation, outcome, save

PEERS = Path(__file__).parents[1] / "peers"
"""Directory of the module that installs OpenSees."""


def in_opensees(name: str) -> list:
    """Run the counterpart of a model with both controls; times of failure, None at the end."""
    sys.path.insert(0, str(PEERS))
    from install import installed  # installs from PyPI

    environment = {**os.environ, "PYTHONPATH": str(installed())}
    script = str(Path(__file__).with_name("in_opensees.py"))
    ends = []
    for control in CONTROLS:
        command = [sys.executable, script, name, control, json.dumps(statics.cover_and_core())]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=600, check=False
        )
        (line,) = [line for line in done.stdout.splitlines() if line.startswith("result ")]
        ends.append(json.loads(line.removeprefix("result ")))
    return ends


def main() -> int:
    """Run all models, or those whose names contain an argument; the exit code."""
    words = sys.argv[1:]
    rows = []
    for name, one in MODELS.items():
        if words and not any(word in name for word in words):
            continue
        rows.append(row := judged(one))
        if name in NAMES:
            row["opensees"] = in_opensees(name)
        print(
            f"{name:72s} {outcome(row):18s} {row['cut']:3d} cut {row['seconds']:6.1f} s  "
            f"{confirmation(row)}  {row.get('opensees', '')}",
            flush=True,
        )
    if not words:
        save(rows)
    return int(any(row["verdict"] == "WRONG" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
