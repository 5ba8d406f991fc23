# SPDX-License-Identifier: MIT
"""Pictures of a model before a run, and of a solution at one of its times."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING

from ufl_beam.errors import SceneError
from ufl_beam.model.constraint_checks import require_independent
from ufl_beam.model.scene import Scene
from ufl_beam.plotting import diagrams
from ufl_beam.plotting.model import plot_model
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@singledispatch
def plot(
    shown: Scene | Solution, what: str = "shape", *, n: int = -1, magnify: float = 1.0
) -> Figure:
    """Draw a model before any run, or a solution at one of its times.

    Of a :class:`Scene` it draws the undeformed model: beams, their cells and names, bodies, joints,
    supports, connectors with their sizes, hinges, loads (red), prescribed motions (orange), masses
    and initial velocities (green).  Hollow heads of arrows are loads that turn with their place.
    Names and sizes for which there is no room are left out.

    Of a :class:`Solution` it draws the frame at the n-th kept time, with the diagram of a section
    force if ``what`` names one: M on the side in tension, positive N and V to the left of the way
    from start to end, positive values red, negative ones blue.  N and V are constant in each cell;
    M is linear between the moments at its ends.

    What is orange drives: filled if it gives the motion, hollow if it gives the force.

    Args:
        shown: The scene or the solution.
        what: Of a solution: "shape", "N", "V" or "M".
        n: Number of the kept time of a solution; negative from the end.
        magnify: Factor on the displacements of a solution.

    Raises:
        SceneError: Neither a scene nor a solution; a scene whose constraints repeat; anything but
            the shape of a scene; an unknown ``what``, no such time, or ``magnify`` not positive.

    Example:
        >>> ub.plot(scene).savefig("model.png")
        >>> ub.plot(solution, "M", magnify=10).savefig("moments.png")
    """
    raise SceneError(
        f"plot: {shown!r} is a {type(shown).__name__}; give a Scene, or the Solution of a run"
    )


@plot.register(Solution)
def _(shown: Solution, what: str = "shape", *, n: int = -1, magnify: float = 1.0) -> Figure:
    return diagrams.plot(shown, what, n=n, magnify=magnify)


@plot.register(Scene)
def _(shown: Scene, what: str = "shape", *, n: int = -1, magnify: float = 1.0) -> Figure:
    if (what, n, magnify) != ("shape", -1, 1.0):
        given = {"what": (what, "shape"), "n": (n, -1), "magnify": (magnify, 1.0)}
        said = [
            f"{name} = {value!r}" for name, (value, default) in given.items() if value != default
        ]
        raise SceneError(
            f"plot: a scene has no {', '.join(said)} before a run; plot(scene) draws the model, "
            f"plot(solution, {what!r}) what a run found"
        )
    require_independent(shown)
    return plot_model(shown)
