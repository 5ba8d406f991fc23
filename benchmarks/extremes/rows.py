# SPDX-License-Identifier: MIT
"""What a row of the study is, and how one is run: every value, one after the other."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import ufl_beam as ub

EPS = 2.0**-52
"""Last digit of one."""

LEDGER = 1e-9
"""What the ledger and momenta are promised to close to, as a part of what went through."""


@dataclass(frozen=True)
class Outcome:
    """What a run of one value came to.

    Attributes:
        error: Difference from an independent answer.
        allowed: What round-off, the tolerance and the order of the method explain.
        iterations: Newton iterations per step that was asked for.
        note: Besides, for the table.
    """

    error: float
    allowed: float
    iterations: float
    note: str = ""


def outcome(solution: ub.Solution, error: float, allowed: float, note: str = "") -> Outcome:
    """The outcome of a simulation."""
    return Outcome(error, allowed, solution.iterations / max(1, solution.substeps), note)


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: Title.
        varied: What the values are.
        against: The independent answer.
        values: What is tried.
        stops: Beginnings or parts of messages with which a value may stop rightly.
        seconds: After which a run that has not ended counts as a hang.
        experiment: From a value to an outcome.
    """

    name: str
    varied: str
    against: str
    values: Sequence[Any]
    stops: tuple[str, ...]
    seconds: float
    experiment: Callable[[Any], Outcome]


ROWS: dict[str, Row] = {}
"""The table."""


def row(
    name: str,
    varied: str,
    against: str,
    values: Sequence[Any],
    *,
    stops: tuple[str, ...] = (),
    seconds: float = 200.0,
) -> Callable[[Callable[[Any], Outcome]], Callable[[Any], Outcome]]:
    """Enter an experiment as a row of the table."""

    def enter(experiment: Callable[[Any], Outcome]) -> Callable[[Any], Outcome]:
        ROWS[name] = Row(name, varied, against, values, stops, seconds, experiment)
        return experiment

    return enter


def run(name: str) -> None:
    """Run a row and write one line of JSON for each value, as soon as it is known."""
    one = ROWS[name]
    for value in one.values:
        begin = time.perf_counter()
        result = _judge(one, value)
        result |= {"value": value, "seconds": time.perf_counter() - begin}
        print(json.dumps(result), file=sys.stdout, flush=True)


def _judge(one: Row, value: Any) -> dict[str, Any]:
    """The verdict on one value, by comparison."""
    try:
        got = one.experiment(value)
    except (ub.ArgumentError, ub.ConvergenceError) as error:
        message = str(error).splitlines()[0]
        right = any(part in message for part in one.stops)
        return {"verdict": "stops" if right else "WRONG", "message": message}
    except Exception as error:
        return {"verdict": "WRONG", "message": f"{type(error).__name__}: {error}"}
    if math.isfinite(got.error) and got.error <= got.allowed:
        return {"verdict": "works", **asdict(got)}
    message = f"error {got.error:.2e} of {got.allowed:.2e}"
    return {"verdict": "WRONG", "message": message, **asdict(got)}
