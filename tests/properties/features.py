# SPDX-License-Identifier: MIT
"""Features of models that combinations draw, each a function that writes into a draft.

A feature takes the slots that it names, which no other feature of a combination may take.  Sizes
are of beams of about 1 m with EA = 1e4 N, GA = 4e3 N, EI = 100 N m2 and 1 kg/m, under forces of
some tens of N, so that yielding moments are some N m and the lowest periods some 0.1 s.
"""

from collections.abc import Callable
from dataclasses import dataclass

EA, GA, EI = 1e4, 4e3, 100.0
PLAIN = "EA=1e4, GA=4e3, EI=100.0, rhoA=1.0, rhoI=0.01"

SECTION = ("section",)
"""Slot of a section that yields or breaks."""


@dataclass(frozen=True)
class Feature:
    """A feature; `statics`, `at_end`: whether static schemes, and those at ends of steps, allow it.

    Attributes:
        elastic: Whether motions are those of an elastic scene without friction and controls.
    """

    name: str
    write: Callable
    slots: tuple = ()
    statics: bool = True
    dynamics: bool = True
    at_end: bool = True
    elastic: bool = True


FEATURES: list[Feature] = []


def feature(*slots, **options):
    """Add a function to the features."""

    def add(function):
        FEATURES.append(Feature(function.__name__, function, slots, **options))
        return function

    return add


def bulk_law(d, limit, stiffness):
    """A law that yields at about a limit."""
    k = stiffness * d.some(0.02, 0.2)
    return d.one([
        f"ub.ElastoPlastic({limit:.4g}, isotropic={k:.4g})",
        f"ub.ElastoPlastic({limit:.4g}, kinematic={k:.4g})",
        f"ub.ElastoPlastic({limit:.4g}, isotropic={k:.4g}, kinematic={k:.4g})",
    ])  # fmt: skip


def own_softening(d, limit, energy):
    """A softening law of one's own with about a limit and an energy."""
    return d.one([
        f"Petersson({limit:.4g}, {energy:.4g})",
        f"Rising({limit:.4g}, {energy / (1.5 * limit):.4g})",
    ])  # fmt: skip


# -- sections ----------------------------------------------------------------------------------


@feature("any section")
def shape(d):
    E, rho = (
        1.2e10 if d.column else 1.2e8,
        1.2e4,
    )  # EI and mass as the plain section has them, in order of size
    d.section(0, d.one([
        f"ub.Section.rectangle(0.01, 0.1, E={E}, nu=0.3, rho={rho / 12:.6g})",
        f"ub.Section.circle(0.05, E={3 * E}, nu=0.3, rho={rho / 24:.6g})",
        f"ub.Section.tube(0.08, 0.005, E={E / 2}, nu=0.3, rho={rho / 15:.6g})",
        f"st.i_shape(0.08, 0.05, 0.004, 0.006, E={E / 4}, nu=0.3, rho={rho / 12:.6g})",
        f"st.box(0.06, 0.08, 0.003, 0.006, E={E}, nu=0.3, rho={rho / 9:.6g})",
        f"st.channel(0.1, 0.06, 0.004, 0.006, 0.005, E={3 * E}, nu=0.3, "
        f"rho={rho / 12:.6g}, axis='weak')",
        f"st.t_shape(0.08, 0.05, 0.004, 0.006, E={2 * E}, nu=0.3, rho={rho / 7:.6g})",
        f"st.steel('IPE 80', E={E}, rho={rho / 9:.6g})",
        "ub.Section.of_shape(st.Shape([(-0.01, 0), (0.01, 0), (0.005, 0.1), (-0.005, 0.1)]), "
        f"shear_factor=0.8, E={E}, nu=0.3, rho={rho / 18:.6g})",
    ]))  # fmt: skip


@feature("section", "any section", elastic=False)
def hardening(d):
    d.yields(0, f"bending={bulk_law(d, d.some(3, 10), EI)}")


@feature("section", "any section", elastic=False)
def axial_and_shear(d):
    d.yields(0, f"axial={bulk_law(d, d.some(8, 30), EA)}, shear={bulk_law(d, d.some(8, 30), GA)}")


