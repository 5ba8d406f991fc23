# SPDX-License-Identifier: MIT
"""Functions that write small scenes with one effect each; see :mod:`stored_scenes`.

Sizes are of beams of about 1 m with EA = 1e4 N, GA = 4e3 N, EI = 100 N m2 and 1 kg/m, under forces
of some tens of N, so that yielding moments are some N m and the lowest periods some 0.1 s.  Random
numbers are drawn in the order of the calls: a changed function changes its stored numbers.
`seeds` are of scenes that replace others which have a limit load, or whose round-off grows.
"""

import math

import user_classes as own
from stored_scenes import DYNAMIC, OVER_ANY_STEP, OVER_STEP, Drawn, Instead, effect, effects

import ufl_beam as ub
import ufl_beam.structures as st

PLAIN = {"EA": 1e4, "GA": 4e3, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.01}


# -- scenes in which effects act -----------------------------------------------------------------


def arm(d, section=None, force=20.0, cells=3, hold=True, grows=None, **options):
    """A beam that is clamped at its start, with a force at its end."""
    section = section or ub.Section(**PLAIN)
    beam = d.add(
        "beams", ub.Beam((0, 0), (1, d.some(0, 0.4)), section, cells=cells, name="b0", **options)
    )
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


def turning_spring(d, a, b, low=20, high=60):
    d.add("connectors", ub.Turn(a, b, ub.Spring(d.some(low, high))))


def springs_along_axes(d, a, b, low, high):
    for axis in ((1.0, 0.0), (0.0, 1.0)):
        d.add("connectors", ub.Slide(a, b, ub.Spring(d.some(low, high)), axis=axis))


def driven(d, section=None, size=0.06, grows=None, **options):
    """An arm whose end is moved forth and back, so that it has no limit load."""
    beam = arm(d, section, force=0.0, **options)
    moved, size = grows or d.swell(), d.sign() * d.some(0.8 * size, 1.2 * size)
    d.add("supports", ub.PrescribedDisplacement(beam.end, v=of_size(moved, size)))
    return beam


def of_size(grows, size):
    """A function of time, multiplied by a number."""
    return lambda t: size * grows(t)


def some(low, high):
    return lambda d: d.some(low, high)


def either(low, high):
    return lambda d: d.either_sign(low, high)


def yes_or_no(d):
    return d.one(True, False)


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


# -- loads -------------------------------------------------------------------------------------


def force_of(d, size=15.0):
    return d.either_sign(size / 3, size), d.either_sign(size / 3, size)


def span_and_profile(d):
    """A part of a beam, and how a load varies along it."""
    top = d.acts(0.5, 2.0)
    profile = d.one((top, -1.0), lambda s: top - 2 * (s - 0.5) ** 2)
    return {"span": (0.1, d.acts(0.5, 0.8)), "profile": profile}


@effect(ub.PointLoad)
def point_load(d):
    beam = arm(d, force=0.0)
    d.add("loads", ub.PointLoad(beam.at(2 / 3), force_of(d), d.either_sign(1, 4), d.wave()))


@effect(ub.FollowerLoad)
def follower_load(d):
    beam = arm(d)
    d.add("loads", ub.FollowerLoad(beam.end, force_of(d), d.either_sign(1, 4), d.wave()))


@effect(ub.LineLoad)
def line_load(d):
    numbers = arm(d), force_of(d, 30.0), d.either_sign(1, 4), d.wave()
    d.add("loads", ub.LineLoad(*numbers, **span_and_profile(d)))


@effect(ub.Pressure)
def pressure(d):
    numbers = arm(d), d.either_sign(10, 30), d.either_sign(10, 30), d.wave()
    d.add("loads", ub.Pressure(*numbers, **span_and_profile(d)))


@effect(ub.MovingLoad)
def moving_load(d):
    beam, other = joined(d, ub.Revolute)
    d.add("supports", ub.Roller(beam.end), ub.Roller(other.end))
    speed, start = d.acts(4.0, 6.0), d.some(0.1, 0.2)
    mass = 0.0 if d.static else d.acts(0.2, 0.6)
    d.add("loads", ub.MovingLoad(
        [beam, other], lambda t: start + speed * t, force_of(d), d.wave(), mass=mass
    ))  # fmt: skip


@effect(ub.Gravity)
def gravity(d):
    beam = arm(d)
    d.add("masses", ub.PointMass(beam.at(2 / 3), 0.5))
    d.add("loads", ub.Gravity((d.either_sign(2, 5), -d.acts(5, 15)), d.wave()))


@effect(ub.RotatingFrame, schemes=OVER_ANY_STEP)
def rotating_frame(d):
    arm(d)
    rate, about = d.either_sign(4, 8), (-d.acts(0.1, 0.3), d.acts(0.1, 0.3))
    d.add("loads", ub.RotatingFrame(rate, about=about))


