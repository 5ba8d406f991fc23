# SPDX-License-Identifier: MIT
"""Models of dynamics: earthquakes, contact, collapse."""

from functools import cache

import numpy as np
from models import Case, model
from statics import PLASTIC, SECTION, STEEL, frame

import ufl_beam as ub
import ufl_beam.structures as st


@cache
def earthquake(peak, seconds=10.0, seed=3):
    """Filtered noise with a rise and a decay, corrected; a `GroundMotion`; m/s²."""
    random, t = np.random.default_rng(seed), np.arange(0.0, seconds, 0.01)
    noise = np.convolve(random.standard_normal(t.size), np.hanning(31), mode="same")
    shape = np.minimum(t / 2, 1) * np.exp(-np.maximum(t - 5, 0) / 2)
    return st.GroundMotion(0.01, noise * shape).scaled(peak=peak).corrected()


def shaken(beams, peak, watched, *, seconds=10.0, dt=0.01, **parts):
    """Frame that bears its weight and is then shaken by a record with a peak in m/s²."""
    weight = ub.Gravity()
    quake = ub.Gravity(acceleration=(-1.0, 0.0), amplitude=earthquake(peak).acceleration)
    damping = [ub.Rayleigh(stiffness=2e-3)]
    scene = ub.Scene(beams, loads=[weight, quake], damping=damping, **parts)
    at_rest = ub.Scene(beams, loads=[weight], **parts)
    return Case(scene, watched, round(seconds / dt), seconds, at_rest, dynamic=True)


def shaken_frame(storeys, bays, peak, section, ends=None, *, mass=20e3, inertia=0.0, **more):
    """Frame with a mass (kg) at each node under a record; the sway of its top is compared."""
    girder_cells = more.pop("cells", 2)
    columns, _, parts = frame(storeys, bays, section, ends, cells=(girder_cells, girder_cells))
    masses = [ub.PointMass(column.end, mass, inertia) for column in columns.values()]
    top = columns[0, storeys - 1].end
    return shaken(peak=peak, watched=("displacement", top, 0), masses=masses, **parts, **more)


@model(
    "ten storeys of fibres under a record",
    "dynamics",
    "OpenSees 1666: ten storeys of fibre elements",
    "sway of the top, m",
)
def ten_storeys():
    """Three bays of HEB 400; 20 fibres of Menegotto and Pinto in 280 cells; peak 6 m/s²."""
    steel = ub.Fibres(st.MenegottoPinto(355e6, 0.01, 20.0), number=20)
    section = st.steel("HEB 400", fibres=steel)
    return shaken_frame(10, 3, 6.0, section, cells=4)


@model(
    "four storeys with hinges of zero length under a record",
    "dynamics",
    "OpenSees 1533: the first step with hinges of zero length fails",
    "sway of the top, m",
)
def four_storeys():
    """56 hinges that soften with a fracture energy of 100 kJ each; peak 5 m/s²."""
    return shaken_frame(4, 2, 5.0, SECTION, ub.Softening(2 * PLASTIC, 100e3))


def falling(inertia):
    """Two storeys whose hinges soften to zero, with 60 t at the nodes, and their fall."""
    hinge = ub.Softening(PLASTIC, 10e3)
    return shaken_frame(2, 2, 6.0, SECTION, hinge, mass=60e3, inertia=inertia, seconds=6.0)


@model(
    "two storeys that collapse by P-Delta under a record",
    "dynamics",
    "the frame loses its stiffness and falls",
    "sway of the top, m",
)
def collapse():
    """The nodes have a rotary inertia of 1 t m²."""
    return falling(1e3)


@model(
    "the same, nodes between softening hinges without rotary inertia",
    "dynamics",
    "no inertia resists a node whose hinges all soften; the jump takes no time",
    "sway of the top, m",
)
def collapse_without_inertia():
    """Each node has three or four hinges at its joint, and no inertia against rotation."""
    return falling(0.0)


@model(
    "hinges that deteriorate until no moment is left, under a record",
    "dynamics",
    "OpenSees 688 in dynamics: kinks of cap, residual strength and ultimate rotation",
    "sway of the top, m",
)
def deteriorating():
    """A portal with four springs of Ibarra, Medina and Krawinkler and columns on pins."""
    left = ub.Beam((0, 0), (0, 4), SECTION, cells=3, name="left")
    right = ub.Beam((6, 0), (6, 4), SECTION, cells=3, name="right")
    girder = ub.Beam((0, 4), (6, 4), SECTION, cells=4, name="girder")
    backbone = st.Backbone(
        PLASTIC, capping=0.02, post_capping=0.05, overstrength=1.075, residual=0.02, ultimate=0.12
    )
    law = st.IbarraKrawinkler(6e8, backbone, strength=0.3, softening=0.5, unloading=0.5)
    pairs = [(ub.ground(0, 0), left.start), (ub.ground(6, 0), right.start)]
    pairs += [(left.end, girder.start), (right.end, girder.end)]
    return shaken(
        [left, right, girder],
        5.0,
        ("displacement", left.end, 0),
        joints=[ub.Revolute(left.end, girder.start), ub.Revolute(right.end, girder.end)],
        supports=[ub.Pinned(left.start), ub.Pinned(right.start)],
        connectors=[ub.Turn(*pair, law) for pair in pairs],
        masses=[ub.PointMass(left.end, 20e3), ub.PointMass(right.end, 20e3)],
    )


