# SPDX-License-Identifier: MIT
"""The rule that chooses between two solutions: closed places stay closed while they can bear it.

The beams have no moment at their ends, so hinges of the section open in cells of the span.
"""

from functools import cache

import numpy as np
import pytest
from helpers import run

import ufl_beam as ub
from ufl_beam.discretization.state_io import Archive

LENGTH, EI, STIFF = 2.0, 1000.0, 1e6  # m, N m², N
LAWS = [ub.Softening, ub.LinearSoftening]
each_scheme = pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentum()], ids=str
)
jumps = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")

FOREVER = 1e9
"""A limit that nothing reaches, and its energy."""


def pushed(hinge=None, *, cells=8, fibres=None):
    """A beam on two supports that is moved by 5 mm at a quarter of its length, and back."""
    section = ub.Section(EA=STIFF, GA=STIFF, EI=EI, rhoA=1.0, rhoI=1e-3, hinge=hinge)
    if fibres is not None:
        section = ub.Section.rectangle(0.1, 0.1, E=1.2e8, nu=0.2, rho=100.0, fibres=fibres)
    beam = ub.Beam((0, 0), (LENGTH, 0), section, cells=cells)
    push = ub.PrescribedDisplacement(beam.at(0.25), v=ub.Table([0, 0.5, 1], [0, 0.005, 0]))
    return beam, ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end), push])


def in_steps(values, scheme):
    """What acts in the steps of an elastic run, from values at their ends."""
    return (1 - scheme.theta) * values[:-1] + scheme.theta * values[1:]


@cache
def largest_moment(scheme, dt):
    """Largest moment that acts in a step of a run in which the hinges stay closed; N m."""
    beam, scene = pushed(ub.Softening(FOREVER, FOREVER))
    solution = run(scene, scheme, dt=dt)
    K = np.array([solution.strains(beam, n)[:, 2] for n in range(len(solution))])
    M = beam.section.EI * K  # that hinges know of
    return np.abs(in_steps(M, scheme)).max()


# -- the choice ----------------------------------------------------------------------------------


@each_scheme
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("dt", [0.1, 0.02])
@pytest.mark.parametrize("energy", [1e-4, 1e-2, 100.0])
def test_a_limit_just_above_the_largest_moment_stays_closed(scheme, law, dt, energy):
    """By 0.1 %; runs are the same to 1e-10.  Iterates exceed the limit, by some per cent.

    The resistance falls from 0.01 to 1e4 times as fast as the cell can follow.
    """
    beam, scene = pushed(law(1.001 * largest_moment(scheme, dt), energy))
    solution = run(scene, scheme, dt=dt)
    assert solution.energy.lost["hinges"][-1] == 0.0
    assert not solution.material(beam).jump.any()
    assert (
        solution.substeps <= 1 / dt + 1
    )  # no step was cut; an EnergyMomentumStatic may divide the first


@jumps
@each_scheme
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("dt", [0.1, 0.02])
@pytest.mark.parametrize("energy", [1e-4, 100.0])
def test_a_limit_just_below_the_largest_moment_opens(scheme, law, dt, energy):
    """By 0.1 %: in dynamics, and in ``Static()`` unless it snaps back."""
    _, scene = pushed(law(0.999 * largest_moment(scheme, dt), energy))
    if energy < 1.0 and scheme == ub.Static():
        with pytest.raises(ub.ConvergenceError) as failure:
            run(scene, scheme, dt=dt)
        assert failure.value.time == pytest.approx(0.5, abs=3e-3)
        return
    solution = run(scene, scheme, dt=dt)
    assert solution.energy.lost["hinges"][-1] > 0.0


@jumps
@each_scheme
@pytest.mark.parametrize(("part", "opens"), [(1.001, False), (0.999, True)])
def test_cracks_of_fibres(scheme, part, opens):
    """The same of the stress of the outermost fibre; M and N of 4 fibres are linear in it."""
    dt, limit = 0.05, 1e15

    def moved(limit):
        law = ub.Fibres(ub.ElastoPlastic(np.inf), number=4, softening=ub.Softening(limit, 1e4))
        beam, scene = pushed(fibres=law)
        solution = run(scene, scheme, dt=dt)
        return solution, [solution.strains(beam, n) for n in range(len(solution))]

    _, strains = moved(limit)
    e = in_steps(np.array(strains), scheme)
    stress = 1.2e8 * (np.abs(e[..., 0]) + np.abs(e[..., 2]) * 3 / 8 * 0.1)
    solution, _ = moved(part * stress.max())
    assert (solution.energy.lost["hinges"][-1] > 0) == opens


