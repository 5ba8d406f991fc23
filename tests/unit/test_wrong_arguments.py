# SPDX-License-Identifier: MIT
"""Every parameter of every public callable refuses what it cannot take, by name, before any mesh.

The table below has a valid call of each public callable and the kind of each of its parameters.  A
kind is a list of values that the parameter must refuse.
"""

import inspect
import math
import re

from mpi4py import MPI

import numpy as np
import pytest
from helpers import ALL, PUBLIC
from user_laws import AirDrag

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.simulation import step_equation

NAN, INF, HUGE = math.nan, math.inf, 10**400
ARRAY = np.array([1.0, 2.0])

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)
BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
OTHER = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="other")
BODY = ub.Body((2, 0), mass=1.0, inertia=1.0, name="hub")
SCENE = ub.Scene([BEAM], supports=[ub.Clamped(BEAM.start)])
PUSHED = ub.Scene(
    [BEAM], supports=[ub.Clamped(BEAM.start)], loads=[ub.PointLoad(BEAM.end, force=(0, 1))]
)
GROWING = ub.Scene(
    [BEAM],
    supports=[ub.Clamped(BEAM.start)],
    loads=[ub.PointLoad(BEAM.end, force=(1, 0), amplitude=lambda t: t)],
)
STEEL = {"E": 210e9, "nu": 0.3}
LAW = ub.ElastoPlastic(1e8)
BREAKS = ub.Softening(10.0, 5.0)
SPRING = ub.Spring(1.0)
BACKBONE = st.Backbone(1.0, 1.0)
JOINT = ub.Revolute(BEAM.end, OTHER.start, multipliers=True)
MOTION = st.GroundMotion(0.1, [0.0, 1.0, 0.5, 0.0])


class Analysed:
    """An analysed section in place of one of sectionproperties."""

    __module__ = "sectionproperties.analysis.section"


# -- kinds of parameters: what each of them must refuse ------------------------------------------

NONE = [None]
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
OPTIONAL_NUMBER = [*NO_NUMBER, NAN, INF]


def optional(kind):
    """The same where None is allowed."""
    return [value for value in kind if value is not None]


def call(function, /, **parameters):
    """A row: a callable, a valid value and a kind of each of its parameters."""
    return function, parameters


def V(value, kind):
    """A valid value, and what is refused in its place."""
    return value, kind


PLACE = V(BEAM.end, NO_PLACE)
TIMED = {"moment": V(1.0, NUMBER), "amplitude": V(lambda t: t, [*TIME, None])}
PART = {
    "span": V((0.2, 0.6), [*VECTOR, (0.6, 0.2), (0.2, 0.2), (-0.1, 0.5), (0.5, 1.1)]),
    "profile": V((0.0, 1.0), [*VECTOR, *(f for f in TIME if f is not ARRAY)]),
}
SHAPE = {
    "E": V(1.0, POSITIVE),
    "nu": V(0.3, [*NUMBER, 0.6, -1.0]),
    "rho": V(1.0, optional(FROM_ZERO)),
    "shear_factor": V(0.8, POSITIVE),
    "fibres": V(None, optional(NO_LAW)),
    "axis": V("weak", [*TEXT, "x"]),
    "core": V(None, optional(NO_LAW)),
    "cover": V(0.0, [*NUMBER, -1.0, 0.2]),
    "shear_factor3": V(None, optional(POSITIVE)),
    "torsion": V(None, optional([*POSITIVE, 10.0])),
    "centroid_only": V(False, SWITCH),
}
FLANGED = {
    "h": V(0.4, POSITIVE),
    "b": V(0.2, POSITIVE),
    "tw": V(0.01, [*POSITIVE, 0.21]),
    "tf": V(0.02, [*POSITIVE, 0.4]),
    "r": V(0.02, [*FROM_ZERO, 0.4]),
}
SOFTENING = {"limit": V(1.0, LIMIT), "fracture_energy": V(1.0, POSITIVE)}
NORMAL = {"mean": V(1.0, POSITIVE), "deviation": V(0.1, POSITIVE), "seed": V(1, SEED)}
MESH = {"mesh": V(None, optional(OBJECT))}
CAPACITY = V(1.0, optional([*LIMIT, 0.0]))
HINGE = {
    "stiffness": V(1.0, POSITIVE), "backbone": V(BACKBONE, OBJECT),
    "negative": V(None, optional(OBJECT)), "strength": CAPACITY, "softening": CAPACITY,
    "unloading": CAPACITY, "exponent": V(1.0, [*POSITIVE, 0.5]),
}  # fmt: skip


class Loose(ub.extend.Statement):
    """A class that is no dataclass."""

    def equations(self, at):
        return ub.extend.Equations([[0.0, 0.0, 0.0]])


OF_WORKS = {
    "name": V("wind", [*TEXT, "", "kinetic"]),
    "beams": V(None, optional(LIST)),
    "numbers": V({"c": 1.0}, [None, 1.0, "ab", {}, {"c": None}, {"c": NAN}, {"w": 1, "q": 1}]),
    "degree": V(2, COUNT),
}
RUN = {"newton": V(None, optional(OBJECT)), **MESH, "comm": V(None, optional(OBJECT))}
ALONG = {"record": V((), LIST), "start": V(None, optional(OBJECT)), **RUN}


