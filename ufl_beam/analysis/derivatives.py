# SPDX-License-Identifier: MIT
"""Derivatives of runs by parameters of the model, by direct differentiation of each step.

derivatives.c differentiates the equation of each step after its solution.  The derivatives are
those of the discrete run, and not approximations of derivatives of the motion.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from functools import cached_property, partial
from inspect import signature
from typing import Any, NamedTuple, NoReturn

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.neighbouring_scenes import Beside, NeighbouringScene, Numbers, Unlike, alike
from ufl_beam.arrays import Array, Index, State
from ufl_beam.compiled.c_library import doubles, ffi, fill, struct
from ufl_beam.discretization.cells_in_space import TURNS, turned_further
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.state_io import Archive
from ufl_beam.display import in_one_line
from ufl_beam.errors import (
    ArgumentError,
    ModelWarning,
    each_warning_once,
    require_function,
    require_kind,
    require_number,
    require_switch,
    shorten,
    warn,
)
from ufl_beam.mechanics.time_scheme import Scheme, V, acts_at_end, has_inertia, order_of
from ufl_beam.model.beams import Mesh
from ufl_beam.model.functions import same_function
from ufl_beam.model.scene import Scene
from ufl_beam.output.state_rows import Block, Column, Columns
from ufl_beam.parallel import progress_bar
from ufl_beam.simulation.initial_state import mesh_of, require_scheme
from ufl_beam.simulation.run import require_times, running, take_steps
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_lengths import Adaptive, EqualSteps, step_count
from ufl_beam.solvers.newton_options import Newton, require_plain
from ufl_beam.terms.derivatives import Neighbours, functions

MODEL_STEP = 2.0**-13
"""Relative change of a parameter for differences of the numbers in a scene.

Five-point differences are exact for polynomials of degree 4; the round-off is 1e-12 of the number.
The error by the coordinates of nodes, (change over length of the cell)⁴, is multiplied by the ratio
of axial to bending stiffness."""

QUANTITY_STEP = 2.0**-17
"""Relative change of a parameter for differences of quantities.

