# SPDX-License-Identifier: MIT
"""Checks and warnings of scenes in space that are those of the plane, and pictures of models."""

import math

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.simulation import initial_state

TUBE = ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3, rho=7850.0)
LIGHT = ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3)


def beam(start=(0, 0, 0), end=(1, 0, 0), section=TUBE, **more):
    return ub.Beam(start, end, section, cells=2, **more)


ARM = beam(name="arm")
FOOT = ub.Clamped(ARM.start)


def run(scene, scheme=None):
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=(0, 0.1), dt=0.1)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ub.Rigid(ub.ground(0, 0), ARM.start),
        lambda: ub.Spherical(ARM.end, ub.ground(1, 0, 0), ub.ground(1, 0)),
        lambda: ub.Revolute(ub.ground(0, 0), ARM.start, axis=(0, 0, 1)),
        lambda: ub.Universal(ARM.end, ub.ground(1, 0), axes=((0, 1, 0), (0, 0, 1))),
        lambda: ub.Link(ARM.end, ub.ground(1, 1)),
        lambda: ub.Prismatic(ub.ground(1, 1), ARM.end),
        lambda: ub.Stretch(ub.ground(1, 1), ARM.end, ub.Spring(1.0)),
    ],
)
def test_places_of_one_connection_have_equal_numbers_of_coordinates(make):
    with pytest.raises(ub.ModelError, match="two coordinates, and others three"):
        make()


def test_bodies_have_as_many_coordinates_as_beams():
    with pytest.raises(ub.ModelError, match="plate: its points have two coordinates"):
        ub.Scene([ARM], bodies=[ub.Body((1, 0), mass=1.0, name="plate")], supports=[FOOT])


def test_beams_without_mass():
    load = ub.PointLoad(ARM.end, force=(0, 0, -1.0))
    light = beam((1, 0, 0), (2, 0, 0), LIGHT, name="light")
    joint = ub.Rigid(ARM.end, light.start)
    with pytest.warns(ub.ModelWarning, match="light: without mass"):
        run(ub.Scene([ARM, light], joints=[joint], supports=[FOOT], loads=[load]))
    alone = beam(section=ub.Section.tube(d=0.1, t=0.005, E=210e9, nu=0.3, rho=0.0))
    held = ub.Spherical(ub.ground(0, 0, 0), alone.start)
    with pytest.raises(ub.ModelError, match="dynamics needs mass or resistance"):
        run(ub.Scene([alone], joints=[held]))
    run(ub.Scene([alone], supports=[ub.Clamped(alone.start)]))


def test_ends_that_touch():
    loose = beam((1, 0, 0), (1, 1, 0), name="loose")
    scene = ub.Scene([ARM, loose], supports=[FOOT])
    with pytest.warns(ub.ModelWarning, match="arm.end .* and loose.start .* touch"):
        run(scene)
    for joint in (
        ub.Spherical(ARM.end, loose.start),
        ub.Revolute(ARM.end, loose.start, axis=(0, 0, 1), multipliers=True),
    ):
        run(ub.Scene([ARM, loose], joints=[joint], supports=[FOOT]))


def test_points_far_from_their_body_and_velocities_about_a_far_origin():
    box = ub.Body((10, 0, 0), mass=1.0, inertia=(0.1, 0.1, 0.1), name="box")
    rope = ub.Link(ARM.end, box.at(0.1, 0, 5))
    with pytest.warns(ub.ModelWarning, match=r"body.at\(x, y, z\) .* at\(10 \+ 0.1, 0 \+ 0, "):
        run(ub.Scene([ARM], bodies=[box], joints=[rope], supports=[FOOT]))
    far = beam((10, 0, 0), (11, 0, 0), name="far")
    spin = ub.Velocity([far], angular=(0, 0, 3.0))
    with pytest.warns(ub.ModelWarning, match=r"angular = 0, 0, 3 rad/s without about=.*10 m away"):
        run(ub.Scene([far], initial=[spin]))


