# SPDX-License-Identifier: MIT
"""Time schemes and adaptive steps in space: equality with the plane, orders, errors, restart."""

import numpy as np
import pytest
from into_space import EXACT, same_in_space
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from test_space import KINDS, LAWS, OTHER, STIFF, crane, flight, in_plane, in_space

import ufl_beam as ub

SCHEMES = [ub.EnergyMomentumDecaying(0.5), ub.EnergyMomentum(beta=0.1), ub.EnergyMomentum(order=4)]


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_planar_scenes_have_the_same_motion_and_losses(scheme):
    assert same_in_space(in_plane(), scheme)[1].energy.worst < 1e-13


TENSOR = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, -0.2], [0.1, -0.2, 1.0]])
SPIN = (1.0, -2.0, 3.0)


@pytest.fixture(scope="module")
def exact():
    """Rotation at 1 s of a body that turns freely, by the differential equation of Euler."""

    def rates(_, y):
        x, y, z, r, a, b, c = y
        turning = [r * a + y * c - z * b, r * b + z * a - x * c, r * c + x * b - y * a,
                   -x * a - y * b - z * c]  # fmt: skip
        momentum = TENSOR @ [a, b, c]
        return np.append(
            np.array(turning) / 2, np.linalg.solve(TENSOR, np.cross(momentum, [a, b, c]))
        )

    accurate = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853"}
    found = solve_ivp(rates, (0, 1), [0, 0, 0, 1, *SPIN], **accurate)
    return Rotation.from_quat(found.y[:4, -1])


def spinning(scheme, dt):
    """A run of a body that turns freely about changing axes."""
    body = ub.Body((0, 0, 0), mass=1.0, inertia=TENSOR)
    start = ub.Velocity([body], angular=SPIN, linear=(1, 0, 0), about=(0, 0, 0))
    scene = ub.Scene(bodies=[body], initial=[start])
    return ub.simulate(scene, scheme, t=(0, 1), dt=dt, newton=EXACT)


def error(run, exact):
    place = run.scene.bodies[0].middle
    found = Rotation.from_rotvec(run.displacement(place)[-1, 3:])
    return np.linalg.norm((exact.inv() * found).as_rotvec())


@pytest.mark.parametrize(("scheme", "order"), [*zip(SCHEMES, (2, 1, 4), strict=True)], ids=str)
def test_orders_of_rotations(scheme, order, exact):
    runs = [spinning(scheme, dt) for dt in (0.025, 0.0125)]
    first, second = (error(run, exact) for run in runs)
    assert abs(np.log2(first / second) - order) < 0.25
    momentum = runs[0].momentum()
    assert np.abs(momentum - momentum[0]).max() < 1e-11
    assert runs[0].energy.worst < 1e-11


@pytest.mark.parametrize("scheme", [SCHEMES[2], ub.EnergyMomentum()], ids=str)
def test_adaptive_steps_estimate_errors_of_rotations(scheme, exact):
    """Estimates are of leading order: ten steps a radian leave some hundredths of the error."""
    run = spinning(scheme, ub.Adaptive(1e-4))
    assert abs(run.time_error / error(run, exact) - 1) < 0.1


@pytest.mark.parametrize("case", ["order 2", "order 4", "stop"])
def test_adaptive_steps_of_a_planar_scene(case):
    """The same steps and the same estimate in a turned plane, also with a pilot of switches."""
    flat = in_plane(lambda *ends: [KINDS["Slide"](*ends, LAWS["stop"])] * (case == "stop"))
    scheme = ub.EnergyMomentum(order=4 if case == "order 4" else 2)
    steps = ub.Adaptive(1e-3, stops=[0.5])
    plane, space = same_in_space(flat, scheme, t=(0, 0.8), dt=steps, tolerance=1e-6)
    assert np.abs(plane.times - space.times).max() < 1e-9
    assert abs(plane.time_error / space.time_error - 1) < 1e-6


def test_start_with_another_scheme_keeps_the_rotations():
    """Only the decaying scheme has changes of strains among the states of its cells."""
    scene, more = in_space(), {"dt": 0.05}
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), **more)
    second = ub.simulate(scene, SCHEMES[0], t=(1, 2), start=first, **more)
    third = ub.simulate(scene, ub.EnergyMomentum(), t=(2, 3), start=second, **more)
    place = scene.beams[0].at(0.3)
    for one, other in ((first, second), (second, third)):
        assert (one.displacement(place)[-1] == other.displacement(place)[0]).all()
        assert other.energy.worst < 1e-9
    lost = second.energy.lost["numerical"]
    assert lost[-1] > 0


@pytest.mark.parametrize(
    "scheme", [ub.Newmark(), ub.GeneralizedAlpha(), ub.EnergyMomentumPrinted()]
)
def test_schemes_that_add_angles_are_refused(scheme):
    with pytest.raises(ub.ModelError, match="a sum of angles about changing axes is no rotation"):
        ub.simulate(crane(), scheme, t=(0, 1), dt=0.1)


def test_order_4_is_refused_for_scenes_that_dissipate():
    scene = in_space(connectors=lambda *ends: [KINDS["Slide"](*ends, LAWS["damper"])])
    with pytest.raises(ub.ModelError, match="dissipates"):
        ub.simulate(scene, ub.EnergyMomentum(order=4), t=(0, 1), dt=0.1)


def test_drift_of_many_turns():
    """20 000 steps about the centre of mass, of which many nodes turn a thousand times."""
    scene = flight()
    away = ub.Velocity(scene.beams, linear=(-5, 0, 0), angular=(0, 0, 0))  # the load stops it
    scene = ub.Scene(scene.beams, loads=scene.loads, initial=[away])
    first = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 5), dt=0.1)
    arguments = {"t": (5, 2005), "dt": 0.1, "newton": EXACT}
    run = ub.simulate(scene, ub.EnergyMomentum(), start=first, **arguments)
    for values in (run.energy.total, run.momentum()[:, 3:]):
        assert np.abs(values - values[0]).max() < 1e-12 * np.linalg.norm(values[0])