TABLE = {
    # sections and materials
    "Section": call(
        ub.Section,
        EA=V(1.0, POSITIVE), GA=V(1.0, POSITIVE), EI=V(1.0, POSITIVE),
        rhoA=V(0.0, optional(FROM_ZERO)), rhoI=V(0.0, FROM_ZERO),
        depth=V(0.0, FROM_ZERO), axial=V(None, optional(NO_LAW)),
        shear=V(None, optional(NO_LAW)), bending=V(None, optional(NO_LAW)),
        hinge=V(None, optional(NO_SOFTENING)), fibres=V(None, optional(NO_LAW)),
        interaction=V(None, optional(OBJECT)), shape=V(None, optional(OBJECT)),
        GA3=V(None, optional(POSITIVE)), EI2=V(None, optional(POSITIVE)),
        GJ=V(None, optional(POSITIVE)), rhoI2=V(None, optional(POSITIVE)),
        centroid_only=V(False, SWITCH),
    ),
    "Shape": call(
        st.Shape,
        corners=V([(0, 0), (1, 0, 0.1), (1, 1)], [
            None, 1.0, "ab", [], [1.0], [(0, 0), (1, 0)], [(0, 0), (1, 0), (1,)],
            [(0, 0), (1, 0), (1, NAN)], [(0, 0), (1, 0), (1, "1")], [(0, 0), (1, 0), (1, 1, -0.1)],
        ]),
        holes=V([], [None, 1.0, "ab", [None], [1.0], [[(0, 0), (1, 0)]]]),
    ),
    "Section.of_shape": call(
        ub.Section.of_shape,
        shape=V(st.Shape([(-1, 0), (1, 0), (0, 1)]), OBJECT), **SHAPE,
    ),
    "Section.rectangle": call(
        ub.Section.rectangle, b=V(1.0, POSITIVE), h=V(1.0, POSITIVE), **SHAPE
    ),
    "Section.circle": call(ub.Section.circle, d=V(1.0, POSITIVE), **SHAPE),
    "Section.tube": call(ub.Section.tube, d=V(1.0, POSITIVE), t=V(0.1, [*POSITIVE, 0.6]), **SHAPE),
    "box": call(
        st.box, b=V(0.2, POSITIVE), h=V(0.3, POSITIVE), t=V(0.02, [*POSITIVE, 0.1]),
        r=V(0.02, [*FROM_ZERO, 0.2]), **SHAPE,
    ),
    "i_shape": call(st.i_shape, **FLANGED, **SHAPE),
    "channel": call(st.channel, **FLANGED, **SHAPE),
    "t_shape": call(st.t_shape, **FLANGED, **SHAPE),
    "steel": call(st.steel, designation=V("IPE 80", [*TEXT, "IPE 81"]), **SHAPE),
    "of_sectionproperties": call(
        st.of_sectionproperties, analysed=V(Analysed(), OBJECT), axis=V("y", [*TEXT, "z"])
    ),
    "Section.of_fibres": call(
        ub.Section.of_fibres,
        y=V([0.0, 1.0], [*FIBRES, [0.0, 0.0], [0.0, HUGE]]),
        A=V([1.0, 1.0], [*FIBRES, [1.0, -1.0], [1.0, 0.0]]),
        E=V([1.0, 1.0], [*OF_EACH, None, 0.0]), nu=V(0.3, [*NUMBER, 0.6]),
        rho=V(0.0, OF_EACH),
        shear_factor=V(0.8, POSITIVE),
        fibres=V([ub.Fibres(LAW)] * 2, [*NO_LAW, [ub.Fibres(LAW)], [ub.Fibres(LAW), LAW]]),
    ),
    "Section.reinforced": call(
        ub.Section.rectangle(1.0, 1.0, **STEEL, fibres=ub.Fibres(LAW, number=4)).reinforced,
        y=V([-0.3, 0.3], [*FIBRES, 0.3, [0.0, 0.6], [0.0]]),
        A=V([0.01, 0.01], [*FIBRES, [0.01, 0.0], [0.01, 1.0]]),
        E=V(1.0, POSITIVE), fibres=V(ub.Fibres(LAW), NO_LAW),
    ),
    "Fibres": call(
        ub.Fibres,
        law=V(LAW, NO_LAW), number=V(5, COUNT), softening=V(None, [*optional(OBJECT), LAW]),
    ),
    "ElastoPlastic": call(
        ub.ElastoPlastic,
        yield_limit=V(1.0, LIMIT), isotropic=V(0.0, FROM_ZERO), kinematic=V(0.0, FROM_ZERO),
        viscosity=V(ub.Perzyna(0.0), OBJECT),
    ),
    "RambergOsgood": call(
        st.RambergOsgood,
        yield_limit=V(1.0, POSITIVE), offset=V(0.002, POSITIVE), exponent=V(5.0, [*POSITIVE, 0.5]),
    ),
    "ArmstrongFrederick": call(
        st.ArmstrongFrederick,
        yield_limit=V(1.0, POSITIVE), kinematic=V(1.0, POSITIVE), recovery=V(1.0, POSITIVE),
    ),
    "BoucWen": call(
        st.BoucWen,
        yield_limit=V(1.0, POSITIVE), hardening=V(0.1, [*FROM_ZERO, 1.0]),
        exponent=V(2.0, [*POSITIVE, 0.5]), shape=V(0.6, [*FROM_ZERO, 0.4, 1.1]),
        strength=V(0.1, FROM_ZERO),
    ),
    "MenegottoPinto": call(
        st.MenegottoPinto,
        yield_limit=V(1.0, POSITIVE), hardening=V(0.1, [*FROM_ZERO, 1.0]), R0=V(20.0, POSITIVE),
        cR1=V(0.9, [*FROM_ZERO, 1.0]), cR2=V(0.15, POSITIVE), a1=V(0.1, FROM_ZERO),
        a2=V(1.0, POSITIVE), a3=V(0.1, FROM_ZERO), a4=V(1.0, POSITIVE),
    ),
    "KentPark": call(
        st.KentPark,
        strength=V(3.0, POSITIVE), residual=V(1.0, [*FROM_ZERO, 4.0]), ultimate=V(1.0, POSITIVE),
        tension=V(BREAKS, NO_SOFTENING),
    ),
    "KentPark.confined": call(
        st.KentPark.confined,
        strength=V(3e7, [*POSITIVE, 30.0]), ratio=V(0.01, FROM_ZERO),
        yield_limit=V(4e8, FROM_ZERO), width=V(0.3, FROM_ZERO), spacing=V(0.1, POSITIVE),
        tension=V(BREAKS, NO_SOFTENING),
    ),
    "Mander": call(
        st.Mander,
        strength=V(3.0, POSITIVE), strain=V(1.0, POSITIVE),
        spalling=V(3.0, [*NO_NUMBER, NAN, 2.0, -INF]), tension=V(BREAKS, NO_SOFTENING),
    ),
    "Mander.confined": call(
        st.Mander.confined,
        strength=V(3e7, POSITIVE), pressure=V(1e6, FROM_ZERO), strain=V(0.002, POSITIVE),
        tension=V(BREAKS, NO_SOFTENING),
    ),
    "AxialBending": call(
        st.AxialBending,
        axial=V(1.0, POSITIVE), bending=V(1.0, POSITIVE), rounding=V(0.1, POSITIVE),
    ),
    "Perzyna": call(ub.Perzyna, eta=V(1.0, LIMIT)),
    "DuvautLions": call(ub.DuvautLions, tau=V(1.0, LIMIT)),
    "Softening": call(ub.Softening, **SOFTENING),
    "LinearSoftening": call(ub.LinearSoftening, **SOFTENING),
    "Normal": call(ub.distributions.Normal, **NORMAL),
    "TruncatedNormal": call(ub.distributions.TruncatedNormal, **NORMAL),
    "Lognormal": call(ub.distributions.Lognormal, **NORMAL),
    "Weibull": call(
        ub.distributions.Weibull, scale=V(1.0, POSITIVE), shape=V(1.0, POSITIVE), seed=V(1, SEED)
    ),
    "KelvinVoigt": call(
        ub.KelvinVoigt, retardation_time=V(1.0, POSITIVE), beams=V(None, optional(LIST))
    ),
    "Rayleigh.with_ratios": call(
        ub.Rayleigh.with_ratios,
        ratios=V(0.03, [None, "x", NAN, 0.0, -1.0, HUGE, (0.1, NAN), (0.1,), (0.01, 0.9)]),
        omega=V((1.0, 2.0), [*VECTOR, (0.0, 1.0), (1.0, 1.0)]), tangent=V(False, SWITCH),
    ),
    "Rayleigh": call(
        ub.Rayleigh,
        mass=V(1.0, FROM_ZERO), stiffness=V(1.0, FROM_ZERO), tangent=V(False, SWITCH),
    ),
    # beams, bodies, places
    "Beam": call(
        ub.Beam,
        start=V((0, 0), VECTOR), end=V((1, 0), VECTOR), section=V(SECTION, OBJECT),
        cells=V(2, COUNT),
        name=V("girder", TEXT), curve=V(None, CURVE), hinges=V({}, HINGES),
        corners=V((), [None, 1.0, "ab", [None], ["0.5"], [NAN], [1j], [1.5], [ARRAY]]),
    ),
    "Beam.arc": call(
        ub.Beam.arc,
        center=V((0, 0), VECTOR), radius=V(1.0, POSITIVE), angles=V((0, 1), VECTOR),
        section=V(SECTION, OBJECT), cells=V(2, COUNT), name=V("girder", TEXT),
        hinges=V({}, HINGES),
    ),
    "Beam.polyline": call(
        ub.Beam.polyline,
        points=V([(0, 0), (1, 0)], [None, 1.0, "ab", [(0, 0)], [(0, 0), None], [(0, 0), (1, NAN)]]),
        section=V(SECTION, OBJECT), cells=V(2, COUNT), name=V("girder", TEXT),
        hinges=V({}, HINGES),
    ),
    "Beam.along": call(
        ub.Beam.along,
        curve=V(lambda s: (s, 0), [*CURVE, None]), section=V(SECTION, OBJECT), cells=V(2, COUNT),
        name=V("girder", TEXT), hinges=V({}, HINGES),
    ),
    "Beam.at": call(BEAM.at, s=V(0.5, [*NUMBER, -0.1, 1.1])),
    "Place": call(
        ub.Place,
        beam=V(BEAM, NO_BEAM), s=V(0.5, [*NUMBER, -0.1, 1.1]), beyond=V(False, SWITCH),
    ),
    "Body": call(
        ub.Body,
        center=V((0, 0), VECTOR), mass=V(1.0, FROM_ZERO), inertia=V(1.0, FROM_ZERO),
        name=V("hub", TEXT),
    ),
    "Body.at": call(BODY.at, x=V(0.0, NUMBER), y=V(0.0, NUMBER)),
    "BodyPoint": call(ub.BodyPoint, body=V(BODY, OBJECT), point=V((0, 0), VECTOR)),
    "ground": call(ub.ground, x=V(0.0, NUMBER), y=V(0.0, NUMBER)),
    # joints, connectors and their laws
    "Rigid": call(
        lambda a, b, multipliers: ub.Rigid(a, b, multipliers=multipliers),
        a=PLACE, b=V(OTHER.start, NO_PLACE), multipliers=V(False, SWITCH),
    ),
    "Revolute": call(
        lambda a, b, multipliers: ub.Revolute(a, b, multipliers=multipliers),
        a=PLACE, b=V(OTHER.start, NO_PLACE), multipliers=V(False, SWITCH),
    ),
    "Release": call(
        ub.Release,
        a=PLACE, b=V(OTHER.start, NO_PLACE), free=V("M", [*TEXT, "", "X", "MX"]),
        multipliers=V(False, SWITCH),
    ),
    "Prismatic": call(
        ub.Prismatic,
        rail=PLACE, slider=V(OTHER.end, NO_PLACE), axis=V(None, optional(VECTOR)),
        turning=V(False, SWITCH),
    ),
    "RigidLink": call(ub.RigidLink, a=PLACE, b=V(OTHER.end, NO_PLACE)),
    "Link": call(ub.Link, a=PLACE, b=V(OTHER.end, NO_PLACE)),
    "Guided": call(
        ub.Guided, place=PLACE, curve=V(lambda s: (1 + s, 0), [*CURVE, None])
    ),
    **{
        kind.__name__: call(
            kind,
            a=PLACE, b=V(OTHER.end, NO_PLACE), law=V(SPRING, OBJECT), name=V("strut", TEXT),
            **({"axis": V(None, optional(VECTOR))} if kind is ub.Slide else {}),
        )
        for kind in (ub.Turn, ub.Stretch, ub.Slide)
    },
    "Bushing": call(
        ub.Bushing,
        a=PLACE, b=V(OTHER.end, NO_PLACE), law=V(ub.Clearance(1.0, gap=1.0), OBJECT),
        axis=V((1.0, 0.0), VECTOR), name=V("pin", TEXT),
    ),
    "Spring": call(
        ub.Spring,
        stiffness=V(1.0, POSITIVE), law=V(None, optional(OBJECT)),
        softening=V(None, optional(OBJECT)), free=V(0.0, NUMBER),
    ),
    "Damper": call(ub.Damper, viscosity=V(1.0, POSITIVE)),
    "Stop": call(
        ub.Stop,
        stiffness=V(1.0, POSITIVE), low=V(-1.0, [*NO_NUMBER, None, NAN, 1.0]),
        high=V(1.0, [*NO_NUMBER, None, NAN, -1.0]), damping=V(1.0, FROM_ZERO),
    ),
    "Backbone": call(
        st.Backbone,
        yield_limit=V(1.0, POSITIVE), capping=V(1.0, POSITIVE),
        post_capping=V(1.0, [*LIMIT, 0.0]), overstrength=V(1.0, [*NUMBER, 0.9]),
        residual=V(0.5, [*FROM_ZERO, 1.1]), ultimate=V(2.0, [*LIMIT, 0.0, 1.0]),
    ),
    "IbarraKrawinkler": call(st.IbarraKrawinkler, **HINGE),
    "PinchingHinge": call(
        st.PinchingHinge, **HINGE,
        kappa_F=V(0.5, [*POSITIVE, 1.1]), kappa_D=V(0.5, [*FROM_ZERO, 1.1]), reloading=CAPACITY,
    ),
    "AxialBendingHinge": call(
        st.AxialBendingHinge,
        axial=V(1.0, POSITIVE), bending=V(1.0, POSITIVE), along=V(1.0, POSITIVE),
        across=V(1.0, POSITIVE), turning=V(1.0, POSITIVE),
    ),
    "Clearance": call(
        ub.Clearance,
        stiffness=V(1.0, POSITIVE), gap=V(1.0, POSITIVE), damping=V(1.0, FROM_ZERO),
        friction=V(1.0, FROM_ZERO), radius=V(1.0, FROM_ZERO),
    ),
    "Coulomb": call(
        ub.Coulomb,
        force=V(1.0, FROM_ZERO), coefficient=V(1.0, FROM_ZERO), joint=V(JOINT, OBJECT),
    ),
    "RigidPlastic": call(ub.RigidPlastic, law=V(LAW, OBJECT)),
    "ForceLaw": call(
        ub.ForceLaw,
        force=V(lambda e, rate, state: (e, state), FUNCTION),
        state=V([0.0], [None, 1.0, "ab", [NAN], [1j], ["1"], [[1.0]], [HUGE]]),
        stored=V(None, optional(FUNCTION)),
    ),
    "Controller": call(
        ub.Controller,
        force=V(lambda simulation: 1.0, FUNCTION), sample=V(None, optional(POSITIVE)),
    ),
    "PrescribedMotion": call(ub.PrescribedMotion, motion=V(lambda t: t, [*TIME, None])),
    "PrescribedForce": call(ub.PrescribedForce, force=V(lambda t: t, [*TIME, None])),
    # loads, supports, masses
    "PointLoad": call(ub.PointLoad, place=PLACE, force=V((1, 0), VECTOR), **TIMED),
    "FollowerLoad": call(ub.FollowerLoad, place=PLACE, force=V((1, 0), VECTOR), **TIMED),
    "LineLoad": call(
        ub.LineLoad, beam=V(BEAM, NO_BEAM), force=V((1, 0), VECTOR), **TIMED, **PART
    ),
    "Pressure": call(
        ub.Pressure, beam=V(BEAM, NO_BEAM), normal=V(1.0, NUMBER), tangential=V(1.0, NUMBER),
        amplitude=TIMED["amplitude"], **PART,
    ),
    "MovingLoad": call(
        ub.MovingLoad,
        beam=V(BEAM, [*(x for x in NO_BEAM if not isinstance(x, list)), []]),
        position=V(lambda t: t, [*TIME, None]),
        force=V((1, 0), VECTOR), amplitude=TIMED["amplitude"], mass=V(1.0, FROM_ZERO),
    ),
    "ImposedStrain": call(
        ub.ImposedStrain, beam=V(BEAM, NO_BEAM),
        **{
            name: V((0.0, 1e-4), ["x", *VECTOR[3:], *TIME[3:]])
            for name in ("axial", "curvature", "shear")
        },
        span=V((0.2, 0.6), [*VECTOR, (0.6, 0.2), (0.2, 0.2), (-0.1, 0.5), (0.5, 1.1)]),
        amplitude=V(lambda t: t, [*TIME, None]),
    ),
    "Gravity": call(
        ub.Gravity, acceleration=V((0, -9.81), VECTOR), amplitude=V(lambda t: t, [*TIME, None])
    ),
    "VirtualWork": call(
        ub.VirtualWork, density=V(lambda w, c: c * w[1], [*FUNCTION, lambda x: x]), **OF_WORKS
    ),
    "Potential": call(
        ub.Potential, density=V(lambda q, c: c * q[1], [*FUNCTION, lambda w: w]), **OF_WORKS
    ),
    "Effect": call(
        ub.Effect, statement=V(AirDrag(), [*OBJECT, AirDrag, Loose()]),
        places=V([BEAM.end], [*LIST, [BEAM.end, BEAM.start]]),
        beams=V(None, [[BEAM], *optional(LIST)]),
        numbers=OF_WORKS["numbers"], degree=OF_WORKS["degree"],
    ),
    "RotatingFrame": call(ub.RotatingFrame, rate=V(1.0, NUMBER), about=V((0, 0), VECTOR)),
    "Table": call(
        ub.Table,
        times=V([0, 1], [None, 1.0, "01", [1, 0], [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]),
        values=V([0, 1], [None, 1.0, "01", [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]),
    ),
    "Spline": call(
        ub.Spline,
        points=V([(0, 0), (1, 0)], [None, 1.0, "01", [(0, 0)], [(0, 0), (1, NAN)], [0, 1]]),
        s=V([0, 1], [1.0, "01", [1, 0], [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]),
    ),
    "ramp": call(ub.ramp, duration=V(1.0, POSITIVE)),
    "GroundMotion": call(
        st.GroundMotion,
        dt=V(0.1, POSITIVE),
        values=V([0, 1], [None, 1.0, "01", [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0], [[0, 1]]]),
        name=V("quake", TEXT),
    ),
    "GroundMotion.from_history": call(
        st.GroundMotion.from_history,
        times=V([0, 1], [None, 1.0, "01", [1, 0], [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]),
        values=V([0, 1], [None, 1.0, "01", [0, NAN], [0, "1"], [0, 1j], [0, HUGE], [0]]),
        dt=V(0.1, optional(POSITIVE)),
        name=V("floor", TEXT),
    ),
    "GroundMotion.read": call(
        st.GroundMotion.read,
        path=V("quake.txt", PATH),
        unit=V("g", []),  # wrong units and steps need a file: unit/test_ground_motion.py
        dt=V(0.1, []),
    ),
    "GroundMotion.scaled": call(
        MOTION.scaled,
        factor=V(None, optional(NUMBER)),
        peak=V(2.0, POSITIVE),
    ),
    "GroundMotion.corrected": call(
        MOTION.corrected,
        degree=V(1, [*FROM_ZERO, 1.5, "2"]),
        highpass=V(None, [*optional(POSITIVE), 5.0]),
    ),
    "GroundMotion.resampled": call(MOTION.resampled, dt=V(0.05, POSITIVE)),
    "Clamped": call(ub.Clamped, place=PLACE),
    "Pinned": call(ub.Pinned, place=PLACE),
    "Roller": call(ub.Roller, place=PLACE, along=V((1, 0), [*VECTOR, (0, 0)])),
    "PrescribedDisplacement": call(
        ub.PrescribedDisplacement,
        place=PLACE,
        **{
            name: V(0.0, [*(v for v in OPTIONAL_NUMBER), *(f for f in TIME if callable(f))])
            for name in ("u", "v", "psi")
        },
        along=V((1.0, 0.5), [*VECTOR, (0, 0)]),
    ),
    "PointMass": call(
        ub.PointMass, place=PLACE, mass=V(1.0, FROM_ZERO), inertia=V(0.0, FROM_ZERO)
    ),
    "Velocity": call(
        ub.Velocity,
        beams=V([BEAM], LIST), linear=V((0, 0), VECTOR), angular=V(1.0, NUMBER),
        about=V((0, 0), optional(VECTOR)),
    ),
    "Scene": call(
        ub.Scene,
        beams=V([BEAM], LIST),
        **{
            name: V((), LIST)
            for name in (
                "joints", "supports", "loads", "masses", "initial", "damping", "bodies",
                "connectors", "works",
            )
        },
    ),
    # schemes, discretisation, solver, steps
    "EnergyMomentum": call(
        ub.EnergyMomentum, alpha=V(0.0, [*FROM_ZERO, 0.6]), beta=V(0.0, [*FROM_ZERO, 0.6]),
        order=V(2, [*NUMBER, 1, 3, 2.5]),
    ),
    "EnergyMomentumDecaying": call(ub.EnergyMomentumDecaying, rho_inf=V(0.5, [*NUMBER, 0.1, 1.1])),
    "Newmark": call(ub.Newmark, gamma=V(0.5, [*NUMBER, 0.4]), beta=V(0.25, [*NUMBER, 0.1])),
    "GeneralizedAlpha": call(ub.GeneralizedAlpha, rho_inf=V(0.8, [*NUMBER, -0.1, 1.1])),
    "EnergyMomentumStatic": call(ub.EnergyMomentumStatic, theta=V(1.0, [*NUMBER, 0.4, 1.1])),
    "Camera": call(
        ub.Camera,
        direction=V((0, 0, -1), [*OBJECT, (0, 1, 0), (0, 0, NAN), ("0", "0", "1")]),
        follow=V(BEAM.end, ["x", 1.0, BEAM, ARRAY]), width=V(1.0, optional(POSITIVE)),
    ),
    "Mesh": call(
        ub.Mesh,
        refine=V(1, [*POSITIVE, 1.5]), degree=V(1, [*COUNT, 4]), lumped=V(False, SWITCH),
    ),
    "Newton": call(
        ub.Newton,
        rtol=V(1e-8, POSITIVE), max_iterations=V(10, COUNT),
        petsc=V({}, [None, 1.0, "x", [], {1: None}]), reference=V(False, SWITCH),
    ),
    "Adaptive": call(
        ub.Adaptive,
        tolerance=V(1.0, POSITIVE), first=V(None, optional(POSITIVE)),
        longest=V(None, optional(POSITIVE)), shortest=V(None, optional(POSITIVE)),
        stops=V((), [None, 1.0, "ab", [None], ["1"], [NAN], [1j], [HUGE]]),
    ),
    # runs
    "simulate": call(
        ub.simulate,
        scene=V(SCENE, OBJECT), scheme=V(ub.Static(), [*OBJECT, ub.Static]),
        t=V((0, 1), [*VECTOR, (1, 0)]), dt=V(0.5, POSITIVE), every=V(1, COUNT),
        max_states=V(10, COUNT),
        checkpoint=V(None, optional(OBJECT)), progress=V(False, SWITCH),
        until=V(None, optional(FUNCTION)), **ALONG,
    ),
    "Simulation": call(
        ub.Simulation,
        scene=V(SCENE, OBJECT), scheme=V(ub.Static(), [*OBJECT, ub.Static]), t0=V(0.0, NUMBER),
        start=V(None, optional(OBJECT)), kind=V(ub.Path, OBJECT), **RUN,
    ),
    "follow": call(
        ub.follow,
        scene=V(GROWING, OBJECT), control=V(ub.LoadControl(1.0), [*OBJECT, ub.LoadControl]),
        until=V(None, optional(FUNCTION)), steps=V(1, COUNT), progress=V(False, SWITCH),
        **ALONG,
    ),
    "ArcLength": call(ub.ArcLength, step=V(1.0, [*NUMBER, 0.0]), factor=V(1.0, POSITIVE)),
    "LoadControl": call(ub.LoadControl, step=V(1.0, [*NUMBER, 0.0])),
    "DisplacementControl": call(
        ub.DisplacementControl,
        place=PLACE, component=V("u", [*TEXT, "w", "", "uv"]), step=V(1.0, [*NUMBER, 0.0]),
        end=V(None, optional(NUMBER)),
    ),
    "DissipationControl": call(
        ub.DissipationControl, step=V(1.0, POSITIVE), otherwise=V(ub.ArcLength(1.0), OBJECT)
    ),
    "modes": call(
        ub.modes, scene=V(SCENE, OBJECT), n=V(1, COUNT), at=V(None, optional(OBJECT)), **MESH
    ),
    "buckling": call(
        ub.buckling,
        scene=V(SCENE, OBJECT), n=V(1, COUNT), t=V(1.0, NUMBER), at=V(None, optional(OBJECT)),
        **MESH,
    ),
    "linearize": call(
        ub.linearize,
        scene=V(PUSHED, OBJECT), inputs=V([PUSHED.loads[0]], [*LIST, [None], [1.0], []]),
        outputs=V(
            [("displacement", BEAM.end, "v")],
            [*LIST, [], ["v"], [("displacement", BEAM.end, "x")], [("displacement", 1.0)]],
        ),
        at=V(None, optional(OBJECT)), **MESH,
    ),
    "imperfect": call(
        st.imperfect,
        scene=V(SCENE, OBJECT), sway=V(0.01, NUMBER),
        bow=V({BEAM: 0.01}, [1.0, "ab", {BEAM: NAN}, {BEAM: "x"}, {1: 0.1}]),
        mode=V(None, optional(OBJECT)), k=V(0, [None, "2", -1, 1.5, NAN]),
        amplitude=V(0.1, NUMBER),
    ),
    "study": call(
        ub.study,
        member=V(lambda: {"x": 1.0}, FUNCTION), cases=V([{}], [None, 1.0, "ab", [None], ["x"], []]),
        path=V(None, optional(PATH)), anew=V(False, SWITCH), progress=V(False, SWITCH),
        comm=V(None, optional(OBJECT)),
    ),
    "differentiate": call(
        ub.differentiate,
        model=V(lambda force: GROWING, [*FUNCTION, lambda force: None]),
        at=V({"force": 1.0}, [None, 1.0, "x", {}, {"force": "x"}, {"force": NAN}]),
        scheme=V(ub.Static(), [*OBJECT, ub.Static]), t=V((0, 1), [*VECTOR, (1, 0)]),
        dt=V(0.5, [*POSITIVE, ub.Adaptive(1e-3)]), start=V(None, optional(OBJECT)),
        unused=V((), [None, 1.0, "force", ["x"], [1.0]]),
        newton=V(None, optional(OBJECT)), **MESH, progress=V(False, SWITCH),
    ),
    "gradient": call(
        ub.gradient,
        model=V(lambda force: GROWING, [*FUNCTION, lambda force: None]),
        at=V({"force": 1.0}, [None, 1.0, "x", {}, {"force": "x"}, {"force": NAN}]),
        scheme=V(ub.Static(), [*OBJECT, ub.Static, ub.EnergyMomentumStatic(0.7)]),
        t=V((0, 1), [*VECTOR, (1, 0)]),
        dt=V(0.5, [*POSITIVE, ub.Adaptive(1e-3)]),
        of=V(lambda run: run.displacement(BEAM.end)[:, 0], FUNCTION),
        reduce=V(np.mean, FUNCTION),
        newton=V(None, optional(OBJECT)),
        max_bytes=V(1e6, POSITIVE),
        **MESH,
    ),
    "tradeoff": call(
        ub.tradeoff,
        scene=V(SCENE, OBJECT),
        quantities=V(
            {"u": lambda s: s.displacement(BEAM.end)},
            [None, 1.0, "x", {}, {"u": None}, {"u": 1.0}, {1: lambda s: s}],
        ),
        scheme=V(ub.EnergyMomentum(), [*OBJECT, ub.EnergyMomentum]), t=V((0, 1), [*VECTOR, (1, 0)]),
        dt=V(0.5, [*(v for v in POSITIVE if not isinstance(v, list)), []]),
        tolerance=V(1e-3, optional(POSITIVE)), budget=V(None, [1.0]),
        max_seconds=V(1.0, POSITIVE), progress=V(False, SWITCH),
        **RUN,
    ),
    "tradeoff.budget": call(
        lambda budget: ub.tradeoff(
            SCENE, {"u": lambda s: s.displacement(BEAM.end)}, scheme=ub.EnergyMomentum(),
            t=(0, 1), dt=0.5, budget=budget,
        ),
        budget=V(1.0, optional(POSITIVE)),
    ),
    # files
    "XDMF": call(ub.XDMF, path=V("run.xdmf", [*PATH, "run.h5"]), every=V(1, COUNT)),
    "VTKHDF": call(ub.VTKHDF, path=V("run.hdf", [*PATH, "run.h5"]), every=V(1, COUNT)),
    "Solution.load": call(
        ub.Solution.load, path=V("run.h5", PATH), scene=V(None, optional(OBJECT))
    ),
    "History": call(
        ub.History,
        path=V("run.csv", PATH), places=V((), LIST), connectors=V((), LIST),
        accelerations=V((), LIST), every=V(1, COUNT), max_rows=V(10, COUNT),
    ),
    "Extremes": call(ub.Extremes, points=V(2, [*NUMBER, 1]), accelerations=V(False, SWITCH)),
    "Checkpoint": call(
        ub.Checkpoint,
        path=V("run.h5", PATH), every=V(1, optional(COUNT)), minutes=V(None, optional(FROM_ZERO)),
        also=V((), [None, 1.0, "ab"]),
    ),
    "Events": call(ub.Events, tell=V(None, optional(FUNCTION))),
    # fatigue
    "Fatigue": call(
        st.Fatigue,
        spots=V(st.HotSpot.fibre(BEAM.end, y=0.1, E=1.0), LIST),
        curve=V(st.SNCurve(range=1.0), OBJECT), resolution=V(0.0, FROM_ZERO),
    ),
    "HotSpot": call(st.HotSpot, place=PLACE, stress=V(lambda N, V, M: N, FUNCTION)),
    "HotSpot.fibre": call(
        st.HotSpot.fibre,
        place=PLACE, y=V(0.1, NUMBER), E=V(1.0, POSITIVE), factor=V(1.0, POSITIVE),
    ),
    "SNCurve": call(
        st.SNCurve,
        range=V(1.0, POSITIVE), cycles=V(1e6, POSITIVE), slope=V(3.0, POSITIVE),
        knee=V(INF, [*NO_NUMBER, None, NAN, -1.0, 0.0]), slope_beyond=V(5.0, POSITIVE),
        limit=V(INF, [*NO_NUMBER, None, NAN, -1.0, 0.0]),
        mean=V(lambda range, mean: range, FUNCTION),
    ),
    "SNCurve.eurocode": call(st.SNCurve.eurocode, category=V(71.0, POSITIVE)),
    "Goodman": call(st.Goodman, ultimate=V(1.0, POSITIVE)),
    "Gerber": call(st.Gerber, ultimate=V(1.0, POSITIVE)),
}  # fmt: skip

OF_FIBRES = ub.Section.rectangle(1.0, 1.0, **STEEL, fibres=ub.Fibres(LAW, number=4))
TABLE |= {
    "moment_curvature": call(
        st.moment_curvature,
        section=V(OF_FIBRES, OBJECT),
        curvature=V([0.0, 0.0], [x for x in FIBRES if x != [1.0]]),
        N=V([0.0, 0.0], [x for x in FIBRES if x != 1.0]),
        length=V(None, optional(POSITIVE)), dt=V(1.0, POSITIVE),
    ),
    "interaction_diagram": call(
        st.interaction_diagram,
        section=V(OF_FIBRES, OBJECT),
        limits=V((0.01, 0.02), [None, 1.0, "ab", (0.01,), (0.01, 0.0), {BEAM: (1, 1)}, (1, NAN)]),
        points=V(8, COUNT), steps=V(1, COUNT), length=V(None, optional(POSITIVE)),
    ),
}  # fmt: skip

SERIES = [None, "ab", 1.0, ["1", "2", "3"], [0.0, NAN, 1.0], [0, 1j, 2], [[0.0, 1.0]], [0, HUGE]]
T, X = np.linspace(0, 10, 400), np.exp(-0.05 * np.linspace(0, 10, 400))
X = X * np.cos(6 * T)
OF_PEAKS = {
    "t": V(T, SERIES), "x": V(X, SERIES), "about": V(0.0, NUMBER),
    "prominence": V(0.05, FROM_ZERO),
}  # fmt: skip
TABLE |= {
    "peaks": call(st.peaks, **OF_PEAKS),
    "damping": call(st.damping, **OF_PEAKS),
    "logarithmic_decrement": call(
        st.logarithmic_decrement, amplitudes=V([3.0, 2.0, 1.0], [*SERIES, [1.0], [1.0, -1.0]])
    ),
    "fit_decay": call(
        st.fit_decay,
        t=V([0.0, 1.0, 2.0, 3.0], SERIES),
        amplitudes=V([3.0, 2.2, 1.5, 1.1], SERIES),
    ),
    "damping_ratio": call(st.damping_ratio, decrement=V(0.1, ["x", None, 1j, NAN, HUGE])),
    "rainflow": call(st.rainflow, series=V([0.0, 1.0, 0.0], SERIES)),
    "response_spectrum": call(
        st.response_spectrum,
        motion=V(MOTION, OBJECT),
        periods=V([1.0], [None, "ab", [], ["1"], [NAN], [1j], [[1.0]], [HUGE], [0.0], -1.0]),
        damping=V(0.05, [*FROM_ZERO, 1.0]),
        ductility=V(1.0, [*FROM_ZERO, 0.5]),
        hardening=V(0.0, [*FROM_ZERO, 1.0]),
    ),
}

SPECTRUM = [
    None, 1.0, "ab", (), ([1.0],), ([1.0], [1.0, 2.0]), ([2.0, 1.0], [1.0, 1.0]),
    ([0.0, NAN], [1.0, 1.0]), ([0.0, "x"], [1.0, 1.0]),
]  # fmt: skip
"""In the place of a spectrum; a function is evaluated at the periods of modes, with a mesh."""
HEAVY = ub.Scene([BEAM], supports=[ub.Clamped(BEAM.start)], masses=[ub.PointMass(BEAM.end, 1.0)])
OF_ANALYSES = {
    "scene": V(HEAVY, OBJECT), **MESH, "newton": V(None, optional(OBJECT)),
    "progress": V(False, SWITCH),
}  # fmt: skip
TABLE |= {
    "pushover": call(
        st.pushover,
        place=V(BEAM.end, [*OBJECT, BODY.middle]),
        target=V(0.1, [*NUMBER, 0.0]),
        pattern=V("uniform", [*LIST, [ub.FollowerLoad(BEAM.end, force=(1, 0))]]),
        component=V("u", [None, 1.0, "w", "psi", ARRAY]),
        steps=V(2, COUNT),
        **OF_ANALYSES,
    ),
    "incremental_dynamic_analysis": call(
        st.incremental_dynamic_analysis,
        build=V(lambda motion: HEAVY, [*FUNCTION, lambda motion: None]),
        motions=V([st.GroundMotion(0.1, [1.0, 2.0])], [*LIST, []]),
        intensities=V([1.0, 2.0], [*SERIES, [2.0, 1.0], [0.0, 1.0], [-1.0]]),
        measure=V(lambda run: run.displacement(BEAM.end), FUNCTION),
        limit=V(1.0, POSITIVE),
        intensity=V(
            lambda motion: motion.peak,
            [*FUNCTION[1:], *(lambda motion, x=x: x for x in (None, "x", NAN, 0.0, -1.0))],
        ),
        scheme=V(None, [*OBJECT[1:], ub.Static()]),
        dt=V(None, [x for x in POSITIVE if x is not None]),
        start=V(None, optional(OBJECT)),
        newton=V(None, optional(OBJECT)),
        path=V(None, optional(PATH)),
        anew=V(False, SWITCH),
        progress=V(False, SWITCH),
        comm=V(None, optional(OBJECT)),
        **MESH,
    ),
    "Fragility.fit": call(
        st.Fragility.fit,
        intensities=V([1.0, 2.0], [*SERIES, [0.0, 1.0], [1.0]]),
        exceeded=V([1, 3], [*SERIES, [-1, 3], [5, 3]]),
        number=V([4, 4], [*SERIES, [0, 0], [4]]),
    ),
    "load_combinations": call(
        st.load_combinations,
        cases=V(
            {"Q": [ub.PointLoad(BEAM.end, force=(1, 0))]},
            [*LIST, {}, {1: []}, {"a": [None]}, {"a": [ub.RotatingFrame(rate=1.0)]}],
        ),
        combinations=V(
            {"A": {"Q": 1.5}},
            [*LIST, {}, {"A": {}}, {"A": {"R": 1.0}}, *({"A": {"Q": x}} for x in NUMBER)],
        ),
        steps=V(2, COUNT),
        **OF_ANALYSES,
    ),
    "response_spectrum_analysis": call(
        st.response_spectrum_analysis,
        scene=V(HEAVY, OBJECT),
        spectrum=V(([0.0, 9.0], [1.0, 1.0]), SPECTRUM),
        n=V(2, COUNT),
        direction=V((1, 0), [*VECTOR, (0.0, 0.0)]),
        damping=V(0.05, [*POSITIVE, 1.0]),
        rule=V("CQC", [None, 1.0, "cqc", ARRAY]),
        at=V(None, optional(OBJECT)),
        **MESH,
    ),
}

BENT = st.Measurement(
    [0.5, 1.0], [1.0, 2.0], lambda run: run.displacement(BEAM.end)[:, 0],
    scheme=ub.Static(), t=(0, 1), dt=0.5,
)  # fmt: skip


def stretched(force):
    """The beam under a growing force."""
    load = ub.PointLoad(BEAM.end, force=(force, 0), amplitude=lambda t: t)
    return ub.Scene([BEAM], supports=[ub.Clamped(BEAM.start)], loads=[load])


TABLE |= {
    "Measurement": call(
        st.Measurement,
        times=V([0.5, 1.0], [*optional(SERIES), [1.0, 0.5], [0.5, 2.0], [0.5]]),
        values=V([1.0, 2.0], [*SERIES, [], [1.0]]),
        quantity=V(lambda run: run.times, FUNCTION),
        scheme=V(ub.Static(), OBJECT),
        t=V((0, 1), [*VECTOR, (1, 0), (0, 0.5)]),
        dt=V(0.5, [*POSITIVE, ub.Adaptive(1e-3)]),
        sigma=V(None, [*(x for x in optional(POSITIVE) if x is not ARRAY), [1.0, 0.0], [1.0]]),
        arguments=V({}, optional(LIST)),
        name=V("bent", TEXT),
        labels=V(("t", "x"), [None, 1.0, "ab", "abc", ("a",), ("a", 1)]),
        newton=V(None, optional(OBJECT)),
        **MESH,
    ),
    "calibrate": call(
        st.calibrate,
        model=V(stretched, [*FUNCTION, lambda force: None, lambda: SCENE]),
        parameters=V({"force": 1.0}, [*LIST, {}, {"load": 1.0}, {1: 1.0}, {"force": (1.0, 2.0)},
                     {"force": (3.0, 1.0, 2.0)}, *({"force": x} for x in [*NUMBER, 0.0])]),
        measured=V([BENT], [*LIST, []]),
        starts=V(1, [*COUNT, 2]),
        seed=V(0, SEED),
        progress=V(False, SWITCH),
        comm=V(None, optional(OBJECT)),
    ),
}  # fmt: skip

PUSH = ub.simulate(PUSHED, ub.Static(), t=(0, 1), dt=1.0, progress=False)
TABLE |= {
    "storeys": call(
        st.storeys,
        solution=V(PUSH, OBJECT),
        levels=V([BEAM.start, ub.ground(0, 1)], [*LIST, [BEAM.start]]),
    ),
    "hinge_table": call(
        st.hinge_table,
        solution=V(PUSH, OBJECT),
        limits=V({"IO": 0.1}, [*LIST, {1: 0.1}, {"IO": 0.2, "LS": 0.1}, {"IO": 0.0}]),
        n=V(-1, [None, "a", 0.5, [0], 10**6, -(10**6)]),
        only=V([BEAM], [*optional(LIST), [OTHER]]),
    ),
}

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

OF_SOLUTIONS = {
    "animate", "picture", "plot", "render",
}  # fmt: skip
"""Pictures, whose tests are in pictures/."""


def test_every_public_callable_is_in_the_table():
    errors = {n for n, o in PUBLIC.items() if inspect.isclass(o) and issubclass(o, BaseException)}
    known = {name.split(".")[0] for name in TABLE}
    missing = set(PUBLIC) - errors - known - RECORDS_OF_RUNS - WITHOUT_PARAMETERS - OF_SOLUTIONS
    assert missing == set()


@pytest.mark.parametrize("name", TABLE)
def test_every_parameter_is_in_the_table(name):
    of, parameters = TABLE[name]
    names = {
        p.name for p in inspect.signature(of).parameters.values() if p.kind is not p.VAR_KEYWORD
    }
    assert names - set(parameters) == set()


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
    _, parameters = TABLE[name]
    good = {parameter: value for parameter, (value, _) in parameters.items()}
    for parameter, (_, kind) in parameters.items():
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
    of, _ = TABLE[name]
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


def turned(a, law):
    return {"connectors": [ub.Turn(a, BEAM.end, law)]}


OWNERS = {
    "PointLoad at girder.end": lambda f: {
        "loads": [ub.PointLoad(BEAM.end, force=(1, 0), amplitude=f)]
    },
    "FollowerLoad at girder.end": lambda f: {
        "loads": [ub.FollowerLoad(BEAM.end, force=(1, 0), amplitude=f)]
    },
    "LineLoad on girder": lambda f: {"loads": [ub.LineLoad(BEAM, force=(1, 0), amplitude=f)]},
    "ImposedStrain of girder": lambda f: {"loads": [ub.ImposedStrain(BEAM, 1e-4, amplitude=f)]},
    "MovingLoad on girder": lambda f: {
        "loads": [ub.MovingLoad(BEAM, f, force=(1, 0)), ub.MovingLoad(BEAM, lambda t: t, (1, 0), f)]
    },
    "Pressure on girder": lambda f: {"loads": [ub.Pressure(BEAM, 1.0, amplitude=f)]},
    "Gravity": lambda f: {"loads": [ub.Gravity(amplitude=f)]},
    "PrescribedDisplacement at girder.start": lambda f: {
        "supports": [ub.PrescribedDisplacement(BEAM.start, u=0, v=f, psi=0)]
    },
    "Turn(ground (1, 0), girder.end (1, 0))": lambda f: turned(
        ub.ground(1, 0), ub.PrescribedMotion(f)
    ),
    "Slide(ground (1, 0), girder.end (1, 0))": lambda f: {
        "connectors": [ub.Slide(ub.ground(1, 0), BEAM.end, ub.PrescribedForce(f), axis=(1, 0))]
    },
    "Turn(ground (0, 0), girder.end (1, 0))": lambda f: turned(
        ub.ground(0, 0), ub.Controller(lambda simulation: f(simulation.t))
    ),
    "Turn(ground (2, 0), girder.end (1, 0))": lambda f: turned(
        ub.ground(2, 0), ub.ForceLaw(lambda e, rate: f(1.0))
    ),
}
"""Parts of a scene with a function of time, by the name of the part that a message has."""


@pytest.mark.parametrize("owner", OWNERS)
@pytest.mark.parametrize("value", [None, "1.0", 1j, np.zeros(2), np.zeros(1), HUGE])
def test_a_function_that_returns_no_number_during_a_run_is_refused(owner, value):
    """The function returns numbers until 0.2 s."""
    parts = {"supports": [ub.Clamped(BEAM.start)]}
    parts |= OWNERS[owner](lambda t: 1e-3 * t if t < 0.25 else value)
    scene = ub.Scene([BEAM], **parts)
    with pytest.raises(ub.ArgumentError) as failure:
        ub.simulate(
            scene, ub.EnergyMomentum(), t=(0, 1), dt=0.1, progress=False, comm=MPI.COMM_SELF
        )
    assert owner in str(failure.value)
    assert "must return a number" in str(failure.value)


def test_numbers_of_numpy_are_numbers():
    """Scalars, and arrays without dimension, are as good as floats."""
    one = ub.Beam((np.int64(0), np.array(0.0)), (np.float32(1), 0), SECTION, cells=np.int64(2))
    push = ub.PointLoad(one.end, force=np.array([1.0, 0.0]), amplitude=lambda t: np.array(t))
    scene = ub.Scene([one], supports=[ub.Clamped(one.start)], loads=[push])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=np.float64(1), comm=MPI.COMM_SELF)
    # F L / EA, the beam being straight
    assert solution.displacement(one.end)[-1, 0] == pytest.approx(1e-4, rel=1e-9)


# -- messages -------------------------------------------------------------------------------------


def test_messages_show_the_beginning_of_long_values():
    records = [ub.Clamped(BEAM.start) for _ in range(40)]
    with pytest.raises(ub.ArgumentError, match="joints") as failure:
        ub.Scene([BEAM], joints=BEAM)
    assert len(str(failure.value)) < 150
    with pytest.raises(ub.ArgumentError, match="is not a Joint") as failure:
        ub.Scene([BEAM], joints=records)
    assert len(str(failure.value)) < 150


def test_an_entry_that_the_ledger_lacks_is_refused():
    solution = ub.simulate(SCENE, ub.Static(), t=(0, 1), dt=1, comm=MPI.COMM_SELF)
    for ask in (lambda e: e.lost["hinges"], lambda e: e["hinges"]):
        with pytest.raises(KeyError, match=r"no entry 'hinges'.*no object of the scene.*'stored'"):
            ask(solution.energy)
    assert solution.energy.lost.get("hinges") is None
    assert "hinges" not in solution.energy.lost
