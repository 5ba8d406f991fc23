# SPDX-License-Identifier: MIT
"""Modes and buckling: arguments, small systems, inelastic states, loads that buckle nothing."""

import math
from dataclasses import replace
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises
from scenes import clamped, rigid_chain
from time_series import read_vtkhdf, read_xdmf

import ufl_beam as ub
from ufl_beam.analysis.small_motions import SmallMotions

SECTION = ub.Section(EA=1e4, GA=4e3, EI=20.0, rhoA=0.5, rhoI=1e-3)


def cantilever(cells=6, section=SECTION, force=None, time=lambda t: 1.0, **more):
    beam = ub.Beam((0, 0), (2, 0), section, cells=cells, name="beam")
    loads = [] if force is None else [ub.PointLoad(beam.end, force, amplitude=time)]
    return clamped(beam, **{"loads": loads, **more})


def free_chain(damping=(), **joint):
    """Two free beams and a revolute joint."""
    one, two = (ub.Beam((x, 0), (x + 1, 0), SECTION, cells=4) for x in (0, 1))
    return ub.Scene([one, two], joints=[ub.Revolute(one.end, two.start, **joint)], damping=damping)


def test_all_modes_there_are():
    """Of 6 cells, 18 degrees of freedom are free; more are not invented, on any process."""
    scene = cantilever()
    found = ub.modes(scene, 100)
    assert len(found) == 18
    assert (np.diff(found.omega) >= 0).all()
    for other in MPI.COMM_WORLD.allgather(found.exponents):
        np.testing.assert_array_equal(other, found.exponents)
    np.testing.assert_allclose(found.omega[:3], ub.modes(scene, 3).omega, rtol=1e-9)


# -- small systems -------------------------------------------------------------------------------


@pytest.mark.parametrize("ζ", [0.3, 2.0])
def test_a_damped_mass(ζ):
    """[closed] ω = √(k/m), ζ = c/(2√(km)); beyond 1 two decays.  Friction that sticks holds."""
    body, here = ub.Body((1, 0), mass=2.0, inertia=1.0), ub.ground(1, 0)
    spring, damper = ub.Spring(8.0), ub.Damper(2 * ζ * math.sqrt(8.0 * 2.0))
    connectors = [ub.Slide(here, body.middle, law, axis=(1, 0)) for law in (spring, damper)]
    connectors += [ub.Slide(here, body.middle, ub.Coulomb(5.0), axis=(0, 1))]
    connectors += [ub.Turn(here, body.middle, ub.Spring(1e4))]
    found = ub.modes(ub.Scene(bodies=[body], connectors=connectors), 2)
    if ζ < 1:
        np.testing.assert_allclose(found.omega, [2.0, 100.0], rtol=1e-10)
        np.testing.assert_allclose(found.damping, [ζ, 0.0], rtol=1e-10, atol=1e-12)
    else:
        decays = 2.0 * (-ζ + np.array([1, -1]) * math.sqrt(ζ**2 - 1))
        np.testing.assert_allclose(found.exponents, decays, rtol=1e-9)
        np.testing.assert_array_equal(found.damping, 1.0)


@pytest.mark.parametrize("damping", [(), (ub.KelvinVoigt(1e-3),), (ub.Rayleigh(mass=0.1),)])
def test_a_free_chain_has_as_many_zeros_as_it_can_move(damping):
    """Three of the whole, one of the joint; mass-proportional damping slows each of them by a0."""
    found = ub.modes(free_chain(damping), 10)
    assert np.sum(found.omega == 0) == 4
    assert np.isnan(found.damping[:4]).all()
    slow = [s for s in found.exponents if s.imag == 0 and s != 0]
    np.testing.assert_allclose(slow, -0.1, rtol=1e-7)
    assert len(slow) == (4 if damping and isinstance(damping[0], ub.Rayleigh) else 0)
    held = ub.modes(free_chain(damping, multipliers=True), 10)  # constraints bring no modes
    assert np.sum(held.omega == 0) == 4
    np.testing.assert_allclose(held.omega, found.omega, rtol=1e-9)


def test_fast_decays_are_modes():
    """High vibrations with `KelvinVoigt` have a slow and a fast decay, as the linear model."""
    scene = cantilever(4, force=(0, 1.0), damping=[ub.KelvinVoigt(0.03)])
    found, outputs = ub.modes(scene, 100).exponents, [("displacement", scene["beam"].end, "v")]
    model = ub.linearize(scene, inputs=scene.loads, outputs=outputs)
    expected = np.linalg.eigvals(model.state_space()[0])
    found = np.append(found, found[np.abs(found.imag) > 1e-9 * np.abs(found)].conj())
    assert len(found) == len(expected) == 24
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-6)


