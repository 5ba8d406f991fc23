# SPDX-License-Identifier: MIT
"""Derivatives of runs against five-point differences of runs, family by family; all [calc].

Differences are of runs with steps solved to 1e-13, and the best of several changes of a parameter.
They have 8 to 11 digits: 1e-13 over a change of 1e-4 is 1e-9, and a run adds up the errors of its
steps.  The derivatives of the motion must agree to 1e-7 of their largest value.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from run_differences import TIGHT, errors, history, relative_error
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")

AGREE = 1e-7
SECTION = ub.Section(EA=2.1e9, GA=6.7e8, EI=9e6, rhoA=78.5, rhoI=0.065)
DAMPED = ub.EnergyMomentum(0.02)


def pulse(t):
    return math.sin(math.pi * t / 0.2) if t < 0.2 else 0.0


def to_and_fro(t):
    return math.sin(2 * math.pi * t / 0.3)


def flying(EI=100.0, rhoA=1.0, load=8.0, v0=0.5):
    """The flying beam of Simo and Vu-Quoc (1986), with a velocity."""
    section = ub.Section(EA=1e4, GA=1e4, EI=EI, rhoA=rhoA, rhoI=10.0)
    beam = ub.Beam((6, 0), (0, 8), section, cells=16)
    kick = ub.PointLoad(
        beam.start, force=(load, 0), moment=-10 * load, amplitude=lambda t: float(t < 2.5)
    )
    return ub.Scene([beam], loads=[kick], initial=[ub.Velocity([beam], linear=(v0, 0))])


def column(section, load, *, hinges=None, amplitude=pulse, cells=12, **parts):
    """A column of 3 m with a mass of 400 kg, which is pushed at its top."""
    beam = ub.Beam((0, 0), (0, 3), section, cells=cells, hinges=hinges or {}, name="column")
    push = ub.PointLoad(beam.end, force=(load, 0), amplitude=amplitude)
    return clamped(beam, masses=[ub.PointMass(beam.end, 400.0)], loads=[push], **parts)


def yielding(limit=60e3, isotropic=4e5, kinematic=2e5, EI=9e6, rhoA=78.5, load=35e3):
    law = ub.ElastoPlastic(limit, isotropic, kinematic)
    return column(replace(SECTION, EI=EI, rhoA=rhoA, bending=law), load)


def viscous(limit=60e3, isotropic=4e5, eta=2e4, load=35e3):
    law = ub.ElastoPlastic(limit, isotropic, viscosity=ub.Perzyna(eta))
    return column(replace(SECTION, bending=law), load)


def relaxing(limit=60e3, time=0.02, load=35e3):
    law = ub.ElastoPlastic(limit, 4e5, viscosity=ub.DuvautLions(time))
    return column(replace(SECTION, bending=law), load)


def softening(M_u=60e3, G_f=6e3, EI=9e6, rhoA=78.5, load=32e3):
    """An embedded hinge that opens in a cell, and does not close again."""
    law = ub.Softening(M_u, G_f)
    return column(replace(SECTION, EI=EI, rhoA=rhoA, hinge=law), load)


def exhausted(M_u=60e3, G_f=1e3, EI=9e6, load=32e3):
    """A hinge in a cell that softens linearly until it turns freely."""
    return column(replace(SECTION, EI=EI, hinge=ub.LinearSoftening(M_u, G_f)), load)


def hinged(M_u=60e3, G_f=6e3, EI=9e6, load=32e3):
    """A plastic hinge of zero length that softens."""
    return column(replace(SECTION, EI=EI), load, hinges={0.0: ub.LinearSoftening(M_u, G_f)})


def both(limit=50e3, isotropic=4e5, kinematic=2e5, M_u=62e3, G_f=6e3, EI=9e6, load=30e3):
    """Yielding to and fro, and a hinge that opens in a cell that has yielded."""
    law = ub.ElastoPlastic(limit, isotropic, kinematic)
    section = replace(SECTION, EI=EI, bending=law, hinge=ub.Softening(M_u, G_f))
    return column(section, load, amplitude=to_and_fro)


def fibres(limit=235e6, isotropic=2e9, E=210e9, height=0.2, load=60e3):
    law = ub.Fibres(ub.ElastoPlastic(limit, isotropic), number=8)
    section = ub.Section.rectangle(0.1, height, E=E, nu=0.3, rho=7850.0, fibres=law)
    return column(section, load, amplitude=to_and_fro, cells=6)


def steel(limit=235e6, hardening=0.01, R0=20.0, load=60e3):
    law = ub.Fibres(st.MenegottoPinto(limit, hardening, R0), number=8)
    section = ub.Section.rectangle(0.1, 0.2, E=210e9, nu=0.3, rho=7850.0, fibres=law)
    return column(section, load, amplitude=to_and_fro, cells=4)


def machine(k=2e3, c=30.0, mass=3.0, length=1.0, limit=25.0, speed=2.0):
    """Two arms with a motor, a yielding spring, a damper and a hinge with friction."""
    section = ub.Section(EA=1e5, GA=1e5, EI=100.0, rhoA=1.0, rhoI=1e-3)
    one = ub.Beam((0, 0), (length, 0), section, cells=3)
    other = ub.Beam((length, 0), (length + 1, 0.3), section, cells=3)
    return ub.Scene(
        [one, other], supports=[ub.Pinned(one.start)], masses=[ub.PointMass(other.end, mass)],
        joints=[ub.Revolute(one.end, other.start)], loads=[ub.Gravity()],
        connectors=[
            ub.Turn(ub.ground(0, 0), one.start, ub.PrescribedMotion(lambda t: speed * t**2)),
            ub.Turn(one.end, other.start, ub.Spring(k, law=ub.ElastoPlastic(limit, 50.0))),
            ub.Turn(one.end, other.start, ub.Damper(c)),
        ],
    )  # fmt: skip


def swinging(length=2.0, height=0.2, *, x=0.0, y=0.0):
    """A steel beam that falls about its pinned end; EA is 75 EI over a cell's length squared."""
    section = ub.Section.rectangle(b=0.1, h=height, E=210e9, nu=0.3, rho=7850.0)
    beam = ub.Beam((x, y), (x + length, y), section, cells=4)
    return ub.Scene([beam], supports=[ub.Pinned(beam.start)], loads=[ub.Gravity()])


