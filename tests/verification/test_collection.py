# SPDX-License-Identifier: MIT
"""Models of benchmarks/collection: three quick ones, and the whole collection as a slow test."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "collection"))

import dynamics  # noqa: F401  # enters its models
import statics  # noqa: F401
from models import MODELS, judged

pytestmark = pytest.mark.serial

QUICK = {
    "hinge at the kink to residual strength, in cycles": "end",
    "perfectly plastic portal, load control until a mechanism": "stops",
    "two gaps that close in the same step": "end",
}
"""Names and verdicts."""


@pytest.mark.parametrize(("name", "verdict"), list(QUICK.items()))
def test_a_quick_model_ends_as_it_should(name, verdict):
    """A stop is at the limit load of linear programming on the displaced geometry, to 0.1 %."""
    assert judged(MODELS[name])["verdict"] == verdict


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*it resists rigid turning and flow")
@pytest.mark.parametrize("name", [name for name in MODELS if name not in QUICK])
def test_a_model_is_not_wrong(name):
    """Models that are known to fail, see docs/collection.md, may become better."""
    assert judged(MODELS[name])["verdict"] != "WRONG"
