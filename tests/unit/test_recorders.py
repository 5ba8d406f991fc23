# SPDX-License-Identifier: MIT
"""Files of a run: their contents are the solution, on any number of ranks."""

import csv
import xml.etree.ElementTree as ET

from mpi4py import MPI

import numpy as np
import pytest
from scenes import SECTION, clamped, rigid_chain
from time_series import read_as_users_do, read_vtkhdf, read_xdmf, require_equal

import ufl_beam as ub

MOTION = (("u", "m"), ("v", "m"), ("psi", "rad"))
FORCE = (("force", "N"), ("work", "J"))
TURNING = (("motion", "rad"), ("force", "N m"), ("work", "J"))


def scene():
    """Two beams at an angle; no two vertices at one point but those of the rigid corner."""
    post = ub.Beam((0, 0), (0, 2), SECTION, cells=3, name="post")
    arm = ub.Beam((0, 2), (3, 3), SECTION, cells=4, name="arm")
    return rigid_chain(
        [post, arm],
        supports=[ub.Clamped(post.start)],
        loads=[ub.PointLoad(arm.end, force=(5, -30), amplitude=ub.ramp(1.0))],
    )


def run(scene, *record, steps=6, scheme=None, **more):
    return ub.simulate(
        scene, scheme or ub.EnergyMomentum(0.1, 0.1), t=(0, 1), dt=1 / steps, record=record, **more
    )


@pytest.fixture(params=[ub.XDMF, ub.VTKHDF], ids=["XDMF", "VTKHDF"])
def series(request, shared_path, on_first_rank):
    """A recorder of time series, and what a reader finds in its file."""
    recorder = request.param
    reader = {ub.XDMF: read_xdmf, ub.VTKHDF: read_vtkhdf}[recorder]
    path = shared_path / f"run{recorder.endings[0]}"

    def make(**more):
        return recorder(path, **more)

    def read():
        found = reader(path)
        require_equal(found, read_as_users_do(path))
        return found

    return make, lambda: on_first_rank(read)


def test_time_series_hold_the_solution(series):
    make, read = series
    frame = scene()
    solution = run(frame, make())
    found, numbering = read(), solution.numbering
    assert found.times == list(solution.times)
    # Beams in their order, node after node: the same numbers
    assert (found.points == np.pad(numbering.points, [(0, 0), (0, 1)])).all()
    assert (found.cells == numbering.cells).all()
    names = ["displacement", "rotation", "velocity", "angular velocity", "part", "N", "V", "M"]
    assert sorted(found.names) == sorted(names)
    for n in range(7):
        for states, vector, angle in (
            (solution.q, "displacement", "rotation"),
            (solution.v, "velocity", "angular velocity"),
        ):
            at_nodes = states[n][numbering.dofs]
            # Copies, so equal to the last bit
            assert (found.of(vector)[n] == at_nodes * (1, 1, 0)).all()
            assert (found.of(angle)[n] == at_nodes[:, 2]).all()
        forces = np.concatenate([solution.section_forces(b, n) for b in frame.beams])
        for component, name in enumerate("NVM"):
            # The same kernel on other meshes: round-off of EA
            assert np.abs(found.of(name)[n] - forces[:, component]).max() < 1e-16 * 1e4 * 10
        assert (found.of("part")[n] == 0).all()


def test_xdmf_refuses_more_points_than_paraview_reads(shared_path, monkeypatch):
    monkeypatch.setattr(ub.XDMF, "limit", 8.0)
    with pytest.raises(
        ub.ArgumentError, match=r"fields of 9 points, more than 8, as text; write a"
    ):
        run(scene(), ub.XDMF(shared_path / "run.xdmf"))


def test_xdmf_has_one_grid_with_all_fields_at_each_time(shared_path, on_first_rank):
    """Readers make a data set of each grid, and of several grids pieces without common fields."""
    run(scene(), ub.XDMF(shared_path / "run.xdmf"))
    root = on_first_rank(lambda: ET.parse(shared_path / "run.xdmf").getroot())
    (collection,) = root.findall("Domain/Grid")
    grids = collection.findall("Grid")
    assert len(grids) == 7
    for numbering in grids:
        names = {one.attrib["Name"] for one in numbering.findall("Attribute")}
        assert {"displacement", "rotation", "N", "V", "M", "part"} <= names
        # Spelled as readers know it
        assert numbering.find("Topology").attrib["TopologyType"] == "Polyline"


