# SPDX-License-Identifier: MIT
"""Derivatives of runs: loads that move with the scene, works, imposed strains, damping, guides."""

import math

import numpy as np
import pytest
import ufl
from helpers import raises
from user_laws import AirDrag, HardeningSpring, MaxwellElement

import ufl_beam as ub
from ufl_beam.analysis import derivatives

WEIGHTS = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
"""Five-point difference."""

TIGHT = ub.Newton(rtol=1e-12)
"""Differences divide errors of solutions by 1e-3 of a parameter."""

DYNAMIC = ub.EnergyMomentum(0.02, 0.01), ub.GeneralizedAlpha(0.8)
STATIC = ub.Static(), ub.EnergyMomentumStatic(0.7)


def scene_of(EI, *loads, law=None, supports=(), start=ub.Clamped, **parts):
    """A cantilever of 2 m that a dead load shakes; loads are functions of the beam."""
    section = ub.Section(EA=1e4, GA=8e3, EI=EI, rhoA=1.0, rhoI=0.05, depth=0.3, bending=law)
    beam = ub.Beam((0, 0), (2, 0.3), section, cells=4)
    shake = ub.PointLoad(beam.end, force=(0, 8), amplitude=lambda t: math.sin(2 * t))
    parts = {name: make(beam) for name, make in parts.items()}
    supports = [start(beam.start), *(make(beam) for make in supports)]
    return ub.Scene([beam], supports=supports, loads=[shake, *(f(beam) for f in loads)], **parts)


def sine(rate):
    return lambda t: math.sin(rate * t)


def follower(load=6.0, moment=2.0, rate=3.0, EI=100.0):
    force = (-load / 3, load)
    return scene_of(EI, lambda b: ub.FollowerLoad(b.end, force, moment, amplitude=sine(rate)))


def pressure(normal=5.0, tangential=20.0, first=1.0, rate=3.0):
    profile = (first, 0.5)
    more = {"profile": profile, "amplitude": sine(rate)}
    return scene_of(100.0, lambda b: ub.Pressure(b, normal, tangential, **more))


def frame(rate=2.0, about=-0.5, mass=0.4, EI=100.0):
    return scene_of(
        EI, lambda b: ub.RotatingFrame(rate, about=(about, 0.2)),
        masses=lambda b: [ub.PointMass(b.end, mass)],
    )  # fmt: skip


def moving(force=6.0, speed=1.3, bend=0.3, rate=3.0):
    """A force that passes nodes, where its forces on cells have kinks."""

    def place(t):
        return 0.1 + speed * t + bend * t**2

    return scene_of(100.0, lambda b: ub.MovingLoad(b, place, (0.2 * force, -force), sine(rate)))


def moving_mass(speed=1.3, bend=0.3, mass=0.5, rate=3.0):
    def place(t):
        return 0.1 + speed * t + bend * t**2

    return scene_of(100.0, lambda b: ub.MovingLoad(b, place, (0, -3), sine(rate), mass=mass))


def passing_mass(start=0.2, speed=5.0, bend=0.3, mass=0.5):
    """A mass that comes at 0.04 s and leaves at 0.43 s."""

    def place(t):
        return -start + speed * t + bend * t**2

    return scene_of(100.0, lambda b: ub.MovingLoad(b, place, (0, -3), mass=mass))


def drag(v, w, q, c, k, t):
    speed = (v[0] ** 2 + v[1] ** 2 + 1e-3) ** 0.5
    return -c * speed * (v[0] * w[0] + v[1] * w[1]) - k * q[1] * w[1] * (1 + t)


def soil(q, k):
    return k * (q[1] ** 4 / 4 + q[1] ** 2 / 6)


