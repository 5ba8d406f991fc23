# SPDX-License-Identifier: MIT
"""Derivatives of runs: closed forms, laws of users, ranges and switches, and wrong arguments.

Tolerances of closed forms are 1e-9: differences of numbers of the scene have errors of 1e-12, and
the solutions of steps of 1e-13, which derivatives by small parts of a result amplify.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

from mpi4py import MPI

import numpy as np
import pytest
from helpers import raises
from run_differences import FORWARD, TIGHT, difference, errors, history, relative_error
from scenes import clamped
from user_laws import (
    Dashpot,
    Exponential,
    Petersson,
    PowerLaw,
    Rising,
    SameHardening,
    Stiffening,
)

import ufl_beam as ub

EXACT = 1e-9
AGREE = 1e-7
"""Differences of runs have 8 to 10 digits at the best change of the parameter."""

RUN = {"t": (0, 1), "dt": 0.25, "newton": TIGHT, "progress": False}


def tip(solution):
    """Displacements and rotation of the end of the first beam."""
    return solution.displacement(solution.scene.beams[0].end)


# -- closed forms ----------------------------------------------------------------------------------


def deflected(EI=4e3, GA=5e5, force=1e-3, length=2.0):
    """Cantilever of 4 cells under a small force."""
    beam = ub.Beam((0, 0), (length, 0), ub.Section(EA=1e6, GA=GA, EI=EI), cells=4)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, force))])


def test_a_cantilever_under_a_small_force():
    """Its tip moves by F L³ (1 - 1/(4 n²))/(3 EI) + F L/GA in n cells with one point each.

    The rotation is 1e-6, so that terms of second order are 1e-12.
    """
    EI, GA, F, L = 4e3, 5e5, 1e-3, 2.0
    run = ub.differentiate(
        deflected, {"EI": EI, "GA": GA, "force": F, "length": L}, ub.Static(), **RUN
    )
    n = 1 - 1 / 64
    bending = F * L**3 * n / (3 * EI)
    shear = F * L / GA
    expected = [-bending / EI, -shear / GA, (bending + shear) / F, (3 * bending + shear) / L]
    assert run.of(lambda s: tip(s)[-1, 1]) == pytest.approx(expected, rel=EXACT)
    clamp = run.of(lambda s: s.reaction(s.scene.supports[0])[-1])
    np.testing.assert_allclose(clamp[1], [0, 0, -1, 0], atol=EXACT)  # -F
    np.testing.assert_allclose(clamp[2], [0, 0, -L, -F], atol=EXACT * F)  # -F L


def swinging(k=20.0, m=3.0, v0=0.4):
    """A mass on a spring, which slides on the ground."""
    body = ub.Body((0, 0), mass=m, inertia=1.0)
    spring = ub.Slide(ub.ground(0, 0), body.at(0, 0), ub.Spring(k), axis=(1, 0))
    return ub.Scene(
        [], bodies=[body], connectors=[spring], initial=[ub.Velocity([body], linear=(v0, 0))]
    )


def test_an_oscillator_by_the_midpoint_rule():
    """u_n = v0 sin(n φ)/ω with φ = 2 arctan(ω dt/2), the closed form of the midpoint rule."""
    k, m, v0, dt, n = 20.0, 3.0, 0.4, 0.05, np.arange(41)
    run = ub.differentiate(
        swinging, {"k": k, "m": m, "v0": v0}, ub.EnergyMomentum(),
        t=(0, 2), dt=dt, newton=TIGHT, progress=False,
    )  # fmt: skip
    ω = math.sqrt(k / m)
    φ, slope = 2 * math.atan(ω * dt / 2), dt / (1 + (ω * dt / 2) ** 2)
    u, v = v0 / ω * np.sin(n * φ), v0 * np.cos(n * φ)
    by_ω = v * n * slope / ω - u / ω, -v0 * np.sin(n * φ) * n * slope

    def motion(s):
        center = s.scene.bodies[0].at(0, 0)
        return s.displacement(center)[:, 0], s.velocity(center)[:, 0]

    found, expected = run.of(motion), np.array([u, v])
    np.testing.assert_allclose(motion(run.solution), expected, atol=EXACT)
    for p, factor in enumerate((ω / (2 * k), -ω / (2 * m))):
        by = factor * np.array(by_ω)
        np.testing.assert_allclose(found[:, :, p], by, atol=EXACT * np.abs(by).max())
    np.testing.assert_allclose(found[:, :, 2], expected / v0, atol=EXACT)
    stored = run.of(lambda s: s.energy.state["stored"])  # k u²/2
    by_v0 = k * u**2 / v0
    # Differences of quantities have an error of 1e-11 of the quantity over that of the parameter
    np.testing.assert_allclose(stored[:, 2], by_v0, atol=1e-8 * by_v0.max())


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic(0.7)], ids=type)
def test_hardening_under_tension(scheme):
    """The end moves by L (N/EA + (N - N_y)/H); functions of time have parameters, too."""
    L, EA, H, N_y, N, rate = 2.0, 1e6, 3e4, 40.0, 100.0, 1.3

    def bar(EA, H, N_y, N, rate):
        law = ub.ElastoPlastic(N_y, isotropic=H)
        section = ub.Section(EA=EA, GA=EA, EI=EA, axial=law)
        beam = ub.Beam((0, 0), (L, 0), section, cells=2)
        pull = ub.PointLoad(beam.end, force=(N, 0), amplitude=lambda t: math.sin(rate * t))
        return clamped(beam, loads=[pull])

    at = {"EA": EA, "H": H, "N_y": N_y, "N": N, "rate": rate}
    run = ub.differentiate(bar, at, scheme, **RUN)
    found, force, slope = run.of(lambda s: tip(s)[-1, 0]), N * math.sin(rate), L * (1 / EA + 1 / H)
    expected = [
        -L * force / EA**2, -L * (force - N_y) / H**2, -L / H, slope * force / N,
        slope * N * math.cos(rate),
    ]  # fmt: skip
    if isinstance(scheme, ub.Static):
        assert found == pytest.approx(expected, rel=EXACT)
    else:  # forces hold within the step, at 0.7 of it
        best = errors(bar, at, scheme, t=(0, 1), dt=0.25, changes=(1e-4, 1e-5), enough=AGREE)
        assert max(best.values()) < AGREE


def pulled(N_y, N, H=1e6):
    """A bar of one cell under a force that grows."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e6, axial=ub.ElastoPlastic(N_y, isotropic=H))
    beam = ub.Beam((0, 0), (2, 0), section, cells=1, name="bar")
    pull = ub.PointLoad(beam.end, force=(N, 0), amplitude=lambda t: t)
    return clamped(beam, loads=[pull])


