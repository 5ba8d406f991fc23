# SPDX-License-Identifier: MIT
"""What benchmarks keep of a measurement: a line of JSON, with commit, versions and machine."""

import datetime
import json
import platform
import subprocess
from functools import cache
from pathlib import Path

from ufl_beam.dolfinx_compat import dolfinx

RESULTS = Path(__file__).parent / "results"


def keep(name, record):
    """Append a record to ``results/NAME.jsonl``."""
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / f"{name}.jsonl").open("a") as file:
        file.write(json.dumps({**record, **machine()}) + "\n")


def in_lines(value, margin=""):
    """Return JSON in which each record without lists of records in it is one line."""
    if not _has_records(value):
        return json.dumps(value)
    inside = margin + " "
    if isinstance(value, dict):
        rows = [f"{inside}{json.dumps(k)}: {in_lines(v, inside)}" for k, v in value.items()]
    else:
        rows = [inside + in_lines(one, inside) for one in value]
    begin, end = "{}" if isinstance(value, dict) else "[]"
    return "\n".join([begin, ",\n".join(rows), margin + end])


def _has_records(value):
    """Return whether there is a list of records in a value, or it is one."""
    if isinstance(value, dict):
        return any(map(_has_records, value.values()))
    return isinstance(value, list) and any(isinstance(one, dict) for one in value)


@cache
def machine():
    """Commit and date, versions and machine of a measurement."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    ).stdout.strip()
    return {
        "commit": f"{commit or 'unknown'}, {datetime.date.today()}",
        "python": platform.python_version(),
        "dolfinx": dolfinx.__version__,
        "machine": platform.machine(),
        "processor": processor(),
        "threads": 1,
    }


def processor():
    """Name of the processor, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((x.split(":")[1].strip() for x in lines if x.startswith("model name")), "unknown")
