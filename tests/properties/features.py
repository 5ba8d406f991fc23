# SPDX-License-Identifier: MIT
"""Features of models that combinations draw: functions that write features by name into a draft.

A feature takes the slots that it names, which no other feature of a combination may take.  Sizes
are of beams of about 1 m with EA = 1e4 N, GA = 4e3 N, EI = 100 N m2 and 1 kg/m, under forces of
some tens of N, so that yielding moments are some N m and the lowest periods some 0.1 s.

Texts are Python source with random parts: ``<1 5>`` is a number between 1 and 5, perhaps with a
format, as in ``<1 5 .3f>``; ``[[a|b]]`` is one of two texts; ``LAST`` is the last beam, ``TIP`` its
end and ``TIME`` a function of time.
"""

from collections.abc import Callable
from dataclasses import dataclass

EA, GA, EI = 1e4, 4e3, 100.0
PLAIN = "EA=1e4, GA=4e3, EI=100.0, rhoA=1.0, rhoI=0.01"

WITHOUT_STATICS = {
    "free_flight", "damper", "damped_stop", "coulomb", "rubbing_pin", "force_law_with_history",
    "connector_law_with_history", "cushion", "rough_clearance", "brake", "rayleigh", "adaptive",
}  # fmt: skip
"""Features that static schemes do not allow."""

OVER_STEPS = {"coulomb", "rubbing_pin", "brake", "rigid_plastic", "rotating_frame"}
"""Features that schemes with forces at the ends of steps do not allow."""

INELASTIC = {
    "hardening", "axial_and_shear", "perzyna", "duvaut_lions", "hysteresis", "own_law",
    "interaction", "hinge_in_cells", "own_hinge_in_cells", "fibres", "fibres_of_steel_or_concrete",
    "hinges", "own_hinges", "spring_yields", "spring_breaks", "own_law_of_breaking", "stop",
    "damped_stop", "coulomb", "rubbing_pin", "controller", "integral_controller",
    "force_law_with_history", "connector_law_with_history", "clearance", "rough_clearance",
    "brake", "rigid_plastic", "axial_bending_hinge", "deteriorating",
}  # fmt: skip
"""Features whose motions are not those of an elastic scene without friction and controls."""


@dataclass(frozen=True)
class Feature:
    """A feature, a function of a draft and its name, and the slots that it takes."""

    name: str
    write: Callable
    slots: tuple = ()

    @property
    def elastic(self):
        return self.name not in INELASTIC

    def allows(self, static, at_end):
        """Whether static schemes, or schemes with forces at the ends of steps, allow it."""
        forbidden = WITHOUT_STATICS if static else OVER_STEPS if at_end else ()
        return self.name not in forbidden


def bulk_law(d, limit, stiffness):
    """A law that yields at about a limit."""
    k = f"{stiffness * d.some(0.02, 0.2):.4g}"
    moduli = d.one([f"isotropic={k}", f"kinematic={k}", f"isotropic={k}, kinematic={k}"])
    return f"ub.ElastoPlastic({limit:.4g}, {moduli})"


def own_softening(d, limit, energy):
    """A softening law of one's own with about a limit and an energy."""
    rising = f"Rising({limit:.4g}, {energy / (1.5 * limit):.4g})"
    return d.one([f"Petersson({limit:.4g}, {energy:.4g})", rising])


# -- sections ----------------------------------------------------------------------------------


def shapes(d, name):
    E, rho = 1.2e10 if d.column else 1.2e8, 1.2e4  # EI and mass of the plain section, in order
    d.sections[0] = d.one([
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
    ])  # fmt: skip


