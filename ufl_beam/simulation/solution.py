# SPDX-License-Identifier: MIT
"""Solutions: motion, forces and ledger of a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Later, Snapshots
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.state_io import State
from ufl_beam.display import TIME, Rich
from ufl_beam.errors import SceneError, require_number
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.bodies import Anchor, Member, Place
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.output.archive import Content, above, below, require_arrays, write
from ufl_beam.output.joint_histories import (
    Connection,
    JointHistory,
    connection,
    links_of,
    motion_of,
    of_joint,
    position_of,
    velocity_of,
)
from ufl_beam.output.output_files import require_path
from ufl_beam.output.saved_scene import require_no_code
from ufl_beam.parallel import active_comm, on_first
from ufl_beam.simulation.force_diagrams import Diagram
from ufl_beam.simulation.kept_states import KeptStates, Material
from ufl_beam.simulation.opened_hinges import Opened
from ufl_beam.simulation.solution_files import FORMAT, NAMED, grid_of, require_same, text_of
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.energy_ledger import Energy
from ufl_beam.terms.links import FORCE


class Solution(Rich):
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
        between: Part of a step at whose configuration its forces are in equilibrium.
        scheme: Of the run; None if the solution was loaded.

    Example:
        >>> print((1e3 * solution.displacement(beam.end)[-1]).round(1))  # mm, mm, mrad, at t = 1 s
        [ -0.1 -18.9 -14.3]
        >>> print(solution.section_forces(beam)[:, 2].round(-3))  # M in the cells; N m
        [-171000. -122000.  -73000.  -24000.]
        >>> print(solution.reaction(scene.supports[0])[-1, 1:].round(-4))  # N, N m
        [100000. 200000.]
    """

    parameter = TIME
    scheme: Scheme | None

    def __init__(self, scene: Scene, grid: Grid) -> None:
        self.scene, self.grid = scene, grid
        self.parts = self.iterations = 0
        self.time_error, self.seconds, self.building = math.nan, 0.0, 0.0
        self.every, self.open_ledger, self.warnings = 1, "", ""
        self.internal: State = {}
        self.between, self.scheme = 1.0, None
        self._kept = KeptStates(grid)

    def keep(self, states: Snapshots | Later, parts: int, iterations: int) -> None:
        """Append states of a run, up to the last of which so many were done."""
        self._kept.append(states)
        self.parts, self.iterations = parts, iterations

    def history(self) -> State:
        """Return all kept states, as arrays by name."""
        return {**self._kept.arrays(), "every": np.array([self.every])}

    def resume(self, history: State) -> None:
        """Go on after what another run kept, see :meth:`history`."""
        self._kept.take(history)
        self.every = int(history["every"][0])

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
        self.resume(below("history/", content))
        self.internal = below("internal/", content)
        self.parts, self.iterations = map(int, content["counts"])
        for name, kind in NAMED.items():
            setattr(self, name, kind(content[name]))

    def __reduce__(self) -> tuple[Any, ...]:
        require_no_code((content := self._content())["scene"])
        return restored, (content,)

    def __len__(self) -> int:
        """Number of kept states."""
        return len(self._kept)

    def part(self, first: int, last: int) -> KeptStates:
        """Views of kept states, from the first number to before the last one."""
        return self._kept.part(first, last)

    def thin(self) -> None:
        """Forget every other kept state; the first one stays."""
        self._kept.thin()

    # -- motion --------------------------------------------------------------------------------

    @property
    def times(self) -> Array:
        """Times that were kept, n after the initial one; (n+1,); s."""
        return self._kept.times

    @property
    def progress(self) -> Array:
        """Abscissa that grows along the kept states; here the time; (n+1,)."""
        return self.times

    @property
    def q(self) -> Array:
        """Configurations, all degrees of freedom in the order of the grid; (n+1, size)."""
        return self._kept.q[:,]

    @property
    def v(self) -> Array:
        """Velocities, as :attr:`q`; empty in statics."""
        return self._kept.v[:,]

    def displacement(self, place: Anchor) -> Array:
        """Displacement and rotation (u, v, ψ) of a place; (n+1, 3); m, m, rad.

        Interpolated in cells with their degree; of points of bodies exact.

        Raises:
            SceneError: The beam of the place is not in the scene.
        """
        return motion_of(self.grid, place, self._kept.q)

    def velocity(self, place: Anchor) -> Array:
        """Velocity (du/dt, dv/dt, dψ/dt) of a place; (n+1, 3); m/s, m/s, rad/s.

        Raises:
            SceneError: The run was static, or the beam of the place is not in the scene.
        """
        if not len(self._kept.v):
            raise SceneError("velocity: the run was static; there is none")
        return velocity_of(self.grid, place, self._kept.q, self._kept.v)

    def position(self, place: Anchor) -> Array:
        """Coordinates of a place; (n+1, 2); m."""
        return position_of(self.grid, place, self._kept.q)

    # -- joints --------------------------------------------------------------------------------

    def connector(self, connector: Connector) -> Connection:
        """Relative motion, force and work of a connector.

        Raises:
            SceneError: It is not in the scene.
        """
        return connection(self._kept.connections[:, links_of(self.scene, connector)])

    def joint(self, joint: Joint) -> JointHistory:
        """Return the relative motion and the forces of the first two places of a joint.

        Raises:
            SceneError: It is not in the scene.
        """
        return of_joint(self.grid, joint, self._kept.q, self._kept.connections[:, :, FORCE])

    def shape(self, beam: Member, n: int = -1) -> Array:
        """Coordinates of the vertices of a beam at the n-th kept time; (num_vertices, 2); m."""
        vertices, grid = self.grid.vertices_of(beam), self.grid
        return np.asarray(grid.points[vertices] + self._kept[n].q[grid.dofs[vertices, :2]])

    # -- forces --------------------------------------------------------------------------------

    def reaction(self, support: Support) -> Array:
        """Force and moment of a support on the scene; (n+1, 3); N, N, N m.

        It is that of the components of motion that the support holds.

        In statics the first row is what the initial state bears: nothing in the undeformed scene,
        for loads act from the first step on; with ``start=`` the reactions of its equilibrium.  In
        dynamics they act during the step that ends at each time; the first row is NaN.

        Raises:
            SceneError: The support is not in the scene.
        """
        if support not in self.scene.supports:
            raise SceneError(f"reaction: {support} is not in the scene")
        number = self.scene.supports.index(support)
        return self._kept.reactions[:, number]

    def section_forces(self, beam: Member, n: int = -1) -> Array:
        """(N, V, M) of :meth:`diagram` in the middle of the cells; (num_cells, 3); N, N, N m."""
        forces = self._kept.forces(n, self.between)
        return np.asarray(forces[self.grid.cells_of(beam), 0])

    def section_forces_at(self, place: Place) -> Array:
        """(N, V, M) at a place, as :meth:`diagram` has it; (n+1, 3); N, N, N m.

        At a vertex they are those at the end of the cell before it.

        Raises:
            SceneError: The beam of the place is not in the scene.
        """
        return self._kept.forces_at(place, self.between)

    def diagram(self, beam: Member, n: int = -1, *, points: int = 9) -> Diagram:
        """Section forces along a beam, by equilibrium of its cells, at the n-th kept time.

        They belong to the equation of the step that ends at that time, with inertia, damping, loads
        and works: at a support they are its :meth:`reaction`, in the axes of the section, which
        turns with the beam.  ``points`` are those of each cell,
        equally spaced, both ends included; V is linear between them under a uniform load.

        The initial state of a static run bears nothing unless it has a ``start=``.  That of a
        dynamic one has the forces of the last step of ``start=``, or those of its strains.

        Raises:
            SceneError: The beam is not in the scene, or ``points`` is less than 2.
        """
        require_number(points, "diagram: points", at_least=2)
        s, cells = self.grid.parameters(beam), self.grid.cells_of(beam)
        at = s[:-1, None] + np.linspace(0.0, 1.0, int(points)) * np.diff(s)[:, None]
        forces = self._kept.forces(n, self.between, int(points))[cells]
        return Diagram(at.ravel(), *forces.reshape(-1, 3).T)

    def find_cell_forces(self, scheme: Scheme, forces: CellForces | None) -> None:
        """Take note of the scheme, and of how forces of cells follow from what is kept."""
        self.scheme = scheme
        self._kept.of_record = None if forces is None else forces.of_record

    def last_forces(self) -> tuple[Array, Array | None]:
        """``cell_number`` of loops.h in the last step; the configuration at its beginning."""
        return self._kept.numbers(self._kept[-1]), self._kept[-1].before

    def strains(self, beam: Member, n: int = -1) -> Array:
        """(Σ, Γ, K) in the cells of a beam at the n-th kept time; (num_cells, 3); 1, 1, 1/m.

        The curvature includes the jump of a hinge over the length of its cell.
        """
        return self._kept.strains(n)[self.grid.cells_of(beam)]

    def strains_at(self, place: Place) -> Array:
        """(Σ, Γ, K) in the cell at a place, as :meth:`section_forces_at`; (n+1, 3); 1, 1, 1/m."""
        return self._kept.at(place, self._kept.strains)

    def material(self, beam: Member, n: int = -1) -> Material:
        """Forces, jumps and dissipated energies in the cells of a beam at the n-th kept time.

        Raises:
            SceneError: The scene is elastic.
        """
        return self._kept.material(n, self.grid.cells_of(beam), self.between)

    def material_at(self, place: Place) -> Material:
        """Material states in the cell at a place at all kept times; arrays begin with (n+1,).

        Where a plastic hinge is at the place, ``forces[:, 2]``, ``jump`` and ``hinge`` are its
        moment during the step that ends at each time, its rotation and the energy that it has
        dissipated.  The other forces are those in the middle of the cell.

        Raises:
            SceneError: The scene is elastic, or the beam of the place is not in it.
        """
        forces, jump, plastic, energy = self._kept.material_at(place, self.between)
        hinge = self.grid.hinge_at(place)
        if hinge is not None:
            of_hinge = self.connector(hinge)
            forces[:, 2], jump, energy = of_hinge.force, of_hinge.motion, of_hinge.dissipated
        return Material(forces, jump, plastic, energy)

    @property
    def opened(self) -> Opened:
        """The cells whose embedded hinge or cracks opened in the run."""
        return Opened(self.grid, self._kept.materials)

    def hinge_place_error(self) -> dict[Member, float]:
        """Largest part of its limit by which the place of an embedded hinge shifts it, by beam.

        A hinge of ``Section(hinge=)`` is in the middle of its cell of length h and opens where the
        moment there reaches the limit; at the ends of the cell the moment differs by ``|V| h/2``.
        The number is ``|V| h / (2 limit)``, V being that of the last kept time before the opening.
        Beams without embedded hinges that opened in the run are left out.
        """
        return {one.beam: one.error for one in self.opened.hinges()}

    # -- balances ------------------------------------------------------------------------------

    @property
    def energy(self) -> Energy:
        """Energy ledger of the run."""
        return Energy(*self._kept.ledger())

    def momentum(self) -> Array:
        """(p_x, p_y, L), L about the origin; (n+1, 3); N s, N s, N m s.

        Raises:
            SceneError: The run was static.
        """
        return self._kept.momentum()

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
