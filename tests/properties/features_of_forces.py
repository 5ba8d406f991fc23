# SPDX-License-Identifier: MIT
"""Features of connectors, loads, works, masses, damping, discretization, solver and steps.

See :mod:`features`, whose list they extend.
"""

from features import bulk_law, feature, own_softening

# -- connectors --------------------------------------------------------------------------------


def _connect(d, law, kinds="SLT"):
    """A connector of a law between the ground and a place, or of two places."""
    x, y = d.tip
    kind = d.one(kinds)
    place = d.one([f"{d.last}.at(0.5)", "b0.end"])
    if kind == "T":
        d.connectors.append(f"ub.Turn(ub.ground(0, 0), {place}, {law})")
    elif kind == "S":
        d.connectors.append(f"ub.Stretch(ub.ground({x + 0.5:.3f}, {y + 0.8:.3f}), {place}, {law})")
    else:
        d.connectors.append(f"ub.Slide(ub.ground(0.2, 0.7), {place}, {law}, axis=(0.3, 1.0))")


@feature()
def spring(d):
    _connect(d, f"ub.Spring({d.some(50, 300):.4g})")


@feature()
def side_spring(d):
    x, y = d.tip
    law = f"ub.Spring({d.some(50, 300):.4g})"
    d.connectors.append(f"ub.Slide(ub.ground({x!r}, {y!r}), {d.last}.end, {law}, axis=(0.0, 1.0))")


@feature(elastic=False)
def spring_yields(d):
    _connect(d, f"ub.Spring(200.0, law={bulk_law(d, d.some(0.5, 4), 200.0)})")


@feature(elastic=False)
def spring_breaks(d):
    kind = d.one(["Softening", "LinearSoftening"])
    _connect(d, f"ub.Spring(200.0, softening=ub.{kind}({d.some(1, 5):.4g}, {d.some(0.5, 2):.4g}))")


@feature(elastic=False)
def own_law_of_breaking(d):
    law = own_softening(d, d.some(1, 5), d.some(0.5, 2))
    _connect(d, d.one([f"ub.Spring(200.0, softening={law})", f"ub.RigidPlastic({law})"]))


@feature(statics=False)
def damper(d):
    _connect(d, f"ub.Damper({d.some(0.2, 3):.4g})")


@feature(elastic=False)
def stop(d):
    _connect(d, f"ub.Stop({d.some(200, 900):.4g}, low=-0.01, high={d.some(0.005, 0.02):.4g})")


@feature(statics=False, elastic=False)
def damped_stop(d):
    _connect(
        d, f"ub.Stop({d.some(200, 900):.4g}, high={d.some(0.005, 0.02):.4g}, "
        f"damping={d.some(0.1, 3):.3g})"
    )  # fmt: skip


@feature("has_friction", statics=False, at_end=False, elastic=False)
def coulomb(d):
    _connect(d, f"ub.Coulomb({d.some(0.2, 2):.4g})")


@feature("has_friction", "joint", statics=False, at_end=False, elastic=False)
def rubbing_pin(d):
    d.need_beams(2)
    d.joint = "ub.Revolute({a}, {b}, multipliers=True)"
    law = f"ub.Coulomb({d.some(0.05, 0.3):.4g}, coefficient=0.02, joint=joint)"
    d.connectors.append(f"ub.Turn(b0.end, b1.start, {law})")


@feature("joint")
def motor(d):
    d.need_beams(2)
    d.joint = "ub.Revolute({a}, {b})"
    ω = d.some(2, 6) / d.end
    law = f"ub.PrescribedMotion(lambda t: {d.some(0.05, 0.4):.3f} * (1.0 - math.cos({ω:.4g} * t)))"
    d.connectors.append(f"ub.Turn(b0.end, b1.start, {law})")


@feature()
def actuator(d):
    _connect(d, f"ub.PrescribedForce(lambda t: {d.some(2, 9):.3f} * math.sin({9 / d.end:.4g} * t))")


@feature(elastic=False)
def controller(d):
    _connect(
        d, f"ub.Controller(lambda now: {d.some(1, 5):.3f} * math.sin({9 / d.end:.4g} * now.t))"
    )


@feature(elastic=False)
def integral_controller(d):
    law = f"ub.Controller(Integral(b0.end, {d.some(0.5, 2):.3f}))"
    d.connectors.append(f"ub.Turn(ub.ground(0, 0), b0.end, {law})")


@feature()
def force_law(d):
    d.lines.append(f"cubic = Cubic({d.some(50, 200):.4g}, {d.some(500, 3000):.4g})")
    _connect(d, d.one(["ub.ForceLaw(cubic)", "ub.ForceLaw(cubic, stored=cubic.energy)"]))


@feature(statics=False, elastic=False)
def force_law_with_history(d):
    _connect(
        d, f"ub.ForceLaw(Maxwell({d.some(50, 200):.4g}, {d.some(0.02, 0.1):.4g}), state=[0.0])"
    )


