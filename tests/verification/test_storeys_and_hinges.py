# SPDX-License-Identifier: MIT
"""Storeys, hinges and accelerations of frames against statics, kinematics and closed forms.

[closed] sway of a portal with a rigid girder, oscillator, rotations and energies of a mechanism;
[calc] storey shears by equilibrium, with the inertia of d'Alembert in dynamics.
"""

import math

import numpy as np
import pytest
from helpers import raises
from scenes import clamped, on_rail

import ufl_beam as ub
import ufl_beam.structures as st

DIGITS = 1e-9
"""Of a number that Newton's method, with its tolerance of 1e-9, finds in another way."""

LIGHT = {"rhoA": 0.0, "rhoI": 0.0}
COLUMN = ub.Section(EA=2e9, GA=8e8, EI=2e7, **LIGHT)
GIRDER = ub.Section(EA=4e9, GA=8e8, EI=6e7, **LIGHT)


def two_storeys(braced, loads, masses=False):
    """A frame of 6 m with storeys of 4 m and 3 m; columns on the right are described downwards."""
    l1, l2 = (ub.Beam((0, a), (0, b), COLUMN, cells=2, name="left") for a, b in ((0, 4), (4, 7)))
    r1, r2 = (ub.Beam((6, b), (6, a), COLUMN, cells=2, name="right") for a, b in ((0, 4), (4, 7)))
    g1, g2 = (ub.Beam((0, y), (6, y), GIRDER, cells=2, name="girder") for y in (4, 7))
    joints = [
        ub.Rigid(l1.end, g1.start, l2.start), ub.Rigid(r1.start, g1.end, r2.end),
        ub.Rigid(l2.end, g2.start), ub.Rigid(r2.start, g2.end),
    ]  # fmt: skip
    feet = [ub.Clamped(l1.start), ub.Clamped(r1.end)]
    floors = [l1.end, r1.start, l2.end, r2.start]
    scene = ub.Scene(
        [l1, r1, l2, r2, g1, g2], joints=joints, supports=feet,
        connectors=braces(l1, r1, l2, r2) if braced else (),
        loads=[load(l1, l2, g1) for load in loads],
        masses=[ub.PointMass(place, 1e4) for place in floors] if masses else (),
    )  # fmt: skip
    return scene, [l1.start, l1.end, l2.end], floors


def braces(l1, r1, l2, r2):
    """A spring in the lower storey, and a damper in the upper one, from above to below."""
    return [
        ub.Stretch(l1.start, r1.start, ub.Spring(3e7)),
        ub.Stretch(r2.start, l2.start, ub.Damper(3e5)),
    ]


def base_shear(run):
    return -sum(run.reaction(support)[:, 0] for support in run.scene.supports)


def assert_near(found, expected, digits=DIGITS):
    np.testing.assert_allclose(found, expected, rtol=0, atol=digits * np.abs(expected).max())


@pytest.mark.parametrize(
    ("braced", "scheme"), [(False, ub.Static()), (True, ub.EnergyMomentumStatic())]
)
def test_storey_shears_are_the_sums_of_the_forces_above(braced, scheme):
    """[calc] Also when sway is large, and with loads on a girder."""
    loads = (
        lambda l1, l2, g1: ub.PointLoad(l1.end, force=(3e6, 0), amplitude=ub.ramp(1.0)),
        lambda l1, l2, g1: ub.PointLoad(l2.end, force=(2e6, -1e6), amplitude=ub.ramp(1.0)),
        lambda l1, l2, g1: ub.LineLoad(g1, force=(2e5, -2e5), amplitude=ub.ramp(1.0)),
    )
    scene, levels, _ = two_storeys(braced, loads)
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
    storeys = st.storeys(run, levels)
    assert np.abs(storeys.ratio[-1]).max() > 0.05 or braced
    assert_near(storeys.shear[-1], [3e6 + 2e6 + 6 * 2e5, 2e6])
    assert_near(storeys.shear[1:, 0], base_shear(run)[1:], 1e-12)  # the same forces of cells


