# SPDX-License-Identifier: MIT
"""Functions that write small scenes with one effect each; see :mod:`stored_scenes`.

Sizes are of beams of about 1 m with EA = 1e4 N, GA = 4e3 N, EI = 100 N m2 and 1 kg/m, under forces
of some tens of N, so that yielding moments are some N m and the lowest periods some 0.1 s.  Random
numbers are drawn in the order of the calls: a changed function changes its stored numbers.
`seeds` are of scenes that replace others which have a limit load, or whose round-off grows.
"""

import math

import user_classes as own
from stored_scenes import DYNAMIC, OVER_ANY_STEP, OVER_STEP, effects

import ufl_beam as ub
import ufl_beam.structures as st

PLAIN = {"EA": 1e4, "GA": 4e3, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.01}


# -- scenes in which effects act -----------------------------------------------------------------


def arm(d, section=None, force=20.0, cells=3, hold=True, grows=None, **options):
    """A beam that is clamped at its start, with a force at its end."""
    section = section or ub.Section(**PLAIN)
    beam = ub.Beam((0, 0), (1, d.some(0, 0.4)), section, cells=cells, name="b0", **options)
    d.add("beams", beam)
    if hold:
        d.add("supports", ub.Clamped(beam.start))
    if force:
        x, y = d.some(-force, force), d.sign() * d.some(force / 2, force)
        d.add("loads", ub.PointLoad(beam.end, force=(x, y), amplitude=grows or d.wave()))
    return beam


def joined(d, joint=None, apart=0.0, section=None):
    """An arm, a second beam from its end with a force at its own end, and a joint."""
    beam = arm(d, section)
    x, y = beam.end.point
    start, end = (x + apart, y + apart / 2), (x + 0.6, y - d.some(0.3, 0.6))
    other = d.add("beams", ub.Beam(start, end, ub.Section(**PLAIN), cells=2, name="b1"))
    load = d.some(-15.0, 15.0), d.sign() * d.some(7.5, 15.0)
    d.add("loads", ub.PointLoad(other.end, force=load, amplitude=d.wave()))
    if joint:
        d.add("joints", joint(beam.end, other.start))
    return beam, other


def driven(d, section=None, size=0.06, grows=None, **options):
    """An arm whose end is moved forth and back, so that it has no limit load."""
    beam = arm(d, section, force=0.0, **options)
    moved, size = grows or d.swell(), d.sign() * d.some(0.8 * size, 1.2 * size)
    d.add("supports", ub.PrescribedDisplacement(beam.end, v=of_size(moved, size)))
    return beam


def of_size(grows, size):
    """A function of time, multiplied by a number."""
    return lambda t: size * grows(t)


def near(d, low=0.2, high=0.8):
    """A point of the ground off the beams."""
    return ub.ground(d.some(low, high), d.some(0.6, 1.0))


def connected(d, law, kind=None, beam=None):
    """A connector of one component between the ground and an inner vertex or end of a beam."""
    beam = beam or arm(d)
    place = d.one(beam.end, beam.at(1 / 3))
    kind = kind or d.one("Stretch", "Slide")
    if kind == "Turn":
        return d.add("connectors", ub.Turn(ub.ground(0, 0), place, law))
    if kind == "Stretch":
        return d.add("connectors", ub.Stretch(near(d, 1.3, 1.8), place, law))
    axis = (d.some(-0.4, 0.4), 1.0)
    return d.add("connectors", ub.Slide(near(d), place, law, axis=axis))


def turning_spring(d, a, b, low=20, high=60):
    d.add("connectors", ub.Turn(a, b, ub.Spring(d.some(low, high))))


def springs_along_axes(d, a, b, low, high):
    for axis in ((1.0, 0.0), (0.0, 1.0)):
        d.add("connectors", ub.Slide(a, b, ub.Spring(d.some(low, high)), axis=axis))


# -- loads, works, damping, supports -----------------------------------------------------------


def force_of(d, size=15.0):
    return d.either_sign(size / 3, size), d.either_sign(size / 3, size)


def span_and_profile(d):
    """A part of a beam, and how a load varies along it."""
    top = d.acts(0.5, 2.0)
    profile = d.one((top, -1.0), lambda s: top - 2 * (s - 0.5) ** 2)
    return {"span": (0.1, d.acts(0.5, 0.8)), "profile": profile}


