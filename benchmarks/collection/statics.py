# SPDX-License-Identifier: MIT
"""Models of statics: limit loads, softening, cycles and snap-through."""

import math

import numpy as np
from limit_analysis import limit_factor
from models import Case, model
from scipy.optimize import brentq

import ufl_beam as ub
import ufl_beam.structures as st

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
"""Pa, -, kg/m³."""

PLASTIC = 100e3
"""Plastic moment of hinges; N m."""

SECTION = ub.Section(EA=4e9, GA=1.5e9, EI=4e7, rhoA=60.0, rhoI=0.5)

BARS = ub.Fibres(st.MenegottoPinto(450e6, 0.01, 15.0))
"""Steel02 of OpenSees issue 1625."""


def cycles(*sizes):
    """Function of time that goes to each size and back, one second each way; and its end (s)."""
    turns = [0.0]
    for size in sizes:
        turns += [size, -size]
    return ub.Table(range(len(turns)), turns), float(len(turns) - 1)


def deteriorating_hinge(*sizes):
    """The hinge of OpenSees 688 at the foot of a cantilever ten times as stiff, in cycles."""
    backbone = st.Backbone(
        923.6e3,
        capping=0.0173,
        post_capping=0.0401,
        overstrength=1.075,
        residual=0.02,
        ultimate=0.095,
    )
    law = st.IbarraKrawinkler(80e6, backbone, strength=0.3, softening=1.0, unloading=1.0)
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e10, GA=1e10, EI=3e8), cells=2)
    turn = ub.Turn(ub.ground(0, 0), beam.start, law)
    drive, end = cycles(*sizes)
    move = ub.PrescribedDisplacement(beam.end, v=drive)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), move], connectors=[turn])
    return Case(scene, ("force", turn), 50 * round(end), end)


@model(
    "hinge at the kink to residual strength, in cycles",
    "statics",
    "OpenSees 688, with its numbers in kN m and mrad",
    "moment of the hinge, N m",
)
def residual_strength():
    """The kink is at 69 mrad, and the cycles reach 80 mrad."""
    return deteriorating_hinge(0.01, 0.02, 0.03, 0.05, 0.07, 0.08)


@model(
    "the same hinge beyond its ultimate rotation",
    "statics",
    "OpenSees 688; no moment is left in the last cycle",
    "moment of the hinge, N m",
)
def ultimate_rotation():
    """Cycles up to 110 mrad; the ultimate rotation is 95 mrad."""
    return deteriorating_hinge(0.02, 0.05, 0.08, 0.11, 0.11)


def frame(storeys, bays, section, ends=None, *, height=3.5, bay=6.0, cells=(2, 2)):
    """Clamped frame: columns and girders by axis or bay and storey, and the fields of its scene.

    ``ends``: law of hinges at the ends of all members; ``cells``: of a column, of a girder.
    """
    hinges = {} if ends is None else {0.0: ends, 1.0: ends}

    def member(a, b, count, name):
        return ub.Beam(a, b, section, cells=count, hinges=hinges, name=name)

    columns = {
        (i, k): member(
            (bay * i, height * k), (bay * i, height * (k + 1)), cells[0], f"column {i}-{k}"
        )
        for i in range(bays + 1)
        for k in range(storeys)
    }
    girders = {
        (i, k): member(
            columns[i, k].ends[1], columns[i + 1, k].ends[1], cells[1], f"girder {i}-{k}"
        )
        for i in range(bays)
        for k in range(storeys)
    }
    joints = []
    for i, k in columns:
        places = [columns[i, k].end]
        places += [columns[i, k + 1].start] if (i, k + 1) in columns else []
        places += [girders[i, k].start] if (i, k) in girders else []
        places += [girders[i - 1, k].end] if (i - 1, k) in girders else []
        joints.append(ub.Rigid(*places))
    feet = [ub.Clamped(columns[i, 0].start) for i in range(bays + 1)]
    beams = [*columns.values(), *girders.values()]
    return columns, girders, {"beams": beams, "joints": joints, "supports": feet}


