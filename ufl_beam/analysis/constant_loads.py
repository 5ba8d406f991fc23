# SPDX-License-Identifier: MIT
"""Loads that are held constant at their values at 1 s, and the equilibrium under them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ufl_beam.errors import ConvergenceError, require_kind, require_switch
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.functions import Constant, Table, TimeFunction, value_at
from ufl_beam.model.loads import Load, MovingLoad, RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton

AT = 1.0  # time at which loads are evaluated: the end of a static run from 0 to 1; s

REST = 1e12
"""Duration of a run to an equilibrium at rest, in which the forces of dampers and viscous laws
vanish; s."""

STEPS = 10  # number of equal steps in which loads grow


def require_options(newton: object, mesh: object, progress: object, what: str) -> None:
    """Raise :class:`ArgumentError` unless the options of the runs of an analysis are valid."""
    if newton is not None:
        require_kind(newton, Newton, f"{what}: newton")
    if mesh is not None:
        require_kind(mesh, Mesh, f"{what}: mesh")
    require_switch(progress, f"{what}: progress")


def size_of(load: Load) -> float:
    """Return the factor on a load at the time :data:`AT`."""
    return value_at(load.amplitude, AT, load)


def effect_at(load: Any) -> str:
    """Describe a load that has no effect at the time :data:`AT`, or changes later; else empty."""
    size, last, times = size_of(load), load.amplitude, np.linspace(0.0, AT, 41)
    with suppress(Exception):  # the function need not exist before the time AT
        if abs(size) <= 1e-9 * max(abs(float(last(t))) for t in times):
            size = 0.0  # as sin(π t)
    if size == 0.0:
        return f"has no force at t = {AT:g} s, and that value counts; give it its final amplitude"
    on = load.length if isinstance(load, MovingLoad) else 0.0
    if on and not 0.0 <= value_at(load.position, AT, load) <= on:
        return f"is not on its beam at t = {AT:g} s, and that place counts"
    if isinstance(last, Table) and last.times[-1] > AT and last.values[-1] != size:
        return (
            f"has the amplitude {size:g} at t = {AT:g} s, which counts, and {last.values[-1]:g} "
            f"from {last.times[-1]:g} s on; give it its final amplitude"
        )
    return ""


def duration(scene: Scene) -> float:
    """Return the duration of a static run to 1 s: :data:`REST`, or 1 s if the scene varies in it.

    Loads and motions of a scene that depend on time need a run in real time.
    """
    times = (0.0, 0.25, 0.5, 0.75)
    varies = any(
        function(t) != function(AT) for _, function in scene.time_functions() for t in times
    )
    return AT if varies else REST


def with_amplitude(load: Any, amplitude: TimeFunction) -> Load:
    """Return a load with another function of time; a :class:`RotatingFrame` has none.

    A :class:`MovingLoad` stays where it is at the time :data:`AT`.
    """
    if isinstance(load, RotatingFrame):
        return load
    if isinstance(load, MovingLoad):
        load = replace(load, position=Constant(value_at(load.position, AT, load)))
    changed: Load = replace(load, amplitude=amplitude)
    return changed


def grown(load: Load, factor: float = 1.0, *, end: float = 0.0, span: float = REST) -> Load:
    """Return a load that grows from zero during ``span`` (s) to its final value at ``end`` (s).

    The final value is ``factor`` times the value of ``load`` at :data:`AT`.
    """
    return with_amplitude(load, Table((end - span, end), (0.0, factor * size_of(load))))


def constant(load: Load) -> Load:
    """Return a load that has its value at the time :data:`AT` at all times."""
    return with_amplitude(load, Constant(size_of(load)))


def loaded_state(
    scene: Scene, what: str, mesh: Mesh | None, newton: Newton | None
) -> tuple[Scene, Solution | None]:
    """Return the scene with constant loads, and a run to its equilibrium at rest, at 0 s.

    The equilibrium is None if no load acts on the scene.

    Raises:
        ConvergenceError: There is no equilibrium; the message begins with ``what``.
    """
    steady = replace(scene, loads=[constant(load) for load in scene.loads])
    if not any(size_of(load) for load in scene.loads):
        return steady, None
    growing = replace(scene, loads=[grown(load) for load in scene.loads])
    try:
        state = simulate(
            growing, Static(), t=(-REST, 0.0), dt=REST / STEPS, mesh=mesh, newton=newton,
            progress=False,
        )  # fmt: skip
    except ConvergenceError as error:
        fraction = 1.0 + error.time / REST
        error.args = (
            f"{what}: no equilibrium beyond {fraction:.3g} times the loads of the scene: {error}",
        )
        raise
    return steady, state