def test_statics_have_no_velocity(series):
    make, read = series
    run(scene(), make(), scheme=ub.Static())
    assert sorted(read().names) == sorted(["displacement", "rotation", "part", "N", "V", "M"])


def test_paths_are_written_by_load_factor(series):
    make, read = series
    path = ub.follow(scene(), ub.LoadControl(0.25), steps=3, record=make())
    found = read()
    assert found.times == list(path.factor)
    assert (found.of("rotation")[-1] == path.q[-1][path.numbering.dofs[:, 2]]).all()


# -- bodies and joints -------------------------------------------------------------------------


def machine(beams=True):
    """A rocker on a bearing, a hanging weight, a wheel; with an arm clamped to the rocker."""
    rocker = ub.Body((0.5, 0.2), mass=2.0, inertia=0.3, name="rocker")
    weight = ub.Body((1.5, -1.0), mass=1.0, inertia=0.1, name="weight")
    wheel = ub.Body((-1.0, 1.0), mass=1.0, inertia=0.1, name="wheel")
    arm = ub.Beam((1.0, 0.5), (2.0, 1.5), SECTION, cells=2, name="arm")
    joints = [
        ub.Revolute(ub.ground(0, 0), rocker.at(0, 0)),
        ub.Link(rocker.at(1, 0), weight.middle),
        ub.Revolute(ub.ground(-1, 1), wheel.middle),
        *([ub.Rigid(rocker.at(1.0, 0.5), arm.start)] if beams else []),
    ]
    connectors = [
        ub.Stretch(ub.ground(-1, 0), rocker.at(0, 0.5), ub.Spring(50.0)),
        ub.Turn(rocker.at(0, 0), ub.ground(0, 0), ub.Damper(0.5)),
        ub.Turn(ub.ground(-1, 1), wheel.middle, ub.PrescribedMotion(lambda t: t * t)),
    ]
    return ub.Scene(
        [arm] if beams else [],
        bodies=[rocker, weight, wheel],
        joints=joints,
        connectors=connectors,
        loads=[ub.Gravity()],
    )


@pytest.mark.parametrize("beams", [True, False])
def test_time_series_show_bodies_and_links(series, beams):
    make, read = series
    scene = machine(beams)
    solution = run(scene, make(), steps=4)
    found = read()
    rocker, weight, wheel = scene.bodies
    connector, spring = scene.joints[1], scene.connectors[0]
    spots = [(0, 0), (1, 0), (0, 0.5), *([(1, 0.5)] if beams else [])]
    rods = [(rocker.middle, rocker.at(*spot)) for spot in spots]
    # What only turns is seen by a line of 2 % of the scene
    rods += [(one.middle, None) for one in (weight, wheel)]
    rods += [connector.places, (spring.a, spring.b)]

    points = found.points[:, :2]
    for values in found.of("part"):
        assert sorted(values) == sorted([0] * 2 * beams + [1] * (len(rods) - 2) + [2, 2])

    def cells_between(a, b):
        """Cells from one point to another, and the order of their ends."""
        there = []
        for cell, ends in enumerate(found.cells):
            for order in (ends, ends[::-1]):
                first = (points[order[0]] == a.point).all()
                size = np.linalg.norm(points[order[1]] - points[order[0]])
                beside = b is None and size == pytest.approx(0.02 * scene.size)
                if first and (beside or (b is not None and (points[order[1]] == b.point).all())):
                    there.append((cell, order))
        return there

    for a, b in rods:
        ((cell, order),) = cells_between(a, b)
        assert found.of("part")[0][cell] == (2 if a in (connector.places[0], spring.a) else 1)
        other = b if b is not None else a.body.at(*points[order[1]])
        for vertex, place in zip(order, (a, other), strict=True):
            u, v = solution.displacement(place), solution.velocity(place)
            # The same sums, perhaps in another order
            assert np.abs(found.of("displacement")[:, vertex, :2] - u[:, :2]).max() < 1e-15
            assert np.abs(found.of("velocity")[:, vertex, :2] - v[:, :2]).max() < 1e-14
            assert (found.of("rotation")[:, vertex] == u[:, 2]).all()
            assert (found.of("angular velocity")[:, vertex] == v[:, 2]).all()
        for name in "VM":
            assert (found.of(name)[:, cell] == 0.0).all()
        pulls = list(found.of("N")[:, cell])
        holder = {connector.places[0]: connector.holders[0], spring.a: spring}.get(a)
        if holder is None:
            assert pulls == [0.0] * len(pulls)
        else:
            assert pulls == list(solution.connector(holder).force)
            assert min(pulls[1:]) != max(pulls[1:])