def test_a_spring_and_a_support_that_moves():
    """The force of a spring is k a t; force and support are in opposite directions."""

    def moved(k, a):
        beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e6, GA=1e6, EI=1e6), cells=1)
        lift = ub.PrescribedDisplacement(beam.start, u=lambda t: a * t, v=0, psi=0)
        spring = ub.Slide(ub.ground(0, 0), beam.start, ub.Spring(k), axis=(1, 0))
        return ub.Scene([beam], supports=[lift], connectors=[spring])

    k, a = 30.0, 0.02
    run = ub.differentiate(moved, {"k": k, "a": a}, ub.Static(), **RUN)
    t = run.solution.times
    np.testing.assert_allclose(run.of(tip)[:, 0], np.column_stack([0 * t, t]), atol=EXACT)
    force = run.of(lambda s: s.reaction(s.scene.supports[0])[:, 0])
    np.testing.assert_allclose(force, np.column_stack([a * t, k * t]), atol=EXACT * k)


def test_hinges_of_zero_length():
    """A hinge turns by (M - M_y)/H, M = F L for small forces."""
    L, F, M_y, H = 2.0, 1e-3, 5e-4, 40.0

    def hinged(M_y, H):
        section = ub.Section(EA=1e6, GA=1e6, EI=1e6)
        law = ub.ElastoPlastic(M_y, isotropic=H)
        beam = ub.Beam((0, 0), (L, 0), section, cells=2, hinges={0.0: law})
        push = ub.PointLoad(beam.end, force=(0, F), amplitude=lambda t: t)
        return clamped(beam, loads=[push])

    run = ub.differentiate(hinged, {"M_y": M_y, "H": H}, ub.Static(), **RUN)
    turned = run.of(lambda s: tip(s)[-1, 2])
    # The rotation is 4e-5, so that the lever arm is shorter by 1e-9
    assert turned == pytest.approx([-1 / H, -(F * L - M_y) / H**2], rel=1e-8)


