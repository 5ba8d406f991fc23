# SPDX-License-Identifier: MIT
"""Connector laws: compiled laws of energy, resistance or a limit, and Python functions of a user.

A function of a user returns a force, which may depend on the history and may have any slope.  C
calls the function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its submodules at their first use
import ufl
from ufl.algorithms import expand_derivatives
from ufl.constantvalue import Zero
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, in_order, lib, struct
from ufl_beam.discretization.compiled_forms import Pointwise, cached_forms, with_shared_nodes
from ufl_beam.errors import ModelError, NoNumber, shorten
from ufl_beam.mechanics.connector_equations import law_step
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.checks import require_returned
from ufl_beam.model.connector_law import ConnectorLaw, ForceLaw
from ufl_beam.model.connectors import Connector
from ufl_beam.model.material_law import State, traced
from ufl_beam.terms.connector_rows import Response, Setting
from ufl_beam.terms.derivatives import Each, Neighbours, margins
from ufl_beam.terms.term import Callbacks

# -- energy and resistance -------------------------------------------------------------------------


STEP_INPUTS = ("motion 0", "before 0", "dt", "theta")
"""Inputs of a law of one motion in the order of loops.h, before the variables."""


def inputs(law: ConnectorLaw) -> tuple[str, ...]:
    """Return the names of the inputs of a compiled law in the order of loops.h."""
    motions = (f"{when} {i}" for when in ("motion", "before") for i in range(law.components))
    data = (
        *(f"state {name}" for name in law.variables),
        *(f"number {n}" for n in law.parameters()),
    )
    return (*motions, "dt", "theta", *data)


class LawForms:
    """C functions of a connector law; the parameters of the law are inputs of the functions.

    Attributes:
        force: Forces and their derivatives with respect to the motions at the end of the step.
        end: ``law_output`` of loops.h, then the variables at the end.
        limit: Force up to which a constraint holds the motion; N or N m.
    """

    def __init__(self, law: ConnectorLaw, scheme: Scheme) -> None:
        self._law, self._scheme, self._pointwise = law, scheme, Pointwise(inputs(law))
        at, motions = self._pointwise.at, [f"motion {i}" for i in range(law.components)]
        self._at = at | {name: ufl.variable(at[name]) for name in motions}
        self._motions = [self._at[name] for name in motions]
        with traced(law):
            forces, *energies, variables = law_step(law, self._at, scheme)
            self.force = self._compile(*forces, *self._slopes(forces))
            by_name = dict(zip(("stored", "numerical"), energies, strict=True))
            end = in_order("law_output", by_name, "law_")
            self.end = self._compile(*end, *variables)
            old = State({name: at[f"state {name}"] for name in law.variables})
            parameters = {name: at[f"number {name}"] for name in law.parameters()}
            self.limit = self._compile(ufl.as_ufl(law.with_parameters(parameters).limit(old)))

    @cached_property
    def table(self) -> tuple[Any, list[str], dict[str, int]]:
        """Derivatives of forces and variables at the end with respect to the inputs, see loops.h.

        Returns:
            A C function, the inputs by which it differentiates, and numbers of
            ``connector_derivatives`` of loops.h.
        """
        by = [name for name in self._at if name not in ("dt", "theta")]
        at = self._at | {name: ufl.variable(self._pointwise.at[name]) for name in by}
        with traced(self._law):
            step = law_step(self._law, at, self._scheme)
            old = State({name: at[f"state {name}"] for name in self._law.variables})
            numbers = {name: at[f"number {name}"] for name in self._law.parameters()}
            limits = [self._law.with_parameters(numbers).limit(old)] * self._law.holds
        ends = with_shared_nodes([*map(ufl.as_ufl, (*step.forces, *step.variables, *limits))])
        conditions = margins(ends)
        slopes = [ufl.diff(x, at[name]) for x in (*ends, *conditions) for name in by]
        sizes = {
            "rows": len(ends) + len(conditions), "columns": len(by), "margins": len(conditions),
            "outputs": len(slopes) + len(conditions),
        }  # fmt: skip
        return self._pointwise.compile(*slopes, *conditions), by, sizes

    @cached_property
    def frozen(self) -> tuple[Any, Any]:
        """Two C functions at constant variables: forces and derivatives; second derivatives."""
        forces = law_step(self._law, self._at, self._scheme, frozen=True).forces
        slopes = self._slopes(forces)
        return self._compile(*forces, *slopes), self._compile(*self._slopes(slopes))

    def _slopes(self, values: Sequence[Expr]) -> list[Expr]:
        """Return derivatives of each value with respect to all motions."""
        return [ufl.diff(value, motion) for value in values for motion in self._motions]

    def _compile(self, *outputs: Expr) -> Any:
        """Compile a function; return a null pointer if all its outputs are zero."""
        outputs = tuple(map(expand_derivatives, outputs))
        zero = all(isinstance(output, Zero) for output in outputs)
        return ffi.NULL if zero else self._pointwise.compile(*outputs)


_law_forms = cached_forms(LawForms)


SMALL_MOTION = 1e-6
"""Motion for the elastic stiffness of a law; rad, or fraction of the size of the scene."""


class CompiledLaws(Response):
    """Connectors with laws of one class; each law has its own parameters."""

    def __init__(
        self, law: ConnectorLaw, connectors: Sequence[Connector], setting: Setting
    ) -> None:
        super().__init__(connectors, setting, f"{type(law).__qualname__}{[*law.variables]}")
        scheme, ledger, k = setting.scheme, setting.ledger, law.components
        n = len(connectors) // k
        self._law, self._components = law, k
        self._enter(stored=(ledger.state, "stored"))
        if not law.elastic:
            self._enter(lost=(ledger.lost, law.entry))
        if scheme.weight_of_before == 0.0 and scheme.load_weight > 0.5:
            self._enter(numerical=(ledger.lost, "numerical"))
        columns = inputs(law)
        w = self._w = np.zeros((n, len(columns)))
        self._at = at = {name: w[:, k] for k, name in enumerate(columns)}
        at["theta"][:], at["dt"][:] = scheme.theta, 1.0
        for name, value in law.variables.items():
            at[f"state {name}"][:] = value
        for name in law.parameters():
            at[f"number {name}"][:] = [x.parameters()[name] for x in self._laws[::k]]
        self._stored, lost = np.zeros(n), np.zeros(n * k)  # the first component has the loss
        self.dissipated = (lost,)
        variables = [at[f"state {name}"] for name in law.variables]
        self._variables = [*variables, self._stored, lost[::k]]
        self._forms = _law_forms(law.with_parameters(dict.fromkeys(law.parameters(), 1.0)), scheme)
        self._answer = np.zeros(int(lib.LAW_OUTPUTS) + len(law.variables))
        self._c = struct(
            "connector_laws", width=len(columns), variables=len(law.variables), w=w,
            force=self._forms.force, end=self._forms.end, loses=not law.elastic,
            along_path=int(law.rate_independent and scheme.weight_of_before > 0.0),
            stored=self._stored, lost=lost, answer=self._answer, sum=np.zeros(2),
        )  # fmt: skip
        self.in_c = {"laws": self._c}
        if law.variables:
            self.stiffness[:] = self._elastic_stiffness()
        if law.holds:
            self._limits = np.zeros(n)
            places = [doubles(self._limits) + i for i in range(n)]
            self._rub(places, laws=self._c, limit_of_law=self._forms.limit)

    def derivatives(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array
    ) -> list[Each] | None:
        """See the base class."""
        storage = lambda laws: laws._w  # noqa: E731
        table = self._table_in_c(neighbours, self._forms.table, inputs(self._law), storage)
        variables = len(self._law.variables)
        table |= {"variables": variables, "variables_at_end": np.zeros(variables)}
        if self._law.holds:
            limits = np.zeros((len(neighbours), len(self._connectors)))
            if (friction := self._friction_in_c(neighbours, term, motions, limits)) is None:
                return None
            table |= friction
        return self._derivatives_in_c(neighbours, term, motions, row, **table)

    def bind_term(self, term: Any) -> None:
        """Store the array of the latest rows of the laws."""
        super().bind_term(term)
        self._rows = term.latest_rows

    def remaining(self) -> Array:
        """Return the remaining fraction of elastic stiffness in the iterate; (num_connectors,)."""
        k = self._components
        slopes = -np.einsum("ijj->ij", self._rows.reshape(-1, k, k + 2)[:, :, :k]).ravel()
        whole = np.ones(len(slopes))
        return np.asarray(np.divide(slopes, self.stiffness, out=whole, where=self.stiffness > 0))

    def bends(self, e1: Array) -> Array:
        """Return minus the second derivatives of the forces at constant variables.

        The result is zero for laws with a limit.  This is exact for sticking connectors, whose rows
        are constant, and neglects the second derivatives of sliding forces.
        """
        if self._law.holds:
            return super().bends(e1)
        k = self._components
        self._w[:, :k] = e1.reshape(-1, k)
        bends = np.zeros((len(self._w), k**3))
        for w, bend in zip(self._w, bends, strict=True):
            lib.ask_law(self._forms.frozen[1], doubles(w), k**3, doubles(bend))
        return -bends

    def _accepted_state(self) -> tuple[ConnectorLaw, list[Array], State]:
        """Return the law with all parameters, and the accepted motions and variables."""
        law, at = self._law, self._at
        laws = law.with_parameters({name: at[f"number {name}"] for name in law.parameters()})
        motions = [at[f"before {i}"] for i in range(law.components)]
        return laws, motions, State({name: at[f"state {name}"] for name in law.variables})

    def _elastic_stiffness(self) -> Array:
        """Return the derivatives of elastic forces by their motions at rest; (num_connectors,)."""
        law, rest, variables = self._accepted_state()
        moved = SMALL_MOTION * self._lengths.reshape(-1, law.components).T
        forces = law.elastic_forces(rest, variables)
        slopes = np.empty_like(moved)
        for i, δ in enumerate(moved):
            motions = [*rest[:i], rest[i] + δ, *rest[i + 1 :]]
            slopes[i] = np.abs(law.elastic_forces(motions, variables)[i] - forces[i]) / δ
        return slopes.T.ravel()

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Return the energy that rate-independent laws dissipate in a static step to ``e1``; J.

        The work is computed by the trapezoidal rule.  Round-off of an elastic step is no loss.
        """
        if not self._law.rate_independent:
            return 0.0
        k, total = self._components, 0.0
        slopes = k + k * k  # forces, and their derivatives
        f0, f1, end = np.zeros(slopes), np.zeros(slopes), self._answer
        for w, now, stored in zip(self._w, e1.reshape(-1, k), self._stored, strict=True):
            for motion, forces in ((w[k : 2 * k], f0), (now, f1)):
                w[:k] = motion
                lib.ask_law(self._forms.force, doubles(w), slopes, doubles(forces))
            lib.ask_law(self._forms.end, doubles(w), len(end), doubles(end))
            mean, change = (f0 + f1)[:k] / 2, now - w[k : 2 * k]
            lost = mean @ change - (end[lib.LAW_STORED] - stored)
            if lost > 1e-12 * (np.abs(mean) @ np.abs(change)):
                total += lost
        return total

    def start(self, e: Array) -> None:
        """Set the accepted motions to ``e``, without a step, and compute the stored energies."""
        k = self._components
        self._w[:, k : 2 * k] = e.reshape(-1, k)
        with np.errstate(all="ignore"):
            law, motions, variables = self._accepted_state()
            self._stored[:] = law.energy(law.as_argument(motions), variables)

    def borne(self) -> Array | None:
        """Return the elastic forces after :meth:`start`; None for laws with a limit."""
        if self._law.holds:
            return None
        law, motions, variables = self._accepted_state()
        return np.column_stack(law.elastic_forces(motions, variables)).ravel()

    def freeze(self) -> None:
        """Keep internal variables constant from now on, except in laws with a limit."""
        if not self._law.holds:
            fill(self._c, force=self._forms.frozen[0])