def test_storey_shears_are_loads_less_inertia():
    """[calc] By d'Alembert with the mean accelerations of the steps; loads act in their middles."""
    load, mass = 8e5, 1e4

    def push(l1, l2, g1):
        return ub.PointLoad(l2.end, force=(load, 0), amplitude=lambda t: math.sin(20 * t))

    scene, levels, floors = two_storeys(True, [push], masses=True)
    newton = ub.Newton(rtol=1e-11)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.01, newton=newton)
    storeys = st.storeys(run, levels)
    first_left, first_right, second_left, second_right = (
        mass * run.acceleration(place)[1:, 0] for place in floors
    )
    above = load * np.sin(20 * (run.times[1:] + run.times[:-1]) / 2) - second_left - second_right
    assert_near(storeys.shear[1:, 1], above)
    assert_near(storeys.shear[1:, 0], above - first_left - first_right)
    assert_near(storeys.shear[1:, 0], base_shear(run)[1:], 1e-12)


def portal(column, girder, force, cells=2, **hinges):
    """A portal of 4 m by 6 m whose left corner is pushed by a force that is multiplied by time."""
    left, right = (
        ub.Beam((x, 0), (x, 4.0), column, cells=cells, name=name, **hinges)
        for x, name in ((0, "left"), (6, "right"))
    )
    top = ub.Beam((0, 4.0), (6, 4.0), girder, cells=cells, name="girder")
    return ub.Scene(
        [left, right, top],
        joints=[ub.Rigid(left.end, top.start), ub.Rigid(right.end, top.end)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.start)],
        loads=[ub.PointLoad(left.end, force=(force, 0), amplitude=lambda t: t)],
    )


def test_drift_of_a_portal_with_a_rigid_girder():
    """[closed] F h³/(24 EI) + F h/(2 GA); errors by strains of stiff parts and the drift 1e-5."""
    h, EI, GA = 4.0, 2e7, 8e8
    stiff = ub.Section(EA=1e15, GA=1e15, EI=1e6 * EI, **LIGHT)
    F = 24 * EI / h**3 * 1e-5 * h
    scene = portal(ub.Section(EA=1e14, GA=GA, EI=EI, **LIGHT), stiff, F)
    left, right = scene["left"], scene["right"]
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, mesh=ub.Mesh(degree=3))
    storeys = st.storeys(run, [left.start, left.end])
    assert_near(storeys.drift[-1], [F * h**3 / (24 * EI) + F * h / (2 * GA)], 1e-4)
    assert_near(storeys.ratio, storeys.drift / h, 1e-15)
    halves = [run.section_forces_at(column.start)[-1, 1] for column in (left, right)]
    assert_near(halves, [-F / 2, -F / 2], 1e-4)  # V is along the normal to the left, -x


@pytest.mark.parametrize(
    ("joint", "scheme"),
    [
        ("rigid link", ub.Static()),
        ("springs", ub.EnergyMomentumStatic()),
        ("springs", ub.GeneralizedAlpha()),
        ("prismatic", ub.EnergyMomentum()),
    ],
)
def test_cuts_through_joints_and_connectors(joint, scheme):
    """[calc] All cuts below massless columns bear the base shear, however they are connected."""
    soft = ub.Section(EA=2e7, GA=8e6, EI=2e6, **LIGHT)
    low = ub.Beam((0, 0), (0.3, 2), soft, cells=2, name="low")
    high = ub.Beam((0.3, 2.6), (0, 5), soft, cells=2, name="high")
    ends, link = (low.end, high.start), ub.Stretch(high.start, low.end, ub.Spring(1e6))
    parts = {
        "rigid link": {"joints": [ub.RigidLink(*ends)]},
        "springs": {
            "connectors": [
                ub.Slide(*ends, ub.Spring(1e6), axis=(1, 0.2)),
                ub.Slide(*ends[::-1], ub.Spring(2e6), axis=(0, 1)),
                ub.Turn(*ends, ub.Spring(1e6)),
            ]
        },
        "prismatic": {
            "joints": [ub.Prismatic(*ends[::-1], axis=(0.2, 1), turning=True)],
            "connectors": [
                link, ub.Turn(*ends, ub.Spring(1e6)),
                ub.Stretch(low.at(0.5), high.at(0.5), ub.Spring(1e6)),
            ],
        },
    }[joint]  # fmt: skip
    masses = [ub.PointMass(high.end, 100.0, 5.0), ub.PointMass(high.start, 1e-3, 1e-3)]
    push = ub.PointLoad(high.end, force=(3e4, -1e4), amplitude=lambda t: t)
    foot = ub.Clamped(low.start)
    scene = ub.Scene(
        [low, high], supports=[foot], loads=[push], masses=masses if scheme.dynamic else (), **parts
    )
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.05)
    storeys = st.storeys(run, [low.start, low.end, high.start])
    assert np.abs(storeys.drift[-1, 1]) > 0.05
    assert_near(storeys.shear[1:], np.column_stack([base_shear(run)[1:]] * 2))