def works(c=0.8, k=3.0, stiffness=20.0, growth=0.5):
    """Numbers and functions of time."""
    numbers = {"c": c, "k": lambda t: k * math.exp(growth * t)}
    size = {"k": lambda t: stiffness * (1 + growth * t)}
    air = ub.VirtualWork("air", drag, numbers=numbers)
    return scene_of(100.0, works=lambda b: [air, ub.Potential("soil", soil, numbers=size)])


def effects(c=0.8, k=3.0, growth=0.5, h=20.0, time=0.3):
    """Statements of a user along the beam and between places, with states, and in time."""
    hardening = {"k": lambda t: k * math.exp(growth * t), "h": h}
    place, maxwell = ub.ground(2, 1), {"k": 9.0, "time": time}
    return scene_of(
        100.0,
        works=lambda b: [
            ub.Effect(AirDrag(), beams=[b], numbers={"c": c}),
            ub.Effect(HardeningSpring(), places=[place, b.end], numbers=hardening),
            ub.Effect(MaxwellElement(), places=[b.at(0.5), b.end], numbers=maxwell),
        ],
    )


def imposed(axial=1e-3, curvature=0.3, rate=3.0, EI=100.0):
    """Strains that do not begin at zero, with a support that hinders them."""
    return scene_of(
        EI, lambda b: ub.ImposedStrain(b, axial, (curvature, 0.1), lambda t: math.cos(rate * t)),
        supports=[lambda b: ub.Roller(b.end)],
    )  # fmt: skip


def imposed_on_points(axial=1e-3, curvature=0.3, rate=3.0, limit=4.0):
    return scene_of(
        100.0, lambda b: ub.ImposedStrain(b, axial, (curvature, 0.1), lambda t: math.cos(rate * t)),
        law=ub.ElastoPlastic(limit, 20.0, 10.0), supports=[lambda b: ub.Roller(b.end)],
    )  # fmt: skip


def viscous(time=0.02, EI=100.0):
    return scene_of(EI, damping=lambda b: [ub.KelvinVoigt(time)])


def damped(mass=0.2, stiffness=0.01, EI=100.0):
    matrix = ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=True)
    return scene_of(EI, damping=lambda b: [matrix])


def damped_points(mass=0.2, stiffness=0.01, EI=100.0, limit=6.0):
    matrix = ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=True)
    law = ub.ElastoPlastic(limit, 20.0, 10.0)
    return scene_of(EI, damping=lambda b: [matrix], law=law)


def guided(radius=2.0, dent=0.5, load=8.0):
    """A curve whose points are not at equal distances for equal steps of its parameter.

    Points move far in a step: directions of short chords have round-off.
    """

    def curve(s):
        return 2 * ufl.cos(s) + dent * ufl.sin(s) ** 2, 0.3 + radius * ufl.sin(s) * (1 + s / 5)

    def grow(t):
        return t

    return scene_of(
        100.0,
        lambda b: ub.PointLoad(b.end, (0, load), amplitude=grow),
        lambda b: ub.PointLoad(b.at(0.5), (0, -load / 2), amplitude=grow),
        joints=lambda b: [ub.Guided(b.end, curve)],
    )


MODELS = (
    follower, pressure, frame, moving, moving_mass, works, effects, imposed, imposed_on_points,
    viscous, damped, damped_points, guided,
)  # fmt: skip
ONLY_DYNAMIC = moving_mass, damped, damped_points


SAME = 5e-8
"""Differences of runs have an error of 1e-12 by a step of 1e-3; solutions have 1e-12 of the largest
force, divided by this step, and some parameters change them by a hundredth only.  Derivatives by
differences of numbers and tangents have round-off over a step of 1e-4."""

STEPS = 1e-3, 1e-4, 1e-5
"""Relative steps of differences, from the largest: a point may yield in one of the runs only."""


