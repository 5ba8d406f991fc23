# SPDX-License-Identifier: MIT
"""Linear models against closed forms, and against nonlinear runs of halved amplitude.

Sources: L. Meirovitch, "Fundamentals of Vibrations", 2001, for beams with end masses and for
linkages; G. Genta, "Dynamics of Rotating Systems", 2005, for a mass on springs in a rotating frame.

The energy-momentum scheme, linearized, is the midpoint rule: a nonlinear run and the same steps of
the linear model differ by terms of second order in the amplitude.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import ufl_beam as ub

STEEL = ub.Section(EA=1e5, GA=4e4, EI=50.0, rhoA=0.5, rhoI=1e-3)
STRICT = ub.Newton(rtol=1e-12)  # far below the differences that are compared


def still(t):
    return 0.0


def exponents(model):
    """Exponents of the state space with Im s >= 0, ascending."""
    s = np.linalg.eigvals(model.state_space()[0])
    s = s[s.imag >= -1e-9 * np.abs(s).max()]
    return s[np.argsort(np.abs(s))]


# -- closed forms ----------------------------------------------------------------------------------

SLENDER = ub.Section(EA=1e7, GA=1e7, EI=1.0, rhoA=1.0, rhoI=1e-7)
"""On a length of 1: shear, axial strain and rotary inertia change (βL)⁴ by (βL)²/1e7."""


def mast_response(omega, mass):
    """Displacements of cart and tip for a unit force on the cart, by Bernoulli's beam."""
    β = math.sqrt(omega)  # of a beam with unit EI and rhoA
    c, s, C, S = math.cos(β), math.sin(β), math.cosh(β), math.sinh(β)
    # w = a cos βx + b sin βx + c cosh βx + d sinh βx; w'(0) = w''(1) = w'''(1) = 0, and
    # w'''(0) - mass ω² w(0) = F, because the shear force of the beam on the cart is -w'''(0).
    rows = np.array([
        [0, 1, 0, 1],
        [-c, -s, C, S],
        [s, -c, S, C],
        [-mass * omega**2, -(β**3), -mass * omega**2, β**3],
    ])  # fmt: skip
    a = np.linalg.solve(rows, [0, 0, 0, 1.0])
    return a[0] + a[2], a @ [c, s, C, S]


def test_beam_on_a_cart():
    """[closed] Receptances and natural frequencies, with modes of βL up to 6.

    Shear and rotary inertia change responses and frequencies by several (βL)²/1e7.
    """
    mass = 0.7
    mast = ub.Beam((0, 0), (0, 1), SLENDER, cells=8, name="mast")
    cart = ub.Body((0, 0), mass=mass, inertia=1.0, name="cart")
    jack = ub.Slide(ub.ground(-1, 0), cart.middle, ub.PrescribedForce(still), axis=(1, 0))
    rail = ub.Prismatic(ub.ground(0, 0), cart.middle, axis=(1, 0))
    joints = [ub.Rigid(mast.start, cart.middle), rail]
    scene = ub.Scene([mast], bodies=[cart], joints=joints, connectors=[jack])
    outputs = [("displacement", cart.middle, "u"), ("displacement", mast.end, "u")]
    model = ub.linearize(scene, inputs=[jack], outputs=outputs, mesh=ub.Mesh(degree=3))
    for omega in (1.0, 8.0, 30.0):
        found = model.frequency_response(omega)[:, 0, 0].real
        np.testing.assert_allclose(found, mast_response(omega, mass), rtol=2e-5)
    reduced = model.reduced(3)
    frequencies = ub.modes(scene, 3, mesh=ub.Mesh(degree=3)).omega
    assert frequencies[0] == 0.0
    # Quotients of works have all digits; LAPACK finds the eigenvalues of A to 1e-12 of the largest
    np.testing.assert_allclose(exponents(reduced)[-2:].imag, frequencies[1:], rtol=1e-10)
    # A pole of the response changes the sign of its inverse.
    between = [(3.0, 12.0), (18.0, 40.0)]
    poles = [brentq(lambda x: 1 / mast_response(x, mass)[1], *ends) for ends in between]
    s = exponents(model)
    assert np.abs(s[:2]).max() < 1e-2 * poles[0]  # rigid motion: the root of round-off
    np.testing.assert_allclose(s[2:4].imag, poles, rtol=2e-5)


