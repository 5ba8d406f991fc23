# SPDX-License-Identifier: MIT
"""Wrong uses of analyses that were seen, and the remedies that their messages state."""

import math
import time
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam import errors

SECTION = ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=1.0, rhoI=1e-3)
BEAM = ub.Beam((0, 0), (0, 2), SECTION, cells=2, name="C11")
SCENE = clamped(BEAM, loads=[ub.Gravity()], masses=[ub.PointMass(BEAM.end, 10.0)])
MOTION = st.GroundMotion(0.1, [0.0, 1.0, -1.0, 0.0])


OTHER = "another object of this name", "scene['C11']"


def run(scene=SCENE, **options):
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, **options)


def crooked():
    return run(st.imperfect(SCENE, sway=0.01))


def spectrum(values):
    return st.response_spectrum_analysis(SCENE, values, n=1)


@pytest.mark.parametrize(
    ("use", "words"),
    [
        (lambda: st.imperfect(SCENE, bow={"C11": 1 / 300}), ["bow = {'C11'", "a dict of beams"]),
        (lambda: st.imperfect(SCENE, bow=1 / 300), ["bow = 0.00333", 'bow={scene["column"]: 1']),
        (lambda: ub.Gravity(amplitude=MOTION), ["Gravity: amplitude", "motion.acceleration"]),
        (lambda: run(record=ub.Extremes), ["record[0]", "recorder = Extremes(...)"]),
        (lambda: spectrum({0.01: 1.0, 9.0: 1.0}),
         ["spectrum = {0.01", "(periods, accelerations)", "of a dict"]),
        (lambda: spectrum([9.0, 9.0]),
         ["spectrum = [9.0, 9.0]", "a function of the period", "(periods, accelerations)"]),
        (lambda: ub.LineLoad(BEAM, force=(0, 1), time=lambda t: t),
         ["LineLoad has no argument 'time'; give amplitude="]),
        (lambda: ub.ElastoPlastic(limit=1.0), ["no argument 'limit'; give yield_limit="]),
        (lambda: ub.Clamped(place=BEAM.end, at=1), ["Clamped has no argument 'at'", "are place"]),
        (lambda: ub.Rigid(BEAM.end, BEAM.start, measured=True),
         ["Rigid has no argument 'measured'; give multipliers="]),
        (lambda: crooked().displacement(BEAM.end), ["C11 is not in the scene", *OTHER]),
        (lambda: crooked().section_forces(BEAM), ["C11 is not in the scene", *OTHER]),
        (lambda: ub.follow(crooked().scene, ub.DisplacementControl(BEAM.end, "u", step=0.1)),
         ["DisplacementControl of C11.end", *OTHER]),
        (lambda: st.hinge_table(SimpleNamespace(path=crooked())),  # as a pushover
         ["is not a Solution; give its attribute 'path'"]),
        (lambda: ub.plot(st.hinge_table(crooked())),
         ["is a HingeTable, which has no picture", "Scene"]),
        (lambda: st.Fatigue(BEAM.end, st.SNCurve.eurocode(71e6)),
         ["Fatigue: spots[0] = <C11.end", "is not a HotSpot"]),
        (lambda: st.steel("IPE 300", fy=235e6),
         ["has no argument 'fy'", "E, nu, rho", "axial, bending"]),
    ],
)  # fmt: skip
def test_a_message_names_the_remedy(use, words):
    with raises(*words):
        use()


@pytest.mark.parametrize(
    ("work", "words"),
    [
        (ub.VirtualWork("p", lambda q, w: -5.0), ["virtual work per length", "f * w[1]"]),
        (ub.VirtualWork("p", lambda q, w: w), ["tensor", "linear in components of w"]),
        (ub.Potential("p", lambda q: 3.0), ["an energy per length of components of q"]),
        (ub.Potential("p", lambda q: q), ["tensor", "energy per length", "k * q[1] ** 2 / 2"]),
    ],
)
def test_densities_are_named_by_their_kind(work, words):
    with raises(*words) as info:
        run(clamped(BEAM, works=[work]))
    other = "an energy per length" if isinstance(work, ub.VirtualWork) else "w[1]"
    assert other not in str(info.value)


def test_a_path_on_which_nothing_moves_says_so():
    """A straight beam between fixed ends is heated: only its force changes."""
    heat = ub.ImposedStrain(BEAM, axial=1e-5, amplitude=lambda t: t)
    words = "nothing moves with the load factor", "st.imperfect", "simulate(scene, Static()"
    with raises(*words, kind=ub.ConvergenceError):
        ub.follow(clamped(BEAM, ub.Clamped(BEAM.end), loads=[heat]), ub.LoadControl(0.5), steps=2)


