# SPDX-License-Identifier: MIT
"""What must stop, and what it must say: scenes and calls that are wrong, or go wrong on the way."""

import math

from rows import LEDGER, outcome, row

import ufl_beam as ub

STEEL = {"EA": 1e4, "GA": 1e4, "EI": 1.0, "rhoA": 1.0, "rhoI": 1e-3}


def cantilever(time=lambda t: 1.0, force=(0.0, 0.1), section=None, **more):
    """A cantilever of 1 m under a load at its end."""
    beam = ub.Beam((0, 0), (1, 0), section or ub.Section(**STEEL), cells=4)
    load = ub.PointLoad(beam.end, force=force, amplitude=time)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load], **more)


def run(scene, scheme=None, t=(0.0, 0.1), dt=0.01):
    """Simulate."""
    return ub.simulate(scene, scheme or ub.EnergyMomentum(), t=t, dt=dt)


def _late(value):
    """A time function that goes wrong at 0.05 s."""
    return lambda t: 1.0 if t < 0.05 else value


def _raises(t):
    if t > 0.05:
        raise ZeroDivisionError("a user's own error")
    return 1.0


def _free_in_statics():
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL))
    return run(ub.Scene([beam], supports=[ub.Pinned(beam.start)]), ub.Static())


def _massless():
    body = ub.Body((0, 0))
    return run(ub.Scene(bodies=[body]))


def _no_mass():
    return run(cantilever(section=ub.Section(EA=1e4, GA=1e4, EI=1.0)))


def _collapse():
    hinge = ub.Softening(limit=0.01, fracture_energy=1e-3)
    section = ub.Section(**STEEL, hinge=hinge)
    return run(cantilever(ub.ramp(0.1), (0.0, 1.0), section), ub.Static())


def _function_fails():
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL), cells=4)

    def force(e, rate):
        return math.nan if abs(e) > 1e-6 else e

    connector = ub.Slide(ub.ground(2, 0), beam.end, ub.ForceLaw(force), axis=(0, 1))
    load = ub.PointLoad(beam.end, force=(0.0, 1.0))
    scene = ub.Scene(
        [beam], supports=[ub.Clamped(beam.start)], connectors=[connector], loads=[load]
    )
    return run(scene)


def _motion(value):
    beam = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL), cells=4)
    return run(
        ub.Scene(
            [beam], supports=[ub.PrescribedDisplacement(beam.start, u=0, v=0, psi=_late(value))]
        )
    )


def _section(**numbers):
    return lambda: ub.Section(**{**STEEL, **numbers})


CASES = {
    "a load that becomes NaN": (
        lambda: run(cantilever(_late(math.nan))),
        "PointLoad",
    ),
    "a load that becomes infinite": (lambda: run(cantilever(_late(math.inf))), "PointLoad"),
    "a prescribed motion that becomes NaN": (
        lambda: _motion(math.nan),
        "PrescribedDisplacement",
    ),
    "a time function that raises an exception": (
        lambda: run(cantilever(_raises)),
        "a user's own error",
    ),
    "a ForceLaw that returns NaN": (_function_fails, "Slide"),
    "a beam of zero length": (lambda: ub.Beam((1, 1), (1, 1), ub.Section(**STEEL)), "zero length"),
    "a stiffness of zero": (_section(EA=0.0), "must be positive"),
    "an infinite stiffness": (_section(EI=math.inf), "not finite"),
    "a stiffness of NaN": (_section(GA=math.nan), "not finite"),
    "a negative mass": (_section(rhoA=-1.0), "must be at least 0"),
    "statics of a mechanism": (_free_in_statics, "free to move"),
    "dynamics of a body without mass": (_massless, "mass = 0"),
    "a load of 1e308 N": (lambda: run(cantilever(force=(0.0, 1e308))), "no equilibrium after t"),
    "a static load beyond collapse": (_collapse, "no equilibrium after t"),
    "steps that do not change the time": (
        lambda: run(cantilever(), t=(1.0, 1.0 + 1e-15), dt=1e-20),
        "dt",
    ),
    "an end before the beginning": (lambda: run(cantilever(), t=(1.0, 0.0)), "must come after"),
    "a step of length zero": (lambda: run(cantilever(), dt=0.0), "must be positive"),
}


@row(
    "wrong input",
    "error",
    "a message that names the error",
    tuple(CASES),
    stops=tuple({says for _, says in CASES.values()}),
)
def mistakes(case):
    """A mistake that is not noticed is wrong."""
    make, says = CASES[case]
    try:
        make()
    except (ub.ArgumentError, ub.ConvergenceError) as error:
        if says not in str(error):
            raise AssertionError(f"{says!r} is not in: {error}") from error
        _require_kept(error)
        raise
    except ZeroDivisionError as error:
        _require_kept(error)
        raise ub.ArgumentError(str(error)) from error
    raise AssertionError("nothing was said")


def _require_kept(error):
    """What was reached must not be lost."""
    solution = getattr(error, "solution", None)
    if solution is not None and len(solution.times) < 1:
        raise AssertionError(f"results are lost: {error}")


@row(
    "beams without mass or rotary inertia",
    "rhoA and rhoI of one half",
    "ledger",
    ((1.0, 1e-3), (1.0, 0.0), (0.0, 1e-3), (0.0, 0.0), (1e-300, 1e-300), (1e12, 1e12)),
)
def without_mass(inertia):
    """A cantilever whose outer half has other inertia, hit; 100 steps."""
    rhoA, rhoI = inertia
    one = ub.Beam((0, 0), (1, 0), ub.Section(**STEEL), cells=4)
    section = ub.Section(**{**STEEL, "rhoA": rhoA, "rhoI": rhoI})
    two = ub.Beam((1, 0), (2, 0), section, cells=4)
    hit = ub.PointLoad(two.at(0.5), force=(0.0, 1.0), amplitude=lambda t: float(t < 0.1))
    scene = ub.Scene(
        [one, two],
        joints=[ub.Rigid(one.end, two.start)],
        supports=[ub.Clamped(one.start)],
        loads=[hit],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(0.01, 0.01), t=(0, 1), dt=0.01)
    return outcome(solution, solution.energy.worst, LEDGER)
