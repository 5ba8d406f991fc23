# SPDX-License-Identifier: MIT
"""Every parameter of every public callable refuses what it cannot take, by name, before any mesh.

Tables have a valid value of each parameter, and its kind: a list of values that it must refuse.
"""

import inspect
import math
import re
from functools import reduce

from mpi4py import MPI

import numpy as np
import pytest
from helpers import ALL, PUBLIC, in_turn, raises
from scenes import SECTION, clamped
from user_laws import AirDrag

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.simulation import step_equation

NAN, INF, HUGE = math.nan, math.inf, 10**400
ARRAY = np.array([1.0, 2.0])

BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
IN_SPACE = ub.Beam((0, 0, 0), (1, 0, 0), SECTION, cells=2, name="girder")
OTHER = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="other")
BODY = ub.Body((2, 0), mass=1.0, inertia=1.0, name="hub")
SCENE = clamped(BEAM)
PUSHED = clamped(BEAM, loads=[ub.PointLoad(BEAM.end, force=(0, 1))])
GROWING = clamped(BEAM, loads=[ub.PointLoad(BEAM.end, force=(1, 0), amplitude=lambda t: t)])
STEEL = {"E": 210e9, "nu": 0.3}
LAW = ub.ElastoPlastic(1e8)
BREAKS = ub.Softening(10.0, 5.0)
JOINT = ub.Revolute(BEAM.end, OTHER.start, multipliers=True)
MOTION = st.GroundMotion(0.1, [0.0, 1.0, 0.5, 0.0])


class Analysed:
    """An analysed section in place of one of sectionproperties."""

    __module__ = "sectionproperties.analysis.section"


# -- kinds of parameters: what each of them must refuse ------------------------------------------

NO_NUMBER = ["1e-3", "x", b"1", 1j, np.complex128(1), [1.0], ARRAY, np.array([1.0]), (), {}, HUGE]
NUMBER = [*NO_NUMBER, None, NAN, INF, -INF]
FROM_ZERO = [*NUMBER, -1.0]
POSITIVE = [*FROM_ZERO, 0.0]
COUNT = [*POSITIVE, 1.5, "2"]
SEED = [*(v for v in NO_NUMBER if v is not HUGE), None, NAN, -1, 1.5]
LIMIT = [*NO_NUMBER, None, NAN, -1.0, -INF]
"""From zero to infinity."""
VECTOR = [
    "ab", None, 1.0, (), (1,), (1, 2, 3), (1, "2"), (1, None), (1, NAN), (INF, 0), (1j, 0),
    (HUGE, 0), (ARRAY, ARRAY),
]  # fmt: skip
EITHER = [x for x in VECTOR if not isinstance(x, tuple) or len(x) != 3]
"""In the place of a vector in the plane or in space."""
UP = [1.0, "x", (1,), (0, 1), (0, NAN, 1), object()]
OBJECT = [None, "x", 1.0, (0, 0), ARRAY, object(), int, [BEAM], STEEL]
"""In the place of any object of this package."""
NO_PLACE = [*OBJECT, BEAM]
NO_BEAM = [*OBJECT, BEAM.end]
NO_LAW = [*OBJECT, BREAKS]
"""In the place of an elastoplastic law."""
NO_SOFTENING = [*OBJECT, ub.Fibres(LAW)]
LIST = [None, 1.0, "ab", [None], ["x"], [1.0], object(), BEAM, [SECTION]]
"""In the place of a list of objects of this package."""
TEXT = [None, 1.0, b"x", ["x"], "\ud800", "a\0"]
HINGES = [
    None, 1.0, "x", [], [BREAKS], {0.5: 1}, {0.5: None}, {1.5: LAW}, {-0.1: LAW}, {NAN: LAW},
    {"end": LAW},
]  # fmt: skip
OF_EACH = ["ab", [], [1.0], [0.0, NAN], [0.0, 1j], [0.0, "1"], [1.0, -1.0], -1.0, NAN, INF, HUGE]
FIBRES = [None, 1.0, "ab", [], [1.0], [0.0, NAN], [0.0, 1j], [0.0, "1"]]
SWITCH = [None, "yes", 2, 1.5, [], ARRAY]
PATH = [None, 1.0, "", b"x", ["x"], object()]
FUNCTION = [None, "x", 1.0, ARRAY]
TIME = [
    "x", 1.0, ARRAY, lambda: 1.0, lambda t: None, lambda t: "1", lambda t: 1j,
    lambda t: np.complex128(1), lambda t: np.zeros(2), lambda t: np.zeros(1), lambda t: [1.0],
    lambda t: NAN, lambda t: INF, lambda t: HUGE, lambda t: 1 / 0,
]  # fmt: skip
CURVE = [
    "x", 1.0, lambda s: None, lambda s: s, lambda s: "ab", lambda s: (s, 1j), lambda s: (s, NAN),
    lambda s: (s, "0"), lambda: (0, 0), lambda s: 1 / 0,
]  # fmt: skip


def optional(kind):
    """The same where None is allowed."""
    return [value for value in kind if value is not None]


def alike(value, kind, names):
    """Parameters of the same kind, with a valid value for all of them."""
    return dict.fromkeys(names.split(), (value, kind))


def stretched(force):
    """The beam under a growing force."""
    load = ub.PointLoad(BEAM.end, force=(force, 0), amplitude=lambda t: t)
    return clamped(BEAM, loads=[load])


