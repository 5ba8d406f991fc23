# SPDX-License-Identifier: MIT
"""Imposed strains: temperature, shrinkage, tendons, lack of fit."""

import math

import numpy as np
import pytest
from helpers import raises
from scenes import clamped

import ufl_beam as ub
import ufl_beam.structures as st

L, EA, EI = 8.0, 1e9, 1e7
STIFF = {"EA": EA, "GA": 4e8, "EI": EI, "rhoA": 100.0, "rhoI": 1.0}
BOW = 1.2e-3
STATICS = [ub.Static(), ub.EnergyMomentumStatic(1.0), ub.EnergyMomentumStatic(0.5)]


def girder(*loads, held=False, section=None, cells=8):
    """A girder on two supports, or clamped at both ends, under functions of the girder."""
    beam = ub.Beam((0, 0), (L, 0), section or ub.Section(**STIFF), cells=cells, name="girder")
    ends = [ub.Clamped, ub.Clamped] if held else [ub.Pinned, ub.Roller]
    supports = [end(at) for end, at in zip(ends, (beam.start, beam.end), strict=True)]
    return beam, ub.Scene([beam], supports=supports, loads=[load(beam) for load in loads])


def heated(beam, amplitude=lambda t: t):
    """50 K, and 100 K/m more on the left, which is above."""
    return ub.ImposedStrain.temperature(beam, 1.2e-5, 50.0, 100.0, amplitude=amplitude)


def at_once(scene, **more):
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, **more)


# -- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", STATICS, ids=str)
def test_heat_bends_a_free_beam_and_loads_a_clamped_one(scheme):
    """[closed] The free beam becomes an arc of a longer axis without stress.

    The clamped one bears N = -EA α T and, warmer above, tension below: M = EI α g.
    """
    beam, scene = girder(heated)
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
    radius, angle = (1 + 6e-4) / BOW, BOW * L / 2
    # Straight cells in place of the arc: their chords differ by the square of half their angle.
    rise, chord = radius * (1 - math.cos(angle)), 2 * radius * math.sin(angle)
    assert run.displacement(beam.at(0.5))[-1, 1] == pytest.approx(rise, rel=(BOW / 2) ** 2)
    assert run.position(beam.end)[-1, 0] == pytest.approx(chord, rel=(BOW / 2) ** 2)
    diagram = run.diagram(beam)
    assert np.abs(diagram.M).max() < 1e-12 * EI * BOW + 1e-12 * EA * 6e-4
    assert np.abs(diagram.N).max() < 1e-12 * EA * 6e-4

    beam, scene = girder(heated, held=True)
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
    part = 1.0 if scheme != ub.EnergyMomentumStatic(0.5) else 0.875  # forces in mid-step
    diagram = run.diagram(beam)
    np.testing.assert_allclose(diagram.N, -EA * 6e-4 * part, rtol=1e-12)
    np.testing.assert_allclose(diagram.M, EI * BOW * part, rtol=1e-12)
    reaction = run.reaction(scene.supports[1])[-1]
    np.testing.assert_allclose(reaction, [-6e5 * part, 0, 1.2e4 * part], rtol=1e-12, atol=1e-6)
    # The ledger: all stored energy is supplied by the heat.
    stored = (EA * 6e-4**2 + EI * BOW**2) * L / 2
    assert run.energy["stored"][-1] == pytest.approx(stored, rel=1e-12)
    assert run.energy.worst < 1e-14


def test_heat_on_a_part_of_a_beam():
    """[closed] The free end of a cantilever that is heated from 0.25 L to 0.75 L."""
    beam = ub.Beam((0, 0), (L, 0), ub.Section(**STIFF), cells=3)
    strain = ub.ImposedStrain(beam, 1e-4, -1e-5, span=(0.25, 0.75))
    u, v, psi = at_once(clamped(beam, loads=[strain])).displacement(beam.end)[-1]
    assert psi == pytest.approx(-1e-5 * L / 2, rel=1e-12)
    assert v == pytest.approx(-1e-5 * L / 2 * L / 2, rel=1e-4)  # 1e-4 longer
    assert u == pytest.approx(1e-4 * L / 2, rel=1e-5)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_strains_that_vary_along_the_beam(degree):
    """[closed] Rotations follow from mean strains; deflections have order 2 p."""
    beam = ub.Beam((0, 0), (L, 0), ub.Section(**STIFF), cells=3)
    strain = ub.ImposedStrain(beam, curvature=lambda s: 1e-6 * (1 + s + s * s))
    run = at_once(clamped(beam, loads=[strain]), mesh=ub.Mesh(degree=degree))
    _, v, psi = run.displacement(beam.end)[-1]
    assert psi == pytest.approx(1e-6 * L * (1 + 1 / 2 + 1 / 3), rel=1e-12)
    by_hand = 1e-6 * L**2 * (1 / 2 + 1 / 6 + 1 / 12)
    assert v == pytest.approx(by_hand, rel=0.1 if degree == 1 else 1e-9)
    assert np.abs(run.diagram(beam).M).max() < 1e-12 * EI * 1e-6 * 10


