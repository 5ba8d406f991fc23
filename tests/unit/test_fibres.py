# SPDX-License-Identifier: MIT
"""Fibres of cross-sections: their sums, their section in a run, and the plastic moment."""

import math

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

# Cells of 1 mm stand for cross-sections; no beam is meant.
pytestmark = pytest.mark.filterwarnings("ignore:beam. its section is:ufl_beam.ModelWarning")

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
ELASTIC = ub.ElastoPlastic(yield_limit=math.inf)
SHAPES = {
    "rectangle": lambda **more: ub.Section.rectangle(b=0.10, h=0.20, **STEEL, **more),
    "circle": lambda **more: ub.Section.circle(d=0.30, **STEEL, **more),
    "tube": lambda **more: ub.Section.tube(d=0.30, t=0.02, **STEEL, **more),
    "full tube": lambda **more: ub.Section.tube(d=0.30, t=0.15, **STEEL, **more),
    "i_shape": lambda **more: st.i_shape(h=0.30, b=0.15, tw=0.008, tf=0.012, **STEEL, **more),
    "fillets": lambda **more: st.steel("HEB 200", **STEEL, **more),
    "channel": lambda **more: st.steel("UPE 200", **STEEL, **more),
    "box": lambda **more: st.box(0.10, 0.20, 0.01, 0.02, **STEEL, **more),
    "weak": lambda **more: st.steel("HEB 200", axis="weak", **STEEL, **more),
}


# -- sums --------------------------------------------------------------------------------------


def of_fibres(shape, number):
    return SHAPES[shape](fibres=ub.Fibres(ELASTIC, number=number))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("number", [7, 80])
def test_fibres_have_the_area_balance_and_lie_inside(shape, number):
    """With the area EA, GA and the mass; round-off of sums of up to 100 numbers."""
    section, whole = of_fibres(shape, number), SHAPES[shape]()
    assert pytest.approx(whole.EA, rel=1e-13) == section.EA
    assert (section.GA, section.rhoA, section.depth) == (whole.GA, whole.rhoA, whole.depth)
    assert section.rhoI == whole.rhoI
    y, A = section.fibres.y, section.fibres.A
    assert A.sum() == pytest.approx(whole.EA / 210e9, rel=1e-13)
    assert (A > 0).all()
    assert (np.diff(y) > 0).all()
    assert np.abs(y).max() < section.depth / 2
    # The axis runs through the centroid: round-off of first moments
    assert abs(A @ y) < 1e-15 * section.depth * A.sum() * number
    assert np.abs(y + y[::-1]).max() < 1e-13 * section.depth
    assert pytest.approx(A[::-1], rel=1e-10) == A


@pytest.mark.parametrize("shape", SHAPES)
def test_second_moments_converge(shape):
    """[closed] Layers lack their own second moments, b t³/12 each: a part of the order 1/n²."""
    lacks = np.array([1 - of_fibres(shape, n).EI / SHAPES[shape]().EI for n in (10, 20, 40)])
    assert (lacks > 0).all()
    # At most that of a rectangle, 1/n²: the other shapes have more of their area further out,
    # or, as the circle, thinner layers of less area there
    assert lacks[0] < 1.5e-2
    # The I has layers of unequal thickness, cut at its flanges
    assert (lacks[1:] < lacks[:-1] / 2).all()


@pytest.mark.parametrize(
    ("shape", "edge", "cap"),
    [
        ("i_shape", 0.138, 0.15 * 0.012),
        ("tube", 0.13, 0.15**2 * math.acos(0.13 / 0.15) - 0.13 * math.sqrt(0.15**2 - 0.13**2)),
    ],
)
def test_layers_end_where_the_shape_changes(shape, edge, cap):
    """No layer is part flange and part web: as many as asked for, and two more."""
    fibres = of_fibres(shape, 7).fibres
    assert len(fibres.y) == 9
    assert fibres.A[fibres.y > edge].sum() == pytest.approx(cap, rel=1e-12)


