# SPDX-License-Identifier: MIT
"""Messages of errors: which object is wrong, why, and what to do.

The names of object and argument in messages on single values are tested in test_wrong_arguments.py.
"""

import math
import re
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest

import ufl_beam as ub
import ufl_beam.structures as st

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)
STEEL = {"E": 210e9, "nu": 0.3}
STEEL_LAW = ub.ElastoPlastic(250e6)
BREAKS = ub.Softening(10.0, 5.0)


def beam(start=(0, 0), end=(1, 0), **more):
    return ub.Beam(start, end, SECTION, **{"cells": 2, "name": "girder", **more})


GIRDER, TWIN, THIRD, STRAY = (beam(name=name) for name in ("girder", "twin", "third", "stray"))
RIGHT = beam((1, 0), (2, 0), name="right")
END, BESIDE = GIRDER.end, RIGHT.start
HINGE = ub.Revolute(END, BESIDE)


def scene(**parts):
    """The girder with these parts."""
    return ub.Scene([GIRDER], **parts)


def run(model=None, scheme=None, *, t=(0.0, 1.0), dt=0.5, **more):
    return ub.simulate(model or scene(), scheme or ub.EnergyMomentum(), t=t, dt=dt, **more)


def raises(says):
    """`pytest.raises` for an ArgumentError with a text; in it ``...`` stands for any text."""
    return pytest.raises(ub.ArgumentError, match=".*".join(map(re.escape, says.split("..."))))


def test_errors_are_a_value_error_or_a_type_error_too():
    """A wrong value is a ValueError, a wrong type a TypeError, too; models have their own class."""
    assert issubclass(ub.ArgumentError, ValueError)
    assert issubclass(ub.ConvergenceError, RuntimeError)
    with pytest.raises(TypeError, match="Newton: rtol = 'x' is not a number"):
        ub.Newton(rtol="x")
    with pytest.raises(ub.ModelError, match="Section: EA = 'x' is not a number"):
        ub.Section("x", 1.0, 1.0)
    with pytest.raises(ub.ArgumentError, match="fps = 0 must be positive") as error:
        ub.animate(run(), "a.gif", fps=0)
    assert not isinstance(error.value, ub.ModelError | TypeError)


def push(amplitude):
    return ub.PointLoad(END, force=(1, 0), amplitude=amplitude)


def in_fibres(fibres=None, **more):
    return ub.Section.rectangle(0.1, 0.2, **STEEL, fibres=fibres or ub.Fibres(STEEL_LAW), **more)


def of_fibres(y, A):
    return ub.Section.of_fibres(y, A, **STEEL, fibres=ub.Fibres(STEEL_LAW))


def wave(s):
    return s, math.inf if s == 0.5 else 0.0


