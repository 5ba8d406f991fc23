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


def recorded(folder, record=(), **more):
    """A run with its recorders of accelerations, at both ends of the mast."""
    scene = shaken()
    mast = scene["mast"]
    table = ub.History(folder / "floors.csv", accelerations=[mast.start, mast.end])
    extremes = ub.Extremes(accelerations=True)
    call = {"t": (0, 0.3), "dt": 0.01, "record": [table, extremes, *record], **more}
    return ub.simulate(scene, ub.EnergyMomentum(), **call), table, extremes


@pytest.mark.parametrize("dt", [0.01, ub.Adaptive(1e-3)], ids=["equal", "adaptive"])
def test_accelerations_are_equal_in_history_extremes_and_solution(dt, shared_path, on_first_rank):
    """To the last bit, also in steps of different lengths, and if only some rows are kept."""
    run, table, extremes = recorded(shared_path, dt=dt)
    mast = run.scene["mast"]
    read = on_first_rank(lambda: np.loadtxt(table.files[0], delimiter=",", skiprows=1))
    rows = read[:, 1:7].reshape(-1, 2, 3)
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


def test_accelerations_of_a_resumed_run_are_those_of_the_whole(shared_path):
    _, _, extremes = recorded(shared_path)
    file = ub.Checkpoint(shared_path / "run.checkpoint", every=7)
    (parts := shared_path / "parts").mkdir(exist_ok=True)
    with pytest.raises(KeyboardInterrupt):
        recorded(parts, [stop_after(11)], checkpoint=file)
    _, table, later = recorded(parts, [stop_after(10**9)], checkpoint=file)
    MPI.COMM_WORLD.barrier()
    assert table.files[0].read_bytes() == (shared_path / "floors.csv").read_bytes()
    for name, values in extremes.state().items():
        np.testing.assert_array_equal(later.state()[name], values)


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
    rows = st.hinge_table(everything, only=(scene["hinge"], scene.connectors[2])).rows
    assert {str(row.where).split()[0] for row in rows} == {"hinge.at(0.5)", "Turn(ground"}
    assert st.hinge_table(everything, only=[scene["elastic"]]).rows == ()


@pytest.mark.parametrize(
    ("limits", "state"), [({"IO": 1.0}, "IO"), ({"IO": 0.01}, "beyond IO"), ({}, "yielded")]
)
def test_states_of_acceptance(everything, limits, state):
    (row,) = st.hinge_table(everything, limits, only=[everything.scene["hinge"]]).rows
    assert row.state == state


def test_limits_that_do_not_increase_are_refused(everything):
    with raises("limits['LS'] = 0.01 rad", "increasing order"):
        st.hinge_table(everything, {"IO": 0.02, "LS": 0.01})


def test_a_hinge_below_its_limit_is_elastic():
    beam = ub.Beam((0, 0), (2, 0), PLAIN, hinges={0.0: ub.ElastoPlastic(1e6)}, name="beam")
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[ub.Gravity()])
    table = st.hinge_table(ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0), LIMITS)
    (row,) = table.rows
    assert (row.n, row.state, row.rotation, row.dissipated) == (-1, "elastic", 0.0, 0.0)
    assert str(table).splitlines()[1].split()[3:] == ["-", "0", "0", "-", "0", "elastic"]
    assert repr(table) == "<HingeTable: 1, 0 yielded>"


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
        (lambda m, b: [m.end, m.start], ["levels[1] = mast.start", "not above levels[0]"]),
        (lambda m, b: [m.start, b.start], ["levels[1] = low.start", "not above"]),
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


def test_tables_are_texts_with_aligned_columns_and_frames_of_pandas(towers, monkeypatch):
    mast = towers.scene["mast"]
    storeys = st.storeys(towers, [mast.start, mast.at(0.2), mast.end])
    lines, html = str(storeys).splitlines(), storeys._repr_html_()
    assert len({len(line) for line in lines}) == 1
    assert lines[0].split("  ")[0] == "storey"
    assert html.count("<tr>") == 3
    assert "<th>shear [N]</th>" in html
    with monkeypatch.context() as without_pandas:
        without_pandas.setitem(sys.modules, "pandas", None)
        with pytest.raises(ImportError, match=r"needs pandas, .* pip install pandas"):
            storeys.frame()
    pandas = pytest.importorskip("pandas")
    frame = storeys.frame()
    assert isinstance(frame, pandas.DataFrame)
    np.testing.assert_allclose(frame["shear [N]"], 3e3, rtol=1e-9)


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


def test_statics_have_no_accelerations_to_record(towers, shared_path):
    mast = towers.scene["mast"]
    table = ub.History(shared_path / "run.csv", accelerations=[mast.end])
    for name, record in (("History", table), ("Extremes", ub.Extremes(accelerations=True))):
        with raises(name, "accelerations", "the run is static"):
            ub.simulate(towers.scene, ub.Static(), t=(0, 1), dt=1.0, record=record)
    with raises("Extremes: accelerations are not recorded", "accelerations=True"):
        ub.Extremes().acceleration(mast)
