# SPDX-License-Identifier: MIT
"""One scene in space on several processes: the results are those of one process.

Random scenes are in properties/test_random_scenes_in_space.py: all schemes, other laws.
"""

import dataclasses
import math

from mpi4py import MPI

import h5py
import numpy as np
import pytest

import ufl_beam as ub

COMM = MPI.COMM_WORLD
pytestmark = [
    pytest.mark.skipif(COMM.size == 1, reason="one process"),
    pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning"),
]

EXACT = ub.Newton(rtol=1e-12)
SAME = 1e-9
"""Largest difference from one process, as a part of the largest value."""

SECTION = ub.Section(
    EA=2e4, GA=1e4, GA3=8e3, EI=40.0, EI2=25.0, GJ=30.0, rhoA=1.0, rhoI=0.02, rhoI2=0.01
)
YIELDS = dataclasses.replace(SECTION, bending=ub.ElastoPlastic(4.0, isotropic=4.0))
AXIS = (0.2, 1.0, 0.4)
END = (1.0, 0.1, 0.0)


def chain(join, *, section=SECTION, apart=0.0, center=(1.0, 0.1, -0.3), loads=True):
    """Two beams and a body; on two processes the border is at the joint of the beams."""
    start = tuple(np.add(END, (apart, 0.0, 0.0)).tolist())
    first = ub.Beam((0, 0, 0), END, section, cells=3, name="first")
    second = ub.Beam(start, tuple(np.add(start, (0.7, 0.2, 0.5)).tolist()), SECTION, cells=3)
    wheel = ub.Body(center, mass=0.8, inertia=(0.03, 0.05, 0.04), name="wheel")
    joints, connectors = join(first.end, second.start, wheel)
    pushes = [
        ub.PointLoad(second.end, force=(1, -2, 3), moment=(0.5, 1.0, -0.5)),
        ub.FollowerLoad(first.end, force=(0, 1, 1), moment=(0.1, 0, 0.2), amplitude=math.sin),
        ub.Gravity((0, 0, -2)),
    ]
    return ub.Scene(
        [first, second], bodies=[wheel], joints=joints, connectors=connectors,
        supports=[ub.Clamped(first.start)], loads=pushes * loads,
    )  # fmt: skip


def numbers(run):
    """Histories of all results of a run, as arrays by name."""
    scene, found = run.scene, {"t": run.times}
    for beam in scene.beams:
        for s in (0.0, 0.3, 1.0):
            found[f"{beam} {s}"] = run.displacement(beam.at(s))
        found[f"forces {beam}"] = np.array([run.section_forces(beam, n) for n in range(len(run))])
    for body in scene.bodies:
        found[f"{body}"] = run.displacement(body.at(*np.add(body.center, 0.2)))
    for support in scene.supports:
        found[f"{support}"] = run.reaction(support)[1:]
    for connector in scene.connectors:
        found |= {f"{connector} {k}": x for k, x in run.connector(connector)._asdict().items()}
    found["works"] = np.column_stack([run.energy[name] for name in run.energy])
    if len(run.v):
        found["momentum"] = run.momentum()
    return found


def compare(run, alone, same=SAME):
    """Check that two runs have the same numbers, and that all processes have them to the bit."""
    found, other = numbers(run), numbers(alone)
    assert found.keys() == other.keys()
    assert len({*COMM.allgather(b"".join(x.tobytes() for x in found.values()))}) == 1
    whole = max(np.abs(x).max() for name, x in other.items() if name.startswith("forces"))
    for name, x in other.items():
        size = max(np.abs(x).max(), whole * (not name.startswith("works")) * 1e-3, 1e-6)
        assert np.abs(found[name] - x).max() < same * size, name


def check(scene, scheme=None, *, t=(0, 0.4), dt=0.02, same=SAME, **more):
    """Compare a run on all processes with one of this process alone; return both."""
    arguments = {"t": t, "dt": dt, "newton": EXACT, **more}
    scheme = scheme or ub.EnergyMomentum()
    run = ub.simulate(scene, scheme, **arguments)
    alone = ub.simulate(scene, scheme, **arguments, comm=MPI.COMM_SELF)
    compare(run, alone, same)
    return run, alone


def joined(joint, body=ub.Rigid):
    """Both beams with a joint; the body is fixed to the second one, or joined to it."""
    return lambda a, b, wheel: ([joint(a, b), body(b, wheel.at(*b.point))], [])


