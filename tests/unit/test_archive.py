# SPDX-License-Identifier: MIT
"""Solutions in files: what was computed is there again, to the last bit, with its scene.

`properties/test_combinations.py` compares results of loaded solutions of random scenes.
"""

import copy
import json
import math
import pickle
import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises, run
from scenes import clamped

import ufl_beam as ub
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.output.serialization import from_data, to_data

sys.path.insert(0, str(Path(__file__).parents[1] / "properties"))
from restart_scenes import arrays_of, machine

STEEL = {"EA": 1e4, "GA": 1e4, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.1}


def cantilever(**more):
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL), cells=2, name="left")
    load = ub.PointLoad(beam.end, force=(0, -3), amplitude=lambda t: math.sin(3 * t))
    return clamped(beam, loads=[load], **more)


def swing(scene=None, **more):
    return run(cantilever() if scene is None else scene, t=(0, 0.5), **more)


def go_on(solution):
    """A run from the end of a solution, with its scene."""
    return run(solution.scene, t=(0.5, 0.8), start=solution)


def saved(solution, folder):
    # Each process has its own wall time; a file has that of the first
    solution.seconds = MPI.COMM_WORLD.bcast(solution.seconds)
    solution.save(folder / "a.h5")
    return ub.Solution.load(folder / "a.h5")


def same(one, other):
    """Equal to the last bit, and not a number where the other is not."""
    one, other = np.asarray(one), np.asarray(other)
    alike = one.dtype == other.dtype and one.shape == other.shape
    return alike and one.tobytes() == other.tobytes()


def require_same(one, other):
    """Equal arrays, texts, and results that are computed with the scene."""
    assert type(one) is type(other)
    assert one.scene is not other.scene
    assert one.imbalance_message == other.imbalance_message
    # Names of the ledger may have another order on another process than the first
    assert sorted(str(one).split("\n")) == sorted(str(other).split("\n"))
    found, expected = arrays_of(one), arrays_of(other)
    assert found.keys() == expected.keys()
    assert all(same(found[name], expected[name]) for name in found)
    for a, b in zip(one.scene.bodies, other.scene.bodies, strict=True):
        assert same(one.position(a.at(0.3, 1)), other.position(b.at(0.3, 1)))
    for a, b in zip(one.scene.supports, other.scene.supports, strict=True):
        assert same(one.reaction(a), other.reaction(b))
    for a, b in zip(one.scene.all_connectors, other.scene.all_connectors, strict=True):
        assert str(a) == str(b)
        assert all(map(same, one.connector(a), other.connector(b)))
    for a, b in zip(one.scene.beams, other.scene.beams, strict=True):
        assert same(one.shape(a), other.shape(b))
        assert same(one.position(a.at(0.3)), other.position(b.at(0.3)))
        assert same(one.section_forces(a, 1), other.section_forces(b, 1))
        assert same(one.strains(a), other.strains(b))
        if found["material"].size:
            assert all(map(same, one.material(a), other.material(b)))


def test_a_machine_of_everything(shared_path):
    """Beams that yield and break, fibres, bodies, joints, each law, each load, damping."""
    solution = ub.simulate(machine(), ub.EnergyMomentum(0.05, 0.02), t=(0, 0.1), dt=0.005, every=3)
    solution.imbalance_message = "the ledger is open"
    loaded = saved(solution, shared_path)
    require_same(loaded, solution)
    # What is one object in the scene is one in the other
    (friction,) = (c.law for c in loaded.scene.connectors if isinstance(c.law, ub.Coulomb))
    assert friction.joint in loaded.scene.joints
    held = [connector.law is RIGID for connector in solution.scene.all_connectors]
    assert [connector.law is RIGID for connector in loaded.scene.all_connectors] == held
    for quantity in ("M", "shapes", "energy", "damage", "dissipation"):
        ub.plot(loaded, quantity)


def test_a_path_with_its_critical_points(shared_path):
    """Euler's column, from which a branch is followed after it was loaded."""
    beam = ub.Beam((0, 0), (0, 1), ub.Section(EA=1e6, GA=1e6, EI=1.0), cells=4, name="column")
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, -1), amplitude=lambda t: t)])
    path = ub.follow(scene, ub.LoadControl(0.5), steps=8)
    loaded = saved(path, shared_path)
    require_same(loaded, path)
    assert same(loaded.factor, path.factor)
    with_scene = ub.Solution.load(shared_path / "a.h5", scene=scene)
    assert with_scene.critical[0].state.scene is scene
    for copied in (loaded, with_scene, pickle.loads(pickle.dumps(path))):
        for one, other in zip(copied.critical, path.critical, strict=True):
            assert str(one) == str(other)
            assert (one.kind, one.factor, one.n) == (other.kind, other.factor, other.n)
            assert same(one.mode, other.mode)
            assert same(one.state.q, other.state.q)
            numbers, expected = one.state.internal, other.state.internal
            assert all(same(numbers[name], expected[name]) for name in expected)
    assert path.critical


