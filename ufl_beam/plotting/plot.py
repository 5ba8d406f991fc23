# SPDX-License-Identifier: MIT
"""Function for all pictures but solid ones: of models, solutions and results of analyses."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from typing import Any

from ufl_beam.analysis.modes import Shapes
from ufl_beam.analysis.parameter_study import Study
from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.errors import ArgumentError, shorten
from ufl_beam.model.scene import Scene
from ufl_beam.model.sections import Section
from ufl_beam.output.extremes import Extremes
from ufl_beam.plotting.analysis_pictures import draw_study, draw_tradeoff
from ufl_beam.plotting.frame_pictures import draw_damage_state, draw_shape
from ufl_beam.plotting.history_pictures import (
    draw_energy,
    draw_extremes,
    draw_history,
    draw_modes,
    draw_shapes,
)
from ufl_beam.plotting.inelastic_pictures import draw_dissipation, draw_hinge, draw_moment_curvature
from ufl_beam.plotting.model import draw_model
from ufl_beam.plotting.section_pictures import draw_section
from ufl_beam.plotting.style import COLUMNS, COMPONENTS, RESULTANTS, Figure
from ufl_beam.simulation.solution import Solution

PICTURES: dict[type, dict[str, Callable[..., Figure]]] = {
    Scene: {"model": draw_model},
    Section: {"section": draw_section},
    Solution: {
        "shape": draw_shape,
        **{name: partial(draw_shape, quantity=name) for name in RESULTANTS},
        "damage": draw_damage_state,
        "shapes": draw_shapes,
        "history": draw_history,
        "energy": draw_energy,
        "dissipation": draw_dissipation,
        "hinge": draw_hinge,
        "moment-curvature": draw_moment_curvature,
    },
    Shapes: {"modes": draw_modes},
    Extremes: {name: partial(draw_extremes, quantity=name) for name in ("M", "N", "V")},
    Study: {"results": draw_study},
    Tradeoff: {"errors": draw_tradeoff},
}
"""Pictures by class and quantity; the first one of a class is drawn by default.

Modules that define further results add their pictures; see ``structures/pictures.py``.
"""

IN_SPACE: dict[type, dict[str, Callable[..., Figure]]] = {
    Solution: PICTURES[Solution] | {name: partial(draw_shape, quantity=name) for name in COLUMNS},
    Extremes: {name: partial(draw_extremes, quantity=name) for name in COMPONENTS},
}
"""The same of scenes in space, where they are others."""


def plot(shown: Any, quantity: str = "", *places: Any, **options: Any) -> Figure:
    """Draw a model, a solution, or the result of an analysis.

    By default, the first quantity of the class is drawn.  A ``Path`` is a ``Solution``.  For the
    results of ``ufl_beam.structures`` see the docstring of ``ufl_beam.structures``.

    ==================  ==================  ========================================================
    shown               quantity            picture and further arguments
    ==================  ==================  ========================================================
    Scene               "model"             the whole model, before any run; ``ax``
    Section             "section"           outline and fibres of a cross-section; ``ax``
    Solution            "shape"             the frame at one time; ``n``, ``magnify``, ``ax``
    Solution            "N", "V", "M"       diagram of a section force; ``n``, ``magnify``, ``ax``
    Solution            "damage"            yielded cells, opened hinges; ``n``, ``limits``, ...
    Solution            "shapes"            shapes; ``times`` or ``count``, ``magnify``, ``ax``
    Solution            "history"           motion over time; places, ``component``, ``ax``
    Solution            "energy"            the energy ledger over time
    Solution            "dissipation"       energy losses over time; ``ax``
    Solution            "hinge"             moment of a hinge; a place or connector, ``ax``
    Solution            "moment-curvature"  moment of a cell; a place, ``ax``
    Modes, Buckling     "modes"             shapes side by side; ``numbers``, ``amplitude``
    Extremes            "M", "N", "V"       envelope of a section force; ``ax``
    Study               "results"           results over the cases
    Tradeoff            "errors"            errors over wall times; ``ax``
    ==================  ==================  ========================================================

    Scenes in space are drawn in a view with z up; ``ax`` then are axes in space.  A solution has
    "N", "V", "T", "M", and the components "V2", "V3", "M2", "M3" in axes of the sections.  V and M
    are drawn as vectors, M on the side of tension.  Extremes have components.  Moments of "hinge"
    and "moment-curvature" are about axis 3.  Components of "history" are "u", "v", "w" and their
    rates, and "rx", "ry", "rz" of the rotation vector.

    Args:
        shown: Object to draw.
        quantity: Quantity to draw.
        places: Place of "hinge" and "moment-curvature", or connector of "hinge"; one or a sequence
            of places of "history"; hot spot of "cycles" of a ``Fatigue``
            with several.
        options: ``n`` is the index of a recorded time, negative from the end.  ``magnify`` is a
            factor on displacements.  ``times`` (s) are replaced by the nearest recorded times;
            ``count`` is a number of shapes.  ``component`` is "v" by default, "u", "psi", or a
            rate of one of them, such as "du/dt" or "d2u/dt2".  ``numbers`` are indices of modes,
            all by default.  ``amplitude`` is their largest displacement, as a fraction of the size
            of the scene.  ``limits`` are acceptance limits that colour hinges, as in
            ``structures.hinge_table``.  ``ax`` are axes to draw in, instead of a new figure.

    Raises:
        ArgumentError: There is no such picture, or one of its arguments is wrong; the message says
            which.

    Example:
        >>> ub.plot(scene).savefig("model.png")
        >>> ub.plot(solution, "M", magnify=10).savefig("moments.png")
        >>> ub.plot(solution, "history", beam.end, component="v").savefig("history.png")
        >>> ub.plot(ub.modes(scene, 3)).savefig("modes.png")
    """
    pictures = next((PICTURES[kind] for kind in PICTURES if isinstance(shown, kind)), None)
    if pictures is None:
        raise ArgumentError(
            f"plot: {shorten(shown)} is a {type(shown).__name__}, which has no picture; there are "
            f"pictures of {', '.join(kind.__name__ for kind in PICTURES)}"
        )
    scene = shown if isinstance(shown, Scene) else getattr(shown, "scene", None)
    scene = scene or getattr(getattr(shown, "solution", None), "scene", None)
    if isinstance(scene, Scene) and scene.in_space:
        pictures = next((IN_SPACE[kind] for kind in IN_SPACE if isinstance(shown, kind)), pictures)
    if quantity and quantity not in pictures:
        hint = "; a scene has none before a run" if isinstance(shown, Scene) else ""
        raise ArgumentError(
            f"plot: quantity = {quantity!r} of a {type(shown).__name__} is not one of "
            f"{', '.join(pictures)}{hint}"
        )
    quantity = quantity or next(iter(pictures))
    draw = pictures[quantity]
    try:
        inspect.signature(draw).bind(shown, *places, **options)
    except TypeError as error:
        takes = ", ".join([*inspect.signature(draw).parameters][1:]) or "no further arguments"
        raise ArgumentError(f"plot: {error}; the picture {quantity!r} takes {takes}") from None
    from matplotlib.axes import Axes

    ax = options.get("ax")
    if not isinstance(ax, Axes | None):
        raise ArgumentError(
            f"ax = {shorten(ax)} must be axes of Matplotlib, as plt.subplots() makes"
        )
    return draw(shown, *places, **options)