@pytest.mark.serial
def test_a_measure_without_numbers_ends_an_incremental_dynamic_analysis():
    """In its first run, which is the only one that is built after the check of ``build``."""
    built = []

    def build(motion):
        built.append(motion)
        return SCENE

    with raises("measure returned nan, not finite numbers", "up to t = "):
        st.incremental_dynamic_analysis(
            build, [MOTION], [1.0, 2.0, 3.0], lambda s: math.nan, limit=1.0
        )
    assert len(built) == 2


# -- gradients -----------------------------------------------------------------------------------


def model(EI, F):
    beam = ub.Beam((0, 0), (2, 0), ub.Section(EA=2e9, GA=7e8, EI=EI, rhoA=60.0), cells=2)
    return clamped(beam, loads=[ub.PointLoad(beam.end, force=(0, F))])


def tip(s):
    return s.displacement(s.scene.beams[0].end)[:, 1]


def gradient(F=-1e5, of=tip, **more):
    parameters = {"EI": 4e6, "F": F}
    return ub.gradient(model, parameters, ub.Static(), t=(0, 1), dt=0.5, of=of, **more)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"reduce": lambda y: y}, ["reduce", "returned array(", "must return a number"]),
        ({"reduce": lambda y: None}, ["returned None at a history of shape (3,)"]),
        ({"reduce": lambda y: math.nan}, ["returned nan", "must return a finite number"]),
        ({"reduce": lambda y: 1j}, ["returned 1j", "must return a number"]),
        ({"of": lambda s: np.zeros((len(s), 2))}, ["last value", "shape (3, 2)"]),
        ({"of": lambda s: ["a"] * len(s)}, ["of returned ['a'", "history of real numbers"]),
        ({"of": lambda s: 1j * tip(s)}, ["of returned array(", "history of real numbers"]),
        ({"of": lambda s: [[1.0], [1.0, 2.0], [1.0]]}, ["of returned [[1.0]", "real numbers"]),
    ],
)
def test_gradients_need_histories_of_numbers_and_one_number(more, words):
    with raises("gradient: ", *words):
        gradient(**more)


# -- runs that end -------------------------------------------------------------------------------


@pytest.mark.serial  # each process would count its own calls
@pytest.mark.parametrize("dt", [0.01, ub.Adaptive(1e-4)], ids=["equal", "adaptive"])
def test_the_wall_time_of_a_tradeoff_ends_a_run_in_progress(dt):
    """The law takes 20 ms, so a run would take 20 s at least; it was ended after one second."""
    calls = []

    def slow(motion, rate):
        calls.append(motion)
        time.sleep(0.02)
        return 10.0 * motion

    device = ub.Slide(ub.ground(0, 2), BEAM.end, ub.ForceLaw(slow), axis=(1, 0))
    scene = clamped(BEAM, loads=[ub.Gravity((1.0, 0.0))], connectors=[device])
    with raises("max_seconds = 1 s", kind=errors.TradeoffError):
        ub.tradeoff(
            scene, {"tip": lambda s: s.displacement(BEAM.end)[-1, 0]}, scheme=ub.EnergyMomentum(),
            t=(0, 10), dt=dt, tolerance=1e-3, max_seconds=1.0,
        )  # fmt: skip
    assert len(calls) < 250  # 50 in a second; the coarsest run has 1000 steps or more


@pytest.mark.filterwarnings("ignore:pushover. target over the size")  # no path leads there
def test_a_pushover_that_ends_early_says_so_briefly():
    """A frame of 12 columns whose feet soften: some hinges are named, and the unit is newton."""
    hinges = {0.0: ub.LinearSoftening(limit=2e3, fracture_energy=20.0)}
    columns = [
        ub.Beam((k, 0), (k, 3), SECTION, cells=1, name=f"column {k}", hinges=hinges)
        for k in range(12)
    ]
    scene = ub.Scene(
        columns,
        joints=[ub.Link(a.end, b.end) for a, b in pairwise(columns)],
        supports=[ub.Clamped(c.start) for c in columns],
        loads=[ub.PointLoad(c.end, force=(0, -100.0)) for c in columns],
        masses=[ub.PointMass(c.end, 10.0) for c in columns],
    )
    with pytest.warns(ub.ModelWarning, match="the path ends at"):
        capacity = st.pushover(scene, columns[0].end, 40.0, steps=40)
    # Eight names of 40 characters, 400 characters of the error, and the sentence around them
    assert len(capacity.failure) < 1000
    assert " more" in capacity.failure
    table = st.hinge_table(capacity.path)
    assert "yields at base shear [N]" in str(table).splitlines()[0]
