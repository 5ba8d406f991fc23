# SPDX-License-Identifier: MIT
"""Runs of a combination, comparisons of their results, and the list of checks.

A check raises :class:`NotApplicable` where the combination is none for it, and AssertionError where
results differ.
"""

import warnings
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from mpi4py import MPI

import numpy as np
from combinations import Combination
from restart_scenes import arrays_of

import ufl_beam as ub

DIGITS = 1e-12
"""Tolerance of Newton's method in runs whose results are compared as numbers."""

SAME = 1e-7
"""Difference of two runs to :data:`DIGITS`, as a part of the largest value: each of some 20 steps
leaves 1e-12 of the forces, stiffnesses differ by factors of up to 1e3."""


class NotApplicable(Exception):
    """Why a check says nothing about a combination."""


def only(condition, reason):
    if not condition:
        raise NotApplicable(reason)


@dataclass
class Run:
    """Names of a script, and the solution of its scene; `failure` if a step failed."""

    names: dict
    solution: ub.Solution
    failure: str = ""


@dataclass
class Case:
    """A combination, its run, and a folder for files."""

    combination: Combination
    folder: Path
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF)

    def run(self, source=None, *, names=None, call=ub.simulate, **changes):
        """Run the script, with other arguments; a failed step leaves what came before it."""
        names = self.combination.make(source) if names is None else names
        arguments = {key: names[key] for key in ("t", "dt", "mesh", "newton")}
        arguments |= {"comm": self.comm, **changes}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ub.ModelWarning)
            try:
                return Run(names, call(names["scene"], names["scheme"], **arguments))
            except ub.ConvergenceError as error:
                return Run(names, error.solution, str(error))

    @cached_property
    def whole(self):
        """The run as the script states it."""
        return self.run()

    @cached_property
    def exact(self):
        """The same to more digits."""
        return self.run(newton=ub.Newton(rtol=DIGITS))

    @property
    def steps(self):
        return len(self.whole.solution) - 1

    @property
    def equal_steps(self):
        return not self.combination.has("ub.Adaptive")


CHECKS = {}


def check(function):
    """Add a function to the checks."""
    CHECKS[function.__name__] = function
    return function


def assert_same_bits(one, other):
    first, second = (arrays_of(x) if isinstance(x, ub.Solution) else x for x in (one, other))
    assert sorted(first) == sorted(second)
    for name, values in first.items():  # all bits but the signs of zeros
        numbers = not isinstance(values, str)
        assert np.array_equal(values, second[name], equal_nan=numbers), name


def difference(one, other, size=None):
    """Largest difference, as a part of the largest size; NaN stands where it stands in both."""
    one, other = np.asarray(one), np.asarray(other)
    assert one.shape == other.shape
    assert (np.isnan(one) == np.isnan(other)).all()
    size = np.nanmax(np.abs(other), initial=0.0) if size is None else size
    return float(np.nanmax(np.abs(one - other), initial=0.0)) / (size or 1.0)


def results(names, solution, rows=slice(None)):
    """Results of a solution by name: motions as parts of the scene, forces of all parts."""
    scene = names["scene"]
    lengths = scene.size * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, 1.0])
    moved = [one.at(s) for one in scene.beams for s in (0.0, 0.5, 1.0)]
    forces = [solution.section_forces_at(place)[rows] for place in moved]
    forces += [solution.reaction(support)[rows] for support in scene.supports]
    moved += [one.middle for one in scene.bodies]
    of_each = [np.atleast_2d(solution.connector(x).force[rows].T) for x in scene.connectors]
    return {
        "motions": (np.array([solution.displacement(p)[rows] / lengths for p in moved]), 1.0),
        "forces": (np.array(forces), None),
        "of connectors": (np.concatenate(of_each) if of_each else np.array([]), None),
    }


def differences(one, other, rows=slice(None)):
    """Largest differences of two runs by kind; of some rows of the second, as if it began there."""
    a, b = results(one.names, one.solution), results(other.names, other.solution, rows)
    forces = max((np.nanmax(np.abs(x), initial=0.0) for x, _ in b.values()), default=1.0)
    found = {}
    for name, (values, size) in a.items():
        values, others = (x[:, 1:] if x.ndim > 1 else x for x in (values, b[name][0]))
        found[name] = difference(values, others, size or forces)
    through = other.solution.energy.energy_transferred or 1.0
    for kind in ("state", "supplied", "lost"):
        mine, others = getattr(one.solution.energy, kind), getattr(other.solution.energy, kind)
        assert set(mine) == set(others)
        for name in mine:
            expected = others[name][rows] - (0.0 if kind == "state" else others[name][rows][0])
            found[f"{kind}: {name}"] = difference(mine[name], expected, through)
    return found


def assert_near(found, tolerance=SAME):
    assert max(found.values()) <= tolerance, {k: v for k, v in found.items() if v > tolerance}


REFUSED = "hinges are for resultants"
"""What a refusal of a combination may say: features that the documentation excludes together."""


def outcome_of(combination, folder, names=CHECKS):
    """What became of each check: "passed", "not applicable", "refused", or words of a flag."""
    case, found = Case(combination, folder), {}
    try:
        assert case.whole.solution is not None
    except ub.ArgumentError as error:
        return {"run": "refused" if REFUSED in str(error) else f"refused: {error}"}
    for name in names:
        try:
            CHECKS[name](case)
            found[name] = "passed"
        except NotApplicable:
            found[name] = "not applicable"
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
    return found


def flags_of(found):
    """Checks that failed, and what they said."""
    known = "passed", "not applicable", "refused"
    return {name: words for name, words in found.items() if words not in known}
