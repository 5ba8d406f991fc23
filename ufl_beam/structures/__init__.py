# SPDX-License-Identifier: MIT
"""Analyses of structures: pushover, spectra, combinations, concrete, steel, fatigue, decay.

This package uses the public interface of ``ufl_beam``, which does not import it.  Units are SI.
Examples use the names of the example of ``ufl_beam``.  ``ub.plot`` draws the results:

==================  ==================  ============================================================
shown               quantity            picture and further arguments
==================  ==================  ============================================================
Storeys             "drift", "shear"    extremes over the height; ``ax``
Fatigue             "cycles"            rainflow matrix and spectrum; a hot spot
MomentCurvature     "moment-curvature"  moment of a section over its curvature; ``ax``
InteractionDiagram  "interaction"       axial force over moment of a section; ``ax``
GroundMotion        "motion"            acceleration, velocity, displacement over time
ResponseSpectrum    any of its arrays   over the period; "pseudo_acceleration" by default; ``ax``
Pushover            "curve"             capacity curve with its hinges; one or several ``targets``
SpectralResponse    "M", "N", "V"       combined section force, with both signs; ``ax``
LoadCombinations    "M", "N", "V"       envelope over the combinations; ``ax``
DemandCurves        "curves"            intensity over demand, fragility; ``labels`` of both axes
Calibration         "fit"               measured and computed values, and the residuals
==================  ==================  ============================================================

Example:
    >>> import ufl_beam.structures as st
    >>> motion = st.GroundMotion(0.01, np.sin(0.1 * np.arange(200)))
    >>> round(motion.peak, 3)
    1.0
"""

from ufl_beam.model.shapes import Shape
from ufl_beam.structures import pictures  # noqa: F401 - adds pictures to ub.plot
from ufl_beam.structures.calibration import calibrate
from ufl_beam.structures.calibration_result import Calibration as Calibration
from ufl_beam.structures.calibration_result import Measurement
from ufl_beam.structures.concrete_laws import KentPark, Mander
from ufl_beam.structures.fatigue import Cycles as Cycles
from ufl_beam.structures.fatigue import Fatigue, Gerber, Goodman, HotSpot, SNCurve, rainflow
from ufl_beam.structures.free_decay import Decay as Decay
from ufl_beam.structures.free_decay import Envelope as Envelope
from ufl_beam.structures.free_decay import (
    damping,
    damping_ratio,
    fit_decay,
    logarithmic_decrement,
    peaks,
)
from ufl_beam.structures.ground_motion import GroundMotion
from ufl_beam.structures.hinge_laws import (
    AxialBendingHinge,
    Backbone,
    IbarraKrawinkler,
    PinchingHinge,
)
from ufl_beam.structures.hysteresis_laws import (
    ArmstrongFrederick,
    AxialBending,
    BoucWen,
    MenegottoPinto,
    RambergOsgood,
)
from ufl_beam.structures.imperfections import imperfect
from ufl_beam.structures.incremental_dynamics import DemandCurves as DemandCurves
from ufl_beam.structures.incremental_dynamics import Fragility as Fragility
from ufl_beam.structures.incremental_dynamics import incremental_dynamic_analysis
from ufl_beam.structures.load_combinations import Governing as Governing
from ufl_beam.structures.load_combinations import LoadCombinations as LoadCombinations
from ufl_beam.structures.load_combinations import load_combinations
from ufl_beam.structures.pushover import HingeFormation as HingeFormation
from ufl_beam.structures.pushover import Pushover as Pushover
from ufl_beam.structures.pushover import TargetDisplacement as TargetDisplacement
from ufl_beam.structures.pushover import pushover
from ufl_beam.structures.response_spectra import ResponseSpectrum as ResponseSpectrum
from ufl_beam.structures.response_spectra import response_spectrum
from ufl_beam.structures.section_analysis import InteractionDiagram as InteractionDiagram
from ufl_beam.structures.section_analysis import MomentCurvature as MomentCurvature
from ufl_beam.structures.section_analysis import interaction_diagram, moment_curvature
from ufl_beam.structures.sectionproperties import of_sectionproperties
from ufl_beam.structures.spectral_analysis import SpectralResponse as SpectralResponse
from ufl_beam.structures.spectral_analysis import response_spectrum_analysis
from ufl_beam.structures.steel_sections import box, channel, i_shape, steel, t_shape
from ufl_beam.structures.storeys_and_hinges import HingeTable as HingeTable
from ufl_beam.structures.storeys_and_hinges import Storeys as Storeys
from ufl_beam.structures.storeys_and_hinges import hinge_table, storeys

__all__ = [
    "ArmstrongFrederick",
    "AxialBending",
    "AxialBendingHinge",
    "Backbone",
    "BoucWen",
    "Fatigue",
    "Gerber",
    "Goodman",
    "GroundMotion",
    "HotSpot",
    "IbarraKrawinkler",
    "KentPark",
    "Mander",
    "Measurement",
    "MenegottoPinto",
    "PinchingHinge",
    "RambergOsgood",
    "SNCurve",
    "Shape",
    "box",
    "calibrate",
    "channel",
    "damping",
    "damping_ratio",
    "fit_decay",
    "hinge_table",
    "i_shape",
    "imperfect",
    "incremental_dynamic_analysis",
    "interaction_diagram",
    "load_combinations",
    "logarithmic_decrement",
    "moment_curvature",
    "of_sectionproperties",
    "peaks",
    "pushover",
    "rainflow",
    "response_spectrum",
    "response_spectrum_analysis",
    "steel",
    "storeys",
    "t_shape",
]

RESULTS = [
    "Calibration", "Cycles", "Decay", "DemandCurves", "Envelope", "Fragility", "Governing",
    "HingeFormation", "HingeTable", "InteractionDiagram", "LoadCombinations", "MomentCurvature",
    "Pushover", "ResponseSpectrum", "SpectralResponse", "Storeys", "TargetDisplacement",
]  # fmt: skip
"""Classes of results; functions and methods return their instances."""