INSIDE = [*VECTOR, (0.6, 0.2), (0.2, 0.2), (-0.1, 0.5), (0.5, 1.1)]
MOVED = [*NO_NUMBER, NAN, INF, *(f for f in TIME if callable(f))]
TIMES = [None, 1.0, "01", [1, 0], [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]
VALUES = [value for value in TIMES if value != [1, 0]]
SERIES = [None, "ab", 1.0, ["1", "2", "3"], [0.0, NAN, 1.0], [0, 1j, 2], [[0.0, 1.0]], [0, HUGE]]
SPECTRUM = [
    None, 1.0, "ab", (), ([1.0],), ([1.0], [1.0, 2.0]), ([2.0, 1.0], [1.0, 1.0]),
    ([0.0, NAN], [1.0, 1.0]), ([0.0, "x"], [1.0, 1.0]),
]  # fmt: skip
"""In the place of a spectrum; a function is evaluated at the periods of modes, with a mesh."""
OF_FIBRES = ub.Section.rectangle(1.0, 1.0, **STEEL, fibres=ub.Fibres(LAW, number=4))
HEAVY = clamped(BEAM, masses=[ub.PointMass(BEAM.end, 1.0)])
PUSH = ub.simulate(PUSHED, ub.Static(), t=(0, 1), dt=1.0)
BENT = st.Measurement(
    [0.5, 1.0], [1.0, 2.0], lambda run: run.displacement(BEAM.end)[:, 0],
    scheme=ub.Static(), t=(0, 1), dt=0.5,
)  # fmt: skip
T = np.linspace(0, 10, 400)

SHAPE = {
    **alike(1.0, POSITIVE, "E shear_factor"), **alike(None, optional(NO_LAW), "core fibres"),
    "axis": ("weak", [*TEXT, "x"]), "cover": (0.0, [*NUMBER, -1.0, 0.2]),
    "nu": (0.3, [*NUMBER, 0.6, -1.0]), "rho": (1.0, optional(FROM_ZERO)),
}  # fmt: skip
BY_NAME = {
    **alike(1.0, NUMBER, "angular moment normal rate t0 tangential x y"),
    **alike(1.0, FROM_ZERO, "a1 a3 coefficient damping depth friction inertia isotropic kinematic "
        "mass pressure prominence ratio resolution rhoI"),
    **alike(1.0, POSITIVE, "EA EI GA R0 a2 a4 across axial b bending cR2 capping category cycles d "
        "factor fracture_energy gap h max_bytes max_seconds mean offset peak radius range recovery "
        "retardation_time rounding rtol scale slope slope_beyond spacing stiffness strain strength "
        "tolerance ultimate viscosity yield_limit duration"),
    **alike(1.0, LIMIT, "eta limit tau"),
    **alike(1.0, optional([*LIMIT, 0.0]), "reloading softening unloading"),
    **alike(2, COUNT, "cells degree every max_iterations max_rows max_states n number steps"),
    **alike(False, SWITCH, "anew beyond centroid_only lumped multipliers progress reference "
        "tangent turning"),
    **alike((1, 0), EITHER, "acceleration center force linear point"),
    **alike(None, optional(POSITIVE), "GA3 EI2 GJ shear_factor3"),
    "angles": ((1, 0), VECTOR), "up": (None, UP), "rhoI2": (None, optional(FROM_ZERO)),
    "torsion": (None, optional([*POSITIVE, 10.0])),
    **alike(BEAM.end, NO_PLACE, "place rail"), **alike(OTHER.end, NO_PLACE, "slider"),
    **alike(lambda t: t, [*TIME, None], "amplitude motion position"),
    **alike(None, optional(OBJECT), "at checkpoint comm interaction mesh mode negative newton "
        "start"),
    **alike(None, optional(POSITIVE), "first highpass length longest sample shortest width"),
    **alike(None, optional(FUNCTION), "stored tell until"),
    **alike((), LIST, "accelerations bodies connectors initial joints loads masses places record "
        "supports works"),
    **alike(INF, [*NO_NUMBER, None, NAN, -1.0, 0.0], "knee"), **alike(0.0, MOVED, "u v psi"),
    **SHAPE, "along": ((1.0, 0.5), [*VECTOR, (0, 0)]),
    "backbone": (st.Backbone(1.0, 1.0), OBJECT), "beam": (BEAM, NO_BEAM),
    "beams": (None, optional(LIST)), "body": (BODY, OBJECT),
    "curve": (lambda s: (1 + s, 0), [*CURVE, None]), "deviation": (0.1, POSITIVE),
    "dt": (0.5, POSITIVE), "exponent": (5.0, [*POSITIVE, 0.5]),
    "hardening": (0.1, [*FROM_ZERO, 1.0]), "hinges": ({}, HINGES), "law": (ub.Spring(1.0), OBJECT),
    "name": ("girder", TEXT),
    "numbers": ({"c": 1.0}, [None, 1.0, "ab", {}, {"c": None}, {"c": NAN}, {"w": 1, "q": 1}]),
    "path": ("run.h5", PATH),
    "profile": ((0.0, 1.0), [*VECTOR, *(f for f in TIME if f is not ARRAY)]),
    "scene": (SCENE, OBJECT), "scheme": (ub.Static(), [*OBJECT, ub.Static]),
    "section": (SECTION, OBJECT), "seed": (1, SEED), "shear": (None, optional(NO_LAW)),
    "solution": (PUSH, OBJECT), "span": ((0.2, 0.6), INSIDE), "step": (1.0, [*NUMBER, 0.0]),
    "t": ((0, 1), [*VECTOR, (1, 0)]), "tension": (BREAKS, NO_SOFTENING),
    "times": ([0, 1], TIMES), "values": ([0, 1], VALUES),
}  # fmt: skip
"""A valid value and the kind of parameters, by their names, unless the table below has another."""

FLANGED = SHAPE | {
    "h": (0.4, POSITIVE), "b": (0.2, POSITIVE), "tw": (0.01, [*POSITIVE, 0.21]),
    "tf": (0.02, [*POSITIVE, 0.4]), "r": (0.02, [*FROM_ZERO, 0.4]),
}  # fmt: skip
PAIR = {"a": (BEAM.end, NO_PLACE), "b": (OTHER.end, NO_PLACE)}
CORNER = {"a": (BEAM.end, NO_PLACE), "b": (OTHER.start, NO_PLACE)}
HINGE = alike(1.0, optional([*LIMIT, 0.0]), "strength")
IN_PAIRS = alike((0.0, 1e-4), ["x", *VECTOR[3:], *TIME[3:]], "axial curvature shear")
OF_PEAKS = {
    "t": (T, SERIES), "x": (np.exp(-0.05 * T) * np.cos(6 * T), SERIES), "about": (0.0, NUMBER),
    "prominence": (0.05, FROM_ZERO),
}  # fmt: skip
DERIVED = {
    "model": (lambda force: GROWING, [*FUNCTION, lambda force: None]),
    "at": ({"force": 1.0}, [None, 1.0, "x", {}, {"force": "x"}, {"force": NAN}]),
    "dt": (0.5, [*POSITIVE, ub.Adaptive(1e-3)]),
}  # fmt: skip
OF_WORK = {"name": ("wind", [*TEXT, "", "kinetic"])}
QUANTITIES = {"u": lambda s: s.displacement(BEAM.end)}

OWN = {
    # sections and materials
    "Section": {"rhoA": (0.0, optional(FROM_ZERO)), "hinge": (None, optional(NO_SOFTENING)),
        "shape": (None, optional(OBJECT)),
        **alike(None, optional(NO_LAW), "axial bending bending2 shear3 twisting")},
    "Shape": {
        "corners": ([(0, 0), (1, 0, 0.1), (1, 1)], [
            None, 1.0, "ab", [], [1.0], [(0, 0), (1, 0)], [(0, 0), (1, 0), (1,)],
            [(0, 0), (1, 0), (1, NAN)], [(0, 0), (1, 0), (1, "1")], [(0, 0), (1, 0), (1, 1, -0.1)],
        ]),
        "holes": ([], [None, 1.0, "ab", [None], [1.0], [[(0, 0), (1, 0)]]]),
    },
    "Section.of_shape": {"shape": (st.Shape([(-1, 0), (1, 0), (0, 1)]), OBJECT)},
    "Section.rectangle": SHAPE,
    "Section.circle": SHAPE,
    "Section.tube": SHAPE | {"t": (0.1, [*POSITIVE, 0.6])},
    "box": SHAPE | {"b": (0.2, POSITIVE), "h": (0.3, POSITIVE), "t": (0.02, [*POSITIVE, 0.1]),
        "r": (0.02, [*FROM_ZERO, 0.2])},
    "i_shape": FLANGED,
    "channel": FLANGED,
    "t_shape": FLANGED,
    "steel": SHAPE | {"designation": ("IPE 80", [*TEXT, "IPE 81"])},
    "of_sectionproperties": {"analysed": (Analysed(), OBJECT), "axis": ("y", [*TEXT, "z"])},
    "Section.of_fibres": {
        "y": ([0.0, 1.0], [*FIBRES, [0.0, 0.0], [0.0, HUGE]]),
        "A": ([1.0, 1.0], [*FIBRES, [1.0, -1.0], [1.0, 0.0]]),
        "E": ([1.0, 1.0], [*OF_EACH, None, 0.0]), "rho": (0.0, OF_EACH),
        "z": (None, [*FIBRES[1:], [0.0, 1.0], [1.0, 1.0]]),
        "fibres": ([ub.Fibres(LAW)] * 2, [*NO_LAW, [ub.Fibres(LAW)], [ub.Fibres(LAW), LAW]]),
    },
    "Section.reinforced": {"y": ([-0.3, 0.3], [*FIBRES, 0.3, [0.0, 0.6], [0.0]]),
        "A": ([0.01, 0.01], [*FIBRES, [0.01, 0.0], [0.01, 1.0]]),
        "fibres": (ub.Fibres(LAW), NO_LAW)},
    "Fibres": {"law": (LAW, NO_LAW), "softening": (None, [*optional(OBJECT), LAW])},
    "ElastoPlastic": {"yield_limit": (1.0, LIMIT), "viscosity": (ub.Perzyna(0.0), OBJECT)},
    "ArmstrongFrederick": {"kinematic": (1.0, POSITIVE)},
    "BoucWen": {"shape": (0.6, [*FROM_ZERO, 0.4, 1.1]), "strength": (1.0, FROM_ZERO)},
    "MenegottoPinto": {"cR1": (0.9, [*FROM_ZERO, 1.0])},
    "KentPark": {"strength": (3.0, POSITIVE), "residual": (1.0, [*FROM_ZERO, 4.0])},
    "KentPark.confined": {"strength": (3e7, [*POSITIVE, 30.0]),
        **alike(1.0, FROM_ZERO, "yield_limit width")},
    "Mander": {"strength": (3.0, POSITIVE), "spalling": (3.0, [*NO_NUMBER, NAN, 2.0, -INF])},
    "Mander.confined": {"strength": (3e7, POSITIVE), "strain": (0.002, POSITIVE)},
    "Weibull": {"shape": (1.0, POSITIVE)},
    "Rayleigh.with_ratios": {
        "ratios": (0.03, [None, "x", NAN, 0.0, -1.0, HUGE, (0.1, NAN), (0.1,), (0.01, 0.9)]),
        "omega": ((1.0, 2.0), [*VECTOR, (0.0, 1.0), (1.0, 1.0)])},
    "Rayleigh": {"stiffness": (1.0, FROM_ZERO)},
    # beams, bodies, places
    "Beam": {"start": ((0, 0), VECTOR), "end": ((1, 0), VECTOR),
        "curve": (None, [*CURVE, lambda s: (s, s, s)]),
        "corners": ((), [None, 1.0, "ab", [None], ["0.5"], [NAN], [1j], [1.5], [ARRAY]])},
    "Beam.polyline": {"points": ([(0, 0), (1, 0)],
        [None, 1.0, "ab", [(0, 0)], [(0, 0), None], [(0, 0), (1, NAN)]])},
    "Beam.at": {"s": (0.5, [*NUMBER, -0.1, 1.1])},
    "Place": {"s": (0.5, [*NUMBER, -0.1, 1.1])},
    "HotSpot.fibre": {"z": (None, [0.1, "x"])},
    # joints, connectors and their laws
    "Rigid": CORNER,
    "Revolute": CORNER,
    "Spherical": {"a": (ub.ground(0, 0, 0), NO_PLACE), "b": (IN_SPACE.start, NO_PLACE)},
    "Universal": {"a": (ub.ground(0, 0, 0), NO_PLACE), "b": (IN_SPACE.start, NO_PLACE),
        "axes": (((1, 0, 0), (0, 1, 0)), [None, 1.0, "ab", ((1, 0, 0), (1, 1, 0)),
            ((1, 0, 0), (0, 0, 0)), ((1, 0), (0, 1)), ARRAY])},
    "Cylindrical": {"rail": (ub.ground(0, 0, 0), NO_PLACE), "slider": (IN_SPACE.end, NO_PLACE),
        "axis": ((1, 0, 0), [1.0, "x", (0, 0, 0), (1, 0), ARRAY])},
    "Release": CORNER | {"free": ("M", [*TEXT, "", "X", "MX"])},
    "Prismatic": {"axis": (None, optional(VECTOR))},
    "RigidLink": PAIR,
    "Link": PAIR,
    "Turn": PAIR | {"axis": ((1.0, 0.0), [None, 1.0, "x", (1.0, 1.0), (0, 0, 1), ARRAY])},
    "Stretch": PAIR,
    "Slide": PAIR | {"axis": (None, optional(VECTOR))},
    "Bushing": PAIR | {"axis": ((1, 0), VECTOR), "law": (ub.Clearance(1.0, gap=1.0), OBJECT)},
    "Spring": {"free": (0.0, NUMBER), **alike(None, optional(OBJECT), "law softening")},
    "Stop": {"low": (-1.0, [*NO_NUMBER, None, NAN, 1.0]),
        "high": (1.0, [*NO_NUMBER, None, NAN, -1.0])},
    "Backbone": {"post_capping": (1.0, [*LIMIT, 0.0]), "overstrength": (1.0, [*NUMBER, 0.9]),
        "residual": (0.5, [*FROM_ZERO, 1.1]), "ultimate": (2.0, [*LIMIT, 0.0, 1.0])},
    "IbarraKrawinkler": HINGE,
    "PinchingHinge": HINGE | {"kappa_F": (0.5, [*POSITIVE, 1.1]),
        "kappa_D": (0.5, [*FROM_ZERO, 1.1])},
    "AxialBendingHinge": alike(1.0, POSITIVE, "along turning"),
    "Clearance": {"radius": (1.0, FROM_ZERO)},
    "Coulomb": {"force": (1.0, FROM_ZERO), "joint": (JOINT, OBJECT)},
    "RigidPlastic": {"law": (LAW, OBJECT)},
    "ForceLaw": {"force": (lambda e, rate, state: (e, state), FUNCTION),
        "state": ([0.0], [None, 1.0, "ab", [NAN], [1j], ["1"], [[1.0]], [HUGE]])},
    "Controller": {"force": (lambda simulation: 1.0, FUNCTION)},
    "PrescribedForce": {"force": (lambda t: t, [*TIME, None])},
    # loads, supports, masses
    "MovingLoad": {"beam": (BEAM, [*(x for x in NO_BEAM if not isinstance(x, list)), []])},
    "ImposedStrain": IN_PAIRS,
    "VirtualWork": OF_WORK | {"density": (lambda w, c: c * w[1], [*FUNCTION, lambda x: x])},
    "Potential": OF_WORK | {"density": (lambda q, c: c * q[1], [*FUNCTION, lambda w: w])},
    "Effect": {"statement": (AirDrag(), [*OBJECT, AirDrag]),
        "places": ([BEAM.end], [*LIST, [BEAM.end, BEAM.start]]),
        "beams": (None, [[BEAM], *optional(LIST)])},
    "PrescribedDisplacement": {  # the scene is in the plane
        "w": (None, [*optional(MOVED), 1.0]), "up": (None, [*optional(VECTOR), (0, 0, 1)]),
        "axis": (None, [*optional(VECTOR), (0, 0, 1)])},
    "Pressure": {"normal": (1.0, [x for x in NUMBER if x is not ARRAY])},
    "RotatingFrame": {"about": ((0, 0), EITHER)},
    "Spline": {"s": ([0, 1], optional(TIMES)),
        "points": ([(0, 0), (1, 0)], [None, 1.0, "01", [(0, 0)], [(0, 0), (1, NAN)], [0, 1]])},
    "GroundMotion": {"values": ([0, 1], [*VALUES, [[0, 1]]])},
    "GroundMotion.from_history": {"dt": (0.1, optional(POSITIVE))},
    # Wrong units and steps need a file: unit/test_ground_motion.py
    "GroundMotion.read": {"unit": ("g", []), "dt": (0.1, [])},
    "GroundMotion.scaled": {"factor": (None, optional(NUMBER)), "peak": (2.0, POSITIVE)},
    "GroundMotion.corrected": {"degree": (1, [*FROM_ZERO, 1.5, "2"]),
        "highpass": (None, [*optional(POSITIVE), 5.0])},
    "GroundMotion.resampled": {"dt": (0.05, POSITIVE)},
    "Velocity": {"beams": ([BEAM], LIST), "about": ((0, 0), optional(EITHER))},
    "Scene": {"beams": ([BEAM], LIST), "damping": ((), LIST)},
    # schemes, discretisation, solver, steps
    "EnergyMomentum": {"order": (2, [*NUMBER, 1, 3, 2.5]),
        **alike(0.0, [*FROM_ZERO, 0.6], "alpha beta")},
    "EnergyMomentumDecaying": {"rho_inf": (0.5, [*NUMBER, 0.1, 1.1])},
    "Newmark": {"gamma": (0.5, [*NUMBER, 0.4]), "beta": (0.25, [*NUMBER, 0.1])},
    "GeneralizedAlpha": {"rho_inf": (0.8, [*NUMBER, -0.1, 1.1])},
    "EnergyMomentumStatic": {"theta": (1.0, [*NUMBER, 0.4, 1.1])},
    "Camera": {"follow": (BEAM.end, ["x", 1.0, BEAM, ARRAY]),
        "direction": ((0, 0, -1), [*optional(OBJECT), (0, 0, 0), (0, 0, NAN), ("0", "0", "1")])},
    "Mesh": {"refine": (1, [*POSITIVE, 1.5]), "degree": (1, [*COUNT, 4])},
    "Newton": {"petsc": ({}, [None, 1.0, "x", [], {1: None}])},
    "Adaptive": {"stops": ((), [None, 1.0, "ab", [None], ["1"], [NAN], [1j], [HUGE]])},
    # runs
    "Simulation": {"kind": (ub.Path, OBJECT)},
    "follow": {"scene": (GROWING, OBJECT),
        "control": (ub.LoadControl(1.0), [*OBJECT, ub.LoadControl])},
    "DisplacementControl": {"component": ("u", [*TEXT, "w", "", "uv"]),
        "end": (None, optional(NUMBER))},
    "DissipationControl": {"step": (1.0, POSITIVE), "otherwise": (ub.ArcLength(1.0), OBJECT)},
    "buckling": {"t": (1.0, NUMBER)},
    "linearize": {"scene": (PUSHED, OBJECT),
        "inputs": ([PUSHED.loads[0]], [*LIST, [None], [1.0], []]),
        "outputs": ([("displacement", BEAM.end, "v")],
            [*LIST, [], ["v"], [("displacement", BEAM.end, "x")], [("displacement", 1.0)]])},
    "imperfect": {"bow": ({BEAM: 0.01}, [1.0, "ab", {BEAM: NAN}, {BEAM: "x"}, {1: 0.1}]),
        "k": (0, [None, "2", -1, 1.5, NAN]), **alike(0.01, NUMBER, "amplitude sway")},
    "study": {"member": (lambda: {"x": 1.0}, FUNCTION), "path": (None, optional(PATH)),
        "cases": ([{}], [None, 1.0, "ab", [None], ["x"], []])},
    "differentiate": DERIVED | {"unused": ((), [None, 1.0, "force", ["x"], [1.0]])},
    "gradient": DERIVED | {
        "scheme": (ub.Static(), [*OBJECT, ub.Static, ub.EnergyMomentumStatic(0.7)]),
        "of": (lambda run: run.displacement(BEAM.end)[:, 0], FUNCTION),
        "reduce": (np.mean, FUNCTION)},
    "tradeoff": {
        "quantities": (QUANTITIES, [None, 1.0, "x", {}, {"u": None}, {"u": 1.0}, {1: lambda s: s}]),
        "scheme": (ub.EnergyMomentum(), [*OBJECT, ub.EnergyMomentum]),
        "dt": (0.5, [*(v for v in POSITIVE if not isinstance(v, list)), []]),
        "tolerance": (1e-3, optional(POSITIVE)), "budget": (None, [1.0])},
    "tradeoff.budget": {"budget": (1.0, optional(POSITIVE))},
    # files
    "XDMF": {"path": ("run.xdmf", [*PATH, "run.h5"])},
    "VTKHDF": {"path": ("run.hdf", [*PATH, "run.h5"])},
    "Solution.load": {"scene": (None, optional(OBJECT))},
    "Extremes": {"points": (2, [*NUMBER, 1]), "accelerations": (False, SWITCH)},
    "Checkpoint": {"every": (1, optional(COUNT)), "minutes": (None, optional(FROM_ZERO)),
        "also": ((), [None, 1.0, "ab"])},
    # fatigue
    "Fatigue": {"spots": (st.HotSpot.fibre(BEAM.end, y=0.1, E=1.0), LIST),
        "curve": (st.SNCurve(range=1.0), OBJECT)},
    "HotSpot": {"stress": (lambda N, V, M: N, FUNCTION)},
    "SNCurve": {"limit": BY_NAME["knee"], "mean": (lambda range, mean: range, FUNCTION)},
    # structures
    "moment_curvature": {"section": (OF_FIBRES, OBJECT),
        "curvature": ([0.0, 0.0], [x for x in FIBRES if x != [1.0]]),
        "N": ([0.0, 0.0], [x for x in FIBRES if x != 1.0])},
    "interaction_diagram": {"section": (OF_FIBRES, OBJECT), "points": (8, COUNT), "limits": (
        (0.01, 0.02), [None, 1.0, "ab", (0.01,), (0.01, 0.0), {BEAM: (1, 1)}, (1, NAN)])},
    "peaks": OF_PEAKS,
    "damping": OF_PEAKS,
    "logarithmic_decrement": {"amplitudes": ([3.0, 2.0, 1.0], [*SERIES, [1.0], [1.0, -1.0]])},
    "fit_decay": {"t": ([0.0, 1.0, 2.0, 3.0], SERIES), "amplitudes": ([3.0, 2.2, 1.5, 1], SERIES)},
    "damping_ratio": {"decrement": (0.1, ["x", None, 1j, NAN, HUGE])},
    "rainflow": {"series": ([0.0, 1.0, 0.0], SERIES)},
    "response_spectrum": {"motion": (MOTION, OBJECT),
        "periods": ([1.0], [None, "ab", [], ["1"], [NAN], [1j], [[1.0]], [HUGE], [0.0], -1.0]),
        "damping": (0.05, [*FROM_ZERO, 1.0]), "ductility": (1.0, [*FROM_ZERO, 0.5])},
    "pushover": {"scene": (HEAVY, OBJECT), "place": (BEAM.end, [*OBJECT, BODY.middle]),
        "target": (0.1, [*NUMBER, 0.0]), "component": ("u", [None, 1.0, "w", "psi", ARRAY]),
        "pattern": ("uniform", [*LIST, [ub.FollowerLoad(BEAM.end, force=(1, 0))]])},
    "incremental_dynamic_analysis": {
        "build": (lambda motion: HEAVY, [*FUNCTION, lambda motion: None]), "limit": (1.0, POSITIVE),
        "motions": ([st.GroundMotion(0.1, [1.0, 2.0])], [*LIST, []]),
        "intensities": ([1.0, 2.0], [*SERIES, [2.0, 1.0], [0.0, 1.0], [-1.0]]),
        "measure": (lambda run: run.displacement(BEAM.end), FUNCTION),
        "intensity": (lambda motion: motion.peak,
            [*FUNCTION[1:], *(lambda motion, x=x: x for x in (None, "x", NAN, 0.0, -1.0))]),
        "scheme": (None, [*OBJECT[1:], ub.Static()]), "dt": (None, optional(POSITIVE)),
        "path": (None, optional(PATH))},
    "Fragility.fit": {"intensities": ([1.0, 2.0], [*SERIES, [0.0, 1.0], [1.0]]),
        "exceeded": ([1, 3], [*SERIES, [-1, 3], [5, 3]]),
        "number": ([4, 4], [*SERIES, [0, 0], [4]])},
    "load_combinations": {"scene": (HEAVY, OBJECT),
        "cases": ({"Q": [ub.PointLoad(BEAM.end, force=(1, 0))]},
            [*LIST, {}, {1: []}, {"a": [None]}, {"a": [ub.RotatingFrame(rate=1.0)]}]),
        "combinations": ({"A": {"Q": 1.5}},
            [*LIST, {}, {"A": {}}, {"A": {"R": 1.0}}, *({"A": {"Q": x}} for x in NUMBER)])},
    "response_spectrum_analysis": {"scene": (HEAVY, OBJECT), "damping": (0.05, [*POSITIVE, 1.0]),
        "spectrum": (([0.0, 9.0], [1.0, 1.0]), SPECTRUM),
        "rule": ("CQC", [None, 1.0, "cqc", ARRAY]),
        "direction": ((1, 0), [*optional(VECTOR), (0.0, 0.0)])},
    "Measurement": {"scheme": (ub.Static(), OBJECT), "dt": DERIVED["dt"],
        "times": ([0.5, 1.0], [*optional(SERIES), [1.0, 0.5], [0.5, 2.0], [0.5]]),
        "values": ([1.0, 2.0], [*SERIES, [], [1.0]]), "quantity": (lambda run: run.times, FUNCTION),
        "t": ((0, 1), [*VECTOR, (1, 0), (0, 0.5)]), "arguments": ({}, optional(LIST)),
        "sigma": (None, [*(x for x in optional(POSITIVE) if x is not ARRAY), [1.0, 0.0], [1.0]]),
        "labels": (("t", "x"), [None, 1.0, "ab", "abc", ("a",), ("a", 1)])},
    "calibrate": {"model": (stretched, [*FUNCTION, lambda force: None, lambda: SCENE]),
        "parameters": ({"force": 1.0}, [*LIST, {}, {"load": 1.0}, {1: 1.0}, {"force": (1.0, 2.0)},
            {"force": (3.0, 1.0, 2.0)}, *({"force": x} for x in [*NUMBER, 0.0])]),
        "measured": ([BENT], [*LIST, []]), "starts": (1, [*COUNT, 2])},
    "storeys": {"levels": ([BEAM.start, ub.ground(0, 1)], [*LIST, [BEAM.start]]),
        "direction": (None, [(1, 0), "x"])},
    "hinge_table": {"limits": ({"IO": 0.1},
        [*LIST, {1: 0.1}, {"IO": 0.2, "LS": 0.1}, {"IO": 0.0}]),
        "n": (-1, [None, "a", 0.5, [0], 10**6, -(10**6)]),
        "only": ([BEAM], [*optional(LIST), [OTHER]])},
}  # fmt: skip
"""Parameters that differ from those of their names, by callables."""


METHODS = {
    "Section.reinforced": OF_FIBRES.reinforced, "Beam.at": BEAM.at,
    "Body.at": lambda x, y: BODY.at(x, y), "ground": lambda x, y: ub.ground(x, y),
    "Rigid": lambda a, b, multipliers: ub.Rigid(a, b, multipliers=multipliers),
    "Revolute": lambda a, b, multipliers: ub.Revolute(a, b, multipliers=multipliers),
    "Spherical": lambda a, b, multipliers: ub.Spherical(a, b, multipliers=multipliers),
    "GroundMotion.scaled": MOTION.scaled, "GroundMotion.corrected": MOTION.corrected,
    "GroundMotion.resampled": MOTION.resampled,
    "tradeoff.budget": lambda budget: ub.tradeoff(
        SCENE, QUANTITIES, scheme=ub.EnergyMomentum(), t=(0, 1), dt=0.5, budget=budget
    ),
}  # fmt: skip
"""Methods of valid objects, and callables with other arguments."""

RECORDS_OF_RUNS = {
    "Branch", "Buckling", "Calibration", "Coefficients", "Connector", "CriticalPoint", "Cycles",
    "Decay", "DemandCurves", "Derivatives", "Diagram", "DiagramInSpace",
    "DolfinxView", "Energy", "Envelope",
    "Equations", "Event", "Extent", "Film", "Fragility", "Governing", "HingeFormation",
    "InteractionDiagram", "Joint", "LinearModel", "LoadCombinations", "Modes", "MomentCurvature",
    "Path", "Pushover", "Solution", "SpectralResponse", "Step", "Study", "Support",
    "TargetDisplacement", "Tradeoff",
}  # fmt: skip
"""Made by runs and by functions of the package, not by users."""

WITHOUT_PARAMETERS = {
    "Static", "EnergyMomentumPrinted", "Recorder", "print_once", "Scheme",
    "DynamicScheme", "ConnectorLaw", "EnergyMomentumBase", "MidpointDynamics", "MaterialLaw",
    "SofteningLaw", "Statement", "law_functions", "extend", "distributions",
}  # fmt: skip

PICTURES = {"animate", "picture", "plot", "render"}
"""Their tests are in pictures/."""


ERRORS = {n for n, x in PUBLIC.items() if inspect.isclass(x) and issubclass(x, BaseException)}
MADE_BY = {
    "Beam.along", "Beam.arc", "Beam.polyline", "Fragility.fit", "GroundMotion.from_history",
    "GroundMotion.read", "HotSpot.fibre", "KentPark.confined", "Mander.confined",
    "Rayleigh.with_ratios", "SNCurve.eurocode", "Section.circle", "Section.of_fibres",
    "Section.of_shape", "Section.rectangle", "Section.tube", "Solution.load", "Place", "BodyPoint",
}  # fmt: skip
"""Class methods, and classes that other methods make."""
CALLABLES = {*PUBLIC, *MADE_BY, *METHODS} - ERRORS - RECORDS_OF_RUNS - WITHOUT_PARAMETERS - PICTURES


def called(name):
    """The callable of a name, of a valid object if it is a method."""
    return METHODS.get(name) or reduce(getattr, name.split(".")[1:], ALL[name.split(".")[0]])


def parameters(name):
    """Valid values and kinds of the parameters of a callable."""
    own = OWN.get(name, {})
    known = BY_NAME | own
    found = inspect.signature(called(name)).parameters.values()
    names = [p.name for p in found if p.kind is not p.VAR_KEYWORD]
    return {parameter: known[parameter] for parameter in {**dict.fromkeys(names), **own}}


WORDS = {
    **dict.fromkeys(("a", "b", "rail", "slider"), "is not a place"),
    "beam": "is not a Beam",
    "corners": "corner",
    "density": "the function has a parameter",
    "hinges": "hinge",
    "path": "the name of the file",
    "point": "hub.at(x, y)",
    "points": "point",
    "quantities": "quantity",
}
"""Words in the place of a parameter's name."""

OF_STRUCTURES = {
    "concrete_laws", "ground_motion", "hinge_laws", "hysteresis_laws",
    "sectionproperties", "steel_sections",
}  # fmt: skip
"""Modules of structures with parts of models; steel sections are named by their function."""

PLACES = {"accelerations", "levels", "places", "place", "follow"}
"""Of recorders and cameras; errors of places are a `ModelError`."""


def of_models(name):
    """Whether something makes a part of a model."""
    _, *folders, module = ALL[name.split(".")[0]].__module__.split(".")
    return folders == ["model"] or module in OF_STRUCTURES


def _wrong(name):
    good = {parameter: value for parameter, (value, _) in parameters(name).items()}
    for parameter, (_, kind) in parameters(name).items():
        for value in kind:
            yield parameter, value, {**good, parameter: value}


@pytest.mark.parametrize("name", sorted(CALLABLES))
def test_wrong_values_are_refused_by_name(name, monkeypatch):
    """Each wrong value gives an ArgumentError that names the object and the parameter.

    It is a `ModelError` for parts of models and for nothing else.
    """

    def no_mesh(*_, **__):
        raise AssertionError("a mesh was made")

    monkeypatch.setattr(step_equation, "Fields", no_mesh)
    of = called(name)
    owners = (name.split(".")[0], "girder", "hub", "Section", "Guide")  # the law of Guided
    faults = []
    for parameter, value, values in _wrong(name):
        try:
            of(**values)
        except (ub.ArgumentError, TypeError) as error:
            said = str(error)
            if not isinstance(error, ub.ArgumentError):
                faults.append(f"{parameter} = {value!r:.60}: {error!r:.100}")
            elif parameter not in PLACES and isinstance(error, ub.ModelError) != of_models(name):
                faults.append(f"{parameter} = {value!r:.60}: it is a {type(error).__name__}")
            elif len(said) > 350:
                faults.append(f"{parameter} = {value!r:.60}: {len(said)} characters")
            elif of_models(name) and not any(owner in said for owner in owners):
                faults.append(f"{parameter} = {value!r:.60}: no owner in {said!r}")
            elif not (re.search(rf"\b{parameter}\b", said) or WORDS.get(parameter, "?") in said):
                faults.append(f"{parameter} = {value!r:.60}: no name in {said!r}")
        except Exception as error:
            faults.append(f"{parameter} = {value!r:.60}: {error!r:.100}")
        else:
            faults.append(f"{parameter} = {value!r:.60}: no error")
    assert not faults, "\n".join(faults)


# -- functions of users, in the middle of a run ---------------------------------------------------


def turned(x, law):
    return {"connectors": [ub.Turn(ub.ground(x, 0), BEAM.end, law)]}


PULLED = "Slide(ground (1, 0), girder.end (1, 0))"
TURNED = "Turn(ground ({}, 0), girder.end (1, 0))"
OWNERS = {
    "PointLoad at girder.end": lambda f: [ub.PointLoad(BEAM.end, force=(1, 0), amplitude=f)],
    "FollowerLoad at girder.end": lambda f: [ub.FollowerLoad(BEAM.end, force=(1, 0), amplitude=f)],
    "LineLoad on girder": lambda f: [ub.LineLoad(BEAM, force=(1, 0), amplitude=f)],
    "ImposedStrain of girder": lambda f: [ub.ImposedStrain(BEAM, 1e-4, amplitude=f)],
    "MovingLoad on girder": lambda f: [
        ub.MovingLoad(BEAM, f, force=(1, 0)), ub.MovingLoad(BEAM, lambda t: t, (1, 0), f)
    ],
    "Pressure on girder": lambda f: [ub.Pressure(BEAM, 1.0, amplitude=f)],
    "Gravity": lambda f: [ub.Gravity(amplitude=f)],
    "PrescribedDisplacement at girder.start": lambda f: {
        "supports": [ub.PrescribedDisplacement(BEAM.start, u=0, v=f, psi=0)]
    },
    PULLED: lambda f: {
        "connectors": [ub.Slide(ub.ground(1, 0), BEAM.end, ub.PrescribedForce(f), axis=(1, 0))]
    },
    TURNED.format(1): lambda f: turned(1, ub.PrescribedMotion(f)),
    TURNED.format(0): lambda f: turned(0, ub.Controller(lambda simulation: f(simulation.t))),
    TURNED.format(2): lambda f: turned(2, ub.ForceLaw(lambda e, rate: f(1.0))),
}  # fmt: skip
"""Parts of a scene with a function of time, by the name of the part that a message has."""


WRONG = None, "1.0", 1j, np.zeros(2), np.zeros(1), HUGE


@pytest.mark.parametrize(("owner", "value"), in_turn(OWNERS, WRONG))
def test_a_function_that_returns_no_number_during_a_run_is_refused(owner, value):
    """The function returns numbers until 0.2 s."""
    parts = OWNERS[owner](lambda t: 1e-3 * t if t < 0.25 else value)
    parts = parts if isinstance(parts, dict) else {"loads": parts}
    scene = ub.Scene([BEAM], **{"supports": [ub.Clamped(BEAM.start)]} | parts)
    with raises(owner, "must return a number"):
        ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, comm=MPI.COMM_SELF)


