# SPDX-License-Identifier: MIT
"""Linear models: matrices, names, inputs, outputs, states, reduction, and calls that are refused.

Their responses are in verification/test_linear_models.py.
"""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from scipy.sparse import issparse
from user_classes import Maxwell

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=4e3, EI=20.0, rhoA=0.5, rhoI=1e-3)
LIGHT = ub.Section(EA=1e4, GA=4e3, EI=20.0, rhoA=0.0)
BEAM = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
FOOT = ub.Clamped(BEAM.start)


def still(t):
    return 0.0


PUSH = ub.PointLoad(BEAM.end, force=(0, 1.0), amplitude=still)
SCENE = ub.Scene([BEAM], supports=[FOOT], loads=[PUSH], damping=[ub.KelvinVoigt(1e-3)])
TIP = ("displacement", BEAM.end, "v")
REACTION = ("reaction", FOOT, "moment")


def model_of(scene=SCENE, inputs=(PUSH,), outputs=(TIP,), **more):
    return ub.linearize(scene, inputs=inputs, outputs=outputs, **more)


def pushed(*parts, **more):
    """A scene of a cantilever from a beam, with a force at its end, and its model."""
    beam = ub.Beam((0, 0), (2, 0), *parts, **more)
    push = ub.PointLoad(beam.end, force=(0, 1.0), amplitude=still)
    scene = clamped(beam, loads=[push])
    return scene, model_of(scene, [push], [("displacement", beam.end, "v")])


def pendulum(law=None):
    """Cart on a rail with a pole, hanging or standing by its axis, and a jack."""
    cart = ub.Body((0, 0), mass=2.0, inertia=0.1, name="cart")
    pole = ub.Beam((0, 0), (0, -1), SECTION, cells=3, name="pole")
    rail = ub.Prismatic(ub.ground(0, 0), cart.middle, axis=(1, 0))
    pin = ub.Revolute(cart.middle, pole.start, multipliers=True)
    jack = ub.Slide(ub.ground(-1, 0), cart.middle, law or ub.PrescribedForce(still), axis=(1, 0))
    scene = ub.Scene([pole], bodies=[cart], joints=[rail, pin], connectors=[jack])
    return scene, cart, pole, pin, jack


MASS = ub.Body((0, 0), mass=1.0, inertia=1.0)
MOVED = ("displacement", MASS.middle, "u")


def block(*laws, size=1.0, amplitude=still):
    """A mass of 1 kg that moves along x only, with laws of this motion, and a force on it."""
    held = ub.PrescribedDisplacement(MASS.middle, v=0.0, psi=0.0)
    pull = ub.PointLoad(MASS.middle, force=(size, 0), amplitude=amplitude)
    slides = [ub.Slide(ub.ground(0, 0), MASS.middle, law, axis=(1, 0)) for law in laws]
    return ub.Scene(bodies=[MASS], supports=[held], connectors=slides, loads=[pull]), pull


# -- matrices and names ----------------------------------------------------------------------------


def test_matrices_have_the_exponents_of_the_modes():
    """(K + s (C + G) + s² M) x = 0 is singular at an exponent: 1e-12 are the digits of LAPACK."""
    model = model_of()
    matrices = model.M, model.C, model.G, model.K
    assert all(issparse(A) and A.shape == (12, 12) for A in matrices)
    M, C, G, K = (A.toarray() for A in matrices)
    np.testing.assert_array_equal(G, 0.0)
    np.testing.assert_array_equal(C, C.T)
    np.testing.assert_allclose(C, 1e-3 * K, atol=1e-9 * np.abs(C).max())
    exponents = ub.modes(SCENE, 100).exponents
    s = exponents[0]
    values = np.linalg.svd(K + s * C + s**2 * M, compute_uv=False)
    assert values[-1] <= 1e-10 * values[0]
    eigenvalues = np.linalg.eigvals(model.state_space()[0])
    assert np.abs(eigenvalues - s).min() <= 1e-9 * abs(s)
    assert len(eigenvalues) == sum(1 + (s.imag > 0) for s in exponents)


