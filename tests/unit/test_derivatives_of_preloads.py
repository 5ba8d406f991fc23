# SPDX-License-Identifier: MIT
"""Derivatives of a run that begins at the end of a run with another scheme or model."""

import math
from dataclasses import replace
from functools import cache, partial, wraps

import numpy as np
import pytest
from helpers import raises
from run_differences import TIGHT, defaults, difference
from scenes import clamped

import ufl_beam as ub

pytestmark = pytest.mark.serial

SAME = 1e-7
"""Differences of two runs to 1e-13, with changes from 1e-3 to 1e-5 of a parameter."""

LEAST = 1e-3
"""Least effect of a parameter, relative to the largest, of which differences have these digits."""

PRELOAD = {"t": (0, 1), "dt": 0.05}
MOTION = {"t": (1, 1.2), "dt": 0.02}


def section(EI, rho=60.0, **more):
    return ub.Section(EA=2e6, GA=7e5, EI=EI, rhoA=rho, rhoI=0.1, **more)


def later(size, before=1.0):
    """Amplitude that grows to ``before`` at 1 s, and then swings."""
    return lambda t: before * t if t < 1 else before + size * math.sin(9 * (t - 1))


def loaded(EI=4e3, length=2.0, load=300.0, normal=50.0, curvature=0.1, move=0.05):
    """Dead, follower and distributed loads, imposed strains, and a support that moves."""
    beam = ub.Beam((0, 0), (length, 0), section(EI), cells=4)
    return ub.Scene(
        [beam],
        supports=[ub.PrescribedDisplacement(beam.start, u=0.0, v=later(move, move), psi=0.0)],
        loads=[
            ub.Gravity(),
            ub.PointLoad(beam.end, force=(0, load), amplitude=later(0.5)),
            ub.FollowerLoad(beam.end, (-load / 5, 20.0), amplitude=later(1.0)),
            ub.Pressure(beam, normal, 10.0, amplitude=later(1.0)),
            ub.ImposedStrain(beam, 1e-3, curvature, later(0.2)),
        ],
    )


def yielding(EI=4e3, limit=900.0, hardening=800.0, rho=60.0, load=200.0, mass=5.0):
    """Yielding sections, damping and a mass."""
    law = ub.ElastoPlastic(limit, isotropic=hardening, kinematic=hardening / 2)
    beam = ub.Beam((0, 0), (2, 0), section(EI, rho, bending=law), cells=4)
    loads = [
        ub.LineLoad(beam, force=(0, -9.81 * rho), amplitude=later(0.2)),
        ub.PointLoad(beam.end, force=(0, -load), amplitude=later(2.0, 0.3)),
    ]
    masses, damping = [ub.PointMass(beam.end, mass)], [ub.KelvinVoigt(1e-3)]
    return clamped(beam, masses=masses, loads=loads, damping=damping)


def smooth(EI=4e3, length=2.0, load=300.0, rho=60.0):
    """For schemes that need smooth scenes."""
    beam = ub.Beam((0, 0), (length, 0), section(EI, rho), cells=4)
    push = ub.PointLoad(beam.end, force=(0, load), amplitude=later(0.5))
    return clamped(beam, loads=[ub.Gravity(), push])


