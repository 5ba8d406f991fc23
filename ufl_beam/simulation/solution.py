# SPDX-License-Identifier: MIT
"""Solutions: motion, forces and ledger of a run."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.collective_errors import on_first
from ufl_beam.compiled.csr import Product
from ufl_beam.discretization.dof_numbering import Grid, Share
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.state_io import State
from ufl_beam.errors import SceneError
from ufl_beam.model.bodies import Anchor, Member, Place, Spot
from ufl_beam.model.connector_laws import Controller, ForceLaw, Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.curves import Curve, nearest, parameter_step
from ufl_beam.model.joints import Joint
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.output.archive import read, write
from ufl_beam.output.joint_histories import (
    Connection,
    JointHistory,
    links_of,
    motion_of,
    of_joint,
    velocity_of,
)
from ufl_beam.output.output_files import require_path
from ufl_beam.output.saved_functions import SavedCurve, SavedFunction
from ufl_beam.output.saved_scene import from_data, lost, to_data
from ufl_beam.output.state_view import StateView
from ufl_beam.parallel import ours
from ufl_beam.parameter import TIME
from ufl_beam.simulation.opened_hinges import Opened, cells_in_words, percent
from ufl_beam.terms.beams import SectionForces, mass_matrix
from ufl_beam.terms.energy_ledger import Energy
from ufl_beam.terms.inelastic_beams import Strains
from ufl_beam.version import version

LEDGER = ("state", "supplied", "lost")
"""The parts of the ledger, see :class:`~ufl_beam.terms.energy_ledger.Energy`."""


class Material(NamedTuple):
    """State of the material of all cells at one time.

    Attributes:
        forces: (N, V, M); (num_cells, 3); N, N, N m.
        jump: Rotation of the hinges; (num_cells,); rad.
        plastic: Energy dissipated by plastic strains; (num_cells,); J.
        hinge: Energy dissipated by hinges, or by the cracks of fibres; (num_cells,); J.
    """

    forces: Array
    jump: Array
    plastic: Array
    hinge: Array


KINDS: dict[str, type[Solution]] = {}
"""Classes of solutions, by name."""

TIME_FUNCTIONS = ("time", "held", "motion", "force")
"""Fields that are functions of time, but for the forces of controllers and functions."""

FORMAT = "solution of ufl_beam, 1"
"""To be counted up whenever files of before mean something else."""


class Solution:
    """Results of a run: motions and forces at the kept times; the same on every process.

    It can be saved, see :meth:`save`, and pickled, with what a file has.

    Attributes:
        scene: What was modelled.
        grid: Its vertices, cells and numbering.
        parts: Number of steps that were taken, parts of cut steps counted each.
        iterations: Number of Newton iterations.
        time_error: Sum of the errors of :class:`Adaptive` steps as they estimated them; of a part
            of the size of the scene, rad; NaN if nobody did.
        seconds: Wall time of the run, building the scene included; s.
        every: Steps from one that was kept to the next.
        parameter: Words for :attr:`times`, which are load factors in a path.
        open_ledger: How far the energy ledger is open, in words; empty if it closes as claimed.
        internal: What cells and connectors remember at the end of the run.

    Example:
        >>> print((1e3 * solution.displacement(beam.end)[-1]).round(1))  # mm, mm, mrad, at t = 1 s
        [ -0.1 -18.9 -14.3]
        >>> print(solution.section_forces(beam)[:, 2].round(-3))  # M in the cells; N m
        [-175000. -125000.  -75000.  -25000.]
        >>> print(solution.reaction(scene.supports[0])[-1, 1:].round(-4))  # N, N m
        [100000. 200000.]
    """

    parameter = TIME

    def __init__(self, scene: Scene, grid: Grid) -> None:
        self.scene, self.grid = scene, grid
        self.parts = 0
        self.iterations = 0
        self.time_error = math.nan
        self.seconds = 0.0
        self.every = 1
        self.open_ledger = ""
        self._times: list[float] = []
        self._q: list[Array] = []
        self._v: list[Array] = []
        self._reactions: list[Array] = []
        self._entries: list[tuple[dict[str, float], ...]] = []
        self._material: list[list[tuple[Index, Array]]] = []
        self._connections: list[Array] = []
        self.internal: State = {}

    def keep(self, simulation: StateView) -> None:
        """Append the state of the simulation; all processes call it together."""
        share = simulation.share
        self._times.append(simulation.t)
        self._q.append(share.gather(simulation.q))
        for v in simulation.velocities():
            self._v.append(share.gather(v))
        self._reactions.append(simulation.reactions())
        self._entries.append(simulation.entries())
        self._material.append(simulation.material())
        if self.scene.links:
            self._connections.append(simulation.connections())
        self.parts, self.iterations = simulation.parts, simulation.iterations

    def history(self) -> State:
        """All that was kept, as arrays by name."""
        history = {
            "times": self.times,
            "q": self.q,
            "v": self.v,
            "reactions": np.array(self._reactions),
            "connections": np.array(self._connections),
            "every": np.array([self.every]),
        }
        if self._material and self._material[0]:
            # Groups are those of laws and processes.
            tables = [np.concatenate([np.c_[group] for group in one]) for one in self._material]
            history["material"] = np.array([table[np.argsort(table[:, 0])] for table in tables])
        energy = self.energy
        for kind in LEDGER:
            for name, values in getattr(energy, kind).items():
                history[f"{kind}: {name}"] = values
        return history

    def resume(self, history: State) -> None:
        """Go on after what another run kept, see :meth:`history`."""
        self._times = [float(t) for t in history["times"]]
        self.every = int(history["every"][0])
        self._q, self._v = list(history["q"]), list(history["v"])
        self._reactions = list(history["reactions"])
        self._connections = list(history["connections"])
        self._material = [[] for _ in self._times]
        if "material" in history:
            for n, table in enumerate([*history["material"]]):
                self._material[n] = [(table[:, 0].astype(np.int64), table[:, 1:])]
        entries: list[dict[str, Array]] = [
            {
                name.removeprefix(f"{kind}: "): values
                for name, values in history.items()
                if name.startswith(f"{kind}: ")
            }
            for kind in LEDGER
        ]
        self._entries = [
            tuple({name: float(values[n]) for name, values in group.items()} for group in entries)
            for n in range(len(self._times))
        ]

    # -- files ---------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write an HDF5 file, which :func:`load` reads; all processes call it together.

        It has all results and the scene with all its numbers.  Functions of a user cannot be
        saved: those of time have their values at the kept times, curves those at many points,
        others, such as controllers, their names.  Results and pictures need no more.

        Args:
            path: File; one that is there is replaced once the new one is complete.

        Raises:
            SceneError: The file cannot be written, or the scene has records of another package.
            OSError: There is no space for it.
        """
        file = require_path(path, "save")
        on_first(ours(), lambda: write(file, FORMAT, *self._content()))

    def _content(self) -> tuple[dict[str, Any], State]:
        """All that is saved: text and arrays."""
        text = {
            "kind": type(self).__name__,
            "version": version(),
            "scene": to_data(self.scene, self._sampled),
            "mesh": to_data(self.grid.mesh),
            "numbering": self.grid.checksum(),
            "seconds": self.seconds,
            "time_error": self.time_error,
            "open_ledger": self.open_ledger,
        }
        return text, self._arrays()

    def _arrays(self) -> State:
        counts = {"counts": np.array([self.parts, self.iterations])}
        history = {f"history/{name}": values for name, values in self.history().items()}
        internal = {f"internal/{name}": values for name, values in self.internal.items()}
        return {**counts, **history, **internal}

    def _take(self, text: dict[str, Any], arrays: State) -> None:
        """Take over what :meth:`_content` gave."""

        def below(prefix: str) -> State:
            found = ((name, values) for name, values in arrays.items() if name.startswith(prefix))
            return {name.removeprefix(prefix): values for name, values in found}

        self.resume(below("history/"))
        self.internal = below("internal/")
        self.parts, self.iterations = (int(n) for n in arrays["counts"])
        for name in ("seconds", "time_error", "open_ledger"):
            setattr(self, name, text[name])

    def _sampled(self, owner: Any, field: str, function: Any) -> Any:
        """Return the record that stands for a function of a user in a file."""
        if field == "curve" and isinstance(owner, Member):
            return SavedCurve.of(function, 0.0, 1.0, self.grid.parameters(owner))
        if field == "curve":
            return self._used_curve(function)
        if field in TIME_FUNCTIONS and not isinstance(owner, Controller | ForceLaw):
            return SavedFunction.of(function, self._times)
        return lost(owner, field, function)

    def _used_curve(self, curve: Curve) -> SavedCurve:
        """The part of a guide curve that was used, a tenth more, and what tangents need."""
        used = [0.0]
        for link in self.scene.links:
            if isinstance(link.law, Guide) and link.law.curve is curve:
                s = 0.0
                for point in self.position(link.b):
                    step = parameter_step(curve, s, self.scene.size)
                    s = nearest(curve, point, s, step, self.scene.size)
                    used.append(s)
        first, last = float(np.nanmin(used)), float(np.nanmax(used))
        steps = (parameter_step(curve, s, self.scene.size) for s in (first, last))
        more = 0.1 * (last - first) + 8 * max(steps)
        return SavedCurve.of(curve, first - more, last + more, (0.0,))

    def __reduce__(self) -> tuple[Any, ...]:
        return restored, self._content()

    def __init_subclass__(cls) -> None:
        KINDS[cls.__name__] = cls

    def __len__(self) -> int:
        """Number of kept states."""
        return len(self._times)

    def thin(self) -> None:
        """Forget every other kept state; the first one stays."""
        for kept in (
            *(self._times, self._q, self._v, self._reactions),
            *(self._entries, self._material, self._connections),
        ):
            del kept[1::2]

    # -- motion --------------------------------------------------------------------------------

    @property
    def times(self) -> Array:
        """Times that were kept, n after the initial one; (n+1,); s."""
        return np.array(self._times)

    @property
    def progress(self) -> Array:
        """Abscissa that grows along the kept states; here the time; (n+1,)."""
        return self.times

    @property
    def q(self) -> Array:
        """Configurations, all degrees of freedom in the order of the grid; (n+1, size)."""
        return np.array(self._q)

    @property
    def v(self) -> Array:
        """Velocities, as :attr:`q`; empty in statics."""
        return np.array(self._v)

    def displacement(self, place: Anchor) -> Array:
        """Displacement and rotation (u, v, ψ) of a place; (n+1, 3); m, m, rad.

        Interpolated in cells with their degree; of points of bodies exact.

        Raises:
            SceneError: The beam of the place is not in the scene.
        """
        return motion_of(self.grid, place, self._q)

    def velocity(self, place: Anchor) -> Array:
        """Velocity (du/dt, dv/dt, dψ/dt) of a place; (n+1, 3); m/s, m/s, rad/s.

        Raises:
            SceneError: The run was static, or the beam of the place is not in the scene.
        """
        if not self._v:
            raise SceneError("velocity: the run was static; there is none")
        return velocity_of(self.grid, place, self._q, self._v)

    def position(self, place: Anchor) -> Array:
        """Coordinates of a place; (n+1, 2); m."""
        if isinstance(place, Spot):
            return np.asarray(place.point + self.displacement(place)[:, :2])
        nodes, weights = self.grid.weights(place)
        return np.asarray(weights @ self.grid.points[nodes] + self.displacement(place)[:, :2])

    # -- joints --------------------------------------------------------------------------------

    def connector(self, connector: Connector) -> Connection:
        """Relative motion, force and work of a connector.

        Raises:
            SceneError: It is not in the scene.
        """
        (number,) = links_of(self.scene, connector)
        return Connection(*np.array(self._connections)[:, number].T)

    def joint(self, joint: Joint) -> JointHistory:
        """Return the relative motion and the forces of the first two places of a joint.

        Raises:
            SceneError: It is not in the scene.
        """
        forces = np.array(self._connections)[..., 1] if self._connections else np.zeros((0, 0))
        return of_joint(self, joint, forces)

    def shape(self, beam: Member, n: int = -1) -> Array:
        """Coordinates of the vertices of a beam at the n-th kept time; (num_vertices, 2); m."""
        vertices = self.grid.vertices_of(beam)
        return np.asarray(self.grid.points[vertices] + self._q[n][self.grid.dofs[vertices, :2]])

    # -- forces --------------------------------------------------------------------------------

    def reaction(self, support: Support) -> Array:
        """Force and moment of a support on the scene; (n+1, 3); N, N, N m.

        In statics the first row is what the initial state bears: nothing where the run begins with
        the undeformed scene, for loads act from the first step on; and the reactions of that
        equilibrium where it begins with ``start=``.

        In dynamics they are those that act during the step that ends at each time; the first row is
        NaN, for no step came before.

        Raises:
            SceneError: The support is not in the scene.
        """
        if support not in self.scene.supports:
            raise SceneError(f"reaction: {support} is not in the scene")
        return np.array(self._reactions)[:, self.scene.supports.index(support)]

    @cached_property
    def _fields(self) -> Fields:
        """The whole scene on this process: what is computed afterwards needs no communication."""
        return Fields(Share(self.grid, MPI.COMM_SELF))

    @cached_property
    def _section_forces(self) -> SectionForces:
        return SectionForces(self._fields)

    def _forces(self, n: int) -> Array:
        """(N, V, M) of all cells: kept where history decides, else computed from the motion."""
        forces = np.empty((len(self.grid.cells), 3))
        self._section_forces.write(self._q[n], forces)
        for cells, rows in self._material[n]:
            forces[cells] = rows[:, :3]
        return forces

    def section_forces(self, beam: Member, n: int = -1) -> Array:
        """(N, V, M) in the cells of a beam at the n-th kept time; (num_cells, 3); N, N, N m."""
        cells = self.grid.cells_of(beam)
        return self._forces(n)[cells]

    def section_forces_at(self, place: Place) -> Array:
        """(N, V, M) in the cell at a place; (n+1, 3); N, N, N m.

        At a vertex it is the cell before it, at the start of a beam the first one.

        Raises:
            SceneError: The beam of the place is not in the scene.
        """
        cell = self.grid.cell(place)
        return np.array([self._forces(n)[cell] for n in range(len(self._q))])

    # -- material ------------------------------------------------------------------------------

    @cached_property
    def _strains(self) -> Strains:
        return Strains(self._fields)

    def strains(self, beam: Member, n: int = -1) -> Array:
        """(Σ, Γ, K) in the cells of a beam at the n-th kept time; (num_cells, 3); 1, 1, 1/m.

        The curvature includes the jump of a hinge over the length of its cell.
        """
        return self._all_strains(n)[self.grid.cells_of(beam)]

    def strains_at(self, place: Place) -> Array:
        """(Σ, Γ, K) in the cell at a place, as :meth:`section_forces_at`; (n+1, 3); 1, 1, 1/m."""
        cell = self.grid.cell(place)
        return np.array([self._all_strains(n)[cell] for n in range(len(self._q))])

    def _all_strains(self, n: int) -> Array:
        strains = np.empty((len(self.grid.cells), 3))
        strains[self._fields.order] = self._strains.mean(self._q[n])
        return strains

    def material(self, beam: Member, n: int = -1) -> Material:
        """Forces, jumps and dissipated energies in the cells of a beam at the n-th kept time.

        Raises:
            SceneError: The scene is elastic.
        """
        return self._of_material(n, self.grid.cells_of(beam))

    def material_at(self, place: Place) -> Material:
        """The same in the cell at a place at all kept times; the arrays begin with (n+1,).

        Where a plastic hinge is at the place, M, the jump and the energy are those of the hinge; M
        is the moment during the step that ends at each time.

        Raises:
            SceneError: The scene is elastic, or the beam of the place is not in it.
        """
        cell = self.grid.cell(place)
        kept = [self._of_material(n, cell) for n in range(len(self._times))]
        forces, jump, plastic, energy = (np.array(field) for field in zip(*kept, strict=True))
        hinge = self.grid.hinge_at(place)
        if hinge is not None:
            of_hinge = self.connector(hinge)
            forces[:, 2], jump, energy = of_hinge.force, of_hinge.motion, of_hinge.dissipated
        return Material(forces, jump, plastic, energy)

    @property
    def opened(self) -> Opened:
        """The cells whose embedded hinge or cracks opened in the run."""
        return Opened(self.grid, self._material)

    def hinge_place_error(self) -> dict[Member, float]:
        """Largest part of its limit by which the place of an embedded hinge shifts it, by beam.

        A hinge of ``Section(hinge=)`` is in the middle of its cell of length h and opens where the
        moment there reaches the limit; at the ends of the cell the moment differs by |V| h/2.  The
        number is |V| h / (2 limit), V being that of the last kept time before the opening.  Beams
        without embedded hinges that opened in the run are left out.
        """
        return {one.beam: one.error for one in self.opened.hinges()}

    def _of_material(self, n: int, cells: Index | int) -> Material:
        if not self._material[n] and not self.scene.hinges:
            raise SceneError("material: nothing in the scene yields or breaks; it is elastic")
        everything = np.zeros((len(self.grid.cells), 6))
        everything[:, :3] = self._forces(n)
        for inelastic, rows in self._material[n]:
            everything[inelastic, 3:] = rows[:, 3:]
        chosen = everything[cells].T
        return Material(chosen[:3].T, *chosen[3:])

    # -- balances ------------------------------------------------------------------------------

    @property
    def energy(self) -> Energy:
        """Energy ledger of the run."""
        groups = []
        for group in range(3):
            names = dict.fromkeys(name for entries in self._entries for name in entries[group])
            groups.append(
                {n: np.array([e[group].get(n, 0.0) for e in self._entries]) for n in names}
            )
        return Energy(*groups)

    def momentum(self) -> Array:
        """(p_x, p_y, L), L about the origin; (n+1, 3); N s, N s, N m s.

        Raises:
            SceneError: The run was static.
        """
        if not self._v:
            raise SceneError("momentum: the run was static; there is none")
        times = Product(mass_matrix(self._fields))
        dofs = np.vstack([self.grid.dofs, self.grid.dofs_of_bodies])
        centers = np.array([body.center for body in self.scene.movers]).reshape(-1, 2)
        _, first = np.unique(dofs[:, 0], return_index=True)
        u, v, ψ = dofs[first, 0], dofs[first, 1], np.unique(dofs[:, 2])
        X, Y = np.vstack([self.grid.points, centers])[first].T

        def of(q: Array, velocity: Array) -> tuple[float, float, float]:
            p = times(velocity)
            turning = (X + q[u]) * p[v] - (Y + q[v]) * p[u]
            return p[u].sum(), p[v].sum(), turning.sum() + p[ψ].sum()

        return np.array([of(q, velocity) for q, velocity in zip(self._q, self._v, strict=True)])

    def __str__(self) -> str:
        scene = self.scene
        counts = {
            "beam": len(scene.beams), "cell": len(self.grid.cells),
            "bod": len(scene.bodies), "link": len(scene.links),
        }  # fmt: skip
        span = f"{self._times[0]:g} to {self._times[-1]:g}"
        endings = {"bod": ("y", "ies")}
        parts = [
            f"{n} {name}{endings.get(name, ('', 's'))[n != 1]}" for name, n in counts.items() if n
        ]
        return (
            f"{', '.join(parts)}, {self.grid.size} degrees of freedom\n"
            f"{self.parameter.value.format(span)} in {self.parts} steps, "
            f"{self.iterations / max(self.parts, 1):.2f} Newton iterations each, "
            f"{self.seconds:.2f} s of wall time\n{self._about_hinges()}{self.energy}"
            + (f"\n{self.open_ledger}" if self.open_ledger else "")
        )

    def _about_hinges(self) -> str:
        """A line about embedded hinges that opened, if there are any."""
        hinges = self.opened.hinges()
        if not hinges:
            return ""
        number, worst = sum(one.number for one in hinges), max(hinges, key=lambda one: one.error)
        return (
            f"embedded hinges opened in {cells_in_words(number)}; their place within the cell "
            f"shifts the limit by at most {percent(worst.error)} ({worst.beam.name}, cell at "
            f"s = {worst.place.s:.3g})\n"
        )


KINDS["Solution"] = Solution


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
    text, arrays = read(file, FORMAT)
    try:
        return restored(text, arrays)
    except SceneError as error:
        raise SceneError(f"solution {file}: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise SceneError(f"solution {file}: the file is damaged: {error!r}") from None


def restored(text: dict[str, Any], arrays: State) -> Solution:
    """Make a solution from what was saved of it."""
    grid = Grid(from_data(text["scene"]), from_data(text["mesh"]))
    if grid.checksum() != text["numbering"]:
        raise SceneError(
            f"it was written by version {text['version']} of ufl_beam, which numbers degrees of "
            f"freedom otherwise than this one, {version()}; load it with that version"
        )
    solution = KINDS[text["kind"]](grid.scene, grid)
    solution._take(text, arrays)
    return solution