@effects(point_load=ub.PointLoad, follower_load=ub.FollowerLoad, line_load=ub.LineLoad)
@effects(pressure=ub.Pressure, gravity=ub.Gravity, imposed_strain=ub.ImposedStrain, table=ub.Table)
@effects(schemes=OVER_ANY_STEP, rotating_frame=ub.RotatingFrame)
def loads(d, name):
    beam = arm(d, force=0.0 if name in ("point_load", "table") else 20.0)
    match name:
        case "point_load":
            load = ub.PointLoad(beam.at(2 / 3), force_of(d), d.either_sign(1, 4), d.wave())
        case "follower_load":
            load = ub.FollowerLoad(beam.end, force_of(d), d.either_sign(1, 4), d.wave())
        case "line_load":
            numbers = force_of(d, 30.0), d.either_sign(1, 4), d.wave()
            load = ub.LineLoad(beam, *numbers, **span_and_profile(d))
        case "pressure":
            numbers = d.either_sign(10, 30), d.either_sign(10, 30), d.wave()
            load = ub.Pressure(beam, *numbers, **span_and_profile(d))
        case "gravity":
            d.add("masses", ub.PointMass(beam.at(2 / 3), 0.5))
            load = ub.Gravity((d.either_sign(2, 5), -d.acts(5, 15)), d.wave())
        case "imposed_strain":
            d.add("supports", ub.Roller(beam.end))
            axial = d.either_sign(1e-3, 4e-3), d.either_sign(1e-3, 4e-3)
            k = d.either_sign(0.02, 0.06)
            curvature = d.one((k, 0.0), lambda s: k * (1 - s**2))
            more = {"shear": d.either_sign(1e-3, 3e-3), "span": (0.0, d.acts(0.5, 0.8))}
            load = ub.ImposedStrain(beam, axial, curvature, d.wave(), **more)
        case "table":
            times = [0.0, d.some(0.05, 0.09), d.acts(0.1, 0.15), d.end]
            values = [0.0, d.acts(0.5, 1.0), -d.acts(0.5, 1.0), 0.5]
            load = ub.PointLoad(beam.end, (5.0, 12.0), amplitude=ub.Table(times, values))
        case "rotating_frame":
            rate, about = d.either_sign(4, 8), (-d.acts(0.1, 0.3), d.acts(0.1, 0.3))
            load = ub.RotatingFrame(rate, about=about)
    d.add("loads", load)


@effects(moving_load=ub.MovingLoad)
def moving_loads(d, name):
    beam, other = joined(d, ub.Revolute)
    d.add("supports", ub.Roller(beam.end), ub.Roller(other.end))
    speed, start = d.acts(4.0, 6.0), d.some(0.1, 0.2)
    mass = 0.0 if d.static else d.acts(0.2, 0.6)
    d.add("loads", ub.MovingLoad(
        [beam, other], lambda t: start + speed * t, force_of(d), d.wave(), mass=mass
    ))  # fmt: skip


@effects(ground_motion=st.GroundMotion)
def ground_motions(d, name):
    beam = arm(d)
    values = [d.either_sign(10.0, 40.0) for _ in range(6)]
    quake = st.GroundMotion(d.acts(0.02, 0.03), values)
    d.further.append(quake)
    if d.static or d.one(True, False):
        d.add("loads", ub.Gravity((-1, 0.5), amplitude=quake.acceleration))
    else:
        moved = ub.PrescribedDisplacement(beam.start, u=0.0, v=quake.displacement, psi=0.0)
        d.parts["supports"] = [moved]


@effects(own_statement=ub.Effect)
def statements(d, name):
    """Elements between places, one with a number that varies in time; drag along a beam."""
    beam = arm(d)
    x, y = beam.end.point
    place, k, grows = ub.ground(x, y + 0.5), d.acts(100, 300), d.wave()
    numbers = {"k": lambda t: k * (1 + grows(t) / 2), "h": d.acts(1e4, 3e4)}
    d.add("works", ub.Effect(own.HardeningSpring(), places=[place, beam.end], numbers=numbers))
    numbers, places = {"k": d.acts(100, 300), "time": d.acts(0.02, 0.1)}, [beam.at(0.5), beam.end]
    d.add("works", ub.Effect(own.MaxwellElement(), places=places, numbers=numbers))
    if not d.static:
        drag = {"c": d.acts(0.5, 3)}
        d.add("works", ub.Effect(own.AirDrag(), beams=[beam], numbers=drag, degree=3))


@effects(schemes=DYNAMIC, rayleigh=ub.Rayleigh)
def rayleigh_damping(d, name):
    arm(d, ub.Section(**PLAIN, bending=ub.ElastoPlastic(d.some(3, 6), kinematic=d.some(3, 10))))
    mass, stiffness = d.acts(0.5, 3), d.acts(5e-4, 3e-3)
    d.add("damping", ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=d.one(True, False)))


@effects(clamped=ub.Clamped, pinned=ub.Pinned)
def supports(d, name):
    beam = arm(d, hold=False)
    pair = (ub.Clamped, ub.Pinned) if name == "clamped" else (ub.Pinned, ub.Clamped)
    d.add("supports", d.instead(*pair)(beam.start))
    turning_spring(d, ub.ground(0, 0), beam.end)


@effects(prescribed_displacement=ub.PrescribedDisplacement)
def moved_supports(d, name):
    beam = arm(d, force=0.0, hold=False)
    u, v, psi = (of_size(d.swell(), d.either_sign(0.02, 0.08)) for _ in range(3))
    along = (1.0, d.acts(0.2, 0.6))
    d.add("supports", ub.PrescribedDisplacement(beam.start, u=u, v=v, psi=0.0, along=along))
    d.add("supports", ub.PrescribedDisplacement(beam.end, v=0.0, psi=psi))


