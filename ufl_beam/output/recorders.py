# SPDX-License-Identifier: MIT
"""Recorders of runs: base class and checks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from ufl_beam.arrays import State
from ufl_beam.errors import SceneError, require_sequence, shorten
from ufl_beam.model.signatures import unlike
from ufl_beam.output.output_files import Output, require_apart, require_writable
from ufl_beam.output.state_view import StateView
from ufl_beam.parallel import on_first


class Recorder(ABC):
    """Base class of recorders, which see each accepted step; called by all processes together.

    Example:
        >>> class Speed(ub.Recorder):
        ...     def open(self, simulation):
        ...         self.largest = 0.0
        ...     def write(self, simulation):
        ...         self.largest = max(self.largest, abs(simulation.velocity(beam.end)[1]))
        >>> run = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05, record=Speed())
    """

    def __repr__(self) -> str:
        return f"<{' '.join([type(self).__name__, *map(str, self.files)])}>"

    @property
    def by_itself(self) -> bool:
        """True if it needs no call of :meth:`write` after steps, once it is open."""
        return False

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that it writes: two outputs of a run must not share one."""
        return ()

    def require_writable(self) -> None:
        """Raise :class:`SceneError` if a file cannot be written; the first process asks."""
        for path in self.files:
            require_writable(path)

    @abstractmethod
    def open(self, simulation: StateView) -> None:
        """Begin, with the initial state."""

    @abstractmethod
    def write(self, simulation: StateView) -> None:
        """Record the state after a step."""

    def close(self) -> None:
        """End the record; also called when the run fails."""

    def state(self) -> State:
        """Return the arrays for :meth:`resume`, by name; those of the first process count.

        Raises:
            SceneError: The recorder has none.
        """
        raise SceneError(
            f"{type(self).__name__}: this recorder cannot go on from a checkpoint; give it methods "
            "state() and resume(simulation, state), or run without a checkpoint"
        )

    def resume(self, simulation: StateView, state: State) -> None:
        """Go on from a :meth:`state`, in the place of :meth:`open`; nothing is recorded yet.

        Raises:
            SceneError: What was written before is not there any more.
        """
        self.state()


def recorders_of(
    record: Sequence[Recorder] | Recorder, comm: MPI.Intracomm, call: str, *others: Output
) -> tuple[tuple[Recorder, ...], list[Output]]:
    """Check the recorders of a run; return them, and all its outputs with the others."""
    recorders = (record,) if isinstance(record, Recorder) else require_sequence(record, "record")
    outputs = []
    for i, recorder in enumerate(recorders):
        name = f"record[{i}]"
        if not isinstance(recorder, Recorder):
            raise SceneError(
                f"{call}: {name} = {shorten(recorder)} is not a Recorder; classes of your own are "
                "derived from ub.Recorder"
            )
        if why := unlike(recorder, Recorder):
            kind = type(recorder).__name__
            raise SceneError(f"{call}: {name}: {kind} is not a recorder: {why}")
        first = next(k for k, one in enumerate(recorders) if one is recorder)
        if first != i:
            raise SceneError(
                f"{call}: record[{first}] and {name} are the same {type(recorder).__name__}; "
                "leave one out"
            )
        on_first(comm, recorder.require_writable)
        outputs.append((f"{name} ({type(recorder).__name__})", recorder.files))
    outputs += others
    on_first(comm, lambda: require_apart(outputs, call))
    return recorders, outputs