# -- what users write ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pulling(ub.extend.ConnectorLaw):
    """A spring that stiffens, beside a damper and a spring that creeps."""

    k: float
    cubic: float
    time: float
    variables: ClassVar = {"creep": 0.0}

    def energy(self, motion, state):
        stretch = motion - state.creep
        return self.k * stretch**2 / 2 + self.cubic * motion**4 / 4

    def increments(self, motion, rate, state, dt):
        return {"creep": (motion - state.creep) / (self.time / dt + 1)}


def struck(law=None, *, hinges=None, softening=None, connectors=None):
    """A cantilever that is struck at its end."""
    section = ub.Section(
        EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01, bending=law,
        **({"hinge": softening} if softening else {}),
    )  # fmt: skip
    beam = ub.Beam((0, 0), (1, 0), section, cells=3, hinges=hinges or {})
    blow = ub.PointLoad(beam.end, force=(0, 30.0), amplitude=lambda t: math.sin(9 * t))
    end = connectors(beam.end) if connectors else []
    return clamped(beam, loads=[blow], connectors=end, masses=[ub.PointMass(beam.end, 0.5)])


LAWS = {
    "power law": (
        lambda M0, k0, n: struck(PowerLaw(M0, k0, n)), {"M0": 20.0, "k0": 0.05, "n": 3.0}
    ),
    "dashpot": (lambda eta: struck(Dashpot(eta)), {"eta": 50.0}),
    "hardening by residuals": (
        lambda M, H, B: struck(SameHardening(M, H, B, 0.0)), {"M": 9.0, "H": 20.0, "B": 7.0}
    ),
    "stiffening": (lambda cubic: struck(Stiffening(cubic)), {"cubic": 300.0}),
    "hinge, exponential": (
        lambda M, G: struck(hinges={0.0: Exponential(M, G)}), {"M": 9.0, "G": 4.0}
    ),
    "hinge, two lines": (
        lambda M, G: struck(hinges={0.0: Petersson(M, G)}), {"M": 9.0, "G": 4.0}
    ),
    "hinge, rising": (
        lambda M, width: struck(hinges={0.0: Rising(M, width)}), {"M": 9.0, "width": 0.5}
    ),
    "hinge in cells": (
        lambda M, G: struck(softening=Exponential(M, G)), {"M": 9.0, "G": 4.0}
    ),
    "connector": (
        lambda k, cubic, time: struck(
            connectors=lambda end: [
                ub.Slide(ub.ground(1, 0), end, Pulling(k, cubic, time), axis=(0, 1))
            ]
        ),
        {"k": 150.0, "cubic": 900.0, "time": 0.2},
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*hinge:ufl_beam.ModelWarning")
@pytest.mark.parametrize("name", LAWS)
def test_laws_of_users(name):
    """Motions, against differences of runs; the blow yields each law, and unloads it."""
    model, at = LAWS[name]
    best = errors(
        model,
        at,
        ub.EnergyMomentum(0.05),
        t=(0, 0.6),
        dt=0.01,
        changes=(1e-4, 1e-5, 1e-6),
        enough=AGREE,
    )
    assert max(best.values()) < AGREE, best


# -- quantities ------------------------------------------------------------------------------------


def yielding(limit=9.0, EI=100.0, load=40.0, length=1.0, cells=3):
    """A column that yields, and a mass on it."""
    law = ub.ElastoPlastic(limit, isotropic=3.0, kinematic=2.0)
    section = ub.Section(EA=1e5, GA=1e5, EI=EI, rhoA=1.0, rhoI=0.01, bending=law)
    beam = ub.Beam((0, 0), (0, length), section, cells=cells, name="column")
    blow = ub.PointLoad(beam.end, force=(load, 0), amplitude=lambda t: math.sin(9 * t))
    return clamped(beam, loads=[blow], masses=[ub.PointMass(beam.end, 0.5)])


DYNAMIC = {"t": (0, 0.6), "dt": 0.01}

QUANTITIES = {
    "largest displacement": lambda s: tip(s)[:, 0].max(),
    "velocity": lambda s: s.velocity(s.scene.beams[0].end),
    "reaction": lambda s: s.reaction(s.scene.supports[0])[1:],  # unknown at first
    "moment": lambda s: s.diagram(s.scene.beams[0], n=10).M,
    "work and losses": lambda s: [s.energy.supplied["loads"], s.energy.lost["plastic"]],
    "energies": lambda s: [s.energy.state["stored"], s.energy.state["kinetic"]],
}


@pytest.mark.parametrize("name", QUANTITIES)
def test_quantities(name):
    """Motions and reactions, and what needs material and energies.

    Rates and forces divide motions by dt or by the axial flexibility, and lose two digits by it.
    """
    at = {"limit": 9.0, "load": 40.0, "length": 1.0}
    best = errors(
        yielding,
        at,
        ub.EnergyMomentum(0.05),
        QUANTITIES[name],
        changes=(1e-4, 1e-5),
        enough=100 * AGREE,
        **DYNAMIC,
    )
    assert max(best.values()) < 100 * AGREE, best


def test_quantities_may_be_complex():
    """The derivative of i u is i times that of u."""
    run = ub.differentiate(yielding, {"load": 40.0}, ub.EnergyMomentum(), progress=False, **DYNAMIC)
    np.testing.assert_allclose(run.of(lambda s: (1 + 2j) * tip(s)), (1 + 2j) * run.of(tip))


def test_the_shape_of_derivatives():
    run = ub.differentiate(yielding, {"load": 40.0, "EI": 100.0}, ub.EnergyMomentum(), **DYNAMIC)
    assert list(run.at) == list(run.ranges) == ["load", "EI"]
    assert run.of(tip).shape == (61, 3, 2)
    assert run.of(lambda s: tip(s)[-1, 0]).shape == (2,)
    assert "load = 40, EI = 100" in repr(run)
    plain = ub.simulate(yielding(), ub.EnergyMomentum(), comm=MPI.COMM_SELF, **DYNAMIC)
    assert np.array_equal(run.solution.q, plain.q)  # derivatives leave the run as it is


@pytest.mark.parametrize("shift", [(0, 0), (300, -200)])
def test_the_geometry(shift):
    """By the place of a vertex, of two beams with a corner; everywhere in the plane."""
    x, y = shift

    def bent(height, span):
        section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01)
        column = ub.Beam((x, y), (x, y + height), section, cells=2)
        girder = ub.Beam((x, y + height), (x + span, y + height), section, cells=2)
        corner = ub.Rigid(column.end, girder.start)
        return ub.Scene(
            [column, girder], joints=[corner], loads=[ub.Gravity()],
            supports=[ub.Clamped(column.start)],
        )  # fmt: skip

    at = {"height": 1.0, "span": 0.7}
    enough = AGREE * (100 if x else 1)  # coordinates of 300 m have two digits less
    best = errors(
        bent, at, ub.EnergyMomentum(), t=(0, 0.3), dt=0.01, changes=(1e-3, 1e-4), enough=enough
    )
    assert max(best.values()) < enough, best


def test_an_infinite_limit_is_an_elastic_law():
    at = {"EI": 100.0, "load": 40.0}

    def elastic(EI, load):
        return yielding(math.inf, EI, load)

    run = ub.differentiate(elastic, at, ub.EnergyMomentum(), newton=TIGHT, **DYNAMIC)
    found = run.of(history)
    assert np.isfinite(found).all()
    assert all(one.change == math.inf for one in run.ranges.values())
    best = errors(elastic, at, ub.EnergyMomentum(), changes=(1e-3, 1e-4), enough=AGREE, **DYNAMIC)
    assert max(best.values()) < AGREE


def test_divided_steps():
    """A bar that begins to flow in the second step, which is divided.

    It stores N² L/(2 EA), and dissipates N_y (N - N_y) L/H.
    """
    L, EA, H, N_y, N = 2.0, 1e6, 1e6 / 30, 40.0, 100.0
    at = {"N_y": N_y, "N": N}
    found = ub.differentiate(lambda N_y, N: pulled(N_y, N, H), at, ub.Static(), **RUN)
    assert found.solution.substeps > len(found.solution) - 1
    expected = [-L / H, L * (1 / EA + 1 / H)]  # see test_hardening_under_tension
    assert found.of(lambda s: tip(s)[-1, 0]) == pytest.approx(expected, rel=EXACT)
    stored, lost = found.of(lambda s: (s.energy.state["stored"][-1], s.energy.lost["plastic"][-1]))
    assert stored == pytest.approx([0, N * L / EA], rel=EXACT, abs=1e-9)
    assert lost == pytest.approx([(N - 2 * N_y) * L / H, N_y * L / H], rel=EXACT)


@pytest.mark.parametrize("near", [1e-4, 1e-6, 1.1e-8])
def test_energies_beside_a_switch(near):
    """The bar has just begun to flow: it dissipates N_y (N - N_y) L/H, on one side of the switch.

    Round-off of the differences: 1e-16 N_y over steps of a fifth of the distance, times 10.
    """
    L, H, N_y = 2.0, 1e6 / 30, 40.0
    at = {"N_y": N_y, "N": N_y * (1 + near)}
    found = ub.differentiate(lambda N_y, N: pulled(N_y, N, H), at, ub.Static(), **RUN)
    assert found.ranges["N"].change == pytest.approx(near * N_y, rel=1e-3)
    lost = found.of(lambda s: s.energy.lost["plastic"][-1])
    assert lost == pytest.approx(
        [-N_y * L / H, N_y * L / H], rel=max(1e-15 / (near / 5), 1e-6) + near
    )


def test_energies_at_a_switch():
    """Differences cannot keep to one side of a switch that is nearer than their round-off."""
    at = {"N": 40.0 * (1 + 1e-11)}
    found = ub.differentiate(lambda N: pulled(40.0, N, 1e6 / 30), at, ub.Static(), **RUN)
    with pytest.warns(ub.ModelWarning, match="of: a change of N by 4e-10 is a switch of the run"):
        found.of(lambda s: s.energy.lost["plastic"][-1])


def test_too_many_substeps(monkeypatch):
    """Energies are refused after more substeps than there is space for."""
    monkeypatch.setattr("ufl_beam.analysis.derivatives.MOST_SUBSTEPS", 3)
    at = {"N_y": 40.0, "N": 100.0}
    options = {**RUN, "dt": 1.0}
    found = ub.differentiate(lambda N_y, N: pulled(N_y, N, 1e6 / 30), at, ub.Static(), **options)
    assert found.solution.substeps == 5
    with raises("of: this quantity needs material or energies", "use a smaller dt"):
        found.of(lambda s: s.energy.state["stored"])


def test_two_runs_give_the_derivatives_of_one():
    """The second run begins with the state, and its derivatives, of the first one."""
    at, options = {"limit": 9.0, "load": 40.0}, {"dt": 0.01, "newton": TIGHT, "progress": False}
    scheme = ub.EnergyMomentum(0.05)
    whole = ub.differentiate(yielding, at, scheme, t=(0, 0.6), **options)
    first = ub.differentiate(yielding, at, scheme, t=(0, 0.3), **options)
    second = ub.differentiate(yielding, at, scheme, t=(0.3, 0.6), start=first, **options)
    for quantity in (tip, lambda s: s.energy.lost["plastic"], lambda s: s.energy.supplied["loads"]):
        one, half = whole.of(quantity), second.of(quantity)
        both = one[30:] if len(half) == 31 else one
        assert relative_error(half, both) < 1e-9  # times differ by round-off
    with raises("differentiate: start ends at t = 0.3 s", "begin there, at the same values"):
        ub.differentiate(yielding, at, scheme, t=(0.2, 0.6), start=first, **options)
    turned = dict(reversed(at.items()))  # derivatives have this order
    with raises("at the same values in the same order"):
        ub.differentiate(yielding, turned, scheme, t=(0.3, 0.6), start=first, **options)
    assert whole.ranges["limit"].time < 0.3
    for name, near in whole.ranges.items():  # switches of the first run count as well
        assert second.ranges[name].change == pytest.approx(near.change, rel=1e-6)
        assert second.ranges[name].time == pytest.approx(near.time)


def test_energies_of_a_static_run_that_continues():
    """N² L/(2 EA), and the work of the force; the first run has one step."""
    L, N_y, N, EA = 2.0, 60.0, 100.0, 1e6
    at, options = {"N_y": N_y, "N": N}, {"dt": 0.5, "newton": TIGHT, "progress": False}
    first = ub.differentiate(pulled, at, ub.Static(), t=(0, 0.5), **options)
    second = ub.differentiate(pulled, at, ub.Static(), t=(0.5, 1), start=first, **options)
    whole = ub.differentiate(pulled, at, ub.Static(), t=(0, 1), **options)

    def energies(s):
        return s.energy.state["stored"][-1], s.energy.supplied["loads"][-1]

    found = second.of(energies)
    assert found[0] == pytest.approx([0, L * N / EA], rel=1e-7, abs=1e-10)
    np.testing.assert_allclose(found, whole.of(energies), rtol=1e-7, atol=1e-12)


def test_energies_after_divided_steps():
    """The first run is divided, the second one is not; see test_divided_steps."""
    at = {"N_y": 40.0, "N": 100.0}

    def bar(N_y, N):
        return pulled(N_y, N, 1e6 / 30)

    options = {"newton": TIGHT, "progress": False}
    first = ub.differentiate(bar, at, ub.Static(), t=(0, 0.5), dt=0.25, **options)
    second = ub.differentiate(bar, at, ub.Static(), t=(0.5, 1), dt=0.25, start=first, **options)
    assert first.solution.substeps > 2
    lost = second.of(lambda s: s.energy.lost["plastic"][-1])
    assert lost == pytest.approx([20.0 * 2 * 30e-6, 40.0 * 2 * 30e-6], rel=EXACT)


def test_runs_with_another_mesh_do_not_continue():
    at, options = {"load": 40.0}, {"dt": 0.1, "progress": False}
    first = ub.differentiate(yielding, at, ub.Static(), t=(0, 0.1), **options)
    more = {"t": (0.1, 0.2), "start": first, **options}
    with raises("differentiate: start has mesh = None; continue with the same one"):
        ub.differentiate(yielding, at, ub.Static(), mesh=ub.Mesh(degree=2), **more)


# -- ranges and switches ---------------------------------------------------------------------------


def test_ranges_of_a_bar_in_closed_form():
    """Forces of 25, 50, 75, 100 N beside a limit of 40 N.

    The first step yields at a limit of 25 N, the second one not at 50 N; at N = 80 N it does not.
    """

    run = ub.differentiate(pulled, {"N_y": 40.0, "N": 100.0}, ub.Static(), **RUN)
    by_limit, by_force = run.ranges.values()
    assert by_limit.change == pytest.approx(10, rel=EXACT)
    assert by_force.change == pytest.approx(20, rel=EXACT)
    assert by_limit[1:] == by_force[1:] == (0.5, "bar at (1, 0)")
    assert "change=10" in repr(by_limit)


def yields(limit):
    """Whether the one cell of a column yields, step by step."""
    scheme = ub.EnergyMomentum(0.05)
    run = ub.simulate(yielding(limit, cells=1), scheme, newton=TIGHT, **DYNAMIC)
    return np.diff(run.energy.lost["plastic"]) > 0


def test_ranges_are_where_the_run_switches():
    """The range is 1 % of the limit.  It is of first order, and hence right to some per cent.

    The moment passes zero in the run, which is no switch.
    """
    limit = 9.0
    run = ub.differentiate(
        lambda limit: yielding(limit, cells=1), {"limit": limit}, ub.EnergyMomentum(0.05),
        newton=TIGHT, **DYNAMIC,
    )  # fmt: skip
    near, here = run.ranges["limit"], yields(limit)
    inside = [np.array_equal(yields(limit + k * near.change), here) for k in (-0.97, 0.97)]
    assert all(inside)
    beyond = [yields(limit + k * near.change) for k in (-1.03, 1.03)]
    changed = [np.flatnonzero(other != here) for other in beyond]
    step = min(int(x) for found in changed for x in found)
    assert run.solution.times[1 + step] == pytest.approx(near.time)
    assert near.place == "column at (0, 0.5)"


def switch_near(limit, change):
    """The limit at which the run switches, by bisection; a value on either side of it."""
    here = yields(limit)
    side = next(s for s in (-1, 1) if not np.array_equal(yields(limit + 1.1 * s * change), here))
    near, far = limit, limit + 1.1 * side * change
    while abs(far - near) > 1e-11 * limit:
        middle = (near + far) / 2
        if np.array_equal(yields(middle), here):
            near = middle
        else:
            far = middle
    return sorted((near, far))


def test_one_sided_derivatives_at_a_switch():
    """Each side of a switch has its derivative; central differences across it are their mean."""
    options = {"scheme": ub.EnergyMomentum(0.05), "newton": TIGHT, **DYNAMIC, "progress": False}

    def column(limit):
        return yielding(limit, cells=1)

    near = ub.differentiate(column, {"limit": 9.0}, **options).ranges["limit"]
    below, above = switch_near(9.0, near.change)
    nudge = 1e-9 * below

    def run(limit):
        return ub.simulate(column(limit), **options).q

    found = []
    for x, side in ((below - nudge, -1), (above + nudge, 1)):
        derivative = ub.differentiate(column, {"limit": x}, **options).of(history)[..., 0]
        found.append(derivative)
        fd = [difference(run, x, side * part * x, FORWARD) for part in (1e-5, 1e-6)]
        assert min(relative_error(derivative, one) for one in fd) < AGREE
    jump = relative_error(*found)
    assert jump > 1e-3
    central = (run(above + 1e-6 * above) - run(below - 1e-6 * below)) / (1e-6 * (below + above))
    assert relative_error((found[0] + found[1]) / 2, central) < 0.01 * jump


def test_a_parameter_at_the_end_of_its_range():
    """A viscosity of zero grows only; the derivative is that of larger values."""

    def creeping(eta):
        law = ub.ElastoPlastic(9.0, isotropic=3.0, viscosity=ub.Perzyna(eta))
        section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01, bending=law)
        beam = ub.Beam((0, 0), (1, 0), section, cells=2)
        lift = ub.PrescribedDisplacement(beam.end, v=lambda t: 0.1 * t)
        push = ub.PointLoad(beam.at(0.5), force=(0, 3.0), amplitude=lambda t: t)
        return clamped(beam, lift, loads=[push])

    options = {"t": (0, 1), "dt": 0.1, "newton": TIGHT, "progress": False}
    found = ub.differentiate(creeping, {"eta": 0.0}, ub.Static(), **options).of(history)[..., 0]

    def run(eta):
        return ub.simulate(creeping(eta), ub.Static(), **options).q

    fd = [difference(run, 0.0, h, FORWARD) for h in (1e-3, 1e-4)]
    assert min(relative_error(found, one) for one in fd) < AGREE


