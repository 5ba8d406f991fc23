# SPDX-License-Identifier: MIT
"""Modes and buckling: what is asked of them, and that it does not matter how."""

import math
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
from scenes import clamped
from time_series import read_vtkhdf, read_xdmf

import ufl_beam as ub
from ufl_beam.analysis.small_motions import SmallMotions

SECTION = ub.Section(EA=1e4, GA=4e3, EI=20.0, rhoA=0.5, rhoI=1e-3)


def cantilever(cells=6, **more):
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=cells, name="beam")
    return clamped(beam, **more)


def mechanism(m=1.0, s=1.0, kg=1.0, angle=0.0, *, damped=True):
    """Crank, flexible rod, slider, spring and dampers; one constraint that no joint shares."""
    N = kg * m / s**2
    cos, sin = math.cos(angle), math.sin(angle)

    def at(x, y):
        return (m * (cos * x - sin * y), m * (sin * x + cos * y))

    section = ub.Section(
        EA=1e4 * N, GA=4e3 * N, EI=20 * N * m**2, rhoA=0.5 * kg / m, rhoI=1e-3 * kg * m
    )
    crank = ub.Body(at(0.15, 0.1), mass=1.0 * kg, inertia=0.02 * kg * m**2)
    slider = ub.Body(at(1.3, 0.0), mass=2.0 * kg, inertia=0.1 * kg * m**2)
    rod = ub.Beam(at(0.3, 0.2), at(1.3, 0.0), section, cells=4)
    base, far = ub.ground(*at(0, 0)), ub.ground(*at(2.0, 0.0))
    damper = ub.Slide(far, slider.middle, ub.Damper(0.5 * N * s / m), axis=(cos, sin))
    return ub.Scene(
        [rod],
        bodies=[crank, slider],
        joints=[
            ub.Revolute(base, crank.at(*at(0, 0))),
            ub.Revolute(crank.at(*at(0.3, 0.2)), rod.start),
            ub.Revolute(rod.end, slider.middle),
            ub.Prismatic(far, slider.middle, axis=(cos, sin)),
        ],
        connectors=[
            ub.Slide(far, slider.middle, ub.Spring(30 * N / m), axis=(cos, sin)),
            *([damper] if damped else []),
        ],
        damping=[ub.KelvinVoigt(1e-3 * s)] if damped else [],
    )


# -- how a scene is stated does not matter -------------------------------------------------------


@pytest.mark.parametrize("damped", [False, True])
def test_units_and_axes(damped):
    """Tolerance: that of the eigenvalue solver, 1e-12, times the condition of the lowest mode."""
    plain = ub.modes(mechanism(damped=damped), 4)
    for units, second in (((1e3, 1.0, 1e-3), 1.0), ((1.0, 60.0, 1.0), 60.0)):
        other = ub.modes(mechanism(*units, angle=0.7, damped=damped), 4)
        np.testing.assert_allclose(other.exponents * second, plain.exponents, rtol=1e-8, atol=1e-8)


def test_a_roller_at_an_angle():
    """The same as one along an axis, in a turned scene."""

    def omega(angle):
        end = (2 * math.cos(angle), 2 * math.sin(angle))
        beam = ub.Beam((0, 0), end, SECTION, cells=6)
        roller = ub.Roller(beam.end, along=end)
        return ub.modes(clamped(beam, roller), 4).omega

    np.testing.assert_allclose(omega(0.6), omega(0.0), rtol=1e-9)


def test_a_joint_that_is_held_and_one_that_is_shared():
    """Multipliers of constraints bring no modes, and no others."""

    def omega(**how):
        one, two = (ub.Beam((x, 0), (x + 1, 0), SECTION, cells=4) for x in (0, 1))
        joint = ub.Revolute(one.end, two.start, **how)
        return ub.modes(ub.Scene([one, two], joints=[joint]), 8).omega

    shared, held = omega(), omega(multipliers=True)
    assert np.sum(shared == 0) == np.sum(held == 0) == 4  # three of the whole, one of the joint
    np.testing.assert_allclose(held, shared, rtol=1e-9)


def test_every_process_gives_the_same():
    comm = MPI.COMM_WORLD
    exponents = comm.allgather(ub.modes(mechanism(), 4).exponents)
    for other in exponents:
        np.testing.assert_array_equal(other, exponents[0])