@pytest.mark.parametrize(
    ("every", "kept"), [(1, [0, 1, 2, 3, 4, 5, 6]), (2, [0, 2, 4, 6]), (4, [0, 4])]
)
def test_a_series_has_every_nth_state(series, every, kept):
    make, read = series
    solution = run(scene(), make(every=every))
    found = read()
    assert found.times == list(solution.times[kept])
    assert (found.of("rotation") == solution.q[kept][:, solution.numbering.dofs[:, 2]]).all()


def test_every_of_the_solution_keeps_the_last():
    all_of_it, some = (run(scene(), steps=7, every=k) for k in (1, 3))
    assert list(some.times) == list(all_of_it.times[[0, 3, 6, 7]])
    assert (some.q == all_of_it.q[[0, 3, 6, 7]]).all()
    assert (some.energy.total == all_of_it.energy.total[[0, 3, 6, 7]]).all()


def read_csv(path):
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array([[float(x) for x in row] for row in rows])


def test_history_holds_the_solution(shared_path, on_first_rank):
    frame = scene()
    post, arm = frame.beams
    places = [arm.end, post.at(0.4)]
    solution = run(frame, ub.History(shared_path / "run.csv", places))
    header, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    assert header == [
        "t [s]",
        *(f"{c} arm.end (3, 3) [{unit}]" for c, unit in MOTION),
        *(f"{c} post.at(0.4) (0, 0.8) [{unit}]" for c, unit in MOTION),
        *("stored [J]", "kinetic [J]", "loads [J]", "numerical [J]"),
    ]
    # Numbers are written to the last digit; interpolation may round once more
    assert (rows[:, 0] == solution.times).all()
    for k, place in enumerate(places):
        columns = rows[:, 1 + 3 * k : 4 + 3 * k]
        assert np.abs(columns - solution.displacement(place)).max() < 1e-15
    for name, column in zip(header[-4:], rows[:, -4:].T, strict=True):
        assert (column == solution.energy[name.removesuffix(" [J]")]).all()


def test_history_without_places(shared_path, on_first_rank):
    solution = run(scene(), ub.History(shared_path / "run.csv"), scheme=ub.Static())
    header, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    assert header == ["t [s]", "stored [J]", "loads [J]"]
    assert (rows[:, 1] == solution.energy["stored"]).all()


def test_names_in_a_table_are_no_formulas(shared_path, on_first_rank):
    """Spreadsheets would compute what begins with one of these characters."""
    pushed = scene()
    beam = pushed.beams[0]
    names = ["=1+1", "+a", "-a", "@a", "a=b"]
    works = [ub.Potential(name, lambda q: q[1] ** 2) for name in names]
    pushed = ub.Scene([beam], supports=pushed.supports, works=works)
    ub.simulate(
        pushed, ub.Static(), t=(0, 1), dt=1.0,
        record=ub.History(shared_path / "a.csv"),
    )  # fmt: skip
    line = on_first_rank(lambda: (shared_path / "a.csv").read_text().splitlines()[0])
    assert not [cell for cell in line.split(",") if cell[0] in "=+-@"]
    assert {f"'{name} [J]" for name in names[:4]} | {"a=b [J]"} <= set(line.split(","))


def test_history_of_points_of_bodies_and_of_connectors(shared_path, on_first_rank):
    scene = machine(beams=False)
    spring, damper, _ = scene.connectors
    connector, point = scene.joints[1], scene.bodies[0].at(1, 0)
    record = ub.History(
        shared_path / "run.csv", [point, ub.ground(0, 0)], connectors=[spring, damper, connector]
    )
    solution = run(scene, record, steps=5)
    header, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    ends = ("rocker (0, 0), ground (0, 0)", "rocker (1, 0), weight (1.5, -1)")
    names = [
        "Stretch(ground (-1, 0), rocker (0, 0.5)), Spring",
        f"Turn({ends[0]}), Damper",
        f"Link({ends[1]})",
    ]
    assert header[1:16] == [
        *(f"{c} rocker (1, 0) [{unit}]" for c, unit in MOTION),
        *(f"{c} ground (0, 0) [{unit}]" for c, unit in MOTION),
        *(f"{c} {names[0]} [{unit}]" for c, unit in (("motion", "m"), *FORCE)),
        *(f"{c} {names[1]} [{unit}]" for c, unit in TURNING),
        *(f"{c} {names[2]} [{unit}]" for c, unit in (("motion", "m"), *FORCE)),
    ]
    assert header[16:] == [f"{name} [J]" for name in solution_entries(solution)]
    # Numbers are written to the last digit
    assert (rows[:, 1:4] == solution.displacement(point)).all()
    assert (rows[:, 4:7] == 0.0).all()
    for k, followed in enumerate((spring, damper, connector.holders[0])):
        history = solution.connector(followed)
        columns = rows[:, 7 + 3 * k : 10 + 3 * k].T
        for column, values in zip(
            columns, (history.motion, history.force, history.work), strict=True
        ):
            assert (column == values).all()
    assert np.abs(rows[1:, 7:13]).min() > 0.0


