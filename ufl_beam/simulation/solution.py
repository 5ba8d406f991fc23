# SPDX-License-Identifier: MIT
"""Solutions: motion, forces and ledger of a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.state_io import State
from ufl_beam.display import TIME, Rich
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.bodies import Member
from ufl_beam.model.scene import Scene
from ufl_beam.output.archive import Content, above, below, require_arrays, write
from ufl_beam.output.output_files import require_path
from ufl_beam.output.saved_scene import require_no_code
from ufl_beam.output.states import States
from ufl_beam.parallel import active_comm, on_first
from ufl_beam.simulation.opened_hinges import Opened
from ufl_beam.simulation.solution_files import (
    FORMAT,
    NAMED,
    grid_of,
    of_earlier_version,
    require_same,
    text_of,
)

UNKNOWN = -2
"""Number of parts up to a state that no step goes on from."""


class Solution(States, Rich):
    """Results of a run: motions and forces at the kept times; the same on every process.

    It can be saved, see :meth:`save`, and pickled, with what a file has.

    Attributes:
        scene: Model.
        grid: Its vertices, cells and numbering.
        parts: Number of steps that were taken, parts of cut steps counted each.
        iterations: Number of Newton iterations.
        time_error: Sum of the estimated errors of :class:`Adaptive` steps, relative to the size of
            the scene, or in rad; NaN with equal steps.
        seconds: Wall time of the run, building the scene included; s.
        building: Wall time of building the scene in :func:`simulate`, which is not saved; s.
        every: Steps from one that was kept to the next.
        parameter: Words for :attr:`times`, which are load factors in a path.
        open_ledger: How far the energy ledger is open, in words; empty if it closes as claimed.
        warnings: What the run has warned of, a line each; see docs/warnings.md.
        internal: Internal variables of cells and connectors at the end of the run.
        scheme: Of the run; None if the solution was loaded.
        parts_of_last: Number of parts up to the last state; :data:`UNKNOWN` if it is not here.

    Example:
        >>> print((1e3 * solution.displacement(beam.end)[-1]).round(1))  # mm, mm, mrad, at t = 1 s
        [ -0.1 -18.9 -14.3]
        >>> print(solution.section_forces(beam)[:, 2].round(-3))  # M in the cells; N m
        [-171000. -122000.  -73000.  -24000.]
        >>> print(solution.reaction(scene.supports[0])[-1, 1:].round(-4))  # N, N m
        [100000. 200000.]
    """

    parameter = TIME

    def __init__(self, scene: Scene, grid: Grid) -> None:
        super().__init__(grid)
        self.scene = scene
        self.parts = self.iterations = 0
        self.time_error, self.seconds, self.building = math.nan, 0.0, 0.0
        self.every, self.open_ledger, self.warnings = 1, "", ""
        self.internal: State = {}
        self.scheme: Scheme | None = None
        self.parts_of_last = UNKNOWN

    def count(self, parts: int, iterations: int) -> None:
        """Take note of what was done up to the last state."""
        self.parts, self.iterations, self.parts_of_last = parts, iterations, parts

    def thin(self) -> None:
        """Forget every other state; the first one stays."""
        self.parts_of_last = self.parts_of_last if len(self) % 2 else UNKNOWN
        super().thin()

    def history(self) -> State:
        """Return all states, as arrays by name."""
        return {**super().history(), "every": np.array([self.every])}

    def resume(self, history: State) -> None:
        """Go on after what another run kept, see :meth:`history`."""
        super().resume(history)
        self.every, self.parts_of_last = int(history["every"][0]), UNKNOWN

    # -- files ---------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write a file with a checksum, which :func:`load` reads; all processes call it together.

        It has all results and the numbers of the scene, but no code: functions of time are saved
        as values at the kept times, curves as points, other functions and laws of a user by name.
        A file that is there is replaced once the new one is complete.

        Raises:
            SceneError: The file cannot be written, or an object of the scene is no dataclass.
            OSError: There is no space for it.
        """
        file = require_path(path, "save")
        on_first(active_comm(), lambda: write(file, FORMAT, self._content()))

    def _content(self) -> Content:
        text = {"kind": type(self).__name__, **text_of(self.grid, self.times, self.position)}
        return {**text, **{name: getattr(self, name) for name in NAMED}, **self._arrays()}

    def _arrays(self) -> State:
        counts = {"counts": np.array([self.parts, self.iterations])}
        return {**counts, **above("history/", self.history()), **above("internal/", self.internal)}

    def _take(self, content: Content) -> None:
        require_arrays(content, {"counts": (2,), "history/every": (1,)})
        if "history/times" in content:
            content = of_earlier_version(content, self.grid)
        self.resume(below("history/", content))
        self.internal = below("internal/", content)
        self.parts, self.iterations = map(int, content["counts"])
        for name, kind in NAMED.items():
            setattr(self, name, kind(content[name]))

    def __reduce__(self) -> tuple[Any, ...]:
        require_no_code((content := self._content())["scene"])
        return restored, (content,)

    @property
    def progress(self) -> Array:
        """Abscissa that grows along the kept states; here the time; (n+1,)."""
        return self.times

    @property
    def opened(self) -> Opened:
        """The cells whose embedded hinge or cracks opened in the run."""
        return Opened(self)

    def hinge_place_error(self) -> dict[Member, float]:
        """Largest part of its limit by which the place of an embedded hinge shifts it, by beam.

        A hinge of ``Section(hinge=)`` is in the middle of its cell of length h and opens where the
        moment there reaches the limit; at the ends of the cell the moment differs by ``|V| h/2``.
        The number is ``|V| h / (2 limit)``, V being that of the last kept time before the opening.
        Beams without embedded hinges that opened in the run are left out.
        """
        return {one.beam: one.error for one in self.opened.hinges()}

    def summary(self) -> list[str]:
        """Return lines on the model, the run, and embedded hinges that opened."""
        ends = " to ".join(f"{t:g}" for t in (*self.times[:1], *self.times[-1:]))
        return [
            str(self.grid),
            f"{self.parameter.value.format(ends)} in {self.parts} steps, "
            f"{self.iterations / max(self.parts, 1):.2f} Newton iterations each, "
            f"{self.seconds:.2f} s of wall time",
            *self.opened.summary(),
        ]

    def __str__(self) -> str:
        said = *self.summary(), str(self.energy), self.open_ledger, self.warnings
        return "\n".join(filter(None, said))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {'; '.join(self.summary()[:2])}>"


def restored(content: Content, scene: Scene | None = None) -> Solution:
    """Make a solution from what was saved of it, with a scene of its own or the given one."""
    grid = grid_of(content, scene)
    kinds = {kind.__name__: kind for kind in (Solution, *Solution.__subclasses__())}
    solution = kinds[content["kind"]](grid.scene, grid)
    solution._take(content)
    if scene is not None:
        require_same(content["scene"], solution._content()["scene"])
    return solution