JOINTS = {
    "Rigid": ub.Rigid, "Spherical": ub.Spherical,
    "Rigid, forces": lambda a, b: ub.Rigid(a, b, multipliers=True),
    "Spherical, forces": lambda a, b: ub.Spherical(a, b, multipliers=True),
    "Revolute": lambda a, b: ub.Revolute(a, b, axis=AXIS),
    "Revolute, forces": lambda a, b: ub.Revolute(a, b, axis=AXIS, multipliers=True),
    "Universal": lambda a, b: ub.Universal(a, b, axes=((1, 0, 0), (0, 1, 0))),
    "Prismatic": lambda a, b: ub.Prismatic(a, b, axis=AXIS),
    "Prismatic, turning": lambda a, b: ub.Prismatic(a, b, axis=AXIS, turning=True),
    "Cylindrical": lambda a, b: ub.Cylindrical(a, b, axis=AXIS),
}  # fmt: skip


@pytest.mark.parametrize("joint", JOINTS)
def test_joints_at_a_border(joint):
    check(chain(joined(JOINTS[joint])))


@pytest.mark.parametrize("joint", [ub.RigidLink, ub.Link], ids=lambda x: x.__name__)
def test_links_across_a_border(joint):
    check(chain(joined(joint), apart=0.3))


@pytest.mark.parametrize("joint", ["Spherical", "Revolute", "Universal", "Prismatic"])
def test_bodies_that_share_a_part_of_their_unknowns(joint):
    """The body has the displacements or the rotations of the end of the second beam."""

    def join(a, b, wheel):
        return [ub.Rigid(a, b), JOINTS[joint](b.beam.end, wheel.middle)], []

    check(chain(join, center=(1.7, 0.3, 0.5)))


LAWS = {
    "hinge": ub.RigidPlastic(ub.LinearSoftening(0.5, fracture_energy=0.2)),
    "force law": ub.ForceLaw(lambda motion, rate: 20 * motion + 3 * rate),
    "controller": ub.Controller(lambda now: -5 * now.displacement(now.scene.beams[1].end)[2]),
}
"""Laws that random scenes do not have."""

