# SPDX-License-Identifier: MIT
"""A long run needs no more memory than a short one."""

import gc
import math
import weakref
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import pytest
from helpers import raises
from scenes import clamped, rigid_chain, swing

import ufl_beam as ub
from ufl_beam.caches import no_garbage_collection
from ufl_beam.compiled import jit

MEBIBYTE = 2**20


def alone(test):
    """On one process, and without the address sanitizer, which keeps freed memory for a while."""
    skipped = pytest.mark.skipif(bool(jit.EXTRA), reason="the sanitizer keeps what is freed")
    return pytest.mark.serial(skipped(test))


def resident():
    """Memory of this process that is in RAM, without garbage; bytes."""
    gc.collect()
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
            self.memory[self.step] = resident()
            self.objects[self.step] = petsc_objects()


def yielding_frame():
    """A frame that yields and breaks, swayed to and fro."""
    section = ub.Section(
        EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01,
        bending=ub.ElastoPlastic(5.0, 2.0), hinge=ub.Softening(8.0, 50.0),
    )  # fmt: skip
    column = ub.Beam((0, 0), (0, 1), section, cells=4)
    girder = ub.Beam((0, 1), (1, 1), section, cells=4)
    sway = ub.PrescribedDisplacement(girder.end, u=lambda t: 0.2 * math.sin(20 * t), v=0)
    return rigid_chain([column, girder], supports=[ub.Clamped(column.start), sway])


@alone
@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
@pytest.mark.parametrize(
    ("scene", "first", "last"), [(swing, 2_000, 10_000), (yielding_frame, 500, 2_000)]
)
def test_memory_does_not_grow(scene, first, last):
    """Steps of 1 ms; 8000 that each left a Python float behind would take 0.2 MB, a vector 2 MB."""
    watch, scheme = Watch({first, last}), ub.EnergyMomentum(alpha=0.05, beta=0.05)
    solution = ub.simulate(scene(), scheme, t=(0, last / 1e3), dt=1e-3, every=last, record=watch)
    assert solution.substeps >= last
    assert watch.memory[last] - watch.memory[first] < 1 * MEBIBYTE
    # The probe itself is one; a step makes none
    assert watch.objects[last] - watch.objects[first] == 1
    if scene is yielding_frame:
        assert min(solution.energy[x][-1] for x in ("plastic", "hinges")) > 1


@alone
def test_memory_does_not_grow_with_the_members_of_a_study():
    """220 members of one structure, each with its own numbers, and hinges."""
    memory = {}

    def member(number):
        section = ub.Section(EA=1e5 + number, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01)
        law = ub.Softening(limit=5.0 + 1e-3 * number, fracture_energy=1.0)
        beam = ub.Beam((0, 0), (1 + 1e-4 * number, 0), section, cells=4, hinges={0.0: law})
        scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, -10.0))])
        solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2e-3), dt=1e-3)
        if number in (100, 219):
            memory[number] = resident()
        return {"end": solution.displacement(beam.end)[-1]}

    study = ub.study(member, [{"number": number} for number in range(220)])
    assert not study.failed
    assert len(set(study["end"][:, 1])) == 220
    # Records of a member take 1 kB; what a simulation holds, some 100 kB, would be 12 MB
    assert memory[219] - memory[100] < 4 * MEBIBYTE


def test_a_closed_simulation_is_freed_at_once():
    """Without the garbage collector; its load, law, guide and controller are functions."""
    section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01)
    beam, body = ub.Beam((0, 0), (1, 0), section, cells=2), ub.Body((1, 0.5), mass=1.0, inertia=0.1)
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
    gc.collect()
    try:
        gc.disable()
        simulation = ub.Simulation(scene, ub.EnergyMomentum(), comm=MPI.COMM_SELF)
        simulation.step_to(0.01)
        simulation.keep()
        solution = simulation.solution
        alive = [weakref.ref(x) for x in (simulation, simulation.equation, simulation.solver)]
        simulation.close()
        del simulation
        assert [part() for part in alive] == [None] * 3
        assert solution.q.shape == (1, solution.numbering.size)
    finally:
        gc.enable()


def test_a_closed_simulation_takes_no_steps():
    simulation = ub.Simulation(swing(), ub.EnergyMomentum(), comm=MPI.COMM_SELF)
    simulation.step_to(0.01)
    simulation.close()
    simulation.close()
    with raises("the simulation is closed"):
        simulation.step_to(0.02)
    assert simulation.t == 0.01
    assert (simulation.now.q[-1] == simulation.q).all()


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_collection_is_as_it_was(enabled):
    try:
        if not enabled:
            gc.disable()
        with pytest.raises(KeyError), no_garbage_collection(), no_garbage_collection():
            raise KeyError if not gc.isenabled() else ValueError
        with raises("no beams"):
            ub.Scene()
        assert gc.isenabled() == enabled
    finally:
        gc.enable()
