# SPDX-License-Identifier: MIT
"""Laws of several components of a relative motion, and a pin in a round hole, which is one."""

import itertools
import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from compiled_law import require_tangent
from helpers import AfterEachStep, in_turn, law_of, raises
from scenes import clamped
from user_classes import Cushion, Stiffening

import ufl_beam as ub

SECTION = ub.Section(EA=1e5, GA=1e5, EI=3.0, rhoA=1.0, rhoI=1e-2)


@dataclass(frozen=True)
class Springs(ub.extend.ConnectorLaw):
    """Three springs that know nothing of each other."""

    along: float
    across: float
    turning: float
    components: ClassVar = 3

    def energy(self, motion, state):
        x, y, turn = motion
        return (self.along * x**2 + self.across * y**2 + self.turning * turn**2) / 2


@dataclass(frozen=True)
class Creeping(ub.extend.ConnectorLaw):
    """A mount whose stiffness against turning grows with the pull, and that creeps along."""

    k: float
    turning: float
    eta: float
    components: ClassVar = 3
    variables: ClassVar = {"creep": 0.0}

    def energy(self, motion, state):
        x, y, turn = motion
        elastic = x - state.creep
        return self.k * (elastic**2 + y**2) / 2 + self.turning * (1 + 50 * elastic) * turn**2 / 2

    def increments(self, motion, rate, state, dt):
        return {"creep": self.k * (motion[0] - state.creep) / (self.eta / dt + self.k)}


XY = (1, 0), (0, 1)
HOLE = {"stiffness": 2000.0, "gap": 0.004}
LAWS = {
    "springs": Springs(100.0, 200.0, 3.0),
    "cushion": Cushion(150.0, 0.02, 4.0),
    "creeping": Creeping(200.0, 4.0, 20.0),
    "hole": ub.Clearance(**HOLE),
    "damped hole": ub.Clearance(**HOLE, damping=3.0),
    "rough hole": ub.Clearance(**HOLE, damping=1.0, friction=0.3, radius=0.05),
}
SCHEMES = [
    ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha(0.8), ub.Newmark(),
]  # fmt: skip


