# SPDX-License-Identifier: MIT
"""Derivatives of runs: loads that move with the scene, works, imposed strains, damping, guides."""

import math

import numpy as np
import pytest
import ufl
from helpers import in_turn, raises
from run_differences import TIGHT, defaults, errors
from scenes import clamped
from user_laws import AirDrag, HardeningSpring, MaxwellElement

import ufl_beam as ub

pytestmark = [
    pytest.mark.serial,
    pytest.mark.filterwarnings("ignore:VirtualWork 'air' takes v"),  # a damper in statics
]
DYNAMIC = ub.EnergyMomentum(0.02, 0.01), ub.GeneralizedAlpha(0.8)
STATIC = ub.Static(), ub.EnergyMomentumStatic(0.7)
TWO_STEPS = {"t": (0, 0.1), "dt": 0.05}


def scene_of(EI, *loads, law=None, supports=(), **parts):
    """A cantilever of 2 m that a dead load shakes; loads are functions of the beam."""
    section = ub.Section(EA=1e4, GA=8e3, EI=EI, rhoA=1.0, rhoI=0.05, depth=0.3, bending=law)
    beam = ub.Beam((0, 0), (2, 0.3), section, cells=4)
    shake = ub.PointLoad(beam.end, force=(0, 8), amplitude=lambda t: math.sin(2 * t))
    parts = {name: make(beam) for name, make in parts.items()}
    supports = [make(beam) for make in supports]
    return clamped(beam, *supports, loads=[shake, *(f(beam) for f in loads)], **parts)


def sine(rate):
    return lambda t: math.sin(rate * t)


def cosine(rate):
    return lambda t: math.cos(rate * t)


def growing(t):
    return t


def following(load=6.0, moment=2.0, normal=5.0, tangential=20.0, first=1.0, rate=3.0, EI=100.0):
    """A follower load and pressure."""
    more = {"profile": (first, 0.5), "amplitude": sine(rate)}
    return scene_of(
        EI,
        lambda b: ub.FollowerLoad(b.end, (-load / 3, load), moment, amplitude=sine(rate)),
        lambda b: ub.Pressure(b, normal, tangential, **more),
    )


def frame(rate=2.0, about=-0.5, mass=0.4, EI=100.0):
    return scene_of(
        EI, lambda b: ub.RotatingFrame(rate, about=(about, 0.2)),
        masses=lambda b: [ub.PointMass(b.end, mass)],
    )  # fmt: skip


def place(start, speed, bend):
    return lambda t: start + speed * t + bend * t**2


def moving(force=6.0, speed=1.3, bend=0.3, rate=3.0):
    """A force that passes nodes, where its forces on cells have kinks."""
    at, F = place(0.1, speed, bend), (0.2 * force, -force)
    return scene_of(100.0, lambda b: ub.MovingLoad(b, at, F, sine(rate)))


def moving_mass(speed=1.3, bend=0.3, mass=0.5, rate=3.0):
    at = place(0.1, speed, bend)
    return scene_of(100.0, lambda b: ub.MovingLoad(b, at, (0, -3), sine(rate), mass=mass))


def passing_mass(start=0.2, speed=5.0, bend=0.3, mass=0.5):
    """A mass that comes at 0.04 s and leaves at 0.43 s; its velocity is a state of its own."""
    at = place(-start, speed, bend)
    return scene_of(100.0, lambda b: ub.MovingLoad(b, at, (0, -3), mass=mass))


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


def imposed(axial=1e-3, curvature=0.3, rate=3.0, EI=100.0, law=None):
    """Strains that do not begin at zero, with a support that hinders them."""
    return scene_of(
        EI, lambda b: ub.ImposedStrain(b, axial, (curvature, 0.1), cosine(rate)),
        law=law, supports=[lambda b: ub.Roller(b.end)],
    )  # fmt: skip


def imposed_on_points(axial=1e-3, curvature=0.3, rate=3.0, limit=4.0):
    return imposed(axial, curvature, rate, law=ub.ElastoPlastic(limit, 20.0, 10.0))


def viscous(time=0.02, EI=100.0):
    return scene_of(EI, damping=lambda b: [ub.KelvinVoigt(time)])


def damped(mass=0.2, stiffness=0.01, EI=100.0, law=None):
    matrix = ub.Rayleigh(mass=mass, stiffness=stiffness, tangent=True)
    return scene_of(EI, damping=lambda b: [matrix], law=law)


def damped_points(mass=0.2, stiffness=0.01, EI=100.0, limit=6.0):
    return damped(mass, stiffness, EI, ub.ElastoPlastic(limit, 20.0, 10.0))


def guided(radius=2.0, dent=0.5, load=8.0):
    """A curve whose points are not at equal distances for equal steps of its parameter.

    Points move far in a step: directions of short chords have round-off.
    """

    def curve(s):
        return 2 * ufl.cos(s) + dent * ufl.sin(s) ** 2, 0.3 + radius * ufl.sin(s) * (1 + s / 5)

    return scene_of(
        100.0,
        lambda b: ub.PointLoad(b.end, (0, load), amplitude=growing),
        lambda b: ub.PointLoad(b.at(0.5), (0, -load / 2), amplitude=growing),
        joints=lambda b: [ub.Guided(b.end, curve)],
    )


def saturated(c=0.8):
    """Drag by a function for which there are no vectors, so that elements are computed singly."""

    def drag(v, w, c):
        return -c * ufl.tanh(v[1]) * w[1]

    return scene_of(100.0, works=lambda b: [ub.VirtualWork("air", drag, numbers={"c": c})])


