# SPDX-License-Identifier: MIT
"""Five-point differences of runs, with which tests compare derivatives of runs."""

import inspect

from mpi4py import MPI

import numpy as np

import ufl_beam as ub

TIGHT = ub.Newton(rtol=1e-13)
"""Differences of runs divide the errors of their steps by the change of a parameter."""

CENTRAL = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
"""Weights of five-point differences by position; exact for polynomials of degree 4."""

FORWARD = {0: -25 / 12, 1: 4.0, 2: -3.0, 3: 4 / 3, 4: -1 / 4}
"""The same of one-sided differences."""

CHANGES = 1e-3, 1e-4, 1e-5, 1e-6
"""Relative changes of a parameter.  The error of differences is least for one of them, which is
unknown: it grows with large changes by higher derivatives and with small ones by round-off."""


def difference(value, x, h, weights=CENTRAL):
    """Difference quotient of a function of a number."""
    return sum(weight * value(x + k * h) for k, weight in weights.items()) / h


def defaults(model):
    """Parameters of a model with their default values, without those that are None."""
    parameters = inspect.signature(model).parameters.values()
    return {p.name: p.default for p in parameters if p.default is not None}


def history(solution):
    """Configurations at all times."""
    return solution.q


def differences(model, at, name, of, scheme, changes=CHANGES, **options):
    """Yield differences of a quantity of runs by one parameter, for each relative change of it."""

    def value(x):
        scene = model(**{**at, name: x})
        return np.asarray(
            of(ub.simulate(scene, scheme, newton=TIGHT, comm=MPI.COMM_SELF, **options))
        )

    for part in changes:
        yield difference(value, at[name], part * (abs(at[name]) or 1.0))


def relative_error(a, b):
    """Largest difference of two arrays over the largest entry of the second."""
    size = np.abs(b).max()
    return float(np.abs(a - b).max() / size) if size > 0 else float(np.abs(a).max())


def errors(model, at, scheme, of=history, changes=CHANGES, enough=0.0, **options):
    """Least relative error of the derivative by each parameter; no further below ``enough``."""
    run = ub.differentiate(model, at, scheme, newton=TIGHT, **options)
    found, least = run.of(of), dict.fromkeys(at, np.inf)
    for k, name in enumerate(at):
        for fd in differences(model, at, name, of, scheme, changes, **options):
            least[name] = min(least[name], relative_error(found[..., k], fd))
            if least[name] < enough:
                break
    return least
