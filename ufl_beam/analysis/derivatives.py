# SPDX-License-Identifier: MIT
"""Derivatives of runs by parameters of the model, by direct differentiation of each step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, struct
from ufl_beam.errors import ArgumentError, require_kind, require_number
from ufl_beam.mechanics.time_scheme import FURTHER, Scheme, V
from ufl_beam.model.beams import Mesh
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.run import require_times, running, take_steps
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_lengths import EqualSteps, step_count
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.derivatives import Neighbours

STEP = 2.0**-10
"""Relative step of differences of the numbers in a scene by a parameter, exact for polynomials of
degree 4."""

STENCILS = {
    (-2, -1, 1, 2): (1 / 12, -8 / 12, 8 / 12, -1 / 12),
    (1, 2, 3, 4): (4.0, -3.0, 4 / 3, -1 / 4),
    (-1, -2, -3, -4): (-4.0, 3.0, -4 / 3, 1 / 4),
}
"""Positions and weights of five-point differences: central, and to one side at the end of a range.
The weight of the position 0 makes the sum zero."""

Model = Callable[..., Scene]


class _StepDerivatives:
    """Derivatives in C of the steps of a simulation, see derivatives.c."""

    def __init__(
        self, simulation: Simulation, neighbours: list[list[Simulation]], weights: Array, states: int
    ) -> None:
        P, size = len(neighbours), simulation.subdomain.size
        self.weights = weights
        equation, self._alive = simulation.equation, list[Any]([neighbours])
        terms = list[Any]()
        for i, term in enumerate(equation.terms):
            others = [[x.equation.terms[i] for x in some] for some in neighbours]
            own = Neighbours(term, others, weights, size)
            if (made := term.derivatives(own)) is None:
                raise ArgumentError(f"differentiate: {type(term).__name__} has no derivatives")
            terms += made
            self._alive += [own, made]
        self.scene = Neighbours(simulation, neighbours, weights, size)
        held, A = len(equation.supports.dofs), equation.A
        q, v = (np.zeros((states, P, size)) for _ in range(2))
        self.q, self.v, self.reactions = q, v, np.zeros((states, P, held))
        dq = self.scene.differences(lambda x: x.q)
        c = self.c = struct(
            "derivatives", parameters=P, size=size, terms=len(terms),
            term=ffi.new("term_derivative[]", terms), q0=dq, q1=np.zeros((P, size)),
            reactions=np.zeros((P, held)), neighbours=weights.shape[1], weight=weights,
            indices=A.indices, tangent=np.zeros(len(A.data)), r=np.zeros(size), v=np.zeros(size),
            s=np.zeros(size), space=np.zeros(size), kept_q=q, kept_v=v,
            kept_reactions=self.reactions,
        )  # fmt: skip
        motions = [x.time_loop.supports.motion for some in neighbours for x in some]
        fill(c, motion=ffi.new("time_function *[]", motions))
        q[0] = dq
        if equation.inertia is not None:
            number = equation.inertia.c.number
            rates = np.zeros((number, P, size))
            dv = self.scene.differences(lambda x: x.inertia.v)
            rates[V] = rates[V + 1] = v[0] = dv
            for k in range(1, number):
                c.rates[k] = doubles(rates[k])
            fill(c, new_rates=np.zeros((number, P, size)), inertia=equation.inertia.step_product)
            self._alive.append(rates)
        c.kept = 1
        fill(simulation.time_loop, derivatives=c)


def _alike(one: Simulation, other: Simulation) -> bool:
    """Return whether two simulations have the same unknowns and the same kinds of terms."""
    a, b = one.numbering, other.numbering
    names = "cells", "dofs", "dofs_of_bodies", "multipliers"
    same = all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)
    terms = [[type(term) for term in x.equation.terms] for x in (one, other)]
    return same and terms[0] == terms[1] and np.array_equal(one.supports.dofs, other.supports.dofs)


class Derivatives:
    """Derivatives of a run by parameters of its model; made by :func:`differentiate`.

    Attributes:
        solution: The run.
        at: Values of the parameters.
        q: Derivatives of the configurations; (n+1, P, size).
        v: Derivatives of the velocities; (n+1, P, size).
        reactions: Derivatives of the forces at the held degrees of freedom; (n+1, P, held).
    """

    def __init__(self, solution: Solution, at: dict[str, float], steps: _StepDerivatives) -> None:
        self.solution, self.at = solution, at
        self.q, self.v, self.reactions = steps.q, steps.v, steps.reactions


def differentiate(
    model: Model, at: Mapping[str, float], scheme: Scheme, *, t: tuple[float, float], dt: float,
    newton: Newton | None = None, mesh: Mesh | None = None,
) -> Derivatives:  # fmt: skip
    """Simulate a scene, and differentiate the run by parameters of the scene."""
    t0, t1 = require_times(t, "differentiate")
    require_number(dt, "differentiate: dt", positive=True)
    at, begin = {name: float(value) for name, value in at.items()}, time.perf_counter()

    def simulation(values: Mapping[str, float]) -> Simulation:
        scene = model(**values)
        require_kind(scene, Scene, "differentiate: the result of model")
        return Simulation(scene, scheme, t0=t0, newton=newton, mesh=mesh, comm=MPI.COMM_SELF)

    neighbours, weights = list[list[Simulation]](), list[Array]()
    for name, value in at.items():
        h = STEP * (abs(value) or 1.0)
        for stencil, w in STENCILS.items():
            try:
                neighbours.append([simulation({**at, name: value + k * h}) for k in stencil])
            except ArgumentError:
                continue
            weights.append(np.array(w) / h)
            break
        else:
            raise ArgumentError(f"differentiate: {name}: no neighbouring value has a scene")
    run = simulation(at)
    number = step_count(t1 - t0, dt)
    for name, some in zip(at, neighbours, strict=True):
        if not all(_alike(run, other) for other in some):
            raise ArgumentError(
                f"differentiate: {name} changes the cells, unknowns or parts of the scene, so that "
                "it has no derivative; keep beams, cells and attached points on the same vertices"
            )
    steps = _StepDerivatives(run, neighbours, np.array(weights), number + 1)
    run.solution.every = 1
    with running(run, [], [], begin):
        from ufl_beam.parallel import progress_bar

        bar = progress_bar(False, MPI.COMM_SELF, total=1.0)
        take_steps(run, EqualSteps(run, t1, dt), [], bar)
    for some in neighbours:
        for other in some:
            other.close()
    return Derivatives(run.solution, at, steps)