It is small because quantities, such as largest values, may be smooth in pieces only.  The round-off
is 1e-11 of the quantity."""

LEAST_STEP = 2.0**-30
"""Least relative change of a parameter for differences of energies and material, where a switch of
the run is near.  The round-off is 1e-6 of the quantity."""

FARTHEST = 5.0  # steps of a difference that a switch must be away

STENCILS: dict[tuple[int, ...], tuple[float, ...]] = {
    (-2, -1, 1, 2): (1 / 12, -8 / 12, 8 / 12, -1 / 12),
    (1, 2, 3, 4): (4.0, -3.0, 4 / 3, -1 / 4),
    (-1, -2, -3, -4): (-4.0, 3.0, -4 / 3, 1 / 4),
}
"""Positions and weights of five-point differences: central ones, and one-sided ones at the end of
the range of a parameter.  The weight of the position 0 makes the sum of the weights zero."""

TOGETHER = 1.0, 1.5
"""Least and largest step of a parameter in the scenes where all parameters change, as a multiple
of the step of :data:`MODEL_STEP`."""

FEW = 8
"""Largest number of parameters that change one by one in the scenes for differences of numbers."""

MOST_SUBSTEPS = 1000
"""Number of substeps of divided steps that are stored; the number of steps if it is larger."""

Model = Callable[..., Scene]


@each_warning_once()
def differentiate(
    model: Model,
    at: Mapping[str, float],
    scheme: Scheme,
    *,
    t: tuple[float, float],
    dt: float,
    start: Derivatives | None = None,
    unused: Collection[str] = (),
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    progress: bool = True,
) -> Derivatives:
    """Simulate a scene, and differentiate the run by parameters of the scene.

    Each step is differentiated after its solution.  The forms of UFL are differentiated by their
    coefficients, the laws by all their inputs.  Functions of time and numbers of the scene are
    differentiated by five-point differences of the model.  A derivative costs about half of a plain
    run, see docs/derivatives.md.

    The run is piecewise smooth in its parameters: the pieces differ in the points that yield or
    open in each step.  The derivative is that of the piece of the run.

    Args:
        model: Function that returns the scene for values of its parameters, which it has as
            keywords.  Parameters may be any numbers of the scene: of sections, laws, loads,
            initial velocities, and of the geometry, if the number of cells stays.
        at: Values of the parameters by name.
        scheme: Time scheme, as in :func:`simulate`.
        t: Beginning and end; s.
        dt: Time step; s.
        start: Derivatives of an earlier run at the same values, with the same mesh, which this run
            continues.  If it has another scheme, such as :class:`Static` for a preload, or another
            model, this run begins as one of :func:`simulate` with ``start``.  Two models must
            return the same beams for the same values, see docs/derivatives.md.
        unused: Names of parameters that may be without effect on this run, such as a mass in a
            static preload; other parameters without effect are an error.
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default the cells of the beams.
        progress: Show a progress bar in a terminal or notebook.

    Raises:
        ArgumentError: An argument is wrong; ``model`` lacks a parameter; a parameter changes the
            cells or the unknowns, or does not enter the result; or an effect of the scene has no
            derivatives, such as a controller.
        ConvergenceError: As in :func:`simulate`.

    Example:
        >>> def cantilever(EI, force):
        ...     section = ub.Section(EA=2e9, GA=7e8, EI=EI, rhoA=60.0, rhoI=0.1)
        ...     beam = ub.Beam((0, 0), (2, 0), section, cells=4)
        ...     push = ub.PointLoad(beam.end, force=(0, force))
        ...     return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> at = {"EI": 4e6, "force": -1e5}
        >>> run = ub.differentiate(cantilever, at, ub.Static(), t=(0, 1), dt=1.0)
        >>> tip = run.of(lambda s: s.displacement(s.scene.beams[0].end)[-1, 1])
        >>> print((tip * [4e6, -1e5]).round(4))  # by relative changes of EI and of the force; m
        [ 0.0654 -0.0657]
    """
    t0, t1 = require_times(t, "differentiate")
    require_switch(progress, "differentiate: progress")
    case = checked_case("differentiate", model, at, scheme, t0, dt, newton, mesh)
    require_kind(unused, Collection, "differentiate: unused")
    if isinstance(unused, str) or {*unused} - {*at}:
        raise ArgumentError(f"differentiate: unused = {unused!r} must be names in at, {[*at]}")
    if start is not None:
        require_kind(start, Derivatives, "differentiate: start")
        if [*start.at.items()] != [*at.items()] or start.solution.times[-1] != t0:
            raise ArgumentError(
                f"differentiate: start ends at t = {start.solution.times[-1]:g} s with "
                f"{start.at}; begin there, at the same values in the same order"
            )
        if start.mesh != mesh:
            raise ArgumentError(
                f"differentiate: start has mesh = {start.mesh}; continue with the same one"
            )
        case.begin_at_end_of(start)
    found = case.run(t1, dt, start, progress=progress)
    found.require_effects(unused)
    return found


def checked_case(
    call: str, model: Model, at: Mapping[str, float], scheme: Scheme, t0: float, dt: float,
    newton: Newton | None, mesh: Mesh | None,
) -> Case:  # fmt: skip
    """Check the arguments of a function ``call`` that differentiates runs."""
    require_function(model, f"{call}: model", "the parameters")
    if isinstance(dt, Adaptive):
        raise ArgumentError(
            f"{call}: dt = Adaptive(...) chooses steps that depend on the parameters; give a number"
        )
    require_number(dt, f"{call}: dt", positive=True)
    require_scheme(scheme, f"{call}: scheme")
    if newton is not None:
        require_kind(newton, Newton, f"{call}: newton")
    require_plain(newton, call)
    require_kind(at, Mapping, f"{call}: at")
    if not at:
        raise ArgumentError(f"{call}: at has no parameters")
    for name, value in at.items():
        require_number(value, f"{call}: at[{name!r}]")
    try:
        signature(model).bind(**at)
    except TypeError as error:
        raise ArgumentError(f"{call}: model has other parameters than at: {error}") from None
    create = partial(Simulation, scheme=scheme, t0=t0, newton=newton, mesh=mesh, comm=MPI.COMM_SELF)
    return Case(call, model, {name: float(value) for name, value in at.items()}, create, mesh)


class Case:
    """Scenes of a model at neighbouring values of its parameters.

    Attributes:
        at: Values of the parameters.
        create: Function that creates a simulation of a scene.
        mesh: Discretization; None for the cells of the beams.
        start: Run with another scheme or model, at whose end the simulations begin; else None.
    """

    start: Derivatives | None = None

    def __init__(
        self, call: str, model: Model, at: dict[str, float], create: partial[Simulation],
        mesh: Mesh | None,
    ) -> None:  # fmt: skip
        self._call, self._model, self.at = call, model, at
        self.create, self.mesh = create, mesh
        self._stencils: dict[str, tuple[int, ...]] = {}

    def scene(self, changes: Mapping[str, float]) -> Scene:
        """Return the scene for the values :attr:`at` with ``changes``."""
        scene = self._model(**{**self.at, **changes})
        require_kind(scene, Scene, f"{self._call}: the result of model")
        return scene

    def begin_at_end_of(self, start: Derivatives) -> None:
        """Let simulations begin at the end of a run, unless they can continue its steps."""
        known = start._case
        self._same_model = self._model is known._model
        schemes = [case.create.keywords["scheme"] for case in (self, known)]
        if not self._same_model or schemes[0] != schemes[1]:
            self.start, self._stencils = start, known._stencils

    def simulation(self) -> Simulation:
        """Return a simulation in its initial state."""
        return self._begin(self.scene({}), None if self.start is None else self.start.solution)

    def _begin(self, scene: Scene, start: Solution | None) -> Simulation:
        if start is not None and self._same_model:  # which may make new beams at each call
            scene = start.scene
        if start is not None and scene.beams != start.scene.beams:
            raise ArgumentError(
                f"{self._call}: model and the model of start have different beams; let both "
                "return the same Beam objects for the same values, by functools.cache, see "
                "docs/derivatives.md"
            )
        scheme, in_space = self.create.keywords["scheme"], scene.in_space
        if in_space and self._call == "differentiate" and order_of(scheme) > 2:
            raise ArgumentError(
                f"differentiate: {scheme!r}: derivatives of rotations in space are known at ends "
                "of steps, not of their stages; use EnergyMomentum() of second order"
            )
        simulation: Simulation = self.create(scene, start=start)
        fill(simulation.time_loop, adds_up=1)
        return simulation

    def _step(self, name: str, fraction: float) -> float:
        return fraction * (abs(self.at[name]) or 1.0)

    def scenes(self, name: str, fraction: float) -> list[Scene]:
        """Return the scenes of a stencil for a parameter, whose steps are a ``fraction`` of it."""
        known = self._stencils.get(name)
        for stencil in STENCILS if known is None else [known]:
            h = self._step(name, fraction)
            try:
                scenes = [self.scene({name: self.at[name] + k * h}) for k in stencil]
            except ArgumentError as error:
                refused = error
                continue
            self._stencils[name] = stencil
            return scenes
        where = f"{self._call}: {name} near {self.at[name]:g}"
        raise ArgumentError(f"{where}: {refused}") from refused

    def simulations(self, name: str, fraction: float) -> Iterator[Simulation]:
        """Yield simulations of :meth:`scenes`."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            scenes = self.scenes(name, fraction)
            starts: Sequence[Solution | None] = [None] * len(scenes)
            if self.start is not None:
                start, p = self.start, [*self.at].index(name)
                starts = start._ends[p] if fraction == MODEL_STEP else start._runs(p, fraction)
            yield from map(self._begin, scenes, starts)

    def differences(self, name: str, fraction: float) -> tuple[Array, Array]:
        """Return changes of a parameter in :meth:`scenes`, and their weights in a derivative."""
        if name not in self._stencils:
            self.scenes(name, MODEL_STEP)
        stencil, step = self._stencils[name], self._step(name, fraction)
        return step * np.array(stencil), np.array(STENCILS[stencil]) / step

    def run(
        self, t1: float, dt: float, start: Derivatives | None = None, *, progress: bool = False
    ) -> Derivatives:
        """Simulate until ``t1`` (s) and differentiate each step, see :func:`differentiate`."""
        begin = time.perf_counter()
        run = self.simulation()
        beside = self.neighbours(run, t1)
        steps = StepDerivatives(run, beside, step_count(t1 - run.t, dt) + 1)
        fill(run.time_loop, derivatives=steps.c)
        if start is not None and self.start is None:
            run.save_or_restore(Archive(run.subdomain, start.end[0]))
            steps.restore(start.end[1])
        with running(run, [], [], begin):
            bar = progress_bar(progress, MPI.COMM_WORLD, total=1.0)
            take_steps(run, EqualSteps(run, t1, dt), [], bar)
        beside.close()
        archive = Archive(run.subdomain)
        run.save_or_restore(archive)
        return Derivatives(self, run.solution, steps, archive.state(), start)

    def neighbours(self, run: Simulation, t1: float) -> Beside:
        """Return scenes at neighbouring values for differences of numbers, in a run to ``t1``."""
        names = [*self.at]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            if self.start is not None or run.begins_with_impact:
                scenes: list[list[Any]] = [[*self.simulations(x, MODEL_STEP)] for x in names]
            elif (found := self._differenced(run, t1)) is not None:
                return found
            else:
                beside = partial(NeighbouringScene, run)
                scenes = [[*map(beside, self.scenes(x, MODEL_STEP))] for x in names]
        for name, some in zip(names, scenes, strict=True):
            if not all(alike(run, other) for other in some):
                raise ArgumentError(
                    f"{self._call}: {name} changes the cells, unknowns or parts of the scene, so "
                    "that the run has no derivative; keep beams, cells and attached points on the "
                    "same vertices"
                )
        return Beside(scenes, np.array([self.differences(x, MODEL_STEP)[1] for x in names]))

    def _differenced(self, run: Simulation, t1: float) -> Beside | None:
        """Return derivatives of all numbers, or a scene for each parameter if all are linear.

        Two scenes in which all parameters change in different proportions show whether numbers are
        linear.  Their changes cancel unless a number depends on a square of a parameter or on a
        product of two.  Many parameters change together, all or every second one, if each number
        depends on one of them at most.
        """
        every, values = np.arange(len(self.at)), np.array([*self.at.values()])
        steps = np.array([self._step(name, MODEL_STEP) for name in self.at])
        far = np.random.default_rng(0).uniform(*TOGETHER, len(steps)) * steps
        numbers, both = Numbers(run, t1), dict[int, NeighbouringScene]()

        def beside(k: int, some: Index) -> NeighbouringScene:
            if len(some) == len(every) and k in both:
                return both[k]
            changed = values.copy()
            changed[some] += k * far[some]
            scene = self.scene(dict(zip(self.at, map(float, changed), strict=True)))
            return NeighbouringScene(run, scene)

        with suppress(ArgumentError, Unlike):
            low, high = both[-1], both[1] = beside(-1, every), beside(1, every)
            linear = numbers.are_linear((low, high))
            if numbers.moving((low, high)):  # C needs the terms of all scenes
                one_each = [[beside(1, every[p : p + 1])] for p in every if linear]
                return Beside(one_each, 1 / far[:, None]) if linear else None
            for n in (1, 2, len(every)) if len(every) > FEW else (len(every),):
                rows = list[dict[int, Array]]()
                for some in (every[k::n] for k in range(n)):
                    if (found := numbers.derivatives(beside, far, some, linear=linear)) is None:
                        break
                    rows = [x | y for x, y in zip(rows, found, strict=True)] if rows else found
                else:
                    high.forget()
                    return Beside([[high]] * len(every), 1 / steps[:, None], rows)
        return None


