# SPDX-License-Identifier: MIT
"""Tables of storeys and hinges, and accelerations: equal wherever they are, with clear errors."""

import sys

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises, stop_after

import ufl_beam as ub
import ufl_beam.structures as st

LIMITS = {"IO": 0.01, "LS": 0.02, "CP": 0.05}
STEEL = {"b": 0.1, "h": 0.2, "E": 210e9, "nu": 0.3, "rho": 7850.0}
PLAIN = ub.Section.rectangle(**STEEL)


def shaken():
    """A mast with a plastic hinge and a floor on a spring that yields, shaken by its foot."""
    hinge, law = ub.ElastoPlastic(4e4, isotropic=1e5), ub.ElastoPlastic(1e4, kinematic=1e5)
    mast = ub.Beam((0, 0), (0, 3), PLAIN, cells=3, hinges={0.0: hinge}, name="mast")
    floor = ub.Beam((0, 3), (2, 3), PLAIN, cells=2, name="floor")
    corner = ub.Turn(mast.end, floor.start, ub.Spring(2e6, law=law))
    foot = ub.PrescribedDisplacement(
        mast.start, u=lambda t: 0.05 * (1 - np.cos(20 * t)), v=0.0, psi=0.0
    )
    return ub.Scene(
        [mast, floor],
        joints=[ub.Revolute(mast.end, floor.start)],
        supports=[foot],
        connectors=[corner],
        masses=[ub.PointMass(floor.end, 500.0)],
    )


def recorded(scene, folder, **more):
    """A run with its recorders of accelerations, at both ends of the mast."""
    mast = scene["mast"]
    places = [mast.start, mast.end]
    table = ub.History(folder / "floors.csv", accelerations=places)
    extremes = ub.Extremes(accelerations=True)
    call = {"t": (0, 0.3), "dt": 0.01, **more}
    record = [table, extremes, *call.pop("record", ())]
    run = ub.simulate(scene, ub.EnergyMomentum(), record=record, **call)
    return run, table, extremes


@pytest.mark.parametrize("dt", [0.01, ub.Adaptive(1e-3)], ids=["equal", "adaptive"])
def test_accelerations_are_equal_in_history_extremes_and_solution(dt, shared_path, on_first_rank):
    """To the last bit, also in steps of different lengths, and if only some rows are kept."""
    run, table, extremes = recorded(shaken(), shared_path, dt=dt)
    mast = run.scene["mast"]
    read = lambda: np.loadtxt(table.files[0], delimiter=",", skiprows=1)  # noqa: E731
    rows = on_first_rank(read)[:, 1:7].reshape(-1, 2, 3)
    for k, place in enumerate((mast.start, mast.end)):
        a = run.acceleration(place)
        np.testing.assert_array_equal(rows[:, k], a)
        found = extremes.acceleration(mast).subset(-k)
        np.testing.assert_array_equal(found.high, a[1:].max(axis=0))
        np.testing.assert_array_equal(found.low, a[1:].min(axis=0))
        at = a[1:].argmax(axis=0)
        np.testing.assert_array_equal(found.time_high, run.times[1:][at])
    moved = np.nancumsum(np.diff(run.times)[:, None] * run.acceleration(mast.end)[1:], axis=0)
    np.testing.assert_allclose(moved, run.velocity(mast.end)[1:], rtol=0, atol=1e-12)


def test_results_of_a_resumed_run_are_those_of_the_whole(shared_path):
    whole, _, extremes = recorded(shaken(), shared_path)
    file = ub.Checkpoint(shared_path / "run.checkpoint", every=7)
    (shared_path / "parts").mkdir(exist_ok=True)
    with pytest.raises(KeyboardInterrupt):
        recorded(shaken(), shared_path / "parts", checkpoint=file, record=[stop_after(11)])
    again = {"checkpoint": file, "record": [stop_after(10**9)]}
    resumed, table, later = recorded(shaken(), shared_path / "parts", **again)
    MPI.COMM_WORLD.barrier()
    assert table.files[0].read_bytes() == (shared_path / "floors.csv").read_bytes()
    for name, values in extremes.state().items():
        np.testing.assert_array_equal(later.state()[name], values)
    assert str(st.hinge_table(resumed, LIMITS)) == str(st.hinge_table(whole, LIMITS))
    levels = lambda run: [run.scene["mast"].start, run.scene["mast"].end]  # noqa: E731
    assert str(st.storeys(resumed, levels(resumed))) == str(st.storeys(whole, levels(whole)))