def test_unknowns_are_places_components_and_forces():
    scene, cart, pole, _, jack = pendulum(ub.PrescribedMotion(still))
    model = model_of(scene, [jack], [("displacement", pole.end, "u")], mesh=ub.Mesh(degree=2))
    unknowns = model.unknowns
    assert len(unknowns) == model.K.shape[0]
    assert (pole.at(1 / 6), "v") in unknowns  # between two vertices
    assert (cart.middle, "psi") not in unknowns  # shared with the ground by the rail
    assert unknowns[-1] == (jack, "force")
    row = model.K.toarray()[-1]  # the jack's motion by the unknowns
    assert row[unknowns.index((cart.middle, "u"))] == pytest.approx(1.0, rel=1e-15)
    assert np.count_nonzero(row) == 1
    _, model = pushed(SECTION, cells=4, hinges={0.5: ub.Softening(5.0, 1.0)})
    hinge = [place for place, c in model.unknowns if c == "psi" and getattr(place, "s", 0) == 0.5]
    assert {place.beyond for place in hinge} == {False, True}


def test_text_names_inputs_and_outputs():
    outputs = [TIP, TIP, ("section_forces_at", BEAM.start, "M"), REACTION]
    model = model_of(inputs=[PUSH, (FOOT, "v")], outputs=outputs)
    assert str(model).splitlines() == [
        "linear model with 12 unknowns",
        "inputs",
        "  factor of PointLoad at beam.end (2, 0) [1]",
        "  d2v/dt2 of Clamped at beam.start (0, 0) [m/s2]",
        "outputs",
        "  v beam.end (2, 0) [m]",
        "  v beam.end (2, 0) [m] (2)",
        "  M beam.start (0, 0) [N m]",
        "  moment Clamped at beam.start (0, 0) [N m]",
    ]
    assert repr(model) == "<LinearModel: 12 unknowns, 2 inputs, 4 outputs>"
    assert model.states[0] == "u beam.at(0.25) (0.5, 0)"
    assert model.states[-2:] == [
        "v of Clamped at beam.start (0, 0) [m]",
        "d/dt v of Clamped at beam.start (0, 0) [m]",
    ]
    reduced = model.reduced(2)
    assert reduced.states[0].startswith("mode 0 (0.88")
    assert str(reduced).startswith("linear model with 6 states")
    assert repr(reduced) == "<LinearModel: 6 states, 2 inputs, 4 outputs>"
    assert repr(model_of()) == "<LinearModel: 12 unknowns, 1 input, 1 output>"


# -- equal forms -----------------------------------------------------------------------------------


def test_inputs_keep_their_order():
    """A motion before a force; each form of the model has the columns in this order."""
    one, other = model_of(inputs=[PUSH, (FOOT, "v")]), model_of(inputs=[(FOOT, "v"), PUSH])
    for form in (
        lambda m: m.transfer_function(2j)[:, :, 0],
        lambda m: m.state_space()[1],
        lambda m: m.state_space()[3],
        lambda m: m.descriptor()[2].toarray(),
        lambda m: m.reduced(3).state_space()[3],
    ):
        np.testing.assert_array_equal(form(one), form(other)[:, ::-1])
    assert one.inputs == other.inputs[::-1]


def test_descriptor_and_state_space_have_one_response():
    """Tolerance: round-off 1e-16 times the ratio of the highest squared frequency to s²."""
    scene, _, pole, pin, jack = pendulum(ub.PrescribedMotion(still))
    load = ub.PointLoad(pole.end, force=(1.0, 0.3))
    outputs = [("displacement", pole.end, "u"), ("acceleration", pole.at(1 / 3), "u"),
               ("joint", pin), ("connector", jack)]  # fmt: skip
    model = model_of(replace(scene, loads=[load]), [load, jack], outputs)
    s = 3.0 + 20.0j
    A, B, C, D = model.state_space()
    expected = model.transfer_function(s)[:, :, 0]
    sizes = 1e-8 * np.abs(expected).max(axis=1, keepdims=True)
    by_states = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
    assert (np.abs(by_states - expected) <= sizes).all()
    E, A, B, C, D = (x.toarray() if issparse(x) else x for x in model.descriptor())
    by_descriptor = C @ np.linalg.solve(s * E - A, B) + D
    assert (np.abs(by_descriptor - expected) <= sizes).all()
    np.testing.assert_array_equal(model.frequency_response([2.0]), model.transfer_function([2j]))


