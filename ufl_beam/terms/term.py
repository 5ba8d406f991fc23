# SPDX-License-Identifier: MIT
"""Terms: virtual works in the equation of a step, and their phases.

A term adds its forces to the residual and their derivatives to the tangent.  When a step is
accepted, the term adds its energies to the ledger.  Vectors hold the local degrees of freedom of a
process, ghosts included.  For each degree of freedom the solver sums the forces of all processes.

Phases are C functions that begin or accept a step; they call Python functions of a user.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, lib
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import ArgumentError, StepFailed
from ufl_beam.model.functions import Constant, Table, TimeFunction, value_at

KINDS = ("beams", "connectors", "loads", "inertia", "damping")
"""Kinds of terms, by the cause of their forces."""


class InCells(NamedTuple):
    """Forces of a term on the nodes of cells; see cell_forces.py.

    Attributes:
        form: Function that returns an object with ``keep_entries`` of :class:`InsertedForces`.
            Without a ``vector``, the forces are the values in the latest residual.
        kind: Value of ``force_kind`` in loops.h.
        order: Positions of the cells in ``subdomain.cells``.
        vector: Pointer to the address of the vector at which linear :class:`InsertedForces` are
            evaluated, if the residual does not evaluate them; else None.
        factor: Factor of the forces.
        on_demand: Whether the forces depend on the configurations at both ends of the step only,
            so that they are computed again from these.
    """

    form: Callable[[], Any]
    kind: int
    order: Index
    vector: Any = None
    factor: float = 1.0
    on_demand: bool = False


class Phases(NamedTuple):
    """C functions of a term in a step, each with its data; loops.h declares their types.

    ``begin`` and ``accept`` begin and accept a step; ``add_state`` adds the energies of a state to
    the ledger.  ``change`` computes the energy that a step stores and dissipates.  ``opens`` is
    ``element_block`` of loops.h, if points or connectors may open.  ``admits`` checks a step before
    its end is accepted.  ``again`` discards earlier iterates when a step is restarted.
    """

    begin: Sequence[Loop] = ()
    accept: Sequence[Loop] = ()
    add_state: Sequence[Loop] = ()
    change: Loop | None = None
    opens: Any = None
    admits: Loop | None = None
    again: Loop | None = None


class Term(ABC):
    """Virtual work of one physical effect.

    Attributes:
        kind: One of :data:`KINDS`.
        loops: Two C functions with their data: the first adds to the residual, the second to the
            tangent.  The second is None if the tangent is zero.
        in_cells: Forces on the nodes of cells, except dead loads; see
            :meth:`DeadLoads.loads_in_cells`.
        law_residual: C function, with its data, of the relative residual of laws; None if zero.
        must_dissipate: True if :meth:`require_dissipation` has to be called before a step is
            accepted.
    """

    kind: str
    loops: tuple[Loop, Loop | None]
    in_cells: Sequence[InCells] = ()
    law_residual: Loop | None = None
    must_dissipate = False

    made_phases: Phases
    """Phases of the term in the equation of a step, which sets them."""

    _A: Csr
    """Matrix that the tangent is added to."""

    @abstractmethod
    def phases(self, callbacks: Callbacks) -> Phases:
        """Return the C functions of the term in a step; the solver calls this method once."""

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the virtual work at ``q1`` to ``r``."""
        (force, data), _ = self.loops
        force(data, doubles(q1), doubles(r))

    def add_tangent(self, q1: Array) -> None:
        """Add the derivative at ``q1`` to the matrix with which the term was created."""
        _, tangent = self.loops
        if tangent is not None:
            tangent[0](tangent[1], doubles(q1), doubles(self._A.data))

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent along ``u`` at constant internal variables."""

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a law generates energy in the step to ``q1``."""

    @property
    def effect(self) -> str:
        """Description of the effect in messages."""
        return type(self).__name__

    @property
    def parts(self) -> object:
        """Kind of the term; a run has derivatives only if it is equal in neighbouring scenes."""
        return type(self)

    def describe(self, place: int) -> str:
        """Return the name of a material point or connector of the term, by its index."""
        return self.effect

    def derivatives(self, neighbours: Any) -> list[Any] | None:
        """Return the derivatives of the term by parameters; None if there are none.

        ``neighbours`` are :class:`~ufl_beam.terms.derivatives.Neighbours` of the term; each
        derivative has the fields of ``term_derivative`` of loops.h.
        """
        return None

    def is_like(self, term: Any) -> bool:
        """Return whether a term of another scene differs in numbers and functions only."""
        return True

    def start(self, q: Array) -> None:
        """Set the accepted configuration to ``q``, without a step."""

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore the data on which later steps depend; ``q`` is the configuration."""


class LoadTerm(Term):
    """Forces that depend on time or on the configuration.

    Attributes:
        vector: ``vector`` of loops.h: forces of the term; their norm is added to the force with
            which the convergence test compares the residual.
    """

    kind = "loads"
    vector: Any

    @abstractmethod
    def carry_on(self, t: float, q: Array, v: Array | None, past: Archive | None) -> Array:
        """Begin at the time ``t``: take its loads as the loads before the first step; return them.

        The state ``q`` is assumed to be in equilibrium with these loads.  ``v`` are the velocities,
        None in statics.  ``past`` is the end of an earlier run of the same scene, if there is one.
        """

    def pass_on(self, archive: Archive) -> None:
        """Save the forces of the last step that :meth:`carry_on` cannot recompute."""

    def begin_energy(self, t: float, q: Array, v: Array) -> None:
        """Set the energies of the state that begins a dynamic run without :meth:`carry_on`."""

    def prepare(self, q1: Array) -> None:
        """Take rates besides velocities from a trial step that ends at ``q1``."""


class Callbacks:
    """Python functions that C calls while it takes steps.

    Exceptions must not pass through C: the first exception is stored, and the step fails.

    Attributes:
        error: First exception in the latest step.  Any other exception replaces a
            :class:`StepFailed`.
        c: ``equation`` of loops.h.
    """

    error: BaseException | None = None
    _closed = False

    def __init__(self, c: Any) -> None:
        self.c, self._alive = c, list[Any]()

    def close(self) -> None:
        """Drop the functions, after which C must not be called.

        They refer to the simulation, which refers to them.  Without this cycle, the memory of a
        simulation is freed at once, and not by the garbage collector.
        """
        self._alive, self._closed = [], True

    def require_open(self) -> None:
        """Raise :class:`ArgumentError` after :meth:`close`."""
        if self._closed:
            raise ArgumentError(
                "the simulation is closed; begin another one, with start=simulation.solution"
            )

    # -- functions, with their data ---------------------------------------------------------------

    def time_functions(self, functions: Sequence[tuple[TimeFunction | None, object]]) -> Any:
        """Return an array of ``time_function`` of loops.h for pairs of a function and its owner.

        None is the time itself.  Error messages mention the owner of the function, see
        :func:`value_at`.
        """
        functions_in_c = ffi.new("time_function[]", len(functions))
        for place, (function, owner) in zip(functions_in_c, functions, strict=True):
            if isinstance(function, Constant):
                function = Table((0.0,), (function.value,))
            if isinstance(function, Table):
                points = [np.array(x, dtype=np.float64) for x in (function.times, function.values)]
                place.points, (place.t, place.y) = len(points[0]), map(doubles, points)
                self._alive += points
            elif isinstance(function, ffi.CData):  # the address of a number
                place.points, place.t, place.y = 1, function, function
            elif function is not None:
                place.value = lib.time_in_python
                place.handle = self.handle(partial(value_at, function, owner=owner))
        return functions_in_c

    def phase(self, function: Callable[[Any, Any, Any], None]) -> Loop:
        """Return a phase for C that calls ``function(step, q1, s)`` with C pointers."""
        return lib.phase_in_python, self.handle(function)

    # -- exceptions -------------------------------------------------------------------------------

    def synchronize(self) -> None:
        """Raise the stored exception of a callback, if there is one."""
        error, self.error = self.error, None
        if error is not None:
            raise error

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Raise the exception of a callback at the end of a ``with`` block, outside of steps."""
        self.require_open()
        before, self.error = (self.error, self.c.raised), None
        try:
            yield
            self.synchronize()
        finally:
            self.error, self.c.raised = before

    def handle(self, function: Any) -> Any:
        """Return a handle of a function for C."""
        self._alive.append(ffi.new_handle((self, function)))
        return self._alive[-1]


