# SPDX-License-Identifier: MIT
"""Load combinations: one nonlinear run each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ufl_beam.analysis.constant_loads import AT, duration, effect_at, grown, require_options
from ufl_beam.errors import (
    ArgumentError,
    ArgumentTypeError,
    ConvergenceError,
    each_warning_once,
    require_all,
    require_count,
    require_kind,
    require_number,
    require_text,
    shorten,
    warn,
)
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.loads import Load, RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.structures.load_combinations_result import LoadCombinations


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
        growing = [
            grown(load, row.get(case, 0.0), end=AT, span=span)
            for case in used
            for load in loads[case]
        ]
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