def test_edges_that_coincide_make_no_layer_of_nothing():
    """Flanges of a tenth of the depth, ten layers."""
    fibres = ub.Fibres(ELASTIC, number=10)
    section = st.i_shape(h=0.3, b=0.15, tw=0.01, tf=0.03, **STEEL, fibres=fibres)
    assert len(section.fibres.y) == 10


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1]])
@pytest.mark.parametrize("shift", [0.0, 5.0])
def test_fibres_of_a_user(shift, order):
    """[closed] Three areas in the given order; the axis runs through their centroid."""
    y, A = np.array([0.0, 0.1, 0.4])[order], np.array([2e-3, 1e-3, 1e-3])[order]
    centroid = (0.1 * 1e-3 + 0.4 * 1e-3) / 4e-3
    fibres = ub.Fibres(ELASTIC)
    section = ub.Section.of_fibres(y + shift, A, **STEEL, shear_factor=0.5, fibres=fibres)
    # Shifted, y are numbers near 5: 1e-15 of it
    assert section.fibres.y == pytest.approx(y - centroid, abs=2e-15)
    assert section.fibres.A.tolist() == A.tolist()
    assert pytest.approx(210e9 * 4e-3) == section.EA
    assert pytest.approx(210e9 * A @ (y - centroid) ** 2) == section.EI
    assert pytest.approx(0.5 * 4e-3 * 210e9 / 2.6) == section.GA
    assert section.rhoA == pytest.approx(7850 * 4e-3)
    assert section.rhoI == pytest.approx(7850 * A @ (y - centroid) ** 2)
    assert section.depth == pytest.approx(0.4)


# -- elastic fibres are the section of their sums ------------------------------------------------


def bent(fibres):
    """A curved cantilever under a force, in fibres or in the resultants of their sums."""
    section = of_fibres("i_shape", 9)
    if not fibres:
        section = ub.Section(section.EA, section.GA, section.EI, section.rhoA, section.rhoI)
    beam = ub.Beam.arc((0, 0), 5.0, (0, 1.5), section, cells=5)
    load = ub.PointLoad(beam.end, force=(3e5, -2e5), moment=1e5, amplitude=ub.ramp(0.1))
    return clamped(beam, loads=[load])


@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentum(0.1, 0.1)], ids=str
)
def test_elastic_fibres_are_elastic_resultants(scheme):
    one, other = (ub.simulate(bent(f), scheme, t=(0, 0.2), dt=0.01) for f in (True, False))
    beam, plain = one.scene.beams[0], other.scene.beams[0]
    motion, expected = one.displacement(beam.end), other.displacement(plain.end)
    assert np.abs(expected).max() > 0.05
    # Each step is solved to 1e-10 of the forces
    assert np.abs(motion - expected).max() < 1e-9 * np.abs(expected).max()
    forces = other.section_forces(plain)
    assert np.abs(one.section_forces(beam) - forces).max() < 1e-8 * np.abs(forces).max()
    for name in ("stored", "loads"):
        values = other.energy[name]
        assert np.abs(one.energy[name] - values).max() < 1e-8 * np.abs(values).max()
    assert set(one.energy.lost) == set(other.energy.lost)


# -- moment and curvature ------------------------------------------------------------------------

E, b, h, LIMIT = 200e9, 0.1, 0.2, 250e6
YIELD_CURVATURE = 2 * LIMIT / (E * h)
YIELD_MOMENT = LIMIT * b * h**2 / 6


def moment(times, *, number, limit=LIMIT, softening=None, **more):
    """Moments of a cell that is bent to `times` the curvature at first yield, in ten steps each."""
    fibres = ub.Fibres(ub.ElastoPlastic(limit, **more), number=number, softening=softening)
    section = ub.Section.rectangle(b, h, E=E, nu=0.3, fibres=fibres)
    # A cell so short that it hardly turns: its length stays, though the section may bear nothing
    length = 1e-3
    beam = ub.Beam((0, 0), (length, 0), section, cells=1)
    turns = [0.0, *(x * YIELD_CURVATURE * length for x in times)]
    turn = ub.PrescribedDisplacement(beam.end, u=0, psi=ub.Table(range(len(turns)), turns))
    solution = ub.simulate(clamped(beam, turn), ub.Static(), t=(0, len(times)), dt=0.1)
    return solution.material_at(beam.at(0.5)).forces[::10, 2][1:] / YIELD_MOMENT, solution