def pressed_hard(load=60.0, normal=40.0, curvature=2.0, growth=1.0):
    """Loads that a static step cannot apply at once."""
    return scene_of(
        10.0,
        lambda b: ub.FollowerLoad(b.end, (-20, load), amplitude=growing),
        lambda b: ub.Pressure(b, normal, 20.0, amplitude=growing),
        lambda b: ub.ImposedStrain(b, 1e-3, curvature, growing),
        lambda b: ub.RotatingFrame(3.0, about=(-1, 0)),
        works=lambda b: [ub.Potential("soil", soil, numbers={"k": lambda t: 5 * growth * t})],
    )


MODELS = (following, moving, frame, works, effects, imposed, viscous, imposed_on_points, guided)
ONLY_DYNAMIC = damped, damped_points


SAME = 5e-8
"""Differences of runs have an error of 1e-12 by a step of 1e-3; solutions have 1e-12 of the largest
force, divided by this step, and some parameters change them by a hundredth only.  Derivatives by
differences of numbers and tangents have round-off over a step of 1e-4."""


def require_differences_of_runs(model, scheme, t=1.0, dt=0.05, **options):
    """Relative changes from the largest: a point may yield in one of the runs only."""
    changes = {"changes": (1e-3, 1e-4, 1e-5), "enough": SAME}
    found = errors(model, defaults(model), scheme, t=(0, t), dt=dt, **changes, **options)
    assert max(found.values()) < SAME, found


@pytest.mark.parametrize(
    ("model", "scheme"),
    [
        *in_turn(MODELS, [*DYNAMIC, *STATIC]),  # a dynamic and a static one
        *((model, scheme) for model in ONLY_DYNAMIC for scheme in DYNAMIC),
    ],
)
def test_derivatives_are_those_of_runs(model, scheme):
    require_differences_of_runs(model, scheme, dt=0.05 if scheme.dynamic else 0.1)


@pytest.mark.parametrize(
    ("model", "degree"),
    [(frame, 2), (saturated, 1)]
    + [pytest.param(x, 2, marks=pytest.mark.slow) for x in (viscous, moving_mass, damped_points)],
)
def test_derivatives_are_those_of_runs_in_curved_cells_and_single_elements(model, degree):
    require_differences_of_runs(model, ub.EnergyMomentum(0.02), 0.6, mesh=ub.Mesh(degree=degree))


@pytest.mark.parametrize("scheme", STATIC, ids=repr)
def test_derivatives_are_those_of_runs_whose_steps_are_divided(scheme):
    run = ub.simulate(pressed_hard(), scheme, t=(0, 1), dt=0.5)
    assert run.substeps > len(run) - 1
    require_differences_of_runs(pressed_hard, scheme, dt=0.5)


@pytest.mark.parametrize(
    ("model", "scheme"),
    [
        *((model, scheme) for model in MODELS for scheme in STATIC[1:] if model is not viscous),
        *((model, DYNAMIC[0]) for model in (works, effects, viscous, moving_mass, *ONLY_DYNAMIC)),
    ],
)
def test_a_run_in_two_parts_has_the_derivatives_of_one(model, scheme):
    at, options = defaults(model), {"dt": 0.05, "newton": TIGHT}
    first = ub.differentiate(model, at, scheme, t=(0, 0.3), **options)
    second = ub.differentiate(model, at, scheme, t=(0.3, 0.6), start=first, **options)
    whole = ub.differentiate(model, at, scheme, t=(0, 0.6), **options)
    parts, one = (x.of(lambda run: run.q[-1]) for x in (second, whole))
    # Both solve the same equations; last digits matter to curves
    same = SAME if model is guided else 1e-9
    assert parts == pytest.approx(one, rel=same, abs=same * np.abs(one).max())


@pytest.mark.parametrize(
    ("model", "scheme"),
    [
        *((model, DYNAMIC[0]) for model in (following, frame, works, effects)),
        *((model, STATIC[0]) for model in (following, frame)),
        *((passing_mass, x) for x in (*DYNAMIC, ub.EnergyMomentumDecaying())),
    ],
)
def test_adjoint_is_the_same_sum(model, scheme):
    """They are the same sums in another order; 1e-9 is round-off of differences in `of`."""
    at, options = defaults(model), {"t": (0, 0.6), "dt": 0.03}
    direct = ub.differentiate(model, at, scheme, **options).of(lambda run: run.q[-1, 4])
    _, found = ub.gradient(model, at, scheme, **options, of=lambda run: run.q[:, 4])
    np.testing.assert_allclose(found, direct, rtol=1e-8, atol=1e-10 * np.abs(direct).max())
    if model is passing_mass:
        require_differences_of_runs(model, scheme, 0.6, 0.03)


@pytest.mark.parametrize("model", [following, works, viscous, imposed_on_points])
def test_a_number_without_effect_changes_nothing(model):
    """Differences of equal forces are exact zeros: round-off would pass for a small effect."""
    with raises("the run does not depend on x"):
        ub.differentiate(lambda x: model(), {"x": 1.0}, ub.EnergyMomentum(), **TWO_STEPS)


def test_masses_that_begin_at_zero_are_refused():
    """The terms of the scene itself then lack the effect."""
    with raises("mass changes the cells, unknowns or parts of the scene"):
        ub.differentiate(moving_mass, {"mass": 0.0}, ub.EnergyMomentum(), **TWO_STEPS)


def test_an_error_in_a_neighbouring_scene_ends_the_call():
    """Its derivative would be NaN."""

    def limited(load):
        def size(t):
            if load > 6.0 and t > 0.05:
                raise ValueError("too much")
            return t

        return scene_of(100.0, lambda b: ub.FollowerLoad(b.end, (0, load), amplitude=size))

    with raises("too much", kind=ValueError):
        ub.differentiate(limited, {"load": 6.0}, ub.Static(), **TWO_STEPS)