def pulled(yields=50e3, isotropic=4e5, EI=9e6, M_u=55e3, G_f=40e3, height=3.0, sway=0.05):
    """A column whose top is moved; it yields, and a hinge of zero length opens at its foot."""
    section = replace(SECTION, EI=EI, bending=ub.ElastoPlastic(yields, isotropic))
    beam = ub.Beam((0, 0), (0, height), section, cells=6, hinges={0.0: ub.Softening(M_u, G_f)})
    move = ub.PrescribedDisplacement(beam.end, u=lambda t: sway * t)
    return clamped(beam, move, loads=[ub.PointLoad(beam.end, force=(0, -1e5))])


def residual_displacement(s):
    """Mean of the displacement over the last half of the run, m; the column swings about it."""
    return s.displacement(s.scene.beams[0].end)[150:, 0].mean()


def decay_ratio(s):
    """Damping ratio of the swings after the pulse."""
    u = s.displacement(s.scene.beams[0].end)[75:, 0]  # after 0.3 s
    return st.damping(s.times[75:], u - u.mean()).ratio


def limit_load(s):
    """Largest force that the support at the top bears, just after the hinge opens; N."""
    return np.abs(s.reaction(s.scene.supports[1])[1:, 0]).max()


STEPS = {"t": (0, 0.6), "dt": 0.002}
FAMILIES = {
    "flying beam": (flying, ub.EnergyMomentum(), {"t": (0, 5), "dt": 0.05}),
    "flying beam, damped": (flying, ub.EnergyMomentum(0.01, 0.01), {"t": (0, 5), "dt": 0.05}),
    "flying beam, Newmark": (flying, ub.Newmark(), {"t": (0, 2), "dt": 0.02}),
    "flying beam, generalized alpha": (flying, ub.GeneralizedAlpha(0.8), {"t": (0, 2), "dt": 0.02}),
    "flying beam, order 4": (flying, ub.EnergyMomentum(order=4), {"t": (0, 2), "dt": 0.1}),
    "yielding": (yielding, DAMPED, STEPS),
    "Perzyna": (viscous, DAMPED, STEPS),
    "Duvaut-Lions": (relaxing, DAMPED, STEPS),
    "softening": (softening, DAMPED, STEPS),
    "softening to zero": (exhausted, DAMPED, STEPS),
    "hinge of zero length": (hinged, DAMPED, STEPS),
    "yielding and softening": (both, DAMPED, STEPS),
    "fibres": (fibres, DAMPED, STEPS),
    "fibres of steel": (steel, DAMPED, STEPS),
    "swinging beam": (swinging, ub.EnergyMomentum(), {"t": (0, 1), "dt": 0.01}),
    "machine": (machine, ub.EnergyMomentum(0.05), {"t": (0, 1), "dt": 0.01}),
    "statics": (pulled, ub.Static(), {"t": (0, 1), "dt": 0.02}),
    "exact statics": (pulled, ub.EnergyMomentumStatic(), {"t": (0, 1), "dt": 0.02}),
    "exact statics, θ = 0.7": (pulled, ub.EnergyMomentumStatic(0.7), {"t": (0, 1), "dt": 0.02}),
    "residual displacement": (yielding, DAMPED, STEPS, residual_displacement),
    # A ratio of logarithms of small differences of peaks, each of which is interpolated
    "damping ratio": (yielding, DAMPED, {"t": (0, 1.2), "dt": 0.004}, decay_ratio, 1e-5),
    # G_f changes the largest force little, just after the hinge opens
    "limit load": (pulled, ub.Static(), {"t": (0, 1), "dt": 0.01}, limit_load, 1e-5),
}
"""Models, schemes and steps, and quantities and tolerances other than the motion to AGREE."""


