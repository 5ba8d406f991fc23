# SPDX-License-Identifier: MIT
"""Inelastic cells in a run: steps that fail leave no trace, and only cells that can yield pay."""

import math

import numpy as np
import pytest
from failing_steps import let_fail
from scenes import clamped

import ufl_beam as ub

ELASTIC = {"EA": 1e5, "GA": 1e5, "EI": 100.0, "rhoA": 1.0, "rhoI": 0.01}


class CutSteps(ub.Simulation):
    """A simulation in which the first attempts at a step fail, after their last iteration."""

    fails = 0

    def __init__(self, *arguments):
        super().__init__(*arguments)
        let_fail(self, self._fails)

    def _fails(self, t1):
        self.fails -= 1
        return self.fails >= 0


def state(simulation):
    """All that a state consists of."""
    return [
        simulation.q,
        *simulation.velocities(),
        *(x.points.state() for x in simulation.inelastic),
        *(np.array(list(group.values())) for group in simulation.entries()),
    ]


@pytest.mark.parametrize(
    ("scheme", "more"),
    [
        (ub.EnergyMomentumStatic(), {}),
        (ub.EnergyMomentum(0.1, 0.1), {"hinge": ub.Softening(7.0, 8.0)}),
    ],
)
def test_a_cut_step_is_its_parts(scheme, more):
    """Two failures cut a step into quarters: the same as quarters from there.

    To the last digit in dynamics: steps have the same ends, 1/64 s and its parts.
    """
    section = ub.Section(**ELASTIC, bending=ub.ElastoPlastic(5.0, 20.0), **more)
    beam = ub.Beam((0, 0), (1, 0), section, cells=5)
    lift = ub.PrescribedDisplacement(beam.end, v=ub.Table([0, 0.5, 1], [0, 0.4, 0.1]))
    scene = clamped(beam, lift)
    cut, fine = CutSteps(scene, scheme), CutSteps(scene, scheme)
    for n in range(32):
        cut.fails = 2 * (n % 5 == 0)
        parts = cut.substeps
        cut.step_to((n + 1) / 64)
        ends = np.linspace(n, n + 1, 5)[1:] if n % 5 == 0 else [n + 1]
        if cut.substeps - parts == 3:  # the parts grow again: 1/4, 1/4, 1/2
            ends = [n + 0.25, n + 0.5, n + 1]
        for end in ends:
            fine.step_to(end / 64)
        assert cut.substeps == fine.substeps
        # Parts of a static step take their motions between its ends, which is round-off here.
        digits = 0.0 if scheme.dynamic else 1e-10
        for one, two in zip(state(cut), state(fine), strict=True):
            np.testing.assert_allclose(one, two, rtol=digits, atol=digits)
    _, _, lost = cut.entries()  # of all processes, each of which has some of the cells
    assert lost["plastic"] > 0
    assert lost.get("hinges", 0.0) > 0 if more else "hinges" not in lost


def test_a_failure_keeps_the_results_so_far():
    """[closed] A force beyond the plastic limit, which is reached at half of the load."""
    section = ub.Section(**ELASTIC, bending=ub.ElastoPlastic(5.0), axial=ub.ElastoPlastic(10.0))
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(20.0, 0), amplitude=ub.ramp(1.0))])
    with pytest.raises(ub.ConvergenceError) as failure:
        ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=0.125)
    solution = failure.value.solution
    assert solution.times[-1] == failure.value.time == pytest.approx(0.5, abs=1e-3)
    material = solution.material_at(beam.end)
    assert len(material.forces) == len(solution.times) == len(solution.energy.total)
    assert material.forces[-1, 0] == pytest.approx(20 * solution.times[-1], rel=1e-9)
    for values in material:
        assert np.isfinite(values).all()
    assert solution.energy.worst < 1e-9


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_one_hinge_among_fifty_cells(degree):
    """No cell has points; the jump is at the place, and files have it in the cell before it."""
    beam = ub.Beam(
        (0, 0), (1, 0), ub.Section(**ELASTIC), cells=50, hinges={0.503: ub.Softening(5.0, 10.0)}
    )
    scene = clamped(beam, ub.PrescribedDisplacement(beam.end, psi=ub.ramp(1.0)))
    mesh = ub.Mesh(degree=degree)
    simulation = ub.Simulation(scene, ub.EnergyMomentumStatic(), mesh=mesh)
    assert not simulation.inelastic
    simulation.step_to(1.0)
    jump, dissipated = simulation.damage()
    assert np.flatnonzero(jump).tolist() == np.flatnonzero(dissipated).tolist() == [25]
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.05, mesh=mesh)
    material = solution.material_at(beam.at(0.503))
    assert "plastic" not in solution.energy.lost
    assert "hardening" not in solution.energy.state
    # [closed] The moment is uniform, of the hinge and of the curvature: M/EI L + jump = 1 rad
    M, jump = material.forces[-1, 2], material.jump[-1]
    assert pytest.approx(5 * math.exp(-5 / 10 * jump), rel=1e-9) == M
    np.testing.assert_allclose(solution.section_forces(beam)[:, 2], M, rtol=1e-9)
    assert M / 100 + jump == pytest.approx(1, rel=1e-9)
    assert solution.energy["hinges"][-1] == pytest.approx(10 * (1 - M / 5), rel=1e-9)


def test_hinges_of_a_beam_come_before_those_of_its_section():
    """At ends; the cells have the law of the section."""
    law, other = ub.Softening(5.0, 10.0), ub.LinearSoftening(1.0, 2.0)
    section = ub.Section(**ELASTIC, hinge=law)
    beams = [
        ub.Beam((0, y), (1, y), section, cells=4, hinges=hinges)
        for y, hinges in enumerate([{}, {1.0: other}, {0.0: None, 0.5: other}])
    ]
    scene = ub.Scene(beams, supports=[ub.Clamped(p) for b in beams for p in (b.start, b.end)])
    assert [(beams.index(h.a.beam), h.a.s, h.law.law) for h in scene.hinges] == [
        (0, 0.0, law), (0, 1.0, law), (1, 0.0, law), (1, 1.0, other), (2, 1.0, law), (2, 0.5, other)
    ]  # fmt: skip
    assert all(beam.section.hinge is law for beam in beams)


def test_cracks_of_fibres_are_no_rotations():
    fibres = ub.Fibres(ub.ElastoPlastic(math.inf), number=4, softening=ub.Softening(1e6, 1e3))
    section = ub.Section.rectangle(0.1, 0.2, E=1e9, nu=0.3, fibres=fibres)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    scene = clamped(beam, ub.PrescribedDisplacement(beam.end, u=0, psi=ub.ramp(1.0)))
    solution = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 0.1), dt=0.01)
    assert solution.energy["hinges"][-1] > 0
    assert (solution.material(beam).jump == 0).all()