def test_results_of_a_file_are_those_of_the_run(shared_path):
    run = ub.simulate(shaken(), ub.EnergyMomentum(), t=(0, 0.3), dt=0.01)
    run.save(shared_path / "run.solution")
    loaded = ub.Solution.load(shared_path / "run.solution")
    assert str(st.hinge_table(loaded, LIMITS)) == str(st.hinge_table(run, LIMITS))
    (one, other) = (
        st.storeys(solution, [solution.scene["mast"].start, solution.scene["mast"].end])
        for solution in (run, loaded)
    )
    for name in ("drift", "shear", "heights", "times"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="one process")
def test_results_of_several_processes_are_those_of_one():
    """To the tolerance of Newton's method, amplified over 30 steps."""
    tables = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        run = ub.simulate(shaken(), ub.EnergyMomentum(), t=(0, 0.3), dt=0.01, comm=comm)
        mast = run.scene["mast"]
        storeys = st.storeys(run, [mast.start, mast.end])
        rows = st.hinge_table(run, LIMITS).rows
        numbers = [row[2:7] for row in rows]
        tables.append((storeys.shear[1:], run.acceleration(mast.end)[1:], numbers))
        assert len(rows) == 2
    for one, other in zip(*tables, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-6 * np.nanmax(np.abs(other)))


# -- hinges ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def everything():
    """Cantilevers that are bent to and fro, with a hinge or inelastic material of each kind."""
    law = ub.ElastoPlastic(30e3, isotropic=1e5)
    fibres = ub.Fibres(ub.ElastoPlastic(200e6, isotropic=2e9), number=20)
    kinds = {
        "yields": ub.Section.rectangle(**STEEL, bending=ub.ElastoPlastic(60e3, isotropic=1e5)),
        "opens": ub.Section.rectangle(**STEEL, hinge=ub.Softening(70e3, 20e3)),
        "fibres": ub.Section.rectangle(**STEEL, fibres=fibres),
        **dict.fromkeys(("hinge", "elastic", "softens", "rigid"), PLAIN),
    }
    beams = {
        name: ub.Beam(
            (0, 3 * k), (2, 3 * k), section, cells=4, name=name,
            hinges={0.5: law} if name == "hinge" else {},
        )
        for k, (name, section) in enumerate(kinds.items())
    }  # fmt: skip
    laws = {
        "elastic": ub.Spring(3e6, law=law),
        "softens": ub.Spring(3e6, softening=ub.Softening(40e3, 2e3)),
        "rigid": ub.RigidPlastic(ub.ElastoPlastic(20e3)),
    }
    connectors = [
        ub.Turn(ub.ground(*beams[name].start.point), beams[name].start, law)
        for name, law in laws.items()
    ]
    ends = [
        ub.PrescribedDisplacement(x.end, v=lambda t: -0.12 * np.sin(6 * t)) for x in beams.values()
    ]
    starts = [(ub.Pinned if n in laws else ub.Clamped)(x.start) for n, x in beams.items()]
    scene = ub.Scene([*beams.values()], supports=[*starts, *ends], connectors=connectors)
    return ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=0.02)


def test_energies_of_all_kinds_of_hinges_add_up_to_the_ledger(everything):
    """A sum in another order."""
    table, energy = st.hinge_table(everything, LIMITS), everything.energy
    total = sum(row.dissipated for row in table.rows)
    assert total == pytest.approx(energy["plastic"][-1] + energy["hinges"][-1], rel=1e-12)
    assert len(table.rows) == 7
    known = {str(row.where).split()[0] for row in table.rows if not np.isnan(row.rotation)}
    assert known == {"opens.start", "hinge.at(0.5)", "Turn(ground"}
    with_yield = [row.where for row in table.rows if not np.isnan(row.ductility)]
    assert with_yield == [c for c in everything.scene.connectors if isinstance(c.law, ub.Spring)]