@effects(virtual_work=ub.VirtualWork, potential=ub.Potential, kelvin_voigt=ub.KelvinVoigt)
@effects(roller=ub.Roller, link=ub.Link, spline=ub.Spline, stretch=ub.Stretch, slide=ub.Slide)
@effects(seeds={4: 11}, guided=ub.Guided)
def in_rigid_frames(d, name):
    """Effects in two beams that are joined rigidly."""
    beam, other = joined(d, ub.Rigid)
    x, y = other.end.point
    match name:
        case "virtual_work":  # across the deformed axis, or a dead force on two beams; and drag
            grows, size = d.wave(), d.either_sign(5, 15)
            d.add("works", d.one(
                ub.VirtualWork("current", own.current, beams=[beam], numbers={"p": size}, degree=3),
                ub.VirtualWork("dead", own.dead, numbers={"x": size, "y": of_size(grows, size)}),
            ))  # fmt: skip
            if not d.static:
                d.add("works", ub.VirtualWork("drag", own.drag, numbers={"c": d.acts(0.5, 3)}))
        case "potential":
            grows, size = d.wave(), d.either_sign(2, 5)
            k = {"k": d.acts(50, 300)}
            d.add("works", ub.Potential("soil", own.soil, beams=[other], numbers=k))
            d.add("works", d.one(
                ub.Potential("field", own.field, numbers={"size": of_size(grows, size)}),
                ub.Potential("warming", own.warming, numbers={"M": of_size(grows, size)}, degree=3),
            ))  # fmt: skip
        case "kelvin_voigt":
            d.add("damping", ub.KelvinVoigt(d.acts(2e-3, 1e-2), beams=d.one(None, [other])))
        case "roller":
            d.add("supports", ub.Roller(other.end, along=(d.acts(0.2, 0.6), 1.0)))
        case "link":
            ground = ub.ground(x + d.acts(0.3, 0.6), y + d.acts(0.3, 0.9))
            d.add("joints", ub.Link(ground, other.end))
        case "guided":
            slope, bend = d.acts(0.2, 0.6), d.acts(1.0, 3.0)
            d.add("joints", ub.Guided(other.end, lambda s: (x + slope * s + bend * s**2, y + s)))
        case "spline":  # some of its segments are passed in the run
            slope, rate = d.acts(0.2, 0.6), d.acts(10, 20)
            both = d.one(True, False)  # sides of the place; else the parameters are distances
            s = [0.02 * k for k in range(-20 if both else 0, 21)]
            points = [(x + slope * p + 0.02 * math.sin(rate * p), y + p) for p in s]
            curve = ub.Spline(points, s) if both else ub.Spline(points)
            d.add("joints", ub.Guided(other.end, curve))
        case "stretch":  # between the ground or a beam and a place of another beam
            a = d.one(beam.at(1 / 3), ub.ground(d.some(0.1, 0.4), -0.5))
            d.add("connectors", ub.Stretch(a, other.end, ub.Spring(d.acts(100, 400))))
        case "slide":  # along an axis that turns with a beam, to a place at a distance
            axis, a = (d.acts(0.3, 0.8), 1.0), beam.at(2 / 3)
            d.add("connectors", ub.Slide(a, other.end, ub.Spring(d.acts(100, 400)), axis=axis))


# -- joints and connectors ---------------------------------------------------------------------


@effects(rigid_link=ub.RigidLink, turn=ub.Turn)
def single_joints(d, name):
    if name == "rigid_link":
        joined(d, ub.RigidLink, apart=d.acts(0.1, 0.2))
    else:
        beam, other = joined(d, ub.Revolute)
        d.add("connectors", ub.Turn(beam.end, other.start, ub.Spring(d.acts(20, 60))))


@effects(rigid=ub.Rigid, revolute=ub.Revolute, prismatic=ub.Prismatic, release=ub.Release)
@effects(axial_bending_hinge=st.AxialBendingHinge)
@effects(schemes=DYNAMIC, bushing=ub.Bushing)
@effects(schemes=OVER_STEP, coulomb_in_a_joint=ub.Coulomb)
def between_beams(d, name):
    """Joints and connectors between two beams, and springs that hold what they leave free."""
    beam, other = joined(d)
    a, b, turns = beam.end, other.start, True
    match name:
        case "rigid" | "revolute":
            multipliers = d.one(True, False)
            pair = (ub.Rigid, ub.Revolute) if name == "rigid" else (ub.Revolute, ub.Rigid)
            d.add("joints", d.instead(*pair)(a, b, multipliers=multipliers))
        case "prismatic":
            axis, turns = (d.acts(0.3, 0.8), 1.0), d.one(True, False)
            d.add("joints", ub.Prismatic(a, b, axis=axis, turning=turns))
            d.add("connectors", ub.Slide(a, b, ub.Spring(d.some(100, 500)), axis=axis))
        case "release":
            free, multipliers = d.one("N", "V", "M"), d.one(True, False)
            free = d.instead(free, {"N": "V", "V": "M", "M": "N"}[free])
            d.add("joints", ub.Release(a, b, free=free, multipliers=multipliers))
            springs_along_axes(d, a, b, 200, 600)
        case "axial_bending_hinge":
            ranges = (3, 6), (0.5, 1.5), (500, 900), (500, 900), (100, 300)
            law = st.AxialBendingHinge(*(d.acts(*limits) for limits in ranges))
            d.add("connectors", ub.Bushing(a, b, law, axis=(1.0, 0.3)))
            springs_along_axes(d, a, b, 100, 200)
        case "bushing":
            law = own.Cushion(d.acts(100, 300), d.acts(0.05, 0.1), d.acts(1, 5))
            d.add("connectors", ub.Bushing(a, b, law, axis=(d.acts(0.3, 0.8), 1.0)))
        case "coulomb_in_a_joint":
            turns, joint = False, d.add("joints", ub.Revolute(a, b, multipliers=True))
            law = ub.Coulomb(d.acts(0.1, 0.4), coefficient=d.acts(0.01, 0.03), joint=joint)
            d.add("connectors", ub.Turn(a, b, law))
    if turns:
        turning_spring(d, a, b)


