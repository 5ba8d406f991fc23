# SPDX-License-Identifier: MIT
"""Combinations of features agree with themselves: some 30 of them, and 400 in `make verify`.

``python3 test_combinations.py 1000 1500`` checks others, with one number it prints the script.
"""

import contextlib
import sys
import tempfile
from pathlib import Path

from mpi4py import MPI

import mechanics_checks  # noqa: F401 - adds its checks
import pytest
from combination_checks import flags_of, outcome_of
from combinations import DYNAMICS, STATICS, Combination, draw
from features import FEATURES
from helpers import PUBLIC

import ufl_beam as ub

NUMBER = 400
"""Combinations that draw everything."""


def covering():
    """Combinations, none refused, that draw all features, bases, schemes, names: most new first."""
    drawn = {}
    for n in range(NUMBER):
        c = draw(n)
        schemes = {x for x in (*STATICS, *DYNAMICS) if c.has(f".{x}\n", f"= {x}\n")}
        drawn[n] = {f.name for f in c.features} | c.names | schemes | {c.base}
    chosen, left = [], set().union(*drawn.values())
    while left:
        n = max(drawn, key=lambda n: len(drawn[n] & left))
        new = drawn.pop(n) & left
        with contextlib.suppress(ub.ModelError):
            draw(n).make()
            chosen.append(n)
            left -= new
    return chosen


FEW = covering()
"""Combinations that are checked in `make test`."""

RECORDED = {
    "Events", "Extremes", "Fatigue", "Gerber", "Goodman", "History", "HotSpot", "Recorder",
    "SNCurve", "VTKHDF", "XDMF",
}  # fmt: skip
"""What the checks `recorders` and `resumed` give to runs."""

CALLED = {
    "Checkpoint", "LoadControl", "Simulation", "buckling", "follow", "linearize", "modes", "plot",
    "simulate",
}  # fmt: skip
"""Other names that checks use."""

MADE = {"Connector", "Joint", "Solution", "Support"}
"""What others return; nobody makes them."""

ELSEWHERE = {
    "sections alike": "box of_sectionproperties",
    "analyses of sections": "interaction_diagram moment_curvature",
    "analyses of histories": "damping damping_ratio fit_decay logarithmic_decrement peaks rainflow "
    "response_spectrum",
    "other controls of paths": "ArcLength DisplacementControl DissipationControl",
    "analyses of structures, which run several simulations": "incremental_dynamic_analysis "
    "load_combinations pushover response_spectrum_analysis hinge_table storeys",
    "derivatives of runs, with random combinations of their own": "differentiate gradient",
    "many runs": "Measurement calibrate study tradeoff",
    "other geometry of ordinary scenes": "imperfect",
    "scenes in space, with tests of their own": "Spherical Universal Cylindrical",
    "errors and words": "ConvergenceError ModelWarning ArgumentError ModelError print_once",
    "pictures of what is not in every combination, or slow": "Camera animate picture render",
}
"""Public names that are no part of a model or its run, and why combinations leave them out."""

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")


@pytest.mark.serial
def test_everything_public_is_drawn():
    """A new public name is drawn by a feature, used by a check, or named above with a reason."""
    few = [draw(seed) for seed in FEW]
    assert {one.name for c in few for one in c.features} == {one.name for one in FEATURES}
    assert all(2 <= len(c.features) <= 5 for c in few)
    for scheme in (*STATICS, *DYNAMICS):
        assert any(c.has(f".{scheme}\n", f"= {scheme}\n") for c in few), scheme
    drawn = set().union(*(c.names for c in few))
    others = (RECORDED | CALLED | MADE).union(*(names.split() for names in ELSEWHERE.values()))
    assert not others - {*PUBLIC}, "no public names any more"
    assert not {*PUBLIC} - drawn - others, "nobody draws these"
    kinds = {name: getattr(kind, "__module__", "") for name, kind in PUBLIC.items()}
    models = {name for name, module in kinds.items() if module.startswith("ufl_beam.model.")}
    in_space = {*ELSEWHERE["scenes in space, with tests of their own"].split()}
    assert models - MADE - in_space <= drawn, "records of models are not left out"


ALL = [pytest.param(n, marks=pytest.mark.slow, id=f"all-{n}") for n in range(NUMBER)]


@pytest.mark.serial
@pytest.mark.parametrize("seed", [*FEW, *ALL])
def test_all_checks_of_a_combination_pass(seed, tmp_path):
    flags = flags_of(outcome_of(draw(seed), tmp_path))
    assert not flags, f"{flags}\n{draw(seed).source}"


@pytest.mark.serial
def test_all_checks_pass_if_iterates_go_far(tmp_path):
    """Forces of a rotating frame are 10⁷ times those in equilibrium at some iterates."""
    source = Path(__file__).with_name("far_iterates.txt").read_text(encoding="utf-8")
    features = tuple(one for one in FEATURES if one.name in source.splitlines()[0])
    assert not flags_of(outcome_of(Combination(157, "chain", features, source), tmp_path))


@pytest.mark.serial
@pytest.mark.parametrize("name", ["momentum", "jumps", "equilibrium"])
def test_a_mistake_is_found(name, tmp_path, monkeypatch):
    """Reactions that are wrong by a part in a million are flagged in a combination of `FEW`."""
    right = ub.Solution.reaction
    monkeypatch.setattr(ub.Solution, "reaction", lambda *of: (1 + 1e-6) * right(*of))
    outcomes = (outcome_of(draw(seed), tmp_path / str(seed), [name]) for seed in FEW)
    assert any(found.get(name, "").startswith("AssertionError") for found in outcomes)


@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="one process")
@pytest.mark.parametrize("seed", range(0, NUMBER, 7))
def test_processes_agree(seed, shared_path):
    flags = flags_of(outcome_of(draw(seed), shared_path, ["processes"]))
    assert not flags, f"{flags}\n{draw(seed).source}"


@pytest.mark.slow
@pytest.mark.serial
def test_few_combinations_are_refused_or_fail(tmp_path):
    """In statics there are limit loads; hinges and fibres in one section are refused."""
    found = [outcome_of(draw(seed), tmp_path, ["failed_step"]) for seed in range(NUMBER)]
    assert sum("run" in one for one in found) <= 0.02 * NUMBER
    assert sum(one.get("failed_step") == "passed" for one in found) <= 0.03 * NUMBER


if __name__ == "__main__":
    first, *last = map(int, sys.argv[1:])
    if not last:
        print(draw(first).source)
    for number in range(first, *last) if last else ():
        with tempfile.TemporaryDirectory() as place:
            if found := flags_of(outcome_of(draw(number), Path(place))):
                print(draw(number).title, found, sep="\n", flush=True)
