# SPDX-License-Identifier: MIT
"""Extrapolation and measured orders of a sequence of runs, each twice as fine as the one before."""

from itertools import pairwise

import numpy as np


def extrapolated(coarse, fine, order=2):
    """Richardson's limit of a method of the given order from two runs."""
    coarse, fine = np.asarray(coarse), np.asarray(fine)
    return fine + (fine - coarse) / (2**order - 1)


def romberg(*runs):
    """Limit for errors that have even powers only: from runs of 1, 2, 4, ... times the cells."""
    order = 2
    while len(runs) > 1:
        runs = [extrapolated(a, b, order) for a, b in pairwise(runs)]
        order += 2
    return runs[0]


def orders(errors):
    """Measured order of each consecutive pair of errors."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


def self_convergence(runs):
    """Measured orders from the differences of consecutive runs; each an array of any shape."""
    return orders([np.linalg.norm(np.subtract(a, b)) for a, b in pairwise(runs)])
