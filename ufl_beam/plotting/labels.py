# SPDX-License-Identifier: MIT
"""Placement of labels in pictures, off lines and off each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ufl_beam.arrays import Array

GAPS = (4.0, 12.0, 24.0, 40.0, 60.0)  # distances of a label from its spot that are tried; points
CLEARANCE = 2.0  # room around a label; points
ROUNDS = 6  # times that each label is placed at most

LINE_COST, LABEL_COST, OUTSIDE_COST, DISTANCE_COST, RANK_COST = 8.0, 40.0, 100.0, 0.6, 0.4
"""Costs of a candidate: of a point of length of lines under the label, of a square point of another
label, of a point beyond the frame, of a point of distance, and of a place in the list of spots."""

CROSSING_COST = 25.0  # of a label that the leader crosses; a line costs a tenth of that
LEADER = 10.0  # distance of a label from its spot from which on a line leads to it; points


class Spot(NamedTuple):
    """Place that a label belongs to, and the direction in which the label lies from it."""

    at: Array  # (2,)
    way: Array  # unit vector; (2,)
    gap: float = 0.0  # least distance of the label; points


class Label(NamedTuple):
    """Text and the places where it may stand, the best first."""

    text: str
    color: str
    rank: int  # labels of lower ranks are placed first
    spots: tuple[Spot, ...]


class Placed(NamedTuple):
    """Label with its place; lengths in points."""

    label: Label
    center: Array  # of its box; (2,)
    half: Array  # half the width and height of its box; (2,)
    spot: Array  # that it belongs to; (2,)
    overlap: float  # part of its box that other labels cover

    @property
    def leader(self) -> Array:
        """Line from the spot to the box if that stands away; (2, 2) or (0, 2)."""
        edge = np.clip(self.spot, self.center - self.half, self.center + self.half)
        ends = np.array([self.spot, edge])
        return ends if np.linalg.norm(edge - self.spot) >= LEADER else ends[:0]


def place(
    labels: Sequence[Label], halves: Sequence[Array], lines: Array, frame: Array | None = None
) -> list[Placed]:
    """Place labels where they cover least; each again until all stay where they are.

    Spots, half widths and heights, segments that should stay visible, (n, 4), and the corners of a
    frame that labels should not leave, (4,), are all in points.
    """
    order = sorted(range(len(labels)), key=lambda k: labels[k].rank)
    placed: dict[int, Placed] = {}
    for _ in range(ROUNDS):
        before = [one.center for one in placed.values()]
        for k in order:
            others = [one for j, one in placed.items() if j != k]
            placed[k] = _best(labels[k], np.asarray(halves[k], dtype=float), lines, others, frame)
        if np.array_equal([one.center for one in placed.values()], before):
            break
    return [placed[k] for k in order]


def _best(
    label: Label, half: Array, lines: Array, others: list[Placed], frame: Array | None
) -> Placed:
    """The place of a label that costs least, of all spots at all distances."""
    boxes: Array = np.reshape([(*x.center - x.half, *x.center + x.half) for x in others], (-1, 4))
    lines = np.vstack([lines, *(x.leader.reshape(-1, 4) for x in others)])
    number = np.arange(len(label.spots))
    gaps, choices = np.repeat(GAPS, len(number)), np.tile(number, len(GAPS))
    ways = np.array([spot.way for spot in label.spots])[choices]
    spots = np.array([spot.at + spot.gap * spot.way for spot in label.spots])[choices]
    # So far from its spot a box is beyond the line through it, across the way.
    centers = spots + ways * (gaps + np.abs(ways) @ half)[:, None]
    low, high = centers - half - CLEARANCE, centers + half + CLEARANCE
    # Segments whose own boxes meet one of these
    first, last = np.minimum(lines[:, :2], lines[:, 2:]), np.maximum(lines[:, :2], lines[:, 2:])
    near = lines[((first <= high.max(axis=0)) & (last >= low.min(axis=0))).all(axis=1)]
    covered = areas_covered(low, high, boxes)
    cost = DISTANCE_COST * gaps + RANK_COST * choices
    cost += LINE_COST * lengths_inside(low, high, near) + LABEL_COST * covered
    if frame is not None:
        beyond = np.maximum(frame[:2] - low, 0.0) + np.maximum(high - frame[2:], 0.0)
        cost += OUTSIDE_COST * beyond.sum(axis=1)
    # Leaders that would be worse than the best place without one are not looked at.
    ends = np.hstack([spots, np.clip(spots, centers - half, centers + half)])
    leads = np.linalg.norm(ends[:, 2:] - ends[:, :2], axis=1) >= LEADER
    some = np.flatnonzero(leads & (cost < cost[~leads].min(initial=np.inf)))
    diagonals = np.concatenate([boxes, boxes[:, [0, 3, 2, 1]]])
    crossed = crossings(ends[some], diagonals) + 0.1 * crossings(ends[some], near)
    cost[some] += CROSSING_COST * crossed
    best = int(np.argmin(cost))
    overlap = float(covered[best] / np.prod(high[best] - low[best]))
    return Placed(label, centers[best], half, spots[best], overlap)


def crossings(first: Array, second: Array) -> Array:
    """Count segments (n, 4) that each of the first segments (num_first, 4) crosses."""
    a, b, c, d = first[:, None, :2], first[:, None, 2:], second[None, :, :2], second[None, :, 2:]

    def side(p: Array, q: Array, r: Array) -> Array:
        """Sign of the area of the triangle p, q, r."""
        (x, y), (u, v) = np.moveaxis(q - p, -1, 0), np.moveaxis(r - p, -1, 0)
        return np.asarray(np.sign(x * v - y * u))

    apart = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
    return np.asarray(apart.sum(axis=1))


def lengths_inside(low: Array, high: Array, lines: Array) -> Array:
    """Measure segments (n, 4) inside each box, given by its corners (num_boxes, 2)."""
    first, way = lines[None, :, :2], (lines[:, 2:] - lines[:, :2])[None]
    lengths = np.linalg.norm(way[0], axis=1)
    # Along an axis in which a segment does not move, it is inside for ever or never.
    way = np.where(way == 0.0, 1e-99, way)
    ends = (low[:, None] - first) / way, (high[:, None] - first) / way
    enter, leave = np.minimum(*ends).max(axis=2), np.maximum(*ends).min(axis=2)
    return np.asarray(np.maximum(np.minimum(leave, 1.0) - np.maximum(enter, 0.0), 0.0) @ lengths)


def areas_covered(low: Array, high: Array, boxes: Array) -> Array:
    """Measure the area of boxes with corners (num_boxes, 2) that others (n, 4) cover."""
    ends, starts = np.minimum(high[:, None], boxes[:, 2:]), np.maximum(low[:, None], boxes[:, :2])
    return np.asarray(np.prod(np.maximum(ends - starts, 0.0), axis=2).sum(axis=1))