def solution_entries(solution):
    """Names of the ledger in its order."""
    energy = solution.energy
    return [*energy.state, *energy.supplied, *energy.lost]


def test_history_tells_the_forces_of_a_joint_apart(shared_path, on_first_rank):
    body = ub.Body((1.0, 0.0), mass=1.0, inertia=0.1)
    joint = ub.Rigid(ub.ground(0, 0), body.at(0, 0), multipliers=True)
    scene = ub.Scene(bodies=[body], joints=[joint], loads=[ub.Gravity((3.0, -10.0))])
    run(scene, ub.History(shared_path / "run.csv", connectors=[joint]), steps=3)
    header, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    forces = [
        rows[-1, header.index(f"force Rigid(ground (0, 0), body (0, 0)), {axis} [{unit}]")]
        for axis, unit in (("x", "N"), ("y", "N"), ("psi", "N m"))
    ]
    # What grows with the weight is held: (3, -10) N, and -10 N at 1 m
    assert forces == pytest.approx([3.0, -10.0, -10.0], rel=1e-9)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"places": [ub.Body((0, 0)).middle]}, "body is not in the scene"),
        (
            {"connectors": [ub.Turn(ub.ground(0, 0), ub.Body((0, 0)).middle, ub.Spring(1.0))]},
            "is not in the scene",
        ),
    ],
)
def test_history_of_something_else_leaves_no_file(shared_path, more, message):
    with pytest.raises(ub.ArgumentError, match=message):
        run(machine(), ub.History(shared_path / "run.csv", **more), steps=1)
    MPI.COMM_WORLD.Barrier()
    assert not (shared_path / "run.csv").exists()


def test_a_second_run_overwrites(shared_path, on_first_rank):
    record = [
        ub.History(shared_path / "run.csv"),
        ub.XDMF(shared_path / "run.xdmf"),
        ub.VTKHDF(shared_path / "run.vtkhdf"),
    ]
    run(scene(), *record, steps=9)
    run(scene(), *record, steps=3)
    assert on_first_rank(lambda: lengths(shared_path)) == (4, 4, 4)


def lengths(folder):
    """Number of rows of a table, and of steps of both time series."""
    return (
        len(read_csv(folder / "run.csv")[1]),
        len(read_xdmf(folder / "run.xdmf").times),
        len(read_vtkhdf(folder / "run.vtkhdf").times),
    )


class Count(ub.extend.Recorder):
    """A recorder of a user."""

    def __init__(self, fail_at=None):
        self.calls, self.times, self.fail_at = [], [], fail_at

    def require_writable(self):
        self.calls.append("require_writable")

    def open(self, simulation):
        self.calls.append("open")
        self.times.append(simulation.t)

    def write(self, simulation):
        self.calls.append("write")
        self.times.append(simulation.t)
        if len(self.times) == self.fail_at:
            raise KeyboardInterrupt

    def close(self):
        self.calls.append("close")


def test_recorders_of_users():
    count = Count()
    solution = run(scene(), count, steps=2)
    asked = ["require_writable"] if MPI.COMM_WORLD.rank == 0 else []
    assert count.calls == [*asked, "open", "write", "write", "close"]
    assert count.times == list(solution.times)
    alone = Count()
    ub.simulate(scene(), ub.EnergyMomentum(), t=(0, 1), dt=0.5, record=alone)  # no list
    assert alone.calls == count.calls