PARTS = [
    # numbers
    (lambda: ub.Section(1.0, 1.0, math.nan), "Section: EI = nan is not finite"),
    (lambda: ub.Section(1.0, 1.0, None), "Section: EI = None is not a number"),
    (lambda: beam(cells=2.5), "girder: cells = 2.5 must be a whole number, at least 1"),
    (lambda: GIRDER.at(1.5), "girder.at(1.5): s must lie between 0 and 1"),
    # sections
    (lambda: ub.Section.tube(0.1, 0.06, **STEEL), "tube: wall t = 0.06 m is thicker than the"),
    (lambda: st.i_shape(0.1, 0.1, 0.01, 0.05, **STEEL), "i_shape: ...do not fit"),
    (lambda: ub.Section.circle(0.1, E=1.0, nu=0.6), "nu = 0.6 must lie in (-1, 0.5]"),
    # laws
    (lambda: ub.Spring(1.0, st.Mander(30.0, 2e-3)), "Spring: Mander: E = 1 must be at least 1.02"),
    (lambda: ub.ElastoPlastic(1.0, isotropic=-2.0), "isotropic = -2 must not...use Softening("),
    (lambda: in_fibres(bending=STEEL_LAW), "Section: a law bending beside fibres"),
    (lambda: in_fibres(shear=STEEL_LAW), "Section: a law shear beside fibres...elastic"),
    (lambda: in_fibres(hinge=BREAKS), "Section: a law hinge beside fibres"),
    # one layer, whose middle is the axis
    (lambda: in_fibres(ub.Fibres(STEEL_LAW, number=1)), "number = 1 has no bending stiffness; use"),
    (lambda: of_fibres([0.1, 0.1], [1, 1]), "of_fibres: all fibres at one y...spread them"),
    (lambda: of_fibres([0, 1], [1, 1, 1]), "y and A must be lists of equal length...(2,)"),
    (lambda: of_fibres([0, 1], [1, -1]), "all areas A must be positive"),
    # beams
    (lambda: beam((1, 2), (1, 2)), "girder: zero length, both ends are at (1.0, 2.0)"),
    (lambda: ub.Beam.arc((0, 0), 1.0, (2, 2), SECTION), "beam: zero length, both angles...are 2"),
    (lambda: ub.Beam.polyline([(0, 0)], SECTION), "a polyline needs at least two points, not 1"),
    (lambda: ub.Beam.polyline([(0, 0), (1, 0), (1, 0)], SECTION), "between two points at (1.0"),
    (lambda: ub.Beam.along(wave, SECTION, cells=4), "beam: curve(0.5)[1] = inf is not finite"),
    (lambda: beam(hinges={0.5: BREAKS, 0.5 + 1e-13: BREAKS}), "two hinges at s = 0.5...give one"),
    (
        lambda: ub.Beam((0, 0), (1, 0), in_fibres(), hinges={0.5: BREAKS}),
        "beam: hinges are for resultants; fibres break by Fibres(softening=)",
    ),
    # functions of time
    (lambda: ub.Table([0, 2, 1], [0, 0, 0]), "Table: times must increase...times[1] = 2...by 1"),
    (lambda: ub.Table([0, 1], [0]), "Table: 2 times and 1 values; give the same number of each"),
    (lambda: push(lambda t: 1 / t), "the time function fails at t = 0: ZeroDivisionError"),
    (lambda: push(lambda t: "x"), "PointLoad at girder.end...returned 'x' at t = 0 s; it must"),
    # supports and joints
    (lambda: ub.Clamped(GIRDER), "Clamped...is not a place; use beam.start, .end or .at(s)"),
    (lambda: ub.Roller(END, along=(0, 0)), "Roller at girder.end...no direction"),
    (lambda: ub.PrescribedDisplacement(END), "nothing...at least one of u, v, psi"),
    (lambda: ub.Revolute(END), "Revolute: a joint needs at least two places"),
    (
        lambda: ub.Spherical(END, BESIDE),
        "Spherical: the joint is for scenes in space; use Revolute",
    ),
    (lambda: scene(bodies=[ub.ground(0, 0).body]), "the ground is in every scene; leave it out"),
    (lambda: ub.Body((0, 0), mass=1.0, inertia=(1, 1, 1)), "inertia in the plane is a number"),
    (lambda: HUB.at(0, 0, 0), "hub.at(0.0, 0.0, 0.0): the centre has 2 coordinates"),
    (
        lambda: ub.Scene([ub.Beam((0, 0, 0), (1, 0, 0), in_fibres(), name="mast")]),
        "mast: the fibres of its section have no z for bending",
    ),
]


@pytest.mark.parametrize(
    "make",
    [
        lambda: ub.ElastoPlastic(0.0, viscosity=ub.Perzyna(math.inf)),
        lambda: ub.ElastoPlastic(math.inf, 0.0, 0.0, ub.DuvautLions(math.inf)),
        lambda: ub.Softening(math.inf, 1.0),
        lambda: ub.LinearSoftening(0.0, 1.0),
        lambda: beam(hinges={0.0: BREAKS, 1.0: ub.LinearSoftening(1.0, 1.0)}, cells=2.0),
        lambda: ub.EnergyMomentumStatic(0.5),
        lambda: in_fibres(ub.Fibres(STEEL_LAW, number=2, softening=BREAKS)),
    ],
)
def test_limits_of_ranges_are_allowed(make):
    assert make() is not None


def held_twice(first, second):
    """A scene with two supports at the end of the girder."""
    return scene(supports=[first(END), second(END)])


def upright(place):
    return ub.Roller(place, along=(0, 1))


def inclined(place):
    return ub.Roller(place, along=(1, 1))


def moved(**motion):
    return lambda place: ub.PrescribedDisplacement(place, **motion)


