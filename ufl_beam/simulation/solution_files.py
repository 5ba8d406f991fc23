# SPDX-License-Identifier: MIT
"""Content of the file of a solution: text, arrays, and the scene with the functions it used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Anchor, Member
from ufl_beam.model.connector_laws import Controller, Guide
from ufl_beam.model.curves import Curve, nearest, parameter_step
from ufl_beam.model.force_laws import ForceLaw
from ufl_beam.model.scene import Scene
from ufl_beam.output.archive import above, below, read
from ufl_beam.output.saved_scene import SavedCurve, SavedFunction, from_data, lost, to_data
from ufl_beam.version import version

T = TypeVar("T")

FORMAT = "solution of ufl_beam, 1"
"""To be counted up whenever files of before mean something else."""

NAMED = ("seconds", "time_error", "open_ledger")
"""Attributes that are saved as they are."""

TIME_FUNCTIONS = ("time", "held", "motion", "force", "numbers")
"""Fields that are functions of time, but for the forces of controllers and functions."""


class Saved(Protocol):
    """A solution, as far as its file has it; the names of :data:`NAMED` are attributes too."""

    scene: Scene
    grid: Grid
    parts: int
    iterations: int
    internal: State

    @property
    def times(self) -> Array:
        """Times that were kept; s."""

    def position(self, place: Anchor) -> Array:
        """Coordinates of a place at these times; m."""

    def history(self) -> State:
        """Return all kept states, as arrays by name."""

    def resume(self, history: State) -> None:
        """Take over a :meth:`history`."""


def made_of_file(file: Path, make: Callable[[dict[str, Any], State], T]) -> T:
    """Read a file and make a solution of it; :class:`SceneError` if that cannot be."""
    text, arrays = read(file, FORMAT)
    try:
        return make(text, arrays)
    except SceneError as error:
        raise SceneError(f"solution {file}: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise SceneError(f"solution {file}: the file is damaged: {error!r}") from None


def text_of(solution: Saved) -> dict[str, Any]:
    """Return what is saved as text."""
    functions = UsedFunctions(solution.grid, [*map(float, solution.times)], solution.position)
    return {
        "kind": type(solution).__name__,
        "version": version(),
        "scene": to_data(solution.scene, functions),
        "mesh": to_data(solution.grid.mesh),
        "numbering": solution.grid.checksum(),
        **{name: getattr(solution, name) for name in NAMED},
    }


def arrays_of(solution: Saved) -> State:
    """Return what is saved as arrays."""
    counts = {"counts": np.array([solution.parts, solution.iterations])}
    history = above("history/", solution.history())
    return {**counts, **history, **above("internal/", solution.internal)}


def take(solution: Saved, text: dict[str, Any], arrays: State) -> None:
    """Take over :func:`text_of` and :func:`arrays_of`."""
    solution.resume(below("history/", arrays))
    solution.internal = below("internal/", arrays)
    solution.parts, solution.iterations = (int(n) for n in arrays["counts"])
    for name in NAMED:
        setattr(solution, name, text[name])


def grid_of(text: dict[str, Any]) -> Grid:
    """Make the grid of a saved solution, with its scene."""
    grid = Grid(from_data(text["scene"]), from_data(text["mesh"]))
    if grid.checksum() != text["numbering"]:
        raise SceneError(
            f"it was written by version {text['version']} of ufl_beam, which numbers degrees of "
            f"freedom otherwise than this one, {version()}; load it with that version"
        )
    return grid


class UsedFunctions:
    """Replaces functions of a scene by records, see :func:`to_data`."""

    def __init__(
        self, grid: Grid, times: Sequence[float], position: Callable[[Anchor], Array]
    ) -> None:
        self._grid, self._times, self._position = grid, times, position

    def __call__(self, owner: Any, field: str, function: Any) -> Any:
        """Return the record for a function that is a field of ``owner``."""
        if field == "curve" and isinstance(owner, Member):
            return SavedCurve.of(function, 0.0, 1.0, self._grid.parameters(owner))
        if field == "curve":
            return self._used_curve(function)
        if field in TIME_FUNCTIONS and not isinstance(owner, Controller | ForceLaw):
            return SavedFunction.of(function, self._times)
        return lost(owner, field, function)

    def _used_curve(self, curve: Curve) -> SavedCurve:
        """The part of a guide curve that was used, a tenth more, and what tangents need."""
        used, scene = [0.0], self._grid.scene
        for link in scene.links:
            if isinstance(link.law, Guide) and link.law.curve is curve:
                s = 0.0
                for point in self._position(link.b):
                    step = parameter_step(curve, s, scene.size)
                    s = nearest(curve, point, s, step, scene.size)
                    used.append(s)
        first, last = float(np.nanmin(used)), float(np.nanmax(used))
        steps = (parameter_step(curve, s, scene.size) for s in (first, last))
        more = 0.1 * (last - first) + 8 * max(steps)
        return SavedCurve.of(curve, first - more, last + more, (0.0,))
