# SPDX-License-Identifier: MIT
"""Connectors whose forces are Python functions of a user.

A function returns a force, which may depend on the history and may have any slope.  C calls it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its submodules at their first use

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import BlockSetting, InTime
from ufl_beam.blocks.connectors import ConnectorBlock, Data, OnConnector, Step
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import fill, lib
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.errors import ModelError, NoNumber, shorten
from ufl_beam.model.checks import require_returned
from ufl_beam.model.connector_law import ForceLaw
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.derivatives import Neighbours
from ufl_beam.terms.term import Callbacks, Phases

OVERSHOOT = 0.5
"""Ratio of residuals of successive iterates above which an iteration has overshot.

At a root of order n, Newton's method multiplies a residual by (1 - 1/n)ⁿ, which is below 1/e.
"""

DIGITS = 1e-8
"""Fraction of the force above which a difference of forces has enough digits for a slope."""

DIFFERENCE = 6e-6
"""Relative increment at which central differences have the least error: ∛(round-off)."""


RELATIVE_STEP = 2.0**-13
"""Step of five-point differences, as a fraction of the change or of the size of an input."""

LEAST_CHANGE = 1e-3
"""Least change of an input in a step that differences resolve, as a fraction of its size."""

ALIKE = 1e-8  # relative difference of derivatives by small and large steps that counts as round-off


def _five_point(function: Callable[[float], Array], change: float, size: float) -> Array:
    """Return the derivative of a function at zero, for an argument of a change and a size.

    Differences with a step in proportion to the size have less round-off than those in proportion
    to the change; they are taken if both agree, as they do for laws without kinks.
    """
    found = []
    for scale in (change, size):
        h = RELATIVE_STEP * scale
        far, close = (function(k * h) - function(-k * h) for k in (2, 1))
        found.append((8.0 * close - far) / (12.0 * h))
    small, large = found
    return np.where(np.abs(large - small) <= ALIKE * np.abs(small), large, small)


class Iterate(NamedTuple):
    """Motion and force of a connector in an iterate, and data of its law."""

    e: float  # motion; m or rad
    λ: float  # force; N or N m
    residual: float  # force of the law at the motion, less λ
    at: float  # motion about which the law was linearized; m or rad


class UserLaw:
    """Law of a connector in a step, stated by functions of a user.

    Attributes:
        state: Internal variables of the accepted state; :class:`FunctionBlock` writes them.
        last: Previous iterate of this step; None in the first iterate.
        energy: Function that returns the recoverable energy; None if the law has no such function.
        known: Time t (s), length dt (s) and initial state of the step.
        begun: Arguments of :meth:`begin` in this step.
    """

    def __init__(
        self, connector: Connector, law: ForceLaw, size: float, load_weight: float, state: Array
    ) -> None:
        self._connector, self._law, self._arguments = connector, law.force, law.arguments
        self._small, self._weight = 1e-3 * size, load_weight
        self.energy, self._stored_arguments = law.stored, law.stored_arguments
        self._e0, self._dt, self.known = 0.0, 1.0, dict[str, Any]()
        self.begun = 0.0, 0.0, 1.0
        self.last: Iterate | None = None
        self.state = state
        state[:] = law.state

    def begin(self, e0: float, t: float, dt: float) -> None:
        """Begin a step of ``dt`` (s) at the motion ``e0``; the law acts at the time ``t`` (s)."""
        self.begun, self._e0, self._dt = (e0, t, dt), e0, dt
        state = self.state.copy()
        state.flags.writeable = False  # all iterates begin with the same state
        self.known = {"t": t, "dt": dt, "state": state}
        self.last = None

    # -- the functions -------------------------------------------------------------------------

    def force(self, e1: float) -> float:
        """Return the force, N or N m, if the step ends at the motion ``e1``."""
        return self.end(e1)[0]

    def end(self, e1: float) -> tuple[float, Array]:
        """Return force and internal variables if the step ends at the motion ``e1``."""
        motion = (1.0 - self._weight) * self._e0 + self._weight * e1
        return self._evaluate(motion, (e1 - self._e0) / self._dt, self.known)

    def _evaluate(
        self, motion: float, rate: float, known: Mapping[str, Any]
    ) -> tuple[float, Array]:
        """Return force and internal variables after the step."""
        state = self.state
        if not self._arguments:
            value = self._law(motion, rate)
        else:
            value = self._law(motion, rate, **{name: known[name] for name in self._arguments})
            if state.size:
                value, state = self._pair(value)
        if isinstance(value, float) and math.isfinite(value) and not self.state.size:
            return value, state
        at = f"motion = {motion:.6g}, rate = {rate:.6g}, t = {self.known['t']:.9g} s"
        force = require_returned(value, f"{self._connector}: the function", at)
        for number in (force, *map(float, state)):
            if not math.isfinite(number):  # NoNumber shortens the step, which may avoid the motion
                raise NoNumber(f"{self._connector}: the function returned {number} at {at}")
        return force, state

    def _pair(self, returned: Any) -> tuple[Any, Array]:
        try:
            force, state = returned
            state = np.array(state, dtype=np.float64).reshape(self.state.shape)
        except (TypeError, ValueError):
            raise ModelError(
                f"{self._connector}: the function returned {shorten(returned)}; it must return the "
                f"force and the state, a list of {self.state.size} numbers"
            ) from None
        return force, state

    def stored(self, motion: float) -> float:
        """Return the recoverable energy at a motion; J."""
        if self.energy is None:
            return 0.0
        value = self.energy(motion, **dict.fromkeys(self._stored_arguments, self.state.copy()))
        t = f", t = {self.known['t']:.9g} s" if self.known else ""
        at = f"motion = {motion:.6g}{t}"
        return require_returned(value, f"{self._connector}: the energy", at, finite=True)

    # -- derivatives of a step -----------------------------------------------------------------

    def outputs(self, e1: float) -> Array:
        """Return force and internal variables as :meth:`end`; (1 + number of variables,)."""
        force, state = self.end(e1)
        return np.array([force, *state])

    def table(self, e1: float) -> Array:
        """Return the derivatives of :meth:`outputs` by e1, by e0 and by the variables before."""
        weight, dt, before = self._weight, self._dt, self.state.copy()
        motion, rate = (1.0 - weight) * self._e0 + weight * e1, (e1 - self._e0) / dt
        after = self.end(e1)[1]
        size = max(abs(motion), self._small)  # of the motion

        def by(change: float, size: float, *direction: Any) -> Array:
            """Differentiate along changes of motion, rate and variables."""

            def along(step: float) -> Array:
                a, b, c = direction
                known = {**self.known, "state": before + step * c}
                force, state = self._evaluate(motion + step * a, rate + step * b, known)
                return np.array([force, *state])

            return _five_point(along, max(abs(change), LEAST_CHANGE * size), size)

        by_motion = by(e1 - self._e0, size, 1.0, 0.0, 0.0)
        by_rate: Array = np.zeros(1 + len(before))
        if math.isfinite(dt):  # a path takes infinite time, in which rates do not change
            by_rate = by(rate, max(abs(rate), size / dt), 0.0, 1.0, 0.0)
        columns = [weight * by_motion + by_rate / dt, (1.0 - weight) * by_motion - by_rate / dt]
        for direction, old, new in zip(np.eye(len(before)), before, after, strict=True):
            largest = max(abs(old), abs(new), size)
            columns.append(by(new - old, largest, 0.0, 0.0, direction))
        return np.column_stack(columns)

    # -- the law around an iterate -------------------------------------------------------------

    def line(self, e: float, λ: float) -> tuple[float, float]:
        """Return slope and intercept of the linearized law at an iterate (``e``, ``λ``)."""
        force, last = self.force(e), self.last
        residual, at = force - λ, e
        if last is not None and abs(residual) > OVERSHOOT * abs(last.residual) and e != last.e:
            at = self._meeting(e, λ, last)
            force = force if at == e else self.force(at)
        slope = self._slope(at, force)
        self.last = Iterate(e, λ, residual, at)
        return slope, force - slope * at

    def _meeting(self, e: float, λ: float, last: Iterate) -> float:
        """Return the motion about which the law is linearized after an overshoot.

        Where the slope of a law is infinite, Newton's method oscillates for ever.  The line through
        motions and forces of the two latest iterates approximates the rest of the scene.  The law
        is linearized at its intersection with this line, if the intersection is between ``e`` and
        the previous motion ``last.at``.
        """
        stiffness = max(0.0, (last.λ - λ) / (e - last.e))

        def excess(x: float) -> float:
            return self.force(x) - λ + stiffness * (x - e)

        excess_now, excess_last = excess(e), excess(last.at)
        if not (excess_now < 0.0 < excess_last or excess_last < 0.0 < excess_now):
            return e
        return float(scipy.optimize.brentq(excess, e, last.at, xtol=1e-300, maxiter=2000))

    def _slope(self, e: float, force: float) -> float:
        """Return the derivative of the force at ``e`` by central differences.

        The increment is proportional to the change of the motion in the step, but at least to a
        thousandth of the motion and a millionth of the scene.  At zero motion the slope may be
        infinite.  Near zero a smaller increment, proportional to the motion in this or the previous
        iterate, is therefore used if the difference of forces has enough digits.
        """
        ε = DIFFERENCE * max(abs(e - self._e0), 1e-3 * max(abs(e), self._small))
        ε_motion = DIFFERENCE * max(abs(e), 0.0 if self.last is None else abs(self.last.at))
        if 0.0 < ε_motion < ε:
            change = self.force(e + ε_motion) - self.force(e - ε_motion)
            if abs(change) > DIGITS * abs(force):
                return change / (2 * ε_motion)
        return (self.force(e + ε) - self.force(e - ε)) / (2 * ε)

    def bend(self, e: float) -> float:
        """Return minus the second derivative of the force by a fourth-order difference.

        The increment is a thousandth of the size of the scene, or of a radian.  The relative error
        is below 1e-8 if the slope changes over a thirtieth of that size or more.  Round-off adds
        about 1e-10 of the force divided by the square of that size.
        """
        ε, weights = self._small, (-1.0, 16.0, -30.0, 16.0, -1.0)
        forces = [w * self.force(e + k * ε) for k, w in zip(range(-2, 3), weights, strict=True)]
        return -sum(forces) / (12 * ε**2)


# -- connectors ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OfFunctions(OnConnector):
    """Force of a function, linearized about the iterate; the function also returns a new state.

    The line, the new state and its derivatives are modes, which :class:`FunctionBlock` sets.  The
    "shifts" are zero; derivatives by parameters of the functions are derivatives by these.

    Attributes:
        variables: Number of internal variables of a connector.
    """

    variables: int
    of_step = "dt", "wanted"

    @cached_property
    def data(self) -> Data:
        """See the base class; "e" is the motion."""
        variables = *(f"state {k}" for k in range(self.variables)), "energy", "e"
        shifts = [f"shift {k}" for k in range(1 + self.variables)]
        return Data(shifts, dict.fromkeys(variables, 0.0))

    def values(self, connector: Any, setting: BlockSetting) -> tuple[Sequence[float], Any]:
        """See the base class; the function acts at the number "wanted"."""
        return super().values(connector, setting)[0], InTime(None, connector, "now")

    @property
    def modes(self) -> list[str]:
        """Line of the force and its change; new state; derivatives by e1, e0 and the variables."""
        rows, columns = range(1 + self.variables), range(2 + self.variables)
        table = (f"slope {i} {j}" for i in rows for j in columns)
        new = (f"new {k}" for k in range(self.variables))
        return ["force", "bend", "new energy", *new, *table]

    def law(self, at: Inputs, step: Step) -> Equations:
        """See the base class."""
        (e0,), (e1,), (work,) = step.e0, step.e1, step.work
        before = [at[f"state {k}"] for k in range(self.variables)]

        def line(row: int, slope: Any, moved: Any) -> Any:
            more = sum(at[f"slope {row} {2 + k}"] * z for k, z in enumerate(before))
            return slope * moved + at[f"slope {row} 1"] * e0 + more + at[f"shift {row}"]

        # The slope of the force changes with the motion; a product with zero has that derivative
        slope = at.stage(at["slope 0 0"], at["bend"] / 2 * e1)
        still = at.stage(e1, 0.0)
        force = at.stage(at["force"], line(0, slope, e1 - still))
        new = [
            at.stage(at[f"new {k}"], line(1 + k, at[f"slope {1 + k} 0"], e1))
            for k in range(self.variables)
        ]
        energy = at["new energy"]
        state = {f"state {k}": x for k, x in enumerate(new)} | {"energy": energy, "e": e1}
        lost = {"functions": work - (energy - at["energy"])}
        return Equations([step.λ[0] - force], state, {"stored": energy}, lost)


class FunctionBlock(ConnectorBlock):
    """Connectors with forces by user functions, with equal numbers of internal variables."""

    def __init__(self, statement: OfFunctions, *arguments: Any) -> None:
        super().__init__(statement, *arguments)
        v, size = statement.variables, self._subdomain.numbering.scene.size
        first, weight = statement.state.index("energy") - v, statement.scheme.load_weight
        laws: list[Any] = [c.law for c in self.connectors]
        self._laws = [
            UserLaw(
                c, laws[i], 1.0 if c.is_rotation else size, weight,
                self._states[i // BATCH, first : first + v, i % BATCH],
            )
            for i, c in enumerate(self.connectors)
        ]  # fmt: skip

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class; C calls the functions in each residual."""
        fill(self._c, ask=lib.run_in_python, asked=callbacks.handle(self._find_lines))
        made = super().phases(callbacks)
        if not any(law.state.size or law.energy for law in self._laws):
            return made
        return made._replace(accept=[callbacks.phase(self._accept), *made.accept])

    def _now(self, name: str) -> list[float]:
        """Return an input of each connector."""
        found: list[float] = self.input(name).ravel().tolist()
        return found[: len(self._laws)]

    def _motions(self) -> list[float]:
        """Return the motions of which C has computed the outputs at the end of a step."""
        outputs = self._kernels.end.outputs
        ends = self._out[: len(self._w) * outputs * BATCH].reshape(-1, outputs, BATCH)
        found: list[float] = ends[:, len(self.statement.state)].ravel().tolist()
        return found[: len(self._laws)]

    def _begin_laws(self) -> None:
        """Begin a step in all laws."""
        begun = zip(self._laws, *map(self._now, ("e", "wanted", "dt")), strict=True)
        for law, e0, t, dt in begun:
            law.begin(e0, t, dt)

    def _find_lines(self) -> None:
        """Linearize the laws about the iterate, for C."""
        if any(self._now("fresh")):
            self._begin_laws()
        force, slopes = self.input("force"), self.input("slope 0 0")
        force.fill(math.nan)  # remains if a function raises an exception
        iterates = zip(self._laws, self._motions(), self._now("q1 force0"), strict=True)
        for i, (law, e1, λ) in enumerate(iterates):
            at = divmod(i, BATCH)
            slopes[at], intercept = law.line(e1, λ)
            force[at] = intercept + slopes[at] * e1

    def _accept(self, step: Any, q1: Any, s: Any) -> None:
        """Set new variables and energies, before any other term accepts the step."""
        lib.end_step_of_block(self._c, q1, lib.COMPUTE)
        for i, (law, e1) in enumerate(zip(self._laws, self._motions(), strict=True)):
            old, at = law.state.copy(), divmod(i, BATCH)
            new = law.end(e1)[1]
            for k, value in enumerate(new):
                self.input(f"new {k}")[at] = value
            law.state[:] = new
            try:
                self.input("new energy")[at] = law.stored(e1)
            finally:
                law.state[:] = old

    def start(self, q: Array) -> None:
        """See the base class: compute the stored energies of the accepted variables."""
        for i, (law, e) in enumerate(zip(self._laws, self.motion_at_begin(q), strict=True)):
            at = divmod(i, BATCH)
            self.state["e"][at] = e
            self.state["energy"][at] = self.input("new energy")[at] = law.stored(float(e))
        super().start(q)

    def resume(self, q: Array) -> None:
        """See the base class."""
        self.start(q)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """See the base class."""
        bend = self.input("bend")
        for i, (law, e) in enumerate(zip(self._laws, self.motion(q1), strict=True)):
            bend[divmod(i, BATCH)] = -law.bend(float(e))
        super().add_tangent_change(q1, u)
        bend.fill(0.0)

    def complete_derivatives(self, c: Any, neighbours: Neighbours, by_number: Array) -> None:
        """Let C call a function that computes tables of the laws by differences."""
        v = self._laws[0].state.size if self._laws else 0

        def tabulate() -> None:
            self._begin_laws()
            for i, (law, e1) in enumerate(zip(self._laws, self._motions(), strict=True)):
                batch, lane = divmod(i, BATCH)
                for (row, column), slope in np.ndenumerate(law.table(e1)):
                    self.input(f"slope {row} {column}")[batch, lane] = slope
                outputs, (e0, t, dt) = law.outputs(e1), law.begun
                for p, others in enumerate(neighbours.terms):
                    change = np.zeros(len(outputs))
                    for other, weight in zip(others, neighbours.weights[p], strict=True):
                        mine = other._laws[i]
                        mine.state[:] = law.state
                        mine.begin(e0, t, dt)
                        change += weight * (mine.outputs(e1) - outputs)
                    by_number[p, batch, : len(outputs), lane] = change

        fill(
            c, tabulate=lib.run_in_python, user=self.callbacks.handle(tabulate),
            shifts=1 + v,
        )  # fmt: skip
