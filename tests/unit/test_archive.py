# SPDX-License-Identifier: MIT
"""Solutions in files: what was computed is there again, to the last bit, with its scene."""

import copy
import json
import math
import os
import pickle
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.output.serialization import RECORDS, from_data, to_data

sys.path.insert(0, str(Path(__file__).parents[1] / "properties"))
from restart_scenes import bend, machine

STEEL = {"EA": 1e4, "GA": 1e4, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.1}


def cantilever(**more):
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL), cells=2, name="left")
    load = ub.PointLoad(beam.end, force=(0, -3), amplitude=lambda t: math.sin(3 * t))
    return clamped(beam, loads=[load], **more)


def swing(scene=None, **more):
    return ub.simulate(
        cantilever() if scene is None else scene,
        ub.EnergyMomentum(), t=(0, 0.5), dt=0.1, **more,
    )  # fmt: skip


def saved(solution, folder):
    # Each process has its own wall time; a file has that of the first
    solution.seconds = MPI.COMM_WORLD.bcast(solution.seconds)
    solution.save(folder / "a.h5")
    return ub.Solution.load(folder / "a.h5")


def same(one, other):
    """Equal to the last bit, and not a number where the other is not."""
    one, other = np.asarray(one), np.asarray(other)
    return (
        one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    )


def places(scene):
    """Some places of a scene, in its order."""
    found = [place for beam in scene.beams for place in (beam.start, beam.at(0.3), beam.end)]
    return [*found, *(body.middle for body in scene.bodies), *(b.at(0.3, 1) for b in scene.bodies)]


def require_same(one, other):
    """All that solutions offer."""
    assert type(one) is type(other)
    assert one.scene is not other.scene
    # Names of the ledger may have another order on another process than the first
    assert sorted(str(one).split("\n")) == sorted(str(other).split("\n"))
    for name in ("substeps", "iterations", "seconds", "every", "imbalance_message"):
        assert getattr(one, name) == getattr(other, name), name
    for name in ("times", "q", "v"):
        assert same(getattr(one, name), getattr(other, name)), name
    for a, b in zip(places(one.scene), places(other.scene), strict=True):
        assert str(a) == str(b)
        assert same(one.displacement(a), other.displacement(b))
        assert same(one.position(a), other.position(b))
        if len(one.v):
            assert same(one.velocity(a), other.velocity(b))
    if len(one.v):
        assert same(one.momentum(), other.momentum())
    for a, b in zip(one.scene.supports, other.scene.supports, strict=True):
        assert same(one.reaction(a), other.reaction(b))
    for a, b in zip(one.scene.all_connectors, other.scene.all_connectors, strict=True):
        assert str(a) == str(b)
        for x, y in zip(one.connector(a), other.connector(b), strict=True):
            assert same(x, y)
    for a, b in zip(one.scene.beams, other.scene.beams, strict=True):
        assert same(one.shape(a), other.shape(b))
        assert same(one.section_forces(a, 1), other.section_forces(b, 1))
        assert same(one.section_forces_at(a.end), other.section_forces_at(b.end))
        assert same(one.strains(a), other.strains(b))
        if one.history()["material"].size:
            for x, y in zip(one.material(a), other.material(b), strict=True):
                assert same(x, y)
    for kind in ("state", "supplied", "lost"):
        here, there = getattr(one.energy, kind), getattr(other.energy, kind)
        assert sorted(here) == sorted(there)
        assert all(same(here[name], there[name]) for name in here)
    assert sorted(one.internal) == sorted(other.internal)
    assert all(same(one.internal[name], other.internal[name]) for name in one.internal)


# -- solutions -------------------------------------------------------------------------------------


def test_a_machine_of_everything(shared_path):
    """Beams that yield and break, fibres, bodies, joints, each law, each load, damping."""
    solution = ub.simulate(machine(), ub.EnergyMomentum(0.05, 0.02), t=(0, 0.1), dt=0.005, every=3)
    loaded = saved(solution, shared_path)
    require_same(loaded, solution)
    for a, b in zip(solution.scene.joints, loaded.scene.joints, strict=True):
        try:
            expected = solution.joint(a)
        except ub.ArgumentError as error:
            with pytest.raises(ub.ArgumentError, match=re.escape(str(error))):
                loaded.joint(b)
            continue
        for x, y in zip(expected, loaded.joint(b), strict=True):
            # Directions of a guide curve come from samples, a thousandth of its length apart
            np.testing.assert_allclose(x, y, rtol=0, atol=1e-9 * np.nan_to_num(np.abs(x)).max())
    # What is one object in the scene is one in the other
    (friction,) = (c.law for c in loaded.scene.connectors if isinstance(c.law, ub.Coulomb))
    assert friction.joint in loaded.scene.joints
    held = [connector.law is RIGID for connector in solution.scene.all_connectors]
    assert [connector.law is RIGID for connector in loaded.scene.all_connectors] == held
    for picture in (
        lambda s: ub.plot(s, "M"),
        lambda s: ub.plot(s, "shapes"),
        lambda s: ub.plot(s, "energy"),
        lambda s: ub.plot(s, "history", [s.scene["right"].end]),
        lambda s: ub.plot(s, "damage"),
        lambda s: ub.plot(s, "dissipation"),
        lambda s: ub.plot(s, "moment-curvature", s.scene["right"].at(0.1)),
    ):
        picture(loaded)