def laws_of_resultants(d, name):
    match name:
        case "hardening":
            law = f"bending={bulk_law(d, d.some(3, 10), EI)}"
        case "axial_and_shear":
            axial, shear = (bulk_law(d, d.some(8, 30), stiffness) for stiffness in (EA, GA))
            law = f"axial={axial}, shear={shear}"
        case "perzyna":
            law = "bending=ub.ElastoPlastic(<3 8>, kinematic=5.0, viscosity=ub.Perzyna(<0.5 5>))"
        case "duvaut_lions":
            viscosity = "ub.DuvautLions(<0.01 0.1>)"
            law = f"bending=ub.ElastoPlastic(<3 8>, isotropic=5.0, viscosity={viscosity})"
        case "hysteresis":  # with or without an axial law of another class
            M = d.some(4, 10)
            axial = d.one(["", f"axial=ub.ElastoPlastic({4 * M:.4g}, isotropic=500), "])
            law = f"{axial}bending=" + d.one_text(
                f"st.RambergOsgood({M:.4g}, <0.02 0.1>, <2 6 .3g>)",
                f"st.ArmstrongFrederick({M:.4g}, <5 20>, <0.5 4>)",
                f"st.BoucWen({M:.4g}, <0.02 0.3 .3g>, <1 4 .3g>)",
            )
        case "own_law":
            law = "bending=" + d.one_text("Dashpot(<5 50>)", "PowerLaw(<4 10>, 0.05, <2 5 .3g>)")
        case "interaction":
            law = "interaction=st.AxialBending(<15 60>, <4 10>)"
        case "hinge_in_cells":
            kind = d.one(["Softening", "LinearSoftening"])
            more = d.one(["", "", f", bending={bulk_law(d, d.some(3, 6), EI)}"])
            law = f"hinge=ub.{kind}(<5 9>, <2 9>){more}"
        case "own_hinge_in_cells":
            law = f"hinge={own_softening(d, d.some(5, 9), d.some(2, 9))}"
    d.sections[0] = d.text(f"ub.Section({PLAIN}, {law})")


RECTANGLE = "ub.Section.rectangle(0.01, 0.1, E=1.2e8, nu=0.3, rho=1e3"


def laws_of_fibres(d, name):
    mean = d.some(4e4, 1e5)
    limit = d.one([
        f"ub.distributions.Normal({mean:.5g}, {mean / 8:.5g}, seed=1)",
        f"ub.distributions.TruncatedNormal({mean:.5g}, {mean / 5:.5g}, seed=2)",
        f"ub.distributions.Lognormal({mean:.5g}, {mean / 5:.5g}, seed=3)",
        f"ub.distributions.Weibull({mean:.5g}, 6.0, seed=4)",
    ])  # fmt: skip
    crack = d.one(["", f", softening=ub.Softening({1.5 * mean:.5g}, {mean / 500:.5g})"])
    law = f"ub.Fibres(ub.ElastoPlastic({limit}, isotropic=6e6), number=4{crack})"
    d.sections[0] = d.one([
        f"{RECTANGLE}, fibres={law})",
        f"ub.Section.of_fibres([-0.05, 0.0, 0.03, 0.06], [2e-4, 3e-4, 3e-4, 2e-4], E=8e7, "
        f"nu=0.3, rho=1e3, fibres={law.replace(', number=4', '')})",
        # laws of several classes: two with cracks at different limits, and bars
        f"{RECTANGLE}, fibres={law}, cover=0.002, "
        f"core=ub.Fibres(st.RambergOsgood({mean:.5g}, 1e-4, 3.0), softening=ub.LinearSoftening("
        f"{2 * mean:.5g}, {mean / 300:.5g}))).reinforced([-0.04, 0.04], [1e-5, 2e-5], E=8e8, "
        f"fibres=ub.Fibres(st.ArmstrongFrederick({3 * mean:.5g}, 1e8, 100.0)))",
        f"st.t_shape(0.1, 0.03, 0.008, 0.02, E=1.2e8, nu=0.3, rho=1e3, fibres={law}, "
        f"cover=0.002, core=ub.Fibres(ub.ElastoPlastic({2 * mean:.5g}))).reinforced([-0.04], "
        f"[1e-5], E=8e8, fibres=ub.Fibres(st.RambergOsgood({3 * mean:.5g}, 1e-4, 3.0)))",
    ])  # fmt: skip