def slider_crank(law, stiffness=30.0):
    """Slider-crank of rigid bodies at 0.7 rad; the spring of the slider is free of force."""
    angle, r, length = 0.7, 0.3, 1.0
    x = r * math.cos(angle) + math.sqrt(length**2 - (r * math.sin(angle)) ** 2)
    o, pin = ub.ground(0, 0), (r * math.cos(angle), r * math.sin(angle))
    crank = ub.Body((0, 0), mass=3.0, inertia=0.2, name="crank")
    rod = ub.Body(((pin[0] + x) / 2, pin[1] / 2), mass=0.6, inertia=0.05, name="rod")
    slider = ub.Body((x, 0), mass=2.0, inertia=0.1, name="slider")
    motor = ub.Turn(o, crank.middle, law)
    guide = ub.Prismatic(o, slider.middle, axis=(1, 0))
    pins = (o, crank.middle), (crank.at(*pin), rod.at(*pin)), (rod.at(x, 0), slider.middle)
    spring = ub.Slide(ub.ground(x + 1, 0), slider.middle, ub.Spring(stiffness), axis=(1, 0))
    scene = ub.Scene(
        bodies=[crank, rod, slider],
        joints=[*(ub.Revolute(*pair) for pair in pins), guide],
        connectors=[motor, spring],
    )
    # Derivatives by the angle: rod angle φ with sin φ = -r/L sin θ, slider, centre of the rod
    φ = -r * math.cos(angle) / (length * math.cos(math.asin(r * math.sin(angle) / length)))
    dx = -r * math.sin(angle) + pin[1] * φ
    centre = (-r * math.sin(angle) + dx) / 2, r * math.cos(angle) / 2
    inertia = 0.2 + 0.05 * φ**2 + 0.6 * (centre[0] ** 2 + centre[1] ** 2) + 2.0 * dx**2
    return scene, motor, slider, crank, spring, inertia, dx


def test_slider_crank_at_rest():
    """[closed] One degree of freedom: inertia of all parts, and the spring, by the angle."""
    scene, motor, slider, crank, spring, inertia, dx = slider_crank(ub.PrescribedForce(still))
    outputs = [("displacement", crank.middle, "psi"), ("velocity", slider.middle, "u"),
               ("connector", spring, "force")]  # fmt: skip
    model = ub.linearize(scene, inputs=[motor], outputs=outputs)
    A, B, C, D = model.state_space()
    assert A.shape == (2, 2)
    stiffness = 30.0 * dx**2
    s = 1.0 + 3.0j
    angle = 1 / (inertia * s**2 + stiffness)
    # Round-off of the coordinates; the largest number of operations is that of 9 motions.
    expected = [angle, s * dx * angle, 30.0 * dx * angle]
    np.testing.assert_allclose(model.transfer_function(s)[:, 0, 0], expected, rtol=1e-11)
    by_states = C @ np.linalg.solve(s * np.eye(2) - A, B) + D
    np.testing.assert_allclose(by_states[:, 0], expected, rtol=1e-11)
    np.testing.assert_allclose(exponents(model), [1j * math.sqrt(stiffness / inertia)], rtol=1e-11)


def test_motor_of_a_slider_crank():
    """[closed] A prescribed motion is an input by its acceleration; the torque is J a + k dx² u."""
    scene, motor, slider, _, _, inertia, dx = slider_crank(ub.PrescribedMotion(still))
    outputs = [("acceleration", slider.middle, "u"), ("connector", motor, "force")]
    model = ub.linearize(scene, inputs=[motor], outputs=outputs)
    A, B, C, D = model.state_space()
    np.testing.assert_array_equal(A, [[0, 1], [0, 0]])  # u and u' alone
    np.testing.assert_array_equal(B, [[0], [1]])
    np.testing.assert_allclose(C, [[0, 0], [-30 * dx**2, 0]], atol=1e-11)
    np.testing.assert_allclose(D, [[dx], [-inertia]], rtol=1e-11)
    assert model.states[1] == f"d/dt {model.states[0]}"