def test_a_parabolic_tendon_balances_a_uniform_load():
    """[closed] P with the sag e balances w = 8 P e / L²; the error is of second order."""
    P, e = 1e6, 0.12
    deflections = []
    for cells in (8, 16):
        beam, scene = girder(
            lambda b: ub.ImposedStrain.tendon(b, P, lambda s: -4 * e * s * (1 - s)),
            lambda b: ub.LineLoad(b, force=(0, -8 * P * e / L**2)),
            section=ub.Section(**STIFF, depth=0.3), cells=cells,
        )  # fmt: skip
        run = at_once(scene)
        deflections.append(abs(run.displacement(beam.at(0.5))[-1, 1]))
        # of the load alone; the tendon pulls the girder shorter, by a thousandth
        assert run.diagram(beam).M.max() == pytest.approx(P * e, rel=2 * P / EA)
        assert np.abs(run.diagram(beam).N).max() < 1e-3 * P
        assert run.displacement(beam.end)[-1, 0] == pytest.approx(-P / EA * L, rel=0.05)
    alone = 5 / 48 * P * e * L**2 / EI
    assert deflections[0] < alone / 64  # cells of degree 1 err by the square of 1/8
    assert deflections[1] < deflections[0] / 4


def test_a_column_buckles_at_a_temperature():
    """[closed] Clamped: the square of its frequency vanishes at ε = 4 π² EI/(EA L²)."""
    critical = 4 * math.pi**2 * EI / (EA * L**2)
    _, scene = girder(
        lambda b: ub.ImposedStrain(b, critical, amplitude=lambda t: t), held=True, cells=32
    )

    def square(part):
        state = ub.simulate(scene, ub.Static(), t=(0, part), dt=part)
        return ub.modes(scene, 1, at=state).omega[0] ** 2

    a, b = square(0.5), square(0.9)
    zero = 0.9 + 0.4 * b / (a - b)  # nearly linear; shear and 32 cells change a percent
    assert zero == pytest.approx(1.0, abs=0.03)
    with raises("the ImposedStrain has a stiffness of its own"):
        ub.buckling(scene, 1)


def test_sudden_heat_in_dynamics():
    """[closed] A run begins with the strains of its initial time, and their energy, which stays."""
    _, scene = girder(lambda b: heated(b, amplitude=lambda t: 1.0))
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.05), dt=1e-3)
    stored = (EA * 6e-4**2 + EI * BOW**2) * L / 2
    assert run.energy.total[0] == pytest.approx(stored, rel=1e-12)
    np.testing.assert_allclose(run.energy.total, stored, rtol=1e-9)
    assert run.energy["kinetic"].max() > 0.2 * stored
    assert np.abs(run.energy["loads"]).max() == 0.0


# -- sections and forms ----------------------------------------------------------------------------

LAYERS = ub.Section.rectangle(
    b=0.1, h=0.3, E=30e9, nu=0.2, rho=2500.0, fibres=ub.Fibres(ub.ElastoPlastic(9e6), number=6)
)
SECTIONS = {
    "elastic": ub.Section(**STIFF),
    "yields": ub.Section(**STIFF, bending=ub.ElastoPlastic(6e3, isotropic=1e5)),
    "breaks": ub.Section(**STIFF, hinge=ub.Softening(6e3, fracture_energy=3e4)),
    "fibres": LAYERS,
    "bars": LAYERS.reinforced(
        y=[-0.1, 0.1], A=[3e-4, 2e-4], E=200e9, fibres=ub.Fibres(st.MenegottoPinto(4e7, 0.02))
    ),
    "both": ub.Section(**STIFF, interaction=st.AxialBending(axial=8e5, bending=9e3)),
}
SCHEMES = [
    ub.Static(), ub.EnergyMomentumStatic(0.75), ub.EnergyMomentum(alpha=0.05),
    ub.EnergyMomentumDecaying(), ub.GeneralizedAlpha(0.8),
]  # fmt: skip


