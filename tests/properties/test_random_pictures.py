# SPDX-License-Identifier: MIT
"""Pictures of random machines: no failure, and every object leaves something."""

import dataclasses

import numpy as np
import pytest
from random_machines import script
from scene_statements import PARTS

import ufl_beam as ub
from ufl_beam.plotting.model import Drawing, model_notes, scene_load_caption
from ufl_beam.plotting.positions import Canvas

pytestmark = pytest.mark.filterwarnings("ignore:.*are of no material")


def machine(seed):
    names = {}
    exec(script(seed), names)
    return names["scene"]


def amount(scene):
    """Number of strokes, labels and words of a picture; and whether all numbers are finite."""
    drawing = Drawing(Canvas.at_scale(scene, 1.0, scene.size / 300.0))
    strokes = [stroke for group in drawing.strokes.values() for stroke in group]
    assert all(np.isfinite(stroke.points).all() for stroke in strokes)
    labels = sum(map(len, drawing.labels.values()))
    whole = [load for load in scene.loads if any(scene_load_caption(load))]
    return len(strokes) + labels + len(whole) + len(model_notes(scene))


@pytest.mark.parametrize("seed", range(25))
def test_every_object_leaves_something(seed):
    scene = machine(seed)
    everything = amount(scene)
    for part in PARTS[2:]:  # beside beams and bodies
        objects = getattr(scene, part)
        for one in objects:
            others = [other for other in objects if other is not one]
            assert amount(dataclasses.replace(scene, **{part: others})) < everything, one


@pytest.mark.parametrize("seed", range(100, 104))
def test_random_machines_are_drawn(seed):
    figure = ub.plot(machine(seed))
    figure.draw_without_rendering()
    assert figure.axes[0].collections
