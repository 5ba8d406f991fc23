# SPDX-License-Identifier: MIT
"""Imposed strains: temperature, shrinkage, tendons, lack of fit."""

import math

import numpy as np
import pytest
from helpers import raises

import ufl_beam as ub
import ufl_beam.structures as st

L, EA, EI = 8.0, 1e9, 1e7
STIFF = {"EA": EA, "GA": 4e8, "EI": EI, "rhoA": 100.0, "rhoI": 1.0}
BOW = 1.2e-3
STATICS = [ub.Static(), ub.EnergyMomentumStatic(1.0), ub.EnergyMomentumStatic(0.5)]


def girder(*loads, held=False, section=None, cells=8, **more):
    """A girder on two supports, or clamped at both ends, under functions of the girder."""
    beam = ub.Beam((0, 0), (L, 0), section or ub.Section(**STIFF), cells=cells, name="girder")
    ends = [ub.Clamped, ub.Clamped] if held else [ub.Pinned, ub.Roller]
    supports = [end(at) for end, at in zip(ends, (beam.start, beam.end), strict=True)]
    return beam, ub.Scene([beam], supports=supports, loads=[load(beam) for load in loads], **more)


def heated(beam, amplitude=lambda t: t):
    """50 K, and 100 K/m more on the left, which is above."""
    return ub.ImposedStrain.temperature(beam, 1.2e-5, 50.0, 100.0, amplitude=amplitude)


def middle(beam, solution):
    return float(solution.displacement(beam.at(0.5))[-1, 1])


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
    rise = radius * (1 - math.cos(angle))
    assert middle(beam, run) == pytest.approx(rise, rel=(BOW / 2) ** 2)
    end = run.position(beam.end)[-1, 0]
    assert end == pytest.approx(2 * radius * math.sin(angle), rel=(BOW / 2) ** 2)
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
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[strain])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    u, v, psi = run.displacement(beam.end)[-1]
    assert psi == pytest.approx(-1e-5 * L / 2, rel=1e-12)
    assert v == pytest.approx(-1e-5 * L / 2 * L / 2, rel=1e-4)  # 1e-4 longer
    assert u == pytest.approx(1e-4 * L / 2, rel=1e-5)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_strains_that_vary_along_the_beam(degree):
    """[closed] Rotations follow from mean strains; deflections have order 2 p."""
    beam = ub.Beam((0, 0), (L, 0), ub.Section(**STIFF), cells=3)
    strain = ub.ImposedStrain(beam, curvature=lambda s: 1e-6 * (1 + s + s * s))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[strain])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, mesh=ub.Mesh(degree=degree))
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
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
        deflections.append(abs(middle(beam, run)))
        # of the load alone; the tendon pulls the girder shorter, by a thousandth
        assert run.diagram(beam).M.max() == pytest.approx(P * e, rel=2 * P / EA)
        assert np.abs(run.diagram(beam).N).max() < 1e-3 * P
        assert run.displacement(beam.end)[-1, 0] == pytest.approx(-P / EA * L, rel=0.05)
    alone = 5 / 48 * P * e * L**2 / EI
    assert deflections[0] < alone / 64  # cells of degree 1 err by the square of 1/8
    assert deflections[1] < deflections[0] / 4


def test_a_bar_that_is_too_short():
    """[closed] Lack of fit δ of one of two equal bars in a row: N = EA δ / (2 L)."""
    bars = [ub.Beam((x, 0), (x + L, 0), ub.Section(**STIFF), cells=2) for x in (0.0, L)]
    scene = ub.Scene(
        bars, joints=[ub.Rigid(bars[0].end, bars[1].start)],
        supports=[ub.Clamped(bars[0].start), ub.Clamped(bars[1].end)],
        loads=[ub.ImposedStrain(bars[0], axial=-0.002 / L)],
    )  # fmt: skip
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0)
    for bar in bars:
        np.testing.assert_allclose(run.diagram(bar).N, EA * 0.002 / (2 * L), rtol=1e-12)
    assert run.displacement(bars[0].end)[-1, 0] == pytest.approx(-0.001, rel=1e-12)


def test_a_column_buckles_at_a_temperature():
    """[closed] Clamped: the square of its frequency vanishes at ε = 4 π² EI/(EA L²)."""
    critical = 4 * math.pi**2 * EI / (EA * L**2)

    def square(strain):
        _, scene = girder(
            lambda b: ub.ImposedStrain(b, 1.0, amplitude=lambda t: t), held=True, cells=32
        )
        state = ub.simulate(scene, ub.Static(), t=(0, strain), dt=strain)
        return ub.modes(scene, 1, at=state).omega[0] ** 2

    a, b = square(0.5 * critical), square(0.9 * critical)
    zero = 0.9 + 0.4 * b / (a - b)  # nearly linear; shear and 32 cells change a percent
    assert zero == pytest.approx(1.0, abs=0.03)


# -- dynamics and the ledger -----------------------------------------------------------------------


def test_sudden_heat_in_dynamics():
    """[closed] A run begins with the strains of its initial time, and their energy, which stays."""
    _, scene = girder(lambda b: heated(b, amplitude=lambda t: 1.0))
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.05), dt=1e-3)
    stored = (EA * 6e-4**2 + EI * BOW**2) * L / 2
    assert run.energy.total[0] == pytest.approx(stored, rel=1e-12)
    np.testing.assert_allclose(run.energy.total, stored, rtol=1e-9)
    assert run.energy["kinetic"].max() > 0.2 * stored
    assert np.abs(run.energy["loads"]).max() == 0.0