def test_plastic_hinges_at_places_and_an_open_ledger(shared_path):
    section = ub.Section(**STEEL, hinge=ub.Softening(2.0, 1.0))
    hinges = {0.5: ub.ElastoPlastic(yield_limit=1.0, isotropic=3.0)}
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, name="left", hinges=hinges)
    load = ub.PointLoad(beam.end, force=(0, -6), amplitude=lambda t: t)
    scene = clamped(beam, loads=[load])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=0.02)
    solution.imbalance_message = "the ledger is open"
    loaded = saved(solution, shared_path)
    require_same(loaded, solution)
    assert max(abs(loaded.connector(loaded.scene.hinges[0]).motion)) > 0
    for s in (0.0, 0.5):
        at, other = (one.material_at(one.scene["left"].at(s)) for one in (loaded, solution))
        assert all(same(x, y) for x, y in zip(at, other, strict=True))


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()])
def test_a_static_solution_is_saved_whole(scheme, shared_path):
    solution = ub.simulate(bend(), scheme, t=(0, 5), dt=0.1)
    require_same(saved(solution, shared_path), solution)


def test_a_path_with_its_critical_points(shared_path):
    """Euler's column, from which a branch is followed after it was loaded."""
    beam = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e6, GA=1e6, EI=1.0), cells=4, name="column")
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, -1), amplitude=lambda t: t)])
    path = ub.follow(scene, ub.LoadControl(0.5), steps=8)
    loaded = saved(path, shared_path)
    require_same(loaded, path)
    assert same(loaded.factor, path.factor)
    assert (
        [str(point) for point in loaded.critical] == [str(point) for point in path.critical] != []
    )
    for one, other in zip(loaded.critical, path.critical, strict=True):
        assert (one.kind, one.factor, one.n) == (other.kind, other.factor, other.n)
        assert same(one.mode, other.mode)
        assert same(one.state.q, other.state.q)
        assert all(same(one.state.internal[n], other.state.internal[n]) for n in one.state.internal)
    pickled = pickle.loads(pickle.dumps(path))
    assert same(pickled.critical[0].mode, path.critical[0].mode)


def test_curves_and_meshes(shared_path):
    section = ub.Section(**STEEL)
    arc = ub.Beam.arc((0, 0), 1.0, (0, 1.5), section, cells=3, name="arc")
    line = ub.Beam.polyline([(0, 0), (1, 2), (3, 3)], section, cells=5, name="line")
    wave = ub.Beam.along(lambda s: (s, math.sin(s)), section, cells=3, name="wave")
    beams = [arc, line, wave]
    scene = ub.Scene(beams, supports=[ub.Clamped(b.start) for b in beams], loads=[ub.Gravity()])
    mesh = ub.Mesh(refine=Fraction(2), degree=2)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.05, mesh=mesh)
    loaded = saved(solution, shared_path)
    require_same(loaded, solution)
    assert loaded.numbering.mesh == mesh
    for s in (0.1, 0.123, 0.9):
        for beam in beams[:2]:
            assert loaded.scene[beam.name].at(s).point == beam.at(s).point
        # Cubic between samples of 1e-3: its error is a 1e-12th of the fourth derivative
        assert loaded.scene["wave"].at(s).point == pytest.approx(wave.at(s).point, abs=1e-12)


def test_runs_and_modes_go_on_from_a_loaded_solution(shared_path):
    """With a scene whose functions are records the run goes on as from the solution itself."""
    body = ub.Body((1.5, 0), mass=1.0, inertia=0.1)
    base = cantilever()
    beam = base.beams[0]
    scene = ub.Scene(
        base.beams, bodies=[body], supports=base.supports,
        loads=[ub.Gravity(amplitude=ub.ramp(0.2))],
        joints=[ub.Link(beam.end, body.middle)],
    )  # fmt: skip
    solution = swing(scene)
    loaded = saved(solution, shared_path)
    runs = [
        ub.simulate(one.scene, ub.EnergyMomentum(), t=(0.5, 0.8), dt=0.1, start=one)
        for one in (solution, loaded)
    ]
    assert same(runs[0].q, runs[1].q)
    assert same(*(ub.modes(one.scene, 2, at=one).omega for one in (solution, loaded)))