def test_states_of_a_run():
    """States that are read from a run predict its next steps by the midpoint rule.

    Changes of second order are the amplitude of 2e-4 m divided by the length.  Eight of twelve
    modes leave out motions of (0.9/150)² of the first one.
    """
    tiny = ub.PointLoad(BEAM.end, force=(0, 1.0), amplitude=lambda t: 3e-3 * (t < 0.05))
    scene, dt = replace(SCENE, loads=[tiny]), 0.005
    model = model_of(scene, [tiny])
    simulation = ub.Simulation(scene, ub.EnergyMomentum(), newton=ub.Newton(rtol=1e-12))
    forms, begun, tips = (model, model.reduced(8)), [], []
    for k in range(40):
        simulation.step_to((k + 1) * dt)
        if k in (19, 39):
            tips.append(simulation.displacement(BEAM.end)[1])
            begun.append([form.state(simulation) for form in forms])
    assert abs(tips[0]) < 2e-3
    for form, w, tolerance in zip(forms, begun[0], (2e-4, 2e-3), strict=True):
        A, _, C, _ = form.state_space()
        I = np.eye(len(A))
        step = np.linalg.solve(I - dt / 2 * A, I + dt / 2 * A)
        later = np.linalg.matrix_power(step, 20) @ w
        assert [(C @ w)[0], (C @ later)[0]] == pytest.approx(tips, rel=tolerance)
    np.testing.assert_array_equal(model.state(simulation.snapshot()), begun[1][0])
    with raises("state: run has no state"):
        model.state(simulation.solution)
    simulation.close()
    static = ub.simulate(replace(scene, damping=()), ub.Static(), t=(0, 0.01), dt=0.01)
    assert not model.state(static)[12:].any()


@pytest.mark.filterwarnings("ignore:::control")  # what a new NumPy says about python-control
def test_python_control():
    control = pytest.importorskip("control")
    model = model_of(inputs=[PUSH, (FOOT, "v")]).reduced(3)
    system = model.to_control()
    assert isinstance(system, control.StateSpace)
    assert (system.nstates, system.ninputs, system.noutputs) == (8, 2, 1)
    # Two ways of inverting a matrix of order 8 whose condition number is about 1e6
    expected = model.frequency_response(3.0)[:, :, 0]
    np.testing.assert_allclose(np.reshape(system(3.0j), (1, 2)), expected, rtol=1e-9)


# -- parts of a scene ------------------------------------------------------------------------------


def test_controller_is_an_input_like_a_force_or_constant():
    forms = []
    for law in (None, ub.Controller(lambda now: 0.0)):
        scene, cart, pole, _, jack = pendulum(law)
        outputs = [("displacement", cart.middle, "u")]
        forms.append(model_of(scene, [jack], outputs).frequency_response(3.0))
    np.testing.assert_array_equal(*forms)
    load = ub.PointLoad(pole.end, force=(1.0, 0))
    with pytest.warns(ub.ModelWarning, match="the force of the controller is constant"):
        model_of(replace(scene, loads=[load]), [load], outputs)


def test_friction_is_left_out_and_springs_unload_elastically():
    """[closed] Static gains 1/k, as in `modes`."""
    scene, pull = block(ub.Coulomb(1.0), ub.Spring(3.0), amplitude=lambda t: 2.0)
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    with pytest.warns(ub.ModelWarning, match="sliding friction is left out"):
        model = model_of(scene, [pull], [MOVED], at=at)
    np.testing.assert_allclose(model.frequency_response(0.0).real, [[[1 / 3]]], rtol=1e-14)
    yielding = ub.Spring(8.0, ub.ElastoPlastic(yield_limit=2.0, isotropic=1.0))
    scene, pull = block(yielding, amplitude=lambda t: 2.5 * t)
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    model = model_of(scene, [pull], [MOVED], at=at)
    np.testing.assert_allclose(model.frequency_response(0.0).real, [[[1 / 8]]], rtol=1e-12)


def test_rate_of_a_motion_without_mass_is_refused():
    """It follows a force at once; its displacement, and responses, are outputs."""
    beam = ub.Beam((0, 0), (2, 0), LIGHT, cells=2)
    middle = ub.PointLoad(beam.at(0.5), force=(0, 1.0))
    scene = clamped(beam, masses=[ub.PointMass(beam.end, 1.0)], loads=[middle])
    model = model_of(scene, [middle], [("displacement", beam.at(0.5), "v")])
    A, B, C, D = model.state_space()
    assert len(A) == 4  # u and v of the mass
    assert D[0, 0] > 0
    static = model.frequency_response(0.0)[0, 0, 0].real
    assert D[0, 0] - (C @ np.linalg.solve(A, B))[0, 0] == pytest.approx(static, rel=1e-10)
    model = model_of(scene, [middle], [("velocity", beam.at(0.5), "v")])
    assert model.frequency_response(1.0).shape == (1, 1, 1)
    with raises("dv/dt beam.at(0.5)", "depends on the rate of factor of PointLoad", "no mass"):
        model.state_space()


