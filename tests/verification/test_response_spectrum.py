# SPDX-License-Identifier: MIT
"""Response spectrum analysis: a shear frame by hand, the formula of CQC, static runs of modes.

[calc] A two-storey shear frame: rigid girders of mass m and columns of 24 EI/h³ a storey have the
2 x 2 matrices M = diag(m1, m2), K = [[2k, -k], [-k, k]].
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import raises
from scenes import clamped, rigid_chain
from scipy.linalg import eigh

import ufl_beam as ub
import ufl_beam.structures as st

EI, H, L, M1, M2 = 2e6, 3.0, 5.0, 12e3, 8e3  # N m², m, m, kg, kg
CUBIC = ub.Mesh(degree=3)
STOREY = 24 * EI / H**3  # N/m
STIFF = 1e6
"""Ratio of the stiffness of girders, and of axial stiffness, to bending: errors below 1e-5."""


def spectrum(T):
    """A spectrum with a plateau up to 0.4 s; m/s²."""
    return 6.0 * min(1.0, 0.4 / T)


def frame():
    column = ub.Section(EA=STIFF * EI, GA=STIFF * EI, EI=EI, rhoA=0.0)
    girder = ub.Section(EA=STIFF * EI, GA=STIFF * EI, EI=STIFF * EI, rhoA=0.0)

    def beam(a, b, section, name):
        return ub.Beam(a, b, section, cells=1, name=name)

    left = [beam((0, H * i), (0, H * (i + 1)), column, f"left {i}") for i in (0, 1)]
    right = [beam((L, H * i), (L, H * (i + 1)), column, f"right {i}") for i in (0, 1)]
    tops = [beam((0, H * i), (L, H * i), girder, f"girder {i}") for i in (1, 2)]
    joints = []
    for side, end in ((left, "start"), (right, "end")):
        joints += [
            ub.Rigid(side[0].end, side[1].start, getattr(tops[0], end)),
            ub.Rigid(side[1].end, getattr(tops[1], end)),
        ]
    masses = [
        ub.PointMass(side[i].end, mass / 2)
        for side in (left, right) for i, mass in enumerate((M1, M2))
    ]  # fmt: skip
    supports = [ub.Clamped(left[0].start), ub.Clamped(right[0].start)]
    return ub.Scene([*left, *right, *tops], joints=joints, supports=supports, masses=masses)


SCENE = frame()


def unit(T):
    return 1.0


def analysed(rule="CQC", n=2, **options):
    return st.response_spectrum_analysis(SCENE, spectrum, n=n, rule=rule, mesh=CUBIC, **options)


def by_hand():
    """Frequencies, drifts of the roof and storey forces of both modes."""
    K = STOREY * np.array([[2.0, -1.0], [-1.0, 1.0]])
    M = np.diag([M1, M2])
    squares, φ = eigh(K, M)
    Γ = φ.T @ M @ np.ones(2)
    Sa = np.array([spectrum(2 * math.pi / ω) for ω in np.sqrt(squares)])
    u = φ * Γ * Sa / squares
    return np.sqrt(squares), Γ**2, u, K @ u, Sa


def cqc(ω, ζ=0.05):
    """[pub] Coefficients in the ratio of frequencies, for equal damping; Der Kiureghian 1981."""
    r = ω / ω[:, None]
    above, below = 8 * ζ**2 * (1 + r) * r**1.5, (1 - r**2) ** 2 + 4 * ζ**2 * r * (1 + r) ** 2
    return above / below


@pytest.mark.parametrize("rule", ["SRSS", "CQC"])
def test_a_shear_frame_is_that_of_hand_calculation(rule):
    response = analysed(rule)
    ω, effective, u, forces, Sa = by_hand()
    assert np.allclose(response.modes.omega, ω, rtol=2e-5)
    assert np.allclose(response.effective_masses, effective, rtol=1e-4)
    ρ = cqc(ω) if rule == "CQC" else np.eye(2)

    def combined(x):
        return math.sqrt(x @ ρ @ x)

    shears = np.cumsum(forces[::-1], axis=0)[::-1]  # of both storeys
    for i, name in enumerate(("left 0", "left 1")):
        beam = SCENE[name]
        assert response.displacement(beam.end)[0] == pytest.approx(combined(u[i]), rel=1e-4)
        diagram = response.diagram(beam, points=3)
        assert np.allclose(diagram.V, combined(shears[i]) / 2, rtol=1e-4)
        assert diagram.M[0] == pytest.approx(combined(shears[i]) / 2 * H / 2, rel=1e-4)
    drift = response.combine(
        response.peaks(SCENE["left 1"].end) - response.peaks(SCENE["left 0"].end)
    )
    assert drift[0] == pytest.approx(combined(u[1] - u[0]), rel=1e-4)
    assert response.base_shear == pytest.approx(combined(effective * Sa), rel=1e-4)
    reactions = [response.reactions[:, i, 0] for i in (0, 1)]
    assert np.allclose(-sum(reactions), shears[0], rtol=1e-4)
    assert response.missing_mass == pytest.approx(0.0, abs=1e-9)


def test_effective_masses_add_up_to_the_mass_that_moves():
    """All modes of a cantilever with consistent mass, and of the frame with constraints."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    beam = ub.Beam((0, 0), (0, 2), section, cells=4, name="beam")
    scene = clamped(beam)
    for mesh, moving in ((ub.Mesh(lumped=True), 7 / 8), (None, None)):
        response = st.response_spectrum_analysis(scene, unit, n=12, mesh=mesh)
        # sums of squares of 12 products of eigenvectors, which are accurate to 1e-8
        assert response.missing_mass == pytest.approx(0.0, abs=1e-7)
        if moving:  # half of the first cell is at the clamp
            assert response.mass == pytest.approx(moving * 2 * section.rhoA, rel=1e-12)
    other = ub.Beam((0, 2), (1, 2), section, cells=2, name="other")
    shared = rigid_chain([beam, other], supports=[ub.Clamped(beam.start)])
    joint = ub.Rigid(beam.end, other.start, multipliers=True)
    angled = replace(shared, joints=[joint])
    held, equal = (st.response_spectrum_analysis(x, unit, n=18) for x in (angled, shared))
    assert held.missing_mass == pytest.approx(0.0, abs=1e-7)
    assert held.mass == pytest.approx(equal.mass, rel=1e-9)
    assert held.base_shear == pytest.approx(equal.base_shear, rel=1e-6)


