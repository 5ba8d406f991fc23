# SPDX-License-Identifier: MIT
"""Counterparts of some models in OpenSees, with its usual settings; run in a process of its own.

The steps of the collection under displacement control; in each step Newton's method, and if it
fails three other algorithms, at most 100 iterations each, up to a norm of increments of 1e-8 m and
rad.  A step that fails in all of them ends the run: it is not divided.  Prints the time of the
last step, or null at the end.
"""

import json
import math
import sys

import numpy as np
import openseespy.opensees as ops
from opensees_models import NAMES


def begun():
    """Begin a plane model of beams."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    ops.geomTransf("Corotational", 1)


ALGORITHMS = (("Newton",), ("NewtonLineSearch",), ("KrylovNewton",), ("ModifiedNewton", "-initial"))
"""Tried in this order in each step, as scripts of users do."""


def settings():
    """Set the solver."""
    ops.system("UmfPack")
    ops.numberer("RCM")
    ops.constraints("Transformation")
    ops.test("NormDispIncr", 1e-8, 100)


def step():
    """Take a step; whether an algorithm has solved it."""
    for algorithm in ALGORITHMS:
        ops.algorithm(*algorithm)
        if ops.analyze(1) == 0:
            return True
    return False


def loaded(node, *force):
    """Apply a force in one second, and keep it; whether it is in equilibrium."""
    ops.timeSeries("Linear", 7)
    ops.pattern("Plain", 7, 7)
    ops.load(node, *force)
    return gravity_steps()


def gravity_steps():
    """Let the loads grow in 50 steps, and keep them; whether they are in equilibrium."""
    settings()
    ops.integrator("LoadControl", 1 / 50)
    ops.analysis("Static", "-noWarnings")
    done = all(step() for _ in range(50))
    ops.loadConst("-time", 0.0)
    return done


def driven(node, dof, times, values, steps):
    """Move a node by a table, in steps for each second; the time of the last step, or None.

    The second argument of the script selects displacement control or an imposed motion.
    """
    t = np.linspace(times[0], times[-1], round(steps * (times[-1] - times[0])) + 1)
    path, start = np.interp(t, times, values), ops.nodeDisp(node, dof)
    if imposed := sys.argv[2] == "imposed motion":
        whole = times[-1] - times[0]
        ops.timeSeries("Path", 8, "-dt", 1 / steps, "-values", *map(float, start + path), 0.0)
        ops.pattern("Plain", 8, 8)
        ops.sp(node, dof, 1.0)
    else:
        ops.timeSeries("Linear", 8)
        ops.pattern("Plain", 8, 8)
        ops.load(node, *(float(dof == k) for k in (1, 2, 3)))
    ops.wipeAnalysis()
    settings()
    for n in range(len(t) - 1):
        change = float(path[n + 1] - path[n])
        if imposed:
            ops.integrator("LoadControl", whole / (len(t) - 1))
        else:
            ops.integrator("DisplacementControl", node, dof, change)
        ops.analysis("Static", "-noWarnings")
        if not step() or not abs(ops.nodeDisp(node, dof) - start - path[n + 1]) < 1e-6:
            return float(t[n])
    return None


def turns(sizes):
    """Times and values of cycles."""
    values = [0.0]
    for size in sizes:
        values += [size, -size]
    return list(map(float, range(len(values)))), values


def chain(first, a, b, cells, section):
    """Beams with a section of fibres, two Gauss points each; nodes from ``first`` on."""
    for k, (x, y) in enumerate(np.linspace(a, b, cells + 1)):
        ops.node(first + k, float(x), float(y))
    for k in range(cells):
        ops.element("dispBeamColumn", first + k, first + k, first + k + 1, 1, section)
    return first, first + cells


def concrete(tag, b, h, layers, bars, cover=None, core=None):
    """Section of layers and bars (y, A); materials 1 and, within ``cover``, ``core``."""
    ops.section("Fiber", tag)
    for i in range(layers):
        y = -h / 2 + (i + 0.5) * h / layers
        inside = core is not None and abs(y) < h / 2 - cover
        width = b - 2 * cover if inside else b
        ops.fiber(y, 0.0, width * h / layers, core if inside else 1)
        if inside:
            ops.fiber(y, 0.0, 2 * cover * h / layers, 1)
    for y, area in bars:
        ops.fiber(y, 0.0, area, 3)
    ops.beamIntegration("Legendre", tag, tag, 2)


def steel(limit=450e6):
    """Steel02 of OpenSees issue 1625."""
    ops.uniaxialMaterial("Steel02", 3, limit, 200e9, 0.01, 15.0, 0.925, 0.15)


def hinge(*sizes):
    """The hinge of issue 688 and a cantilever."""
    begun()
    backbone = [0.0173, 0.0401, 0.095, 923.6e3, 1.075, 0.02]
    material = [80e6, *backbone, *backbone, 0.3, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    ops.uniaxialMaterial("IMKBilin", 1, *material)
    for tag, x in ((1, 0.0), (2, 0.0), (3, 1.0)):
        ops.node(tag, x, 0.0)
    ops.fix(1, 1, 1, 1)
    ops.equalDOF(1, 2, 1, 2)
    ops.element("zeroLength", 1, 1, 2, "-mat", 1, "-dir", 6)
    ops.element("elasticBeamColumn", 2, 2, 3, 1.0, 1e10, 3e-2, 1)
    times, values = turns(sizes)
    return driven(3, 2, times, values, 50)


def beam(ultimate):
    """Half of the beam of reinforced concrete, pushed in the middle."""
    begun()
    ops.uniaxialMaterial("Concrete01", 1, -25e6, -0.002, -5e6, -ultimate)
    steel()
    concrete(1, 0.3, 0.5, 30, [(-0.21, 3.6e-3), (0.21, 0.6e-3)])
    first, last = chain(1, (0, 0), (3, 0), 10, 1)
    ops.fix(first, 1, 1, 0)
    ops.fix(last, 0, 0, 1)
    return driven(last, 2, (0.0, 1.0), (0.0, -0.12), 240)


def gravity():
    """A column of Concrete07 under gravity, force-based as in issue 1669, then bent."""
    begun()
    ops.uniaxialMaterial("Concrete07", 1, -30e6, -0.002, 27e9, 1.0, 1e-6, 2.0, 2.3, 2.25)
    steel()
    concrete(1, 0.4, 0.4, 30, [(-0.16, 1e-3), (0.16, 1e-3)])
    ops.beamIntegration("Lobatto", 2, 1, 5)
    ops.node(1, 0.0, 0.0)
    ops.node(2, 0.0, 3.0)
    ops.fix(1, 1, 1, 1)
    ops.element("forceBeamColumn", 1, 1, 2, 1, 2)
    if not loaded(2, 0.0, -0.8e6, 0.0):
        return 0.0
    return driven(2, 1, (1.0, 2.0), (0.0, 0.06), 60)


def frame():
    """Two storeys of reinforced concrete as in issue 1625."""
    begun()
    ops.uniaxialMaterial("Concrete01", 1, -25e6, -0.002, -5e6, -0.0035)
    steel()
    bar = 2 * 0.000113097
    concrete(1, 0.4, 0.6, 20, [(y, bar) for y in (-0.255, -0.085, 0.085, 0.255)])
    ends = {}
    for i in range(2):
        for k in range(2):
            ends[i, k] = chain(20 * (2 * i + k) + 1, (5 * i, 3 * k), (5 * i, 3 * k + 3), 6, 1)
        ops.fix(ends[i, 0][0], 1, 1, 1)
        ops.equalDOF(ends[i, 0][1], ends[i, 1][0], 1, 2, 3)
    girders = []
    for k in range(2):
        first, last = chain(201 + 20 * k, (0, 3 * k + 3), (5, 3 * k + 3), 8, 1)
        ops.equalDOF(ends[0, k][1], first, 1, 2, 3)
        ops.equalDOF(ends[1, k][1], last, 1, 2, 3)
        girders += range(first, last)
    ops.timeSeries("Linear", 7)
    ops.pattern("Plain", 7, 7)
    for one in girders:  # 6 kN/m at the nodes of its cell
        for node in (one, one + 1):
            ops.load(node, 0.0, -6e3 * 5 / 8 / 2, 0.0)
    if not gravity_steps():
        return 0.0
    return driven(ends[0, 1][1], 1, (1.0, 3.0), (0.0, 0.12), 50)


def column():
    """A column of confined and unconfined concrete in cycles."""
    begun()
    cover, core = json.loads(sys.argv[3])
    ops.uniaxialMaterial("Concrete01", 1, *cover)
    ops.uniaxialMaterial("Concrete01", 2, *core)
    steel()
    concrete(1, 0.4, 0.4, 20, [(-0.15, 1e-3), (0.0, 0.6e-3), (0.15, 1e-3)], 0.04, 2)
    first, last = chain(1, (0, 0), (0, 3), 8, 1)
    ops.fix(first, 1, 1, 1)
    if not loaded(last, 0.0, -1.4e6, 0.0):
        return 0.0
    times, sizes = turns((0.015, 0.03, 0.045, 0.06, 0.09))
    return driven(last, 1, [t + 1 for t in times], sizes, 50)


def brace():
    """A tube that buckles and yields."""
    begun()
    ops.uniaxialMaterial("Steel02", 1, 355e6, 210e9, 0.01, 20.0, 0.925, 0.15)
    ops.section("Fiber", 1)
    ops.patch("circ", 1, 24, 1, 0.0, 0.0, 0.064, 0.07, 0.0, 360.0)
    ops.beamIntegration("Legendre", 1, 1, 2)
    for k, s in enumerate(np.linspace(0, 1, 13)):
        ops.node(1 + k, 4 * float(s), 0.008 * math.sin(math.pi * s))
    for k in range(12):
        ops.element("dispBeamColumn", 1 + k, 1 + k, 2 + k, 1, 1)
    ops.fix(1, 1, 1, 0)
    ops.fix(13, 0, 1, 0)
    times, sizes = turns((0.004, 0.008, 0.016, 0.032))
    return driven(13, 1, times, sizes, 100)


RUNS = (
    lambda: hinge(0.01, 0.02, 0.03, 0.05, 0.07, 0.08),
    lambda: hinge(0.02, 0.05, 0.08, 0.11, 0.11),
    lambda: beam(0.02),
    frame,
    gravity,
    column,
    brace,
)
"""Counterparts in the order of their names."""

if __name__ == "__main__":
    print("result", json.dumps(RUNS[NAMES.index(sys.argv[1])]()))