def disagreement(model, scheme, t, dt, **options):
    """Largest difference from five-point differences of runs, relative to their largest value."""
    at = dict(zip(model.__code__.co_varnames, model.__defaults__, strict=False))
    options = {"t": (0, t), "dt": dt, "newton": TIGHT, "progress": False, **options}
    found = ub.differentiate(model, at, scheme, **options)
    exact, worst = found.of(lambda run: run.q), 0.0
    for p, (name, value) in enumerate(at.items()):
        errors = [np.inf]
        for h in (step * value for step in STEPS):
            runs = {
                k: ub.simulate(model(**{name: value + k * h}), scheme, **options) for k in WEIGHTS
            }
            if {run.substeps for run in runs.values()} == {found.solution.substeps}:
                differences = sum(w * runs[k].q for k, w in WEIGHTS.items()) / h
                error = np.abs(exact[..., p] - differences).max() / np.abs(differences).max()
                errors.append(error)
            if min(errors) < SAME:
                break
        worst = max(worst, min(errors))
    return worst, found.solution


@pytest.mark.serial
@pytest.mark.parametrize("scheme", DYNAMIC, ids=repr)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_in_dynamics_are_those_of_runs(model, scheme):
    if model is frame and not scheme.has_mean_velocity:
        pytest.skip("refused: a rotating frame needs the mean velocity of a step")
    assert disagreement(model, scheme, 1.0, 0.05)[0] < SAME


@pytest.mark.serial
@pytest.mark.filterwarnings("ignore:VirtualWork 'air' takes v")  # a damper in statics
@pytest.mark.parametrize("scheme", STATIC, ids=repr)
@pytest.mark.parametrize("model", [m for m in MODELS if m not in ONLY_DYNAMIC])
def test_derivatives_in_statics_are_those_of_runs(model, scheme):
    assert disagreement(model, scheme, 1.0, 0.1)[0] < SAME


@pytest.mark.serial
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=repr)
def test_a_number_inside_of_the_function_of_a_work_has_a_derivative(scheme):
    def model(load=3.0):
        return scene_of(100.0, works=lambda b: [ub.VirtualWork("wind", lambda w: load * w[1])])

    assert disagreement(model, scheme, 0.2, 0.1)[0] < SAME


@pytest.mark.serial
def test_derivatives_by_curves_hardly_depend_on_the_step_of_differences(monkeypatch):
    """With a step of 2^-9 round-off is 16 times smaller; the error of the differences is 1e-11.

    The round-off of directions is two last digits over the longest parameter step, 4e-3 of the
    scene, and over 2^-13: 9e-10.  In the first steps the dent hardly changes the motion, and later
    derivatives are 10 to 50 times as large.
    """
    at = {"radius": 2.0, "dent": 0.5}
    options = {"t": (0, 1), "dt": 0.05, "newton": TIGHT, "progress": False}
    found = []
    for step in (derivatives.MODEL_STEP, 2.0**-9):
        monkeypatch.setattr(derivatives, "MODEL_STEP", step)
        found.append(ub.differentiate(guided, at, DYNAMIC[0], **options).of(lambda run: run.q))
    change, size = (np.abs(x).max(axis=(0, 1)) for x in (found[0] - found[1], found[1]))
    assert max(change / size) < SAME


@pytest.mark.serial
@pytest.mark.parametrize(
    ("model", "degree"), [(moving_mass, 3), (imposed_on_points, 3), (damped_points, 2)]
)
def test_derivatives_are_those_of_runs_in_curved_cells(model, degree):
    scheme, mesh = ub.EnergyMomentum(0.02), ub.Mesh(degree=degree)
    assert disagreement(model, scheme, 0.6, 0.05, mesh=mesh)[0] < SAME


def saturated(c=0.8):
    """Drag by a function for which there are no vectors, so that elements are computed singly."""

    def drag(v, w, c):
        return -c * ufl.tanh(v[1]) * w[1]

    return scene_of(100.0, works=lambda b: [ub.VirtualWork("air", drag, numbers={"c": c})])