def test_mass_on_springs_in_a_rotating_frame():
    """[closed] (m (s² - Ω²) + kx)(m (s² - Ω²) + ky) + 4 m² Ω² s² = 0, with Coriolis forces."""
    Ω, m, kx, ky = 3.0, 2.0, 50.0, 80.0
    rotor = ub.Body((0, 0), mass=m, inertia=1.0, name="rotor")
    springs = [
        ub.Slide(ub.ground(0, 0), rotor.middle, ub.Spring(k), axis=axis)
        for k, axis in ((kx, (1, 0)), (ky, (0, 1)))
    ]
    push = ub.PointLoad(rotor.middle, force=(1.0, 0.0))
    scene = ub.Scene(
        [], bodies=[rotor], connectors=springs, loads=[ub.RotatingFrame(Ω), push],
        supports=[ub.PrescribedDisplacement(rotor.middle, psi=0.0)],
    )  # fmt: skip
    at = ub.simulate(replace(scene, loads=[ub.RotatingFrame(Ω)]), ub.Static(), t=(0, 1), dt=1)
    unloaded = replace(scene, loads=[scene.loads[0], replace(push, amplitude=still)])
    outputs = [("displacement", rotor.middle, "u"), ("displacement", rotor.middle, "v")]
    model = ub.linearize(unloaded, inputs=[unloaded.loads[1]], outputs=outputs, at=at)
    np.testing.assert_allclose(model.G.toarray(), [[0, -2 * m * Ω], [2 * m * Ω, 0]], atol=1e-9)
    assert not model.C.nnz
    a, b = kx - m * Ω**2, ky - m * Ω**2
    squares = np.roots([m**2, m * (a + b) + 4 * m**2 * Ω**2, a * b])
    expected = np.sort(np.sqrt(-squares))
    np.testing.assert_allclose(exponents(model).imag, expected, rtol=1e-12)
    s = 0.4 + 2.0j
    x, y = np.linalg.solve([[m * s**2 + a, -2 * m * Ω * s], [2 * m * Ω * s, m * s**2 + b]], [1, 0])
    np.testing.assert_allclose(model.transfer_function(s)[:, 0, 0], [x, y], rtol=1e-12)


