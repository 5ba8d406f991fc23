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
from run_differences import FORWARD, TIGHT, difference, errors, relative_error
from scenes import clamped
from user_laws import Dashpot, Exponential, PowerLaw, Stiffening

import ufl_beam as ub

EXACT = 1e-9
AGREE = 1e-7
"""Differences of runs have 8 to 10 digits at the best change of the parameter."""

TO_THE_DIGITS = {"newton": TIGHT}
RUN = {"t": (0, 1), "dt": 0.25, **TO_THE_DIGITS}
DYNAMIC = {"t": (0, 0.6), "dt": 0.01, **TO_THE_DIGITS}
SHORT = {"t": (0, 0.02), "dt": 0.01}
DAMPED = ub.EnergyMomentum(0.05)


def tip(solution):
    """Displacements and rotation of the end of the first beam."""
    return solution.displacement(solution.scene.beams[0].end)


def tip_at_end(solution):
    return tip(solution)[-1]


# -- closed forms ----------------------------------------------------------------------------------


def deflected(EI=4e3, GA=5e5, force=1e-3, length=2.0):
    """Cantilever of 4 cells under a small force."""
    beam = ub.Beam((0, 0), (length, 0), ub.Section(EA=1e6, GA=GA, EI=EI), cells=4)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, force))])


def test_a_cantilever_under_a_small_force():
    """Its tip moves by F L³ (1 - 1/(4 n²))/(3 EI) + F L/GA in n cells with one point each."""
    # The rotation is 1e-6, so that terms of second order are 1e-12.
    EI, GA, F, L = 4e3, 5e5, 1e-3, 2.0
    at = {"EI": EI, "GA": GA, "force": F, "length": L}
    run = ub.differentiate(deflected, at, ub.Static(), **RUN)
    bending, shear = F * L**3 * (1 - 1 / 64) / (3 * EI), F * L / GA
    expected = [-bending / EI, -shear / GA, (bending + shear) / F, (3 * bending + shear) / L]
    assert run.of(tip_at_end)[1] == pytest.approx(expected, rel=EXACT)
    clamp = run.of(lambda s: s.reaction(s.scene.supports[0])[-1])
    np.testing.assert_allclose(clamp[1], [0, 0, -1, 0], atol=EXACT)  # -F
    np.testing.assert_allclose(clamp[2], [0, 0, -L, -F], atol=EXACT * F)  # -F L


def swinging(k=20.0, m=3.0, v0=0.4):
    """A mass on a spring, which slides on the ground."""
    body = ub.Body((0, 0), mass=m, inertia=1.0)
    spring = ub.Slide(ub.ground(0, 0), body.at(0, 0), ub.Spring(k), axis=(1, 0))
    start = [ub.Velocity([body], linear=(v0, 0))]
    return ub.Scene([], bodies=[body], connectors=[spring], initial=start)


def test_an_oscillator_by_the_midpoint_rule():
    """u_n = v0 sin(n φ)/ω with φ = 2 arctan(ω dt/2), the closed form of the midpoint rule."""
    k, m, v0, dt, n = 20.0, 3.0, 0.4, 0.05, np.arange(41)
    run = ub.differentiate(
        swinging, {"k": k, "m": m, "v0": v0}, ub.EnergyMomentum(), t=(0, 2), dt=dt, **TO_THE_DIGITS
    )
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
    # Differences of quantities have an error of 1e-11 of the quantity over that of the parameter
    for name, by_v0 in (("stored", k * u**2 / v0), ("kinetic", m * v**2 / v0)):
        energy = run.of(lambda s, name=name: s.energy.state[name])
        np.testing.assert_allclose(energy[:, 2], by_v0, atol=1e-8 * by_v0.max())


def pulled(N_y, N, H=1e6, EA=1e6):
    """A bar of one cell under a force that grows."""
    section = ub.Section(EA=EA, GA=1e6, EI=1e6, axial=ub.ElastoPlastic(N_y, isotropic=H))
    beam = ub.Beam((0, 0), (2, 0), section, cells=1, name="bar")
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(N, 0), amplitude=lambda t: t)])


