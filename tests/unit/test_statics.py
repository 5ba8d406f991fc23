# SPDX-License-Identifier: MIT
"""Static runs: loads that are there from the start, relaxation, first reactions, broken springs."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises, run
from into_space import same_in_space
from scenes import clamped
from scipy.spatial.transform import Rotation

import ufl_beam as ub


def cantilever(*loads, supports=(), **section):
    """A cantilever of 1 m with L/r = 1000, or what `section` says; loads are made of the beam."""
    numbers = {"EA": 1e6, "GA": 1e6 / 3, "EI": 1.0} | section
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**numbers), cells=4)
    clamp = ub.Clamped(beam.start)
    return beam, ub.Scene(
        [beam],
        supports=[clamp, *(make(beam) for make in supports)],
        loads=[make(beam) for make in loads],
    )


# -- loads that are there from the start ---------------------------------------------------------

STEADY = {
    "dead": lambda b: ub.PointLoad(b.end, force=(0, -1.0)),
    "strong": lambda b: ub.PointLoad(b.end, force=(0, -10.0)),
    "follower": lambda b: ub.FollowerLoad(b.end, force=(0, -5.0)),
    "line": lambda b: ub.LineLoad(b, force=(0, -10.0)),
}


@pytest.mark.parametrize("load", STEADY.values(), ids=STEADY)
def test_under_steady_loads_both_static_schemes_agree(load):
    """`EnergyMomentumStatic` arrives where `Static` does, in the first step, with an exact ledger.

    The loads are applied in parts that turn no node by more than 0.02 rad: forces are in error by
    (Δψ/2)² = 1e-4 at θ = 1/2.  At θ > 1/2 they are of first order in the last of these parts, of
    which the rest of the step leaves a hundredth, and later steps nothing.
    """
    beam, scene = cantilever(load)
    expected = run(scene, ub.Static(), dt=0.5).displacement(beam.end)[-1]
    for theta in (0.5, 0.75, 1.0):
        found = run(scene, ub.EnergyMomentumStatic(theta))
        ends = found.displacement(beam.end)
        assert (ends[0] == 0).all()
        assert ends[1] == pytest.approx(expected, rel=2e-3, abs=2e-3)
        assert ends[-1] == pytest.approx(expected, rel=1e-3, abs=1e-3)
        assert found.energy.worst < 1e-9
        # All of the work of the load is counted: at θ = 1/2 it is what is stored.
        assert found.energy["loads"][1] > 0
        if theta == 0.5:
            assert found.energy["stored"] == pytest.approx(found.energy["loads"], rel=1e-9)


@pytest.mark.parametrize("reference", [False, True])
def test_the_step_after_loads_were_applied_does_not_go_on_like_that(reference):
    """A large load is applied in many equal parts; the step after them is not cut."""
    _, scene = cantilever(lambda b: ub.PointLoad(b.end, force=(0, 100.0)), EA=1e4, GA=4e3, EI=100.0)
    newton = ub.Newton(reference=reference)
    assert run(scene, ub.EnergyMomentumStatic(), dt=0.5, newton=newton).substeps == 32 + 2


@pytest.mark.parametrize("by", ["support", "actuator"])
def test_a_steady_motion_and_a_steady_actuator(by):
    """A support and a force that are there from the start are applied in parts as well."""
    lifted = [lambda b: ub.PrescribedDisplacement(b.end, v=0.6)]
    beam, scene = cantilever(supports=lifted if by == "support" else ())
    if by == "actuator":
        jack = ub.Stretch(ub.ground(1, -2), beam.end, ub.PrescribedForce(lambda t: 2.0))
        scene = replace(scene, connectors=[jack])
    schemes = ub.Static(), ub.EnergyMomentumStatic()
    one, other = (run(scene, scheme).displacement(beam.end)[-1] for scheme in schemes)
    assert np.abs(one[1]) > 0.1
    assert other == pytest.approx(one, rel=1e-6)


def test_loads_that_grow_are_not_applied_before():
    """Nothing precedes the first step where loads begin at zero, nor in a run that goes on."""
    _, scene = cantilever(lambda b: ub.PointLoad(b.end, force=(0, -1.0), amplitude=lambda t: t))
    first = run(scene, ub.EnergyMomentumStatic())
    assert first.substeps == 10
    again = run(scene, ub.EnergyMomentumStatic(), t=(1, 2), start=first)
    assert again.substeps == 10


# -- relaxation ------------------------------------------------------------------------------------


def relaxing(**law):
    """A beam with Duvaut-Lions plasticity, bent within one second and then held."""
    law = ub.ElastoPlastic(yield_limit=5.0, viscosity=ub.DuvautLions(0.5), **law)
    bend = [lambda b: ub.PrescribedDisplacement(b.end, v=lambda t: 0.1 * min(t, 1.0))]
    return cantilever(supports=bend, EI=100.0, bending=law)[1]


def test_relaxation_is_not_cut():
    """Steps up to the relaxation time are one step each, by either scheme, of first order."""
    scene = relaxing(isotropic=10.0)
    bent = run(scene, ub.Static())

    def relaxed(scheme, dt):
        rest = run(scene, scheme, t=(1, 6), dt=dt, start=bent)
        assert rest.substeps == round(5 / dt)
        return rest.reaction(scene.supports[1])[-1, 1]

    for scheme in (ub.Static(), ub.EnergyMomentumStatic()):
        coarse, middle, fine = (relaxed(scheme, dt) for dt in (0.5, 0.25, 0.125))
        assert coarse == pytest.approx(fine, rel=0.02)
        assert 1.5 < (coarse - middle) / (middle - fine) < 2.5


def test_the_order_of_the_work_of_inelastic_laws():
    """Of first order with θ = 1, of second with θ = 1/2."""

    def work(scheme, steps):
        return run(relaxing(), scheme, t=(0, 2), dt=1 / steps).energy["supports"][-1]

    exact = work(ub.EnergyMomentumStatic(0.5), 512)
    for theta, least, most in ((1.0, 0.8, 1.2), (0.5, 1.5, 4.0)):
        scheme = ub.EnergyMomentumStatic(theta)
        errors = [abs(work(scheme, steps) - exact) for steps in (16, 32)]
        assert least < np.log2(errors[0] / errors[1]) < most


# -- the first reaction ----------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()], ids=str)
def test_the_first_reaction(scheme):
    """Zero in the undeformed scene; that of the equilibrium with which a run begins."""
    growing = {"amplitude": lambda t: min(t, 1.0)}
    _, scene = cantilever(
        lambda b: ub.PointLoad(b.end, force=(0, -0.2), **growing),
        lambda b: ub.LineLoad(b, force=(0, -0.4), **growing),
    )
    clamp = scene.supports[0]
    first = run(scene, scheme)
    assert (first.reaction(clamp)[0] == 0).all()
    assert np.isfinite(first.reaction(clamp)).all()
    assert first.reaction(clamp)[-1, 1] == pytest.approx(0.6, rel=1e-9)
    again = run(scene, scheme, t=(1, 2), start=first)
    # The forces are those of the same equilibrium, a part of them right on the support; at the end
    # of the run before, the exact scheme knows those over the step.
    assert again.reaction(clamp)[0, 1:] == pytest.approx(first.reaction(clamp)[-1, 1:], rel=1e-4)
    assert again.reaction(clamp)[0, 1:] == pytest.approx(again.reaction(clamp)[-1, 1:], rel=1e-3)


def test_reactions_where_a_run_ends():
    """Those of the last state that was accepted, not of the step that failed."""
    # Above the snap-back of an imposed force
    softening = ub.Softening(limit=2.0, fracture_energy=0.05)
    load = {"force": (0, -4.0), "amplitude": ub.ramp(1.0)}
    _, scene = cantilever(lambda b: ub.PointLoad(b.end, **load), hinge=softening)
    with pytest.raises(ub.ConvergenceError) as ended:
        run(scene, ub.Static(), dt=0.3)
    solution = ended.value.solution
    t = solution.times[-1]
    assert 0.3 < t < 1.0
    force = solution.reaction(scene.supports[0])[-1]
    # Forces are met to 1e-10 of themselves.
    assert force[:2] == pytest.approx([0.0, 4.0 * t], abs=1e-8)


def test_a_controller_that_asks_for_a_velocity_is_refused():
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e3, GA=1e3, EI=1.0), cells=2)
    brake = ub.Controller(lambda now: -0.1 * now.velocity(beam.end)[1])
    scene = clamped(beam, connectors=[ub.Slide(ub.ground(2, 0), beam.end, brake, axis=(0, 1))])
    with raises("velocity of beam.end", "the run is static"):
        run(scene, ub.Static())


# -- leaps to other branches -----------------------------------------------------------------------


@pytest.mark.parametrize("dt", [1.0, 0.25, 0.01])
def test_a_straight_rope_sags_under_its_weight(dt):
    """[closed] H of the parabola, from w² S³/(24 H²) = H S/EA: 27 515 N for EI = 0.

    Its force is the third power of its sag, so that works differ by a factor of 2 in the first step
    however short it is.  EI and the sag, 2.3 % of the span, change H by less than half a percent.
    """
    S, EA, weight = 100.0, 2e7, 50.0
    section = ub.Section(EA=EA, GA=1e7, EI=1e3, rhoA=weight / 9.81)
    rope = ub.Beam((0, 0), (S, 0), section, cells=60)
    ends = [ub.Pinned(rope.start), ub.Pinned(rope.end)]
    scene = ub.Scene([rope], supports=ends, loads=[ub.Gravity(amplitude=lambda t: t)])
    end = 3 * dt if dt < 0.1 else 1.0
    found = run(scene, ub.Static(), t=(0, end), dt=dt)
    if end == 1.0:
        pull = -found.reaction(ends[0])[-1, 0]
        assert pull == pytest.approx((EA * (weight * S) ** 2 / 24) ** (1 / 3), rel=5e-3)
    assert found.substeps < 8 + 20 / dt  # a few substeps from the straight state


@pytest.mark.parametrize("scale", [1.0, 1e-12])
def test_a_shallow_truss_is_refused_at_its_limit_load(scale):
    """[closed] k (h² - x²) x/L³ in the middle of two rods has its limit at x = h/√3, at any scale
    of the forces; no step beyond is taken, also not the first one from the unloaded truss."""
    EA, h, L = 1e4 * scale, 0.1, 1.0
    section = ub.Section(EA=EA, GA=EA, EI=1.0 * scale)
    rods = [ub.Beam((x, 0), (0, h), section, cells=1) for x in (-L, L)]
    limit = 2 * EA / (2 * np.hypot(L, h) ** 3) * (h**2 - h**2 / 3) * h / np.sqrt(3)
    push = ub.PointLoad(rods[0].end, force=(0, -1.3 * limit), amplitude=lambda t: t)
    scene = ub.Scene(
        rods, joints=[ub.Revolute(rods[0].end, rods[1].end)],
        supports=[ub.Pinned(rod.start) for rod in rods], loads=[push],
    )  # fmt: skip
    for dt in (1.0, 0.1):
        with pytest.raises(ub.ConvergenceError) as ended:
            ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt)
        # The rods rotate by 0.1 rad, so that the limit is met to 1 %.
        assert ended.value.time == pytest.approx(1 / 1.3, rel=0.02)
        assert "constant loads act in the first step, give them amplitude=" in str(ended.value)


@pytest.mark.parametrize(("push", "steps"), [(1e-3, 100), (1e-2, 20)])
def test_a_bent_column_does_not_leap_to_the_straight_one(push, steps):
    """Energies agree with works there, too, but a growing load does work by its growth."""
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e4, GA=4e3, EI=1.0), cells=10)
    down = ub.PointLoad(column.end, force=(0, -3.0), amplitude=lambda t: t)
    scene = clamped(column, loads=[down, ub.PointLoad(column.end, force=(push, 0))])
    found = run(scene, ub.Static(), t=(0, 1), dt=1 / steps)
    sways = found.displacement(column.end)[:, 0]
    assert (np.diff(sways) > 0).all()
    assert sways[-1] > 0.6
    assert found.substeps > steps


@pytest.mark.parametrize("angle", [0.0, 0.37, 2.2, 4.0])
def test_a_pendulum_hangs_in_any_direction(angle):
    """The first tangent is singular to round-off, which is no less a mechanism than zero.

    Also in space, in any plane.
    """
    c, s = np.cos(angle), np.sin(angle)
    down, aside = np.array([s, -c]), np.array([c, s])
    section = ub.Section(EA=1e4, GA=1e4, EI=500.0, rhoA=1.0, rhoI=10.0)
    beam = ub.Beam((0, 0), tuple(3 * down), section, cells=3)
    push = ub.PointLoad(beam.end, force=tuple(0.1 * aside), amplitude=lambda t: t)
    joint = ub.Revolute(ub.ground(0, 0), beam.start)
    loads = [ub.Gravity(tuple(9.81 * down)), push]
    scene, turn = ub.Scene([beam], joints=[joint], loads=loads), Rotation.from_rotvec([c, 2 * s, 1])
    plane, _ = same_in_space(scene, ub.Static(), turn=turn, dt=0.5, tolerance=1e-9)
    shape = plane.shape(beam)
    weight = 9.81 * (shape[:-1] + shape[1:]) / 2  # of cells of 1 m and 1 kg
    assert weight.sum(axis=0) @ aside == pytest.approx(0.1 * (shape[-1] @ down), rel=1e-6)


def test_a_start_in_equilibrium_stays():
    """Loads that joints alone bear move nothing: works are round-off, which no check may judge."""
    for angle in np.linspace(0, 6.2, 7):
        r = np.array([np.cos(angle), np.sin(angle)])
        links = [ub.Body(tuple((i + 0.5) * r), mass=1.0, inertia=1 / 12) for i in range(2)]
        ground = ub.ground(0, 0)
        pins = [(ground, links[0].at(0, 0)), (links[0].at(*r), links[1].at(*r))]
        pairs = [(ground, links[0].middle), (links[0].middle, links[1].middle)]
        scene = ub.Scene(
            bodies=links, joints=[ub.Revolute(*pin, multipliers=True) for pin in pins],
            connectors=[ub.Turn(*pair, ub.Spring(10.0)) for pair in pairs],
            loads=[ub.Gravity(acceleration=tuple(9.81 * r))],
        )  # fmt: skip
        found = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
        assert np.abs(found.displacement(links[1].middle)).max() < 1e-12


# -- what only loads hold -------------------------------------------------------------------------

ROD = ub.Section(EA=1e6, GA=1e6, EI=1e4, rhoA=1.0)


def rods(*points, loads=None, **more):
    """Rods between points, hinged to each other and to a pin at the first point, and their load."""
    beams = [ub.Beam(a, b, ROD, cells=4) for a, b in itertools.pairwise(points)]
    joints = [ub.Revolute(a.end, b.start) for a, b in itertools.pairwise(beams)]
    supports = [ub.Pinned(beams[0].start)]
    acting = [ub.Gravity()] if loads is None else loads(beams[-1])
    return ub.Scene(beams, joints=joints, supports=supports, loads=acting, **more)


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()], ids=str)
@pytest.mark.parametrize("tip", [(8, 10), (6, 4)])
def test_a_weight_hangs_from_a_flexible_arm(scheme, tip):
    """The slack rope resists no swing before the first step; then it follows the tip sideways."""
    steel = ub.Section.tube(0.3, 0.012, E=210e9, nu=0.3, rho=7850.0)
    arm = ub.Beam((0, 10), tip, steel, cells=4)
    (x, y), weight = tip, 9.81 * 3000.0
    load = ub.Body((x, y - 5.0), mass=3000.0, inertia=900.0)
    rope = ub.Link(arm.end, load.at(x, y - 4.5))
    gravity, foot = ub.Gravity(), ub.Clamped(arm.start)
    scene = ub.Scene([arm], bodies=[load], joints=[rope], supports=[foot], loads=[gravity])
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
    hung, held = (run.displacement(place)[-1] for place in (load.at(x, y - 5.0), arm.end))
    np.testing.assert_allclose(hung[:2], held[:2], atol=1e-7)
    assert abs(hung[2]) < 1e-7
    assert abs(held[0]) > 1e-3
    np.testing.assert_allclose(run.joint(rope).force[-1], [0, weight], atol=1e-7 * weight)


def test_a_path_of_what_its_weight_holds():
    """[closed] A force F across a hanging rod at its end: tan of its angle is F over W/2.

    It bends by less than W l²/(8 EI) = 1e-4 of its length.
    """
    beam = ub.Beam((0, 0), (0, -1), ROD, cells=4)
    push = ub.PointLoad(beam.end, force=(1, 0), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=[ub.Gravity(), push])
    path = ub.follow(scene, ub.ArcLength(0.2), until=lambda now: now.t > 5)
    u, v, _ = path.displacement(beam.end).T
    np.testing.assert_allclose(u / (1 - v), path.factor / (9.81 / 2), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(
    ("points", "loads", "said"),
    [
        ([(0, 0), (0, -1)], lambda rod: [], ". Add supports"),
        ([(0, 0), (1, -1)], None, "only near an equilibrium, as a weight below its hinge"),
        (
            [(0, 0), (1, 0)],
            lambda rod: [ub.FollowerLoad(rod.end, force=(5, 0))],
            "loads do not hold it either",
        ),
        ([(0, 0), (1, 0)], lambda rod: [ub.RotatingFrame(3.0)], "loads do not hold it either"),
    ],
    ids=["unloaded", "it falls", "the load turns with it", "it rotates steadily"],
)
def test_motions_that_loads_do_not_hold_are_refused(points, loads, said):
    """With names, by statics and buckling."""
    with raises("free to move in 1 way", "can turn about (", said):
        ub.simulate(rods(*points, loads=loads), ub.Static(), t=(0, 1), dt=1)
    with pytest.raises(ub.ArgumentError, match=r"free to move|stiffness of its own"):
        ub.buckling(rods(*points, loads=loads), 1)


def test_only_motions_that_loads_do_not_hold_are_named():
    """A body that hangs from a rod at its own centre spins; its weight holds the swing, and that of
    bodies beside it that hang above their centres."""
    arm = ub.Beam((0, 0), (2, 0), ROD, cells=4)
    bodies = [ub.Body((x, -1), mass=1.0, inertia=1.0, name=n) for x, n in ((2, "load"), (1, "bob"))]
    rods = [ub.Link(arm.end, bodies[0].middle), ub.Link(arm.at(0.5), bodies[1].at(1, -0.5))]
    scene = ub.Scene(
        [arm], joints=rods, supports=[ub.Clamped(arm.start)], loads=[ub.Gravity()], bodies=bodies
    )
    spin = r"in 1 way[^:]*: load \(body 0\) can turn about \(2, -1\)\. The loads do not hold it"
    with pytest.raises(ub.ArgumentError, match=spin):
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)


def test_a_path_with_a_loose_rod_is_refused():
    """Its first state has no loads, by which the stiffness could be judged."""
    held, loose = (ub.Beam((x, 0), (x + 1, 0), ROD, cells=4, name=f"{x}") for x in (0, 2))
    push = ub.PointLoad(held.end, force=(0, 1), amplitude=lambda t: t)
    feet = [ub.Clamped(held.start), ub.Pinned(loose.start)]
    with raises("free to move in 1 way", "2 (beam 1) can turn", "loads do not hold it either"):
        ub.follow(ub.Scene([held, loose], supports=feet, loads=[push]), ub.LoadControl(1.0))


def test_a_free_rod_that_is_pulled_is_free():
    """The tension holds its rotation, and nothing its displacement."""
    beam = ub.Beam((0, 0), (1, 0), ROD, cells=4, name="rod")
    ends = [ub.PointLoad(beam.start, force=(-5, 0)), ub.PointLoad(beam.end, force=(5, 0))]
    with pytest.raises(ub.ArgumentError, match=r"free to move in 2 independent ways.*rod.*shift"):
        ub.simulate(ub.Scene([beam], loads=ends), ub.Static(), t=(0, 1), dt=1)