@effects(spring=ub.Spring, damper=ub.Damper, force_law=ub.ForceLaw)
@effects(own_connector_law=ub.extend.ConnectorLaw)
@effects(schemes=DYNAMIC, force_law_with_state=ub.ForceLaw)
@effects(schemes=DYNAMIC, own_connector_law_with_state=ub.extend.ConnectorLaw)
@effects(schemes=OVER_STEP, own_connector_law_that_holds=ub.extend.ConnectorLaw)
@effects(schemes=OVER_STEP, rigid_then_softening=ub.RigidPlastic)
def laws_of_connectors(d, name):
    match name:
        case "spring":
            law = ub.Spring(d.acts(100, 400), free=d.either_sign(0.01, 0.03))
        case "damper":
            law = ub.Damper(d.acts(2, 10))
        case "force_law":
            cubic = own.Cubic(d.acts(50, 200), d.acts(3e4, 9e4))
            law = ub.ForceLaw(cubic, stored=d.one(None, cubic.energy))
        case "own_connector_law":
            law = own.Stiffening(d.acts(50, 200), d.acts(3e4, 9e4))
        case "force_law_with_state":
            law = ub.ForceLaw(own.Maxwell(d.acts(100, 300), d.acts(0.02, 0.1)), state=[0.0])
        case "own_connector_law_with_state":
            law = own.Relaxing(d.acts(100, 300), d.acts(0.02, 0.1), d.acts(2, 10))
        case "own_connector_law_that_holds":
            rest = d.acts(4, 8)
            law = own.Brake(rest, rest * d.acts(0.5, 0.8), d.acts(0.02, 0.1))
        case "rigid_then_softening":
            kind = d.one(ub.Softening, ub.LinearSoftening, own.Petersson)
            law = ub.RigidPlastic(kind(d.acts(1, 4), d.acts(0.1, 0.3)))
    connected(d, law)


@effects(prescribed_motion=ub.PrescribedMotion, prescribed_force=ub.PrescribedForce)
@effects(schemes=OVER_STEP, coulomb=ub.Coulomb)
def laws_of_all_connectors(d, name):
    match name:
        case "prescribed_motion":
            law = ub.PrescribedMotion(of_size(d.swell(), d.either_sign(0.03, 0.1)))
        case "prescribed_force":
            law = ub.PrescribedForce(of_size(d.wave(), d.either_sign(3, 10)))
        case "coulomb":
            law = ub.Coulomb(d.acts(0.5, 3))
    connected(d, law, d.one("Turn", "Stretch", "Slide"))


@effects(yielding_spring=ub.Spring, breaking_spring=ub.Spring, stop=ub.Stop)
@effects(controller=ub.Controller)
@effects(schemes=OVER_ANY_STEP, rigid_plastic=ub.RigidPlastic)
def laws_on_arms(d, name):
    if name in ("yielding_spring", "breaking_spring"):
        beam = driven(d, size=0.1)
    else:
        beam = arm(d, grows=d.wave(6.0, 9.0) if name == "stop" else None)
    match name:
        case "yielding_spring":
            numbers = {"isotropic": (5, 20), "kinematic": (5, 20)}
            law = ub.ElastoPlastic(
                d.acts(0.3, 0.8), **{kind: d.acts(*limits) for kind, limits in numbers.items()}
            )
            law = ub.Spring(d.acts(150, 300), law=law)
        case "breaking_spring":
            kind = d.one(ub.Softening, ub.LinearSoftening)
            softening = kind(d.acts(0.3, 0.8), d.acts(0.02, 0.05))
            law = ub.Spring(d.acts(150, 300), softening=softening)
        case "stop":  # both ends of the interval are reached
            low, high = -d.acts(5e-4, 2e-3), d.acts(5e-4, 2e-3)
            damping = 0.0 if d.static else d.acts(0.2, 1)
            law = ub.Stop(d.acts(300, 900), low=low, high=high, damping=damping)
        case "rigid_plastic":
            law = ub.ElastoPlastic(d.acts(1, 4), isotropic=d.acts(20, 60), kinematic=d.acts(20, 60))
            law = ub.RigidPlastic(law)
        case "controller":  # by an integral of a rotation, or a displacement that is sampled
            if d.one(True, False):
                law = ub.Controller(own.Integral(beam.end, d.acts(5, 20)))
                d.add("connectors", ub.Turn(ub.ground(0, 0), beam.end, law))
                return
            gain, sample = d.acts(20, 60), d.one(None, 3 * d.dt)
            law = ub.Controller(lambda now: -gain * now.displacement(beam.end)[1], sample)
    connected(d, law, beam=beam)