def test_solutions_can_be_pickled_and_copied():
    solution = swing()
    require_same(pickle.loads(pickle.dumps(solution)), solution)
    require_same(copy.deepcopy(solution), solution)


def test_shapes_that_are_no_runs(shared_path):
    motion = ub.modes(cantilever(), 1).motion(0, count=4)
    loaded = saved(motion, shared_path)
    assert same(loaded.q, motion.q)
    assert same(loaded.times, motion.times)


# -- functions -------------------------------------------------------------------------------------


def test_functions_are_known_at_the_times_that_were_kept(shared_path):
    solution = swing()
    load = saved(solution, shared_path).scene.loads[0]
    for t in solution.times:
        assert load.amplitude(t) == math.sin(3 * t)
    with pytest.raises(ub.ArgumentError, match=r"<lambda> is not known at t = 0\.07: a file"):
        load.amplitude(0.07)


def test_controllers_are_not_saved(shared_path):
    base = cantilever()
    turn = ub.Turn(ub.ground(0, 0), base.beams[0].end, ub.Controller(lambda now: 0.1 * now.t))
    spring = ub.Turn(ub.ground(0, 0), base.beams[0].end, ub.ForceLaw(lambda e, rate: 2 * e))
    scene = ub.Scene(base.beams, supports=base.supports, connectors=[turn, spring])
    solution = swing(scene)
    loaded = saved(solution, shared_path)
    require_same(loaded, solution)
    with pytest.raises(ub.ArgumentError, match="<lambda> is not in the file of the solution"):
        swing(loaded.scene)


# -- names -----------------------------------------------------------------------------------------


def test_beams_and_bodies_by_name():
    scene = machine()
    assert scene["left"] is scene.beams[1]
    assert scene["b"] is scene.bodies[1]
    with pytest.raises(ub.ArgumentError, match="bodies are called 'roof'; the names are"):
        scene["roof"]
    two = [ub.Beam((0, k), (1, k), ub.Section(**STEEL)) for k in (0, 1)]
    with pytest.raises(ub.ArgumentError, match="2 beams and bodies are called 'beam'"):
        ub.Scene(two)["beam"]


# -- what is in the scene --------------------------------------------------------------------------


def test_numbers_are_exact():
    law = ub.ElastoPlastic(
        yield_limit=math.inf, isotropic=0.1, kinematic=1 / 3, viscosity=ub.Perzyna(1e-300)
    )
    spring = ub.Spring(math.nextafter(1, 2), law, ub.LinearSoftening(0.1, 1e22))
    assert from_data(json.loads(json.dumps(to_data(spring)))) == spring
    stop = ub.Stop(2, low=-math.inf, high=0.0)
    assert from_data(json.loads(json.dumps(to_data(stop)))) == stop
    random = ub.distributions.TruncatedNormal(1.0, 0.1, seed=7)
    assert from_data(to_data(random)) == random


def test_each_record_of_the_package_can_be_saved():
    assert {"Beam", "Body", "Clamped", "Rigid", "Scene", "Table", "Turn"} <= set(RECORDS)
    assert all(kind.__module__.startswith("ufl_beam.") for kind in RECORDS.values())


@dataclass(frozen=True)
class Odd(ub.ElastoPlastic):
    """A law of a user."""

    factor: float = 1.0


def of_ones_own(factor=1.0, force=-3.0, wave=3.0):
    """A cantilever with a law, a controller and a function of the script."""
    section = ub.Section(**STEEL, bending=Odd(yield_limit=0.5, isotropic=10.0, factor=factor))
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, name="left")
    load = ub.PointLoad(beam.end, force=(0, force), amplitude=lambda t: math.sin(wave * t))
    turn = ub.Turn(ub.ground(0, 0), beam.end, ub.Controller(lambda now: 0.1 * now.t))
    scene = {"supports": [ub.Clamped(beam.start)], "loads": [load], "connectors": [turn]}
    return ub.Scene([beam], **scene)