@feature()
def connector_law(d):
    _connect(d, f"Stiffening({d.some(50, 200):.4g}, {d.some(500, 3000):.4g})")


@feature(statics=False, elastic=False)
def connector_law_with_history(d):
    numbers = d.some(50, 200), d.some(0.02, 0.1), d.some(0.1, 2)
    _connect(d, f"Relaxing({', '.join(f'{x:.4g}' for x in numbers)})")


@feature(statics=False)
def cushion(d):
    place = d.one([f"{d.last}.at(0.5)", "b0.end"])
    law = f"Cushion({d.some(50, 200):.4g}, {d.some(0.02, 0.1):.4g}, {d.some(0.1, 2):.4g})"
    d.connectors.append(f"ub.Bushing(ub.ground(0.2, 0.7), {place}, {law}, axis=(0.3, 1.0))")


@feature(elastic=False)
def clearance(d):
    law = f"ub.Clearance({d.some(300, 900):.4g}, gap={d.some(0.002, 0.01):.4g})"
    d.connectors.append(f"ub.Bushing(ub.ground(0.2, 0.7), {d.last}.end, {law}, axis=(0.3, 1.0))")


@feature(statics=False, elastic=False)
def rough_clearance(d):
    law = (
        f"ub.Clearance({d.some(300, 900):.4g}, gap={d.some(0.002, 0.01):.4g}, damping=1.0, "
        f"friction={d.some(0.1, 0.5):.3g}, radius=0.02)"
    )
    d.connectors.append(f"ub.Bushing(ub.ground(0.2, 0.7), {d.last}.end, {law}, axis=(0.3, 1.0))")


@feature("has_friction", statics=False, at_end=False, elastic=False)
def brake(d):
    rest = d.some(0.3, 2)
    _connect(d, f"Brake({rest:.4g}, {rest * d.some(0.5, 1):.4g}, {d.some(0.02, 0.2):.4g})")


@feature(at_end=False, elastic=False)
def rigid_plastic(d):
    law = f"ub.RigidPlastic(ub.ElastoPlastic({d.some(1, 4):.4g}, isotropic={d.some(50, 200):.4g}))"
    d.connectors.append(f"ub.Slide(ub.ground(0.2, 0.7), {d.last}.at(0.5), {law}, axis=(0.3, 1.0))")


@feature(elastic=False)
def axial_bending_hinge(d):
    N, M = d.some(2, 20), d.some(0.5, 3)
    law = f"st.AxialBendingHinge({N:.4g}, {M:.4g}, {d.some(300, 900):.4g}, 500.0, 100.0)"
    d.connectors.append(f"ub.Bushing(ub.ground(0.2, 0.7), {d.last}.end, {law}, axis=(0.3, 1.0))")


@feature(elastic=False)
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
        kind, more = "PinchingHinge", f", {d.some(0.2, 1):.3g}, {d.some(0, 1):.3g}, {E[1]}"
    _connect(d, f"st.{kind}({k}, {plus}, {minus}, {', '.join(E)}, {n}{more})", "SLT")


# -- loads, works, masses, damping -------------------------------------------------------------


@feature()
def follower(d):
    d.loads.append(
        f"ub.FollowerLoad({d.last}.end, force=({d.some(-15, 15):.3f}, {d.some(-15, 15):.3f}), "
        f"moment={d.some(-2, 2):.3f}, amplitude={d.time()})"
    )


@feature()
def moment(d):
    d.loads.append(
        f"ub.PointLoad({d.last}.at(0.5), moment={d.some(-6, 6):.3f}, amplitude={d.time()})"
    )


PART = ", span=(0.0, 0.5), profile=(0.0, 2.0)"
CURVED = ", profile=lambda s: 1 - 4 * (s - 0.5) ** 2"


@feature()
def line_load(d):
    more = d.one(["", f", moment={d.some(-2, 2):.3f}"])
    more += d.one(["", ", span=(0.25, 0.75)", ", profile=(1.5, -0.5)", PART, CURVED])
    d.loads.append(
        f"ub.LineLoad(b0, force=({d.some(-20, 20):.3f}, {d.some(-20, 20):.3f}){more}, "
        f"amplitude={d.time()})"
    )


@feature()
def imposed_strain(d):
    kinds = [
        f"axial={d.some(-1e-3, 1e-3):.3e}, span=(0.25, 0.75)",
        f"axial=(0.0, {d.some(-1e-3, 1e-3):.3e}), curvature={d.some(-5e-2, 5e-2):.3e}",
        f"curvature=lambda s: {d.some(-5e-2, 5e-2):.3e} * (1 - s**2), shear=1e-4",
    ]
    d.loads.append(f"ub.ImposedStrain(b0, {d.one(kinds)}, amplitude={d.time()})")


