# SPDX-License-Identifier: MIT
"""Each effect of the package has stored numbers of scenes in which it acts."""

import inspect
import sys
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path

import pytest

import ufl_beam as ub
from ufl_beam.model.connector_laws import Guide, Law
from ufl_beam.model.loads import LOADS, Damping

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS / "properties"), str(TESTS)]

import stored_effects  # noqa: E402, F401 - adds the effects
from stored_scenes import EFFECTS, FOLDER, SCENES, stored  # noqa: E402
from test_stored_numbers import TOLERANCE  # noqa: E402

ACTS = 1000 * TOLERANCE
"""Least change of the results by a number of an effect, far above what the comparison lets pass."""

OTHERS = {
    "Connector", "Joint", "Support",  # bases, from which users cannot derive
    "DynamicScheme", "Scheme", "Coefficients", "Step",  # parts of a scheme of a user
    "Scene", "Shape",  # what other records are made of
}  # fmt: skip
"""Public classes of the model and of time schemes that are no effects."""

NAMES = {"name", "depth", "shape"}
"""Fields that are for messages, pictures and section tables."""


def public_effects():
    """Public classes of models, schemes, steps and path controls, by name."""
    folders = ("model.", "mechanics.", "simulation.step_lengths", "analysis.path_controls")
    return {
        name: kind
        for name in ub.__all__
        if inspect.isclass(kind := getattr(ub, name))
        and kind.__module__.startswith(tuple(f"ufl_beam.{folder}" for folder in folders))
        and name not in OTHERS
    }


PUBLIC = public_effects()


def test_effects_of_the_unions_are_public():
    """A guide is the law of the joint `Guided`."""
    assert {*LOADS, *Damping.__args__, *Law.__args__} - {Guide} <= set(PUBLIC.values())


def effect_of(record):
    """The class of a record, of a user's class its public base, or None."""
    bases = [kind for kind in type(record).__mro__ if kind in PUBLIC.values()]
    return bases[0] if bases else None


def records_in(value, seen=None):
    """All records in a value, also those of other records and of functions of time."""
    seen = {} if seen is None else seen
    if id(value) in seen:
        return seen
    if is_dataclass(value) and not isinstance(value, type):
        seen[id(value)] = value
        for field in fields(value):
            records_in(getattr(value, field.name), seen)
    elif isinstance(value, (list, tuple)):
        for one in value:
            records_in(one, seen)
    elif isinstance(value, dict):
        records_in(list(value.values()), seen)
    elif inspect.ismethod(value):
        records_in(value.__self__, seen)
    return seen


@cache
def records_of(name):
    """Records of each of the scenes of an effect."""
    drafts = [EFFECTS[name].draft(seed) for seed in range(SCENES)]
    return [list(records_in(list(vars(draft).values())).values()) for draft in drafts]


@pytest.mark.parametrize("name", PUBLIC)
def test_each_effect_acts_in_three_scenes(name):
    """It is in the scene, and the results differ from those with another number of it."""
    own = [one for one in EFFECTS.values() if PUBLIC[name] in one.kinds]
    scenes = [
        (one.name, seed)
        for one in own
        for seed, scene in enumerate(stored(one.name))
        if max(scene["acts"]) > ACTS
        and any(
            effect_of(record) is PUBLIC[name] or type(record).__mro__[1:].count(PUBLIC[name])
            for record in records_of(one.name)[seed]
        )
    ]
    assert len(scenes) >= 3


@pytest.mark.parametrize("name", EFFECTS)
def test_each_number_of_an_effect_acts(name):
    """In one of the scenes, and in each scene at least one number."""
    acts = [scene["acts"] for scene in stored(name)]
    assert all(max(numbers) > ACTS for numbers in acts)
    most = max(len(numbers) for numbers in acts)
    idle = [k for k in range(most) if max(row[k] for row in acts if len(row) > k) <= ACTS]
    assert not idle


@cache
def values_of_fields():
    """Values of each field of each effect in all scenes, by class and name."""
    values = {}
    for name in EFFECTS:
        for record in (one for scene in records_of(name) for one in scene):
            for kind in type(record).__mro__:
                if kind in PUBLIC.values():
                    for field in fields(record):
                        key = kind.__name__, field.name
                        values.setdefault(key, []).append(getattr(record, field.name))
    return values


def options():
    """Fields with a default, and switches, of all effects."""
    for name, kind in PUBLIC.items():
        for field in fields(kind) if is_dataclass(kind) else ():
            default = field.default if field.default_factory is MISSING else field.default_factory()
            switch = any(
                isinstance(x, bool) for x in values_of_fields().get((name, field.name), ())
            )
            if field.init and field.name not in NAMES and (switch or default is not MISSING):
                yield name, field.name, default


@pytest.mark.parametrize(("name", "option", "default"), options())
def test_each_option_is_in_a_scene(name, option, default):
    """With another value than its default; of a switch without default both values."""
    values = values_of_fields().get((name, option), [])
    if default is MISSING:
        assert {True, False} <= set(values)
    else:
        assert any(not _same(value, default) for value in values)


def _same(value, default):
    return type(value) is type(default) and value == default


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_each_degree_is_in_three_scenes(degree):
    meshes = [
        record
        for name in EFFECTS
        for scene in records_of(name)
        for record in scene
        if isinstance(record, ub.Mesh) and record.degree == degree
    ]
    assert len(meshes) >= 3


def test_files_belong_to_effects_and_are_small():
    files = list(FOLDER.iterdir())
    assert {file.stem for file in files} == set(EFFECTS)
    assert sum(file.stat().st_size for file in files) < 2e6
