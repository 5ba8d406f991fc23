# SPDX-License-Identifier: MIT
"""Load combinations, one nonlinear run each, and the envelope of their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.constant_loads import AT, duration, effect_at, grown, require_options
from ufl_beam.arrays import Array
from ufl_beam.display import Rich, in_one_line
from ufl_beam.errors import (
    ArgumentError,
    ArgumentTypeError,
    ConvergenceError,
    each_warning_once,
    require_all,
    require_array,
    require_count,
    require_kind,
    require_number,
    require_text,
    shorten,
    warn,
)
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import AttachmentPoint, Member
from ufl_beam.model.loads import Load, RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import Support
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton


@in_one_line
class Governing(NamedTuple):
    """Smallest and largest values over load combinations, as arrays of the same shape.

    Attributes:
        low: The least values.
        high: The largest values.
        low_by: Names (``str``) of the combinations with the least values.
        high_by: Names (``str``) of the combinations with the largest values.

    Example:
        >>> free = ub.Scene([beam], supports=scene.supports)
        >>> cases = {"G": [ub.Gravity()], "Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
        >>> both = st.load_combinations(free, cases, {"1": {"G": 1.35, "Q": 1.5}, "2": {"G": 1}})
        >>> forces = both.section_forces(beam)
        >>> print(forces.high[0, 1].round(), forces.high_by[0, 1])  # V at the start; N
        -3080.0 2
    """

    low: Array
    high: Array
    low_by: npt.NDArray[Any]
    high_by: npt.NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class LoadCombinations(Rich):
    """Runs of load combinations and their envelope; made by :func:`load_combinations`.

    Attributes:
        factors: Factor of each load case, by the names of combination and case.
        solutions: Solution of each combination that has an equilibrium, by its name; the last state
            has the whole loads.
        failed: Reason why a combination has no equilibrium, by its name.

    Example:
        >>> free = ub.Scene([beam], supports=scene.supports)
        >>> cases = {"G": [ub.Gravity()], "Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
        >>> both = st.load_combinations(free, cases, {"1": {"G": 1.35, "Q": 1.5}, "2": {"G": 1}})
        >>> M = both.section_forces(beam)
        >>> print(M.low[0, 2].round(-2), M.low_by[0, 2])  # N m
        -34200.0 1
        >>> figure = ub.plot(both, "M")
    """

    factors: dict[str, dict[str, float]]
    solutions: dict[str, Solution]
    failed: dict[str, str]

    @property
    def scene(self) -> Scene:
        """Model, with the loads of the first combination that has an equilibrium."""
        return next(iter(self.solutions.values())).scene

    def envelope(self, value: Callable[[Solution], npt.ArrayLike]) -> Governing:
        """Return extremes of a function of a solution, such as the drift of a storey.

        Example:
            >>> free = ub.Scene([beam], supports=scene.supports)
            >>> cases = {"Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
            >>> both = st.load_combinations(free, cases, {"A": {"Q": 1.5}, "B": {"Q": -1.0}})
            >>> both.envelope(lambda run: run.displacement(beam.end)[-1, 1]).low_by
            'A'
        """
        names = np.array([*self.solutions], dtype=object)  # its elements are str, not np.str_
        values = np.array([
            require_array(value(run), f"envelope: the value of combination {name!r}")
            for name, run in self.solutions.items()
        ])  # fmt: skip
        return Governing(
            values.min(axis=0), values.max(axis=0),
            names[values.argmin(axis=0)], names[values.argmax(axis=0)],
        )  # fmt: skip

    def section_forces(self, beam: Member, *, points: int = 9) -> Governing:
        """Return extremes of (N, V, M) at points of the cells of a beam; N, N, N m.

        In space, they are of (N, V2, V3, T, M2, M3).
        Rows have the order of a :class:`Diagram` with the same points; (num_cells · points, 3).

        Raises:
            ArgumentError: The beam is not in the scene, or ``points`` is less than 2.
        """
        return self.envelope(lambda run: np.transpose(run.diagram(beam, points=points)[1:]))

    def displacement(self, place: AttachmentPoint) -> Governing:
        """Return extremes of (u, v, ψ) of a place; (3,); m, m, rad."""
        return self.envelope(lambda run: run.displacement(place)[-1])

    def reaction(self, support: Support) -> Governing:
        """Return extremes of the force (x, y) and moment of a support; (3,); N, N, N m.

        Raises:
            ArgumentError: The support is not in the scene.
        """
        return self.envelope(lambda run: run.reaction(support)[-1])

    def __str__(self) -> str:
        first = next(iter(self.solutions.values()))
        width = max(len(name) for name in self.factors)
        lines = [f"{repr(self)[1:-1]}; extremes of section forces and their combinations"]
        for beam in first.scene.beams:
            reached = self.section_forces(beam)
            for k, name in enumerate(first.diagram(beam)._fields[1:]):
                unit = "kN m" if name[0] in "MT" else "kN"  # SI units are divided by 1000
                low, high = int(reached.low[:, k].argmin()), int(reached.high[:, k].argmax())
                lines.append(
                    f"  {beam.name:12s} {name} {reached.low[low, k] / 1e3:10.2f} {unit:4s} "
                    f"{reached.low_by[low, k]:{width}s} {reached.high[high, k] / 1e3:10.2f} "
                    f"{unit:4s} {reached.high_by[high, k]}"
                )
        return "\n".join([*lines, *(f"  {name}: {why}" for name, why in self.failed.items())])

    def __repr__(self) -> str:
        return f"<LoadCombinations: {len(self.factors)} combinations, {len(self.failed)} failed>"


@each_warning_once()
def load_combinations(
    scene: Scene,
    cases: Mapping[str, Sequence[Load]],
    combinations: Mapping[str, Mapping[str, float]],
    *,
    steps: int = 10,
    newton: Newton | None = None,
    mesh: Mesh | None = None,
    progress: bool = True,
) -> LoadCombinations:
    """Compute the equilibrium under each combination of load cases.

    Results of nonlinear models cannot be superposed, so each combination is a static run.  The
    loads of its cases grow together from zero to the factor times their value at t = 1 s: a pulse
    that has ended gives nothing, and a ramp of 10 s a tenth of the load.  Loads
    and motions of the scene itself act in every combination, unchanged.  They grow so slowly that
    dampers and viscous laws bear nothing.  Only if loads or motions of the scene depend on time, a
    run is from 0 to 1 s in real time.  Damping of the scene is ignored.  All runs have the same
    vertices, also where loads of other combinations begin or end.

    Args:
        scene: Model.
        cases: Loads of each case by its name, such as "dead", "snow", "wind from the left".
        combinations: Factors of cases by the name of each combination, such as
            ``{"ULS 1": {"dead": 1.35, "snow": 1.5}}``.
        steps: Number of steps of each run.
        newton: Tolerances and options of Newton's method.
        mesh: Discretization; by default the cells of the beams.
        progress: Show progress bars in a terminal or notebook.

    Raises:
        ArgumentError: The call is wrong, such as a combination with the name of no case.
        ConvergenceError: No combination has an equilibrium.

    Warns:
        ModelWarning: A combination has no equilibrium; the envelope leaves it out.  Or a load of a
            case has no force at 1 s, or a ``Table`` or ``ramp`` still changes after 1 s.

    Example:
        >>> free = ub.Scene([beam], supports=scene.supports)
        >>> cases = {"G": [ub.Gravity()], "Q": [ub.PointLoad(beam.end, force=(0, -1e4))]}
        >>> both = st.load_combinations(free, cases, {"1": {"G": 1.35, "Q": 1.5}, "2": {"G": 1}})
        >>> reaction = both.reaction(scene.supports[0])
        >>> print(reaction.high[1].round(), reaction.high_by[1])  # N
        19158.0 1
    """
    what = "load_combinations"
    require_kind(scene, Scene, f"{what}: scene")
    steps = require_count(steps, f"{what}: steps")
    require_options(newton, mesh, progress, what)
    loads = dict[str, tuple[Load, ...]]()
    for name, case in _named(cases, f"{what}: cases").items():
        loads[name] = require_all(case, f"{what}: cases[{name!r}]", Load)
        if any(isinstance(load, RotatingFrame) for load in loads[name]):
            raise ArgumentError(
                f"{what}: cases[{name!r}]: forces of a RotatingFrame have no factor; give the "
                "frame to the scene"
            )
        for load in loads[name]:
            if any(load is other for other in scene.loads):
                raise ArgumentError(
                    f"{what}: {load} of cases[{name!r}] is in the scene, too, and would act twice; "
                    "give replace(scene, loads=[]), or leave it out of the case"
                )
            if said := effect_at(load):
                warn(f"{what}: {load} of cases[{name!r}] {said}")
    scene = replace(scene, damping=())
    span = duration(scene)
    factors = dict[str, dict[str, float]]()
    for name, combination in _named(combinations, f"{what}: combinations").items():
        where = f"{what}: combinations[{name!r}]"
        factors[name] = row = {}
        for case, factor in _named(combination, where).items():
            if case not in loads:
                raise ArgumentError(f"{where}: {case!r} is not a case; cases: {', '.join(loads)}")
            row[case] = require_number(factor, f"{where}[{case!r}]")
    # Loads begin and end at vertices, which must be the same in all runs
    used = [case for case in loads if any(case in row for row in factors.values())]
    scenes = dict[str, Scene]()
    for name, row in factors.items():
        pairs = ((load, row.get(case, 0.0)) for case in used for load in loads[case])
        growing = [grown(load, factor, end=AT, span=span) for load, factor in pairs]
        scenes[name] = replace(scene, loads=[*scene.loads, *growing])
    solutions, failed = dict[str, Solution](), dict[str, str]()
    for name, loaded in scenes.items():
        try:
            solutions[name] = simulate(
                loaded, Static(), t=(AT - span, AT), dt=span / steps, every=steps,
                newton=newton, mesh=mesh, progress=progress,
            )  # fmt: skip
        except ConvergenceError as error:
            fraction = 1.0 - (AT - error.time) / span
            failed[name] = f"no equilibrium beyond {fraction:.3g} of its loads: {error}"
            error.args = (f"{name}: {failed[name]}",)
            if len(failed) == len(scenes):
                raise
            warn(f"{what}: {error}")
    return LoadCombinations(factors, solutions, failed)


def _named(value: Any, what: str) -> dict[str, Any]:
    """Return ``value`` as a dictionary with at least one text as key, or raise."""
    if not isinstance(value, Mapping):
        raise ArgumentTypeError(f"{what} = {shorten(value)} must be a dict, with names as keys")
    if not value:
        raise ArgumentError(f"{what} is empty")
    for name in value:
        require_text(name, f"{what}: name")
    return dict(value)