def test_all_modes_there_are():
    """Of 6 cells, 18 degrees of freedom are free; more are not invented."""
    scene = cantilever()
    found = ub.modes(scene, 100)
    assert len(found) == 18
    assert (np.diff(found.omega) >= 0).all()
    np.testing.assert_allclose(found.omega[:3], ub.modes(scene, 3).omega, rtol=1e-9)


# -- small systems -------------------------------------------------------------------------------


def test_a_damped_mass():
    """[closed] ω = √(k/m), ζ = c/(2√(km)); beyond 1 two motions that do not oscillate."""
    k, mass = 8.0, 2.0
    body = ub.Body((1, 0), mass=mass, inertia=1.0)
    here = ub.ground(1, 0)

    def exponents(c):
        spring, damper = ub.Spring(k), ub.Damper(c)
        scene = ub.Scene(
            bodies=[body],
            joints=[ub.Prismatic(here, body.middle, axis=(1, 0))],
            connectors=[
                ub.Slide(here, body.middle, spring, axis=(1, 0)),
                ub.Slide(here, body.middle, damper, axis=(1, 0)),
            ],
        )
        return ub.modes(scene, 2)

    ζ = 0.3
    light = exponents(2 * ζ * math.sqrt(k * mass))
    np.testing.assert_allclose(light.omega, [2.0], rtol=1e-10)
    np.testing.assert_allclose(light.damping, [ζ], rtol=1e-10)
    ζ = 2.0
    heavy = exponents(2 * ζ * math.sqrt(k * mass))
    np.testing.assert_allclose(
        heavy.exponents, 2.0 * (-ζ + np.array([1, -1]) * math.sqrt(ζ**2 - 1)), rtol=1e-9
    )
    np.testing.assert_array_equal(heavy.damping, 1.0)


@pytest.mark.parametrize("damping", [(), (ub.KelvinVoigt(1e-3),), (ub.Rayleigh(mass=0.1),)])
def test_a_free_chain_has_as_many_zeros_as_it_can_move(damping):
    """Two beams and a revolute joint: 4; mass-proportional damping slows each of them by a0."""
    one, two = (ub.Beam((x, 0), (x + 1, 0), SECTION, cells=4) for x in (0, 1))
    scene = ub.Scene([one, two], joints=[ub.Revolute(one.end, two.start)], damping=damping)
    found = ub.modes(scene, 10)
    assert np.sum(found.omega == 0) == 4
    assert np.isnan(found.damping[:4]).all()
    slow = [s for s in found.exponents if s.imag == 0 and s != 0]
    np.testing.assert_allclose(slow, -0.1, rtol=1e-7)
    assert len(slow) == (4 if damping and isinstance(damping[0], ub.Rayleigh) else 0)


def test_friction_that_sticks_holds():
    body = ub.Body((1, 0), mass=2.0, inertia=1.0)
    here = ub.ground(1, 0)
    held = ub.Slide(here, body.middle, ub.Coulomb(5.0), axis=(0, 1))
    springs = [
        ub.Slide(here, body.middle, ub.Spring(8.0), axis=(1, 0)),
        ub.Turn(here, body.middle, ub.Spring(9.0)),
    ]
    found = ub.modes(ub.Scene(bodies=[body], connectors=[held, *springs]), 5)
    np.testing.assert_allclose(found.omega, [2.0, 3.0], rtol=1e-10)


# -- what has yielded and what is open -----------------------------------------------------------


def test_what_has_yielded_answers_elastically():
    """The frequencies of a beam that was bent beyond its limit are those of an elastic one.

    It stays bent under its load, which shifts them by less than a hundredth; with the tangent of
    hardening, a tenth of the elastic one at the clamp, the first would be a third lower.
    """
    law = ub.ElastoPlastic(yield_limit=1.0, isotropic=2.0)
    section = ub.Section(EA=1e4, GA=4e3, EI=20.0, rhoA=0.5, rhoI=1e-3, bending=law)
    beam = ub.Beam((0, 0), (2, 0), section, cells=6)
    push = ub.PointLoad(beam.end, force=(0, 0.55), amplitude=ub.ramp(1.0))
    scene = clamped(beam, loads=[push])
    bent = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    assert bent.energy.lost["plastic"][-1] > 0
    elastic = ub.modes(cantilever(), 3).omega
    np.testing.assert_allclose(ub.modes(scene, 3, at=bent).omega, elastic, rtol=1e-2)