def test_frame_with_dampers():
    """[closed] Portal with columns without mass and a rigid girder: m s² + c s + 24 EI/h³ = 0.

    With a spring in series with the damper: (m s² + k)(c s + k1) + k1 c s = 0.
    """
    h, EI, m, c, k1 = 3.0, 4.0, 2.0, 0.7, 1.5
    column = ub.Section(EA=1e9, GA=1e9, EI=EI, rhoA=0.0, rhoI=0.0)
    posts = [ub.Beam((x, 0), (x, h), column, cells=1, name=f"post {x}") for x in (0, 4)]
    girder = ub.Body((2, h), mass=m, inertia=1.0, name="girder")
    joints = [ub.Rigid(post.end, girder.at(*post.end.point)) for post in posts]
    supports = [ub.Clamped(post.start) for post in posts]
    side = ub.ground(6, h)
    push = ub.PointLoad(girder.middle, force=(1.0, 0))
    output = [("displacement", girder.middle, "u"), ("velocity", girder.middle, "u")]

    def state_space(bodies, connectors, more=()):
        scene = ub.Scene(
            posts, bodies=[girder, *bodies], joints=joints, supports=[*supports, *more],
            connectors=connectors, loads=[push],
        )  # fmt: skip
        model = ub.linearize(scene, inputs=[push], outputs=output, mesh=ub.Mesh(degree=3))
        return model, exponents(model)

    k = 2 * 12 * EI / h**3
    model, s = state_space([], [ub.Slide(side, girder.middle, ub.Damper(c), axis=(1, 0))])
    # u alone has the mass; v and ψ, held by the axial stiffness, have the mass, too.
    assert s[0] == pytest.approx(np.roots([m, c, k])[0], rel=1e-6)
    assert len(model.states) == 6
    plug = ub.Body((5, h), mass=0.0, inertia=0.0, name="plug")
    maxwell = [
        ub.Slide(girder.middle, plug.middle, ub.Spring(k1), axis=(1, 0)),
        ub.Slide(side, plug.middle, ub.Damper(c), axis=(1, 0)),
    ]
    held = ub.PrescribedDisplacement(plug.middle, v=0.0, psi=0.0)
    model, s = state_space([plug], maxwell, [held])
    cubic = np.roots([m * c, m * k1, c * (k + k1), k * k1])
    cubic = cubic[cubic.imag >= 0]
    np.testing.assert_allclose(s[:2], cubic[np.argsort(abs(cubic))], rtol=1e-6)
    assert len(model.states) == 7
    z = 0.3 + 0.9j
    A, B, C, D = model.state_space()
    by_states = C @ np.linalg.solve(z * np.eye(7) - A, B) + D
    u = (c * z + k1) / np.polyval([m * c, m * k1, c * (k + k1), k * k1], z)
    for found in (by_states[:, 0], model.transfer_function(z)[:, 0, 0]):
        np.testing.assert_allclose(found, [u, z * u], rtol=1e-6)


# -- nonlinear runs --------------------------------------------------------------------------------

COMPONENTS = {
    **dict.fromkeys(("displacement", "velocity", "acceleration"), ("u", "v", "psi")),
    "section_forces_at": ("N", "V", "M"), "connector": ("motion", "rate", "force"),
    **dict.fromkeys(("joint", "reaction"), ("x", "y", "moment")),
}  # fmt: skip


def expanded(outputs):
    """Outputs with all components of those that have none."""
    return [(*x[:2], c) for x in outputs for c in (COMPONENTS[x[0]] if len(x) == 2 else [x[2]])]


def measured(run, kind, x, component):
    """History of an output in a nonlinear run."""
    found = getattr(run, kind)(x)
    if kind == "connector":
        return getattr(found, component)
    if kind == "joint":
        found = np.column_stack([found.force, found.moment])
    return found[:, COMPONENTS[kind].index(component)]


def responses(model, outputs, t, size, power):
    """Outputs of the linear model for the inputs ``size t**power``, and their largest values."""
    A, B, C, D = model.state_space()
    w, linear = np.zeros(len(A)), []
    ends = [x[0] in ("displacement", "velocity") or x[2] == "motion" for x in outputs]
    for t0, t1 in itertools.pairwise(t):
        dt, i = t1 - t0, np.full(B.shape[1], size * ((t0 + t1) / 2) ** power)
        w0 = w
        w = np.linalg.solve(np.eye(len(A)) - dt / 2 * A, w0 + dt * (A @ w0 / 2 + B @ i))
        linear.append(np.where(ends, C @ w, C @ (w0 + w) / 2 + D @ i))
    linear = np.array(linear)
    return linear, np.abs(linear).max(axis=0)


