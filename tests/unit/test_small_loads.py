# SPDX-License-Identifier: MIT
"""Loads of any size and units of any size: runs end, and answers are those of unit loads."""

import math

from mpi4py import MPI

import numpy as np
import pytest
from scenes import clamped

import ufl_beam as ub

E = 1e9  # stiffness of a beam of 3 m that a spring of 2e9 N m/rad holds, and loads of 1 N


def braced(force, unit=1.0, *, lean=1, time=lambda t: t, rhoA=0.0):
    """A post on a spring, inclined or not, and a second beam that a measured joint carries."""
    section = ub.Section(EA=2.5 * E * unit, GA=0.5 * E * unit, EI=0.06 * E * unit, rhoA=rhoA * unit)
    post = ub.Beam((0, 0), (lean, 3), section, cells=4)
    arm = ub.Beam((lean, 3), (lean + 2, 3), section, cells=2)
    ground = ub.ground(0, 0)
    return ub.Scene(
        [post, arm],
        joints=[ub.Revolute(ground, post.start), ub.Rigid(post.end, arm.start, multipliers=True)],
        connectors=[
            ub.Turn(ground, post.start, ub.Spring(2 * E * unit)),
            ub.Stretch(ub.ground(2, 0), arm.end, ub.Spring(0.01 * E * unit)),
        ],
        loads=[ub.PointLoad(arm.end, force=(force * unit, 0), amplitude=time)],
    )


def ends(scene, scheme):
    run = ub.simulate(scene, scheme, t=(0, 1), dt=0.25)
    assert run.substeps == 4
    return run.displacement(scene.beams[1].end)[-1]


@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.5)], ids=str
)
def test_static_loads_down_to_nothing(scheme):
    """Displacements are in proportion to loads from 1e-6 N, u/L of some 1e-14, to 1e-290 N.

    A linear problem has some 1e-9 after its conditioning.
    """
    unit = ends(braced(1e-6), scheme) / 1e-6
    assert np.abs(unit).max() > 1e-10
    for force in (1e-12, 1e-157, 1e-290):
        found = ends(braced(force), scheme) / force
        assert found == pytest.approx(unit, rel=1e-7)
    # Displacements of some 1e-318 m have five digits, those below 5e-324 m are zero.
    assert ends(braced(1e-308), scheme) / 1e-308 == pytest.approx(unit, rel=1e-3, abs=1e-12)
    for force in (1e-322, 0.0):
        assert np.isfinite(ends(braced(force), scheme)).all()


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()], ids=str)
def test_units_of_any_size(scheme):
    """Stiffness and loads of any unit: the same motion, to the digits of its factors."""
    unit = ends(braced(1e4), scheme)
    # On several processes PETSc's own Newton method squares the residual.
    power = 280 if MPI.COMM_WORLD.size == 1 else 140
    for size in (10.0**power, 10.0**-power):
        assert ends(braced(1e4, size), scheme) == pytest.approx(unit, rel=1e-7)


def test_an_elastic_strain_keeps_its_digits():
    """The axial strain of an inclined bar, N/EA, for forces far below the last digit of one."""
    along = np.array([3.0, 4.0]) / 5
    bar = ub.Beam((0, 0), (3, 4), ub.Section(EA=E, GA=E, EI=E), cells=3)
    for force in (1.0, 1e-12, 1e-100):
        load = ub.PointLoad(bar.end, force=tuple(force * along))
        run = ub.simulate(clamped(bar, loads=[load]), ub.Static(), t=(0, 1), dt=1)
        # Linear but for strains of 1e-9
        assert run.section_forces(bar)[:, 0] == pytest.approx([force] * 3, rel=1e-8)


@pytest.mark.parametrize("lean", [0, 1])
def test_a_motion_comes_to_rest(lean):
    """In steps without a cut, from 1e-157 m, whose square is nothing, to less than 1e-300 m."""
    scene = braced(1e4, lean=lean, time=lambda t: float(t < 0.1), rhoA=100.0)
    run = ub.simulate(scene, ub.EnergyMomentum(0.45, 0.45), t=(0, 12), dt=0.01)
    assert run.substeps == 1200
    largest = np.abs(run.displacement(scene.beams[1].end)).max(axis=1)
    assert np.isfinite(largest).all()
    assert largest[-1] < 1e-300
    assert ((largest > 1e-200) & (largest < 1e-157)).any()


@pytest.mark.parametrize("force", [1e4, 2.0, 1e-200])
def test_a_path_of_a_small_load(force):
    """Of a post on a spring; no state is critical, and the path is that of statics."""
    scene = braced(force, lean=0)
    path = ub.follow(scene, ub.LoadControl(0.05), steps=20)
    assert path.critical == []
    assert path.times[-1] == pytest.approx(1.0)
    end = path.displacement(scene.beams[1].end)[-1]
    assert end == pytest.approx(ends(scene, ub.Static()), rel=1e-7)


@pytest.mark.parametrize("size", [1e-3, 1e-20, 1e-200])
def test_small_motions_of_a_drive(size):
    """Angles and distances of any size are followed, not taken for none."""
    section = ub.Section(EA=E, GA=E, EI=E)
    law = ub.PrescribedMotion(lambda t: size * t)
    beam, ground = ub.Beam((0, 0), (2, 1), section, cells=2), ub.ground(0, 0)
    motor, jack = ub.Turn(ground, beam.start, law), ub.Stretch(ub.ground(2, 0), beam.end, law)
    scene = ub.Scene([beam], joints=[ub.Revolute(ground, beam.start)], connectors=[motor])
    run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    assert run.displacement(beam.end)[-1, 2] == pytest.approx(size, rel=1e-9)
    run = ub.simulate(clamped(beam, connectors=[jack]), ub.Static(), t=(0, 1), dt=0.5)
    # The jack stands upright; turning it matters to the square of the motion over its length.
    assert run.connector(jack).motion[-1] == pytest.approx(size, rel=1e-9)
    assert run.displacement(beam.end)[-1, 1] == pytest.approx(size, rel=1e-2)


@pytest.mark.parametrize("part", [0.5, 0.9])
def test_a_small_load_beside_a_large_one(part):
    """A column under a part of its critical load magnifies a lateral load of 4e-10 of that.

    Refined steps are the reference, which do not guess so well; a guess that just meets the
    tolerance of 1e-10 of all forces would leave a fifth of the deflection.
    """
    section = ub.Section(EA=1e8, GA=1e8, EI=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=8)
    push = ub.PointLoad(beam.end, force=(-part * math.pi**2 / 4, 0), amplitude=ub.ramp(1.0))
    side = ub.PointLoad(beam.end, force=(0, 1e-9), amplitude=ub.ramp(1.0))
    scene = clamped(beam, loads=[push, side])
    found, expected = (
        ub.simulate(scene, ub.Static(), t=(0, 1), dt=dt, newton=newton)
        for dt, newton in ((0.1, None), (1.0, ub.Newton(rtol=1e-15)))
    )
    deflections = [one.displacement(beam.end)[-1, 1] for one in (found, expected)]
    assert deflections[0] == pytest.approx(deflections[1], rel=1e-5)