@effect(ub.ImposedStrain)
def imposed_strain(d):
    beam = arm(d)
    d.add("supports", ub.Roller(beam.end))
    a, b, k = d.either_sign(1e-3, 4e-3), d.either_sign(1e-3, 4e-3), d.either_sign(0.02, 0.06)
    curvature = d.one((k, 0.0), lambda s: k * (1 - s**2))
    shear, span = d.either_sign(1e-3, 3e-3), (0.0, d.acts(0.5, 0.8))
    d.add("loads", ub.ImposedStrain(beam, (a, b), curvature, d.wave(), shear=shear, span=span))


@effect(ub.Table)
def table(d):
    beam = arm(d, force=0.0)
    times = [0.0, d.some(0.05, 0.09), d.acts(0.1, 0.15), d.end]
    values = [0.0, d.acts(0.5, 1.0), -d.acts(0.5, 1.0), 0.5]
    d.add("loads", ub.PointLoad(beam.end, (5.0, 12.0), amplitude=ub.Table(times, values)))


@effect(st.GroundMotion)
def ground_motion(d):
    beam = arm(d)
    values = [d.either_sign(10.0, 40.0) for _ in range(6)]
    quake = st.GroundMotion(d.acts(0.02, 0.03), values)
    d.further.append(quake)
    if d.static or yes_or_no(d):
        d.add("loads", ub.Gravity((-1, 0.5), amplitude=quake.acceleration))
    else:
        moved = ub.PrescribedDisplacement(beam.start, u=0.0, v=quake.displacement, psi=0.0)
        d.parts["supports"] = [moved]


# -- works and damping ---------------------------------------------------------------------------


@effect(ub.VirtualWork)
def virtual_work(d):
    """A force across the deformed axis, or a dead force on one of two beams, and drag."""
    beam, _ = joined(d, ub.Rigid)
    grows, size = d.wave(), d.either_sign(5, 15)
    d.add("works", d.one(
        ub.VirtualWork("current", own.current, beams=[beam], numbers={"p": size}, degree=3),
        ub.VirtualWork("dead", own.dead, numbers={"x": size, "y": of_size(grows, size)}),
    ))  # fmt: skip
    if not d.static:
        d.add("works", ub.VirtualWork("drag", own.drag, numbers={"c": d.acts(0.5, 3)}))


@effect(ub.Potential)
def potential(d):
    _, other = joined(d, ub.Rigid)
    grows, size = d.wave(), d.either_sign(2, 5)
    d.add("works", ub.Potential("soil", own.soil, beams=[other], numbers={"k": d.acts(50, 300)}))
    d.add("works", d.one(
        ub.Potential("field", own.field, numbers={"size": of_size(grows, size)}),
        ub.Potential("warming", own.warming, numbers={"M": of_size(grows, size)}, degree=3),
    ))  # fmt: skip


@effect(ub.Effect)
def own_statement(d):
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


@effect(ub.Rayleigh, schemes=DYNAMIC)
def rayleigh(d):
    arm(d, ub.Section(**PLAIN, bending=ub.ElastoPlastic(d.some(3, 6), kinematic=d.some(3, 10))))
    mass, stiffness = d.acts(0.5, 3), d.acts(5e-4, 3e-3)
    d.add("damping", ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=yes_or_no(d)))


@effect(ub.KelvinVoigt)
def kelvin_voigt(d):
    _, other = joined(d, ub.Rigid)
    d.add("damping", ub.KelvinVoigt(d.acts(2e-3, 1e-2), beams=d.one(None, [other])))


# -- supports ----------------------------------------------------------------------------------


def held_at_its_start(d, support):
    beam = arm(d, hold=False)
    d.add("supports", support(d)(beam.start))
    turning_spring(d, ub.ground(0, 0), beam.end)


effects(
    held_at_its_start,
    clamped=Instead(ub.Clamped, ub.Pinned),
    pinned=Instead(ub.Pinned, ub.Clamped),
)


@effect(ub.Roller)
def roller(d):
    _, other = joined(d, ub.Rigid)
    d.add("supports", ub.Roller(other.end, along=(d.acts(0.2, 0.6), 1.0)))


@effect(ub.PrescribedDisplacement)
def prescribed_displacement(d):
    beam = arm(d, force=0.0, hold=False)
    u, v, psi = (of_size(d.swell(), d.either_sign(0.02, 0.08)) for _ in range(3))
    along = (1.0, d.acts(0.2, 0.6))
    d.add("supports", ub.PrescribedDisplacement(beam.start, u=u, v=v, psi=0.0, along=along))
    d.add("supports", ub.PrescribedDisplacement(beam.end, v=0.0, psi=psi))


