# SPDX-License-Identifier: MIT
"""Subclasses of records: refused by name where computations would ignore what is theirs."""

from dataclasses import dataclass

import pytest
from helpers import raises, run
from scenes import clamped

import ufl_beam as ub
from ufl_beam.model.connector_laws import Law
from ufl_beam.model.loads import LOADS, Damping

CLOSED = [
    *(law for law in Law.__args__ if law is not ub.extend.ConnectorLaw), *Damping.__args__,
    *LOADS,
    *(ub.Softening, ub.LinearSoftening, ub.VirtualWork, ub.Potential, ub.Perzyna),
    *(ub.DuvautLions, ub.Table),
]  # fmt: skip
"""Classes by which terms, forms, ledger and events choose what they compute."""


@pytest.mark.parametrize("kind", CLOSED, ids=lambda kind: kind.__name__)
def test_no_subclass_is_ignored(kind):
    with raises(f"Mine: {kind.__name__} has no subclasses"):
        dataclass(frozen=True)(type("Mine", (kind,), {"__annotations__": {"more": float}}))


@dataclass(frozen=True)
class Saturating(ub.ElastoPlastic):
    """Hardening by a number of its own; linear, so that its stress is known."""

    more: float = 0.0

    def increments(self, strain, state, dt):
        f = ub.extend.law_functions
        trial = self.stress(strain, state)
        over = f.positive(f.absolute(trial) - self.yield_limit - self.more * state.accumulated)
        γ = over / (self.C + self.more)
        return {"plastic": f.sign(trial) * γ, "accumulated": γ}

    def hardening_energy(self, state):
        return self.more * state.accumulated**2 / 2


@pytest.mark.parametrize("reference", [False, True])
def test_a_subclass_of_hardening_is_followed(reference):
    """[closed] A bar of EA = 1000 beyond its limit of 1 has the slope EA H/(EA + H)."""
    section = ub.Section(EA=1e3, GA=1e3, EI=1.0, axial=Saturating(1.0, more=500.0))
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    pull = ub.PrescribedDisplacement(beam.end, u=lambda t: 0.01 * t, v=0.0, psi=0.0)
    newton = ub.Newton(reference=reference)
    found = run(clamped(beam, pull), ub.Static(), dt=0.25, newton=newton)
    force = 1.0 + 1e3 * 500 / (1e3 + 500) * (0.01 - 0.001)
    assert found.section_forces_at(beam.start)[-1, 0] == pytest.approx(force, rel=1e-9)


def test_a_hinge_of_zero_length_refuses_it():
    """Its equations are those of ElastoPlastic."""
    law, section = Saturating(1.0, more=1.0), ub.Section(EA=1, GA=1, EI=1)
    with raises("Saturating is a subclass of ElastoPlastic, and a hinge"):
        ub.Beam((0, 0), (1, 0), section, hinges={0.5: law})
    with raises("Saturating is a subclass of ElastoPlastic, and a hinge"):
        ub.RigidPlastic(law)