def require_second_order(scene, outputs, inputs, drive, at=None, *, power=1, steps=25):
    """Halved inputs change the difference from the linear model by a factor of 4 and more.

    ``drive`` sets the factor of the inputs of the scene.  Amplitudes are below 1 % of the size of
    the scene and of a radian, so third order is left 1 %; 1e-9 of the output is round-off of steps.
    """
    outputs = expanded(outputs)
    drive(0.0)
    dt = 0.01
    model = ub.linearize(scene, inputs=inputs, outputs=outputs, at=at)
    t0 = 0.0 if at is None else at.times[-1]
    apart = []
    for size in (0.1, 0.05):
        drive(size)
        run = ub.simulate(
            scene, ub.EnergyMomentum(), t=(t0, t0 + steps * dt), dt=dt, start=at, newton=STRICT
        )
        linear, sizes = responses(model, outputs, run.times - run.times[0], size, power)
        found = np.column_stack([measured(run, *x) for x in outputs])
        before = np.zeros(len(outputs))
        for k, x in enumerate(outputs):
            if at is not None and x[0] not in ("velocity", "acceleration") and x[2] != "rate":
                before[k] = measured(at, *x)[-1]
        apart.append(np.abs(found[1:] - before - linear).max(axis=0))
        assert (apart[-1] <= 0.3 * sizes.max()).all()
    for name, first, second, size in zip(model.outputs, *apart, sizes, strict=True):
        assert second <= first / 4 * 1.01 + 1e-9 * size, (name, first / second)


class Drive:
    """Factor of inputs that :func:`require_second_order` sets."""

    size = 0.0

    def __call__(self, size):
        self.size = size

    def load(self, t0, base=1.0, part=1.0):
        """Amplitude ``base`` plus a ramp from ``t0`` on."""
        return lambda t: base + part * self.size * max(t - t0, 0.0)


SOFT = ub.Section(EA=1e4, GA=4e3, EI=20.0, rhoA=0.5, rhoI=1e-2)


def test_step_of_a_loaded_cantilever():
    """Each kind of load as an input about a state under all of them, with damping and a spring."""
    b = ub.Beam((0, 0), (2, 0), SOFT, cells=3)
    root, drive = ub.Clamped(b.start), Drive()

    def loads(varied):
        def amplitude(k):
            return drive.load(1e5, part=float(k == varied))

        return [
            ub.PointLoad(b.end, force=(-1.0, -3.0), amplitude=amplitude(0)),
            ub.FollowerLoad(b.at(0.5), force=(0, -2.0), amplitude=amplitude(1)),
            ub.LineLoad(b, force=(0.5, 1.0), amplitude=amplitude(2)),
            ub.Pressure(b, normal=-1.0, amplitude=amplitude(3)),
            ub.ImposedStrain(b, curvature=0.1, axial=1e-3, amplitude=amplitude(4)),
            ub.Gravity((0, -1.0), amplitude=amplitude(5)),
        ]

    props = [
        ub.Slide(ub.ground(1.5, 0), b.at(0.75), law, axis=(0, 1))
        for law in (ub.Spring(20.0), ub.Damper(2.0))
    ]
    outputs = [
        ("displacement", b.end), ("velocity", b.end), ("acceleration", b.at(0.6)),
        ("section_forces_at", b.at(0.3)), ("section_forces_at", b.start), ("reaction", root),
        ("connector", props[0]), ("connector", props[1]),
    ]  # fmt: skip
    for k in range(6):
        drive(0.0)
        static = ub.Scene([b], supports=[root], loads=loads(k), connectors=props)
        # Steps are long, so that the damper is at rest in the end
        at = ub.simulate(static, ub.Static(), t=(0, 1e5), dt=2e4, newton=STRICT)
        damping = [ub.KelvinVoigt(1e-3), ub.Rayleigh(mass=0.1, stiffness=1e-3)]
        scene = replace(static, damping=damping)
        require_second_order(scene, outputs, [scene.loads[k]], drive, at)