# -- what is refused -------------------------------------------------------------------------------


def refuse(*parts, model=yielding, at=(("load", 40.0),), scheme=None, **options):
    """Differentiating raises an error with these words, before or after the run."""
    options = {"t": (0, 0.02), "dt": 0.01, "progress": False, **options}
    with raises(*parts):
        ub.differentiate(model, dict(at), scheme or ub.EnergyMomentum(), **options)


def test_parameters_that_do_not_fit():
    refuse("differentiate: at has no parameters", at=())
    refuse(
        "differentiate: model has other parameters than at:",
        "unexpected keyword argument 'EJ'",
        at={"EJ": 1.0},
    )
    refuse("differentiate: at['EI']", "'stiff'", at={"EI": "stiff"})
    refuse("Section: EI = -1 must be positive", at={"EI": -1.0})


def test_a_parameter_that_does_not_enter():
    """Neither a name that the model ignores nor density in statics; a force of zero enters."""

    def model(load, rho=1.0, unused=0.0):
        section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=rho)
        beam = ub.Beam((0, 0), (1, 0), section, cells=2)
        return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, load))])

    def run(at, **more):
        return ub.differentiate(model, at, ub.Static(), t=(0, 1), dt=1.0, progress=False, **more)

    for name in "unused", "rho":
        with raises(f"differentiate: the run does not depend on {name}; remove it from at"):
            run({"load": 1.0, name: 3.0})
        found = run({"load": 1.0, name: 3.0}, unused=[name])
        assert (found.of(tip)[..., 1] == 0).all()
    for wrong in "rho", ["density"]:
        with raises("differentiate: unused = ", "must be names in at"):
            run({"load": 1.0, "rho": 3.0}, unused=wrong)
    still = ub.differentiate(
        lambda load, EI: deflected(EI=EI, force=load), {"load": 0.0, "EI": 4e3}, ub.Static(), **RUN
    )
    by_load, by_stiffness = still.of(lambda s: tip(s)[-1, 1])
    assert by_load == pytest.approx(8 * (1 - 1 / 64) / (3 * 4e3) + 2 / 5e5, rel=EXACT)
    assert by_stiffness == 0  # it enters, and the beam remains straight