class StepDerivatives:
    """Derivatives of the steps of a simulation, which derivatives.c computes.

    Args:
        simulation: Simulation in its initial state.
        beside: Scenes with neighbouring values of the parameters.
        states: Number of states of the run.

    Attributes:
        terms: Derivatives of all terms: kinds, and data of C.
        states: Derivatives of the present state of the run, as arrays that C changes.
        places: Indices of states of terms, indices of the terms, and functions that return the
            arrays of a term that the states are derivatives of.
        q, v: Derivatives of configurations and velocities by P parameters; (states, P, size).
        constrained_dofs: Degrees of freedom that supports hold; (number,).
        reactions: Derivatives of the forces of supports, in their axes; (states, P, number).
        c: ``derivatives`` of loops.h.
    """

    def __init__(self, simulation: Simulation, beside: Beside, states: int) -> None:
        weights, size = beside.weights, simulation.subdomain.size
        P, rows = len(weights), None if beside.rows is None else iter(beside.rows)
        equation, A = simulation.equation, simulation.equation.A
        for k, support in enumerate(simulation.scene.supports):
            here = support.moving.get(5)  # a rotation in space, which is no sum of unknowns
            others = [x.scene.supports[k].moving.get(5) for some in beside.scenes for x in some]
            if here is not None and not all(same_function(here, other) for other in others):
                raise ArgumentError(
                    f"differentiate: {support}: psi depends on a parameter; rotations of supports "
                    "in space have no derivatives: use a Turn with PrescribedMotion and Revolute"
                )
        scene = Neighbours(simulation, beside.scenes, weights, size, rows)
        self.terms, self.states = list[Any](), list[Array]()
        self.places = list[tuple[int, int, Callable[[Any], Array]]]()
        self._alive = list[Any]([beside])  # data of C
        self.owners = list[Any]()  # terms, by their index in C
        for i, term in enumerate(equation.terms):
            own = Neighbours(term, beside.terms(i), weights, size, rows)
            if (found := term.derivatives(own)) is None:
                raise ArgumentError(f"differentiate: {term.effect} has no derivatives")
            # Beams use imposed strains, which follow in equation.terms: with the terms in reverse
            # order, the adjoint has imposed strains after beams.
            self.terms[:0] = found
            self.owners[:0] = [term] * len(found)
            self.places += [(len(self.states) + k, i, of) for k, of in own.places.items()]
            self.states += own.states
            self._alive.append(own)
            scene.enters |= own.enters
        self.numbers_enter = scene.enters
        in_c = [(data, *functions(kind)[:4]) for kind, data in self.terms]
        constrained = len(equation.supports.dofs)
        self.q, self.v = np.zeros((2, states, P, size))
        self._change, self._time = np.full(P, np.inf), np.full(P, np.nan)
        self._term, self._place = np.zeros((2, P), dtype=np.int32)
        self.constrained_dofs = equation.supports.dofs
        self.reactions = np.zeros((states, P, constrained))
        q0 = scene.differences(lambda x: x.q)
        reactions = scene.differences(lambda x: x.supports.reactions)
        several = [x for some in beside.scenes for x in some if rows is None]
        motions = [x.time_loop.supports.motion for x in several]
        most = max(states, MOST_SUBSTEPS) if states > 1 else 0  # the adjoint divides no steps
        substeps = self._substeps = [np.zeros((most, *n)) for n in ((3,), (size,), (P, size))]
        c = self.c = struct(
            "derivatives", parameters=P, size=size, terms=len(in_c),
            term=ffi.new("term_derivative[]", in_c), q0=q0, q1=np.zeros((P, size)),
            reactions=reactions, neighbours=len(several) // P, weight=weights,
            motion=ffi.new("time_function *[]", motions), indices=A.indices,
            tangent=np.zeros(len(A.data)), r=np.zeros(size), v=np.zeros(size), s=np.zeros(size),
            space=np.zeros(size), range=self._change, range_time=self._time,
            range_term=self._term, range_place=self._place, kept=1, kept_q=self.q, kept_v=self.v,
            kept_reactions=self.reactions, room=most, substep=substeps[0],
            substep_q=substeps[1], substep_dq=substeps[2],
        )  # fmt: skip
        rates = np.zeros((V + 1, P, size))
        if equation.inertia is not None:
            rates = np.zeros((equation.inertia.c.number, P, size))
            rates[V:] = scene.differences(lambda x: x.inertia.rates).swapaxes(0, 1)
            for k in range(V, len(rates)):
                c.rates[k] = doubles(rates[k])
            fill(c, new_rates=np.zeros(rates.shape), inertia=equation.inertia.step_product)
        self.states += [reactions, q0, rates]
        self.restore(self.states)
        if beside.rows:
            beside.rows.clear()

    def restore(self, states: list[Array]) -> None:
        """Set the derivatives at the beginning of the run to the :attr:`states` of another one."""
        for mine, other in zip(self.states, states, strict=True):
            mine[:] = other
        *_, self.reactions[0], self.q[0], rates = self.states
        self.v[0] = rates[V]

    def substeps(self) -> list[Array] | None:
        """Return the substeps of divided steps, see derivatives.c; None if there were too many."""
        number = self.c.substeps
        return [x[:number].copy() for x in self._substeps] if number >= 0 else None

    def ranges(self) -> list[Range]:
        """Return the range of each derivative."""
        found = []
        for p, change in enumerate(map(float, self._change)):
            owner, place = self.owners[self._term[p]], int(self._place[p])
            name = owner.describe(place) if np.isfinite(change) else ""
            found.append(Range(change, float(self._time[p]), name))
        return found