def test_energies_of_a_run_with_a_start_include_those_before(everything):
    """And the ledger begins at zero."""
    total, runs = 0.0, []
    for ends in ((0.0, 0.6), (0.6, 1.0)):
        start = runs[-1] if runs else None
        scheme = ub.EnergyMomentumStatic()
        runs.append(ub.simulate(everything.scene, scheme, t=ends, dt=0.02, start=start))
        energy = runs[-1].energy
        total += energy["plastic"][-1] + energy["hinges"][-1]
        rows = st.hinge_table(runs[-1]).rows
        assert sum(row.dissipated for row in rows) == pytest.approx(total, rel=1e-12)
    assert {row.time for row in rows} == {0.6}


def test_rows_are_those_of_other_results(everything):
    """Of connectors, and of the material at the place of a hinge."""
    for row in st.hinge_table(everything).rows:
        if np.isnan(row.rotation):
            continue
        if isinstance(row.where, ub.Place):
            jump, lost = everything.material_at(row.where)[1::2]
        else:
            jump, *_, lost = everything.connector(row.where)[::4]
        assert abs(row.rotation) == np.abs(jump).max()
        assert row.dissipated == lost[-1]
        assert row.n == np.argmax(lost > 0)
        assert row.time == everything.times[row.n]


def test_hinges_of_some_beams_and_connectors(everything):
    scene = everything.scene
    chosen = scene["hinge"], scene.connectors[2]
    rows = st.hinge_table(everything, LIMITS, only=chosen).rows
    assert {str(row.where).split()[0] for row in rows} == {"hinge.at(0.5)", "Turn(ground"}
    assert st.hinge_table(everything, only=[scene["elastic"]]).rows == ()


@pytest.mark.parametrize(
    ("limit", "state"), [(1.0, "IO"), (0.01, "beyond IO"), (None, "yielded")]
)  # fmt: skip
def test_states_of_acceptance(everything, limit, state):
    limits = {} if limit is None else {"IO": limit}
    rows = st.hinge_table(everything, limits, only=[everything.scene["hinge"]]).rows
    assert [row.state for row in rows] == [state]


def test_a_hinge_below_its_limit_is_elastic():
    beam = ub.Beam((0, 0), (2, 0), PLAIN, hinges={0.0: ub.ElastoPlastic(1e6)}, name="beam")
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[ub.Gravity()])
    table = st.hinge_table(ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0), LIMITS)
    (row,) = table.rows
    assert (row.n, row.state, row.rotation, row.dissipated) == (-1, "elastic", 0.0, 0.0)
    assert str(table).splitlines()[1].split()[3:] == ["-", "0", "0", "-", "0", "elastic"]
    assert repr(table) == "<HingeTable: 1, 0 yielded>"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"limits": {"IO": 0.0}}, ["limits['IO']", "must be positive"]),
        ({"limits": {"IO": 0.02, "LS": 0.01}}, ["limits['LS'] = 0.01 rad", "increasing order"]),
        ({"limits": [0.1]}, ["hinge_table: limits", "is not a Mapping"]),
        ({"limits": {1: 0.1}}, ["hinge_table: limits", "must be text"]),
        ({"only": [PLAIN]}, ["hinge_table: only[0]", "is not a Beam or Connector"]),
        ({"only": [ub.Beam((0, 0), (1, 0), PLAIN)]}, ["only[0]", "is not in the scene"]),
    ],
)
def test_wrong_arguments_of_hinges(everything, arguments, words):
    with raises(*words):
        st.hinge_table(everything, **arguments)


# -- storeys -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def towers():
    """A mast, and a body between two beams; the mast is pushed by 3 kN at its end."""
    mast = ub.Beam((0, 0), (0, 3), PLAIN, name="mast")
    low, high = ub.Beam((5, 0), (5, 1), PLAIN, name="low"), ub.Beam((5, 2), (5, 3), PLAIN)
    block = ub.Body((5, 1.5), mass=1.0, inertia=1.0, name="block")
    scene = ub.Scene(
        [mast, low, high],
        bodies=[block],
        joints=[ub.Rigid(low.end, block.at(5, 1)), ub.Rigid(block.at(5, 2), high.start)],
        supports=[ub.Clamped(mast.start), ub.Clamped(low.start)],
        loads=[ub.PointLoad(mast.end, force=(3e3, 0))],
    )
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)