def test_laws_of_a_user_need_the_scene_of_the_script(shared_path):
    """The solution has that scene, with its functions: a run can go on from it."""
    solution, path = swing(of_ones_own()), shared_path / "a.h5"
    solution.save(path)
    with pytest.raises(
        ub.ArgumentError,
        match=r"a\.h5: the scene has the class Odd of your own \(module test_archive\), and files "
        r"have no code; load it with the scene of the script, "
        r"ub\.Solution\.load\(path, scene=scene\)$",
    ):
        ub.Solution.load(path)
    scene = of_ones_own()
    loaded = ub.Solution.load(path, scene=scene)
    assert loaded.scene is scene
    solution.seconds = loaded.seconds
    require_same(loaded, solution)
    assert solution.energy.lost["plastic"][-1] > 0
    runs = [
        ub.simulate(one.scene, ub.EnergyMomentum(), t=(0.5, 0.8), dt=0.1, start=one)
        for one in (solution, loaded)
    ]
    assert same(runs[0].q, runs[1].q)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (lambda: of_ones_own(factor=2.0), r"\['factor'\] is 2\.0, in the file 1\.0"),
        (lambda: of_ones_own(force=-4.0), r"\[1\] is -4\.0, in the file -3\.0"),
        (lambda: of_ones_own(wave=4.0), r"\['values'\]\[\d\] is .*, in the file"),
        (cantilever, "is a solution of another scene: its beams, cells, bodies or joints differ"),
    ],
    ids=["law", "load", "function", "scene"],
)
def test_another_scene_is_refused(other, message, shared_path):
    swing(of_ones_own()).save(shared_path / "a.h5")
    remedy = r"give the scene of that run, or load the file without scene=$"
    with pytest.raises(ub.ArgumentError, match=f"{message}.*; {remedy}"):
        ub.Solution.load(shared_path / "a.h5", scene=other())


def test_a_path_is_loaded_with_the_scene_of_the_script(shared_path):
    """As other solutions are, to follow a branch with functions of the script."""
    beam = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e6, GA=1e6, EI=1.0), cells=4, name="column")
    load = ub.PointLoad(beam.end, force=(0, -1), amplitude=lambda t: t)
    scene = clamped(beam, loads=[load])
    path = ub.follow(scene, ub.LoadControl(0.5), steps=8)
    path.save(shared_path / "a.h5")
    loaded = ub.Solution.load(shared_path / "a.h5", scene=scene)
    assert loaded.critical[0].state.scene is scene
    assert same(loaded.critical[0].mode, path.critical[0].mode)


def test_laws_of_a_user_are_not_pickled():
    with pytest.raises(ub.ArgumentError, match="has the class Odd of your own"):
        pickle.dumps(swing(of_ones_own()))


def test_objects_that_are_no_dataclasses_are_refused():
    with pytest.raises(ub.ArgumentError, match="cannot be saved: object is no record of numbers"):
        to_data(object())


# -- files -----------------------------------------------------------------------------------------


def test_others_can_read_it(shared_path, on_first_rank):
    solution = swing()
    solution.save(shared_path / "a.h5")

    def motion():
        with np.load(shared_path / "a.h5") as file:
            return file["history/q"]

    assert same(on_first_rank(motion), solution.q)
    assert on_first_rank(lambda: [path.name for path in shared_path.iterdir()]) == ["a.h5"]


def test_a_second_file_replaces_the_first(shared_path):
    swing().save(shared_path / "a.h5")
    solution = swing(every=2)
    require_same(saved(solution, shared_path), solution)


def test_paths_that_cannot_be_written(shared_path):
    solution = swing()
    with pytest.raises(ub.ArgumentError, match="there is no directory"):
        solution.save(shared_path / "nowhere" / "a.h5")
    with pytest.raises(ub.ArgumentError, match="save: path = 3 must be the name of a file"):
        solution.save(3)


# -- version ---------------------------------------------------------------------------------------


def test_the_version_is_the_one_of_the_project():
    project = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    (cached_forms,) = re.findall(r'^version = "([^"]+)"', project, re.MULTILINE)
    assert ub.__version__ == cached_forms


@pytest.mark.serial
def test_version_of_an_installed_package(tmp_path, monkeypatch):
    """Without a source tree around it the package asks its metadata."""
    (tmp_path / "ufl_beam-9.8.7.dist-info").mkdir()
    text = "Metadata-Version: 2.1\nName: ufl_beam\nVersion: 9.8.7\n"
    (tmp_path / "ufl_beam-9.8.7.dist-info" / "METADATA").write_text(text)
    shutil.copytree(Path(__file__).parents[2] / "ufl_beam", tmp_path / "ufl_beam")
    command = [sys.executable, "-c", "import ufl_beam; print(ufl_beam.__version__)"]
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "9.8.7\n"
