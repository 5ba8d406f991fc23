# SPDX-License-Identifier: MIT
"""The problems in OpenSees: corotational elements, lumped masses, no output.

Its planar corotational transformation ends at a rotation of π; where beams turn further (P2), a
spatial model has its motion out of the plane fixed.  Masses are constants in the axes of the scene,
also rotary ones; inertia that turns with a spatial beam (P6) are masses on stiff arms.
"""

import math
from itertools import pairwise

import numpy as np
import openseespy.opensees as ops
from problems import PROBLEMS
from stopwatch import Stopwatch

VERSION = f"OpenSees {ops.version()}"


class Model:
    """Nodes and elements; ``spatial`` has six degrees of freedom a node, of which three are fixed
    unless it is ``free``.

    Element "euler" is elasticBeamColumn, without shear; "shear" is ElasticTimoshenkoBeam.
    """

    def __init__(self, element, spatial=False, free=False):
        ops.wipe()
        self.element, self.spatial, self.free = element, spatial, free
        self.turn = 6 if spatial else 3
        ops.model("basic", "-ndm", 3 if spatial else 2, "-ndf", self.turn)
        self.count, self.elements, self.masses, self.fixed = 0, 0, {}, {}

    def add(self, chain):
        """Tags of the nodes of a chain."""
        tags = [self.node(*point) for point in chain.points]
        s = chain.section
        self.elements += 1  # a transformation for each chain
        transformation = self.elements
        ops.geomTransf("Corotational", transformation, *([0.0, 0.0, 1.0] if self.spatial else []))
        for a, b in pairwise(tags):
            self.elements += 1
            ops.element(*self._element(a, b, s, transformation))
            for tag in (a, b):
                m, J = self.masses.get(tag, (0.0, 0.0))
                self.masses[tag] = m + s.rhoA * chain.h / 2, J + s.rhoI * chain.h / 2
        return tags

    def _element(self, a, b, s, transformation):
        place = (self.elements, a, b)
        if self.element == "shear":
            more = (s.EI, s.EI, s.EI, s.GA, s.GA) if self.spatial else (s.EI, s.GA)
            return "ElasticTimoshenkoBeam", *place, 1.0, 1.0, s.EA, *more, transformation
        more = (1.0, 1.0, s.EI, s.EI, s.EI) if self.spatial else (1.0, s.EI)
        return "elasticBeamColumn", *place, s.EA, *more, transformation

    def put_on_arms(self, tags, chain):
        """Masses of a chain on four stiff arms a node, for inertia that turns with the nodes."""
        s, up = chain.section, np.array((0.0, 0.0, 1.0))
        along = np.subtract(chain.end, chain.start) / (chain.cells * chain.h)
        arms = math.sqrt(2 * s.rhoI / s.rhoA) * np.array([up, np.cross(up, along)])
        self.elements += 1
        transformation = self.elements
        ops.geomTransf("Corotational", transformation, *along)
        for tag, point in zip(tags, chain.points, strict=True):
            m, _ = self.masses.pop(tag)
            for arm in (*arms, *-arms):
                end = self.node(*point + arm)
                self.masses[end] = m / 4, 0.0
                self.elements += 1
                ops.element(*self._element(tag, end, s.times(1e3), transformation))

    def energy(self):
        """Kinetic, and stored in elements of linear elasticity without shear; J."""
        kinetic = 0.0
        for tag, (m, J) in self.masses.items():
            v = np.array(ops.nodeVel(tag))
            kinetic += (m * v[:3] @ v[:3] + J * v[3:] @ v[3:]) / 2
        stored = (np.dot(ops.basicForce(e), ops.basicDeformation(e)) for e in ops.getEleTags())
        return float(kinetic + sum(stored) / 2)

    def node(self, x, y, z=0.0):
        self.count += 1
        ops.node(self.count, float(x), float(y), *([float(z)] if self.spatial else []))
        return self.count

    def fix(self, tag, u, v, turn):
        self.fixed[tag] = (u, v, turn)

    def finish(self):
        """Supports and masses, which the chains of a node share."""
        for tag in range(1, self.count + 1):
            u, v, turn = self.fixed.get(tag, (0, 0, 0))
            ops.fix(tag, u, v, *([int(not self.free)] * 3 if self.spatial else ()), turn)
            m, J = self.masses.get(tag, (0.0, 0.0))
            ops.mass(tag, *((m, m, m, J, J, J) if self.spatial else (m, m, J)))

    def load(self, tag, series, fx=0.0, fy=0.0, moment=0.0, more=(0.0, 0.0, 0.0)):
        """Force and moment in the plane; more: fz, and moments about x and y."""
        ops.timeSeries(*series)
        ops.pattern("Plain", 1, 1)
        ops.load(tag, fx, fy, *(more if self.spatial else ()), moment)

    def where(self, tag):
        n = 3 if self.free else 2
        return np.add(ops.nodeCoord(tag)[:n], ops.nodeDisp(tag)[:n]).tolist()


