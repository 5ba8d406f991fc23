"""Files of a run: their contents are the solution, on any number of ranks."""

import csv
import re

from mpi4py import MPI

import h5py
import numpy as np
import pytest

import ufl_beam as ub

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)


def scene():
    """Two beams at an angle; no two vertices at one point but those of the rigid corner."""
    post = ub.Beam((0, 0), (0, 2), SECTION, cells=3, name="post")
    arm = ub.Beam((0, 2), (3, 3), SECTION, cells=4, name="arm")
    return ub.Scene(
        [post, arm],
        joints=[ub.Rigid(post.end, arm.start)],
        supports=[ub.Clamped(post.start)],
        loads=[ub.PointLoad(arm.end, force=(5, -30), time=ub.ramp(1.0))],
    )


def run(scene, *record, steps=6, scheme=None, **more):
    return ub.simulate(
        scene, scheme or ub.Midpoint(0.1, 0.1), t=(0, 1), dt=1 / steps, record=record, **more
    )


def read_h5(path):
    """All data sets of an HDF5 file by name."""
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, thing: (
                found.__setitem__(name, thing[()]) if hasattr(thing, "shape") else None
            )
        )
    return found


def series(data, name):
    """The values of a function in the order of time."""
    group = {k.rsplit("/", 1)[1]: v for k, v in data.items() if k.startswith(f"Function/{name}/")}
    return [group[key] for key in sorted(group, key=lambda k: float(k.replace("_", ".")))]


def vertices_of(data, points):
    """Number of the vertex of the grid at each point of the file; joined vertices move alike."""
    apart = np.linalg.norm(points[None] - data["Mesh/mesh/geometry"][:, None, :2], axis=2)
    assert apart.min(axis=1).max() == 0.0
    return apart.argmin(axis=1)


def test_xdmf_holds_the_solution(shared_path, on_first_rank):
    frame = scene()
    solution = run(frame, ub.XDMF(shared_path / "run.xdmf"))
    data = on_first_rank(lambda: read_h5(shared_path / "run.h5"))
    grid, count = solution.grid, len(solution.times)
    assert count == 7
    assert data["Mesh/mesh/geometry"].shape == (9, 2)
    assert data["Mesh/mesh/topology"].shape == (7, 2)

    vertices = vertices_of(data, grid.points)
    shapes = {"displacement": (9, 3), "rotation": (9, 1), "N": (7, 1), "V": (7, 1), "M": (7, 1)}
    names = {name.split("/")[1] for name in data if name.startswith("Function/")}
    assert names == set(shapes)
    for name, shape in shapes.items():
        assert [values.shape for values in series(data, name)] == [shape] * count
    for n in range(count):
        q = solution.q[n][grid.dofs[vertices]]
        # Copies, so equal to the last bit
        assert (series(data, "displacement")[n][:, :2] == q[:, :2]).all()
        assert (series(data, "displacement")[n][:, 2] == 0).all()
        assert (series(data, "rotation")[n][:, 0] == q[:, 2]).all()

    # Cells by their middle
    middles = grid.points[grid.cells].mean(axis=1)
    here = data["Mesh/mesh/geometry"][data["Mesh/mesh/topology"]][:, :, :2].mean(axis=1)
    cells = np.linalg.norm(middles[None] - here[:, None], axis=2).argmin(axis=1)
    assert sorted(cells) == list(range(7))
    for n in range(count):
        forces = np.concatenate([solution.section_forces(b, n) for b in frame.beams])
        for component, name in enumerate("NVM"):
            written = series(data, name)[n][:, 0]
            # The same kernel on other meshes: round-off of EA
            assert np.abs(written - forces[cells, component]).max() < 1e-16 * 1e4 * 10


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
        ub.Turn(ub.ground(-1, 1), wheel.middle, ub.Motor(lambda t: t * t)),
    ]
    return ub.Scene(
        [arm] if beams else [],
        bodies=[rocker, weight, wheel],
        joints=joints,
        connectors=connectors,
        loads=[ub.Gravity()],
    )


