# SPDX-License-Identifier: MIT
"""Derivatives of one number of a run by many parameters, by the discrete adjoint of its steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.derivatives import (
    MODEL_STEP,
    STENCILS,
    Model,
    MotionOnly,
    StepDerivatives,
    Unknown,
    checked_case,
    in_scene,
)
from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.discretization.cells_in_space import TURNS
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import (
    ArgumentError,
    StepFailed,
    each_warning_once,
    require_function,
    require_number,
    require_returned,
    shorten,
)
from ufl_beam.mechanics.time_scheme import Scheme, has_inertia, stages_of
from ufl_beam.model.beams import Mesh
from ufl_beam.simulation.run import require_times
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_lengths import step_count
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.derivatives import functions, recorded

SMALL = 2.0**-17
"""Small step of differences of histories and numbers, as a fraction of the largest value."""

ALIKE = 1e-9  # relative difference of slopes by small and large steps that counts as round-off

MOTION = "t", "q", "v", TURNS
"""Columns of states on which histories may depend."""

FINER = 2.0**-6
"""Ratio of steps of differences of histories and numbers, see :func:`_slope`."""

MAX_BYTES = 2.0**28  # memory for recorded steps; bytes


@each_warning_once()
def gradient(
    model: Model,
    at: Mapping[str, float],
    scheme: Scheme,
    *,
    t: tuple[float, float],
    dt: float,
    of: Callable[[Solution], npt.ArrayLike],
    reduce: Callable[[Array], float] = itemgetter(-1),
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    max_bytes: float = MAX_BYTES,
) -> tuple[float, Array]:
    """Compute one number of a run, and differentiate it by many parameters of the scene.

    The adjoint of the run goes back through its steps once, at a cost that hardly depends on the
    number of parameters.  Besides, the model is called for differences of the numbers of the scene,
    seldom if each number depends on one parameter at most, as a stiffness does on EI.
    :func:`differentiate` has derivatives of any quantity, and continues a preload with ``start``,
    which this function does not: its run begins with the undeformed scene.

    The steps are recorded in parts of the run that fit into the given memory.  Each segment is
    computed twice.

    Args:
        model: Function that returns the scene for values of its parameters.
        at: Values of the parameters by name.
        scheme: Time scheme.
        t: Beginning and end; s.
        dt: Time step; s.
        of: Function of a :class:`Solution` that returns a history of its motion, (n+1,) or
            (n+1, k): each value depends on displacements, positions and velocities at its time
            only.
        reduce: Function that returns the number for the history; by default its last value.
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default the cells of the beams.
        max_bytes: Memory for recorded steps; bytes.

    Returns:
        The number and its derivatives; (P,), in the order of ``at``.  ``scipy.optimize.minimize``
        takes both with ``jac=True``.  The derivative by a parameter on which the run does not
        depend is round-off.

    Raises:
        ArgumentError: As in :func:`differentiate`; the history depends on something else than the
            motion at its times, in space on its displacements; ``reduce`` returns no finite number;
            or steps were divided.

    Example:
        >>> def frame(**EI):
        ...     shape = {"EA": 2e9, "GA": 7e8, "rhoA": 60.0, "rhoI": 0.1}
        ...     sections = [ub.Section(EI=x, **shape) for x in EI.values()]
        ...     a, b = (ub.Beam((k, 0), (k + 1, 0), s, cells=2) for k, s in enumerate(sections))
        ...     joints, supports = [ub.Rigid(a.end, b.start)], [ub.Clamped(a.start)]
        ...     return ub.Scene([a, b], joints=joints, supports=supports, loads=[ub.Gravity()])
        >>> tip = lambda s: s.displacement(s.scene.beams[-1].end)[:, 1]
        >>> at = {"EI_0": 4e6, "EI_1": 4e6}
        >>> value, sag = ub.gradient(frame, at, ub.EnergyMomentum(), t=(0, 0.1), dt=2e-3, of=tip)
        >>> print((sag * 4e6 * 1e6).round(2))  # by relative changes; micrometres
        [1707.16  124.12]
    """
    require_function(of, "gradient: of", "a Solution")
    require_function(reduce, "gradient: reduce", "a history")
    require_number(max_bytes, "gradient: max_bytes", positive=True)
    t0, t1 = require_times(t, "gradient")
    case = checked_case("gradient", model, at, scheme, t0, dt, newton, mesh)
    if not has_inertia(scheme) and scheme.load_weight != 1.0:
        raise ArgumentError(f"gradient: scheme = {scheme} has no adjoint; use Static()")
    with closing(case.simulation()) as run:
        beside = case.neighbours(run, t1)
        steps = StepDerivatives(run, beside, 1)
        number = step_count(t1 - t0, dt)
        ends = t0 + (t1 - t0) * np.arange(1, number + 1) / number
        ends[-1] = t1
        adjoint = _Adjoint(run, steps, max_bytes)
        starts = adjoint.run(ends)
        history = _History(run.solution, of, reduce)
        found = adjoint.reverse(ends, starts, *history.derivatives_by_motion())
        others = {other for some in beside.scenes for other in some}
        moved = {other for other in others if history.change_in(other.numbering)}
        for p, (name, some) in enumerate(zip(at, beside.scenes, strict=True)):
            if moved.intersection(some):
                numberings = [
                    DofNumbering(x, run.numbering.mesh) for x in case.scenes(name, MODEL_STEP)
                ]
                changes = [*map(history.change_in, numberings)]
                found[p] += case.differences(name, MODEL_STEP)[1] @ changes
        beside.close()
    return history.value, found


class _Adjoint:
    """Recorded steps of a simulation, and their adjoint, see adjoint.c."""

    def __init__(self, simulation: Simulation, steps: StepDerivatives, max_bytes: float) -> None:
        self._simulation, self._steps = simulation, steps
        c, A = steps.c, simulation.equation.A
        terms = [functions(kind)[4:] for kind, _ in steps.terms]
        blocks = [(A.data, A.data.nbytes)]
        blocks += [block for term in steps.terms for block in recorded(*term)]
        loop, size = simulation.time_loop, simulation.subdomain.size
        blocks += [(loop.x, 8 * size), (ffi.addressof(loop.step, "q0"), 8 * size)]
        pointers = [self._pointer(x) for x, _ in blocks]
        lengths = np.array([n for _, n in blocks], dtype=np.int64)
        step = sum(map(ffi.sizeof, ("int", "time_step", "scheme_numbers"))) + int(lengths.sum())
        self._stages = len(stages_of(simulation.scheme))
        self.most = max(1, int(max_bytes // (step * self._stages)))
        rows = np.repeat(np.arange(size), np.diff(A.indptr)).astype(np.int32)
        # `values` is space for the degrees of freedom, the values of forms, and the data of a point
        space = max([size, 1024, *(n // 8 for _, n in blocks)])
        self._q1, self._rates = np.zeros(size), np.zeros((lib.MOST_RATES, size))
        self.gradient = np.zeros(c.parameters)
        self._lengths, self._alive = lengths, [pointers, blocks]
        self.c = struct(
            "adjoint", d=c, parameters=c.parameters, size=size,
            term=ffi.new("term_transposes[]", terms), q0=np.zeros(size), q1=self._q1,
            new_rates=np.zeros((lib.MOST_RATES, size)), q_bar=np.zeros(size),
            values=np.zeros(space), gradient=self.gradient, transpose=A.positions(A.indices, rows),
            transposed=np.zeros(len(A.data)), blocks=len(blocks),
            block=ffi.new("void **[]", pointers), bytes=step,
            length=ffi.from_buffer("int64_t[]", lengths), **{"lambda": np.zeros(size)},
        )  # fmt: skip
        for k, rate in enumerate(self._rates):
            self.c.rates[k] = doubles(rate)

    @staticmethod
    def _pointer(values: Any) -> Any:
        """Return a pointer to the address of an array of Python or C."""
        if isinstance(values, np.ndarray):
            values = doubles(values)
        if ffi.typeof(values).item.kind == "pointer":
            return ffi.cast("void **", values)
        return ffi.new("void *[1]", [ffi.cast("void *", values)])

    def run(self, ends: Array) -> list[Any]:
        """Take all steps; return the states at the beginning of each recorded segment."""
        simulation, starts = self._simulation, list[Any]()
        simulation.keep()
        for first in range(0, len(ends), self.most):
            archive = Archive(simulation.subdomain)
            simulation.save_or_restore(archive)
            starts.append(archive.state())
            self._step_to(ends[first : first + self.most], keep=True)
        if simulation.substeps != len(ends):
            raise ArgumentError("gradient: steps of the run were divided; use a smaller dt")
        return starts

    def _step_to(self, ends: Array, *, keep: bool) -> None:
        while len(ends):
            ends = ends[self._simulation.steps_to(ends, keep=keep) :]

    def reverse(
        self, ends: Array, starts: list[Any], q: tuple[Index, Array], v: tuple[Index, Array]
    ) -> Array:
        """Return the derivatives by the parameters, from those by q and v, see ``_History``."""
        simulation, c = self._simulation, self.c
        # With a step for initial accelerations
        number = min(self.most, len(ends)) * self._stages + 1
        fill(c, most=number, record=ffi.new("char[]", number * int(c.bytes)))
        for segment in reversed(range(len(starts))):
            first = segment * self.most
            some = ends[first : first + self.most]
            simulation.save_or_restore(Archive(simulation.subdomain, starts[segment]))
            fill(simulation.time_loop, adjoint=c)
            self._step_to(some, keep=False)
            simulation.time_loop.adjoint = ffi.NULL
            for n in reversed(range(first + 1, first + 1 + len(some))):
                self._add(n, q, v)
                with simulation.equation.callbacks.raising():
                    for _ in range(self._stages):
                        if not lib.go_back(c, simulation.time_loop):
                            raise StepFailed(f"the tangent is singular at t = {ends[n - 1]:g} s")
        self._add(0, q, v)
        if c.recorded:  # the step from which the initial accelerations were taken
            with simulation.equation.callbacks.raising():
                lib.go_back(c, simulation.time_loop)
        lib.finish_adjoint(c, simulation.time_loop)
        return self.gradient.copy()

    def _add(self, n: int, q: tuple[Index, Array], v: tuple[Index, Array]) -> None:
        for x, (dofs, values) in ((self._q1, q), (self._rates[1], v)):
            x[dofs] += values[n]


class _History:
    """A history of the motion of a run, and a number that is made of it."""

    def __init__(
        self, solution: Solution, of: Callable[[Solution], npt.ArrayLike],
        reduce: Callable[[Array], float],
    ) -> None:  # fmt: skip
        self._numbering, self._quantity, self._reduce = solution.numbering, of, reduce
        self._blocks = solution.blocks
        reference = self._reference = self._in(self._numbering)
        if reference.shape[:1] != (len(solution),):
            raise ArgumentError(
                f"gradient: of returns an array of shape {reference.shape}, and must return a "
                f"history with one row for each of the {len(solution)} states; put the rest into "
                "reduce"
            )
        if not np.isfinite(reference).all():
            n = int(np.argmin(np.isfinite(reference.reshape(len(reference), -1)).all(axis=1)))
            raise ArgumentError(
                f"gradient: the history is not finite at t = {solution.times[n]:g} s; return "
                "finite values, and leave out those that reduce does not need"
            )
        self.value = self._number(reference)
        # Rotations in space are no sums of unknowns
        if self._numbering.scene.in_space and not np.array_equal(
            self._shifted(TURNS, slice(None), SMALL), reference
        ):
            raise ArgumentError(
                "gradient: the history depends on rotations in space, of which there is no "
                "adjoint; take displacements of places of beams or centres of bodies, or use "
                "differentiate"
            )

    def _in(self, numbering: DofNumbering) -> Array:
        """Return the history in a scene."""
        try:
            values = in_scene(self._quantity, MotionOnly(numbering, self._blocks, MOTION))
        except Unknown:
            raise ArgumentError(
                "gradient: the history needs more than displacements and velocities, such as "
                "forces or energies; use differentiate"
            ) from None
        try:
            return np.asarray(values).astype(np.float64, casting="same_kind")
        except (TypeError, ValueError):
            raise ArgumentError(
                f"gradient: of returned {shorten(values)}; it must return a history of real numbers"
            ) from None

    def _number(self, history: Array) -> float:
        what = "gradient: reduce, by default the last value,"
        given = f"a history of shape {history.shape}"
        return require_returned(self._reduce(history), what, given, finite=True)

    def change_in(self, numbering: DofNumbering) -> float:
        """Return the change of the number in another scene with the same motion.

        Positions, and displacements of points of bodies, depend on the geometry, too.
        """
        history = self._in(numbering)
        if np.array_equal(history, self._reference, equal_nan=True):
            return 0.0
        return self._number(history) - self._number(self._reference)

    def _by_values(self) -> Array:
        """Return the derivatives of the number by the values of the history; (n+1, k)."""
        reference = self._reference
        rows = reference.reshape(len(reference), -1)
        by_rows = np.zeros(rows.shape)
        for n, k in np.ndindex(rows.shape):

            def number(change: float, at: tuple[int, int] = (n, k)) -> float:
                changed = rows.copy()
                changed[at] += change
                return self._number(changed.reshape(reference.shape))

            by_rows[n, k] = _slope(number, float(np.abs(rows[:, k]).max()))
        return by_rows

    def derivatives_by_motion(self) -> list[tuple[Index, Array]]:
        """Return the derivatives of the number by q and by v of each state.

        Both are the degrees of freedom on which the history depends, (k,), and the derivatives by
        them, (n+1, k).
        """
        reference, by_rows = self._reference, self._by_values()
        n, size = len(reference), self._numbering.size
        some_rows, both = np.arange(n)[:, None] % 2, list[tuple[Index, Array]]()
        for name in ("q", "v"):
            found, pending = dict[int, Array](), [slice(0, size)]
            scale = self._largest(name)
            while pending and scale is not None:  # bisection for those on which it depends
                dofs = pending.pop()
                number = dofs.stop - dofs.start
                change = SMALL * scale * (1 + np.arange(number) / size)
                if np.array_equal(self._shifted(name, dofs, change), reference):
                    continue
                if number > 1:
                    middle = dofs.start + number // 2
                    pending += slice(dofs.start, middle), slice(middle, dofs.stop)
                    continue
                changed = self._shifted(name, dofs, change * some_rows)
                if np.any(changed[::2] != reference[::2]):
                    raise ArgumentError(
                        "gradient: values of the history depend on motions at other times; put the "
                        "part that combines times into reduce"
                    )
                shifted = partial(self._shifted, name, dofs)
                slope = np.asarray(_slope(shifted, scale)).reshape(n, -1)
                found[dofs.start] = np.sum(by_rows * slope, axis=1)
            values = np.reshape([*found.values()], (-1, n)).T
            both.append((np.array([*found], dtype=np.intp), values))
        return both

    def _largest(self, name: str) -> float | None:
        """Return the largest number of a column, 1 if all are zero, None without the column."""
        pieces = [x.columns.column_of(name, x.rows) for x in self._blocks if name in x.columns.at]
        return max(float(np.abs(x).max()) for x in pieces) or 1.0 if pieces else None

    def _shifted(self, name: str, dofs: slice, change: Array | float) -> Array:
        """Return the history if some degrees of freedom of a column change; (n+1, ...) or less."""
        kept, first = list[tuple[Array, Array]](), 0
        for block in self._blocks:
            piece = block.columns.column_of(name, block.rows)[:, dofs]
            kept.append((piece, piece.copy()))
            shape = len(self._reference), *piece.shape[1:]
            piece += np.broadcast_to(change, shape)[first : (first := first + len(piece))]
        try:
            return self._in(self._numbering)
        finally:
            for piece, before in kept:
                piece[:] = before


def _slope(function: Callable[[float], Any], scale: float) -> Array:
    """Return the derivative of a function at zero, for arguments of the size ``scale`` or less.

    The argument may be much smaller than ``scale``, which is the largest number of the motion or of
    the history: a force of a joint, an angle after many turns, the first of many decaying swings.
    So steps become finer until slopes agree, and the slope is taken that differs least from the
    slope before, with its round-off.  Polynomials of degree 4 need two steps.
    """
    (positions, weights), start = next(iter(STENCILS.items())), np.asarray(function(0.0))

    def slope_at(h: float) -> Array:
        shifted = zip(positions, weights, strict=True)
        return np.asarray(sum(w / h * (function(k * h) - start) for k, w in shifted))

    h, round_off = scale or 1.0, np.finfo(np.float64).eps * np.abs(start).max()
    finest, last, best, least = 2.0**-40 * min(h, 1.0), slope_at(h), None, 1.0
    largest = np.abs(last).max()
    while least > ALIKE and h > finest:
        h *= FINER
        if round_off / h > least * largest > 0:  # finer steps have more round-off
            break
        slope = slope_at(h)
        if not largest and not slope.any() and h < SMALL * (scale or 1.0):
            return slope
        largest = max(largest, np.abs(slope).max())
        error = np.abs(slope - last).max() + round_off / h
        if error < least * largest:
            best, least = slope, float(error / largest)
        last = slope
    return slope_at(SMALL * min(scale or 1.0, 1.0)) if best is None else best
