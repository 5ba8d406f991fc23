# SPDX-License-Identifier: MIT
"""The structures in OpenSees: zero-length sections, fibre elements, and hinges of one law each."""

from itertools import pairwise

import numpy as np
import openseespy.opensees as ops
from stopwatch import Stopwatch
from structures import CURVATURES, SECTIONS, Column, Frame, Hinge

VERSION = f"OpenSees {ops.version()}"


def section_of(p):
    """Create section 1 and the laws of its fibres."""
    s = p.steel
    ops.uniaxialMaterial(
        "Steel02", 1, s["yield_limit"], p.bars, s["hardening"], 20.0, 0.925, 0.15,
        s["a1"], s["a2"], s["a3"], s["a4"],
    )  # fmt: skip
    tags = {"steel": 1}
    for name in ("cover", "core"):
        if hasattr(p, name):
            c, tags[name] = getattr(p, name), len(tags) + 1
            peak = 2 * c["strength"] / p.concrete
            ops.uniaxialMaterial(
                "Concrete01", tags[name], -c["strength"], -peak, -c["residual"], -c["ultimate"]
            )
    ops.section("Fiber", 1)
    for y, A, material in p.fibres():
        ops.fiber(y, 0.0, A, tags[material])


def prepare(tolerance=1e-9):
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", tolerance, 50, 0)
    ops.algorithm("Newton")


def follow(steps, step, read):
    """Values after each step, of which the steps alone are timed; step: 0 if it succeeds."""
    values, stopwatch, said = [read()], Stopwatch(), {}
    for i in range(steps):
        with stopwatch:
            failed = step(i)
        if failed:
            said = {"failed": f"stopped at step {i + 1} of {steps}"}
            break
        values.append(read())
    return values, {"steps": len(values) - 1, **said, **stopwatch.read()}


def constant(load):
    """Apply a load, then keep it."""
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    load()
    prepare()
    ops.integrator("LoadControl", 0.1)
    ops.analysis("Static")
    if ops.analyze(10):
        raise RuntimeError("the constant load is not borne")
    ops.loadConst("-time", 0.0)
    ops.wipeAnalysis()
    prepare()


def section(kind):
    p = SECTIONS[kind]
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    section_of(p)
    ops.node(1, 0.0, 0.0)
    ops.node(2, 0.0, 0.0)
    ops.fix(1, 1, 1, 1)
    ops.fix(2, 0, 1, 0)
    ops.element("zeroLengthSection", 1, 1, 2, 1)
    constant(lambda: ops.load(2, p.N, 0.0, 0.0))
    n = len(CURVATURES) - 1
    path = ("-time", *map(float, range(n + 1)), "-values", *map(float, CURVATURES))
    ops.timeSeries("Path", 2, *path)
    ops.pattern("Plain", 2, 2)
    ops.sp(2, 3, 1.0)
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    values, result = follow(
        n, lambda _: ops.analyze(1), lambda: ops.eleResponse(1, "section", "force")[1]
    )
    return result | {"values": {"moment": values}}


def column(cells, kind):
    p = SECTIONS["concrete"]
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    section_of(p)
    ops.geomTransf("Corotational", 1)
    ops.beamIntegration("Legendre", 1, 1, 2)
    for i in range(cells + 1):
        ops.node(i + 1, 0.0, Column.length * i / cells)
    for i in range(cells):
        ops.element(kind, i + 1, i + 1, i + 2, 1, 1)
    ops.fix(1, 1, 1, 1)
    top = cells + 1
    constant(lambda: ops.load(top, 0.0, p.N, 0.0))

    # With prescribed displacements Newton's method fails, at the latest where they turn back.
    ops.timeSeries("Linear", 2)
    ops.pattern("Plain", 2, 2)
    ops.load(top, 1.0, 0.0, 0.0)
    ops.test("NormDispIncr", 1e-8, 50, 0)
    moves, repeated = np.diff(Column.moves), set()

    def step(i):
        """Take the step, after a failure with other algorithms or in ten or hundred parts."""
        for parts in (1, 10, 100):
            ops.integrator("DisplacementControl", top, 1, float(moves[i]) / parts)
            done = 0
            for algorithm in ("NewtonLineSearch", "Newton", "KrylovNewton", "ModifiedNewton"):
                ops.algorithm(algorithm)
                ops.analysis("Static")
                while done < parts and not ops.analyze(1):
                    done += 1
                if done < parts:
                    repeated.add(i)
            if done:
                return done < parts
        return 1

    values, result = follow(len(moves), step, lambda: ops.getLoadFactor(2))
    return result | {"repeated": len(repeated), "values": {"force": values}}