def laws_of_steel_or_concrete(d, name):
    strength, limit = d.some(2e5, 4e5), d.some(1e5, 2e5)
    kind, energy = d.one(["Softening", "LinearSoftening"]), d.some(300, 900)
    tension = f"tension=ub.{kind}({limit:.5g}, {energy:.4g})"
    law = d.one_text(
        f"st.MenegottoPinto({limit / 2:.5g}, <0.02 0.2 .3g>, a1=0.1, a3=0.05)",
        f"st.KentPark({strength:.5g}, {strength / 3:.5g}, {strength / 2e7:.4g}, {tension})",
        f"st.Mander({strength:.5g}, {strength / 6e7:.4g}, {tension})",
    )
    d.sections[0] = f"{RECTANGLE}, fibres=ub.Fibres({law}, number=4))"


def hinges(d, name):
    M, place = d.some(3, 9), "0.0"
    if name == "own_hinges":
        law = own_softening(d, M, d.some(2, 9))
    else:
        place, softening = d.one([0.0, 0.0, 0.5]), f"Softening({M:.4g}"
        law = d.one_text(
            f"ub.{softening}, <1 8>)", f"ub.Linear{softening}, <2 9>)",
            f"ub.ElastoPlastic({M:.4g}, isotropic=<5 30>)",
        )  # fmt: skip
    d.beams[0]["hinges"] = f"{{{place}: {law}}}"


# -- axes, joints, supports --------------------------------------------------------------------


def axes(d, name):
    d.beams[0]["kind"] = d.text("[[arc|polyline|along]]")


def joints(d, name):
    """A joint of two beams, and connectors between its places."""
    d.need_beams(2, apart=name == "rigid_link")
    match name:
        case "revolute":
            d.joint = d.text("ub.Revolute({a}, {b}[[|, multipliers=True]])")
            connectors = ["Turn: ub.Spring(<20 100>)"]
        case "multipliers":
            d.joint, connectors = "ub.Rigid({a}, {b}, multipliers=True)", []
        case "prismatic":
            axis = d.text("axis=(<-1 1 .3f>, 1.0)")
            d.joint = f"ub.Prismatic({{a}}, {{b}}, {axis})"
            connectors = [f"Slide: ub.Spring(<100 900>), {axis}"]
        case "slot":
            d.joint = "ub.Prismatic({a}, {b}, axis=(0.3, 1.0), turning=True)"
            connectors = ["Slide: ub.Spring(400.0), axis=(0.3, 1.0)", "Turn: ub.Spring(<20 100>)"]
        case "rigid_link":
            d.joint, connectors = "ub.RigidLink({a}, {b})", []
        case "release":
            free = d.text("[[N|V|M]]")
            d.joint = d.text(f"ub.Release({{a}}, {{b}}, free='{free}'[[|, multipliers=True]])")
            axis = "b0.end.direction" if free == "N" else ACROSS
            slide = f"Slide: ub.Spring(<50 300>), axis={axis}"
            connectors = ["Turn: ub.Spring(<50 300>)" if free == "M" else slide]
        case "rubbing_pin":
            d.joint = "ub.Revolute({a}, {b}, multipliers=True)"
            connectors = ["Turn: ub.Coulomb(<0.05 0.3>, coefficient=0.02, joint=joint)"]
        case "motor":
            ω = d.some(2, 6) / d.end
            way = f"<0.05 0.4 .3f> * (1.0 - math.cos({ω:.4g} * t))"
            d.joint = "ub.Revolute({a}, {b})"
            connectors = [f"Turn: ub.PrescribedMotion(lambda t: {way})"]
    for text in connectors:
        kind, law = text.split(": ", 1)
        d.connectors.append(d.text(f"ub.{kind}(b0.end, b1.start, {law})"))


ACROSS = "(-b0.end.direction[1], b0.end.direction[0])"


