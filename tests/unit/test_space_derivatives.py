# SPDX-License-Identifier: MIT
"""Derivatives of runs and linear models in space, by differences of runs and by the plane."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import ufl_beam as ub
from ufl_beam.blocks.beams import alike
from ufl_beam.blocks.block import called
from ufl_beam.blocks.spatial_beams import ElasticCellInSpace
from ufl_beam.blocks.statement import kernels

EXACT = ub.Newton(rtol=1e-13)
SKEW = Rotation.from_rotvec([0.3, -0.7, 1.1])
STIFF = {"EA": 1e4, "GA": 1e4, "EI": 500.0, "rhoA": 1.0, "rhoI": 10.0}
OTHER = {"GA3": 7e3, "EI2": 300.0, "GJ": 400.0, "rhoI2": 6.0}
AXIS = tuple(SKEW.apply([0.0, 0.0, 1.0]))


def in_turned_plane(x, y):
    return tuple(SKEW.apply([x, y, 0.0]))


def in_plane(x, y):
    return x, y


def growing(t):
    return t


def swinging(t):
    return np.sin(4 * t)


# -- the table of derivatives ----------------------------------------------------------------------


def test_the_table_of_a_cell_equals_differences():
    """All rows but those of the tangent, which are zero, by central differences."""
    made, made_of = kernels(statement := ElasticCellInSpace(alike(ub.EnergyMomentum()))), []
    (table, margins), n = made.derivative, len(statement.inputs)
    assert not margins
    w = np.random.default_rng(0).uniform(0.1, 0.4, n)
    h, last = 1e-4, len(statement.unknowns)
    for change in h * np.eye(n):
        values = [
            np.append(
                called(made.force, w + k * change)[:last], called(made.end, w + k * change)[:8]
            )
            for k in (-2, -1, 1, 2)
        ]
        made_of.append((8 * (values[2] - values[1]) - (values[3] - values[0])) / (12 * h))
    exact, found = np.transpose(made_of), called(table, w).reshape(-1, n)
    assert not found[:last, :last].any()
    exact[:last, :last] = 0.0
    assert np.abs(found - exact).max() < 1e-8 * np.abs(exact).max()


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
    beam = s.scene.beams[0]
    lost = [energy[-1] for energy in s.energy.lost.values()]
    return {
        "motion": s.displacement(beam.end)[-1],
        "reaction": s.reaction(s.scene.supports[0])[-1],
        "section forces": s.section_forces(beam)[0],
        "energies": np.array([s.energy["stored"][-1], *lost]),
    }


@pytest.mark.filterwarnings("ignore:.*the hinge of the section opened")
@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
@pytest.mark.parametrize("model", [about_axes, driven, followed, rotating, laws, fibres, hinged])
def test_derivatives_equal_differences_of_runs(model, scheme):
    if model is rotating and isinstance(scheme, ub.Static):
        return
    defaults = model.__defaults__
    at = dict(zip(model.__code__.co_varnames, defaults, strict=False))
    options = {"t": (0, 1), "dt": 0.1, "newton": EXACT, "progress": False}
    run = ub.differentiate(model, at, scheme, **options)
    runs = {
        name: [
            results(ub.simulate(model(**at | {name: x * (1 + k * 1e-4)}), scheme, **options))
            for k in (-2, -1, 1, 2)
        ]
        for name, x in at.items()
    }
    for kind, size in results(run.solution).items():
        found = run.of(lambda s, kind=kind: results(s)[kind])
        for p, (name, x) in enumerate(at.items()):
            far, near, near1, far1 = (one[kind] for one in runs[name])
            exact = (8 * (near1 - near) - (far1 - far)) / (12e-4 * x)
            scale = max(np.abs(exact).max(), 1e-2 * np.abs(size).max() / x)
            assert np.abs(found[..., p] - exact).max() < 1e-6 * scale, (kind, name)


def test_a_parameter_of_a_prescribed_rotation_is_refused():
    def model(angle):
        beam = member()
        support = ub.PrescribedDisplacement(
            beam.start, u=0.0, v=0.0, w=0.0, axis=(0, 0, 1), psi=lambda t: angle * t
        )
        return ub.Scene([beam], supports=[support])

    options = {"t": (0, 1), "dt": 0.5}
    with pytest.raises(ub.ArgumentError, match="psi depends on a parameter"):
        ub.differentiate(model, {"angle": 1.0}, ub.Static(), progress=False, **options)
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
    options = {"t": (0, 3), "dt": 0.05, "newton": EXACT, "progress": False}
    scheme, at = ub.EnergyMomentum(), {"EI": 20.0}
    run = ub.differentiate(spinning, at, scheme, **options)
    quantities = (
        lambda s: s.energy["stored"][-1],
        lambda s: s.section_forces(s.scene.beams[0])[0],
        lambda s: s.displacement(s.scene.beams[0].end)[-1],
    )
    runs = [ub.simulate(spinning(20.0 * (1 + k * 1e-3)), scheme, **options) for k in (-2, -1, 1, 2)]
    for quantity in quantities:
        far, near, near1, far1 = map(quantity, runs)
        exact = (8 * (near1 - near) - (far1 - far)) / 0.24
        scale = max(np.abs(exact).max(), 1e-2 * np.abs(quantity(run.solution)).max() / 20.0)
        assert np.abs(run.of(quantity)[..., 0] - exact).max() < 1e-6 * scale

    def height(s):
        return s.displacement(s.scene.beams[0].end)[:, 2]

    del options["progress"]
    _, slopes = ub.gradient(spinning, at, scheme, of=height, **options)
    direct = run.of(lambda s: height(s)[-1])
    assert np.abs(slopes - direct).max() < 1e-8 * np.abs(height(run.solution)).max() / 20.0


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_derivatives_of_a_yielding_planar_beam_in_a_turned_plane(scheme):
    """Direct derivatives and the adjoint are those of the plane; a run in two parts."""

    def model(at, limit, load):
        flat = at is in_plane
        section = ub.Section(
            **STIFF, **{} if flat else OTHER, bending=ub.ElastoPlastic(limit, kinematic=30.0)
        )
        beam = ub.Beam(at(1, 0), at(5, 3), section, cells=3, **{} if flat else {"up": at(0, 1)})
        push = ub.PointLoad(beam.end, force=at(1.0, load), amplitude=lambda t: 0.6 * np.sin(3 * t))
        return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push])

    values = {"limit": 6.0, "load": 9.0}
    options = {"dt": 0.05, "newton": EXACT, "progress": False}
    slopes, forces = [], []
    for at in (in_plane, in_turned_plane):
        turn = np.eye(2) if at is in_plane else SKEW.inv().as_matrix()[:2]

        def height(s, turn=turn):
            moved = s.displacement(s.scene.beams[0].end)[:, : turn.shape[1]]
            return moved @ turn[1]

        def made(at=at, **some):
            return model(at, **some)

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


def frame(at):
    """A frame with a body on a spring, dampers and loads, on a support in turned axes."""
    flat = at is in_plane
    section = ub.Section(**STIFF, **{} if flat else OTHER)
    up = [{} if flat else {"up": at(*x)} for x in ((1, 1), (0, 1))]
    long = ub.Beam(at(6, 0), at(0, 8), section, cells=4, **up[0])
    short = ub.Beam(at(0, 8), at(3, 9), section, cells=2, **up[1])
    ball = ub.Body(at(3.5, 9), mass=30.0, inertia=5.0 if flat else (5.0, 5.0, 5.0))
    axis, corner = {} if flat else {"axis": AXIS}, ball.at(*at(3, 9))
    held = {"u": 0.0, "v": 0.0, "psi": 0.0, "along": at(1, 2)}
    held |= {} if flat else {"w": 0.0, "axis": AXIS, "up": AXIS}
    ground = ub.ground(*at(8, 12))
    return ub.Scene(
        [long, short], bodies=[ball], damping=[ub.KelvinVoigt(0.01)],
        joints=[ub.Rigid(long.end, short.start), ub.Revolute(short.end, corner, **axis)],
        connectors=[
            ub.Turn(short.end, corner, ub.Spring(80.0), **axis),
            ub.Stretch(ball.at(*at(4, 9.5)), ground, ub.Spring(30.0)),
            ub.Stretch(long.end, ground, ub.Damper(2.0)),
        ],
        supports=[ub.PrescribedDisplacement(long.start, **held)],
        loads=[
            ub.PointLoad(long.end, force=at(3, -8), amplitude=steady),
            ub.FollowerLoad(short.start, force=at(1, 2), amplitude=steady),
        ],
    )  # fmt: skip


def steady(t):
    return min(t, 1.0)


def linear_model(at):
    """Return the linear model of the frame about a static state, and this state."""
    scene = frame(at)
    names = ("u", "v") if at is in_plane else ("u", "v", "w")
    axes = ("x", "y") if at is in_plane else ("x", "y", "z")
    state = ub.simulate(scene, ub.Static(), t=(0, 2000), dt=200, newton=EXACT, progress=False)
    long, short = scene.beams
    places = long.at(0.4), scene.bodies[0].at(*at(4, 9.5)), short.end
    kinds = "displacement", "velocity", "acceleration"
    outputs = [(kind, x, c) for kind, x in zip(kinds, places, strict=True) for c in names]
    outputs += [("reaction", scene.supports[0], c) for c in axes]
    outputs += [("connector", x) for x in scene.connectors]
    support = scene.supports[0]
    inputs = [*scene.loads, (support, "u"), (support, "psi")]
    return ub.linearize(scene, inputs=inputs, outputs=outputs, at=state), state


def test_a_linear_model_of_a_planar_frame_in_a_turned_plane():
    """Frequency responses of loads and motions of supports, to motions and forces."""
    (plane, _), (space, _) = map(linear_model, (in_plane, in_turned_plane))
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
    model, state = linear_model(in_turned_plane)
    size, (A, B, C, _) = 1e-6, model.state_space()
    n = len(A)
    whole = np.zeros((n + 2, n + 2))  # states, and an input sin t
    whole[:n, : n + 1] = np.column_stack([A, B[:, 0]])
    whole[n, n + 1], whole[n + 1, n] = 1.0, -1.0
    exact = expm(2.0 * whole)[:, n + 1] * size
    errors = []
    for dt in (0.02, 0.01):
        push = ub.PointLoad(
            state.scene.beams[0].end, force=in_turned_plane(3, -8),
            amplitude=lambda t: 1 + size * np.sin(t - 2000),
        )  # fmt: skip
        scene = replace(state.scene, loads=[push, state.scene.loads[1]])
        run = ub.simulate(
            scene, ub.EnergyMomentum(), t=(2000, 2002), dt=dt, start=state, newton=EXACT,
            progress=False,
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
    scene = frame(in_turned_plane)
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


# -- vibration and buckling about a yielded state --------------------------------------------------


def in_both_planes(push, **laws):
    """Yield a yielded column in the plane and in a turned plane, with its static state."""
    for at in (in_plane, in_turned_plane):
        flat = at is in_plane
        section = ub.Section(**STIFF, **{} if flat else OTHER | {"EI2": 9e3}, **laws)
        beam = ub.Beam(at(0, 0), at(0, 5), section, cells=4, **{} if flat else {"up": at(1, 0)})
        load = ub.PointLoad(beam.end, force=at(*push), amplitude=growing)
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        state = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, newton=EXACT, progress=False)
        assert state.energy["plastic"][-1] > 0
        yield scene, state


def test_modes_about_a_yielded_state():
    """Those of the planar column are among those in space."""
    found = []
    for scene, state in in_both_planes((20, -10), bending=ub.ElastoPlastic(60.0, kinematic=20.0)):
        shapes = ub.modes(scene, 12 if scene.in_space else 4, at=state)
        omega = shapes.omega
        if scene.in_space:
            nodes = shapes.numbering.dofs[:, :3]
            moved = np.array([SKEW.inv().apply(shapes.shapes[nodes, k]) for k in range(12)])
            across = np.abs(moved[..., 2]).max(axis=1) / np.abs(moved).max(axis=(1, 2))
            omega = omega[across < 1e-6][:4]
        found.append(omega)
    assert np.abs(found[1] / found[0] - 1).max() < 1e-9


def test_buckling_about_a_yielded_state():
    laws = {"axial": ub.ElastoPlastic(20.0, kinematic=5e3)}
    factors = [
        ub.buckling(scene, 1, at=state, t=2.0).factors[0]
        for scene, state in in_both_planes((0, -40), **laws)
    ]
    assert abs(factors[1] / factors[0] - 1) < 1e-8
