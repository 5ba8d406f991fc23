# SPDX-License-Identifier: MIT
"""Numbers of small scenes with each effect are those that are stored in ``tests/data/effects``.

They are a record, not the truth: see ``tests/verification`` and ``tests/unit`` for closed forms.
"""

import pytest
import stored_effects  # noqa: F401 - adds the effects
from stored_scenes import EFFECTS, SCENES, differences, numbers, stored

TOLERANCE = 1e-9
"""Largest difference, over the largest motion, velocity, force or energy of a scene: flags of the
compiler make up to 2.3e-12, a tolerance of Newton's method of 1e-13 up to 2.5e-10."""


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