# -- hinges ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mechanism():
    """A portal of stiff members that sways by 1 m on four plastic hinges."""
    h, M = 4.0, 1e5
    stiff, law = ub.Section(EA=1e12, GA=1e12, EI=1e12, **LIGHT), ub.ElastoPlastic(M)
    scene = portal(stiff, stiff, 1e3, cells=1, hinges={0.0: law, 1.0: law})
    control = ub.DisplacementControl(scene["left"].end, "u", 0.2)
    return ub.follow(scene, control, steps=5), h, M


def test_rotations_of_a_mechanism(mechanism):
    """[closed] Hinges rotate by asin(Δ/h), but for M h / EI = 4e-7, and dissipate M asin(Δ/h)."""
    path, h, M = mechanism
    left = path.scene["left"]
    drift = st.storeys(path, [left.start, left.end]).drift[-1, 0]
    rotation = math.asin(drift / h)
    table = st.hinge_table(path, {"IO": 0.1, "LS": 0.2, "CP": 0.5})
    assert drift > 0.9
    assert len(table.rows) == 4
    for row in table.rows:
        assert abs(row.rotation) == pytest.approx(rotation, abs=1e-6)
        assert row.plastic == row.rotation
        assert row.dissipated == pytest.approx(M * rotation, rel=1e-6)
        assert row.state == "CP"
        assert math.isnan(row.ductility)
    total = sum(row.dissipated for row in table.rows)
    assert total == pytest.approx(path.energy["hinges"][-1], rel=1e-12)
    n = len(path) // 2
    rotation = math.asin(st.storeys(path, [left.start, left.end]).drift[n, 0] / h)
    for row in st.hinge_table(path, n=n).rows:
        assert abs(row.rotation) == pytest.approx(rotation, abs=1e-6)
        assert row.dissipated == pytest.approx(M * rotation, rel=1e-5)
    assert all(row.n < 0 for row in st.hinge_table(path, n=0).rows)


def test_a_storey_of_a_path_bears_its_load(mechanism):
    """To round-off of stresses with GA = 1e12 N, 1e-4 N."""
    path, *_ = mechanism
    left = path.scene["left"]
    storeys = st.storeys(path, [left.start, left.end])
    assert_near(storeys.shear[:, 0], 1e3 * path.factor, 1e-9)
    assert "drift at load factor [-]" in storeys.columns()


def turned_spring(law):
    """Run in which a spring turns by an angle, the spring, and the angle."""
    φ, stiff = 0.05, ub.Section(EA=1e13, GA=1e13, EI=1e13, **LIGHT)
    beam = ub.Beam((0, 0), (2, 0), stiff, cells=1, name="arm")
    spring = ub.Turn(ub.ground(0, 0), beam.start, law)
    turned = ub.PrescribedDisplacement(beam.start, u=0.0, v=0.0, psi=lambda t: φ * math.sin(t))
    scene = ub.Scene([beam], supports=[turned], connectors=[spring])
    return ub.simulate(scene, ub.Static(), t=(0, math.pi / 2), dt=math.pi / 80), spring, φ


