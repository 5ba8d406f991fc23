# SPDX-License-Identifier: MIT
"""Derivatives of random combinations agree with differences of runs, or are refused with a reason.

The derivative by a factor of a random number must be within 1e-7 of its largest value, or within
three times the digits of the differences, which are known from two of their changes.
"""

import re
from collections import Counter
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from combinations import draw
from run_differences import CENTRAL, TIGHT, difference

import ufl_beam as ub

pytestmark = [pytest.mark.serial, pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")]

FEW = 4, 5, 6, 12, 18, 47, 52, 70, 72, 99
"""Combinations with laws, hinges, connectors, joints, statics and dynamics, of a second each."""

REASONS = (
    r"differentiate: [A-Z]\w+ has no derivatives",  # an effect
    r"differentiate: x changes the cells, unknowns or parts of the scene",
    r"differentiate: x near 1: .* joint ends lie .* apart",  # one of two vertices moves
    r"differentiate: the run does not depend on x",  # inertia in statics
    r"differentiate: dt = Adaptive",
)

NUMBERS = re.compile(r"(?<![\w.\]\)])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)(?![\w.])")
TIMES = re.compile(r"Table\(\[[^]]*\]")
"""Times of a table; steps end at some of them, where its value has no derivative by the time."""

OTHERS = "#", "import", "scheme =", "t, dt", "mesh"
"""Words of lines without numbers of the scene."""

CHANGES = 1e-3, 1e-4, 1e-5, 1e-6, 1e-7


class Case(NamedTuple):
    """Function of a factor of a number of a combination, arguments of its run, and the number."""

    model: object
    run: dict
    number: str


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
    return Case(model, run, f"{source[first:last]} in {line}")


class Outcome(NamedTuple):
    """Comparison of a derivative with differences.

    Attributes:
        kind: "agrees", "switches", "differs", "refused" or "failed".
        error: Least error, relative to the size of the derivative.
        digits: Least change of differences from one change of x to the next, in the same unit.
    """

    kind: str
    error: float = 0.0
    digits: float = 0.0
    words: str = ""


def outcome(one):
    """Compare with differences of runs; of better ones where those to 1e-13 have large errors."""
    for newton in (TIGHT, ub.Newton(rtol=1e-15)):
        found = compare(one, newton)
        if found.kind != "differs":
            break
    return found


def compare(one, newton):
    """The same with given tolerances."""
    options = {"newton": newton, **one.run}
    try:
        found = ub.differentiate(one.model, {"x": 1.0}, **options)
    except ub.ConvergenceError as error:
        return Outcome("failed", words=str(error))
    except ub.ArgumentError as error:
        return Outcome("refused", words=str(error))
    derivative, limit = found.of(lambda s: s.q)[..., 0], found.ranges["x"]

    def value(x):
        return ub.simulate(one.model(x), **options).q

    # Forces and motions have units of their own.  A derivative of zero is 1e-13 of the motion over
    # a change, or 1e-8 of loads of 1 to 25 N.
    size, least = np.abs(derivative).max(axis=0), 1e-3 * np.abs(found.solution.q).max(axis=0)
    forces = np.isin(np.arange(len(size)), found.solution.numbering.multipliers)
    groups = [(x, floor) for x, floor in ((forces, [1.0]), (~forces, least[~forces])) if x.any()]
    scales = [(x, max(size[x].max(), *floor)) for x, floor in groups]

    def apart(one, other):
        return max(np.abs(one - other)[:, x].max() / scale for x, scale in scales)

    words = f"range {limit.change:.1e} at {limit.time:g} s, {limit.place}"
    fds, known, errors = [], [], []
    for h in CHANGES:
        try:
            fds.append(difference(value, 1.0, h, CENTRAL))
        except (ub.ConvergenceError, ValueError):  # other numbers of steps
            continue
        known.append(h)
        errors.append(apart(fds[-1], derivative))
        digits = min((apart(*pair) for pair in pairwise(fds)), default=np.inf)
        if min(errors) < 1e-7 and digits < 1e-4:
            break
    if len(fds) < 2:
        return Outcome("failed", words="the runs of differences fail")
    if min(errors) < max(1e-7, 3 * digits) and digits < 1e-4:
        return Outcome("agrees", min(errors), digits, words)
    kind = "switches" if limit.change < 2.5 * min(known) else "differs"
    return Outcome(kind, min(errors), digits, words)


@pytest.mark.parametrize("seed", FEW)
def test_derivatives_agree_with_differences(seed):
    found = outcome(case(seed))
    assert found.kind == "agrees", (found, case(seed).number)


@pytest.mark.parametrize(("seed", "reason"), [(0, 1), (9, 2), (3, 0), (14, 3), (97, 4)])
def test_reasons_of_refusals(seed, reason):
    found = outcome(case(seed))
    assert found.kind == "refused"
    assert re.match(REASONS[reason], found.words, re.DOTALL), found


@pytest.mark.parametrize("seed", FEW[:-1])
def test_adjoint_is_the_direct_derivative(seed):
    """Of a random sum of motions at all times, which differences of `of` know to about 1e-9."""
    one, random = case(seed), np.random.default_rng(seed)
    run = {"newton": TIGHT, **one.run}
    found = ub.differentiate(one.model, {"x": 1.0}, **run)
    direct = found.of(lambda s: s.q)[..., 0]
    times = random.normal(size=len(direct))
    dofs = random.choice(direct.shape[1], 3, replace=False)
    _, found = ub.gradient(
        one.model, {"x": 1.0}, of=lambda s: s.q[:, dofs].sum(axis=1), reduce=times.dot, **run
    )
    parts = times[:, None] * direct[:, dofs]
    np.testing.assert_allclose(found, parts.sum(), rtol=0, atol=1e-8 * np.abs(parts).sum())


def test_a_mistake_is_found(monkeypatch):
    """Derivatives that are wrong by a part in a million differ."""
    right = ub.Derivatives.of
    monkeypatch.setattr(ub.Derivatives, "of", lambda *of: (1 + 1e-6) * right(*of))
    assert outcome(case(4)).kind == "differs"


@pytest.mark.slow
def test_a_hundred_random_scenes():
    """No derivative differs; at most two runs of a hundred have a switch beside them or fail."""
    kinds, faults = Counter(), {}
    for seed in range(1000):
        try:
            one = case(seed)
        except ub.ModelError:  # a combination that is refused, as test_combinations.py counts
            continue
        found = outcome(one)
        kinds[found.kind] += 1
        explained = any(re.match(reason, found.words, re.DOTALL) for reason in REASONS)
        if found.kind == "differs" or (found.kind == "refused" and not explained):
            faults[seed] = found, one.number
        if kinds["agrees"] == 100:
            break
    print(kinds)
    assert not faults
    assert kinds["agrees"] == 100
    assert kinds["switches"] + kinds["failed"] <= 2
