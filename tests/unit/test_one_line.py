# SPDX-License-Identifier: MIT
"""Representations of one line; those of all public classes are looked at in test_examples.py."""

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

import ufl_beam as ub
from ufl_beam.display import compact_repr, counted
from ufl_beam.model.supports import still


class Pair(NamedTuple):
    """Two things, of which the second has a default."""

    first: object
    second: object = 1.0


def test_fields_as_by_default_and_empty_ones_are_left_out():
    assert compact_repr(Pair(2)) == "Pair(first=2)"
    assert compact_repr(Pair({}, 2)) == "Pair(second=2)"
    assert repr(ub.Newton()) == "Newton()"
    assert repr(ub.Newton(rtol=1e-8)) == "Newton(rtol=1e-08)"


def test_numbers_have_six_digits():
    assert compact_repr(Pair(math.pi, np.float64(1) / 3)) == "Pair(first=3.14159, second=0.333333)"
    assert compact_repr(Pair((0.1 + 0.2, 1))) == "Pair(first=(0.3, 1))"
    assert repr(ub.Mesh(refine=Fraction(3, 2))) == "Mesh(refine=3/2)"


def test_functions_have_their_names():
    assert compact_repr(Pair(still)) == "Pair(first=still)"


def test_long_arrays_have_their_shapes():
    assert compact_repr(Pair(np.arange(3.0))) == "Pair(first=[0, 1, 2])"
    assert compact_repr(Pair(np.zeros((9, 3)))) == "Pair(first=array of shape (9, 3))"
    assert compact_repr(Pair([*range(9)])) == "Pair(first=[0, 1, 2, 3, 4, 5, ...])"


def test_what_there_is_is_counted():
    assert counted((1, "body", "bodies"), (0, "joint", "joints"), (2, "load", "loads")) == (
        "1 body, 2 loads"
    )
    assert repr(ub.Scene(bodies=[ub.Body((0, 0), mass=1.0, inertia=1.0)])) == "<Scene: 1 body>"
