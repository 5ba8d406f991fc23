# SPDX-License-Identifier: MIT
"""All checks of many combinations: outcomes, and a table of how often each applied and passed."""

import contextlib
import io
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import combination_checks  # noqa: F401 - adds its checks
import mechanics_checks  # noqa: F401
from combination_case import CHECKS, Case, NotApplicable
from combinations import draw

import ufl_beam as ub

REFUSED = (
    "hinges are for resultants",
)  # fmt: skip
"""What a refusal of a combination may say: features that the documentation excludes together."""


SECONDS: Counter = Counter()
"""Time that each check has taken in this process; s."""


def outcome_of(combination, folder, names):
    """What became of each check: "passed", "not applicable", "refused", or words of a flag."""
    case, found = Case(combination, folder), {}
    try:
        assert case.whole.solution is not None
    except ub.ArgumentError as error:
        known = any(words in str(error) for words in REFUSED)
        return {"run": "refused" if known else f"refused: {error}"}
    for name in names:
        begin = time.perf_counter()
        try:
            CHECKS[name](case)
            found[name] = "passed"
        except NotApplicable:
            found[name] = "not applicable"
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
        SECONDS[name] += time.perf_counter() - begin
    return found


def table_of(seeds, names):
    """Run many; print flags as they come, and return the table of checks."""
    warnings.simplefilter("error", RuntimeWarning)  # as in tests
    counts = {name: Counter() for name in ("run", *names)}
    for seed in seeds:
        quiet = contextlib.redirect_stdout(io.StringIO())  # what resumed runs say
        with tempfile.TemporaryDirectory() as folder, quiet:
            found = outcome_of(draw(seed), Path(folder), names)
        for name, words in {"run": "passed", **found}.items():
            known = words in ("passed", "not applicable", "refused")
            counts[name][words if known else "flags"] += 1
            if not known:
                print(f"{name}: {words[:600]}\n    {draw(seed).title}", flush=True)
    kinds = ("passed", "flags", "refused", "not applicable")
    rows = [f"{'check':24s}" + "".join(f"{kind:>16s}" for kind in kinds) + "       s each"]
    for name, count in counts.items():
        each = SECONDS[name] / max(1, sum(count.values()))
        rows.append(f"{name:24s}" + "".join(f"{count[k]:16d}" for k in kinds) + f"{each:13.3f}")
    return "\n".join(rows)
