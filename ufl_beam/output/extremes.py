# SPDX-License-Identifier: MIT
"""Extremes of section forces and motions in a run, with their times."""

from __future__ import annotations

from typing import Any, NamedTuple

from mpi4py import MPI

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index, State
from ufl_beam.caches import cached_forms
from ufl_beam.compiled.c_library import doubles, fill, lib, struct
from ufl_beam.compiled.keys import key_of
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.compiled_forms import (
    InsertedForces,
    Pointwise,
    Stated,
    compiled_functions,
    inserted_cells,
)
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.display import in_one_line
from ufl_beam.errors import ArgumentError, require_number, require_switch
from ufl_beam.mechanics.time_scheme import has_inertia
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import Body, Member
from ufl_beam.output.output_files import require_arrays
from ufl_beam.output.recorder import Restartable, StateView
from ufl_beam.output.section_forces import in_section, section_force
from ufl_beam.terms.cell_forces import CellForces


@in_one_line
class Extent(NamedTuple):  # with the fields of ``extent`` in loops.h
    """Smallest and largest values in a run and their times, as arrays of the same shape.

    Attributes:
        low: The least values.
        high: The largest values.
        time_low: Times at which the least values were first reached; s.
        time_high: Times at which the largest values were first reached; s.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=extremes)
        >>> v = extremes.displacement(beam).subset((-1, 1))
        >>> print(v.low.round(3), v.time_low)  # m, s
        -0.019 1.0
    """

    low: Array
    high: Array
    time_low: Array
    time_high: Array

    def subset(self, rows: Index) -> Extent:
        """Return the extremes at an index of the arrays, such as rows or (row, column)."""
        return Extent(*(values[rows] for values in self))


# -- extremes that C updates after each step -------------------------------------------------------


@cached_forms
def along_cells(degree: int, fractions: tuple[float, ...], works: bool) -> tuple[Any, ...]:
    """Compile :func:`section_force`; its values in a cell are (N, V, M) at the fractions.

    If all fractions are 0 or 1, displacements and forces between the ends have no effect.

    Returns:
        The function, compiled, of unknowns, of resultants (``cell_number`` of loops.h), of the
        directions of the axis at both ends of a cell, and of the vector between the ends; the
        numbers of unknowns, all of a cell or only rotations, and of resultants.
    """
    mesh, between = Mesh(degree=degree), set(fractions) > {0.0, 1.0}
    n = len(mesh.nodes)
    first, moves = (lib.CELL_NUMBERS, 3 * n) if between else (lib.COUPLE, n)

    def state() -> Stated:
        names = [*(f"motion {k}" for k in range(moves)), *(f"force {k}" for k in range(first))]
        compiler = Pointwise([*names, "angle 0", "angle 1", "x", "y"])
        motions, at = [*compiler.at.values()][:moves], compiler.at
        order = [0, *range(2, n), 1]  # order of nodes along a cell
        *displacements, rotations = ([motions[k + i] for i in order] for k in range(0, moves, n))

        def weighted(weights: Array, values: list[Expr]) -> Expr:
            return sum(float(a) * x for a, x in zip(weights, values, strict=True))

        def tangent(fraction: float) -> tuple[Any, Any]:
            if not between:
                return at["x"], at["y"]
            u, v = (weighted(mesh.slopes(fraction), nodes) for nodes in displacements)
            return at["x"] + u, at["y"] + v

        known = [at[f"force {k}"] for k in range(first)] + [0.0] * (lib.CELL_NUMBERS - first)
        at_fraction = section_force(known, tangent, works=works)
        at_end = known[lib.END_X : lib.END_M + 1]
        rows = list[Expr]()
        for fraction in fractions:
            rotation = weighted(mesh.weights(fraction), rotations)
            angle = (1 - fraction) * at["angle 0"] + fraction * at["angle 1"] + rotation
            plane = at_fraction(fraction) if fraction < 1 else tuple(at_end)
            rows += in_section(plane, ufl.cos(angle), ufl.sin(angle))
        return Stated(compiler, [rows], inserted=1, unknowns=moves)

    key = key_of("section forces", degree, fractions, works)
    return compiled_functions(key, state)[0][0], moves, first


