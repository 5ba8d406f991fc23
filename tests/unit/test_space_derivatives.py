# SPDX-License-Identifier: MIT
"""Derivatives of runs and linear models in space, by differences of runs and by the plane."""

from dataclasses import replace

import numpy as np
import pytest
from into_space import EXACT, SKEW, InSpace, same_in_space
from run_differences import defaults, difference
from scipy.linalg import expm
from test_space import OTHER, PLANAR, STIFF
from test_space_analysis import bent_arm

import ufl_beam as ub


def growing(t):
    return t


def swinging(t):
    return np.sin(4 * t)


# -- derivatives of runs ---------------------------------------------------------------------------


def member(cells=2, **numbers):
    section = ub.Section(**STIFF | OTHER | numbers)
    return ub.Beam((0, 0, 0), (4, 1, 0.5), section, cells=cells)


def about_axes(load=30.0, EI=500.0):
    """A place that turns freely about a skew axis, and a roller in a skew direction."""
    beam = member(EI=EI)
    hinge = ub.PrescribedDisplacement(beam.start, u=0.0, v=0.0, w=0.0, axis=(1, 2, 0.3))
    push = ub.PointLoad(beam.at(0.5), force=(3, 5, load), amplitude=growing)
    supports = [hinge, ub.Roller(beam.end, along=(1, 0.3, 0.4))]
    return ub.Scene([beam], supports=supports, loads=[push])


def driven(moved=0.3, EI=500.0):
    """A support in turned axes that moves, and turns its place by three radians."""
    beam = member(EI=EI)
    support = ub.PrescribedDisplacement(
        beam.start, u=lambda t: moved * t, v=0.0, w=lambda t: -0.1 * t, along=(1, 0.3, 0.6),
        up=(0, 1, 1), axis=(1, 2, 0.3), psi=lambda t: 3 * t,
    )  # fmt: skip
    load = ub.PointLoad(beam.end, force=(3, 5, 20), amplitude=growing)
    return ub.Scene([beam], supports=[support], loads=[load])


def followed(load=20.0, EI=500.0):
    """Follower load, constant moment and pressure."""
    beam = member(EI=EI)
    loads = [
        ub.FollowerLoad(
            beam.end, force=(3, load, 20), moment=(load, 1, 2 * load), amplitude=growing
        ),
        ub.PointLoad(beam.end, moment=(0, load, 0), amplitude=growing),
        ub.Pressure(beam, normal=(load / 5, load / 10), amplitude=growing),
    ]
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=loads)


def rotating(rate=2.0, EI=500.0):
    """A body on an arm in a rotating frame, on a revolute joint with a spring."""
    beam = member(EI=EI)
    ball = ub.Body((4, 1, 0.5), mass=2.0, inertia=(0.3, 0.4, 0.5))
    joint = ub.Revolute(beam.end, ball.middle, axis=(1, 0.5, 2))
    spring = ub.Turn(beam.end, ball.middle, ub.Spring(50.0), axis=(1, 0.5, 2))
    loads = [ub.RotatingFrame(rate=(0.3, rate, 1), about=(0, 1, 0)), ub.Gravity((0, 0, -5.0))]
    return ub.Scene(
        [beam], bodies=[ball], joints=[joint], connectors=[spring], loads=loads,
        supports=[ub.Clamped(beam.start)], damping=[ub.KelvinVoigt(0.01)],
    )  # fmt: skip


def laws(limit=6.0, EI=500.0):
    """Plastic bending about both axes."""
    own, other = (ub.ElastoPlastic(k * limit, kinematic=30.0) for k in (2, 1))
    beam = member(EI=EI, bending=own, bending2=other)
    push = ub.PointLoad(beam.end, force=(1, 7, 9), amplitude=swinging)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])


def fibres(limit=100.0, load=9.0):
    """Plastic fibres."""
    y, z = (x.ravel() for x in np.meshgrid(*[np.linspace(-0.4, 0.4, 3)] * 2))
    section = ub.Section.of_fibres(
        y, np.full(9, 0.1), z=z, fibres=ub.Fibres(ub.ElastoPlastic(limit, kinematic=500.0)),
        E=1e4, nu=0.25, rho=1.0, torsion=0.1,
    )  # fmt: skip
    beam = ub.Beam((0, 0, 0), (4, 1, 0.5), section, cells=2)
    push = ub.PointLoad(beam.end, force=(1, load, 20), amplitude=swinging)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])