# -- inelastic states ----------------------------------------------------------------------------


def test_what_has_yielded_answers_elastically():
    """A beam that was bent beyond its limit has the frequencies of an elastic one.

    It stays bent under its load, which shifts them by less than a hundredth; with the tangent of
    hardening, a tenth of the elastic one at the clamp, the first would be a third lower.
    """
    yields = replace(SECTION, bending=ub.ElastoPlastic(yield_limit=1.0, isotropic=2.0))
    scene = cantilever(section=yields, force=(0, 0.55), time=ub.ramp(1.0))
    bent = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    assert bent.energy.lost["plastic"][-1] > 0
    elastic = ub.modes(cantilever(), 3).omega
    np.testing.assert_allclose(ub.modes(scene, 3, at=bent).omega, elastic, rtol=1e-2)


def test_a_hinge_that_bears_nothing_is_a_joint():
    """In the cell of the hinge the rest is elastic: a joint between two cells is h/2 away."""
    free = ub.Beam((0, 0), (2, 0), SECTION, cells=40, hinges={0.5: ub.Softening(0.0, 1.0)})
    one, two = (ub.Beam((x, 0), (x + 1, 0), SECTION, cells=20) for x in (0, 1))
    supports = [ub.Clamped(one.start), ub.Pinned(two.end)]
    jointed = ub.Scene([one, two], joints=[ub.Revolute(one.end, two.start)], supports=supports)
    hinged = clamped(free, ub.Pinned(free.end))
    with_hinge, with_joint = (ub.modes(s, 2).omega for s in (hinged, jointed))
    np.testing.assert_allclose(with_hinge, with_joint, rtol=2 / 40)


# -- states that are no equilibrium --------------------------------------------------------------

UNBALANCED = {
    "VirtualWork 'wind'": lambda b: {"works": [ub.VirtualWork("wind", lambda w: w[1])]},
    "Potential 'well'": lambda b: {"works": [ub.Potential("well", lambda q: q[0])]},
    "Stretch": lambda b: {
        "connectors": [ub.Stretch(ub.ground(3, 1), b.end, ub.PrescribedForce(lambda t: 5.0))]
    },
    "PrescribedDisplacement at ": lambda b: {
        "supports": [ub.Clamped(b.start), ub.PrescribedDisplacement(b.end, u=0.001)]
    },
}


@pytest.mark.parametrize("name", UNBALANCED)
def test_what_acts_in_the_undeformed_scene_is_named(name):
    """A load of the undeformed scene, and a work without a force there, are not."""
    scene = cantilever(2)
    beam = scene["beam"]
    with pytest.warns(ub.ModelWarning, match=f"{name}.*no equilibrium.*give at=simulate"):
        ub.modes(replace(scene, **UNBALANCED[name](beam)), 1)
    bed = ub.Potential("bed", lambda q, axis: 5 * q[1] ** 2)
    pull = ub.PointLoad(beam.end, force=(1, 0))
    ub.modes(replace(scene, loads=[pull], works=[bed]), 1)  # no warning is issued


def test_modes_of_what_its_weight_holds():
    """[closed] ω² = g/l of a point; a body that falls has none, with or without its weight."""
    body = ub.Body((0, -1), mass=1.0, inertia=1e-12)
    falling = ub.Scene([], bodies=[body], loads=[ub.Gravity()])
    pendulum = replace(falling, joints=[ub.Revolute(ub.ground(0, 0), body.at(0, 0))])
    assert ub.modes(pendulum, 1).omega[0] == pytest.approx(9.81**0.5, rel=1e-9)
    assert np.abs(ub.modes(falling, 3).omega).max() == 0.0