def soft(N_y=40.0, N=100.0, H=1e6 / 30, EA=1e6):
    """The same with a plastic modulus so low that steps are divided."""
    return pulled(N_y, N, H, EA)


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


def struck(*, law=None, hinge=None, softening=None, connector=None):
    """A cantilever that is struck at its end."""
    more = {"hinge": softening} if softening else {}
    section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01, bending=law, **more)
    beam = ub.Beam((0, 0), (1, 0), section, cells=3, hinges={0.0: hinge} if hinge else {})
    blow = ub.PointLoad(beam.end, force=(0, 30.0), amplitude=lambda t: math.sin(9 * t))
    ground = ub.ground(1, 0)
    end = [ub.Slide(ground, beam.end, connector, axis=(0, 1))] if connector else []
    return clamped(beam, loads=[blow], connectors=end, masses=[ub.PointMass(beam.end, 0.5)])


LAWS = {
    "power law": ("law", PowerLaw, {"M0": 20.0, "k0": 0.05, "n": 3.0}),
    "dashpot": ("law", Dashpot, {"eta": 50.0}),
    "stiffening": ("law", Stiffening, {"cubic": 300.0}),
    "hinge": ("hinge", Exponential, {"M": 9.0, "G": 4.0}),
    "hinge in cells": ("softening", Exponential, {"M": 9.0, "G": 4.0}),
    "connector": ("connector", Pulling, {"k": 150.0, "cubic": 900.0, "time": 0.2}),
}


@pytest.mark.filterwarnings("ignore:.*hinge:ufl_beam.ModelWarning")
@pytest.mark.parametrize("name", LAWS)
def test_laws_of_users(name):
    """Motions, against differences of runs; the blow yields each law, and unloads it."""
    where, law, at = LAWS[name]

    def model(**numbers):
        return struck(**{where: law(*numbers.values())})

    changes = {"changes": (1e-4, 1e-5, 1e-6), "enough": AGREE}
    best = errors(model, at, DAMPED, t=(0, 0.6), dt=0.01, **changes)
    assert max(best.values()) < AGREE, best


# -- quantities ------------------------------------------------------------------------------------


def yielding(limit=9.0, EI=100.0, load=40.0, length=1.0, cells=3):
    """A column that yields, and a mass on it."""
    law = ub.ElastoPlastic(limit, isotropic=3.0, kinematic=2.0)
    section = ub.Section(EA=1e5, GA=1e5, EI=EI, rhoA=1.0, rhoI=0.01, bending=law)
    beam = ub.Beam((0, 0), (0, length), section, cells=cells, name="column")
    blow = ub.PointLoad(beam.end, force=(load, 0), amplitude=lambda t: math.sin(9 * t))
    return clamped(beam, loads=[blow], masses=[ub.PointMass(beam.end, 0.5)])


def test_quantities_have_any_shape_and_may_be_complex():
    run = ub.differentiate(yielding, {"load": 40.0, "EI": 100.0}, ub.EnergyMomentum(), **DYNAMIC)
    assert list(run.at) == list(run.ranges) == ["load", "EI"]
    assert run.of(tip).shape == (61, 3, 2)
    assert run.of(lambda s: tip(s)[-1, 0]).shape == (2,)
    np.testing.assert_allclose(run.of(lambda s: (1 + 2j) * tip(s)), (1 + 2j) * run.of(tip))
    assert "load = 40, EI = 100" in repr(run)
    plain = ub.simulate(yielding(), ub.EnergyMomentum(), comm=MPI.COMM_SELF, **DYNAMIC)
    assert np.array_equal(run.solution.q, plain.q)  # derivatives leave the run as it is


def test_an_infinite_limit_is_an_elastic_law():
    def elastic(EI, load):
        return yielding(math.inf, EI, load)

    at, times = {"EI": 100.0, "load": 40.0}, {"t": (0, 0.6), "dt": 0.01}
    run = ub.differentiate(elastic, at, ub.EnergyMomentum(), **DYNAMIC)
    assert all(one.change == math.inf for one in run.ranges.values())
    changes = {"changes": (1e-3, 1e-4), "enough": AGREE}
    best = errors(elastic, at, ub.EnergyMomentum(), **times, **changes)
    assert max(best.values()) < AGREE


