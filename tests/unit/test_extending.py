# SPDX-License-Identifier: MIT
"""The examples of docs/extending.md agree with the package."""

import numpy as np
import pytest
from pages import DOCS, blocks_of

import ufl_beam as ub


@pytest.mark.parametrize("reference", [False, True], ids=["compiled", "reference"])
def test_a_scheme_of_the_page_in_both_paths(reference):
    """Where things yield and open, it is the scheme of the package with the same numbers."""
    names = {"__name__": "__main__"}
    for block in blocks_of(DOCS / "extending.md")[:2]:
        exec(block, names)
    weak = ub.Section(
        EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01,
        bending=ub.ElastoPlastic(30.0, isotropic=80.0),
        hinge=ub.Softening(40.0, fracture_energy=15.0),
    )  # fmt: skip
    beam = ub.Beam((0, 0), (0, 1), weak, cells=5)
    push = ub.PointLoad(beam.end, force=(900.0, 0.0), amplitude=ub.ramp(0.1))
    spring = ub.Stretch(ub.ground(1, 1), beam.end, ub.Spring(3e3, law=ub.ElastoPlastic(40.0)))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push], connectors=[spring])
    newton = ub.Newton(rtol=1e-12, reference=reference)
    mine, known = (
        ub.simulate(scene, scheme, t=(0, 0.1), dt=2e-3, newton=newton)
        for scheme in (names["Weighted"](0.6), ub.EnergyMomentum(alpha=0.1, beta=0.1))
    )
    assert min(known.energy.lost[name][-1] for name in ("plastic", "hinges", "numerical")) > 1e-3
    assert mine.parts == known.parts
    # The same numbers in another order.
    assert np.allclose(mine.q, known.q, rtol=0, atol=1e-9 * np.abs(known.q).max())
    for name, lost in known.energy.lost.items():
        assert np.allclose(mine.energy.lost[name], lost, rtol=1e-8, atol=1e-9)