def test_plastic_moment_of_a_rectangle():
    """[closed] M/M_y = 3/2 - (κ_y/κ)²/2 beyond first yield, elastic-perfectly plastic."""
    κ = np.array([0.5, 1.5, 2.0, 5.0, 20.0])
    exact = np.where(κ > 1, 1.5 - 0.5 / κ**2, κ)
    errors = np.array([np.abs(moment(κ, number=n)[0] - exact).max() for n in (10, 40, 160)])
    # Layers of one stress: their own second moments, 1/n² in the elastic range, and the layer in
    # which the elastic core ends
    assert (errors < 1.5 / np.array([10, 40, 160]) ** 2).all()


def test_plastic_moment_of_few_fibres():
    """[closed] Two fibres at h/4 with half of the area each yield together: M = LIMIT A h/4."""
    ratio, _ = moment([1.0, 5.0], number=2)
    assert ratio == pytest.approx([E * b * h**3 / 16 * YIELD_CURVATURE / YIELD_MOMENT, 1.5])


def test_unloading_is_elastic_and_leaves_a_curvature():
    """[closed] From κ back by Δκ < 2 κ_y the moment falls by EI Δκ."""
    (loaded, unloaded), solution = moment([5.0, 4.0], number=40)
    assert loaded - unloaded == pytest.approx(1 - 1 / 40**2, rel=1e-9)
    plastic = solution.energy["plastic"]
    # Nothing is dissipated on the way back, to round-off of a strain over its limit
    assert plastic[-1] - plastic[10] <= 1e-12 * plastic[-1]


def test_hardening_fibres_keep_a_slope():
    """[closed] Far beyond first yield dM/dκ = E_t I with E_t = E H/(E + H), for all fibres flow."""
    (_, before, after), _ = moment([1.0, 400.0, 410.0], number=20, isotropic=E / 9)
    assert (after - before) / 10 == pytest.approx(0.1 * (1 - 1 / 20**2), rel=1e-9)


def test_fibres_that_crack_bear_nothing_in_the_end():
    """[closed] Each dissipates energy times area; the moment is gone, the outer fibres first."""
    law = ub.Softening(LIMIT, 1e3)
    κ = [0.9, 5.0, 400.0, 4000.0]
    (elastic, some, few, none), solution = moment(κ, number=10, limit=math.inf, softening=law)
    assert elastic == pytest.approx(0.9 * (1 - 1 / 10**2), rel=1e-9)
    assert some > few > none
    assert abs(none) < 1e-9
    # The openings are 0.5 mm and more, of a length energy/limit of 4e-6 m
    assert solution.energy["hinges"][-1] == pytest.approx(1e3 * b * h, rel=1e-9)


def test_random_limits_blur_the_first_yield():
    """[calc] A scatter of 10 %: weaker than the fibres of the mean at first yield, alike far on."""
    limits = LIMIT, ub.distributions.Normal(LIMIT, 0.1 * LIMIT, seed=3)
    same, random = (moment([0.95, 30.0], number=160, limit=limit)[0] for limit in limits)
    assert random[0] < same[0] * (1 - 1e-4)
    # 0.1/sqrt(160) of the whole moment is one deviation of the sum; three of them
    assert random[1] == pytest.approx(same[1], rel=3 * 0.1 / math.sqrt(160))


@pytest.mark.parametrize("limit", [math.inf, 0.0])
def test_cracks_at_limits_without_end(limit):
    """Infinity never opens, zero never bears; both without a warning."""
    # The bulk never yields, though it could.
    softening = ub.Softening(limit, 1.0)
    ratio, solution = moment([0.5], number=4, limit=1e30, softening=softening)
    bears = 0.5 * (1 - 1 / 4**2) if limit else 0.0
    assert ratio == pytest.approx([bears], rel=1e-9, abs=1e-12)
    # What never opens has no entry.
    assert solution.energy.lost.get("hinges", np.zeros(1))[-1] == 0
    assert ("hinges" in solution.energy.lost) == (limit == 0)
    assert np.isfinite(solution.energy.total).all()
