# SPDX-License-Identifier: MIT
"""The rule that chooses between two solutions: closed places stay closed while they can bear it.

The beams have no moment at their ends, so hinges of the section open in cells of the span.
"""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.errors import StepFailed
from ufl_beam.terms.openings import OVER, Openings, SearchFlags

LENGTH, EI, STIFF = 2.0, 1000.0, 1e6  # m, N m², N
LAWS = [ub.Softening, ub.LinearSoftening]
each_scheme = pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.ExactStatic(), ub.Midpoint()], ids=str
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
    push = ub.Prescribed(beam.at(0.25), v=ub.Table([0, 0.5, 1], [0, 0.005, 0]))
    return beam, ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end), push])


def run(scene, scheme, dt):
    return ub.simulate(scene, scheme, t=(0, 1), dt=dt, progress=False)


def in_steps(values, scheme):
    """What acts in the steps of an elastic run, from values at their ends."""
    return (1 - scheme.theta) * values[:-1] + scheme.theta * values[1:]


@cache
def largest_moment(scheme, dt):
    """Largest moment that acts in a step of a run in which the hinges stay closed; N m."""
    beam, scene = pushed(ub.Softening(FOREVER, FOREVER))
    solution = run(scene, scheme, dt)
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
    solution = run(scene, scheme, dt)
    assert solution.energy.lost["hinges"][-1] == 0.0
    assert not solution.material(beam).jump.any()
    assert solution.parts <= 1 / dt + 1  # no step was cut; an ExactStatic may divide the first


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
            run(scene, scheme, dt)
        assert failure.value.time == pytest.approx(0.5, abs=3e-3)
        return
    solution = run(scene, scheme, dt)
    assert solution.energy.lost["hinges"][-1] > 0.0


@jumps
@each_scheme
@pytest.mark.parametrize(("part", "opens"), [(1.001, False), (0.999, True)])
def test_cracks_of_fibres(scheme, part, opens):
    """The same of the stress of the outermost fibre; M and N of 4 fibres are linear in it."""
    dt, limit = 0.05, 1e15

    def moved(limit):
        law = ub.Fibres(ub.Hardening(np.inf), number=4, softening=ub.Softening(limit, 1e4))
        beam, scene = pushed(fibres=law)
        solution = run(scene, scheme, dt)
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
        push = ub.PointLoad(beam.end, force=(0, 100.0), time=ub.Table([0, 0.5, 1], [0, 1, 0]))
        clamp = ub.Clamped(beam.start)
        scene = ub.Scene([beam], supports=[clamp], loads=[push], connectors=[spring])
        solution = run(scene, scheme, dt)
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
    solution = run(scene, ub.Midpoint(), 0.1)
    n = int(np.argmax(solution.energy.lost["hinges"] > 0))
    assert (solution.material(beam, n).hinge > 0).sum() == 1


@pytest.mark.serial  # several processes take steps in Python
@jumps
@pytest.mark.parametrize("law", [None, ub.Softening(FOREVER, FOREVER), ub.Softening(10.0, 1e-3)])
def test_only_steps_in_which_something_opens_are_solved_again(law, monkeypatch):
    """All steps are solved in C, those without an opening once, with hinges and without."""
    solved, opened = [], []

    def counting(method, calls):
        def counted(self, *args, **keywords):
            calls.append(self)
            return method(self, *args, **keywords)

        return counted

    solver, openings = ub.solvers.newton.Solver, ub.terms.openings.Openings
    monkeypatch.setattr(solver, "solve", counting(solver.solve, solved))
    monkeypatch.setattr(openings, "open", counting(openings.open, opened))
    beam, scene = pushed(law)
    solution = run(scene, ub.Midpoint(), 0.01)
    assert not solved
    if law is None or law.limit == FOREVER:
        assert not opened
    else:
        energies = [solution.material(beam, n).hinge for n in range(len(solution))]
        newly = np.sum((np.diff(energies, axis=0) > 0).any(axis=1))
        assert newly > 0
        assert newly <= len(opened) <= 2 * newly