def test_curves_and_meshes(shared_path):
    section = ub.Section(**STEEL)
    arc = ub.Beam.arc((0, 0), 1.0, (0, 1.5), section, cells=3, name="arc")
    line = ub.Beam.polyline([(0, 0), (1, 2), (3, 3)], section, cells=5, name="line")
    wave = ub.Beam.along(lambda s: (s, math.sin(s)), section, cells=3, name="wave")
    beams = [arc, line, wave]
    scene = ub.Scene(beams, supports=[ub.Clamped(b.start) for b in beams], loads=[ub.Gravity()])
    mesh = ub.Mesh(refine=Fraction(2), degree=2)
    solution = run(scene, t=(0, 0.1), dt=0.05, mesh=mesh)
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
    body, base = ub.Body((1.5, 0), mass=1.0, inertia=0.1), cantilever()
    (beam,) = base.beams
    gravity = ub.Gravity(amplitude=ub.ramp(0.2))
    link = ub.Link(beam.end, body.middle)
    solution = swing(clamped(beam, bodies=[body], loads=[gravity], joints=[link]))
    loaded = saved(solution, shared_path)
    assert same(*(go_on(one).q for one in (solution, loaded)))
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


def test_functions_are_known_at_the_times_that_were_kept(shared_path):
    solution = swing()
    load = saved(solution, shared_path).scene.loads[0]
    for t in solution.times:
        assert load.amplitude(t) == math.sin(3 * t)
    with raises("<lambda> is not known at t = 0.07: a file"):
        load.amplitude(0.07)


def test_controllers_are_not_saved(shared_path):
    (beam,) = cantilever().beams
    laws = ub.Controller(lambda now: 0.1 * now.t), ub.ForceLaw(lambda e, rate: 2 * e)
    turns = [ub.Turn(ub.ground(0, 0), beam.end, law) for law in laws]
    solution = swing(clamped(beam, connectors=turns))
    loaded = saved(solution, shared_path)
    require_same(loaded, solution)
    with raises("<lambda> is not in the file of the solution"):
        swing(loaded.scene)


def test_beams_and_bodies_by_name():
    scene = machine()
    assert scene["left"] is scene.beams[1]
    assert scene["b"] is scene.bodies[1]
    with raises("bodies are called 'roof'; the names are"):
        scene["roof"]
    two = [ub.Beam((0, k), (1, k), ub.Section(**STEEL)) for k in (0, 1)]
    with raises("2 beams and bodies are called 'beam'"):
        ub.Scene(two)["beam"]


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
    return clamped(beam, loads=[load], connectors=[turn])


def test_laws_of_a_user_need_the_scene_of_the_script(shared_path):
    """The solution has that scene, with its functions: a run can go on from it."""
    solution, path = swing(of_ones_own()), shared_path / "a.h5"
    solution.save(path)
    with raises(
        "a.h5: the scene has the class Odd of your own (module test_archive), and files have no "
        "code; load it with the scene of the script, ub.Solution.load(path, scene=scene)"
    ):
        ub.Solution.load(path)
    with raises("has the class Odd of your own"):
        pickle.dumps(solution)
    scene = of_ones_own()
    loaded = ub.Solution.load(path, scene=scene)
    assert loaded.scene is scene
    solution.seconds = loaded.seconds
    require_same(loaded, solution)
    assert solution.energy.lost["plastic"][-1] > 0
    assert same(*(go_on(one).q for one in (solution, loaded)))


def test_another_scene_is_refused(shared_path):
    swing(of_ones_own()).save(shared_path / "a.h5")
    remedy = "; give the scene of that run, or load the file without scene="
    for other, *words in (
        (of_ones_own(factor=2.0), "['factor'] is 2.0, in the file 1.0"),
        (of_ones_own(force=-4.0), "[1] is -4.0, in the file -3.0"),
        (of_ones_own(wave=4.0), "['values'][", "] is ", ", in the file"),
        (cantilever(), "another scene: its beams, cells, bodies or joints differ"),
    ):
        with raises(*words, remedy):
            ub.Solution.load(shared_path / "a.h5", scene=other)


def test_others_can_read_it(shared_path, on_first_rank):
    """The last file of a name, and there is no other file."""
    swing().save(shared_path / "a.h5")
    solution = swing(every=2)
    require_same(saved(solution, shared_path), solution)

    def motion():
        with np.load(shared_path / "a.h5") as file:
            return file["history/q"]

    assert same(on_first_rank(motion), solution.q)
    assert on_first_rank(lambda: [path.name for path in shared_path.iterdir()]) == ["a.h5"]


def test_what_cannot_be_saved(shared_path):
    solution = swing()
    with raises("there is no directory"):
        solution.save(shared_path / "nowhere" / "a.h5")
    with raises("save: path = 3 must be the name of a file"):
        solution.save(3)
    with raises("cannot be saved: object is no record of numbers"):
        to_data(object())


def test_the_version_is_the_one_of_the_project():
    project = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    assert f'\nversion = "{ub.__version__}" ' in project
