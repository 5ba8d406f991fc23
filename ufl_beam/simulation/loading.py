# SPDX-License-Identifier: MIT
"""Reading of saved solutions."""

from __future__ import annotations

from pathlib import Path

from ufl_beam.output.archive import decoding, read
from ufl_beam.output.output_files import require_path
from ufl_beam.simulation.solution import Solution, restored
from ufl_beam.simulation.solution_files import FORMAT


def load(path: str | Path) -> Solution:
    """Read a solution that :meth:`Solution.save` wrote.

    Its places are those of its own scene: ``loaded.displacement(loaded.scene["left"].end)``.

    Raises:
        SceneError: There is no such file, or it holds no solution, or is damaged, or is of a
            version that numbers degrees of freedom otherwise.

    Example:
        >>> solution.save("beam.h5")
        >>> loaded = ub.load("beam.h5")
        >>> bool((loaded.q == solution.q).all())
        True
    """
    file = require_path(path, "load")
    with decoding(file, FORMAT):
        return restored(read(file, FORMAT))