def test_moving_supports_are_inputs_and_outputs():
    """A clamp moves in each component: a slow rotation turns the beam as a rigid body, v = 2 ψ."""
    outputs = [("acceleration", BEAM.start, "v"), ("displacement", BEAM.start, "v")]
    model = model_of(inputs=[(FOOT, "v")], outputs=outputs)
    np.testing.assert_array_equal(model.state_space()[3], [[1.0], [0.0]])
    s = 2.0 + 1.0j
    np.testing.assert_allclose(model.transfer_function(s)[:, 0, 0], [1.0, 1 / s**2], rtol=1e-14)
    model = model_of(inputs=[FOOT])
    assert [name[:3] for name in model.inputs] == ["d2u", "d2v", "d2p"]
    slow = model.frequency_response(1e-3)[0, :, 0] * -1e-6
    np.testing.assert_allclose(slow.real, [0.0, 1.0, 2.0], atol=1e-6)


def test_force_of_a_link_on_a_body_that_has_turned():
    """[closed] Balance of the body: the force of the link is m s² u + k u - F."""
    m, k, F, s = 2.0, 3.0, (1.0, 0.5), 0.3 + 2.0j
    body, pivot = ub.Body((0, -2), mass=m, inertia=0.3), ub.ground(0, -2)
    link = ub.Link(ub.ground(0, 0), body.at(0.3, -1.2))
    springs = [ub.Slide(pivot, body.middle, ub.Spring(k), axis=axis) for axis in ((1, 0), (0, 1))]
    springs.append(ub.Turn(pivot, body.middle, ub.Spring(5.0)))
    hold = ub.PointLoad(body.middle, force=(6.0, -9.0), moment=1.0, amplitude=lambda t: min(t, 1))
    push = ub.PointLoad(body.middle, force=F, amplitude=still)
    scene = ub.Scene(bodies=[body], joints=[link], connectors=springs, loads=[hold, push])
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    assert abs(at.displacement(body.middle)[-1, 2]) > 0.3
    outputs = [("joint", link, c) for c in "xy"] + [("displacement", body.middle, c) for c in "uv"]
    force, motion = (
        model_of(scene, [push], outputs, at=at).transfer_function(s)[:, 0, 0].reshape(2, 2)
    )
    np.testing.assert_allclose(force, (m * s**2 + k) * motion - F, rtol=1e-9)


def test_large_model_is_sparse_and_reducible():
    scene, model = pushed(SECTION, cells=800)
    with raises("4800 states are too many", "reduced(n)"):
        model.state_space()
    found = np.linalg.eigvals(model.reduced(3).state_space()[0]).imag
    np.testing.assert_allclose(np.sort(found)[3:], ub.modes(scene, 3).omega, rtol=1e-9)
    assert model.descriptor()[1].nnz < 100 * model.K.shape[0]


def test_modes_of_free_scenes_are_states():
    """Three rigid motions of a free beam; a force accelerates its mass of 1 kg."""
    push = ub.PointLoad(BEAM.at(0.5), force=(0, 1.0))
    scene = ub.Scene([BEAM], loads=[push])
    model = model_of(scene, [push], [("acceleration", BEAM.at(0.5), "v")])
    slow, reduced = 1e-2 * ub.modes(scene, 4).omega[3], model.reduced(5)
    for form in (model, reduced):
        assert form.frequency_response(slow)[0, 0, 0].real == pytest.approx(1.0, rel=1e-3)
    assert ["(0 Hz)" in x for x in reduced.states[:4]] == [True, True, True, False]
    with pytest.warns(ub.ModelWarning, match="2 modes leave out motions without.* at least 3"):
        model.reduced(2)


def test_follower_force_makes_the_stiffness_unsymmetric():
    """Beyond Beck's load the column flutters: exponents of `modes`, also with two modes.

    Without damping the modes span an invariant space, so that their exponents are exact.
    """
    column = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e5, GA=1e5, EI=1.0, rhoA=1.0), cells=12)
    thrust = ub.FollowerLoad(column.end, force=(-22.0, 0), amplitude=lambda t: t)
    push = ub.PointLoad(column.end, force=(0, 1.0), amplitude=still)
    scene = clamped(column, loads=[thrust, push])
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    model = model_of(scene, [push], [("displacement", column.end, "v")], at=at)
    assert abs(model.K - model.K.T).max() > 1.0
    expected = ub.modes(scene, 1, at=at).exponents[0]
    assert abs(expected.real) > 0.1
    for form in (model, model.reduced(2)):
        s = np.linalg.eigvals(form.state_space()[0])
        apart = np.abs(np.abs(s.real) - abs(expected.real)) + np.abs(s.imag - expected.imag)
        assert apart.min() <= 1e-6 * abs(expected)