def joined(*supports):
    """Three beams, joined rigidly and by a hinge, with supports."""
    joints = [ub.Rigid(END, TWIN.end), ub.Revolute(TWIN.end, THIRD.end)]
    return ub.Scene([GIRDER, TWIN, THIRD], joints=joints, supports=supports)


def rubbed(pressing):
    """Two beams with friction that is pressed by the force of a joint or a support."""
    rub = ub.Turn(END, BESIDE, ub.Coulomb(coefficient=1.0, joint=pressing))
    kind = "joints" if isinstance(pressing, ub.extend.Joint) else "supports"
    return ub.Scene([GIRDER, RIGHT], connectors=[rub], **{kind: [pressing]})


RUBS = ub.Coulomb(coefficient=1.0, joint=ub.Pinned(GIRDER.start))
PRESSED = ub.Turn(ub.ground(1, 0), END, RUBS)


def thrown(*velocities):
    """Simulation of two beams on one hinge."""
    two = ub.Scene([GIRDER, RIGHT], joints=[HINGE], initial=velocities)
    return ub.Simulation(two, ub.EnergyMomentum())


SHORT, ROOF = beam((0, 0), (0, 3.75), name="short"), beam((0, 4), (6, 4), name="roof")
HALT = ub.Beam.along(lambda s: (max(s, 0.5), 0.0), SECTION, cells=4, name="halt")
OF_ABSENT = {
    "supports": ub.Clamped(STRAY.start),
    "loads": ub.PointLoad(STRAY.end),
    "masses": ub.PointMass(STRAY.end, 1.0),
    "initial": ub.Velocity([STRAY]),
    "joints": ub.Rigid(STRAY.start, STRAY.end),
}
"""Parts of a beam that is not in the scene."""

SCENES = [
    (lambda: ub.Scene([]), "Scene: no beams"),
    (lambda: ub.Scene([GIRDER, TWIN, GIRDER]), "girder is in the scene twice, as beams[0] and b"),
    (lambda: scene(loads=[ub.Clamped(END)]), "loads[0] = ...is not a PointLoad or FollowerLoad or"),
    *(
        (lambda part=part, one=one: scene(**{part: [one]}),
         type(one).__name__ + "...stray is not in the scene; add it to beams")
        for part, one in OF_ABSENT.items()
    ),
    # joints
    (
        lambda: ub.Scene([SHORT, ROOF], joints=[ub.Rigid(ROOF.start, SHORT.end)]),
        "Rigid: joint ends lie 0.25 m apart: roof.start (0, 4) and short.end (0, 3.75)",
    ),
    (
        lambda: ub.Scene([GIRDER, TWIN], joints=[ub.Revolute(GIRDER.start, TWIN.start, TWIN.end)]),
        "Revolute: joint ends lie 1 m apart: girder.start (0, 0) and twin.end (1, 0)",
    ),
    (
        lambda: ub.Scene([GIRDER, TWIN], joints=[ub.Rigid(END, TWIN.end, TWIN.end)]),
        "Rigid(...twin.end (1, 0), twin.end (1, 0)): the same place twice",
    ),
    # supports in conflict; an inclined roller takes both displacements of its place
    (lambda: held_twice(ub.Clamped, ub.Pinned), "in conflict...girder.end (1, 0)...both hold u"),
    (lambda: held_twice(ub.Roller, inclined), "in conflict...both hold v; remove one"),
    (lambda: held_twice(upright, inclined), "in conflict...both hold u; remove one"),
    (lambda: held_twice(ub.Clamped, moved(psi=1.0)), "in conflict...both hold psi; remove one"),
    (lambda: held_twice(inclined, moved(u=0)), "in conflict...both hold u; remove one"),
    (
        lambda: joined(ub.Pinned(END), ub.Roller(THIRD.end)),
        "in conflict: Pinned at girder.end (1, 0) and Roller at third.end (1, 0) both hold v",
    ),
    # friction pressed by a force that is not known
    (lambda: rubbed(HINGE), "Turn(girder.end...Revolute(...shares unknowns...multipliers"),
    (lambda: rubbed(moved(psi=0.0)(GIRDER.start)), "girder.start...holds no displacement"),
    (
        lambda: rubbed(ub.Revolute(ub.ground(1, 0), END, BESIDE, multipliers=True)),
        "has more than two places, so that it has no single force; make a joint of two",
    ),
    (lambda: scene(connectors=[PRESSED]), "Turn(...Pinned at girder.start...is not in the scene"),
    # initial velocities
    (
        lambda: thrown(ub.Velocity([GIRDER], linear=(1, 0)), ub.Velocity([RIGHT], linear=(2, 0))),
        "Velocity: right gets two different velocities at (1, 0)...joined to",
    ),
    (lambda: run(ub.Scene([HALT])), "halt: zero length of a cell at"),
]  # fmt: skip