class ExtremesInC:
    """Extremes of section forces at points of cells, and of motions, after each substep.

    Each process updates the extremes of its cells and degrees of freedom.

    Attributes:
        c: Struct ``watch`` of loops.h.
        seen: Number of steps up to the state that Python included last.
    """

    def __init__(
        self, fields: Fields, cell_forces: CellForces, between: float, fractions: Array
    ) -> None:
        self._subdomain = subdomain = fields.subdomain
        size, works = subdomain.size, bool(subdomain.numbering.scene.works)
        kept = tuple(map(float, fractions))
        function, moves, first = along_cells(fields.degree, kept, works)
        space = np.empty((1, first + 4, BATCH))  # C has the numbers of cells elsewhere
        cells = inserted_cells(function, space, fields.cell_dofs[:, -moves:])
        self._along = InsertedForces(cells)
        _, spare = self._along.keep_entries()
        start, end = fields.coordinates().transpose(1, 0, 2)
        axes = np.hstack([subdomain.numbering.axis_angles[subdomain.cells], end - start])
        self._points, self._forces = len(fractions), cell_forces
        sizes = spare.size, size
        self._extents = [Extent(*np.zeros((4, n))) for n in sizes]
        cell_forces.keep_latest()
        self.c = struct(
            "watch", forces=cell_forces.c, along=cells, between=between,
            axes=in_batches(axes, BATCH), q=np.zeros(size), first=first,
            numbers=np.zeros(lib.CELL_NUMBERS * len(axes)), some=np.zeros(lib.SOME * cells.width),
            in_order=cell_forces.in_order(),
        )  # fmt: skip
        self.seen = -1
        for c, extent in zip((self.c.of_forces, self.c.of_motion), self._extents, strict=True):
            fill(c, size=len(extent.low), **extent._asdict())

    def add(self, steps: int, t: float, q: Array, before: Array) -> None:
        """Include the state after ``steps`` steps, unless :attr:`seen` is the same number.

        Processes that share the scene call this method together; it gathers their extremes.
        """
        if steps != self.seen:
            resultants = self._forces(q, before)
            previous, self._forces.c.initial = self._forces.c.initial, doubles(resultants)
            lib.watch_step(self.c, 0, t, doubles(before), doubles(q))
            self._forces.c.initial = previous
            self.seen = steps
        if not self._subdomain.alone:
            self.gather()

    def begin(self, steps: int, forces: Extent, motion: Extent) -> None:
        """Set the extremes after ``steps`` steps, in the form that :meth:`extents` returns."""
        for to, values in zip(self._extents[0], forces, strict=True):
            to[:] = in_batches(values[self._subdomain.cells], BATCH).ravel()
        for to, values in zip(self._extents[1], motion, strict=True):
            to[:] = values[self._subdomain.dofs]
        self.seen, self._gathered = steps, [forces, motion]

    def gather(self) -> None:
        """Gather the extremes of all processes that share the scene; they call it together."""
        subdomain, (forces, motion) = self._subdomain, self._extents
        cells, shape = subdomain.cells, (-1, 3 * self._points, BATCH)
        whole: Array = np.zeros((4, len(subdomain.numbering.cells), self._points, 3))
        for k, values in enumerate(forces):
            in_order = values.reshape(shape).transpose(0, 2, 1).reshape(-1, self._points, 3)
            whole[k, cells] = in_order[: len(cells)]
        if not subdomain.alone:
            subdomain.comm.Allreduce(MPI.IN_PLACE, whole)
        motions = (subdomain.gather(values).copy() for values in motion)
        self._gathered = [Extent(*whole), Extent(*motions)]

    def extents(self) -> list[Extent]:
        """Return the extremes of section forces, (num_cells, points, 3), and motions, (size,).

        If processes share the scene, the latest :meth:`gather` has computed the extremes.
        """
        if self._subdomain.alone:
            self.gather()
        return self._gathered


# -- the recorder ----------------------------------------------------------------------------------


