# SPDX-License-Identifier: MIT
"""Rayleigh damping with the committed tangent: closed forms, an independent integration, checks."""

import functools
import math

import numpy as np
import pytest
from helpers import assert_balanced, raises, require_restart
from scenes import clamped
from scipy.integrate import solve_ivp

import ufl_beam as ub
import ufl_beam.structures as st

pytestmark = pytest.mark.filterwarnings("ignore:.*it resists rigid turning and flow")

PLAIN = {"EA": 1e4, "GA": 4e3, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.01}  # N, N, N m², kg/m, kg m

# -- an oscillator: a bar without mass that yields, with a mass at its end -----------------------

STIFFNESS, AFTER_YIELD, LIMIT = 100.0, 20.0, 1.0  # N/m, N/m, N; mass 1 kg
A0, A1 = 0.2, 0.01  # 1/s, s: damping ratios 0.01 and 0.05
END = 2.0  # s, three periods


def force(t):
    """Load on the mass; N.  Its frequency is between those of both slopes."""
    return math.cos(6.0 * t)


def oscillator(damping, steps, scheme=None):
    """Displacement at the end, and the run."""
    # The slopes of bar and hardening are in series: 1/20 = 1/100 + 1/25.
    law = ub.ElastoPlastic(LIMIT, kinematic=25.0)
    bar = ub.Beam((0, 0), (1, 0), ub.Section(EA=STIFFNESS, GA=1.0, EI=1.0, axial=law), cells=1)
    mass = ub.PointMass(bar.end, 1.0, 1.0)
    load = ub.PointLoad(bar.end, force=(1.0, 0.0), amplitude=force)
    scene = clamped(bar, masses=[mass], loads=[load], damping=[damping])
    run = ub.simulate(scene, scheme or ub.EnergyMomentum(), t=(0, END), dt=END / steps)
    return run.displacement(bar.end)[-1, 0], run


@functools.cache
def integrated():
    """The displacement at the end, the loss, number of switches, fastest velocity by SciPy.

    The damping force is (a0 + a1 k) v with the slope k of the spring, which changes at a switch.
    """
    y = np.zeros(5)  # u, v, spring force, back force, loss
    t, flows, switches, fastest = 0.0, False, 0, 0.0
    while t < END:
        k = AFTER_YIELD if flows else STIFFNESS
        c = A0 + A1 * k

        def rates(t, y, k=k, c=c, flows=flows):
            v = y[1]
            return v, force(t) - c * v - y[2], k * v, flows * k * v, c * v**2

        def switch(_, y, flows=flows):
            return y[1] if flows else abs(y[2] - y[3]) - LIMIT

        # At a switch the value is zero; a step beyond it has the sign of the new branch.
        switch.terminal, switch.direction = True, -np.sign(y[1]) if flows else 1
        found = solve_ivp(rates, (t, END), y, events=switch, rtol=1e-12, atol=1e-14)
        t, y, fastest = found.t[-1], found.y[:, -1], max(fastest, abs(found.y[1]).max())
        if found.status == 1:
            flows, switches = not flows, switches + 1
            if not flows:  # its force is at the limit of the other direction of flow
                y[2] -= 1e-13 * np.sign(y[2] - y[3])
    return y[0], y[4], switches, fastest


def lag():
    """Bound of the error of the lag of a step at each switch, per second of the step [calc].

    The damping factor is off by a1 (k - k') for a step at most, the velocity by
    a1 (k - k') |v| dt/m, the displacement by this divided by the lower circular frequency.
    """
    *_, switches, fastest = integrated()
    return switches * A1 * (STIFFNESS - AFTER_YIELD) * fastest / math.sqrt(AFTER_YIELD)