def at_the_tip(d, name):
    x, y = d.tip
    match name:
        case "connector":
            d.joints.append(f"ub.Link(ub.ground({x - 0.4:.3f}, {y - 0.9:.3f}), {d.last}.end)")
        case "guided":
            bend = d.some(-0.5, 0.5)
            curve = f"lambda s: ({x!r} + 0.4 * s, {y!r} + s + {bend:.3f} * s**2)"
            if bend > 0:  # without another random number
                s = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
                curve = f"ub.Spline([({curve})(s) for s in {s}], {s})"
            d.joints.append(f"ub.Guided({d.last}.end, {curve})")
        case "roller":
            d.supports.append(d.text("ub.Roller(TIP, along=(<-1 1 .3f>, 1.0))"))
        case "propped":
            d.supports.append(f"ub.Roller({d.last}.end, along=(1.0, {0.0 if d.column else 0.3}))")
        case "moved_tip":
            component, size = d.one([("u", 0.05), ("v", 0.1), ("psi", 0.3)])
            along = d.one(["", ", along=(1.0, 0.4)"]) if component != "psi" else ""
            way = f"ub.Table([0.0, {d.end / 2:.4g}, {d.end:.4g}], [0.0, {size}, {-size / 2}])"
            if not d.static:  # kinks of motions are blows, of which the energy does not converge
                way = f"lambda t: {size} * (1.0 - math.cos({d.some(2, 6) / d.end:.4g} * t))"
            d.supports.append(f"ub.PrescribedDisplacement({d.last}.end, {component}={way}{along})")


def at_the_root(d, name):
    match name:
        case "pinned":
            d.root = "ub.Pinned({place})"
            d.connectors.append(d.text("ub.Turn(ub.ground(0, 0), b0.start, ub.Spring(<100 500>))"))
        case "shaken":
            motion = f"lambda t: 0.03 * (1.0 - math.cos({d.some(2, 6) / d.end:.4g} * t))"
            if d.one([True, False]):
                values = ", ".join(f"{d.some(-0.3, 0.3) / d.end**2:.3f}" for _ in range(8))
                d.lines.append(f"quake = st.GroundMotion({d.end / 10:.4g}, [0.0, {values}, 0.0])")
                motion = "quake.displacement"
            d.root = d.text(f"ub.PrescribedDisplacement({{place}}, [[u|v|psi]]={motion}, {{rest}})")
        case "free_flight":
            d.root = None
            motion = "linear=(<-2 2 .3f>, 1.0), angular=<-4 4 .3f>, about=(0.0, 0.0)"
            d.initial.append(d.text(f"ub.Velocity([{{moving}}], {motion})"))


def bodies(d, name):
    x, y = d.tip
    middle = f"{x + d.some(0.05, 0.2):.4f}, {y + d.some(-0.1, 0.1):.4f}"
    d.bodies.append(f"body = ub.Body(({middle}), mass=0.7, inertia=0.02, name='body')")
    spring = d.text("ub.Turn(TIP, body.middle, ub.Spring(<20 90>))")
    joint = d.one(["Rigid", "Revolute"])
    d.joints.append(f"ub.{joint}({d.last}.end, body.at({x!r}, {y!r}))")
    d.connectors += [spring] if joint == "Revolute" else []
    d.loads.append(d.text("ub.PointLoad(body.middle, force=(0.0, -5.0), amplitude=TIME)"))


# -- connectors --------------------------------------------------------------------------------

LAWS = {
    "spring": "ub.Spring(<50 300>)",
    "spring_breaks": "ub.Spring(200.0, softening=ub.[[Softening|LinearSoftening]](<1 5>, <0.5 2>))",
    "damper": "ub.Damper(<0.2 3>)",
    "stop": "ub.Stop(<200 900>, low=-0.01, high=<0.005 0.02>)",
    "damped_stop": "ub.Stop(<200 900>, high=<0.005 0.02>, damping=<0.1 3 .3g>)",
    "coulomb": "ub.Coulomb(<0.2 2>)",
    "actuator": "ub.PrescribedForce(lambda t: <2 9 .3f> * math.sin(60 * t))",
    "controller": "ub.Controller(lambda now: <1 5 .3f> * math.sin(60 * now.t))",
    "force_law_with_history": "ub.ForceLaw(Maxwell(<50 200>, <0.02 0.1>), state=[0.0])",
    "connector_law": "Stiffening(<50 200>, <500 3000>)",
    "connector_law_with_history": "Relaxing(<50 200>, <0.02 0.1>, <0.1 2>)",
}
TO_TIP = "ub.Bushing(ub.ground(0.2, 0.7), TIP, {}, axis=(0.3, 1.0))"
CLEARANCE = "ub.Clearance(<300 900>, gap=<0.002 0.01>"
RIGID_PLASTIC = "ub.RigidPlastic(ub.ElastoPlastic(<1 4>, isotropic=<50 200>))"
BUSHINGS = {
    "cushion": "Cushion(<50 200>, <0.02 0.1>, <0.1 2>)",
    "clearance": f"{CLEARANCE})",
    "rough_clearance": f"{CLEARANCE}, damping=1.0, friction=<0.1 0.5 .3g>, radius=0.02)",
    "axial_bending_hinge": "st.AxialBendingHinge(<2 20>, <0.5 3>, <300 900>, 500.0, 100.0)",
}


