# SPDX-License-Identifier: MIT
"""Planar flexible multibody dynamics with geometrically exact beams.  Units are SI."""

from ufl_beam import compat  # noqa: F401 - first, because it explains what is not installed

# isort: split

from ufl_beam.beams import Beam, Place
from ufl_beam.bodies import Body, Spot, ground
from ufl_beam.checkpoint import Checkpoint
from ufl_beam.classical import GeneralizedAlpha, Newmark, Static
from ufl_beam.connectors import (
    Actuator,
    Connector,
    Controller,
    Coulomb,
    Damper,
    Function,
    Guided,
    Joint,
    Link,
    Motor,
    Prismatic,
    Release,
    Revolute,
    Rigid,
    RigidLink,
    RigidPlastic,
    Slide,
    Spring,
    Stop,
    Stretch,
    Turn,
)
from ufl_beam.continuation import Path, follow
from ufl_beam.controls import ArcLength, Displacement, Dissipation, Load
from ufl_beam.critical import Branch, CriticalPoint
from ufl_beam.cycles import Cycles, Gerber, Goodman, SNCurve, rainflow
from ufl_beam.decay import (
    Decay,
    Envelope,
    damping,
    damping_ratio,
    fit_decay,
    logarithmic_decrement,
    peaks,
)
from ufl_beam.discretisation import Mesh
from ufl_beam.distributions import Lognormal, Normal, TruncatedNormal, Weibull
from ufl_beam.envelopes import plot_cycles, plot_extremes
from ufl_beam.errors import (
    ConvergenceError,
    CopiesDiffer,
    ModelWarning,
    SceneError,
    TradeoffError,
)
from ufl_beam.events import Event, Events
from ufl_beam.exact_schemes import DecayingMidpoint, ExactStatic, Midpoint, PrintedMidpoint
from ufl_beam.extremes import Extent, Extremes
from ufl_beam.fatigue import Fatigue, HotSpot
from ufl_beam.fibres import Fibres
from ufl_beam.gathered import Study
from ufl_beam.hysteresis import (
    plot_damage,
    plot_dissipation,
    plot_hinge,
    plot_moment_curvature,
)
from ufl_beam.laws import DuvautLions, Hardening, LinearSoftening, Perzyna, Softening
from ufl_beam.ledger import Energy
from ufl_beam.loads import (
    FollowerLoad,
    Gravity,
    LineLoad,
    PointLoad,
    RotatingFrame,
    Table,
    ramp,
)
from ufl_beam.mode_pictures import plot_modes
from ufl_beam.modes import Buckling, Modes, buckling, modes
from ufl_beam.pacing import Adaptive
from ufl_beam.pictures import plot
from ufl_beam.precision import Tradeoff
from ufl_beam.record import History, Recorder
from ufl_beam.render import animate, render
from ufl_beam.running import say, simulate
from ufl_beam.scene import (
    Clamped,
    Pinned,
    PointMass,
    Prescribed,
    Roller,
    Scene,
    Support,
    Velocity,
)
from ufl_beam.sections import Section
from ufl_beam.simulation import Simulation
from ufl_beam.solution import Solution, load
from ufl_beam.solve import Newton
from ufl_beam.studies import study
from ufl_beam.time_series import VTKHDF, XDMF
from ufl_beam.tradeoffs import tradeoff
from ufl_beam.version import version
from ufl_beam.view import picture, plot_energy, plot_history, plot_shapes
from ufl_beam.viscous import KelvinVoigt, Rayleigh
from ufl_beam.work_precision import plot_tradeoff

__version__ = version()

__all__ = [
    "VTKHDF",
    "XDMF",
    "Actuator",
    "Adaptive",
    "ArcLength",
    "Beam",
    "Body",
    "Branch",
    "Buckling",
    "Checkpoint",
    "Clamped",
    "Connector",
    "Controller",
    "ConvergenceError",
    "CopiesDiffer",
    "Coulomb",
    "CriticalPoint",
    "Cycles",
    "Damper",
    "Decay",
    "DecayingMidpoint",
    "Displacement",
    "Dissipation",
    "DuvautLions",
    "Energy",
    "Envelope",
    "Event",
    "Events",
    "ExactStatic",
    "Extent",
    "Extremes",
    "Fatigue",
    "Fibres",
    "FollowerLoad",
    "Function",
    "GeneralizedAlpha",
    "Gerber",
    "Goodman",
    "Gravity",
    "Guided",
    "Hardening",
    "History",
    "HotSpot",
    "Joint",
    "KelvinVoigt",
    "LineLoad",
    "LinearSoftening",
    "Link",
    "Load",
    "Lognormal",
    "Mesh",
    "Midpoint",
    "ModelWarning",
    "Modes",
    "Motor",
    "Newmark",
    "Newton",
    "Normal",
    "Path",
    "Perzyna",
    "Pinned",
    "Place",
    "PointLoad",
    "PointMass",
    "Prescribed",
    "PrintedMidpoint",
    "Prismatic",
    "Rayleigh",
    "Recorder",
    "Release",
    "Revolute",
    "Rigid",
    "RigidLink",
    "RigidPlastic",
    "Roller",
    "RotatingFrame",
    "SNCurve",
    "Scene",
    "SceneError",
    "Section",
    "Simulation",
    "Slide",
    "Softening",
    "Solution",
    "Spot",
    "Spring",
    "Static",
    "Stop",
    "Stretch",
    "Study",
    "Support",
    "Table",
    "Tradeoff",
    "TradeoffError",
    "TruncatedNormal",
    "Turn",
    "Velocity",
    "Weibull",
    "animate",
    "buckling",
    "damping",
    "damping_ratio",
    "fit_decay",
    "follow",
    "ground",
    "load",
    "logarithmic_decrement",
    "modes",
    "peaks",
    "picture",
    "plot",
    "plot_cycles",
    "plot_damage",
    "plot_dissipation",
    "plot_energy",
    "plot_extremes",
    "plot_hinge",
    "plot_history",
    "plot_modes",
    "plot_moment_curvature",
    "plot_shapes",
    "plot_tradeoff",
    "rainflow",
    "ramp",
    "render",
    "say",
    "simulate",
    "study",
    "tradeoff",
]
