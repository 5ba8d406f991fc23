# SPDX-License-Identifier: MIT
"""Files of a run: their contents are the solution, on any number of ranks."""

import csv
import xml.etree.ElementTree as ET
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises, stop_after
from scenes import SECTION, clamped, rigid_chain
from time_series import read_as_users_do, read_vtkhdf, read_xdmf, require_equal

import ufl_beam as ub

MOTION = (("u", "m"), ("v", "m"), ("psi", "rad"))
FORCE = (("motion", "m"), ("force", "N"), ("work", "J"))
TURNING = (("motion", "rad"), ("force", "N m"), ("work", "J"))
READERS = {ub.XDMF: read_xdmf, ub.VTKHDF: read_vtkhdf}


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


# -- time series ---------------------------------------------------------------------------------


@pytest.fixture(params=READERS, ids=["XDMF", "VTKHDF"])
def series(request, shared_path, on_first_rank):
    """A recorder of time series, and what a reader finds in its file."""
    path = shared_path / f"run{request.param.endings[0]}"

    def read():
        found = READERS[request.param](path)
        require_equal(found, read_as_users_do(path))
        return found

    return lambda **more: request.param(path, **more), lambda: on_first_rank(read)


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
    for states, vector, angle in (
        (solution.q, "displacement", "rotation"),
        (solution.v, "velocity", "angular velocity"),
    ):
        at_nodes = states[:, numbering.dofs]
        # Copies, so equal to the last bit
        assert (found.of(vector) == at_nodes * (1, 1, 0)).all()
        assert (found.of(angle) == at_nodes[..., 2]).all()
    for n in range(7):
        forces = np.concatenate([solution.section_forces(b, n) for b in frame.beams])
        drawn = np.column_stack([found.of(name)[n] for name in "NVM"])
        # The same kernel on other meshes: round-off of EA
        assert np.abs(drawn - forces).max() < 1e-16 * 1e4 * 10
    assert (found.of("part") == 0).all()


def test_statics_have_no_velocity_and_a_second_run_overwrites(series):
    make, read = series
    run(scene(), make(), steps=9)
    path = ub.follow(scene(), ub.LoadControl(0.25), steps=3, record=make())
    found = read()
    assert sorted(found.names) == sorted(["displacement", "rotation", "part", "N", "V", "M"])
    assert found.times == list(path.factor)
    assert (found.of("rotation")[-1] == path.q[-1][path.numbering.dofs[:, 2]]).all()


@pytest.mark.parametrize(("every", "kept"), [(2, [0, 2, 4, 6]), (4, [0, 4])])
def test_a_series_has_every_nth_state(series, every, kept):
    make, read = series
    solution = run(scene(), make(every=every))
    found = read()
    assert found.times == list(solution.times[kept])
    assert (found.of("rotation") == solution.q[kept][:, solution.numbering.dofs[:, 2]]).all()


def test_xdmf_has_one_grid_with_all_fields_at_each_time(shared_path, on_first_rank, monkeypatch):
    """Readers make a data set of each grid, and of several grids pieces without common fields."""
    file = shared_path / "run.xdmf"
    run(scene(), ub.XDMF(file))
    (collection,) = on_first_rank(lambda: ET.parse(file).getroot().findall("Domain/Grid"))
    grids = collection.findall("Grid")
    assert len(grids) == 7
    for grid in grids:
        names = {one.attrib["Name"] for one in grid.findall("Attribute")}
        assert {"displacement", "rotation", "N", "V", "M", "part"} <= names
        # Spelled as readers know it
        assert grid.find("Topology").attrib["TopologyType"] == "Polyline"
    monkeypatch.setattr(ub.XDMF, "limit", 8.0)
    with raises("fields of 9 points, more than 8, as text; write a"):
        run(scene(), ub.XDMF(file))


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
    link, spring = scene.joints[1], scene.connectors[0]
    spots = [(0, 0), (1, 0), (0, 0.5), *([(1, 0.5)] if beams else [])]
    # Ends of rods, their part and the force that they bear; a line of 2 % of the scene shows what
    # only turns
    rods = [(rocker.middle, rocker.at(*spot), 1, None) for spot in spots]
    rods += [(one.middle, None, 1, None) for one in (weight, wheel)]
    rods += [(*link.places, 2, link.holders[0]), (spring.a, spring.b, 2, spring)]
    points = found.points[:, :2]
    for values in found.of("part"):
        assert sorted(values) == sorted([0] * 2 * beams + [part for _, _, part, _ in rods])
    for a, b, part, holder in rods:
        there = [
            (cell, order)
            for cell, ends in enumerate(found.cells)
            for order in (ends, ends[::-1])
            if (points[order[0]] == a.point).all()
            and (
                np.linalg.norm(np.diff(points[order], axis=0)) == pytest.approx(0.02 * scene.size)
                if b is None
                else (points[order[1]] == b.point).all()
            )
        ]
        ((cell, order),) = there
        assert found.of("part")[0][cell] == part
        for vertex, place in zip(order, (a, b or a.body.at(*points[order[1]])), strict=True):
            u, v = solution.displacement(place), solution.velocity(place)
            # The same sums, perhaps in another order
            assert np.abs(found.of("displacement")[:, vertex, :2] - u[:, :2]).max() < 1e-15
            assert np.abs(found.of("velocity")[:, vertex, :2] - v[:, :2]).max() < 1e-14
            assert (found.of("rotation")[:, vertex] == u[:, 2]).all()
            assert (found.of("angular velocity")[:, vertex] == v[:, 2]).all()
        pulls = solution.connector(holder).force if holder else np.zeros(5)
        assert (found.of("N")[:, cell] == pulls).all()
        assert holder is None or np.ptp(pulls[1:]) > 0
        assert not found.of("V")[:, cell].any()
        assert not found.of("M")[:, cell].any()