@feature("section", "any section", elastic=False)
def perzyna(d):
    law = f"{d.some(3, 8):.4g}, kinematic=5.0, viscosity=ub.Perzyna({d.some(0.5, 5):.4g})"
    d.yields(0, f"bending=ub.ElastoPlastic({law})")


@feature("section", "any section", elastic=False)
def duvaut_lions(d):
    law = f"{d.some(3, 8):.4g}, isotropic=5.0, viscosity=ub.DuvautLions({d.some(0.01, 0.1):.4g})"
    d.yields(0, f"bending=ub.ElastoPlastic({law})")


@feature("section", "any section", elastic=False)
def hysteresis(d):
    M = d.some(4, 10)
    # with or without an axial law of another class
    axial = f"axial=ub.ElastoPlastic({4 * M:.4g}, isotropic={EA / 20:.4g}), "
    d.yields(0, d.one(["", axial]) + "bending=" + d.one([
        f"st.RambergOsgood({M:.4g}, {d.some(0.02, 0.1):.4g}, {d.some(2, 6):.3g})",
        f"st.ArmstrongFrederick({M:.4g}, {d.some(5, 20):.4g}, {d.some(0.5, 4):.4g})",
        f"st.BoucWen({M:.4g}, {d.some(0.02, 0.3):.3g}, {d.some(1, 4):.3g})",
    ]))  # fmt: skip


@feature("section", "any section", elastic=False)
def own_law(d):
    d.yields(0, "bending=" + d.one([
        f"Dashpot({d.some(5, 50):.4g})",
        f"PowerLaw({d.some(4, 10):.4g}, 0.05, {d.some(2, 5):.3g})",
    ]))  # fmt: skip


@feature("section", "any section", elastic=False)
def interaction(d):
    d.yields(0, f"interaction=st.AxialBending({d.some(15, 60):.4g}, {d.some(4, 10):.4g})")


@feature("section", "any section", elastic=False)
def hinge_in_cells(d):
    kind = d.one(["Softening", "LinearSoftening"])
    more = d.one(["", "", f", bending={bulk_law(d, d.some(3, 6), EI)}"])
    d.yields(0, f"hinge=ub.{kind}({d.some(5, 9):.4g}, {d.some(2, 9):.4g}){more}")


@feature("section", "any section", elastic=False)
def own_hinge_in_cells(d):
    d.yields(0, f"hinge={own_softening(d, d.some(5, 9), d.some(2, 9))}")


@feature("section", "any section", elastic=False)
def fibres(d):
    mean = d.some(4e4, 1e5)
    limit = d.one([
        f"ub.distributions.Normal({mean:.5g}, {mean / 8:.5g}, seed=1)",
        f"ub.distributions.TruncatedNormal({mean:.5g}, {mean / 5:.5g}, seed=2)",
        f"ub.distributions.Lognormal({mean:.5g}, {mean / 5:.5g}, seed=3)",
        f"ub.distributions.Weibull({mean:.5g}, 6.0, seed=4)",
    ])  # fmt: skip
    crack = d.one(["", f", softening=ub.Softening({1.5 * mean:.5g}, {mean / 500:.5g})"])
    law = f"ub.Fibres(ub.ElastoPlastic({limit}, isotropic=6e6), number=4{crack})"
    shapes = [
        f"ub.Section.rectangle(0.01, 0.1, E=1.2e8, nu=0.3, rho=1e3, fibres={law})",
        f"ub.Section.of_fibres([-0.05, 0.0, 0.03, 0.06], [2e-4, 3e-4, 3e-4, 2e-4], E=8e7, "
        f"nu=0.3, rho=1e3, fibres={law.replace(', number=4', '')})",
        # laws of several classes: two with cracks at different limits, and bars
        f"ub.Section.rectangle(0.01, 0.1, E=1.2e8, nu=0.3, rho=1e3, fibres={law}, cover=0.002, "
        f"core=ub.Fibres(st.RambergOsgood({mean:.5g}, 1e-4, 3.0), softening=ub.LinearSoftening("
        f"{2 * mean:.5g}, {mean / 300:.5g}))).reinforced([-0.04, 0.04], [1e-5, 2e-5], E=8e8, "
        f"fibres=ub.Fibres(st.ArmstrongFrederick({3 * mean:.5g}, 1e8, 100.0)))",
        f"st.t_shape(0.1, 0.03, 0.008, 0.02, E=1.2e8, nu=0.3, rho=1e3, fibres={law}, "
        f"cover=0.002, core=ub.Fibres(ub.ElastoPlastic({2 * mean:.5g}))).reinforced([-0.04], "
        f"[1e-5], E=8e8, fibres=ub.Fibres(st.RambergOsgood({3 * mean:.5g}, 1e-4, 3.0)))",
    ]
    d.section(0, d.one(shapes))