def hinge(kind, largest, lost):
    h = Hinge
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    backbone = (
        h.capping, h.post_capping, h.ultimate, h.limit, h.overstrength, h.residual
    )  # fmt: skip
    # Zero is no energy at all in IMKBilin: a large number stands for no deterioration.
    lost = [x or 1e9 for x in lost]
    if kind == "IMKBilin":
        del lost[2]
    more = (h.kappa_F, h.kappa_D) if kind == "IMKPinching" else ()
    ops.uniaxialMaterial(
        kind, 1, h.stiffness, *backbone, *backbone, *lost, *[1.0] * len(lost), 1.0, 1.0,
        *more,
    )  # fmt: skip
    ops.testUniaxialMaterial(1)
    stopwatch, moments = Stopwatch(), []
    with stopwatch:
        for x in h.rotations(largest):
            ops.setStrain(float(x))
            moments.append(ops.getStress())
    return {"values": {"moment": moments}, **stopwatch.read()}


def frame(scale, dt, cells):
    f = Frame
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    ops.geomTransf("Corotational", 1)
    count = {"node": 0, "element": 0}

    def node(x, y):
        count["node"] += 1
        ops.node(count["node"], x, y)
        return count["node"]

    def element(*arguments):
        count["element"] += 1
        ops.element(arguments[0], count["element"], *arguments[1:])

    def member(a, b, s):
        ends = np.array([ops.nodeCoord(a), ops.nodeCoord(b)])
        inner = [
            node(*map(float, ends[0] + (ends[1] - ends[0]) * i / cells)) for i in range(1, cells)
        ]
        chain = [a, *inner, b]
        for i, j in pairwise(chain):
            element("elasticBeamColumn", i, j, s["EA"], 1.0, s["EI"], 1)

    for tag, h in ((1, f.hinge), (2, f.foot)):
        ops.uniaxialMaterial("Steel01", tag, h["limit"], h["stiffness"], h["ratio"])
    joints, pins = [[], []], []

    def spring(a, b, material):
        element("zeroLength", a, b, "-mat", material, "-dir", 3)
        pins.append((a, b))

    for side, x in enumerate((0.0, f.bay)):
        base = node(x, 0.0)
        ops.fix(base, 1, 1, 1)
        below = node(x, 0.0)
        spring(base, below, 2)
        for i in range(f.storeys):
            above = node(x, (i + 1) * f.height)
            ops.mass(above, f.mass, f.mass, f.inertia)
            member(below, above, f.column)
            joints[side].append(above)
            below = above
    for left, right in zip(*joints, strict=True):
        a, b = node(*ops.nodeCoord(left)), node(*ops.nodeCoord(right))
        spring(left, a, 1)
        spring(right, b, 1)
        member(a, b, f.girder)
    for a, b in pins:
        ops.equalDOF(a, b, 1, 2)
    constant(lambda: [ops.load(j, 0.0, -f.mass * f.g, 0.0) for j in joints[0] + joints[1]])
    ops.test("NormDispIncr", 1e-8, 50, 0)
    values = f.record(scale)
    ops.timeSeries("Path", 3, "-dt", f.dt_record, "-values", *map(float, values))
    ops.pattern("UniformExcitation", 3, 1, "-accel", 3)
    ops.rayleigh(f.damping, 0.0, 0.0, 0.0)
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    return joints[0], round(f.end / dt)


def collapse(scale, dt, cells):
    places, n = frame(scale, dt, cells)
    stopwatch, samples, said = Stopwatch(), [], {}
    every = round(Frame.sampled / dt)
    for first in range(0, n, every):
        with stopwatch:
            failed = ops.analyze(every, dt)
        if failed:
            said = {
                "failed": f"stopped between t = {first * dt:g} s and {(first + every) * dt:g} s"
            }
            break
        samples.append([ops.nodeDisp(p, 1) for p in places])
    return {"steps": n, "values": {"u": samples}, **said, **stopwatch.read()}


RUNS = {"section": section, "column": column, "hinge": hinge, "frame": collapse}