# -- reduced models --------------------------------------------------------------------------------


def test_reduced_model_is_exact_for_slow_inputs():
    """The error of n modes is the square of s over the first frequency left out, (1/130)²."""
    outputs = [TIP, ("section_forces_at", BEAM.at(0.4), "M"), ("reaction", FOOT, "y"),
               ("velocity", BEAM.at(0.5), "psi")]  # fmt: skip
    model = model_of(inputs=[PUSH, (FOOT, "v")], outputs=outputs)
    reduced = model.reduced(8)
    assert len(reduced.states) == 18
    for form, s, rtol in ((reduced, 0.1 + 1.0j, 6e-5), (model.reduced(12), 5.0 + 90.0j, 1e-6)):
        np.testing.assert_allclose(form.transfer_function(s), model.transfer_function(s), rtol=rtol)
    again, before = reduced.reduced(3).state_space(), reduced.state_space()[0]
    for mine, other in zip(again, model.reduced(3).state_space(), strict=True):
        np.testing.assert_array_equal(mine, other)
    np.testing.assert_array_equal(reduced.state_space()[0], before)
    E, A, *_ = reduced.descriptor()
    assert (np.eye(18) != E).sum() == 0
    np.testing.assert_array_equal(A.toarray(), before)


def test_dampers_in_series_with_springs():
    """The reduced model has the lags of the dampers as states; `modes` has all exponents.

    Masses of 2 kg in a row on springs; each has a damper in series with a spring.
    """
    bodies, connectors, held, last, count = [], [], [], ub.ground(-1, 0), 3
    for k in range(count):
        body, plug = (ub.Body((k, y), mass=m, inertia=m / 2) for y, m in ((0, 2.0), (1, 0.0)))
        pairs = [(last, body.middle, ub.Spring(50.0)), (body.middle, plug.middle, ub.Spring(40.0)),
                 (ub.ground(k + 0.5, 1), plug.middle, ub.Damper(3.0 * (1 + k)))]  # fmt: skip
        connectors += [ub.Slide(a, b, law, axis=(1, 0)) for a, b, law in pairs]
        held += [ub.PrescribedDisplacement(x.middle, v=0.0, psi=0.0) for x in (body, plug)]
        bodies, last = [*bodies, body, plug], body.middle
    push = ub.PointLoad(last, force=(1.0, 0))
    scene = ub.Scene(bodies=bodies, connectors=connectors, supports=held, loads=[push])
    outputs = [(kind, x, "u") for kind in ("displacement", "velocity") for x in (last, plug.middle)]
    model = model_of(scene, [push], outputs)
    expected = np.linalg.eigvals(model.state_space()[0])
    expected = np.sort_complex(expected[expected.imag >= 0])
    assert len(expected) == 2 * count
    found = np.sort_complex(ub.modes(scene, 10).exponents)
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    reduced = model.reduced(10)
    assert len(reduced.states) == 3 * count
    assert reduced.states[count] == "lag 0 of dampers"
    s = 0.2 + 5.0j
    np.testing.assert_allclose(reduced.transfer_function(s), model.transfer_function(s), rtol=1e-9)
    simulation = ub.Simulation(scene, ub.EnergyMomentum())
    for t in (0.01, 0.02):
        simulation.step_to(t)
    one, other = (form.state_space()[2] @ form.state(simulation) for form in (model, reduced))
    simulation.close()
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_reduced_model_with_dampers():
    """With all modes it is exact, also for forces of constraints, on which the dampers work.

    Modes that are left out bear the forces of dampers as in statics.  Velocities apart, which
    depend on the rate of the inputs, the error is of first order in s.
    """
    beam = ub.Beam((0, 0), (2, 0.4), replace(SECTION, rhoI=1e-2), cells=4)
    body = ub.Body((2, 1), mass=0.3, inertia=0.02, name="body")
    pin = ub.Revolute(beam.end, body.at(2, 0.4))
    spring = ub.Turn(beam.end, body.middle, ub.Spring(1.0))
    damper = ub.Slide(ub.ground(2, 1), body.middle, ub.Damper(2.0), axis=(0, 1))
    jack = ub.Slide(ub.ground(1, 0), beam.at(0.5), ub.PrescribedMotion(still), axis=(0, 1))
    foot, push = ub.Clamped(beam.start), ub.PointLoad(body.middle, force=(1.0, 1.0))
    scene = ub.Scene(
        [beam], bodies=[body], joints=[pin], supports=[foot], loads=[push],
        connectors=[spring, damper, jack],
    )  # fmt: skip
    outputs = [("joint", pin, "x"), ("joint", pin, "y"), ("connector", jack, "force"),
               ("reaction", foot), ("displacement", body.middle), ("velocity", body.middle, "v"),
               ("section_forces_at", beam.at(0.7))]  # fmt: skip
    model = model_of(scene, [jack, push, (foot, "v")], outputs)
    every, reduced = model.reduced(100), model.reduced(4)
    for s in (0.3 + 2.0j, 20.0j):  # the round-off of the static parts
        full = model.transfer_function(s)
        np.testing.assert_allclose(every.transfer_function(s), full, rtol=1e-7)
    full, few = (m.transfer_function(1.0j)[:, :, 0] for m in (model, reduced))
    velocity = model.outputs.index("dv/dt body (2, 1) [m/s]")
    errors = np.delete(np.abs(few - full) / np.abs(full), velocity, axis=0)
    assert errors.max() <= 1e-4
    force = model.inputs.index("factor of PointLoad at body (2, 1) [1]")
    assert abs(reduced.state_space()[3][velocity, force]) <= 1e-9