# -- joints ------------------------------------------------------------------------------------


def joined_with_a_spring(d, joint):
    beam, other = joined(d)
    multipliers = yes_or_no(d)
    d.add("joints", joint(d)(beam.end, other.start, multipliers=multipliers))
    turning_spring(d, beam.end, other.start)


effects(
    joined_with_a_spring,
    rigid=Instead(ub.Rigid, ub.Revolute),
    revolute=Instead(ub.Revolute, ub.Rigid),
)


@effect(ub.Prismatic)
def prismatic(d):
    beam, other = joined(d)
    axis, turning = (d.acts(0.3, 0.8), 1.0), yes_or_no(d)
    d.add("joints", ub.Prismatic(beam.end, other.start, axis=axis, turning=turning))
    d.add("connectors", ub.Slide(beam.end, other.start, ub.Spring(d.some(100, 500)), axis=axis))
    if turning:
        turning_spring(d, beam.end, other.start)


@effect(ub.RigidLink)
def rigid_link(d):
    joined(d, ub.RigidLink, apart=d.acts(0.1, 0.2))


@effect(ub.Link)
def link(d):
    _, other = joined(d, ub.Rigid)
    x, y = other.end.point
    d.add("joints", ub.Link(ub.ground(x + d.acts(0.3, 0.6), y + d.acts(0.3, 0.9)), other.end))


@effect(ub.Guided, seeds={4: 11})
def guided(d):
    _, other = joined(d, ub.Rigid)
    (x, y), slope, bend = other.end.point, d.acts(0.2, 0.6), d.acts(1.0, 3.0)
    d.add("joints", ub.Guided(other.end, lambda s: (x + slope * s + bend * s**2, y + s)))


@effect(ub.Spline)
def spline(d):
    """A guide through points; some of its segments are passed in the run."""
    _, other = joined(d, ub.Rigid)
    (x, y), slope, rate = other.end.point, d.acts(0.2, 0.6), d.acts(10, 20)
    both = yes_or_no(d)  # sides of the place; else the parameters are distances
    s = [0.02 * k for k in range(-20 if both else 0, 21)]
    points = [(x + slope * p + 0.02 * math.sin(rate * p), y + p) for p in s]
    d.add("joints", ub.Guided(other.end, ub.Spline(points, s) if both else ub.Spline(points)))


@effect(ub.Release)
def release(d):
    beam, other = joined(d)
    free, multipliers = d.one("N", "V", "M"), yes_or_no(d)
    free = d.instead(free, {"N": "V", "V": "M", "M": "N"}[free])
    d.add("joints", ub.Release(beam.end, other.start, free=free, multipliers=multipliers))
    springs_along_axes(d, beam.end, other.start, 200, 600)
    turning_spring(d, beam.end, other.start)


# -- connectors --------------------------------------------------------------------------------


@effect(ub.Turn)
def turn(d):
    beam, other = joined(d, ub.Revolute)
    d.add("connectors", ub.Turn(beam.end, other.start, ub.Spring(d.acts(20, 60))))


@effect(ub.Stretch)
def stretch(d):
    """Between the ground or a beam and a place of another beam."""
    beam, other = joined(d, ub.Rigid)
    a = d.one(beam.at(1 / 3), ub.ground(d.some(0.1, 0.4), -0.5))
    d.add("connectors", ub.Stretch(a, other.end, ub.Spring(d.acts(100, 400))))


@effect(ub.Slide)
def slide(d):
    """Along an axis that turns with a beam, to a place at a distance."""
    beam, other = joined(d, ub.Rigid)
    axis = (d.acts(0.3, 0.8), 1.0)
    d.add("connectors", ub.Slide(beam.at(2 / 3), other.end, ub.Spring(d.acts(100, 400)), axis=axis))


@effect(ub.Bushing, schemes=DYNAMIC)
def bushing(d):
    beam, other = joined(d)
    law = own.Cushion(d.acts(100, 300), d.acts(0.05, 0.1), d.acts(1, 5))
    axis = (d.acts(0.3, 0.8), 1.0)
    d.add("connectors", ub.Bushing(beam.end, other.start, law, axis=axis))
    turning_spring(d, beam.end, other.start)


@effect(ub.Controller)
def controller(d):
    """Integral of a rotation, or a force from a displacement that is sampled."""
    beam = arm(d)
    if yes_or_no(d):
        law = ub.Controller(own.Integral(beam.end, d.acts(5, 20)))
        d.add("connectors", ub.Turn(ub.ground(0, 0), beam.end, law))
        return
    gain, sample = d.acts(20, 60), d.one(None, 3 * d.dt)
    law = ub.Controller(lambda now: -gain * now.displacement(beam.end)[1], sample)
    connected(d, law, beam=beam)