def machine(stiffness=900.0, limit=15.0, viscosity=60.0, friction=30.0, hinge=180.0, push=80.0):
    """Connectors with a state, a motor, an actuator, and a hinge that opens in the preload."""
    softening = ub.LinearSoftening(hinge, 600.0)
    a = ub.Beam((0, 0), (1, 0), section(4e3), cells=2, hinges={0.0: softening})
    b = ub.Beam((1, 0), (2, 0), section(4e3), cells=2)

    def rubber(motion, rate, state):
        return 2e3 * motion + 9e3 * motion**3 + state[0], [0.5 * (state[0] + viscosity * motion)]

    spring = ub.Spring(stiffness, law=ub.ElastoPlastic(limit, isotropic=stiffness / 5))
    return ub.Scene(
        [a, b], joints=[ub.Revolute(a.end, b.start)], supports=[ub.Clamped(a.start)],
        connectors=[
            ub.Turn(a.end, b.start, spring),
            ub.Slide(ub.ground(2, -1), b.end, ub.ForceLaw(rubber, state=[0.0]), axis=(0, 1)),
            ub.Slide(ub.ground(1, -1), a.end, ub.Damper(viscosity), axis=(0, 1)),
            ub.Slide(ub.ground(3, 0), b.end, ub.Coulomb(friction), axis=(1, 0)),
            ub.Slide(ub.ground(0, 1), b.at(0.5), ub.PrescribedForce(
                lambda t: push * math.sin(2 * t)), axis=(0, 1)),
        ],
        loads=[ub.LineLoad(a, force=(0, -600.0), amplitude=later(0.3))],
    )  # fmt: skip


def tip(s):
    return s.displacement(s.scene.beams[-1].end)


def reactions(s):
    return s.reaction(s.scene.supports[0])[1:]


def energies(s):
    return np.array([s.energy.state["stored"], *s.energy.lost.values()])


def forces(s):
    diagrams = [s.diagram(s.scene.beams[0], n, points=3) for n in range(len(s))]
    return np.array([[x.N, x.V, x.M] for x in diagrams])


TO_THE_DIGITS = {"newton": TIGHT}


@cache
def preloaded(model, scheme, name, x):
    """Preload with one parameter that differs; the tests of all schemes of the motion share it."""
    return ub.simulate(model(**{**defaults(model), name: x}), scheme, **PRELOAD, **TO_THE_DIGITS)


@cache
def derivatives_of_preload(model, scheme, unused):
    at = defaults(model)
    return ub.differentiate(model, at, scheme, unused=unused, **PRELOAD, **TO_THE_DIGITS)


def disagreements(first, second, schemes, quantities, enough, unused=("mass",)):
    """Least errors of the derivatives of quantities by each parameter of two models.

    After errors below ``enough`` the other changes of a parameter are left out.
    """
    at, (before, scheme) = defaults(first), schemes
    unused = tuple(name for name in unused if name in at)
    start = derivatives_of_preload(first, before, unused)
    more = {"unused": unused} if not scheme.dynamic else {}
    run = ub.differentiate(second, at, scheme, **MOTION, start=start, **more, **TO_THE_DIGITS)

    def both(name, x):
        one = preloaded(first, before, name, x)
        scene = one.scene if first is second else second(**{**at, name: x})
        end = ub.simulate(scene, scheme, **MOTION, start=one, **TO_THE_DIGITS)
        return np.concatenate([np.ravel(of(end)) for of in quantities])

    cuts = np.cumsum([np.size(of(run.solution)) for of in quantities])[:-1]
    found = [run.of(of).reshape(-1, len(at)) * list(at.values()) for of in quantities]
    errors = np.full((len(quantities), len(at)), np.inf)
    for p, name in enumerate(at):
        for h in (1e-3, 1e-4, 1e-5):
            fds = np.split(difference(partial(both, name), at[name], h * at[name]), cuts)
            for k, (x, fd) in enumerate(zip(found, fds, strict=True)):
                size = max(np.abs(x[:, p]).max(), LEAST * np.abs(x).max())
                error = np.abs(x[:, p] - at[name] * fd).max() / size
                errors[k, p] = min(errors[k, p], error)
            if (errors[:, p] < enough).all():
                break
    return errors