@pytest.mark.serial
@pytest.mark.parametrize("model", [saturated])
def test_derivatives_of_elements_that_are_computed_singly(model):
    assert disagreement(model, ub.EnergyMomentum(), 0.6, 0.05)[0] < SAME


@pytest.mark.serial
@pytest.mark.filterwarnings("ignore:VirtualWork 'air' takes v")  # a damper in statics
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.EnergyMomentumStatic(0.7)], ids=repr)
@pytest.mark.parametrize("model", MODELS)
def test_a_run_in_two_parts_has_the_derivatives_of_one(model, scheme):
    if not scheme.dynamic and model in ONLY_DYNAMIC:
        pytest.skip("no effect in statics")
    at = dict(zip(model.__code__.co_varnames, model.__defaults__, strict=False))
    options = {"dt": 0.05, "newton": TIGHT, "progress": False}
    first = ub.differentiate(model, at, scheme, t=(0, 0.3), **options)
    second = ub.differentiate(model, at, scheme, t=(0.3, 0.6), start=first, **options)
    whole = ub.differentiate(model, at, scheme, t=(0, 0.6), **options)
    parts, one = (x.of(lambda run: run.q[-1]) for x in (second, whole))
    # Both solve the same equations to 1e-12 of the forces; last digits matter to curves, see below
    same = SAME if model is guided else 1e-9
    assert parts == pytest.approx(one, rel=same, abs=same * np.abs(one).max())


def pressed_hard(load=60.0, normal=40.0, curvature=2.0, growth=1.0):
    """Loads that a static step cannot apply at once."""

    def linear(t):
        return t

    return scene_of(
        10.0,
        lambda b: ub.FollowerLoad(b.end, (-20, load), amplitude=linear),
        lambda b: ub.Pressure(b, normal, 20.0, amplitude=linear),
        lambda b: ub.ImposedStrain(b, 1e-3, curvature, linear),
        lambda b: ub.RotatingFrame(3.0, about=(-1, 0)),
        works=lambda b: [ub.Potential("soil", soil, numbers={"k": lambda t: 5 * growth * t})],
    )


@pytest.mark.serial
@pytest.mark.parametrize("scheme", STATIC, ids=repr)
def test_derivatives_are_those_of_runs_whose_steps_are_divided(scheme):
    error, run = disagreement(pressed_hard, scheme, 1.0, 0.5)
    assert run.substeps > len(run) - 1
    assert error < SAME


@pytest.mark.serial
def test_lengths_of_beams_change_the_forces_of_moving_loads_and_works():
    """Nodes move: lengths, directions and places of the loads change."""

    def model(length=2.0, height=0.3):
        section = ub.Section(EA=1e4, GA=8e3, EI=100.0, rhoA=1.0, rhoI=0.05)
        beam = ub.Beam((0, 0), (length, height), section, cells=3)
        loads = [
            ub.MovingLoad(beam, lambda t: 0.05 + 1.5 * t, (0, -6), mass=0.5),
            ub.Pressure(beam, 5.0, 2.0, amplitude=sine(3.0)),
            ub.ImposedStrain(beam, 1e-3, 0.1, amplitude=sine(3.0)),
        ]
        air = ub.VirtualWork("air", drag, numbers={"c": 0.8, "k": 3.0})
        return ub.Scene(
            [beam], supports=[ub.Clamped(beam.start)], loads=loads, works=[air],
            damping=[ub.KelvinVoigt(0.01)],
        )  # fmt: skip

    assert disagreement(model, ub.EnergyMomentum(), 1.0, 0.05)[0] < SAME


@pytest.mark.serial
@pytest.mark.parametrize("model", [follower, works, viscous, imposed_on_points])
def test_a_number_without_effect_changes_nothing(model):
    """Differences of equal forces are exact zeros: round-off would pass for a small effect."""

    def idle(x):
        return model()

    with raises("the run does not depend on x"):
        options = {"t": (0, 0.2), "dt": 0.1, "progress": False}
        ub.differentiate(idle, {"x": 1.0}, ub.EnergyMomentum(), **options)