@effect(ub.PrescribedMotion)
def prescribed_motion(d):
    law = ub.PrescribedMotion(of_size(d.swell(), d.either_sign(0.03, 0.1)))
    connected(d, law, d.one("Turn", "Stretch", "Slide"))


@effect(ub.PrescribedForce)
def prescribed_force(d):
    law = ub.PrescribedForce(of_size(d.wave(), d.either_sign(3, 10)))
    connected(d, law, d.one("Turn", "Stretch", "Slide"))


effects(
    lambda d, law: connected(d, law(d)),
    spring=Drawn(ub.Spring, (100, 400), free=either(0.01, 0.03)),
    damper=Drawn(ub.Damper, (2, 10)),
    own_connector_law=Drawn(own.Stiffening, (50, 200), (3e4, 9e4)),
)

MAXWELL = Drawn(own.Maxwell, (100, 300), (0.02, 0.1))

effects(
    lambda d, law: connected(d, law(d)),
    schemes=DYNAMIC,
    force_law_with_state=Drawn(ub.ForceLaw, MAXWELL, state=[0.0]),
    own_connector_law_with_state=Drawn(own.Relaxing, (100, 300), (0.02, 0.1), (2, 10)),
)


@effect(ub.Spring)
def yielding_spring(d):
    beam = driven(d, size=0.1)
    law = ub.ElastoPlastic(d.acts(0.3, 0.8), isotropic=d.acts(5, 20), kinematic=d.acts(5, 20))
    connected(d, ub.Spring(d.acts(150, 300), law=law), beam=beam)


@effect(ub.Spring)
def breaking_spring(d):
    beam, kind = driven(d, size=0.1), d.one(ub.Softening, ub.LinearSoftening)
    softening = kind(d.acts(0.3, 0.8), d.acts(0.02, 0.05))
    connected(d, ub.Spring(d.acts(150, 300), softening=softening), beam=beam)


@effect(ub.Stop)
def stop(d):
    """Both ends of the interval are reached."""
    beam = arm(d, grows=d.swing())
    low, high = -d.acts(5e-4, 2e-3), d.acts(5e-4, 2e-3)
    damping = 0.0 if d.static else d.acts(0.2, 1)
    connected(d, ub.Stop(d.acts(300, 900), low=low, high=high, damping=damping), beam=beam)


@effect(ub.Clearance)
def clearance(d):
    beam = arm(d)
    damping = 0.0 if d.static else d.acts(0.2, 1)
    law = ub.Clearance(d.acts(300, 900), gap=d.acts(0.003, 0.01), damping=damping)
    d.add("connectors", ub.Bushing(near(d), beam.end, law, axis=(0.3, 1.0)))


@effect(ub.Clearance, schemes=DYNAMIC)
def rough_clearance(d):
    beam = arm(d)
    law = ub.Clearance(
        d.acts(300, 900), gap=d.acts(0.003, 0.01), damping=d.acts(0.2, 1),
        friction=d.acts(0.03, 0.1), radius=d.acts(0.02, 0.05),
    )  # fmt: skip
    d.add("connectors", ub.Bushing(near(d), beam.end, law, axis=(0.3, 1.0)))


@effect(ub.Coulomb, schemes=OVER_STEP)
def coulomb(d):
    connected(d, ub.Coulomb(d.acts(0.5, 3)), d.one("Turn", "Stretch", "Slide"))


@effect(ub.Coulomb, schemes=OVER_STEP)
def coulomb_in_a_joint(d):
    beam, other = joined(d)
    joint = d.add("joints", ub.Revolute(beam.end, other.start, multipliers=True))
    law = ub.Coulomb(d.acts(0.1, 0.4), coefficient=d.acts(0.01, 0.03), joint=joint)
    d.add("connectors", ub.Turn(beam.end, other.start, law))


@effect(ub.RigidPlastic, schemes=OVER_ANY_STEP)
def rigid_plastic(d):
    beam = arm(d)
    law = ub.ElastoPlastic(d.acts(1, 4), isotropic=d.acts(20, 60), kinematic=d.acts(20, 60))
    connected(d, ub.RigidPlastic(law), beam=beam)


@effect(ub.RigidPlastic, schemes=OVER_STEP)
def rigid_then_softening(d):
    kind = d.one(ub.Softening, ub.LinearSoftening, own.Petersson)
    connected(d, ub.RigidPlastic(kind(d.acts(1, 4), d.acts(0.1, 0.3))))


@effect(ub.ForceLaw)
def force_law(d):
    cubic = own.Cubic(d.acts(50, 200), d.acts(3e4, 9e4))
    connected(d, ub.ForceLaw(cubic, stored=d.one(None, cubic.energy)))