def test_files_are_closed_when_a_run_is_stopped(shared_path, on_first_rank):
    with pytest.raises(KeyboardInterrupt):
        run(
            scene(),
            ub.History(shared_path / "run.csv"),
            ub.XDMF(shared_path / "run.xdmf"),
            ub.VTKHDF(shared_path / "run.vtkhdf"),
            Count(fail_at=4),
        )
    # The initial state and three steps
    assert on_first_rank(lambda: lengths(shared_path)) == (4, 4, 4)


def test_files_do_not_depend_on_the_number_of_ranks(shared_path, on_first_rank):
    """Against the same run of one process alone; to round-off, since sums have another order."""
    frame = scene()
    places = [frame.beams[1].end]

    def record(name):
        return [
            ub.History(shared_path / f"{name}.csv", places),
            ub.XDMF(shared_path / f"{name}.xdmf"),
            ub.VTKHDF(shared_path / f"{name}.vtkhdf"),
        ]

    run(frame, *record("all"))

    def alone():
        run(frame, *record("one"), comm=MPI.COMM_SELF)
        return [
            (
                read_csv(shared_path / f"{name}.csv"),
                read_xdmf(shared_path / f"{name}.xdmf"),
                read_vtkhdf(shared_path / f"{name}.vtkhdf"),
            )
            for name in ("all", "one")
        ]

    ((header, rows), *series), ((header_1, rows_1), *series_1) = on_first_rank(alone)
    assert header == header_1
    # Newton's method ends below 1e-10 of the forces and its last step squares that; energies are
    # up to 10 J, motions up to 1 m
    assert np.abs(rows - rows_1).max() < 1e-9
    for found, other in zip(series, series_1, strict=True):
        assert found.times == other.times
        assert found.names == other.names
        assert (found.points == other.points).all()
        assert (found.cells == other.cells).all()
        for name in found.names:
            # Section forces are of the order of 100 N
            tolerance = 1e-7 if name in "NVM" else 1e-9
            assert np.abs(found.of(name) - other.of(name)).max() < tolerance


@pytest.mark.parametrize("degree", [1, 3])
def test_rows_of_displacements_follow_the_beam(degree):
    """Hinges and inner nodes change nothing: the last row is that of the end."""
    section = ub.Section(EA=1e6, GA=1e6, EI=500.0, rhoA=2.0, rhoI=0.01)
    hinges = (
        {0.0: ub.ElastoPlastic(20.0, 50.0), 0.5: ub.ElastoPlastic(10.0, 50.0)}
        if degree == 1
        else {}
    )
    beam = ub.Beam((0, 0), (2, 0), section, cells=4, hinges=hinges)
    load = ub.PointLoad(beam.end, force=(0.0, -20.0), amplitude=ub.ramp(0.1))
    scene = clamped(beam, loads=[load])
    extremes, mesh = ub.Extremes(), ub.Mesh(degree=degree)
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=5e-3, record=extremes, mesh=mesh)
    low = extremes.displacement(beam).low
    assert len(low) == 4 * degree + 1
    for row, s in ((0, 0.0), (2 * degree, 0.5), (-1, 1.0)):
        assert np.array_equal(low[row], run.displacement(beam.at(s)).min(axis=0))
    assert (np.diff(low[:, 1]) < 0).all()  # it bends down, further from row to row


@pytest.mark.parametrize("most", [10**9, 3], ids=["all states", "thinned"])
def test_iterations_of_a_failed_step_count_with_and_without_recorders(most):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    twist = ub.PrescribedDisplacement(beam.start, psi=lambda t: t + 4.0 * (t > 0.55))
    moved = ub.Scene([beam], supports=[twist])

    def counts(*recorders):
        with pytest.raises(ub.ConvergenceError) as failure:
            run(moved, *recorders, max_states=most)
        return failure.value.solution.substeps, failure.value.solution.iterations

    assert counts() == counts(ub.Extremes()) == counts(ub.Events())
    assert counts()[1] > 20  # most are of the failed step


@pytest.mark.parametrize("kind", ["csv", "xdmf", "hdf"])
def test_closed_recorders_have_a_state(kind, shared_path):
    """A user may ask for it after the run; no run continues from it."""
    path = shared_path / f"run.{kind}"
    film = {"csv": lambda: ub.History(path, []), "xdmf": lambda: ub.XDMF(path)}
    record = film.get(kind, lambda: ub.VTKHDF(path))()
    run(scene(), record)
    assert record.state()["digest"].size == 0