def defaults(model):
    """Values of the parameters of a model."""
    return dict(zip(model.__code__.co_varnames, model.__defaults__, strict=False))


def best_errors(model, scheme, options, of=history, tolerance=AGREE):
    """Least errors by parameter, and their tolerance."""
    changes = 1e-3, 1e-4, 3e-5, 1e-5, 1e-6
    best = errors(model, defaults(model), scheme, of, changes, enough=tolerance, **options)
    return best, tolerance


@pytest.mark.parametrize("name", FAMILIES)
def test_derivatives_by_all_parameters(name):
    best, tolerance = best_errors(*FAMILIES[name])
    print(name, " ".join(f"{key} {error:.0e}" for key, error in best.items()))
    assert max(best.values()) < tolerance, best


def test_derivatives_far_from_the_origin():
    """They do not depend on the place of a scene; coordinates of 300 m have two digits less."""
    at, near, far = {"length": 2.1, "height": 0.2}, swinging, partial(swinging, x=300.1, y=-200.1)
    options = {"newton": TIGHT, "t": (0, 1), "dt": 0.01}
    runs = (ub.differentiate(model, at, ub.EnergyMomentum(), **options) for model in (near, far))
    expected, found = (run.of(history) for run in runs)
    for p in range(2):
        assert relative_error(found[..., p], expected[..., p]) < AGREE


def test_tolerances_of_steps():
    """Steps that are solved to rtol have derivatives of that error, times a small factor."""
    at = {"limit": 60e3, "EI": 9e6}

    def derivatives(rtol):
        options = {"newton": ub.Newton(rtol=rtol), **STEPS}
        return ub.differentiate(yielding, at, DAMPED, **options).of(history)

    exact = derivatives(TIGHT.rtol)
    for rtol in (1e-6, 1e-8, 1e-10):
        assert relative_error(derivatives(rtol), exact) < max(100 * rtol, 1e-9)