def swayed(tip, force):
    """Sway force that grows in time."""
    return ub.PointLoad(tip, force=(force, 0), amplitude=lambda t: t)


def displaced(solution, places):
    """Last positions (m) of places."""
    return [solution.position(place)[-1, :2] for place in places]


def portal_limit(solution):
    """Load factor of the displaced portal by linear programming."""
    loads = np.zeros((5, 3))
    loads[1, 0], loads[2, 1] = 100e3, -150e3
    held = [(n, k) for n in (0, 4) for k in range(3)]
    left, girder, right = solution.scene.beams
    places = left.start, left.end, girder.at(0.5), right.end, right.start
    nodes = displaced(solution, places)
    return limit_factor(nodes, [(0, 1), (1, 2), (2, 3), (3, 4)], held, loads, [PLASTIC] * 4)


@model(
    "perfectly plastic portal, load control until a mechanism",
    "statics",
    "OpenSees 1533: hinges of zero length; the tangent becomes singular",
    "sway, m",
    stops=(
        "a mechanism has formed",
        "Hinge(girder.at(0.5) (3, 4)), Hinge(girder.end (6, 4)), Hinge(left.start (0, 0)) and "
        "Hinge(right.start (6, 0)) give way together",  # the hinges that turn in the linear program
    ),
    limit=portal_limit,
    tolerance=1e-3,  # the static theorem on the displaced geometry leaves the shear of the cells
)
def portal_mechanism():
    """6 m by 4 m, hinges at the ends and in the middle of members; both loads grow together."""
    hinge = ub.ElastoPlastic(PLASTIC)
    left = ub.Beam((0, 0), (0, 4), SECTION, cells=4, hinges={0.0: hinge}, name="left")
    right = ub.Beam((6, 0), (6, 4), SECTION, cells=4, hinges={0.0: hinge}, name="right")
    hinges = dict.fromkeys((0.0, 0.5, 1.0), hinge)
    girder = ub.Beam((0, 4), (6, 4), SECTION, cells=8, hinges=hinges, name="girder")
    scene = ub.Scene(
        [left, girder, right],
        joints=[ub.Rigid(left.end, girder.start), ub.Rigid(girder.end, right.end)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        loads=[
            swayed(left.end, 100e3),
            ub.PointLoad(girder.at(0.5), force=(0, -150e3), amplitude=lambda t: t),
        ],
    )
    return Case(scene, ("displacement", left.end, 0), 40, 2.0)


def fibre_limit(solution):
    """Largest load factor of the column by integration of its deflection, small rotations.

    From the top downwards EI w'' = -M with M = 50 kN λ s + N w, and a curvature of M from layers;
    for each slope at the top λ follows from the clamped foot, and the largest λ is the limit.
    """
    N, y = 200e3, (np.arange(400) + 0.5) / 4000 - 0.05
    curvatures, moments = np.linspace(0.0, 0.5, 400), []
    for curvature in curvatures:

        def stress(strain, curvature=curvature):
            return np.clip(210e9 * (strain - curvature * y), -355e6, 355e6)

        def missing(strain, stress=stress):
            return stress(strain).sum() * 0.01 / 400 + N

        moments.append(-(stress(brentq(missing, -0.03, 0.03)) * y).sum() * 0.01 / 400)
    s = np.linspace(0.0, 3.0, 1201)
    h = s[1]

    def slope_at_foot(factor, slope):
        w = 0.0
        for x in s[:-1]:  # leap-frog: slopes in the middles of intervals, second order
            moment = 50e3 * factor * x + N * w
            slope -= h * np.interp(moment, moments, curvatures) * (0.5 if x == 0.0 else 1.0)
            w += h * slope
        return slope - h / 2 * np.interp(50e3 * factor * 3.0 + N * w, moments, curvatures)

    slopes = np.linspace(0.02, 0.08, 13)
    return max(brentq(slope_at_foot, 0.0, 1.0, args=(slope,), xtol=1e-5) for slope in slopes)


@model(
    "column of perfectly plastic fibres, load control until P-Delta collapse",
    "statics",
    "perfectly plastic fibres have no tangent stiffness",
    "sway, m",
    stops=("a limit load", "beam at (0, 0.0375)"),  # the cell at the foot
    limit=fibre_limit,
    tolerance=1 / 80,  # the lowest cell has the moment of its middle, at 1/80 of the height
)
def fibre_column():
    """A cantilever of 3 m, 0.1 m square, under 200 kN; 40 fibres in each of 40 cells."""
    section = ub.Section.rectangle(
        b=0.1, h=0.1, fibres=ub.Fibres(ub.ElastoPlastic(355e6), number=40), **STEEL
    )
    column = ub.Beam((0, 0), (0, 3), section, cells=40)
    loads = [ub.PointLoad(column.end, force=(0, -200e3)), swayed(column.end, 50e3)]
    scene = ub.Scene([column], supports=[ub.Clamped(column.start)], loads=loads)
    return Case(scene, ("displacement", column.end, 0), 80)


def two_storeys_limit(solution):
    """Load factor of the displaced frame of two storeys by linear programming."""
    columns = solution.scene.beams[:6]  # of the first axis, of the second, of the third
    places = [column.start for column in columns[::2]]
    places += [column.end for column in (*columns[::2], *columns[1::2])]
    nodes = displaced(solution, places)
    members = [(n, n + 3) for n in range(6)] + [(3, 4), (4, 5), (6, 7), (7, 8)]
    loads = np.zeros((9, 3))
    loads[3, 0], loads[6, 0] = 50e3, 100e3
    weight = np.zeros((9, 3))
    weight[3:, 1] = -200e3
    held = [(n, k) for n in range(3) for k in range(3)]
    return limit_factor(nodes, members, held, loads, [PLASTIC] * 10, weight)


@model(
    "two storeys with 20 perfectly plastic hinges, load control until a mechanism",
    "statics",
    "OpenSees 1533: hinges of zero length",
    "sway, m",
    stops=(
        "a limit load",
        # five of the six hinges that turn in the linear program; the last one has not yielded yet
        *(f"Hinge(column {end}" for end in ("0-0.st", "1-0.st", "2-0.st", "1-0.end", "2-0.end")),
    ),
    limit=two_storeys_limit,
    tolerance=0.02,  # the sway stiffness of the last elastic members is below that of the weight
)
def two_storeys_mechanism():
    """200 kN on each node; the sway forces of both floors grow together."""
    columns, _, parts = frame(2, 2, SECTION, ub.ElastoPlastic(PLASTIC))
    loads = [ub.PointLoad(column.end, force=(0, -200e3)) for column in columns.values()]
    loads += [swayed(columns[0, 0].end, 50e3), swayed(columns[0, 1].end, 100e3)]
    return Case(ub.Scene(**parts, loads=loads), ("displacement", columns[0, 1].end, 0), 60, 3.0)


@model(
    "two storeys with 20 softening hinges, pushed beyond the largest load",
    "statics",
    "softening hinges open in turn; several share one step",
    "base shear, N",
)
def two_storeys_softening():
    """The top is pushed by 0.4 m; each hinge loses its moment at a fracture energy of 20 kJ."""
    columns, _, parts = frame(2, 2, SECTION, ub.Softening(PLASTIC, 20e3))
    push = ub.PrescribedDisplacement(columns[0, 1].end, u=lambda t: 0.4 * t)
    parts["supports"].append(push)
    return Case(ub.Scene(**parts), ("reaction", push, 0), 200)


def weighed_then_pushed(column, weight, sway, steps, end):
    """Column whose top bears its weight (N) at 1 s and is then pushed."""
    load = ub.PointLoad(column.end, force=(0, -weight), amplitude=ub.ramp(1.0))
    push = ub.PrescribedDisplacement(column.end, u=sway)
    scene = ub.Scene([column], supports=[ub.Clamped(column.start), push], loads=[load])
    return Case(scene, ("reaction", push, 0), steps, end)


def reinforced(b, h, law, y, A, number=20, E=25e9, **core):
    """Rectangle of layers of concrete with bars at ``y`` (m)."""
    concrete = {"fibres": ub.Fibres(law, number=number), **core}
    plain = ub.Section.rectangle(b=b, h=h, E=E, nu=0.2, rho=2500.0, **concrete)
    return plain.reinforced(y=y, A=A, E=200e9, fibres=BARS)


def leaning_limit(solution):
    """Load factor of a rigid-plastic column on an elastic shaft at first yield of its foot.

    Horizontal force λ H and weight N: the moment at the foot is H λ tan(kL)/k, with k² = N/EI.
    """
    k = math.sqrt(1e6 / SECTION.EI)
    return PLASTIC / (50e3 * math.tan(k * 5.0) / k)


@model(
    "column under weight and sway, load control until P-Delta collapse",
    "statics",
    "weight makes the stiffness negative at the first hinge",
    "sway, m",
    stops=("a mechanism has formed", "Hinge(beam.start (0, 0)) gives way"),
    limit=leaning_limit,
    tolerance=2e-3,  # the shaft also shears and shortens: N/GA + N/EA = 0.9e-3
)
def leaning_column():
    """A cantilever of 5 m under 1 MN with one hinge of constant moment at its foot."""
    column = ub.Beam((0, 0), (0, 5), SECTION, cells=16, hinges={0.0: ub.ElastoPlastic(PLASTIC)})
    loads = [ub.PointLoad(column.end, force=(0, -1e6)), swayed(column.end, 50e3)]
    scene = ub.Scene([column], supports=[ub.Clamped(column.start)], loads=loads)
    return Case(scene, ("displacement", column.end, 0), 40)


@model(
    "the same column, pushed beyond the collapse",
    "statics",
    "the sway force becomes negative",
    "sway force, N",
)
def leaning_column_pushed():
    """The top is pushed by 1 m after the weight."""
    column = ub.Beam((0, 0), (0, 5), SECTION, cells=16, hinges={0.0: ub.ElastoPlastic(PLASTIC)})
    return weighed_then_pushed(column, 1e6, ub.Table([0, 1, 2], [0, 0, 1.0]), 100, 2.0)


def concrete_half(ultimate):
    """Half of a simply supported beam of 6 m with 1.2 % and 0.6 % of steel; Kent-Park."""
    law = st.KentPark(25e6, 5e6, ultimate)
    section = reinforced(0.3, 0.5, law, [-0.21, 0.21], [3.6e-3, 0.6e-3], number=30)
    return ub.Beam((0, 0), (3, 0), section, cells=10)


@model(
    "reinforced concrete beam beyond its peak",
    "statics",
    "OpenSees 1445; the concrete crushes",
    "load, N",
)
def concrete_beam():
    """Confined concrete, 5 MPa from 2 %; pushed by 0.12 m in the middle."""
    half = concrete_half(0.02)
    middle = ub.PrescribedDisplacement(half.end, v=lambda t: -0.12 * t, psi=0.0)
    scene = ub.Scene([half], supports=[ub.Pinned(half.start), middle])
    return Case(scene, ("reaction", middle, 1), 240)


@model(
    "brittle reinforced concrete beam, snap-back of the deflection",
    "path",
    "OpenSees 1445; one cell crushes while the others unload",
    "load factor",
)
def brittle_concrete_beam():
    """5 MPa from 0.35 % in cells of 0.3 m; no displacement control passes the crushing."""
    half = concrete_half(0.0035)
    turn = ub.PrescribedDisplacement(half.end, psi=0.0)
    load = ub.PointLoad(half.end, force=(0, -1e5), amplitude=lambda t: t)
    scene = ub.Scene([half], supports=[ub.Pinned(half.start), turn], loads=[load])
    return Case(
        scene,
        ("factor",),
        2000,
        control=lambda divisor: ub.ArcLength(0.002 / divisor, factor=100.0),
        until=lambda now: now.displacement(half.end)[1] < -0.12,
        compared=lambda factor: [factor.max(), factor[-1]],
        arc=0.002,
        ends=("displacement", half.end, 1, -0.12),
    )


@model(
    "two storeys of reinforced concrete, pushed after the vertical loads",
    "statics",
    "OpenSees 1625, with its materials and section, in the plane",
    "base shear, N",
)
def concrete_frame():
    """Columns of 0.6 m by 0.4 m under 6 kN/m on girders, then pushed by 0.12 m; 8 bars of 12 mm."""
    bar, law = 0.000113097, st.KentPark(25e6, 5e6, 0.0035)
    section = reinforced(0.4, 0.6, law, [-0.255, -0.085, 0.085, 0.255], [2 * bar] * 4)
    columns, girders, parts = frame(2, 1, section, height=3.0, bay=5.0, cells=(6, 8))
    push = ub.PrescribedDisplacement(columns[0, 1].end, u=ub.Table([0, 1, 3], [0, 0, 0.12]))
    parts["supports"].append(push)
    hold = ub.ramp(1.0)
    loads = [ub.LineLoad(girder, force=(0, -6e3), amplitude=hold) for girder in girders.values()]
    return Case(ub.Scene(**parts, loads=loads), ("reaction", push, 0), 150, 3.0)


@model(
    "concrete without tension under gravity, then bent",
    "statics",
    "OpenSees 1669: Concrete07 fails in the first step of gravity",
    "sway force, N",
)
def no_tension():
    """Mander's concrete, which is the backbone of Concrete07, with steel; cracked by the sway."""
    law = st.Mander(30e6, 0.002)
    section = reinforced(0.4, 0.4, law, [-0.16, 0.16], [1e-3, 1e-3], number=30, E=27e9)
    column = ub.Beam((0, 0), (0, 3), section, cells=8)
    return weighed_then_pushed(column, 0.8e6, ub.Table([0, 1, 2], [0, 0, 0.06]), 120, 2.0)


@model(
    "column of reinforced concrete, cycles until the concrete crushes",
    "statics",
    "cover and core soften in compression while bars reverse",
    "sway force, N",
)
def concrete_cycles():
    """0.4 m square, 3 m high, 30 % of its strength in compression, drifts up to 3 %."""
    hoops = {"ratio": 0.012, "yield_limit": 400e6, "width": 0.32, "spacing": 0.1}
    cover, core = st.KentPark.confined(30e6), st.KentPark.confined(30e6, **hoops)
    y, A = [-0.15, 0.0, 0.15], [1e-3, 0.6e-3, 1e-3]
    section = reinforced(0.4, 0.4, cover, y, A, E=30e9, core=ub.Fibres(core), cover=0.04)
    column = ub.Beam((0, 0), (0, 3), section, cells=8)
    drive, end = cycles(0.015, 0.03, 0.045, 0.06, 0.09)
    sway = ub.Table([0.0, *(t + 1.0 for t in drive.times)], [0.0, *drive.values])
    return weighed_then_pushed(column, 1.4e6, sway, 50 * round(end + 1), end + 1)


@model(
    "brace that buckles and yields in cycles",
    "statics",
    "buckling, plastic hinge in the middle and straightening in each cycle",
    "axial force, N",
)
def brace():
    """A tube of 4 m, slenderness 85, bow of L/500; fibres of Menegotto and Pinto."""
    steel = ub.Fibres(st.MenegottoPinto(355e6, 0.01, 20.0), number=20)
    section = ub.Section.tube(d=0.14, t=0.006, fibres=steel, **STEEL)
    points = np.linspace(0, 1, 13)
    bow = [(4 * s, 0.008 * math.sin(math.pi * s)) for s in points]
    brace = ub.Beam.polyline(bow, section, cells=12)
    drive, end = cycles(0.004, 0.008, 0.016, 0.032)
    move = ub.PrescribedDisplacement(brace.end, u=drive, v=0.0)
    scene = ub.Scene([brace], supports=[ub.Pinned(brace.start), move])
    return Case(scene, ("reaction", move, 0), 100 * round(end), end)


@model(
    "snap-through of a shallow truss onto a stop",
    "path",
    "the load falls, and the contact stiffness grows a thousandfold",
    "load factor",
)
def snap_through():
    """Two bars of slope 0.1; the stop is 0.15 m below the top, within the falling branch."""
    bars = ub.Section(EA=1e7, GA=4e6, EI=10.0)
    left = ub.Beam((-1, 0), (0, 0.1), bars, cells=2)
    right = ub.Beam((0, 0.1), (1, 0), bars, cells=2)
    stop = ub.Slide(ub.ground(0, 0.1), left.end, ub.Stop(1e8, low=-0.15), axis=(0, 1))
    load = ub.PointLoad(left.end, force=(0, -1e3), amplitude=lambda t: t)
    scene = ub.Scene(
        [left, right],
        joints=[ub.Revolute(left.end, right.start)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.end)],
        connectors=[stop],
        loads=[load],
    )
    return Case(
        scene,
        ("factor",),
        150,
        control=lambda divisor: ub.DisplacementControl(left.end, "v", -0.0015 / divisor),
        until=lambda now: now.displacement(left.end)[1] < -0.1505,
        compared=lambda factor: [factor[: factor.argmin()].max(), factor.min()],
        ends=("displacement", left.end, 1, -0.1505),
    )


