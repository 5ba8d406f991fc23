# SPDX-License-Identifier: MIT
"""Numbers of small scenes with each effect are those that are stored in ``tests/data/effects``.

They are a record of an earlier state of the package, not the truth: closed forms and independent
calculations are in ``tests/verification`` and ``tests/unit``.
"""

import pytest
import stored_effects  # noqa: F401 - adds the effects
from stored_scenes import EFFECTS, SCENES, differences, numbers, stored

TOLERANCE = 1e-9
"""Largest difference, as a part of the largest motion, velocity, force or energy of a scene.

With the compiler flags -O1, -march=x86-64 and -ffp-contract numbers differed by up to 2.3e-12; with
the tolerance of Newton's method, 1e-12, reduced to 1e-13 by up to 2.5e-10, which another order of
iterations may do as well.
"""


@pytest.mark.serial  # each process would compute the same
@pytest.mark.parametrize("name", EFFECTS)
def test_numbers_are_those_that_are_stored(name):
    scenes = stored(name)
    assert len(scenes) == SCENES
    for seed, expected in enumerate(scenes):
        found = differences(numbers(*EFFECTS[name].draft(seed).run()), expected["numbers"])
        assert max(found.values()) <= TOLERANCE, {
            (seed, key): value for key, value in found.items() if value > TOLERANCE
        }