@pytest.mark.parametrize("EA", [1e7, 1e10])
def test_reduced_model_of_a_cart_with_a_stiff_mast(EA):
    """[closed] Bernoulli's cantilever on a cart, pushed at 0.3 of its first frequency.

    The mesh of 32 linear cells leaves 1e-3; round-off of the stiffness, 1e-16 EA/EI 32², does not
    count.  All reduced models agree to (ω/ω₊)⁴.
    """
    M, EI, rho, L, w = 4.0, 60.0, 1.5, 2.0, 1.94
    k = (rho * w * w / EI) ** 0.25 * L
    ratio = (np.sin(k) * np.cosh(k) + np.cos(k) * np.sinh(k)) / (1 + np.cos(k) * np.cosh(k))
    exact = -1 / (w * w * (M + rho * L / k * ratio))
    section = ub.Section(EA=EA, GA=EA / 3, EI=EI, rhoA=rho, depth=0.05)
    mast = ub.Beam((0, 0), (0, L), section, cells=32)
    cart = ub.Body((0, 0), mass=M, inertia=1.0)
    push = ub.PointLoad(cart.middle, force=(1.0, 0), amplitude=still)
    rail = ub.Prismatic(ub.ground(0, 0), cart.middle, axis=(1, 0))
    joints = [ub.Rigid(mast.start, cart.middle), rail]
    scene = ub.Scene([mast], bodies=[cart], joints=joints, loads=[push])
    model = model_of(scene, [push], [("displacement", cart.middle, "u")])
    found = [model.reduced(n).frequency_response(w)[0, 0, 0] for n in (2, 3, 10)]
    assert found == pytest.approx([exact] * 3, rel=1e-3)


def hysteresis(motion, rate, dt, state):
    after = state[0] + rate * dt * (1 - abs(state[0]))
    return 40.0 * after, [after]


@pytest.mark.parametrize(
    ("law", "named"),
    [
        (ub.ForceLaw(Maxwell(40.0, 0.1), [0.0]), True),
        (ub.ForceLaw(hysteresis, [0.0]), False),
        (ub.ForceLaw(lambda x, rate: 3 * x + x**3 + 2 * rate + rate**3), False),
        (ub.Damper(2.0), False),
    ],
)
def test_laws_that_relax_are_named(law, named):
    """A damper in series with a spring has no matrix; hysteresis has one for small motions."""
    scene, pull = block(ub.Spring(50.0), law)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model_of(scene, [pull], [MOVED])
        ub.modes(scene, 1)
    assert len(caught) == 2 * named
    assert all("depends on the length of a step" in str(x.message) for x in caught)


# -- refused calls ---------------------------------------------------------------------------------


def test_response_at_an_exponent():
    model = model_of(replace(SCENE, damping=()), [PUSH, (FOOT, "v")])
    for form in (model, model.reduced(2)):
        with raises("s = 0: a prescribed motion grows without bound"):
            form.frequency_response(0.0)
    free = replace(SCENE, supports=(), damping=())
    with raises("s = 0", "is an exponent of the model"):
        model_of(free).reduced(4).frequency_response(0.0)
    scene, pull = block(ub.Spring(4.0))
    with raises("s = 0+2j is an exponent of the model"):
        model_of(scene, [pull], [MOVED]).frequency_response(2.0)


