# SPDX-License-Identifier: MIT
"""Function for all pictures in the plane: of models, solutions and results of analyses."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from ufl_beam.analysis.calibration_result import Calibration
from ufl_beam.analysis.incremental_dynamics_result import DemandCurves
from ufl_beam.analysis.load_combinations_result import LoadCombinations
from ufl_beam.analysis.modes import Shapes
from ufl_beam.analysis.parameter_study import Study
from ufl_beam.analysis.pushover_result import Pushover
from ufl_beam.analysis.response_spectra import ResponseSpectrum
from ufl_beam.analysis.response_spectrum import SpectralResponse
from ufl_beam.analysis.section_analysis import InteractionDiagram, MomentCurvature
from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.errors import ArgumentError, shorten
from ufl_beam.model.ground_motion import GroundMotion
from ufl_beam.model.scene import Scene
from ufl_beam.model.sections import Section
from ufl_beam.output.engineering_results import Storeys
from ufl_beam.output.extremes import Extremes
from ufl_beam.output.fatigue import Fatigue
from ufl_beam.plotting.analysis_pictures import (
    draw_calibration,
    draw_combinations,
    draw_dynamics,
    draw_pushover,
    draw_response,
)
from ufl_beam.plotting.frame_pictures import draw_damage_state, draw_shape
from ufl_beam.plotting.history_pictures import (
    SPECTRA,
    draw_cycles,
    draw_energy,
    draw_extremes,
    draw_history,
    draw_modes,
    draw_motion,
    draw_shapes,
    draw_spectrum,
    draw_storeys,
    draw_study,
    draw_tradeoff,
)
from ufl_beam.plotting.inelastic_pictures import (
    draw_dissipation,
    draw_hinge,
    draw_interaction,
    draw_moment_curvature,
    draw_section_moments,
)
from ufl_beam.plotting.model import draw_model
from ufl_beam.plotting.section_pictures import draw_section
from ufl_beam.plotting.style import RESULTANTS
from ufl_beam.simulation.solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    Storeys: {name: partial(draw_storeys, quantity=name) for name in ("drift", "shear")},
    Fatigue: {"cycles": draw_cycles},
    Study: {"results": draw_study},
    Tradeoff: {"errors": draw_tradeoff},
    MomentCurvature: {"moment-curvature": draw_section_moments},
    InteractionDiagram: {"interaction": draw_interaction},
    Pushover: {"curve": draw_pushover},
    SpectralResponse: {name: partial(draw_response, quantity=name) for name in ("M", "N", "V")},
    LoadCombinations: {name: partial(draw_combinations, quantity=name) for name in ("M", "N", "V")},
    DemandCurves: {"curves": draw_dynamics},
    Calibration: {"fit": draw_calibration},
    GroundMotion: {"motion": draw_motion},
    ResponseSpectrum: {name: partial(draw_spectrum, quantity=name) for name in SPECTRA},
}
"""Pictures by class and quantity; the first one of a class is drawn by default."""


def plot(shown: Any, quantity: str = "", *places: Any, **options: Any) -> Figure:
    """Draw a model, a solution, or the result of an analysis.

    By default, the first quantity of the class is drawn.  A ``Path`` is a ``Solution``.

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
    Storeys             "drift", "shear"    extremes over the height; ``ax``
    Fatigue             "cycles"            rainflow matrix and spectrum; a hot spot
    Study               "results"           results over the cases
    Tradeoff            "errors"            errors over wall times; ``ax``
    MomentCurvature     "moment-curvature"  moment of a section over its curvature; ``ax``
    InteractionDiagram  "interaction"       axial force over moment of a section; ``ax``
    GroundMotion        "motion"            acceleration, velocity, displacement over time
    ResponseSpectrum    any of its arrays   over the period; "pseudo_acceleration" by default
    Pushover            "curve"             capacity curve with its hinges; ``targets``, ``ax``
    SpectralResponse    "M", "N", "V"       combined section force, with both signs; ``ax``
    DemandCurves        "curves"            intensity over demand, fragility; ``labels``
    LoadCombinations    "M", "N", "V"       envelope over the combinations; ``ax``
    Calibration         "fit"               measured and computed values, and the residuals
    ==================  ==================  ========================================================

    Args:
        shown: Object to draw.
        quantity: Quantity to draw.
        places: Place of "hinge" and "moment-curvature", or connector of "hinge"; one or a sequence
            of places of "history"; hot spot of "cycles".
        options: ``n`` is the index of a recorded time, negative from the end.  ``magnify`` is a
            factor on displacements.  ``times`` (s) are replaced by the nearest recorded times;
            ``count`` is a number of shapes.  ``component`` is "u", "v" or "psi", or a rate of one
            of them, such as "du/dt" or "d2u/dt2".  ``numbers`` are indices of modes, all by
            default.  ``amplitude`` is their largest displacement, as a fraction of the size of the
            scene.  ``limits`` are acceptance limits that colour hinges, as in
            :meth:`Solution.hinges`.  ``targets`` is one or several of the target displacements of a
            pushover.  ``labels`` are texts for demand and intensity, such as
            ``("drift (1)", "spectral acceleration (m/s²)")``; by default they are the names of the
            functions of the analysis.  ``ax`` are axes to draw in, instead of a new figure.

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
            f"plot: {shown!r} is a {type(shown).__name__}; give a Scene, a Section, the "
            "Solution of a run, or the result of an analysis"
        )
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
