# SPDX-License-Identifier: MIT
"""A long run needs no more memory than a short one."""

import gc
import math
import weakref
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import pytest
from scenes import clamped, rigid_chain, swing

import ufl_beam as ub
from ufl_beam.caches import no_garbage_collection
from ufl_beam.compiled import jit

unsanitized = pytest.mark.skipif(
    bool(jit.EXTRA), reason="the address sanitizer keeps what is freed for a while"
)

MEBIBYTE = 2**20


def resident():
    """Memory of this process that is in RAM; bytes."""
    (line,) = [x for x in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in x]
    return int(line.split()[1]) * 1024


def petsc_objects():
    """Number that PETSc gives the next object; it counts all that were ever made."""
    probe = PETSc.Vec().createSeq(1)
    try:
        return probe.id
    finally:
        probe.destroy()


class Watch(ub.extend.Recorder):
    """Measures at some steps."""

    def __init__(self, at):
        self.at, self.step, self.memory, self.objects = at, 0, {}, {}

    def open(self, simulation):
        pass

    def write(self, simulation):
        self.step += 1
        if self.step in self.at:
            gc.collect()
            self.memory[self.step] = resident()
            self.objects[self.step] = petsc_objects()


@unsanitized
@pytest.mark.serial
def test_memory_does_not_grow():
    """The four-beam swing with stiff links, 10 000 steps of 1 ms."""
    watch = Watch({2_000, 10_000})
    scheme = ub.EnergyMomentum(alpha=0.05, beta=0.05)
    solution = ub.simulate(
        swing(rigidity=1e4), scheme, t=(0, 10), dt=1e-3, every=10_000, record=watch
    )
    assert solution.substeps >= 10_000
    # 8000 steps that each left one Python float behind would take 0.2 MB, one vector 2 MB
    assert watch.memory[10_000] - watch.memory[2_000] < 1 * MEBIBYTE
    # The probe itself is one; a step makes none
    assert watch.objects[10_000] - watch.objects[2_000] == 1


@unsanitized
@pytest.mark.serial
@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
def test_memory_does_not_grow_with_inelastic_material():
    """A frame that yields and breaks, swayed to and fro in 2000 steps."""
    section = ub.Section(
        EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01,
        bending=ub.ElastoPlastic(5.0, 2.0), hinge=ub.Softening(8.0, 50.0),
    )  # fmt: skip
    column = ub.Beam((0, 0), (0, 1), section, cells=4, name="column")
    girder = ub.Beam((0, 1), (1, 1), section, cells=4, name="girder")
    sway = ub.PrescribedDisplacement(girder.end, u=lambda t: 0.2 * math.sin(20 * t), v=0)
    scene = rigid_chain([column, girder], supports=[ub.Clamped(column.start), sway])
    watch = Watch({500, 2_000})
    scheme = ub.EnergyMomentum(alpha=0.05, beta=0.05)
    solution = ub.simulate(scene, scheme, t=(0, 2), dt=1e-3, every=2_000, record=watch)
    energy = solution.energy
    assert energy["plastic"][-1] > 1
    assert energy["hinges"][-1] > 1
    # As above
    assert watch.memory[2_000] - watch.memory[500] < 1 * MEBIBYTE
    assert watch.objects[2_000] - watch.objects[500] == 1


@unsanitized
@pytest.mark.serial
def test_a_simulation_gives_everything_back():
    """200 runs one after the other."""
    scene = swing()

    def runs(count):
        for _ in range(count):
            ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2e-3), dt=1e-3)
        gc.collect()
        return resident()

    before = runs(20)
    # Meshes and spaces of a run take some 100 kB: 180 of them would be 18 MB
    assert runs(180) - before < 4 * MEBIBYTE


def called_back():
    """A simulation, alone on each process, whose load, law, guide and controller are functions."""
    section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    body = ub.Body((1, 0.5), mass=1.0, inertia=0.1)
    scene = clamped(
        beam,
        bodies=[body],
        joints=[ub.Guided(body.middle, lambda s: (1.0, 0.5 + s))],
        connectors=[
            ub.Stretch(beam.end, body.middle, ub.ForceLaw(lambda e, de: 30.0 * e + 0.1 * de)),
            ub.Turn(beam.end, body.middle, ub.Controller(lambda now: 0.1 * now.t)),
        ],
        loads=[ub.PointLoad(beam.end, force=(0.0, 1.0), amplitude=lambda t: t)],
    )
    return ub.Simulation(scene, ub.EnergyMomentum(), comm=MPI.COMM_SELF)


def test_a_closed_simulation_is_freed_at_once():
    """Without the garbage collector, which searches all objects of the process."""
    gc.collect()
    try:
        gc.disable()
        simulation = called_back()
        simulation.step_to(0.01)
        simulation.keep()
        solution, parts = simulation.solution, (simulation, simulation.equation, simulation.solver)
        alive = [weakref.ref(part) for part in parts]
        simulation.close()
        del simulation, parts
        assert [part() for part in alive] == [None] * 3
        assert solution.q.shape == (1, solution.numbering.size)
    finally:
        gc.enable()


def test_a_closed_simulation_takes_no_steps():
    simulation = called_back()
    simulation.step_to(0.01)
    simulation.close()
    simulation.close()
    q = simulation.q
    with pytest.raises(ub.ArgumentError, match="the simulation is closed"):
        simulation.step_to(0.02)
    assert simulation.t == 0.01
    assert (simulation.now.q[-1] == q).all()


@unsanitized
@pytest.mark.serial
def test_memory_does_not_grow_with_the_members_of_a_study():
    """400 members of one structure, each with its own numbers, and hinges."""
    memory = {}

    def member(number):
        section = ub.Section(EA=1e5 + number, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01)
        law = ub.Softening(limit=5.0 + 1e-3 * number, fracture_energy=1.0)
        beam = ub.Beam((0, 0), (1 + 1e-4 * number, 0), section, cells=4, hinges={0.0: law})
        load = ub.PointLoad(beam.end, force=(0, -10.0))
        scene = clamped(beam, loads=[load])
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2e-3), dt=1e-3)
        if number in (100, 399):
            gc.collect()
            memory[number] = resident()
        return {"end": solution.displacement(beam.end)[-1]}

    study = ub.study(member, [{"number": number} for number in range(400)])
    assert not study.failed
    assert len(set(study["end"][:, 1])) == 400
    # Records of a member take 1 kB; what a simulation holds, some 100 kB, would be 30 MB
    assert memory[399] - memory[100] < 4 * MEBIBYTE


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_collection_is_as_it_was(enabled):
    try:
        if not enabled:
            gc.disable()
        with pytest.raises(KeyError), no_garbage_collection(), no_garbage_collection():
            raise KeyError if not gc.isenabled() else ValueError
        assert gc.isenabled() == enabled
    finally:
        gc.enable()


def test_a_refused_scene_leaves_garbage_collection_on():
    with pytest.raises(ub.ArgumentError, match="no beams"):
        ub.Scene()
    assert gc.isenabled()