@pytest.mark.parametrize("scheme", [ub.EnergyMomentum(), ub.Newmark()])
def test_a_yielding_oscillator_converges_with_first_order(scheme):
    """Against the integration by SciPy; the energy of damping as well.

    A velocity error dv of the bound changes the loss by 2 c v dv for the time of the run at most.
    """
    exact, lost, switches, fastest = integrated()
    assert switches == 8
    damping = ub.Rayleigh(mass=A0, stiffness=A1, tangent=True)
    for steps in (200, 800):
        found, run = oscillator(damping, steps, scheme)
        bound = lag() * END / steps
        assert abs(found - exact) < bound
        loss = 2 * (A0 + A1 * STIFFNESS) * fastest * bound * math.sqrt(AFTER_YIELD) * END
        assert abs(run.energy["damping"][-1] - lost) < loss
        assert np.diff(run.energy["damping"]).min() >= 0
    assert scheme != ub.EnergyMomentum() or run.energy.worst < 1e-9
    initial, _ = oscillator(ub.Rayleigh(mass=A0, stiffness=A1), steps, scheme)
    assert abs(initial - exact) > 0.4 * abs(exact)  # another problem


# -- beams -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scheme", "degree"), [(ub.EnergyMomentum(), 1), (ub.Newmark(), 2)])
def test_an_elastic_beam_is_damped_as_by_the_initial_stiffness(scheme, degree):
    """With rotations of 1e-12 the matrices are equal to 1e-12; 100 times this for 50 steps."""
    beam = ub.Beam((0, 0), (0.8, 0.6), ub.Section(**PLAIN), cells=3)
    load = ub.PointLoad(beam.end, force=(-0.6e-10, 0.8e-10))
    dampings = (ub.Rayleigh(mass=1, stiffness=1e-3, tangent=x) for x in (False, True))
    scenes = (clamped(beam, loads=[load], damping=[damping]) for damping in dampings)
    steps = {"t": (0, 0.5), "dt": 0.01, "mesh": ub.Mesh(degree=degree)}
    a, b = (ub.simulate(scene, scheme, **steps) for scene in scenes)
    np.testing.assert_allclose(a.q, b.q, rtol=0, atol=1e-10 * np.abs(a.q).max())
    np.testing.assert_allclose(a.energy["damping"], b.energy["damping"], rtol=1e-10)
    M, m = a.diagram(beam).M, b.diagram(beam).M
    np.testing.assert_allclose(M, m, rtol=0, atol=1e-10 * np.abs(M).max())


def test_rigid_rotation_is_damped_less_with_smaller_steps():
    """K follows the beam, but in a step of dt it is behind by a rotation ω dt.

    [closed] It stretches the axes of K by (ω dt)²/2, so the power is a1 EA L (ω² dt/2)²; the next
    term is (ω dt)² smaller, and the spin loses 1e-3 of its energy.
    """
    omega, a1, EA = 2 * math.pi, 1e-7, 1e6
    stiff = ub.Section(EA=EA, GA=4e5, EI=1e4, rhoA=1.0, rhoI=0.01)
    beam = ub.Beam((0, 0), (1, 0), stiff, cells=2)
    spin = ub.Velocity((beam,), angular=omega, about=(0.5, 0.0))
    scene = ub.Scene([beam], initial=[spin], damping=[ub.Rayleigh(stiffness=a1, tangent=True)])
    for dt in (0.01, 0.005):
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=dt)
        power = a1 * EA * (omega**2 * dt / 2) ** 2
        assert run.energy["damping"][-1] == pytest.approx(power * 0.5, rel=(omega * dt) ** 2 + 1e-3)
        assert run.energy.worst < 1e-9


YIELDING = {
    "hardening": {"bending": ub.ElastoPlastic(3.0, kinematic=5.0)},
    "perfect": {"bending": ub.ElastoPlastic(3.0)},
    "hinge": {"hinge": ub.Softening(3.0, 5.0)},
    "interaction": {"interaction": st.AxialBending(15.0, 4.0)},
}


def shaken(kind, scheme=None, t=(0, 0.8), tangent=True, **options):
    """A cantilever with a mass under a load that makes it yield, and its run; or of a section."""
    fibres = ub.Fibres(ub.ElastoPlastic(6e4), number=4, softening=ub.Softening(4e4, 400.0))
    section = ub.Section.rectangle(0.01, 0.1, E=1.2e8, nu=0.3, rho=1e3, fibres=fibres)
    if kind != "fibres":
        section = ub.Section(**PLAIN, **YIELDING[kind]) if kind in YIELDING else kind
    beam = ub.Beam((0, 0), (1, 0.3), section, cells=4)
    load = ub.PointLoad(beam.end, force=(3.0, -14.0), amplitude=lambda t: math.sin(9 * t))
    damping = ub.Rayleigh(mass=0.5, stiffness=2e-3, tangent=tangent)
    masses = [ub.PointMass(beam.end, 0.5, 0.01)]
    scene = clamped(beam, loads=[load], damping=[damping], masses=masses)
    return beam, ub.simulate(scene, scheme or ub.EnergyMomentum(), t=t, dt=0.01, **options)