def _record_error(kind: type, error: BaseException, traceback: Any) -> None:
    """Store an exception of a callback, and let C end the step on all processes.

    The handle is read from the arguments of the callback, because an interrupt may come before the
    first line of the callback.
    """
    callbacks, _ = ffi.from_handle(traceback.tb_frame.f_locals["handle"])
    failed = isinstance(error, StepFailed)
    if callbacks.error is None or isinstance(callbacks.error, StepFailed):
        callbacks.error = error.with_traceback(traceback)
    callbacks.c.raised = max(callbacks.c.raised, 1 if failed else 2)


def from_c(
    error: float | None = None, name: str | None = None
) -> Callable[[Callable[..., Any]], Any]:
    """Decorate a callback that c_library.py declares; it returns ``error`` after an exception."""
    more = {} if error is None else {"error": error}
    declared: Any = ffi.def_extern(name=name, onerror=_record_error, **more)
    return declared  # type: ignore[no-any-return]


@from_c(math.nan)
def time_in_python(handle: Any, t: float) -> float:
    """Return the value of a function of time at ``t``."""
    return float(ffi.from_handle(handle)[1](t))


def call_in_python(handle: Any, *arguments: Any) -> None:
    """Call a Python function for C; callbacks of three signatures use this function."""
    ffi.from_handle(handle)[1](*arguments)


for _name in ("run", "begin", "phase"):
    from_c(name=f"{_name}_in_python")(call_in_python)