def hinged(limit=12.0, EI=500.0):
    """Softening hinges at the foot and in the cells."""
    law = ub.LinearSoftening(limit=limit, fracture_energy=30.0)
    beam = ub.Beam(
        (0, 0, 0), (4, 1, 0.5), ub.Section(**STIFF | OTHER | {"EI": EI}, hinge=law), cells=2,
        hinges={0: law},
    )  # fmt: skip
    push = ub.PointLoad(beam.end, force=(0, 4, 5), amplitude=swinging)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])


def results(s):
    """Return results of all kinds at the end, each relative to its size."""
    beams = s.scene.beams
    lost = [energy[-1] for energy in s.energy.lost.values()]
    connectors = {
        str(x): np.append(s.position(x.a)[-1], s.connector(x).force[-1]) for x in s.scene.connectors
    }
    return connectors | {
        "motion": s.displacement(beams[-1].end)[-1],
        "reaction": s.reaction(s.scene.supports[0])[-1],
        "section forces": s.section_forces(beams[0])[0],
        "energies": np.array([s.energy["stored"][-1], *lost]),
    }


@pytest.mark.filterwarnings("ignore:.*the hinge of the section opened")
@pytest.mark.parametrize(
    ("model", "scheme"),
    [(x, ub.EnergyMomentum()) for x in (about_axes, driven, followed, rotating, bent_arm)]
    + [(x, ub.EnergyMomentum()) for x in (laws, fibres, hinged)]
    + [(x, ub.Static()) for x in (about_axes, driven, bent_arm)]
    + [
        pytest.param(x, ub.Static(), marks=pytest.mark.slow)  # tables compile for 20 s each
        for x in (followed, laws, fibres, hinged)
    ],
)
def test_derivatives_equal_differences_of_runs(model, scheme):
    at, options = defaults(model), {"t": (0, 1), "dt": 0.1, "newton": EXACT}
    run = ub.differentiate(model, at, scheme, **options)
    kinds = results(run.solution)
    cuts = np.cumsum([np.size(x) for x in kinds.values()])[:-1]

    def flat(s):
        return np.concatenate([np.ravel(x) for x in results(s).values()])

    found = run.of(flat)
    for p, (name, x) in enumerate(at.items()):

        def value(x, name=name):
            return flat(ub.simulate(model(**at | {name: x}), scheme, **options))

        pairs = (np.split(z, cuts) for z in (found[:, p], difference(value, x, 1e-4 * x)))
        for (kind, size), a, exact in zip(kinds.items(), *pairs, strict=True):
            scale = max(np.abs(exact).max(), 1e-2 * np.abs(size).max() / x)
            assert np.abs(a - exact).max() < 1e-6 * scale, (kind, name)


def test_a_parameter_of_a_prescribed_rotation_is_refused():
    def model(angle):
        beam = member()
        support = ub.PrescribedDisplacement(
            beam.start, u=0.0, v=0.0, w=0.0, axis=(0, 0, 1), psi=lambda t: angle * t
        )
        return ub.Scene([beam], supports=[support])

    options = {"t": (0, 1), "dt": 0.5}
    with pytest.raises(ub.ArgumentError, match="psi depends on a parameter"):
        ub.differentiate(model, {"angle": 1.0}, ub.Static(), **options)
    with pytest.raises(ub.ArgumentError, match="psi depends on a parameter"):
        ub.gradient(
            model, {"angle": 1.0}, ub.Static(), **options,
            of=lambda s: s.position(s.scene.beams[0].end),
        )  # fmt: skip


def spinning(EI=20.0):
    """A free beam that tumbles by many radians."""
    beam = ub.Beam((6, 0, 0), (0, 8, 0), ub.Section(**STIFF | OTHER | {"EI": EI}), cells=2)
    spin = ub.Velocity([beam], angular=(0.7, 1.4, 2.8), linear=(0, 0, 0), about=(3, 4, 0))
    push = ub.PointLoad(beam.start, force=(1, 2, -2), moment=(1, 0, 3), amplitude=swinging)
    return ub.Scene([beam], initial=[spin], loads=[push])


