# SPDX-License-Identifier: MIT
"""Reading of saved solutions."""

from __future__ import annotations

from pathlib import Path

from ufl_beam.errors import require_kind
from ufl_beam.model.scene import Scene
from ufl_beam.output.archive import decoding, read
from ufl_beam.output.output_files import require_path
from ufl_beam.simulation.solution import Solution, restored
from ufl_beam.simulation.solution_files import FORMAT


def load(path: str | Path, *, scene: Scene | None = None) -> Solution:
    """Read a solution that :meth:`Solution.save` wrote.

    Its places are those of its own scene: ``loaded.displacement(loaded.scene["left"].end)``.

    Args:
        path: File.
        scene: The scene of the run, built by the script: the solution has this one then, with its
            functions and with laws of your own, which files do not contain.  All numbers, classes
            and names must be those of the file, and functions of time must have the same values.

    Raises:
        SceneError: There is no such file, or it holds no solution, or is damaged, or is of a
            version that numbers degrees of freedom otherwise, or of another scene; or it has laws
            of a user, and no scene is given.

    Example:
        >>> solution.save("beam.h5")
        >>> loaded = ub.load("beam.h5")
        >>> bool((loaded.q == solution.q).all())
        True
    """
    file = require_path(path, "load")
    if scene is not None:
        require_kind(scene, Scene, "load: scene")
    with decoding(file, FORMAT):
        return restored(read(file, FORMAT), scene)