@feature("section", "any section", elastic=False)
def fibres_of_steel_or_concrete(d):
    strength, limit = d.some(2e5, 4e5), d.some(1e5, 2e5)
    kind, energy = d.one(["Softening", "LinearSoftening"]), d.some(300, 900)
    tension = f"tension=ub.{kind}({limit:.5g}, {energy:.4g})"
    law = d.one([
        f"st.MenegottoPinto({limit / 2:.5g}, {d.some(0.02, 0.2):.3g}, a1=0.1, a3=0.05)",
        f"st.KentPark({strength:.5g}, {strength / 3:.5g}, {strength / 2e7:.4g}, {tension})",
        f"st.Mander({strength:.5g}, {strength / 6e7:.4g}, {tension})",
    ])  # fmt: skip
    fibres = f"ub.Fibres({law}, number=4)"
    d.section(0, f"ub.Section.rectangle(0.01, 0.1, E=1.2e8, nu=0.3, rho=1e3, fibres={fibres})")


@feature("hinges", elastic=False)
def hinges(d):
    M, place = d.some(3, 9), d.one([0.0, 0.0, 0.5])
    d.beams[0]["hinges"] = f"{{{place}: " + d.one([
        f"ub.Softening({M:.4g}, {d.some(1, 8):.4g})",
        f"ub.LinearSoftening({M:.4g}, {d.some(2, 9):.4g})",
        f"ub.ElastoPlastic({M:.4g}, isotropic={d.some(5, 30):.4g})",
    ]) + "}"  # fmt: skip


@feature("hinges", elastic=False)
def own_hinges(d):
    d.beams[0]["hinges"] = f"{{0.0: {own_softening(d, d.some(3, 9), d.some(2, 9))}}}"


# -- axes, joints, supports --------------------------------------------------------------------


@feature("axis", "hinges")
def curved(d):
    d.beams[0]["kind"] = d.one(["arc", "polyline", "along"])


@feature("joint")
def revolute(d):
    d.need_beams(2)
    multipliers = d.one(["", ", multipliers=True"])
    d.joint = f"ub.Revolute({{a}}, {{b}}{multipliers})"
    d.connectors.append(f"ub.Turn(b0.end, b1.start, ub.Spring({d.some(20, 100):.4g}))")


@feature("joint")
def multipliers(d):
    d.need_beams(2)
    d.joint = "ub.Rigid({a}, {b}, multipliers=True)"


@feature("joint")
def prismatic(d):
    d.need_beams(2)
    d.joint = f"ub.Prismatic({{a}}, {{b}}, axis=({d.some(-1, 1):.3f}, 1.0))"
    axis = d.joint.split("axis=")[1][:-1]
    d.connectors.append(
        f"ub.Slide(b0.end, b1.start, ub.Spring({d.some(100, 900):.4g}), axis={axis})"
    )


@feature("joint")
def slot(d):
    d.need_beams(2)
    d.joint = "ub.Prismatic({a}, {b}, axis=(0.3, 1.0), turning=True)"
    d.connectors.append("ub.Slide(b0.end, b1.start, ub.Spring(400.0), axis=(0.3, 1.0))")
    d.connectors.append(f"ub.Turn(b0.end, b1.start, ub.Spring({d.some(20, 100):.4g}))")


@feature("joint")
def rigid_link(d):
    d.need_beams(2, apart=True)
    d.joint = "ub.RigidLink({a}, {b})"