SECTIONS = {
    "elastic": ub.Section(**STIFF),
    "yields": ub.Section(**STIFF, bending=ub.ElastoPlastic(6e3, isotropic=1e5)),
    "breaks": ub.Section(**STIFF, hinge=ub.Softening(6e3, fracture_energy=3e4)),
    "fibres": ub.Section.rectangle(
        b=0.1, h=0.3, E=30e9, nu=0.2, rho=2500.0, fibres=ub.Fibres(ub.ElastoPlastic(9e6), number=6)
    ),
    "bars": ub.Section.rectangle(
        b=0.1, h=0.3, E=30e9, nu=0.2, rho=2500.0, fibres=ub.Fibres(ub.ElastoPlastic(9e6), number=6)
    ).reinforced(
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
    [
        *(pytest.param("yields", scheme, id=str(scheme)) for scheme in SCHEMES),
        *(pytest.param(name, SCHEMES[k % 5], id=name) for k, name in enumerate(SECTIONS)),
    ],
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
    fast = ub.simulate(scene, scheme, t=(0, end), dt=dt, mesh=mesh)
    as_by_reference(fast, 1e-8)
    if isinstance(scheme, ub.EnergyMomentumStatic | ub.EnergyMomentum | ub.EnergyMomentumDecaying):
        assert fast.energy.worst < 1e-9
    # The reaction is the section force at the end.
    N, V, M = (x[-1] for x in fast.diagram(beam)[1:])
    psi = fast.displacement(beam.end)[-1, 2]
    assert psi == 0.0
    size = np.abs([N, V, M]).max()
    reaction = fast.reaction(scene.supports[1])[-1]
    np.testing.assert_allclose(reaction, [N, V, M], rtol=0, atol=1e-9 * size)


def test_paths_restarts_and_files_have_the_same_forces(shared_path):
    """A path by load control, a run in two halves, and a saved solution with functions."""
    beam, scene = girder(
        heated, lambda b: ub.ImposedStrain(b, curvature=lambda s: 1e-3 * s, amplitude=lambda t: t),
        held=True, section=SECTIONS["yields"],
    )  # fmt: skip
    whole = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)
    path = ub.follow(scene, ub.LoadControl(0.25), steps=4)
    half = ub.simulate(scene, ub.Static(), t=(0, 0.5), dt=0.25)
    rest = ub.simulate(scene, ub.Static(), t=(0.5, 1), dt=0.25, start=half)
    whole.save(shared_path / "heated.solution")
    loaded = ub.Solution.load(shared_path / "heated.solution")
    for other, tolerance in ((path, 1e-9), (rest, 1e-12), (loaded, 0.0)):
        mine = other.diagram(other.scene.beams[0])
        for a, b in zip(mine[1:], whole.diagram(beam)[1:], strict=True):
            assert np.abs(a - b).max() <= tolerance * np.abs(whole.diagram(beam).M).max()
    assert whole.energy["plastic"][-1] > 0


# -- the model -------------------------------------------------------------------------------------


def test_a_scene_without_imposed_strains_has_no_term_for_them():
    _, scene = girder()
    simulation = ub.Simulation(scene, ub.Static())
    (cells,) = simulation.beams
    assert not cells.imposed
    assert not [name for name in cells.statement.inputs if "imposed" in name]
    simulation.close()


BEAM = ub.Beam((0, 0), (4, 0), ub.Section.rectangle(b=0.2, h=0.4, E=30e9, nu=0.2), name="girder")


@pytest.mark.parametrize(
    "fibres", [None, ub.Fibres(ub.ElastoPlastic(30e6))], ids=["elastic", "fibres"]
)
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
        (lambda: ub.ImposedStrain(BEAM, axial="hot"), "axial"),
        (lambda: ub.ImposedStrain(BEAM, curvature=lambda s: 1 / s), "curvature fails at s = 0"),
        (lambda: ub.ImposedStrain(BEAM, axial=lambda s: None), "axial"),
        (lambda: ub.ImposedStrain.temperature(BEAM, 0.0, 10), "expansion"),
        (
            lambda: ub.ImposedStrain.tendon(BEAM, 1e6, (0.0, -0.25)),
            "eccentricity -0.25 m in girder at s = 1, outside its section, which reaches from -0.2",
        ),
    ],
)
def test_wrong_strains_are_refused(make, message):
    with raises(message, kind=ub.ModelError):
        make()


def test_buckling_refuses_imposed_strains():
    _, scene = girder(heated, held=True)
    with raises("the ImposedStrain has a stiffness of its own"):
        ub.buckling(scene, 1)


@pytest.mark.serial
@pytest.mark.parametrize(("section", "degree"), [("elastic", 1), ("elastic", 2), ("yields", 3)])
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
    held = forces[np.abs(forces) > 1e-9 * np.abs(forces).max()]
    assert np.abs(reactions).max() == pytest.approx(np.abs(held).max(), rel=1e-9)
    assert forces.reshape(-1, 3).sum(axis=0)[:2] == pytest.approx([0, 0], abs=1e-6)