def connectors(d, name):
    """A connector, or a connector of a law between the ground and a place."""
    law, whole, (x, y) = LAWS.get(name), None, d.tip
    match name:
        case "side_spring":
            law = "ub.Spring(<50 300>), axis=(0.0, 1.0)"
            whole = f"ub.Slide(ub.ground({x!r}, {y!r}), TIP, {law})"
        case "integral_controller":
            law = "ub.Controller(Integral(b0.end, <0.5 2 .3f>))"
            whole = f"ub.Turn(ub.ground(0, 0), b0.end, {law})"
        case "rigid_plastic":
            place = "ub.ground(0.2, 0.7), LAST.at(0.5)"
            whole = f"ub.Slide({place}, {RIGID_PLASTIC}, axis=(0.3, 1.0))"
        case "cushion":
            whole = TO_TIP.replace("TIP", "[[LAST.at(0.5)|b0.end]]").format(BUSHINGS[name])
        case "clearance" | "rough_clearance" | "axial_bending_hinge":
            whole = TO_TIP.format(BUSHINGS[name])
        case "spring_yields":
            law = f"ub.Spring(200.0, law={bulk_law(d, d.some(0.5, 4), 200.0)})"
        case "own_law_of_breaking":
            law = own_softening(d, d.some(1, 5), d.some(0.5, 2))
            law = d.one([f"ub.Spring(200.0, softening={law})", f"ub.RigidPlastic({law})"])
        case "force_law":
            d.lines.append(d.text("cubic = Cubic(<50 200>, <500 3000>)"))
            law = "ub.ForceLaw(cubic[[|, stored=cubic.energy]])"
        case "brake":
            rest = d.some(0.3, 2)
            law = f"Brake({rest:.4g}, {rest * d.some(0.5, 1):.4g}, <0.02 0.2>)"
        case "deteriorating":
            law = deteriorating(d)
    if whole is None:
        law, kind, place = d.text(law), d.one("SLT"), d.one(["LAST.at(0.5)", "b0.end"])
        far = f"ub.ground({x + 0.5:.3f}, {y + 0.8:.3f})"
        whole = {
            "T": f"ub.Turn(ub.ground(0, 0), {place}, {law})",
            "S": f"ub.Stretch({far}, {place}, {law})",
            "L": f"ub.Slide(ub.ground(0.2, 0.7), {place}, {law}, axis=(0.3, 1.0))",
        }[kind]
    d.connectors.append(d.text(whole))


def deteriorating(d):
    M, k, n = d.some(1, 4), 200.0, d.one([1, 1.3, 2])
    plus, minus = (
        f"st.Backbone({M * f:.4g}, {d.some(1, 4) * M / k:.4g}, {d.some(4, 30) * M / k:.4g}, "
        f"{d.some(1, 1.2):.3g}, {d.some(0, 0.5):.3g}, {d.some(20, 60) * M / k:.4g})"
        for f in (1, d.some(0.7, 1))
    )
    E = [f"{d.some(5, 50) * M / k:.4g}" for _ in range(3)]
    kind, more = "IbarraKrawinkler", ""
    if d.one([True, False]):
        kind, more = "PinchingHinge", f", <0.2 1 .3g>, <0 1 .3g>, {E[1]}"
    return f"st.{kind}({k}, {plus}, {minus}, {', '.join(E)}, {n}{more})"