def test_derivatives_of_a_beam_that_turns_far():
    """Energies and section forces after two turns, by differences of runs; the adjoint.

    Round-off of the derivatives is that of the rotations, over the relative step of a parameter:
    less than 1e-8 of the quantity over the parameter.
    """
    options = {"t": (0, 3), "dt": 0.05, "newton": EXACT}
    scheme, at = ub.EnergyMomentum(), {"EI": 20.0}
    run = ub.differentiate(spinning, at, scheme, **options)
    quantities = (
        lambda s: s.energy["stored"][-1],
        lambda s: s.section_forces(s.scene.beams[0])[0],
        lambda s: s.displacement(s.scene.beams[0].end)[-1],
    )
    for quantity in quantities:

        def value(EI, quantity=quantity):
            return quantity(ub.simulate(spinning(EI), scheme, **options))

        exact = difference(value, 20.0, 0.02)
        scale = max(np.abs(exact).max(), 1e-2 * np.abs(quantity(run.solution)).max() / 20.0)
        assert np.abs(run.of(quantity)[..., 0] - exact).max() < 1e-6 * scale

    def height(s):
        return s.displacement(s.scene.beams[0].end)[:, 2]

    _, slopes = ub.gradient(spinning, at, scheme, of=height, **options)
    direct = run.of(lambda s: height(s)[-1])
    assert np.abs(slopes - direct).max() < 1e-8 * np.abs(height(run.solution)).max() / 20.0


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_derivatives_of_a_yielding_planar_beam_in_a_turned_plane(scheme):
    """Direct derivatives and the adjoint are those of the plane; a run in two parts."""

    def plane(limit, load):
        section = ub.Section(**STIFF, bending=ub.ElastoPlastic(limit, kinematic=30.0))
        beam = ub.Beam((1, 0), (5, 3), section, cells=3)
        push = ub.PointLoad(beam.end, force=(1, load), amplitude=lambda t: 0.6 * np.sin(3 * t))
        return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])

    def space(**values):
        return InSpace(plane(**values), SKEW).scene

    values = {"limit": 6.0, "load": 9.0}
    options = {"dt": 0.05, "newton": EXACT}
    slopes, forces = [], []
    for made, across in ((plane, (0, 1)), (space, SKEW.apply([0, 1, 0]))):

        def height(s, across=across):
            return s.displacement(s.scene.beams[0].end)[:, : len(across)] @ across

        whole = ub.differentiate(made, values, scheme, t=(0, 1), **options)
        first = ub.differentiate(made, values, scheme, t=(0, 0.5), **options)
        second = ub.differentiate(made, values, scheme, t=(0.5, 1), start=first, **options)
        slopes += [x.of(lambda s: height(s)[-1]) for x in (whole, second)]
        slopes.append(
            ub.gradient(made, values, scheme, t=(0, 1), dt=0.05, of=height, newton=EXACT)[1]
        )
        forces.append(whole.of(lambda s: s.energy["plastic"][-1]))
    assert np.abs(np.array(slopes) / slopes[0] - 1).max() < 1e-8
    assert np.abs(forces[1] / forces[0] - 1).max() < 1e-7  # by differences of energies


# -- linear models ---------------------------------------------------------------------------------


def frame():
    """A frame with a body on a spring, dampers and loads, on a support in turned axes."""
    long = ub.Beam((6, 0), (0, 8), PLANAR, cells=4)
    short = ub.Beam((0, 8), (3, 9), PLANAR, cells=2)
    ball = ub.Body((3.5, 9), mass=30.0, inertia=5.0)
    corner, ground = ball.at(3, 9), ub.ground(8, 12)
    return ub.Scene(
        [long, short], bodies=[ball], damping=[ub.KelvinVoigt(0.01)],
        joints=[ub.Rigid(long.end, short.start), ub.Revolute(short.end, corner)],
        connectors=[
            ub.Turn(short.end, corner, ub.Spring(80.0)),
            ub.Stretch(ball.at(4, 9.5), ground, ub.Spring(30.0)),
            ub.Stretch(long.end, ground, ub.Damper(2.0)),
        ],
        supports=[ub.PrescribedDisplacement(long.start, u=0.0, v=0.0, psi=0.0, along=(1, 2))],
        loads=[
            ub.PointLoad(long.end, force=(3, -8), amplitude=steady),
            ub.FollowerLoad(short.start, force=(1, 2), amplitude=steady),
        ],
    )  # fmt: skip


def steady(t):
    return min(t, 1.0)


def linear_model(scene):
    """Return the linear model of the frame about a static state, and this state."""
    names, axes = (("u", "v", "w"), "xyz") if scene.in_space else (("u", "v"), "xy")
    state = ub.simulate(scene, ub.Static(), t=(0, 2000), dt=200, newton=EXACT)
    long, short = scene.beams
    places = long.at(0.4), scene.connectors[1].a, short.end
    kinds = "displacement", "velocity", "acceleration"
    outputs = [(kind, x, c) for kind, x in zip(kinds, places, strict=True) for c in names]
    outputs += [("reaction", scene.supports[0], c) for c in axes]
    outputs += [("connector", x) for x in scene.connectors]
    support = scene.supports[0]
    inputs = [*scene.loads, (support, "u"), (support, "psi")]
    return ub.linearize(scene, inputs=inputs, outputs=outputs, at=state), state