@effects(clearance=ub.Clearance)
@effects(schemes=DYNAMIC, rough_clearance=ub.Clearance)
def clearances(d, name):
    beam, rough = arm(d), name == "rough_clearance"
    damping = None if rough else 0.0 if d.static else d.acts(0.2, 1)
    k, gap = d.acts(300, 900), d.acts(0.003, 0.01)
    more = {"damping": damping}
    if rough:
        ranges = {"damping": (0.2, 1), "friction": (0.03, 0.1), "radius": (0.02, 0.05)}
        more = {of: d.acts(*limits) for of, limits in ranges.items()}
    law = ub.Clearance(k, gap=gap, **more)
    d.add("connectors", ub.Bushing(near(d), beam.end, law, axis=(0.3, 1.0)))


def backbone(d, M, k):
    return st.Backbone(
        d.acts(0.8 * M, 1.2 * M), capping=d.acts(0.8, 1.5) * M / k,
        post_capping=d.acts(4, 8) * M / k, overstrength=1 + d.acts(0.05, 0.15),
        residual=d.acts(0.2, 0.4), ultimate=d.some(40, 60) * M / k,
    )  # fmt: skip


@effects(ibarra_krawinkler=(st.IbarraKrawinkler, st.Backbone))
@effects(pinching_hinge=(st.PinchingHinge, st.Backbone))
def deteriorating_hinges(d, name):
    """A hinge at the start of an arm, through some cycles."""
    kind, names, numbers = st.IbarraKrawinkler, ["strength", "softening", "unloading"], {}
    if name == "pinching_hinge":
        kind, names = st.PinchingHinge, [*names, "reloading"]
        numbers = {"kappa_F": d.acts(0.3, 0.7), "kappa_D": d.acts(0.2, 0.7)}
    beam = driven(d, size=0.04, grows=d.wave(8.0, 11.0, power=3), hold=False)
    d.add("supports", ub.Pinned(beam.start))
    M, k = d.some(0.8, 1.5), d.acts(150, 250)
    plus, minus = backbone(d, M, k), None if d.static else backbone(d, M, k)
    energies = {of: d.acts(20, 60) * M / k for of in names}
    law = kind(k, plus, minus, **energies, exponent=d.acts(1.0, 1.5), **numbers)
    d.add("connectors", ub.Turn(ub.ground(0, 0), beam.start, law))


# -- laws of sections ----------------------------------------------------------------------------


@effects(elasto_plastic=ub.ElastoPlastic, perzyna=ub.Perzyna, duvaut_lions=ub.DuvautLions)
@effects(ramberg_osgood=st.RambergOsgood, armstrong_frederick=st.ArmstrongFrederick)
@effects(bouc_wen=st.BoucWen, own_material_law=ub.extend.MaterialLaw)
def laws_of_bending(d, name):
    match name:
        case "elasto_plastic":
            law = ub.ElastoPlastic(d.acts(3, 6), isotropic=d.acts(3, 10), kinematic=d.acts(3, 10))
        case "perzyna":
            viscosity = ub.Perzyna(d.acts(0.5, 3))
            law = ub.ElastoPlastic(d.acts(3, 6), kinematic=d.acts(3, 10), viscosity=viscosity)
        case "duvaut_lions":
            viscosity = ub.DuvautLions(d.acts(0.01, 0.05))
            law = ub.ElastoPlastic(d.acts(3, 6), isotropic=d.acts(3, 10), viscosity=viscosity)
        case "ramberg_osgood":
            law = st.RambergOsgood(d.acts(4, 8), d.acts(0.02, 0.08), d.acts(2, 6))
        case "armstrong_frederick":
            law = st.ArmstrongFrederick(d.acts(4, 8), d.acts(10, 30), d.acts(2, 8))
        case "bouc_wen":
            ranges = (4, 8), (0.05, 0.2), (1, 3), (0.55, 0.8), (0.1, 0.3)
            law = st.BoucWen(*(d.acts(*limits) for limits in ranges))
        case "own_material_law":
            law = d.choose(
                lambda: own.Dashpot(d.acts(0.5, 2)),
                lambda: own.PowerLaw(d.acts(4, 8), 0.05, d.acts(2, 5)),
            )
    driven(d, ub.Section(**PLAIN, bending=law))


@effects(axial_and_shear=(ub.ElastoPlastic, ub.Section), axial_bending=st.AxialBending)
def laws_of_other_resultants(d, name):
    if name == "axial_and_shear":
        axial = ub.ElastoPlastic(d.acts(1, 2), isotropic=d.acts(500, 1000))
        shear = ub.ElastoPlastic(d.acts(3, 6), kinematic=d.acts(200, 500))
        arm(d, ub.Section(**PLAIN, axial=axial, shear=shear))
        return
    law = st.AxialBending(d.acts(15, 30), d.acts(4, 7), d.acts(0.01, 0.05))
    beam = driven(d, ub.Section(**PLAIN, interaction=law))
    pull = d.sign() * d.some(4, 8), 0.0
    d.add("loads", ub.PointLoad(beam.end, force=pull, amplitude=d.wave()))


def layered(fibres, **options):
    """A rectangle of EI = 100 N m2 whose stress at 15 N m is 0.9 MPa while it is elastic."""
    stiff = {"E": 1.2e8, "nu": 0.3, "rho": 1e3}
    return ub.Section.rectangle(0.01, 0.1, **stiff, fibres=fibres, **options)


