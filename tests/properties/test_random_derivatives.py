# SPDX-License-Identifier: MIT
"""Derivatives of random combinations agree with differences of runs, or are refused with a reason.

The derivative by a factor of a random number must be within 1e-7 of its largest value, or within
three times the digits of the differences, which are known from two of their changes.
"""

import re
from collections import Counter

import numpy as np
import pytest
from derivative_cases import case, outcome
from run_differences import TIGHT

import ufl_beam as ub

pytestmark = [pytest.mark.serial, pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")]

FEW = 4, 5, 6, 12, 18, 33, 47, 49, 52, 70, 72, 99
"""Combinations with laws, hinges, connectors, joints, statics and dynamics, of a second each."""

REASONS = (
    r"differentiate: [A-Z]\w+ has no derivatives",  # an effect
    r"differentiate: x changes the cells, unknowns or parts of the scene",
    r"differentiate: x near 1: .* joint ends lie .* apart",  # one of two vertices moves
    r"differentiate: the run does not depend on x",  # inertia in statics
    r"differentiate: dt = Adaptive",
)


@pytest.mark.parametrize("seed", FEW)
def test_derivatives_agree_with_differences(seed):
    found = outcome(case(seed))
    assert found.kind == "agrees", (found, case(seed).number)


@pytest.mark.parametrize(("seed", "reason"), [(0, 1), (9, 2), (3, 0), (14, 3), (97, 4)])
def test_reasons_of_refusals(seed, reason):
    found = outcome(case(seed))
    assert found.kind == "refused"
    assert re.match(REASONS[reason], found.words, re.DOTALL), found


@pytest.mark.parametrize("seed", [4, 5, 6, 12, 18, 47, 49, 52, 70, 72])
def test_adjoint_is_the_direct_derivative(seed):
    """Of a random sum of motions at all times, which differences of `of` know to about 1e-9."""
    one, random = case(seed), np.random.default_rng(seed)
    run = {"newton": TIGHT, **one.run}
    found = ub.differentiate(one.model, {"x": 1.0}, progress=False, **run)
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