def test_a_motion_without_mass_and_stiffness_is_refused():
    """A spring and a law of force -4 x, between the ground and a body without mass."""
    scene, pull = block(ub.Spring(4.0))
    plug = ub.Body((1, 0), mass=0.0, inertia=0.0, name="plug")
    held = ub.PrescribedDisplacement(plug.middle, v=0.0, psi=0.0)
    laws = ub.Spring(4.0), ub.ForceLaw(lambda x, rate: -4 * x)
    pair = [ub.Slide(ub.ground(0, 0), plug.middle, law, axis=(1, 0)) for law in laws]
    scene = replace(scene, bodies=[MASS, plug], supports=[*scene.supports, held],
                    connectors=[*scene.connectors, *pair])  # fmt: skip
    model = model_of(scene, [pull], [MOVED])
    with raises("neither mass, damper nor stiffness determines u plug (1, 0)"):
        model.state_space()
    for compute in (lambda: model.reduced(1), lambda: ub.modes(scene, 1)):
        with raises("neither mass nor stiffness determines some motion in this state"):
            compute()


@pytest.mark.parametrize("order", [1, -1])
def test_a_combination_of_motions_may_have_no_mass(order):
    """A point mass on a rigid arm of a body without mass, on springs; for each order of bodies."""
    point = ub.Body((1, 0), mass=5.0, inertia=0.0, name="point")
    hub = ub.Body((0, 0), mass=0.0, inertia=0.0, name="hub")
    ground, at = ub.ground(0, 0), hub.middle
    springs = [ub.Slide(ground, at, ub.Spring(2e3), axis=axis) for axis in ((1, 0), (0, 1))]
    scene = ub.Scene(
        [], bodies=[point, hub][::order], joints=[ub.RigidLink(at, point.middle)],
        connectors=[*springs, ub.Turn(ground, at, ub.Spring(1e3))],
        loads=[ub.PointLoad(at, force=(1.0, 1.0))],
    )  # fmt: skip
    outputs = [("displacement", at), ("velocity", point.middle, "v")]
    model, s = model_of(scene, scene.loads, outputs), 3j
    A, B, C, D = model.state_space()
    assert len(A) == 4
    by_states = C @ np.linalg.solve(s * np.eye(4) - A, B) + D
    np.testing.assert_allclose(by_states, model.transfer_function(s)[:, :, 0], rtol=1e-12)
    by_hand = 1 / (2e3 - 5.0 * 9.0)  # u, by its spring and mass
    assert by_states[0, 0] == pytest.approx(by_hand, rel=1e-12)


def test_state_must_be_an_equilibrium():
    weight = replace(SCENE, loads=[ub.Gravity(), PUSH])
    with raises("unbalanced forces", "v of beam", "not in equilibrium", "at=simulate"):
        model_of(weight)
    at = ub.simulate(replace(weight, damping=()), ub.Static(), t=(0, 1), dt=0.5)
    model_of(weight, at=at)
    heavier = replace(weight, loads=[ub.Gravity((0, -20.0)), PUSH])
    with raises("unbalanced forces", "loads or motions have changed"):
        model_of(heavier, at=at)
    moved = ub.PrescribedDisplacement(BEAM.start, u=0.0, v=0.1, psi=0.0)
    with raises("gap of PrescribedDisplacement at beam.start"):
        model_of(replace(SCENE, supports=[moved]))


def test_state_must_be_at_rest():
    """A free flight is in equilibrium of forces, and moves; a vibration that has decayed rests."""
    free = ub.Scene([BEAM], initial=[ub.Velocity([BEAM], (1.0, 0.0))], loads=[PUSH])
    run = ub.simulate(free, ub.EnergyMomentum(), t=(0, 0.1), dt=0.05)
    with raises("at moves", "u of beam", "give a state at rest"):
        model_of(free, at=run)
    damped, kick = block(ub.Spring(4.0), ub.Damper(2.0), amplitude=lambda t: 1.0)
    run = ub.simulate(damped, ub.EnergyMomentum(), t=(0, 10), dt=0.1)
    with raises("unbalanced", "u of body"):
        model_of(damped, [kick], [MOVED], at=run)
    run = ub.simulate(damped, ub.EnergyMomentum(), t=(0, 20), dt=0.1)  # exp(-20) is left
    model_of(damped, [kick], [MOVED], at=run)