@effect(ub.extend.ConnectorLaw, schemes=OVER_STEP)
def own_connector_law_that_holds(d):
    rest = d.acts(4, 8)
    connected(d, own.Brake(rest, rest * d.acts(0.5, 0.8), d.acts(0.02, 0.1)))


def backbone(d, M, k):
    return st.Backbone(
        d.acts(0.8 * M, 1.2 * M), capping=d.acts(0.8, 1.5) * M / k,
        post_capping=d.acts(4, 8) * M / k, overstrength=1 + d.acts(0.05, 0.15),
        residual=d.acts(0.2, 0.4), ultimate=d.some(40, 60) * M / k,
    )  # fmt: skip


def deteriorating(d, kind, *more, **numbers):
    """A hinge at the start of an arm, through some cycles."""
    beam = driven(d, size=0.04, grows=d.surge(), hold=False)
    d.add("supports", ub.Pinned(beam.start))
    M, k = d.some(0.8, 1.5), d.acts(150, 250)
    plus, minus = backbone(d, M, k), None if d.static else backbone(d, M, k)
    of = "strength", "softening", "unloading", *more
    energies = {name: d.acts(20, 60) * M / k for name in of}
    law = kind(k, plus, minus, **energies, exponent=d.acts(1.0, 1.5), **numbers)
    d.add("connectors", ub.Turn(ub.ground(0, 0), beam.start, law))


@effect(st.IbarraKrawinkler, st.Backbone)
def ibarra_krawinkler(d):
    deteriorating(d, st.IbarraKrawinkler)


@effect(st.PinchingHinge, st.Backbone)
def pinching_hinge(d):
    numbers = {"kappa_F": d.acts(0.3, 0.7), "kappa_D": d.acts(0.2, 0.7)}
    deteriorating(d, st.PinchingHinge, "reloading", **numbers)


@effect(st.AxialBendingHinge)
def axial_bending_hinge(d):
    beam, other = joined(d)
    ranges = (3, 6), (0.5, 1.5), (500, 900), (500, 900), (100, 300)
    law = st.AxialBendingHinge(*(d.acts(*limits) for limits in ranges))
    d.add("connectors", ub.Bushing(beam.end, other.start, law, axis=(1.0, 0.3)))
    springs_along_axes(d, beam.end, other.start, 100, 200)
    turning_spring(d, beam.end, other.start)


# -- laws of sections ----------------------------------------------------------------------------


def bent(d, law):
    driven(d, ub.Section(**PLAIN, bending=law(d)))


effects(
    bent,
    elasto_plastic=Drawn(ub.ElastoPlastic, (3, 6), isotropic=(3, 10), kinematic=(3, 10)),
    ramberg_osgood=Drawn(st.RambergOsgood, (4, 8), (0.02, 0.08), (2, 6)),
    armstrong_frederick=Drawn(st.ArmstrongFrederick, (4, 8), (10, 30), (2, 8)),
    bouc_wen=Drawn(st.BoucWen, (4, 8), (0.05, 0.2), (1, 3), (0.55, 0.8), (0.1, 0.3)),
)


def creeping(d, viscosity):
    """Isotropic hardening of one kind, kinematic hardening of the other."""
    of = viscosity(d)
    kind = "kinematic" if isinstance(of, ub.Perzyna) else "isotropic"
    law = ub.ElastoPlastic(d.acts(3, 6), **{kind: d.acts(3, 10)}, viscosity=of)
    driven(d, ub.Section(**PLAIN, bending=law))


effects(
    creeping,
    perzyna=Drawn(ub.Perzyna, (0.5, 3)),
    duvaut_lions=Drawn(ub.DuvautLions, (0.01, 0.05)),
)


@effect(ub.ElastoPlastic, ub.Section)
def axial_and_shear(d):
    axial = ub.ElastoPlastic(d.acts(1, 2), isotropic=d.acts(500, 1000))
    shear = ub.ElastoPlastic(d.acts(3, 6), kinematic=d.acts(200, 500))
    arm(d, ub.Section(**PLAIN, axial=axial, shear=shear))


@effect(st.AxialBending)
def axial_bending(d):
    law = st.AxialBending(d.acts(15, 30), d.acts(4, 7), d.acts(0.01, 0.05))
    beam = driven(d, ub.Section(**PLAIN, interaction=law))
    pull = d.sign() * d.some(4, 8), 0.0
    d.add("loads", ub.PointLoad(beam.end, force=pull, amplitude=d.wave()))


@effect(ub.extend.MaterialLaw)
def own_material_law(d):
    power = Drawn(own.PowerLaw, (4, 8), 0.05, (2, 5))
    bent(d, d.one(Drawn(own.Dashpot, (0.5, 2)), power))