def test_supports_at_one_place_may_hold_different_displacements():
    a_hinge_apart = ub.PrescribedDisplacement(THIRD.end, psi=1.0)  # another rotation
    assert joined(ub.Roller(END), moved(u=0.0)(END), moved(psi=0.0)(END), a_hinge_apart).supports


def test_velocities_may_differ_where_they_agree_at_the_joint():
    # Both turn about the hinge, at different rates
    rates = (GIRDER, 1.0), (RIGHT, -3.0)
    assert thrown(*(ub.Velocity([x], angular=w, about=(1, 0)) for x, w in rates)).t == 0.0


@pytest.mark.parametrize("free", ["M", "NV", "NM"])
def test_a_release_with_multipliers_has_the_same_equilibrium(free):
    """Forces hold all that it transmits, its rotation too."""
    joint = ub.Release(END, BESIDE, free=free, multipliers=True)
    assert joint.shared == ()
    assert len(joint.holders) == 3 - len(free)
    held = [ub.Clamped(GIRDER.start), ub.Clamped(RIGHT.end)]
    push = ub.PointLoad(GIRDER.at(0.5), force=(1.0, 1.0), moment=1.0)
    motions = []
    for one in (ub.Release(END, BESIDE, free=free), joint):
        two = ub.Scene([GIRDER, RIGHT], joints=[one], supports=held, loads=[push])
        motions.append(run(two, ub.Static()).displacement(BESIDE)[-1])
    # The same equilibrium with other unknowns; Newton's tolerance is 1e-10 of the forces
    np.testing.assert_allclose(motions[1], motions[0], rtol=1e-7, atol=1e-12)


def static(model):
    return ub.Simulation(model, ub.Static())


def in_line(joint, *supports):
    return ub.Scene([GIRDER, RIGHT], joints=[joint(END, BESIDE)], supports=supports)


PINS = ub.Revolute, ub.Pinned(GIRDER.start), ub.Pinned(RIGHT.end)


def portal(corner=ub.Revolute):
    """Two posts and a girder with hinges, but for one corner."""
    left, roof = beam((0, 0), (0, 4), name="left"), beam((0, 4), (6, 4), name="roof")
    right = beam((6, 4), (6, 0), name="right")
    joints = [corner(left.end, roof.start), ub.Revolute(roof.end, right.start)]
    supports = [ub.Pinned(left.start), ub.Pinned(right.end)]
    return ub.Scene([left, roof, right], joints=joints, supports=supports)


def chain(support, count=310):
    """Beams in one line, 930 unknowns: beyond the size of dense decompositions."""
    beams = [beam((i, 0), (i + 1, 0), cells=1, name=f"b{i}") for i in range(count)]
    joints = [ub.Rigid(x.end, y.start) for x, y in pairwise(beams)]
    return ub.Scene(beams, joints=joints, supports=[support(beams[0].start)])


@pytest.mark.parametrize(
    ("make", "says", "centers"),
    [
        (scene, "3 independent ways...girder (beam 0)...Add supports or joints...EnergyM", None),
        (lambda: scene(supports=[ub.Pinned(GIRDER.start)]), "1 way", {"girder": (0, 0)}),
        (portal, "1 way...roof (beam 1) can shift along", {"left": (0, 0), "right": (6, 0)}),
        # the clamped girder is not named
        (lambda: in_line(ub.Revolute, ub.Clamped(GIRDER.start)), "1 way", {"right": (1, 0)}),
        # free at first order only, but statics starts there
        (lambda: in_line(*PINS), "1 way", {"girder": (0, 0), "right": (2, 0)}),
        (lambda: chain(ub.Pinned), "1 way...; and 306 more", {f"b{i}": (0, 0) for i in range(4)}),
    ],
)
def test_a_message_names_the_beams_of_a_mechanism_and_their_centers(make, says, centers):
    with raises(f"free to move in {says}") as failure:
        static(make())
    turning = r"(\w+) \(beam \d+\) can turn about \(([^,]+), ([^)]+)\)"
    found = re.findall(turning, str(failure.value))
    if centers is not None:
        known = {name: pytest.approx(at, abs=1e-9) for name, at in centers.items()}
        assert {name: (float(x), float(y)) for name, x, y in found} == known


