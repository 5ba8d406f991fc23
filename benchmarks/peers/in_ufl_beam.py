# SPDX-License-Identifier: MIT
"""The problems in ufl_beam, as a user states them; the time loop is timed."""

import numpy as np
from problems import PROBLEMS
from stopwatch import Stopwatch

import ufl_beam as ub
from ufl_beam.dolfinx_compat import dolfinx

VERSION = f"DOLFINx {dolfinx.__version__}"


def discretised(scheme="EnergyMomentum", degree=1, lumped=False, **dials):
    """A scheme by its name, with its arguments, a mesh, and how Newton's method runs."""
    mesh = ub.Mesh(degree=degree, lumped=lumped)
    return getattr(ub, scheme)(**dials), mesh, ub.Newton()


def beams_of(chains):
    return [
        ub.Beam(c.start, c.end, ub.Section(**c.section._asdict()), cells=c.cells) for c in chains
    ]


def run(scene, discretised, end, steps, sample=None, every=None):
    """Step to the end; only the steps are timed, not what is read after every so many of them.

    Returns:
        The simulation at its end, the samples, and what the loop took.
    """
    scheme, mesh, newton = discretised
    simulation = ub.Simulation(scene, scheme, mesh=mesh, newton=newton)
    every = every or steps
    samples, stopwatch = [], Stopwatch()
    for first in range(1, steps + 1, every):
        ends = end * np.arange(first, min(first + every, steps + 1)) / steps
        with stopwatch:
            while len(ends):
                ends = ends[simulation.steps_to(ends) :]
        if sample:
            samples.append(sample(simulation))
    result = {"steps": steps, "newton": simulation.iterations, **stopwatch.read()}
    return simulation, samples, result


def energy(simulation):
    """Kinetic and stored; J."""
    return sum(simulation.ledger.state.values())


def roll_up(cells, turns):
    p = PROBLEMS["P1"]
    (beam,) = beams_of(p.chains(cells))
    bend = ub.PointLoad(beam.end, moment=p.moment(turns), amplitude=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[bend])
    now, _, result = run(scene, discretised("Static"), 1.0, p.steps)
    return result | {"values": {"tip": where(now, beam.end)}}


def where(now, place):
    return np.add(place.point, now.displacement(place)[: len(place.point)]).tolist()


def flying_beam(cells, dt, steps=None, pulse="sudden", **dials):
    p = PROBLEMS["P2"]
    (beam,) = beams_of(p.chains(cells))
    time = p.triangle if pulse == "triangle" else lambda t: float(t < p.until)
    push = ub.PointLoad(beam.start, force=(p.force, 0), moment=p.moment, amplitude=time)
    n = steps or round(p.end / dt)
    now, _, result = run(ub.Scene([beam], loads=[push]), discretised(**dials), n * dt, n)
    return result | {"values": {"ends": [where(now, at) for at in (beam.start, beam.end)]}}


def swing(cells, dt, end=None, **dials):
    p = PROBLEMS["P3"]
    beam, left, right = beams_of(p.chains(cells))
    middle = beam.at(0.5)
    scene = ub.Scene(
        [beam, left, right],
        joints=[ub.Revolute(left.start, beam.start), ub.Revolute(right.start, beam.end)],
        supports=[ub.Pinned(left.end), ub.Pinned(right.end)],
        masses=[ub.PointMass(middle, p.mass)],
        loads=[ub.PointLoad(middle, force=(1, 0), amplitude=p.push)],
    )

    def sample(now):
        return *now.displacement(middle)[:2].tolist(), energy(now)

    n, every = round((end or p.end) / dt), round(p.sampled / dt)
    _, samples, result = run(scene, discretised(**dials), n * dt, n, sample, every)
    middle, told = [s[:2] for s in samples], [s[2] for s in samples]
    return result | {"values": {"middle": middle, "energy": told}}


def portal(cells, dt, **dials):
    p = PROBLEMS["P4"]
    left, girder, right = beams_of(p.chains(cells))
    kinematic = p.stiffness * p.ratio / (1 - p.ratio)
    bilinear = ub.Spring(
        p.stiffness, law=ub.ElastoPlastic(yield_limit=p.limit, kinematic=kinematic)
    )
    hinge = ub.Turn(girder.end, right.start, bilinear)
    scene = ub.Scene(
        [left, girder, right],
        joints=[ub.Rigid(left.end, girder.start), ub.Revolute(girder.end, right.start)],
        connectors=[hinge],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(1, 0), amplitude=p.push)],
    )

    def sample(now):
        return float(now.displacement(left.end)[0]), now.connector(hinge).motion

    n, every = round(p.end / dt), round(p.sampled / dt)
    _, samples, result = run(scene, discretised(**dials), p.end, n, sample, every)
    u, turn = zip(*samples, strict=True)
    return result | {"values": {"u": u, "turn": turn}}


def cantilever(cells, dt, **dials):
    p = PROBLEMS["P5"]
    (beam,) = beams_of(p.chains(cells))
    load = ub.PointLoad(beam.end, force=(0, 1), amplitude=p.push)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
    now, _, result = run(scene, discretised(**dials), p.end, round(p.end / dt))
    return result | {"values": {"tip": where(now, beam.end)}}


def tumbling_beam(cells, dt, steps=None, **dials):
    p = PROBLEMS["P6"]
    (beam,) = beams_of(p.chains(cells))
    push = ub.PointLoad(beam.start, force=p.force, moment=p.moment, amplitude=p.push)
    n = steps or round(p.end / dt)
    scene, every = ub.Scene([beam], loads=[push]), round(p.until / dt)
    now, told, result = run(scene, discretised(**dials), n * dt, n, energy, every)
    ends = [where(now, at) for at in (beam.start, beam.end)]
    return result | {"values": {"ends": ends, "energy": told}}


RUNS = {
    "P1": roll_up, "P2": flying_beam, "P3": swing, "P4": portal, "P5": cantilever,
    "P6": tumbling_beam,
}  # fmt: skip