# -- divided steps, and runs in two parts ----------------------------------------------------------


def stored_and_lost(solution):
    return solution.energy.state["stored"][-1], solution.energy.lost["plastic"][-1]


def test_divided_steps():
    """A bar that begins to flow in the second step, which is divided; also in two runs."""
    # Its end moves by L (N/EA + (N - N_y)/H); it stores N² L/(2 EA), and loses N_y (N - N_y) L/H.
    L, EA, H, N_y, N = 2.0, 1e6, 1e6 / 30, 40.0, 100.0
    at = {"N_y": N_y, "N": N, "H": H, "EA": EA}
    whole = ub.differentiate(soft, at, ub.Static(), **RUN)
    first = ub.differentiate(soft, at, ub.Static(), **{**RUN, "t": (0, 0.5)})
    second = ub.differentiate(soft, at, ub.Static(), **{**RUN, "t": (0.5, 1), "start": first})
    assert whole.solution.substeps > len(whole.solution) - 1
    assert first.solution.substeps > 2
    expected = [-L / H, L * (1 / EA + 1 / H), -L * (N - N_y) / H**2, -L * N / EA**2]
    assert whole.of(tip_at_end)[0] == pytest.approx(expected, rel=EXACT)
    for run, digits in (whole, EXACT), (second, 1e-7):
        stored, lost = run.of(stored_and_lost)
        assert stored[:2] == pytest.approx([0, N * L / EA], rel=digits, abs=1e-9)
        assert lost[:2] == pytest.approx([(N - 2 * N_y) * L / H, N_y * L / H], rel=EXACT)


def test_too_many_substeps(monkeypatch):
    """Energies are refused after more substeps than there is space for."""
    monkeypatch.setattr("ufl_beam.analysis.derivatives.MOST_SUBSTEPS", 3)
    found = ub.differentiate(soft, {"N": 100.0}, ub.Static(), **{**RUN, "dt": 1.0})
    assert found.solution.substeps == 5
    with raises("of: this quantity needs material or energies", "use a smaller dt"):
        found.of(stored_and_lost)


def test_two_runs_give_the_derivatives_of_one():
    """The second run begins with the state, and its derivatives, of the first one."""
    at, options = {"limit": 9.0, "load": 40.0}, {"dt": 0.01, **TO_THE_DIGITS}
    whole = ub.differentiate(yielding, at, DAMPED, t=(0, 0.6), **options)
    first = ub.differentiate(yielding, at, DAMPED, t=(0, 0.3), **options)
    second = ub.differentiate(yielding, at, DAMPED, t=(0.3, 0.6), start=first, **options)
    for quantity in (tip, lambda s: s.energy.lost["plastic"], lambda s: s.energy.supplied["loads"]):
        one, half = whole.of(quantity), second.of(quantity)
        both = one[30:] if len(half) == 31 else one
        assert relative_error(half, both) < 1e-9  # times differ by round-off
    assert whole.ranges["limit"].time < 0.3
    for name, near in whole.ranges.items():  # switches of the first run count as well
        assert second.ranges[name].change == pytest.approx(near.change, rel=1e-6)
        assert second.ranges[name].time == pytest.approx(near.time)
    turned = dict(reversed(at.items()))  # derivatives have this order
    more = {"start": first, **options}
    with raises("differentiate: start ends at t = 0.3 s", "begin there, at the same values"):
        ub.differentiate(yielding, at, DAMPED, t=(0.2, 0.6), **more)
    with raises("at the same values in the same order"):
        ub.differentiate(yielding, turned, DAMPED, t=(0.3, 0.6), **more)
    with raises("differentiate: start has mesh = None; continue with the same one"):
        ub.differentiate(yielding, at, DAMPED, t=(0.3, 0.6), mesh=ub.Mesh(degree=2), **more)


# -- ranges and switches ---------------------------------------------------------------------------