def test_a_beam_on_parallel_rollers_can_shift_along_them():
    supports = [ub.Roller(place, along=(3, 4)) for place in (GIRDER.start, END)]
    with raises("free to move in 1 way...girder (beam 0) can shift along") as failure:
        static(scene(supports=supports))
    # The direction, (3, 4) scaled to a largest component of 1
    u, v = str(failure.value).split("along (")[1].split(")")[0].split(", ")
    assert (abs(float(u)), abs(float(v))) == (0.75, 1.0)


def test_a_frame_with_a_rigid_corner_or_a_clamp_is_no_mechanism():
    assert static(portal(corner=ub.Rigid)).t == 0.0
    assert static(chain(ub.Clamped)).t == 0.0
    assert ub.Simulation(scene(), ub.EnergyMomentum()).t == 0.0  # dynamics needs no supports


HUB = ub.Body((3, 0), mass=1.0, inertia=1.0, name="hub")
MASS = ub.PointMass(GIRDER.at(0.3), 1.0)  # makes a vertex there
CLAMPED = scene(supports=[ub.Clamped(GIRDER.start)])
YIELDING = ub.Beam((0, 0), (1, 0), ub.Section(1e4, 1e4, 100.0, bending=ub.ElastoPlastic(1.0)))
YIELDS = ub.Scene([YIELDING], supports=[ub.Clamped(YIELDING.start)])
OF_OTHERS = "start: the solution has other beams or another mesh"
RUNS = [
    (lambda: run(CLAMPED, ub.Static(), dt=ub.Adaptive(1e-3)), "a static scheme has none; give a"),
    (lambda: run(record=ub.History("a\0.csv", [END])), "output a...cannot be written: ...null"),
    (lambda: run(t=(1.0, 1.0)), "the end t[1] = 1 must come after the beginning 1"),
    (lambda: run(record=ub.History("a.csv", [STRAY.end])), "stray.end (1, 0): stray is not in the"),
    # the start
    (lambda: run(ub.Scene([TWIN]), start=run()), OF_OTHERS + "; use the same Beam objects"),
    (lambda: run(start=run(), mesh=ub.Mesh(2)), OF_OTHERS),
    (lambda: run(start=run(scene(masses=[MASS]))), "girder has other vertices...corners=(s, ...)"),
    (lambda: run(scene(bodies=[HUB]), start=run()), "start: hub is not in the scene of the solut"),
    # results
    (lambda: run().displacement(STRAY.end), "stray.end (1, 0): stray is not in the scene"),
    (lambda: run().section_forces(STRAY), "stray is not in the scene"),
    (lambda: run().reaction(ub.Clamped(STRAY.end)), "reaction: Clamped at stray.end...not in"),
    (lambda: run(CLAMPED, ub.Static()).velocity(END), "velocity: the run was static"),
    (lambda: run(CLAMPED, ub.Static()).momentum(), "momentum: the run was static"),
    (lambda: run().material(GIRDER), "material: no beam of the scene yields or breaks"),
    (lambda: run(YIELDS, ub.Static()).material(STRAY), "stray is not in the scene"),
]


MESSAGES = [*PARTS, *SCENES, *RUNS]


@pytest.mark.parametrize(("make", "says"), MESSAGES, ids=[says for _, says in MESSAGES])
def test_a_message_says_why_something_is_refused(make, says):
    with raises(says):
        make()


@pytest.mark.parametrize(("recorder", "name"), [(ub.XDMF, "a.xdmf"), (ub.History, "a.csv")])
def test_an_output_that_cannot_be_written_is_refused_before_the_run(recorder, name, shared_path):
    with raises("output...nowhere...there is no directory...make it first"):
        run(record=recorder(shared_path / "nowhere" / name))
    if MPI.COMM_WORLD.rank == 0:
        (shared_path / name).mkdir()
    MPI.COMM_WORLD.barrier()
    with raises("output...cannot be written...directory"):
        run(record=[recorder(shared_path / name)])