@feature("joint")
def release(d):
    d.need_beams(2)
    free = d.one(["N", "V", "M"])
    d.joint = f"ub.Release({{a}}, {{b}}, free='{free}'{d.one(['', ', multipliers=True'])})"
    k = d.some(50, 300)
    if free == "M":
        d.connectors.append(f"ub.Turn(b0.end, b1.start, ub.Spring({k:.4g}))")
    else:
        axis = "b0.end.direction" if free == "N" else "(-b0.end.direction[1], b0.end.direction[0])"
        d.connectors.append(f"ub.Slide(b0.end, b1.start, ub.Spring({k:.4g}), axis={axis})")


@feature("tip")
def connector(d):
    x, y = d.tip
    d.joints.append(f"ub.Link(ub.ground({x - 0.4:.3f}, {y - 0.9:.3f}), {d.last}.end)")


@feature("tip")
def guided(d):
    x, y = d.tip
    bend = d.some(-0.5, 0.5)
    curve = f"lambda s: ({x!r} + 0.4 * s, {y!r} + s + {bend:.3f} * s**2)"
    if bend > 0:  # without another random number
        s = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
        curve = f"ub.Spline([({curve})(s) for s in {s}], {s})"
    d.joints.append(f"ub.Guided({d.last}.end, {curve})")


@feature("tip")
def roller(d):
    d.supports.append(f"ub.Roller({d.last}.end, along=({d.some(-1, 1):.3f}, 1.0))")


@feature("tip")
def propped(d):
    along = (1.0, 0.0) if d.column else (1.0, 0.3)
    d.supports.append(f"ub.Roller({d.last}.end, along={along})")


@feature("tip")
def moved_tip(d):
    component, size = d.one([("u", 0.05), ("v", 0.1), ("psi", 0.3)])
    along = d.one(["", ", along=(1.0, 0.4)"]) if component != "psi" else ""
    way = f"ub.Table([0.0, {d.end / 2:.4g}, {d.end:.4g}], [0.0, {size}, {-size / 2}])"
    if not d.static:  # kinks of motions are blows, of which the energy does not converge
        way = f"lambda t: {size} * (1.0 - math.cos({d.some(2, 6) / d.end:.4g} * t))"
    d.supports.append(f"ub.PrescribedDisplacement({d.last}.end, {component}={way}{along})")


@feature("root")
def pinned(d):
    d.root = "ub.Pinned({place})"
    d.connectors.append(f"ub.Turn(ub.ground(0, 0), b0.start, ub.Spring({d.some(100, 500):.4g}))")


@feature("root")
def shaken(d):
    ω = d.some(2, 6) / d.end
    motion = f"lambda t: 0.03 * (1.0 - math.cos({ω:.4g} * t))"
    if d.one([True, False]):
        values = ", ".join(f"{d.some(-0.3, 0.3) / d.end**2:.3f}" for _ in range(8))
        d.lines.append(f"quake = st.GroundMotion({d.end / 10:.4g}, [0.0, {values}, 0.0])")
        motion = "quake.displacement"
    d.root = f"ub.PrescribedDisplacement({{place}}, {d.one(['u', 'v', 'psi'])}={motion}, {{rest}})"


@feature("root", "tip", "free", statics=False)
def free_flight(d):
    d.root = None
    d.initial.append(
        f"ub.Velocity([{{moving}}], linear=({d.some(-2, 2):.3f}, 1.0), "
        f"angular={d.some(-4, 4):.3f}, about=(0.0, 0.0))"
    )


@feature("body")
def body(d):
    x, y = d.tip
    cx, cy = x + d.some(0.05, 0.2), y + d.some(-0.1, 0.1)
    d.bodies.append(f"body = ub.Body(({cx:.4f}, {cy:.4f}), mass=0.7, inertia=0.02, name='body')")
    spring = f"ub.Turn({d.last}.end, body.middle, ub.Spring({d.some(20, 90):.4g}))"
    if d.one([True, False]):
        d.joints.append(f"ub.Rigid({d.last}.end, body.at({x!r}, {y!r}))")
    else:
        d.joints.append(f"ub.Revolute({d.last}.end, body.at({x!r}, {y!r}))")
        d.connectors.append(spring)
    d.loads.append(f"ub.PointLoad(body.middle, force=(0.0, -5.0), amplitude={d.time()})")