# -- tables --------------------------------------------------------------------------------------


def read_csv(path):
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array([[float(x) for x in row] for row in rows])


@pytest.fixture
def table(shared_path, on_first_rank):
    """A path, and a function that reads the header and the numbers of its file."""
    path = shared_path / "run.csv"
    return path, lambda: on_first_rank(lambda: read_csv(path))


def entries(solution):
    """Columns of the ledger in its order."""
    energy = solution.energy
    return [f"{name} [J]" for name in (*energy.state, *energy.supplied, *energy.lost)]


def require_energies(header, rows, solution):
    names = entries(solution)
    assert header[-len(names) :] == names
    for name, column in zip(names, rows[:, -len(names) :].T, strict=True):
        assert (column == solution.energy[name.removesuffix(" [J]")]).all()


def test_history_holds_the_solution(table):
    path, read = table
    frame = scene()
    post, arm = frame.beams
    places = [arm.end, post.at(0.4)]
    solution = run(frame, ub.History(path, places))
    header, rows = read()
    assert header[:7] == [
        "t [s]",
        *(f"{c} arm.end (3, 3) [{unit}]" for c, unit in MOTION),
        *(f"{c} post.at(0.4) (0, 0.8) [{unit}]" for c, unit in MOTION),
    ]
    assert entries(solution) == ["stored [J]", "kinetic [J]", "loads [J]", "numerical [J]"]
    # Numbers are written to the last digit; interpolation may round once more
    assert (rows[:, 0] == solution.times).all()
    moved = np.hstack([solution.displacement(place) for place in places])
    assert np.abs(rows[:, 1:7] - moved).max() < 1e-15
    require_energies(header[7:], rows, solution)


def test_history_of_points_of_bodies_and_of_connectors(table):
    path, read = table
    scene = machine(beams=False)
    spring, damper, _ = scene.connectors
    link, point = scene.joints[1], scene.bodies[0].at(1, 0)
    followed = [spring, damper, link]
    solution = run(scene, ub.History(path, [point, ub.ground(0, 0)], connectors=followed), steps=5)
    header, rows = read()
    names = [
        "Stretch(ground (-1, 0), rocker (0, 0.5)), Spring",
        "Turn(rocker (0, 0), ground (0, 0)), Damper",
        "Link(rocker (1, 0), weight (1.5, -1))",
    ]
    assert header[1:16] == [
        *(f"{c} rocker (1, 0) [{unit}]" for c, unit in MOTION),
        *(f"{c} ground (0, 0) [{unit}]" for c, unit in MOTION),
        *(
            f"{c} {name} [{unit}]"
            for name, columns in zip(names, (FORCE, TURNING, FORCE), strict=True)
            for c, unit in columns
        ),
    ]
    require_energies(header[16:], rows, solution)
    # Numbers are written to the last digit
    assert (rows[:, 1:4] == solution.displacement(point)).all()
    assert (rows[:, 4:7] == 0.0).all()
    histories = [solution.connector(x) for x in (spring, damper, link.holders[0])]
    columns = [x for h in histories for x in (h.motion, h.force, h.work)]
    assert (rows[:, 7:16] == np.transpose(columns)).all()
    assert np.abs(rows[1:, 7:13]).min() > 0.0