@pytest.mark.filterwarnings("ignore:differentiate. the run does not depend")  # in statics
@pytest.mark.parametrize(
    ("model", "scheme"),
    [
        (loaded, ub.EnergyMomentum(0.05, 0.05)),
        (loaded, ub.EnergyMomentumPrinted()),
        (loaded, ub.EnergyMomentumStatic(0.7)),
        (yielding, ub.GeneralizedAlpha(0.7)),
        (machine, ub.EnergyMomentum(0.05, 0.05)),
        (machine, ub.EnergyMomentumStatic(0.7)),
        (smooth, ub.Newmark()),
        (smooth, ub.EnergyMomentum(order=4)),  # without energies
    ],
)
def test_motion_after_a_preload(model, scheme):
    quantities = [tip, reactions, *([energies] if model is not smooth else [])]
    errors = disagreements(model, model, (ub.Static(), scheme), quantities, SAME)
    assert errors.max() < SAME, errors


def test_reactions_of_the_first_state_of_a_static_run():
    """The load and its moment about the support, in runs with one scheme and with two."""

    def cantilever(load=70.0, length=2.0):
        beam = ub.Beam((0, 0), (length, 0), section(1e5), cells=4)
        return clamped(beam, loads=[ub.PointLoad(beam.end, (0, load), amplitude=later(1.0))])

    at = defaults(cantilever)
    start = ub.differentiate(cantilever, at, ub.Static(), **PRELOAD, **TO_THE_DIGITS)
    for scheme in ub.Static(), ub.EnergyMomentumStatic(0.7):
        run = ub.differentiate(cantilever, at, scheme, **MOTION, start=start, **TO_THE_DIGITS)
        first = run.of(lambda s: s.reaction(s.scene.supports[0])[0])
        np.testing.assert_allclose(first[1:], [[-1, 0], [-2, -70]], rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("schemes", [
    (ub.EnergyMomentum(), ub.EnergyMomentumDecaying()),
    (ub.Newmark(), ub.GeneralizedAlpha(0.7)),
    (ub.EnergyMomentum(), ub.Static()),
], ids=repr)  # fmt: skip
def test_a_dynamic_run_goes_on_with_another_scheme(schemes):
    """Rates of both schemes, and section forces, which the first state may have from the step."""
    enough = np.array([SAME, SAME, 1e-5])  # normal forces are small differences
    errors = disagreements(yielding, yielding, schemes, [tip, energies, forces], enough)
    assert (errors.max(axis=1) < enough).all(), errors


def test_two_models_with_other_beams_are_refused():
    at = {"load": 9.0}
    start = ub.differentiate(lambda load: loaded(load=load), at, ub.Static(), **PRELOAD)
    with raises("differentiate: model and the model of start have different", "functools.cache"):
        ub.differentiate(
            lambda load: loaded(load=load), at, ub.EnergyMomentum(), **MOTION, start=start
        )


def test_two_models_with_the_same_beams():
    """Damping is refused in statics, and a joint is removed after it."""

    @cache
    def whole(EI=4e3, limit=700.0, mass=20.0, joint=1.0, damping=0.3):
        a = ub.Beam((0, 0), (joint, 0), section(EI, bending=ub.ElastoPlastic(limit, 400.0)))
        b = ub.Beam((joint, 0), (2, 0.3), section(EI), cells=3)
        return ub.Scene(
            [a, b], supports=[ub.Clamped(a.start)], loads=[ub.Gravity()],
            joints=[ub.Revolute(a.end, b.start), ub.Rigid(b.end, ub.ground(2, 0.3))],
            connectors=[ub.Turn(a.end, b.start, ub.Spring(900.0))],
            masses=[ub.PointMass(b.start, mass)],
            damping=[ub.Rayleigh(mass=damping, stiffness=1e-3, tangent=True)],
        )  # fmt: skip

    @wraps(whole)
    def undamped(**values):
        return replace(whole(**values), damping=())

    @wraps(whole)
    def free(**values):
        scene = whole(**values)
        return replace(scene, joints=scene.joints[:1])

    schemes = ub.Static(), ub.EnergyMomentum()
    with raises("the run does not depend on damping", "unused=['damping'] if a run with start="):
        disagreements(undamped, free, schemes, [tip], 1e-6)
    errors = disagreements(undamped, free, schemes, [tip, reactions], 1e-6, ["damping", "mass"])
    assert errors.max() < 1e-6, errors