@pytest.mark.parametrize(
    ("levels", "words"),
    [
        (lambda m, b: [m.start], ["at least two places"]),
        (lambda m, b: [m.end, m.start], ["levels[1] = mast.start", "not above levels[0]"]),
        (lambda m, b: [m.start, b.start], ["levels[1] = low.start", "not above"]),
        (lambda m, b: [m.start, 3.0], ["levels[1] = 3.0 is not a place"]),
        (lambda m, b: m.start, ["storeys: levels", "must be a list"]),
        (lambda m, b: [b.end, m.end], ["the level y = 1 m cuts the body block"]),
        (lambda m, b: [m.end, ub.ground(0, 9)], ["nothing is cut just above the level y = 3 m"]),
        (lambda m, b: [m.start, ub.Beam((0, 0), (0, 1), PLAIN).end], ["is not in the scene"]),
    ],
)
def test_wrong_levels(towers, levels, words):
    with raises(*words):
        st.storeys(towers, levels(towers.scene["mast"], towers.scene["low"]))


def test_levels_may_be_anywhere(towers):
    """Between vertices, at bodies and at the ground; the mast has the only force."""
    mast, block = towers.scene["mast"], towers.scene["block"]
    storeys = st.storeys(towers, [mast.start, mast.at(0.1), block.at(5, 2.0), ub.ground(0, 4)])
    np.testing.assert_allclose(storeys.shear[-1], 3e3, rtol=1e-9)
    np.testing.assert_allclose(storeys.heights, [0.3, 1.7, 2.0])
    assert repr(storeys) == "<Storeys: 3, 2 states>"


# -- tables ------------------------------------------------------------------------------------


def test_tables_are_texts_with_aligned_columns(towers):
    mast = towers.scene["mast"]
    storeys = st.storeys(towers, [mast.start, mast.at(0.2), mast.end])
    lines = str(storeys).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert lines[0].split("  ")[0] == "storey"
    html = storeys._repr_html_()
    assert html.count("<tr>") == 3
    assert "<th>shear [N]</th>" in html


def test_tables_are_frames_of_pandas(towers):
    pandas = pytest.importorskip("pandas")
    mast = towers.scene["mast"]
    frame = st.storeys(towers, [mast.start, mast.at(0.2), mast.end]).frame()
    assert isinstance(frame, pandas.DataFrame)
    np.testing.assert_allclose(frame["shear [N]"], 3e3, rtol=1e-9)


def test_missing_pandas_is_named(towers, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    mast = towers.scene["mast"]
    storeys = st.storeys(towers, [mast.start, mast.end])
    with pytest.raises(ImportError, match=r"needs pandas, .* pip install pandas"):
        storeys.frame()


@pytest.mark.serial
def test_profiles_of_storeys_are_drawn(towers):
    mast = towers.scene["mast"]
    storeys = st.storeys(towers, [mast.start, mast.at(0.2), mast.end])
    for quantity, values in (("drift", 100 * storeys.ratio[-1]), ("shear", [3.0, 3.0])):
        (axes,) = ub.plot(storeys, quantity).axes
        _, largest, least = axes.lines
        np.testing.assert_allclose(largest.get_xdata()[::2], values)
        np.testing.assert_allclose(least.get_xdata(), 0.0)
        np.testing.assert_allclose(largest.get_ydata(), [0.0, 0.6, 0.6, 3.0])
    assert axes.get_xlabel() == "storey shear (kN)"


# -- recorders ---------------------------------------------------------------------------------


@pytest.mark.parametrize("record", ["History", "Extremes"])
def test_statics_have_no_accelerations_to_record(record, towers, shared_path):
    mast = towers.scene["mast"]
    recorder = {
        "History": ub.History(shared_path / "run.csv", accelerations=[mast.end]),
        "Extremes": ub.Extremes(accelerations=True),
    }[record]
    with raises(record, "accelerations", "the run is static"):
        ub.simulate(towers.scene, ub.Static(), t=(0, 1), dt=1.0, record=recorder)


def test_accelerations_that_were_not_recorded(towers):
    with raises("Extremes: accelerations are not recorded", "accelerations=True"):
        ub.Extremes().acceleration(towers.scene["mast"])