def test_a_linear_model_of_a_planar_frame_in_a_turned_plane():
    """Frequency responses of loads and motions of supports, to motions and forces."""
    (plane, _), (space, _) = map(linear_model, (frame(), InSpace(frame(), SKEW).scene))
    omega = [0.1, 0.7, 2.0, 9.0]
    flat, H = (x.frequency_response(omega) for x in (plane, space))
    vectors = SKEW.inv().as_matrix() @ H[:12].reshape(4, 3, -1)
    assert np.abs(vectors[:, 2]).max() < 1e-9 * np.abs(vectors).max()
    turned = np.vstack([vectors[:, :2].reshape(8, *H.shape[1:]), H[12:]])
    for row, exact in zip(turned, flat, strict=True):
        assert np.abs(row - exact).max() < 1e-9 * np.abs(exact).max()
    assert "rotation about x" in {name for _, name in space.unknowns}


def test_a_linear_model_has_the_small_motions_of_a_run():
    """Errors of second order in the step; states of the model from a run."""
    model, state = linear_model(InSpace(frame(), SKEW).scene)
    size, (A, B, C, _) = 1e-6, model.state_space()
    n = len(A)
    whole = np.zeros((n + 2, n + 2))  # states, and an input sin t
    whole[:n, : n + 1] = np.column_stack([A, B[:, 0]])
    whole[n, n + 1], whole[n + 1, n] = 1.0, -1.0
    exact = expm(2.0 * whole)[:, n + 1] * size
    errors = []
    for dt in (0.02, 0.01):
        push = ub.PointLoad(
            state.scene.beams[0].end, force=state.scene.loads[0].force,
            amplitude=lambda t: 1 + size * np.sin(t - 2000),
        )  # fmt: skip
        scene = replace(state.scene, loads=[push, state.scene.loads[1]])
        run = ub.simulate(
            scene, ub.EnergyMomentum(), t=(2000, 2002), dt=dt, start=state, newton=EXACT,
        )  # fmt: skip
        moved = run.displacement(scene.beams[0].at(0.4))[[0, -1], :3]
        outputs, states = C[:3] @ exact[:n], model.state(run)
        errors.append(
            [
                np.abs(np.diff(moved, axis=0)[0] - outputs).max() / np.abs(outputs).max(),
                np.abs(states - exact[:n]).max() / np.abs(exact[:n]).max(),
            ]
        )
    assert np.all(np.abs(np.log2(np.divide(*errors)) - 2) < 0.15), errors
    assert np.max(errors[1]) < 1e-2


def test_inputs_and_outputs_that_linear_models_in_space_lack():
    scene = InSpace(frame(), SKEW).scene
    beam, support, push = scene.beams[0], scene.supports[0], scene.loads[0]
    for output, words in (
        (("section_forces_at", beam.end), "in space begins with 'displacement'"),
        (("joint", scene.joints[1]), "in space begins with 'displacement'"),
        (("displacement", beam.end, "psi"), "must be one of 'u', 'v', 'w'"),
        (("reaction", support, "moment"), "must be one of 'x', 'y', 'z'"),
    ):
        with pytest.raises((ub.ArgumentError, TypeError), match=words):
            ub.linearize(scene, inputs=[push], outputs=[output])
    foot = ub.Scene([beam], supports=[ub.Clamped(beam.start)])
    with pytest.raises(ub.ArgumentError, match="must be 'u', 'v' or 'w'"):
        ub.linearize(foot, inputs=[(foot.supports[0], "psi")], outputs=[("displacement", beam.end)])


def test_buckling_about_a_yielded_state():
    """That of a planar column, in a turned plane."""
    section = ub.Section(**STIFF, axial=ub.ElastoPlastic(20.0, kinematic=5e3))
    beam = ub.Beam((0, 0), (0, 5), section, cells=4)
    load = ub.PointLoad(beam.end, force=(0, -40), amplitude=growing)
    column = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    runs = same_in_space(column, ub.Static())
    assert runs[0].energy["plastic"][-1] > 0
    one, other = (ub.buckling(x.scene, 1, at=x, t=2.0).factors[0] for x in runs)
    assert abs(other / one - 1) < 1e-8