def analyse(newton, integrator, tolerance=1e-8, system="ProfileSPD", joined=False):
    """Nodes of one chain are in their best order; ``joined`` ones are put in order."""
    ops.constraints("Transformation" if joined else "Plain")
    ops.numberer("RCM" if joined else "Plain")
    ops.system(system)
    ops.test("NormDispIncr", tolerance, 50, 0)
    ops.algorithm({"full": "Newton", "modified": "ModifiedNewton"}[newton])
    ops.integrator(*integrator)
    ops.analysis("Static" if integrator[0] == "LoadControl" else "Transient")


INTEGRATORS = {"newmark": ("Newmark", 0.5, 0.25), "trbdf2": ("TRBDF2",)}


def run(steps, dt=None, sample=None, every=None):
    """The loop over steps; what is read after every so many of them is not timed."""
    samples, stopwatch, every, said = [], Stopwatch(), every or steps, {}
    for first in range(0, steps, every):
        n = min(every, steps - first)
        with stopwatch:
            failed = ops.analyze(n, *([] if dt is None else [dt]))
        if failed:
            said = {"failed": f"stopped at t = {ops.getTime():.4g}"}
            break
        if sample:
            samples.append(sample())
    return samples, {"steps": steps, **said, **stopwatch.read()}


def clamped(chain):
    """A model of one chain, clamped at its start; the tag of its end."""
    model = Model("euler")
    tags = model.add(chain)
    model.fix(tags[0], 1, 1, 1)
    model.finish()
    return model, tags[-1]


def followed(model, tip, steps, dt=None):
    """Iterations and the place of the tip, after some steps."""
    iterations, result = run(steps, dt, ops.testIter, every=1)
    return result | {"newton": sum(iterations), "values": {"tip": model.where(tip)}}


def roll_up(cells, turns, load_steps=PROBLEMS["P1"].steps, steps=None):
    p = PROBLEMS["P1"]
    model, tip = clamped(*p.chains(cells))
    model.load(tip, ("Linear", 1), moment=p.moment(turns))
    analyse("full", ("LoadControl", 1 / load_steps), system="BandGeneral")  # it is indefinite
    return followed(model, tip, steps or load_steps)


def flying_beam(cells, dt, newton="full", integrator="newmark", steps=None, pulse="sudden"):
    p = PROBLEMS["P2"]
    (chain,) = p.chains(cells)
    model = Model("euler", spatial=True)
    tags = model.add(chain)
    model.finish()
    e = 1e-6 * dt  # the push is 1, at its end 1/2, then 0: an exact impulse
    times, factors = (-1.0, p.until - e, p.until, p.until + e, 1e3), (1.0, 1.0, 0.5, 0.0, 0.0)
    if pulse == "triangle":
        times, factors = (-1.0, 0.0, p.until / 2, p.until, 1e3), (0.0, 0.0, 1.0, 0.0, 0.0)
    path = ("Path", 1, "-time", *times, "-values", *factors)
    model.load(tags[0], path, fx=p.force, moment=p.moment)
    m, J = model.masses[tags[0]]
    for c, acceleration in ((1, p.force / m), (6, p.moment / J)) if pulse == "sudden" else ():
        ops.setNodeAccel(tags[0], c, acceleration, "-commit")
    tolerance = 1e-8 if cells <= 64 else 1e-5  # it does not reach less on fine meshes
    analyse(newton, INTEGRATORS[integrator], tolerance=tolerance)
    _, result = run(steps or round(p.end / dt), dt)
    return result | {"values": {"ends": [model.where(tags[i]) for i in (0, -1)]}}