def test_runs_that_are_not_differentiated():
    refuse("dt = Adaptive(...)", "give a number", dt=ub.Adaptive(1e-3))
    refuse("reference=True cannot be combined with differentiate", newton=ub.Newton(reference=True))
    refuse("the result of model = 3 is not a Scene", model=lambda load: 3)
    refuse("model = 3.0 must be a function of the parameters", model=3.0)
    refuse("the end t[1] = 0 must come after the beginning", t=(1, 0))


def test_parameters_that_change_the_cells():
    def finer(size):
        return yielding(cells=2 + int(size))

    refuse("size changes the cells, unknowns or parts of the scene", model=finer, at={"size": 3.0})

    def apart(height):
        one = ub.Beam((0, 0), (0, height), ub.Section(EA=1.0, GA=1.0, EI=1.0, rhoA=1.0))
        other = ub.Beam((0, 1), (1, 1), ub.Section(EA=1.0, GA=1.0, EI=1.0, rhoA=1.0))
        return ub.Scene([one, other], joints=[ub.Rigid(one.end, other.start)])

    refuse("differentiate: height near 1: Rigid: joint ends lie", model=apart, at={"height": 1.0})


def test_effects_without_derivatives_are_named():
    def controlled(load):
        beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0), cells=2)
        law = ub.Controller(lambda simulation: load)
        return clamped(beam, connectors=[ub.Turn(ub.ground(1, 0), beam.end, law)])

    refuse("differentiate: Controller has no derivatives", model=controlled)