OTHER = ub.Beam((0, 0), (0, 1), SECTION, name="other")
ARM = ub.Beam((2, 0), (3, 0), SECTION, name="arm")
SPRING = ub.Slide(ub.ground(2, 0), BEAM.end, ub.Spring(1.0), axis=(0, 1))
JACK = ub.Turn(ub.ground(0, 0), BEAM.start, ub.PrescribedForce(still))
ROLLER = ub.Roller(BEAM.end, along=(0, 1))
PIN = ub.Revolute(BEAM.end, ARM.start)
CURVED = ub.Guided(ARM.at(0.5), lambda s: (2.5 + s, s))
SLIDER = ub.Prismatic(ub.ground(3, 0), ARM.end, axis=(0, 1))
AT_FOOT = ub.PointLoad(BEAM.start, force=(1.0, 0))


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ([], "inputs is empty"),
        (["push"], "inputs[0] = 'push' must be a load, connector or support"),
        ([BEAM], "inputs[0]"),
        ([PUSH, PUSH], "inputs[1]: PointLoad at beam.end (2, 0) occurs twice"),
        ([FOOT, (FOOT, "u")], "inputs[1]: Clamped at beam.start (0, 0) occurs twice"),
        ([ub.PointLoad(BEAM.end, force=(0, 1))], "inputs[0]: PointLoad at beam.end (2, 0) is not"),
        ([ub.Clamped(BEAM.start)], "is not in the scene"),
        ([JACK], "is not in the scene"),
        ([(FOOT, "x")], "inputs[0]: component 'x' must be 'u', 'v' or 'psi'"),
        ([(PUSH, "u")], "is a pair, which is for supports"),
        ([SPRING], "has the law Spring; an input has a PrescribedForce"),
        ([AT_FOOT], "inputs: factor of PointLoad at beam.start"),
        ([(ROLLER, "v")], "does not hold v"),
    ],
)
def test_inputs_that_are_refused(inputs, message):
    parts = {"connectors": [SPRING], "loads": [PUSH, AT_FOOT], "supports": [FOOT, ROLLER]}
    with raises(message):
        model_of(replace(SCENE, **parts), inputs)


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ("v", "outputs[0] = 'v' must be a tuple such as ('displacement', place, 'v')"),
        (("speed", BEAM.end), "which begins with 'displacement', 'velocity'"),
        (("displacement", BEAM.end, "w"), "component 'w' must be one of 'u', 'v', 'psi'"),
        (("displacement", BEAM), "outputs[0]"),
        (("displacement", OTHER.end), "outputs[0]: other.end (0, 1) is not in the scene"),
        (("displacement", BEAM.start, "v"), "supports or constraints hold this motion"),
        (("section_forces_at", BEAM.end, "u"), "must be one of 'N', 'V', 'M'"),
        (("section_forces_at", ub.ground(0, 0)), "must be a Place"),
        (("connector", PUSH), "must be a Connector"),
        (("connector", SPRING), "is not in the scene"),
        (("reaction", BEAM.start), "must be a Support"),
        (("reaction", ub.Clamped(BEAM.start)), "is not in the scene"),
        (("joint", SPRING), "must be a Joint"),
        (("joint", PIN), "shares unknowns"),
        (("joint", ub.Revolute(BEAM.end, ARM.start)), "is not in the scene"),
        (("joint", CURVED), "the force of a guide is no output"),
        (("joint", SLIDER, "moment"), "shares its rotation; its moment is not known"),
    ],
)
def test_outputs_that_are_refused(output, message):
    joints = [PIN, CURVED, SLIDER]
    scene = ub.Scene([BEAM, ARM], supports=[FOOT], joints=joints, loads=[PUSH])
    with raises(message):
        model_of(scene, outputs=[output])


def test_other_refused_calls():
    with raises("nothing that can move has mass"):
        pushed(LIGHT)
    frame = ub.RotatingFrame(1.0)
    scene = ub.Scene([BEAM], supports=[FOOT], loads=[frame, PUSH])
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    with raises("forces of a RotatingFrame have no factor"):
        model_of(scene, [frame], at=at)
    model, other = model_of(), clamped(OTHER)
    for call, parts in (
        (lambda: model.transfer_function([math.nan]), ["s = ", "must be finite"]),
        (lambda: model.reduced(0), ["reduced: n"]),
        (lambda: model.frequency_response(["a"]), ["frequency_response: omega"]),
        (
            lambda: model.state(ub.simulate(other, ub.Static(), t=(0, 1), dt=1)),
            ["state: run has other beams"],
        ),
        (lambda: model.state(1.0), ["state: run"]),
    ):
        with raises(*parts):
            call()
