# SPDX-License-Identifier: MIT
"""Run a translated case in OpenSees, in a process of its own.

The case is read from the standard input.  All cases have one strategy, which is usual: in each
step Newton's method and, if it fails, three other algorithms, 100 iterations each, up to a norm
of increments of 1e-8 m and rad.  If all fail, the step is halved, and halves again, up to 64
parts.  A part that fails ends the run.
"""

import json
import sys
import time
from functools import partial

import openseespy.opensees as ops

ALGORITHMS = (("Newton",), ("NewtonLineSearch",), ("KrylovNewton",), ("ModifiedNewton", "-initial"))
"""Algorithms in the order in which a step tries them."""

ITERATIONS = 50
"""Largest number of iterations of an algorithm."""

HALVINGS = 6
"""Largest number of times that a step is halved."""

MOST = 5000
"""Largest number of steps of a path."""

SERIES = 1000
"""First tag of time series and patterns."""


class Failure(Exception):
    """A step that no algorithm solves."""


def settings(kind):
    """Set the solver of an analysis."""
    ops.wipeAnalysis()
    ops.system("UmfPack")
    ops.numberer("RCM")
    ops.constraints("Transformation")
    ops.test("NormDispIncr", 1e-8, ITERATIONS)
    ops.algorithm("Newton")
    ops.integrator(*(("Newmark", 0.5, 0.25) if kind == "Transient" else ("LoadControl", 0.0)))
    ops.analysis(kind, "-noWarnings")


def solved(size, begin):
    """Take a step; whether an algorithm has solved it."""
    for algorithm in ALGORITHMS:
        arguments = begin(size)
        ops.algorithm(*algorithm)
        if ops.analyze(1, *arguments) == 0:
            return True
    return False


def advance(size, begin, halvings=HALVINGS):
    """Take a step, halved if necessary; whether it was."""
    if solved(size, begin):
        return False
    if not halvings:
        raise Failure
    for _ in range(2):
        advance(size / 2, begin, halvings - 1)
    return True


def by_time(size):
    """Begin a step of statics in time."""
    ops.integrator("LoadControl", size)
    return ()


def by_dynamics(size):
    """Begin a step of dynamics."""
    return (size,)


def by_displacement(node, dof, size):
    """Begin a step under displacement control."""
    ops.integrator("DisplacementControl", node, dof, size)
    return ()


def by_arc(size):
    """Begin a step of the arc length."""
    ops.integrator("ArcLength", size, 0.0)
    return ()


def pattern(tag, values, dt):
    """Begin a pattern with the values of its factor at the ends of steps."""
    ops.timeSeries("Path", tag, "-dt", dt, "-values", *values, values[-1], values[-1])
    ops.pattern("Plain", tag, tag)


def load(forces):
    """Apply forces at nodes."""
    for node, *force in forces:
        ops.load(node, *force)


def value(what, *of, control=""):
    """Return the present value of a quantity."""
    if what == "displacement":
        return ops.nodeDisp(of[1], of[0])
    if what == "force":
        return ops.eleResponse(of[0], "material", "1", "stress")[0]
    if what == "factor" or control == "displacement control":
        return ops.getLoadFactor(SERIES)
    ops.reactions()
    return sum(ops.nodeReaction(node, of[0]) for node in of[1:])


def along(path, forces, keep):
    """Follow a path until a quantity falls below its limit."""
    settings("Static")
    ops.timeSeries("Linear", SERIES)
    ops.pattern("Plain", SERIES, SERIES)
    load(forces)
    begin = partial(by_displacement, *path["at"]) if "at" in path else by_arc
    before = now = 0.0
    for _ in range(MOST):
        if path["limit"] > now < before:
            return
        yield advance(path["size"], begin)
        before, now = now, value(*path["end"])
        keep()
    raise Failure


def run(model, control, values):
    """Run a model; append the compared quantity after each step; yield whether it was halved."""
    ops.wipe()
    for name, *arguments in model["commands"]:
        getattr(ops, name)(*arguments)
    dt, steps = model["dt"], model["steps"]
    values.append(0.0)

    def keep():
        values.append(value(*model["watched"], control=control))

    if model["rest"]:
        settings("Static")
        pattern(SERIES - 1, [0.0, 1.0], 1.0)
        for forces in model["rest"]:
            load(forces)
        for _ in range(4):
            yield advance(0.25, by_time)
        ops.loadConst("-time", 0.0)
        values[0] = value(*model["watched"])
    if path := model["path"]:
        yield from along(path, model["patterns"][0]["loads"], keep)
        return
    for k, one in enumerate(model["patterns"]):
        pattern(SERIES + 1 + k, one["values"], dt)
        load(one["loads"])
    if model["dynamic"]:
        settings("Transient")
        for _ in range(steps):
            yield advance(dt, by_dynamics)
            keep()
        return
    settings("Static")
    if control == "displacement control":
        (motion,) = model["motions"]
        at = (node, dof) = motion["node"], motion["dof"]
        path = motion["values"]
        first = next(k for k, value in enumerate(path) if value) - 1
        for _ in range(first or bool(model["patterns"])):
            yield advance(dt, by_time)
            values += [0.0] * bool(first)
        ops.loadConst("-time", 0.0)
        ops.timeSeries("Linear", SERIES)
        ops.pattern("Plain", SERIES, SERIES)
        ops.load(node, *(float(dof == k) for k in (1, 2, 3)))
        settings("Static")
        start = ops.nodeDisp(*at)
        for n in range(first, steps):
            yield advance(path[n + 1] - path[n], partial(by_displacement, *at))
            if not abs(ops.nodeDisp(*at) - start - path[n + 1]) < 1e-6:
                raise Failure
            keep()
        return
    for k, motion in enumerate(model["motions"]):
        pattern(SERIES + 100 + k, motion["values"], dt)
        ops.sp(motion["node"], motion["dof"], 1.0)
    for _ in range(steps):
        yield advance(dt, by_time)
        keep()


def main():
    """Run the case of the standard input under the control of the first argument."""
    model, begin = json.load(sys.stdin), time.perf_counter()
    values: list = []
    result = {"end": None, "halved": 0, "values": values}
    try:
        for halved in run(model, sys.argv[1], values):
            result["halved"] += halved
    except Failure:
        if model["path"]:
            result["end"] = ops.getLoadFactor(SERIES)
        elif sys.argv[1] == "displacement control":
            result["end"] = (len(values) - 1) * model["dt"]
        else:
            result["end"] = ops.getTime()
    print("result", json.dumps(result | {"seconds": time.perf_counter() - begin}))


if __name__ == "__main__":
    main()