def test_model_shows_all_loads_and_connectors():
    box = ub.Body((2, 0, 1), mass=20.0, inertia=(1.0, 2.0, 3.0), name="box")
    mast = beam((0, 0, 0), (0, 0, 1), up=(1, 0, 0), name="mast")
    arm = beam((0, 0, 1), (2, 0, 1), name="arm", hinges={0.5: ub.Softening(1e4, 1e3)})
    scene = ub.Scene(
        [mast, arm], bodies=[box],
        joints=[
            ub.Rigid(mast.end, arm.start),
            ub.Universal(arm.end, box.middle, axes=((0, 1, 0), (0, 0, 1))),
        ],
        supports=[
            ub.PrescribedDisplacement(
                mast.start, u=0.0, v=0.0, w=lambda t: 0.1 * t, axis=(0, 0, 1), psi=lambda t: t
            )
        ],
        connectors=[ub.Stretch(ub.ground(2, 1, 0), box.middle, ub.Spring(1e3))],
        loads=[
            ub.Gravity((0, 0, -9.81)), ub.Pressure(mast, normal=(30.0, 40.0)),
            ub.FollowerLoad(arm.at(0.25), force=(0, 7.0, 0), moment=(0, 0, 11.0)),
            ub.MovingLoad(arm, force=(0, 0, -13.0), position=lambda t: t),
            ub.RotatingFrame(rate=(0, 0, 1.0), about=(0, 0, 0)),
        ],
        initial=[ub.Velocity([box], linear=(3.0, 4.0, 0), angular=(0, 0, 2.0), about=(2, 0, 1))],
        damping=[ub.KelvinVoigt(1e-3)],
    )  # fmt: skip
    figure = ub.plot(scene)
    figure.draw_without_rendering()
    words = [x.get_text() for x in figure.axes[0].texts]
    for text in (
        "g = 9.81 m/s²", "50 N/m, follows", "7 N, follows", "11 N m, follows", "13 N, moves",
        "frame: (0, 0, 1) rad/s about (0, 0, 0)", "1 kN/m", "box, 20 kg", "hinge 10 kN m", "w(t)",
        "ψ(t)", "5 m/s (2 rad/s)", "Kelvin–Voigt damping, 1 ms", "mast",
    ):  # fmt: skip
        assert text in words, (text, words)


def test_symbols_lie_in_the_picture():
    """A normal is perpendicular to the view direction, and to its vector as it is seen."""
    from ufl_beam.plotting.positions import FROM_A_SIDE, PICTURE, normal

    vectors = np.random.default_rng(0).normal(size=(5, 3))
    left = normal(vectors)
    assert np.allclose(left @ FROM_A_SIDE, 0.0, atol=1e-14)
    seen, turned = vectors @ PICTURE[3].T, left @ PICTURE[3].T
    assert np.allclose(turned, seen[:, ::-1] * (-1.0, 1.0), atol=1e-14)
    assert math.isclose(PICTURE[3][1, 2], np.abs(PICTURE[3][:, 2]).max())  # z is upwards


# -- constraints that repeat -----------------------------------------------------------------------

CORNERS = (0, 0, 0), (0.2, 1, 0), (1.5, 1.4, 0), (1.4, 0, 0)
KINDS = {
    "R": lambda *at: ub.Revolute(*at, axis=(0, 0, 1)),
    "C": lambda *at: ub.Cylindrical(*at, axis=(0, 0, 1)),
    "U": lambda *at: ub.Universal(*at, axes=((0, 0, 1), (1, 0, 0))),
    "S": ub.Spherical,
}


def rod(start, end, name):
    middle = tuple((a + b) / 2 for a, b in zip(start, end, strict=True))
    return ub.Body(middle, mass=1.0, inertia=(0.1, 0.1, 0.1), name=name)


def four_bars(kinds):
    """A planar linkage of three bodies and the ground in space, with joints of these kinds."""
    rods = [rod(*CORNERS[k : k + 2], f"rod {k}") for k in range(3)]
    idle = rod((9, 9, 9), (9, 9, 10), "idle")
    ground = [ub.ground(*x) for x in CORNERS]
    before = [ground[0], *(b.at(*x) for b, x in zip(rods, CORNERS[1:], strict=True))]
    after = [*(b.at(*x) for b, x in zip(rods, CORNERS[:3], strict=True)), ground[3]]
    joints = [KINDS[x](a, b) for x, a, b in zip(kinds, before, after, strict=True)]
    joints.append(ub.Revolute(ub.ground(9, 9, 9), idle.at(9, 9, 9), axis=(1, 2, 3)))
    return ub.Scene(bodies=[*rods, idle], joints=joints, loads=[ub.Gravity((0, -9.81, 0))])