def test_a_refused_output_leaves_no_file(shared_path):
    with raises("every"):
        run(record=ub.History(shared_path / "a.csv"), every=0)
    with raises("nowhere"):
        run(record=[ub.History(shared_path / "a.csv"), ub.XDMF(shared_path / "nowhere" / "b.xdmf")])
    MPI.COMM_WORLD.barrier()
    assert list(shared_path.iterdir()) == []


def test_a_start_with_a_new_joint_of_places_apart_is_refused():
    """The hinge has turned by 2 rad/s · 1 s; a rigid joint would have to turn it back."""
    turns = [ub.Velocity([x], angular=w, about=(1, 0)) for x, w in ((GIRDER, 0.0), (RIGHT, 2.0))]
    rigid = in_line(ub.Rigid)
    hinged = run(ub.Scene([GIRDER, RIGHT], joints=[HINGE], initial=turns), t=(0, 1), dt=1 / 8)
    with raises("start: the new scene joins places whose positions differ by...rad at...psi of"):
        run(rigid, start=hinged)
    still = run(in_line(ub.Revolute))
    assert len(run(rigid, start=still).times) > 1


def test_time_functions_need_no_hash():
    class Pulse:
        """As a plain dataclass, which has equality and no hash."""

        def __call__(self, t):
            return 1.0

        def __eq__(self, other):
            return isinstance(other, Pulse)

    run(scene(loads=[push(Pulse())]))  # no error is raised


@pytest.fixture
def database():
    """PETSc's options of Newton's method, which a test may change."""
    from petsc4py import PETSc

    database = PETSc.Options("ub_")
    before = database.getAll()
    yield database
    for name in database.getAll():
        del database[name]
    for name, value in before.items():
        database[name] = value


@pytest.mark.serial  # PETSc reports an error of all ranks by aborting some of them
def test_wrong_petsc_options_do_no_harm_to_the_next_run(database):
    with raises("PETSc refuses the options -ub_snes_type nonsense: "):
        run(newton=ub.Newton(petsc={"snes_type": "nonsense"}))
    assert database.getAll() == {}
    run()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("snes_monitr", "option ub_snes_monitr; did you mean ub_snes_monitor"),
        ("snes_tr_delta0", "option ub_snes_tr_delta0; "),  # of another method
    ],
)
def test_an_option_without_effect_is_refused(database, name, said):
    with raises(f"Newton: petsc: PETSc does not use the {said}"):
        run(newton=ub.Newton(petsc={"snes_max_it": 20, name: "1"}))
    assert database.getAll() == {}
    database[name] = "1"
    assert database.hasName(name)  # someone has asked for it, which PETSc remembers
    with raises(f"PETSC_OPTIONS: PETSc does not use the {said}"):
        run()
    assert database.getAll() == {name: "1"}  # for whoever else reads it


def test_an_option_that_petsc_asks_for_later_is_refused_unless_in_petsc_options(database):
    with raises("ub_snes_view; such options must be in PETSC_OPTIONS"):
        run(newton=ub.Newton(petsc={"snes_view": None}))
    database["snes_view"] = ":/dev/null"
    run()
    run()  # known as used by now


def test_an_option_of_another_linear_solver_is_refused():
    """PETSc asks for some options only where others choose their solver."""
    with raises("ub_pc_factor_mat_ordering_type"):
        run(newton=ub.Newton(petsc={"pc_factor_mat_ordering_type": "rcm"}))
    run(newton=ub.Newton(petsc={"ksp_type": "richardson", "ksp_richardson_scale": 1.0}))


@pytest.mark.parametrize("t", [0.5, 0.4, math.nan])
def test_steps_end_later_than_the_present_time(t):
    simulation = ub.Simulation(scene(supports=[ub.Clamped(GIRDER.start)]), ub.Static(), t0=0.5)
    with pytest.raises(
        ub.ArgumentError, match=r"step_to\(.*the simulation is at t = 0.5 s already"
    ):
        simulation.step_to(t)
    simulation.close()