class Extremes(Restartable):
    """Recorder of the extremes of section forces along all cells and of motions of all nodes.

    All steps are included, even if the solution does not store them, and the initial state, which
    is unloaded in statics without ``start=``.  Steps that the solver divides count as their
    substeps.  Memory does not grow with the number of steps.  Section forces are evaluated at
    equally spaced points of each cell, both ends included, as in :meth:`Solution.diagram`.  During
    a run, processes that share the scene have the extremes up to the end of the last whole step.
    In space Python updates the extremes after each whole step; rotations are rotation vectors, as
    :meth:`Solution.displacement` returns them.

    Args:
        points: Number of points of a cell, at least 2.
        accelerations: Record extremes of the accelerations of all nodes, which Python then updates
            after each whole step.

    Raises:
        ArgumentError: ``points`` is no number of at least 2.  A run raises it if it is static and
            ``accelerations`` is true.

    Example:
        >>> extremes = ub.Extremes()
        >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=extremes)
        >>> M = extremes.section_forces(beam).low[:, 2]  # N m
        >>> print(M[:6].round(-3))  # at both ends of three of the four cells
        [-195000. -146000. -146000.  -98000.  -98000.  -49000.]
    """

    def __init__(self, points: int = 2, *, accelerations: bool = False) -> None:
        require_number(points, "Extremes: points", at_least=2)
        require_switch(accelerations, "Extremes: accelerations")
        self._accelerated = bool(accelerations)
        self._fractions = np.arange(int(points)) / (int(points) - 1)
        self._in_c: Any = None  # ExtremesInC during a run
        self._taken: dict[str, Extent] = {}  # by quantity

    def begin(self, simulation: StateView, state: State | None = None) -> None:
        """Begin with the initial state, or continue from a :meth:`state`."""
        self._numbering: DofNumbering = simulation.numbering
        self._solution = simulation.solution
        if self._accelerated and not has_inertia(simulation.scheme):
            raise ArgumentError("Extremes: accelerations: the run is static; there are none")
        in_space, size = simulation.scene.in_space, self._numbering.size
        self.by_itself = simulation.subdomain.alone and not self._accelerated and not in_space
        along = len(self._numbering.cells), len(self._fractions), 6 if in_space else 3
        shapes: dict[str, tuple[int, ...]] = {"forces": along, "q": (size,)}
        shapes |= {"a": (size,)} if self._accelerated else {}
        self._taken = {}
        for what, shape in shapes.items():
            extent = Extent(*(np.full(shape, x) for x in (np.inf, -np.inf, 0.0, 0.0)))
            if state is not None:
                names = [f"{what} {name}" for name in Extent._fields]
                require_arrays(state, dict.fromkeys(names, shape))
                extent = Extent(*(state[name].copy() for name in names))
            self._taken[what] = extent
        if not in_space:
            self._in_c = simulation.watch(self._fractions)
            steps = -1 if state is None else simulation.substeps
            self._in_c.begin(steps, self._taken["forces"], self._taken["q"])
        self._before: Array = np.full((1 + size) * self._accelerated, np.nan)
        if state is None:
            self.write(simulation)
        elif self._accelerated:
            require_arrays(state, {"before": self._before.shape})
            self._before = state["before"].copy()

    def write(self, simulation: StateView) -> None:
        """Include the state of a step."""
        if self._in_c is None:  # in space
            now, numbering = simulation.now, self._numbering
            motion = now.q[0]
            motion[numbering.dofs] = now.motion_of_nodes(0)
            for body, dofs in zip(simulation.scene.bodies, numbering.dofs_of_bodies, strict=False):
                motion[dofs] = now.displacement(body.middle)[0]
            self._widen("forces", now.cell_forces(0, self._fractions), simulation.t)
            self._widen("q", motion, simulation.t)
        else:
            self._in_c.add(simulation.substeps, simulation.t, simulation.q, simulation.q_before)
        if self._accelerated:
            v = simulation.subdomain.gather(simulation.velocities()[0])
            latest = np.append(simulation.t, v)
            change = latest - self._before
            self._before[:] = latest
            self._widen("a", change[1:] / change[0], simulation.t)

    def _widen(self, quantity: str, values: Array, t: float) -> None:
        """Extend the extremes of a quantity by its values at the time ``t``."""
        extent = self._taken[quantity]
        for reached, when, beyond in (
            (extent.low, extent.time_low, values < extent.low),
            (extent.high, extent.time_high, values > extent.high),
        ):
            if beyond.any():
                reached[beyond] = values[beyond]
                when[beyond] = t

    def close(self) -> None:
        """Stop recording; the extremes remain available."""
        self._taken, self._in_c = self._extents, None

    @property
    def _extents(self) -> dict[str, Extent]:
        """Extremes of forces, of motions and, if they are recorded, of accelerations."""
        in_c = self._in_c.extents() if self._in_c is not None else ()
        return self._taken | dict(zip(("forces", "q"), in_c, strict=False))

    def state(self) -> State:
        """Return the extremes so far, by name."""
        more, extents = {"before": self._before} if self._accelerated else {}, self._extents.items()
        return more | {f"{k} {n}": x for k, extent in extents for n, x in extent._asdict().items()}

    @property
    def numbering(self) -> DofNumbering:
        """Vertices and cells of the scene.

        Raises:
            ArgumentError: Nothing was run.
        """
        if not hasattr(self, "_numbering"):
            raise ArgumentError("Extremes: nothing was run; give it to simulate(..., record=)")
        return self._numbering

    @property
    def solution(self) -> Any:
        """The :class:`Solution` of the run.

        Raises:
            ArgumentError: Nothing was run.
        """
        _ = self.numbering  # or its error
        return self._solution

    def section_forces(self, beam: Member) -> Extent:
        """Return extremes of (N, V, M) at points of the cells of a beam; N, N, N m.

        Rows have the order of a :class:`Diagram` with the same points; (num_cells · points, 3).
        In space, columns are those of a :class:`DiagramInSpace`; (num_cells · points, 6).

        Raises:
            ArgumentError: The beam is not in the scene, or nothing was run.
        """
        cells = self.numbering.cells_of(beam)
        found = self._extents["forces"].subset(cells)
        return Extent(*(x.reshape(-1, x.shape[2]) for x in found))

    def displacement(self, owner: Member | Body) -> Extent:
        """Return extremes of (u, v, ψ) at the nodes of a beam, or of a body; (n, 3); m, m, rad.

        In space they are extremes of the displacement and the rotation vector; (n, 6).

        Rows follow a beam from start to end: its vertices and, between them, the inner nodes of
        cells of higher degree.  At a hinge ψ is as in :meth:`Solution.displacement` of the place.

        Raises:
            ArgumentError: The object is not in the scene, or nothing was run.
        """
        return self._at_nodes("q", owner)

    def acceleration(self, owner: Member | Body) -> Extent:
        """Return extremes of mean accelerations of steps; (n, 3); m/s², m/s², rad/s².

        The rows are those of :meth:`displacement`, the values those of
        :meth:`Solution.acceleration` if each step is stored.

        Raises:
            ArgumentError: Accelerations are not recorded, the object is not in the scene, or
                nothing was run.

        Example:
            >>> floors = ub.Extremes(accelerations=True)
            >>> run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05, record=floors)
            >>> tip = floors.acceleration(beam).subset((-1, 1))
            >>> bool(tip.high == np.nanmax(run.acceleration(beam.end)[:, 1]))
            True
        """
        if not self._accelerated:
            raise ArgumentError(
                "Extremes: accelerations are not recorded; use Extremes(accelerations=True)"
            )
        return self._at_nodes("a", owner)

    def _at_nodes(self, quantity: str, owner: Member | Body) -> Extent:
        """Return the extremes of a quantity at the nodes of a beam or body; (n, 3)."""
        numbering = self.numbering
        if isinstance(owner, Body):
            return self._extents[quantity].subset(numbering.node(owner.middle)[None])
        return self._extents[quantity].subset(numbering.dofs[numbering.nodes_along(owner)])