def test_history_tells_the_forces_of_a_joint_apart(table):
    """[closed] The weight of (3, -10) N is held at a distance of 1 m."""
    path, read = table
    body = ub.Body((1.0, 0.0), mass=1.0, inertia=0.1)
    joint = ub.Rigid(ub.ground(0, 0), body.at(0, 0), multipliers=True)
    held = ub.Scene(bodies=[body], joints=[joint], loads=[ub.Gravity((3.0, -10.0))])
    run(held, ub.History(path, connectors=[joint]), steps=3)
    header, rows = read()
    forces = [
        rows[-1, header.index(f"force Rigid(ground (0, 0), body (0, 0)), {axis} [{unit}]")]
        for axis, unit in (("x", "N"), ("y", "N"), ("psi", "N m"))
    ]
    assert forces == pytest.approx([3.0, -10.0, -10.0], rel=1e-9)


def test_names_in_a_table_are_no_formulas(table):
    """Spreadsheets would compute what begins with one of these characters."""
    path, read = table
    names = ["=1+1", "+a", "-a", "@a", "a=b"]
    works = [ub.Potential(name, lambda q: q[1] ** 2) for name in names]
    run(replace(scene(), works=works), ub.History(path), scheme=ub.Static(), steps=1)
    header, _ = read()
    assert not [cell for cell in header if cell[0] in "=+-@"]
    assert {f"'{name} [J]" for name in names[:4]} | {"a=b [J]"} <= set(header)


LOOSE = ub.Body((0, 0))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"places": [LOOSE.middle]}, "body is not in the scene"),
        (
            {"connectors": [ub.Turn(ub.ground(0, 0), LOOSE.middle, ub.Spring(1.0))]},
            "is not in the scene",
        ),
    ],
)
def test_history_of_something_else_leaves_no_file(shared_path, more, message):
    with raises(message):
        run(machine(), ub.History(shared_path / "run.csv", **more), steps=1)
    MPI.COMM_WORLD.Barrier()
    assert not (shared_path / "run.csv").exists()


# -- recorders -----------------------------------------------------------------------------------


class Count(ub.extend.Recorder):
    """A recorder of a user."""

    def __init__(self):
        self.calls, self.times = [], []

    def require_writable(self):
        self.calls.append("require_writable")

    def open(self, simulation):
        self.calls.append("open")
        self.times.append(simulation.t)

    def write(self, simulation):
        self.calls.append("write")
        self.times.append(simulation.t)

    def close(self):
        self.calls.append("close")


def test_recorders_of_users():
    """One or a list of them."""
    asked = ["require_writable"] if MPI.COMM_WORLD.rank == 0 else []
    for listed in (False, True):
        one = Count()
        record = [one] if listed else one
        solution = ub.simulate(scene(), ub.EnergyMomentum(), t=(0, 1), dt=0.5, record=record)
        assert one.calls == [*asked, "open", "write", "write", "close"]
        assert one.times == list(solution.times)


def test_files_are_closed_when_a_run_is_stopped(shared_path, on_first_rank):
    """A user may ask for a state afterwards; no run continues from it."""
    paths = [shared_path / f"run.{end}" for end in ("csv", "xdmf", "vtkhdf")]
    record = [ub.History(paths[0]), ub.XDMF(paths[1]), ub.VTKHDF(paths[2])]
    with pytest.raises(KeyboardInterrupt):
        run(scene(), *record, stop_after(3))
    # The initial state and three steps
    assert on_first_rank(lambda: len(read_csv(paths[0])[1])) == 4
    assert on_first_rank(lambda: len(read_xdmf(paths[1]).times)) == 4
    assert on_first_rank(lambda: len(read_vtkhdf(paths[2]).times)) == 4
    assert [one.state()["digest"].size for one in record] == [0, 0, 0]


@pytest.mark.parametrize("degree", [1, 3])
def test_rows_of_displacements_follow_the_beam(degree):
    """Hinges and inner nodes change nothing: the last row is that of the end."""
    section = ub.Section(EA=1e6, GA=1e6, EI=500.0, rhoA=2.0, rhoI=0.01)
    laws = {0.0: ub.ElastoPlastic(20.0, 50.0), 0.5: ub.ElastoPlastic(10.0, 50.0)}
    beam = ub.Beam((0, 0), (2, 0), section, cells=4, hinges=laws if degree == 1 else {})
    load = ub.PointLoad(beam.end, force=(0.0, -20.0), amplitude=ub.ramp(0.1))
    scene, extremes = clamped(beam, loads=[load]), ub.Extremes()
    options = {"t": (0, 0.1), "dt": 5e-3, "record": extremes, "mesh": ub.Mesh(degree=degree)}
    run = ub.simulate(scene, ub.EnergyMomentum(), **options)
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
