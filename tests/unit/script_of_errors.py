# SPDX-License-Identifier: MIT
"""Functions of a user that raise on one process or on all; run by test_collective_errors.py.

`mpirun -n 2 python3 script_of_errors.py` prints a line for each case: its name, the exceptions of
all processes; with the arguments CASE and RANK one process fails where processes do not agree.
"""

import math
import sys
import time
from pathlib import Path
from unittest import mock

from mpi4py import MPI

import ufl_beam as ub
from ufl_beam import parallel
from ufl_beam.simulation.step_equation import StepEquation

WORLD = MPI.COMM_WORLD
ALL = -1
parallel.SMALLEST_SUBDOMAIN = 1

SECTION = ub.Section(EA=1e6, GA=1e6, EI=1e2, rhoA=1.0, rhoI=1e-3)
BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=8)


class Unportable(Exception):
    """Other processes cannot make one from its message."""

    def __init__(self, number, text):
        super().__init__(f"{text} {number}")


class Watch(ub.extend.Recorder):
    def __init__(self, at, action):
        self.at, self.action = at, action

    def open(self, sim):
        if self.at == "open":
            self.action()

    def write(self, sim):
        if self.at == "write" and sim.t > 0.02:
            self.action()


class Remembers:
    """A time function whose state cannot be told later."""

    def __init__(self, action):
        self.action = action

    def __call__(self, t):
        return 1.0

    def state(self):
        return self.action()

    def restore(self, state):
        pass


def failure(rank, make):
    """A function of anything that fails on a process, or on all."""

    def fail(*_, **__):
        if rank in (ALL, WORLD.rank):
            raise make()
        return 0.0

    return fail


def run(scene, **more):
    more = {"t": (0, 0.05), "dt": 0.01, **more}
    return ub.simulate(scene, more.pop("scheme", ub.EnergyMomentum()), **more)


def scene(time=lambda t: 1.0, **more):
    more.setdefault("loads", [ub.PointLoad(BEAM.end, force=(0, -1.0), amplitude=time)])
    more.setdefault("supports", [ub.Clamped(BEAM.start)])
    return ub.Scene([BEAM], **more)


def late(function):
    return lambda t: function() if t > 0.025 else 0.0


def load(fail):
    run(scene(late(fail)))


def load_in_statics(fail):
    run(scene(late(fail)), scheme=ub.Static())


def follower(fail):
    run(scene(loads=[ub.FollowerLoad(BEAM.end, force=(0, 1.0), amplitude=late(fail))]))


def gravity(fail):
    run(scene(loads=[ub.Gravity(amplitude=late(fail))]), dt=ub.Adaptive(1e-3))


def prescribed(fail):
    run(scene(supports=[ub.Clamped(BEAM.start), ub.PrescribedDisplacement(BEAM.end, v=late(fail))]))


def connected(law):
    run(scene(connectors=[ub.Stretch(ub.ground(1, 1), BEAM.end, law)]))


def motor(fail):
    connected(ub.PrescribedMotion(late(fail)))


def actuator(fail):
    connected(ub.PrescribedForce(late(fail)))


def controller(fail):
    connected(ub.Controller(lambda sim: fail() if sim.t > 0.02 else 0.0))


def function(fail):
    connected(ub.ForceLaw(lambda motion, rate: fail() if abs(motion) > 1e-5 else 0.0))


def work(fail):
    lift = ub.VirtualWork("lift", lambda w, c: c * w[1], numbers={"c": late(fail)})
    run(scene(works=[lift]))


def recorder(fail):
    run(scene(), record=Watch("write", fail))


def beginning(fail):
    run(scene(), record=Watch("open", fail))


def events(fail):
    stop = ub.Stretch(ub.ground(1, 1), BEAM.end, ub.Stop(low=-1e-9, high=1e-9, stiffness=1.0))
    run(scene(connectors=[stop]), record=ub.Events(tell=fail))


def checkpoint(fail):
    asked, file = [], Path(sys.argv[-1])
    if WORLD.rank == 0:
        file.unlink(missing_ok=True)

    def state():
        asked.append(0)
        return fail() if len(asked) > 1 else 0.0

    run(scene(Remembers(state)), checkpoint=ub.Checkpoint(file, every=2))


def internal_variables(fail):
    """Those of another run, with which this run begins."""
    first = run(scene())
    with mock.patch.object(StepEquation, "set_internal_variables", side_effect=fail):
        run(scene(), start=first)


def path(fail):
    moves = ub.PrescribedDisplacement(BEAM.end, v=lambda t: fail() if t > 0.3 else 0.1 * t)
    ub.follow(scene(loads=[], supports=[ub.Clamped(BEAM.start), moves]), ub.LoadControl(0.1))


EVERYWHERE = [
    load, load_in_statics, gravity, controller, recorder, beginning, checkpoint, internal_variables
]  # fmt: skip
"""Cases whose function is called on all processes."""

SOMEWHERE = [follower, prescribed, motor, actuator, function, work, events, path]
"""Cases whose function is called where the object is."""


def outcomes(case, rank, make):
    """The exceptions of all processes, as text."""
    try:
        case(failure(rank, make))
    except BaseException as error:
        mine = f"{type(error).__name__}: {error}"
    else:
        mine = "nothing"
    return WORLD.allgather(mine)


def nothing_but_numbers(rank):
    """A load that is no number on one process."""
    value = math.nan if rank in (ALL, WORLD.rank) else 1.0
    return outcomes(lambda fail: load(lambda: value), ALL, Exception)


def together():
    def user():
        return RuntimeError("user")

    for case in EVERYWHERE:
        for rank in (ALL, 0, 1):
            ub.print_once(case.__name__, rank, outcomes(case, rank, user), sep="|")
    for case in SOMEWHERE:
        ub.print_once(case.__name__, ALL, outcomes(case, ALL, user), sep="|")
    for kind in (KeyboardInterrupt, lambda: Unportable(7, "number"), lambda: SystemExit("exit")):
        ub.print_once("kind", 1, outcomes(load, 1, kind), sep="|")
    for rank in (ALL, 0, 1):
        ub.print_once("nan", rank, nothing_but_numbers(rank), sep="|")
    ub.print_once("end")


# -- where the processes cannot agree --------------------------------------------------------------


def alone(fail):
    """Outside of any run."""
    fail()
    WORLD.barrier()


def asked(fail):
    """The others ask for what all have to ask for together."""

    def force(sim):
        fail()
        return 1e-3 * sim.displacement(BEAM.end)[0]

    connected(ub.Controller(force))


def building(fail):
    """Before the processes share anything."""
    run(scene(time=fail), start=run(scene()))


if __name__ == "__main__":
    if len(sys.argv) <= 2:
        together()
    else:
        name, rank = sys.argv[1:]
        # Where both fail, nothing need be short, and a busy machine may start them far apart.
        parallel.GRACE = 30.0 if int(rank) < 0 else 0.5
        print(f"begun at {time.time()}", file=sys.stderr, flush=True)
        globals()[name](failure(int(rank), lambda: RuntimeError(f"user, {name}")))