# -- loads, works, masses, damping -------------------------------------------------------------

WEAK, MASS = "(<-15 15 .3f>, <-15 15 .3f>)", ", mass=0.5"
PROFILES = (
    "", ", span=(0.25, 0.75)", ", profile=(1.5, -0.5)", ", span=(0.0, 0.5), profile=(0.0, 2.0)",
    ", profile=lambda s: 1 - 4 * (s - 0.5) ** 2",
)  # fmt: skip


def loads(d, name):
    match name:
        case "follower":
            text = f"FollowerLoad(TIP, force={WEAK}, moment=<-2 2 .3f>, amplitude=TIME)"
        case "moment":
            text = "PointLoad(LAST.at(0.5), moment=<-6 6 .3f>, amplitude=TIME)"
        case "line_load":
            more = d.one_text("", ", moment=<-2 2 .3f>") + d.one(PROFILES)
            text = f"LineLoad(b0, force=(<-20 20 .3f>, <-20 20 .3f>){more}, amplitude=TIME)"
        case "imposed_strain":
            strain = d.one_text(
                "axial=<-1e-3 1e-3 .3e>, span=(0.25, 0.75)",
                "axial=(0.0, <-1e-3 1e-3 .3e>), curvature=<-5e-2 5e-2 .3e>",
                "curvature=lambda s: <-5e-2 5e-2 .3e> * (1 - s**2), shear=1e-4",
            )
            text = f"ImposedStrain(b0, {strain}, amplitude=TIME)"
        case "pressure":
            text = f"Pressure(b0, <-20 20 .3f>, <-20 20 .3f>{d.one(PROFILES)}, amplitude=TIME)"
        case "moving_load":
            place = d.one([f"3 * t / {d.end:.4g} - 1", "0.2 + 0.1 * math.sin(20 * t)", "0.5"])
            beam = d.one(["b0", "[b1, b2]"]) if len(d.beams) > 2 else "b0"
            text = f"MovingLoad({beam}, lambda t: {place}, {WEAK}, TIME[[|{MASS}]])"
        case "gravity":
            text = "Gravity((<-5 5 .3f>, -9.81), amplitude=TIME)"
        case "rotating_frame":
            text = "RotatingFrame(<1 5 .3f>, about=(-0.2, 0.1))"
    d.loads.append(d.text(f"ub.{text}"))
    if any("RotatingFrame" in load for load in d.loads):  # which refuses masses of moving loads
        d.loads[:] = [load.replace(MASS, "") for load in d.loads]


def virtual_works(d, name):
    size = d.some(-15, 15)
    k, end = f"{10 * abs(size):.3f}", d.end
    kinds = [
        f"'current', current, numbers={{'p': {size:.3f}}}",
        "'dead', dead, numbers={'x': <-15 15 .3f>, 'y': TIME}",
    ]
    own = [f"HardeningSpring(), places=[ub.ground(0.3, 1.2), TIP], numbers={{'k': {k}, 'h': 1e3}}"]
    if not d.static:
        kinds += [
            "'drag', drag, numbers={'c': <0.2 3 .3f>}",
            f"'wind', wind, numbers={{'c': <0.2 2 .3f>, 'speed': {1 / end:.4g}}}",
        ]
        numbers = f"numbers={{'k': {k}, 'time': {end / 4:.4g}}}"
        own += [
            f"AirDrag(), beams=[b0], numbers={{'c': {abs(size):.3f}}}",
            f"MaxwellElement(), places=[b0.start, TIP], {numbers}",
        ]
    kinds, beams = [d.text(kind) for kind in kinds], d.one(["", ", beams=[b0]"])
    works = [f"ub.VirtualWork({kind}{beams})" for kind in kinds]
    d.works.append(d.one_text(*works, *(f"ub.Effect({kind})" for kind in own)))