def test_a_hinge_that_bears_nothing_is_a_joint():
    """In the cell of the hinge the rest is elastic: a joint between two cells is h/2 away."""
    cells = 40
    open_ = ub.Beam((0, 0), (2, 0), SECTION, cells=cells, hinges={0.5: ub.Softening(0.0, 1.0)})
    scene = clamped(open_, ub.Pinned(open_.end))
    one = ub.Beam((0, 0), (1, 0), SECTION, cells=cells // 2)
    two = ub.Beam((1, 0), (2, 0), SECTION, cells=cells // 2)
    joint = ub.Revolute(one.end, two.start)
    jointed = ub.Scene(
        [one, two], joints=[joint], supports=[ub.Clamped(one.start), ub.Pinned(two.end)]
    )
    with_hinge, with_joint = (ub.modes(s, 2).omega for s in (scene, jointed))
    np.testing.assert_allclose(with_hinge, with_joint, rtol=2 / cells)


# -- the rotating frame --------------------------------------------------------------------------


def test_a_rotating_frame_keeps_energy():
    """Coriolis' force does no work and the centrifugal force has a potential: the ledger closes."""
    frame = ub.RotatingFrame(3.0, (0.2, 0.1))
    scene = cantilever(loads=[frame])
    beam = scene.beams[0]
    thrown = ub.Scene(
        [beam],
        supports=scene.supports,
        loads=[frame],
        masses=[ub.PointMass(beam.end, 0.3)],
    )
    solution = ub.simulate(thrown, ub.EnergyMomentum(), t=(0, 1.0), dt=0.02)
    assert np.ptp(solution.displacement(beam.end)[:, 1]) > 1e-3
    assert solution.energy.worst < 1e-9  # the ledger closes


def test_what_acts_in_the_undeformed_scene_is_named():
    """Vibrations about a state that is none of equilibrium are refused, or a warning names why."""
    scene = cantilever(loads=[ub.RotatingFrame(12.0)])
    with pytest.raises(
        ub.ArgumentError, match=r"RotatingFrame; give .* at=simulate\(scene, Static"
    ):
        ub.modes(scene, 1)
    beam = scene.beams[0]
    others = {
        "VirtualWork 'wind'": {"works": [ub.VirtualWork("wind", lambda q, w, axis: w[1])]},
        "Potential 'well'": {"works": [ub.Potential("well", lambda q, axis: q[0])]},
        "Stretch": {
            "connectors": [
                ub.Stretch(ub.ground(3, 1), beam.end, ub.PrescribedForce(lambda t: 5.0))
            ],
        },
    }
    for name, more in others.items():
        with pytest.warns(ub.ModelWarning, match=f"{name}.*no equilibrium.*give at=simulate"):
            ub.modes(clamped(beam, **more), 1)
    held = [ub.Clamped(beam.start), ub.PrescribedDisplacement(beam.end, u=0.001)]
    with pytest.warns(ub.ModelWarning, match="PrescribedDisplacement at .* no equilibrium"):
        ub.modes(ub.Scene([beam], supports=held), 1)
    # What balances, a load of the undeformed scene, and a work without a force there: no warning.
    bed = ub.Potential("bed", lambda q, axis: 5 * q[1] ** 2)
    pull = ub.PointLoad(beam.end, force=(1, 0))
    ub.modes(clamped(beam, loads=[pull], works=[bed]), 1)


def test_modes_of_what_its_weight_holds():
    """[closed] ω² = g/l of a point; a body that falls has none, with or without its weight."""
    body = ub.Body((0, -1), mass=1.0, inertia=1e-12)
    pin = ub.Revolute(ub.ground(0, 0), body.at(0, 0))
    scene = ub.Scene([], joints=[pin], bodies=[body], loads=[ub.Gravity()])
    assert ub.modes(scene, 1).omega[0] == pytest.approx(9.81**0.5, rel=1e-9)
    falling = ub.Scene([], bodies=[body], loads=[ub.Gravity()])
    assert np.abs(ub.modes(falling, 3).omega).max() == 0.0


def test_a_thrown_body_flies_straight():
    """[closed] Seen from the frame a free body spirals; the midpoint rule is of second order."""
    rate, mass = 2.0, 1.5
    body = ub.Body((1.0, 0.0), mass=mass, inertia=1.0)
    # A spring that is next to nothing: what is attached to nothing has no matrix entries.
    nothing = ub.Slide(ub.ground(1, 0), body.middle, ub.Spring(1e-12), axis=(1, 0))
    at_rest = ub.Velocity((body,), linear=(0.0, -rate * 1.0))
    scene = ub.Scene(
        bodies=[body], connectors=[nothing], initial=[at_rest], loads=[ub.RotatingFrame(rate)]
    )
    errors = []
    for steps in (50, 100):
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=1 / steps)
        there = solution.position(body.middle)[-1]
        errors.append(np.linalg.norm(there - (math.cos(rate), -math.sin(rate))))
    assert errors[1] < 1e-3
    assert 1.9 < math.log2(errors[0] / errors[1]) < 2.1


# -- files and pictures --------------------------------------------------------------------------


def test_the_largest_displacement_of_a_mode_is_one(shared_path, on_first_rank):
    """The largest displacement is one, and the file has all modes."""
    scene = cantilever()
    found = ub.modes(scene, 3)
    tip = found.shape(0, scene.beams[0].end)
    np.testing.assert_allclose(tip[:2], [0, 1], atol=1e-9)
    motion = found.motion(0, amplitude=0.1, count=4)
    height = motion.displacement(scene.beams[0].end)[:, 1]
    np.testing.assert_allclose(height, [0.2, 0, -0.2, 0, 0.2], atol=1e-9)
    found.write(shared_path / "modes.xdmf")
    found.write(shared_path / "modes.hdf")
    one = on_first_rank(lambda: read_xdmf(shared_path / "modes.xdmf"))
    other = on_first_rank(lambda: read_vtkhdf(shared_path / "modes.hdf"))
    assert one.times == other.times == [0, 1, 2]
    assert all((one.of(name) == other.of(name)).all() for name in one.names)
    moments = one.of("M")[0]
    # A bending moment EI v'': of the clamped end of a cantilever 3.52 times v/L², less h/2.
    np.testing.assert_allclose(np.abs(moments).max(), 20 * 3.52 * 0.2 / 4, rtol=0.15)
    with pytest.raises(ub.ArgumentError, match="there is no shape 3; there are 3"):
        found.shape(3, scene.beams[0].end)


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", ["vibration", "buckling"])
def test_a_mode_that_passes_through_its_state_shows_the_diagrams_of_the_state(kind, degree):
    """[closed] A quarter of a period after the largest displacement only the state is left."""
    scene = cantilever(cells=3)
    beam, mesh = scene.beams[0], ub.Mesh(degree=degree)
    across = [ub.LineLoad(beam, force=(0, -3.0)), ub.Pressure(beam, normal=1.0)]
    weight = ub.Gravity((-10.0, 0.0))  # along the beam
    loaded = replace(scene, loads=[weight] + across * (kind == "vibration"))
    state = ub.simulate(loaded, ub.Static(), t=(0, 1), dt=1.0, mesh=mesh)
    if kind == "vibration":
        found = ub.modes(loaded, 1, at=state)
    else:
        pushed = replace(scene, loads=[weight, ub.PointLoad(beam.end, force=(-1.0, 0))])
        found = ub.buckling(pushed, 1, at=state)
    motion, of_state = found.motion(0, amplitude=0.01, count=4), np.array(state.diagram(beam))
    size = np.abs(of_state[1:]).max()  # tolerance: stresses of the state are subtracted
    np.testing.assert_allclose(motion.diagram(beam, 1), of_state, rtol=0, atol=1e-9 * size)
    # [closed] EI u'' of the first mode at the clamped end is 3.52 EI u/L²; buckling: π²/4.
    bends = abs(motion.diagram(beam, 0).M - of_state[3]).max()
    curvature = (3.52 if kind == "vibration" else math.pi**2 / 4) * 0.02 / 4
    assert bends == pytest.approx(20 * curvature, rel=0.3)  # of three cells


@pytest.mark.serial
def test_modes_have_pictures(tmp_path):
    scene = cantilever(loads=[])
    found = ub.modes(scene, 4)
    ub.plot(found).savefig(tmp_path / "modes.png")
    ub.plot(found, numbers=np.arange(1, 2)).savefig(tmp_path / "one.png")
    assert (tmp_path / "modes.png").stat().st_size > (tmp_path / "one.png").stat().st_size > 1000
    assert "mode 0: " in str(found)
    assert "Hz" in found.titles[0]


# -- the change of stiffness -----------------------------------------------------------------------


def mixed():
    """Beams elastic and not, a support at an angle, and connectors of all kinds that store."""
    yielding = ub.Section(EA=1e3, GA=4e2, EI=10.0, bending=ub.ElastoPlastic(30.0, 0.2))
    elastic = ub.Section(EA=1e3, GA=4e2, EI=10.0)
    a = ub.Beam((0, 0), (0.3, 1), elastic, cells=2, name="a")
    b = ub.Beam((0.3, 1), (1.5, 1.2), yielding, cells=3, name="b")
    c = ub.Beam((1.5, 1.2), (2, 0), elastic, cells=2, name="c")
    d = ub.Beam((0, 2), (1, 2.5), elastic, cells=2, name="d")
    body = ub.Body((1, 2.7), mass=1.0, inertia=1.0, name="body")
    return ub.Scene(
        [a, b, c, d],
        bodies=[body],
        supports=[ub.Clamped(a.start), ub.Roller(c.end, along=(0.3, 1.0))],
        joints=[
            ub.Rigid(a.end, b.start, multipliers=True),
            ub.Revolute(b.end, c.start),
            ub.Revolute(d.end, body.at(1, 2.5), multipliers=True),
            ub.Guided(d.start, lambda s: (s, 2 + 0.3 * s * s)),
        ],
        connectors=[
            ub.Turn(b.end, c.start, ub.Spring(7.0)),
            ub.Stretch(b.end, d.end, ub.ForceLaw(lambda x, v: 5 * x + 30 * x**2 + 20 * x**3)),
            ub.Turn(body.middle, d.end, ub.ForceLaw(lambda x, v: 5 * x + 3 * x**2)),
            ub.Turn(ub.ground(1, 2.7), body.middle, ub.Spring(3.0)),
            ub.Stretch(a.at(0.5), d.start, ub.Spring(11.0)),
        ],
        loads=[ub.PointLoad(b.end, force=(0.1, -0.3), amplitude=lambda t: t)],
    )


@pytest.mark.serial
def test_change_of_stiffness_is_its_derivative():
    """Against differences of fourth order of the stiffness itself, in any direction.

    They leave 1e-8 of derivatives of 140 N or so, and the guide's curvature as much; works of the
    change between motions are those of its matrix, to round-off.
    """
    scene = mixed()
    loaded = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    small = SmallMotions(scene, loaded, 2.0)
    simulation, random = small._simulation, np.random.default_rng(0)
    along, _ = small.linear_change("modes")
    for u in (along, random.normal(size=len(along))):
        derived = small._matrix(simulation.equation.tangent_change(small.q, u)).toarray()
        h = 1e-2 / np.abs(u).max()
        stencil = ((-2, 1), (-1, -8), (1, 8), (2, -1))
        stiff = {k: small._linearized(small.q + k * h * u)[1].toarray() for k, _ in stencil}
        difference = sum(weight * stiff[k] for k, weight in stencil) / (12 * h)
        assert np.abs(derived - difference).max() <= 1e-8 * np.abs(derived).max()
        right, left = small._with_laws()
        x = random.normal(size=(right.shape[1], 3))
        X, Y = right @ x, left.T @ x
        stiffness, change = simulation.equation.tangent_works(small.q, u, X, Y)
        np.testing.assert_allclose(stiffness, x.T @ small.K @ x, rtol=0, atol=1e-9)
        digits = 1e-11 * np.abs(change).max()
        np.testing.assert_allclose(change, Y.T @ derived @ X, rtol=0, atol=digits)


# -- wrong calls ---------------------------------------------------------------------------------


def test_wrong_calls_are_refused():
    scene = cantilever()
    beam = scene.beams[0]
    other = cantilever(4)
    solution = ub.simulate(cantilever(loads=[ub.Gravity()]), ub.Static(), t=(0, 1), dt=1)
    for call, message in (
        (lambda: ub.modes(scene, 0), "modes: n = 0 must be"),
        (lambda: ub.modes(beam, 2), "modes: scene = .* is not a Scene"),
        (lambda: ub.modes(other, 2, at=solution), "modes: at is a solution of other beams"),
        (lambda: ub.modes(scene, 2, at=2.0), "modes: at = 2.0 is not a Solution"),
        (lambda: ub.buckling(scene, 1), "nothing acts on the scene at t = 1 s"),
        (
            lambda: ub.buckling(ub.Scene([beam], loads=[ub.Gravity()]), 1),
            "free to move in 3 independent ways",
        ),
        (
            lambda: ub.buckling(cantilever(loads=[ub.RotatingFrame(1.0)]), 1),
            "the RotatingFrame has a stiffness of its own",
        ),
        (lambda: ub.RotatingFrame(math.inf), "RotatingFrame: rate = inf is not finite"),
    ):
        with pytest.raises(ub.ArgumentError, match=message):
            call()


def test_a_scene_without_mass_has_no_modes():
    section = ub.Section(EA=1e4, GA=4e3, EI=20.0)
    beam = ub.Beam((0, 0), (2, 0), section, cells=2)
    with pytest.raises(ub.ArgumentError, match="nothing that can move has mass"):
        ub.modes(clamped(beam), 1)


def test_a_lone_body_seen_from_a_rotating_frame():
    """It flies straight; position and velocity lag (ω dt)²/12 of the angle ω t, 3.2 m away."""
    rate, body = 2.0, ub.Body((1, 0), mass=2.0, inertia=1.0)
    scene = ub.Scene(
        bodies=[body],
        loads=[ub.RotatingFrame(rate)],
        initial=[ub.Velocity([body], linear=(0.0, 1.0))],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01)
    straight = np.array([1.0, 3.0])  # at 1 s, with the velocity of the frame, ω r = 2 m/s
    c, s = np.cos(rate), np.sin(rate)
    seen = np.array([[c, s], [-s, c]]) @ straight
    np.testing.assert_allclose(
        solution.position(body.middle)[-1], seen, atol=3.2 * 2 * 2.0 * 0.02**2 / 12
    )
    assert solution.energy.worst < 1e-12


@pytest.mark.parametrize(
    "law",
    [
        ub.Damper(5.0), ub.PrescribedForce(lambda t: 0.0 * t),
        ub.PrescribedMotion(lambda t: 0.0 * t),
        ub.Spring(10.0), ub.Stop(1e4, low=-1.0), ub.ForceLaw(lambda e, de: 10 * e + 5 * e**3),
        ub.Coulomb(1.0),
    ],
    ids=lambda law: type(law).__name__,
)  # fmt: skip
def test_buckling_with_each_law(law):
    """A column with a connector at its top: free, held (what sticks and motors), or sprung."""
    section = ub.Section(EA=1e6, GA=1e6, EI=500.0, rhoA=2.0, rhoI=0.01)
    column = ub.Beam((0, 0), (0, 2), section, cells=8)
    weight = ub.PointLoad(column.end, force=(0.0, -100.0))
    top = ub.Slide(ub.ground(0, 2), column.end, law, axis=(1, 0))
    foot = ub.Clamped(column.start)
    scene = ub.Scene([column], supports=[foot], loads=[weight], connectors=[top])
    factor = ub.buckling(scene, 1).factors[0]
    free = np.pi**2 / 4 * 500.0 / 2.0**2 / 100.0
    held = 8.18 * free  # (0.699 l) beside 2 l
    if isinstance(law, ub.PrescribedMotion | ub.Coulomb):
        assert factor == pytest.approx(held, rel=0.06)
    elif isinstance(law, ub.Spring | ub.ForceLaw):
        assert 1.03 * free < factor < 1.1 * free
    else:
        assert factor == pytest.approx(free, rel=0.01)


def portal(loads):
    left, right = (ub.Beam((x, 0), (x, 4), SECTION, cells=6) for x in (0, 6))
    girder = ub.Beam((0, 4), (6, 4), SECTION, cells=8)
    return ub.Scene(
        [left, girder, right],
        joints=[ub.Rigid(left.end, girder.start), ub.Rigid(girder.end, right.end)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        loads=loads(girder),
    )


def test_factors_of_loads_that_bend_beams_are_marked():
    """A load along a girder bends it long before the columns buckle."""
    columns = portal(lambda beam: [ub.PointLoad(x, (0, -1)) for x in (beam.start, beam.end)])
    good = ub.buckling(columns, 2)
    assert good.errors.max() < 0.02
    along = portal(lambda beam: [ub.LineLoad(beam, (0, -1 / 3))])
    with (
        pytest.warns(ub.ModelWarning, match="are no buckling loads.*loads bend, turn"),
        pytest.warns(ub.ModelWarning, match="of magnitude .* are complex and left out"),
    ):
        wrong = ub.buckling(along, 2)
    assert wrong.errors.min() > 0.4
    assert abs(wrong.factors[0]) < 0.5 * good.factors[0]
    assert all("no buckling load" in title for title in wrong.titles)


def test_errors_of_factors_estimate_the_change_of_factors():
    """A force across a column, 0.3 % of its load, changes the factor by less than the estimate."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=16)
    across, alone = (
        ub.buckling(clamped(beam, loads=[ub.PointLoad(beam.end, (-1.0, y))]), 1)
        for y in (0.003, 0.0)
    )
    assert alone.errors[0] < 1e-3
    change = 1 - across.factors[0] / alone.factors[0]
    assert change < across.errors[0] < 3 * change


def test_a_column_that_only_shortens_does_not_buckle():
    """[closed] P (1 - P/EA) = π² EI/L² has no solution P if EA < 4 π² EI/L²; GA is 1e4 EA.

    The only factor is P = EA, at which nothing is left of the column.
    """
    section = ub.Section(EA=30.0, GA=3e5, EI=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=16)
    push = ub.PointLoad(beam.end, force=(-1.0, 0))
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end)], loads=[push])
    with pytest.warns(ub.ModelWarning, match="are complex and left out.*shorten.*GA > 10 EA"):
        found = ub.buckling(scene, 1)
    assert found.factors == pytest.approx([30.0], rel=1e-3)  # EA/GA and the mesh


def test_masses_of_moving_loads_are_left_out():
    """They would be damping, because their tangent grows with the square of the frequency."""
    found, bare = [], cantilever()
    for mass in (0.0, 2000.0):
        axle = ub.MovingLoad(bare["beam"], lambda t: 1.3, force=(0, -2e-3), mass=mass)
        scene = replace(bare, loads=[axle])
        at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
        found.append(ub.modes(scene, 3, at=at).exponents)
    assert np.allclose(*found, rtol=1e-12)


def test_buckling_about_a_state_needs_loads_that_grow():
    section = ub.Section(EA=4e9, GA=1.5e9, EI=5e7, rhoA=300.0)
    beam = ub.Beam((0, 0), (3, 0), section, cells=8)
    load = ub.PointLoad(beam.end, force=(-1e7, 0), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end)], loads=[load])
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    with pytest.raises(ub.ArgumentError, match="so that nothing grows"):
        ub.buckling(scene, 1, at=at)
    whole, rest = ub.buckling(scene, 1).factors[0], ub.buckling(scene, 1, t=2.0, at=at).factors[0]
    assert 1.0 + rest == pytest.approx(whole, rel=1e-2)


def spinning(rate):
    """A free beam that turns about its middle; it bends at 22.4 √(EI/ρAL⁴) = 35 rad/s."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    turn = ub.Velocity([beam], angular=rate, about=(1.0, 0.0))
    scene = ub.Scene([beam], initial=[turn])
    return scene, ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.02), dt=0.01)


