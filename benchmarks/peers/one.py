# SPDX-License-Identifier: MIT
"""One run in a process of its own: ``one.py PROGRAM PROBLEM SETTINGS``; a line of JSON."""

import importlib
import json
import sys
from pathlib import Path


def peak():
    """Peak memory of this program alone; MB.  (ru_maxrss counts that of the one before it, too.)"""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def main(program, problem, settings):
    module = importlib.import_module(f"in_{program}")
    before = peak()
    result = module.RUNS[problem](**json.loads(settings))
    result = {"memory": peak(), "memory_before": before, "version": module.VERSION} | result
    print("\n" + json.dumps(result), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