def flexible_slider_crank(law):
    angle, r, length = 0.7, 0.3, 1.0
    x = r * math.cos(angle) + math.sqrt(length**2 - (r * math.sin(angle)) ** 2)
    o = ub.ground(0, 0)
    crank = ub.Body((0, 0), mass=3.0, inertia=0.2, name="crank")
    slider = ub.Body((x, 0), mass=2.0, inertia=0.1, name="slider")
    pin = crank.at(r * math.cos(angle), r * math.sin(angle))
    rod = ub.Beam(pin.point, (x, 0), STEEL, cells=3, name="rod")
    bearing = ub.Revolute(o, crank.middle, multipliers=True)
    elbow = ub.Revolute(pin, rod.start, multipliers=True)
    wrist = ub.Revolute(rod.end, slider.middle, multipliers=True)
    guide = ub.Prismatic(o, slider.middle, axis=(1, 0))
    motor = ub.Turn(o, crank.middle, law)
    spring = ub.Stretch(slider.middle, ub.ground(x + 1, 0.2), ub.Spring(30.0))
    scene = ub.Scene(
        [rod], bodies=[crank, slider], joints=[bearing, elbow, wrist, guide],
        connectors=[motor, spring],
    )  # fmt: skip
    outputs = [
        ("displacement", crank.middle, "psi"), ("acceleration", crank.middle, "psi"),
        ("displacement", slider.middle, "u"), ("displacement", rod.at(0.5)),
        ("velocity", pin, "u"), ("section_forces_at", rod.at(0.4)), ("joint", elbow, "x"),
        ("joint", elbow, "y"), ("joint", bearing, "x"), ("joint", guide, "y"),
        ("connector", motor), ("connector", spring),
    ]  # fmt: skip
    return scene, motor, outputs


@pytest.mark.parametrize("law", [ub.PrescribedForce, ub.PrescribedMotion])
def test_step_of_a_slider_crank(law):
    """From rest by a torque that grows, or with a constant angular acceleration."""
    drive, forced = Drive(), law is ub.PrescribedForce
    scene, motor, outputs = flexible_slider_crank(
        law(lambda t: drive.size * (t if forced else t**2 / 2))
    )
    require_second_order(scene, outputs, [motor], drive, power=int(forced), steps=40)


def test_step_of_a_support():
    """A clamp at an angle is accelerated, under a load that bends the beam."""
    b = ub.Beam((0, 0), (2, 0.3), STEEL, cells=3)
    drive = Drive()

    def motion(t):
        return drive.size * max(t - 1, 0) ** 2 / 2

    foot = ub.PrescribedDisplacement(b.start, u=0.0, v=motion, psi=0.0, along=(1, 0.4))
    scene = ub.Scene(
        [b], supports=[foot], loads=[ub.PointLoad(b.end, force=(1, -5.0))],
        damping=[ub.Rayleigh(mass=0.2, stiffness=1e-3)],
    )  # fmt: skip
    still = replace(scene, damping=())
    at = ub.simulate(still, ub.Static(), t=(0, 1), dt=0.5, newton=STRICT)
    outputs = [
        ("displacement", b.end), ("acceleration", b.end), ("reaction", foot),
        ("section_forces_at", b.at(0.3)), ("displacement", b.start, "u"),
    ]  # fmt: skip
    require_second_order(scene, outputs, [(foot, "v")], drive, at, power=0)


def test_step_of_a_spinning_blade():
    """A force at the tip in a rotating frame; a mass at the tip."""
    b, drive = ub.Beam((0.2, 0), (2.2, 0), STEEL, cells=3), Drive()
    tip = ub.PointLoad(b.end, force=(0.0, 1.0), amplitude=drive.load(1.0, base=0.0))
    foot = ub.Clamped(b.start)
    scene = ub.Scene(
        [b], supports=[foot], loads=[ub.RotatingFrame(8.0), tip],
        masses=[ub.PointMass(b.end, 0.3, 0.01)],
    )  # fmt: skip
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5, newton=STRICT)
    outputs = [
        ("displacement", b.end), ("acceleration", b.end), ("reaction", foot),
        ("section_forces_at", b.at(0.3)),
    ]  # fmt: skip
    require_second_order(scene, outputs, [tip], drive, at)