@effects(fibres=ub.Fibres, placed_fibres=(ub.Fibres, ub.Section))
@effects(normal=ub.distributions.Normal, truncated_normal=ub.distributions.TruncatedNormal)
@effects(lognormal=ub.distributions.Lognormal, weibull=ub.distributions.Weibull)
@effects(menegotto_pinto=st.MenegottoPinto)
def laws_of_fibres(d, name):
    match name:
        case "fibres":  # cracks, a core of another law, and bars
            law = ub.ElastoPlastic(d.acts(8e4, 1e5), isotropic=d.acts(4e6, 9e6))
            crack = d.one(ub.Softening, ub.LinearSoftening)
            crack = crack(d.acts(1.1e5, 1.3e5), d.acts(400, 800))
            cover = ub.Fibres(law, number=d.instead(4, 6), softening=crack)
            core = ub.Fibres(st.RambergOsgood(d.some(1e5, 2e5), 1e-4, 3.0))
            bars = ub.Fibres(st.ArmstrongFrederick(d.acts(3e5, 5e5), 1e8, 100.0))
            section = d.one(layered(cover), layered(cover, cover=0.002, core=core))
            section = section.reinforced([-0.04, 0.04], [1e-5, 2e-5], E=8e8, fibres=bars)
        case "placed_fibres":
            law = ub.Fibres(ub.ElastoPlastic(d.acts(1e5, 2e5), kinematic=d.acts(3e6, 9e6)))
            y, A = [-0.05, 0.0, 0.03, d.acts(0.04, 0.05)], [2e-4, 3e-4, 3e-4, d.acts(1e-4, 2e-4)]
            section = ub.Section.of_fibres(y, A, E=1e8, nu=0.3, rho=1e3, fibres=law)
        case "menegotto_pinto":
            more = {
                "R0": (10, 20), "cR1": (0.6, 0.8), "cR2": (0.1, 0.3), "a1": (0.05, 0.2),
                "a2": (0.8, 1.5), "a3": (0.05, 0.2), "a4": (0.8, 1.5),
            }  # fmt: skip
            law = st.MenegottoPinto(
                d.acts(1e5, 2e5), d.acts(0.02, 0.1), **{of: d.acts(*x) for of, x in more.items()}
            )
            section = layered(ub.Fibres(law, number=4))
        case _:
            kind, of, seeds = {
                "normal": (ub.distributions.Normal, (1e4, 2e4), (1, 5)),
                "truncated_normal": (ub.distributions.TruncatedNormal, (2e4, 4e4), (2, 6)),
                "lognormal": (ub.distributions.Lognormal, (2e4, 4e4), (3, 7)),
                "weibull": (ub.distributions.Weibull, (4, 8), (4, 8)),
            }[name]
            limit = kind(d.acts(1e5, 2e5), d.acts(*of), seed=d.instead(*seeds))
            section = layered(ub.Fibres(ub.ElastoPlastic(limit, isotropic=6e6), number=4))
    driven(d, section)


@effects(seeds={4: 14}, kent_park=st.KentPark)
@effects(seeds={4: 11}, mander=st.Mander)
def concretes(d, name):
    """With bars that yield: without them, cells crush one after the other, and which, is random."""
    kind = ub.Softening if name == "kent_park" else ub.LinearSoftening
    strength, tension = d.acts(1e5, 2e5), kind(d.acts(6e4, 1e5), d.acts(400, 900))
    if name == "kent_park":
        ultimate = d.acts(1.4, 1.8) * 2.4e5 * 2 / 1.2e8
        law = st.KentPark(strength, d.acts(3e4, 6e4), ultimate, tension)
    else:
        strain = d.acts(1.2, 1.5) * 2.4e5 / 1.2e8
        spalling = d.choose(lambda: math.inf, lambda: d.acts(2.1, 2.5) * strain)
        law = st.Mander(strength, strain, spalling, tension)
    bars = ub.Fibres(ub.ElastoPlastic(2e6, kinematic=3e8))
    section = layered(ub.Fibres(law, number=4))
    driven(d, section.reinforced([-0.04, 0.04], [5e-5, 5e-5], E=8e8, fibres=bars), size=0.12)


IN_CELLS = {"softening": ub.Softening, "linear_softening": ub.LinearSoftening}
IN_CELLS["own_softening"] = ub.extend.SofteningLaw
AT_PLACES = IN_CELLS | {"hardening": ub.ElastoPlastic}


@effects(**{f"{name}_in_cells": (kind, ub.Section) for name, kind in IN_CELLS.items()})
@effects(
    schemes=OVER_ANY_STEP,
    **{f"{name}_at_a_place": (kind, ub.Beam) for name, kind in AT_PLACES.items()},
)
def hinges(d, name):
    if name == "hardening_at_a_place":
        viscosity = ub.Perzyna(d.choose(lambda: 0.0, lambda: d.acts(0.5, 2)))
        limit, moduli = d.acts(3, 5), {x: d.acts(5, 20) for x in ("isotropic", "kinematic")}
        law = ub.ElastoPlastic(limit, **moduli, viscosity=viscosity)
    else:
        M, G = d.acts(4, 7), d.acts(1.0, 3.0)
        if name.startswith("own"):
            law = d.one(own.Petersson(M, G), own.Rising(M, G / (1.5 * M)))
        else:
            law = (ub.Softening if name.startswith("softening") else ub.LinearSoftening)(M, G)
    if name.endswith("in_cells"):
        bending = d.one(None, ub.ElastoPlastic(d.some(5, 6), isotropic=20.0))
        driven(d, ub.Section(**PLAIN, hinge=law, bending=bending))
    else:
        driven(d, hinges={d.one(0.0, 1 / 3): law})