@pytest.mark.parametrize("degree", [1, 3])
def test_section_forces_of_a_mode_are_those_of_a_static_run(degree):
    """Under the inertial forces of the mode, of distributed and point masses.

    Forces are so small that nonlinear terms are below 1e-6, and above the tolerance of Newton's
    method, 1e-8 of the largest force.
    """
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    column = ub.Beam((0, 0), (0, 3), section, cells=6, name="column")
    arm = ub.Beam((0, 3), (2, 3.5), section, cells=4, name="arm")
    mass = ub.PointMass(arm.end, 300.0)
    scene = rigid_chain([column, arm], supports=[ub.Clamped(column.start)], masses=[mass])
    mesh, small = ub.Mesh(degree=degree), 1e-5
    with pytest.warns(ub.ModelWarning, match="of the mass"):
        response = st.response_spectrum_analysis(scene, lambda T: small, n=1, mesh=mesh)
    size = response.participation[0] * small  # times ω²/ω²
    loads = [ub.PointLoad(arm.end, tuple(300.0 * size * response.modes.shape(0, arm.end)[:2].real))]
    densities = [
        {"force": (section.rhoA * size, 0.0)},
        {"force": (0.0, section.rhoA * size)},
        {"moment": section.rhoI * size},
    ]
    for beam in scene.beams:
        for axis, density in enumerate(densities):

            def along(s, beam=beam, axis=axis):
                return float(response.modes.shape(0, beam.at(s))[axis].real)

            loads.append(ub.LineLoad(beam, **density, profile=along))
    steps = {"t": (0, 1), "dt": 1.0, "mesh": mesh}
    run, foot = ub.simulate(replace(scene, loads=loads), ub.Static(), **steps), scene.supports[0]
    moved = np.abs(run.displacement(arm.end)[-1])
    np.testing.assert_allclose(response.displacement(arm.end), moved, rtol=1e-5)
    np.testing.assert_allclose(response.reaction(foot), np.abs(run.reaction(foot)[-1]), rtol=1e-5)
    for beam in scene.beams:
        ends, found = run.diagram(beam, points=5), response.diagram(beam, points=5)
        for name in ("N", "V", "M"):
            values = np.abs(getattr(ends, name))
            assert np.allclose(getattr(found, name), values, rtol=0, atol=1e-5 * values.max())


