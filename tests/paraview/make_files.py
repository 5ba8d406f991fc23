# SPDX-License-Identifier: MIT
"""make_files.py FOLDER: a run with beams, hinges, a body and a spring, and numbers to expect."""

import json
import sys
from pathlib import Path

import numpy as np

import ufl_beam as ub

folder = Path(sys.argv[1])
steel = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
column = ub.Section.rectangle(
    b=0.1, h=0.2, **steel, hinge=ub.Softening(limit=150e3, fracture_energy=60e3)
)
girder = ub.Section.rectangle(b=0.1, h=0.25, **steel)
left = ub.Beam((0, 0), (0, 4), column, cells=8, name="left")
roof = ub.Beam((0, 4), (6, 4), girder, cells=12, name="roof")
right = ub.Beam((6, 4), (6, 0), column, cells=8, name="right")
weight = ub.Body((3, 2.5), mass=800.0, inertia=20.0, name="weight")
frame = ub.Scene(
    [left, roof, right],
    bodies=[weight],
    joints=[
        ub.Rigid(left.end, roof.start),
        ub.Rigid(roof.end, right.start),
        ub.Link(roof.at(0.5), weight.at(3, 3)),
    ],
    connectors=[ub.Stretch(left.at(0.5), weight.at(2.5, 2.5), ub.Spring(5e4))],
    supports=[ub.Clamped(left.start), ub.Pinned(right.end)],
    loads=[
        ub.PointLoad(
            left.end, force=(140e3, 0.0), amplitude=ub.Table([0, 0.05, 0.2, 0.21], [0, 1, 1, 0])
        ),
        ub.Gravity(),
    ],
)
solution = ub.simulate(
    frame,
    ub.EnergyMomentum(alpha=0.05, beta=0.05),
    t=(0.0, 0.4),
    dt=1e-3,
    record=[ub.XDMF(folder / "frame.xdmf", every=10), ub.VTKHDF(folder / "frame.hdf", every=10)],
)
points = [b.at(s) for b in frame.beams for s in np.linspace(0, 1, 13 if b is roof else 9)]
points += [weight.middle, weight.at(3, 3), weight.at(2.5, 2.5)]
expected = {
    "times": 41,
    "displacement": max(float(np.hypot(*solution.displacement(p)[-1, :2])) for p in points),
    "rotation": max(abs(float(solution.displacement(p)[-1, 2])) for p in points),
    "M": max(float(abs(solution.section_forces(b)[:, 2]).max()) for b in frame.beams),
    "jump": max(abs(float(solution.connector(hinge).motion[-1])) for hinge in frame.hinges),
}
(folder / "expected.json").write_text(json.dumps(expected))
