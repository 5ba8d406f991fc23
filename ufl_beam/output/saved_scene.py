# SPDX-License-Identifier: MIT
"""Scenes as JSON data: each record with the exact numbers that made it.

Functions of a user are no data.  Those of time are saved by their values at the times of a
solution, curves by many points; of others the name is left.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping
from fractions import Fraction
from types import ModuleType
from typing import Any

import numpy as np

from ufl_beam.errors import ModelWarning, SceneError
from ufl_beam.model import (
    beams,
    bodies,
    connector_laws,
    connectors,
    curves,
    damping,
    distributions,
    fibres,
    joints,
    loads,
    masses,
    material_laws,
    mesh_options,
    scene,
    sections,
    supports,
    time_functions,
)
from ufl_beam.output import saved_functions
from ufl_beam.output.saved_functions import LostFunction

Data = Any  # data of JSON

Sampling = Callable[[Any, str, Any], Any]
"""Record that stands for a function, given the record and the field that it is in."""

MODULES: tuple[ModuleType, ...] = (
    *(beams, bodies, connector_laws, connectors, curves, damping, distributions, fibres),
    *(joints, loads, masses, material_laws, mesh_options, saved_functions, scene, sections),
    *(supports, time_functions),
)

RECORDS: dict[str, type] = {
    name: kind
    for module in MODULES
    for name, kind in vars(module).items()
    if isinstance(kind, type) and dataclasses.is_dataclass(kind)
}
"""Classes of records, by name."""

KNOWN: dict[str, Any] = {
    "GROUND": bodies.GROUND,
    "HELD": connector_laws.HELD,
    "steady": time_functions.steady,
    "still": supports.still,
}
"""Objects that all scenes share."""


def lost(owner: Any, field: str, function: Any) -> LostFunction:
    """Replace a function by its name."""
    return LostFunction(saved_functions.name_of(function))


def to_data(value: Any, sampling: Sampling = lost) -> Data:
    """Describe a scene, or another record, with a sampling of the functions of a user."""
    records: list[Data] = []
    # By identity; the objects are kept, so that none gets the identity of another.
    numbers: dict[int, tuple[int, Any]] = {}

    def describe(value: Any, owner: Any, field: str) -> Data:
        if isinstance(value, np.generic):
            value = value.item()
        if value is None or isinstance(value, bool | str | int | float):
            return value
        if isinstance(value, Fraction):
            return {"fraction": str(value)}
        if isinstance(value, np.ndarray):
            return {"array": value.tolist()}
        if isinstance(value, tuple | list):
            return [describe(one, owner, field) for one in value]
        if isinstance(value, Mapping):
            pairs = [[describe(x, owner, field) for x in pair] for pair in value.items()]
            return {"mapping": pairs}
        for name in (name for name, known in KNOWN.items() if value is known):
            return {"known": name}
        if id(value) not in numbers:
            record = value
            if RECORDS.get(type(value).__name__) is not type(value):
                if not callable(value):
                    raise SceneError(
                        f"{value!r} cannot be saved: {type(value).__name__} is no record of "
                        "ufl_beam, which are numbers and names"
                    )
                record = sampling(owner, field, value)
            content = {
                f.name: describe(getattr(record, f.name), record, f.name)
                for f in dataclasses.fields(record)
                if f.init
            }
            numbers[id(value)] = len(records), value
            records.append({"is": type(record).__name__, **content})
        return {"record": numbers[id(value)][0]}

    root = describe(value, None, "")
    return {"records": records, "root": root}


def from_data(data: Data) -> Any:
    """Rebuild the records that :func:`to_data` described, without repeating warnings."""
    made: list[Any] = []

    def make(data: Data) -> Any:
        if isinstance(data, list):
            return tuple(map(make, data))
        if not isinstance(data, dict):
            return data
        ((kind, content),) = data.items()
        return makers[kind](content)

    makers: dict[str, Callable[[Any], Any]] = {
        "fraction": Fraction, "array": np.array, "known": KNOWN.__getitem__,
        "record": made.__getitem__, "mapping": lambda pairs: dict(map(make, pairs)),
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        for record in data["records"]:
            fields = {name: make(value) for name, value in record.items() if name != "is"}
            made.append(RECORDS[record["is"]](**fields))
    return make(data["root"])