@pytest.mark.serial
def test_strains_may_begin_at_zero():
    """Central differences of runs err by the square of their strain, 1e-4."""

    def heated(strain):
        return scene_of(100.0, lambda b: ub.ImposedStrain(b, strain))

    options = {"t": (0, 0.1), "dt": 0.05, "progress": False}
    found = ub.differentiate(heated, {"strain": 0.0}, ub.Static(), **options)
    ends = [ub.simulate(heated(x), ub.Static(), **options).q[-1] for x in (1e-4, -1e-4)]
    expected = (ends[0] - ends[1]) / 2e-4
    error = np.abs(found.of(lambda run: run.q[-1]).ravel() - expected).max()
    assert error < 1e-6 * np.abs(expected).max()


def test_masses_that_begin_at_zero_are_refused():
    """The terms of the scene itself then lack the effect."""
    options = {"t": (0, 0.1), "dt": 0.05, "progress": False}
    with raises("mass changes the cells, unknowns or parts of the scene"):
        ub.differentiate(moving_mass, {"mass": 0.0}, ub.EnergyMomentum(), **options)


@pytest.mark.serial
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(0.02, 0.01), ub.Static()], ids=repr)
@pytest.mark.parametrize(
    "model",
    [
        follower,
        pressure,
        frame,
        works,
        effects,
        viscous,
        imposed,
        moving,
        moving_mass,
        guided,
        damped,
        damped_points,
    ],
)
def test_adjoint_is_the_same_sum(model, scheme):
    """They are the same sums in another order; 1e-9 is round-off of differences in `of`."""
    if model in (viscous, works, effects, *ONLY_DYNAMIC) and scheme == ub.Static():
        pytest.skip("forces by velocities")
    at = dict(zip(model.__code__.co_varnames, model.__defaults__, strict=False))
    options = {"t": (0, 1), "dt": 0.05}
    run = ub.differentiate(model, at, scheme, **options, progress=False)
    direct = run.of(lambda run: run.q[-1, 4])
    _, found = ub.gradient(model, at, scheme, **options, of=lambda run: run.q[:, 4])
    np.testing.assert_allclose(found, direct, rtol=1e-8, atol=1e-10 * np.abs(direct).max())


@pytest.mark.serial
@pytest.mark.parametrize("scheme", [*DYNAMIC, ub.EnergyMomentumDecaying(), ub.Newmark()], ids=repr)
@pytest.mark.parametrize("model", [moving_mass, passing_mass])
def test_derivatives_by_a_mass_that_comes_and_goes(model, scheme):
    """Its velocity is a state of its own; the adjoint is the same sum, see the test above."""
    at = dict(zip(model.__code__.co_varnames, model.__defaults__, strict=False))
    options = {"t": (0, 0.6), "dt": 0.03}
    error, _ = disagreement(model, scheme, 0.6, 0.03)
    assert error < SAME
    run = ub.differentiate(model, at, scheme, **options, progress=False)
    direct = run.of(lambda run: run.q[-1, 4])
    _, found = ub.gradient(model, at, scheme, **options, of=lambda run: run.q[:, 4])
    np.testing.assert_allclose(found, direct, rtol=1e-8, atol=1e-10 * np.abs(direct).max())


@pytest.mark.serial
def test_an_error_in_a_neighbouring_scene_ends_the_call():
    """Its derivative would be NaN."""

    def limited(load):
        def size(t):
            if load > 6.0 and t > 0.5:
                raise ValueError("too much")
            return t

        return scene_of(100.0, lambda b: ub.FollowerLoad(b.end, (0, load), amplitude=size))

    options = {"t": (0, 1), "dt": 0.1, "progress": False}
    with raises("too much", kind=ValueError):
        ub.differentiate(limited, {"load": 6.0}, ub.Static(), **options)
