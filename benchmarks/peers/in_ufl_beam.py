"""The problems in ufl_beam, as a user states them; the time loop is timed."""

import time

import numpy as np
from problems import PROBLEMS

import ufl_beam as ub
from ufl_beam.compat import dolfinx

VERSION = f"DOLFINx {dolfinx.__version__}"


def scheme_of(alpha):
    return ub.Midpoint(alpha=alpha, beta=alpha)


def beams_of(chains):
    return [
        ub.Beam(c.start, c.end, ub.Section(**c.section._asdict()), cells=c.cells) for c in chains
    ]


def run(scene, scheme, end, steps, newton=None, sample=None, every=None):
    """Step to the end; only the steps are timed, not what is read every so many of them."""
    simulation = ub.Simulation(scene, scheme, newton=newton)
    every = every or steps
    samples, wall = [], 0.0
    for first in range(1, steps + 1, every):
        last = min(first + every, steps + 1)
        begin = time.perf_counter()
        for n in range(first, last):
            simulation.step_to(end * n / steps)
        wall += time.perf_counter() - begin
        if sample:
            samples.append(sample(simulation))
    result = {"wall": wall, "steps": steps, "newton": simulation.iterations}
    return simulation, samples, result


def flying_beam(cells, dt, steps=None, alpha=0.0):
    p = PROBLEMS["P2"]
    (beam,) = beams_of(p.chains(cells))
    push = ub.PointLoad(
        beam.start, force=(p.force, 0), moment=p.moment, time=lambda t: float(t < p.until)
    )
    n = steps or round(p.end / dt)
    now, _, result = run(ub.Scene([beam], loads=[push]), scheme_of(alpha), n * dt, n)
    ends = [np.add(place.point, now.displacement(place)[:2]) for place in (beam.start, beam.end)]
    return result | {"values": {"ends": [e.tolist() for e in ends]}}


def portal(cells, dt, alpha=0.0):
    p = PROBLEMS["P4"]
    left, girder, right = beams_of(p.chains(cells))
    kinematic = p.stiffness * p.ratio / (1 - p.ratio)
    bilinear = ub.Spring(p.stiffness, law=ub.Hardening(limit=p.limit, kinematic=kinematic))
    hinge = ub.Turn(girder.end, right.start, bilinear)
    scene = ub.Scene(
        [left, girder, right],
        joints=[ub.Rigid(left.end, girder.start), ub.Revolute(girder.end, right.start)],
        connectors=[hinge],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(1, 0), time=p.push)],
    )

    def sample(now):
        return now.displacement(left.end)[0], now.connector(hinge).motion

    every, n = round(p.sampled / dt), round(p.end / dt)
    _, samples, result = run(scene, scheme_of(alpha), p.end, n, sample=sample, every=every)
    u, turn = zip(*samples, strict=True)
    return result | {"values": {"u": [float(x) for x in u], "turn": [float(x) for x in turn]}}


RUNS = {"P2": flying_beam, "P4": portal}