def test_step_of_a_frame_with_a_load_beside_a_body():
    """A load away from the centre of a body is a connector; a rigid joint bears its moment."""
    post = ub.Beam((0, 0), (0, 2), STEEL, cells=3, name="post")
    top = ub.Body((0, 2), mass=2.0, inertia=0.3, name="top")
    joint, drive = ub.Rigid(post.end, top.middle, multipliers=True), Drive()
    damper = ub.Stretch(ub.ground(1.5, 0), top.at(0, 1.8), ub.Damper(4.0))
    load = ub.PointLoad(top.at(0.4, 2.2), force=(1.0, -2.0), moment=0.3, amplitude=drive.load(1e5))
    scene = ub.Scene(
        [post], bodies=[top], joints=[joint], supports=[ub.Clamped(post.start)],
        connectors=[damper], loads=[load],
    )  # fmt: skip
    at = ub.simulate(scene, ub.Static(), t=(0, 1e5), dt=5e4, newton=STRICT)
    outputs = [
        ("displacement", top.at(0.4, 2.2)), ("velocity", top.middle), ("joint", joint),
        ("reaction", scene.supports[0]), ("connector", damper),
        ("section_forces_at", post.at(0.2)),
    ]  # fmt: skip
    require_second_order(scene, outputs, [load], drive, at)


# -- static runs -----------------------------------------------------------------------------------

GIRDER = ub.Beam((0, 0), (2, 0.5), SOFT, cells=3, name="girder")
FOOT = ub.Clamped(GIRDER.start)


def hung(amplitude):
    """Link that bears a force: its direction turns with its ends."""
    link = ub.Link(ub.ground(3, 1.5), GIRDER.end)
    load = ub.PointLoad(GIRDER.at(1 / 3), force=(1.0, -5.0), amplitude=amplitude)
    scene = ub.Scene([GIRDER], supports=[ub.Pinned(GIRDER.start)], joints=[link], loads=[load])
    return scene, [("joint", link, "x"), ("joint", link, "y"), ("displacement", GIRDER.end)]


def sliding(amplitude):
    """Slider whose rail turns with a loaded beam."""
    arm = ub.Beam((2, 0.5), (3, 0.3), SOFT, cells=2, name="arm")
    rail = ub.Prismatic(GIRDER.end, arm.start, axis=(2, 0.5))
    spring = ub.Slide(GIRDER.end, arm.start, ub.Spring(30.0), axis=(2, 0.5))
    load = ub.PointLoad(arm.end, force=(1.0, -2.0), amplitude=amplitude)
    scene = ub.Scene(
        [GIRDER, arm], supports=[FOOT], joints=[rail], connectors=[spring], loads=[load]
    )
    outputs = [("joint", rail, "x"), ("joint", rail, "y"), ("displacement", arm.end),
               ("connector", spring, "motion"), ("connector", spring, "force")]  # fmt: skip
    return scene, outputs


def crossed(amplitude):
    """Moving load between the nodes of a cell; section forces on both sides of it."""
    load = ub.MovingLoad([GIRDER], force=(0, -3.0), position=lambda t: 0.77, amplitude=amplitude)
    scene = ub.Scene([GIRDER], supports=[FOOT], loads=[load])
    places = [GIRDER.at(s) for s in (0.1, 0.35, 0.6)]
    return scene, [("section_forces_at", place) for place in places]


@pytest.mark.parametrize("build", [hung, sliding, crossed])
def test_static_gains_about_a_loaded_state(build):
    """[calc] Difference quotients of static runs: the step 1e-3 leaves a millionth of the gain."""
    factor = [0.0]
    scene, outputs = build(lambda t: t * (1 + factor[0]))
    outputs = expanded(outputs)

    def run():
        return ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25, newton=ub.Newton(rtol=1e-13))

    model = ub.linearize(scene, inputs=[scene.loads[0]], outputs=outputs, at=run())
    ends = []
    for factor[0] in (1e-3, -1e-3):
        loaded = run()
        ends.append(np.array([measured(loaded, *x)[-1] for x in outputs]))
    quotient = (ends[0] - ends[1]) / 2e-3
    sizes = np.maximum(np.abs(quotient), 1e-3 * np.abs(quotient).max())
    A, B, C, D = model.state_space()
    by_states = (D - C @ np.linalg.solve(A, B))[:, 0]
    for gain in (model.frequency_response(0.0)[:, 0, 0].real, by_states):
        assert (np.abs(gain - quotient) <= 5e-6 * sizes).all()
