# SPDX-License-Identifier: MIT
"""Random scenes: states that C keeps are, to the last bit, those that Python gathers."""

import numpy as np
import pytest

import ufl_beam as ub

SEEDS = range(24)

STEPS, DT = 40, 0.02  # s

SCHEMES = (
    ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.05), ub.Newmark(0.6, 0.36),
    ub.GeneralizedAlpha(0.5),
    ub.Static(), ub.EnergyMomentumStatic(),
)  # fmt: skip

pytestmark = [pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning"), pytest.mark.serial]


def draw(seed):
    """A chain of beams with joints, springs, plastic hinges and yielding or breaking sections."""
    random = np.random.default_rng(seed)

    def some(low, high):
        return float(random.uniform(low, high))

    def one(*choices):
        return choices[int(random.integers(len(choices)))]

    def law():
        return one(
            ub.Softening(some(0.5, 5.0), some(2.0, 20.0)),
            ub.ElastoPlastic(some(0.5, 5.0), kinematic=some(1.0, 20.0)),
            ub.ElastoPlastic(some(0.5, 5.0), isotropic=some(1.0, 20.0)),
        )

    def spring():
        stiffness, limit = some(10.0, 100.0), some(0.2, 2.0)
        yielding, breaking = (
            ub.ElastoPlastic(limit, some(1.0, 10.0)),
            ub.Softening(limit, some(1.0, 9.0)),
        )
        return one(
            ub.Spring(stiffness),
            ub.Spring(stiffness, yielding),
            ub.Spring(stiffness, softening=breaking),
        )

    beams, joints, connectors, start = [], [], [], (0.0, 0.0)
    for _ in range(int(random.integers(1, 4))):
        end = (start[0] + some(0.5, 2.0), start[1] + some(-1.0, 1.0))
        of_material = one(
            {},
            {"bending": ub.ElastoPlastic(some(5.0, 20.0), kinematic=20.0)},
            {"hinge": ub.Softening(some(5.0, 20.0), 20.0)},
        )
        section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0, **of_material)
        places = [s for s in (0.0, 0.5, 1.0) if not of_material and random.random() < 0.4]
        hinges = {s: law() for s in places}
        beam = ub.Beam(start, end, section, cells=2 * int(random.integers(1, 4)), hinges=hinges)
        if beams:
            join = one(ub.Rigid, ub.Revolute)
            joints.append(join(beams[-1].end, beam.start, multipliers=one(True, False)))
            connectors.append(ub.Turn(beams[-1].end, beam.start, spring()))
        if random.random() < 0.6:
            ground = ub.ground(end[0], end[1] - 1.0)
            connectors.append(ub.Stretch(ground, beam.at(one(0.5, 1.0)), spring()))
        beams.append(beam)
        start = end
    moving = ub.PrescribedDisplacement(beams[-1].end, v=lambda t: 0.2 * np.sin(4.0 * t))
    return ub.Scene(
        beams,
        joints=joints,
        supports=[ub.Clamped(beams[0].start), *([moving] if random.random() < 0.4 else [])],
        loads=[ub.PointLoad(beams[-1].at(0.5), force=(some(-20.0, 20.0), some(-20.0, 20.0)))],
        connectors=connectors,
    ), one(*SCHEMES)


def run(seed, *, many):
    """A run as far as it goes; the states are kept while it steps, or each gathered after its step.

    The first is kept by Python.
    """
    simulation, ends = ub.Simulation(*draw(seed)), DT * np.arange(1, STEPS + 1)
    simulation.keep()
    try:
        while len(ends):
            taken = simulation.steps_to(ends if many else ends[:1], keep=many)
            if not many:
                simulation.keep()
            ends = ends[taken:]
    except ub.ConvergenceError:
        pass
    return simulation.solution


@pytest.mark.parametrize("seed", SEEDS)
def test_rows_of_c_are_states(seed):
    one, other = run(seed, many=True), run(seed, many=False)
    states, others = one.history(), other.history()
    assert [*states] == [*others]
    assert len(one) > STEPS / 4
    for name, values in states.items():
        assert np.array_equal(values, others[name], equal_nan=True), name
    assert (one.parts, one.iterations) == (other.parts, other.iterations)