def layered(d, fibres, **options):
    """A rectangle of EI = 100 N m2 whose stress at 15 N m is 0.9 MPa while it is elastic."""
    stiff = {"E": 1.2e8, "nu": 0.3, "rho": 1e3}
    return ub.Section.rectangle(0.01, 0.1, **stiff, fibres=fibres, **options)


@effect(ub.Fibres)
def fibres(d):
    """Cracks, a core of another law, and bars."""
    law = ub.ElastoPlastic(d.acts(8e4, 1e5), isotropic=d.acts(4e6, 9e6))
    crack = d.one(ub.Softening, ub.LinearSoftening)(d.acts(1.1e5, 1.3e5), d.acts(400, 800))
    cover = ub.Fibres(law, number=d.instead(4, 6), softening=crack)
    core = ub.Fibres(st.RambergOsgood(d.some(1e5, 2e5), 1e-4, 3.0))
    bars = ub.Fibres(st.ArmstrongFrederick(d.acts(3e5, 5e5), 1e8, 100.0))
    section = d.one(layered(d, cover), layered(d, cover, cover=0.002, core=core))
    driven(d, section.reinforced([-0.04, 0.04], [1e-5, 2e-5], E=8e8, fibres=bars))


@effect(ub.Fibres, ub.Section)
def placed_fibres(d):
    law = ub.ElastoPlastic(d.acts(1e5, 2e5), kinematic=d.acts(3e6, 9e6))
    y, A = [-0.05, 0.0, 0.03, d.acts(0.04, 0.05)], [2e-4, 3e-4, 3e-4, d.acts(1e-4, 2e-4)]
    driven(d, ub.Section.of_fibres(y, A, E=1e8, nu=0.3, rho=1e3, fibres=ub.Fibres(law)))


def scattered(d, limit):
    driven(d, layered(d, ub.Fibres(ub.ElastoPlastic(limit(d), isotropic=6e6), number=4)))


LIMIT, WIDE = (1e5, 2e5), (2e4, 4e4)
effects(
    scattered,
    normal=Drawn(ub.distributions.Normal, LIMIT, (1e4, 2e4), seed=Instead(1, 5)),
    truncated_normal=Drawn(ub.distributions.TruncatedNormal, LIMIT, WIDE, seed=Instead(2, 6)),
    lognormal=Drawn(ub.distributions.Lognormal, LIMIT, WIDE, seed=Instead(3, 7)),
    weibull=Drawn(ub.distributions.Weibull, LIMIT, (4, 8), seed=Instead(4, 8)),
)


@effect(st.MenegottoPinto)
def menegotto_pinto(d):
    law = st.MenegottoPinto(
        d.acts(1e5, 2e5), d.acts(0.02, 0.1), R0=d.acts(10, 20), cR1=d.acts(0.6, 0.8),
        cR2=d.acts(0.1, 0.3), a1=d.acts(0.05, 0.2), a2=d.acts(0.8, 1.5), a3=d.acts(0.05, 0.2),
        a4=d.acts(0.8, 1.5),
    )  # fmt: skip
    driven(d, layered(d, ub.Fibres(law, number=4)))


def concrete(d, law):
    """With bars that yield: without them, cells crush one after the other, and which, is random."""
    bars = ub.Fibres(ub.ElastoPlastic(2e6, kinematic=3e8))
    section = layered(d, ub.Fibres(law, number=4))
    driven(d, section.reinforced([-0.04, 0.04], [5e-5, 5e-5], E=8e8, fibres=bars), size=0.12)


@effect(st.KentPark, seeds={4: 14})
def kent_park(d):
    strength, tension = d.acts(1e5, 2e5), ub.Softening(d.acts(6e4, 1e5), d.acts(400, 900))
    ultimate = d.acts(1.4, 1.8) * 2.4e5 * 2 / 1.2e8
    concrete(d, st.KentPark(strength, d.acts(3e4, 6e4), ultimate, tension))


@effect(st.Mander, seeds={4: 11})
def mander(d):
    strength, tension = d.acts(1e5, 2e5), ub.LinearSoftening(d.acts(6e4, 1e5), d.acts(400, 900))
    strain = d.acts(1.2, 1.5) * 2.4e5 / 1.2e8
    spalling = d.one(lambda: math.inf, lambda: d.acts(2.1, 2.5) * strain)()
    concrete(d, st.Mander(strength, strain, spalling, tension))


# -- hinges ------------------------------------------------------------------------------------


def hinge_in_cells(d, law):
    law, bending = law(d), d.one(None, ub.ElastoPlastic(d.some(5, 6), isotropic=20.0))
    driven(d, ub.Section(**PLAIN, hinge=law, bending=bending))


def hinge_at_a_place(d, law):
    law = law(d)
    driven(d, hinges={d.one(0.0, 1 / 3): law})