def test_ductility_of_a_spring_that_softens_before_it_yields():
    """The elastic limit is the lower one of both."""
    law = ub.Spring(3e6, law=ub.ElastoPlastic(9e4), softening=ub.Softening(3e4, 1e6))
    run, _, φ = turned_spring(law)
    (row,) = st.hinge_table(run, {"IO": 0.02}).rows
    assert row.ductility == pytest.approx(φ * 3e6 / 3e4, rel=1e-12)


@pytest.mark.parametrize("limit", [3e4, ub.distributions.Normal(3e4, 3e3, seed=1)])
def test_ductility_and_plastic_rotation_of_a_spring(limit):
    """[closed] Bilinear: M = My + k H/(k + H) (φ - My/k), dissipating My times the plastic part."""
    k, H = 3e6, 1e6
    run, spring, φ = turned_spring(ub.Spring(k, law=ub.ElastoPlastic(limit, isotropic=H)))
    (row,) = st.hinge_table(run, {"IO": 0.02, "CP": 0.025}).rows
    My = run.connector(spring).force[-1] * (k + H) / k - H * φ
    assert (My == pytest.approx(3e4, rel=1e-12)) == (limit == 3e4)
    plastic = (φ - My / k) * k / (k + H)
    assert row.where == spring
    assert row.time == pytest.approx(math.asin(My / k / φ), abs=math.pi / 80)
    assert row.rotation == pytest.approx(φ, rel=1e-12)
    assert row.plastic == pytest.approx(plastic, rel=1e-9)
    assert row.ductility == pytest.approx(φ * k / My, rel=1e-12)
    assert row.dissipated == pytest.approx(My * plastic, rel=1e-9)
    assert row.state == "beyond CP"


# -- accelerations -----------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark(), ub.GeneralizedAlpha()])
def test_accelerations_of_an_oscillator_are_of_second_order(scheme):
    """[closed] -v0 ω sin ωt in the middles of steps, 30 m/s² and 10 1/s; means of two at ends."""
    scene = on_rail(ub.Spring(200.0), mass=2.0, speed=3.0, joints=[])
    place, errors = scene.bodies[0].middle, []
    for dt in (0.01, 0.005):
        run = ub.simulate(scene, scheme, t=(0, 1), dt=dt)
        t, a = run.times, run.acceleration(place)[:, 0]
        middles, ends = a[1:] + 30 * np.sin(5 * (t[1:] + t[:-1])), (a[1:-1] + a[2:]) / 2
        errors.append([np.abs(middles).max(), np.abs(ends + 30 * np.sin(10 * t[1:-1])).max()])
    assert np.isnan(run.acceleration(place)[0]).all()
    np.testing.assert_allclose(np.divide(*errors), 4.0, rtol=0.1)


def test_a_support_that_starts_at_once_has_no_acceleration():
    """From rest it has the velocity V after an impact; it does not alternate between 0 and 2V."""
    V, dt = 0.5, 0.01
    beam = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=1.0, rhoI=1e-3))
    foot = ub.PrescribedDisplacement(beam.start, u=lambda t: V * t, v=0.0, psi=0.0)
    run = ub.simulate(ub.Scene([beam], supports=[foot]), ub.EnergyMomentum(), t=(0, 0.1), dt=dt)
    a = run.acceleration(beam.start)[1:, 0]
    np.testing.assert_allclose(a, 0.0, atol=1e-9 * V / dt)


def test_statics_have_no_accelerations():
    beam = ub.Beam((0, 0), (0, 1), COLUMN)
    run = ub.simulate(clamped(beam), ub.Static(), t=(0, 1), dt=1)
    with raises("acceleration: the run was static"):
        run.acceleration(beam.end)


def test_a_cut_through_a_column_from_above_is_at_its_height():
    section = ub.Section(EA=4e8, GA=1e8, EI=1.4e6)
    mast = ub.Beam((0, 3), (0, 0), section, cells=1)
    wind = ub.LineLoad(mast, force=(500, 0))
    scene = ub.Scene([mast], supports=[ub.Clamped(mast.end)], loads=[wind])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    levels = [mast.end, mast.at(0.75), mast.start]
    assert st.storeys(run, levels).shear[-1] == pytest.approx([1500, 1125])