@pytest.mark.parametrize("beams", [True, False])
def test_xdmf_shows_bodies_and_links(shared_path, on_first_rank, beams):
    scene = machine(beams)
    solution = run(scene, ub.XDMF(shared_path / "run.xdmf"), steps=4)
    data = on_first_rank(lambda: read_h5(shared_path / "run.h5"))
    rocker, weight, wheel = scene.bodies
    link, spring = scene.joints[1], scene.connectors[0]
    spots = [(0, 0), (1, 0), (0, 0.5), *([(1, 0.5)] if beams else [])]
    rods = [(rocker.middle, rocker.at(*spot)) for spot in spots]
    # What only turns is seen by a line of 2 % of the scene
    rods += [(one.middle, None) for one in (weight, wheel)]
    rods += [link.places, (spring.a, spring.b)]

    topology, points = data["Mesh/mesh/topology"], data["Mesh/mesh/geometry"][:, :2]
    parts = [values[:, 0] for values in series(data, "part")]
    assert len(parts) == len(solution.times)
    for values in parts:
        assert sorted(values) == sorted([0] * 2 * beams + [1] * (len(rods) - 2) + [2, 2])

    def cells_between(a, b):
        """Cells from one point to another, and the order of their ends."""
        found = []
        for cell, ends in enumerate(topology):
            for order in (ends, ends[::-1]):
                first = (points[order[0]] == a.point).all()
                size = np.linalg.norm(points[order[1]] - points[order[0]])
                beside = b is None and size == pytest.approx(0.02 * scene.size)
                if first and (beside or (b is not None and (points[order[1]] == b.point).all())):
                    found.append((cell, order))
        return found

    for a, b in rods:
        ((cell, order),) = cells_between(a, b)
        assert parts[0][cell] == (2 if a in (link.places[0], spring.a) else 1)
        other = b if b is not None else a.body.at(*points[order[1]])
        for n in range(len(solution.times)):
            for vertex, place in zip(order, (a, other), strict=True):
                u = solution.displacement(place)[n]
                # The same sums; the point of the file is rounded once
                written = series(data, "displacement")[n][vertex, :2]
                assert np.abs(written - u[:2]).max() < 1e-15
                assert series(data, "rotation")[n][vertex, 0] == u[2]
        for name in "VM":
            assert all(values[cell, 0] == 0.0 for values in series(data, name))
        pulls = [values[cell, 0] for values in series(data, "N")]
        holder = {link.places[0]: link.holders[0], spring.a: spring}.get(a)
        if holder is None:
            assert pulls == [0.0] * len(pulls)
        else:
            assert pulls == list(solution.connector(holder).force)
            assert min(pulls[1:]) != max(pulls[1:])


@pytest.mark.parametrize("beams", [True, False])
def test_xdmf_says_what_is_in_the_data(shared_path, on_first_rank, beams):
    """What readers rely on: each item is there, of its size, and cells are between vertices."""
    run(machine(beams), ub.XDMF(shared_path / "run.xdmf"), steps=2)
    text = on_first_rank(lambda: (shared_path / "run.xdmf").read_text())
    data = on_first_rank(lambda: read_h5(shared_path / "run.h5"))
    items = re.findall(r'<DataItem Dimensions="([\d ]+)"[^>]*>run.h5:/([^<]+)</DataItem>', text)
    assert {name for _, name in items} == set(data)
    for size, name in items:
        assert tuple(map(int, size.split())) == data[name].shape
    assert text.count('Name="part" AttributeType="Scalar" Center="Cell"') == 3
    topology, points = data["Mesh/mesh/topology"], data["Mesh/mesh/geometry"]
    assert sorted(np.unique(topology)) == list(range(len(points)))
    # 2 cells of the arm; from centres to points 4 (3), 1, 1; a link and a spring
    assert len(topology) == (2 + 6 + 2 if beams else 5 + 2)


def test_xdmf_names_the_times(shared_path, on_first_rank):
    run(scene(), ub.XDMF(shared_path / "run.xdmf"), steps=4)
    text = on_first_rank(lambda: (shared_path / "run.xdmf").read_text())
    for time in ("0", "0.25", "0.5", "0.75", "1"):
        assert text.count(f'<Time Value="{time}" />') == 5  # once for each function
    assert "run.h5:/Function/displacement/0_25" in text


@pytest.mark.parametrize(
    ("every", "kept"), [(1, [0, 1, 2, 3, 4, 5, 6]), (2, [0, 2, 4, 6]), (4, [0, 4])]
)
def test_every(shared_path, on_first_rank, every, kept):
    solution = run(scene(), ub.XDMF(shared_path / "run.xdmf", every=every))
    data = on_first_rank(lambda: read_h5(shared_path / "run.h5"))
    vertices = vertices_of(data, solution.grid.points)
    rotations = [values[:, 0] for values in series(data, "rotation")]
    assert len(rotations) == len(kept)
    for n, values in zip(kept, rotations, strict=True):
        assert (values == solution.q[n][solution.grid.dofs[vertices, 2]]).all()


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
        "t",
        *(f"{c} arm.end (3, 3)" for c in ("u", "v", "psi")),
        *(f"{c} post.at(0.4) (0, 0.8)" for c in ("u", "v", "psi")),
        *("stored", "kinetic", "loads", "numerical"),
    ]
    # Numbers are written to the last digit; interpolation may round once more
    assert (rows[:, 0] == solution.times).all()
    for k, place in enumerate(places):
        columns = rows[:, 1 + 3 * k : 4 + 3 * k]
        assert np.abs(columns - solution.displacement(place)).max() < 1e-15
    for name, column in zip(header[-4:], rows[:, -4:].T, strict=True):
        assert (column == solution.energy[name]).all()


