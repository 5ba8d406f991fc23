# SPDX-License-Identifier: MIT
"""Derivatives of random combinations by random numbers in their scripts."""

import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from combinations import draw
from run_differences import CENTRAL, TIGHT, difference

import ufl_beam as ub

NUMBERS = re.compile(r"(?<![\w.\]\)])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)(?![\w.])")
TIMES = re.compile(r"Table\(\[[^]]*\]")
"""Times of a table; steps end at some of them, where its value has no derivative by the time."""

OTHERS = "#", "import", "scheme =", "t, dt", "mesh"
"""Words of lines without numbers of the scene."""

CHANGES = 1e-3, 1e-4, 1e-5, 1e-6, 1e-7


class Case(NamedTuple):
    """A combination with the factor ``x`` of one of its numbers.

    Attributes:
        model: Function of x that returns the scene.
        run: Scheme, times, step and mesh, as arguments of ``simulate``.
        number: The number with its line.
        title: Title of the combination.
    """

    model: object
    run: dict
    number: str
    title: str


def case(seed):
    """A combination, and one of its numbers that is not zero."""
    combination, random = draw(seed), np.random.default_rng(seed)
    source, places, at = combination.source, [], 0
    for line in source.splitlines(keepends=True):
        if not any(word in line for word in OTHERS):
            numbers = TIMES.sub(lambda m: " " * len(m[0]), line)
            found = [m.span() for m in NUMBERS.finditer(numbers) if float(m[0]) != 0]
            places += [(at + a, at + b, line.strip()) for a, b in found]
        at += len(line)
    first, last, line = places[random.integers(len(places))]
    names = combination.make()

    def model(x):
        number = f"({source[first:last]} * {x!r})"
        return combination.make(source[:first] + number + source[last:])["scene"]

    run = {name: names[name] for name in ("scheme", "t", "dt", "mesh")}
    return Case(model, run, f"{source[first:last]} in {line}", combination.title)


class Outcome(NamedTuple):
    """Comparison of a derivative with differences.

    Attributes:
        kind: "agrees", "switches", "differs", "refused" or "failed".
        error: Least error, relative to the size of the derivative.
        digits: Least change of the differences from one change of x to the next, in the same unit.
        words: Message of a refusal or failure, or the range.
    """

    kind: str
    error: float = 0.0
    digits: float = 0.0
    words: str = ""


def outcome(one):
    """Compare the derivative of the motion with differences of runs.

    Near limit loads runs to 1e-13 have errors of 1e-6, and are solved further.
    """
    for newton in (TIGHT, ub.Newton(rtol=1e-15)):
        found = compare(one, newton)
        if found.kind != "differs":
            break
    return found


def compare(one, newton):
    """The same with given tolerances."""
    options = {"newton": newton, "progress": False, **one.run}
    try:
        found = ub.differentiate(one.model, {"x": 1.0}, **options)
    except ub.ConvergenceError as error:
        return Outcome("failed", words=str(error))
    except ub.ArgumentError as error:
        return Outcome("refused", words=str(error))
    derivative, limit = found.of(lambda s: s.q)[..., 0], found.ranges["x"]

    def value(x):
        return ub.simulate(one.model(x), **options).q

    fds, known = [], []
    for h in CHANGES:
        try:
            fds.append(difference(value, 1.0, h, CENTRAL))
            known.append(h)
        except (ub.ConvergenceError, ValueError):  # other numbers of steps
            continue
    if len(fds) < 2:
        return Outcome("failed", words="the runs of differences fail")
    size = np.abs(derivative).max(axis=0)
    multipliers = np.isin(np.arange(len(size)), found.solution.numbering.multipliers)
    errors, digits = np.zeros((2, len(fds)))
    for group in (multipliers, ~multipliers):  # forces and motions have units of their own
        if not group.any():
            continue
        # A derivative of zero is 1e-13 of the motion over a change, or 1e-8 of loads of 1 to 25 N
        floor = 1.0 if group is multipliers else 1e-3 * np.abs(found.solution.q[:, group]).max()
        scale = max(size[group].max(), floor)
        far = [np.abs(fd - derivative)[:, group].max() / scale for fd in fds]
        step = [np.abs(a - b)[:, group].max() / scale for a, b in pairwise(fds)]
        errors = np.maximum(errors, far)
        digits = np.maximum(digits, [*step, step[-1]])
    best = int(np.argmin(errors))
    words = f"range {limit.change:.1e} at {limit.time:g} s, {limit.place}"
    if errors[best] < max(1e-7, 3 * digits.min()) and digits.min() < 1e-4:
        return Outcome("agrees", errors[best], digits.min(), words)
    kind = "switches" if limit.change < 2.5 * min(known) else "differs"
    return Outcome(kind, errors[best], digits.min(), words)
