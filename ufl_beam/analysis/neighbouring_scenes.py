# SPDX-License-Identifier: MIT
"""Scenes with neighbouring values of parameters, whose numbers are differenced."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.model.connector_law import ForceLaw
from ufl_beam.model.functions import TimeFunction, same_function
from ufl_beam.model.loads import MovingLoad
from ufl_beam.model.scene import Scene
from ufl_beam.parallel import Agreement
from ufl_beam.simulation.initial_state import initial_state
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.terms.derivatives import Registered

LINEAR = 1e-9
"""Largest ratio of second and first differences of a number that is a linear function."""

SAMPLES = 7  # times at which functions of time of neighbouring scenes are compared


class NeighbouringScene:
    """Terms of a scene beside the scene of a run, at the beginning of the run.

    It has those attributes of a :class:`Simulation` that derivatives read, and shares the matrix of
    the run: it takes no steps.
    """

    def __init__(self, run: Simulation, scene: Scene) -> None:
        self.scene, self.numbering = scene, DofNumbering(scene, run.numbering.mesh)
        if not same_cells(run.numbering, self.numbering):
            return  # without terms
        subdomain = Subdomain(self.numbering, run.subdomain.comm)
        q, v, _, _ = initial_state(self.numbering, None)
        self.q, together = q[subdomain.dofs], Agreement(run.subdomain.comm)
        self.equation = equation = StepEquation(
            subdomain, run.scheme, run.t, v[subdomain.dofs], together, run.equation.A
        )
        self.supports, self.inertia = equation.supports, equation.inertia
        if self.inertia is not None and self.inertia.scheme.further_rates:
            for load in [*equation.loads, *equation.imposed]:
                load.carry_on(run.t, self.q, self.inertia.v, None)
        elif self.inertia is not None:
            equation.begin_energies(run.t, self.q, self.inertia.v)
        for term in equation.terms:
            term.start(self.q)
        for group in equation.connector_terms:
            group.put_forces(self.q)
        self.time_loop = SimpleNamespace(supports=self.supports.in_c(equation.callbacks))

    def forget(self) -> None:
        """Keep the numbering only."""
        del self.equation, self.supports, self.inertia, self.time_loop, self.q


@dataclass
class Beside:
    """Scenes at neighbouring values of each parameter.

    Attributes:
        scenes: The scenes of each parameter.
        weights: Weights of the scenes in derivatives; (P, n).
        rows: Derivatives of each of the :class:`Numbers` by the parameters on which it depends, by
            their indices, if functions of time are the same in all scenes; the scenes have
            forgotten their terms.  Else None.
    """

    scenes: list[list[Any]]
    weights: Array
    rows: list[dict[int, Array]] | None = None

    def terms(self, i: int) -> list[list[Any]]:
        """Return the terms of the scenes with an index; none if the scenes have forgotten them."""
        known = self.rows is None
        return [[x.equation.terms[i] for x in some if known] for some in self.scenes]

    def close(self) -> None:
        """Free memory; raise exceptions of functions of the user."""
        for other in (x for some in self.scenes for x in some):
            if self.rows is None:
                other.equation.callbacks.synchronize()
            if isinstance(other, Simulation):
                other.close()


def same_cells(a: DofNumbering, b: DofNumbering) -> bool:
    """Return whether two scenes have the same cells and unknowns."""
    names = "cells", "dofs", "dofs_of_bodies", "multipliers"
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


def alike(run: Simulation, other: Any) -> bool:
    """Return whether two simulations have the same unknowns and the same parts of terms."""
    if not same_cells(run.numbering, other.numbering):
        return False
    terms = [[term.parts for term in x.equation.terms] for x in (run, other)]
    angles = [[[*support.turns] for support in x.scene.supports] for x in (run, other)]
    constrained = np.array_equal(run.supports.dofs, other.supports.dofs)
    return terms[0] == terms[1] and angles[0] == angles[1] and constrained


class Unlike(Exception):
    """Terms of a neighbouring scene differ in more than numbers and functions of time."""


class Numbers:
    """Numbers in the terms of a run that parameters may change."""

    def __init__(self, run: Simulation, t1: float) -> None:
        self._run, self._times = run, np.linspace(run.t, t1, SAMPLES)
        self._values, self._fixed = list[Callable[[Any], Array]](), list[Callable[[Any], Array]]()
        for i, term in enumerate(run.equation.terms):
            register = Registered(term, run.subdomain.size)
            term.derivatives(register)
            for mine, found in ((self._values, register.values), (self._fixed, register.fixed)):
                mine += [partial(_of_term, i, values) for values in found]
        self._values += [lambda x: x.q, lambda x: x.supports.reactions]
        if run.equation.inertia is not None:
            self._values.append(lambda x: x.inertia.rates)
        self._here = [values(run) for values in self._values]
        laws = (connector.law for connector in run.scene.all_connectors)
        # Numbers that are not in arrays, or functions of the time function of a load
        self._others = bool(run.scene.works) or any(isinstance(x, ForceLaw) for x in laws)
        self._others |= any(isinstance(x, MovingLoad) for x in run.scene.loads)

    def changes(self, other: Any) -> list[Array]:
        """Return the changes of all numbers in a scene; raise if its terms differ in more."""
        if self._others or not alike(self._run, other):
            raise Unlike
        terms = self._run.equation.terms, other.equation.terms
        fixed = ([of(x) for of in self._fixed] for x in (self._run, other))
        same = all(here.is_like(there) for here, there in zip(*terms, strict=True))
        if not (same and all(map(np.array_equal, *fixed))):
            raise Unlike
        found = list[Array]()
        for here, values in zip(self._here, self._values, strict=True):
            with np.errstate(invalid="ignore"):  # infinite numbers do not change
                change = np.subtract(values(other), here)
            found.append(np.where(np.isfinite(change), change, 0.0))
        return found

    def derivatives(
        self, beside: Callable[[int, Index], Any], far: Array, some: Index, *, linear: bool
    ) -> list[dict[int, Array]] | None:
        """Return the rows of :class:`Beside` by some parameters, from scenes in which all change.

        They are None if a number depends on two of the parameters.  A scene for each bit of their
        order tells these apart: in it the parameters with this bit change, and a number changes as
        with all of them or not at all.

        Args:
            beside: Function that returns a scene in which parameters change by a multiple of
                ``far``.
            far: Changes of all parameters; (P,).
            some: Indices of the parameters.
            linear: Whether all numbers are linear functions of the parameters.
        """
        whole, order = self.changes(beside(1, some)), np.arange(len(some))
        places = [np.zeros(x.shape, dtype=np.intp) for x in whole]
        for bit in range(int(order[-1]).bit_length()):
            part = self.changes(beside(1, some[order >> bit & 1 == 1]))
            for place, x, y in zip(places, whole, part, strict=True):
                if y[y != x].any():
                    return None
                place[y != 0] |= 1 << bit
        slopes = whole
        if not linear:
            low = self.changes(beside(-1, some))
            if not all(map(_cancel, low, whole, self._here)):  # five-point differences
                ends = (self.changes(beside(k, some)) for k in (-2, 2))
                four = zip(*ends, low, whole, strict=True)
                slopes = [(a - b + 8 * (d - c)) / 12 for a, b, c, d in four]
        return [
            {
                int(some[k]): np.where(place == k, slope, 0.0) / far[some[k]]
                for k in np.unique(place[x != 0])
            }
            for place, slope, x in zip(places, slopes, whole, strict=True)
        ]

    def are_linear(self, both: Sequence[Any]) -> bool:
        """Return whether changes of numbers and functions in two opposite scenes cancel."""
        linear = all(map(_cancel, *map(self.changes, both), self._here))
        for functions in self.moving(both) if linear else ():
            at, low, high = np.array([[f(float(t)) for t in self._times] for f in functions])
            linear &= _cancel(low - at, high - at, at)
        return linear

    def moving(self, both: Sequence[Any]) -> list[Sequence[TimeFunction]]:
        """Return the functions of time that differ: of the run, then of both other scenes."""
        scenes = (x.scene.time_functions() for x in (self._run, *both))
        of_three = [[f for _, f in three] for three in zip(*scenes, strict=True)]
        return [x for x in of_three if not all(same_function(x[0], other) for other in x)]


def _of_term(i: int, values: Callable[[Any], Array], scene: Any) -> Array:
    return values(scene.equation.terms[i])


def _cancel(low: Array, high: Array, values: Array) -> bool:
    """Return whether two changes of numbers are opposite, apart from round-off."""
    round_off = 8 * np.finfo(np.float64).eps * np.abs(values)
    with np.errstate(invalid="ignore"):
        return not (np.abs(low + high) > LINEAR * np.abs(high) + round_off).any()