@pytest.mark.parametrize(
    ("call", "rate"), [(ub.modes, 0.1), (ub.modes, -20.0), (ub.buckling, -20.0)]
)
def test_a_state_that_turns_is_refused(call, rate):
    """Without centrifugal and Coriolis forces its rotation has about its rate as a frequency."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=6)
    spins = ub.Scene([beam], initial=[ub.Velocity([beam], angular=rate, about=(1.0, 0.0))])
    run = ub.simulate(spins, ub.EnergyMomentum(), t=(0, 0.02), dt=0.01)
    held = clamped(beam, loads=[ub.PointLoad(beam.end, (-1.0, 0))])
    with raises(f"{call.__name__}: at turns: ", " rad/s", " RotatingFrame"):
        call(spins if call is ub.modes else held, 4, at=run)


def test_a_vibrating_state_is_no_spin():
    """The tip of a cantilever moves by 1 % of its length; its frequencies do not depend on this."""
    scene = cantilever(force=(0, 0.4), time=lambda t: float(t < 0.05))
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.3), dt=0.01)
    assert np.abs(run.v[-1]).max() > 1e-3
    bent = ub.modes(scene, 1, at=run).omega
    assert bent == pytest.approx(ub.modes(scene, 1).omega, rel=1e-3)


def test_a_body_seen_from_a_rotating_frame_flies_straight():
    """[closed] A spiral, and no energy comes or goes; the midpoint rule is of second order.

    Position and velocity lag (ω dt)²/12 of the angle ω t, 3.2 m away.
    """
    rate, body, errors = 2.0, ub.Body((1, 0), mass=2.0, inertia=1.0), []
    thrown = ub.Velocity([body], linear=(0.0, 1.0))
    scene = ub.Scene(bodies=[body], loads=[ub.RotatingFrame(rate)], initial=[thrown])
    c, s = np.cos(rate), np.sin(rate)
    seen = np.array([[c, s], [-s, c]]) @ (1.0, 3.0)  # at 1 s, with the velocity of the frame, 2 m/s
    for dt in (0.02, 0.01):
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=dt)
        errors.append(np.abs(run.position(body.middle)[-1] - seen).max())
        assert errors[-1] < 3.2 * 2 * 2.0 * (rate * dt) ** 2 / 12
        assert run.energy.worst < 1e-12
    assert 1.9 < math.log2(errors[0] / errors[1]) < 2.1


# -- shapes and files ----------------------------------------------------------------------------


def test_the_largest_displacement_of_a_mode_is_one(shared_path, on_first_rank):
    """In shapes, motions and both kinds of files, which have all modes."""
    scene = cantilever()
    found, end = ub.modes(scene, 3), scene["beam"].end
    np.testing.assert_allclose(found.shape(0, end)[:2], [0, 1], atol=1e-9)
    height = found.motion(0, amplitude=0.1, count=4).displacement(end)[:, 1]
    np.testing.assert_allclose(height, [0.2, 0, -0.2, 0, 0.2], atol=1e-9)
    assert "mode 0: " in str(found)
    assert "Hz" in found.titles[0]
    found.write(shared_path / "modes.xdmf")
    found.write(shared_path / "modes.hdf")
    one = on_first_rank(lambda: read_xdmf(shared_path / "modes.xdmf"))
    other = on_first_rank(lambda: read_vtkhdf(shared_path / "modes.hdf"))
    assert one.times == other.times == [0, 1, 2]
    assert all((one.of(name) == other.of(name)).all() for name in one.names)
    # A bending moment EI v'': of the clamped end of a cantilever 3.52 times v/L², less h/2.
    np.testing.assert_allclose(np.abs(one.of("M")[0]).max(), 20 * 3.52 * 0.2 / 4, rtol=0.15)


@pytest.mark.parametrize(("kind", "degree"), [("vibration", 3), ("buckling", 1)])
def test_a_mode_that_passes_through_its_state_shows_the_diagrams_of_the_state(kind, degree):
    """[closed] A quarter of a period after the largest displacement only the state is left."""
    scene = cantilever(cells=3)
    beam, mesh = scene["beam"], ub.Mesh(degree=degree)
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


# -- the change of stiffness -----------------------------------------------------------------------


def mixed():
    """Beams elastic and not, a support at an angle, and connectors that store."""
    elastic = ub.Section(EA=1e3, GA=4e2, EI=10.0)
    yielding = replace(elastic, bending=ub.ElastoPlastic(30.0, 0.2))
    a = ub.Beam((0, 0), (0.3, 1), elastic, cells=2, name="a")
    b = ub.Beam((0.3, 1), (1.5, 1.2), yielding, cells=3, name="b")
    c = ub.Beam((1.5, 1.2), (2, 0), elastic, cells=2, name="c")
    bead = ub.Body((1, 2.7), mass=1.0, inertia=1.0, name="bead")
    return ub.Scene(
        [a, b, c],
        bodies=[bead],
        supports=[ub.Clamped(a.start), ub.Roller(c.end, along=(0.3, 1.0))],
        joints=[
            ub.Rigid(a.end, b.start, multipliers=True),
            ub.Revolute(b.end, c.start),
            ub.Guided(bead.middle, lambda s: (1 + s, 2.7 + 0.3 * s * s)),
        ],
        connectors=[
            ub.Turn(b.end, c.start, ub.Spring(7.0)),
            ub.Stretch(b.end, bead.middle, ub.ForceLaw(lambda x, v: 5 * x + 30 * x**2)),
            ub.Turn(ub.ground(1, 2.7), bead.middle, ub.ForceLaw(lambda x, v: 5 * x + 3 * x**3)),
            ub.Stretch(a.at(0.5), bead.middle, ub.Spring(11.0)),
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
    small = SmallMotions(scene, ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5), 2.0)
    simulation, random = small._simulation, np.random.default_rng(0)
    along, _ = small.linear_change("modes")
    for u in (along, random.normal(size=len(along))):
        derived = small._matrix(simulation.equation.tangent_change(small.q, u)).toarray()
        h = 1e-2 / np.abs(u).max()
        difference = sum(
            weight * small._linearized(small.q + k * h * u)[1].toarray()
            for k, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1))
        ) / (12 * h)
        assert np.abs(derived - difference).max() <= 1e-8 * np.abs(derived).max()
        right, left = small._with_laws()
        x = random.normal(size=(right.shape[1], 3))
        X, Y = right @ x, left.T @ x
        stiffness, change = simulation.equation.tangent_works(small.q, u, X, Y)
        np.testing.assert_allclose(stiffness, x.T @ small.K @ x, rtol=0, atol=1e-9)
        digits = 1e-11 * np.abs(change).max()
        np.testing.assert_allclose(change, Y.T @ derived @ X, rtol=0, atol=digits)


# -- wrong calls ---------------------------------------------------------------------------------

PLAIN, TURNING = cantilever(), cantilever(loads=[ub.RotatingFrame(12.0)])
BEAM, MASSLESS = PLAIN["beam"], cantilever(2, ub.Section(EA=1e4, GA=4e3, EI=20.0))
FREE = ub.Scene([BEAM], loads=[ub.Gravity()])
BLOWN = replace(PLAIN, loads=[ub.Pressure(BEAM, normal=1.0)])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda run: ub.modes(cantilever(4), 2, at=run), "modes: at is a solution of other beams"),
        (lambda run: ub.modes(TURNING, 1), "RotatingFrame; give "),
        (lambda run: ub.modes(MASSLESS, 1), "nothing that can move has mass"),
        (lambda run: ub.modes(PLAIN, 3).shape(3, BEAM.end), "there is no shape 3; there are 3"),
        (lambda run: ub.buckling(PLAIN, 1), "nothing acts on the scene at t = 1 s"),
        (lambda run: ub.buckling(FREE, 1), "free to move in 3 independent ways"),
        (lambda run: ub.buckling(TURNING, 1), "the RotatingFrame has a stiffness of its own"),
        (lambda run: ub.buckling(BLOWN, 1), "the Pressure has a stiffness of its own"),
    ],
)
def test_wrong_calls_are_refused(call, words):
    loaded = replace(PLAIN, loads=[ub.Gravity()])
    run = ub.simulate(loaded, ub.Static(), t=(0, 1), dt=1)
    with raises(words):
        call(run)


# -- buckling ------------------------------------------------------------------------------------


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
    column = ub.Beam((0, 0), (0, 2), ub.Section(EA=1e6, GA=1e6, EI=500.0), cells=8)
    weight = ub.PointLoad(column.end, force=(0.0, -100.0))
    top = ub.Slide(ub.ground(0, 2), column.end, law, axis=(1, 0))
    factor = ub.buckling(clamped(column, loads=[weight], connectors=[top]), 1).factors[0]
    free = np.pi**2 / 4 * 500.0 / 2.0**2 / 100.0
    held = 8.18 * free  # (0.699 l) beside 2 l
    if isinstance(law, ub.PrescribedMotion | ub.Coulomb):
        assert factor == pytest.approx(held, rel=0.06)
    elif isinstance(law, ub.Spring | ub.ForceLaw):
        assert 1.03 * free < factor < 1.1 * free
    else:
        assert factor == pytest.approx(free, rel=0.01)


def portal(loads):
    points = [(0, 0), (0, 4), (6, 4), (6, 0)]
    left, girder, right = (ub.Beam(a, b, SECTION, cells=8) for a, b in pairwise(points))
    supports = [ub.Clamped(left.start), ub.Clamped(right.end)]
    return rigid_chain([left, girder, right], supports=supports, loads=loads(girder))


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
    across, alone = (ub.buckling(cantilever(16, force=(-1.0, y)), 1) for y in (0.003, 0.0))
    assert alone.errors[0] < 1e-3
    change = 1 - across.factors[0] / alone.factors[0]
    assert change < across.errors[0] < 3 * change


def simple_column(section, cells, force, amplitude=lambda t: 1.0):
    """A column of 1 m that is pinned at both ends."""
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    push = ub.PointLoad(beam.end, force=(force, 0), amplitude=amplitude)
    return ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end)], loads=[push])


def test_a_column_that_only_shortens_does_not_buckle():
    """[closed] P (1 - P/EA) = π² EI/L² has no solution P if EA < 4 π² EI/L²; GA is 1e4 EA.

    The only factor is P = EA, at which nothing is left of the column.
    """
    scene = simple_column(ub.Section(EA=30.0, GA=3e5, EI=1.0), 16, -1.0)
    with pytest.warns(ub.ModelWarning, match="are complex and left out.*shorten.*GA > 10 EA"):
        found = ub.buckling(scene, 1)
    assert found.factors == pytest.approx([30.0], rel=1e-3)  # EA/GA and the mesh


def test_buckling_about_a_state_needs_loads_that_grow():
    scene = simple_column(ub.Section(EA=4e9, GA=1.5e9, EI=5e6), 8, -1e7, lambda t: t)
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    with raises("so that nothing grows"):
        ub.buckling(scene, 1, at=at)
    whole, rest = ub.buckling(scene, 1).factors[0], ub.buckling(scene, 1, t=2.0, at=at).factors[0]
    assert 1.0 + rest == pytest.approx(whole, rel=1e-2)


def test_masses_of_moving_loads_are_left_out():
    """They would be damping, because their tangent grows with the square of the frequency."""
    found, bare = [], cantilever()
    for mass in (0.0, 2000.0):
        axle = ub.MovingLoad(bare["beam"], lambda t: 1.3, force=(0, -2e-3), mass=mass)
        scene = replace(bare, loads=[axle])
        at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
        found.append(ub.modes(scene, 3, at=at).exponents)
    assert np.allclose(*found, rtol=1e-12)


# -- stops that just touch -----------------------------------------------------------------------


def propped(law, *loads):
    """A beam on two bearings and connectors under a quarter and the middle of it."""
    section = ub.Section(EA=2e9, GA=8e8, EI=5e6, rhoA=50.0)
    beam = ub.Beam((0, 0), (6, 0), section, cells=8)
    props = [ub.Slide(ub.ground(6 * s, 0), beam.at(s), law, axis=(0, 1)) for s in (0.25, 0.5)]
    bearings = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    return ub.Scene([beam], supports=bearings, connectors=props, loads=loads)


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
    scene, turn = replace(scene, loads=[push]), ("displacement", push.place, "psi")
    for name, call in (
        ("modes", lambda: ub.modes(scene, 1)), ("buckling", lambda: ub.buckling(scene, 1)),
        ("linearize", lambda: ub.linearize(scene, inputs=[push], outputs=[turn])),
    ):  # fmt: skip
        with pytest.warns(ub.ModelWarning, match=f"{name}: Slide.*, Slide.*at a limit.*Give at="):
            call()


def test_a_stop_that_is_pressed_or_open_is_not_named():
    """Nor are laws with a slope that varies smoothly; pressed stops are as stiff as springs."""
    smooth = [ub.ForceLaw(lambda e, de: 1e6 * e**3), ub.ForceLaw(lambda e, de: 1e6 * e * abs(e))]
    for law in (ub.Stop(4e6, low=-1e-3), *smooth):
        ub.modes(propped(law), 1)  # no warning is issued
    scene = propped(ub.Stop(4e6, low=0.0), ub.Gravity())
    pressed = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    found = ub.modes(scene, 1, at=pressed).omega
    assert found == pytest.approx(ub.modes(propped(ub.Spring(4e6)), 1).omega, rel=1e-4)