def swing(cells, dt, newton="full", integrator="trbdf2", end=None):
    p = PROBLEMS["P3"]
    model = Model("euler")
    beam, left, right = (model.add(chain) for chain in p.chains(cells))
    middle = beam[len(beam) // 2]
    m, J = model.masses[middle]
    model.masses[middle] = m + p.mass, J
    for connector in (left, right):
        model.fix(connector[-1], 1, 1, 0)
    model.finish()
    for connector, tag in ((left, beam[0]), (right, beam[-1])):
        ops.equalDOF(tag, connector[0], 1, 2)
    times, values = (-1.0, 0.0, p.until / 2, p.until, 1e3), (0.0, 0.0, p.peak, 0.0, 0.0)
    model.load(middle, ("Path", 1, "-time", *times, "-values", *values), fx=1.0)
    analyse(newton, INTEGRATORS[integrator], joined=True)

    def sample():
        return ops.nodeDisp(middle, 1), ops.nodeDisp(middle, 2)

    samples, result = run(round((end or p.end) / dt), dt, sample, round(p.sampled / dt))
    return result | {"values": {"middle": samples}}


def portal(cells, dt, newton="full", element="euler", integrator="newmark"):
    p = PROBLEMS["P4"]
    model = Model(element)
    left, girder, right = (model.add(chain) for chain in p.chains(cells))
    model.fix(left[0], 1, 1, 1)
    model.fix(right[-1], 1, 1, 1)
    model.finish()
    ops.equalDOF(left[-1], girder[0], 1, 2, 3)
    ops.equalDOF(girder[-1], right[0], 1, 2)
    ops.uniaxialMaterial("Steel01", 1, p.limit, p.stiffness, p.ratio)
    ops.element("zeroLength", model.elements + 1, girder[-1], right[0], "-mat", 1, "-dir", 3)
    model.load(left[-1], ("Trig", 1, 0.0, p.until, 2 * p.until), fx=p.force)
    analyse(newton, INTEGRATORS[integrator], joined=True)

    def sample():
        u = ops.nodeDisp(left[-1], 1)
        return u, ops.nodeDisp(right[0], 3) - ops.nodeDisp(girder[-1], 3)

    samples, result = run(round(p.end / dt), dt, sample, round(p.sampled / dt))
    u, turn = zip(*samples, strict=True) if samples else ((math.nan,), (math.nan,))
    return result | {"values": {"u": u, "turn": turn}}


def cantilever(cells, dt, newton="full"):
    p = PROBLEMS["P5"]
    model, tip = clamped(*p.chains(cells))
    model.load(tip, ("Linear", 1, "-factor", 1 / p.end), fy=p.force)
    tolerance = 1e-8 if cells <= 10_000 else 1e-6  # it does not reach less on fine meshes
    analyse(newton, INTEGRATORS["newmark"], tolerance=tolerance)
    return followed(model, tip, round(p.end / dt), dt)


def tumbling_beam(cells, dt, newton="full", integrator="newmark", arms=False, steps=None):
    p = PROBLEMS["P6"]
    (chain,) = p.chains(cells)
    model = Model("euler", spatial=True, free=True)
    tags = model.add(chain)
    if arms:
        model.put_on_arms(tags, chain)
    model.finish()
    times, values = (-1.0, 0.0, p.until / 2, p.until, 1e3), (0.0, 0.0, p.peak, 0.0, 0.0)
    fx, fy, *more, moment = *p.force, *p.moment
    model.load(tags[0], ("Path", 1, "-time", *times, "-values", *values), fx, fy, moment, more)
    analyse(newton, INTEGRATORS[integrator], joined=arms)
    n = steps or round(p.end / dt)
    energy, result = run(n, dt, model.energy, round(p.until / dt))
    return result | {"values": {"ends": [model.where(tags[i]) for i in (0, -1)], "energy": energy}}


RUNS = {
    "P1": roll_up, "P2": flying_beam, "P3": swing, "P4": portal, "P5": cantilever,
    "P6": tumbling_beam,
}  # fmt: skip