@pytest.mark.parametrize("kind", [*YIELDING, "fibres"])
def test_softening_supplies_no_energy(kind):
    """The ledger closes, and the loss by damping grows in each step, smaller than that of K(0)."""
    runs = [shaken(kind, tangent=x)[1] for x in (True, False)]
    for run in runs:
        assert_balanced(run.energy)
        assert run.energy["damping"][-1] > 0
    assert sum(runs[0].energy[x][-1] for x in ("plastic", "hinges") if x in runs[0].energy) > 0.1
    assert runs[0].energy["damping"][-1] < 0.6 * runs[1].energy["damping"][-1]


@pytest.mark.parametrize("kind", ["fibres", pytest.param("hinge", marks=pytest.mark.slow)])
def test_the_reference_solver_finds_the_same(kind, as_by_reference):
    """Tolerance: variables of laws have 9 digits, as corrections below this end their iteration."""
    run = shaken(kind, t=(0, 0.15), newton=ub.Newton(rtol=1e-12))[1]
    as_by_reference(run)


@pytest.mark.parametrize("scheme", [ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha()])
def test_runs_continue_with_the_same_tangents(scheme, tmp_path):
    """Bit for bit from a checkpoint, to digits of Newton's method from `start=`."""
    _, run = shaken("hardening", scheme)
    assert np.diff(run.energy["plastic"])[40] > 0  # it flows when the runs continue

    def simulate(scene, scheme, t, **options):
        options = {"newton": ub.Newton(rtol=1e-12), "dt": 0.01, **options}
        return ub.simulate(scene, scheme, t=t, **options)

    require_restart(simulate, run.scene, [], scheme, tmp_path, 0.8)


def test_a_flowing_cell_has_no_damping_moment():
    """A perfectly plastic cell bears its yield moment while it flows, except in the first step.

    With the initial stiffness the moment a1 EI dκ/dt is added, see docs/howto_earthquake.md.
    """
    section = ub.Section(EA=1e4, GA=4e3, EI=100.0, bending=ub.ElastoPlastic(3.0))
    excess = {}
    for tangent in (True, False):
        beam, run = shaken(section, tangent=tangent)
        place = beam.at(1 / 8)  # middle of the first cell
        moment = np.abs(run.section_forces_at(place)[1:, 2])
        flows = np.diff(run.material_at(place).plastic) > 0
        excess[tangent] = (moment[1:][flows[1:] & flows[:-1]] / 3.0 - 1).max()
    assert abs(excess[True]) < 1e-7
    assert excess[False] > 0.5


def test_first_step_after_statics_is_elastic():
    """`start=` a static run that yielded: small vibrations unload the state, so K is elastic."""
    law = ub.ElastoPlastic(3e-4, kinematic=5.0)
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**PLAIN, bending=law), cells=2)
    load = ub.PointLoad(beam.end, force=(0.0, 5e-4))
    pulled = ub.simulate(clamped(beam, loads=[load]), ub.Static(), t=(0, 1), dt=0.1)
    scene = clamped(beam, loads=[load], damping=[ub.Rayleigh(stiffness=1e-3, tangent=True)])
    for at in (pulled, ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.3), dt=0.01, start=pulled)):
        damped = ub.modes(scene, 1, at=at)
        np.testing.assert_allclose(damped.damping, 1e-3 * damped.omega / 2, rtol=1e-4)


def test_bad_tangents_are_refused():
    with raises("Rayleigh: tangent=True has no effect with stiffness = 0"):
        ub.Rayleigh(mass=1.0, tangent=True)
    with raises("Rayleigh: tangent = 1 must be True or False"):
        ub.Rayleigh(stiffness=1.0, tangent=1)
    assert ub.Rayleigh.with_ratios(0.03, (5.0, 50.0), tangent=True).tangent
