# SPDX-License-Identifier: MIT
"""Modified Newton's method: loads that go, friction, and runs that go on from a checkpoint."""

import math

import numpy as np
import pytest

import ufl_beam as ub

MODIFIED = ub.Newton(modified=True)
QUIET = {"progress": False}


def cantilever(force, time):
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e3, GA=1e3, EI=1.0, rhoA=1.0), cells=4)
    load = ub.PointLoad(beam.end, force, time=time)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


@pytest.mark.parametrize("scheme", [ub.Static(), ub.ExactStatic()])
def test_loads_may_go(scheme):
    """To the undeformed scene, and on without loads, in steps that are not cut.

    The residual is to be a part 1e-10 of forces that fade with it: where a tangent is kept, neither
    Newton's method nor round-off gets there.  [exact] zero, but for 1e-9 of the largest deflection.
    """
    scene = cantilever((0.08, 0.6), ub.Table([0, 0.25, 0.5, 1], [0, 1, 0, 0]))
    run = ub.simulate(scene, scheme, t=(0, 1), dt=1 / 24, newton=MODIFIED, **QUIET)
    full = ub.simulate(scene, scheme, t=(0, 1), dt=1 / 24, **QUIET)
    np.testing.assert_allclose(run.q, full.q, atol=1e-9)
    if scheme == ub.Static():
        assert run.parts == 24
        assert abs(run.q[-1]).max() < 1e-9 * abs(run.q).max()


@pytest.mark.parametrize("friction", [0.05, 0.25, 1.0])
def test_friction_that_sticks_and_slides(friction):
    """Its row is about the motion or about the force: no tangent of the one serves the other.

    No step is cut, and the motion is that of Newton's full method.  Each of 60 steps may leave
    1e-12 of some 2 N, which deflect the end by 1/3 m/N: together 4e-11 m.
    """
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e3, GA=1e3, EI=1.0, rhoA=1.0), cells=4)
    load = ub.PointLoad(beam.end, (0.5, 2.0), time=lambda t: math.sin(9 * t))
    rub = ub.Stretch(ub.ground(1.3, 0.4), beam.end, ub.Coulomb(friction))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load], connectors=[rub])

    def run(**options):
        newton = ub.Newton(rtol=1e-12, **options)
        return ub.simulate(scene, ub.Midpoint(0.05), t=(0, 1), dt=1 / 60, newton=newton, **QUIET)

    kept, full = run(modified=True), run()
    assert kept.parts == full.parts == 60
    np.testing.assert_allclose(kept.q, full.q, rtol=0, atol=1e-10)
    force = full.connector(rub).force
    assert [force.min(), force.max()] == pytest.approx([-friction, friction]), "it never turns"


class Killed(ub.Recorder):
    """Recorder that stops a run after some steps."""

    def __init__(self, after=None):
        self.after, self.steps = after, 0

    def open(self, simulation):
        pass

    def write(self, simulation):
        self.steps += 1
        if self.steps == self.after:
            raise RuntimeError("killed")

    def state(self):
        return {}

    def resume(self, simulation, state):
        pass


@pytest.mark.serial  # sums of several processes have no order
@pytest.mark.parametrize(
    "scheme", [ub.Midpoint(), ub.DecayingMidpoint(), ub.GeneralizedAlpha(), ub.Static()]
)
def test_a_run_goes_on_bit_for_bit(scheme, tmp_path):
    scene = cantilever((0, 1), lambda t: 4 * t)

    def run(name, after=None):
        file = ub.Checkpoint(tmp_path / name, every=3)
        more = {"record": Killed(after), "checkpoint": file, "newton": MODIFIED, **QUIET}
        return ub.simulate(scene, scheme, t=(0, 0.6), dt=0.02, **more)

    whole = run("whole")
    with pytest.raises(RuntimeError, match="killed"):
        run("killed", 11)
    resumed = run("killed")
    assert np.array_equal(resumed.q, whole.q)
    assert resumed.iterations == whole.iterations


@pytest.mark.serial
def test_a_loop_goes_on_bit_for_bit():
    """``state`` and ``resume`` of a simulation: the step after them has a new tangent in both."""
    scene, ends = cantilever((0, 1), lambda t: 4 * t), np.arange(1, 31) * 0.02
    one, other = (ub.Simulation(scene, ub.DecayingMidpoint(), newton=MODIFIED) for _ in range(2))
    for k, end in enumerate(ends):
        if k == 9:
            other.resume(one.state())
        one.step_to(end)
        if k >= 9:
            other.step_to(end)
    assert np.array_equal(one.q, other.q)
    assert one.iterations == other.iterations
    one.close()
    other.close()
