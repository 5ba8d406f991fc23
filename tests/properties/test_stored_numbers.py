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

With the compiler flags -O1 and -march=x86-64 numbers differed by up to 1.2e-12, with changes of all
random numbers by 1e-11 by up to 1.4e-9, and with Newton's method to 1e-11 by up to 4e-9.
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