# -- sections, axes, bodies, motions ---------------------------------------------------------------


@effects(section=ub.Section)
def elastic_sections(d, name):
    """Elastic, also without rotary inertia."""
    numbers = {"EA": d.acts(200, 900), "GA": d.acts(200, 900), "EI": d.acts(50, 150)}
    arm(d, ub.Section(**numbers, rhoA=d.instead(d.some(0.5, 1.5), 2.0) if not d.static else 1.0))


@effects(curved_axis=ub.Beam)
def axes(d, name):
    """An arc, a polyline, or a curve of a user."""
    plain, h = ub.Section(**PLAIN), d.acts(0.1, 0.3)
    angle = math.atan2(h, 0.5)
    arc = (0.5, -h), math.hypot(0.5, h), (math.pi - angle, angle)
    beam = d.add("beams", d.one(
        ub.Beam.arc(*arc, plain, cells=3, name="b0"),
        ub.Beam.polyline([(0, 0), (0.5, h), (1, 0)], plain, cells=2, name="b0"),
        ub.Beam.along(lambda s: (s, 4 * h * s * (1 - s)), plain, cells=3, name="b0"),
    ))  # fmt: skip
    d.add("supports", ub.Clamped(beam.start))
    d.add("loads", ub.PointLoad(beam.end, (d.some(-20, 20), 10.0), amplitude=d.wave()))


@effects(body=ub.Body, point_mass=ub.PointMass)
@effects(schemes=DYNAMIC, velocity=ub.Velocity)
@effects(schemes=DYNAMIC, impact=(ub.PrescribedMotion, ub.PrescribedDisplacement))
def masses_and_motions(d, name):
    beam = arm(d, hold=name != "velocity")
    x, y = beam.end.point
    match name:
        case "body":
            middle, mass = (x + d.acts(0.1, 0.2), y + 0.1), d.instead(0.7, 0.9)
            body = d.add("bodies", ub.Body(middle, mass=mass, inertia=0.02))
            if d.one(True, False):
                d.add("joints", ub.Rigid(beam.end, body.at(x, y)))
            else:
                d.add("joints", ub.Revolute(beam.end, body.at(x, y), multipliers=True))
                turning_spring(d, beam.end, body.middle, 20, 90)
            d.add("loads", ub.PointLoad(body.at(x + 0.3, y), (3.0, -8.0), amplitude=d.wave()))
            d.add("loads", ub.Gravity((0.0, -9.81), d.wave()))
        case "point_mass":
            d.add("masses", ub.PointMass(beam.end, d.acts(0.3, 0.9)))
            if not d.static:
                mass = d.some(0.3, 0.9), d.acts(0.02, 0.05)
                d.add("masses", ub.PointMass(beam.at(1 / 3), *mass))
            d.add("loads", ub.Gravity((3.0, -9.81), d.wave()))
        case "velocity":
            body = d.add("bodies", ub.Body((1.2, 0.5), mass=0.5, inertia=0.02))
            d.add("joints", ub.RigidLink(beam.end, body.middle))
            linear = d.either_sign(0.5, 2), d.either_sign(0.5, 2)
            angular, about = d.either_sign(2, 4), (d.acts(0.2, 0.5), 0.0)
            d.add("initial", ub.Velocity([beam, body], linear, angular, about=about))
        case "impact":  # a rate that jumps: at the beginning, and at a kink of the motion
            times, way = [0.0, d.some(0.04, 0.07), 1.0], d.either_sign(0.02, 0.05)
            moved = ub.Table(times, [0.0, way, way])
            if d.one(True, False):
                d.add("supports", ub.PrescribedDisplacement(beam.end, v=moved))
            else:
                connected(d, ub.PrescribedMotion(moved), beam=beam)


# -- discretization and schemes --------------------------------------------------------------------


def varied(d):
    """A frame with a load, a connector and, now and then, a law that yields."""
    law = d.one(None, ub.ElastoPlastic(d.some(3, 6), kinematic=d.some(3, 10)))
    beam, other = joined(d, ub.Rigid, section=ub.Section(**PLAIN, bending=law))
    d.add("connectors", d.one(
        ub.Stretch(near(d, 1.3, 1.8), other.end, ub.Spring(d.some(50, 200))),
        ub.Slide(near(d), other.end, ub.Spring(d.some(50, 200)), axis=(0.3, 1.0)),
    ))  # fmt: skip
    d.add("loads", d.one(
        ub.Pressure(beam, d.some(5, 20), amplitude=d.wave()),
        ub.LineLoad(beam, (0.0, d.some(5, 20)), amplitude=d.wave()),
        ub.FollowerLoad(other.end, (0.0, d.some(5, 15)), amplitude=d.wave()),
    ))  # fmt: skip


