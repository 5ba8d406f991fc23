"""Rank analysis: can the beams of a scene move without being strained?"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigsh

from ufl_beam.beams import Place
from ufl_beam.compat import Array
from ufl_beam.errors import SceneError
from ufl_beam.scene import Scene

DENSE = 90
"""Up to this number of unknowns the null space comes from a dense decomposition."""


def require_no_mechanism(scene: Scene) -> None:
    """Raise :class:`SceneError` if a part of the scene is free to move in statics.

    An elastic beam resists every motion but the three rigid ones, so a motion without strain moves
    each beam as a rigid body; it exists if joints and supports leave those motions a null space.
    """
    free = _null_space(_constraints(scene))
    if free.shape[1] == 0:
        return
    mode = free[:, 0].reshape(-1, 3) / np.abs(free[:, 0]).max()
    moving = [i for i in range(len(scene.beams)) if np.abs(mode[i]).max() > 1e-6]
    parts = "; ".join(_describe(scene, i, mode[i]) for i in moving[:4])
    more = f"; and {len(moving) - 4} more" if len(moving) > 4 else ""
    ways = "way" if free.shape[1] == 1 else "independent ways"
    raise SceneError(
        f"the scene is free to move in {free.shape[1]} {ways}, so statics has no unique answer: "
        f"{parts}{more}. Add supports or joints, or run dynamics (Midpoint)"
    )


def _center(scene: Scene, beam: int) -> tuple[float, float]:
    """Point about which the rigid motion of a beam is described."""
    (xa, ya), (xb, yb) = scene.beams[beam].a, scene.beams[beam].b
    return (xa + xb) / 2, (ya + yb) / 2


def _constraints(scene: Scene) -> csr_array:
    """What joints and supports demand of (u, v, size ψ) of all beams; (constraints, 3 beams)."""
    number = {beam: i for i, beam in enumerate(scene.beams)}
    entries: list[tuple[int, int, float]] = []
    row = 0

    def motion(place: Place) -> tuple[int, Array]:
        beam = number[place.beam]
        cx, cy = _center(scene, beam)
        x, y = (place.point[0] - cx) / scene.size, (place.point[1] - cy) / scene.size
        return 3 * beam, np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])

    for joint in scene.joints:
        first, here = motion(joint.places[0])
        for place in joint.places[1:]:
            column, there = motion(place)
            for c in joint.shared:
                entries += [(row, first + k, -here[c, k]) for k in range(3)]
                entries += [(row, column + k, there[c, k]) for k in range(3)]
                row += 1
    for support in scene.supports:
        cos, sin = math.cos(support.angle), math.sin(support.angle)
        column, there = motion(support.place)
        turned = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]) @ there
        for c in support.held:
            entries += [(row, column + k, turned[c, k]) for k in range(3)]
            row += 1
    rows, columns, values = np.array(entries).reshape(-1, 3).T
    shape = (max(row, 1), 3 * len(scene.beams))
    return csr_array((values, (rows.astype(int), columns.astype(int))), shape=shape)


def _null_space(constraints: csr_array) -> Array:
    """Orthonormal basis, in columns, of what ``constraints @ x = 0`` leaves free."""
    unknowns = constraints.shape[1]
    if unknowns <= DENSE:
        _, sizes, rows = np.linalg.svd(constraints.toarray(), full_matrices=True)
        rank = int(np.sum(sizes > 1e-10 * max(1.0, sizes.max(initial=0.0))))
        return np.asarray(rows[rank:].T)
    gram = (constraints.T @ constraints).tocsc()
    values, vectors = eigsh(gram, k=6, sigma=-1e-9, which="LM", v0=np.ones(unknowns))
    return np.asarray(vectors[:, values < 1e-13 * abs(gram).max()])


def _describe(scene: Scene, beam: int, mode: Array) -> str:
    name = f"{scene.beams[beam].name} (beam {beam})"
    u, v, ψ = mode
    if abs(ψ) < 1e-6:
        return f"{name} can shift along ({u:.3g}, {v:.3g})"
    cx, cy = _center(scene, beam)
    x, y = (
        scene.size * round(c / scene.size, 9)
        for c in (cx - v / ψ * scene.size, cy + u / ψ * scene.size)
    )
    return f"{name} can turn about ({x:.4g}, {y:.4g})"