def cantilever(*laws, load=lambda t: math.sin(9 * t)):
    """A flexible cantilever whose end is in bushings."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    connectors = [ub.Bushing(ub.ground(1, 0), beam.end, law, axis=(0.6, 0.8)) for law in laws]
    push = ub.PointLoad(beam.end, force=(0.7, 1.0), moment=0.4, amplitude=load)
    return beam.end, connectors, clamped(beam, loads=[push], connectors=connectors)


run = partial(ub.simulate, t=(0, 0.6), dt=0.02)


@pytest.mark.parametrize(("name", "scheme"), in_turn(LAWS, SCHEMES), ids=str)
def test_tangent_is_the_derivative(name, scheme):
    """In small steps, in large ones, over edges and in none."""
    n = LAWS[name].components
    starts = np.array([[3e-3, 1e-3, 0.01], [5e-3, -4e-3, 0.02], [0.0, 0.0, 0.0]])
    ways = np.array([[2e-4, 1e-4, -1e-3], [5e-3, 4e-3, 0.03], [0.0, 0.0, 0.0]])
    steps = [(e0, e0 + way) for e0, way in itertools.product(starts[:, :n], ways[:, :n])]

    def tolerance(force, slopes):
        return 3e-5 * max(np.abs(slopes).max(), np.abs(force).max() / 1e-3, 1.0)

    require_tangent(LAWS[name], scheme, steps, 1e-7, tolerance, state=1e-4)


def test_tables_and_live_values(shared_path, on_first_rank):
    _, (connector,), scene = cantilever(LAWS["rough hole"])
    path, live = shared_path / "run.csv", []
    watching = AfterEachStep(lambda now: live.append(now.connector(connector)))
    record = [ub.History(path, connectors=[connector]), watching]
    history = run(scene, ub.EnergyMomentum(), record=record).connector(connector)
    for name in history._fields:
        of_run = np.array([getattr(one, name) for one in live])
        np.testing.assert_array_equal(of_run, getattr(history, name)[1:])
    header, *rows = on_first_rank(lambda: path.read_text().splitlines())
    assert "force Bushing(ground (1, 0), beam.end (1, 0)), along [N]" in header
    assert "motion Bushing(ground (1, 0), beam.end (1, 0)), turn [rad]" in header
    found = np.array([[float(x) for x in row.split(",")] for row in rows])[:, [1, 4, 7]]
    np.testing.assert_array_equal(found, history.motion)


@dataclass(frozen=True)
class Mount(Stiffening):
    components: ClassVar = 3

    def energy(self, motion, state):
        x, y, turn = motion
        return Stiffening.energy(self, turn, state) + 1e6 * (x**2 + y**2)


@pytest.mark.filterwarnings("ignore:buckling. the factors:ufl_beam.ModelWarning")
def test_buckling_and_modes():
    """The bends of a law of three components, and of one, against those of a force."""
    column = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e7, GA=1e7, EI=1e5, rhoA=1.0), cells=4)
    ends, factors, omegas = (ub.ground(0, 0), column.start), [], []
    slides = [ub.Slide(*ends, ub.Spring(2e6), axis=axis) for axis in XY]
    force = ub.ForceLaw(lambda e, rate: 5.0 * e + 30.0 * e**3)
    for connectors in (
        [ub.Turn(*ends, force), *slides],
        [ub.Turn(*ends, Stiffening(5.0, 30.0)), *slides],
        [ub.Bushing(*ends, Mount(5.0, 30.0))],
    ):
        push = ub.PointLoad(column.end, force=(0.3, -1.0), amplitude=lambda t: t)
        scene = ub.Scene([column], loads=[push], connectors=connectors)
        state = run(scene, ub.Static(), t=(0, 1), dt=0.25)
        factors.append(ub.buckling(scene, 1, at=state, t=2.0).factors[0])
        omegas.append(ub.modes(scene, 3, at=state).omega)
    assert factors[1:] == pytest.approx([factors[0]] * 2, rel=1e-6)
    np.testing.assert_allclose(omegas[1:], [omegas[0]] * 2, rtol=1e-6)


BODY = ub.Body((1, 0), mass=2.0, inertia=1.0)
ENDS = ub.ground(1, 0), BODY.middle
SOFT = [ub.Slide(*ENDS, ub.Spring(1e-3), axis=axis) for axis in XY]
"""Springs that hold a pin which touches nothing in statics."""


def thrown(connector, v, spin=0.0):
    start = ub.Velocity((BODY,), linear=v, angular=spin, about=(1, 0))
    return ub.Scene(bodies=[BODY], connectors=[connector], initial=[start])


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()], ids=str)
@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_on_a_line_it_is_a_stop(scheme, damping):
    """A pin that runs to and fro across the hole, in any direction [closed]."""
    way = np.array([0.28, 0.96])
    hole = ub.Bushing(*ENDS, ub.Clearance(2e4, gap=0.01, damping=damping), axis=(0.6, 0.8))
    edges = ub.Stop(2e4, low=-0.01, high=0.01, damping=damping)
    stop = ub.Slide(*ENDS, edges, axis=tuple(way))
    found, expected = (
        run(thrown(x, tuple(0.3 * way)), scheme, t=(0, 0.4), dt=1e-3, newton=ub.Newton(rtol=1e-13))
        for x in (hole, stop)
    )
    on_line = found.displacement(BODY.middle)[:, :2] @ way
    np.testing.assert_allclose(on_line, expected.connector(stop).motion, rtol=0, atol=1e-9)
    force = np.hypot(*found.connector(hole).force.T)
    np.testing.assert_allclose(force, np.abs(expected.connector(stop).force), atol=1e-5)
    for entry in expected.energy:
        np.testing.assert_allclose(found.energy[entry], expected.energy[entry], atol=1e-8)


def test_without_friction_the_spin_stays():
    """Nothing turns the pin, and its path keeps its moment of momentum about the hole [closed]."""
    scene = thrown(ub.Bushing(*ENDS, ub.Clearance(2e4, gap=0.01)), (0.2, 0.1), spin=3.0)
    solution = run(scene, ub.EnergyMomentum(), t=(0, 1.0), dt=1e-3, newton=ub.Newton(rtol=1e-13))
    velocity, moved = solution.velocity(BODY.middle), solution.displacement(BODY.middle)
    np.testing.assert_allclose(velocity[:, 2], 3.0, rtol=1e-12)
    assert np.ptp(solution.energy.total) < 1e-11 * solution.energy.total[0]
    assert np.hypot(*moved[:, :2].T).max() > 0.01


@pytest.mark.parametrize("friction", [0.1, 0.4])
def test_a_turning_pin_climbs_to_the_friction_angle(friction):
    """Driven slowly it slides where tan φ is the friction; the drive bears mg r sin φ [closed].

    The contact is in its edge by mg cos φ/k, by which the moment of the friction is not longer: the
    surface of the pin is where it is pressed.
    """
    weight, radius = 2.0 * 9.81, 0.05
    pin = ub.Bushing(*ENDS, ub.Clearance(1e6, gap=1e-3, friction=friction, radius=radius))
    drive = ub.Turn(*ENDS, ub.PrescribedMotion(lambda t: 2 * t))
    scene = ub.Scene(bodies=[BODY], connectors=[pin, drive, *SOFT], loads=[ub.Gravity((0, -9.81))])
    history = run(scene, ub.Static(), t=(0, 1), dt=0.01).connector(pin)
    (x, y, _), angle = history.motion[-1], math.atan(friction)
    assert math.atan2(abs(x), -y) == pytest.approx(angle, rel=1e-4)
    assert x < 0  # the surface below goes to the right, and the pin rolls to the left
    along, across, moment = history.force[-1]
    assert moment == pytest.approx(weight * math.sin(angle) * radius, rel=1e-6)
    assert (along, across) == pytest.approx((0.0, -weight), abs=1e-5)


def test_a_pin_that_is_held_by_friction_rests():
    """A moment below the limit rolls it by an angle whose sine is M/(mg r), no further [closed].

    Then the surfaces have rolled by the same length, but for the deflection of the contact.
    """
    k, gap, radius, weight = 1e6, 1e-3, 0.05, 2.0 * 9.81
    limit = 0.3 / math.hypot(1, 0.3) * weight * radius
    results, turned = [], []
    for part in (0.5, 0.9, 1.1):
        pin = ub.Bushing(*ENDS, ub.Clearance(k, gap=gap, friction=0.3, radius=radius))
        rest = 1e-6 if part < 1 else 0.1 * limit / 0.5  # N m/rad; it bears 0.1 limit at 0.5 rad
        push = ub.PointLoad(BODY.middle, moment=part * limit, amplitude=lambda t: max(t - 1.0, 0.0))
        scene = ub.Scene(
            bodies=[BODY], connectors=[pin, *SOFT, ub.Turn(*ENDS, ub.Spring(rest))],
            loads=[ub.Gravity((0, -9.81), amplitude=ub.ramp(1.0)), push],
        )  # fmt: skip
        history = run(scene, ub.Static(), t=(0, 2), dt=0.05).connector(pin)
        results.append(abs(history.force[-1, 2]) / limit)
        turned.append(abs(history.motion[-1, 2]))
    assert results == pytest.approx([0.5, 0.9, 1.0], rel=1e-5)
    for part, found in zip((0.5, 0.9), turned, strict=False):
        sine = part * limit / (weight * radius)
        depth, deflection = weight * math.sqrt(1 - sine**2) / k, weight * sine / k
        expected = ((gap + depth) * math.asin(sine) + deflection) / radius
        assert found == pytest.approx(expected, rel=2e-3)
    assert turned[2] == pytest.approx(0.5, rel=1e-3)  # 1e-5 of the limit is 1e-4 of its tenth


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ub.Slide(*ENDS, LAWS["cushion"], axis=(1, 0)), "Cushion acts on 2 components"),
        (lambda: ub.Turn(*ENDS, LAWS["hole"]), "use Bushing(a, b, law)"),
        (lambda: ub.Bushing(*ENDS, ub.Stop(1.0, high=0.1)), "acts on one component"),
        (lambda: ub.Bushing(*ENDS, LAWS["hole"], axis=(0, 0)), "axis has zero length"),
        (
            lambda: ub.Bushing(*ENDS, law_of(components=4, energy=lambda s, e, z: 0.0)),
            "components = 4 must be 1, 2 or 3",
        ),
        (
            lambda: ub.Bushing(*ENDS, law_of(components=2, resistance=lambda s, e, r, z, dt: r[0])),
            "it must return a tuple of 2 forces",
        ),
        (lambda: ub.Stretch(*ENDS, ub.Stop(1.0, high=0.1)), "Clearance(...)) for a pin"),
        (lambda: ub.Clearance(1e6, gap=1e-3, friction=0.1), "give friction and the radius"),
        (lambda: ub.Clearance(1e6, gap=1e-3, radius=0.1), "give friction and the radius"),
    ],
)
def test_wrong_bushings_are_refused(make, message):
    with raises(message):
        make()


def test_a_path_has_no_time_for_friction():
    rough = cantilever(LAWS["rough hole"], load=lambda t: t)[2]
    with raises("simulate"):
        ub.follow(rough, ub.LoadControl(0.2), steps=5)
    at, _, scene = cantilever(LAWS["hole"], load=lambda t: t)
    path = ub.follow(scene, ub.LoadControl(0.1), steps=10)
    end = path.factor[-1]
    found = run(scene, ub.Static(), t=(0, end), dt=end / 10).displacement(at)[-1]
    assert end > 0.8
    np.testing.assert_allclose(path.displacement(at)[-1], found, rtol=1e-7, atol=1e-12)
    ub.plot(scene).draw_without_rendering()
    ub.plot(path).draw_without_rendering()
