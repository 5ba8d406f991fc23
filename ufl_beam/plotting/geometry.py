# SPDX-License-Identifier: MIT
"""Vectors in the plane, and points along lines, of pictures; all arrays end with (x, y)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ufl_beam.arrays import Array


def directions(angles: Any) -> Array:
    """Unit vectors at angles from the axis x; (..., 2); angles in rad."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def unit_vectors(vectors: Array) -> Array:
    """Vectors divided by their lengths; (..., 2)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def left_of(vectors: Array) -> Array:
    """Vectors turned to their left by a right angle; (..., 2)."""
    return vectors[..., ::-1] * (-1.0, 1.0)


def in_frame(points: Any, at: Array, ahead: Array) -> Array:
    """Points from coordinates along a vector and to its left, in its length; (n, 2)."""
    return np.asarray(at + np.array(points) @ np.array([ahead, left_of(ahead)]))


def lengths_along(line: Array) -> Array:
    """Lengths of a line from its start to each of its points; (n,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))


def points_along(line: Array, lengths: Array) -> Array:
    """Points of a line at lengths from its start; (n, 2)."""
    return np.column_stack([np.interp(lengths, lengths_along(line), x) for x in line.T])


def segments(line: Array) -> Array:
    """Pieces of a line between its points, as (x, y, x, y) of both ends; (n - 1, 4)."""
    return np.hstack([line[:-1], line[1:]])


def joined(lines: Iterable[Array]) -> Array:
    """Lines one after the other, with NaN between them: one line to Matplotlib; (n, 2)."""
    gap = np.full((1, 2), np.nan)
    chains: list[Array] = [chain for line in lines for chain in (line, gap)]
    return np.concatenate(chains[:-1] or [np.empty((0, 2))])