@pytest.mark.serial
@pytest.mark.filterwarnings("ignore:girder. the hinge of the section:ufl_beam.ModelWarning")
@pytest.mark.parametrize(
    ("section", "scheme"),
    [pytest.param(name, SCHEMES[k % 5], id=name) for k, name in enumerate(SECTIONS)],
)
def test_all_schemes_and_sections_agree_with_the_reference(section, scheme, as_by_reference):
    """Heat and a load: motions, section forces and ledger, to the digits of Newton's method."""
    beam, scene = girder(
        lambda b: heated(b, amplitude=lambda t: min(t, 0.7)),
        lambda b: ub.ImposedStrain(b, axial=(0, -1e-4), shear=1e-5, amplitude=math.sin),
        lambda b: ub.PointLoad(b.at(0.5), force=(0, -5e3), amplitude=lambda t: t),
        held=True, section=SECTIONS[section],
    )  # fmt: skip
    end, dt = (0.02, 2e-3) if scheme.dynamic else (1.0, 0.1)
    mesh = ub.Mesh(degree=2 if section == "bars" else 1)
    run = ub.simulate(scene, scheme, t=(0, end), dt=dt, mesh=mesh)
    as_by_reference(run, 1e-8)
    # The reaction is the section force at the end.
    forces = [x[-1] for x in run.diagram(beam)[1:]]
    assert run.displacement(beam.end)[-1, 2] == 0.0
    reaction = run.reaction(scene.supports[1])[-1]
    np.testing.assert_allclose(reaction, forces, rtol=0, atol=1e-9 * np.abs(forces).max())


@pytest.mark.serial
@pytest.mark.parametrize(("section", "degree"), [("elastic", 2), ("yields", 1)])
def test_forms_for_dolfinx_subtract_imposed_strains(section, degree):
    """Internal forces of the accepted state equal the reactions of a heated clamped beam."""
    fem = pytest.importorskip("dolfinx.fem")
    _, scene = girder(heated, held=True, section=SECTIONS[section])
    simulation = ub.Simulation(scene, ub.Static(), mesh=ub.Mesh(degree=degree))
    simulation.step_to(1.0)
    view = simulation.dolfinx
    forces = np.zeros(len(simulation.q))
    np.add.at(forces, view.dofs, fem.assemble_vector(fem.form(view.forms.work)).array)
    reactions = simulation.now.reaction(scene.supports[1])[-1]
    assert np.abs(reactions).max() == pytest.approx(np.abs(forces).max(), rel=1e-9)
    assert forces.reshape(-1, 3).sum(axis=0)[:2] == pytest.approx([0, 0], abs=1e-6)


@pytest.mark.parametrize("section", ["elastic", "yields"])
def test_a_path_has_the_forces_of_a_run(section):
    def bent(beam):
        return ub.ImposedStrain(beam, curvature=lambda s: 1e-3 * s, amplitude=lambda t: t)

    beam, scene = girder(heated, bent, held=True, section=SECTIONS[section])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    path = ub.follow(scene, ub.LoadControl(0.25), steps=4)
    for one, other in zip(path.diagram(beam), run.diagram(beam), strict=True):
        assert np.abs(one - other).max() <= 1e-9 * np.abs(run.diagram(beam).M).max()


# -- the model -------------------------------------------------------------------------------------

BEAM = ub.Beam((0, 0), (4, 0), ub.Section.rectangle(b=0.2, h=0.4, E=30e9, nu=0.2), name="girder")


@pytest.mark.parametrize("fibres", [None, ub.Fibres(ub.ElastoPlastic(30e6))])
def test_a_tendon_stays_in_an_unsymmetric_section(fibres):
    """A T of 0.8 m with a flange of 1 m x 0.2 m at the top: the web reaches farther down."""
    section = st.t_shape(0.8, 1.0, 0.2, 0.2, E=30e9, nu=0.2, rho=2500.0, fibres=fibres)
    beam = ub.Beam((0, 0), (10, 0), section)
    y = np.average([0.3, 0.7], weights=[0.6 * 0.2, 1.0 * 0.2])  # of the centroid, from the bottom
    ub.ImposedStrain.tendon(beam, 1e6, 0.01 - y)
    for outside in (-0.01 - y, 0.81 - y):
        with raises("outside its section", kind=ub.ModelError):
            ub.ImposedStrain.tendon(beam, 1e6, outside)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ub.ImposedStrain(BEAM, span=(0.5, 1.2)), "span = (0.5, 1.2) must be two"),
        (lambda: ub.ImposedStrain(BEAM, curvature=lambda s: 1 / s), "curvature fails at s = 0"),
        (
            lambda: ub.ImposedStrain.tendon(BEAM, 1e6, (0.0, -0.25)),
            "eccentricity -0.25 m in girder at s = 1, outside its section, which reaches from -0.2",
        ),
    ],
)
def test_wrong_strains_are_refused(make, message):
    with raises(message, kind=ub.ModelError):
        make()