def test_numbers_of_numpy_are_numbers():
    """Scalars, and arrays without dimension, are as good as floats."""
    one = ub.Beam((np.int64(0), np.array(0.0)), (np.float32(1), 0), SECTION, cells=np.int64(2))
    push = ub.PointLoad(one.end, force=np.array([1.0, 0.0]), amplitude=lambda t: np.array(t))
    scene = clamped(one, loads=[push])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=np.float64(1), comm=MPI.COMM_SELF)
    # F L / EA, the beam being straight
    assert solution.displacement(one.end)[-1, 0] == pytest.approx(1e-4, rel=1e-9)


# -- messages -------------------------------------------------------------------------------------


def test_messages_show_the_beginning_of_long_values():
    for joints, words in ((BEAM, "joints"), ([ub.Clamped(BEAM.start)] * 40, "is not a Joint")):
        with raises(words) as failure:
            ub.Scene([BEAM], joints=joints)
        assert len(str(failure.value)) < 150


def test_an_entry_that_the_ledger_lacks_is_refused():
    solution = ub.simulate(SCENE, ub.Static(), t=(0, 1), dt=1, comm=MPI.COMM_SELF)
    for ask in (lambda e: e.lost["hinges"], lambda e: e["hinges"]):
        with pytest.raises(KeyError, match=r"no entry 'hinges'.*no object of the scene.*'stored'"):
            ask(solution.energy)
    assert solution.energy.lost.get("hinges") is None
    assert "hinges" not in solution.energy.lost
