# SPDX-License-Identifier: MIT
"""Planar flexible multibody dynamics with geometrically exact beams.  Units are SI.

The examples in docstrings, which are run as tests, use the names of this one: a cantilever, and
one with a plastic hinge at its clamped end that has opened.

Example:
    >>> import numpy as np
    >>> import ufl_beam as ub
    >>> section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    >>> beam = ub.Beam((0, 0), (2, 0), section, cells=4)
    >>> force = ub.PointLoad(beam.end, force=(0, -1e5), time=lambda t: t)
    >>> scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[force])
    >>> solution = ub.simulate(scene, ub.Midpoint(), t=(0, 1), dt=0.05)
    >>> weak = ub.Beam((0, 0), (2, 0), section, hinges={0.0: ub.Softening(5e4, energy=1e3)})
    >>> down = ub.Prescribed(weak.end, v=lambda t: -0.05 * t)
    >>> hinged = ub.Scene([weak], supports=[ub.Clamped(weak.start), down])
    >>> broken = ub.simulate(hinged, ub.Static(), t=(0, 1), dt=0.02)
"""

from ufl_beam import dolfinx_compat  # noqa: F401 - first: it explains what is missing

# isort: split

from ufl_beam.analysis.critical_points import Branch, CriticalPoint
from ufl_beam.analysis.free_decay import (
    Decay,
    Envelope,
    damping,
    damping_ratio,
    fit_decay,
    logarithmic_decrement,
    peaks,
)
from ufl_beam.analysis.modes import Buckling, Modes, buckling, modes
from ufl_beam.analysis.parameter_study import Study, study
from ufl_beam.analysis.path_controls import (
    ArcLength,
    DisplacementControl,
    DissipationControl,
    LoadControl,
)
from ufl_beam.analysis.path_following import Path, follow
from ufl_beam.analysis.tradeoff import tradeoff
from ufl_beam.analysis.tradeoff_result import Tradeoff
from ufl_beam.errors import ConvergenceError, CopiesDiffer, ModelWarning, SceneError, TradeoffError
from ufl_beam.mechanics.classical import GeneralizedAlpha, Newmark, Static
from ufl_beam.mechanics.energy_momentum import (
    DecayingMidpoint,
    ExactStatic,
    ExactStep,
    Midpoint,
    Midway,
    PrintedMidpoint,
)
from ufl_beam.mechanics.time_schemes import Coefficients, DynamicScheme, Scheme, Step
from ufl_beam.model import law_functions
from ufl_beam.model.beams import Beam, Mesh
from ufl_beam.model.bodies import Body, Place, PointMass, Spot, Velocity, ground
from ufl_beam.model.connector_law import ConnectorLaw, ForceLaw
from ufl_beam.model.connector_laws import (
    Actuator,
    Clearance,
    Controller,
    Coulomb,
    Damper,
    Motor,
    RigidPlastic,
    Spring,
    Stop,
)
from ufl_beam.model.connectors import Bushing, Connector, Slide, Stretch, Turn
from ufl_beam.model.fibres import Fibres, Lognormal, Normal, TruncatedNormal, Weibull
from ufl_beam.model.functions import Table, ramp
from ufl_beam.model.joints import (
    Guided,
    Joint,
    Link,
    Prismatic,
    Release,
    Revolute,
    Rigid,
    RigidLink,
)
from ufl_beam.model.loads import (
    FollowerLoad,
    Gravity,
    KelvinVoigt,
    LineLoad,
    PointLoad,
    Rayleigh,
    RotatingFrame,
)
from ufl_beam.model.material_law import MaterialLaw
from ufl_beam.model.material_laws import (
    ArmstrongFrederick,
    AxialBending,
    BoucWen,
    DuvautLions,
    Hardening,
    Perzyna,
    RambergOsgood,
)
from ufl_beam.model.scene import Scene
from ufl_beam.model.sections import Section
from ufl_beam.model.softening_laws import LinearSoftening, Softening, SofteningLaw
from ufl_beam.model.supports import Clamped, Pinned, Prescribed, Roller, Support
from ufl_beam.model.works import Potential, VirtualWork
from ufl_beam.output.dolfinx_view import DolfinxView
from ufl_beam.output.extremes import Extent, Extremes
from ufl_beam.output.fatigue import Cycles, Fatigue, Gerber, Goodman, HotSpot, SNCurve, rainflow
from ufl_beam.output.history import Event, Events, History
from ufl_beam.output.output_files import version
from ufl_beam.output.paraview_files import VTKHDF, XDMF
from ufl_beam.output.postprocessing import Diagram
from ufl_beam.output.recorders import Recorder
from ufl_beam.parallel import say
from ufl_beam.plotting.diagrams import plot_damage
from ufl_beam.plotting.films import Film
from ufl_beam.plotting.inelastic import (
    plot_dissipation,
    plot_hinge,
    plot_moment_curvature,
)
from ufl_beam.plotting.model import plot
from ufl_beam.plotting.plots import (
    plot_cycles,
    plot_energy,
    plot_extremes,
    plot_history,
    plot_modes,
    plot_shapes,
    plot_tradeoff,
)
from ufl_beam.plotting.render import Camera, animate, render
from ufl_beam.plotting.style import picture
from ufl_beam.simulation.checkpoint import Checkpoint
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution, load
from ufl_beam.simulation.step_control import Adaptive
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.energy_ledger import Energy