@feature()
def pressure(d):
    more = d.one(["", ", span=(0.25, 0.75)", ", profile=(1.5, -0.5)", PART, CURVED])
    d.loads.append(
        f"ub.Pressure(b0, {d.some(-20, 20):.3f}, {d.some(-20, 20):.3f}{more}, amplitude={d.time()})"
    )


@feature()
def moving_load(d):
    place = d.one(["3 * t / END - 1", "0.2 + 0.1 * math.sin(20 * t)", "0.5"])
    beam = d.one(["b0", "[b1, b2]"]) if len(d.beams) > 2 else "b0"
    d.loads.append(
        f"ub.MovingLoad({beam}, lambda t: {place.replace('END', f'{d.end:.4g}')}, "
        f"({d.some(-15, 15):.3f}, {d.some(-15, 15):.3f}), {d.time()}{d.one(['', MASS])})"
    )
    without_mass_in_a_frame(d)


MASS = ", mass=0.5"


def without_mass_in_a_frame(d):
    """Take the masses from moving loads in a rotating frame, which refuses them."""
    if any("RotatingFrame" in load for load in d.loads):
        d.loads[:] = [load.replace(MASS, "") for load in d.loads]


@feature()
def gravity(d):
    d.loads.append(f"ub.Gravity(({d.some(-5, 5):.3f}, -9.81), amplitude={d.time()})")


@feature("frame", at_end=False)
def rotating_frame(d):
    d.loads.append(f"ub.RotatingFrame({d.some(1, 5):.3f}, about=(-0.2, 0.1))")
    without_mass_in_a_frame(d)


@feature("work")
def virtual_work(d):
    size = d.some(-15, 15)
    kinds = [
        f"'current', current, numbers={{'p': {size:.3f}}}",
        f"'dead', dead, numbers={{'x': {d.some(-15, 15):.3f}, 'y': {d.time()}}}",
    ]
    numbers = f"numbers={{'k': {10 * abs(size):.3f}, 'h': 1e3}}"
    own = [f"HardeningSpring(), places=[ub.ground(0.3, 1.2), {d.last}.end], {numbers}"]
    if not d.static:
        kinds += [
            f"'drag', drag, numbers={{'c': {d.some(0.2, 3):.3f}}}",
            f"'wind', wind, numbers={{'c': {d.some(0.2, 2):.3f}, 'speed': {1 / d.end:.4g}}}",
        ]
        numbers = f"numbers={{'k': {10 * abs(size):.3f}, 'time': {d.end / 4:.4g}}}"
        own += [
            f"AirDrag(), beams=[b0], numbers={{'c': {abs(size):.3f}}}",
            f"MaxwellElement(), places=[b0.start, {d.last}.end], {numbers}",
        ]
    beams = d.one(["", ", beams=[b0]"])
    works = [f"ub.VirtualWork({kind}{beams})" for kind in kinds]
    d.works.append(d.one([*works, *(f"ub.Effect({kind})" for kind in own)]))


@feature("potential")
def potential(d):
    kinds = [
        f"'soil', soil, numbers={{'k': {d.some(50, 500):.3f}}}",
        f"'field', field, numbers={{'size': ub.ramp({d.end / 2:.4g})}}",
        f"'warming', warming, numbers={{'M': {d.some(-5, 5):.3f}}}",
    ]
    kind = kinds[0] if d.column else d.one(kinds)
    d.works.append(f"ub.Potential({kind}, beams=[b0])")


@feature()
def point_mass(d):
    inertia = d.one(["", ", 0.02"])
    d.masses.append(f"ub.PointMass({d.last}.{d.one(['end', 'at(0.5)'])}, 0.8{inertia})")
    d.loads.append(f"ub.Gravity(amplitude={d.time()})")


@feature("damping", statics=False)
def rayleigh(d):
    factors = f"mass={d.some(0.1, 2):.3f}, stiffness={d.some(1e-4, 1e-3):.2e}"
    d.damping.append(f"ub.Rayleigh({factors}{d.one(['', ', tangent=True'])})")


@feature("viscous")
def kelvin_voigt(d):
    d.damping.append(f"ub.KelvinVoigt({d.some(1e-4, 2e-3):.2e}{d.one(['', ', beams=[b0]'])})")


# -- discretization, solver, steps -------------------------------------------------------------


@feature("mesh")
def degree(d):
    d.mesh = f"ub.Mesh(degree={d.one([2, 3])}{d.one(['', ', lumped=True'])})"


@feature("mesh")
def refined(d):
    d.mesh = f"ub.Mesh(refine={d.one(['2', '3'])}{d.one(['', ', lumped=True'])})"


@feature("newton")
def newton(d):
    d.newton = d.one([
        "ub.Newton(rtol=1e-11, max_iterations=20)",
        "ub.Newton(petsc={'snes_linesearch_type': 'bt'})",
    ])  # fmt: skip


@feature("steps", statics=False)
def adaptive(d):
    d.step = f"ub.Adaptive({d.some(1e-4, 1e-3):.2e}, stops=[{d.end / 3:.4g}])"