@effects(mesh_of_degree_2=ub.Mesh, mesh_of_degree_3=ub.Mesh, refined_mesh=ub.Mesh)
@effects(schemes=DYNAMIC, lumped_mass=ub.Mesh)
def meshes(d, name):
    varied(d)
    match name:
        case "mesh_of_degree_2" | "mesh_of_degree_3":
            degree = int(name[-1])
            d.mesh = ub.Mesh(degree=d.instead(degree, degree - 1), lumped=d.one(True, False))
        case "refined_mesh":
            d.mesh = ub.Mesh(refine=d.instead(2, 1))
        case "lumped_mass":
            d.mesh = ub.Mesh(lumped=d.instead(True, False))


@effects(static=ub.Static, energy_momentum_static=ub.EnergyMomentumStatic)
@effects(energy_momentum=ub.EnergyMomentum, energy_momentum_printed=ub.EnergyMomentumPrinted)
@effects(energy_momentum_decaying=ub.EnergyMomentumDecaying, newmark=ub.Newmark)
@effects(generalized_alpha=ub.GeneralizedAlpha)
@effects(own_scheme=(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics))
def time_schemes(d, name):
    other = ub.EnergyMomentum()
    match name:
        case "static":
            scheme = ub.Static()
        case "energy_momentum_static":
            scheme = ub.EnergyMomentumStatic(d.one(1.0, 0.5, 0.7))
            d.add("damping", ub.KelvinVoigt(5e-3))
        case "energy_momentum":
            scheme = ub.EnergyMomentum(d.some(0.02, 0.1), d.some(0.05, 0.2))
        case "energy_momentum_printed":
            scheme = ub.EnergyMomentumPrinted()
        case "energy_momentum_decaying":
            d.dt, other = d.one(0.008, 0.01), ub.EnergyMomentumDecaying(1.0)
            scheme = ub.EnergyMomentumDecaying(d.some(0.4, 0.7))
        case "newmark":
            gamma, more, other = d.some(0.5, 0.6), d.some(0.0, 0.05), ub.Newmark(0.65, 0.4)
            scheme = ub.Newmark(gamma, (gamma + 0.5) ** 2 / 4 + more)
        case "generalized_alpha":
            scheme, other = ub.GeneralizedAlpha(d.some(0.4, 0.9)), ub.GeneralizedAlpha(1.0)
        case "own_scheme":
            scheme, other = own.Weighted(d.some(0.52, 0.58)), own.Weighted(0.5)
    d.scheme = d.instead(scheme, other)
    varied(d)


@effects(fourth_order=ub.EnergyMomentum)
def schemes_of_fourth_order(d, name):
    d.scheme = d.instead(ub.EnergyMomentum(order=4), ub.EnergyMomentum())
    _, other = joined(d, ub.Rigid)
    d.add("connectors", ub.Stretch(near(d, 1.3, 1.8), other.end, ub.Spring(d.some(50, 200))))


@effects(adaptive=ub.Adaptive)
def adaptive_steps(d, name):
    """Motions after adaptive steps; in the scene that shows that they act, steps are equal."""
    d.scheme = ub.EnergyMomentum()
    steps = ub.Adaptive(
        d.some(1e-4, 3e-4), first=d.some(1e-3, 4e-3), longest=0.02, shortest=1e-9,
        stops=[d.some(0.05, 0.1)],
    )  # fmt: skip
    d.dt = d.instead(steps, d.dt)
    beam = arm(d)
    connected(d, ub.Spring(d.some(50, 200)), beam=beam)


@effects(load_control=ub.LoadControl, displacement_control=ub.DisplacementControl)
@effects(arc_length=ub.ArcLength, dissipation_control=ub.DissipationControl)
def paths(d, name):
    """A load that grows with the load factor; of another control the path has other steps."""
    match name:
        case "load_control":
            step = d.some(0.02, 0.05)
            beam, controls = arm(d, force=0.0), [ub.LoadControl(x * step) for x in (1, 1.1)]
        case "displacement_control":
            beam, step = arm(d, force=0.0), -d.some(0.01, 0.02)
            controls = [
                ub.DisplacementControl(beam.end, "v", step, end=20.5 * x * step) for x in (1, 1.1)
            ]
        case "arc_length":  # a shallow truss of two halves that snaps through
            section, rise = ub.Section(**PLAIN), d.some(0.06, 0.1)
            beam = d.add("beams", ub.Beam((0, 0), (1, rise), section, cells=3, name="b0"))
            d.add("supports", ub.Pinned(beam.start), ub.Roller(beam.end, along=(0, 1)))
            step, factor = d.some(0.01, 0.02), d.some(0.5, 2)
            controls = [ub.ArcLength(x * step, factor=factor) for x in (1, 1.1)]
        case "dissipation_control":  # where it softens, steps depend on numbers of iterations
            law = ub.ElastoPlastic(d.some(2, 4), isotropic=d.some(10, 30))
            beam = arm(d, ub.Section(**PLAIN, bending=law), force=0.0)
            step, elastic = d.some(0.01, 0.02), ub.ArcLength(0.03)
            controls = [ub.DissipationControl(x * step, otherwise=elastic) for x in (1, 1.1)]
    load = d.some(-5, 5), -d.some(15, 25)
    d.add("loads", ub.PointLoad(beam.end, force=load, amplitude=lambda t: t))
    d.control = d.instead(*controls)