@jumps
def test_what_flows_is_part_of_the_state():
    """A run that goes on from a state in the middle of an opening: the same to the last digit."""
    _, scene = pushed(ub.Softening(10.0, 1.0))
    ends = np.linspace(0, 0.6, 61)[1:]
    one = ub.Simulation(scene, ub.Midpoint())
    for n, t in enumerate(ends):
        one.step_to(t)
        if n == 40:
            state, flows = one.state(), [x.points["flows"].copy() for x in one.inelastic]
    assert one.comm.allreduce(sum(int((x == 1).sum()) for x in flows)) > 0
    other = ub.Simulation(scene, ub.Midpoint())
    other.resume(state)
    for here, there in zip(other.inelastic, flows, strict=True):
        np.testing.assert_array_equal(here.points["flows"], there)
    for t in ends[41:]:
        other.step_to(t)
    np.testing.assert_array_equal(one.share.gather(one.q), other.share.gather(other.q))
    assert one.iterations == other.iterations


# -- the search ----------------------------------------------------------------------------------


class Fuses:
    """Places that open in the order of what they bear; each one that opens relieves the others."""

    def __init__(self, search, bears, stiff):
        self.search, self.bears, self.stiff = search, bears, stiff
        self.open = np.zeros(len(bears), dtype=bool)

    @property
    def stress(self):
        """In units of the limit."""
        return self.bears - self.stiff * self.open.sum()

    @property
    def over(self):
        return np.where(self.open, 0.0, self.stress - 1).clip(0.0)

    def release(self, least):
        self.open |= self.stress - 1 >= least

    def hold(self):
        self.open[:] = False


def search(bears, stiff, fails=lambda fuses: False):
    """What is open in each of the solutions that are sought, and whether the step began again."""
    search, seen, again = SearchFlags(), [], []
    fuses = Fuses(search, np.array(bears), stiff)
    alone = SimpleNamespace(alone=True, largest=lambda here: here)
    openings = Openings(search, [fuses], alone)

    def solve(q):
        if again:
            seen.append("free")
            return q
        seen.append(fuses.open.tolist())
        search.flags[OVER] |= fuses.over.max() > 0
        if fails(fuses):
            raise StepFailed("on purpose")
        return q + 1

    try:
        openings.solve(np.zeros(1), solve, lambda: again.append(True))
    finally:
        assert not fuses.open.any()
        assert not search.flags.any()
    return seen


def test_nothing_opens_below_its_limit():
    """One solution."""
    assert search([0.5, 1.0], 0.0) == [[False, False]]


def test_the_largest_excess_opens_first():
    """The others only if they still bear too much, then those with less of it as well."""
    assert search([1.2, 1.09, 0.5], 0.1) == [[False] * 3, [True, False, False]]
    one, two = [True, False, False], [True, True, False]
    assert search([1.2, 1.19, 0.5], 0.01) == [[False] * 3, one, two]
    assert search([1.2, 1.1, 1.09], 0.0) == [[False] * 3, one, [True] * 3]
    assert search([1.2, 1.2 - 1e-10, 1.1], 0.1) == [[False] * 3, two]  # alike but for a last digit


def test_places_are_free_where_holding_them_leads_nowhere():
    """The step begins again from its first guess; not if none has borne more than its limit."""
    assert search([1.2], 0.0, lambda fuses: True) == [[False], "free"]
    assert search([1.2], 0.0, lambda fuses: fuses.open.any()) == [[False], [True], "free"]
    with pytest.raises(StepFailed, match="on purpose"):
        search([0.9], 0.0, lambda fuses: True)


def test_no_search_where_nothing_opens():
    """There is no object for it."""
    _, scene = pushed()
    assert ub.Simulation(scene, ub.Static())._assembly.openings is None
