# SPDX-License-Identifier: MIT
"""The reference solver in space: a plain loop over kernels finds the motion of the ordinary one."""

import numpy as np
import pytest
from into_space import EXACT
from test_space import KINDS, LAWS, OTHER, STIFF, bend, crane, in_space

import ufl_beam as ub

pytestmark = pytest.mark.serial

PLAIN = ub.Newton(rtol=1e-12, reference=True)


def spring(law):
    return in_space(connectors=lambda *ends: [KINDS["Slide"](*ends, LAWS[law])])


def bent():
    beam = ub.Beam((0, 0, 0), (1, 0, 2), ub.Section(**STIFF, **OTHER), cells=4)
    load = ub.PointLoad(beam.end, force=(100, 50, 0), moment=(30, 0, 20), amplitude=lambda t: t)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


CASES = {
    "machine": (crane, ub.EnergyMomentum(), 0.2, 0.02),
    "dissipation": (in_space, ub.EnergyMomentum(0.1, 0.05), 1.0, 0.1),
    "decaying": (in_space, ub.EnergyMomentumDecaying(), 1.0, 0.1),
    "stop": (lambda: spring("stop"), ub.EnergyMomentum(), 0.5, 0.1),
    "yielding spring": (lambda: spring("hardening spring"), ub.EnergyMomentum(), 0.5, 0.1),
    "statics": (bent, ub.Static(), 1.0, 0.25), "arc": (lambda: bend(8), ub.Static(), 1.0, 0.25),
    "statics over steps": (bent, ub.EnergyMomentumStatic(), 1.0, 0.25),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_equal_motion(case):
    make, scheme, t, dt = CASES[case]
    scene = make()
    ordinary, plain = (
        ub.simulate(scene, scheme, t=(0, t), dt=dt, newton=newton) for newton in (EXACT, PLAIN)
    )
    for place in [beam.at(0.6) for beam in scene.beams] + [x.middle for x in scene.bodies]:
        one, other = (run.displacement(place) for run in (ordinary, plain))
        assert np.abs(one - other).max() < 1e-12 * scene.size
    assert plain.iterations > plain.substeps


def test_scope():
    scheme = ub.EnergyMomentum(order=4)
    with pytest.raises(ub.ArgumentError, match="cannot be combined with EnergyMomentum"):
        ub.simulate(bent(), scheme, t=(0, 1), dt=0.5, newton=PLAIN)
