# SPDX-License-Identifier: MIT
"""Loads that are held constant at their values at 1 s, and the equilibrium under them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ufl_beam.errors import ConvergenceError, require_kind, require_switch
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.functions import Constant, Table, TimeFunction, value_at
from ufl_beam.model.loads import Load, RotatingFrame
from ufl_beam.model.scene import Scene
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.solution import Solution
from ufl_beam.solvers.newton_options import Newton

AT = 1.0
"""Time at which loads are evaluated: the end of a static run from 0 to 1; s."""

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


def with_amplitude(load: Any, amplitude: TimeFunction) -> Any:
    """Return a load with another function of time; a :class:`RotatingFrame` has none."""
    return load if isinstance(load, RotatingFrame) else replace(load, amplitude=amplitude)


def grown(load: Load, factor: float = 1.0) -> Load:
    """Return a load that grows from zero at -1 s to its final value at 0 s.

    The final value is ``factor`` times the value of ``load`` at :data:`AT`.
    """
    grown: Load = with_amplitude(load, Table((-1.0, 0.0), (0.0, factor * size_of(load))))
    return grown


def constant(load: Load) -> Load:
    """Return a load that has its value at the time :data:`AT` at all times."""
    constant: Load = with_amplitude(load, Constant(size_of(load)))
    return constant


def loaded_state(
    scene: Scene, what: str, mesh: Mesh | None, newton: Newton | None
) -> tuple[Scene, Solution | None]:
    """Return the scene with constant loads, and a run from -1 s to 0 s to its equilibrium.

    The equilibrium is None if the scene has no loads.

    Raises:
        ConvergenceError: There is no equilibrium; the message begins with ``what``.
    """
    if not scene.loads:
        return scene, None
    growing = replace(scene, loads=[grown(load) for load in scene.loads])
    try:
        state = simulate(
            growing, Static(), t=(-1.0, 0.0), dt=1.0 / STEPS, mesh=mesh, newton=newton,
            progress=False,
        )  # fmt: skip
    except ConvergenceError as error:
        fraction = 1.0 + error.time
        error.args = (
            f"{what}: no equilibrium beyond {fraction:.3g} times the loads of the scene: {error}",
        )
        raise
    return replace(scene, loads=[constant(load) for load in scene.loads]), state