def test_history_without_places(shared_path, on_first_rank):
    solution = run(scene(), ub.History(shared_path / "run.csv"), scheme=ub.Static())
    header, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    assert header == ["t", "stored", "loads"]
    assert (rows[:, 1] == solution.energy["stored"]).all()


def test_history_of_points_of_bodies_and_of_connectors(shared_path, on_first_rank):
    scene = machine(beams=False)
    spring, damper, _ = scene.connectors
    link, point = scene.joints[1], scene.bodies[0].at(1, 0)
    record = ub.History(
        shared_path / "run.csv", [point, ub.ground(0, 0)], connectors=[spring, damper, link]
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
        *(f"{c} rocker (1, 0)" for c in ("u", "v", "psi")),
        *(f"{c} ground (0, 0)" for c in ("u", "v", "psi")),
        *(f"{c} {name}" for name in names for c in ("motion", "force", "work")),
    ]
    assert header[16:] == solution_entries(solution)
    # Numbers are written to the last digit
    assert (rows[:, 1:4] == solution.displacement(point)).all()
    assert (rows[:, 4:7] == 0.0).all()
    for k, connector in enumerate((spring, damper, link.holders[0])):
        history = solution.connector(connector)
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
    joint = ub.Rigid(ub.ground(0, 0), body.at(0, 0), measured=True)
    scene = ub.Scene(bodies=[body], joints=[joint], loads=[ub.Gravity((3.0, -10.0))])
    run(scene, ub.History(shared_path / "run.csv", connectors=[joint]), steps=3)
    header, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    forces = [
        rows[-1, header.index(f"force Rigid(ground (0, 0), body (0, 0)), {axis}")]
        for axis in ("x", "y", "psi")
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
    with pytest.raises(ub.SceneError, match=message):
        run(machine(), ub.History(shared_path / "run.csv", **more), steps=1)
    MPI.COMM_WORLD.Barrier()
    assert not (shared_path / "run.csv").exists()


def test_a_second_run_overwrites(shared_path, on_first_rank):
    record = [ub.History(shared_path / "run.csv"), ub.XDMF(shared_path / "run.xdmf")]
    run(scene(), *record, steps=9)
    run(scene(), *record, steps=3)
    _, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    data = on_first_rank(lambda: read_h5(shared_path / "run.h5"))
    assert len(rows) == len(series(data, "N")) == 4


class Count(ub.Recorder):
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
    ub.simulate(scene(), ub.Midpoint(), t=(0, 1), dt=0.5, record=alone)  # no list
    assert alone.calls == count.calls


def test_files_are_closed_when_a_run_is_stopped(shared_path, on_first_rank):
    with pytest.raises(KeyboardInterrupt):
        run(
            scene(),
            *(ub.History(shared_path / "run.csv"), ub.XDMF(shared_path / "run.xdmf")),
            Count(fail_at=4),
        )
    _, rows = on_first_rank(lambda: read_csv(shared_path / "run.csv"))
    data = on_first_rank(lambda: read_h5(shared_path / "run.h5"))
    assert len(rows) == len(series(data, "N")) == 4  # the initial state and three steps


def test_files_do_not_depend_on_the_number_of_ranks(shared_path, on_first_rank):
    """Against the same run of one process alone; to round-off, since sums have another order."""
    frame = scene()
    places = [frame.beams[1].end]
    run(frame, ub.History(shared_path / "all.csv", places), ub.XDMF(shared_path / "all.xdmf"))

    def alone():
        one, other = shared_path / "one.csv", shared_path / "one.xdmf"
        run(frame, ub.History(one, places), ub.XDMF(other), comm=MPI.COMM_SELF)
        return [
            (read_csv(shared_path / f"{n}.csv"), read_h5(shared_path / f"{n}.h5"))
            for n in ("all", "one")
        ]

    ((header, rows), data), ((header_1, rows_1), data_1) = on_first_rank(alone)
    assert header == header_1
    # Newton's method ends below 1e-10 of the forces and its last step squares that; energies are
    # up to 10 J, motions up to 1 m
    assert np.abs(rows - rows_1).max() < 1e-9
    assert data.keys() == data_1.keys()
    for name, values in data.items():
        assert values.shape == data_1[name].shape
        # Section forces are of the order of 100 N
        assert np.abs(values - data_1[name]).max() < (
            1e-7 if name[9:11] in ("N/", "V/", "M/") else 1e-9
        )
