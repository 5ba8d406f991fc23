# SPDX-License-Identifier: MIT
"""Text in the file of a solution: the scene, with its functions as far as they were used."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Anchor, Member
from ufl_beam.model.connector_laws import Controller, Guide
from ufl_beam.model.curves import Curve, nearest, parameter_step
from ufl_beam.model.force_laws import ForceLaw
from ufl_beam.model.scene import Scene
from ufl_beam.output.archive import Content, above, below, version
from ufl_beam.output.saved_scene import SavedCurve, SavedFunction, from_data, lost, to_data
from ufl_beam.output.state_rows import BEFORE, FORCES
from ufl_beam.simulation.fingerprint import Description, difference

FORMAT = "solution of ufl_beam, 3"
"""The number grows whenever the meaning of files changes."""

NAMED = {
    "seconds": float, "time_error": float, "between": float, "begun": bool, "open_ledger": str,
    "warnings": str,
}  # fmt: skip
"""Attributes that are saved as they are, and their types."""

TIME_FUNCTIONS = ("time", "held", "motion", "force", "numbers")
"""Fields that are functions of time, but for the forces of controllers and functions."""


def text_of(grid: Grid, times: Array, position: Callable[[Anchor], Array]) -> dict[str, Any]:
    """Return the text for :func:`grid_of`; ``position`` gives a place at the times; (n+1, 2); m."""

    def record(owner: Any, field: str, function: Any) -> Any:
        """Return the record for a function that is a field of ``owner``."""
        if field == "curve" and isinstance(owner, Member):
            return SavedCurve.of(function, 0.0, 1.0, grid.parameters(owner))
        if field == "curve":
            return _used_curve(grid.scene, position, function)
        if field in TIME_FUNCTIONS and not isinstance(owner, Controller | ForceLaw):
            return SavedFunction.of(function, map(float, times))
        return lost(owner, field, function)

    return {
        "version": version(), "scene": to_data(grid.scene, record), "mesh": to_data(grid.mesh),
        "numbering": grid.checksum(),
    }  # fmt: skip


def grid_of(text: dict[str, Any], scene: Scene | None) -> Grid:
    """Make the grid of a saved solution, with its scene or another one of the same numbering."""
    grid = Grid(from_data(text["scene"]) if scene is None else scene, from_data(text["mesh"]))
    if grid.checksum() != text["numbering"]:
        if scene is not None:
            raise SceneError(
                "it is a solution of another scene: its beams, cells, bodies or joints are others"
            )
        raise SceneError(
            f"it was written by version {text['version']} of ufl_beam, which numbers degrees of "
            f"freedom otherwise than this one, {version()}; load it with that version"
        )
    return grid


def require_same(saved: Any, given: Any) -> None:
    """Raise :class:`SceneError` unless two scenes are the same as data, see :func:`text_of`."""
    now, then = (Description({"scene": json.loads(json.dumps(d))}).texts for d in (given, saved))
    if differs := difference(now, then):
        raise SceneError(f"it is a solution of another scene: {differs}")


def of_earlier_version(content: Content, grid: Grid) -> Content:
    """Content of the formats 1 and 2 in that of this one: names, axes, rows of material."""
    old = below("history/", content)
    q, kept = old["q"], {name: values for name, values in old.items() if len(values)}
    names = {"times": "t", "connections": "connectors", "cells": FORCES}
    new = {names.get(name, name): values for name, values in kept.items()}
    new.setdefault(FORCES, np.full((len(q), lib.CELL_NUMBERS, len(grid.cells)), np.nan))
    for k, support in enumerate(grid.scene.supports):  # reactions were in the axes of the plane
        cos, sin = np.cos(support.angle), np.sin(support.angle)
        new["reactions"][:, k, :2] @= [[cos, -sin], [sin, cos]]
    if "material" in new:  # rows began with the number of the cell
        rows = new["material"]
        order = np.argsort(rows[:, :, 0], axis=1)[:, :, None]
        new["material"] = np.take_along_axis(rows, order, 1)[:, :, 1:]
    if len(new.get(BEFORE, ())) == 1:  # each step began where the one before ended
        new[BEFORE] = np.concatenate([new[BEFORE], q[:-1]])
    others = {name: of for name, of in content.items() if not name.startswith("history/")}
    return {**others, "begun": BEFORE in new, **above("history/", new)}


def _used_curve(scene: Scene, position: Callable[[Anchor], Array], curve: Curve) -> SavedCurve:
    """The part of a guide curve that was used, a tenth more, and what tangents need."""
    used = [0.0]
    for link in scene.links:
        if isinstance(link.law, Guide) and link.law.curve is curve:
            s = 0.0
            for point in position(link.b):
                s = nearest(curve, point, s, parameter_step(curve, s, scene.size), scene.size)
                used.append(s)
    first, last = float(np.nanmin(used)), float(np.nanmax(used))
    steps = (parameter_step(curve, s, scene.size) for s in (first, last))
    more = 0.1 * (last - first) + 8 * max(steps)
    return SavedCurve.of(curve, first - more, last + more, (0.0,))
