# SPDX-License-Identifier: MIT
"""Every parameter of every public callable refuses what it cannot take, by name, before any mesh.

The table below has a valid call of each public callable and the kind of each of its parameters.  A
kind is a list of values that the parameter must refuse.
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
OTHER = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="other")
BODY = ub.Body((2, 0), mass=1.0, inertia=1.0, name="hub")
SCENE = clamped(BEAM)
PUSHED = clamped(BEAM, loads=[ub.PointLoad(BEAM.end, force=(0, 1))])
GROWING = clamped(BEAM, loads=[ub.PointLoad(BEAM.end, force=(1, 0), amplitude=lambda t: t)])
STEEL = {"E": 210e9, "nu": 0.3}
LAW = ub.ElastoPlastic(1e8)
BREAKS = ub.Softening(10.0, 5.0)
BACKBONE = st.Backbone(1.0, 1.0)
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
    lambda s: (s, s, s), lambda s: (s, "0"), lambda: (0, 0), lambda s: 1 / 0,
]  # fmt: skip


def optional(kind):
    """The same where None is allowed."""
    return [value for value in kind if value is not None]


def V(value, kind):
    """A valid value, and the values that are refused in its place."""
    return value, kind


def row(*groups, **parameters):
    """Valid values and kinds of the parameters of a callable."""
    for group in groups:
        parameters = group | parameters
    return parameters


def alike(value, kind):
    """A function of names of parameters that have the same valid value and kind."""
    return lambda names: dict.fromkeys(names.split(), (value, kind))


number, from_zero, positive = alike(1.0, NUMBER), alike(1.0, FROM_ZERO), alike(1.0, POSITIVE)
limit, count, switch = alike(1.0, LIMIT), alike(2, COUNT), alike(False, SWITCH)
vector, text, place = alike((1, 0), VECTOR), alike("girder", TEXT), alike(BEAM.end, NO_PLACE)
beam, timed = alike(BEAM, NO_BEAM), alike(lambda t: t, [*TIME, None])
nothing, softening = alike(None, optional(OBJECT)), alike(BREAKS, NO_SOFTENING)
law, laws = alike(LAW, NO_LAW), alike(None, optional(NO_LAW))
each, capacity = alike((), LIST), alike(1.0, optional([*LIMIT, 0.0]))

INSIDE = V((0.2, 0.6), [*VECTOR, (0.6, 0.2), (0.2, 0.2), (-0.1, 0.5), (0.5, 1.1)])
PART = {"span": INSIDE, "profile": V((0.0, 1.0), [*VECTOR, *(f for f in TIME if f is not ARRAY)])}
SHAPE = positive("E shear_factor") | laws("fibres core") | {
    "nu": V(0.3, [*NUMBER, 0.6, -1.0]), "rho": V(1.0, optional(FROM_ZERO)),
    "axis": V("weak", [*TEXT, "x"]), "cover": V(0.0, [*NUMBER, -1.0, 0.2]),
}  # fmt: skip
FLANGED = {
    "h": V(0.4, POSITIVE), "b": V(0.2, POSITIVE), "tw": V(0.01, [*POSITIVE, 0.21]),
    "tf": V(0.02, [*POSITIVE, 0.4]), "r": V(0.02, [*FROM_ZERO, 0.4]),
}  # fmt: skip
SOFTENING = limit("limit") | positive("fracture_energy")
NORMAL = {"mean": V(1.0, POSITIVE), "deviation": V(0.1, POSITIVE), "seed": V(1, SEED)}
HINGE = positive("stiffness") | nothing("negative") | capacity("strength softening unloading") | {
    "backbone": V(BACKBONE, OBJECT), "exponent": V(1.0, [*POSITIVE, 0.5]),
}  # fmt: skip


OF_WORKS = count("degree") | {
    "name": V("wind", [*TEXT, "", "kinetic"]),
    "beams": V(None, optional(LIST)),
    "numbers": V({"c": 1.0}, [None, 1.0, "ab", {}, {"c": None}, {"c": NAN}, {"w": 1, "q": 1}]),
}
MEMBER = text("name") | {
    "section": V(SECTION, OBJECT), "cells": V(2, COUNT), "hinges": V({}, HINGES),
}  # fmt: skip
PAIR = {"a": V(BEAM.end, NO_PLACE), "b": V(OTHER.end, NO_PLACE)}
CONNECTOR = PAIR | text("name") | {"law": V(ub.Spring(1.0), OBJECT)}
CORNER = {**PAIR, "b": V(OTHER.start, NO_PLACE), "multipliers": V(False, SWITCH)}
TIMES = [None, 1.0, "01", [1, 0], [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]
VALUES = [value for value in TIMES if value != [1, 0]]
RUN = nothing("newton mesh comm")
SPAN_OF_TIME = V((0, 1), [*VECTOR, (1, 0)])
SCHEME = V(ub.Static(), [*OBJECT, ub.Static])

FORCE = vector("force") | number("moment") | timed("amplitude")
DERIVED = nothing("newton mesh") | {
    "model": V(lambda force: GROWING, [*FUNCTION, lambda force: None]),
    "at": V({"force": 1.0}, [None, 1.0, "x", {}, {"force": "x"}, {"force": NAN}]),
    "t": SPAN_OF_TIME, "dt": V(0.5, [*POSITIVE, ub.Adaptive(1e-3)]),
}  # fmt: skip
OF_FIBRES = ub.Section.rectangle(1.0, 1.0, **STEEL, fibres=ub.Fibres(LAW, number=4))
SERIES = [None, "ab", 1.0, ["1", "2", "3"], [0.0, NAN, 1.0], [0, 1j, 2], [[0.0, 1.0]], [0, HUGE]]
T = np.linspace(0, 10, 400)
OF_PEAKS = number("about") | {
    "t": V(T, SERIES), "x": V(np.exp(-0.05 * T) * np.cos(6 * T), SERIES),
    "prominence": V(0.05, FROM_ZERO),
}  # fmt: skip
SPECTRUM = [
    None, 1.0, "ab", (), ([1.0],), ([1.0], [1.0, 2.0]), ([2.0, 1.0], [1.0, 1.0]),
    ([0.0, NAN], [1.0, 1.0]), ([0.0, "x"], [1.0, 1.0]),
]  # fmt: skip
"""In the place of a spectrum; a function is evaluated at the periods of modes, with a mesh."""
HEAVY = clamped(BEAM, masses=[ub.PointMass(BEAM.end, 1.0)])
OF_ANALYSES = nothing("mesh newton") | switch("progress") | {"scene": V(HEAVY, OBJECT)}
BENT = st.Measurement(
    [0.5, 1.0], [1.0, 2.0], lambda run: run.displacement(BEAM.end)[:, 0],
    scheme=ub.Static(), t=(0, 1), dt=0.5,
)  # fmt: skip
PUSH = ub.simulate(PUSHED, ub.Static(), t=(0, 1), dt=1.0, progress=False)


def stretched(force):
    """The beam under a growing force."""
    load = ub.PointLoad(BEAM.end, force=(force, 0), amplitude=lambda t: t)
    return clamped(BEAM, loads=[load])


QUANTITIES = {"u": lambda s: s.displacement(BEAM.end)}

TABLE = {
    # sections and materials
    "Section": row(positive("EA GA EI"), from_zero("rhoI depth"),
        laws("axial shear bending fibres"), nothing("interaction shape"),
        rhoA=V(0.0, optional(FROM_ZERO)), hinge=V(None, optional(NO_SOFTENING))),
    "Shape": row(
        corners=V([(0, 0), (1, 0, 0.1), (1, 1)], [
            None, 1.0, "ab", [], [1.0], [(0, 0), (1, 0)], [(0, 0), (1, 0), (1,)],
            [(0, 0), (1, 0), (1, NAN)], [(0, 0), (1, 0), (1, "1")], [(0, 0), (1, 0), (1, 1, -0.1)],
        ]),
        holes=V([], [None, 1.0, "ab", [None], [1.0], [[(0, 0), (1, 0)]]]),
    ),
    "Section.of_shape": row(SHAPE, shape=V(st.Shape([(-1, 0), (1, 0), (0, 1)]), OBJECT)),
    "Section.rectangle": row(SHAPE, positive("b h")),
    "Section.circle": row(SHAPE, positive("d")),
    "Section.tube": row(SHAPE, positive("d"), t=V(0.1, [*POSITIVE, 0.6])),
    "box": row(SHAPE, b=V(0.2, POSITIVE), h=V(0.3, POSITIVE), t=V(0.02, [*POSITIVE, 0.1]),
        r=V(0.02, [*FROM_ZERO, 0.2])),
    "i_shape": row(FLANGED, SHAPE),
    "channel": row(FLANGED, SHAPE),
    "t_shape": row(FLANGED, SHAPE),
    "steel": row(SHAPE, designation=V("IPE 80", [*TEXT, "IPE 81"])),
    "of_sectionproperties": row(analysed=V(Analysed(), OBJECT), axis=V("y", [*TEXT, "z"])),
    "Section.of_fibres": row(positive("shear_factor"),
        y=V([0.0, 1.0], [*FIBRES, [0.0, 0.0], [0.0, HUGE]]),
        A=V([1.0, 1.0], [*FIBRES, [1.0, -1.0], [1.0, 0.0]]), E=V([1.0, 1.0], [*OF_EACH, None, 0.0]),
        nu=V(0.3, [*NUMBER, 0.6]), rho=V(0.0, OF_EACH),
        fibres=V([ub.Fibres(LAW)] * 2, [*NO_LAW, [ub.Fibres(LAW)], [ub.Fibres(LAW), LAW]])),
    "Section.reinforced": row(positive("E"), y=V([-0.3, 0.3], [*FIBRES, 0.3, [0.0, 0.6], [0.0]]),
        A=V([0.01, 0.01], [*FIBRES, [0.01, 0.0], [0.01, 1.0]]), fibres=V(ub.Fibres(LAW), NO_LAW)),
    "Fibres": row(law("law"), count("number"), softening=V(None, [*optional(OBJECT), LAW])),
    "ElastoPlastic": row(limit("yield_limit"), from_zero("isotropic kinematic"),
        viscosity=V(ub.Perzyna(0.0), OBJECT)),
    "RambergOsgood": row(positive("yield_limit offset"), exponent=V(5.0, [*POSITIVE, 0.5])),
    "ArmstrongFrederick": row(positive("yield_limit kinematic recovery")),
    "BoucWen": row(positive("yield_limit"), from_zero("strength"),
        hardening=V(0.1, [*FROM_ZERO, 1.0]), exponent=V(2.0, [*POSITIVE, 0.5]),
        shape=V(0.6, [*FROM_ZERO, 0.4, 1.1])),
    "MenegottoPinto": row(positive("yield_limit R0 cR2 a2 a4"), from_zero("a1 a3"),
        hardening=V(0.1, [*FROM_ZERO, 1.0]), cR1=V(0.9, [*FROM_ZERO, 1.0])),
    "KentPark": row(positive("ultimate"), softening("tension"), strength=V(3.0, POSITIVE),
        residual=V(1.0, [*FROM_ZERO, 4.0])),
    "KentPark.confined": row(softening("tension"), from_zero("ratio yield_limit width"),
        positive("spacing"), strength=V(3e7, [*POSITIVE, 30.0])),
    "Mander": row(positive("strain"), softening("tension"), strength=V(3.0, POSITIVE),
        spalling=V(3.0, [*NO_NUMBER, NAN, 2.0, -INF])),
    "Mander.confined": row(softening("tension"), from_zero("pressure"), strength=V(3e7, POSITIVE),
        strain=V(0.002, POSITIVE)),
    "AxialBending": row(positive("axial bending rounding")),
    "Perzyna": row(limit("eta")),
    "DuvautLions": row(limit("tau")),
    "Softening": row(SOFTENING),
    "LinearSoftening": row(SOFTENING),
    "Normal": row(NORMAL),
    "TruncatedNormal": row(NORMAL),
    "Lognormal": row(NORMAL),
    "Weibull": row(positive("scale shape"), seed=V(1, SEED)),
    "KelvinVoigt": row(positive("retardation_time"), beams=V(None, optional(LIST))),
    "Rayleigh.with_ratios": row(switch("tangent"),
        ratios=V(0.03, [None, "x", NAN, 0.0, -1.0, HUGE, (0.1, NAN), (0.1,), (0.01, 0.9)]),
        omega=V((1.0, 2.0), [*VECTOR, (0.0, 1.0), (1.0, 1.0)])),
    "Rayleigh": row(from_zero("mass stiffness"), switch("tangent")),
    # beams, bodies, places
    "Beam": row(MEMBER, start=V((0, 0), VECTOR), end=V((1, 0), VECTOR), curve=V(None, CURVE),
        corners=V((), [None, 1.0, "ab", [None], ["0.5"], [NAN], [1j], [1.5], [ARRAY]])),
    "Beam.arc": row(MEMBER, positive("radius"), center=V((0, 0), VECTOR), angles=V((0, 1), VECTOR)),
    "Beam.polyline": row(
        MEMBER,
        points=V([(0, 0), (1, 0)], [None, 1.0, "ab", [(0, 0)], [(0, 0), None], [(0, 0), (1, NAN)]]),
    ),
    "Beam.along": row(MEMBER, curve=V(lambda s: (s, 0), [*CURVE, None])),
    "Beam.at": row(s=V(0.5, [*NUMBER, -0.1, 1.1])),
    "Place": row(beam("beam"), switch("beyond"), s=V(0.5, [*NUMBER, -0.1, 1.1])),
    "Body": row(vector("center"), from_zero("mass inertia"), text("name")),
    "Body.at": row(number("x y")),
    "BodyPoint": row(vector("point"), body=V(BODY, OBJECT)),
    "ground": row(number("x y")),
    # joints, connectors and their laws
    "Rigid": row(CORNER),
    "Revolute": row(CORNER),
    "Release": row(CORNER, free=V("M", [*TEXT, "", "X", "MX"])),
    "Prismatic": row(place("rail"), switch("turning"), slider=V(OTHER.end, NO_PLACE),
        axis=V(None, optional(VECTOR))),
    "RigidLink": row(PAIR),
    "Link": row(PAIR),
    "Guided": row(place("place"), curve=V(lambda s: (1 + s, 0), [*CURVE, None])),
    "Turn": row(CONNECTOR),
    "Stretch": row(CONNECTOR),
    "Slide": row(CONNECTOR, axis=V(None, optional(VECTOR))),
    "Bushing": row(PAIR, vector("axis"), text("name"), law=V(ub.Clearance(1.0, gap=1.0), OBJECT)),
    "Spring": row(positive("stiffness"), nothing("law softening"), number("free")),
    "Damper": row(positive("viscosity")),
    "Stop": row(positive("stiffness"), from_zero("damping"),
        low=V(-1.0, [*NO_NUMBER, None, NAN, 1.0]), high=V(1.0, [*NO_NUMBER, None, NAN, -1.0])),
    "Backbone": row(positive("yield_limit capping"), post_capping=V(1.0, [*LIMIT, 0.0]),
        overstrength=V(1.0, [*NUMBER, 0.9]), residual=V(0.5, [*FROM_ZERO, 1.1]),
        ultimate=V(2.0, [*LIMIT, 0.0, 1.0])),
    "IbarraKrawinkler": row(HINGE),
    "PinchingHinge": row(HINGE, capacity("reloading"), kappa_F=V(0.5, [*POSITIVE, 1.1]),
        kappa_D=V(0.5, [*FROM_ZERO, 1.1])),
    "AxialBendingHinge": row(positive("axial bending along across turning")),
    "Clearance": row(positive("stiffness gap"), from_zero("damping friction radius")),
    "Coulomb": row(from_zero("force coefficient"), joint=V(JOINT, OBJECT)),
    "RigidPlastic": row(law=V(LAW, OBJECT)),
    "ForceLaw": row(force=V(lambda e, rate, state: (e, state), FUNCTION),
        state=V([0.0], [None, 1.0, "ab", [NAN], [1j], ["1"], [[1.0]], [HUGE]]),
        stored=V(None, optional(FUNCTION))),
    "Controller": row(force=V(lambda simulation: 1.0, FUNCTION),
        sample=V(None, optional(POSITIVE))),
    "PrescribedMotion": row(timed("motion")),
    "PrescribedForce": row(timed("force")),
    # loads, supports, masses
    "PointLoad": row(place("place"), FORCE),
    "FollowerLoad": row(place("place"), FORCE),
    "LineLoad": row(beam("beam"), FORCE, PART),
    "Pressure": row(beam("beam"), number("normal tangential"), timed("amplitude"), PART),
    "MovingLoad": row(timed("position amplitude"), vector("force"), from_zero("mass"),
        beam=V(BEAM, [*(x for x in NO_BEAM if not isinstance(x, list)), []])),
    "ImposedStrain": row(beam("beam"), timed("amplitude"),
        alike((0.0, 1e-4), ["x", *VECTOR[3:], *TIME[3:]])("axial curvature shear"), span=INSIDE),
    "Gravity": row(vector("acceleration"), timed("amplitude")),
    "VirtualWork": row(OF_WORKS, density=V(lambda w, c: c * w[1], [*FUNCTION, lambda x: x])),
    "Potential": row(OF_WORKS, density=V(lambda q, c: c * q[1], [*FUNCTION, lambda w: w])),
    "Effect": row(count("degree"), statement=V(AirDrag(), [*OBJECT, AirDrag]),
        places=V([BEAM.end], [*LIST, [BEAM.end, BEAM.start]]),
        beams=V(None, [[BEAM], *optional(LIST)]), numbers=OF_WORKS["numbers"]),
    "RotatingFrame": row(number("rate"), vector("about")),
    "Table": row(times=V([0, 1], TIMES), values=V([0, 1], VALUES)),
    "Spline": row(
        points=V([(0, 0), (1, 0)], [None, 1.0, "01", [(0, 0)], [(0, 0), (1, NAN)], [0, 1]]),
        s=V([0, 1], optional(TIMES))),
    "ramp": row(positive("duration")),
    "GroundMotion": row(positive("dt"), text("name"), values=V([0, 1], [*VALUES, [[0, 1]]])),
    "GroundMotion.from_history": row(text("name"), times=V([0, 1], TIMES), values=V([0, 1], VALUES),
        dt=V(0.1, optional(POSITIVE))),
    "GroundMotion.read": row(
        # Wrong units and steps need a file: unit/test_ground_motion.py
        path=V("quake.txt", PATH), unit=V("g", []), dt=V(0.1, []),
    ),
    "GroundMotion.scaled": row(factor=V(None, optional(NUMBER)), peak=V(2.0, POSITIVE)),
    "GroundMotion.corrected": row(degree=V(1, [*FROM_ZERO, 1.5, "2"]),
        highpass=V(None, [*optional(POSITIVE), 5.0])),
    "GroundMotion.resampled": row(dt=V(0.05, POSITIVE)),
    "Clamped": row(place("place")),
    "Pinned": row(place("place")),
    "Roller": row(place("place"), along=V((1, 0), [*VECTOR, (0, 0)])),
    "PrescribedDisplacement": row(place("place"), along=V((1.0, 0.5), [*VECTOR, (0, 0)]),
        **alike(0.0, [*NO_NUMBER, NAN, INF, *(f for f in TIME if callable(f))])("u v psi")),
    "PointMass": row(place("place"), from_zero("mass inertia")),
    "Velocity": row(vector("linear"), number("angular"), beams=V([BEAM], LIST),
        about=V((0, 0), optional(VECTOR))),
    "Scene": row(each("joints supports loads masses initial damping bodies connectors works"),
        beams=V([BEAM], LIST)),
    # schemes, discretisation, solver, steps
    "EnergyMomentum": row(alike(0.0, [*FROM_ZERO, 0.6])("alpha beta"),
        order=V(2, [*NUMBER, 1, 3, 2.5])),
    "EnergyMomentumDecaying": row(rho_inf=V(0.5, [*NUMBER, 0.1, 1.1])),
    "Newmark": row(gamma=V(0.5, [*NUMBER, 0.4]), beta=V(0.25, [*NUMBER, 0.1])),
    "GeneralizedAlpha": row(rho_inf=V(0.8, [*NUMBER, -0.1, 1.1])),
    "EnergyMomentumStatic": row(theta=V(1.0, [*NUMBER, 0.4, 1.1])),
    "Camera": row(direction=V((0, 0, -1), [*OBJECT, (0, 1, 0), (0, 0, NAN), ("0", "0", "1")]),
        follow=V(BEAM.end, ["x", 1.0, BEAM, ARRAY]), width=V(1.0, optional(POSITIVE))),
    "Mesh": row(switch("lumped"), refine=V(1, [*POSITIVE, 1.5]), degree=V(1, [*COUNT, 4])),
    "Newton": row(positive("rtol"), count("max_iterations"), switch("reference"),
        petsc=V({}, [None, 1.0, "x", [], {1: None}])),
    "Adaptive": row(positive("tolerance"),
        alike(None, optional(POSITIVE))("first longest shortest"),
        stops=V((), [None, 1.0, "ab", [None], ["1"], [NAN], [1j], [HUGE]])),
    # runs
    "simulate": row(RUN, nothing("start checkpoint"), count("every max_states"), switch("progress"),
        each("record"), scene=V(SCENE, OBJECT), scheme=SCHEME, t=SPAN_OF_TIME, dt=V(0.5, POSITIVE),
        until=V(None, optional(FUNCTION))),
    "Simulation": row(RUN, number("t0"), nothing("start"), scene=V(SCENE, OBJECT), scheme=SCHEME,
        kind=V(ub.Path, OBJECT)),
    "follow": row(RUN, nothing("start"), each("record"), switch("progress"),
        scene=V(GROWING, OBJECT), control=V(ub.LoadControl(1.0), [*OBJECT, ub.LoadControl]),
        until=V(None, optional(FUNCTION)), steps=V(1, COUNT)),
    "ArcLength": row(positive("factor"), step=V(1.0, [*NUMBER, 0.0])),
    "LoadControl": row(step=V(1.0, [*NUMBER, 0.0])),
    "DisplacementControl": row(place("place"), component=V("u", [*TEXT, "w", "", "uv"]),
        step=V(1.0, [*NUMBER, 0.0]), end=V(None, optional(NUMBER))),
    "DissipationControl": row(positive("step"), otherwise=V(ub.ArcLength(1.0), OBJECT)),
    "modes": row(nothing("at mesh"), scene=V(SCENE, OBJECT), n=V(1, COUNT)),
    "buckling": row(nothing("at mesh"), number("t"), scene=V(SCENE, OBJECT), n=V(1, COUNT)),
    "linearize": row(nothing("at mesh"), scene=V(PUSHED, OBJECT),
        inputs=V([PUSHED.loads[0]], [*LIST, [None], [1.0], []]),
        outputs=V([("displacement", BEAM.end, "v")],
            [*LIST, [], ["v"], [("displacement", BEAM.end, "x")], [("displacement", 1.0)]])),
    "imperfect": row(nothing("mode"), scene=V(SCENE, OBJECT), sway=V(0.01, NUMBER),
        bow=V({BEAM: 0.01}, [1.0, "ab", {BEAM: NAN}, {BEAM: "x"}, {1: 0.1}]),
        k=V(0, [None, "2", -1, 1.5, NAN]), amplitude=V(0.1, NUMBER)),
    "study": row(nothing("comm"), switch("anew progress"), member=V(lambda: {"x": 1.0}, FUNCTION),
        cases=V([{}], [None, 1.0, "ab", [None], ["x"], []]), path=V(None, optional(PATH))),
    "differentiate": row(DERIVED, nothing("start"), switch("progress"), scheme=SCHEME,
        unused=V((), [None, 1.0, "force", ["x"], [1.0]])),
    "gradient": row(DERIVED, scheme=V(ub.Static(), [*SCHEME[1], ub.EnergyMomentumStatic(0.7)]),
        of=V(lambda run: run.displacement(BEAM.end)[:, 0], FUNCTION), reduce=V(np.mean, FUNCTION),
        max_bytes=V(1e6, POSITIVE)),
    "tradeoff": row(RUN, positive("max_seconds"), switch("progress"), scene=V(SCENE, OBJECT),
        quantities=V(QUANTITIES, [None, 1.0, "x", {}, {"u": None}, {"u": 1.0}, {1: lambda s: s}]),
        scheme=V(ub.EnergyMomentum(), [*OBJECT, ub.EnergyMomentum]), t=SPAN_OF_TIME,
        dt=V(0.5, [*(v for v in POSITIVE if not isinstance(v, list)), []]),
        tolerance=V(1e-3, optional(POSITIVE)), budget=V(None, [1.0])),
    "tradeoff.budget": row(budget=V(1.0, optional(POSITIVE))),
    # files
    "XDMF": row(path=V("run.xdmf", [*PATH, "run.h5"]), every=V(1, COUNT)),
    "VTKHDF": row(path=V("run.hdf", [*PATH, "run.h5"]), every=V(1, COUNT)),
    "Solution.load": row(nothing("scene"), path=V("run.h5", PATH)),
    "History": row(each("places connectors accelerations"), count("every max_rows"),
        path=V("run.csv", PATH)),
    "Extremes": row(switch("accelerations"), points=V(2, [*NUMBER, 1])),
    "Checkpoint": row(path=V("run.h5", PATH), every=V(1, optional(COUNT)),
        minutes=V(None, optional(FROM_ZERO)), also=V((), [None, 1.0, "ab"])),
    "Events": row(tell=V(None, optional(FUNCTION))),
    # fatigue
    "Fatigue": row(from_zero("resolution"), spots=V(st.HotSpot.fibre(BEAM.end, y=0.1, E=1.0), LIST),
        curve=V(st.SNCurve(range=1.0), OBJECT)),
    "HotSpot": row(place("place"), stress=V(lambda N, V, M: N, FUNCTION)),
    "HotSpot.fibre": row(place("place"), number("y"), positive("E factor")),
    "SNCurve": row(positive("range cycles slope slope_beyond"),
        alike(INF, [*NO_NUMBER, None, NAN, -1.0, 0.0])("knee limit"),
        mean=V(lambda range, mean: range, FUNCTION)),
    "SNCurve.eurocode": row(category=V(71.0, POSITIVE)),
    "Goodman": row(positive("ultimate")),
    "Gerber": row(positive("ultimate")),
    # structures
    "moment_curvature": row(positive("dt"), section=V(OF_FIBRES, OBJECT),
        curvature=V([0.0, 0.0], [x for x in FIBRES if x != [1.0]]),
        N=V([0.0, 0.0], [x for x in FIBRES if x != 1.0]), length=V(None, optional(POSITIVE))),
    "interaction_diagram": row(section=V(OF_FIBRES, OBJECT),
        limits=V((0.01, 0.02), [None, 1.0, "ab", (0.01,), (0.01, 0.0), {BEAM: (1, 1)}, (1, NAN)]),
        points=V(8, COUNT), steps=V(1, COUNT), length=V(None, optional(POSITIVE))),
    "peaks": row(OF_PEAKS),
    "damping": row(OF_PEAKS),
    "logarithmic_decrement": row(amplitudes=V([3.0, 2.0, 1.0], [*SERIES, [1.0], [1.0, -1.0]])),
    "fit_decay": row(t=V([0.0, 1.0, 2.0, 3.0], SERIES), amplitudes=V([3.0, 2.2, 1.5, 1.1], SERIES)),
    "damping_ratio": row(decrement=V(0.1, ["x", None, 1j, NAN, HUGE])),
    "rainflow": row(series=V([0.0, 1.0, 0.0], SERIES)),
    "response_spectrum": row(motion=V(MOTION, OBJECT),
        periods=V([1.0], [None, "ab", [], ["1"], [NAN], [1j], [[1.0]], [HUGE], [0.0], -1.0]),
        damping=V(0.05, [*FROM_ZERO, 1.0]), ductility=V(1.0, [*FROM_ZERO, 0.5]),
        hardening=V(0.0, [*FROM_ZERO, 1.0])),
    "pushover": row(OF_ANALYSES, count("steps"), place=V(BEAM.end, [*OBJECT, BODY.middle]),
        target=V(0.1, [*NUMBER, 0.0]), component=V("u", [None, 1.0, "w", "psi", ARRAY]),
        pattern=V("uniform", [*LIST, [ub.FollowerLoad(BEAM.end, force=(1, 0))]])),
    "incremental_dynamic_analysis": row(
        RUN, nothing("start"), positive("limit"), switch("anew progress"),
        build=V(lambda motion: HEAVY, [*FUNCTION, lambda motion: None]),
        motions=V([st.GroundMotion(0.1, [1.0, 2.0])], [*LIST, []]),
        intensities=V([1.0, 2.0], [*SERIES, [2.0, 1.0], [0.0, 1.0], [-1.0]]),
        measure=V(lambda run: run.displacement(BEAM.end), FUNCTION),
        intensity=V(
            lambda motion: motion.peak,
            [*FUNCTION[1:], *(lambda motion, x=x: x for x in (None, "x", NAN, 0.0, -1.0))],
        ),
        scheme=V(None, [*OBJECT[1:], ub.Static()]), dt=V(None, optional(POSITIVE)),
        path=V(None, optional(PATH)),
    ),
    "Fragility.fit": row(intensities=V([1.0, 2.0], [*SERIES, [0.0, 1.0], [1.0]]),
        exceeded=V([1, 3], [*SERIES, [-1, 3], [5, 3]]), number=V([4, 4], [*SERIES, [0, 0], [4]])),
    "load_combinations": row(
        OF_ANALYSES, count("steps"),
        cases=V(
            {"Q": [ub.PointLoad(BEAM.end, force=(1, 0))]},
            [*LIST, {}, {1: []}, {"a": [None]}, {"a": [ub.RotatingFrame(rate=1.0)]}],
        ),
        combinations=V(
            {"A": {"Q": 1.5}},
            [*LIST, {}, {"A": {}}, {"A": {"R": 1.0}}, *({"A": {"Q": x}} for x in NUMBER)],
        ),
    ),
    "response_spectrum_analysis": row(nothing("at mesh"), count("n"), scene=V(HEAVY, OBJECT),
        spectrum=V(([0.0, 9.0], [1.0, 1.0]), SPECTRUM), direction=V((1, 0), [*VECTOR, (0.0, 0.0)]),
        damping=V(0.05, [*POSITIVE, 1.0]), rule=V("CQC", [None, 1.0, "cqc", ARRAY])),
    "Measurement": row(nothing("newton mesh"), text("name"),
        times=V([0.5, 1.0], [*optional(SERIES), [1.0, 0.5], [0.5, 2.0], [0.5]]),
        values=V([1.0, 2.0], [*SERIES, [], [1.0]]), quantity=V(lambda run: run.times, FUNCTION),
        scheme=V(ub.Static(), OBJECT), t=V((0, 1), [*VECTOR, (1, 0), (0, 0.5)]),
        dt=V(0.5, [*POSITIVE, ub.Adaptive(1e-3)]), arguments=V({}, optional(LIST)),
        sigma=V(None, [*(x for x in optional(POSITIVE) if x is not ARRAY), [1.0, 0.0], [1.0]]),
        labels=V(("t", "x"), [None, 1.0, "ab", "abc", ("a",), ("a", 1)])),
    "calibrate": row(
        switch("progress"), nothing("comm"),
        model=V(stretched, [*FUNCTION, lambda force: None, lambda: SCENE]),
        parameters=V({"force": 1.0}, [*LIST, {}, {"load": 1.0}, {1: 1.0}, {"force": (1.0, 2.0)},
                     {"force": (3.0, 1.0, 2.0)}, *({"force": x} for x in [*NUMBER, 0.0])]),
        measured=V([BENT], [*LIST, []]), starts=V(1, [*COUNT, 2]), seed=V(0, SEED),
    ),
    "storeys": row(solution=V(PUSH, OBJECT),
        levels=V([BEAM.start, ub.ground(0, 1)], [*LIST, [BEAM.start]])),
    "hinge_table": row(solution=V(PUSH, OBJECT),
        limits=V({"IO": 0.1}, [*LIST, {1: 0.1}, {"IO": 0.2, "LS": 0.1}, {"IO": 0.0}]),
        n=V(-1, [None, "a", 0.5, [0], 10**6, -(10**6)]),
        only=V([BEAM], [*optional(LIST), [OTHER]])),
}  # fmt: skip
"""Parameters of each public callable; of methods, too."""


def pair_of(kind):
    return lambda a, b, multipliers: kind(a, b, multipliers=multipliers)


METHODS = {
    "Section.reinforced": OF_FIBRES.reinforced,
    "Beam.at": BEAM.at,
    "Body.at": BODY.at,
    "Rigid": pair_of(ub.Rigid),
    "Revolute": pair_of(ub.Revolute),
    "GroundMotion.scaled": MOTION.scaled,
    "GroundMotion.corrected": MOTION.corrected,
    "GroundMotion.resampled": MOTION.resampled,
    "tradeoff.budget": lambda budget: ub.tradeoff(
        SCENE, QUANTITIES, scheme=ub.EnergyMomentum(), t=(0, 1), dt=0.5, budget=budget
    ),
}


def called(name):
    """The callable of a row, of a valid object if it is a method."""
    return METHODS.get(name) or reduce(getattr, name.split(".")[1:], ALL[name.split(".")[0]])


RECORDS_OF_RUNS = {
    "Branch", "Buckling", "Calibration", "Coefficients", "Connector", "CriticalPoint", "Cycles",
    "Decay", "DemandCurves", "Derivatives", "Diagram", "DolfinxView", "Energy", "Envelope",
    "Equations", "Event", "Extent", "Film", "Governing", "HingeFormation", "InteractionDiagram",
    "Joint", "LinearModel", "LoadCombinations", "Modes", "MomentCurvature", "Path", "Pushover",
    "Solution", "SpectralResponse", "Step", "Study", "Support", "TargetDisplacement", "Tradeoff",
}  # fmt: skip
"""Made by runs and by functions of the package, not by users."""

WITHOUT_PARAMETERS = {
    "Static", "EnergyMomentumPrinted", "Recorder", "print_once", "Scheme",
    "DynamicScheme", "ConnectorLaw", "EnergyMomentumBase", "MidpointDynamics", "MaterialLaw",
    "SofteningLaw", "Statement", "law_functions", "extend", "distributions",
}  # fmt: skip

OF_SOLUTIONS = {"animate", "picture", "plot", "render"}
"""Pictures, whose tests are in pictures/."""


def test_every_public_callable_is_in_the_table():
    errors = {n for n, o in PUBLIC.items() if inspect.isclass(o) and issubclass(o, BaseException)}
    known = {name.split(".")[0] for name in TABLE}
    missing = set(PUBLIC) - errors - known - RECORDS_OF_RUNS - WITHOUT_PARAMETERS - OF_SOLUTIONS
    assert missing == set()


@pytest.mark.parametrize("name", TABLE)
def test_every_parameter_is_in_the_table(name):
    parameters = inspect.signature(called(name)).parameters.values()
    assert {p.name for p in parameters if p.kind is not p.VAR_KEYWORD} <= set(TABLE[name])


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
    "concrete_laws", "ground_motion", "hinge_laws", "hysteresis_laws", "steel_laws",
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
    good = {parameter: value for parameter, (value, _) in TABLE[name].items()}
    for parameter, (_, kind) in TABLE[name].items():
        for value in kind:
            yield parameter, value, {**good, parameter: value}


@pytest.mark.parametrize("name", TABLE)
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
        ub.simulate(
            scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, progress=False, comm=MPI.COMM_SELF
        )


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
