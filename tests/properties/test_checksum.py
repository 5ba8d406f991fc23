# SPDX-License-Identifier: MIT
"""One scene of everything gives one result on any number of processes."""

import numpy as np

import ufl_beam as ub

CHECKSUMS = {"q": "8.26542832", "energy": "1.02415037", "links": "1.02379385"}
"""Of a run on one process, to nine digits; the same on two and three."""


def everything():
    """Beams that yield and hinge, fibres, bodies, every joint and every law, across processes."""
    steel = {"EA": 1e5, "GA": 1e5, "EI": 40.0, "rhoA": 0.5, "rhoI": 0.01}
    hinged = ub.Section(**steel, bending=ub.ElastoPlastic(yield_limit=0.5, kinematic=3.0))
    fibres = ub.Section.rectangle(
        b=0.02, h=0.05, E=1e8, nu=0.3, rho=500.0,
        fibres=ub.Fibres(
            ub.ElastoPlastic(ub.TruncatedNormal(1e5, 2e4, seed=7)), number=12
        ),
    )  # fmt: skip
    a = ub.Body((0, 0), mass=2.0, inertia=0.3, name="a")
    b = ub.Body((1, 0), mass=1.0, inertia=0.1, name="b")
    c = ub.Body((2, 0.2), mass=1.0, inertia=0.2, name="c")
    right = ub.Beam((2.5, 0.2), (3.5, 0.2), hinged, cells=4, hinges={0.1: ub.Softening(0.6, 0.02)})
    left = ub.Beam((-2, 0), (-0.5, 0), fibres, cells=5, name="left")
    joints = [
        ub.Prismatic(a.at(0.3, 0), b.middle, axis=(1, 0.3)),
        ub.Revolute(b.at(1.5, 0.1), c.at(1.5, 0.1)),
        ub.Rigid(c.at(2.5, 0.2), right.start),
        ub.Revolute(left.end, a.at(-0.5, 0), multipliers=True),
        ub.Link(left.start, ub.ground(-2, -3)),
        ub.Guided(right.end, lambda s: (3.5 + s, 0.2 + 0.3 * np.sin(s))),
    ]

    def control(now):
        """Of what other processes have."""
        return -0.1 * now.t - 0.05 * now.displacement(left.start)[2] - now.connector(spring).motion

    spring = ub.Turn(b.middle, c.middle, ub.Spring(5.0))
    connectors = [
        ub.Slide(
            a.middle, b.middle, ub.Spring(20.0, ub.ElastoPlastic(yield_limit=0.5, kinematic=2.0))
        ),
        spring,
        ub.Turn(a.middle, left.end, ub.Damper(0.2)),
        ub.Stretch(left.at(0.4), right.at(0.5), ub.Stop(50.0, high=0.2)),
        ub.Turn(left.end, a.middle, ub.Coulomb(0.05)),
        ub.Slide(ub.ground(0, 0), a.middle, ub.ForceLaw(lambda e, rate: 10 * e), axis=(0, 1)),
        ub.Turn(ub.ground(0, 0), c.middle, ub.Controller(control)),
    ]
    loads = [ub.Gravity(), ub.PointLoad(c.at(2.5, 0.5), force=(3, 2), moment=1.0)]
    return ub.Scene(
        [right, left], joints=joints, connectors=connectors, bodies=[a, b, c], loads=loads
    )


def test_results_have_their_digits_on_any_number_of_processes():
    run = ub.simulate(everything(), ub.EnergyMomentum(0.05), t=(0, 0.3), dt=0.005)
    assert run.energy.worst < 1e-9
    for name, numbers in (
        ("q", run.q[-1]),
        ("energy", [entry[-1] for entry in run.energy.lost.values()]),
        ("links", [run.connector(link).work[-1] for link in run.scene.connectors]),
    ):
        size = np.linalg.norm(np.sort(np.abs(numbers)))
        assert f"{size:.9g}" == CHECKSUMS[name], name
