# SPDX-License-Identifier: MIT
"""The structures in ufl_beam."""

from itertools import pairwise

import numpy as np
from stopwatch import Stopwatch
from structures import CURVATURES, SECTIONS, Column, Frame, Hinge

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.dolfinx_compat import dolfinx

VERSION = f"DOLFINx {dolfinx.__version__}"


def section_of(p):
    """Return a section without shear strains, as the elements of OpenSees have."""
    laws = {"steel": ub.Fibres(st.MenegottoPinto(**p.steel))}
    E = {"steel": p.bars}
    for name in ("cover", "core"):
        if hasattr(p, name):
            laws[name], E[name] = ub.Fibres(st.KentPark(**getattr(p, name))), p.concrete
    y, A, material = zip(*p.fibres(), strict=True)
    return ub.Section.of_fibres(
        y, A, E=[E[m] for m in material], fibres=[laws[m] for m in material], nu=0.2,
        shear_factor=1e4,
    )  # fmt: skip


def section(kind):
    p, stopwatch = SECTIONS[kind], Stopwatch()
    own = section_of(p)
    with stopwatch:
        result = st.moment_curvature(own, CURVATURES, p.N)
    return {"values": {"moment": result.moment.tolist()}, **stopwatch.read()}


def column(cells, degree):
    own = section_of(SECTIONS["concrete"])
    member = ub.Beam((0, 0), (0, Column.length), own, cells=cells)
    n = len(Column.moves) - 1
    weight = ub.PointLoad(member.end, force=(0, SECTIONS["concrete"].N), amplitude=ub.ramp(1.0))
    move = ub.Table([0.0, *range(1, n + 2)], [0.0, *Column.moves])
    push = ub.PrescribedDisplacement(member.end, u=move)
    scene = ub.Scene([member], supports=[ub.Clamped(member.start), push], loads=[weight])
    stopwatch = Stopwatch()
    with stopwatch:
        run = ub.simulate(
            scene, ub.Static(), t=(0, n + 1), dt=1.0, mesh=ub.Mesh(degree=degree), progress=False
        )
    return {"values": {"force": run.reaction(push)[1:, 0].tolist()}, **stopwatch.read()}


def hinge(kind, largest, lost):
    h, rotations = Hinge, Hinge.rotations(largest)
    backbone = st.Backbone(
        h.limit, capping=h.capping, post_capping=h.post_capping, overstrength=h.overstrength,
        residual=h.residual, ultimate=h.ultimate,
    )  # fmt: skip
    names = "strength", "softening", "reloading", "unloading"
    modes = {name: x for name, x in zip(names, lost, strict=True) if x}
    if kind == "IMKBilin":
        law = st.IbarraKrawinkler(h.stiffness, backbone, **modes)
    else:
        pinching = {"kappa_F": h.kappa_F, "kappa_D": h.kappa_D} if kind == "IMKPinching" else {}
        law = st.PinchingHinge(h.stiffness, backbone, **modes, **pinching)
    arm = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e9, GA=1e9, EI=1e8, rhoA=1.0), cells=1)
    spring = ub.Turn(ub.ground(0, 0), arm.start, law)
    n = len(rotations) - 1
    turning = ub.Table(range(n + 1), rotations)
    turn = ub.PrescribedDisplacement(arm.start, u=0.0, v=0.0, psi=turning)
    scene = ub.Scene([arm], supports=[turn], connectors=[spring])
    stopwatch = Stopwatch()
    with stopwatch:
        run = ub.simulate(scene, ub.Static(), t=(0, n), dt=1.0, progress=False)
    return {"values": {"moment": run.connector(spring).force.tolist()}, **stopwatch.read()}


def bilinear(stiffness, limit, ratio):
    law = ub.ElastoPlastic(yield_limit=limit, kinematic=stiffness * ratio / (1 - ratio))
    return ub.Spring(stiffness, law=law)


def frame(scale, dt, cells):
    f = Frame
    rigid = 1e13  # GA; no shear strains, as in elasticBeamColumn
    post, rail = (ub.Section(**s, GA=rigid, rhoA=0.0) for s in (f.column, f.girder))
    members, joints, connectors, feet, masses = [], [], [], [], []
    posts = [[], []]
    for side, x in enumerate((0.0, f.bay)):
        for i in range(f.storeys):
            posts[side].append(
                ub.Beam((x, i * f.height), (x, (i + 1) * f.height), post, cells=cells)
            )
        foot = posts[side][0].start
        feet.append(ub.Pinned(foot))
        connectors.append(ub.Turn(ub.ground(x, 0), foot, bilinear(**f.foot)))
        joints += [ub.Rigid(a.end, b.start) for a, b in pairwise(posts[side])]
        masses += [ub.PointMass(p.end, f.mass, f.inertia) for p in posts[side]]
    members += posts[0] + posts[1]
    for left, right in zip(*posts, strict=True):
        girder = ub.Beam(left.end.point, right.end.point, rail, cells=cells)
        members.append(girder)
        for place, end in ((left.end, girder.start), (right.end, girder.end)):
            joints.append(ub.Revolute(place, end))
            connectors.append(ub.Turn(place, end, bilinear(**f.hinge)))
    values = f.record(scale)
    times = 1.0 + f.dt_record * np.arange(len(values))  # gravity grows until t = 1
    shake = ub.Gravity((-1, 0), amplitude=ub.Table([0.0, *times], [0.0, *values]))
    weight = ub.Gravity((0, -f.g), amplitude=ub.ramp(1.0))
    shared = {
        "joints": joints, "connectors": connectors, "supports": feet, "masses": masses,
        "loads": [weight, shake],
    }  # fmt: skip
    mesh = ub.Mesh(degree=2)
    undamped = ub.Scene(members, **shared)
    still = ub.simulate(undamped, ub.Static(), t=(0, 1), dt=0.1, mesh=mesh, progress=False)
    places = [p.end for p in posts[0]]
    scene = ub.Scene(members, **shared, damping=[ub.Rayleigh(mass=f.damping)])
    moving = ub.Simulation(scene, ub.EnergyMomentum(), mesh=mesh, start=still)
    return moving, places, round(f.end / dt)


def collapse(scale, dt, cells):
    moving, places, n = frame(scale, dt, cells)
    stopwatch, samples, said = Stopwatch(), [], {}
    every = round(Frame.sampled / dt)
    accounts = [moving.ledger.state, moving.ledger.supplied, moving.ledger.lost]
    entries = [[dict(account) for account in accounts]]
    for first in range(1, n + 1, every):
        ends = 1.0 + dt * np.arange(first, first + every)
        try:
            with stopwatch:
                while len(ends):
                    ends = ends[moving.steps_to(ends) :]
        except ub.ConvergenceError as error:
            said["failed"] = str(error)[:200]
            break
        samples.append([float(moving.displacement(p)[0]) for p in places])
        entries.append([dict(account) for account in accounts])
    parts = [
        {name: np.array([one[i][name] for one in entries]) for name in account}
        for i, account in enumerate(accounts)
    ]
    said["ledger"] = ub.Energy(*parts).worst
    return {"steps": n, "values": {"u": samples}, **said, **stopwatch.read()}


RUNS = {"section": section, "column": column, "hinge": hinge, "frame": collapse}