def test_quantities_that_do_not_fit():
    run = ub.differentiate(
        yielding, {"load": 40.0}, ub.EnergyMomentum(), t=(0, 0.02), dt=0.01, progress=False
    )
    other = yielding().beams[0]
    with raises("of: quantity = 3"):
        run.of(3)
    with raises("column is not in the scene"):  # also of the run itself
        run.of(lambda s: s.displacement(other.end))
    for value in (None, "far", [1.0, [2.0]]):
        with raises("of: quantity returned", "must return a number or an array"):
            run.of(lambda s, value=value: value)
    sizes = iter(range(1, 9))
    with raises("of: the shape of the quantity depends on the parameters"):
        run.of(lambda s: np.zeros(next(sizes)))
    # Errors of a user's function keep their kind
    with pytest.raises(ZeroDivisionError):
        run.of(lambda s: 1 / 0)


def test_a_beam_of_another_call():
    """The quantity knows the beam of the first call only; a model that keeps its beams works."""
    made = []

    def model(load):
        scene = yielding(load=load)
        made.append(scene.beams[0])
        return scene

    run = ub.differentiate(
        model, {"load": 40.0}, ub.EnergyMomentum(), t=(0, 0.02), dt=0.01, progress=False
    )
    with raises("not in the scene", "lambda s: s.displacement(s.scene.beams[0].end)"):
        run.of(lambda s: s.displacement(made[0].end))
    beam = made[0]

    def same(load):
        return clamped(beam, loads=[ub.PointLoad(beam.end, force=(load, 0))])

    run = ub.differentiate(same, {"load": 40.0}, ub.Static(), t=(0, 1), dt=0.5, progress=False)
    assert run.of(lambda s: s.displacement(beam.end)[-1, 0]).shape == (1,)