@pytest.mark.parametrize(
    ("state", "degree"), [("heated", 1), ("yielded", 1), ("yielded", 2), ("with an open hinge", 2)]
)
def test_section_forces_about_a_state_are_in_equilibrium_with_reactions(state, degree):
    """At the ends of a clamped beam whose section forces are not those of its configuration."""
    limit = 250e6 * 0.1 * 0.1**2 / 4  # plastic moment; N m
    laws = {
        "heated": {},
        "yielded": {"fibres": ub.Fibres(ub.ElastoPlastic(250e6, kinematic=2e9), number=8)},
        "with an open hinge": {"hinge": ub.LinearSoftening(limit, 0.025 * limit)},
    }
    section = ub.Section.rectangle(b=0.1, h=0.1, E=210e9, nu=0.3, rho=7850.0, **laws[state])
    in_cells = {0.0: None, 1.0: None} if "hinge" in laws[state] else {}  # not at the ends
    beam = ub.Beam((0, 0), (2, 0), section, cells=12, hinges=in_cells)
    actions = {
        "heated": [ub.ImposedStrain.temperature(beam, 1.2e-5, uniform=200.0)],
        "yielded": [ub.PointLoad(beam.at(0.5), (0, -9.0 * limit / 2))],
        "with an open hinge": [],
    }
    turned = 0.2 if state == "with an open hinge" else 0.0
    start = ub.PrescribedDisplacement(beam.start, u=0.0, v=0.0, psi=lambda t: turned * t)
    supports = [start, ub.Clamped(beam.end)]
    scene = ub.Scene([beam], supports=supports, loads=actions[state])
    mesh = ub.Mesh(degree=degree)
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.05, mesh=mesh)
    with pytest.warns(ub.ModelWarning, match="of the mass"):
        response = st.response_spectrum_analysis(
            scene, lambda T: 1.0, n=1, direction=(0, 1), at=at, mesh=mesh
        )
    diagram = response.diagram(beam)
    reactions = [response.reaction(support)[2] for support in supports]
    assert np.allclose(diagram.M[[0, -1]], reactions, rtol=0, atol=1e-9 * max(reactions))
    shown, forces = response.modes.motion(0, amplitude=1e-12, count=1), at.section_forces(beam)
    assert np.allclose(shown.section_forces(beam), forces, rtol=0, atol=1e-8 * abs(forces).max())
    if state == "yielded":
        assert at.energy.lost["plastic"][-1] > 0.0
    if state == "with an open hinge":
        assert at.energy.lost["hinges"][-1] > 0.9 * 0.025 * limit