# -- functions of a user ---------------------------------------------------------------------------

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
        state: Internal variables of the accepted state; :meth:`UserLaws.accept_end` writes them.
        last: Previous iterate of this step; None in the first iterate.
        energy: Function that returns the recoverable energy; None if the law has no such function.
        known: Time t (s), length dt (s) and initial state of the step.
    """

    def __init__(
        self, connector: Connector, law: ForceLaw, size: float, load_weight: float, state: Array
    ) -> None:
        self._connector, self._law, self._arguments = connector, law.force, law.arguments
        self._small, self._weight = 1e-3 * size, load_weight
        self.energy, self._stored_arguments = law.stored, law.stored_arguments
        self._e0, self._dt, self.known = 0.0, 1.0, dict[str, Any]()
        self.last: Iterate | None = None
        self.state = state
        state[:] = law.state

    def begin(self, e0: float, t: float, dt: float) -> None:
        """Begin a step of ``dt`` (s) at the motion ``e0``; the law acts at the time ``t`` (s)."""
        self._e0, self._dt = e0, dt
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


class UserLaws(Response):
    """Connectors with forces by user functions, with equal numbers of internal variables."""

    def __init__(self, law: ForceLaw, connectors: Sequence[Connector], setting: Setting) -> None:
        super().__init__(connectors, setting, "AskedLaws")
        n, ledger = len(connectors), setting.ledger
        self._work = ledger.lost, "functions"
        self._enter(entry=self._work, stored=(ledger.state, "stored"))
        self._in_steps["sign"] = 1.0
        first, weight = len(STEP_INPUTS), setting.scheme.load_weight
        self._storage = np.zeros((n, first + len(law.state)))  # inputs; only the variables are used
        states: Any = self._storage[:, first:]
        self._variables = list(states.T)
        arguments = zip(connectors, self._laws, self._lengths, states, strict=True)
        self._each = [
            UserLaw(connector, record, size, weight, x) for connector, record, size, x in arguments
        ]
        self.needs_accept_end = any(law.state.size or law.energy for law in self._each)
        self._stored, self._force = np.zeros(1), np.zeros(n)
        self._c = struct("called_laws", force=self._force, held=self._stored)
        self.in_c = {"asked": self._c}

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """Return fields as :class:`Response` does, and set the functions that C calls."""
        c, handle = self._c, callbacks.handle
        fill(c, begin=lib.begin_in_python, find_rows=lib.run_in_python, again=lib.run_in_python)
        c.begin_self, c.rows_self = handle(self._begin), handle(self._find_rows)
        c.again_self = handle(self._again)
        return super().in_steps(callbacks)

    def derivatives(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array
    ) -> list[Each] | None:
        """See the base class; differences of the functions make a table of each law."""
        n, variables = len(self._connectors), len(self._variables)
        w = neighbours.state(lambda term: term.response._storage)
        columns = [0, 1, *range(len(STEP_INPUTS), w.shape[2])]
        J = np.zeros((n, 1 + variables, len(columns)))
        by_parameter = np.zeros((len(neighbours), n, 1 + variables))

        def tabulate() -> None:
            motions = self._e0.tolist(), self._e1.tolist()
            for i, (law, e0, e1) in enumerate(zip(self._each, *motions, strict=True)):
                J[i] = law.table(e1)
                outputs, (t, dt) = law.outputs(e1), (law.known[name] for name in ("t", "dt"))
                for p, others in enumerate(neighbours.terms):
                    by_parameter[p, i] = 0.0
                    for other, weight in zip(others, neighbours.weights[p], strict=True):
                        mine = other.response._each[i]
                        mine.state[:] = law.state
                        mine.begin(e0, t, dt)
                        by_parameter[p, i] += weight * (mine.outputs(e1) - outputs)

        return self._derivatives_in_c(
            neighbours, term, motions, row, J=J, rows=1 + variables, columns=len(columns),
            outputs=J[0].size, column=np.array(columns, dtype=np.int32), width=w.shape[2],
            variables=variables, variables_at_end=np.zeros(variables), by_parameter=by_parameter,
            w=w, w_bar=np.zeros(w[0].shape), tabulate_user=lib.run_in_python,
            user=term.callbacks.handle(tabulate),
        )  # fmt: skip

    def bind_term(self, term: Any) -> None:
        """Store references to the motions, accepted and latest, and to the latest rows of laws."""
        (self._e0, self._e1), self._rows = term.motions, term.latest_rows

    def _begin(self, t: float, dt: float) -> None:
        for law, e0 in zip(self._each, self._e0.tolist(), strict=True):
            law.begin(e0, t, dt)

    def _again(self) -> None:
        for law in self._each:
            law.last = None

    def _find_rows(self) -> None:
        """Write the laws, linearized about the iterate, into the rows of C."""
        self._rows[:, 2] = math.nan  # remains if a function raises an exception
        motions = zip(self._each, self._e1.tolist(), self._force.tolist(), strict=True)
        for row, (law, e1, λ) in zip(self._rows, motions, strict=True):
            slope, intercept = law.line(e1, λ)
            row[:] = -slope, 1.0, intercept

    def bends(self, e1: Array) -> Array:
        """Return minus the second derivatives of the forces; (num_connectors,)."""
        return np.array([law.bend(e1[i]) for i, law in enumerate(self._each)])

    def accept_end(self, e1: Array) -> None:
        """Accept the variables after a step to ``e1``; the growth of stored energy is no loss."""
        states = [law.end(float(x))[1] for law, x in zip(self._each, e1, strict=True)]
        before = float(self._stored[0])
        for law, state in zip(self._each, states, strict=True):
            law.state[:] = state
        self.start(e1)
        account, entry = self._work
        account[entry] -= float(self._stored[0]) - before

    def start(self, e: Array) -> None:
        """Compute the energy stored at the motions ``e``."""
        self._stored[0] = sum([law.stored(float(x)) for law, x in zip(self._each, e, strict=True)])

    def restore(self, rows: Array) -> None:
        """Restore the variables of :meth:`state`, after the accepted motions."""
        super().restore(rows)
        self.start(self._e0)