CONNECTORS = {
    "Stretch": lambda a, b, law: ub.Stretch(a, b, law),
    "Slide": lambda a, b, law: ub.Slide(a, b, law, axis=AXIS),
    "Turn": lambda a, b, law: ub.Turn(a, b, law, axis=AXIS),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", CONNECTORS)
def test_connectors_across_a_border(kind, law):
    """Between both beams, and between the body and the first beam."""
    joint = JOINTS["Revolute"] if kind == "Turn" else JOINTS["Prismatic, turning"]
    joint = None if kind == "Stretch" else joint

    def join(a, b, wheel):
        both = [CONNECTORS[kind](a, b, LAWS[law])]
        if law != "hinge":
            both.append(CONNECTORS[kind](a.beam.at(1 / 3), wheel.middle, LAWS[law]))
        joints = [ub.Spherical(b, wheel.at(*b.point))]
        return [*joints, *([joint(a, b)] if joint else [])], both

    if law == "hinge" and kind != "Turn":
        pytest.skip("hinges turn")
    check(chain(join, apart=0.3 * (kind == "Stretch")), t=(0, 0.2))


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_beams_that_yield_on_one_process(scheme):
    """With hinges of zero length and in a cell, and viscosity of one beam."""
    scene = chain(joined(ub.Rigid), section=YIELDS)
    first, second = scene.beams
    hinge = ub.LinearSoftening(1.0, fracture_energy=0.5)
    bent = ub.Beam(*second.ends, SECTION, cells=3, hinges={0.0: hinge, 0.5: hinge}, name="bent")
    joint = ub.Rigid(first.end, bent.start)
    load = ub.PointLoad(bent.end, force=(0.5, -1, 1), amplitude=lambda t: t)
    damping = [ub.KelvinVoigt(0.01, beams=[first])]
    check(ub.Scene(
        [first, bent], joints=[joint], supports=scene.supports, loads=[load],
        damping=damping if scheme == ub.EnergyMomentum() else (),
    ), scheme, t=(0, 0.5), dt=0.05)  # fmt: skip


@pytest.mark.parametrize("dt", [0.01, ub.Adaptive(1e-4)], ids=["equal", "adaptive"])
def test_a_spinning_body(dt):
    """A wheel of 300 rad/s on an axle between two processes, and a body that flies alone."""

    def join(a, b, wheel):
        return [ub.Rigid(a, b), ub.Revolute(b, wheel.at(*b.point), axis=(0.0, 0.0, 1.0))], []

    scene = chain(join, loads=False)
    alone = ub.Body((0, 5, 0), mass=2.0, inertia=(1, 2, 3), name="alone")
    wheel = scene.bodies[0]
    spins = [
        ub.Velocity([wheel], angular=(0, 0, 30.0), linear=(0, 0, 0), about=(1.0, 0.1, 0)),
        ub.Velocity([alone], angular=(1, 20.0, 0.3), linear=(0, 1, 0), about=alone.center),
    ]
    scene = dataclasses.replace(scene, bodies=[wheel, alone], initial=spins)
    run, _ = check(scene, dt=dt, same=1e-7)
    assert run.energy.worst < 1e-9


@pytest.mark.parametrize("order", [2, 4])
def test_adaptive_steps(order):
    check(chain(joined(JOINTS["Revolute"])), ub.EnergyMomentum(order=order), dt=ub.Adaptive(1e-4))


def test_adaptive_steps_with_friction():
    def join(a, b, wheel):
        return [JOINTS["Revolute"](a, b), ub.Rigid(b, wheel.at(*b.point))], [
            ub.Turn(a, b, ub.Coulomb(0.2), axis=AXIS)
        ]

    check(chain(join), dt=ub.Adaptive(1e-3), t=(0, 0.2), same=1e-6)


def test_loads_and_frames():
    scene = chain(joined(ub.Rigid))
    first, second = scene.beams
    loads = [
        ub.RotatingFrame((0.3, 0.2, 1.0), about=(0.5, 0, 0)), ub.LineLoad(second, force=(1, 0, 1)),
        ub.Pressure(second, normal=(3, -2), tangential=1.0, amplitude=lambda t: t),
        ub.MovingLoad([first, second], lambda t: 3 * t, force=(0, 0, -2)),
        ub.PointLoad(scene.bodies[0].middle, force=(1, 0, 0), moment=(0, 0.2, 0)),
        ub.FollowerLoad(scene.bodies[0].middle, force=(1, 0, 0), moment=(0, 0.2, 0)),
    ]  # fmt: skip
    run, _ = check(dataclasses.replace(scene, loads=(*scene.loads, *loads)))
    check(dataclasses.replace(scene, loads=loads[1:4]), start=run, t=(0.4, 0.6))


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Static()], ids=str)
def test_driven_axes(scheme):
    """A root that turns by several radians, and a roller in turned axes beyond the border."""
    tied = chain(joined(ub.Rigid))
    first, second = tied.beams
    root = ub.PrescribedDisplacement(
        first.start, axis=AXIS, u=0.0, v=0.0, w=0.0, psi=lambda t: 8 * t
    )
    end = ub.PrescribedDisplacement(second.end, along=(1, 1, 0), u=lambda t: 0.1 * t)
    driven = dataclasses.replace(tied, supports=[root])
    run, alone = check(driven, scheme, t=(0, 0.5), dt=0.02)
    more, _ = check(driven, scheme, t=(0.5, 0.6), dt=0.02, start=run)
    check(driven, scheme, t=(0.5, 0.6), dt=0.02, start=alone)
    check(dataclasses.replace(tied, supports=[*tied.supports, end]), scheme, dt=0.02)
    other = dataclasses.replace(root, axis=(1.0, 0.0, 0.0), psi=None)
    with pytest.raises(ub.ModelError, match="turns about"):  # on all processes
        ub.simulate(
            dataclasses.replace(driven, supports=[other]), scheme, t=(0.6, 0.7), dt=0.1, start=more
        )


def test_a_path_with_a_critical_point():
    """A narrow right-angle frame that leaves its plane."""
    strip = ub.Section(
        EA=1e5, GA=1e5, GA3=1e5, EI=50.0, EI2=0.5, GJ=0.4, rhoA=1.0, rhoI=0.01, rhoI2=0.01
    )
    legs = [
        ub.Beam((0, 0, 0), (1, 0, 0), strip, cells=6),
        ub.Beam((1, 0, 0), (1, -1, 0), strip, cells=6, up=(1, 0, 0)),
    ]
    scene = ub.Scene(
        legs, joints=[ub.Rigid(legs[0].end, legs[1].start)], supports=[ub.Clamped(legs[0].start)],
        loads=[ub.PointLoad(legs[1].end, force=(0, 1.0, 0), amplitude=lambda t: t)],
    )  # fmt: skip
    paths = [
        ub.follow(
            scene, ub.ArcLength(0.2), until=lambda now: now.t > 6, steps=60,
            newton=ub.Newton(rtol=1e-11), comm=comm,
        )
        for comm in (COMM, MPI.COMM_SELF)
    ]  # fmt: skip
    compare(*paths, same=1e-6)
    factors = [[x.factor for x in path.critical] for path in paths]
    assert factors[0]
    assert factors[0] == pytest.approx(factors[1], rel=1e-6)