def test_a_step_turns_a_node_by_two_radians():
    """The limit is 120 degrees; a body in fast rotation, whose steps are divided above it."""
    for spin, substeps in ((200.0, 100), (300.0, 100), (400.0, 200)):
        body = ub.Body((0, 0, 0), mass=1.0, inertia=(1, 2, 2.5), name="top")
        start = ub.Velocity([body], angular=(0, 0, spin), linear=(0, 0, 0), about=(0, 0, 0))
        scene = ub.Scene(bodies=[body], initial=[start])
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
        assert run.substeps == substeps
        assert run.energy.worst < 1e-10
    with pytest.raises(ub.ConvergenceError, match=r"top turns by 1\d\d° in the step"):
        ub.simulate(
            scene, ub.EnergyMomentum(), t=(0, 1), dt=ub.Adaptive(1.0, first=0.1, shortest=0.05),
        )  # fmt: skip


AT, AXIS = (0.3, 0.7, 0.2), (0.36, 0.48, 0.8)
JOINTS = {
    "revolute": lambda beam, ball: ub.Revolute(beam.end, ball.at(*AT), axis=AXIS),
    "prismatic": lambda beam, ball: ub.Prismatic(beam.end, ball.at(*AT), axis=AXIS),
    "link": lambda beam, ball: ub.Link(beam.end, ball.middle),
}


@pytest.mark.parametrize("joint", JOINTS)
def test_small_loads_on_joints_at_rest(joint):
    """Constraints have all digits of small motions: a load of 1e-9 N moves as one of 1 N does."""
    tips = []
    for size in (1.0, 1e-9):
        beam = ub.Beam((0, 0, 0), AT, ub.Section(**STIFF, **OTHER), cells=2)
        ball = ub.Body((0.8, 0.9, 0.1), mass=1.0, inertia=TENSOR)
        load = ub.PointLoad(ball.middle, force=(0, size, 2 * size), amplitude=lambda t: t)
        scene = ub.Scene(
            [beam], bodies=[ball], joints=[JOINTS[joint](beam, ball)],
            supports=[ub.Clamped(beam.start)], loads=[load],
        )  # fmt: skip
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.04), dt=0.01)
        assert run.substeps == 4
        tips.append(run.displacement(ball.middle)[-1, :3] / size)
    # The motion under 1 N is 1e-5 m; what is nonlinear in it is that part of it.
    assert np.abs(tips[0] - tips[1]).max() < 1e-3 * np.abs(tips[0]).max()


SLENDER = 1e2, 1e4, 1e6


def rod(slenderness):
    """A steel rod of 1 m, and its section."""
    d, E, G, rho = 1 / slenderness, 210e9, 81e9, 7850.0
    A, I = np.pi * d**2 / 4, np.pi * d**4 / 64
    section = ub.Section(
        EA=E * A, GA=0.9 * G * A, GA3=0.9 * G * A, EI=E * I, EI2=E * I, GJ=2 * G * I,
        rhoA=rho * A, rhoI=rho * I, rhoI2=rho * I,
    )  # fmt: skip
    beam = ub.Beam((0, 0, 0), (1, 0, 0), section, cells=8, name="rod")
    return beam, section


@pytest.mark.serial  # at 1e6, round-off decides which iterate has the tolerance
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentumStatic()], ids=str)
@pytest.mark.parametrize("slenderness", SLENDER)
def test_slender_rods(slenderness, scheme):
    """Forces that bend the rod far; its axial stiffness is up to 1e13 times that of bending."""
    beam, section = rod(slenderness)
    force = (0, section.EI, section.EI)
    load = ub.PointLoad(beam.end, force=force, amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.1)
    assert run.energy.worst < 1e-9
    if not scheme.dynamic:
        assert np.linalg.norm(run.displacement(beam.end)[-1, :3]) > 0.3


@pytest.mark.parametrize("spin", [(0, 1e3, 10), (1e3, 10, 0), (300, 400, 500)], ids=str)
def test_fast_spins(spin):
    """Steps of ten radians are divided."""
    beam, _ = rod(20)
    start = ub.Velocity([beam], angular=spin, linear=(0, 0, 0), about=(0.5, 0, 0))
    scene = ub.Scene([beam], initial=[start])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.01, newton=EXACT)
    assert run.substeps > 10
    assert run.energy.worst < 1e-9


@pytest.mark.filterwarnings("ignore:rod. its section is:ufl_beam.ModelWarning")
@pytest.mark.parametrize("factor", [1e-6, 1e6])
@pytest.mark.parametrize("name", ["EA", "GA", "GJ", "EI2", "rhoA", "rhoI"])
def test_ratios_of_stiffness_and_mass(name, factor):
    """Each run closes its ledger, or ends with an error that names a cell."""
    beam, section = rod(20)
    values = {x: getattr(section, x) * (factor if x == name else 1.0) for x in STIFF | OTHER}
    beam = ub.Beam((0, 0, 0), (1, 0, 0), ub.Section(**values), cells=8, name="rod")
    load = ub.PointLoad(beam.end, force=(0, 1e3, 1e3))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    try:
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.01)
    except ub.ConvergenceError as error:
        run, words = error.solution, str(error)
    else:
        words = "A cell, rod at ("
    assert "A cell, rod at (" in words
    assert run.energy.worst < 1e-10 * max(1.0, np.abs(run.energy["loads"]).max())