@in_one_line
class Range(NamedTuple):
    """Range of a parameter in which a derivative holds, to first order.

    The run is smooth until one more point, hinge or connector yields, opens, closes or unloads in a
    step, or one less.

    Attributes:
        change: Size of the change of the parameter, in its unit, at the nearest of these switches,
            without a sign: the switch may be on either side.  It is infinite if there is none, or
            if the laws have too many conditions.
        time: Time of this switch; s.
        place: Cell or connector of this switch.

    Example:
        >>> def column(limit):
        ...     law = ub.ElastoPlastic(limit, isotropic=1e5)
        ...     weak = ub.Section(EA=2e9, GA=7e8, EI=4e6, rhoA=60.0, rhoI=0.1, bending=law)
        ...     beam = ub.Beam((0, 0), (2, 0), weak, cells=4)
        ...     push = ub.PointLoad(beam.end, force=(0, 1e4), amplitude=lambda t: t)
        ...     return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])
        >>> run = ub.differentiate(column, {"limit": 1.5e4}, ub.Static(), t=(0, 1), dt=0.1)
        >>> print(f"{run.ranges['limit'].change:.0f} N m, {run.ranges['limit'].place}")
        750 N m, beam at (0.25, 0)
    """

    change: float
    time: float
    place: str


class Derivatives:
    """Derivatives of a run by parameters of its model; made by :func:`differentiate`.

    Attributes:
        solution: The run.
        at: Values of the parameters by name, in the order of the derivatives.
        ranges: :class:`Range` of each parameter by name, including switches in ``start``.
        mesh: Discretization; None for the cells of the beams.
        end: State at the end of the run, and its derivatives, for a run that continues.

    Example:
        >>> def swing(length):
        ...     beam = ub.Beam((0, 0), (length, 0), section, cells=4)
        ...     return ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=[ub.Gravity()])
        >>> run = ub.differentiate(swing, {"length": 2.0}, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
        >>> angle = run.of(lambda s: s.displacement(s.scene.beams[0].start)[:, 2])
        >>> print(angle.shape, angle[-1].round(3))  # rad/m
        (101, 1) [0.657]
    """

    def __init__(
        self, case: Case, solution: Solution, steps: StepDerivatives, state: State,
        start: Derivatives | None,
    ) -> None:  # fmt: skip
        self.solution, self.at, self._case = solution, case.at, case
        self.end, self._places = (state, steps.states), steps.places
        self._start = start if case.start is None else None
        self._q, self._v, self._reactions = steps.q, steps.v, steps.reactions
        self._substeps = steps.substeps()
        self._constrained_dofs, self.mesh = steps.constrained_dofs, case.mesh
        self.ranges = dict(zip(case.at, steps.ranges(), strict=True))
        of_motion = (np.any(x, axis=(0, 2)) for x in (steps.q, steps.v, steps.reactions))
        changes = [x.change for x in self.ranges.values()]
        enters = np.any([steps.numbers_enter, np.isfinite(changes), *of_motion], axis=0)
        self._enters = dict(zip(case.at, map(bool, enters), strict=True))
        if start is not None:
            for name, earlier in start.ranges.items():
                self.ranges[name] = min(earlier, self.ranges[name], key=lambda x: x.change)
            for name, enters in start._enters.items():
                self._enters[name] |= enters
        self._repeated: dict[tuple[int, float], list[Solution]] = {}

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.at.items())
        return f"<Derivatives at {values}: {self.solution!r}>"

    def require_effects(self, unused: Collection[str]) -> None:
        """Raise :class:`ArgumentError` if the run does not depend on a parameter."""
        for name, enters in self._enters.items():
            if not enters and name not in unused:
                raise ArgumentError(
                    f"differentiate: the run does not depend on {name}; remove it from at, or give "
                    f"unused=[{name!r}] if a run with start= will depend on it"
                )

    def of(self, quantity: Callable[[Solution], npt.ArrayLike]) -> Array:
        """Return the derivatives of a quantity of the run.

        The quantity is differenced between states that are shifted along the derivatives of the
        motion, without further solutions of steps.  If it needs more than motions and reactions,
        the material and the energies follow the shifted motions once; this costs about as much as
        two plain runs for each parameter.

        Args:
            quantity: Function of a :class:`Solution` that returns a number or an array.  If the
                model makes new beams, it finds places in the scene of the solution:
                ``lambda s: s.displacement(s.scene.beams[0].end)``.

        Returns:
            Derivatives; (..., P) for a quantity of shape (...), in the order of :attr:`at`.

        Raises:
            ArgumentError: The quantity fails, or it needs material or energies of a run with stages
                in its steps, or with too many substeps.
        """
        require_function(quantity, "of: quantity", "a Solution")
        reference = _as_array(quantity(self.solution))
        fractions = [QUANTITY_STEP] * len(self.at)
        try:
            changes = [self._differences(quantity, reference, some) for some in self._motions]
        except Unknown:
            fractions = [self._fraction(name) for name in self.at]
            runs = (self._runs(p, fraction) for p, fraction in enumerate(fractions))
            changes = [self._differences(quantity, reference, some) for some in runs]
        found = [
            np.tensordot(self._case.differences(name, fraction)[1], row, axes=1)
            for name, fraction, row in zip(self.at, fractions, changes, strict=True)
        ]
        return np.stack(found, axis=-1)

    def _differences(
        self, quantity: Callable[[Solution], npt.ArrayLike], reference: Array, some: list[Solution]
    ) -> Array:
        changes = []
        for other in some:
            value = _as_array(in_scene(quantity, other))
            if value.shape != reference.shape:
                raise ArgumentError("of: the shape of the quantity depends on the parameters")
            changes.append(value - reference)
        return np.array(changes)

    def _states(self, p: int, change: float) -> State:
        """Return motions and reactions if parameter ``p`` grows by ``change``."""
        solution = self.solution
        states = {"t": solution.times, "q": solution.q + change * self._q[:, p]}
        if has_inertia(solution.scheme):  # type: ignore[arg-type]
            states["v"] = solution.v + change * self._v[:, p]
        reactions = solution.column("reactions")[:,]
        for k, support in enumerate(solution.scene.supports):
            dofs = solution.numbering.node(support.place)
            components = [*support.held]
            at = np.searchsorted(self._constrained_dofs, dofs[components])
            reactions[:, k, components] += change * self._reactions[:, p, at]
        if solution.scene.in_space:
            states[TURNS] = self._turns(p, change)
        if any(support.axis is not None for support in solution.scene.supports):
            return states  # moments of hinges turn with their places
        return states | {"reactions": reactions}

    def _turns(self, p: int, change: float) -> Array:
        """Return the rotations in space if parameter ``p`` grows by ``change``.

        They are products of the rotations in steps.
        """
        before, solution = self._start or self._case.start, self.solution
        turns = before._turns(p, change)[-1] if before else solution.column(TURNS)[:,][0]
        found, (_, stored, q) = [turns], self._all_ends(p, change)
        at_end = acts_at_end(solution.scheme)  # type: ignore[arg-type]
        for step, kept in zip(np.diff(q, axis=0), stored, strict=True):
            turns = turned_further(solution.numbering, turns, step, at_end=at_end)
            found += [turns] * int(kept)
        return np.array(found)

    def _all_ends(self, p: int, change: float) -> tuple[Array, Array, Array]:
        """Return steps and substeps if parameter ``p`` grows by ``change``.

        They are rows for :meth:`Simulation.repeat`, whether they are stored, and the initial
        configuration with those at their ends; (n, 3), (n,), (n+1, size).
        """
        ends, q = self.solution.times[1:], self.solution.q + change * self._q[:, p]
        steps: Array = np.column_stack([ends, ends, np.zeros(len(ends))])
        stored: Any = np.ones(len(ends), bool)
        if self._substeps is not None and len(self._substeps[0]):
            some, known, slopes = self._substeps
            at = np.searchsorted(ends, some[:, 0])
            steps, stored = np.insert(steps, at, some, axis=0), np.insert(stored, at, False)
            q = np.insert(q, at + 1, known + change * slopes[:, p], axis=0)
        return steps, stored, q

    @cached_property
    def _motions(self) -> list[list[Solution]]:
        """Motions and reactions at neighbouring values of each parameter."""
        found = list[list[Solution]]()
        for p, name in enumerate(self.at):
            scenes = self._case.scenes(name, QUANTITY_STEP)
            made = [DofNumbering(scene, mesh_of(None, self._case.mesh)) for scene in scenes]
            changes, _ = self._case.differences(name, QUANTITY_STEP)
            pairs = zip(made, changes, strict=True)
            found.append([MotionOnly.of_states(n, self._states(p, x)) for n, x in pairs])
        return found

    def _fraction(self, name: str) -> float:
        """Return the relative step of a parameter between runs, which do not reach a switch."""
        # Rotations of such runs in space have the round-off of the products of all steps
        widest = MODEL_STEP if self.solution.scene.in_space else QUANTITY_STEP
        switch = self.ranges[name].change / (abs(self.at[name]) or 1.0)
        if switch < FARTHEST * LEAST_STEP:
            warn(
                f"of: a change of {name} by {self.ranges[name].change:.2g} is a switch of the run, "
                "which differences of material and energies cross: their derivatives are wrong "
                "if it matters. Choose another value, or compare with runs"
            )
            return QUANTITY_STEP
        return min(widest, switch / FARTHEST)

    def _runs(self, p: int, fraction: float) -> list[Solution]:
        """Return whole solutions at values of parameter p, in steps of a fraction of it."""
        if (p, fraction) not in self._repeated:
            if order_of(self.solution.scheme) > 2:  # type: ignore[arg-type]
                raise ArgumentError(
                    "of: this quantity needs section forces, material or energies between the "
                    f"stages of {self.solution.scheme}; use order=2"
                )
            first, name, found = self._first(), [*self.at][p], list[Solution]()
            # Simulations begin at the time of the first run
            simulations = first._case.simulations(name, fraction)
            changes, _ = self._case.differences(name, fraction)
            for simulation, change in zip(simulations, changes, strict=True):
                with closing(simulation):
                    found.append(self._repeat(simulation, p, change))
            self._repeated[p, fraction] = found
        return self._repeated[p, fraction]

    def _first(self) -> Derivatives:
        """Return the first of the runs; raise if too many steps of a run were divided."""
        if self._substeps is None:
            raise ArgumentError(
                "of: this quantity needs material or energies, and many steps of the run were "
                "divided; use a smaller dt"
            )
        return self if self._start is None else self._start._first()

    @cached_property
    def _ends(self) -> list[list[Solution]]:
        """Ends of runs at neighbouring values of each parameter, to first order.

        Internal variables of the run grow by their derivatives, without a switch of any point.
        Accumulated energies do not change; :meth:`_runs` has energies for quantities.
        """
        known, (*states, reactions, q, rates) = self.end
        held, ends = np.zeros(q.shape), list[list[Solution]]()
        held[:, self._constrained_dofs] = reactions
        changes = {"q": q, "reactions": held}
        for p, name in enumerate(self.at):
            ends.append([])
            simulations = self._case.simulations(name, MODEL_STEP)
            positions, _ = self._case.differences(name, MODEL_STEP)
            for simulation, change in zip(simulations, positions, strict=True):
                with closing(simulation):
                    if (inertia := simulation.equation.inertia) is not None:
                        changes |= zip(inertia.names, rates[V:], strict=True)
                    both = ((k, known[k], x[p]) for k, x in changes.items() if k in known)
                    moved = {k: value + change * x for k, value, x in both}
                    simulation.save_or_restore(Archive(simulation.subdomain, known | moved))
                    for k, i, of in self._places:
                        of(simulation.equation.terms[i])[...] += change * states[k][p]
                    simulation.end()
                    ends[p].append(simulation.solution)
        return ends

    def _repeat(self, simulation: Simulation, p: int, change: float) -> Solution:
        """Return the states of a simulation whose motion follows from a change of a parameter."""
        if self._start is not None:
            earlier = self._start._repeat(simulation, p, change)
            simulation.solution = Solution(earlier.scene, earlier.numbering, earlier)
        steps, _, q = self._all_ends(p, change)
        simulation.repeat(steps, q[1:])
        simulation.end()
        return simulation.solution


