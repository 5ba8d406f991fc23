# SPDX-License-Identifier: MIT
"""Plane frames and flexible multibody systems of geometrically exact beams.  Units are SI.

The examples in docstrings run as tests.  They use the names of the example below: a cantilever with
its solution, and a cantilever whose plastic hinge at the clamped end softens.

Example:
    >>> import numpy as np
    >>> import ufl_beam as ub
    >>> section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    >>> beam = ub.Beam((0, 0), (2, 0), section, cells=4)
    >>> force = ub.PointLoad(beam.end, force=(0, -1e5), amplitude=lambda t: t)
    >>> scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[force])
    >>> solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.05)
    >>> law = ub.Softening(limit=5e4, fracture_energy=1e3)
    >>> weak = ub.Beam((0, 0), (2, 0), section, hinges={0.0: law})
    >>> down = ub.PrescribedDisplacement(weak.end, v=lambda t: -0.05 * t)
    >>> hinged = ub.Scene([weak], supports=[ub.Clamped(weak.start), down])
    >>> broken = ub.simulate(hinged, ub.Static(), t=(0, 1), dt=0.02)
"""

from importlib import import_module
from typing import NoReturn

from ufl_beam import dolfinx_compat  # noqa: F401 - first: its errors explain missing packages

# isort: split

from ufl_beam import extend as extend
from ufl_beam.analysis.critical_points import Branch as Branch
from ufl_beam.analysis.critical_points import CriticalPoint as CriticalPoint
from ufl_beam.analysis.derivatives import Derivatives as Derivatives
from ufl_beam.analysis.derivatives import Range as Range
from ufl_beam.analysis.derivatives import differentiate
from ufl_beam.analysis.gradient import gradient as gradient
from ufl_beam.analysis.linear_model import LinearModel as LinearModel
from ufl_beam.analysis.linear_model import linearize
from ufl_beam.analysis.modes import Buckling as Buckling
from ufl_beam.analysis.modes import Modes as Modes
from ufl_beam.analysis.modes import buckling, modes
from ufl_beam.analysis.parameter_study import Study as Study
from ufl_beam.analysis.parameter_study import study
from ufl_beam.analysis.path_controls import (
    ArcLength,
    DisplacementControl,
    DissipationControl,
    LoadControl,
)
from ufl_beam.analysis.path_following import Path as Path
from ufl_beam.analysis.path_following import follow
from ufl_beam.analysis.tradeoff import tradeoff
from ufl_beam.analysis.tradeoff_result import Tradeoff as Tradeoff
from ufl_beam.errors import ArgumentError, ConvergenceError, ModelError, ModelWarning
from ufl_beam.mechanics.time_schemes import (
    EnergyMomentum,
    EnergyMomentumDecaying,
    EnergyMomentumPrinted,
    EnergyMomentumStatic,
    GeneralizedAlpha,
    Newmark,
    Static,
)
from ufl_beam.model import distributions as distributions
from ufl_beam.model.beams import Beam, Mesh
from ufl_beam.model.bodies import Body, PointMass, Velocity, ground
from ufl_beam.model.bodies import BodyPoint as BodyPoint
from ufl_beam.model.bodies import Place as Place
from ufl_beam.model.connector_law import ForceLaw
from ufl_beam.model.connector_laws import (
    Clearance,
    Controller,
    Coulomb,
    Damper,
    PrescribedForce,
    PrescribedMotion,
    RigidPlastic,
    Spring,
    Stop,
)
from ufl_beam.model.connectors import Bushing, Connector, Slide, Stretch, Turn
from ufl_beam.model.fibres import Fibres
from ufl_beam.model.functions import Spline, Table, ramp
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.joints import (
    Cylindrical,
    Guided,
    Link,
    Prismatic,
    Release,
    Revolute,
    Rigid,
    RigidLink,
    Spherical,
    Universal,
)
from ufl_beam.model.loads import (
    FollowerLoad,
    Gravity,
    KelvinVoigt,
    LineLoad,
    MovingLoad,
    PointLoad,
    Pressure,
    Rayleigh,
    RotatingFrame,
)
from ufl_beam.model.material_laws import DuvautLions, ElastoPlastic, Perzyna
from ufl_beam.model.scene import Scene
from ufl_beam.model.sections import Section
from ufl_beam.model.softening_laws import LinearSoftening, Softening
from ufl_beam.model.supports import Clamped, Pinned, PrescribedDisplacement, Roller, Support
from ufl_beam.model.works import Effect, Potential, VirtualWork
from ufl_beam.output.dolfinx_view import DolfinxView as DolfinxView
from ufl_beam.output.extremes import Extent as Extent
from ufl_beam.output.extremes import Extremes
from ufl_beam.output.history import Event as Event
from ufl_beam.output.history import Events, History
from ufl_beam.output.output_files import version
from ufl_beam.output.paraview_files import VTKHDF, XDMF
from ufl_beam.output.section_forces import Diagram as Diagram
from ufl_beam.output.section_forces import DiagramInSpace as DiagramInSpace
from ufl_beam.parallel import print_once
from ufl_beam.plotting.films import Film as Film
from ufl_beam.plotting.plot import plot
from ufl_beam.plotting.render import Camera, animate, render
from ufl_beam.plotting.style import picture
from ufl_beam.simulation.checkpoint import Checkpoint
from ufl_beam.simulation.run import simulate
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_lengths import Adaptive
from ufl_beam.solvers.newton_options import Newton
from ufl_beam.terms.energy_ledger import Energy as Energy