def test_ranges_of_a_bar_in_closed_form():
    """Forces of 25, 50, 75, 100 N beside a limit of 40 N."""
    # The first step yields at a limit of 25 N, the second one not at 50 N; at N = 80 N it does not.
    run = ub.differentiate(pulled, {"N_y": 40.0, "N": 100.0}, ub.Static(), **RUN)
    by_limit, by_force = run.ranges.values()
    assert by_limit.change == pytest.approx(10, rel=EXACT)
    assert by_force.change == pytest.approx(20, rel=EXACT)
    assert by_limit[1:] == by_force[1:] == (0.5, "bar at (1, 0)")
    assert "change=10" in repr(by_limit)


def test_an_elastic_spring_that_turns_has_no_switch():
    """Its equation has a series for small rotations in a step, which changes no digit."""

    def sprung(EI):
        beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e5, GA=4e4, EI=EI, rhoA=1.0), cells=2)
        ends = ub.ground(0, 0), beam.start
        spring = ub.Turn(*ends, ub.Spring(100.0))
        joints, loads = [ub.Revolute(*ends)], [ub.Gravity()]
        return ub.Scene([beam], joints=joints, connectors=[spring], loads=loads)

    found = ub.differentiate(sprung, {"EI": 50.0}, ub.EnergyMomentum(), t=(0, 0.1), dt=0.01)
    assert found.ranges["EI"].change == np.inf


@pytest.mark.parametrize("near", [1e-4, 1e-6, 1.1e-8, -1e-4])
def test_each_side_of_a_switch_has_its_derivatives(near):
    """The bar has just begun to flow, and dissipates N_y (N - N_y) L/H; or it has not."""
    # Round-off of the differences: 1e-16 N_y over steps of a fifth of the distance, times 10.
    L, EA, H, N_y = 2.0, 1e6, 1e6 / 30, 40.0
    at = {"N_y": N_y, "N": N_y * (1 + near)}
    found, flows = ub.differentiate(soft, at, ub.Static(), **RUN), near > 0
    assert found.ranges["N"].change == pytest.approx(abs(near) * N_y, rel=1e-3)
    expected = [-flows * L / H, L * (1 / EA + flows / H)]
    assert found.of(tip_at_end)[0] == pytest.approx(expected, rel=1e-7)
    _, lost = found.of(stored_and_lost)
    expected = [-flows * N_y * L / H, flows * N_y * L / H]
    assert lost == pytest.approx(expected, rel=max(1e-15 / (abs(near) / 5), 1e-6) + abs(near))


def test_energies_at_a_switch():
    """Differences cannot keep to one side of a switch that is nearer than their round-off."""
    found = ub.differentiate(soft, {"N": 40.0 * (1 + 1e-11)}, ub.Static(), **RUN)
    with pytest.warns(ub.ModelWarning, match="of: a change of N by 4e-10 is a switch of the run"):
        found.of(stored_and_lost)


def test_a_parameter_at_the_end_of_its_range():
    """A viscosity of zero grows only; the derivative is that of larger values."""

    def creeping(eta):
        law = ub.ElastoPlastic(9.0, isotropic=3.0, viscosity=ub.Perzyna(eta))
        section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=0.01, bending=law)
        beam = ub.Beam((0, 0), (1, 0), section, cells=2)
        lift = ub.PrescribedDisplacement(beam.end, v=lambda t: 0.1 * t)
        push = ub.PointLoad(beam.at(0.5), force=(0, 3.0), amplitude=lambda t: t)
        return clamped(beam, lift, loads=[push])

    def run(eta):
        return ub.simulate(creeping(eta), ub.Static(), **options).q

    options = {**RUN, "dt": 0.1}
    found = ub.differentiate(creeping, {"eta": 0.0}, ub.Static(), **options).of(lambda s: s.q)
    fd = [difference(run, 0.0, h, FORWARD) for h in (1e-3, 1e-4)]
    assert min(relative_error(found[..., 0], one) for one in fd) < AGREE


# -- what is refused -------------------------------------------------------------------------------


def apart(height):
    section = ub.Section(EA=1.0, GA=1.0, EI=1.0, rhoA=1.0)
    one, other = ub.Beam((0, 0), (0, height), section), ub.Beam((0, 1), (1, 1), section)
    return ub.Scene([one, other], joints=[ub.Rigid(one.end, other.start)])