def test_recorders(shared_path, on_first_rank):
    """Extremes, histories and files are those of one process."""
    scene = chain(joined(ub.Rigid), section=YIELDS)
    tip = scene.beams[1].end

    def recorded(name):
        return [
            ub.Extremes(points=3), ub.History(shared_path / f"{name}.csv", [tip]), ub.Events(),
            ub.VTKHDF(shared_path / f"{name}.vtkhdf"),
        ]  # fmt: skip

    arguments = {"t": (0, 0.4), "dt": 0.02, "newton": EXACT}
    run = ub.simulate(scene, ub.EnergyMomentum(), record=(shared := recorded("all")), **arguments)
    by_one = recorded("one")
    on_first_rank(lambda: ub.simulate(
        scene, ub.EnergyMomentum(), record=by_one, comm=MPI.COMM_SELF, **arguments
    ) and None)  # fmt: skip
    section = [shared[0].section_forces(beam) for beam in scene.beams]
    forces = np.concatenate([x.high for x in section])
    assert np.isfinite(forces).all()
    assert len({*COMM.allgather(forces.tobytes())}) == 1
    if COMM.rank == 0:
        expected = [by_one[0].section_forces(beam) for beam in scene.beams]
        for a, b in zip(section, expected, strict=True):
            for x, y in zip(a, b, strict=True):
                assert np.abs(x - y).max() < SAME * max(np.abs(forces).max(), 1.0)
        a, b = (
            np.loadtxt(shared_path / f"{x}.csv", delimiter=",", skiprows=1) for x in ("all", "one")
        )
        assert np.abs(a - b).max() < SAME
        with h5py.File(shared_path / "all.vtkhdf") as a, h5py.File(shared_path / "one.vtkhdf") as b:
            names = list[str]()
            a.visit(names.append)
            for name in names:
                if isinstance(a[name], h5py.Dataset) and a[name].dtype.kind == "f":
                    size = max(np.abs(b[name][()]).max(initial=0.0), 1.0)
                    assert np.abs(a[name][()] - b[name][()]).max(initial=0.0) < SAME * size, name
    assert len(run) == 21


def test_processes_agree_on_errors():
    """A step that turns too far, and a law that fails on one process."""
    flying = ub.Body((0, 0, 0), mass=1.0, inertia=(1, 2, 3), name="top")
    scene = chain(joined(ub.Rigid), loads=False)
    spin = ub.Velocity([flying], angular=(0, 1e5, 0), linear=(0, 0, 0), about=(0, 0, 0))
    scene = dataclasses.replace(scene, bodies=[*scene.bodies, flying], initial=[spin])

    def words(scene, error, comm=COMM, **more):
        with pytest.raises(error) as raised:
            ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), comm=comm, **more)
        return str(raised.value)

    steps = ub.Adaptive(1e-3, first=0.1, shortest=0.01)
    said = words(scene, ub.ConvergenceError, dt=steps)
    assert "top turns by" in said
    assert {*COMM.allgather(said)} == {words(scene, ub.ConvergenceError, MPI.COMM_SELF, dt=steps)}

    root = ub.PrescribedDisplacement(
        scene.beams[0].start, axis=AXIS, u=0.0, v=0.0, w=0.0, psi=lambda t: 1000 * t
    )
    driven = dataclasses.replace(scene, supports=[root], bodies=scene.bodies[:1], initial=[])
    said = words(driven, ub.ConvergenceError, dt=steps)
    assert "PrescribedDisplacement at first.start (0, 0, 0) turns by 1432°" in said
    assert {*COMM.allgather(said)} == {words(driven, ub.ConvergenceError, MPI.COMM_SELF, dt=steps)}

    def fails(motion, rate):
        if motion > 0.001:
            raise ValueError("beyond the table")
        return motion

    def join(a, b, wheel):
        return [ub.Rigid(a, b), ub.Rigid(b, wheel.at(*b.point))], [
            ub.Stretch(ub.ground(2, 2, 2), b.beam.end, ub.ForceLaw(fails))
        ]

    said = words(chain(join), Exception, dt=0.02)
    assert "beyond the table" in said
    assert len({*COMM.allgather(said)}) == 1