def test_redundant_joints_are_refused_by_name():
    """A loop moves in one way, so of its constraints 18 - 1 = 17 are independent."""
    for kinds, repeated in (("RRRR", 3), ("RRUR", 2), ("RRSR", 1), ("RRCR", 2), ("RRCU", 1)):
        with pytest.raises(ub.ModelError) as refused:
            run(four_bars(kinds))
        words = str(refused.value)
        assert f"contradict each other: {repeated} of the constraints of Revolute(ground" in words
        assert "rod 1 (1.5, 1.4, 0), rod 2 (1.5, 1.4, 0)" in words
        assert "Spherical, Cylindrical or Universal in place of Revolute" in words
        assert "idle" not in words
        with pytest.raises(ub.ModelError, match="contradict"):
            ub.plot(four_bars(kinds))
    tight, times = ub.Newton(rtol=1e-13), {"t": (0, 0.1), "dt": 0.1}
    closes = ub.simulate(four_bars("RRSC"), ub.EnergyMomentum(), newton=tight, **times)
    assert closes.energy.worst < 1e-12


def test_constraints_that_repeat_during_a_run_are_named(monkeypatch):
    """As in a dead centre, which no check of the undeformed scene finds."""
    monkeypatch.setattr(initial_state, "require_independent", lambda scene: None)
    with pytest.raises(ub.ConvergenceError, match="singular: the constraints of ") as failed:
        run(four_bars("RRRR"))
    words = str(failed.value).partition("constraints of ")[2].partition(" are not independent")
    assert words[1]
    assert words[0].count("Revolute") == 3
    assert "and 1 more" in words[0]
    assert "idle" not in words[0]


def test_redundant_supports_and_drives_are_refused_by_name():
    slope = ub.PrescribedDisplacement(ARM.end, u=0.0, along=(1, 2, 2))
    rail = ub.Prismatic(ub.ground(1, 1, 1), ARM.end, axis=(0, 1, -1), turning=True)
    drive = ub.Turn(ub.ground(0, 0, 0), ARM.start, ub.PrescribedMotion(math.sin), axis=(1, 1, 0))
    for joints, supports, drives, names in (
        # the rail holds the displacement across (0, 1, -1), of which (1, 2, 2) is a direction
        ([rail], [slope], [], r"Prismatic.*; PrescribedDisplacement at arm.end \(1, 0, 0\) can"),
        ([], [FOOT], [drive], r"1 of .* Turn.* with PrescribedMotion; Clamped at arm.start"),
    ):
        with pytest.raises(ub.ModelError, match=names):
            run(ub.Scene([ARM], joints=joints, supports=supports, connectors=drives))


def test_redundant_loops_of_flexible_beams_run():
    """The same linkage with beams has no constraint that follows from the others."""
    rods = [beam(*CORNERS[k : k + 2], name=f"rod {k}") for k in range(3)]
    places = ub.ground(*CORNERS[0]), *(x for b in rods for x in (b.start, b.end))
    places = *places, ub.ground(*CORNERS[3])
    pairs, weight = zip(places[::2], places[1::2], strict=True), ub.Gravity((0, -9.81, 0))
    joints = [ub.Revolute(a, b, axis=(0, 0, 1)) for a, b in pairs]
    assert run(ub.Scene(rods, joints=joints, loads=[weight])).energy.worst < 1e-9  # rtol


def test_connectors_whose_motions_are_held():
    post = beam((1, 0, 0), (1, 1, 0), name="post")
    hinge = ub.Revolute(ARM.end, post.start, axis=(0, 1, 0))
    still, free = (
        ub.Turn(ARM.end, post.start, ub.Spring(1e3), axis=axis, name=name)
        for name, axis in (("still", (1, 0, 0)), ("free", (0, 1, 0)))
    )
    with pytest.warns(ub.ModelWarning, match="is held at zero by Revolute") as warned:
        run(ub.Scene([ARM, post], joints=[hinge], supports=[FOOT], connectors=[still, free]))
    assert [str(x.message).partition(":")[0] for x in warned] == [str(still)]


def test_a_jump_of_a_driven_axis_is_named():
    """The tangent of a step that is refused at once is zero."""
    turned = ub.PrescribedDisplacement(
        ARM.start, u=0.0, v=0.0, w=0.0, axis=(0, 0, 1), psi=lambda t: 0.0 if t < 0.05 else 3.0
    )
    with pytest.raises(ub.ConvergenceError, match="turns by 172° in the step, more than the limit"):
        run(ub.Scene([ARM], supports=[turned]))


def test_zero_vectors_of_the_plane_are_those_of_space():
    spin = ub.Velocity([ARM], angular=(0, 0, 1.0), about=(0.0, 0.0))
    moving = run(ub.Scene([ARM], initial=[spin]))
    assert moving.velocity(ARM.end)[0, 1] == 1.0