def controlled(load):
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0), cells=2)
    law = ub.Controller(lambda simulation: load)
    return clamped(beam, connectors=[ub.Turn(ub.ground(1, 0), beam.end, law)])


@pytest.mark.parametrize(
    ("model", "at", "words"),
    [
        (yielding, {"EJ": 1.0}, ["other parameters than at:", "unexpected keyword argument 'EJ'"]),
        (yielding, {"EI": -1.0}, ["Section: EI = -1 must be positive"]),
        (
            lambda size: yielding(cells=2 + int(size)), {"size": 3.0},
            ["size changes the cells, unknowns or parts of the scene"],
        ),
        (apart, {"height": 1.0}, ["differentiate: height near 1: Rigid: joint ends lie"]),
        (controlled, {"load": 1.0}, ["differentiate: Controller has no derivatives"]),
    ],
    ids=["unknown name", "negative", "other cells", "apart", "controller"],
)  # fmt: skip
def test_models_that_are_refused(model, at, words):
    with raises(*words):
        ub.differentiate(model, at, ub.EnergyMomentum(), **SHORT)


def test_the_reference_solver_has_no_derivatives():
    newton = ub.Newton(reference=True)
    with raises("reference=True cannot be combined with differentiate"):
        ub.differentiate(yielding, {"load": 1.0}, ub.EnergyMomentum(), newton=newton, **SHORT)


def test_a_parameter_that_does_not_enter():
    """Neither a name that the model ignores nor density in statics; a force of zero enters."""

    def model(load, rho=1.0, unused=0.0):
        section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=rho)
        beam = ub.Beam((0, 0), (1, 0), section, cells=2)
        return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, load))])

    for name in "unused", "rho":
        at = {"load": 1.0, name: 3.0}
        with raises(f"differentiate: the run does not depend on {name}; remove it from at"):
            ub.differentiate(model, at, ub.Static(), **RUN)
        found = ub.differentiate(model, at, ub.Static(), unused=[name], **RUN)
        assert (found.of(tip)[..., 1] == 0).all()
    still = ub.differentiate(deflected, {"force": 0.0, "EI": 4e3}, ub.Static(), **RUN)
    by_load, by_stiffness = still.of(tip_at_end)[1]
    assert by_load == pytest.approx(8 * (1 - 1 / 64) / (3 * 4e3) + 2 / 5e5, rel=EXACT)
    assert by_stiffness == 0  # it enters, and the beam remains straight


def test_quantities_that_do_not_fit():
    run = ub.differentiate(yielding, {"load": 40.0}, ub.EnergyMomentum(), **SHORT)
    other, sizes = yielding().beams[0], iter(range(1, 9))
    for quantity, *words in (
        (3, "of: quantity = 3"),
        (lambda s: s.displacement(other.end), "column is not in the scene"),
        (lambda s: "far", "of: quantity returned", "must return a number or an array"),
        (lambda s: [1.0, [2.0]], "of: quantity returned", "must return a number or an array"),
        (lambda s: np.zeros(next(sizes)), "of: the shape of the quantity depends on the parameter"),
    ):
        with raises(*words):
            run.of(quantity)
    with pytest.raises(ZeroDivisionError):  # errors of a user's function keep their kind
        run.of(lambda s: 1 / 0)
    fourth = ub.differentiate(swinging, {"k": 20.0}, ub.EnergyMomentum(order=4), **SHORT)
    with raises("of: this quantity needs section forces", "use order=2"):
        fourth.of(lambda s: s.energy.state["stored"])


def test_a_beam_of_another_call():
    """The quantity knows the beam of the first call only."""
    made = []

    def model(load):
        made.append(yielding(load=load))
        return made[-1]

    run = ub.differentiate(model, {"load": 40.0}, ub.EnergyMomentum(), **SHORT)
    with raises("not in the scene", "lambda s: s.displacement(s.scene.beams[0].end)"):
        run.of(lambda s: s.displacement(made[0].beams[0].end))