@model(
    "footing that rocks and uplifts under a record",
    "dynamics",
    "twenty contacts open and close, several in one step",
    "rotation, rad",
)
def rocking():
    """A pier of 8 m with 50 t on a footing of 3 m; soil without tension, damped contact."""
    pier = ub.Beam((0, 0), (0, 8), SECTION, cells=4)
    footing = ub.Body((0, 0), mass=20e3, inertia=15e3)
    soil = ub.Stop(5e7, low=0.0, damping=1.0)
    places = np.linspace(-1.5, 1.5, 20)
    bed = [ub.Slide(ub.ground(x, 0), footing.at(x, 0), soil, axis=(0, 1)) for x in places]
    bed += [ub.Slide(one.a, one.b, ub.Spring(5e4), axis=(0, 1)) for one in bed]  # at the start
    hold = ub.Slide(ub.ground(0, 0), footing.middle, ub.Spring(1e9), axis=(1, 0))
    return shaken(
        [pier],
        4.0,
        ("displacement", footing.middle, 2),
        dt=0.005,
        bodies=[footing],
        joints=[ub.Rigid(pier.start, footing.middle)],
        connectors=[*bed, hold],
        masses=[ub.PointMass(pier.end, 50e3)],
    )


@model(
    "three towers that pound, two gaps of equal width",
    "dynamics",
    "two gaps close in the same step; the contact stiffness is large",
    "sway of the middle tower, m",
)
def pounding():
    """Two stiff towers beside a flexible one; gaps of 20 mm, 200 MN/m, damped."""
    soft = ub.Section(EA=4e9, GA=1.5e9, EI=1.5e7, rhoA=60.0, rhoI=0.5)
    towers = [
        ub.Beam((x, 0), (x, 6), section, cells=4)
        for x, section in ((-4, SECTION), (0, soft), (4, SECTION))
    ]
    gap = 0.02
    stops = [
        ub.Slide(towers[a].end, towers[b].end, ub.Stop(2e8, low=-gap, damping=0.5), axis=(1, 0))
        for a, b in ((0, 1), (1, 2))
    ]
    return shaken(
        towers,
        4.0,
        ("displacement", towers[1].end, 0),
        dt=0.002,
        supports=[ub.Clamped(tower.start) for tower in towers],
        connectors=stops,
        masses=[ub.PointMass(tower.end, 15e3) for tower in towers],
    )


@model(
    "sliding isolator under a record",
    "dynamics",
    "Coulomb friction without an elastic branch sticks and slides",
    "sway of the slab, m",
)
def isolator():
    """A column on a slab of 40 t that slides at 0.1 g, with a spring of 2 s."""
    slab = ub.Body((0, 0), mass=40e3, inertia=50e3)
    column = ub.Beam((0, 0), (0, 4), SECTION, cells=4)
    guide = ub.Prismatic(ub.ground(0, 0), slab.middle, axis=(1, 0))
    between = ub.ground(0, 0), slab.middle
    connectors = [
        ub.Slide(*between, ub.Coulomb(5.5e4), axis=(1, 0)),
        ub.Slide(*between, ub.Spring(5.5e5), axis=(1, 0)),
    ]
    return shaken(
        [column],
        4.0,
        ("displacement", slab.middle, 0),
        bodies=[slab],
        joints=[ub.Rigid(column.start, slab.middle), guide],
        connectors=connectors,
        masses=[ub.PointMass(column.end, 15e3)],
    )


@model(
    "a column is removed in one step",
    "dynamics",
    "progressive collapse: sudden unloading, catenary action of fibres",
    "deflection above the column, m",
)
def removed_column():
    """Two girders of 6 m, HEB 300 of fibres with 600 kN at the lost support; damped."""
    steel = ub.Fibres(st.MenegottoPinto(355e6, 0.01, 20.0), number=20)
    section = st.steel("HEB 300", fibres=steel)
    girder = ub.Beam((0, 0), (12, 0), section, cells=24)
    middle = girder.at(0.5)
    weight = 600e3
    scene = ub.Scene(
        [girder],
        supports=[ub.Clamped(girder.start), ub.Clamped(girder.end)],
        masses=[ub.PointMass(middle, weight / 9.81)],
        damping=[ub.Rayleigh(mass=1.0, stiffness=1e-3)],
        loads=[ub.PointLoad(middle, force=(0, -weight))],
    )
    return Case(scene, ("displacement", middle, 1), 400, 4.0, dynamic=True)


@model(
    "guyed mast with slack cables in gusts",
    "dynamics",
    "both cables are slack at the same time; each tightening is an impact",
    "sway of the mast, m",
)
def guyed_mast():
    """A pinned mast of 10 m with a mass of 1 t and cables with 5 mm of slack."""
    mast = ub.Beam((0, 0), (0, 10), ub.Section.tube(d=0.1, t=0.005, **STEEL), cells=4)
    cables = [
        ub.Stretch(ub.ground(x, 0), mast.end, ub.Stop(2e6, high=0.005, damping=0.2))
        for x in (-6.0, 6.0)
    ]
    gusts = ub.PointLoad(
        mast.end, force=(5e3, 0), amplitude=lambda t: np.sin(3.0 * t) + 0.5 * np.sin(7.7 * t)
    )
    scene = ub.Scene(
        [mast],
        supports=[ub.Pinned(mast.start)],
        connectors=cables,
        masses=[ub.PointMass(mast.end, 1e3)],
        loads=[gusts, ub.Gravity()],
    )
    return Case(scene, ("displacement", mast.end, 0), 3000, 6.0, dynamic=True)
