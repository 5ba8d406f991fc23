# SPDX-License-Identifier: MIT
"""Vibration modes with natural frequencies and damping ratios, and buckling loads and modes."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_beam.analysis.constant_loads import AT, duration
from ufl_beam.analysis.small_motions import SmallMotions
from ufl_beam.arrays import Array, Complex
from ufl_beam.blocks.beams import section_law
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.cell_functions import strains_of, stress_forces
from ufl_beam.discretization.cells_in_space import (
    STIFFNESS_IN_SPACE,
    TURNS,
    CellsOfState,
    cell_axes,
    turned_further,
    velocity_at,
)
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.model_warnings import warn_of_masses
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.display import Rich
from ufl_beam.errors import (
    ArgumentError,
    each_warning_once,
    require_count,
    require_kind,
    require_number,
    warn,
)
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import GROUND, AttachmentPoint
from ufl_beam.model.constraint_checks import require_no_mechanism, require_no_prestress
from ufl_beam.model.loads import Load, RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.model.works import Effect, VirtualWork
from ufl_beam.output.paraview_files import VTKHDF, XDMF
from ufl_beam.output.state_rows import FORCES, Connection
from ufl_beam.parallel import active_comm, on_first
from ufl_beam.simulation.initial_state import StateOf, chosen_state, mesh_of
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.terms.cell_forces import CellForces
from ufl_beam.terms.term import InCells

LARGEST_ERROR = 0.1
"""Largest estimated error of a buckling factor without a warning.  The estimate is below 0.02 in
frames under forces at their nodes, and 0.1 to 0.7 where loads along beams bend them first."""

SPIN = 0.1  # mean rate of turning that is an error, as a fraction of the first frequency
MOST_TITLES = 4  # largest number of modes in a one-line text
AMPLITUDE = 0.1  # largest displacement of a mode in pictures, as a fraction of the scene's size


@dataclass(frozen=True, eq=False)
class Shapes(Rich, ABC):
    """Vibration or buckling modes about a state; the same on every process.

    Attributes:
        scene: Model.
        numbering: Vertices, cells and degrees of freedom of the scene.
        q: Configuration of the state of the modes, ordered by ``numbering``; (size,).
        turns: Rotations of the nodes in the state, in space, as quaternions minus 1; (nodes, 4).
        shapes: Modes, in columns; (size, n); complex if phases differ.  The largest displacement is
            1; in a mode without displacements, the largest rotation is 1.
        section_law: b and D of the section forces b + D e of cells for strains e, at p integration
            points; (num_cells, 3 p), (num_cells, 9 p), or in space (num_cells, 6), (num_cells, 36).
        resultants: Resultants of the cells in the state, ``cell_number`` of loops.h; zero in an
            unloaded scene; (9, num_cells).
    """

    scene: Scene
    numbering: DofNumbering
    q: Array
    turns: Array
    shapes: Array | Complex
    section_law: tuple[Array, Array]
    resultants: Array

    word = "shape"

    @property
    @abstractmethod
    def titles(self) -> list[str]:
        """Captions of the modes in plots."""

    def __str__(self) -> str:
        return "\n".join(f"{self.word} {k}: {title}" for k, title in enumerate(self.titles))

    def __repr__(self) -> str:
        titles = self.titles[:MOST_TITLES] + ["..."] * (len(self) > MOST_TITLES)
        return f"<{type(self).__name__}: {'; '.join(titles)}>"

    def __len__(self) -> int:
        return int(self.shapes.shape[1])

    def shape(self, k: int, place: AttachmentPoint) -> Array | Complex:
        """Return the motion (u, v, ψ) of a place in the k-th mode; (3,).

        In space, return the displacement, and the rotation about axes of the node; (6,).

        Raises:
            ArgumentError: There is no such mode, or the place is not in the scene.
        """
        self._require(k)
        shape: Any = self.shapes[:, k]
        state = self.turns if self.scene.in_space else self.q
        return np.asarray(velocity_at(self.numbering, place, shape[None], state[None])[0])

    def motion(self, k: int, *, amplitude: float = AMPLITUDE, count: int = 24) -> Solution:
        """Return one period of the k-th mode as a solution, for :func:`animate` or :func:`plot`.

        Section forces are the forces of the state plus changes of the stresses.  The loads of the
        state stay constant, and the mode has no inertia forces.

        Args:
            k: Index of the mode.
            amplitude: Largest displacement, as a fraction of the size of the scene.
            count: Number of equal intervals of the period; times go from 0 to 1.

        Raises:
            ArgumentError: There is no such mode, or a number is not positive.
        """
        self._require(k)
        require_number(amplitude, "motion: amplitude", positive=True)
        require_count(count, "motion: count")
        times = np.arange(count + 1) / count
        swing = np.outer(np.exp(2j * math.pi * times), self._scaled(k, amplitude)).real
        forces: Array = np.zeros((count + 1, *self.resultants.shape))
        if not self.scene.in_space:
            subdomain = Subdomain(self.numbering, MPI.COMM_SELF)
            fields, r = Fields(subdomain), np.zeros(subdomain.size)
            form = stress_forces(fields, self.section_law)
            cell_forces = CellForces(subdomain, [InCells(lambda: form, lib.STRESS, fields.order)])
            stresses = []
            for q in (self.q, *np.ascontiguousarray(self.q + swing)):
                form.add(q, r)
                cell_forces.accept()
                stresses.append(cell_forces(q, q))
            forces[:] = self.resultants + np.array(stresses[1:]) - stresses[0]
        return self._states(times, swing, forces)

    def _states(self, times: Array, changes: Any, forces: Array) -> Solution:
        """Return states with changes of the configuration, (n, size), and forces of cells."""
        history = {"t": times, "q": self.q + changes, "every": np.array([1])}
        if self.scene.in_space:
            further = [turned_further(self.numbering, self.turns, change) for change in changes]
            history[TURNS] = np.array(further)
        solution = Solution(self.scene, self.numbering)
        solution.resume(history | {FORCES: forces})
        return solution

    def write(self, path: str | Path, *, amplitude: float = AMPLITUDE) -> None:
        """Write a time series for PyVista or ParaView, in which the time k shows the k-th mode.

        Displacements are the sum of the state and the mode.  N, V and M belong to the mode alone.

        Args:
            path: File, ending in ``.hdf`` or ``.xdmf``, see :class:`VTKHDF`, :class:`XDMF`.
            amplitude: Largest displacement, as a fraction of the size of the scene.

        Raises:
            ArgumentError: The file cannot be written, or there is no mode.
        """
        require_number(amplitude, "write: amplitude", positive=True)
        self._require(0)
        recorder = VTKHDF(path) if Path(path).suffix in VTKHDF.endings else XDMF(path)

        def write() -> None:
            recorder.require_writable()
            subdomain = Subdomain(self.numbering, MPI.COMM_SELF)
            changes = (self._scaled(k, amplitude).real for k in range(len(self)))
            first, *others = (_Frame(self, subdomain, float(k), x) for k, x in enumerate(changes))
            with closing(recorder):
                recorder.open(first)  # type: ignore[arg-type]
                for frame in others:
                    recorder.write(frame)  # type: ignore[arg-type]

        on_first(active_comm(), write)

    def _scaled(self, k: int, amplitude: float) -> Array | Complex:
        """Scale a mode so that its largest displacement is ``amplitude`` times the scene's size.

        If the mode has rotations only, the largest rotation is ``amplitude`` in rad.
        """
        shape = self.shapes[:, k]
        lengths = np.r_[self.numbering.dofs, self.numbering.dofs_of_bodies]
        lengths = lengths[:, : self.numbering.displacements]
        size = self.scene.size if np.abs(shape[lengths]).max() > 0.5 else 1.0
        scaled: Array | Complex = amplitude * size * shape
        return scaled

    def _require(self, k: int) -> None:
        if not -len(self) <= k < len(self):
            raise ArgumentError(f"there is no shape {k}; there are {len(self)}")


class _Frame:
    """State plus one mode, with the interface of a simulation that recorders need."""

    may_break = False

    def __init__(self, shapes: Shapes, subdomain: Subdomain, t: float, change: Array) -> None:
        self.scene, self.numbering = shapes.scene, shapes.numbering
        self.comm, self.subdomain = subdomain.comm, subdomain
        self.q, self.t = shapes.q + change, t
        self._shapes, self._fields, self._change = shapes, Fields(subdomain), change
        self.now = shapes._states(np.array([t]), change[None], shapes.resultants[None])

    def connections(self) -> Array:
        return np.zeros((len(self.scene.all_connectors), len(Connection._fields)))

    def section_forces(self) -> Array:
        """Return mean section forces of the mode alone; (num_cells, 3 or 6); N, N, N m."""
        (_, D), ε = self._shapes.section_law, 1e-5
        ends = [self._strains(sign * ε * self._change) for sign in (1.0, -1.0)]
        e = ((ends[0] - ends[1]) / (2 * ε)).reshape(len(D), -1, 6 if self.scene.in_space else 3)
        weights = self.numbering.mesh.point_weights
        D = D.reshape(*e.shape, e.shape[-1])
        return np.asarray(np.einsum("p,cpij,cpj->ci", weights, D, e))

    def _strains(self, change: Array) -> Array:
        """Return the strains after a change of the state of the modes."""
        shapes, q = self._shapes, self._shapes.q + change
        if not self.scene.in_space:
            return strains_of(self._fields)(q)
        turns = turned_further(self.numbering, shapes.turns, change)
        axes = cell_axes(self._fields)
        return CellsOfState.of(self.numbering, axes, q, turns).strains()


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Shapes):
    """Vibration modes ``x exp(s t)`` about a state; made by :func:`modes`.

    Attributes:
        exponents: s = -ζω + iω√(1-ζ²) of each mode, ``|s|`` ascending; (n,); 1/s.  A conjugate
            pair counts once, with positive imaginary part.

    Example:
        >>> shapes = ub.modes(scene, 3)
        >>> print(shapes.frequencies.round())  # Hz
        [ 42. 286. 651.]
        >>> figure = ub.plot(shapes)
    """

    exponents: Complex
    word = "mode"

    @property
    def omega(self) -> Array:
        """Natural circular frequencies ``|s|``; (n,); rad/s."""
        return np.asarray(np.abs(self.exponents))

    @property
    def frequencies(self) -> Array:
        """Natural frequencies, ascending; (n,); Hz."""
        return np.asarray(self.omega / (2 * math.pi))

    @property
    def damping(self) -> Array:
        """Damping ratios ζ = ``-Re s/|s|``; (n,).

        A motion with a negative ratio grows, a motion with ±1 does not oscillate, and no force
        opposes a motion with NaN.
        """
        ω = self.omega
        ratios: Array = np.full(len(ω), np.nan)
        np.divide(-self.exponents.real, ω, out=ratios, where=ω > 0)
        return ratios

    @property
    def titles(self) -> list[str]:
        """Frequency of each mode, and its damping ratio if there is damping."""
        return [
            f"{f:.4g} Hz" + (f", ζ = {ζ:.3g}" if abs(ζ) > 1e-6 else "")
            for f, ζ in zip(self.frequencies, self.damping, strict=True)
        ]


@dataclass(frozen=True, eq=False, repr=False)
class Buckling(Shapes):
    """Buckling modes and their load factors; made by :func:`buckling`.

    Attributes:
        factors: Load factors, ``|factor|`` ascending; negative for reversed loads; (n,).
        errors: Estimated relative errors of the factors; above 0.1 if the loads bend beams before
            they buckle; (n,).

    Example:
        >>> load = ub.PointLoad(beam.end, force=(-1e6, 0))
        >>> column = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        >>> print(ub.buckling(column, 2).factors.round(1))  # on 1 MN
        [ 8.8 95.4]
    """

    factors: Array
    errors: Array

    @property
    def titles(self) -> list[str]:
        """Factor of each mode by which the loads are multiplied."""
        return [
            f"loads × {factor:.4g}" + " (no buckling load)" * bool(error > LARGEST_ERROR)
            for factor, error in zip(self.factors, self.errors, strict=True)
        ]


@each_warning_once()
def modes(scene: Scene, n: int, *, at: StateOf | None = None, mesh: Mesh | None = None) -> Modes:
    """Compute natural frequencies, damping ratios and shapes of small vibrations.

    The vibrations are about the undeformed, unloaded scene, or about the last state of the solution
    ``at``.  Section forces, loads and a :class:`RotatingFrame` contribute to the stiffness of this
    state.  Without ``at``, a scene that can move without strain, such as a pendulum, vibrates about
    its equilibrium under its loads.  All material responds elastically, also where it has yielded,
    and hinges keep their openings; hinges that no longer carry a moment act as joints.  Sticking
    friction is a constraint; sliding friction and controllers are ignored.

    Without damping the modes solve K x = ω² M x.  With damping, Coriolis or follower forces they
    solve (K + s C + s² M) x = 0; K and C need not be symmetric.  Motions that decay
    without oscillation are modes, too.  A negative damping ratio means flutter, or buckling if the
    ratio is -1.

    Args:
        scene: Model.
        n: Number of modes, from the lowest frequency; fewer if the scene has fewer.
        at: Solution of the same beams with equal joints; vibrations are about its last state, or
            about the n-th stored state of ``(solution, n)``.
        mesh: Discretization; by default the mesh of ``at``, or the cells of the beams.

    Raises:
        ArgumentError: The call or the scene is wrong, nothing that moves has mass, the scene has a
            :class:`RotatingFrame` and ``at`` is not given, or ``at`` turns.

    Warns:
        ModelWarning: The undeformed scene is no equilibrium, some beams have no mass, a stop just
            touches, or internal variables of a law of a connector relax.

    Example:
        >>> shapes = ub.modes(scene, 3, mesh=ub.Mesh(refine=4))
        >>> print(shapes.frequencies.round(1))  # Hz
        [ 41.5 250.6 646.8]
    """
    n = require_count(n, "modes: n")
    at = require_state("modes", scene, at, mesh)
    return computed_modes(scene, n, at, mesh)


def computed_modes(
    scene: Scene, n: int, at: Solution | None, mesh: Mesh | None, *, damped: bool = True
) -> Modes:
    """Compute modes as :func:`modes`; ``damped=False`` leaves velocity-dependent forces out."""
    if at is None:
        if any(isinstance(load, RotatingFrame) for load in scene.loads):
            raise ArgumentError(
                "modes: the undeformed scene is not at rest in a RotatingFrame; give the state of "
                "steady rotation, at=simulate(scene, Static(), ...), or leave the frame out"
            )
        if scene.loads and require_no_mechanism(scene):
            undamped, t0 = replace(scene, damping=()), AT - duration(scene)
            simulation = Simulation(undamped, Static(), t0=t0, mesh=mesh)
            # Some scenes have no equilibrium, such as a falling body.
            with suppress(ArgumentError), closing(simulation):
                simulation.may_be_free = True  # free motions are modes, too
                simulation.step_to(AT)
                at = simulation.snapshot()
            if at is None and (scene.supports or GROUND in scene.rigid_bodies):
                warn(
                    "modes: loads have no effect, since no equilibrium under them was found; begin "
                    "near it, give at=, or leave the loads out"
                )
        if at is None:
            scene = replace(scene, loads=())  # with loads, this state would be no equilibrium
    small = SmallMotions(scene, at, mesh=mesh)
    require_no_spin("modes", small, at)
    if at is None and (said := small.unbalanced()):
        warn(said)
    if not small.M.data.any():
        raise ArgumentError("modes: nothing that can move has mass; give sections rho or rhoA")
    warn_of_masses(scene)
    small.warn_of_limits("modes")
    if damped:
        small.warn_of_relaxation("modes")
    exponents, shapes = small.exponents(n, damped=damped)
    state = scene, small.numbering, small.q, small.turns
    return Modes(*state, shapes, *_stresses(small, at), exponents)


@each_warning_once()
def buckling(
    scene: Scene, n: int, *, t: float = 1.0, at: StateOf | None = None, mesh: Mesh | None = None
) -> Buckling:
    """Compute buckling load factors and modes, (K + λ K' + λ² K''/2) x = 0.

    Loads and prescribed motions grow in proportion, from their values in the state ``at``, or from
    zero without ``at`` (λ = 0), to their values at the time ``t`` (λ = 1).  K' and K'' are the
    derivatives of the stiffness along this path; they include changes of forces and of
    displacements.  Factors are exact if the path is straight, as of columns and of frames under
    forces in line with their columns; else the error grows with the factor and with the curvature
    of the path.  If loads bend beams long before they buckle, factors have no meaning; a warning
    lists these factors.  In space, these factors are only estimates of the results, at which the
    stiffness in equilibrium vanishes, also if loads bend beams before.

    Args:
        scene: Model.
        n: Number of factors, from the smallest ``|λ|``; fewer if fewer are real.
        t: Time at which loads are evaluated; s.
        at: Solution of the same beams with equal joints; the loads grow from its last state, or
            from the n-th stored state of ``(solution, n)``.
        mesh: Discretization; by default the mesh of ``at``, or the cells of the beams.

    Raises:
        ArgumentError: The call is wrong; the scene is free to move; nothing acts on it; ``at``
            turns; or the scene has a
            :class:`FollowerLoad`, :class:`Pressure`, :class:`RotatingFrame`,
            :class:`ImposedStrain` or
            :class:`VirtualWork`.

    Warns:
        ModelWarning: The stiffness of a shape does not vanish at its factor, or a stop just
            touches.

    Example:
        >>> push = ub.PointLoad(beam.end, force=(-1.0, 0))
        >>> column = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> critical = ub.buckling(column, 1, mesh=ub.Mesh(refine=4)).factors[0]
        >>> print(f"{critical / (np.pi**2 * section.EI / (2 * 2) ** 2):.2f}")  # times Euler's load
        1.00
    """
    n = require_count(n, "buckling: n")
    at = require_state("buckling", scene, at, mesh)
    require_number(t, "buckling: t")
    frames = [] if at is None else [x for x in at.scene.loads if isinstance(x, RotatingFrame)]
    for load in (*scene.loads, *scene.works, *frames):
        if isinstance(load, VirtualWork | Effect) or (isinstance(load, Load) and not load.dead):
            raise ArgumentError(
                f"buckling: the {type(load).__name__} has a stiffness of its own; use "
                "modes(..., at=) about states with an increasing load, and find where a frequency "
                "vanishes or a damping ratio becomes negative"
            )
    functions = [function for _, function in scene.time_functions()]
    same = at is not None and (scene.loads, scene.supports) == (at.scene.loads, at.scene.supports)
    if same and at is not None and all(f(t) == f(float(at.times[-1])) for f in functions):
        raise ArgumentError(
            f"buckling: loads and motions at t = {t:g} s are the same as in the state at "
            f"{float(at.times[-1]):g} s, so that nothing grows; give a larger t, or another state"
        )
    if at is None and (said := require_no_mechanism(scene)):
        raise ArgumentError(f"{said}Where loads hold it, give at=simulate(scene, Static(), ...)")
    small = SmallMotions(scene, at, t, mesh)
    require_no_spin("buckling", small, at)
    small.warn_of_limits("buckling")
    if scene.in_space:
        t0 = 0.0 if at is None else float(at.times[-1])  # loads grow from their values there
        growing, switch = _growing(scene, at, t0)
        static = Simulation(growing, Static(), t0=t0, start=at, mesh=mesh, comm=MPI.COMM_SELF)
        switch.acting = True
        for inner in (*(cells.points for cells in static.inelastic), *static.connector_terms):
            inner.freeze()  # as in the linearized equations
        static.time_loop.path.slack = math.inf  # frozen points do not store the work of steps
        with closing(static):
            found = small.buckling_in_space(n, static)
    else:
        found = small.buckling(n)
    factors, shapes, errors, others = found
    stiff = any(beam.section.GA > 10 * beam.section.EA for beam in scene.beams)
    wrong = (
        ": the stiffness of their shapes does not vanish there, because the loads bend, turn or "
        "shorten beams first"
        + ", which GA > 10 EA makes worse (GA = 10 EA excludes shear strains as well)"
        * stiff
        + ". Give forces at the nodes instead of along beams, give at= a state closer to buckling, "
        "follow the path with ub.follow, or find where a frequency of modes(..., at=) vanishes"
    )
    if listed := ", ".join(f"{x:.4g}" for x in factors[errors > LARGEST_ERROR]):
        warn(f"buckling: the factors {listed} are no buckling loads{wrong}")
    if not len(factors) or (others < np.abs(factors).max()).any():
        listed = ", ".join(f"{x:.4g}" for x in np.sort(others)[:n])
        warn(f"buckling: factors of magnitude {listed} are complex and left out{wrong}")
    state = scene, small.numbering, small.q, small.turns
    return Buckling(*state, shapes, *_stresses(small, at), factors, errors)


def _growing(scene: Scene, at: Solution | None, t0: float) -> tuple[Scene, SimpleNamespace]:
    """Return a scene with the loads of ``at`` until the attribute ``acting`` of the result is set.

    From then on, it has the loads of ``scene``.  Loads of both scenes are functions of time alone.
    """
    switch, before = SimpleNamespace(acting=False), scene.loads if at is None else at.scene.loads

    def is_among(load: Load, others: Sequence[Load]) -> bool:
        return any(load is other or load == other for other in others)

    def appears(load: Any) -> Any:
        factor = load.amplitude
        return replace(load, amplitude=lambda t: factor(t) if switch.acting else 0.0)

    def vanishes(load: Any) -> Any:
        factor = load.amplitude(t0)
        return replace(load, amplitude=lambda t: 0.0 if switch.acting else factor)

    loads = [load if is_among(load, before) else appears(load) for load in scene.loads]
    loads += [vanishes(load) for load in before if not is_among(load, scene.loads)]
    return replace(scene, loads=loads) if loads != [*scene.loads] else scene, switch


def _stresses(small: SmallMotions, at: Solution | None) -> tuple[tuple[Array, Array], Array]:
    """Return the law and the resultants of the cells in the last state of ``at``, or without it."""
    count = len(small.numbering.cells)
    if small.scene.in_space:
        fields = Fields(Subdomain(small.numbering, MPI.COMM_SELF))
        D = fields.section_values(*STIFFNESS_IN_SPACE)[:, :, None] * np.eye(6)
        law: tuple[Array, Array] = np.zeros((count, 6)), D.reshape(-1, 36)
    else:
        law = section_law(small.beams, small.numbering)
    return law, np.zeros((lib.CELL_NUMBERS, count)) if at is None else at.cell_resultants(-1)


def require_state(
    what: str, scene: Scene, at: StateOf | None, mesh: Mesh | None
) -> Solution | None:
    """Return the solution that ends with the state ``at``, None for the undeformed scene, or raise.

    ``what`` is the function that needs the state.
    """
    require_kind(scene, Scene, f"{what}: scene")
    state = chosen_state(at, f"{what}: at")
    if state is None:
        require_no_prestress(scene, what, "give at=, a static solution")
    elif not DofNumbering(scene, mesh_of(state, mesh)).agrees(state.numbering):
        raise ArgumentError(
            f"{what}: at is a solution of other beams, joints or cells; use the same Beam "
            "objects, joined alike, and the same Mesh"
        )
    return state


def require_no_spin(call: str, small: SmallMotions, at: Solution | None) -> None:
    """Raise if a beam or body turns fast in the last state of ``at``; ``call`` is the caller."""
    if at is None or not len(at.v) or not small.M.data.any():
        return
    first = small.undamped(1, (small.K + small.K.T) / 2, definite=True)[-1] ** 0.5
    parts: list[Any] = [*small.scene.rigid_bodies, *small.scene.beams]
    for part in parts:
        rotations = small.numbering.nodes_of(part)[1][:, small.numbering.displacements :]
        if (rate := np.linalg.norm(at.v[-1][rotations].mean(axis=0))) > SPIN * first:
            raise ArgumentError(
                f"{call}: at turns: {part} by {rate:.3g} rad/s, beside a first frequency of "
                f"{first:.3g} rad/s; its centrifugal and Coriolis forces would be missing. Put a "
                "RotatingFrame of this rate in the scene, and give its state of steady rotation, "
                "or give a state at rest"
            )