def in_scene(quantity: Callable[[Solution], npt.ArrayLike], solution: Solution) -> npt.ArrayLike:
    """Return a quantity in a neighbouring scene, which may have other beams than the scene."""
    try:
        return quantity(solution)
    except ArgumentError as error:
        raise ArgumentError(
            f"{error}. If the model makes new beams at each call, find places in the scene "
            "of the solution, as in lambda s: s.displacement(s.scene.beams[0].end)"
        ) from error


def _as_array(values: Any) -> Array:
    """Return the result of a quantity as an array, of complex numbers if it has some."""
    try:
        found = np.asarray(values) if values is not None else None
        if found is not None:
            found = found.astype(np.complex128 if np.iscomplexobj(found) else np.float64)
    except (TypeError, ValueError):
        found = None
    if found is None:
        raise ArgumentError(
            f"of: quantity returned {shorten(values)}; it must return a number or an array"
        )
    return found


class Unknown(Exception):
    """A quantity needs numbers that the derivatives of the motion do not have."""


class MotionOnly(Solution):
    """States in a scene, of which only some columns are known."""

    def __init__(
        self, numbering: DofNumbering, blocks: Sequence[Block], known: Collection[str]
    ) -> None:
        super().__init__(numbering.scene, numbering)
        self._blocks, self._known = [*blocks], known

    @classmethod
    def of_states(cls, numbering: DofNumbering, states: State) -> MotionOnly:
        """Return the states in a scene from their columns."""
        columns = Columns({name: x.shape[1:] for name, x in states.items()})
        rows = np.column_stack([x.reshape(len(x), -1) for x in states.values()])
        return cls(numbering, [Block(columns, rows, len(rows))], {*states, "v"})

    def column(self, name: str) -> Column:
        """Return a column of the states."""
        if name not in self._known:
            raise Unknown
        return super().column(name)

    def _row(self, name: str, n: int) -> Array:
        return self.column(name)[n,]

    def _refuse(self, *_: Any) -> NoReturn:
        raise Unknown

    ledger = cell_resultants = _refuse  # type: ignore[assignment]
    internal = property(_refuse, lambda self, value: None)  # type: ignore[assignment]