def test_a_loaded_state_softens_the_frame():
    """[closed] A weight P on a storey of columns: k - 6/5 P/h, to 1/700 (P h²/EI)²."""
    weight = 1e4
    loads = [ub.PointLoad(SCENE[name].end, (0, -weight)) for name in ("left 1", "right 1")]
    loaded = replace(SCENE, loads=loads)
    state = ub.simulate(loaded, ub.Static(), t=(0, 1), dt=1.0, mesh=CUBIC)
    response = st.response_spectrum_analysis(loaded, spectrum, n=2, at=state)
    k = STOREY - 2 * 1.2 * weight / H
    K = k * np.array([[2.0, -1.0], [-1.0, 1.0]])
    squares = eigh(K, np.diag([M1, M2]), eigvals_only=True)
    assert np.allclose(response.modes.omega, np.sqrt(squares), rtol=1e-4)


MAST = ub.Beam((0, 0), (0, 3), ub.Section(EA=1e8, GA=1e8, EI=1e6, rhoA=10.0), cells=2)
DAMPER = ub.Stretch(ub.ground(1, 3), MAST.end, ub.Damper(1e4))
LIGHT = ub.Beam((0, 0), (0, 3), ub.Section(1e8, 1e8, 1e6, rhoA=0.0), cells=2)
HELD = ub.Potential("soil", lambda q: q[0] ** 2)


@pytest.mark.parametrize(
    ("scene", "curve", "words"),
    [
        (ub.Scene([MAST]), spectrum, ["move without strain"]),
        (clamped(MAST), ([1.0, 2.0], [3.0, 2.0]), ["covers periods from 1 to 2 s, but not 0."]),
        (clamped(MAST), lambda T: 0.0, ["must be positive"]),
        (clamped(MAST, connectors=[DAMPER]), spectrum, ["dampers"]),
        (clamped(LIGHT), spectrum, ["nothing that can move has mass"]),
        (clamped(MAST, works=[HELD]), spectrum, ["works are left out of section forces"]),
        *(
            (clamped(MAST, loads=[load]), spectrum, [name, "the force follows the motion"])
            for name, load in (
                ("FollowerLoad", ub.FollowerLoad(MAST.end, force=(0, -1.0))),
                ("Pressure", ub.Pressure(MAST, 1.0)),
            )
        ),
    ],
)
def test_what_cannot_be_analysed_is_refused(scene, curve, words):
    at = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0) if scene.loads else None
    with raises(*words):
        st.response_spectrum_analysis(scene, curve, n=1, at=at)


def test_peaks_have_a_row_for_each_mode():
    with raises("combine: peaks of shape (3,) must have a row for each of the 2 modes"):
        st.response_spectrum_analysis(clamped(MAST), spectrum, n=2).combine(np.ones(3))


def test_a_body_beyond_the_end_of_a_beam_moves_with_the_ground():
    """[closed] The one mode of a massless column has all the mass."""
    section = ub.Section(EA=4e8, GA=1e8, EI=1.4e6)
    column = ub.Beam((0, 0), (0, 3), section)
    body = ub.Body((0, 3.5), mass=5e3, inertia=0.0, name="roof")
    scene = clamped(column, bodies=[body], joints=[ub.Rigid(column.end, body.at(0, 3))])
    found = st.response_spectrum_analysis(scene, lambda T: 3.0, n=1)
    assert found.effective_masses == pytest.approx([5e3])
    assert found.mass == pytest.approx(5e3)


def test_a_support_bears_the_moment_of_a_spring():
    section = ub.Section(EA=4e8, GA=1e8, EI=1.4e6, rhoA=1.0)
    stub = ub.Beam((-1, 0), (0, 0), section)
    column = ub.Beam((0, 0), (0, 3), section, cells=2)
    joint = ub.Revolute(stub.end, column.start)
    spring = ub.Turn(stub.end, column.start, ub.Spring(1e5))
    base, mass = ub.Clamped(stub.end), ub.PointMass(column.end, 5e3)
    parts = {"joints": [joint], "connectors": [spring], "masses": [mass]}
    scene = ub.Scene([stub, column], supports=[ub.Clamped(stub.start), base], **parts)
    response = st.response_spectrum_analysis(scene, lambda T: 3.0, n=1)
    assert response.reaction(base)[2] == pytest.approx(response.diagram(column).M[0], rel=1e-6)
