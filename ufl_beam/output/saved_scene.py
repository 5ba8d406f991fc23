# SPDX-License-Identifier: MIT
"""Scenes as JSON data: each record with the exact numbers that made it.

Functions of a user are no data.  Those of time are saved by their values at the times of a
solution, curves by many points; of others the name is left.  Of laws and other records of a user
numbers and the name of the class are saved, to be compared with a scene that the user has built.
"""

from __future__ import annotations

import dataclasses
import warnings
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, NoReturn, TypeVar

import numpy as np
from scipy.interpolate import KroghInterpolator

from ufl_beam.errors import ModelWarning, SceneError
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.connector_laws import HELD
from ufl_beam.model.curves import Point
from ufl_beam.model.supports import still
from ufl_beam.model.time_functions import steady

T = TypeVar("T")
Data = Any  # data of JSON
Sampling = Callable[[Any, str, Any], Any]  # from record, field and function what stands for it
SAMPLES = 1000  # intervals in which a curve is sampled


@dataclasses.dataclass(frozen=True)
class SavedFunction:
    """Function of time that is known at some times."""

    name: str  # that of the function
    times: tuple[float, ...]  # ascending; s
    values: tuple[float, ...]  # one for each time

    @classmethod
    def of(cls, function: Callable[[float], float], times: Iterable[float]) -> SavedFunction:
        """Sample a function, at 0 as well; where it fails it is not known."""
        known = _sampled(lambda t: float(function(t)), {0.0, *times})
        return cls(name_of(function), tuple(known), tuple(known.values()))

    def __call__(self, t: float) -> float:
        """The value at one of the times, or :class:`SceneError` at others."""
        n = bisect_left(self.times, t)
        if n == len(self.times) or self.times[n] != t:
            raise SceneError(
                f"the function {self.name} is not known at t = {t:g}: a file of a solution has "
                "the values of functions at its times only; load it with your own scene, which has "
                "the function: ub.load(path, scene=scene)"
            )
        return self.values[n]


@dataclasses.dataclass(frozen=True)
class SavedCurve:
    """Curve through saved points, cubic between them and straight beyond."""

    name: str  # that of the function
    s: tuple[float, ...]  # ascending parameters, at least two
    points: tuple[Point, ...]  # one for each; m

    @classmethod
    def of(
        cls, curve: Callable[[float], Any], first: float, last: float, more: Iterable[float] = ()
    ) -> SavedCurve:
        """Sample a curve between two parameters, and at more of them; gaps where it fails."""
        even = (first + (last - first) * k / SAMPLES for k in range(SAMPLES + 1))

        def point(s: float) -> Point:
            x, y = curve(s)
            return float(x), float(y)

        known = _sampled(point, {*even, *more})
        return cls(name_of(curve), tuple(known), tuple(known.values()))

    def __call__(self, s: float) -> Point:
        """The point at a parameter; exact where it was sampled."""
        n = bisect_left(self.s, s)
        if n < len(self.s) and self.s[n] == s:
            return self.points[n]
        count = 4 if 0 < n < len(self.s) else 2
        first = max(min(n - count // 2, len(self.s) - count), 0)
        near = slice(first, first + count)
        x, y = KroghInterpolator(self.s[near], self.points[near])(s)
        return float(x), float(y)


@dataclasses.dataclass(frozen=True)
class LostFunction:
    """Placeholder of a function that cannot be saved, such as a controller."""

    name: str  # that of the function

    def __call__(self, *arguments: object, **named: object) -> NoReturn:
        """Raise :class:`SceneError`, as the function is not there."""
        raise SceneError(
            f"the function {self.name} is not in the file of the solution, which has results and "
            "numbers; build the scene with the function to simulate it"
        )


def _sampled(function: Callable[[float], T], at: Iterable[float]) -> dict[float, T]:
    """Values of a function in ascending order, without those at which it fails."""
    known = {}
    for x in sorted(at):
        try:
            known[x] = function(x)
        except Exception:
            continue
    return known


def name_of(function: Any) -> str:
    """Return the name of a function, or of the class of a callable object."""
    return str(getattr(function, "__qualname__", type(function).__qualname__))


MODEL = import_module("ufl_beam.model").__path__
# Classes of records, by name
RECORDS: dict[str, type] = {
    name: kind
    for module in iter_modules(MODEL, "ufl_beam.model.")
    for name, kind in vars(import_module(module.name)).items()
    if isinstance(kind, type) and dataclasses.is_dataclass(kind)
}
RECORDS |= {kind.__name__: kind for kind in (SavedFunction, SavedCurve, LostFunction)}
# Objects that all scenes share
KNOWN: dict[str, Any] = {"GROUND": GROUND, "HELD": HELD, "steady": steady, "still": still}


def lost(owner: Any, field: str, function: Any) -> LostFunction:
    """Replace a function by its name."""
    return LostFunction(name_of(function))


def to_data(value: Any, sampling: Sampling = lost) -> Data:
    """Describe a scene or another record as data; ``sampling`` replaces functions of a user."""
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
        for name, known in KNOWN.items():
            if value is known:
                return {"known": name}
        if id(value) not in numbers:
            record = value
            if RECORDS.get(type(value).__name__) is not type(value):
                if callable(value):
                    record = sampling(owner, field, value)
                elif not dataclasses.is_dataclass(value):
                    raise SceneError(
                        f"{value!r} cannot be saved: {type(value).__name__} is no record of "
                        "numbers and names; make it a dataclass"
                    )
            content = {
                f.name: describe(getattr(record, f.name), record, f.name)
                for f in dataclasses.fields(record)
                if f.init
            }
            numbers[id(value)] = len(records), value
            kind = type(record)
            if RECORDS.get(kind.__name__) is not kind:
                content["from"] = kind.__module__
            records.append({"is": kind.__qualname__, **content})
        return {"record": numbers[id(value)][0]}

    root = describe(value, None, "")
    return {"records": records, "root": root}


def require_no_code(data: Data) -> None:
    """Raise :class:`SceneError` if a scene has records of classes that the package has not."""
    for record in data["records"]:
        if "from" in record:
            kind = f"the class {record['is']} of your own (module {record['from']})"
            raise SceneError(
                f"the scene has {kind}, and files have no code; load it with the scene of the "
                "script, ub.load(path, scene=scene)"
            )


def from_data(data: Data) -> Any:
    """Rebuild the records that :func:`to_data` described, without repeating warnings."""
    require_no_code(data)
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