def own_softening(d):
    limit, energy = d.acts(4, 7), d.acts(1.0, 3.0)
    return d.one(own.Petersson(limit, energy), own.Rising(limit, energy / (1.5 * limit)))


SOFTENING, LINEAR = (Drawn(x, (4, 7), (1.0, 3.0)) for x in (ub.Softening, ub.LinearSoftening))
effects(
    hinge_in_cells,
    ub.Section,
    softening_in_cells=SOFTENING,
    linear_softening_in_cells=LINEAR,
)
effects(
    hinge_at_a_place,
    ub.Beam,
    schemes=OVER_ANY_STEP,
    softening_at_a_place=SOFTENING,
    linear_softening_at_a_place=LINEAR,
)


@effect(ub.extend.SofteningLaw, ub.Section)
def own_softening_in_cells(d):
    hinge_in_cells(d, own_softening)


@effect(ub.extend.SofteningLaw, ub.Beam, schemes=OVER_ANY_STEP)
def own_softening_at_a_place(d):
    hinge_at_a_place(d, own_softening)


@effect(ub.ElastoPlastic, ub.Beam, schemes=OVER_ANY_STEP)
def hardening_at_a_place(d):
    viscosity = ub.Perzyna(d.one(lambda: 0.0, lambda: d.acts(0.5, 2))())
    numbers = {"isotropic": (5, 20), "kinematic": (5, 20), "viscosity": viscosity}
    hinge_at_a_place(d, Drawn(ub.ElastoPlastic, (3, 5), **numbers))


# -- sections, axes, bodies, motions ---------------------------------------------------------------


@effect(ub.Section)
def section(d):
    """Elastic, also without rotary inertia."""
    numbers = {"EA": d.acts(200, 900), "GA": d.acts(200, 900), "EI": d.acts(50, 150)}
    arm(d, ub.Section(**numbers, rhoA=d.instead(d.some(0.5, 1.5), 2.0) if not d.static else 1.0))


@effect(ub.Beam)
def curved_axis(d):
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


@effect(ub.Body)
def body(d):
    beam = arm(d)
    x, y = beam.end.point
    body = ub.Body((x + d.acts(0.1, 0.2), y + 0.1), mass=d.instead(0.7, 0.9), inertia=0.02)
    d.add("bodies", body)
    if yes_or_no(d):
        d.add("joints", ub.Rigid(beam.end, body.at(x, y)))
    else:
        d.add("joints", ub.Revolute(beam.end, body.at(x, y), multipliers=True))
        turning_spring(d, beam.end, body.middle, 20, 90)
    d.add("loads", ub.PointLoad(body.at(x + 0.3, y), (3.0, -8.0), amplitude=d.wave()))
    d.add("loads", ub.Gravity((0.0, -9.81), d.wave()))


@effect(ub.PointMass)
def point_mass(d):
    beam = arm(d)
    d.add("masses", ub.PointMass(beam.end, d.acts(0.3, 0.9)))
    if not d.static:
        d.add("masses", ub.PointMass(beam.at(1 / 3), d.some(0.3, 0.9), d.acts(0.02, 0.05)))
    d.add("loads", ub.Gravity((3.0, -9.81), d.wave()))


@effect(ub.Velocity, schemes=DYNAMIC)
def velocity(d):
    beam = arm(d, hold=False)
    body = d.add("bodies", ub.Body((1.2, 0.5), mass=0.5, inertia=0.02))
    d.add("joints", ub.RigidLink(beam.end, body.middle))
    linear = d.either_sign(0.5, 2), d.either_sign(0.5, 2)
    angular, about = d.either_sign(2, 4), (d.acts(0.2, 0.5), 0.0)
    d.add("initial", ub.Velocity([beam, body], linear, angular, about=about))


@effect(ub.PrescribedMotion, ub.PrescribedDisplacement, schemes=DYNAMIC)
def impact(d):
    """A rate that jumps: at the beginning, and at a kink of the motion."""
    beam = arm(d)
    times, way = [0.0, d.some(0.04, 0.07), 1.0], d.either_sign(0.02, 0.05)
    moved = ub.Table(times, [0.0, way, way])
    if yes_or_no(d):
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


def meshed(d, mesh):
    varied(d)
    d.mesh = mesh(d)


effects(
    meshed,
    mesh_of_degree_2=Drawn(ub.Mesh, degree=Instead(2, 1), lumped=yes_or_no),
    mesh_of_degree_3=Drawn(ub.Mesh, degree=Instead(3, 2), lumped=yes_or_no),
    refined_mesh=Drawn(ub.Mesh, refine=Instead(2, 1)),
)
effects(meshed, schemes=DYNAMIC, lumped_mass=Drawn(ub.Mesh, lumped=Instead(True, False)))


