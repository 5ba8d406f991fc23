"""One run in a process of its own: ``one.py PROGRAM PROBLEM SETTINGS``; a line of JSON."""

import importlib
import json
import resource
import sys


def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # MB


def main(program, problem, settings):
    module = importlib.import_module(f"in_{program}")
    before = peak()
    result = module.RUNS[problem](**json.loads(settings))
    result = {"memory": peak(), "memory_before": before, "version": module.VERSION} | result
    print("\n" + json.dumps(result), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