__version__ = version()

__all__ = [
    "VTKHDF", "XDMF", "Actuator", "Adaptive", "ArcLength", "ArmstrongFrederick", "AxialBending",
    "Beam", "Body", "BoucWen", "Branch", "Buckling", "Bushing", "Camera", "Checkpoint", "Clamped",
    "Clearance", "Coefficients", "Connector", "ConnectorLaw", "Controller", "ConvergenceError",
    "CopiesDiffer", "Coulomb", "CriticalPoint", "Cycles", "Damper", "Decay", "DecayingMidpoint",
    "Diagram", "DisplacementControl", "DissipationControl", "DolfinxView", "DuvautLions",
    "DynamicScheme", "Energy", "Envelope", "Event", "Events", "ExactStatic", "ExactStep", "Extent",
    "Extremes", "Fatigue", "Fibres", "Film", "FollowerLoad", "ForceLaw", "GeneralizedAlpha",
    "Gerber", "Goodman", "Gravity", "Guided", "Hardening", "History", "HotSpot", "Joint",
    "KelvinVoigt", "LineLoad", "LinearSoftening", "Link", "LoadControl", "Lognormal", "MaterialLaw",
    "Mesh", "Midpoint", "Midway", "ModelWarning", "Modes", "Motor", "Newmark", "Newton", "Normal",
    "Path", "Perzyna", "Pinned", "Place", "PointLoad", "PointMass", "Potential", "Prescribed",
    "PrintedMidpoint", "Prismatic", "RambergOsgood", "Rayleigh", "Recorder", "Release", "Revolute",
    "Rigid", "RigidLink", "RigidPlastic", "Roller", "RotatingFrame", "SNCurve", "Scene",
    "SceneError", "Scheme", "Section", "Simulation", "Slide", "Softening", "SofteningLaw",
    "Solution", "Spot", "Spring", "Static", "Step", "Stop", "Stretch", "Study", "Support", "Table",
    "Tradeoff", "TradeoffError", "TruncatedNormal", "Turn", "Velocity", "VirtualWork", "Weibull",
    "animate", "buckling", "damping", "damping_ratio", "fit_decay", "follow", "ground",
    "law_functions", "load", "logarithmic_decrement", "modes", "peaks", "picture", "plot",
    "plot_cycles", "plot_damage", "plot_dissipation", "plot_energy", "plot_extremes", "plot_hinge",
    "plot_history", "plot_modes", "plot_moment_curvature", "plot_shapes", "plot_tradeoff",
    "rainflow", "ramp", "render", "say", "simulate", "study", "tradeoff",
]  # fmt: skip