@each_scheme
@pytest.mark.parametrize(("part", "opens"), [(1.001, False), (0.999, True)])
def test_springs_that_soften(scheme, part, opens):
    """A pushed bar with a spring at its end; springs share what cells know of each other."""
    dt, limit = 0.05, FOREVER

    def moved(limit):
        section = ub.Section(EA=STIFF, GA=STIFF, EI=EI, rhoA=1.0, rhoI=1e-3)
        beam = ub.Beam((0, 0), (LENGTH, 0), section, cells=4)
        law = ub.Softening(limit, FOREVER if limit == FOREVER else 100.0)
        spring = ub.Slide(
            beam.end, ub.ground(LENGTH, -1.0), ub.Spring(1e3, softening=law), axis=(0, 1)
        )
        push = ub.PointLoad(beam.end, force=(0, 100.0), amplitude=ub.Table([0, 0.5, 1], [0, 1, 0]))
        clamp = ub.Clamped(beam.start)
        scene = ub.Scene([beam], supports=[clamp], loads=[push], connectors=[spring])
        solution = run(scene, scheme, dt=dt)
        return solution, solution.connector(spring).force

    _, force = moved(limit)
    solution, _ = moved(part * np.abs(force).max())  # forces are those in the steps
    assert (solution.energy.lost["hinges"][-1] > 0) == opens


@jumps
def test_only_what_must_open_does():
    """Steps so long that several cells would exceed the limit at once: only the worst one opens.

    When it opens in a jump, the others unload.
    """
    beam, scene = pushed(ub.Softening(10.0, 1e-3), cells=16)
    solution = run(scene, ub.EnergyMomentum(), dt=0.1)
    n = int(np.argmax(solution.energy.lost["hinges"] > 0))
    assert (solution.material(beam, n).hinge > 0).sum() == 1


@jumps
def test_what_flows_is_part_of_the_state():
    """A run that goes on from a state in the middle of an opening: the same to the last digit."""
    _, scene = pushed(ub.Softening(10.0, 1.0))
    ends = np.linspace(0, 0.6, 61)[1:]
    one = ub.Simulation(scene, ub.EnergyMomentum())
    for n, t in enumerate(ends):
        one.step_to(t)
        if n == 40:
            one.save_or_restore(archive := Archive(one.subdomain))
            state, flows = archive.state(), [x.points["flows"].copy() for x in one.inelastic]
    assert one.comm.allreduce(sum(int((x == 1).sum()) for x in flows)) > 0
    other = ub.Simulation(scene, ub.EnergyMomentum())
    other.save_or_restore(Archive(other.subdomain, state))
    for here, there in zip(other.inelastic, flows, strict=True):
        np.testing.assert_array_equal(here.points["flows"], there)
    for t in ends[41:]:
        other.step_to(t)
    np.testing.assert_array_equal(one.subdomain.gather(one.q), other.subdomain.gather(other.q))
    assert one.iterations == other.iterations


# -- the order -----------------------------------------------------------------------------------


def chain(limits):
    """Blocks on a line behind springs that soften slowly, the last one pulled beyond the limits."""
    section = ub.Section(EA=STIFF, GA=STIFF, EI=EI)
    blocks = [ub.Beam((2 * i, 0), (2 * i + 1, 0), section, cells=1) for i in range(len(limits))]
    before = [ub.ground(-1, 0), *(block.end for block in blocks)]
    springs = [
        ub.Slide(a, b.start, ub.Spring(1e3, softening=ub.Softening(limit, 100.0)), axis=(1, 0))
        for a, b, limit in zip(before[:-1], blocks, limits, strict=True)
    ]
    guides = [ub.PrescribedDisplacement(block.start, v=0.0, psi=0.0) for block in blocks]
    pull = ub.PrescribedDisplacement(blocks[-1].end, u=lambda t: 1.3e-3 * len(limits) * t)
    return springs, ub.Scene(blocks, supports=[*guides, pull], connectors=springs)


@pytest.mark.parametrize(
    ("limits", "opens"),
    [
        ([1.5, 1.4, 1.6], [False, False, False]),
        ([1.0, 1.1, 1.2], [True, False, False]),
        ([1.2, 1.0, 1.1], [False, True, False]),
        ([1.0, 1.0 + 1e-6, 1.2], [True, False, False]),
        ([1.2, 1.0, 1.0 + 1e-11], [False, True, True]),  # alike but for a last digit
    ],
)
def test_the_largest_excess_opens_first(limits, opens):
    """In one step in which all springs would bear 1.3 N; one that opens relieves the others."""
    springs, scene = chain(limits)
    solution = run(scene, ub.EnergyMomentumStatic(), dt=1.0)
    assert [solution.connector(one).dissipated[-1] > 0 for one in springs] == opens
    force = min(*limits, 1.3)
    assert solution.connector(springs[0]).force[-1] == pytest.approx(force, rel=0.02)


def test_no_search_where_nothing_opens():
    """Steps are solved once, in as many iterations as if nothing could open."""
    _, scene = pushed()
    _, closed = pushed(ub.Softening(FOREVER, FOREVER))
    elastic = ub.Simulation(scene, ub.EnergyMomentum())
    assert not elastic.time_loop.opens
    assert (
        run(closed, ub.EnergyMomentum(), dt=0.01).iterations
        == run(scene, ub.EnergyMomentum(), dt=0.01).iterations
    )