@model(
    "snap-back of a cracking beam",
    "path",
    "the fracture energy is a tenth of the stored energy",
    "deflection at the end, m",
)
def snap_back():
    """A cantilever with a brittle hinge, by dissipation control to 95 % of the fracture energy."""
    energy = 0.1 * PLASTIC**2 * 5.0 / SECTION.EI
    hinge = ub.Softening(PLASTIC, energy)
    beam = ub.Beam((0, 0), (5, 0), SECTION, cells=10, hinges={0.0: hinge})
    load = ub.PointLoad(beam.end, force=(0, -1e5), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    return Case(
        scene,
        ("displacement", beam.end, 1),
        400,
        control=lambda divisor: ub.DissipationControl(energy / (40 * divisor), ub.ArcLength(0.02)),
        until=lambda now: now.damage()[1].sum() >= 0.95 * energy * (1 - 1e-9),
        compared=lambda deflection: [deflection.min()],
        arc=0.001,
        ends=("factor", 0.05 * PLASTIC / 5e5),
    )


@model(
    "two gaps that close in the same step",
    "statics",
    "symmetric contact: both or none",
    "force in the left stop, N",
)
def two_gaps():
    """A beam on rollers between two equal stops is pressed onto both by a force in its middle."""
    beam = ub.Beam((0, 0), (4, 0), SECTION, cells=8)
    stops = [
        ub.Slide(ub.ground(x, 0), beam.at(x / 4), ub.Stop(1e8, low=-0.01), axis=(0, 1))
        for x in (0.0, 4.0)
    ]
    soft = [
        ub.Slide(ub.ground(x, 0), beam.at(x / 4), ub.Spring(1e5), axis=(0, 1)) for x in (0.0, 4.0)
    ]
    load = ub.PointLoad(beam.at(0.5), force=(0, -5e5), amplitude=lambda t: t)
    hold = ub.PrescribedDisplacement(beam.at(0.5), u=0.0)
    scene = ub.Scene([beam], supports=[hold], connectors=[*stops, *soft], loads=[load])
    return Case(scene, ("force", stops[0]), 10)


@model(
    "mast on two cables that become slack in turn",
    "statics",
    "a slack cable has no stiffness; with both slack the mast is a mechanism",
    "sway force, N",
)
def slack_cables():
    """A pinned mast of 10 m with cables that only pull, driven to both sides; no prestress."""
    mast = ub.Beam((0, 0), (0, 10), SECTION, cells=4)
    cables = [ub.Stretch(ub.ground(x, 0), mast.end, ub.Stop(2e6, high=0.001)) for x in (-6.0, 6.0)]
    drive, end = cycles(0.02, 0.05, 0.1)
    push = ub.PrescribedDisplacement(mast.end, u=drive)
    weight = ub.PointLoad(mast.end, force=(0, -1e4))
    scene = ub.Scene(
        [mast], supports=[ub.Pinned(mast.start), push], connectors=cables, loads=[weight]
    )
    return Case(scene, ("reaction", push, 0), 20 * round(end), end)