def of_scheme(d, scheme, other):
    d.scheme = d.instead(scheme, other)
    varied(d)


effects(
    lambda d, scheme: of_scheme(d, scheme(d), ub.EnergyMomentum()),
    static=Drawn(ub.Static),
    energy_momentum_printed=Drawn(ub.EnergyMomentumPrinted),
    energy_momentum=Drawn(ub.EnergyMomentum, some(0.02, 0.1), some(0.05, 0.2)),
)


@effect(ub.EnergyMomentumStatic)
def energy_momentum_static(d):
    of_scheme(d, ub.EnergyMomentumStatic(d.one(1.0, 0.5, 0.7)), ub.EnergyMomentum())
    d.add("damping", ub.KelvinVoigt(5e-3))


@effect(ub.EnergyMomentum)
def fourth_order(d):
    d.scheme = d.instead(ub.EnergyMomentum(order=4), ub.EnergyMomentum())
    _, other = joined(d, ub.Rigid)
    d.add("connectors", ub.Stretch(near(d, 1.3, 1.8), other.end, ub.Spring(d.some(50, 200))))


@effect(ub.EnergyMomentumDecaying)
def energy_momentum_decaying(d):
    d.dt = d.one(0.008, 0.01)
    of_scheme(d, ub.EnergyMomentumDecaying(d.some(0.4, 0.7)), ub.EnergyMomentumDecaying(1.0))


@effect(ub.GeneralizedAlpha)
def generalized_alpha(d):
    of_scheme(d, ub.GeneralizedAlpha(d.some(0.4, 0.9)), ub.GeneralizedAlpha(1.0))


@effect(ub.Newmark)
def newmark(d):
    gamma, more = d.some(0.5, 0.6), d.some(0.0, 0.05)
    of_scheme(d, ub.Newmark(gamma, (gamma + 0.5) ** 2 / 4 + more), ub.Newmark(0.65, 0.4))


@effect(ub.extend.EnergyMomentumBase, ub.extend.MidpointDynamics)
def own_scheme(d):
    of_scheme(d, own.Weighted(d.some(0.52, 0.58)), own.Weighted(0.5))


@effect(ub.Adaptive)
def adaptive(d):
    """Motions after adaptive steps; in the scene that shows that they act, steps are equal."""
    d.scheme = ub.EnergyMomentum()
    steps = ub.Adaptive(
        d.some(1e-4, 3e-4), first=d.some(1e-3, 4e-3), longest=0.02, shortest=1e-9,
        stops=[d.some(0.05, 0.1)],
    )  # fmt: skip
    d.dt = d.instead(steps, d.dt)
    beam = arm(d)
    connected(d, ub.Spring(d.some(50, 200)), beam=beam)


# -- paths -------------------------------------------------------------------------------------


def along_path(d, beam, control, other):
    """A load that grows with the load factor; of another control the path has other steps."""
    load = d.some(-5, 5), -d.some(15, 25)
    d.add("loads", ub.PointLoad(beam.end, force=load, amplitude=lambda t: t))
    d.control = d.instead(control, other)


@effect(ub.LoadControl)
def load_control(d):
    step = d.some(0.02, 0.05)
    along_path(d, arm(d, force=0.0), ub.LoadControl(step), ub.LoadControl(1.1 * step))


@effect(ub.DisplacementControl)
def displacement_control(d):
    beam, step = arm(d, force=0.0), -d.some(0.01, 0.02)
    ends = (ub.DisplacementControl(beam.end, "v", step, end=20.5 * x * step) for x in (1, 1.1))
    along_path(d, beam, *ends)


@effect(ub.ArcLength)
def arc_length(d):
    """A shallow truss of two halves that snaps through."""
    section, rise = ub.Section(**PLAIN), d.some(0.06, 0.1)
    beam = d.add("beams", ub.Beam((0, 0), (1, rise), section, cells=3, name="b0"))
    d.add("supports", ub.Pinned(beam.start), ub.Roller(beam.end, along=(0, 1)))
    step, factor = d.some(0.01, 0.02), d.some(0.5, 2)
    along_path(d, beam, *(ub.ArcLength(x * step, factor=factor) for x in (1, 1.1)))


@effect(ub.DissipationControl)
def dissipation_control(d):
    """It hardens: where it softens, lengths of steps depend on numbers of iterations."""
    law = ub.ElastoPlastic(d.some(2, 4), isotropic=d.some(10, 30))
    beam = arm(d, ub.Section(**PLAIN, bending=law), force=0.0)
    step, elastic = d.some(0.01, 0.02), ub.ArcLength(0.03)
    controls = (ub.DissipationControl(x * step, otherwise=elastic) for x in (1, 1.1))
    along_path(d, beam, *controls)