__version__ = version()

__all__ = [
    "VTKHDF", "XDMF", "Adaptive", "ArcLength", "ArgumentError", "Beam", "Body", "Bushing", "Camera",
    "Checkpoint", "Clamped", "Clearance", "Connector", "Controller", "ConvergenceError", "Coulomb",
    "Cylindrical", "Damper", "DisplacementControl", "DissipationControl", "DuvautLions", "Effect",
    "ElastoPlastic", "EnergyMomentum", "EnergyMomentumDecaying", "EnergyMomentumPrinted",
    "EnergyMomentumStatic", "Events", "Extremes", "Fibres", "FollowerLoad", "ForceLaw",
    "GeneralizedAlpha", "Gravity", "Guided", "History", "ImposedStrain", "KelvinVoigt", "LineLoad",
    "LinearSoftening", "Link", "LoadControl", "Mesh", "ModelError", "ModelWarning", "MovingLoad",
    "Newmark", "Newton", "Perzyna", "Pinned", "PointLoad", "PointMass", "Potential",
    "PrescribedDisplacement", "PrescribedForce", "PrescribedMotion", "Pressure", "Prismatic",
    "Rayleigh", "Release", "Revolute", "Rigid", "RigidLink", "RigidPlastic", "Roller",
    "RotatingFrame", "Scene", "Section", "Simulation", "Slide", "Softening", "Solution",
    "Spherical", "Spline", "Spring", "Static", "Stop", "Stretch", "Support", "Table", "Turn",
    "Universal", "Velocity", "VirtualWork", "animate", "buckling", "differentiate",
    "follow", "gradient", "ground", "linearize", "modes", "picture", "plot", "print_once",
    "ramp", "render", "simulate", "study", "tradeoff",
]  # fmt: skip

RESULTS = [
    "BodyPoint", "Branch", "Buckling", "CriticalPoint", "Derivatives", "Diagram", "DiagramInSpace",
    "DolfinxView", "Energy", "Event", "Extent", "Film", "LinearModel", "Modes", "Path", "Place",
    "Range", "Study", "Tradeoff",
]  # fmt: skip
"""Classes of results and of places; functions and methods return their instances."""

OLD_NAMES = {
    "Actuator": "PrescribedForce",
    "DecayingMidpoint": "EnergyMomentumDecaying",
    "Displacement": "DisplacementControl",
    "Dissipation": "DissipationControl",
    "ExactStatic": "EnergyMomentumStatic",
    "CopiesDiffer": "errors.ProcessesDiffer",
    "ExactStep": "extend.EnergyMomentumBase",
    "Function": "ForceLaw",
    "Hardening": "ElastoPlastic",
    "Load": "LoadControl",
    "Midpoint": "EnergyMomentum",
    "MidpointLoads": "extend.MidpointDynamics",
    "Midway": "extend.MidpointDynamics",
    "Motor": "PrescribedMotion",
    "Prescribed": "PrescribedDisplacement",
    "PrintedMidpoint": "EnergyMomentumPrinted",
    "SceneError": "ModelError, or ufl_beam.ArgumentError,",
    "Spot": "BodyPoint",
    "load": "Solution.load",
    "plot_cycles": 'plot(fatigue, "cycles", spot)',
    "plot_damage": 'plot(solution, "damage")',
    "plot_dissipation": 'plot(solution, "dissipation")',
    "plot_energy": 'plot(solution, "energy")',
    "plot_extremes": 'plot(extremes, "M")',
    "plot_hinge": 'plot(solution, "hinge", place)',
    "plot_history": 'plot(solution, "history", places)',
    "plot_modes": "plot(modes)",
    "plot_moment_curvature": 'plot(solution, "moment-curvature", place)',
    "plot_shapes": 'plot(solution, "shapes")',
    "plot_tradeoff": "plot(tradeoff)",
    "say": "print_once",
}
"""Former public names, and the names that replace them."""


def __getattr__(name: str) -> NoReturn:
    """Raise :class:`AttributeError`; for an old name, the message has the new name."""
    new = OLD_NAMES.get(name)
    if not (new or name == "structures" or name.startswith("_")):
        import_module("ufl_beam.structures")  # becomes a name of this module
        for module in ("structures", "extend", "distributions", "errors"):
            found = getattr(globals()[module], name, None)
            home = getattr(found, "__module__", getattr(found, "__name__", ""))
            if home.startswith("ufl_beam."):
                new = f"{module}.{name}"
    text = f"; it is ufl_beam.{new} now" if new else ""
    text += "; import ufl_beam.structures first" * (name == "structures")
    raise AttributeError(f"module 'ufl_beam' has no attribute {name!r}{text}")