def potentials(d, name):
    kinds = [
        d.text("'soil', soil, numbers={'k': <50 500 .3f>}"),
        f"'field', field, numbers={{'size': ub.ramp({d.end / 2:.4g})}}",
        d.text("'warming', warming, numbers={'M': <-5 5 .3f>}"),
    ]
    d.works.append(f"ub.Potential({kinds[0] if d.column else d.one(kinds)}, beams=[b0])")


def masses(d, name):
    inertia = d.one(["", ", 0.02"])
    d.masses.append(d.text(f"ub.PointMass(LAST.[[end|at(0.5)]], 0.8{inertia})"))
    d.loads.append(d.text("ub.Gravity(amplitude=TIME)"))


def damping(d, name):
    factors = "mass=<0.1 2 .3f>, stiffness=<1e-4 1e-3 .2e>[[|, tangent=True]]"
    kelvin_voigt = "ub.KelvinVoigt(<1e-4 2e-3 .2e>[[|, beams=[b0]]])"
    d.damping.append(d.text(f"ub.Rayleigh({factors})" if name == "rayleigh" else kelvin_voigt))


def settings(d, name):
    """Discretization, solver and steps."""
    match name:
        case "degree":
            d.mesh = d.text("ub.Mesh(degree=[[2|3]][[|, lumped=True]])")
        case "refined":
            d.mesh = d.text("ub.Mesh(refine=[[2|3]][[|, lumped=True]])")
        case "newton":
            search = "petsc={'snes_linesearch_type': 'bt'}"
            d.newton = d.text(f"ub.Newton([[rtol=1e-11, max_iterations=20|{search}]])")
        case "adaptive":
            d.step = d.text(f"ub.Adaptive(<1e-4 1e-3 .2e>, stops=[{d.end / 3:.4g}])")


FEATURES = [
    Feature(name, write, slots)
    for write, slots, names in (
        (shapes, ["any section"], "shape"),
        (laws_of_resultants, ["section", "any section"], "hardening axial_and_shear perzyna"),
        (laws_of_resultants, ["section", "any section"], "duvaut_lions hysteresis own_law"),
        (laws_of_resultants, ["section", "any section"], "interaction hinge_in_cells"),
        (laws_of_resultants, ["section", "any section"], "own_hinge_in_cells"),
        (laws_of_fibres, ["section", "any section"], "fibres"),
        (laws_of_steel_or_concrete, ["section", "any section"], "fibres_of_steel_or_concrete"),
        (hinges, ["hinges"], "hinges own_hinges"),
        (axes, ["axis", "hinges"], "curved"),
        (joints, ["joint"], "revolute multipliers prismatic slot rigid_link release"),
        (at_the_tip, ["tip"], "connector guided roller propped moved_tip"),
        (at_the_root, ["root"], "pinned shaken"),
        (at_the_root, ["root", "tip", "free"], "free_flight"),
        (bodies, ["body"], "body"),
        (connectors, [], "spring side_spring spring_yields spring_breaks own_law_of_breaking"),
        (connectors, [], "damper stop damped_stop"),
        (connectors, ["has_friction"], "coulomb"),
        (joints, ["has_friction", "joint"], "rubbing_pin"),
        (joints, ["joint"], "motor"),
        (connectors, [], "actuator controller integral_controller force_law"),
        (connectors, [], "force_law_with_history connector_law connector_law_with_history"),
        (connectors, [], "cushion clearance rough_clearance"),
        (connectors, ["has_friction"], "brake"),
        (connectors, [], "rigid_plastic axial_bending_hinge deteriorating"),
        (loads, [], "follower moment line_load imposed_strain pressure moving_load gravity"),
        (loads, ["frame"], "rotating_frame"),
        (virtual_works, ["work"], "virtual_work"),
        (potentials, ["potential"], "potential"),
        (masses, [], "point_mass"),
        (damping, ["damping"], "rayleigh"),
        (damping, ["viscous"], "kelvin_voigt"),
        (settings, ["mesh"], "degree refined"),
        (settings, ["newton"], "newton"),
        (settings, ["steps"], "adaptive"),
    )
    for name in names.split()
]
"""All features; their order decides what a seed draws."""
