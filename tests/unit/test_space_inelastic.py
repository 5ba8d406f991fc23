# SPDX-License-Identifier: MIT
"""Inelastic beams in space: equality with the plane, fibres, hinges, balances, restart."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ufl_beam as ub
import ufl_beam.structures as st

EXACT = ub.Newton(rtol=1e-13)
TURN = Rotation.from_rotvec([0.3, -0.7, 1.1])
STIFF = {"EA": 1e4, "GA": 1e4, "EI": 500.0, "rhoA": 1.0, "rhoI": 10.0}
OTHER = {"GA3": 7e3, "EI2": 300.0, "GJ": 400.0, "rhoI2": 6.0}


@dataclass(frozen=True)
class Maxwell(ub.extend.MaterialLaw):
    """A spring and a damper in series, of a user."""

    tau: float
    variables: ClassVar = {"flow": 0.0}

    def residuals(self, strain, old, new, dt):
        return {"flow": new.flow - old.flow - dt / self.tau * (strain - new.flow)}

    def stress(self, strain, state):
        return self.C * (strain - state.flow)

    def elastic_energy(self, strain, state):
        return self.C / 2 * (strain - state.flow) ** 2


def in_plane(x, y):
    return x, y


def skew(x, y):
    return tuple(TURN.apply([x, y, 0.0]))


def cantilever(section, at, *, amplitude, hinges=None, size=1.0):
    """A beam of five cells, pushed across at its end; vectors of the plane go through ``at``."""
    up = {} if at is in_plane else {"up": at(-3, 4)}
    beam = ub.Beam(at(1, 0), at(5, 3), section, cells=5, hinges=hinges or {}, **up)
    load = ub.PointLoad(beam.end, force=at(-3 * size, 4 * size), amplitude=amplitude)
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


def in_both(scheme, laws, *, end=1.0, amplitude, tolerance=1e-12, **more):
    """Run a cantilever in the plane and in a skew plane; check that motions and energies are equal.

    Residuals are solved to 1e-13 of the forces.  ``tolerance`` is relative.
    """
    section, other = (ub.Section(**STIFF, **x, **laws) for x in ({}, OTHER))
    runs = [
        ub.simulate(
            cantilever(x, at, amplitude=amplitude, **more), scheme, t=(0, end), dt=0.02,
            newton=EXACT, progress=False,
        )
        for x, at in ((section, in_plane), (other, skew))
    ]  # fmt: skip
    plane, space = (run.displacement(run.scene.beams[0].end) for run in runs)
    moved, turned = TURN.inv().apply(space[:, :3]), TURN.inv().apply(space[:, 3:])
    size = runs[0].scene.size
    assert np.abs(moved[:, :2] - plane[:, :2]).max() < tolerance * size
    assert np.abs(moved[:, 2]).max() < tolerance * size
    assert np.abs(turned - plane[:, 2:] * [[0, 0, 1]]).max() < tolerance
    one, other = (run.energy for run in runs)
    for name in one:
        if name != "loads":
            assert np.abs(one[name] - other[name]).max() < tolerance * one["loads"].max(), name
    return runs


def push(t):
    """Push, then pull."""
    return 3 * np.sin(4 * t)


RESULTANTS = {
    "bending": {"bending": ub.ElastoPlastic(8.0, isotropic=20.0, kinematic=30.0)},
    "shear": {"shear": ub.ElastoPlastic(2.0, isotropic=3e3)},
    "axial": {"axial": ub.ElastoPlastic(0.03, isotropic=1e3)},
    "three laws": {
        "bending": ub.ElastoPlastic(8.0, isotropic=20.0),
        "shear": ub.ElastoPlastic(2.0, kinematic=3e3),
        "axial": ub.ElastoPlastic(0.03, isotropic=1e3),
    },
    "two classes": {"bending": st.BoucWen(8.0, 0.1), "shear": ub.ElastoPlastic(2.0, kinematic=3e3)},
    "Perzyna": {"bending": ub.ElastoPlastic(8.0, viscosity=ub.Perzyna(eta=50.0))},
    "Duvaut-Lions": {"bending": ub.ElastoPlastic(8.0, viscosity=ub.DuvautLions(tau=0.1))},
    "Ramberg-Osgood": {"bending": st.RambergOsgood(8.0, offset=0.002, exponent=5.0)},
    "Armstrong-Frederick": {"bending": st.ArmstrongFrederick(8.0, 100.0, 10.0)},
    "Maxwell": {"bending": Maxwell(tau=0.1)},
    "hinge of the section": {"hinge": ub.LinearSoftening(8.0, fracture_energy=10.0)},
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*hinge of the section opened")
@pytest.mark.parametrize("name", RESULTANTS)
def test_laws_have_the_same_motion_in_space(name):
    runs = in_both(ub.EnergyMomentum(), RESULTANTS[name], amplitude=push)
    lost = runs[1].energy["hinges" if name.startswith("hinge") else "plastic"]
    assert lost[-1] > 1e-5 * runs[1].energy["loads"].max(), "the law yields"
    assert np.abs(runs[1].energy.imbalance).max() < 1e-12 * runs[1].energy["loads"].max()
    one, other = (run.material(run.scene.beams[0]) for run in runs)
    for field in ("jump", "plastic", "hinge"):
        a, b = getattr(one, field), getattr(other, field)
        assert np.abs(a - b).max() < 1e-11 * max(1.0, np.abs(a).max())
    lost_in_cells = np.sum(other.plastic + other.hinge)
    at_ends = [runs[1].connector(x).dissipated[-1] for x in runs[1].scene.hinges]
    assert np.isclose(lost_in_cells + sum(at_ends), lost[-1], rtol=1e-12)


@pytest.mark.parametrize(
    "scheme", [ub.EnergyMomentum(alpha=0.1), ub.Static(), ub.EnergyMomentumStatic()], ids=str
)
def test_schemes_have_the_same_motion_in_space(scheme):
    in_both(scheme, RESULTANTS["three laws"], amplitude=push, end=0.7)


@pytest.mark.parametrize(
    "law",
    [
        ub.LinearSoftening(8.0, fracture_energy=5.0),
        ub.Softening(8.0, fracture_energy=5.0),
        ub.ElastoPlastic(8.0, isotropic=5.0),
    ],
    ids=str,
)
def test_hinges_of_zero_length_have_the_same_motion_in_space(law):
    hinges = {0.0: law, 0.4: law}
    runs = in_both(ub.EnergyMomentum(), {}, amplitude=push, hinges=hinges)
    histories = [[run.connector(x) for x in run.scene.hinges] for run in runs]
    for one, other in zip(*histories, strict=True):
        for field in ("motion", "force", "dissipated"):
            a, b = getattr(one, field), getattr(other, field)
            assert np.abs(a - b).max() < 1e-11 * max(1.0, np.abs(a).max())
    assert max(np.ptp(one.motion) for one in histories[0]) > 0.01, "a hinge turns"