def test_a_state_that_turns_is_refused():
    """Its modes need centrifugal and Coriolis forces: (rate/frequency)² of the stiffness.

    Without them the free rotation of the beam, however slow, has about its rate as a frequency.
    """
    for rate in (0.1, -20.0):
        scene, run = spinning(rate)
        with pytest.raises(ub.ArgumentError, match=r"modes: at turns: .* rad/s.* RotatingFrame"):
            ub.modes(scene, 4, at=run)
    beam = scene.beams[0]
    held = clamped(beam, loads=[ub.PointLoad(beam.end, (-1.0, 0))])
    with pytest.raises(ub.ArgumentError, match=r"buckling: at turns: .* rad/s.* RotatingFrame"):
        ub.buckling(held, 1, at=run)


def test_a_vibrating_state_is_no_spin():
    """The tip of a cantilever moves by 1 % of its length; its frequencies do not depend on this."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    kick = ub.PointLoad(beam.end, force=(0, 0.4), amplitude=lambda t: float(t < 0.05))
    scene = clamped(beam, loads=[kick])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.3), dt=0.01)
    assert np.abs(run.v[-1]).max() > 1e-3
    bent = ub.modes(scene, 1, at=run).omega
    assert bent == pytest.approx(ub.modes(scene, 1).omega, rel=1e-3)


def propped(law, *loads):
    """A beam on two bearings and a connector under its middle."""
    section = ub.Section(EA=2e9, GA=8e8, EI=5e6, rhoA=50.0)
    beam = ub.Beam((0, 0), (6, 0), section, cells=8)
    support = ub.Slide(ub.ground(3, 0), beam.at(0.5), law, axis=(0, 1))
    bearings = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    return ub.Scene([beam], supports=bearings, connectors=[support], loads=loads)


def linearized(scene, at=None):
    tip = ("displacement", scene.beams[0].end, "psi")
    return ub.linearize(scene, inputs=[scene.loads[0]], outputs=[tip], at=at)


@pytest.mark.parametrize(
    "law",
    [
        ub.Stop(4e6, low=0.0), ub.Stop(4e6, high=0.0), ub.Stop(4e6, low=0.0, high=0.0),
        ub.ForceLaw(lambda e, de: 4e6 * min(e, 0.0)),
    ],
    ids=["low", "high", "both", "own"],
)  # fmt: skip
def test_a_stop_that_just_touches_is_named(law):
    """It counts as open in modes, buckling and linear models, though any load may close it."""
    scene = propped(law)
    push = ub.PointLoad(scene.beams[0].end, (-1.0, 0), amplitude=lambda t: t)
    scene = replace(scene, loads=[push])
    for name, call in (
        ("modes", lambda: ub.modes(scene, 1)), ("buckling", lambda: ub.buckling(scene, 1)),
        ("linearize", lambda: linearized(scene)),
    ):  # fmt: skip
        with pytest.warns(ub.ModelWarning, match=f"{name}: Slide.*at a limit.*Give at="):
            call()


def test_a_stop_that_is_pressed_or_open_is_not_named():
    """Nor are laws with a slope that varies smoothly; the pressed stop is as stiff as a spring."""
    smooth = [ub.ForceLaw(lambda e, de: 1e6 * e**3), ub.ForceLaw(lambda e, de: 1e6 * e * abs(e))]
    for law in (ub.Stop(4e6, low=-1e-3), ub.Spring(4e6), *smooth):
        scene = propped(law)
        ub.modes(scene, 1)  # no warning is issued
    scene = propped(ub.Stop(4e6, low=0.0), ub.Gravity())
    pressed = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    found = ub.modes(scene, 1, at=pressed).omega
    assert found == pytest.approx(ub.modes(propped(ub.Spring(4e6)), 1).omega, rel=1e-4)


def test_crossed_ties_that_hang_slack_are_named():
    section = ub.Section(EA=2e9, GA=8e8, EI=5e6, rhoA=50.0)
    left, right = (ub.Beam((x, 0), (x, 3), section) for x in (0, 4))
    top = ub.Beam((0, 3), (4, 3), section)
    tie = ub.Stop(1e7, high=0.0)
    ties = [ub.Stretch(left.start, right.end, tie), ub.Stretch(right.start, left.end, tie)]
    scene = ub.Scene(
        [left, right, top], supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        joints=[ub.Rigid(left.end, top.start), ub.Rigid(top.end, right.end)], connectors=ties,
    )  # fmt: skip
    with pytest.warns(ub.ModelWarning, match="modes: Stretch.*, Stretch.*at a limit"):
        ub.modes(scene, 1)


def test_fast_decays_are_modes():
    """High vibrations with `KelvinVoigt` have a slow and a fast decay, as the linear model."""
    section = ub.Section(EA=1e5, GA=3e4, EI=10.0, rhoA=1.0, rhoI=1e-3)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    push = ub.PointLoad(beam.end, force=(0, 1.0))
    scene = clamped(beam, loads=[push], damping=[ub.KelvinVoigt(0.03)])
    found = ub.modes(scene, 100).exponents
    model = ub.linearize(scene, inputs=[push], outputs=[("displacement", beam.end, "v")])
    expected = np.linalg.eigvals(model.state_space()[0])
    found = np.append(found, found[np.abs(found.imag) > 1e-9 * np.abs(found)].conj())
    assert len(found) == len(expected) == 24
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-6)
